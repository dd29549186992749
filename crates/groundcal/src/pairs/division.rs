//! Homographies together with one parameter of radial distortion, the division model.
//!
//! ```text
//! u = x / (1 + λ |x|²)           x measured, u ideal; frame coordinates, the centre of distortion being their origin
//! ```
//!
//! Two ways (KZR 3.2):
//!
//! * [`division_closed_form`]: with ũ(λ) = (x, y, 1 + λ |x|²) the equations ũ_b × H ũ_a = 0 are quadratic in λ,
//!   (D₁ + λ D₂ + λ² D₃) h = 0. Multiplied by D₁ᵀ they are a quadratic eigenvalue problem of 9 x 9 matrices (Fitzgibbon, *Simultaneous
//!   linear estimation of multiple view geometry and lens distortion*, CVPR 2001). Exact without noise; with noise it minimises
//!   nothing and is badly biased: a start, not an answer.
//! * [`refine_division`]: maximum likelihood of λ together with one homography or several,
//!
//! ```text
//! minimise over H_m, λ, x̂_i:   Σ ( |a_i - x̂_i|² + |b_i - d(H_m u(x̂_i))|² ) / σ_i²,      d(u) = 2 u / (1 + √(1 - 4 λ |u|²)) = u⁻¹
//! ```
//!
//! the points x̂ eliminated as in [`crate::pairs::refine`]. To first order λ = k1 (s / f)² for a frame of scale s px: a small k1 of
//! Brown-Conrady bends as much.

use nalgebra::{DMatrix, DVector, Matrix2, Matrix2x3, Matrix3, SMatrix, SVector, Vector2, Vector3};

use crate::{
    error::Error,
    geometry::{frame::Frame, homography::Homography},
    numerics::{
        levenberg_marquardt::{LeastSquares, NormalEquations, minimise},
        linalg::{inverse_spd, matrix_from_rows, rows_of, sphere_tangent, symmetric_eigen},
    },
    pairs::{
        correspondence::PointMatch,
        dlt::direct_linear_transformation,
        refine::{HomographyEstimate, RefineOptions, SIGMA_FLOOR_PX, to_frame},
    },
};

/// The division model, frame coordinates.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct DivisionModel {
    /// λ in 1 / (frame units)²: negative for barrel distortion.
    pub lambda: f64,
}

/// A point, its derivative by where it came from and by λ.
struct MappedPoint {
    point: Vector2<f64>,
    by_point: Matrix2<f64>,
    by_lambda: Vector2<f64>,
}

/// Least 1 + λ |x|²: nearer to zero a point goes to infinity.
const MIN_DENOMINATOR: f64 = 0.02;

impl DivisionModel {
    /// Measured to ideal; `None` where the model sends the point to or beyond infinity.
    pub(crate) fn undistort(&self, x: &Vector2<f64>) -> Option<Vector2<f64>> {
        let w = 1.0 + self.lambda * x.norm_squared();
        (w > MIN_DENOMINATOR).then(|| x / w)
    }

    /// Ideal to measured; `None` where no measured point becomes this one.
    #[cfg(test)]
    pub(crate) fn distort(&self, u: &Vector2<f64>) -> Option<Vector2<f64>> {
        let square = 1.0 - 4.0 * self.lambda * u.norm_squared();
        (square > 0.0).then(|| u * (2.0 / (1.0 + square.sqrt())))
    }

    fn undistort_with_derivatives(&self, x: &Vector2<f64>) -> Option<MappedPoint> {
        let r2 = x.norm_squared();
        let w = 1.0 + self.lambda * r2;
        (w > MIN_DENOMINATOR).then(|| MappedPoint {
            point: x / w,
            by_point: Matrix2::identity() / w - x * x.transpose() * (2.0 * self.lambda / (w * w)),
            by_lambda: x * (-r2 / (w * w)),
        })
    }

    fn distort_with_derivatives(&self, u: &Vector2<f64>) -> Option<MappedPoint> {
        let r2 = u.norm_squared();
        let square = 1.0 - 4.0 * self.lambda * r2;
        (square > 0.0).then(|| {
            let s = square.sqrt();
            let slope = 4.0 / (s * (1.0 + s).powi(2));
            MappedPoint {
                point: u * (2.0 / (1.0 + s)),
                by_point: Matrix2::identity() * (2.0 / (1.0 + s)) + u * u.transpose() * (2.0 * self.lambda * slope),
                by_lambda: u * (r2 * slope),
            }
        })
    }
}

/// A homography between ideal points and the distortion that makes them, frame coordinates.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct DivisionHomography {
    /// Ideal points of a to those of b, unit Frobenius norm.
    pub in_frame: Matrix3<f64>,
    /// The lens.
    pub model: DivisionModel,
}

/// Real eigenvalues are those with less imaginary part than this, relative to their size.
const MAX_IMAGINARY_PART: f64 = 1e-6;
/// Smallest over largest singular value of the equations of exact matches: rounding.
const MAX_EXACT_SINGULAR_RATIO: f64 = 1e-13;
/// Most that 1 + λ |x|² is in an image: a pincushion lens that halves distances at the corner. At λ = ∞ any points agree.
const MAX_DENOMINATOR: f64 = 2.0;
/// About which λ the eigenvalue problem is expanded: one that no lens has, since its matrix must be invertible.
const EXPANSION_LAMBDA: f64 = 0.617;

/// λ and H in closed form from five or more matches (pixels); `None` when no real λ leaves every point in front.
pub(crate) fn division_closed_form(matches: &[PointMatch], frame: &Frame) -> Option<DivisionHomography> {
    if matches.len() < 5 {
        return None;
    }
    let local = to_frame(matches, frame);
    let rows = 2 * local.len();
    let mut parts = [DMatrix::<f64>::zeros(rows, 9), DMatrix::zeros(rows, 9), DMatrix::zeros(rows, 9)];
    for (i, m) in local.iter().enumerate() {
        let (ra, rb) = (m.a.norm_squared(), m.b.norm_squared());
        let w = 1.0 / m.sigma_px;
        // (1 + λ rb) (H₁ ũ_a) - x_b (H₃ ũ_a) and the same with H₂ and y_b; ũ_a = (x, y, 1) + λ (0, 0, ra).
        let constant = Vector3::new(m.a.x, m.a.y, 1.0);
        let linear = Vector3::new(0.0, 0.0, ra);
        for (k, coordinate) in [m.b.x, m.b.y].into_iter().enumerate() {
            let row = 2 * i + k;
            for c in 0..3 {
                parts[0][(row, 3 * k + c)] = w * constant[c];
                parts[0][(row, 6 + c)] = -w * coordinate * constant[c];
                parts[1][(row, 3 * k + c)] = w * (linear[c] + rb * constant[c]);
                parts[1][(row, 6 + c)] = -w * coordinate * linear[c];
                parts[2][(row, 3 * k + c)] = w * rb * linear[c];
            }
        }
    }
    let at = |lambda: f64| &parts[0] + &parts[1] * lambda + &parts[2] * (lambda * lambda);
    // The homography and algebraic residual that belong to a λ.
    let with = |lambda: f64| -> Option<(f64, DivisionHomography)> {
        let (d, model) = (at(lambda), DivisionModel { lambda });
        let (values, vectors) = symmetric_eigen(&(d.transpose() * &d))?;
        let h = matrix_from_rows(&SVector::<f64, 9>::from_fn(|i, _| vectors[(i, 0)]));
        Some((values[0].max(0.0) / values.sum(), DivisionHomography { in_frame: facing(&h, &local, &model), model }))
    };
    // A null vector of D₁ is one of D₁ᵀ D(λ) from the left whatever λ is: no lens has to be told beforehand.
    if !parts[0].iter().all(|v| v.is_finite()) {
        return None;
    }
    let singular = nalgebra::linalg::SVD::try_new(parts[0].clone(), false, false, f64::EPSILON, 1000)?.singular_values;
    if singular.min() < MAX_EXACT_SINGULAR_RATIO * singular.max() {
        return Some(with(0.0)?.1);
    }
    let left = parts[0].transpose();
    // D₁ᵀ D(λ) about λ₀: with μ = 1 / (λ - λ₀) the problem is μ² Q₀ + μ Q₁ + Q₂ = 0, Q₀ invertible.
    let q0 = &left * at(EXPANSION_LAMBDA);
    let q1 = &left * (&parts[1] + &parts[2] * (2.0 * EXPANSION_LAMBDA));
    let q2 = &left * &parts[2];
    let lu = q0.lu();
    let (upper, lower) = (lu.solve(&q1)?, lu.solve(&q2)?);
    let mut companion = DMatrix::<f64>::zeros(18, 18);
    companion.view_mut((0, 9), (9, 9)).fill_with_identity();
    companion.view_mut((9, 0), (9, 9)).copy_from(&-lower);
    companion.view_mut((9, 9), (9, 9)).copy_from(&-upper);
    if !companion.iter().all(|v| v.is_finite()) {
        return None;
    }
    let eigenvalues = nalgebra::linalg::Schur::try_new(companion, f64::EPSILON, 2000)?.complex_eigenvalues();
    let farthest = local.iter().map(|m| m.a.norm_squared().max(m.b.norm_squared())).fold(0.0, f64::max);
    let in_range = |lambda: f64| (MIN_DENOMINATOR..MAX_DENOMINATOR).contains(&(1.0 + lambda * farthest));
    let mut best: Option<(f64, DivisionHomography)> = None;
    for mu in eigenvalues.iter() {
        if mu.re.abs() < 1e-9 || mu.im.abs() > MAX_IMAGINARY_PART * mu.re.abs() {
            continue;
        }
        let lambda = EXPANSION_LAMBDA + 1.0 / mu.re;
        if !in_range(lambda) {
            continue;
        }
        let candidate = with(lambda)?;
        if best.as_ref().is_none_or(|b| candidate.0 < b.0) {
            best = Some(candidate);
        }
    }
    best.map(|(_, found)| found)
}

/// The sign that puts the points in front.
fn facing(h: &Matrix3<f64>, matches: &[PointMatch], model: &DivisionModel) -> Matrix3<f64> {
    let ahead = matches.iter().filter_map(|m| model.undistort(&m.a)).filter(|u| (h * u.push(1.0)).z > 0.0).count();
    if 2 * ahead >= matches.len() { *h } else { -h }
}

/// A match whose true point is eliminated.
struct Eliminated {
    squared_error: f64,
    innovation: Vector2<f64>,
    weight: Matrix2<f64>,
    by_entries: SMatrix<f64, 2, 9>,
    by_lambda: Vector2<f64>,
}

fn eliminate(h: &Matrix3<f64>, model: &DivisionModel, m: &PointMatch) -> Option<Eliminated> {
    let mut point = m.a;
    // Gauss-Newton on the point, as for a homography alone.
    for step in 0.. {
        let ideal = model.undistort_with_derivatives(&point)?;
        let homogeneous = ideal.point.push(1.0);
        let q = h * homogeneous;
        if q.z <= 1e-9 {
            return None;
        }
        let w = 1.0 / q.z;
        let image = Vector2::new(q.x * w, q.y * w);
        let seen = model.distort_with_derivatives(&image)?;
        let projection = seen.by_point * Matrix2x3::new(w, 0.0, -image.x * w, 0.0, w, -image.y * w);
        let by_ideal = projection * h.fixed_view::<3, 2>(0, 0);
        let f = by_ideal * ideal.by_point;
        let (da, db) = (m.a - point, m.b - seen.point);
        if step == 3 {
            return Some(Eliminated {
                squared_error: da.norm_squared() + db.norm_squared(),
                innovation: db - f * da,
                weight: (Matrix2::identity() + f * f.transpose()).try_inverse()?,
                by_entries: SMatrix::<f64, 2, 9>::from_fn(|r, c| projection[(r, c / 3)] * homogeneous[c % 3]),
                by_lambda: by_ideal * ideal.by_lambda + seen.by_lambda,
            });
        }
        point += (Matrix2::identity() + f.transpose() * f).try_inverse()? * (da + f.transpose() * db);
    }
    None
}

/// Homographies of motions and the λ of all of them.
#[derive(Clone)]
struct State {
    homographies: Vec<Matrix3<f64>>,
    model: DivisionModel,
}

/// The unknowns: eight of each homography, then λ.
struct SharedLambdaProblem {
    motions: Vec<Vec<PointMatch>>,
}

impl LeastSquares for SharedLambdaProblem {
    type State = State;
    type Linearised = NormalEquations;

    fn cost(&self, state: &State) -> Option<f64> {
        let mut cost = 0.0;
        for (h, matches) in state.homographies.iter().zip(&self.motions) {
            for m in matches {
                cost += 0.5 * eliminate(h, &state.model, m)?.squared_error / (m.sigma_px * m.sigma_px);
            }
        }
        cost.is_finite().then_some(cost)
    }

    fn linearise(&self, state: &State) -> Option<NormalEquations> {
        let n = 8 * self.motions.len() + 1;
        let (mut cost, mut gradient, mut information) = (0.0, DVector::zeros(n), DMatrix::zeros(n, n));
        for (i, (h, matches)) in state.homographies.iter().zip(&self.motions).enumerate() {
            let tangent = sphere_tangent(&rows_of(h));
            let mut slope = SVector::<f64, 9>::zeros();
            let mut block = SMatrix::<f64, 9, 9>::zeros();
            for m in matches {
                let e = eliminate(h, &state.model, m)?;
                let weight = e.weight / (m.sigma_px * m.sigma_px);
                let mut j = SMatrix::<f64, 2, 9>::zeros();
                j.fixed_view_mut::<2, 8>(0, 0).copy_from(&(e.by_entries * tangent));
                j.set_column(8, &e.by_lambda);
                cost += 0.5 * e.squared_error / (m.sigma_px * m.sigma_px);
                slope -= j.transpose() * (weight * e.innovation);
                block += j.transpose() * weight * j;
            }
            let at = |k: usize| if k == 8 { n - 1 } else { 8 * i + k };
            for r in 0..9 {
                gradient[at(r)] += slope[r];
                for c in 0..9 {
                    information[(at(r), at(c))] += block[(r, c)];
                }
            }
        }
        cost.is_finite().then_some(NormalEquations { cost, gradient, information })
    }

    fn retract(&self, state: &State, step: &DVector<f64>) -> State {
        let moved = |(i, h): (usize, &Matrix3<f64>)| {
            let rows = rows_of(h);
            let along = sphere_tangent(&rows) * SVector::<f64, 8>::from_fn(|k, _| step[8 * i + k]);
            matrix_from_rows(&(rows + along).normalize())
        };
        State {
            homographies: state.homographies.iter().enumerate().map(moved).collect(),
            model: DivisionModel { lambda: state.model.lambda + step[step.len() - 1] },
        }
    }
}

/// Homographies and the one λ of their lens.
#[derive(Debug, Clone)]
pub(crate) struct DivisionEstimate {
    /// The lens.
    pub model: DivisionModel,
    /// Standard deviation of λ, 1 / (frame units)².
    #[cfg(test)]
    pub lambda_sigma: f64,
    /// One a motion, between ideal points, λ being free in their covariances.
    pub homographies: Vec<HomographyEstimate>,
}

/// Maximum likelihood of the homographies of one or more motions (matches in pixels, all of them inliers, five or more each) and of
/// the λ they share, from a start of λ (default: none).
///
/// # Errors
/// [`Error::DegeneratePoints`] where the matches do not tell a homography and λ.
pub(crate) fn refine_division(
    motions: &[&[PointMatch]],
    frame: &Frame,
    start: Option<DivisionModel>,
    options: &RefineOptions,
) -> Result<DivisionEstimate, Error> {
    let count = motions.iter().map(|m| m.len()).sum();
    let degenerate = || Error::DegeneratePoints { count, spread_ratio: 0.0 };
    if motions.is_empty() || motions.iter().any(|m| m.len() < 5) {
        return Err(degenerate());
    }
    let model = start.unwrap_or_default();
    let local: Vec<Vec<PointMatch>> = motions.iter().map(|m| to_frame(m, frame)).collect();
    let first = |matches: &Vec<PointMatch>| {
        let ideal: Option<Vec<PointMatch>> = matches
            .iter()
            .map(|m| Some(PointMatch { a: model.undistort(&m.a)?, b: model.undistort(&m.b)?, ..*m }))
            .collect();
        Some(direct_linear_transformation(&ideal?)?.0)
    };
    let homographies: Vec<Matrix3<f64>> = local.iter().map(first).collect::<Option<_>>().ok_or_else(degenerate)?;
    let problem = SharedLambdaProblem { motions: local };
    let out = minimise(&problem, State { homographies, model }, &options.lm).ok_or_else(degenerate)?;
    let inverse = inverse_spd(&out.linearised.information).ok_or_else(degenerate)?;
    let n = inverse.nrows();
    let scale_sq = frame.scale_px * frame.scale_px;
    let degrees_of_freedom = 2.0 * count as f64 - n as f64;
    let sigma_sq_px = 2.0 * out.cost * scale_sq / degrees_of_freedom.max(1.0);
    let variance = sigma_sq_px.max(SIGMA_FLOOR_PX * SIGMA_FLOOR_PX) / scale_sq;
    let homographies = out
        .state
        .homographies
        .iter()
        .enumerate()
        .map(|(i, h)| {
            let tangent = sphere_tangent(&rows_of(h));
            let block = SMatrix::<f64, 8, 8>::from_fn(|r, c| inverse[(8 * i + r, 8 * i + c)] * variance);
            let map = Homography::from_frame(h, frame).map_err(|_| degenerate())?;
            let covariance = tangent * block * tangent.transpose();
            let mut estimate = HomographyEstimate::from_parts(map, covariance, *frame, motions[i].len());
            estimate.sigma_px = sigma_sq_px.sqrt();
            estimate.rms_px = (2.0 * out.cost * scale_sq / count as f64).sqrt();
            (estimate.iterations, estimate.stop) = (out.iterations, out.stop);
            Ok(estimate)
        })
        .collect::<Result<_, Error>>()?;
    Ok(DivisionEstimate {
        model: out.state.model,
        #[cfg(test)]
        lambda_sigma: (inverse[(n - 1, n - 1)] * variance).sqrt(),
        homographies,
    })
}

/// λ of one motion's matches in closed form, of points in the frame (Fitzgibbon 2001); `None`: no real solution.
pub fn division_of_motion(matches: &[PointMatch], frame: &Frame) -> Option<f64> {
    division_closed_form(matches, frame).map(|found| found.model.lambda)
}

/// λ that some motions share, of points in the frame, minimised together with their homographies, which are those of ideal points.
///
/// # Errors
/// That of a motion without a homography.
pub fn division_of_motions(motions: &[&[PointMatch]], frame: &Frame) -> Result<(f64, Vec<HomographyEstimate>), Error> {
    let found = refine_division(motions, frame, None, &RefineOptions::default())?;
    Ok((found.model.lambda, found.homographies))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::synthetic::points::PointScene;
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};
    use rand_pcg::Pcg64Mcg;

    fn distorted(lambda: f64, matches: usize, sigma_px: f64, seed: u64) -> (Frame, Vec<Vec<PointMatch>>, PointScene) {
        let scene = PointScene { matches, sigma_px: 0.0, ..PointScene::nominal(seed) };
        let frame = Frame::new(scene.size, None);
        let model = DivisionModel { lambda };
        let mut rng = Pcg64Mcg::seed_from_u64(seed);
        let mut seen = |p: &Vector2<f64>| {
            let mut noise = || -> f64 { StandardNormal.sample(&mut rng) };
            let noise = Vector2::new(noise(), noise()) * sigma_px;
            frame.pixel(&model.distort(&frame.local(p)).expect("within the model")) + noise
        };
        let motions = scene.pairs();
        let motions = motions
            .iter()
            .map(|p| p.matches.iter().map(|m| PointMatch { a: seen(&m.a), b: seen(&m.b), ..*m }).collect())
            .collect();
        (frame, motions, scene)
    }

    #[test]
    fn undistort_is_the_inverse_of_distort_and_derivatives_are_differences() {
        for lambda in [-0.3, -0.05, 0.0, 0.05, 0.15] {
            let model = DivisionModel { lambda };
            let x = Vector2::new(0.7, -0.6);
            let u = model.undistort(&x).expect("inside");
            assert!((model.distort(&u).expect("inside") - x).norm() < 1e-14);
            let step = 1e-6;
            for (mapped, map) in [
                (
                    model.undistort_with_derivatives(&x),
                    &(|m: &DivisionModel, p: &Vector2<f64>| m.undistort(p)) as &dyn Fn(&_, &_) -> _,
                ),
                (model.distort_with_derivatives(&x), &|m: &DivisionModel, p: &Vector2<f64>| m.distort(p)),
            ] {
                let mapped = mapped.expect("inside");
                for i in 0..2 {
                    let d = Vector2::from_fn(|r, _| if r == i { step } else { 0.0 });
                    let difference = (map(&model, &(x + d)).expect("inside") - map(&model, &(x - d)).expect("inside"))
                        / (2.0 * step);
                    assert!((difference - mapped.by_point.column(i)).norm() < 1e-8, "{lambda}");
                }
                let at = |l: f64| map(&DivisionModel { lambda: l }, &x).expect("inside");
                let difference = (at(lambda + step) - at(lambda - step)) / (2.0 * step);
                assert!((difference - mapped.by_lambda).norm() < 1e-8, "{lambda}");
            }
        }
        assert!(DivisionModel { lambda: -1.0 }.undistort(&Vector2::new(1.0, 0.5)).is_none());
        assert!(DivisionModel { lambda: 1.0 }.distort(&Vector2::new(1.0, 0.5)).is_none());
    }

    #[test]
    fn exact_matches_come_back_both_ways() {
        for lambda in [-0.25, -0.1, -1e-3, 0.0, 0.05] {
            for count in [5, 20, 200] {
                let (frame, motions, scene) = distorted(lambda, count, 0.0, 3);
                for (i, matches) in motions.iter().enumerate() {
                    let truth = scene.homography(i).expect("a motion").in_frame(&frame);
                    let closed = division_closed_form(matches, &frame);
                    let closed = closed.unwrap_or_else(|| panic!("no real solution: {count} matches, {lambda}"));
                    let error = (closed.model.lambda - lambda).abs();
                    assert!(error < 1e-8, "closed form, {count} matches, {lambda}: {error:e}");
                    let error = (closed.in_frame - truth).norm();
                    assert!(error < 1e-8, "closed form, {count} matches, {lambda}: {error:e}");
                    let refined =
                        refine_division(&[matches], &frame, None, &RefineOptions::default()).expect("a camera");
                    let error = (refined.model.lambda - lambda).abs();
                    assert!(error < 1e-8, "refined, {count} matches, {lambda}: {error:e}");
                    let error = (refined.homographies[0].in_frame - truth).norm();
                    assert!(error < 1e-8, "refined, {count} matches, {lambda}: {error:e}");
                }
                let slices: Vec<&[PointMatch]> = motions.iter().map(Vec::as_slice).collect();
                let shared = refine_division(&slices, &frame, None, &RefineOptions::default()).expect("a camera");
                assert!((shared.model.lambda - lambda).abs() < 1e-9);
            }
        }
    }

    #[test]
    fn the_stated_deviation_is_the_scatter() {
        let trials = 200;
        let squares: f64 = (0..trials)
            .map(|seed| {
                let (frame, motions, _) = distorted(-0.1, 100, 0.5, seed);
                let out = refine_division(&[&motions[0]], &frame, None, &RefineOptions::default()).expect("a camera");
                ((out.model.lambda + 0.1) / out.lambda_sigma).powi(2)
            })
            .sum();
        let rms = (squares / trials as f64).sqrt();
        // 200 trials tell it to 5 %.
        assert!((0.85..1.15).contains(&rms), "{rms}");
    }

    #[test]
    fn too_few_or_collinear_matches_are_refused() {
        let (frame, motions, _) = distorted(-0.1, 5, 0.0, 1);
        assert!(division_closed_form(&motions[0][..4], &frame).is_none());
        assert!(refine_division(&[&motions[0][..4]], &frame, None, &RefineOptions::default()).is_err());
        assert!(refine_division(&[], &frame, None, &RefineOptions::default()).is_err());
        let line: Vec<PointMatch> = (0..20)
            .map(|i| {
                let p = Vector2::new(100.0 + 50.0 * f64::from(i), 300.0);
                PointMatch { a: p, b: p + Vector2::new(10.0, 0.0), sigma_px: 1.0 }
            })
            .collect();
        assert!(refine_division(&[&line], &frame, None, &RefineOptions::default()).is_err());
    }
}
