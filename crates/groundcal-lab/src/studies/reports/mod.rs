//! Tables, figures and pages of the studies; one file a kind of study.

pub mod figure4;
pub mod general;
pub mod output;
pub mod radial;
pub mod subsets;
pub mod transfer;
