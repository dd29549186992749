//! The camera as Knight, Zisserman & Reid have it: eᵀ ω e = 0 of every motion with weight one (KZR 1.1), K by Cholesky, nothing weighted,
//! polished or known beforehand; and how the points' noise carries through it, to first order.
//!
//! ```text
//! cov(p) = Σ_i (∂p/∂e_i) C_i (∂p/∂e_i)ᵀ       p = (ln fx, ln fy/fx, cx, cy, skew), frame units
//! ```
//!
//! The derivatives are differences along the columns of a root of C_i, each of them an independent error of one deviation.

use nalgebra::{Matrix4, SMatrix, Vector4};

use crate::{
    error::Error,
    numerics::linalg::ComplexPoint,
    start::absolute_conic::{Constraint, Parameters, WeightedPoint, solve_unweighted},
};

/// Part of a deviation by which a point is moved for the differences.
pub(crate) const STEP_SIGMAS: f64 = 0.05;
/// Added to each variance, so that a point known exactly has a root.
const MIN_VARIANCE: f64 = 1e-20;

/// The solution from some circular points and its covariance to first order: (ln fx, ln fy/fx, cx, cy, skew), frame units; not finite
/// where a twentieth of a deviation leads to no camera. `aspect` is fy / fx where the constraint holds it.
///
/// # Errors
/// [`Error::NotPositiveDefinite`] when no real camera solves the equations.
pub(crate) fn solve_unweighted_with_covariance(
    points: &[WeightedPoint],
    constraint: Constraint,
    aspect: f64,
) -> Result<(Parameters, SMatrix<f64, 5, 5>), Error> {
    let mut bare: Vec<ComplexPoint> = points.iter().map(|p| p.point.point).collect();
    let p = solve_unweighted(&bare, constraint, aspect)?;
    let mut covariance = SMatrix::<f64, 5, 5>::zeros();
    for (i, WeightedPoint { point, covariance: of_point }) in points.iter().enumerate() {
        let regular = of_point + Matrix4::from_diagonal_element(MIN_VARIANCE);
        let Some(root) = regular.cholesky() else { continue };
        for c in 0..4 {
            let step: Vector4<f64> = root.l().column(c) * STEP_SIGMAS;
            let ends = [1.0, -1.0].map(|sign| {
                bare[i] = point.moved(&(step * sign)).normalize();
                solve_unweighted(&bare, constraint, aspect).ok()
            });
            bare[i] = point.point;
            let change = match ends {
                [Some(up), Some(down)] => (up - down) / (2.0 * STEP_SIGMAS),
                _ => Parameters::repeat(f64::INFINITY),
            };
            covariance += change * change.transpose();
        }
    }
    Ok((p, covariance))
}
