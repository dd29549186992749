//! The table of an experiment: a line a constraint and method, as text and as CSV.

use std::fmt::Write;

use groundcal::{Error, start::Constraint};

use crate::{
    error::LabError,
    experiments::methods::{Score, Scores},
    tables::{self, six_digits},
};

/// What one method made of one set of motions.
pub(crate) struct Line {
    /// What it worked from: `features`, `pictures` or `given`.
    pub(crate) input: &'static str,
    pub(crate) constraint: Constraint,
    /// Whether it was told the true principal point, where the constraint holds one; the image centre otherwise.
    pub(crate) told_centre: bool,
    pub(crate) method: &'static str,
    pub(crate) motions: usize,
    pub(crate) outcome: Result<Scores, Error>,
}

impl Line {
    /// The constraint, with an asterisk where the principal point was told.
    fn label(&self) -> String {
        format!("{}{}", self.constraint, if self.told_centre { "*" } else { "" })
    }
}

const COLUMNS: [&str; 13] = [
    "experiment",
    "input",
    "constraint",
    "told_principal_point",
    "method",
    "motions",
    "focal_error_percent",
    "focal_sd_percent",
    "aspect_error_percent",
    "aspect_sd_percent",
    "principal_point_error_percent_of_f",
    "principal_point_sd_percent_of_f",
    "refused",
];

/// The table as CSV: six significant digits; an empty deviation says that the constraint holds the number, empty errors that there
/// is no camera, for the reason in the last column.
pub(crate) fn csv(experiment: &str, lines: &[Line]) -> Result<Vec<u8>, LabError> {
    let record = |line: &Line| {
        let mut record = vec![
            experiment.to_string(),
            line.input.to_string(),
            line.constraint.to_string(),
            line.told_centre.to_string(),
            line.method.to_string(),
            line.motions.to_string(),
        ];
        match &line.outcome {
            Ok(s) => {
                for score in [s.focal, s.aspect, s.principal_point] {
                    record.push(six_digits(score.error));
                    record.push(score.sd.map_or(String::new(), six_digits));
                }
                record.push(String::new());
            }
            Err(error) => {
                record.extend(std::iter::repeat_n(String::new(), 6));
                record.push(error.to_string());
            }
        }
        record
    };
    tables::csv(&COLUMNS, &lines.iter().map(record).collect::<Vec<_>>())
}

/// The table as text: errors with their stated deviations, in per cent; reasons of refusals below.
pub(crate) fn text(lines: &[Line]) -> String {
    let mut page = String::new();
    let mut notes: Vec<String> = Vec::new();
    // Writing to a string cannot fail.
    let _ = writeln!(
        page,
        "{:<11}{:<10}{:<17}{:>20}{:>20}{:>20}",
        "", "", "", "focal length, %", "aspect ratio, %", "princ. point, % of f"
    );
    let head = ["error", "sd", "error", "sd", "error", "sd"];
    let _ = write!(page, "{:<11}{:<10}{:<17}", "constraint", "from", "method");
    for (i, h) in head.into_iter().enumerate() {
        let _ = write!(page, "{h:>width$}", width = if i % 2 == 0 { 11 } else { 9 });
    }
    let _ = writeln!(page);
    for line in lines {
        let _ = write!(page, "{:<11}{:<10}{:<17}", line.label(), line.input, line.method);
        match &line.outcome {
            Ok(s) => {
                let _ = write!(page, "{}{}", cell(&s.focal, true), cell(&s.aspect, true));
                let _ = writeln!(page, "{}", cell(&s.principal_point, false));
            }
            Err(error) => {
                let note = error.to_string();
                let index = notes.iter().position(|n| *n == note).unwrap_or_else(|| {
                    notes.push(note);
                    notes.len() - 1
                });
                let _ = writeln!(page, "{:>20}", format!("no camera [{}]", index + 1));
            }
        }
    }
    if lines.iter().any(|l| l.told_centre) {
        let _ = writeln!(page, "* told the true principal point; without it, the image centre is held");
    }
    for (i, note) in notes.iter().enumerate() {
        // The remedy after the first sentence is for people with a camera.
        let first = note.split(". ").next().unwrap_or(note);
        let _ = writeln!(page, "[{}] {first}", i + 1);
    }
    page
}

fn cell(score: &Score, signed: bool) -> String {
    let error = if signed { format!("{:+.3}", score.error) } else { format!("{:.3}", score.error) };
    let sd = score.sd.map_or("held".into(), |v| if v < 1000.0 { format!("{v:.3}") } else { "> 1000".into() });
    format!("{error:>11}{sd:>9}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn held_numbers_and_refusals_are_told_apart() {
        let score = |error, sd| Score { error, sd };
        let scores =
            Scores { focal: score(-0.25, Some(0.5)), aspect: score(0.0, None), principal_point: score(1.5, None) };
        let line = |outcome| Line {
            input: "features",
            constraint: Constraint::Focal,
            told_centre: true,
            method: "linear",
            motions: 3,
            outcome,
        };
        let lines = [line(Ok(scores)), line(Err(Error::TooFewImages { found: 1 }))];
        let page = text(&lines);
        assert!(page.contains("-0.250    0.500     +0.000     held      1.500     held\n"), "{page}");
        assert!(page.contains("\nfocal*     features  linear"), "{page}");
        assert!(page.contains("is held\n[1] 1 image: a calibration needs"), "{page}");
        let table = String::from_utf8(csv("film", &lines).unwrap()).unwrap();
        assert!(table.contains("\nfilm,features,focal,true,linear,3,-0.250000,0.500000,0,,1.50000,,\n"), "{table}");
        assert!(table.contains("\nfilm,features,focal,true,linear,3,,,,,,,\"1 image:"), "{table}");
    }
}
