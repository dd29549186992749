//! Homographies between two images of a plane: x_b ~ H x_a.
//!
//! H is named `h_b_from_a`, scaled to determinant 1; a point in front of both cameras then has a positive third
//! coordinate on either side (H&Z 21.1).

use nalgebra::{Matrix3, SMatrix, Vector2, Vector3};

use crate::{error::Error, geometry::frame::Frame};

/// An invertible 3x3 matrix of determinant 1 that takes homogeneous points of image a to image b.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Homography(Matrix3<f64>);

impl Homography {
    /// From any multiple of the matrix; refused when it is not finite or not invertible to working precision.
    pub fn new(h_b_from_a: Matrix3<f64>) -> Result<Self, Error> {
        if !h_b_from_a.iter().all(|v| v.is_finite()) {
            return Err(Error::InvalidInput("a homography has an entry that is not a finite number".into()));
        }
        let det = h_b_from_a.determinant();
        let relative = det.abs() / h_b_from_a.norm().powi(3);
        if relative.is_nan() || relative < 1e-18 {
            return Err(Error::InvalidInput(format!(
                "a homography is not invertible (determinant over norm cubed {relative:.1e})"
            )));
        }
        Ok(Self(h_b_from_a / det.cbrt()))
    }

    /// The matrix, determinant 1.
    pub fn matrix(&self) -> &Matrix3<f64> {
        &self.0
    }

    /// The image of a point; `None` when it goes to or beyond infinity.
    pub fn apply(&self, p: &Vector2<f64>) -> Option<Vector2<f64>> {
        let q = self.0 * Vector3::new(p.x, p.y, 1.0);
        (q.z > 0.0).then(|| Vector2::new(q.x / q.z, q.y / q.z))
    }

    /// The homography from b to a.
    pub fn inverse(&self) -> Self {
        let m = &self.0;
        // Determinant 1: the inverse is the adjugate, which never fails.
        let adjugate = Matrix3::from_fn(|r, c| {
            let (r1, r2, c1, c2) = ((c + 1) % 3, (c + 2) % 3, (r + 1) % 3, (r + 2) % 3);
            m[(r1, c1)] * m[(r2, c2)] - m[(r1, c2)] * m[(r2, c1)]
        });
        Self(adjugate)
    }

    /// The same map in frame coordinates, unit Frobenius norm.
    pub fn in_frame(&self, frame: &Frame) -> Matrix3<f64> {
        let m = frame.frame_matrix() * self.0 * frame.pixel_matrix();
        m / m.norm()
    }

    /// A map given in frame coordinates, in pixels.
    pub fn from_frame(m: &Matrix3<f64>, frame: &Frame) -> Result<Self, Error> {
        Self::new(frame.pixel_matrix() * m * frame.frame_matrix())
    }
}

/// The covariance of the nine entries, row by row, of a matrix given in frame coordinates.
pub type HomographyCovariance = SMatrix<f64, 9, 9>;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn inverse_and_frame_round_trip() {
        let h = Homography::new(Matrix3::new(1.1, 0.2, 30.0, -0.1, 0.9, -20.0, 1e-4, -2e-4, 1.0)).expect("invertible");
        let p = Vector2::new(321.0, 123.0);
        let q = h.apply(&p).expect("in front");
        assert!((h.inverse().apply(&q).expect("in front") - p).norm() < 1e-9);
        let frame = Frame::new(crate::geometry::size::ImageSize::new(640, 480), None);
        let back = Homography::from_frame(&h.in_frame(&frame), &frame).expect("invertible");
        assert!((back.matrix() - h.matrix()).norm() < 1e-10);
        assert!(Homography::new(Matrix3::zeros()).is_err());
        assert!(Homography::new(Matrix3::from_element(f64::NAN)).is_err());
    }
}
