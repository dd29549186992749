//! Tests of the stage as a whole.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)] // a test may end in a panic
#![allow(clippy::print_stdout)] // what was skipped or measured is shown

mod floor;
