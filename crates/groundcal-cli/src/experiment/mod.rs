//! `groundcal experiment`: the four experiments of the paper (KZR) on scenes with exact truth, rendered, calibrated and put into
//! tables: constraint by method, errors of focal length, aspect ratio and principal point.

mod contact_sheet;
mod film;
mod methods;
mod mobile;
mod paths;
mod subsets;
mod table;

use std::{
    fmt::Write,
    path::{Path, PathBuf},
    time::Instant,
};

use clap::{Args, ValueEnum};
use groundcal::{
    calibrate::Options,
    error::Error,
    geometry::{frame::Frame, intrinsics::Intrinsics},
    pairs::correspondence::ImagePair,
    result::Calibration,
    start::absolute_conic::Constraint,
    vision::image::GrayImage,
};
use groundcal_lab::renderer::scene::Scene;
use indicatif::{ProgressBar, ProgressStyle};

use crate::error::CliError;
use groundcal_io::{export::write_whole, images::read_images, names::image_names};
use groundcal_lab::render_scene::write_pictures;
use methods::{Measured, Scores};
use table::Line;

/// `groundcal experiment`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  groundcal experiment tripod --out experiments/
  groundcal experiment all --quick --out /tmp/experiments

Writes, for each experiment NAME, the pictures with their truth into the folder NAME, a sheet of them (NAME_views.jpg), the \
table (NAME.txt, NAME.csv), and for tripod and pan-head all subsets of motions (NAME_subsets.csv, .svg, .png), for mobile-head \
the draws of given matches (mobile-head_draws.csv), for film the rectified floor (film_floor.png).")]
pub struct ExperimentArgs {
    /// Which of the paper's experiments
    #[arg(value_enum)]
    pub experiment: ExperimentArg,

    /// Folder for pictures, tables and figures (made if need be)
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,

    /// Seed of the pictures' noise, of given matches and of all random choices
    #[arg(long, default_value_t = 0)]
    pub seed: u64,

    /// Threads [default: all processors]; the result does not depend on it
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub threads: Option<u16>,

    /// A first look in a few seconds: pictures of half the size, every other motion, a fifth of the draws
    #[arg(long)]
    pub quick: bool,
}

/// An experiment on the command line.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum ExperimentArg {
    /// A tripod moved over the floor: 14 motions of varied roll
    Tripod,
    /// A pan head that does not move: 13 pans, the elevation alone varied, the axis 0.2 m from the optical centre
    PanHead,
    /// A pan head on a robot: three pictures, forward, three more; few matches given, and the pictures
    MobileHead,
    /// Two frames of a film from a crane that rises: focal length and rectified floor
    Film,
    /// All four
    All,
}

/// A scene of ours and what the paper reports of its own.
struct Experiment {
    name: &'static str,
    scene: &'static str,
    paper: &'static str,
}

const TRIPOD: Experiment = Experiment {
    name: "tripod",
    scene: include_str!("../../scenes/tripod.toml"),
    paper: "focal length 0.8 % off with `focal`; the best triple of motions 0.1 %",
};
const PAN_HEAD: Experiment = Experiment {
    name: "pan-head",
    scene: include_str!("../../scenes/pan-head.toml"),
    paper: "focal length about 10 % off; the rotating-camera method no better than 62 %",
};
const MOBILE_HEAD: Experiment = Experiment {
    name: "mobile-head",
    scene: include_str!("../../scenes/mobile-head.toml"),
    paper: "focal length 8.2 % off",
};
const FILM: Experiment =
    Experiment { name: "film", scene: include_str!("../../scenes/film.toml"), paper: "focal length 4.5 % off" };

/// Runs the experiments asked for; each is printed when it is done.
pub fn run(args: &ExperimentArgs) -> Result<(), CliError> {
    crate::refuse_file(&args.out)?;
    crate::start_threads(args.threads)?;
    std::fs::create_dir_all(&args.out)
        .map_err(|e| CliError::Other(format!("cannot make the folder {}: {e}", args.out.display())))?;
    let chosen = |e: ExperimentArg| args.experiment == e || args.experiment == ExperimentArg::All;
    type Step = fn(&Setup) -> Result<String, CliError>;
    let steps: [(ExperimentArg, &Experiment, Step); 4] = [
        (ExperimentArg::Tripod, &TRIPOD, tripod),
        (ExperimentArg::PanHead, &PAN_HEAD, pan_head),
        (ExperimentArg::MobileHead, &MOBILE_HEAD, mobile::run),
        (ExperimentArg::Film, &FILM, film::run),
    ];
    for (_, experiment, step) in steps.into_iter().filter(|s| chosen(s.0)) {
        let began = Instant::now();
        let setup = Setup::new(experiment, args)?;
        let page = format!("{}{}", setup.head(), step(&setup)?);
        write_whole(&setup.path(".txt"), page.as_bytes())?;
        setup.bar.finish_and_clear();
        crate::print(&format!("{page}\n"))?;
        let _ = writeln_stderr(&format!("{}: {:.1} s", experiment.name, began.elapsed().as_secs_f64()));
    }
    Ok(())
}

/// Times differ from run to run: not on standard output.
fn writeln_stderr(text: &str) -> std::io::Result<()> {
    use std::io::Write;
    writeln!(std::io::stderr().lock(), "{text}")
}

/// One experiment about to be run.
struct Setup<'a> {
    name: &'static str,
    paper: &'static str,
    /// The scene of the pictures.
    scene: Scene,
    /// The same at full size.
    full_scene: Scene,
    truth: Intrinsics,
    out: &'a Path,
    seed: u64,
    quick: bool,
    bar: ProgressBar,
}

/// The pictures as read back from their files, and the matches of the motions.
struct Pictures {
    names: Vec<String>,
    images: Vec<GrayImage>,
    matched: Vec<ImagePair>,
}

impl Pictures {
    /// The program's own method, told that all pairs are motions.
    fn groundcal(&self, options: &Options, truth: &Intrinsics) -> Result<(Scores, Calibration), Error> {
        let pairs = self.matched.iter().map(|p| (p.from, p.to)).collect();
        let options = Options { pairs: Some(pairs), ..options.clone() };
        methods::groundcal(&self.names, &self.images, &self.matched, &options, truth)
    }
}

impl<'a> Setup<'a> {
    fn new(experiment: &Experiment, args: &'a ExperimentArgs) -> Result<Self, CliError> {
        let wrong = |e: toml::de::Error| CliError::Other(format!("scene {}: {e}", experiment.name));
        let mut full_scene: Scene = toml::from_str(experiment.scene).map_err(wrong)?;
        full_scene.seed = full_scene.seed.wrapping_add(args.seed.wrapping_mul(1000));
        let mut scene = full_scene.clone();
        if args.quick {
            reduce(&mut scene);
        }
        let bar = ProgressBar::new(scene.view_count() as u64);
        if let Ok(style) = ProgressStyle::with_template("{msg:24} [{bar:40}] {pos}/{len}") {
            bar.set_style(style.progress_chars("=> "));
        }
        Ok(Self {
            name: experiment.name,
            paper: experiment.paper,
            truth: scene.camera.intrinsics(),
            scene,
            full_scene,
            out: &args.out,
            seed: args.seed,
            quick: args.quick,
            bar,
        })
    }

    /// A file of this experiment.
    fn path(&self, ending: &str) -> PathBuf {
        self.out.join(format!("{}{ending}", self.name))
    }

    fn head(&self) -> String {
        let t = &self.truth;
        let [w, h] = self.scene.camera.image_size;
        let quick = if self.quick { " (--quick)" } else { "" };
        let mut page = String::new();
        // Writing to a string cannot fail.
        let _ = writeln!(page, "{}{quick}: {} pictures, {w} x {h} px", self.name, self.scene.view_count());
        let _ = writeln!(page, "truth: fx {:.2}, fy {:.2}, cx {:.2}, cy {:.2} px", t.fx, t.fy, t.cx, t.cy);
        let _ = writeln!(page, "the paper, on its own pictures: {}\n", self.paper);
        page
    }

    /// Renders the pictures into the folder of the experiment, reads them as `calibrate` would, and matches the pairs.
    fn pictures(&self, pairs: &[(usize, usize)], columns: u32) -> Result<Pictures, CliError> {
        self.bar.set_message(format!("{}: rendering", self.name));
        let folder = self.path("");
        let rendered = write_pictures(&self.scene, self.name, &folder, |_| self.bar.inc(1))?;
        write_whole(&self.path("_views.jpg"), &contact_sheet::jpeg(&rendered, columns)?)?;
        let files: Vec<PathBuf> = self.scene.views().map(|(_, v)| folder.join(&v.file)).collect();
        self.bar.set_message(format!("{}: calibrating", self.name));
        let images = read_images(&files)?.images;
        let matched = methods::match_pairs(&images, pairs, &Options::default());
        Ok(Pictures { names: image_names(&files), images, matched })
    }

    /// All pairs of matches count as motions.
    fn options(&self, constraint: Constraint, told_centre: bool) -> Options {
        let principal_point_px = told_centre.then_some([self.truth.cx, self.truth.cy]);
        Options { constraint, principal_point_px, seed: self.seed, ..Options::default() }
    }

    fn frame(&self, told_centre: bool) -> Frame {
        Frame::new(self.scene.camera.size(), told_centre.then_some([self.truth.cx, self.truth.cy]))
    }

    /// The linear method (but for `auto`, which it does not know) and ours under each constraint, told which pairs are motions;
    /// at the end under `focal` with the true principal point.
    fn lines(&self, pictures: &Pictures, constraints: &[Constraint]) -> Result<Vec<Line>, CliError> {
        let mut lines = Vec::new();
        let told = constraints.iter().map(|&c| (c, false)).chain([(Constraint::Focal, true)]);
        for (constraint, told_centre) in told {
            let line = |input, method, outcome| {
                let motions = pictures.matched.len();
                Line { input, constraint, told_centre, method, motions, outcome }
            };
            let options = self.options(constraint, told_centre);
            if constraint != Constraint::Auto {
                let measured = methods::measure(&pictures.matched, self.frame(told_centre), &options);
                let outcome = measured.and_then(|m| methods::linear(&m, &self.truth, constraint));
                lines.push(line("features", "linear", accept(outcome)?));
            }
            let found = pictures.groundcal(&options, &self.truth);
            lines.push(line("pictures", "groundcal", accept(found.map(|f| f.0))?));
        }
        Ok(lines)
    }

    /// Writes the table and gives it as text.
    fn table(&self, lines: &[Line]) -> Result<String, CliError> {
        write_whole(&self.path(".csv"), &table::csv(self.name, lines)?)?;
        Ok(table::text(lines))
    }
}

/// A refusal is a result of the experiment; anything else that goes wrong is not.
fn accept<T>(outcome: Result<T, Error>) -> Result<Result<T, Error>, CliError> {
    match outcome {
        Err(error) if !error.is_degenerate() => Err(error.into()),
        other => Ok(other),
    }
}

/// Pictures of half the size and every other attitude (where there are several).
fn reduce(scene: &mut Scene) {
    let k = scene.camera.intrinsics();
    let c = &mut scene.camera;
    c.image_size = c.image_size.map(|n| n / 2);
    (c.fx, c.fy) = (0.5 * k.fx, c.fy.map(|f| 0.5 * f));
    // Pixel (0, 0) is the centre of a pixel: its corner keeps its place.
    (c.cx, c.cy) = (Some(0.5 * (k.cx + 0.5) - 0.5), Some(0.5 * (k.cy + 0.5) - 0.5));
    let mut index = 0;
    scene.groups.retain(|_| {
        index += 1;
        index % 2 == 1
    });
}

/// The two views of every attitude.
fn pairs_of(scene: &Scene) -> Vec<(usize, usize)> {
    (0..scene.groups.len()).map(|i| (2 * i, 2 * i + 1)).collect()
}

fn tripod(setup: &Setup) -> Result<String, CliError> {
    use Constraint::*;
    let pictures = setup.pictures(&pairs_of(&setup.scene), 7)?;
    let lines = setup.lines(&pictures, &[Full, ZeroSkew, Square, FixedPrincipalPoint, Focal, Auto])?;
    let measured = methods::measure(&pictures.matched, setup.frame(false), &setup.options(Focal, false))?;
    let minimal = [(Focal, 1), (Square, 2), (ZeroSkew, 2), (Full, 3)];
    let subsets = subsets::report(setup.name, setup.out, &measured, &setup.truth, &minimal)?;
    Ok(format!("{}{}\n{subsets}", motions(&measured), setup.table(&lines)?))
}

fn pan_head(setup: &Setup) -> Result<String, CliError> {
    use Constraint::*;
    let pictures = setup.pictures(&pairs_of(&setup.scene), 7)?;
    let measured = methods::measure(&pictures.matched, setup.frame(false), &setup.options(Focal, false))?;
    let mut lines = setup.lines(&pictures, &[Full, ZeroSkew, Square, FixedPrincipalPoint, Focal, Auto])?;
    for constraint in [Full, ZeroSkew, Square, FixedPrincipalPoint, Focal] {
        let outcome = accept(methods::rotating(&measured, &setup.truth, constraint))?;
        let (input, method, motions) = ("features", "rotating camera", pictures.matched.len());
        lines.push(Line { input, constraint, told_centre: false, method, motions, outcome });
    }
    let minimal = [(Focal, 1), (FixedPrincipalPoint, 2), (Square, 2), (ZeroSkew, 3)];
    let subsets = subsets::report(setup.name, setup.out, &measured, &setup.truth, &minimal)?;
    Ok(format!("{}{}\n{subsets}", motions(&measured), setup.table(&lines)?))
}

/// A line on the motions.
fn motions(measured: &Measured) -> String {
    let count = measured.homographies.len();
    let [fewest, most] = measured.matches;
    let range = if fewest == most { format!("{most}") } else { format!("{fewest} to {most}") };
    let plural = if count == 1 { "" } else { "s" };
    let still = count - measured.motions.len();
    let left_out = if still == 0 { String::new() } else { format!("; {still} show no turn above their noise") };
    format!("{count} motion{plural} of {range} matched features{left_out}\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_scenes_are_valid_and_halves_of_them_too() {
        for experiment in [TRIPOD, PAN_HEAD, MOBILE_HEAD, FILM] {
            let mut scene: Scene = toml::from_str(experiment.scene).unwrap();
            scene.validate().unwrap();
            let full = scene.clone();
            reduce(&mut scene);
            scene.validate().unwrap();
            // The same point of the floor is seen at the same place of the picture.
            let (_, view) = scene.views().next().unwrap();
            let yaw = view.yaw_deg.to_radians();
            let point = nalgebra::Vector3::new(view.centre_m[0] + yaw.cos(), view.centre_m[1] + yaw.sin(), 0.0);
            let at = |s: &Scene| s.pixel_from_world(0, &point).unwrap().unwrap().add_scalar(0.5);
            assert!((at(&full) - at(&scene) * 2.0).norm() < 1e-9);
        }
    }

    #[test]
    fn motions_keep_their_attitude_and_the_head_its_axis() {
        for (experiment, motions) in [(TRIPOD, 14), (PAN_HEAD, 13)] {
            let scene: Scene = toml::from_str(experiment.scene).unwrap();
            assert_eq!((scene.groups.len(), scene.view_count()), (motions, 2 * motions));
            for group in &scene.groups {
                let [a, b] = [&group.views[0], &group.views[1]];
                assert!(a.centre_m[2] == b.centre_m[2] && (a.yaw_deg - b.yaw_deg).abs() > 10.0);
            }
        }
        let head: Scene = toml::from_str(PAN_HEAD.scene).unwrap();
        for (_, view) in head.views() {
            let yaw = view.yaw_deg.to_radians();
            let [x, y, _] = view.centre_m;
            assert!((x - 0.2 * yaw.cos()).hypot(y - 0.2 * yaw.sin()) < 1e-4);
        }
    }
}
