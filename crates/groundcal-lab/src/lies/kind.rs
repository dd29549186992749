//! What a family is, and what the program is given of it.

use serde::{Deserialize, Serialize};

/// How a family stands to what the program assumes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Kind {
    /// Something assumed does not hold.
    Violated,
    /// What is asked for does not follow from the pictures, or hardly.
    Degenerate,
    /// The camera moved in a more general way than about a plane's normal.
    General,
    /// All that is assumed holds.
    WellSpecified,
}

impl Kind {
    /// A word for tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Violated => "violated",
            Self::Degenerate => "degenerate",
            Self::General => "general",
            Self::WellSpecified => "well-specified",
        }
    }
}

/// What the program is given.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Medium {
    /// Matches.
    Points,
    /// Pictures.
    Pictures,
}
