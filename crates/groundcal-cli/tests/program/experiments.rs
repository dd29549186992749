//! `groundcal experiment` from end to end, at half size: the numbers against the scenes' truth.

use std::{collections::BTreeMap, path::Path};

use crate::common::*;
use groundcal::numerics::median;
use tempfile::tempdir;

type Line = BTreeMap<String, String>;

fn table(path: &Path) -> Vec<Line> {
    csv::Reader::from_path(path).unwrap().deserialize().map(|line| line.unwrap()).collect()
}

fn value(line: &Line, column: &str) -> f64 {
    line[column].parse().unwrap_or_else(|_| panic!("{column} of {line:?}"))
}

/// What decides the focal length, the aspect ratio and the principal point: (error, deviation) of those the constraint leaves free.
fn free_numbers(line: &Line) -> Vec<(f64, f64)> {
    ["focal", "aspect", "principal_point"]
        .into_iter()
        .filter_map(|name| {
            let unit = if name == "principal_point" { "percent_of_f" } else { "percent" };
            let sd = line[&format!("{name}_sd_{unit}")].parse().ok()?;
            Some((value(line, &format!("{name}_error_{unit}")), sd))
        })
        .collect()
}

fn lines<'a>(table: &'a [Line], method: &str, constraint: &str, told: bool) -> Vec<&'a Line> {
    let is = |l: &&Line| {
        l["method"] == method && l["constraint"] == constraint && l["told_principal_point"] == told.to_string()
    };
    table.iter().filter(is).collect()
}

/// Constraints that hold nothing false: the principal points of the scenes are not in the centre.
const TRUE_CONSTRAINTS: [(&str, bool); 5] =
    [("full", false), ("zero-skew", false), ("square", false), ("auto", false), ("focal", true)];

fn errors_are_those_stated(table: &[Line], name: &str) {
    for (constraint, told) in TRUE_CONSTRAINTS {
        for (method, deviations) in [("groundcal", 3.0), ("linear", 4.0)] {
            for line in lines(table, method, constraint, told) {
                for (error, sd) in free_numbers(line) {
                    assert!(error.abs() < deviations * sd, "{name}: {line:?}");
                }
            }
        }
    }
}

fn middle(values: impl Iterator<Item = f64>) -> f64 {
    median(&mut values.collect::<Vec<_>>())
}

#[test]
fn the_experiments() {
    let folder = tempdir().unwrap();
    let out = folder.path();
    let outcome = groundcal(&["experiment", "all", "--quick", "--out", &text(out)]);
    assert_eq!(outcome.code, 0, "{}", outcome.stderr);
    println!("{}", outcome.stdout);
    tripod(out);
    pan_head(out);
    mobile_head(out);
    film(out);
    lens(out);
    for name in ["tripod", "pan-head", "mobile-head", "film", "lens"] {
        let page = std::fs::read_to_string(out.join(format!("{name}.txt"))).unwrap();
        assert!(outcome.stdout.contains(&page));
        assert!(out.join(name).join("truth.json").exists());
        assert!(image::open(out.join(format!("{name}_views.jpg"))).unwrap().width() > 500);
    }
}

fn tripod(out: &Path) {
    let table = table(&out.join("tripod.csv"));
    errors_are_those_stated(&table, "tripod");
    // Holding the principal point at the centre, 1.6 % of f off, costs more than ours has of other errors.
    let [held, told] = [false, true].map(|t| free_numbers(lines(&table, "linear", "focal", t)[0])[0].0.abs());
    assert!(held > told, "{held} {told}");
    for constraint in ["full", "zero-skew", "square"] {
        let sd = |method| free_numbers(lines(&table, method, constraint, false)[0])[0].1;
        assert!(sd("groundcal") < 0.7 * sd("linear"), "{constraint}");
    }
    subsets(out, "tripod", &[("focal", 7), ("square", 21), ("zero-skew", 21), ("full", 35)]);
}

fn pan_head(out: &Path) {
    let table = table(&out.join("pan-head.csv"));
    errors_are_those_stated(&table, "pan-head");
    for constraint in ["full", "zero-skew", "square", "fixed-pp", "focal"] {
        let worst = |method| {
            let numbers = free_numbers(lines(&table, method, constraint, false)[0]);
            numbers.iter().map(|n| n.0.abs()).fold(0.0, f64::max)
        };
        // The axis is 0.2 m from the optical centre, at a height of 0.8 m.
        assert!(worst("rotating camera") > 10.0, "{constraint}");
        assert!(worst("groundcal") < 1.5, "{constraint}");
    }
    subsets(out, "pan-head", &[("focal", 7), ("fixed-pp", 21), ("square", 21), ("zero-skew", 35)]);
}

/// The principal point is not where the correction of each pair has its centre, but for `focal` that is told it.
fn lens(out: &Path) {
    let table = table(&out.join("lens.csv"));
    for (constraint, told) in [("zero-skew", false), ("square", false), ("focal", true)] {
        let of = |method| free_numbers(lines(&table, method, constraint, told)[0]);
        for (method, deviations) in [("groundcal", 3.0), ("undistorted", 4.0)] {
            for (error, sd) in of(method) {
                assert!(error.abs() < deviations * sd, "{method} {constraint}: {error} +- {sd}");
            }
        }
        let [(per_pair, sd), (closed_form, _)] = ["per pair", "closed form"].map(|method| of(method)[0]);
        // As far as the motions' matches go, and not much further off: one parameter, a centre that may be wrong by 1.6 % of f.
        assert!(
            per_pair.abs() < 4.0 * sd && closed_form.abs() > 3.0 * per_pair.abs(),
            "{per_pair} +- {sd}, {closed_form}"
        );
        let [ours, corrected] = ["groundcal", "undistorted"].map(|method| of(method)[0].1);
        assert!(ours < 0.5 * corrected, "{ours} {corrected}");
    }
    let ignored = free_numbers(lines(&table, "linear", "focal", true)[0])[0].0;
    assert!(ignored.abs() > 3.0, "{ignored}");
}

fn subsets(out: &Path, name: &str, expected: &[(&str, usize)]) {
    let table = table(&out.join(format!("{name}_subsets.csv")));
    assert_eq!(table.len(), expected.iter().map(|e| e.1).sum::<usize>());
    for &(constraint, count) in expected {
        let own: Vec<&Line> = table.iter().filter(|l| l["constraint"] == constraint).collect();
        assert_eq!(own.len(), count);
        let found = own.iter().filter(|l| !l["focal_error_percent"].is_empty());
        let numbers: Vec<(f64, f64)> =
            found.map(|l| (value(l, "predicted_sd_percent"), value(l, "focal_error_percent").abs())).collect();
        assert!(numbers.windows(2).all(|w| w[0].0 <= w[1].0), "{constraint}: the surest come first");
        // Half of the subsets or more give a camera, whose errors are of the size predicted: subsets share motions, so that a
        // common deviation moves them all.
        assert!(2 * numbers.len() > count, "{constraint}");
        let ratio = middle(numbers.iter().map(|n| n.1)) / middle(numbers.iter().map(|n| n.0));
        assert!((0.2..3.0).contains(&ratio), "{name} {constraint}: {ratio}");
    }
    let svg = std::fs::read_to_string(out.join(format!("{name}_subsets.svg"))).unwrap();
    assert!(svg.starts_with("<svg") && svg.contains("subsets with less, % of all"));
    assert_eq!(image::open(out.join(format!("{name}_subsets.png"))).unwrap().width(), 1600);
}

fn mobile_head(out: &Path) {
    let table_of = table(&out.join("mobile-head.csv"));
    errors_are_those_stated(&table_of, "mobile-head");
    let dense = lines(&table_of, "groundcal", "focal", true);
    let dense = free_numbers(dense.iter().find(|l| l["input"] == "pictures").unwrap())[0];
    assert!(dense.1 < 0.2, "{dense:?}");
    let draws = table(&out.join("mobile-head_draws.csv"));
    assert_eq!(draws.len(), 4 * 40);
    let told = |method: &str| -> Vec<(f64, f64)> {
        let own = draws.iter().filter(|l| l["method"] == method && l["told_principal_point"] == "true");
        let number = |l: &Line, c: &str| l[c].parse().unwrap_or(f64::INFINITY);
        own.map(|l| (number(l, "focal_error_percent").abs(), number(l, "focal_sd_percent"))).collect()
    };
    let (ours, linear) = (told("groundcal"), told("linear"));
    let errors = |numbers: &[(f64, f64)]| middle(numbers.iter().map(|n| n.0));
    assert!(errors(&ours) < errors(&linear), "{} {}", errors(&ours), errors(&linear));
    // 95 % expected, of 40 draws: sampling error 3.4 %.
    let held = ours.iter().filter(|n| n.0 < 2.0 * n.1).count();
    assert!(held >= 34, "{held} of 40");
    small_range_of_elevations(&table(&out.join("mobile-head_elevations.csv")));
}

/// The paper's table 1: the more is asked of a small range of orientations, the worse, zero skew worst.
fn small_range_of_elevations(draws: &[Line]) {
    assert_eq!(draws.len(), 9 * 40);
    let errors = |constraint: &str, method: &str| -> Vec<f64> {
        let own = draws.iter().filter(|l| l["constraint"] == constraint && l["method"] == method);
        // Without a camera the error counts as infinite.
        own.map(|l| l["focal_error_percent"].parse().map_or(f64::INFINITY, f64::abs)).collect()
    };
    let refused = |constraint, method| errors(constraint, method).iter().filter(|e| e.is_infinite()).count();
    let medians = ["focal", "fixed-pp", "square", "zero-skew"].map(|c| middle(errors(c, "linear").into_iter()));
    assert!(medians[0] < 4.0 && 2.0 * medians[0] < medians[1] && medians[1] < medians[2], "{medians:?}");
    assert!(medians[2] < medians[3], "{medians:?}");
    // Ours does not answer with what it does not know, and has the focal length all the same.
    assert_eq!(refused("zero-skew", "groundcal"), 40);
    assert_eq!((refused("focal", "groundcal"), refused("auto", "groundcal")), (0, 0));
    assert!(middle(errors("auto", "groundcal").into_iter()) < 4.0);
}

#[test]
fn real_pictures_are_calibrated_or_said_to_be_missing() {
    let folder = tempdir().unwrap();
    let (out, nowhere) = (text(&folder.path().join("out")), text(folder.path()));
    let outcome = groundcal(&["experiment", "real", "--data", &nowhere, "--out", &out]);
    assert_eq!(outcome.code, 0, "{}", outcome.stderr);
    for set in ["real_turntable_bare", "real_turn_grail", "real_turn_denny"] {
        assert!(outcome.stdout.contains(&format!("skipped: {set}: not in ")), "{}", outcome.stdout);
    }
    assert_eq!(results_in(&folder.path().join("out")), ["real.txt".to_string()].into());
    let data = root().join("../shared/data");
    if !data.join("real_turntable_bare/truth.json").is_file() {
        println!("skipped: the set real_turntable_bare is not beside the repository (../shared/data)");
        return;
    }
    let outcome = groundcal(&["experiment", "real", "--quick", "--data", &text(&data), "--out", &out]);
    assert_eq!(outcome.code, 0, "{}", outcome.stderr);
    let table = table(&folder.path().join("out/real_turntable_bare.csv"));
    // The truth is known to 0.9 %.
    for (method, deviations) in [("linear", 3.0), ("undistorted", 3.0), ("groundcal", 3.0)] {
        let line = lines(&table, method, "focal", false)[0];
        let (error, sd) = free_numbers(line)[0];
        assert!(error.abs() < deviations * sd.hypot(0.9), "{line:?}");
    }
}

fn film(out: &Path) {
    let table = table(&out.join("film.csv"));
    errors_are_those_stated(&table, "film");
    let held = free_numbers(lines(&table, "groundcal", "focal", false)[0])[0];
    assert!(held.0.abs() < 3.0 * held.1 && held.0.abs() < 4.5, "{held:?}");
    let page = std::fs::read_to_string(out.join("film.txt")).unwrap();
    let angle = |what: &str| -> f64 {
        let line = page.lines().find(|l| l.contains(what)).unwrap();
        assert!(line.ends_with("(4 edges)"), "{line}");
        line.split_whitespace().next().unwrap().parse().unwrap()
    };
    assert!(angle("in the frame") > 20.0);
    assert!(angle("rectified (") < 1.0, "{page}");
    // What is left with the true camera is the measurement's.
    assert!(angle("with the true camera") < 0.2, "{page}");
    // The shape itself: a right angle and a semicircle, in the frame, on the floor rectified, and there with the true camera.
    let section = |head: &str| -> Vec<f64> {
        let lines = page.lines().skip_while(|l| !l.starts_with(head)).skip(1).take(3);
        lines.map(|l| l.split_whitespace().next().unwrap().parse().unwrap()).collect()
    };
    let square = section("The path across them");
    // At half size the path across is 50 pixels long: half a pixel of an edge's end is 0.6 degrees.
    assert!(square[0] > 10.0 && square[1] < 2.0 && square[2] < 0.6, "{page}");
    let arch = section("The semicircular arch");
    assert!(arch[0] > 2.0 && arch[1] < 1.06 && arch[2] < 1.03, "{page}");
    let floor = image::open(out.join("film_floor.png")).unwrap();
    assert!(floor.width() > 200 && floor.height() > 200);
}

#[test]
fn the_seed_decides_and_the_threads_do_not() {
    let folder = tempdir().unwrap();
    let files = |name: &str, more: &[&str]| {
        let out = folder.path().join(name);
        let place = text(&out);
        let outcome = groundcal(&[&["experiment", "film", "--quick", "--out", &place], more].concat());
        assert_eq!(outcome.code, 0, "{}", outcome.stderr);
        (
            outcome.stdout,
            ["film.csv", "film_floor.png", "film/frame_001.jpg"].map(|f| std::fs::read(out.join(f)).unwrap()),
        )
    };
    let first = files("first", &["--threads", "1"]);
    assert!(first == files("second", &["--threads", "3"]));
    assert!(first != files("third", &["--seed", "1"]));
}

#[test]
fn wrong_usage_is_refused() {
    let folder = tempdir().unwrap();
    let out = text(folder.path());
    for args in [
        &["experiment", "crane", "--out", &out][..],
        &["experiment", "film"],
        &["experiment", "film", "--out", &at("README.md")],
        &["experiment", "real", "--out", &out],
    ] {
        let outcome = groundcal(args);
        assert_eq!(outcome.code, 2, "{args:?}: {}", outcome.stderr);
        assert_eq!(outcome.stdout, "");
    }
    assert!(files_in(folder.path()).is_empty());
}
