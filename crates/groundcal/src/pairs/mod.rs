//! What one pair of images says: matches, homography, circular point, lens from planes.

pub mod circular_points;
pub mod correspondence;
pub mod division;
pub mod dlt;
pub(crate) mod known_lens;
pub(crate) mod lens_placement;
pub(crate) mod observation;
pub(crate) mod observe;
pub mod pair_lens;
pub(crate) mod patch;
pub mod placed_lens;
pub mod plane_lens;
pub(crate) mod ray_match;
pub mod refine;
pub(crate) mod residual;
pub mod robust;
