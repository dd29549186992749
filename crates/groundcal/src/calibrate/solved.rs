//! A camera with all that it was made from, ready to be criticised and reported.

use nalgebra::SMatrix;

use crate::{
    calibrate::{joint::JointSolution, options::Method},
    ids::PairId,
    result::Warning,
    select::selection::Selection,
    start::{absolute_conic::Constraint, linear_camera::CameraSolution},
};

/// The answer to what was asked.
pub(super) struct Solved {
    /// The method that gave it: where the joint refinement failed, the linear one.
    pub(super) method: Method,
    /// The constraint in force.
    pub(super) constraint: Constraint,
    /// Camera and attitudes.
    pub(super) solution: CameraSolution,
    /// The joint refinement, if there was one.
    pub(super) joint: Option<JointSolution>,
    /// The pairs used, ascending; members of the solution's groups count in it.
    pub(super) used: Vec<PairId>,
    /// Pairs that join other views to the motions, where there was no joint refinement to have them.
    pub(super) links: Vec<PairId>,
    /// Where motions were dropped because no camera could be refined with them: the selection without them.
    pub(super) selection: Option<Selection>,
    /// How much of the deviation of f comes from the lens.
    pub(super) lens_share: f64,
    /// Angles of the pairs used where they are rotations about any axes, radians.
    pub(super) rotations_rad: Option<Vec<f64>>,
    /// Factor on all standard deviations because given coefficients act through the focal length, where they do.
    pub(super) amplification: Option<f64>,
    /// Doubts met on the way.
    pub(super) warnings: Vec<Warning>,
}

/// Part of the deviation of f that comes from what the lens adds to the covariance.
pub(super) fn share_of(added: &SMatrix<f64, 5, 5>, covariance: &SMatrix<f64, 5, 5>) -> f64 {
    (added[(0, 0)] / covariance[(0, 0)]).sqrt()
}
