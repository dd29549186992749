//! Weights of the observations: the noise of each kind, what neighbours have in common, and the loss.
//!
//! ```text
//! weight = Λ g(r) / (s² D),       s² = Σ g |r|² / degrees of freedom,       g = min(1, limit / |r|)                      (Huber 1964)
//! D = Σ_cells |Σ r|²  /  Σ_cells 2 n s² (1 - 1/m) (c - 8/p) / c           1 where chance exceeds it with more than one in a hundred
//! ```
//!
//! with r the whitened residuals of n points in a cell of one of m pictures, c numbers of full cells of a pair of pictures and p kinds of measurement and cameras between
//! them: a homography of its own would take eight.

use std::collections::BTreeMap;

use nalgebra::Vector2;

use crate::{
    numerics::{
        skyline_cholesky::SkylineCholesky,
        statistics::{NORMAL_999, chi_squared_survival},
    },
    refine::{blocks::State, problem::Problem, tracks::KINDS},
};

/// Cells along each side of an image, and the fewest points of one, for residuals that neighbours have in common.
const CELLS: usize = 4;
const CELL_COUNT: usize = 3;
/// Probability below which what they have in common is not put down to chance.
const DESIGN_EFFECT_P: f64 = 0.01;
/// Relative error of the variance of the residuals at which the weights have converged, and the same of what neighbours have in common.
const VARIANCE_TOLERANCE: f64 = 0.005;
const DESIGN_EFFECT_TOLERANCE: f64 = 0.05;
/// Most rounds in which the weights of the loss follow the variance for given residuals, and the relative change at which it has converged.
const MAX_WEIGHT_ROUNDS: usize = 100;
const WEIGHT_TOLERANCE: f64 = 1e-9;

/// A kind of measurement and two images (frame and camera) that share points.
type PairOfKind = (usize, [(usize, usize); 2]);

/// Sum of the residuals in a part of an image.
#[derive(Debug, Clone, Copy, Default)]
struct Cell {
    sum: Vector2<f64>,
    /// Expected mean square of each of its coordinates, if they were independent.
    variance: f64,
    count: usize,
}

/// What the residuals say of their weights.
#[derive(Debug, Clone, Copy)]
pub(crate) struct WeightEstimate {
    /// Variance of single residuals in units of what the weights in force take it for.
    pub(crate) single_variances: [f64; KINDS],
    /// How much more neighbours have in common than independent residuals would.
    pub(crate) effects: [f64; KINDS],
    /// Degrees of freedom of all residuals.
    pub(crate) degrees_of_freedom: f64,
    /// And of each kind, which the columns cost in proportion.
    pub(crate) of_kinds: [f64; KINDS],
}

impl WeightEstimate {
    /// From the residuals of a solution, the weights in force allowing for `effects_in_force`.
    pub(crate) fn new(
        problem: &Problem,
        state: &State,
        (residuals, squared_residuals): (&[Vec<Vector2<f64>>], &[Vec<f64>]),
        factor: &SkylineCholesky,
        effects_in_force: [f64; KINDS],
    ) -> Self {
        let (variances, degrees_of_freedom) = problem.variance_factors(state, squared_residuals, factor);
        let redundancies = problem.redundancies().map(|r| r as f64);
        let total = redundancies.iter().sum::<f64>().max(1.0);
        Self {
            effects: problem.design_effects(residuals, variances),
            // In units of single residuals, which the weights in force take for larger by what neighbours have in common.
            single_variances: std::array::from_fn(|k| variances[k] * effects_in_force[k]),
            degrees_of_freedom,
            of_kinds: redundancies.map(|r| r * degrees_of_freedom / total),
        }
    }

    /// The variance of single residuals of each kind, in the units of [`Self::single_variances`], at which the weights of the loss would converge if the
    /// residuals stayed as they are. The rounds stop within half a per cent of it, which the evidence of ten thousand residuals would show as a
    /// difference of 50.
    pub(crate) fn at_fixed_point(
        &self,
        problem: &Problem,
        squared_residuals: &[Vec<f64>],
        effects_in_force: [f64; KINDS],
    ) -> [f64; KINDS] {
        let sums = |variances: [f64; KINDS]| {
            problem.weighted_sums(squared_residuals, |k, limit, r| {
                let r = r * effects_in_force[k] / variances[k];
                if r > limit { (limit / r).sqrt() } else { 1.0 }
            })
        };
        let in_force = problem.weighted_sums_in_force(squared_residuals);
        let mut variances = self.single_variances;
        for _ in 0..MAX_WEIGHT_ROUNDS {
            let now = sums(variances);
            // The degrees of freedom are those that led from the sums in force to the variances in force.
            let next = std::array::from_fn(|k| {
                if in_force[k] > 0.0 { self.single_variances[k] * now[k] / in_force[k] } else { 1.0 }
            });
            let moved = (0..KINDS).map(|k| (next[k] / variances[k] - 1.0).abs()).fold(0.0, f64::max);
            variances = next;
            if moved < WEIGHT_TOLERANCE {
                break;
            }
        }
        variances
    }

    /// Whether the weights in force need no change.
    pub(crate) fn has_converged(&self, effects_in_force: [f64; KINDS]) -> bool {
        (0..KINDS).all(|k| {
            (self.single_variances[k] - 1.0).abs() < VARIANCE_TOLERANCE
                && (self.effects[k] / effects_in_force[k]).ln().abs() < DESIGN_EFFECT_TOLERANCE
        })
    }

    /// Changes the weights of a problem accordingly.
    pub(crate) fn apply(&self, problem: &mut Problem, squared_residuals: &[Vec<f64>], in_force: [f64; KINDS]) {
        // What is large is so in units of single residuals.
        let next: [f64; KINDS] =
            std::array::from_fn(|k| (problem.weights[k] * in_force[k] / self.single_variances[k]).clamp(1e-6, 25.0));
        problem.reweight(squared_residuals, std::array::from_fn(|k| next[k] / problem.weights[k]));
        problem.weights = std::array::from_fn(|k| next[k] / self.effects[k]);
    }
}

impl Problem {
    /// Degrees of freedom of each kind before cameras and frames are counted: two an observation less two a track.
    fn redundancies(&self) -> [usize; KINDS] {
        let mut out = [0; KINDS];
        for (seen, &kind) in self.prepared.iter().zip(&self.kinds) {
            out[kind] += 2 * (seen.len() - 1);
        }
        out
    }

    /// Mean squared weighted residual per degree of freedom of each kind, and all of these: two an observation less two a track
    /// less the columns, of which those with priors count by how much the data decide them.
    fn variance_factors(
        &self,
        state: &State,
        squared_residuals: &[Vec<f64>],
        factor: &SkylineCholesky,
    ) -> ([f64; KINDS], f64) {
        let priors = self.prior_information(state);
        let variances = factor.inverse_diagonal(&priors.iter().map(|(column, _)| *column).collect::<Vec<_>>());
        let held: f64 =
            priors.iter().zip(variances).map(|((_, information), variance)| (information * variance).min(1.0)).sum();
        let redundancies = self.redundancies().map(|r| r as f64);
        let total: f64 = redundancies.iter().sum();
        let dof = total - (self.layout.size as f64 - held);
        if dof < 1.0 {
            return ([1.0; KINDS], dof.max(0.0));
        }
        let sums = self.weighted_sums_in_force(squared_residuals);
        // The columns cost each kind in proportion.
        let of_kind = |k: usize| if redundancies[k] > 0.0 { sums[k] / (redundancies[k] * dof / total) } else { 1.0 };
        (std::array::from_fn(of_kind), dof)
    }

    /// How much more the residuals of neighbouring points of each kind have in common than independent ones would: the mean square
    /// of sums over cells of the images, by its expectation from the `variances` of single residuals. A lens or a floor that is
    /// not quite as the model says, and matching errors that depend on the perspective, show in it where the size of single
    /// residuals does not. 1 where the difference may be chance.
    fn design_effects(&self, residuals: &[Vec<Vector2<f64>>], variances: [f64; KINDS]) -> [f64; KINDS] {
        let mut cells: BTreeMap<PairOfKind, [Cell; CELLS * CELLS]> = BTreeMap::new();
        for c in &self.clusters {
            let share = (c.images.len() as f64 - 1.0) / c.images.len() as f64;
            for &t in &c.tracks {
                let kind = self.kinds[t];
                for ((s, r), &image) in self.prepared[t].iter().zip(&residuals[t]).zip(&c.images).skip(1) {
                    let half_sides = self.cameras[image.1].image_half_sides;
                    let place =
                        |x: f64, half: f64| ((0.5 * (x / half + 1.0) * CELLS as f64).max(0.0) as usize).min(CELLS - 1);
                    let at = place(s.pixel.y, half_sides[1]) * CELLS + place(s.pixel.x, half_sides[0]);
                    let cell = &mut cells.entry((kind, [c.images[0], image])).or_default()[at];
                    cell.sum += r;
                    cell.variance += share * variances[kind];
                    cell.count += 1;
                }
            }
        }
        let between = |[first, image]: &[(usize, usize); 2]| [first.0, image.0];
        let mut pairs_between: BTreeMap<(usize, [usize; 2]), usize> = BTreeMap::new();
        for (kind, images) in cells.keys() {
            *pairs_between.entry((*kind, between(images))).or_default() += 1;
        }
        let (mut squares, mut expected, mut degrees_of_freedom) = ([0.0; KINDS], [0.0; KINDS], [0.0; KINDS]);
        for ((kind, images), pair) in &cells {
            let full = || pair.iter().filter(|c| c.count >= CELL_COUNT);
            let numbers = 2.0 * full().count() as f64;
            // What a homography of its own would follow is not in the residuals. The cameras of a rig have one between two frames
            // in common, and none of their own within a frame.
            let frames = between(images);
            let shared_by = pairs_between[&(*kind, frames)] as f64;
            let left = numbers - if frames[0] == frames[1] { 0.0 } else { 8.0 / shared_by };
            if left <= 0.0 {
                continue;
            }
            squares[*kind] += full().map(|c| c.sum.norm_squared()).sum::<f64>();
            expected[*kind] += 2.0 * full().map(|c| c.variance).sum::<f64>() * left / numbers;
            degrees_of_freedom[*kind] += left;
        }
        std::array::from_fn(|k| {
            let (ratio, dof) = (squares[k] / expected[k], degrees_of_freedom[k]);
            let chance = chi_squared_survival(ratio * dof, dof.round() as usize);
            if dof >= 1.0 && ratio > 1.0 && chance < DESIGN_EFFECT_P { ratio } else { 1.0 }
        })
    }

    /// Sets the weight of each observation to Huber's (1964) for its squared residual. Between two calls the problem is one of
    /// plain least squares (iteratively reweighted), which converges in a few steps.
    ///
    /// `scales` multiplies the residuals of each kind beforehand.
    fn reweight(&mut self, squared_residuals: &[Vec<f64>], scales: [f64; KINDS]) {
        let huber = self.huber;
        for ((seen, residuals), &kind) in self.prepared.iter_mut().zip(squared_residuals).zip(&self.kinds) {
            let limit = huber_limit(huber, seen.len());
            for (s, r) in seen.iter_mut().zip(residuals) {
                let r = r * scales[kind];
                s.robust = if r > limit { (limit / r).sqrt() } else { 1.0 };
            }
        }
    }

    /// By how much more the variance of an estimate is than the mean of the residuals has it, where observations that are said to be precise are less so than
    /// others: with weights w that are stated and variances s² / w that are true, the weights of least squares leave
    ///
    /// ```text
    /// h = (Σ w s² / Σ w) / (Σ s² / N)            (White 1980, for derivatives that have nothing to do with the weights)
    /// ```
    ///
    /// of the variance that (Σ s² / N) / Σ w has. The largest of the kinds; 1 where the difference may be chance.
    pub(crate) fn misstated_noise(&self, squared_residuals: &[Vec<f64>]) -> f64 {
        // Σ w, Σ w², Σ w s², Σ s², N.
        let mut sums = [[0.0; 5]; KINDS];
        for ((seen, residuals), &kind) in self.prepared.iter().zip(squared_residuals).zip(&self.kinds) {
            for (s, r) in seen.iter().zip(residuals) {
                let (w, r) = (s.stated_information(), s.robust * r);
                let terms = [w, w * w, w * r, r, 1.0];
                sums[kind].iter_mut().zip(terms).for_each(|(sum, term)| *sum += term);
            }
        }
        let of_kind = |[w, w2, wr, r, n]: [f64; 5]| {
            if w <= 0.0 || r <= 0.0 {
                return 1.0;
            }
            let ratio = (wr / w) / (r / n);
            // The two residuals of a point in two pictures are one: half as many are independent.
            let by_chance = (2.0 * (w2 / (w * w) - 1.0 / n)).max(0.0).sqrt();
            if ratio > 1.0 + NORMAL_999 * by_chance { ratio } else { 1.0 }
        };
        sums.map(of_kind).into_iter().fold(1.0, f64::max)
    }

    /// Sums of the squared residuals of each kind with the weights in force.
    fn weighted_sums_in_force(&self, squared_residuals: &[Vec<f64>]) -> [f64; KINDS] {
        let mut sums = [0.0; KINDS];
        for ((seen, residuals), &kind) in self.prepared.iter().zip(squared_residuals).zip(&self.kinds) {
            sums[kind] += seen.iter().zip(residuals).map(|(s, r)| s.robust * r).sum::<f64>();
        }
        sums
    }

    /// The same with the weights that are said of a kind, Huber's limit there, and a squared residual.
    fn weighted_sums(&self, squared_residuals: &[Vec<f64>], weight: impl Fn(usize, f64, f64) -> f64) -> [f64; KINDS] {
        let mut sums = [0.0; KINDS];
        for ((seen, residuals), &kind) in self.prepared.iter().zip(squared_residuals).zip(&self.kinds) {
            let limit = huber_limit(self.huber, seen.len());
            sums[kind] += residuals.iter().map(|&r| weight(kind, limit, r) * r).sum::<f64>();
        }
        sums
    }
}

/// Squared residual, in units of its variance, from which on Huber's loss grows slower: the point follows its observations, so that a
/// residual is smaller than the error.
fn huber_limit(huber: f64, observations: usize) -> f64 {
    huber * huber * (observations as f64 - 1.0) / observations as f64
}
