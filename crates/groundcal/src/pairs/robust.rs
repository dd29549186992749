//! A homography from matches with outliers: robust search, then the gold standard on the inliers.
//!
//! ```text
//! d² = Sampson's squared distance of a match / (σ_max σ_i)²          inlier: d² < min(q s², 9.21)
//! s² = median d² / (2 ln 2) at first, then (σ̂ / σ_max)²,   at least (0.001 px / σ_max)²
//! ```
//!
//! q: 99.73 % of chi-squared with two degrees of freedom (11.8); σ_max: the largest deviation thought possible; σ_i: the relative deviation stated of a
//! match; σ̂: that of the fit. The search is that of `numerics::ransac`; cutting and fitting go round until the inliers stay the same.

use nalgebra::{Matrix3, SVector};

use crate::pairs::{
    refine::{HomographyEstimate, RefineOptions, accumulate, refine_in_frame, to_frame},
    residual::PlaneMatch,
};
use crate::{
    error::Error,
    geometry::frame::Frame,
    numerics::{
        linalg::{matrix_from_rows, rows_of, sphere_tangent},
        ransac::{OUTLIER_SQUARED, RansacOptions, RobustProblem, search_until},
        statistics::{chi_squared_2_quantile, median},
    },
    observer::{Observer, Silent},
    pairs::correspondence::PointMatch,
};

/// Options of [`robust_homography`].
#[derive(Debug, Clone, Copy)]
pub struct RobustOptions {
    /// Largest standard deviation of a coordinate of a good match that is thought possible, in pixels.
    pub max_sigma_px: f64,
    /// Matches within this many pixels of where they were are taken as a background that does not move, when they are
    /// the best supported plane.
    pub static_px: f64,
    /// Fewest inliers of a second plane that may replace a static background.
    pub min_inliers: usize,
    /// The robust loop.
    pub(crate) ransac: RansacOptions,
}

impl Default for RobustOptions {
    fn default() -> Self {
        Self { max_sigma_px: 2.0, static_px: 1.5, min_inliers: 15, ransac: RansacOptions::default() }
    }
}

/// A homography and the matches it was made from.
#[derive(Debug, Clone)]
pub(crate) struct RobustHomography {
    /// The refined homography.
    pub estimate: HomographyEstimate,
    /// Indices of the matches used, ascending.
    pub inliers: Vec<usize>,
    /// Matches of a background that did not move and had more support; they were set aside. 0: none.
    pub static_background: usize,
    /// The matches are patches matched by least squares, not features.
    pub patches: bool,
    /// The homography is the identity: nothing moved between the two images, and no second plane was found.
    pub is_static: bool,
}

struct Problem<'a, M> {
    matches: &'a [M],
    /// 1 / largest noise variance, in frame units.
    scale: f64,
}

impl<M: PlaneMatch> RobustProblem for Problem<'_, M> {
    type Model = Matrix3<f64>;
    const SAMPLE_SIZE: usize = 4;

    fn len(&self) -> usize {
        self.matches.len()
    }

    fn minimal(&self, sample: &[usize]) -> Option<Self::Model> {
        let m = [0, 1, 2, 3].map(|i| &self.matches[sample[i]]);
        let h = M::through_four(m)?;
        let in_front = |h: &Matrix3<f64>| m.iter().all(|p| p.is_in_front(h));
        if in_front(&h) {
            Some(h)
        } else if in_front(&-h) {
            Some(-h)
        } else {
            None
        }
    }

    fn squared_residual(&self, model: &Self::Model, index: usize) -> f64 {
        let m = &self.matches[index];
        m.sampson_squared(model) * self.scale / (m.sigma_px() * m.sigma_px())
    }

    fn refit(&self, model: &Self::Model, weights: &[f64]) -> Option<Self::Model> {
        let (_, gradient, information) = accumulate(model, self.matches, Some(weights))?;
        let tangent = sphere_tangent(&rows_of(model));
        let reduced = tangent.transpose() * information * tangent;
        let step: SVector<f64, 8> = reduced.cholesky()?.solve(&-(tangent.transpose() * gradient));
        let moved = (rows_of(model) + tangent * step).normalize();
        moved.iter().all(|v| v.is_finite()).then(|| matrix_from_rows(&moved))
    }
}

/// Fraction of good matches kept by the final cut. At 99 % the hard cut would cost 3 % of accuracy, here it costs 1 %.
const INLIER_QUANTILE: f64 = 0.9973;

/// A homography from point matches (pixels), some of which may be wrong. Deterministic by the seed.
///
/// # Errors
/// [`Error::DegeneratePoints`] when there are fewer than four matches, or no quadruple of them or the inliers determine a
/// homography.
pub fn robust_homography(
    matches: &[PointMatch],
    frame: &Frame,
    options: &RobustOptions,
    seed: u64,
) -> Result<HomographyEstimate, Error> {
    let options = RobustOptions { ransac: RansacOptions { seed, ..options.ransac }, ..*options };
    Ok(estimate_in_frame(&to_frame(matches, frame), frame, &options, &Silent)?.estimate)
}

/// The same of matches in the frame, with what became of them, under an observer's eyes; [`Error::Stopped`] when it says so.
pub(crate) fn estimate_in_frame<M: PlaneMatch>(
    matches: &[M],
    frame: &Frame,
    options: &RobustOptions,
    observer: &dyn Observer,
) -> Result<RobustHomography, Error> {
    let all: Vec<usize> = (0..matches.len()).collect();
    let first = estimate_among(matches, &all, frame, options, observer)?;
    let displacement = |m: &M| m.displacement_px(frame);
    let mut moved: Vec<f64> = first.inliers.iter().map(|&i| displacement(&matches[i])).collect();
    if median(&mut moved) > options.static_px {
        return Ok(first);
    }
    // The best supported plane stands still. Something else may move before it: look among what is left.
    let rest: Vec<usize> =
        (0..matches.len()).filter(|&i| displacement(&matches[i]) > 3.0 * options.static_px).collect();
    let second = estimate_among(matches, &rest, frame, options, observer);
    observer.go_on()?;
    let second = second.ok().filter(|s| s.inliers.len() >= options.min_inliers);
    Ok(match second {
        Some(second) => RobustHomography { static_background: first.inliers.len(), ..second },
        None => RobustHomography { is_static: true, ..first },
    })
}

fn estimate_among<M: PlaneMatch>(
    matches: &[M],
    among: &[usize],
    frame: &Frame,
    options: &RobustOptions,
    observer: &dyn Observer,
) -> Result<RobustHomography, Error> {
    let local: Vec<M> = among.iter().map(|&i| matches[i].clone()).collect();
    let degenerate = || Error::DegeneratePoints {
        count: local.len(),
        spread_ratio: if local.is_empty() { 0.0 } else { M::spread(&local) },
    };
    let largest_sigma_px = options.max_sigma_px;
    let max_sigma = largest_sigma_px / frame.scale_px;
    let problem = Problem { matches: &local, scale: 1.0 / (max_sigma * max_sigma) };
    let found = search_until(&problem, &options.ransac, observer);
    observer.go_on()?;
    let found = found.ok_or_else(degenerate)?;

    // The scale of the noise from the inliers (median of chi-squared, two degrees of freedom: 2 ln 2), then cut and refine, until the set of inliers no longer changes.
    let mut h = found.model;
    let mut inliers = found.inliers;
    let squared = |h: &Matrix3<f64>, i: usize| problem.squared_residual(h, i);
    let mut noise = median(&mut inliers.iter().map(|&i| squared(&h, i)).collect::<Vec<_>>()) / (2.0 * 2f64.ln());
    let mut estimate = None;
    for _ in 0..8 {
        // At least a thousandth of a pixel, so that exact data keep all their points.
        let floor = (1e-3 / largest_sigma_px).powi(2);
        let limit = (chi_squared_2_quantile(1.0 - INLIER_QUANTILE) * noise.max(floor)).min(OUTLIER_SQUARED);
        let next: Vec<usize> = (0..local.len()).filter(|&i| squared(&h, i) < limit).collect();
        if next.len() < 4 {
            return Err(degenerate());
        }
        if estimate.is_some() && next == inliers {
            break;
        }
        inliers = next;
        let kept: Vec<M> = inliers.iter().map(|&i| local[i].clone()).collect();
        // With no datum left out there was no cut to allow for.
        let kept_fraction = if inliers.len() == local.len() { 1.0 } else { INLIER_QUANTILE };
        let options = RefineOptions { kept_fraction, ..RefineOptions::default() };
        let refined = refine_in_frame(&kept, Some(&h), frame, &options, observer)?;
        h = refined.in_frame;
        noise = (refined.sigma_px / largest_sigma_px).powi(2);
        estimate = Some(refined);
    }
    let estimate = estimate.ok_or_else(degenerate)?;
    Ok(RobustHomography {
        estimate,
        inliers: inliers.iter().map(|&i| among[i]).collect(),
        static_background: 0,
        patches: false,
        is_static: false,
    })
}
