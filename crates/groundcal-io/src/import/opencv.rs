//! OpenCV's FileStorage, YAML or XML, under the names its calibration programs use. Pixels are counted as here.

use groundcal::geometry::intrinsics::Intrinsics;

use crate::import::{ImportedCamera, brown_conrady, node::Node};

const MATRIX: [&str; 5] = ["camera_matrix", "K", "M1", "M", "intrinsic_matrix"];
const LENS: [&str; 5] = ["distortion_coefficients", "dist_coeffs", "D", "D1", "distortion"];

/// Whether there is a camera matrix.
pub fn looks_like_it(root: &Node) -> bool {
    root.get(&MATRIX).is_some()
}

/// The camera.
pub fn camera(root: &Node) -> Result<ImportedCamera, String> {
    if root.get(&["fisheye_model"]).and_then(Node::number).is_some_and(|v| v != 0.0) {
        return Err(
            "OpenCV's fisheye model, which is not read: only pinhole cameras with k1, k2, p1, p2, k3 are".into()
        );
    }
    from_matrices("OpenCV", root)
}

/// Camera matrix, lens and size of a file that names them as OpenCV or ROS do.
pub fn from_matrices(format: &'static str, root: &Node) -> Result<ImportedCamera, String> {
    let matrix = root
        .get(&MATRIX)
        .ok_or_else(|| format!("no camera_matrix; the file has the keys {}", root.keys().join(", ")))?
        .numbers()
        .map_err(|e| format!("camera_matrix: {e}"))?;
    let [fx, skew, cx, k10, fy, cy, k20, k21, k22] = matrix[..] else {
        return Err(format!("camera_matrix: expected 3 x 3 numbers, found {}", matrix.len()));
    };
    if [k10, k20, k21, k22] != [0.0, 0.0, 0.0, 1.0] {
        return Err(format!(
            "camera_matrix: expected [fx, skew, cx; 0, fy, cy; 0, 0, 1], found [.., .., ..; {k10}, .., ..; {k20}, {k21}, {k22}]"
        ));
    }
    if let Some(model) = root.get(&["distortion_model"]).and_then(Node::text)
        && !matches!(model, "plumb_bob" | "radtan" | "none" | "" | "rational_polynomial")
    {
        return Err(format!("distortion_model is {model}: plumb_bob (k1, k2, p1, p2, k3) is read, {model} is not"));
    }
    let lens = match root.get(&LENS) {
        Some(node) => brown_conrady(&node.numbers().map_err(|e| format!("distortion_coefficients: {e}"))?)?,
        None => Default::default(),
    };
    let side = |names: &[&str]| root.get(names).and_then(Node::number);
    let size = match (side(&["image_width", "width"]), side(&["image_height", "height"])) {
        (Some(w), Some(h)) => Some([w, h]),
        _ => None,
    };
    ImportedCamera::new(format, size, Intrinsics { fx, fy, cx, cy, skew }, lens)
}
