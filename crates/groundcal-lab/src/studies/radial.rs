//! Bias and scatter of the one-parameter radial distortion (KZR 3.2) under noise: closed form, minimised with each homography, and
//! minimised with all homographies of one lens.
//!
//! Scenes are those of [`super::figure4`] with points distorted by the division model, whose λ all methods estimate; the camera follows
//! from the homographies by the linear method with zero skew.

use nalgebra::{Matrix3, Vector2};
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Mcg;

use crate::studies::{
    figure4::{Condition, in_units, linear_homography, quantile, scene},
    setting::Setting,
};
use groundcal::{
    geometry::{Camera, Division, Frame, Lens},
    pairs::{HomographyEstimate, PointMatch, division_of_motion, division_of_motions, gold_standard_homography},
    start::{Constraint, unweighted_camera},
};

/// True λ: a corner pulled in by a fifth (k1 near -0.08 for a focal length of 1000 px at 1280 x 960).
pub const LAMBDA: f64 = -0.1;
/// Standard deviations of the image noise, pixels.
pub const NOISE_PX: [f64; 7] = [0.0, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0];

/// How the lens is estimated.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Method {
    /// Not at all.
    Ignored,
    /// Fitzgibbon's quadratic eigenvalue problem, each motion by itself.
    ClosedForm,
    /// Minimised together with each homography.
    EachHomography,
    /// Minimised together with all three homographies.
    AllHomographies,
}

impl Method {
    /// All of them.
    pub const ALL: [Method; 4] = [Method::Ignored, Method::ClosedForm, Method::EachHomography, Method::AllHomographies];

    /// The name used in files.
    pub fn name(self) -> &'static str {
        match self {
            Method::Ignored => "ignored",
            Method::ClosedForm => "closed_form",
            Method::EachHomography => "each_homography",
            Method::AllHomographies => "all_homographies",
        }
    }
}

/// What one trial gave for one method.
#[derive(Debug, Clone, Copy, Default)]
pub struct Outcome {
    /// Relative error of λ of the first motion; `None`: no real solution (and always for [`Method::Ignored`]).
    pub lambda: Option<f64>,
    /// Relative error of fx; `None`: no camera.
    pub fx: Option<f64>,
}

/// One trial of all methods, in the order of [`Method::ALL`].
pub fn trial(noise_px: f64, setting: Setting, seed: u64, number: u64) -> [Outcome; 4] {
    let scene = scene(&Condition { noise_px: 0.0, setting, ..Condition::default() }, seed, number);
    let frame = Frame::new(scene.size, None);
    let unit = in_units(&frame);
    let camera = Camera { size: scene.size, intrinsics: unit, lens: Lens::Division(Division::new(LAMBDA)) };
    let mut rng = Pcg64Mcg::seed_from_u64(scene.seed ^ 0x5ad1_a100);
    let mut seen = |p: &Vector2<f64>| {
        let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
        let noise = Vector2::new(normal(), normal()) * noise_px;
        // A barrel lens distorts any point.
        camera.project(&unit.normalised_from_pixel(p).push(1.0)).unwrap_or(frame.origin_px) + noise
    };
    let motions: Vec<Vec<PointMatch>> = scene
        .pairs()
        .iter()
        .map(|p| p.matches.iter().map(|m| PointMatch { a: seen(&m.a), b: seen(&m.b), ..*m }).collect())
        .collect();
    let slices: Vec<&[PointMatch]> = motions.iter().map(Vec::as_slice).collect();
    let fx_error = |homographies: Option<Vec<Matrix3<f64>>>| {
        let k = unweighted_camera(&homographies?, &frame, Constraint::ZeroSkew, 1.0).ok()?;
        Some(k.fx / scene.intrinsics.fx - 1.0).filter(|e| e.is_finite())
    };
    let of_estimates =
        |all: Option<Vec<HomographyEstimate>>| fx_error(all.map(|all| all.iter().map(|h| h.in_frame).collect()));
    let relative = |lambda: f64| lambda / LAMBDA - 1.0;
    Method::ALL.map(|method| match method {
        Method::Ignored => Outcome {
            lambda: None,
            fx: of_estimates(slices.iter().map(|m| gold_standard_homography(m, &frame).ok()).collect()),
        },
        Method::ClosedForm => {
            let found: Vec<_> = slices.iter().map(|m| division_of_motion(m, &frame)).collect();
            // Homographies of ideal points by the linear method, as where there is no lens.
            let homographies = found.iter().zip(&slices).map(|(found, matches)| {
                let model = Lens::Division(Division::new((*found)?));
                let ideal: Option<Vec<PointMatch>> = matches
                    .iter()
                    .map(|m| {
                        let undo = |p: &Vector2<f64>| {
                            Some((unit.matrix() * model.undistort(&unit.normalised_from_pixel(p))?.push(1.0)).xy())
                        };
                        Some(PointMatch { a: undo(&m.a)?, b: undo(&m.b)?, ..*m })
                    })
                    .collect();
                linear_homography(&ideal?, &frame)
            });
            Outcome { lambda: found[0].map(relative), fx: fx_error(homographies.collect()) }
        }
        Method::EachHomography => {
            let found: Vec<_> = slices.iter().map(|m| division_of_motions(&[m], &frame).ok()).collect();
            Outcome {
                lambda: found[0].as_ref().map(|f| relative(f.0)),
                fx: of_estimates(found.into_iter().map(|f| f?.1.into_iter().next()).collect()),
            }
        }
        Method::AllHomographies => {
            let found = division_of_motions(&slices, &frame).ok();
            Outcome { lambda: found.as_ref().map(|f| relative(f.0)), fx: of_estimates(found.map(|f| f.1)) }
        }
    })
}

/// Errors of many trials, per cent.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Spread {
    /// All trials.
    pub trials: usize,
    /// Those without an answer.
    pub failures: usize,
    /// Lower quartile, median and upper quartile of the absolute error over all trials, a failure counting as infinite.
    pub absolute_percent: [f64; 3],
    /// Median of the signed error over the trials with an answer: the bias that outliers do not rule.
    pub median_percent: Option<f64>,
    /// Mean of the signed error over the trials with an answer.
    pub mean_percent: Option<f64>,
    /// Their standard deviation.
    pub deviation_percent: Option<f64>,
}

/// Sums up relative errors; `None` is a failure.
pub fn spread(errors: &[Option<f64>]) -> Spread {
    let percent: Vec<f64> = errors.iter().flatten().map(|e| 100.0 * e).collect();
    let n = percent.len() as f64;
    let mut absolute: Vec<f64> = errors.iter().map(|e| e.map_or(f64::INFINITY, |e| 100.0 * e.abs())).collect();
    absolute.sort_by(f64::total_cmp);
    let mut signed = percent.clone();
    signed.sort_by(f64::total_cmp);
    let mean = (n > 0.0).then(|| percent.iter().sum::<f64>() / n);
    let deviation =
        mean.filter(|_| n > 1.0).map(|m| (percent.iter().map(|e| (e - m).powi(2)).sum::<f64>() / (n - 1.0)).sqrt());
    Spread {
        trials: errors.len(),
        failures: errors.len() - percent.len(),
        absolute_percent: [0.25, 0.5, 0.75].map(|p| quantile(&absolute, p)),
        median_percent: (n > 0.0).then(|| quantile(&signed, 0.5)),
        mean_percent: mean,
        deviation_percent: deviation,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn without_noise_all_but_ignoring_the_lens_are_exact() {
        for number in 0..4 {
            for (method, outcome) in
                Method::ALL.iter().zip(trial(0.0, Setting { matches: 60, ..Setting::default() }, 1, number))
            {
                let fx = outcome.fx.expect("a camera").abs();
                if *method == Method::Ignored {
                    assert!(fx > 0.01, "{fx}");
                } else {
                    assert!(fx < 1e-8 && outcome.lambda.expect("a lens").abs() < 1e-8, "{method:?} {outcome:?}");
                }
            }
        }
    }

    #[test]
    fn failures_are_counted() {
        let s = spread(&[Some(0.01), None, Some(-0.03)]);
        assert_eq!((s.trials, s.failures), (3, 1));
        assert!((s.mean_percent.expect("two") + 1.0).abs() < 1e-12 && (s.absolute_percent[1] - 3.0).abs() < 1e-12);
        assert_eq!(spread(&[None]).mean_percent, None);
    }
}
