//! `camera_undistorted.json`, the camera of images without their lens's distortion, and the maps from their pixels to the originals'.

use std::{io::Cursor, path::Path};

use groundcal::{
    floor::undistort::Fit,
    geometry::{distortion::Distortion, intrinsics::Intrinsics, size::ImageSize},
};
use serde::Serialize;
use tiff::encoder::{TiffEncoder, colortype::Gray32Float};

use crate::error::IoError;

/// Read back as a calibration.
#[derive(Debug, Serialize)]
struct CameraFile {
    format_version: u32,
    pixel_centre: &'static str,
    camera: CameraJson,
    undistort_fit: &'static str,
    distorted_camera: CameraJson,
}

#[derive(Debug, Serialize)]
struct CameraJson {
    image_size: [usize; 2],
    fx: f64,
    fy: f64,
    cx: f64,
    cy: f64,
    skew: f64,
    distortion: LensJson,
}

#[derive(Debug, Serialize)]
struct LensJson {
    model: &'static str,
    k1: f64,
    k2: f64,
    p1: f64,
    p2: f64,
}

impl CameraJson {
    fn new(size: ImageSize, k: &Intrinsics, d: &Distortion) -> Self {
        CameraJson {
            image_size: [size.width, size.height],
            fx: k.fx,
            fy: k.fy,
            cx: k.cx,
            cy: k.cy,
            skew: k.skew,
            distortion: LensJson {
                model: if d.is_none() { "none" } else { "radtan" },
                k1: d.k1,
                k2: d.k2,
                p1: d.p1,
                p2: d.p2,
            },
        }
    }
}

/// The camera of undistorted images, and beside it the one with the lens.
///
/// # Errors
/// [`IoError::Other`] when it cannot be written as JSON.
pub fn camera_json(
    size: ImageSize,
    undistorted: &Intrinsics,
    fit: Fit,
    original: (&Intrinsics, &Distortion),
) -> Result<String, IoError> {
    let file = CameraFile {
        format_version: 1,
        pixel_centre: "(0,0) is the centre of the top-left pixel",
        camera: CameraJson::new(size, undistorted, &Distortion::default()),
        undistort_fit: match fit {
            Fit::Same => "same",
            Fit::All => "all",
            Fit::Crop => "crop",
        },
        distorted_camera: CameraJson::new(size, original.0, original.1),
    };
    serde_json::to_string_pretty(&file)
        .map(|json| json + "\n")
        .map_err(|e| IoError::Other(format!("cannot write the camera as JSON: {e}")))
}

/// A map as TIFF with one 32-bit floating point channel, as `cv2.imread(..., cv2.IMREAD_UNCHANGED)` gives it back; `path` stands for it
/// in messages.
///
/// # Errors
/// [`IoError::Other`] when it cannot be encoded.
pub fn map_tiff(map: &[f32], size: ImageSize, path: &Path) -> Result<Vec<u8>, IoError> {
    let mut bytes = Cursor::new(Vec::new());
    TiffEncoder::new(&mut bytes)
        .and_then(|mut t| t.write_image::<Gray32Float>(size.width as u32, size.height as u32, map))
        .map_err(|e| IoError::Other(format!("cannot encode {}: {e}", path.display())))?;
    Ok(bytes.into_inner())
}
