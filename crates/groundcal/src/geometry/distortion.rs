//! Lens distortion, Brown-Conrady as in OpenCV ("radtan", "plumb bob").
//!
//! With normalised coordinates (x, y) and r² = x² + y²:
//!
//! ```text
//! x_d = x (1 + k1 r² + k2 r⁴) + 2 p1 x y + p2 (r² + 2 x²)
//! y_d = y (1 + k1 r² + k2 r⁴) + p1 (r² + 2 y²) + 2 p2 x y
//! ```

use nalgebra::{Matrix2, Vector2};
use serde::{Deserialize, Serialize};

use crate::geometry::{
    intrinsics::Intrinsics,
    lens::{Lens, Radtan},
};

/// Coefficients of the lens distortion (no unit: they act on coordinates divided by the focal length).
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Distortion {
    /// Radial, second order.
    #[serde(default)]
    pub k1: f64,
    /// Radial, fourth order.
    #[serde(default)]
    pub k2: f64,
    /// Tangential.
    #[serde(default)]
    pub p1: f64,
    /// Tangential.
    #[serde(default)]
    pub p2: f64,
}

impl Distortion {
    /// Radial distortion alone.
    pub fn radial(k1: f64, k2: f64) -> Self {
        Self { k1, k2, p1: 0.0, p2: 0.0 }
    }

    /// Whether all coefficients are zero.
    pub fn is_none(&self) -> bool {
        self.k1 == 0.0 && self.k2 == 0.0 && self.p1 == 0.0 && self.p2 == 0.0
    }

    /// Ideal to distorted normalised coordinates.
    pub fn distort(&self, p: &Vector2<f64>) -> Vector2<f64> {
        let (x, y) = (p.x, p.y);
        let r2 = x * x + y * y;
        let radial = 1.0 + r2 * (self.k1 + self.k2 * r2);
        Vector2::new(
            x * radial + 2.0 * self.p1 * x * y + self.p2 * (r2 + 2.0 * x * x),
            y * radial + self.p1 * (r2 + 2.0 * y * y) + 2.0 * self.p2 * x * y,
        )
    }

    /// The derivative of [`Self::distort`].
    pub fn distort_jacobian(&self, p: &Vector2<f64>) -> Matrix2<f64> {
        let (x, y) = (p.x, p.y);
        let r2 = x * x + y * y;
        let radial = 1.0 + r2 * (self.k1 + self.k2 * r2);
        let slope = 2.0 * (self.k1 + 2.0 * self.k2 * r2);
        let off = x * y * slope + 2.0 * self.p1 * x + 2.0 * self.p2 * y;
        Matrix2::new(
            radial + x * x * slope + 2.0 * self.p1 * y + 6.0 * self.p2 * x,
            off,
            off,
            radial + y * y * slope + 6.0 * self.p1 * y + 2.0 * self.p2 * x,
        )
    }

    /// Whether an ideal point lies within the first fold of the lens model, where the map is one to one. Further out the polynomial
    /// may rise again and show points far to the side in the middle of the image.
    pub fn is_one_to_one_at(&self, p: &Vector2<f64>) -> bool {
        if self.is_none() {
            return true;
        }
        // Radially: the first root of d/dr (r + k1 r³ + k2 r⁵) = 1 + b s + a s², s = r².
        let (a, b) = (5.0 * self.k2, 3.0 * self.k1);
        let discriminant = b * b - 4.0 * a;
        let fold = match (b < 0.0, a < 0.0) {
            (true, _) if discriminant >= 0.0 => 2.0 / (discriminant.sqrt() - b),
            (false, true) => (b + discriminant.sqrt()) / (-2.0 * a),
            _ => f64::INFINITY,
        };
        p.norm_squared() < fold && self.distort_jacobian(p).determinant() > 0.0
    }

    /// Distorted to ideal normalised coordinates by Newton's method; `None` where the lens model folds over (no ideal
    /// point within the invertible disc maps there).
    pub fn undistort(&self, d: &Vector2<f64>) -> Option<Vector2<f64>> {
        if self.is_none() {
            return Some(*d);
        }
        let mut p = *d;
        for _ in 0..30 {
            let j = self.distort_jacobian(&p);
            // Past the fold the Jacobian turns over: there is nothing to find on that side.
            if j.determinant() < 1e-3 {
                p *= 0.7;
                continue;
            }
            let step = j.try_inverse()? * (self.distort(&p) - d);
            p -= step;
            if !(p.x.is_finite() && p.y.is_finite()) {
                return None;
            }
            if step.norm() <= 1e-14 * (1.0 + p.norm()) {
                break;
            }
        }
        let good = (self.distort(&p) - d).norm() <= 1e-10 * (1.0 + d.norm());
        (good && self.distort_jacobian(&p).determinant() > 0.0).then_some(p)
    }

    /// A distorted pixel to the pixel an ideal lens would have given, with the same camera matrix.
    pub fn undistort_pixel(&self, k: &Intrinsics, pixel: &Vector2<f64>) -> Option<Vector2<f64>> {
        self.undistort(&k.normalised_from_pixel(pixel)).map(|p| k.pixel_from_normalised(&p))
    }
}

impl From<&Distortion> for Lens {
    fn from(d: &Distortion) -> Self {
        Self::Radtan(Radtan::new([d.k1, d.k2, d.p1, d.p2, 0.0]))
    }
}

impl From<Distortion> for Lens {
    fn from(d: Distortion) -> Self {
        Self::from(&d)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn undistort_inverts_distort_over_the_image() {
        for d in [
            Distortion::radial(-0.3, 0.09),
            Distortion::radial(0.1, -0.02),
            Distortion { k1: -0.2, k2: 0.03, p1: 1e-3, p2: -2e-3 },
        ] {
            for i in -8..=8 {
                for j in -8..=8 {
                    let p = Vector2::new(i as f64 * 0.08, j as f64 * 0.06);
                    let q = d.undistort(&d.distort(&p)).expect("invertible here");
                    assert!((q - p).norm() < 1e-10, "{d:?} {p:?} {q:?}");
                }
            }
        }
    }

    #[test]
    fn the_jacobian_agrees_with_differences() {
        let d = Distortion { k1: -0.2, k2: 0.05, p1: 1e-3, p2: -2e-3 };
        let p = Vector2::new(0.31, -0.42);
        let h = 1e-6;
        for c in 0..2 {
            let mut step = Vector2::zeros();
            step[c] = h;
            let difference = (d.distort(&(p + step)) - d.distort(&(p - step))) / (2.0 * h);
            assert!((difference - d.distort_jacobian(&p).column(c)).norm() < 1e-8);
        }
    }

    #[test]
    fn the_first_fold_ends_where_the_map_is_one_to_one() {
        for d in [
            Distortion::radial(-0.4, 0.05),
            Distortion::radial(-0.2, 0.0),
            Distortion::radial(0.1, -0.05),
            Distortion::radial(-0.1, -0.02),
        ] {
            // The radius grows up to the fold and no further.
            let radius = |r: f64| d.distort(&Vector2::new(r, 0.0)).x;
            let fold =
                (1..10_000).map(|i| f64::from(i) * 1e-3).find(|r| radius(*r) <= radius(r - 1e-3)).expect("a fold");
            assert!(d.is_one_to_one_at(&Vector2::new(0.0, fold - 0.003)), "{d:?} {fold}");
            for beyond in [fold + 0.003, 1.5 * fold, 4.0 * fold] {
                assert!(!d.is_one_to_one_at(&Vector2::new(beyond, 0.0)), "{d:?} {fold} {beyond}");
            }
        }
        for d in [Distortion::default(), Distortion::radial(-0.25, 0.05), Distortion::radial(0.1, 0.01)] {
            assert!(d.is_one_to_one_at(&Vector2::new(8.0, 3.0)), "{d:?} never folds");
        }
    }

    #[test]
    fn beyond_the_fold_there_is_no_ideal_point() {
        assert_eq!(Distortion::radial(-0.5, 0.0).undistort(&Vector2::new(2.0, 0.0)), None);
    }
}
