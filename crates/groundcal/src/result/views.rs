//! Attitudes of the camera, and views of the joint refinement.

use serde::{Deserialize, Serialize};

use crate::{geometry::parameters::Parameter, result::covariance::Covariance};

/// A number of a view: of its camera, or of where the camera was.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ViewParameter {
    /// Angle of the optical axis below the horizontal, radians.
    PitchDownRad,
    /// Roll, radians.
    RollRad,
    /// Heading, radians.
    YawRad,
    /// Optical centre, x.
    X,
    /// Optical centre, y.
    Y,
    /// Optical centre, height.
    Height,
    /// A number of the camera; these come first in lists.
    #[serde(untagged)]
    Camera(Parameter),
}

impl ViewParameter {
    /// Those of the view itself.
    pub(crate) const OF_POSE: [ViewParameter; 6] = [
        ViewParameter::PitchDownRad,
        ViewParameter::RollRad,
        ViewParameter::YawRad,
        ViewParameter::X,
        ViewParameter::Y,
        ViewParameter::Height,
    ];

    /// How many there are.
    pub(crate) const COUNT: usize = Parameter::ALL.len() + Self::OF_POSE.len();

    /// All, in the order of every list of them: those of the camera, then those of the view.
    pub(crate) const ALL: [ViewParameter; Self::COUNT] = {
        let mut all = [ViewParameter::Height; Self::COUNT];
        let mut i = 0;
        while i < Self::COUNT {
            all[i] = if i < Parameter::ALL.len() {
                ViewParameter::Camera(Parameter::ALL[i])
            } else {
                Self::OF_POSE[i - Parameter::ALL.len()]
            };
            i += 1;
        }
        all
    };

    /// Whether it is a length over the floor.
    pub(crate) fn is_length(self) -> bool {
        matches!(self, ViewParameter::X | ViewParameter::Y | ViewParameter::Height)
    }
}

/// The camera's attitude to the floor.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct AttitudeReport {
    /// Angle of the optical axis below the horizontal, in degrees (90: straight down).
    pub pitch_down_deg: f64,
    /// Its standard deviation; `None` for the linear method.
    pub pitch_down_sigma_deg: Option<f64>,
    /// Roll about the optical axis, in degrees (0: the horizon is level).
    pub roll_deg: f64,
    /// Its standard deviation; `None` for the linear method.
    pub roll_sigma_deg: Option<f64>,
    /// Height of the optical centre over the floor that its views have in common, in the world of `origin`; `None` without a floor
    /// or for the linear method.
    pub height: Option<f64>,
    /// Its standard deviation.
    pub height_sigma: Option<f64>,
    /// Name of the image that is the origin of that world.
    pub origin: Option<String>,
    /// The horizon in the undistorted image: a x + b y + c = 0 in pixels, a² + b² = 1 (`None`: at infinity).
    pub horizon_px: Option<[f64; 3]>,
    /// Standard deviation of its direction, in degrees; `None` for the linear method.
    pub horizon_sigma_deg: Option<f64>,
    /// Standard deviation of its distance from the image's centre, in pixels; `None` for the linear method.
    pub horizon_sigma_px: Option<f64>,
    /// Motions that show it: indices into `motions`.
    #[serde(default)]
    pub motions: Vec<usize>,
}

/// A view of the joint refinement, in a world whose origin is the floor below the optical centre of the first view that common
/// points connect it to, Z up, +X along that view's heading, the height of that optical centre being the unit of length (or
/// [`crate::result::Calibration::camera_height_m`] metres).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct ViewReport {
    /// Name of the image.
    pub image: String,
    /// Index of its attitude; `None` where there is no floor.
    pub attitude: Option<usize>,
    /// Name of the image that is the origin of its world.
    pub origin: String,
    /// Heading, anticlockwise seen from above, in degrees.
    pub yaw_deg: f64,
    /// Its standard deviation in degrees; 0 for an origin.
    #[serde(default)]
    pub yaw_sigma_deg: f64,
    /// Angle of this view's optical axis below the horizontal, in degrees.
    pub pitch_down_deg: f64,
    /// Its standard deviation in degrees.
    #[serde(default)]
    pub pitch_down_sigma_deg: f64,
    /// This view's roll, in degrees.
    pub roll_deg: f64,
    /// Its standard deviation in degrees.
    #[serde(default)]
    pub roll_sigma_deg: f64,
    /// Optical centre: x, y, height (`None` for directions: nothing shows where the camera was).
    pub position: Option<[f64; 3]>,
    /// Standard deviations of the three.
    pub position_sigma: Option<[f64; 3]>,
    /// Points of the floor from undistorted pixels (`None` for directions).
    pub floor_from_image: Option<FloorHomography>,
    /// Points seen in it.
    #[serde(default)]
    pub observations: usize,
    /// Root mean square of its weighted residuals: 1 as expected, more where something does not fit.
    #[serde(default)]
    pub weighted_rms: f64,
    /// Covariance of the camera, of this view's attitude and heading, and of its place (in the unit of `position`).
    #[serde(default)]
    pub covariance: Covariance<ViewParameter>,
}

/// The homography (X, Y, 1)ᵀ ~ H (x, y, 1)ᵀ from pixels of the image without its lens distortion to points of the floor. The third
/// coordinate is positive below the horizon; the third row is the horizon.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct FloorHomography {
    /// H, in units of length of the world and pixels.
    pub matrix: [[f64; 3]; 3],
    /// Covariance of its nine numbers, row by row (the uncertainty of what the lens does to the pixels themselves is not in it).
    pub covariance: [[f64; 9]; 9],
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_camera_and_view_stand_in_one_list() {
        let text = serde_json::to_string(&ViewParameter::ALL).unwrap();
        let names = "fx fy cx cy skew k1 k2 p1 p2 k3 pitch_down_rad roll_rad yaw_rad x y height";
        assert_eq!(text, format!("[{}]", names.split(' ').map(|n| format!("{n:?}")).collect::<Vec<_>>().join(",")));
        assert_eq!(serde_json::from_str::<Vec<ViewParameter>>(&text).unwrap(), ViewParameter::ALL);
    }
}
