//! Deviations stated of matches count as stated where they are those that the matches have, and not where they are not.

use groundcal::{
    Options, Silent, calibrate_matches,
    pairs::{ImagePair, PointMatch},
    result::{Calibration, Parameter, Warning},
    synthetic::PointScene,
};

fn calibrate(scene: &PointScene, pairs: &[ImagePair]) -> Calibration {
    let images = pairs.iter().map(|p| p.from.max(p.to) + 1).max().expect("pairs");
    let names: Vec<String> = (0..images).map(|i| i.to_string()).collect();
    calibrate_matches(&names, scene.size, pairs, &Options::default(), &Silent).unwrap_or_else(|error| panic!("{error}"))
}

/// A number between 0 and 1 that depends on all of these.
fn uniform(pair: usize, at: usize, draw: usize) -> f64 {
    let mut x = (pair * 1_000_003 + at * 1_009 + draw) as u64;
    for _ in 0..3 {
        x = (x ^ (x >> 29)).wrapping_add(1).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    }
    (x >> 11) as f64 / (1u64 << 53) as f64
}

/// Between a fifth and five times.
fn some_sigma(pair: usize, at: usize) -> f64 {
    25f64.powf(uniform(pair, at, 0) - 0.5)
}

fn contradicted(c: &Calibration) -> Option<f64> {
    c.warnings.iter().find_map(|w| match w {
        Warning::StatedNoiseContradicted { exponent, .. } => Some(*exponent),
        _ => None,
    })
}

/// The matches of a scene with other deviations stated.
fn stated(pairs: &[ImagePair], sigma: impl Fn(usize, usize) -> f64) -> Vec<ImagePair> {
    let of_pair = |(p, pair): (usize, &ImagePair)| {
        let with = |(i, m): (usize, &PointMatch)| PointMatch { sigma_px: sigma(p, i), ..*m };
        ImagePair { matches: pair.matches.iter().enumerate().map(with).collect(), ..*pair }
    };
    pairs.iter().enumerate().map(of_pair).collect()
}

#[test]
fn deviations_that_matches_do_not_have_count_for_nothing() {
    let scene = PointScene { matches: 150, ..PointScene::nominal(4) };
    let pairs = scene.pairs();
    let alike = calibrate(&scene, &pairs);
    assert_eq!(contradicted(&alike), None);
    let with = calibrate(&scene, &stated(&pairs, some_sigma));
    assert_eq!(contradicted(&with), Some(0.0));
    for parameter in [Parameter::Fx, Parameter::Cx] {
        assert_eq!(alike.standard_deviation(parameter), with.standard_deviation(parameter));
    }
    assert_eq!(alike.camera.fx.to_bits(), with.camera.fx.to_bits());
}

#[test]
fn deviations_that_matches_have_are_kept() {
    let scene = PointScene { matches: 150, sigma_px: 0.0, outlier_fraction: 0.0, ..PointScene::nominal(4) };
    let exact = scene.pairs();
    // Noise of half a pixel times the deviation stated; and the root of that, so that differences are half as large.
    let normal = |p: usize, i: usize, k: usize| (0..12).map(|j| uniform(p, i, 1 + 12 * k + j)).sum::<f64>() - 6.0;
    for (power, found) in [(1.0, None), (0.5, Some(0.5))] {
        let mut noisy = exact.clone();
        for (p, pair) in noisy.iter_mut().enumerate() {
            for (i, m) in pair.matches.iter_mut().enumerate() {
                let sigma = 0.5 * some_sigma(p, i).powf(power);
                let by = [0, 1, 2, 3].map(|k| sigma * normal(p, i, k));
                *m = PointMatch::new([m.a.x + by[0], m.a.y + by[1]], [m.b.x + by[2], m.b.y + by[3]]);
            }
        }
        let with = calibrate(&scene, &stated(&noisy, some_sigma));
        assert_eq!(contradicted(&with), found);
        let sigma = with.standard_deviation(Parameter::Fx).expect("estimated");
        assert!((with.camera.fx - scene.intrinsics.fx).abs() < 3.0 * sigma, "{} +- {sigma}", with.camera.fx);
    }
}
