//! The gold standard for a homography: errors in both images (H&Z 4.2.5, algorithm 4.3).
//!
//! ```text
//! minimise over H, x̂_i:   Σ_i ( |a_i - x̂_i|² + |b_i - H x̂_i|² ) / σ_i²
//! ```
//!
//! The points x̂ are eliminated: with F = ∂(H x̂)/∂x̂ and G = ∂(H x̂)/∂h the information of h is Σ Gᵀ (I + F Fᵀ)⁻¹ G / σ². It is
//! kept in the eight-dimensional tangent space of the unit sphere on which the nine entries live, in frame coordinates.

use nalgebra::{DMatrix, DVector, Matrix2, Matrix2x3, Matrix3, SMatrix, SVector, Vector2, Vector3};

use crate::{
    error::Error,
    geometry::{
        frame::Frame,
        homography::{Homography, HomographyCovariance},
    },
    numerics::{
        levenberg_marquardt::{LeastSquares, LmOptions, NormalEquations, StopReason, minimise_until},
        linalg::{inverse_spd, matrix_from_rows, rows_of, sphere_tangent, symmetric_eigen},
        statistics::{chi_squared_2_mean_below, chi_squared_2_quantile},
    },
    observer::{Observer, Silent},
    pairs::{correspondence::PointMatch, dlt::direct_linear_transformation},
};

/// A homography with its covariance.
#[derive(Debug, Clone)]
pub struct HomographyEstimate {
    /// Pixels of a to pixels of b.
    pub h_b_from_a: Homography,
    /// The same map in frame coordinates, unit Frobenius norm.
    pub in_frame: Matrix3<f64>,
    /// Covariance of the nine entries of `in_frame`, row by row; rank 8. The noise scale is `sigma_px`.
    pub covariance: HomographyCovariance,
    /// The frame of both.
    pub frame: Frame,
    /// Matches used.
    pub matches: usize,
    /// Standard deviation of one coordinate of a match of unit `sigma_px`, estimated from the residuals, in pixels.
    pub sigma_px: f64,
    /// Root mean square of the transfer residual |b - H x̂| together with |a - x̂|, per match, in pixels.
    pub rms_px: f64,
    /// Steps of the refinement.
    pub iterations: usize,
    /// Why it ended.
    pub stop: StopReason,
}

impl HomographyEstimate {
    /// A homography from elsewhere, its covariance (frame coordinates, unit norm, row by row) being known or taken from
    /// points spread over the image with `sigma_px` noise.
    pub fn from_parts(h_b_from_a: Homography, covariance: HomographyCovariance, frame: Frame, matches: usize) -> Self {
        let in_frame = h_b_from_a.in_frame(&frame);
        Self {
            h_b_from_a,
            in_frame,
            covariance,
            frame,
            matches,
            sigma_px: 1.0,
            rms_px: 0.0,
            iterations: 0,
            stop: StopReason::Converged,
        }
    }
}

/// One match against a homography, its true point eliminated.
struct Eliminated {
    /// |a - x̂|² + |b - H x̂|² at the best x̂.
    squared_error: f64,
    /// x̂, homogeneous.
    point: Vector3<f64>,
    /// ∂(H x̂) / ∂(H x̂ homogeneous): 2x3.
    projection: Matrix2x3<f64>,
    /// (I + F Fᵀ)⁻¹.
    weight: Matrix2<f64>,
    /// Innovation b - H x̂ - F (a - x̂).
    innovation: Vector2<f64>,
}

fn eliminate(h: &Matrix3<f64>, m: &PointMatch) -> Option<Eliminated> {
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
pub fn sampson_squared(h: &Matrix3<f64>, m: &PointMatch) -> f64 {
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

/// Normal equations of the nine entries: half cost, gradient, information (before restriction to the sphere).
pub(super) fn accumulate(
    h: &Matrix3<f64>,
    matches: &[PointMatch],
    weights: Option<&[f64]>,
) -> Option<(f64, SVector<f64, 9>, SMatrix<f64, 9, 9>)> {
    let (mut cost, mut gradient, mut information) = (0.0, SVector::<f64, 9>::zeros(), SMatrix::<f64, 9, 9>::zeros());
    for (index, m) in matches.iter().enumerate() {
        let w = weights.map_or(1.0, |w| w[index]) / (m.sigma_px * m.sigma_px);
        if w == 0.0 {
            continue;
        }
        let e = eliminate(h, m)?;
        cost += 0.5 * w * e.squared_error;
        let pull = e.projection.transpose() * (e.weight * e.innovation) * w;
        let inner = e.projection.transpose() * e.weight * e.projection * w;
        let outer = e.point * e.point.transpose();
        for r in 0..3 {
            for i in 0..3 {
                gradient[3 * r + i] -= pull[r] * e.point[i];
            }
            for c in r..3 {
                for i in 0..3 {
                    for j in 0..3 {
                        information[(3 * r + i, 3 * c + j)] += inner[(r, c)] * outer[(i, j)];
                    }
                }
            }
        }
    }
    for r in 0..9 {
        for c in 0..r {
            information[(r, c)] = information[(c, r)];
        }
    }
    Some((cost, gradient, information))
}

struct GoldStandard<'a> {
    matches: &'a [PointMatch],
    weights: Option<&'a [f64]>,
}

impl LeastSquares for GoldStandard<'_> {
    type State = Matrix3<f64>;
    type Linearised = NormalEquations;

    fn cost(&self, h: &Self::State) -> Option<f64> {
        let mut cost = 0.0;
        for (index, m) in self.matches.iter().enumerate() {
            let w = self.weights.map_or(1.0, |w| w[index]) / (m.sigma_px * m.sigma_px);
            cost += 0.5 * w * eliminate(h, m)?.squared_error;
        }
        Some(cost)
    }

    fn linearise(&self, h: &Self::State) -> Option<NormalEquations> {
        let (cost, gradient, information) = accumulate(h, self.matches, self.weights)?;
        let tangent = sphere_tangent(&rows_of(h));
        let reduced = tangent.transpose() * information * tangent;
        let slope = tangent.transpose() * gradient;
        Some(NormalEquations {
            cost,
            gradient: DVector::from_fn(8, |i, _| slope[i]),
            information: DMatrix::from_fn(8, 8, |r, c| reduced[(r, c)]),
        })
    }

    fn retract(&self, h: &Self::State, step: &DVector<f64>) -> Self::State {
        let tangent = sphere_tangent(&rows_of(h));
        let moved = rows_of(h) + tangent * SVector::<f64, 8>::from_fn(|i, _| step[i]);
        matrix_from_rows(&moved.normalize())
    }
}

/// Least noise that a covariance is made with, in pixels.
const SIGMA_FLOOR_PX: f64 = 0.01;

/// Ratio of the least to the largest standard deviation of the points over direction, the worse image of the two.
pub fn spread_ratio(matches: &[PointMatch]) -> f64 {
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

/// Options of [`refine`].
#[derive(Debug, Clone, Copy)]
pub struct RefineOptions {
    /// Squared residuals were cut at this quantile of their distribution before (1: not cut): the noise estimate allows
    /// for it.
    pub kept_fraction: f64,
    /// Stop rule.
    pub lm: LmOptions,
}

impl Default for RefineOptions {
    fn default() -> Self {
        Self {
            kept_fraction: 1.0,
            lm: LmOptions {
                max_iterations: 30,
                relative_cost_tolerance: 1e-10,
                step_tolerance: 1e-15,
                ..LmOptions::default()
            },
        }
    }
}

/// The matches in frame coordinates.
pub fn to_frame(matches: &[PointMatch], frame: &Frame) -> Vec<PointMatch> {
    matches.iter().map(|m| PointMatch { a: frame.from_pixel(&m.a), b: frame.from_pixel(&m.b), ..*m }).collect()
}

/// Maximum likelihood homography of four or more matches (pixels), all of them inliers, from a start in frame coordinates
/// (default: linear), with its covariance.
pub fn refine(
    matches: &[PointMatch],
    start: Option<&Matrix3<f64>>,
    frame: &Frame,
    options: &RefineOptions,
) -> Result<HomographyEstimate, Error> {
    refine_until(matches, start, frame, options, &Silent)
}

/// The same under an observer's eyes; [`Error::Stopped`] when it says so.
pub(crate) fn refine_until(
    matches: &[PointMatch],
    start: Option<&Matrix3<f64>>,
    frame: &Frame,
    options: &RefineOptions,
    observer: &dyn Observer,
) -> Result<HomographyEstimate, Error> {
    let local = to_frame(matches, frame);
    let degenerate = |ratio| Error::DegeneratePoints { count: matches.len(), spread_ratio: ratio };
    let spread = if local.len() < 4 { 0.0 } else { spread_ratio(&local) };
    if spread < 1e-4 {
        return Err(degenerate(spread));
    }
    let start = match start {
        Some(h) => *h / h.norm(),
        None => {
            let (h, ratio) = direct_linear_transformation(&local).ok_or_else(|| degenerate(0.0))?;
            if ratio > 0.5 {
                return Err(degenerate(1.0 - ratio));
            }
            h
        }
    };
    let problem = GoldStandard { matches: &local, weights: None };
    let out = minimise_until(&problem, start, &options.lm, observer).ok_or_else(|| degenerate(spread))?;
    if out.stop == StopReason::Stopped {
        return Err(Error::Stopped);
    }
    let (values, _) = symmetric_eigen(&out.linearised.information)
        .ok_or_else(|| Error::Numerical { stage: "homography", detail: "information matrix not finite".into() })?;
    if values[0] <= 1e-12 * values[7] {
        return Err(degenerate((values[0].max(0.0) / values[7]).sqrt()));
    }
    let inverse = inverse_spd(&out.linearised.information).ok_or_else(|| degenerate((values[0] / values[7]).sqrt()))?;

    let scale_sq = frame.scale_px * frame.scale_px;
    let squared_px = 2.0 * out.cost * scale_sq;
    let cut = if options.kept_fraction < 1.0 {
        chi_squared_2_mean_below(chi_squared_2_quantile(1.0 - options.kept_fraction)) / 2.0
    } else {
        1.0
    };
    let dof = 2.0 * local.len() as f64 - 8.0;
    // With a handful of matches the residuals say little of the noise: two observations of 1 px go in with them.
    let (prior_dof, prior_sq) = if dof < 20.0 { (2.0, 2.0) } else { (0.0, 0.0) };
    let sigma_sq_px = (squared_px / cut + prior_sq) / (dof + prior_dof);
    let tangent = sphere_tangent(&rows_of(&out.state));
    // No matcher is better than this; without a floor exact data would have infinite weight beside an axis error.
    let variance = sigma_sq_px.max(SIGMA_FLOOR_PX * SIGMA_FLOOR_PX) / scale_sq;
    let reduced = SMatrix::<f64, 8, 8>::from_fn(|r, c| inverse[(r, c)] * variance);
    let mean_weight = local.iter().map(|m| m.sigma_px.powi(-2)).sum::<f64>() / local.len() as f64;
    Ok(HomographyEstimate {
        h_b_from_a: Homography::from_frame(&out.state, frame).map_err(|_| degenerate(spread))?,
        in_frame: out.state,
        covariance: tangent * reduced * tangent.transpose(),
        frame: *frame,
        matches: local.len(),
        sigma_px: sigma_sq_px.sqrt(),
        rms_px: (squared_px / (local.len() as f64 * mean_weight)).sqrt(),
        iterations: out.iterations,
        stop: out.stop,
    })
}
