//! Files appear whole or not at all.

use std::{io::Write, path::Path};

use crate::{error::IoError, text::shown};

/// Writes a file whole or not at all: to a temporary neighbour first, then renamed.
///
/// # Errors
/// [`IoError::Other`] where the folder or the disk does not take it.
///
/// ```
/// let folder = tempfile::tempdir()?;
/// groundcal_io::export::write_whole(&folder.path().join("a.txt"), b"all of it")?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn write_whole(path: &Path, content: &[u8]) -> Result<(), IoError> {
    let fail = |e: std::io::Error| IoError::Other(format!("cannot write {}: {e}", shown(path)));
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
