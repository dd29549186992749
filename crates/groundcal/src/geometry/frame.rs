//! The frame in which the estimation is done.
//!
//! One similarity for **both** images of a motion, since eigenvectors of a homography mean nothing otherwise:
//! x' = (x - x0) / s with the assumed principal point x0 as origin and half the mean image side s as unit.

use nalgebra::{Matrix3, SMatrix, Vector2};

use crate::geometry::{intrinsics::Intrinsics, size::ImageSize};

/// A similarity without rotation: pixels to units of half the mean image side about an origin.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Frame {
    /// Origin in pixels.
    pub origin_px: Vector2<f64>,
    /// Pixels for one unit of the frame.
    pub scale_px: f64,
}

impl Frame {
    /// The frame for an image size and an assumed principal point in pixels (default: the image centre).
    pub fn new(size: ImageSize, principal_point_px: Option<[f64; 2]>) -> Self {
        let [x, y] = principal_point_px.unwrap_or(size.centre_px());
        Self { origin_px: Vector2::new(x, y), scale_px: size.half_mean_side_px() }
    }

    /// Pixels to frame.
    pub(crate) fn local(&self, p: &Vector2<f64>) -> Vector2<f64> {
        (p - self.origin_px) / self.scale_px
    }

    /// Frame to pixels.
    pub(crate) fn pixel(&self, p: &Vector2<f64>) -> Vector2<f64> {
        p * self.scale_px + self.origin_px
    }

    /// The matrix that takes homogeneous frame coordinates to pixels.
    pub(crate) fn pixel_matrix(&self) -> Matrix3<f64> {
        Matrix3::new(self.scale_px, 0.0, self.origin_px.x, 0.0, self.scale_px, self.origin_px.y, 0.0, 0.0, 1.0)
    }

    /// The matrix that takes homogeneous pixels to frame coordinates.
    pub(crate) fn frame_matrix(&self) -> Matrix3<f64> {
        let s = 1.0 / self.scale_px;
        Matrix3::new(s, 0.0, -self.origin_px.x * s, 0.0, s, -self.origin_px.y * s, 0.0, 0.0, 1.0)
    }

    /// A camera matrix in pixels from one in frame units.
    pub(crate) fn intrinsics_to_pixel(&self, k: &Intrinsics) -> Intrinsics {
        Intrinsics {
            fx: k.fx * self.scale_px,
            fy: k.fy * self.scale_px,
            cx: k.cx * self.scale_px + self.origin_px.x,
            cy: k.cy * self.scale_px + self.origin_px.y,
            skew: k.skew * self.scale_px,
        }
    }

    /// Derivatives of (fx, fy, cx, cy, skew) in pixels by (ln fx, ln fy/fx, cx, cy, skew) in frame units.
    pub(crate) fn pixels_by_logarithms(&self, k_px: &Intrinsics) -> SMatrix<f64, 5, 5> {
        let mut jacobian = SMatrix::from_diagonal_element(self.scale_px);
        jacobian[(0, 0)] = k_px.fx;
        (jacobian[(1, 0)], jacobian[(1, 1)]) = (k_px.fy, k_px.fy);
        jacobian
    }

    /// A camera matrix in frame units from one in pixels.
    pub(crate) fn intrinsics_from_pixel(&self, k: &Intrinsics) -> Intrinsics {
        Intrinsics {
            fx: k.fx / self.scale_px,
            fy: k.fy / self.scale_px,
            cx: (k.cx - self.origin_px.x) / self.scale_px,
            cy: (k.cy - self.origin_px.y) / self.scale_px,
            skew: k.skew / self.scale_px,
        }
    }
}
