//! What one pair of images says: matches, homography, circular point, lens from planes.

pub mod circular_points;
pub mod correspondence;
pub mod dlt;
pub(crate) mod known_lens;
pub(crate) mod observation;
pub(crate) mod observe;
pub(crate) mod patch;
pub mod plane_lens;
pub mod refine;
pub mod robust;
