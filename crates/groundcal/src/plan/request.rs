//! What is asked of a plan, in the words of whoever asks: a carrier, and what of it, of the camera and of the matches is not as usual.

use crate::{
    calibrate::{LensModel, Options},
    error::Error,
    geometry::{constraint::Constraint, frame::Frame, intrinsics::Intrinsics, lens::Lens, size::ImageSize},
    plan::{
        after,
        carriers::{Carrier, CarrierMotion, MAX_TURN_DEG, turns_up_to_deg},
        planner::{PlanOptions, Planner, Start},
        report::PlanReport,
    },
    remedy::Wording,
    result::{Calibration, calibration::ATTITUDE_SIGMA_DEG},
    start::linear_camera::GivenPrior,
};

/// Standard deviation of each coordinate of a match where nothing is said, pixels.
const NOISE_PX: f64 = 0.3;
/// Matches of two pictures that show the same floor from border to border, where nothing is said.
const POINTS: f64 = 300.0;
/// Motions where nothing is said, and those added to a calibration.
const MOTIONS: usize = 4;
const MOTIONS_ADDED: usize = 2;
/// The most motions of a plan.
const MAX_MOTIONS: usize = 50;
const IMAGE_SIZE: ImageSize = ImageSize { width: 1280, height: 960 };

/// What is asked of a plan. `None` and empty: as usual, or as the calibration has it that is to be improved.
#[derive(Debug, Clone, Default)]
pub struct PlanRequest {
    /// What carries the camera.
    pub carrier: Carrier,
    /// Width and height in pixels.
    pub image_size: Option<ImageSize>,
    /// Rough focal length in pixels.
    pub f_px: Option<f64>,
    /// Rough horizontal field of view in degrees, instead of the focal length.
    pub hfov_deg: Option<f64>,
    /// Principal point, pixels, as the calibration is going to be told.
    pub principal_point_px: Option<[f64; 2]>,
    /// Tilts that the camera can have, degrees below the horizon.
    pub tilts_deg: Option<Vec<f64>>,
    /// Rolls that it can have, degrees.
    pub rolls_deg: Option<Vec<f64>>,
    /// Largest turn between two pictures, degrees.
    pub max_turn_deg: Option<f64>,
    /// Height of the camera over the floor, metres.
    pub height_m: Option<f64>,
    /// Distance from the camera back to the axis that it turns about, metres.
    pub axis_offset_m: Option<f64>,
    /// How far away the floor can still be matched, metres.
    pub reach_m: Option<f64>,
    /// Standard deviation of each coordinate of a match, pixels.
    pub noise_px: Option<f64>,
    /// Matches of two pictures that show the same floor from border to border.
    pub points: Option<f64>,
    /// Motions (two pictures each).
    pub motions: Option<usize>,
    /// What the calibration is going to assume of the camera matrix.
    pub constraint: Constraint,
    /// What is known of parameters beforehand.
    pub priors: Vec<GivenPrior>,
    /// What is going to be estimated of the lens.
    pub lens: LensModel,
    /// How far the camera pitches and rolls by itself between views, standard deviation in degrees.
    pub attitude_sigma_deg: Option<f64>,
    /// How far its height varies, relative standard deviation.
    pub height_sigma: Option<f64>,
}

/// Why there is no plan.
#[derive(Debug, Clone, PartialEq)]
pub enum RequestError {
    /// A number of the request is out of its range.
    OutOfRange {
        /// Name of the field.
        field: &'static str,
        /// Its value.
        value: f64,
        /// What was expected.
        expected: String,
    },
    /// The calibration to be improved does not serve, whatever is asked.
    OfCalibration(Error),
    /// What is asked cannot be planned.
    Plan(Error),
}

/// A number above zero.
fn positive(field: &'static str, value: f64, limit: f64) -> Result<f64, RequestError> {
    if value.is_finite() && value > 0.0 && value <= limit {
        return Ok(value);
    }
    Err(RequestError::OutOfRange { field, value, expected: format!("a number above 0, at most {limit}") })
}

impl PlanRequest {
    /// The plan; after a calibration, the motions that improve it most.
    ///
    /// # Errors
    /// [`RequestError`].
    ///
    /// ```
    /// use groundcal::{Plain, plan::PlanRequest};
    ///
    /// let report = PlanRequest { motions: Some(3), ..PlanRequest::default() }.report(None, &Plain).unwrap();
    /// assert_eq!(report.motions.len(), 3);
    /// ```
    pub fn report(&self, after: Option<&Calibration>, wording: &dyn Wording) -> Result<PlanReport, RequestError> {
        let known = after.map(Known::new).transpose()?;
        if let Some(motions) = self.motions.filter(|n| !(1..=MAX_MOTIONS).contains(n)) {
            let expected = format!("a whole number from 1 to {MAX_MOTIONS}");
            return Err(RequestError::OutOfRange { field: "motions", value: motions as f64, expected });
        }
        let height_of_calibration = after.and_then(|c| c.camera_height_m);
        let motion = self.motion(self.height_m.or(height_of_calibration).unwrap_or(self.carrier.height_m()))?;
        let options = match &known {
            Some(known) => known.options(self, &motion)?,
            None => self.fresh(&motion)?,
        };
        let plan = Planner::new(&options, known.as_ref().map(|k| &k.covariance))
            .and_then(|planner| planner.plan())
            .map_err(RequestError::Plan)?;
        Ok(PlanReport::new(motion, &options, plan, wording))
    }

    /// How the carrier moves: as usual, but for what is said.
    fn motion(&self, height_m: f64) -> Result<CarrierMotion, RequestError> {
        let usual = self.carrier.motion(positive("height_m", height_m, 1e5)?);
        let max_turn = self.max_turn_deg.unwrap_or(MAX_TURN_DEG);
        if !(0.0..=180.0).contains(&max_turn) {
            let expected = "0 to 180 degrees".into();
            return Err(RequestError::OutOfRange { field: "max_turn_deg", value: max_turn, expected });
        }
        let axis_offset_m = self.axis_offset_m.unwrap_or(usual.axis_offset_m);
        if !(axis_offset_m.is_finite() && (0.0..=1e5).contains(&axis_offset_m)) {
            let expected = "0 to 100000 metres".into();
            return Err(RequestError::OutOfRange { field: "axis_offset_m", value: axis_offset_m, expected });
        }
        Ok(CarrierMotion {
            tilts_deg: self.tilts_deg.clone().unwrap_or(usual.tilts_deg),
            rolls_deg: self.rolls_deg.clone().unwrap_or(usual.rolls_deg),
            turns_deg: turns_up_to_deg(max_turn),
            axis_offset_m,
            reach_m: positive("reach_m", self.reach_m.unwrap_or(usual.reach_m), 1e7)?,
            ..usual
        })
    }

    /// Without a calibration: a rough camera.
    fn fresh(&self, motion: &CarrierMotion) -> Result<PlanOptions, RequestError> {
        let size = self.image_size.unwrap_or(IMAGE_SIZE);
        let width = size.width as f64;
        let f = match (self.f_px, self.hfov_deg) {
            (Some(f), _) => positive("f", f, 1e7)?,
            (None, Some(degrees)) if (1.0..=170.0).contains(&degrees) => {
                0.5 * width / (0.5 * degrees).to_radians().tan()
            }
            (None, Some(value)) => {
                let expected = "1 to 170 degrees".into();
                return Err(RequestError::OutOfRange { field: "hfov_deg", value, expected });
            }
            (None, None) => width,
        };
        let [cx, cy] = Frame::new(size, self.principal_point_px).origin_px.into();
        Ok(PlanOptions {
            intrinsics: Intrinsics::square(f, cx, cy),
            lens: Lens::None,
            size,
            rig: motion.rig(),
            noise_px: self.noise_px.unwrap_or(NOISE_PX),
            points: self.points.unwrap_or(POINTS),
            motions: self.motions.unwrap_or(MOTIONS),
            calibration: Options {
                constraint: self.constraint,
                principal_point_px: self.principal_point_px,
                lens: self.lens,
                priors: self.priors.clone(),
                attitude_sigma_deg: Some(self.attitude_sigma_deg.unwrap_or(ATTITUDE_SIGMA_DEG)),
                height_sigma: Some(self.height_sigma.unwrap_or(self.carrier.height_sigma())),
                ..Options::default()
            },
        })
    }
}

/// A calibration to improve.
struct Known<'a> {
    calibration: &'a Calibration,
    covariance: Start,
}

impl<'a> Known<'a> {
    fn new(calibration: &'a Calibration) -> Result<Self, RequestError> {
        let covariance = after::start_after(calibration).map_err(RequestError::OfCalibration)?;
        let known = Self { calibration, covariance };
        // What it holds is judged by itself: no fault of a request that is going to take its place.
        let own = known.assumed(&Carrier::Tripod.motion(Carrier::Tripod.height_m()));
        Planner::new(&own, Some(&known.covariance)).map_err(RequestError::OfCalibration)?;
        Ok(known)
    }

    /// Camera, priors and noise as this calibration has them.
    fn assumed(&self, motion: &CarrierMotion) -> PlanOptions {
        let camera = &self.calibration.camera;
        PlanOptions {
            intrinsics: camera.intrinsics(),
            lens: camera.lens(),
            size: camera.size(),
            rig: motion.rig(),
            noise_px: after::noise_px(self.calibration).unwrap_or(NOISE_PX),
            points: POINTS,
            motions: MOTIONS_ADDED,
            calibration: after::options(self.calibration),
        }
    }

    /// Camera, priors, noise and matches as this calibration has them, unless they are given.
    fn options(&self, request: &PlanRequest, motion: &CarrierMotion) -> Result<PlanOptions, RequestError> {
        let assumed = self.assumed(motion);
        let mut options = PlanOptions {
            noise_px: request.noise_px.unwrap_or(assumed.noise_px),
            motions: request.motions.unwrap_or(assumed.motions),
            calibration: Options {
                attitude_sigma_deg: request.attitude_sigma_deg.or(assumed.calibration.attitude_sigma_deg),
                height_sigma: request.height_sigma.or(assumed.calibration.height_sigma),
                ..assumed.calibration
            },
            ..assumed
        };
        if let Some(points) = request.points {
            options.points = points;
        } else {
            let planner = Planner::new(&options, Some(&self.covariance)).map_err(RequestError::Plan)?;
            options.points = after::points(self.calibration, &planner).unwrap_or(POINTS);
        }
        Ok(options)
    }
}
