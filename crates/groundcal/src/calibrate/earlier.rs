//! A calibration as what is known beforehand of the same camera.
//!
//! Priors are independent of each other, what a calibration knows is not: a focal length and a distortion that are wrong together go unseen. With
//! D the variances and R the correlations of the calibration's covariance C = √D R √D, the independent variances λ D, λ the largest eigenvalue of R,
//! are the smallest multiple of D that nowhere claims more than C does (λ D - C has no negative eigenvalue).

use nalgebra::DMatrix;

use crate::{
    error::Error,
    geometry::{lens::Lens, size::ImageSize},
    numerics::linalg::symmetric_eigen,
    result::{Calibration, LensSource, Parameter},
    start::linear_camera::GivenPrior,
};

/// Priors from an earlier calibration, for images of this size, of all that it estimated.
///
/// # Errors
/// [`Error::InvalidOption`] where its images have another shape, its lens is of another model, or it estimated nothing.
pub fn priors_of(earlier: &Calibration, size: ImageSize) -> Result<Vec<GivenPrior>, Error> {
    let wrong = |what: String| Err(Error::InvalidOption(format!("an earlier calibration as prior: {what}")));
    let before = earlier.camera.size();
    let Some(camera) = earlier.camera.model().scaled_to(size) else {
        return wrong(format!(
            "its images have {before} pixels, these {size}: another shape, so they are not the same picture at another size"
        ));
    };
    if !matches!(earlier.camera.lens(), Lens::None | Lens::Radtan(_)) {
        return wrong(format!("its lens is {}; give it as a known lens", earlier.camera.lens().name()));
    }
    let of_lens = earlier.camera.distortion.source == LensSource::Estimated;
    let estimated = |p: &Parameter| {
        earlier.standard_deviation(*p).is_some_and(|s| s.is_finite() && s > 0.0) && (of_lens || !p.is_of_lens())
    };
    let parameters: Vec<Parameter> = Parameter::ALL.into_iter().filter(estimated).collect();
    if parameters.is_empty() {
        return wrong("it estimated nothing of the camera".into());
    }
    // fy is known through the aspect ratio fy / fx.
    let (fx, fy) = (earlier.camera.fx, earlier.camera.fy);
    let both = parameters.contains(&Parameter::Fx);
    let n = parameters.len();
    let change = DMatrix::from_fn(n, n, |r, c| match (parameters[r], parameters[c]) {
        (Parameter::Fy, Parameter::Fy) => 1.0 / fx,
        (Parameter::Fy, Parameter::Fx) if both => -fy / (fx * fx),
        (a, b) => f64::from(u8::from(a == b)),
    });
    let covariance = &change * earlier.covariance.of(&parameters) * change.transpose();
    let sigma: Vec<f64> = covariance.diagonal().iter().map(|v| v.max(0.0).sqrt()).collect();
    let correlation = DMatrix::from_fn(n, n, |r, c| {
        let scale = sigma[r] * sigma[c];
        if scale > 0.0 { covariance[(r, c)] / scale } else { f64::from(u8::from(r == c)) }
    });
    let largest = symmetric_eigen(&correlation).map_or(n as f64, |(values, _)| values.max());
    let pixels = size.width as f64 / before.width as f64;
    let prior = |(i, p): (usize, &Parameter)| {
        let (mean, unit) = match p {
            Parameter::Fx => (camera.intrinsics.fx, pixels),
            Parameter::Fy => (camera.intrinsics.fy / camera.intrinsics.fx, 1.0),
            Parameter::Cx => (camera.intrinsics.cx, pixels),
            Parameter::Cy => (camera.intrinsics.cy, pixels),
            Parameter::Skew => (camera.intrinsics.skew, pixels),
            of_lens => (earlier.value(*of_lens), 1.0),
        };
        GivenPrior { parameter: p.prior(), mean, sigma: sigma[i] * largest.max(1.0).sqrt() * unit }
    };
    // One held by its constraint (fy = fx exactly) is no prior.
    Ok(parameters.iter().enumerate().map(prior).filter(|p| p.sigma > 0.0).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        calibrate::{Options, Silent, calibrate_matches},
        geometry::parameters::PriorParameter,
        pairs::correspondence::ImagePair,
        synthetic::points::PointScene,
    };

    fn calibration(seed: u64, options: &Options) -> Calibration {
        let scene = PointScene::nominal(seed);
        let pairs: Vec<ImagePair> = scene.pairs();
        let names: Vec<String> = (0..2 * pairs.len()).map(|i| i.to_string()).collect();
        calibrate_matches(&names, scene.size, &pairs, options, &Silent).expect("a camera")
    }

    #[test]
    fn priors_claim_nowhere_more_than_the_calibration() {
        let c = calibration(1, &Options::default());
        let priors = priors_of(&c, c.camera.size()).expect("priors");
        let of = |p: PriorParameter| priors.iter().find(|g| g.parameter == p).expect("a prior");
        let fx = of(PriorParameter::Fx);
        assert_eq!(fx.mean, c.camera.fx);
        assert!((of(PriorParameter::Aspect).mean - c.camera.fy / c.camera.fx).abs() < 1e-15);
        assert!(fx.sigma > c.standard_deviation.fx.expect("estimated"));
        // Along every direction: of fx, cx, cy, k1, k2.
        let some = [Parameter::Fx, Parameter::Cx, Parameter::Cy, Parameter::K1, Parameter::K2];
        let covariance = c.covariance.of(&some);
        let wide = DMatrix::from_fn(5, 5, |r, k| if r == k { of(some[r].prior()).sigma.powi(2) } else { 0.0 });
        let scale = DMatrix::from_fn(5, 5, |r, k| if r == k { covariance[(r, r)].sqrt().recip() } else { 0.0 });
        let (values, _) = symmetric_eigen(&(&scale * (wide - covariance) * &scale)).expect("eigenvalues");
        assert!(values.min() > -1e-9, "{values}");
    }

    #[test]
    fn a_second_calibration_gains_from_the_first() {
        let first = calibration(1, &Options::default());
        let alone = calibration(2, &Options::default());
        let priors = priors_of(&first, first.camera.size()).expect("priors");
        let both = calibration(2, &Options { priors, ..Options::default() });
        let sigma = |c: &Calibration| c.standard_deviation.fx.expect("estimated");
        assert!(sigma(&both) < 0.95 * sigma(&alone), "{} after {}", sigma(&both), sigma(&alone));
        assert!((both.camera.fx - 1000.0).abs() < 4.0 * sigma(&both), "{}", both.camera.fx);
    }

    #[test]
    fn another_size_is_scaled_and_another_shape_refused() {
        let c = calibration(1, &Options::default());
        let half = priors_of(&c, ImageSize::new(640, 480)).expect("priors");
        let whole = priors_of(&c, c.camera.size()).expect("priors");
        assert!(
            (half[0].sigma / whole[0].sigma - 0.5).abs() < 1e-12 && (half[0].mean / whole[0].mean - 0.5).abs() < 1e-12
        );
        assert!(priors_of(&c, ImageSize::new(640, 640)).unwrap_err().to_string().contains("another shape"));
        let mut held = c;
        held.standard_deviation = Default::default();
        assert!(priors_of(&held, ImageSize::new(1280, 960)).unwrap_err().to_string().contains("estimated nothing"));
    }
}
