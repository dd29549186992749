//! The equidistant fisheye of Kannala and Brandt (PAMI 2006), k1 to k4, as `cv2.fisheye` and Kalibr's `equidistant` have it.
//!
//! ```text
//! θ: angle from the optical axis,    θ_d = θ (1 + k1 θ² + k2 θ⁴ + k3 θ⁶ + k4 θ⁸),    (x_d, y_d) = θ_d (X, Y) / √(X² + Y²)
//! ```
//!
//! At and beyond 90 degrees as before it. The model reaches to the first root of dθ_d/dθ, at most to 180 degrees.

use nalgebra::{Matrix2, Matrix2x3, Vector2, Vector3};

use crate::geometry::lens::{
    projection::{ByLensParameters, LensProjection},
    radial::OddPolynomial,
};

/// The equidistant fisheye.
///
/// # Examples
/// ```
/// use groundcal::{Fisheye, Lens, nalgebra::Vector3};
/// // Square to the axis: 90 degrees are half a turn of the unit circle from the centre.
/// let lens = Lens::Fisheye(Fisheye::default());
/// let point = lens.project(&Vector3::x()).expect("seen");
/// assert!((point.x - std::f64::consts::FRAC_PI_2).abs() < 1e-12);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Fisheye {
    polynomial: OddPolynomial<4>,
    max_angle_rad: f64,
}

impl Default for Fisheye {
    fn default() -> Self {
        Self::new([0.0; 4])
    }
}

impl Fisheye {
    /// Names of the parameters.
    pub(crate) const PARAMETER_NAMES: [&'static str; 4] = ["k1", "k2", "k3", "k4"];

    /// From k1, k2, k3, k4.
    pub fn new(coefficients: [f64; 4]) -> Self {
        let polynomial = OddPolynomial(coefficients);
        Self { polynomial, max_angle_rad: polynomial.fold().min(std::f64::consts::PI) }
    }

    /// k1, k2, k3, k4.
    pub(crate) fn parameters(&self) -> [f64; 4] {
        self.polynomial.0
    }

    /// Largest angle from the optical axis, radians.
    pub(crate) fn max_angle_rad(&self) -> f64 {
        self.max_angle_rad
    }

    /// Largest radius of a distorted point.
    pub(crate) fn max_radius(&self) -> f64 {
        self.max_angle_rad * self.polynomial.factor(self.max_angle_rad * self.max_angle_rad)
    }

    /// The ray's distance from the axis, its angle, and θ_d over that distance.
    fn parts(&self, ray: &Vector3<f64>) -> Option<(f64, f64, f64)> {
        let rho = ray.x.hypot(ray.y);
        let theta = rho.atan2(ray.z);
        if theta.is_nan() || theta >= self.max_angle_rad {
            return None;
        }
        let scale = if rho > 0.0 { theta * self.polynomial.factor(theta * theta) / rho } else { 1.0 / ray.z };
        scale.is_finite().then_some((rho, theta, scale))
    }

    /// The distorted point of a ray; `None` beyond the fold, and for the ray straight back.
    pub(crate) fn project(&self, ray: &Vector3<f64>) -> Option<Vector2<f64>> {
        self.parts(ray).map(|(_, _, scale)| ray.xy() * scale)
    }

    /// [`Self::project`] with derivatives.
    pub(crate) fn project_with_jacobian(&self, ray: &Vector3<f64>) -> Option<LensProjection> {
        let (rho, theta, scale) = self.parts(ray)?;
        let theta2 = theta * theta;
        let outward = if rho > 0.0 { ray.xy() / rho } else { Vector2::zeros() };
        let slope = self.polynomial.slope(theta2) / ray.norm_squared();
        let by_xy = Matrix2::identity() * scale + outward * outward.transpose() * (slope * ray.z - scale);
        let by_z = -ray.xy() * slope;
        let by_ray = Matrix2x3::from_columns(&[by_xy.column(0).into(), by_xy.column(1).into(), by_z]);
        let mut by_parameters = ByLensParameters::zeros();
        let mut power = theta;
        for i in 0..4 {
            power *= theta2;
            by_parameters.set_column(i, &(outward * power));
        }
        Some(LensProjection { point: ray.xy() * scale, by_ray, by_parameters })
    }

    /// The ray of unit length of a distorted point; `None` beyond the fold.
    pub(crate) fn unproject(&self, point: &Vector2<f64>) -> Option<Vector3<f64>> {
        let radius = point.norm();
        let theta = self.polynomial.inverse(radius, self.max_angle_rad)?;
        let (sin, cos) = theta.sin_cos();
        let outward = if radius > 0.0 { point / radius } else { Vector2::zeros() };
        Some(Vector3::new(outward.x * sin, outward.y * sin, cos))
    }
}
