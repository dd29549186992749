//! The third experiment: three pictures, forward, three more. A handful of matches a motion given, as by hand, many times; and
//! the pictures themselves.

use std::fmt::Write;

use groundcal::{
    Error, LensModel, Options, Silent, calibrate_matches, geometry::Frame, pairs::ImagePair, start::Constraint,
};
use rayon::prelude::*;

use crate::{
    error::LabError,
    experiments::{
        methods::{self, Scores},
        setup::{Description, ExperimentOutput, Setup, accept, motions},
        table::Line,
    },
    renderer::{
        floor_matches::floor_matches,
        scene::{Group, Scene},
    },
    tables::{csv, six_digits},
};

/// The experiment.
pub(crate) const DESCRIPTION: Description = Description {
    name: "mobile-head",
    scene: include_str!("../../scenes/mobile-head.toml"),
    paper: "focal length 8.2 % off",
};

/// Motions with a turn among the six views: neighbours in the pan before and after driving, and two across the drive.
const PAIRS: [(usize, usize); 6] = [(0, 1), (1, 2), (3, 4), (4, 5), (1, 3), (1, 5)];
/// Noise of a point picked by hand, pixels.
const HAND_SIGMA_PX: f64 = 0.7;
/// Matches of a motion, fewest and most.
const HAND_MATCHES: [usize; 2] = [6, 8];
/// Draws of given matches.
const DRAWS: u64 = 200;
const QUICK_DRAWS: u64 = 40;

/// Endings of the files of draws: of the one elevation, and of a small range of them.
pub(crate) const ENDINGS: [&str; 2] = ["_draws.csv", "_elevations.csv"];

type Outcome = Result<Scores, Error>;

/// What is tried on each draw.
struct Case {
    constraint: Constraint,
    method: &'static str,
    /// Whether it is told the true principal point.
    told_centre: bool,
}

const fn case(constraint: Constraint, method: &'static str, told_centre: bool) -> Case {
    Case { constraint, method, told_centre }
}

/// At the one elevation.
const CASES: [Case; 4] = [
    case(Constraint::Focal, "linear", false),
    case(Constraint::Focal, "groundcal", false),
    case(Constraint::Focal, "linear", true),
    case(Constraint::Focal, "groundcal", true),
];

/// The paper's table 1: a minimal set over a small range of orientations, one pan at each elevation, under four constraints.
const ELEVATIONS_DEG: [f64; 3] = [39.0, 42.0, 45.0];
const PAIRS_OF_ELEVATIONS: [(usize, usize); 3] = [(0, 1), (2, 3), (4, 5)];
const CASES_OF_ELEVATIONS: [Case; 9] = [
    case(Constraint::Focal, "linear", false),
    case(Constraint::Focal, "groundcal", false),
    case(Constraint::FixedPrincipalPoint, "linear", false),
    case(Constraint::FixedPrincipalPoint, "groundcal", false),
    case(Constraint::Square, "linear", false),
    case(Constraint::Square, "groundcal", false),
    case(Constraint::ZeroSkew, "linear", false),
    case(Constraint::ZeroSkew, "groundcal", false),
    case(Constraint::Auto, "groundcal", false),
];

/// A scene of given matches and what is tried on them.
struct Given<'a> {
    scene: &'a Scene,
    pairs: &'a [(usize, usize)],
    cases: &'a [Case],
}

/// What each of the cases makes of one draw of matches.
type Draw = Vec<Outcome>;

/// Draws matches, renders, calibrates and sums up.
pub(crate) fn run(setup: &Setup) -> Result<ExperimentOutput, LabError> {
    let one = Given { scene: &setup.full_scene, pairs: &PAIRS, cases: &CASES };
    let elevations = elevations_of(&setup.full_scene);
    let several = Given { scene: &elevations, pairs: &PAIRS_OF_ELEVATIONS, cases: &CASES_OF_ELEVATIONS };
    let all_draws = |given: &Given| -> Result<Vec<Draw>, LabError> {
        let numbers = 0..if setup.quick { QUICK_DRAWS } else { DRAWS };
        numbers.into_par_iter().map(|number| draw(setup, given, number)).collect()
    };
    let (draws, of_range) = (all_draws(&one)?, all_draws(&several)?);
    let of_draws = [
        setup.file(ENDINGS[0], draws_table(one.cases, &draws)?),
        setup.file(ENDINGS[1], draws_table(several.cases, &of_range)?),
    ];

    let pictures = setup.pictures(&PAIRS, 3)?;
    let measured = methods::measure(&pictures.matched, setup.frame(false), &setup.options(Constraint::Focal, false))?;
    let mut lines = Vec::new();
    if let Some(first) = draws.first() {
        lines.extend(CASES.iter().zip(first).map(|(&Case { constraint, method, told_centre }, outcome)| Line {
            input: "given",
            constraint,
            told_centre,
            method,
            motions: PAIRS.len(),
            outcome: outcome.clone(),
        }));
    }
    lines.extend(setup.lines(&pictures, &[Constraint::Focal, Constraint::Auto])?);
    let (of_lines, table) = setup.table(&lines)?;
    let files = of_draws.into_iter().chain(pictures.files).chain([of_lines]).collect();
    let [fewest, most] = HAND_MATCHES;
    let noise = format!("{fewest} to {most} given matches a motion, {HAND_SIGMA_PX} px of noise");
    let page = format!(
        "{}{table}\n{} draws of {noise}, one elevation: error of the focal length, %\n{}\n\
         {} draws of {noise}, a pan at elevations of {} degrees: error of the focal length, %\n{}",
        motions(&measured),
        draws.len(),
        summary(one.cases, &draws),
        of_range.len(),
        ELEVATIONS_DEG.map(|deg| deg.to_string()).join(", "),
        summary(several.cases, &of_range)
    );
    Ok(setup.output(&page, files))
}

/// The same head with a pan at each of several elevations in place of six views at one.
fn elevations_of(scene: &Scene) -> Scene {
    let group = |pitch_down_deg: f64| {
        let mut views = scene.groups.first().map_or(Vec::new(), |group| group.views.iter().take(2).cloned().collect());
        for (view, side) in views.iter_mut().zip(["a", "b"]) {
            view.file = format!("{pitch_down_deg}{side}");
        }
        Group { pitch_down_deg, roll_deg: 0.0, views }
    };
    Scene { groups: ELEVATIONS_DEG.map(group).to_vec(), ..scene.clone() }
}

/// Matches of one draw, at the full size of the pictures, and what the methods make of them.
fn draw(setup: &Setup, given: &Given, number: u64) -> Result<Draw, LabError> {
    let Given { scene, pairs, cases } = given;
    let truth = scene.camera.intrinsics();
    let matches: Vec<ImagePair> = pairs
        .iter()
        .enumerate()
        .map(|(i, &(from, to))| {
            let seed = setup.seed.wrapping_mul(1_000_003).wrapping_add(number * pairs.len() as u64 + i as u64);
            let count = HAND_MATCHES[0] + (number as usize + i) % (HAND_MATCHES[1] - HAND_MATCHES[0] + 1);
            let matches = floor_matches(scene, [from, to], count, HAND_SIGMA_PX, seed)
                .map_err(|e| LabError::Other(format!("{}: {e}", setup.name)))?;
            Ok(ImagePair { from, to, matches })
        })
        .collect::<Result<_, LabError>>()?;
    let names: Vec<String> = scene.views().map(|(_, v)| v.file.clone()).collect();
    let size = scene.camera.size();
    let one = |&Case { constraint, method, told_centre }: &Case| {
        let principal_point_px = told_centre.then_some([truth.cx, truth.cy]);
        let mut options = Options {
            constraint,
            principal_point_px,
            // Nobody who picks eight points by hand asks them for the lens.
            lens: LensModel::None,
            pairs: Some(pairs.to_vec()),
            seed: setup.seed,
            ..Options::default()
        };
        options.robust.min_inliers = HAND_MATCHES[0];
        accept(if method == "linear" {
            let measured = methods::measure(&matches, Frame::new(size, principal_point_px), &options);
            measured.and_then(|m| methods::linear(&m, &truth, constraint))
        } else {
            let found = calibrate_matches(&names, size, &matches, &options, &Silent);
            found.map(|c| Scores::of_calibration(&truth, &c, constraint))
        })
    };
    cases.iter().map(one).collect()
}

fn summary(cases: &[Case], draws: &[Draw]) -> String {
    let mut page = String::new();
    // Writing to a string cannot fail.
    let _ = writeln!(
        page,
        "{:<11}{:<17}{:>16}{:>9}{:>16}{:>11}{:>22}",
        "constraint", "method", "lower quartile", "median", "upper quartile", "no camera", "within 2 stated sd, %"
    );
    for (i, case) in cases.iter().enumerate() {
        let name = format!("{}{}", case.constraint, if case.told_centre { "*" } else { "" });
        let found: Vec<&Scores> = draws.iter().filter_map(|d| d[i].as_ref().ok()).collect();
        // Without a camera the error counts as infinite.
        let mut errors: Vec<f64> =
            draws.iter().map(|d| d[i].as_ref().map_or(f64::INFINITY, |s| s.focal.error.abs())).collect();
        errors.sort_by(f64::total_cmp);
        let at = |p: f64| errors.get((p * errors.len() as f64) as usize).copied().unwrap_or(f64::NAN);
        let held = found.iter().filter(|s| s.focal.sd.is_some_and(|sd| s.focal.error.abs() <= 2.0 * sd)).count();
        let _ = writeln!(
            page,
            "{name:<11}{:<17}{:>16.3}{:>9.3}{:>16.3}{:>11}{:>22.1}",
            case.method,
            at(0.25),
            at(0.5),
            at(0.75),
            draws.len() - found.len(),
            100.0 * held as f64 / found.len().max(1) as f64
        );
    }
    page
}

fn draws_table(cases: &[Case], draws: &[Draw]) -> Result<Vec<u8>, LabError> {
    let head =
        ["draw", "constraint", "method", "told_principal_point", "focal_error_percent", "focal_sd_percent", "refused"];
    let mut records = Vec::new();
    for (i, draw) in draws.iter().enumerate() {
        for (Case { constraint, method, told_centre }, outcome) in cases.iter().zip(draw) {
            let (error, sd, refused) = match outcome {
                Ok(s) => (six_digits(s.focal.error), s.focal.sd.map_or(String::new(), six_digits), String::new()),
                Err(e) => (String::new(), String::new(), e.to_string()),
            };
            let of_case = [constraint.to_string(), method.to_string(), told_centre.to_string()];
            records.push([i.to_string()].into_iter().chain(of_case).chain([error, sd, refused]).collect());
        }
    }
    csv(&head, &records)
}
