//! Matches of pairs of images, as tables give them.

use std::path::Path;

use groundcal::{geometry::ImageSize, pairs::ImagePair};

use crate::note::Note;

/// Part of the image that points must reach in one direction at least. Whatever is photographed, in some image it reaches beyond the
/// top left quarter.
const MIN_EXTENT_FRACTION: f64 = 0.5;

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
    /// What there is to say about the table.
    pub notes: Vec<Note>,
}

impl PointPairs {
    /// With a remark where the image size can hardly be right.
    pub(crate) fn judged(mut self, path: &Path, size: ImageSize) -> Self {
        let points = || self.pairs.iter().flat_map(|p| p.matches.iter().flat_map(|m| [m.a, m.b]));
        let right = points().map(|p| p.x).fold(0.0, f64::max);
        let bottom = points().map(|p| p.y).fold(0.0, f64::max);
        if right < MIN_EXTENT_FRACTION * size.width as f64 && bottom < MIN_EXTENT_FRACTION * size.height as f64 {
            let what = format!(
                "all points lie within the first {:.0} x {:.0} of {size} pixels: check the image size (--image-size)",
                right.ceil(),
                bottom.ceil()
            );
            self.notes.push(Note::file(Note::POINTS_IN_A_CORNER, path, what));
        }
        self
    }
}
