//! From the matches of pairs to what each pair shows: a homography and the motion in it, or the reason why not.

use nalgebra::{Vector2, Vector4};
use rayon::prelude::*;

use crate::{
    error::Error,
    geometry::{frame::Frame, homography::Homography, intrinsics::Intrinsics, lens::Lens},
    ids::PairId,
    numerics::linalg::complex_pair_eigen,
    observer::{Observer, Silent, Stage},
    pairs::{
        circular_points::CircularPoint,
        correspondence::{ImagePair, PointMatch},
        dlt::direct_linear_transformation,
        observation::{PairObservation, Refusal, RefusalKind, TurningPlane, turning_plane},
        placed_lens::PlacedLens,
        ray_match::RayMatch,
        refine::{HomographyEstimate, RefineOptions, refine, refine_in_frame, refine_until, to_frame},
        residual::PlaneMatch,
        robust::{RobustHomography, RobustOptions, estimate_in_frame},
    },
};

/// Options of [`observe`].
#[derive(Debug, Clone, Copy)]
pub(crate) struct ObserveOptions {
    /// Frame of the homographies.
    pub(crate) frame: Frame,
    /// Through which a radial distortion is thought to act before the camera is known: a nominal focal length.
    pub(crate) nominal_camera: Intrinsics,
    /// Fewest matches on a plane.
    pub(crate) min_matches: usize,
    /// Matches come from elsewhere and may be coarser than those of features.
    pub(crate) from_elsewhere: bool,
    /// Robust homographies.
    pub(crate) robust: RobustOptions,
    /// Seed of the random samples.
    pub(crate) seed: u64,
}

/// Largest noise of a patch match in units of its predicted deviation.
const MAX_PATCH_NOISE: f64 = 6.0;
/// Fraction of the largest noise thought possible from which on more is allowed for given matches, and where that ends.
const NOISE_LIMIT_FRACTION: f64 = 0.6;
pub(crate) const MAX_NOISE_PX: f64 = 16.0;
/// Where no model takes any point to.
pub(crate) const OUTSIDE_MODEL_PX: f64 = 1e7;
/// Width over length below which points count as lying on a line.
const MAX_LINE_ASPECT: f64 = 0.01;

type Outcome = Result<TurningPlane, Refusal>;

/// What every pair shows, the distortion of a lens undone.
///
/// # Errors
/// [`Error::Stopped`] and no other: a pair that shows nothing says why.
pub(crate) fn observe(
    pairs: Vec<ImagePair>,
    lens: Option<&PlacedLens>,
    options: &ObserveOptions,
    observer: &dyn Observer,
) -> Result<Vec<PairObservation>, Error> {
    let outcomes =
        observer.map(Stage::Homographies, &pairs, |pair| outcome_of_matches(pair, lens, options, observer))?;
    let observed = pairs.into_iter().zip(outcomes).enumerate();
    Ok(observed.map(|(i, (pair, outcome))| PairObservation::new(PairId::new(i), pair, outcome).through(lens)).collect())
}

/// The same pairs looked at afresh under another lens; those of pictures that others show already stay set aside.
///
/// # Errors
/// [`Error::Stopped`] and no other.
pub(crate) fn observe_anew(
    pairs: Vec<PairObservation>,
    lens: Option<&PlacedLens>,
    options: &ObserveOptions,
    observer: &dyn Observer,
) -> Result<Vec<PairObservation>, Error> {
    let repeated =
        |pair: &PairObservation| pair.outcome.as_ref().err().filter(|r| r.kind == RefusalKind::Repeated).cloned();
    let kept: Vec<Option<Refusal>> = pairs.iter().map(repeated).collect();
    let mut anew = observe(pairs.into_iter().map(PairObservation::into_pair).collect(), lens, options, observer)?;
    for (pair, refusal) in anew.iter_mut().zip(kept) {
        if let Some(refusal) = refusal {
            pair.outcome = Err(refusal);
        }
    }
    Ok(anew)
}

/// One pair looked at again under another lens: patches stay patches, and a background set aside stays so.
///
/// # Errors
/// [`Error::Stopped`] and no other.
pub(crate) fn observe_again(
    before: &PairObservation,
    lens: Option<&PlacedLens>,
    options: &ObserveOptions,
    observer: &dyn Observer,
) -> Result<PairObservation, Error> {
    let pair = ImagePair { from: before.from.index(), to: before.to.index(), matches: before.matches.clone() };
    let patches = before.outcome.as_ref().is_ok_and(|turning| turning.plane.patches);
    let mut outcome = if patches {
        outcome_of_patches(&pair, lens, options, observer)?
    } else {
        outcome_of_matches(&pair, lens, options, observer)?
    };
    if let (Ok(new), Ok(old)) = (&mut outcome, &before.outcome) {
        (new.plane.patches, new.plane.static_background) = (old.plane.patches, old.plane.static_background);
    }
    let superseded = before.superseded.clone();
    let new = PairObservation::new(before.id, pair, outcome).through(lens);
    Ok(PairObservation { candidates: before.candidates, superseded, ..new })
}

/// The homography of matches found to be on a pair's plane, the distortion of a lens undone.
pub(crate) fn refit(
    pair: &PairObservation,
    plane: &RobustHomography,
    lens: &PlacedLens,
    frame: &Frame,
) -> Option<HomographyEstimate> {
    let inliers = plane.inliers.iter().map(|&k| &pair.matches[k]);
    if lens.lens.sees_behind() {
        let rays = inliers.map(|m| RayMatch::new(m, lens, frame)).filter(RayMatch::is_seen).collect::<Vec<_>>();
        return refine_in_frame(&rays, None, frame, &RefineOptions::default(), &Silent).ok();
    }
    let ideal: Vec<PointMatch> = inliers.filter_map(|m| lens.ideal_match(m)).collect();
    refine(&ideal, None, frame, &RefineOptions::default()).ok()
}

/// The homographies of all pairs from the matches found to be on their planes, the distortion of a lens undone.
pub(crate) fn refit_all(
    pairs: Vec<PairObservation>,
    lens: &PlacedLens,
    frame: &Frame,
    observer: &dyn Observer,
) -> Result<Vec<PairObservation>, Error> {
    let refitted = |mut pair: PairObservation| {
        observer.go_on()?;
        if let Ok(turning) = &pair.outcome {
            let mut plane = turning.plane.clone();
            let by_k1 = turning.geometry.circular_point.by_k1;
            if let Some(estimate) = refit(&pair, &plane, lens, frame) {
                plane.estimate = estimate;
            }
            pair.outcome = turning_plane(plane).map(|mut turning| {
                turning.geometry.circular_point.by_k1 = by_k1;
                turning
            });
        }
        Ok(pair.through(Some(lens)))
    };
    pairs.into_par_iter().map(refitted).collect()
}

/// The linear homographies of all pairs from the matches found to be on their planes, every match with the same weight. Their covariances
/// are those of the refined ones, which to first order they share.
///
/// # Errors
/// [`Error::Stopped`] and no other.
pub(crate) fn refit_linearly(
    pairs: Vec<PairObservation>,
    frame: &Frame,
    observer: &dyn Observer,
) -> Result<Vec<PairObservation>, Error> {
    let refitted = |mut pair: PairObservation| {
        observer.go_on()?;
        let on_plane: Vec<PointMatch> = pair.inliers().map(|m| PointMatch { sigma_px: 1.0, ..*m }).collect();
        if let Ok(turning) = &pair.outcome
            && let Some((in_frame, _)) = direct_linear_transformation(&to_frame(&on_plane, frame))
            && let Ok(h_b_from_a) = Homography::from_frame(&in_frame, frame)
        {
            let mut plane = turning.plane.clone();
            plane.estimate = HomographyEstimate { in_frame, h_b_from_a, ..plane.estimate };
            pair.outcome = turning_plane(plane);
        }
        Ok(pair)
    };
    pairs.into_par_iter().map(refitted).collect()
}

/// A number that matches have whatever their order and the place of their images: each pair has samples of its own.
pub(crate) fn key_of(matches: &[PointMatch]) -> u64 {
    let key = |m: &PointMatch| {
        let words = [m.a.x, m.a.y, m.b.x, m.b.y].map(f64::to_bits);
        words.iter().fold(0xcbf2_9ce4_8422_2325, |hash: u64, word| (hash ^ word).wrapping_mul(0x0000_0100_0000_01b3))
    };
    matches.iter().fold(0, |sum: u64, m| sum.wrapping_add(key(m)))
}

/// From features, or from points given.
///
/// # Errors
/// [`Error::Stopped`] and no other.
pub(crate) fn outcome_of_matches(
    pair: &ImagePair,
    lens: Option<&PlacedLens>,
    options: &ObserveOptions,
    observer: &dyn Observer,
) -> Result<Outcome, Error> {
    let mut robust = options.robust;
    let mut outcome = outcome_with(pair, lens, robust, options, observer)?;
    // Matches from elsewhere may be coarser than those of features: where the noise comes near what was thought possible, it
    // is cut off by that, and more is allowed.
    while options.from_elsewhere && robust.max_sigma_px < MAX_NOISE_PX {
        let plane = match &outcome {
            Ok(turning) => Some(&turning.plane),
            Err(refusal) => refusal.plane.as_deref(),
        };
        if plane.map_or(0.0, |plane| plane.estimate.sigma_px) < NOISE_LIMIT_FRACTION * robust.max_sigma_px {
            break;
        }
        robust.max_sigma_px *= 2.0;
        outcome = outcome_with(pair, lens, robust, options, observer)?;
    }
    Ok(outcome)
}

/// From patches, which carry their own deviation: noise is in units of it.
///
/// # Errors
/// [`Error::Stopped`] and no other.
pub(crate) fn outcome_of_patches(
    pair: &ImagePair,
    lens: Option<&PlacedLens>,
    options: &ObserveOptions,
    observer: &dyn Observer,
) -> Result<Outcome, Error> {
    let robust = RobustOptions { max_sigma_px: MAX_PATCH_NOISE, static_px: 0.0, ..options.robust };
    outcome_with(pair, lens, robust, options, observer)
}

fn outcome_with(
    pair: &ImagePair,
    lens: Option<&PlacedLens>,
    mut robust: RobustOptions,
    options: &ObserveOptions,
    observer: &dyn Observer,
) -> Result<Outcome, Error> {
    let (candidates, min_matches) = (pair.matches.len(), options.min_matches);
    if candidates < min_matches.max(4) {
        let reason = format!("{candidates} matches only ({} needed)", min_matches.max(4));
        return Ok(Err(Refusal::new(RefusalKind::NoPlane, reason, None)));
    }
    robust.min_inliers = min_matches.max(6);
    robust.ransac.seed = options.seed ^ key_of(&pair.matches);
    if let Some(lens) = lens.filter(|lens| lens.lens.sees_behind()) {
        let rays: Vec<RayMatch> = pair.matches.iter().map(|m| RayMatch::new(m, lens, &options.frame)).collect();
        return plane_among(&rays, &robust, options, observer);
    }
    // Indices into the pair's matches are kept; a match that has no ideal point is moved out of every model's reach.
    let ideal: Vec<PointMatch> = match lens {
        None => pair.matches.clone(),
        Some(lens) => pair
            .matches
            .iter()
            .map(|m| lens.ideal_match(m).unwrap_or(PointMatch { b: Vector2::repeat(OUTSIDE_MODEL_PX), ..*m }))
            .collect(),
    };
    let mut outcome = plane_among(&to_frame(&ideal, &options.frame), &robust, options, observer)?;
    if let Ok(TurningPlane { plane, geometry }) = &mut outcome {
        let on_plane: Vec<PointMatch> = plane.inliers.iter().map(|&k| ideal[k]).collect();
        let point = &geometry.circular_point;
        geometry.circular_point.by_k1 = shift_by_k1(&on_plane, plane, point, options, observer);
    }
    observer.go_on()?;
    Ok(outcome)
}

/// The plane that most of the matches agree on, and the motion in it.
fn plane_among<M: PlaneMatch>(
    matches: &[M],
    robust: &RobustOptions,
    options: &ObserveOptions,
    observer: &dyn Observer,
) -> Result<Outcome, Error> {
    let found = match estimate_in_frame(matches, &options.frame, robust, observer) {
        Ok(found) => found,
        Err(Error::Stopped) => return Err(Error::Stopped),
        Err(error) => return Ok(Err(no_plane(matches, error))),
    };
    let on_plane: Vec<M> = found.inliers.iter().map(|&k| matches[k].clone()).collect();
    if let Some(refusal) = refused(&found, matches, M::spread(&on_plane), (options.min_matches, robust.static_px)) {
        return Ok(Err(Refusal { plane: Some(Box::new(found)), ..refusal }));
    }
    Ok(turning_plane(found))
}

/// Matches among which no plane was found.
fn no_plane<M: PlaneMatch>(ideal: &[M], error: Error) -> Refusal {
    let candidates = ideal.len();
    if M::spread(ideal) < MAX_LINE_ASPECT {
        let reason = format!("the {candidates} matches lie on a line ({})", width_of(M::spread(ideal)));
        return Refusal { error: Some(Box::new(error)), ..Refusal::new(RefusalKind::NoPlane, reason, None) };
    }
    Refusal::new(RefusalKind::NoPlane, format!("no common plane: none of {candidates} matches agree on one"), None)
}

/// How far points are from telling a plane, in words.
fn width_of(spread: f64) -> String {
    format!("{:.1} % as wide as long, {:.0} % needed", 100.0 * spread, 100.0 * MAX_LINE_ASPECT)
}

/// What is wrong with a plane found, whose matches spread by this ratio of width to length.
fn refused<M: PlaneMatch>(
    found: &RobustHomography,
    ideal: &[M],
    spread: f64,
    (min_matches, static_px): (usize, f64),
) -> Option<Refusal> {
    let (agreeing, candidates) = (found.inliers.len(), ideal.len());
    if spread < MAX_LINE_ASPECT {
        let reason = format!("the {agreeing} matches that agree lie on a line ({})", width_of(spread));
        let error = Error::DegeneratePoints { count: agreeing, spread_ratio: M::spread(ideal) };
        return Some(Refusal { error: Some(Box::new(error)), ..Refusal::new(RefusalKind::NoPlane, reason, None) });
    }
    if agreeing < min_matches {
        let reason = format!("no common plane: {agreeing} of {candidates} matches agree on one ({min_matches} needed)");
        return Some(Refusal::new(RefusalKind::NoPlane, reason, None));
    }
    if found.is_static {
        let reason =
            format!("nothing moved: {agreeing} of {candidates} matches stand still, to {static_px} px in the median");
        return Some(Refusal::new(RefusalKind::Static, reason, None));
    }
    None
}

/// The change of a circular point for each unit of k1 undone, by a difference: both homographies from the same (at most
/// a few hundred) matches.
fn shift_by_k1(
    on_plane: &[PointMatch],
    plane: &RobustHomography,
    point: &CircularPoint,
    options: &ObserveOptions,
    observer: &dyn Observer,
) -> Option<Vector4<f64>> {
    const STEP: f64 = 0.02;
    const MIN_SCALE_MATCHES: usize = 300;
    let lens = PlacedLens { lens: Lens::radial(STEP, 0.0), intrinsics: options.nominal_camera };
    let stride = on_plane.len().div_ceil(MIN_SCALE_MATCHES);
    let some: Vec<PointMatch> = on_plane.iter().step_by(stride).copied().collect();
    let undone: Vec<PointMatch> = some.iter().filter_map(|m| lens.ideal_match(m)).collect();
    let coordinates = |matches: &[PointMatch]| {
        let start = &plane.estimate.in_frame;
        let estimate = refine_until(matches, Some(start), &options.frame, &RefineOptions::default(), observer).ok()?;
        let eigen = complex_pair_eigen(&estimate.in_frame)?;
        Some(point.coordinates_of(&eigen.complex_right))
    };
    Some((coordinates(&undone)? - coordinates(&some)?) / STEP)
}
