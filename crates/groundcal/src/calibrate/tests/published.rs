//! The method as Knight, Zisserman & Reid published it (`Method::Kzr`): exact data, the three steps done by hand, its error bars.

use crate::calibrate::calibrate_matches;
use crate::calibrate::{HomographyFit, LensModel, MotionModel, Options};
use crate::error::Error;
use crate::geometry::constraint::Constraint;
use crate::geometry::frame::Frame;
use crate::geometry::intrinsics::Intrinsics;
use crate::geometry::lens::Division;
use crate::geometry::lens::Lens;
use crate::numerics::linalg::{ComplexPoint, complex_pair_eigen};
use crate::observer::Silent;
use crate::pairs::correspondence::{ImagePair, PointMatch};
use crate::pairs::dlt::direct_linear_transformation;
use crate::pairs::pair_lens::RadialCorrection;
use crate::result::calibration::Calibration;
use crate::result::camera::Method;
use crate::start::absolute_conic::{intrinsics_of, solve_unweighted};
use crate::synthetic::points::PointScene;
use rayon::prelude::*;

fn options(homographies: HomographyFit) -> Options {
    Options {
        method: Method::Kzr,
        homographies,
        constraint: Constraint::ZeroSkew,
        pairs: Some(vec![(0, 1), (2, 3), (4, 5)]),
        attitude_sigma_deg: Some(0.0),
        ..Options::default()
    }
}

fn calibrated(scene: &PointScene, options: &Options) -> Result<Calibration, Error> {
    let names: Vec<String> = (0..2 * scene.motions.len()).map(|i| i.to_string()).collect();
    let matches: Vec<ImagePair> = scene.pairs();
    calibrate_matches(&names, scene.size, &matches, options, &Silent)
}

fn numbers(k: &Intrinsics) -> [f64; 5] {
    [k.fx, k.fy, k.cx, k.cy, k.skew]
}

const BOTH: [HomographyFit; 2] = [HomographyFit::Linear, HomographyFit::NonLinear];

#[test]
fn exact_matches_give_the_exact_camera() {
    for homographies in BOTH {
        for constraint in [Constraint::Full, Constraint::ZeroSkew] {
            let scene = PointScene { sigma_px: 0.0, ..PointScene::nominal(4) };
            let c = calibrated(&scene, &Options { constraint, ..options(homographies) }).unwrap();
            for (found, truth) in numbers(&c.camera.intrinsics()).iter().zip(numbers(&scene.intrinsics)) {
                assert!((found - truth).abs() < 1e-6, "{homographies:?} {constraint:?}: {found} {truth}");
            }
            assert_eq!((c.method, c.constraint, c.scene), (Method::Kzr, constraint, None));
        }
    }
}

/// Linear homographies of the matches on the plane, their eigenvectors, one linear system, Cholesky: nothing else.
#[test]
fn the_answer_is_that_of_the_three_steps() {
    for seed in 0..5 {
        let scene = PointScene::nominal(seed);
        let c = calibrated(&scene, &options(HomographyFit::Linear)).unwrap();
        let frame = Frame::new(scene.size, None);
        let points: Vec<ComplexPoint> = (c.evidence.pairs.iter())
            .map(|pair| {
                let accepted = pair.matches.iter().filter(|m| m.accepted);
                let local = |p: [f64; 2]| frame.local(&p.into());
                let matches: Vec<PointMatch> =
                    accepted.map(|m| PointMatch::new(local(m.a).into(), local(m.b).into())).collect();
                let (h, _) = direct_linear_transformation(&matches).unwrap();
                complex_pair_eigen(&h).unwrap().complex_right
            })
            .collect();
        let by_hand = solve_unweighted(&points, Constraint::ZeroSkew, 1.0).unwrap();
        let by_hand = frame.intrinsics_to_pixel(&intrinsics_of(&by_hand));
        for (found, expected) in numbers(&c.camera.intrinsics()).iter().zip(numbers(&by_hand)) {
            assert!((found - expected).abs() < 1e-7, "{seed}: {found} {expected}");
        }
        // The weighted and polished method answers otherwise.
        let linear = Options { method: Method::Linear, lens: LensModel::None, ..options(HomographyFit::NonLinear) };
        let apart = calibrated(&scene, &linear).unwrap().camera.fx - c.camera.fx;
        assert!(apart.abs() > 1e-3, "{seed}: {apart}");
    }
}

#[test]
fn its_intervals_hold_the_truth() {
    const TRIALS: u64 = 600;
    for homographies in BOTH {
        let held: [f64; 4] = (0..TRIALS)
            .into_par_iter()
            .map(|seed| {
                let scene = PointScene::nominal(seed);
                let c = calibrated(&scene, &options(homographies)).unwrap();
                let s = &c.standard_deviation;
                let (k, truth) = (numbers(&c.camera.intrinsics()), numbers(&scene.intrinsics));
                let sigma = [s.fx, s.fy, s.cx, s.cy].map(Option::unwrap);
                std::array::from_fn(|i| f64::from((k[i] - truth[i]).abs() <= 1.96 * sigma[i]) / TRIALS as f64)
            })
            .reduce(|| [0.0; 4], |a, b| std::array::from_fn(|i| a[i] + b[i]));
        // Sampling error 0.9 %.
        assert!(held.iter().all(|share| (0.92..=0.98).contains(share)), "{held:?}");
    }
}

#[test]
fn what_it_has_no_word_for_is_refused() {
    let scene = PointScene::nominal(1);
    let refused = |options: Options| match calibrated(&scene, &options) {
        Err(Error::InvalidOption(text)) => assert!(text.contains("kzr"), "{text}"),
        other => panic!("{other:?}"),
    };
    let kzr = || options(HomographyFit::NonLinear);
    refused(Options { distortion: Lens::radial(-0.1, 0.0), ..kzr() });
    refused(Options { height_sigma: Some(0.0), ..kzr() });
    refused(Options { radial: RadialCorrection::PerPair, method: Method::Linear, ..kzr() });
    refused(Options { motion: MotionModel::Turning, ..kzr() });
    refused(Options { method: Method::Joint, ..options(HomographyFit::Linear) });
    // Two motions for the five unknowns.
    let full = Options { constraint: Constraint::Full, pairs: Some(vec![(0, 1), (2, 3)]), ..kzr() };
    assert!(matches!(calibrated(&scene, &full), Err(Error::TooFewAttitudes { needed: 3, .. })));
}

const CORRECTIONS: [RadialCorrection; 2] = [RadialCorrection::PerPair, RadialCorrection::ClosedForm];
/// A camera whose lens acts about the image's centre.
const CENTRED: Intrinsics = Intrinsics { fx: 1000.0, fy: 1000.0, cx: 639.5, cy: 479.5, skew: 0.0 };

fn through_lens(lens: Lens, sigma_px: f64, seed: u64) -> PointScene {
    PointScene { intrinsics: CENTRED, lens, sigma_px, ..PointScene::nominal(seed) }
}

#[test]
fn exact_matches_through_a_lens_of_one_parameter_give_the_exact_camera_and_lens() {
    for lambda in [-0.2, 0.05] {
        for radial in CORRECTIONS {
            for homographies in BOTH {
                let scene = through_lens(Lens::Division(Division::new(lambda)), 0.0, 4);
                let c = calibrated(&scene, &Options { radial, ..options(homographies) }).unwrap();
                for (found, truth) in numbers(&c.camera.intrinsics()).iter().zip(numbers(&CENTRED)) {
                    assert!((found - truth).abs() < 1e-4, "{lambda} {radial:?} {homographies:?}: {found} {truth}");
                }
                let [found] = c.camera.lens().parameters()[..] else { panic!("{:?}", c.camera.lens()) };
                assert!((found - lambda).abs() < 1e-7, "{found} {lambda}");
            }
        }
    }
}

/// Errors of fx, per cent, over seeds; `None`: refused.
fn errors(scene: impl Fn(u64) -> PointScene + Sync, radial: RadialCorrection) -> Vec<Option<f64>> {
    let error = |seed: u64| {
        let c = calibrated(&scene(seed), &Options { radial, ..options(HomographyFit::NonLinear) });
        c.ok().map(|c| 100.0 * (c.camera.fx / CENTRED.fx - 1.0))
    };
    (0..60u64).into_par_iter().map(error).collect()
}

/// None of them may be refused.
fn mean_and_its_deviation(values: &[Option<f64>]) -> (f64, f64) {
    let values: Vec<f64> = values.iter().map(|v| v.expect("a camera")).collect();
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    (mean, (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0) / n).sqrt())
}

/// The lens is that of Brown and Conrady, which the one parameter follows nearly.
#[test]
fn with_noise_what_is_minimised_is_right_and_the_closed_form_is_biased() {
    let lens = Lens::radial(-0.2, 0.0);
    let of = |sigma_px: f64, radial| errors(|seed| through_lens(lens, sigma_px, seed), radial);
    let ignored = of(0.0, RadialCorrection::None);
    let model = CORRECTIONS.map(|radial| mean_and_its_deviation(&of(0.0, radial)).0);
    let noisy = CORRECTIONS.map(|radial| mean_and_its_deviation(&of(0.5, radial)));
    // What is left without noise is what the one parameter lacks of k1.
    let farthest = model[0].abs().max(model[1].abs());
    assert!(ignored.iter().flatten().all(|error| error.abs() > 5.0 * farthest), "{ignored:.1?}");
    let [(minimised, its_deviation), (closed_form, deviation)] = noisy;
    assert!((minimised - model[0]).abs() < 3.0 * its_deviation, "{minimised} +- {its_deviation}");
    assert!((closed_form - model[1]).abs() > 5.0 * deviation, "{closed_form} +- {deviation}");
}
