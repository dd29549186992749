//! What the terminal gets: width, colours, silence; folders in place of a command; pictures that do not belong; points of the floor.

use std::process::Command;

use crate::common::*;
use groundcal::{
    floor::FloorView,
    geometry::{Intrinsics, Lens, View},
    synthetic::PointScene,
};
use nalgebra::{Rotation2, Vector2};
use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64Mcg;
use serde_json::Value;
use tempfile::tempdir;

/// A run with variables of its environment; standard output, standard error, exit code.
fn with_variables(args: &[&str], variables: &[(&str, &str)]) -> (String, String, i32) {
    let mut command = Command::new(env!("CARGO_BIN_EXE_groundcal"));
    command.args(args).env_remove("NO_COLOR").env_remove("COLUMNS").envs(variables.iter().copied());
    let output = command.output().unwrap();
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
    (text(output.stdout), text(output.stderr), output.status.code().unwrap())
}

/// Matches of three motions, as arguments.
fn matches(folder: &std::path::Path) -> [String; 3] {
    let csv = write(folder, "matches.csv", matches_csv(&PointScene { sigma_px: 0.3, ..PointScene::nominal(2) }));
    [csv, "--image-size".into(), "1280x960".into()]
}

#[test]
fn the_summary_has_the_width_of_the_terminal() {
    let folder = tempdir().unwrap();
    let [csv, a, b] = matches(folder.path());
    let of = |columns: &str| with_variables(&["calibrate", &csv, &a, &b, "--verbose"], &[("COLUMNS", columns)]).0;
    let longest = |text: &str| text.lines().map(|l| l.chars().count()).max().unwrap();
    for (columns, most) in [("60", 60), ("80", 80), ("100", 100), ("120", 120), ("10", 60), ("999", 120)] {
        let text = of(columns);
        assert!(longest(&text) <= most && longest(&text) > most - 12, "{columns}: {}\n{text}", longest(&text));
    }
    assert_eq!(of("no number"), of("80"), "where nobody says");
}

#[test]
fn colours_are_for_terminals_or_on_request() {
    let folder = tempdir().unwrap();
    let [csv, a, b] = matches(folder.path());
    let coloured = |more: &[&str], variables: &[(&str, &str)]| {
        let args: Vec<&str> = ["calibrate", &csv, &a, &b].into_iter().chain(more.iter().copied()).collect();
        with_variables(&args, variables).0.contains('\u{1b}')
    };
    assert!(!coloured(&[], &[]), "a pipe");
    assert!(coloured(&["--color", "always"], &[]));
    assert!(coloured(&["--color", "always"], &[("NO_COLOR", "1")]), "what is said counts");
    assert!(!coloured(&["--color", "never"], &[]));
    let error = |color: &str| with_variables(&["calibrate", "nowhere", "--color", color], &[]).1;
    assert!(error("always").contains("\u{1b}[1;31merror\u{1b}[0m: ") && error("never").starts_with("error: "));
    // The parser's own words too.
    assert!(with_variables(&["calibrat", "--color=always"], &[]).1.contains('\u{1b}'));
    assert!(!with_variables(&["calibrat", "--color=never"], &[]).1.contains('\u{1b}'));
}

#[test]
fn quiet_says_nothing_but_errors_and_json() {
    let folder = tempdir().unwrap();
    let [csv, a, b] = matches(folder.path());
    let out = text(&folder.path().join("out"));
    let run = groundcal(&["calibrate", &csv, &a, &b, "--quiet", "--out", &out]);
    assert_eq!((run.code, run.stdout.as_str(), run.stderr.as_str()), (0, "", ""));
    assert!(folder.path().join("out/report.html").is_file());
    assert!(calibrate(&[&csv, &a, &b, "-q"]).json()["camera"]["fx"].is_number());
    let run = groundcal(&["calibrate", "nowhere", "--quiet"]);
    assert!(run.code == 4 && run.stderr.starts_with("error: "), "{}", run.stderr);
}

/// Who is refused asks of a certain pair, too.
#[test]
fn refusals_say_of_each_pair_why_it_is_no_motion() {
    // Views of three attitudes, between which the camera tilted.
    let images = ["00a.jpg", "01a.jpg", "02a.jpg"].map(|name| at(&format!("examples/tripod/{name}")));
    let run = groundcal(&["calibrate", &images[0], &images[1], &images[2], "--json"]);
    assert_eq!(run.code, 3, "{}", run.stderr);
    let json: Value = serde_json::from_str(&run.stdout).unwrap();
    let pairs = json["error"]["pairs"].as_array().expect("pairs");
    assert_eq!(pairs.len(), 3, "each once: {pairs:?}");
    assert!(run.stderr.contains("note: --verbose says of each of 3 pairs"), "{}", run.stderr);
    let run = groundcal(&["calibrate", &images[0], &images[1], &images[2], "--verbose"]);
    for pair in pairs {
        let [from, to, reason] = ["from", "to", "reason"].map(|field| pair[field].as_str().expect("text"));
        assert!(run.stderr.contains(&format!("not used: {from} - {to}: {reason}")), "{}", run.stderr);
    }
}

#[test]
fn a_folder_stands_for_its_calibration() {
    let folder = tempdir().unwrap();
    for name in ["00a.jpg", "00b.jpg"] {
        std::fs::copy(root().join("examples/tripod").join(name), folder.path().join(name)).unwrap();
    }
    let path = text(folder.path());
    let short = groundcal(&[&path, "--motion", "plane-normal"]);
    let long = groundcal(&["calibrate", &path, "--motion", "plane-normal"]);
    assert_eq!((short.code, &short.stdout), (0, &long.stdout), "{}", short.stderr);
    // No command, and nothing that is there.
    let run = groundcal(&["calibrat", &path]);
    assert!(run.code == 2 && run.stderr.contains("calibrate"), "{}", run.stderr);
}

#[test]
fn folders_in_folders_and_pictures_that_do_not_belong() {
    let folder = tempdir().unwrap();
    std::fs::create_dir(folder.path().join("first")).unwrap();
    for (name, to) in [("00a.jpg", "first/00a.jpg"), ("00b.jpg", "00b.jpg"), ("01a.jpg", "01a.jpg")] {
        std::fs::copy(root().join("examples/tripod").join(name), folder.path().join(to)).unwrap();
    }
    image::GrayImage::from_pixel(64, 48, image::Luma([9])).save(folder.path().join("logo.png")).unwrap();
    let path = text(folder.path());
    let run = groundcal(&["calibrate", &path, "--recursive"]);
    assert_eq!(run.code, 4);
    for words in ["logo.png is 64x48 pixels", "and 2 more are 800x600", "--exclude 'logo.png'"] {
        assert!(run.stderr.contains(words), "{words}: {}", run.stderr);
    }
    let images = |more: &[&str]| {
        let args: Vec<&str> =
            [path.as_str(), "--motion", "plane-normal"].into_iter().chain(more.iter().copied()).collect();
        let json = calibrate(&args).json();
        let mut names: Vec<String> =
            json["views"].as_array().unwrap().iter().map(|v| v["image"].as_str().unwrap().to_string()).collect();
        names.sort_by_key(|n| n.rsplit('/').next().map(str::to_string));
        names
    };
    let found = images(&["--recursive", "--exclude", "logo.png", "--exclude", "01*"]);
    assert!(found.len() == 2 && found[0].ends_with("00a.jpg") && found[1].ends_with("00b.jpg"), "{found:?}");
    // A file that is no image.
    std::fs::write(folder.path().join("notes.jpg"), "no image").unwrap();
    let run = groundcal(&["calibrate", &path, "--exclude", "logo.png"]);
    assert!(
        run.code == 4 && run.stderr.contains("notes.jpg") && run.stderr.contains("--exclude 'notes.jpg'"),
        "{}",
        run.stderr
    );
    // One that was named is meant.
    let run = groundcal(&["calibrate", &text(&folder.path().join("notes.jpg")), &text(&folder.path().join("00b.jpg"))]);
    assert!(run.code == 4 && !run.stderr.contains("--exclude"), "{}", run.stderr);
}

#[test]
fn points_of_the_floor_and_back() {
    let folder = tempdir().unwrap();
    let [csv, a, b] = matches(folder.path());
    let out = text(&folder.path().join("out"));
    let run = groundcal(&["calibrate", &csv, &a, &b, "--out", &out, "--no-report", "-q", "--camera-height", "3"]);
    assert_eq!(run.code, 0, "{}", run.stderr);
    let json = groundcal(&["floor", &out, "m0a", "400,500", "900,700", "640,-4000", "--json"]).json();
    assert_eq!((json["unit"].as_str(), json["points"][2]["floor"].is_null()), (Some("m"), true));
    assert_eq!(json["distances"].as_array().unwrap().len(), 1);
    let [x, y] = [0, 1].map(|i| number(&json, &format!("/points/0/floor/{i}")));
    let distance = number(&json, "/distances/0/distance");
    let [x2, y2] = [0, 1].map(|i| number(&json, &format!("/points/1/floor/{i}")));
    assert!(((x2 - x).hypot(y2 - y) - distance).abs() < 1e-9 && number(&json, "/distances/0/sigma") > 0.0);
    let back = groundcal(&["floor", &out, "m0a", &format!("{x},{y}"), "--to-pixels", "--json"]).json();
    let pixel = [0, 1].map(|i| number(&back, &format!("/points/0/pixel/{i}")));
    assert!((pixel[0] - 400.0).abs() < 1e-6 && (pixel[1] - 500.0).abs() < 1e-6, "{pixel:?}");
    let page = groundcal(&["floor", &out, "m0a", "400,500", "900,700", "640,-4000"]);
    assert!(page.code == 0 && page.stdout.contains("1 to 2: ") && page.stdout.contains("no floor"), "{}", page.stdout);
    assert!(page.stdout.lines().all(|l| l.chars().count() <= 80), "{}", page.stdout);
    let run = groundcal(&["floor", &out, "nowhere", "400,500"]);
    assert!(run.code == 4 && run.stderr.contains("no view nowhere"), "{}", run.stderr);
    // A distance of the floor gives back the metres that it is measured in.
    let scaled = groundcal(&[
        "calibrate",
        &csv,
        &a,
        &b,
        "--json",
        "--floor-distance",
        "m0a",
        "400,500",
        "900,700",
        &format!("{distance}+-0.001"),
    ])
    .json();
    assert!(
        (number(&scaled, "/camera_height_m") - 3.0).abs() < 1e-9 && number(&scaled, "/camera_height_sigma_m") > 0.0
    );
    let run = groundcal(&["calibrate", &csv, &a, &b, "--floor-distance", "m0a", "400,500", "900,700", "much"]);
    assert!(run.code == 2 && run.stderr.contains("--floor-distance"), "{}", run.stderr);
}

#[test]
fn the_expected_error_over_the_image() {
    let folder = tempdir().unwrap();
    let [csv, a, b] = matches(folder.path());
    let out = text(&folder.path().join("out"));
    assert_eq!(groundcal(&["calibrate", &csv, &a, &b, "--out", &out, "--no-report", "-q"]).code, 0);
    let pictures = text(&folder.path().join("pictures"));
    let grid = groundcal(&["uncertainty", &out, "--json", "--out", &pictures]).json();
    assert_eq!(
        results_in(&folder.path().join("pictures")).into_iter().collect::<Vec<_>>(),
        ["distant.png", "distant.svg", "floor.png", "floor.svg", "uncertainty.json"]
    );
    // That of the file is the same.
    let file = read_json(&folder.path().join("out/calibration.json"));
    let same = |a: &Value, b: &Value| match (a.as_f64(), b.as_f64()) {
        (Some(a), Some(b)) => (a / b - 1.0).abs() < 1e-6,
        (a, b) => a == b,
    };
    let [here, there] = [&grid, &file["projection_uncertainty"]].map(|g| g["distant_px"].as_array().unwrap());
    assert_eq!(here.len(), 16 * 12);
    assert!(here.iter().zip(there).all(|(a, b)| same(a, b)));
    let page = groundcal(&["uncertainty", &out, "--cells", "4"]);
    assert!(page.stdout.contains("Points of the floor") && page.stdout.lines().count() < 30, "{}", page.stdout);
    let run = groundcal(&["uncertainty", &at("examples/tripod/truth.json")]);
    assert_eq!(run.code, 4, "{}", run.stderr);
}

#[test]
fn an_earlier_calibration_narrows_the_next() {
    let folder = tempdir().unwrap();
    let [csv, a, b] = matches(folder.path());
    let out = text(&folder.path().join("out"));
    assert_eq!(groundcal(&["calibrate", &csv, &a, &b, "--out", &out, "--no-report", "-q"]).code, 0);
    let other = write(folder.path(), "other.csv", matches_csv(&PointScene { sigma_px: 0.3, ..PointScene::nominal(9) }));
    let alone = calibrate(&[other.as_str(), &a, &b]).json();
    let both = calibrate(&[other.as_str(), &a, &b, "--prior-from", &out]).json();
    let sigma = |json: &Value| number(json, "/standard_deviation/fx");
    assert!(sigma(&both) < sigma(&alone), "{} after {}", sigma(&both), sigma(&alone));
    assert!(both["priors"].as_array().unwrap().iter().any(|p| p["parameter"] == "fx"), "{}", both["priors"]);
    let run = groundcal(&["calibrate", &other, &a, "640x640", "--prior-from", &out]);
    assert!(run.code != 0 && run.stderr.starts_with("error: "), "{}", run.stderr);
}

/// A robot with a camera 1.2 m up, 0.3 m ahead and 0.1 m to the right of the odometry's origin, looking 20 degrees to the left: tracks of a floor from
/// nine places, and the robot's odometry with 1 % of noise.
fn robot(folder: &std::path::Path, names: &dyn Fn(usize) -> String, stamps: &dyn Fn(usize) -> String) -> [String; 2] {
    let mut rng = Pcg64Mcg::seed_from_u64(11);
    let mut normal = move || -> f64 { rng.sample(StandardNormal) };
    let k = Intrinsics::square(1000.0, 644.0, 476.0);
    let mut at = Vector2::new(0.0, 0.0);
    let mut yaw = 0.1f64;
    let (mut measured_at, mut measured_yaw) = (Vector2::new(5.0, 2.0), -1.0f64);
    let mut tracks = "image,track,x,y\n".to_string();
    let mut odometry = format!("{},x,y,yaw_deg\n", stamps(usize::MAX));
    let points: Vec<Vector2<f64>> = (0..2500).map(|_| Vector2::new(1.6 * normal() + 1.0, 1.6 * normal())).collect();
    for i in 0..9 {
        if i > 0 {
            let (way, turn) = (0.12, if i % 2 == 0 { 0.35 } else { -0.5 });
            let step = Rotation2::new(0.5 * turn) * Vector2::new(way, 0.0);
            at += Rotation2::new(yaw) * step;
            yaw += turn;
            let noise = Vector2::new(normal(), normal()) * 0.01 * way;
            measured_at += Rotation2::new(measured_yaw) * (step + noise);
            measured_yaw += turn;
        }
        let eye = at + Rotation2::new(yaw) * Vector2::new(0.3, -0.1);
        let pose = View {
            pitch_down_rad: 45f64.to_radians(),
            roll_rad: 0.03,
            yaw_rad: yaw + 20f64.to_radians(),
            centre: eye.push(1.2),
        };
        let view = FloorView::new(&k, Lens::None, &pose).unwrap();
        for (t, p) in points.iter().enumerate() {
            let Some(q) = view.pixel_from_floor(p) else { continue };
            let q = q + Vector2::new(normal(), normal()) * 0.2;
            if (0.0..1279.0).contains(&q.x) && (0.0..959.0).contains(&q.y) {
                tracks += &format!("{},{t},{},{}\n", names(i), q.x, q.y);
            }
        }
        odometry += &format!("{},{},{},{}\n", stamps(i), measured_at.x, measured_at.y, measured_yaw.to_degrees());
    }
    [write(folder, "tracks.csv", tracks), write(folder, "odometry.csv", odometry)]
}

#[test]
fn odometry_gives_metres_and_the_place_of_the_camera() {
    let folder = tempdir().unwrap();
    let by_name = |i: usize| if i == usize::MAX { "image".into() } else { format!("{i}.png") };
    let [tracks, odometry] = robot(folder.path(), &by_name, &by_name);
    // One attitude leaves fx to a few per cent, and the scale with it; a robot's camera was calibrated before.
    let known = ["--prior", "fx=1000+-2", "--prior", "cx=644+-2", "--prior", "cy=476+-2"];
    let args = |tracks: &str, odometry: &str| -> Vec<String> {
        let of_robot = [tracks, "--image-size", "1280x960", "--motion", "plane-normal", "--odometry", odometry];
        of_robot.iter().chain(&known).map(|s| s.to_string()).collect()
    };
    let json = calibrate(&args(&tracks, &odometry)).json();
    let base = &json["on_base"][0];
    println!("{base:#}");
    let pull = |value: &str, sigma: &str, truth: f64| (number(base, value) - truth) / number(base, sigma);
    for (value, sigma, truth) in [
        ("/metres_per_unit", "/metres_per_unit_sigma", 1.2),
        ("/height_m", "/height_sigma_m", 1.2),
        ("/position_m/0", "/position_sigma_m/0", 0.3),
        ("/position_m/1", "/position_sigma_m/1", -0.1),
        ("/yaw_deg", "/yaw_sigma_deg", 20.0),
    ] {
        let pull = pull(value, sigma, truth);
        assert!(pull.abs() < 3.5, "{value}: {pull} deviations");
    }
    assert!((number(&json, "/camera_height_m") - number(base, "/metres_per_unit")).abs() < 1e-9);
    // The same by times, in nanoseconds and in seconds.
    let other = tempdir().unwrap();
    let by_time = |i: usize| if i == usize::MAX { "time".into() } else { format!("{}.5", 100 + i) };
    let [tracks, odometry] = robot(other.path(), &|i| format!("{}500000000.png", 100 + i), &by_time);
    let by_time = calibrate(&args(&tracks, &odometry)).json();
    assert!((number(&by_time["on_base"][0], "/yaw_deg") - number(base, "/yaw_deg")).abs() < 1e-6);
    let page = groundcal(&[&["calibrate".to_string()], &args(&tracks, &odometry)[..]].concat());
    assert!(page.stdout.contains("On the base:") && page.stdout.contains("m ahead"), "{}", page.stdout);
}
