//! `groundcal undistort`: images as an ideal lens would have taken them, the camera that belongs to them, and the maps.

use std::{
    fmt::Write,
    path::{Path, PathBuf},
};

use clap::{Args, ValueEnum};
use groundcal::{
    floor::{Fit, Undistortion},
    result::Camera,
    vision::{Pyramid, Raster, resample},
};
use groundcal_io::{
    export::undistorted,
    import,
    inputs::find_images,
    names::stems,
    outputs::{Request, sha256},
    pictures::{self, Encode, Picture, PictureFormat, PictureReader},
    text::shown,
};

use crate::{
    args::{OverwriteArg, PictureFormatArg, ThreadsArg, camera_of},
    error::CliError,
    output::{self, Finished, Results},
};

/// `groundcal undistort`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  groundcal calibrate photos/ --out result/
  groundcal undistort result/ photos/ --out straight/
  groundcal undistort result/ photos/ --out straight/ --fit crop --maps
  groundcal undistort camchain.yaml#cam0 fisheye/ --out flat/ --fov 100

straight/camera_undistorted.json is the camera of the new images (no distortion). With --maps, map_x.tiff and map_y.tiff \
hold for each pixel of a new image the pixel of the original one, for cv2.remap (docs/formats.md). Exit codes: 0 images, 2 \
wrong usage, 4 unreadable or unusable input, 1 anything else.")]
pub(crate) struct UndistortArgs {
    /// calibration.json of `groundcal calibrate --out` or the folder it is in, or a camera file that `groundcal compare` reads
    #[arg(value_name = "CAMERA")]
    pub(crate) calibration: PathBuf,

    /// Images of the camera: folders, files, glob patterns (none with --maps alone)
    #[arg(value_name = "IMAGES", required_unless_present = "maps")]
    pub(crate) inputs: Vec<PathBuf>,

    /// Folder for the images (made if need be)
    #[arg(long, value_name = "DIR")]
    pub(crate) out: PathBuf,

    /// Which part of the undistorted scene is shown
    #[arg(long, value_enum, default_value_t = FitArg::Same)]
    pub(crate) fit: FitArg,

    /// Field of view of the new images from the left side to the right, degrees, instead of --fit
    #[arg(long, value_name = "DEG", conflicts_with = "fit", value_parser = parse_field_of_view)]
    pub(crate) fov: Option<f64>,

    /// Also write map_x.tiff and map_y.tiff
    #[arg(long)]
    pub(crate) maps: bool,

    /// Kind of picture [default: png; 16-bit TIFF and floating point stay TIFF]
    #[arg(long, value_enum)]
    pub(crate) format: Option<PictureFormatArg>,

    #[command(flatten)]
    pub(crate) overwrite: OverwriteArg,

    #[command(flatten)]
    pub(crate) threads: ThreadsArg,
}

/// [`Fit`] on the command line.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum FitArg {
    /// The same camera matrix
    Same,
    /// Everything the originals show, with empty borders
    All,
    /// As much as leaves no empty border
    Crop,
}

impl From<FitArg> for Fit {
    fn from(value: FitArg) -> Self {
        match value {
            FitArg::Same => Fit::Same,
            FitArg::All => Fit::All,
            FitArg::Crop => Fit::Crop,
        }
    }
}

/// Degrees, as a flat image can have them.
fn parse_field_of_view(text: &str) -> Result<f64, String> {
    let degrees = text.trim().parse::<f64>().ok().filter(|v| (1.0..=175.0).contains(v));
    degrees.ok_or_else(|| "expected degrees from 1 to 175, for example 100".into())
}

/// The camera's file and the maps' names.
const CAMERA: &str = "camera_undistorted.json";
const MAPS: [&str; 2] = ["map_x", "map_y"];

/// Runs the command; what was left out is told on standard error.
pub(crate) fn run(args: &UndistortArgs) -> Result<(), CliError> {
    output::check_folder(&args.out)?;
    let (text, notes, finished) = output::on_threads(args.threads, || images_of(args))?;
    for note in notes {
        output::note(&note);
    }
    output::print(&text)?;
    finished.tell();
    Ok(())
}

/// What is printed, notes for standard error, and what was written.
fn images_of(args: &UndistortArgs) -> Result<(String, Vec<String>, Finished), CliError> {
    let imported = import::read_camera(&args.calibration)?;
    let camera = camera_of(&args.calibration, &imported)?;
    let size = camera.size;
    let fit = match args.fov {
        Some(degrees) => Fit::FieldOfView { horizontal_rad: degrees.to_radians() },
        None => args.fit.into(),
    };
    let undistortion = Undistortion::new(&camera, fit).map_err(|e| CliError::of_file(&args.calibration, e))?;
    let mut notes = imported.notes.clone();
    if camera.lens.is_none() && args.fov.is_none() {
        notes.push(format!(
            "{}: the lens has no distortion there; the images stay as they are",
            shown(&args.calibration)
        ));
    }
    let files = if args.inputs.is_empty() { Vec::new() } else { find_images(&args.inputs)? };
    // Images that cannot be used, and results that would overwrite something, are refused before anything is written.
    let (reader, said) = PictureReader::new(&files, size, args.format.map(PictureFormat::from), false)?;
    notes.extend(said.iter().map(ToString::to_string));
    let new = undistortion.intrinsics();
    let original = Camera::new(size, &camera.intrinsics, camera.lens, imported.lens_source);
    let json = undistorted::camera_json(new, fit, &original)?;
    let maps: Vec<String> = MAPS.iter().filter(|_| args.maps).map(|m| format!("{m}.tiff")).collect();
    let targets: Vec<String> = stems(&files, &MAPS)
        .iter()
        .enumerate()
        .map(|(i, stem)| format!("{stem}.{}", reader.format(i).extension()))
        .collect();
    let names: Vec<String> = [CAMERA.to_string()].into_iter().chain(maps.clone()).chain(targets.clone()).collect();
    let inputs: Vec<PathBuf> = files.iter().cloned().chain([import::camera_file(&args.calibration)]).collect();
    let results = Results::begin(&Request {
        folder: &args.out,
        command: "undistort",
        names: &names,
        inputs: &inputs,
        // Images of one camera may come one after the other.
        basis: Some(&sha256(json.as_bytes())),
        overwrite: args.overwrite.overwrite,
    })?;

    let mut text = String::new();
    results.write(CAMERA, json.as_bytes())?;
    // Writing to a string cannot fail.
    let _ = writeln!(
        text,
        "camera of the undistorted images: fx {:.3}, fy {:.3}, cx {:.3}, cy {:.3} px ({})",
        new.fx,
        new.fy,
        new.cx,
        new.cy,
        args.out.join(CAMERA).display()
    );
    for (name, map) in maps.iter().zip(undistortion.maps()) {
        let path = args.out.join(name);
        results.write(name, &undistorted::map_tiff(&map, size, &path)?)?;
        let _ = writeln!(text, "{}", path.display());
    }
    for (i, name) in targets.iter().enumerate() {
        output::go_on()?;
        let path = args.out.join(name);
        let format = reader.format(i);
        let bytes = match reader.read(i)? {
            Picture::U8(picture) => straightened(picture, &undistortion, format, &path),
            Picture::U16(picture) => straightened(picture, &undistortion, format, &path),
            Picture::F32(picture) => straightened(picture, &undistortion, format, &path),
        }?;
        results.write(name, &bytes)?;
        let _ = writeln!(text, "{}", path.display());
    }
    Ok((text, notes, results.finish()?))
}

/// A picture's file without distortion.
fn straightened<T: Encode>(
    picture: Raster<T>,
    undistortion: &Undistortion,
    format: PictureFormat,
    path: &Path,
) -> Result<Vec<u8>, CliError> {
    let size = picture.size();
    let out = resample(&Pyramid::new(picture), size, |p| undistortion.source_pixel(p));
    Ok(pictures::encode(&out, format, path)?)
}
