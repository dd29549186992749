//! What a set of motions is judged by: the variance of ln f, from an information matrix over the camera's numbers.

use nalgebra::SMatrix;

use crate::{numerics::linalg::inverse_spd, refine::blocks::MAX_CAMERA_NUMBERS, synthetic::points::MotionSpec};

/// A symmetric matrix over the numbers of the camera's block in the joint refinement (ln fx, ln fy/fx, cx, cy, skew in frame units, then
/// those of its lens); rows beyond its lens are zero.
pub(crate) type CameraMatrix = SMatrix<f64, MAX_CAMERA_NUMBERS, MAX_CAMERA_NUMBERS>;

/// Which of these numbers the estimator frees.
pub(super) type Free = [bool; MAX_CAMERA_NUMBERS];

/// A motion of the grid with what it says.
pub(super) struct Candidate {
    pub(super) spec: MotionSpec,
    pub(super) information: CameraMatrix,
    pub(super) matches: f64,
    pub(super) overlap: f64,
}

/// Inverse over the free numbers, zero elsewhere; `None` when singular.
pub(super) fn inverse_free(information: &CameraMatrix, free: &Free) -> Option<CameraMatrix> {
    let kept: Vec<usize> = (0..free.len()).filter(|&i| free[i]).collect();
    let dense = nalgebra::DMatrix::from_fn(kept.len(), kept.len(), |r, c| information[(kept[r], kept[c])]);
    let inverse = inverse_spd(&dense)?;
    let mut out = CameraMatrix::zeros();
    for (r, &i) in kept.iter().enumerate() {
        for (c, &j) in kept.iter().enumerate() {
            out[(i, j)] = inverse[(r, c)];
        }
    }
    Some(out)
}

/// Variance of ln √(fx fy).
pub(super) fn ln_f_variance(c: &CameraMatrix) -> f64 {
    c[(0, 0)] + c[(0, 1)] + 0.25 * c[(1, 1)]
}
