//! `groundcal plan`: which pictures to take, and how well the camera will be known from them.

mod after;
mod text;

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use groundcal::{
    calibrate::Options,
    geometry::{distortion::Distortion, intrinsics::Intrinsics, size::ImageSize},
    plan::{HEIGHT_SIGMA, Plan, PlanOptions, PlannedMotion, Planner, Prediction, Rig, Start},
    result::{Prior, Warning, WarningReport},
    start::linear_camera::GivenPrior,
};
use serde::Serialize;

use crate::{
    args::{ConstraintArg, DistortionArg, parse_point, parse_prior, parse_size},
    error::CliError,
    remedies::Flags,
};
use groundcal_io::export;
use groundcal_report::plot::{Curve, Figure, Marker, Panel, Style, png, svg};

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
pub struct PlanArgs {
    /// What carries the camera: default values of the options below
    #[arg(long, value_enum, default_value_t = RigArg::Tripod)]
    pub rig: RigArg,

    /// Improve this calibration (calibration.json, or the folder it is in): camera, error bars, noise and matches come from it
    #[arg(long, value_name = "FILE", conflicts_with_all = ["image_size", "f", "hfov_deg", "principal_point", "constraint", "distortion", "prior"])]
    pub after: Option<PathBuf>,

    /// Image size [default: 1280x960]
    #[arg(long, value_name = "WxH", value_parser = parse_size)]
    pub image_size: Option<ImageSize>,

    /// Rough focal length in pixels [default: the image width]
    #[arg(long, value_name = "PX", allow_negative_numbers = true)]
    pub f: Option<f64>,

    /// Rough horizontal field of view in degrees, instead of --f
    #[arg(long, value_name = "DEG", conflicts_with = "f", allow_negative_numbers = true)]
    pub hfov_deg: Option<f64>,

    /// Principal point in pixels, as `calibrate` is going to be told [default: image centre]
    #[arg(long, value_name = "X,Y", value_parser = parse_point, allow_hyphen_values = true)]
    pub principal_point: Option<[f64; 2]>,

    /// Tilts the camera can have, degrees below the horizon: a list 20,35,50 or a range FROM:TO:STEP
    /// [default: tripod 20:60:10, pan-head 10:60:10, drone 30:60:15, robot 30]
    #[arg(long, value_name = "LIST", value_parser = parse_angles, allow_hyphen_values = true)]
    pub tilts_deg: Option<Angles>,

    /// Rolls the camera can have, degrees, positive with its right-hand side down [default: tripod -40:40:20, others 0]
    #[arg(long, value_name = "LIST", value_parser = parse_angles, allow_hyphen_values = true)]
    pub rolls_deg: Option<Angles>,

    /// Largest turn between two pictures [default: 60]
    #[arg(long, value_name = "DEG", allow_negative_numbers = true)]
    pub max_turn_deg: Option<f64>,

    /// Height of the camera over the floor [default: tripod 1.5, pan-head 2.5, robot 0.5, drone 10]
    #[arg(long, value_name = "M", allow_negative_numbers = true)]
    pub height_m: Option<f64>,

    /// Distance from the camera back to the axis it turns about [default: tripod 0.1, pan-head 0.05, robot 0.2, drone 0]
    #[arg(long, value_name = "M", allow_negative_numbers = true)]
    pub axis_offset_m: Option<f64>,

    /// How far away the floor can still be matched [default: 10 camera heights]
    #[arg(long, value_name = "M", allow_negative_numbers = true)]
    pub reach_m: Option<f64>,

    /// Standard deviation of each coordinate of a match, pixels [default: 0.3; after a calibration: as there]
    #[arg(long, value_name = "PX", allow_negative_numbers = true)]
    pub noise_px: Option<f64>,

    /// Matches of two pictures that show the same floor from border to border [default: 300; after a calibration: as there]
    #[arg(long, value_name = "N")]
    pub points: Option<u32>,

    /// Motions (two pictures each) to plan [default: 4; after a calibration: 2]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=50))]
    pub motions: Option<u32>,

    /// What `calibrate` is going to assume of the camera matrix
    #[arg(long, value_enum, default_value_t = ConstraintArg::Auto)]
    pub constraint: ConstraintArg,

    /// What is known of a parameter beforehand, as for `calibrate`. May be repeated
    #[arg(long, value_name = "NAME=VALUE+-SIGMA", value_parser = parse_prior)]
    pub prior: Vec<GivenPrior>,

    /// What `calibrate` is going to estimate of the lens distortion
    #[arg(long, value_enum, default_value_t = DistortionArg::Auto)]
    pub distortion: DistortionArg,

    /// How far the camera pitches and rolls by itself between views, standard deviation in degrees
    /// [default: 0.1; after a calibration: as there]
    #[arg(long, value_name = "DEG", allow_negative_numbers = true)]
    pub attitude_sigma_deg: Option<f64>,

    /// How far its height strays, relative standard deviation [default: 0.001; drone 0.02; after a calibration: as there]
    #[arg(long, value_name = "S", allow_negative_numbers = true)]
    pub height_sigma: Option<f64>,

    /// Write plan.json and a figure of the error of f against the number of motions, plan.svg and plan.png, into this folder
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,

    /// Print the plan as JSON on standard output and nothing else there
    #[arg(long)]
    pub json: bool,
}

/// What carries the camera.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum RigArg {
    /// Tilts and rolls by hand; turned about its column or lifted and put down again
    Tripod,
    /// Turns and tilts, without roll
    PanHead,
    /// One attitude; turns on the spot or drives curves
    Robot,
    /// A gimbal that tilts; turns while it hovers
    Drone,
}

/// Default values of a rig.
struct Carrier {
    name: &'static str,
    tilts_deg: &'static [f64],
    rolls_deg: &'static [f64],
    height_m: f64,
    axis_offset_m: f64,
    height_sigma: f64,
}

impl RigArg {
    fn carrier(self) -> Carrier {
        let tripod = Carrier {
            name: "tripod",
            tilts_deg: &[20.0, 30.0, 40.0, 50.0, 60.0],
            rolls_deg: &[-40.0, -20.0, 0.0, 20.0, 40.0],
            height_m: 1.5,
            axis_offset_m: 0.1,
            height_sigma: HEIGHT_SIGMA,
        };
        let level = Carrier { rolls_deg: &[0.0], ..tripod };
        match self {
            RigArg::Tripod => Carrier { rolls_deg: &[-40.0, -20.0, 0.0, 20.0, 40.0], ..level },
            RigArg::PanHead => Carrier {
                name: "pan head",
                tilts_deg: &[10.0, 20.0, 30.0, 40.0, 50.0, 60.0],
                height_m: 2.5,
                axis_offset_m: 0.05,
                ..level
            },
            RigArg::Robot => Carrier { name: "robot", tilts_deg: &[30.0], height_m: 0.5, axis_offset_m: 0.2, ..level },
            RigArg::Drone => Carrier {
                name: "drone",
                tilts_deg: &[30.0, 45.0, 60.0],
                height_m: 10.0,
                axis_offset_m: 0.0,
                height_sigma: 0.02,
                ..level
            },
        }
    }
}

/// Turns that are tried, degrees, as far as the rig turns.
const TURNS_DEG: [f64; 8] = [5.0, 10.0, 15.0, 20.0, 30.0, 45.0, 60.0, 90.0];
/// Largest of them unless said otherwise.
const MAX_TURN_DEG: f64 = 60.0;
/// Default distance to which the floor can be matched, heights: it is seen under 6 degrees there.
const REACH_HEIGHTS: f64 = 10.0;
const DEFAULT_SIZE: ImageSize = ImageSize { width: 1280, height: 960 };
const DEFAULT_NOISE_PX: f64 = 0.3;
const DEFAULT_POINTS: f64 = 300.0;
/// How far attitudes stray where nothing is said: what `calibrate` takes until the motions tell it.
const ATTITUDE_SIGMA_DEG: f64 = 0.1;

/// Strays up to which predictions were held against simulated calibrations (crates/groundcal/tests/plan.rs), with a margin.
const CHECKED_SIGMA_DEG: f64 = 0.15;
/// Angles in degrees.
#[derive(Debug, Clone, PartialEq)]
pub struct Angles(Vec<f64>);

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

/// Everything that is written as JSON.
#[derive(Debug, Serialize)]
pub struct Report {
    format_version: u32,
    rig: RigReport,
    assumed: Assumed,
    /// The camera as known from the calibration given; `null` without one.
    before: Option<Prediction>,
    motions: Vec<PlannedMotion>,
    priors: Vec<Prior>,
    warnings: Vec<WarningReport>,
}

/// How the camera can move.
#[derive(Debug, Serialize)]
struct RigReport {
    name: &'static str,
    tilts_deg: Vec<f64>,
    rolls_deg: Vec<f64>,
    turns_deg: Vec<f64>,
    height_m: f64,
    axis_offset_m: f64,
    reach_m: f64,
}

/// What the error bars rest on.
#[derive(Debug, Serialize)]
struct Assumed {
    image_size: [usize; 2],
    fx: f64,
    fy: f64,
    cx: f64,
    cy: f64,
    noise_px: f64,
    points: f64,
    motions: usize,
    constraint: &'static str,
    attitude_sigma_deg: f64,
    height_sigma: f64,
}

/// Makes the plan, writes the files of `--out` and gives the text for standard output.
pub fn run(args: &PlanArgs) -> Result<String, CliError> {
    let report = report(args)?;
    let json = || {
        serde_json::to_string_pretty(&report)
            .map(|text| text + "\n")
            .map_err(|e| CliError::Other(format!("cannot write the plan as JSON: {e}")))
    };
    if let Some(out) = &args.out {
        crate::refuse_file(out)?;
        std::fs::create_dir_all(out)
            .map_err(|e| CliError::Other(format!("cannot make the folder {}: {e}", out.display())))?;
        let canvas = figure(&report).layout();
        export::write_whole(&out.join("plan.svg"), svg::document(&canvas).as_bytes())?;
        export::write_whole(&out.join("plan.png"), &png::encode(&canvas, PNG_SCALE).map_err(CliError::Other)?)?;
        export::write_whole(&out.join("plan.json"), json()?.as_bytes())?;
    }
    if args.json { json() } else { Ok(text::page(&report, args)) }
}

/// Pixels of the PNG for one of the SVG: sharp on dense screens.
const PNG_SCALE: f64 = 2.0;

fn positive(name: &str, value: f64, limit: f64) -> Result<f64, CliError> {
    if value.is_finite() && value > 0.0 && value <= limit {
        return Ok(value);
    }
    Err(CliError::Usage(format!("{name} {value}: give a number above 0, at most {limit}")))
}

fn report(args: &PlanArgs) -> Result<Report, CliError> {
    let carrier = args.rig.carrier();
    let known = args.after.as_deref().map(after::read).transpose()?;
    let height_m = args.height_m.or(known.as_ref().and_then(|k| k.height_m())).unwrap_or(carrier.height_m);
    let rig = rig(args, &carrier, height_m)?;
    let start: Option<Start> = known.as_ref().map(|k| k.covariance);
    let options = match &known {
        Some(known) => known.options(args, &rig)?,
        None => fresh(args, &carrier, &rig)?,
    };
    let plan: Plan = Planner::new(&options, start.as_ref())?.plan()?;
    let k = &options.intrinsics;
    let mut warnings = plan.warnings;
    let attitude_sigma_deg = options.calibration.attitude_sigma_deg.unwrap_or(ATTITUDE_SIGMA_DEG);
    if attitude_sigma_deg > CHECKED_SIGMA_DEG {
        warnings.push(Warning::LargeStrays { sigma_deg: attitude_sigma_deg, checked_deg: 0.1 });
    }
    Ok(Report {
        format_version: 1,
        assumed: Assumed {
            image_size: [options.size.width, options.size.height],
            fx: k.fx,
            fy: k.fy,
            cx: k.cx,
            cy: k.cy,
            noise_px: options.noise_px,
            points: options.points,
            motions: options.motions,
            constraint: options.calibration.constraint.name(),
            attitude_sigma_deg,
            height_sigma: options.calibration.height_sigma.unwrap_or(HEIGHT_SIGMA),
        },
        rig,
        before: plan.before,
        motions: plan.motions,
        priors: plan.priors,
        warnings: WarningReport::all(&warnings, &Flags),
    })
}

fn rig(args: &PlanArgs, carrier: &Carrier, height_m: f64) -> Result<RigReport, CliError> {
    let angles = |given: &Option<Angles>, usual: &[f64]| given.as_ref().map_or(usual.to_vec(), |a| a.0.clone());
    let height_m = positive("--height-m", height_m, 1e5)?;
    let max_turn = args.max_turn_deg.unwrap_or(MAX_TURN_DEG);
    if !(0.0..=180.0).contains(&max_turn) {
        return Err(CliError::Usage(format!("--max-turn-deg {max_turn}: give 0 to 180 degrees")));
    }
    let mut turns_deg: Vec<f64> = TURNS_DEG.into_iter().filter(|t| *t <= max_turn).collect();
    if turns_deg.is_empty() {
        turns_deg.push(max_turn);
    }
    let axis_offset_m = args.axis_offset_m.unwrap_or(carrier.axis_offset_m);
    if !(axis_offset_m.is_finite() && (0.0..=1e5).contains(&axis_offset_m)) {
        return Err(CliError::Usage(format!("--axis-offset-m {axis_offset_m}: give 0 to 100000 metres")));
    }
    Ok(RigReport {
        name: carrier.name,
        tilts_deg: angles(&args.tilts_deg, carrier.tilts_deg),
        rolls_deg: angles(&args.rolls_deg, carrier.rolls_deg),
        turns_deg,
        height_m,
        axis_offset_m,
        reach_m: positive("--reach-m", args.reach_m.unwrap_or(REACH_HEIGHTS * height_m), 1e7)?,
    })
}

impl RigReport {
    fn rig(&self) -> Rig {
        let radians = |values: &[f64]| values.iter().map(|v| v.to_radians()).collect();
        Rig {
            pitches_down_rad: radians(&self.tilts_deg),
            rolls_rad: radians(&self.rolls_deg),
            turns_rad: radians(&self.turns_deg),
            axis_offset: self.axis_offset_m / self.height_m,
            reach: self.reach_m / self.height_m,
        }
    }
}

/// Without a calibration: a rough camera.
fn fresh(args: &PlanArgs, carrier: &Carrier, rig: &RigReport) -> Result<PlanOptions, CliError> {
    let size = args.image_size.unwrap_or(DEFAULT_SIZE);
    let width = size.width as f64;
    let f = match (args.f, args.hfov_deg) {
        (Some(f), _) => positive("--f", f, 1e7)?,
        (None, Some(degrees)) if (1.0..=170.0).contains(&degrees) => 0.5 * width / (0.5 * degrees).to_radians().tan(),
        (None, Some(degrees)) => return Err(CliError::Usage(format!("--hfov-deg {degrees}: give 1 to 170 degrees"))),
        (None, None) => width,
    };
    let [cx, cy] = args.principal_point.unwrap_or(size.centre_px());
    Ok(PlanOptions {
        intrinsics: Intrinsics::square(f, cx, cy),
        distortion: Distortion::default(),
        size,
        rig: rig.rig(),
        noise_px: args.noise_px.unwrap_or(DEFAULT_NOISE_PX),
        points: args.points.map_or(DEFAULT_POINTS, f64::from),
        motions: args.motions.unwrap_or(4) as usize,
        calibration: Options {
            constraint: args.constraint.into(),
            principal_point_px: args.principal_point,
            lens: args.distortion.into(),
            priors: args.prior.clone(),
            attitude_sigma_deg: Some(args.attitude_sigma_deg.unwrap_or(ATTITUDE_SIGMA_DEG)),
            height_sigma: Some(args.height_sigma.unwrap_or(carrier.height_sigma)),
            ..Options::default()
        },
    })
}

/// Predicted standard deviation of f against the number of motions.
fn figure(report: &Report) -> Figure {
    let style = Style { color: [0, 90, 160], width: 2.0, dash: &[], marker: Some(Marker::Circle), filled: true };
    let before = report.before.iter().map(|p| [0.0, p.f_percent]);
    let after = report
        .motions
        .iter()
        .enumerate()
        .map(|(i, m)| [(i + 1) as f64, m.after.as_ref().map_or(f64::INFINITY, |p| p.f_percent)]);
    let points = before.chain(after).collect();
    let a = &report.assumed;
    Figure {
        title: format!("Expected error of the focal length, {}", report.rig.name),
        x_label: if report.before.is_some() { "motions added" } else { "motions" }.into(),
        y_label: "standard deviation of f, %".into(),
        x_log: false,
        rows: vec![vec![Panel { title: String::new(), curves: vec![Curve { style, points, band: Vec::new() }] }]],
        legend: vec![(style, "predicted".into())],
        notes: vec![
            format!(
                "{} x {} px, f about {:.0} px; noise {} px, {:.0} matches to a full picture; attitude sigma {} deg",
                a.image_size[0],
                a.image_size[1],
                a.fx,
                text::short(a.noise_px),
                a.points,
                text::short(a.attitude_sigma_deg)
            ),
            "A cross at the upper edge: not determined yet.".into(),
        ],
    }
}
