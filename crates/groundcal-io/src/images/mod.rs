//! Images in: files to grey values.
//!
//! `decode` turns a file into samples as stored (`stored`), through `tiff`, `jpeg` (with `jpeg_scan`) and `convert` where the `image`
//! crate does not do; `range` says which values are black and white; `grey` makes one number of each pixel.

mod convert;
mod decode;
mod grey;
mod jpeg;
mod jpeg_scan;
pub(crate) mod range;
mod read;
mod stored;
mod tiff;

pub use range::{ValueRange, ValueRanges};
pub use read::{Images, read_image, read_image_bytes, read_images, read_stored};
pub use stored::{Samples, StoredImage};

#[cfg(test)]
mod tests;
