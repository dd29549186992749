//! The pool to begin with: the corpus of the repository.

use std::path::Path;

use crate::targets::Target;

/// The files of a target's folder, in the order of their names.
pub(crate) fn of(target: &Target) -> std::io::Result<Vec<Vec<u8>>> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("corpus").join(target.name);
    let mut files = std::fs::read_dir(&folder)?.map(|e| Ok(e?.path())).collect::<std::io::Result<Vec<_>>>()?;
    files.sort();
    if files.is_empty() {
        return Err(std::io::Error::other(format!("no seeds in {}", folder.display())));
    }
    files.iter().map(std::fs::read).collect()
}
