//! `groundcal simulate`: the studies of the paper and three beside them.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use groundcal::geometry::ImageSize;
use groundcal_lab::studies::{catalogue::Study, figure4, setting::Asked};

use crate::{
    args::{OverwriteArg, ThreadsArg, parse_size},
    error::CliError,
    output::{self, Finished, Results, canvas_names},
    progress::Bar,
};
use groundcal_io::outputs::Request;

/// `groundcal simulate`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  groundcal simulate noise --out study/            noise.csv, noise.svg, noise.png
  groundcal simulate all --trials 1000 --out study/
  groundcal simulate offset --matches 20 --roll-deg 10 --image-size 640x480 --out study/

The nominal condition: noise 1 px, rotation axis 0.2 m behind the optical centre, turns of 15 degrees, three motions, the \
camera 3 m over the floor, 200 matches a motion (and 20), 1280 x 960 pixels, f about 1000 px; attitudes wide (rolls to 45 \
degrees), and narrow (rolls within 10 degrees).")]
pub(crate) struct SimulateArgs {
    /// What is varied
    #[arg(value_enum)]
    pub(crate) study: StudyArg,

    /// Matches of each motion [default: 200, and 20; `subsets`: 200]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(6..=10_000))]
    pub(crate) matches: Option<u32>,

    /// Rolls within so many degrees of level, to either side, in place of the wide attitudes and the narrow ones (10)
    #[arg(long, value_name = "DEG", value_parser = parse_roll)]
    pub(crate) roll_deg: Option<f64>,

    /// Standard deviation of each image coordinate in pixels where the study does not vary it [default: 1]
    #[arg(long, value_name = "PX", value_parser = parse_noise)]
    pub(crate) noise_px: Option<f64>,

    /// Image size; the field of view stays as it is [default: 1280x960]
    #[arg(long, value_name = "WxH", value_parser = parse_size)]
    pub(crate) image_size: Option<ImageSize>,

    /// Trials for each point of a curve
    #[arg(long, value_name = "N", default_value_t = 200, value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    pub(crate) trials: u32,

    /// Seed of all random choices
    #[arg(long, default_value_t = 0)]
    pub(crate) seed: u64,

    #[command(flatten)]
    pub(crate) overwrite: OverwriteArg,

    #[command(flatten)]
    pub(crate) threads: ThreadsArg,

    /// Folder for STUDY.csv, STUDY.svg and STUDY.png (made if need be)
    #[arg(long, value_name = "DIR")]
    pub(crate) out: PathBuf,
}

/// [`Study`] on the command line.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum StudyArg {
    /// Image noise, 0 to 4 px
    Noise,
    /// Distance of the rotation axis, 0.02 to 100 m
    Offset,
    /// Number of motions, 3 to 20
    Motions,
    /// Rotation angle, 2 to 60 degrees, about axes through the optical centre and 0.2 m from it
    Angle,
    /// Angle between rotation axis and floor normal, 0 to 10 degrees
    Axis,
    /// Radial distortion of one parameter, by noise 0 to 1 px: bias of the closed form and of minimising
    Radial,
    /// One motion carried into other views against motions of their own, turning by 1 to 45 degrees
    Transfer,
    /// All subsets of 2, 3, 4 and 6 out of twelve motions: predicted and true errors
    Subsets,
    /// Views from anywhere before a plane: their number, 3 to 15, and the spread of their tilts, 5 to 50 degrees
    General,
    /// All nine
    All,
}

impl StudyArg {
    fn studies(self) -> Vec<Study> {
        match self {
            StudyArg::Noise => vec![Study::Figure4(figure4::Study::Noise)],
            StudyArg::Offset => vec![Study::Figure4(figure4::Study::Offset)],
            StudyArg::Motions => vec![Study::Figure4(figure4::Study::Motions)],
            StudyArg::Angle => vec![Study::Figure4(figure4::Study::Angle)],
            StudyArg::Axis => vec![Study::Figure4(figure4::Study::Axis)],
            StudyArg::Radial => vec![Study::Radial],
            StudyArg::Transfer => vec![Study::Transfer],
            StudyArg::Subsets => vec![Study::Subsets],
            StudyArg::General => vec![Study::General],
            StudyArg::All => Study::all(),
        }
    }
}

/// A number of degrees from level.
fn parse_roll(text: &str) -> Result<f64, String> {
    number_within(text, 90.0, "degrees")
}

/// A standard deviation in pixels.
fn parse_noise(text: &str) -> Result<f64, String> {
    number_within(text, 100.0, "pixels")
}

fn number_within(text: &str, most: f64, unit: &str) -> Result<f64, String> {
    let number = text.trim().parse::<f64>().ok().filter(|v| (0.0..=most).contains(v));
    number.ok_or_else(|| format!("expected a number of {unit} from 0 to {most}"))
}

/// Runs the studies asked for. The files of a study appear together; those of one that is done stay when a later one is interrupted.
pub(crate) fn run(args: &SimulateArgs) -> Result<(), CliError> {
    let studies = args.study.studies();
    if let ([only], Some(noise)) = (studies.as_slice(), args.noise_px)
        && only.varies_noise()
    {
        return Err(CliError::Usage(format!("--noise-px {noise}: `{}` varies the noise itself", only.name())));
    }
    if let ([only], Some(deg)) = (studies.as_slice(), args.roll_deg)
        && !only.knows_rolls()
    {
        return Err(CliError::Usage(format!(
            "--roll-deg {deg}: the views of `{}` are rolled by any angle",
            only.name()
        )));
    }
    // All of them are asked for before the first.
    for study in &studies {
        begin(args, *study)?;
    }
    let (page, finished) = output::on_threads(args.threads, || simulate(args, &studies))?;
    output::print(&page)?;
    finished.iter().for_each(Finished::tell);
    Ok(())
}

/// The files of a study, before the work.
fn begin(args: &SimulateArgs, study: Study) -> Result<Results, CliError> {
    let names: Vec<String> = [table(study)].into_iter().chain(canvas_names(study.name())).collect();
    Results::begin(&Request {
        folder: &args.out,
        command: &format!("simulate {}", study.name()),
        names: &names,
        inputs: &[],
        basis: None,
        overwrite: args.overwrite.overwrite,
    })
}

fn table(study: Study) -> String {
    format!("{}.csv", study.name())
}

fn simulate(args: &SimulateArgs, studies: &[Study]) -> Result<(String, Vec<Finished>), CliError> {
    let bar = Bar::new("{msg:24} [{bar:40}] {pos}/{len} trials, {eta} left");
    let asked = Asked {
        matches: args.matches.map(|n| n as usize),
        roll_deg: args.roll_deg,
        noise_px: args.noise_px,
        size: args.image_size,
    };
    let (mut page, mut finished) = (String::new(), Vec::new());
    for study in studies {
        let results = begin(args, *study)?;
        let result = study.run(&asked, args.trials, args.seed, &bar)?;
        results.write(&table(*study), &result.table)?;
        results.write_canvas(study.name(), &result.figure.layout())?;
        finished.push(results.finish()?);
        page.push_str(&result.page);
    }
    Ok((page, finished))
}
