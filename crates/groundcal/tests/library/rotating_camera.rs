//! The rotating-camera method from matches: exact data, lenses, degenerate turns, cameras that move.

use groundcal::{
    Error, LensModel, Method, Options, Silent, calibrate_matches,
    geometry::{ImageSize, Intrinsics, Lens},
    pairs::ImagePair,
    result::{Calibration, LensSource, Scene},
    start::Constraint,
    synthetic::{MotionSpec, PointScene, turning_pairs},
};
use nalgebra::{Matrix3, Rotation3, Vector3};

const SIZE: ImageSize = ImageSize { width: 1280, height: 960 };
const K: Intrinsics = Intrinsics { fx: 1010.0, fy: 1004.0, cx: 650.0, cy: 471.0, skew: 0.0 };

/// A view turned by pan (about the image's vertical), tilt (about its horizontal), then roll, degrees.
fn view([pan, tilt, roll]: [f64; 3]) -> Matrix3<f64> {
    let about = |axis: Vector3<f64>, deg: f64| Rotation3::from_scaled_axis(axis * deg.to_radians());
    (about(Vector3::z(), roll) * about(Vector3::x(), tilt) * about(Vector3::y(), pan)).into_inner()
}

/// A pan-tilt head on the spot.
const PAN_TILT: [[f64; 3]; 6] =
    [[0.0, 0.0, 0.0], [20.0, 0.0, 0.0], [-15.0, 12.0, 0.0], [8.0, -15.0, 0.0], [-20.0, -8.0, 0.0], [14.0, 14.0, 0.0]];

fn pairs(views: &[[f64; 3]], lens: &Lens, sigma_px: f64, seed: u64) -> Vec<ImagePair> {
    let rotations: Vec<Matrix3<f64>> = views.iter().map(|v| view(*v)).collect();
    turning_pairs(&rotations, &K, lens, SIZE, 4000, sigma_px, seed)
}

fn calibrate(pairs: &[ImagePair], options: Options) -> Result<Calibration, Error> {
    let images = pairs.iter().map(|p| p.from.max(p.to)).max().unwrap_or(0) + 1;
    let names: Vec<String> = (0..images).map(|i| i.to_string()).collect();
    calibrate_matches(&names, SIZE, pairs, &options, &Silent)
}

fn rotating(constraint: Constraint) -> Options {
    Options { method: Method::Rotating, constraint, lens: LensModel::None, ..Options::default() }
}

fn errors(c: &Calibration) -> [f64; 4] {
    [c.camera.fx - K.fx, c.camera.fy - K.fy, c.camera.cx - K.cx, c.camera.cy - K.cy]
}

fn codes(c: &Calibration) -> Vec<&str> {
    c.warnings.iter().map(|w| w.code()).collect()
}

#[test]
fn exact_matches_of_a_pan_tilt_head_give_the_camera() {
    let pairs = pairs(&PAN_TILT, &Lens::None, 0.0, 1);
    for constraint in [Constraint::Auto, Constraint::ZeroSkew, Constraint::Full] {
        let c = calibrate(&pairs, rotating(constraint)).expect("a camera");
        assert!(errors(&c).iter().all(|e| e.abs() < 1e-6), "{constraint}: {:?}", errors(&c));
        let expected = if constraint == Constraint::Full { constraint } else { Constraint::ZeroSkew };
        assert_eq!((c.method, c.constraint, c.scene), (Method::Rotating, expected, Some(Scene::Directions)));
        assert!(c.motions.iter().all(|m| m.used), "{:?}", c.motions);
        // Pan and tilt by angles of a hand's breadth: the first pair is a pan of 20 degrees.
        assert!((c.motions[0].rotation_deg.expect("a turn") - 20.0).abs() < 1e-6);
    }
}

#[test]
fn error_bars_hold_with_and_without_a_lens() {
    for (lens, model) in [(Lens::None, LensModel::None), (Lens::radial(-0.12, 0.03), LensModel::K1K2)] {
        let (mut within, mut all) = (0, 0);
        for seed in 0..25 {
            let options = Options { lens: model, ..rotating(Constraint::ZeroSkew) };
            let c = calibrate(&pairs(&PAN_TILT, &lens, 0.3, seed), options).expect("a camera");
            let s = &c.standard_deviation;
            for (error, sigma) in errors(&c).into_iter().zip([s.fx, s.fy, s.cx, s.cy]) {
                let sigma = sigma.expect("estimated");
                assert!(sigma < 0.01 * K.fx, "{sigma}");
                all += 1;
                within += usize::from(error.abs() < 2.0 * sigma);
            }
        }
        // 95 % expected; a hundred draws, four by four of one trial.
        assert!(within * 100 >= 85 * all, "{within} of {all}");
    }
}

#[test]
fn a_given_lens_is_undone() {
    let lens = Lens::radial(-0.12, 0.03);
    let options = Options { distortion: lens, ..rotating(Constraint::ZeroSkew) };
    let c = calibrate(&pairs(&PAN_TILT, &lens, 0.0, 4), options).expect("a camera");
    assert!(errors(&c).iter().all(|e| e.abs() < 1e-3), "{:?}", errors(&c));
    assert_eq!(c.camera.distortion.source, LensSource::Given);
}

#[test]
fn turns_about_one_axis_are_refused_by_its_name() {
    let about = |f: fn(f64) -> [f64; 3]| [0.0, 12.0, 24.0, -10.0].map(f);
    for (views, named, free) in [
        (about(|a| [a, 0.0, 0.0]), "(a pan)", "fy"),
        (about(|a| [0.0, a, 0.0]), "(a tilt)", "fx"),
        (about(|a| [0.0, 0.0, a]), "(a roll)", "focal length"),
    ] {
        let error = calibrate(&pairs(&views, &Lens::None, 0.3, 2), rotating(Constraint::Auto)).expect_err("one axis");
        let text = error.to_string();
        assert!(matches!(error, Error::Undetermined { .. }) && text.contains(named) && text.contains(free), "{text}");
    }
    // Square pixels make up for a pan.
    let pan = about(|a| [a, 0.0, 0.0]);
    let options = Options { aspect: Some(K.fy / K.fx), ..rotating(Constraint::Square) };
    let c = calibrate(&pairs(&pan, &Lens::None, 0.0, 2), options).expect("a camera");
    assert!(errors(&c)[0].abs() < 1e-6, "{:?}", errors(&c));
}

#[test]
fn a_camera_that_moves_is_refused_or_warned_of() {
    // 0.2 m of offset over a floor 3 m away: near enough to rotations to give an answer.
    let near = PointScene { sigma_px: 0.3, ..PointScene::nominal(1) };
    let c = calibrate(&near.pairs(), Options { lens: LensModel::None, ..rotating(Constraint::ZeroSkew) })
        .expect("a camera, wrong");
    assert!(codes(&c).contains(&"not_rotations"), "{:?}", codes(&c));
    assert!(c.fit.variance_inflation > 10.0);
    // 3 m of offset: no rotation at all.
    let far = PointScene {
        motions: near
            .motions
            .iter()
            .map(|m| MotionSpec::about_axis(m.pitch_down_rad, m.roll_rad, m.turn_rad, 3.0, 3.0))
            .collect(),
        ..near
    };
    let pairs: Vec<ImagePair> = far.pairs();
    let error = calibrate(&pairs, rotating(Constraint::ZeroSkew)).expect_err("moved");
    assert!(matches!(error, Error::NoUsableMotion { .. }) && error.to_string().contains("moved"), "{error}");
}

#[test]
fn options_without_meaning_are_refused() {
    let pairs = pairs(&PAN_TILT, &Lens::None, 0.3, 1);
    for options in [
        Options { attitude_sigma_deg: Some(1.0), ..rotating(Constraint::Auto) },
        Options { height_sigma: Some(0.1), ..rotating(Constraint::Auto) },
    ] {
        assert!(matches!(calibrate(&pairs, options), Err(Error::InvalidOption(_))));
    }
}
