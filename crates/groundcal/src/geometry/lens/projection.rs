//! What a lens model says of a ray.

use nalgebra::{Matrix2x3, SMatrix, Vector2};

/// The most parameters a lens model has.
pub(crate) const MAX_LENS_PARAMETERS: usize = 5;

/// Derivatives of a point by the lens's own parameters, in their order; columns beyond their number are zero.
pub(crate) type ByLensParameters = SMatrix<f64, 2, MAX_LENS_PARAMETERS>;

/// Where a ray is seen, with derivatives.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct LensProjection {
    /// Distorted normalised coordinates: what the camera matrix takes to pixels.
    pub point: Vector2<f64>,
    /// By the ray, which need not be of unit length: the derivative along it is zero.
    pub by_ray: Matrix2x3<f64>,
    /// By the lens's parameters.
    pub by_parameters: ByLensParameters,
}
