//! `groundcal rectify`: metric bird's-eye pictures of the floor, of each view or of all together.

use std::{fmt::Write, path::PathBuf};

use clap::{Args, ValueEnum};
use groundcal::{
    floor::{
        DEFAULT_EXTENT_HEIGHTS, FloorGrid, FloorLayout, FloorView, Mosaic, Placed, ResolutionError, placed, rectify,
        sets_of_one_world,
    },
    result::{Calibration, Method},
    vision::{Pyramid, Raster, Resampled},
};
use groundcal_io::{
    export::floor_picture::{self, FloorPicture},
    import::groundcal_json,
    inputs::find_images,
    names::stems,
    outputs::{Request, sha256},
    pictures::{self, Encode, Picture, PictureFormat, PictureReader},
    text::shown,
    view_files::{ViewFiles, look_beside, match_files},
};

use crate::{
    args::{OverwriteArg, PictureFormatArg, ThreadsArg, parse_height},
    error::CliError,
    output::{self, Finished, Results},
};

/// `groundcal rectify`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  groundcal calibrate photos/ --out result/
  groundcal rectify result/ photos/ --out floor/                    each view from above
  groundcal rectify result/ photos/ --out floor/ --mosaic --camera-height 1.45 --resolution 500

Beside each picture: a world file (.pgw, .jgw) and a JSON file with the homography from the image to the floor. Lengths \
are in heights of the camera at the first view, in metres with --camera-height (here or in calibrate). Exit codes: 0 \
pictures, 2 wrong usage, 4 unreadable or unusable input, 1 anything else.")]
pub(crate) struct RectifyArgs {
    /// calibration.json of `groundcal calibrate --out`, or the folder it is in
    pub(crate) calibration: PathBuf,

    /// The images of the calibration: folders, files, glob patterns [default: looked for beside calibration.json and in the current
    /// folder]
    #[arg(value_name = "IMAGES")]
    pub(crate) inputs: Vec<PathBuf>,

    /// Folder for the pictures (made if need be)
    #[arg(long, value_name = "DIR")]
    pub(crate) out: PathBuf,

    /// One picture of all views of a set (common points connect them) instead of one for each
    #[arg(long)]
    pub(crate) mosaic: bool,

    /// Pixels for a camera height, or for a metre where lengths are in metres [default: that of the images' median pixel, as 1, 2 or
    /// 5 times a power of ten]
    #[arg(long, value_name = "PX", value_parser = parse_positive, allow_negative_numbers = true)]
    pub(crate) resolution: Option<f64>,

    /// How far from the point below the camera the floor is shown, in camera heights, or in metres where lengths are [default: 5 camera
    /// heights]
    #[arg(long, value_name = "DISTANCE", value_parser = parse_positive, allow_negative_numbers = true)]
    pub(crate) extent: Option<f64>,

    /// Height of the camera over the floor in metres at the first view of each set [default: that of the calibration, else lengths are
    /// in camera heights]
    #[arg(long, value_name = "METRES", value_parser = parse_height, allow_negative_numbers = true)]
    pub(crate) camera_height: Option<f64>,

    /// Which way is up in the picture
    #[arg(long, value_enum)]
    pub(crate) up: Option<Up>,

    /// Kind of picture [default: png; 16-bit TIFF and floating point stay TIFF]
    #[arg(long, value_enum)]
    pub(crate) format: Option<PictureFormatArg>,

    #[command(flatten)]
    pub(crate) overwrite: OverwriteArg,

    #[command(flatten)]
    pub(crate) threads: ThreadsArg,
}

/// Which way is up.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum Up {
    /// The way the camera looks (of a mosaic: that of its first view); default for single views
    Heading,
    /// +Y of the world, +X to the right; default for mosaics
    Y,
}

impl From<Up> for groundcal::floor::Up {
    fn from(value: Up) -> Self {
        match value {
            Up::Heading => groundcal::floor::Up::Heading,
            Up::Y => groundcal::floor::Up::Y,
        }
    }
}

fn parse_positive(text: &str) -> Result<f64, String> {
    let value = text.trim().parse::<f64>().ok().filter(|v| v.is_finite() && (1e-6..=1e9).contains(v));
    value.ok_or_else(|| "expected a positive number".into())
}

/// A view with its image file.
struct Found {
    placed: Placed,
    file: PathBuf,
}

/// What is written.
struct Work<'a> {
    calibration: &'a Calibration,
    args: &'a RectifyArgs,
    layout: FloorLayout,
    /// Lengths in metres.
    camera_height_m: Option<f64>,
}

/// A picture to be made.
struct Planned {
    /// Without ending.
    name: String,
    grid: FloorGrid,
    /// Which of the views found are in it.
    views: Vec<usize>,
}

impl Planned {
    /// Names of the picture, of the JSON and the world file beside it.
    fn files(&self, format: PictureFormat) -> [String; 3] {
        [format.extension(), "json", format.world_extension()].map(|ending| format!("{}.{ending}", self.name))
    }
}

/// Runs the command; what was left out is told on standard error.
pub(crate) fn run(args: &RectifyArgs) -> Result<(), CliError> {
    output::check_folder(&args.out)?;
    let (text, notes, finished) = output::on_threads(args.threads, || pictures_of(args))?;
    for note in notes {
        output::note(&note);
    }
    output::print(&text)?;
    finished.tell();
    Ok(())
}

/// Writes the pictures; what is printed, notes for standard error, and what was written.
fn pictures_of(args: &RectifyArgs) -> Result<(String, Vec<String>, Finished), CliError> {
    let calibration = groundcal_json::read(&args.calibration)?;
    let camera_height_m = args.camera_height.or(calibration.camera_height_m);
    let scale = args.camera_height.map_or(1.0, |h| h / calibration.camera_height_m.unwrap_or(1.0));
    let placed = placed(&calibration, scale).map_err(|e| CliError::of_file(&args.calibration, e))?;
    if args.mosaic && placed.iter().all(|p| p.origin.is_none()) {
        return Err(CliError::Input(format!(
            "{}: the views have attitudes but no positions ({}), so there is no common floor to lay them on. Calibrate without \
             --method linear, or leave --mosaic out to rectify each view by itself",
            shown(&args.calibration),
            match calibration.method {
                Method::Linear => "--method linear",
                Method::Kzr => "--method kzr",
                Method::Transferred => "--method transferred",
                Method::Rotating => "--method rotating",
                Method::Joint => "the joint refinement failed",
            }
        )));
    }
    let (found, mut notes) = found(args, placed)?;
    let default_up = if args.mosaic { Up::Y } else { Up::Heading };
    let work = Work {
        calibration: &calibration,
        args,
        layout: FloorLayout {
            size: calibration.camera.model().size,
            max_distance: args.extent.unwrap_or(DEFAULT_EXTENT_HEIGHTS * camera_height_m.unwrap_or(1.0)),
            up: args.up.unwrap_or(default_up).into(),
        },
        camera_height_m,
    };
    let sets = work.sets(&found);
    let px_per_unit = work.resolution(&sets, &mut notes)?;
    // Images that cannot be used, and results that would overwrite something, are refused before anything is written.
    let files: Vec<PathBuf> = found.iter().map(|f| f.file.clone()).collect();
    let asked = args.format.map(PictureFormat::from);
    let (reader, said) = PictureReader::new(&files, work.layout.size, asked, args.mosaic)?;
    notes.extend(said.iter().map(ToString::to_string));
    let plan = if args.mosaic {
        work.mosaics(&found, &sets, px_per_unit)
    } else {
        work.single_views(&found, &files, px_per_unit, &mut notes)
    };
    let results = work.begin(&plan, &files, &reader)?;
    let mut text = format!(
        "{px_per_unit} px per {}, floor shown to {} from below each camera\n",
        work.unit(),
        work.length(work.layout.max_distance)
    );
    for planned in &plan {
        work.make(planned, &found, &reader, &results, &mut text)?;
    }
    Ok((text, notes, results.finish()?))
}

/// The format of a picture: that of its views.
fn format_of(planned: &Planned, reader: &PictureReader) -> PictureFormat {
    reader.format(planned.views.first().copied().unwrap_or_default())
}

/// The views whose files are there, and notes on the others.
fn found(args: &RectifyArgs, placed: Vec<Placed>) -> Result<(Vec<Found>, Vec<String>), CliError> {
    let images: Vec<&str> = placed.iter().map(|p| p.image.as_str()).collect();
    let beside = args.inputs.is_empty();
    let matched: ViewFiles = if beside {
        let folder =
            if args.calibration.is_dir() { Some(args.calibration.as_path()) } else { args.calibration.parent() };
        look_beside(&images, folder)
    } else {
        match_files(&images, &find_images(&args.inputs)?)?
    };
    let missing = listed(&matched.missing(&images));
    let others = listed(&matched.others);
    let mut notes = Vec::new();
    if !others.is_empty() {
        notes.push(format!("left out, as the calibration has no position for them: {others}"));
    }
    if !missing.is_empty() {
        notes.push(format!("of the calibration's images not found: {missing}"));
    }
    let found: Vec<Found> = placed
        .into_iter()
        .zip(matched.files)
        .filter_map(|(placed, file)| Some(Found { placed, file: file? }))
        .collect();
    if !found.is_empty() {
        return Ok((found, notes));
    }
    Err(CliError::Input(if beside {
        format!(
            "no image of the calibration ({missing}) is beside it or in the current folder. Name their folder: groundcal rectify {} \
             FOLDER --out {}",
            shown(&args.calibration),
            shown(&args.out)
        )
    } else {
        format!(
            "no image given ({others}) is a view of the calibration, which has {missing}. Give the images that were calibrated, under \
             the names they had"
        )
    }))
}

/// The first few of a list.
fn listed(names: &[impl AsRef<str>]) -> String {
    const SHOWN: usize = 5;
    let shown = names.iter().take(SHOWN).map(AsRef::as_ref).collect::<Vec<_>>().join(", ");
    if names.len() > SHOWN { format!("{shown} and {} more", names.len() - SHOWN) } else { shown }
}

fn views<'a>(set: &[&'a Found]) -> Vec<&'a FloorView> {
    set.iter().map(|f| &f.placed.view).collect()
}

impl Work<'_> {
    fn unit(&self) -> &'static str {
        floor_picture::unit(self.camera_height_m)
    }

    fn length(&self, value: f64) -> String {
        match self.camera_height_m {
            Some(_) => format!("{value} m"),
            None => format!("{value} camera heights"),
        }
    }

    /// The views that make one picture each.
    fn sets<'a>(&self, found: &'a [Found]) -> Vec<Vec<&'a Found>> {
        if !self.args.mosaic {
            return found.iter().map(|f| vec![f]).collect();
        }
        let worlds: Vec<Option<&str>> = found.iter().map(|f| f.placed.origin.as_deref()).collect();
        sets_of_one_world(&worlds).into_iter().map(|set| set.into_iter().map(|i| &found[i]).collect()).collect()
    }

    /// Pixels for a unit of length.
    fn resolution(&self, sets: &[Vec<&Found>], notes: &mut Vec<String>) -> Result<f64, CliError> {
        let sets: Vec<Vec<&FloorView>> = sets.iter().map(|s| views(s)).collect();
        let asked = self.args.resolution;
        let chosen = self.layout.resolution(&sets, asked).map_err(|error| match error {
            ResolutionError::NoFloor => CliError::Input(format!(
                "no view sees floor within {} of the point below it. Take a larger --extent; if there is no floor in the images, \
                 there is nothing to rectify",
                self.length(self.layout.max_distance)
            )),
            ResolutionError::TooLarge { pixels, most_pixels, fits_px_per_unit } => CliError::Usage(format!(
                "--resolution {}: a picture would have {:.0} megapixels, {} at most. Take {fits_px_per_unit} px per {} or less, or a \
                 smaller --extent than {}",
                asked.unwrap_or(f64::NAN),
                pixels as f64 / 1e6,
                most_pixels / 1_000_000,
                self.unit(),
                self.length(self.layout.max_distance)
            )),
        })?;
        if let Some(wanted) = chosen.lowered_from {
            notes.push(format!(
                "resolution lowered from {wanted} to {} px per {}, for pictures of at most {} megapixels",
                chosen.px_per_unit,
                self.unit(),
                chosen.most_pixels / 1_000_000
            ));
        }
        Ok(chosen.px_per_unit)
    }

    fn single_views(
        &self,
        found: &[Found],
        files: &[PathBuf],
        px_per_unit: f64,
        notes: &mut Vec<String>,
    ) -> Vec<Planned> {
        let mut plan = Vec::new();
        for (i, (f, name)) in found.iter().zip(stems(files, &[])).enumerate() {
            let Some(grid) = self.layout.grid(&[&f.placed.view], px_per_unit) else {
                let within = self.length(self.layout.max_distance);
                notes.push(format!("{}: no floor in it within {within}: left out", f.placed.image));
                continue;
            };
            plan.push(Planned { name: format!("{name}_floor"), grid, views: vec![i] });
        }
        plan
    }

    fn mosaics(&self, found: &[Found], sets: &[Vec<&Found>], px_per_unit: f64) -> Vec<Planned> {
        let place = |f: &&Found| found.iter().position(|g| std::ptr::eq(g, *f));
        let planned = |(i, set): (usize, &Vec<&Found>)| {
            let grid = self.layout.grid(&views(set), px_per_unit)?;
            let name = if sets.len() == 1 { "mosaic".to_string() } else { format!("mosaic_{}", i + 1) };
            Some(Planned { name, grid, views: set.iter().filter_map(place).collect() })
        };
        sets.iter().enumerate().filter_map(planned).collect()
    }

    /// All files, before the work.
    fn begin(&self, plan: &[Planned], files: &[PathBuf], reader: &PictureReader) -> Result<Results, CliError> {
        let names: Vec<String> = plan.iter().flat_map(|p| p.files(format_of(p, reader))).collect();
        let calibration = groundcal_json::file_of(&self.args.calibration);
        let inputs: Vec<PathBuf> = files.iter().cloned().chain([calibration]).collect();
        let json = serde_json::to_vec(self.calibration)
            .map_err(|e| CliError::Other(format!("cannot write the calibration as JSON: {e}")))?;
        let basis = sha256(&json);
        Results::begin(&Request {
            folder: &self.args.out,
            command: if self.args.mosaic { "rectify --mosaic" } else { "rectify" },
            names: &names,
            inputs: &inputs,
            // Single views of one calibration may come one after the other; mosaics of other views take the place of the last ones.
            basis: (!self.args.mosaic).then_some(&basis),
            overwrite: self.args.overwrite.overwrite,
        })
    }

    /// The floor in the depth of its first picture, which is that of all.
    fn flat<T: Encode>(
        &self,
        planned: &Planned,
        first: Raster<T>,
        set: &[&Found],
        reader: &PictureReader,
    ) -> Result<Resampled<T>, CliError> {
        let far = self.layout.max_distance;
        if !self.args.mosaic {
            let Some(f) = set.first() else { return Err(CliError::Other("a picture of no view".into())) };
            return Ok(rectify(&Pyramid::new(first), &f.placed.view, &planned.grid, far));
        }
        let channels = if reader.has_colour() { 3 } else { 1 };
        let mut mosaic = Mosaic::new(planned.grid, channels, far);
        let mut first = Some(first);
        for (index, f) in planned.views.iter().zip(set) {
            output::go_on()?;
            let picture = match first.take() {
                Some(first) => first,
                None => T::of(reader.read(*index)?)
                    .ok_or_else(|| CliError::Other("pictures of different depths in one".into()))?,
            };
            let picture = if reader.has_colour() { pictures::to_colour(picture) } else { picture };
            mosaic.add(&Pyramid::new(picture), &f.placed.view);
        }
        Ok(mosaic.finish())
    }

    fn make(
        &self,
        planned: &Planned,
        found: &[Found],
        reader: &PictureReader,
        results: &Results,
        text: &mut String,
    ) -> Result<(), CliError> {
        output::go_on()?;
        let set: Vec<&Found> = planned.views.iter().filter_map(|i| found.get(*i)).collect();
        let Some(first) = planned.views.first() else { return Ok(()) };
        let format = format_of(planned, reader);
        let [file, beside, world] = planned.files(format);
        let path = self.args.out.join(&file);
        let bytes = match reader.read(*first)? {
            Picture::U8(picture) => pictures::encode(&self.flat(planned, picture, &set, reader)?, format, &path),
            Picture::U16(picture) => pictures::encode(&self.flat(planned, picture, &set, reader)?, format, &path),
            Picture::F32(picture) => pictures::encode(&self.flat(planned, picture, &set, reader)?, format, &path),
        }?;
        let picture = FloorPicture {
            file: file.clone(),
            grid: planned.grid,
            views: set.iter().map(|f| (f.placed.image.as_str(), &f.placed.view)).collect(),
            origin: set.first().and_then(|f| f.placed.origin.as_deref()),
            max_distance: self.layout.max_distance,
            camera_height_m: self.camera_height_m,
            camera: self.calibration.camera.model(),
        };
        results.write(&beside, picture.json()?.as_bytes())?;
        results.write(&world, picture.world_file().as_bytes())?;
        results.write(&file, &bytes)?;
        let size = picture.grid.size;
        let sides = [size.width, size.height].map(|n| n as f64 * picture.grid.unit_per_px);
        let of = if self.args.mosaic { format!(", {} views", set.len()) } else { String::new() };
        // Writing to a string cannot fail.
        let _ = writeln!(
            text,
            "{}: {} x {} px, {:.3} x {:.3} {}s{of}",
            path.display(),
            size.width,
            size.height,
            sides[0],
            sides[1],
            self.unit()
        );
        Ok(())
    }
}
