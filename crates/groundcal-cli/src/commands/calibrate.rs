//! `groundcal calibrate`: the camera from photographs, or from matches.

use std::{path::PathBuf, time::Instant};

use clap::{Args, ValueEnum};
use groundcal::{
    HomographyFit, Method, Options, RadialCorrection, calibrate_images, calibrate_matches,
    geometry::{Camera, ImageSize, Lens},
    priors_of,
    result::{Calibration, Warning},
    start::GivenPrior,
    vision::GrayImage,
};
use groundcal_io::{
    export::{self, Format},
    images::{MaskFiles, read_images},
    import::{groundcal_json, read_camera},
    inputs::{Inputs, Search, find_inputs_by},
    matches::{PairChoice, read_matches, read_pairs},
    names::image_names,
    note::Note,
    outputs::Request,
    text::{message, shown},
};
use groundcal_report::{
    html,
    text::{self, SummaryOptions},
};

use crate::{
    args::{
        ConstraintArg, FeaturesArg, FormatArg, LensArg, MotionArg, OverwriteArg, ThreadsArg, parse_height, parse_point,
        parse_prior, parse_size,
    },
    error::{CliError, Noted, PairLeftOut},
    foreign,
    output::{self, Results},
    progress::StageTimes,
    remedies::Flags,
    scale::{self, Lengths},
    terminal::{self, ColorArg},
};

/// `groundcal calibrate`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  groundcal calibrate photos/                      a folder: pairs are found
  groundcal calibrate 'shots/*.png' --constraint square --out result/
  groundcal calibrate matches.csv --image-size 1280x960 --constraint zero-skew --json

Take two or more images per camera attitude: turn the camera 15 to 60 degrees (and move it, if you like) over the floor \
without tilting it. Then tilt or roll it by 20 degrees or more and repeat.

Pixels: (0,0) is the centre of the top-left pixel. Exit codes: 0 a calibration, 2 wrong usage, 3 the images cannot \
determine what was asked, 4 unreadable or unusable input, 1 anything else.")]
pub(crate) struct CalibrateArgs {
    /// Folders, image files (JPEG, PNG, TIFF, WebP), glob patterns, or one matches.csv / tracks.csv
    #[arg(required = true, value_name = "INPUT")]
    pub(crate) inputs: Vec<PathBuf>,

    /// Search the folders in folders too
    #[arg(long)]
    pub(crate) recursive: bool,

    /// Leave out files of folders and patterns whose name matches (`thumb_*`), or whose path does (`old/`, `old/*.png`). May be repeated
    #[arg(long, value_name = "PATTERN")]
    pub(crate) exclude: Vec<String>,

    /// CSV of image pairs known to be turns about the floor's normal: image_a,image_b (default: they are found)
    #[arg(long, value_name = "FILE")]
    pub(crate) pairs: Option<PathBuf>,

    /// What of the images is used, white in an image of their size: one file for all, or a folder with one for each (a.png for
    /// a.jpg). What stands still in all images is found by itself
    #[arg(long, value_name = "FILE|DIR")]
    pub(crate) mask: Option<PathBuf>,

    /// How the camera moved
    #[arg(long, value_enum, default_value_t = MotionArg::Auto)]
    pub(crate) motion: MotionArg,

    /// What to assume of the camera matrix
    #[arg(long, value_enum, default_value_t = ConstraintArg::Auto)]
    pub(crate) constraint: ConstraintArg,

    /// Principal point in pixels: held by `fixed-pp` and `focal`, centre of the prior of `auto` [default: image centre]
    #[arg(long, value_name = "X,Y", value_parser = parse_point, allow_hyphen_values = true)]
    pub(crate) principal_point: Option<[f64; 2]>,

    /// fy / fx: held by `square` and `focal`, centre of the prior of `auto` [default: 1]
    #[arg(long, value_name = "A", allow_negative_numbers = true)]
    pub(crate) aspect: Option<f64>,

    /// What is known of a parameter beforehand, as fx, aspect, cx, cy, skew, k1, k2, p1, p2 or k3 = VALUE+-SIGMA in pixels
    /// (aspect and those of the lens: no unit); takes the place of the prior of `auto`. May be repeated
    #[arg(long, value_name = "NAME=VALUE+-SIGMA", value_parser = parse_prior)]
    pub(crate) prior: Vec<GivenPrior>,

    /// How the camera is estimated
    #[arg(long, value_enum, default_value_t = MethodArg::Joint)]
    pub(crate) method: MethodArg,

    /// How homographies are fitted to their matches, for `--method kzr` [default: nonlinear]
    #[arg(long, value_enum)]
    pub(crate) homographies: Option<HomographiesArg>,

    /// How a radial distortion of one parameter is corrected in each pair by itself, for `--method kzr` [default: not at all]
    #[arg(long, value_enum)]
    pub(crate) radial: Option<RadialArg>,

    /// The lens: what is estimated of it (`none`: the error bars do not cover it)
    #[arg(long, visible_alias = "distortion", value_name = "MODEL", value_enum, default_value_t = LensArg::Auto)]
    pub(crate) lens: LensArg,

    /// Camera file (of groundcal, OpenCV, ROS, Kalibr, COLMAP, nerfstudio) whose lens is known, of any model, fisheyes too: its
    /// coefficients are held and undone before anything else. Focal length and centre start from the file's and are estimated anew
    #[arg(long, value_name = "FILE", conflicts_with_all = ["k1", "k2", "lens"])]
    pub(crate) lens_from: Option<String>,

    /// Known radial distortion of the lens (Brown-Conrady, as OpenCV); it is undone before anything else, none is estimated
    #[arg(long, value_name = "K1", allow_hyphen_values = true)]
    pub(crate) k1: Option<f64>,

    /// Known radial distortion, fourth order
    #[arg(long, value_name = "K2", allow_hyphen_values = true)]
    pub(crate) k2: Option<f64>,

    /// How far the camera pitches and rolls by itself between views, standard deviation in degrees (0: not at all)
    /// [default: estimated from three attitudes on, else 0.1; 1.5 for a single motion before a background that stands still]
    #[arg(long, value_name = "DEG", allow_negative_numbers = true)]
    pub(crate) attitude_sigma_deg: Option<f64>,

    /// How far the camera's height over the floor varies between the views of an attitude, relative standard deviation (0: constant
    /// height; 0.3 and more: free) [default: estimated]
    #[arg(long, value_name = "S", allow_negative_numbers = true)]
    pub(crate) height_sigma: Option<f64>,

    /// Height of the camera over the floor in metres at the first view (of each set of views that common points connect): gives
    /// positions in metres [default: that height is 1]
    #[arg(long, value_name = "METRES", value_parser = parse_height, allow_negative_numbers = true)]
    pub(crate) camera_height: Option<f64>,

    /// A distance on the floor that is known, between two pixels of an image: metres [+-SIGMA]. Gives positions in metres
    #[arg(long, value_names = ["VIEW", "X1,Y1", "X2,Y2", "METRES"], num_args = 4, conflicts_with = "camera_height", allow_hyphen_values = true)]
    pub(crate) floor_distance: Vec<String>,

    /// CSV of a robot's odometry: image (or time, where images are named by their times), x, y, yaw_deg (or yaw, radians), in metres. Gives positions
    /// in metres, and where the camera sits on the robot's base
    #[arg(long, value_name = "FILE")]
    pub(crate) odometry: Option<PathBuf>,

    /// An earlier calibration of this camera (calibration.json, or its folder) as what is known of it; --prior goes before it
    #[arg(long, value_name = "FILE")]
    pub(crate) prior_from: Option<PathBuf>,

    /// Image size, for matches.csv and tracks.csv
    #[arg(long, value_name = "WxH", value_parser = parse_size)]
    pub(crate) image_size: Option<ImageSize>,

    /// Seed of all random choices
    #[arg(long, default_value_t = 0)]
    pub(crate) seed: u64,

    /// How many features are looked for: few first, and many where these do not carry the answer, or many at once
    #[arg(long, value_enum, default_value_t = FeaturesArg::Auto)]
    pub(crate) features: FeaturesArg,

    /// Most features of an image, where many are looked for
    #[arg(long, value_name = "N", default_value_t = 3000, value_parser = clap::value_parser!(u32).range(50..=50_000))]
    pub(crate) max_features: u32,

    /// Write calibration.json, report.html and the camera in the formats of other programs into this folder (made if need be)
    #[arg(long, value_name = "DIR")]
    pub(crate) out: Option<PathBuf>,

    /// Formats written into --out beside calibration.json, separated by commas [default: all]
    #[arg(long, value_name = "NAME", value_enum, value_delimiter = ',', requires = "out")]
    pub(crate) format: Vec<FormatArg>,

    /// Leave out report.html, the page that shows the calibration
    #[arg(long, requires = "out")]
    pub(crate) no_report: bool,

    /// Print the calibration as JSON on standard output and nothing else there
    #[arg(long)]
    pub(crate) json: bool,

    /// The command line itself, for the page.
    #[arg(skip)]
    pub(crate) command_line: String,

    #[command(flatten)]
    pub(crate) overwrite: OverwriteArg,

    #[command(flatten)]
    pub(crate) threads: ThreadsArg,

    /// List every pair and show how long each stage took (on standard error)
    #[arg(long, short)]
    pub(crate) verbose: bool,
}

/// [`Method`] on the command line.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum MethodArg {
    /// Camera, lens, attitudes, views and points refined together
    Joint,
    /// The closed form of Knight, Zisserman & Reid (2003) with what we add to it: motions weighted by the covariances of their circular
    /// points and polished to the maximum likelihood, the lens estimated, the floor matched again patch by patch
    Linear,
    /// The same as published, for comparison: homographies, their eigenvectors, one linear system with all weights one, Cholesky. No lens
    /// of all pictures (undo it first, or see `--radial`), no weights, nothing polished
    Kzr,
    /// One motion transferred, linearly: its circular point carried into other views of its plane by their homographies, however these
    /// turned (section 2.3 there). Four images give the full camera; `joint` uses such views, too
    Transferred,
    /// All pairs taken for rotations about the optical centre (Hartley 1994): a pan-tilt camera on the spot, no floor needed. Wrong
    /// for a camera that moves; `joint` recognises cameras that turn on the spot by itself
    Rotating,
}

/// [`HomographyFit`] on the command line.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum HomographiesArg {
    /// Normalised direct linear transformation of the matches on the plane
    Linear,
    /// Maximum likelihood, with errors in both images
    Nonlinear,
}

/// [`RadialCorrection`] on the command line.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum RadialArg {
    /// Minimised together with each homography
    PerPair,
    /// In closed form: biased by noise
    ClosedForm,
}

impl From<RadialArg> for RadialCorrection {
    fn from(value: RadialArg) -> Self {
        match value {
            RadialArg::PerPair => RadialCorrection::PerPair,
            RadialArg::ClosedForm => RadialCorrection::ClosedForm,
        }
    }
}

impl From<HomographiesArg> for HomographyFit {
    fn from(value: HomographiesArg) -> Self {
        match value {
            HomographiesArg::Linear => HomographyFit::Linear,
            HomographiesArg::Nonlinear => HomographyFit::NonLinear,
        }
    }
}

impl From<MethodArg> for Method {
    fn from(value: MethodArg) -> Self {
        match value {
            MethodArg::Joint => Method::Joint,
            MethodArg::Linear => Method::Linear,
            MethodArg::Kzr => Method::Kzr,
            MethodArg::Transferred => Method::Transferred,
            MethodArg::Rotating => Method::Rotating,
        }
    }
}

/// Calibrates, writes the files of `--out` and prints the report.
pub(crate) fn run(args: &CalibrateArgs, color: ColorArg) -> Result<(), CliError> {
    if let Some(out) = &args.out {
        output::check_folder(out)?;
    }
    let search = Search { recursive: args.recursive, exclude: args.exclude.clone() };
    let inputs = find_inputs_by(&args.inputs, &search)?;
    let masks = find_masks(args, &inputs)?;
    let results = begin(args, &inputs, masks.as_ref())?;
    output::on_threads(args.threads, || calibrate(args, color, inputs, masks, results))
}

/// The masks of the images, if they have any.
fn find_masks(args: &CalibrateArgs, inputs: &Inputs) -> Result<Option<MaskFiles>, CliError> {
    let Some(given) = &args.mask else { return Ok(None) };
    match inputs {
        Inputs::Images(files) => Ok(Some(MaskFiles::find(given, files)?)),
        Inputs::Csv(_) => {
            Err(CliError::Usage("--mask goes with images; leave points out of a matches.csv or tracks.csv".into()))
        }
    }
}

/// The files of `--out`, if it is given, before the work.
fn begin(args: &CalibrateArgs, inputs: &Inputs, masks: Option<&MaskFiles>) -> Result<Option<Results>, CliError> {
    let Some(out) = &args.out else { return Ok(None) };
    let of_formats = export::file_names(&formats(args));
    let page = (!args.no_report).then_some(output::PAGE);
    let names: Vec<String> = ["calibration.json"].into_iter().chain(page).chain(of_formats).map(String::from).collect();
    let files = match inputs {
        Inputs::Images(files) => files.as_slice(),
        Inputs::Csv(file) => std::slice::from_ref(file),
    };
    let masks = masks.map_or(&[][..], MaskFiles::files);
    let read: Vec<PathBuf> = files.iter().chain(&args.pairs).chain(&args.odometry).chain(masks).cloned().collect();
    let request = Request {
        folder: out,
        command: "calibrate",
        names: &names,
        inputs: &read,
        basis: None,
        overwrite: args.overwrite.overwrite,
    };
    Results::begin(&request).map(Some)
}

fn formats(args: &CalibrateArgs) -> Vec<Format> {
    args.format.iter().map(|f| (*f).into()).collect()
}

fn calibrate(
    args: &CalibrateArgs,
    color: ColorArg,
    inputs: Inputs,
    masks: Option<MaskFiles>,
    results: Option<Results>,
) -> Result<(), CliError> {
    let progress = StageTimes::new("reading");
    let result = from_inputs(args, inputs, masks, &progress);
    let mut times = progress.finish();
    let Calibrated { mut calibration, images } = result.map_err(|error| match error {
        // A signal is its own reason.
        CliError::Stopped(_) => error,
        error => {
            let error = progress.noted(error);
            tell_pairs_left_out(&error, args.verbose);
            error
        }
    })?;
    let lengths = Lengths {
        camera_height_m: args.camera_height,
        floor_distance: &args.floor_distance,
        odometry: args.odometry.as_deref(),
    };
    let (scaled, said) = scale::scaled(&lengths, calibration)?;
    calibration = scaled;
    for note in said {
        output::note(&note);
    }
    let mut finished = None;
    if let Some(results) = results {
        let start = Instant::now();
        let page = if args.no_report {
            None
        } else {
            Some(html::page(&calibration, &images, &Flags, Some(&args.command_line))?)
        };
        for note in write_results(&results, &calibration, &formats(args), page.as_deref())? {
            output::note(&note);
        }
        finished = Some(results.finish()?);
        times.push(("writing", start.elapsed()));
    }
    if args.json {
        output::print_json(&export::json(&calibration, &Flags)?)?;
    } else {
        let more = match args.out {
            Some(_) => "Motions, attitudes, views and what was left out: the page, or --verbose.",
            None => {
                "Motions, attitudes, views and what was left out: --verbose, or the page and files of --out FOLDER."
            }
        };
        let options = SummaryOptions { width: terminal::width(), verbose: args.verbose, more };
        let lines = text::summary_lines(&calibration, &options, &Flags);
        output::print_lines(&lines, color)?;
    }
    if let Some(finished) = finished {
        finished.tell();
    }
    if args.verbose {
        let total: f64 = times.iter().map(|t| t.1.as_secs_f64()).sum();
        for (stage, time) in &times {
            output::remark(&format!("{stage:<20}{:>8.3} s", time.as_secs_f64()));
        }
        output::remark(&format!("{:<20}{total:>8.3} s", "all"));
    }
    Ok(())
}

/// Why each pair is no motion, or that there is more to be had on it.
fn tell_pairs_left_out(error: &CliError, verbose: bool) {
    let CliError::Noted(_, Noted { left_out, .. }) = error else { return };
    if verbose {
        for PairLeftOut { from, to, reason } in left_out {
            output::remark(&message(&format!("not used: {from} - {to}: {reason}")));
        }
    } else if !left_out.is_empty() {
        output::note(&format!("--verbose says of each of {} pairs why it is no motion", left_out.len()));
    }
}

/// A calibration and what it was made from.
struct Calibrated {
    calibration: Calibration,
    /// The images themselves; none for matches from elsewhere.
    images: Vec<GrayImage>,
}

/// Input to calibration.
fn from_inputs(
    args: &CalibrateArgs,
    inputs: Inputs,
    masks: Option<MaskFiles>,
    progress: &StageTimes,
) -> Result<Calibrated, CliError> {
    let mut options = options(args);
    match inputs {
        Inputs::Images(files) => {
            if args.image_size.is_some() {
                return Err(CliError::Usage(
                    "--image-size goes with matches.csv or tracks.csv; images have their own".into(),
                ));
            }
            let names = image_names(&files);
            if let Some(path) = &args.pairs {
                options.pairs = Some(read_pairs(path, &names)?);
            }
            let read = read_images(&files).map_err(|e| foreign::of_file(e, &files, &args.inputs))?;
            foreign::check_size(&files, &names, &read.images, &args.inputs)?;
            tell(&read.notes, progress);
            options.stated_focal_px = read.stated_focal_px;
            let mut images = read.images;
            if let Some(masks) = masks {
                images = masks.put_on(images, &files)?;
            }
            if let Some(image) = images.first() {
                take_known_lens(args, image.size(), &mut options, progress)?;
                take_earlier(args, image.size(), &mut options)?;
            }
            let calibration = calibrate_images(&names, &images, &options, progress)?;
            Ok(Calibrated { calibration, images })
        }
        Inputs::Csv(path) => {
            let size = args.image_size.ok_or_else(|| {
                CliError::Usage(format!("{}: give the size of the images with --image-size WxH", shown(&path)))
            })?;
            let choice = match &args.pairs {
                Some(list) => PairChoice::Listed { list, all_pairs_limit: options.all_pairs_limit },
                None => PairChoice::Near { all_pairs_limit: options.all_pairs_limit },
            };
            let table = read_matches(&path, size, choice)?;
            tell(&table.notes, progress);
            take_known_lens(args, size, &mut options, progress)?;
            take_earlier(args, size, &mut options)?;
            options.pairs.clone_from(&table.listed);
            let count = table.names.len();
            let mut calibration = calibrate_matches(&table.names, size, &table.pairs, &options, progress)
                .map_err(|e| CliError::of_file_and_options(&path, e))?;
            if table.neighbours_only {
                calibration.warnings.push(Warning::NeighboursOnly { images: count });
            }
            Ok(Calibrated { calibration, images: Vec::new() })
        }
    }
}

fn tell(notes: &[Note], progress: &StageTimes) {
    notes.iter().for_each(|note| progress.note(note.code, note.to_string()));
}

/// Takes what `--prior-from` knows, where `--prior` says nothing.
fn take_earlier(args: &CalibrateArgs, size: ImageSize, options: &mut Options) -> Result<(), CliError> {
    let Some(file) = &args.prior_from else { return Ok(()) };
    let earlier = groundcal_json::read(file)?;
    let priors = priors_of(&earlier, size).map_err(|e| CliError::of_file(file, e))?;
    let given = |p: &GivenPrior| options.priors.iter().any(|g| g.parameter == p.parameter);
    let new: Vec<GivenPrior> = priors.into_iter().filter(|p| !given(p)).collect();
    options.priors.extend(new);
    Ok(())
}

/// Takes the lens of `--lens-from`, and the camera matrix through which it was measured, at the size of these images.
fn take_known_lens(
    args: &CalibrateArgs,
    size: ImageSize,
    options: &mut Options,
    progress: &StageTimes,
) -> Result<(), CliError> {
    let Some(file) = &args.lens_from else { return Ok(()) };
    let imported = read_camera(file)?;
    if imported.lens.is_none() {
        return Err(CliError::Usage(format!(
            "--lens-from {file}: it has no lens distortion. Give --lens none for a lens known to have none"
        )));
    }
    let of_file = imported.size.unwrap_or(size);
    let camera = Camera { size: of_file, intrinsics: imported.intrinsics, lens: imported.lens };
    let Some(camera) = camera.scaled_to(size) else {
        return Err(CliError::Usage(format!(
            "--lens-from {file}: a camera of {of_file} pixels, the images have {size}: another shape, so they are not the same picture \
             at another size"
        )));
    };
    options.distortion = camera.lens;
    options.distortion_camera = Some(camera.intrinsics);
    imported.notes.into_iter().for_each(|note| progress.note(Note::CAMERA_FILE, note));
    Ok(())
}

fn options(args: &CalibrateArgs) -> Options {
    let mut options = Options {
        motion: args.motion.into(),
        constraint: args.constraint.into(),
        principal_point_px: args.principal_point,
        aspect: args.aspect,
        lens: args.lens.into(),
        method: args.method.into(),
        homographies: args.homographies.map_or_else(HomographyFit::default, Into::into),
        radial: args.radial.map_or_else(RadialCorrection::default, Into::into),
        priors: args.prior.clone(),
        height_sigma: args.height_sigma,
        distortion: match [args.k1, args.k2].map(|k| k.unwrap_or(0.0)) {
            [0.0, 0.0] => Lens::None,
            [k1, k2] => Lens::radial(k1, k2),
        },
        attitude_sigma_deg: args.attitude_sigma_deg,
        seed: args.seed,
        ..Options::default()
    };
    options.max_features = args.max_features as usize;
    options.feature_density = args.features.into();
    options
}

/// The files of `--out`, the report's page among them if there is one. Returns what the formats cannot say.
fn write_results(
    results: &Results,
    calibration: &Calibration,
    formats: &[Format],
    page: Option<&str>,
) -> Result<Vec<String>, CliError> {
    let rendered = export::render(calibration, formats)?;
    results.write("calibration.json", export::json(calibration, &Flags)?.as_bytes())?;
    if let Some(page) = page {
        results.write(output::PAGE, page.as_bytes())?;
    }
    for file in &rendered.files {
        results.write(file.name, file.content.as_bytes())?;
    }
    Ok(rendered.notes)
}
