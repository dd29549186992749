//! The command line.

use std::path::PathBuf;

use clap::{Args, Parser, Subcommand, ValueEnum};
use groundcal::{
    calibrate::{LensModel, Method},
    geometry::size::ImageSize,
    start::{
        absolute_conic::Constraint,
        linear_camera::{GivenPrior, PriorParameter},
    },
};
use groundcal_lab::studies::figure4::Study;

use crate::{
    compare::CompareArgs,
    experiment::ExperimentArgs,
    man::{CompletionsArgs, ManArgs},
    plan::PlanArgs,
    rectify::RectifyArgs,
    undistort::UndistortArgs,
};
use groundcal_io::export::Format;
use groundcal_io::pictures::PictureFormat;

/// Calibrate a camera from the floor it looks at, with no calibration target.
#[derive(Debug, Parser)]
#[command(
    name = "groundcal",
    version,
    about,
    propagate_version = true,
    after_help = "Example:
  groundcal calibrate photos/ --out result/

Exit codes: 0 a calibration, 2 wrong usage, 3 the images cannot determine what was asked, 4 unreadable or \
unusable input, 1 anything else."
)]
pub struct Cli {
    /// What to do.
    #[command(subcommand)]
    pub command: Command,
}

/// The commands.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Camera matrix with error bars from photographs (or matches) of a floor
    Calibrate(Box<CalibrateArgs>),
    /// Images with truth from a scene file
    Render(RenderArgs),
    /// Which pictures to take, and the error bars to expect; after a calibration, the next motions that improve it most
    Plan(Box<PlanArgs>),
    /// The simulation study of the paper: error of the focal length on synthetic matches, as table and figure
    Simulate(SimulateArgs),
    /// The four experiments of the paper on rendered scenes: tables of errors against exact truth
    Experiment(ExperimentArgs),
    /// Metric bird's-eye pictures of the floor: of each view, or a mosaic of all
    Rectify(RectifyArgs),
    /// Images without their lens distortion, and the maps for OpenCV
    Undistort(UndistortArgs),
    /// How far calibrations differ: parameters with significance, reprojection in pixels
    Compare(CompareArgs),
    /// Shell completions, on standard output
    Completions(CompletionsArgs),
    /// Manual pages
    Man(ManArgs),
}

/// `groundcal calibrate`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  groundcal calibrate photos/                      a folder: pairs are found
  groundcal calibrate 'shots/*.png' --constraint square --out result/
  groundcal calibrate matches.csv --image-size 1280x960 --constraint zero-skew --json

Take two or more images per camera attitude: turn the camera 15 to 60 degrees (and move it, if you like) over the floor \
without tilting it. Then tilt or roll it by 20 degrees or more and repeat.

Pixels: (0,0) is the centre of the top-left pixel. Exit codes: 0 a calibration, 2 wrong usage, 3 the images cannot \
determine what was asked, 4 unreadable or unusable input, 1 anything else.")]
pub struct CalibrateArgs {
    /// Folders, image files (JPEG, PNG, TIFF, WebP), glob patterns, or one matches.csv / tracks.csv
    #[arg(required = true, value_name = "INPUT")]
    pub inputs: Vec<String>,

    /// CSV of image pairs known to be turns about the floor's normal: image_a,image_b (default: they are found)
    #[arg(long, value_name = "FILE")]
    pub pairs: Option<PathBuf>,

    /// What to assume of the camera matrix
    #[arg(long, value_enum, default_value_t = ConstraintArg::Auto)]
    pub constraint: ConstraintArg,

    /// Principal point in pixels: held by `fixed-pp` and `focal`, centre of the prior of `auto` [default: image centre]
    #[arg(long, value_name = "X,Y", value_parser = parse_point, allow_hyphen_values = true)]
    pub principal_point: Option<[f64; 2]>,

    /// fy / fx: held by `square` and `focal`, centre of the prior of `auto` [default: 1]
    #[arg(long, value_name = "A", allow_negative_numbers = true)]
    pub aspect: Option<f64>,

    /// What is known of a parameter beforehand, as fx, aspect, cx, cy, skew, k1 or k2 = VALUE+-SIGMA in pixels (aspect, k1, k2: no
    /// unit); takes the place of the prior of `auto`. May be repeated
    #[arg(long, value_name = "NAME=VALUE+-SIGMA", value_parser = parse_prior)]
    pub prior: Vec<GivenPrior>,

    /// How the camera is estimated
    #[arg(long, value_enum, default_value_t = MethodArg::Joint)]
    pub method: MethodArg,

    /// Lens distortion: what is estimated of it (`none`: the error bars do not cover it)
    #[arg(long, value_enum, default_value_t = DistortionArg::Auto)]
    pub distortion: DistortionArg,

    /// Known radial distortion of the lens (Brown-Conrady, as OpenCV); it is undone before anything else, none is estimated
    #[arg(long, value_name = "K1", allow_hyphen_values = true)]
    pub k1: Option<f64>,

    /// Known radial distortion, fourth order
    #[arg(long, value_name = "K2", allow_hyphen_values = true)]
    pub k2: Option<f64>,

    /// How far the camera pitches and rolls by itself between views, standard deviation in degrees (0: not at all)
    /// [default: estimated from three attitudes on, else 0.1; 1.5 for a single motion before a background that stands still]
    #[arg(long, value_name = "DEG", allow_negative_numbers = true)]
    pub attitude_sigma_deg: Option<f64>,

    /// How far the camera's height over the floor strays between the views of an attitude, relative standard deviation (0: constant
    /// height; 0.3 and more: free) [default: estimated]
    #[arg(long, value_name = "S", allow_negative_numbers = true)]
    pub height_sigma: Option<f64>,

    /// Height of the camera over the floor in metres at the first view (of each set of views that common points connect): gives
    /// positions in metres [default: that height is 1]
    #[arg(long, value_name = "METRES", value_parser = parse_height, allow_negative_numbers = true)]
    pub camera_height: Option<f64>,

    /// Image size, for matches.csv and tracks.csv
    #[arg(long, value_name = "WxH", value_parser = parse_size)]
    pub image_size: Option<ImageSize>,

    /// Seed of all random choices
    #[arg(long, default_value_t = 0)]
    pub seed: u64,

    /// Most features of an image
    #[arg(long, value_name = "N", default_value_t = 3000, value_parser = clap::value_parser!(u32).range(50..=50_000))]
    pub max_features: u32,

    /// Write calibration.json, report.html and the camera in the formats of other programs into this folder (made if need be)
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,

    /// Formats written into --out beside calibration.json, separated by commas [default: all]
    #[arg(long, value_name = "NAME", value_enum, value_delimiter = ',', requires = "out")]
    pub format: Vec<FormatArg>,

    /// Leave out report.html, the page that shows the calibration
    #[arg(long, requires = "out")]
    pub no_report: bool,

    /// Print the calibration as JSON on standard output and nothing else there
    #[arg(long)]
    pub json: bool,

    /// Threads [default: all processors]; the result does not depend on it
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub threads: Option<u16>,

    /// List every pair and show how long each stage took (on standard error)
    #[arg(long, short)]
    pub verbose: bool,
}

/// `groundcal render`.
#[derive(Debug, Args)]
#[command(after_help = "Example:
  groundcal render examples/tripod/scene.toml --out rendered/")]
pub struct RenderArgs {
    /// Scene description (TOML; see docs/formats.md)
    pub scene: PathBuf,

    /// Folder for the images and truth.json (made if need be)
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
}

/// `groundcal simulate`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  groundcal simulate noise --out study/            noise.csv, noise.svg, noise.png
  groundcal simulate all --trials 1000 --out study/

The nominal condition: noise 1 px, rotation axis 0.2 m behind the optical centre, turns of 15 degrees, three motions, the \
camera 3 m over the floor, 200 matches a motion (and 20), 1280 x 960 pixels, f about 1000 px.")]
pub struct SimulateArgs {
    /// What is varied
    #[arg(value_enum)]
    pub study: StudyArg,

    /// Trials for each point of a curve
    #[arg(long, value_name = "N", default_value_t = 200, value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    pub trials: u32,

    /// Seed of all random choices
    #[arg(long, default_value_t = 0)]
    pub seed: u64,

    /// Threads [default: all processors]; the result does not depend on it
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub threads: Option<u16>,

    /// Folder for STUDY.csv, STUDY.svg and STUDY.png (made if need be)
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
}

/// [`Study`] on the command line.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum StudyArg {
    /// Image noise, 0 to 4 px
    Noise,
    /// Distance of the rotation axis, 0.02 to 100 m
    Offset,
    /// Number of motions, 3 to 20
    Motions,
    /// Rotation angle, 2 to 60 degrees, about axes through the optical centre and 0.2 m from it
    Angle,
    /// Angle between rotation axis and floor normal, 0 to 10 degrees
    Axis,
    /// Radial distortion of one parameter, by noise 0 to 1 px: bias of the closed form and of minimising
    Radial,
    /// One motion carried into other views against motions of their own, turning by 1 to 45 degrees
    Transfer,
    /// All subsets of 2, 3, 4 and 6 out of twelve motions: predicted and true errors
    Subsets,
    /// All eight
    All,
}

impl StudyArg {
    /// Those of the paper's figure 4 that are meant.
    pub fn studies(self) -> Vec<Study> {
        match self {
            StudyArg::Noise => vec![Study::Noise],
            StudyArg::Offset => vec![Study::Offset],
            StudyArg::Motions => vec![Study::Motions],
            StudyArg::Angle => vec![Study::Angle],
            StudyArg::Axis => vec![Study::Axis],
            StudyArg::Radial | StudyArg::Transfer | StudyArg::Subsets => Vec::new(),
            StudyArg::All => Study::ALL.to_vec(),
        }
    }

    /// Its name on the command line.
    pub fn name(self) -> Option<&'static str> {
        match self {
            StudyArg::Radial => Some("radial"),
            StudyArg::Transfer => Some("transfer"),
            StudyArg::Subsets => Some("subsets"),
            StudyArg::All => None,
            five => five.studies().first().map(|s| s.name()),
        }
    }
}

/// [`LensModel`] on the command line.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum DistortionArg {
    /// k1 and k2, with priors 0 +- 0.3: what the images do not tell of them stays at zero, with its error bar
    Auto,
    /// Nothing: the lens has none
    None,
    /// k1
    K1,
    /// k1 and k2
    K1k2,
}

impl From<DistortionArg> for LensModel {
    fn from(value: DistortionArg) -> Self {
        match value {
            DistortionArg::None => LensModel::None,
            DistortionArg::K1 => LensModel::K1,
            DistortionArg::Auto | DistortionArg::K1k2 => LensModel::K1K2,
        }
    }
}

/// [`Method`] on the command line.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum MethodArg {
    /// Camera, lens, attitudes, views and points refined together
    Joint,
    /// The closed form of Knight, Zisserman & Reid (2003) and maximum likelihood of its circular points, each motion by itself
    Linear,
    /// All pairs taken for rotations about the optical centre (Hartley 1994): a pan-tilt camera on the spot, no floor needed. Wrong
    /// for a camera that moves; `joint` recognises cameras that turn on the spot by itself
    Rotating,
}

impl From<MethodArg> for Method {
    fn from(value: MethodArg) -> Self {
        match value {
            MethodArg::Joint => Method::Joint,
            MethodArg::Linear => Method::Linear,
            MethodArg::Rotating => Method::Rotating,
        }
    }
}

/// [`Constraint`] on the command line.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum ConstraintArg {
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

pub fn parse_point(text: &str) -> Result<[f64; 2], String> {
    let (x, y) = text.split_once(',').ok_or("expected X,Y in pixels, for example 639.5,479.5")?;
    let number = |s: &str| s.trim().parse::<f64>().ok().filter(|v| v.is_finite());
    Ok([number(x).ok_or("X is not a number")?, number(y).ok_or("Y is not a number")?])
}

pub fn parse_prior(text: &str) -> Result<GivenPrior, String> {
    let wrong = || format!("expected NAME=VALUE+-SIGMA, for example cx=320+-5, found {text}");
    let (name, value) = text.split_once('=').ok_or_else(wrong)?;
    let (mean, sigma) = value.split_once("+-").or_else(|| value.split_once('±')).ok_or_else(wrong)?;
    let known = PriorParameter::ALL.into_iter().find(|p| p.name() == name.trim());
    let parameter = known.ok_or_else(|| {
        let names: Vec<&str> = PriorParameter::ALL.iter().map(|p| p.name()).collect();
        format!("{name} is none of {}", names.join(", "))
    })?;
    let number = |s: &str| s.trim().parse::<f64>().ok().filter(|v| v.is_finite()).ok_or_else(wrong);
    Ok(GivenPrior { parameter, mean: number(mean)?, sigma: number(sigma)? })
}

/// A length in metres, positive.
pub fn parse_height(text: &str) -> Result<f64, String> {
    let height = text.trim().parse::<f64>().ok().filter(|v| v.is_finite() && (1e-6..=1e6).contains(v));
    height.ok_or_else(|| "expected a height in metres from 0.000001 to 1000000, for example 1.45".into())
}

pub fn parse_size(text: &str) -> Result<ImageSize, String> {
    let (w, h) = text.split_once(['x', 'X']).ok_or("expected WxH in pixels, for example 1280x960")?;
    let side = |s: &str| s.trim().parse::<usize>().ok().filter(|v| (2..=100_000).contains(v));
    let wrong = "width and height must be whole numbers from 2 to 100000";
    Ok(ImageSize::new(side(w).ok_or(wrong)?, side(h).ok_or(wrong)?))
}

/// [`Format`] on the command line.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum FormatArg {
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

/// [`PictureFormat`] on the command line.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum PictureFormatArg {
    /// PNG, transparent where nothing was seen
    Png,
    /// JPEG, white where nothing was seen
    Jpeg,
}

impl From<PictureFormatArg> for PictureFormat {
    fn from(value: PictureFormatArg) -> Self {
        match value {
            PictureFormatArg::Png => PictureFormat::Png,
            PictureFormatArg::Jpeg => PictureFormat::Jpeg,
        }
    }
}
