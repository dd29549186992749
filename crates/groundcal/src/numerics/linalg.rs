//! Small linear algebra shared by the stages: what nalgebra leaves out or does not guard.

use nalgebra::{Complex, DMatrix, DVector, Matrix3, SMatrix, SVector, SymmetricEigen, Vector3};

/// A complex 3-vector: a point of the complex projective plane.
pub(crate) type ComplexPoint = Vector3<Complex<f64>>;

/// The matrix of the cross product: `cross_matrix(a) * b == a.cross(&b)`.
pub(crate) fn cross_matrix(a: &Vector3<f64>) -> Matrix3<f64> {
    Matrix3::new(0.0, -a.z, a.y, a.z, 0.0, -a.x, -a.y, a.x, 0.0)
}

/// The cross product of complex vectors, without conjugation.
pub(crate) fn complex_cross(a: &ComplexPoint, b: &ComplexPoint) -> ComplexPoint {
    Vector3::new(a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x)
}

/// The bilinear product aᵀb, without conjugation.
pub(crate) fn bilinear(a: &ComplexPoint, b: &ComplexPoint) -> Complex<f64> {
    a.x * b.x + a.y * b.y + a.z * b.z
}

/// A real vector as a complex one.
pub(crate) fn to_complex(v: &Vector3<f64>) -> ComplexPoint {
    v.map(|x| Complex::new(x, 0.0))
}

/// The nine entries of a 3x3 matrix, row by row.
pub(crate) fn rows_of(m: &Matrix3<f64>) -> SVector<f64, 9> {
    SVector::<f64, 9>::from_fn(|i, _| m[(i / 3, i % 3)])
}

/// A 3x3 matrix from its nine entries, row by row.
pub(crate) fn matrix_from_rows(v: &SVector<f64, 9>) -> Matrix3<f64> {
    Matrix3::from_fn(|r, c| v[3 * r + c])
}

/// Eight orthonormal directions orthogonal to a unit 9-vector (the tangent space of the sphere there): the last eight
/// columns of the Householder reflection that takes the first axis to `v`.
pub(crate) fn sphere_tangent(v: &SVector<f64, 9>) -> SMatrix<f64, 9, 8> {
    let sign = if v[0] >= 0.0 { 1.0 } else { -1.0 };
    let mut w = *v;
    w[0] += sign;
    let scale = 2.0 / w.norm_squared();
    SMatrix::<f64, 9, 8>::from_fn(|r, c| {
        let identity = if r == c + 1 { 1.0 } else { 0.0 };
        identity - scale * w[r] * w[c + 1]
    })
}

/// Eigenvalues, ascending, and eigenvectors (columns) of a symmetric matrix; `None` when an entry is not finite or the
/// iteration does not end.
pub(crate) fn symmetric_eigen(m: &DMatrix<f64>) -> Option<(DVector<f64>, DMatrix<f64>)> {
    if !m.iter().all(|v| v.is_finite()) {
        return None;
    }
    let eigen = SymmetricEigen::try_new(m.clone(), 1e-15, 1000)?;
    let mut order: Vec<usize> = (0..m.nrows()).collect();
    order.sort_by(|&a, &b| eigen.eigenvalues[a].total_cmp(&eigen.eigenvalues[b]));
    let values = DVector::from_iterator(order.len(), order.iter().map(|&i| eigen.eigenvalues[i]));
    let vectors = DMatrix::from_fn(m.nrows(), order.len(), |r, c| eigen.eigenvectors[(r, order[c])]);
    Some((values, vectors))
}

/// Inverse of a symmetric positive definite matrix, after scaling its diagonal to one (parameters of unlike units);
/// `None` when it is not positive definite to working precision.
pub(crate) fn inverse_spd(m: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    let n = m.nrows();
    if !m.iter().all(|v| v.is_finite()) || (0..n).any(|i| m[(i, i)] <= 0.0) {
        return None;
    }
    let scale = DVector::from_iterator(n, (0..n).map(|i| 1.0 / m[(i, i)].sqrt()));
    let scaled = DMatrix::from_fn(n, n, |r, c| m[(r, c)] * scale[r] * scale[c]);
    let inverse = scaled.cholesky()?.inverse();
    let ok = inverse.iter().all(|v| v.is_finite() && v.abs() < 1e14);
    ok.then(|| DMatrix::from_fn(n, n, |r, c| inverse[(r, c)] * scale[r] * scale[c]))
}

/// The eigenvalues and eigenvectors of a real 3x3 matrix that has one real eigenvalue and a complex pair.
#[derive(Debug, Clone, Copy)]
pub(crate) struct ComplexPairEigen {
    /// The real eigenvalue.
    pub real_value: f64,
    /// The eigenvalue of the pair with positive imaginary part.
    pub complex_value: Complex<f64>,
    /// Right eigenvector of the real eigenvalue, unit length.
    pub real_right: Vector3<f64>,
    /// Left eigenvector of the real eigenvalue, unit length.
    pub real_left: Vector3<f64>,
    /// Right eigenvector of `complex_value`, unit length; that of the conjugate is its conjugate.
    pub complex_right: ComplexPoint,
    /// Left eigenvector of `complex_value` (lᵀ M = λ lᵀ, no conjugation), unit length.
    pub complex_left: ComplexPoint,
}

/// Closed form: the real root of the characteristic cubic (polished by Newton steps), the quadratic that is left, and
/// eigenvectors as the largest cross product of two rows of M - λI. `None` when all eigenvalues are real or coincide.
pub(crate) fn complex_pair_eigen(m: &Matrix3<f64>) -> Option<ComplexPairEigen> {
    let scale = m.norm();
    if !scale.is_finite() || scale == 0.0 {
        return None;
    }
    let a = m / scale;
    // p(x) = x^3 - t x^2 + s x - d
    let t = a.trace();
    let s = a[(0, 0)] * a[(1, 1)] - a[(0, 1)] * a[(1, 0)] + a[(0, 0)] * a[(2, 2)] - a[(0, 2)] * a[(2, 0)]
        + a[(1, 1)] * a[(2, 2)]
        - a[(1, 2)] * a[(2, 1)];
    let d = a.determinant();
    // Depressed cubic y^3 + p y + q with x = y + t/3.
    let shift = t / 3.0;
    let p = s - t * t / 3.0;
    let q = -2.0 * shift.powi(3) + s * shift - d;
    let discriminant = (q / 2.0).powi(2) + (p / 3.0).powi(3);
    if discriminant <= 0.0 {
        return None;
    }
    let root = discriminant.sqrt();
    // Of the two cube roots take the one without cancellation; the other follows from u v = -p / 3.
    let u = if q > 0.0 { -(q / 2.0 + root).cbrt() } else { (root - q / 2.0).cbrt() };
    let v = if u == 0.0 { 0.0 } else { -p / (3.0 * u) };
    let mut real = u + v + shift;
    for _ in 0..3 {
        let value = ((real - t) * real + s) * real - d;
        let slope = (3.0 * real - 2.0 * t) * real + s;
        if slope == 0.0 {
            break;
        }
        let step = value / slope;
        if step.is_finite() && step.abs() < 0.5 * (real.abs() + 1e-3) {
            real -= step;
        }
    }
    // (x - real)(x^2 + b x + c)
    let b = real - t;
    let c = s + real * b;
    let quarter = c - 0.25 * b * b;
    // A triple real root comes out of rounding with an imaginary part of the cube root of the machine precision.
    if quarter <= 1e-9 {
        return None;
    }
    let mut pair = Complex::new(-0.5 * b, quarter.sqrt());
    for _ in 0..2 {
        let value = ((pair - t) * pair + s) * pair - d;
        let slope = (pair * 3.0 - 2.0 * t) * pair + s;
        let step = value / slope;
        if step.re.is_finite() && step.im.is_finite() && step.norm() < 0.1 * pair.im {
            pair -= step;
        }
    }
    let real_c = Complex::new(real, 0.0);
    let ac = a.map(|x| Complex::new(x, 0.0));
    let act = ac.transpose();
    let real_right = null_vector(&ac, real_c)?.map(|z| z.re);
    let real_left = null_vector(&act, real_c)?.map(|z| z.re);
    Some(ComplexPairEigen {
        real_value: real * scale,
        complex_value: pair * scale,
        real_right: real_right.normalize(),
        real_left: real_left.normalize(),
        complex_right: null_vector(&ac, pair)?,
        complex_left: null_vector(&act, pair)?,
    })
}

fn null_vector(m: &Matrix3<Complex<f64>>, lambda: Complex<f64>) -> Option<ComplexPoint> {
    let shifted = m - Matrix3::from_diagonal_element(lambda);
    let rows: [ComplexPoint; 3] = std::array::from_fn(|i| shifted.row(i).transpose());
    let candidates =
        [complex_cross(&rows[0], &rows[1]), complex_cross(&rows[1], &rows[2]), complex_cross(&rows[2], &rows[0])];
    let best = candidates.into_iter().max_by(|a, b| a.norm_squared().total_cmp(&b.norm_squared()))?;
    let norm = best.norm();
    (norm.is_finite() && norm > 0.0).then(|| best.unscale(norm))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn complex_pair_of_a_rotation_like_matrix() {
        let m = Matrix3::new(0.9, -0.4, 0.3, 0.5, 0.8, -0.1, -0.2, 0.05, 1.3);
        let eigen = complex_pair_eigen(&m).expect("has a pair");
        let mc = m.map(|x| Complex::new(x, 0.0));
        assert!((mc * eigen.complex_right - eigen.complex_right * eigen.complex_value).norm() < 1e-14);
        assert!((mc.transpose() * eigen.complex_left - eigen.complex_left * eigen.complex_value).norm() < 1e-14);
        assert!((m * eigen.real_right - eigen.real_right * eigen.real_value).norm() < 1e-14);
        assert!((m.transpose() * eigen.real_left - eigen.real_left * eigen.real_value).norm() < 1e-14);
    }

    #[test]
    fn no_pair_in_a_symmetric_or_broken_matrix() {
        assert!(complex_pair_eigen(&Matrix3::new(2.0, 1.0, 0.0, 1.0, 3.0, 0.5, 0.0, 0.5, 1.0)).is_none());
        assert!(complex_pair_eigen(&Matrix3::identity()).is_none());
        assert!(complex_pair_eigen(&Matrix3::from_element(f64::NAN)).is_none());
    }

    #[test]
    fn the_sphere_tangent_is_orthonormal_and_orthogonal() {
        for first in [0.3, -0.3, 0.0] {
            let v = SVector::<f64, 9>::from_fn(|i, _| if i == 0 { first } else { (i as f64).sin() }).normalize();
            let t = sphere_tangent(&v);
            assert!((t.transpose() * t - SMatrix::<f64, 8, 8>::identity()).norm() < 1e-14);
            assert!((t.transpose() * v).norm() < 1e-14);
        }
    }

    #[test]
    fn spd_inverse_refuses_what_is_not_positive_definite() {
        let good = DMatrix::from_row_slice(2, 2, &[1e12, 1.0, 1.0, 1e-10]);
        let inverse = inverse_spd(&good).expect("positive definite");
        let exact = [1e-10 / 99.0, -1.0 / 99.0, -1.0 / 99.0, 1e12 / 99.0];
        assert!(inverse.iter().zip(exact).all(|(found, value)| (found / value - 1.0).abs() < 1e-12));
        assert!(inverse_spd(&DMatrix::from_row_slice(2, 2, &[1.0, 2.0, 2.0, 1.0])).is_none());
    }
}
