//! What the joint refinement gives back.

use nalgebra::{DMatrix, SMatrix, Vector3};

use crate::{
    geometry::{frame::Frame, intrinsics::Intrinsics},
    numerics::levenberg_marquardt::StopReason,
    refine::{
        blocks::{CameraState, CameraUnknowns, DepartureKind, MATRIX, RIG_POSE, RigPose, State},
        evidence::Evidence,
        lever::LeverArm,
        problem::Problem,
        residual::SceneModel,
        tracks::KINDS,
        variance_components::Component,
    },
};

/// The rig's first camera: its pose is the rig's.
pub(crate) const FIRST_CAMERA: usize = 0;

/// Covariance of the numbers of a camera's block and of others after them.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct JointCovariance {
    matrix: DMatrix<f64>,
    camera_numbers: usize,
}

impl JointCovariance {
    pub(crate) fn new(matrix: DMatrix<f64>, camera_numbers: usize) -> Self {
        Self { matrix, camera_numbers }
    }

    /// Of all.
    pub(crate) fn matrix(&self) -> &DMatrix<f64> {
        &self.matrix
    }

    /// To add to it what else is not known.
    pub(crate) fn matrix_mut(&mut self) -> &mut DMatrix<f64> {
        &mut self.matrix
    }

    /// How many of the first are the camera's.
    pub(crate) fn camera_numbers(&self) -> usize {
        self.camera_numbers
    }

    /// Of the others.
    pub(crate) fn without_camera(&self) -> DMatrix<f64> {
        let (n, all) = (self.camera_numbers, self.matrix.nrows());
        self.matrix.view((n, n), (all - n, all - n)).into_owned()
    }

    /// With the camera's numbers in pixels, given their derivatives by those of its block ([`pixels_by_camera`]).
    pub(crate) fn in_pixels(&self, by_camera: &DMatrix<f64>) -> Self {
        let mut jacobian = DMatrix::identity(self.matrix.nrows(), self.matrix.nrows());
        jacobian.view_mut((0, 0), by_camera.shape()).copy_from(by_camera);
        Self { matrix: &jacobian * &self.matrix * jacobian.transpose(), camera_numbers: self.camera_numbers }
    }
}

/// Derivatives of a camera's numbers in pixels (fx, fy, cx, cy, skew, then those of its lens) by those of its block, however many.
pub(crate) fn pixels_by_camera(k_px: &Intrinsics, frame: &Frame, numbers: usize) -> DMatrix<f64> {
    let mut jacobian = DMatrix::identity(numbers, numbers);
    jacobian.view_mut((0, 0), (MATRIX, MATRIX)).copy_from(&frame.pixels_by_logarithms(k_px));
    jacobian
}

/// A camera's result.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct CameraEstimate {
    /// Its numbers.
    pub state: CameraState,
    /// Their covariance, units of its frame; zero rows for what was held.
    pub covariance: DMatrix<f64>,
}

/// A camera's place in the rig.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct RigEstimate {
    /// Camera from the first camera's coordinates, lengths in the world's unit.
    pub pose: RigPose,
    /// Covariance of a small turn about the camera's axes and of the translation; zero for what was held.
    pub covariance: SMatrix<f64, RIG_POSE, RIG_POSE>,
}

/// An attitude group's result.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct GroupEstimate {
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
pub(crate) struct ViewEstimate {
    /// First frame of the connected set; its own index for that frame.
    pub origin: usize,
    /// Heading, anticlockwise from above, radians.
    pub yaw_rad: f64,
    /// Its standard deviation; 0 for an origin.
    pub yaw_sigma_rad: f64,
    /// Pitch (down) and roll of this view, radians.
    pub pitch_roll_rad: [f64; 2],
    /// Its attitude error against its group's about two level axes, radians.
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
pub(crate) struct Bundle {
    /// Floor or directions.
    pub scene: SceneModel,
    /// Everything estimated.
    pub state: State,
    /// One a camera.
    pub cameras: Vec<CameraEstimate>,
    /// What was estimated of each in the end, with its priors.
    pub unknowns: Vec<CameraUnknowns>,
    /// Where each camera sits in the rig.
    #[cfg_attr(not(test), expect(dead_code, reason = "no calibration has a second camera yet"))]
    pub rig: Vec<RigEstimate>,
    /// One a group.
    pub groups: Vec<GroupEstimate>,
    /// One a frame; `None` for frames without tracks.
    pub views: Vec<Option<ViewEstimate>>,
    /// Frames whose attitude errors are outliers, which its σ_a is not of.
    pub outlier_frames: Vec<usize>,
    /// Standard deviation of the frames' attitudes, radians.
    pub attitude_sigma: Component,
    /// Relative standard deviation of the frames' heights.
    pub height_sigma: Component,
    /// Standard deviation of each kind of departure of the frames' pictures (relative f, radians, frame units); zero where it is not estimated.
    pub departure_sigmas: [Component; DepartureKind::ALL.len()],
    /// Parallax that a camera taken to turn on the spot shows, which the covariance of the first camera allows for; `None`: none.
    pub lever_arm: Option<LeverArm>,
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
    /// How well the frames' attitudes agree with σ_a: chi-squared of their errors and its degrees of freedom.
    pub agreement: (f64, usize),
    /// The same under the largest σ_a with which motions are about the plane's normal.
    pub agreement_at_most: (f64, usize),
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
    pub remaining_gain: f64,
    /// Why the last loop ended.
    pub stop: StopReason,
    /// What was minimised last.
    pub(crate) problem: Problem,
}

impl Bundle {
    /// Adds to the covariance of the first camera, and with it to that of groups and views, what else is not known of its numbers.
    pub(crate) fn allow(&mut self, added: &DMatrix<f64>) {
        let of_camera = self.cameras.iter_mut().take(1).map(|camera| &mut camera.covariance);
        let of_groups = self.groups.iter_mut().map(|group| group.covariance.matrix_mut());
        let of_views = self.views.iter_mut().flatten().map(|view| view.covariance.matrix_mut());
        for covariance in of_camera.chain(of_groups).chain(of_views) {
            let mut block = covariance.view_mut((0, 0), added.shape());
            block += added;
        }
    }
}
