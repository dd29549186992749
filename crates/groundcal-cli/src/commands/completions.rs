//! `groundcal completions`: made from the definitions of the command line.

use clap::Args;
use clap_complete::Shell;

use crate::{error::CliError, output};

/// `groundcal completions`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  groundcal completions bash > ~/.local/share/bash-completion/completions/groundcal
  groundcal completions zsh > ~/.zfunc/_groundcal
  groundcal completions fish > ~/.config/fish/completions/groundcal.fish")]
pub(crate) struct CompletionsArgs {
    /// The shell
    #[arg(value_enum)]
    pub(crate) shell: Shell,
}

/// Prints the completion script of a shell.
pub(crate) fn run(args: &CompletionsArgs, program: clap::Command) -> Result<(), CliError> {
    output::print_as_it_is(&script(args.shell, program))
}

/// The completion script of a shell.
pub(crate) fn script(shell: Shell, mut program: clap::Command) -> String {
    let mut script = Vec::new();
    clap_complete::generate(shell, &mut program, "groundcal", &mut script);
    String::from_utf8_lossy(&script).into_owned()
}
