//! Pixels and points of the floor; bird's-eye and undistorted pictures.

pub mod layout;
pub mod odometry;
mod outline;
pub mod placed;
pub mod points;
pub mod projection;
pub mod rectify;
pub mod scale;
pub mod undistort;
pub mod view;
