//! A camera that turns while its pictures are read out, and in all of them alike: pictures out of a pan, or of a robot that turns on.
//!
//! ```text
//! x turned by v w about the plane's normal,   v: row from the middle, -1 to 1;   w ~ N(0, sigma_w^2), one for all pictures
//! ```
//!
//! A score test ([`crate::refine::prospect`]) says whether there is one; w is then held at what it finds, and found again there until nothing is left.
//! (Of turns that differ from picture to picture see [`super::departures`].)

use crate::{
    calibrate::refinement_input::{Refined, RefinementInput, RowTurn},
    error::Error,
    refine::{DepartureKind, prospect::row_turn_of_all},
};

/// Rounds of the turn: Newton's steps, of a number that is nearly linear.
const MAX_ROUNDS: usize = 3;
/// Standard deviations by which it moves when it is found.
const TOLERANCE_SIGMAS: f64 = 0.1;

/// The refinement with one turn while each picture is read out, where the tracks ask for it; with it twice the logarithm of the odds.
///
/// # Errors
/// [`Error::Stopped`] and no other.
pub(super) fn with_row_turn(
    input: &RefinementInput<'_>,
    refined: &Refined,
    needed: f64,
) -> Result<Option<(f64, Refined)>, Error> {
    if refined.row_turn.is_some() || refined.options.bundle.departures.contains(&DepartureKind::RowTurn) {
        return Ok(None);
    }
    let Some(mut found) = row_turn_of_all(&refined.joint.bundle).filter(|found| found.prospect.gain > needed) else {
        return Ok(None);
    };
    let (mut turn_rad, mut state) = (0.0, refined.joint.bundle.state.clone());
    let mut best = None;
    for _ in 0..MAX_ROUNDS {
        turn_rad += found.turn_rad;
        let mut options = refined.options.clone();
        options.bundle = options.bundle.for_trial();
        let starts = vec![state.read_out_turning(turn_rad)];
        let Some(mut tried) = input.tried(refined, refined.solution.clone(), options, starts)? else { break };
        let Some(left) = row_turn_of_all(&tried.joint.bundle) else { break };
        let gain = tried.gain_over(refined, f64::NEG_INFINITY).map(|gain| gain - left.price(turn_rad));
        state = tried.joint.bundle.state.clone();
        if let Some(twice_log_odds) = gain.filter(|gain| *gain > needed) {
            tried.row_turn = Some(RowTurn { turn_rad, twice_log_odds });
            best = Some((twice_log_odds, tried));
        }
        if left.turn_rad.abs() < TOLERANCE_SIGMAS * left.variance.sqrt() {
            break;
        }
        found = left;
    }
    Ok(best)
}
