//! What the joint refinement gives back.

use nalgebra::{DMatrix, SMatrix, Vector3};

use crate::{
    geometry::{frame::Frame, intrinsics::Intrinsics},
    numerics::levenberg_marquardt::StopReason,
    refine::{
        blocks::{CameraState, DepartureKind, MATRIX, RIG_POSE, RigPose, State},
        evidence::Evidence,
        residual::SceneModel,
        tracks::KINDS,
        variance_components::Component,
    },
};

/// The rig's first camera: its pose is the rig's.
pub(crate) const FIRST_CAMERA: usize = 0;

/// Covariance of the numbers of a camera's block and of others after them.
#[derive(Debug, Clone, PartialEq)]
pub struct JointCovariance {
    matrix: DMatrix<f64>,
    camera_numbers: usize,
}

impl JointCovariance {
    pub(crate) fn new(matrix: DMatrix<f64>, camera_numbers: usize) -> Self {
        Self { matrix, camera_numbers }
    }

    /// Of all.
    pub fn matrix(&self) -> &DMatrix<f64> {
        &self.matrix
    }

    /// Of the camera's numbers.
    pub fn camera(&self) -> DMatrix<f64> {
        let n = self.camera_numbers;
        self.matrix.view((0, 0), (n, n)).into_owned()
    }

    /// Of the others.
    pub fn rest(&self) -> DMatrix<f64> {
        let (n, all) = (self.camera_numbers, self.matrix.nrows());
        self.matrix.view((n, n), (all - n, all - n)).into_owned()
    }

    /// In the fixed order of results: the camera's [`CAMERA`] numbers, then the others.
    pub fn fixed<const N: usize>(&self) -> SMatrix<f64, N, N> {
        fixed(&self.matrix, self.camera_numbers)
    }
}

/// Numbers of a camera in results: fx, fy, cx, cy, skew, k1, k2. Those that a lens does not have are zero, those beyond are left out.
pub const CAMERA: usize = 7;
/// Numbers of a view's covariance in results: the camera's, then pitch (down), roll, yaw, x, y, height.
pub const VIEW_NUMBERS: usize = CAMERA + 6;
/// Numbers of a group's covariance in results: the camera's, then pitch (down), roll, height.
pub const GROUP_NUMBERS: usize = CAMERA + 3;

fn fixed<const N: usize>(matrix: &DMatrix<f64>, camera_numbers: usize) -> SMatrix<f64, N, N> {
    let place = |i: usize| {
        if i < CAMERA {
            (i < camera_numbers).then_some(i)
        } else {
            Some(i - CAMERA + camera_numbers).filter(|p| *p < matrix.nrows())
        }
    };
    SMatrix::from_fn(|r, c| match (place(r), place(c)) {
        (Some(r), Some(c)) => matrix[(r, c)],
        _ => 0.0,
    })
}

/// Derivatives of a camera's [`CAMERA`] numbers in results by those of its block (frame units).
pub fn pixels_by_camera(k_px: &Intrinsics, frame: &Frame) -> SMatrix<f64, CAMERA, CAMERA> {
    let mut jacobian = SMatrix::<f64, CAMERA, CAMERA>::identity();
    jacobian.fixed_view_mut::<MATRIX, MATRIX>(0, 0).copy_from(&frame.pixels_by_logarithms(k_px));
    jacobian
}

/// A camera's result.
#[derive(Debug, Clone, PartialEq)]
pub struct CameraEstimate {
    /// Its numbers.
    pub state: CameraState,
    /// Their covariance, units of its frame; zero rows for what was held.
    pub covariance: DMatrix<f64>,
}

impl CameraEstimate {
    /// The covariance in the fixed order of results.
    pub fn fixed_covariance(&self) -> SMatrix<f64, CAMERA, CAMERA> {
        fixed(&self.covariance, self.covariance.nrows())
    }
}

/// A camera's place in the rig.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RigEstimate {
    /// Camera from the first camera's coordinates, lengths in the world's unit.
    pub pose: RigPose,
    /// Covariance of a small turn about the camera's axes and of the translation; zero for what was held.
    pub covariance: SMatrix<f64, RIG_POSE, RIG_POSE>,
}

/// An attitude group's result.
#[derive(Debug, Clone, PartialEq)]
pub struct GroupEstimate {
    /// Pitch (down) and roll, radians.
    pub pitch_roll_rad: [f64; 2],
    /// Height over the floor, in the world of its views (directions: 1).
    pub height: f64,
    /// Covariance of the camera's numbers (frame units), pitch, roll (radians) and height; zero for what was held.
    pub covariance: JointCovariance,
    /// First frame of the connected set its frames belong to.
    pub origin: usize,
    /// The floor's upward normal in camera coordinates.
    pub up: Vector3<f64>,
}

/// A frame's result as the rig's first camera has it, in a world whose origin is the floor below the first frame connected to it,
/// +X along that frame's heading, unit its height.
#[derive(Debug, Clone, PartialEq)]
pub struct ViewEstimate {
    /// First frame of the connected set; its own index for that frame.
    pub origin: usize,
    /// Heading, anticlockwise from above, radians.
    pub yaw_rad: f64,
    /// Its standard deviation; 0 for an origin.
    pub yaw_sigma_rad: f64,
    /// Pitch (down) and roll of this view, radians.
    pub pitch_roll_rad: [f64; 2],
    /// How far its attitude strays from its group's about two level axes, radians.
    pub delta_rad: [f64; 2],
    /// Optical centre: x, y, height (directions: zero, zero, one).
    pub centre: Vector3<f64>,
    /// Standard deviations of the three.
    pub centre_sigma: Vector3<f64>,
    /// Covariance of the camera's numbers (frame units), pitch, roll, yaw (radians), x, y and height; zero for what was held.
    pub covariance: JointCovariance,
    /// Root mean square of the weighted residuals of its observations (1: as expected).
    pub weighted_rms: f64,
    /// Observations.
    pub observations: usize,
}

/// The refined state and how sure it is.
#[derive(Debug, Clone)]
pub struct Bundle {
    /// Floor or directions.
    pub scene: SceneModel,
    /// Everything estimated.
    pub state: State,
    /// One a camera.
    pub cameras: Vec<CameraEstimate>,
    /// Where each camera sits in the rig.
    pub rig: Vec<RigEstimate>,
    /// One a group.
    pub groups: Vec<GroupEstimate>,
    /// One a frame; `None` for frames without tracks.
    pub views: Vec<Option<ViewEstimate>>,
    /// Deviation of the frames' attitudes, radians.
    pub attitude_sigma: Component,
    /// Relative deviation of the frames' heights.
    pub height_sigma: Component,
    /// Deviation of each kind of departure of the frames' pictures (relative f, radians, frame units); zero where it is not estimated.
    pub departure_sigmas: [Component; DepartureKind::ALL.len()],
    /// Weighted squared residuals over their degrees of freedom, before the weights were scaled by it, for each
    /// [`crate::refine::Kind`]; 1 where there are none.
    pub variance_factors: [f64; KINDS],
    /// How much more the residuals of neighbours have in common than independent ones would, for each kind; the covariances
    /// allow for it.
    pub design_effects: [f64; KINDS],
    /// Observations (of two coordinates), tracks, columns.
    pub counts: [usize; 3],
    /// Observations of each kind.
    pub observations_of: [usize; KINDS],
    /// Degrees of freedom of the residuals.
    pub degrees_of_freedom: f64,
    /// How well the frames' attitudes agree with σ_a: chi-squared of their deviations and its degrees of freedom.
    pub agreement: (f64, usize),
    /// How well the model explains the tracks; `None` where that cannot be told.
    pub evidence: Option<Evidence>,
    /// By how much the covariances are wider than the inverse information.
    pub widened: f64,
    /// Half the weighted squared residuals, losses and priors included.
    pub cost: f64,
    /// Weighted squared residual of each observation of each track.
    pub squared_residuals: Vec<Vec<f64>>,
    /// Steps tried, over all rounds.
    pub iterations: usize,
    /// By how much a further step would still lower the cost: 0.5 is one standard deviation in one direction.
    pub left_to_gain: f64,
    /// Why the last loop ended.
    pub stop: StopReason,
}
