//! Brown-Conrady distortion as in OpenCV ("radtan", "plumb bob"): k1, k2, p1, p2, k3.
//!
//! With the ideal point (x, y) = (X/Z, Y/Z) and r² = x² + y²:
//!
//! ```text
//! x_d = x (1 + k1 r² + k2 r⁴ + k3 r⁶) + 2 p1 x y + p2 (r² + 2 x²)
//! y_d = y (1 + k1 r² + k2 r⁴ + k3 r⁶) + p1 (r² + 2 y²) + 2 p2 x y
//! ```
//!
//! The model reaches to the first fold of its radial part, the first root of 1 + 3 k1 r² + 5 k2 r⁴ + 7 k3 r⁶. The tangential part
//! is small in every lens and moves the fold little: within the radius a point is inside where the determinant of the derivative
//! is positive too.

use nalgebra::{Matrix2, Matrix2x3, Vector2, Vector3};

use crate::geometry::lens::{
    projection::{ByLensParameters, LensProjection},
    radial::OddPolynomial,
};

/// Least z of a ray of unit length: beyond, its ideal point is at infinity or behind.
const MIN_Z: f64 = 1e-9;
/// Steps of Newton's method in two dimensions, which starts at the solution without the tangential part.
const MAX_STEPS: usize = 30;

/// Brown-Conrady distortion.
///
/// # Examples
/// ```
/// use groundcal::{Lens, Radtan};
/// let lens = Lens::Radtan(Radtan::new([-0.1, 0.0, 0.001, 0.0, 0.0]));
/// assert_eq!(lens.parameter_names(), ["k1", "k2", "p1", "p2", "k3"]);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Radtan {
    radial: OddPolynomial<3>,
    p1: f64,
    p2: f64,
    /// First fold of the radial part.
    fold: f64,
}

impl Default for Radtan {
    fn default() -> Self {
        Self::radial(0.0, 0.0)
    }
}

impl Radtan {
    /// Names of the parameters, in OpenCV's order.
    pub(crate) const PARAMETER_NAMES: [&'static str; 5] = ["k1", "k2", "p1", "p2", "k3"];

    /// From k1, k2, p1, p2, k3.
    pub fn new([k1, k2, p1, p2, k3]: [f64; 5]) -> Self {
        let radial = OddPolynomial([k1, k2, k3]);
        Self { radial, p1, p2, fold: radial.fold() }
    }

    /// From k1 and k2 alone.
    pub(crate) fn radial(k1: f64, k2: f64) -> Self {
        Self::new([k1, k2, 0.0, 0.0, 0.0])
    }

    /// k1, k2, p1, p2, k3.
    pub(crate) fn parameters(&self) -> [f64; 5] {
        let [k1, k2, k3] = self.radial.0;
        [k1, k2, self.p1, self.p2, k3]
    }

    /// Whether all coefficients are zero.
    pub(crate) fn is_none(&self) -> bool {
        self.parameters() == [0.0; 5]
    }

    /// Radius of the ideal points that the model describes; infinite where it never folds.
    pub(crate) fn max_ideal_radius(&self) -> f64 {
        self.fold
    }

    /// Largest radius of a distorted point.
    pub(crate) fn max_radius(&self) -> f64 {
        if self.fold.is_finite() { self.fold * self.radial.factor(self.fold * self.fold) } else { f64::INFINITY }
    }

    fn has_tangential(&self) -> bool {
        self.p1 != 0.0 || self.p2 != 0.0
    }

    /// The polynomial at an ideal point, wherever it lies: beyond the fold too. See `distort`.
    pub(crate) fn polynomial(&self, p: &Vector2<f64>) -> Vector2<f64> {
        let (x, y) = (p.x, p.y);
        let r2 = x * x + y * y;
        let radial = self.radial.factor(r2);
        Vector2::new(
            x * radial + 2.0 * self.p1 * x * y + self.p2 * (r2 + 2.0 * x * x),
            y * radial + self.p1 * (r2 + 2.0 * y * y) + 2.0 * self.p2 * x * y,
        )
    }

    /// The derivative of [`Self::polynomial`].
    pub(crate) fn jacobian(&self, p: &Vector2<f64>) -> Matrix2<f64> {
        let (x, y) = (p.x, p.y);
        let r2 = x * x + y * y;
        let (radial, slope) = (self.radial.factor(r2), 2.0 * self.radial.factor_slope(r2));
        let off = x * y * slope + 2.0 * self.p1 * x + 2.0 * self.p2 * y;
        Matrix2::new(
            radial + x * x * slope + 2.0 * self.p1 * y + 6.0 * self.p2 * x,
            off,
            off,
            radial + y * y * slope + 6.0 * self.p1 * y + 2.0 * self.p2 * x,
        )
    }

    /// Whether the model describes an ideal point: within the first fold, where the map is one to one.
    pub(crate) fn contains(&self, p: &Vector2<f64>) -> bool {
        p.norm_squared() < self.fold * self.fold && (!self.has_tangential() || self.jacobian(p).determinant() > 0.0)
    }

    /// Ideal to distorted point; `None` beyond the fold.
    pub(crate) fn distort(&self, p: &Vector2<f64>) -> Option<Vector2<f64>> {
        self.contains(p).then(|| self.polynomial(p))
    }

    /// Distorted to ideal point; `None` where no point within the fold maps there.
    pub(crate) fn undistort(&self, d: &Vector2<f64>) -> Option<Vector2<f64>> {
        if self.is_none() {
            return Some(*d);
        }
        let distorted_radius = d.norm();
        let radius = self.radial.inverse(distorted_radius, self.fold);
        let scaled = |radius: f64| if distorted_radius > 0.0 { d * (radius / distorted_radius) } else { *d };
        if !self.has_tangential() {
            return radius.map(scaled);
        }
        // Where the radial part alone reaches no further, the tangential part may.
        let mut p = scaled(radius.unwrap_or(0.95 * self.fold));
        for _ in 0..MAX_STEPS {
            let j = self.jacobian(&p);
            // Past the fold the derivative turns over: what is sought lies further in.
            if j.determinant() < 1e-3 && !self.contains(&p) {
                p *= 0.7;
                continue;
            }
            let step = j.try_inverse()? * (self.polynomial(&p) - d);
            p -= step;
            if step.norm() <= 1e-14 * (1.0 + p.norm()) {
                break;
            }
        }
        let found = (self.polynomial(&p) - d).norm() <= 1e-10 * (1.0 + distorted_radius);
        (found && self.contains(&p)).then_some(p)
    }

    /// The distorted point of a ray; `None` behind the camera and beyond the fold.
    pub(crate) fn project(&self, ray: &Vector3<f64>) -> Option<Vector2<f64>> {
        self.distort(&ideal_point(ray)?)
    }

    /// [`Self::project`] with derivatives.
    #[inline(always)]
    pub(crate) fn project_with_jacobian(&self, ray: &Vector3<f64>) -> Option<LensProjection> {
        let p = ideal_point(ray)?;
        let j = self.jacobian(&p);
        if !(p.norm_squared() < self.fold * self.fold && j.determinant() > 0.0) {
            return None;
        }
        let inverse = 1.0 / ray.z;
        let by_ray = Matrix2x3::from_columns(&[j.column(0) * inverse, j.column(1) * inverse, -(j * p) * inverse]);
        let (x, y, r2) = (p.x, p.y, p.norm_squared());
        let by_tangential = [Vector2::new(2.0 * x * y, r2 + 2.0 * y * y), Vector2::new(r2 + 2.0 * x * x, 2.0 * x * y)];
        let by_radial = [p * r2, p * r2 * r2, p * r2 * r2 * r2];
        let by_parameters = ByLensParameters::from_columns(&[
            by_radial[0],
            by_radial[1],
            by_tangential[0],
            by_tangential[1],
            by_radial[2],
        ]);
        Some(LensProjection { point: self.polynomial(&p), by_ray, by_parameters })
    }

    /// The ray of unit length of a distorted point; `None` where the model gives none.
    pub(crate) fn unproject(&self, point: &Vector2<f64>) -> Option<Vector3<f64>> {
        let p = self.undistort(point)?;
        Some(Vector3::new(p.x, p.y, 1.0).normalize()).filter(|ray| ray.z > MIN_Z)
    }
}

/// (X/Z, Y/Z); `None` behind the camera.
pub(super) fn ideal_point(ray: &Vector3<f64>) -> Option<Vector2<f64>> {
    (ray.z > MIN_Z * ray.norm()).then(|| Vector2::new(ray.x / ray.z, ray.y / ray.z))
}
