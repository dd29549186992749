//! The blocks of unknowns of the joint refinement: their numbers, how a step moves them, and which are estimated.
//!
//! | block          | numbers |
//! |----------------|---------|
//! | camera         | ln fx, ln fy/fx, cx, cy, skew (units of the camera's frame), then those of its lens, however many |
//! | rig pose       | of a camera in the rig: rotation (3), translation (3); that of the first camera is the identity |
//! | attitude group | attitude (2), ln of the height |
//! | frame          | δ (2), yaw, x, y, ln of the height over that of its group; departures of its picture: ln f over the camera's, turn while it is read out, shift (2) |
//! | point          | two in the tangent plane of a unit vector; eliminated |
//!
//! A frame is a moment at which all cameras of the rig look; with one camera it is an image. What has an attitude of its own is a
//! frame in a group of its own.

use nalgebra::{DVector, Matrix3, Rotation3, SVector, Vector2, Vector3};

use crate::{
    geometry::{
        camera::INTRINSIC_NAMES,
        frame::Frame,
        intrinsics::Intrinsics,
        lens::{Lens, MAX_LENS_PARAMETERS},
        parameters::Parameter,
    },
    numerics::levenberg_marquardt::{LmOptions, StepPolicy},
    numerics::statistics::HUBER_SIGMAS,
};

/// Numbers of a camera matrix.
pub(crate) const MATRIX: usize = INTRINSIC_NAMES.len();
/// Most numbers a camera's block has.
pub(crate) const MAX_CAMERA_NUMBERS: usize = MATRIX + MAX_LENS_PARAMETERS;
/// Numbers of a rig pose.
pub(crate) const RIG_POSE: usize = 6;
/// Numbers of an attitude group.
pub(crate) const GROUP: usize = 3;
/// Numbers of a frame: those of its pose, then the departures of its picture.
pub(crate) const FRAME: usize = FRAME_POSE + DEPARTURES;
/// Numbers of a frame's pose.
pub(crate) const FRAME_POSE: usize = 6;
/// Numbers by which the picture of a frame departs from those of the others.
pub(crate) const DEPARTURES: usize = 4;
/// Place of ln h among the numbers of a group.
pub(crate) const GROUP_HEIGHT: usize = 2;
/// Place of the heading among the numbers of a frame.
pub(crate) const FRAME_YAW: usize = 2;
/// Place of the height error among the numbers of a frame.
pub(crate) const FRAME_HEIGHT: usize = 5;

/// ln fx, ln fy/fx, cx, cy, skew in frame units.
pub(crate) type MatrixNumbers = SVector<f64, MATRIX>;

/// A Gaussian prior on a number: (mean, standard deviation).
pub(crate) type Prior = (f64, f64);

/// A camera: its matrix and its lens.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct CameraState {
    /// Camera matrix, in units of the camera's frame.
    pub matrix: MatrixNumbers,
    /// Lens.
    pub lens: Lens,
}

impl CameraState {
    /// From a camera matrix in pixels.
    pub(crate) fn new(intrinsics_px: &Intrinsics, lens: &Lens, frame: &Frame) -> Self {
        let k = frame.intrinsics_from_pixel(intrinsics_px);
        Self { matrix: MatrixNumbers::from([k.fx.ln(), (k.fy / k.fx).ln(), k.cx, k.cy, k.skew]), lens: *lens }
    }

    /// The camera matrix in frame units.
    pub(crate) fn intrinsics_in_frame(&self) -> Intrinsics {
        let p = &self.matrix;
        let fx = p[0].exp();
        Intrinsics { fx, fy: fx * p[1].exp(), cx: p[2], cy: p[3], skew: p[4] }
    }

    /// How many numbers the block has.
    pub(crate) fn count(&self) -> usize {
        MATRIX + self.lens.parameter_names().len()
    }

    /// The place of a parameter among the numbers of the block (that of fy has ln fy/fx); `None`: the lens has none of it.
    pub(crate) fn place(&self, parameter: Parameter) -> Option<usize> {
        let among = |names: &[&str]| names.iter().position(|n| *n == parameter.name());
        if parameter.is_of_lens() {
            among(self.lens.parameter_names()).map(|i| MATRIX + i)
        } else {
            among(&INTRINSIC_NAMES)
        }
    }

    /// The numbers of the block in their order.
    pub(crate) fn numbers(&self) -> DVector<f64> {
        DVector::from_iterator(self.count(), self.matrix.iter().copied().chain(self.lens.parameters()))
    }

    /// With numbers of the block moved by steps.
    pub(crate) fn moved(&self, steps: impl Iterator<Item = (usize, f64)>) -> Self {
        let (mut matrix, mut parameters) = (self.matrix, self.lens.parameters());
        for (number, by) in steps {
            match number.checked_sub(MATRIX) {
                None => matrix[number] += by,
                Some(of_lens) => parameters[of_lens] += by,
            }
        }
        Self { matrix, lens: self.lens.with_parameters(&parameters).unwrap_or(self.lens) }
    }
}

/// Where a camera sits in the rig: camera from the coordinates of the rig's first camera, lengths in the world's unit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct RigPose {
    /// Rotation.
    pub rotation: Matrix3<f64>,
    /// Translation.
    pub translation: Vector3<f64>,
}

impl RigPose {
    /// That of the first camera.
    pub(crate) fn identity() -> Self {
        Self { rotation: Matrix3::identity(), translation: Vector3::zeros() }
    }

    /// Turned about the camera's axes and shifted along them by a small step.
    pub(crate) fn moved(&self, step: &SVector<f64, RIG_POSE>) -> Self {
        let turn = Rotation3::from_scaled_axis(step.fixed_rows::<3>(0).into_owned());
        Self { rotation: turn * self.rotation, translation: self.translation + step.fixed_rows::<3>(3) }
    }
}

/// What a group of frames shares.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct GroupState {
    /// A: camera coordinates from level coordinates with the camera's heading.
    pub attitude: Matrix3<f64>,
    /// Logarithm of the height.
    pub ln_height: f64,
}

impl GroupState {
    /// The attitude turned by a small step about two level axes.
    pub(crate) fn turned(&self, step: [f64; 2]) -> Matrix3<f64> {
        self.attitude * rotation_x(step[0]) * rotation_y(step[1])
    }
}

/// In what a frame's picture departs from those of the others: a lens that was focused or zoomed again, a shutter that rolled while the
/// camera turned, a stabiliser. Nothing, unless it is estimated ([`BundleOptions::departures`]).
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Departure {
    /// Logarithm of its focal length over that of the camera.
    pub ln_focal: f64,
    /// Turn about the plane's normal from the picture's middle row until its last is read out, radians.
    pub row_turn_rad: f64,
    /// Shift of the picture, frame units.
    pub shift: Vector2<f64>,
}

impl State {
    /// The same with one turn while each picture is read out, from the middle row to the last.
    pub(crate) fn read_out_turning(mut self, turn_rad: f64) -> Self {
        self.frames.iter_mut().for_each(|frame| frame.departure.row_turn_rad = turn_rad);
        self
    }
}

impl Departure {
    /// The numbers in their order.
    pub(crate) fn numbers(&self) -> [f64; DEPARTURES] {
        [self.ln_focal, self.row_turn_rad, self.shift.x, self.shift.y]
    }

    /// From the numbers in their order.
    pub(crate) fn from_numbers([ln_focal, row_turn_rad, x, y]: [f64; DEPARTURES]) -> Self {
        Self { ln_focal, row_turn_rad, shift: Vector2::new(x, y) }
    }
}

/// Departures that have a deviation in common.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum DepartureKind {
    /// Focal lengths.
    Focal,
    /// Turns while pictures are read out.
    RowTurn,
    /// Shifts.
    Shift,
}

impl DepartureKind {
    /// All of them.
    pub(crate) const ALL: [Self; 3] = [Self::Focal, Self::RowTurn, Self::Shift];

    /// Their numbers among those of a frame.
    pub(crate) fn numbers(self) -> std::ops::Range<usize> {
        match self {
            Self::Focal => FRAME_POSE..FRAME_POSE + 1,
            Self::RowTurn => FRAME_POSE + 1..FRAME_POSE + 2,
            Self::Shift => FRAME_POSE + 2..FRAME_POSE + 4,
        }
    }
}

/// What a frame has of its own.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct FrameState {
    /// Its group.
    pub group: usize,
    /// Error of the attitude about level axes across and along the heading, radians.
    pub delta_rad: [f64; 2],
    /// Heading, radians.
    pub yaw_rad: f64,
    /// Optical centre over the floor.
    pub position: Vector2<f64>,
    /// Logarithm of its height over that of its group.
    pub ln_height_ratio: f64,
    /// Departures of its picture.
    pub departure: Departure,
}

pub(crate) fn rotation_x(a: f64) -> Matrix3<f64> {
    let (s, c) = a.sin_cos();
    Matrix3::new(1.0, 0.0, 0.0, 0.0, c, -s, 0.0, s, c)
}

pub(crate) fn rotation_y(a: f64) -> Matrix3<f64> {
    let (s, c) = a.sin_cos();
    Matrix3::new(c, 0.0, s, 0.0, 1.0, 0.0, -s, 0.0, c)
}

/// Everything that is estimated.
#[derive(Debug, Clone)]
pub(crate) struct State {
    /// Cameras.
    pub cameras: Vec<CameraState>,
    /// Where each camera sits in the rig; the first is the reference.
    pub rig: Vec<RigPose>,
    /// Attitude groups.
    pub groups: Vec<GroupState>,
    /// Frames.
    pub frames: Vec<FrameState>,
    /// A unit vector for each track.
    pub points: Vec<Vector3<f64>>,
}

impl State {
    /// Of one camera.
    pub(crate) fn of_one_camera(camera: CameraState, groups: Vec<GroupState>, frames: Vec<FrameState>) -> Self {
        Self { cameras: vec![camera], rig: vec![RigPose::identity()], groups, frames, points: Vec::new() }
    }

    /// The same with a group, and so a free attitude and height, for each frame: general motion before the plane.
    pub(crate) fn with_own_attitudes(mut self) -> Self {
        let of = |f: &FrameState| {
            let group = &self.groups[f.group];
            GroupState { attitude: group.turned(f.delta_rad), ln_height: group.ln_height + f.ln_height_ratio }
        };
        self.groups = self.frames.iter().map(of).collect();
        for (group, f) in self.frames.iter_mut().enumerate() {
            *f = FrameState { group, delta_rad: [0.0; 2], ln_height_ratio: 0.0, ..*f };
        }
        self
    }
}

/// What is estimated of a camera and its place in the rig, and what is known of it beforehand.
#[derive(Debug, Clone)]
pub(crate) struct CameraUnknowns {
    /// Frame of the camera's pixels: the unit of its numbers.
    pub frame: Frame,
    /// Half width and height of its images, frame units.
    pub image_half_sides: [f64; 2],
    /// Which of the matrix's numbers are estimated; the aspect ratio held means that fy follows fx.
    pub matrix_free: [bool; MATRIX],
    /// Their priors.
    pub matrix_priors: [Option<Prior>; MATRIX],
    /// Which of the lens's numbers are estimated; what is not named is held.
    pub lens_free: Vec<bool>,
    /// Their priors.
    pub lens_priors: Vec<Option<Prior>>,
    /// Numbers of the lens that are held unless the residuals ask for them, with the priors that they then have.
    pub lens_on_demand: Vec<(usize, Prior)>,
    /// Which of the numbers of its pose in the rig are estimated; none of the first camera's are.
    pub rig_free: [bool; RIG_POSE],
}

impl CameraUnknowns {
    /// Without skew, with two numbers of the lens, no priors, and a pose that is free.
    pub(crate) fn new(frame: Frame, image_half_sides: [f64; 2]) -> Self {
        Self {
            frame,
            image_half_sides,
            matrix_free: [true, true, true, true, false],
            matrix_priors: [None; MATRIX],
            lens_free: vec![true, true],
            lens_priors: Vec::new(),
            lens_on_demand: Vec::new(),
            rig_free: [true; RIG_POSE],
        }
    }

    /// Whether a number of the camera's block is estimated.
    pub(crate) fn is_free(&self, number: usize) -> bool {
        match number.checked_sub(MATRIX) {
            None => self.matrix_free[number],
            Some(of_lens) => self.lens_free.get(of_lens).copied().unwrap_or(false),
        }
    }

    /// Sets whether a number of the camera's block is estimated.
    pub(crate) fn set_free(&mut self, number: usize, free: bool) {
        match number.checked_sub(MATRIX) {
            None => self.matrix_free[number] = free,
            Some(of_lens) => {
                self.lens_free.resize(self.lens_free.len().max(of_lens + 1), false);
                self.lens_free[of_lens] = free;
            }
        }
    }

    /// Has a number of the lens estimated, with a prior or none.
    pub(crate) fn free_lens(&mut self, of_lens: usize, prior: Option<Prior>) {
        self.set_free(MATRIX + of_lens, true);
        self.lens_priors.resize(self.lens_priors.len().max(of_lens + 1), None);
        self.lens_priors[of_lens] = prior;
    }

    /// Holds the numbers of the lens from one on.
    pub(crate) fn hold_lens_from(&mut self, first: usize) {
        self.lens_free.truncate(first);
        self.lens_on_demand.clear();
    }

    /// The prior of a number of the camera's block.
    pub(crate) fn prior(&self, number: usize) -> Option<Prior> {
        match number.checked_sub(MATRIX) {
            None => self.matrix_priors[number],
            Some(of_lens) => self.lens_priors.get(of_lens).copied().flatten(),
        }
    }
}

/// Standard deviation, about each axis, of the attitude error of an outlier frame: a tripod leg that slipped, a head knocked, a
/// pair of another attitude.
pub(crate) const OUTLIER_ATTITUDE_SIGMA_RAD: f64 = 0.05;

/// Options of the joint refinement.
#[derive(Debug, Clone)]
pub(crate) struct BundleOptions {
    /// One a camera.
    pub cameras: Vec<CameraUnknowns>,
    /// σ_a in radians, about each of two axes; `None`: estimated where enough frames tell it, else its scale. Infinite: every frame
    /// has an attitude and a height of its own (`with_own_attitudes`).
    pub attitude_sigma_rad: Option<f64>,
    /// Scale of the half-Cauchy prior of σ_a, radians.
    pub attitude_scale_rad: f64,
    /// σ_h, relative; `None`: estimated.
    pub height_sigma: Option<f64>,
    /// Frames whose attitudes do not count among those that σ_a is of: outliers, whose errors have the standard deviation `OUTLIER_ATTITUDE_SIGMA_RAD`.
    pub outlier_frames: Vec<usize>,
    /// Somebody vouches that a camera taken to turn on the spot turns about its lens. Otherwise its covariance allows for a lens off the
    /// axis by what the residuals leave open (`LeverArm`).
    pub lens_on_axis: bool,
    /// Departures of the frames' pictures that are estimated, each with a deviation of its own.
    pub departures: Vec<DepartureKind>,
    /// Residuals beyond this many standard deviations count less.
    pub huber: f64,
    /// Most rounds of estimation of weights and variance components.
    pub rounds: usize,
    /// Whether the shape of the likelihood is looked at where the error bar of f is wide.
    pub profile: bool,
    /// The loop.
    pub lm: LmOptions,
}

impl BundleOptions {
    /// For a model that is only tried against another: neither the last digits nor the shape of the likelihood matter.
    pub(crate) fn for_trial(self) -> Self {
        let lm = LmOptions { max_iterations: 25, ..self.lm };
        Self { rounds: 3, profile: false, lm, ..self }
    }

    /// The same priors and freedoms with the pains of other options.
    pub(crate) fn with_thoroughness_of(self, other: &Self) -> Self {
        Self { rounds: other.rounds, profile: other.profile, lm: other.lm, ..self }
    }

    /// The usual ones for these cameras.
    pub(crate) fn new(cameras: Vec<CameraUnknowns>) -> Self {
        Self {
            cameras,
            attitude_sigma_rad: None,
            attitude_scale_rad: 0.1f64.to_radians(),
            height_sigma: None,
            outlier_frames: Vec::new(),
            lens_on_axis: false,
            departures: Vec::new(),
            huber: HUBER_SIGMAS,
            rounds: 10,
            profile: true,
            lm: LmOptions {
                descent: StepPolicy::Damped,
                max_iterations: 60,
                relative_cost_tolerance: 1e-7,
                step_tolerance: 1e-13,
            },
        }
    }
}
