//! A run's results, from the first look at the folder to the last file in place.

use std::{
    collections::BTreeMap,
    fs::{self, File, OpenOptions},
    io::{self, Write},
    path::{Path, PathBuf},
    sync::{Arc, Mutex, MutexGuard, PoisonError, Weak},
};

use crate::{
    error::IoError,
    outputs::{
        check::{check_folder, check_names, check_targets},
        claim::Claim,
        digest,
        journal::{Fuel, Journal, Placing},
        manifest::{Entry, Manifest},
    },
    text::{plain, shown},
};

/// What a run is going to write.
#[derive(Debug, Clone)]
pub struct Request<'a> {
    /// The folder; it is made if need be.
    pub folder: &'a Path,
    /// Whose files they are: a later run of the same command replaces them.
    pub command: &'a str,
    /// Every name that may be written, with `/` where folders are inside.
    pub names: &'a [String],
    /// Every file that is read.
    pub inputs: &'a [PathBuf],
    /// What all files are made from. Where that of the last run was the same, its files stay beside the new ones; `None`: they go.
    pub basis: Option<&'a str>,
    /// Whether files that no run wrote, or that were changed since, may be replaced.
    pub overwrite: bool,
}

/// Results on their way. Dropped before [`Outputs::commit`], nothing of them is left.
#[derive(Debug)]
pub struct Outputs {
    staging: Arc<Mutex<Option<Staging>>>,
    notes: Vec<String>,
}

/// Throws the results of a run away from another thread, as Ctrl-C does.
#[derive(Debug, Clone)]
pub struct Abandon(Weak<Mutex<Option<Staging>>>);

/// What a run has written.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Written {
    /// The folder.
    pub folder: PathBuf,
    /// Names of the files, in the order in which they were announced.
    pub names: Vec<String>,
    /// What became of the files of earlier runs, sentences for the user.
    pub notes: Vec<String>,
}

#[derive(Debug)]
struct Staging {
    claim: Claim,
    command: String,
    basis: Option<String>,
    names: Vec<String>,
    inputs: Vec<PathBuf>,
    overwrite: bool,
    written: BTreeMap<String, Entry>,
}

fn locked(staging: &Mutex<Option<Staging>>) -> MutexGuard<'_, Option<Staging>> {
    staging.lock().unwrap_or_else(PoisonError::into_inner)
}

fn ended() -> IoError {
    IoError::Other("the run was ended".into())
}

/// "3 files", "1 file".
fn files(count: usize) -> String {
    format!("{count} file{}", if count == 1 { "" } else { "s" })
}

impl Outputs {
    /// Looks at everything that could stand in the way, and claims the folder.
    ///
    /// # Errors
    /// [`IoError::WouldReplace`] where a result would take the place of an input or of a file that no run wrote; [`IoError::Usage`] for
    /// names or a folder that cannot be; [`IoError::Other`] where nothing can be written, or another run is at work there.
    ///
    /// ```
    /// use groundcal_io::outputs::{Outputs, Request};
    ///
    /// # let folder = tempfile::tempdir()?;
    /// let names = ["camera.txt".to_string()];
    /// let request =
    ///     Request { folder: folder.path(), command: "example", names: &names, inputs: &[], basis: None, overwrite: false };
    /// let outputs = Outputs::begin(&request)?;
    /// outputs.write("camera.txt", b"f 700")?;
    /// assert_eq!(outputs.commit()?.names, names);
    /// // Its own file may be replaced; once it was edited, it may not.
    /// Outputs::begin(&request)?;
    /// std::fs::write(folder.path().join("camera.txt"), "mine")?;
    /// assert!(Outputs::begin(&request).is_err());
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn begin(request: &Request) -> Result<Self, IoError> {
        check_folder(request.folder)?;
        check_names(request.names)?;
        let mut claim = Claim::new(request.folder)?;
        let cannot = |e: io::Error| IoError::Other(format!("cannot write into {}: {e}", shown(request.folder)));
        let mut notes = finish_interrupted(&mut claim)?;
        claim.clear().map_err(cannot)?;
        let (manifest, note) = Manifest::read(request.folder);
        notes.extend(note);
        check_targets(request.folder, request.names, request.inputs, &manifest, request.overwrite)?;
        // Names that the system does not take, or takes for one, are found here and not at the end.
        for name in request.names {
            let path = claim.new_files().join(name);
            let parent = path.parent().unwrap_or(request.folder);
            fs::create_dir_all(parent)
                .and_then(|()| OpenOptions::new().write(true).create_new(true).open(&path))
                .map_err(|e| IoError::Other(format!("cannot write {}: {e}", plain(name))))?;
        }
        let staging = Staging {
            claim,
            command: request.command.to_string(),
            basis: request.basis.map(String::from),
            names: request.names.to_vec(),
            inputs: request.inputs.to_vec(),
            overwrite: request.overwrite,
            written: BTreeMap::new(),
        };
        Ok(Self { staging: Arc::new(Mutex::new(Some(staging))), notes })
    }

    /// What [`Outputs::begin`] had to do, sentences for the user.
    pub fn notes(&self) -> &[String] {
        &self.notes
    }

    /// Means for another thread to throw the results away.
    pub fn abandon(&self) -> Abandon {
        Abandon(Arc::downgrade(&self.staging))
    }

    /// Writes a file that waits for the others. Names that were announced and never written do not appear.
    ///
    /// # Errors
    /// [`IoError::Other`] for a name that was not announced, and where the disk does not take it.
    pub fn write(&self, name: &str, content: &[u8]) -> Result<(), IoError> {
        let mut staging = locked(&self.staging);
        let staging = staging.as_mut().ok_or_else(ended)?;
        let path = staging.claim.folder().join(name);
        let cannot = |e: io::Error| IoError::Other(format!("cannot write {}: {e}", shown(&path)));
        if !staging.names.iter().any(|n| n == name) {
            return Err(IoError::Other(format!("{} was not announced", plain(name))));
        }
        let mut file = File::create(staging.claim.new_files().join(name)).map_err(cannot)?;
        file.write_all(content).and_then(|()| file.sync_all()).map_err(cannot)?;
        let entry = Entry { name: name.to_string(), bytes: content.len() as u64, sha256: digest::sha256(content) };
        staging.written.insert(name.to_string(), entry);
        Ok(())
    }

    /// Moves all results into place.
    ///
    /// # Errors
    /// As [`Outputs::begin`], whose rules are asked again; [`IoError::Other`] where a file cannot be moved: the next run goes on there.
    pub fn commit(self) -> Result<Written, IoError> {
        self.commit_up_to(None)
    }

    /// As [`Outputs::commit`], broken off after so many steps.
    pub(crate) fn commit_up_to(self, mut fuel: Fuel) -> Result<Written, IoError> {
        let mut staging = locked(&self.staging);
        let mut staging = staging.take().ok_or_else(ended)?;
        let folder = staging.claim.folder().to_path_buf();
        let cannot = |e: io::Error| IoError::Other(format!("cannot write into {}: {e}", shown(&folder)));
        let names: Vec<String> = staging.names.iter().filter(|n| staging.written.contains_key(*n)).cloned().collect();
        let (manifest, _) = Manifest::read(&folder);
        check_targets(&folder, &names, &staging.inputs, &manifest, staging.overwrite)?;
        let (journal, kept) = staging.journal(&names, &manifest).map_err(cannot)?;
        let removed: Vec<String> = journal.remove.iter().map(|e| plain(&e.name)).collect();
        journal.write(&mut staging.claim, &mut fuel).map_err(cannot)?;
        let mut notes = journal.apply(&mut staging.claim, &mut fuel).map_err(cannot)?;
        if !removed.is_empty() {
            notes.push(format!("taken away, of an earlier run: {}", listed(&removed)));
        }
        if !kept.is_empty() {
            notes.push(format!("of an earlier run, but changed since, and kept: {}", listed(&kept)));
        }
        Ok(Written { folder, names, notes })
    }
}

/// The first few of many.
fn listed(names: &[String]) -> String {
    const SHOWN: usize = 5;
    let first = names.iter().take(SHOWN).cloned().collect::<Vec<_>>().join(", ");
    if names.len() > SHOWN { format!("{first} and {} more", names.len() - SHOWN) } else { first }
}

/// Finishes a run that was killed after its results were whole.
fn finish_interrupted(claim: &mut Claim) -> Result<Vec<String>, IoError> {
    let Some(journal) = Journal::read(claim)? else { return Ok(Vec::new()) };
    // Until it is finished, it is not to be cleared away.
    claim.keep(true);
    let run = shown(&claim.run());
    let mut notes = journal.apply(claim, &mut None).map_err(|e| {
        IoError::Other(format!("cannot finish an interrupted run: {e}. Mend that, or take the folder {run} away"))
    })?;
    let what = files(journal.place.len());
    notes.push(format!("an interrupted run of {} was finished: {what} moved into place", plain(&journal.command)));
    Ok(notes)
}

impl Staging {
    /// What is to be done, and which files of an earlier run were changed since.
    fn journal(&self, names: &[String], manifest: &Manifest) -> io::Result<(Journal, Vec<String>)> {
        let folder = self.claim.folder();
        let entries: Vec<Entry> = names.iter().filter_map(|n| self.written.get(n)).cloned().collect();
        let mut place = Vec::with_capacity(entries.len());
        for entry in &entries {
            let replaces = digest::of_file(&folder.join(&entry.name))?;
            place.push(Placing { name: entry.name.clone(), replaces, sha256: entry.sha256.clone() });
        }
        let basis = self.basis.as_deref();
        let (mut remove, mut kept) = (Vec::new(), Vec::new());
        for old in manifest.stale(&self.command, basis, &entries) {
            if folder.join(&old.name).symlink_metadata().is_err() {
                continue;
            }
            if old.is_unchanged(folder)? { remove.push(old) } else { kept.push(plain(&old.name)) }
        }
        let after = manifest.after(&self.command, basis, &entries);
        Ok((Journal { command: self.command.clone(), place, remove, manifest: after }, kept))
    }
}

impl Abandon {
    /// Throws the results away, unless they are in place or just being moved there: then it waits until they are.
    pub fn now(&self) {
        if let Some(staging) = self.0.upgrade() {
            locked(&staging).take();
        }
    }
}
