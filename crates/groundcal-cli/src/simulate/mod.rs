//! The simulation study: runs the trials, writes a table (CSV) and a figure (SVG, PNG) for each study, prints a summary.

mod further;

use std::{fmt::Write, path::Path};

use groundcal::start::absolute_conic::Constraint;
use groundcal_lab::studies::figure4::{
    Condition, MAX_SHIFT_M, Method, Study, Summary, Trial, summarise, summarise_bound, trial,
};
use indicatif::{ProgressBar, ProgressStyle};
use rayon::prelude::*;

use crate::{
    args::{SimulateArgs, StudyArg},
    error::CliError,
};
use groundcal_io::export::write_whole;
use groundcal_report::{
    canvas::{png, svg},
    plot::{Curve, Figure, Marker, Panel, Style},
};

/// The trials of one condition, summed up: each of [`Method::ALL`], then the bound.
struct Row {
    condition: Condition,
    fewest_matches: usize,
    summaries: Vec<Summary>,
}

/// Runs the studies asked for and gives the summary for standard output. Every file appears whole or not at all, and those of
/// a study that is done stay when a later one is interrupted.
pub fn run(args: &SimulateArgs) -> Result<String, CliError> {
    std::fs::create_dir_all(&args.out)
        .map_err(|e| CliError::Other(format!("cannot make the folder {}: {e}", args.out.display())))?;
    let mut page = String::new();
    for study in args.study.studies() {
        let rows = simulate(study, args.trials, args.seed);
        write_files(&args.out, study.name(), &table(study, &rows)?, &figure(study, &rows, args.trials))?;
        // Writing to a string cannot fail.
        let _ = summary(&mut page, study, &rows, args.trials);
    }
    for (name, run) in further::STUDIES {
        if args.study != StudyArg::All && args.study.name() != Some(name) {
            continue;
        }
        let output = run(args.trials, args.seed)?;
        write_files(&args.out, name, &output.table, &output.figure)?;
        page.push_str(&output.page);
    }
    Ok(page)
}

/// Pixels of the PNG for one of the SVG: sharp on dense screens.
const PNG_SCALE: f64 = 2.0;
/// Median absolute value of a normal variable of unit variance.
const HALF_NORMAL_MEDIAN: f64 = 0.674_489_750_196_082;

/// NAME.csv, NAME.svg and NAME.png.
fn write_files(out: &Path, name: &str, table: &[u8], figure: &Figure) -> Result<(), CliError> {
    let path = |extension: &str| out.join(format!("{name}.{extension}"));
    write_whole(&path("csv"), table)?;
    let canvas = figure.layout();
    write_whole(&path("svg"), svg::document(&canvas).as_bytes())?;
    Ok(write_whole(&path("png"), &png::encode(&canvas, PNG_SCALE)?)?)
}

/// Draws nothing where standard error is not a terminal.
fn progress_bar(name: &'static str, trials: u64) -> ProgressBar {
    let bar = ProgressBar::new(trials);
    if let Ok(style) = ProgressStyle::with_template("{msg:24} [{bar:40}] {pos}/{len} trials, {eta} left") {
        bar.set_style(style.progress_chars("=> "));
    }
    bar.set_message(name);
    bar
}

fn simulate(study: Study, trials: u32, seed: u64) -> Vec<Row> {
    let conditions = study.conditions();
    let bar = progress_bar(study.name(), conditions.len() as u64 * u64::from(trials));
    let rows = conditions
        .into_iter()
        .map(|condition| {
            let outcomes: Vec<Trial> = (0..u64::from(trials))
                .into_par_iter()
                .map(|number| {
                    let outcome = trial(&condition, seed, number);
                    bar.inc(1);
                    outcome
                })
                .collect();
            let methods = (0..Method::ALL.len()).map(|i| summarise(&outcomes, i));
            Row {
                condition,
                fewest_matches: outcomes.iter().map(|t| t.fewest_matches).min().unwrap_or(0),
                summaries: methods.chain([summarise_bound(&outcomes)]).collect(),
            }
        })
        .collect();
    bar.finish_and_clear();
    rows
}

/// Name and constraint of each summary of a row.
fn methods() -> impl Iterator<Item = (&'static str, Constraint)> {
    Method::ALL.iter().map(|m| (m.name(), m.constraint())).chain([("cramer_rao_bound", Constraint::ZeroSkew)])
}

const COLUMNS: [&str; 24] = [
    "study",
    "value",
    "matches",
    "noise_px",
    "offset_m",
    "motions",
    "turn_deg",
    "axis_error_deg",
    "method",
    "constraint",
    "trials",
    "failures",
    "fewest_matches",
    "median_percent",
    "lower_quartile_percent",
    "upper_quartile_percent",
    "rmse_percent",
    "rmse_fx_px",
    "rmse_over_bound",
    "rmse_over_bound_free_height",
    "coverage_fx",
    "coverage_fy",
    "coverage_cx",
    "coverage_cy",
];

/// `NAME.csv`: one line a condition and method; empty where a number does not exist, `inf` for a median of failures.
fn table(study: Study, rows: &[Row]) -> Result<Vec<u8>, CliError> {
    let mut records = Vec::new();
    for row in rows {
        let c = &row.condition;
        for ((name, constraint), s) in methods().zip(&row.summaries) {
            let [lower, median, upper] = s.quartiles_percent.map(number);
            let mut record = vec![
                study.name().to_string(),
                number(c.value),
                c.matches.to_string(),
                number(c.noise_px),
                number(c.offset_m),
                c.motions.to_string(),
                number(c.turn_deg),
                number(c.axis_error_deg),
                name.to_string(),
                constraint.name().to_string(),
                s.trials.to_string(),
                s.failures.to_string(),
                row.fewest_matches.to_string(),
                median,
                lower,
                upper,
                optional(s.rmse_percent),
                optional(s.rmse_px),
                optional(s.rmse_over_bound[0]),
                optional(s.rmse_over_bound[1]),
            ];
            record.extend((0..4).map(|i| optional(s.coverage.map(|c| c[i]))));
            records.push(record);
        }
    }
    csv_table(&COLUMNS, &records)
}

fn csv_table(columns: &[&str], records: &[Vec<String>]) -> Result<Vec<u8>, CliError> {
    let fail = |e: &dyn std::fmt::Display| CliError::Other(format!("cannot write the table: {e}"));
    let mut writer = csv::Writer::from_writer(Vec::new());
    writer.write_record(columns).map_err(|e| fail(&e))?;
    for record in records {
        writer.write_record(record).map_err(|e| fail(&e))?;
    }
    writer.into_inner().map_err(|e| fail(&e))
}

/// Empty where there is no number.
fn optional(value: Option<f64>) -> String {
    value.map_or(String::new(), number)
}

/// Six significant digits, no trailing zeros.
fn number(value: f64) -> String {
    if value == 0.0 || !value.is_finite() {
        return value.to_string();
    }
    let digits = (5 - value.abs().log10().floor() as i32).clamp(0, 20) as usize;
    let text = format!("{value:.digits$}");
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_string() } else { text }
}

/// Curves shown, in drawing order: index of the summary, label, look (colours of Okabe & Ito, told apart by the colour-blind)
/// and whether its quartiles are.
fn curves() -> [(usize, &'static str, Style, bool); 7] {
    let style = |color, width, dash, marker, filled| Style { color, width, dash, marker, filled };
    const DASHED: &[f64] = &[7.0, 4.0];
    let (sky, blue, orange, red, purple, green) =
        ([86, 180, 233], [0, 114, 178], [230, 159, 0], [213, 94, 0], [204, 121, 167], [0, 158, 115]);
    [
        (5, "rotating camera, zero skew", style(purple, 2.0, &[], Some(Marker::Diamond), true), true),
        (0, "planar, linear homographies, full", style(sky, 2.0, &[], Some(Marker::Circle), true), false),
        (1, "planar, linear homographies, zero skew", style(blue, 2.0, &[], Some(Marker::Square), true), false),
        (2, "planar, nonlinear homographies, full", style(orange, 1.8, DASHED, Some(Marker::Circle), false), false),
        (3, "planar, nonlinear homographies, zero skew", style(red, 1.8, DASHED, Some(Marker::Square), false), false),
        (7, "groundcal, zero skew", style(green, 2.4, &[], Some(Marker::Triangle), true), true),
        (8, "Cramér-Rao bound, planar motion, zero skew", style([0, 0, 0], 1.8, &[2.0, 3.0], None, false), false),
    ]
}

fn figure(study: Study, rows: &[Row], trials: u32) -> Figure {
    let (title, x_label) = match study {
        Study::Noise => ("Focal length error against image noise", "standard deviation of image points, px"),
        Study::Offset => (
            "Focal length error against distance of the rotation axis",
            "distance of the axis from the optical centre, m",
        ),
        Study::Motions => ("Focal length error against number of motions", "motions, each with an attitude of its own"),
        Study::Angle => ("Focal length error against rotation angle", "rotation angle, degrees"),
        Study::Axis => {
            ("Focal length error against error of the rotation axis", "angle from axis to floor normal, degrees")
        }
    };
    // Panels side by side: 200 and 20 matches; below one another: distances of the axis.
    let mut panels: Vec<((f64, usize), Vec<&Row>)> = Vec::new();
    for row in rows {
        let offset = if study == Study::Offset { 0.0 } else { row.condition.offset_m };
        let key = (offset, row.condition.matches);
        match panels.iter_mut().find(|p| p.0 == key) {
            Some(panel) => panel.1.push(row),
            None => panels.push((key, vec![row])),
        }
    }
    let panel = |((offset, matches), rows): &((f64, usize), Vec<&Row>)| Panel {
        title: if study == Study::Angle {
            format!("{matches} matches a motion, axis at {offset} m")
        } else {
            format!("{matches} matches a motion")
        },
        curves: curves()
            .iter()
            .map(|&(index, _, style, banded)| Curve {
                style,
                points: rows.iter().map(|r| [r.condition.value, r.summaries[index].quartiles_percent[1]]).collect(),
                band: if banded {
                    let band = |r: &&Row| {
                        let [low, _, high] = r.summaries[index].quartiles_percent;
                        [r.condition.value, low, high]
                    };
                    rows.iter().map(band).collect()
                } else {
                    Vec::new()
                },
            })
            .collect(),
    };
    let failed = rows.iter().any(|r| curves().iter().any(|c| r.summaries[c.0].quartiles_percent[1].is_infinite()));
    let mut notes =
        vec![format!("Median of |error| over {trials} trials, a failure counting as infinite; bands: quartiles.")];
    if failed {
        notes.push("A cross at the upper edge: half of the trials or more gave no camera.".into());
    }
    if study == Study::Offset {
        notes.push(format!(
            "Turns of 15 degrees, less where the camera would move further than {MAX_SHIFT_M} m (axis beyond 3.8 m)."
        ));
    }
    if study == Study::Axis {
        notes.push("The bound is that of an axis whose error is known.".into());
    }
    if study == Study::Noise {
        notes.push("Without noise all planar methods are exact: no point at 0 px.".into());
    }
    Figure {
        title: title.into(),
        x_label: x_label.into(),
        y_label: "error of fx, %".into(),
        x_log: matches!(study, Study::Offset | Study::Angle),
        rows: panels.chunks(2).map(|row| row.iter().map(panel).collect()).collect(),
        legend: curves().iter().map(|c| (c.2, c.1.to_string())).collect(),
        notes,
    }
}

/// A page of medians, and how groundcal's errors compare with the bound and with its intervals.
fn summary(w: &mut String, study: Study, rows: &[Row], trials: u32) -> std::fmt::Result {
    let unit = match study {
        Study::Noise => "noise px",
        Study::Offset => "offset m",
        Study::Motions => "motions",
        Study::Angle => "turn deg",
        Study::Axis => "axis deg",
    };
    writeln!(w, "{}: median |error| of fx in % over {trials} trials (failures in brackets)", study.name())?;
    let heads = ["rotating", "lin. full", "lin. zero", "nonl. full", "nonl. zero", "groundcal", "bound"];
    write!(w, "{:>8}{:>8}{:>9}", "matches", "axis m", unit)?;
    for head in heads {
        write!(w, "{head:>14}")?;
    }
    writeln!(w, "{:>12}{:>8}", "rmse/bound", "95 %")?;
    for row in rows {
        let c = &row.condition;
        write!(w, "{:>8}{:>8}{:>9}", c.matches, c.offset_m, c.value)?;
        for (index, ..) in curves() {
            let s = &row.summaries[index];
            let failures = if s.failures > 0 { format!(" ({})", s.failures) } else { String::new() };
            write!(w, "{:>14}", format!("{:.3}{failures}", s.quartiles_percent[1]))?;
        }
        let ours = &row.summaries[7];
        let ratio = ours.rmse_over_bound[0].map_or("-".into(), |r| format!("{r:.2}"));
        let held = ours.coverage.map_or("-".into(), |c| format!("{:.1}", 100.0 * c[0]));
        writeln!(w, "{ratio:>12}{held:>8}")?;
    }
    writeln!(w)
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
            assert_eq!(number(value), text);
        }
    }

    #[test]
    fn the_curves_are_the_methods_their_labels_name() {
        let found: Vec<(&str, Constraint)> = curves().iter().filter_map(|c| methods().nth(c.0)).collect();
        let (full, zero) = (Constraint::Full, Constraint::ZeroSkew);
        let expected = [
            ("rotating", zero),
            ("planar_linear", full),
            ("planar_linear", zero),
            ("planar_gold_standard", full),
            ("planar_gold_standard", zero),
            ("groundcal", zero),
            ("cramer_rao_bound", zero),
        ];
        assert_eq!(found, expected);
    }

    #[test]
    fn texts_fit_with_the_letters_there_are() {
        // As SVG they are drawn in the viewer's face, which may be wider.
        const WIDER: f64 = 1.1;
        for study in Study::ALL {
            let row = |condition| Row { condition, fewest_matches: 0, summaries: vec![summarise_bound(&[]); 9] };
            let rows: Vec<Row> = study.conditions().into_iter().map(row).collect();
            let canvas = figure(study, &rows, 100_000).layout();
            let texts = canvas.texts(WIDER);
            for (i, text) in texts.iter().enumerate() {
                let side = canvas.view[if text.upwards { 3 } else { 2 }];
                assert!(text.has_letters && text.along[0] >= 0.0 && text.along[1] <= side, "{text:?}");
                for other in texts[..i].iter().filter(|other| !(text.upwards || other.upwards)) {
                    let apart = (other.across - text.across).abs() >= text.size
                        || text.along[0] > other.along[1]
                        || text.along[1] < other.along[0];
                    assert!(apart, "{text:?}, {other:?}");
                }
            }
            assert!(texts.len() > 20);
        }
    }
}
