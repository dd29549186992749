//! The numbers behind the pictures of the report: computed here, drawn in [`super::sections`], and written into the page as JSON.
//!
//! Pixels throughout, (0, 0) the centre of the top-left pixel; lengths on the floor in camera heights.

pub mod camera;
pub mod conic;
pub mod floor;
pub mod motions;
pub mod residuals;

use groundcal::{
    remedy::Wording,
    result::{Calibration, PixelCentre, WarningReport},
};
use serde::Serialize;

/// Everything shown.
#[derive(Debug, Serialize)]
pub struct Model {
    /// Version of the program.
    pub version: &'static str,
    pub pixel_centre: PixelCentre,
    /// Names of all images, in order.
    pub images: Vec<String>,
    pub camera: camera::CameraNumbers,
    pub motions: Vec<motions::Motion>,
    pub residuals: Option<residuals::Residuals>,
    pub floor: Vec<floor::FloorMap>,
    pub conic: Option<conic::Conic>,
    pub warnings: Vec<WarningReport>,
}

/// From a calibration, in the words of a front end.
pub fn model(c: &Calibration, wording: &dyn Wording) -> Model {
    Model {
        version: env!("CARGO_PKG_VERSION"),
        pixel_centre: c.pixel_centre,
        images: c.evidence.images.clone(),
        camera: camera::camera(c),
        motions: motions::motions(c, wording),
        residuals: residuals::residuals(c),
        floor: floor::maps(c),
        conic: conic::conic(c),
        warnings: WarningReport::all(&c.warnings, wording),
    }
}
