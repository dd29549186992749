//! The lens as it is reported.

use crate::{
    calibrate::joint::JointSolution,
    geometry::lens::Lens,
    pairs::known_lens::KnownLens,
    result::{LensSource, Parameter},
    start::linear_camera::CameraSolution,
};

/// Coefficients, where they come from, and how sure they are.
pub(super) struct LensResult {
    pub(super) source: LensSource,
    pub(super) lens: Lens,
    /// Standard deviations of those that were estimated.
    sigmas: Vec<(Parameter, f64)>,
}

impl LensResult {
    pub(super) fn new(known: &KnownLens, joint: Option<&JointSolution>, s: &CameraSolution) -> Self {
        let held = |source, lens| Self { source, lens, sigmas: Vec::new() };
        match (known, joint) {
            (KnownLens::NotModelled, _) => held(LensSource::NotModelled, Lens::None),
            (KnownLens::Given(lens), _) => held(LensSource::Given, lens.lens),
            // It acted about the centre that was assumed, in pixels: the coefficient is that of the focal length found.
            (KnownLens::OfPairs(lens), _) => {
                let placed = lens.with_focal_length(s.intrinsics.fx);
                held(LensSource::Estimated, placed.map_or(Lens::None, |placed| placed.lens))
            }
            (KnownLens::Placed(placement), None) if known.is_estimated() => {
                held(LensSource::Estimated, placement.lens.lens)
            }
            (KnownLens::Placed(placement), _) if !known.is_estimated() => held(LensSource::Given, placement.lens.lens),
            (KnownLens::Estimated(_) | KnownLens::Placed(_), Some(joint)) => {
                // What is not estimated has no variance.
                let sigma = |p: Parameter| Some((p, joint.covariance_of(p, p).sqrt())).filter(|(_, s)| *s > 0.0);
                let of_lens = Parameter::ALL.into_iter().filter(|p| p.is_of_lens());
                Self { source: LensSource::Estimated, lens: joint.lens, sigmas: of_lens.filter_map(sigma).collect() }
            }
            (KnownLens::Placed(placement), None) => held(LensSource::Given, placement.lens.lens),
            (KnownLens::Estimated(finding), None) => {
                let k = &s.intrinsics;
                let ln_f_sigma = s.covariance_px[(0, 0)].max(0.0).sqrt() / k.fx;
                let placed = finding.lens().and_then(|l| l.with_focal_length(k.fx));
                let lens = placed.map_or(Lens::None, |l| l.lens);
                let [k1, k2] = ["k1", "k2"].map(|name| lens.parameter(name).unwrap_or(0.0));
                // The residuals see k1 / f² and k2 / f⁴: what is unknown of f adds.
                let [k1_sigma, k2_sigma] = finding.sigmas(k);
                let sigmas = vec![
                    (Parameter::K1, k1_sigma.hypot(2.0 * k1 * ln_f_sigma)),
                    (Parameter::K2, k2_sigma.hypot(4.0 * k2 * ln_f_sigma)),
                ];
                Self { source: LensSource::Estimated, lens, sigmas }
            }
        }
    }

    /// The standard deviation of a coefficient; `None`: it was not estimated.
    pub(super) fn sigma(&self, p: Parameter) -> Option<f64> {
        self.sigmas.iter().find(|(q, _)| *q == p).map(|(_, sigma)| *sigma)
    }
}
