//! Matches of pairs of images, as tables give them.

use groundcal::pairs::correspondence::ImagePair;

/// Matches of pairs of images, from a CSV.
#[derive(Debug, Clone)]
pub struct PointPairs {
    /// Image names, in order of appearance (matches) or natural order (tracks).
    pub names: Vec<String>,
    /// Pairs that share points.
    pub pairs: Vec<ImagePair>,
    /// Whether pairs that are no neighbours were left out.
    pub neighbours_only: bool,
    /// The pairs that a list names, as indices of `names`.
    pub listed: Option<Vec<(usize, usize)>>,
}
