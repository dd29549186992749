//! The camera of a calibration, and how it was found.

use serde::{Deserialize, Serialize};

use crate::geometry::{
    camera,
    intrinsics::Intrinsics,
    lens::Lens,
    parameters::{Parameter, PriorParameter},
    size::ImageSize,
};

/// How the camera is estimated from the motions.
///
/// # Examples
/// ```
/// use groundcal::{Method, Options};
/// // The closed form alone, to compare with.
/// let options = Options { method: Method::Linear, ..Options::default() };
/// assert_eq!(Method::default(), Method::Joint);
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Method {
    /// The closed form of Knight, Zisserman & Reid (2003), weighted by the covariances of the circular points and polished to their
    /// maximum likelihood, each motion by itself; the lens estimated before, the floor matched again patch by patch.
    Linear,
    /// The same as published, for comparison: homographies, their eigenvectors, eᵀ ω e = 0 of every motion with weight one, Cholesky. No
    /// weights, no lens, no patches, nothing polished; the constraint `auto` stands for `zero-skew`.
    Kzr,
    /// One motion transferred, linearly: its circular point carried into other views by homographies of the same plane, however these turned
    /// (section 2.3 there). The joint refinement uses such views, too.
    Transferred,
    /// Joint refinement of camera, lens, attitudes, views and points, from there.
    #[default]
    Joint,
    /// All homographies taken for rotations about the optical centre (`rotating_camera`; Hartley 1994): a pan-tilt camera
    /// on the spot. No floor is needed, no axis is assumed; the constraint `auto` stands for `zero-skew`.
    Rotating,
}

impl Method {
    /// The name used on the command line and in files.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Method::Linear => "linear",
            Method::Kzr => "kzr",
            Method::Transferred => "transferred",
            Method::Joint => "joint",
            Method::Rotating => "rotating",
        }
    }
}

/// What the points were taken for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Scene {
    /// Points of a floor.
    Floor,
    /// Points too far away to show where the camera was: a camera that turns on the spot.
    Directions,
}

/// What the camera did between the pictures used.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum MotionKind {
    /// It turned about the normal of a plane, and may have moved.
    PlaneNormal,
    /// It turned on the spot, about any axes.
    Turning,
    /// It moved in any way before one plane: every view has an attitude and a height of its own.
    General,
}

/// Where the lens's coefficients come from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub enum LensSource {
    /// Nowhere: the lens was taken to have no distortion.
    #[serde(rename = "not modelled")]
    NotModelled,
    /// They were given.
    #[default]
    #[serde(rename = "given")]
    Given,
    /// From the images (the model is then `none` where the coefficients are not told from zero).
    #[serde(rename = "estimated")]
    Estimated,
}

/// The name used in files and reports.
impl std::fmt::Display for LensSource {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.pad(match self {
            LensSource::NotModelled => "not modelled",
            LensSource::Given => "given",
            LensSource::Estimated => "estimated",
        })
    }
}

/// Camera parameters in pixels.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Camera {
    /// Width and height in pixels.
    pub image_size: [usize; 2],
    /// Focal length along x.
    pub fx: f64,
    /// Focal length along y.
    pub fy: f64,
    /// Principal point, x.
    pub cx: f64,
    /// Principal point, y.
    pub cy: f64,
    /// Skew.
    #[serde(default)]
    pub skew: f64,
    /// Lens distortion.
    #[serde(default)]
    pub distortion: DistortionReport,
}

impl Camera {
    /// A camera of images of this size.
    pub fn new(size: ImageSize, k: &Intrinsics, lens: impl Into<Lens>, source: LensSource) -> Self {
        // Coefficients that are all zero are no lens, as the file says it.
        let lens = Some(lens.into()).filter(|lens| !lens.is_none()).unwrap_or(Lens::None);
        Self {
            image_size: [size.width, size.height],
            fx: k.fx,
            fy: k.fy,
            cx: k.cx,
            cy: k.cy,
            skew: k.skew,
            distortion: DistortionReport { lens, source },
        }
    }

    /// The camera matrix.
    pub(crate) fn intrinsics(&self) -> Intrinsics {
        Intrinsics { fx: self.fx, fy: self.fy, cx: self.cx, cy: self.cy, skew: self.skew }
    }

    /// The lens.
    pub(crate) fn lens(&self) -> Lens {
        self.distortion.lens
    }

    /// Size, camera matrix and lens.
    pub fn model(&self) -> camera::Camera {
        camera::Camera { size: self.size(), intrinsics: self.intrinsics(), lens: self.lens() }
    }

    /// Width and height.
    pub(crate) fn size(&self) -> ImageSize {
        ImageSize::new(self.image_size[0], self.image_size[1])
    }

    /// A number of it, in pixels (those of the lens: no unit).
    pub(crate) fn value(&self, p: Parameter) -> f64 {
        match p {
            Parameter::Fx => self.fx,
            Parameter::Fy => self.fy,
            Parameter::Cx => self.cx,
            Parameter::Cy => self.cy,
            Parameter::Skew => self.skew,
            of_lens => self.distortion.lens.parameter(of_lens.name()).unwrap_or(0.0),
        }
    }
}

/// Lens distortion: `model` and its parameters by name, and where they come from.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct DistortionReport {
    /// The lens.
    #[serde(flatten)]
    pub lens: Lens,
    /// Where the coefficients come from.
    #[serde(default)]
    pub source: LensSource,
}

/// A Gaussian prior and how much it counted.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Prior {
    /// The parameter.
    pub parameter: PriorParameter,
    /// Mean, in pixels (`aspect` and what is of the lens: no unit).
    pub mean: f64,
    /// Standard deviation, same unit.
    pub sigma: f64,
    /// Posterior over prior standard deviation: near 1 the prior decided, near 0 the images did.
    pub posterior_over_prior: f64,
    /// Distance between the mean and what the images alone say, in deviations of both together; `None`: they say nothing of it, or the
    /// method does not tell. Priors beyond 4 are released ([`PriorConflict`]), unless the images are no likelier without them.
    #[serde(default)]
    pub conflict: Option<f64>,
}

/// A prior that the images contradicted, and that was released for it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct PriorConflict {
    /// The parameter.
    pub parameter: PriorParameter,
    /// Mean of the prior, in pixels (`aspect`, `k1`, `k2`: no unit).
    pub mean: f64,
    /// Its standard deviation, same unit; 0: the value was held.
    pub sigma: f64,
    /// What the images say without it.
    pub found: f64,
    /// Standard deviation of that.
    pub found_sigma: f64,
    /// Twice the logarithm of the odds of the images without it over those with it.
    pub twice_log_odds: f64,
}

impl PriorConflict {
    /// Standard deviations, of both together, between the prior and what the images say.
    pub(crate) fn standardised_distance(&self) -> f64 {
        (self.found - self.mean).abs() / self.sigma.hypot(self.found_sigma)
    }
}
