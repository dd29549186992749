//! Pixels and points of the floor; bird's-eye and undistorted pictures.

pub(crate) mod layout;
pub(crate) mod odometry;
mod outline;
pub(crate) mod placed;
pub(crate) mod points;
pub(crate) mod projection;
mod rectified;
pub(crate) mod rectify;
pub(crate) mod scale;
pub(crate) mod undistort;
pub(crate) mod view;

pub use layout::{DEFAULT_EXTENT_HEIGHTS, FloorLayout, Resolution, ResolutionError, Up, sets_of_one_world};
pub use odometry::{BasePose, with_odometry};
pub use placed::{Placed, placed};
pub use points::{FloorPoint, ImagePoint, Length, MeasuringView};
pub use projection::{CELLS, projection_uncertainty};
pub use rectified::rectify_image;
pub use rectify::{Mosaic, rectify};
pub use scale::{KnownDistance, with_floor_distance};
pub use undistort::{Fit, Undistortion};
pub use view::{FloorGrid, FloorView};

#[cfg(test)]
mod tests;
