//! The groundcal program: floor photographs in, camera out.

mod args;
mod compare;
mod error;
mod experiment;
mod man;
mod plan;
mod progress;
mod rectify;
mod remedies;
mod simulate;
mod undistort;

use std::{
    io::{IsTerminal, Write},
    path::Path,
    process::ExitCode,
    time::Instant,
};

use args::{CalibrateArgs, Cli, Command, SimulateArgs};
use clap::Parser;
use compare::CompareArgs;
use error::CliError;
use groundcal::{
    calibrate::{Options, calibrate_images, calibrate_matches},
    geometry::distortion::Distortion,
    result::{Calibration, Warning},
    vision::image::GrayImage,
};
use groundcal_io::{
    export::{self, formats::Format},
    load,
};
use groundcal_lab::render_scene;
use groundcal_report::{html, text};
use progress::Progress;
use remedies::Flags;

fn main() -> ExitCode {
    let outcome = match Cli::parse().command {
        Command::Calibrate(args) => calibrate(&args),
        Command::Plan(args) => plan::run(&args).and_then(|page| print(&page)),
        Command::Render(args) => refuse_file(&args.out).and_then(|()| Ok(render_scene::run(&args.scene, &args.out)?)),
        Command::Simulate(args) => simulate(&args),
        Command::Experiment(args) => experiment::run(&args),
        Command::Rectify(args) => pictures_of(&args.out, args.threads, || rectify::run(&args)),
        Command::Undistort(args) => pictures_of(&args.out, args.threads, || undistort::run(&args)),
        Command::Compare(args) => compare(&args),
        Command::Completions(args) => print(&man::completions(args.shell)),
        Command::Man(args) => refuse_file(&args.out).and_then(|()| man::write_pages(&args)),
    };
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            let mark = if std::io::stderr().is_terminal() { "\u{1b}[31merror\u{1b}[0m" } else { "error" };
            let _ = writeln!(std::io::stderr(), "{mark}: {error}");
            ExitCode::from(error.exit_code())
        }
    }
}

fn simulate(args: &SimulateArgs) -> Result<(), CliError> {
    refuse_file(&args.out)?;
    start_threads(args.threads)?;
    print(&simulate::run(args)?)
}

fn compare(args: &CompareArgs) -> Result<(), CliError> {
    if let Some(out) = &args.out {
        refuse_file(out)?;
    }
    print(&compare::run(args)?)
}

/// A command that writes pictures and tells what it left out on standard error.
fn pictures_of(
    out: &Path,
    threads: Option<u16>,
    run: impl FnOnce() -> Result<(String, Vec<String>), CliError>,
) -> Result<(), CliError> {
    refuse_file(out)?;
    start_threads(threads)?;
    let (text, notes) = run()?;
    for note in notes {
        let _ = writeln!(std::io::stderr(), "note: {note}");
    }
    print(&text)
}

/// `--out` has to be a folder that can be written, or nothing yet: asked before minutes of work. Nothing is left behind.
fn refuse_file(out: &Path) -> Result<(), CliError> {
    if out.exists() && !out.is_dir() {
        return Err(CliError::Usage(format!("--out {}: is a file; name a folder", out.display())));
    }
    let here = Path::new(".");
    let nearest = out.ancestors().map(|p| if p.as_os_str().is_empty() { here } else { p }).find(|p| p.exists());
    let folder = nearest.unwrap_or(here);
    if !folder.is_dir() {
        let out = out.display();
        return Err(CliError::Other(format!("cannot make the folder {out}: {} is a file", folder.display())));
    }
    tempfile::tempfile_in(folder).map(drop).map_err(|e| {
        CliError::Other(format!(
            "--out {}: cannot write into {}: {e}. Name another folder",
            out.display(),
            folder.display()
        ))
    })
}

fn start_threads(threads: Option<u16>) -> Result<(), CliError> {
    if let Some(threads) = threads {
        rayon::ThreadPoolBuilder::new()
            .num_threads(usize::from(threads))
            .build_global()
            .map_err(|e| CliError::Other(format!("cannot start {threads} threads: {e}")))?;
    }
    Ok(())
}

fn calibrate(args: &CalibrateArgs) -> Result<(), CliError> {
    if let Some(out) = &args.out {
        refuse_file(out)?;
    }
    start_threads(args.threads)?;
    let progress = Progress::new("reading");
    let result = run(args, &progress);
    let mut times = progress.finish();
    let Calibrated { mut calibration, count, images } = result?;
    if let Some(height_m) = args.camera_height {
        calibration = calibration.with_camera_height(height_m)?;
    }
    if let Some(out) = &args.out {
        let start = Instant::now();
        let page = if args.no_report { None } else { Some(html::html(&calibration, &images, &Flags)?) };
        let formats: Vec<Format> = args.format.iter().map(|f| (*f).into()).collect();
        for note in write_results(out, &calibration, &formats, page.as_deref())? {
            let _ = writeln!(std::io::stderr(), "note: {note}");
        }
        times.push(("writing", start.elapsed()));
    }
    let page = if args.json {
        export::json(&calibration, &Flags)?
    } else {
        text::summary(&calibration, count, args.verbose, &Flags)
    };
    print(&page)?;
    if args.verbose {
        let total: f64 = times.iter().map(|t| t.1.as_secs_f64()).sum();
        let mut err = std::io::stderr().lock();
        for (stage, time) in &times {
            let _ = writeln!(err, "{stage:<20}{:>8.3} s", time.as_secs_f64());
        }
        let _ = writeln!(err, "{:<20}{total:>8.3} s", "all");
    }
    Ok(())
}

/// A calibration and what it was made from.
struct Calibrated {
    calibration: Calibration,
    /// How many images.
    count: usize,
    /// The images themselves; none for matches from elsewhere.
    images: Vec<GrayImage>,
}

/// Input to calibration.
fn run(args: &CalibrateArgs, progress: &Progress) -> Result<Calibrated, CliError> {
    let mut options = options(args);
    match load::find(&args.inputs)? {
        load::Input::Images(files) => {
            if args.image_size.is_some() {
                return Err(CliError::Usage(
                    "--image-size goes with matches.csv or tracks.csv; images have their own".into(),
                ));
            }
            let names = load::names_of(&files);
            if let Some(path) = &args.pairs {
                options.pairs = Some(load::pairs(path, &names)?);
            }
            let images = load::images(&files)?;
            let calibration = calibrate_images(&names, &images, &options, progress)?;
            Ok(Calibrated { calibration, count: names.len(), images })
        }
        load::Input::Csv(path) => {
            let size = args.image_size.ok_or_else(|| {
                CliError::Usage(format!("{}: give the size of the images with --image-size WxH", path.display()))
            })?;
            // Who names the pairs may name any.
            let limit = if args.pairs.is_some() { usize::MAX } else { options.all_pairs_limit };
            let table = load::csv_matches(&path, size, limit)?;
            if let Some(path) = &args.pairs {
                options.pairs = Some(load::pairs(path, &table.names)?);
            }
            let count = table.names.len();
            let mut calibration = calibrate_matches(&table.names, size, &table.pairs, &options, progress)?;
            if table.neighbours_only {
                calibration.warnings.push(Warning::NeighboursOnly { images: count });
            }
            Ok(Calibrated { calibration, count, images: Vec::new() })
        }
    }
}

fn options(args: &CalibrateArgs) -> Options {
    let mut options = Options {
        constraint: args.constraint.into(),
        principal_point_px: args.principal_point,
        aspect: args.aspect,
        lens: args.distortion.into(),
        method: args.method.into(),
        priors: args.prior.clone(),
        height_sigma: args.height_sigma,
        distortion: Distortion::radial(args.k1.unwrap_or(0.0), args.k2.unwrap_or(0.0)),
        attitude_sigma_deg: args.attitude_sigma_deg,
        seed: args.seed,
        ..Options::default()
    };
    options.features.max_features = args.max_features as usize;
    options
}

/// The files of `--out`, the report's page among them if there is one, `calibration.json` last; the folder is made if need be. Returns
/// what the formats cannot say.
fn write_results(
    out: &Path,
    calibration: &Calibration,
    formats: &[Format],
    page: Option<&str>,
) -> Result<Vec<String>, CliError> {
    std::fs::create_dir_all(out)
        .map_err(|e| CliError::Other(format!("cannot make the folder {}: {e}", out.display())))?;
    let json = export::json(calibration, &Flags)?;
    let rendered = export::formats::render(calibration, formats)?;
    if let Some(page) = page {
        export::write_whole(&out.join("report.html"), page.as_bytes())?;
    }
    for file in &rendered.files {
        export::write_whole(&out.join(file.name), file.content.as_bytes())?;
    }
    export::write_whole(&out.join("calibration.json"), json.as_bytes())?;
    Ok(rendered.notes)
}

/// To standard output; a reader that has had enough (`| head`) is no fault.
fn print(text: &str) -> Result<(), CliError> {
    match std::io::stdout().lock().write_all(text.as_bytes()) {
        Err(e) if e.kind() != std::io::ErrorKind::BrokenPipe => {
            Err(CliError::Other(format!("cannot write the result: {e}")))
        }
        _ => Ok(()),
    }
}
