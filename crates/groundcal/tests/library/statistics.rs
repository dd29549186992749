//! Seeded Monte Carlo trials of the linear method on synthetic matches against the Cramér-Rao bound.

use groundcal::{
    LensModel, Options, Silent, calibrate_matches,
    start::Constraint,
    synthetic::{HeightModel, PointScene},
};
use rayon::prelude::*;

const TRIALS: u64 = 600;

/// Errors and standard deviations of (fx, fy, cx, cy), and the bound of fx for constant and for free height.
struct Trial {
    error: [f64; 4],
    sigma: [f64; 4],
    bound: [f64; 2],
}

#[test]
fn rmse_is_near_the_bound_and_the_intervals_hold() {
    let options = Options {
        constraint: Constraint::ZeroSkew,
        attitude_sigma_deg: Some(0.0),
        height_sigma: Some(0.0),
        pairs: Some(vec![(0, 1), (2, 3), (4, 5)]),
        lens: LensModel::None,
        ..Options::default()
    };
    let names: Vec<String> = (0..6).map(|i| i.to_string()).collect();
    let trials: Vec<Trial> = (0..TRIALS)
        .into_par_iter()
        .map(|seed| {
            let scene = PointScene::nominal(seed);
            let pairs = scene.pairs();
            let bound = [HeightModel::Constant, HeightModel::Free].map(|h| {
                let b = scene.bound(Constraint::ZeroSkew, h);
                b.expect("determined")[(0, 0)].sqrt()
            });
            let c = calibrate_matches(&names, scene.size, &pairs, &options, &Silent).expect("a camera");
            let (k, sd, t) = (&c.camera, &c.standard_deviation, &scene.intrinsics);
            let sds = [sd.fx, sd.fy, sd.cx, sd.cy].map(|s| s.expect("estimated"));
            Trial { error: [k.fx - t.fx, k.fy - t.fy, k.cx - t.cx, k.cy - t.cy], sigma: sds, bound }
        })
        .collect();
    let n = trials.len() as f64;
    let mean_square = |f: &dyn Fn(&Trial) -> f64| trials.iter().map(|t| f(t).powi(2)).sum::<f64>() / n;
    let constant = (mean_square(&|t| t.error[0]) / mean_square(&|t| t.bound[0])).sqrt();
    let free = (mean_square(&|t| t.error[0]) / mean_square(&|t| t.bound[1])).sqrt();
    println!("RMSE of fx over the bound: {constant:.3} (constant height), {free:.3} (height free); {TRIALS} trials");
    println!("stated over bound {:.3}", (mean_square(&|t| t.sigma[0]) / mean_square(&|t| t.bound[0])).sqrt());
    println!(
        "RMSE of fx {:.3} px, bias {:.3} px",
        mean_square(&|t| t.error[0]).sqrt(),
        trials.iter().map(|t| t.error[0]).sum::<f64>() / n
    );
    assert!(constant <= 1.25, "{constant}");
    for (i, name) in ["fx", "fy", "cx", "cy"].iter().enumerate() {
        let held = trials.iter().filter(|t| t.error[i].abs() <= 1.96 * t.sigma[i]).count() as f64 / n;
        println!("95 % interval of {name} held {:.1} %", 100.0 * held);
        assert!((0.92..=0.98).contains(&held), "{name}: {held}");
    }
}
