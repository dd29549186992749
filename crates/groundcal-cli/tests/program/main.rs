//! The program from end to end. One test binary: every further one would link the whole program again.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)] // a test may end in a panic

mod bad_inputs;
mod causes;
mod cli;
mod common;
mod documents;
mod experiments;
mod fisheye;
mod formats;
mod kills;
mod masks;
mod outputs;
mod plan;
mod readers;
mod rectify;
mod report;
mod result;
mod schema;
mod shared_data;
mod simulate;
mod structure;
mod terminal;
