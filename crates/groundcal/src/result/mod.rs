//! The result of a calibration: one value, written and read, from which every renderer works.
//!
//! Pixels throughout, (0, 0) being the centre of the top-left pixel; angles in degrees where the name says so. The JSON form is
//! documented in `docs/formats.md`; it is that of the derived [`serde::Serialize`] and [`serde::Deserialize`] of [`Calibration`].
//!
//! | file | what |
//! |---|---|
//! | `calibration` | the value itself; what is asked of it by name |
//! | `camera` | camera matrix, lens, method, scene, priors |
//! | `covariance` | covariances and deviations with the names of their rows |
//! | `fit` | how well it all agrees |
//! | `views` | attitudes and views |
//! | `motions` | pairs of images and what became of them |
//! | `diagnosis` | which motions do not fit the others |
//! | `warning` | doubt, as values |
//! | `verdict`, `judge` | whether to trust it |
//! | `evidence` | what it was made from, point by point |

pub(crate) mod calibration;
pub(crate) mod camera;
pub(crate) mod covariance;
pub(crate) mod diagnosis;
pub(crate) mod evidence;
pub(crate) mod fit;
pub(crate) mod judge;
pub(crate) mod motions;
pub(crate) mod on_base;
pub(crate) mod projection;
pub(crate) mod verdict;
pub(crate) mod views;
pub(crate) mod warning;

pub use calibration::{FORMAT_VERSION, SCHEMA_VERSION};
pub use evidence::{Evidence, MatchEvidence, ObservationEvidence, PairEvidence};
pub use judge::{level_with, verdict_on_refusal};

pub use crate::geometry::parameters::Parameter;
pub use crate::geometry::parameters::PriorParameter;
pub use calibration::Calibration;
pub use calibration::PixelCentre;
pub use camera::Camera;
pub use camera::DistortionReport;
pub use camera::LensSource;
pub use camera::Method;
pub use camera::MotionKind;
pub use camera::Prior;
pub use camera::PriorConflict;
pub use camera::Scene;
pub use covariance::Covariance;
pub use covariance::StandardDeviation;
pub use fit::Fit;
pub use fit::Refinement;
pub use fit::ResidualReport;
pub use motions::MotionDiagnosis;
pub use motions::MotionReport;
pub use motions::MotionVerdict;
pub use on_base::CameraOnBase;
pub use projection::ProjectionUncertainty;
pub use verdict::Verdict;
pub use verdict::VerdictLevel;
pub use verdict::VerdictReason;
pub use views::AttitudeReport;
pub use views::FloorHomography;
pub use views::ViewParameter;
pub use views::ViewReport;
pub use warning::PictureDeparture;
pub use warning::PrincipalPointDoubt;
pub use warning::Warning;
pub use warning::WarningReport;
