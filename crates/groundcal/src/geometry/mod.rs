//! Cameras, attitudes, planes: models and conventions, without estimation.

pub mod attitude;
pub mod camera;
pub mod camera_difference;
pub mod constraint;
pub mod frame;
pub mod homography;
pub mod intrinsics;
pub mod lens;
pub mod parameters;
pub mod plane_view;
pub mod size;
