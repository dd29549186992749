//! What `--after` takes from a calibration.

use std::path::Path;

use groundcal::{
    calibrate::{LensModel, Options},
    error::Error,
    numerics::statistics::median,
    plan::{MIN_MATCHES, PlanOptions, Planner, Start, carriers::CarrierMotion},
    result::{Calibration, MotionReport, Parameter},
    start::linear_camera::GivenPrior,
};

use groundcal_io::import::groundcal_json;

use crate::{
    commands::plan::args::{DEFAULT_NOISE_PX, DEFAULT_POINTS, PlanArgs},
    error::CliError,
};

/// Least noise a plan knows, pixels: exact matches are somebody's simulation.
const LEAST_NOISE_PX: f64 = 1e-3;

/// A calibration to improve.
pub(crate) struct Known {
    file: Calibration,
    /// Its covariance.
    pub(crate) covariance: Start,
    name: String,
}

/// Reads calibration.json, or that in a folder.
pub(crate) fn read(path: &Path) -> Result<Known, CliError> {
    let file = groundcal_json::read(path)?;
    let name = path.display().to_string();
    let fail =
        |what: &str| CliError::Input(format!("{name}: {what}. Calibrate again with this version of the program"));
    if !file.covariance.is_known() {
        return Err(fail("there is no covariance to start from"));
    }
    if let Some(p) = Parameter::ALL.iter().find(|p| !file.covariance.parameters.contains(p)) {
        return Err(fail(&format!("there is no {p} in the covariance")));
    }
    let covariance = Start::from_fn(|r, s| file.covariance(Parameter::ALL[r], Parameter::ALL[s]));
    Ok(Known { covariance, name, file })
}

impl Known {
    /// Height of the camera over the floor in metres, where the calibration knows it.
    pub(crate) fn height_m(&self) -> Option<f64> {
        self.file.camera_height_m
    }

    /// Camera, priors, noise and matches as this calibration has them, unless they are given.
    pub(crate) fn options(&self, args: &PlanArgs, motion: &CarrierMotion) -> Result<PlanOptions, CliError> {
        let c = &self.file.camera;
        let priors = self.file.priors.iter();
        let mut options = PlanOptions {
            intrinsics: c.intrinsics(),
            distortion: c.lens(),
            size: c.size(),
            rig: motion.rig(),
            noise_px: args.noise_px.or_else(|| self.noise_px()).unwrap_or(DEFAULT_NOISE_PX),
            points: DEFAULT_POINTS,
            motions: args.motions.unwrap_or(2) as usize,
            calibration: Options {
                constraint: self.file.constraint,
                lens: LensModel::K1K2,
                priors: priors.map(|p| GivenPrior { parameter: p.parameter, mean: p.mean, sigma: p.sigma }).collect(),
                attitude_sigma_deg: Some(args.attitude_sigma_deg.unwrap_or(self.file.attitude_sigma_deg)),
                height_sigma: args.height_sigma.or(self.file.height_sigma),
                ..Options::default()
            },
        };
        options.points = match args.points {
            Some(points) => f64::from(points),
            None => self
                .points(&Planner::new(&options, Some(&self.covariance)).map_err(|e| self.named(e))?)
                .unwrap_or(DEFAULT_POINTS),
        };
        Ok(options)
    }

    /// What the library says of the file's numbers is said of the file.
    fn named(&self, error: Error) -> CliError {
        match error {
            Error::InvalidInput(text) => CliError::Input(format!("{}: {text}", self.name)),
            error => error.into(),
        }
    }

    /// Noise of a coordinate: the residuals of the motions used, two coordinates of four being left over by the point, and what the
    /// refinement found them to be too small by.
    fn noise_px(&self) -> Option<f64> {
        let mut rms: Vec<f64> = self.file.motions.iter().filter(|m| m.used).filter_map(|m| m.rms_px).collect();
        let factor = self.file.fit.refinement.as_ref().and_then(|r| r.patches.as_ref().or(r.points.as_ref()));
        let factor = factor.map_or(1.0, |f| (f.variance_factor * f.design_effect).sqrt());
        (!rms.is_empty()).then(|| (factor * median(&mut rms) / 2f64.sqrt()).max(LEAST_NOISE_PX))
    }

    /// Matches that the motions used would have had if both pictures had shown the same floor from border to border.
    fn points(&self, planner: &Planner) -> Option<f64> {
        let of = |m: &MotionReport| {
            let attitude = self.file.attitudes.get(m.attitude?)?;
            let spec = planner.motion(
                attitude.pitch_down_deg.to_radians(),
                attitude.roll_deg.to_radians(),
                m.rotation_deg?.to_radians(),
            );
            let fraction = planner.shared_fraction(&spec);
            // Of a sliver that the rig's axis leaves in view nothing follows.
            (fraction > 0.05 && m.matches > 0).then_some(m.matches as f64 / fraction)
        };
        let mut all: Vec<f64> = self.file.motions.iter().filter(|m| m.used).filter_map(of).collect();
        (!all.is_empty()).then(|| median(&mut all).clamp(MIN_MATCHES, 1e6))
    }
}
