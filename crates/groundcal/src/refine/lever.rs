//! A camera taken to turn on the spot whose lens is off the axis of turning, before things that are not all far away.
//!
//! ```text
//! x = R q - ρ l,     l: the lens from the axis in camera coordinates, alike in all pictures;  ρ = ρ' + u: inverse distance of the point
//! g = Cᵀ M r,  D = Cᵀ M C  of each point;      W = Σ (g gᵀ - D),      λ² = eᵀ W e / Σ (eᵀ D e)²
//! ```
//!
//! What l does at one distance for all points is nearly what a longer lens on the axis does, and is in no residual. What remains is that
//! near things move against far ones, and that is looked for in two ways:
//!
//! - distances that follow from the direction, as those of a floor do: ρ = a + bᵀ q makes ρ l linear in twelve numbers, whose score says
//!   whether the residuals ask for them, and by how much the camera is wrong for leaving them out;
//! - distances of each point's own: along e, the direction of l, the residuals have the further variance λ² = |l|² var(u), for which the
//!   expectation of W, zero without it, is the score (of a variance: Chesher 1984, *Testing for neglected heterogeneity*). From λ follows,
//!   with distances that vary as those of rooms do, how far the camera is wrong.
//!
//! What the camera is wrong by goes into its error bars. C: derivatives of a point's observations by ρ l; M takes the direction of the
//! point out; r: residuals.

use nalgebra::{DMatrix, DVector, Matrix3, SMatrix, SymmetricEigen, Vector3};
use rayon::prelude::*;

use crate::{
    numerics::statistics::chi_squared_survival,
    refine::{
        elimination::TrackRows,
        problem::Problem,
        residual::SceneModel,
        score::{ByNumbers, Minimum, without_point},
    },
};

/// Probability below which parallax is not put down to chance; along any of three directions.
const LEVER_P: f64 = 1e-3;
/// Standard deviation, beforehand, of the numbers of ρ l: 3 mm over a floor 1.5 m below are 0.002, an arm's length in a room 0.2.
const SIGMA: f64 = 0.1;
/// Standard deviation of inverse distances over their mean. (Seen from above, the inverse distances of the points of a floor are spread evenly
/// from the horizon down: 0.58. In rooms whose walls are 1 to 4 away it is 0.4, from 2 to 4 0.2.)
const VARIATION: f64 = 0.4;

/// Parallax that a camera taken to turn on the spot shows.
#[derive(Debug, Clone, PartialEq)]
pub struct LeverArm {
    /// How far the lens is off the axis, over the (harmonic) mean distance of the points.
    pub over_distance: f64,
    /// By how much ln f of the first camera is wrong for leaving it out.
    pub moves_ln_f: f64,
    /// By how much the numbers of the first camera are.
    moves: Vec<(usize, f64)>,
}

/// Of a point: g and D.
type Parallax = (Vector3<f64>, Matrix3<f64>);

impl LeverArm {
    /// Of a solution; `None`: it shows none.
    pub(crate) fn of(problem: &Problem, at: Minimum<'_>) -> Option<Self> {
        if problem.scene != SceneModel::Directions {
            return None;
        }
        let found = [of_a_floor(problem, at), of_single_points(problem, at)];
        let of_camera = || problem.layout.cameras[0].free();
        let arms = found.into_iter().flatten().map(|(over_distance, moved)| {
            let moves: Vec<(usize, f64)> = of_camera().map(|(number, column)| (number, moved[column])).collect();
            let moves_ln_f = moves.iter().find(|(number, _)| *number == 0).map_or(0.0, |(_, by)| *by);
            Self { over_distance, moves_ln_f, moves }
        });
        arms.max_by(|a, b| a.moves_ln_f.abs().total_cmp(&b.moves_ln_f.abs()))
    }

    /// Adds what leaving it out makes wrong to the covariance of the first camera.
    pub(crate) fn widen(&self, covariance: &mut DMatrix<f64>) {
        for &(row, by_row) in &self.moves {
            for &(column, by_column) in &self.moves {
                covariance[(row, column)] += by_row * by_column;
            }
        }
    }
}

/// How far the lens is off the axis over the mean distance, and by how much the columns are wrong for it, with distances that follow from the
/// direction of a point.
fn of_a_floor(problem: &Problem, at: Minimum<'_>) -> Option<(f64, DVector<f64>)> {
    let by_numbers: &ByNumbers<'_, 12> = &|_, projection, _| {
        let by = -projection.by_camera_point;
        let q = projection.point;
        let mut all = SMatrix::<f64, 2, 12>::zeros();
        for (block, factor) in [1.0, q.x, q.y, q.z].into_iter().enumerate() {
            all.fixed_columns_mut::<3>(3 * block).copy_from(&(by * factor));
        }
        all
    };
    let score = problem.score(at, SIGMA, by_numbers)?;
    if score.chance() >= LEVER_P {
        return None;
    }
    let moved = problem.moved_by(at, by_numbers)? * score.step;
    Some((score.step.norm(), moved))
}

/// The same with distances of each point's own.
fn of_single_points(problem: &Problem, at: Minimum<'_>) -> Option<(f64, DVector<f64>)> {
    let (direction, lambda) = direction_of(&parallaxes(problem, at)?)?;
    let over_distance = lambda / VARIATION;
    let by_unit = problem.moved_by::<3>(at, &|_, projection, _| -projection.by_camera_point)?;
    Some((over_distance, by_unit * direction * over_distance))
}

/// The direction in which the residuals of the points have most variance beyond their own, and the root of that; `None` where that is
/// put down to chance.
fn direction_of(points: &[Parallax]) -> Option<(Vector3<f64>, f64)> {
    let mean: Matrix3<f64> = points.iter().map(|(_, d)| d).sum();
    let excess: Matrix3<f64> = points.iter().map(|(g, d)| g * g.transpose() - d).sum();
    // e with the largest eᵀ W e / eᵀ Σ D e.
    let root = mean.cholesky()?.l().try_inverse()?;
    let eigen = SymmetricEigen::new(root * excess * root.transpose());
    let direction = (root.transpose() * eigen.eigenvectors.column(eigen.eigenvalues.imax())).normalize();
    let of_point = |(g, d): &Parallax| (direction.dot(g).powi(2), direction.dot(&(d * direction)));
    let (mut score, mut variance, mut information) = (0.0, 0.0, 0.0);
    for (seen, expected) in points.iter().map(of_point) {
        score += seen - expected;
        // As it is, not as normal residuals would have it: a few wrong matches are no parallax.
        variance += (seen - expected).powi(2);
        information += expected * expected;
    }
    // One side of a normal distribution.
    let chance = 3.0 * 0.5 * chi_squared_survival(score * score / variance, 1);
    (score > 0.0 && chance < LEVER_P).then(|| (direction, (score / information).sqrt()))
}

/// g and D of every point.
fn parallaxes(problem: &Problem, at: Minimum<'_>) -> Option<Vec<Parallax>> {
    let views = problem.views(at.state);
    let of_chunk = |(cluster, tracks): &(usize, &[usize])| {
        let c = &problem.clusters[*cluster];
        let mut rows = TrackRows::new(c);
        let mut derivatives = vec![Vector3::zeros(); 2 * c.images.len()];
        let of_track = |&t: &usize| {
            problem.linearise_track((c, t), at.state, &views, &mut rows, |o, projection, _, root| {
                let by = -projection.by_camera_point;
                derivatives[2 * o] = (by.row(0) * root[0] + by.row(1) * root[1]).transpose();
                derivatives[2 * o + 1] = (by.row(1) * root[2]).transpose();
            })?;
            without_point(&rows, &mut derivatives)?;
            let residuals = (0..c.images.len()).flat_map(|o| rows.residual(o));
            let g: Vector3<f64> = derivatives.iter().zip(residuals).map(|(c, r)| c * r).sum();
            Some((g, derivatives.iter().map(|c| c * c.transpose()).sum()))
        };
        tracks.iter().map(of_track).collect::<Option<Vec<Parallax>>>()
    };
    let parts: Vec<Option<Vec<Parallax>>> = problem.chunks().par_iter().map(of_chunk).collect();
    Some(parts.into_iter().collect::<Option<Vec<_>>>()?.concat())
}
