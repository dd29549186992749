//! Radial distortion of one parameter: its error and that of fx, by noise and method.

use std::fmt::Write;

use groundcal_report::plot::{Curve, Figure, Marker, Panel, Style};

use crate::{
    error::LabError,
    progress::Progress,
    studies::{
        radial::{LAMBDA, Method, NOISE_PX, Spread, spread, trial},
        reports::output::{
            BLACK, BLUE, DASHED, DOTTED, GREEN, ORANGE, SPREAD, StudyOutput, signed, spread_record, style, trials,
            with_failures,
        },
        setting::{Asked, SETTING, Setting},
    },
    tables::{csv, six_digits_trimmed},
};

/// What one method made of one condition.
struct Row {
    method: Method,
    setting: Setting,
    noise_px: f64,
    lambda: Spread,
    fx: Spread,
}

/// Runs the trials of all conditions.
///
/// # Errors
/// [`LabError::Other`] when the table cannot be written.
pub fn run(asked: &Asked, count: u32, seed: u64, progress: &dyn Progress) -> Result<StudyOutput, LabError> {
    let settings = asked.settings();
    progress.begin("radial", (settings.len() * NOISE_PX.len()) as u64 * u64::from(count));
    let mut rows = Vec::new();
    for &setting in &settings {
        for &noise_px in &NOISE_PX {
            let outcomes = trials(count, progress, |i| trial(noise_px, setting, seed, i))?;
            rows.extend(Method::ALL.iter().enumerate().map(|(m, &method)| Row {
                method,
                setting,
                noise_px,
                lambda: spread(&outcomes.iter().map(|o| o[m].lambda).collect::<Vec<_>>()),
                fx: spread(&outcomes.iter().map(|o| o[m].fx).collect::<Vec<_>>()),
            }));
        }
    }
    progress.finish();
    Ok(StudyOutput { table: table(&rows)?, figure: figure(&rows, &settings, count), page: page(&rows, count) })
}

fn table(rows: &[Row]) -> Result<Vec<u8>, LabError> {
    let mut records = Vec::new();
    for r in rows {
        for (of, s) in [("lambda", &r.lambda), ("fx", &r.fx)] {
            if of == "lambda" && r.method == Method::Ignored {
                continue;
            }
            let mut record = vec!["radial".into(), six_digits_trimmed(r.noise_px)];
            record.extend(r.setting.record());
            record.extend([r.method.name().into(), of.into()]);
            record.extend(spread_record(s));
            records.push(record);
        }
    }
    let columns = [&["study", "noise_px"][..], &SETTING, &["method", "of"], &SPREAD].concat();
    csv(&columns, &records)
}

fn page(rows: &[Row], count: u32) -> String {
    let mut page = format!(
        "radial: error of lambda ({LAMBDA} in units of half the mean side) and of fx in % over {count} trials (failures in brackets)\n\
         {:>8}{:>6}{:>9}  {:<18}{:>16}{:>12}{:>12}{:>16}{:>12}{:>12}\n",
        "matches", "rolls", "noise px", "method", "lambda median", "bias", "sd", "fx median", "bias", "sd"
    );
    let failed = |s: &Spread| with_failures(s.absolute_percent[1], s.failures);
    for r in rows {
        let no_lens = r.method == Method::Ignored;
        let of_lens = |text: String| if no_lens { "-".into() } else { text };
        // Writing to a string cannot fail.
        let _ = writeln!(
            page,
            "{:>8}{:>6}{:>9}  {:<18}{:>16}{:>12}{:>12}{:>16}{:>12}{:>12}",
            r.setting.matches,
            r.setting.attitudes.short(),
            r.noise_px,
            r.method.name(),
            of_lens(failed(&r.lambda)),
            of_lens(signed(r.lambda.median_percent)),
            of_lens(signed(r.lambda.deviation_percent)),
            failed(&r.fx),
            signed(r.fx.median_percent),
            signed(r.fx.deviation_percent),
        );
    }
    page.push('\n');
    page
}

fn figure(rows: &[Row], settings: &[Setting], count: u32) -> Figure {
    let closed_bias = style(ORANGE, DASHED, None);
    let styles = [
        style(BLACK, DOTTED, None),
        style(ORANGE, &[], Some(Marker::Diamond)),
        style(BLUE, &[], Some(Marker::Circle)),
        style(GREEN, &[], Some(Marker::Triangle)),
    ];
    let curve = |style: Style, setting: &Setting, method: Method, of: &dyn Fn(&Row) -> f64| {
        let here = rows.iter().filter(|r| r.setting == *setting && r.method == method);
        Curve { style, points: here.map(|r| [r.noise_px, of(r)]).collect(), band: Vec::new() }
    };
    let of_lambda = |setting: &Setting| Panel {
        title: format!("lambda, {}", setting.words()),
        curves: (1..4)
            .map(|m| curve(styles[m], setting, Method::ALL[m], &|r| r.lambda.absolute_percent[1]))
            .chain([curve(closed_bias, setting, Method::ALL[1], &|r| {
                r.lambda.median_percent.map_or(f64::INFINITY, f64::abs)
            })])
            .collect(),
    };
    let of_fx = |setting: &Setting| Panel {
        title: format!("fx, {}", setting.words()),
        curves: (0..4).map(|m| curve(styles[m], setting, Method::ALL[m], &|r| r.fx.absolute_percent[1])).collect(),
    };
    Figure {
        title: "One-parameter radial distortion against image noise".into(),
        x_label: "standard deviation of image points, px".into(),
        y_label: "error, %".into(),
        x_log: false,
        rows: settings
            .chunks(2)
            .flat_map(|row| [row.iter().map(of_lambda).collect(), row.iter().map(of_fx).collect()])
            .collect(),
        legend: vec![
            (styles[0], "distortion ignored".into()),
            (styles[1], "closed form, each motion".into()),
            (closed_bias, "its bias: |median signed error|".into()),
            (styles[2], "minimised with each homography".into()),
            (styles[3], "minimised with all three homographies".into()),
        ],
        notes: vec![
            format!("Median of |error| over {count} trials, a failure counting as infinite. Without noise all but"),
            "ignoring the lens are exact: no point at 0 px.".into(),
        ],
    }
}
