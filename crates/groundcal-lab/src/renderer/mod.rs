//! Photographs of floors with exact truth, deterministic by their seed.

pub mod floor_matches;
mod noise;
mod optics;
pub mod render;
pub mod scene;
mod texture;
