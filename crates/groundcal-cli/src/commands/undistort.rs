//! `groundcal undistort`: images as an ideal lens would have taken them, the camera that belongs to them, and the maps.

use std::{fmt::Write, path::PathBuf};

use clap::{Args, ValueEnum};
use groundcal::{
    floor::undistort::{Fit, Undistortion},
    result::Camera,
    vision::resample::{Pyramid, resample},
};
use groundcal_io::{
    export::{undistorted, write_whole},
    import,
    inputs::find_images,
    names::stems,
    pictures::{self, PictureFormat, PictureReader},
    text::shown,
};

use crate::{
    args::{PictureFormatArg, ThreadsArg, camera_of},
    error::CliError,
    output,
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

    /// Kind of picture
    #[arg(long, value_enum, default_value_t = PictureFormatArg::Png)]
    pub(crate) format: PictureFormatArg,

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

/// Runs the command; what was left out is told on standard error.
pub(crate) fn run(args: &UndistortArgs) -> Result<(), CliError> {
    output::refuse_file(&args.out)?;
    let (text, notes) = output::on_threads(args.threads, || images_of(args))?;
    for note in notes {
        output::note(&note);
    }
    output::print(&text)
}

/// What is printed, with notes for standard error.
fn images_of(args: &UndistortArgs) -> Result<(String, Vec<String>), CliError> {
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
    let names = stems(&files);
    let targets: Vec<PathBuf> =
        names.iter().map(|n| args.out.join(format!("{n}.{}", PictureFormat::from(args.format).extension()))).collect();
    // Images that cannot be used, and results that would overwrite them, are refused before anything is written.
    let (reader, said) = PictureReader::new(&files, size)?;
    notes.extend(said.iter().map(ToString::to_string));
    for target in &targets {
        let same = |f: &PathBuf| matches!((f.canonicalize(), target.canonicalize()), (Ok(a), Ok(b)) if a == b);
        if let Some(file) = files.iter().find(|f| same(f)) {
            return Err(CliError::Usage(format!(
                "--out {}: {} would be overwritten. Name another folder",
                args.out.display(),
                file.display()
            )));
        }
    }
    output::make_folder(&args.out)?;

    let mut text = String::new();
    let new = undistortion.intrinsics();
    let original = Camera::new(size, &camera.intrinsics, camera.lens, imported.lens_source);
    let json = undistorted::camera_json(new, fit, &original)?;
    write_whole(&args.out.join("camera_undistorted.json"), json.as_bytes())?;
    let _ = writeln!(
        text,
        "camera of the undistorted images: fx {:.3}, fy {:.3}, cx {:.3}, cy {:.3} px ({})",
        new.fx,
        new.fy,
        new.cx,
        new.cy,
        args.out.join("camera_undistorted.json").display()
    );
    if args.maps {
        let [x, y] = undistortion.maps();
        for (name, map) in [("map_x.tiff", x), ("map_y.tiff", y)] {
            let path = args.out.join(name);
            write_whole(&path, &undistorted::map_tiff(&map, size, &path)?)?;
            let _ = writeln!(text, "{}", path.display());
        }
    }
    for (file, target) in files.iter().zip(&targets) {
        let picture = Pyramid::new(reader.read(file)?);
        let out = resample(&picture, size, |p| undistortion.source_pixel(p));
        write_whole(target, &pictures::encode(&out, args.format.into(), target)?)?;
        let _ = writeln!(text, "{}", target.display());
    }
    Ok((text, notes))
}
