//! Tests of the stage as a whole.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)] // a test may end in a panic
#![allow(clippy::print_stdout)] // what was skipped or measured is shown

mod homographies;
mod shared_data;

use crate::{
    error::Error,
    geometry::frame::Frame,
    observer::Silent,
    pairs::{
        correspondence::PointMatch,
        refine::to_frame,
        robust::{RobustHomography, RobustOptions, estimate_in_frame},
    },
};

/// A homography with the matches it was made from.
fn estimate_robust(matches: &[PointMatch], frame: &Frame, options: &RobustOptions) -> Result<RobustHomography, Error> {
    estimate_in_frame(&to_frame(matches, frame), frame, options, &Silent)
}
