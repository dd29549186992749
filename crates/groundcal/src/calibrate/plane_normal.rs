//! The camera of plane-normal motions: closed form, then the joint refinement.

use crate::{
    calibrate::{
        checks::unmodelled_distortion,
        options::{HELD_ATTITUDE_SIGMA_DEG, LensModel, Method},
        refinement::{RefinementOptions, refine_motions},
        solved::{Solved, share_of},
        stage_options::StageOptions,
    },
    error::Error,
    observer::Observer,
    pairs::{known_lens::KnownLens, observation::PairObservation, plane_lens::Lens},
    result::Warning,
    select::selection::Selection,
    start::{
        from_pairs::camera_of_motions_through,
        lens_uncertainty::covariance_of_lens,
        linear_camera::{CameraOptions, check_certainty, solve_camera_until},
    },
};

/// The camera of the motions selected.
///
/// # Errors
/// See [`solve_camera_until`] and [`refine_motions`]; [`Error::Stopped`].
pub(super) fn solve_plane_normal(
    pairs: &[PairObservation],
    selection: &Selection,
    lens: &KnownLens,
    stages: &StageOptions<'_>,
    observer: &dyn Observer,
) -> Result<Solved, Error> {
    let (options, frame, used) = (stages.options, &stages.frame, selection.used());
    let mut camera = camera_options(pairs, selection, stages);
    let mut solution = solve_camera_until(&selection.motions(pairs), frame, &camera, observer)?;
    let refinement = RefinementOptions {
        frame: *frame,
        k2_is_held: options.lens == LensModel::K1,
        bundle: options.refinement(stages.size, &camera, lens.is_estimated()),
    };
    // The same weights for every question asked of this solution.
    (camera.attitude_sigma_rad, camera.estimate_attitude_sigma) = (solution.attitude_sigma_rad, false);
    let mut warnings = Vec::new();
    let mut joint = None;
    if options.method == Method::Joint {
        match refine_motions(pairs, selection, &solution, lens, &refinement, observer) {
            Ok(refined) => joint = refined,
            Err(error) if error.is_degenerate() || error == Error::Stopped => return Err(error),
            Err(error) => warnings.push(Warning::NotRefined { reason: error.finding() }),
        }
    }
    let through = |lens: &Lens| Ok(camera_of_motions_through(lens, pairs, &used, frame, &camera, observer)?.intrinsics);
    let mut lens_share = 0.0;
    if let Some(joint) = &joint {
        check_certainty(&joint.camera_covariance(), options.constraint, solution.groups.len(), frame)?;
        solution = joint.solution(solution, &refinement.bundle);
        lens_share = joint.share_of_lens().sqrt();
    } else if let KnownLens::Estimated(finding) = lens {
        let added = covariance_of_lens(finding, options.constraint, through)?;
        solution.covariance_px += added;
        lens_share = share_of(&added, &solution.covariance_px);
    }
    warnings.extend(unmodelled_distortion(pairs, lens, &solution.intrinsics, through)?);
    let method = if joint.is_some() { Method::Joint } else { Method::Linear };
    let constraint = options.constraint;
    let (rotations_rad, amplification) = (None, None);
    Ok(Solved { method, constraint, solution, joint, used, lens_share, rotations_rad, amplification, warnings })
}

/// A single motion before a background that stands still is a thing moved before a fixed camera, by an arm or by hand: its axis
/// may stray further.
fn camera_options(pairs: &[PairObservation], selection: &Selection, stages: &StageOptions<'_>) -> CameraOptions {
    let mut camera = stages.camera.clone();
    if let [only] = selection.used().as_slice()
        && stages.options.attitude_sigma_deg.is_none()
        && pairs[*only].background() > 0
    {
        camera.attitude_sigma_rad = HELD_ATTITUDE_SIGMA_DEG.to_radians();
    }
    camera
}
