//! The front door: calls the stages in order.
//!
//! images -> features -> matches -> homographies -> circular points -> consistent motions -> camera. One may enter at
//! images ([`calibrate_images`]), matches ([`calibrate_matches`]), homographies ([`calibrate_homographies`]) or circular
//! points ([`calibrate_circular_points`]).

use nalgebra::{Vector2, Vector3, Vector4};
use rayon::prelude::*;

use crate::{
    absolute_conic::Constraint,
    attitude_groups::{Motion, Sides},
    camera::{CameraOptions, CameraSolution, solve_camera},
    circular_points::{CircularPoint, MotionGeometry, NoCircularPoint, from_homography},
    correspondence::{ImagePair, PointMatch, validated},
    distortion::Distortion,
    error::Error,
    features::{FeatureOptions, Features, MatchOptions, detect, match_features},
    frame::Frame,
    homography::{
        HomographyEstimate, RobustHomography, RobustOptions, estimate_robust, refine::RefineOptions, refine::refine,
    },
    image::{GrayImage, ImageSize},
    intrinsics::Intrinsics,
    linalg::complex_pair_eigen,
    motions::{ConsistencyOptions, Verdict, find_consistent},
    result::{
        AttitudeReport, Calibration, Camera, Covariance, DistortionReport, Fit, MotionReport, Prior, StandardDeviation,
        Warning,
    },
};

/// What a calibration may be told. Everything has a default.
#[derive(Debug, Clone)]
pub struct Options {
    /// What is assumed of the camera matrix.
    pub constraint: Constraint,
    /// The principal point in pixels where it is held, centre of its prior otherwise (default: the image centre).
    pub principal_point_px: Option<[f64; 2]>,
    /// fy / fx where it is held, centre of its prior otherwise (default: 1).
    pub aspect: Option<f64>,
    /// A known lens distortion; it is undone before anything else.
    pub distortion: Distortion,
    /// Standard deviation of each view's attitude about each axis across the floor's normal, in degrees: robots pitch and
    /// floors are not flat. 0: exactly plane-normal, as in the paper.
    pub attitude_sigma_deg: f64,
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
    /// Seed of every random choice.
    pub seed: u64,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            constraint: Constraint::Auto,
            principal_point_px: None,
            aspect: None,
            distortion: Distortion::default(),
            attitude_sigma_deg: 0.1,
            pairs: None,
            all_pairs_limit: 40,
            min_plane_matches: None,
            features: FeatureOptions::default(),
            matching: MatchOptions::default(),
            robust: RobustOptions::default(),
            seed: 0,
        }
    }
}

/// Prior of ln(fy / fx) under `auto`, and when the ratio is given.
const ASPECT_SIGMA: f64 = 0.003;
const GIVEN_ASPECT_SIGMA: f64 = 0.001;
/// Prior of the principal point as a fraction of the image width under `auto`, and when it is given.
const PRINCIPAL_POINT_SIGMA: f64 = 0.05;
const GIVEN_PRINCIPAL_POINT_SIGMA: f64 = 0.01;
/// The same in the search for consistent motions, where nothing should be lost to an odd lens.
const SEARCH_PRINCIPAL_POINT_SIGMA: f64 = 0.1;
/// Least deviation of the attitudes in the search: what is left of lens distortion and of a scene that is not quite a plane
/// moves circular points by more than the noise says, and a motion is not to be lost for it. Pairs of images of different
/// attitudes are off by degrees.
const SEARCH_ATTITUDE_SIGMA_DEG: f64 = 0.3;
/// Deviation of the k1 that the search takes to be still there, given or not: a given one has its own error and no lens has
/// k1 alone.
const SEARCH_K1_SIGMA: f64 = 0.05;
/// Deviation of a circular point's direction in the search for all other faults of the model (higher distortion, a scene not
/// quite flat or not quite at infinity): a third of a degree.
const SEARCH_DIRECTION_SIGMA: f64 = 0.006;
/// Fraction of points beyond the horizon from which on a scene is no floor.
const MINOR_SIDE: f64 = 0.05;
/// Squared distance beyond which a motion disagrees with the camera of the others: 99.9 % of chi-squared with two degrees
/// of freedom.
const MOTION_GATE: f64 = 13.8;

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
        if let Some(a) = self.aspect {
            if !(a.is_finite() && (0.1..=10.0).contains(&a)) {
                return fail(format!("aspect ratio {a} must lie between 0.1 and 10"));
            }
        }
        if !(self.attitude_sigma_deg.is_finite() && (0.0..=20.0).contains(&self.attitude_sigma_deg)) {
            return fail(format!("attitude sigma {} degrees must lie between 0 and 20", self.attitude_sigma_deg));
        }
        let d = &self.distortion;
        if ![d.k1, d.k2, d.p1, d.p2].iter().all(|v| v.is_finite() && v.abs() <= 10.0) {
            return fail(format!("distortion k1 {}, k2 {} must be finite and at most 10 in size", d.k1, d.k2));
        }
        if !(self.robust.max_sigma_px.is_finite() && self.robust.max_sigma_px > 0.0) {
            return fail(format!("largest noise {} px must be positive", self.robust.max_sigma_px));
        }
        Ok(())
    }

    fn camera(&self, size: ImageSize) -> CameraOptions {
        let fraction =
            if self.principal_point_px.is_some() { GIVEN_PRINCIPAL_POINT_SIGMA } else { PRINCIPAL_POINT_SIGMA };
        CameraOptions {
            constraint: self.constraint,
            aspect: self.aspect.unwrap_or(1.0),
            aspect_sigma: if self.aspect.is_some() { GIVEN_ASPECT_SIGMA } else { ASPECT_SIGMA },
            principal_point_sigma_px: fraction * size.width as f64,
            attitude_sigma_rad: self.attitude_sigma_deg.to_radians(),
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

/// Why a pair has no homography or no circular point, in the words of the report.
struct Refusal {
    reason: String,
    rotation_deg: Option<f64>,
    homography: Option<RobustHomography>,
    kind: RefusalKind,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum RefusalKind {
    NoPlane,
    Static,
    NoRotation,
    Uncertain,
}

struct PairResult {
    candidates: usize,
    outcome: Result<(RobustHomography, MotionGeometry), Refusal>,
}

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
    if names.len() != images.len() {
        return Err(Error::InvalidInput(format!("{} names for {} images", names.len(), images.len())));
    }
    if images.len() < 2 {
        return Err(Error::TooFewImages { found: images.len() });
    }
    let size = images[0].size();
    if let Some(other) = images.iter().position(|i| i.size() != size) {
        return Err(Error::InvalidInput(format!(
            "{} is {} pixels, {} is {size}: all images must come from one camera at one size",
            names[other],
            images[other].size(),
            names[0],
        )));
    }
    options.validate(size)?;
    let mut warnings = Vec::new();
    let pairs = candidate_pairs(images.len(), options)?;
    if options.pairs.is_none() && images.len() > options.all_pairs_limit {
        warnings.push(Warning::NeighboursOnly { images: images.len() });
    }
    let duplicate = |i: usize, j: usize| images[i] == images[j];
    for j in 1..images.len() {
        if let Some(i) = (0..j).find(|&i| duplicate(i, j)) {
            warnings.push(Warning::DuplicateImages { first: names[i].clone(), second: names[j].clone() });
        }
    }
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
    let min = options.min_plane_matches.unwrap_or(15);
    Pipeline { names, size, options, observer, min_matches: min }.run(&matched, warnings)
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
    let min = options.min_plane_matches.unwrap_or(6);
    Pipeline { names, size, options, observer, min_matches: min }.run(&chosen, Vec::new())
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
    options.validate(size)?;
    if !options.distortion.is_none() {
        return Err(Error::InvalidOption("a lens distortion cannot be undone in homographies".into()));
    }
    let results: Vec<(ImagePair, PairResult)> = homographies
        .iter()
        .map(|(from, to, estimate)| {
            let robust = RobustHomography {
                estimate: estimate.clone(),
                inliers: Vec::new(),
                trials: 0,
                static_background: 0,
                is_static: false,
            };
            let outcome = geometry_of(robust);
            (
                ImagePair { from: *from, to: *to, matches: Vec::new() },
                PairResult { candidates: estimate.matches, outcome },
            )
        })
        .collect();
    let (pairs, results): (Vec<_>, Vec<_>) = results.into_iter().unzip();
    let pipeline = Pipeline { names, size, options, observer: &Silent, min_matches: 0 };
    pipeline.conclude(&pairs, results, true, Vec::new())
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

fn geometry_of(robust: RobustHomography) -> Result<(RobustHomography, MotionGeometry), Refusal> {
    match from_homography(&robust.estimate) {
        Ok(geometry) => Ok((robust, geometry)),
        Err(NoCircularPoint::NoRotation { rotation_rad, significance }) => {
            let deg = rotation_rad.to_degrees();
            let near = if rotation_rad > 1.6 { "a turn near 180 degrees" } else { "a translation, or hardly a turn" };
            Err(Refusal {
                reason: format!(
                    "no rotation to be seen: {near} (eigenvalue angle {deg:.1} degrees, {significance:.1} sigma; 8 needed)"
                ),
                rotation_deg: Some(deg),
                homography: Some(robust),
                kind: RefusalKind::NoRotation,
            })
        }
        Err(NoCircularPoint::TooUncertain { sigma }) => Err(Refusal {
            reason: format!("circular point too uncertain (direction known to {:.0} degrees)", sigma.to_degrees()),
            rotation_deg: None,
            homography: Some(robust),
            kind: RefusalKind::Uncertain,
        }),
    }
}

struct Pipeline<'a> {
    names: &'a [String],
    size: ImageSize,
    options: &'a Options,
    observer: &'a dyn Observer,
    min_matches: usize,
}

/// A lens with the camera matrix through which its coefficients act.
#[derive(Clone, Copy)]
struct Lens {
    distortion: Distortion,
    intrinsics: Intrinsics,
}

impl Lens {
    fn ideal(&self, m: &PointMatch) -> Option<PointMatch> {
        let undo = |p: &Vector2<f64>| self.distortion.undistort_pixel(&self.intrinsics, p);
        Some(PointMatch { a: undo(&m.a)?, b: undo(&m.b)?, ..*m })
    }
}

impl Pipeline<'_> {
    fn frame(&self) -> Frame {
        Frame::new(self.size, self.options.principal_point_px)
    }

    fn run(&self, given: &[ImagePair], mut warnings: Vec<Warning>) -> Result<Calibration, Error> {
        let pairs: Vec<ImagePair> = given
            .iter()
            .map(|p| Ok(ImagePair { matches: validated(&p.matches, self.size)?, ..p.clone() }))
            .collect::<Result<_, Error>>()?;
        if let [only] = pairs.as_slice() {
            if only.matches.len() < 4 {
                return Err(Error::TooFewMatches {
                    from: self.names[only.from].clone(),
                    to: self.names[only.to].clone(),
                    given: given[0].matches.len(),
                    found: only.matches.len(),
                });
            }
        }
        let trusted = self.options.pairs.is_some();
        if self.options.distortion.is_none() {
            let results = self.homographies(&pairs, None);
            return self.conclude(&pairs, results, trusted, warnings);
        }
        // The coefficients act on coordinates divided by the focal length, which is not known yet: start from a middling
        // one, then once more with the result; the fixed point is found on the inliers (see `settle`).
        let [cx, cy] = self.options.principal_point_px.unwrap_or(self.size.centre_px());
        let mut lens = Lens {
            distortion: self.options.distortion,
            intrinsics: Intrinsics::square(self.size.width.max(self.size.height) as f64, cx, cy),
        };
        let mut amplification = 1.0;
        for _ in 0..2 {
            let results = self.homographies(&pairs, Some(&lens));
            let (motions, verdicts) = self.select(&results, &pairs, trusted)?;
            let used: Vec<usize> = accepted(&motions, &verdicts);
            let settled = self.settle(&pairs, &results, &used, lens)?;
            lens.intrinsics = settled.intrinsics;
            amplification = settled.amplification;
            if settled.last_change > 1e-6 {
                warnings.push(Warning::DistortionNotConverged { relative_change: settled.last_change });
            }
        }
        let results = self.homographies(&pairs, Some(&lens));
        let (motions, verdicts) = self.select(&results, &pairs, trusted)?;
        let used = accepted(&motions, &verdicts);
        let settled = self.settle(&pairs, &results, &used, lens)?;
        lens.intrinsics = settled.intrinsics;
        let results = self.refit_all(&pairs, results, &lens);
        warnings.dedup();
        let mut out = self.conclude_with(&pairs, results, trusted, warnings, Some(lens))?;
        amplify(&mut out, amplification.max(settled.amplification));
        Ok(out)
    }

    fn homographies(&self, pairs: &[ImagePair], lens: Option<&Lens>) -> Vec<PairResult> {
        self.observer.begin(Stage::Homographies, pairs.len());
        pairs
            .par_iter()
            .map(|pair| {
                let result = self.homography(pair, lens);
                self.observer.advance(Stage::Homographies);
                result
            })
            .collect()
    }

    fn homography(&self, pair: &ImagePair, lens: Option<&Lens>) -> PairResult {
        let candidates = pair.matches.len();
        let refuse = |reason: String, kind, homography| PairResult {
            candidates,
            outcome: Err(Refusal { reason, rotation_deg: None, homography, kind }),
        };
        if candidates < self.min_matches.max(4) {
            let text = format!("{candidates} matches only ({} needed)", self.min_matches.max(4));
            return refuse(text, RefusalKind::NoPlane, None);
        }
        // Indices into the pair's matches are kept; a match that has no ideal point is moved out of every model's reach.
        let ideal: Vec<PointMatch> = match lens {
            None => pair.matches.clone(),
            Some(lens) => pair.matches.iter().map(|m| lens.ideal(m).unwrap_or(*m)).collect(),
        };
        let mut robust = self.options.robust;
        robust.min_inliers = self.min_matches.max(6);
        robust.ransac.seed = self.options.seed ^ ((pair.from as u64) << 32 | pair.to as u64);
        match estimate_robust(&ideal, &self.frame(), &robust) {
            Err(_) => refuse(
                format!("no common plane: none of {candidates} matches agree on one"),
                RefusalKind::NoPlane,
                None,
            ),
            Ok(found) if found.inliers.len() < self.min_matches => {
                let text = format!(
                    "no common plane: {} of {candidates} matches agree on one ({} needed)",
                    found.inliers.len(),
                    self.min_matches
                );
                refuse(text, RefusalKind::NoPlane, Some(found))
            }
            Ok(found) if found.is_static => {
                let text = format!("nothing moved: {} of {candidates} matches stand still", found.inliers.len());
                refuse(text, RefusalKind::Static, Some(found))
            }
            Ok(found) => {
                let mut outcome = geometry_of(found);
                if let Ok((robust, geometry)) = &mut outcome {
                    geometry.circular_point.by_k1 = self.shift_by_k1(&ideal, robust, &geometry.circular_point);
                }
                PairResult { candidates, outcome }
            }
        }
    }

    /// The change of a circular point for each unit of k1 undone, by a difference: both homographies from the same (at most
    /// a few hundred) inliers.
    fn shift_by_k1(
        &self,
        matches: &[PointMatch],
        robust: &RobustHomography,
        point: &CircularPoint,
    ) -> Option<Vector4<f64>> {
        const STEP: f64 = 0.02;
        const ENOUGH: usize = 300;
        let [cx, cy] = self.options.principal_point_px.unwrap_or(self.size.centre_px());
        let lens = Lens {
            distortion: Distortion::radial(STEP, 0.0),
            intrinsics: Intrinsics::square(self.size.width.max(self.size.height) as f64, cx, cy),
        };
        let stride = robust.inliers.len().div_ceil(ENOUGH);
        let some: Vec<PointMatch> = robust.inliers.iter().step_by(stride).map(|&k| matches[k]).collect();
        let undone: Vec<PointMatch> = some.iter().filter_map(|m| lens.ideal(m)).collect();
        let coordinates = |matches: &[PointMatch]| {
            let start = &robust.estimate.in_frame;
            let estimate = refine(matches, Some(start), &self.frame(), &RefineOptions::default()).ok()?;
            let eigen = complex_pair_eigen(&estimate.in_frame)?;
            Some(point.coordinates_of(&eigen.complex_right))
        };
        Some((coordinates(&undone)? - coordinates(&some)?) / STEP)
    }

    /// Consistent motions among the pairs with circular points: indices of pairs, and a verdict each.
    fn select(
        &self,
        results: &[PairResult],
        pairs: &[ImagePair],
        trusted: bool,
    ) -> Result<(Vec<(usize, Motion)>, Vec<Verdict>), Error> {
        let frame = self.frame();
        let motions: Vec<(usize, Motion)> = results
            .iter()
            .enumerate()
            .filter_map(|(i, r)| {
                let (robust, geometry) = r.outcome.as_ref().ok()?;
                let points = robust.inliers.iter().map(|&k| frame.from_pixel(&pairs[i].matches[k].a));
                let sides = if geometry.minor_side(points) > MINOR_SIDE { Sides::Both } else { Sides::One };
                Some((i, Motion { from: pairs[i].from, to: pairs[i].to, geometry: geometry.clone(), sides }))
            })
            .collect();
        if motions.is_empty() {
            return Err(self.why_nothing(results));
        }
        let bare: Vec<Motion> = motions.iter().map(|(_, m)| m.clone()).collect();
        if trusted || bare.len() == 1 {
            let verdicts = vec![Verdict::Accepted; bare.len()];
            return Ok((motions, verdicts));
        }
        let consistency = ConsistencyOptions {
            attitude_sigma_rad: self.options.attitude_sigma_deg.max(SEARCH_ATTITUDE_SIGMA_DEG).to_radians(),
            k1_sigma: SEARCH_K1_SIGMA,
            direction_sigma: SEARCH_DIRECTION_SIGMA,
            principal_point_sigma: SEARCH_PRINCIPAL_POINT_SIGMA * self.size.width as f64 / frame.scale_px,
            aspect: self.options.aspect.unwrap_or(1.0),
            gate: MOTION_GATE,
        };
        let selection = find_consistent(&bare, &consistency);
        // Of two motions that disagree the better one is used, with a warning; from three on, agreement is asked for.
        if bare.len() >= 3 && selection.log_odds < selection.needed_log_odds {
            let agreeing = selection.verdicts.iter().filter(|v| **v == Verdict::Accepted).count();
            return Err(Error::NoUsableMotion {
                pairs: bare.len(),
                reason: format!(
                    "of the {} pairs that show a turning plane the best set that agrees on one camera has {agreeing}, no more than \
                     coincidence gives (log odds {:.1}, {:.1} needed): these are not turns about the floor's normal, or the lens \
                     distortion is large",
                    bare.len(),
                    selection.log_odds,
                    selection.needed_log_odds
                ),
                remedy: "Turn the camera without tilting it between the images of a motion; name the true motions with --pairs; give \
                         --k1 for a wide lens, or --attitude-sigma-deg for a carrier that pitches"
                    .into(),
            });
        }
        let verdicts = selection.verdicts;
        Ok((motions, verdicts))
    }

    fn why_nothing(&self, results: &[PairResult]) -> Error {
        let refusals = || results.iter().filter_map(|r| r.outcome.as_ref().err());
        let count = |kind| refusals().filter(|r| r.kind == kind).count();
        let with_plane = results.len() - count(RefusalKind::NoPlane);
        if with_plane == 0 {
            let best = refusals().filter_map(|r| r.homography.as_ref()).map(|h| h.inliers.len()).max().unwrap_or(0);
            return Error::NoCommonPlane { pairs: results.len(), best, needed: self.min_matches };
        }
        let turn = "Turn the camera by 15 to 60 degrees between the two images of a motion, without tilting it";
        let (reason, remedy) = if count(RefusalKind::Static) == with_plane {
            ("nothing moved between the images (all matches stand still)".to_string(), turn.to_string())
        } else if count(RefusalKind::NoRotation) > 0 {
            let largest = refusals()
                .filter(|r| r.kind == RefusalKind::NoRotation)
                .filter_map(|r| r.rotation_deg)
                .fold(0.0, f64::max);
            (
                format!(
                    "the camera was moved without a turn, a pure translation says nothing of the focal length (largest eigenvalue angle \
                     {largest:.1} degrees, not above its noise)"
                ),
                turn.to_string(),
            )
        } else {
            let text =
                refusals().find(|r| r.kind == RefusalKind::Uncertain).map_or(String::new(), |r| r.reason.clone());
            (text, "Give more matches spread over more of the image, and turn the camera further".to_string())
        };
        Error::NoUsableMotion { pairs: with_plane, reason, remedy }
    }

    /// The camera of the motions `used` (indices of pairs) after undoing the distortion of `lens` anew on their inliers.
    fn refit_camera(
        &self,
        pairs: &[ImagePair],
        results: &[PairResult],
        used: &[usize],
        lens: &Lens,
    ) -> Result<CameraSolution, Error> {
        let motions: Vec<Motion> = used
            .par_iter()
            .filter_map(|&i| {
                let (robust, _) = results[i].outcome.as_ref().ok()?;
                let estimate = self.refit(&pairs[i], robust, lens)?;
                let geometry = from_homography(&estimate).ok()?;
                Some(Motion { from: pairs[i].from, to: pairs[i].to, geometry, sides: Sides::One })
            })
            .collect();
        solve_camera(&motions, &self.frame(), &self.options.camera(self.size))
    }

    fn refit(&self, pair: &ImagePair, robust: &RobustHomography, lens: &Lens) -> Option<HomographyEstimate> {
        let ideal: Vec<PointMatch> = robust.inliers.iter().filter_map(|&k| lens.ideal(&pair.matches[k])).collect();
        refine(&ideal, None, &self.frame(), &RefineOptions::default()).ok()
    }

    fn refit_all(&self, pairs: &[ImagePair], results: Vec<PairResult>, lens: &Lens) -> Vec<PairResult> {
        results
            .into_iter()
            .zip(pairs)
            .map(|(result, pair)| {
                let outcome = match result.outcome {
                    Ok((mut robust, geometry)) => {
                        if let Some(estimate) = self.refit(pair, &robust, lens) {
                            robust.estimate = estimate;
                        }
                        let by_k1 = geometry.circular_point.by_k1;
                        geometry_of(robust).map(|(robust, mut geometry)| {
                            geometry.circular_point.by_k1 = by_k1;
                            (robust, geometry)
                        })
                    }
                    refused => refused,
                };
                PairResult { outcome, ..result }
            })
            .collect()
    }

    /// The camera that, used to undo the given distortion, comes out again: Steffensen's iteration on ln f.
    fn settle(
        &self,
        pairs: &[ImagePair],
        results: &[PairResult],
        used: &[usize],
        start: Lens,
    ) -> Result<Settled, Error> {
        let mut lens = start;
        let mut slope: f64 = 0.0;
        let mut last: Option<(f64, f64)> = None;
        let mut last_change = f64::INFINITY;
        for _ in 0..25 {
            let solved = self.refit_camera(pairs, results, used, &lens)?.intrinsics;
            let (input, output) = (lens.intrinsics.fx.ln(), solved.fx.ln());
            if let Some((last_input, last_output)) = last {
                if (input - last_input).abs() > 1e-7 {
                    slope = ((output - last_output) / (input - last_input)).clamp(-3.0, 0.95);
                }
            }
            last = Some((input, output));
            last_change = (output - input).abs();
            // Newton on output(input) - input, not more than a factor of two at once.
            let step = ((output - input) / (1.0 - slope)).clamp(-0.7, 0.7);
            let factor = (input + step - output).exp();
            lens.intrinsics =
                Intrinsics { fx: solved.fx * factor, fy: solved.fy * factor, skew: solved.skew * factor, ..solved };
            if last_change < 1e-10 {
                break;
            }
        }
        Ok(Settled { intrinsics: lens.intrinsics, amplification: (1.0 / (1.0 - slope)).max(1.0), last_change })
    }

    fn conclude(
        &self,
        pairs: &[ImagePair],
        results: Vec<PairResult>,
        trusted: bool,
        warnings: Vec<Warning>,
    ) -> Result<Calibration, Error> {
        self.conclude_with(pairs, results, trusted, warnings, None)
    }

    fn conclude_with(
        &self,
        pairs: &[ImagePair],
        results: Vec<PairResult>,
        trusted: bool,
        mut warnings: Vec<Warning>,
        lens: Option<Lens>,
    ) -> Result<Calibration, Error> {
        self.observer.begin(Stage::Camera, 1);
        let (motions, verdicts) = self.select(&results, pairs, trusted)?;
        let used = accepted(&motions, &verdicts);
        let used_motions: Vec<Motion> =
            motions.iter().filter(|(i, _)| used.contains(i)).map(|(_, m)| m.clone()).collect();
        let solution = solve_camera(&used_motions, &self.frame(), &self.options.camera(self.size))?;

        for (pair, result) in pairs.iter().zip(&results) {
            if let Ok((robust, _)) = &result.outcome {
                if robust.static_background > 0 {
                    warnings.push(Warning::StaticBackground {
                        from: self.names[pair.from].clone(),
                        to: self.names[pair.to].clone(),
                        matches: robust.static_background,
                    });
                }
            }
        }
        let matched = pairs.iter().any(|p| !p.matches.is_empty());
        if lens.is_none() && matched {
            // An unmodelled k1 of the true lens shows as the change that undoing it would make, the other way round.
            let f_if = |k1: f64| {
                let lens = Lens { distortion: Distortion::radial(k1, 0.0), intrinsics: solution.intrinsics };
                self.refit_camera(pairs, &results, &used, &lens)
                    .map(|s| 100.0 * (solution.intrinsics.fx / s.intrinsics.fx - 1.0))
            };
            warnings.push(Warning::DistortionNotModelled {
                barrel_minus_percent: f_if(0.05).unwrap_or(f64::INFINITY),
                barrel_percent: f_if(-0.05).unwrap_or(f64::INFINITY),
            });
        }
        let mut attitudes = Vec::new();
        for group in &solution.groups {
            let point_sets = group.members.iter().map(|&m| used[m]).filter_map(|i| {
                let (robust, _) = results[i].outcome.as_ref().ok()?;
                Some((&pairs[i].matches, &robust.inliers))
            });
            let seen = point_sets.flat_map(|(matches, inliers)| inliers.iter().map(|&k| matches[k].a));
            attitudes.push(Attitude::of(&group.fused.point, &solution.intrinsics, &self.frame(), seen));
        }
        self.add_warnings(&mut warnings, &solution, &attitudes, used.len());
        let motion_reports = self.motion_reports(pairs, &results, &motions, &verdicts, &used, &solution, &attitudes);
        let reports = solution
            .groups
            .iter()
            .zip(&attitudes)
            .map(|(group, attitude)| AttitudeReport {
                pitch_down_deg: attitude.pitch_down_rad.to_degrees(),
                roll_deg: attitude.roll_rad.to_degrees(),
                horizon_px: attitude.horizon_px,
                motions: group.members.iter().map(|&m| used[m]).collect(),
            })
            .collect();
        self.observer.advance(Stage::Camera);
        Ok(self.assemble(&solution, lens, reports, motion_reports, &warnings))
    }

    fn add_warnings(&self, warnings: &mut Vec<Warning>, s: &CameraSolution, attitudes: &[Attitude], motions: usize) {
        if motions == 1 {
            warnings.push(Warning::SingleMotion);
        }
        if attitudes.len() == 1 {
            warnings.push(Warning::SingleAttitude { motions });
        } else if s.estimated[2] {
            // Rolls modulo 180 degrees: the horizon is a line without direction.
            let rolls: Vec<f64> = attitudes.iter().map(|a| a.roll_rad).collect();
            let apart = |a: f64, b: f64| {
                let d = (a - b).rem_euclid(std::f64::consts::PI);
                d.min(std::f64::consts::PI - d)
            };
            let spread = rolls.iter().flat_map(|a| rolls.iter().map(move |b| apart(*a, *b))).fold(0.0, f64::max);
            if spread < 5f64.to_radians() {
                warnings.push(Warning::ParallelHorizons { spread_deg: spread.to_degrees() });
            }
        }
        if s.variance_inflation > 1.0 {
            warnings.push(Warning::MotionsDisagree {
                chi_squared: s.chi_squared,
                degrees_of_freedom: s.degrees_of_freedom,
                widened: s.variance_inflation.sqrt(),
            });
        }
        for prior in s.priors.iter().filter(|p| p.parameter != "aspect" && p.posterior_over_prior > 0.7) {
            warnings.push(Warning::PriorDecides {
                parameter: prior.parameter,
                posterior_over_prior: prior.posterior_over_prior,
            });
        }
        let percent = 100.0 * s.covariance_px[(0, 0)].sqrt() / s.intrinsics.fx;
        if percent > 5.0 {
            warnings.push(Warning::LargeUncertainty { percent });
        }
    }

    #[allow(clippy::too_many_arguments)]
    fn motion_reports(
        &self,
        pairs: &[ImagePair],
        results: &[PairResult],
        motions: &[(usize, Motion)],
        verdicts: &[Verdict],
        used: &[usize],
        solution: &CameraSolution,
        attitudes: &[Attitude],
    ) -> Vec<MotionReport> {
        let name = |i: usize| self.names[i].clone();
        pairs
            .iter()
            .zip(results)
            .enumerate()
            .map(|(i, (pair, result))| {
                let position = used.iter().position(|&u| u == i);
                let attitude = position.and_then(|m| solution.groups.iter().position(|g| g.members.contains(&m)));
                let verdict = motions.iter().position(|(m, _)| *m == i).map(|m| verdicts[m]);
                let reason = match (&result.outcome, verdict) {
                    (Err(refusal), _) => Some(refusal.reason.clone()),
                    (Ok(_), Some(Verdict::Disagrees { sigmas })) if sigmas.is_finite() => {
                        Some(format!("not a turn about the floor's normal: no agreement with the other motions' camera ({sigmas:.0} sigma)"))
                    }
                    (Ok(_), Some(Verdict::Disagrees { .. })) => Some("agrees with no camera".to_string()),
                    (Ok(_), Some(Verdict::WrongSides)) => Some(
                        "not a turn about the floor's normal: the horizon it implies passes between its points".to_string(),
                    ),
                    (Ok(_), Some(Verdict::OtherAttitude { motion, image, sigmas })) => {
                        let other = &motions[motion].1;
                        Some(format!(
                            "not a turn about the floor's normal: {} has another attitude in {} - {} ({sigmas:.0} sigma)",
                            name(image),
                            name(other.from),
                            name(other.to)
                        ))
                    }
                    _ => None,
                };
                let robust = match &result.outcome {
                    Ok((robust, _)) => Some(robust),
                    Err(refusal) => refusal.homography.as_ref(),
                };
                let geometry = result.outcome.as_ref().ok().map(|(_, g)| g);
                let rotation = geometry.map(|g| {
                    let turn = g.rotation_rad.to_degrees();
                    match attitude.map(|a| &attitudes[a]) {
                        Some(a) => turn * a.turn_sign(&g.circular_point, &solution.intrinsics, &self.frame()),
                        None => turn,
                    }
                });
                let refused_rotation = result.outcome.as_ref().err().and_then(|r| r.rotation_deg);
                MotionReport {
                    from: name(pair.from),
                    to: name(pair.to),
                    used: position.is_some(),
                    rotation_deg: rotation.or(refused_rotation),
                    rotation_sigma_deg: geometry.map(|g| g.rotation_sigma_rad.to_degrees()),
                    rho: geometry.map(|g| g.rho),
                    rho_sigma: geometry.map(|g| g.rho_sigma),
                    matches: robust.map_or(0, |r| r.estimate.matches),
                    candidate_matches: result.candidates,
                    rms_px: robust.map(|r| r.estimate.rms_px),
                    attitude,
                    reason,
                }
            })
            .collect()
    }

    fn assemble(
        &self,
        s: &CameraSolution,
        lens: Option<Lens>,
        attitudes: Vec<AttitudeReport>,
        motions: Vec<MotionReport>,
        warnings: &[Warning],
    ) -> Calibration {
        let k = &s.intrinsics;
        let sd = |i: usize| s.estimated[i].then(|| s.covariance_px[(i, i)].max(0.0).sqrt());
        let d = lens.map_or(Distortion::default(), |l| l.distortion);
        Calibration {
            format_version: 1,
            pixel_centre: "(0,0) is the centre of the top-left pixel",
            camera: Camera {
                image_size: [self.size.width, self.size.height],
                fx: k.fx,
                fy: k.fy,
                cx: k.cx,
                cy: k.cy,
                skew: k.skew,
                distortion: DistortionReport {
                    model: if d.is_none() { "none" } else { "radtan" },
                    k1: d.k1,
                    k2: d.k2,
                    p1: d.p1,
                    p2: d.p2,
                },
            },
            standard_deviation: StandardDeviation {
                fx: sd(0),
                fy: sd(1),
                cx: sd(2),
                cy: sd(3),
                skew: sd(4),
                k1: None,
                k2: None,
            },
            covariance: Covariance {
                parameters: ["fx", "fy", "cx", "cy", "skew"],
                matrix: std::array::from_fn(|r| std::array::from_fn(|c| s.covariance_px[(r, c)])),
            },
            constraint: self.options.constraint.name().to_string(),
            method: "linear (Knight, Zisserman & Reid 2003), weighted",
            priors: s
                .priors
                .iter()
                .map(|p| Prior {
                    parameter: p.parameter,
                    mean: p.mean,
                    sigma: p.sigma,
                    posterior_over_prior: p.posterior_over_prior,
                })
                .collect(),
            attitude_sigma_deg: self.options.attitude_sigma_deg,
            fit: Fit {
                chi_squared: s.chi_squared,
                degrees_of_freedom: s.degrees_of_freedom,
                variance_inflation: s.variance_inflation,
                distortion_amplification: 1.0,
            },
            attitudes,
            motions,
            warnings: warnings.iter().map(Warning::report).collect(),
        }
    }
}

fn accepted(motions: &[(usize, Motion)], verdicts: &[Verdict]) -> Vec<usize> {
    motions.iter().zip(verdicts).filter(|(_, v)| **v == Verdict::Accepted).map(|((i, _), _)| *i).collect()
}

struct Settled {
    intrinsics: Intrinsics,
    /// d ln f / d ln(f of the noise alone): the given coefficients pull the answer along with the focal length.
    amplification: f64,
    last_change: f64,
}

fn amplify(c: &mut Calibration, factor: f64) {
    let s = &mut c.standard_deviation;
    for value in [&mut s.fx, &mut s.fy, &mut s.cx, &mut s.cy, &mut s.skew].into_iter().flatten() {
        *value *= factor;
    }
    for value in c.covariance.matrix.iter_mut().flatten() {
        *value *= factor * factor;
    }
    c.fit.distortion_amplification = factor;
}

/// The floor's normal in the camera frame.
struct Attitude {
    pitch_down_rad: f64,
    roll_rad: f64,
    horizon_px: Option<[f64; 3]>,
    up: Vector3<f64>,
}

impl Attitude {
    /// From a circular point (frame coordinates): the normal is the cross product of the real and imaginary part of
    /// K⁻¹e. It points up: away from the points seen on the floor, or, when points lie on both sides of the horizon (a
    /// scene at infinity), to the top of the image.
    fn of(point: &CircularPoint, k: &Intrinsics, frame: &Frame, seen: impl Iterator<Item = Vector2<f64>>) -> Self {
        let mut up = normal_of(point, k, frame);
        let (mut below, mut above) = (0usize, 0usize);
        for p in seen {
            if k.ray(&p).dot(&up) < 0.0 {
                below += 1;
            } else {
                above += 1;
            }
        }
        let one_sided = below.max(above) > 9 * below.min(above) && below + above > 0;
        let turn_over = if one_sided { above > below } else { up.y > 0.0 || (up.y == 0.0 && up.z > 0.0) };
        if turn_over {
            up = -up;
        }
        let line = k.inverse_matrix().transpose() * up;
        let length = line.xy().norm();
        Self {
            pitch_down_rad: (-up.z).clamp(-1.0, 1.0).asin(),
            roll_rad: (-up.x).atan2(-up.y),
            horizon_px: (length > 1e-12).then(|| [line.x / length, line.y / length, line.z / length]),
            up,
        }
    }

    /// +1 when the eigenvalue's angle is a counter-clockwise turn of the camera seen from above, -1 otherwise: the
    /// eigenvector K A (1, i, 0) belongs to exp(i (yaw_b - yaw_a)).
    fn turn_sign(&self, point: &CircularPoint, k: &Intrinsics, frame: &Frame) -> f64 {
        normal_of(point, k, frame).dot(&self.up).signum()
    }
}

fn normal_of(point: &CircularPoint, k: &Intrinsics, frame: &Frame) -> Vector3<f64> {
    let m = (k.inverse_matrix() * frame.pixel_matrix()).map(|x| nalgebra::Complex::new(x, 0.0));
    let v = m * point.point;
    v.map(|z| z.re).cross(&v.map(|z| z.im)).normalize()
}
