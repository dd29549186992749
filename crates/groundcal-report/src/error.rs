//! Why a page or a figure could not be made.

/// A fault in encoding a picture or drawing a figure.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub struct ReportError(pub String);
