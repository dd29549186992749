//! `groundcal plan` from end to end.

use crate::common::*;
use groundcal::synthetic::{MotionSpec, PointScene};
use serde_json::Value;
use tempfile::tempdir;

fn plan(more: &[&str]) -> Outcome {
    groundcal(&[&["plan"], more].concat())
}

fn plan_json(more: &[&str]) -> Value {
    plan(&[more, &["--json"]].concat()).json()
}

fn f_percent(plan: &Value) -> Vec<f64> {
    let motions = plan["motions"].as_array().expect("a list").iter();
    motions.map(|m| m.pointer("/after/f_percent").and_then(Value::as_f64).unwrap_or(f64::INFINITY)).collect()
}

/// A page as one line.
fn flowing(page: &str) -> String {
    page.split_whitespace().collect::<Vec<_>>().join(" ")
}

fn codes(plan: &Value) -> Vec<&str> {
    plan["warnings"].as_array().expect("a list").iter().map(|w| w["code"].as_str().expect("a code")).collect()
}

#[test]
fn a_tripod_gets_a_shot_list() {
    let outcome = plan(&[]);
    assert_eq!((outcome.code, outcome.stderr.as_str()), (0, ""));
    println!("{}", outcome.stdout);
    for words in [
        "1. Tilt ",
        "deg below the horizon, roll ",
        "take a picture, turn ",
        "deg anticlockwise (to the left), take another.",
        "4. Tilt ",
        "it tells the principal point",
        "Then: groundcal calibrate PICTURES/ --out result/",
    ] {
        assert!(flowing(&outcome.stdout).contains(words), "{words:?} is missing");
    }
    assert!(outcome.stdout.lines().all(|l| l.chars().count() <= 102));
    assert_eq!(outcome.stdout, plan(&[]).stdout, "the same each time");
    let json = plan_json(&[]);
    let f = f_percent(&json);
    assert!(f.len() == 4 && f.windows(2).all(|w| w[1] < w[0]), "{f:?}");
    assert_eq!(codes(&json), [""; 0]);
    assert!(json["before"].is_null());
    for (key, value) in [("noise_px", 0.3), ("points", 300.0), ("fx", 1280.0), ("attitude_sigma_deg", 0.1)] {
        assert_eq!(json["assumed"][key], value, "{key}");
    }
}

#[test]
fn each_carrier_has_a_plan_and_says_what_it_cannot_tell() {
    for (rig, warned) in [
        ("pan-head", &["parallel_horizons"][..]),
        ("drone", &["parallel_horizons"]),
        ("robot", &["single_attitude", "prior_decides"]),
    ] {
        let json = plan_json(&["--rig", rig]);
        println!("{rig}: f {:.3?} %", f_percent(&json));
        assert_eq!(codes(&json), warned, "{rig}");
    }
    let text = plan(&["--rig", "robot"]).stdout;
    println!("{text}");
    for words in ["From there drive on", "held by this; the motions do not tell it", "expect warning [single_attitude]"]
    {
        assert!(flowing(&text).contains(words), "{words:?} is missing");
    }
}

#[test]
fn what_is_known_of_camera_and_carrier_changes_the_plan() {
    let wide = plan_json(&["--hfov-deg", "90"]);
    assert!((number(&wide, "/assumed/fx") - 640.0).abs() < 1e-9);
    let f = |more: &[&str]| *f_percent(&plan_json(more)).last().expect("a motion");
    let usual = f(&[]);
    assert!(f(&["--noise-px", "0.05", "--attitude-sigma-deg", "0"]) < 0.5 * usual);
    assert!(f(&["--attitude-sigma-deg", "1"]) > 1.5 * usual);
    assert_eq!(codes(&plan_json(&["--attitude-sigma-deg", "1"])), ["large_attitude_errors"]);
    assert!(f(&["--motions", "8"]) < usual);
    // A principal point that is known makes up for the one attitude.
    let known = ["--rig", "robot", "--prior", "cx=640+-1", "--prior", "cy=480+-1"];
    assert!(f(&known) < 0.3 * f(&["--rig", "robot"]));
    let json = plan_json(&["--tilts-deg", "25:45:20", "--rolls-deg", "-30,30", "--max-turn-deg", "20"]);
    for m in json["motions"].as_array().expect("a list") {
        assert!([25.0, 45.0].contains(&number(m, "/pitch_down_deg").round()), "{m}");
        assert!((number(m, "/roll_deg").abs() - 30.0).abs() < 1e-9 && number(m, "/turn_deg") < 20.1, "{m}");
    }
}

#[test]
fn the_figure_and_the_json_are_written_whole() {
    let folder = tempdir().expect("a folder");
    let out = folder.path().join("plan");
    let outcome = plan(&["--constraint", "zero-skew", "--out", &text(&out)]);
    assert_eq!(outcome.code, 0, "{}", outcome.stderr);
    let names: Vec<String> = results_in(&out).into_iter().collect();
    assert_eq!(names, ["plan.json", "plan.png", "plan.svg"]);
    assert!(outcome.stdout.contains("not determined yet"), "{}", outcome.stdout);
    assert!(read_json(&out.join("plan.json"))["motions"][0]["after"].is_null());
    assert_eq!(image::open(out.join("plan.png")).expect("a picture").width(), 1600);
    let svg = std::fs::read_to_string(out.join("plan.svg")).expect("a text");
    assert!(svg.starts_with("<svg") && svg.contains("standard deviation of f, %"));
}

/// The covariance of a calibration, and what one more motion as planned does to it when it is made: the proposal must come true
/// within what one trial can show.
#[test]
fn after_a_calibration_the_next_motions_are_proposed() {
    let folder = tempdir().expect("a folder");
    let spec = |tilt: f64, roll: f64, turn: f64| {
        MotionSpec::about_axis(tilt.to_radians(), roll.to_radians(), turn.to_radians(), 0.1, 1.5)
    };
    let mut scene = PointScene {
        motions: vec![spec(40.0, 0.0, 20.0), spec(50.0, 20.0, 20.0)],
        sigma_px: 0.3,
        matches: 200,
        reach: 10.0,
        ..PointScene::nominal(3)
    };
    let calibrated = |scene: &PointScene, name: &str| {
        let matches = write(folder.path(), &format!("{name}.csv"), matches_csv(scene));
        let out = folder.path().join(name);
        let options = ["--height-sigma", "0.001", "--attitude-sigma-deg", "0.1"];
        let files = ["calibrate", &matches, "--image-size", "1280x960", "--out", &text(&out)];
        let outcome = groundcal(&[&files[..], &options].concat());
        assert_eq!(outcome.code, 0, "{}", outcome.stderr);
        out
    };
    let two = calibrated(&scene, "two");
    let json = plan_json(&["--after", &text(&two)]);
    let before = number(&json, "/before/f_percent");
    let f = f_percent(&json);
    println!("before {before:.3} %, after {f:.3?} %");
    assert!(f.len() == 2 && f[0] < 0.7 * before && f[1] < f[0], "{before} {f:?}");
    let stated = read_json(&two.join("calibration.json"));
    let fx = |json: &Value| number(json, "/standard_deviation/fx");
    assert!((number(&json, "/before/standard_deviation/fx") / fx(&stated) - 1.0).abs() < 1e-9);
    // Noise and matches are those of the calibration: 200 matches did not fill the picture.
    assert!((number(&json, "/assumed/noise_px") - 0.3).abs() < 0.05, "{}", json["assumed"]);
    assert!(number(&json, "/assumed/points") > 220.0, "{}", json["assumed"]);
    let m = &json["motions"][0];
    scene.motions.push(spec(number(m, "/pitch_down_deg"), number(m, "/roll_deg"), number(m, "/turn_deg")));
    let three = read_json(&calibrated(&scene, "three").join("calibration.json"));
    let ratio = fx(&three) / number(m, "/after/standard_deviation/fx");
    println!("stated after it over planned: {ratio:.3}");
    // The noise of each is estimated from some hundred residuals, and 200 matches are more than the plan counts on.
    assert!((0.8..1.15).contains(&ratio), "{ratio}");
    let page = plan(&["--after", &text(&two.join("calibration.json"))]).stdout;
    println!("{page}");
    for words in ["Now f is known to ", "\nnow ", "\n+1 ", "\n+2 ", "old and new pictures together"] {
        assert!(page.contains(words), "{words:?} is missing");
    }
}

#[test]
fn what_cannot_be_planned_is_refused() {
    let folder = tempdir().expect("a folder");
    let no_covariance = write(
        folder.path(),
        "bare.json",
        r#"{"format_version": 1, "camera": {"image_size": [640, 480], "fx": 500, "fy": 500, "cx": 320, "cy": 240}}"#,
    );
    let zeros = format!(
        r#"{{"format_version": 1, "camera": {{"image_size": [640, 480], "fx": 500, "fy": 500, "cx": 320, "cy": 240}},
           "covariance": {{"parameters": ["fx", "fy", "cx", "cy", "skew", "k1", "k2"], "matrix": [{}]}}}}"#,
        ["[0, 0, 0, 0, 0, 0, 0]"; 7].join(", ")
    );
    let zeros = write(folder.path(), "zeros.json", zeros);
    let out = folder.path().join("out");
    let out = text(&out);
    let known = read_names(folder.path());
    let cases: [(&[&str], i32, &str); 18] = [
        (&["--tilts-deg", "90"], 3, "straight down"),
        (&["--max-turn-deg", "0"], 3, "--max-turn-deg"),
        (&["--tilts-deg", "-40"], 3, "shows enough floor"),
        (&["--rig", "robot", "--constraint", "zero-skew"], 3, "needs 2"),
        (&["--f", "0"], 2, "--f 0"),
        (&["--f", "1"], 2, "focal length 1 px"),
        (&["--hfov-deg", "190"], 2, "--hfov-deg 190"),
        (&["--noise-px", "-1"], 2, "noise -1 px"),
        (&["--points", "3"], 2, "3 points"),
        (&["--height-m", "nan"], 2, "--height-m"),
        (&["--tilts-deg", "10:20"], 2, "FROM:TO:STEP"),
        (&["--distortion", "fisheye"], 2, "fisheye"),
        (&["--tilts-deg", "120"], 2, "tilt 120 degrees must"),
        (&["--attitude-sigma-deg", "50"], 2, "attitude sigma 50"),
        (&["--after", "nothing.json"], 4, "nothing.json"),
        (&["--after", "nothing.json", "--f", "900"], 2, "cannot be used with"),
        (&["--after", &no_covariance], 4, "no covariance"),
        (&["--after", &zeros], 4, "not positive definite"),
    ];
    for (args, code, words) in cases {
        let outcome = plan(&[args, &["--out", &out]].concat());
        println!("{args:?}: {}", outcome.stderr);
        assert_eq!(outcome.code, code, "{args:?}: {}", outcome.stderr);
        assert!(outcome.stderr.contains(words), "{words:?} is missing: {}", outcome.stderr);
        assert_eq!(outcome.stdout, "", "{args:?}");
    }
    assert_eq!(read_names(folder.path()), known, "nothing is written");
}

fn read_names(folder: &std::path::Path) -> Vec<String> {
    files_in(folder).into_iter().collect()
}
