//! Points and distances of the floor: their intervals hold the truth as often as they say, over synthetic calibrations.

use std::sync::OnceLock;

use groundcal::{
    Options, Silent, calibrate_matches,
    floor::{FloorPoint, FloorView, KnownDistance, MeasuringView, with_floor_distance},
    geometry::{Intrinsics, Lens, Radtan},
    pairs::ImagePair,
    result::Calibration,
    start::{GivenPrior, PriorParameter},
    synthetic::PointScene,
};
use nalgebra::Vector2;
use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64Mcg;
use rayon::prelude::*;

const TRIALS: usize = 500;
/// Noise of the pixels that are pointed at.
const POINTING_PX: f64 = 0.5;
/// Of 500 intervals of 95 %: 93 to 97 %.
const HELD: std::ops::RangeInclusive<usize> = 465..=485;

/// How far views vary in tilt and height, which is also said.
const ATTITUDE_SIGMA_DEG: f64 = 0.1;
const HEIGHT_SIGMA: f64 = 0.002;
/// Of k1 and k2: lenses are drawn from what is said of them.
const LENS_SIGMA: [f64; 2] = [0.03, 0.01];

fn options() -> Options {
    Options {
        attitude_sigma_deg: Some(ATTITUDE_SIGMA_DEG),
        height_sigma: Some(HEIGHT_SIGMA),
        priors: [(PriorParameter::K1, LENS_SIGMA[0]), (PriorParameter::K2, LENS_SIGMA[1])]
            .map(|(parameter, sigma)| GivenPrior { parameter, mean: 0.0, sigma })
            .to_vec(),
        ..Options::default()
    }
}

/// A camera drawn from what is assumed of cameras, and its calibration.
struct Trial {
    seed: u64,
    scene: PointScene,
    calibration: Calibration,
}

fn trial(seed: u64) -> Trial {
    let mut rng = Pcg64Mcg::seed_from_u64(0xF100 + seed);
    let mut normal = |sigma: f64| sigma * rng.sample::<f64, _>(StandardNormal);
    let nominal = PointScene::nominal(seed);
    let [cx, cy] = nominal.size.centre_px();
    let shift = 0.05 * nominal.size.width as f64;
    let fx = 1000.0 + normal(30.0);
    let fy = fx * (1.0 + normal(0.003));
    let intrinsics = Intrinsics { fx, fy, cx: cx + normal(shift), cy: cy + normal(shift), skew: 0.0 };
    let lens =
        Lens::Radtan(Radtan::new([normal(LENS_SIGMA[0]), normal(LENS_SIGMA[1]), normal(0.001), normal(0.001), 0.0]));
    let mut scene = PointScene { intrinsics, lens, sigma_px: 0.5, matches: 100, ..nominal };
    // Each view varies from what its attitude's have in common: the second of a motion from the first by both.
    let both = 2f64.sqrt();
    for m in &mut scene.motions {
        // A roll is about the optical axis, of which the part along the floor tilts the camera.
        let [ahead, aside] = [0; 2].map(|_| normal(both * ATTITUDE_SIGMA_DEG.to_radians()));
        m.attitude_error_rad = [ahead, aside / m.pitch_down_rad.cos()];
        m.height_ratio = 1.0 + normal(both * HEIGHT_SIGMA);
    }
    let pairs: Vec<ImagePair> = scene.pairs();
    let names: Vec<String> = (0..2 * pairs.len()).map(|i| format!("{i}.jpg")).collect();
    let calibration = calibrate_matches(&names, scene.size, &pairs, &options(), &Silent).expect("a camera");
    Trial { seed, scene, calibration }
}

fn trials() -> &'static [Trial] {
    static ALL: OnceLock<Vec<Trial>> = OnceLock::new();
    ALL.get_or_init(|| (0..TRIALS as u64).into_par_iter().map(trial).collect())
}

impl Trial {
    /// The camera of the first view of a motion, as it truly is.
    fn truth(&self, motion: usize) -> FloorView {
        FloorView::new(&self.scene.intrinsics, self.scene.lens, &self.scene.motions[motion].views()[0]).expect("a view")
    }

    /// How high it is, in the scene's unit; 1 in the calibration's.
    fn height(&self, motion: usize) -> f64 {
        self.scene.motions[motion].height
    }

    /// Pixels as somebody points at them.
    fn pointed_at(&self, pixels: [[f64; 2]; 2], which: u64) -> [[f64; 2]; 2] {
        let mut rng = Pcg64Mcg::seed_from_u64(0xAB00 + 17 * self.seed + which);
        pixels.map(|p| p.map(|v| v + POINTING_PX * rng.sample::<f64, _>(StandardNormal)))
    }

    fn true_distance(&self, motion: usize, [p, q]: [[f64; 2]; 2]) -> f64 {
        let truth = self.truth(motion);
        let [p, q] = [p, q].map(|p| truth.floor_from_pixel(&Vector2::from(p)).expect("floor"));
        (q - p).norm() / self.height(motion)
    }
}

/// Two pairs of places in the image.
const ONE: [[f64; 2]; 2] = [[250.0, 400.0], [980.0, 780.0]];
const OTHER: [[f64; 2]; 2] = [[640.0, 300.0], [560.0, 900.0]];

fn held(pulls: impl Iterator<Item = f64>) -> (usize, f64) {
    let pulls: Vec<f64> = pulls.collect();
    let rms = (pulls.iter().map(|p| p * p).sum::<f64>() / pulls.len() as f64).sqrt();
    (pulls.iter().filter(|p| p.abs() < 1.959_964).count(), rms)
}

#[test]
fn distances_hold_in_95_per_cent() {
    for (name, pixels) in [("one", ONE), ("other", OTHER)] {
        let pulls = trials().iter().map(|t| {
            let view = MeasuringView::of(&t.calibration, "0").expect("a view");
            let length = view.distance(t.pointed_at(pixels, 0), POINTING_PX).expect("floor");
            (length.value - t.true_distance(0, pixels)) / length.sigma
        });
        let (count, rms) = held(pulls);
        println!("{name}: {count} of {TRIALS} held, pulls of {rms:.3}");
        assert!(HELD.contains(&count), "{count} of {TRIALS}");
    }
}

#[test]
fn points_hold_and_come_back_to_their_pixels() {
    let pixel = OTHER[1];
    let of = |t: &Trial| {
        let view = MeasuringView::of(&t.calibration, "0.jpg").expect("a view");
        let [seen, _] = t.pointed_at([pixel, pixel], 1);
        let point = view.floor_point(seen, POINTING_PX).expect("floor");
        // There and back is the same pixel, with errors that are at least those of pointing.
        let back = view.image_point(&FloorPoint { covariance: [[0.0; 2]; 2], ..point }).expect("a pixel");
        assert!((back.pixel[0] - seen[0]).hypot(back.pixel[1] - seen[1]) < 1e-6);
        point
    };
    for axis in 0..2 {
        let pulls = trials().iter().map(|t| {
            let point = of(t);
            let truth = t.truth(0).floor_from_pixel(&Vector2::from(pixel)).expect("floor") / t.height(0);
            // The scene's first view stands over the origin and looks along +X, as the calibration's does.
            (point.position[axis] - truth[axis]) / point.covariance[axis][axis].sqrt()
        });
        let (count, rms) = held(pulls);
        println!("axis {axis}: {count} of {TRIALS} held, pulls of {rms:.3}");
        assert!(HELD.contains(&count), "{count} of {TRIALS}");
    }
}

#[test]
fn pixels_of_floor_points_hold() {
    let pixel = ONE[1];
    let pulls = trials().iter().flat_map(|t| {
        let truth = t.truth(0).floor_from_pixel(&Vector2::from(pixel)).expect("floor") / t.height(0);
        let view = MeasuringView::of(&t.calibration, "0.jpg").expect("a view");
        let point = FloorPoint { position: truth.into(), covariance: [[0.0; 2]; 2] };
        let image = view.image_point(&point).expect("a pixel");
        [0, 1].map(|i| (image.pixel[i] - pixel[i]) / image.covariance_px2[i][i].sqrt())
    });
    let pulls: Vec<f64> = pulls.collect();
    for axis in 0..2 {
        let (count, rms) = held(pulls.iter().copied().skip(axis).step_by(2));
        println!("axis {axis}: {count} of {TRIALS} held, pulls of {rms:.3}");
        assert!(HELD.contains(&count), "{count} of {TRIALS}");
    }
}

#[test]
fn a_known_distance_gives_metres_with_their_errors() {
    // Three metres of floor are a unit; the rule is known to 0.3 %.
    let (unit_m, rule) = (3.0, 0.003);
    let scaled = |t: &Trial| {
        let metres = unit_m * t.true_distance(0, ONE);
        let mut rng = Pcg64Mcg::seed_from_u64(0xCD00 + t.seed);
        let error = rule * metres * rng.sample::<f64, _>(StandardNormal);
        let known = KnownDistance {
            pixels: t.pointed_at(ONE, 0),
            pixel_sigma_px: POINTING_PX,
            metres: metres + error,
            metres_sigma: rule * metres,
        };
        let c = with_floor_distance(t.calibration.clone(), "0.jpg", &known).expect("a scale");
        (known, c)
    };
    let pulls = trials().iter().map(|t| {
        let (_, c) = scaled(t);
        let length =
            MeasuringView::of(&c, "0").expect("a view").distance(t.pointed_at(OTHER, 2), POINTING_PX).expect("floor");
        (length.value - unit_m * t.true_distance(0, OTHER)) / length.sigma
    });
    let (count, rms) = held(pulls);
    println!("another distance of the view: {count} of {TRIALS} held, pulls of {rms:.3}");
    assert!(HELD.contains(&count), "{count} of {TRIALS}");
    let pulls = trials().iter().map(|t| {
        let (_, c) = scaled(t);
        (c.camera_height_m.expect("metres") - unit_m) / c.camera_height_sigma_m.expect("an error bar")
    });
    let (count, rms) = held(pulls);
    println!("the height of the camera: {count} of {TRIALS} held, pulls of {rms:.3}");
    assert!(HELD.contains(&count), "{count} of {TRIALS}");
    // The distance itself, through the same pixels, is the rule's: nothing of the calibration is in its error.
    let t = &trials()[0];
    let (known, c) = scaled(t);
    let again = MeasuringView::of(&c, "0").expect("a view").distance(known.pixels, 0.0).expect("floor");
    assert!((again.value / known.metres - 1.0).abs() < 1e-9);
    let pointing = again.sigma.powi(2) - known.metres_sigma.powi(2);
    assert!(pointing > 0.0 && again.sigma < 1.5 * known.metres_sigma, "{again:?}");
}

#[test]
fn what_is_no_floor_is_none() {
    let c = &trials()[0].calibration;
    let view = MeasuringView::of(c, "0.jpg").expect("a view");
    assert_eq!(view.floor_point([640.0, -5000.0], 0.5), None);
    assert_eq!(view.distance([[600.0, 700.0]; 2], 0.5), None);
    let message = MeasuringView::of(c, "9.jpg").unwrap_err().to_string();
    assert!(message.contains("no view 9.jpg among the 6"), "{message}");
    let known =
        KnownDistance { pixels: [[640.0, -5000.0], ONE[0]], pixel_sigma_px: 0.5, metres: 1.0, metres_sigma: 0.0 };
    let message = with_floor_distance(c.clone(), "0", &known).unwrap_err().to_string();
    assert!(message.contains("above the horizon"), "{message}");
}
