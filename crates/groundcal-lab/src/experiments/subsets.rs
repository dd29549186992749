//! All subsets of a few motions (KZR figures 5 and 6): how large their errors are, how large they were predicted to be without
//! truth, and whether the prediction tells good subsets from bad.

use std::fmt::Write;

use groundcal::{geometry::Intrinsics, start::Constraint};
use groundcal_report::{
    canvas::{png, svg},
    plot::{Curve, Figure, Marker, Panel, Style},
};

use crate::{
    error::LabError,
    experiments::{
        methods::Measured,
        setup::{OutputFile, Setup},
    },
    rank_correlation::spearman,
    studies::reports::output::two_a_row,
    subsets::{Subset, rank_subsets},
    tables::{self, six_digits},
};

/// Endings of its table and its figure.
pub(crate) const ENDINGS: [&str; 3] = ["_subsets.csv", "_subsets.svg", "_subsets.png"];
/// Pixels of the PNG for one of the SVG: sharp on dense screens.
const PNG_SCALE: f64 = 2.0;

/// A constraint and the number of motions it needs at least.
pub(crate) type Minimal = (Constraint, usize);

/// The subsets of one constraint, the surest first.
struct Ranking {
    minimal: Minimal,
    subsets: Vec<Subset>,
    /// Of each subset: error of fx in per cent with its sign; `None` without a camera.
    errors: Vec<Option<f64>>,
}

/// The linear method's camera of every subset, as the paper has it: axes exactly normal, nothing of the camera known but the
/// constraint.
fn rank(measured: &Measured, truth: &Intrinsics, minimal: Minimal) -> Result<Ranking, LabError> {
    let subsets = rank_subsets(&measured.motions, minimal.0, minimal.1)?;
    let error = |s: &Subset| Some(100.0 * (s.camera.as_ref().ok()?.intrinsics.fx / truth.fx - 1.0));
    let errors = subsets.iter().map(error).collect();
    Ok(Ranking { minimal, subsets, errors })
}

impl Ranking {
    /// (predicted deviation, |error|) of the subsets with a camera, per cent, the surest first.
    fn pairs(&self) -> (Vec<f64>, Vec<f64>) {
        let found = self.subsets.iter().zip(&self.errors).filter_map(|(s, e)| Some((s, (*e)?.abs())));
        found.map(|(s, error)| (100.0 * s.predicted_sigma(), error)).unzip()
    }
}

/// Ranks the subsets under each constraint: `NAME_subsets.csv`, `.svg` and `.png`, and a summary.
pub(crate) fn report(
    setup: &Setup,
    measured: &Measured,
    minimal: &[Minimal],
) -> Result<(Vec<OutputFile>, String), LabError> {
    let rankings: Vec<Ranking> = minimal.iter().map(|&m| rank(measured, &setup.truth, m)).collect::<Result<_, _>>()?;
    let canvas = figure(setup.name, &rankings).layout();
    let files = vec![
        setup.file(ENDINGS[0], csv(setup.name, &rankings)?),
        setup.file(ENDINGS[1], svg::document(&canvas).into_bytes()),
        setup.file(ENDINGS[2], png::encode(&canvas, PNG_SCALE)?),
    ];
    let mut page = String::new();
    // Writing to a string cannot fail.
    let _ = summary(&mut page, &rankings);
    Ok((files, page))
}

fn summary(w: &mut String, rankings: &[Ranking]) -> std::fmt::Result {
    writeln!(w, "All subsets of m motions, linear method: error of the focal length, %")?;
    writeln!(
        w,
        "{:<11}{:>3}{:>9}{:>11}{:>9}{:>9}{:>11}{:>13}{:>11}{:>12}",
        "constraint",
        "m",
        "subsets",
        "no camera",
        "best",
        "median",
        "predicted",
        "surest one's",
        "rank of",
        "rank corre-"
    )?;
    writeln!(
        w,
        "{:<11}{:>3}{:>9}{:>11}{:>9}{:>9}{:>11}{:>13}{:>11}{:>12}",
        "", "", "", "", "", "", "median", "error", "its error", "lation"
    )?;
    for r in rankings {
        let (predicted, errors) = r.pairs();
        let mut sorted = errors.clone();
        sorted.sort_by(f64::total_cmp);
        let middle = |v: &[f64]| v.get(v.len() / 2).map_or("-".into(), |x| format!("{x:.3}"));
        let first = errors.first().copied();
        let rank = first.map_or("-".into(), |e| (1 + errors.iter().filter(|v| **v < e).count()).to_string());
        let show = |v: Option<f64>| v.map_or("-".into(), |e| format!("{e:.3}"));
        writeln!(
            w,
            "{:<11}{:>3}{:>9}{:>11}{:>9}{:>9}{:>11}{:>13}{:>11}{:>12.2}",
            r.minimal.0,
            r.minimal.1,
            r.subsets.len(),
            r.subsets.len() - errors.len(),
            show(sorted.first().copied()),
            middle(&sorted),
            middle(&predicted),
            show(first),
            rank,
            spearman(&predicted, &errors)
        )?;
    }
    Ok(())
}

const COLUMNS: [&str; 6] =
    ["experiment", "constraint", "motions", "predicted_rank", "predicted_sd_percent", "focal_error_percent"];

/// A line a subset, the surest first; empty where there is no camera.
fn csv(name: &str, rankings: &[Ranking]) -> Result<Vec<u8>, LabError> {
    let mut records = Vec::new();
    for r in rankings {
        for (rank, (subset, error)) in r.subsets.iter().zip(&r.errors).enumerate() {
            let motions: Vec<String> = subset.motions.iter().map(|m| m.to_string()).collect();
            let sd = error.map_or(String::new(), |_| six_digits(100.0 * subset.predicted_sigma()));
            records.push(vec![
                name.to_string(),
                r.minimal.0.to_string(),
                motions.join(" "),
                (rank + 1).to_string(),
                sd,
                error.map_or(String::new(), six_digits),
            ]);
        }
    }
    tables::csv(&COLUMNS, &records)
}

/// True errors and predicted deviations, each in rising order, against the part of the subsets that have less.
fn figure(name: &str, rankings: &[Ranking]) -> Figure {
    let style = |color, dash, marker| Style { color, width: 2.2, dash, marker, filled: true };
    let error_style = style([213, 94, 0], &[], Some(Marker::Circle));
    let predicted_style = style([0, 114, 178], &[7.0, 4.0], None);
    // Markers on a few points only: there are hundreds.
    let sorted_curve = |mut values: Vec<f64>, all: usize, style: Style| {
        values.sort_by(f64::total_cmp);
        let point = |(i, v): (usize, &f64)| [100.0 * (i as f64 + 0.5) / all as f64, *v];
        Curve { style, points: values.iter().enumerate().map(point).collect(), band: Vec::new() }
    };
    let panels: Vec<Panel> = rankings
        .iter()
        .map(|r| {
            let (predicted, errors) = r.pairs();
            let all = r.subsets.len();
            let (constraint, size) = (r.minimal.0, r.minimal.1);
            Panel {
                title: format!("{constraint}, {size} motion{} of {}", if size == 1 { "" } else { "s" }, motions(r)),
                curves: vec![
                    sorted_curve(errors, all, Style { marker: (all < 20).then_some(Marker::Circle), ..error_style }),
                    sorted_curve(predicted, all, predicted_style),
                ],
            }
        })
        .collect();
    Figure {
        title: format!("Focal length from minimal sets of motions: {name}"),
        x_label: "subsets with less, % of all".into(),
        y_label: "error of fx, %".into(),
        x_log: false,
        rows: two_a_row(panels),
        legend: vec![
            (Style { marker: None, ..error_style }, "true error".into()),
            (predicted_style, "predicted standard deviation".into()),
        ],
        notes: vec!["Each curve in its own order. A curve that ends early: the other subsets gave no camera.".into()],
    }
}

/// Motions that the subsets are made of.
fn motions(r: &Ranking) -> usize {
    r.subsets.iter().flat_map(|s| &s.motions).max().map_or(0, |m| m + 1)
}
