//! Shared tools: linear algebra, one Levenberg-Marquardt loop, one RANSAC loop, statistics, graphs, the skyline matrix and its factor.

pub(crate) mod graph;
pub(crate) mod levenberg_marquardt;
pub(crate) mod linalg;
pub(crate) mod ransac;
pub(crate) mod skyline;
pub(crate) mod skyline_cholesky;
pub(crate) mod statistics;

pub use graph::components;
pub use statistics::{NORMAL_95, chi_squared_survival, median};
