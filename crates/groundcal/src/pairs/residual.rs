//! The residual of one match against a homography, its true point eliminated: what the search, the gold standard and the lens from
//! planes are made of.
//!
//! ```text
//! min over x̂:   |a - x̂|² + |b - H x̂|²
//! ```
//!
//! [`PlaneMatch`] is what a match must tell: plane coordinates ([`PointMatch`] in a frame) do, and rays at any angle from the axis
//! ([`super::ray_match`]).

use nalgebra::{Matrix2, Matrix2x3, Matrix3, SMatrix, Vector2, Vector3};

use crate::{
    geometry::frame::Frame,
    pairs::{
        correspondence::PointMatch,
        dlt::{direct_linear_transformation, from_four_points},
    },
};

/// A match that a homography between homogeneous frame coordinates explains, or not.
pub(crate) trait PlaneMatch: Clone + Sync {
    /// Standard deviation of each coordinate relative to that of the other matches.
    fn sigma_px(&self) -> f64;

    /// How far the point moved in the image.
    fn displacement_px(&self, frame: &Frame) -> f64;

    /// The residual and its derivatives; `None` for a point beyond infinity.
    fn eliminated(&self, h: &Matrix3<f64>) -> Option<Eliminated>;

    /// Squared Sampson distance, frame units; infinite for a point beyond infinity.
    fn sampson_squared(&self, h: &Matrix3<f64>) -> f64;

    /// Whether the point of the first image is in front of the second.
    fn is_in_front(&self, h: &Matrix3<f64>) -> bool;

    /// The homography through four; `None` for degenerate ones.
    fn through_four(sample: [&Self; 4]) -> Option<Matrix3<f64>>;

    /// Least squares on the algebraic error, and the least eigenvalue over the next.
    fn linear(matches: &[Self]) -> Option<(Matrix3<f64>, f64)>;

    /// Width over length of the points, the worse image of the two: 0 on a line.
    fn spread(matches: &[Self]) -> f64;
}

impl PlaneMatch for PointMatch {
    fn sigma_px(&self) -> f64 {
        self.sigma_px
    }

    fn displacement_px(&self, frame: &Frame) -> f64 {
        (self.b - self.a).norm() * frame.scale_px
    }

    fn eliminated(&self, h: &Matrix3<f64>) -> Option<Eliminated> {
        eliminate(h, self)
    }

    #[inline]
    fn sampson_squared(&self, h: &Matrix3<f64>) -> f64 {
        sampson_squared(h, self)
    }

    fn is_in_front(&self, h: &Matrix3<f64>) -> bool {
        h[(2, 0)] * self.a.x + h[(2, 1)] * self.a.y + h[(2, 2)] > 1e-6
    }

    fn through_four(sample: [&Self; 4]) -> Option<Matrix3<f64>> {
        from_four_points(sample)
    }

    fn linear(matches: &[Self]) -> Option<(Matrix3<f64>, f64)> {
        direct_linear_transformation(matches)
    }

    fn spread(matches: &[Self]) -> f64 {
        spread_ratio(matches)
    }
}

/// One match against a homography, its true point eliminated.
pub(crate) struct Eliminated {
    /// |a - x̂|² + |b - H x̂|² at the best x̂.
    pub(crate) squared_error: f64,
    /// x̂, homogeneous.
    pub(crate) point: Vector3<f64>,
    /// ∂(H x̂) / ∂(H x̂ homogeneous): 2x3.
    pub(crate) projection: Matrix2x3<f64>,
    /// (I + F Fᵀ)⁻¹.
    pub(crate) weight: Matrix2<f64>,
    /// Innovation b - H x̂ - F (a - x̂).
    pub(crate) innovation: Vector2<f64>,
}

pub(crate) fn eliminate(h: &Matrix3<f64>, m: &PointMatch) -> Option<Eliminated> {
    let mut point = m.a;
    let mut result = None;
    // Gauss-Newton on the point: the first step is Sampson's approximation, the third is below rounding for real noise.
    for step in 0..4 {
        let homogeneous = Vector3::new(point.x, point.y, 1.0);
        let q = h * homogeneous;
        if q.z <= 1e-9 {
            return None;
        }
        let w = 1.0 / q.z;
        let image = Vector2::new(q.x * w, q.y * w);
        let projection = Matrix2x3::new(w, 0.0, -image.x * w, 0.0, w, -image.y * w);
        let f = projection * h.fixed_view::<3, 2>(0, 0);
        let (da, db) = (m.a - point, m.b - image);
        if step == 3 {
            let weight = (Matrix2::identity() + f * f.transpose()).try_inverse()?;
            result = Some(Eliminated {
                squared_error: da.norm_squared() + db.norm_squared(),
                point: homogeneous,
                projection,
                weight,
                innovation: db - f * da,
            });
        } else {
            point += (Matrix2::identity() + f.transpose() * f).try_inverse()? * (da + f.transpose() * db);
        }
    }
    result
}

/// The residual of one match linearised in the homography's entries and in both points, its true point eliminated.
pub(crate) struct Linearised {
    /// The corrected points x̂ and H x̂; their errors are uncorrelated with the innovation.
    pub(crate) corrected: [Vector2<f64>; 2],
    /// Innovation b - H x̂ - F (a - x̂).
    pub(crate) innovation: Vector2<f64>,
    /// Its inverse covariance for unit noise in all four coordinates, (I + F Fᵀ)⁻¹.
    pub(crate) weight: Matrix2<f64>,
    /// F: what a step of a does to its image.
    pub(crate) slope: Matrix2<f64>,
    /// What a step of the nine entries, row by row, does to the image.
    pub(crate) by_entries: SMatrix<f64, 2, 9>,
}

/// See [`Linearised`]; frame coordinates. `None` for a point beyond infinity.
pub(crate) fn linearise(h: &Matrix3<f64>, m: &PointMatch) -> Option<Linearised> {
    let e = eliminate(h, m)?;
    let image = h * e.point;
    Some(Linearised {
        corrected: [e.point.xy(), image.xy() / image.z],
        innovation: e.innovation,
        weight: e.weight,
        slope: e.projection * h.fixed_view::<3, 2>(0, 0),
        by_entries: SMatrix::<f64, 2, 9>::from_fn(|r, c| e.projection[(r, c / 3)] * e.point[c % 3]),
    })
}

/// Squared Sampson distance (both images), the first-order value of the gold standard's error; frame units of the
/// arguments. Infinite for a point that goes beyond infinity.
#[inline]
pub(crate) fn sampson_squared(h: &Matrix3<f64>, m: &PointMatch) -> f64 {
    let q = h * Vector3::new(m.a.x, m.a.y, 1.0);
    if q.z <= 1e-9 {
        return f64::INFINITY;
    }
    let w = 1.0 / q.z;
    let (u, v) = (q.x * w, q.y * w);
    let f11 = (h[(0, 0)] - u * h[(2, 0)]) * w;
    let f12 = (h[(0, 1)] - u * h[(2, 1)]) * w;
    let f21 = (h[(1, 0)] - v * h[(2, 0)]) * w;
    let f22 = (h[(1, 1)] - v * h[(2, 1)]) * w;
    let (c11, c12, c22) = (1.0 + f11 * f11 + f12 * f12, f11 * f21 + f12 * f22, 1.0 + f21 * f21 + f22 * f22);
    let (dx, dy) = (m.b.x - u, m.b.y - v);
    (c22 * dx * dx - 2.0 * c12 * dx * dy + c11 * dy * dy) / (c11 * c22 - c12 * c12)
}

/// Ratio of the least to the largest standard deviation of the points over direction, the worse image of the two.
pub(crate) fn spread_ratio(matches: &[PointMatch]) -> f64 {
    let ratio = |points: &dyn Fn(&PointMatch) -> Vector2<f64>| {
        let n = matches.len() as f64;
        let mean = matches.iter().map(points).fold(Vector2::zeros(), |s, p| s + p) / n;
        let scatter = matches.iter().map(points).fold(Matrix2::zeros(), |s, p| s + (p - mean) * (p - mean).transpose());
        let (half, det) = (0.5 * scatter.trace(), scatter.determinant().max(0.0));
        let root = (half * half - det).max(0.0).sqrt();
        if half + root > 0.0 { ((half - root).max(0.0) / (half + root)).sqrt() } else { 0.0 }
    };
    ratio(&|m| m.a).min(ratio(&|m| m.b))
}
