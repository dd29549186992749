//! What can stop a study or an experiment.

use groundcal::Error;
use groundcal_io::error::IoError;

/// Why a study or an experiment ended early.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum LabError {
    /// The library's word on what it was given. A refusal of a method is a result of an experiment, not this.
    #[error(transparent)]
    Calibration(#[from] Error),
    /// A picture or file could not be made, read or written.
    #[error(transparent)]
    Files(#[from] IoError),
    /// A figure could not be drawn.
    #[error(transparent)]
    Figure(#[from] groundcal_report::error::ReportError),
    /// A scene, a table or a picture could not be made.
    #[error("{0}")]
    Other(String),
}
