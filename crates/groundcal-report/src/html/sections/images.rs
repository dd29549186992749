//! All images, with what became of each, and where in the image something was seen.

use groundcal::result::{Calibration, MotionReport};

use crate::{
    canvas::{Mark, Picture, Shape, svg::escape},
    html::{
        markup::{Drawing, counted, drawing, figure, fixed},
        pictures::Pictures,
    },
};

/// Width of a thumbnail's drawing, that of the shared pictures.
const WIDTH: f64 = 640.0;
/// Images that are shown.
const SHOWN: usize = 120;
/// Points of the picture of all of them.
const POINTS: usize = 4000;
/// Cells along the longer side, of which those that hold points are counted.
const CELLS: usize = 12;

pub(crate) fn section(c: &Calibration, pictures: &Pictures) -> String {
    let names = &c.evidence.images;
    let used = names.iter().filter(|name| is_used(c, name)).count();
    let mut out = format!("<p>{} of {} are used.</p>\n<div class=\"images\">\n", used, counted(names.len(), "image"));
    for (i, name) in names.iter().enumerate().take(SHOWN) {
        out.push_str(&tile(c, pictures, i, name));
    }
    out.push_str("</div>\n");
    if names.len() > SHOWN {
        out.push_str(&format!("<p>The first {SHOWN} of {} images are shown.</p>\n", names.len()));
    }
    out.push_str(&coverage(c));
    out
}

fn is_used(c: &Calibration, name: &str) -> bool {
    of_image(c, name).any(|m| m.used || m.cross_attitude_link) || c.views.iter().any(|v| v.image == name)
}

fn of_image<'a>(c: &'a Calibration, name: &'a str) -> impl Iterator<Item = &'a MotionReport> {
    c.motions.iter().filter(move |m| m.from == name || m.to == name)
}

fn tile(c: &Calibration, pictures: &Pictures, index: usize, name: &str) -> String {
    let [w, h] = c.camera.image_size.map(|s| s as f64);
    let used = is_used(c, name);
    let height = WIDTH * h / w;
    let picture = if pictures.thumbnails.is_empty() {
        String::new()
    } else {
        let mut svg = Drawing::new([0.0, 0.0, WIDTH, height]);
        svg.picture(Picture::Shared(format!("im{index}")));
        svg.rectangle(if used { "border" } else { "border out" }, [0.0, 0.0], [WIDTH, height]);
        drawing(&svg, "picture", name)
    };
    let what = if used {
        let motions = of_image(c, name).filter(|m| m.used).count();
        let links = of_image(c, name).filter(|m| m.cross_attitude_link).count();
        let also = if links > 0 { format!(", {}", counted(links, "link")) } else { String::new() };
        format!("<strong class=\"in\">used</strong>: {}{also}", counted(motions, "motion"))
    } else {
        format!("<strong class=\"out\">not used</strong>: {}", escape(&why_not(c, name)))
    };
    format!(
        "<figure class=\"{}\">{picture}<figcaption>{}. {}<br>{what}</figcaption></figure>\n",
        if used { "tile" } else { "tile unused" },
        index + 1,
        escape(name)
    )
}

/// The reason of the pair that shows most.
fn why_not(c: &Calibration, name: &str) -> String {
    let best = of_image(c, name).filter(|m| m.reason.is_some()).max_by_key(|m| m.matches.max(m.candidate_matches));
    match best {
        Some(m) => {
            let other = if m.from == name { &m.to } else { &m.from };
            format!("with {other}: {}", m.reason.as_deref().unwrap_or_default())
        }
        None => "no other image was compared with it".into(),
    }
}

/// Where in the image points were seen, of all images together.
fn coverage(c: &Calibration) -> String {
    let [w, h] = c.camera.image_size.map(|s| s as f64);
    let observed: Vec<[f64; 2]> = c.evidence.observations.iter().map(|o| o.pixel).collect();
    let matched = || {
        let used = c.evidence.pairs.iter().zip(&c.motions).filter(|(_, m)| m.used);
        used.flat_map(|(p, _)| p.matches.iter().filter(|k| k.accepted).flat_map(|k| [k.a, k.b])).collect()
    };
    let points: Vec<[f64; 2]> = if observed.is_empty() { matched() } else { observed };
    if points.is_empty() {
        return String::new();
    }
    let side = w.max(h) / CELLS as f64;
    let cells = [w, h].map(|n| (n / side).round().max(1.0) as usize);
    let place = |p: &[f64; 2], i: usize| (((p[i] + 0.5) / [w, h][i] * cells[i] as f64) as usize).min(cells[i] - 1);
    let mut seen = vec![false; cells[0] * cells[1]];
    for p in &points {
        seen[place(p, 1) * cells[0] + place(p, 0)] = true;
    }
    let share = seen.iter().filter(|s| **s).count() as f64 / seen.len() as f64;
    let width = 520.0;
    let scale = (width - 20.0) / w;
    let mut svg = Drawing::new([0.0, 0.0, width, h * scale + 20.0]);
    svg.rectangle("frame", [10.0, 10.0], [w * scale, h * scale]);
    let every = points.len().div_ceil(POINTS);
    let shown = points.iter().step_by(every).map(|p| p.map(|v| 10.0 + (v + 0.5) * scale)).collect();
    svg.shape("covered", Shape::Marks(Mark::Dot, shown));
    let picture = figure(
        "half",
        &drawing(&svg, "plot", "Points of all images over the image plane"),
        &format!(
            "Where in the image something was matched, all images together: {} points in {} % of {} x {} cells{}. The lens is not known where there \
             are none.",
            points.len(),
            fixed(100.0 * share, 0),
            cells[0],
            cells[1],
            if every > 1 { format!(" (one of {every} is drawn)") } else { String::new() }
        ),
    );
    format!("<div class=\"figures\">\n{picture}</div>\n")
}
