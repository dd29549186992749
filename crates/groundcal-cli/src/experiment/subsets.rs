//! All subsets of a few motions (KZR figures 5 and 6): how large their errors are, how large they were predicted to be without
//! truth, and whether the prediction tells good subsets from bad.

use std::{fmt::Write, path::Path};

use groundcal::{
    geometry::intrinsics::Intrinsics,
    numerics::statistics::spearman,
    start::{absolute_conic::Constraint, linear_camera::CameraOptions},
};
use groundcal_lab::subsets::{Subset, rank_subsets};

use crate::error::CliError;
use crate::experiment::{methods::Measured, table::number};
use groundcal_io::export::write_whole;
use groundcal_report::{
    canvas::{png, svg},
    plot::{Curve, Figure, Marker, Panel, Style},
};

/// A constraint and the number of motions it needs at least.
pub type Minimal = (Constraint, usize);

/// The subsets of one constraint, the surest first.
struct Ranking {
    minimal: Minimal,
    subsets: Vec<Subset>,
    /// Of each subset: error of fx in per cent with its sign; `None` without a camera.
    errors: Vec<Option<f64>>,
}

/// The linear method's camera of every subset, as the paper has it: axes exactly normal, nothing of the camera known but the
/// constraint.
fn rank(measured: &Measured, truth: &Intrinsics, minimal: Minimal) -> Result<Ranking, CliError> {
    let options = CameraOptions {
        constraint: minimal.0,
        aspect: 1.0,
        aspect_sigma: f64::INFINITY,
        principal_point_sigma_px: f64::INFINITY,
        given: Vec::new(),
        attitude_sigma_rad: 0.0,
        estimate_attitude_sigma: false,
    };
    let subsets = rank_subsets(&measured.motions, &measured.frame, &options, minimal.1)?;
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

/// Ranks the subsets under each constraint; writes `NAME_subsets.csv`, `.svg` and `.png`, and gives a summary.
pub fn report(
    name: &str,
    out: &Path,
    measured: &Measured,
    truth: &Intrinsics,
    minimal: &[Minimal],
) -> Result<String, CliError> {
    let rankings: Vec<Ranking> = minimal.iter().map(|&m| rank(measured, truth, m)).collect::<Result<_, _>>()?;
    let path = |extension: &str| out.join(format!("{name}_subsets.{extension}"));
    write_whole(&path("csv"), &csv(name, &rankings)?)?;
    let canvas = figure(name, &rankings).layout();
    write_whole(&path("svg"), svg::document(&canvas).as_bytes())?;
    write_whole(&path("png"), &png::encode(&canvas, 2.0)?)?;
    let mut page = String::new();
    // Writing to a string cannot fail.
    let _ = summary(&mut page, &rankings);
    Ok(page)
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
            r.minimal.0.name(),
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
fn csv(name: &str, rankings: &[Ranking]) -> Result<Vec<u8>, CliError> {
    let fail = |e: &dyn std::fmt::Display| CliError::Other(format!("cannot write the table of subsets: {e}"));
    let mut writer = csv::Writer::from_writer(Vec::new());
    writer.write_record(COLUMNS).map_err(|e| fail(&e))?;
    for r in rankings {
        for (rank, (subset, error)) in r.subsets.iter().zip(&r.errors).enumerate() {
            let motions: Vec<String> = subset.motions.iter().map(|m| m.to_string()).collect();
            let sd = error.map_or(String::new(), |_| number(100.0 * subset.predicted_sigma()));
            let record = [
                name.to_string(),
                r.minimal.0.name().to_string(),
                motions.join(" "),
                (rank + 1).to_string(),
                sd,
                error.map_or(String::new(), number),
            ];
            writer.write_record(&record).map_err(|e| fail(&e))?;
        }
    }
    writer.into_inner().map_err(|e| fail(&e))
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
            let (constraint, size) = (r.minimal.0.name(), r.minimal.1);
            Panel {
                title: format!("{constraint}, {size} motion{} of {}", if size == 1 { "" } else { "s" }, motions(r)),
                curves: vec![
                    sorted_curve(errors, all, Style { marker: (all < 20).then_some(Marker::Circle), ..error_style }),
                    sorted_curve(predicted, all, predicted_style),
                ],
            }
        })
        .collect();
    let mut rows: Vec<Vec<Panel>> = Vec::new();
    for panel in panels {
        match rows.last_mut().filter(|r| r.len() < 2) {
            Some(row) => row.push(panel),
            None => rows.push(vec![panel]),
        }
    }
    Figure {
        title: format!("Focal length from minimal sets of motions: {name}"),
        x_label: "subsets with less, % of all".into(),
        y_label: "error of fx, %".into(),
        x_log: false,
        rows,
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
