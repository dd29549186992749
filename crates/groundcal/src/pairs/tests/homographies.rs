//! Accuracy of the robust homography: median transfer error against the same refinement on the true inliers.

use crate::geometry::frame::Frame;
use crate::geometry::homography::Homography;
use crate::numerics::statistics::median;
use crate::pairs::correspondence::PointMatch;
use crate::pairs::refine::{RefineOptions, refine};
use crate::pairs::robust::RobustOptions;
use crate::pairs::tests::estimate_robust;
use crate::synthetic::points::{PointScene, SyntheticPair};
use nalgebra::Vector2;
use rayon::prelude::*;

/// Root mean square distance between the estimate's and the true transfer of the inliers, in pixels.
fn transfer_rms_px(estimate: &Homography, truth: &Homography, points: &[Vector2<f64>]) -> f64 {
    let sum: f64 = points
        .iter()
        .map(|p| (estimate.apply(p).expect("in front") - truth.apply(p).expect("in front")).norm_squared())
        .sum();
    (sum / points.len() as f64).sqrt()
}

fn inliers(pair: &SyntheticPair) -> Vec<PointMatch> {
    pair.pair.matches.iter().zip(&pair.is_inlier).filter(|(_, good)| **good).map(|(m, _)| *m).collect()
}

#[test]
fn outliers_cost_less_than_five_percent() {
    for matches in [200, 2000] {
        for outlier_fraction in [0.0, 0.3, 0.6] {
            let mut errors: Vec<(f64, f64)> = (0..400u64)
                .into_par_iter()
                .map(|seed| {
                    let scene = PointScene { matches, outlier_fraction, ..PointScene::nominal(1000 + seed) };
                    let truth = scene.homography(0).expect("a homography");
                    let pair = &scene.pairs_with_truth()[0];
                    let frame = Frame::new(scene.size, None);
                    let good = inliers(pair);
                    let points: Vec<Vector2<f64>> = good.iter().map(|m| m.a).collect();
                    let ideal = refine(&good, None, &frame, &RefineOptions::default()).expect("inliers determine it");
                    let options = RobustOptions::default();
                    let robust = estimate_robust(&pair.pair.matches, &frame, &options).expect("enough inliers");
                    let error = |h: &Homography| transfer_rms_px(h, &truth, &points);
                    (error(&robust.estimate.h_b_from_a), error(&ideal.h_b_from_a))
                })
                .collect();
            let robust = median(&mut errors.iter().map(|e| e.0).collect::<Vec<_>>());
            let ideal = median(&mut errors.iter_mut().map(|e| e.1).collect::<Vec<_>>());
            println!(
                "{matches} matches, {:.0} % outliers: median transfer rms {robust:.4} px, on the true inliers {ideal:.4} px, \
                 ratio {:.3}",
                100.0 * outlier_fraction,
                robust / ideal
            );
            assert!(robust <= 1.05 * ideal, "{matches} {outlier_fraction}: {robust} {ideal}");
        }
    }
}

#[test]
fn a_static_background_does_not_win_in_silence() {
    let scene = PointScene { matches: 120, ..PointScene::nominal(5) };
    let moving = scene.pairs()[0].matches.clone();
    // Three times as many points that stand still, in a strip at the border as a robot's own body would.
    let still = (0..360).map(|i| {
        let p = [(i * 37 % 1280) as f64, 880.0 + (i * 13 % 80) as f64];
        PointMatch::new(p, [p[0] + 0.3 * (i as f64).sin(), p[1] + 0.3 * (i as f64).cos()])
    });
    let matches: Vec<PointMatch> = moving.iter().copied().chain(still).collect();
    let frame = Frame::new(scene.size, None);
    let found = estimate_robust(&matches, &frame, &RobustOptions::default()).expect("a plane");
    assert!(found.static_background >= 300, "{}", found.static_background);
    assert!(!found.is_static);
    let truth = scene.homography(0).expect("a homography");
    let points: Vec<Vector2<f64>> = moving.iter().map(|m| m.a).collect();
    assert!(transfer_rms_px(&found.estimate.h_b_from_a, &truth, &points) < 1.0);
    // Nothing else moves: said so.
    let alone = estimate_robust(&matches[120..], &frame, &RobustOptions::default()).expect("a plane");
    assert!(alone.is_static);
}

#[test]
fn the_covariance_of_a_homography_is_right() {
    // Mahalanobis distance of the nine entries from the truth: chi-squared with eight degrees of freedom.
    let trials = 300u64;
    let total: f64 = (0..trials)
        .into_par_iter()
        .map(|seed| {
            let scene = PointScene::nominal(seed);
            let frame = Frame::new(scene.size, None);
            let pair = &scene.pairs()[1];
            let estimate = refine(&pair.matches, None, &frame, &RefineOptions::default()).expect("determined");
            let truth = scene.homography(1).expect("a homography").in_frame(&frame);
            let difference = nalgebra::SVector::<f64, 9>::from_fn(|i, _| {
                truth[(i / 3, i % 3)] * truth.dot(&estimate.in_frame).signum() - estimate.in_frame[(i / 3, i % 3)]
            });
            let eigen = estimate.covariance.symmetric_eigen();
            // The direction of least variance is the gauge.
            let gauge = eigen.eigenvalues.imin();
            (0..9)
                .filter(|i| *i != gauge)
                .map(|i| eigen.eigenvectors.column(i).dot(&difference).powi(2) / eigen.eigenvalues[i])
                .sum::<f64>()
        })
        .sum();
    let mean = total / trials as f64;
    // Standard error of the mean: sqrt(2 * 8 / trials) = 0.23.
    assert!((mean - 8.0).abs() < 0.8, "{mean}");
}
