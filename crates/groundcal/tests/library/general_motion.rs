//! Any motion before one plane.

use groundcal::{
    Error, LensModel, MotionModel, Options, Silent, calibrate_matches,
    geometry::{Constraint, Intrinsics, Lens},
    result::{Calibration, MotionKind, Parameter},
    synthetic::PlaneViewScene,
};
use rayon::prelude::*;

fn calibrated(scene: &PlaneViewScene, motion: MotionModel) -> Result<Calibration, Error> {
    let names: Vec<String> = (0..scene.views).map(|i| format!("{i}.png")).collect();
    calibrate_matches(&names, scene.size, &scene.pairs(), &Options { motion, ..Options::default() }, &Silent)
}

/// Errors of fx, fy, cx and cy in deviations.
fn deviations(c: &Calibration, scene: &PlaneViewScene) -> [f64; 4] {
    let k = &scene.intrinsics;
    let truth = [(Parameter::Fx, k.fx), (Parameter::Fy, k.fy), (Parameter::Cx, k.cx), (Parameter::Cy, k.cy)];
    truth.map(|(p, value)| (c.value(p) - value) / c.standard_deviation(p).expect("estimated"))
}

/// Scenes of focal lengths from 0.6 to 4 widths, with lenses that barrel and pincushion.
fn scenes(views: usize, count: u64) -> Vec<PlaneViewScene> {
    let scene = |seed: u64| {
        let part = |k: u64| ((seed * 7 + k * 13) % 11) as f64 / 10.0;
        let f = 1280.0 * 0.6 * (4.0f64 / 0.6).powf(part(0));
        let k1 = -0.2 + 0.25 * part(1);
        PlaneViewScene {
            views,
            intrinsics: Intrinsics::square(f, 629.5 + 20.0 * part(2), 489.5 - 20.0 * part(3)),
            lens: Lens::radial(k1, 0.0),
            ..PlaneViewScene::nominal(seed)
        }
    };
    (1..=count).map(scene).collect()
}

#[test]
fn hand_held_views_of_a_plane_give_the_camera_within_its_error_bars() {
    // Of 40 scenes with four intrinsics each one number may lie beyond 3 deviations, one in 370 of a normal variable.
    let mut beyond = 0;
    for views in [5, 10] {
        let answers: Vec<_> =
            scenes(views, 20).into_par_iter().map(|scene| (calibrated(&scene, MotionModel::General), scene)).collect();
        for (answer, scene) in answers {
            let c = answer.unwrap_or_else(|e| panic!("{views} views, seed {}: {e}", scene.seed));
            assert_eq!((c.motion, c.attitudes.len(), c.views.len()), (Some(MotionKind::General), 0, views));
            let z = deviations(&c, &scene);
            assert!(z.iter().all(|z| z.abs() < 4.0), "{views} views, seed {}: {z:?}", scene.seed);
            beyond += z.iter().filter(|z| z.abs() > 3.0).count();
        }
    }
    assert!(beyond <= 2, "{beyond} of 160 beyond 3 deviations");
}

#[test]
fn general_motion_is_found_where_nobody_names_it() {
    for scene in scenes(8, 4) {
        let c = calibrated(&scene, MotionModel::Auto).expect("a camera");
        assert_eq!(c.motion, Some(MotionKind::General), "seed {}", scene.seed);
        assert!(deviations(&c, &scene).iter().all(|z| z.abs() < 4.0));
    }
}

#[test]
fn what_general_motion_cannot_tell_is_refused_by_name() {
    let refused = |scene: PlaneViewScene| {
        let error = calibrated(&scene, MotionModel::General).expect_err("nothing to be told");
        assert!(error.is_degenerate(), "{error}");
        error.to_string()
    };
    let nominal = PlaneViewScene::nominal(3);
    let two = refused(PlaneViewScene { views: 2, ..nominal.clone() });
    assert!(two.contains("joins 2 images"), "{two}");
    let frontal = refused(PlaneViewScene { tilt_deg: [0.0, 0.01], ..nominal.clone() });
    assert!(frontal.contains("straight at the plane"), "{frontal}");
}

#[test]
fn views_tilted_alike_are_refused_by_name() {
    // Turned about the plane's normal: the plane is seen alike by all.
    let scene = PlaneViewScene { tilt_deg: [35.0; 2], turn_deg: [20.0; 2], ..PlaneViewScene::nominal(5) };
    let error = calibrated(&scene, MotionModel::General).expect_err("alike");
    assert!(error.to_string().contains("tilted alike"), "{error}");
}

/// Without lens and priors, the covariance that is stated is Cramér and Rao's, and the errors are as large as it says.
#[test]
fn general_motion_reaches_the_cramer_rao_bound() {
    let options = Options {
        motion: MotionModel::General,
        constraint: Constraint::ZeroSkew,
        lens: LensModel::None,
        ..Options::default()
    };
    let trial = |seed: u64| {
        let scene = PlaneViewScene { views: 8, tilt_deg: [10.0, 50.0], ..PlaneViewScene::nominal(seed) };
        let bound = scene.bound(Constraint::ZeroSkew).expect("determined")[(0, 0)];
        let names: Vec<String> = (0..scene.views).map(|i| i.to_string()).collect();
        let c = calibrate_matches(&names, scene.size, &scene.pairs(), &options, &Silent)
            .unwrap_or_else(|e| panic!("seed {seed}: {e}"));
        let stated = c.standard_deviation(Parameter::Fx).expect("estimated").powi(2);
        ((c.camera.fx - scene.intrinsics.fx).powi(2) / bound, stated / bound)
    };
    let all: Vec<(f64, f64)> = (0..80).into_par_iter().map(trial).collect();
    let n = all.len() as f64;
    let (squares, stated) = (all.iter().map(|t| t.0).sum::<f64>() / n, all.iter().map(|t| t.1).sum::<f64>() / n);
    println!("RMSE over the bound {:.3}, stated deviation over it {:.3}", squares.sqrt(), stated.sqrt());
    // Of 80 squares of normal variables the mean lies within 1 +- 3 (2 / 80)^(1/2).
    assert!((0.5..1.5).contains(&squares), "{squares}");
    assert!((0.8..1.35).contains(&stated), "{stated}");
}
