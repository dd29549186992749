//! A plan with its assumptions, as it is written.

use serde::Serialize;

use crate::{
    plan::{
        carriers::CarrierMotion,
        planner::{HEIGHT_SIGMA, Plan, PlanOptions, PlannedMotion, Prediction},
    },
    remedy::Wording,
    result::{Prior, Warning, WarningReport, calibration::ATTITUDE_SIGMA_DEG},
};

/// Strays up to which predictions were held against simulated calibrations (tests/library/plan.rs), with a margin.
const CHECKED_SIGMA_DEG: f64 = 0.15;
/// Strays that those simulations had, degrees.
const SIMULATED_SIGMA_DEG: f64 = 0.1;

/// A plan, what carries the camera, and what the error bars assume.
#[derive(Debug, Clone, Serialize)]
#[non_exhaustive]
pub struct PlanReport {
    /// Version of this format.
    pub format_version: u32,
    /// How the camera can move.
    pub rig: CarrierMotion,
    /// What the error bars assume.
    pub assumed: Assumptions,
    /// The camera as known from the calibration given; `None` without one.
    pub before: Option<Prediction>,
    /// The motions, the most useful first.
    pub motions: Vec<PlannedMotion>,
    /// What is assumed beforehand and how much of it is left to count in the end.
    pub priors: Vec<Prior>,
    /// What the calibration is going to warn of, and [`Warning::LargeAttitudeErrors`].
    pub warnings: Vec<WarningReport>,
}

/// What the error bars assume.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Assumptions {
    /// Width and height.
    pub image_size: [usize; 2],
    /// Focal length along x, pixels.
    pub fx: f64,
    /// Focal length along y, pixels.
    pub fy: f64,
    /// Principal point, x.
    pub cx: f64,
    /// Principal point, y.
    pub cy: f64,
    /// Standard deviation of each coordinate of a match, pixels.
    pub noise_px: f64,
    /// Matches of two pictures that show the same floor from border to border.
    pub points: f64,
    /// Motions asked for.
    pub motions: usize,
    /// What the calibration is going to assume of the camera matrix.
    pub constraint: &'static str,
    /// How far the camera pitches and rolls by itself between views, degrees.
    pub attitude_sigma_deg: f64,
    /// How far its height varies, relative.
    pub height_sigma: f64,
}

impl PlanReport {
    /// The report of a plan made with these options, its warnings in the words of a front end.
    pub(crate) fn new(rig: CarrierMotion, options: &PlanOptions, plan: Plan, wording: &dyn Wording) -> Self {
        let k = &options.intrinsics;
        let attitude_sigma_deg = options.calibration.attitude_sigma_deg.unwrap_or(ATTITUDE_SIGMA_DEG);
        let mut warnings = plan.warnings;
        if attitude_sigma_deg > CHECKED_SIGMA_DEG {
            warnings
                .push(Warning::LargeAttitudeErrors { sigma_deg: attitude_sigma_deg, checked_deg: SIMULATED_SIGMA_DEG });
        }
        Self {
            format_version: 1,
            assumed: Assumptions {
                image_size: [options.size.width, options.size.height],
                fx: k.fx,
                fy: k.fy,
                cx: k.cx,
                cy: k.cy,
                noise_px: options.noise_px,
                points: options.points,
                motions: options.motions,
                constraint: options.calibration.constraint.name(),
                attitude_sigma_deg,
                height_sigma: options.calibration.height_sigma.unwrap_or(HEIGHT_SIGMA),
            },
            rig,
            before: plan.before,
            motions: plan.motions,
            priors: plan.priors,
            warnings: WarningReport::all(&warnings, wording),
        }
    }
}
