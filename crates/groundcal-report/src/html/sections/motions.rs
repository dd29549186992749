//! Motions: both images with their matches and horizons, and both laid on the floor.

use std::fmt::Write;

use groundcal::result::{Calibration, evidence::PairEvidence};

use crate::html::sections::{figure, with_sigma};
use crate::html::{
    model::{
        Model,
        conic::horizon,
        motions::{Motion, Overlay},
    },
    pictures::{Picture, Pictures},
    svg::{Anchor, Scale, Svg, escape, fixed, path_of, short},
};

/// Motions of which the images are drawn.
const DRAWN: usize = 24;
/// Matches drawn of each kind in an image.
const MATCHES: usize = 2500;
/// Numbered matches, the same number in both images.
const LANDMARKS: usize = 8;
/// Width of a drawn image in the drawing's units.
const WIDTH: f64 = 640.0;
/// Units of the drawing to a pixel of an overlay, and page pixels to one of them.
const ZOOM: f64 = 1.25;
const OVERLAY_SCALE: f64 = 1.1;
/// A horizon this far outside the image, in image heights, is still drawn.
const OUTSIDE: f64 = 0.4;

/// The thumbnails, once for all places where they are drawn.
pub fn definitions(pictures: &Pictures) -> String {
    if pictures.thumbnails.is_empty() {
        return String::new();
    }
    let mut out = String::from("<svg class=\"defs\" width=\"0\" height=\"0\" aria-hidden=\"true\"><defs>");
    for (i, p) in pictures.thumbnails.iter().enumerate() {
        let height = WIDTH * p.size[1] as f64 / p.size[0] as f64;
        let _ = write!(
            out,
            "<image id=\"im{i}\" width=\"{WIDTH}\" height=\"{}\" preserveAspectRatio=\"none\" href=\"{}\"/>",
            short(height),
            p.uri
        );
    }
    out.push_str("</defs></svg>\n");
    out
}

pub fn section(model: &Model, c: &Calibration, pictures: &Pictures) -> String {
    let mut out = String::from(
        "<p class=\"legend\"><svg viewBox=\"0 0 14 14\" aria-hidden=\"true\"><path class=\"accepted\" d=\"M7 7h0\"/></svg> accepted <svg viewBox=\"0 0 14 14\" aria-hidden=\"true\"><path class=\"rejected\" d=\"M3 3L11 11M3 11L11 3\"/></svg> rejected \
         <svg viewBox=\"0 0 14 14\" aria-hidden=\"true\"><path class=\"lost\" d=\"M3 3H11V11H3Z\"/></svg> patch not found again \
         <svg viewBox=\"0 0 24 14\" class=\"wide\" aria-hidden=\"true\"><path class=\"sky\" d=\"M1 7H23\"/></svg> horizon \
         <svg viewBox=\"0 0 24 14\" class=\"wide\" aria-hidden=\"true\"><rect class=\"cluster\" x=\"1\" y=\"1\" width=\"22\" height=\"12\"/></svg> \
         most matches here are rejected: a thing that stands on the floor, or moved. The same number marks the same point of the floor.</p>\n",
    );
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
        let _ = write!(
            out,
            "<p>The first {DRAWN} of {} motions are drawn; all are in the tables.</p>",
            model.motions.len()
        );
    }
    out
}

fn motion(index: usize, m: &Motion, c: &Calibration, pictures: &Pictures) -> String {
    let report = &c.motions[m.pair];
    let mut facts: Vec<String> = Vec::new();
    if let Some(turn) = m.rotation_deg {
        facts.push(format!("turn {}\u{b0}", with_sigma(turn, report.rotation_sigma_deg)));
    }
    if let Some(rho) = m.rho {
        facts.push(format!("height ratio {}", with_sigma(rho, report.rho_sigma)));
    }
    facts.push(format!("{} matches accepted, {} rejected, {} patches not found again", m.accepted, m.rejected, m.lost));
    if let Some(rms) = m.rms_px {
        facts.push(format!("{} px rms about its own homography", fixed(rms, 3)));
    }
    if let Some(rms) = m.joint_rms_px {
        facts.push(format!("{} px rms about the camera of all motions", fixed(rms, 3)));
    }
    if let Some(apart) = m.apart_deg {
        facts.push(format!("attitudes of its views {}\u{b0} apart", fixed(apart, 3)));
    }
    let mut out = format!(
        "<article class=\"motion{}\" id=\"motion{index}\">\n<h3>{} \u{2192} {}</h3>\n<p>{}.</p>\n",
        if m.used { "" } else { " unused" },
        escape(&m.from),
        escape(&m.to),
        facts.join("; ")
    );
    if !m.used {
        let reason = m.reason.as_deref().unwrap_or("no reason is known");
        let _ = writeln!(out, "<p class=\"note\"><strong>Not used:</strong> {}.</p>", escape(reason));
    }
    if let Some(attention) = &m.attention {
        let _ = writeln!(out, "<p class=\"note\"><strong>Does not fit:</strong> {}.</p>", escape(attention));
    }
    let p = &c.evidence.pairs[m.pair];
    if !p.matches.is_empty() || !pictures.thumbnails.is_empty() {
        let landmarks = landmarks(p, c.camera.image_size);
        out.push_str("<div class=\"figures\">\n");
        for which in 0..2 {
            out.push_str(&image(m, c, p, which, pictures, &landmarks));
        }
        out.push_str("</div>\n");
    }
    if let Some(overlay) = &m.overlay {
        match pictures.overlays.get(index) {
            Some(Some(pair)) => out.push_str(&floor(index, m, overlay, pair, c)),
            _ if pictures.thumbnails.is_empty() => out.push_str(&floor_points(m, overlay, c, p)),
            _ => {}
        }
    }
    out.push_str("</article>\n");
    out
}

/// Accepted matches far from one another, and from the borders, where their numbers would be cut off.
fn landmarks(p: &PairEvidence, [width, height]: [usize; 2]) -> Vec<usize> {
    const ROOM: f64 = 0.07;
    let inside = |[x, y]: [f64; 2]| {
        let (u, v) = (x / width as f64, y / height as f64);
        (ROOM..=1.0 - ROOM).contains(&u) && (ROOM..=1.0 - ROOM).contains(&v)
    };
    let shown = |k: &usize| p.matches[*k].accepted && inside(p.matches[*k].a) && inside(p.matches[*k].b);
    let accepted: Vec<usize> = (0..p.matches.len()).filter(shown).collect();
    let mut chosen: Vec<usize> = Vec::new();
    let mut distance = vec![f64::INFINITY; accepted.len()];
    while chosen.len() < LANDMARKS.min(accepted.len()) {
        let next = match chosen.last() {
            None => 0,
            Some(_) => (0..accepted.len()).max_by(|a, b| distance[*a].total_cmp(&distance[*b])).unwrap_or(0),
        };
        let at = p.matches[accepted[next]].a;
        for (d, &k) in distance.iter_mut().zip(&accepted) {
            let [x, y] = p.matches[k].a;
            *d = d.min((x - at[0]).hypot(y - at[1]));
        }
        chosen.push(accepted[next]);
    }
    chosen
}

/// A path of one mark at each point; every so many of them, where there are too many.
fn marks(points: &[[f64; 2]], mark: impl Fn(&mut String, [f64; 2])) -> String {
    let stride = points.len().div_ceil(MATCHES).max(1);
    let mut d = String::new();
    for p in points.iter().step_by(stride) {
        mark(&mut d, *p);
    }
    d
}

fn dot(d: &mut String, [x, y]: [f64; 2]) {
    let _ = write!(d, "M{} {}h0", short(x), short(y));
}

fn cross(d: &mut String, [x, y]: [f64; 2]) {
    let _ = write!(d, "M{} {}l7 7m-7 0l7-7", short(x - 3.5), short(y - 3.5));
}

fn square(d: &mut String, [x, y]: [f64; 2]) {
    let _ = write!(d, "M{} {}h8v8h-8Z", short(x - 4.0), short(y - 4.0));
}

fn image(
    m: &Motion,
    c: &Calibration,
    p: &PairEvidence,
    which: usize,
    pictures: &Pictures,
    landmarks: &[usize],
) -> String {
    let number = m.images[which];
    let name = if which == 0 { &m.from } else { &m.to };
    let [w, h] = c.camera.image_size.map(|s| s as f64);
    let scale = WIDTH / w;
    let height = h * scale;
    let at = |[x, y]: [f64; 2]| [(x + 0.5) * scale, (y + 0.5) * scale];
    let pose = pose_of(c, name, m);
    let room = OUTSIDE * h;
    let pieces = pose.map_or(Vec::new(), |[pitch, roll]| horizon(c, pitch, roll, [-room, -room, w + room, h + room]));
    // The drawing reaches as far as the horizon outside the image, if that is not far.
    let reach =
        |f: fn(f64, f64) -> f64, i: usize, start: f64| pieces.iter().flatten().map(|q| at(*q)[i]).fold(start, f);
    let crosses = pieces.iter().flatten().any(|[x, y]| (0.0..w).contains(x) || (0.0..h).contains(y));
    let (left, top, right, bottom) = if crosses {
        (
            reach(f64::min, 0, 0.0).max(-0.12 * WIDTH),
            reach(f64::min, 1, 0.0),
            reach(f64::max, 0, WIDTH).min(1.12 * WIDTH),
            reach(f64::max, 1, height),
        )
    } else {
        (0.0, 0.0, WIDTH, height)
    };
    let margin = 2.0;
    let view_box = [left - margin, top - margin, right - left + 2.0 * margin, bottom - top + 2.0 * margin];
    let mut svg = Svg::new(view_box, "picture", &format!("{name} with its matches"));
    if pictures.thumbnails.is_empty() {
        svg.rect("blank", [0.0, 0.0], [WIDTH, height]);
    } else {
        svg.raw(&format!("<use href=\"#im{number}\"/>"));
        svg.rect("border", [0.0, 0.0], [WIDTH, height]);
    }
    let side = |k: &groundcal::result::evidence::MatchEvidence| at(if which == 0 { k.a } else { k.b });
    let of =
        |accepted: bool| -> Vec<[f64; 2]> { p.matches.iter().filter(|k| k.accepted == accepted).map(side).collect() };
    let d = marks(&of(true), dot);
    if !d.is_empty() {
        svg.raw("<g data-layer=\"accepted\">").path("accepted halo", &d).path("accepted", &d).raw("</g>");
    }
    let rejected = marks(&of(false), cross);
    let lost: Vec<[f64; 2]> = if which == 0 { p.lost_patches.iter().map(|q| at(*q)).collect() } else { Vec::new() };
    let lost = marks(&lost, square);
    svg.raw("<g data-layer=\"rejected\">");
    svg.path("lost", &lost).path("rejected halo", &rejected).path("rejected", &rejected);
    if which == 0 {
        for cluster in &m.clusters {
            let [l, t, r, b] = cluster.box_px;
            let ([l, t], [r, b]) = (at([l, t]), at([r, b]));
            svg.rect("cluster halo", [l, t], [r - l, b - t]).rect("cluster", [l, t], [r - l, b - t]);
            svg.text("mark small", [l + 3.0, t + 14.0], Anchor::Start, &format!("{} rejected", cluster.rejected));
        }
    }
    svg.raw("</g>");
    for piece in &pieces {
        let line: Vec<[f64; 2]> = piece.iter().map(|q| at(*q)).collect();
        svg.polyline("sky halo", &line, false).polyline("sky", &line, false);
    }
    svg.raw("<g data-layer=\"numbers\">");
    for (n, &k) in landmarks.iter().enumerate() {
        let [x, y] = side(&p.matches[k]);
        svg.circle("landmark", [x, y], 5.0);
        svg.text("mark", [x + 7.0, y - 6.0], Anchor::Start, &(n + 1).to_string());
    }
    svg.raw("</g>");
    if !crosses && let Some([pitch, roll]) = pose {
        svg.text("mark", [8.0, height - 10.0], Anchor::Start, &far_horizon(c, pitch, roll));
    }
    figure("half", &svg.finish(), &format!("{}. {name}", number + 1))
}

/// Where a horizon is that is not drawn.
fn far_horizon(c: &Calibration, pitch: f64, roll: f64) -> String {
    let distance = c.camera.fx * pitch.to_radians().tan();
    if !(distance.is_finite() && distance.abs() < 1e5) {
        return "horizon at infinity: the camera looks straight down".into();
    }
    // The horizon lies opposite to the direction in which the picture's lower side dips.
    let angle = roll.rem_euclid(360.0);
    let side = [
        "above",
        "to the upper left of",
        "to the left of",
        "to the lower left of",
        "below",
        "to the lower right of",
        "to the right of",
        "to the upper right of",
    ];
    let place = side[((angle + 22.5) / 45.0) as usize % 8];
    format!("horizon {} px {place} the principal point", fixed(distance.abs(), 0))
}

/// Pitch and roll of an image, of its own or of the motion's attitude.
fn pose_of(c: &Calibration, name: &str, m: &Motion) -> Option<[f64; 2]> {
    let own = c.views.iter().find(|v| v.image == name && v.attitude.is_some()).map(|v| [v.pitch_down_deg, v.roll_deg]);
    own.or_else(|| {
        let a = c.attitudes.get(c.motions[m.pair].attitude?)?;
        Some([a.pitch_down_deg, a.roll_deg])
    })
}

/// Frame, metric grid and labels of an overlay; the pictures or points go in between.
struct FloorFrame {
    svg: Svg,
    x: Scale,
    y: Scale,
    frame: [f64; 4],
}

impl FloorFrame {
    fn new(m: &Motion, o: &Overlay) -> Self {
        let [w, h] = o.size.map(|s| s as f64);
        let (left, top) = (58.0, 10.0);
        let (width, height) = (ZOOM * w, ZOOM * h);
        let frame = [left, left + width, top, top + height];
        // Floor coordinates about the first camera's foot, in its heights.
        let ends = |i: usize, length: f64, sign: f64| {
            [(-0.5 - o.foot_px[i]) * o.unit_per_px * sign, (length - 0.5 - o.foot_px[i]) * o.unit_per_px * sign]
        };
        let [low, high] = ends(0, w, 1.0);
        let [far, near] = ends(1, h, -1.0);
        let label = format!("{} and {} laid on the floor", m.from, m.to);
        Self {
            svg: Svg::new([0.0, 0.0, left + width + 12.0, top + height + 46.0], "plot overlay", &label),
            x: Scale::new([low, high], [left, left + width]),
            y: Scale::new([near, far], [top + height, top]),
            frame,
        }
    }

    /// The grid, its lines of a class, and its labels above what was drawn.
    fn finish(mut self, grid: &str) -> String {
        let [left, right, top, bottom] = self.frame;
        let (tx, digits) = self.x.ticks(6);
        for t in tx {
            self.svg.line(grid, [self.x.at(t), top], [self.x.at(t), bottom]);
            self.svg.text("tick", [self.x.at(t), bottom + 17.0], Anchor::Middle, &fixed(t, digits));
        }
        let (ty, digits) = self.y.ticks(5);
        for t in ty {
            self.svg.line(grid, [left, self.y.at(t)], [right, self.y.at(t)]);
            self.svg.text("tick", [left - 7.0, self.y.at(t) + 4.0], Anchor::End, &fixed(t, digits));
        }
        self.svg.rect("frame", [left, top], [right - left, bottom - top]);
        self.svg.text(
            "tick",
            [0.5 * (left + right), bottom + 38.0],
            Anchor::Middle,
            "to the right of the first camera, camera heights",
        );
        self.svg.text_up("tick", [13.0, 0.5 * (top + bottom)], "ahead, camera heights");
        // As large as the pictures in it, so that all texts of the page have one size.
        self.svg.at_scale(OVERLAY_SCALE);
        self.svg.finish()
    }
}

/// Both pictures on the floor with the controls.
fn floor(index: usize, m: &Motion, o: &Overlay, [a, b]: &[Picture; 2], c: &Calibration) -> String {
    let mut frame = FloorFrame::new(m, o);
    let [left, _, top, _] = frame.frame;
    let mut clips = String::from("<defs>");
    for which in 0..2 {
        let corners = o.map.outline(&c.evidence, which, c.camera.size());
        let outline: Vec<[f64; 2]> =
            corners.iter().map(|[x, y]| [left + ZOOM * (x + 0.5), top + ZOOM * (y + 0.5)]).collect();
        let _ =
            write!(clips, "<clipPath id=\"clip{index}-{which}\"><path d=\"{}\"/></clipPath>", path_of(&outline, true));
    }
    clips.push_str("</defs>");
    frame.svg.raw(&clips);
    let [w, h] = o.size.map(|s| short(ZOOM * s as f64));
    for (which, picture) in [a, b].into_iter().enumerate() {
        let class = if which == 0 { "under" } else { "over" };
        frame.svg.raw(&format!(
            "<g clip-path=\"url(#clip{index}-{which})\" class=\"{class}\"><image x=\"{left}\" y=\"{top}\" width=\"{w}\" height=\"{h}\" \
             preserveAspectRatio=\"none\" href=\"{}\"/></g>",
            picture.uri
        ));
    }
    let (from, to) = (escape(&m.from), escape(&m.to));
    let controls = format!(
        "<p class=\"controls\" role=\"group\" aria-label=\"Overlay of {from} and {to}\"><label class=\"slide\"><span>{from}</span>\
         <input type=\"range\" min=\"0\" max=\"100\" value=\"50\" data-mix aria-label=\"From {from} (0) to {to} (100)\"><span>{to}</span></label> \
         <button type=\"button\" data-blink aria-pressed=\"false\">Blink</button> \
         <label><input type=\"checkbox\" data-difference> Difference</label></p>"
    );
    let fit = o
        .correlation
        .map_or(String::new(), |r| format!(" Where both see the floor their correlation is {}.", fixed(r, 3)));
    let caption = format!(
        "The floor seen from above in both images, up is where {} looks; unit: height of its camera over the floor. Move the slider or \
         blink: the floor stays still, whatever jumps stands on it, moved, or does not fit.{fit}",
        m.from
    );
    figure("whole lay", &format!("{controls}{}", frame.finish("metric")), &caption)
}

/// Without pictures: the points of both views on the floor, which lie on each other where all fits.
fn floor_points(m: &Motion, o: &Overlay, c: &Calibration, p: &PairEvidence) -> String {
    let mut frame = FloorFrame::new(m, o);
    let [left, right, top, bottom] = frame.frame;
    let place = |pixel: [f64; 2], which: usize| -> Option<[f64; 2]> {
        let q = o.map.on_grid(&c.evidence, which, pixel)?;
        let at = [left + ZOOM * (q[0] + 0.5), top + ZOOM * (q[1] + 0.5)];
        (at[0] > left && at[0] < right && at[1] > top && at[1] < bottom).then_some(at)
    };
    for accepted in [true, false] {
        let of = |which: usize| -> Vec<[f64; 2]> {
            let chosen = p.matches.iter().filter(|k| k.accepted == accepted);
            chosen.filter_map(|k| place(if which == 0 { k.a } else { k.b }, which)).collect()
        };
        if accepted {
            frame.svg.path("accepted", &marks(&of(0), dot));
            frame.svg.path("lost", &marks(&of(1), square));
        } else {
            frame.svg.path("rejected", &marks(&of(0), cross));
        }
    }
    let caption = format!(
        "The matches on the floor seen from above: dots from {}, squares around them from {}, by the camera found; crosses: rejected. A dot \
         outside its square does not fit.",
        m.from, m.to
    );
    figure("whole lay", &frame.finish("grid"), &caption)
}
