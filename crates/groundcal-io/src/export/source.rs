//! What is written: a camera, and what a calibration knows beside it.

use groundcal::{
    geometry::Camera,
    result::{Calibration, Parameter},
};

use crate::export::world::World;

/// A camera to write, with the views of its calibration where it comes from one.
pub(crate) struct Source<'a> {
    /// The camera.
    pub(crate) camera: Camera,
    /// Where its errors are.
    calibration: Option<&'a Calibration>,
    /// Poses of the largest world; none without a calibration.
    pub(crate) world: World<'a>,
}

impl<'a> Source<'a> {
    /// Of a calibration.
    pub(crate) fn of_calibration(calibration: &'a Calibration) -> Self {
        Self { camera: calibration.camera.model(), calibration: Some(calibration), world: World::largest(calibration) }
    }

    /// A camera that nothing else is known of.
    pub(crate) fn of_camera(camera: &Camera) -> Self {
        Self { camera: *camera, calibration: None, world: World::empty() }
    }

    /// Standard deviation of a number; nothing: held, given or not known.
    pub(crate) fn standard_deviation(&self, p: Parameter) -> Option<f64> {
        self.calibration.and_then(|c| c.standard_deviation(p))
    }

    /// A parameter of the lens, 0 where its model has none of the name.
    pub(crate) fn lens_parameter(&self, name: &str) -> f64 {
        self.camera.lens.parameter(name).unwrap_or(0.0)
    }

    /// Parameters of the lens by name, 0 where its model has none.
    pub(crate) fn lens_parameters<const N: usize>(&self, names: [&str; N]) -> [f64; N] {
        names.map(|name| self.lens_parameter(name))
    }
}
