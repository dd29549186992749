//! Pictures that depart from each other in what is taken for common to all: focus, a rolling shutter, a stabiliser.
//!
//! ```text
//! pixel_i = e^φi (K lens(x) - c) + c + s_i,   x turned by v w_i about the plane's normal;   φ ~ N(0, σ_f²), w ~ N(0, σ_w²), s ~ N(0, σ_s²)
//! ```
//!
//! None of this need show in the residuals either: attitude and height errors, which are estimated, follow. So each kind of departure is
//! tried, its deviation estimated as the others are (restricted likelihood), and kept where the evidence
//! ([`crate::refine::Bundle`]) is for it by [`RELEASE_ODDS`](super::prior_conflicts), in which its freedom has its price.

use crate::{
    calibrate::refinement_input::{Refined, RefinementInput, RefinementOptions, RowTurn},
    error::Error,
    refine::{DepartureKind, blocks::MATRIX},
    result::{PictureDeparture, Warning},
};

/// Design effect from which on departures are tried: residuals of neighbours that have nothing in common have 1.
const SUSPECT_DESIGN_EFFECT: f64 = 1.0;

/// The options with a kind of departure; `None`: there is no reason to try it.
pub(super) fn departing(refined: &Refined, kind: DepartureKind) -> Option<RefinementOptions> {
    let bundle = &refined.joint.bundle;
    let suspect = refined.has_attitude_errors() || bundle.design_effects.iter().any(|e| *e > SUSPECT_DESIGN_EFFECT);
    // A lens or attitudes that are held because that was asked for may be wrong, and pictures that depart could hide it.
    let asked = &refined.options.bundle;
    let held = asked.attitude_sigma_rad.is_some() || !asked.cameras[0].is_free(MATRIX);
    if !suspect
        || held
        || asked.departures.contains(&kind)
        || (kind == DepartureKind::RowTurn && refined.row_turn.is_some())
    {
        return None;
    }
    let mut options = refined.options.clone();
    options.bundle.departures.push(kind);
    Some(options)
}

/// The options with each kind of departure where views moved in any way before a plane: what they promise is looked at there, and none is taken, since
/// one account of what was seen beside that is one too many.
pub(super) fn unasked_departures(refined: &Refined) -> Vec<(DepartureKind, RefinementOptions)> {
    let asked = &refined.options.bundle;
    if asked.attitude_sigma_rad != Some(f64::INFINITY) || !asked.cameras[0].is_free(MATRIX) {
        return Vec::new();
    }
    let with = |kind: DepartureKind| {
        let mut options = refined.options.clone();
        options.bundle.departures.push(kind);
        (kind, options)
    };
    DepartureKind::ALL.into_iter().map(with).collect()
}

/// The refinement with a kind of departure ([`departing`]), where the tracks ask for it; with it twice the logarithm of the odds.
///
/// # Errors
/// [`Error::Stopped`] and no other.
pub(super) fn with_departure(
    input: &RefinementInput<'_>,
    refined: &Refined,
    kind: DepartureKind,
    options: RefinementOptions,
    needed: f64,
) -> Result<Option<(f64, Refined)>, Error> {
    let better = input.better_with(refined, options, needed)?;
    Ok(better.map(|(gain, mut with)| {
        with.departures.push((kind, gain));
        (gain, with)
    }))
}

/// What is said of the departures found, and of what the images leave open.
pub(super) fn departures_found(refined: &Refined) -> Vec<Warning> {
    let scale_px = refined.options.frame.scale_px;
    let found = |&(kind, twice_log_odds): &(DepartureKind, f64)| {
        let sigma = refined.joint.bundle.departure_sigmas[kind as usize].sigma;
        let (departure, sigma) = match kind {
            DepartureKind::Focal => (PictureDeparture::FocalLength, 100.0 * sigma),
            // From the first row to the last.
            DepartureKind::RowTurn => (PictureDeparture::RowTurn, 2.0 * sigma.to_degrees()),
            DepartureKind::Shift => (PictureDeparture::Shift, scale_px * sigma),
        };
        Warning::PicturesDepart { departure, sigma, twice_log_odds }
    };
    let of_all = refined.row_turn.map(|RowTurn { turn_rad, twice_log_odds }| Warning::PicturesDepart {
        departure: PictureDeparture::RowTurn,
        sigma: 2.0 * turn_rad.abs().to_degrees(),
        twice_log_odds,
    });
    refined.departures.iter().map(found).chain(of_all).chain(refined.open_assumption.clone()).collect()
}
