//! Values of arguments that several commands share.

use std::path::Path;

use clap::{Args, ValueEnum};
use groundcal::{
    FeatureDensity, LensModel, MotionModel,
    geometry::{Camera, ImageSize},
    start::{Constraint, GivenPrior, PriorParameter},
};
use groundcal_io::{
    export::Format,
    import::ImportedCamera,
    limits::{MAX_PIXELS, SIDES_PX},
    pictures::PictureFormat,
    text::shown,
};

use crate::error::CliError;

/// `--threads`.
#[derive(Debug, Clone, Copy, Args)]
pub(crate) struct ThreadsArg {
    /// Threads [default: all processors, which are also the most that are used]; the result does not depend on it
    #[arg(long, value_name = "N", value_parser = parse_threads)]
    threads: Option<usize>,
}

/// Threads that do no harm on any machine; fewer processors than that are no reason to use fewer than was asked for.
const HARMLESS_THREADS: usize = 8;

impl ThreadsArg {
    /// How many were asked for, as far as they help.
    pub(crate) fn count(self) -> Option<usize> {
        let most = std::thread::available_parallelism().map_or(1, usize::from).max(HARMLESS_THREADS);
        self.threads.map(|n| n.min(most))
    }
}

fn parse_threads(text: &str) -> Result<usize, String> {
    let digits = !text.is_empty() && text.bytes().all(|b| b.is_ascii_digit());
    // More than any number holds is more than helps.
    let number = digits.then(|| text.parse().unwrap_or(usize::MAX)).filter(|n| *n > 0);
    number.ok_or_else(|| "expected a whole number from 1".into())
}

/// `--overwrite`.
#[derive(Debug, Clone, Copy, Args)]
pub(crate) struct OverwriteArg {
    /// Replace files in --out that no run of this program wrote, or that were changed since. Inputs are never replaced
    #[arg(long, requires = "out")]
    pub(crate) overwrite: bool,
}

/// [`LensModel`] on the command line.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum LensArg {
    /// Brown-Conrady (`radtan`), or a fisheye's where the images reach far from the axis and are a thousand times likelier so
    Auto,
    /// k1 and k2, with priors 0 +- 0.3, p1 and p2, with priors 0 +- 0.001: what the images do not tell of them stays at zero, with its
    /// error bar; k3 (prior 0 +- 0.3) where the residuals ask for it
    Radtan,
    /// The equidistant fisheye of Kannala and Brandt, k1 to k4, of 180 degrees and more
    Fisheye,
    /// Nothing: the lens has none
    None,
    /// k1, p1 and p2
    K1,
    /// The same as `auto`
    K1k2,
}

impl From<LensArg> for LensModel {
    fn from(value: LensArg) -> Self {
        match value {
            LensArg::None => LensModel::None,
            LensArg::K1 => LensModel::K1,
            LensArg::Radtan => LensModel::Radtan,
            LensArg::Fisheye => LensModel::Fisheye,
            LensArg::Auto | LensArg::K1k2 => LensModel::K1K2,
        }
    }
}

/// [`MotionModel`] on the command line.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum MotionArg {
    /// Whichever the pictures show; refused where nothing in them shows that an axis was normal to the plane
    Auto,
    /// Turns about the plane's normal, moved along the plane or not: you vouch that the camera did not tilt between the images of a motion
    PlaneNormal,
    /// Any motion before one plane, from hand-held pictures of a floor, a desk, a poster or a wall
    General,
    /// The camera turned on the spot, about any axes
    Turning,
}

impl From<MotionArg> for MotionModel {
    fn from(value: MotionArg) -> Self {
        match value {
            MotionArg::Auto => MotionModel::Auto,
            MotionArg::PlaneNormal => MotionModel::PlaneNormal,
            MotionArg::General => MotionModel::General,
            MotionArg::Turning => MotionModel::Turning,
        }
    }
}

/// [`FeatureDensity`] on the command line.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum FeaturesArg {
    /// At most 1200 an image, without an upsampled octave; all where these do not carry the answer
    Auto,
    /// All of them (see --max-features)
    Dense,
}

impl From<FeaturesArg> for FeatureDensity {
    fn from(value: FeaturesArg) -> Self {
        match value {
            FeaturesArg::Auto => FeatureDensity::Auto,
            FeaturesArg::Dense => FeatureDensity::Dense,
        }
    }
}

/// [`Constraint`] on the command line.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum ConstraintArg {
    /// Zero skew; priors on aspect (1 +- 0.003; +- 0.001 about a given one) and principal point (centre +- 5 % of the width;
    /// +- 1 % about a given one); 1 attitude or more
    Auto,
    /// Nothing: fx, fy, cx, cy, skew; 3 attitudes
    Full,
    /// No skew: fx, fy, cx, cy; 2 attitudes (3 if the roll never changes)
    ZeroSkew,
    /// No skew, known aspect ratio: f, cx, cy; 2 attitudes
    Square,
    /// No skew, known principal point: fx, fy; 1 attitude
    FixedPp,
    /// Known aspect ratio and principal point: f; 1 attitude
    Focal,
}

impl From<ConstraintArg> for Constraint {
    fn from(value: ConstraintArg) -> Self {
        match value {
            ConstraintArg::Auto => Constraint::Auto,
            ConstraintArg::Full => Constraint::Full,
            ConstraintArg::ZeroSkew => Constraint::ZeroSkew,
            ConstraintArg::Square => Constraint::Square,
            ConstraintArg::FixedPp => Constraint::FixedPrincipalPoint,
            ConstraintArg::Focal => Constraint::Focal,
        }
    }
}

/// `X,Y` in pixels.
pub(crate) fn parse_point(text: &str) -> Result<[f64; 2], String> {
    let (x, y) = text.split_once(',').ok_or("expected X,Y in pixels, for example 639.5,479.5")?;
    let number = |s: &str| s.trim().parse::<f64>().ok().filter(|v| v.is_finite());
    Ok([number(x).ok_or("X is not a number")?, number(y).ok_or("Y is not a number")?])
}

/// `NAME=VALUE+-SIGMA`.
pub(crate) fn parse_prior(text: &str) -> Result<GivenPrior, String> {
    let wrong = || format!("expected NAME=VALUE+-SIGMA, for example cx=320+-5, found {text}");
    let (name, value) = text.split_once('=').ok_or_else(wrong)?;
    let (mean, sigma) = value.split_once("+-").or_else(|| value.split_once('±')).ok_or_else(wrong)?;
    let known = PriorParameter::ALL.into_iter().find(|p| p.to_string() == name.trim());
    let parameter = known.ok_or_else(|| {
        let names = PriorParameter::ALL.map(|p| p.to_string());
        format!("{name} is none of {}", names.join(", "))
    })?;
    let number = |s: &str| s.trim().parse::<f64>().ok().filter(|v| v.is_finite()).ok_or_else(wrong);
    Ok(GivenPrior { parameter, mean: number(mean)?, sigma: number(sigma)? })
}

/// A length in metres, positive.
pub(crate) fn parse_height(text: &str) -> Result<f64, String> {
    let height = text.trim().parse::<f64>().ok().filter(|v| v.is_finite() && (1e-6..=1e6).contains(v));
    height.ok_or_else(|| "expected a height in metres from 0.000001 to 1000000, for example 1.45".into())
}

/// A standard deviation in pixels.
pub(crate) fn parse_sigma(text: &str) -> Result<f64, String> {
    let sigma = text.trim().parse::<f64>().ok().filter(|v| v.is_finite() && (0.0..=1e3).contains(v));
    sigma.ok_or_else(|| "expected pixels from 0 to 1000, for example 0.5".into())
}

/// A distance on the floor as `--floor-distance` has it.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct FloorDistance {
    /// The image in which it is seen.
    pub(crate) view: String,
    /// Its ends.
    pub(crate) pixels: [[f64; 2]; 2],
    /// Metres, and their standard deviation.
    pub(crate) metres: [f64; 2],
}

impl FloorDistance {
    /// From `VIEW X1,Y1 X2,Y2 METRES[+-SIGMA]`.
    pub(crate) fn parse(words: &[String]) -> Result<Self, String> {
        let [view, first, second, metres] = words else {
            return Err("expected VIEW X1,Y1 X2,Y2 METRES, for example 00a.jpg 412,380 655,410 1.20".into());
        };
        let (value, sigma) = match metres.split_once("+-").or_else(|| metres.split_once('±')) {
            Some((value, sigma)) => (value, sigma.trim().parse::<f64>().ok()),
            None => (metres.as_str(), Some(0.0)),
        };
        let value = parse_height(value).map_err(|_| format!("{metres} is no distance in metres"))?;
        let sigma = sigma
            .filter(|s| s.is_finite() && *s >= 0.0)
            .ok_or(format!("{metres} has no standard deviation in metres"))?;
        Ok(Self { view: view.clone(), pixels: [parse_point(first)?, parse_point(second)?], metres: [value, sigma] })
    }
}

/// `WxH` in pixels.
pub(crate) fn parse_size(text: &str) -> Result<ImageSize, String> {
    let (w, h) = text.split_once(['x', 'X']).ok_or("expected WxH in pixels, for example 1280x960")?;
    let side = |s: &str| s.trim().parse::<u64>().ok().filter(|v| SIDES_PX.contains(v));
    let wrong = || format!("width and height must be whole numbers from {} to {}", SIDES_PX.start(), SIDES_PX.end());
    let (w, h) = (side(w).ok_or_else(wrong)?, side(h).ok_or_else(wrong)?);
    if w * h > MAX_PIXELS {
        return Err(format!("images of at most {} megapixels are read", MAX_PIXELS / 1_000_000));
    }
    Ok(ImageSize::new(w as usize, h as usize))
}

/// [`PictureFormat`] on the command line.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum PictureFormatArg {
    /// PNG, transparent where nothing was seen
    Png,
    /// TIFF, zero where nothing was seen (floating point: not a number)
    Tiff,
    /// JPEG, white where nothing was seen
    Jpeg,
}

impl From<PictureFormatArg> for PictureFormat {
    fn from(value: PictureFormatArg) -> Self {
        match value {
            PictureFormatArg::Png => PictureFormat::Png,
            PictureFormatArg::Tiff => PictureFormat::Tiff,
            PictureFormatArg::Jpeg => PictureFormat::Jpeg,
        }
    }
}

/// [`Format`] on the command line.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum FormatArg {
    /// camera_opencv.yaml: OpenCV's FileStorage
    Opencv,
    /// camera_info.yaml: ROS camera_info
    Ros,
    /// camchain.yaml: Kalibr
    Kalibr,
    /// cameras.txt, images.txt, points3D.txt: COLMAP
    Colmap,
    /// transforms.json: nerfstudio and its relatives
    Nerfstudio,
    /// camera_matlab.csv: the numbers as MATLAB counts pixels
    Matlab,
}

impl From<FormatArg> for Format {
    fn from(value: FormatArg) -> Self {
        match value {
            FormatArg::Opencv => Format::Opencv,
            FormatArg::Ros => Format::Ros,
            FormatArg::Kalibr => Format::Kalibr,
            FormatArg::Colmap => Format::Colmap,
            FormatArg::Nerfstudio => Format::Nerfstudio,
            FormatArg::Matlab => Format::Matlab,
        }
    }
}

/// The camera of a file that has to say the size of its images.
pub(crate) fn camera_of(file: &Path, imported: &ImportedCamera) -> Result<Camera, CliError> {
    let size = imported.size.ok_or_else(|| {
        CliError::Input(format!(
            "{}: the size of the images is not said. Add image_width and image_height",
            shown(file)
        ))
    })?;
    Ok(Camera { size, intrinsics: imported.intrinsics, lens: imported.lens })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn threads_are_capped_at_what_helps() {
        let count = |text: &str| ThreadsArg { threads: Some(parse_threads(text).unwrap()) }.count();
        assert_eq!(count("3"), Some(3));
        assert_eq!(count("99999999999999999999999"), count("100000"));
        assert!(count("100000") < Some(10_000));
        for wrong in ["0", "", "-1", "+1", "two", "1.5"] {
            assert!(parse_threads(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn sizes_have_the_limits_of_images() {
        assert_eq!(parse_size("1280x960"), Ok(ImageSize::new(1280, 960)));
        assert!(parse_size("100000x100000").unwrap_err().contains("megapixels"));
        assert!(parse_size("1x960").unwrap_err().contains("from 2 to 100000"));
    }
}
