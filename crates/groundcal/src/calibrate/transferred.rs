//! The camera of one plane-normal motion and views joined to it ([`Method::Transferred`]; KZR 2.3): the circular point of the motion carried
//! into every view by the homography of the same plane, and eᵀ ω e = 0 of all with weight one ([`crate::start::transferred`]).
//!
//! Beside the answer stand its standard deviations, the noise of the points and an axis off the normal carried through to first order. The
//! axis is believed in every view: the joint refinement, which has all pairs as uncertain as they are, does better where there are
//! several motions.

use std::{cmp::Reverse, collections::BTreeMap};

use crate::{
    calibrate::{
        checks::unmodelled_distortion,
        options::Method,
        refinement::{MAX_LINK_MISFIT, MIN_LINK_MATCHES},
        solved::{Solved, share_of},
        soundness::check_field_of_view,
        stage_options::StageOptions,
    },
    error::Error,
    geometry::intrinsics::Intrinsics,
    ids::{ImageId, PairId},
    observer::Observer,
    pairs::{
        circular_points::from_homography, known_lens::KnownLens, observation::PairObservation, observe::refit,
        placed_lens::PlacedLens, refine::HomographyEstimate,
    },
    remedy::Remedy,
    select::{
        attitude_groups::{HorizonSides, Motion, group_attitudes_until},
        selection::Selection,
    },
    start::{
        absolute_conic::WeightedPoint,
        lens_uncertainty::covariance_of_lens,
        linear_camera::CameraSolution,
        transferred::{Join, Transferred, camera_transferred},
    },
};

/// A pair that joins a view to the motion, and whether it leads from that view to one of the motion.
struct JoiningPair {
    id: PairId,
    backwards: bool,
}

/// The camera of the motion selected, or of that of most matches among several, and of the views that most matches join to it.
///
/// # Errors
/// [`Error::TooFewAttitudes`] where no view or too few are joined; [`Error::NotPositiveDefinite`], [`Error::Undetermined`];
/// [`Error::Unsound`] for a view of another plane; [`Error::Stopped`].
pub(super) fn solve_transferred(
    pairs: &[PairObservation],
    selection: &Selection,
    lens: &KnownLens,
    stages: &StageOptions<'_>,
    observer: &dyn Observer,
) -> Result<Solved, Error> {
    let matches = |id: &PairId| pairs[*id].plane().map_or(0, |plane| plane.inliers.len());
    let Some(first) = selection.used().into_iter().max_by_key(|id| (matches(id), Reverse(*id))) else {
        return Err(Error::Numerical { stage: "transfer of circular points", detail: "no motion is selected".into() });
    };
    let joined = views_joined(pairs, first);
    let mut solution = camera(pairs, first, &joined, None, stages, observer)?;
    check_field_of_view(&solution.intrinsics, stages.size)?;
    let through = |lens: &PlacedLens| -> Result<Intrinsics, Error> {
        Ok(camera(pairs, first, &joined, Some(lens), stages, observer)?.intrinsics)
    };
    let mut lens_share = 0.0;
    if let Some(added) = covariance_of_lens(lens, through)? {
        solution.covariance_px += added;
        lens_share = share_of(&added, &solution.covariance_px);
    }
    let warnings = unmodelled_distortion(pairs, lens, &solution.intrinsics, through)?.into_iter().collect();
    Ok(Solved {
        method: Method::Transferred,
        constraint: stages.constraint_without_priors(),
        solution,
        joint: None,
        used: vec![first],
        links: joined.iter().map(|join| join.id).collect(),
        selection: Some(selection.clone().with_one(first, pairs)),
        lens_share,
        rotations_rad: None,
        amplification: None,
        warnings,
    })
}

/// Of every image that shares the moving plane with a view of the motion, the pair of most matches.
fn views_joined(pairs: &[PairObservation], first: PairId) -> Vec<JoiningPair> {
    let motion = pairs[first].images();
    let mut best: BTreeMap<ImageId, (usize, JoiningPair)> = BTreeMap::new();
    for pair in pairs {
        let [from, to] = pair.images().map(|image| motion.contains(&image));
        let (image, backwards) = match (from, to) {
            (true, false) => (pair.to, false),
            (false, true) => (pair.from, true),
            _ => continue,
        };
        let matches = pair.moving_plane().map_or(0, |plane| plane.inliers.len());
        if matches >= MIN_LINK_MATCHES && best.get(&image).is_none_or(|(most, _)| matches > *most) {
            best.insert(image, (matches, JoiningPair { id: pair.id, backwards }));
        }
    }
    best.into_values().map(|(_, join)| join).collect()
}

/// The camera from the homographies as they are, or through another lens.
fn camera(
    pairs: &[PairObservation],
    first: PairId,
    joined: &[JoiningPair],
    lens: Option<&PlacedLens>,
    stages: &StageOptions<'_>,
    observer: &dyn Observer,
) -> Result<CameraSolution, Error> {
    observer.go_on()?;
    let failed = || Error::Numerical { stage: "transfer of circular points", detail: "a homography is lost".into() };
    let estimate = |id: PairId| -> Result<HomographyEstimate, Error> {
        let plane = pairs[id].plane().ok_or_else(failed)?;
        match lens {
            None => Ok(plane.estimate.clone()),
            Some(lens) => refit(&pairs[id], plane, lens, &stages.frame).ok_or_else(failed),
        }
    };
    let geometry = from_homography(&estimate(first)?).map_err(|_| failed())?;
    let estimates = joined.iter().map(|join| estimate(join.id)).collect::<Result<Vec<_>, Error>>()?;
    let joins: Vec<Join<'_>> =
        estimates.iter().zip(joined).map(|(estimate, j)| Join { estimate, backwards: j.backwards }).collect();
    let (constraint, aspect) = (stages.constraint_without_priors(), stages.camera.aspect);
    let attitude_sigma_rad = stages.camera.attitude_sigma_rad;
    let solved = |covariance| {
        let point = WeightedPoint { point: geometry.circular_point.clone(), covariance };
        camera_transferred(&point, &joins, &stages.frame, constraint, aspect)
    };
    // What an axis off the normal does depends on the camera.
    let k = stages.frame.intrinsics_from_pixel(&solved(geometry.circular_point.covariance)?.camera.intrinsics);
    let Transferred { camera, estimated, misfits } =
        solved(geometry.circular_point.total_covariance(&k, attitude_sigma_rad))?;
    let tolerance = MAX_LINK_MISFIT + 2.0 * camera.covariance_px[(0, 0)].max(0.0).sqrt() / camera.intrinsics.fx;
    if let Some(worst) = misfits.iter().copied().reduce(f64::max).filter(|worst| *worst > tolerance) {
        return Err(Error::Unsound {
            reason: format!(
                "the views joined to the motion show its plane stretched by up to {:.0} %, where one camera stretches it in none: they see \
                 another plane, or the motion did not turn about the normal",
                100.0 * worst
            ),
            remedies: vec![Remedy::NamePairs, Remedy::CheckImages],
        });
    }
    let pair = &pairs[first];
    let motion = Motion { from: pair.from, to: pair.to, geometry, sides: HorizonSides::One };
    let groups = group_attitudes_until(&[motion], &k, attitude_sigma_rad, observer)?;
    Ok(CameraSolution {
        intrinsics: camera.intrinsics,
        covariance_px: camera.covariance_px,
        estimated,
        priors: Vec::new(),
        groups,
        chi_squared: 0.0,
        degrees_of_freedom: 0,
        attitude_sigma_rad,
        attitude_sigma_estimated: false,
        variance_inflation: 1.0,
    })
}
