//! Frames whose attitude error is an outlier among those of the others.
//!
//! ```text
//! δ_i ~ N(0, σ_a²) of all frames but few,   δ_j ~ N(0, 0.05²) of frame j
//! ```
//!
//! With one deviation for all, a single wrong motion (a tripod leg that slipped, a pair of another attitude) makes σ_a large for all and
//! hides in it. So the frame with the greatest attitude error is tried as one that does not count: σ_a is that of the others, and the evidence
//! ([`crate::refine::Bundle`]) says whether that is the better account, the wide prior of the one having its price.

use crate::{
    calibrate::refinement_input::{Refined, RefinementInput},
    error::Error,
};

/// Most outlier frames, as a fraction of all: with more there is no telling which are the outliers.
const MAX_OUTLIER_FRACTION: f64 = 0.25;

/// The refinement in which the frame with the greatest attitude error is one that does not count; with it twice the logarithm of the odds.
///
/// # Errors
/// [`Error::Stopped`] and no other.
pub(super) fn with_outlier_frame(
    input: &RefinementInput<'_>,
    refined: &Refined,
    needed: f64,
) -> Result<Option<(f64, Refined)>, Error> {
    let bundle = &refined.joint.bundle;
    let mut options = refined.options.clone();
    let outliers = &mut options.bundle.outlier_frames;
    let all = bundle.state.frames.len();
    let suspect = refined.has_attitude_errors() && options.bundle.attitude_sigma_rad.is_none();
    if !suspect || (outliers.len() + 1) as f64 > MAX_OUTLIER_FRACTION * all as f64 {
        return Ok(None);
    }
    let squared = |frame: usize| bundle.state.frames[frame].delta_rad.iter().map(|d| d * d).sum::<f64>();
    let candidates = (0..all).filter(|frame| !outliers.contains(frame));
    let Some(frame) = candidates.max_by(|a, b| squared(*a).total_cmp(&squared(*b))) else { return Ok(None) };
    outliers.push(frame);
    input.better_with(refined, options, needed)
}
