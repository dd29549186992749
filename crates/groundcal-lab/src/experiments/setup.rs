//! One experiment about to be run: its scene, its pictures, and what the methods make of them.

use std::{fmt::Write, path::Path};

use groundcal::{
    Error, MotionModel, Options, Silent,
    geometry::{Frame, Intrinsics},
    match_images,
    pairs::ImagePair,
    result::Calibration,
    start::Constraint,
    vision::GrayImage,
};
use groundcal_io::images::read_image_bytes;

use crate::{
    error::LabError,
    experiments::{
        contact_sheet,
        methods::{self, Measured, Scores},
        table::{self, Line},
    },
    progress::Progress,
    render_scene::{self, Rendered, TRUTH, render_pictures, truth_json},
    renderer::scene::Scene,
};

/// Endings of the files that every experiment has: the sheet of its pictures, the table, the page.
const VIEWS: &str = "_views.jpg";
const CSV: &str = ".csv";
const TXT: &str = ".txt";

/// A scene of ours and what the paper reports of its own.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Description {
    /// Name in tables and file names.
    pub(crate) name: &'static str,
    /// The scene file.
    pub(crate) scene: &'static str,
    /// The paper's result.
    pub(crate) paper: &'static str,
}

/// How an experiment is run.
#[derive(Debug, Clone, Copy, Default)]
pub struct ExperimentOptions {
    /// Seed of the pictures' noise, of given matches and of all random choices.
    pub seed: u64,
    /// Pictures of half the size, every other motion, a fifth of the draws.
    pub quick: bool,
}

/// A file that an experiment gives.
#[derive(Debug, Clone)]
pub struct OutputFile {
    /// Where it belongs under the folder of all experiments, with `/` between folder and file.
    pub name: String,
    /// Its content.
    pub bytes: Vec<u8>,
}

/// What an experiment gives: the page, also among the files, and the files in the order in which they are to be written.
#[derive(Debug, Clone)]
pub struct ExperimentOutput {
    /// Truth, table and remarks as text.
    pub page: String,
    /// Pictures, tables and figures; the page comes last.
    pub files: Vec<OutputFile>,
}

/// One experiment about to be run.
pub(crate) struct Setup<'a> {
    pub(crate) name: &'static str,
    paper: &'static str,
    /// The scene of the pictures.
    pub(crate) scene: Scene,
    /// The same at full size.
    pub(crate) full_scene: Scene,
    pub(crate) truth: Intrinsics,
    pub(crate) seed: u64,
    pub(crate) quick: bool,
    progress: &'a dyn Progress,
}

/// The pictures as read back from their files, and the matches of the motions.
pub(crate) struct Pictures {
    names: Vec<String>,
    /// As rendered and encoded.
    pub(crate) rendered: Vec<Rendered>,
    pub(crate) images: Vec<GrayImage>,
    pub(crate) matched: Vec<ImagePair>,
    /// The pictures with their truth, and a sheet of them.
    pub(crate) files: Vec<OutputFile>,
}

impl Pictures {
    /// Names of their files.
    pub(crate) fn names(&self) -> &[String] {
        &self.names
    }

    /// The program's own method, told that all pairs are motions.
    pub(crate) fn groundcal(&self, options: &Options, truth: &Intrinsics) -> Result<(Scores, Calibration), Error> {
        let pairs = self.matched.iter().map(|p| (p.from, p.to)).collect();
        let options = Options { pairs: Some(pairs), motion: MotionModel::PlaneNormal, ..options.clone() };
        methods::groundcal(&self.names, &self.images, &self.matched, &options, truth)
    }
}

impl<'a> Setup<'a> {
    pub(crate) fn new(
        description: &Description,
        options: &ExperimentOptions,
        progress: &'a dyn Progress,
    ) -> Result<Self, LabError> {
        let wrong = |e: toml::de::Error| LabError::Other(format!("scene {}: {e}", description.name));
        let mut full_scene: Scene = toml::from_str(description.scene).map_err(wrong)?;
        full_scene.seed = full_scene.seed.wrapping_add(options.seed.wrapping_mul(1000));
        let mut scene = full_scene.clone();
        if options.quick {
            reduce(&mut scene);
        }
        Ok(Self {
            name: description.name,
            paper: description.paper,
            truth: scene.camera.intrinsics(),
            scene,
            full_scene,
            seed: options.seed,
            quick: options.quick,
            progress,
        })
    }

    /// A file of this experiment, named after it.
    pub(crate) fn file(&self, ending: &str, bytes: Vec<u8>) -> OutputFile {
        OutputFile { name: format!("{}{ending}", self.name), bytes }
    }

    /// A file in the folder of this experiment's pictures.
    fn picture_file(&self, file: &str, bytes: Vec<u8>) -> OutputFile {
        OutputFile { name: format!("{}/{file}", self.name), bytes }
    }

    /// Names of all files: those of the scene, and those that end so.
    pub(crate) fn file_names(&self, endings: &[&str]) -> Vec<String> {
        let pictures = render_scene::file_names(&self.scene).into_iter().map(|f| format!("{}/{f}", self.name));
        let all = [VIEWS, CSV, TXT].iter().chain(endings);
        pictures.chain(all.map(|ending| format!("{}{ending}", self.name))).collect()
    }

    /// What is looked at, the truth, and the paper's result.
    pub(crate) fn head(&self) -> String {
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

    /// Renders the pictures, reads them as `calibrate` would from their files, and matches the pairs.
    pub(crate) fn pictures(&self, pairs: &[(usize, usize)], columns: u32) -> Result<Pictures, LabError> {
        self.progress.begin(&format!("{}: rendering", self.name), self.scene.view_count() as u64);
        let rendered = render_pictures(&self.scene, self.name, |_| self.progress.advance())?;
        self.progress.begin(&format!("{}: calibrating", self.name), 0);
        let folder = Path::new(self.name);
        let read = |r: &Rendered| read_image_bytes(&folder.join(&r.file), &r.bytes);
        let images = rendered.iter().map(read).collect::<Result<Vec<_>, _>>()?;
        let matched = match_images(&images, pairs, &Options::default(), &Silent)?;
        let inside = |r: &Rendered| self.picture_file(&r.file, r.bytes.clone());
        let mut files: Vec<OutputFile> = rendered.iter().map(inside).collect();
        files.push(self.picture_file(TRUTH, truth_json(&self.scene)?.into_bytes()));
        let pictures: Vec<_> = rendered.iter().map(|r| &r.picture).collect();
        files.push(self.file(VIEWS, contact_sheet::jpeg(&pictures, columns)?));
        Ok(Pictures { names: rendered.iter().map(|r| r.file.clone()).collect(), rendered, images, matched, files })
    }

    /// All pairs of matches count as motions.
    pub(crate) fn options(&self, constraint: Constraint, told_centre: bool) -> Options {
        let principal_point_px = told_centre.then_some([self.truth.cx, self.truth.cy]);
        Options { constraint, principal_point_px, seed: self.seed, ..Options::default() }
    }

    pub(crate) fn frame(&self, told_centre: bool) -> Frame {
        Frame::new(self.scene.camera.size(), told_centre.then_some([self.truth.cx, self.truth.cy]))
    }

    /// The linear method (but for `auto`, which it does not know) and ours under each constraint, told which pairs are motions;
    /// at the end under `focal` with the true principal point.
    pub(crate) fn lines(&self, pictures: &Pictures, constraints: &[Constraint]) -> Result<Vec<Line>, LabError> {
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

    /// The table as a file and as text.
    pub(crate) fn table(&self, lines: &[Line]) -> Result<(OutputFile, String), LabError> {
        Ok((self.file(CSV, table::csv(self.name, lines)?), table::text(lines)))
    }

    /// The experiment's output: the head and the page of its results, and the files with that page at the end.
    pub(crate) fn output(&self, results: &str, mut files: Vec<OutputFile>) -> ExperimentOutput {
        let page = format!("{}{results}", self.head());
        files.push(self.file(TXT, page.clone().into_bytes()));
        self.progress.finish();
        ExperimentOutput { page, files }
    }
}

/// A refusal is a result of the experiment; anything else that goes wrong is not.
pub(crate) fn accept<T>(outcome: Result<T, Error>) -> Result<Result<T, Error>, LabError> {
    match outcome {
        Err(error) if !error.is_degenerate() => Err(error.into()),
        other => Ok(other),
    }
}

/// Pictures of half the size and every other attitude (where there are several).
pub(crate) fn reduce(scene: &mut Scene) {
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
pub(crate) fn pairs_of(scene: &Scene) -> Vec<(usize, usize)> {
    (0..scene.groups.len()).map(|i| (2 * i, 2 * i + 1)).collect()
}

/// A line on the motions.
pub(crate) fn motions(measured: &Measured) -> String {
    let count = measured.homographies.len();
    let [fewest, most] = measured.matches;
    let range = if fewest == most { format!("{most}") } else { format!("{fewest} to {most}") };
    let plural = if count == 1 { "" } else { "s" };
    let still = count - measured.motions.len();
    let left_out = if still == 0 { String::new() } else { format!("; {still} show no turn above their noise") };
    format!("{count} motion{plural} of {range} matched features{left_out}\n")
}
