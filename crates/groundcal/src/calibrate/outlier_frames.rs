//! Frames whose attitude error is an outlier among those of the others.
//!
//! ```text
//! δ_i ~ N(0, σ_a²) of all frames but few,   δ_j ~ N(0, 0.05²) of frame j
//! ```
//!
//! With one deviation for all, a single wrong motion (a tripod leg that slipped, a pair of another attitude) makes σ_a large for all and
//! hides in it. So the frame with the greatest attitude error is tried as one that does not count: σ_a is that of the others, and the evidence
//! ([`crate::refine::Bundle`]) says whether that is the better account, the wide prior of the one having its price.
//!
//! Of a few motions of attitudes of their own a wrong one bends the camera until nothing is left to see but that the height changed in it and in no other. Each of
//! them is an account of its own, then: with the wrong one's attitude free, heights agree, which has its weight in the evidence.

use crate::{
    calibrate::refinement_input::{Refined, RefinementInput, RefinementOptions},
    error::Error,
    refine::{bundle::FIRST_CAMERA, prospect::Prospect},
};

/// Most outlier frames, as a fraction of all: with more there is no telling which are the outliers.
const MAX_OUTLIER_FRACTION: f64 = 0.25;

/// The refinement in which the frame with the greatest attitude error is one that does not count; with it twice the logarithm of the odds.
///
/// # Errors
/// [`Error::Stopped`] and no other.
pub(super) fn with_outlier_frame(
    input: &RefinementInput<'_>,
    refined: &Refined,
    needed: f64,
) -> Result<Option<(f64, Refined)>, Error> {
    let bundle = &refined.joint.bundle;
    let mut options = refined.options.clone();
    let outliers = &mut options.bundle.outlier_frames;
    let all = bundle.state.frames.len();
    let suspect = refined.has_attitude_errors() && options.bundle.attitude_sigma_rad.is_none();
    if !suspect || (outliers.len() + 1) as f64 > MAX_OUTLIER_FRACTION * all as f64 {
        return Ok(None);
    }
    let squared = |frame: usize| bundle.state.frames[frame].delta_rad.iter().map(|d| d * d).sum::<f64>();
    let candidates = (0..all).filter(|frame| !outliers.contains(frame));
    let Some(frame) = candidates.max_by(|a, b| squared(*a).total_cmp(&squared(*b))) else { return Ok(None) };
    outliers.push(frame);
    input.better_with(refined, options, needed)
}

/// Motions up to which each is thought of as the wrong one: with more the others show it.
const MAX_MOTIONS: usize = 12;
/// Fewest, so that without one something is left to tell the camera.
const MIN_MOTIONS: usize = 3;

/// A refinement that is better, with twice the logarithm of the odds.
type Better = Option<(f64, Refined)>;

/// The best refinement in which one of the motions of attitudes of their own was none about the floor's normal, where its evidence is better by more than
/// `needed`, and what the others promise that are better by more than `counts`: to first order an attitude that is held all but fixed says whether it would rather
/// move, but not how far.
///
/// # Errors
/// [`Error::Stopped`] and no other.
pub(super) fn with_wrong_motion(
    input: &RefinementInput<'_>,
    refined: &Refined,
    [counts, needed]: [f64; 2],
) -> Result<(Better, Vec<Prospect>), Error> {
    let (mut best, mut open): (Better, Vec<Prospect>) = (None, Vec::new());
    for mut options in wrong_motions(refined) {
        input.observer.go_on()?;
        let Some(prospect) = refined.prospect(&options).filter(|prospect| prospect.gain > counts) else {
            continue;
        };
        options.bundle = options.bundle.for_trial();
        let starts = vec![refined.joint.bundle.state.clone()];
        let tried = input.tried(refined, refined.solution.clone(), options, starts)?;
        let found = tried.and_then(|other| Some((other.gain_over(refined, f64::NEG_INFINITY)?, other)));
        let Some((gain, other)) = found else {
            open.push(prospect);
            continue;
        };
        if gain <= needed {
            let [here, there] = [refined, &other].map(|r| &r.joint.bundle.cameras[FIRST_CAMERA]);
            let step = there.state.numbers() - here.state.numbers();
            open.push(Prospect { gain, step, covariance: there.covariance.clone() });
        } else if best.as_ref().is_none_or(|(most, _)| gain > *most) {
            best = Some((gain, other));
        }
    }
    Ok((best, open))
}

/// What is estimated if one of the motions of attitudes of their own was none about the floor's normal: of each, the second frame's attitude does not count.
fn wrong_motions(refined: &Refined) -> Vec<RefinementOptions> {
    let state = &refined.joint.bundle.state;
    if refined.options.bundle.attitude_sigma_rad.is_some() || !refined.options.bundle.outlier_frames.is_empty() {
        return Vec::new();
    }
    let frames_of = |group: usize| -> Vec<usize> {
        (0..state.frames.len()).filter(|&frame| state.frames[frame].group == group).collect()
    };
    let motions: Vec<Vec<usize>> = (0..state.groups.len()).map(frames_of).filter(|frames| frames.len() > 1).collect();
    if !(MIN_MOTIONS..=MAX_MOTIONS).contains(&motions.len()) {
        return Vec::new();
    }
    let of_motion = |frames: &Vec<usize>| {
        let mut options = refined.options.clone();
        options.bundle.outlier_frames.push(*frames.get(1).filter(|_| frames.len() == 2)?);
        Some(options)
    };
    motions.iter().filter_map(of_motion).collect()
}
