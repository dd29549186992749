//! Minimal sets in simulation (KZR figures 5 and 6): the cameras of all subsets of m out of twelve motions, ranked by their predicted
//! error, with their true errors; and bias and variance of sets of m motions.

use crate::studies::{
    figure4::{Condition, scene},
    setting::Setting,
};
use crate::{rank_correlation::spearman, subsets::rank_subsets};
use groundcal::synthetic::{HeightModel, PointScene};
use groundcal::{
    geometry::Frame,
    pairs::{HomographyEstimate, gold_standard_homography, shows_turn},
    start::{Constraint, unweighted_camera},
};

/// Motions of a scene.
pub const MOTIONS: usize = 12;
/// Motions of a subset: zero skew needs two.
pub const SIZES: [usize; 4] = [2, 3, 4, 6];
/// Parts of equal size into which the ranked subsets are divided.
pub const PARTS: usize = 20;

/// One subset.
#[derive(Debug, Clone, Copy)]
pub struct Ranked {
    /// Predicted relative standard deviation of fx; infinite without a camera.
    pub predicted: f64,
    /// Relative error of fx of the covariance-weighted camera; `None`: refused.
    pub weighted: Option<f64>,
    /// Relative error of fx of the paper's linear camera, all equations with one weight; `None`: no real camera.
    pub linear: Option<f64>,
}

/// All subsets of one size in one scene, the surest first.
#[derive(Debug, Clone)]
pub struct Trial {
    /// The subsets.
    pub ranked: Vec<Ranked>,
    /// Spearman's rank correlation of predicted and true error over the subsets with a camera.
    pub correlation: f64,
    /// The first `size` motions alone: independent from scene to scene.
    pub first: Ranked,
    /// Cramér-Rao bound (free height, as the linear methods have it) of those, relative; `None`: not determined.
    pub bound: Option<f64>,
}

/// All subsets of `size` in the scene of a trial: zero skew, nominal condition but for setting and noise.
pub fn trial(size: usize, setting: Setting, noise_px: f64, seed: u64, number: u64) -> Option<Trial> {
    let condition = Condition { motions: MOTIONS, setting, noise_px, ..Condition::default() };
    let scene = scene(&condition, seed, number);
    let frame = Frame::new(scene.size, None);
    let pairs = scene.pairs();
    let fit = |matches: &[_]| gold_standard_homography(matches, &frame).ok().filter(shows_turn);
    let motions: Vec<HomographyEstimate> = pairs.iter().map(|p| fit(&p.matches)).collect::<Option<_>>()?;
    let fx = scene.intrinsics.fx;
    let relative = |found: f64| Some(found / fx - 1.0).filter(|e: &f64| e.is_finite());
    let subsets = rank_subsets(&motions, Constraint::ZeroSkew, size).ok()?;
    let ranked: Vec<(bool, Ranked)> = subsets
        .iter()
        .map(|s| {
            let chosen: Vec<_> = s.motions.iter().map(|&i| motions[i].in_frame).collect();
            let linear = unweighted_camera(&chosen, &frame, Constraint::ZeroSkew, 1.0).ok();
            let ranked = Ranked {
                predicted: s.predicted_sigma(),
                weighted: s.camera.as_ref().ok().and_then(|c| relative(c.intrinsics.fx)),
                linear: linear.and_then(|k| relative(k.fx)),
            };
            (s.motions.iter().copied().eq(0..size), ranked)
        })
        .collect();
    let (predicted, errors): (Vec<f64>, Vec<f64>) =
        ranked.iter().filter_map(|(_, r)| Some((r.predicted, r.weighted?.abs()))).unzip();
    let first = ranked.iter().find(|(is_first, _)| *is_first)?.1;
    let of_first = PointScene { motions: scene.motions[..size].to_vec(), ..scene.clone() };
    let bound = of_first.bound(Constraint::ZeroSkew, HeightModel::Free);
    Some(Trial {
        ranked: ranked.into_iter().map(|r| r.1).collect(),
        correlation: spearman(&predicted, &errors),
        first,
        bound: bound.map(|b| b[(0, 0)].sqrt() / fx),
    })
}

/// The part of the ranking, 0 to [`PARTS`] - 1, that place `index` of `count` belongs to.
pub fn part(index: usize, count: usize) -> usize {
    index * PARTS / count.max(1)
}
