//! The numbers behind the pictures of the report: computed here, drawn in [`super::sections`], and written into the page as JSON.
//!
//! Pixels throughout, (0, 0) the centre of the top-left pixel; lengths on the floor in camera heights.

pub(crate) mod camera;
pub(crate) mod conic;
pub(crate) mod floor;
pub(crate) mod motions;
pub(crate) mod residuals;

use groundcal::{
    Wording,
    result::{Calibration, PixelCentre, WarningReport},
};
use serde::Serialize;

/// Everything shown.
#[derive(Debug, Serialize)]
pub(crate) struct Model {
    /// Version of the program.
    pub(crate) version: &'static str,
    pub(crate) pixel_centre: PixelCentre,
    /// Names of all images, in order.
    pub(crate) images: Vec<String>,
    pub(crate) camera: camera::CameraNumbers,
    pub(crate) motions: Vec<motions::Motion>,
    pub(crate) residuals: Option<residuals::Residuals>,
    pub(crate) floor: Vec<floor::FloorMap>,
    pub(crate) conic: Option<conic::Conic>,
    pub(crate) warnings: Vec<WarningReport>,
}

/// From a calibration, in the words of a front end.
pub(crate) fn model(c: &Calibration, wording: &dyn Wording) -> Model {
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
