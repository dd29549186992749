//! Grey images, resampling, masks, features, patches.

pub mod features;
pub mod image;
pub mod mask;
pub mod patches;
pub mod resample;
pub mod still;
