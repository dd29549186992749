//! The views of one plane, however they moved: all images that planes connect.
//!
//! ```text
//! H_i = H_ik ... H_jr      along the path of least variance, a homography's variance being one over its matches
//! ```
//!
//! Nothing is asked of the motions, so nothing but the plane itself tells a wrong pair: that is judged by the refinement.

use std::{cmp::Reverse, collections::BTreeMap};

use nalgebra::Matrix3;

use crate::{
    error::Error,
    ids::{ImageId, PairId},
    numerics::graph::{components, largest_component},
    pairs::{
        observation::{PairObservation, images_of, why_no_motion},
        robust::RobustHomography,
    },
    remedy::Remedy,
    select::{
        attitude_groups::HorizonSides,
        selection::{MotionKind, PairVerdict, Rejection, Selection},
    },
};

/// Fewest views: two leave the focal length and the tilt of the plane to be traded for each other.
const MIN_VIEWS: usize = 3;
/// Pairs of an image that are used, those of most matches: what more of them say is known by way of the others.
const PAIRS_PER_IMAGE: usize = 8;

/// Options of [`select_general`].
#[derive(Debug, Clone, Copy)]
pub(crate) struct GeneralOptions {
    /// Fewest matches on a plane, for the error's words.
    pub(crate) min_matches: usize,
    /// Largest noise of the matches of a plane, pixels.
    pub(crate) max_sigma_px: f64,
}

/// All pairs with a plane that join most images, or the best few of each image; but for some that were found to be of other planes.
///
/// # Errors
/// [`Error::NoUsableMotion`] where fewer than three images are joined.
pub(crate) fn select_general(
    pairs: &[PairObservation],
    other_planes: &[PairId],
    options: &GeneralOptions,
) -> Result<Selection, Error> {
    let is_plane = |pair: &&PairObservation| {
        let precise = |plane: &RobustHomography| plane.estimate.sigma_px <= options.max_sigma_px;
        pair.moving_plane().is_some_and(precise) && !other_planes.contains(&pair.id)
    };
    let planes: Vec<PairId> = pairs.iter().filter(is_plane).map(|p| p.id).collect();
    if planes.is_empty() {
        return Err(why_no_motion(pairs, options.min_matches));
    }
    let edges = || planes.iter().map(|&id| pairs[id].images().map(ImageId::index)).map(|[a, b]| (a, b));
    let label = components(edges().map(|(a, b)| a.max(b) + 1).max().unwrap_or(0), edges());
    let largest = largest_component(&label);
    let joined: Vec<PairId> =
        planes.iter().copied().filter(|&id| Some(label[pairs[id].from.index()]) == largest).collect();
    let images = images_of(&joined, pairs).len();
    if images < MIN_VIEWS {
        return Err(Error::NoUsableMotion {
            pairs: planes.len(),
            reason: format!(
                "a common plane joins {images} images, and general motion needs {MIN_VIEWS} or more: of two the focal length and the \
                 tilt of the plane cannot be told apart"
            ),
            remedies: vec![Remedy::MoreViews, Remedy::VouchPlaneNormal],
        });
    }
    // Where patches tell of every image, what features alone say adds no more than their noise.
    let patched: Vec<PairId> =
        joined.iter().copied().filter(|&id| pairs[id].plane().is_some_and(|plane| plane.patches)).collect();
    let in_full = !patched.is_empty() && paths(&patched, pairs, reference_of(&patched, pairs)).len() == images;
    let best = best_of_each_image(if in_full { &patched } else { &joined }, pairs);
    Ok(Selection::new(MotionKind::General, pairs, |id| {
        if best.contains(&id) {
            PairVerdict::Used { sides: HorizonSides::One }
        } else if other_planes.contains(&id) {
            PairVerdict::Rejected(Rejection::OtherPlane)
        } else if joined.contains(&id) {
            PairVerdict::Rejected(Rejection::Redundant)
        } else if planes.contains(&id) {
            PairVerdict::Rejected(Rejection::Unconnected)
        } else {
            PairVerdict::NoMotion
        }
    }))
}

fn matches_of(id: PairId, pairs: &[PairObservation]) -> usize {
    pairs[id].plane().map_or(0, |plane| plane.inliers.len())
}

/// The pairs of most matches of each image, and those that lead to it from the reference.
fn best_of_each_image(joined: &[PairId], pairs: &[PairObservation]) -> Vec<PairId> {
    let mut sorted = joined.to_vec();
    sorted.sort_by_key(|&id| (Reverse(matches_of(id, pairs)), id));
    let mut count: BTreeMap<ImageId, usize> = BTreeMap::new();
    let mut best: Vec<PairId> = Vec::new();
    for id in sorted {
        let images = pairs[id].images();
        if images.iter().any(|image| count.get(image).is_none_or(|n| *n < PAIRS_PER_IMAGE)) {
            images.iter().for_each(|image| *count.entry(*image).or_default() += 1);
            best.push(id);
        }
    }
    best.extend(paths(joined, pairs, reference_of(joined, pairs)).into_values().filter_map(|step| Some(step.by?.0)));
    best.sort_unstable();
    best.dedup();
    best
}

/// The image that most matches lead to.
fn reference_of(joined: &[PairId], pairs: &[PairObservation]) -> ImageId {
    let mut matches: BTreeMap<ImageId, usize> = BTreeMap::new();
    for &id in joined {
        pairs[id].images().iter().for_each(|image| *matches.entry(*image).or_default() += matches_of(id, pairs));
    }
    let most = matches.into_iter().max_by_key(|(image, count)| (*count, Reverse(*image)));
    most.map_or(ImageId::new(0), |(image, _)| image)
}

/// How an image is reached.
struct Step {
    variance: f64,
    /// The pair that leads to it, and from where.
    by: Option<(PairId, ImageId)>,
    done: bool,
}

/// Ways of least variance from the reference to all images that pairs connect with it (Dijkstra).
fn paths(joined: &[PairId], pairs: &[PairObservation], reference: ImageId) -> BTreeMap<ImageId, Step> {
    let mut steps = BTreeMap::from([(reference, Step { variance: 0.0, by: None, done: false })]);
    let mut of_image: BTreeMap<ImageId, Vec<PairId>> = BTreeMap::new();
    for &id in joined {
        pairs[id].images().iter().for_each(|image| of_image.entry(*image).or_default().push(id));
    }
    loop {
        let open = steps.iter_mut().filter(|(_, step)| !step.done);
        let Some((&image, step)) = open.min_by(|a, b| a.1.variance.total_cmp(&b.1.variance)) else { return steps };
        step.done = true;
        let variance = step.variance;
        for &id in of_image.get(&image).into_iter().flatten() {
            let [a, b] = pairs[id].images();
            let other = if a == image { b } else { a };
            let through = variance + 1.0 / matches_of(id, pairs).max(1) as f64;
            if steps.get(&other).is_none_or(|known| !known.done && through < known.variance) {
                steps.insert(other, Step { variance: through, by: Some((id, image)), done: false });
            }
        }
    }
}

/// The image that most matches lead to, and homographies from it to every image that the pairs connect, frame units.
pub(crate) fn homographies_from_reference(
    used: &[PairId],
    pairs: &[PairObservation],
) -> (ImageId, BTreeMap<ImageId, Matrix3<f64>>) {
    let reference = reference_of(used, pairs);
    let steps = paths(used, pairs, reference);
    let mut order: Vec<(&ImageId, &Step)> = steps.iter().collect();
    order.sort_by(|a, b| a.1.variance.total_cmp(&b.1.variance));
    let mut known = BTreeMap::from([(reference, Matrix3::identity())]);
    for (&image, step) in order {
        let Some((id, from)) = step.by else { continue };
        let Some((plane, before)) = pairs[id].plane().zip(known.get(&from)) else { continue };
        let h = plane.estimate.in_frame;
        let step = if pairs[id].from == from { Some(h) } else { h.try_inverse() };
        let Some(h) = step.map(|h| h * before) else { continue };
        known.insert(image, h / h.norm());
    }
    (reference, known)
}
