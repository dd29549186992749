//! The camera of plane-normal motions: closed form, then the joint refinement.

use crate::{
    calibrate::{
        checks::unmodelled_distortion,
        departures::departures_found,
        doubts::{allow_for_untested_priors, widen_by_doubts, widen_departing},
        options::{HELD_ATTITUDE_SIGMA_DEG, Method},
        prior_conflicts::WIDE_LN_ASPECT,
        refinement_input::RefinementOptions,
        solved::{Solved, share_of},
        soundness::{check_field_of_view, refine_until_sound},
        stage_options::StageOptions,
    },
    error::Error,
    geometry::constraint::Constraint,
    ids::PairId,
    observer::Observer,
    pairs::{
        known_lens::KnownLens, lens_placement::MIN_NOISE_PX, observation::PairObservation, placed_lens::PlacedLens,
    },
    result::Warning,
    select::{attitude_groups::Motion, selection::Selection},
    start::{
        from_pairs::camera_of_motions_through,
        lens_uncertainty::covariance_of_lens,
        linear_camera::{CameraOptions, CameraSolution, check_certainty, solve_camera_until},
    },
};

/// The camera of the motions selected.
///
/// # Errors
/// See [`solve_camera_until`] and [`refine_until_sound`]; [`Error::Stopped`].
pub(super) fn solve_plane_normal(
    pairs: &[PairObservation],
    selection: &Selection,
    lens: &KnownLens,
    stages: &StageOptions<'_>,
    observer: &dyn Observer,
) -> Result<Solved, Error> {
    let (options, frame) = (stages.options, &stages.frame);
    let camera = camera_options(pairs, selection, stages);
    let mut solution = first_camera(&selection.motions(pairs), &camera, stages, observer)?;
    let mut refinement = RefinementOptions {
        frame: *frame,
        k2_is_held: options.lens.holds_k2(),
        radtan_only: options.lens.is_radtan_only(),
        bundle: options.refinement(stages.size, &camera, lens.is_estimated()),
        camera: camera.clone(),
    };
    let mut warnings = Vec::new();
    let (mut joint, mut left, mut has_repairs, mut departs) = (None, None, false, false);
    if options.method == Method::Joint {
        let told = (&refinement, stages.size);
        match refine_until_sound(pairs, selection, &solution, lens, told, observer) {
            Ok(None) => {}
            Ok(Some(sound)) => {
                let refined = sound.refined;
                has_repairs = refined.is_repaired() || sound.selection.is_some();
                departs = refined.has_departures();
                warnings.extend(departures_found(&refined));
                warnings.extend(refined.fisheye.map(|twice_log_odds| Warning::FisheyeLens { twice_log_odds }));
                warnings.extend(refined.conflicts.into_iter().map(Warning::PriorContradicted));
                (solution, refinement) = (refined.solution, refined.options);
                joint = Some(refined.joint);
                left = sound.selection;
            }
            Err(error @ Error::Unsound { .. }) if are_exact(&selection.used(), pairs) => {
                warnings.push(Warning::NotRefined { reason: error.finding() });
            }
            Err(error) => return Err(error),
        }
    }
    let used = left.as_ref().unwrap_or(selection).used();
    // The same weights for every question asked of this solution.
    let mut camera = refinement.camera.clone();
    (camera.attitude_sigma_rad, camera.estimate_attitude_sigma) = (solution.attitude_sigma_rad, false);
    let through =
        |lens: &PlacedLens| Ok(camera_of_motions_through(lens, pairs, &used, frame, &camera, observer)?.intrinsics);
    let mut lens_share = 0.0;
    if let Some(joint) = &mut joint {
        widen_by_doubts(joint, (has_repairs, solution.groups.len()), pairs, &used, options);
        check_certainty(&joint.camera_covariance(), options.constraint, solution.groups.len(), frame)?;
        allow_for_untested_priors(joint, solution.groups.len(), options);
        if departs {
            widen_departing(joint, solution.groups.len());
        }
        solution = joint.solution(solution, &refinement.bundle);
        lens_share = joint.share_of_lens().sqrt();
    } else if let Some(added) = covariance_of_lens(lens, through)? {
        solution.covariance_px += added;
        lens_share = share_of(&added, &solution.covariance_px);
    }
    check_field_of_view(&solution.intrinsics, stages.size)?;
    warnings.extend(unmodelled_distortion(pairs, lens, &solution.intrinsics, through)?);
    let method = if joint.is_some() { Method::Joint } else { Method::Linear };
    let constraint = options.constraint;
    let (rotations_rad, amplification) = (None, None);
    Ok(Solved {
        method,
        constraint,
        solution,
        joint,
        used,
        links: Vec::new(),
        selection: left,
        lens_share,
        rotations_rad,
        amplification,
        warnings,
    })
}

/// Whether the matches have no noise at all, as computed ones do: beside their information that of the priors is lost in rounding, and
/// the closed form has all there is.
fn are_exact(used: &[PairId], pairs: &[PairObservation]) -> bool {
    used.iter().all(|&id| pairs[id].plane().is_some_and(|plane| plane.estimate.sigma_px < MIN_NOISE_PX))
}

/// The camera to start from. Where square pixels leave none that is certain, the refinement, which tries the prior of the aspect ratio
/// against the matches, starts from one without.
///
/// # Errors
/// See [`solve_camera_until`].
fn first_camera(
    motions: &[Motion],
    camera: &CameraOptions,
    stages: &StageOptions<'_>,
    observer: &dyn Observer,
) -> Result<CameraSolution, Error> {
    let error = match solve_camera_until(motions, &stages.frame, camera, observer) {
        Err(error) if error.is_degenerate() => error,
        answer => return answer,
    };
    if stages.options.method != Method::Joint || camera.constraint != Constraint::Auto {
        return Err(error);
    }
    let any_aspect = CameraOptions { aspect_sigma: WIDE_LN_ASPECT, ..camera.clone() };
    solve_camera_until(motions, &stages.frame, &any_aspect, observer)
        .map_err(|other| if other == Error::Stopped { other } else { error })
}

/// A single motion before a background that stands still is a thing moved before a fixed camera, by an arm or by hand: its axis
/// may vary further.
fn camera_options(pairs: &[PairObservation], selection: &Selection, stages: &StageOptions<'_>) -> CameraOptions {
    let mut camera = stages.camera.clone();
    if let [only] = selection.used().as_slice()
        && stages.options.attitude_sigma_deg.is_none()
        && (pairs[*only].background() > 0 || stages.background_set_aside)
    {
        camera.attitude_sigma_rad = HELD_ATTITUDE_SIGMA_DEG.to_radians();
    }
    camera
}
