//! `groundcal convert`: a camera file as the formats of other programs.

use std::{fmt::Write, path::PathBuf};

use clap::Args;
use groundcal_io::{
    export::{self, Format},
    import,
    outputs::Request,
};

use crate::{
    args::{FormatArg, OverwriteArg, camera_of},
    error::CliError,
    output::{self, Results},
};

/// `groundcal convert`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  groundcal convert camchain.yaml --out converted/
  groundcal convert sparse/cameras.txt#1 --out converted/ --format ros,kalibr

Reads what `groundcal compare` reads. A camera with a fisheye lens is written with it where the format has one. What a format \
cannot hold is left out and said. Exit codes: 0 files, 2 wrong usage, 4 unreadable or unusable input, 1 anything else.")]
pub(crate) struct ConvertArgs {
    /// A file of a camera; FILE#NAME names one of several
    #[arg(value_name = "FILE")]
    pub(crate) camera: String,

    /// Folder for the files (made if need be)
    #[arg(long, value_name = "DIR")]
    pub(crate) out: PathBuf,

    /// Which formats, with commas between [default: all]
    #[arg(long, value_enum, value_delimiter = ',', value_name = "FORMAT")]
    pub(crate) format: Vec<FormatArg>,

    #[command(flatten)]
    pub(crate) overwrite: OverwriteArg,
}

/// Writes the files and prints their names; what was left out is told on standard error.
pub(crate) fn run(args: &ConvertArgs) -> Result<(), CliError> {
    output::check_folder(&args.out)?;
    let formats: Vec<Format> = args.format.iter().copied().map(Format::from).collect();
    let names: Vec<String> = export::file_names(&formats).into_iter().map(String::from).collect();
    let results = Results::begin(&Request {
        folder: &args.out,
        command: "convert",
        names: &names,
        inputs: &[import::camera_file(&args.camera)],
        basis: None,
        overwrite: args.overwrite.overwrite,
    })?;
    let imported = import::read_camera(&args.camera)?;
    let camera = camera_of(&args.camera, &imported)?;
    let rendered = export::render_camera(&camera, &formats)?;
    let mut text = String::new();
    for file in &rendered.files {
        results.write(file.name, file.content.as_bytes())?;
        // Writing to a string cannot fail.
        let _ = writeln!(text, "{}", args.out.join(file.name).display());
    }
    let finished = results.finish()?;
    for note in imported.notes.iter().chain(&rendered.notes) {
        output::note(note);
    }
    output::print(&text)?;
    finished.tell();
    Ok(())
}
