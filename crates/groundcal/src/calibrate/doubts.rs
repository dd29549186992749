//! Doubts about an answer that do not say what is wrong: attitudes that vary from motion to motion, planes that are not the floor of all views, neighbours
//! that move together.
//!
//! ```text
//! C' = C f,      f = 4 of an answer that is doubted,   times D where the design effect D is more than usual
//! ```
//!
//! An answer is doubted where views from anywhere might explain better what was seen, and where something was found wrong and repaired with three attitudes or
//! fewer: two equations each for five numbers and the repair, so that next to nothing is left to try the repair by.
//!
//! Where nobody vouched for the motion, such an answer gives way to that of views from anywhere ([`super::driver`]), if there is one. D has
//! widened the bars once already, as of noise that neighbours share; what they share beyond what features and patches do is no noise, and is the same in
//! all motions.

use crate::{
    calibrate::{
        joint::JointSolution,
        options::{MotionModel, Options},
        solved::Solved,
    },
    ids::PairId,
    pairs::observation::{PairObservation, images_of},
    refine::{Kind, SceneModel},
    result::judge::{GENERAL_ATTITUDE_SIGMA_DEG, usual_design_effect},
    result::{MotionKind, Scene},
};

/// Factor on the variance of an answer that is doubted and stands: twice its deviations. (Of 39 answers of the bench that other planes contradicted and views
/// from anywhere did not explain 4 were off by more than 3 deviations, up to 14; of 44 repaired with three attitudes or fewer 5, up to 5.7; of 165
/// repaired with more 3, and of all others one in 60.)
const DOUBTED_VARIANCE: f64 = 4.0;
/// Attitudes from which on a repair is tried by more than it was made from.
const MIN_ATTITUDES_OF_REPAIR: usize = 4;

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
pub(super) fn is_repair_untried(has_repairs: bool, attitudes: usize) -> bool {
    has_repairs && attitudes < MIN_ATTITUDES_OF_REPAIR
}

/// Widens the error bars of a camera of plane-normal motions by what doubts it.
pub(super) fn widen_by_doubts(
    joint: &mut JointSolution,
    is_repair_untried: bool,
    pairs: &[PairObservation],
    used: &[PairId],
    options: &Options,
) {
    if joint.bundle.scene != SceneModel::Floor {
        return;
    }
    let vouched = options.motion == MotionModel::PlaneNormal || options.attitude_sigma_deg.is_some();
    let is_doubted = is_repair_untried || (!vouched && is_doubted(joint));
    let doubt = if is_doubted { DOUBTED_VARIANCE } else { 1.0 };
    let has_free_views = joint.views.len() > images_of(used, pairs).len();
    let linked = |kind: Kind| match kind {
        Kind::Patch => !joint.cross_links.is_empty(),
        Kind::Point => has_free_views,
    };
    let usual = |kind: Kind| usual_design_effect((Scene::Floor, MotionKind::PlaneNormal), linked(kind));
    widen(joint, doubt * unusual_design_effect(joint, usual));
}

/// The same of a camera of views from anywhere: where nobody asked for them, by what is usual of motions.
pub(super) fn widen_general_by_doubts(joint: &mut JointSolution, options: &Options) {
    let asked = options.motion == MotionModel::General;
    let kind = if asked { MotionKind::General } else { MotionKind::PlaneNormal };
    // Patches of one picture have something in common in all views that see them.
    widen(joint, unusual_design_effect(joint, |of| usual_design_effect((Scene::Floor, kind), of == Kind::Patch)));
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
