//! The folder of files that the list names.

use std::{
    ffi::OsString,
    path::{Path, PathBuf},
};

use super::{calibrations, cameras, images, tables};

/// The files, made once, and an empty folder to work in.
pub(super) struct Files {
    folder: tempfile::TempDir,
}

impl Files {
    pub(super) fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let files = Self { folder };
        std::fs::create_dir(files.empty_folder()).unwrap();
        for (name, content) in [tables::files(), cameras::files(), calibrations::files(), images::files()].concat() {
            std::fs::write(files.path(&name), content).unwrap();
        }
        std::fs::create_dir(files.path("folder")).unwrap();
        std::fs::create_dir(files.path("folder.csv")).unwrap();
        std::fs::create_dir_all(files.path("nested/calibration.json")).unwrap();
        // As large as is said, without taking any room.
        let large = std::fs::File::create(files.path("large.yaml")).unwrap();
        large.set_len(65 << 20).unwrap();
        let large = std::fs::File::create(files.path("large.csv")).unwrap();
        large.set_len((512 << 20) + 1).unwrap();
        files.links();
        files
    }

    /// Links, devices and pipes.
    fn links(&self) {
        #[cfg(unix)]
        {
            use std::os::unix::fs::symlink;
            for name in ["zero.csv", "zero.png", "zero.yaml", "zero.json", "zero.toml"] {
                symlink("/dev/zero", self.path(name)).unwrap();
            }
            for name in ["dangling.png", "dangling.yaml", "dangling.csv"] {
                symlink("nowhere", self.path(name)).unwrap();
            }
            for name in ["pipe.csv", "pipe.png", "pipe.yaml", "pipe.json", "pipe.toml"] {
                let made = std::process::Command::new("mkfifo").arg(self.path(name)).status();
                assert!(made.is_ok_and(|s| s.success()), "mkfifo");
            }
        }
    }

    pub(super) fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    pub(super) fn empty_folder(&self) -> PathBuf {
        self.path("empty")
    }

    /// A command line: `@NAME` is a file of the folder, `OUT` a folder for results, `~` a blank, `^` an escape character.
    pub(super) fn arguments(&self, command: &str, out: &Path) -> Vec<OsString> {
        let plain = |word: &str| word.replace('~', " ").replace('^', "\u{1b}");
        let argument = |word: &str| match word.strip_prefix('@') {
            Some(name) => self.path(&plain(name)).into_os_string(),
            None if word == "OUT" => out.as_os_str().to_os_string(),
            None => plain(word).into(),
        };
        command.split_whitespace().map(argument).collect()
    }

    /// A text without the names of the folder, which differ from run to run and may look like anything.
    pub(super) fn without_folder(&self, text: &str) -> String {
        text.replace(&*self.folder.path().to_string_lossy(), "")
    }
}
