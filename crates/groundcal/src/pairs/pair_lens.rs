//! A radial distortion of each pair's own, of one parameter, undone in its matches (KZR 3.2), for comparison with what all pairs tell together
//! (`pairs::known_lens`). The model and both ways to its λ are those of [`crate::pairs::division`]; the centre of distortion is held
//! at the origin of the frame.

use nalgebra::Vector2;

use crate::{
    error::Error,
    geometry::{
        frame::Frame,
        homography::Homography,
        intrinsics::Intrinsics,
        lens::{Division, Lens},
    },
    numerics::statistics::median,
    observer::{Observer, Stage},
    pairs::{
        correspondence::{ImagePair, PointMatch},
        division::{DivisionModel, division_closed_form, refine_division},
        dlt::direct_linear_transformation,
        observation::{PairObservation, Refusal, RefusalKind, TurningPlane, turning_plane},
        observe::{OUTSIDE_MODEL_PX, ObserveOptions, outcome_of_matches},
        placed_lens::PlacedLens,
        refine::{HomographyEstimate, RefineOptions, to_frame},
    },
};

/// How [`Method::Kzr`](crate::result::Method::Kzr) corrects a radial distortion.
///
/// # Examples
/// ```
/// use groundcal::{Method, Options, RadialCorrection};
/// // The paper's method with its correction of a radial distortion, each pair by itself.
/// let options = Options { method: Method::Kzr, radial: RadialCorrection::PerPair, ..Options::default() };
/// assert_ne!(options.radial, RadialCorrection::None);
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum RadialCorrection {
    /// Not at all.
    #[default]
    None,
    /// λ minimised with each homography.
    PerPair,
    /// λ of each pair in closed form. Exact without noise, biased by it (by a quarter at 1 px): a start, not an answer.
    ClosedForm,
}

/// Times that matches on the plane and λ are found in turn: the first search takes what bends for outliers.
const ROUNDS: usize = 3;

/// How λ and homographies are found.
#[derive(Debug, Clone, Copy)]
pub(crate) struct PairLensOptions {
    pub(crate) correction: RadialCorrection,
    /// Whether the homographies are linear ones, every match with the same weight.
    pub(crate) linear: bool,
    pub(crate) observe: ObserveOptions,
}

/// The pairs as their own lenses' corrections show them, and the lens of the median λ; none where no pair tells one.
///
/// # Errors
/// [`Error::Stopped`] and no other: a pair that shows nothing says why.
pub(crate) fn correct_each(
    pairs: Vec<PairObservation>,
    options: &PairLensOptions,
    observer: &dyn Observer,
) -> Result<(Vec<PairObservation>, Option<PlacedLens>), Error> {
    let corrected = observer.map(Stage::Homographies, &pairs, |pair| corrected(pair, options, observer))?;
    let (pairs, lambdas): (Vec<_>, Vec<_>) = corrected.into_iter().unzip();
    let mut lambdas: Vec<f64> = lambdas.into_iter().flatten().collect();
    let lens = (!lambdas.is_empty()).then(|| placed(median(&mut lambdas), &options.observe.frame));
    Ok((pairs, lens))
}

/// The lens of a λ in the frame.
fn placed(lambda: f64, frame: &Frame) -> PlacedLens {
    let centre = frame.origin_px;
    PlacedLens {
        lens: Lens::Division(Division::new(lambda)),
        intrinsics: Intrinsics::square(frame.scale_px, centre.x, centre.y),
    }
}

fn corrected(
    pair: &PairObservation,
    options: &PairLensOptions,
    observer: &dyn Observer,
) -> Result<(PairObservation, Option<f64>), Error> {
    let mut pair = pair.clone();
    let mut found: Option<DivisionModel> = None;
    for _ in 0..ROUNDS {
        observer.go_on()?;
        let Some(on_plane) = on_moving_plane(&pair) else { break };
        let frame = &options.observe.frame;
        let Some(model) = lambda(&on_plane, frame, found, options.correction) else {
            let reason = "no radial distortion of one parameter makes a plane of its matches".to_string();
            pair.outcome = Err(Refusal::new(RefusalKind::NoPlane, reason, pair.plane().cloned()));
            return Ok((pair, None));
        };
        let lens = placed(model.lambda, frame);
        // A match that has no ideal point is moved out of every model's reach.
        let ideal =
            |m: &PointMatch| lens.ideal_match(m).unwrap_or(PointMatch { b: Vector2::repeat(OUTSIDE_MODEL_PX), ..*m });
        let matches = pair.matches.iter().map(ideal).collect();
        let straight = ImagePair { from: pair.from.index(), to: pair.to.index(), matches };
        pair.outcome = outcome_of_matches(&straight, None, &options.observe, observer)?;
        found = Some(model);
    }
    if let (Some(model), Ok(turning)) = (found, &pair.outcome) {
        pair.outcome = with_homography(&pair, turning, model, options);
    }
    Ok((pair, found.map(|model| model.lambda)))
}

/// The matches on the plane as they were seen, unless nothing moved.
fn on_moving_plane(pair: &PairObservation) -> Option<Vec<PointMatch>> {
    Some(pair.moving_plane()?.inliers.iter().map(|&k| pair.matches[k]).collect())
}

fn lambda(
    matches: &[PointMatch],
    frame: &Frame,
    before: Option<DivisionModel>,
    correction: RadialCorrection,
) -> Option<DivisionModel> {
    match correction {
        RadialCorrection::None => Some(DivisionModel::default()),
        RadialCorrection::ClosedForm => division_closed_form(matches, frame).map(|found| found.model),
        RadialCorrection::PerPair => {
            let found = refine_division(&[matches], frame, before, &RefineOptions::default());
            found.ok().map(|found| found.model)
        }
    }
}

/// The plane with the homography that was asked for. Its covariance is that of a homography minimised with λ: to first order the others
/// share it.
fn with_homography(
    pair: &PairObservation,
    turning: &TurningPlane,
    model: DivisionModel,
    options: &PairLensOptions,
) -> Result<TurningPlane, Refusal> {
    let frame = &options.observe.frame;
    let mut plane = turning.plane.clone();
    let seen: Vec<PointMatch> = plane.inliers.iter().map(|&k| pair.matches[k]).collect();
    if let Ok(minimised) = refine_division(&[&seen], frame, Some(model), &RefineOptions::default())
        && let [together] = minimised.homographies.as_slice()
    {
        plane.estimate = match options.correction {
            RadialCorrection::PerPair => together.clone(),
            _ => HomographyEstimate {
                in_frame: plane.estimate.in_frame,
                h_b_from_a: plane.estimate.h_b_from_a,
                ..together.clone()
            },
        };
    }
    if options.linear {
        let lens = placed(model.lambda, frame);
        let ideal = seen.iter().filter_map(|m| lens.ideal_match(m)).map(|m| PointMatch { sigma_px: 1.0, ..m });
        if let Some((in_frame, _)) = direct_linear_transformation(&to_frame(&ideal.collect::<Vec<_>>(), frame))
            && let Ok(h_b_from_a) = Homography::from_frame(&in_frame, frame)
        {
            plane.estimate = HomographyEstimate { in_frame, h_b_from_a, ..plane.estimate };
        }
    }
    turning_plane(plane)
}
