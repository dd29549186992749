//! What is estimated of a lens: decentring always, k3 where the residuals ask for it.

use groundcal::{
    Options, Silent, calibrate_matches,
    geometry::{Lens, Radtan},
    pairs::ImagePair,
    result::{Calibration, Parameter},
    synthetic::{MotionSpec, PointScene},
};

/// Six motions of as many attitudes.
fn scene(coefficients: [f64; 5], seed: u64) -> PointScene {
    let motion = |i: usize| {
        let (pitch, roll) = (0.6 + 0.07 * i as f64, -0.5 + 0.2 * i as f64);
        MotionSpec::about_axis(pitch, roll, 0.4, 0.3, 1.0)
    };
    PointScene {
        lens: Lens::Radtan(Radtan::new(coefficients)),
        motions: (0..6).map(motion).collect(),
        matches: 400,
        sigma_px: 0.2,
        ..PointScene::nominal(seed)
    }
}

fn calibrated(scene: &PointScene) -> Calibration {
    let names: Vec<String> = (0..2 * scene.motions.len()).map(|i| format!("{i}.png")).collect();
    let pairs: Vec<ImagePair> = scene.pairs();
    calibrate_matches(&names, scene.size, &pairs, &Options::default(), &Silent).expect("a camera")
}

/// Deviations of parameters from the truth in units of their error bars.
fn z(c: &Calibration, scene: &PointScene, all: &[Parameter]) -> Vec<f64> {
    let k = &scene.intrinsics;
    let truth = |p: Parameter| match p {
        Parameter::Fx => k.fx,
        Parameter::Fy => k.fy,
        Parameter::Cx => k.cx,
        Parameter::Cy => k.cy,
        Parameter::Skew => 0.0,
        of_lens => scene.lens.parameter(of_lens.name()).unwrap_or(0.0),
    };
    all.iter().map(|p| (c.value(*p) - truth(*p)) / c.standard_deviation(*p).expect("estimated")).collect()
}

#[test]
fn decentring_is_not_taken_for_the_principal_point() {
    use Parameter::{Cx, Cy, Fx, Fy, K1, K2, P1, P2};
    let all = [Fx, Fy, Cx, Cy, K1, K2, P1, P2];
    let mut squares = 0.0;
    for seed in 0..4 {
        let scene = scene([-0.15, 0.03, 0.0015, -0.001, 0.0], seed);
        let c = calibrated(&scene);
        let z = z(&c, &scene, &all);
        assert!(z.iter().all(|z| z.abs() < 4.0), "{all:?} {z:?}");
        // Told by the images, not by the prior, which is 1.5 deviations away.
        assert!([P1, P2].iter().all(|p| c.standard_deviation(*p).is_some_and(|s| s < 2e-4)));
        assert_eq!(c.prior(P1.prior()).map(|p| (p.mean, p.sigma)), Some((0.0, 1e-3)));
        squares += z.iter().map(|z| z * z).sum::<f64>();
    }
    // 99.9 % of chi-squared of 32 numbers.
    assert!(squares < 62.5, "{squares}");
}

#[test]
fn k3_is_estimated_where_the_residuals_ask_for_it() {
    use Parameter::{Cx, Cy, Fx, Fy, K3};
    // One in a thousand is released by chance.
    for seed in 0..6 {
        let c = calibrated(&scene([-0.2, 0.05, 3e-4, -2e-4, 0.0], seed));
        assert_eq!((c.standard_deviation(K3), c.value(K3)), (None, 0.0), "seed {seed}");
    }
    for (seed, k3) in [(1, 0.15), (2, -0.15)] {
        let scene = scene([-0.2, 0.05, 3e-4, -2e-4, k3], seed);
        let c = calibrated(&scene);
        let all = [Fx, Fy, Cx, Cy, K3];
        let z = z(&c, &scene, &all);
        assert!(z.iter().all(|z| z.abs() < 4.0), "{all:?} {z:?}");
        assert!(c.standard_deviation(K3).is_some_and(|s| s < 0.1) && c.prior(K3.prior()).is_some());
    }
}
