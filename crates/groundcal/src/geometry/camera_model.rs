//! A whole camera, as files of this and other programs describe it: image size, camera matrix, and the lens with the third
//! radial coefficient that others estimate and [`crate::calibrate`] does not.
//!
//! ```text
//! x_d = x (1 + k1 r² + k2 r⁴ + k3 r⁶) + 2 p1 x y + p2 (r² + 2 x²)
//! y_d = y (1 + k1 r² + k2 r⁴ + k3 r⁶) + p1 (r² + 2 y²) + 2 p2 x y        pixel = K (x_d, y_d, 1)
//! ```
//!
//! (Brown-Conrady, OpenCV's first five coefficients), with (x, y) = (X/Z, Y/Z) of the camera frame (x right, y down, z forward)
//! and pixel (0, 0) at the centre of the top-left pixel.

use nalgebra::{Matrix2, Vector2, Vector3};

use crate::geometry::{distortion::Distortion, intrinsics::Intrinsics, size::ImageSize};

/// Steps at which the way from the optical axis to a point is checked for the lens model's fold.
const FOLD_STEPS: u32 = 16;

/// Image size, camera matrix and lens.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CameraModel {
    /// Image size in pixels.
    pub size: ImageSize,
    /// Camera matrix in pixels.
    pub intrinsics: Intrinsics,
    /// k1, k2, p1, p2.
    pub distortion: Distortion,
    /// Radial, sixth order.
    pub k3: f64,
}

impl CameraModel {
    /// Ideal to distorted normalised coordinates.
    pub fn distort(&self, p: &Vector2<f64>) -> Vector2<f64> {
        let r2 = p.norm_squared();
        self.distortion.distort(p) + p * (self.k3 * r2 * r2 * r2)
    }

    /// The derivative of [`Self::distort`].
    pub fn distort_jacobian(&self, p: &Vector2<f64>) -> Matrix2<f64> {
        let r2 = p.norm_squared();
        let radial = Matrix2::identity() * (r2 * r2 * r2) + p * p.transpose() * (6.0 * r2 * r2);
        self.distortion.distort_jacobian(p) + radial * self.k3
    }

    /// Whether the lens model is invertible all the way from the optical axis to this ideal point (normalised coordinates).
    pub fn within_fold(&self, p: &Vector2<f64>) -> bool {
        let straight = self.distortion.is_none() && self.k3 == 0.0;
        straight
            || (1..=FOLD_STEPS).all(|i| {
                let part = p * (f64::from(i) / f64::from(FOLD_STEPS));
                self.distort_jacobian(&part).determinant() > 0.0
            })
    }

    /// The direction (z = 1, camera frame) that is seen at a pixel; `None` where the lens model gives none: nothing within its
    /// fold maps there.
    pub fn ray(&self, pixel: &Vector2<f64>) -> Option<Vector3<f64>> {
        let d = self.intrinsics.normalised_from_pixel(pixel);
        let mut p = if self.k3 == 0.0 { self.distortion.undistort(&d)? } else { d };
        if self.k3 != 0.0 {
            for _ in 0..50 {
                let j = self.distort_jacobian(&p);
                // Past the fold the Jacobian turns over: what is sought lies further in.
                if j.determinant() < 1e-3 {
                    p *= 0.7;
                    continue;
                }
                let step = j.try_inverse()? * (self.distort(&p) - d);
                p -= step;
                if step.norm() <= 1e-14 * (1.0 + p.norm()) {
                    break;
                }
            }
        }
        let found = (self.distort(&p) - d).norm() <= 1e-10 * (1.0 + d.norm());
        (found && self.within_fold(&p)).then(|| Vector3::new(p.x, p.y, 1.0))
    }

    /// The pixel at which a point in camera coordinates is seen; `None` behind the camera or beyond the lens model's fold.
    pub fn pixel(&self, x: &Vector3<f64>) -> Option<Vector2<f64>> {
        if x.z <= 1e-9 * x.norm() {
            return None;
        }
        let p = Vector2::new(x.x / x.z, x.y / x.z);
        self.within_fold(&p).then(|| self.intrinsics.pixel_from_normalised(&self.distort(&p)))
    }

    /// The same camera with its images scaled to another size. Pixel centres are at whole numbers, so a coordinate u becomes
    /// (u + ½) s - ½.
    pub fn scaled_to(&self, size: ImageSize) -> Self {
        let sx = size.width as f64 / self.size.width as f64;
        let sy = size.height as f64 / self.size.height as f64;
        let k = &self.intrinsics;
        let intrinsics = Intrinsics {
            fx: k.fx * sx,
            fy: k.fy * sy,
            cx: (k.cx + 0.5) * sx - 0.5,
            cy: (k.cy + 0.5) * sy - 0.5,
            skew: k.skew * sx,
        };
        Self { size, intrinsics, ..*self }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn camera(k1: f64, k2: f64, k3: f64) -> CameraModel {
        CameraModel {
            size: ImageSize::new(800, 600),
            intrinsics: Intrinsics { fx: 620.0, fy: 625.0, cx: 405.0, cy: 297.0, skew: 0.4 },
            distortion: Distortion { p1: 1e-3, p2: -5e-4, ..Distortion::radial(k1, k2) },
            k3,
        }
    }

    #[test]
    fn pixels_become_rays_and_pixels_again() {
        for camera in [camera(-0.3, 0.12, -0.02), camera(0.05, 0.0, 0.01), camera(-0.1, 0.02, 0.0)] {
            for x in (0..=800).step_by(100) {
                for y in (0..=600).step_by(100) {
                    let pixel = Vector2::new(f64::from(x), f64::from(y));
                    let back = camera.pixel(&(camera.ray(&pixel).expect("inside") * 3.0)).expect("inside");
                    assert!((back - pixel).norm() < 1e-7, "{pixel} {back}");
                }
            }
        }
    }

    #[test]
    fn the_jacobian_agrees_with_differences() {
        let (camera, p, h) = (camera(-0.2, 0.05, -0.03), Vector2::new(0.31, -0.42), 1e-6);
        for c in 0..2 {
            let mut step = Vector2::zeros();
            step[c] = h;
            let difference = (camera.distort(&(p + step)) - camera.distort(&(p - step))) / (2.0 * h);
            assert!((difference - camera.distort_jacobian(&p).column(c)).norm() < 1e-8);
        }
    }

    #[test]
    fn beyond_the_fold_there_is_neither_ray_nor_pixel() {
        // 1 + 3 k1 r² is zero at r = 0.816.
        let folding = camera(-0.5, 0.0, 0.0);
        assert_eq!(folding.pixel(&Vector3::new(1.2, 0.0, 1.0)), None);
        assert_eq!(folding.ray(&Vector2::new(2000.0, 297.0)), None);
        // With k2 the model rises again beyond its fold (0.61 to 1.03), which must not pass for a picture.
        let twice = camera(-1.2, 0.5, 0.0);
        assert!(twice.distort_jacobian(&Vector2::new(1.4, 0.0)).determinant() > 0.0);
        assert_eq!(twice.pixel(&Vector3::new(1.4, 0.0, 1.0)), None);
    }

    #[test]
    fn scaling_keeps_the_image_borders() {
        let (whole, half) = (camera(-0.2, 0.0, 0.0), camera(-0.2, 0.0, 0.0).scaled_to(ImageSize::new(400, 300)));
        // The corner of the image, half a pixel outside the centre of its first pixel.
        let corner = Vector2::new(-0.5, -0.5);
        let (a, b) = (whole.ray(&corner).expect("inside"), half.ray(&corner).expect("inside"));
        assert!((a - b).norm() < 1e-12);
    }
}
