//! `groundcal experiment`: the experiments of the paper on rendered scenes, and real pictures.

use std::{
    path::{Path, PathBuf},
    time::Instant,
};

use clap::{Args, ValueEnum};
use groundcal_io::outputs::Request;
use groundcal_lab::experiments::{
    catalogue::Experiment,
    real,
    setup::{ExperimentOptions, ExperimentOutput},
};

use crate::{
    args::{OverwriteArg, ThreadsArg},
    error::CliError,
    output::{self, Results},
    progress::Bar,
};

/// `groundcal experiment`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  groundcal experiment tripod --out experiments/
  groundcal experiment all --quick --out /tmp/experiments
  groundcal experiment real --data ../shared/data --out experiments/

Writes, for each experiment NAME, the pictures with their truth into the folder NAME, a sheet of them (NAME_views.jpg), the \
table (NAME.txt, NAME.csv), and for tripod and pan-head all subsets of motions (NAME_subsets.csv, .svg, .png), for mobile-head \
the draws of given matches (mobile-head_draws.csv, mobile-head_elevations.csv), for film the rectified floor (film_floor.png). \
`real` writes a table for each set of pictures that is in --data, and real.txt.")]
pub(crate) struct ExperimentArgs {
    /// Which of the paper's experiments
    #[arg(value_enum)]
    pub(crate) experiment: ExperimentArg,

    /// Folder of the sets of real pictures (`real`, and `all`, which leaves them out without it)
    #[arg(long, value_name = "DIR")]
    pub(crate) data: Option<PathBuf>,

    /// Folder for pictures, tables and figures (made if need be)
    #[arg(long, value_name = "DIR")]
    pub(crate) out: PathBuf,

    /// Seed of the pictures' noise, of given matches and of all random choices
    #[arg(long, default_value_t = 0)]
    pub(crate) seed: u64,

    #[command(flatten)]
    pub(crate) overwrite: OverwriteArg,

    #[command(flatten)]
    pub(crate) threads: ThreadsArg,

    /// A first look in a few seconds: pictures of half the size, every other motion, a fifth of the draws
    #[arg(long)]
    pub(crate) quick: bool,
}

/// An experiment on the command line.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum ExperimentArg {
    /// A tripod moved over the floor: 14 motions of varied roll
    Tripod,
    /// A pan head that does not move: 13 pans, the elevation alone varied, the axis 0.2 m from the optical centre
    PanHead,
    /// A pan head on a robot: three pictures, forward, three more; few matches given, and the pictures
    MobileHead,
    /// Two frames of a film from a crane that rises: focal length and rectified floor
    Film,
    /// The tripod through a lens that bends (k1 -0.2), corrected first in each of the ways there are
    Lens,
    /// Real pictures under --data: a turntable, two full turns; sets that are not there are said and skipped
    Real,
    /// All on rendered pictures, and `real` where there is --data
    All,
}

impl ExperimentArg {
    fn work(self, data: Option<&Path>) -> Result<Vec<Work<'_>>, CliError> {
        let real = data.map(Work::Real);
        Ok(match self {
            ExperimentArg::Tripod => vec![Work::Rendered(Experiment::Tripod)],
            ExperimentArg::PanHead => vec![Work::Rendered(Experiment::PanHead)],
            ExperimentArg::MobileHead => vec![Work::Rendered(Experiment::MobileHead)],
            ExperimentArg::Film => vec![Work::Rendered(Experiment::Film)],
            ExperimentArg::Lens => vec![Work::Rendered(Experiment::Lens)],
            ExperimentArg::Real => {
                let missing = || CliError::Usage("`real` needs the folder of its pictures: give --data DIR".into());
                vec![real.ok_or_else(missing)?]
            }
            ExperimentArg::All => Experiment::ALL.map(Work::Rendered).into_iter().chain(real).collect(),
        })
    }
}

/// What is run.
#[derive(Clone, Copy)]
enum Work<'a> {
    Rendered(Experiment),
    /// From the sets in this folder.
    Real(&'a Path),
}

impl Work<'_> {
    fn name(self) -> &'static str {
        match self {
            Work::Rendered(experiment) => experiment.name(),
            Work::Real(_) => real::NAME,
        }
    }

    fn file_names(self, options: &ExperimentOptions) -> Result<Vec<String>, CliError> {
        Ok(match self {
            Work::Rendered(experiment) => experiment.file_names(options)?,
            Work::Real(_) => real::file_names(),
        })
    }

    fn run(self, options: &ExperimentOptions, bar: &Bar) -> Result<ExperimentOutput, CliError> {
        Ok(match self {
            Work::Rendered(experiment) => experiment.run(options, bar)?,
            Work::Real(data) => real::run(data, options, bar)?,
        })
    }
}

/// Runs the experiments asked for; each is written and printed when it is done.
pub(crate) fn run(args: &ExperimentArgs) -> Result<(), CliError> {
    // All of them are asked for before the first.
    let all = args.experiment.work(args.data.as_deref())?;
    for work in &all {
        begin(args, *work)?;
    }
    output::on_threads(args.threads, || experiment(args, &all))
}

fn options(args: &ExperimentArgs) -> ExperimentOptions {
    ExperimentOptions { seed: args.seed, quick: args.quick }
}

/// The files of an experiment, before the work.
fn begin(args: &ExperimentArgs, work: Work) -> Result<Results, CliError> {
    Results::begin(&Request {
        folder: &args.out,
        command: &format!("experiment {}", work.name()),
        names: &work.file_names(&options(args))?,
        inputs: &[],
        basis: None,
        overwrite: args.overwrite.overwrite,
    })
}

fn experiment(args: &ExperimentArgs, all: &[Work]) -> Result<(), CliError> {
    for work in all {
        let began = Instant::now();
        let results = begin(args, *work)?;
        let bar = Bar::new("{msg:24} [{bar:40}] {pos}/{len}");
        let result = work.run(&options(args), &bar)?;
        for file in &result.files {
            results.write(&file.name, &file.bytes)?;
        }
        let finished = results.finish()?;
        output::print(&format!("{}\n", result.page))?;
        finished.tell();
        // Times differ from run to run: not on standard output.
        output::tell(&format!("{}: {:.1} s", work.name(), began.elapsed().as_secs_f64()));
    }
    Ok(())
}
