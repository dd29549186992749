//! Doubt about a result, as values.

use serde::{Deserialize, Serialize};

use crate::{
    geometry::parameters::PriorParameter,
    remedy::{Remedy, Wording, sentence},
    result::camera::PriorConflict,
};

/// In what pictures depart from each other.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum PictureDeparture {
    /// Focal length.
    FocalLength,
    /// Turn while they are read out.
    RowTurn,
    /// Shift.
    Shift,
}

/// Doubt about a result.
///
/// # Examples
/// ```
/// use groundcal::Warning;
/// let warning = Warning::SingleMotion;
/// assert_eq!(warning.code(), "single_motion");
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "code", content = "numbers", rename_all = "snake_case")]
#[non_exhaustive]
pub enum Warning {
    /// No lens distortion was given and none is estimated.
    DistortionNotModelled {
        /// Change of fx in percent if the lens has k1 = +0.05; `None`: then there is no camera at all.
        pincushion_percent: Option<f64>,
        /// Change of fx in percent if the lens has k1 = -0.05; `None`: then there is no camera at all.
        barrel_percent: Option<f64>,
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
    /// A motion's views have attitude errors larger than those of the others.
    #[serde(rename = "motion_strays")]
    MotionAttitudeError {
        /// First image.
        from: String,
        /// Second image.
        to: String,
        /// How far their attitudes differ, degrees.
        apart_deg: f64,
        /// Standard deviation of each attitude that the error bars allow for, degrees.
        sigma_deg: f64,
    },
    /// A motion was left out because no camera explains it and the others together.
    MotionLeftOut {
        /// First image.
        from: String,
        /// Second image.
        to: String,
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
        parameter: PriorParameter,
        /// Posterior over prior standard deviation.
        posterior_over_prior: f64,
    },
    /// The images contradict a prior, which was released for it.
    PriorContradicted(PriorConflict),
    /// Pictures depart from each other in what was taken for common to all.
    PicturesDepart {
        /// In what.
        departure: PictureDeparture,
        /// Standard deviation: per cent of f, degrees while a picture is read out, pixels.
        sigma: f64,
        /// Twice the logarithm of the odds of the images with it over those without.
        twice_log_odds: f64,
    },
    /// Of something that was assumed the images neither show nor exclude that it is otherwise; the error bars have what that would do.
    AssumptionOpen {
        /// What was assumed, in words.
        assumption: String,
        /// Twice the logarithm of the odds of the images without it over those with it.
        twice_log_odds: f64,
        /// By how much fx would be another, per cent.
        fx_percent: f64,
        /// By how much the error bars of the camera are wider for all such doubts, at most.
        widened: f64,
    },
    /// The lens is a fisheye's, not the one of Brown and Conrady that was assumed.
    FisheyeLens {
        /// Twice the logarithm of the odds of the images with it over those with the other.
        twice_log_odds: f64,
    },
    /// The focal length is not the one that the pictures state (Exif).
    FocalLengthUnexpected {
        /// fx that they state, pixels.
        stated_px: f64,
        /// By how much fx is larger than that, per cent.
        percent: f64,
    },
    /// A camera that turned on the spot shows parallax: its lens was off the axis of turning, before things that are not far away.
    LensOffAxis {
        /// How far off, in per cent of the distance of the things seen, were that alike for all.
        percent_of_distance: f64,
        /// By how much fx may be wrong for it, per cent; it is in the error bars.
        fx_percent: f64,
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
    /// Something stands still in all images, and was set aside before they were matched.
    StillInAllImages {
        /// Share of the places with detail that it takes, per cent.
        percent: f64,
    },
    /// Two inputs are the same image.
    DuplicateImages {
        /// First name.
        first: String,
        /// Second name.
        second: String,
    },
    /// The deviations stated of the matches are not those that they have.
    StatedNoiseContradicted {
        /// Power of the deviations stated that was taken instead: 0 for one deviation for all, 0.5 for differences half as large.
        exponent: f64,
        /// Twice the logarithm of its odds over the deviations as stated.
        twice_log_odds: f64,
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
    /// The fixed point between the given distortion and focal length did not converge.
    DistortionNotConverged {
        /// Last relative change of fx.
        relative_change: f64,
    },
    /// The attitude errors of a plan's views are larger than predictions were checked for.
    #[serde(alias = "large_strays")]
    LargeAttitudeErrors {
        /// How far, standard deviation in degrees.
        sigma_deg: f64,
        /// Up to where predictions are checked, degrees.
        checked_deg: f64,
    },
    /// A warning in the words of another version of the program, from a file.
    Other {
        /// Its code.
        code: String,
        /// Its words.
        message: String,
    },
}

/// The direction in which the principal point is known least.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
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
    pub(crate) fn new(fx: f64, covariance: impl Fn(usize, usize) -> f64) -> Self {
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
    /// Short name, stable across versions.
    pub fn code(&self) -> &str {
        match self {
            Warning::DistortionNotModelled { .. } => "distortion_not_modelled",
            Warning::DistortionUncertain { .. } => "distortion_uncertain",
            Warning::SingleMotion => "single_motion",
            Warning::SingleAttitude { .. } => "single_attitude",
            Warning::MotionAttitudeError { .. } => "motion_strays",
            Warning::MotionLeftOut { .. } => "motion_left_out",
            Warning::FloorsContradict { .. } => "floors_contradict",
            Warning::ParallelHorizons { .. } => "parallel_horizons",
            Warning::MotionsDisagree { .. } => "motions_disagree",
            Warning::NotRotations { .. } => "not_rotations",
            Warning::PriorDecides { .. } => "prior_decides",
            Warning::PriorContradicted(_) => "prior_contradicted",
            Warning::PicturesDepart { .. } => "pictures_depart",
            Warning::AssumptionOpen { .. } => "assumption_open",
            Warning::FisheyeLens { .. } => "fisheye_lens",
            Warning::FocalLengthUnexpected { .. } => "focal_length_unexpected",
            Warning::LensOffAxis { .. } => "lens_off_axis",
            Warning::StaticBackground { .. } => "static_background",
            Warning::StillInAllImages { .. } => "still_in_all_images",
            Warning::DuplicateImages { .. } => "duplicate_images",
            Warning::StatedNoiseContradicted { .. } => "stated_noise_contradicted",
            Warning::LargeUncertainty { .. } => "large_uncertainty",
            Warning::NeighboursOnly { .. } => "neighbours_only",
            Warning::NotRefined { .. } => "not_refined",
            Warning::DistortionNotConverged { .. } => "distortion_not_converged",
            Warning::LargeAttitudeErrors { .. } => "large_attitude_errors",
            Warning::Other { code, .. } => code,
        }
    }

    /// What it means, with numbers.
    pub(crate) fn finding(&self) -> String {
        match self {
            Warning::DistortionNotModelled { pincushion_percent, barrel_percent } => {
                let change =
                    |percent: &Option<f64>| percent.map_or("beyond any camera".into(), |p| format!("by {p:+.1} %"));
                format!(
                    "lens distortion was not modelled and the error bars do not cover it: k1 = -0.05 (slight barrel: lines bend near the \
                     border) unmodelled would move fx {}, k1 = +0.05 {} for these motions",
                    change(barrel_percent),
                    change(pincushion_percent)
                )
            }
            Warning::DistortionUncertain { percent, k1_sigma } => format!(
                "the lens distortion is known to k1 +- {k1_sigma:.4} only, which makes {percent:.1} % of uncertainty in fx"
            ),
            Warning::AssumptionOpen { assumption, twice_log_odds, fx_percent, widened } => format!(
                "assumed: {assumption}. The images do not exclude that it is otherwise (twice the logarithm of the odds {twice_log_odds:+.1}; fx \
                 would move by {fx_percent:+.2} %): the error bars allow for it, and are up to {widened:.1} times as wide"
            ),
            Warning::SingleMotion => {
                "one motion only: nothing checks that its axis is normal to the floor (1 degree off moves f by \
                                      several per cent)"
                    .into()
            }
            Warning::SingleAttitude { motions, doubt } => of_one_attitude(*motions, doubt.as_ref()),
            Warning::FloorsContradict { agree, contradict } => format!(
                "{contradict} pairs of images of different attitudes share a plane that cannot be the floor of both, {agree} one that \
                 can: the motions found may be a coincidence among views that tilt freely, and the camera wrong by more than its \
                 error bars"
            ),
            Warning::MotionAttitudeError { from, to, apart_deg, sigma_deg } => format!(
                "{from} and {to}: their attitudes differ by {apart_deg:.2} degrees, more than the {sigma_deg:.2} degrees of a view that \
                 the others show explain: the camera tilted between them, or they look at another plane"
            ),
            Warning::MotionLeftOut { from, to } => format!(
                "{from} and {to} were left out: with them no camera explains all motions together. The camera tilted between them, they \
                 look at another plane, or another motion is wrong that agrees with the rest by accident"
            ),
            Warning::ParallelHorizons { spread_deg } => format!(
                "the camera's roll varies by {spread_deg:.1} degrees only: the horizons are nearly parallel and the principal point \
                 across them is weakly determined"
            ),
            Warning::MotionsDisagree { chi_squared, degrees_of_freedom, widened } => format!(
                "the motions disagree on one camera by more than their noise (chi-squared {chi_squared:.1} for {degrees_of_freedom} \
                 degrees of freedom); standard deviations were widened by {widened:.1}. Likely causes: lens distortion, an axis off the \
                 floor's normal, or a wrong pair"
            ),
            Warning::NotRotations { chi_squared, degrees_of_freedom, widened } => format!(
                "the pairs are further from rotations about the optical centre than their noise (chi-squared {chi_squared:.1} for \
                 {degrees_of_freedom} degrees of freedom); standard deviations were widened by {widened:.1}, which does not cover the bias \
                 of a camera that moved between its images"
            ),
            Warning::PriorDecides { parameter, posterior_over_prior } => format!(
                "the images say little about {parameter}: its standard deviation is {:.0} % of what was assumed beforehand",
                100.0 * posterior_over_prior
            ),
            Warning::PicturesDepart { departure, sigma, .. } => departing(*departure, *sigma),
            Warning::FisheyeLens { .. } => "the lens is a fisheye's (equidistant, Kannala and Brandt): the images are a thousand times likelier with it \
                 than with the lens of Brown and Conrady, and its k1, k2 and k3 were estimated (as `cv2.fisheye` has them)"
                .to_string(),
            Warning::FocalLengthUnexpected { stated_px, percent } => unexpected(*stated_px, *percent),
            Warning::LensOffAxis { percent_of_distance, fx_percent } => format!(
                "the images are those of a camera turning on the spot, but show parallax: the lens was off the axis of turning, by about \
                 {percent_of_distance:.2} % of the distance of what it saw. fx may be wrong by {fx_percent:.2} % for it, which is in its error bar"
            ),
            Warning::PriorContradicted(conflict) => contradiction(conflict),
            Warning::StaticBackground { from, to, matches } => format!(
                "{from} and {to}: {matches} matches stand still, more than move; a background (or a part of the camera's carrier) that \
                 does not move was set aside"
            ),
            Warning::StillInAllImages { percent } => format!(
                "{percent:.1} % of what is seen stands still in all images (a part of the camera's carrier, a background, a date stamp); it was \
                 set aside, and the rest was matched"
            ),
            Warning::DuplicateImages { first, second } => {
                format!("{first} and {second} are the same image, which counts once")
            }
            Warning::StatedNoiseContradicted { exponent, twice_log_odds } => of_stated_noise(*exponent, *twice_log_odds),
            Warning::LargeUncertainty { percent } => {
                format!(
                    "fx is known to {percent:.1} % (one standard deviation) only; intervals this wide are approximate"
                )
            }
            Warning::NeighboursOnly { images } => {
                format!(
                    "{images} images: not all pairs were compared, but neighbours in the given order and, of pictures, those that look most alike"
                )
            }
            Warning::NotRefined { reason } => {
                format!(
                    "the joint refinement failed ({reason}); the answer is the linear method's, with its error bars"
                )
            }
            Warning::DistortionNotConverged { relative_change } => {
                format!("focal length and the given distortion did not converge (last change {relative_change:.1e})")
            }
            Warning::LargeAttitudeErrors { sigma_deg, checked_deg } => of_large_attitude_errors(*sigma_deg, *checked_deg),
            Warning::Other { message, .. } => message.clone(),
        }
    }

    /// What to do about it: any of these.
    pub(crate) fn remedies(&self) -> Vec<Remedy> {
        match self {
            Warning::DistortionNotModelled { .. } => vec![Remedy::EstimateLens, Remedy::GiveLensCoefficients],
            Warning::DistortionUncertain { .. } => {
                vec![Remedy::GiveLensCoefficients, Remedy::StateNoDistortion, Remedy::CoverCorners]
            }
            Warning::SingleMotion => vec![Remedy::MoreMotions],
            Warning::SingleAttitude { .. } => vec![Remedy::TiltOrRoll { deg: 20.0 }],
            Warning::FloorsContradict { .. } => vec![Remedy::NamePairs, Remedy::RetakeMotion],
            Warning::MotionLeftOut { .. } => vec![Remedy::RetakeMotion, Remedy::NamePairs],
            Warning::MotionAttitudeError { .. } => vec![Remedy::LeavePairOut, Remedy::RetakeMotion],
            Warning::ParallelHorizons { .. } => vec![Remedy::RollCamera { deg: 30.0 }],
            Warning::MotionsDisagree { .. } => {
                vec![Remedy::GiveLensCoefficients, Remedy::GiveAttitudeSigma, Remedy::NamePairs]
            }
            Warning::NotRotations { .. } => vec![Remedy::UseJointMethod, Remedy::EstimateLens],
            Warning::PriorDecides { .. } => vec![Remedy::VaryTiltAndRoll, Remedy::GiveValue],
            Warning::PriorContradicted(_) => vec![Remedy::GiveValue, Remedy::CheckImages],
            Warning::PicturesDepart { .. } => vec![Remedy::CheckImages],
            Warning::AssumptionOpen { .. } => vec![Remedy::VaryTiltAndRoll, Remedy::CheckImages],
            Warning::FocalLengthUnexpected { .. } => vec![Remedy::CheckImages, Remedy::NamePairs],
            // It was done already.
            Warning::FisheyeLens { .. } => Vec::new(),
            Warning::LensOffAxis { .. } => vec![Remedy::TurnAboutOpticalCentre, Remedy::TurnOverFloor],
            Warning::StaticBackground { .. } => vec![Remedy::MaskBackground],
            Warning::StillInAllImages { .. } => vec![Remedy::MaskBackground],
            Warning::DuplicateImages { .. } => vec![Remedy::RemoveDuplicate],
            // It was done already.
            Warning::StatedNoiseContradicted { .. } => Vec::new(),
            Warning::LargeUncertainty { .. } => vec![Remedy::ClearMotions],
            Warning::NeighboursOnly { .. } => vec![Remedy::ComparePairs],
            Warning::NotRefined { .. } => vec![Remedy::ReportFault],
            Warning::DistortionNotConverged { .. } => vec![Remedy::CheckLensCoefficients],
            Warning::LargeAttitudeErrors { .. } => {
                vec![Remedy::TurnAtLeast { deg: 30.0 }, Remedy::MoreMotionsThanPlanned, Remedy::SteadyCamera]
            }
            Warning::Other { .. } => Vec::new(),
        }
    }

    /// Finding and remedies as a front end words them.
    pub fn message(&self, wording: &dyn Wording) -> String {
        sentence(&self.finding(), &self.remedies(), wording)
    }
}

/// What is said of a plan whose attitudes vary by more than was checked.
fn of_large_attitude_errors(sigma_deg: f64, checked_deg: f64) -> String {
    format!(
        "tilt and roll vary by {sigma_deg} degrees, predictions are checked by simulation for {checked_deg} degrees. With much \
                 more, short turns may be refused: two attitudes that differ by 1.4 degrees put the axis of a 10 degree turn off by 8"
    )
}

/// What is said of deviations that the matches contradict.
fn of_stated_noise(exponent: f64, twice_log_odds: f64) -> String {
    let instead =
        if exponent > 0.0 { "their differences were halved" } else { "all matches were taken as equally precise" };
    format!(
        "the deviations stated of the matches (sigma_px) are not those that they have (twice the logarithm of the odds {twice_log_odds:+.0}): {instead}"
    )
}

/// What is said of motions of one attitude.
fn of_one_attitude(motions: usize, doubt: Option<&PrincipalPointDoubt>) -> String {
    let what = match doubt {
        None => "f depends on where the principal point is held".to_string(),
        Some(d) => format!(
            "the principal point can move along ({:.2}, {:.2}) by +-{:.1} px (one standard deviation), held there by the prior and the lens \
             alone, and fx with it by {:.2} %",
            d.direction[0], d.direction[1], d.sigma_px, d.f_percent
        ),
    };
    format!("{motions} motion{} of one attitude: {what}", if motions == 1 { "" } else { "s" })
}

/// What is said of a focal length that is not the one stated.
fn unexpected(stated_px: f64, percent: f64) -> String {
    format!(
        "the pictures state a focal length (Exif) of {stated_px:.0} px; the one found is {:.0} % {}: one of the two is wrong, or the pictures were \
         cropped",
        percent.abs(),
        if percent > 0.0 { "longer" } else { "shorter" }
    )
}

/// In what pictures depart from each other.
fn departing(departure: PictureDeparture, sigma: f64) -> String {
    match departure {
        PictureDeparture::FocalLength => format!(
            "the focal length is not the same in all pictures (standard deviation {sigma:.2} %): the lens was focused or zoomed between \
             them, or it breathes; fx and fy are their mean, with error bars that hold the spread"
        ),
        PictureDeparture::RowTurn => format!(
            "the pictures are bent as by a rolling shutter: the camera turned by about {sigma:.2} degrees while one was read out, which \
             was estimated"
        ),
        PictureDeparture::Shift => format!(
            "the pictures are shifted against each other (standard deviation {sigma:.1} px), as by a stabiliser or by cropping; cx and \
             cy are their mean, with error bars that hold the spread"
        ),
    }
}

/// What the images contradict, and what they say.
fn contradiction(c: &PriorConflict) -> String {
    let (unit, digits) = if c.parameter.is_in_pixels() { (" px", 1) } else { ("", 4) };
    let spread = if c.sigma > 0.0 { format!(" +- {:.digits$}", c.sigma) } else { String::new() };
    let cause = match c.parameter {
        PriorParameter::Aspect => ". Pixels that are not square, or pictures resized unequally, do that",
        PriorParameter::Cx | PriorParameter::Cy => ". Pictures that were cropped do that",
        PriorParameter::Skew => ". Pictures that were sheared or scanned do that",
        _ => "",
    };
    format!(
        "the images contradict what was assumed of {}, {:.digits$}{spread}{unit}: without that they say {:.digits$} +- {:.digits$}{unit} \
         ({:.0} deviations apart), and the camera was estimated without it{cause}",
        c.parameter,
        c.mean,
        c.found,
        c.found_sigma,
        c.standardised_distance(),
    )
}

/// In the library's own words.
impl std::fmt::Display for Warning {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.message(&crate::remedy::Plain))
    }
}

/// A warning as it is written: what it is, its numbers, and its words.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct WarningReport {
    /// Code and numbers.
    #[serde(flatten)]
    pub warning: Warning,
    /// What it means and what to do, as a front end words it.
    pub message: String,
    /// Codes of the remedies.
    pub remedies: Vec<&'static str>,
}

impl WarningReport {
    /// Of a warning.
    pub(crate) fn new(warning: &Warning, wording: &dyn Wording) -> Self {
        Self {
            warning: warning.clone(),
            message: warning.message(wording),
            remedies: warning.remedies().iter().map(Remedy::code).collect(),
        }
    }

    /// Of several.
    pub fn all(warnings: &[Warning], wording: &dyn Wording) -> Vec<Self> {
        warnings.iter().map(|w| Self::new(w, wording)).collect()
    }
}

/// A list of warnings in a file.
pub(crate) mod list {
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    use crate::{
        remedy::Plain,
        result::warning::{Warning, WarningReport},
    };

    /// As it may be read: with the numbers of this version, or by another version with words alone.
    #[derive(Deserialize)]
    #[serde(untagged)]
    enum Read {
        Known(Warning),
        Worded { code: String, message: String },
    }

    pub(crate) fn serialize<S: Serializer>(warnings: &[Warning], serializer: S) -> Result<S::Ok, S::Error> {
        WarningReport::all(warnings, &Plain).serialize(serializer)
    }

    pub(crate) fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<Warning>, D::Error> {
        let read = Vec::<Read>::deserialize(deserializer)?;
        let warning = |r| match r {
            Read::Known(warning) => warning,
            // Without its numbers it is known by its words.
            Read::Worded { code, message } => Warning::Other { code, message },
        };
        Ok(read.into_iter().map(warning).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn examples() -> Vec<Warning> {
        let doubt = PrincipalPointDoubt { direction: [0.6, 0.8], sigma_px: 3.25, f_percent: 0.1 };
        vec![
            Warning::DistortionNotModelled { pincushion_percent: Some(1.0), barrel_percent: None },
            Warning::DistortionUncertain { percent: 2.0, k1_sigma: 0.01 },
            Warning::SingleMotion,
            Warning::SingleAttitude { motions: 2, doubt: Some(doubt) },
            Warning::SingleAttitude { motions: 1, doubt: None },
            Warning::MotionAttitudeError { from: "a".into(), to: "b".into(), apart_deg: 1.0, sigma_deg: 0.1 },
            Warning::MotionLeftOut { from: "a".into(), to: "b".into() },
            Warning::FloorsContradict { agree: 1, contradict: 3 },
            Warning::ParallelHorizons { spread_deg: 2.0 },
            Warning::MotionsDisagree { chi_squared: 30.0, degrees_of_freedom: 4, widened: 2.7 },
            Warning::NotRotations { chi_squared: 30.0, degrees_of_freedom: 4, widened: 2.7 },
            Warning::PriorDecides { parameter: PriorParameter::Cy, posterior_over_prior: 0.9 },
            Warning::PriorContradicted(PriorConflict {
                parameter: PriorParameter::Aspect,
                mean: 1.0,
                sigma: 0.003,
                found: 1.09,
                found_sigma: 0.004,
                twice_log_odds: 200.0,
            }),
            Warning::FisheyeLens { twice_log_odds: 90.0 },
            Warning::FocalLengthUnexpected { stated_px: 900.0, percent: -20.0 },
            Warning::PicturesDepart { departure: PictureDeparture::RowTurn, sigma: 0.4, twice_log_odds: 90.0 },
            Warning::AssumptionOpen {
                assumption: "square pixels".into(),
                twice_log_odds: 4.0,
                fx_percent: 1.5,
                widened: 2.0,
            },
            Warning::LensOffAxis { percent_of_distance: 0.7, fx_percent: 1.2 },
            Warning::StaticBackground { from: "a".into(), to: "b".into(), matches: 40 },
            Warning::StillInAllImages { percent: 12.5 },
            Warning::DuplicateImages { first: "a".into(), second: "b".into() },
            Warning::StatedNoiseContradicted { exponent: 0.5, twice_log_odds: 90.0 },
            Warning::LargeUncertainty { percent: 7.0 },
            Warning::NeighboursOnly { images: 50 },
            Warning::NotRefined { reason: "no".into() },
            Warning::DistortionNotConverged { relative_change: 1e-3 },
            Warning::LargeAttitudeErrors { sigma_deg: 0.5, checked_deg: 0.1 },
        ]
    }

    #[derive(Debug, PartialEq, Serialize, Deserialize)]
    struct File {
        #[serde(with = "list")]
        warnings: Vec<Warning>,
    }

    #[test]
    fn every_warning_is_read_back_with_its_numbers() {
        let file = File { warnings: examples() };
        let text = serde_json::to_string(&file).unwrap();
        assert_eq!(serde_json::from_str::<File>(&text).unwrap(), file);
        let value: serde_json::Value = serde_json::from_str(&text).unwrap();
        for (written, warning) in value["warnings"].as_array().unwrap().iter().zip(&file.warnings) {
            assert_eq!(written["code"], warning.code());
            assert_eq!(written["message"], warning.to_string());
            assert_eq!(written["remedies"].as_array().unwrap().len(), warning.remedies().len());
        }
        assert_eq!(value["warnings"][0]["remedies"][0], "estimate_lens");
        assert_eq!(value["warnings"][3]["numbers"]["doubt"]["sigma_px"], 3.25);
    }

    #[test]
    fn a_warning_without_numbers_keeps_its_words() {
        for code in ["single_attitude", "unheard_of"] {
            let text = format!(r#"{{"warnings": [{{"code": "{code}", "message": "Beware"}}]}}"#);
            let file: File = serde_json::from_str(&text).unwrap();
            assert_eq!(file.warnings, [Warning::Other { code: code.into(), message: "Beware".into() }]);
            assert_eq!((file.warnings[0].code(), file.warnings[0].to_string()), (code, "Beware".to_string()));
            let again: File = serde_json::from_str(&serde_json::to_string(&file).unwrap()).unwrap();
            assert_eq!(again, file);
        }
    }
}
