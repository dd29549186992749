//! Whether to trust an answer, in one word, and why not more.
//!
//! | level | what it says |
//! |---|---|
//! | trustworthy | what was assumed has been tried against the images and held |
//! | usable | the same, but the images decide less than all: the doubts are named, and are in the error bars |
//! | unchecked | the images show something that the model leaves out, or nothing tried what it assumes: the error bars may not hold |
//! | contradicted | the images contradict the answer: there is none ([`crate::error::Error::Unsound`]) |
//!
//! [`crate::result::judge`] gives it.

use serde::{Deserialize, Serialize};

/// How far an answer can be trusted; the best first.
///
/// # Examples
/// ```
/// use groundcal::VerdictLevel;
/// assert!(VerdictLevel::Trustworthy < VerdictLevel::Unchecked, "the best first");
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum VerdictLevel {
    /// What was assumed has been tried, and held.
    Trustworthy,
    /// So it has, but the images decide less than all.
    Usable,
    /// The images show what the model leaves out, or nothing tried what it assumes.
    Unchecked,
    /// The images contradict the answer; it is not given.
    Contradicted,
}

/// The name as in files.
impl std::fmt::Display for VerdictLevel {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.pad(match self {
            Self::Trustworthy => "trustworthy",
            Self::Usable => "usable",
            Self::Unchecked => "unchecked",
            Self::Contradicted => "contradicted",
        })
    }
}

/// Why an answer is no better than its level.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct VerdictReason {
    /// Stable name: that of a warning, of an error, or one of the verdict's own.
    pub code: String,
    /// What it means, with numbers.
    pub message: String,
}

/// Whether to trust an answer.
///
/// # Examples
/// ```
/// # use groundcal::{ImagePair, Options, Silent, calibrate_matches, synthetic::PointScene};
/// # let scene = PointScene::nominal(0);
/// # let pairs: Vec<ImagePair> = scene.pairs();
/// # let names: Vec<String> = (0..6).map(|i| format!("view {i}")).collect();
/// # let calibration = calibrate_matches(&names, scene.size, &pairs, &Options::default(), &Silent)?;
/// use groundcal::VerdictLevel;
/// let verdict = calibration.verdict.expect("asked");
/// if verdict.level > VerdictLevel::Trustworthy {
///     verdict.reasons.iter().for_each(|r| println!("[{}] {}", r.code, r.message));
/// }
/// # Ok::<(), groundcal::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Verdict {
    /// In one word.
    pub level: VerdictLevel,
    /// Whether more than the height ratio of a single motion tried that the camera turned about the floor's normal, or on the spot: a
    /// second attitude, a third view, or turns that close.
    pub checked: bool,
    /// Why it is no better; empty where it is trustworthy. Those that weigh most come first.
    pub reasons: Vec<VerdictReason>,
}
