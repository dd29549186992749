//! The lens as it is reported.

use crate::{
    calibrate::joint::Joint, geometry::distortion::Distortion, pairs::known_lens::KnownLens, result::LensSource,
    start::linear_camera::CameraSolution,
};

/// Coefficients, where they come from, and how sure they are.
pub(super) struct LensResult {
    pub(super) source: LensSource,
    pub(super) distortion: Distortion,
    pub(super) k1_sigma: Option<f64>,
    pub(super) k2_sigma: Option<f64>,
}

impl LensResult {
    pub(super) fn new(known: &KnownLens, joint: Option<&Joint>, s: &CameraSolution) -> Self {
        let held = |source, distortion| Self { source, distortion, k1_sigma: None, k2_sigma: None };
        match (known, joint) {
            (KnownLens::NotModelled, _) => held(LensSource::NotModelled, Distortion::default()),
            (KnownLens::Given(lens), _) => held(LensSource::Given, lens.distortion),
            (KnownLens::Estimated(_), Some(joint)) => {
                // What is not estimated has no variance.
                let sigma = |i: usize| Some(joint.covariance_px[(i, i)].sqrt()).filter(|s| *s > 0.0);
                Self {
                    source: LensSource::Estimated,
                    distortion: joint.distortion,
                    k1_sigma: sigma(5),
                    k2_sigma: sigma(6),
                }
            }
            (KnownLens::Estimated(finding), None) => {
                let k = &s.intrinsics;
                let ln_f_sigma = s.covariance_px[(0, 0)].max(0.0).sqrt() / k.fx;
                let lens = finding.lens().map(|l| l.with_focal_length(k.fx));
                let distortion = lens.map_or(Distortion::default(), |l| l.distortion);
                // The residuals see k1 / f² and k2 / f⁴: what is unknown of f adds.
                let [k1_sigma, k2_sigma] = finding.sigmas(k);
                Self {
                    source: LensSource::Estimated,
                    distortion,
                    k1_sigma: Some(k1_sigma.hypot(2.0 * distortion.k1 * ln_f_sigma)),
                    k2_sigma: Some(k2_sigma.hypot(4.0 * distortion.k2 * ln_f_sigma)),
                }
            }
        }
    }
}
