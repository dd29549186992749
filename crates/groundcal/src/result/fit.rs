//! How well everything agrees.

use serde::{Deserialize, Serialize};

/// Agreement of the motions.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Fit {
    /// Sum of squared normalised residuals of the conic equations.
    pub chi_squared: f64,
    /// Its degrees of freedom.
    pub degrees_of_freedom: usize,
    /// Factor on all variances because the motions disagree (1: none).
    pub variance_inflation: f64,
    /// Factor on all standard deviations because the given distortion acts through the focal length (1: none given).
    pub distortion_amplification: f64,
    /// The joint refinement; `None` for the linear method.
    pub refinement: Option<Refinement>,
}

/// Of nothing: no equation is left over.
impl Default for Fit {
    fn default() -> Self {
        Self {
            chi_squared: 0.0,
            degrees_of_freedom: 0,
            variance_inflation: 1.0,
            distortion_amplification: 1.0,
            refinement: None,
        }
    }
}

/// How the residuals of one kind of measurement are.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct ResidualReport {
    /// Points seen in images.
    pub observations: usize,
    /// Weighted squared residuals over their degrees of freedom, weights being those that single homographies gave: 1 says that
    /// the model explains the matches as well as a homography a pair does. The weights were scaled by it.
    pub variance_factor: f64,
    /// How much more the residuals of neighbouring points have in common than independent ones would (1: nothing): a lens or a
    /// floor not quite as the model says, matching errors that depend on the perspective. The variances are larger by it.
    pub design_effect: f64,
}

/// How the joint refinement went.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Refinement {
    /// Points seen in images, each with two coordinates.
    pub observations: usize,
    /// Points.
    pub tracks: usize,
    /// Root mean square distance, in pixels, of the points as measured from where the camera shows them, over all observations, those that
    /// count less among them; the places of the points are estimated too. What other programs call the reprojection error. `None`: a file of
    /// an earlier version.
    #[serde(default)]
    pub reprojection_rms_px: Option<f64>,
    /// Degrees of freedom of the residuals.
    pub degrees_of_freedom: f64,
    /// Patches matched by least squares, where there are any.
    pub patches: Option<ResidualReport>,
    /// Features, or points from elsewhere.
    pub points: Option<ResidualReport>,
    /// Pairs of images of different attitudes that take part because both see the same floor.
    #[serde(alias = "ties")]
    pub cross_attitude_links: usize,
    /// Levenberg-Marquardt steps.
    pub iterations: usize,
    /// Whether the last loop ended by itself.
    pub converged: bool,
}
