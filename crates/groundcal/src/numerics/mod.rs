//! Shared tools: linear algebra, one Levenberg-Marquardt loop, one RANSAC loop, statistics, graphs, the skyline matrix.

pub mod graph;
pub mod levenberg_marquardt;
pub mod linalg;
pub mod ransac;
pub mod skyline;
pub mod statistics;
