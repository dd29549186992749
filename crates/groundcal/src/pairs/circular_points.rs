//! The imaged circular points of the floor, from one plane-normal motion.
//!
//! For H = K (R + t nᵀ/d) K⁻¹ whose rotation axis is the plane's normal n (KZR eq. 1):
//!
//! ```text
//! H e = λ e,   e ~ K A (1, ±i, 0)ᵀ,   λ / |λ| = exp(∓i θ),   ρ = λ_real / |λ| = 1 + n·t/d
//! ```
//!
//! The eigenvector e is the image of a circular point whatever the translation; the line through e and its conjugate is
//! the horizon. Everything is in frame coordinates (see [`crate::geometry::frame`]), the same for both images. First-order
//! propagation: δe = Σ_k l_kᵀ δH e / ((λ - λ_k) l_kᵀ r_k) r_k over the other two eigenpairs.

use nalgebra::{Complex, Matrix3, Matrix4, SMatrix, SVector, Vector3, Vector4};

use crate::{
    geometry::{homography::HomographyCovariance, intrinsics::Intrinsics},
    numerics::linalg::{ComplexPoint, bilinear, complex_cross, complex_pair_eigen, cross_matrix, rows_of, to_complex},
    pairs::refine::HomographyEstimate,
};

/// One of the two imaged circular points (the other is its conjugate) with its covariance, in frame coordinates.
#[derive(Debug, Clone)]
pub(crate) struct CircularPoint {
    /// The point, unit length, of arbitrary phase.
    pub point: ComplexPoint,
    /// Two directions that complete it to a unitary basis: an error is e + α u + β v.
    pub tangent: [ComplexPoint; 2],
    /// Covariance of (Re α, Im α, Re β, Im β) from image noise.
    pub covariance: Matrix4<f64>,
    /// How it moves with the homography, for the effect of an axis that is not quite normal to the plane.
    pub sensitivity: Option<Sensitivity>,
    /// Derivative of its tangent coordinates by the radial distortion k1 that is undone before the homography is fitted, the focal length
    /// being taken as the longer image side; `None` where it was not computed.
    pub by_k1: Option<Vector4<f64>>,
}

/// The homography a circular point came from and the derivative of (Re α, Im α, Re β, Im β) by its entries.
#[derive(Debug, Clone)]
pub(crate) struct Sensitivity {
    /// Frame coordinates, unit norm.
    pub h: Matrix3<f64>,
    /// 4x9, entries row by row.
    pub jacobian: SMatrix<f64, 4, 9>,
}

/// Two directions that complete a unit complex vector to a unitary basis.
fn unitary_tangent(e: &ComplexPoint) -> [ComplexPoint; 2] {
    let smallest = (0..3).min_by(|&i, &j| e[i].norm().total_cmp(&e[j].norm())).unwrap_or(0);
    let mut axis = Vector3::zeros();
    axis[smallest] = Complex::new(1.0, 0.0);
    let u = axis - e * e.dotc(&axis);
    let u = u.unscale(u.norm());
    let v = complex_cross(e, &u).map(|z| z.conj());
    [u, v.unscale(v.norm())]
}

impl CircularPoint {
    /// A circular point from elsewhere: any non-zero multiple of it, and the standard deviation of its direction (each
    /// of the four real components, radians-like units of a unit vector).
    pub(crate) fn from_point(point: ComplexPoint, sigma: f64) -> Option<Self> {
        let norm = point.norm();
        if !(norm.is_finite() && norm > 0.0 && sigma.is_finite() && sigma > 0.0) {
            return None;
        }
        let point = point.unscale(norm);
        // A point whose conjugate is itself lies on the real plane: not a circular point.
        if bilinear_hermitian_gap(&point) < 1e-12 {
            return None;
        }
        let tangent = unitary_tangent(&point);
        Some(Self {
            point,
            tangent,
            covariance: Matrix4::from_diagonal_element(sigma * sigma),
            sensitivity: None,
            by_k1: None,
        })
    }

    /// The covariance with an axis that varies from the normal: each view's attitude has an independent error of
    /// `attitude_sigma_rad` about both axes across the normal, so H becomes K exp(δ) K⁻¹ H, δ with twice the variance.
    pub(crate) fn total_covariance(&self, k: &Intrinsics, attitude_sigma_rad: f64) -> Matrix4<f64> {
        let mut total = self.covariance;
        if let (Some(s), true) = (&self.sensitivity, attitude_sigma_rad > 0.0) {
            let (km, ki) = (k.matrix(), k.inverse_matrix());
            let normal = self.horizon().map(|l| (km.transpose() * l).normalize());
            for axis in 0..3 {
                let mut direction = Vector3::zeros();
                direction[axis] = 1.0;
                // Turning about the normal is what the motion does: only what is across it counts.
                if let Some(n) = normal {
                    direction -= n * n[axis];
                }
                let change = km * cross_matrix(&direction) * ki * s.h;
                let moved: Vector4<f64> = s.jacobian * rows_of(&change);
                total += moved * moved.transpose() * (2.0 * attitude_sigma_rad * attitude_sigma_rad);
            }
        }
        total
    }

    /// The point with the sign of the imaginary parts turned: its conjugate, covariance along.
    pub(crate) fn conjugate(&self) -> Self {
        let flip = Matrix4::from_diagonal(&Vector4::new(1.0, -1.0, 1.0, -1.0));
        Self {
            point: self.point.map(|z| z.conj()),
            tangent: self.tangent.map(|t| t.map(|z| z.conj())),
            covariance: flip * self.covariance * flip,
            sensitivity: self.sensitivity.as_ref().map(|s| Sensitivity { h: s.h, jacobian: flip * s.jacobian }),
            by_k1: self.by_k1.map(|v| flip * v),
        }
    }

    /// The horizon l (l·x = 0, unit length, sign free): the real line through the point and its conjugate.
    pub(crate) fn horizon(&self) -> Option<Vector3<f64>> {
        horizon_of(&self.point)
    }

    /// The tangent coordinates of another point close to this one, or of its conjugate, whichever is closer.
    pub(crate) fn coordinates_of(&self, other: &ComplexPoint) -> Vector4<f64> {
        let conjugate = other.map(|z| z.conj());
        let nearer =
            if self.point.dotc(other).norm() >= self.point.dotc(&conjugate).norm() { other } else { &conjugate };
        let along = self.point.dotc(nearer);
        let [a, b] = self.tangent.map(|t| t.dotc(nearer) / along);
        Vector4::new(a.re, a.im, b.re, b.im)
    }

    /// The point moved by tangent coordinates.
    pub(crate) fn moved(&self, step: &Vector4<f64>) -> ComplexPoint {
        self.point + self.tangent[0] * Complex::new(step[0], step[1]) + self.tangent[1] * Complex::new(step[2], step[3])
    }
}

/// The real line through a complex point and its conjugate.
fn horizon_of(point: &ComplexPoint) -> Option<Vector3<f64>> {
    let line = point.map(|z| z.re).cross(&point.map(|z| z.im));
    let norm = line.norm();
    (norm > 1e-12).then(|| line / norm)
}

/// 1 - |eᵀe| of a unit vector: 0 when it is a real vector times a phase.
fn bilinear_hermitian_gap(e: &ComplexPoint) -> f64 {
    1.0 - bilinear(e, e).norm()
}

/// What one motion says without a camera.
#[derive(Debug, Clone)]
pub(crate) struct MotionGeometry {
    /// The imaged circular point.
    pub circular_point: CircularPoint,
    /// Rotation angle, 0 to π (the sign needs the camera: see [`mod@crate::calibrate`]).
    pub rotation_rad: f64,
    /// Its standard deviation.
    pub rotation_sigma_rad: f64,
    /// ρ = 1 + n·t/d: 1 for a motion at constant height.
    pub height_ratio: f64,
    /// Its standard deviation.
    pub height_ratio_sigma: f64,
}

impl MotionGeometry {
    /// The smaller of the fractions of points (homogeneous frame coordinates, third coordinate as that of their rays) on either side of the horizon: 0 to 0.5.
    pub(crate) fn minor_side(&self, points: impl Iterator<Item = Vector3<f64>>) -> f64 {
        let Some(l) = self.circular_point.horizon() else { return 0.0 };
        let (mut all, mut positive) = (0usize, 0usize);
        for p in points {
            all += 1;
            positive += usize::from(l.dot(&p) > 0.0);
        }
        positive.min(all - positive) as f64 / all.max(1) as f64
    }
}

/// Why a homography has no usable circular points.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum NoCircularPoint {
    /// All eigenvalues are real, or the imaginary part is not above the noise: translation, or a turn near 0 or 180
    /// degrees.
    NoRotation {
        /// The angle the eigenvalues give, in radians (0 when real, or π when the pair is negative).
        rotation_rad: f64,
        /// Imaginary part over its standard deviation.
        significance: f64,
    },
    /// The circular point is known too badly to say anything.
    TooUncertain {
        /// Largest standard deviation of its direction, dimensionless.
        sigma: f64,
    },
}

/// Imaginary part of the eigenvalue over its standard deviation that is asked for. Where eigenvalues collapse the
/// imaginary part of pure noise is 2 to 3 times its linearised deviation (a square or cube root of the noise).
pub(crate) const MIN_SIGNIFICANCE: f64 = 8.0;
/// Largest standard deviation of the point's direction for which first-order propagation means something.
pub(crate) const MAX_DIRECTION_SIGMA: f64 = 0.3;

/// Whether a homography shows a turn about the plane's normal above its noise: whether it has a circular point that is known.
pub fn shows_turn(estimate: &HomographyEstimate) -> bool {
    from_homography(estimate).is_ok()
}

/// The circular points of a homography with covariance.
pub(crate) fn from_homography(estimate: &HomographyEstimate) -> Result<MotionGeometry, NoCircularPoint> {
    geometry(&estimate.in_frame, &estimate.covariance)
}

fn geometry(h: &Matrix3<f64>, covariance: &HomographyCovariance) -> Result<MotionGeometry, NoCircularPoint> {
    let Some(eigen) = complex_pair_eigen(h) else {
        let rotation_rad = if h.trace() < 0.0 { std::f64::consts::PI } else { 0.0 };
        return Err(NoCircularPoint::NoRotation { rotation_rad, significance: 0.0 });
    };
    let (e, l, lambda) = (eigen.complex_right, eigen.complex_left, eigen.complex_value);
    let outer = |left: &ComplexPoint, right: &ComplexPoint| {
        SVector::<Complex<f64>, 9>::from_fn(|i, _| left[i / 3] * right[i % 3])
    };
    let conj = |p: &ComplexPoint| p.map(|z| z.conj());
    let real_right = to_complex(&eigen.real_right);
    let real_left = to_complex(&eigen.real_left);

    // d log λ = lᵀ δH e / (λ lᵀe): imaginary part the angle, real part the modulus.
    let d_log_lambda = outer(&l, &e) / (bilinear(&l, &e) * lambda);
    let d_angle = d_log_lambda.map(|z| z.im);
    let d_log_height_ratio = outer(&real_left, &real_right).map(|z| z.re)
        / (eigen.real_left.dot(&eigen.real_right) * eigen.real_value)
        - d_log_lambda.map(|z| z.re);
    let variance = |row: &SVector<f64, 9>| (row.transpose() * covariance * row)[(0, 0)].max(0.0);
    let rotation_rad = lambda.im.atan2(lambda.re);
    let rotation_sigma_rad = variance(&d_angle).sqrt();
    let modulus = lambda.norm();
    let height_ratio = eigen.real_value / modulus;
    let height_ratio_sigma = (variance(&d_log_height_ratio)).sqrt() * height_ratio.abs();
    // sin θ over its deviation tells a turn from noise at both ends, 0 and 180 degrees.
    let significance = rotation_rad.sin() / rotation_sigma_rad.max(f64::MIN_POSITIVE);
    if significance.is_nan() || significance < MIN_SIGNIFICANCE {
        return Err(NoCircularPoint::NoRotation { rotation_rad, significance });
    }

    let tangent = unitary_tangent(&e);
    // The other two eigenpairs: the conjugate and the real one.
    let others = [(lambda.conj(), conj(&e), conj(&l)), (Complex::new(eigen.real_value, 0.0), real_right, real_left)];
    let mut jacobian = SMatrix::<f64, 4, 9>::zeros();
    for (value, right, left) in &others {
        let row = outer(left, &e) / ((lambda - value) * bilinear(left, right));
        for (k, axis) in tangent.iter().enumerate() {
            let along = row * axis.dotc(right);
            for c in 0..9 {
                jacobian[(2 * k, c)] += along[c].re;
                jacobian[(2 * k + 1, c)] += along[c].im;
            }
        }
    }
    let covariance = jacobian * covariance * jacobian.transpose();
    let sigma = (0..4).map(|i| covariance[(i, i)]).fold(0.0, f64::max).sqrt();
    if sigma.is_nan() || sigma > MAX_DIRECTION_SIGMA {
        return Err(NoCircularPoint::TooUncertain { sigma });
    }
    Ok(MotionGeometry {
        circular_point: CircularPoint {
            point: e,
            tangent,
            covariance,
            sensitivity: Some(Sensitivity { h: *h, jacobian }),
            by_k1: None,
        },
        rotation_rad,
        rotation_sigma_rad,
        height_ratio,
        height_ratio_sigma,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Rotation3;

    fn example(theta: f64, t: Vector3<f64>) -> (Intrinsics, Matrix3<f64>, Vector3<f64>) {
        let k = Intrinsics { fx: 2.1, fy: 2.0, cx: 0.05, cy: -0.03, skew: 0.01 };
        let attitude = Rotation3::from_euler_angles(2.3, 0.2, 0.4);
        let n = attitude * Vector3::z();
        let r = attitude * Rotation3::from_axis_angle(&Vector3::z_axis(), theta) * attitude.inverse();
        let h = k.matrix() * (r.matrix() + (attitude * t) * n.transpose()) * k.inverse_matrix();
        (k, h / h.norm(), n)
    }

    #[test]
    fn closed_form_gives_angle_rho_conic_and_horizon() {
        for (theta, t) in
            [(0.4, Vector3::new(0.3, -0.5, 0.0)), (1.2, Vector3::new(0.1, 0.2, 0.25)), (2.9, Vector3::zeros())]
        {
            let (k, h, n) = example(theta, t);
            let g = geometry(&h, &HomographyCovariance::from_diagonal_element(1e-20)).expect("a rotation");
            assert!((g.rotation_rad - theta).abs() < 1e-12);
            assert!((g.height_ratio - (1.0 + t.z)).abs() < 1e-12);
            let v = k.inverse_matrix().map(|x| Complex::new(x, 0.0)) * g.circular_point.point;
            assert!(bilinear(&v, &v).norm() < 1e-12);
            let horizon = g.circular_point.horizon().expect("a line");
            assert!((k.matrix().transpose() * horizon).cross(&n).norm() < 1e-12);
        }
    }

    #[test]
    fn the_jacobian_agrees_with_differences() {
        let (_, h, _) = example(0.5, Vector3::new(0.2, 0.1, 0.1));
        let tiny = HomographyCovariance::from_diagonal_element(1e-16);
        let at = geometry(&h, &tiny).expect("a rotation");
        let cp = &at.circular_point;
        let jacobian = cp.sensitivity.as_ref().expect("from a homography").jacobian;
        let step = 1e-6;
        let coordinates = |m: &Matrix3<f64>| {
            let p = geometry(m, &tiny).expect("a rotation").circular_point.point;
            let p = p / cp.point.dotc(&p);
            let [a, b] = cp.tangent.map(|t| t.dotc(&p));
            Vector4::new(a.re, a.im, b.re, b.im)
        };
        for i in 0..9 {
            let mut d = Matrix3::zeros();
            d[(i / 3, i % 3)] = step;
            let difference = (coordinates(&(h + d)) - coordinates(&(h - d))) / (2.0 * step);
            assert!((difference - jacobian.column(i)).norm() < 1e-6 * (1.0 + difference.norm()), "{i}");
        }
    }

    #[test]
    fn translation_and_half_turns_are_refused_with_noise_and_without() {
        use rand::{RngExt, SeedableRng};
        let mut rng = rand_pcg::Pcg64Mcg::seed_from_u64(3);
        for (theta, t) in [
            (0.0, Vector3::new(0.4, 0.1, 0.0)),
            (0.0, Vector3::new(0.4, 0.1, 0.2)),
            (0.0, Vector3::zeros()),
            (std::f64::consts::PI, Vector3::new(0.1, 0.0, 0.0)),
        ] {
            for sigma in [1e-4, 1e-3] {
                for _ in 0..200 {
                    let (_, h, _) = example(theta, t);
                    let noise = Matrix3::from_fn(|_, _| sigma * 3f64.sqrt() * rng.random_range(-1.0..1.0));
                    let found = geometry(&(h + noise), &HomographyCovariance::from_diagonal_element(sigma * sigma));
                    assert!(
                        found.is_err(),
                        "{theta} {t:?} {sigma}: {:?}",
                        found.map(|g| (g.rotation_rad, g.rotation_sigma_rad))
                    );
                }
            }
        }
    }
}
