//! `groundcal convert`: a camera file as the formats of other programs.

use std::{fmt::Write, path::PathBuf};

use clap::Args;
use groundcal_io::{
    export::{self, Format},
    import,
};

use crate::{
    args::{FormatArg, camera_of},
    error::CliError,
    output,
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
    pub(crate) camera: PathBuf,

    /// Folder for the files (made if need be)
    #[arg(long, value_name = "DIR")]
    pub(crate) out: PathBuf,

    /// Which formats, with commas between [default: all]
    #[arg(long, value_enum, value_delimiter = ',', value_name = "FORMAT")]
    pub(crate) format: Vec<FormatArg>,
}

/// Writes the files and prints their names; what was left out is told on standard error.
pub(crate) fn run(args: &ConvertArgs) -> Result<(), CliError> {
    output::refuse_file(&args.out)?;
    let imported = import::read_camera(&args.camera)?;
    let camera = camera_of(&args.camera, &imported)?;
    let formats: Vec<Format> = args.format.iter().copied().map(Format::from).collect();
    let rendered = export::render_camera(&camera, &formats)?;
    output::make_folder(&args.out)?;
    let mut text = String::new();
    for file in &rendered.files {
        let path = args.out.join(file.name);
        export::write_whole(&path, file.content.as_bytes())?;
        // Writing to a string cannot fail.
        let _ = writeln!(text, "{}", path.display());
    }
    for note in imported.notes.iter().chain(&rendered.notes) {
        output::note(note);
    }
    output::print(&text)
}
