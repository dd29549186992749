//! Mutated inputs for every reader, and for calibrations from matches.
//!
//! An input is taken from a pool, mutated and given to a target. A panic, a message that no user should see, memory beyond 2 GB or ten
//! seconds of work without an end are findings, and their inputs are kept. What a target answers, numbers and names taken out, is its
//! signature: an input with a signature that was not seen before joins the pool, so that the search goes deeper where the reader does.
//! That takes the place of counting branches, for which a compiler other than the stable one is needed.
//!
//! ```text
//! cargo run --release -p groundcal-fuzz -- --seconds 3600              each target for an hour
//! cargo run --release -p groundcal-fuzz -- --target tables --seed 7 --seconds 60
//! cargo run --release -p groundcal-fuzz -- --target cameras --replay FILE
//! ```

#![forbid(unsafe_code)]

mod mutate;
mod run;
mod seeds;
mod signature;
mod targets;
mod watch;

use std::{path::PathBuf, process::ExitCode, time::Duration};

use clap::Parser;

use run::{Findings, Run};
use targets::TARGETS;

/// Gives mutated inputs to groundcal's readers and to calibrations from matches.
#[derive(Debug, Parser)]
struct Args {
    /// One target [default: all, one after the other]
    #[arg(long, value_name = "NAME")]
    target: Option<String>,

    /// Seconds for each target
    #[arg(long, value_name = "S", default_value_t = 5)]
    seconds: u64,

    /// Seed of the mutations
    #[arg(long, default_value_t = 0)]
    seed: u64,

    /// Folder for the inputs of findings
    #[arg(long, value_name = "DIR", default_value = "target/fuzz")]
    findings: PathBuf,

    /// Gives this file to the target, unchanged, and ends
    #[arg(long, value_name = "FILE", requires = "target")]
    replay: Option<PathBuf>,
}

fn main() -> ExitCode {
    let args = Args::parse();
    let chosen: Vec<_> = TARGETS.iter().filter(|t| args.target.as_ref().is_none_or(|name| name == t.name)).collect();
    if chosen.is_empty() {
        let names: Vec<&str> = TARGETS.iter().map(|t| t.name).collect();
        eprintln!("error: no such target; there are {}", names.join(", "));
        return ExitCode::from(2);
    }
    let result = chosen.into_iter().try_fold(Findings::default(), |mut all, target| {
        let run = Run {
            target,
            seed: args.seed,
            time: Duration::from_secs(args.seconds),
            folder: &args.findings,
            replay: args.replay.as_deref(),
        };
        all.add(run.run()?);
        Ok::<_, std::io::Error>(all)
    });
    match result {
        Ok(all) => {
            println!("{all}");
            ExitCode::from(u8::from(all.any()))
        }
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}
