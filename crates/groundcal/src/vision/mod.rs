//! Grey images, resampling, masks, features, patches.

pub(crate) mod features;
pub(crate) mod image;
pub(crate) mod mask;
pub(crate) mod patches;
pub(crate) mod resample;
pub(crate) mod still;

pub use features::{Feature, FeatureOptions, Features, MatchOptions, detect, match_features};
pub use image::GrayImage;
pub use mask::Mask;
pub use patches::{PatchMatch, PatchOptions, match_patches, template_grid};
pub use resample::{Depth, Pyramid, Raster, Resampled, resample};
pub use still::{StillParts, still_parts};
