//! What ends the program early, and its exit code.

use crate::{interrupt, remedies::Flags};

/// A calibration, or what else was asked for.
pub(crate) const SUCCESS: u8 = 0;
/// Anything else that goes wrong.
pub(crate) const OTHER: u8 = 1;
/// Wrong usage; also clap's.
const USAGE: u8 = 2;
/// The images cannot determine what was asked.
const UNDETERMINED: u8 = 3;
/// Unreadable or unusable input.
const INPUT: u8 = 4;

/// What ends the program early.
#[derive(Debug)]
pub(crate) enum CliError {
    /// The command line contradicts itself or names nothing.
    Usage(String),
    /// A file or folder cannot be read or does not hold what it should.
    Input(String),
    /// The library's word.
    Calibration(groundcal::error::Error),
    /// Writing failed, or another fault of the surroundings.
    Other(String),
    /// A signal asked the program to end; the exit code.
    Stopped(u8),
}

impl CliError {
    /// The program's exit code.
    pub(crate) fn exit_code(&self) -> u8 {
        use groundcal::error::Error;
        match self {
            CliError::Usage(_) | CliError::Calibration(Error::InvalidOption(_)) => USAGE,
            CliError::Calibration(error) if error.is_degenerate() => UNDETERMINED,
            CliError::Input(_) | CliError::Calibration(Error::InvalidInput(_)) => INPUT,
            CliError::Calibration(_) | CliError::Other(_) => OTHER,
            CliError::Stopped(code) => *code,
        }
    }
}

impl std::fmt::Display for CliError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            CliError::Usage(text) | CliError::Input(text) | CliError::Other(text) => f.write_str(text),
            CliError::Calibration(error) => f.write_str(&error.message(&Flags)),
            CliError::Stopped(_) => f.write_str("interrupted"),
        }
    }
}

impl From<groundcal::error::Error> for CliError {
    fn from(error: groundcal::error::Error) -> Self {
        match (error, interrupt::requested()) {
            (groundcal::error::Error::Stopped, Some(code)) => CliError::Stopped(code),
            (error, _) => CliError::Calibration(error),
        }
    }
}

impl From<groundcal_io::error::IoError> for CliError {
    fn from(error: groundcal_io::error::IoError) -> Self {
        use groundcal_io::error::IoError;
        // The error's own words are fit to be shown, whatever names and files hold.
        let text = error.to_string();
        match error {
            IoError::Usage(_) => CliError::Usage(text),
            IoError::WouldReplace { input: true, .. } => CliError::Usage(format!("{text}. Name another folder")),
            IoError::WouldReplace { .. } => {
                CliError::Usage(format!("{text}. Name another folder, or give --overwrite to replace them"))
            }
            IoError::Calibration(error) => CliError::Calibration(error),
            error if error.is_input() => CliError::Input(text),
            _ => CliError::Other(text),
        }
    }
}

impl From<groundcal_report::error::ReportError> for CliError {
    fn from(error: groundcal_report::error::ReportError) -> Self {
        CliError::Other(error.to_string())
    }
}

impl From<groundcal_lab::error::LabError> for CliError {
    fn from(error: groundcal_lab::error::LabError) -> Self {
        use groundcal_lab::error::LabError;
        match error {
            LabError::Calibration(error) => CliError::Calibration(error),
            LabError::Files(error) => error.into(),
            other => CliError::Other(other.to_string()),
        }
    }
}
