//! What a reader had to do or to leave out, for the user: values and the sentences about them.

use std::path::Path;

use crate::text::{printable, shown};

/// A remark that does not stop the work.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Note {
    /// What kind of remark; does not change.
    pub code: &'static str,
    /// The file it is about; nothing: all of them.
    pub file: Option<String>,
    /// The sentence.
    pub what: String,
}

impl Note {
    /// A JPEG that ends early or is damaged inside.
    pub const DAMAGED_IMAGE: &str = "damaged_image";
    /// Values that do not fill the range of their type.
    pub const VALUE_RANGE: &str = "value_range";
    /// An image read by another program.
    pub const CONVERTED_IMAGE: &str = "converted_image";
    /// One of several pages.
    pub const SEVERAL_PAGES: &str = "several_pages";
    /// What a camera's file says beside its camera, or does not say.
    pub const CAMERA_FILE: &str = "camera_file";
    /// Tracks left out because there are very many.
    pub const THINNED_TRACKS: &str = "thinned_tracks";
    /// Points in a corner of the images that their size says.
    pub const POINTS_IN_A_CORNER: &str = "points_in_a_corner";
    /// A picture written with fewer bits than it has.
    pub const DEPTH_LOST: &str = "depth_lost";

    pub(crate) fn file(code: &'static str, path: &Path, what: impl Into<String>) -> Self {
        Self { code, file: Some(shown(path)), what: what.into() }
    }

    pub(crate) fn all(code: &'static str, what: impl Into<String>) -> Self {
        Self { code, file: None, what: what.into() }
    }
}

impl std::fmt::Display for Note {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match &self.file {
            Some(file) => write!(f, "{file}: {}", printable(&self.what)),
            None => f.write_str(&printable(&self.what)),
        }
    }
}
