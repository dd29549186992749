//! Images in: files to grey values.
//!
//! `decode` turns a file into samples as stored (`stored`), through `tiff`, `jpeg` (with `jpeg_scan`) and `convert` where the `image`
//! crate does not do; `range` says which values are black and white; `grey` makes one number of each pixel. `array`: pictures that are in memory already. `masks` says what of
//! them is used; `focal_length` reads what photographs say they were taken with.

mod array;
mod convert;
mod decode;
mod focal_length;
mod grey;
mod jpeg;
mod jpeg_scan;
mod masks;
pub(crate) mod range;
mod read;
mod stored;
mod tiff;

pub use array::{ArrayImage, Pixels};
pub use focal_length::stated_focal_length_mm;
pub use masks::MaskFiles;
pub use range::{ValueRange, ValueRanges};
pub use read::{Arrays, Images, read_image, read_image_bytes, read_images, read_images_until, read_stored};
pub use stored::{Samples, StoredImage};

#[cfg(test)]
mod tests;
