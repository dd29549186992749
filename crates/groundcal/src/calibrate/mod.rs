//! The front door: calls the stages in order.
//!
//! images -> features -> matches -> homographies -> circular points -> consistent motions -> camera. One may enter at
//! images ([`calibrate_images`], or with matches [`calibrate_matched_images`]), matches ([`calibrate_matches`]), homographies
//! ([`calibrate_homographies`]) or circular points ([`calibrate_circular_points`]).

mod evidence;
mod joint;
mod linear;
mod pairs;
mod patches;
mod report;
mod rotating_camera;
mod turning;
mod unknown_lens;

use rayon::prelude::*;

use crate::{
    error::Error,
    geometry::{distortion::Distortion, frame::Frame, size::ImageSize},
    pairs::{
        circular_points::{CircularPoint, MotionGeometry},
        correspondence::ImagePair,
        refine::HomographyEstimate,
        robust::{RobustHomography, RobustOptions},
    },
    result::{Calibration, Warning, calibration::ATTITUDE_SIGMA_DEG},
    select::attitude_groups::{Motion, Sides},
    start::{
        absolute_conic::Constraint,
        linear_camera::{CameraOptions, CameraSolution, GivenPrior, PriorParameter, solve_camera},
    },
    vision::{
        features::{FeatureOptions, Features, MatchOptions, detect, match_features},
        image::GrayImage,
        patches::PatchOptions,
    },
};

pub use crate::result::Method;

/// What is estimated of a lens.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum LensModel {
    /// Nothing: the lens is taken to have no distortion, and the error bars do not cover it.
    None,
    /// k1.
    K1,
    /// k1 and k2, each with a prior about zero: what the images do not tell stays there, with its error bar.
    #[default]
    K1K2,
}

/// What a calibration may be told. Everything has a default.
#[derive(Debug, Clone)]
pub struct Options {
    /// How the camera is estimated.
    pub method: Method,
    /// What is assumed of the camera matrix.
    pub constraint: Constraint,
    /// The principal point in pixels where it is held, centre of its prior otherwise (default: the image centre).
    pub principal_point_px: Option<[f64; 2]>,
    /// fy / fx where it is held, centre of its prior otherwise (default: 1).
    pub aspect: Option<f64>,
    /// A known lens distortion; it is undone before anything else.
    pub distortion: Distortion,
    /// What is estimated of a lens distortion where none is given.
    pub lens: LensModel,
    /// Priors that take the place of those of `auto`, or join the other constraints (joint refinement; the linear method knows
    /// those of the camera matrix).
    pub priors: Vec<GivenPrior>,
    /// Standard deviation of each view's attitude about each axis across the floor's normal, in degrees: robots pitch and
    /// floors are not flat. 0: exactly plane-normal, as in the paper. `None`: estimated where three attitudes or more allow
    /// it, else 0.1, or 1.5 for a single motion before a background that stands still (a thing moved before a fixed camera,
    /// by an arm or by hand).
    pub attitude_sigma_deg: Option<f64>,
    /// Relative standard deviation of each view's height over the floor from that of the others of its attitude. 0: constant
    /// height; 0.3 and more: free. `None`: estimated. The linear method takes heights as free.
    pub height_sigma: Option<f64>,
    /// Pairs of image indices known to be plane-normal motions; `None`: found.
    pub pairs: Option<Vec<(usize, usize)>>,
    /// Up to this many images all pairs are compared, beyond it neighbours.
    pub all_pairs_limit: usize,
    /// Fewest matches that must agree on a plane; `None`: 15 for images, 6 for given matches.
    pub min_plane_matches: Option<usize>,
    /// Detection of features.
    pub features: FeatureOptions,
    /// Matching of features.
    pub matching: MatchOptions,
    /// Robust homographies.
    pub robust: RobustOptions,
    /// Whether the floor of the motions found is matched again patch by patch (images only).
    pub match_patches: bool,
    /// Least squares matching of those patches.
    pub patches: PatchOptions,
    /// Seed of every random choice.
    pub seed: u64,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            method: Method::default(),
            constraint: Constraint::Auto,
            principal_point_px: None,
            aspect: None,
            distortion: Distortion::default(),
            lens: LensModel::default(),
            priors: Vec::new(),
            attitude_sigma_deg: None,
            height_sigma: None,
            pairs: None,
            all_pairs_limit: 40,
            min_plane_matches: None,
            features: FeatureOptions::default(),
            matching: MatchOptions::default(),
            robust: RobustOptions::default(),
            match_patches: true,
            patches: PatchOptions::default(),
            seed: 0,
        }
    }
}

/// How far a thing moved before a fixed camera by an arm or by hand pitches and rolls by itself, in degrees, when a single motion cannot
/// show it.
const HELD_ATTITUDE_SIGMA_DEG: f64 = 1.5;
/// Prior of ln(fy / fx) under `auto`, and when the ratio is given.
const ASPECT_SIGMA: f64 = 0.003;
const GIVEN_ASPECT_SIGMA: f64 = 0.001;
/// Prior of the principal point as a fraction of the image width under `auto`, and when it is given.
const PRINCIPAL_POINT_SIGMA: f64 = 0.05;
const GIVEN_PRINCIPAL_POINT_SIGMA: f64 = 0.01;
impl Options {
    /// Checks every option once.
    ///
    /// # Errors
    /// [`Error::InvalidOption`] naming the option and its value.
    pub fn validate(&self, size: ImageSize) -> Result<(), Error> {
        let fail = |text: String| Err(Error::InvalidOption(text));
        if let Some([x, y]) = self.principal_point_px {
            let (w, h) = (size.width as f64, size.height as f64);
            if !(x.is_finite() && y.is_finite() && (-w..2.0 * w).contains(&x) && (-h..2.0 * h).contains(&y)) {
                return fail(format!("principal point ({x}, {y}) is not near an image of {size} pixels"));
            }
        }
        if let Some(a) = self.aspect
            && !(a.is_finite() && (0.1..=10.0).contains(&a))
        {
            return fail(format!("aspect ratio {a} must lie between 0.1 and 10"));
        }
        if let Some(sigma) = self.attitude_sigma_deg
            && !(sigma.is_finite() && (0.0..=20.0).contains(&sigma))
        {
            return fail(format!("attitude sigma {sigma} degrees must lie between 0 and 20"));
        }
        if let Some(sigma) = self.height_sigma
            && !(sigma.is_finite() && (0.0..=10.0).contains(&sigma))
        {
            return fail(format!("height sigma {sigma} must lie between 0 and 10"));
        }
        let d = &self.distortion;
        if ![d.k1, d.k2, d.p1, d.p2].iter().all(|v| v.is_finite() && v.abs() <= 10.0) {
            return fail(format!("distortion k1 {}, k2 {} must be finite and at most 10 in size", d.k1, d.k2));
        }
        for p in &self.priors {
            let name = p.parameter.name();
            let positive = matches!(p.parameter, PriorParameter::Fx | PriorParameter::Aspect);
            if !(p.mean.is_finite() && p.sigma.is_finite() && p.sigma > 0.0 && (!positive || p.mean > 0.0)) {
                return fail(format!(
                    "prior {name} = {} +- {}: both must be finite, the deviation (and a focal length or ratio) positive",
                    p.mean, p.sigma
                ));
            }
            if self.priors.iter().filter(|q| q.parameter == p.parameter).count() > 1 {
                return fail(format!("two priors of {name}"));
            }
            if !self.is_estimated(p.parameter) {
                return fail(format!(
                    "a prior of {name}, which `{}`, the given distortion or the lens model holds: leave one of the two out",
                    self.constraint.name()
                ));
            }
        }
        if self.method == Method::Rotating {
            if !self.priors.is_empty() {
                return fail(
                    "the rotating-camera method takes no priors: leave them out, or use the joint method".into(),
                );
            }
            if self.attitude_sigma_deg.is_some() || self.height_sigma.is_some() {
                return fail(
                    "the rotating-camera method knows no floor: an attitude or height sigma has no meaning there"
                        .into(),
                );
            }
        }
        if !(self.robust.max_sigma_px.is_finite() && self.robust.max_sigma_px > 0.0) {
            return fail(format!("largest noise {} px must be positive", self.robust.max_sigma_px));
        }
        Ok(())
    }

    /// Whether a number of the camera is estimated at all.
    fn is_estimated(&self, parameter: PriorParameter) -> bool {
        let free = self.constraint.free();
        let lens_unknown = self.distortion.is_none();
        match parameter {
            PriorParameter::Fx => free[0],
            PriorParameter::Aspect => free[1],
            PriorParameter::Cx => free[2],
            PriorParameter::Cy => free[3],
            // `auto` holds the skew at zero unless it is told otherwise.
            PriorParameter::Skew => free[4] || self.constraint == Constraint::Auto,
            PriorParameter::K1 => lens_unknown && self.lens != LensModel::None,
            PriorParameter::K2 => lens_unknown && self.lens == LensModel::K1K2,
        }
    }

    fn given_prior(&self, parameter: PriorParameter) -> Option<(f64, f64)> {
        self.priors.iter().find(|p| p.parameter == parameter).map(|p| (p.mean, p.sigma))
    }

    fn camera(&self, size: ImageSize) -> CameraOptions {
        let fraction =
            if self.principal_point_px.is_some() { GIVEN_PRINCIPAL_POINT_SIGMA } else { PRINCIPAL_POINT_SIGMA };
        CameraOptions {
            constraint: self.constraint,
            aspect: self.aspect.unwrap_or(1.0),
            aspect_sigma: if self.aspect.is_some() { GIVEN_ASPECT_SIGMA } else { ASPECT_SIGMA },
            principal_point_sigma_px: fraction * size.width as f64,
            given: self.priors.clone(),
            attitude_sigma_rad: self.attitude_sigma_deg.unwrap_or(ATTITUDE_SIGMA_DEG).to_radians(),
            estimate_attitude_sigma: self.attitude_sigma_deg.is_none(),
        }
    }
}

/// A step of the work, for progress displays.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stage {
    /// Features of each image.
    Features,
    /// Matches of each pair.
    Matching,
    /// Homography of each pair.
    Homographies,
    /// Least squares matching of the floor of each motion.
    Patches,
    /// Consistent motions and camera.
    Camera,
}

/// Hears of the progress; all calls may come from any thread.
pub trait Observer: Sync {
    /// A stage of `total` items begins.
    fn begin(&self, stage: Stage, total: usize) {
        let _ = (stage, total);
    }
    /// One item of the stage is done.
    fn advance(&self, stage: Stage) {
        let _ = stage;
    }
}

/// An observer that does not listen.
pub struct Silent;
impl Observer for Silent {}

/// Calibrates from photographs of the floor, all of one size, by one camera at one zoom.
///
/// # Errors
/// See [`Error`].
pub fn calibrate_images(
    names: &[String],
    images: &[GrayImage],
    options: &Options,
    observer: &dyn Observer,
) -> Result<Calibration, Error> {
    let size = check_images(names, images)?;
    options.validate(size)?;
    let mut warnings = Vec::new();
    let pairs = candidate_pairs(images.len(), options)?;
    if options.pairs.is_none() && images.len() > options.all_pairs_limit {
        warnings.push(Warning::NeighboursOnly { images: images.len() });
    }
    warnings.extend(duplicates(names, images));
    observer.begin(Stage::Features, images.len());
    let features: Vec<Features> = images
        .par_iter()
        .map(|image| {
            let found = detect(image, &options.features);
            observer.advance(Stage::Features);
            found
        })
        .collect();
    observer.begin(Stage::Matching, pairs.len());
    let matched: Vec<ImagePair> = pairs
        .par_iter()
        .map(|&(from, to)| {
            let matches = match_features(&features[from], &features[to], &options.matching);
            observer.advance(Stage::Matching);
            ImagePair { from, to, matches }
        })
        .collect();
    run_images(names, images, &matched, options, observer, warnings)
}

/// Calibrates from photographs as [`calibrate_images`] does, from matches between them that are there already: another
/// matcher's, or the same for several calibrations. The floor of the motions found is matched again patch by patch all the same.
///
/// # Errors
/// See [`Error`].
pub fn calibrate_matched_images(
    names: &[String],
    images: &[GrayImage],
    pairs: &[ImagePair],
    options: &Options,
    observer: &dyn Observer,
) -> Result<Calibration, Error> {
    let size = check_images(names, images)?;
    options.validate(size)?;
    let chosen = chosen_pairs(names, pairs, options)?;
    run_images(names, images, &chosen, options, observer, duplicates(names, images))
}

/// The one size of the images.
fn check_images(names: &[String], images: &[GrayImage]) -> Result<ImageSize, Error> {
    if names.len() != images.len() {
        return Err(Error::InvalidInput(format!("{} names for {} images", names.len(), images.len())));
    }
    if images.len() < 2 {
        return Err(Error::TooFewImages { found: images.len() });
    }
    let size = images[0].size();
    if size.width < 2 || size.height < 2 {
        return Err(Error::InvalidInput(format!("{} is {size} pixels: nothing can be seen in it", names[0])));
    }
    if let Some(other) = images.iter().position(|i| i.size() != size) {
        return Err(Error::InvalidInput(format!(
            "{} is {} pixels, {} is {size}: all images must come from one camera at one size",
            names[other],
            images[other].size(),
            names[0],
        )));
    }
    Ok(size)
}

fn duplicates(names: &[String], images: &[GrayImage]) -> Vec<Warning> {
    let mut warnings = Vec::new();
    let duplicate = |i: usize, j: usize| images[i] == images[j];
    for j in 1..images.len() {
        if let Some(i) = (0..j).find(|&i| duplicate(i, j)) {
            warnings.push(Warning::DuplicateImages { first: names[i].clone(), second: names[j].clone() });
        }
    }
    warnings
}

/// The pipeline on matches between images.
fn run_images(
    names: &[String],
    images: &[GrayImage],
    matched: &[ImagePair],
    options: &Options,
    observer: &dyn Observer,
    warnings: Vec<Warning>,
) -> Result<Calibration, Error> {
    let min = options.min_plane_matches.unwrap_or(15);
    if let [only] = matched
        && only.matches.len() < 4
    {
        return Err(Error::NoCommonPlane { pairs: 1, best: only.matches.len(), needed: min });
    }
    Pipeline { names, size: images[0].size(), options, observer, images: Some(images), min_matches: min }
        .run(matched, warnings)
}

fn candidate_pairs(images: usize, options: &Options) -> Result<Vec<(usize, usize)>, Error> {
    if let Some(pairs) = &options.pairs {
        if pairs.is_empty() {
            return Err(Error::InvalidOption("the list of pairs is empty".into()));
        }
        let mut known = std::collections::HashSet::new();
        for &(a, b) in pairs {
            if a >= images || b >= images || a == b {
                return Err(Error::InvalidOption(format!("pair ({a}, {b}) does not name two of the {images} images")));
            }
            if !known.insert((a.min(b), a.max(b))) {
                return Err(Error::InvalidOption(format!("pair ({a}, {b}) is given twice")));
            }
        }
        return Ok(pairs.clone());
    }
    let all = images <= options.all_pairs_limit;
    let reach = if all { images } else { 3 };
    let mut pairs: Vec<(usize, usize)> =
        (0..images).flat_map(|a| (a + 1..images.min(a + 1 + reach)).map(move |b| (a, b))).collect();
    if !all {
        // A closed turn ends where it began.
        pairs.push((0, images - 1));
    }
    Ok(pairs)
}

/// Calibrates from point matches; `names` gives a name for each image index used by the pairs.
///
/// # Errors
/// See [`Error`].
pub fn calibrate_matches(
    names: &[String],
    size: ImageSize,
    pairs: &[ImagePair],
    options: &Options,
    observer: &dyn Observer,
) -> Result<Calibration, Error> {
    if size.width < 2 || size.height < 2 {
        return Err(Error::InvalidInput(format!("an image size of {size} pixels")));
    }
    options.validate(size)?;
    if names.len() < 2 {
        return Err(Error::TooFewImages { found: names.len() });
    }
    let chosen = chosen_pairs(names, pairs, options)?;
    let min = options.min_plane_matches.unwrap_or(6);
    Pipeline { names, size, options, observer, images: None, min_matches: min }.run(&chosen, Vec::new())
}

/// Of given pairs those that the options name, or all.
fn chosen_pairs(names: &[String], pairs: &[ImagePair], options: &Options) -> Result<Vec<ImagePair>, Error> {
    let index_ok = |p: &ImagePair| p.from < names.len() && p.to < names.len() && p.from != p.to;
    if let Some(bad) = pairs.iter().find(|p| !index_ok(p)) {
        return Err(Error::InvalidInput(format!("a pair ({}, {}) of {} images", bad.from, bad.to, names.len())));
    }
    let chosen: Vec<ImagePair> = match &options.pairs {
        None => pairs.to_vec(),
        Some(wanted) => {
            let find = |&(a, b): &(usize, usize)| {
                let is = |p: &&ImagePair| (p.from, p.to) == (a, b) || (p.from, p.to) == (b, a);
                pairs.iter().find(is).cloned().ok_or_else(|| {
                    let name = |i: usize| names.get(i).map_or("?", String::as_str);
                    Error::InvalidInput(format!("no matches between {} and {}, which the pairs name", name(a), name(b)))
                })
            };
            wanted.iter().map(find).collect::<Result<_, _>>()?
        }
    };
    if chosen.is_empty() {
        return Err(Error::InvalidInput("no matches at all".into()));
    }
    Ok(chosen)
}

/// Calibrates from homographies (pixels of `from` to pixels of `to`) with covariance, all of them plane-normal motions.
/// The distortion of the options must be none: it cannot be undone in a homography.
///
/// # Errors
/// See [`Error`].
pub fn calibrate_homographies(
    names: &[String],
    size: ImageSize,
    homographies: &[(usize, usize, HomographyEstimate)],
    options: &Options,
) -> Result<Calibration, Error> {
    if size.width < 2 || size.height < 2 {
        return Err(Error::InvalidInput(format!("an image size of {size} pixels")));
    }
    options.validate(size)?;
    if !options.distortion.is_none() {
        return Err(Error::InvalidOption("a lens distortion cannot be undone in homographies".into()));
    }
    if homographies.is_empty() {
        return Err(Error::InvalidInput("no homographies at all".into()));
    }
    let frame = Frame::new(size, options.principal_point_px);
    for (i, (from, to, estimate)) in homographies.iter().enumerate() {
        if *from >= names.len() || *to >= names.len() || from == to {
            return Err(Error::InvalidInput(format!("homography {i} from {from} to {to} of {} images", names.len())));
        }
        if !estimate.covariance.iter().all(|v| v.is_finite()) {
            return Err(Error::InvalidInput(format!("homography {i} has a covariance that is not finite")));
        }
        if estimate.frame != frame {
            return Err(Error::InvalidInput(format!(
                "homography {i} has its covariance in a frame of another image size or principal point"
            )));
        }
    }
    let results: Vec<(ImagePair, pairs::PairResult)> = homographies
        .iter()
        .map(|(from, to, estimate)| {
            let robust = RobustHomography {
                estimate: estimate.clone(),
                inliers: Vec::new(),
                trials: 0,
                static_background: 0,
                patches: false,
                is_static: false,
            };
            let outcome = pairs::geometry_of(robust);
            (
                ImagePair { from: *from, to: *to, matches: Vec::new() },
                pairs::PairResult { candidates: estimate.matches, outcome, superseded: None },
            )
        })
        .collect();
    let (pairs, results): (Vec<_>, Vec<_>) = results.into_iter().unzip();
    let pipeline = Pipeline { names, size, options, observer: &Silent, images: None, min_matches: 0 };
    if options.method == Method::Rotating {
        return pipeline.conclude_rotating(&pairs, &results, &report::KnownLens::NotModelled, Vec::new());
    }
    let chosen = pipeline.select(&results, &pairs, true)?;
    pipeline.conclude(&pairs, &results, chosen, Vec::new(), &report::KnownLens::NotModelled)
}

/// The camera from circular points alone, given in pixels (any non-zero multiple) with the standard deviation of each
/// point's direction in frame coordinates.
///
/// # Errors
/// See [`Error`].
pub fn calibrate_circular_points(
    size: ImageSize,
    points: &[(nalgebra::Vector3<nalgebra::Complex<f64>>, f64)],
    options: &Options,
) -> Result<CameraSolution, Error> {
    options.validate(size)?;
    let frame = Frame::new(size, options.principal_point_px);
    let to_frame = frame.frame_matrix().map(|x| nalgebra::Complex::new(x, 0.0));
    let motions: Vec<Motion> = points
        .iter()
        .enumerate()
        .map(|(i, (point, sigma))| {
            let circular_point = CircularPoint::from_point(to_frame * point, *sigma).ok_or_else(|| {
                Error::InvalidInput(format!(
                    "circular point {i} is zero, real or not finite, or its sigma not positive"
                ))
            })?;
            let geometry =
                MotionGeometry { circular_point, rotation_rad: 0.0, rotation_sigma_rad: 0.0, rho: 1.0, rho_sigma: 0.0 };
            Ok(Motion { from: 2 * i, to: 2 * i + 1, geometry, sides: Sides::One })
        })
        .collect::<Result<_, Error>>()?;
    solve_camera(&motions, &frame, &options.camera(size))
}

struct Pipeline<'a> {
    names: &'a [String],
    size: ImageSize,
    options: &'a Options,
    observer: &'a dyn Observer,
    images: Option<&'a [GrayImage]>,
    min_matches: usize,
}

impl Pipeline<'_> {
    fn frame(&self) -> Frame {
        Frame::new(self.size, self.options.principal_point_px)
    }
}
