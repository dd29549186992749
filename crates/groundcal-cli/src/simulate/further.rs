//! Studies beside those of the paper's figure 4: radial distortion, one motion transferred, minimal sets.

use std::fmt::Write;

use groundcal::numerics::statistics::median;
use groundcal_lab::studies::{
    radial::{self, LAMBDA, Spread, spread},
    subset::{self, MOTIONS, PARTS, SIZES, part},
    transfer::{self, FIRST_TURN_DEG, TURNS_DEG},
};
use rayon::prelude::*;

use crate::error::CliError;
use crate::simulate::{csv_table, number, optional, progress_bar};
use groundcal_report::plot::{Curve, Figure, Marker, Panel, Style};

/// What a study gives.
pub struct Output {
    /// `NAME.csv`.
    pub table: Vec<u8>,
    /// `NAME.svg`, `NAME.png`.
    pub figure: Figure,
    /// For standard output.
    pub page: String,
}

type Run = fn(u32, u64) -> Result<Output, CliError>;

/// Names and functions of (trials, seed).
pub const STUDIES: [(&str, Run); 3] = [("radial", radial), ("transfer", transfer), ("subsets", subsets)];

// Okabe & Ito, told apart by the colour-blind.
const SKY: [u8; 3] = [86, 180, 233];
const BLUE: [u8; 3] = [0, 114, 178];
const ORANGE: [u8; 3] = [230, 159, 0];
const RED: [u8; 3] = [213, 94, 0];
const GREEN: [u8; 3] = [0, 158, 115];
const BLACK: [u8; 3] = [0, 0, 0];
const DASHED: &[f64] = &[7.0, 4.0];
const DOTTED: &[f64] = &[2.0, 3.0];

fn style(color: [u8; 3], dash: &'static [f64], marker: Option<Marker>) -> Style {
    Style { color, width: 2.0, dash, marker, filled: dash.is_empty() }
}

/// Results of all trials, in order.
fn trials<T: Send>(count: u32, bar: &indicatif::ProgressBar, one: impl Fn(u64) -> T + Sync) -> Vec<T> {
    (0..u64::from(count))
        .into_par_iter()
        .map(|i| {
            let out = one(i);
            bar.inc(1);
            out
        })
        .collect()
}

/// Counts and spread, as the columns of [`SPREAD`].
fn spread_record(s: &Spread) -> Vec<String> {
    let [lower, middle, upper] = s.absolute_percent.map(number);
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

const SPREAD: [&str; 8] = [
    "trials",
    "failures",
    "median_percent",
    "lower_quartile_percent",
    "upper_quartile_percent",
    "median_signed_percent",
    "mean_signed_percent",
    "deviation_percent",
];

fn text(value: Option<f64>) -> String {
    value.map_or("-".into(), |v| format!("{v:+.3}"))
}

fn radial(count: u32, seed: u64) -> Result<Output, CliError> {
    use radial::{MATCHES, Method, NOISE_PX, trial};
    let bar = progress_bar("radial", (MATCHES.len() * NOISE_PX.len()) as u64 * u64::from(count));
    let mut records = Vec::new();
    let mut page = format!(
        "radial: error of lambda ({LAMBDA} in units of half the mean side) and of fx in % over {count} trials (failures in brackets)\n\
         {:>8}{:>9}  {:<18}{:>16}{:>12}{:>12}{:>16}{:>12}{:>12}\n",
        "matches", "noise px", "method", "lambda median", "bias", "sd", "fx median", "bias", "sd"
    );
    // [matches][method] curves of λ, of its bias, of fx.
    let mut curves = vec![vec![[const { Vec::<[f64; 2]>::new() }; 3]; Method::ALL.len()]; MATCHES.len()];
    for (panel, &matches) in MATCHES.iter().enumerate() {
        for &noise in &NOISE_PX {
            let outcomes = trials(count, &bar, |i| trial(noise, matches, seed, i));
            for (m, method) in Method::ALL.iter().enumerate() {
                let lambda = spread(&outcomes.iter().map(|o| o[m].lambda).collect::<Vec<_>>());
                let fx = spread(&outcomes.iter().map(|o| o[m].fx).collect::<Vec<_>>());
                for (of, s) in [("lambda", &lambda), ("fx", &fx)] {
                    if of == "lambda" && *method == Method::Ignored {
                        continue;
                    }
                    let mut record =
                        ["radial".into(), number(noise), matches.to_string(), method.name().into(), of.into()].to_vec();
                    record.extend(spread_record(s));
                    records.push(record);
                }
                let failed = |s: &Spread| {
                    let failures = if s.failures > 0 { format!(" ({})", s.failures) } else { String::new() };
                    format!("{:.3}{failures}", s.absolute_percent[1])
                };
                let no_lens = *method == Method::Ignored;
                let _ = writeln!(
                    page,
                    "{matches:>8}{noise:>9}  {:<18}{:>16}{:>12}{:>12}{:>16}{:>12}{:>12}",
                    method.name(),
                    if no_lens { "-".into() } else { failed(&lambda) },
                    if no_lens { "-".into() } else { text(lambda.median_percent) },
                    if no_lens { "-".into() } else { text(lambda.deviation_percent) },
                    failed(&fx),
                    text(fx.median_percent),
                    text(fx.deviation_percent),
                );
                let c = &mut curves[panel][m];
                c[0].push([noise, lambda.absolute_percent[1]]);
                c[1].push([noise, lambda.median_percent.map_or(f64::INFINITY, f64::abs)]);
                c[2].push([noise, fx.absolute_percent[1]]);
            }
        }
    }
    bar.finish_and_clear();
    page.push('\n');
    let closed_bias = style(ORANGE, DASHED, None);
    let styles = [
        style(BLACK, DOTTED, None),
        style(ORANGE, &[], Some(Marker::Diamond)),
        style(BLUE, &[], Some(Marker::Circle)),
        style(GREEN, &[], Some(Marker::Triangle)),
    ];
    let curve = |style: Style, points: &Vec<[f64; 2]>| Curve { style, points: points.clone(), band: Vec::new() };
    let of_lambda = |panel: usize| Panel {
        title: format!("lambda, {} matches a motion", MATCHES[panel]),
        curves: (1..4)
            .map(|m| curve(styles[m], &curves[panel][m][0]))
            .chain([curve(closed_bias, &curves[panel][1][1])])
            .collect(),
    };
    let of_fx = |panel: usize| Panel {
        title: format!("fx, {} matches a motion", MATCHES[panel]),
        curves: (0..4).map(|m| curve(styles[m], &curves[panel][m][2])).collect(),
    };
    let columns = [&["study", "noise_px", "matches", "method", "of"][..], &SPREAD].concat();
    Ok(Output {
        table: csv_table(&columns, &records)?,
        figure: Figure {
            title: "One-parameter radial distortion against image noise".into(),
            x_label: "standard deviation of image points, px".into(),
            y_label: "error, %".into(),
            x_log: false,
            rows: vec![(0..2).map(of_lambda).collect(), (0..2).map(of_fx).collect()],
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
        },
        page,
    })
}

fn transfer(count: u32, seed: u64) -> Result<Output, CliError> {
    use transfer::{AXIS_ERRORS_DEG, EQUAL_TURN_DEG, MATCHES, Method, Setup, trial};
    let turning = |m| TURNS_DEG.iter().map(move |&turn| (turn, Setup::turning(turn, m))).collect::<Vec<_>>();
    let stray = |m| AXIS_ERRORS_DEG.iter().map(move |&e| (e, Setup::off_axis(e, m))).collect::<Vec<_>>();
    let panels: Vec<(&str, Vec<(f64, Setup)>)> = MATCHES
        .iter()
        .map(|&m| ("turn_deg", turning(m)))
        .chain(MATCHES.iter().map(|&m| ("axis_error_deg", stray(m))))
        .collect();
    let points = panels.iter().map(|p| p.1.len()).sum::<usize>();
    let bar = progress_bar("transfer", points as u64 * u64::from(count));
    let mut records = Vec::new();
    let mut page = format!(
        "transfer: median |error| of fx in % over {count} trials (failures in brackets)\n{:>8}{:>11}{:>10}{:>10}",
        "matches", "axis error", "1st turn", "others"
    );
    for method in Method::ALL {
        let _ = write!(page, "{:>18}", method.name());
    }
    page.push('\n');
    let styles = [
        style(BLUE, &[], Some(Marker::Square)),
        style(ORANGE, &[], Some(Marker::Diamond)),
        style(GREEN, &[], Some(Marker::Triangle)),
        style(BLACK, DOTTED, None),
    ];
    let mut drawn = Vec::new();
    for (varied, setups) in &panels {
        let mut curves: Vec<Curve> =
            styles.iter().map(|&style| Curve { style, points: Vec::new(), band: Vec::new() }).collect();
        for (x, setup) in setups {
            let outcomes = trials(count, &bar, |i| trial(setup, seed, i));
            let Setup { first_turn_deg, turn_deg, axis_error_deg, matches } = *setup;
            let _ = write!(page, "{matches:>8}{axis_error_deg:>11}{first_turn_deg:>10}{turn_deg:>10}");
            for (m, method) in Method::ALL.iter().enumerate() {
                // A bound is a deviation: the median error of an estimator at it.
                let unit = if *method == Method::Bound { super::HALF_NORMAL_MEDIAN } else { 1.0 };
                let s = spread(&outcomes.iter().map(|o| o[m].map(|e| unit * e)).collect::<Vec<_>>());
                let mut record = vec!["transfer".into(), varied.to_string(), number(first_turn_deg), number(turn_deg)];
                record.extend([number(axis_error_deg), matches.to_string(), method.name().into()]);
                record.extend(spread_record(&s));
                records.push(record);
                let failures = if s.failures > 0 { format!(" ({})", s.failures) } else { String::new() };
                let _ = write!(page, "{:>18}", format!("{:.3}{failures}", s.absolute_percent[1]));
                curves[m].points.push([*x, s.absolute_percent[1]]);
                if *method != Method::Bound {
                    curves[m].band.push([*x, s.absolute_percent[0], s.absolute_percent[2]]);
                }
            }
            page.push('\n');
        }
        let matches = setups.first().map_or(0, |s| s.1.matches);
        let title = match *varied {
            "turn_deg" => format!("others turn by x degrees; {matches} matches"),
            _ => format!("axes x degrees off, turns of {EQUAL_TURN_DEG}; {matches} matches"),
        };
        drawn.push(Panel { title, curves });
    }
    bar.finish_and_clear();
    page.push('\n');
    let head = ["study", "varied", "first_turn_deg", "turn_deg", "axis_error_deg", "matches", "method"];
    let columns = [&head[..], &SPREAD].concat();
    Ok(Output {
        table: csv_table(&columns, &records)?,
        figure: Figure {
            title: "One motion transferred, or motions of their own".into(),
            x_label: "x, degrees".into(),
            y_label: "error of fx, %".into(),
            x_log: true,
            rows: pairs(drawn),
            legend: styles
                .into_iter()
                .zip([
                    "a motion at each attitude, linear",
                    "the first motion transferred, linear",
                    "a motion at each attitude, groundcal",
                    "Cramér-Rao bound of those motions",
                ])
                .map(|(s, label)| (s, label.to_string()))
                .collect(),
            notes: vec![
                format!(
                    "Upper row: the first motion turns by {FIRST_TURN_DEG} degrees. Zero skew, three attitudes. Median of |error|"
                ),
                format!(
                    "over {count} trials, a failure counting as infinite; bands: quartiles. The bound knows the axes."
                ),
            ],
        },
        page,
    })
}

/// Panels two in a row.
fn pairs(panels: Vec<Panel>) -> Vec<Vec<Panel>> {
    let mut rows: Vec<Vec<Panel>> = Vec::new();
    for panel in panels {
        match rows.last_mut() {
            Some(row) if row.len() < 2 => row.push(panel),
            _ => rows.push(vec![panel]),
        }
    }
    rows
}

fn subsets(count: u32, seed: u64) -> Result<Output, CliError> {
    let bar = progress_bar("subsets", SIZES.len() as u64 * u64::from(count));
    let mut records = Vec::new();
    let mut page = format!(
        "subsets of {MOTIONS} motions: errors of fx in % over {count} scenes; first the paper's linear method and the weighted one on \
         one subset a scene\n{:>6}{:>12}{:>12}{:>10}{:>12}{:>12}{:>10}{:>10}{:>14}\n",
        "size", "linear mean", "sd", "failures", "weight. mean", "sd", "failures", "bound", "correlation"
    );
    let mut best = format!(
        "{:>6}{:>22}{:>22}{:>22}   median |error| of the weighted method\n",
        "size", "surest 5 %", "middle", "least sure 5 %"
    );
    let styles =
        [style(RED, &[], Some(Marker::Square)), style(BLUE, &[], Some(Marker::Circle)), style(SKY, DASHED, None)];
    let mut panels = Vec::new();
    for &size in &SIZES {
        let all: Vec<subset::Trial> =
            trials(count, &bar, |i| subset::trial(size, seed, i)).into_iter().flatten().collect();
        let firsts = |f: &dyn Fn(&subset::Ranked) -> Option<f64>| -> Spread {
            spread(&all.iter().map(|t| f(&t.first)).collect::<Vec<_>>())
        };
        let (linear, weighted) = (firsts(&|r| r.linear), firsts(&|r| r.weighted));
        let mean_square = |v: &[f64]| (v.iter().map(|b| b * b).sum::<f64>() / v.len().max(1) as f64).sqrt();
        let bound = 100.0 * mean_square(&all.iter().filter_map(|t| t.bound).collect::<Vec<_>>());
        let correlation = all.iter().map(|t| t.correlation).sum::<f64>() / all.len().max(1) as f64;
        let _ = writeln!(
            page,
            "{size:>6}{:>12}{:>12}{:>10}{:>12}{:>12}{:>10}{bound:>10.3}{correlation:>14.2}",
            text(linear.mean_percent),
            text(linear.deviation_percent),
            linear.failures,
            text(weighted.mean_percent),
            text(weighted.deviation_percent),
            weighted.failures
        );
        let mut curves: Vec<Curve> =
            styles.iter().map(|&style| Curve { style, points: Vec::new(), band: Vec::new() }).collect();
        let mut medians = Vec::new();
        for index in 0..PARTS {
            let here: Vec<&subset::Ranked> = all
                .iter()
                .flat_map(|t| {
                    let ranked = t.ranked.iter().enumerate();
                    ranked.filter(|(i, _)| part(*i, t.ranked.len()) == index).map(|(_, r)| r)
                })
                .collect();
            let place = 100.0 * (index as f64 + 0.5) / PARTS as f64;
            let mut predicted: Vec<f64> =
                here.iter().map(|r| 100.0 * super::HALF_NORMAL_MEDIAN * r.predicted).collect();
            let predicted = median(&mut predicted);
            let of =
                |f: &dyn Fn(&subset::Ranked) -> Option<f64>| spread(&here.iter().map(|r| f(r)).collect::<Vec<_>>());
            let (linear, weighted) = (of(&|r| r.linear), of(&|r| r.weighted));
            for (method, s) in [("linear", &linear), ("weighted", &weighted)] {
                let mut record =
                    ["subsets".into(), size.to_string(), number(place), number(predicted), method.into()].to_vec();
                record.extend(spread_record(s));
                records.push(record);
            }
            for (curve, y) in
                curves.iter_mut().zip([linear.absolute_percent[1], weighted.absolute_percent[1], predicted])
            {
                curve.points.push([place, y]);
            }
            curves[1].band.push([place, weighted.absolute_percent[0], weighted.absolute_percent[2]]);
            medians.push(weighted.absolute_percent[1]);
        }
        let _ = writeln!(best, "{size:>6}{:>22.3}{:>22.3}{:>22.3}", medians[0], medians[PARTS / 2], medians[PARTS - 1]);
        panels.push(Panel { title: format!("subsets of {size} motions"), curves });
    }
    bar.finish_and_clear();
    page.push_str(&best);
    page.push('\n');
    let columns = [&["study", "size", "place_percent", "predicted_percent", "method"][..], &SPREAD].concat();
    Ok(Output {
        table: csv_table(&columns, &records)?,
        figure: Figure {
            title: format!("All subsets of {MOTIONS} motions, ranked by predicted error"),
            x_label: "place in the ranking, % (0: the surest)".into(),
            y_label: "error of fx, %".into(),
            x_log: false,
            rows: pairs(panels),
            legend: vec![
                (styles[0], "true error, linear".into()),
                (styles[1], "true error, weighted by covariance".into()),
                (styles[2], "predicted without truth".into()),
            ],
            notes: vec![
                format!(
                    "Medians over {count} scenes of twelve motions, 1 px, 200 matches a motion, zero skew; a failure"
                ),
                "counts as infinite; bands: quartiles.".into(),
            ],
        },
        page,
    })
}
