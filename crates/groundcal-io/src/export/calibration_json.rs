//! `calibration.json` (docs/formats.md).

use groundcal::{
    Wording,
    result::{Calibration, WarningReport},
};

use crate::error::IoError;

/// The calibration as JSON, its warnings in the words of a front end.
///
/// # Errors
/// [`IoError::Other`] where a number cannot be written.
pub fn json(calibration: &Calibration, wording: &dyn Wording) -> Result<String, IoError> {
    let text = || {
        let mut value = serde_json::to_value(calibration)?;
        value["warnings"] = serde_json::to_value(WarningReport::all(&calibration.warnings, wording))?;
        serde_json::to_string_pretty(&value)
    };
    text().map(|text| text + "\n").map_err(|e| IoError::Other(format!("cannot write the calibration as JSON: {e}")))
}
