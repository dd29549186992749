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

use nalgebra::{DMatrix, Matrix3, SMatrix, SymmetricEigen, Vector3};
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
/// Standard deviation, beforehand, of the numbers of ρ l: 3 mm over a floor 1.5 m below are 0.002, a tripod head's 5 cm before things 5 m away
/// 0.01, an arm's length in a room 0.2, which is then seen.
const SIGMA: f64 = 0.01;
/// Standard deviation of inverse distances over their mean. (Seen from above, the inverse distances of the points of a floor are spread evenly
/// from the horizon down: 0.58. In rooms whose walls are 1 to 4 away it is 0.4, from 2 to 4 0.2.)
const VARIATION: f64 = 0.4;

/// What a camera taken to turn on the spot may be wrong by for a lens off the axis.
#[derive(Debug, Clone, PartialEq)]
pub struct LeverArm {
    /// How far the lens is off the axis, over the (harmonic) mean distance of the points; `None`: the images show no parallax.
    pub over_distance: Option<f64>,
    /// Deviation of ln f of the first camera for it.
    pub ln_f_sigma: f64,
    /// Covariance of the numbers of the first camera for it, by their places.
    added: Vec<((usize, usize), f64)>,
}

/// Of a point: g and D.
type Parallax = (Vector3<f64>, Matrix3<f64>);

/// What an account of parallax says: how far the lens is off the axis where that is not put down to chance, and the covariance of the
/// columns of the first camera for it.
struct Account {
    over_distance: Option<f64>,
    covariance: DMatrix<f64>,
}

impl LeverArm {
    /// Of a solution. `on_axis`: somebody vouches that the lens was on the axis; then what is not seen is not there.
    pub(crate) fn of(problem: &Problem, at: Minimum<'_>, on_axis: bool) -> Option<Self> {
        if problem.scene != SceneModel::Directions {
            return None;
        }
        let columns: Vec<(usize, usize)> = problem.layout.cameras[0].free().collect();
        let accounts: Vec<Account> =
            [of_a_floor(problem, at, on_axis), of_single_points(problem, at)].into_iter().flatten().collect();
        let covariance = |row: usize, column: usize| accounts.iter().map(|a| a.covariance[(row, column)]).sum::<f64>();
        let mut added = Vec::new();
        for (r, &(row, _)) in columns.iter().enumerate() {
            added.extend(columns.iter().enumerate().map(|(c, &(column, _))| ((row, column), covariance(r, c))));
        }
        let ln_f_sigma = added.iter().find(|(places, _)| *places == (0, 0)).map_or(0.0, |(_, v)| v.sqrt());
        let over_distance = accounts.iter().filter_map(|a| a.over_distance).max_by(f64::total_cmp);
        (!accounts.is_empty()).then_some(Self { over_distance, ln_f_sigma, added })
    }

    /// Adds what leaving it out makes wrong to the covariance of the first camera.
    pub(crate) fn widen(&self, covariance: &mut DMatrix<f64>) {
        self.added.iter().for_each(|(places, value)| covariance[*places] += value);
    }
}

/// The rows of the first camera's columns.
fn of_camera(problem: &Problem, all: &DMatrix<f64>) -> DMatrix<f64> {
    let columns: Vec<usize> = problem.layout.cameras[0].free().map(|(_, column)| column).collect();
    all.select_rows(&columns)
}

/// With distances that follow from the direction of a point.
fn of_a_floor(problem: &Problem, at: Minimum<'_>, on_axis: bool) -> Option<Account> {
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
    let seen = score.chance() < LEVER_P;
    if on_axis && !seen {
        return None;
    }
    let moved = of_camera(problem, &problem.moved_by(at, by_numbers)?);
    let step = &moved * score.step;
    let mut covariance = &step * step.transpose();
    if !on_axis {
        covariance += &moved * score.covariance * moved.transpose();
    }
    Some(Account { over_distance: seen.then(|| score.step.norm()), covariance })
}

/// With distances of each point's own.
fn of_single_points(problem: &Problem, at: Minimum<'_>) -> Option<Account> {
    let (direction, lambda) = direction_of(&parallaxes(problem, at)?)?;
    let over_distance = lambda / VARIATION;
    let by_unit = problem.moved_by::<3>(at, &|_, projection, _| -projection.by_camera_point)?;
    let step = of_camera(problem, &by_unit) * direction * over_distance;
    Some(Account { over_distance: Some(over_distance), covariance: &step * step.transpose() })
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
