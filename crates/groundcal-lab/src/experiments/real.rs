//! Real pictures beside the rendered ones: a thing on a turntable before a camera that stands still, and full turns of a level camera.
//! They lie outside the repository; what is not there is said and skipped.
//!
//! - *linear*: the paper's method as published ([`Method::Kzr`]), told which pairs are motions, the lens ignored.
//! - *undistorted*: the same from matches corrected first, as in the paper, with the camera and lens that groundcal found.
//! - *rotating camera*: Hᵀ ω H = ω of all pairs.
//! - *groundcal*: `calibrate` as shipped. The turntable's pairs are named and vouched for; full turns are recognised by themselves.
//!
//! The camera in `truth.json` is read for the errors alone.

use std::{
    fmt::Write,
    path::{Path, PathBuf},
};

use groundcal::{
    Error, Method, MotionModel, Options, Silent, calibrate_images, calibrate_matches,
    geometry::{ImageSize, Intrinsics},
    match_images,
    pairs::ImagePair,
    result::Calibration,
    start::Constraint,
    vision::GrayImage,
};
use groundcal_io::{
    images::read_images, import::read_camera, inputs::find_images, matches::read_pairs, names::image_names,
};

use crate::{
    error::LabError,
    experiments::{
        methods::{self, Scores},
        setup::{ExperimentOptions, ExperimentOutput, OutputFile, accept},
        table::{self, Line},
    },
    progress::Progress,
};

/// Its name in tables, messages and file names.
pub const NAME: &str = "real";

/// Which pairs of a set are motions.
enum Pairs {
    /// `pairs.csv` names them.
    Named,
    /// Neighbours, and the last with the first: a full turn.
    Ring,
}

/// A set of pictures.
struct Set {
    folder: &'static str,
    what: &'static str,
    pairs: Pairs,
}

const SETS: [Set; 3] = [
    Set {
        folder: "real_turntable_bare",
        what: "a disc with markers turned before a webcam; one attitude",
        pairs: Pairs::Named,
    },
    Set { folder: "real_turn_grail", what: "a level camera on a tripod, a full turn in a room", pairs: Pairs::Ring },
    Set { folder: "real_turn_denny", what: "a level camera, a full turn near things: parallax", pairs: Pairs::Ring },
];

/// For a first look the first set alone.
const QUICK_SETS: usize = 1;

fn table_name(set: &Set) -> String {
    format!("{}.csv", set.folder)
}

/// Names of the files at most.
pub fn file_names() -> Vec<String> {
    SETS.iter().map(table_name).chain([format!("{NAME}.txt")]).collect()
}

/// Calibrates from each set under `data`.
///
/// # Errors
/// Whatever is not a method's refusal, which is a result: unreadable pictures, unusable input.
pub fn run(data: &Path, options: &ExperimentOptions, progress: &dyn Progress) -> Result<ExperimentOutput, LabError> {
    let sets = &SETS[..if options.quick { QUICK_SETS } else { SETS.len() }];
    progress.begin(NAME, sets.len() as u64);
    let (mut page, mut files) = (String::new(), Vec::new());
    for set in sets {
        let folder = data.join(set.folder);
        // Writing to a string cannot fail.
        if folder.join("truth.json").is_file() {
            let (head, lines) = of_set(set, &folder, options)?;
            let _ = writeln!(page, "{head}{}", table::text(&lines));
            files.push(OutputFile { name: table_name(set), bytes: table::csv(set.folder, &lines)? });
        } else {
            let _ = writeln!(page, "skipped: {}: not in {}\n", set.folder, data.display());
        }
        progress.advance();
    }
    progress.finish();
    files.push(OutputFile { name: format!("{NAME}.txt"), bytes: page.clone().into_bytes() });
    Ok(ExperimentOutput { page, files })
}

/// The pictures of a set, and what is known of them.
struct Real {
    names: Vec<String>,
    images: Vec<GrayImage>,
    size: ImageSize,
    pairs: Vec<(usize, usize)>,
    truth: Intrinsics,
    /// How far the truth's focal length is known, per cent.
    tolerance_percent: Option<f64>,
}

fn read(set: &Set, folder: &Path) -> Result<Real, LabError> {
    let files: Vec<PathBuf> = find_images(&[folder])?;
    let names = image_names(&files);
    let images = read_images(&files)?.images;
    let truth_file = folder.join("truth.json");
    let camera = read_camera(&truth_file)?;
    let pairs = match set.pairs {
        Pairs::Named => read_pairs(&folder.join("pairs.csv"), &names)?,
        Pairs::Ring => (0..names.len()).map(|i| (i, (i + 1) % names.len())).collect(),
    };
    let size = images.first().map(GrayImage::size).ok_or_else(|| LabError::Other(format!("{}: empty", set.folder)))?;
    let tolerance_percent = tolerance(&truth_file, camera.intrinsics.fx);
    Ok(Real { names, images, size, pairs, truth: camera.intrinsics, tolerance_percent })
}

/// What the truth says of its own focal length: a tolerance in per cent, as a number or a word, or a deviation in pixels.
fn tolerance(truth: &Path, fx: f64) -> Option<f64> {
    let text = std::fs::read_to_string(truth).ok()?;
    let json: serde_json::Value = serde_json::from_str(&text).ok()?;
    let number = |v: &serde_json::Value| v.as_f64().or_else(|| v.as_str()?.trim().parse().ok());
    let of = |name: &str| json.get(name).and_then(number);
    let deviation = || number(&json["standard_deviation"]["fx"]).map(|sd| 100.0 * sd / fx);
    of("f_tolerance_percent").or_else(|| of("tolerance_percent")).or_else(deviation)
}

fn of_set(set: &Set, folder: &Path, asked: &ExperimentOptions) -> Result<(String, Vec<Line>), LabError> {
    let real = read(set, folder)?;
    let known = real.tolerance_percent.map_or(String::new(), |t| format!(", known to {t:.2} %"));
    let head = format!(
        "{}: {}; {} pictures, {} px, {} pairs\ntruth: fx {:.1} px{known}\n",
        set.folder,
        set.what,
        real.names.len(),
        real.size,
        real.pairs.len(),
        real.truth.fx
    );
    let mut lines = Vec::new();
    let mut add = |input, method, constraint, outcome: Result<Scores, Error>| -> Result<(), LabError> {
        let (told_centre, motions) = (false, real.pairs.len());
        lines.push(Line { input, constraint, told_centre, method, motions, outcome: accept(outcome)? });
        Ok(())
    };
    let named = |method, constraint| Options {
        method,
        constraint,
        pairs: Some(real.pairs.clone()),
        motion: MotionModel::PlaneNormal,
        seed: asked.seed,
        ..Options::default()
    };
    let ours = |constraint| match set.pairs {
        Pairs::Named => named(Method::Joint, constraint),
        Pairs::Ring => Options { constraint, seed: asked.seed, ..Options::default() },
    };
    let matched = match_images(&real.images, &real.pairs, &Options::default(), &Silent);
    let of_matches = |options: &Options, pairs: &[ImagePair]| {
        calibrate_matches(&real.names, real.size, pairs, options, &Silent).map(|c| real.scores(&c, options.constraint))
    };
    let linear = named(Method::Kzr, Constraint::Focal);
    add("features", "linear", Constraint::Focal, matched.clone().and_then(|m| of_matches(&linear, &m)))?;
    let found: Vec<_> =
        [Constraint::Focal, Constraint::Auto].into_iter().map(|c| (c, real.calibrated(&ours(c)))).collect();
    if let Some((_, Ok(c))) = found.first() {
        let corrected = matched.clone().and_then(|m| of_matches(&linear, &methods::undistorted(&m, c)));
        add("features", "undistorted", Constraint::Focal, corrected)?;
    }
    if matches!(set.pairs, Pairs::Ring) {
        let rotating = Options { motion: MotionModel::Auto, ..named(Method::Rotating, Constraint::Focal) };
        add("features", "rotating camera", Constraint::Focal, matched.and_then(|m| of_matches(&rotating, &m)))?;
    }
    for (constraint, outcome) in found {
        add("pictures", "groundcal", constraint, outcome.map(|c| real.scores(&c, constraint)))?;
    }
    Ok((head, lines))
}

impl Real {
    fn calibrated(&self, options: &Options) -> Result<Calibration, Error> {
        calibrate_images(&self.names, &self.images, options, &Silent)
    }

    fn scores(&self, c: &Calibration, constraint: Constraint) -> Scores {
        Scores::of_calibration(&self.truth, c, constraint)
    }
}
