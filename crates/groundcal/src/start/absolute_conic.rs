//! From circular points to the camera matrix.
//!
//! Each attitude's circular point e lies on ω = K⁻ᵀK⁻¹, the image of the absolute conic: eᵀ ω e = 0, two real equations
//! (KZR 1.1). The linear solution minimises Σ rᵀ C⁻¹ r over the entries of ω left free by a [`Constraint`], C being the
//! covariance of r = eᵀ ω e propagated from e, iterated; K follows by Cholesky. It is then polished to the maximum
//! likelihood of the circular points, each corrected onto the conic, over
//!
//! ```text
//! p = (ln fx, ln fy/fx, cx, cy, skew)      frame units, r = vᵀv / vᴴv with v = K⁻¹ e
//! ```
//!
//! with the information matrix Σ Jᵀ C⁻¹ J (plus that of priors).

use nalgebra::{
    Complex, DMatrix, DVector, Matrix2, Matrix2x4, Matrix3, Matrix4, SMatrix, SVector, Vector2, Vector3, Vector4,
};

use crate::{
    error::Error,
    geometry::{frame::Frame, intrinsics::Intrinsics},
    numerics::{
        levenberg_marquardt::{LeastSquares, LmOptions, NormalEquations, minimise},
        linalg::{ComplexPoint, bilinear, inverse_spd, symmetric_eigen},
    },
    pairs::circular_points::CircularPoint,
    remedy::Remedy,
};

pub use crate::geometry::constraint::Constraint;

impl Constraint {
    /// Basis of the conics ω that the constraint allows (KZR 1.1), columns (ω11, ω12, ω13, ω22, ω23, ω33): ω12 = 0 without skew, ω11 = aspect² ω22 for a
    /// known `aspect` fy / fx, ω13 = ω23 = 0 for a principal point at the frame's origin. Whatever is not linear in ω has no basis.
    pub(crate) fn basis(self, aspect: f64) -> DMatrix<f64> {
        let square = [1.0, 0.0, 0.0, 1.0 / (aspect * aspect), 0.0, 0.0];
        let unit = |i: usize| std::array::from_fn(|j| if i == j { 1.0 } else { 0.0 });
        let columns: Vec<[f64; 6]> = match self {
            Constraint::Full => (0..6).map(unit).collect(),
            Constraint::ZeroSkew => [0, 2, 3, 4, 5].map(unit).to_vec(),
            Constraint::Square => vec![square, unit(2), unit(4), unit(5)],
            Constraint::FixedPrincipalPoint => [0, 3, 5].map(unit).to_vec(),
            Constraint::Auto | Constraint::Focal => vec![square, unit(5)],
        };
        DMatrix::from_fn(6, columns.len(), |r, c| columns[c][r])
    }
}

/// Gaussian priors on (ln fx, ln fy/fx, cx, cy, skew), frame units; `None`: no prior on that parameter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Priors(pub [Option<(f64, f64)>; 5]);

impl Priors {
    /// No prior at all.
    pub(crate) const NONE: Priors = Priors([None; 5]);
}

/// One attitude's circular point with the covariance to be used for it.
#[derive(Debug, Clone)]
pub(crate) struct WeightedPoint {
    /// The circular point.
    pub point: CircularPoint,
    /// Covariance of its tangent coordinates, axis error included.
    pub covariance: Matrix4<f64>,
}

/// Camera matrix parameters (ln fx, ln fy/fx, cx, cy, skew) in frame units.
pub(crate) type Parameters = SVector<f64, 5>;

/// The camera matrix of the parameters.
pub(crate) fn intrinsics_of(p: &Parameters) -> Intrinsics {
    let fx = p[0].exp();
    Intrinsics { fx, fy: fx * p[1].exp(), cx: p[2], cy: p[3], skew: p[4] }
}

/// The parameters of a camera matrix.
pub(crate) fn parameters_of(k: &Intrinsics) -> Parameters {
    Parameters::from([k.fx.ln(), (k.fy / k.fx).ln(), k.cx, k.cy, k.skew])
}

/// r = vᵀv / vᴴv, its derivative by the point's tangent coordinates and by the parameters.
pub(crate) struct Residual {
    /// Real and imaginary part of r; 0 on the conic, of modulus 1 at most.
    pub value: Vector2<f64>,
    /// ∂r / ∂(Re α, Im α, Re β, Im β).
    pub by_point: Matrix2x4<f64>,
    /// ∂r / ∂p.
    pub by_parameters: SMatrix<f64, 2, 5>,
}

/// How the residual of the image of a circular point, both in pixels, changes with (ln fx, ln fy/fx, cx, cy, skew), the last three in
/// units of the frame.
pub fn residual_by_camera(frame: &Frame, intrinsics: &Intrinsics, point_px: &ComplexPoint) -> SMatrix<f64, 2, 5> {
    let e = frame.frame_matrix().map(|x| Complex::new(x, 0.0)) * point_px;
    residual(&parameters_of(&frame.intrinsics_from_pixel(intrinsics)), &e, &[e, e]).by_parameters
}

/// The residual of a (complex) point `e` whose error directions are `tangent`.
pub(crate) fn residual(p: &Parameters, e: &ComplexPoint, tangent: &[ComplexPoint; 2]) -> Residual {
    let k = intrinsics_of(p);
    let inverse = |q: &ComplexPoint| -> ComplexPoint {
        let y = (q.y - q.z * k.cy) / k.fy;
        Vector3::new((q.x - q.z * k.cx - y * k.skew) / k.fx, y, q.z)
    };
    let v = inverse(e);
    let norm = v.norm_squared();
    let r = bilinear(&v, &v) / norm;
    let mut by_point = Matrix2x4::zeros();
    for (i, t) in tangent.iter().enumerate() {
        let d = bilinear(&v, &inverse(t)) * 2.0 / norm;
        by_point[(0, 2 * i)] = d.re;
        by_point[(1, 2 * i)] = d.im;
        by_point[(0, 2 * i + 1)] = -d.im;
        by_point[(1, 2 * i + 1)] = d.re;
    }
    // v = K⁻¹ e: ∂v_y/∂ln fy = -v_y, and so on; ln fy = p0 + p1.
    let zero = Complex::new(0.0, 0.0);
    let (fx, fy, s) = (k.fx, k.fy, k.skew);
    let by_fx: ComplexPoint = Vector3::new(-v.x, zero, zero);
    let by_fy: ComplexPoint = Vector3::new(v.y * (s / fx), -v.y, zero);
    let by_cx: ComplexPoint = Vector3::new(-v.z / fx, zero, zero);
    let by_cy: ComplexPoint = Vector3::new(v.z * (s / (fx * fy)), -v.z / fy, zero);
    let by_skew: ComplexPoint = Vector3::new(-v.y / fx, zero, zero);
    let mut by_parameters = SMatrix::<f64, 2, 5>::zeros();
    for (c, d) in [by_fx + by_fy, by_fy, by_cx, by_cy, by_skew].iter().enumerate() {
        let d = bilinear(&v, d) * 2.0 / norm;
        by_parameters[(0, c)] = d.re;
        by_parameters[(1, c)] = d.im;
    }
    Residual { value: Vector2::new(r.re, r.im), by_point, by_parameters }
}

/// Least covariance of a residual: keeps exact data invertible, far below any real noise.
const COVARIANCE_FLOOR: f64 = 1e-28;

/// A point corrected onto the conic: innovation, its covariance, derivative by the parameters.
struct Corrected {
    innovation: Vector2<f64>,
    information: Matrix2<f64>,
    by_parameters: SMatrix<f64, 2, 5>,
}

fn correct(p: &Parameters, point: &WeightedPoint) -> Option<Corrected> {
    let mut step = Vector4::zeros();
    let mut result = None;
    for round in 0..3 {
        let e = point.point.moved(&step);
        let r = residual(p, &e, &point.point.tangent);
        let innovation = r.value - r.by_point * step;
        let covariance =
            r.by_point * point.covariance * r.by_point.transpose() + Matrix2::from_diagonal_element(COVARIANCE_FLOOR);
        let information = covariance.try_inverse()?;
        if round == 2 {
            result = Some(Corrected { innovation, information, by_parameters: r.by_parameters });
        } else {
            let correction = -(point.covariance * r.by_point.transpose() * information * innovation);
            // Far from the conic the linearised correction is meaningless: stay at the measured point.
            if correction.norm() > 0.5 {
                return Some(Corrected { innovation, information, by_parameters: r.by_parameters });
            }
            step = correction;
        }
    }
    result
}

struct MaximumLikelihood<'a> {
    points: &'a [WeightedPoint],
    priors: &'a Priors,
    free: Vec<usize>,
}

impl LeastSquares for MaximumLikelihood<'_> {
    type State = Parameters;
    type Linearised = NormalEquations;

    fn cost(&self, p: &Self::State) -> Option<f64> {
        let mut cost = 0.0;
        for point in self.points {
            let c = correct(p, point)?;
            cost += 0.5 * (c.innovation.transpose() * c.information * c.innovation)[(0, 0)];
        }
        for (i, prior) in self.priors.0.iter().enumerate() {
            if let Some((mean, sigma)) = prior {
                cost += 0.5 * ((p[i] - mean) / sigma).powi(2);
            }
        }
        cost.is_finite().then_some(cost)
    }

    fn linearise(&self, p: &Self::State) -> Option<NormalEquations> {
        let mut cost = 0.0;
        let mut gradient = SVector::<f64, 5>::zeros();
        let mut information = SMatrix::<f64, 5, 5>::zeros();
        for point in self.points {
            let c = correct(p, point)?;
            let weighted = c.by_parameters.transpose() * c.information;
            cost += 0.5 * (c.innovation.transpose() * c.information * c.innovation)[(0, 0)];
            gradient += weighted * c.innovation;
            information += weighted * c.by_parameters;
        }
        for (i, prior) in self.priors.0.iter().enumerate() {
            if let Some((mean, sigma)) = prior {
                let weight = 1.0 / (sigma * sigma);
                cost += 0.5 * weight * (p[i] - mean).powi(2);
                gradient[i] += weight * (p[i] - mean);
                information[(i, i)] += weight;
            }
        }
        let n = self.free.len();
        cost.is_finite().then(|| NormalEquations {
            cost,
            gradient: DVector::from_fn(n, |i, _| gradient[self.free[i]]),
            information: DMatrix::from_fn(n, n, |r, c| information[(self.free[r], self.free[c])]),
        })
    }

    fn retract(&self, p: &Self::State, step: &DVector<f64>) -> Self::State {
        let mut moved = *p;
        for (i, &index) in self.free.iter().enumerate() {
            moved[index] += step[i];
        }
        moved
    }
}

/// The estimate of the camera matrix.
#[derive(Debug, Clone)]
pub(crate) struct ConicSolution {
    /// Parameters, frame units.
    pub parameters: Parameters,
    /// Covariance of (ln fx, ln fy/fx, cx, cy, skew), frame units; zero rows for what was held.
    pub covariance: SMatrix<f64, 5, 5>,
    /// Sum of squared normalised residuals, priors included.
    pub chi_squared: f64,
    /// Equations (and priors) minus unknowns.
    pub degrees_of_freedom: usize,
    /// Logarithm of the determinants of the residuals' covariances and of the information matrix: with chi-squared, -2
    /// times the restricted log likelihood of whatever the covariances depend on.
    pub log_determinants: f64,
}

impl ConicSolution {
    /// The camera matrix, frame units.
    pub(crate) fn intrinsics(&self) -> Intrinsics {
        intrinsics_of(&self.parameters)
    }
}

/// Maximum likelihood (maximum a posteriori with priors) from a start; `None` when the start is unusable or the
/// information matrix singular.
pub(crate) fn refine(
    points: &[WeightedPoint],
    start: &Parameters,
    free: [bool; 5],
    priors: &Priors,
) -> Option<ConicSolution> {
    let free: Vec<usize> = (0..5).filter(|&i| free[i]).collect();
    let problem = MaximumLikelihood { points, priors, free };
    let options =
        LmOptions { max_iterations: 40, relative_cost_tolerance: 1e-9, step_tolerance: 1e-13, ..LmOptions::default() };
    let out = minimise(&problem, *start, &options)?;
    let inverse = inverse_spd(&out.linearised.information)?;
    let mut covariance = SMatrix::<f64, 5, 5>::zeros();
    for (r, &i) in problem.free.iter().enumerate() {
        for (c, &j) in problem.free.iter().enumerate() {
            covariance[(i, j)] = inverse[(r, c)];
        }
    }
    let with_prior = problem.free.iter().filter(|&&i| priors.0[i].is_some()).count();
    Some(ConicSolution {
        parameters: out.state,
        covariance,
        chi_squared: 2.0 * out.cost,
        degrees_of_freedom: (2 * points.len() + with_prior).saturating_sub(problem.free.len()),
        log_determinants: points
            .iter()
            .filter_map(|point| Some(-correct(&out.state, point)?.information.determinant().ln()))
            .sum::<f64>()
            - inverse.determinant().ln(),
    })
}

/// The equations eᵀ ω d = 0 in (ω11, ω12, ω13, ω22, ω23, ω33), real part and imaginary part. Of a circular point e = p + iq with itself (KZR 1.1):
/// pᵀωp - qᵀωq = 0 and 2 pᵀωq = 0.
fn conic_rows(e: &ComplexPoint, d: &ComplexPoint) -> [SVector<f64, 6>; 2] {
    let c = [e.x * d.x, e.x * d.y + e.y * d.x, e.x * d.z + e.z * d.x, e.y * d.y, e.y * d.z + e.z * d.y, e.z * d.z];
    [SVector::from(c.map(|z| z.re)), SVector::from(c.map(|z| z.im))]
}

/// Information over noise below which a direction of the conic counts as unseen.
pub(crate) const MIN_SIGNAL_OVER_NOISE: f64 = 5.0;

/// The weighted linear solution for one of the hard constraints (for `Auto`: as `Focal`), iterated on its weights.
///
/// # Errors
/// [`Error::Undetermined`] when a second direction of the conic is at the level of the noise,
/// [`Error::NotPositiveDefinite`] when no real camera solves the equations.
pub(crate) fn solve_linear(points: &[WeightedPoint], constraint: Constraint, aspect: f64) -> Result<Parameters, Error> {
    let basis = constraint.basis(aspect);
    let mut p = Parameters::from([2f64.ln(), aspect.ln(), 0.0, 0.0, 0.0]);
    const ROUNDS: usize = 3;
    for round in 0..ROUNDS {
        let omega = {
            let ki = intrinsics_of(&p).inverse_matrix();
            ki.transpose() * ki
        };
        let mut signal = SMatrix::<f64, 6, 6>::zeros();
        let mut noise = SMatrix::<f64, 6, 6>::zeros();
        for point in points {
            let e = &point.point.point;
            let we: ComplexPoint = omega.map(|x| Complex::new(x, 0.0)) * e;
            let mut jacobian = Matrix2x4::zeros();
            for (i, t) in point.point.tangent.iter().enumerate() {
                let d = bilinear(&we, t) * 2.0;
                jacobian[(0, 2 * i)] = d.re;
                jacobian[(1, 2 * i)] = d.im;
                jacobian[(0, 2 * i + 1)] = -d.im;
                jacobian[(1, 2 * i + 1)] = d.re;
            }
            let floor = Matrix2::from_diagonal_element(COVARIANCE_FLOOR);
            let covariance = jacobian * point.covariance * jacobian.transpose() + floor;
            let Some(weight) = covariance.try_inverse() else { continue };
            let add = |target: &mut SMatrix<f64, 6, 6>, rows: &[SVector<f64, 6>; 2]| {
                for a in 0..2 {
                    for b in 0..2 {
                        target.ger(weight[(a, b)], &rows[a], &rows[b], 1.0);
                    }
                }
            };
            add(&mut signal, &conic_rows(e, e));
            if round == ROUNDS - 1 {
                // What image noise alone would add to the matrix. (An axis that varies moves a point along the conic: that is
                // information, not noise.)
                let spread = Matrix4::from_diagonal_element(1e-18) + point.point.covariance;
                if let Some(root) = spread.cholesky() {
                    for c in 0..4 {
                        let column = root.l().column(c).into_owned();
                        let d = point.point.moved(&column) - e;
                        add(&mut noise, &conic_rows(e, &d).map(|r| r * 2.0));
                    }
                }
            }
        }
        let n = basis.ncols();
        let reduce = |m: &SMatrix<f64, 6, 6>| {
            let dynamic = DMatrix::from_fn(6, 6, |r, c| m[(r, c)]);
            basis.transpose() * dynamic * &basis
        };
        let reduced = reduce(&signal);
        let (_, vectors) = symmetric_eigen(&reduced)
            .ok_or_else(|| Error::Numerical { stage: "absolute conic", detail: "normal matrix not finite".into() })?;
        if round == ROUNDS - 1 {
            check_rank(&reduced, &reduce(&noise), constraint)?;
        }
        let z = DVector::from_fn(n, |i, _| vectors[(i, 0)]);
        match intrinsics_from_conic(&conic_from_entries(&(&basis * z))) {
            Ok(k) => p = parameters_of(&k),
            Err(eigenvalues) if round == ROUNDS - 1 => {
                return Err(Error::NotPositiveDefinite {
                    constraint: constraint.name(),
                    eigenvalues,
                    remedies: vec![
                        Remedy::CLEAR_TURN,
                        Remedy::VaryTiltAndRoll,
                        Remedy::UseConstraint { any_of: vec![Constraint::Focal] },
                    ],
                });
            }
            // The first weights may be far off; the next round has another chance from them.
            Err(_) => {}
        }
    }
    Ok(p)
}

/// The linear solution as the paper has it (KZR 1.1): the rows of all unit points stacked, every equation with the same
/// weight, no check of rank. Points and result in frame coordinates; `aspect` is fy / fx where the constraint holds it.
///
/// # Errors
/// [`Error::NotPositiveDefinite`] when no real camera solves the equations.
pub(crate) fn solve_unweighted(
    points: &[ComplexPoint],
    constraint: Constraint,
    aspect: f64,
) -> Result<Parameters, Error> {
    let basis = constraint.basis(aspect);
    let mut signal = SMatrix::<f64, 6, 6>::zeros();
    for e in points {
        for row in conic_rows(e, e) {
            signal.ger(1.0, &row, &row, 1.0);
        }
    }
    let reduced = basis.transpose() * DMatrix::from_fn(6, 6, |r, c| signal[(r, c)]) * &basis;
    let (_, vectors) = symmetric_eigen(&reduced)
        .ok_or_else(|| Error::Numerical { stage: "absolute conic", detail: "normal matrix not finite".into() })?;
    let k = intrinsics_from_conic(&conic_from_entries(&(&basis * vectors.column(0))));
    k.map(|k| parameters_of(&k)).map_err(|eigenvalues| Error::NotPositiveDefinite {
        constraint: constraint.name(),
        eigenvalues,
        remedies: vec![Remedy::CLEAR_TURN, Remedy::VaryTiltAndRoll],
    })
}

/// The symmetric matrix of (ω11, ω12, ω13, ω22, ω23, ω33).
pub(crate) fn conic_from_entries(w: &DVector<f64>) -> Matrix3<f64> {
    Matrix3::new(w[0], w[1], w[2], w[1], w[3], w[4], w[2], w[4], w[5])
}

/// Compares the second weakest direction of the equations with what noise alone gives it.
fn check_rank(signal: &DMatrix<f64>, noise: &DMatrix<f64>, constraint: Constraint) -> Result<(), Error> {
    if signal.nrows() < 3 {
        // One unknown (or two, both in every equation): the size of the error bar tells.
        return Ok(());
    }
    let ratio = signal_over_noise(signal, noise).ok_or_else(|| Error::Numerical {
        stage: "absolute conic",
        detail: "noise matrix not positive definite".into(),
    })?;
    if ratio < MIN_SIGNAL_OVER_NOISE {
        return Err(Error::Undetermined {
            constraint: constraint.name(),
            direction: format!(
                "a whole family of cameras fits the motions equally well (signal over noise {ratio:.2}, at least \
                 {MIN_SIGNAL_OVER_NOISE} is needed)"
            ),
            remedies: vec![Remedy::TiltOrRoll { deg: 20.0 }, Remedy::UseConstraint { any_of: vec![Constraint::Focal] }],
        });
    }
    Ok(())
}

/// The second smallest eigenvalue of `signal` with respect to `noise`, the matrix that noise alone would give; `None` when
/// an entry is not finite.
pub(crate) fn signal_over_noise(signal: &DMatrix<f64>, noise: &DMatrix<f64>) -> Option<f64> {
    let n = signal.nrows();
    let regularised = noise + DMatrix::identity(n, n) * (1e-9 * noise.trace().max(f64::MIN_POSITIVE) / n as f64);
    let root = regularised.cholesky()?.l();
    let whitened = root.solve_lower_triangular(signal)?;
    let whitened = root.solve_lower_triangular(&whitened.transpose())?;
    let symmetric = (&whitened + whitened.transpose()) * 0.5;
    let (values, _) = symmetric_eigen(&symmetric)?;
    Some(values[1])
}

/// K from ω ~ K⁻ᵀK⁻¹ by Cholesky.
///
/// # Errors
/// The eigenvalues, largest modulus scaled to one, when ω is not definite.
pub(crate) fn intrinsics_from_conic(omega: &Matrix3<f64>) -> Result<Intrinsics, [f64; 3]> {
    let signed = if omega.trace() < 0.0 { -omega } else { *omega };
    if let Some(l) = signed.cholesky() {
        // ω = L Lᵀ and ω ~ K⁻ᵀ K⁻¹ with K⁻¹ upper triangular: K ~ L⁻ᵀ.
        if let Some(k) = l.l().transpose().try_inverse() {
            // The inverse of a triangular matrix leaves rounding below the diagonal.
            let upper = Matrix3::new(k[(0, 0)], k[(0, 1)], k[(0, 2)], 0.0, k[(1, 1)], k[(1, 2)], 0.0, 0.0, k[(2, 2)]);
            if let Some(intrinsics) = Intrinsics::from_matrix(&upper) {
                return Ok(intrinsics);
            }
        }
    }
    let mut values: Vec<f64> = signed.symmetric_eigenvalues().iter().copied().collect();
    values.sort_by(f64::total_cmp);
    let largest = values.iter().fold(f64::MIN_POSITIVE, |m, v| m.max(v.abs()));
    Err([values[0] / largest, values[1] / largest, values[2] / largest])
}

/// The squared Mahalanobis distance of a motion's circular point from the conic of an estimate with covariance
/// (two degrees of freedom), and the logarithm of how much better "on this conic" explains it than "anywhere".
pub(crate) fn agreement(
    p: &Parameters,
    parameter_covariance: &SMatrix<f64, 5, 5>,
    point: &WeightedPoint,
) -> Option<(f64, f64)> {
    let r = residual(p, &point.point.point, &point.point.tangent);
    let covariance = r.by_point * point.covariance * r.by_point.transpose()
        + r.by_parameters * parameter_covariance * r.by_parameters.transpose()
        + Matrix2::from_diagonal_element(COVARIANCE_FLOOR);
    let distance = (r.value.transpose() * covariance.try_inverse()? * r.value)[(0, 0)];
    // Anywhere: r uniform over the unit disc, density 1/π.
    let log_odds = -0.5 * distance - 0.5 * covariance.determinant().ln() - 2f64.ln();
    Some((distance, log_odds))
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Rotation3;

    fn points_for(k: &Intrinsics, attitudes: &[(f64, f64)], sigma: f64) -> Vec<WeightedPoint> {
        attitudes
            .iter()
            .map(|&(pitch, roll)| {
                let a = Rotation3::from_axis_angle(&Vector3::z_axis(), roll)
                    * Rotation3::from_axis_angle(&Vector3::x_axis(), pitch);
                let v: ComplexPoint = (k.matrix() * a.matrix()).map(|x| Complex::new(x, 0.0))
                    * Vector3::new(Complex::new(1.0, 0.0), Complex::new(0.0, 1.0), Complex::new(0.0, 0.0));
                let point = CircularPoint::from_point(v, sigma).expect("a circular point");
                let covariance = point.covariance;
                WeightedPoint { point, covariance }
            })
            .collect()
    }

    fn truth(constraint: Constraint) -> Intrinsics {
        match constraint {
            Constraint::Full => Intrinsics { fx: 2.1, fy: 2.05, cx: 0.04, cy: -0.06, skew: 0.01 },
            Constraint::ZeroSkew => Intrinsics { fx: 2.1, fy: 2.05, cx: 0.04, cy: -0.06, skew: 0.0 },
            Constraint::Square => Intrinsics { fx: 2.1, fy: 2.1, cx: 0.04, cy: -0.06, skew: 0.0 },
            Constraint::FixedPrincipalPoint => Intrinsics { fx: 2.1, fy: 2.05, cx: 0.0, cy: 0.0, skew: 0.0 },
            Constraint::Focal | Constraint::Auto => Intrinsics { fx: 2.1, fy: 2.1, cx: 0.0, cy: 0.0, skew: 0.0 },
        }
    }

    const ATTITUDES: [(f64, f64); 5] = [(2.2, 0.15), (2.0, 0.5), (2.4, -0.6), (1.9, 1.2), (2.3, 0.2)];

    #[test]
    fn exact_points_give_the_exact_camera_under_every_constraint() {
        for constraint in Constraint::ALL {
            let k = truth(constraint);
            for count in [constraint.attitudes_needed(), 5] {
                let points = points_for(&k, &ATTITUDES[..count], 1e-9);
                let p = solve_linear(&points, constraint, 1.0).expect("determined");
                let error = (parameters_of(&k) - p).norm();
                assert!(error < 1e-9, "{constraint:?} {count}: {error:e}");
                let bare: Vec<ComplexPoint> = points.iter().map(|w| w.point.point).collect();
                let p = solve_unweighted(&bare, constraint, 1.0).expect("definite");
                assert!((parameters_of(&k) - p).norm() < 1e-9, "{constraint:?} {count}, unweighted");
                let out = refine(&points, &p, constraint.free(), &Priors::NONE);
                if constraint != Constraint::Auto || count > 1 {
                    let out = out.expect("determined");
                    assert!((parameters_of(&k) - out.parameters).norm() < 1e-9, "{constraint:?} {count}");
                }
            }
        }
    }

    #[test]
    fn a_given_aspect_ratio_is_used() {
        let k = Intrinsics { fx: 2.0, fy: 2.2, cx: 0.0, cy: 0.0, skew: 0.0 };
        let p = solve_linear(&points_for(&k, &ATTITUDES[..1], 1e-9), Constraint::Focal, 1.1).expect("determined");
        assert!((parameters_of(&k) - p).norm() < 1e-9);
    }

    #[test]
    fn the_residual_is_zero_at_truth_and_its_derivatives_agree_with_differences() {
        let k = truth(Constraint::Full);
        let p = parameters_of(&k);
        for w in points_for(&k, &ATTITUDES, 1e-3) {
            let e = w.point.point;
            let at = residual(&p, &e, &w.point.tangent);
            assert!(at.value.norm() < 1e-13);
            let h = 1e-6;
            for i in 0..5 {
                let mut d = Parameters::zeros();
                d[i] = h;
                let value = |q: Parameters| residual(&q, &e, &w.point.tangent).value;
                let difference = (value(p + d) - value(p - d)) / (2.0 * h);
                assert!((difference - at.by_parameters.column(i)).norm() < 1e-8);
            }
            for i in 0..4 {
                let mut d = Vector4::zeros();
                d[i] = h;
                let value = |s: Vector4<f64>| residual(&p, &w.point.moved(&s), &w.point.tangent).value;
                let difference = (value(d) - value(-d)) / (2.0 * h);
                assert!((difference - at.by_point.column(i)).norm() < 1e-8);
            }
        }
    }

    #[test]
    fn one_attitude_or_views_square_to_the_plane_are_noticed() {
        let k = truth(Constraint::ZeroSkew);
        let same = points_for(&k, &[(2.2, 0.1); 4], 1e-3);
        assert!(matches!(solve_linear(&same, Constraint::ZeroSkew, 1.0), Err(Error::Undetermined { .. })));
        // Looking straight down, whatever the roll: nothing of focal length.
        let nadir = points_for(&k, &[(std::f64::consts::PI, 0.0), (std::f64::consts::PI, 0.8)], 1e-3);
        assert!(solve_linear(&nadir, Constraint::ZeroSkew, 1.0).is_err());
    }

    #[test]
    fn an_indefinite_conic_is_an_error_with_its_eigenvalues() {
        let omega = Matrix3::new(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, -0.3);
        assert_eq!(intrinsics_from_conic(&omega).map_err(|v| v[0] < 0.0), Err(true));
        let k = truth(Constraint::Full);
        let ki = k.inverse_matrix();
        let back = intrinsics_from_conic(&(ki.transpose() * ki * -7.0)).expect("definite");
        assert!((parameters_of(&back) - parameters_of(&k)).norm() < 1e-12);
    }
}
