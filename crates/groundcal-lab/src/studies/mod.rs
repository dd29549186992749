//! The simulation studies of the paper and three beside them.

pub mod figure4;
pub mod radial;
pub mod subset;
pub mod transfer;
