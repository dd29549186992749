//! The camera matrix
//!
//! ```text
//!     | fx  skew  cx |
//! K = | 0    fy   cy |      x_pixel ~ K x_camera,   camera frame: x right, y down, z forward
//!     | 0    0    1  |
//! ```
//!
//! in pixels, pixel (0, 0) being the centre of the top-left pixel.

use nalgebra::{Matrix3, Vector2, Vector3};
use serde::{Deserialize, Serialize};

/// The five numbers of the camera matrix, in pixels.
///
/// # Examples
/// ```
/// use groundcal::{Intrinsics, nalgebra::Vector2};
/// let k = Intrinsics::square(500.0, 320.0, 240.0);
/// assert_eq!(k.normalised_from_pixel(&Vector2::new(570.0, 490.0)), Vector2::new(0.5, 0.5));
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Intrinsics {
    /// Focal length along the image's x axis, in pixels.
    pub fx: f64,
    /// Focal length along the image's y axis, in pixels.
    pub fy: f64,
    /// Principal point, x, in pixels from the centre of the top-left pixel.
    pub cx: f64,
    /// Principal point, y, in pixels from the centre of the top-left pixel.
    pub cy: f64,
    /// Skew in pixels (0 for every camera made today).
    #[serde(default)]
    pub skew: f64,
}

impl Intrinsics {
    /// A camera of square pixels: focal length and principal point in pixels.
    pub fn square(f_px: f64, cx: f64, cy: f64) -> Self {
        Self { fx: f_px, fy: f_px, cx, cy, skew: 0.0 }
    }

    /// The matrix K.
    pub fn matrix(&self) -> Matrix3<f64> {
        Matrix3::new(self.fx, self.skew, self.cx, 0.0, self.fy, self.cy, 0.0, 0.0, 1.0)
    }

    /// The matrix K⁻¹, in closed form.
    pub fn inverse_matrix(&self) -> Matrix3<f64> {
        let (fx, fy, cx, cy, s) = (self.fx, self.fy, self.cx, self.cy, self.skew);
        Matrix3::new(1.0 / fx, -s / (fx * fy), (s * cy - cx * fy) / (fx * fy), 0.0, 1.0 / fy, -cy / fy, 0.0, 0.0, 1.0)
    }

    /// From an upper triangular matrix with positive diagonal, divided by its last entry; `None` when it is not one.
    pub(crate) fn from_matrix(k: &Matrix3<f64>) -> Option<Self> {
        let k = k / k[(2, 2)];
        let upper = k[(1, 0)] == 0.0 && k[(2, 0)] == 0.0 && k[(2, 1)] == 0.0;
        let ok = upper && k[(0, 0)] > 0.0 && k[(1, 1)] > 0.0 && k.iter().all(|v| v.is_finite());
        ok.then(|| Self { fx: k[(0, 0)], fy: k[(1, 1)], cx: k[(0, 2)], cy: k[(1, 2)], skew: k[(0, 1)] })
    }

    /// Normalised camera coordinates (x/z, y/z) to pixels.
    pub(crate) fn pixel_from_normalised(&self, p: &Vector2<f64>) -> Vector2<f64> {
        Vector2::new(self.fx * p.x + self.skew * p.y + self.cx, self.fy * p.y + self.cy)
    }

    /// Pixels to normalised camera coordinates (x/z, y/z).
    pub fn normalised_from_pixel(&self, p: &Vector2<f64>) -> Vector2<f64> {
        let y = (p.y - self.cy) / self.fy;
        Vector2::new((p.x - self.cx - self.skew * y) / self.fx, y)
    }

    /// Direction (not of unit length, z = 1) of the ray through a pixel, in the camera frame.
    pub(crate) fn ray(&self, p: &Vector2<f64>) -> Vector3<f64> {
        let n = self.normalised_from_pixel(p);
        Vector3::new(n.x, n.y, 1.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn inverse_matrix_and_point_maps_agree_with_the_matrix() {
        let k = Intrinsics { fx: 900.0, fy: 910.0, cx: 500.0, cy: 370.0, skew: 2.5 };
        assert!((k.matrix() * k.inverse_matrix() - Matrix3::identity()).norm() < 1e-12);
        assert_eq!(Intrinsics::from_matrix(&(k.matrix() * 3.0)).map(|q| (q.fx - k.fx).abs() < 1e-9), Some(true));
        let p = Vector2::new(123.4, 567.8);
        assert!((k.pixel_from_normalised(&k.normalised_from_pixel(&p)) - p).norm() < 1e-10);
        let q = k.matrix() * k.ray(&p);
        assert!((Vector2::new(q.x / q.z, q.y / q.z) - p).norm() < 1e-10);
    }
}
