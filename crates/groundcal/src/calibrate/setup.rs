//! What the joint refinement is given: links between views, the tracks of their matches, groups of views of one attitude, and the
//! camera to start from.

use std::collections::BTreeSet;

use nalgebra::Vector2;

use crate::{
    calibrate::views::Views,
    geometry::{
        frame::Frame,
        intrinsics::Intrinsics,
        lens::{Lens, Radtan},
    },
    ids::{GroupId, PairId, ViewId},
    numerics::graph::components,
    pairs::{
        correspondence::PointMatch,
        known_lens::KnownLens,
        lens_placement::MIN_NOISE_PX,
        observation::PairObservation,
        placed_lens::PlacedLens,
        ray_match::RayMatch,
        residual::{PlaneMatch, sampson_squared},
        robust::RobustHomography,
    },
    refine::{CameraState, Kind, Observation, Track, start::Link, tracks::join_matches},
    start::linear_camera::CameraSolution,
};

/// Matches that the common noise of all pairs is worth in the estimate of one pair's.
const COMMON_NOISE_MATCHES: f64 = 20.0;
/// Standard deviations from its homography within which a match takes part; the weights of the loss do the rest.
const MAX_INLIER_SIGMAS: f64 = 5.0;

/// Views joined by homographies, and the points that they see.
#[derive(Clone)]
pub(super) struct Setup {
    pub(super) links: Vec<Link>,
    pub(super) tracks: Vec<Track>,
}

impl Setup {
    /// Of the pairs `some`, whose images are all among the views. `None` when there are no matches.
    pub(super) fn of_pairs(
        some: &[PairId],
        pairs: &[PairObservation],
        views: &Views,
        lens: Option<&PlacedLens>,
        frame: &Frame,
    ) -> Option<Self> {
        let joined = |&id: &PairId| {
            let pair = &pairs[id];
            Some(JoinedPair { pair, plane: pair.plane()?, views: views.of_pair(pair)? })
        };
        let all: Vec<JoinedPair> = some.iter().map(joined).collect::<Option<_>>()?;
        let mut tracks = Vec::new();
        for kind in [Kind::Patch, Kind::Point] {
            let of_kind: Vec<&JoinedPair> =
                all.iter().filter(|joined| joined.plane.patches == (kind == Kind::Patch)).collect();
            tracks.extend(join_matches(kind, &matches_of(&of_kind, lens, frame)));
        }
        let links = all.iter().map(JoinedPair::link).collect();
        (!tracks.is_empty()).then_some(Self { links, tracks })
    }
}

struct JoinedPair<'a> {
    pair: &'a PairObservation,
    plane: &'a RobustHomography,
    views: [ViewId; 2],
}

impl JoinedPair<'_> {
    fn link(&self) -> Link {
        let [from, to] = self.views.map(ViewId::index);
        Link { from, to, h_to_from: self.plane.estimate.h_b_from_a, matches: self.plane.inliers.len() }
    }
}

/// The matches of pairs of one kind, weighted by their noise.
fn matches_of(all: &[&JoinedPair], lens: Option<&PlacedLens>, frame: &Frame) -> Vec<[Observation; 2]> {
    let count: usize = all.iter().map(|joined| joined.plane.inliers.len()).sum();
    let squared = |plane: &RobustHomography| plane.inliers.len() as f64 * plane.estimate.sigma_px.powi(2);
    let common = all.iter().map(|joined| squared(joined.plane)).sum::<f64>() / count as f64;
    let mut matches = Vec::new();
    for joined in all {
        // Few matches do not tell their noise: that of all of the kind counts as some more.
        let n = joined.plane.inliers.len() as f64;
        let noise =
            (n * joined.plane.estimate.sigma_px.powi(2) + COMMON_NOISE_MATCHES * common) / (n + COMMON_NOISE_MATCHES);
        for k in near_plane(joined.pair, joined.plane, lens, frame) {
            let m = &joined.pair.matches[k];
            let variance = (noise * m.sigma_px * m.sigma_px).max(MIN_NOISE_PX.powi(2));
            let observation =
                |view: ViewId, pixel: Vector2<f64>| Observation::new(view.index(), pixel, variance.sqrt());
            let [a, b] = joined.views;
            matches.push([observation(a, m.a), observation(b, m.b)]);
        }
    }
    matches
}

/// Indices of the matches within reach of a pair's homography: its inliers and what lies a little further off, so that the
/// refinement's own weights decide and not a cut, which costs good matches where they are few.
fn near_plane(
    pair: &PairObservation,
    plane: &RobustHomography,
    lens: Option<&PlacedLens>,
    frame: &Frame,
) -> Vec<usize> {
    let noise = (plane.estimate.sigma_px.max(MIN_NOISE_PX) / frame.scale_px).powi(2);
    let h = &plane.estimate.in_frame;
    let near =
        |squared: f64, sigma_px: f64| squared / (noise * sigma_px * sigma_px) < MAX_INLIER_SIGMAS * MAX_INLIER_SIGMAS;
    let within = |m: &PointMatch| {
        let ideal = match lens {
            Some(lens) if lens.lens.sees_behind() => {
                return near(RayMatch::new(m, lens, frame).sampson_squared(h), m.sigma_px);
            }
            Some(lens) => lens.ideal_match(m),
            None => Some(*m),
        };
        ideal.is_some_and(|m| {
            let local = PointMatch { a: frame.local(&m.a), b: frame.local(&m.b), ..m };
            near(sampson_squared(h, &local), m.sigma_px)
        })
    };
    let mut near: Vec<usize> = (0..pair.matches.len()).filter(|&k| within(&pair.matches[k])).collect();
    near.extend(&plane.inliers);
    near.sort_unstable();
    near.dedup();
    near
}

/// Groups of the refinement: views that motions connect share an attitude by what they are. Motions that only happen to have the
/// same attitude within their noise keep one each, since a true difference would be forced to nothing.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct ViewGroups {
    /// The group of each view.
    pub(super) of_view: Vec<GroupId>,
    /// The attitude of the closed-form solution that each group starts from and is reported as.
    pub(super) attitudes: Vec<usize>,
}

impl ViewGroups {
    /// Of the motions `used`, whose attitudes are those of the solution. `None` where one of their images is no view.
    pub(super) fn of_motions(
        used: &[PairId],
        pairs: &[PairObservation],
        views: &Views,
        solution: &CameraSolution,
    ) -> Option<Self> {
        let joined: Vec<[ViewId; 2]> = used.iter().map(|&id| views.of_pair(&pairs[id])).collect::<Option<_>>()?;
        let label = components(views.len(), joined.iter().map(|[a, b]| (a.index(), b.index())));
        let roots: BTreeSet<usize> = label.iter().copied().collect();
        let of_view: Vec<GroupId> = label.iter().map(|l| GroupId::new(roots.range(..l).count())).collect();
        let mut attitudes = vec![0; roots.len()];
        for (attitude, group) in solution.groups.iter().enumerate() {
            for &member in &group.members {
                let [from, _] = joined[member];
                attitudes[of_view[from.index()].index()] = attitude;
            }
        }
        Some(Self { of_view, attitudes })
    }

    /// As the refinement counts them.
    pub(super) fn indices(&self) -> Vec<usize> {
        self.of_view.iter().map(|group| group.index()).collect()
    }
}

/// Camera matrix and lens as the refinement starts from them; `k2_is_held`: an estimated lens has none.
pub(super) fn starting_camera(k: &Intrinsics, lens: &KnownLens, k2_is_held: bool, frame: &Frame) -> CameraState {
    let start = match lens {
        KnownLens::NotModelled => Lens::None,
        KnownLens::Given(lens) | KnownLens::OfPairs(lens) => lens.lens,
        KnownLens::Placed(placement) => placement.lens.lens,
        KnownLens::Estimated(finding) => {
            finding.lens().and_then(|l| l.with_focal_length(k.fx)).map_or(Lens::None, |l| l.lens)
        }
    };
    // A pinhole has the numbers of Brown-Conrady, all zero.
    let lens = match start {
        Lens::None => Lens::radial(0.0, 0.0),
        Lens::Radtan(radtan) if k2_is_held && lens.is_estimated() => {
            let [k1, _, p1, p2, k3] = radtan.parameters();
            Lens::Radtan(Radtan::new([k1, 0.0, p1, p2, k3]))
        }
        other => other,
    };
    CameraState::new(k, &lens, frame)
}
