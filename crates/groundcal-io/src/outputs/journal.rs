//! The moving of results into place, which can be taken up again wherever it was broken off.

use std::{
    fs::{self, File},
    io::{self, Write},
    path::Path,
};

use serde::{Deserialize, Serialize};

use crate::{
    error::IoError,
    file,
    limits::MAX_CAMERA_BYTES,
    outputs::{
        check::is_inside,
        claim::Claim,
        digest,
        manifest::{Entry, MANIFEST, Manifest, stays_inside},
    },
    text::{plain, shown},
};

/// The journal's name in the run folder.
const JOURNAL: &str = "journal.json";

/// What is left to do when all results are there.
#[derive(Debug, Serialize, Deserialize)]
pub(crate) struct Journal {
    /// The command.
    pub(crate) command: String,
    /// The results.
    pub(crate) place: Vec<Placing>,
    /// Files of an earlier run, to be taken away.
    pub(crate) remove: Vec<Entry>,
    /// The list after it.
    pub(crate) manifest: Manifest,
}

/// A result and what it takes the place of.
#[derive(Debug, Serialize, Deserialize)]
pub(crate) struct Placing {
    /// Its name.
    pub(crate) name: String,
    /// SHA-256 of the file that it replaces, where there is one.
    pub(crate) replaces: Option<String>,
    /// Its own.
    pub(crate) sha256: String,
}

/// Steps that a test lets through before it breaks off; all of them otherwise.
pub(crate) type Fuel = Option<usize>;

/// Takes a step, or breaks off as a kill would.
fn step(fuel: &mut Fuel) -> io::Result<()> {
    match fuel {
        Some(0) => Err(io::Error::other("broken off")),
        Some(left) => {
            *left -= 1;
            Ok(())
        }
        None => Ok(()),
    }
}

/// Makes the names in a folder last through a loss of power. Not every system can, and a kill does not need it.
pub(crate) fn sync_folder(folder: &Path) {
    #[cfg(unix)]
    if let Ok(folder) = File::open(folder) {
        let _ = folder.sync_all();
    }
    #[cfg(not(unix))]
    let _ = folder;
}

/// A file that is there whole or not at all.
fn write_at_once(path: &Path, waiting: &Path, bytes: &[u8]) -> io::Result<()> {
    let mut file = File::create(waiting)?;
    file.write_all(bytes)?;
    file.sync_all()?;
    fs::rename(waiting, path)
}

impl Journal {
    /// That of a run that was broken off; nothing where it had not come so far.
    pub(crate) fn read(claim: &Claim) -> Result<Option<Self>, IoError> {
        let path = claim.run().join(JOURNAL);
        if path.symlink_metadata().is_err_and(|e| e.kind() == io::ErrorKind::NotFound) {
            return Ok(None);
        }
        let bytes = file::bytes(&path, MAX_CAMERA_BYTES)?;
        let journal: Self = serde_json::from_slice(&bytes).map_err(|e| {
            IoError::file(&path, format!("no journal of a run ({e}). Take the folder {} away", shown(&claim.run())))
        })?;
        Ok(Some(journal))
    }

    /// Writes it: from here on the run counts.
    pub(crate) fn write(&self, claim: &mut Claim, fuel: &mut Fuel) -> io::Result<()> {
        let run = claim.run();
        sync_folder(&claim.new_files());
        step(fuel)?;
        write_at_once(&run.join(JOURNAL), &run.join("journal.waiting"), &serde_json::to_vec(self)?)?;
        claim.keep(true);
        sync_folder(&run);
        Ok(())
    }

    /// Moves the results into place, as far as that has not been done, and takes the run folder's content away. The sentences say which
    /// files the user changed in the meantime: they stay as they are.
    pub(crate) fn apply(&self, claim: &mut Claim, fuel: &mut Fuel) -> io::Result<Vec<String>> {
        let mut notes = Vec::new();
        let (folder, waiting) = (claim.folder().to_path_buf(), claim.new_files());
        for placing in self.place.iter().filter(|p| stays_inside(&p.name)) {
            let (from, to) = (waiting.join(&placing.name), folder.join(&placing.name));
            if from.symlink_metadata().is_err() {
                continue;
            }
            step(fuel)?;
            let found = digest::of_file(&to)?;
            if to.is_dir() || (found.is_some() && found != placing.replaces && found.as_ref() != Some(&placing.sha256))
            {
                notes.push(format!(
                    "{} was changed meanwhile and is kept; the new one is dropped",
                    plain(&placing.name)
                ));
                continue;
            }
            if let Some(parent) = to.parent() {
                fs::create_dir_all(parent)?;
            }
            fs::rename(&from, &to)?;
        }
        for entry in self.remove.iter().filter(|e| is_inside(&folder, &e.name)) {
            step(fuel)?;
            if entry.is_unchanged(&folder)? {
                fs::remove_file(folder.join(&entry.name))?;
                let above = Path::new(&entry.name).ancestors().skip(1).filter(|p| !p.as_os_str().is_empty());
                for empty in above {
                    // Only an empty one goes.
                    let _ = fs::remove_dir(folder.join(empty));
                }
            }
        }
        step(fuel)?;
        write_at_once(&folder.join(MANIFEST), &claim.run().join("manifest.waiting"), &self.manifest.to_json()?)?;
        sync_folder(&folder);
        step(fuel)?;
        fs::remove_file(claim.run().join(JOURNAL))?;
        claim.keep(false);
        claim.keep_folders();
        step(fuel)?;
        Ok(notes)
    }
}
