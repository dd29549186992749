//! The simulation studies of the paper and three beside them.

pub mod catalogue;
pub mod figure4;
pub mod general;
pub mod radial;
pub mod reports;
pub mod setting;
pub mod subset;
pub mod transfer;
