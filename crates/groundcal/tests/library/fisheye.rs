//! A lens of a model that sees to both sides and behind: given, its pixels pass through rays; not given, it is found.

use groundcal::{
    Error, LensModel, Method, MotionModel, Options, Silent, calibrate_matches,
    geometry::{Camera, Constraint, Fisheye, ImageSize, Intrinsics, Lens},
    pairs::ImagePair,
    result::{Calibration, LensSource, Parameter, Warning},
    synthetic::{MotionSpec, PlaneViewScene, PointScene},
};

const SIZE: ImageSize = ImageSize { width: 1000, height: 1000 };

/// 180 degrees across the image, 250 to its corners.
fn scene(sigma_px: f64, seed: u64) -> PointScene {
    PointScene {
        intrinsics: Intrinsics::square(316.0, 506.5, 494.5),
        lens: Lens::Fisheye(Fisheye::new([0.02, -0.005, 0.002, -0.0004])),
        size: SIZE,
        matches: 300,
        sigma_px,
        ..PointScene::nominal(seed)
    }
}

fn pairs(scene: &PointScene) -> Vec<ImagePair> {
    scene.pairs()
}

/// Told the lens and a camera matrix that is 2 % off.
fn options(scene: &PointScene) -> Options {
    let k = &scene.intrinsics;
    Options {
        distortion: scene.lens,
        distortion_camera: Some(Intrinsics {
            cx: k.cx - 5.0,
            cy: k.cy + 4.0,
            ..Intrinsics::square(1.02 * k.fx, 0.0, 0.0)
        }),
        ..Options::default()
    }
}

fn calibrated(scene: &PointScene, options: &Options) -> Calibration {
    let names: Vec<String> = (0..2 * scene.motions.len()).map(|i| format!("{i}.png")).collect();
    calibrate_matches(&names, SIZE, &pairs(scene), options, &Silent).expect("a camera")
}

/// Relative errors of fx, fy and of the principal point in focal lengths.
fn errors(c: &Calibration) -> [f64; 4] {
    let k = c.camera.model().intrinsics;
    [k.fx / 316.0 - 1.0, k.fy / 316.0 - 1.0, (k.cx - 506.5) / 316.0, (k.cy - 494.5) / 316.0]
}

#[test]
fn matches_at_and_beyond_90_degrees_bring_the_camera_back() {
    let exact = scene(0.0, 1);
    let camera = Camera { size: SIZE, intrinsics: exact.intrinsics, lens: exact.lens };
    let behind = |p| camera.unproject(&p).expect("a ray").z < 0.0;
    let count = pairs(&exact).iter().flat_map(|p| &p.matches).filter(|m| behind(m.a) || behind(m.b)).count();
    assert!(count > 60, "{count} matches behind the camera's plane");
    // A thousandth of a pixel, as 900 matches average it.
    let nearly = scene(1e-3, 1);
    for (method, scene, tolerance) in [(Method::Linear, &exact, 1e-9), (Method::Joint, &nearly, 1e-5)] {
        let c = calibrated(scene, &Options { method, constraint: Constraint::ZeroSkew, ..options(scene) });
        assert_eq!(c.method, method, "{:?}", c.warnings);
        assert!(errors(&c).iter().all(|e| e.abs() < tolerance), "{method:?} {:?}", errors(&c));
        assert_eq!((c.camera.model().lens, c.camera.distortion.source), (scene.lens, LensSource::Given));
        assert!(c.motions.iter().all(|m| m.used && m.matches > 290), "{:?}", c.motions);
    }
}

#[test]
fn error_bars_hold_with_noise() {
    let all = [Parameter::Fx, Parameter::Fy, Parameter::Cx, Parameter::Cy];
    for method in [Method::Joint, Method::Linear] {
        let mut squares = 0.0;
        for seed in 0..6 {
            let scene = scene(0.3, 10 + seed);
            let c = calibrated(&scene, &Options { method, ..options(&scene) });
            assert_eq!(c.method, method, "{:?}", c.warnings);
            for (p, error) in all.into_iter().zip(errors(&c)) {
                let sd = c.standard_deviation(p).expect("estimated");
                let z = error * 316.0 / sd;
                assert!(z.abs() < 4.0 && sd < 3.0, "{method:?} seed {seed}: {p} {z:.2} deviations of {sd}");
                squares += z * z;
            }
        }
        println!("{method:?}: chi-squared {squares:.1} of 24 numbers");
        // 99.9 % of chi-squared lies below 51.2, and above 7.5.
        assert!(squares < 51.2, "{method:?} {squares}");
    }
}

#[test]
fn a_lens_of_a_wide_model_needs_the_camera_through_which_it_acts() {
    let scene = scene(0.3, 1);
    let options = Options { distortion_camera: None, ..options(&scene) };
    let names: Vec<String> = (0..6).map(|i| i.to_string()).collect();
    let error = calibrate_matches(&names, SIZE, &pairs(&scene), &options, &Silent).expect_err("no camera matrix");
    assert!(matches!(&error, Error::InvalidOption(text) if text.contains("fisheye")), "{error}");
}

/// Motions before a lens of 100 to 130 degrees, whose camera and lens nobody knows.
fn blind_scene(lens: Lens, focal_px: f64, seed: u64) -> PointScene {
    let attitudes: [[f64; 3]; 5] =
        [[48.0, 4.0, 24.0], [40.0, 32.0, -28.0], [55.0, -24.0, 32.0], [45.0, 50.0, -22.0], [58.0, -48.0, 26.0]];
    let motion = |[pitch, roll, turn]: &[f64; 3]| {
        MotionSpec::about_axis(pitch.to_radians(), roll.to_radians(), turn.to_radians(), 0.3, 1.4)
    };
    PointScene {
        intrinsics: Intrinsics::square(focal_px, 651.0, 467.0),
        lens,
        motions: attitudes.iter().map(motion).collect(),
        matches: 250,
        sigma_px: 0.2,
        reach: 8.0,
        ..PointScene::nominal(seed)
    }
}

/// What comes of them without a word.
fn blind(lens: Lens, focal_px: f64, seed: u64) -> (PointScene, Calibration) {
    let scene = blind_scene(lens, focal_px, seed);
    let names: Vec<String> = (0..2 * scene.motions.len()).map(|i| i.to_string()).collect();
    let c = calibrate_matches(&names, scene.size, &pairs(&scene), &Options::default(), &Silent)
        .unwrap_or_else(|error| panic!("{lens:?}: {error}"));
    (scene, c)
}

fn is_said(c: &Calibration) -> bool {
    c.warnings.iter().any(|w| matches!(w, Warning::FisheyeLens { .. }))
}

#[test]
fn a_fisheye_that_nobody_named_is_found() {
    // Equidistant, stereographic and equisolid lenses.
    for (seed, coefficients) in
        [[0.0; 4], [1.0 / 12.0, 1.0 / 120.0, 17.0 / 20160.0, 0.0], [-1.0 / 24.0, 1.0 / 1920.0, 0.0, 0.0]]
            .into_iter()
            .enumerate()
    {
        let (scene, c) = blind(Lens::Fisheye(Fisheye::new(coefficients)), 600.0, seed as u64);
        assert!(is_said(&c) && c.camera.distortion.source == LensSource::Estimated, "{:?}", c.warnings);
        let found = c.camera.model().lens;
        assert!(matches!(found, Lens::Fisheye(_)), "{:?}", c.camera.distortion);
        let off = (c.camera.fx / scene.intrinsics.fx - 1.0).abs();
        let sigma = c.standard_deviation(Parameter::Fx).expect("estimated");
        println!("{coefficients:?}: fx {:.3} +- {sigma:.3}, {:?}", c.camera.fx, found.parameters());
        assert!(off < 0.003 && (c.camera.fx - scene.intrinsics.fx).abs() < 4.0 * sigma, "{off}");
        for (i, p) in [Parameter::K1, Parameter::K2].into_iter().enumerate() {
            let sigma = c.standard_deviation(p).expect("estimated");
            assert!((found.parameters()[i] - coefficients[i]).abs() < 4.0 * sigma, "{p:?} {:?}", found.parameters());
        }
    }
}

#[test]
fn a_lens_of_brown_and_conrady_stays_one() {
    for (seed, k1) in [0.0, -0.1, -0.2, -0.3].into_iter().enumerate() {
        let (scene, c) = blind(Lens::radial(k1, 0.1 * k1.abs()), 900.0, seed as u64);
        assert!(!is_said(&c) && matches!(c.camera.model().lens, Lens::Radtan(_)), "{k1}: {:?}", c.warnings);
        let sigma = c.standard_deviation(Parameter::Fx).expect("estimated");
        assert!((c.camera.fx - scene.intrinsics.fx).abs() < 4.0 * sigma);
    }
}

/// Lenses of 140 and 180 degrees across 1,000 pixels: four models, seen in motions over a floor, and from anywhere before a plane.
#[test]
fn a_fisheye_that_is_named_is_told_from_the_planes() {
    let coefficients = [[0.0; 4], [0.02, -0.005, 0.002, -0.0004], [-0.04, 0.003, 0.0, 0.0], [0.05, -0.01, 0.0, 0.0]];
    for (seed, (degrees, ks)) in [140.0f64, 180.0].into_iter().flat_map(|d| coefficients.map(|ks| (d, ks))).enumerate()
    {
        let seed = seed as u64;
        let focal_px = 500.0 / (0.5 * degrees.to_radians());
        let intrinsics = Intrinsics::square(focal_px, 506.5, 494.5);
        let lens = Lens::Fisheye(Fisheye::new(ks));
        let floor =
            PointScene { intrinsics, lens, size: SIZE, matches: 300, sigma_px: 0.3, ..PointScene::nominal(seed) };
        let plane = PlaneViewScene { intrinsics, lens, size: SIZE, views: 6, ..PlaneViewScene::nominal(seed) };
        for (motion, pairs) in [(MotionModel::Auto, pairs(&floor)), (MotionModel::General, plane.pairs())] {
            let options = Options { lens: LensModel::Fisheye, motion, ..Options::default() };
            let names: Vec<String> = (0..6).map(|i| format!("{i}.png")).collect();
            let c = calibrate_matches(&names, SIZE, &pairs, &options, &Silent)
                .unwrap_or_else(|e| panic!("{degrees} degrees, {motion:?}: {e}"));
            assert_eq!((c.camera.model().lens.name(), c.camera.distortion.source), ("fisheye", LensSource::Estimated));
            let z = |p: Parameter, truth: f64| (c.value(p) - truth) / c.standard_deviation(p).expect("estimated");
            let truths = [(Parameter::Fx, focal_px), (Parameter::Cx, 506.5), (Parameter::K1, ks[0])];
            let off = (c.camera.fx / focal_px - 1.0).abs();
            println!("{degrees} degrees {motion:?} {ks:?}: off by {:.3} %", 100.0 * off);
            assert!(off < 0.006 && truths.iter().all(|(p, t)| z(*p, *t).abs() < 4.0), "{degrees} {motion:?} {off}");
        }
    }
}

#[test]
fn a_lens_said_to_be_no_fisheye_is_taken_for_none() {
    let mut scene = blind_scene(Lens::Fisheye(Fisheye::new([0.0; 4])), 600.0, 1);
    scene.lens = Lens::radial(-0.2, 0.02);
    let names: Vec<String> = (0..2 * scene.motions.len()).map(|i| i.to_string()).collect();
    let options = Options { lens: LensModel::Radtan, ..Options::default() };
    let c = calibrate_matches(&names, scene.size, &pairs(&scene), &options, &Silent).expect("a camera");
    assert!(!is_said(&c) && matches!(c.camera.model().lens, Lens::Radtan(_)), "{:?}", c.camera.distortion);
    // The same of a fisheye: whatever comes of it, it is none.
    let scene = blind_scene(Lens::Fisheye(Fisheye::new([0.0; 4])), 600.0, 1);
    if let Ok(c) = calibrate_matches(&names, scene.size, &pairs(&scene), &options, &Silent) {
        assert!(!is_said(&c) && !matches!(c.camera.model().lens, Lens::Fisheye(_)));
    }
}
