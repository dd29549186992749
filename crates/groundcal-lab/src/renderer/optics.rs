//! The rays of a pixel's samples: one inversion of the lens model a pixel where the lens allows it, one a sample else.

use nalgebra::{Matrix2, Vector2, Vector3};

use groundcal::geometry::{Camera, ImageSize, Intrinsics, Lens};

/// A camera, prepared for many pixels.
#[derive(Debug, Clone)]
pub(super) enum Optics {
    /// Rays (x, y, 1): no distortion, or Brown-Conrady.
    Flat {
        /// Camera matrix.
        intrinsics: Intrinsics,
        /// Lens.
        lens: Lens,
    },
    /// Rays of unit length, in any direction.
    Wide(Camera),
}

/// What the samples of a pixel share.
pub(super) struct Middle {
    /// The ray of the pixel's centre.
    pub(super) ray: Vector3<f64>,
    /// Its change for a pixel along x and y.
    pub(super) per_pixel: [Vector3<f64>; 2],
    /// Derivative of the ideal by the distorted point.
    ideal_from_distorted: Matrix2<f64>,
}

impl Optics {
    /// Of a camera.
    pub(super) fn new(camera: &Camera) -> Self {
        let intrinsics = camera.intrinsics;
        if camera.lens.is_flat() { Self::Flat { intrinsics, lens: camera.lens } } else { Self::Wide(*camera) }
    }

    /// Whether rays (x, y, 1) are linear in the pixel.
    pub(super) fn is_straight(&self) -> bool {
        matches!(self, Self::Flat { lens, .. } if lens.is_none())
    }

    /// At a pixel's centre; `None` where the lens model gives no ray.
    pub(super) fn middle(&self, x: f64, y: f64) -> Option<Middle> {
        let pixel = Vector2::new(x, y);
        match self {
            Self::Flat { intrinsics: k, lens } => {
                let ideal = lens.undistort(&k.normalised_from_pixel(&pixel))?;
                let per_pixel = Matrix2::new(1.0 / k.fx, -k.skew / (k.fx * k.fy), 0.0, 1.0 / k.fy);
                let ideal_from_distorted =
                    if lens.is_none() { Matrix2::identity() } else { slope(lens, &ideal)?.try_inverse()? };
                let ideal_from_pixel = ideal_from_distorted * per_pixel;
                let per_pixel = [0, 1].map(|j| ideal_from_pixel.column(j).push(0.0));
                Some(Middle { ray: ideal.push(1.0), per_pixel, ideal_from_distorted })
            }
            Self::Wide(camera) => {
                let ray = camera.unproject(&pixel)?;
                let by_ray = camera.derivative_by_point(&ray)?;
                // Of the directions' changes that move the pixel so, those across the ray.
                let across = by_ray.transpose() * (by_ray * by_ray.transpose()).try_inverse()?;
                let per_pixel = [0, 1].map(|j| across.column(j).into_owned());
                Some(Middle { ray, per_pixel, ideal_from_distorted: Matrix2::identity() })
            }
        }
    }

    /// The ray at `pixel + offset`, a fraction of a pixel from the middle. Two simplified Newton steps leave less than 1e-9 px;
    /// where they do not, the lens model is inverted in full.
    pub(super) fn near(&self, middle: &Middle, pixel: [f64; 2], offset: [f64; 2]) -> Option<Vector3<f64>> {
        let at = Vector2::new(pixel[0] + offset[0], pixel[1] + offset[1]);
        let (k, lens) = match self {
            Self::Flat { intrinsics, lens } => (intrinsics, lens),
            Self::Wide(camera) => return camera.unproject(&at),
        };
        let distorted = k.normalised_from_pixel(&at);
        let mut p = middle.ray.xy() + middle.per_pixel[0].xy() * offset[0] + middle.per_pixel[1].xy() * offset[1];
        let mut step = 0.0;
        for _ in 0..2 {
            let Some(there) = lens.project(&p.push(1.0)) else {
                // Beyond the fold.
                step = f64::INFINITY;
                break;
            };
            let correction = middle.ideal_from_distorted * (there - distorted);
            p -= correction;
            step = correction.norm_squared();
        }
        // The steps shrink by a factor of a thousand or so; the last one bounds what is left.
        let ideal = if step < 1e-18 { p } else { lens.undistort(&distorted)? };
        Some(ideal.push(1.0))
    }
}

/// Derivative of the distorted by the ideal point.
fn slope(lens: &Lens, ideal: &Vector2<f64>) -> Option<Matrix2<f64>> {
    let camera = Camera { size: ImageSize::new(1, 1), intrinsics: Intrinsics::square(1.0, 0.0, 0.0), lens: *lens };
    // At depth 1 the first two columns are by the ideal point.
    Some(camera.derivative_by_point(&ideal.push(1.0))?.fixed_columns::<2>(0).into_owned())
}
