//! Linear homographies: from four points, and the normalised direct linear transformation (H&Z algorithm 4.2).
//!
//! Each match gives two rows of A h = 0 from x_b × (H x_a) = 0; h is the eigenvector of AᵀA of least eigenvalue.

use nalgebra::{DMatrix, Matrix3, SMatrix, SVector, Vector2, Vector3};

use crate::{
    numerics::linalg::{matrix_from_rows, symmetric_eigen},
    pairs::correspondence::PointMatch,
};

/// The homography through four matches, by the projective bases of both quadruples; `None` when three of the points
/// are (nearly) on a line in either image, or when the quadruple is turned over, which no view of a plane from the
/// same side can do.
pub(crate) fn from_four_points(matches: [&PointMatch; 4]) -> Option<Matrix3<f64>> {
    let area = |p: &Vector2<f64>, q: &Vector2<f64>, r: &Vector2<f64>| (q - p).perp(&(r - p));
    for [i, j, k] in [[0, 1, 2], [0, 1, 3], [0, 2, 3], [1, 2, 3]] {
        let (p, q, r) = (matches[i], matches[j], matches[k]);
        let (in_a, in_b) = (area(&p.a, &q.a, &r.a), area(&p.b, &q.b, &r.b));
        let reach_a = (q.a - p.a).norm_squared().max((r.a - p.a).norm_squared());
        let reach_b = (q.b - p.b).norm_squared().max((r.b - p.b).norm_squared());
        if in_a * in_b <= 0.0 || in_a.abs() < 1e-3 * reach_a || in_b.abs() < 1e-3 * reach_b {
            return None;
        }
    }
    let basis = |p: [&Vector2<f64>; 4]| -> Option<Matrix3<f64>> {
        let h = p.map(|q| Vector3::new(q.x, q.y, 1.0));
        let m = Matrix3::from_columns(&[h[0], h[1], h[2]]);
        let weights = m.try_inverse()? * h[3];
        Some(Matrix3::from_columns(&[h[0] * weights.x, h[1] * weights.y, h[2] * weights.z]))
    };
    let a = basis(matches.map(|m| &m.a))?;
    let b = basis(matches.map(|m| &m.b))?;
    let h = b * a.try_inverse()?;
    let norm = h.norm();
    (norm.is_finite() && norm > 0.0).then(|| h / norm)
}

/// The centroid and the factor that brings the mean distance from it to √2 (H&Z 4.4.4).
fn normalisation(points: impl Iterator<Item = Vector2<f64>> + Clone) -> Option<Matrix3<f64>> {
    let n = points.clone().count() as f64;
    let centroid = points.clone().fold(Vector2::zeros(), |s, p| s + p) / n;
    let spread = points.map(|p| (p - centroid).norm()).sum::<f64>() / n;
    let s = std::f64::consts::SQRT_2 / spread;
    s.is_finite().then(|| Matrix3::new(s, 0.0, -s * centroid.x, 0.0, s, -s * centroid.y, 0.0, 0.0, 1.0))
}

/// Least squares on the algebraic error of four or more matches, coordinates normalised, weights 1/σ²; the result has
/// unit norm and a sign that puts the points in front. Second value: the smallest over the second smallest eigenvalue of
/// AᵀA (1 when the points do not determine H). `None` for fewer than four or coincident points.
pub fn direct_linear_transformation(matches: &[PointMatch]) -> Option<(Matrix3<f64>, f64)> {
    if matches.len() < 4 {
        return None;
    }
    let ta = normalisation(matches.iter().map(|m| m.a))?;
    let tb = normalisation(matches.iter().map(|m| m.b))?;
    let mut normal = SMatrix::<f64, 9, 9>::zeros();
    for m in matches {
        let a = ta * Vector3::new(m.a.x, m.a.y, 1.0);
        let b = tb * Vector3::new(m.b.x, m.b.y, 1.0);
        let row = |sign: [f64; 3]| SVector::<f64, 9>::from_fn(|i, _| sign[i / 3] * a[i % 3]);
        let w = 1.0 / (m.sigma_px * m.sigma_px);
        let (r1, r2) = (row([1.0, 0.0, -b.x]), row([0.0, 1.0, -b.y]));
        normal.ger(w, &r1, &r1, 1.0);
        normal.ger(w, &r2, &r2, 1.0);
    }
    let (values, vectors) = symmetric_eigen(&DMatrix::from_fn(9, 9, |r, c| normal[(r, c)]))?;
    let h = matrix_from_rows(&SVector::<f64, 9>::from_fn(|i, _| vectors[(i, 0)]));
    let h = tb.try_inverse()? * h * ta;
    let in_front = matches.iter().filter(|m| (h * Vector3::new(m.a.x, m.a.y, 1.0)).z > 0.0).count();
    let sign = if 2 * in_front >= matches.len() { 1.0 } else { -1.0 };
    let norm = h.norm();
    let ratio = (values[0].max(0.0) + f64::EPSILON * values[8]) / values[1].max(f64::EPSILON * values[8]);
    (norm.is_finite() && norm > 0.0).then(|| (h * (sign / norm), ratio.min(1.0)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn warp(h: &Matrix3<f64>, x: f64, y: f64) -> PointMatch {
        let q = h * Vector3::new(x, y, 1.0);
        PointMatch::new([x, y], [q.x / q.z, q.y / q.z])
    }

    fn truth() -> Matrix3<f64> {
        Matrix3::new(1.02, -0.2, 40.0, 0.18, 0.97, -25.0, 1e-4, -5e-5, 1.0)
    }

    #[test]
    fn exact_data_give_the_exact_matrix() {
        let h = truth();
        let points: Vec<_> = (0..30).map(|i| warp(&h, (i * 97 % 640) as f64, (i * 53 % 480) as f64)).collect();
        let expected = h / h.norm();
        let (found, ratio) = direct_linear_transformation(&points).expect("determined");
        assert!((found - expected).norm() < 1e-9 * expected.norm());
        assert!(ratio < 1e-12);
        let four = from_four_points([&points[0], &points[7], &points[13], &points[22]]).expect("determined");
        assert!((four * four[(2, 2)].signum() - expected).norm() < 1e-9);
    }

    #[test]
    fn coordinates_scaled_by_a_million_change_nothing() {
        let h = truth();
        let s = 1e6;
        let points: Vec<_> = (0..30).map(|i| warp(&h, (i * 97 % 640) as f64, (i * 53 % 480) as f64)).collect();
        let scaled: Vec<_> = points.iter().map(|m| PointMatch { a: m.a * s, b: m.b * s, ..*m }).collect();
        let (found, _) = direct_linear_transformation(&scaled).expect("determined");
        let t = Matrix3::new(s, 0.0, 0.0, 0.0, s, 0.0, 0.0, 0.0, 1.0);
        let back = Matrix3::new(1.0 / s, 0.0, 0.0, 0.0, 1.0 / s, 0.0, 0.0, 0.0, 1.0) * found * t;
        assert!((back / back.norm() - h / h.norm()).norm() < 1e-9);
    }

    #[test]
    fn collinear_mirrored_and_coincident_points_are_refused() {
        let h = truth();
        let line: Vec<_> = (0..20).map(|i| warp(&h, i as f64 * 30.0, i as f64 * 20.0)).collect();
        assert!(from_four_points([&line[0], &line[5], &line[9], &line[14]]).is_none());
        assert!(direct_linear_transformation(&line).is_none_or(|(_, ratio)| ratio > 1e-3));
        let mirrored: Vec<_> = [(10.0, 10.0), (600.0, 30.0), (580.0, 400.0), (30.0, 420.0)]
            .map(|(x, y)| PointMatch::new([x, y], [640.0 - x, y]))
            .to_vec();
        assert!(from_four_points([&mirrored[0], &mirrored[1], &mirrored[2], &mirrored[3]]).is_none());
        let same = vec![PointMatch::new([5.0, 5.0], [6.0, 6.0]); 10];
        assert!(direct_linear_transformation(&same).is_none());
    }
}
