//! Closed-form cameras that the refinement starts from.

pub(crate) mod absolute_conic;
pub(crate) mod closed_forms;
pub(crate) mod from_pairs;
pub(crate) mod general_plane;
pub(crate) mod given_lens;
pub(crate) mod lens_uncertainty;
pub(crate) mod linear_camera;
pub(crate) mod rotating_camera;
pub(crate) mod transferred;
pub(crate) mod unweighted_camera;

pub use absolute_conic::{
    Constraint, Parameters, Residual, WeightedPoint, intrinsics_of, parameters_of, residual, solve_unweighted,
};
pub use closed_forms::{
    LinearCamera, rotating_camera, unweighted_camera, unweighted_camera_with_covariance, weighted_camera,
};
pub use linear_camera::{
    CameraOptions, CameraSolution, GivenPrior, PriorParameter, PriorUse, solve_camera, what_is_uncertain,
};
pub use rotating_camera::{RotatingOptions, RotatingSolution, Rotation, Weighting, calibrate_rotating};
pub use transferred::transferred_camera;
pub use unweighted_camera::solve_unweighted_with_covariance;
