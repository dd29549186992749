//! Grey images, resampling, features, patches.

pub mod features;
pub mod image;
pub mod patches;
pub mod resample;
