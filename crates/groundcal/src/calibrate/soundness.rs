//! Converged or not an answer: a refinement is tried from other starts, then without its worst motions, and refused in the end.
//!
//! ```text
//! unsound:   not converged,   P(χ²(σ_a = 2.5 degrees)) < 0.001,   s² > 25,   D > 2.6 (directions),   2 atan(w / 2f) > 170 degrees
//! wrong motion m:   s² of all is no noise,  s² without m is,   gain of "m apart" > 2 ln 1000  and  > the next suspect's + 2 ln 1000 + 3.09 √(32 (M - 1))
//! ```
//!
//! s²: variance of the residuals in units of the matching noise, of the kind that has most; D: their design effect; w: side of the image; χ² of the
//! attitude errors under the largest σ_a with which a motion is one. gain: by how much -2 ln E of the residuals falls where those of m are left to a
//! homography of its own ([`crate::refine::evidence`]); M motions, whose homographies of their own would take eight numbers each.

use crate::{
    calibrate::{
        joint::JointSolution,
        prior_conflicts::RELEASE_ODDS,
        refinement::{Starts, refine_motions},
        refinement_input::{Refined, RefinementOptions},
    },
    error::Error,
    geometry::{intrinsics::Intrinsics, size::ImageSize},
    ids::{PairId, ViewId},
    numerics::statistics::{NORMAL_999, chi_squared_survival, median},
    observer::Observer,
    pairs::{known_lens::KnownLens, observation::PairObservation},
    refine::{Kind, SceneModel, blocks::MATRIX},
    remedy::Remedy,
    result::judge::VARIANCE_RANGE,
    select::selection::Selection,
    start::linear_camera::{CameraSolution, solve_camera_until},
};

/// Largest variance of the residuals in units of the matching noise: five times its deviation. (Of a real panorama whose lens is not quite
/// that of the model, and which is right to 0.05 %, it is 4.4.)
const MAX_VARIANCE: f64 = 25.0;
/// Largest design effect of the residuals of a scene of directions: what neighbours have in common there is parallax, of a lens off the
/// axes before things that are not far away. (Of scenes with the lens on the axes or all things far, 3 of 60 are beyond, by a lens of higher
/// order; of those with the lens off by 3 mm to 20 cm, 58 of 80, nearly all of them wrong by more than 4 deviations.)
const MAX_DIRECTIONS_DESIGN_EFFECT: f64 = 2.6;
/// Significance level of attitude errors beyond the largest σ_a.
const TOO_LARGE_ERRORS_P: f64 = 1e-3;
/// Widest field of view, degrees across the width, that a flat image can have.
const MAX_FIELD_OF_VIEW_DEG: f64 = 170.0;
/// Motions that are dropped one after the other, at most, and as a fraction of all.
const MAX_DROPPED: usize = 4;
const MAX_DROPPED_FRACTION: f64 = 0.25;
/// Significance level of what is left of points beyond their noise.
const ABOVE_NOISE_P: f64 = 1e-3;
/// Motions, those with the largest residuals first, of which each is looked at as the wrong one: a refinement each.
const MAX_SUSPECTS: usize = 4;

/// A refinement that can be vouched for.
pub(super) struct AcceptedRefinement {
    pub(super) refined: Refined,
    /// The selection without the motions that were dropped, if any were.
    pub(super) selection: Option<Selection>,
}

/// Refines the motions selected until it holds. `None` when there are no matches to refine on.
///
/// # Errors
/// [`Error::Unsound`] when there is no end to it; [`Error::Stopped`].
pub(super) fn refine_until_sound(
    pairs: &[PairObservation],
    selection: &Selection,
    solution: &CameraSolution,
    lens: &KnownLens,
    (options, size): (&RefinementOptions, ImageSize),
    observer: &dyn Observer,
) -> Result<Option<AcceptedRefinement>, Error> {
    let attempt = |selection: &Selection, solution: &CameraSolution, starts: Starts| {
        let refined = match refine_motions(pairs, selection, solution, lens, options, starts, observer) {
            Ok(Some(refined)) => refined,
            Ok(None) => return Ok(Attempt::NothingToRefine),
            Err(Error::Stopped) => return Err(Error::Stopped),
            Err(error) => return Ok(Attempt::Failed(error, None)),
        };
        Ok(match check_soundness(&refined.joint, size) {
            Ok(()) => Attempt::AcceptedRefinement(refined),
            Err(error) => Attempt::Failed(error, Some(refined)),
        })
    };
    let resolve =
        |left: &Selection| match solve_camera_until(&left.motions(pairs), &options.frame, &options.camera, observer) {
            Ok(solution) => Ok(Some(solution)),
            Err(Error::Stopped) => Err(Error::Stopped),
            Err(_) => Ok(None),
        };
    let used = selection.used();
    let most = MAX_DROPPED.min((MAX_DROPPED_FRACTION * used.len() as f64) as usize);
    let (mut left, mut solution) = (selection.clone(), solution.clone());
    let mut first_error = None;
    for dropped in 0..=most {
        let mut worst = None;
        for starts in [Starts::Usual, Starts::Many] {
            match attempt(&left, &solution, starts)? {
                Attempt::NothingToRefine => return Ok(None),
                Attempt::AcceptedRefinement(refined) => {
                    let without = match dropped < most {
                        true => without_wrong_motion(&refined, pairs, &left, resolve, attempt)?,
                        false => None,
                    };
                    let selection = (dropped > 0).then_some(left);
                    return Ok(Some(without.unwrap_or(AcceptedRefinement { refined, selection })));
                }
                Attempt::Failed(error, refined) => {
                    first_error.get_or_insert(error);
                    let by_residual = refined.as_ref().map(|r| by_residual(&r.joint, pairs, &left.used()));
                    worst = by_residual.and_then(|motions| motions.first().copied()).or(worst);
                    let Some(refined) = refined.filter(|_| dropped < most) else { continue };
                    // Another start does not help where one motion gives all of them attitude errors.
                    if attitude_errors_too_large(&refined.joint) {
                        break;
                    }
                    if let Some(accepted) = without_wrong_motion(&refined, pairs, &left, resolve, attempt)? {
                        return Ok(Some(accepted));
                    }
                }
            }
        }
        left = left.clone().without(worst.unwrap_or_else(|| least_matched(pairs, &left.used())));
        match resolve(&left)? {
            Some(next) => solution = next,
            None => break,
        }
    }
    Err(refused(first_error))
}

/// The refinement without one motion, where what is left of all is more than noise and what is left of the others is noise without that one. A motion that is
/// wrong bends the camera until lens, skew and pictures are bent too, so that its own residuals need not be the largest: those with the largest are tried. What a
/// suspect gains is that of all residuals, its own being those of a homography.
///
/// # Errors
/// [`Error::Unsound`] where the evidence does not single one out: the camera would be another with each.
fn without_wrong_motion(
    refined: &Refined,
    pairs: &[PairObservation],
    selection: &Selection,
    resolve: impl Fn(&Selection) -> Result<Option<CameraSolution>, Error>,
    attempt: impl Fn(&Selection, &CameraSolution, Starts) -> Result<Attempt, Error>,
) -> Result<Option<AcceptedRefinement>, Error> {
    let held = !refined.joint.bundle.attitude_sigma.estimated;
    let may_be_noise = largest_variance(&refined.joint) < VARIANCE_RANGE.end && (!held || is_noise(&refined.joint));
    if may_be_noise || held_lens_is_to_blame(&refined.joint) {
        return Ok(None);
    }
    let mut found: Vec<(f64, AcceptedRefinement)> = Vec::new();
    for suspect in by_residual(&refined.joint, pairs, &selection.used()).into_iter().take(MAX_SUSPECTS) {
        let left = selection.clone().without(suspect);
        let Some(solution) = resolve(&left)? else { continue };
        let Attempt::AcceptedRefinement(other) = attempt(&left, &solution, Starts::Usual)? else { continue };
        let Some((without, with)) = other.joint.bundle.evidence.zip(refined.joint.bundle.evidence) else { continue };
        let gain = without.gain_with_rest_apart(&with);
        if is_noise(&other.joint) && gain > 2.0 * RELEASE_ODDS.ln() {
            found.push((gain, AcceptedRefinement { refined: other, selection: Some(left) }));
        }
    }
    found.sort_by(|a, b| b.0.total_cmp(&a.0));
    // Each is a chi-squared of what homographies of their own would explain beyond one camera, eight numbers each.
    let spread = (2.0 * 2.0 * 8.0 * (selection.used().len() - 1) as f64).sqrt();
    if let [(first, _), (second, _), ..] = found.as_slice()
        && first - second < 2.0 * RELEASE_ODDS.ln() + NORMAL_999 * spread
    {
        return Err(unsound(
            "without one of the motions the others agree, but which of them is wrong the images do not tell".into(),
        ));
    }
    Ok(found.into_iter().next().map(|(_, accepted)| accepted))
}

/// Whether what is left of the tracks may be noise: within what models that are right have; where there are points alone, by the spread of its variance. (Beside
/// patches the points are those of links, whose homographies are less sure.)
fn is_noise(joint: &JointSolution) -> bool {
    let bundle = &joint.bundle;
    let of_kind = |kind: Kind| (bundle.observations_of[kind as usize] as f64, kind as usize);
    let ((patches, _), (points, k)) = (of_kind(Kind::Patch), of_kind(Kind::Point));
    // Each of two pictures has two numbers, of which the point takes two.
    let independent = (points / bundle.design_effects[k].max(1.0)).round();
    largest_variance(joint) < VARIANCE_RANGE.end
        && (patches > 0.0
            || chi_squared_survival(bundle.variance_factors[k] * independent, independent as usize) > ABOVE_NOISE_P)
}

/// Variance of what is left of the tracks, of the kind that has most, in units of the matching noise.
fn largest_variance(joint: &JointSolution) -> f64 {
    joint.bundle.variance_factors.iter().copied().fold(0.0, f64::max)
}

enum Attempt {
    NothingToRefine,
    AcceptedRefinement(Refined),
    /// Why, and what it came to, if to anything.
    Failed(Error, Option<Refined>),
}

/// In the words of an answer that is refused.
fn refused(error: Option<Error>) -> Error {
    match error {
        Some(error) if error.is_degenerate() => error,
        Some(error) => unsound(format!("the joint refinement failed, from other starts too ({})", error.finding())),
        None => unsound("the joint refinement failed".into()),
    }
}

fn unsound(reason: String) -> Error {
    Error::Unsound { reason, remedies: vec![Remedy::NamePairs, Remedy::ClearMotions, Remedy::GiveLensCoefficients] }
}

/// Whether the attitude errors are larger than those of a camera that turns about the floor's normal, whatever it is carried by.
fn attitude_errors_too_large(joint: &JointSolution) -> bool {
    let (chi_squared, directions) = joint.bundle.agreement_at_most;
    joint.bundle.attitude_sigma.estimated && chi_squared_survival(chi_squared, directions) < TOO_LARGE_ERRORS_P
}

/// Whether what is left may be the lens: a camera that turns on the spot shows the error of a lens that the user holds in every pair
/// alike. No motion is to blame then, and the bars are widened by what is left.
fn held_lens_is_to_blame(joint: &JointSolution) -> bool {
    let bundle = &joint.bundle;
    bundle.scene == SceneModel::Directions && bundle.unknowns.first().is_some_and(|camera| !camera.is_free(MATRIX))
}

/// Refuses a refinement that has not converged, whose residuals are no noise, or whose camera is none.
///
/// # Errors
/// [`Error::Unsound`].
pub(super) fn check_soundness(joint: &JointSolution, size: ImageSize) -> Result<(), Error> {
    let bundle = &joint.bundle;
    if !joint.has_converged() {
        return Err(unsound(format!(
            "the joint refinement had not converged after {} steps (fx {:.0} px)",
            bundle.iterations, joint.intrinsics.fx
        )));
    }
    if attitude_errors_too_large(joint) {
        return Err(unsound(format!(
            "no camera explains the motions as turns about the floor's normal: from one to the next its attitude would vary by {:.1} degrees",
            bundle.attitude_sigma.sigma.to_degrees()
        )));
    }
    if held_lens_is_to_blame(joint) {
        return check_field_of_view(&joint.intrinsics, size);
    }
    let variance = largest_variance(joint);
    if variance > MAX_VARIANCE {
        return Err(unsound(format!(
            "no camera explains the motions together: what is left of them is {:.0} times as large as the matching noise",
            variance.sqrt()
        )));
    }
    let effect = bundle.design_effects.iter().copied().fold(0.0, f64::max);
    if bundle.scene == SceneModel::Directions && effect > MAX_DIRECTIONS_DESIGN_EFFECT {
        return Err(Error::Unsound {
            reason: format!(
                "the images look like those of a camera turning on the spot, but neighbouring points move together by more than that allows \
                 (design effect {effect:.1}, at most {MAX_DIRECTIONS_DESIGN_EFFECT} are trusted): the lens was off the axis of turning, before things that are \
                 not all far away"
            ),
            remedies: vec![Remedy::TurnAboutOpticalCentre, Remedy::TurnOverFloor, Remedy::NamePairs],
        });
    }
    check_field_of_view(&joint.intrinsics, size)
}

/// Refuses a focal length that no flat image can have.
///
/// # Errors
/// [`Error::Unsound`].
pub(super) fn check_field_of_view(k: &Intrinsics, size: ImageSize) -> Result<(), Error> {
    let degrees = |f: f64, side: usize| 2.0 * (0.5 * side as f64 / f).atan().to_degrees();
    let widest = degrees(k.fx, size.width).max(degrees(k.fy, size.height));
    if widest < MAX_FIELD_OF_VIEW_DEG {
        return Ok(());
    }
    Err(unsound(format!(
        "with fx = {:.1} and fy = {:.1} px the images would show {widest:.0} degrees, which no lens without a fisheye's projection does",
        k.fx, k.fy
    )))
}

/// The pairs, first the one whose residuals are largest, in the median; where attitude errors are too large, whose two attitudes are furthest apart.
fn by_residual(joint: &JointSolution, pairs: &[PairObservation], used: &[PairId]) -> Vec<PairId> {
    let too_large = attitude_errors_too_large(joint);
    let of_pair = |id: PairId| {
        let Some(views) = joint.views.of_pair(&pairs[id]) else { return 0.0 };
        let [a, b] = views.map(ViewId::index);
        if too_large {
            let [a, b] = [a, b].map(|frame| joint.bundle.state.frames[frame].delta_rad);
            return (a[0] - b[0]).hypot(a[1] - b[1]);
        }
        let seen = |frame: usize, track: usize| joint.tracks[track].observations.iter().position(|o| o.frame == frame);
        let both = |track: usize| {
            let residuals = &joint.bundle.squared_residuals[track];
            Some(residuals[seen(a, track)?] + residuals[seen(b, track)?])
        };
        median(&mut (0..joint.tracks.len()).filter_map(both).collect::<Vec<f64>>())
    };
    let mut scored: Vec<(PairId, f64)> = used.iter().map(|&id| (id, of_pair(id))).collect();
    scored.sort_by(|a, b| b.1.total_cmp(&a.1).then(b.0.cmp(&a.0)));
    scored.into_iter().map(|(id, _)| id).collect()
}

/// The pair of fewest matches.
fn least_matched(pairs: &[PairObservation], used: &[PairId]) -> PairId {
    used.iter().copied().min_by_key(|&id| pairs[id].inliers().count()).unwrap_or(PairId::new(0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_focal_length_of_nothing_is_no_camera() {
        let size = ImageSize { width: 640, height: 480 };
        assert!(check_field_of_view(&Intrinsics::square(100.0, 320.0, 240.0), size).is_ok());
        let error = check_field_of_view(&Intrinsics::square(20.0, 320.0, 240.0), size).expect_err("173 degrees");
        assert!(error.is_degenerate() && error.to_string().contains("173 degrees"), "{error}");
    }
}
