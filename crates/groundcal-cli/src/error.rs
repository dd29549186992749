//! What ends the program early, and its exit code.

use crate::remedies::Flags;

/// Exit codes: 0 a calibration; 1 anything else; 2 wrong usage; 3 the images cannot determine what was asked; 4 unreadable or
/// unusable input.
#[derive(Debug)]
pub enum CliError {
    /// The command line contradicts itself or names nothing.
    Usage(String),
    /// A file or folder cannot be read or does not hold what it should.
    Input(String),
    /// The library's word.
    Calibration(groundcal::error::Error),
    /// Writing failed, or another fault of the surroundings.
    Other(String),
}

impl CliError {
    /// The program's exit code.
    pub fn exit_code(&self) -> u8 {
        use groundcal::error::Error;
        match self {
            CliError::Usage(_) | CliError::Calibration(Error::InvalidOption(_)) => 2,
            CliError::Calibration(error) if error.is_degenerate() => 3,
            CliError::Input(_) | CliError::Calibration(Error::InvalidInput(_)) => 4,
            CliError::Calibration(_) | CliError::Other(_) => 1,
        }
    }
}

impl std::fmt::Display for CliError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            CliError::Usage(text) | CliError::Input(text) | CliError::Other(text) => f.write_str(text),
            CliError::Calibration(error) => f.write_str(&error.message(&Flags)),
        }
    }
}

impl From<groundcal::error::Error> for CliError {
    fn from(error: groundcal::error::Error) -> Self {
        CliError::Calibration(error)
    }
}

impl From<groundcal_io::error::IoError> for CliError {
    fn from(error: groundcal_io::error::IoError) -> Self {
        use groundcal_io::error::IoError;
        match error {
            IoError::Usage(text) => CliError::Usage(text),
            IoError::Input(text) => CliError::Input(text),
            IoError::Calibration(error) => CliError::Calibration(error),
            other => CliError::Other(other.to_string()),
        }
    }
}

impl From<groundcal_report::error::ReportError> for CliError {
    fn from(error: groundcal_report::error::ReportError) -> Self {
        CliError::Other(error.to_string())
    }
}
