//! The summary for people, in the style of a statistics package.

use std::fmt::Write;

use groundcal::{
    numerics::statistics::NORMAL_95,
    remedy::Wording,
    result::{Calibration, LensModelName, LensSource, Method, MotionReport, Parameter, Scene},
};

/// Width of the page in columns.
const WIDTH: usize = 100;
/// Pairs not used that are listed one by one without `--verbose`.
const MAX_LISTED: usize = 8;

/// The page.
pub fn summary(c: &Calibration, images: usize, verbose: bool, wording: &dyn Wording) -> String {
    let mut page = String::new();
    // Writing to a string cannot fail.
    let _ = write_summary(&mut page, c, images, verbose, wording);
    page
}

fn write_summary(
    w: &mut String,
    c: &Calibration,
    images: usize,
    verbose: bool,
    wording: &dyn Wording,
) -> std::fmt::Result {
    let used: Vec<&MotionReport> = c.motions.iter().filter(|m| m.used).collect();
    let double = "=".repeat(WIDTH);
    let single = "-".repeat(WIDTH);
    writeln!(w, "{:^WIDTH$}", format!("groundcal {}: camera from floor motions", env!("CARGO_PKG_VERSION")))?;
    writeln!(w, "{double}")?;
    let two =
        |w: &mut String, a: (&str, String), b: (&str, String)| writeln!(w, "{:<16}{:<36}{:<16}{}", a.0, a.1, b.0, b.1);
    let [width, height] = c.camera.image_size;
    let method = match c.method {
        Method::Joint => "joint refinement",
        Method::Rotating => "rotating camera, covariance-weighted",
        Method::Linear => "linear, covariance-weighted",
    };
    two(w, ("Images:", format!("{images}, {width} x {height} px")), ("Method:", method.into()))?;
    two(
        w,
        ("Motions used:", format!("{} of {} pairs", used.len(), c.motions.len())),
        ("Constraint:", c.constraint.to_string()),
    )?;
    two(
        w,
        ("Attitudes:", c.attitudes.len().to_string()),
        (
            "Attitude sigma:",
            format!(
                "{:.3} deg a view{}",
                c.attitude_sigma_deg,
                if c.attitude_sigma_estimated { ", estimated" } else { "" }
            ),
        ),
    )?;
    if let Some(r) = &c.fit.refinement {
        let scene = match c.scene {
            Some(Scene::Directions) => "far away, the camera turns on the spot".to_string(),
            Some(Scene::Floor) | None => format!("floor; {} ties between attitudes", r.ties),
        };
        let heights = c.height_sigma.map_or("no part".into(), |s| format!("{:.3} % a view", 100.0 * s));
        two(w, ("Scene:", scene), ("Height sigma:", heights))?;
        let residuals = [("patches", &r.patches), ("points", &r.points)].into_iter().filter_map(|(kind, k)| {
            let k = k.as_ref()?;
            Some(format!("{} of {kind} ({:.2}, {:.1})", k.observations, k.variance_factor, k.design_effect))
        });
        writeln!(w, "{:<16}{}", "Observations:", residuals.collect::<Vec<_>>().join(", "))?;
    }
    let fit = &c.fit;
    let chi = if fit.degrees_of_freedom == 0 {
        "none left over to check by".to_string()
    } else {
        format!("{:.1} for {} degrees of freedom", fit.chi_squared, fit.degrees_of_freedom)
    };
    two(w, ("Chi-squared:", chi), ("Distortion:", distortion(c)))?;
    writeln!(w, "{double}")?;
    writeln!(w, "{:<12}{:>12}{:>14}{:>28}{:>12}", "", "estimate", "std. error", "[95 % interval]", "std. error")?;
    writeln!(w, "{:<12}{:>12}{:>14}{:>28}{:>12}", "", "px", "px", "px", "% of fx")?;
    writeln!(w, "{single}")?;
    let of_lens = |wanted: bool| Parameter::ALL.into_iter().filter(move |p| p.is_of_lens() == wanted);
    for name in of_lens(false) {
        let value = c.value(name);
        match c.standard_deviation(name) {
            Some(sigma) => {
                let (low, high) = (value - NORMAL_95 * sigma, value + NORMAL_95 * sigma);
                let percent = 100.0 * sigma / c.camera.fx;
                writeln!(w, "{name:<12}{value:>12.3}{sigma:>14.3}{low:>15.3}{high:>13.3}{percent:>12.3}")?;
            }
            // Adding zero turns -0 into 0.
            None => writeln!(w, "{name:<12}{:>12.3}{:>14}", value + 0.0, "held")?,
        }
    }
    for name in of_lens(true) {
        let value = c.value(name);
        if let Some(sigma) = c.standard_deviation(name) {
            let (low, high) = (value - NORMAL_95 * sigma, value + NORMAL_95 * sigma);
            writeln!(w, "{name:<12}{value:>12.5}{sigma:>14.5}{low:>15.5}{high:>13.5}")?;
        }
    }
    writeln!(w, "{single}")?;
    for p in &c.priors {
        let unit = if p.parameter.is_in_pixels() { " px" } else { "" };
        writeln!(
            w,
            "prior: {:<8}{:>10.3} +- {:<8.3}{:<4} narrowed by the images to {:.0} % of that width",
            p.parameter,
            p.mean,
            p.sigma,
            unit,
            100.0 * p.posterior_over_prior.min(1.0)
        )?;
    }
    if !c.priors.is_empty() {
        writeln!(w, "{single}")?;
    }
    let name_width = used.iter().map(|m| m.from.len().max(m.to.len())).max().unwrap_or(4).clamp(8, 24);
    writeln!(
        w,
        "{:<name_width$}  {:<name_width$}{:>16}{:>17}{:>9}{:>8}{:>8}{:>8}",
        "from", "to", "turn (deg)", "rho", "matches", "rms px", "pitch", "roll"
    )?;
    for m in &used {
        let attitude = m.attitude.and_then(|a| c.attitudes.get(a));
        writeln!(
            w,
            "{:<name_width$}  {:<name_width$}{:>16}{:>17}{:>9}{:>8.2}{:>8.2}{:>8.2}",
            m.from,
            m.to,
            with_sigma(m.rotation_deg, m.rotation_sigma_deg, 3),
            with_sigma(m.rho, m.rho_sigma, 4),
            m.matches,
            m.rms_px.unwrap_or(f64::NAN),
            attitude.map_or(f64::NAN, |a| a.pitch_down_deg),
            attitude.map_or(f64::NAN, |a| a.roll_deg),
        )?;
    }
    misfits(w, c, wording)?;
    attitudes(w, c, &single)?;
    if verbose && !c.views.is_empty() {
        views(w, c, &single)?;
    }
    not_used(w, c, verbose)?;
    writeln!(w, "{double}")?;
    writeln!(
        w,
        "Pixel (0,0) is the centre of the top-left pixel. turn: of the camera, anticlockwise seen from above;\n\
         rho: height of the second view over the floor in units of the first's (1: constant height);\n\
         pitch: optical axis below the horizon; roll: right-hand side down; both in degrees."
    )?;
    if !c.attitudes.is_empty() {
        let unit = match (c.camera_height_m, c.views.is_empty()) {
            (Some(metres), _) => format!("height: {metres} m at the first view of each set"),
            (None, false) => "height: 1 at the first view of each set".into(),
            (None, true) => "height: not estimated".into(),
        };
        writeln!(
            w,
            "{unit}; horizon: of the undistorted image, turned clockwise against its rows,\n\
             and how far above the image's centre it passes (square to it; negative: below)."
        )?;
    }
    if c.fit.refinement.is_some() {
        writeln!(
            w,
            "Observations: in brackets the variance of the residuals over that under single homographies, and how much\n\
             more neighbours have in common than independent ones would; both are in the error bars."
        )?;
    }
    if verbose && !c.views.is_empty() {
        writeln!(
            w,
            "Views: +X is the heading of the view named as origin, Z up, its optical centre is at (0, 0, {}); heading\n\
             anticlockwise seen from above.",
            c.camera_height_m.map_or("1".into(), |m| format!("{m} m"))
        )?;
    }
    for warning in &c.warnings {
        writeln!(w, "\nwarning [{}]\n{}", warning.code(), wrapped(&warning.message(wording), 2))?;
    }
    Ok(())
}

fn distortion(c: &Calibration) -> String {
    let d = &c.camera.distortion;
    match (d.source, d.model) {
        (LensSource::Given, _) => format!("given: k1 {}, k2 {}", d.k1, d.k2),
        (LensSource::Estimated, LensModelName::None) => "estimated: none found".into(),
        (source @ (LensSource::Estimated | LensSource::NotModelled), _) => source.name().into(),
    }
}

fn with_sigma(value: Option<f64>, sigma: Option<f64>, digits: usize) -> String {
    match (value, sigma) {
        (Some(v), Some(s)) => format!("{v:.digits$} +-{s:.digits$}"),
        (Some(v), None) => format!("{v:.digits$}"),
        _ => "-".into(),
    }
}

/// Motions used that do not fit the others.
fn misfits(w: &mut String, c: &Calibration, wording: &dyn Wording) -> std::fmt::Result {
    for m in &c.motions {
        if let Some(message) = m.diagnosis.and_then(|d| d.verdict.message(wording)) {
            writeln!(w, "{}", wrapped(&format!("does not fit: {} - {}: {message}", m.from, m.to), 2))?;
        }
    }
    Ok(())
}

/// The camera over the floor: angles, height and horizon of each attitude.
fn attitudes(w: &mut String, c: &Calibration, rule: &str) -> std::fmt::Result {
    if c.attitudes.is_empty() {
        return Ok(());
    }
    writeln!(w, "{rule}")?;
    let unit = if c.camera_height_m.is_some() { "height (m)" } else { "height" };
    writeln!(
        w,
        "{:<10}{:>20}{:>20}{unit:>18}{:>14}{:>18}",
        "attitude", "pitch (deg)", "roll (deg)", "horizon (deg)", "above centre (px)"
    )?;
    let [x, y] = c.camera.size().centre_px();
    for (i, a) in c.attitudes.iter().enumerate() {
        let (turned, above) = match a.horizon_px {
            // Clockwise as the image is shown; the line's (a, b) points up, away from the floor.
            Some([p, q, r]) => (format!("{:.3}", (-p / q).atan().to_degrees() + 0.0), Some(-(p * x + q * y + r))),
            None => ("-".into(), None),
        };
        writeln!(
            w,
            "{i:<10}{:>20}{:>20}{:>18}{turned:>14}{:>18}",
            with_sigma(Some(a.pitch_down_deg), a.pitch_down_sigma_deg, 3),
            with_sigma(Some(a.roll_deg), a.roll_sigma_deg, 3),
            with_sigma(a.height, a.height_sigma, 5),
            with_sigma(above, a.horizon_sigma_px, 2),
        )?;
    }
    writeln!(w, "{rule}")
}

/// Where each view is and where it looks.
fn views(w: &mut String, c: &Calibration, rule: &str) -> std::fmt::Result {
    writeln!(w, "{rule}")?;
    let width = c.views.iter().map(|v| v.image.len()).max().unwrap_or(4).clamp(8, 24);
    writeln!(
        w,
        "{:<width$}  {:<width$}{:>17}{:>8}{:>8}{:>16}{:>16}{:>16}",
        "view", "origin", "heading (deg)", "pitch", "roll", "x", "y", "height"
    )?;
    for v in &c.views {
        let coordinate = |i: usize| with_sigma(v.position.map(|p| p[i]), v.position_sigma.map(|s| s[i]), 4);
        writeln!(
            w,
            "{:<width$}  {:<width$}{:>17}{:>8.2}{:>8.2}{:>16}{:>16}{:>16}",
            v.image,
            v.origin,
            with_sigma(Some(v.yaw_deg), Some(v.yaw_sigma_deg), 3),
            v.pitch_down_deg,
            v.roll_deg,
            coordinate(0),
            coordinate(1),
            coordinate(2),
        )?;
    }
    writeln!(w, "{rule}")
}

/// What was left out and why: pairs with a plane one by one (some, or all with `--verbose`), the others by number.
fn not_used(w: &mut String, c: &Calibration, verbose: bool) -> std::fmt::Result {
    let left: Vec<&MotionReport> = c.motions.iter().filter(|m| !m.used && !m.tie).collect();
    if left.is_empty() {
        return Ok(());
    }
    let with_plane = left.iter().filter(|m| m.rotation_deg.is_some()).count();
    let list_all = verbose || left.len() <= MAX_LISTED;
    writeln!(
        w,
        "not used: {} pairs; {with_plane} with a common plane, {} without one or with too few matches{}",
        left.len(),
        left.len() - with_plane,
        if list_all { ":" } else { " (all: --verbose, or calibration.json)" }
    )?;
    let mut listed = 0;
    for m in &left {
        if !list_all && (m.rotation_deg.is_none() || listed == MAX_LISTED) {
            continue;
        }
        listed += 1;
        let reason = m.reason.as_deref().unwrap_or("-");
        let turn = m.rotation_deg.map_or(String::new(), |t| format!(" ({t:.1} deg, {} matches)", m.matches));
        writeln!(w, "{}", wrapped(&format!("{} - {}{turn}: {reason}", m.from, m.to), 2))?;
    }
    if listed < with_plane {
        writeln!(w, "  ... and {} more", with_plane - listed)?;
    }
    Ok(())
}

/// Lines of the page's width, indented.
pub fn wrapped(text: &str, indent: usize) -> String {
    let mut out = String::new();
    let mut column = 0;
    for word in text.split_whitespace() {
        let length = word.chars().count();
        if column == 0 || column + 1 + length > WIDTH {
            if column > 0 {
                out.push('\n');
            }
            out.push_str(&" ".repeat(indent));
            column = indent;
        } else {
            out.push(' ');
            column += 1;
        }
        out.push_str(word);
        column += length;
    }
    out
}
