//! Pixels and points of the floor; bird's-eye and undistorted pictures.

pub mod layout;
mod outline;
pub mod placed;
pub mod rectify;
pub mod undistort;
pub mod view;
