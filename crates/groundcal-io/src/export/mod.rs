//! Renderers of a calibration: each takes the one result value and gives text.

pub mod colmap;
pub mod formats;
pub mod kalibr;
pub mod matlab;
pub mod nerfstudio;
pub mod opencv;
pub mod ros;

use std::{io::Write, path::Path};

use groundcal::{
    remedy::Wording,
    result::{Calibration, WarningReport},
};

use crate::error::IoError;

/// The calibration as JSON (docs/formats.md), its warnings in the words of a front end.
pub fn json(calibration: &Calibration, wording: &dyn Wording) -> Result<String, IoError> {
    let text = || {
        let mut value = serde_json::to_value(calibration)?;
        value["warnings"] = serde_json::to_value(WarningReport::all(&calibration.warnings, wording))?;
        serde_json::to_string_pretty(&value)
    };
    text().map(|text| text + "\n").map_err(|e| IoError::Other(format!("cannot write the calibration as JSON: {e}")))
}

/// Writes a file whole or not at all: to a temporary neighbour first, then renamed.
pub fn write_whole(path: &Path, content: &[u8]) -> Result<(), IoError> {
    let fail = |e: std::io::Error| IoError::Other(format!("cannot write {}: {e}", path.display()));
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let mut builder = tempfile::Builder::new();
    builder.prefix(".groundcal-");
    // A temporary file is private by default; the finished one should have ordinary rights (less the umask).
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    let mut file = builder.tempfile_in(folder).map_err(fail)?;
    file.write_all(content).map_err(fail)?;
    file.persist(path).map_err(|e| fail(e.error))?;
    Ok(())
}
