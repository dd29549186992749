//! All subsets of twelve motions, ranked by their predicted errors.

use std::fmt::Write;

use groundcal::numerics::median;
use groundcal_report::plot::{Figure, Marker, Panel, Style};

use crate::{
    error::LabError,
    progress::Progress,
    studies::{
        radial::{Spread, spread},
        reports::output::{
            BLUE, DASHED, HALF_NORMAL_MEDIAN, RED, SKY, SPREAD, StudyOutput, empty_curves, signed, spread_record,
            style, trials, two_a_row,
        },
        setting::{Asked, NOISE_PX, SETTING, Setting},
        subset::{MOTIONS, PARTS, Ranked, SIZES, Trial, part, trial},
    },
    tables::{csv, six_digits_trimmed},
};

/// Subsets of one place in the ranking.
struct Part {
    /// Place of its middle, per cent: 0 is the surest.
    place_percent: f64,
    /// Median error predicted, per cent.
    predicted_percent: f64,
    linear: Spread,
    weighted: Spread,
}

/// Subsets of one size.
struct OfSize {
    setting: Setting,
    size: usize,
    parts: Vec<Part>,
    /// On one subset a scene.
    first_linear: Spread,
    first_weighted: Spread,
    /// Root mean square, per cent.
    bound_percent: f64,
    correlation: f64,
}

/// Runs the trials of all sizes.
///
/// # Errors
/// [`LabError::Other`] when the table cannot be written.
pub fn run(asked: &Asked, count: u32, seed: u64, progress: &dyn Progress) -> Result<StudyOutput, LabError> {
    // Few matches say nothing new of choosing among subsets.
    let settings = Asked { matches: asked.matches.or(Some(Setting::default().matches)), ..*asked }.settings();
    let noise_px = asked.noise_px.unwrap_or(NOISE_PX);
    progress.begin("subsets", (settings.len() * SIZES.len()) as u64 * u64::from(count));
    let sizes: Vec<OfSize> = settings
        .iter()
        .flat_map(|&setting| SIZES.map(|size| (setting, size)))
        .map(|(setting, size)| {
            let all = trials(count, progress, |i| trial(size, setting, noise_px, seed, i))?;
            Ok(summarise(setting, size, &all.into_iter().flatten().collect::<Vec<_>>()))
        })
        .collect::<Result<_, LabError>>()?;
    progress.finish();
    Ok(StudyOutput { table: table(&sizes)?, figure: figure(&sizes, count), page: page(&sizes, count) })
}

fn summarise(setting: Setting, size: usize, all: &[Trial]) -> OfSize {
    let mean_square = |v: &[f64]| (v.iter().map(|b| b * b).sum::<f64>() / v.len().max(1) as f64).sqrt();
    OfSize {
        setting,
        size,
        parts: (0..PARTS).map(|index| part_of(index, all)).collect(),
        first_linear: spread(&all.iter().map(|t| t.first.linear).collect::<Vec<_>>()),
        first_weighted: spread(&all.iter().map(|t| t.first.weighted).collect::<Vec<_>>()),
        bound_percent: 100.0 * mean_square(&all.iter().filter_map(|t| t.bound).collect::<Vec<_>>()),
        correlation: all.iter().map(|t| t.correlation).sum::<f64>() / all.len().max(1) as f64,
    }
}

fn part_of(index: usize, all: &[Trial]) -> Part {
    let of_trial = |t: &'_ Trial| -> Vec<Ranked> {
        let ranked = t.ranked.iter().enumerate();
        ranked.filter(|(i, _)| part(*i, t.ranked.len()) == index).map(|(_, r)| *r).collect()
    };
    let here: Vec<Ranked> = all.iter().flat_map(of_trial).collect();
    let mut predicted: Vec<f64> = here.iter().map(|r| 100.0 * HALF_NORMAL_MEDIAN * r.predicted).collect();
    Part {
        place_percent: 100.0 * (index as f64 + 0.5) / PARTS as f64,
        predicted_percent: median(&mut predicted),
        linear: spread(&here.iter().map(|r| r.linear).collect::<Vec<_>>()),
        weighted: spread(&here.iter().map(|r| r.weighted).collect::<Vec<_>>()),
    }
}

fn table(sizes: &[OfSize]) -> Result<Vec<u8>, LabError> {
    let mut records = Vec::new();
    for s in sizes {
        for p in &s.parts {
            for (method, spread) in [("linear", &p.linear), ("weighted", &p.weighted)] {
                let mut record = vec!["subsets".into(), s.size.to_string()];
                record.extend(s.setting.record());
                record.extend([
                    six_digits_trimmed(p.place_percent),
                    six_digits_trimmed(p.predicted_percent),
                    method.into(),
                ]);
                record.extend(spread_record(spread));
                records.push(record);
            }
        }
    }
    let head = [&["study", "size"][..], &SETTING, &["place_percent", "predicted_percent", "method"], &SPREAD];
    csv(&head.concat(), &records)
}

fn page(sizes: &[OfSize], count: u32) -> String {
    let mut page = format!(
        "subsets of {MOTIONS} motions: errors of fx in % over {count} scenes; first the paper's linear method and the weighted one on \
         one subset a scene\n{:>6}{:>6}{:>12}{:>12}{:>10}{:>12}{:>12}{:>10}{:>10}{:>14}\n",
        "rolls", "size", "linear mean", "sd", "failures", "weight. mean", "sd", "failures", "bound", "correlation"
    );
    let mut best = format!(
        "{:>6}{:>6}{:>22}{:>22}{:>22}   median |error| of the weighted method\n",
        "rolls", "size", "surest 5 %", "middle", "least sure 5 %"
    );
    for s in sizes {
        let (linear, weighted) = (&s.first_linear, &s.first_weighted);
        // Writing to a string cannot fail.
        let _ = writeln!(
            page,
            "{:>6}{:>6}{:>12}{:>12}{:>10}{:>12}{:>12}{:>10}{:>10.3}{:>14.2}",
            s.setting.attitudes.short(),
            s.size,
            signed(linear.mean_percent),
            signed(linear.deviation_percent),
            linear.failures,
            signed(weighted.mean_percent),
            signed(weighted.deviation_percent),
            weighted.failures,
            s.bound_percent,
            s.correlation,
        );
        let [first, middle, last] = [0, PARTS / 2, PARTS - 1].map(|i| s.parts[i].weighted.absolute_percent[1]);
        let _ =
            writeln!(best, "{:>6}{:>6}{first:>22.3}{middle:>22.3}{last:>22.3}", s.setting.attitudes.short(), s.size);
    }
    page.push_str(&best);
    page.push('\n');
    page
}

fn panel(of_size: &OfSize, styles: &[Style; 3]) -> Panel {
    let mut curves = empty_curves(styles);
    for p in &of_size.parts {
        let medians = [p.linear.absolute_percent[1], p.weighted.absolute_percent[1], p.predicted_percent];
        for (curve, y) in curves.iter_mut().zip(medians) {
            curve.points.push([p.place_percent, y]);
        }
        let [lower, _, upper] = p.weighted.absolute_percent;
        curves[1].band.push([p.place_percent, lower, upper]);
    }
    Panel { title: format!("{} motions; {}", of_size.size, of_size.setting.words()), curves }
}

fn figure(sizes: &[OfSize], count: u32) -> Figure {
    let styles =
        [style(RED, &[], Some(Marker::Square)), style(BLUE, &[], Some(Marker::Circle)), style(SKY, DASHED, None)];
    Figure {
        title: format!("All subsets of {MOTIONS} motions, ranked by predicted error"),
        x_label: "place in the ranking, % (0: the surest)".into(),
        y_label: "error of fx, %".into(),
        x_log: false,
        rows: two_a_row(sizes.iter().map(|s| panel(s, &styles)).collect()),
        legend: vec![
            (styles[0], "true error, linear".into()),
            (styles[1], "true error, weighted by covariance".into()),
            (styles[2], "predicted without truth".into()),
        ],
        notes: vec![
            format!("Medians over {count} scenes of twelve motions, zero skew; a failure"),
            "counts as infinite; bands: quartiles.".into(),
        ],
    }
}
