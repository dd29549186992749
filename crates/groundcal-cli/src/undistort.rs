//! `groundcal undistort`: images as an ideal lens would have taken them, the camera that belongs to them, and the maps.

use std::{
    fmt::Write,
    io::Cursor,
    path::{Path, PathBuf},
};

use crate::args::PictureFormatArg;
use clap::{Args, ValueEnum};
use groundcal::{
    floor::undistort::{Fit, Undistortion},
    geometry::{distortion::Distortion, size::ImageSize},
    result::{
        Camera, LensSource, PixelCentre,
        calibration::{FORMAT_VERSION, SCHEMA_VERSION},
    },
    vision::resample::{Pyramid, resample},
};
use serde::Serialize;
use tiff::encoder::{TiffEncoder, colortype::Gray32Float};

use crate::error::CliError;
use groundcal_io::{
    export::write_whole,
    import::groundcal_json,
    pictures::{self, PictureFormat},
};

/// `groundcal undistort`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  groundcal calibrate photos/ --out result/
  groundcal undistort result/ photos/ --out straight/
  groundcal undistort result/ photos/ --out straight/ --fit crop --maps

straight/camera_undistorted.json is the camera of the new images (no distortion). With --maps, map_x.tiff and map_y.tiff \
hold for each pixel of a new image the pixel of the original one, for cv2.remap (docs/formats.md). Exit codes: 0 images, 2 \
wrong usage, 4 unreadable or unusable input, 1 anything else.")]
pub struct UndistortArgs {
    /// calibration.json of `groundcal calibrate --out`, or the folder it is in
    pub calibration: PathBuf,

    /// Images of the camera: folders, files, glob patterns (none with --maps alone)
    #[arg(value_name = "IMAGES", required_unless_present = "maps")]
    pub inputs: Vec<String>,

    /// Folder for the images (made if need be)
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,

    /// Which part of the undistorted scene is shown
    #[arg(long, value_enum, default_value_t = FitArg::Same)]
    pub fit: FitArg,

    /// Also write map_x.tiff and map_y.tiff
    #[arg(long)]
    pub maps: bool,

    /// Kind of picture
    #[arg(long, value_enum, default_value_t = PictureFormatArg::Png)]
    pub format: PictureFormatArg,

    /// Threads [default: all processors]; the result does not depend on it
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub threads: Option<u16>,
}

/// [`Fit`] on the command line.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum FitArg {
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

/// `camera_undistorted.json`: read back as a calibration.
#[derive(Debug, Serialize)]
struct CameraFile {
    schema_version: u32,
    format_version: u32,
    pixel_centre: PixelCentre,
    camera: Camera,
    undistort_fit: &'static str,
    distorted_camera: Camera,
}

/// Runs the command; returns what is printed, with notes for standard error.
pub fn run(args: &UndistortArgs) -> Result<(String, Vec<String>), CliError> {
    let calibration = groundcal_json::read(&args.calibration)?;
    let (k, lens, size) = (calibration.camera.intrinsics(), calibration.camera.lens(), calibration.camera.size());
    let undistortion = Undistortion::new(&k, &lens, size, args.fit.into())?;
    let mut notes = Vec::new();
    if lens.is_none() {
        notes.push(format!(
            "{}: the lens has no distortion there; the images stay as they are",
            args.calibration.display()
        ));
    }
    let files = if args.inputs.is_empty() { Vec::new() } else { pictures::files(&args.inputs)? };
    let names = pictures::stems(&files);
    let targets: Vec<PathBuf> =
        names.iter().map(|n| args.out.join(format!("{n}.{}", PictureFormat::from(args.format).extension()))).collect();
    // Images that cannot be used, and results that would overwrite them, are refused before anything is written.
    for file in &files {
        pictures::read(file, size)?;
    }
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
    std::fs::create_dir_all(&args.out)
        .map_err(|e| CliError::Other(format!("cannot make the folder {}: {e}", args.out.display())))?;

    let mut text = String::new();
    let new = undistortion.intrinsics();
    let file = CameraFile {
        schema_version: SCHEMA_VERSION,
        format_version: FORMAT_VERSION,
        pixel_centre: PixelCentre::TopLeftPixel,
        camera: Camera::new(size, new, &Distortion::default(), LensSource::Given),
        undistort_fit: match args.fit {
            FitArg::Same => "same",
            FitArg::All => "all",
            FitArg::Crop => "crop",
        },
        distorted_camera: calibration.camera.clone(),
    };
    let json = serde_json::to_string_pretty(&file)
        .map_err(|e| CliError::Other(format!("cannot write the camera as JSON: {e}")))?;
    write_whole(&args.out.join("camera_undistorted.json"), format!("{json}\n").as_bytes())?;
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
            write_whole(&path, &tiff_of(&map, size, &path)?)?;
            let _ = writeln!(text, "{}", path.display());
        }
    }
    for (file, target) in files.iter().zip(&targets) {
        let picture = Pyramid::new(pictures::read(file, size)?);
        let out = resample(&picture, size, |p| undistortion.source_pixel(p));
        write_whole(target, &pictures::encode(&out, args.format.into(), target)?)?;
        let _ = writeln!(text, "{}", target.display());
    }
    Ok((text, notes))
}

/// One 32-bit floating point channel, as `cv2.imread(..., cv2.IMREAD_UNCHANGED)` gives it back.
fn tiff_of(map: &[f32], size: ImageSize, path: &Path) -> Result<Vec<u8>, CliError> {
    let mut bytes = Cursor::new(Vec::new());
    TiffEncoder::new(&mut bytes)
        .and_then(|mut t| t.write_image::<Gray32Float>(size.width as u32, size.height as u32, map))
        .map_err(|e| CliError::Other(format!("cannot encode {}: {e}", path.display())))?;
    Ok(bytes.into_inner())
}
