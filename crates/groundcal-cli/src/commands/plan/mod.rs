//! `groundcal plan`: which pictures to take, and how well the camera will be known from them.

mod after;
mod args;
mod text;

use groundcal::{
    calibrate::Options,
    geometry::{distortion::Distortion, intrinsics::Intrinsics, size::ImageSize},
    plan::{
        PlanOptions, Planner,
        carriers::{Carrier, CarrierMotion, MAX_TURN_DEG, turns_up_to_deg},
        report::{ATTITUDE_SIGMA_DEG, PlanReport},
    },
};
use groundcal_io::export::write_whole;
use groundcal_report::plot::{Curve, Figure, Marker, Panel, Style};

use crate::{error::CliError, output};
use args::{DEFAULT_NOISE_PX, DEFAULT_POINTS};

pub(crate) use args::PlanArgs;

const DEFAULT_SIZE: ImageSize = ImageSize { width: 1280, height: 960 };

/// Makes the plan, writes the files of `--out` and prints it.
pub(crate) fn run(args: &PlanArgs) -> Result<(), CliError> {
    let report = report(args)?;
    let json = || {
        serde_json::to_string_pretty(&report)
            .map(|text| text + "\n")
            .map_err(|e| CliError::Other(format!("cannot write the plan as JSON: {e}")))
    };
    if let Some(out) = &args.out {
        output::refuse_file(out)?;
        output::make_folder(out)?;
        output::write_figure(out, "plan", &figure(&report))?;
        write_whole(&out.join("plan.json"), json()?.as_bytes())?;
    }
    output::print(&if args.json { json()? } else { text::page(&report, args) })
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
    Ok(PlanReport::new(motion, &options, plan))
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
    let [cx, cy] = args.principal_point.unwrap_or(size.centre_px());
    Ok(PlanOptions {
        intrinsics: Intrinsics::square(f, cx, cy),
        distortion: Distortion::default(),
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

/// Predicted standard deviation of f against the number of motions.
fn figure(report: &PlanReport) -> Figure {
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
