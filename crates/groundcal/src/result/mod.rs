//! The result of a calibration: one serialisable value, from which every renderer works.
//!
//! Pixels throughout, (0, 0) being the centre of the top-left pixel; angles in degrees where the name says so. The JSON
//! form is documented in `docs/formats.md`.

pub mod evidence;

use nalgebra::{SMatrix, SVector};
use serde::Serialize;

use crate::{
    error::Error,
    floor::view::FloorView,
    geometry::{distortion::Distortion, intrinsics::Intrinsics, size::ImageSize},
    refine::VIEW_NUMBERS,
    result::evidence::Evidence,
};

/// A calibrated camera, what it was made from, and what to beware of.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Calibration {
    /// Version of this format.
    pub format_version: u32,
    /// Pixel convention of all coordinates.
    pub pixel_centre: &'static str,
    /// The camera.
    pub camera: Camera,
    /// One standard deviation of each parameter; `None`: held fixed.
    pub standard_deviation: StandardDeviation,
    /// Covariance of the parameters.
    pub covariance: Covariance,
    /// Name of the constraint.
    pub constraint: String,
    /// Method of estimation: `joint` (everything refined together), `linear` (Knight, Zisserman & Reid 2003, weighted) or
    /// `rotating` (Hartley 1994, weighted).
    pub method: &'static str,
    /// What the points were taken for: `floor`, or `directions` (a camera turning on the spot before a scene far away); `None`
    /// for the linear method.
    pub scene: Option<&'static str>,
    /// Height of the origins' optical centres in metres where positions are in metres ([`Calibration::with_camera_height`]); `None`:
    /// that height is the unit of length.
    pub camera_height_m: Option<f64>,
    /// What was assumed beforehand and how much it counted.
    pub priors: Vec<Prior>,
    /// Standard deviation of each view's attitude about the axes across the floor's normal that the error bars allow
    /// for, in degrees.
    pub attitude_sigma_deg: f64,
    /// Whether the motions told it (otherwise it is the stated or default value).
    pub attitude_sigma_estimated: bool,
    /// Relative standard deviation of the views' heights over the floor (0: constant); `None` where heights have no part.
    pub height_sigma: Option<f64>,
    /// How well the motions agree on one camera.
    pub fit: Fit,
    /// Attitudes of the camera to the floor.
    pub attitudes: Vec<AttitudeReport>,
    /// Every view of the joint refinement.
    pub views: Vec<ViewReport>,
    /// Every pair looked at.
    pub motions: Vec<MotionReport>,
    /// What to beware of.
    pub warnings: Vec<WarningReport>,
    /// What it was made from, point by point; not written to the JSON.
    #[serde(skip)]
    pub evidence: Evidence,
}

/// Camera parameters in pixels.
#[derive(Debug, Clone, PartialEq, Serialize)]
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
    pub skew: f64,
    /// Lens distortion.
    pub distortion: DistortionReport,
}

impl Camera {
    /// The camera matrix.
    pub fn intrinsics(&self) -> Intrinsics {
        Intrinsics { fx: self.fx, fy: self.fy, cx: self.cx, cy: self.cy, skew: self.skew }
    }

    /// The lens.
    pub fn lens(&self) -> Distortion {
        let d = &self.distortion;
        Distortion { k1: d.k1, k2: d.k2, p1: d.p1, p2: d.p2 }
    }

    /// Width and height.
    pub fn size(&self) -> ImageSize {
        ImageSize::new(self.image_size[0], self.image_size[1])
    }
}

/// Lens distortion, named.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct DistortionReport {
    /// `none`, or `radtan` (Brown-Conrady, as OpenCV).
    pub model: &'static str,
    /// `not modelled`, `given` or `estimated` (the model is then `none` where the coefficients are not told from zero).
    pub source: &'static str,
    /// Radial, second order.
    pub k1: f64,
    /// Radial, fourth order.
    pub k2: f64,
    /// Tangential.
    pub p1: f64,
    /// Tangential.
    pub p2: f64,
}

/// One standard deviation of each parameter, in pixels (k1, k2: none); `None`: held fixed or given.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[allow(missing_docs)]
pub struct StandardDeviation {
    pub fx: Option<f64>,
    pub fy: Option<f64>,
    pub cx: Option<f64>,
    pub cy: Option<f64>,
    pub skew: Option<f64>,
    pub k1: Option<f64>,
    pub k2: Option<f64>,
}

/// Covariance matrix with the names of its rows.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Covariance {
    /// Names of rows and columns.
    pub parameters: [&'static str; 7],
    /// Pixels squared (k1, k2: no unit); rows of what was held are zero. The linear method leaves the covariances between lens
    /// and camera zero.
    pub matrix: [[f64; 7]; 7],
}

/// A Gaussian prior and how much it counted.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Prior {
    /// Parameter: `fx`, `aspect` (fy / fx), `cx`, `cy`, `skew`, `k1`, `k2`.
    pub parameter: &'static str,
    /// Mean, in pixels (`aspect`, `k1`, `k2`: no unit).
    pub mean: f64,
    /// Standard deviation, same unit.
    pub sigma: f64,
    /// Posterior over prior standard deviation: near 1 the prior decided, near 0 the images did.
    pub posterior_over_prior: f64,
}

/// Agreement of the motions.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
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

/// How the residuals of one kind of measurement are.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
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
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Refinement {
    /// Points seen in images, each with two coordinates.
    pub observations: usize,
    /// Points.
    pub tracks: usize,
    /// Degrees of freedom of the residuals.
    pub degrees_of_freedom: f64,
    /// Patches matched by least squares, where there are any.
    pub patches: Option<ResidualReport>,
    /// Features, or points from elsewhere.
    pub points: Option<ResidualReport>,
    /// Pairs of images of different attitudes that take part because both see the same floor.
    pub ties: usize,
    /// Levenberg-Marquardt steps.
    pub iterations: usize,
    /// Whether the last loop ended by itself.
    pub converged: bool,
}

/// The camera's attitude to the floor.
#[derive(Debug, Clone, PartialEq, Serialize)]
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
    pub motions: Vec<usize>,
}

/// A view of the joint refinement, in a world whose origin is the floor below the optical centre of the first view that common
/// points connect it to, Z up, +X along that view's heading, the height of that optical centre being the unit of length (or
/// [`Calibration::camera_height_m`] metres).
#[derive(Debug, Clone, PartialEq, Serialize)]
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
    pub yaw_sigma_deg: f64,
    /// Angle of this view's optical axis below the horizontal, in degrees.
    pub pitch_down_deg: f64,
    /// Its standard deviation in degrees.
    pub pitch_down_sigma_deg: f64,
    /// This view's roll, in degrees.
    pub roll_deg: f64,
    /// Its standard deviation in degrees.
    pub roll_sigma_deg: f64,
    /// Optical centre: x, y, height (`None` for directions: nothing shows where the camera was).
    pub position: Option<[f64; 3]>,
    /// Standard deviations of the three.
    pub position_sigma: Option<[f64; 3]>,
    /// Points of the floor from undistorted pixels (`None` for directions).
    pub floor_from_image: Option<FloorHomography>,
    /// Points seen in it.
    pub observations: usize,
    /// Root mean square of its weighted residuals: 1 as expected, more where something does not fit.
    pub weighted_rms: f64,
    /// Covariance of fx, fy, cx, cy, skew (pixels), k1, k2, pitch, roll, yaw (radians), x, y and height (the unit of `position`); zero
    /// for what was held. Not written to JSON.
    #[serde(skip)]
    pub covariance: SMatrix<f64, VIEW_NUMBERS, VIEW_NUMBERS>,
}

/// The homography (X, Y, 1)ᵀ ~ H (x, y, 1)ᵀ from pixels of the image without its lens distortion to points of the floor. The third
/// coordinate is positive below the horizon; the third row is the horizon.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FloorHomography {
    /// H, in units of length of the world and pixels.
    pub matrix: [[f64; 3]; 3],
    /// Covariance of its nine numbers, row by row (the uncertainty of what the lens does to the pixels themselves is not in it).
    pub covariance: [[f64; 9]; 9],
}

impl FloorHomography {
    /// Of a view and the covariance of [`ViewReport::covariance`].
    pub fn new(view: &FloorView, covariance: &SMatrix<f64, VIEW_NUMBERS, VIEW_NUMBERS>) -> Self {
        let by = view
            .derivative_by_numbers(|v| SVector::<f64, 9>::from_row_slice(v.floor_from_image().transpose().as_slice()));
        let h = view.floor_from_image();
        let c = by * covariance * by.transpose();
        Self {
            matrix: std::array::from_fn(|r| std::array::from_fn(|c| h[(r, c)])),
            covariance: std::array::from_fn(|r| std::array::from_fn(|s| 0.5 * (c[(r, s)] + c[(s, r)]))),
        }
    }
}

impl Calibration {
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
            let first = VIEW_NUMBERS - 3;
            let scale = |i: usize| if i >= first { factor } else { 1.0 };
            v.covariance = SMatrix::from_fn(|r, c| v.covariance[(r, c)] * scale(r) * scale(c));
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
        Ok(self)
    }
}

/// A pair of images.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct MotionReport {
    /// Name of the first image.
    pub from: String,
    /// Name of the second image.
    pub to: String,
    /// Whether it takes part in the camera as a motion.
    pub used: bool,
    /// Whether its matches take part because both images, of different attitudes, see the same floor.
    pub tie: bool,
    /// Turn of the camera from the first to the second image, counter-clockwise seen from above, in degrees; unsigned for
    /// a motion not used; `None` without a homography.
    pub rotation_deg: Option<f64>,
    /// Its standard deviation in degrees.
    pub rotation_sigma_deg: Option<f64>,
    /// Height ratio: 1 for a motion at constant height above the floor.
    pub rho: Option<f64>,
    /// Its standard deviation.
    pub rho_sigma: Option<f64>,
    /// Matches that agree on one plane.
    pub matches: usize,
    /// Matches tried.
    pub candidate_matches: usize,
    /// Root mean square residual of the plane's matches, both images together, in pixels.
    pub rms_px: Option<f64>,
    /// Index of its attitude.
    pub attitude: Option<usize>,
    /// Why it is not used.
    pub reason: Option<String>,
}

/// A warning as it is written.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct WarningReport {
    /// Short name, stable across versions.
    pub code: &'static str,
    /// What it means, with numbers, and what to do next.
    pub message: String,
}

/// Doubt about a result.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum Warning {
    /// No lens distortion was given and none is estimated.
    DistortionNotModelled {
        /// Change of fx in percent if the lens has k1 = +0.05.
        pincushion_percent: f64,
        /// Change of fx in percent if the lens has k1 = -0.05.
        barrel_percent: f64,
    },
    /// The lens distortion is estimated, but so badly that it rules the error bar of the focal length.
    DistortionUncertain {
        /// Standard deviation of fx that comes from the lens, in percent.
        percent: f64,
        /// Standard deviation of k1.
        k1_sigma: f64,
    },
    /// One motion only: nothing to check it by.
    SingleMotion,
    /// All motions have one attitude.
    SingleAttitude {
        /// How many motions.
        motions: usize,
        /// Where the principal point may go; `None` where it is held.
        doubt: Option<PrincipalPointDoubt>,
    },
    /// A motion's views stray from their common attitude by more than those of the others.
    MotionStrays {
        /// First image.
        from: String,
        /// Second image.
        to: String,
        /// How far their attitudes differ, degrees.
        apart_deg: f64,
        /// Standard deviation of each attitude that the error bars allow for, degrees.
        sigma_deg: f64,
    },
    /// Planes shared by views of different attitudes are mostly not the floor of both.
    FloorsContradict {
        /// Pairs whose plane is the floor of both.
        agree: usize,
        /// Pairs whose plane cannot be.
        contradict: usize,
    },
    /// All horizons are parallel: roll was never varied.
    ParallelHorizons {
        /// Largest difference of roll in degrees.
        spread_deg: f64,
    },
    /// The motions disagree by more than their noise.
    MotionsDisagree {
        /// Sum of squared normalised residuals.
        chi_squared: f64,
        /// Its degrees of freedom.
        degrees_of_freedom: usize,
        /// Factor by which the standard deviations were widened.
        widened: f64,
    },
    /// Homographies taken for rotations about the optical centre are further from it than their noise.
    NotRotations {
        /// Sum of squared normalised residuals.
        chi_squared: f64,
        /// Its degrees of freedom.
        degrees_of_freedom: usize,
        /// Factor by which the standard deviations were widened.
        widened: f64,
    },
    /// A prior, not the images, decided a parameter.
    PriorDecides {
        /// The parameter.
        parameter: &'static str,
        /// Posterior over prior standard deviation.
        posterior_over_prior: f64,
    },
    /// A background that does not move had more support than the plane used.
    StaticBackground {
        /// First image.
        from: String,
        /// Second image.
        to: String,
        /// Matches that stand still.
        matches: usize,
    },
    /// Two inputs are the same image.
    DuplicateImages {
        /// First name.
        first: String,
        /// Second name.
        second: String,
    },
    /// The relative standard deviation of the focal length is large.
    LargeUncertainty {
        /// Standard deviation of fx in percent.
        percent: f64,
    },
    /// Many images: only neighbours were compared.
    NeighboursOnly {
        /// Number of images.
        images: usize,
    },
    /// The joint refinement failed; the answer is the linear method's.
    NotRefined {
        /// Why.
        reason: String,
    },
    /// The fixed point between the given distortion and focal length did not settle.
    DistortionNotConverged {
        /// Last relative change of fx.
        relative_change: f64,
    },
}

/// The direction in which the principal point is known least.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PrincipalPointDoubt {
    /// Unit vector in the image, x and y.
    pub direction: [f64; 2],
    /// Standard deviation along it, pixels.
    pub sigma_px: f64,
    /// By how much fx changes with that, per cent.
    pub f_percent: f64,
}

impl PrincipalPointDoubt {
    /// From the covariance of (fx, fy, cx, cy, ...) in pixels squared.
    pub fn new(fx: f64, covariance: impl Fn(usize, usize) -> f64) -> Self {
        let (xx, xy, yy) = (covariance(2, 2), covariance(2, 3), covariance(3, 3));
        let angle = 0.5 * (2.0 * xy).atan2(xx - yy);
        let (y, x) = angle.sin_cos();
        let variance = (x * x * xx + 2.0 * x * y * xy + y * y * yy).max(f64::MIN_POSITIVE);
        let with_f = x * covariance(0, 2) + y * covariance(0, 3);
        let sigma_px = variance.sqrt();
        Self { direction: [x, y], sigma_px, f_percent: 100.0 * (with_f / variance * sigma_px / fx).abs() }
    }
}

impl Warning {
    /// Code and text.
    pub fn report(&self) -> WarningReport {
        let (code, message) = match self {
            Warning::DistortionNotModelled { pincushion_percent, barrel_percent } => (
                "distortion_not_modelled",
                format!(
                    "lens distortion was not modelled and the error bars do not cover it: k1 = -0.05 (slight barrel) unmodelled would \
                     move fx by {barrel_percent:+.1} %, k1 = +0.05 by {pincushion_percent:+.1} % for these motions. If lines bend near the \
                     border, give the lens's k1 with --k1 (and --k2)"
                ),
            ),
            Warning::DistortionUncertain { percent, k1_sigma } => (
                "distortion_uncertain",
                format!(
                    "the lens distortion is known to k1 +- {k1_sigma:.4} only, which makes {percent:.1} % of uncertainty in fx. Give the \
                     lens's k1 with --k1 if you know it (or --distortion none for a lens known to have none), or take more images with \
                     floor out to the corners"
                ),
            ),
            Warning::SingleMotion => (
                "single_motion",
                "one motion only: nothing checks that its axis is normal to the floor (1 degree off moves f by several per \
                 cent). Take more motions, at other tilts and rolls"
                    .to_string(),
            ),
            Warning::SingleAttitude { motions, doubt } => (
                "single_attitude",
                format!(
                    "{motions} motion{} of one attitude: {}. Tilt or roll the camera by 20 degrees and repeat one motion",
                    if *motions == 1 { "" } else { "s" },
                    match doubt {
                        None => "f depends on where the principal point is held".to_string(),
                        Some(d) => format!(
                            "the principal point can move along ({:.2}, {:.2}) by +-{:.1} px (one standard deviation), held there by the \
                             prior and the lens alone, and fx with it by {:.2} %",
                            d.direction[0], d.direction[1], d.sigma_px, d.f_percent
                        ),
                    }
                ),
            ),
            Warning::FloorsContradict { agree, contradict } => (
                "floors_contradict",
                format!(
                    "{contradict} pairs of images of different attitudes share a plane that cannot be the floor of both, {agree} one that \
                     can: the motions found may be a coincidence among views that tilt freely, and the camera wrong by more than its \
                     error bars. Name the true motions with --pairs, or take them again without tilting the camera between the two \
                     images"
                ),
            ),
            Warning::MotionStrays { from, to, apart_deg, sigma_deg } => (
                "motion_strays",
                format!(
                    "{from} and {to}: their attitudes differ by {apart_deg:.2} degrees, more than the {sigma_deg:.2} degrees of a \
                     view that the others show explain: the camera tilted between them, or they look at another plane. Leave the pair out \
                     (--pairs) or take it again"
                ),
            ),
            Warning::ParallelHorizons { spread_deg } => (
                "parallel_horizons",
                format!(
                    "the camera's roll varies by {spread_deg:.1} degrees only: the horizons are nearly parallel and the principal point \
                     across them is weakly determined. Roll the camera by 30 degrees or more for one or two motions"
                ),
            ),
            Warning::MotionsDisagree { chi_squared, degrees_of_freedom, widened } => (
                "motions_disagree",
                format!(
                    "the motions disagree on one camera by more than their noise (chi-squared {chi_squared:.1} for {degrees_of_freedom} \
                     degrees of freedom); standard deviations were widened by {widened:.1}. Likely causes: lens distortion, an axis off \
                     the floor's normal (see --attitude-sigma-deg), or a wrong pair"
                ),
            ),
            Warning::NotRotations { chi_squared, degrees_of_freedom, widened } => (
                "not_rotations",
                format!(
                    "the pairs are further from rotations about the optical centre than their noise (chi-squared {chi_squared:.1} for \
                     {degrees_of_freedom} degrees of freedom); standard deviations were widened by {widened:.1}, which does not cover the \
                     bias of a camera that moved between its images. Over a floor use the joint method (the default); on the spot, \
                     model the lens (--distortion auto)"
                ),
            ),
            Warning::PriorDecides { parameter, posterior_over_prior } => (
                "prior_decides",
                format!(
                    "the images say little about {parameter}: its standard deviation is {:.0} % of what was assumed beforehand. Vary tilt \
                     and roll more, or give the value if you know it",
                    100.0 * posterior_over_prior
                ),
            ),
            Warning::StaticBackground { from, to, matches } => (
                "static_background",
                format!(
                    "{from} and {to}: {matches} matches stand still, more than move; a background (or a part of the camera's carrier) \
                     that does not move was set aside. Mask it if it should not be there"
                ),
            ),
            Warning::DuplicateImages { first, second } => {
                ("duplicate_images", format!("{first} and {second} are the same image; a pair of them says nothing. Remove one"))
            }
            Warning::LargeUncertainty { percent } => (
                "large_uncertainty",
                format!(
                    "fx is known to {percent:.1} % (one standard deviation) only; intervals this wide are approximate. Take more motions \
                     with turns of 15 to 60 degrees, the camera 30 to 60 degrees below the horizon"
                ),
            ),
            Warning::NeighboursOnly { images } => (
                "neighbours_only",
                format!("{images} images: only neighbours in the given order were compared. Give --pairs to compare others"),
            ),
            Warning::NotRefined { reason } => (
                "not_refined",
                format!("the joint refinement failed ({reason}); the answer is the linear method's, with its error bars"),
            ),
            Warning::DistortionNotConverged { relative_change } => (
                "distortion_not_converged",
                format!(
                    "focal length and the given distortion did not settle (last change {relative_change:.1e}). Check the sign and size of k1"
                ),
            ),
        };
        WarningReport { code, message }
    }
}
