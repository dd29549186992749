//! The answer of the joint refinement (see [`crate::refine`]), in the terms of images and pixels.

use nalgebra::{DMatrix, DVector, SMatrix};

use crate::{
    calibrate::views::Views,
    geometry::{frame::Frame, intrinsics::Intrinsics, lens::Lens},
    ids::{GroupId, PairId},
    numerics::{levenberg_marquardt::StopReason, linalg::inverse_spd},
    refine::{
        Bundle, BundleOptions, CameraEstimate, CameraUnknowns, GroupEstimate, JointCovariance, Kind, Track,
        ViewEstimate, blocks::MATRIX, bundle::pixels_by_camera, disagreement,
    },
    result::{Covariance, Parameter, Prior, Refinement, ResidualReport, ViewParameter},
    start::linear_camera::{CameraSolution, PriorParameter},
};

/// Pairs of views of different attitudes with a common plane: whether it can be the floor of both.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct SharedFloors {
    pub(super) agree: usize,
    pub(super) contradict: usize,
}

impl SharedFloors {
    /// Whether most of them cannot be the floor of both, and more than one.
    pub(super) fn are_contradicted(self) -> bool {
        self.contradict >= MIN_CONTRADICTIONS && self.contradict > self.agree
    }
}

/// Pairs of different attitudes whose planes must contradict them to be worth a warning.
const MIN_CONTRADICTIONS: usize = 2;

/// Part of a prior's variance by which the data must narrow it to say anything of its number.
const MIN_VARIANCE_REDUCTION: f64 = 1e-6;

/// What a further step may still gain where the loop did not end by itself: a fifth of a deviation.
const MAX_REMAINING_GAIN: f64 = 0.02;

/// A refined calibration with the images its views are.
pub(super) struct JointSolution {
    pub(super) bundle: Bundle,
    /// What it was refined on.
    pub(super) tracks: Vec<Track>,
    /// Its views as images.
    pub(super) views: Views,
    /// The attitude of the closed-form solution that each group has; none before a scene without a floor.
    pub(super) attitudes: Vec<usize>,
    /// Pairs that link views of different attitudes.
    pub(super) cross_links: Vec<PairId>,
    /// What planes shared by views of different attitudes say of them.
    pub(super) floors: SharedFloors,
    /// Camera matrix in pixels.
    pub(super) intrinsics: Intrinsics,
    /// Lens.
    pub(super) lens: Lens,
    /// Covariance of the camera's numbers, pixels: fx, fy, cx, cy, skew, then those of its lens.
    covariance_px: DMatrix<f64>,
    /// Derivative of the same by the camera's numbers of the refinement.
    by_camera: DMatrix<f64>,
    /// What the covariance of the camera's numbers has beside that of the refinement.
    allowed: DMatrix<f64>,
}

impl JointSolution {
    /// Whether it is a minimum, so that its error bars and its evidence mean something.
    pub(super) fn has_converged(&self) -> bool {
        self.bundle.stop == StopReason::Converged || self.bundle.remaining_gain <= MAX_REMAINING_GAIN
    }

    pub(super) fn new(bundle: Bundle, tracks: Vec<Track>, views: Views, frame: &Frame) -> Self {
        let camera = &bundle.cameras[0];
        let mut intrinsics = frame.intrinsics_to_pixel(&camera.state.intrinsics_in_frame());
        intrinsics.skew += 0.0;
        let jacobian = pixels_by_camera(&intrinsics, frame, camera.state.count());
        Self {
            intrinsics,
            lens: camera.state.lens,
            covariance_px: &jacobian * &camera.covariance * jacobian.transpose(),
            by_camera: jacobian,
            allowed: DMatrix::zeros(camera.state.count(), camera.state.count()),
            views,
            cross_links: Vec::new(),
            floors: SharedFloors::default(),
            attitudes: Vec::new(),
            tracks,
            bundle,
        }
    }

    /// Adds to the covariance of the camera's numbers what else is not known of them.
    pub(super) fn allow(&mut self, added: &DMatrix<f64>) {
        self.bundle.allow(added);
        self.allowed += added;
        self.covariance_px = &self.by_camera * &self.bundle.cameras[0].covariance * self.by_camera.transpose();
    }

    /// The covariance of the camera's numbers as the noise alone has it.
    pub(super) fn covariance_of_noise(&self) -> DMatrix<f64> {
        (&self.bundle.cameras[0].covariance - &self.allowed) / self.bundle.widened
    }

    /// A covariance with the camera's numbers in pixels.
    pub(super) fn in_pixels(&self, covariance: &JointCovariance) -> JointCovariance {
        covariance.in_pixels(&self.by_camera)
    }

    /// The covariance of two parameters, pixels; zero where one was held or the lens has none of it.
    pub(super) fn covariance_of(&self, a: Parameter, b: Parameter) -> f64 {
        let camera = &self.bundle.cameras[0].state;
        camera.place(a).zip(camera.place(b)).map_or(0.0, |places| self.covariance_px[places])
    }

    /// Covariance of the numbers of a view, by name.
    pub(super) fn view_covariance(&self, view: &ViewEstimate) -> Covariance<ViewParameter> {
        let camera = &self.bundle.cameras[0].state;
        let covariance = self.in_pixels(&view.covariance);
        let place = |p: ViewParameter| match p {
            ViewParameter::Camera(p) => camera.place(p),
            other => ViewParameter::OF_POSE.iter().position(|q| *q == other).map(|i| camera.count() + i),
        };
        let places = ViewParameter::ALL.map(place);
        Covariance::from_fn(&ViewParameter::ALL, |r, c| {
            places[r].zip(places[c]).map_or(0.0, |places| covariance.matrix()[places])
        })
    }

    /// The attitude of the closed-form solution that a group has.
    pub(super) fn attitude_of(&self, group: GroupId) -> Option<usize> {
        self.attitudes.get(group.index()).copied()
    }

    /// The best known of the groups that have an attitude of the closed-form solution.
    pub(super) fn group_with(&self, attitude: usize) -> Option<&GroupEstimate> {
        let tilt = |g: &GroupEstimate| g.covariance.without_camera().view((0, 0), (2, 2)).trace();
        let members = self.attitudes.iter().zip(&self.bundle.groups).filter(|(a, _)| **a == attitude);
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

    /// How the refinement went.
    pub(super) fn report(&self) -> Refinement {
        let b = &self.bundle;
        let [observations, tracks, _] = b.counts;
        Refinement {
            observations,
            tracks,
            // From the evidence, where that is put together.
            reprojection_rms_px: None,
            degrees_of_freedom: b.degrees_of_freedom,
            patches: self.residuals(Kind::Patch),
            points: self.residuals(Kind::Point),
            cross_attitude_links: self.cross_links.len(),
            iterations: b.iterations,
            converged: b.stop == StopReason::Converged,
        }
    }

    /// How much of the variance of ln fx comes from the lens.
    pub(super) fn share_of_lens(&self) -> f64 {
        let c = &self.bundle.cameras[0].covariance;
        let free: Vec<usize> = (MATRIX..c.nrows()).filter(|&i| c[(i, i)] > 0.0).collect();
        let lens = DMatrix::from_fn(free.len(), free.len(), |r, s| c[(free[r], free[s])]);
        let cross = DVector::from_fn(free.len(), |r, _| c[(free[r], 0)]);
        match inverse_spd(&lens) {
            Some(inverse) if !free.is_empty() => (cross.transpose() * inverse * &cross)[(0, 0)] / c[(0, 0)],
            _ => 0.0,
        }
    }

    /// Distance between the mean of a number's prior and what the data alone say of it, in deviations of both together; `None` where it
    /// has no prior or the data say nothing of it.
    pub(super) fn prior_conflict(&self, unknowns: &CameraUnknowns, number: usize) -> Option<f64> {
        let (mean, sigma) = unknowns.prior(number)?;
        let camera = &self.bundle.cameras[0];
        let left = sigma * sigma - self.covariance_of_noise()[(number, number)];
        let moved = (camera.state.numbers()[number] - mean).abs();
        (left > MIN_VARIANCE_REDUCTION * sigma * sigma).then(|| moved / left.sqrt())
    }

    /// The closed-form solution with the refined numbers in their places.
    pub(super) fn solution(&self, start: CameraSolution, options: &BundleOptions) -> CameraSolution {
        let (chi_squared, degrees_of_freedom) = self.bundle.agreement;
        let CameraEstimate { state, covariance } = &self.bundle.cameras[0];
        let ratio = |i: usize, sigma: f64| covariance[(i, i)].max(0.0).sqrt() / sigma;
        let unknowns = &self.bundle.unknowns[0];
        let of_camera = start.priors.into_iter().map(|p| {
            let index = PriorParameter::ALL.iter().position(|n| *n == p.parameter);
            let known = index.and_then(|i| Some(ratio(i, unknowns.prior(i)?.1)));
            let conflict = index.and_then(|i| self.prior_conflict(unknowns, i));
            Prior { posterior_over_prior: known.unwrap_or(p.posterior_over_prior), conflict, ..p }
        });
        let of_lens = Parameter::ALL.into_iter().filter(|p| p.is_of_lens()).filter_map(|p| {
            let place = state.place(p)?;
            let (mean, sigma) = unknowns.prior(place)?;
            let conflict = self.prior_conflict(unknowns, place);
            Some(Prior { parameter: p.prior(), mean, sigma, posterior_over_prior: ratio(place, sigma), conflict })
        });
        let priors = of_camera.chain(of_lens).collect();
        let mut estimated = start.estimated;
        estimated[4] = unknowns.is_free(4);
        CameraSolution {
            intrinsics: self.intrinsics,
            covariance_px: self.covariance_px.fixed_view::<MATRIX, MATRIX>(0, 0).into_owned(),
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
            ..start
        }
    }
}
