//! Closed-form cameras that the refinement starts from.

pub mod absolute_conic;
pub mod linear_camera;
pub mod rotating_camera;
