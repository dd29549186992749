//! Why a file could not be read or written.

/// What reading and writing can end with.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum IoError {
    /// What was named contradicts itself or names nothing.
    #[error("{0}")]
    Usage(String),
    /// A file or folder cannot be read or does not hold what it should.
    #[error("{0}")]
    Input(String),
    /// The library's word on what a file holds.
    #[error(transparent)]
    Calibration(#[from] groundcal::error::Error),
    /// Writing failed, or another fault of the surroundings.
    #[error("{0}")]
    Other(String),
}
