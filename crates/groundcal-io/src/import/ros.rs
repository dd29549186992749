//! ROS camera_info: the calibration file (camera_name, camera_matrix, ...) or the message as printed (K, D, P). Pixels are counted
//! as here.

use crate::import::{imported::ImportedCamera, node::Node, opencv};

/// Whether there are a camera matrix and what only ROS writes beside it.
pub(crate) fn looks_like_it(root: &Node) -> bool {
    opencv::looks_like_it(root) && root.get(&["projection_matrix", "camera_name", "P"]).is_some()
}

/// The camera. Rectification and projection matrices say nothing of the raw image and are left aside.
pub(crate) fn cameras(root: &Node) -> Result<Vec<ImportedCamera>, String> {
    opencv::named("ROS camera_info", root)
}
