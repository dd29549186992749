//! The library from outside. One test binary: every further one would compile the same generic code again.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)] // a test may end in a panic

mod copies;
mod degenerate_heads;
mod departures;
mod exact;
mod fisheye;
mod floor;
mod floor_points;
mod floor_views;
mod general_motion;
mod homographies;
mod invariance;
mod lens;
mod named_pairs;
mod plan;
mod prior_conflicts;
mod published;
mod refinement;
mod refinement_blocks;
mod rotating_camera;
mod selection;
mod shared_data;
mod statistics;
mod stop;
mod thresholds;
mod verdict;
mod words;
