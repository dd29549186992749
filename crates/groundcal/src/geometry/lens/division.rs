//! The division model of one parameter (Fitzgibbon, CVPR 2001), on rays.
//!
//! ```text
//! ray ~ (x_d, y_d, 1 + λ r_d²)        r_d = 2 r / (Z + √(Z² - 4 λ r²)),    r² = X² + Y²
//! ```
//!
//! λ < 0 (barrel) reaches beyond 90 degrees, up to 180: at r_d = 1/√-λ the ray is square to the axis. λ > 0 folds at
//! r_d = 1/√λ, where tan θ = 1 / (2 √λ).

use nalgebra::{Matrix2, Matrix2x3, Vector2, Vector3};

use crate::geometry::lens::projection::{ByLensParameters, LensProjection};

/// The division model.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Division {
    lambda: f64,
}

/// What projecting needs: the distance from the axis, the root, and r_d / r.
struct Parts {
    rho: f64,
    root: f64,
    scale: f64,
}

impl Division {
    /// Names of the parameters.
    pub(crate) const PARAMETER_NAMES: [&'static str; 1] = ["lambda"];

    /// From λ.
    pub fn new(lambda: f64) -> Self {
        Self { lambda }
    }

    /// λ.
    pub(crate) fn parameters(&self) -> [f64; 1] {
        [self.lambda]
    }

    /// Largest angle from the optical axis, radians.
    pub(crate) fn max_angle_rad(&self) -> f64 {
        if self.lambda > 0.0 {
            (0.5 / self.lambda.sqrt()).atan()
        } else if self.lambda == 0.0 {
            std::f64::consts::FRAC_PI_2
        } else {
            std::f64::consts::PI
        }
    }

    /// Largest radius of a distorted point.
    pub(crate) fn max_radius(&self) -> f64 {
        if self.lambda > 0.0 { 1.0 / self.lambda.sqrt() } else { f64::INFINITY }
    }

    fn parts(&self, ray: &Vector3<f64>) -> Option<Parts> {
        let (rho, z) = (ray.x.hypot(ray.y), ray.z);
        let length = ray.norm();
        if self.lambda >= 0.0 && z <= 1e-9 * length {
            return None;
        }
        let under_root = z * z - 4.0 * self.lambda * rho * rho;
        // Also refuses what is not a number, and the ray straight back.
        if !(under_root > 0.0 && (z > 0.0 || rho > 1e-12 * length)) {
            return None;
        }
        let root = under_root.sqrt();
        // Of the two forms of one number the one without cancellation.
        let scale = if z >= 0.0 { 2.0 / (z + root) } else { (root - z) / (-2.0 * self.lambda * rho * rho) };
        Some(Parts { rho, root, scale }).filter(|p| p.scale.is_finite())
    }

    /// The distorted point of a ray; `None` beyond the fold.
    pub(crate) fn project(&self, ray: &Vector3<f64>) -> Option<Vector2<f64>> {
        self.parts(ray).map(|parts| ray.xy() * parts.scale)
    }

    /// [`Self::project`] with derivatives.
    pub(crate) fn project_with_jacobian(&self, ray: &Vector3<f64>) -> Option<LensProjection> {
        let Parts { rho, root, scale } = self.parts(ray)?;
        let radius = scale * rho;
        let outward = if rho > 0.0 { ray.xy() / rho } else { Vector2::zeros() };
        let by_rho = (1.0 + self.lambda * radius * radius) / root;
        let by_xy = Matrix2::identity() * scale + outward * outward.transpose() * (by_rho - scale);
        let by_z = -outward * (radius / root);
        let by_ray = Matrix2x3::from_columns(&[by_xy.column(0).into(), by_xy.column(1).into(), by_z]);
        let mut by_parameters = ByLensParameters::zeros();
        by_parameters.set_column(0, &(outward * (rho * radius * radius / root)));
        Some(LensProjection { point: ray.xy() * scale, by_ray, by_parameters })
    }

    /// The ray of unit length of a distorted point; `None` beyond the fold.
    pub(crate) fn unproject(&self, point: &Vector2<f64>) -> Option<Vector3<f64>> {
        let r2 = point.norm_squared();
        let inside = r2.is_finite() && self.lambda * r2 < 1.0;
        inside.then(|| Vector3::new(point.x, point.y, 1.0 + self.lambda * r2).normalize())
    }
}
