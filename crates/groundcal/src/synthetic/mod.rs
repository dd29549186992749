//! Point scenes with truth and the Cramér-Rao bound, deterministic by their seed.

pub mod bound;
pub mod plane_views;
pub mod points;
