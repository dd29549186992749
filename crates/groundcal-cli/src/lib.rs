//! The groundcal program as a library: arguments, progress, files and exit codes; the work is done by the other crates.
//!
//! [`run`] is the whole program, for whoever wants to be it under another name or from another language.

#![forbid(unsafe_code)]

mod args;
mod commands;
mod error;
mod foreign;
mod interrupt;
mod output;
mod progress;
mod remedies;
mod scale;
mod terminal;

use std::{
    ffi::{OsStr, OsString},
    io::Write,
    path::Path,
};

use clap::{CommandFactory, FromArgMatches, Parser, Subcommand};

use commands::{
    calibrate, compare, completions, convert, experiment, floor, man, plan, rectify, render, simulate, uncertainty,
    undistort,
};
use error::CliError;
use groundcal_io::text;
use terminal::{ColorArg, TerminalArgs};

pub use interrupt::end_on_signals;

/// Runs the program with a command line whose first word is the program's name; gives its exit code.
///
/// Results go to standard output and to the files asked for, progress and messages to standard error. It may be called more than once
/// in a process.
///
/// ```
/// assert_eq!(groundcal_cli::run(["groundcal", "calibrate"].map(Into::into)), 2);
/// ```
pub fn run(args: impl IntoIterator<Item = OsString>) -> u8 {
    let args = points_last(with_command(args.into_iter().collect()));
    let mut cli = match parsed(&args) {
        Ok(cli) => cli,
        Err(error) => {
            print_words_of_clap(&args, &error);
            return u8::try_from(error.exit_code()).unwrap_or(error::OTHER);
        }
    };
    if let Command::Calibrate(of) = &mut cli.command {
        of.command_line = command_line(&args);
    }
    terminal::set_quiet(cli.terminal.quiet);
    terminal::set_progress(cli.terminal.progress);
    let json = cli.command.prints_json();
    let color = cli.terminal.color;
    match dispatch(cli.command, cli.terminal) {
        Ok(()) => error::SUCCESS,
        Err(CliError::Stopped(code)) => {
            let _ = writeln!(std::io::stderr(), "interrupted");
            code
        }
        Err(error) => {
            // Who reads standard output as JSON gets the error so too.
            if let (true, Ok(text)) = (json, serde_json::to_string_pretty(&error.report())) {
                let _ = output::print_json(&(text + "\n"));
            }
            let text = terminal::fitted(&format!("error: {error}"));
            let text = match text.strip_prefix("error") {
                Some(rest) if color.of(&std::io::stderr()) => format!("\u{1b}[1;31merror\u{1b}[0m{rest}"),
                _ => text,
            };
            let _ = writeln!(std::io::stderr(), "{text}");
            error.exit_code()
        }
    }
}

/// Options that decide where results go and how fast, not what they are.
const OF_THE_RUN: [&str; 4] = ["--out", "--threads", "--overwrite", "--json"];

/// As it could be typed again, without what makes no difference to the results: the same input gives the same page.
fn command_line(args: &[OsString]) -> String {
    let word = |arg: &OsString| {
        let text = arg.to_string_lossy();
        let plain = |c: char| c.is_alphanumeric() || "-_./=,:+#@%".contains(c);
        match text.chars().all(plain) && !text.is_empty() {
            true => text.into_owned(),
            false => format!("'{}'", text.replace('\'', "'\\''")),
        }
    };
    let mut rest: Vec<String> = Vec::new();
    let mut all = args.iter().skip(1);
    while let Some(arg) = all.next() {
        let text = arg.to_string_lossy();
        match OF_THE_RUN.iter().find(|name| text.split('=').next() == Some(**name)) {
            Some(name) => {
                // A value may stand by itself.
                if ["--out", "--threads"].contains(name) && !text.contains('=') {
                    all.next();
                }
            }
            None => rest.push(word(arg)),
        }
    }
    text::printable(&format!("groundcal {}", rest.join(" "))).into_owned()
}

/// The command line as the parser reads it, with colours as it says itself.
fn parsed(args: &[OsString]) -> Result<Cli, clap::Error> {
    let mut command = Cli::command().color(ColorArg::in_words(args).choice());
    let matches = command.try_get_matches_from_mut(args)?;
    Cli::from_arg_matches(&matches).map_err(|error| error.format(&mut command))
}

/// `groundcal FOLDER` stands for `groundcal calibrate FOLDER`: where the first word is no command but something that is there, or a pattern.
fn with_command(mut args: Vec<OsString>) -> Vec<OsString> {
    let Some(first) = args.get(1) else { return args };
    let is_command = |word: &OsStr| {
        let names = |c: &clap::Command| c.get_name_and_visible_aliases().iter().any(|name| word == *name);
        word == "help" || Cli::command().get_subcommands().any(names)
    };
    let pattern = first.to_str().is_some_and(|text| text.contains(['*', '?', '[']) && !text.starts_with('-'));
    if !is_command(first) && (pattern || Path::new(first).exists()) {
        args.insert(1, "calibrate".into());
    }
    args
}

/// Coordinates of `groundcal floor` may begin with a minus, which the parser takes for an option: they go last, after `--`.
fn points_last(args: Vec<OsString>) -> Vec<OsString> {
    if args.get(1).is_none_or(|word| word != "floor") || args.iter().any(|word| word == "--") {
        return args;
    }
    let is_point =
        |word: &OsString| word.to_str().is_some_and(|text| text.starts_with('-') && args::parse_point(text).is_ok());
    if !args.iter().any(is_point) {
        return args;
    }
    let of_points = |word: &OsString| word.to_str().is_some_and(|text| args::parse_point(text).is_ok());
    let (points, rest): (Vec<OsString>, Vec<OsString>) = args.into_iter().partition(of_points);
    rest.into_iter().chain(["--".into()]).chain(points).collect()
}

/// Help and version on standard output, errors on standard error. Arguments that errors repeat may hold anything; then they are shown
/// without colours.
fn print_words_of_clap(args: &[OsString], error: &clap::Error) {
    let plain = |arg: &OsString| arg.to_str().is_some_and(|text| text::message(text) == text);
    if !error.use_stderr() || args.iter().all(plain) {
        let _ = error.print();
        return;
    }
    for line in error.render().to_string().trim_end().lines() {
        output::tell(line);
    }
}

fn dispatch(command: Command, terminal: TerminalArgs) -> Result<(), CliError> {
    match command {
        Command::Calibrate(args) => calibrate::run(&args, terminal.color),
        Command::Render(args) => render::run(&args),
        Command::Plan(args) => plan::run(&args),
        Command::Simulate(args) => simulate::run(&args),
        Command::Experiment(args) => experiment::run(&args),
        Command::Floor(args) => floor::run(&args),
        Command::Uncertainty(args) => uncertainty::run(&args),
        Command::Rectify(args) => rectify::run(&args),
        Command::Undistort(args) => undistort::run(&args),
        Command::Compare(args) => compare::run(&args),
        Command::Convert(args) => convert::run(&args),
        Command::Completions(args) => completions::run(&args, Cli::command()),
        Command::Man(args) => man::run(&args, Cli::command()),
    }
}

/// Calibrate a camera from the floor it looks at, with no calibration target.
#[derive(Debug, Parser)]
#[command(
    name = "groundcal",
    version,
    about,
    propagate_version = true,
    after_help = "Examples:
  groundcal photos/                         the same as groundcal calibrate photos/
  groundcal calibrate photos/ --out result/

Exit codes: 0 a calibration, 2 wrong usage, 3 the images cannot determine what was asked, 4 unreadable or \
unusable input, 1 anything else."
)]
struct Cli {
    #[command(flatten)]
    terminal: TerminalArgs,

    /// What to do.
    #[command(subcommand)]
    command: Command,
}

/// The commands.
#[derive(Debug, Subcommand)]
enum Command {
    /// Camera matrix with error bars from photographs (or matches) of a floor
    Calibrate(Box<calibrate::CalibrateArgs>),
    /// Images with truth from a scene file
    Render(render::RenderArgs),
    /// Which pictures to take, and the error bars to expect; after a calibration, the next motions that improve it most
    Plan(Box<plan::PlanArgs>),
    /// The simulation study of the paper: error of the focal length on synthetic matches, as table and figure
    Simulate(simulate::SimulateArgs),
    /// The experiments of the paper on rendered scenes: tables of errors against exact truth
    Experiment(experiment::ExperimentArgs),
    /// Points of the floor from pixels of a view, and back, with error bars; distances on it
    Floor(floor::FloorArgs),
    /// How sure a camera is of where things appear: expected error in pixels over the image
    Uncertainty(uncertainty::UncertaintyArgs),
    /// Metric bird's-eye pictures of the floor: of each view, or a mosaic of all
    Rectify(rectify::RectifyArgs),
    /// Images without their lens distortion, and the maps for OpenCV
    Undistort(undistort::UndistortArgs),
    /// How far calibrations differ: parameters with significance, reprojection in pixels
    Compare(compare::CompareArgs),
    /// A camera file in the formats of other programs
    Convert(convert::ConvertArgs),
    /// Shell completions, on standard output
    Completions(completions::CompletionsArgs),
    /// Manual pages
    Man(man::ManArgs),
}

impl Command {
    /// Whether standard output is to be JSON.
    fn prints_json(&self) -> bool {
        match self {
            Command::Calibrate(args) => args.json,
            Command::Plan(args) => args.json,
            Command::Compare(args) => args.json,
            Command::Floor(args) => args.json,
            Command::Uncertainty(args) => args.json,
            _ => false,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_command_line_is_well_formed() {
        Cli::command().debug_assert();
    }

    #[test]
    fn every_help_text_has_an_example() {
        let mut whole = Cli::command();
        whole.build();
        let mut commands: Vec<clap::Command> =
            whole.get_subcommands().filter(|c| c.get_name() != "help").cloned().collect();
        commands.push(whole);
        assert!(commands.len() > 5);
        for mut command in commands {
            let text = command.render_long_help().to_string();
            assert!(text.contains("\nExample:\n  groundcal ") || text.contains("\nExamples:\n  groundcal "), "{text}");
        }
    }

    #[test]
    fn every_command_has_a_page_with_an_example() {
        let pages = man::pages(Cli::command()).unwrap();
        let commands = Cli::command().get_subcommands().count();
        assert_eq!(pages.len(), commands + 1);
        for (name, page) in pages {
            let text = String::from_utf8(page).unwrap();
            assert!(text.contains(&format!("\n.TH {name} 1")), "{name}: {text}");
            assert!(text.contains(".TH ") && text.contains(".SH SYNOPSIS"), "{name}");
            assert!(!text.contains("groundcal\\-help"), "{name}");
            let example = text.split_once("\n.SH EXAMPLE").unwrap_or_else(|| panic!("{name} has no example")).1;
            assert!(example.contains("groundcal "), "{name}: {example}");
        }
    }

    #[test]
    fn completions_know_the_commands() {
        for shell in <clap_complete::Shell as clap::ValueEnum>::value_variants() {
            let script = completions::script(*shell, Cli::command());
            for word in ["calibrate", "compare", "attitude-sigma-deg"] {
                assert!(script.contains(word), "{shell}: {word}");
            }
        }
    }
}
