//! What one pair of images says: matches, homography, circular point, lens from planes.

pub(crate) mod circular_points;
pub(crate) mod correspondence;
pub(crate) mod division;
pub(crate) mod dlt;
pub(crate) mod known_lens;
pub(crate) mod lens_placement;
pub(crate) mod observation;
pub(crate) mod observe;
pub(crate) mod pair_lens;
pub(crate) mod patch;
pub(crate) mod placed_lens;
pub(crate) mod plane_lens;
pub(crate) mod ray_match;
pub(crate) mod refine;
pub(crate) mod residual;
pub(crate) mod robust;

pub use circular_points::shows_turn;
pub use correspondence::{ImagePair, PointMatch, validated};
pub use division::{division_of_motion, division_of_motions};
pub use dlt::direct_linear_transformation;
pub use pair_lens::RadialCorrection;
pub use placed_lens::ideal_match;
pub use refine::{HomographyEstimate, gold_standard_homography};
pub use robust::{RobustOptions, robust_homography};

#[cfg(test)]
mod tests;
