//! What `--after` takes from a calibration, unless the arguments say it.

use std::path::Path;

use groundcal::{
    calibrate::Options,
    error::Error,
    plan::{PlanOptions, Planner, Start, after, carriers::CarrierMotion},
    result::Calibration,
};
use groundcal_io::import::groundcal_json;

use crate::{
    commands::plan::args::{DEFAULT_NOISE_PX, DEFAULT_POINTS, PlanArgs},
    error::CliError,
};

/// A calibration to improve.
pub(crate) struct Known {
    calibration: Calibration,
    /// Its covariance.
    pub(crate) covariance: Start,
    name: String,
}

/// Reads calibration.json, or that in a folder.
pub(crate) fn read(path: &Path) -> Result<Known, CliError> {
    let calibration = groundcal_json::read(path)?;
    let name = path.display().to_string();
    let covariance = after::start(&calibration).map_err(|e| of_file(&name, e))?;
    Ok(Known { calibration, covariance, name })
}

/// What the library says of the file's numbers is said of the file.
fn of_file(name: &str, error: Error) -> CliError {
    match error {
        Error::InvalidInput(text) => CliError::Input(format!("{name}: {text}")),
        error => error.into(),
    }
}

impl Known {
    /// Height of the camera over the floor in metres, where the calibration knows it.
    pub(crate) fn height_m(&self) -> Option<f64> {
        self.calibration.camera_height_m
    }

    /// Camera, priors, noise and matches as this calibration has them, unless they are given.
    pub(crate) fn options(&self, args: &PlanArgs, motion: &CarrierMotion) -> Result<PlanOptions, CliError> {
        let camera = &self.calibration.camera;
        let assumed = after::options(&self.calibration);
        let mut options = PlanOptions {
            intrinsics: camera.intrinsics(),
            lens: camera.lens(),
            size: camera.size(),
            rig: motion.rig(),
            noise_px: args.noise_px.or_else(|| after::noise_px(&self.calibration)).unwrap_or(DEFAULT_NOISE_PX),
            points: DEFAULT_POINTS,
            motions: args.motions.unwrap_or(2) as usize,
            calibration: Options {
                attitude_sigma_deg: args.attitude_sigma_deg.or(assumed.attitude_sigma_deg),
                height_sigma: args.height_sigma.or(assumed.height_sigma),
                ..assumed
            },
        };
        if let Some(points) = args.points {
            options.points = f64::from(points);
        } else {
            let planner = Planner::new(&options, Some(&self.covariance)).map_err(|e| of_file(&self.name, e))?;
            options.points = after::points(&self.calibration, &planner).unwrap_or(DEFAULT_POINTS);
        }
        Ok(options)
    }
}
