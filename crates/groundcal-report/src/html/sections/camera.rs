//! The camera with its error bars, what determined each number, and the lens.

use groundcal::result::Calibration;

use crate::html::sections::{decimals, figure, table};
use crate::html::{
    model::{
        Model,
        camera::{CameraNumber, CameraNumbers},
    },
    svg::{Anchor, Scale, Svg, fixed, path_of},
};

pub fn section(c: &Calibration, model: &Model) -> String {
    let camera = &model.camera;
    let rows: Vec<Vec<String>> = camera.parameters.iter().map(|p| row(p, c)).collect();
    let mut out = table(
        "Camera: estimate, standard deviation, and what determined it",
        &[
            "",
            "estimate",
            "std. deviation",
            "95 % interval",
            "assumed beforehand",
            "told by the images",
            "correlation with fx",
        ],
        &rows,
    );
    out.push_str("<div class=\"figures\">\n");
    out.push_str(&error_bars(camera, c));
    if !camera.lens.is_empty() {
        out.push_str(&lens(camera));
    }
    out.push_str("</div>\n");
    out
}

fn row(p: &CameraNumber, c: &Calibration) -> Vec<String> {
    let digits = p.sigma.map_or(if p.unit.is_empty() { 5 } else { 3 }, decimals);
    let unit = if p.unit.is_empty() { String::new() } else { format!(" {}", p.unit) };
    let dash = || "\u{2013}".to_string();
    let source = match (p.sigma, p.name) {
        (Some(_), _) => None,
        (None, "k1" | "k2") => Some(c.camera.distortion.source.name()),
        _ => Some("held"),
    };
    let relative = if p.unit == "px" {
        p.sigma.map_or(String::new(), |s| format!(" ({} % of fx)", fixed(100.0 * s / c.camera.fx, 3)))
    } else {
        String::new()
    };
    vec![
        p.name.to_string(),
        format!("{}{unit}", fixed(p.value, digits)),
        match (p.sigma, source) {
            (Some(s), _) => format!("{}{unit}{relative}", fixed(s, digits)),
            (None, Some(source)) => source.to_string(),
            _ => dash(),
        },
        p.interval.map_or_else(dash, |[low, high]| format!("{} to {}", fixed(low, digits), fixed(high, digits))),
        p.prior.map_or_else(dash, |[mean, sigma]| {
            let digits = decimals(sigma);
            format!("{} \u{b1} {}{unit}", fixed(mean, digits), fixed(sigma, digits))
        }),
        p.from_images.map_or_else(dash, percent),
        p.correlation_with_fx.map_or_else(dash, |r| fixed(r, 2)),
    ]
}

/// A part of one in per cent, never rounded up to all.
fn percent(part: f64) -> String {
    let percent = 100.0 * part;
    if part >= 1.0 {
        "100 %".into()
    } else if percent > 99.9 {
        "> 99.9 %".into()
    } else {
        format!("{} %", fixed(percent, 1))
    }
}

/// Standard deviations before and after on one logarithmic axis, in pixels at the place where they matter.
fn error_bars(camera: &CameraNumbers, c: &Calibration) -> String {
    let [w, h] = camera.image_size.map(|s| s as f64);
    let rho = 0.5 * w.hypot(h) / c.camera.fx;
    let in_px = |p: &CameraNumber, s: f64| match p.name {
        "k1" => s * c.camera.fx * rho.powi(3),
        "k2" => s * c.camera.fx * rho.powi(5),
        _ => s,
    };
    let free: Vec<&CameraNumber> = camera.parameters.iter().filter(|p| p.sigma.is_some_and(|s| s > 0.0)).collect();
    if free.is_empty() {
        return String::new();
    }
    let all =
        free.iter().flat_map(|p| [p.sigma, p.prior.map(|q| q[1])].into_iter().flatten().map(|s| in_px(p, s).log10()));
    let (low, high) = all.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
    let (low, high) = ((low - 0.1).floor(), (high + 0.1).ceil());
    let (left, top, row) = (52.0, 14.0, 30.0);
    let bottom = top + row * free.len() as f64;
    let x = Scale::new([low, high], [left, 500.0]);
    let mut svg =
        Svg::new([0.0, 0.0, 520.0, bottom + 46.0], "plot", "Standard deviations before and after the images were seen");
    for power in low as i32..=high as i32 {
        let at = x.at(f64::from(power));
        svg.line("grid", [at, top], [at, bottom]);
        let label = if power >= 0 { fixed(10f64.powi(power), 0) } else { fixed(10f64.powi(power), (-power) as usize) };
        svg.text("tick", [at, bottom + 16.0], Anchor::Middle, &label);
    }
    for (i, p) in free.iter().enumerate() {
        let y = top + row * (i as f64 + 0.5);
        svg.text("label", [left - 10.0, y + 4.0], Anchor::End, p.name);
        let after = p.sigma.map_or(left, |s| x.at(in_px(p, s).log10()));
        if let Some([_, before]) = p.prior {
            let before = x.at(in_px(p, before).log10());
            svg.line("narrowed", [before, y], [after, y]);
            let d = path_of(&[[before - 6.0, y], [before, y - 6.0], [before + 6.0, y], [before, y + 6.0]], true);
            svg.path("prior", &d);
        }
        svg.circle("posterior", [after, y], 5.0);
    }
    svg.line("axis", [left, bottom], [500.0, bottom]);
    svg.text(
        "tick",
        [0.5 * (left + 500.0), bottom + 38.0],
        Anchor::Middle,
        "standard deviation, px (k1, k2: their effect at the image's corner)",
    );
    let legend = "<p class=\"legend\"><svg viewBox=\"0 0 14 14\" aria-hidden=\"true\"><path class=\"prior\" d=\"M1 7L7 1L13 7L7 13Z\"/></svg> \
                  assumed beforehand <svg viewBox=\"0 0 14 14\" aria-hidden=\"true\"><circle class=\"posterior\" cx=\"7\" cy=\"7\" r=\"5\"/></svg> \
                  after the images</p>";
    figure(
        "half",
        &format!("{}{legend}", svg.finish()),
        "How far the images narrowed each number. Where circle and diamond nearly meet, the assumption decided, not the images; \
         without a diamond nothing was assumed.",
    )
}

fn lens(camera: &CameraNumbers) -> String {
    let (left, right, top, bottom) = (62.0, 500.0, 12.0, 250.0);
    let farthest = camera.lens.last().map_or(1.0, |p| p.radius_px);
    let ends = |side: f64| camera.lens.iter().map(move |p| p.outwards_px + side * 2.0 * p.sigma_px);
    let low = ends(-1.0).fold(0.0, f64::min);
    let high = ends(1.0).fold(0.0, f64::max);
    let room = 0.08 * (high - low).max(1e-6);
    let (x, y) = (Scale::new([0.0, farthest], [left, right]), Scale::new([low - room, high + room], [bottom, top]));
    let mut svg = Svg::new(
        [0.0, 0.0, 520.0, 296.0],
        "plot",
        "Displacement by the lens against the distance from the principal point",
    );
    axes(&mut svg, &x, &y, [left, right, top, bottom], "distance from the principal point, px", "moved outwards, px");
    let outline: Vec<[f64; 2]> = camera
        .lens
        .iter()
        .map(|p| [x.at(p.radius_px), y.at(p.outwards_px + 2.0 * p.sigma_px)])
        .chain(camera.lens.iter().rev().map(|p| [x.at(p.radius_px), y.at(p.outwards_px - 2.0 * p.sigma_px)]))
        .collect();
    svg.polyline("band", &outline, true);
    let curve: Vec<[f64; 2]> = camera.lens.iter().map(|p| [x.at(p.radius_px), y.at(p.outwards_px)]).collect();
    svg.polyline("curve", &curve, false);
    figure(
        "half",
        &svg.finish(),
        "What the lens does: how far it moves a point away from the principal point, with two standard deviations to either side. \
         Below zero: barrel.",
    )
}

/// Grid, ticks and labels of a plot whose frame is left, right, top, bottom.
pub fn axes(svg: &mut Svg, x: &Scale, y: &Scale, [left, right, top, bottom]: [f64; 4], x_label: &str, y_label: &str) {
    let (ticks, digits) = x.ticks(6);
    for t in ticks {
        svg.line("grid", [x.at(t), top], [x.at(t), bottom]);
        svg.text("tick", [x.at(t), bottom + 17.0], Anchor::Middle, &fixed(t, digits));
    }
    let (ticks, digits) = y.ticks(5);
    for t in ticks {
        svg.line(if t.abs() < 1e-12 { "zero" } else { "grid" }, [left, y.at(t)], [right, y.at(t)]);
        svg.text("tick", [left - 7.0, y.at(t) + 4.0], Anchor::End, &fixed(t, digits));
    }
    svg.line("axis", [left, bottom], [right, bottom]);
    svg.line("axis", [left, top], [left, bottom]);
    svg.text("tick", [0.5 * (left + right), bottom + 38.0], Anchor::Middle, x_label);
    svg.text_up("tick", [13.0, 0.5 * (top + bottom)], y_label);
}
