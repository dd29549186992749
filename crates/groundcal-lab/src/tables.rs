//! Tables of numbers as CSV.

use groundcal_report::number::{significant, trimmed};

use crate::error::LabError;

/// A CSV with a head line.
///
/// # Errors
/// [`LabError::Other`] when a record has another number of columns than the head.
pub fn csv<S: AsRef<str>>(columns: &[&str], records: &[Vec<S>]) -> Result<Vec<u8>, LabError> {
    let fail = |e: &dyn std::fmt::Display| LabError::Other(format!("cannot write the table: {e}"));
    let mut writer = csv::Writer::from_writer(Vec::new());
    writer.write_record(columns).map_err(|e| fail(&e))?;
    for record in records {
        writer.write_record(record.iter().map(AsRef::as_ref)).map_err(|e| fail(&e))?;
    }
    writer.into_inner().map_err(|e| fail(&e))
}

/// Six significant digits, zeros at the end kept.
pub fn six_digits(value: f64) -> String {
    significant(value, 6, 12)
}

/// Six significant digits, no zeros at the end.
pub fn six_digits_trimmed(value: f64) -> String {
    trimmed(&significant(value, 6, 20)).to_string()
}

/// As [`six_digits_trimmed`]; empty where there is no number.
pub fn optional(value: Option<f64>) -> String {
    value.map_or(String::new(), six_digits_trimmed)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_six_digits() {
        for (value, text) in [
            (0.0, "0"),
            (15.0, "15"),
            (0.02, "0.02"),
            (1.0 / 3.0, "0.333333"),
            (123456.7, "123457"),
            (f64::INFINITY, "inf"),
        ] {
            assert_eq!(six_digits_trimmed(value), text);
        }
        assert_eq!((six_digits(15.0), six_digits(0.02)), ("15.0000".into(), "0.0200000".into()));
    }
}
