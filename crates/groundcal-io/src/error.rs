//! Why a file could not be read or written: with the file, and the line or field, where they are known.

use std::path::Path;

use groundcal::Error;

use crate::text::{message, shown};

/// What reading and writing can end with. Messages have no control characters, whatever names and files hold.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum IoError {
    /// What was named contradicts itself or names nothing.
    #[error("{}", message(.0))]
    Usage(String),
    /// Input that cannot be read or used, where no single file is at fault.
    #[error("{}", message(.0))]
    Input(String),
    /// A file or folder that cannot be read or does not hold what it should.
    #[error("{}{}: {}", message(.file), place(*.line), message(.what))]
    File {
        /// Its path, fit to be shown.
        file: String,
        /// The line at fault, from 1.
        line: Option<u64>,
        /// What is wrong, with the field's name where it is a field, and what helps.
        what: String,
    },
    /// The library's word on what a file holds.
    #[error(transparent)]
    Calibration(Error),
    /// A result would take the place of a file that is not an earlier one.
    #[error("{folder}: {names} would be overwritten, {}", whose(*.input))]
    WouldReplace {
        /// The folder of the results, fit to be shown.
        folder: String,
        /// Names of such files, fit to be shown.
        names: String,
        /// Whether they are inputs, which are never replaced; otherwise no run wrote them as they are.
        input: bool,
    },
    /// Writing failed, or another fault of the surroundings.
    #[error("{}", message(.0))]
    Other(String),
}

fn place(line: Option<u64>) -> String {
    line.map_or_else(String::new, |line| format!(" line {line}"))
}

fn whose(input: bool) -> &'static str {
    if input { "which this run reads" } else { "which no run wrote, or which was changed since" }
}

impl IoError {
    /// A fault of a file.
    pub(crate) fn file(path: &Path, what: impl Into<String>) -> Self {
        IoError::File { file: shown(path), line: None, what: what.into() }
    }

    /// A fault in a line of a file.
    pub(crate) fn line(path: &Path, line: u64, what: impl Into<String>) -> Self {
        IoError::File { file: shown(path), line: Some(line), what: what.into() }
    }

    /// Whether what the user gave to read is at fault, not the command or the surroundings.
    pub fn is_input(&self) -> bool {
        matches!(self, IoError::Input(_) | IoError::File { .. })
    }
}

/// A value of a file that the library takes for an option is input all the same.
impl From<Error> for IoError {
    fn from(error: Error) -> Self {
        match error {
            Error::InvalidOption(what) | Error::InvalidInput(what) => IoError::Input(what.to_string()),
            error => IoError::Calibration(error),
        }
    }
}
