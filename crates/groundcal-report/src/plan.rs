//! A capture plan as a shot list and as a figure.

use groundcal::{
    plan::{PlanReport, PlannedMotion, Prediction, VarianceShares},
    result::{Warning, WarningReport},
};

use crate::{
    number::{fixed, short},
    plot::{Curve, Figure, Marker, Panel, Style},
    terminal::{Table, centred, facts, rule, wrapped},
};

/// Room for the number of a shot.
const INDENT: usize = 4;

/// The plan as a shot list; `then` says what to do with the pictures.
pub fn text(report: &PlanReport, then: &str, width: usize) -> String {
    let (double, single) = (rule('=', width), rule('-', width));
    let title = format!("groundcal {}: capture plan", env!("CARGO_PKG_VERSION"));
    format!(
        "{}\n{double}\n{}{single}\n{}{single}\n{}{single}\n{}{}\n{then}\n",
        centred(&title, width),
        facts(&assumptions(report), width),
        shots(report, width),
        deviations(report, width),
        priors(report).text(width),
        warnings(report, width),
    )
}

fn assumptions(report: &PlanReport) -> Vec<(&'static str, String)> {
    let (a, rig) = (&report.assumed, &report.rig);
    let [w, h] = a.image_size;
    let field_deg = 2.0 * (0.5 * w as f64 / a.fx).atan().to_degrees();
    let source = if report.before.is_some() { "calibrated" } else { "assumed" };
    let turn = rig.turns_deg.iter().fold(0.0f64, |m, t| m.max(*t));
    vec![
        (
            "Camera",
            format!(
                "{w} x {h} px, f {} px ({} deg wide), {source}; constraint {}",
                fixed(a.fx, 0),
                fixed(field_deg, 0),
                a.constraint
            ),
        ),
        (
            "Carrier",
            format!(
                "{}, {} m over the floor; turns about an axis {} m behind the camera, by {turn} deg at most; tilts {} deg, rolls {} deg",
                rig.name,
                rig.height_m,
                rig.axis_offset_m,
                list(&rig.tilts_deg),
                list(&rig.rolls_deg)
            ),
        ),
        (
            "Matches",
            format!(
                "{} to a full picture, noise {} px, floor up to {} m away",
                fixed(a.points, 0),
                short(a.noise_px),
                short(rig.reach_m)
            ),
        ),
        (
            "Strays",
            format!(
                "tilt and roll by {} deg, height by {} % a picture",
                short(a.attitude_sigma_deg),
                short(100.0 * a.height_sigma)
            ),
        ),
    ]
}

/// What to do, step by step, and what each step is good for.
fn shots(report: &PlanReport, width: usize) -> String {
    let mut out = String::new();
    if let Some(before) = &report.before {
        out += &format!("Now f is known to {} (one standard deviation).\n\n", percent(before));
    }
    let mut last = report.before.as_ref();
    for (i, m) in report.motions.iter().enumerate() {
        let shot = wrapped(&shot(m, report.rig.drives), INDENT, width);
        out += &format!("{:>2}. {}\n{}\n", i + 1, shot.trim_start(), wrapped(&reason(last, m), INDENT, width));
        last = m.after.as_ref().or(last);
    }
    out.push('\n');
    if report.motions.len() < report.assumed.motions {
        let text = format!(
            "{} motions were asked for; one more of this carrier would lower the error of f by less than a hundredth of it.",
            report.assumed.motions
        );
        out += &(wrapped(&text, 0, width) + "\n");
    }
    let least = report.motions.iter().map(|m| m.overlap).fold(1.0f64, f64::min);
    let words = format!(
        "Tilt: the optical axis below the horizon. Roll: positive with the camera's right-hand side down. Turn: anticlockwise, seen from \
         above, the tilt and roll untouched; {} % of the floor or more stays in view.",
        fixed(100.0 * least, 0)
    );
    out + &wrapped(&words, 0, width) + "\n"
}

fn shot(m: &PlannedMotion, drives: bool) -> String {
    let turn = format!("{} deg anticlockwise (to the left)", fixed(m.turn_deg, 0));
    let turned = if drives { format!("drive on until the camera has turned {turn}") } else { format!("turn {turn}") };
    if m.continues {
        return format!("From there {turned}, take another picture.");
    }
    let degrees = fixed(m.roll_deg, 0);
    let roll = match m.roll_deg {
        r if r > 0.0 => format!("roll {degrees} deg (right-hand side down)"),
        r if r < 0.0 => format!("roll {degrees} deg (left-hand side down)"),
        _ => "roll 0".to_string(),
    };
    let tilt = fixed(m.pitch_down_deg, 0);
    format!("Tilt {tilt} deg below the horizon, {roll}: take a picture, {turned}, take another.")
}

/// Why a motion: what it does to f, and by what.
fn reason(before: Option<&Prediction>, m: &PlannedMotion) -> String {
    let Some(after) = &m.after else { return "The camera is not determined yet.".into() };
    let Some(before) = before else {
        return format!("f to {}. {}", percent(after), rest(after));
    };
    let variance = |p: &Prediction| p.f_percent * p.f_percent;
    let part = |p: &Prediction, of: fn(&VarianceShares) -> f64| of(&p.share) * variance(p);
    let fall = |of: fn(&VarianceShares) -> f64| part(before, of) - part(after, of);
    let causes = [
        ("tells the principal point", fall(|s| s.principal_point)),
        ("tells the lens distortion", fall(|s| s.lens)),
        ("tells the aspect ratio", fall(|s| s.aspect)),
    ];
    let all = variance(before) - variance(after);
    let (cause, most) = largest(causes);
    let why = if most > 0.5 * all { format!(": it {cause}") } else { ": it averages the noise".into() };
    format!("f from {} to {}{why}.", percent(before), percent(after))
}

/// What is left of the error.
fn rest(p: &Prediction) -> String {
    let (part, most) = largest([
        ("principal point", p.share.principal_point),
        ("lens distortion", p.share.lens),
        ("aspect ratio", p.share.aspect),
    ]);
    if most > 0.5 {
        format!("{} % of its variance would be gone if the {part} were known.", fixed(100.0 * most, 0))
    } else {
        "It is mostly noise.".into()
    }
}

/// The first of those that are largest.
fn largest(parts: [(&'static str, f64); 3]) -> (&'static str, f64) {
    parts.into_iter().fold(parts[0], |best, part| if part.1 > best.1 { part } else { best })
}

/// Standard deviations after each motion.
fn deviations(report: &PlanReport, width: usize) -> String {
    let words = "expected standard deviations, and the parts of the variance of f that would be gone if the principal point, the lens or \
                 the aspect ratio were known (they overlap)";
    let mut table = ["fx\npx", "fy\npx", "cx\npx", "cy\npx", "k1", "k2", "point", "lens", "aspect"]
        .into_iter()
        .fold(Table::new().name("motions").number("f\n%"), Table::number);
    let mut row = |name: String, p: Option<&Prediction>| {
        let Some(p) = p else { return table.row([name, "not determined yet".into()]) };
        let s = &p.standard_deviation;
        let numbers = [s.fx, s.fy, s.cx, s.cy, s.k1, s.k2].map(|v| v.map_or("held".into(), short));
        let shares = [p.share.principal_point, p.share.lens, p.share.aspect];
        let shares = shares.map(|share| format!("{} %", fixed(100.0 * share, 0)));
        table.row([name, short(p.f_percent)].into_iter().chain(numbers).chain(shares));
    };
    if report.before.is_some() {
        row("now".into(), report.before.as_ref());
    }
    let sign = if report.before.is_some() { "+" } else { "" };
    for (i, m) in report.motions.iter().enumerate() {
        row(format!("{sign}{}", i + 1), m.after.as_ref());
    }
    wrapped(words, 0, width) + "\n" + &table.text(width)
}

/// What is assumed beforehand, and whether the motions tell it too.
fn priors(report: &PlanReport) -> Table {
    let mut table = Table::new().name("assumed").number("mean").number("std. dev.").name("");
    for p in &report.priors {
        let held = if p.posterior_over_prior > 0.7 {
            "held by this; the motions do not tell it".to_string()
        } else {
            let left = fixed(100.0 * p.posterior_over_prior, 0);
            format!("the motions narrow it to {left} % of that width")
        };
        table.row([p.parameter.to_string(), short(p.mean), short(p.sigma), held]);
    }
    table
}

fn warnings(report: &PlanReport, width: usize) -> String {
    let one = |w: &WarningReport| {
        let expected = if matches!(w.warning, Warning::LargeAttitudeErrors { .. }) { "" } else { "expect " };
        format!("\n{}\n", wrapped(&format!("{expected}warning [{}]: {}", w.warning.code(), w.message), 0, width))
    };
    report.warnings.iter().map(one).collect()
}

fn percent(p: &Prediction) -> String {
    format!("{} %", short(p.f_percent))
}

fn list(values: &[f64]) -> String {
    values.iter().map(|v| short(*v)).collect::<Vec<_>>().join(", ")
}

/// Predicted standard deviation of f against the number of motions.
pub fn figure(report: &PlanReport) -> Figure {
    let style = Style { color: [0, 90, 160], width: 2.0, dash: &[], marker: Some(Marker::Circle), filled: true };
    let before = report.before.iter().map(|p| [0.0, p.f_percent]);
    let after = report
        .motions
        .iter()
        .enumerate()
        .map(|(i, m)| [(i + 1) as f64, m.after.as_ref().map_or(f64::INFINITY, |p| p.f_percent)]);
    let points = before.chain(after).collect();
    let a = &report.assumed;
    Figure {
        title: format!("Expected error of the focal length, {}", report.rig.name),
        x_label: if report.before.is_some() { "motions added" } else { "motions" }.into(),
        y_label: "standard deviation of f, %".into(),
        x_log: false,
        rows: vec![vec![Panel { title: String::new(), curves: vec![Curve { style, points, band: Vec::new() }] }]],
        legend: vec![(style, "predicted".into())],
        notes: vec![
            format!(
                "{} x {} px, f about {} px; noise {} px, {} matches to a full picture; attitude sigma {} deg",
                a.image_size[0],
                a.image_size[1],
                fixed(a.fx, 0),
                short(a.noise_px),
                fixed(a.points, 0),
                short(a.attitude_sigma_deg)
            ),
            "A cross at the upper edge: not determined yet.".into(),
        ],
    }
}
