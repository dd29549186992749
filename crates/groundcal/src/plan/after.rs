//! What a plan takes from a calibration that it is to improve.

use crate::{
    calibrate::{LensModel, Options},
    error::Error,
    numerics::statistics::median,
    plan::planner::{MIN_MATCHES, Planner, Start},
    result::{Calibration, MotionReport, Parameter},
    start::linear_camera::GivenPrior,
};

/// Least noise a plan knows, pixels: exact matches are somebody's simulation.
const MIN_NOISE_PX: f64 = 1e-3;
/// Part of the floor that two pictures must share for their matches to tell anything: of a sliver nothing follows.
const MIN_SHARED: f64 = 0.05;

/// The covariance to start from.
///
/// # Errors
/// [`Error::InvalidInput`] where the calibration has none of the camera matrix, k1 and k2. Files of before have no other numbers.
pub(crate) fn start_after(c: &Calibration) -> Result<Start, Error> {
    let fail = |what: String| Error::InvalidInput(format!("{what}. Calibrate again with this version of the program"));
    if !c.covariance.is_known() {
        return Err(fail("there is no covariance to start from".into()));
    }
    let later = [Parameter::P1, Parameter::P2, Parameter::K3];
    let missing = |p: &&Parameter| !later.contains(p) && !c.covariance.parameters.contains(p);
    if let Some(p) = Parameter::ALL.iter().find(missing) {
        return Err(fail(format!("there is no {p} in the covariance")));
    }
    Ok(c.covariance.clone())
}

/// What was assumed, to be assumed again.
pub(crate) fn options(c: &Calibration) -> Options {
    let priors = c.priors.iter();
    Options {
        constraint: c.constraint,
        lens: LensModel::K1K2,
        priors: priors.map(|p| GivenPrior { parameter: p.parameter, mean: p.mean, sigma: p.sigma }).collect(),
        attitude_sigma_deg: Some(c.attitude_sigma_deg),
        height_sigma: c.height_sigma,
        ..Options::default()
    }
}

/// Noise of a coordinate: the residuals of the motions used, two coordinates of four being left over by the point, and what the
/// refinement found them to be too small by.
pub(crate) fn noise_px(c: &Calibration) -> Option<f64> {
    let mut rms: Vec<f64> = c.motions.iter().filter(|m| m.used).filter_map(|m| m.rms_px).collect();
    let factor = c.fit.refinement.as_ref().and_then(|r| r.patches.as_ref().or(r.points.as_ref()));
    let factor = factor.map_or(1.0, |f| (f.variance_factor * f.design_effect).sqrt());
    (!rms.is_empty()).then(|| (factor * median(&mut rms) / 2f64.sqrt()).max(MIN_NOISE_PX))
}

/// Matches that the motions used would have had if both pictures had shown the same floor from border to border.
pub(crate) fn points(c: &Calibration, planner: &Planner) -> Option<f64> {
    let of = |m: &MotionReport| {
        let attitude = c.attitudes.get(m.attitude?)?;
        let spec = planner.motion(
            attitude.pitch_down_deg.to_radians(),
            attitude.roll_deg.to_radians(),
            m.rotation_deg?.to_radians(),
        );
        let fraction = planner.shared_fraction(&spec);
        (fraction > MIN_SHARED && m.matches > 0).then_some(m.matches as f64 / fraction)
    };
    let mut all: Vec<f64> = c.motions.iter().filter(|m| m.used).filter_map(of).collect();
    (!all.is_empty()).then(|| median(&mut all).clamp(MIN_MATCHES, 1e6))
}
