//! transforms.json with the camera at its top (nerfstudio). Pixels are counted from the corner of the image: cx and cy less ½ are ours.

use groundcal::geometry::{distortion::Distortion, intrinsics::Intrinsics};
use serde_json::Value;

use crate::import::ImportedCamera;

/// The camera.
pub fn camera(root: &Value) -> Result<ImportedCamera, String> {
    match root.get("camera_model").map(|m| m.as_str().unwrap_or_default()) {
        None | Some("OPENCV" | "PINHOLE" | "SIMPLE_PINHOLE" | "SIMPLE_RADIAL" | "RADIAL") => {}
        Some(other) => return Err(format!("camera_model is {other}: OPENCV and PINHOLE are read, {other} is not")),
    }
    let required = |name: &str| {
        root.get(name).and_then(Value::as_f64).ok_or_else(|| {
            format!("{name} is not a number at the top of the file (cameras of single frames are not read)")
        })
    };
    let coefficient = |name: &str| root.get(name).and_then(Value::as_f64).unwrap_or(0.0);
    if let Some(name) = ["k4", "k5", "k6"].into_iter().find(|n| coefficient(n) != 0.0) {
        return Err(format!("{name} is {}: only k1, k2, p1, p2, k3 are read", coefficient(name)));
    }
    let (fx, fy) = (required("fl_x")?, required("fl_y")?);
    let (cx, cy) = (required("cx")? - 0.5, required("cy")? - 0.5);
    let [k1, k2, p1, p2] = ["k1", "k2", "p1", "p2"].map(coefficient);
    let size = [required("w")?, required("h")?];
    let lens = (Distortion { k1, k2, p1, p2 }, coefficient("k3"));
    ImportedCamera::new("transforms.json", Some(size), Intrinsics { fx, fy, cx, cy, skew: 0.0 }, lens)
}
