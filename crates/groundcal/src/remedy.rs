//! What to do about an error or a warning, as a value.
//!
//! The library knows what helps (name the true motions, give the lens's coefficients); how that is done, an option of the command line or
//! an argument of a function, is known to the front end alone. It words each [`Remedy`] through a [`Wording`]; [`Plain`] is the library's
//! own, without any.

use crate::geometry::constraint::Constraint;

/// Something that helps, or may help.
///
/// # Examples
/// ```
/// use groundcal::Remedy;
/// let turn = Remedy::TurnCamera { from_deg: 15.0, to_deg: 60.0 };
/// assert_eq!(turn.code(), "turn_camera");
/// println!("{turn}");
/// ```
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum Remedy {
    // With the camera.
    /// Take a second image of the same attitude.
    TakeSecondImage,
    /// Check that the images overlap and that the floor can be seen in them.
    CheckImages,
    /// Turn the camera by these angles between the two images of a motion, without tilting it.
    TurnCamera {
        /// Least turn, degrees.
        from_deg: f64,
        /// Largest turn, degrees.
        to_deg: f64,
    },
    /// Turn the camera further.
    TurnFurther,
    /// Turn without tilting between the images of a motion.
    DoNotTilt,
    /// Tilt or roll the camera by so much and repeat a motion.
    TiltOrRoll {
        /// By how much, degrees.
        deg: f64,
    },
    /// Tilt the camera to an angle from which the focal length shows.
    TiltDown {
        /// Least angle below the horizon, degrees.
        from_deg: f64,
        /// Largest angle below the horizon, degrees.
        to_deg: f64,
    },
    /// Roll the camera by so much or more for one or two motions.
    RollCamera {
        /// By how much, degrees.
        deg: f64,
    },
    /// Vary tilt and roll more.
    VaryTiltAndRoll,
    /// Take more motions, at other tilts and rolls.
    MoreMotions,
    /// Take more pictures of the plane, from other tilts and headings.
    MoreViews,
    /// Take more motions than a plan says.
    MoreMotionsThanPlanned,
    /// Take more motions, with clear turns and tilts that tell the focal length.
    ClearMotions,
    /// Turn by so much or more.
    TurnAtLeast {
        /// Least turn, degrees.
        deg: f64,
    },
    /// Steady the camera.
    SteadyCamera,
    /// Take more images with floor out to the corners.
    CoverCorners,
    /// Take the motion, or the motions, again without tilting the camera between the two images.
    RetakeMotion,
    /// Turn the camera about its optical centre.
    TurnAboutOpticalCentre,
    /// Turn the camera about two different axes.
    TurnAboutTwoAxes {
        /// Least turn, degrees.
        turn_deg: f64,
    },
    /// Use motions about the floor's normal.
    TurnOverFloor,
    /// Bring more floor into both pictures of a motion.
    ShowMoreFloor,
    // With the data.
    /// Give more matches, of points on the floor, spread over the image.
    MoreMatches,
    /// Use points spread over the plane.
    SpreadPoints,
    /// Say by a mask what of the images is to be used.
    MaskBackground,
    /// Remove one of two equal images.
    RemoveDuplicate,
    // With options.
    /// Vouch that the camera did not tilt: that the motions are plane-normal.
    VouchPlaneNormal,
    /// Name the pairs that are true motions.
    NamePairs,
    /// Leave a pair out.
    LeavePairOut,
    /// Name the pairs to be compared.
    ComparePairs,
    /// Give the lens's coefficients.
    GiveLensCoefficients,
    /// Say that the lens has no distortion.
    StateNoDistortion,
    /// Have the lens's distortion estimated.
    EstimateLens,
    /// Check the coefficients given.
    CheckLensCoefficients,
    /// Say how far the carrier pitches and rolls by itself.
    GiveAttitudeSigma,
    /// Give the value of a parameter, if it is known.
    GiveValue,
    /// Ask for less: one of these constraints.
    UseConstraint {
        /// Any of them will do.
        any_of: Vec<Constraint>,
    },
    /// Use the joint method, over a floor.
    UseJointMethod,
    /// Allow the camera larger turns (in a plan).
    AllowLargerTurns,
    /// Allow the camera other tilts (in a plan).
    AllowTilts,
    // With us.
    /// Report a fault of the program, with the input.
    ReportFault,
}

impl Remedy {
    /// A turn that tells the circular points well.
    pub(crate) const CLEAR_TURN: Remedy = Remedy::TurnCamera { from_deg: 15.0, to_deg: 60.0 };
    /// A tilt from which the focal length shows.
    pub(crate) const TILT_DOWN: Remedy = Remedy::TiltDown { from_deg: 30.0, to_deg: 60.0 };

    /// Short name, stable across versions.
    pub fn code(&self) -> &'static str {
        match self {
            Remedy::TakeSecondImage => "take_second_image",
            Remedy::CheckImages => "check_images",
            Remedy::TurnCamera { .. } => "turn_camera",
            Remedy::TurnFurther => "turn_further",
            Remedy::DoNotTilt => "do_not_tilt",
            Remedy::TiltOrRoll { .. } => "tilt_or_roll",
            Remedy::TiltDown { .. } => "tilt_down",
            Remedy::RollCamera { .. } => "roll_camera",
            Remedy::VaryTiltAndRoll => "vary_tilt_and_roll",
            Remedy::MoreMotions => "more_motions",
            Remedy::MoreViews => "more_views",
            Remedy::MoreMotionsThanPlanned => "more_motions_than_planned",
            Remedy::ClearMotions => "clear_motions",
            Remedy::TurnAtLeast { .. } => "turn_at_least",
            Remedy::SteadyCamera => "steady_camera",
            Remedy::CoverCorners => "cover_corners",
            Remedy::RetakeMotion => "retake_motion",
            Remedy::TurnAboutOpticalCentre => "turn_about_optical_centre",
            Remedy::TurnAboutTwoAxes { .. } => "turn_about_two_axes",
            Remedy::TurnOverFloor => "turn_over_floor",
            Remedy::ShowMoreFloor => "show_more_floor",
            Remedy::MoreMatches => "more_matches",
            Remedy::SpreadPoints => "spread_points",
            Remedy::MaskBackground => "mask_background",
            Remedy::RemoveDuplicate => "remove_duplicate",
            Remedy::VouchPlaneNormal => "vouch_plane_normal",
            Remedy::NamePairs => "name_pairs",
            Remedy::LeavePairOut => "leave_pair_out",
            Remedy::ComparePairs => "compare_pairs",
            Remedy::GiveLensCoefficients => "give_lens_coefficients",
            Remedy::StateNoDistortion => "state_no_distortion",
            Remedy::EstimateLens => "estimate_lens",
            Remedy::CheckLensCoefficients => "check_lens_coefficients",
            Remedy::GiveAttitudeSigma => "give_attitude_sigma",
            Remedy::GiveValue => "give_value",
            Remedy::UseConstraint { .. } => "use_constraint",
            Remedy::UseJointMethod => "use_joint_method",
            Remedy::AllowLargerTurns => "allow_larger_turns",
            Remedy::AllowTilts => "allow_tilts",
            Remedy::ReportFault => "report_fault",
        }
    }
}

/// A clause that tells somebody to do it, without a capital or a full stop.
impl std::fmt::Display for Remedy {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let text = match self {
            Remedy::TakeSecondImage => {
                "take a second image after turning (and, if you like, moving) the camera over the floor without tilting it"
            }
            Remedy::CheckImages => {
                "check that the images belong together, overlap by half or more, and that the plane or the scene in them has visible texture and is in focus"
            }
            Remedy::TurnCamera { from_deg, to_deg } => {
                return write!(
                    f,
                    "turn the camera by {from_deg} to {to_deg} degrees between the two images of a motion, without tilting it"
                );
            }
            Remedy::TurnFurther => "turn the camera further between the images",
            Remedy::DoNotTilt => "turn the camera without tilting it between the images of a motion",
            Remedy::TiltOrRoll { deg } => {
                return write!(f, "tilt or roll the camera by {deg} degrees and repeat a motion");
            }
            Remedy::TiltDown { from_deg, to_deg } => {
                return write!(
                    f,
                    "tilt the camera to {from_deg} to {to_deg} degrees below the horizon (a roll alone does not help)"
                );
            }
            Remedy::RollCamera { deg } => {
                return write!(f, "roll the camera by {deg} degrees or more for one or two motions");
            }
            Remedy::VaryTiltAndRoll => "vary tilt and roll more",
            Remedy::MoreMotions => "take more motions, at other tilts and rolls",
            Remedy::MoreViews => {
                "take five pictures or more of the same plane, from several sides, the camera tilted by 20 to 50 degrees to it"
            }
            Remedy::MoreMotionsThanPlanned => "make more motions than planned",
            Remedy::ClearMotions => {
                "take more motions with turns of 15 to 60 degrees, the camera 30 to 60 degrees below the horizon"
            }
            Remedy::TurnAtLeast { deg } => return write!(f, "turn by {deg} degrees or more"),
            Remedy::SteadyCamera => "steady the camera",
            Remedy::CoverCorners => "take more images with floor out to the corners",
            Remedy::RetakeMotion => "take it again without tilting the camera between the two images",
            Remedy::TurnAboutOpticalCentre => "turn the camera about its optical centre",
            Remedy::TurnAboutTwoAxes { turn_deg } => {
                return write!(
                    f,
                    "turn the camera by {turn_deg} degrees or more about two different axes, 20 degrees or more apart (pan and tilt, or \
                     with a roll)"
                );
            }
            Remedy::TurnOverFloor => {
                "where the camera moves as well, over a floor, use motions about the floor's normal instead"
            }
            Remedy::ShowMoreFloor => {
                "tilt the camera further down, turn it less, bring the axis of the turn nearer to the camera, or find a floor with more \
                 texture"
            }
            Remedy::MoreMatches => "give more matches of points on the floor, spread over more of the image",
            Remedy::SpreadPoints => "use points spread over the plane",
            Remedy::MaskBackground => "say by a mask what of the images is to be used",
            Remedy::RemoveDuplicate => "remove one",
            Remedy::VouchPlaneNormal => "say that the camera turned without tilting, if you know it",
            Remedy::NamePairs => "name the true motions",
            Remedy::LeavePairOut => "leave the pair out",
            Remedy::ComparePairs => "name the pairs to be compared to have others compared",
            Remedy::GiveLensCoefficients => "give the lens's k1 (and k2) if you know it",
            Remedy::StateNoDistortion => "state it if the lens is known to have no distortion",
            Remedy::EstimateLens => "have the lens distortion estimated",
            Remedy::CheckLensCoefficients => "check the sign and size of k1",
            Remedy::GiveAttitudeSigma => "say how far the carrier pitches and rolls by itself",
            Remedy::GiveValue => "give the value if you know it",
            Remedy::UseConstraint { any_of } => {
                return write!(
                    f,
                    "ask for less with a stronger constraint ({})",
                    either(any_of.iter().map(|c| c.name().to_string()))
                );
            }
            Remedy::UseJointMethod => {
                "over a floor use the joint method (the default), which needs no fixed optical centre"
            }
            Remedy::AllowLargerTurns => "let the camera turn by 15 degrees or more between two pictures",
            Remedy::AllowTilts => "tilt the camera to 30 to 60 degrees below the horizon",
            Remedy::ReportFault => "please report it with the input",
        };
        f.write_str(text)
    }
}

/// "a", "a or b", "a, b or c".
pub fn either(names: impl Iterator<Item = String>) -> String {
    let names: Vec<String> = names.collect();
    match names.split_last() {
        Some((last, first)) if !first.is_empty() => format!("{} or {last}", first.join(", ")),
        _ => names.concat(),
    }
}

/// How a front end words what to do: with its options, arguments or buttons.
///
/// # Examples
/// ```
/// use groundcal::{Remedy, Wording};
/// struct Buttons;
/// impl Wording for Buttons {
///     fn remedy(&self, remedy: &Remedy) -> String {
///         format!("press [{}]", remedy.code())
///     }
/// }
/// assert!(Buttons.remedy(&Remedy::EstimateLens).contains("estimate_lens"));
/// ```
pub trait Wording {
    /// A clause that tells somebody to do it, without a capital or a full stop.
    fn remedy(&self, remedy: &Remedy) -> String {
        remedy.to_string()
    }
}

/// The library's own words.
pub struct Plain;
impl Wording for Plain {}

/// What was found, and then what to do about it, any of it: "Finding. This, or that".
pub(crate) fn sentence(finding: &str, remedies: &[Remedy], wording: &dyn Wording) -> String {
    let clauses: Vec<String> = remedies.iter().map(|r| wording.remedy(r)).collect();
    let mut advice = match clauses.split_last() {
        None => return finding.into(),
        Some((last, [])) => last.clone(),
        Some((last, [first])) => format!("{first}, or {last}"),
        Some((last, first)) => format!("{}; or {last}", first.join("; ")),
    };
    if let Some(first) = advice.get_mut(..1) {
        first.make_ascii_uppercase();
    }
    format!("{finding}. {advice}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn clauses_become_a_sentence() {
        let of = |c: &[Constraint]| Remedy::UseConstraint { any_of: c.to_vec() };
        assert_eq!(of(&[Constraint::Focal]).to_string(), "ask for less with a stronger constraint (focal)");
        let both = [of(&[Constraint::Auto, Constraint::Focal, Constraint::Square]), Remedy::RollCamera { deg: 30.0 }];
        assert_eq!(
            sentence("it is wrong", &both, &Plain),
            "it is wrong. Ask for less with a stronger constraint (auto, focal or square), or roll the camera by 30 degrees or more for one or two motions"
        );
        assert_eq!(sentence("it is wrong", &[], &Plain), "it is wrong");
    }
}
