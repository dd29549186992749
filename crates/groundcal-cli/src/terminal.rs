//! What the reader's terminal can show: its width, colours; and how much is said at all.

use std::{
    io::IsTerminal,
    sync::atomic::{AtomicBool, AtomicU8, Ordering},
};

use clap::{Args, ColorChoice, ValueEnum};
use groundcal_io::text::printable_lines;
use groundcal_report::terminal::{Line, Look, WIDTH, wrapped};

/// Summaries are not narrower than their numbers are wide, nor so wide that lines are hard to follow.
const WIDTHS: std::ops::RangeInclusive<usize> = 60..=120;

/// Options of every command.
#[derive(Debug, Clone, Copy, Args)]
pub(crate) struct TerminalArgs {
    /// Colours: `auto` has them on a terminal, unless the variable NO_COLOR is set
    #[arg(long, value_enum, value_name = "WHEN", default_value_t = ColorArg::Auto, global = true, hide_possible_values = true)]
    pub(crate) color: ColorArg,

    /// How progress is shown on standard error, of what takes longer than seconds: `bar`, `plain` (lines), `none`; `auto` has a bar on a
    /// terminal and lines elsewhere
    #[arg(long, value_enum, value_name = "HOW", default_value_t = ProgressArg::Auto, global = true, hide_possible_values = true)]
    pub(crate) progress: ProgressArg,

    /// Print nothing but errors, and what --json asks for
    #[arg(long, short, global = true)]
    pub(crate) quiet: bool,
}

/// `--progress`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum ProgressArg {
    /// A bar on a terminal, lines elsewhere
    Auto,
    /// A bar
    Bar,
    /// Lines
    Plain,
    /// None
    None,
}

/// How progress is shown; one for the process, as standard error is.
static PROGRESS: AtomicU8 = AtomicU8::new(ProgressArg::Auto as u8);

/// Shows progress so from here on.
pub(crate) fn set_progress(how: ProgressArg) {
    PROGRESS.store(how as u8, Ordering::Relaxed);
}

/// How progress is shown here and now: never [`ProgressArg::Auto`].
pub(crate) fn progress() -> ProgressArg {
    let asked = PROGRESS.load(Ordering::Relaxed);
    let of = |how: ProgressArg| how as u8 == asked;
    if is_quiet() || of(ProgressArg::None) {
        ProgressArg::None
    } else if of(ProgressArg::Plain) {
        ProgressArg::Plain
    } else if of(ProgressArg::Bar) || std::io::stderr().is_terminal() {
        ProgressArg::Bar
    } else {
        ProgressArg::Plain
    }
}

/// `--color`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum ColorArg {
    /// On a terminal
    Auto,
    /// Also into files and pipes
    Always,
    /// None
    Never,
}

impl ColorArg {
    /// Of a command line that is not parsed yet, for the words of the parser itself.
    pub(crate) fn in_words(words: &[std::ffi::OsString]) -> Self {
        let texts: Vec<&str> = words.iter().take_while(|w| *w != "--").filter_map(|w| w.to_str()).collect();
        let after = texts.windows(2).filter(|w| w[0] == "--color").map(|w| w[1]);
        let joined = texts.iter().filter_map(|w| w.strip_prefix("--color="));
        after.chain(joined).find_map(|value| Self::from_str(value, false).ok()).unwrap_or(Self::Auto)
    }

    /// As the parser names it.
    pub(crate) fn choice(self) -> ColorChoice {
        match self.on(true) {
            Some(true) => ColorChoice::Always,
            Some(false) => ColorChoice::Never,
            None => ColorChoice::Auto,
        }
    }

    /// Whether there are colours; `None`: as whoever writes them finds the terminal.
    fn on(self, terminal: bool) -> Option<bool> {
        let refused = std::env::var_os("NO_COLOR").is_some_and(|v| !v.is_empty());
        let dumb = std::env::var_os("TERM").is_some_and(|v| v == "dumb");
        match self {
            ColorArg::Always => Some(true),
            ColorArg::Never => Some(false),
            ColorArg::Auto if refused || dumb || !terminal => Some(false),
            ColorArg::Auto => None,
        }
    }

    /// Whether a stream gets colours.
    pub(crate) fn of(self, stream: &impl IsTerminal) -> bool {
        self.on(stream.is_terminal()).unwrap_or(true)
    }
}

/// Whether nothing but errors is said. One for the process, as its standard streams are.
static QUIET: AtomicBool = AtomicBool::new(false);

/// Says nothing but errors from here on, or all again.
pub(crate) fn set_quiet(quiet: bool) {
    QUIET.store(quiet, Ordering::Relaxed);
}

/// Whether nothing but errors is said.
pub(crate) fn is_quiet() -> bool {
    QUIET.load(Ordering::Relaxed)
}

/// Columns for what goes to standard output: as the variable COLUMNS or the terminal says.
pub(crate) fn width() -> usize {
    let said = std::env::var("COLUMNS").ok().and_then(|text| text.trim().parse::<usize>().ok()).filter(|n| *n > 0);
    let measured = || terminal_size::terminal_size_of(std::io::stdout()).map(|(w, _)| usize::from(w.0));
    said.or_else(measured).unwrap_or(WIDTH).clamp(*WIDTHS.start(), *WIDTHS.end())
}

/// A message in lines that fit the terminal that standard error is; one line elsewhere, for whoever reads it by program.
pub(crate) fn fitted(text: &str) -> String {
    match terminal_size::terminal_size_of(std::io::stderr()) {
        Some((columns, _)) => wrapped(text, 0, usize::from(columns.0).max(*WIDTHS.start())),
        None => text.into(),
    }
}

/// Lines with their looks; names in them have no control characters.
pub(crate) fn painted(lines: &[Line], colours: bool) -> String {
    let paint = |line: &Line| {
        let text = printable_lines(&line.text);
        match code(line.look).filter(|_| colours && !text.is_empty()) {
            Some(code) => format!("\u{1b}[{code}m{text}\u{1b}[0m\n"),
            None => format!("{text}\n"),
        }
    };
    lines.iter().map(paint).collect()
}

/// Select Graphic Rendition (ECMA-48).
fn code(look: Look) -> Option<&'static str> {
    match look {
        Look::Plain => None,
        Look::Strong => Some("1"),
        Look::Good => Some("1;32"),
        Look::Doubt => Some("1;33"),
        Look::Bad => Some("1;31"),
        Look::Faint => Some("2"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_are_found_in_the_words_of_a_command_line() {
        let of = |line: &str| ColorArg::in_words(&line.split(' ').map(Into::into).collect::<Vec<_>>());
        assert_eq!(of("groundcal calibrate x"), ColorArg::Auto);
        assert_eq!(of("groundcal calibrate --color never x"), ColorArg::Never);
        assert_eq!(of("groundcal --color=always plan"), ColorArg::Always);
        assert_eq!(of("groundcal calibrate -- --color never"), ColorArg::Auto);
        assert_eq!(of("groundcal calibrate --color"), ColorArg::Auto);
    }

    #[test]
    fn control_characters_of_names_are_no_colours() {
        let line = Line { text: "name \u{1b}[31m".into(), look: Look::Good };
        let text = painted(&[line, Line::plain("")], true);
        assert!(text.starts_with("\u{1b}[1;32mname ") && text.matches('\u{1b}').count() == 2, "{text:?}");
        assert!(text.ends_with("\u{1b}[0m\n\n"), "{text:?}");
    }
}
