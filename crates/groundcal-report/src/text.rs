//! The summary for people: whether to trust it, what it was made from, the camera with its error bars, what to beware of. With
//! `verbose`, in the style of a statistics package, also the motions, the attitudes, the views, what was assumed and what was left out.

use groundcal::{
    Wording,
    geometry::Lens,
    result::{
        Calibration, CameraOnBase, LensSource, Method, MotionKind, MotionReport, Parameter, Scene, Verdict,
        VerdictLevel, VerdictReason, level_with,
    },
};

use crate::{
    number::{decimals_of_sigma, fixed, interval_95, or_dash, with_sigma},
    terminal::{self, Line, Look, Table, centred, facts, rule, wrapped},
    uncertainty::in_short,
};

/// Lines of a summary without `verbose`, if its camera and its first warning leave it the choice: terminals have 24 to 60.
const SCREEN_LINES: usize = 40;

/// What the summary shows, and how wide.
#[derive(Debug, Clone, Copy)]
pub struct SummaryOptions<'a> {
    /// Columns of the terminal.
    pub width: usize,
    /// Whether everything is listed, or what fits a screen.
    pub verbose: bool,
    /// Where the rest stands, in the words of a front end; its last line without `verbose`.
    pub more: &'a str,
}

impl Default for SummaryOptions<'_> {
    fn default() -> Self {
        Self { width: terminal::WIDTH, verbose: false, more: "" }
    }
}

/// The summary as plain text, in the words of a front end.
pub fn summary(c: &Calibration, options: &SummaryOptions, wording: &dyn Wording) -> String {
    summary_lines(c, options, wording).iter().map(|line| format!("{}\n", line.text)).collect()
}

/// The summary line by line, with the look of each.
pub fn summary_lines(c: &Calibration, options: &SummaryOptions, wording: &dyn Wording) -> Vec<Line> {
    let width = options.width;
    let mut lines = Vec::new();
    if let Some(v) = &c.verdict {
        lines.extend(Line::all(&wrapped(&verdict_line(v), 0, width), look_of(v.level)));
        lines.push(Line::plain(""));
    }
    if options.verbose {
        let (double, single) = (rule('=', width), rule('-', width));
        let title = format!("groundcal {}: camera from {} images", env!("CARGO_PKG_VERSION"), c.evidence.images.len());
        let blocks = blocks(c, width, wording).join(&format!("{single}\n"));
        let notes: String = notes(c).iter().map(|note| wrapped(note, 0, width) + "\n").collect();
        let facts = facts(&[made_from(c), how(c)].concat(), width);
        let text = format!("{}\n{double}\n{facts}{double}\n{blocks}{double}\n{notes}", centred(&title, width));
        lines.extend(Line::all(&text, Look::Plain));
    } else {
        lines.extend(Line::all(&facts(&made_from(c), width), Look::Plain));
        lines.push(Line::plain(""));
        lines.extend(Line::all(&camera(c).text(width), Look::Plain));
    }
    // What is said at the end has its place, too.
    let more = if options.verbose || options.more.is_empty() { Vec::new() } else { vec![Line::plain(""); 2] };
    let room = if options.verbose { usize::MAX } else { SCREEN_LINES.saturating_sub(lines.len() + more.len()) };
    lines.extend(doubts(c, room, options, wording));
    if !more.is_empty() {
        lines.push(Line::plain(""));
        lines.extend(Line::all(&wrapped(options.more, 0, width), Look::Faint));
    }
    lines
}

/// The tables, one below the other.
fn blocks(c: &Calibration, width: usize, wording: &dyn Wording) -> Vec<String> {
    let mut blocks = vec![camera(c).text(width)];
    if !c.priors.is_empty() {
        blocks.push(priors(c).text(width));
    }
    blocks.push(motions(c).text(width) + &misfits(c, width, wording));
    if !c.attitudes.is_empty() {
        blocks.push(attitudes(c).text(width));
    }
    if !c.views.is_empty() {
        blocks.push(views(c).text(width));
    }
    let left = not_used(c, width);
    if !left.is_empty() {
        blocks.push(left);
    }
    blocks
}

fn look_of(level: VerdictLevel) -> Look {
    match level {
        VerdictLevel::Trustworthy => Look::Good,
        VerdictLevel::Usable => Look::Doubt,
        VerdictLevel::Unchecked | VerdictLevel::Contradicted => Look::Bad,
    }
}

/// A warning, or a reason of the verdict that is none.
struct Doubt {
    /// Its place among the reasons of the verdict, of which those that weigh most come first.
    rank: usize,
    level: Option<VerdictLevel>,
    /// Its heading.
    kind: &'static str,
    code: String,
    message: String,
}

/// Warnings and other reasons of the verdict, the gravest first. Those of one code beside each other; of each code the first one in full where there
/// is not room for all.
fn doubts(c: &Calibration, room: usize, options: &SummaryOptions, wording: &dyn Wording) -> Vec<Line> {
    let reasons: &[VerdictReason] = c.verdict.as_ref().map_or(&[], |v| &v.reasons);
    let rank = |code: &str| reasons.iter().position(|r| r.code == code).unwrap_or(reasons.len());
    let mut all: Vec<Doubt> = Vec::new();
    for r in beside_warnings(c) {
        // Those that are no warnings do not say their level; the verdict's is the worst of all.
        let level = c.verdict.as_ref().map(|v| v.level).filter(|_| rank(&r.code) == 0).or(Some(VerdictLevel::Usable));
        all.push(Doubt {
            rank: rank(&r.code),
            level,
            kind: "verdict",
            code: r.code.clone(),
            message: r.message.clone(),
        });
    }
    all.extend(c.warnings.iter().map(|w| Doubt {
        rank: rank(w.code()),
        level: level_with(w),
        kind: "warning",
        code: w.code().into(),
        message: w.message(wording),
    }));
    let first: Vec<usize> = all.iter().map(|d| all.iter().position(|e| e.code == d.code).unwrap_or(0)).collect();
    let mut order: Vec<usize> = (0..all.len()).collect();
    order.sort_by_key(|&i| (all[i].rank, std::cmp::Reverse(all[i].level), first[i], i));
    let (mut lines, mut unsaid) = (Vec::new(), Vec::new());
    for i in order {
        let (d, alike) = (&all[i], first.iter().filter(|f| **f == first[i]).count());
        if !options.verbose && first[i] != i {
            continue;
        }
        let others = match alike - 1 {
            0 => String::new(),
            _ if options.verbose => String::new(),
            n => format!(", and {n} more like it"),
        };
        let mut of_it = vec![Line::plain("")];
        let look = d.level.map_or(Look::Strong, look_of);
        of_it.extend(Line::all(&wrapped(&format!("{} [{}]{others}", d.kind, d.code), 0, options.width), look));
        of_it.extend(Line::all(&wrapped(&d.message, 2, options.width), Look::Plain));
        // The gravest is said whatever it takes; two lines stay for the names of the others.
        if lines.is_empty() || lines.len() + of_it.len() + 2 <= room {
            lines.extend(of_it);
        } else {
            unsaid.push(d.code.as_str());
        }
    }
    if !unsaid.is_empty() {
        lines.push(Line::plain(""));
        lines.extend(Line::all(&wrapped(&format!("and also: {}", unsaid.join(", ")), 0, options.width), Look::Strong));
    }
    lines
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
    format!("Verdict: {} ({means}){because}", v.level)
}

/// Reasons of the verdict that are no warnings.
pub(crate) fn beside_warnings(c: &Calibration) -> Vec<&VerdictReason> {
    let warned = |r: &&VerdictReason| c.warnings.iter().any(|w| w.code() == r.code);
    c.verdict.iter().flat_map(|v| &v.reasons).filter(|r| !warned(r)).collect()
}

/// Whether the camera turned on the spot: nothing of its answer is about a floor.
fn turns_on_the_spot(c: &Calibration) -> bool {
    c.scene == Some(Scene::Directions)
}

/// What everybody asks for.
fn made_from(c: &Calibration) -> Vec<(&'static str, String)> {
    let [width, height] = c.camera.image_size;
    let used = c.motions.iter().filter(|m| m.used).count();
    let general = c.motion == Some(MotionKind::General);
    let mut list = vec![
        ("Images", format!("{}, {width} x {height} px", c.evidence.images.len())),
        (if general { "Pairs used" } else { "Motions used" }, format!("{used} of {} pairs", c.motions.len())),
    ];
    let refinement = c.fit.refinement.as_ref();
    if let Some((rms_px, r)) = refinement.and_then(|r| Some((r.reprojection_rms_px?, r))) {
        list.push(("Reprojection", format!("{} px rms", fixed(rms_px, decimals_of_sigma(rms_px).min(4)))));
        list.push(("Points", format!("{}, seen {} times", r.tracks, r.observations)));
    }
    let grid = c.projection_uncertainty.as_ref();
    if let Some([middle, _, most]) = grid.and_then(|g| in_short(g, &g.distant_px)) {
        let [middle, most] = [middle, most].map(|v| fixed(v, decimals_of_sigma(v).min(4)));
        list.push(("Expected error", format!("{middle} px, at most {most}")));
    }
    if turns_on_the_spot(c) {
        list.push(("Scene", "far away: it turned on the spot".into()));
    } else if general {
        list.push(("Motion", "any, before one plane".into()));
    } else {
        list.push(("Attitudes", c.attitudes.len().to_string()));
    }
    list.push(("Lens", distortion(c)));
    if let Some(height_m) = c.camera_height_m {
        let sigma = c.camera_height_sigma_m;
        let decimals = sigma.filter(|s| *s > 0.0).map_or(3, decimals_of_sigma);
        list.push(("Camera height", format!("{} m", with_sigma(Some(height_m), sigma, decimals))));
    }
    list.extend(c.on_base.iter().map(|b| ("On the base", on_base(b))));
    list
}

/// The camera on a robot, in a sentence.
fn on_base(b: &CameraOnBase) -> String {
    let value = |v: f64, sigma: f64| with_sigma(Some(v), Some(sigma), decimals_of_sigma(sigma).min(5));
    let place = match (b.position_m, b.position_sigma_m) {
        (Some([x, y]), Some([sx, sy])) => format!("{} m ahead, {} m to the left", value(x, sx), value(y, sy)),
        _ => "place not shown (the base hardly turned)".into(),
    };
    format!(
        "{place}, {} m up, heading {} deg to the left, attitude {}; from {} motions, odometry errs by {} % of the way",
        value(b.height_m, b.height_sigma_m),
        value(b.yaw_deg, b.yaw_sigma_deg),
        attitude_number(b.attitude),
        b.motions,
        fixed(100.0 * b.relative_noise, 1)
    )
}

/// How it was found, and how well all agrees.
fn how(c: &Calibration) -> Vec<(&'static str, String)> {
    let method = match c.method {
        Method::Joint => "joint refinement",
        Method::Rotating => "rotating camera, covariance-weighted",
        Method::Linear => "linear, covariance-weighted, polished",
        Method::Kzr => "linear as published (Knight, Zisserman & Reid 2003)",
        Method::Transferred => "one motion transferred, linear (Knight, Zisserman & Reid 2003, 2.3)",
    };
    let estimated = if c.attitude_sigma_estimated { ", estimated" } else { "" };
    let mut list = vec![("Method", method.to_string()), ("Constraint", c.constraint.to_string())];
    let attitude_sigma = match c.motion {
        Some(MotionKind::General) => "every view has an attitude of its own".into(),
        _ => format!("{} deg a view{estimated}", fixed(c.attitude_sigma_deg, 3)),
    };
    list.push(("Attitude sigma", attitude_sigma));
    if let Some(r) = &c.fit.refinement {
        if !turns_on_the_spot(c) {
            list.push(("Scene", format!("floor; {} links between attitudes", r.cross_attitude_links)));
        }
        if let Some(s) = c.height_sigma {
            list.push(("Height sigma", format!("{} % a view", fixed(100.0 * s, 3))));
        }
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
    list
}

fn distortion(c: &Calibration) -> String {
    let d = &c.camera.distortion;
    match (d.source, d.lens.is_none()) {
        (LensSource::Given, _) => format!("given: {}", given(&d.lens)),
        (LensSource::Estimated, true) => "estimated: none found".into(),
        (source @ (LensSource::Estimated | LensSource::NotModelled), _) => source.to_string(),
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
                let [low, high] = interval_95(value, sigma).map(|v| fixed(v, decimals));
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
        use groundcal::PriorParameter::{Cx, Cy, Fx, Skew};
        let unit = if matches!(p.parameter, Fx | Cx | Cy | Skew) { ", px" } else { "" };
        let narrowed = fixed(100.0 * p.posterior_over_prior.min(1.0), 0);
        table.row([format!("{}{unit}", p.parameter), fixed(p.mean, 3), fixed(p.sigma, 3), format!("{narrowed} %")]);
    }
    table
}

/// The motions used. Of a camera that turned on the spot there is no height to compare.
fn motions(c: &Calibration) -> Table {
    let mut table = Table::new()
        .name("from")
        .name("to")
        .number("turn (deg)")
        .number("height ratio")
        .number("matches")
        .number("rms px")
        .number("attitude");
    let floor = !turns_on_the_spot(c);
    for m in c.motions.iter().filter(|m| m.used) {
        table.row([
            m.from.clone(),
            m.to.clone(),
            with_sigma(m.rotation_deg, m.rotation_sigma_deg, 3),
            with_sigma(m.height_ratio.filter(|_| floor), m.height_ratio_sigma, 4),
            m.matches.to_string(),
            or_dash(m.rms_px, 2),
            m.attitude.filter(|_| floor).map_or("-".into(), attitude_number),
        ]);
    }
    table.without_empty_columns()
}

/// Attitudes are counted from 1 wherever people read of them.
fn attitude_number(index: usize) -> String {
    (index + 1).to_string()
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
    let [x, y] = c.camera.model().size.centre_px();
    for (i, a) in c.attitudes.iter().enumerate() {
        // Clockwise as the image is shown; the line's (a, b) points up, away from the floor.
        let turned = a.horizon_px.map(|[p, q, _]| (-p / q).atan().to_degrees());
        let above = a.horizon_px.map(|[p, q, r]| -(p * x + q * y + r));
        table.row([
            attitude_number(i),
            with_sigma(Some(a.pitch_down_deg), a.pitch_down_sigma_deg, 3),
            with_sigma(Some(a.roll_deg), a.roll_sigma_deg, 3),
            with_sigma(a.height, a.height_sigma, 5),
            or_dash(turned, 3),
            with_sigma(above, a.horizon_sigma_px, 2),
        ]);
    }
    table.without_empty_columns()
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
    table.without_empty_columns()
}

/// What was left out and why.
fn not_used(c: &Calibration, width: usize) -> String {
    let left: Vec<&MotionReport> = c.motions.iter().filter(|m| !m.used && !m.cross_attitude_link).collect();
    if left.is_empty() {
        return String::new();
    }
    let with_plane = left.iter().filter(|m| m.matches > 0).count();
    let what = if turns_on_the_spot(c) { "a common turn" } else { "a common plane" };
    let head = format!(
        "not used: {} pairs; {with_plane} with {what}, {} without one or with too few matches:",
        left.len(),
        left.len() - with_plane,
    );
    let mut out = wrapped(&head, 0, width) + "\n";
    for m in &left {
        let reason = m.reason.as_deref().unwrap_or("-");
        let turn = m.rotation_deg.map_or(String::new(), |t| format!(" ({} deg, {} matches)", fixed(t, 1), m.matches));
        out += &(wrapped(&format!("{} - {}{turn}: {reason}", m.from, m.to), 2, width) + "\n");
    }
    out
}

/// What the words and numbers mean.
fn notes(c: &Calibration) -> Vec<String> {
    let convention = "Pixel (0,0) is the centre of the top-left pixel.";
    let mut notes = Vec::new();
    if turns_on_the_spot(c) {
        notes.push(format!(
            "{convention} turn: of the camera, in degrees, anticlockwise seen from above; pitch and roll, where there are any: of the optical \
             axis below the plane that the axis of turning is square to, and about it (right-hand side down)."
        ));
    } else {
        notes.push(format!(
            "{convention} turn: of the camera, anticlockwise seen from above; height ratio: height of the second view over the floor in units of the \
             first's (1: constant height); pitch: optical axis below the horizon; roll: right-hand side down; both in degrees."
        ));
        let unit = match (c.camera_height_m, c.views.is_empty()) {
            (Some(metres), _) => format!("height: {} m at the first view of each set", fixed(metres, 4)),
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
            "Reprojection: root mean square distance of points from where the camera shows them. Expected error: of where a point far away is shown, \
             after the rotation that fits best, in the middle of the image and where it is largest. Observations: in brackets the variance of \
             the residuals over that under single homographies, and how much more neighbours have in common than independent ones would; both \
             are in the error bars."
                .into(),
        );
    }
    if !c.views.is_empty() && !turns_on_the_spot(c) {
        notes.push(format!(
            "Views: +X is the heading of the view named as origin, Z up, its optical centre is at (0, 0, {}); heading anticlockwise seen \
             from above.",
            c.camera_height_m.map_or("1".into(), |m| format!("{} m", fixed(m, 4)))
        ));
    }
    notes
}
