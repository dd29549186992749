//! A pair of images and all that is known of it: the one record that every stage reads, and that a stage writes anew when it
//! looks again.

use std::{collections::BTreeSet, ops::Index};

use nalgebra::{Vector2, Vector3};

use crate::{
    error::Error,
    geometry::homography::Homography,
    ids::{ImageId, PairId},
    pairs::{
        circular_points::{MAX_DIRECTION_SIGMA, MIN_SIGNIFICANCE, MotionGeometry, NoCircularPoint, from_homography},
        correspondence::{ImagePair, PointMatch},
        placed_lens::PlacedLens,
        refine::HomographyEstimate,
        robust::RobustHomography,
    },
    remedy::Remedy,
};

/// What a pair of images shows. In a list, [`Self::id`] is its place.
#[derive(Debug, Clone)]
pub(crate) struct PairObservation {
    pub(crate) id: PairId,
    pub(crate) from: ImageId,
    pub(crate) to: ImageId,
    /// Pixels, as the lens gave them; none for a homography from elsewhere.
    pub(crate) matches: Vec<PointMatch>,
    /// Matches tried at first: patches may have taken their place.
    pub(crate) candidates: usize,
    /// A plane that turns, or why there is none.
    pub(crate) outcome: Result<TurningPlane, Refusal>,
    /// What patches took the place of, if they did.
    pub(crate) superseded: Option<Box<Superseded>>,
    /// The lens that was undone, where its rays may lie square to the axis or behind: then pixels are no place in the plane of an
    /// ideal image, however roughly.
    pub(crate) wide_lens: Option<PlacedLens>,
}

/// The plane of a pair, and the motion that its homography shows.
#[derive(Debug, Clone)]
pub(crate) struct TurningPlane {
    pub(crate) plane: RobustHomography,
    pub(crate) geometry: MotionGeometry,
}

/// Why a pair has no homography or no circular point, in the words of the report.
#[derive(Debug, Clone)]
pub(crate) struct Refusal {
    pub(crate) kind: RefusalKind,
    pub(crate) reason: String,
    pub(crate) rotation_deg: Option<f64>,
    pub(crate) plane: Option<Box<RobustHomography>>,
    /// The error itself, to be shown where there is one pair only.
    pub(crate) error: Option<Box<Error>>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum RefusalKind {
    NoPlane,
    Static,
    /// The same pictures as another pair's.
    Repeated,
    NoRotation,
    Uncertain,
}

/// What patches took the place of.
#[derive(Debug, Clone)]
pub(crate) struct Superseded {
    /// Features, and whether each was on the plane.
    pub(crate) features: Vec<(PointMatch, bool)>,
    /// Places of templates that were sought in the second image and not found.
    pub(crate) lost: Vec<[f64; 2]>,
}

impl Refusal {
    pub(crate) fn new(kind: RefusalKind, reason: String, plane: Option<RobustHomography>) -> Self {
        Self { kind, reason, rotation_deg: None, plane: plane.map(Box::new), error: None }
    }
}

/// The motion that a plane's homography shows.
pub(crate) fn turning_plane(plane: RobustHomography) -> Result<TurningPlane, Refusal> {
    match from_homography(&plane.estimate) {
        Ok(geometry) => Ok(TurningPlane { plane, geometry }),
        Err(NoCircularPoint::NoRotation { rotation_rad, significance }) => {
            let deg = rotation_rad.to_degrees();
            let near = if rotation_rad > 1.6 { "a turn near 180 degrees" } else { "a translation, or hardly a turn" };
            let reason = format!(
                "no rotation to be seen: {near} (eigenvalue angle {deg:.1} degrees, {significance:.1} sigma; {MIN_SIGNIFICANCE} needed)"
            );
            Err(Refusal { rotation_deg: Some(deg), ..Refusal::new(RefusalKind::NoRotation, reason, Some(plane)) })
        }
        Err(NoCircularPoint::TooUncertain { sigma }) => {
            let [known, needed] = [sigma, MAX_DIRECTION_SIGMA].map(f64::to_degrees);
            let reason =
                format!("circular point too uncertain (direction known to {known:.0} degrees, {needed:.0} needed)");
            Err(Refusal::new(RefusalKind::Uncertain, reason, Some(plane)))
        }
    }
}

impl PairObservation {
    /// What matches showed.
    pub(crate) fn new(id: PairId, pair: ImagePair, outcome: Result<TurningPlane, Refusal>) -> Self {
        let ImagePair { from, to, matches } = pair;
        let candidates = matches.len();
        Self { id, from: from.into(), to: to.into(), matches, candidates, outcome, superseded: None, wide_lens: None }
    }

    /// The same with its pixels seen through a lens.
    pub(crate) fn through(self, lens: Option<&PlacedLens>) -> Self {
        Self { wide_lens: lens.filter(|lens| lens.lens.sees_behind()).copied(), ..self }
    }

    /// A homography from elsewhere.
    pub(crate) fn of_homography(id: PairId, [from, to]: [ImageId; 2], estimate: HomographyEstimate) -> Self {
        let candidates = estimate.matches;
        let plane =
            RobustHomography { estimate, inliers: Vec::new(), static_background: 0, patches: false, is_static: false };
        let outcome = turning_plane(plane);
        Self { id, from, to, matches: Vec::new(), candidates, outcome, superseded: None, wide_lens: None }
    }

    /// The matches alone, to be looked at afresh.
    pub(crate) fn into_pair(self) -> ImagePair {
        ImagePair { from: self.from.index(), to: self.to.index(), matches: self.matches }
    }

    /// Both images.
    pub(crate) fn images(&self) -> [ImageId; 2] {
        [self.from, self.to]
    }

    /// The plane, whether or not it shows a turn.
    pub(crate) fn plane(&self) -> Option<&RobustHomography> {
        match &self.outcome {
            Ok(turning) => Some(&turning.plane),
            Err(refusal) => refusal.plane.as_deref(),
        }
    }

    /// The plane, unless nothing moved.
    pub(crate) fn moving_plane(&self) -> Option<&RobustHomography> {
        self.plane().filter(|plane| !plane.is_static)
    }

    /// The motion, where there is one.
    pub(crate) fn geometry(&self) -> Option<&MotionGeometry> {
        self.outcome.as_ref().ok().map(|turning| &turning.geometry)
    }

    /// Matches on a plane that turns; none without one.
    pub(crate) fn inliers(&self) -> impl Iterator<Item = &PointMatch> {
        let indices = self.outcome.as_ref().map_or(&[][..], |turning| &turning.plane.inliers);
        indices.iter().map(|&k| &self.matches[k])
    }

    /// Where the matches on a plane that turns lie in the first image, homogeneous pixels: as they are, or their rays through a wide
    /// lens.
    pub(crate) fn seen_in_first(&self) -> impl Iterator<Item = Vector3<f64>> {
        self.inliers().filter_map(|m| self.ray_in_first(m))
    }

    /// Where a match lies in the first image, so seen.
    fn ray_in_first(&self, m: &PointMatch) -> Option<Vector3<f64>> {
        match &self.wide_lens {
            Some(lens) => lens.ray_px(&m.a),
            None => Some(m.a.push(1.0)),
        }
    }

    /// Whether both images show the same side of a plane that moved, as two pictures of a floor do and two of which one is mirrored do not: points before
    /// both cameras keep their depth's sign under a homography of determinant 1.
    pub(crate) fn shows_one_side(&self) -> bool {
        let Some(plane) = self.moving_plane() else { return false };
        let depth_row = plane.estimate.h_b_from_a.matrix().row(2).transpose();
        let ray = |&k: &usize| self.ray_in_first(&self.matches[k]);
        let behind = plane.inliers.iter().filter_map(ray).filter(|ray| depth_row.dot(ray) < 0.0).count();
        2 * behind < plane.inliers.len()
    }

    /// Matches of a background that does not move, set aside.
    pub(crate) fn background(&self) -> usize {
        self.outcome.as_ref().map_or(0, |turning| turning.plane.static_background)
    }

    /// All matches, and whether each is on the plane.
    pub(crate) fn marked_matches(&self, plane: &RobustHomography) -> Vec<(PointMatch, bool)> {
        let mut marked: Vec<(PointMatch, bool)> = self.matches.iter().map(|m| (*m, false)).collect();
        for &k in &plane.inliers {
            marked[k].1 = true;
        }
        marked
    }
}

impl Index<PairId> for [PairObservation] {
    type Output = PairObservation;

    fn index(&self, id: PairId) -> &PairObservation {
        &self[id.index()]
    }
}

/// The images of some pairs.
pub(crate) fn images_of(some: &[PairId], pairs: &[PairObservation]) -> BTreeSet<ImageId> {
    some.iter().flat_map(|&id| pairs[id].images()).collect()
}

/// Where a homography between ideal pixels takes a pixel of the first image in the second, lens and all.
pub(crate) fn carried(h_b_from_a: &Homography, a: &Vector2<f64>, lens: Option<&PlacedLens>) -> Option<Vector2<f64>> {
    match lens {
        None => h_b_from_a.apply(a),
        Some(lens) => lens.carried(h_b_from_a, a),
    }
}

/// Why no pair shows a plane that turns; `needed` matches make a plane.
pub(crate) fn why_no_motion(pairs: &[PairObservation], needed: usize) -> Error {
    let refusals = || pairs.iter().filter_map(|p| p.outcome.as_ref().err());
    let count = |kind| refusals().filter(|r| r.kind == kind).count();
    let with_plane = pairs.len() - count(RefusalKind::NoPlane);
    if with_plane == 0 {
        if let ([_], Some(error)) = (pairs, refusals().find_map(|r| r.error.clone())) {
            return *error;
        }
        let best = refusals().filter_map(|r| r.plane.as_ref()).map(|plane| plane.inliers.len()).max().unwrap_or(0);
        return Error::NoCommonPlane { pairs: pairs.len(), best, needed };
    }
    let (reason, remedies) = if count(RefusalKind::Static) == with_plane {
        ("nothing moved between the images (all matches stand still)".to_string(), vec![Remedy::CLEAR_TURN])
    } else if count(RefusalKind::NoRotation) > 0 {
        let angles = || refusals().filter(|r| r.kind == RefusalKind::NoRotation).filter_map(|r| r.rotation_deg);
        let (largest, half_turns) = (angles().fold(0.0, f64::max), angles().filter(|a| *a > 90.0).count());
        let reason = if half_turns == count(RefusalKind::NoRotation) {
            format!(
                "the camera was turned by nearly 180 degrees (eigenvalue angle {largest:.1} degrees): the circular points cannot be \
                 told apart there"
            )
        } else {
            format!(
                "the camera was moved without a turn, a pure translation says nothing of the focal length (largest eigenvalue angle \
                 {largest:.1} degrees, not above its noise)"
            )
        };
        (reason, vec![Remedy::CLEAR_TURN])
    } else {
        let text = refusals().find(|r| r.kind == RefusalKind::Uncertain).map_or(String::new(), |r| r.reason.clone());
        (text, vec![Remedy::MoreMatches, Remedy::TurnFurther])
    };
    Error::NoUsableMotion { pairs: with_plane, reason, remedies }
}
