//! `groundcal simulate` from end to end.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod common;

use std::{collections::BTreeMap, path::Path, time::Instant};

use common::*;
use tempfile::tempdir;

const STUDIES: [(&str, usize); 5] = [("noise", 20), ("offset", 24), ("motions", 18), ("angle", 40), ("axis", 20)];

/// The lines of a table as column name -> text.
fn table(path: &Path) -> Vec<BTreeMap<String, String>> {
    csv::Reader::from_path(path).unwrap().deserialize().map(|line| line.unwrap()).collect()
}

fn simulate(study: &str, out: &Path, more: &[&str]) -> Outcome {
    let out = text(out);
    let mut args = vec!["simulate", study, "--out", &out];
    args.extend(more);
    let outcome = groundcal(&args);
    assert_eq!(outcome.code, 0, "{}", outcome.stderr);
    outcome
}

#[test]
fn every_study_gives_a_table_and_two_figures() {
    let folder = tempdir().unwrap();
    let began = Instant::now();
    let outcome = simulate("all", folder.path(), &["--trials", "20"]);
    println!("all studies with 20 trials: {:.1} s", began.elapsed().as_secs_f64());
    let names: Vec<String> =
        STUDIES.iter().flat_map(|s| ["csv", "png", "svg"].map(|e| format!("{}.{e}", s.0))).collect();
    assert_eq!(files_in(folder.path()), names.into_iter().collect());
    for (study, conditions) in STUDIES {
        assert!(outcome.stdout.contains(&format!("{study}: median |error| of fx in % over 20 trials")));
        let lines = table(&folder.path().join(format!("{study}.csv")));
        // Eight methods and the bound.
        assert_eq!(lines.len(), 9 * conditions, "{study}");
        for line in &lines {
            assert_eq!(line["study"], study);
            for column in ["value", "matches", "noise_px", "offset_m", "motions", "turn_deg", "axis_error_deg"] {
                assert!(line[column].parse::<f64>().unwrap() >= 0.0, "{column}: {line:?}");
            }
            let (trials, failures) = (&line["trials"], line["failures"].parse::<usize>().unwrap());
            assert!(trials == "20" && failures <= 20);
            let quartiles = ["lower_quartile_percent", "median_percent", "upper_quartile_percent"];
            let quartiles = quartiles.map(|c| line[c].parse::<f64>().unwrap());
            assert!(quartiles[0] <= quartiles[1] && quartiles[1] <= quartiles[2], "{line:?}");
            assert_eq!(quartiles[1].is_infinite(), failures >= 10, "{line:?}");
            assert_eq!(line["rmse_percent"].is_empty(), failures == 20, "{line:?}");
            let stated = ["groundcal", "rotating"].contains(&line["method"].as_str()) && failures < 20;
            for column in ["coverage_fx", "coverage_fy", "coverage_cx", "coverage_cy"] {
                let coverage = line[column].parse::<f64>();
                assert!(if stated { (0.0..=1.0).contains(&coverage.unwrap()) } else { line[column].is_empty() });
            }
        }
        let picture = image::open(folder.path().join(format!("{study}.png"))).unwrap();
        assert_eq!(picture.width(), 1600);
        let svg = std::fs::read_to_string(folder.path().join(format!("{study}.svg"))).unwrap();
        assert!(svg.starts_with("<svg") && svg.ends_with("</svg>\n") && svg.contains("error of fx, %"));
    }
}

#[test]
fn without_noise_planar_methods_are_exact() {
    let folder = tempdir().unwrap();
    simulate("noise", folder.path(), &["--trials", "3"]);
    let lines = table(&folder.path().join("noise.csv"));
    for line in lines.iter().filter(|l| l["noise_px"] == "0") {
        let rmse: f64 = line["rmse_percent"].parse().unwrap();
        assert!(if line["method"] == "rotating" { rmse > 1.0 } else { rmse < 1e-8 }, "{line:?}");
    }
}

#[test]
fn the_seed_decides_and_the_threads_do_not() {
    let folder = tempdir().unwrap();
    let files = |name: &str, more: &[&str]| {
        let out = folder.path().join(name);
        simulate("motions", &out, &[&["--trials", "4"], more].concat());
        ["csv", "svg", "png"].map(|e| std::fs::read(out.join(format!("motions.{e}"))).unwrap())
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
        &["simulate", "nonsense", "--out", &out][..],
        &["simulate", "noise"],
        &["simulate", "noise", "--trials", "0", "--out", &out],
        &["simulate", "noise", "--out", &at("README.md")],
    ] {
        let outcome = groundcal(args);
        assert_eq!(outcome.code, 2, "{args:?}: {}", outcome.stderr);
        assert_eq!(outcome.stdout, "");
    }
    assert!(files_in(folder.path()).is_empty());
}
