//! Homographies between two images of a plane: x_b ~ H x_a.
//!
//! H is named `h_b_from_a`, scaled to determinant 1; a point in front of both cameras then has a positive third
//! coordinate on either side (H&Z 21.1).

use nalgebra::{Matrix3, SMatrix, Vector2, Vector3};

use crate::{error::Error, geometry::frame::Frame};

/// An invertible 3x3 matrix of determinant 1 that takes homogeneous points of image a to image b.
///
/// # Examples
/// ```
/// use groundcal::{Homography, synthetic::PointScene};
/// // What the noise of a scene's matches is about.
/// let scene = PointScene { sigma_px: 1e-6, ..PointScene::nominal(0) };
/// let h: Homography = scene.homography(0).expect("the first motion");
/// let seen = scene.pairs()[0].matches[0];
/// assert!((h.apply(&seen.a).expect("finite") - seen.b).norm() < 1e-4);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Homography(Matrix3<f64>);

impl Homography {
    /// From any multiple of the matrix; refused when it is not finite or not invertible to working precision.
    pub(crate) fn new(h_b_from_a: Matrix3<f64>) -> Result<Self, Error> {
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
    pub(crate) fn matrix(&self) -> &Matrix3<f64> {
        &self.0
    }

    /// The image of a point; `None` when it goes to or beyond infinity.
    pub fn apply(&self, p: &Vector2<f64>) -> Option<Vector2<f64>> {
        let q = self.0 * Vector3::new(p.x, p.y, 1.0);
        (q.z > 0.0).then(|| Vector2::new(q.x / q.z, q.y / q.z))
    }

    /// The homography from b to a.
    pub(crate) fn inverse(&self) -> Self {
        let m = &self.0;
        // Determinant 1: the inverse is the adjugate, which never fails.
        let adjugate = Matrix3::from_fn(|r, c| {
            let (r1, r2, c1, c2) = ((c + 1) % 3, (c + 2) % 3, (r + 1) % 3, (r + 2) % 3);
            m[(r1, c1)] * m[(r2, c2)] - m[(r1, c2)] * m[(r2, c1)]
        });
        Self(adjugate)
    }

    /// The same map in frame coordinates, unit Frobenius norm.
    pub(crate) fn in_frame(&self, frame: &Frame) -> Matrix3<f64> {
        let m = frame.frame_matrix() * self.0 * frame.pixel_matrix();
        m / m.norm()
    }

    /// A map given in frame coordinates, in pixels.
    pub(crate) fn from_frame(m: &Matrix3<f64>, frame: &Frame) -> Result<Self, Error> {
        Self::new(frame.pixel_matrix() * m * frame.frame_matrix())
    }
}

impl From<Homography> for Matrix3<f64> {
    fn from(h_b_from_a: Homography) -> Self {
        h_b_from_a.0
    }
}

/// The covariance of the nine entries, row by row, of a matrix given in frame coordinates.
pub(crate) type HomographyCovariance = SMatrix<f64, 9, 9>;

/// From the covariance of the nine entries, row by row, of a matrix in pixels, of any scale, that of the same map in frame coordinates and
/// of unit norm: G = N H N⁻¹, g = G / |G|, and to first order dg = (I - g gᵀ) (N ⊗ N⁻ᵀ) dh / |G|.
///
/// # Errors
/// [`Error::InvalidInput`] where it is not finite.
pub(crate) fn covariance_in_frame(
    h_b_from_a: &Matrix3<f64>,
    covariance: &HomographyCovariance,
    frame: &Frame,
) -> Result<HomographyCovariance, Error> {
    let (n, back) = (frame.frame_matrix(), frame.pixel_matrix());
    let g = n * h_b_from_a * back;
    let norm = g.norm();
    let moved = HomographyCovariance::from_fn(|a, b| n[(a / 3, b / 3)] * back[(b % 3, a % 3)]);
    let unit = SMatrix::<f64, 9, 1>::from_fn(|a, _| g[(a / 3, a % 3)] / norm);
    let jacobian = (HomographyCovariance::identity() - unit * unit.transpose()) * moved / norm;
    let found = jacobian * covariance * jacobian.transpose();
    let finite = found.iter().all(|v| v.is_finite());
    finite.then_some(found).ok_or_else(|| Error::InvalidInput("a covariance is not finite".into()))
}

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

    #[test]
    fn a_covariance_goes_into_the_frame_as_differences_do() {
        let h = Matrix3::new(1.1, 0.2, 30.0, -0.1, 0.9, -20.0, 1e-4, -2e-4, 1.0) * 3.0;
        let frame = Frame::new(crate::geometry::size::ImageSize::new(640, 480), None);
        let unit = |h: &Matrix3<f64>| {
            let g = frame.frame_matrix() * h * frame.pixel_matrix();
            g / g.norm()
        };
        for entry in 0..9 {
            let at: f64 = h[(entry / 3, entry % 3)];
            let step = 1e-6 * (1.0 + at.abs());
            let mut moved = h;
            moved[(entry / 3, entry % 3)] += step;
            let change = (unit(&moved) - unit(&h)) / step;
            let mut covariance = HomographyCovariance::zeros();
            covariance[(entry, entry)] = 1.0;
            let found = covariance_in_frame(&h, &covariance, &frame).expect("finite");
            let expected = HomographyCovariance::from_fn(|a, b| change[(a / 3, a % 3)] * change[(b / 3, b % 3)]);
            assert!((found - expected).norm() < 1e-4 * expected.norm(), "{entry}: {found} {expected}");
        }
        assert!(covariance_in_frame(&h, &HomographyCovariance::from_element(f64::NAN), &frame).is_err());
    }
}
