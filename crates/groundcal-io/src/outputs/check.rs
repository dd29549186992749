//! What a run may write: no two results under one name, none in the place of an input, of a folder, or of a file that no run wrote.

use std::{
    collections::{HashMap, HashSet},
    fs,
    path::{Path, PathBuf},
};

use crate::{
    error::IoError,
    outputs::manifest::{MANIFEST, Manifest, stays_inside},
    text::{plain, shown},
};

/// Names of a kind that a message shows.
const SHOWN: usize = 3;

/// A folder for results has to be one that can be written, or nothing yet. Nothing is left behind.
///
/// # Errors
/// [`IoError::Usage`] for a file or a link to nothing, [`IoError::Other`] where nothing can be written.
pub fn check_folder(folder: &Path) -> Result<(), IoError> {
    let named = shown(folder);
    let is_link = |p: &Path| p.symlink_metadata().is_ok_and(|m| m.is_symlink()) && !p.exists();
    if folder.exists() && !folder.is_dir() {
        return Err(IoError::Usage(format!("{named} is a file; name a folder")));
    }
    let here = Path::new(".");
    let mut above = folder.ancestors().map(|p| if p.as_os_str().is_empty() { here } else { p });
    let nearest = above.find(|p| p.exists() || is_link(p)).unwrap_or(here);
    if is_link(nearest) {
        return Err(IoError::Usage(format!(
            "{} is a link to something that does not exist; name a folder",
            shown(nearest)
        )));
    }
    if !nearest.is_dir() {
        return Err(IoError::Other(format!("cannot make the folder {named}: {} is a file", shown(nearest))));
    }
    tempfile::tempfile_in(nearest)
        .map(drop)
        .map_err(|e| IoError::Other(format!("{named}: cannot write into {}: {e}. Name another folder", shown(nearest))))
}

/// Refuses names that are one file on some system, or that leave the folder.
pub(crate) fn check_names(names: &[String]) -> Result<(), IoError> {
    let mut seen: HashMap<String, &str> = HashMap::new();
    for name in names {
        if !stays_inside(name) || name.starts_with(".groundcal-") {
            return Err(IoError::Usage(format!("{} is no name for a result", plain(name))));
        }
        if let Some(other) = seen.insert(name.to_lowercase(), name) {
            return Err(IoError::Usage(format!(
                "two results would be named {} and {}. Rename an input",
                plain(other),
                plain(name)
            )));
        }
    }
    Ok(())
}

/// What makes a file the same under any of its names.
#[derive(Debug, PartialEq, Eq, Hash)]
enum Identity {
    #[cfg(unix)]
    Place(u64, u64),
    #[cfg(not(unix))]
    Path(PathBuf),
}

fn identity(path: &Path) -> Option<Identity> {
    #[cfg(unix)]
    {
        use std::os::unix::fs::MetadataExt;
        path.metadata().ok().map(|m| Identity::Place(m.dev(), m.ino()))
    }
    #[cfg(not(unix))]
    path.canonicalize().ok().map(Identity::Path)
}

/// A few of many names.
fn some(names: &[String]) -> String {
    let first: Vec<String> = names.iter().take(SHOWN).map(|n| plain(n)).collect();
    match names.len().saturating_sub(SHOWN) {
        0 => first.join(", "),
        more => format!("{} and {more} more", first.join(", ")),
    }
}

/// Refuses results that would take the place of what is not ours.
///
/// # Errors
/// [`IoError::WouldReplace`] for an input, and without `overwrite` for a file that is not in the manifest or was changed since;
/// [`IoError::Usage`] for a folder.
pub(crate) fn check_targets(
    folder: &Path,
    names: &[String],
    inputs: &[PathBuf],
    manifest: &Manifest,
    overwrite: bool,
) -> Result<(), IoError> {
    if folder.join(MANIFEST).symlink_metadata().is_ok_and(|m| !m.is_file()) {
        return Err(IoError::Usage(format!("{} is no file; take it away", shown(&folder.join(MANIFEST)))));
    }
    let inputs: HashSet<Identity> = inputs.iter().filter_map(|i| identity(i)).collect();
    let (mut of_inputs, mut foreign) = (Vec::new(), Vec::new());
    for name in names {
        let path = folder.join(name);
        for above in Path::new(name).ancestors().skip(1).filter(|p| !p.as_os_str().is_empty()) {
            let above = folder.join(above);
            if above.symlink_metadata().is_ok_and(|_| !above.is_dir()) {
                return Err(IoError::Usage(format!(
                    "{} is a file where a folder of results belongs. Take it away, or name another folder",
                    shown(&above)
                )));
            }
        }
        let Ok(metadata) = path.symlink_metadata() else { continue };
        if path.is_dir() {
            return Err(IoError::Usage(format!(
                "{} is a folder where a file of the results belongs. Take it away, or name another folder",
                shown(&path)
            )));
        }
        if identity(&path).is_some_and(|i| inputs.contains(&i)) {
            of_inputs.push(name.clone());
        } else if !overwrite {
            let unchanged = |e: &crate::outputs::manifest::Entry| e.is_unchanged(folder).unwrap_or(false);
            if !metadata.is_file() || !manifest.entry(name).is_some_and(unchanged) {
                foreign.push(name.clone());
            }
        }
    }
    let refused = |names: &[String], input| IoError::WouldReplace { folder: shown(folder), names: some(names), input };
    if !of_inputs.is_empty() {
        return Err(refused(&of_inputs, true));
    }
    if !foreign.is_empty() {
        return Err(refused(&foreign, false));
    }
    Ok(())
}

/// Whether all folders on the way to a file are folders themselves, not links to others.
pub(crate) fn is_inside(folder: &Path, name: &str) -> bool {
    let above = Path::new(name).ancestors().skip(1).filter(|p| !p.as_os_str().is_empty());
    stays_inside(name) && above.into_iter().all(|p| fs::symlink_metadata(folder.join(p)).is_ok_and(|m| m.is_dir()))
}
