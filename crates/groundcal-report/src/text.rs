//! The summary for people, in the style of a statistics package: what it was made from, the camera with its error bars, the motions,
//! the attitudes, what was left out, the warnings.

use groundcal::{
    geometry::lens::Lens,
    numerics::statistics::NORMAL_95,
    remedy::Wording,
    result::{
        Calibration, LensSource, Method, MotionReport, Parameter, Scene, Verdict, VerdictLevel, VerdictReason, Warning,
    },
};

use crate::{
    number::{fixed, or_dash, with_sigma},
    terminal::{self, Table, centred, facts, rule, wrapped},
};

/// Pairs not used that are listed one by one without `verbose`.
const MAX_LISTED: usize = 8;

/// What the summary shows, and how wide.
#[derive(Debug, Clone, Copy)]
pub struct SummaryOptions {
    /// Columns of the terminal.
    pub width: usize,
    /// Whether every view, and every pair that was not used, is listed.
    pub verbose: bool,
}

impl Default for SummaryOptions {
    fn default() -> Self {
        Self { width: terminal::WIDTH, verbose: false }
    }
}

/// The page, in the words of a front end.
pub fn summary(c: &Calibration, options: &SummaryOptions, wording: &dyn Wording) -> String {
    let SummaryOptions { width, verbose } = *options;
    let (double, single) = (rule('=', width), rule('-', width));
    let title = format!("groundcal {}: camera from floor motions", env!("CARGO_PKG_VERSION"));
    let mut blocks = vec![camera(c).text(width)];
    if !c.priors.is_empty() {
        blocks.push(priors(c).text(width));
    }
    blocks.push(motions(c).text(width) + &misfits(c, width, wording));
    if !c.attitudes.is_empty() {
        blocks.push(attitudes(c).text(width));
    }
    if verbose && !c.views.is_empty() {
        blocks.push(views(c).text(width));
    }
    let left = not_used(c, options);
    if !left.is_empty() {
        blocks.push(left);
    }
    let notes: String = notes(c, verbose).iter().map(|note| wrapped(note, 0, width) + "\n").collect();
    let warning = |w: &Warning| format!("\nwarning [{}]\n{}\n", w.code(), wrapped(&w.message(wording), 2, width));
    let warnings: String = c.warnings.iter().map(warning).collect();
    let verdict = c.verdict.as_ref().map_or(String::new(), |v| wrapped(&verdict_line(v), 0, width) + "\n\n");
    let reason = |r: &&VerdictReason| format!("\nverdict [{}]\n{}\n", r.code, wrapped(&r.message, 2, width));
    let reasons: String = beside_warnings(c).iter().map(reason).collect();
    format!(
        "{verdict}{}\n{double}\n{}{double}\n{}{double}\n{notes}{reasons}{warnings}",
        centred(&title, width),
        facts(&made_from(c), width),
        blocks.join(&format!("{single}\n")),
    )
}

/// The verdict in a line: the level, and the names of the reasons, which stand in full among the warnings or beside them.
pub(crate) fn verdict_line(v: &Verdict) -> String {
    let codes: Vec<&str> = v.reasons.iter().map(|r| r.code.as_str()).collect();
    let because = if codes.is_empty() { String::new() } else { format!(": {}", codes.join(", ")) };
    let means = match v.level {
        VerdictLevel::Trustworthy => "what was assumed was tried against the images, and held",
        VerdictLevel::Usable => "the images decide less than all; what they leave open is in the error bars",
        VerdictLevel::Unchecked => "the error bars may not hold",
        VerdictLevel::Contradicted => "the images contradict it",
    };
    format!("Verdict: {} ({means}){because}", v.level.name())
}

/// Reasons of the verdict that are no warnings.
pub(crate) fn beside_warnings(c: &Calibration) -> Vec<&VerdictReason> {
    let warned = |r: &&VerdictReason| c.warnings.iter().any(|w| w.code() == r.code);
    c.verdict.iter().flat_map(|v| &v.reasons).filter(|r| !warned(r)).collect()
}

/// Input, method and fit.
fn made_from(c: &Calibration) -> Vec<(&'static str, String)> {
    let [width, height] = c.camera.image_size;
    let used = c.motions.iter().filter(|m| m.used).count();
    let method = match c.method {
        Method::Joint => "joint refinement",
        Method::Rotating => "rotating camera, covariance-weighted",
        Method::Linear => "linear, covariance-weighted, polished",
        Method::Kzr => "linear as published (Knight, Zisserman & Reid 2003)",
    };
    let estimated = if c.attitude_sigma_estimated { ", estimated" } else { "" };
    let mut list = vec![
        ("Images", format!("{}, {width} x {height} px", c.evidence.images.len())),
        ("Method", method.into()),
        ("Motions used", format!("{used} of {} pairs", c.motions.len())),
        ("Constraint", c.constraint.to_string()),
        ("Attitudes", c.attitudes.len().to_string()),
        ("Attitude sigma", format!("{} deg a view{estimated}", fixed(c.attitude_sigma_deg, 3))),
    ];
    if let Some(r) = &c.fit.refinement {
        let scene = match c.scene {
            Some(Scene::Directions) => "far away, the camera turns on the spot".to_string(),
            Some(Scene::Floor) | None => format!("floor; {} ties between attitudes", r.ties),
        };
        list.push(("Scene", scene));
        let heights = c.height_sigma.map_or("no part".into(), |s| format!("{} % a view", fixed(100.0 * s, 3)));
        list.push(("Height sigma", heights));
        let kinds = [("patches", &r.patches), ("points", &r.points)].into_iter().filter_map(|(kind, k)| {
            let k = k.as_ref()?;
            let (variance, design) = (fixed(k.variance_factor, 2), fixed(k.design_effect, 1));
            Some(format!("{} of {kind} ({variance}, {design})", k.observations))
        });
        list.push(("Observations", kinds.collect::<Vec<_>>().join(", ")));
    }
    let chi_squared = match c.fit.degrees_of_freedom {
        0 => "none left over to check by".to_string(),
        n => format!("{} for {n} degrees of freedom", fixed(c.fit.chi_squared, 1)),
    };
    list.push(("Chi-squared", chi_squared));
    list.push(("Distortion", distortion(c)));
    list
}

fn distortion(c: &Calibration) -> String {
    let d = &c.camera.distortion;
    match (d.source, d.lens.is_none()) {
        (LensSource::Given, _) => format!("given: {}", given(&d.lens)),
        (LensSource::Estimated, true) => "estimated: none found".into(),
        (source @ (LensSource::Estimated | LensSource::NotModelled), _) => source.name().into(),
    }
}

/// A lens's parameters; of Brown-Conrady k1 and k2, and of the others those that are not zero.
fn given(lens: &Lens) -> String {
    let model = if matches!(lens, Lens::Radtan(_)) { String::new() } else { format!("{}, ", lens.name()) };
    let named = lens.parameter_names().iter().zip(lens.parameters()).enumerate();
    let said =
        named.filter(|(i, (_, value))| *i < 2 || *value != 0.0).map(|(_, (name, value))| format!("{name} {value}"));
    model + &said.collect::<Vec<_>>().join(", ")
}

/// The camera's numbers with their error bars.
fn camera(c: &Calibration) -> Table {
    let mut table = Table::new()
        .name("")
        .number("estimate\npx")
        .number("std. error\npx")
        .number("95 % interval\npx")
        .number("std. error\n% of fx");
    for p in Parameter::ALL {
        let value = c.value(p);
        let decimals = if p.is_of_lens() { 5 } else { 3 };
        match c.standard_deviation(p) {
            Some(sigma) => {
                let [low, high] = [-NORMAL_95, NORMAL_95].map(|t| fixed(value + t * sigma, decimals));
                let of_fx = if p.is_of_lens() { String::new() } else { fixed(100.0 * sigma / c.camera.fx, 3) };
                let [estimate, error] = [value, sigma].map(|v| fixed(v, decimals));
                table.row([p.to_string(), estimate, error, format!("{low} to {high}"), of_fx]);
            }
            None if p.is_of_lens() => {}
            None => table.row([p.to_string(), fixed(value, decimals), "held".into()]),
        }
    }
    table
}

/// What was assumed beforehand, and what is left of it.
fn priors(c: &Calibration) -> Table {
    let mut table = Table::new().name("prior").number("mean").number("std. dev.").number("narrowed by the images to");
    for p in &c.priors {
        let unit = if p.parameter.is_in_pixels() { ", px" } else { "" };
        let narrowed = fixed(100.0 * p.posterior_over_prior.min(1.0), 0);
        table.row([format!("{}{unit}", p.parameter), fixed(p.mean, 3), fixed(p.sigma, 3), format!("{narrowed} %")]);
    }
    table
}

/// The motions used.
fn motions(c: &Calibration) -> Table {
    let mut table = Table::new()
        .name("from")
        .name("to")
        .number("turn (deg)")
        .number("rho")
        .number("matches")
        .number("rms px")
        .number("pitch")
        .number("roll");
    for m in c.motions.iter().filter(|m| m.used) {
        let attitude = m.attitude.and_then(|a| c.attitudes.get(a));
        table.row([
            m.from.clone(),
            m.to.clone(),
            with_sigma(m.rotation_deg, m.rotation_sigma_deg, 3),
            with_sigma(m.rho, m.rho_sigma, 4),
            m.matches.to_string(),
            or_dash(m.rms_px, 2),
            or_dash(attitude.map(|a| a.pitch_down_deg), 2),
            or_dash(attitude.map(|a| a.roll_deg), 2),
        ]);
    }
    table.without_empty_columns()
}

/// Motions used that do not fit the others.
fn misfits(c: &Calibration, width: usize, wording: &dyn Wording) -> String {
    let misfit = |m: &MotionReport| {
        let message = m.diagnosis.and_then(|d| d.verdict.message(wording))?;
        Some(wrapped(&format!("does not fit: {} - {}: {message}", m.from, m.to), 2, width) + "\n")
    };
    c.motions.iter().filter_map(misfit).collect()
}

/// The camera over the floor: angles, height and horizon of each attitude.
fn attitudes(c: &Calibration) -> Table {
    let mut table = Table::new()
        .name("attitude")
        .number("pitch (deg)")
        .number("roll (deg)")
        .number(if c.camera_height_m.is_some() { "height (m)" } else { "height" })
        .number("horizon\n(deg)")
        .number("above centre\n(px)");
    let [x, y] = c.camera.size().centre_px();
    for (i, a) in c.attitudes.iter().enumerate() {
        // Clockwise as the image is shown; the line's (a, b) points up, away from the floor.
        let turned = a.horizon_px.map(|[p, q, _]| (-p / q).atan().to_degrees());
        let above = a.horizon_px.map(|[p, q, r]| -(p * x + q * y + r));
        table.row([
            i.to_string(),
            with_sigma(Some(a.pitch_down_deg), a.pitch_down_sigma_deg, 3),
            with_sigma(Some(a.roll_deg), a.roll_sigma_deg, 3),
            with_sigma(a.height, a.height_sigma, 5),
            or_dash(turned, 3),
            with_sigma(above, a.horizon_sigma_px, 2),
        ]);
    }
    table
}

/// Where each view is and where it looks.
fn views(c: &Calibration) -> Table {
    let mut table = Table::new()
        .name("view")
        .name("origin")
        .number("heading (deg)")
        .number("pitch")
        .number("roll")
        .number("x")
        .number("y")
        .number("height");
    for v in &c.views {
        let coordinate = |i: usize| with_sigma(v.position.map(|p| p[i]), v.position_sigma.map(|s| s[i]), 4);
        table.row([
            v.image.clone(),
            v.origin.clone(),
            with_sigma(Some(v.yaw_deg), Some(v.yaw_sigma_deg), 3),
            fixed(v.pitch_down_deg, 2),
            fixed(v.roll_deg, 2),
            coordinate(0),
            coordinate(1),
            coordinate(2),
        ]);
    }
    table
}

/// What was left out and why: pairs with a plane one by one (some, or all with `verbose`), the others by number.
fn not_used(c: &Calibration, options: &SummaryOptions) -> String {
    let left: Vec<&MotionReport> = c.motions.iter().filter(|m| !m.used && !m.tie).collect();
    if left.is_empty() {
        return String::new();
    }
    let with_plane = left.iter().filter(|m| m.rotation_deg.is_some()).count();
    let list_all = options.verbose || left.len() <= MAX_LISTED;
    let head = format!(
        "not used: {} pairs; {with_plane} with a common plane, {} without one or with too few matches{}",
        left.len(),
        left.len() - with_plane,
        if list_all { ":" } else { " (all: --verbose, or calibration.json)" }
    );
    let shown: Vec<&MotionReport> =
        if list_all { left } else { left.into_iter().filter(|m| m.rotation_deg.is_some()).take(MAX_LISTED).collect() };
    let mut out = wrapped(&head, 0, options.width) + "\n";
    for m in &shown {
        let reason = m.reason.as_deref().unwrap_or("-");
        let turn = m.rotation_deg.map_or(String::new(), |t| format!(" ({} deg, {} matches)", fixed(t, 1), m.matches));
        out += &(wrapped(&format!("{} - {}{turn}: {reason}", m.from, m.to), 2, options.width) + "\n");
    }
    if shown.len() < with_plane {
        out += &format!("  ... and {} more\n", with_plane - shown.len());
    }
    out
}

/// What the words and numbers mean.
fn notes(c: &Calibration, verbose: bool) -> Vec<String> {
    let mut notes = vec![
        "Pixel (0,0) is the centre of the top-left pixel. turn: of the camera, anticlockwise seen from above; rho: height of the second \
         view over the floor in units of the first's (1: constant height); pitch: optical axis below the horizon; roll: right-hand side \
         down; both in degrees."
            .to_string(),
    ];
    if !c.attitudes.is_empty() {
        let unit = match (c.camera_height_m, c.views.is_empty()) {
            (Some(metres), _) => format!("height: {metres} m at the first view of each set"),
            (None, false) => "height: 1 at the first view of each set".into(),
            (None, true) => "height: not estimated".into(),
        };
        notes.push(format!(
            "{unit}; horizon: of the undistorted image, turned clockwise against its rows, and how far above the image's centre it \
             passes (square to it; negative: below)."
        ));
    }
    if c.fit.refinement.is_some() {
        notes.push(
            "Observations: in brackets the variance of the residuals over that under single homographies, and how much more neighbours \
             have in common than independent ones would; both are in the error bars."
                .into(),
        );
    }
    if verbose && !c.views.is_empty() {
        notes.push(format!(
            "Views: +X is the heading of the view named as origin, Z up, its optical centre is at (0, 0, {}); heading anticlockwise seen \
             from above.",
            c.camera_height_m.map_or("1".into(), |m| format!("{m} m"))
        ));
    }
    notes
}
