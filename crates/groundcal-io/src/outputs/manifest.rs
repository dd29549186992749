//! The list of the files that runs wrote into a folder.

use std::{
    io,
    path::{Component, Path},
};

use serde::{Deserialize, Serialize};

use crate::{file, limits::MAX_CAMERA_BYTES, outputs::digest};

/// Its name in the folder.
pub const MANIFEST: &str = ".groundcal-manifest.json";
/// Of its format.
const FORMAT_VERSION: u32 = 1;

/// A file as a run wrote it.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Entry {
    /// Path in the folder, with `/` between its parts.
    pub(crate) name: String,
    /// Its length.
    pub(crate) bytes: u64,
    /// Its content's SHA-256 in hexadecimal.
    pub(crate) sha256: String,
}

/// The files of a command.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Record {
    /// The command.
    pub(crate) command: String,
    /// What all its files were made from, where later runs may add to them.
    pub(crate) basis: Option<String>,
    /// The files, by name.
    pub(crate) files: Vec<Entry>,
}

/// The list.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Manifest {
    format_version: u32,
    /// A record a command.
    pub(crate) commands: Vec<Record>,
}

impl Default for Manifest {
    fn default() -> Self {
        Self { format_version: FORMAT_VERSION, commands: Vec::new() }
    }
}

/// Whether a name stays inside the folder, on every system.
pub(crate) fn stays_inside(name: &str) -> bool {
    let parts = Path::new(name).components();
    !name.is_empty() && !name.contains('\\') && parts.clone().all(|c| matches!(c, Component::Normal(_)))
}

impl Manifest {
    /// That of a folder; an empty one where there is none. The sentence says why a list that is there is not used.
    pub(crate) fn read(folder: &Path) -> (Self, Option<String>) {
        let path = folder.join(MANIFEST);
        if path.symlink_metadata().is_err_and(|e| e.kind() == io::ErrorKind::NotFound) {
            return (Self::default(), None);
        }
        let parsed = file::bytes(&path, MAX_CAMERA_BYTES)
            .map_err(|e| e.to_string())
            .and_then(|bytes| serde_json::from_slice::<Self>(&bytes).map_err(|e| e.to_string()))
            .and_then(|m| match m.format_version {
                FORMAT_VERSION => Ok(m),
                other => Err(format!("its format_version is {other}, not {FORMAT_VERSION}")),
            });
        match parsed {
            Ok(mut manifest) => {
                for record in &mut manifest.commands {
                    record.files.retain(|e| stays_inside(&e.name));
                }
                (manifest, None)
            }
            Err(what) => (
                Self::default(),
                Some(format!("{MANIFEST} is not used, no file counts as written by an earlier run: {what}")),
            ),
        }
    }

    /// As it is written.
    pub(crate) fn to_json(&self) -> Result<Vec<u8>, serde_json::Error> {
        let mut bytes = serde_json::to_vec_pretty(self)?;
        bytes.push(b'\n');
        Ok(bytes)
    }

    /// The file of this name.
    pub(crate) fn entry(&self, name: &str) -> Option<&Entry> {
        self.commands.iter().flat_map(|r| &r.files).find(|e| e.name == name)
    }

    /// The files of a command's last run that a run with these files leaves without successor.
    pub(crate) fn stale(&self, command: &str, basis: Option<&str>, files: &[Entry]) -> Vec<Entry> {
        let Some(record) = self.commands.iter().find(|r| r.command == command) else { return Vec::new() };
        if basis.is_some() && record.basis.as_deref() == basis {
            return Vec::new();
        }
        record.files.iter().filter(|old| files.iter().all(|new| new.name != old.name)).cloned().collect()
    }

    /// The list after a run: a name belongs to the command that wrote it last.
    pub(crate) fn after(&self, command: &str, basis: Option<&str>, files: &[Entry]) -> Self {
        let fresh = |e: &Entry| files.iter().all(|new| new.name != e.name);
        let mut commands = self.commands.clone();
        for record in &mut commands {
            record.files.retain(fresh);
        }
        let mut own = files.to_vec();
        if let Some(at) = commands.iter().position(|r| r.command == command) {
            let old = commands.remove(at);
            if basis.is_some() && old.basis.as_deref() == basis {
                own.extend(old.files);
            }
        }
        commands.push(Record { command: command.to_string(), basis: basis.map(String::from), files: own });
        commands.retain(|r| !r.files.is_empty());
        commands.sort_by(|a, b| a.command.cmp(&b.command));
        for record in &mut commands {
            record.files.sort_by(|a, b| a.name.cmp(&b.name));
        }
        Self { format_version: FORMAT_VERSION, commands }
    }
}

impl Entry {
    /// Whether a folder still has the file as it was written.
    pub(crate) fn is_unchanged(&self, folder: &Path) -> io::Result<bool> {
        let path = folder.join(&self.name);
        if path.symlink_metadata().is_ok_and(|m| m.len() != self.bytes) {
            return Ok(false);
        }
        Ok(digest::of_file(&path)?.as_deref() == Some(self.sha256.as_str()))
    }
}
