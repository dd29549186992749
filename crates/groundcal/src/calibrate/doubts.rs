//! Doubts about an answer that do not say what is wrong: attitudes that vary from motion to motion, planes that are not the floor of all views, neighbours
//! that move together.
//!
//! ```text
//! C' = C f + S,   f = 4 of an answer that is doubted, times D where the design effect D is more than usual
//!                 S = 3 Σ_j c_j c_jᵀ / σ_j² of one attitude, c_j the column of C of a number j that nobody gave, σ_j its prior's deviation
//! ```
//!
//! One attitude's two equations leave aspect and principal point to their priors, and a prior that nothing tests cannot be contradicted: it counts with
//! twice its deviation (the second line, c_j / σ_j² being what the estimate follows of the prior's mean). What the matches do tell is as it was.
//!
//! An answer is doubted where views from anywhere might explain better what was seen, and where something was found wrong and repaired with three attitudes or
//! fewer: two equations each for five numbers and the repair, so that next to nothing is left to try the repair by. Where pictures depart from each other and there are
//! more attitudes, f = 2.
//!
//! Where nobody vouched for the motion, such an answer gives way to that of views from anywhere ([`super::driver`]), if there is one. D has
//! widened the bars once already, as of noise that neighbours share; what they share beyond what features and patches do is no noise, and is the same in
//! all motions.

use nalgebra::DMatrix;

use crate::{
    calibrate::{
        joint::JointSolution,
        options::{MotionModel, Options},
        solved::Solved,
    },
    geometry::parameters::PriorParameter,
    ids::PairId,
    pairs::observation::{PairObservation, images_of},
    refine::{Kind, SceneModel},
    result::judge::{GENERAL_ATTITUDE_SIGMA_DEG, MIN_ATTITUDES_OF_REPAIR, usual_design_effect},
    result::{MotionKind, Scene},
};

/// Factor on the variance of an answer that is doubted and stands: twice its deviations. (Of 39 answers of the bench that other planes contradicted and views
/// from anywhere did not explain 4 were off by more than 3 deviations, up to 14; of 44 repaired with three attitudes or fewer 5, up to 5.7; of 165
/// repaired with more 3, and of all others one in 60.)
const DOUBTED_VARIANCE: f64 = 4.0;
/// Factor on the variance of a prior that one attitude leaves untested. (Of 365 answers of the bench of one attitude 11 were off by more
/// than 3 deviations, up to 9.8; four of these were of cropped pictures, whose centre is not where cameras have it.)
const UNTESTED_PRIOR_VARIANCE: f64 = 4.0;
/// Largest design effect that is usual of one attitude: beyond it the answer is doubted. (1 in 50 well-specified scenes has more; of 49 answers of the bench beyond
/// it 3 were off by more than 3 deviations, up to 9.8.)
const MAX_DESIGN_EFFECT_OF_ONE_ATTITUDE: f64 = 2.2;

/// Factor on the variance of an answer whose pictures depart from each other, with attitudes enough to try that by: the departures are seldom just of the kind that
/// was found. (Of 166 such answers of the bench 9 were off by more than 3 deviations and 3 by more than 4.2, of 1043 others 8; one in ten by more than
/// 2.3 and 1.8.)
const DEPARTING_VARIANCE: f64 = 2.0;

/// Whether the attitude errors are larger than those of any carrier that turns about the floor's normal.
fn has_attitude_errors_of_general_motion(joint: &JointSolution) -> bool {
    let component = &joint.bundle.attitude_sigma;
    component.estimated && component.sigma.to_degrees() > GENERAL_ATTITUDE_SIGMA_DEG
}

/// Whether views from anywhere might explain better what was seen.
pub(super) fn is_doubted(joint: &JointSolution) -> bool {
    has_attitude_errors_of_general_motion(joint) || joint.floors.are_contradicted()
}

/// The same of an answer.
pub(super) fn is_answer_doubted(solved: &Solved) -> bool {
    solved.joint.as_ref().is_some_and(is_doubted)
}

/// Whether something that was found wrong was repaired, and nothing is left to try the repair by.
fn is_repair_untried(has_repairs: bool, attitudes: usize) -> bool {
    has_repairs && attitudes < MIN_ATTITUDES_OF_REPAIR
}

/// Widens the error bars of a camera of plane-normal motions by what doubts it.
pub(super) fn widen_by_doubts(
    joint: &mut JointSolution,
    (is_repaired, attitudes): (bool, usize),
    pairs: &[PairObservation],
    used: &[PairId],
    options: &Options,
) {
    if joint.bundle.scene != SceneModel::Floor {
        return;
    }
    let vouched = options.motion == MotionModel::PlaneNormal || options.attitude_sigma_deg.is_some();
    let is_alone = attitudes == 1;
    let has_free_views = joint.views.len() > images_of(used, pairs).len();
    let linked = |kind: Kind| match kind {
        Kind::Patch => !joint.cross_links.is_empty(),
        Kind::Point => has_free_views,
    };
    let usual = |kind: Kind| {
        let usual = usual_design_effect((Scene::Floor, MotionKind::PlaneNormal), linked(kind));
        usual.map(|usual| if is_alone && !vouched { usual.min(MAX_DESIGN_EFFECT_OF_ONE_ATTITUDE) } else { usual })
    };
    let effect = unusual_design_effect(joint, usual);
    let is_doubted =
        is_repair_untried(is_repaired, attitudes) || (!vouched && (is_doubted(joint) || (is_alone && effect > 1.0)));
    let doubt = if is_doubted { DOUBTED_VARIANCE } else { 1.0 };
    widen(joint, doubt * effect);
}

/// Widens the error bars of a camera whose pictures depart from each other. That makes no answer undetermined.
pub(super) fn widen_departing(joint: &mut JointSolution, attitudes: usize) {
    if attitudes >= MIN_ATTITUDES_OF_REPAIR {
        widen(joint, DEPARTING_VARIANCE);
    }
}

/// Adds to the error bars what they owe to the priors that nobody gave and one attitude does not test, were these as wide as they are taken to be. What is
/// less known for that is not undetermined.
pub(super) fn allow_for_untested_priors(joint: &mut JointSolution, attitudes: usize, options: &Options) {
    if attitudes != 1 || joint.bundle.scene != SceneModel::Floor {
        return;
    }
    // With the noise as it is: what was widened says less of what follows a prior.
    let covariance = joint.covariance_of_noise();
    let mut added = DMatrix::zeros(covariance.nrows(), covariance.ncols());
    let left_to_priors = [PriorParameter::Aspect, PriorParameter::Cx, PriorParameter::Cy];
    for parameter in left_to_priors.into_iter().filter(|p| !options.is_told(*p)) {
        let Some((number, (_, sigma))) = prior_of(joint, parameter) else {
            continue;
        };
        let follows = covariance.column(number) / sigma;
        added += &follows * follows.transpose() * (UNTESTED_PRIOR_VARIANCE - 1.0);
    }
    joint.allow(&added);
}

/// The same of a camera of views from anywhere: where nobody asked for them, by what is usual of motions.
pub(super) fn widen_general_by_doubts(joint: &mut JointSolution, options: &Options) {
    let asked = options.motion == MotionModel::General;
    let kind = if asked { MotionKind::General } else { MotionKind::PlaneNormal };
    // Patches of one picture have something in common in all views that see them.
    widen(joint, unusual_design_effect(joint, |of| usual_design_effect((Scene::Floor, kind), of == Kind::Patch)));
}

/// The place of a number of the camera and its prior, if it has one.
fn prior_of(joint: &JointSolution, parameter: PriorParameter) -> Option<(usize, (f64, f64))> {
    let number = PriorParameter::ALL.iter().position(|p| *p == parameter)?;
    Some((number, joint.bundle.unknowns[0].prior(number)?))
}

fn widen(joint: &mut JointSolution, factor: f64) {
    if factor > 1.0 {
        let added = &joint.bundle.cameras[0].covariance * (factor - 1.0);
        joint.allow(&added);
    }
}

/// The largest design effect that is more than usual; 1 where none is.
fn unusual_design_effect(joint: &JointSolution, usual: impl Fn(Kind) -> Option<f64>) -> f64 {
    let effect = |kind: Kind| {
        let effect = joint.bundle.design_effects[kind as usize];
        if usual(kind).is_some_and(|usual| effect > usual) { effect } else { 1.0 }
    };
    [Kind::Patch, Kind::Point].into_iter().map(effect).fold(1.0, f64::max)
}
