//! Which pairs are motions: views that are none must not pass for some, and many views must not take for ever.

use crate::calibrate::Options;
use crate::calibrate::calibrate_matches;
use crate::geometry::intrinsics::Intrinsics;
use crate::geometry::plane_view::{View, project};
use crate::geometry::size::ImageSize;
use crate::observer::Silent;
use crate::pairs::correspondence::{ImagePair, PointMatch};
use nalgebra::{Vector2, Vector3};
use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Mcg;
use rayon::prelude::*;

const F: f64 = 1000.0;

/// Matches of all pairs of views of the same floor points, with noise.
fn all_pairs(views: &[View], points: usize, sigma_px: f64, rng: &mut Pcg64Mcg) -> (ImageSize, Vec<ImagePair>) {
    let size = ImageSize::new(1280, 960);
    let k = Intrinsics::square(F, 639.5, 479.5);
    let tracks: Vec<Vec<Option<Vector2<f64>>>> = (0..points)
        .map(|_| {
            let point = Vector2::new(rng.random_range(-1.0..5.0), rng.random_range(-3.0..3.0));
            views
                .iter()
                .map(|view| {
                    let seen = project(&k, view, &point)?;
                    let inside = seen.x > 0.0 && seen.y > 0.0 && seen.x < 1279.0 && seen.y < 959.0;
                    let mut noise = || -> f64 { StandardNormal.sample(rng) };
                    inside.then(|| seen + Vector2::new(noise(), noise()) * sigma_px)
                })
                .collect()
        })
        .collect();
    let mut pairs = Vec::new();
    for from in 0..views.len() {
        for to in from + 1..views.len() {
            let both = tracks.iter().filter_map(|t| Some(PointMatch { a: t[from]?, b: t[to]?, sigma_px: 1.0 }));
            pairs.push(ImagePair { from, to, matches: both.collect() });
        }
    }
    (size, pairs)
}

#[test]
fn general_motion_is_refused_or_covered_by_its_error_bar() {
    let trials: u64 = 80;
    let wrong: Vec<String> = (0..trials)
        .into_par_iter()
        .filter_map(|seed| {
            let mut rng = Pcg64Mcg::seed_from_u64(seed);
            let count = 4 + (seed % 3) as usize;
            let views: Vec<View> = (0..count)
                .map(|_| View {
                    pitch_down_rad: rng.random_range(35f64..65.0).to_radians(),
                    roll_rad: rng.random_range(-30f64..30.0).to_radians(),
                    yaw_rad: rng.random_range(-25f64..25.0).to_radians(),
                    centre: Vector3::new(
                        rng.random_range(-0.3..0.3),
                        rng.random_range(-0.3..0.3),
                        rng.random_range(1.3..1.7),
                    ),
                })
                .collect();
            let (size, pairs) = all_pairs(&views, 500, 0.3, &mut rng);
            let names: Vec<String> = (0..count).map(|i| i.to_string()).collect();
            let c = calibrate_matches(&names, size, &pairs, &Options::default(), &Silent).ok()?;
            let sigma = c.standard_deviation.fx.expect("estimated");
            let codes: Vec<&str> = c.warnings.iter().map(|w| w.code()).collect();
            let flagged = codes.contains(&"floors_contradict");
            ((c.camera.fx - F).abs() > 3.0 * sigma && !flagged)
                .then(|| format!("seed {seed}: {} +- {sigma} {codes:?}", c.camera.fx))
        })
        .collect();
    // Coincidence is let through at odds of one to twenty, and then contradicted by the planes the views share.
    assert!(wrong.len() as u64 * 40 <= trials, "{wrong:?}");
}

#[test]
fn forty_views_of_one_attitude_are_found_and_joined() {
    let mut rng = Pcg64Mcg::seed_from_u64(1);
    let count = 40;
    let views: Vec<View> = (0..count)
        .map(|i| View {
            pitch_down_rad: 0.9,
            roll_rad: 0.1,
            yaw_rad: 0.02 * i as f64,
            centre: Vector3::new(0.01 * i as f64, 0.0, 1.5),
        })
        .collect();
    let (size, pairs) = all_pairs(&views, 400, 0.3, &mut rng);
    let names: Vec<String> = (0..count).map(|i| i.to_string()).collect();
    let c = calibrate_matches(&names, size, &pairs, &Options::default(), &Silent).expect("a camera");
    assert_eq!(c.attitudes.len(), 1);
    assert!(c.motions.iter().filter(|m| m.used).count() > 500);
    let sigma = c.standard_deviation.fx.expect("estimated");
    assert!((c.camera.fx - F).abs() < 4.0 * sigma, "{} +- {sigma}", c.camera.fx);
}
