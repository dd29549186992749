//! Where results and messages go: standard output, standard error, folders and files; and the threads that make them.

use std::{io::Write, path::Path};

use groundcal_io::{
    export::write_whole,
    text::{message, printable_json, printable_lines},
};
use groundcal_report::canvas::{Canvas, Ink, png, svg};

use crate::{args::ThreadsArg, error::CliError};

/// Pixels of a PNG for one of the SVG: sharp on dense screens.
const PNG_SCALE: f64 = 2.0;

/// A page to standard output; names in it have no control characters.
pub(crate) fn print(page: &str) -> Result<(), CliError> {
    print_as_it_is(&printable_lines(page))
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
    let _ = writeln!(std::io::stderr(), "{}", message(text));
}

/// A remark to standard error.
pub(crate) fn note(text: &str) {
    tell(&format!("note: {text}"));
}

/// `--out` has to be a folder that can be written, or nothing yet: asked before minutes of work. Nothing is left behind.
pub(crate) fn refuse_file(out: &Path) -> Result<(), CliError> {
    if out.exists() && !out.is_dir() {
        return Err(CliError::Usage(format!("--out {}: is a file; name a folder", out.display())));
    }
    let here = Path::new(".");
    let nearest = out.ancestors().map(|p| if p.as_os_str().is_empty() { here } else { p }).find(|p| p.exists());
    let folder = nearest.unwrap_or(here);
    if !folder.is_dir() {
        let out = out.display();
        return Err(CliError::Other(format!("cannot make the folder {out}: {} is a file", folder.display())));
    }
    tempfile::tempfile_in(folder).map(drop).map_err(|e| {
        CliError::Other(format!(
            "--out {}: cannot write into {}: {e}. Name another folder",
            out.display(),
            folder.display()
        ))
    })
}

/// Makes a folder if need be.
pub(crate) fn make_folder(folder: &Path) -> Result<(), CliError> {
    std::fs::create_dir_all(folder)
        .map_err(|e| CliError::Other(format!("cannot make the folder {}: {e}", folder.display())))
}

/// `NAME.svg` and `NAME.png`.
pub(crate) fn write_canvas(folder: &Path, name: &str, canvas: &Canvas<Ink>) -> Result<(), CliError> {
    write_whole(&folder.join(format!("{name}.svg")), svg::document(canvas).as_bytes())?;
    Ok(write_whole(&folder.join(format!("{name}.png")), &png::encode(canvas, PNG_SCALE)?)?)
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
