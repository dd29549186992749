//! The plane of pairs matched again patch by patch (see [`crate::vision::patches`]).

use std::collections::{BTreeMap, BTreeSet, HashSet};

use nalgebra::Vector2;
use rayon::prelude::*;

use crate::{
    error::Error,
    ids::{ImageId, PairId},
    observer::{Observer, Stage},
    pairs::{
        correspondence::{ImagePair, PointMatch},
        observation::{PairObservation, Superseded, TurningPlane, carried},
        observe::{ObserveOptions, outcome_of_patches},
        placed_lens::PlacedLens,
    },
    vision::{
        image::GrayImage,
        patches::{PatchOptions, match_patches_until, template_grid_until},
    },
};

/// Options of [`match_by_patches`].
#[derive(Debug, Clone, Copy)]
pub(crate) struct PatchStageOptions {
    /// Least squares matching.
    pub(crate) patches: PatchOptions,
    /// The homographies of what is matched.
    pub(crate) observe: ObserveOptions,
}

/// Every so many of an image's patches are sought in views of other attitudes.
const LINK_STRIDE: usize = 3;
/// Fewest patches that replace feature matches.
const MIN_PATCHES: usize = 30;
/// Distance from the border, in half sides of a patch, within which a patch may be found missing because part of it is outside.
const LOST_MARGIN: f64 = 2.5;
/// By how much the turn that patches show may differ from that of the features, radians: the patches were sought where the
/// features said, so they may refine that, not turn it into something else.
const MAX_TURN_CHANGE_RAD: f64 = 0.1;

/// Places of an image's templates: all its pairs share them.
type Grids = BTreeMap<ImageId, Vec<(usize, usize)>>;

/// Replaces the matches of the pairs `used` by patches matched by least squares and fits the homographies to them; those of the pairs `links` by every
/// third of an image's patches, all of them the same, so that they join those of motions to tracks. A pair whose plane has too little texture, or whose
/// patches contradict its features, keeps what it had.
///
/// # Errors
/// [`Error::Stopped`] and no other.
pub(crate) fn match_by_patches(
    mut pairs: Vec<PairObservation>,
    [used, links]: [&[PairId]; 2],
    images: &[GrayImage],
    lens: Option<&PlacedLens>,
    options: &PatchStageOptions,
    observer: &dyn Observer,
) -> Result<Vec<PairObservation>, Error> {
    let features: &[PairObservation] = &pairs;
    let needed: BTreeSet<ImageId> = used.iter().chain(links).map(|&id| features[id].from).collect();
    let grid = |image: ImageId| Ok((image, template_grid_until(&images[image.index()], &options.patches, observer)?));
    let grids: Grids = needed.into_par_iter().map(grid).collect::<Result<_, Error>>()?;
    let thinned: Grids =
        grids.iter().map(|(&image, grid)| (image, grid.iter().step_by(LINK_STRIDE).copied().collect())).collect();
    let all: Vec<(PairId, &Grids)> =
        used.iter().map(|&id| (id, &grids)).chain(links.iter().map(|&id| (id, &thinned))).collect();
    let replaced = observer.map(Stage::Patches, &all, |&(id, grids)| {
        let pair = &features[id];
        let Ok(turning) = &pair.outcome else { return Ok(None) };
        replaced_by_patches(pair, turning, images, grids, lens, options, observer)
    })?;
    for pair in replaced.into_iter().flatten() {
        let place = pair.id.index();
        pairs[place] = pair;
    }
    Ok(pairs)
}

fn replaced_by_patches(
    pair: &PairObservation,
    turning: &TurningPlane,
    images: &[GrayImage],
    grids: &Grids,
    lens: Option<&PlacedLens>,
    options: &PatchStageOptions,
    observer: &dyn Observer,
) -> Result<Option<PairObservation>, Error> {
    let TurningPlane { plane, geometry } = turning;
    let Some(grid) = grids.get(&pair.from) else { return Ok(None) };
    let [a, b] = pair.images().map(|image| &images[image.index()]);
    let map = |p: &Vector2<f64>| carried(&plane.estimate.h_b_from_a, p, lens);
    let patches = match_patches_until(a, grid, b, &map, &options.patches, observer)?;
    let matches: Vec<PointMatch> = patches.iter().map(|m| m.point_match(options.patches.model_sigma_px)).collect();
    if matches.len() < MIN_PATCHES {
        return Ok(None);
    }
    let again = ImagePair { from: pair.from.index(), to: pair.to.index(), matches };
    let mut outcome = outcome_of_patches(&again, lens, &options.observe, observer)?;
    let Ok(found) = &mut outcome else { return Ok(None) };
    let turned_rad = (found.geometry.rotation_rad - geometry.rotation_rad).abs();
    if found.plane.inliers.len() < MIN_PATCHES || turned_rad > MAX_TURN_CHANGE_RAD {
        return Ok(None);
    }
    (found.plane.patches, found.plane.static_background) = (true, plane.static_background);
    let places: HashSet<(usize, usize)> = patches.iter().map(|m| (m.a.x as usize, m.a.y as usize)).collect();
    // Only where all of the patch should be seen.
    let (size, margin) = (b.size(), options.patches.radius_px as f64 * LOST_MARGIN);
    let seen_in_b = |p: &Vector2<f64>| {
        let in_picture =
            p.x > margin && p.y > margin && p.x < size.width as f64 - margin && p.y < size.height as f64 - margin;
        in_picture && b.used_about(p.x, p.y, margin) >= 1.0
    };
    let lost = grid
        .iter()
        .filter(|place| !places.contains(place))
        .map(|&(x, y)| Vector2::new(x as f64, y as f64))
        .filter(|a| map(a).is_some_and(|b| seen_in_b(&b)))
        .map(Into::into)
        .collect();
    let superseded = Superseded { features: pair.marked_matches(plane), lost };
    let new = PairObservation::new(pair.id, again, outcome).through(lens);
    Ok(Some(PairObservation { candidates: pair.candidates, superseded: Some(Box::new(superseded)), ..new }))
}
