//! A camera taken to turn on the spot whose lens is off the axis of turning, before things that are not all far away.
//!
//! ```text
//! x = R q - ν l,     l: the lens from the axis in camera coordinates, alike in all pictures;  ν = ν' + u: inverse distance of the point
//! g = Cᵀ M r,  D = Cᵀ M C  of each point;      W = Σ (g gᵀ - D),      λ² = eᵀ W e / Σ (eᵀ D e)²
//! ```
//!
//! What l does at one distance for all points is nearly what a longer lens on the axis does, and is in no residual. What remains is that
//! near things move against far ones, and that is looked for in two ways:
//!
//! - distances that follow from the direction, as those of a floor do: ν = a + bᵀ q makes ν l linear in twelve numbers, whose score says
//!   whether the residuals ask for them, and by how much the camera is wrong for leaving them out;
//! - distances of each point's own: along e, the direction of l, the residuals have the further variance λ² = |l|² var(u), for which the
//!   expectation of W, zero without it, is the score (of a variance: Chesher 1984, *Testing for neglected heterogeneity*). From λ follows,
//!   with distances that vary as those of rooms do, how far the camera is wrong.
//!
//! What the camera is wrong by goes into its error bars. C: derivatives of a point's observations by ν l; M takes the direction of the
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
/// Standard deviation, beforehand, of the numbers of ν l: 3 mm over a floor 1.5 m below are 0.002, a tripod head's 5 cm before things 5 m away
/// 0.01, an arm's length in a room 0.2, which is then seen.
const PARALLAX_SIGMA: f64 = 0.01;
/// Standard deviation of inverse distances over their mean. (Seen from above, the inverse distances of the points of a floor are spread evenly
/// from the horizon down: 0.58. In rooms whose walls are 1 to 4 away it is 0.4, from 2 to 4 0.2.)
const INVERSE_DISTANCE_VARIATION: f64 = 0.4;

/// What a camera taken to turn on the spot may be wrong by for a lens off the axis.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct LeverArm {
    /// How far the lens is off the axis, over the (harmonic) mean distance of the points; `None`: the images show no parallax.
    pub over_distance: Option<f64>,
    /// Standard deviation of ln f of the first camera for it.
    pub ln_f_sigma: f64,
    /// Covariance of the numbers of the first camera for it, by their places.
    added: Vec<((usize, usize), f64)>,
}

/// Of a point: g and D.
type Parallax = (Vector3<f64>, Matrix3<f64>);

impl LeverArm {
    /// Of a solution. `on_axis`: somebody vouches that the lens was on the axis; then what is not seen is not there.
    pub(crate) fn of(problem: &Problem, at: Minimum<'_>, on_axis: bool) -> Option<Self> {
        if problem.scene != SceneModel::Directions {
            return None;
        }
        let by_numbers: &ByNumbers<'_, 12> = &|_, projection| {
            let by = -projection.by_camera_point;
            let q = projection.point;
            let mut all = SMatrix::<f64, 2, 12>::zeros();
            for (block, factor) in [1.0, q.x, q.y, q.z].into_iter().enumerate() {
                all.fixed_columns_mut::<3>(3 * block).copy_from(&(by * factor));
            }
            all
        };
        let score = problem.score(at, PARALLAX_SIGMA, by_numbers)?;
        let free: Vec<(usize, usize)> = problem.layout.cameras[0].free().collect();
        let moved_by = score.moved_by.select_rows(free.iter().map(|(_, column)| column));
        let of_a_floor = score.chance() < LEVER_P;
        let of_single_points = direction_of(&parallaxes(problem, at)?);
        let mut covariance = DMatrix::zeros(free.len(), free.len());
        let mut over_distance = None;
        if !on_axis {
            covariance += &moved_by * score.covariance * moved_by.transpose();
        }
        if of_a_floor || !on_axis {
            let step = &moved_by * score.step;
            covariance += &step * step.transpose();
            over_distance = of_a_floor.then(|| score.step.norm());
        }
        if let Some((direction, lambda)) = of_single_points {
            let far = lambda / INVERSE_DISTANCE_VARIATION;
            // The first three numbers are l at one distance for all.
            let step = moved_by.columns(0, 3) * direction * far;
            covariance += &step * step.transpose();
            over_distance = Some(over_distance.map_or(far, |other: f64| other.max(far)));
        }
        let places = free.iter().enumerate().flat_map(|r| free.iter().enumerate().map(move |c| (r, c)));
        let added: Vec<((usize, usize), f64)> =
            places.map(|((r, &(row, _)), (c, &(column, _)))| ((row, column), covariance[(r, c)])).collect();
        let ln_f_sigma = added.iter().find(|(places, _)| *places == (0, 0)).map_or(0.0, |(_, v)| v.sqrt());
        Some(Self { over_distance, ln_f_sigma, added })
    }

    /// What leaving it out makes wrong in the covariance of the first camera, by places.
    pub(crate) fn added(&self) -> &[((usize, usize), f64)] {
        &self.added
    }
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
            problem.linearise_track((c, t), at.state, &views, &mut rows, |o, projection, root| {
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
