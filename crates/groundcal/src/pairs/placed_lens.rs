//! A lens and the camera matrix through which it acts: between pixels and what an ideal lens would have given.
//!
//! ```text
//! pixel = K lens(ray),     ideal pixel ~ K ray
//! ```
//!
//! Ideal pixels of a lens that sees behind the camera are homogeneous, with any third coordinate; see `pairs::ray_match`.

use nalgebra::{Vector2, Vector3};

use crate::{
    geometry::{camera::Camera, homography::Homography, intrinsics::Intrinsics, lens::Lens},
    pairs::correspondence::PointMatch,
};

/// A lens, and the camera matrix through which it acts.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct PlacedLens {
    /// The lens.
    pub(crate) lens: Lens,
    /// Focal length and centre.
    pub(crate) intrinsics: Intrinsics,
}

/// A match as a camera of the same matrix without distortion would have given it, its deviation magnified as the lens was undone; `None` also
/// for what that camera would not have seen.
pub fn ideal_match(camera: &Camera, m: &PointMatch) -> Option<PointMatch> {
    PlacedLens { lens: camera.lens, intrinsics: camera.intrinsics }.ideal_match(m)
}

impl PlacedLens {
    /// The pixel an ideal lens would have given; `None` also for what it would not have seen.
    pub(crate) fn ideal_point(&self, p: &Vector2<f64>) -> Option<Vector2<f64>> {
        let ideal = self.lens.undistort(&self.intrinsics.normalised_from_pixel(p))?;
        Some(self.intrinsics.pixel_from_normalised(&ideal))
    }

    /// The pixel this lens gives for one of an ideal lens.
    pub(crate) fn real_point(&self, p: &Vector2<f64>) -> Option<Vector2<f64>> {
        let distorted = self.lens.distort(&self.intrinsics.normalised_from_pixel(p))?;
        Some(self.intrinsics.pixel_from_normalised(&distorted)).filter(|q| q.x.is_finite() && q.y.is_finite())
    }

    /// A match as an ideal lens would have given it, its deviation magnified as the lens was undone.
    pub(crate) fn ideal_match(&self, m: &PointMatch) -> Option<PointMatch> {
        let (a, b) = (self.ideal_point(&m.a)?, self.ideal_point(&m.b)?);
        let magnification = |ideal: &Vector2<f64>| {
            let ray = self.intrinsics.normalised_from_pixel(ideal).push(1.0);
            let across = self.lens.project_with_jacobian(&ray)?.by_ray.fixed_columns::<2>(0).determinant();
            Some(1.0 / across.abs().sqrt())
        };
        Some(PointMatch { a, b, sigma_px: m.sigma_px * 0.5 * (magnification(&a)? + magnification(&b)?) })
    }

    /// The ray of a pixel in homogeneous ideal pixels: K times the ray of unit length.
    pub(crate) fn ray_px(&self, p: &Vector2<f64>) -> Option<Vector3<f64>> {
        self.lens.unproject(&self.intrinsics.normalised_from_pixel(p)).map(|ray| self.intrinsics.matrix() * ray)
    }

    /// Where a homography between ideal pixels takes a pixel of the first image in the second, lens and all.
    pub(crate) fn carried(&self, h_b_from_a: &Homography, a: &Vector2<f64>) -> Option<Vector2<f64>> {
        if !self.lens.sees_behind() {
            return self.real_point(&h_b_from_a.apply(&self.ideal_point(a)?)?);
        }
        let ray = self.intrinsics.inverse_matrix() * (h_b_from_a.matrix() * self.ray_px(a)?);
        self.lens.project(&ray).map(|d| self.intrinsics.pixel_from_normalised(&d))
    }

    /// The same lens through another focal length; `None` for a model that has no such family
    /// ([`Lens::for_focal_length_times`]).
    pub(crate) fn with_focal_length(&self, f_px: f64) -> Option<Self> {
        let ratio = f_px / self.intrinsics.fx;
        let intrinsics = Intrinsics { fx: f_px, fy: self.intrinsics.fy * ratio, ..self.intrinsics };
        Some(Self { lens: self.lens.for_focal_length_times(ratio)?, intrinsics })
    }
}
