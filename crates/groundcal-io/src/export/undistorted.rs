//! `camera_undistorted.json`, the camera of images without their lens's distortion, and the maps from their pixels to the originals'.

use std::{io::Cursor, path::Path};

use groundcal::{
    floor::Fit,
    geometry::{ImageSize, Intrinsics, Lens},
    result::{Camera, FORMAT_VERSION, LensSource, PixelCentre, SCHEMA_VERSION},
};
use serde::Serialize;
use tiff::encoder::{TiffEncoder, colortype::Gray32Float};

use crate::error::IoError;

/// Read back as a calibration.
#[derive(Debug, Serialize)]
struct CameraFile<'a> {
    schema_version: u32,
    format_version: u32,
    pixel_centre: PixelCentre,
    camera: Camera,
    undistort_fit: &'static str,
    distorted_camera: &'a Camera,
}

/// The camera of undistorted images, and beside it the one with the lens.
///
/// # Errors
/// [`IoError::Other`] when it cannot be written as JSON.
pub fn camera_json(undistorted: &Intrinsics, fit: Fit, original: &Camera) -> Result<String, IoError> {
    let file = CameraFile {
        schema_version: SCHEMA_VERSION,
        format_version: FORMAT_VERSION,
        pixel_centre: PixelCentre::TopLeftPixel,
        camera: Camera::new(original.model().size, undistorted, Lens::None, LensSource::Given),
        undistort_fit: match fit {
            Fit::Same => "same",
            Fit::All => "all",
            Fit::Crop => "crop",
            Fit::FieldOfView { .. } => "field_of_view",
        },
        distorted_camera: original,
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
