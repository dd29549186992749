//! Pairs of images: what was seen in them, and how those used fit together.

use serde::{Deserialize, Serialize};

use crate::remedy::{Remedy, Wording, sentence};

/// A pair of images.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct MotionReport {
    /// Name of the first image.
    pub from: String,
    /// Name of the second image.
    pub to: String,
    /// Whether it takes part in the camera as a motion.
    pub used: bool,
    /// Whether its matches take part because both images, of different attitudes, see the same floor.
    #[serde(default, alias = "tie")]
    pub cross_attitude_link: bool,
    /// Turn of the camera from the first to the second image, counter-clockwise seen from above, in degrees; unsigned for
    /// a motion not used; `None` without a homography.
    pub rotation_deg: Option<f64>,
    /// Its standard deviation in degrees.
    pub rotation_sigma_deg: Option<f64>,
    /// Height ratio: 1 for a motion at constant height above the floor.
    #[serde(alias = "rho")]
    pub height_ratio: Option<f64>,
    /// Its standard deviation.
    #[serde(alias = "rho_sigma")]
    pub height_ratio_sigma: Option<f64>,
    /// Matches that agree on one plane.
    #[serde(default)]
    pub matches: usize,
    /// Matches tried.
    #[serde(default)]
    pub candidate_matches: usize,
    /// Root mean square residual of the plane's matches, both images together, in pixels.
    pub rms_px: Option<f64>,
    /// Index of its attitude.
    pub attitude: Option<usize>,
    /// Why it is not used.
    pub reason: Option<String>,
    /// How it fits the others; `None` where it takes no part.
    pub diagnosis: Option<MotionDiagnosis>,
}

/// How a motion that takes part fits the others (`diagnosis`).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct MotionDiagnosis {
    /// Root mean square residual of its points from the camera of all motions, both images together, in pixels: much more than
    /// [`MotionReport::rms_px`] where the motion does not fit the others. `None`: not refined jointly.
    pub joint_rms_px: Option<f64>,
    /// How far the attitudes of its two views are apart, in degrees: 0 for a turn about the floor's normal. `None`: not refined jointly.
    pub apart_deg: Option<f64>,
    /// What follows from that.
    pub verdict: MotionVerdict,
}

/// What is wrong with a motion, if anything is.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(tag = "code", rename_all = "snake_case")]
#[non_exhaustive]
pub enum MotionVerdict {
    /// Nothing to judge it by: it was not refined jointly.
    NotJudged,
    /// It agrees with the others.
    Fits,
    /// Its two views tilt against each other more than those of the other motions do.
    Tilts {
        /// How far their attitudes are apart, degrees.
        apart_deg: f64,
        /// How far those of the other motions are, degrees.
        usual_deg: f64,
    },
    /// It fits the camera of all motions far worse than its own homography.
    OffCamera {
        /// Residual from the camera of all motions, pixels.
        joint_rms_px: f64,
        /// Residual from a homography of its own, pixels.
        own_rms_px: f64,
    },
}

impl MotionVerdict {
    /// What was found, in words; `None`: nothing wrong.
    pub(crate) fn finding(&self) -> Option<String> {
        match self {
            MotionVerdict::NotJudged | MotionVerdict::Fits => None,
            MotionVerdict::Tilts { apart_deg, usual_deg } => Some(format!(
                "the attitudes of its two views are {apart_deg:.2} degrees apart, those of the other motions {usual_deg:.2}: the camera \
                 tilted between the two images, or they show different planes"
            )),
            MotionVerdict::OffCamera { joint_rms_px, own_rms_px } => Some(format!(
                "its points are {joint_rms_px:.2} px off the camera of all motions, but {own_rms_px:.2} px off a homography of their own: \
                 a motion is wrong (this one or another), or the lens model is too simple"
            )),
        }
    }

    /// What to do about it.
    pub(crate) fn remedies(&self) -> Vec<Remedy> {
        match self {
            MotionVerdict::NotJudged | MotionVerdict::Fits | MotionVerdict::OffCamera { .. } => Vec::new(),
            MotionVerdict::Tilts { .. } => vec![Remedy::LeavePairOut, Remedy::RetakeMotion],
        }
    }

    /// Finding and remedies as a front end words them; `None`: nothing wrong.
    pub fn message(&self, wording: &dyn Wording) -> Option<String> {
        self.finding().map(|finding| sentence(&finding, &self.remedies(), wording))
    }
}
