//! Views from anywhere before a plane, by their number and by the spread of their tilts.

use std::fmt::Write;

use groundcal_report::plot::{Figure, Marker, Panel, Style};

use crate::{
    error::LabError,
    progress::Progress,
    studies::{
        general::{Method, NOISE_PX, POINTS, SOME_VIEWS, Setup, TILT_DEG, TILTS_DEG, VIEWS, trial},
        radial::{Spread, spread},
        reports::output::{
            BLACK, BLUE, DOTTED, GREEN, HALF_NORMAL_MEDIAN, SPREAD, StudyOutput, empty_curves, spread_record, style,
            trials, two_a_row, with_failures,
        },
        setting::{Asked, Setting},
    },
    tables::{csv, six_digits_trimmed},
};

/// What is varied in a panel.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Varied {
    Views,
    Tilt,
}

impl Varied {
    fn name(self) -> &'static str {
        match self {
            Varied::Views => "views",
            Varied::Tilt => "tilt_deg",
        }
    }
}

/// A condition: its abscissa, and what each of [`Method::ALL`] made of it.
struct Condition {
    x: f64,
    setup: Setup,
    spreads: Vec<Spread>,
}

/// Runs the trials of all conditions.
///
/// # Errors
/// [`LabError::Other`] when the table cannot be written.
pub fn run(asked: &Asked, count: u32, seed: u64, progress: &dyn Progress) -> Result<StudyOutput, LabError> {
    let base = Setup {
        views: SOME_VIEWS,
        tilt_deg: TILT_DEG,
        points: asked.matches.unwrap_or(POINTS),
        size: asked.size.unwrap_or(Setting::default().size),
        noise_px: asked.noise_px.unwrap_or(NOISE_PX),
    };
    let by_views = VIEWS.map(|views| (views as f64, Setup { views, ..base })).to_vec();
    let by_tilt = TILTS_DEG.map(|tilt_deg| (tilt_deg, Setup { tilt_deg, ..base })).to_vec();
    progress.begin("general", (VIEWS.len() + TILTS_DEG.len()) as u64 * u64::from(count));
    let run = |(x, setup): (f64, Setup)| -> Result<Condition, LabError> {
        Ok(Condition { x, setup, spreads: spreads(&setup, count, seed, progress)? })
    };
    let series: Vec<(Varied, Vec<Condition>)> = [(Varied::Views, by_views), (Varied::Tilt, by_tilt)]
        .into_iter()
        .map(|(varied, setups)| Ok((varied, setups.into_iter().map(run).collect::<Result<_, _>>()?)))
        .collect::<Result<_, LabError>>()?;
    progress.finish();
    Ok(StudyOutput { table: table(&series)?, figure: figure(&series, count), page: page(&series, count) })
}

/// The errors of each of [`Method::ALL`] under one condition.
fn spreads(setup: &Setup, count: u32, seed: u64, progress: &dyn Progress) -> Result<Vec<Spread>, LabError> {
    let outcomes = trials(count, progress, |i| trial(setup, seed, i))?;
    let of = |(m, method): (usize, &Method)| {
        // A bound is a deviation: the median error of an estimator at it.
        let unit = if *method == Method::Bound { HALF_NORMAL_MEDIAN } else { 1.0 };
        spread(&outcomes.iter().map(|o| o[m].map(|e| unit * e)).collect::<Vec<_>>())
    };
    Ok(Method::ALL.iter().enumerate().map(of).collect())
}

fn table(series: &[(Varied, Vec<Condition>)]) -> Result<Vec<u8>, LabError> {
    let mut records = Vec::new();
    for (varied, points) in series {
        for Condition { setup, spreads, .. } in points {
            for (method, spread) in Method::ALL.iter().zip(spreads) {
                let mut record = vec!["general".into(), varied.name().into(), setup.views.to_string()];
                record.extend([six_digits_trimmed(setup.tilt_deg), setup.points.to_string()]);
                record.extend([setup.size.width.to_string(), setup.size.height.to_string()]);
                record.push(method.name().into());
                record.extend(spread_record(spread));
                records.push(record);
            }
        }
    }
    let head = ["study", "varied", "views", "tilt_deg", "matches", "image_width", "image_height", "method"];
    csv(&[&head[..], &SPREAD].concat(), &records)
}

fn page(series: &[(Varied, Vec<Condition>)], count: u32) -> String {
    let mut page = format!(
        "general: median |error| of fx in % over {count} trials (failures in brackets)\n{:>8}{:>10}{:>8}",
        "views", "tilt to", "points"
    );
    // Writing to a string cannot fail.
    for method in Method::ALL {
        let _ = write!(page, "{:>18}", method.name());
    }
    page.push('\n');
    for Condition { setup, spreads, .. } in series.iter().flat_map(|(_, points)| points) {
        let _ = write!(page, "{:>8}{:>10}{:>8}", setup.views, setup.tilt_deg, setup.points);
        for s in spreads {
            let _ = write!(page, "{:>18}", with_failures(s.absolute_percent[1], s.failures));
        }
        page.push('\n');
    }
    page.push('\n');
    page
}

fn panel((varied, points): &(Varied, Vec<Condition>), styles: &[Style; 3]) -> Panel {
    let mut curves = empty_curves(styles);
    for Condition { x, spreads, .. } in points {
        for ((curve, s), method) in curves.iter_mut().zip(spreads).zip(Method::ALL) {
            // Motions know nothing of how the views are tilted.
            if method == Method::PlaneNormal && *varied == Varied::Tilt {
                continue;
            }
            let [lower, middle, upper] = s.absolute_percent;
            curve.points.push([*x, middle]);
            if method != Method::Bound {
                curve.band.push([*x, lower, upper]);
            }
        }
    }
    let title = match varied {
        Varied::Views => format!("x pictures, tilted by up to {TILT_DEG} degrees"),
        Varied::Tilt => format!("{SOME_VIEWS} pictures, tilted by up to x degrees"),
    };
    Panel { title, curves }
}

fn figure(series: &[(Varied, Vec<Condition>)], count: u32) -> Figure {
    let styles =
        [style(GREEN, &[], Some(Marker::Triangle)), style(BLUE, &[], Some(Marker::Square)), style(BLACK, DOTTED, None)];
    let labels = [
        "from anywhere, groundcal",
        "plane-normal motions of as many pictures, groundcal",
        "Cramér-Rao bound, from anywhere",
    ];
    Figure {
        title: "Any motion before a plane".into(),
        x_label: "x".into(),
        y_label: "error of fx, %".into(),
        x_log: true,
        rows: two_a_row(series.iter().map(|s| panel(s, &styles)).collect()),
        legend: styles.into_iter().zip(labels).map(|(s, label)| (s, label.to_string())).collect(),
        notes: vec![
            "The motions turn by 15 degrees about an axis 0.2 m away, at attitudes of their own. Zero skew, no lens."
                .into(),
            format!("Median of |error| over {count} trials, a failure counting as infinite; bands: quartiles."),
        ],
    }
}
