//! From the linear camera to the joint refinement of everything (see [`crate::refine`]), and back to what is reported.

use nalgebra::{Matrix3, SMatrix, Vector2};

use crate::calibrate::{
    LensModel, Options, Pipeline,
    linear::Chosen,
    pairs::PairResult,
    report::{Attitude, KnownLens},
    unknown_lens::{K1_SIGMA, K2_SIGMA},
};
use crate::{
    error::Error,
    floor::view::FloorView,
    geometry::{
        attitude::attitude_rotation, distortion::Distortion, frame::Frame, intrinsics::Intrinsics, plane_view::View,
        size::ImageSize,
    },
    numerics::levenberg_marquardt::StopReason,
    pairs::{
        correspondence::{ImagePair, PointMatch},
        refine::sampson_squared,
        robust::RobustHomography,
    },
    refine::{
        Bundle, BundleOptions, CAMERA, CameraState, CameraUnknowns, GroupEstimate, Kind, Observation, SceneModel,
        State, Track, VIEW_NUMBERS, ViewEstimate, adjust,
        bundle::pixels_by_camera,
        disagreement,
        start::{Link, floor_deviation, state_from_links},
        tracks::join_matches,
    },
    result::{FloorHomography, Refinement, ResidualReport, ViewReport},
    select::attitude_groups::{AttitudeGroup, Sides},
    start::linear_camera::{CameraOptions, CameraSolution, PriorParameter, PriorUse},
};

/// Noise no camera is below, in pixels: exact data keep finite weights.
const LEAST_NOISE_PX: f64 = 1e-4;
/// Matches that the common noise of all pairs is worth in the estimate of one pair's.
const COMMON_NOISE_MATCHES: f64 = 20.0;

/// Relative deviation of f from which on other focal lengths are tried as starts.
const VAGUE: f64 = 0.03;

/// Deviations from its homography within which a match takes part; the weights of the loss do the rest.
const REACH: f64 = 5.0;

/// Matches that make a tie between views of different attitudes, how far its homography may be from one of the floor (radians and
/// relative lengths), how many ties a view has at most, and by how much they may raise the variance of the residuals of patches and of points.
const MIN_TIE_MATCHES: usize = 20;
const MAX_TIE_DEVIATION: f64 = 0.03;
const TIES_PER_VIEW: usize = 2;
const MAX_TIE_VARIANCE: f64 = 1.3;
const MAX_TIE_POINT_VARIANCE: f64 = 3.0;

/// Variance of the residuals under rotations, in units of the matching noise, that no real lens and distant scene come near.
const MAX_ROTATION_VARIANCE: f64 = 100.0;

/// Deviation of such a homography from which on it contradicts the two attitudes.
const CONTRADICTION: f64 = 0.1;

/// Pairs of views of different attitudes with a common plane: whether it can be the floor of both.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct SharedFloors {
    pub(super) agree: usize,
    pub(super) contradict: usize,
}

/// A refined calibration with the images its views are.
pub(super) struct Joint {
    pub(super) bundle: Bundle,
    /// What it was refined on.
    pub(super) tracks: Vec<Track>,
    /// Image of each view.
    pub(super) images: Vec<usize>,
    /// The attitude of the solution that each group has.
    pub(super) attitude_of_group: Vec<usize>,
    /// Pairs that tie views of different attitudes.
    pub(super) ties: Vec<usize>,
    /// What planes shared by views of different attitudes say of them.
    pub(super) floors: SharedFloors,
    /// Camera matrix in pixels.
    pub(super) intrinsics: Intrinsics,
    /// Lens.
    pub(super) distortion: Distortion,
    /// Covariance of (fx, fy, cx, cy, skew, k1, k2), pixels.
    pub(super) covariance_px: SMatrix<f64, CAMERA, CAMERA>,
    /// Derivative of the same by the camera's numbers of the refinement.
    by_camera: SMatrix<f64, CAMERA, CAMERA>,
}

impl Joint {
    fn new(bundle: Bundle, tracks: Vec<Track>, images: Vec<usize>, frame: &Frame) -> Self {
        let camera = &bundle.cameras[0];
        let mut intrinsics = frame.intrinsics_to_pixel(&camera.state.intrinsics_in_frame());
        intrinsics.skew += 0.0;
        let jacobian = pixels_by_camera(&intrinsics, frame);
        let covariance = camera.fixed_covariance();
        let [k1, k2, p1, p2] = ["k1", "k2", "p1", "p2"].map(|name| camera.state.lens.parameter(name).unwrap_or(0.0));
        let distortion = Distortion { k1, k2, p1, p2 };
        Self {
            intrinsics,
            distortion,
            covariance_px: jacobian * covariance * jacobian.transpose(),
            by_camera: jacobian,
            images,
            ties: Vec::new(),
            floors: SharedFloors::default(),
            attitude_of_group: Vec::new(),
            tracks,
            bundle,
        }
    }

    /// A covariance whose first numbers are the camera's of the refinement with these in pixels.
    pub(super) fn in_pixels<const N: usize>(&self, covariance: &SMatrix<f64, N, N>) -> SMatrix<f64, N, N> {
        let mut jacobian = SMatrix::<f64, N, N>::identity();
        jacobian.fixed_view_mut::<CAMERA, CAMERA>(0, 0).copy_from(&self.by_camera);
        jacobian * covariance * jacobian.transpose()
    }

    /// The best known of the groups that have an attitude of the solution.
    pub(super) fn group_with(&self, attitude: usize) -> Option<&GroupEstimate> {
        let tilt = |g: &GroupEstimate| {
            let c = g.covariance.rest();
            c[(0, 0)] + c[(1, 1)]
        };
        let members = self.attitude_of_group.iter().zip(&self.bundle.groups).filter(|(a, _)| **a == attitude);
        members.map(|(_, g)| g).min_by(|a, b| tilt(a).total_cmp(&tilt(b)))
    }

    /// Covariance of (ln fx, ln fy/fx, cx, cy, skew), frame units.
    pub(super) fn camera_covariance(&self) -> SMatrix<f64, 5, 5> {
        self.bundle.cameras[0].covariance.fixed_view::<5, 5>(0, 0).into_owned()
    }

    fn residuals(&self, kind: Kind) -> Option<ResidualReport> {
        let b = &self.bundle;
        let observations = b.observations_of[kind as usize];
        (observations > 0).then(|| ResidualReport {
            observations,
            variance_factor: b.variance_factors[kind as usize],
            design_effect: b.design_effects[kind as usize],
        })
    }

    pub(super) fn report(&self) -> Refinement {
        let b = &self.bundle;
        let [observations, tracks, _] = b.counts;
        Refinement {
            observations,
            tracks,
            degrees_of_freedom: b.degrees_of_freedom,
            patches: self.residuals(Kind::Patch),
            points: self.residuals(Kind::Point),
            ties: self.ties.len(),
            iterations: b.iterations,
            converged: b.stop == StopReason::Converged,
        }
    }

    /// How much of the variance of ln fx comes from the lens.
    pub(super) fn share_of_lens(&self) -> f64 {
        let c = self.bundle.cameras[0].fixed_covariance();
        let free: Vec<usize> = (5..CAMERA).filter(|&i| c[(i, i)] > 0.0).collect();
        let lens = nalgebra::DMatrix::from_fn(free.len(), free.len(), |r, s| c[(free[r], free[s])]);
        let cross = nalgebra::DVector::from_fn(free.len(), |r, _| c[(free[r], 0)]);
        match crate::numerics::linalg::inverse_spd(&lens) {
            Some(inverse) if !free.is_empty() => (cross.transpose() * inverse * &cross)[(0, 0)] / c[(0, 0)],
            _ => 0.0,
        }
    }

    /// The linear solution with the refined numbers in their places.
    pub(super) fn solution(&self, linear: CameraSolution, options: &BundleOptions) -> CameraSolution {
        let (chi_squared, degrees_of_freedom) = self.bundle.agreement;
        let covariance = self.bundle.cameras[0].fixed_covariance();
        let ratio = |i: usize, sigma: f64| covariance[(i, i)].max(0.0).sqrt() / sigma;
        let unknowns = &options.cameras[0];
        let of_camera = linear.priors.into_iter().map(|p| {
            let index = PriorParameter::ALL.iter().position(|n| n.name() == p.parameter);
            let known = index.and_then(|i| Some(ratio(i, unknowns.prior(i)?.1)));
            PriorUse { posterior_over_prior: known.unwrap_or(p.posterior_over_prior), ..p }
        });
        let of_lens = (5..CAMERA).filter_map(|i| {
            let (mean, sigma) = unknowns.prior(i)?;
            let parameter = PriorParameter::ALL[i].name();
            Some(PriorUse { parameter, mean, sigma, posterior_over_prior: ratio(i, sigma) })
        });
        let priors = of_camera.chain(of_lens).collect();
        let mut estimated = linear.estimated;
        estimated[4] = unknowns.is_free(4);
        CameraSolution {
            intrinsics: self.intrinsics,
            covariance_px: self.covariance_px.fixed_view::<5, 5>(0, 0).into_owned(),
            estimated,
            priors,
            chi_squared,
            degrees_of_freedom,
            attitude_sigma_rad: self.bundle.attitude_sigma.sigma,
            attitude_sigma_estimated: self.bundle.attitude_sigma.estimated,
            variance_inflation: if options.attitude_sigma_rad.is_some() {
                disagreement(self.bundle.agreement)
            } else {
                1.0
            },
            ..linear
        }
    }
}

/// What the joint refinement is given.
pub(super) struct Setup {
    pub(super) links: Vec<Link>,
    tracks: Vec<Track>,
}

impl Pipeline<'_> {
    /// Options of the joint refinement under what is known of camera and lens.
    pub(super) fn bundle_options(&self, camera: &CameraOptions, known: &KnownLens, frame: &Frame) -> BundleOptions {
        let estimate_lens = matches!(known, KnownLens::Estimated(_));
        self.options.bundle_options(self.size, camera, estimate_lens, frame)
    }

    /// Refines the linear solution on the matches of the motions chosen. `None` when there are no matches to refine on.
    ///
    /// # Errors
    /// See [`adjust`].
    pub(super) fn refine_jointly(
        &self,
        pairs: &[ImagePair],
        results: &[PairResult],
        chosen: &Chosen,
        solution: &CameraSolution,
        known: &KnownLens,
        options: &BundleOptions,
    ) -> Result<Option<Joint>, Error> {
        let used = chosen.used();
        let images = images_of(&used, pairs);
        let (group_of_view, attitude_of_group) = groups_of(&used, pairs, &images, solution);
        let Some(setup) = self.setup(pairs, results, &used, &images, known) else { return Ok(None) };
        let both_sides = chosen.motions.iter().any(|(i, m)| used.contains(i) && m.sides == Sides::Both);
        let scene = if both_sides { SceneModel::Directions } else { SceneModel::Floor };
        // A focal length that the linear solution hardly knows may be another.
        let vague = solution.covariance_px[(0, 0)].sqrt() > VAGUE * solution.intrinsics.fx;
        let factors: &[f64] = if vague { &[1.0, 0.8, 1.25] } else { &[1.0] };
        let start = |factor: &f64| {
            let k = &solution.intrinsics;
            let k = Intrinsics { fx: k.fx * factor, fy: k.fy * factor, ..*k };
            let of_solution = self.attitudes_under(&k, pairs, results, &used, solution);
            let attitudes: Vec<Matrix3<f64>> = attitude_of_group.iter().map(|&a| of_solution[a]).collect();
            state_from_links(scene, self.camera_vector(&k, known), &k, &attitudes, &group_of_view, &setup.links)
        };
        let starts = factors.iter().filter_map(start).collect();
        let mut joint = self.adjusted(scene, setup, images.clone(), starts, options)?;
        joint.attitude_of_group = attitude_of_group;
        if scene == SceneModel::Directions || solution.groups.len() < 2 {
            return Ok(Some(joint));
        }
        // Views of different attitudes that see the same floor, tied by their ordinary matches.
        let (ties, floors) = self.ties(pairs, results, &used, &joint);
        joint.floors = floors;
        if ties.is_empty() {
            return Ok(Some(joint));
        }
        let all: Vec<usize> = used.iter().chain(&ties).copied().collect();
        let Some(setup) = self.setup(pairs, results, &all, &images, known) else { return Ok(Some(joint)) };
        let attitudes: Vec<Matrix3<f64>> = joint.bundle.state.groups.iter().map(|g| g.attitude).collect();
        let start = state_from_links(
            scene,
            joint.bundle.state.cameras[0],
            &joint.intrinsics,
            &attitudes,
            &group_of_view,
            &setup.links,
        );
        let Ok(mut tied) = self.adjusted(scene, setup, images, start.into_iter().collect(), options) else {
            return Ok(Some(joint));
        };
        // What contradicts the motions is no tie.
        let raised = |kind: Kind| {
            let [before, after] = [&joint, &tied].map(|j| j.bundle.variance_factors[kind as usize]);
            after / before
        };
        if raised(Kind::Patch) > MAX_TIE_VARIANCE || raised(Kind::Point) > MAX_TIE_POINT_VARIANCE {
            return Ok(Some(joint));
        }
        (tied.ties, tied.attitude_of_group, tied.floors) = (ties, joint.attitude_of_group, joint.floors);
        Ok(Some(tied))
    }

    /// Pairs of views of different attitudes whose homographies are of the floor that both look at.
    fn ties(
        &self,
        pairs: &[ImagePair],
        results: &[PairResult],
        used: &[usize],
        joint: &Joint,
    ) -> (Vec<usize>, SharedFloors) {
        let (k, k_inverse) = (joint.intrinsics.matrix(), joint.intrinsics.inverse_matrix());
        let view = |image: usize| joint.images.binary_search(&image).ok();
        let group = |v: usize| joint.bundle.state.frames[v].group;
        let attitude = |v: usize| &joint.bundle.state.groups[group(v)].attitude;
        let candidates: Vec<(usize, usize, f64)> = (0..pairs.len())
            .filter(|i| !used.contains(i))
            .filter_map(|i| {
                let (a, b) = (view(pairs[i].from)?, view(pairs[i].to)?);
                let robust = results[i].robust().filter(|r| !r.is_static && r.inliers.len() >= MIN_TIE_MATCHES)?;
                let m = k_inverse * robust.estimate.h_b_from_a.matrix() * k;
                let deviation = floor_deviation(&m, [attitude(a), attitude(b)])?;
                (group(a) != group(b)).then_some((i, robust.inliers.len(), deviation))
            })
            .collect();
        let contradictions = candidates.iter().filter(|c| c.2 > CONTRADICTION).count();
        let mut found: Vec<(usize, usize)> =
            candidates.iter().filter(|c| c.2 < MAX_TIE_DEVIATION).map(|c| (c.0, c.1)).collect();
        let floors = SharedFloors { agree: found.len(), contradict: contradictions };
        found.sort_by_key(|(i, matches)| (std::cmp::Reverse(*matches), *i));
        found.truncate(TIES_PER_VIEW * joint.images.len());
        let mut ties: Vec<usize> = found.into_iter().map(|(i, _)| i).collect();
        ties.sort_unstable();
        (ties, floors)
    }

    /// Refines from starts.
    pub(super) fn adjusted(
        &self,
        scene: SceneModel,
        setup: Setup,
        images: Vec<usize>,
        starts: Vec<State>,
        options: &BundleOptions,
    ) -> Result<Joint, Error> {
        if starts.is_empty() {
            return Err(Error::Numerical {
                stage: "joint refinement",
                detail: "the homographies of the motions fit no camera".into(),
            });
        }
        let bundle = adjust(scene, &setup.tracks, starts, options)?;
        let [patches, points] = bundle.variance_factors;
        if scene == SceneModel::Directions && patches.max(points) > MAX_ROTATION_VARIANCE {
            return Err(Error::NoUsableMotion {
                pairs: setup.links.len(),
                reason: format!(
                    "the points lie above and below the horizon, as those far from a camera that turns on the spot do, but rotations \
                     leave residuals {:.0} times as large as the matching noise: the camera moved, before a scene that is no floor",
                    patches.max(points).sqrt()
                ),
                remedy: "Turn the camera about its optical centre, or about the normal of a floor that it sees; name the true \
                         motions with --pairs"
                    .into(),
            });
        }
        Ok(Joint::new(bundle, setup.tracks, images, &self.frame()))
    }

    /// Camera matrix and lens as the refinement starts from them.
    pub(super) fn camera_vector(&self, k: &Intrinsics, known: &KnownLens) -> CameraState {
        let lens = match known {
            KnownLens::NotModelled => Distortion::default(),
            KnownLens::Given(lens) => lens.distortion,
            KnownLens::Estimated(finding) => {
                finding.lens().map_or(Distortion::default(), |l| l.with_focal_length(k.fx).distortion)
            }
        };
        let held = matches!(known, KnownLens::Estimated(_)) && self.options.lens == LensModel::K1;
        let lens = Distortion { k2: if held { 0.0 } else { lens.k2 }, ..lens };
        CameraState::new(k, &lens.into(), &self.frame())
    }

    /// Attitudes of the groups as their circular points say under a camera matrix.
    fn attitudes_under(
        &self,
        k: &Intrinsics,
        pairs: &[ImagePair],
        results: &[PairResult],
        used: &[usize],
        solution: &CameraSolution,
    ) -> Vec<Matrix3<f64>> {
        let of = |group: &AttitudeGroup| {
            let members = group.members.iter().map(|&m| used[m]);
            let seen = members.flat_map(|i| results[i].inliers().iter().map(move |&k| pairs[i].matches[k].a));
            let attitude = Attitude::of(&group.fused.point, k, &self.frame(), seen);
            attitude_rotation(attitude.pitch_down_rad, attitude.roll_rad)
        };
        solution.groups.iter().map(of).collect()
    }

    /// Indices of the matches within reach of a pair's homography: its inliers and what lies a little further off, so that the
    /// refinement's own weights decide and not a cut, which costs good matches where they are few.
    fn near_plane(&self, pair: &ImagePair, robust: &RobustHomography, known: &KnownLens) -> Vec<usize> {
        let frame = self.frame();
        let lens = known.lens();
        let noise = (robust.estimate.sigma_px.max(LEAST_NOISE_PX) / frame.scale_px).powi(2);
        let within = |m: &PointMatch| {
            let ideal = match lens {
                Some(lens) => lens.ideal_match(m),
                None => Some(*m),
            };
            ideal.is_some_and(|m| {
                let local = PointMatch { a: frame.from_pixel(&m.a), b: frame.from_pixel(&m.b), ..m };
                let squared = sampson_squared(&robust.estimate.in_frame, &local) / (noise * m.sigma_px * m.sigma_px);
                squared < REACH * REACH
            })
        };
        let mut near: Vec<usize> = (0..pair.matches.len()).filter(|&k| within(&pair.matches[k])).collect();
        near.extend(&robust.inliers);
        near.sort_unstable();
        near.dedup();
        near
    }

    /// Links and tracks of the pairs `used`, views numbered as in `images`. `None` when there are no matches.
    pub(super) fn setup(
        &self,
        pairs: &[ImagePair],
        results: &[PairResult],
        used: &[usize],
        images: &[usize],
        known: &KnownLens,
    ) -> Option<Setup> {
        let view = |image: usize| view_in(images, image);
        let robust_of = |i: usize| results[i].robust().map(|robust| (i, robust));
        let all: Vec<(usize, &RobustHomography)> = used.iter().map(|&i| robust_of(i)).collect::<Option<_>>()?;
        let link = |(i, robust): &(usize, &RobustHomography)| Link {
            from: view(pairs[*i].from),
            to: view(pairs[*i].to),
            h_to_from: robust.estimate.h_b_from_a,
            matches: robust.inliers.len(),
        };
        let links = all.iter().map(link).collect();
        let mut tracks = Vec::new();
        for kind in [Kind::Patch, Kind::Point] {
            let of_kind: Vec<_> = all.iter().filter(|(_, r)| r.patches == (kind == Kind::Patch)).collect();
            let count: usize = of_kind.iter().map(|(_, r)| r.inliers.len()).sum();
            let common = of_kind.iter().map(|(_, r)| r.inliers.len() as f64 * r.estimate.sigma_px.powi(2)).sum::<f64>()
                / count as f64;
            let mut matches: Vec<[Observation; 2]> = Vec::new();
            for (i, robust) in of_kind {
                // Few matches do not tell their noise: that of all of the kind counts as some more.
                let n = robust.inliers.len() as f64;
                let noise =
                    (n * robust.estimate.sigma_px.powi(2) + COMMON_NOISE_MATCHES * common) / (n + COMMON_NOISE_MATCHES);
                for k in self.near_plane(&pairs[*i], robust, known) {
                    let m = &pairs[*i].matches[k];
                    let variance = (noise * m.sigma_px * m.sigma_px).max(LEAST_NOISE_PX.powi(2));
                    let observation =
                        |image: usize, pixel: Vector2<f64>| Observation::new(view(image), pixel, variance.sqrt());
                    matches.push([observation(pairs[*i].from, m.a), observation(pairs[*i].to, m.b)]);
                }
            }
            tracks.extend(join_matches(kind, &matches));
        }
        (!tracks.is_empty()).then_some(Setup { links, tracks })
    }
}

/// Images of the pairs `used`, ascending.
pub(super) fn images_of(used: &[usize], pairs: &[ImagePair]) -> Vec<usize> {
    let all: std::collections::BTreeSet<usize> = used.iter().flat_map(|&i| [pairs[i].from, pairs[i].to]).collect();
    all.into_iter().collect()
}

/// Groups of the refinement: views that motions connect share an attitude by what they are. Motions that only happen to have the
/// same attitude within their noise keep one each, since a true difference would be forced to nothing. Returns the group of
/// each view and the attitude of the solution that each group starts from and is reported as.
fn groups_of(
    used: &[usize],
    pairs: &[ImagePair],
    images: &[usize],
    solution: &CameraSolution,
) -> (Vec<usize>, Vec<usize>) {
    let mut label: Vec<usize> = (0..images.len()).collect();
    let views = |i: usize| [pairs[i].from, pairs[i].to].map(|image| view_in(images, image));
    for &i in used {
        let [a, b] = views(i).map(|v| label[v]);
        label.iter_mut().filter(|l| **l == a.max(b)).for_each(|l| *l = a.min(b));
    }
    let roots: std::collections::BTreeSet<usize> = label.iter().copied().collect();
    let group_of_view: Vec<usize> = label.iter().map(|l| roots.range(..l).count()).collect();
    let mut attitude_of_group = vec![0; roots.len()];
    for (attitude, group) in solution.groups.iter().enumerate() {
        for &m in &group.members {
            attitude_of_group[group_of_view[views(used[m])[0]]] = attitude;
        }
    }
    (group_of_view, attitude_of_group)
}

fn view_in(images: &[usize], image: usize) -> usize {
    images.binary_search(&image).unwrap_or(0)
}

impl Options {
    /// What the joint refinement assumes where nothing is known of the images yet, in the frame of such a size.
    pub(crate) fn assumptions(&self, size: ImageSize) -> BundleOptions {
        let frame = Frame::new(size, self.principal_point_px);
        let estimate_lens = self.distortion.is_none() && self.lens != LensModel::None;
        self.bundle_options(size, &self.camera(size), estimate_lens, &frame)
    }

    fn bundle_options(
        &self,
        size: ImageSize,
        camera: &CameraOptions,
        estimate_lens: bool,
        frame: &Frame,
    ) -> BundleOptions {
        let k = self.constraint.free();
        let priors = camera.priors(frame).0;
        let (k1, k2) = (estimate_lens, estimate_lens && self.lens == LensModel::K1K2);
        let lens_prior =
            |free: bool, parameter, sigma: f64| free.then(|| self.given_prior(parameter).unwrap_or((0.0, sigma)));
        let image_half_sides = [size.width, size.height].map(|side| 0.5 * side as f64 / frame.scale_px);
        let unknowns = CameraUnknowns {
            matrix_free: [k[0], k[1], k[2], k[3], k[4] || priors[4].is_some()],
            matrix_priors: priors,
            lens_free: vec![k1, k2],
            lens_priors: vec![
                lens_prior(k1, PriorParameter::K1, K1_SIGMA),
                lens_prior(k2, PriorParameter::K2, K2_SIGMA),
            ],
            ..CameraUnknowns::new(*frame, image_half_sides)
        };
        BundleOptions {
            attitude_sigma_rad: (!camera.estimate_attitude_sigma).then_some(camera.attitude_sigma_rad),
            attitude_scale_rad: camera.attitude_sigma_rad,
            height_sigma: self.height_sigma,
            ..BundleOptions::new(vec![unknowns])
        }
    }
}

impl PairResult {
    /// The homography, whether or not it shows a turn.
    pub(super) fn robust(&self) -> Option<&RobustHomography> {
        match &self.outcome {
            Ok((robust, _)) => Some(robust),
            Err(refusal) => refusal.homography.as_deref(),
        }
    }

    /// Indices of the matches on the plane; none without a homography.
    pub(super) fn inliers(&self) -> &[usize] {
        self.outcome.as_ref().map_or(&[], |(robust, _)| &robust.inliers)
    }
}

impl Pipeline<'_> {
    pub(super) fn view_reports(&self, joint: &Joint) -> Vec<ViewReport> {
        let b = &joint.bundle;
        let report = |(v, estimate): (usize, &Option<ViewEstimate>)| {
            let e = estimate.as_ref()?;
            let floor = b.scene == SceneModel::Floor;
            let covariance = joint.in_pixels::<VIEW_NUMBERS>(&e.covariance.fixed());
            let sigma_deg = |i: usize| covariance[(CAMERA + i, CAMERA + i)].max(0.0).sqrt().to_degrees();
            let [pitch_down_rad, roll_rad] = e.pitch_roll_rad;
            let view = View { pitch_down_rad, roll_rad, yaw_rad: e.yaw_rad, centre: e.centre };
            let over_floor = FloorView::new(&joint.intrinsics, &joint.distortion, &view).ok().filter(|_| floor);
            Some(ViewReport {
                image: self.names[joint.images[v]].clone(),
                attitude: joint.attitude_of_group.get(b.state.frames[v].group).copied(),
                origin: self.names[joint.images[e.origin]].clone(),
                yaw_deg: e.yaw_rad.to_degrees(),
                yaw_sigma_deg: e.yaw_sigma_rad.to_degrees(),
                pitch_down_deg: pitch_down_rad.to_degrees(),
                pitch_down_sigma_deg: sigma_deg(0),
                roll_deg: roll_rad.to_degrees(),
                roll_sigma_deg: sigma_deg(1),
                position: floor.then(|| e.centre.into()),
                position_sigma: floor.then(|| e.centre_sigma.into()),
                floor_from_image: over_floor.map(|o| FloorHomography::new(&o, &covariance)),
                observations: e.observations,
                weighted_rms: e.weighted_rms,
                covariance,
            })
        };
        b.views.iter().enumerate().filter_map(report).collect()
    }
}
