//! The third experiment: three pictures, forward, three more. A handful of matches a motion given, as by hand, many times; and
//! the pictures themselves.

use std::fmt::Write;

use groundcal::{
    calibrate::{LensModel, Options, Silent, calibrate_matches},
    error::Error,
    geometry::frame::Frame,
    pairs::correspondence::ImagePair,
    start::absolute_conic::Constraint,
};
use rayon::prelude::*;

use crate::{
    error::LabError,
    experiments::{
        methods::{self, Scores},
        setup::{Description, ExperimentOutput, Setup, accept, motions},
        table::Line,
    },
    renderer::floor_matches::floor_matches,
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

/// Ending of the file of draws.
pub(crate) const ENDINGS: [&str; 1] = ["_draws.csv"];

type Outcome = Result<Scores, Error>;

/// Method, and whether it is told the true principal point.
const METHODS: [(&str, bool); 4] = [("linear", false), ("groundcal", false), ("linear", true), ("groundcal", true)];

/// What each of [`METHODS`] makes of one draw of matches.
type Draw = [Outcome; 4];

/// Draws matches, renders, calibrates and sums up.
pub(crate) fn run(setup: &Setup) -> Result<ExperimentOutput, LabError> {
    let draws: Vec<Draw> = (0..if setup.quick { QUICK_DRAWS } else { DRAWS })
        .into_par_iter()
        .map(|number| draw(setup, number))
        .collect::<Result<_, LabError>>()?;
    let of_draws = setup.file(ENDINGS[0], draws_table(&draws)?);

    let pictures = setup.pictures(&PAIRS, 3)?;
    let measured = methods::measure(&pictures.matched, setup.frame(false), &setup.options(Constraint::Focal, false))?;
    let mut lines = Vec::new();
    if let Some(first) = draws.first() {
        let (input, constraint, motions) = ("given", Constraint::Focal, PAIRS.len());
        lines.extend(METHODS.iter().zip(first).map(|(&(method, told_centre), outcome)| Line {
            input,
            constraint,
            told_centre,
            method,
            motions,
            outcome: outcome.clone(),
        }));
    }
    lines.extend(setup.lines(&pictures, &[Constraint::Focal, Constraint::Auto])?);
    let (of_lines, table) = setup.table(&lines)?;
    let files = [of_draws].into_iter().chain(pictures.files).chain([of_lines]).collect();
    Ok(setup.output(&format!("{}{table}\n{}", motions(&measured), summary(&draws)), files))
}

/// Matches of one draw, at the full size of the pictures, and what the methods make of them.
fn draw(setup: &Setup, number: u64) -> Result<Draw, LabError> {
    let scene = &setup.full_scene;
    let truth = scene.camera.intrinsics();
    let pairs: Vec<ImagePair> = PAIRS
        .iter()
        .enumerate()
        .map(|(i, &(from, to))| {
            let seed = setup.seed.wrapping_mul(1_000_003).wrapping_add(number * PAIRS.len() as u64 + i as u64);
            let count = HAND_MATCHES[0] + (number as usize + i) % (HAND_MATCHES[1] - HAND_MATCHES[0] + 1);
            let matches = floor_matches(scene, [from, to], count, HAND_SIGMA_PX, seed)
                .map_err(|e| LabError::Other(format!("{}: {e}", setup.name)))?;
            Ok(ImagePair { from, to, matches })
        })
        .collect::<Result<_, LabError>>()?;
    let names: Vec<String> = scene.views().map(|(_, v)| v.file.clone()).collect();
    let size = scene.camera.size();
    let one = |&(method, told): &(&str, bool)| {
        let principal_point_px = told.then_some([truth.cx, truth.cy]);
        let mut options = Options {
            constraint: Constraint::Focal,
            principal_point_px,
            // Nobody who picks eight points by hand asks them for the lens.
            lens: LensModel::None,
            pairs: Some(PAIRS.to_vec()),
            seed: setup.seed,
            ..Options::default()
        };
        options.robust.min_inliers = HAND_MATCHES[0];
        accept(if method == "linear" {
            let measured = methods::measure(&pairs, Frame::new(size, principal_point_px), &options);
            measured.and_then(|m| methods::linear(&m, &truth, Constraint::Focal))
        } else {
            let found = calibrate_matches(&names, size, &pairs, &options, &Silent);
            found.map(|c| Scores::of_calibration(&truth, &c, Constraint::Focal))
        })
    };
    let [a, b, c, d] = METHODS.each_ref().map(one);
    Ok([a?, b?, c?, d?])
}

fn summary(draws: &[Draw]) -> String {
    let mut page = String::new();
    let [fewest, most] = HAND_MATCHES;
    // Writing to a string cannot fail.
    let _ = writeln!(
        page,
        "{} draws of {fewest} to {most} given matches a motion, {HAND_SIGMA_PX} px of noise, `focal`: error of the focal length, %",
        draws.len()
    );
    let _ = writeln!(
        page,
        "{:<17}{:>16}{:>9}{:>16}{:>11}{:>22}",
        "method", "lower quartile", "median", "upper quartile", "no camera", "within 2 stated sd, %"
    );
    for (i, (name, told)) in METHODS.iter().enumerate() {
        let name = format!("{name}{}", if *told { "*" } else { "" });
        let found: Vec<&Scores> = draws.iter().filter_map(|d| d[i].as_ref().ok()).collect();
        // Without a camera the error counts as infinite.
        let mut errors: Vec<f64> =
            draws.iter().map(|d| d[i].as_ref().map_or(f64::INFINITY, |s| s.focal.error.abs())).collect();
        errors.sort_by(f64::total_cmp);
        let at = |p: f64| errors.get((p * errors.len() as f64) as usize).copied().unwrap_or(f64::NAN);
        let held = found.iter().filter(|s| s.focal.sd.is_some_and(|sd| s.focal.error.abs() <= 2.0 * sd)).count();
        let _ = writeln!(
            page,
            "{name:<17}{:>16.3}{:>9.3}{:>16.3}{:>11}{:>22.1}",
            at(0.25),
            at(0.5),
            at(0.75),
            draws.len() - found.len(),
            100.0 * held as f64 / found.len().max(1) as f64
        );
    }
    page
}

fn draws_table(draws: &[Draw]) -> Result<Vec<u8>, LabError> {
    let head = ["draw", "method", "told_principal_point", "focal_error_percent", "focal_sd_percent", "refused"];
    let mut records = Vec::new();
    for (i, draw) in draws.iter().enumerate() {
        for ((method, told), outcome) in METHODS.iter().zip(draw) {
            let (error, sd, refused) = match outcome {
                Ok(s) => (six_digits(s.focal.error), s.focal.sd.map_or(String::new(), six_digits), String::new()),
                Err(e) => (String::new(), String::new(), e.to_string()),
            };
            records.push(vec![i.to_string(), method.to_string(), told.to_string(), error, sd, refused]);
        }
    }
    csv(&head, &records)
}
