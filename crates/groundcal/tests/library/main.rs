//! The library from outside. One test binary: every further one would compile the same generic code again.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)] // a test may end in a panic

mod copies;
mod departures;
mod doubts;
mod exact;
mod fisheye;
mod floor_points;
mod floor_views;
mod general_motion;
mod invariance;
mod lens;
mod named_pairs;
mod prior_conflicts;
mod rotating_camera;
mod stated_noise;
mod statistics;
mod stop;
mod thresholds;
mod verdict;
mod words;
