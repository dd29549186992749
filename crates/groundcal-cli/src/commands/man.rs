//! `groundcal man`: made from the definitions of the command line.

use std::path::PathBuf;

use clap::Args;
use clap_mangen::Man;
use roff::{Roff, roman};

use groundcal_io::outputs::Request;

use crate::{args::OverwriteArg, error::CliError, output::Results};

/// `groundcal man`.
#[derive(Debug, Args)]
#[command(after_help = "Example:
  groundcal man --out ~/.local/share/man/man1      then: man groundcal-calibrate")]
pub(crate) struct ManArgs {
    /// Folder for groundcal.1 and a page for each command (made if need be)
    #[arg(long, value_name = "DIR")]
    pub(crate) out: PathBuf,

    #[command(flatten)]
    pub(crate) overwrite: OverwriteArg,
}

/// Writes the pages.
pub(crate) fn run(args: &ManArgs, program: clap::Command) -> Result<(), CliError> {
    let fail = |e: std::io::Error| CliError::Other(format!("cannot make the manual pages: {e}"));
    let pages = pages(program).map_err(fail)?;
    let file = |name: &str| format!("{name}.1");
    let names: Vec<String> = pages.iter().map(|(name, _)| file(name)).collect();
    let results = Results::begin(&Request {
        folder: &args.out,
        command: "man",
        names: &names,
        inputs: &[],
        basis: None,
        overwrite: args.overwrite.overwrite,
    })?;
    for (name, page) in &pages {
        results.write(&file(name), page)?;
    }
    results.finish()?.tell();
    Ok(())
}

/// Name and text of every page: the program's, then that of each command.
pub(crate) fn pages(program: clap::Command) -> std::io::Result<Vec<(String, Vec<u8>)>> {
    // `groundcal help` has no page of its own, so none is referred to.
    let mut whole = program.disable_help_subcommand(true);
    whole.build();
    let mut pages = vec![("groundcal".to_string(), page(whole.clone(), true)?)];
    for command in whole.get_subcommands() {
        // `build` has given each command its display name, from which the page's head is made.
        pages.push((format!("groundcal-{}", command.get_name()), page(command.clone(), false)?));
    }
    Ok(pages)
}

/// As clap_mangen renders it, but with the text after the options in a section of its own for each paragraph that has a heading,
/// line by line as it is written.
fn page(command: clap::Command, commands: bool) -> std::io::Result<Vec<u8>> {
    let after = command.get_after_help().map(ToString::to_string).unwrap_or_default();
    let man = Man::new(command);
    let mut out = Vec::new();
    man.render_title(&mut out)?;
    man.render_name_section(&mut out)?;
    man.render_synopsis_section(&mut out)?;
    man.render_description_section(&mut out)?;
    man.render_options_section(&mut out)?;
    if commands {
        man.render_subcommands_section(&mut out)?;
    }
    let mut notes = Roff::new();
    let mut headed = false;
    for paragraph in after.split("\n\n").filter(|p| !p.trim().is_empty()) {
        match paragraph.split_once('\n') {
            Some((heading, body)) if heading.ends_with(':') => {
                notes.control("SH", [heading.trim_end_matches(':').to_uppercase().as_str()]);
                notes.control("nf", []);
                for line in body.lines() {
                    notes.text([roman(line)]);
                }
                notes.control("fi", []);
                headed = false;
            }
            _ => {
                if !headed {
                    notes.control("SH", ["NOTES"]);
                    headed = true;
                } else {
                    notes.control("PP", []);
                }
                notes.text([roman(paragraph.replace('\n', " "))]);
            }
        }
    }
    notes.to_writer(&mut out)?;
    man.render_version_section(&mut out)?;
    Ok(out)
}
