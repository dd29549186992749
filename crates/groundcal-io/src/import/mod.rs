//! Cameras of this program and of others. The content tells the format, not the name.
//!
//! [`read_camera`] reads a file; `formats` has the table of formats; one file a format; below them what they share: `imported` (the
//! camera), `node` (YAML, XML and JSON as one tree), `key` and `spelling` (names in the wild), `lens` (lists of coefficients).

mod colmap;
mod formats;
pub mod groundcal_json;
mod imported;
mod json;
mod kalibr;
mod key;
mod lens;
mod nerfstudio;
mod node;
mod opencv;
mod read;
mod ros;
mod spelling;
mod truth_json;

pub use imported::ImportedCamera;
pub use read::{camera_file, read_camera};

#[cfg(test)]
pub(crate) use formats::parse;

#[cfg(test)]
mod tests;
