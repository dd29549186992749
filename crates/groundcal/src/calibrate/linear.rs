//! The linear method on all pairs: consistent motions, camera, and the fixed point with a given lens distortion.

use rayon::prelude::*;

use crate::calibrate::{
    LensModel, Method, Pipeline, joint::images_of, pairs::PairResult, report::KnownLens, turning::Turning,
};
use crate::{
    error::Error,
    geometry::intrinsics::Intrinsics,
    pairs::{
        circular_points::from_homography,
        correspondence::{ImagePair, validated},
        plane_lens::Lens,
    },
    remedy::Remedy,
    result::{Calibration, Warning},
    select::{
        attitude_groups::{Motion, Sides},
        plane_normal::{ConsistencyOptions, Verdict, find_consistent},
    },
    start::linear_camera::{CameraOptions, CameraSolution, solve_camera},
};

/// Prior of the principal point in the search for consistent motions, as a fraction of the width: nothing should be lost to
/// an odd lens.
const SEARCH_PRINCIPAL_POINT_SIGMA: f64 = 0.1;
/// Least deviation of the attitudes in the search: what is left of lens distortion and of a scene that is not quite a plane
/// moves circular points by more than the noise says, and a motion is not to be lost for it. Pairs of images of different
/// attitudes are off by degrees.
const SEARCH_ATTITUDE_SIGMAS_DEG: [f64; 3] = [0.3, 1.0, 2.5];
/// Deviation of the k1 that the search takes to be still there, given or not: a given one has its own error and no lens has
/// k1 alone.
const SEARCH_K1_SIGMA: f64 = 0.05;
/// Deviation of a circular point's direction in the search for all other faults of the model (higher distortion, a scene not
/// quite flat or not quite at infinity): a third of a degree.
const SEARCH_DIRECTION_SIGMA: f64 = 0.006;
/// Fraction of points beyond the horizon from which on a scene is no floor.
const MINOR_SIDE: f64 = 0.05;
/// Squared distance beyond which a motion disagrees with the camera of the others: 99.9 % of chi-squared with two degrees
/// of freedom.
const MOTION_GATE: f64 = 13.8;

/// What the images turned out to show.
pub(super) enum Scenario {
    /// Turns about the normal of a floor.
    Motions(Chosen),
    /// A camera turning on the spot, about any axes.
    Turning(Turning),
}

/// The motions among the pairs, and what became of each.
pub(super) struct Chosen {
    /// Index of the pair, motion.
    pub(super) motions: Vec<(usize, Motion)>,
    /// One a motion.
    pub(super) verdicts: Vec<Verdict>,
}

impl Chosen {
    /// The same choice with what the pairs say now, their homographies having been refined. What no longer shows a turn is
    /// left out.
    pub(super) fn refreshed(mut self, results: &[PairResult]) -> Self {
        for ((pair, motion), verdict) in self.motions.iter_mut().zip(&mut self.verdicts) {
            match &results[*pair].outcome {
                Ok((_, geometry)) => motion.geometry = geometry.clone(),
                Err(_) => *verdict = Verdict::Disagrees { sigmas: f64::INFINITY },
            }
        }
        self
    }

    /// Indices of the pairs that are used.
    pub(super) fn used(&self) -> Vec<usize> {
        let accepted = self.motions.iter().zip(&self.verdicts).filter(|(_, v)| **v == Verdict::Accepted);
        accepted.map(|((i, _), _)| *i).collect()
    }
}

pub(super) struct Settled {
    pub(super) intrinsics: Intrinsics,
    /// d ln f / d ln(f of the noise alone): the given coefficients pull the answer along with the focal length.
    pub(super) amplification: f64,
    pub(super) last_change: f64,
}

impl Pipeline<'_> {
    pub(super) fn run(&self, given: &[ImagePair], mut warnings: Vec<Warning>) -> Result<Calibration, Error> {
        let pairs: Vec<ImagePair> = given
            .iter()
            .map(|p| Ok(ImagePair { matches: validated(&p.matches, self.size)?, ..p.clone() }))
            .collect::<Result<_, Error>>()?;
        if let [only] = pairs.as_slice()
            && only.matches.len() < 4
        {
            return Err(Error::TooFewMatches {
                from: self.names[only.from].clone(),
                to: self.names[only.to].clone(),
                given: given[0].matches.len(),
                found: only.matches.len(),
            });
        }
        if self.options.method == Method::Rotating {
            return self.run_rotating(pairs, warnings);
        }
        let trusted = self.options.pairs.is_some();
        if self.options.distortion.is_none() {
            if self.options.lens != LensModel::None {
                return self.run_unknown_lens(pairs, trusted, warnings);
            }
            let results = self.homographies(&pairs, None);
            let chosen = match self.choose(&results, &pairs, trusted, &KnownLens::NotModelled)? {
                Scenario::Motions(chosen) => chosen,
                Scenario::Turning(turning) => {
                    return self.conclude_turning(pairs, results, &turning, warnings, &KnownLens::NotModelled, None);
                }
            };
            let (pairs, results) = self.sharpen(pairs, results, &chosen.used(), None);
            return self.conclude(&pairs, &results, chosen.refreshed(&results), warnings, &KnownLens::NotModelled);
        }
        // The coefficients act on coordinates divided by the focal length, which is not known yet: start from a middling
        // one, then once more with the result; the fixed point is found on the inliers (see `settle`).
        let [cx, cy] = self.options.principal_point_px.unwrap_or(self.size.centre_px());
        let mut lens = Lens {
            distortion: self.options.distortion,
            intrinsics: Intrinsics::square(self.size.width.max(self.size.height) as f64, cx, cy),
        };
        let mut amplification = 1.0;
        if self.options.method == Method::Joint {
            // Which scene it is does not hang on the exact lens.
            let results = self.homographies(&pairs, Some(&lens));
            if let Ok(Scenario::Turning(turning)) = self.choose(&results, &pairs, trusted, &KnownLens::Given(lens)) {
                let given = KnownLens::Given(lens);
                return self.conclude_turning(pairs, results, &turning, warnings, &given, Some(&lens));
            }
        }
        for _ in 0..2 {
            let results = self.homographies(&pairs, Some(&lens));
            let used = self.select(&results, &pairs, trusted)?.used();
            let settled = settle(lens, |lens| self.intrinsics_with(&pairs, &results, &used, lens))?;
            lens.intrinsics = settled.intrinsics;
            amplification = settled.amplification;
        }
        let results = self.homographies(&pairs, Some(&lens));
        let chosen = self.select(&results, &pairs, trusted)?;
        let (pairs, results) = self.sharpen(pairs, results, &chosen.used(), Some(&lens));
        let settled = settle(lens, |lens| self.intrinsics_with(&pairs, &results, &chosen.used(), lens))?;
        lens.intrinsics = settled.intrinsics;
        if settled.last_change > 1e-6 {
            warnings.push(Warning::DistortionNotConverged { relative_change: settled.last_change });
        }
        let results = self.refit_all(&pairs, results, &lens);
        let mut out = self.conclude(&pairs, &results, chosen.refreshed(&results), warnings, &KnownLens::Given(lens))?;
        if out.fit.refinement.is_none() {
            super::report::amplify(&mut out, amplification.max(settled.amplification));
        }
        Ok(out)
    }

    /// Plane-normal motions, or a camera that turns on the spot about any axes where that explains more of the images.
    pub(super) fn choose(
        &self,
        results: &[PairResult],
        pairs: &[ImagePair],
        trusted: bool,
        known: &KnownLens,
    ) -> Result<Scenario, Error> {
        let selected = self.select(results, pairs, trusted);
        if trusted || self.options.method == Method::Linear {
            return selected.map(Scenario::Motions);
        }
        // A pan about one axis is explained by both, and then it is motions of one attitude, which is more to know.
        let used = selected.as_ref().map_or(Vec::new(), Chosen::used);
        let joined = images_of(&used, pairs).len();
        let explains_more =
            |t: &Turning| t.images > joined || (t.images == joined && 4 * used.len() < 3 * t.used.len());
        match self.turning(pairs, results, known) {
            Some(turning) if explains_more(&turning) => Ok(Scenario::Turning(turning)),
            _ => selected.map(Scenario::Motions),
        }
    }

    /// Consistent motions among the pairs with circular points: indices of pairs, and a verdict each.
    pub(super) fn select(&self, results: &[PairResult], pairs: &[ImagePair], trusted: bool) -> Result<Chosen, Error> {
        let frame = self.frame();
        let motions: Vec<(usize, Motion)> = results
            .iter()
            .enumerate()
            .filter_map(|(i, r)| {
                let (robust, geometry) = r.outcome.as_ref().ok()?;
                let points = robust.inliers.iter().map(|&k| frame.from_pixel(&pairs[i].matches[k].a));
                let sides = if geometry.minor_side(points) > MINOR_SIDE { Sides::Both } else { Sides::One };
                Some((i, Motion { from: pairs[i].from, to: pairs[i].to, geometry: geometry.clone(), sides }))
            })
            .collect();
        if motions.is_empty() {
            return Err(self.why_nothing(results));
        }
        let bare: Vec<Motion> = motions.iter().map(|(_, m)| m.clone()).collect();
        if trusted || bare.len() == 1 {
            let verdicts = vec![Verdict::Accepted; bare.len()];
            return Ok(Chosen { motions, verdicts });
        }
        let search = |sigma_deg: f64| {
            let consistency = ConsistencyOptions {
                attitude_sigma_rad: self.options.attitude_sigma_deg.unwrap_or(0.0).max(sigma_deg).to_radians(),
                k1_sigma: SEARCH_K1_SIGMA,
                direction_sigma: SEARCH_DIRECTION_SIGMA,
                principal_point_sigma: SEARCH_PRINCIPAL_POINT_SIGMA * self.size.width as f64 / frame.scale_px,
                aspect: self.options.aspect.unwrap_or(1.0),
                gate: MOTION_GATE,
            };
            find_consistent(&bare, &consistency)
        };
        // A carrier that pitches or an arm that is not quite aligned: the axes may stray more than is usual.
        let mut selection = search(SEARCH_ATTITUDE_SIGMAS_DEG[0]);
        for sigma_deg in &SEARCH_ATTITUDE_SIGMAS_DEG[1..] {
            if selection.log_odds >= selection.needed_log_odds || self.options.attitude_sigma_deg.is_some() {
                break;
            }
            let wider = search(*sigma_deg);
            if wider.log_odds > selection.log_odds {
                selection = wider;
            }
        }
        // Of two motions that disagree the better one is used, with a warning; from three on, agreement is asked for.
        if bare.len() >= 3 && selection.log_odds < selection.needed_log_odds {
            let agreeing = selection.verdicts.iter().filter(|v| **v == Verdict::Accepted).count();
            return Err(Error::NoUsableMotion {
                pairs: bare.len(),
                reason: format!(
                    "of the {} pairs that show a turning plane the best set that agrees on one camera has {agreeing}, no more than \
                     coincidence gives (log odds {:.1}, {:.1} needed): these are not turns about the floor's normal, or the lens \
                     distortion is large",
                    bare.len(),
                    selection.log_odds,
                    selection.needed_log_odds
                ),
                remedies: vec![
                    Remedy::DoNotTilt,
                    Remedy::NamePairs,
                    Remedy::GiveLensCoefficients,
                    Remedy::GiveAttitudeSigma,
                ],
            });
        }
        let verdicts = selection.verdicts;
        Ok(Chosen { motions, verdicts })
    }

    /// The camera of the motions `used` (indices of pairs) after undoing the distortion of `lens` anew on their inliers.
    pub(super) fn refit_camera(
        &self,
        pairs: &[ImagePair],
        results: &[PairResult],
        used: &[usize],
        lens: &Lens,
        options: &CameraOptions,
    ) -> Result<CameraSolution, Error> {
        let motions: Vec<Motion> = used
            .par_iter()
            .filter_map(|&i| {
                let (robust, _) = results[i].outcome.as_ref().ok()?;
                let estimate = self.refit(&pairs[i], robust, lens)?;
                let geometry = from_homography(&estimate).ok()?;
                Some(Motion { from: pairs[i].from, to: pairs[i].to, geometry, sides: Sides::One })
            })
            .collect();
        if motions.is_empty() && !used.is_empty() {
            let d = &self.options.distortion;
            return Err(Error::InvalidOption(format!(
                "the lens distortion k1 = {}, k2 = {} cannot be undone where the matches are: the lens folds over inside the image. \
                 Check the sign and size of the coefficients",
                d.k1, d.k2
            )));
        }
        solve_camera(&motions, &self.frame(), options)
    }

    fn intrinsics_with(
        &self,
        pairs: &[ImagePair],
        results: &[PairResult],
        used: &[usize],
        lens: &Lens,
    ) -> Result<Intrinsics, Error> {
        Ok(self.refit_camera(pairs, results, used, lens, &self.options.camera(self.size))?.intrinsics)
    }
}

/// The camera that, used to undo the given distortion, comes out again: Steffensen's iteration on ln f. `solve` gives the camera
/// of matches undone by a lens.
pub(super) fn settle(start: Lens, solve: impl Fn(&Lens) -> Result<Intrinsics, Error>) -> Result<Settled, Error> {
    let mut lens = start;
    let mut slope: f64 = 0.0;
    let mut last: Option<(f64, f64)> = None;
    let mut last_change = f64::INFINITY;
    for _ in 0..25 {
        let solved = solve(&lens)?;
        let (input, output) = (lens.intrinsics.fx.ln(), solved.fx.ln());
        if let Some((last_input, last_output)) = last
            && (input - last_input).abs() > 1e-7
        {
            slope = ((output - last_output) / (input - last_input)).clamp(-3.0, 0.95);
        }
        last = Some((input, output));
        let k = &lens.intrinsics;
        let shift = (solved.cx - k.cx).abs().max((solved.cy - k.cy).abs()) / k.fx;
        last_change = (output - input).abs().max(shift);
        // Newton on output(input) - input, not more than a factor of two at once.
        let step = ((output - input) / (1.0 - slope)).clamp(-0.7, 0.7);
        let factor = (input + step - output).exp();
        lens.intrinsics =
            Intrinsics { fx: solved.fx * factor, fy: solved.fy * factor, skew: solved.skew * factor, ..solved };
        if last_change < 1e-10 {
            break;
        }
    }
    Ok(Settled { intrinsics: lens.intrinsics, amplification: (1.0 / (1.0 - slope)).max(1.0), last_change })
}
