//! Arguments of `groundcal plan`.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use groundcal::{geometry::ImageSize, plan::Carrier, start::GivenPrior};

use crate::args::{ConstraintArg, LensArg, OverwriteArg, parse_point, parse_prior, parse_size};

/// `groundcal plan`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  groundcal plan                                           a tripod and any camera
  groundcal plan --rig pan-head --image-size 1920x1080 --hfov-deg 70
  groundcal plan --rig robot --tilts-deg 20 --height-m 0.4 --noise-px 0.1
  groundcal plan --after result/calibration.json           what to add to a calibration

The standard deviations are those `groundcal calibrate` would report, to first order, if the pictures show the floor as assumed. They \
scale with the noise where that rules them. Exit codes: 0 a plan, 2 wrong usage, 3 no motion of the rig can tell what is asked, \
4 unreadable or unusable input, 1 anything else.")]
pub(crate) struct PlanArgs {
    /// What carries the camera: default values of the options below
    #[arg(long, value_enum, default_value_t = RigArg::Tripod)]
    pub(crate) rig: RigArg,

    /// Improve this calibration (calibration.json, or the folder it is in): camera, error bars, noise and matches come from it
    #[arg(long, value_name = "FILE", conflicts_with_all = ["image_size", "f", "hfov_deg", "principal_point", "constraint", "lens", "prior"])]
    pub(crate) after: Option<PathBuf>,

    /// Image size [default: 1280x960]
    #[arg(long, value_name = "WxH", value_parser = parse_size)]
    pub(crate) image_size: Option<ImageSize>,

    /// Rough focal length in pixels [default: the image width]
    #[arg(long, value_name = "PX", allow_negative_numbers = true)]
    pub(crate) f: Option<f64>,

    /// Rough horizontal field of view in degrees, instead of --f
    #[arg(long, value_name = "DEG", conflicts_with = "f", allow_negative_numbers = true)]
    pub(crate) hfov_deg: Option<f64>,

    /// Principal point in pixels, as `calibrate` is going to be told [default: image centre]
    #[arg(long, value_name = "X,Y", value_parser = parse_point, allow_hyphen_values = true)]
    pub(crate) principal_point: Option<[f64; 2]>,

    /// Tilts the camera can have, degrees below the horizon: a list 20,35,50 or a range FROM:TO:STEP
    /// [default: tripod 20:60:10, pan-head 10:60:10, drone 30:60:15, robot 30]
    #[arg(long, value_name = "LIST", value_parser = parse_angles, allow_hyphen_values = true)]
    pub(crate) tilts_deg: Option<Angles>,

    /// Rolls the camera can have, degrees, positive with its right-hand side down [default: tripod -40:40:20, others 0]
    #[arg(long, value_name = "LIST", value_parser = parse_angles, allow_hyphen_values = true)]
    pub(crate) rolls_deg: Option<Angles>,

    /// Largest turn between two pictures [default: 60]
    #[arg(long, value_name = "DEG", allow_negative_numbers = true)]
    pub(crate) max_turn_deg: Option<f64>,

    /// Height of the camera over the floor [default: tripod 1.5, pan-head 2.5, robot 0.5, drone 10]
    #[arg(long, value_name = "M", allow_negative_numbers = true)]
    pub(crate) height_m: Option<f64>,

    /// Distance from the camera back to the axis it turns about [default: tripod 0.1, pan-head 0.05, robot 0.2, drone 0]
    #[arg(long, value_name = "M", allow_negative_numbers = true)]
    pub(crate) axis_offset_m: Option<f64>,

    /// How far away the floor can still be matched [default: 10 camera heights]
    #[arg(long, value_name = "M", allow_negative_numbers = true)]
    pub(crate) reach_m: Option<f64>,

    /// Standard deviation of each coordinate of a match, pixels [default: 0.3; after a calibration: as there]
    #[arg(long, value_name = "PX", allow_negative_numbers = true)]
    pub(crate) noise_px: Option<f64>,

    /// Matches of two pictures that show the same floor from border to border [default: 300; after a calibration: as there]
    #[arg(long, value_name = "N")]
    pub(crate) points: Option<u32>,

    /// Motions (two pictures each) to plan [default: 4; after a calibration: 2]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    pub(crate) motions: Option<u32>,

    /// What `calibrate` is going to assume of the camera matrix
    #[arg(long, value_enum, default_value_t = ConstraintArg::Auto)]
    pub(crate) constraint: ConstraintArg,

    /// What is known of a parameter beforehand, as for `calibrate`. May be repeated
    #[arg(long, value_name = "NAME=VALUE+-SIGMA", value_parser = parse_prior)]
    pub(crate) prior: Vec<GivenPrior>,

    /// What `calibrate` is going to estimate of the lens distortion
    #[arg(long, visible_alias = "distortion", value_name = "MODEL", value_enum, default_value_t = LensArg::Auto)]
    pub(crate) lens: LensArg,

    /// How far the camera pitches and rolls by itself between views, standard deviation in degrees
    /// [default: 0.1; after a calibration: as there]
    #[arg(long, value_name = "DEG", allow_negative_numbers = true)]
    pub(crate) attitude_sigma_deg: Option<f64>,

    /// How far its height varies, relative standard deviation [default: 0.001; drone 0.02; after a calibration: as there]
    #[arg(long, value_name = "S", allow_negative_numbers = true)]
    pub(crate) height_sigma: Option<f64>,

    /// Write plan.json and a figure of the error of f against the number of motions, plan.svg and plan.png, into this folder
    #[arg(long, value_name = "DIR")]
    pub(crate) out: Option<PathBuf>,

    #[command(flatten)]
    pub(crate) overwrite: OverwriteArg,

    /// Print the plan as JSON on standard output and nothing else there
    #[arg(long)]
    pub(crate) json: bool,
}

/// What carries the camera.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum RigArg {
    /// Tilts and rolls by hand; turned about its column or lifted and put down again
    Tripod,
    /// Turns and tilts, without roll
    PanHead,
    /// One attitude; turns on the spot or drives curves
    Robot,
    /// A gimbal that tilts; turns while it hovers
    Drone,
}

impl From<RigArg> for Carrier {
    fn from(value: RigArg) -> Self {
        match value {
            RigArg::Tripod => Carrier::Tripod,
            RigArg::PanHead => Carrier::PanHead,
            RigArg::Robot => Carrier::Robot,
            RigArg::Drone => Carrier::Drone,
        }
    }
}

/// Angles in degrees.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Angles(pub(crate) Vec<f64>);

fn parse_angles(text: &str) -> Result<Angles, String> {
    let number = |s: &str| {
        let value = s.trim().parse::<f64>().ok().filter(|v| v.is_finite() && v.abs() <= 180.0);
        value.ok_or_else(|| {
            format!("{s:?} is no angle from -180 to 180 degrees; expected a list 20,35,50 or a range 20:60:10")
        })
    };
    let parts: Vec<&str> = text.split(':').collect();
    let values = match parts[..] {
        [from, to, step] => {
            let (from, to, step) = (number(from)?, number(to)?, number(step)?);
            if step <= 0.0 || to < from {
                return Err(format!("the range {text} must go up in steps greater than 0"));
            }
            let count = ((to - from) / step + 1e-9).floor() as usize + 1;
            if count > 50 {
                return Err(format!("the range {text} has {count} angles: 50 are the most"));
            }
            (0..count).map(|i| from + i as f64 * step).collect()
        }
        [list] => list.split(',').map(number).collect::<Result<Vec<f64>, String>>()?,
        _ => return Err("expected a list 20,35,50 or a range FROM:TO:STEP".into()),
    };
    Ok(Angles(values))
}
