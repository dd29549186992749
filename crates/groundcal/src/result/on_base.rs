//! Where the camera sits on a robot ([`crate::floor::odometry`] finds it).

use serde::{Deserialize, Serialize};

/// The camera on a robot's base, of the views of one attitude: x forward, y to the left, z up, origin where the odometry has it, on the floor.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct CameraOnBase {
    /// Index of the attitude.
    pub attitude: usize,
    /// Name of the image that is the origin of the views' world.
    pub origin: String,
    /// Motions that told it.
    pub motions: usize,
    /// Metres of a unit of that world before: the height of its origin's optical centre, or 1 where lengths were metres already.
    pub metres_per_unit: f64,
    /// Its standard deviation.
    pub metres_per_unit_sigma: f64,
    /// x and y of the optical centre in metres; `None`: the base hardly turned, which does not show it.
    pub position_m: Option<[f64; 2]>,
    /// Their standard deviations.
    pub position_sigma_m: Option<[f64; 2]>,
    /// Height of the optical centre over the floor in metres.
    pub height_m: f64,
    /// Its standard deviation.
    pub height_sigma_m: f64,
    /// Heading of the camera from the base's x, anticlockwise seen from above, degrees.
    pub yaw_deg: f64,
    /// Its standard deviation.
    pub yaw_sigma_deg: f64,
    /// Optical axis below the horizontal, degrees.
    pub pitch_down_deg: f64,
    /// Roll, degrees.
    pub roll_deg: f64,
    /// How far the odometry errs, over the way driven: one standard deviation.
    pub relative_noise: f64,
}
