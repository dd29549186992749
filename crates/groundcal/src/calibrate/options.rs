//! What a calibration may be told, and what the camera's stages and the refinement make of it.

pub(crate) use crate::result::Method;
use crate::{
    error::Error,
    geometry::{frame::Frame, intrinsics::Intrinsics, lens::Lens, size::ImageSize},
    named::named,
    pairs::{
        known_lens::{K1_SIGMA, K2_SIGMA, K3_SIGMA, P_SIGMA},
        pair_lens::RadialCorrection,
        robust::RobustOptions,
    },
    refine::{BundleOptions, CameraUnknowns},
    result::calibration::ATTITUDE_SIGMA_DEG,
    start::{
        absolute_conic::Constraint,
        linear_camera::{CameraOptions, GivenPrior, PriorParameter},
    },
    vision::{features::FeatureOptions, patches::PatchOptions},
};

named! {
    /// What is estimated of a lens.
    ///
    /// # Examples
    /// ```
    /// use groundcal::{LensModel, Options};
    /// // Ideal pictures, undistorted before: nothing is estimated of the lens.
    /// let options = Options { lens: LensModel::None, ..Options::default() };
    /// assert!(options.lens != LensModel::default());
    /// assert_eq!(LensModel::ALL.map(LensModel::name), ["none", "k1", "k1k2", "radtan", "fisheye"]);
    /// ```
    #[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
    pub enum LensModel {
        /// Nothing: the lens is taken to have no distortion, and the error bars do not cover it.
        None = "none",
        /// k1, p1 and p2.
        K1 = "k1",
        /// k1, k2, p1 and p2, each with a prior about zero: what the images do not tell stays there, with its error bar. k3 where the
        /// residuals of the joint refinement ask for it.
        #[default]
        K1K2 = "k1k2",
        /// The same, and never a fisheye's: unless this is said, that is tried where the images reach far from the axis.
        Radtan = "radtan",
        /// A fisheye's (equidistant, Kannala and Brandt), of up to 220 degrees across the image's diagonal and more: k1 to k4, each with a prior about zero.
        Fisheye = "fisheye",
    }
}

// Every lens model is named in each of these, so that a new one is asked for all of it.
impl LensModel {
    /// Whether its coefficients are a fisheye's.
    pub(crate) fn is_fisheye(self) -> bool {
        match self {
            Self::None | Self::K1 | Self::K1K2 | Self::Radtan => false,
            Self::Fisheye => true,
        }
    }

    /// Whether its first coefficients are found from homographies of planes before a camera is known.
    pub(crate) fn is_found_from_planes(self) -> bool {
        match self {
            Self::None | Self::Fisheye => false,
            Self::K1 | Self::K1K2 | Self::Radtan => true,
        }
    }

    /// Whether it is Brown-Conrady without k2.
    pub(crate) fn holds_k2(self) -> bool {
        match self {
            Self::K1 => true,
            Self::None | Self::K1K2 | Self::Radtan | Self::Fisheye => false,
        }
    }

    /// Whether somebody said that the lens is no fisheye.
    pub(crate) fn is_radtan_only(self) -> bool {
        match self {
            Self::Radtan => true,
            Self::None | Self::K1 | Self::K1K2 | Self::Fisheye => false,
        }
    }

    /// Whether a number of the lens, for which a prior may be given, is estimated.
    fn estimates(self, parameter: PriorParameter) -> bool {
        use PriorParameter::{K1, K2, K3, P1, P2};
        match self {
            Self::None => false,
            Self::K1 => matches!(parameter, K1 | P1 | P2),
            Self::K1K2 | Self::Radtan => matches!(parameter, K1 | K2 | K3 | P1 | P2),
            Self::Fisheye => matches!(parameter, K1 | K2 | K3),
        }
    }
}

/// How the homographies of [`Method::Kzr`] are fitted to the matches that a robust search finds to be on the plane.
///
/// # Examples
/// ```
/// use groundcal::{HomographyFit, Method, Options};
/// let options = Options { method: Method::Kzr, homographies: HomographyFit::Linear, ..Options::default() };
/// assert_ne!(options.homographies, HomographyFit::default());
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum HomographyFit {
    /// Maximum likelihood with errors in both images (H&Z 4.2.5).
    #[default]
    NonLinear,
    /// The normalised direct linear transformation (H&Z 4.1), every match with the same weight.
    Linear,
}

/// What is known of how the camera moved.
///
/// # Examples
/// ```
/// use groundcal::{MotionModel, Options};
/// // Pictures of one plane from the hand.
/// let options = Options { motion: MotionModel::General, ..Options::default() };
/// assert_eq!(MotionModel::default(), MotionModel::Auto);
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum MotionModel {
    /// Nothing: plane-normal motions or a camera turning on the spot, whichever the pictures show. Where nothing checks that an axis was
    /// normal to the plane, the answer is refused.
    #[default]
    Auto,
    /// Turns about the plane's normal, with or without a translation: the user vouches for it.
    PlaneNormal,
    /// A camera turning on the spot, about any axes.
    Turning,
    /// Anything before one plane (Triggs 1998): the joint method.
    General,
}

/// How many features are looked for.
///
/// ```
/// use groundcal::{FeatureDensity, Options};
///
/// assert_eq!(Options::default().feature_density, FeatureDensity::Auto);
/// let all_at_once = Options { feature_density: FeatureDensity::Dense, ..Options::default() };
/// # assert_eq!(all_at_once.max_features, 3000);
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum FeatureDensity {
    /// Few (`coarse`), enough to find the planes that patches are then matched on; all where these do not carry the answer:
    /// where there is none, where patches find too little texture, or where images are left over.
    #[default]
    Auto,
    /// All: [`Options::max_features`].
    Dense,
}

/// What a calibration may be told. Everything has a default.
///
/// # Examples
/// ```
/// use groundcal::{Constraint, LensModel, Options};
/// let options = Options { constraint: Constraint::Square, lens: LensModel::None, seed: 7, ..Options::default() };
/// assert_eq!(options.priors, Options::default().priors);
/// ```
#[derive(Debug, Clone)]
pub struct Options {
    /// How the camera is estimated.
    pub method: Method,
    /// How homographies are fitted; [`Method::Kzr`] only.
    pub homographies: HomographyFit,
    /// How a radial distortion is corrected, about the assumed principal point; [`Method::Kzr`] only.
    pub radial: RadialCorrection,
    /// What is known of the motion.
    pub motion: MotionModel,
    /// What is assumed of the camera matrix.
    pub constraint: Constraint,
    /// The principal point in pixels where it is held, centre of its prior otherwise (default: the image centre).
    pub principal_point_px: Option<[f64; 2]>,
    /// fy / fx where it is held, centre of its prior otherwise (default: 1).
    pub aspect: Option<f64>,
    /// fx in pixels that the pictures themselves state (their Exif). The answer is checked by it and made from it in no way.
    pub stated_focal_px: Option<f64>,
    /// A known lens, of any model: its coefficients are held and undone before anything else; the camera matrix through which they
    /// act is estimated. [`Lens::None`]: not known.
    pub distortion: Lens,
    /// The camera matrix, in pixels of these images, through which `distortion` was measured: where the focal length and the centre
    /// of a known lens start from; they are estimated all the same, and there is no prior at these values. A lens that sees beyond 90
    /// degrees needs it: through another focal length a floor is no plane. `None`: the longer side for a focal length.
    pub distortion_camera: Option<Intrinsics>,
    /// What is estimated of a lens distortion where none is given.
    pub lens: LensModel,
    /// Priors that take the place of those of `auto`, or join the other constraints (joint refinement; the linear method knows
    /// those of the camera matrix).
    pub priors: Vec<GivenPrior>,
    /// Standard deviation of each view's attitude about each axis across the floor's normal, in degrees: robots pitch and
    /// floors are not flat. 0: exactly plane-normal, as in the paper. `None`: estimated where three attitudes or more allow
    /// it, else 0.1, or 1.5 for a single motion before a background that stands still (a thing moved before a fixed camera,
    /// by an arm or by hand).
    pub attitude_sigma_deg: Option<f64>,
    /// Relative standard deviation of each view's height over the floor from that of the others of its attitude. 0: constant
    /// height; 0.3 and more: free. `None`: estimated. The linear method takes heights as free.
    pub height_sigma: Option<f64>,
    /// Pairs of image indices known to be plane-normal motions; `None`: found. The joint method uses what other pairs there are as links
    /// between views of the same floor, and images outside of the pairs named as further views.
    pub pairs: Option<Vec<(usize, usize)>>,
    /// Up to this many images all pairs are compared; beyond it neighbours and, of pictures, those that look most alike.
    pub all_pairs_limit: usize,
    /// Fewest matches that must agree on a plane; `None`: 15 for images, 6 for given matches.
    pub min_plane_matches: Option<usize>,
    /// Most features kept of an image, spread over it.
    pub max_features: usize,
    /// Whether fewer features are tried first.
    pub feature_density: FeatureDensity,
    /// Robust homographies.
    pub robust: RobustOptions,
    /// Whether the floor of the motions found is matched again patch by patch (images only).
    pub match_patches: bool,
    /// Largest predicted standard deviation of either coordinate of a patch, in pixels: less texture than that is left out.
    pub max_patch_sigma_px: f64,
    /// Seed of every random choice.
    pub seed: u64,
}

impl Options {
    /// How features are looked for.
    pub(crate) fn features(&self) -> FeatureOptions {
        FeatureOptions { max_features: self.max_features, ..FeatureOptions::default() }
    }
}

impl Default for Options {
    fn default() -> Self {
        Self {
            method: Method::default(),
            homographies: HomographyFit::default(),
            radial: RadialCorrection::default(),
            motion: MotionModel::default(),
            constraint: Constraint::Auto,
            principal_point_px: None,
            aspect: None,
            distortion: Lens::None,
            distortion_camera: None,
            lens: LensModel::default(),
            priors: Vec::new(),
            attitude_sigma_deg: None,
            height_sigma: None,
            pairs: None,
            all_pairs_limit: 40,
            min_plane_matches: None,
            max_features: FeatureOptions::default().max_features,
            feature_density: FeatureDensity::default(),
            robust: RobustOptions::default(),
            match_patches: true,
            max_patch_sigma_px: PatchOptions::default().max_sigma_px,
            stated_focal_px: None,
            seed: 0,
        }
    }
}

/// How far a camera on a robot, a tripod or a head pitches and rolls by itself, in degrees, where nothing is said of it; and
/// a thing moved before a fixed camera by an arm or by hand, when a single motion cannot show it.
pub(crate) const HELD_ATTITUDE_SIGMA_DEG: f64 = 1.5;
/// Prior of ln(fy / fx) under `auto`, and when the ratio is given.
const ASPECT_SIGMA: f64 = 0.003;
const GIVEN_ASPECT_SIGMA: f64 = 0.001;
/// Prior of the principal point as a fraction of the image width under `auto`, and when it is given.
const PRINCIPAL_POINT_SIGMA: f64 = 0.05;
const GIVEN_PRINCIPAL_POINT_SIGMA: f64 = 0.01;

/// Priors of a fisheye's k1 to k4. (An equisolid lens has k1 = -0.042, a stereographic one 0.083, an orthographic one -0.167 with k2 = 0.008; those of
/// `cv2.fisheye` calibrations are some hundredths.)
pub(super) const FISHEYE_SIGMAS: [f64; 4] = [0.1, 0.05, 0.02, 0.01];

/// Largest coefficient of a known lens.
const MAX_COEFFICIENT: f64 = 10.0;

impl Options {
    /// Whether the floor of motions seen in images is matched again patch by patch: the published method does not.
    pub(super) fn has_patches(&self) -> bool {
        self.match_patches && self.method != Method::Kzr
    }

    /// Whether pairs beside those named have a use: the joint refinement of plane-normal motions links views by them, and a motion is
    /// transferred by them.
    pub(super) fn has_links_beside_named_pairs(&self) -> bool {
        matches!(self.method, Method::Joint | Method::Transferred)
            && matches!(self.motion, MotionModel::Auto | MotionModel::PlaneNormal)
    }

    /// Checks every option once.
    ///
    /// # Errors
    /// [`Error::InvalidOption`] naming the option and its value.
    pub(crate) fn validate(&self, size: ImageSize) -> Result<(), Error> {
        let fail = |text: String| Err(Error::InvalidOption(text));
        if self.motion == MotionModel::General && self.method != Method::Joint {
            return fail("general motion before a plane is for the joint method alone".into());
        }
        if let Some([x, y]) = self.principal_point_px {
            let (w, h) = (size.width as f64, size.height as f64);
            if !(x.is_finite() && y.is_finite() && (-w..2.0 * w).contains(&x) && (-h..2.0 * h).contains(&y)) {
                return fail(format!("principal point ({x}, {y}) is not near an image of {size} pixels"));
            }
        }
        if let Some(px) = self.stated_focal_px
            && !(px.is_finite() && px > 0.0)
        {
            return fail(format!("a stated focal length of {px} pixels must be positive"));
        }
        if let Some(a) = self.aspect
            && !(a.is_finite() && (0.1..=10.0).contains(&a))
        {
            return fail(format!("aspect ratio {a} must lie between 0.1 and 10"));
        }
        if let Some(sigma) = self.attitude_sigma_deg
            && !(sigma.is_finite() && (0.0..=20.0).contains(&sigma))
        {
            return fail(format!("attitude sigma {sigma} degrees must lie between 0 and 20"));
        }
        if let Some(sigma) = self.height_sigma
            && !(sigma.is_finite() && (0.0..=10.0).contains(&sigma))
        {
            return fail(format!("height sigma {sigma} must lie between 0 and 10"));
        }
        self.validate_distortion()?;
        for p in &self.priors {
            let name = p.parameter.name();
            let positive = matches!(p.parameter, PriorParameter::Fx | PriorParameter::Aspect);
            if !(p.mean.is_finite() && p.sigma.is_finite() && p.sigma > 0.0 && (!positive || p.mean > 0.0)) {
                return fail(format!(
                    "prior {name} = {} +- {}: both must be finite, the deviation (and a focal length or ratio) positive",
                    p.mean, p.sigma
                ));
            }
            if self.priors.iter().filter(|q| q.parameter == p.parameter).count() > 1 {
                return fail(format!("two priors of {name}"));
            }
            if !self.is_estimated(p.parameter) {
                return fail(format!(
                    "a prior of {name}, which `{}`, the given distortion or the lens model holds: leave one of the two out",
                    self.constraint.name()
                ));
            }
        }
        if self.method == Method::Rotating {
            if !self.priors.is_empty() {
                return fail(
                    "the rotating-camera method takes no priors: leave them out, or use the joint method".into(),
                );
            }
            if self.attitude_sigma_deg.is_some() || self.height_sigma.is_some() {
                return fail(
                    "the rotating-camera method knows no floor: an attitude or height sigma has no meaning there"
                        .into(),
                );
            }
        }
        self.validate_published()?;
        if !(self.robust.max_sigma_px.is_finite() && self.robust.max_sigma_px > 0.0) {
            return fail(format!("largest noise {} px must be positive", self.robust.max_sigma_px));
        }
        Ok(())
    }

    /// What the method as published has no word for.
    fn validate_published(&self) -> Result<(), Error> {
        let fail = |text: &str| Err(Error::InvalidOption(text.into()));
        if self.method != Method::Kzr && self.radial != RadialCorrection::None {
            return fail(
                "a radial correction pair by pair belongs to the published method, kzr: the others estimate the lens",
            );
        }
        if self.method != Method::Kzr {
            return if self.homographies == HomographyFit::Linear {
                fail("linear homographies belong to the published method, kzr: the others refine theirs")
            } else {
                Ok(())
            };
        }
        if !self.priors.is_empty() {
            return fail("the published method (kzr) takes no priors: leave them out, or use the joint method");
        }
        if !self.distortion.is_none() {
            return fail(
                "the published method (kzr) knows no lens of several pairs: undo the distortion in the pictures first (undistort), or let it \
                 correct each pair by itself (radial)",
            );
        }
        if self.height_sigma.is_some() {
            return fail("the published method (kzr) takes heights as they come: a height sigma has no meaning there");
        }
        if self.motion == MotionModel::Turning {
            return fail(
                "the published method (kzr) is for turns about a plane's normal: use the rotating or the joint method",
            );
        }
        Ok(())
    }

    fn validate_distortion(&self) -> Result<(), Error> {
        let lens = &self.distortion;
        for (name, value) in lens.parameter_names().iter().zip(lens.parameters()) {
            if !(value.is_finite() && value.abs() <= MAX_COEFFICIENT) {
                return Err(Error::InvalidOption(format!(
                    "distortion {name} {value} must be finite and at most {MAX_COEFFICIENT} in size"
                )));
            }
        }
        let numbers = self.distortion_camera.map(|k| [k.fx, k.fy, k.cx, k.cy, k.skew]);
        if let Some(numbers) = numbers
            && !(numbers.iter().all(|v| v.is_finite()) && numbers[0] > 0.0 && numbers[1] > 0.0)
        {
            return Err(Error::InvalidOption(
                "the camera matrix of a known lens must be finite, its focal lengths positive".into(),
            ));
        }
        if lens.sees_behind() && numbers.is_none() {
            return Err(Error::InvalidOption(format!(
                "a known {} lens without the camera matrix through which it was measured: a lens that sees beyond 90 degrees is undone \
                 from there",
                lens.name()
            )));
        }
        Ok(())
    }

    /// Whether a number of the camera is estimated at all.
    fn is_estimated(&self, parameter: PriorParameter) -> bool {
        let free = self.constraint.free();
        match parameter {
            PriorParameter::Fx => free[0],
            PriorParameter::Aspect => free[1],
            PriorParameter::Cx => free[2],
            PriorParameter::Cy => free[3],
            // `auto` holds the skew at zero unless it is told otherwise.
            PriorParameter::Skew => free[4] || self.constraint == Constraint::Auto,
            PriorParameter::K1 | PriorParameter::K2 | PriorParameter::K3 | PriorParameter::P1 | PriorParameter::P2 => {
                self.distortion.is_none() && self.lens.estimates(parameter)
            }
        }
    }

    fn given_prior(&self, parameter: PriorParameter) -> Option<(f64, f64)> {
        self.priors.iter().find(|p| p.parameter == parameter).map(|p| (p.mean, p.sigma))
    }

    /// Whether somebody said what a number of the camera matrix is, or about what.
    pub(super) fn is_told(&self, parameter: PriorParameter) -> bool {
        let is_held = match parameter {
            PriorParameter::Aspect => self.aspect.is_some(),
            PriorParameter::Cx | PriorParameter::Cy => self.principal_point_px.is_some(),
            _ => false,
        };
        is_held || self.given_prior(parameter).is_some()
    }

    /// The frame of the estimation: its origin is the assumed principal point.
    pub(super) fn frame(&self, size: ImageSize) -> Frame {
        Frame::new(size, self.principal_point_px)
    }

    /// Where the principal point is thought to be, pixels.
    pub(super) fn assumed_principal_point(&self, size: ImageSize) -> [f64; 2] {
        self.frame(size).origin_px.into()
    }

    /// Square pixels and the longer side for a focal length, until a camera is known.
    pub(super) fn nominal_camera(&self, size: ImageSize) -> Intrinsics {
        let [cx, cy] = self.assumed_principal_point(size);
        Intrinsics::square(size.width.max(size.height) as f64, cx, cy)
    }

    /// The camera matrix through which a known lens acts before a camera is known.
    pub(super) fn camera_of_lens(&self, size: ImageSize) -> Intrinsics {
        self.distortion_camera.unwrap_or_else(|| self.nominal_camera(size))
    }

    /// Whether the distortion is to be found.
    pub(super) fn lens_is_unknown(&self) -> bool {
        self.distortion.is_none() && self.lens.is_found_from_planes() && self.method != Method::Kzr
    }

    /// What the closed-form camera is told.
    pub(super) fn camera(&self, size: ImageSize) -> CameraOptions {
        let fraction =
            if self.principal_point_px.is_some() { GIVEN_PRINCIPAL_POINT_SIGMA } else { PRINCIPAL_POINT_SIGMA };
        CameraOptions {
            constraint: self.constraint,
            aspect: self.aspect.unwrap_or(1.0),
            aspect_sigma: if self.aspect.is_some() { GIVEN_ASPECT_SIGMA } else { ASPECT_SIGMA },
            principal_point_sigma_px: fraction * size.width as f64,
            given: self.priors.clone(),
            attitude_sigma_rad: self.attitude_sigma_deg.unwrap_or(ATTITUDE_SIGMA_DEG).to_radians(),
            estimate_attitude_sigma: self.attitude_sigma_deg.is_none(),
        }
    }

    /// What the joint refinement assumes where nothing is known of the images yet, in the frame of such a size.
    #[cfg(feature = "synthetic")]
    pub(crate) fn assumptions(&self, size: ImageSize) -> BundleOptions {
        self.refinement(size, &self.camera(size), self.lens_is_unknown())
    }

    /// What is estimated of a lens. The decentring of Brown-Conrady always is: else it is taken for the principal point.
    fn free_lens(&self, unknowns: &mut CameraUnknowns) {
        use PriorParameter::{K1, K2, K3, P1, P2};
        if self.lens.is_fisheye() {
            let given = [Some(K1), Some(K2), Some(K3), None].map(|p| p.and_then(|p| self.given_prior(p)));
            for (k, (given, sigma)) in given.into_iter().zip(FISHEYE_SIGMAS).enumerate() {
                unknowns.free_lens(k, Some(given.unwrap_or((0.0, sigma))));
            }
            return;
        }
        for (of_lens, (parameter, sigma)) in
            [(K1, K1_SIGMA), (K2, K2_SIGMA), (P1, P_SIGMA), (P2, P_SIGMA), (K3, K3_SIGMA)].into_iter().enumerate()
        {
            let given = self.given_prior(parameter);
            let prior = given.unwrap_or((0.0, sigma));
            if !self.is_estimated(parameter) {
                continue;
            } else if parameter == K3 && given.is_none() {
                unknowns.lens_on_demand.push((of_lens, prior));
            } else {
                unknowns.free_lens(of_lens, Some(prior));
            }
        }
    }

    /// What the joint refinement is told, the closed-form camera having been told `camera`.
    pub(super) fn refinement(&self, size: ImageSize, camera: &CameraOptions, estimate_lens: bool) -> BundleOptions {
        let frame = self.frame(size);
        let k = self.constraint.free();
        let priors = camera.priors(&frame).0;
        let image_half_sides = [size.width, size.height].map(|side| 0.5 * side as f64 / frame.scale_px);
        let mut unknowns = CameraUnknowns {
            matrix_free: [k[0], k[1], k[2], k[3], k[4] || priors[4].is_some()],
            matrix_priors: priors,
            lens_free: Vec::new(),
            ..CameraUnknowns::new(frame, image_half_sides)
        };
        if estimate_lens {
            self.free_lens(&mut unknowns);
        }
        BundleOptions {
            attitude_sigma_rad: (!camera.estimate_attitude_sigma).then_some(camera.attitude_sigma_rad),
            attitude_scale_rad: camera.attitude_sigma_rad,
            height_sigma: self.height_sigma,
            lens_on_axis: self.motion == MotionModel::Turning,
            ..BundleOptions::new(vec![unknowns])
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stated_focal_length_is_one() {
        let validated =
            |px| Options { stated_focal_px: Some(px), ..Options::default() }.validate(ImageSize::new(640, 480));
        for px in [0.0, -500.0, f64::NAN, f64::INFINITY] {
            assert!(matches!(validated(px), Err(Error::InvalidOption(_))), "{px}");
        }
        assert_eq!(validated(500.0), Ok(()));
    }

    #[test]
    fn general_motion_has_no_closed_form() {
        let validated = |method| {
            Options { motion: MotionModel::General, method, ..Options::default() }.validate(ImageSize::new(640, 480))
        };
        assert_eq!(validated(Method::Joint), Ok(()));
        for method in [Method::Linear, Method::Kzr, Method::Rotating] {
            assert!(matches!(validated(method), Err(Error::InvalidOption(_))), "{method:?}");
        }
    }
}
