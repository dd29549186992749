//! Scenes with truth, for tests, examples and benchmarks: everything here is deterministic by its seed.

pub mod bound;
pub mod floor_matches;
mod noise;
pub mod points;
pub mod radial_study;
pub mod render;
pub mod scene;
pub mod study;
pub mod subset_study;
mod texture;
pub mod transfer_study;
