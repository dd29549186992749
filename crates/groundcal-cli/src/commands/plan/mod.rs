//! `groundcal plan`: which pictures to take, and how well the camera will be known from them.

mod after;
mod args;

use std::fmt::Write;

use clap::ValueEnum;
use groundcal::{
    calibrate::Options,
    geometry::{frame::Frame, intrinsics::Intrinsics, lens::Lens, size::ImageSize},
    plan::{
        PlanOptions, Planner,
        carriers::{Carrier, CarrierMotion, MAX_TURN_DEG, turns_up_to_deg},
        report::{ATTITUDE_SIGMA_DEG, PlanReport},
    },
};
use groundcal_io::{import::groundcal_json, outputs::Request};
use groundcal_report::{number::short, plan, terminal};

use crate::{
    args::DistortionArg,
    error::CliError,
    output::{self, Results, canvas_names},
    remedies::Flags,
};
use args::{DEFAULT_NOISE_PX, DEFAULT_POINTS};

pub(crate) use args::PlanArgs;

const DEFAULT_SIZE: ImageSize = ImageSize { width: 1280, height: 960 };

/// Makes the plan, writes the files of `--out` and prints it.
pub(crate) fn run(args: &PlanArgs) -> Result<(), CliError> {
    let results = begin(args)?;
    let report = report(args)?;
    let json = || {
        serde_json::to_string_pretty(&report)
            .map(|text| text + "\n")
            .map_err(|e| CliError::Other(format!("cannot write the plan as JSON: {e}")))
    };
    let mut finished = None;
    if let Some(results) = results {
        results.write_canvas("plan", &plan::figure(&report).layout())?;
        results.write("plan.json", json()?.as_bytes())?;
        finished = Some(results.finish()?);
    }
    output::print(&if args.json { json()? } else { plan::text(&report, &command(&report, args), terminal::WIDTH) })?;
    if let Some(finished) = finished {
        finished.tell();
    }
    Ok(())
}

/// The files of `--out`, if it is given, before the work.
fn begin(args: &PlanArgs) -> Result<Option<Results>, CliError> {
    let Some(out) = &args.out else { return Ok(None) };
    let names: Vec<String> = ["plan.json".to_string()].into_iter().chain(canvas_names("plan")).collect();
    let inputs: Vec<_> = args.after.as_deref().map(groundcal_json::file_of).into_iter().collect();
    let request = Request {
        folder: out,
        command: "plan",
        names: &names,
        inputs: &inputs,
        basis: None,
        overwrite: args.overwrite.overwrite,
    };
    Results::begin(&request).map(Some)
}

fn positive(name: &str, value: f64, limit: f64) -> Result<f64, CliError> {
    if value.is_finite() && value > 0.0 && value <= limit {
        return Ok(value);
    }
    Err(CliError::Usage(format!("{name} {value}: give a number above 0, at most {limit}")))
}

fn report(args: &PlanArgs) -> Result<PlanReport, CliError> {
    let carrier = Carrier::from(args.rig);
    let known = args.after.as_deref().map(after::read).transpose()?;
    let height_m = args.height_m.or(known.as_ref().and_then(|k| k.height_m())).unwrap_or(carrier.height_m());
    let motion = motion(args, carrier, height_m)?;
    let options = match &known {
        Some(known) => known.options(args, &motion)?,
        None => fresh(args, carrier, &motion)?,
    };
    let plan = Planner::new(&options, known.as_ref().map(|k| &k.covariance))?.plan()?;
    Ok(PlanReport::new(motion, &options, plan, &Flags))
}

/// How the carrier moves: as usual, but for what the arguments say.
fn motion(args: &PlanArgs, carrier: Carrier, height_m: f64) -> Result<CarrierMotion, CliError> {
    let usual = carrier.motion(positive("--height-m", height_m, 1e5)?);
    let max_turn = args.max_turn_deg.unwrap_or(MAX_TURN_DEG);
    if !(0.0..=180.0).contains(&max_turn) {
        return Err(CliError::Usage(format!("--max-turn-deg {max_turn}: give 0 to 180 degrees")));
    }
    let axis_offset_m = args.axis_offset_m.unwrap_or(usual.axis_offset_m);
    if !(axis_offset_m.is_finite() && (0.0..=1e5).contains(&axis_offset_m)) {
        return Err(CliError::Usage(format!("--axis-offset-m {axis_offset_m}: give 0 to 100000 metres")));
    }
    Ok(CarrierMotion {
        tilts_deg: args.tilts_deg.as_ref().map_or(usual.tilts_deg, |a| a.0.clone()),
        rolls_deg: args.rolls_deg.as_ref().map_or(usual.rolls_deg, |a| a.0.clone()),
        turns_deg: turns_up_to_deg(max_turn),
        axis_offset_m,
        reach_m: positive("--reach-m", args.reach_m.unwrap_or(usual.reach_m), 1e7)?,
        ..usual
    })
}

/// Without a calibration: a rough camera.
fn fresh(args: &PlanArgs, carrier: Carrier, motion: &CarrierMotion) -> Result<PlanOptions, CliError> {
    let size = args.image_size.unwrap_or(DEFAULT_SIZE);
    let width = size.width as f64;
    let f = match (args.f, args.hfov_deg) {
        (Some(f), _) => positive("--f", f, 1e7)?,
        (None, Some(degrees)) if (1.0..=170.0).contains(&degrees) => 0.5 * width / (0.5 * degrees).to_radians().tan(),
        (None, Some(degrees)) => return Err(CliError::Usage(format!("--hfov-deg {degrees}: give 1 to 170 degrees"))),
        (None, None) => width,
    };
    let [cx, cy] = Frame::new(size, args.principal_point).origin_px.into();
    Ok(PlanOptions {
        intrinsics: Intrinsics::square(f, cx, cy),
        lens: Lens::None,
        size,
        rig: motion.rig(),
        noise_px: args.noise_px.unwrap_or(DEFAULT_NOISE_PX),
        points: args.points.map_or(DEFAULT_POINTS, f64::from),
        motions: args.motions.unwrap_or(4) as usize,
        calibration: Options {
            constraint: args.constraint.into(),
            principal_point_px: args.principal_point,
            lens: args.distortion.into(),
            priors: args.prior.clone(),
            attitude_sigma_deg: Some(args.attitude_sigma_deg.unwrap_or(ATTITUDE_SIGMA_DEG)),
            height_sigma: Some(args.height_sigma.unwrap_or(carrier.height_sigma())),
            ..Options::default()
        },
    })
}

/// The command that calibrates from the pictures of the plan.
fn command(report: &PlanReport, args: &PlanArgs) -> String {
    let a = &report.assumed;
    let mut command = String::from("groundcal calibrate PICTURES/");
    if a.constraint != "auto" {
        let _ = write!(command, " --constraint {}", a.constraint);
    }
    if let Some([x, y]) = args.principal_point {
        let _ = write!(command, " --principal-point {x},{y}");
    }
    for p in &args.prior {
        let _ = write!(command, " --prior {}={}+-{}", p.parameter.name(), p.mean, p.sigma);
    }
    if let Some(lens) = args.distortion.to_possible_value().filter(|_| args.distortion != DistortionArg::Auto) {
        let _ = write!(command, " --distortion {}", lens.get_name());
    }
    if args.attitude_sigma_deg.is_some() {
        let _ = write!(command, " --attitude-sigma-deg {}", short(a.attitude_sigma_deg));
    }
    if args.height_sigma.is_some() {
        let _ = write!(command, " --height-sigma {}", a.height_sigma);
    }
    command
}
