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
    numerics::graph::{TreeNode, components, largest_component, spanning_forest},
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
pub(crate) const PAIRS_PER_IMAGE: usize = 8;

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
        let precise = |plane: &RobustHomography| too_noisy(plane, options).is_none();
        pair.moving_plane().is_some_and(precise) && !other_planes.contains(&pair.id)
    };
    let of_both_sides: Vec<PairId> = pairs.iter().filter(is_plane).map(|p| p.id).collect();
    let mirrored = mirrored_images(&of_both_sides, pairs);
    let is_mirrored = |image: ImageId| mirrored[image.index()];
    let of_one_side = |id: &PairId| {
        let [a, b] = pairs[*id].images().map(is_mirrored);
        a == b && pairs[*id].shows_one_side()
    };
    let planes: Vec<PairId> = of_both_sides.into_iter().filter(of_one_side).collect();
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
            match pairs[id].moving_plane().map(|plane| too_noisy(plane, options)) {
                Some(Some(rejection)) => PairVerdict::Rejected(rejection),
                Some(None) => PairVerdict::Rejected(Rejection::Mirrored),
                None => PairVerdict::NoMotion,
            }
        }
    }))
}

/// Which images show the plane from the other side than the first of those they are joined with, or mirrored: as the pairs of most matches have it, among
/// which a chance plane of a mirrored picture is not.
fn mirrored_images(planes: &[PairId], pairs: &[PairObservation]) -> Vec<bool> {
    let mut best_first = planes.to_vec();
    best_first.sort_by_key(|&id| (Reverse(matches_of(id, pairs)), id));
    let edge = |id: &PairId| pairs[*id].images().map(ImageId::index).into();
    let edges: Vec<(usize, usize)> = best_first.iter().map(edge).collect();
    let count = pairs.iter().flat_map(PairObservation::images).map(|image| image.index() + 1).max().unwrap_or(0);
    let mut mirrored = vec![false; count];
    for TreeNode { node, by } in spanning_forest(count, &edges) {
        if let Some((edge, from)) = by {
            mirrored[node] = mirrored[from] == pairs[best_first[edge]].shows_one_side();
        }
    }
    mirrored
}

/// Whether the points of a plane scatter too much. Patches have been judged by their own deviations.
fn too_noisy(plane: &RobustHomography, options: &GeneralOptions) -> Option<Rejection> {
    let (sigma_px, most_px) = (plane.estimate.sigma_px, options.max_sigma_px);
    (!plane.patches && sigma_px > most_px).then_some(Rejection::TooNoisy { sigma_px, most_px })
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        geometry::{frame::Frame, size::ImageSize},
        pairs::{
            correspondence::PointMatch,
            observation::{Refusal, RefusalKind},
            refine::HomographyEstimate,
        },
    };

    const SIZE: ImageSize = ImageSize { width: 640, height: 480 };

    /// A pair of which `matches` points are of the plane that `h` maps.
    fn pair(id: usize, [from, to]: [usize; 2], h: &Matrix3<f64>, matches: usize) -> PairObservation {
        let estimate = HomographyEstimate::from_pixels(h, None, Frame::new(SIZE, None), matches).expect("invertible");
        let seen = |k: usize| {
            let (x, y) = (100.0 + 40.0 * (k % 10) as f64, 80.0 + 30.0 * (k / 10) as f64);
            let b = h * nalgebra::Vector3::new(x, y, 1.0);
            PointMatch::new([x, y], [b.x / b.z, b.y / b.z])
        };
        let plane = RobustHomography {
            estimate,
            inliers: (0..matches).collect(),
            static_background: 0,
            patches: false,
            is_static: false,
        };
        PairObservation {
            id: PairId::new(id),
            from: ImageId::new(from),
            to: ImageId::new(to),
            matches: (0..matches).map(seen).collect(),
            candidates: matches,
            outcome: Err(Refusal::new(RefusalKind::NoRotation, "no turn".into(), Some(plane))),
            superseded: None,
            wide_lens: None,
        }
    }

    /// What most matches say of a mirrored image outweighs a chance plane by which it seems to be one of the others.
    #[test]
    fn a_mirrored_image_is_left_out_with_its_chance_plane() {
        let view = |t: f64, shift: f64| Matrix3::new(1.0, t, shift, -t, 1.0, 10.0, 1e-4 * t, 2e-4, 1.0);
        let mirror = Matrix3::new(-1.0, 0.0, 639.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0);
        let views = [view(0.0, 0.0), view(0.1, 30.0), view(-0.2, 20.0), mirror * view(0.1, -40.0)];
        let between = |id: usize, [a, b]: [usize; 2], matches: usize| {
            pair(id, [a, b], &(views[b] * views[a].try_inverse().expect("invertible")), matches)
        };
        let chance = pair(5, [2, 3], &view(0.3, 100.0), 20);
        let pairs = vec![
            between(0, [0, 1], 80),
            between(1, [0, 2], 70),
            between(2, [1, 2], 60),
            between(3, [0, 3], 75),
            between(4, [1, 3], 50),
            chance,
        ];
        let selection =
            select_general(&pairs, &[], &GeneralOptions { min_matches: 8, max_sigma_px: 2.0 }).expect("three views");
        assert_eq!(selection.used(), [0, 1, 2].map(PairId::new));
        for mirrored in [3, 4, 5] {
            let verdict = selection.verdict(PairId::new(mirrored));
            assert_eq!(verdict, PairVerdict::Rejected(Rejection::Mirrored), "{mirrored}");
        }
    }
}
