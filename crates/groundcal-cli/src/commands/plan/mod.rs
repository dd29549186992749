//! `groundcal plan`: which pictures to take, and how well the camera will be known from them.

mod args;

use std::fmt::Write;

use clap::ValueEnum;
use groundcal::plan::{PlanReport, PlanRequest, RequestError};
use groundcal_io::{import::groundcal_json, outputs::Request};
use groundcal_report::{number::short, plan};

use crate::{
    args::LensArg,
    error::CliError,
    output::{self, Results, canvas_names},
    remedies::Flags,
    terminal,
};
pub(crate) use args::PlanArgs;

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
    if args.json {
        output::print_json(&json()?)?;
    } else {
        output::print(&plan::text(&report, &then(&report, args), terminal::width()))?;
    }
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

fn report(args: &PlanArgs) -> Result<PlanReport, CliError> {
    let known = args.after.as_deref().map(groundcal_json::read).transpose()?;
    let request = PlanRequest {
        carrier: args.rig.into(),
        image_size: args.image_size,
        f_px: args.f,
        hfov_deg: args.hfov_deg,
        principal_point_px: args.principal_point,
        tilts_deg: args.tilts_deg.as_ref().map(|a| a.0.clone()),
        rolls_deg: args.rolls_deg.as_ref().map(|a| a.0.clone()),
        max_turn_deg: args.max_turn_deg,
        height_m: args.height_m,
        axis_offset_m: args.axis_offset_m,
        reach_m: args.reach_m,
        noise_px: args.noise_px,
        points: args.points.map(f64::from),
        motions: args.motions.map(|n| n as usize),
        constraint: args.constraint.into(),
        priors: args.prior.clone(),
        lens: args.lens.into(),
        attitude_sigma_deg: args.attitude_sigma_deg,
        height_sigma: args.height_sigma,
    };
    request.report(known.as_ref(), &Flags).map_err(|error| match (error, &args.after) {
        (RequestError::OutOfRange { field, value, expected }, _) => {
            CliError::Usage(format!("--{} {value}: give {expected}", field.replace('_', "-")))
        }
        (RequestError::OfCalibration(error), Some(path)) => CliError::of_file(path, error),
        (RequestError::Plan(error), Some(path)) => CliError::of_file_and_options(path, error),
        (RequestError::OfCalibration(error) | RequestError::Plan(error), None) => error.into(),
    })
}

/// The commands for the pictures of the plan.
fn then(report: &PlanReport, args: &PlanArgs) -> String {
    let a = &report.assumed;
    let mut command = String::from("groundcal calibrate PICTURES/");
    if a.constraint != "auto" {
        let _ = write!(command, " --constraint {}", a.constraint);
    }
    if let Some([x, y]) = args.principal_point {
        let _ = write!(command, " --principal-point {x},{y}");
    }
    for p in &args.prior {
        let _ = write!(command, " --prior {}={}+-{}", p.parameter, p.mean, p.sigma);
    }
    if let Some(lens) = args.lens.to_possible_value().filter(|_| args.lens != LensArg::Auto) {
        let _ = write!(command, " --lens {}", lens.get_name());
    }
    if args.attitude_sigma_deg.is_some() {
        let _ = write!(command, " --attitude-sigma-deg {}", short(a.attitude_sigma_deg));
    }
    if args.height_sigma.is_some() {
        let _ = write!(command, " --height-sigma {}", a.height_sigma);
    }
    let all = if report.before.is_some() { " (old and new pictures together)" } else { "" };
    format!(
        "Then: {command} --out result/{all}\nand:  groundcal plan --rig {} --after result/",
        report.rig.name.replace(' ', "-")
    )
}
