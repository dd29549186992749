//! What a study gives, and what its reports share.

use groundcal::Error;
use groundcal_report::plot::{Curve, Figure, Marker, Panel, Style};
use rayon::prelude::*;

use crate::{
    error::LabError,
    progress::Progress,
    studies::radial::Spread,
    tables::{optional, six_digits_trimmed},
};

/// What a study gives.
#[derive(Debug, Clone)]
pub struct StudyOutput {
    /// `NAME.csv`.
    pub table: Vec<u8>,
    /// `NAME.svg`, `NAME.png`.
    pub figure: Figure,
    /// A summary as text.
    pub page: String,
}

/// Median absolute value of a normal variable of unit variance.
pub(crate) const HALF_NORMAL_MEDIAN: f64 = 0.674_489_750_196_082;

// Okabe & Ito, told apart by the colour-blind.
pub(crate) const SKY: [u8; 3] = [86, 180, 233];
pub(crate) const BLUE: [u8; 3] = [0, 114, 178];
pub(crate) const ORANGE: [u8; 3] = [230, 159, 0];
pub(crate) const RED: [u8; 3] = [213, 94, 0];
pub(crate) const PURPLE: [u8; 3] = [204, 121, 167];
pub(crate) const GREEN: [u8; 3] = [0, 158, 115];
pub(crate) const BLACK: [u8; 3] = [0, 0, 0];
pub(crate) const DASHED: &[f64] = &[7.0, 4.0];
pub(crate) const DOTTED: &[f64] = &[2.0, 3.0];

/// A line of width 2; markers of whole lines are filled.
pub(crate) fn style(color: [u8; 3], dash: &'static [f64], marker: Option<Marker>) -> Style {
    Style { color, width: 2.0, dash, marker, filled: dash.is_empty() }
}

/// Curves without points.
pub(crate) fn empty_curves(styles: &[Style]) -> Vec<Curve> {
    styles.iter().map(|&style| Curve { style, points: Vec::new(), band: Vec::new() }).collect()
}

/// Panels two in a row.
pub(crate) fn two_a_row(panels: Vec<Panel>) -> Vec<Vec<Panel>> {
    let mut rows: Vec<Vec<Panel>> = Vec::new();
    for panel in panels {
        match rows.last_mut() {
            Some(row) if row.len() < 2 => row.push(panel),
            _ => rows.push(vec![panel]),
        }
    }
    rows
}

/// Results of all trials, in order.
///
/// # Errors
/// [`Error::Stopped`] where it was asked for.
pub(crate) fn trials<T: Send>(
    count: u32,
    progress: &dyn Progress,
    one: impl Fn(u64) -> T + Sync,
) -> Result<Vec<T>, LabError> {
    (0..u64::from(count))
        .into_par_iter()
        .map(|i| {
            if progress.stopped() {
                return Err(Error::Stopped.into());
            }
            let out = one(i);
            progress.advance();
            Ok(out)
        })
        .collect()
}

/// Columns of [`spread_record`].
pub(crate) const SPREAD: [&str; 8] = [
    "trials",
    "failures",
    "median_percent",
    "lower_quartile_percent",
    "upper_quartile_percent",
    "median_signed_percent",
    "mean_signed_percent",
    "deviation_percent",
];

/// Counts and spread, as the columns of [`SPREAD`].
pub(crate) fn spread_record(s: &Spread) -> Vec<String> {
    let [lower, middle, upper] = s.absolute_percent.map(six_digits_trimmed);
    vec![
        s.trials.to_string(),
        s.failures.to_string(),
        middle,
        lower,
        upper,
        optional(s.median_percent),
        optional(s.mean_percent),
        optional(s.deviation_percent),
    ]
}

/// A signed number of a page.
pub(crate) fn signed(value: Option<f64>) -> String {
    value.map_or("-".into(), |v| format!("{v:+.3}"))
}

/// A median, with the failures in brackets where there are any.
pub(crate) fn with_failures(median: f64, failures: usize) -> String {
    let failures = if failures > 0 { format!(" ({failures})") } else { String::new() };
    format!("{median:.3}{failures}")
}
