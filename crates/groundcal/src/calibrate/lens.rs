//! The lens in the driver: before motions are selected and again from those selected, estimated or given.

use rayon::prelude::*;

use crate::{
    calibrate::{options::Method, stage_options::StageOptions},
    error::Error,
    geometry::intrinsics::Intrinsics,
    observer::Observer,
    pairs::{
        known_lens::{DistortionCentre, KnownLens, LensFromPlanes, LensOptions, lens_of_motions, placement_of},
        lens_placement::LensPlacement,
        observation::PairObservation,
        observe::{observe_again, observe_anew, refit_all},
        placed_lens::PlacedLens,
    },
    select::selection::Selection,
    start::{
        from_pairs::{camera_of_motions_through, camera_of_rotations_through},
        given_lens::{FixedPoint, fixed_point},
        linear_camera::{CameraSolution, solve_camera_until},
    },
};

/// Times that motions are selected and a given lens put through their camera, in turn.
const GIVEN_ROUNDS: usize = 2;
/// Times that the lens is estimated from the motions and their homographies anew.
const ESTIMATED_ROUNDS: usize = 3;
/// Principal points known better than this fraction of the width become the centre of distortion.
const KNOWN_CENTRE: f64 = 0.02;
/// The same images told it, through a lens not yet known: it is not taken to be known better than half a per cent.
const CENTRE_SIGMA_FLOOR: f64 = 5e-3;

/// Pairs, which of them are motions, and the given lens through the camera of those: its coefficients act on coordinates divided by
/// the focal length, which is not known beforehand. `select` says which pairs are motions.
///
/// # Errors
/// Those of `select` and of the camera; [`Error::Stopped`].
pub(super) fn through_own_camera(
    mut pairs: Vec<PairObservation>,
    mut selection: Selection,
    start: PlacedLens,
    select: impl Fn(&[PairObservation]) -> Result<Selection, Error>,
    stages: &StageOptions<'_>,
    observer: &dyn Observer,
) -> Result<(Vec<PairObservation>, Selection, FixedPoint), Error> {
    let mut found = given_lens_of(&pairs, &selection, start, stages, observer)?;
    for round in 1..=GIVEN_ROUNDS {
        pairs = observe_anew(pairs, Some(&found.lens), &stages.observe, observer)?;
        selection = select(&pairs)?;
        if round < GIVEN_ROUNDS {
            found = given_lens_of(&pairs, &selection, found.lens, stages, observer)?;
        }
    }
    Ok((pairs, selection, found))
}

/// The given coefficients through the camera of the pairs selected.
fn given_lens_of(
    pairs: &[PairObservation],
    selection: &Selection,
    start: PlacedLens,
    stages: &StageOptions<'_>,
    observer: &dyn Observer,
) -> Result<FixedPoint, Error> {
    let used = selection.used();
    let rotating = stages.options.method == Method::Rotating;
    fixed_point(start, |lens: &PlacedLens| -> Result<Intrinsics, Error> {
        observer.go_on()?;
        Ok(if rotating {
            camera_of_rotations_through(lens, pairs, &used, &stages.frame, &stages.rotating, observer)?.intrinsics
        } else {
            camera_of_motions_through(lens, pairs, &used, &stages.frame, &stages.camera, observer)?.intrinsics
        })
    })
}

/// The given coefficients through the camera of motions whose homographies became better, and those homographies undone by it.
///
/// # Errors
/// Those of the camera; [`Error::Stopped`].
pub(super) fn given_lens_of_motions(
    pairs: Vec<PairObservation>,
    selection: &Selection,
    start: PlacedLens,
    stages: &StageOptions<'_>,
    observer: &dyn Observer,
) -> Result<(Vec<PairObservation>, FixedPoint), Error> {
    let found = given_lens_of(&pairs, selection, start, stages, observer)?;
    Ok((refit_all(pairs, &found.lens, &stages.frame, observer)?, found))
}

/// A known lens that sees behind the camera through the camera matrix that the planes of the motions tell, and their homographies undone
/// by it.
///
/// # Errors
/// [`Error::Stopped`] and no other.
pub(super) fn lens_placed_by_motions(
    pairs: Vec<PairObservation>,
    selection: &Selection,
    before: LensPlacement,
    stages: &StageOptions<'_>,
    observer: &dyn Observer,
) -> Result<(Vec<PairObservation>, KnownLens), Error> {
    let measured = if before.of_model_alone {
        before.lens
    } else {
        PlacedLens { intrinsics: stages.options.camera_of_lens(stages.size), ..before.lens }
    };
    let found = placement_of(&pairs, &selection.used(), &before, &measured, &stages.frame, observer)?;
    let placement = LensPlacement { of_model_alone: before.of_model_alone, ..found.unwrap_or(before) };
    Ok((refit_all(pairs, &placement.lens, &stages.frame, observer)?, KnownLens::Placed(placement)))
}

/// The lens from the motions selected alone, about the principal point that they give, and their homographies with it undone, in
/// turn.
///
/// # Errors
/// [`Error::Stopped`] and no other.
pub(super) fn estimated_lens_of_motions(
    mut pairs: Vec<PairObservation>,
    mut selection: Selection,
    lens: KnownLens,
    options: &LensOptions,
    stages: &StageOptions<'_>,
    observer: &dyn Observer,
) -> Result<(Vec<PairObservation>, Selection, KnownLens), Error> {
    let mut finding: Option<LensFromPlanes> = match lens {
        KnownLens::Estimated(finding) => Some(finding),
        KnownLens::NotModelled | KnownLens::Given(_) | KnownLens::Placed(_) | KnownLens::OfPairs(_) => None,
    };
    for _ in 0..ESTIMATED_ROUNDS {
        selection = selection.confirmed(&pairs);
        let used = selection.used();
        let camera = solve_camera_until(&selection.motions(&pairs), &stages.frame, &stages.camera, observer).ok();
        observer.go_on()?;
        let centre = distortion_centre(camera.as_ref(), options);
        let Some(next) = lens_of_motions(&pairs, &used, centre, finding.as_ref(), options, observer)? else { break };
        let nothing_new = !next.significant && finding.as_ref().is_some_and(|before| !before.significant);
        if !nothing_new {
            let known: &[PairObservation] = &pairs;
            let again: Vec<PairObservation> = used
                .par_iter()
                .map(|&id| observe_again(&known[id], next.lens(), &stages.observe, observer))
                .collect::<Result<_, Error>>()?;
            for pair in again {
                let place = pair.id.index();
                pairs[place] = pair;
            }
        }
        finding = Some(next);
        if nothing_new {
            break;
        }
    }
    let selection = selection.confirmed(&pairs);
    Ok((pairs, selection, finding.into()))
}

/// The principal point, where it is known well enough.
fn distortion_centre(camera: Option<&CameraSolution>, options: &LensOptions) -> DistortionCentre {
    let assumed = options.assumed_centre();
    let Some(camera) = camera.filter(|c| c.estimated[2]) else { return assumed };
    let variance = camera.covariance_px[(2, 2)].max(camera.covariance_px[(3, 3)]);
    let known = variance.sqrt() / options.size.width as f64;
    if known < KNOWN_CENTRE {
        let k = &camera.intrinsics;
        return DistortionCentre { px: [k.cx, k.cy], sigma: known.max(CENTRE_SIGMA_FLOOR) };
    }
    assumed
}
