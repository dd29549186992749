//! Priors against data: a prior that the matches contradict is released, and the camera estimated again without it.
//!
//! A prior that is wrong need not show in the residuals: attitude errors, which are estimated, follow the wrong camera (pixels of aspect 1.09 under
//! 1 ± 0.003 make σ_a 2.3 degrees of 0.01, and the aspect's own posterior hardly leaves its prior). So the estimate is made again
//! with the prior wide, from where it was and from a closed form without it, and the evidences of the two are compared
//! ([`crate::refine::evidence`]), in which a wide prior and attitude errors both have their price.
//!
//! Were the prior right, the evidence without it would exceed the evidence with it K times with a probability of at most 1 / K (the
//! mean of the ratio over data of the narrower model is 1: Markov's inequality).

use nalgebra::DMatrix;

use crate::{
    calibrate::departures::{departing, unasked_departures, with_departure},
    calibrate::fisheye::with_fisheye,
    calibrate::outlier_frames::{with_outlier_frame, with_wrong_motion},
    calibrate::refinement_input::{Refined, RefinementInput, RefinementOptions},
    calibrate::row_turn::with_row_turn,
    error::Error,
    geometry::{constraint::Constraint, parameters::PriorParameter},
    refine::{
        BundleOptions, DepartureKind, State,
        blocks::MATRIX,
        prospect::{Prospect, row_turn_of_all},
        turned::some_turned,
    },
    result::{PriorConflict, Warning},
    start::linear_camera::{GivenPrior, solve_camera_until, what_is_uncertain},
};

/// Odds from which on a prior is given up: of four that are tried at most 4 good cameras in 1,000 are flagged. (Measured: of 20 wrong aspect
/// ratios and skews the odds were 1e2, with a distance of more than 4, to 1e67; of 12 good cameras 1e-1 at most; none of 200 was flagged.)
pub(super) const RELEASE_ODDS: f64 = 1e3;
/// Standardised distance between a prior's mean and what the data say, from which on the prior is given up where the evidence is
/// not against it: 6 in 100,000 of a normal variable are beyond.
const MIN_CONFLICT_SIGMAS: f64 = 4.0;
/// Distance, in deviations of both together, between a prior and what the data say without it, below which they do not contradict each
/// other whatever the evidence says: then the other estimate is another minimum of the same model.
const MIN_CONTRADICTION_SIGMAS: f64 = 3.0;
/// Gain (twice the logarithm of the odds) from which on another minimum is one, and not the same reached otherwise.
const MIN_GAIN_OF_MINIMUM: f64 = 2.0;
/// Distance up to which a prior is not tried at all: its square is the gain where there are no attitude errors.
const SUSPECT_DISTANCE: f64 = 2.0;
/// Most priors that are released one after the other.
const MAX_RELEASED: usize = 4;

/// Standard deviation of ln(fy / fx) without its prior: pixels and resized pictures have ratios of a half to two.
pub(super) const WIDE_LN_ASPECT: f64 = 0.5;
/// Of the principal point, as a fraction of the width: cropped pictures.
const WIDE_PRINCIPAL_POINT: f64 = 0.5;
/// Of the skew, as a fraction of f: sheared scans.
const WIDE_SKEW: f64 = 0.05;
/// Factor on the deviations of the lens's numbers.
const WIDER_LENS: f64 = 10.0;

/// Numbers of the camera that are released together.
const RELEASES: [&[usize]; 5] = [&[1], &[4], &[2, 3], &[5, 6], &[7, 8]];

/// Places of a camera's block in the order of [`PriorParameter::ALL`].
const ASPECT: usize = 1;
const SKEW: usize = 4;
const DECENTRING: usize = 7;

/// Releases the priors that the tracks refined on contradict. With it whether anything is another than before.
///
/// # Errors
/// [`Error::Stopped`] and no other: where nothing better is found the refinement stands.
pub(super) fn release_contradicted_priors(
    input: &RefinementInput<'_>,
    mut refined: Refined,
) -> Result<(Refined, bool), Error> {
    let asked = refined.options.bundle.clone();
    let (mut changed, mut open) = (false, Vec::new());
    for _ in 0..MAX_RELEASED {
        match best_alternative(input, &refined)? {
            (Some(without), _) => (refined, changed) = (without, true),
            (None, prospects) => {
                open = prospects;
                break;
            }
        }
    }
    if !changed {
        return Ok((Refined { open, ..refined }, false));
    }
    // What was tried roughly and found better is now done with all care.
    let mut options = refined.options.clone();
    options.bundle = options.bundle.with_thoroughness_of(&asked);
    let starts = vec![refined.joint.bundle.state.clone()];
    let again = input.refined_again(&refined, refined.solution.clone(), options, starts)?;
    Ok((Refined { open, ..again }, true))
}

/// Odds beforehand against each alternative: that one scene in ten departs from the model in one of eight ways.
const ODDS_AGAINST: f64 = 80.0;
/// Odds of the images from which on an alternative counts: of 258 refinements of well-specified scenes 2.3 % have one. What they say nothing of has odds of 1.
const OPEN_ODDS: f64 = 4.0;
/// Factor on an error bar from which on it is said why. (Of the same 258 1.9 % have more.)
const WORTH_SAYING: f64 = 1.5;

/// Adds to the error bars what the alternatives that were not taken have against them: the second moment about the answer of a mixture, in which
/// each that makes the images four times likelier and more has the weight that the evidence gives it (Hoeting et al. 1999, *Bayesian model averaging*).
///
/// ```text
/// C' = C + sum_k w_k (C_k + d_k d_kT),      w_k = E_k / (E_k + 80 E)
/// ```
pub(super) fn allow_for_open_alternatives(refined: &mut Refined) {
    let covariance = &refined.joint.bundle.cameras[0].covariance;
    let (numbers, _) = covariance.shape();
    let mut added = DMatrix::zeros(numbers, numbers);
    let turn = row_turn_of_all(&refined.joint.bundle);
    let of_turn = turn.iter().filter(|_| refined.row_turn.is_none());
    let of_turn = of_turn.map(|turn| (Alternative::Departing(DepartureKind::RowTurn).assumption(), &turn.prospect));
    let turned = some_turned(&refined.joint.bundle, &refined.joint.tracks, &refined.options.bundle);
    let of_turned = turned.iter().map(|prospect| ("no picture is turned by 180 degrees", prospect));
    let mut most: Option<(f64, &'static str, &Prospect)> = None;
    for (assumption, prospect) in
        refined.open.iter().map(|(assumption, p)| (*assumption, p)).chain(of_turn).chain(of_turned)
    {
        if prospect.gain < 2.0 * OPEN_ODDS.ln() || prospect.step.len() != numbers {
            continue;
        }
        let weight = 1.0 / (1.0 + ODDS_AGAINST * (-0.5 * prospect.gain).exp());
        let of_it = (&prospect.covariance + &prospect.step * prospect.step.transpose()) * weight;
        // What is less likely than the answer does not make it one that is not determined.
        let with = (covariance + &of_it).fixed_view::<MATRIX, MATRIX>(0, 0).into_owned();
        if weight < 0.5 && what_is_uncertain(&with, &refined.options.frame).is_some() {
            continue;
        }
        let share = widening(covariance, &of_it);
        added += of_it;
        if most.is_none_or(|(other, ..)| share > other) {
            most = Some((share, assumption, prospect));
        }
    }
    let widened = widening(covariance, &added);
    let open_assumption =
        most.filter(|_| widened > WORTH_SAYING).map(|(_, assumption, prospect)| Warning::AssumptionOpen {
            assumption: assumption.into(),
            twice_log_odds: prospect.gain,
            fx_percent: 100.0 * prospect.step[0].exp_m1(),
            widened,
        });
    // A turn that was found is held there.
    if let (Some(_), Some(turn)) = (refined.row_turn, &turn) {
        added += &turn.moved_by * turn.moved_by.transpose() * turn.variance;
    }
    // What is held has no error bar.
    for held in (0..numbers).filter(|&number| covariance[(number, number)] == 0.0) {
        added.row_mut(held).fill(0.0);
        added.column_mut(held).fill(0.0);
    }
    refined.joint.allow(&added);
    refined.open_assumption = open_assumption;
}

/// By how much the error bars of focal lengths and principal point are wider with what is added to their covariance, at most.
fn widening(covariance: &DMatrix<f64>, added: &DMatrix<f64>) -> f64 {
    let estimated = (0..MATRIX).filter(|&number| covariance[(number, number)] > 0.0);
    estimated.map(|n| (1.0 + added[(n, n)] / covariance[(n, n)]).sqrt()).fold(1.0, f64::max)
}

/// What may be wrong of a refinement, and how it is tried.
#[derive(Clone, Copy)]
enum Alternative {
    /// Priors of some numbers.
    Without(&'static [usize]),
    /// That pictures do not depart from each other.
    Departing(DepartureKind),
}

impl Alternative {
    /// What is assumed without it.
    fn assumption(self) -> &'static str {
        match self {
            Self::Without([ASPECT]) => "pixels are square",
            Self::Without([SKEW]) => "pixels have no skew",
            Self::Without([2, 3]) => "the principal point is near the middle",
            Self::Without([5, 6]) => "the lens bends no more than lenses do",
            Self::Without(_) => "the lens is centred as well as lenses are",
            Self::Departing(DepartureKind::Focal) => "all pictures have one focal length",
            Self::Departing(DepartureKind::RowTurn) => "the camera stood still while each picture was read out",
            Self::Departing(DepartureKind::Shift) => "no picture is shifted against the others",
        }
    }
}

/// Gain over what others promise from which on these are not tried in the same round: they are in the next, beside it.
const DECISIVE_GAIN: f64 = 100.0;

/// What each alternative that was tried promised, by its name.
type Prospects = Vec<(&'static str, Prospect)>;

/// The best refinement of those with one assumption less; `None`: none is better. Those that promise most are tried first.
/// With it what all promise.
fn best_alternative(input: &RefinementInput<'_>, refined: &Refined) -> Result<(Option<Refined>, Prospects), Error> {
    let mut best: Option<(f64, Refined)> = None;
    let needed = 2.0 * RELEASE_ODDS.ln();
    let offer = |best: &mut Option<(f64, Refined)>, found: Option<(f64, Refined)>| {
        if let Some((gain, other)) = found
            && best.as_ref().is_none_or(|(most, _)| gain > *most)
        {
            *best = Some((gain, other));
        }
    };
    offer(&mut best, with_fisheye(input, refined, needed)?);
    offer(&mut best, with_outlier_frame(input, refined, needed)?);
    offer(&mut best, with_row_turn(input, refined, needed)?);
    // A fisheye has no decentring.
    let releases = RELEASES.into_iter().filter(|numbers| numbers[0] < DECENTRING || !refined.has_fisheye_lens());
    let departures = DepartureKind::ALL.into_iter().map(Alternative::Departing);
    let mut promising: Vec<(f64, Alternative, RefinementOptions)> = Vec::new();
    let mut prospects = Vec::new();
    for alternative in releases.map(Alternative::Without).chain(departures) {
        input.observer.go_on()?;
        let options = match alternative {
            Alternative::Without(numbers) => released(refined, numbers),
            Alternative::Departing(kind) => departing(refined, kind),
        };
        let Some(options) = options else { continue };
        let prospect = refined.prospect(&options);
        let gain = prospect.as_ref().map_or(f64::INFINITY, |prospect| prospect.gain);
        prospects.extend(prospect.map(|prospect| (alternative.assumption(), prospect)));
        let asked =
            matches!(alternative, Alternative::Without(numbers) if distance_of(refined, numbers) > MIN_CONFLICT_SIGMAS);
        if asked || gain > 0.0 || !refined.is_nearly_linear() {
            promising.push((gain, alternative, options));
        }
    }
    promising.sort_by(|a, b| b.0.total_cmp(&a.0));
    for (kind, options) in unasked_departures(refined) {
        prospects.extend(refined.prospect(&options).map(|p| (Alternative::Departing(kind).assumption(), p)));
    }
    let (found, of_wrong_motions) = with_wrong_motion(input, refined, [2.0 * OPEN_ODDS.ln(), needed])?;
    offer(&mut best, found);
    prospects.extend(of_wrong_motions.into_iter().map(|p| ("each motion is a turn about the floor's normal", p)));
    for (prospect, alternative, options) in promising {
        if best.as_ref().is_some_and(|(gain, _)| *gain > prospect + DECISIVE_GAIN) {
            break;
        }
        let found = match alternative {
            Alternative::Without(numbers) => without_prior(input, refined, numbers, options)?,
            Alternative::Departing(kind) => with_departure(input, refined, kind, options, needed)?,
        };
        offer(&mut best, found);
    }
    Ok((best.map(|(_, other)| other), prospects))
}

/// The greatest distance between the priors of some numbers and what the data say of them.
fn distance_of(refined: &Refined, numbers: &[usize]) -> f64 {
    let unknowns = &refined.options.bundle.cameras[0];
    numbers.iter().filter_map(|&n| refined.joint.prior_conflict(unknowns, n)).fold(0.0, f64::max)
}

/// The refinement without the priors of some numbers, where the tracks contradict them; with it twice the logarithm of the odds.
fn without_prior(
    input: &RefinementInput<'_>,
    refined: &Refined,
    numbers: &[usize],
    options: RefinementOptions,
) -> Result<Option<(f64, Refined)>, Error> {
    let distance = distance_of(refined, numbers);
    let needed = if distance > MIN_CONFLICT_SIGMAS { 0.0 } else { 2.0 * RELEASE_ODDS.ln() };
    let mut starts: Vec<State> = vec![refined.joint.bundle.state.clone()];
    let closed_form = solve_camera_until(&input.motions, &options.frame, &options.camera, input.observer).ok();
    input.observer.go_on()?;
    // The closed form knows the lens of Brown and Conrady alone, and of the tracks those of the motions: with links between attitudes its
    // start is far from any minimum of theirs, and without them it has been tried.
    let of_motions = !refined.has_fisheye_lens() && refined.joint.cross_links.is_empty();
    let usual_lens = closed_form.as_ref().filter(|_| of_motions);
    starts.extend(usual_lens.and_then(|solution| input.start(solution, 1.0)));
    let solution = closed_form.unwrap_or_else(|| refined.solution.clone());
    let Some(mut without) = input.tried(refined, solution, options, starts)? else { return Ok(None) };
    let Some(gain) = without.gain_over(refined, needed) else { return Ok(None) };
    let found: Vec<PriorConflict> = numbers.iter().filter_map(|&n| conflict_of(refined, &without, n, gain)).collect();
    if found.iter().all(|c| c.standardised_distance() < MIN_CONTRADICTION_SIGMAS) {
        return same_prior_from(input, refined, &without);
    }
    without.conflicts.extend(found);
    Ok(Some((gain, without)))
}

/// The refinement with its priors as they are from where it came to without one of them, where that is better: it was another minimum,
/// not the prior, that made the difference.
fn same_prior_from(
    input: &RefinementInput<'_>,
    refined: &Refined,
    without: &Refined,
) -> Result<Option<(f64, Refined)>, Error> {
    let mut start = without.joint.bundle.state.clone();
    // What is held was perhaps free there.
    let (unknowns, held_at) = (&refined.options.bundle.cameras[0], &refined.joint.bundle.cameras[0].state.numbers());
    let numbers = start.cameras[0].numbers();
    let back = (0..numbers.len().min(held_at.len())).filter(|&n| !unknowns.is_free(n));
    start.cameras[0] = start.cameras[0].moved(back.map(|n| (n, held_at[n] - numbers[n])));
    let starts = vec![start];
    let again = input.tried(refined, refined.solution.clone(), refined.options.clone(), starts)?;
    Ok(again.and_then(|again| Some((again.gain_over(refined, MIN_GAIN_OF_MINIMUM)?, again))))
}

/// The options with the priors of some numbers wide; `None`: there is nothing to release, or no reason to.
fn released(refined: &Refined, numbers: &[usize]) -> Option<RefinementOptions> {
    // What is held has no distance, and an aspect ratio hides in attitude errors; the principal point and the lens do not.
    let hides = matches!(numbers, [ASPECT] | [SKEW]);
    if distance_of(refined, numbers) < SUSPECT_DISTANCE && !hides {
        return None;
    }
    let before = &refined.options;
    let mut options = before.clone();
    let unknowns = options.bundle.cameras.first_mut()?;
    let numbers_of_lens = refined.joint.bundle.cameras[0].state.count();
    let mut any = false;
    for &number in numbers.iter().filter(|n| **n < numbers_of_lens) {
        let held = !unknowns.is_free(number);
        // Only `auto` holds the skew because most cameras have none; elsewhere what is held is asked for.
        if held && !(number == SKEW && before.camera.constraint == Constraint::Auto) {
            continue;
        }
        let (mean, sigma) = match unknowns.prior(number) {
            Some(prior) => prior,
            None if held => (0.0, 0.0),
            None => continue,
        };
        let wide = match number {
            ASPECT => WIDE_LN_ASPECT,
            2 | 3 => 2.0 * WIDE_PRINCIPAL_POINT * unknowns.image_half_sides[0],
            SKEW => WIDE_SKEW * refined.joint.bundle.cameras[0].state.matrix[0].exp(),
            _ => WIDER_LENS * sigma,
        };
        if wide <= 1.5 * sigma || refined.conflicts.iter().any(|c| c.parameter == PriorParameter::ALL[number]) {
            continue;
        }
        any = true;
        unknowns.set_free(number, true);
        if number < 5 {
            unknowns.matrix_priors[number] = Some((mean, wide));
        } else {
            unknowns.lens_priors[number - 5] = Some((mean, wide));
        }
    }
    let prior = |unknowns: &BundleOptions, n: usize| unknowns.cameras[0].prior(n);
    let parameter = |n: usize| PriorParameter::ALL[n];
    for &number in numbers.iter().filter(|n| **n < 5) {
        let Some(given) = prior(&options.bundle, number).map(|p| in_pixels(parameter(number), p, &options)) else {
            continue;
        };
        options.camera.given.retain(|p| p.parameter != given.parameter);
        options.camera.given.push(given);
    }
    options.bundle = options.bundle.for_trial();
    any.then_some(options)
}

/// A prior of the refinement in the units of those that are given.
fn in_pixels(parameter: PriorParameter, (mean, sigma): (f64, f64), options: &RefinementOptions) -> GivenPrior {
    let frame = &options.frame;
    let (mean, sigma) = match parameter {
        PriorParameter::Fx => (mean.exp() * frame.scale_px, sigma * mean.exp() * frame.scale_px),
        PriorParameter::Aspect => (mean.exp(), sigma * mean.exp()),
        PriorParameter::Cx => (mean * frame.scale_px + frame.origin_px.x, sigma * frame.scale_px),
        PriorParameter::Cy => (mean * frame.scale_px + frame.origin_px.y, sigma * frame.scale_px),
        PriorParameter::Skew => (mean * frame.scale_px, sigma * frame.scale_px),
        PriorParameter::K1 | PriorParameter::K2 | PriorParameter::P1 | PriorParameter::P2 | PriorParameter::K3 => {
            (mean, sigma)
        }
    };
    GivenPrior { parameter, mean, sigma }
}

/// What is said of a prior that was released.
fn conflict_of(before: &Refined, after: &Refined, number: usize, gain: f64) -> Option<PriorConflict> {
    let parameter = PriorParameter::ALL[number];
    let camera = &after.joint.bundle.cameras[0];
    let prior = before.options.bundle.cameras[0].prior(number).unwrap_or((0.0, 0.0));
    let found = (*camera.state.numbers().get(number)?, camera.covariance[(number, number)].max(0.0).sqrt());
    let [prior, found] = [prior, found].map(|p| in_pixels(parameter, p, &after.options));
    Some(PriorConflict {
        parameter,
        mean: prior.mean,
        sigma: prior.sigma,
        found: found.mean,
        found_sigma: found.sigma,
        twice_log_odds: gain,
    })
}
