//! `groundcal render`: images with truth from a scene file.

use std::path::PathBuf;

use clap::Args;
use groundcal_io::outputs::Request;
use groundcal_lab::render_scene::SceneFile;

use crate::{
    args::OverwriteArg,
    error::CliError,
    output::{self, Results},
};

/// `groundcal render`.
#[derive(Debug, Args)]
#[command(after_help = "Example:
  groundcal render examples/tripod/scene.toml --out rendered/")]
pub(crate) struct RenderArgs {
    /// Scene description (TOML; see docs/formats.md)
    pub(crate) scene: PathBuf,

    /// Folder for the images and truth.json (made if need be)
    #[arg(long, value_name = "DIR")]
    pub(crate) out: PathBuf,

    #[command(flatten)]
    pub(crate) overwrite: OverwriteArg,
}

/// Renders the views of the scene.
pub(crate) fn run(args: &RenderArgs) -> Result<(), CliError> {
    output::check_folder(&args.out)?;
    let scene = SceneFile::read(&args.scene)?;
    let results = Results::begin(&Request {
        folder: &args.out,
        command: "render",
        names: &scene.file_names(),
        inputs: std::slice::from_ref(&args.scene),
        basis: None,
        overwrite: args.overwrite.overwrite,
    })?;
    for file in scene.files()? {
        let (name, bytes) = file?;
        results.write(&name, &bytes)?;
        output::go_on()?;
    }
    results.finish()?.tell();
    Ok(())
}
