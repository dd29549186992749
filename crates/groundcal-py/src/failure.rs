//! What can go wrong, and the Python exception it becomes.
//!
//! The classes are written in Python (`groundcal._errors`), with a code and remedies; here they are raised.

use groundcal::{Error, Wording};
use groundcal_io::{error::IoError, text::message};
use groundcal_lab::error::LabError;
use groundcal_report::error::ReportError;
use pyo3::{
    exceptions::{PyOSError, PyRuntimeError},
    prelude::*,
};

use crate::keywords::Keywords;

/// Why there is no result.
#[derive(Debug)]
pub(crate) enum Failure {
    /// The library's word.
    Library(Error),
    /// Input or an option that cannot be used, in words.
    Input(&'static str, String),
    /// Writing failed, or another fault of the surroundings.
    Surroundings(String),
    /// A fault of ours.
    Fault(String),
}

/// Input that cannot be used.
pub(crate) const UNUSABLE_INPUT: &str = "unusable_input";
/// A value of a keyword that cannot be used.
pub(crate) const UNUSABLE_OPTION: &str = "unusable_option";

impl Failure {
    /// Input that cannot be used.
    pub(crate) fn input(what: impl Into<String>) -> Self {
        Failure::Input(UNUSABLE_INPUT, what.into())
    }

    /// A value of a keyword that cannot be used.
    pub(crate) fn option(what: impl Into<String>) -> Self {
        Failure::Input(UNUSABLE_OPTION, what.into())
    }

    /// The library's word on what has a name of its own.
    pub(crate) fn of_input(name: &str, error: Error) -> Self {
        match error {
            Error::InvalidInput(what) | Error::InvalidOption(what) => Self::input(format!("{name}: {what}")),
            error => Failure::Library(error),
        }
    }
}

impl From<Error> for Failure {
    fn from(error: Error) -> Self {
        Failure::Library(error)
    }
}

impl From<IoError> for Failure {
    fn from(error: IoError) -> Self {
        let text = error.to_string();
        match error {
            IoError::Calibration(error) => Failure::Library(error),
            IoError::WouldReplace { input: true, .. } => Self::input(format!("{text}. Name another folder")),
            IoError::WouldReplace { .. } => {
                Self::input(format!("{text}. Name another folder, or give overwrite=True to replace them"))
            }
            IoError::Usage(_) => Self::input(text),
            error if error.is_input() => Self::input(text),
            _ => Failure::Surroundings(text),
        }
    }
}

impl From<ReportError> for Failure {
    fn from(error: ReportError) -> Self {
        Failure::Fault(error.to_string())
    }
}

impl From<LabError> for Failure {
    fn from(error: LabError) -> Self {
        match error {
            LabError::Calibration(error) => error.into(),
            LabError::Files(error) => error.into(),
            other => Failure::Fault(other.to_string()),
        }
    }
}

impl From<serde_json::Error> for Failure {
    fn from(error: serde_json::Error) -> Self {
        Failure::Fault(format!("cannot write the result as JSON: {error}"))
    }
}

/// Raises a class of `groundcal._errors`.
fn raised(py: Python<'_>, class: &str, text: &str, code: &str, remedies: &[String]) -> PyErr {
    let made = || py.import("groundcal._errors")?.getattr(class)?.call1((message(text), code, remedies.to_vec()));
    match made() {
        Ok(value) => PyErr::from_value(value),
        Err(error) => error,
    }
}

impl Failure {
    /// The exception, with what was noted of the input before, which may be its reason.
    pub(crate) fn raise_with(self, py: Python<'_>, notes: &[String]) -> PyErr {
        let error = self.raise(py);
        // Only the package's own have a place for them.
        if !notes.is_empty()
            && let Ok(method) = error.value(py).getattr("_note")
        {
            let notes: Vec<String> = notes.iter().map(|note| message(note)).collect();
            if let Err(fault) = method.call1((notes,)) {
                return fault;
            }
        }
        error
    }

    /// The exception.
    pub(crate) fn raise(self, py: Python<'_>) -> PyErr {
        match self {
            Failure::Library(error @ (Error::Numerical { .. } | Error::Stopped)) => {
                PyRuntimeError::new_err(error.message(&Keywords))
            }
            Failure::Library(error) => {
                let class = if error.is_degenerate() { "DegenerateError" } else { "InputError" };
                let remedies: Vec<String> = error.remedies().iter().map(|r| Keywords.remedy(r)).collect();
                raised(py, class, &error.message(&Keywords), error.code(), &remedies)
            }
            Failure::Input(code, text) => raised(py, "InputError", &text, code, &[]),
            Failure::Surroundings(text) => PyOSError::new_err(message(&text)),
            Failure::Fault(text) => PyRuntimeError::new_err(message(&text)),
        }
    }
}
