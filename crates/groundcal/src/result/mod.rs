//! The result of a calibration: one value, written and read, from which every renderer works.
//!
//! Pixels throughout, (0, 0) being the centre of the top-left pixel; angles in degrees where the name says so. The JSON form is
//! documented in `docs/formats.md`; it is that of the derived [`serde::Serialize`] and [`serde::Deserialize`] of [`Calibration`].
//!
//! | file | what |
//! |---|---|
//! | [`calibration`] | the value itself; what is asked of it by name |
//! | [`camera`] | camera matrix, lens, method, scene, priors |
//! | [`covariance`] | covariances and deviations with the names of their rows |
//! | [`fit`] | how well it all agrees |
//! | [`views`] | attitudes and views |
//! | [`motions`] | pairs of images and what became of them |
//! | [`diagnosis`] | which motions do not fit the others |
//! | [`warning`] | doubt, as values |
//! | [`verdict`], [`judge`] | whether to trust it |
//! | [`evidence`] | what it was made from, point by point |

pub mod calibration;
pub mod camera;
pub mod covariance;
pub mod diagnosis;
pub mod evidence;
pub mod fit;
pub mod judge;
pub mod motions;
pub mod on_base;
pub mod projection;
pub mod verdict;
pub mod views;
pub mod warning;

pub use crate::geometry::parameters::{Parameter, PriorParameter};
pub use calibration::{Calibration, PixelCentre};
pub use camera::{Camera, DistortionReport, LensSource, Method, MotionKind, Prior, PriorConflict, Scene};
pub use covariance::{Covariance, StandardDeviation};
pub use fit::{Fit, Refinement, ResidualReport};
pub use motions::{MotionDiagnosis, MotionReport, MotionVerdict};
pub use on_base::CameraOnBase;
pub use projection::ProjectionUncertainty;
pub use verdict::{Verdict, VerdictLevel, VerdictReason};
pub use views::{AttitudeReport, FloorHomography, ViewParameter, ViewReport};
pub use warning::{PictureDeparture, PrincipalPointDoubt, Warning, WarningReport};
