//! What to do about a warning or an error, in the words of Python: with its keywords.

use groundcal::{Remedy, Wording, either};

/// Remedies that are keywords of a function are named by them; the others are in the library's words.
pub(crate) struct Keywords;

impl Wording for Keywords {
    fn remedy(&self, remedy: &Remedy) -> String {
        let text = match remedy {
            Remedy::VouchPlaneNormal => {
                "say so with motion=\"plane-normal\" if you know that the camera turned without tilting"
            }
            Remedy::NamePairs => "name the true motions with pairs=",
            Remedy::MaskBackground => "say with mask= what of the images is to be used",
            Remedy::LeavePairOut => "leave the pair out (pairs=)",
            Remedy::ComparePairs => "give pairs= to compare others",
            Remedy::GiveLensCoefficients => "give the lens's k1 (and k2) with distortion={\"k1\": ...} if you know it",
            Remedy::StateNoDistortion => "give lens=\"none\" for a lens known to have no distortion",
            Remedy::EstimateLens => "have the lens distortion estimated (lens=\"k1k2\")",
            Remedy::CheckLensCoefficients => "check the sign and size of k1 (distortion=)",
            Remedy::GiveAttitudeSigma => "give attitude_sigma_deg= for a carrier that pitches",
            Remedy::GiveValue => "give the value if you know it (principal_point_px=, priors=)",
            Remedy::UseConstraint { any_of } => {
                // The first with its keyword, so that it can be copied.
                let named = any_of.iter().enumerate().map(|(i, c)| match i {
                    0 => format!("constraint=\"{c}\""),
                    _ => format!("\"{c}\""),
                });
                return format!("ask for less with a stronger constraint ({})", either(named));
            }
            Remedy::UseJointMethod => {
                "over a floor use the joint method (the default, method=\"joint\"), which needs no fixed optical centre"
            }
            Remedy::AllowLargerTurns => {
                "let the camera turn by 15 degrees or more between two pictures (max_turn_deg=)"
            }
            Remedy::AllowTilts => "tilt the camera to 30 to 60 degrees below the horizon (tilts_deg=)",
            other => return other.to_string(),
        };
        text.into()
    }
}
