//! A calibration that is written and read is the same calibration.

#![allow(clippy::expect_used, clippy::panic)] // a test may end in a panic

use groundcal::{
    LensModel, Method, Options, Plain, Remedy, Silent, Wording, calibrate_matches,
    floor::placed,
    geometry::{Constraint, ImageSize, Intrinsics, Lens, rotation_cam_from_world},
    pairs::ImagePair,
    result::{Calibration, Evidence, Parameter, Scene, ViewParameter},
    synthetic::{PointScene, turning_pairs},
};
use groundcal_io::{export::json, import::groundcal_json::parse};
use nalgebra::Matrix3;

fn names(count: usize) -> Vec<String> {
    (0..count).map(|i| format!("{i}.jpg")).collect()
}

fn of_floor(scene: &PointScene, options: Options) -> Calibration {
    let pairs: Vec<ImagePair> = scene.pairs();
    calibrate_matches(&names(2 * pairs.len()), scene.size, &pairs, &options, &Silent).expect("a camera")
}

fn of_directions(options: Options) -> Calibration {
    let (size, k) = (ImageSize::new(512, 384), Intrinsics::square(420.0, 252.0, 195.0));
    let view = |i: i32| rotation_cam_from_world(0.05 * f64::from(i % 3), 0.02, (20.0 * f64::from(i)).to_radians());
    let rotations: Vec<Matrix3<f64>> = (0..6).map(view).collect();
    let pairs = turning_pairs(&rotations, &k, &Lens::None, size, 3000, 0.3, 0);
    calibrate_matches(&names(6), size, &pairs, &options, &Silent).expect("a camera")
}

#[test]
fn what_is_written_is_read_back() {
    let scene = PointScene { matches: 300, ..PointScene::nominal(0) };
    let with = |method, constraint, lens| Options { method, constraint, lens, ..Options::default() };
    let joint = of_floor(&scene, with(Method::Joint, Constraint::Auto, LensModel::K1K2));
    let given = Options { distortion: Lens::radial(0.01, 0.0), method: Method::Linear, ..Options::default() };
    let one = PointScene { motions: scene.motions[..1].to_vec(), ..scene.clone() };
    let all = [
        ("joint", joint.clone()),
        ("metres", joint.with_camera_height(1.37).expect("a height")),
        ("square", of_floor(&scene, with(Method::Joint, Constraint::Square, LensModel::K1))),
        ("linear", of_floor(&scene, with(Method::Linear, Constraint::ZeroSkew, LensModel::None))),
        ("given", of_floor(&scene, given)),
        ("one motion", of_floor(&one, Options::default())),
        ("directions", of_directions(Options::default())),
        ("rotating", of_directions(with(Method::Rotating, Constraint::Auto, LensModel::K1K2))),
    ];
    for (name, c) in all {
        println!("{name}: {:?}", c.warnings);
        let text = json(&c, &Plain).expect("JSON");
        let again = parse(&text).unwrap_or_else(|e| panic!("{name}: {e}"));
        let mut without_evidence = c.clone();
        without_evidence.evidence = Evidence::default();
        assert_eq!(again, without_evidence, "{name}");
        assert_eq!(json(&again, &Plain).expect("JSON"), text, "{name}");
        // What other commands need is there.
        assert_eq!(placed(&again, 1.0).is_ok(), c.scene != Some(Scene::Directions), "{name}");
        let (fx, sigma) = (Parameter::Fx, c.standard_deviation(Parameter::Fx).expect("estimated"));
        assert!((c.covariance.get(fx, fx).sqrt() / sigma - 1.0).abs() < 1e-9, "{name}");
        for v in &again.views {
            let seen = v.covariance.get(ViewParameter::Camera(fx), ViewParameter::Camera(fx)).sqrt();
            assert!((seen / sigma - 1.0).abs() < 1e-6, "{name}: {seen} {sigma}");
            let pitch = v.covariance.get(ViewParameter::PitchDownRad, ViewParameter::PitchDownRad).sqrt().to_degrees();
            assert!((pitch - v.pitch_down_sigma_deg).abs() <= 1e-9 * pitch, "{name}");
        }
        assert!(again.motions.iter().all(|m| m.diagnosis.is_some() == m.used), "{name}");
    }
}

/// A front end with words of its own.
struct Loud;
impl Wording for Loud {
    fn remedy(&self, remedy: &Remedy) -> String {
        remedy.code().to_uppercase()
    }
}

#[test]
fn the_front_end_words_the_messages_and_nothing_else() {
    let scene = PointScene { matches: 300, ..PointScene::nominal(0) };
    let c = of_floor(&scene, Options { lens: LensModel::None, ..Options::default() });
    let (plain, loud) = (json(&c, &Plain).expect("JSON"), json(&c, &Loud).expect("JSON"));
    assert!(loud.contains("ESTIMATE_LENS") && !plain.contains("ESTIMATE_LENS"));
    assert_eq!(parse(&plain), parse(&loud));
    let keys = |text: &str| -> Vec<String> {
        text.lines().filter_map(|l| Some(l.split_once("\": ")?.0.to_string())).collect()
    };
    assert_eq!(keys(&plain), keys(&loud), "the order of the keys");
    assert!(plain.starts_with("{\n  \"schema_version\": 6,\n  \"format_version\": 2,\n  \"verdict\""));
}
