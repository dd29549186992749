//! The largest set of plane-normal motions that one camera explains.
//!
//! ```text
//! score of a set = Σ_i ( ln π N₂(r_i; 0, C_i)  +  ln m(ρ_i)  -  ln n )         needed: 3 + 2 ln n
//! m(ρ) = Σ_k share_k N(ln ρ; 0, s_k² + σ²) / N(ln ρ; 0, 0.3² + σ²)
//! ```
//!
//! Every candidate founds a set, for which the first term of its own is left out. The set grows by the candidate that its camera explains best: r
//! is the residual of the circular point on the camera's conic, C its covariance, the camera's own uncertainty included, and anywhere else r would
//! be uniform over the unit disc. It must lie within [`ConsistencyOptions::gate`], rᵀ C⁻¹ r, and its terms must add to the score. The camera is
//! refitted after each. n: candidates (left out for images that follow each other in a sequence); σ: standard deviation of ln ρ;
//! share_k, s_k: how cameras keep their height. An image has one attitude, so motions that share an image must have the same circular point.
//!
//! A member that keeps out others, which agree with the camera too and would add more, is left out for them ([`Search::exchanged`]).
//!
//! A head that tilts about its optical centre also gives circular points on the conic, those of the planes across its tilt
//! axis. They are told from the floor's by the horizon: a floor lies on one side of it. Motions with points on both sides
//! (far scenes, a camera turning on the spot) are taken only where the floor does not explain the images.

use std::collections::BTreeSet;

use nalgebra::Matrix4;
use rayon::prelude::*;

use crate::{
    error::Error,
    ids::ImageId,
    observer::Observer,
    select::attitude_groups::{DIFFERENT_ATTITUDE, HorizonSides, Motion, attitude_distance},
    start::absolute_conic::{ConicSolution, Parameters, Priors, WeightedPoint, agreement, intrinsics_of, refine},
};

/// Options of [`find_consistent`].
#[derive(Debug, Clone, Copy)]
pub(crate) struct ConsistencyOptions {
    /// Standard deviation of each view's attitude about the axes across the floor's normal, in radians.
    pub(crate) attitude_sigma_rad: f64,
    /// Standard deviation of a radial distortion k1 that was not undone.
    pub(crate) k1_sigma: f64,
    /// Standard deviation of each tangent coordinate of a circular point for other faults of the model.
    pub(crate) direction_sigma: f64,
    /// Standard deviation of the principal point from the frame's origin, frame units.
    pub(crate) principal_point_sigma: f64,
    /// Expected fy / fx.
    pub(crate) aspect: f64,
    /// Squared distance (two degrees of freedom) beyond which a motion disagrees.
    pub(crate) gate: f64,
    /// The images are in the order in which they were taken: neighbours are likelier to be motions than other pairs. The order of the files
    /// of an unordered set is none.
    pub(crate) sequence: bool,
}

/// What became of a candidate.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Verdict {
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
        image: ImageId,
        /// Square root of the Mahalanobis distance between the circular points.
        sigmas: f64,
    },
}

/// What a set must have beyond coincidence, 2 ln n of n candidates: odds of twenty to one. A single motion must have it of its height ratio.
pub(crate) const MARGIN_LOG_ODDS: f64 = 3.0;

/// Most members that a set is tried without.
const MAX_EXCHANGES: usize = 8;

/// How cameras keep their height between the two images of a motion: share of motions, standard deviation of ln ρ. Tripods moved on a
/// floor, robots on wheels and turntables keep it exactly (patches show ρ to 1e-5, features to 1e-3); what is carried keeps it to a few per
/// cent; cranes do not keep it.
const HEIGHT_RATIO_MIXTURE: [(f64, f64); 3] = [(0.5, 1e-3), (0.3, 0.02), (0.2, FREE_LN_HEIGHT_RATIO_SIGMA)];
/// Standard deviation of ln ρ for two views that tilt and move freely. Measured on views of a floor whose tilts differ by 0.1, 1 and 10
/// degrees: median |ρ - 1| 0.0016, 0.016 and 0.13, and within 0.001 of 1 in 34, 4 and 0.5 of 100.
const FREE_LN_HEIGHT_RATIO_SIGMA: f64 = 0.3;

/// Logarithm of how much likelier this ρ is for a motion than for a pair of views that tilt freely. A pair that tilted has any ratio: ρ
/// within its small bar of 1 speaks for a plane-normal motion by about a hundred to one, ρ off 1 for a tilt as much as for a crane.
pub(crate) fn height_log_odds(height_ratio: f64, height_ratio_sigma: f64) -> f64 {
    let ln_height_ratio = height_ratio.max(1e-3).ln();
    let noise = (height_ratio_sigma / height_ratio.max(1e-3)).powi(2);
    let density = |sigma: f64| {
        let variance = sigma * sigma + noise;
        (-0.5 * ln_height_ratio * ln_height_ratio / variance).exp() / variance.sqrt()
    };
    let free = density(FREE_LN_HEIGHT_RATIO_SIGMA).max(f64::MIN_POSITIVE);
    let motion: f64 = HEIGHT_RATIO_MIXTURE.iter().map(|(share, sigma)| share * density(*sigma)).sum();
    (motion / free).ln()
}

#[derive(Clone)]
struct Hypothesis {
    members: Vec<usize>,
    score: f64,
    solution: ConicSolution,
}

/// Gives the images of a motion, and all that are joined to either, one label.
fn join(labels: &mut [usize], motion: &Motion) {
    let (keep, change) = (labels[motion.from.index()], labels[motion.to.index()]);
    for label in labels.iter_mut().filter(|l| **l == change) {
        *label = keep;
    }
}

struct Search<'a> {
    motions: &'a [Motion],
    priors: Priors,
    options: &'a ConsistencyOptions,
    /// Squared attitude distances, seen through the focal length that the search begins with.
    distances: Vec<Vec<f64>>,
}

/// The widest spread of focal lengths allowed for in the search alone: fx is 0.9 of the mean side, times or over 3 (two
/// standard deviations).
const SEARCH_LN_F: (f64, f64) = (0.6, 0.55);

impl<'a> Search<'a> {
    fn new(motions: &'a [Motion], options: &'a ConsistencyOptions, observer: &dyn Observer) -> Result<Self, Error> {
        let sigma = options.principal_point_sigma;
        let aspect = options.aspect.ln();
        let priors = Priors([Some(SEARCH_LN_F), Some((aspect, 0.01)), Some((0.0, sigma)), Some((0.0, sigma)), None]);
        let reference = Parameters::from([SEARCH_LN_F.0, aspect, 0.0, 0.0, 0.0]);
        let mut search = Self { motions, priors, options, distances: Vec::new() };
        let points: Vec<WeightedPoint> = (0..motions.len()).map(|i| search.undistorted(i, &reference)).collect();
        let distances_from = |a: &WeightedPoint| {
            observer.go_on()?;
            Ok(points.iter().map(|b| attitude_distance(a, b, options.k1_sigma)).collect())
        };
        search.distances = points.par_iter().map(distances_from).collect::<Result<_, Error>>()?;
        Ok(search)
    }

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
        // Chance agreement of one among n counts for nothing; of two images taken one after the other it is no chance.
        let follow = self.options.sequence && m.to.index().abs_diff(m.from.index()) == 1;
        let order = if follow { 0.0 } else { -(self.motions.len() as f64).ln() };
        order + height_log_odds(m.geometry.height_ratio, m.geometry.height_ratio_sigma)
    }

    /// Whether a candidate contradicts a set; `labels` says of each image to which connected part of the set it belongs. Images that motions
    /// connect share one attitude. With the candidate its two parts become one, so every candidate between images of that part, in the set or
    /// not, must have the same circular point. (Of three images of which two share an attitude, the two wrong pairs may well agree with each
    /// other, but not with the right one.)
    fn conflicts(&self, index: usize, labels: &[usize]) -> bool {
        let new = &self.motions[index];
        let label = |image: ImageId| labels[image.index()];
        let joined = [label(new.from), label(new.to)];
        let among = |m: &Motion| joined.contains(&label(m.from)) && joined.contains(&label(m.to));
        self.motions
            .iter()
            .enumerate()
            .any(|(i, m)| i != index && among(m) && self.distances[index][i] > DIFFERENT_ATTITUDE)
    }

    /// What becomes of a candidate when this set is the answer.
    fn verdict(&self, index: usize, best: &Hypothesis) -> Verdict {
        let (motions, distances) = (self.motions, &self.distances[index]);
        if best.members.contains(&index) {
            return Verdict::Accepted;
        }
        if motions[index].sides == HorizonSides::Both && motions[best.members[0]].sides == HorizonSides::One {
            return Verdict::WrongSides;
        }
        let shared = |m: usize| {
            let (a, b) = (&motions[index], &motions[m]);
            [a.from, a.to].into_iter().find(|image| *image == b.from || *image == b.to)
        };
        let clash = best
            .members
            .iter()
            .filter_map(|&m| Some((m, shared(m)?)))
            .filter(|&(m, _)| distances[m] > DIFFERENT_ATTITUDE)
            .max_by(|(a, _), (b, _)| distances[*a].total_cmp(&distances[*b]));
        if let Some((motion, image)) = clash {
            return Verdict::OtherAttitude { motion, image, sigmas: distances[motion].sqrt() };
        }
        let weighted = self.weighted(index, &best.solution.parameters);
        let agreement = agreement(&best.solution.parameters, &best.solution.covariance, &weighted);
        Verdict::Disagrees { sigmas: agreement.map_or(f64::INFINITY, |(distance, _)| distance).sqrt() }
    }

    /// What a candidate adds to the score of a set with this camera; `None` where it does not agree with it, or adds nothing.
    fn gain(&self, index: usize, solution: &ConicSolution) -> Option<f64> {
        let weighted = self.weighted(index, &solution.parameters);
        let (distance, odds) = agreement(&solution.parameters, &solution.covariance, &weighted)?;
        let gain = odds + self.log_odds_beforehand(index);
        (distance < self.options.gate && gain > 0.0).then_some(gain)
    }

    /// The set without a member that keeps out candidates which agree with its camera and together count for more: a pair of two attitudes may by chance agree
    /// with the camera of the others, and then stands, taken in early, for a whole image's true pairs.
    fn exchanged(&self, mut best: Hypothesis, observer: &dyn Observer) -> Result<Hypothesis, Error> {
        let mut barred: Vec<usize> = Vec::new();
        while barred.len() < MAX_EXCHANGES {
            let kept_out = (0..self.motions.len()).filter(|i| !best.members.contains(i) && !barred.contains(i));
            let mut keeps_out = vec![0.0; self.motions.len()];
            for (i, gain) in kept_out.filter_map(|i| Some((i, self.gain(i, &best.solution)?))) {
                let of_its_images = |m: usize| {
                    let (a, b) = (&self.motions[i], &self.motions[m]);
                    [a.from, a.to].contains(&b.from) || [a.from, a.to].contains(&b.to)
                };
                let clashing = |m: &&usize| of_its_images(**m) && self.distances[i][**m] > DIFFERENT_ATTITUDE;
                best.members.iter().filter(clashing).for_each(|&m| keeps_out[m] += gain);
            }
            let most = (0..keeps_out.len())
                .filter(|&m| keeps_out[m] > 0.0)
                .reduce(|most, next| if keeps_out[next] > keeps_out[most] { next } else { most });
            let Some(most) = most else { break };
            barred.push(most);
            let seed = best.members.iter().copied().find(|m| *m != most);
            let other = seed.map(|seed| self.grow(seed, &barred, &[], observer)).transpose()?.flatten();
            match other.filter(|other| other.score > best.score) {
                Some(other) => best = other,
                None => break,
            }
        }
        Ok(best)
    }

    /// What each candidate that is open adds to a set with this camera, the most last.
    fn offers(&self, open: &[bool], solution: &ConicSolution) -> Vec<(usize, f64)> {
        let of = |index: usize| open[index].then(|| Some((index, self.gain(index, solution)?))).flatten();
        let mut offers: Vec<(usize, f64)> = (0..open.len()).into_par_iter().filter_map(of).collect();
        offers.sort_by(|a, b| a.1.total_cmp(&b.1).then(b.0.cmp(&a.0)));
        offers
    }

    /// The set that a candidate founds, of all but some; `None`, too, where it comes to be one that is known.
    fn grow(
        &self,
        seed: usize,
        barred: &[usize],
        known: &[Hypothesis],
        observer: &dyn Observer,
    ) -> Result<Option<Hypothesis>, Error> {
        // Far points may lie on one side of the horizon by chance; points of a floor never lie on both.
        let floor = self.motions[seed].sides == HorizonSides::One;
        let suits = |i: usize| !floor || self.motions[i].sides == HorizonSides::One;
        let Some(mut solution) = self.found(seed).filter(|s| s.chi_squared <= 2.0 * self.options.gate) else {
            return Ok(None);
        };
        let mut members = vec![seed];
        let mut score = self.log_odds_beforehand(seed);
        let images = self.motions.iter().map(|m| m.from.max(m.to).index() + 1).max().unwrap_or(0);
        let mut labels: Vec<usize> = (0..images).collect();
        join(&mut labels, &self.motions[seed]);
        // Out for good: what contradicts a set contradicts every larger one.
        let mut open: Vec<bool> =
            (0..self.motions.len()).map(|i| i != seed && suits(i) && !barred.contains(&i)).collect();
        let mut offers = self.offers(&open, &solution);
        while let Some((index, gain)) = offers.pop() {
            observer.go_on()?;
            open[index] = false;
            if self.conflicts(index, &labels) {
                continue;
            }
            members.push(index);
            let refitted = is_refitted(members.len());
            if refitted {
                let Some(next) = self.solve(&members, &solution.parameters) else {
                    members.pop();
                    continue;
                };
                // Within the gate one by one and yet not together: a coincidence.
                if next.chi_squared > self.options.gate * members.len() as f64 {
                    members.pop();
                    continue;
                }
                solution = next;
            }
            join(&mut labels, &self.motions[index]);
            score += gain;
            let of_known = |h: &Hypothesis| members[1..].iter().all(|m| h.members.contains(m));
            if members.len() == TELLING_MEMBERS && known.iter().any(of_known) {
                return Ok(None);
            }
            // What the others add changes with the camera alone.
            if refitted {
                offers = self.offers(&open, &solution);
            }
        }
        Ok(Some(Hypothesis { members, score, solution }))
    }
}

/// Members of a set that determine its camera: one more changes little, and sets that have them in common are much the same.
const TELLING_MEMBERS: usize = 12;

/// Whether the camera is solved for again with so many members: the more they are, the less one more changes.
fn is_refitted(members: usize) -> bool {
    const AFTER: usize = 8;
    let halved = (members / (8 * AFTER)).checked_ilog2().unwrap_or(0);
    members <= TELLING_MEMBERS || members.is_multiple_of(AFTER << halved)
}

/// The largest consistent set.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct ConsistentSet {
    /// One a motion.
    pub(crate) verdicts: Vec<Verdict>,
    /// Logarithm of the odds that the set is no coincidence.
    pub(crate) log_odds: f64,
    /// What coincidence among as many candidates reaches: a set with less is not to be trusted.
    pub(crate) needed_log_odds: f64,
}

/// Finds the largest consistent set. Deterministic.
///
/// # Errors
/// [`Error::Stopped`] and no other.
pub(crate) fn find_consistent(
    motions: &[Motion],
    options: &ConsistencyOptions,
    observer: &dyn Observer,
) -> Result<ConsistentSet, Error> {
    // Each of n candidates may found a set, and each set has n to choose from.
    let needed_log_odds = MARGIN_LOG_ODDS + 2.0 * (motions.len().max(1) as f64).ln();
    if motions.is_empty() {
        return Ok(ConsistentSet { verdicts: Vec::new(), log_odds: 0.0, needed_log_odds });
    }
    let search = Search::new(motions, options, observer)?;
    // A seed that a set has taken in would found much the same set.
    let mut hypotheses: Vec<Hypothesis> = Vec::new();
    for seed in 0..motions.len() {
        let taken = hypotheses.iter().any(|h| h.members.len() >= 4 && h.members.contains(&seed));
        if !taken {
            hypotheses.extend(search.grow(seed, &[], &hypotheses, observer)?);
        }
    }
    // The earliest seed on a tie, whatever the threads did.
    let best_of = |sides: HorizonSides| {
        let founded = hypotheses.iter().filter(|h| motions[h.members[0]].sides == sides);
        founded.reduce(|best, next| if next.score > best.score { next } else { best })
    };
    let images = |h: &Hypothesis| {
        let all: BTreeSet<ImageId> = h.members.iter().flat_map(|&m| [motions[m].from, motions[m].to]).collect();
        all.len()
    };
    let best = match (best_of(HorizonSides::One), best_of(HorizonSides::Both)) {
        (Some(floor), Some(far)) => Some(if 2 * images(floor) >= images(far) { floor } else { far }),
        (floor, far) => floor.or(far),
    };
    let best = best.cloned().map(|best| search.exchanged(best, observer)).transpose()?;
    let Some(best) = &best else {
        let verdicts = vec![Verdict::Disagrees { sigmas: f64::INFINITY }; motions.len()];
        return Ok(ConsistentSet { verdicts, log_odds: f64::NEG_INFINITY, needed_log_odds });
    };
    let verdicts = (0..motions.len()).map(|i| search.verdict(i, best)).collect();
    Ok(ConsistentSet { verdicts, log_odds: best.score, needed_log_odds })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        geometry::{frame::Frame, intrinsics::Intrinsics},
        numerics::statistics::CHI_SQUARED_2_999,
        observer::Silent,
        pairs::{
            observe::{ObserveOptions, observe},
            robust::RobustOptions,
        },
        synthetic::points::{MotionSpec, PointScene},
    };

    /// Turns of one attitude, in a row of images, and first of all one of another attitude between an image of the row and one outside.
    fn row_and_another() -> Vec<Motion> {
        let turn = |pitch: f64, roll: f64, degrees: f64| {
            MotionSpec::about_axis(pitch.to_radians(), roll.to_radians(), degrees.to_radians(), 0.3, 1.0)
        };
        let row = (0..6).map(|k| turn(46.0, 5.0, 30.0 + 2.0 * f64::from(k)));
        let scene =
            PointScene { motions: [turn(60.0, 35.0, 32.0)].into_iter().chain(row).collect(), ..PointScene::nominal(5) };
        let frame = Frame::new(scene.size, None);
        let [cx, cy] = scene.size.centre_px();
        let options = ObserveOptions {
            frame,
            nominal_camera: Intrinsics::square(scene.size.width as f64, cx, cy),
            min_matches: 6,
            from_elsewhere: true,
            robust: RobustOptions::default(),
            seed: 0,
        };
        let mut pairs = scene.pairs();
        let images = [(2, 7)].into_iter().chain((0..6).map(|k| (k, k + 1)));
        pairs.iter_mut().zip(images).for_each(|(pair, (from, to))| (pair.from, pair.to) = (from, to));
        let observed = observe(pairs, None, &options, &Silent).expect("not stopped");
        let motion = |pair: &crate::pairs::observation::PairObservation| {
            let geometry = pair.outcome.as_ref().expect("a turn").geometry.clone();
            Motion { from: pair.from, to: pair.to, geometry, sides: HorizonSides::One }
        };
        observed.iter().map(motion).collect()
    }

    #[test]
    fn a_member_that_keeps_out_two_that_agree_gives_way() {
        let motions = row_and_another();
        let options = ConsistencyOptions {
            attitude_sigma_rad: 0.001,
            k1_sigma: 0.05,
            direction_sigma: 1e-4,
            principal_point_sigma: 0.1,
            aspect: 1.0,
            gate: CHI_SQUARED_2_999,
            sequence: false,
        };
        let search = Search::new(&motions, &options, &Silent).expect("not stopped");
        let founded = search.grow(0, &[], &[], &Silent).expect("not stopped").expect("a set");
        // The row's two pairs of the image that it shares are kept out.
        let mut members = founded.members.clone();
        members.sort_unstable();
        assert_eq!(members, [0, 1, 4, 5, 6]);
        let exchanged = search.exchanged(founded, &Silent).expect("not stopped");
        let mut members = exchanged.members.clone();
        members.sort_unstable();
        assert_eq!(members, [1, 2, 3, 4, 5, 6]);
    }
}
