//! The paper's figure 4: a table, a figure and a page for each of its five studies.

use std::fmt::Write;

use groundcal::start::Constraint;
use groundcal_report::plot::{Curve, Figure, Marker, Panel, Style};

use crate::{
    error::LabError,
    progress::Progress,
    studies::{
        figure4::{Condition, MAX_SHIFT_M, Method, Study, Summary, Trial, summarise, summarise_bound, trial},
        reports::output::{
            BLACK, BLUE, DASHED, DOTTED, GREEN, ORANGE, PURPLE, RED, SKY, StudyOutput, trials, with_failures,
        },
        setting::{Asked, Setting},
    },
    tables::{csv, optional, six_digits_trimmed},
};

/// The trials of one condition, summed up: each of [`Method::ALL`], then the bound.
struct Row {
    condition: Condition,
    fewest_matches: usize,
    summaries: Vec<Summary>,
}

/// Runs the trials of a study.
///
/// # Errors
/// [`LabError::Other`] when the table cannot be written.
pub fn run(
    study: Study,
    asked: &Asked,
    count: u32,
    seed: u64,
    progress: &dyn Progress,
) -> Result<StudyOutput, LabError> {
    let conditions = study.conditions(asked);
    progress.begin(study.name(), conditions.len() as u64 * u64::from(count));
    let rows: Vec<Row> = conditions
        .into_iter()
        .map(|condition| {
            let outcomes: Vec<Trial> = trials(count, progress, |number| trial(&condition, seed, number))?;
            let methods = (0..Method::ALL.len()).map(|i| summarise(&outcomes, i));
            Ok(Row {
                condition,
                fewest_matches: outcomes.iter().map(|t| t.fewest_matches).min().unwrap_or(0),
                summaries: methods.chain([summarise_bound(&outcomes)]).collect(),
            })
        })
        .collect::<Result<_, LabError>>()?;
    progress.finish();
    let mut page = String::new();
    // Writing to a string cannot fail.
    let _ = summary(&mut page, study, &rows, count);
    Ok(StudyOutput { table: table(study, &rows)?, figure: figure(study, &rows, count), page })
}

/// Name and constraint of each summary of a row.
fn methods() -> impl Iterator<Item = (&'static str, Constraint)> {
    Method::ALL.iter().map(|m| (m.name(), m.constraint())).chain([("cramer_rao_bound", Constraint::ZeroSkew)])
}

const COLUMNS: [&str; 27] = [
    "study",
    "value",
    "matches",
    "roll_deg",
    "image_width",
    "image_height",
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
fn table(study: Study, rows: &[Row]) -> Result<Vec<u8>, LabError> {
    let mut records = Vec::new();
    for row in rows {
        let c = &row.condition;
        for ((name, constraint), s) in methods().zip(&row.summaries) {
            let [lower, median, upper] = s.quartiles_percent.map(six_digits_trimmed);
            let mut record = vec![study.name().to_string(), six_digits_trimmed(c.value)];
            record.extend(c.setting.record());
            record.extend([
                six_digits_trimmed(c.noise_px),
                six_digits_trimmed(c.offset_m),
                c.motions.to_string(),
                six_digits_trimmed(c.turn_deg),
                six_digits_trimmed(c.axis_error_deg),
                name.to_string(),
                constraint.to_string(),
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
            ]);
            record.extend((0..4).map(|i| optional(s.coverage.map(|c| c[i]))));
            records.push(record);
        }
    }
    csv(&COLUMNS, &records)
}

/// Curves shown, in drawing order: index of the summary, label, look (colours of Okabe & Ito, told apart by the colour-blind)
/// and whether its quartiles are.
fn curves() -> [(usize, &'static str, Style, bool); 7] {
    let style = |color, width, dash, marker, filled| Style { color, width, dash, marker, filled };
    [
        (5, "rotating camera, zero skew", style(PURPLE, 2.0, &[], Some(Marker::Diamond), true), true),
        (0, "planar, linear homographies, full", style(SKY, 2.0, &[], Some(Marker::Circle), true), false),
        (1, "planar, linear homographies, zero skew", style(BLUE, 2.0, &[], Some(Marker::Square), true), false),
        (2, "planar, nonlinear homographies, full", style(ORANGE, 1.8, DASHED, Some(Marker::Circle), false), false),
        (3, "planar, nonlinear homographies, zero skew", style(RED, 1.8, DASHED, Some(Marker::Square), false), false),
        (7, "groundcal, zero skew", style(GREEN, 2.4, &[], Some(Marker::Triangle), true), true),
        (8, "Cramér-Rao bound, planar motion, zero skew", style(BLACK, 1.8, DOTTED, None, false), false),
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
    // Panels side by side: numbers of matches; below one another: attitudes, then distances of the axis.
    let mut panels: Vec<((f64, Setting), Vec<&Row>)> = Vec::new();
    for row in rows {
        let offset = if study == Study::Offset { 0.0 } else { row.condition.offset_m };
        let key = (offset, row.condition.setting);
        match panels.iter_mut().find(|p| p.0 == key) {
            Some(panel) => panel.1.push(row),
            None => panels.push((key, vec![row])),
        }
    }
    let panel = |((offset, setting), rows): &((f64, Setting), Vec<&Row>)| Panel {
        title: if matches!(study, Study::Angle | Study::Axis) {
            format!("{}, axis at {offset} m", setting.words())
        } else {
            setting.words()
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
    write!(w, "{:>8}{:>6}{:>8}{:>9}", "matches", "rolls", "axis m", unit)?;
    for head in heads {
        write!(w, "{head:>14}")?;
    }
    writeln!(w, "{:>12}{:>8}", "rmse/bound", "95 %")?;
    for row in rows {
        let c = &row.condition;
        let s = &c.setting;
        write!(w, "{:>8}{:>6}{:>8}{:>9}", s.matches, s.attitudes.short(), c.offset_m, c.value)?;
        for (index, ..) in curves() {
            let s = &row.summaries[index];
            write!(w, "{:>14}", with_failures(s.quartiles_percent[1], s.failures))?;
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
            let rows: Vec<Row> = study.conditions(&Asked::default()).into_iter().map(row).collect();
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
