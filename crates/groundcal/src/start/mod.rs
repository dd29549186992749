//! Closed-form cameras that the refinement starts from.

pub mod absolute_conic;
pub(crate) mod from_pairs;
pub(crate) mod general_plane;
pub(crate) mod given_lens;
pub(crate) mod lens_uncertainty;
pub mod linear_camera;
pub mod rotating_camera;
pub mod unweighted_camera;
