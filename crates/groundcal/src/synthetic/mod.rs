//! Point scenes with truth and the Cramér-Rao bound, deterministic by their seed.

pub(crate) mod bound;
pub(crate) mod plane_views;
pub(crate) mod points;

pub use bound::HeightModel;
pub use plane_views::PlaneViewScene;
pub use points::{MotionSpec, PointScene, turning_pairs};
