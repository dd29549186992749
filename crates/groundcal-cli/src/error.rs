//! What ends the program early, and its exit code.

use std::path::Path;

use groundcal::{
    Error, Remedy,
    result::{Verdict, verdict_on_refusal},
};
use groundcal_io::text::{message, shown};
use serde::Serialize;

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
    Calibration(Error),
    /// Writing failed, or another fault of the surroundings.
    Other(String),
    /// A signal asked the program to end; the exit code.
    Stopped(u8),
    /// One of these, after something was noted that may be the reason.
    Noted(Box<CliError>, Noted),
}

/// What was noted before the end.
#[derive(Debug, Default)]
pub(crate) struct Noted {
    pub(crate) remarks: Vec<Remark>,
    /// Pairs that are no motions.
    pub(crate) left_out: Vec<PairLeftOut>,
}

impl Noted {
    pub(crate) fn is_empty(&self) -> bool {
        self.remarks.is_empty() && self.left_out.is_empty()
    }
}

/// A pair of images that is no motion.
#[derive(Debug, Clone, Serialize)]
pub(crate) struct PairLeftOut {
    pub(crate) from: String,
    pub(crate) to: String,
    pub(crate) reason: String,
}

/// What was noted of the input before the end.
#[derive(Debug, Clone, Serialize)]
pub(crate) struct Remark {
    /// Stable name: that of a warning, or of a note on a file.
    pub(crate) code: String,
    /// What standard error says.
    pub(crate) message: String,
}

/// An error as `--json` prints it.
#[derive(Debug, Serialize)]
pub(crate) struct ErrorReport {
    /// Where the images contradict the answer, which is not given.
    #[serde(skip_serializing_if = "Option::is_none")]
    verdict: Option<Verdict>,
    error: Failure,
}

#[derive(Debug, Serialize)]
struct Failure {
    /// Stable name.
    code: &'static str,
    /// What standard error says.
    message: String,
    /// Stable names of what to do, any of which helps.
    remedies: Vec<&'static str>,
    /// What was noted of the input before.
    notes: Vec<Remark>,
    /// Why each pair is no motion, where none or too few are.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pairs: Vec<PairLeftOut>,
}

impl CliError {
    /// The library's word on what a file holds, whatever it took it for: input, said of the file.
    pub(crate) fn of_file(path: &Path, error: Error) -> Self {
        Self::of_input(&shown(path), error)
    }

    /// The same of what has a name of its own.
    pub(crate) fn of_input(name: &str, error: Error) -> Self {
        match error {
            Error::InvalidInput(what) | Error::InvalidOption(what) => CliError::Input(format!("{name}: {what}")),
            error => error.into(),
        }
    }

    /// The same, where options are the library's other input.
    pub(crate) fn of_file_and_options(path: &Path, error: Error) -> Self {
        match error {
            Error::InvalidOption(_) => error.into(),
            error => Self::of_file(path, error),
        }
    }

    /// The program's exit code.
    pub(crate) fn exit_code(&self) -> u8 {
        match self {
            CliError::Usage(_) | CliError::Calibration(Error::InvalidOption(_)) => USAGE,
            CliError::Calibration(error) if error.is_degenerate() => UNDETERMINED,
            CliError::Input(_) | CliError::Calibration(Error::InvalidInput(_)) => INPUT,
            CliError::Calibration(_) | CliError::Other(_) => OTHER,
            CliError::Stopped(code) => *code,
            CliError::Noted(error, _) => error.exit_code(),
        }
    }

    /// For `--json`.
    pub(crate) fn report(&self) -> ErrorReport {
        if let CliError::Noted(error, noted) = self {
            let mut report = error.report();
            report.error.notes.extend_from_slice(&noted.remarks);
            report.error.pairs.extend_from_slice(&noted.left_out);
            return report;
        }
        let (code, remedies) = match self {
            CliError::Usage(_) => ("wrong_usage", Vec::new()),
            CliError::Input(_) => ("unusable_input", Vec::new()),
            CliError::Other(_) => ("failed", Vec::new()),
            CliError::Stopped(_) | CliError::Noted(..) => ("stopped", Vec::new()),
            CliError::Calibration(error) => (error.code(), error.remedies().iter().map(Remedy::code).collect()),
        };
        let verdict = match self {
            CliError::Calibration(error) => verdict_on_refusal(error),
            _ => None,
        };
        let message = self.to_string();
        ErrorReport { verdict, error: Failure { code, message, remedies, notes: Vec::new(), pairs: Vec::new() } }
    }
}

/// Fit for a terminal, whatever names and files hold.
impl std::fmt::Display for CliError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            CliError::Usage(text) | CliError::Input(text) | CliError::Other(text) => f.write_str(&message(text)),
            CliError::Calibration(error) => f.write_str(&message(&error.message(&Flags))),
            CliError::Stopped(_) => f.write_str("interrupted"),
            CliError::Noted(error, _) => error.fmt(f),
        }
    }
}

impl From<Error> for CliError {
    fn from(error: Error) -> Self {
        match (error, interrupt::requested()) {
            (Error::Stopped, Some(code)) => CliError::Stopped(code),
            (error, _) => CliError::Calibration(error),
        }
    }
}

impl From<groundcal_io::error::IoError> for CliError {
    fn from(error: groundcal_io::error::IoError) -> Self {
        use groundcal_io::error::IoError;
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
            LabError::Calibration(error) => error.into(),
            LabError::Files(error) => error.into(),
            other => CliError::Other(other.to_string()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_are_values_too() {
        let report = |error: CliError| serde_json::to_value(error.report()).unwrap()["error"].clone();
        let degenerate = report(Error::TooFewImages { found: 1 }.into());
        assert_eq!(degenerate["code"], "too_few_images");
        assert_eq!(degenerate["remedies"], serde_json::json!(["take_second_image"]));
        assert!(degenerate["message"].as_str().unwrap().starts_with("1 image: "));
        assert_eq!(degenerate["notes"], serde_json::json!([]));
        assert_eq!(report(CliError::Other("x\u{1b}[2J".into()))["message"], r"x\u{1b}[2J");
        let note = Remark { code: "damaged_image".into(), message: "a.jpg: ends early".into() };
        let noted = Noted { remarks: vec![note], ..Noted::default() };
        let noted = CliError::Noted(Box::new(Error::TooFewImages { found: 1 }.into()), noted);
        assert_eq!(noted.exit_code(), UNDETERMINED);
        let noted = report(noted);
        assert_eq!((&noted["code"], &noted["message"]), (&degenerate["code"], &degenerate["message"]));
        assert_eq!(noted["notes"], serde_json::json!([{"code": "damaged_image", "message": "a.jpg: ends early"}]));
    }

    #[test]
    fn what_a_file_holds_is_never_an_option() {
        let option = || Error::InvalidOption("attitude sigma 50 degrees".into());
        let error = CliError::of_file(Path::new("a/b.json"), option());
        assert_eq!((error.exit_code(), error.to_string()), (INPUT, "a/b.json: attitude sigma 50 degrees".into()));
        assert_eq!(CliError::of_file_and_options(Path::new("b"), option()).exit_code(), USAGE);
        assert_eq!(CliError::of_file(Path::new("b"), Error::TooFewImages { found: 1 }).exit_code(), UNDETERMINED);
    }
}
