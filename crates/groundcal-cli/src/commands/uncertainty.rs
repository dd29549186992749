//! `groundcal uncertainty`: how sure a camera is of where things appear, over the image.

use std::path::PathBuf;

use clap::Args;
use groundcal::{
    floor::{CELLS, projection_uncertainty},
    result::{Calibration, ProjectionUncertainty},
};
use groundcal_io::{import::groundcal_json, outputs::Request, text::shown};
use groundcal_report::uncertainty;

use crate::{
    args::OverwriteArg,
    error::CliError,
    output::{self, Results, canvas_names},
    terminal,
};

/// `groundcal uncertainty`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  groundcal uncertainty result/
  groundcal uncertainty result/ --cells 32 --out uncertainty/

For each part of the image the distance in pixels by which the camera shows things in the wrong place, root mean square: points far away, after \
the rotation that hides most of the error, and points of the floor, after the pose that does. It is what the standard deviations of the single numbers \
amount to together. Exit codes: 0 a grid, 2 wrong usage, 4 unreadable or unusable input, 1 anything else.")]
pub(crate) struct UncertaintyArgs {
    /// calibration.json, or the folder it is in
    #[arg(value_name = "CALIBRATION")]
    pub(crate) calibration: PathBuf,

    /// Cells along the longer side of the image
    #[arg(long, value_name = "N", default_value_t = CELLS as u32, value_parser = clap::value_parser!(u32).range(2..=200))]
    pub(crate) cells: u32,

    /// Folder for uncertainty.json and the pictures distant.svg and .png, floor.svg and .png (made if need be)
    #[arg(long, value_name = "DIR")]
    pub(crate) out: Option<PathBuf>,

    #[command(flatten)]
    pub(crate) overwrite: OverwriteArg,

    /// Print the grid as JSON on standard output and nothing else there
    #[arg(long)]
    pub(crate) json: bool,
}

const JSON: &str = "uncertainty.json";

/// Prints the grid and writes the files of `--out`.
pub(crate) fn run(args: &UncertaintyArgs) -> Result<(), CliError> {
    let calibration = groundcal_json::read(&args.calibration)?;
    let grid = projection_uncertainty(&calibration, args.cells as usize).ok_or_else(|| {
        CliError::Input(format!(
            "{}: it has no error bars, or every number of its camera was held",
            shown(&args.calibration)
        ))
    })?;
    let json = serde_json::to_string_pretty(&grid)
        .map(|text| text + "\n")
        .map_err(|e| CliError::Other(format!("cannot write the grid as JSON: {e}")))?;
    let finished = match &args.out {
        Some(out) => Some(write(args, out, &calibration, &grid, &json)?),
        None => None,
    };
    if args.json {
        output::print_json(&json)?;
    } else {
        output::print(&uncertainty::text(&grid, calibration.camera.image_size, terminal::width()))?;
    }
    if let Some(finished) = finished {
        finished.tell();
    }
    Ok(())
}

fn write(
    args: &UncertaintyArgs,
    out: &std::path::Path,
    c: &Calibration,
    grid: &ProjectionUncertainty,
    json: &str,
) -> Result<output::Finished, CliError> {
    output::check_folder(out)?;
    let pictures = uncertainty::figures(grid, c.camera.image_size);
    let names: Vec<String> =
        [JSON.to_string()].into_iter().chain(pictures.iter().flat_map(|(name, _)| canvas_names(name))).collect();
    let results = Results::begin(&Request {
        folder: out,
        command: "uncertainty",
        names: &names,
        inputs: &[groundcal_json::file_of(&args.calibration)],
        basis: None,
        overwrite: args.overwrite.overwrite,
    })?;
    results.write(JSON, json.as_bytes())?;
    for (name, picture) in &pictures {
        results.write_canvas(name, picture)?;
    }
    results.finish()
}
