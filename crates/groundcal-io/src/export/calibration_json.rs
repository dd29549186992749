//! `calibration.json` (docs/formats.md).

use groundcal::result::Calibration;

use crate::error::IoError;

/// The calibration as JSON.
///
/// # Errors
/// [`IoError::Other`] where a number cannot be written.
pub fn json(calibration: &Calibration) -> Result<String, IoError> {
    serde_json::to_string_pretty(calibration)
        .map(|text| text + "\n")
        .map_err(|e| IoError::Other(format!("cannot write the calibration as JSON: {e}")))
}
