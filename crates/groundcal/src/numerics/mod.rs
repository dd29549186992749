//! Shared tools: linear algebra, one Levenberg-Marquardt loop, one RANSAC loop, statistics, the skyline matrix.

pub mod levenberg_marquardt;
pub mod linalg;
pub mod ransac;
pub mod skyline;
pub mod statistics;
