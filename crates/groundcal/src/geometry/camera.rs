//! The camera: image size, camera matrix, lens.
//!
//! ```text
//! pixel = K (x_d, y_d, 1),     (x_d, y_d) = lens(X, Y, Z)
//! ```
//!
//! with (X, Y, Z) in the camera frame (x right, y down, z forward) and pixel (0, 0) at the centre of the top-left pixel.
//!
//! The order of its parameters, everywhere: fx, fy, cx, cy, skew ([`INTRINSIC_NAMES`]), then those of the lens
//! ([`Lens::parameter_names`]).

#[cfg(test)]
use nalgebra::Matrix2x5;
use nalgebra::{Matrix2, Matrix2x3, Vector2, Vector3};
use serde::{Deserialize, Serialize};

use crate::geometry::{intrinsics::Intrinsics, lens::Lens, size::ImageSize};

/// Names of the camera matrix's parameters, in their order.
pub(crate) const INTRINSIC_NAMES: [&str; 5] = ["fx", "fy", "cx", "cy", "skew"];

/// Image size, camera matrix and lens. As JSON: `image_size`, `fx`, `fy`, `cx`, `cy`, `skew`, `distortion`.
///
/// # Examples
/// ```
/// use groundcal::{Camera, ImageSize, Intrinsics, Lens, nalgebra::{Vector2, Vector3}};
/// let camera = Camera { size: ImageSize::new(640, 480), intrinsics: Intrinsics::square(500.0, 319.5, 239.5), lens: Lens::radial(-0.1, 0.0) };
/// let pixel = camera.project(&Vector3::new(0.1, -0.2, 1.0)).expect("in front");
/// let ray = camera.unproject(&pixel).expect("in the image");
/// assert!((ray.xy() / ray.z - Vector2::new(0.1, -0.2)).norm() < 1e-9);
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(from = "Record", into = "Record")]
pub struct Camera {
    /// Image size in pixels.
    pub size: ImageSize,
    /// Camera matrix in pixels.
    pub intrinsics: Intrinsics,
    /// Lens.
    pub lens: Lens,
}

/// A camera as files have it.
#[derive(Serialize, Deserialize)]
struct Record {
    image_size: [usize; 2],
    #[serde(flatten)]
    intrinsics: Intrinsics,
    #[serde(default)]
    distortion: Lens,
}

impl From<Record> for Camera {
    fn from(r: Record) -> Self {
        Self { size: ImageSize::new(r.image_size[0], r.image_size[1]), intrinsics: r.intrinsics, lens: r.distortion }
    }
}

impl From<Camera> for Record {
    fn from(c: Camera) -> Self {
        Self { image_size: [c.size.width, c.size.height], intrinsics: c.intrinsics, distortion: c.lens }
    }
}

/// Where a point is seen, with derivatives.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct CameraProjection {
    /// The pixel.
    pub(crate) pixel: Vector2<f64>,
    /// By the point, or the ray.
    pub(crate) by_point: Matrix2x3<f64>,
    /// By fx, fy, cx, cy, skew.
    #[cfg(test)]
    pub(crate) by_intrinsics: Matrix2x5<f64>,
    /// By the lens's parameters; columns beyond their number are zero.
    #[cfg(test)]
    pub(crate) by_lens: crate::geometry::lens::ByLensParameters,
}

impl Camera {
    /// The pixel at which a point in camera coordinates, or a ray of any length, is seen; `None` where the lens model describes
    /// none. It may lie outside the image.
    pub fn project(&self, point: &Vector3<f64>) -> Option<Vector2<f64>> {
        self.lens.project(point).map(|d| self.intrinsics.pixel_from_normalised(&d))
    }

    /// How that pixel changes with the point, or the ray.
    pub fn derivative_by_point(&self, point: &Vector3<f64>) -> Option<Matrix2x3<f64>> {
        Some(self.project_with_jacobians(point)?.by_point)
    }

    /// [`Self::project`] with derivatives.
    pub(crate) fn project_with_jacobians(&self, point: &Vector3<f64>) -> Option<CameraProjection> {
        let lens = self.lens.project_with_jacobian(point)?;
        let (k, d) = (&self.intrinsics, &lens.point);
        let linear = Matrix2::new(k.fx, k.skew, 0.0, k.fy);
        Some(CameraProjection {
            pixel: k.pixel_from_normalised(d),
            by_point: linear * lens.by_ray,
            #[cfg(test)]
            by_intrinsics: Matrix2x5::new(d.x, 0.0, 1.0, 0.0, d.y, 0.0, d.y, 0.0, 1.0, 0.0),
            #[cfg(test)]
            by_lens: linear * lens.by_parameters,
        })
    }

    /// The ray, of unit length in camera coordinates, that is seen at a pixel; `None` where the lens model gives none.
    pub fn unproject(&self, pixel: &Vector2<f64>) -> Option<Vector3<f64>> {
        self.lens.unproject(&self.intrinsics.normalised_from_pixel(pixel))
    }

    /// Names of the parameters, in their order.
    #[cfg(test)]
    pub(crate) fn parameter_names(&self) -> Vec<&'static str> {
        INTRINSIC_NAMES.iter().chain(self.lens.parameter_names()).copied().collect()
    }

    /// The parameters.
    #[cfg(test)]
    pub(crate) fn parameters(&self) -> Vec<f64> {
        let k = &self.intrinsics;
        [k.fx, k.fy, k.cx, k.cy, k.skew].into_iter().chain(self.lens.parameters()).collect()
    }

    /// The same image size and lens model with other parameters; `None` where their number is not the model's.
    #[cfg(test)]
    pub(crate) fn with_parameters(&self, parameters: &[f64]) -> Option<Self> {
        let [fx, fy, cx, cy, skew, lens @ ..] = parameters else { return None };
        let intrinsics = Intrinsics { fx: *fx, fy: *fy, cx: *cx, cy: *cy, skew: *skew };
        Some(Self { intrinsics, lens: self.lens.with_parameters(lens)?, ..*self })
    }

    /// The same camera with its images scaled to another size; `None` where that has another shape, so that it is not the same picture. Pixel centres are at whole numbers, so a coordinate u becomes
    /// (u + ½) s - ½.
    pub fn scaled_to(&self, size: ImageSize) -> Option<Self> {
        if !size.has_shape_of(self.size) {
            return None;
        }
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
        Some(Self { size, intrinsics, ..*self })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::lens::{Division, Fisheye, Radtan};

    fn camera(lens: Lens) -> Camera {
        let intrinsics = Intrinsics { fx: 420.0, fy: 425.0, cx: 405.0, cy: 297.0, skew: 0.4 };
        Camera { size: ImageSize::new(800, 600), intrinsics, lens }
    }

    fn lenses() -> [Lens; 4] {
        [
            Lens::None,
            Lens::Radtan(Radtan::new([-0.2, 0.05, 1e-3, -5e-4, -0.003])),
            Lens::Division(Division::new(-0.4)),
            Lens::Fisheye(Fisheye::new([0.02, -0.01, 0.003, -0.0005])),
        ]
    }

    #[test]
    fn pixels_become_rays_and_pixels_again() {
        for lens in lenses() {
            let camera = camera(lens);
            for x in (0..=800).step_by(100) {
                for y in (0..=600).step_by(100) {
                    let pixel = Vector2::new(f64::from(x), f64::from(y));
                    let back = camera.project(&(camera.unproject(&pixel).expect("inside") * 3.0)).expect("inside");
                    assert!((back - pixel).norm() < 1e-9, "{lens:?} {pixel} {back}");
                }
            }
        }
    }

    #[test]
    fn derivatives_agree_with_differences() {
        for lens in lenses() {
            let camera = camera(lens);
            let point = Vector3::new(0.7, -0.4, 1.1);
            let p = camera.project_with_jacobians(&point).expect("inside");
            assert_eq!(Some(p.pixel), camera.project(&point));
            let parameters = camera.parameters();
            assert_eq!(parameters.len(), camera.parameter_names().len());
            assert_eq!(camera.with_parameters(&parameters), Some(camera));
            assert_eq!(camera.with_parameters(&parameters[1..]), None);
            let agree = |difference: Vector2<f64>, analytic: Vector2<f64>, what: &str| {
                assert!((difference - analytic).norm() < 1e-6 * (1.0 + analytic.norm()), "{lens:?} {what}");
            };
            let h = 1e-6;
            for c in 0..3 {
                let mut step = Vector3::zeros();
                step[c] = h;
                let at = |p: Vector3<f64>| camera.project(&p).expect("inside");
                let difference = (at(point + step) - at(point - step)) / (2.0 * h);
                agree(difference, p.by_point.column(c).into(), "point");
            }
            for (i, name) in camera.parameter_names().into_iter().enumerate() {
                let at = |step: f64| {
                    let mut moved = parameters.clone();
                    moved[i] += step;
                    camera.with_parameters(&moved).and_then(|c| c.project(&point)).expect("inside")
                };
                let difference = (at(h) - at(-h)) / (2.0 * h);
                let analytic = if i < 5 { p.by_intrinsics.column(i) } else { p.by_lens.column(i - 5) };
                agree(difference, analytic.into(), name);
            }
        }
    }

    #[test]
    fn json_brings_the_camera_back() {
        for lens in lenses() {
            let text = serde_json::to_string(&camera(lens)).expect("JSON");
            assert!(text.contains(&format!("\"model\":\"{}\"", lens.name())), "{text}");
            assert_eq!(serde_json::from_str::<Camera>(&text).expect("read"), camera(lens), "{text}");
        }
        let text = serde_json::to_string(&camera(Lens::radial(-0.1, 0.0))).expect("JSON");
        let expected = r#"{"image_size":[800,600],"fx":420.0,"fy":425.0,"cx":405.0,"cy":297.0,"skew":0.4,"distortion":{"model":"radtan","k1":-0.1,"k2":0.0,"p1":0.0,"p2":0.0}}"#;
        assert_eq!(text, expected);
    }

    #[test]
    fn scaling_keeps_the_image_borders() {
        for lens in lenses() {
            let (whole, half) = (camera(lens), camera(lens).scaled_to(ImageSize::new(400, 300)).expect("one shape"));
            // The corner of the image, half a pixel outside the centre of its first pixel.
            let corner = Vector2::new(-0.5, -0.5);
            let (a, b) = (whole.unproject(&corner).expect("inside"), half.unproject(&corner).expect("inside"));
            assert!((a - b).norm() < 1e-12);
        }
    }
}
