//! Where results and messages go: standard output, standard error, folders and files; and the threads that make them.

use std::{io::Write, path::Path};

use groundcal_io::{
    outputs::{self, Outputs, Request, Written},
    text::{self, message, plain, printable_json, printable_lines},
};
use groundcal_report::{
    canvas::{Canvas, Ink, png, svg},
    terminal::Line,
};

use crate::{
    args::ThreadsArg,
    error::CliError,
    interrupt,
    terminal::{self, ColorArg},
};

/// Pixels of a PNG for one of the SVG: sharp on dense screens.
const PNG_SCALE: f64 = 2.0;
/// The page of a calibration.
pub(crate) const PAGE: &str = "report.html";
/// Names of files that are told.
const NAMES_SHOWN: usize = 12;

/// A page to standard output, unless nothing is to be said; names in it have no control characters.
pub(crate) fn print(page: &str) -> Result<(), CliError> {
    if terminal::is_quiet() {
        return Ok(());
    }
    print_as_it_is(&printable_lines(page))
}

/// Lines of a summary to standard output, unless nothing is to be said.
pub(crate) fn print_lines(lines: &[Line], color: ColorArg) -> Result<(), CliError> {
    if terminal::is_quiet() {
        return Ok(());
    }
    print_as_it_is(&terminal::painted(lines, color.of(&std::io::stdout())))
}

/// JSON to standard output.
pub(crate) fn print_json(json: &str) -> Result<(), CliError> {
    print_as_it_is(&printable_json(json))
}

/// To standard output; a reader that has had enough (`| head`) is no fault.
pub(crate) fn print_as_it_is(text: &str) -> Result<(), CliError> {
    match std::io::stdout().lock().write_all(text.as_bytes()) {
        Err(e) if e.kind() != std::io::ErrorKind::BrokenPipe => {
            Err(CliError::Other(format!("cannot write the result: {e}")))
        }
        _ => Ok(()),
    }
}

/// A line to standard error, fit for a terminal whatever names it holds.
pub(crate) fn tell(text: &str) {
    let _ = writeln!(std::io::stderr(), "{}", terminal::fitted(&message(text)));
}

/// A line to standard error, unless nothing is to be said.
pub(crate) fn remark(text: &str) {
    if !terminal::is_quiet() {
        tell(text);
    }
}

/// A note to standard error, unless nothing is to be said.
pub(crate) fn note(text: &str) {
    remark(&format!("note: {text}"));
}

/// A line of progress to standard error; where nobody reads it, nobody misses it.
pub(crate) fn progress_line(text: &str) {
    let _ = writeln!(std::io::stderr(), "{text}");
}

/// Ends the work here where a signal asks for it.
pub(crate) fn go_on() -> Result<(), CliError> {
    interrupt::requested().map_or(Ok(()), |code| Err(CliError::Stopped(code)))
}

/// Results that were thrown away on a signal cannot be written: the signal is the cause then.
fn unless_stopped(error: CliError) -> CliError {
    interrupt::requested().map_or(error, CliError::Stopped)
}

/// `--out` has to be a folder that can be written, or nothing yet: asked before minutes of work. Nothing is left behind.
pub(crate) fn check_folder(out: &Path) -> Result<(), CliError> {
    Ok(outputs::check_folder(out)?)
}

/// The results of a run on their way into `--out`; dropped before [`Results::finish`], nothing of them is left.
pub(crate) struct Results(Outputs);

impl Results {
    /// Refuses what would be lost, before the work; see [`Outputs::begin`].
    pub(crate) fn begin(request: &Request) -> Result<Self, CliError> {
        let outputs = Outputs::begin(request)?;
        interrupt::guard(outputs.abandon());
        outputs.notes().iter().for_each(|text| note(text));
        Ok(Self(outputs))
    }

    /// A file.
    pub(crate) fn write(&self, name: &str, content: &[u8]) -> Result<(), CliError> {
        self.0.write(name, content).map_err(|e| unless_stopped(e.into()))
    }

    /// `NAME.svg` and `NAME.png`.
    pub(crate) fn write_canvas(&self, name: &str, canvas: &Canvas<Ink>) -> Result<(), CliError> {
        self.write(&format!("{name}.svg"), svg::document(canvas).as_bytes())?;
        self.write(&format!("{name}.png"), &png::encode(canvas, PNG_SCALE)?)
    }

    /// All files into place. What was written is told when the run's other words are said.
    pub(crate) fn finish(self) -> Result<Finished, CliError> {
        go_on()?;
        self.0.commit().map(Finished).map_err(|e| unless_stopped(e.into()))
    }
}

/// Names of [`Results::write_canvas`].
pub(crate) fn canvas_names(name: &str) -> [String; 2] {
    [format!("{name}.svg"), format!("{name}.png")]
}

/// What a run has written.
#[must_use]
pub(crate) struct Finished(Written);

impl Finished {
    /// Says it on standard error.
    pub(crate) fn tell(&self) {
        let Written { folder, names, notes } = &self.0;
        notes.iter().for_each(|text| note(text));
        let shown: Vec<String> = names.iter().take(NAMES_SHOWN).map(|n| plain(n)).collect();
        let more = names.len().saturating_sub(NAMES_SHOWN);
        let more = if more > 0 { format!(" and {more} more") } else { String::new() };
        remark(&format!("written to {}: {}{more}", text::shown(folder), shown.join(", ")));
        if names.iter().any(|n| n == PAGE) {
            remark(&format!("the page: {}", text::shown(&folder.join(PAGE))));
        }
    }
}

/// Works on as many threads as were asked for: a pool of its own, so that the program can be run again in one process.
pub(crate) fn on_threads<T: Send>(
    threads: ThreadsArg,
    work: impl FnOnce() -> Result<T, CliError> + Send,
) -> Result<T, CliError> {
    let Some(threads) = threads.count() else { return work() };
    rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .build()
        .map_err(|e| CliError::Other(format!("cannot start {threads} threads: {e}")))?
        .install(work)
}
