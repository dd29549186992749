//! What criticises the answer: each doubt as a warning, with numbers.

use crate::{
    calibrate::{
        attitude::Attitude, joint::JointSolution, lens_result::LensResult, names::Names, options::Method,
        solved::Solved, stage_options::StageOptions,
    },
    error::Error,
    geometry::{attitude::PARALLEL_HORIZONS_DEG, intrinsics::Intrinsics, lens::Lens, parameters::PriorParameter},
    ids::{ImageId, PairId, ViewId},
    numerics::statistics::chi_squared_survival,
    pairs::{known_lens::KnownLens, observation::PairObservation, placed_lens::PlacedLens},
    result::{Parameter, PrincipalPointDoubt, Prior, Warning},
    start::linear_camera::{CameraSolution, PRIOR_DECIDES},
};

/// Standard deviation of fx, in percent, from which on its interval is only roughly one.
const LARGE_UNCERTAINTY_PERCENT: f64 = 5.0;
/// Parameters whose priors, when they decide, are worth a warning: those of the aspect ratio and of the distortion decide for
/// good cameras too.
const WARNED_PRIORS: [PriorParameter; 4] =
    [PriorParameter::Fx, PriorParameter::Cx, PriorParameter::Cy, PriorParameter::Skew];
/// Standard deviation of the principal point, as a fraction of the width, below which it counts as known.
const KNOWN_PRINCIPAL_POINT: f64 = 0.01;
/// Share of the deviation of fx that comes from the lens, and how large that part must be in percent, to be worth a warning.
const MIN_LENS_SHARE: f64 = 0.8;
const MIN_LENS_PERCENT: f64 = 1.0;
/// A slight distortion, of either sign, that goes unmodelled.
const SLIGHT_K1: f64 = 0.05;
/// How far a stated focal length may be from the true one, of its logarithm: whole millimetres are 4 % at 13 mm, 16:9 cut out of 3:2 is 5 %,
/// lenses shorten by some per cent when they focus near.
const STATED_TOLERANCE: f64 = 0.1;
const UNEXPECTED_SIGMAS: f64 = 3.0;
/// Significance level, for all motions together, of an attitude error that the others do not explain.
const ATTITUDE_ERROR_P: f64 = 0.01;

/// What a lens taken to have no distortion would do if it had some: an unmodelled k1 of the true lens shows as the change that
/// undoing it would make, the other way round. `solve` gives the camera of matches undone by a lens.
///
/// # Errors
/// [`Error::Stopped`] and no other.
pub(super) fn unmodelled_distortion(
    pairs: &[PairObservation],
    lens: &KnownLens,
    k: &Intrinsics,
    solve: impl Fn(&PlacedLens) -> Result<Intrinsics, Error>,
) -> Result<Option<Warning>, Error> {
    if !matches!(lens, KnownLens::NotModelled) || pairs.iter().all(|pair| pair.matches.is_empty()) {
        return Ok(None);
    }
    let percent_if = |k1: f64| match solve(&PlacedLens { lens: Lens::radial(k1, 0.0), intrinsics: *k }) {
        Ok(undone) => Ok(Some(100.0 * (k.fx / undone.fx - 1.0))),
        Err(Error::Stopped) => Err(Error::Stopped),
        Err(_) => Ok(None),
    };
    Ok(Some(Warning::DistortionNotModelled {
        pincushion_percent: percent_if(SLIGHT_K1)?,
        barrel_percent: percent_if(-SLIGHT_K1)?,
    }))
}

/// All doubts about a camera, after those met on the way.
pub(super) fn doubts(
    solved: &Solved,
    lens: &LensResult,
    attitudes: &[Attitude],
    pairs: &[PairObservation],
    names: Names<'_>,
    stages: &StageOptions<'_>,
) -> Vec<Warning> {
    let mut warnings = Vec::new();
    warnings.extend(uncertain_lens(solved, lens));
    warnings.extend(static_backgrounds(pairs, names));
    warnings.extend(left_out(solved, pairs, names));
    // Views of no motion that see its floor, at attitudes of their own, check it and tell the principal point.
    let linked = solved.joint.as_ref().is_some_and(|joint| !joint.cross_links.is_empty()) || !solved.links.is_empty();
    warnings.extend((solved.used.len() == 1 && !linked).then_some(Warning::SingleMotion));
    if attitudes.len() > 1 || !linked {
        warnings.extend(alike_attitudes(solved, attitudes, stages));
    }
    warnings.extend(disagreement(solved));
    warnings.extend(deciding_priors(solved));
    let solution = &solved.solution;
    let percent = 100.0 * solution.covariance_px[(0, 0)].sqrt() / solution.intrinsics.fx;
    warnings.extend(large_uncertainty(percent));
    warnings.extend(stages.options.stated_focal_px.and_then(|stated| unexpected_focal_length(solution, stated)));
    if let Some(joint) = &solved.joint {
        warnings.extend(motions_with_attitude_errors(solved, joint, pairs, names));
        warnings.extend(joint.bundle.lever_arm.as_ref().and_then(|lever_arm| {
            let percent_of_distance = 100.0 * lever_arm.over_distance?;
            Some(Warning::LensOffAxis { percent_of_distance, fx_percent: 100.0 * lever_arm.ln_f_sigma })
        }));
        let floors = joint.floors;
        if floors.are_contradicted() {
            warnings.push(Warning::FloorsContradict { agree: floors.agree, contradict: floors.contradict });
        }
    }
    warnings
}

/// A deviation of fx, in percent, that makes its interval only roughly one.
pub(super) fn large_uncertainty(percent: f64) -> Option<Warning> {
    (percent > LARGE_UNCERTAINTY_PERCENT).then_some(Warning::LargeUncertainty { percent })
}

/// A focal length that is not the one that the pictures state.
fn unexpected_focal_length(solution: &CameraSolution, stated_px: f64) -> Option<Warning> {
    let fx = solution.intrinsics.fx;
    let sigma = solution.covariance_px[(0, 0)].max(0.0).sqrt() / fx;
    ((fx / stated_px).ln().abs() > STATED_TOLERANCE + UNEXPECTED_SIGMAS * sigma)
        .then(|| Warning::FocalLengthUnexpected { stated_px, percent: 100.0 * (fx / stated_px - 1.0) })
}

fn uncertain_lens(solved: &Solved, lens: &LensResult) -> Option<Warning> {
    let solution = &solved.solution;
    let percent = 100.0 * solved.lens_share * solution.covariance_px[(0, 0)].sqrt() / solution.intrinsics.fx;
    let k1_sigma = lens.sigma(Parameter::K1)?;
    (solved.lens_share > MIN_LENS_SHARE && percent > MIN_LENS_PERCENT)
        .then_some(Warning::DistortionUncertain { percent, k1_sigma })
}

fn static_backgrounds(pairs: &[PairObservation], names: Names<'_>) -> impl Iterator<Item = Warning> {
    pairs.iter().filter(|pair| pair.background() > 0).map(move |pair| Warning::StaticBackground {
        from: names.of(pair.from),
        to: names.of(pair.to),
        matches: pair.background(),
    })
}

/// Motions that the refinement did without.
fn left_out(solved: &Solved, pairs: &[PairObservation], names: Names<'_>) -> Vec<Warning> {
    let of = |id: PairId| Warning::MotionLeftOut { from: names.of(pairs[id].from), to: names.of(pairs[id].to) };
    solved.selection.iter().flat_map(|left| left.left_out().map(of)).collect()
}

/// One attitude, or several that differ in pitch alone.
fn alike_attitudes(solved: &Solved, attitudes: &[Attitude], stages: &StageOptions<'_>) -> Option<Warning> {
    let s = &solved.solution;
    let given = stages.options.principal_point_px.is_some();
    if attitudes.len() == 1 && !given {
        let doubt = s.estimated[2].then(|| PrincipalPointDoubt::new(s.intrinsics.fx, |r, c| s.covariance_px[(r, c)]));
        // A closed turn or the lens may tell the principal point all the same.
        let known = doubt.is_some_and(|d| d.sigma_px < KNOWN_PRINCIPAL_POINT * stages.size.width as f64);
        return (!known).then_some(Warning::SingleAttitude { motions: solved.used.len(), doubt });
    }
    if attitudes.len() < 2 || !s.estimated[2] {
        return None;
    }
    // Rolls modulo 180 degrees: the horizon is a line without direction.
    let apart = |a: f64, b: f64| {
        let d = (a - b).rem_euclid(std::f64::consts::PI);
        d.min(std::f64::consts::PI - d)
    };
    let rolls = || attitudes.iter().map(|a| a.roll_rad);
    let spread = rolls().flat_map(|a| rolls().map(move |b| apart(a, b))).fold(0.0, f64::max);
    (spread < PARALLEL_HORIZONS_DEG.to_radians())
        .then_some(Warning::ParallelHorizons { spread_deg: spread.to_degrees() })
}

/// Motions that disagree; rotations say it in their own words.
fn disagreement(solved: &Solved) -> Option<Warning> {
    let s = &solved.solution;
    (s.variance_inflation > 1.0 && solved.method != Method::Rotating).then(|| Warning::MotionsDisagree {
        chi_squared: s.chi_squared,
        degrees_of_freedom: s.degrees_of_freedom,
        widened: s.variance_inflation.sqrt(),
    })
}

fn deciding_priors(solved: &Solved) -> impl Iterator<Item = Warning> {
    let decides = |p: &&Prior| WARNED_PRIORS.contains(&p.parameter) && p.posterior_over_prior > PRIOR_DECIDES;
    solved.solution.priors.iter().filter(decides).map(|prior| Warning::PriorDecides {
        parameter: prior.parameter,
        posterior_over_prior: prior.posterior_over_prior,
    })
}

/// Motions whose views' attitude errors are larger than σ_a explains: chi-squared of their four errors.
fn motions_with_attitude_errors(
    solved: &Solved,
    joint: &JointSolution,
    pairs: &[PairObservation],
    names: Names<'_>,
) -> Vec<Warning> {
    let sigma = joint.bundle.attitude_sigma.sigma;
    let delta = |image: ImageId| {
        let view = joint.views.of(image)?;
        Some(joint.bundle.state.frames[view.index()].delta_rad)
    };
    let inconsistent = |&id: &PairId| {
        let pair = &pairs[id];
        let (a, b) = (delta(pair.from)?, delta(pair.to)?);
        let frames = joint.views.of_pair(pair)?.map(ViewId::index);
        let known = frames.iter().any(|frame| joint.bundle.outlier_frames.contains(frame));
        let squares = a.iter().chain(&b).map(|d| (d / sigma).powi(2)).sum::<f64>();
        let improbable = chi_squared_survival(squares, 4) < ATTITUDE_ERROR_P / solved.used.len() as f64;
        (known || sigma > 0.0 && improbable).then(|| Warning::MotionAttitudeError {
            from: names.of(pair.from),
            to: names.of(pair.to),
            apart_deg: (a[0] - b[0]).hypot(a[1] - b[1]).to_degrees(),
            sigma_deg: sigma.to_degrees(),
        })
    };
    solved.used.iter().filter_map(inconsistent).collect()
}
