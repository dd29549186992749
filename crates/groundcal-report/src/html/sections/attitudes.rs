//! Horizons and circular points, the spread of the attitudes, and what they determine together.

use groundcal::result::Calibration;

use crate::{
    canvas::{Anchor, scale::Scale},
    html::{
        markup::{Drawing, attitude_class, counted, drawing, figure, fixed, power_of_ten, table, with_sigma},
        model::conic::Conic,
    },
};

pub(crate) fn section(c: &Calibration, conic: &Conic) -> String {
    let mut out = String::from("<div class=\"figures\">\n");
    out.push_str(&points(c, conic));
    out.push_str(&spread(conic));
    out.push_str("</div>\n");
    out.push_str(&conditioning(conic));
    let rows: Vec<Vec<String>> = c
        .attitudes
        .iter()
        .zip(&conic.attitudes)
        .enumerate()
        .map(|(i, (a, of_conic))| {
            let names: Vec<String> = of_conic.motions.iter().map(|[a, b]| format!("{a} \u{2192} {b}")).collect();
            vec![
                (i + 1).to_string(),
                with_sigma(a.pitch_down_deg, a.pitch_down_sigma_deg),
                with_sigma(a.roll_deg, a.roll_sigma_deg),
                a.horizon_px.map_or("at infinity".into(), |[a, b, c]| {
                    format!("{} x {} y {} = 0", fixed(a, 4), signed(b, 4), signed(c, 1))
                }),
                names.join(", "),
            ]
        })
        .collect();
    out.push_str(&table(
        "Attitudes of the camera to the floor",
        &["attitude", "pitch down, deg", "roll, deg", "horizon in ideal pixels", "motions"],
        &rows,
    ));
    out
}

/// A number to be added, with its sign before it.
fn signed(value: f64, decimals: usize) -> String {
    format!("{} {}", if value < 0.0 { '\u{2212}' } else { '+' }, fixed(value.abs(), decimals))
}

/// The image, the horizons about it and the circular points on them.
fn points(c: &Calibration, conic: &Conic) -> String {
    let [w, h] = c.camera.image_size.map(|s| s as f64);
    // As far as twelve images away: a camera that looks straight down has its horizon at infinity.
    let reach = 12.0 * w.max(h);
    let centre = [0.5 * w, 0.5 * h];
    let near = |p: &[f64; 2]| (p[0] - centre[0]).hypot(p[1] - centre[1]) < reach;
    let known: Vec<(usize, [[f64; 2]; 2])> = conic
        .attitudes
        .iter()
        .enumerate()
        .filter_map(|(i, a)| a.circular_points.map(|p| (i, p)))
        .filter(|(_, [m, d])| near(m) && d[0].hypot(d[1]) < reach)
        .collect();
    let ends = |[m, d]: &[[f64; 2]; 2]| [[m[0] - d[0], m[1] - d[1]], [m[0] + d[0], m[1] + d[1]]];
    let all: Vec<[f64; 2]> =
        known.iter().flat_map(|(_, p)| ends(p)).chain([[0.0, 0.0], [w, h], [c.camera.cx, c.camera.cy]]).collect();
    let bounds = |i: usize| {
        let (low, high) = all.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), p| (l.min(p[i]), h.max(p[i])));
        let room = 0.04 * (high - low);
        [low - room, high + room]
    };
    let (x, y) = (bounds(0), bounds(1));
    let side = 500.0;
    let scale = (side / (x[1] - x[0])).min(440.0 / (y[1] - y[0]));
    let (width, height) = (scale * (x[1] - x[0]), scale * (y[1] - y[0]));
    let (sx, sy) = (Scale::new(x, [10.0, 10.0 + width]), Scale::new(y, [10.0, 10.0 + height]));
    let at = |p: [f64; 2]| [sx.at(p[0]), sy.at(p[1])];
    let mut svg = Drawing::new([0.0, 0.0, 20.0 + side.max(width), 44.0 + height]);
    svg.rectangle("frame", at([-0.5, -0.5]), [w * scale, h * scale]);
    let [px, py] = at([c.camera.cx, c.camera.cy]);
    svg.line("zero", [px - 7.0, py], [px + 7.0, py]).line("zero", [px, py - 7.0], [px, py + 7.0]);
    for (i, point) in &known {
        let class = attitude_class(Some(*i));
        let [low, high] = ends(point);
        svg.line(format!("horizon {class}"), at(low), at(high));
        for measured in &conic.attitudes[*i].measured {
            for [x, y] in ends(measured).map(at) {
                svg.line(format!("cross {class}"), [x - 5.0, y - 5.0], [x + 5.0, y + 5.0]);
                svg.line(format!("cross {class}"), [x - 5.0, y + 5.0], [x + 5.0, y - 5.0]);
            }
        }
        for end in [low, high] {
            svg.circle(format!("ring {class}"), at(end), 6.0);
        }
        let [mx, my] = at(point[0]);
        svg.circle(format!("foot {class}"), [mx, my], 3.0);
        svg.text("mark", [mx + 10.0, my - 6.0], Anchor::Start, &(i + 1).to_string());
    }
    // A bar for the scale: as long as the image is wide.
    let y_bar = 28.0 + height;
    svg.line("axis", [10.0, y_bar], [10.0 + w * scale, y_bar]);
    svg.text(
        "tick",
        [18.0 + w * scale, y_bar + 4.0],
        Anchor::Start,
        &format!("{} px, the width of the image (rectangle)", fixed(w, 0)),
    );
    let hidden = conic.attitudes.len() - known.len();
    let beyond = if hidden > 0 { format!(" {hidden} too far away to be drawn.") } else { String::new() };
    figure(
        "half",
        &drawing(&svg, "plot", "Horizons and circular points about the image"),
        &format!(
            "Each attitude's horizon with its pair of circular points m \u{b1} i d, drawn at m \u{b1} d (rings; dot: m; number: attitude). \
             Crosses: the same from each motion by itself; they should lie in the rings.{beyond} Horizons of different directions and \
             distances fix the camera; parallel ones leave the principal point across them open."
        ),
    )
}

/// Attitudes on a disc: straight down in the middle, level at the rim, roll as the angle.
fn spread(conic: &Conic) -> String {
    let (centre, radius) = ([250.0, 236.0], 190.0);
    let mut svg = Drawing::new([0.0, 0.0, 500.0, 470.0]);
    for (i, part) in [1.0, 2.0 / 3.0, 1.0 / 3.0].into_iter().enumerate() {
        svg.circle(if i == 0 { "frame" } else { "grid" }, centre, radius * part);
        let text = format!("{}\u{b0}", fixed(90.0 * (1.0 - part), 0));
        svg.text("tick", [centre[0] + 4.0, centre[1] + radius * part - 5.0], Anchor::Start, &text);
    }
    svg.text("tick", [centre[0] + 6.0, centre[1] + 5.0], Anchor::Start, "down");
    let at = |pitch: f64, roll: f64| {
        let r = radius * (1.0 - pitch.clamp(-90.0, 90.0) / 90.0).clamp(0.0, 1.0);
        let (sin, cos) = roll.to_radians().sin_cos();
        [centre[0] + r * sin, centre[1] - r * cos]
    };
    for roll in (0..360).step_by(45) {
        let angle = f64::from(roll);
        svg.line("grid", centre, at(0.0, angle));
        let (sin, cos) = angle.to_radians().sin_cos();
        let signed = if angle > 180.0 { angle - 360.0 } else { angle };
        let place = [centre[0] + (radius + 24.0) * sin, centre[1] - (radius + 16.0) * cos + 4.0];
        svg.text("tick", place, Anchor::Middle, &format!("{}\u{b0}", fixed(signed, 0)));
    }
    for (i, a) in conic.attitudes.iter().enumerate() {
        let [x, y] = at(a.pitch_down_deg, a.roll_deg);
        for [pitch, roll] in &a.views {
            let own = at(*pitch, *roll);
            svg.line(format!("attitude-errors {}", attitude_class(Some(i))), [x, y], own);
            svg.circle(format!("own {}", attitude_class(Some(i))), own, 2.0);
        }
        svg.circle(format!("foot {}", attitude_class(Some(i))), [x, y], 6.0);
        svg.text("mark", [x + 10.0, y - 7.0], Anchor::Start, &(i + 1).to_string());
    }
    figure(
        "half",
        &drawing(&svg, "plot", "Attitudes by pitch and roll"),
        &format!(
            "How the attitudes are spread: roll as the angle, pitch below the horizon from the rim (level) to the middle (straight down). \
             Spread here: {} degrees of pitch, {} of roll. Points far apart, and not all on one spoke, determine the camera best. Small dots are single views: away from their ring the camera tilted between them.",
            fixed(conic.pitch_spread_deg, 1),
            fixed(conic.roll_spread_deg, 1)
        ),
    )
}

fn conditioning(conic: &Conic) -> String {
    let n = conic.unknowns.len();
    let enough = if conic.equations < n {
        format!(
            "<p class=\"note\"><strong>{} equations from {} for {n} unknowns:</strong> the rest is held by what was assumed, or \
             told by the lens and by views that overlap.</p>\n",
            conic.equations,
            counted(conic.attitudes.len(), "attitude")
        )
    } else {
        format!("<p>{} equations from {} attitudes for {n} unknowns.</p>\n", conic.equations, conic.attitudes.len())
    };
    if conic.singular_values.is_empty() {
        return enough;
    }
    let parts: Vec<String> = conic
        .unknowns
        .iter()
        .zip(&conic.weakest)
        .filter(|(_, part)| part.abs() > 0.1)
        .map(|(name, part)| format!("{} {name}", fixed(*part, 2)))
        .collect();
    let condition = conic.singular_values.last().map_or(f64::INFINITY, |least| 1.0 / least);
    let size =
        if condition < 1e4 { format!("condition {}", fixed(condition, 0)) } else { "no rank for all unknowns".into() };
    let caption = format!(
        "What the attitudes' equations determine together, whatever the noise ({size}). Short bars are combinations that the attitudes \
         hardly tell; the weakest is {} (cx, cy, skew in half image sides).",
        parts.join(" + ").replace("+ \u{2212}", "\u{2212} ")
    );
    format!(
        "{enough}<div class=\"figures\">{}</div>\n",
        figure("half", &singular_values(&conic.singular_values), &caption)
    )
}

/// Bars on a logarithmic scale.
fn singular_values(values: &[f64]) -> String {
    let (left, row) = (34.0, 26.0);
    let least = -4.0;
    let x = Scale::new([least, 0.0], [left, 480.0]);
    let bottom = 10.0 + row * values.len() as f64;
    let mut svg = Drawing::new([0.0, 0.0, 520.0, bottom + 46.0]);
    for power in -4..=0 {
        let at = x.at(f64::from(power));
        svg.line("grid", [at, 10.0], [at, bottom]);
        let label = if power == -4 { "\u{2264} 0.0001".into() } else { power_of_ten(power) };
        svg.text("tick", [at, bottom + 16.0], Anchor::Middle, &label);
    }
    for (i, value) in values.iter().enumerate() {
        let y = 10.0 + row * (i as f64 + 0.2);
        let end = x.at(value.max(1e-4).log10());
        svg.rectangle("bar", [left, y], [(end - left).max(2.0), 0.6 * row]);
        svg.text("tick", [left - 8.0, y + 0.45 * row], Anchor::End, &(i + 1).to_string());
    }
    svg.line("axis", [left, bottom], [480.0, bottom]);
    svg.text("tick", [0.5 * (left + 480.0), bottom + 38.0], Anchor::Middle, "singular value over the largest");
    drawing(&svg, "plot", "Singular values of the attitudes' equations")
}
