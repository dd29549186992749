//! The camera with its error bars, what determined each number, and the lens.

use groundcal::result::Calibration;

use crate::{
    canvas::{Anchor, Point, Shape, scale::Scale},
    html::{
        markup::{Axes, Drawing, NONE, drawing, figure, fixed, power_of_ten, symbol, table},
        model::{
            Model,
            camera::{CameraNumber, CameraNumbers},
        },
    },
    number::decimals_of_sigma,
};

pub(crate) fn section(c: &Calibration, model: &Model) -> String {
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
    let digits = p.sigma.map_or(if p.unit.is_empty() { 5 } else { 3 }, decimals_of_sigma);
    let unit = if p.unit.is_empty() { String::new() } else { format!(" {}", p.unit) };
    let dash = || NONE.to_string();
    let source = match (p.sigma, p.name) {
        (Some(_), _) => None,
        (None, _) if p.unit.is_empty() => Some(c.camera.distortion.source.to_string()),
        _ => Some("held".into()),
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
            (None, Some(source)) => source,
            _ => dash(),
        },
        p.interval.map_or_else(dash, |[low, high]| format!("{} to {}", fixed(low, digits), fixed(high, digits))),
        p.prior.map_or_else(dash, |[mean, sigma]| {
            let digits = decimals_of_sigma(sigma);
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
        "k3" => s * c.camera.fx * rho.powi(7),
        // Along their axis.
        "p1" | "p2" => s * c.camera.fx * 3.0 * rho.powi(2),
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
    let mut svg = Drawing::new([0.0, 0.0, 520.0, bottom + 46.0]);
    for power in low as i32..=high as i32 {
        let at = x.at(f64::from(power));
        svg.line("grid", [at, top], [at, bottom]);
        svg.text("tick", [at, bottom + 16.0], Anchor::Middle, &power_of_ten(power));
    }
    for (i, p) in free.iter().enumerate() {
        let y = top + row * (i as f64 + 0.5);
        svg.text("label", [left - 10.0, y + 4.0], Anchor::End, p.name);
        let after = p.sigma.map_or(left, |s| x.at(in_px(p, s).log10()));
        if let Some([_, before]) = p.prior {
            let before = x.at(in_px(p, before).log10());
            svg.line("narrowed", [before, y], [after, y]);
            svg.shape("prior", diamond([before, y]));
        }
        svg.circle("posterior", [after, y], 5.0);
    }
    svg.line("axis", [left, bottom], [500.0, bottom]);
    svg.text(
        "tick",
        [0.5 * (left + 500.0), bottom + 38.0],
        Anchor::Middle,
        "standard deviation, px (lens: at the image's corner)",
    );
    let legend = format!(
        "<p class=\"legend\">{} assumed beforehand {} after the images</p>",
        symbol("prior", &diamond([7.0, 7.0])),
        symbol("posterior", &Shape::Circle([7.0, 7.0], 5.0))
    );
    let bars = drawing(&svg, "plot", "Standard deviations before and after the images were seen");
    figure(
        "half",
        &format!("{bars}{legend}"),
        "How far the images narrowed each number (of the lens: its effect at the corner of the image). Where circle and diamond nearly meet, the assumption decided, not the images; \
         without a diamond nothing was assumed.",
    )
}

fn diamond([x, y]: Point) -> Shape {
    Shape::polygon(vec![[x - 6.0, y], [x, y - 6.0], [x + 6.0, y], [x, y + 6.0]])
}

fn lens(camera: &CameraNumbers) -> String {
    let (left, right, top, bottom) = (62.0, 500.0, 12.0, 250.0);
    let farthest = camera.lens.last().map_or(1.0, |p| p.radius_px);
    let ends = |side: f64| camera.lens.iter().map(move |p| p.outwards_px + side * 2.0 * p.sigma_px);
    let low = ends(-1.0).fold(0.0, f64::min);
    let high = ends(1.0).fold(0.0, f64::max);
    let room = 0.08 * (high - low).max(1e-6);
    let (x, y) = (Scale::new([0.0, farthest], [left, right]), Scale::new([low - room, high + room], [bottom, top]));
    let mut svg = Drawing::new([0.0, 0.0, 520.0, 296.0]);
    let axes = Axes {
        frame: [left, right, top, bottom],
        x: &x,
        y: &y,
        x_label: "distance from the principal point, px",
        y_label: "moved outwards, px",
    };
    axes.draw(&mut svg);
    let outline = camera
        .lens
        .iter()
        .map(|p| [x.at(p.radius_px), y.at(p.outwards_px + 2.0 * p.sigma_px)])
        .chain(camera.lens.iter().rev().map(|p| [x.at(p.radius_px), y.at(p.outwards_px - 2.0 * p.sigma_px)]))
        .collect();
    svg.shape("band", Shape::polygon(outline));
    let curve = camera.lens.iter().map(|p| [x.at(p.radius_px), y.at(p.outwards_px)]).collect();
    svg.shape("curve", Shape::polyline(curve));
    figure(
        "half",
        &drawing(&svg, "plot", "Displacement by the lens against the distance from the principal point"),
        "What the lens does: how far it moves a point away from the principal point, with two standard deviations to either side. \
         Below zero: barrel.",
    )
}
