//! Motions: both images with their matches and horizons, and both laid on the floor.

mod matches;
mod overlay;

use groundcal::result::Calibration;

use crate::{
    canvas::{Mark, Shape, svg::escape},
    html::{
        markup::{fixed, symbol, wide_symbol, with_sigma},
        model::{Model, motions::Motion},
        pictures::Pictures,
    },
    number::coordinate,
};

/// Motions of which the images are drawn.
const DRAWN: usize = 24;

/// The thumbnails, once for all places where they are drawn.
pub(crate) fn definitions(pictures: &Pictures) -> String {
    if pictures.thumbnails.is_empty() {
        return String::new();
    }
    let mut out = String::from("<svg class=\"defs\" width=\"0\" height=\"0\" aria-hidden=\"true\"><defs>");
    for (i, p) in pictures.thumbnails.iter().enumerate() {
        let width = matches::WIDTH;
        out.push_str(&format!(
            "<image id=\"im{i}\" width=\"{width}\" height=\"{}\" preserveAspectRatio=\"none\" href=\"{}\"/>",
            coordinate(width * p.size[1] as f64 / p.size[0] as f64),
            p.uri
        ));
    }
    out.push_str("</defs></svg>\n");
    out
}

/// All motions, one after another.
pub(crate) fn section(model: &Model, c: &Calibration, pictures: &Pictures) -> String {
    let mut out = legend();
    if model.motions.iter().any(|m| m.lost + m.rejected > 0) {
        out.push_str(
            "<p class=\"controls\"><label><input type=\"checkbox\" checked data-layer=\"accepted\"> accepted</label> \
             <label><input type=\"checkbox\" checked data-layer=\"rejected\"> rejected and not found</label> \
             <label><input type=\"checkbox\" checked data-layer=\"numbers\"> numbers</label></p>\n",
        );
    }
    for (i, m) in model.motions.iter().enumerate().take(DRAWN) {
        out.push_str(&motion(i, m, c, pictures));
    }
    if model.motions.len() > DRAWN {
        let all = model.motions.len();
        out.push_str(&format!("<p>The first {DRAWN} of {all} motions are drawn; all are in the tables.</p>"));
    }
    out
}

fn legend() -> String {
    let middle = [7.0, 7.0];
    format!(
        "<p class=\"legend\">{} accepted {} rejected {} patch not found again {} horizon {} most matches here are rejected: a thing that \
         stands on the floor, or moved. The same number marks the same point of the floor.</p>\n",
        symbol("accepted", &Shape::Marks(Mark::Dot, vec![middle])),
        symbol("rejected", &Shape::Marks(Mark::Cross(8.0), vec![middle])),
        symbol("lost", &Shape::Marks(Mark::Square(8.0), vec![middle])),
        wide_symbol("sky", &Shape::polyline(vec![[1.0, 7.0], [23.0, 7.0]])),
        wide_symbol("cluster", &Shape::Rectangle([1.0, 1.0], [22.0, 12.0])),
    )
}

fn motion(index: usize, m: &Motion, c: &Calibration, pictures: &Pictures) -> String {
    let mut out = format!(
        "<article class=\"motion{}\" id=\"motion{index}\">\n<h3>{} \u{2192} {}</h3>\n<p>{}.</p>\n",
        if m.used { "" } else { " unused" },
        escape(&m.from),
        escape(&m.to),
        facts(m, c).join("; ")
    );
    if !m.used {
        let reason = m.reason.as_deref().unwrap_or("no reason is known");
        out.push_str(&format!("<p class=\"note\"><strong>Not used:</strong> {}.</p>\n", escape(reason)));
    }
    if let Some(attention) = &m.attention {
        out.push_str(&format!("<p class=\"note\"><strong>Does not fit:</strong> {}.</p>\n", escape(attention)));
    }
    let p = &c.evidence.pairs[m.pair];
    if !p.matches.is_empty() || !pictures.thumbnails.is_empty() {
        out.push_str(&matches::both(m, c, p, pictures));
    }
    if let Some(laid) = &m.overlay {
        match pictures.overlays.get(index) {
            Some(Some(pair)) => out.push_str(&overlay::pictures(index, m, laid, pair, c)),
            _ if pictures.thumbnails.is_empty() => out.push_str(&overlay::points(m, laid, c, p)),
            _ => {}
        }
    }
    out.push_str("</article>\n");
    out
}

/// What is known of it, in a few words each.
fn facts(m: &Motion, c: &Calibration) -> Vec<String> {
    let report = &c.motions[m.pair];
    let counts =
        format!("{} matches accepted, {} rejected, {} patches not found again", m.accepted, m.rejected, m.lost);
    [
        m.rotation_deg.map(|turn| format!("turn {}\u{b0}", with_sigma(turn, report.rotation_sigma_deg))),
        m.height_ratio.map(|ratio| format!("height ratio {}", with_sigma(ratio, report.height_ratio_sigma))),
        Some(counts),
        m.rms_px.map(|rms| format!("{} px rms about its own homography", fixed(rms, 3))),
        m.joint_rms_px.map(|rms| format!("{} px rms about the camera of all motions", fixed(rms, 3))),
        m.apart_deg.map(|apart| format!("attitudes of its views {}\u{b0} apart", fixed(apart, 3))),
    ]
    .into_iter()
    .flatten()
    .collect()
}
