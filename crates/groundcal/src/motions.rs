//! Which pairs of views are plane-normal motions.
//!
//! The largest set of motions whose circular points agree with one camera: every candidate founds a hypothesis, which
//! grows by the candidate that one camera explains best (logarithm of the odds of "on the conic of this camera", with the
//! camera's own uncertainty, against "anywhere"), is refitted after each, and is scored by the sum of these. An image has
//! one attitude, so motions that share an image must have the same circular point.
//!
//! A head that tilts about its optical centre also gives circular points on the conic, those of the planes across its tilt
//! axis. They are told from the floor's by the horizon: a floor lies on one side of it. Motions with points on both sides
//! (far scenes, a camera turning on the spot) are taken only where the floor does not explain the images.

use nalgebra::{Matrix4, SMatrix};

use crate::{
    absolute_conic::{ConicSolution, Parameters, Priors, WeightedPoint, agreement, intrinsics_of, refine},
    attitude_groups::{DIFFERENT_ATTITUDE, Motion, Sides, attitude_distance},
};

/// Options of [`find_consistent`].
#[derive(Debug, Clone, Copy)]
pub struct ConsistencyOptions {
    /// Standard deviation of each view's attitude about the axes across the floor's normal, in radians.
    pub attitude_sigma_rad: f64,
    /// Standard deviation of a radial distortion k1 that was not undone.
    pub k1_sigma: f64,
    /// Standard deviation of each tangent coordinate of a circular point for other faults of the model.
    pub direction_sigma: f64,
    /// Standard deviation of the principal point from the frame's origin, frame units.
    pub principal_point_sigma: f64,
    /// Expected fy / fx.
    pub aspect: f64,
    /// Squared distance (two degrees of freedom) beyond which a motion disagrees.
    pub gate: f64,
}

/// What became of a candidate.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Verdict {
    /// In the consistent set.
    Accepted,
    /// Its points lie on both sides of the horizon it implies, where a floor explains the others.
    WrongSides,
    /// Its circular point is this many standard deviations off the conic of the others.
    Disagrees {
        /// Square root of the Mahalanobis distance.
        sigmas: f64,
    },
    /// An accepted motion gives one of its images another attitude.
    OtherAttitude {
        /// Index of the accepted motion.
        motion: usize,
        /// The image they share.
        image: usize,
        /// Square root of the Mahalanobis distance between the circular points.
        sigmas: f64,
    },
}

/// Odds (logarithm) given beforehand to a pair of images that follow each other: people take the two images of a motion one
/// after the other. Any other pair has odds of one to the number of pairs tried, so that chance agreement of one among many
/// counts for nothing.
const NEIGHBOUR_LOG_ODDS: f64 = 0.0;

struct Hypothesis {
    members: Vec<usize>,
    score: f64,
    solution: ConicSolution,
}

struct Search<'a> {
    motions: &'a [Motion],
    priors: Priors,
    options: &'a ConsistencyOptions,
    /// Circular points with their covariance for a middling camera.
    reference: Vec<WeightedPoint>,
    /// conflict[i][j]: squared attitude distance of motions that share an image; not a number otherwise (found when asked
    /// for).
    conflict: Vec<Vec<f64>>,
}

/// The widest spread of focal lengths allowed for in the search alone: fx is 0.9 of the mean side, times or over 3 (two
/// standard deviations).
const SEARCH_LN_F: (f64, f64) = (0.6, 0.55);

impl Search<'_> {
    /// A motion's circular point with its covariance, all but the distortion.
    fn undistorted(&self, index: usize, p: &Parameters) -> WeightedPoint {
        let point = self.motions[index].geometry.circular_point.clone();
        let covariance = point.total_covariance(&intrinsics_of(p), self.options.attitude_sigma_rad)
            + Matrix4::from_diagonal_element(self.options.direction_sigma.powi(2));
        WeightedPoint { point, covariance }
    }

    /// The same with the distortion as noise of its own.
    fn weighted(&self, index: usize, p: &Parameters) -> WeightedPoint {
        let mut weighted = self.undistorted(index, p);
        if let Some(shift) = weighted.point.by_k1 {
            weighted.covariance += shift * shift.transpose() * self.options.k1_sigma.powi(2);
        }
        weighted
    }

    fn solve(&self, members: &[usize], start: &Parameters) -> Option<ConicSolution> {
        let points: Vec<WeightedPoint> = members.iter().map(|&i| self.weighted(i, start)).collect();
        refine(&points, start, [true, true, true, true, false], &self.priors)
    }

    fn found(&self, seed: usize) -> Option<ConicSolution> {
        let mut best: Option<ConicSolution> = None;
        for f in [0.9f64, 1.8, 3.6] {
            let start = Parameters::from([f.ln(), self.options.aspect.ln(), 0.0, 0.0, 0.0]);
            let Some(out) = self.solve(&[seed], &start) else { continue };
            if best.as_ref().is_none_or(|b| out.chi_squared < b.chi_squared) {
                best = Some(out);
            }
        }
        best
    }

    fn log_odds_beforehand(&self, index: usize) -> f64 {
        let m = &self.motions[index];
        if m.to.abs_diff(m.from) == 1 { NEIGHBOUR_LOG_ODDS } else { -(self.motions.len() as f64).ln() }
    }

    /// Whether a candidate contradicts the members. Images joined by motions share one attitude, so every candidate among
    /// them, member or not, must have the circular point of the one to be added: of three images of which two share an
    /// attitude, the two false pairs may well agree with each other, but not with the true one.
    fn conflicts(&self, index: usize, members: &[usize]) -> bool {
        let new = &self.motions[index];
        let mut images = std::collections::BTreeSet::from([new.from, new.to]);
        let mut grew = true;
        while grew {
            let before = images.len();
            for m in members.iter().map(|&m| &self.motions[m]) {
                if images.contains(&m.from) || images.contains(&m.to) {
                    images.extend([m.from, m.to]);
                }
            }
            grew = images.len() > before;
        }
        let among = |m: &Motion| images.contains(&m.from) && images.contains(&m.to);
        let others = self.motions.iter().enumerate().filter(|(i, m)| *i != index && among(m));
        others.into_iter().any(|(i, _)| self.distance(index, i) > DIFFERENT_ATTITUDE)
    }

    fn distance(&self, a: usize, b: usize) -> f64 {
        let known = self.conflict[a][b];
        if known.is_nan() {
            attitude_distance(&self.reference[a], &self.reference[b], self.options.k1_sigma)
        } else {
            known
        }
    }

    fn grow(&self, seed: usize) -> Option<Hypothesis> {
        // Far points may lie on one side of the horizon by chance; points of a floor never lie on both.
        let floor = self.motions[seed].sides == Sides::One;
        let suits = |i: usize| !floor || self.motions[i].sides == Sides::One;
        let mut solution = self.found(seed)?;
        if solution.chi_squared > 2.0 * self.options.gate {
            return None;
        }
        let mut members = vec![seed];
        let mut score = self.log_odds_beforehand(seed);
        loop {
            let best = (0..self.motions.len())
                .filter(|&i| suits(i) && !members.contains(&i) && !self.conflicts(i, &members))
                .filter_map(|i| {
                    let w = self.weighted(i, &solution.parameters);
                    let (distance, odds) = agreement(&solution.parameters, &solution.covariance, &w)?;
                    (distance < self.options.gate).then_some((i, odds + self.log_odds_beforehand(i)))
                })
                .max_by(|a, b| a.1.total_cmp(&b.1).then(b.0.cmp(&a.0)));
            let Some((index, gain)) = best.filter(|(_, gain)| *gain > 0.0) else { break };
            members.push(index);
            let Some(next) = self.solve(&members, &solution.parameters) else {
                members.pop();
                break;
            };
            // Within the gate one by one and yet not together: a coincidence.
            if next.chi_squared > self.options.gate * members.len() as f64 {
                members.pop();
                break;
            }
            solution = next;
            score += gain;
        }
        Some(Hypothesis { members, score, solution })
    }
}

/// The largest consistent set.
#[derive(Debug, Clone, PartialEq)]
pub struct Selection {
    /// One a motion.
    pub verdicts: Vec<Verdict>,
    /// Logarithm of the odds that the set is no coincidence.
    pub log_odds: f64,
    /// What coincidence among as many candidates reaches: a set with less is not to be trusted.
    pub needed_log_odds: f64,
}

/// Finds the largest consistent set. Deterministic.
pub fn find_consistent(motions: &[Motion], options: &ConsistencyOptions) -> Selection {
    // Each of n candidates may found a set, and each set has n to choose from.
    let needed_log_odds = 2.0 * (motions.len().max(1) as f64).ln();
    if motions.is_empty() {
        return Selection { verdicts: Vec::new(), log_odds: 0.0, needed_log_odds };
    }
    let sigma = options.principal_point_sigma;
    let priors =
        Priors([Some(SEARCH_LN_F), Some((options.aspect.ln(), 0.01)), Some((0.0, sigma)), Some((0.0, sigma)), None]);
    let reference = Parameters::from([SEARCH_LN_F.0, options.aspect.ln(), 0.0, 0.0, 0.0]);
    let mut search = Search { motions, priors, options, reference: Vec::new(), conflict: Vec::new() };
    search.reference = (0..motions.len()).map(|i| search.undistorted(i, &reference)).collect();
    let shares = |a: &Motion, b: &Motion| [a.from, a.to].into_iter().find(|v| *v == b.from || *v == b.to);
    search.conflict = (0..motions.len())
        .map(|i| {
            (0..motions.len())
                .map(|j| match shares(&motions[i], &motions[j]) {
                    Some(_) if i != j => {
                        attitude_distance(&search.reference[i], &search.reference[j], options.k1_sigma)
                    }
                    _ => f64::NAN,
                })
                .collect()
        })
        .collect();
    use rayon::prelude::*;
    let hypotheses: Vec<Option<Hypothesis>> =
        (0..motions.len()).into_par_iter().map(|seed| search.grow(seed)).collect();
    // The earliest seed on a tie, whatever the threads did.
    let best_of = |sides: Sides| {
        let seeded = hypotheses.iter().enumerate().filter(|(seed, _)| motions[*seed].sides == sides);
        seeded.filter_map(|(_, h)| h.as_ref()).reduce(|best, next| if next.score > best.score { next } else { best })
    };
    let images = |h: &Hypothesis| {
        let all: std::collections::BTreeSet<usize> =
            h.members.iter().flat_map(|&m| [motions[m].from, motions[m].to]).collect();
        all.len()
    };
    let best = match (best_of(Sides::One), best_of(Sides::Both)) {
        (Some(floor), Some(far)) => Some(if 2 * images(floor) >= images(far) { floor } else { far }),
        (floor, far) => floor.or(far),
    };
    let Some(best) = best else {
        let verdicts = vec![Verdict::Disagrees { sigmas: f64::INFINITY }; motions.len()];
        return Selection { verdicts, log_odds: f64::NEG_INFINITY, needed_log_odds };
    };
    let verdicts = (0..motions.len())
        .map(|i| {
            if best.members.contains(&i) {
                return Verdict::Accepted;
            }
            if motions[i].sides == Sides::Both && motions[best.members[0]].sides == Sides::One {
                return Verdict::WrongSides;
            }
            let clash = best
                .members
                .iter()
                .filter(|&&m| search.conflict[i][m] > DIFFERENT_ATTITUDE)
                .max_by(|&&a, &&b| search.conflict[i][a].total_cmp(&search.conflict[i][b]));
            if let Some(&m) = clash {
                let image = shares(&motions[i], &motions[m]).unwrap_or(motions[i].from);
                return Verdict::OtherAttitude { motion: m, image, sigmas: search.conflict[i][m].sqrt() };
            }
            let covariance: SMatrix<f64, 5, 5> = best.solution.covariance;
            let w = search.weighted(i, &best.solution.parameters);
            let distance = agreement(&best.solution.parameters, &covariance, &w).map_or(f64::INFINITY, |(d, _)| d);
            Verdict::Disagrees { sigmas: distance.sqrt() }
        })
        .collect();
    Selection { verdicts, log_odds: best.score, needed_log_odds }
}
