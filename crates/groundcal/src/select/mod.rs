//! Which pairs are motions, of which kind, and which motions share an attitude.

pub(crate) mod attitude_groups;
pub(crate) mod consistent_set;
pub(crate) mod general;
pub(crate) mod plane_normal;
pub(crate) mod rotations;
pub(crate) mod selection;
