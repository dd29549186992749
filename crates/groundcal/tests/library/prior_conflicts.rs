//! Priors against data: what the matches contradict is released and said, what they do not stays; what has not come to an answer is none.

use groundcal::{
    Error, Options, Silent, calibrate_matches,
    geometry::{ImageSize, Intrinsics},
    pairs::{ImagePair, PointMatch},
    result::{Calibration, Parameter, PriorParameter, Warning},
    synthetic::{MotionSpec, PointScene},
};
use nalgebra::Vector2;

const ATTITUDES: [[f64; 3]; 4] = [[50.0, 5.0, 24.0], [42.0, 35.0, -28.0], [55.0, -22.0, 32.0], [47.0, 50.0, -22.0]];

/// Motions of some of the attitudes: a camera on a tripod, 0.1 px.
fn scene(attitudes: &[[f64; 3]], fy: f64, skew: f64, seed: u64) -> PointScene {
    let motion = |[pitch, roll, turn]: &[f64; 3]| {
        MotionSpec::about_axis(pitch.to_radians(), roll.to_radians(), turn.to_radians(), 0.1, 1.4)
    };
    let centre = ImageSize::new(640, 480).centre_px();
    PointScene {
        intrinsics: Intrinsics { fx: 600.0, fy, cx: centre[0] + 11.0, cy: centre[1] - 6.0, skew },
        size: ImageSize::new(640, 480),
        motions: attitudes.iter().map(motion).collect(),
        matches: 200,
        sigma_px: 0.1,
        ..PointScene::nominal(seed)
    }
}

fn calibrate(scene: &PointScene) -> Result<Calibration, Error> {
    let pairs: Vec<ImagePair> = scene.pairs();
    let names: Vec<String> = (0..2 * pairs.len()).map(|i| i.to_string()).collect();
    calibrate_matches(&names, scene.size, &pairs, &Options::default(), &Silent)
}

fn contradicted(c: &Calibration) -> Vec<PriorParameter> {
    let of = |w: &Warning| match w {
        Warning::PriorContradicted(conflict) => Some(conflict.parameter),
        _ => None,
    };
    c.warnings.iter().filter_map(of).collect()
}

/// Largest error in deviations.
fn worst(c: &Calibration, scene: &PointScene) -> f64 {
    let (k, t) = (&c.camera, &scene.intrinsics);
    let errors = [(k.fx - t.fx, Parameter::Fx), (k.fy - t.fy, Parameter::Fy), (k.cx - t.cx, Parameter::Cx)];
    let of = |(error, p): (f64, Parameter)| (error / c.standard_deviation(p).expect("estimated")).abs();
    errors.into_iter().map(of).fold(of((k.cy - t.cy, Parameter::Cy)), f64::max)
}

#[test]
fn pixels_that_are_not_square_are_found_and_said() {
    for (seed, aspect) in [0.5, 0.8, 0.91, 1.09, 1.25].into_iter().enumerate() {
        let scene = scene(&ATTITUDES, 600.0 * aspect, 0.0, seed as u64);
        let c = calibrate(&scene).unwrap_or_else(|error| panic!("aspect {aspect}: {error}"));
        assert_eq!(contradicted(&c), [PriorParameter::Aspect], "aspect {aspect}");
        let off = worst(&c, &scene);
        println!("aspect {aspect}: fx {:.2} fy {:.2}, {off:.1} deviations off at most", c.camera.fx, c.camera.fy);
        // Four numbers of five scenes: 3.9 deviations have a chance of one in 500.
        assert!(off < 3.9, "aspect {aspect}: {off} deviations");
        let sigma = c.standard_deviation(Parameter::Fx).expect("estimated");
        assert!(sigma < 3.0, "half a per cent at most, as with the prior: {sigma}");
    }
}

#[test]
fn a_skewed_camera_is_found_and_said() {
    let scene = scene(&ATTITUDES, 600.0, 9.0, 5);
    let c = calibrate(&scene).expect("a camera");
    assert_eq!(contradicted(&c), [PriorParameter::Skew]);
    let sigma = c.standard_deviation(Parameter::Skew).expect("estimated");
    assert!(worst(&c, &scene) < 3.9 && (c.camera.skew - 9.0).abs() < 3.9 * sigma, "{:?}", c.camera);
}

#[test]
fn priors_that_hold_are_kept() {
    let mut conflicts = Vec::new();
    for seed in 0..12 {
        for (attitudes, aspect) in [(4, 1.0), (4, 1.002), (2, 1.0), (1, 1.0)] {
            let scene = scene(&ATTITUDES[..attitudes], 600.0 * aspect, 0.0, 100 + seed);
            let c = match calibrate(&scene) {
                // Two pictures whose height ratio does not show that the axis was normal.
                Err(error) if attitudes == 1 && error.is_degenerate() => continue,
                other => other.expect("a camera"),
            };
            assert_eq!(contradicted(&c), [], "seed {seed}, {attitudes} attitudes, aspect {aspect}");
            conflicts.extend(c.priors.iter().filter_map(|p| p.conflict));
        }
    }
    assert!(!conflicts.is_empty() && conflicts.iter().all(|c| *c < 4.5), "{conflicts:?}");
}

#[test]
fn one_attitude_with_pixels_that_are_not_square_is_covered_or_refused() {
    // Nothing tells the aspect ratio of one motion: what the principal point's prior leaves open covers a tenth.
    for (seed, aspect) in [0.91, 0.95, 1.05, 1.09].into_iter().enumerate() {
        let scene = scene(&ATTITUDES[1..2], 600.0 * aspect, 0.0, 40 + seed as u64);
        match calibrate(&scene) {
            Ok(c) => {
                let off = worst(&c, &scene);
                println!("aspect {aspect}: fx {:.1}, {off:.1} deviations off at most", c.camera.fx);
                assert!(off < 4.0, "aspect {aspect}: {off} deviations");
            }
            Err(error) => assert!(error.is_degenerate(), "{error}"),
        }
    }
}

#[test]
fn matches_behind_the_camera_do_not_stop_the_refinement() {
    let scene = scene(&ATTITUDES, 600.0, 0.0, 9);
    let mut pairs: Vec<ImagePair> = scene.pairs();
    let right = calibrate(&scene).expect("a camera");
    // Above the horizon of the second view, and on no line of the homography.
    for (i, pair) in pairs.iter_mut().enumerate() {
        let high = PointMatch { b: Vector2::new(40.0 * i as f64, -200.0), ..pair.matches[0] };
        pair.matches.push(high);
    }
    let names: Vec<String> = (0..2 * pairs.len()).map(|i| i.to_string()).collect();
    let c = calibrate_matches(&names, scene.size, &pairs, &Options::default(), &Silent).expect("a camera");
    assert_eq!(c.method, right.method);
    let sigma = right.standard_deviation(Parameter::Fx).expect("estimated");
    assert!((c.camera.fx - right.camera.fx).abs() < sigma, "{} {}", c.camera.fx, right.camera.fx);
}

#[test]
fn a_motion_that_tilted_is_named_and_widens_no_other() {
    for (seed, tilt_deg) in [[1.0, 0.0], [-3.0, 1.0], [0.0, 5.0], [0.5, 0.5]].into_iter().enumerate() {
        let six = [ATTITUDES[0], ATTITUDES[1], ATTITUDES[2], ATTITUDES[3], [38.0, -50.0, 20.0], [60.0, 15.0, -30.0]];
        let mut scene = scene(&six, 600.0, 0.0, 60 + seed as u64);
        // A hundredth of a degree, and one that is none.
        for (i, motion) in scene.motions.iter_mut().enumerate() {
            let sign = if i % 2 == 0 { 1.0 } else { -1.0 };
            motion.attitude_error_rad = [sign * 2e-4, -sign * 1e-4];
        }
        let right = calibrate_named(&scene);
        scene.motions[2].attitude_error_rad = tilt_deg.map(f64::to_radians);
        let c = calibrate_named(&scene);
        let counts = |c: &Calibration| {
            let of = |w: &Warning| matches!(w, Warning::MotionAttitudeError { from, .. } if from == "4").then_some(());
            (
                c.warnings.iter().filter_map(of).count(),
                c.warnings.iter().filter(|w| w.code() == "motion_strays").count(),
            )
        };
        // Kept with an attitude of its own it cannot tell less than left out; weights converge to a few per cent.
        scene.motions.remove(2);
        let others = calibrate_named(&scene);
        let [sigma, most] = [&c, &others].map(|c| c.standard_deviation(Parameter::Fx).expect("estimated"));
        let [sigma_a, most_a] = [&c, &others].map(|c| c.attitude_sigma_deg);
        let off = worst(&c, &scene);
        println!(
            "{tilt_deg:?} degrees: fx {:.2} +- {sigma:.3} ({most:.3} without), attitudes {sigma_a:.3} ({most_a:.3}), {off:.1} deviations off at most",
            c.camera.fx
        );
        assert_eq!(counts(&right), (0, 0));
        assert!(off < 3.9, "{off} deviations");
        // Seven tenths of a degree may be one of the deviations of all, which then hold it.
        if tilt_deg[0].hypot(tilt_deg[1]) >= 1.0 {
            assert_eq!(counts(&c), (1, 1), "{tilt_deg:?}");
            assert!(sigma < 1.05 * most && sigma_a < 1.05 * most_a, "{sigma} for {most}, {sigma_a} for {most_a}");
        }
    }
}

/// With its pairs named as motions.
fn calibrate_named(scene: &PointScene) -> Calibration {
    let pairs: Vec<ImagePair> = scene.pairs();
    let names: Vec<String> = (0..2 * pairs.len()).map(|i| i.to_string()).collect();
    let motions = (0..pairs.len()).map(|i| (2 * i, 2 * i + 1)).collect();
    let options = Options { pairs: Some(motions), ..Options::default() };
    calibrate_matches(&names, scene.size, &pairs, &options, &Silent).expect("a camera")
}
