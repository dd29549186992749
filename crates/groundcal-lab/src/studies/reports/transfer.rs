//! One motion transferred into other views against motions of their own, by their turns and by errors of their axes.

use std::fmt::Write;

use groundcal_report::plot::{Figure, Marker, Panel, Style};

use crate::{
    error::LabError,
    progress::Progress,
    studies::{
        radial::{Spread, spread},
        reports::output::{
            BLACK, BLUE, DOTTED, GREEN, HALF_NORMAL_MEDIAN, ORANGE, SPREAD, StudyOutput, empty_curves, spread_record,
            style, trials, two_a_row, with_failures,
        },
        setting::{Asked, NOISE_PX, SETTING, Setting},
        transfer::{AXIS_ERRORS_DEG, EQUAL_TURN_DEG, FIRST_TURN_DEG, Method, Setup, TURNS_DEG, trial},
    },
    tables::{csv, six_digits_trimmed},
};

/// What is varied in a panel.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Varied {
    Turn,
    AxisError,
}

/// A condition: its abscissa, and what each of [`Method::ALL`] made of it.
struct Condition {
    x: f64,
    setup: Setup,
    spreads: Vec<Spread>,
}

/// Conditions drawn as one curve a method.
struct Series {
    varied: Varied,
    setting: Setting,
    points: Vec<Condition>,
}

/// Runs the trials of all conditions.
///
/// # Errors
/// [`LabError::Other`] when the table cannot be written.
pub fn run(asked: &Asked, count: u32, seed: u64, progress: &dyn Progress) -> Result<StudyOutput, LabError> {
    let (settings, noise_px) = (asked.settings(), asked.noise_px.unwrap_or(NOISE_PX));
    let turning =
        |&s: &Setting| (Varied::Turn, s, TURNS_DEG.map(|turn| (turn, Setup::turning(turn, s, noise_px))).to_vec());
    let stray =
        |&s: &Setting| (Varied::AxisError, s, AXIS_ERRORS_DEG.map(|e| (e, Setup::off_axis(e, s, noise_px))).to_vec());
    let conditions = settings.len() * (TURNS_DEG.len() + AXIS_ERRORS_DEG.len());
    progress.begin("transfer", conditions as u64 * u64::from(count));
    let run = |(x, setup): (f64, Setup)| -> Result<Condition, LabError> {
        Ok(Condition { x, setup, spreads: spreads(&setup, count, seed, progress)? })
    };
    let series: Vec<Series> = settings
        .iter()
        .map(turning)
        .chain(settings.iter().map(stray))
        .map(|(varied, setting, setups)| {
            let points = setups.into_iter().map(run).collect::<Result<_, _>>()?;
            Ok(Series { varied, setting, points })
        })
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

fn table(series: &[Series]) -> Result<Vec<u8>, LabError> {
    let number = six_digits_trimmed;
    let mut records = Vec::new();
    for s in series {
        let varied = match s.varied {
            Varied::Turn => "turn_deg",
            Varied::AxisError => "axis_error_deg",
        };
        for Condition { setup, spreads, .. } in &s.points {
            for (method, spread) in Method::ALL.iter().zip(spreads) {
                let Setup { first_turn_deg, turn_deg, axis_error_deg, setting, .. } = *setup;
                let mut record = vec!["transfer".into(), varied.into(), number(first_turn_deg), number(turn_deg)];
                record.push(number(axis_error_deg));
                record.extend(setting.record());
                record.push(method.name().into());
                record.extend(spread_record(spread));
                records.push(record);
            }
        }
    }
    let head = ["study", "varied", "first_turn_deg", "turn_deg", "axis_error_deg"];
    csv(&[&head[..], &SETTING, &["method"], &SPREAD].concat(), &records)
}

fn page(series: &[Series], count: u32) -> String {
    let mut page = format!(
        "transfer: median |error| of fx in % over {count} trials (failures in brackets)\n{:>8}{:>6}{:>11}{:>10}{:>10}",
        "matches", "rolls", "axis error", "1st turn", "others"
    );
    // Writing to a string cannot fail.
    for method in Method::ALL {
        let _ = write!(page, "{:>18}", method.name());
    }
    page.push('\n');
    for Condition { setup, spreads, .. } in series.iter().flat_map(|s| &s.points) {
        let Setup { first_turn_deg, turn_deg, axis_error_deg, setting, .. } = *setup;
        let _ = write!(page, "{:>8}{:>6}", setting.matches, setting.attitudes.short());
        let _ = write!(page, "{axis_error_deg:>11}{first_turn_deg:>10}{turn_deg:>10}");
        for s in spreads {
            let _ = write!(page, "{:>18}", with_failures(s.absolute_percent[1], s.failures));
        }
        page.push('\n');
    }
    page.push('\n');
    page
}

fn panel(series: &Series, styles: &[Style; 4]) -> Panel {
    let mut curves = empty_curves(styles);
    for Condition { x, spreads, .. } in &series.points {
        for ((curve, s), method) in curves.iter_mut().zip(spreads).zip(Method::ALL) {
            let [lower, middle, upper] = s.absolute_percent;
            curve.points.push([*x, middle]);
            if method != Method::Bound {
                curve.band.push([*x, lower, upper]);
            }
        }
    }
    let words = series.setting.words();
    let title = match series.varied {
        Varied::Turn => format!("others turn by x; {words}"),
        Varied::AxisError => format!("axes x off; {words}"),
    };
    Panel { title, curves }
}

fn figure(series: &[Series], count: u32) -> Figure {
    let styles = [
        style(BLUE, &[], Some(Marker::Square)),
        style(ORANGE, &[], Some(Marker::Diamond)),
        style(GREEN, &[], Some(Marker::Triangle)),
        style(BLACK, DOTTED, None),
    ];
    let labels = [
        "a motion at each attitude, linear",
        "the first motion transferred, linear",
        "a motion at each attitude, groundcal",
        "Cramér-Rao bound of those motions",
    ];
    Figure {
        title: "One motion transferred, or motions of their own".into(),
        x_label: "x, degrees".into(),
        y_label: "error of fx, %".into(),
        x_log: true,
        rows: two_a_row(series.iter().map(|s| panel(s, &styles)).collect()),
        legend: styles.into_iter().zip(labels).map(|(s, label)| (s, label.to_string())).collect(),
        notes: vec![
            format!(
                "Others turn by x: the first motion turns by {FIRST_TURN_DEG} degrees. Axes x off: all turn by {EQUAL_TURN_DEG}. Zero skew, three attitudes."
            ),
            format!(
                "Median of |error| over {count} trials, a failure counting as infinite; bands: quartiles. The bound knows the axes."
            ),
        ],
    }
}
