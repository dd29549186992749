//! The joint refinement against truth: exact data, the Cramér-Rao bound, full turns, panoramas, screw motions, axes that vary.

use crate::calibrate::calibrate_matches;
use crate::calibrate::{LensModel, MotionModel, Options};
use crate::error::Error;
use crate::geometry::attitude::{attitude_rotation, rotation_cam_from_world};
use crate::geometry::constraint::Constraint;
use crate::geometry::frame::Frame;
use crate::geometry::intrinsics::Intrinsics;
use crate::geometry::lens::Lens;
use crate::geometry::size::ImageSize;
use crate::numerics::levenberg_marquardt::LmOptions;
use crate::observer::Silent;
use crate::pairs::correspondence::ImagePair;
use crate::refine::adjust::adjust;
use crate::refine::blocks::{BundleOptions, CameraState, CameraUnknowns, FrameState, GroupState, State};
use crate::refine::residual::SceneModel;
use crate::refine::tracks::{Kind, Observation, Track};
use crate::result::calibration::Calibration;
use crate::result::camera::Method;
use crate::synthetic::bound::HeightModel;
use crate::synthetic::points::{MotionSpec, PointScene, turning_pairs};
use nalgebra::{Matrix3, Vector2};
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Mcg;
use rayon::prelude::*;

fn names(count: usize) -> Vec<String> {
    (0..count).map(|i| i.to_string()).collect()
}

fn calibrate(scene: &PointScene, options: &Options) -> Result<Calibration, Error> {
    let pairs: Vec<ImagePair> = scene.pairs();
    calibrate_matches(&names(2 * pairs.len()), scene.size, &pairs, options, &Silent)
}

#[test]
fn a_full_turn_on_the_spot_closes_and_gives_lens_and_focal_length() {
    // A level camera before a room: points above and below the horizon.
    let (size, k) = (ImageSize::new(512, 384), Intrinsics::square(420.0, 252.0, 195.0));
    let lens = Lens::radial(-0.15, 0.02);
    let rotations: Vec<Matrix3<f64>> =
        (0..18).map(|i| rotation_cam_from_world(0.05, 0.02, (20.0 * f64::from(i)).to_radians())).collect();
    let mut errors = Vec::new();
    let mut alone = Vec::new();
    for seed in 0..3 {
        let pairs = turning_pairs(&rotations, &k, &lens, size, 1500, 0.3, seed);
        let c = calibrate_matches(&names(18), size, &pairs, &Options::default(), &Silent).expect("a camera");
        assert_eq!(c.scene, Some(crate::result::Scene::Directions));
        assert_eq!(c.attitudes.len(), 1, "one attitude");
        let sigma = c.standard_deviation.fx.expect("estimated");
        let error = c.camera.fx - k.fx;
        assert!(error.abs() < 4.0 * sigma, "seed {seed}: {error} +- {sigma}");
        errors.push((error / k.fx).abs());
        let last = c.views.iter().find(|v| v.image == "17").expect("the last view");
        assert!((last.yaw_deg + 20.0).abs() < 0.1, "the turn is closed: {}", last.yaw_deg);
        // Pairs by themselves, the lens ignored.
        let linear = Options { method: Method::Linear, lens: LensModel::None, ..Options::default() };
        if let Ok(c) = calibrate_matches(&names(18), size, &pairs, &linear, &Silent) {
            alone.push((c.camera.fx / k.fx - 1.0).abs());
        }
    }
    println!("relative errors of f: {errors:.5?}; pairs alone, lens ignored: {alone:.4?}");
    assert!(errors.iter().all(|e| *e < 0.002), "{errors:?}");
    assert!(alone.iter().all(|e| *e > 0.02), "{alone:?}");
}

#[test]
fn four_views_of_a_panorama_about_different_axes() {
    let (size, k) = (ImageSize::new(1024, 768), Intrinsics::square(900.0, 505.0, 390.0));
    let angles = [(0.0, 0.0, 0.0), (0.05, 0.1, 0.35), (0.3, -0.2, 0.1), (-0.25, 0.15, 0.3)];
    let rotations: Vec<Matrix3<f64>> = angles.iter().map(|(p, r, y)| rotation_cam_from_world(*p, *r, *y)).collect();
    for lens in [Lens::None, Lens::radial(-0.1, 0.0)] {
        for seed in 0..5 {
            let pairs = turning_pairs(&rotations, &k, &lens, size, 8000, 0.3, seed);
            let c = calibrate_matches(&names(4), size, &pairs, &Options::default(), &Silent).expect("a camera");
            assert_eq!(c.scene, Some(crate::result::Scene::Directions));
            assert_eq!(c.views.len(), 4, "all views are used");
            let (error, sigma) = (c.camera.fx - k.fx, c.standard_deviation.fx.expect("estimated"));
            println!("{lens:?} seed {seed}: f off by {error:.2} +- {sigma:.2} px");
            assert!(error.abs() < 0.005 * k.fx && error.abs() < 4.0 * sigma, "{error} +- {sigma}");
        }
    }
}

#[test]
fn two_images_of_a_screw_motion_with_a_long_lens() {
    let size = ImageSize::new(1280, 960);
    let f = 1.3 * size.width as f64;
    let errors: Vec<f64> = (0..20)
        .map(|seed| {
            let mut motion = MotionSpec::about_axis(40f64.to_radians(), 0.1, 30f64.to_radians(), 0.3, 3.0);
            motion.height_ratio = 1.2;
            let scene = PointScene {
                intrinsics: Intrinsics::square(f, 639.5, 479.5),
                motions: vec![motion],
                matches: 1000,
                sigma_px: 0.1,
                ..PointScene::nominal(seed)
            };
            // Heights that differ may as well be a tilt: nothing in two pictures tells the two apart.
            let options = Options { constraint: Constraint::Focal, ..Options::default() };
            assert!(calibrate(&scene, &options).is_err());
            let options = Options { motion: MotionModel::PlaneNormal, ..options };
            let c = calibrate(&scene, &options).expect("a camera");
            let sigma = c.standard_deviation.fx.expect("estimated");
            assert!((c.camera.fx - f).abs() < 4.0 * sigma, "{} +- {sigma}", c.camera.fx);
            (c.camera.fx / f - 1.0).abs()
        })
        .collect();
    println!("relative errors of f: {errors:.5?}");
    assert!(errors.iter().all(|e| *e < 0.005), "{errors:?}");
}

#[test]
fn axes_that_stray_by_two_degrees_are_covered_by_the_error_bars() {
    const TRIALS: u64 = 200;
    let outcomes: Vec<Option<(f64, f64)>> = (0..TRIALS)
        .into_par_iter()
        .map(|seed| {
            let mut rng = Pcg64Mcg::seed_from_u64(seed);
            let mut stray = || -> f64 {
                let normal: f64 = StandardNormal.sample(&mut rng);
                normal * 2f64.to_radians() / 2f64.sqrt()
            };
            let motions: Vec<MotionSpec> = (0..8)
                .map(|i| {
                    let (pitch, roll) = (35.0 + 4.0 * f64::from(i), -40.0 + 11.0 * f64::from(i));
                    let turn = if i % 2 == 0 { 30f64 } else { -40f64 };
                    let mut m =
                        MotionSpec::about_axis(pitch.to_radians(), roll.to_radians(), turn.to_radians(), 0.3, 2.0);
                    m.attitude_error_rad = [stray(), stray()];
                    m
                })
                .collect();
            let scene = PointScene { motions, matches: 300, sigma_px: 0.3, ..PointScene::nominal(seed) };
            let c = calibrate(&scene, &Options::default()).ok()?;
            Some((c.camera.fx - scene.intrinsics.fx, c.standard_deviation.fx?))
        })
        .collect();
    let answered: Vec<(f64, f64)> = outcomes.iter().flatten().copied().collect();
    let within = answered.iter().filter(|(e, s)| e.abs() <= 3.0 * s).count();
    let rms = (answered.iter().map(|(e, _)| e * e).sum::<f64>() / answered.len() as f64).sqrt();
    let stated = (answered.iter().map(|(_, s)| s * s).sum::<f64>() / answered.len() as f64).sqrt();
    println!(
        "{} of {TRIALS} answered, {within} within 3 sd; rms error {rms:.1} px, stated {stated:.1} px",
        answered.len()
    );
    assert!(answered.len() as f64 >= 0.95 * TRIALS as f64);
    assert!(within as f64 >= 0.95 * answered.len() as f64);
}

#[test]
fn four_motions_of_one_attitude_do_not_determine_the_principal_point() {
    let motion = |turn: f64| MotionSpec::about_axis(0.8, 0.2, turn.to_radians(), 0.3, 2.0);
    let scene = |seed| PointScene {
        motions: [20.0, 35.0, -30.0, 50.0].map(motion).to_vec(),
        matches: 500,
        sigma_px: 0.1,
        ..PointScene::nominal(seed)
    };
    for seed in 0..10 {
        for constraint in [Constraint::Full, Constraint::ZeroSkew, Constraint::Square] {
            let options = Options { constraint, ..Options::default() };
            assert!(calibrate(&scene(seed), &options).is_err(), "{constraint:?} is refused");
        }
        let c = calibrate(&scene(seed), &Options::default()).expect("held by the prior");
        let sd = &c.standard_deviation;
        let (cx, cy) = (sd.cx.expect("estimated"), sd.cy.expect("estimated"));
        assert!(cx.hypot(cy) > 20.0, "the prior's width is left somewhere: {cx}, {cy}");
        assert!(c.warnings.iter().any(|w| w.code() == "single_attitude"));
        let fx = sd.fx.expect("estimated");
        assert!((c.camera.fx - 1000.0).abs() < 3.5 * fx, "{} +- {fx}", c.camera.fx);
    }
}

/// Points of motions as the refinement takes them, and the true state.
fn bundle_of(scene: &PointScene) -> (Frame, Vec<Track>, State) {
    let frame = Frame::new(scene.size, None);
    let seen = |frame: usize, pixel: Vector2<f64>| Observation::new(frame, pixel, scene.sigma_px.max(1e-4));
    let tracks = scene
        .pairs()
        .iter()
        .flat_map(|p| p.matches.clone().into_iter().map(|m| (p.from, p.to, m)))
        .map(|(a, b, m)| Track { kind: Kind::Point, observations: vec![seen(a, m.a), seen(b, m.b)] })
        .collect();
    let camera = CameraState::new(&scene.intrinsics, &Lens::radial(0.0, 0.0), &frame);
    let groups = scene
        .motions
        .iter()
        .map(|m| GroupState { attitude: attitude_rotation(m.pitch_down_rad, m.roll_rad), ln_height: 0.0 })
        .collect();
    let frames = scene.motions.iter().enumerate().flat_map(|(group, m)| {
        m.views().map(|v| FrameState {
            group,
            delta_rad: [0.0; 2],
            yaw_rad: v.yaw_rad,
            // The unit of length is the height of the first view.
            position: v.centre.xy() / m.height,
            ln_height_ratio: (v.centre.z / m.height).ln(),
            departure: crate::refine::blocks::Departure::default(),
        })
    });
    (frame, tracks, State::of_one_camera(camera, groups, frames.collect()))
}

/// Zero skew and no lens to estimate, exact axes and heights, every residual in full.
fn exact(frame: Frame) -> BundleOptions {
    let camera = CameraUnknowns { lens_free: Vec::new(), ..CameraUnknowns::new(frame, [1.15, 0.86]) };
    BundleOptions {
        attitude_sigma_rad: Some(0.0),
        height_sigma: Some(0.0),
        huber: 1e6,
        lm: LmOptions { max_iterations: 60, ..LmOptions::default() },
        ..BundleOptions::new(vec![camera])
    }
}

#[test]
fn exact_matches_come_back_from_a_start_far_off() {
    let scene = PointScene { sigma_px: 0.0, ..PointScene::nominal(3) };
    let (frame, tracks, truth) = bundle_of(&scene);
    let mut start = truth.clone();
    start.cameras[0].matrix[0] += 0.2;
    start.cameras[0].matrix[2] -= 0.05;
    for (i, g) in start.groups.iter_mut().enumerate() {
        g.attitude = g.turned([0.05, -0.04 * (i as f64 - 1.0)]);
    }
    let found = adjust(SceneModel::Floor, &tracks, vec![start], &exact(frame)).expect("refined");
    let error = (found.state.cameras[0].matrix - truth.cameras[0].matrix).norm();
    assert!(error < 1e-9, "{error}");
    for (v, t) in found.state.frames.iter().zip(&truth.frames) {
        // The heading of the world is that of the first view, wherever it started.
        assert!((v.position.norm() - t.position.norm()).abs() < 1e-8);
    }
}

#[test]
fn the_stated_covariance_is_the_cramer_rao_bound() {
    // Two derivations of one number: Euclidean points and dense elimination there, homogeneous points and rotations here.
    for (height_sigma, model) in [(0.0, HeightModel::Constant), (10.0, HeightModel::Free)] {
        let scene = PointScene { sigma_px: 0.02, ..PointScene::nominal(5) };
        let (frame, tracks, truth) = bundle_of(&scene);
        let options = BundleOptions { height_sigma: Some(height_sigma), ..exact(frame) };
        let found = adjust(SceneModel::Floor, &tracks, vec![truth], &options).expect("refined");
        let bound = scene.bound(Constraint::ZeroSkew, model).expect("determined");
        // The noise is estimated; the weights have converged when it agrees with them to half a per cent.
        let noise = found.variance_factors[Kind::Point as usize];
        let student = found.degrees_of_freedom / (found.degrees_of_freedom - 2.0);
        let ln_fx = found.cameras[0].covariance[(0, 0)] / (noise * student);
        let ratio = ln_fx * scene.intrinsics.fx.powi(2) / bound[(0, 0)];
        assert!((ratio - 1.0).abs() < 6e-3, "{model:?}: {ratio}");
        let cy = found.cameras[0].covariance[(3, 3)] * frame.scale_px.powi(2) / (noise * student);
        assert!((cy / bound[(3, 3)] - 1.0).abs() < 6e-3, "{model:?}: {cy} {}", bound[(3, 3)]);
    }
}

#[test]
fn no_start_no_answer_and_no_panic() {
    let (frame, tracks, truth) = bundle_of(&PointScene::nominal(1));
    let options = exact(frame);
    assert!(adjust(SceneModel::Floor, &tracks, Vec::new(), &options).is_err());
    let mut foreign = tracks.clone();
    foreign[3].observations[1].frame = 99;
    let refused = adjust(SceneModel::Floor, &foreign, vec![truth.clone()], &options);
    assert!(matches!(refused, Err(Error::InvalidInput(text)) if text.contains("track 3")));
    let mut broken = truth;
    broken.cameras[0].matrix[0] = f64::NAN;
    assert!(adjust(SceneModel::Floor, &tracks, vec![broken], &options).is_err());
}
