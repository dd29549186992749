//! Scenes with truth, for tests, examples and benchmarks: everything here is deterministic by its seed.

pub mod bound;
pub mod floor_matches;
mod noise;
pub mod points;
pub mod render;
pub mod scene;
pub mod study;
mod texture;
