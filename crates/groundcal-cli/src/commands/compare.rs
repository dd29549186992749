//! `groundcal compare`: how far calibrations differ, in their parameters and in pixels.

use std::path::PathBuf;

use clap::Args;
use groundcal::geometry::ImageSize;

use crate::{
    args::OverwriteArg,
    error::CliError,
    output::{self, Finished, Results, canvas_names},
    terminal,
};
use groundcal_io::{
    import::{self, ImportedCamera},
    outputs::Request,
    text::{name_text, shown},
};
use groundcal_report::{
    compare::{self, CompareError},
    comparison,
    plot::Field,
};

/// `groundcal compare`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  groundcal compare result/calibration.json examples/tripod/truth.json
  groundcal compare result/ old/camera_info.yaml sparse/cameras.txt --out comparison/
  groundcal compare result/ camchain.yaml#cam1 --json

Reads calibration.json and truth.json of this program (or the folder they are in), OpenCV YAML and XML, ROS camera_info, Kalibr \
camchain.yaml, COLMAP cameras.txt and nerfstudio transforms.json, fisheye lenses among them; the content tells the format. FILE#NAME names one camera of \
several. Each camera is compared with the first. One whose images have another size, but the same shape, is scaled to it.

The reprojection difference is what remains when the second camera is turned to fit the first best, as it is for everybody who \
estimates the camera's pose with it.")]
pub(crate) struct CompareArgs {
    /// Two or more files of cameras; each is compared with the first
    #[arg(required = true, num_args = 2.., value_name = "FILE")]
    pub(crate) files: Vec<PathBuf>,

    /// Folder for comparison.json and the pictures difference_N.svg and .png (made if need be)
    #[arg(long, value_name = "DIR")]
    pub(crate) out: Option<PathBuf>,

    #[command(flatten)]
    pub(crate) overwrite: OverwriteArg,

    /// Print the comparison as JSON on standard output and nothing else there
    #[arg(long)]
    pub(crate) json: bool,
}

/// Compares, writes the files of `--out` and prints the comparison; what was left out is told on standard error.
pub(crate) fn run(args: &CompareArgs) -> Result<(), CliError> {
    let results = begin(args)?;
    let (text, notes, finished) = compared(args, results)?;
    for note in notes {
        output::note(&note);
    }
    if args.json {
        output::print_json(&text)?
    } else {
        output::print(&text)?
    }
    if let Some(finished) = finished {
        finished.tell();
    }
    Ok(())
}

/// The files of `--out`, if it is given, before the work.
fn begin(args: &CompareArgs) -> Result<Option<Results>, CliError> {
    let Some(out) = &args.out else { return Ok(None) };
    let pictures = (1..args.files.len()).flat_map(|i| canvas_names(&picture(i)));
    let names: Vec<String> = [JSON.to_string()].into_iter().chain(pictures).collect();
    let inputs: Vec<PathBuf> = args.files.iter().map(import::camera_file).collect();
    let request = Request {
        folder: out,
        command: "compare",
        names: &names,
        inputs: &inputs,
        basis: None,
        overwrite: args.overwrite.overwrite,
    };
    Results::begin(&request).map(Some)
}

/// The comparison's file.
const JSON: &str = "comparison.json";

/// Name of the picture of a camera after the first, without its ending.
fn picture(camera: usize) -> String {
    format!("difference_{camera}")
}

/// What goes to standard output, notes for standard error, and what was written.
fn compared(args: &CompareArgs, results: Option<Results>) -> Result<(String, Vec<String>, Option<Finished>), CliError> {
    let cameras = args.files.iter().map(import::read_camera).collect::<Result<Vec<ImportedCamera>, _>>()?;
    let names: Vec<String> = args.files.iter().map(|f| name_text(f.as_os_str())).collect();
    let of = |(file, camera): (&PathBuf, &ImportedCamera)| {
        camera.notes.iter().map(|n| format!("{}: {n}", shown(file))).collect::<Vec<_>>()
    };
    let notes: Vec<String> = args.files.iter().zip(&cameras).flat_map(of).collect();
    let named = cameras.into_iter().zip(&names).map(|(camera, name)| compare::Camera {
        name: name.clone(),
        format: camera.format,
        size: camera.size,
        intrinsics: camera.intrinsics,
        lens: camera.lens,
        covariance: camera.covariance,
    });
    let (all, differences) = compare::compare(&named.collect::<Vec<_>>()).map_err(|e| cannot(&names, e))?;
    let [width, height] = all.reference.image_size;
    let size = ImageSize::new(width, height);
    let of_others = names[1..].iter().zip(&differences).filter(|_| args.out.is_some());
    let pictures: Vec<Field> =
        of_others.map(|(name, difference)| comparison::figure(&names[0], name, size, difference)).collect();
    let json = serde_json::to_string_pretty(&all)
        .map(|text| text + "\n")
        .map_err(|e| CliError::Other(format!("cannot write the comparison as JSON: {e}")))?;
    let finished = results.map(|results| write_files(results, &json, &pictures)).transpose()?;
    if args.json {
        return Ok((json, notes, finished));
    }
    Ok((comparison::text(&all, terminal::width()), notes, finished))
}

fn write_files(results: Results, json: &str, pictures: &[Field]) -> Result<Finished, CliError> {
    for (i, field) in pictures.iter().enumerate() {
        results.write_canvas(&picture(i + 1), &field.layout())?;
    }
    results.write(JSON, json.as_bytes())?;
    results.finish()
}

fn cannot(names: &[String], error: CompareError) -> CliError {
    let both = |i: usize| format!("{} and {}", names[0], names[i]);
    match error {
        CompareError::NoSize => CliError::Input(format!(
            "{}: none of the files says the size of the images. Add image_width and image_height to one",
            names.join(", ")
        )),
        CompareError::Shapes(i, what) => CliError::Input(format!("{}: {what}", both(i))),
        CompareError::Camera(i, error) => CliError::of_input(&both(i), error),
    }
}
