//! Which pairs are plane-normal motions, and which of them share an attitude.

pub mod attitude_groups;
pub mod plane_normal;
