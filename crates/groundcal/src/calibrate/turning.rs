//! A camera that turns on the spot, about any axes, before a scene of any shape (a panorama, a pan-tilt head).
//!
//! Then every pair's homography is K R K⁻¹, whatever the axis. That is told from a floor by a focal length that makes
//! K⁻¹ H K a rotation for pairs of all images at once, and confirmed by the joint refinement of directions, whose residuals
//! must be those of the matches. Plane-normal motions do not come into it: every view has an attitude of its own.

use nalgebra::Matrix3;

use crate::calibrate::{
    Pipeline, Stage,
    joint::{Joint, images_of},
    linear::Chosen,
    pairs::PairResult,
    report::{Concluded, KnownLens},
};
use crate::{
    error::Error,
    geometry::{attitude::attitude_rotation, intrinsics::Intrinsics},
    pairs::{correspondence::ImagePair, plane_lens::Lens},
    refine::{
        Kind, SceneModel,
        start::{rotations_from_links, state_from_links},
    },
    result::{Calibration, Warning},
    start::linear_camera::{CameraSolution, check_certainty},
};

/// Fewest images: two views of a turn are a plane-normal motion, whatever the axis.
pub(super) const MIN_IMAGES: usize = 3;
/// Largest ‖M Mᵀ - I‖ of a pair's M = K⁻¹ H K that passes for a rotation before distortion and noise are known.
const MAX_DEVIATION: f64 = 0.1;
/// Largest variance of the residuals under rotations over that under a homography for each pair.
const MAX_VARIANCE: f64 = 2.5;
/// Focal lengths tried, in image widths.
const FOCAL_RANGE: (f64, f64) = (0.3, 6.0);
const FOCAL_STEPS: usize = 80;

/// Pairs that rotations explain.
pub(super) struct Turning {
    /// Indices of the pairs.
    pub(super) used: Vec<usize>,
    /// Images joined by them.
    pub(super) images: usize,
    focal_px: f64,
}

impl PairResult {
    /// ‖M Mᵀ - I‖ for M = K⁻¹ H K of determinant 1: zero for a rotation.
    fn deviation_from_rotation(&self, k: &Intrinsics) -> Option<f64> {
        let robust = self.robust().filter(|r| !r.is_static)?;
        let m = k.inverse_matrix() * robust.estimate.h_b_from_a.matrix() * k.matrix();
        Some((m * m.transpose() - Matrix3::identity()).norm())
    }
}

impl Pipeline<'_> {
    /// The square-pixel camera that makes rotations of most pairs, and which pairs those are.
    pub(super) fn nearest_to_rotations(&self, results: &[PairResult]) -> Option<(Intrinsics, Vec<usize>)> {
        let (width, [cx, cy]) =
            (self.size.width as f64, self.options.principal_point_px.unwrap_or(self.size.centre_px()));
        let camera = |i: usize| {
            let (low, high) = FOCAL_RANGE;
            let f = width * low * (high / low).powf(i as f64 / FOCAL_STEPS as f64);
            Intrinsics { fy: f * self.options.aspect.unwrap_or(1.0), ..Intrinsics::square(f, cx, cy) }
        };
        // Truncated squares: a wrong pair costs no more than a bad one.
        let score = |k: &Intrinsics| -> f64 {
            let all = results.iter().filter_map(|r| r.deviation_from_rotation(k));
            all.map(|d| d.min(2.0 * MAX_DEVIATION).powi(2)).sum()
        };
        let best = (0..=FOCAL_STEPS).map(camera).min_by(|a, b| score(a).total_cmp(&score(b)))?;
        let fits = |i: &usize| results[*i].deviation_from_rotation(&best).is_some_and(|d| d < MAX_DEVIATION);
        Some((best, (0..results.len()).filter(fits).collect()))
    }

    /// The pairs that one camera turning on the spot explains, if they join three images or more, none of them contradicts a
    /// third pair, and the joint refinement agrees.
    pub(super) fn turning(&self, pairs: &[ImagePair], results: &[PairResult], known: &KnownLens) -> Option<Turning> {
        let (best, used) = self.nearest_to_rotations(results)?;
        let seen = results.iter().filter(|r| r.robust().is_some_and(|h| !h.is_static)).count();
        // A floor seen from several places contradicts in most pairs.
        if 2 * used.len() <= seen {
            return None;
        }
        let used = largest_connected(&used, pairs);
        let images = images_of(&used, pairs).len();
        if images < MIN_IMAGES {
            return None;
        }
        let turning = Turning { used, images, focal_px: best.fx };
        let refined = self.refine_turning(pairs, results, &turning, known).ok()?;
        (refined.bundle.variance_factors[Kind::Point as usize] < MAX_VARIANCE).then_some(turning)
    }

    fn refine_turning(
        &self,
        pairs: &[ImagePair],
        results: &[PairResult],
        turning: &Turning,
        known: &KnownLens,
    ) -> Result<Joint, Error> {
        let [cx, cy] = self.options.principal_point_px.unwrap_or(self.size.centre_px());
        let aspect = self.options.aspect.unwrap_or(1.0);
        let k = Intrinsics { fy: turning.focal_px * aspect, ..Intrinsics::square(turning.focal_px, cx, cy) };
        let mut options = self.bundle_options(&self.options.camera(self.size), known, &self.frame());
        // Each view has an attitude of its own: there is nothing for it to stray from.
        options.attitude_sigma_rad = Some(0.0);
        let images = images_of(&turning.used, pairs);
        let failed = |detail: &str| Error::Numerical { stage: "joint refinement", detail: detail.into() };
        let setup =
            self.setup(pairs, results, &turning.used, &images, known).ok_or_else(|| failed("there are no matches"))?;
        // World axes are those of the first view, which is level by definition.
        let attitudes = rotations_from_links(attitude_rotation(0.0, 0.0), images.len(), &k, &setup.links)
            .ok_or_else(|| failed("the pairs do not connect the images"))?;
        let groups: Vec<usize> = (0..images.len()).collect();
        let scene = SceneModel::Directions;
        let start = state_from_links(scene, self.camera_vector(&k, known), &k, &attitudes, &groups, &setup.links);
        self.adjusted(scene, setup, images, start.into_iter().collect(), &options)
    }

    /// The camera of a turning, patches and all.
    pub(super) fn conclude_turning(
        &self,
        pairs: Vec<ImagePair>,
        results: Vec<PairResult>,
        turning: &Turning,
        warnings: Vec<Warning>,
        known: &KnownLens,
        lens: Option<&Lens>,
    ) -> Result<Calibration, Error> {
        let (pairs, results) = self.sharpen(pairs, results, &turning.used, lens);
        self.observer.begin(Stage::Camera, 1);
        let joint = self.refine_turning(&pairs, &results, turning, known)?;
        let camera = self.options.camera(self.size);
        let options = self.bundle_options(&camera, known, &self.frame());
        let free = self.options.constraint.free();
        let empty = CameraSolution {
            intrinsics: joint.intrinsics,
            covariance_px: nalgebra::SMatrix::zeros(),
            estimated: [free[0], free[0], free[2], free[3], free[4]],
            priors: camera.prior_uses(&self.frame(), &nalgebra::SMatrix::zeros()),
            groups: Vec::new(),
            chi_squared: 0.0,
            degrees_of_freedom: 0,
            attitude_sigma_rad: 0.0,
            attitude_sigma_estimated: false,
            variance_inflation: 1.0,
        };
        let solution = joint.solution(empty, &options);
        check_certainty(&joint.camera_covariance(), self.options.constraint, joint.bundle.groups.len(), &self.frame())?;
        let lens_share = joint.share_of_lens().sqrt();
        let chosen = Chosen { motions: Vec::new(), verdicts: Vec::new() };
        let concluded = Concluded { solution, joint: Some(joint), lens_share, chosen, used: turning.used.clone() };
        Ok(self.report(&pairs, &results, concluded, warnings, known))
    }
}

/// The pairs of the largest set of images that pairs connect.
fn largest_connected(used: &[usize], pairs: &[ImagePair]) -> Vec<usize> {
    let mut label: std::collections::BTreeMap<usize, usize> =
        images_of(used, pairs).into_iter().map(|i| (i, i)).collect();
    for &i in used {
        let (a, b) = (label[&pairs[i].from], label[&pairs[i].to]);
        let (keep, change) = (a.min(b), a.max(b));
        label.values_mut().filter(|l| **l == change).for_each(|l| *l = keep);
    }
    let size = |root: usize| label.values().filter(|l| **l == root).count();
    let largest = label.values().copied().max_by(|a, b| size(*a).cmp(&size(*b)).then(b.cmp(a)));
    used.iter().copied().filter(|&i| Some(label[&pairs[i].from]) == largest).collect()
}
