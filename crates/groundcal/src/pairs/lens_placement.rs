//! The camera matrix through which a known lens acts, from the homographies' residuals, shared by all pairs: for lenses that see behind
//! the camera, whose angles no other focal length gives.
//!
//! Through another focal length or about another centre a plane's rays obey no homography. θ = (ln f, x0, y0), the centre in focal
//! lengths, is found as the coefficients of an unknown lens are ([`super::plane_lens`]): by Gauss-Newton together with all
//! homographies, each of which is eliminated.

use nalgebra::{DMatrix, DVector, Matrix2x3, Matrix3, SMatrix, SVector, Vector2, Vector3};
use rayon::prelude::*;

use crate::{
    geometry::frame::Frame,
    numerics::{
        levenberg_marquardt::{LeastSquares, LmOptions, NormalEquations, StepPolicy, StopReason, minimise_until},
        linalg::{rows_of, sphere_tangent},
    },
    observer::Observer,
    pairs::{
        correspondence::PointMatch,
        placed_lens::PlacedLens,
        ray_match::{RayChart, RayMatch},
        refine::{RefineOptions, refine_in_frame},
    },
};

/// Standard deviation of ln f and of the centre (focal lengths) about where the lens was measured: another copy of the camera, or focused
/// otherwise. Planes tell both far better; where they do not, no homography was found through the lens.
const LN_F_SIGMA: f64 = 0.1;
const CENTRE_SIGMA: f64 = 0.1;
/// Longest step of each number.
const MAX_STEP: f64 = 0.1;
/// Gauss-Newton rounds, and the step that ends them.
const ROUNDS: usize = 12;
const STEP_TOLERANCE: f64 = 1e-8;
/// Step of the differences.
const STEP: f64 = 1e-5;
/// Matches of a pair that take part: more do not help where systematic errors rule.
const MAX_MATCHES: usize = 3000;

/// A known lens with the camera matrix through which planes show it.
#[derive(Debug, Clone, Copy)]
pub(crate) struct LensPlacement {
    pub(crate) lens: PlacedLens,
    /// Covariance of (ln f, x0, y0), the centre in focal lengths; `None`: no plane was asked.
    pub(crate) covariance: Option<Matrix3<f64>>,
    /// Its model alone is known: the coefficients are to be estimated.
    pub(crate) of_model_alone: bool,
}

/// The lens with (ln f, x0, y0) changed.
pub(crate) fn moved(lens: &PlacedLens, step: &Vector3<f64>) -> PlacedLens {
    let k = &lens.intrinsics;
    let factor = step[0].exp();
    let mut intrinsics = *k;
    (intrinsics.fx, intrinsics.fy, intrinsics.skew) = (k.fx * factor, k.fy * factor, k.skew * factor);
    (intrinsics.cx, intrinsics.cy) = (k.cx + step[1] * k.fx, k.cy + step[2] * k.fy);
    PlacedLens { intrinsics, ..*lens }
}

/// From the inliers of planes (pixels, distorted), about where the lens was measured. `None` when nothing is determined.
pub(crate) fn place_lens(
    planes: &[&[PointMatch]],
    frame: &Frame,
    start: &PlacedLens,
    measured: &PlacedLens,
    observer: &dyn Observer,
) -> Option<LensPlacement> {
    let problem = PlacementProblem { planes, frame, measured, observer };
    let options = LmOptions {
        descent: StepPolicy::Undamped,
        max_iterations: ROUNDS,
        relative_cost_tolerance: 0.0,
        step_tolerance: STEP_TOLERANCE,
    };
    let out = minimise_until(&problem, *start, &options, observer)?;
    if matches!(out.stop, StopReason::Stalled | StopReason::Stopped) {
        return None;
    }
    let information = out.linearised.information.fixed_view::<3, 3>(0, 0).into_owned();
    Some(LensPlacement { lens: out.state, covariance: Some(information.try_inverse()?), of_model_alone: false })
}

/// The estimating equations: the noise of each plane, and with it their weights, is that of its residuals at the lens.
struct PlacementProblem<'a> {
    planes: &'a [&'a [PointMatch]],
    frame: &'a Frame,
    measured: &'a PlacedLens,
    observer: &'a dyn Observer,
}

impl LeastSquares for PlacementProblem<'_> {
    type State = PlacedLens;
    type Linearised = NormalEquations;

    fn cost(&self, lens: &PlacedLens) -> Option<f64> {
        let k = &lens.intrinsics;
        (k.fx.is_finite() && k.fx > 0.0 && k.cx.is_finite() && k.cy.is_finite()).then_some(0.0)
    }

    fn linearise(&self, lens: &PlacedLens) -> Option<NormalEquations> {
        let parts: Vec<Option<(Vector3<f64>, Matrix3<f64>)>> =
            self.planes.par_iter().map(|matches| reduced_equations(matches, self.frame, lens, self.observer)).collect();
        self.observer.go_on().ok()?;
        let (mut gradient, mut normal, mut told) = (Vector3::zeros(), Matrix3::zeros(), false);
        for (g, a) in parts.into_iter().flatten() {
            gradient += g;
            normal += a;
            told = true;
        }
        let (k, from) = (&lens.intrinsics, &self.measured.intrinsics);
        let offset = Vector3::new((k.fx / from.fx).ln(), (k.cx - from.cx) / from.fx, (k.cy - from.cy) / from.fy);
        let information = Vector3::new(LN_F_SIGMA, CENTRE_SIGMA, CENTRE_SIGMA).map(|sigma| 1.0 / (sigma * sigma));
        gradient += information.component_mul(&offset);
        normal += Matrix3::from_diagonal(&information);
        told.then(|| NormalEquations {
            cost: 0.0,
            gradient: DVector::from_column_slice(gradient.as_slice()),
            information: DMatrix::from_column_slice(3, 3, normal.as_slice()),
        })
    }

    fn retract(&self, lens: &PlacedLens, step: &DVector<f64>) -> PlacedLens {
        moved(lens, &Vector3::from_fn(|i, _| step[i].clamp(-MAX_STEP, MAX_STEP)))
    }
}

/// Gradient and information of θ of one plane, its homography eliminated, in units of its noise.
fn reduced_equations(
    matches: &[PointMatch],
    frame: &Frame,
    lens: &PlacedLens,
    observer: &dyn Observer,
) -> Option<(Vector3<f64>, Matrix3<f64>)> {
    let stride = matches.len().div_ceil(MAX_MATCHES).max(1);
    let seen = |m: &PointMatch| {
        let rays = RayMatch::new(m, lens, frame);
        rays.is_seen().then_some((*m, rays))
    };
    let some: Vec<(PointMatch, RayMatch)> = matches.iter().step_by(stride).filter_map(seen).collect();
    let rays: Vec<RayMatch> = some.iter().map(|(_, rays)| *rays).collect();
    let estimate = refine_in_frame(&rays, None, frame, &RefineOptions::default(), observer).ok()?;
    let tangent = sphere_tangent(&rows_of(&estimate.in_frame));
    let shifted: [[PlacedLens; 2]; 3] = std::array::from_fn(|i| {
        let step = Vector3::from_fn(|r, _| if r == i { STEP } else { 0.0 });
        [moved(lens, &step), moved(lens, &-step)]
    });
    // Change of a pixel's place in its own chart with each number, by central differences, frame units.
    let derivative = |p: &Vector2<f64>| -> Option<Matrix2x3<f64>> {
        let chart = RayChart::new(p, lens, frame)?;
        let mut by_lens = Matrix2x3::zeros();
        for (i, [up, down]) in shifted.iter().enumerate() {
            let difference = chart.place_of(p, up, frame)? - chart.place_of(p, down, frame)?;
            by_lens.set_column(i, &(difference / (2.0 * STEP)));
        }
        Some(by_lens)
    };
    let mut hh = SMatrix::<f64, 8, 8>::zeros();
    let mut ht = SMatrix::<f64, 8, 3>::zeros();
    let mut tt = Matrix3::zeros();
    let mut gradient_t = Vector3::zeros();
    let mut gradient_h = SVector::<f64, 8>::zeros();
    for (m, rays) in &some {
        let l = rays.linearised(&estimate.in_frame)?;
        let weight = l.weight / (m.sigma_px * m.sigma_px);
        // At the corrected points: at the measured ones the derivative would share the noise of the innovation.
        let [a, b] = [m.a + l.corrected[0] * frame.scale_px, m.b + l.corrected[1] * frame.scale_px];
        let (Some(by_a), Some(by_b)) = (derivative(&a), derivative(&b)) else { continue };
        let by_lens = by_b - l.slope * by_a;
        let by_h = -(l.by_entries * tangent);
        hh += by_h.transpose() * weight * by_h;
        ht += by_h.transpose() * weight * by_lens;
        tt += by_lens.transpose() * weight * by_lens;
        gradient_t += by_lens.transpose() * weight * l.innovation;
        gradient_h += by_h.transpose() * weight * l.innovation;
    }
    let inverse = hh.try_inverse()?;
    let noise = (estimate.sigma_px.max(MIN_NOISE_PX) / frame.scale_px).powi(2);
    let reduced = tt - ht.transpose() * inverse * ht;
    let gradient = gradient_t - ht.transpose() * inverse * gradient_h;
    Some((gradient / noise, reduced / noise))
}

/// Noise no camera is below, pixels: exact data keep finite weights.
pub(crate) const MIN_NOISE_PX: f64 = 1e-4;
