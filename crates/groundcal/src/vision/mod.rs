//! Grey images, resampling, masks, features, patches.

pub(crate) mod features;
pub(crate) mod image;
pub(crate) mod mask;
pub(crate) mod patches;
pub(crate) mod resample;
pub(crate) mod still;

pub use image::GrayImage;
pub use mask::Mask;
pub use resample::{Depth, Pyramid, Raster, Resampled, resample};
