//! How large what is read may be.

use std::ops::RangeInclusive;

/// Pixels of one image.
pub const MAX_PIXELS: u64 = 150_000_000;
/// Pixels of all images of one run together: 8 GB as grey values.
pub const MAX_PIXELS_TOGETHER: u64 = 2_000_000_000;
/// Sides of an image, in pixels.
pub const SIDES_PX: RangeInclusive<u64> = 2..=100_000;
/// Focal lengths that a camera can have: the longest telescope on the finest pixels stays below.
pub const FOCAL_LENGTHS_PX: RangeInclusive<f64> = 1e-3..=1e7;

/// Pairs of images of a table: four hundred images, all with all; each pair that has a plane takes kilobytes until the end.
pub const MAX_PAIRS: usize = 80_000;
/// Matches of all pairs of a table of tracks together. Tracks are thinned to that: a hundred thousand matches a pair tell no more of a
/// camera than ten thousand, as what they have in common (lens model, floor) is in all of them.
pub const MAX_MATCHES: usize = 4_000_000;

/// Memory a decoder may ask for: 100 megapixels of 16-bit RGBA.
pub(crate) const MAX_DECODER_BYTES: u64 = 1 << 30;
/// Bytes of an image file.
pub(crate) const MAX_IMAGE_BYTES: u64 = 1 << 30;
/// Bytes of a table of matches or tracks: about ten million rows.
pub(crate) const MAX_TABLE_BYTES: u64 = 512 << 20;
/// Bytes of a calibration: this program's own, of very many views, is the largest.
pub(crate) const MAX_CAMERA_BYTES: u64 = 64 << 20;
/// Values in a JSON file, each of which takes hundreds of bytes while it is read: a calibration of [`MAX_CAMERA_BYTES`] has half as many.
pub(crate) const MAX_JSON_VALUES: usize = 4_000_000;
/// Bytes of a camera in YAML or XML, whose parsers need many times that.
pub(crate) const MAX_MARKUP_BYTES: usize = 4 << 20;
