//! Cameras, attitudes, planes: models and conventions, without estimation.

pub(crate) mod attitude;
pub(crate) mod camera;
pub(crate) mod camera_difference;
pub(crate) mod constraint;
pub(crate) mod frame;
pub(crate) mod homography;
pub(crate) mod intrinsics;
pub(crate) mod lens;
pub(crate) mod parameters;
pub(crate) mod plane_view;
pub(crate) mod size;

pub use attitude::{angles_from_rotation, rotation_cam_from_world};
pub use camera::Camera;
pub use camera_difference::{CameraDifference, camera_difference};
pub use constraint::Constraint;
pub use frame::Frame;
pub use homography::Homography;
pub use intrinsics::Intrinsics;
pub use lens::{Division, Fisheye, Lens, Radtan};
pub use parameters::{Parameter, PriorParameter};
pub use plane_view::View;
pub use size::ImageSize;
