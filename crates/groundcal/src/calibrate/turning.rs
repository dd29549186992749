//! The camera of a joint refinement of directions: it turned on the spot, about any axes, before a scene of any shape. Plane-normal
//! motions do not come into it: every view has an attitude of its own.

use nalgebra::SMatrix;

use crate::{
    calibrate::{
        joint::JointSolution, options::Method, refinement::refine_turning, refinement_input::RefinementOptions,
        solved::Solved, soundness::check_soundness, stage_options::StageOptions,
    },
    error::Error,
    geometry::intrinsics::Intrinsics,
    observer::Observer,
    pairs::{known_lens::KnownLens, observation::PairObservation},
    refine::Kind,
    select::selection::Selection,
    start::linear_camera::{CameraSolution, check_certainty},
};

/// Largest variance of the residuals under rotations over that under a homography for each pair.
const MAX_VARIANCE: f64 = 2.5;

/// Numbers of the lens with which rotations are to explain the matches: k1 and k2. Decentring and k3 would take up what a camera that
/// moved leaves (seen in 7 of 18 synthetic heads that turn off their axis over a floor).
const LENS_NUMBERS_TO_EXPLAIN_WITH: usize = 2;

/// Whether rotations explain the matches of the pairs selected as well as a homography each does.
///
/// # Errors
/// [`Error::Stopped`] and no other.
pub(super) fn rotations_explain(
    pairs: &[PairObservation],
    selection: &Selection,
    focal_px: f64,
    lens: &KnownLens,
    stages: &StageOptions<'_>,
    observer: &dyn Observer,
) -> Result<bool, Error> {
    let mut refinement = refinement_options(lens, stages);
    refinement.bundle.cameras.iter_mut().for_each(|camera| camera.hold_lens_from(LENS_NUMBERS_TO_EXPLAIN_WITH));
    match refined(pairs, selection, focal_px, lens, &refinement, stages, observer) {
        Ok(joint) => Ok(joint.bundle.variance_factors[Kind::Point as usize] < MAX_VARIANCE),
        Err(Error::Stopped) => Err(Error::Stopped),
        Err(_) => Ok(false),
    }
}

/// The camera of the rotations selected.
///
/// # Errors
/// See [`refine_turning`] and [`check_soundness`].
pub(super) fn solve_turning(
    pairs: &[PairObservation],
    selection: &Selection,
    focal_px: f64,
    lens: &KnownLens,
    stages: &StageOptions<'_>,
    observer: &dyn Observer,
) -> Result<Solved, Error> {
    let refinement = refinement_options(lens, stages);
    let joint = refined(pairs, selection, focal_px, lens, &refinement, stages, observer)?;
    check_soundness(&joint, stages.size)?;
    let (frame, constraint) = (&stages.frame, stages.options.constraint);
    // No closed form: rotations need no plane-normal motions, which it is made of.
    let start = CameraSolution {
        intrinsics: joint.intrinsics,
        covariance_px: SMatrix::zeros(),
        estimated: constraint.estimated(),
        priors: stages.camera.prior_uses(frame, &SMatrix::zeros()),
        groups: Vec::new(),
        chi_squared: 0.0,
        degrees_of_freedom: 0,
        attitude_sigma_rad: 0.0,
        attitude_sigma_estimated: false,
        variance_inflation: 1.0,
    };
    let solution = joint.solution(start, &refinement.bundle);
    check_certainty(&joint.camera_covariance(), constraint, joint.bundle.groups.len(), frame)?;
    Ok(Solved {
        method: Method::Joint,
        constraint,
        solution,
        lens_share: joint.share_of_lens().sqrt(),
        joint: Some(joint),
        used: selection.used(),
        links: Vec::new(),
        selection: None,
        rotations_rad: None,
        amplification: None,
        warnings: Vec::new(),
    })
}

fn refinement_options(lens: &KnownLens, stages: &StageOptions<'_>) -> RefinementOptions {
    let options = stages.options;
    RefinementOptions {
        frame: stages.frame,
        k2_is_held: options.lens.holds_k2(),
        radtan_only: options.lens.is_radtan_only(),
        bundle: options.refinement(stages.size, &stages.camera, lens.is_estimated()),
        camera: stages.camera.clone(),
    }
}

fn refined(
    pairs: &[PairObservation],
    selection: &Selection,
    focal_px: f64,
    lens: &KnownLens,
    refinement: &RefinementOptions,
    stages: &StageOptions<'_>,
    observer: &dyn Observer,
) -> Result<JointSolution, Error> {
    let [cx, cy] = stages.rotations.principal_point_px;
    let k = Intrinsics { fy: focal_px * stages.rotations.aspect, ..Intrinsics::square(focal_px, cx, cy) };
    refine_turning(pairs, selection, &k, lens, refinement, observer)
}
