//! Calibrate a camera from the floor it looks at, with no calibration target.
pub mod distortion;
pub mod image;
pub mod intrinsics;
pub mod synthetic;
