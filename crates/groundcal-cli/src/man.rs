//! `groundcal man` and `groundcal completions`: made from the definitions of the command line.

use std::path::PathBuf;

use clap::{Args, CommandFactory};
use clap_complete::Shell;
use clap_mangen::Man;
use roff::{Roff, roman};

use crate::{args::Cli, error::CliError};
use groundcal_io::export::write_whole;

/// `groundcal man`.
#[derive(Debug, Args)]
#[command(after_help = "Example:
  groundcal man --out ~/.local/share/man/man1      then: man groundcal-calibrate")]
pub struct ManArgs {
    /// Folder for groundcal.1 and a page for each command (made if need be)
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
}

/// `groundcal completions`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  groundcal completions bash > ~/.local/share/bash-completion/completions/groundcal
  groundcal completions zsh > ~/.zfunc/_groundcal
  groundcal completions fish > ~/.config/fish/completions/groundcal.fish")]
pub struct CompletionsArgs {
    /// The shell
    #[arg(value_enum)]
    pub shell: Shell,
}

/// The completion script of a shell.
pub fn completions(shell: Shell) -> String {
    let mut script = Vec::new();
    clap_complete::generate(shell, &mut Cli::command(), "groundcal", &mut script);
    String::from_utf8_lossy(&script).into_owned()
}

/// Writes the pages.
pub fn write_pages(args: &ManArgs) -> Result<(), CliError> {
    let fail = |e: std::io::Error| CliError::Other(format!("cannot make the manual pages: {e}"));
    std::fs::create_dir_all(&args.out)
        .map_err(|e| CliError::Other(format!("cannot make the folder {}: {e}", args.out.display())))?;
    for (name, page) in pages().map_err(fail)? {
        write_whole(&args.out.join(format!("{name}.1")), &page)?;
    }
    Ok(())
}

/// Name and text of every page: the program's, then that of each command.
fn pages() -> std::io::Result<Vec<(String, Vec<u8>)>> {
    // `groundcal help` has no page of its own, so none is referred to.
    let mut whole = Cli::command().disable_help_subcommand(true);
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

#[cfg(test)]
mod tests {
    use clap::ValueEnum;

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
        let pages = pages().unwrap();
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
        for shell in Shell::value_variants() {
            let script = completions(*shell);
            for word in ["calibrate", "compare", "attitude-sigma-deg"] {
                assert!(script.contains(word), "{shell}: {word}");
            }
        }
    }
}
