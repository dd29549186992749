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

pub use absolute_conic::{Constraint, residual_by_camera};
pub use closed_forms::{LinearCamera, closed_form, unweighted_camera};
pub use linear_camera::{GivenPrior, PriorParameter};
pub use transferred::calibrate_transferred;
