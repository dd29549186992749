//! The plan as a shot list.

use std::fmt::Write;

use clap::ValueEnum;
use groundcal::{
    plan::{PlannedMotion, Prediction, Shares},
    result::Warning,
};

use crate::args::DistortionArg;
use crate::plan::{PlanArgs, Report, RigArg};
use groundcal_report::text::wrapped;

const WIDTH: usize = 100;
/// Room for the number of a shot.
const INDENT: usize = 4;

/// The page for standard output.
pub fn page(report: &Report, args: &PlanArgs) -> String {
    let mut page = String::new();
    // Writing to a string cannot fail.
    let _ = write_page(&mut page, report, args);
    page
}

fn write_page(out: &mut String, report: &Report, args: &PlanArgs) -> std::fmt::Result {
    let (a, rig) = (&report.assumed, &report.rig);
    let rule = "-".repeat(WIDTH);
    writeln!(out, "{:^WIDTH$}", format!("groundcal {}: capture plan", env!("CARGO_PKG_VERSION")))?;
    writeln!(out, "{}", "=".repeat(WIDTH))?;
    let (w, h) = (a.image_size[0], a.image_size[1]);
    let field = 2.0 * (0.5 * w as f64 / a.fx).atan().to_degrees();
    let source = if report.before.is_some() { "calibrated" } else { "assumed" };
    writeln!(
        out,
        "Camera:   {w} x {h} px, f {:.0} px ({field:.0} deg wide), {source}; constraint {}",
        a.fx, a.constraint
    )?;
    writeln!(
        out,
        "Carrier:  {}, {} m over the floor; turns about an axis {} m behind the camera, by {} deg at most",
        rig.name,
        rig.height_m,
        rig.axis_offset_m,
        rig.turns_deg.iter().fold(0.0f64, |m, t| m.max(*t))
    )?;
    writeln!(out, "          tilts {} deg, rolls {} deg", list(&rig.tilts_deg), list(&rig.rolls_deg))?;
    writeln!(
        out,
        "Matches:  {:.0} to a full picture, noise {} px, floor up to {} m away",
        a.points,
        short(a.noise_px),
        short(rig.reach_m)
    )?;
    writeln!(
        out,
        "Strays:   tilt and roll by {} deg, height by {} % a picture",
        short(a.attitude_sigma_deg),
        short(100.0 * a.height_sigma)
    )?;
    writeln!(out, "{rule}")?;
    if let Some(before) = &report.before {
        writeln!(out, "Now f is known to {} (one standard deviation).", percent(before))?;
        writeln!(out)?;
    }
    let mut last = report.before.as_ref();
    for (i, m) in report.motions.iter().enumerate() {
        let shot = wrapped(&shot(m, args.rig), INDENT);
        writeln!(out, "{:>2}. {}", i + 1, &shot[INDENT..])?;
        writeln!(out, "{}", wrapped(&reason(last, m), INDENT))?;
        last = m.after.as_ref().or(last);
    }
    writeln!(out)?;
    if report.motions.len() < a.motions {
        let text = format!(
            "{} motions were asked for; one more of this carrier would lower the error of f by less than a hundredth of it.",
            a.motions
        );
        writeln!(out, "{}", wrapped(&text, 0))?;
    }
    writeln!(
        out,
        "Tilt: the optical axis below the horizon. Roll: positive with the camera's right-hand side down. Turn:"
    )?;
    writeln!(
        out,
        "anticlockwise, seen from above, the tilt and roll untouched; {:.0} % of the floor or more stays in view.",
        {
            let least = report.motions.iter().map(|m| m.overlap).fold(1.0f64, f64::min);
            100.0 * least
        }
    )?;
    writeln!(out, "{rule}")?;
    table(out, report)?;
    writeln!(out, "{rule}")?;
    for p in &report.priors {
        let held = if p.posterior_over_prior > 0.7 {
            "held by this; the motions do not tell it".to_string()
        } else {
            format!("the motions narrow it to {:.0} % of that width", 100.0 * p.posterior_over_prior)
        };
        writeln!(out, "assumed: {:<7}{:>9} +- {:<8}{held}", p.parameter, short(p.mean), short(p.sigma))?;
    }
    for warning in &report.warnings {
        writeln!(out)?;
        let expected = if matches!(warning.warning, Warning::LargeStrays { .. }) { "" } else { "expect " };
        let code = warning.warning.code();
        writeln!(out, "{}", wrapped(&format!("{expected}warning [{code}]: {}", warning.message), 0))?;
    }
    writeln!(out)?;
    let command = command(report, args);
    let all = if report.before.is_some() { " (old and new pictures together)" } else { "" };
    writeln!(out, "Then: {command} --out result/{all}")?;
    writeln!(out, "and:  groundcal plan --rig {} --after result/", rig.name.replace(' ', "-"))
}

/// The calibration the plan is made for.
fn command(report: &Report, args: &PlanArgs) -> String {
    let a = &report.assumed;
    let mut command = String::from("groundcal calibrate PICTURES/");
    if a.constraint != "auto" {
        let _ = write!(command, " --constraint {}", a.constraint);
    }
    if let Some([x, y]) = args.principal_point {
        let _ = write!(command, " --principal-point {x},{y}");
    }
    for p in &args.prior {
        let _ = write!(command, " --prior {}={}+-{}", p.parameter.name(), p.mean, p.sigma);
    }
    if let Some(lens) = args.distortion.to_possible_value().filter(|_| args.distortion != DistortionArg::Auto) {
        let _ = write!(command, " --distortion {}", lens.get_name());
    }
    if args.attitude_sigma_deg.is_some() {
        let _ = write!(command, " --attitude-sigma-deg {}", short(a.attitude_sigma_deg));
    }
    if args.height_sigma.is_some() {
        let _ = write!(command, " --height-sigma {}", a.height_sigma);
    }
    command
}

fn shot(m: &PlannedMotion, rig: RigArg) -> String {
    let turn = format!("{:.0} deg anticlockwise (to the left)", m.turn_deg);
    let turned = match rig {
        RigArg::Robot => format!("drive on until the camera has turned {turn}"),
        _ => format!("turn {turn}"),
    };
    if m.continues {
        return format!("From there {turned}, take another picture.");
    }
    let roll = match m.roll_deg {
        r if r > 0.0 => format!("roll {r:.0} deg (right-hand side down)"),
        r if r < 0.0 => format!("roll {r:.0} deg (left-hand side down)"),
        _ => "roll 0".to_string(),
    };
    format!("Tilt {:.0} deg below the horizon, {roll}: take a picture, {turned}, take another.", m.pitch_down_deg)
}

/// Why a motion: what it does to f, and by what.
fn reason(before: Option<&Prediction>, m: &PlannedMotion) -> String {
    let Some(after) = &m.after else { return "The camera is not determined yet.".into() };
    let Some(before) = before else {
        return format!("f to {}. {}", percent(after), rest(after));
    };
    let variance = |p: &Prediction| p.f_percent * p.f_percent;
    let part = |p: &Prediction, of: fn(&Shares) -> f64| of(&p.share) * variance(p);
    let fall = |of: fn(&Shares) -> f64| part(before, of) - part(after, of);
    let causes: [(&str, f64); 3] = [
        ("tells the principal point", fall(|s| s.principal_point)),
        ("tells the lens distortion", fall(|s| s.lens)),
        ("tells the aspect ratio", fall(|s| s.aspect)),
    ];
    let all = variance(before) - variance(after);
    let most = causes.iter().fold(causes[0], |best, c| if c.1 > best.1 { *c } else { best });
    let why = if most.1 > 0.5 * all { format!(": it {}", most.0) } else { ": it averages the noise".into() };
    format!("f from {} to {}{why}.", percent(before), percent(after))
}

/// What is left of the error.
fn rest(p: &Prediction) -> String {
    let parts = [
        ("principal point", p.share.principal_point),
        ("lens distortion", p.share.lens),
        ("aspect ratio", p.share.aspect),
    ];
    let most = parts.iter().fold(parts[0], |best, c| if c.1 > best.1 { *c } else { best });
    if most.1 > 0.5 {
        format!("{:.0} % of its variance would be gone if the {} were known.", 100.0 * most.1, most.0)
    } else {
        "It is mostly noise.".into()
    }
}

/// Standard deviations after each motion.
fn table(out: &mut String, report: &Report) -> std::fmt::Result {
    writeln!(
        out,
        "expected standard deviations, and the parts of the variance of f that would be gone if the principal"
    )?;
    writeln!(out, "point, the lens or the aspect ratio were known (they overlap)")?;
    writeln!(
        out,
        "{:<9}{:>9}{:>9}{:>9}{:>9}{:>9}{:>9}{:>9}   point, lens, aspect",
        "motions", "f %", "fx px", "fy px", "cx px", "cy px", "k1", "k2"
    )?;
    let mut row = |name: &str, p: Option<&Prediction>| {
        let Some(p) = p else { return writeln!(out, "{name:<9}{:>9}", "not determined yet") };
        let s = &p.standard_deviation;
        let number = |v: Option<f64>| v.map_or("held".into(), short);
        let share = |v: f64| format!("{:.0} %", 100.0 * v);
        writeln!(
            out,
            "{name:<9}{:>9}{:>9}{:>9}{:>9}{:>9}{:>9}{:>9}   {}, {}, {}",
            short(p.f_percent),
            number(s.fx),
            number(s.fy),
            number(s.cx),
            number(s.cy),
            number(s.k1),
            number(s.k2),
            share(p.share.principal_point),
            share(p.share.lens),
            share(p.share.aspect)
        )
    };
    if report.before.is_some() {
        row("now", report.before.as_ref())?;
    }
    let sign = if report.before.is_some() { "+" } else { "" };
    for (i, m) in report.motions.iter().enumerate() {
        row(&format!("{sign}{}", i + 1), m.after.as_ref())?;
    }
    Ok(())
}

fn percent(p: &Prediction) -> String {
    format!("{} %", short(p.f_percent))
}

/// Two or three significant digits without an exponent.
pub fn short(value: f64) -> String {
    let size = value.abs();
    if size == 0.0 {
        return "0".into();
    }
    let decimals = (2 - size.log10().floor() as i32).clamp(0, 6) as usize;
    let text = format!("{value:.decimals$}");
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').into() } else { text }
}

fn list(values: &[f64]) -> String {
    values.iter().map(|v| short(*v)).collect::<Vec<_>>().join(", ")
}
