//! What `--after` takes from a calibration, unless the arguments say it.

use std::path::{Path, PathBuf};

use groundcal::{
    calibrate::Options,
    plan::{
        PlanOptions, Planner, Start, after,
        carriers::{Carrier, CarrierMotion},
    },
    result::Calibration,
};
use groundcal_io::import::groundcal_json;

use crate::{
    commands::plan::args::{DEFAULT_NOISE_PX, DEFAULT_POINTS, PlanArgs},
    error::CliError,
};

/// Motions added where nothing is said.
const DEFAULT_MOTIONS: usize = 2;

/// A calibration to improve.
pub(crate) struct Known {
    calibration: Calibration,
    /// Its covariance.
    pub(crate) covariance: Start,
    path: PathBuf,
}

/// Reads calibration.json, or that in a folder.
pub(crate) fn read(path: &Path) -> Result<Known, CliError> {
    let of_file = |error| CliError::of_file(path, error);
    let calibration = groundcal_json::read(path)?;
    let covariance = after::start(&calibration).map_err(of_file)?;
    let known = Known { calibration, covariance, path: path.to_path_buf() };
    // What the file holds is judged by itself: no fault of arguments that are going to take its place.
    let usual = Carrier::Tripod.motion(Carrier::Tripod.height_m());
    let own = known.assumed(&usual)?;
    Planner::new(&own, Some(&known.covariance)).map_err(of_file)?;
    Ok(known)
}

impl Known {
    /// Height of the camera over the floor in metres, where the calibration knows it.
    pub(crate) fn height_m(&self) -> Option<f64> {
        self.calibration.camera_height_m
    }

    /// Camera, priors and noise as this calibration has them.
    fn assumed(&self, motion: &CarrierMotion) -> Result<PlanOptions, CliError> {
        let camera = &self.calibration.camera;
        Ok(PlanOptions {
            intrinsics: camera.intrinsics(),
            lens: camera.lens(),
            size: camera.size(),
            rig: motion.rig(),
            noise_px: after::noise_px(&self.calibration).unwrap_or(DEFAULT_NOISE_PX),
            points: DEFAULT_POINTS,
            motions: DEFAULT_MOTIONS,
            calibration: after::options(&self.calibration),
        })
    }

    /// Camera, priors, noise and matches as this calibration has them, unless they are given.
    pub(crate) fn options(&self, args: &PlanArgs, motion: &CarrierMotion) -> Result<PlanOptions, CliError> {
        let assumed = self.assumed(motion)?;
        let mut options = PlanOptions {
            noise_px: args.noise_px.unwrap_or(assumed.noise_px),
            motions: args.motions.map_or(assumed.motions, |n| n as usize),
            calibration: Options {
                attitude_sigma_deg: args.attitude_sigma_deg.or(assumed.calibration.attitude_sigma_deg),
                height_sigma: args.height_sigma.or(assumed.calibration.height_sigma),
                ..assumed.calibration
            },
            ..assumed
        };
        if let Some(points) = args.points {
            options.points = f64::from(points);
        } else {
            let planner = Planner::new(&options, Some(&self.covariance))
                .map_err(|e| CliError::of_file_and_options(&self.path, e))?;
            options.points = after::points(&self.calibration, &planner).unwrap_or(DEFAULT_POINTS);
        }
        Ok(options)
    }
}
