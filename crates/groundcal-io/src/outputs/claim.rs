//! A folder that one run writes into: made where need be, its run folder locked, put back as it was if nothing comes of it.

use std::{
    fs::{self, File, OpenOptions, TryLockError},
    io,
    path::{Path, PathBuf},
};

use crate::{error::IoError, text::shown};

/// The run folder's name.
const RUN: &str = ".groundcal-run";
/// The lock and the results in it.
const LOCK: &str = "lock";
const NEW: &str = "new";
/// How often a run folder that another run takes away at this moment is made again.
const ATTEMPTS: usize = 20;

/// A folder and its lock. Dropped, it leaves the folder without the run folder, and without the folders that were made for it.
#[derive(Debug)]
pub(crate) struct Claim {
    folder: PathBuf,
    lock: Option<File>,
    /// Folders that were not there before, the outermost first.
    made: Vec<PathBuf>,
    /// Whether the run folder stays: it holds what the next run has to finish.
    keep: bool,
}

/// Whether a path still leads to an open file.
fn leads_to(path: &Path, file: &File) -> bool {
    #[cfg(unix)]
    {
        use std::os::unix::fs::MetadataExt;
        let place = |m: fs::Metadata| (m.dev(), m.ino());
        path.metadata().ok().map(place).is_some_and(|p| file.metadata().ok().map(place) == Some(p))
    }
    #[cfg(not(unix))]
    {
        // An open file's name is not given to another there.
        let _ = file;
        path.exists()
    }
}

impl Claim {
    /// Makes the folder and locks it.
    ///
    /// # Errors
    /// [`IoError::Other`] where it cannot be made, or another run is at work in it.
    pub(crate) fn new(folder: &Path) -> Result<Self, IoError> {
        let cannot =
            |e: io::Error| IoError::Other(format!("cannot write into {}: {e}. Name another folder", shown(folder)));
        let made: Vec<PathBuf> = folder
            .ancestors()
            .take_while(|p| !p.as_os_str().is_empty() && p.symlink_metadata().is_err())
            .map(Path::to_path_buf)
            .collect();
        let mut claim =
            Self { folder: folder.to_path_buf(), lock: None, made: made.into_iter().rev().collect(), keep: true };
        fs::create_dir_all(folder).map_err(cannot)?;
        let run = claim.run();
        if run.symlink_metadata().is_ok_and(|m| !m.is_dir()) {
            return Err(IoError::Usage(format!("{} is in the way: no run made it. Take it away", shown(&run))));
        }
        for _ in 0..ATTEMPTS {
            fs::create_dir_all(&run).map_err(cannot)?;
            let path = run.join(LOCK);
            let file = match OpenOptions::new().create(true).truncate(false).write(true).open(&path) {
                Ok(file) => file,
                Err(e) if e.kind() == io::ErrorKind::NotFound => continue,
                Err(e) => return Err(cannot(e)),
            };
            match file.try_lock() {
                Err(TryLockError::WouldBlock) => {
                    return Err(IoError::Other(format!(
                        "another run is writing into {}. Wait until it is done, or name another folder",
                        shown(folder)
                    )));
                }
                // Some network drives have no locks: one run at a time is then the user's care.
                Err(TryLockError::Error(e)) if e.kind() != io::ErrorKind::Unsupported => return Err(cannot(e)),
                _ => {}
            }
            if leads_to(&path, &file) {
                claim.lock = Some(file);
                claim.keep = false;
                return Ok(claim);
            }
        }
        Err(IoError::Other(format!("other runs come and go in {}. Name another folder", shown(folder))))
    }

    /// The folder written into.
    pub(crate) fn folder(&self) -> &Path {
        &self.folder
    }

    /// The run folder.
    pub(crate) fn run(&self) -> PathBuf {
        self.folder.join(RUN)
    }

    /// Where results wait.
    pub(crate) fn new_files(&self) -> PathBuf {
        self.run().join(NEW)
    }

    /// Whether the run folder is left for the next run to finish.
    pub(crate) fn keep(&mut self, keep: bool) {
        self.keep = keep;
    }

    /// The folders that were made stay: they hold results.
    pub(crate) fn keep_folders(&mut self) {
        self.made.clear();
    }

    /// Empties the run folder but for the lock.
    pub(crate) fn clear(&self) -> io::Result<()> {
        for entry in fs::read_dir(self.run())? {
            let entry = entry?;
            if entry.file_name() == LOCK {
                continue;
            }
            if entry.file_type()?.is_dir() { fs::remove_dir_all(entry.path())? } else { fs::remove_file(entry.path())? }
        }
        Ok(())
    }
}

impl Drop for Claim {
    fn drop(&mut self) {
        if !self.keep {
            // What cannot be taken away now goes with the next run. The lock goes last, and is let go of after its name is gone.
            let _ = self.clear();
            let _ = fs::remove_file(self.run().join(LOCK));
            self.lock = None;
            let _ = fs::remove_dir(self.run());
            for folder in self.made.iter().rev() {
                let _ = fs::remove_dir(folder);
            }
        }
    }
}
