//! A calibrated camera with everything that is known of it.

use serde::{Deserialize, Serialize};

use crate::{
    error::Error,
    geometry::{
        constraint::Constraint,
        parameters::{Parameter, PriorParameter},
    },
    result::{
        camera::{Camera, Method, MotionKind, Prior, Scene},
        covariance::{Covariance, StandardDeviation},
        evidence::Evidence,
        fit::Fit,
        motions::MotionReport,
        on_base::CameraOnBase,
        projection::ProjectionUncertainty,
        verdict::Verdict,
        views::{AttitudeReport, ViewReport},
        warning::{self, Warning},
    },
};

/// The version of [`Calibration::schema_version`] that is written; older ones are read.
pub const SCHEMA_VERSION: u32 = 6;
/// The version of [`Calibration::format_version`] that is written; older ones are read.
pub const FORMAT_VERSION: u32 = 2;
/// How far a camera on a robot, a tripod or a head pitches and rolls by itself, in degrees, where nothing is said of it.
pub(crate) const ATTITUDE_SIGMA_DEG: f64 = 0.1;

fn first_version() -> u32 {
    1
}

fn usual_attitude_sigma_deg() -> f64 {
    ATTITUDE_SIGMA_DEG
}

/// Pixel convention of all coordinates. There is one; files say it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub enum PixelCentre {
    /// (0, 0) is the centre of the top-left pixel.
    #[default]
    #[serde(rename = "(0,0) is the centre of the top-left pixel")]
    TopLeftPixel,
}

/// As in files.
impl std::fmt::Display for PixelCentre {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            PixelCentre::TopLeftPixel => "(0,0) is the centre of the top-left pixel",
        })
    }
}

/// A calibrated camera, what it was made from, and what to beware of.
///
/// Read from a file that says less (a camera alone, say), the rest is what `calibrate` takes where it is told nothing, and lists are empty.
///
/// # Examples
/// ```
/// # use groundcal::{ImagePair, Options, Silent, calibrate_matches, synthetic::PointScene};
/// # let scene = PointScene::nominal(0);
/// # let pairs: Vec<ImagePair> = scene.pairs();
/// # let names: Vec<String> = (0..6).map(|i| format!("view {i}")).collect();
/// # let calibration = calibrate_matches(&names, scene.size, &pairs, &Options::default(), &Silent)?;
/// use groundcal::Parameter;
/// println!("fx = {} +- {:?}", calibration.value(Parameter::Fx), calibration.standard_deviation(Parameter::Fx));
/// for warning in &calibration.warnings {
///     println!("[{}] {warning}", warning.code());
/// }
/// # Ok::<(), groundcal::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Calibration {
    /// Version of this form: it grows with every field or name that is new. [`SCHEMA_VERSION`]; files without it are of version 1.
    #[serde(default = "first_version")]
    pub schema_version: u32,
    /// Version of what readers may rely on: it grows when a field goes or changes its meaning. [`FORMAT_VERSION`].
    #[serde(default = "first_version")]
    pub format_version: u32,
    /// Whether to trust it; `None`: nobody asked (a file of an earlier version, a camera from elsewhere).
    #[serde(default)]
    pub verdict: Option<Verdict>,
    /// Pixel convention of all coordinates.
    #[serde(default)]
    pub pixel_centre: PixelCentre,
    /// The camera.
    pub camera: Camera,
    /// One standard deviation of each parameter; `None`: held fixed.
    #[serde(default)]
    pub standard_deviation: StandardDeviation,
    /// Covariance of the parameters in pixels squared (those of the lens: no unit); rows of what was held are zero. The linear method leaves the
    /// covariances between lens and camera zero.
    #[serde(default)]
    pub covariance: Covariance<Parameter>,
    /// What was assumed of the camera matrix.
    #[serde(default)]
    pub constraint: Constraint,
    /// Method of estimation.
    #[serde(default)]
    pub method: Method,
    /// What the points were taken for; `None` for the linear method.
    pub scene: Option<Scene>,
    /// What the camera was taken to do between the pictures used; `None`: a file of an earlier version.
    #[serde(default)]
    pub motion: Option<MotionKind>,
    /// Height of the origins' optical centres in metres where positions are in metres ([`Calibration::with_camera_height`]); `None`:
    /// that height is the unit of length.
    pub camera_height_m: Option<f64>,
    /// Its standard deviation; `None`: it is taken as exact, or the unit.
    #[serde(default)]
    pub camera_height_sigma_m: Option<f64>,
    /// What was assumed beforehand and how much it counted.
    #[serde(default)]
    pub priors: Vec<Prior>,
    /// Standard deviation of each view's attitude about the axes across the floor's normal that the error bars allow
    /// for, in degrees.
    #[serde(default = "usual_attitude_sigma_deg")]
    pub attitude_sigma_deg: f64,
    /// Whether the motions told it (otherwise it is the stated or default value).
    #[serde(default)]
    pub attitude_sigma_estimated: bool,
    /// Relative standard deviation of the views' heights over the floor (0: constant); `None` where heights have no part.
    pub height_sigma: Option<f64>,
    /// How well the motions agree on one camera.
    #[serde(default)]
    pub fit: Fit,
    /// Attitudes of the camera to the floor.
    #[serde(default)]
    pub attitudes: Vec<AttitudeReport>,
    /// Every view of the joint refinement.
    #[serde(default)]
    pub views: Vec<ViewReport>,
    /// Every pair looked at.
    #[serde(default)]
    pub motions: Vec<MotionReport>,
    /// Where the camera sits on a robot, where odometry told; of each attitude.
    #[serde(default)]
    pub on_base: Vec<CameraOnBase>,
    /// How sure the camera is of where things appear, over the image; `None`: no error bars, or a file of an earlier version.
    #[serde(default)]
    pub projection_uncertainty: Option<ProjectionUncertainty>,
    /// What to beware of.
    #[serde(default, with = "warning::list")]
    pub warnings: Vec<Warning>,
    /// What it was made from, point by point; not written to files.
    #[serde(skip)]
    pub evidence: Evidence,
}

impl Calibration {
    /// A number of the camera, in pixels (those of the lens: no unit).
    pub fn value(&self, p: Parameter) -> f64 {
        self.camera.value(p)
    }

    /// One standard deviation of a parameter; `None`: held fixed or given.
    pub fn standard_deviation(&self, p: Parameter) -> Option<f64> {
        self.standard_deviation.get(p)
    }

    /// The prior of a parameter, if there was one.
    pub fn prior(&self, p: PriorParameter) -> Option<&Prior> {
        self.priors.iter().find(|prior| prior.parameter == p)
    }

    /// The same with lengths in metres: the optical centre of every world's origin is `height_m` over the floor. The height is taken
    /// as exact.
    ///
    /// # Errors
    /// [`Error::InvalidOption`] when it is not positive.
    pub fn with_camera_height(mut self, height_m: f64) -> Result<Self, Error> {
        if !(height_m.is_finite() && height_m > 0.0) {
            return Err(Error::InvalidOption(format!("camera height {height_m} m must be positive")));
        }
        let factor = height_m / self.camera_height_m.unwrap_or(1.0);
        for a in &mut self.attitudes {
            [&mut a.height, &mut a.height_sigma].into_iter().flatten().for_each(|v| *v *= factor);
        }
        for v in &mut self.views {
            let lengths = [&mut v.position, &mut v.position_sigma].into_iter().flatten();
            lengths.flatten().for_each(|x| *x *= factor);
            v.covariance.scale(|p| if p.is_length() { factor } else { 1.0 });
            if let Some(h) = &mut v.floor_from_image {
                // X and Y are lengths, the third coordinate is none.
                let scale = |i: usize| if i < 6 { factor } else { 1.0 };
                h.matrix[..2].iter_mut().flatten().for_each(|x| *x *= factor);
                for (r, row) in h.covariance.iter_mut().enumerate() {
                    row.iter_mut().enumerate().for_each(|(c, x)| *x *= scale(r) * scale(c));
                }
            }
        }
        self.camera_height_m = Some(height_m);
        self.camera_height_sigma_m = None;
        Ok(self)
    }
}
