//! The gold standard for a homography: errors in both images (H&Z 4.2.5, algorithm 4.3).
//!
//! ```text
//! minimise over H, x̂_i:   Σ_i ( |a_i - x̂_i|² + |b_i - H x̂_i|² ) / σ_i²
//! ```
//!
//! The points x̂ are eliminated: with F = ∂(H x̂)/∂x̂ and G = ∂(H x̂)/∂h the information of h is Σ Gᵀ (I + F Fᵀ)⁻¹ G / σ². It is
//! kept in the eight-dimensional tangent space of the unit sphere on which the nine entries live, in frame coordinates.

use nalgebra::{DMatrix, DVector, Matrix3, SMatrix, SVector};

use crate::{
    error::Error,
    geometry::{
        frame::Frame,
        homography::{Homography, HomographyCovariance, covariance_in_frame},
    },
    numerics::{
        levenberg_marquardt::{LeastSquares, LmOptions, NormalEquations, StopReason, minimise_until},
        linalg::{inverse_spd, matrix_from_rows, rows_of, sphere_tangent, symmetric_eigen},
        statistics::{chi_squared_2_mean_below, chi_squared_2_quantile},
    },
    observer::{Observer, Silent},
    pairs::{correspondence::PointMatch, residual::PlaneMatch},
};

/// A homography with its covariance.
///
/// # Examples
/// ```
/// use groundcal::{HomographyEstimate, ImageSize, geometry::Frame, nalgebra::Matrix3};
/// let frame = Frame::new(ImageSize::new(640, 480), None);
/// let estimate = HomographyEstimate::from_pixels(&Matrix3::identity(), None, frame, 100)?;
/// assert_eq!(estimate.covariance[(0, 0)], 1e-8);
/// # Ok::<(), groundcal::Error>(())
/// ```
#[derive(Debug, Clone)]
pub struct HomographyEstimate {
    /// Pixels of a to pixels of b.
    pub h_b_from_a: Homography,
    /// The same map in frame coordinates, unit Frobenius norm.
    pub in_frame: Matrix3<f64>,
    /// Covariance of the nine entries of `in_frame`, row by row; rank 8. The noise scale is `sigma_px`.
    pub covariance: SMatrix<f64, 9, 9>,
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
    pub(crate) stop: StopReason,
}

/// Variance of each entry of the unit-norm matrix in frame coordinates where no covariance is given: all homographies count the same.
const VARIANCE_WITHOUT_COVARIANCE: f64 = 1e-8;

impl HomographyEstimate {
    /// A homography from elsewhere: any multiple of the matrix that takes pixels of a to pixels of b, and the covariance of the nine entries,
    /// row by row, of the matrix as it is given; `None`: not known, all count the same. `matches`: from so many, if that is known.
    ///
    /// # Errors
    /// [`Error::InvalidInput`] where the matrix or the covariance is not finite, or the matrix is not invertible.
    pub fn from_pixels(
        h_b_from_a: &Matrix3<f64>,
        covariance: Option<&SMatrix<f64, 9, 9>>,
        frame: Frame,
        matches: usize,
    ) -> Result<Self, Error> {
        let h = Homography::new(*h_b_from_a)?;
        let covariance = match covariance {
            None => HomographyCovariance::from_diagonal_element(VARIANCE_WITHOUT_COVARIANCE),
            Some(given) => covariance_in_frame(h_b_from_a, given, &frame)?,
        };
        Ok(Self::from_parts(h, covariance, frame, matches))
    }

    /// The same from a covariance in frame coordinates, of the matrix of unit norm.
    pub(crate) fn from_parts(
        h_b_from_a: Homography,
        covariance: HomographyCovariance,
        frame: Frame,
        matches: usize,
    ) -> Self {
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

/// Normal equations of the nine entries: half cost, gradient, information (before restriction to the sphere).
pub(super) fn accumulate<M: PlaneMatch>(
    h: &Matrix3<f64>,
    matches: &[M],
    weights: Option<&[f64]>,
) -> Option<(f64, SVector<f64, 9>, SMatrix<f64, 9, 9>)> {
    let (mut cost, mut gradient, mut information) = (0.0, SVector::<f64, 9>::zeros(), SMatrix::<f64, 9, 9>::zeros());
    for (index, m) in matches.iter().enumerate() {
        let w = weights.map_or(1.0, |w| w[index]) / (m.sigma_px() * m.sigma_px());
        if w == 0.0 {
            continue;
        }
        let e = m.eliminated(h)?;
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

struct GoldStandard<'a, M> {
    matches: &'a [M],
}

impl<M: PlaneMatch> LeastSquares for GoldStandard<'_, M> {
    type State = Matrix3<f64>;
    type Linearised = NormalEquations;

    fn cost(&self, h: &Self::State) -> Option<f64> {
        let mut cost = 0.0;
        for m in self.matches {
            cost += 0.5 / (m.sigma_px() * m.sigma_px()) * m.eliminated(h)?.squared_error;
        }
        Some(cost)
    }

    fn linearise(&self, h: &Self::State) -> Option<NormalEquations> {
        let (cost, gradient, information) = accumulate(h, self.matches, None)?;
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
pub(crate) const SIGMA_FLOOR_PX: f64 = 0.01;

/// Options of [`refine`].
#[derive(Debug, Clone, Copy)]
pub(crate) struct RefineOptions {
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
pub(crate) fn to_frame(matches: &[PointMatch], frame: &Frame) -> Vec<PointMatch> {
    matches.iter().map(|m| PointMatch { a: frame.local(&m.a), b: frame.local(&m.b), ..*m }).collect()
}

/// Maximum likelihood homography of four or more matches (pixels), all of them inliers, from a start in frame coordinates
/// (default: linear), with its covariance.
pub(crate) fn refine(
    matches: &[PointMatch],
    start: Option<&Matrix3<f64>>,
    frame: &Frame,
    options: &RefineOptions,
) -> Result<HomographyEstimate, Error> {
    refine_until(matches, start, frame, options, &Silent)
}

/// Maximum likelihood homography of four or more matches (pixels), all of them inliers, with its covariance (gold standard).
///
/// # Errors
/// [`Error::DegeneratePoints`] for points that determine none.
pub fn gold_standard_homography(matches: &[PointMatch], frame: &Frame) -> Result<HomographyEstimate, Error> {
    refine(matches, None, frame, &RefineOptions::default())
}

/// The same under an observer's eyes; [`Error::Stopped`] when it says so.
pub(crate) fn refine_until(
    matches: &[PointMatch],
    start: Option<&Matrix3<f64>>,
    frame: &Frame,
    options: &RefineOptions,
    observer: &dyn Observer,
) -> Result<HomographyEstimate, Error> {
    refine_in_frame(&to_frame(matches, frame), start, frame, options, observer)
}

/// The same of matches in the frame.
pub(crate) fn refine_in_frame<M: PlaneMatch>(
    local: &[M],
    start: Option<&Matrix3<f64>>,
    frame: &Frame,
    options: &RefineOptions,
    observer: &dyn Observer,
) -> Result<HomographyEstimate, Error> {
    let degenerate = |ratio| Error::DegeneratePoints { count: local.len(), spread_ratio: ratio };
    let spread = if local.len() < 4 { 0.0 } else { M::spread(local) };
    if spread < 1e-4 {
        return Err(degenerate(spread));
    }
    let start = match start {
        Some(h) => *h / h.norm(),
        None => {
            let (h, ratio) = M::linear(local).ok_or_else(|| degenerate(0.0))?;
            if ratio > 0.5 {
                return Err(degenerate(1.0 - ratio));
            }
            h
        }
    };
    let problem = GoldStandard { matches: local };
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
    let mean_weight = local.iter().map(|m| m.sigma_px().powi(-2)).sum::<f64>() / local.len() as f64;
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
