//! `groundcal experiment`: the four experiments of the paper on rendered scenes.

use std::{path::PathBuf, time::Instant};

use clap::{Args, ValueEnum};
use groundcal_io::outputs::Request;
use groundcal_lab::experiments::{catalogue::Experiment, setup::ExperimentOptions};

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

Writes, for each experiment NAME, the pictures with their truth into the folder NAME, a sheet of them (NAME_views.jpg), the \
table (NAME.txt, NAME.csv), and for tripod and pan-head all subsets of motions (NAME_subsets.csv, .svg, .png), for mobile-head \
the draws of given matches (mobile-head_draws.csv), for film the rectified floor (film_floor.png).")]
pub(crate) struct ExperimentArgs {
    /// Which of the paper's experiments
    #[arg(value_enum)]
    pub(crate) experiment: ExperimentArg,

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
    /// All four
    All,
}

impl ExperimentArg {
    fn experiments(self) -> Vec<Experiment> {
        match self {
            ExperimentArg::Tripod => vec![Experiment::Tripod],
            ExperimentArg::PanHead => vec![Experiment::PanHead],
            ExperimentArg::MobileHead => vec![Experiment::MobileHead],
            ExperimentArg::Film => vec![Experiment::Film],
            ExperimentArg::All => Experiment::ALL.to_vec(),
        }
    }
}

/// Runs the experiments asked for; each is written and printed when it is done.
pub(crate) fn run(args: &ExperimentArgs) -> Result<(), CliError> {
    // All of them are asked for before the first.
    for experiment in args.experiment.experiments() {
        begin(args, experiment)?;
    }
    output::on_threads(args.threads, || experiment(args))
}

fn options(args: &ExperimentArgs) -> ExperimentOptions {
    ExperimentOptions { seed: args.seed, quick: args.quick }
}

/// The files of an experiment, before the work.
fn begin(args: &ExperimentArgs, experiment: Experiment) -> Result<Results, CliError> {
    Results::begin(&Request {
        folder: &args.out,
        command: &format!("experiment {}", experiment.name()),
        names: &experiment.file_names(&options(args))?,
        inputs: &[],
        basis: None,
        overwrite: args.overwrite.overwrite,
    })
}

fn experiment(args: &ExperimentArgs) -> Result<(), CliError> {
    for experiment in args.experiment.experiments() {
        let began = Instant::now();
        let results = begin(args, experiment)?;
        let bar = Bar::new("{msg:24} [{bar:40}] {pos}/{len}");
        let result = experiment.run(&options(args), &bar)?;
        for file in &result.files {
            results.write(&file.name, &file.bytes)?;
        }
        let finished = results.finish()?;
        output::print(&format!("{}\n", result.page))?;
        finished.tell();
        // Times differ from run to run: not on standard output.
        output::tell(&format!("{}: {:.1} s", experiment.name(), began.elapsed().as_secs_f64()));
    }
    Ok(())
}
