//! The camera's numbers with their error bars, and what determined each: the images or what was assumed.

use groundcal::{
    geometry::Lens,
    result::{Calibration, Parameter, PriorParameter},
};
use serde::Serialize;

use crate::number::interval_95;

/// The camera.
#[derive(Debug, Serialize)]
pub(crate) struct CameraNumbers {
    pub(crate) image_size: [usize; 2],
    pub(crate) parameters: Vec<CameraNumber>,
    /// Displacement by the lens along a radius; empty without distortion.
    pub(crate) lens: Vec<LensPoint>,
}

/// A number of the camera.
#[derive(Debug, Serialize)]
pub(crate) struct CameraNumber {
    pub(crate) name: &'static str,
    /// `px`, or nothing.
    pub(crate) unit: &'static str,
    pub(crate) value: f64,
    /// One standard deviation; `None`: held.
    pub(crate) sigma: Option<f64>,
    /// 95 % interval.
    pub(crate) interval: Option<[f64; 2]>,
    /// What was assumed: mean, standard deviation, in the parameter's unit (`fy`: through the aspect ratio, at the fx found).
    pub(crate) prior: Option<[f64; 2]>,
    /// Part of what is known of it that the images told, 0 to 1: 1 - (posterior / prior variance); 1 without a prior.
    pub(crate) from_images: Option<f64>,
    /// Correlation with fx.
    pub(crate) correlation_with_fx: Option<f64>,
}

/// The lens at a distance from the principal point.
#[derive(Debug, Serialize)]
pub(crate) struct LensPoint {
    /// Distance of the ideal point, pixels.
    pub(crate) radius_px: f64,
    /// How far the lens moves it outwards.
    pub(crate) outwards_px: f64,
    pub(crate) sigma_px: f64,
}

const LENS_POINTS: usize = 24;

/// From a calibration.
pub(crate) fn camera(c: &Calibration) -> CameraNumbers {
    let fx = Parameter::Fx;
    let parameters = Parameter::ALL
        .into_iter()
        .filter(|p| is_shown(c, *p))
        .map(|p| {
            let (value, sigma) = (c.value(p), c.standard_deviation(p));
            let correlation = c.covariance.get(fx, p) / (c.covariance.get(fx, fx) * c.covariance.get(p, p)).sqrt();
            // The prior of fy is one of fy / fx: the ratio's own narrowing counts.
            let told = |p: f64| (1.0 - p * p).clamp(0.0, 1.0);
            let narrowed = c.prior(p.prior()).map(|p| p.posterior_over_prior);
            CameraNumber {
                name: p.name(),
                unit: if p.is_of_lens() { "" } else { "px" },
                // Adding zero turns -0 into 0.
                value: value + 0.0,
                sigma,
                interval: sigma.map(|s| interval_95(value, s)),
                prior: prior_of(c, p),
                from_images: sigma.map(|_| narrowed.map_or(1.0, told)),
                correlation_with_fx: sigma.and(Some(correlation)).filter(|r| p != fx && r.is_finite()),
            }
        })
        .collect();
    CameraNumbers { image_size: c.camera.image_size, parameters, lens: lens(c) }
}

/// What was neither estimated nor is there is not shown, but for k1 and k2, the first things asked of a lens.
fn is_shown(c: &Calibration, p: Parameter) -> bool {
    let first = !p.is_of_lens() || [Parameter::K1, Parameter::K2].contains(&p);
    first || c.standard_deviation(p).is_some() || c.value(p) != 0.0
}

fn prior_of(c: &Calibration, p: Parameter) -> Option<[f64; 2]> {
    let unit = if p.prior() == PriorParameter::Aspect { c.camera.fx } else { 1.0 };
    c.prior(p.prior()).map(|prior| [prior.mean * unit, prior.sigma * unit])
}

/// The radial displacement f (k1 r³ + k2 r⁵ + k3 r⁷), r in focal lengths, out to the farthest corner. Of Brown-Conrady alone: that of other models
/// is no such sum.
fn lens(c: &Calibration) -> Vec<LensPoint> {
    const RADIAL: [(Parameter, i32); 3] = [(Parameter::K1, 3), (Parameter::K2, 5), (Parameter::K3, 7)];
    let camera = &c.camera;
    let none = RADIAL.iter().all(|(k, _)| c.value(*k) == 0.0) && c.standard_deviation.k1.is_none();
    if none || !matches!(camera.model().lens, Lens::None | Lens::Radtan(_)) {
        return Vec::new();
    }
    let [w, h] = camera.image_size.map(|s| s as f64 - 1.0);
    let farthest = camera.cx.max(w - camera.cx).hypot(camera.cy.max(h - camera.cy));
    (0..=LENS_POINTS)
        .map(|i| {
            let radius_px = farthest * i as f64 / LENS_POINTS as f64;
            let rho = radius_px / camera.fx;
            let by = RADIAL.map(|(k, power)| (k, rho.powi(power) * camera.fx));
            let covariances =
                by.iter().flat_map(|(a, by_a)| by.iter().map(move |(b, by_b)| by_a * by_b * c.covariance.get(*a, *b)));
            LensPoint {
                radius_px,
                outwards_px: by.iter().map(|(k, by_k)| by_k * c.value(*k)).sum(),
                sigma_px: covariances.sum::<f64>().max(0.0).sqrt(),
            }
        })
        .collect()
}
