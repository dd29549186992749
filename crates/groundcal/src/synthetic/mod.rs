//! Point scenes with truth and the Cramér-Rao bound, deterministic by their seed.

pub(crate) mod bound;
pub(crate) mod plane_views;
pub(crate) mod points;

pub use bound::{HeightModel, cramer_rao_bound, plane_views_bound};
pub use plane_views::{PlaneViewScene, PlaneViews};
pub use points::{MotionSpec, PointScene, SyntheticPair, turning_pairs};
