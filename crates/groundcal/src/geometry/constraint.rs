//! What may be assumed of a camera matrix.

use serde::{Deserialize, Serialize};

use crate::named::named;

named! {
    /// What is assumed of the camera matrix (KZR 1.1).
    ///
    /// # Examples
    /// ```
    /// use groundcal::Constraint;
    /// assert_eq!(Constraint::Square.to_string(), "square");
    /// assert_eq!(Constraint::ALL[0].to_string(), "auto");
    /// ```
    #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize)]
    #[serde(rename_all = "kebab-case")]
    pub enum Constraint {
        /// Zero skew, and priors instead of hard choices for aspect ratio and principal point.
        #[default]
        Auto = "auto",
        /// All five parameters free: three attitudes.
        Full = "full",
        /// ω12 = 0: two attitudes.
        ZeroSkew = "zero-skew",
        /// Zero skew and known aspect ratio: two attitudes.
        Square = "square",
        /// Zero skew and known principal point: one attitude.
        #[serde(rename = "fixed-pp")]
        FixedPrincipalPoint = "fixed-pp",
        /// Zero skew, known aspect ratio and principal point: one attitude.
        Focal = "focal",
    }
}

impl Constraint {
    /// Which of (ln fx, ln fy/fx, cx, cy, skew) are free.
    pub fn free(self) -> [bool; 5] {
        match self {
            Constraint::Auto | Constraint::ZeroSkew => [true, true, true, true, false],
            Constraint::Full => [true; 5],
            Constraint::Square => [true, false, true, true, false],
            Constraint::FixedPrincipalPoint => [true, true, false, false, false],
            Constraint::Focal => [true, false, false, false, false],
        }
    }

    /// Which of (fx, fy, cx, cy, skew) have an error: fy, too, where it is fx times a ratio that is held.
    pub(crate) fn estimated(self) -> [bool; 5] {
        let [fx, _, cx, cy, skew] = self.free();
        [fx, fx, cx, cy, skew]
    }

    /// Whether it holds all that another one holds.
    pub(crate) fn holds_what(self, other: Constraint) -> bool {
        self.free().iter().zip(other.free()).all(|(free, others)| others || !free)
    }

    /// Number of unknowns.
    pub(crate) fn unknowns(self) -> usize {
        self.free().iter().filter(|f| **f).count()
    }

    /// Different attitudes needed.
    pub(crate) fn attitudes_needed(self) -> usize {
        match self {
            Constraint::Full => 3,
            Constraint::ZeroSkew | Constraint::Square => 2,
            Constraint::Auto | Constraint::FixedPrincipalPoint | Constraint::Focal => 1,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Starts of one constraint for another: what that holds is not moved by them.
    #[test]
    fn a_constraint_holds_what_those_with_more_unknowns_hold() {
        use Constraint::{Auto, FixedPrincipalPoint, Focal, Full, Square, ZeroSkew};
        for other in Constraint::ALL {
            assert!(Focal.holds_what(other) && other.holds_what(Full), "{other}");
        }
        assert!(ZeroSkew.holds_what(Auto) && Square.holds_what(ZeroSkew));
        assert!(!ZeroSkew.holds_what(Square) && !Square.holds_what(FixedPrincipalPoint) && !Full.holds_what(Auto));
    }

    #[test]
    fn files_and_command_line_use_the_same_names() {
        for c in Constraint::ALL {
            assert_eq!(serde_json::to_string(&c).unwrap(), format!("\"{}\"", c.name()));
        }
    }
}
