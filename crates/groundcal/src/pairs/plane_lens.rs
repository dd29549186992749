//! Radial distortion from the homographies' residuals, shared by all motions.
//!
//! With ideal points u(x; k1, k2, centre), every motion's matches obey u(b) ~ H u(a). The lens parameters
//! θ = (k1, k2, x0, y0) are found by Gauss-Newton together with all homographies, each of which is eliminated:
//!
//! ```text
//! A = Σ_motions ( H_θθ - H_θh H_hh⁻¹ H_hθ ) / σ²,      δθ = -(A + P)⁻¹ (g + P (θ - θ_prior))
//! ```
//!
//! The coefficients act through a fixed reference focal length: k1 / f² is what the residuals see, whatever f is. A match's
//! deviation is scaled by the lens's local magnification, so that noise stays what it was in the image.

use nalgebra::{DMatrix, DVector, Matrix2x4, Matrix4, SMatrix, SVector, Vector2, Vector4};
use rayon::prelude::*;

use crate::{
    geometry::{
        frame::Frame,
        lens::{Lens, Radtan},
    },
    numerics::{
        levenberg_marquardt::{LeastSquares, LmOptions, NormalEquations, StepPolicy, StopReason, minimise_until},
        linalg::{rows_of, sphere_tangent},
    },
    observer::Observer,
    pairs::{
        correspondence::PointMatch,
        placed_lens::PlacedLens,
        refine::{RefineOptions, refine_until},
        residual::linearise,
    },
};

/// The lens with (k1, k2, x0, y0) changed; the centre in units of the focal length.
pub(crate) fn moved(lens: &PlacedLens, step: &Vector4<f64>) -> PlacedLens {
    let [k1, k2, p1, p2, k3] = coefficients(lens);
    let mut intrinsics = lens.intrinsics;
    intrinsics.cx += step[2] * intrinsics.fx;
    intrinsics.cy += step[3] * intrinsics.fy;
    PlacedLens { lens: Lens::Radtan(Radtan::new([k1 + step[0], k2 + step[1], p1, p2, k3])), intrinsics }
}

/// k1, k2, p1, p2, k3: planes are asked for no other model.
pub(crate) fn coefficients(lens: &PlacedLens) -> [f64; 5] {
    match &lens.lens {
        Lens::Radtan(radtan) => radtan.parameters(),
        _ => [0.0; 5],
    }
}

/// Priors of the lens.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct LensPrior {
    /// Standard deviation of k1 about 0.
    pub k1_sigma: f64,
    /// Standard deviation of k2 about 0.
    pub k2_sigma: f64,
    /// Standard deviation of the centre of distortion about the given one, in focal lengths.
    pub centre_sigma: f64,
}

impl LensPrior {
    fn information(&self) -> Vector4<f64> {
        Vector4::new(self.k1_sigma, self.k2_sigma, self.centre_sigma, self.centre_sigma).map(|s| 1.0 / (s * s))
    }
}

/// The estimated lens.
#[derive(Debug, Clone)]
pub(crate) struct LensEstimate {
    /// k1 and k2 through the reference focal length, and the centre.
    pub lens: PlacedLens,
    /// Covariance of (k1, k2, x0, y0), the centre in focal lengths.
    pub covariance: Matrix4<f64>,
}

/// Gauss-Newton rounds, and the step that ends them.
const ROUNDS: usize = 8;
const STEP_TOLERANCE: f64 = 1e-7;
/// Longest step of each number, and the coefficients beyond which there is no lens.
const MAX_STEP: [f64; 4] = [0.3, 0.5, 0.05, 0.05];
const MAX_COEFFICIENTS: [f64; 2] = [3.0, 5.0];
/// Matches of a motion that take part: more do not help where systematic errors rule.
const MAX_MATCHES: usize = 3000;

/// Estimates the lens from the inliers of motions (pixels, distorted), starting at `start`, about whose centre the prior of the
/// centre of distortion lies. `None` when nothing is determined or the lens folds over.
#[cfg(test)]
pub(crate) fn estimate_lens(
    motions: &[&[PointMatch]],
    frame: &Frame,
    start: &PlacedLens,
    prior: &LensPrior,
) -> Option<LensEstimate> {
    estimate_lens_until(motions, frame, start, prior, &crate::observer::Silent)
}

/// The same under an observer's eyes; `None` also when it says stop.
pub(crate) fn estimate_lens_until(
    motions: &[&[PointMatch]],
    frame: &Frame,
    start: &PlacedLens,
    prior: &LensPrior,
    observer: &dyn Observer,
) -> Option<LensEstimate> {
    let problem = LensProblem { motions, frame, start, prior_information: prior.information(), observer };
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
    let information = out.linearised.information.fixed_view::<4, 4>(0, 0).into_owned();
    Some(LensEstimate { lens: out.state, covariance: information.try_inverse()? })
}

/// The lens's estimating equations: the noise of each motion, and with it their weights, is that of its residuals at the lens.
struct LensProblem<'a> {
    motions: &'a [&'a [PointMatch]],
    frame: &'a Frame,
    start: &'a PlacedLens,
    prior_information: Vector4<f64>,
    observer: &'a dyn Observer,
}

impl LeastSquares for LensProblem<'_> {
    type State = PlacedLens;
    type Linearised = NormalEquations;

    fn cost(&self, lens: &PlacedLens) -> Option<f64> {
        let ([k1, k2, ..], [most_k1, most_k2]) = (coefficients(lens), MAX_COEFFICIENTS);
        (k1.abs() < most_k1 && k2.abs() < most_k2).then_some(0.0)
    }

    fn linearise(&self, lens: &PlacedLens) -> Option<NormalEquations> {
        let parts: Vec<Option<(Vector4<f64>, Matrix4<f64>)>> = self
            .motions
            .par_iter()
            .map(|matches| reduced_equations(matches, self.frame, lens, self.observer))
            .collect();
        self.observer.go_on().ok()?;
        let (mut gradient, mut normal) = (Vector4::zeros(), Matrix4::zeros());
        for (g, a) in parts.into_iter().flatten() {
            gradient += g;
            normal += a;
        }
        let ([k1, k2, ..], k, from) = (coefficients(lens), &lens.intrinsics, &self.start.intrinsics);
        let offset = Vector4::new(k1, k2, (k.cx - from.cx) / from.fx, (k.cy - from.cy) / from.fy);
        gradient += self.prior_information.component_mul(&offset);
        normal += Matrix4::from_diagonal(&self.prior_information);
        Some(NormalEquations {
            cost: 0.0,
            gradient: DVector::from_column_slice(gradient.as_slice()),
            information: DMatrix::from_column_slice(4, 4, normal.as_slice()),
        })
    }

    fn retract(&self, lens: &PlacedLens, step: &DVector<f64>) -> PlacedLens {
        moved(lens, &Vector4::from_fn(|i, _| step[i].clamp(-MAX_STEP[i], MAX_STEP[i])))
    }
}

/// Gradient and information of θ of one motion, its homography eliminated, in units of its noise.
fn reduced_equations(
    matches: &[PointMatch],
    frame: &Frame,
    lens: &PlacedLens,
    observer: &dyn Observer,
) -> Option<(Vector4<f64>, Matrix4<f64>)> {
    let stride = matches.len().div_ceil(MAX_MATCHES).max(1);
    // A point beyond the fold of a lens on the way has no ideal place; it is back when the lens is better.
    let ideal: Vec<PointMatch> = matches.iter().step_by(stride).filter_map(|m| lens.ideal_match(m)).collect();
    let estimate = refine_until(&ideal, None, frame, &RefineOptions::default(), observer).ok()?;
    let tangent = sphere_tangent(&rows_of(&estimate.in_frame));
    const STEP: f64 = 1e-4;
    let shifted: Vec<[PlacedLens; 2]> = (0..4)
        .map(|i| {
            let mut step = Vector4::zeros();
            step[i] = STEP;
            [moved(lens, &step), moved(lens, &-step)]
        })
        .collect();
    // Change of a point's ideal place with each parameter, by central differences, frame units.
    let derivative = |p: &Vector2<f64>| -> Option<Matrix2x4<f64>> {
        let mut d = Matrix2x4::zeros();
        for (i, [up, down]) in shifted.iter().enumerate() {
            let difference = up.ideal_point(p)? - down.ideal_point(p)?;
            d.set_column(i, &(difference / (2.0 * STEP * frame.scale_px)));
        }
        Some(d)
    };
    let mut hh = SMatrix::<f64, 8, 8>::zeros();
    let mut ht = SMatrix::<f64, 8, 4>::zeros();
    let mut tt = Matrix4::zeros();
    let mut gradient_t = Vector4::zeros();
    let mut gradient_h = SVector::<f64, 8>::zeros();
    for m in &ideal {
        let local = PointMatch { a: frame.local(&m.a), b: frame.local(&m.b), ..*m };
        let l = linearise(&estimate.in_frame, &local)?;
        let weight = l.weight / (m.sigma_px * m.sigma_px);
        // At the corrected points: at the measured ones the derivative would share the noise of the innovation, and the
        // products would not average to zero.
        let [a, b] = l.corrected.map(|p| lens.real_point(&frame.pixel(&p)));
        let (Some(by_a), Some(by_b)) = (a.and_then(|p| derivative(&p)), b.and_then(|p| derivative(&p))) else {
            continue;
        };
        let by_lens = by_b - l.slope * by_a;
        let by_h = -(l.by_entries * tangent);
        hh += by_h.transpose() * weight * by_h;
        ht += by_h.transpose() * weight * by_lens;
        tt += by_lens.transpose() * weight * by_lens;
        gradient_t += by_lens.transpose() * weight * l.innovation;
        gradient_h += by_h.transpose() * weight * l.innovation;
    }
    let inverse = hh.try_inverse()?;
    let noise = (estimate.sigma_px / frame.scale_px).powi(2);
    let reduced = tt - ht.transpose() * inverse * ht;
    let gradient = gradient_t - ht.transpose() * inverse * gradient_h;
    Some((gradient / noise, reduced / noise))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::synthetic::points::PointScene;

    #[test]
    fn the_lens_comes_back_from_exact_and_from_noisy_matches() {
        for (sigma_px, tolerance) in [(0.0, 1e-6), (0.05, 0.003)] {
            let scene = PointScene { lens: Lens::radial(-0.2, 0.04), sigma_px, matches: 500, ..PointScene::nominal(3) };
            let k = scene.intrinsics;
            let frame = Frame::new(scene.size, None);
            let pairs = scene.pairs();
            let motions: Vec<&[PointMatch]> = pairs.iter().map(|p| p.matches.as_slice()).collect();
            let start = PlacedLens { lens: Lens::None, intrinsics: k };
            let prior = LensPrior { k1_sigma: 100.0, k2_sigma: 100.0, centre_sigma: 0.001 };
            let found = estimate_lens(&motions, &frame, &start, &prior).expect("determined");
            let [k1, k2, ..] = coefficients(&found.lens);
            assert!((k1 + 0.2).abs() < tolerance && (k2 - 0.04).abs() < 5.0 * tolerance, "{sigma_px}: {k1} {k2}");
            if sigma_px > 0.0 {
                let sd = found.covariance[(0, 0)].sqrt();
                assert!((k1 + 0.2).abs() < 4.0 * sd && sd < tolerance, "{sd}");
            }
            // Through another focal length the same lens.
            let other = found.lens.with_focal_length(500.0).expect("of this model");
            let p = Vector2::new(100.0, 200.0);
            let (u, v) = (found.lens.ideal_point(&p).expect("inside"), other.ideal_point(&p).expect("inside"));
            assert!((u - v).norm() < 1e-9);
        }
    }
}
