//! The camera of the rotating-camera method ([`crate::start::rotating_camera`]): a pan-tilt camera on the spot, before a scene of
//! any shape.
//!
//! ```text
//! Hᵀ ω H = ω for every pair
//! ```
//!
//! Nothing is refined jointly. [`super::turning`] does that for cameras that it recognises, and is the better estimate.

use std::collections::HashMap;

use crate::{
    calibrate::{
        checks::unmodelled_distortion,
        options::Method,
        solved::{Solved, share_of},
        stage_options::StageOptions,
    },
    error::Error,
    ids::{ImageId, PairId},
    observer::Observer,
    pairs::{known_lens::KnownLens, observation::PairObservation, placed_lens::PlacedLens},
    result::Warning,
    select::selection::Selection,
    start::{
        from_pairs::{camera_of_rotations, camera_of_rotations_through},
        lens_uncertainty::covariance_of_lens,
        linear_camera::CameraSolution,
    },
};

/// The camera of the rotations selected.
///
/// # Errors
/// See [`crate::start::rotating_camera::calibrate_rotating`]; [`Error::Stopped`].
pub(super) fn solve_rotating(
    pairs: &[PairObservation],
    selection: &Selection,
    lens: &KnownLens,
    stages: &StageOptions<'_>,
    observer: &dyn Observer,
) -> Result<Solved, Error> {
    let used = selection.used();
    let found = camera_of_rotations(pairs, &used, &stages.rotating)?;
    let through = |lens: &PlacedLens| {
        Ok(camera_of_rotations_through(lens, pairs, &used, &stages.frame, &stages.rotating, observer)?.intrinsics)
    };
    let added = covariance_of_lens(lens, through)?.unwrap_or_default();
    let mut warnings: Vec<Warning> =
        unmodelled_distortion(pairs, lens, &found.intrinsics, through)?.into_iter().collect();
    if found.variance_inflation > 1.0 {
        warnings.push(Warning::NotRotations {
            chi_squared: found.chi_squared,
            degrees_of_freedom: found.degrees_of_freedom,
            widened: found.variance_inflation.sqrt(),
        });
    }
    let covariance_px = found.covariance_px * shared_noise(pairs, &used) + added;
    let solution = CameraSolution {
        intrinsics: found.intrinsics,
        covariance_px,
        estimated: found.estimated,
        priors: Vec::new(),
        groups: Vec::new(),
        chi_squared: found.chi_squared,
        degrees_of_freedom: found.degrees_of_freedom,
        attitude_sigma_rad: 0.0,
        attitude_sigma_estimated: false,
        variance_inflation: found.variance_inflation,
    };
    Ok(Solved {
        method: Method::Rotating,
        constraint: stages.rotating.constraint,
        solution,
        joint: None,
        used,
        links: Vec::new(),
        selection: None,
        lens_share: share_of(&added, &covariance_px),
        rotations_rad: Some(found.rotations.iter().map(|rotation| rotation.angle_rad).collect()),
        amplification: None,
        warnings,
    })
}

/// Factor on the covariance of pairs taken for independent although points of an image are in several of them.
///
/// All differences of n values with independent noise carry (n/2) times the information of the values when they count as
/// independent (their Laplacian is n I - J, each difference having twice the variance): for a point seen in m pairs, (m + 1) / 2.
fn shared_noise(pairs: &[PairObservation], used: &[PairId]) -> f64 {
    let mut seen: HashMap<(ImageId, u64, u64), usize> = HashMap::new();
    for &id in used {
        let pair = &pairs[id];
        for m in pair.inliers() {
            for (image, p) in [(pair.from, m.a), (pair.to, m.b)] {
                *seen.entry((image, p.x.to_bits(), p.y.to_bits())).or_default() += 1;
            }
        }
    }
    // Mean over observations, so that a point in m pairs counts m times.
    let (all, weighted) = seen.values().fold((0usize, 0usize), |(a, w), m| (a + m, w + m * m));
    if all == 0 { 1.0 } else { 0.5 * (weighted as f64 / all as f64 + 1.0) }
}
