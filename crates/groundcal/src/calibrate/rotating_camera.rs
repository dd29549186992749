//! The rotating-camera method on all pairs ([`crate::start::rotating_camera`]): a pan-tilt camera on the spot, before a scene of any shape.
//!
//! ```text
//! Hᵀ ω H = ω for every pair
//! ```
//!
//! Nothing is refined jointly. [`super::turning`] does that for cameras that it recognises, and is the better estimate.

use std::collections::HashMap;

use nalgebra::SMatrix;

use crate::calibrate::{
    LensModel, Pipeline, Stage,
    joint::images_of,
    linear::{Chosen, settle},
    pairs::PairResult,
    report::{Concluded, KnownLens, amplify},
    turning::MIN_IMAGES,
    unknown_lens::covariance_of_lens,
};
use crate::{
    error::Error,
    geometry::{distortion::Distortion, intrinsics::Intrinsics},
    pairs::{correspondence::ImagePair, plane_lens::Lens, refine::HomographyEstimate},
    remedy::Remedy,
    result::{Calibration, Method, Scene, Warning},
    start::{
        absolute_conic::Constraint,
        linear_camera::CameraSolution,
        rotating_camera::{RotatingOptions, RotatingSolution, Weighting, calibrate_rotating},
    },
};

impl Pipeline<'_> {
    pub(super) fn run_rotating(&self, pairs: Vec<ImagePair>, mut warnings: Vec<Warning>) -> Result<Calibration, Error> {
        let mut amplification = 1.0;
        let (results, known) = if !self.options.distortion.is_none() {
            let (results, lens, settled) = self.with_given_lens(&pairs, &mut warnings)?;
            amplification = settled;
            (results, KnownLens::Given(lens))
        } else if self.options.lens != LensModel::None {
            let (results, finding) = self.homographies_and_lens(&pairs);
            (results, finding.map_or(KnownLens::NotModelled, KnownLens::Estimated))
        } else {
            (self.homographies(&pairs, None), KnownLens::NotModelled)
        };
        let used = self.rotations(&pairs, &results)?;
        let (pairs, results) = self.sharpen(pairs, results, &used, known.lens());
        let mut out = self.conclude_rotating(&pairs, &results, &known, warnings)?;
        amplify(&mut out, amplification);
        Ok(out)
    }

    /// The camera of homographies taken for rotations, with everything that is reported beside it.
    pub(super) fn conclude_rotating(
        &self,
        pairs: &[ImagePair],
        results: &[PairResult],
        known: &KnownLens,
        mut warnings: Vec<Warning>,
    ) -> Result<Calibration, Error> {
        let used = self.rotations(pairs, results)?;
        self.observer.begin(Stage::Camera, 1);
        let estimates: Vec<HomographyEstimate> =
            used.iter().filter_map(|&i| Some(results[i].robust()?.estimate.clone())).collect();
        let found = calibrate_rotating(&estimates, &self.rotating_options())?;
        let with_lens = |lens: &Lens| self.rotating_with(pairs, results, &used, lens);
        let mut added = SMatrix::<f64, 5, 5>::zeros();
        match known {
            KnownLens::Estimated(finding) => added = covariance_of_lens(finding, with_lens)?,
            KnownLens::NotModelled if pairs.iter().any(|p| !p.matches.is_empty()) => {
                let percent_if = |k1: f64| {
                    let lens = Lens { distortion: Distortion::radial(k1, 0.0), intrinsics: found.intrinsics };
                    with_lens(&lens).ok().map(|k| 100.0 * (found.intrinsics.fx / k.fx - 1.0))
                };
                warnings.push(Warning::DistortionNotModelled {
                    pincushion_percent: percent_if(0.05),
                    barrel_percent: percent_if(-0.05),
                });
            }
            _ => {}
        }
        if found.variance_inflation > 1.0 {
            warnings.push(Warning::NotRotations {
                chi_squared: found.chi_squared,
                degrees_of_freedom: found.degrees_of_freedom,
                widened: found.variance_inflation.sqrt(),
            });
        }
        let solution = self.as_camera(&found, shared_noise(pairs, results, &used), &added);
        let lens_share = (added[(0, 0)] / solution.covariance_px[(0, 0)]).sqrt();
        let chosen = Chosen { motions: Vec::new(), verdicts: Vec::new() };
        let concluded = Concluded { solution, joint: None, lens_share, chosen, used: used.clone() };
        let mut out = self.report(pairs, results, concluded, warnings, known);
        out.method = Method::Rotating;
        out.scene = Some(Scene::Directions);
        out.constraint = self.rotating_options().constraint;
        out.fit.chi_squared = found.chi_squared;
        out.fit.degrees_of_freedom = found.degrees_of_freedom;
        out.fit.variance_inflation = found.variance_inflation;
        for (&i, rotation) in used.iter().zip(&found.rotations) {
            out.motions[i].rotation_deg = Some(rotation.angle_rad.to_degrees());
        }
        Ok(out)
    }

    fn rotating_options(&self) -> RotatingOptions {
        RotatingOptions {
            constraint: match self.options.constraint {
                Constraint::Auto => Constraint::ZeroSkew,
                other => other,
            },
            aspect: self.options.aspect.unwrap_or(1.0),
            weighting: Weighting::Covariance,
        }
    }

    /// Pairs taken for rotations: those named, or those that one focal length makes rotations of. Chance hardly ever does that (five
    /// equations a pair), so that three images joined by them are enough; else they must be most.
    fn rotations(&self, pairs: &[ImagePair], results: &[PairResult]) -> Result<Vec<usize>, Error> {
        let seen: Vec<usize> =
            (0..results.len()).filter(|&i| results[i].robust().is_some_and(|r| !r.is_static)).collect();
        if seen.is_empty() {
            return Err(self.why_nothing(results));
        }
        if self.options.pairs.is_some() {
            return Ok(seen);
        }
        let (_, used) = self.nearest_to_rotations(results).unwrap_or_else(|| {
            let [cx, cy] = self.size.centre_px();
            (Intrinsics::square(self.size.width as f64, cx, cy), Vec::new())
        });
        if images_of(&used, pairs).len() < MIN_IMAGES && 2 * used.len() <= seen.len() {
            return Err(Error::NoUsableMotion {
                pairs: seen.len(),
                reason: format!(
                    "{} of them can be a rotation about the optical centre under one focal length, more than half or \
                     three joined images are needed: the camera was moved between the images",
                    used.len()
                ),
                remedies: vec![Remedy::UseJointMethod, Remedy::NamePairs],
            });
        }
        Ok(used)
    }

    /// The camera of matches undone by a lens.
    fn rotating_with(
        &self,
        pairs: &[ImagePair],
        results: &[PairResult],
        used: &[usize],
        lens: &Lens,
    ) -> Result<Intrinsics, Error> {
        let again: Vec<HomographyEstimate> =
            used.iter().filter_map(|&i| self.refit(&pairs[i], results[i].robust()?, lens)).collect();
        Ok(calibrate_rotating(&again, &self.rotating_options())?.intrinsics)
    }

    /// Homographies with the given coefficients undone through the focal length that then comes out; also by how much the
    /// coefficients enlarge errors of it.
    fn with_given_lens(
        &self,
        pairs: &[ImagePair],
        warnings: &mut Vec<Warning>,
    ) -> Result<(Vec<PairResult>, Lens, f64), Error> {
        let [cx, cy] = self.options.principal_point_px.unwrap_or(self.size.centre_px());
        let mut lens = Lens {
            distortion: self.options.distortion,
            intrinsics: Intrinsics::square(self.size.width.max(self.size.height) as f64, cx, cy),
        };
        let (mut amplification, mut last_change) = (1.0, 0.0);
        for _ in 0..2 {
            let results = self.homographies(pairs, Some(&lens));
            let used = self.rotations(pairs, &results)?;
            let settled = settle(lens, |lens| self.rotating_with(pairs, &results, &used, lens))?;
            lens.intrinsics = settled.intrinsics;
            (amplification, last_change) = (settled.amplification, settled.last_change);
        }
        if last_change > 1e-6 {
            warnings.push(Warning::DistortionNotConverged { relative_change: last_change });
        }
        Ok((self.homographies(pairs, Some(&lens)), lens, amplification))
    }

    fn as_camera(&self, found: &RotatingSolution, shared: f64, added: &SMatrix<f64, 5, 5>) -> CameraSolution {
        CameraSolution {
            intrinsics: found.intrinsics,
            covariance_px: found.covariance_px * shared + added,
            estimated: found.estimated,
            priors: Vec::new(),
            groups: Vec::new(),
            chi_squared: found.chi_squared,
            degrees_of_freedom: found.degrees_of_freedom,
            attitude_sigma_rad: 0.0,
            attitude_sigma_estimated: false,
            // `NotRotations` says it instead.
            variance_inflation: 1.0,
        }
    }
}

/// Factor on the covariance of pairs taken for independent although points of an image are in several of them.
///
/// All differences of n values with independent noise carry (n/2) times the information of the values when they count as
/// independent (their Laplacian is n I - J, each difference having twice the variance): for a point seen in m pairs, (m + 1) / 2.
fn shared_noise(pairs: &[ImagePair], results: &[PairResult], used: &[usize]) -> f64 {
    let mut seen: HashMap<(usize, u64, u64), usize> = HashMap::new();
    for &i in used {
        let pair = &pairs[i];
        for &k in results[i].inliers() {
            let m = &pair.matches[k];
            for (image, p) in [(pair.from, m.a), (pair.to, m.b)] {
                *seen.entry((image, p.x.to_bits(), p.y.to_bits())).or_default() += 1;
            }
        }
    }
    // Mean over observations, so that a point in m pairs counts m times.
    let (all, weighted) = seen.values().fold((0usize, 0usize), |(a, w), m| (a + m, w + m * m));
    if all == 0 { 1.0 } else { 0.5 * (weighted as f64 / all as f64 + 1.0) }
}
