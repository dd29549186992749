//! A motion that may be planned, and what sums of information say of the camera.

use crate::{
    numerics::linalg::inverse_spd, plan::information::CameraMatrix, refine::CAMERA, synthetic::points::MotionSpec,
};

/// A motion of the grid with what it says.
pub(super) struct Candidate {
    pub(super) spec: MotionSpec,
    pub(super) information: CameraMatrix,
    pub(super) matches: f64,
    pub(super) overlap: f64,
}

/// Inverse over the free numbers, zero elsewhere; `None` when singular.
pub(super) fn inverse_free(information: &CameraMatrix, free: &[bool; CAMERA]) -> Option<CameraMatrix> {
    let kept: Vec<usize> = (0..CAMERA).filter(|&i| free[i]).collect();
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
