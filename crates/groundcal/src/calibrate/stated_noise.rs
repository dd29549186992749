//! Deviations that are stated of matches, against those that they have.
//!
//! ```text
//! ln L(α) = Σ_m ( -ln v_m - ½ min(d_m² / v_m, χ²) ),      v_m = s² σ_m^(2α),      s² = med(d² / σ^(2α)) / (2 ln 2)
//! ```
//!
//! d: Sampson distance of a match from the plane of its pair, found with the same α; σ: deviation stated, relative to that of the other matches. α = 1: as stated;
//! 0: all have one; ½: the differences are half as large. Matches that are said to be precise and are not draw the camera to themselves, and those of them that the
//! planes leave out hide by how much: bars from what is left were too small by a third.

use std::cmp::Reverse;

use rayon::prelude::*;

use crate::{
    calibrate::prior_conflicts::RELEASE_ODDS,
    error::Error,
    numerics::statistics::{CHI_SQUARED_2_999, median},
    observer::Observer,
    pairs::{
        correspondence::{ImagePair, PointMatch},
        observation::PairObservation,
        observe::{ObserveOptions, key_of, outcome_of_matches},
        placed_lens::PlacedLens,
        refine::to_frame,
        residual::PlaneMatch,
    },
    result::Warning,
};

/// Powers of the deviations stated that may be those that matches have.
const EXPONENTS: [f64; 3] = [1.0, 0.5, 0.0];
/// Largest over smallest deviation of a pair's matches from which on they are not all alike.
const MIN_RANGE: f64 = 1.2;
/// Pairs that are asked, those of most matches: thousands of matches.
const MAX_ASKED: usize = 30;

/// The deviations that the matches contradict, and what they have instead.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct ContradictedNoise {
    /// Power of the deviations stated.
    exponent: f64,
    /// Of it over the deviations as stated.
    twice_log_odds: f64,
}

impl ContradictedNoise {
    /// The pairs with the deviations that their matches have.
    pub(super) fn corrected(self, pairs: Vec<PairObservation>) -> Vec<ImagePair> {
        let of_pair = |pair: PairObservation| {
            let mut pair = pair.into_pair();
            pair.matches = with_exponent(&pair.matches, self.exponent);
            pair
        };
        pairs.into_iter().map(of_pair).collect()
    }

    pub(super) fn warning(self) -> Warning {
        Warning::StatedNoiseContradicted { exponent: self.exponent, twice_log_odds: self.twice_log_odds }
    }
}

fn with_exponent(matches: &[PointMatch], exponent: f64) -> Vec<PointMatch> {
    matches.iter().map(|m| PointMatch { sigma_px: m.sigma_px.powf(exponent), ..*m }).collect()
}

/// What the matches say against the deviations stated of them; `None` where that is nothing.
///
/// # Errors
/// [`Error::Stopped`] and no other.
pub(super) fn contradicted_noise(
    pairs: &[PairObservation],
    lens: Option<&PlacedLens>,
    options: &ObserveOptions,
    observer: &dyn Observer,
) -> Result<Option<ContradictedNoise>, Error> {
    if !options.from_elsewhere || lens.is_some_and(|lens| lens.lens.sees_behind()) {
        return Ok(None);
    }
    let varies = |pair: &&PairObservation| {
        let sigmas = || pair.matches.iter().map(|m| m.sigma_px);
        sigmas().fold(0.0, f64::max) > MIN_RANGE * sigmas().fold(f64::INFINITY, f64::min)
    };
    let mut asked: Vec<&PairObservation> = pairs.iter().filter(|pair| pair.plane().is_some()).filter(varies).collect();
    asked.sort_by_cached_key(|pair| (Reverse(pair.matches.len()), key_of(&pair.matches)));
    asked.truncate(MAX_ASKED);
    let scores: Vec<Vec<f64>> =
        asked.par_iter().map(|pair| log_likelihoods(pair, lens, options, observer)).collect::<Result<_, Error>>()?;
    let sum = |k: usize| scores.iter().map(|of_pair| of_pair[k]).sum::<f64>();
    let as_stated = sum(0);
    let others = (1..EXPONENTS.len()).map(|k| (EXPONENTS[k], 2.0 * (sum(k) - as_stated)));
    let best = others.max_by(|a, b| a.1.total_cmp(&b.1));
    Ok(best
        .filter(|(_, gain)| *gain > 2.0 * RELEASE_ODDS.ln())
        .map(|(exponent, twice_log_odds)| ContradictedNoise { exponent, twice_log_odds }))
}

/// Of the matches that any of the planes of a pair explains, under each of the [`EXPONENTS`].
fn log_likelihoods(
    pair: &PairObservation,
    lens: Option<&PlacedLens>,
    options: &ObserveOptions,
    observer: &dyn Observer,
) -> Result<Vec<f64>, Error> {
    let ideal = |m: &PointMatch| lens.map_or(Some(*m), |lens| lens.ideal_match(m));
    let matches: Vec<PointMatch> = pair.matches.iter().filter_map(ideal).collect();
    let in_frame = to_frame(&matches, &options.frame);
    let mut is_explained = vec![false; matches.len()];
    let mut found = Vec::new();
    for exponent in EXPONENTS {
        let matches = with_exponent(&matches, exponent);
        let again = ImagePair { from: pair.from.index(), to: pair.to.index(), matches };
        let plane = match outcome_of_matches(&again, None, options, observer)? {
            Ok(turning) => turning.plane,
            Err(refusal) => match refusal.plane {
                Some(plane) => *plane,
                None => return Ok(vec![0.0; EXPONENTS.len()]),
            },
        };
        plane.inliers.iter().for_each(|&k| is_explained[k] = true);
        let of_match = |(m, weighed): (&PointMatch, &PointMatch)| {
            m.sampson_squared(&plane.estimate.in_frame) / (weighed.sigma_px * weighed.sigma_px)
        };
        found.push(in_frame.iter().zip(&again.matches).map(of_match).collect::<Vec<f64>>());
    }
    let of_exponent = |(exponent, squares): (f64, &Vec<f64>)| {
        let explained = || (0..matches.len()).filter(|&k| is_explained[k]);
        let mut all: Vec<f64> = explained().map(|k| squares[k]).collect();
        let scale = (median(&mut all) / (2.0 * 2f64.ln())).max(f64::MIN_POSITIVE);
        let of = |k: usize| {
            let log_variance = scale.ln() + 2.0 * exponent * matches[k].sigma_px.ln();
            -log_variance - 0.5 * (squares[k] / scale).min(CHI_SQUARED_2_999)
        };
        explained().map(of).sum()
    };
    Ok(EXPONENTS.into_iter().zip(&found).map(of_exponent).collect())
}
