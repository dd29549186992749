//! A lens that nothing is known of: its distortion from the residuals of the planes, before motions are chosen and again from
//! the patches of those chosen; what is left unknown of it goes into the error bars.

use nalgebra::{Matrix4, SMatrix, SVector};

use crate::calibrate::{
    LensModel, Pipeline,
    linear::{Chosen, Scenario},
    pairs::PairResult,
    report::KnownLens,
};
use crate::{
    error::Error,
    geometry::{distortion::Distortion, intrinsics::Intrinsics},
    pairs::{
        correspondence::{ImagePair, PointMatch},
        plane_lens::{Lens, LensEstimate, LensPrior, estimate_lens},
    },
    result::{Calibration, Warning},
    start::linear_camera::{CameraOptions, CameraSolution, solve_camera},
};

/// Priors of k1 and k2, lenses from wide to long.
pub(super) const K1_SIGMA: f64 = 0.3;
pub(super) const K2_SIGMA: f64 = 0.3;
/// Centre of distortion: deviation from the assumed principal point, as a fraction of the width, before it is known better.
const CENTRE_SIGMA: f64 = 0.05;
/// Principal points known better than this fraction of the width become the centre of distortion.
const KNOWN_CENTRE: f64 = 0.02;
/// Pairs and matches of a pair that tell of the lens before the motions are known.
const MAX_PAIRS: usize = 24;
const MIN_INLIERS: usize = 40;
/// Squared distance of (k1, k2) from zero beyond which they are kept: 99.9 % of chi-squared with two degrees of freedom.
const SIGNIFICANT: f64 = 13.8;

/// The lens as far as it is known.
#[derive(Clone)]
pub(super) struct LensFinding {
    pub(super) estimate: LensEstimate,
    /// Whether the coefficients differ from zero.
    pub(super) significant: bool,
}

impl LensFinding {
    fn new(estimate: LensEstimate) -> Self {
        let d = &estimate.lens.distortion;
        let k = nalgebra::Vector2::new(d.k1, d.k2);
        let block = estimate.covariance.fixed_view::<2, 2>(0, 0).into_owned();
        let distance = block.try_inverse().map_or(0.0, |i| (k.transpose() * i * k)[(0, 0)]);
        Self { estimate, significant: distance > SIGNIFICANT }
    }

    /// The lens to be undone: none where its coefficients are not told from zero.
    pub(super) fn lens(&self) -> Option<&Lens> {
        self.significant.then_some(&self.estimate.lens)
    }

    /// The lens about which the covariance holds.
    fn reference(&self) -> Lens {
        let mut lens = self.estimate.lens;
        if !self.significant {
            lens.distortion = Distortion::default();
        }
        lens
    }
}

impl Pipeline<'_> {
    pub(super) fn run_unknown_lens(
        &self,
        pairs: Vec<ImagePair>,
        trusted: bool,
        warnings: Vec<Warning>,
    ) -> Result<Calibration, Error> {
        let (results, mut finding) = self.homographies_and_lens(&pairs);
        let lens = finding.as_ref().and_then(LensFinding::lens).copied();
        let known = finding.clone().map_or(KnownLens::NotModelled, KnownLens::Estimated);
        let mut chosen = match self.choose(&results, &pairs, trusted, &known)? {
            Scenario::Motions(chosen) => chosen,
            Scenario::Turning(turning) => {
                return self.conclude_turning(pairs, results, &turning, warnings, &known, lens.as_ref());
            }
        };
        let (pairs, mut results) = self.sharpen(pairs, results, &chosen.used(), lens.as_ref());
        // Again from the motions alone, patches and all, about the principal point that they give.
        for _ in 0..3 {
            chosen = chosen.refreshed(&results);
            let used = chosen.used();
            let camera = self.camera_of(&chosen, &self.options.camera(self.size)).ok();
            let Some(next) = self.lens_of_motions(&pairs, &results, &used, finding.as_ref(), camera.as_ref()) else {
                break;
            };
            let settled = !next.significant && finding.as_ref().is_some_and(|f| !f.significant);
            if !settled {
                for &i in &used {
                    let again = self.again(&pairs[i], &results[i], next.lens());
                    results[i] = again;
                }
            }
            finding = Some(next);
            if settled {
                break;
            }
        }
        let known = finding.map_or(KnownLens::NotModelled, KnownLens::Estimated);
        self.conclude(&pairs, &results, chosen.refreshed(&results), warnings, &known)
    }

    /// Homographies of all pairs, and the lens undone in them, from their own residuals.
    pub(super) fn homographies_and_lens(&self, pairs: &[ImagePair]) -> (Vec<PairResult>, Option<LensFinding>) {
        let mut results = self.homographies(pairs, None);
        let mut finding: Option<LensFinding> = None;
        for _ in 0..2 {
            let Some(next) = self.lens_of_planes(pairs, &results, finding.as_ref()) else { break };
            let significant = next.significant;
            if significant {
                results = self.homographies(pairs, next.lens());
            }
            finding = Some(next);
            if !significant {
                break;
            }
        }
        (results, finding)
    }

    /// The homography of a pair again under another lens.
    fn again(&self, pair: &ImagePair, before: &PairResult, lens: Option<&Lens>) -> PairResult {
        let patches = before.outcome.as_ref().is_ok_and(|(robust, _)| robust.patches);
        let mut next = if patches {
            self.homography_with(pair, lens, self.robust_options(true))
        } else {
            self.homography(pair, lens)
        };
        next.candidates = before.candidates;
        next.superseded.clone_from(&before.superseded);
        if let (Ok((new, _)), Ok((old, _))) = (&mut next.outcome, &before.outcome) {
            (new.patches, new.static_background) = (old.patches, old.static_background);
        }
        next
    }

    pub(super) fn camera_of(&self, chosen: &Chosen, options: &CameraOptions) -> Result<CameraSolution, Error> {
        let used = chosen.used();
        let motions: Vec<_> = chosen.motions.iter().filter(|(i, _)| used.contains(i)).map(|(_, m)| m.clone()).collect();
        solve_camera(&motions, &self.frame(), options)
    }

    fn reference_lens(&self, centre_px: [f64; 2], before: Option<&LensFinding>) -> Lens {
        let f = self.size.width.max(self.size.height) as f64;
        let distortion = before.map_or(Distortion::default(), |b| b.estimate.lens.distortion);
        Lens { distortion, intrinsics: Intrinsics::square(f, centre_px[0], centre_px[1]) }
    }

    /// From the best supported planes of any pairs.
    fn lens_of_planes(
        &self,
        pairs: &[ImagePair],
        results: &[PairResult],
        before: Option<&LensFinding>,
    ) -> Option<LensFinding> {
        let inliers = |i: usize| {
            let robust = match &results[i].outcome {
                Ok((robust, _)) => robust,
                Err(refusal) => refusal.homography.as_deref()?,
            };
            (!robust.is_static && robust.inliers.len() >= MIN_INLIERS).then_some(&robust.inliers)
        };
        let mut best: Vec<(usize, &Vec<usize>)> = (0..pairs.len()).filter_map(|i| Some((i, inliers(i)?))).collect();
        best.sort_by_key(|(i, list)| (std::cmp::Reverse(list.len()), *i));
        best.truncate(MAX_PAIRS);
        let centre = self.options.principal_point_px.unwrap_or(self.size.centre_px());
        self.lens_of(pairs, &best, centre, CENTRE_SIGMA, before)
    }

    fn lens_of_motions(
        &self,
        pairs: &[ImagePair],
        results: &[PairResult],
        used: &[usize],
        before: Option<&LensFinding>,
        camera: Option<&CameraSolution>,
    ) -> Option<LensFinding> {
        // All pairs of many views repeat each other.
        let stride = used.len().div_ceil(MAX_PAIRS);
        let lists: Vec<(usize, &Vec<usize>)> = used
            .iter()
            .step_by(stride.max(1))
            .filter_map(|&i| Some((i, &results[i].outcome.as_ref().ok()?.0.inliers)))
            .collect();
        let width = self.size.width as f64;
        let mut centre = self.options.principal_point_px.unwrap_or(self.size.centre_px());
        let mut sigma = CENTRE_SIGMA;
        if let Some(c) = camera {
            let known = c.covariance_px[(2, 2)].max(c.covariance_px[(3, 3)]).sqrt() / width;
            if c.estimated[2] && known < KNOWN_CENTRE {
                // The same images told it, through a lens not yet known: not sharper than half a per cent.
                (centre, sigma) = ([c.intrinsics.cx, c.intrinsics.cy], known.max(5e-3));
            }
        }
        self.lens_of(pairs, &lists, centre, sigma, before)
    }

    fn lens_of(
        &self,
        pairs: &[ImagePair],
        lists: &[(usize, &Vec<usize>)],
        centre_px: [f64; 2],
        centre_sigma: f64,
        before: Option<&LensFinding>,
    ) -> Option<LensFinding> {
        let matches: Vec<Vec<PointMatch>> =
            lists.iter().map(|(i, list)| list.iter().map(|&k| pairs[*i].matches[k]).collect()).collect();
        let slices: Vec<&[PointMatch]> = matches.iter().map(Vec::as_slice).collect();
        if slices.is_empty() {
            return None;
        }
        let start = self.reference_lens(centre_px, before);
        let prior = LensPrior {
            k1_sigma: K1_SIGMA,
            // Held at zero, but for rounding.
            k2_sigma: if self.options.lens == LensModel::K1 { 1e-6 } else { K2_SIGMA },
            centre_sigma: centre_sigma * self.size.width as f64 / start.intrinsics.fx,
        };
        estimate_lens(&slices, &self.frame(), &start, &prior).map(LensFinding::new)
    }
}

/// What the uncertainty of the lens adds to the covariance of (fx, fy, cx, cy, skew), pixels squared: the camera again
/// with the lens moved along each column of the covariance's root. `solve` gives the camera of matches undone by a lens.
pub(super) fn covariance_of_lens(
    finding: &LensFinding,
    solve: impl Fn(&Lens) -> Result<Intrinsics, Error>,
) -> Result<SMatrix<f64, 5, 5>, Error> {
    lens_propagated(finding, solve).ok_or_else(|| Error::Numerical {
        stage: "lens distortion",
        detail: "the camera does not follow the lens".into(),
    })
}

fn lens_propagated(
    finding: &LensFinding,
    solve: impl Fn(&Lens) -> Result<Intrinsics, Error>,
) -> Option<SMatrix<f64, 5, 5>> {
    let reference = finding.reference();
    let numbers = |lens: &Lens| -> Option<SVector<f64, 5>> {
        let k = solve(lens).ok()?;
        Some(SVector::<f64, 5>::from([k.fx, k.fy, k.cx, k.cy, k.skew]))
    };
    let here = numbers(&reference)?;
    let symmetric = (finding.estimate.covariance + finding.estimate.covariance.transpose()) * 0.5;
    let root: Matrix4<f64> = symmetric.cholesky()?.l();
    let mut total = SMatrix::<f64, 5, 5>::zeros();
    for column in root.column_iter() {
        // A whole deviation may leave the range of the lens model: a step of a tenth, scaled.
        const PART: f64 = 0.1;
        let difference = (numbers(&reference.moved(&(column * PART)))? - here) / PART;
        total += difference * difference.transpose();
    }
    Some(total)
}
