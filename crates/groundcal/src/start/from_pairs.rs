//! The closed-form cameras of pairs selected, also with the distortion of another lens undone anew in their matches.

use rayon::prelude::*;

use crate::{
    error::Error,
    geometry::{frame::Frame, lens::Lens},
    ids::PairId,
    observer::Observer,
    pairs::{
        circular_points::from_homography, observation::PairObservation, observe::refit, placed_lens::PlacedLens,
        refine::HomographyEstimate,
    },
    select::attitude_groups::{HorizonSides, Motion},
    start::{
        linear_camera::{CameraOptions, CameraSolution, solve_camera_until},
        rotating_camera::{RotatingOptions, RotatingSolution, calibrate_rotating},
    },
};

/// The camera of plane-normal motions `used` after undoing the distortion of `lens` anew on the matches of their planes.
///
/// # Errors
/// See [`crate::start::linear_camera::solve_camera`]; [`Error::InvalidOption`] for a lens that cannot be undone where the matches are; [`Error::Stopped`].
pub(crate) fn camera_of_motions_through(
    lens: &PlacedLens,
    pairs: &[PairObservation],
    used: &[PairId],
    frame: &Frame,
    options: &CameraOptions,
    observer: &dyn Observer,
) -> Result<CameraSolution, Error> {
    solve_camera_until(&motions_through(lens, pairs, used, frame, observer)?, frame, options, observer)
}

/// Those motions.
///
/// # Errors
/// [`Error::InvalidOption`] for a lens that cannot be undone where the matches are; [`Error::Stopped`].
pub(crate) fn motions_through(
    lens: &PlacedLens,
    pairs: &[PairObservation],
    used: &[PairId],
    frame: &Frame,
    observer: &dyn Observer,
) -> Result<Vec<Motion>, Error> {
    let motion = |&id: &PairId| {
        let pair = &pairs[id];
        let estimate = refit(pair, &pair.outcome.as_ref().ok()?.plane, lens, frame)?;
        let geometry = from_homography(&estimate).ok()?;
        Some(Motion { from: pair.from, to: pair.to, geometry, sides: HorizonSides::One })
    };
    let motions = unless_stopped(used, motion, observer)?;
    if motions.is_empty() && !used.is_empty() {
        return Err(Error::InvalidOption(format!(
            "the lens distortion {} cannot be undone where the matches are: the lens folds over inside the image. Check the sign and \
             size of the coefficients",
            named_parameters(&lens.lens)
        )));
    }
    Ok(motions)
}

/// The camera of the rotations `used`.
///
/// # Errors
/// See [`calibrate_rotating`].
pub(crate) fn camera_of_rotations(
    pairs: &[PairObservation],
    used: &[PairId],
    options: &RotatingOptions,
) -> Result<RotatingSolution, Error> {
    let estimates: Vec<HomographyEstimate> =
        used.iter().filter_map(|&id| Some(pairs[id].plane()?.estimate.clone())).collect();
    calibrate_rotating(&estimates, options)
}

/// The same after undoing the distortion of `lens` anew.
///
/// # Errors
/// See [`calibrate_rotating`]; [`Error::Stopped`].
pub(crate) fn camera_of_rotations_through(
    lens: &PlacedLens,
    pairs: &[PairObservation],
    used: &[PairId],
    frame: &Frame,
    options: &RotatingOptions,
    observer: &dyn Observer,
) -> Result<RotatingSolution, Error> {
    let again = |&id: &PairId| refit(&pairs[id], pairs[id].plane()?, lens, frame);
    calibrate_rotating(&unless_stopped(used, again, observer)?, options)
}

/// `k1 = -0.1, k2 = 0.02` and so on, those that are zero at the end left out.
fn named_parameters(lens: &Lens) -> String {
    let values = lens.parameters();
    let last = values.iter().rposition(|v| *v != 0.0).map_or(0, |last| last + 1);
    let named = lens.parameter_names().iter().zip(&values).take(last);
    named.map(|(name, value)| format!("{name} = {value}")).collect::<Vec<_>>().join(", ")
}

fn unless_stopped<T: Send>(
    used: &[PairId],
    work: impl Fn(&PairId) -> Option<T> + Sync,
    observer: &dyn Observer,
) -> Result<Vec<T>, Error> {
    let all: Vec<Option<T>> =
        used.par_iter().map(|id| observer.go_on().map(|()| work(id))).collect::<Result<_, Error>>()?;
    Ok(all.into_iter().flatten().collect())
}
