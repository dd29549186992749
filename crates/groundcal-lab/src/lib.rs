//! groundcal's laboratory: rendered scenes with truth, the paper's studies and experiments, and what only they use.
//!
//! It draws, renders, runs and sums up; tables, figures and pictures come back as values, which the program writes.

#![forbid(unsafe_code)]

pub mod error;
pub mod experiments;
pub mod lies;
pub mod progress;
mod rank_correlation;
pub mod render_scene;
pub mod renderer;
pub mod studies;
pub mod subsets;
pub mod tables;
