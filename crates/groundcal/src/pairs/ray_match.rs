//! Matches as rays, for lenses that see at and beyond 90 degrees from the optical axis.
//!
//! A pixel p is the homogeneous point x = F⁻¹ K ray(p) of the frame, whose third coordinate may be zero or negative, and its
//! neighbourhood is a linear chart,
//!
//! ```text
//! x(p + s δ) ~ C (δ, 1),     C = [ s ∂x/∂p | x ]
//! ```
//!
//! s the frame's unit in pixels. Between the charts of both images the homography H is C_b⁻¹ H C_a, the match lies at both origins, and
//! the noise is that of the pixels in every direction, however the lens stretches them. What is said of matches in plane coordinates
//! ([`super::residual`]) holds there as it stands; without a lens it is the very same.

use nalgebra::{DMatrix, Matrix2, Matrix3, Matrix3x2, SMatrix, SVector, Vector2, Vector3};

use crate::{
    geometry::frame::Frame,
    numerics::linalg::{matrix_from_rows, symmetric_eigen},
    pairs::{
        correspondence::PointMatch,
        placed_lens::PlacedLens,
        residual::{Eliminated, Linearised, PlaneMatch, eliminate, linearise, sampson_squared},
    },
};

/// A pixel's ray in the frame, and the chart about it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct RayChart {
    /// C, its last column of unit length.
    chart: Matrix3<f64>,
    inverse: Matrix3<f64>,
}

impl RayChart {
    /// Of a pixel; `None` where the lens model gives no ray.
    pub(crate) fn new(pixel: &Vector2<f64>, lens: &PlacedLens, frame: &Frame) -> Option<Self> {
        let k = &lens.intrinsics;
        let ray = lens.lens.unproject(&k.normalised_from_pixel(pixel))?;
        let across = across(&ray);
        let by_across = lens.lens.project_with_jacobian(&ray)?.by_ray * across;
        let pixel_by_across = Matrix2::new(k.fx, k.skew, 0.0, k.fy) * by_across;
        let ray_by_pixel = across * pixel_by_across.try_inverse()?;
        let to_frame = frame.frame_matrix() * k.matrix();
        let (x, by_pixel) = (to_frame * ray, to_frame * ray_by_pixel * frame.scale_px);
        let chart = Matrix3::from_columns(&[by_pixel.column(0).into(), by_pixel.column(1).into(), x]) / x.norm();
        Some(Self { chart, inverse: chart.try_inverse()? })
    }

    /// Where another lens puts a pixel in this chart, frame units.
    pub(crate) fn place_of(&self, pixel: &Vector2<f64>, lens: &PlacedLens, frame: &Frame) -> Option<Vector2<f64>> {
        let x = self.inverse * (frame.frame_matrix() * lens.ray_px(pixel)?);
        (x.z > 0.0).then(|| x.xy() / x.z)
    }

    /// The point of the frame, homogeneous, unit length.
    fn point(&self) -> Vector3<f64> {
        self.chart.column(2).into_owned()
    }
}

/// Two orthonormal directions across a unit vector.
fn across(ray: &Vector3<f64>) -> Matrix3x2<f64> {
    let aside = if ray.x.abs() < 0.6 { Vector3::x() } else { Vector3::y() };
    let first = ray.cross(&aside).normalize();
    Matrix3x2::from_columns(&[first, ray.cross(&first)])
}

/// A match of two rays.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct RayMatch {
    /// `None`: the lens model has no ray for one of its pixels, and no homography explains it.
    rays: Option<[RayChart; 2]>,
    sigma_px: f64,
    displacement_px: f64,
}

impl RayMatch {
    /// Of a match in pixels.
    pub(crate) fn new(m: &PointMatch, lens: &PlacedLens, frame: &Frame) -> Self {
        let ray = |p: &Vector2<f64>| RayChart::new(p, lens, frame);
        let rays = ray(&m.a).zip(ray(&m.b)).map(|(a, b)| [a, b]);
        Self { rays, sigma_px: m.sigma_px, displacement_px: (m.b - m.a).norm() }
    }

    /// Whether the lens model has rays for both pixels.
    pub(crate) fn is_seen(&self) -> bool {
        self.rays.is_some()
    }

    /// The homography between the charts.
    fn between_charts(&self, h: &Matrix3<f64>) -> Option<Matrix3<f64>> {
        let [a, b] = self.rays.as_ref()?;
        Some(b.inverse * h * a.chart)
    }

    /// The residual linearised in the nine entries and in both pixels; corrected points in the charts.
    pub(crate) fn linearised(&self, h: &Matrix3<f64>) -> Option<Linearised> {
        let l = linearise(&self.between_charts(h)?, &self.at_origins())?;
        let x = self.eliminated(h)?;
        let by_entries = SMatrix::<f64, 2, 9>::from_fn(|r, c| x.projection[(r, c / 3)] * x.point[c % 3]);
        Some(Linearised { by_entries, ..l })
    }

    /// The match in the charts.
    fn at_origins(&self) -> PointMatch {
        PointMatch { a: Vector2::zeros(), b: Vector2::zeros(), sigma_px: self.sigma_px }
    }
}

impl PlaneMatch for RayMatch {
    fn sigma_px(&self) -> f64 {
        self.sigma_px
    }

    fn displacement_px(&self, _: &Frame) -> f64 {
        self.displacement_px
    }

    fn eliminated(&self, h: &Matrix3<f64>) -> Option<Eliminated> {
        let [a, b] = self.rays.as_ref()?;
        let e = eliminate(&self.between_charts(h)?, &self.at_origins())?;
        Some(Eliminated { point: a.chart * e.point, projection: e.projection * b.inverse, ..e })
    }

    fn sampson_squared(&self, h: &Matrix3<f64>) -> f64 {
        self.between_charts(h).map_or(f64::INFINITY, |h| sampson_squared(&h, &self.at_origins()))
    }

    fn is_in_front(&self, h: &Matrix3<f64>) -> bool {
        self.between_charts(h).is_some_and(|h| h[(2, 2)] > 1e-6)
    }

    /// As in plane coordinates, areas being volumes: a quadruple must not be turned over, nor three of it lie on a great circle.
    fn through_four(sample: [&Self; 4]) -> Option<Matrix3<f64>> {
        let mut points = [[Vector3::zeros(); 4]; 2];
        for (i, m) in sample.iter().enumerate() {
            let [a, b] = m.rays.as_ref()?;
            (points[0][i], points[1][i]) = (a.point(), b.point());
        }
        for triple in [[0, 1, 2], [0, 1, 3], [0, 2, 3], [1, 2, 3]] {
            let [in_a, in_b] = [0, 1].map(|image| {
                let [p, q, r] = triple.map(|i: usize| points[image][i]);
                (p.dot(&q.cross(&r)), (q - p).norm_squared().max((r - p).norm_squared()))
            });
            if in_a.0 * in_b.0 <= 0.0 || in_a.0.abs() < 1e-3 * in_a.1 || in_b.0.abs() < 1e-3 * in_b.1 {
                return None;
            }
        }
        let basis = |p: &[Vector3<f64>; 4]| -> Option<Matrix3<f64>> {
            let m = Matrix3::from_columns(&p[..3]);
            let weights = m.try_inverse()? * p[3];
            Some(m * Matrix3::from_diagonal(&weights))
        };
        let h = basis(&points[1])? * basis(&points[0])?.try_inverse()?;
        let norm = h.norm();
        (norm.is_finite() && norm > 0.0).then(|| h / norm)
    }

    fn linear(matches: &[Self]) -> Option<(Matrix3<f64>, f64)> {
        let mut normal = SMatrix::<f64, 9, 9>::zeros();
        for m in matches {
            let [a, b] = m.rays.as_ref()?;
            let x = a.point();
            // What the chart of b has of H x in its first two coordinates is to vanish.
            for r in 0..2 {
                let row = SVector::<f64, 9>::from_fn(|i, _| b.inverse[(r, i / 3)] * x[i % 3]);
                normal.ger(m.sigma_px.powi(-2), &row, &row, 1.0);
            }
        }
        let (values, vectors) = symmetric_eigen(&DMatrix::from_fn(9, 9, |r, c| normal[(r, c)]))?;
        let h = matrix_from_rows(&SVector::<f64, 9>::from_fn(|i, _| vectors[(i, 0)]));
        let in_front = matches.iter().filter(|m| m.between_charts(&h).is_some_and(|h| h[(2, 2)] > 0.0)).count();
        let sign = if 2 * in_front >= matches.len() { 1.0 } else { -1.0 };
        let norm = h.norm();
        let ratio = (values[0].max(0.0) + f64::EPSILON * values[8]) / values[1].max(f64::EPSILON * values[8]);
        (norm.is_finite() && norm > 0.0).then(|| (h * (sign / norm), ratio.min(1.0)))
    }

    /// Rays on a line of the plane lie on a great circle.
    fn spread(matches: &[Self]) -> f64 {
        let ratio = |image: usize| {
            let scatter = matches
                .iter()
                .filter_map(|m| m.rays.as_ref())
                .map(|rays| rays[image].point())
                .fold(Matrix3::zeros(), |sum, p| sum + p * p.transpose());
            let values = symmetric_eigen(&DMatrix::from_fn(3, 3, |r, c| scatter[(r, c)])).map(|(values, _)| values);
            values.filter(|v| v[1] > 0.0).map_or(0.0, |v| (v[0].max(0.0) / v[1]).sqrt())
        };
        ratio(0).min(ratio(1))
    }
}
