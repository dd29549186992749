//! `groundcal simulate` from end to end.

use std::{collections::BTreeMap, path::Path};

use crate::common::*;
use tempfile::tempdir;

const STUDIES: [(&str, usize); 5] = [("noise", 40), ("offset", 60), ("motions", 36), ("angle", 80), ("axis", 80)];
const FURTHER: [&str; 4] = ["radial", "transfer", "subsets", "general"];

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
    // Another seed than that of the reference: independent of it.
    let outcome = simulate("all", folder.path(), &["--trials", "20", "--seed", "1"]);
    let all = STUDIES.iter().map(|s| s.0).chain(FURTHER);
    let names: Vec<String> = all.flat_map(|s| ["csv", "png", "svg"].map(|e| format!("{s}.{e}"))).collect();
    assert_eq!(results_in(folder.path()), names.into_iter().collect());
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
    for study in STUDIES.iter().map(|s| s.0).chain(FURTHER) {
        agrees_with_reference(study, &folder.path().join(format!("{study}.csv")));
    }
}

/// Standard deviation of a sample median over that of the mean, for normal values; interquartile range of a unit normal.
const MEDIAN_OVER_MEAN: f64 = 1.2533;
const NORMAL_QUARTILES_APART: f64 = 1.3490;
/// Deviations that none of some 3500 comparisons should reach.
const NEVER: f64 = 5.0;

/// Scenes of the study of subsets, of each of which there are many subsets: in its reference, and in a run here.
const REFERENCE_SCENES: f64 = 200.0;
const SCENES: f64 = 20.0;

/// The probability of five deviations, on both sides.
const NEVER_P: f64 = 5.7e-7;

/// Fisher's exact test, two-sided: (failures, trials) of two runs with one probability.
fn probability([old, of_old]: [f64; 2], [new, of_new]: [f64; 2]) -> f64 {
    let ln_factorial = |n: f64| (1..=n as u64).map(|i| (i as f64).ln()).sum::<f64>();
    let ln_choose = |n: f64, k: f64| ln_factorial(n) - ln_factorial(k) - ln_factorial(n - k);
    let failures = old + new;
    let of = |k: f64| {
        let possible = k <= of_new && failures - k <= of_old && k <= failures && k >= 0.0;
        let ln = || ln_choose(of_new, k) + ln_choose(of_old, failures - k) - ln_choose(of_old + of_new, failures);
        if possible { ln().exp() } else { 0.0 }
    };
    let seen = of(new);
    (0..=of_new as u64).map(|k| of(k as f64)).filter(|p| *p <= seen * (1.0 + 1e-9)).sum()
}

#[test]
fn counts_are_compared_by_their_exact_probability() {
    // One failure among 4 and 3 of 4: 2 (4 · 4) / 70 + 2 / 70.
    assert!((probability([1.0, 4.0], [3.0, 4.0]) - 34.0 / 70.0).abs() < 1e-12);
    assert!((probability([10.0, 1000.0], [0.0, 20.0]) - 1.0).abs() < 1e-9);
    assert!(probability([0.0, 1000.0], [5.0, 20.0]) < NEVER_P);
    assert!(probability([999.0, 1000.0], [18.0, 20.0]) > 1e-4);
}

/// Compares medians and failures with those of another seed, stored in `tests/reference` (1000 trials for noise and offset, 200 for the others;
/// made by `groundcal simulate STUDY --trials N --out crates/groundcal-cli/tests/reference`, figures deleted). Tolerances follow from the number of trials: a median's from its
/// quartiles, a count's from Fisher's exact test (a normal distribution is none of a failure in a thousand).
fn agrees_with_reference(study: &str, path: &Path) {
    const RESULTS: [&str; 18] = [
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
        "median_signed_percent",
        "mean_signed_percent",
        "deviation_percent",
        "predicted_percent",
    ];
    let key = |line: &BTreeMap<String, String>| -> BTreeMap<String, String> {
        line.clone().into_iter().filter(|(name, _)| !RESULTS.contains(&name.as_str())).collect()
    };
    let stored = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("tests/reference/{study}.csv"));
    let (reference, found) = (table(&stored), table(path));
    assert_eq!(reference.len(), found.len(), "{study}: conditions differ from the reference");
    let (mut squares, mut compared) = (0.0, 0.0);
    for (old, new) in reference.iter().zip(&found) {
        assert_eq!(key(old), key(new), "{study}");
        let value = |line: &BTreeMap<String, String>, column: &str| -> f64 {
            line[column].parse().unwrap_or_else(|_| panic!("{study} {column}: {line:?}"))
        };
        // Subsets of one scene share its motions: only scenes are independent, and a part of the subsets fails that is as good as a part of them.
        let scenes = |line, of_subsets: f64| if study == "subsets" { of_subsets } else { value(line, "trials") };
        let (scenes_old, scenes_new) = (scenes(old, REFERENCE_SCENES), scenes(new, SCENES));
        let counts = |line, scenes: f64| [(value(line, "failures") / value(line, "trials") * scenes).round(), scenes];
        assert!(
            probability(counts(old, scenes_old), counts(new, scenes_new)) > NEVER_P,
            "{study}: failures {old:?} {new:?}"
        );
        let [m_old, m_new] = [old, new].map(|l| value(l, "median_percent"));
        if m_old < 1e-7 || !m_old.is_finite() || !m_new.is_finite() {
            // Exact, or no median: the failures have been compared.
            assert!(m_old > 1e-7 || m_new < 1e-7, "{study}: {old:?} {new:?}");
            continue;
        }
        let deviation = |line| {
            let apart = value(line, "upper_quartile_percent") - value(line, "lower_quartile_percent");
            MEDIAN_OVER_MEAN * apart / NORMAL_QUARTILES_APART / scenes_old.sqrt()
        };
        // Both from the reference, whose quartiles are better known.
        let ratio = (scenes_old / scenes_new).sqrt();
        let sigma = deviation(old).hypot(deviation(old) * ratio);
        let z = (m_new - m_old) / sigma;
        assert!(z.abs() < NEVER || !sigma.is_finite(), "{study}: {z:.1} deviations: {old:?} {new:?}");
        if sigma.is_finite() {
            squares += z * z;
            compared += 1.0;
        }
    }
    // Conditions share draws, so this is no sum of independent squares: it need only be of their order.
    let rms = (squares / f64::max(compared, 1.0)).sqrt();
    println!("{study}: {compared} medians within {rms:.2} deviations (root mean square) of the reference");
    assert!(rms < 2.5, "{study}: {rms:.2}");
}

#[test]
fn one_setting_may_be_asked_for() {
    let folder = tempdir().unwrap();
    let asked = ["--matches", "30", "--roll-deg", "12.5", "--image-size", "640x480", "--trials", "3"];
    for study in ["noise", "radial", "transfer", "subsets"] {
        simulate(study, folder.path(), &asked);
        for line in table(&folder.path().join(format!("{study}.csv"))) {
            let setting = ["matches", "roll_deg", "image_width", "image_height"].map(|c| line[c].as_str());
            assert_eq!(setting, ["30", "12.5", "640", "480"], "{study}");
        }
    }
    simulate("motions", folder.path(), &[&asked[..], &["--noise-px", "0.3"]].concat());
    let lines = table(&folder.path().join("motions.csv"));
    assert!(lines.len() == 9 * 9 && lines.iter().all(|line| line["noise_px"] == "0.3"));
}

#[test]
fn views_from_anywhere_are_rolled_by_any_angle() {
    let folder = tempdir().unwrap();
    simulate("general", folder.path(), &["--matches", "40", "--image-size", "640x480", "--trials", "3"]);
    let lines = table(&folder.path().join("general.csv"));
    // Three methods, seven numbers of views and seven tilts.
    assert_eq!(lines.len(), 3 * 14);
    assert!(lines.iter().all(|line| line["matches"] == "40" && line["image_width"] == "640"));
    let refused = groundcal(&["simulate", "general", "--roll-deg", "10", "--out", &text(folder.path())]);
    assert!(refused.code == 2 && refused.stderr.contains("any angle"), "{}", refused.stderr);
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
        &["simulate", "noise", "--noise-px", "2", "--out", &out],
        &["simulate", "offset", "--noise-px", "-1", "--out", &out],
        &["simulate", "offset", "--roll-deg", "91", "--out", &out],
        &["simulate", "offset", "--matches", "5", "--out", &out],
        &["simulate", "offset", "--image-size", "640", "--out", &out],
    ] {
        let outcome = groundcal(args);
        assert_eq!(outcome.code, 2, "{args:?}: {}", outcome.stderr);
        assert_eq!(outcome.stdout, "");
    }
    assert!(files_in(folder.path()).is_empty());
}
