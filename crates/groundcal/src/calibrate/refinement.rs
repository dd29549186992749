//! The joint refinement of the pairs selected: plane-normal motions over a floor, or a camera turning on the spot.

use std::{
    cmp::Reverse,
    collections::{BTreeMap, BTreeSet},
};

use nalgebra::Matrix3;

use crate::{
    calibrate::{
        joint::{JointSolution, SharedFloors},
        prior_conflicts::{allow_for_open_alternatives, release_contradicted_priors},
        refinement_input::{Refined, RefinementInput, RefinementOptions, adjusted, adjusted_below_horizon},
        setup::{Setup, starting_camera},
        views::Views,
    },
    error::Error,
    geometry::{attitude::attitude_rotation, constraint::Constraint, intrinsics::Intrinsics},
    ids::{ImageId, PairId, ViewId},
    observer::Observer,
    pairs::{known_lens::KnownLens, observation::PairObservation},
    refine::{
        Kind, SceneModel, State,
        start::{floor_misfit, floor_seen, rotations_from_links, state_from_links},
    },
    select::selection::Selection,
    start::linear_camera::{CameraOptions, CameraSolution, solve_camera_until},
};

/// Relative standard deviation of f from which on other focal lengths are tried as starts, and those.
const UNCERTAIN_FOCAL_SIGMA: f64 = 0.03;
const UNCERTAIN_FOCAL_FACTORS: [f64; 3] = [1.0, 0.8, 1.25];

/// The same where a refinement came to nothing.
const FAILED_FOCAL_FACTORS: [f64; 5] = [1.0, 0.5, 0.71, 1.41, 2.0];

/// Where to refine from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Starts {
    /// The closed-form solution, and near it where it is uncertain.
    Usual,
    /// Solutions under other constraints and other focal lengths, too.
    Many,
}

/// Matches that link views of different attitudes, how far their homography may be from one of the floor (radians and relative
/// lengths), how many links a view has at most, and by how much they may raise the variance of the residuals of patches and of
/// points.
pub(super) const MIN_LINK_MATCHES: usize = 20;
pub(super) const MAX_LINK_MISFIT: f64 = 0.03;
const LINKS_PER_VIEW: usize = 2;
const MAX_LINK_VARIANCE: f64 = 1.3;
const MAX_LINK_POINT_VARIANCE: f64 = 3.0;
/// Misfit of such a homography from which on it contradicts the two attitudes.
const CONTRADICTING_MISFIT: f64 = 0.1;

/// Refines the closed-form solution on the matches of the motions selected, and on those of pairs of different attitudes that see
/// the same floor, with priors that the matches contradict released. `None` when there are no matches to refine on.
///
/// # Errors
/// See [`crate::refine::adjust`]; [`Error::Stopped`].
pub(super) fn refine_motions(
    pairs: &[PairObservation],
    selection: &Selection,
    solution: &CameraSolution,
    lens: &KnownLens,
    options: &RefinementOptions,
    starts: Starts,
    observer: &dyn Observer,
) -> Result<Option<Refined>, Error> {
    let Some(input) = RefinementInput::new(pairs, selection, solution, lens, options, observer) else {
        return Ok(None);
    };
    // A focal length that the closed form hardly knows may be another.
    let uncertain = solution.covariance_px[(0, 0)].sqrt() > UNCERTAIN_FOCAL_SIGMA * solution.intrinsics.fx;
    let factors: &[f64] = match starts {
        Starts::Many => &FAILED_FOCAL_FACTORS,
        Starts::Usual if uncertain => &UNCERTAIN_FOCAL_FACTORS,
        Starts::Usual => &[1.0],
    };
    let mut states: Vec<State> = factors.iter().filter_map(|factor| input.start(solution, *factor)).collect();
    if starts == Starts::Many {
        states.extend(under_other_constraints(&input, options).iter().filter_map(|other| input.start(other, 1.0)));
    }
    let joint =
        adjusted_below_horizon(input.scene, input.setup.clone(), input.views.clone(), states, options, observer)?;
    let refined = input.refined(joint, solution.clone(), options.clone());
    let (mut refined, is_changed) = release_contradicted_priors(&input, refined)?;
    if input.scene != SceneModel::Directions {
        let is_linked;
        (refined, is_linked) = with_cross_links(&input, refined)?;
        // With more that is seen, more may be contradicted; with the same as before, the same.
        if is_linked || is_changed {
            (refined, _) = release_contradicted_priors(&input, refined)?;
        }
    }
    allow_for_open_alternatives(&mut refined);
    Ok(Some(refined))
}

/// The closed form under the constraints that are tried when that asked for leads nowhere: those that hold what that holds.
fn under_other_constraints(input: &RefinementInput<'_>, options: &RefinementOptions) -> Vec<CameraSolution> {
    let under = |constraint: Constraint| {
        let camera = CameraOptions { constraint, ..options.camera.clone() };
        solve_camera_until(&input.motions, &options.frame, &camera, input.observer).ok()
    };
    [Constraint::ZeroSkew, Constraint::Square, Constraint::Focal]
        .into_iter()
        .filter(|other| other.holds_what(options.camera.constraint))
        .filter_map(under)
        .collect()
}

/// Refined again with the ordinary matches of views of different attitudes that see the same floor, and with images outside of any motion
/// that see it; as it was where there are none, or where they contradict the motions. With it whether there are more.
fn with_cross_links(input: &RefinementInput<'_>, mut refined: Refined) -> Result<(Refined, bool), Error> {
    let (cross_links, floors) = cross_attitude_links(&refined.joint, input.pairs, &input.used);
    refined.joint.floors = floors;
    let free = free_views(&refined.joint, input.pairs);
    let mut links: Vec<PairId> = cross_links.iter().copied().chain(free.iter().flat_map(|f| f.links.clone())).collect();
    links.sort_unstable();
    links.dedup();
    let Some(mut joint) = linked(input, &refined, &links, &free)? else {
        return Ok((refined, false));
    };
    joint.floors = floors;
    refined.joint = joint;
    Ok((refined, true))
}

/// Refined with more links between views, and with free views. `None` where there are none or they contradict the motions.
fn linked(
    input: &RefinementInput<'_>,
    refined: &Refined,
    links: &[PairId],
    free: &[FreeView],
) -> Result<Option<JointSolution>, Error> {
    let (joint, options) = (&refined.joint, &refined.options);
    if links.is_empty() {
        return Ok(None);
    }
    let all: Vec<PairId> = input.used.iter().chain(links).copied().collect();
    let views = joint.views.and(free.iter().map(|f| f.image));
    let Some(setup) = Setup::of_pairs(&all, input.pairs, &views, input.lens.lens(), &options.frame) else {
        return Ok(None);
    };
    let state = &joint.bundle.state;
    let mut attitudes: Vec<Matrix3<f64>> = state.groups.iter().map(|g| g.attitude).collect();
    let first_free = attitudes.len();
    attitudes.extend(free.iter().map(|f| f.attitude));
    let group_of = |view: usize| {
        let image = views.image(ViewId::new(view));
        let known = joint.views.of(image).map(|view| state.frames[view.index()].group);
        known.or_else(|| Some(first_free + free.iter().position(|f| f.image == image)?))
    };
    let Some(groups) = (0..views.len()).map(group_of).collect::<Option<Vec<usize>>>() else { return Ok(None) };
    let (scene, camera) = (joint.bundle.scene, state.cameras[0]);
    let start = state_from_links(scene, camera, &joint.intrinsics, &attitudes, &groups, &setup.links)
        .map(|state| refined.as_read_out(state));
    let mut linked =
        match adjusted_below_horizon(scene, setup, views, start.into_iter().collect(), options, input.observer) {
            Ok(linked) => linked,
            Err(Error::Stopped) => return Err(Error::Stopped),
            Err(_) => return Ok(None),
        };
    let raised = |kind: Kind| {
        let [before, after] = [joint, &linked].map(|j| j.bundle.variance_factors[kind as usize]);
        after / before
    };
    if raised(Kind::Patch) > MAX_LINK_VARIANCE || raised(Kind::Point) > MAX_LINK_POINT_VARIANCE {
        return Ok(None);
    }
    linked.cross_links = links.to_vec();
    linked.attitudes.clone_from(&joint.attitudes);
    Ok(Some(linked))
}

/// An image outside of any motion that sees the floor of the motions.
struct FreeView {
    image: ImageId,
    /// Its attitude, as the homography from a view of the motions has it.
    attitude: Matrix3<f64>,
    /// Pairs that link it, those of most matches first.
    links: Vec<PairId>,
}

/// Images outside of any motion whose homographies from views of the motions are of their floor: under the camera they stretch it in no direction.
fn free_views(joint: &JointSolution, pairs: &[PairObservation]) -> Vec<FreeView> {
    let (k, k_inverse) = (joint.intrinsics.matrix(), joint.intrinsics.inverse_matrix());
    let state = &joint.bundle.state;
    let tolerance = MAX_LINK_MISFIT + 2.0 * joint.camera_covariance()[(0, 0)].max(0.0).sqrt();
    let mut found: Vec<FreeView> = Vec::new();
    let matches = |id: PairId| pairs[id].plane().map_or(0, |plane| plane.inliers.len());
    let mut sorted: Vec<&PairObservation> = pairs.iter().collect();
    sorted.sort_by_key(|pair| (Reverse(matches(pair.id)), pair.id));
    for pair in sorted {
        let [from, to] = [pair.from, pair.to].map(|image| joint.views.of(image));
        let (view, image, away) = match (from, to) {
            (Some(view), None) => (view, pair.to, true),
            (None, Some(view)) => (view, pair.from, false),
            _ => continue,
        };
        let Some(plane) = pair.moving_plane().filter(|plane| plane.inliers.len() >= MIN_LINK_MATCHES) else { continue };
        let h = plane.estimate.h_b_from_a;
        let h = if away { h } else { h.inverse() };
        let m = k_inverse * h.matrix() * k;
        let known = &state.groups[state.frames[view.index()].group].attitude;
        let Some((_, attitude)) = floor_seen(&m, known).filter(|(stretch, _)| *stretch < tolerance) else {
            continue;
        };
        match found.iter_mut().find(|f| f.image == image) {
            Some(known) if known.links.len() < LINKS_PER_VIEW => known.links.push(pair.id),
            Some(_) => {}
            None => found.push(FreeView { image, attitude, links: vec![pair.id] }),
        }
    }
    found
}

/// Pairs beside the motions that may link their views to each other, or others to them: of each view those of most matches on a plane, as many as are used
/// of it. Which of them are of the floor the refined camera tells.
pub(super) fn likely_links(pairs: &[PairObservation], used: &[PairId]) -> Vec<PairId> {
    let of_motions: BTreeSet<ImageId> = used.iter().flat_map(|&id| pairs[id].images()).collect();
    let matches = |pair: &PairObservation| pair.moving_plane().map_or(0, |plane| plane.inliers.len());
    let may_link = |pair: &&PairObservation| {
        matches(pair) >= MIN_LINK_MATCHES
            && !used.contains(&pair.id)
            && pair.images().iter().any(|image| of_motions.contains(image))
    };
    let mut candidates: Vec<&PairObservation> = pairs.iter().filter(may_link).collect();
    candidates.sort_by_key(|pair| (Reverse(matches(pair)), pair.id));
    let mut links_of: BTreeMap<ImageId, usize> = BTreeMap::new();
    let mut links = Vec::new();
    for pair in candidates {
        if pair.images().iter().any(|image| links_of.get(image).is_none_or(|n| *n < LINKS_PER_VIEW)) {
            pair.images().iter().for_each(|image| *links_of.entry(*image).or_default() += 1);
            links.push(pair.id);
        }
    }
    links
}

/// Pairs of views of different attitudes whose homographies are of the floor that both look at.
fn cross_attitude_links(
    joint: &JointSolution,
    pairs: &[PairObservation],
    used: &[PairId],
) -> (Vec<PairId>, SharedFloors) {
    let (k, k_inverse) = (joint.intrinsics.matrix(), joint.intrinsics.inverse_matrix());
    let state = &joint.bundle.state;
    let candidate = |pair: &PairObservation| {
        let [a, b] = joint.views.of_pair(pair)?.map(|view| state.frames[view.index()].group);
        let plane = pair.moving_plane().filter(|plane| plane.inliers.len() >= MIN_LINK_MATCHES)?;
        let m = k_inverse * plane.estimate.h_b_from_a.matrix() * k;
        let misfit = floor_misfit(&m, [a, b].map(|group| &state.groups[group].attitude))?;
        (a != b).then_some((pair.id, plane.inliers.len(), misfit))
    };
    let candidates: Vec<(PairId, usize, f64)> =
        pairs.iter().filter(|pair| !used.contains(&pair.id)).filter_map(candidate).collect();
    let contradict = candidates.iter().filter(|c| c.2 > CONTRADICTING_MISFIT).count();
    let mut found: Vec<(PairId, usize)> =
        candidates.iter().filter(|c| c.2 < MAX_LINK_MISFIT).map(|c| (c.0, c.1)).collect();
    let floors = SharedFloors { agree: found.len(), contradict };
    found.sort_by_key(|(id, matches)| (Reverse(*matches), *id));
    found.truncate(LINKS_PER_VIEW * joint.views.len());
    let mut links: Vec<PairId> = found.into_iter().map(|(id, _)| id).collect();
    links.sort_unstable();
    (links, floors)
}

/// Refines a camera that turns on the spot from a camera matrix: every view has an attitude of its own.
///
/// # Errors
/// See [`crate::refine::adjust`]; [`Error::Stopped`].
pub(super) fn refine_turning(
    pairs: &[PairObservation],
    selection: &Selection,
    k: &Intrinsics,
    lens: &KnownLens,
    options: &RefinementOptions,
    observer: &dyn Observer,
) -> Result<JointSolution, Error> {
    let mut options = options.clone();
    // An attitude of its own has no error against a group.
    options.bundle.attitude_sigma_rad = Some(0.0);
    let (used, frame) = (selection.used(), &options.frame);
    let views = Views::of_pairs(&used, pairs);
    let failed = |detail: &str| Error::Numerical { stage: "joint refinement", detail: detail.into() };
    let setup =
        Setup::of_pairs(&used, pairs, &views, lens.lens(), frame).ok_or_else(|| failed("there are no matches"))?;
    // World axes are those of the first view, which is level by definition.
    let attitudes = rotations_from_links(attitude_rotation(0.0, 0.0), views.len(), k, &setup.links)
        .ok_or_else(|| failed("the pairs do not connect the images"))?;
    let groups: Vec<usize> = (0..views.len()).collect();
    let camera = starting_camera(k, lens, options.k2_is_held, frame);
    let start = state_from_links(SceneModel::Directions, camera, k, &attitudes, &groups, &setup.links);
    adjusted(SceneModel::Directions, setup, views, start.into_iter().collect(), &options, observer)
}
