//! What is said of an answer: whether to trust it, and why not more.

use groundcal::{
    MotionModel, Options, Silent, calibrate_matches,
    geometry::{ImageSize, Intrinsics, Lens, rotation_cam_from_world},
    pairs::{ImagePair, PointMatch},
    result::{Calibration, Verdict, VerdictLevel},
    synthetic::{MotionSpec, PointScene, turning_pairs},
};
use nalgebra::{Matrix3, Vector2, Vector3};
use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Mcg;

fn names(count: usize) -> Vec<String> {
    (0..count).map(|i| i.to_string()).collect()
}

fn verdict(c: &Calibration) -> &Verdict {
    c.verdict.as_ref().expect("every answer has one")
}

fn of_motions(motions: Vec<MotionSpec>, seed: u64) -> Calibration {
    let scene = PointScene { motions, matches: 300, sigma_px: 0.2, ..PointScene::nominal(seed) };
    let pairs: Vec<ImagePair> = scene.pairs();
    calibrate_matches(&names(2 * pairs.len()), scene.size, &pairs, &Options::default(), &Silent).expect("a camera")
}

#[test]
fn several_attitudes_that_agree_are_trustworthy_and_one_is_usable() {
    let motion = |i: usize, varied: bool| {
        let i = if varied { i as f64 } else { 0.0 };
        MotionSpec::about_axis(0.6 + 0.07 * i, -0.5 + 0.2 * i, 0.4, 0.3, 1.0)
    };
    for seed in 0..3 {
        let several = of_motions((0..6).map(|i| motion(i, true)).collect(), seed);
        let v = verdict(&several);
        assert_eq!((v.level, v.checked, v.reasons.as_slice()), (VerdictLevel::Trustworthy, true, &[][..]));
        let one = of_motions((0..4).map(|i| motion(i, false)).collect(), seed);
        let of_one = verdict(&one);
        assert_eq!((of_one.level, of_one.checked), (VerdictLevel::Usable, true), "{of_one:?}");
        assert!(of_one.reasons.iter().any(|r| r.code == "single_attitude" && !r.message.is_empty()), "{of_one:?}");
    }
}

/// A camera that turns about the vertical before things at distances of 1 to 4 whose lens is ahead of the axis.
fn turning_off_axis(ahead: f64, seed: u64) -> (ImageSize, Intrinsics, Vec<ImagePair>) {
    let (size, k) = (ImageSize::new(640, 480), Intrinsics::square(520.0, 317.0, 243.0));
    let rotations: Vec<Matrix3<f64>> =
        (0..12).map(|i| rotation_cam_from_world(0.05, 0.02, (30.0 * f64::from(i)).to_radians())).collect();
    if ahead == 0.0 {
        let pairs = turning_pairs(&rotations, &k, &Lens::None, size, 4000, 0.2, seed);
        return (size, k, pairs);
    }
    let mut rng = Pcg64Mcg::seed_from_u64(seed);
    let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
    let directions: Vec<Vector3<f64>> = (0..4000).map(|_| Vector3::from_fn(|_, _| normal()).normalize()).collect();
    let points: Vec<Vector3<f64>> = directions.iter().map(|d| d * rng.random_range(1.0..4.0)).collect();
    let lens_from_axis = Vector3::new(0.0, 0.0, ahead);
    let mut seen = |r: &Matrix3<f64>, p: &Vector3<f64>| {
        let x = r * p - lens_from_axis;
        let noise = Vector2::from_fn(|_, _| -> f64 { StandardNormal.sample(&mut rng) }) * 0.2;
        let pixel = (k.matrix() * x / x.z).xy() + noise;
        let inside = pixel.x >= 0.0 && pixel.y >= 0.0 && pixel.x <= 639.0 && pixel.y <= 479.0;
        (x.z > 0.2 && inside).then_some(pixel)
    };
    let views: Vec<Vec<Option<Vector2<f64>>>> =
        rotations.iter().map(|r| points.iter().map(|p| seen(r, p)).collect()).collect();
    let pairs = (0..12).map(|i| (i, (i + 1) % 12)).map(|(from, to)| {
        let both = views[from].iter().zip(&views[to]);
        let matches = both.filter_map(|(a, b)| Some(PointMatch { a: (*a)?, b: (*b)?, sigma_px: 1.0 })).collect();
        ImagePair { from, to, matches }
    });
    (size, k, pairs.collect())
}

#[test]
fn a_turn_on_the_spot_allows_for_a_lens_off_the_axis_unless_somebody_vouches_for_it() {
    let (size, _, pairs) = turning_off_axis(0.0, 1);
    let asked = |motion| {
        let options = Options { motion, ..Options::default() };
        calibrate_matches(&names(12), size, &pairs, &options, &Silent).expect("a camera")
    };
    for (motion, code, percent) in [
        (MotionModel::Auto, "lens_may_be_off_axis", 0.5..2.0),
        (MotionModel::Turning, "lens_on_axis_assumed", 0.0..0.05),
    ] {
        let c = asked(motion);
        let v = verdict(&c);
        assert_eq!((v.level, v.checked), (VerdictLevel::Usable, true), "{v:?}");
        assert!(v.reasons.iter().any(|r| r.code == code), "{v:?}");
        let of_fx = 100.0 * c.standard_deviation.fx.expect("estimated") / c.camera.fx;
        assert!(percent.contains(&of_fx), "{of_fx} %");
    }
}

#[test]
fn parallax_of_a_lens_off_the_axis_is_named_and_nothing_is_where_there_is_none() {
    let options = Options { motion: MotionModel::Turning, ..Options::default() };
    let named = |ahead: f64, seed: u64| {
        let (size, k, pairs) = turning_off_axis(ahead, seed);
        let c = calibrate_matches(&names(12), size, &pairs, &options, &Silent).expect("a camera");
        let (error, sigma) = (c.camera.fx - k.fx, c.standard_deviation.fx.expect("estimated"));
        let codes: Vec<&str> = c.warnings.iter().map(|w| w.code()).collect();
        println!("ahead {ahead}, seed {seed}: {error:.3} +- {sigma:.3} {codes:?}");
        // 1 % of an axis's distance moves f by 20 deviations of the matching noise: it is the allowance that covers it.
        assert!(error.abs() < 4.0 * sigma, "ahead {ahead}, seed {seed}: {error} +- {sigma}");
        c.warnings.iter().any(|w| w.code() == "lens_off_axis")
    };
    let far = (0..8).filter(|&seed| named(0.0, seed)).count();
    assert!(far <= 1, "one in a thousand by chance: {far} of 8");
    let near = (0..8).filter(|&seed| named(0.01, seed)).count();
    assert_eq!(near, 8);
}

#[test]
fn motions_about_axes_far_off_the_normal_are_no_answer() {
    // Ten motions, each with its second attitude off by up to so many radians about each axis.
    let calibrated = |most: f64, seed: u64| {
        let mut rng = Pcg64Mcg::seed_from_u64(seed);
        let mut motion = |i: usize| MotionSpec {
            attitude_error_rad: [rng.random_range(-most..most), rng.random_range(-most..most)],
            ..MotionSpec::about_axis(0.85 + 0.03 * i as f64, -0.5 + 0.1 * i as f64, 0.5, 0.3, 1.0)
        };
        let motions: Vec<MotionSpec> = (0..10).map(&mut motion).collect();
        let scene = PointScene { motions, matches: 300, sigma_px: 0.2, ..PointScene::nominal(seed) };
        let pairs: Vec<ImagePair> = scene.pairs();
        let options = Options {
            pairs: Some((0..10).map(|i| (2 * i, 2 * i + 1)).collect()),
            motion: MotionModel::PlaneNormal,
            ..Options::default()
        };
        calibrate_matches(&names(20), scene.size, &pairs, &options, &Silent)
    };
    let mut refused = 0;
    for seed in 0..4 {
        // Some come right once the two worst of the ten are left out; the others are refused for what is wrong with them.
        if let Err(error) = calibrated(0.25, seed) {
            assert!(
                error.is_degenerate() && error.to_string().contains("its attitude would vary by"),
                "{seed}: {error}"
            );
            refused += 1;
        }
        // Half a degree a picture is a robot that rocks.
        let slight = calibrated(0.02, seed).unwrap_or_else(|error| panic!("{seed}: {error}"));
        assert!((0.2..0.8).contains(&slight.attitude_sigma_deg), "{}", slight.attitude_sigma_deg);
    }
    assert!(refused >= 2, "{refused} of 4");
}

#[test]
fn a_focal_length_that_pictures_state_checks_the_answer_and_makes_none_of_it() {
    let scene = PointScene { matches: 300, sigma_px: 0.2, ..PointScene::nominal(2) };
    let pairs: Vec<ImagePair> = scene.pairs();
    let with = |stated: Option<f64>| {
        let options = Options { stated_focal_px: stated.map(|factor| factor * 1000.0), ..Options::default() };
        calibrate_matches(&names(2 * pairs.len()), scene.size, &pairs, &options, &Silent).expect("a camera")
    };
    let unsaid = with(None);
    for (factor, expected) in [(0.94, false), (1.06, false), (0.75, true), (1.4, true)] {
        let c = with(Some(factor));
        assert_eq!(c.camera.fx.to_bits(), unsaid.camera.fx.to_bits());
        let said = verdict(&c).reasons.iter().any(|r| r.code == "focal_length_unexpected");
        assert_eq!((said, verdict(&c).level == VerdictLevel::Unchecked), (expected, expected), "{factor}");
    }
}
