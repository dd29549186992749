//! `groundcal render`: images with truth from a scene file.

use std::path::PathBuf;

use clap::Args;
use groundcal_lab::render_scene;

use crate::{error::CliError, output};

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
}

/// Renders the views of the scene.
pub(crate) fn run(args: &RenderArgs) -> Result<(), CliError> {
    output::refuse_file(&args.out)?;
    Ok(render_scene::run(&args.scene, &args.out)?)
}
