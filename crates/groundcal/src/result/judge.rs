//! The verdict on an answer ([`Verdict`]): what was tried, and what it said.
//!
//! Every reason has a level that it leaves the answer at; that of the answer is the worst. A reason that would stand as often on right
//! answers as on wrong ones is none.

use std::collections::HashSet;

use crate::{
    error::Error,
    numerics::statistics::chi_squared_survival,
    remedy::Remedy,
    result::{
        calibration::Calibration,
        camera::{Method, MotionKind, Scene},
        fit::ResidualReport,
        verdict::{Verdict, VerdictLevel, VerdictReason},
        warning::Warning,
    },
};

/// Variance of the residuals, in units of the matching noise, outside of which they are no noise of that size. (Of 198 well-specified
/// scenes of points it lies in 0.93 to 1.22, of rendered pictures up to 1.95, of a real panorama that is right to 0.05 % it is 4.4.)
pub(crate) const VARIANCE_RANGE: std::ops::Range<f64> = 0.7..5.0;
/// Probability at which a variance below that is not put down to few residuals.
const CHANCE_P: f64 = 1e-3;
/// Residuals that are smaller than the noise of the matches.
const RESIDUALS_BELOW_NOISE: &str = "residuals_below_noise";
/// Largest design effect of the residuals over a floor. (1 of 180 well-specified scenes is beyond, 18 of 101 wrong answers are.)
const MAX_DESIGN_EFFECT: f64 = 2.6;
/// The same where views moved in any way: a point is seen in many views, and what is not flat, or what patches of one picture have in common, comes
/// back in all of them. (Of 7 real boards and 2 rendered floors, all right within 1.5 deviations, it is 1.7 to 4.8.)
const MAX_GENERAL_DESIGN_EFFECT: f64 = 5.0;

/// Standard deviation of attitudes from which on views of one plane are better taken for what they may be, views from anywhere. (Of 47 answers to
/// general motion as turns about a normal 44 had more.)
pub(crate) const GENERAL_ATTITUDE_SIGMA_DEG: f64 = 1.0;

/// On a calibration, from its warnings and residuals. `on_the_spot`: somebody vouches that a camera taken to turn on the spot did.
pub(crate) fn verdict_on(c: &Calibration, on_the_spot: bool) -> Verdict {
    let mut reasons: Vec<(VerdictLevel, VerdictReason)> = Vec::new();
    let mut add = |level: VerdictLevel, code: &str, message: String| {
        if !reasons.iter().any(|(_, r)| r.code == code) {
            reasons.push((level, VerdictReason { code: code.into(), message }));
        }
    };
    for warning in &c.warnings {
        if let Some(level) = level_with(warning) {
            add(level, warning.code(), warning.finding());
        }
    }
    if c.attitude_sigma_estimated && c.attitude_sigma_deg > GENERAL_ATTITUDE_SIGMA_DEG {
        let message = format!(
            "the camera's attitude varies by {:.1} degrees from one motion to the next, more than a tripod's or a carrier's on wheels does: the \
             motions may be none about the floor's normal",
            c.attitude_sigma_deg
        );
        add(VerdictLevel::Usable, "attitudes_vary", message);
    }
    if c.scene == Some(Scene::Directions) && c.fit.refinement.is_some() {
        let (code, message) = if on_the_spot { LENS_ON_AXIS_ASSUMED } else { LENS_MAY_BE_OFF_AXIS };
        add(VerdictLevel::Usable, code, message.into());
    }
    match &c.fit.refinement {
        Some(r) => {
            // Views of no motion are linked by points, too.
            let kinds = [(&r.patches, r.cross_attitude_links > 0), (&r.points, has_free_views(c))];
            for (residuals, linked) in kinds.into_iter().filter_map(|(r, linked)| Some((r.as_ref()?, linked))) {
                let share = residuals.observations as f64 / r.observations.max(1) as f64;
                let usual = c.scene.zip(c.motion).and_then(|seen| usual_design_effect(seen, linked));
                for (code, message) in of_residuals(residuals, share * r.degrees_of_freedom, usual) {
                    add(VerdictLevel::Unchecked, code, message);
                }
            }
        }
        None if c.method != Method::Joint => {
            let method = match c.method {
                Method::Rotating => "rotating-camera",
                method => method.name(),
            };
            let message = format!(
                "the {method} method alone does not try its assumptions against the matches; the joint refinement does"
            );
            add(VerdictLevel::Unchecked, "not_refined", message);
        }
        None => {}
    }
    // Those of one level in the order in which they were found.
    reasons.sort_by_key(|(level, _)| std::cmp::Reverse(*level));
    Verdict {
        level: reasons.first().map_or(VerdictLevel::Trustworthy, |(level, _)| *level),
        checked: is_checked(c),
        reasons: reasons.into_iter().map(|(_, reason)| reason).collect(),
    }
}

/// Attitudes from which on a repair is tried by more than it was made from.
pub(crate) const MIN_ATTITUDES_OF_REPAIR: usize = 4;
/// Priors that may be contradicted in an answer, and beside pictures that depart. (Of the two answers of the bench with more than two, the one with six was off by
/// 40 deviations.)
const MAX_RELEASED: usize = 2;
const MAX_RELEASED_BESIDE_DEPARTURES: usize = 1;

/// Refuses an answer that needs more than one account of what is wrong with its assumptions: pictures that depart from each other, or a camera that is
/// not as cameras are, explain much, and where something else is wrong as well there is no telling which of the two it was. (Of 20 answers of
/// the bench with pictures that depart over a floor and another such doubt, 10 were wrong by more than 4 deviations, of 4 with a
/// prior contradicted and another 3; of the other 721 answers 23. Of 15 that depart in two ways with three attitudes or fewer one was off by 12 deviations.)
///
/// # Errors
/// [`Error::Unsound`].
pub(crate) fn one_account_at_most(c: &Calibration) -> Result<(), Error> {
    let depart = c.warnings.iter().any(|w| matches!(w, Warning::PicturesDepart { .. }));
    let released: Vec<&str> = c.warnings.iter().filter_map(released_prior).collect();
    let of_released = format!("what was assumed of {} is contradicted", released.join(" and "));
    let most_released = if depart { MAX_RELEASED_BESIDE_DEPARTURES } else { MAX_RELEASED };
    let mut others: Vec<String> = Vec::new();
    let account = match (depart, released.is_empty()) {
        (true, _) => {
            "the pictures depart from each other in focal length, place or while they are read out".to_string()
        }
        (false, false) => of_released.clone(),
        (false, true) => return Ok(()),
    };
    if released.len() > most_released {
        others.push(if depart { of_released } else { format!("{} assumptions are more than one", released.len()) });
    }
    let departures = c.warnings.iter().filter(|w| matches!(w, Warning::PicturesDepart { .. })).count();
    let attitudes = c.attitudes.len();
    if departures > 1 && (1..MIN_ATTITUDES_OF_REPAIR).contains(&attitudes) {
        others.push(format!("they do in {departures} ways, which {attitudes} attitudes do not tell apart"));
    }
    // A lever arm is seen by its parallax, and so is what pictures that depart show of it.
    if !depart && c.warnings.iter().any(|w| matches!(w, Warning::LensOffAxis { .. })) {
        others.push("the lens was off the axis of turning".into());
    }
    // Of a camera that turns on the spot the pictures' own turns are free, and neighbours move together by parallax.
    if c.scene == Some(Scene::Floor) {
        let inconsistent = c.warnings.iter().filter(|w| matches!(w, Warning::MotionAttitudeError { .. })).count();
        if inconsistent > 0 {
            others.push(format!("{inconsistent} of the motions have attitude errors that the others do not explain"));
        }
        let left_out = c.warnings.iter().filter(|w| matches!(w, Warning::MotionLeftOut { .. })).count();
        // A camera that is not as cameras are may have cost a motion before it was found.
        if depart && left_out > 0 {
            others.push(format!("{left_out} of the motions had to be left out"));
        }
        let reasons = c.verdict.iter().flat_map(|v| &v.reasons);
        others.extend(reasons.filter(|r| r.code == RESIDUALS_BELOW_NOISE).map(|r| r.message.clone()));
    }
    if others.is_empty() {
        return Ok(());
    }
    let reason =
        format!("{account}, and {}: no telling which of these accounts is the right one", others.join(", and "));
    Err(Error::Unsound { reason, remedies: vec![Remedy::CheckImages, Remedy::NamePairs, Remedy::ClearMotions] })
}

/// The name of a prior that was given up.
fn released_prior(warning: &Warning) -> Option<&'static str> {
    match warning {
        Warning::PriorContradicted(conflict) => Some(conflict.parameter.name()),
        _ => None,
    }
}

/// On an answer that is refused because the images contradict it; `None`: they do not, it is not determined.
pub fn verdict_on_refusal(error: &Error) -> Option<Verdict> {
    matches!(error, Error::Unsound { .. }).then(|| Verdict {
        level: VerdictLevel::Contradicted,
        checked: true,
        reasons: vec![VerdictReason { code: error.code().into(), message: error.finding() }],
    })
}

/// Of things at one distance, a lens ahead of the axis of turning shows what a longer one on it would, so that nothing in the images tells
/// the two apart. (Of 57 answers of the bench for cameras that turn on the spot 33 were wrong by more than 3 deviations, nearly all with the
/// lens off the axis, before the error bars allowed for it.)
const LENS_MAY_BE_OFF_AXIS: (&str, &str) = (
    "lens_may_be_off_axis",
    "the camera turned on the spot: the error bars allow for a lens off the axis of turning by 1 % of the distance of what it saw (5 cm before \
     things 5 m away), which images of things that are all about as far away do not show; the motion `turning` vouches that there is none",
);
const LENS_ON_AXIS_ASSUMED: (&str, &str) = (
    "lens_on_axis_assumed",
    "the camera is taken to have turned about its lens, as was said: how far the lens was off the axis of turning, over the distance of what \
     it saw, is an error of fx (10 mm before things 2 m away: 0.5 %), and is not in the error bars where the images do not show it",
);

/// At what a warning leaves an answer; `None`: it says nothing of whether the error bars hold. The worse the level, the graver the warning.
pub fn level_with(warning: &Warning) -> Option<VerdictLevel> {
    match warning {
        Warning::PicturesDepart { .. }
        | Warning::PriorContradicted(_)
        | Warning::MotionAttitudeError { .. }
        | Warning::MotionLeftOut { .. }
        | Warning::MotionsDisagree { .. }
        | Warning::NotRotations { .. }
        | Warning::DistortionNotModelled { .. }
        | Warning::DistortionNotConverged { .. }
        | Warning::LensOffAxis { .. }
        | Warning::FocalLengthUnexpected { .. }
        | Warning::NotRefined { .. } => Some(VerdictLevel::Unchecked),
        // What other planes contradict has wider bars for it.
        Warning::FloorsContradict { .. }
        | Warning::SingleMotion
        | Warning::SingleAttitude { .. }
        | Warning::PriorDecides { .. }
        | Warning::AssumptionOpen { .. }
        | Warning::DistortionUncertain { .. }
        | Warning::LargeUncertainty { .. } => Some(VerdictLevel::Usable),
        // As often on right answers as on wrong ones, or no doubt about the camera.
        Warning::ParallelHorizons { .. }
        | Warning::StaticBackground { .. }
        | Warning::StillInAllImages { .. }
        | Warning::DuplicateImages { .. }
        | Warning::FisheyeLens { .. }
        | Warning::StatedNoiseContradicted { .. }
        | Warning::NeighboursOnly { .. }
        | Warning::LargeAttitudeErrors { .. }
        | Warning::Other { .. } => None,
    }
}

/// The design effect up to which residuals are usual; none where the refinement judges it itself. Patches that are sought in views of other attitudes
/// too (`linked`) are seen as those of views that moved in any way.
pub(crate) fn usual_design_effect(seen: (Scene, MotionKind), linked: bool) -> Option<f64> {
    match seen {
        (Scene::Floor, MotionKind::General) => Some(MAX_GENERAL_DESIGN_EFFECT),
        (Scene::Floor, _) if linked => Some(MAX_GENERAL_DESIGN_EFFECT),
        (Scene::Floor, _) => Some(MAX_DESIGN_EFFECT),
        _ => None,
    }
}

/// What residuals of one kind say against the model.
fn of_residuals(r: &ResidualReport, degrees_of_freedom: f64, usual_effect: Option<f64>) -> Vec<(&'static str, String)> {
    let mut out = Vec::new();
    let variance = r.variance_factor;
    // Neighbours that have something in common are fewer than they look.
    let independent = (degrees_of_freedom / r.design_effect.max(1.0)).round().max(1.0);
    let below_by_chance = 1.0 - chi_squared_survival(variance * independent, independent as usize);
    if variance < VARIANCE_RANGE.start && below_by_chance < CHANCE_P {
        out.push((
            RESIDUALS_BELOW_NOISE,
            format!(
                "what is left of the matches is {:.2} times as large as their noise: they are copies of each other and count more than once, or the model \
                 follows what it should not",
                variance.sqrt()
            ),
        ));
    }
    if variance > VARIANCE_RANGE.end {
        out.push((
            "residuals_above_noise",
            format!(
                "what is left of the matches is {:.1} times as large as their noise: the model leaves something out",
                variance.sqrt()
            ),
        ));
    }
    if let Some(usual) = usual_effect.filter(|usual| r.design_effect > *usual) {
        out.push((
            "neighbours_move_together",
            format!(
                "neighbouring points move together by more than the model allows (design effect {:.1}, usual is up to {usual}): a lens, a \
                 floor or a shutter that is not as assumed",
                r.design_effect
            ),
        ));
    }
    out
}

/// Whether there are views of no motion, which see its floor.
fn has_free_views(c: &Calibration) -> bool {
    let of_motions: HashSet<&str> =
        c.motions.iter().filter(|m| m.used).flat_map(|m| [m.from.as_str(), m.to.as_str()]).collect();
    c.scene == Some(Scene::Floor) && c.views.len() > of_motions.len()
}

/// See [`Verdict::checked`].
fn is_checked(c: &Calibration) -> bool {
    let used = c.motions.iter().filter(|m| m.used).count();
    let views = c.views.len();
    match c.scene {
        // Turns that close: more pairs than it takes to connect the views.
        Some(Scene::Directions) => views > 0 && used >= views,
        // Of three views one equation is left over.
        _ if c.motion == Some(MotionKind::General) || has_free_views(c) => views > 3,
        _ => c.attitudes.len() > 1 || (used > 1 && views > 2),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        calibrate::{Options, Silent, calibrate_matches},
        pairs::correspondence::ImagePair,
        result::{PictureDeparture, PriorConflict, PriorParameter},
        synthetic::points::PointScene,
    };

    #[test]
    fn residuals_speak_against_the_model_beyond_what_noise_does() {
        let codes = |variance_factor: f64, design_effect: f64, degrees_of_freedom: f64, usual: Option<f64>| {
            let residuals = ResidualReport { observations: 1000, variance_factor, design_effect };
            let found = of_residuals(&residuals, degrees_of_freedom, usual);
            found.into_iter().map(|(code, _)| code).collect::<Vec<_>>()
        };
        assert!(codes(1.0, 2.0, 1000.0, Some(MAX_DESIGN_EFFECT)).is_empty());
        assert_eq!(codes(0.6, 1.0, 1000.0, Some(MAX_DESIGN_EFFECT)), ["residuals_below_noise"]);
        // Few residuals are as small by chance, and neighbours that have something in common are few.
        assert!(codes(0.6, 1.0, 12.0, Some(MAX_DESIGN_EFFECT)).is_empty());
        assert!(codes(0.6, 2.5, 30.0, Some(MAX_DESIGN_EFFECT)).is_empty());
        assert_eq!(codes(6.0, 1.0, 1000.0, Some(MAX_DESIGN_EFFECT)), ["residuals_above_noise"]);
        assert_eq!(codes(1.0, 3.0, 1000.0, Some(MAX_DESIGN_EFFECT)), ["neighbours_move_together"]);
        // There it is judged, and refused, by the refinement.
        assert!(codes(1.0, 3.0, 1000.0, None).is_empty());
    }

    #[test]
    fn one_account_of_a_misfit_is_given_and_two_are_none() {
        let scene = PointScene::nominal(1);
        let pairs: Vec<ImagePair> = scene.pairs();
        let names: Vec<String> = (0..2 * pairs.len()).map(|i| i.to_string()).collect();
        let c = calibrate_matches(&names, scene.size, &pairs, &Options::default(), &Silent).expect("a camera");
        let departs =
            || Warning::PicturesDepart { departure: PictureDeparture::FocalLength, sigma: 0.5, twice_log_odds: 60.0 };
        let attitude_error =
            || Warning::MotionAttitudeError { from: "a".into(), to: "b".into(), apart_deg: 3.0, sigma_deg: 0.1 };
        let released = |parameter| {
            Warning::PriorContradicted(PriorConflict {
                parameter,
                mean: 0.0,
                sigma: 1.0,
                found: 9.0,
                found_sigma: 1.0,
                twice_log_odds: 60.0,
            })
        };
        let verdict = |scene: Scene, warnings: Vec<Warning>| {
            one_account_at_most(&Calibration { scene: Some(scene), warnings, ..c.clone() }).map_err(|e| e.to_string())
        };
        let (cx, cy) = (PriorParameter::Cx, PriorParameter::Cy);
        for alone in [vec![departs()], vec![attitude_error()], vec![released(cx), released(cy)]] {
            assert_eq!(verdict(Scene::Floor, alone), Ok(()));
        }
        // The scene has three attitudes.
        let message = verdict(Scene::Floor, vec![departs(), departs()]).expect_err("two departures");
        assert!(message.contains("2 ways, which 3 attitudes do not tell apart"), "{message}");
        let message = verdict(Scene::Floor, vec![released(cx), attitude_error()]).expect_err("two accounts");
        assert!(message.contains("assumed of cx is contradicted, and 1 of the motions"), "{message}");
        let three = vec![released(cx), released(cy), released(PriorParameter::Aspect)];
        let message = verdict(Scene::Floor, three).expect_err("three assumptions");
        assert!(message.contains("3 assumptions"), "{message}");
        assert_eq!(verdict(Scene::Floor, vec![departs(), released(cx)]), Ok(()));
        let message = verdict(Scene::Floor, vec![departs(), attitude_error()]).expect_err("two accounts");
        assert!(message.contains("1 of the motions have attitude errors"), "{message}");
        let message =
            verdict(Scene::Directions, vec![departs(), released(cx), released(cy)]).expect_err("two accounts");
        assert!(message.contains("cx and cy"), "{message}");
        // Of a camera that turns on the spot each picture has its own turn.
        assert_eq!(verdict(Scene::Directions, vec![departs(), attitude_error()]), Ok(()));
    }

    #[test]
    fn only_what_contradicts_an_answer_is_a_verdict_on_a_refusal() {
        let unsound = Error::Unsound { reason: "residuals".into(), remedies: Vec::new() };
        let verdict = verdict_on_refusal(&unsound).expect("contradicted");
        assert_eq!((verdict.level, verdict.reasons[0].code.as_str()), (VerdictLevel::Contradicted, "unsound"));
        assert!(verdict_on_refusal(&Error::TooFewImages { found: 1 }).is_none());
    }
}
