//! What to do about a warning or an error, in the words of the command line: with its options.

use groundcal::{Remedy, Wording, either};

/// Remedies that are options of a command are named by them; the others are in the library's words.
pub(crate) struct Flags;

impl Wording for Flags {
    fn remedy(&self, remedy: &Remedy) -> String {
        let text = match remedy {
            Remedy::VouchPlaneNormal => {
                "say so with --motion plane-normal if you know that the camera turned without tilting"
            }
            Remedy::NamePairs => "name the true motions with --pairs",
            Remedy::MaskBackground => "say with --mask what of the images is to be used",
            Remedy::LeavePairOut => "leave the pair out (--pairs)",
            Remedy::ComparePairs => "give --pairs to compare others",
            Remedy::GiveLensCoefficients => "give the lens's k1 with --k1 (and --k2) if you know it",
            Remedy::StateNoDistortion => "give --lens none for a lens known to have none",
            Remedy::EstimateLens => "have the lens distortion estimated (--lens auto)",
            Remedy::GiveAttitudeSigma => "give --attitude-sigma-deg for a carrier that pitches",
            Remedy::GiveValue => "give the value if you know it (--principal-point, --prior)",
            Remedy::UseConstraint { any_of } => {
                // The first with its option, so that it can be copied.
                let named = any_of.iter().enumerate().map(|(i, c)| match i {
                    0 => format!("`--constraint {c}`"),
                    _ => format!("`{c}`"),
                });
                return format!("ask for less with a stronger constraint ({})", either(named));
            }
            Remedy::UseJointMethod => {
                "over a floor use the joint method (the default, --method joint), which needs no fixed optical centre"
            }
            Remedy::AllowLargerTurns => {
                "let the camera turn by 15 degrees or more between two pictures (--max-turn-deg)"
            }
            Remedy::AllowTilts => "tilt the camera to 30 to 60 degrees below the horizon (--tilts-deg)",
            other => return other.to_string(),
        };
        text.into()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use groundcal::result::Warning;

    #[test]
    fn options_are_named() {
        let message = Warning::NeighboursOnly { images: 50 }.message(&Flags);
        assert_eq!(
            message,
            "50 images: not all pairs were compared, but neighbours in the given order and, of pictures, \
             those that look most alike. Give --pairs to compare others"
        );
        let text = Flags.remedy(&Remedy::UseConstraint {
            any_of: vec![groundcal::start::Constraint::Auto, groundcal::start::Constraint::Focal],
        });
        assert_eq!(text, "ask for less with a stronger constraint (`--constraint auto` or `focal`)");
        let spread = Flags.remedy(&Remedy::SpreadPoints);
        assert_eq!(spread, Remedy::SpreadPoints.to_string());
    }
}
