//! Scenes with truth, for tests, examples and benchmarks: everything here is deterministic by its seed.

pub mod bound;
pub mod points;
