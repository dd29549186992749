//! The formats of `calibrate --out`, read back by other programs' readers, and `compare` on what was written.

use std::{process::Command, sync::OnceLock};

use crate::{common::*, readers::python};
use groundcal::{
    geometry::{Intrinsics, Lens, Radtan, rotation_cam_from_world},
    synthetic::{MotionSpec, PointScene},
};
use nalgebra::{Vector2, Vector3};
use serde_json::{Value, json};
use tempfile::{TempDir, tempdir};

/// A run on the pictures of the tripod, whose twelve views share one world.
fn tripod() -> &'static TempDir {
    static RUN: OnceLock<TempDir> = OnceLock::new();
    RUN.get_or_init(|| {
        let folder = tempdir().unwrap();
        let run = groundcal(&["calibrate", &at("examples/tripod"), "--out", &text(folder.path())]);
        assert_eq!(run.code, 0, "{}", run.stderr);
        assert!(!run.stderr.contains("note:"), "{}", run.stderr);
        folder
    })
}

/// A run on matches through a lens that is far from ideal: three motions, three worlds; the first has three views.
fn lens() -> &'static (TempDir, String) {
    static RUN: OnceLock<(TempDir, String)> = OnceLock::new();
    RUN.get_or_init(|| {
        let mut scene = PointScene::nominal(5);
        scene.lens = Lens::radial(-0.12, 0.03);
        let second = scene.motions[0];
        scene.motions.push(MotionSpec { turn_rad: -second.turn_rad, ..second });
        let mut csv = String::from("image_a,image_b,xa,ya,xb,yb\n");
        for (i, motion) in scene.pairs().iter().enumerate() {
            for m in &motion.matches {
                // The fourth motion starts from the same image as the first.
                let from = if i == 3 { "m0a".to_string() } else { format!("m{i}a") };
                csv += &format!("{from},m{i}b,{},{},{},{}\n", m.a.x, m.a.y, m.b.x, m.b.y);
            }
        }
        let folder = tempdir().unwrap();
        let csv = write(folder.path(), "matches.csv", csv);
        let out = text(&folder.path().join("out"));
        let run =
            groundcal(&["calibrate", &csv, "--image-size", "1280x960", "--k1", "-0.12", "--k2", "0.03", "--out", &out]);
        assert_eq!(run.code, 0, "{}", run.stderr);
        (folder, run.stderr)
    })
}

/// Floor points of the views of the largest world, with the pixels our own model gives them.
fn expected(calibration: &Value) -> Vec<Value> {
    let c = |name: &str| number(calibration, &format!("/camera/{name}"));
    let k = Intrinsics { fx: c("fx"), fy: c("fy"), cx: c("cx"), cy: c("cy"), skew: c("skew") };
    let [k1, k2, p1, p2] = ["k1", "k2", "p1", "p2"].map(|n| c(&format!("distortion/{n}")));
    let lens = Lens::Radtan(Radtan::new([k1, k2, p1, p2, 0.0]));
    let views = calibration["views"].as_array().unwrap();
    let origin = &views[0]["origin"];
    let mut points = Vec::new();
    for view in views.iter().filter(|v| v["origin"] == *origin) {
        let [pitch, roll, yaw] =
            ["pitch_down_deg", "roll_deg", "yaw_deg"].map(|n| view[n].as_f64().unwrap().to_radians());
        let r = rotation_cam_from_world(pitch, roll, yaw);
        let centre = Vector3::from_fn(|i, _| view["position"][i].as_f64().unwrap());
        for pixel in [[20.0, 500.0], [400.0, 320.0], [700.0, 560.0], [250.0, 410.0]] {
            let ideal = lens.undistort(&k.normalised_from_pixel(&Vector2::from(pixel))).unwrap();
            let ray = r.transpose() * Vector3::new(ideal.x, ideal.y, 1.0);
            let mut point = centre - ray * (centre.z / ray.z);
            // Off the floor a little: the height must come through too.
            point.z = 0.05;
            let seen = r * (point - centre);
            let seen = (k.matrix() * lens.project(&seen).unwrap().push(1.0)).xy();
            points.push(json!({"image": view["image"], "point": point.as_slice(), "pixel": seen.as_slice()}));
        }
    }
    points
}

#[test]
fn other_readers_see_floor_points_where_we_do() {
    let Some(python) = python(&["cv2", "numpy", "pycolmap", "yaml"]) else { return };
    let script = root().join("crates/groundcal-cli/tests/formats/read_back.py");
    for (name, folder) in [("tripod", tripod().path().to_path_buf()), ("lens", lens().0.path().join("out"))] {
        let scratch = tempdir().unwrap();
        let points = expected(&read_json(&folder.join("calibration.json")));
        let list = write(scratch.path(), "expected.json", Value::from(points).to_string());
        let output = Command::new(python).arg(&script).arg(&folder).arg(&list).output().unwrap();
        let printed = String::from_utf8_lossy(&output.stdout);
        assert!(output.status.success(), "{name}: {printed}{}", String::from_utf8_lossy(&output.stderr));
        println!("{name}:\n{printed}");
        let mut formats = Vec::new();
        for line in printed.lines() {
            let (format, distance) = line.split_once(' ').unwrap();
            let distance: f64 = distance.parse().unwrap();
            assert!(distance < 1e-6, "{name}: {format} is {distance} px off");
            formats.push(format.to_string());
        }
        assert_eq!(formats, ["colmap", "opencv", "ros", "kalibr", "nerfstudio", "matlab"], "{name}");
    }
}

#[test]
fn worlds_are_not_mixed() {
    let (folder, stderr) = lens();
    let out = folder.path().join("out");
    for words in
        ["note: poses are those of the 3 views connected to m0a", "4 views are in other worlds", "m1a, m1b, m2a, m2b"]
    {
        assert!(stderr.contains(words), "{stderr}");
    }
    let images = std::fs::read_to_string(out.join("images.txt")).unwrap();
    let names: Vec<&str> = images
        .lines()
        .filter(|l| !l.is_empty() && !l.starts_with('#'))
        .map(|l| l.rsplit(' ').next().unwrap())
        .collect();
    assert_eq!(names, ["m0a", "m0b", "m3b"]);
    assert!(images.contains("other worlds"), "{images}");
    let spaced = std::fs::read_to_string(folder.path().join("matches.csv")).unwrap().replace("m0b,", "m0 b,");
    let spaced = write(folder.path(), "spaced.csv", spaced);
    let other = text(&folder.path().join("spaced"));
    let height = ["--camera-height", "3.0"];
    let base = ["calibrate", &spaced, "--image-size", "1280x960", "--out", &other, "--format", "colmap"];
    let run = groundcal(&[&base[..], &height].concat());
    let metric = std::fs::read_to_string(folder.path().join("spaced/images.txt")).unwrap();
    assert!(metric.contains("lengths in metres") && images.contains("lengths in heights"), "{metric}");
    assert!(run.stderr.contains("first blank: \"m0 b\""), "{}", run.stderr);
    assert_eq!(read_json(&out.join("transforms.json"))["frames"].as_array().unwrap().len(), 3);
}

#[test]
fn formats_are_chosen_by_name() {
    let (folder, _) = lens();
    let csv = text(&folder.path().join("matches.csv"));
    let base = ["calibrate", &csv, "--image-size", "1280x960", "--method", "linear"];
    let out = tempdir().unwrap();
    let run = groundcal(&[&base[..], &["--out", &text(out.path()), "--format", "ros,colmap"]].concat());
    assert_eq!(run.code, 0, "{}", run.stderr);
    let names: Vec<String> = results_in(out.path()).into_iter().collect();
    let expected = ["calibration.json", "camera_info.yaml", "cameras.txt", "images.txt", "points3D.txt", "report.html"];
    assert_eq!(names, expected);
    // The linear method has no positions: the model loads, without images.
    let images = std::fs::read_to_string(out.path().join("images.txt")).unwrap();
    assert!(images.lines().all(|l| l.starts_with('#')) && images.contains("No poses"), "{images}");
    let without_out = groundcal(&[&base[..], &["--format", "ros"]].concat());
    assert_eq!(without_out.code, 2);
    assert!(without_out.stderr.contains("--out"), "{}", without_out.stderr);
    let unknown = groundcal(&[&base[..], &["--out", &text(out.path()), "--format", "metashape"]].concat());
    assert!(
        unknown.code == 2 && unknown.stderr.contains("opencv, ros, kalibr, colmap, nerfstudio, matlab"),
        "{}",
        unknown.stderr
    );
}

#[test]
fn every_format_written_is_read_and_does_not_differ() {
    for folder in [tripod().path().to_path_buf(), lens().0.path().join("out")] {
        let file = |name: &str| text(&folder.join(name));
        let others =
            ["camera_opencv.yaml", "camera_info.yaml", "camchain.yaml", "cameras.txt", "transforms.json"].map(file);
        let mut args = vec!["compare".to_string(), text(&folder)];
        args.extend(others);
        args.push("--json".into());
        let compared = groundcal(&args).json();
        let all = compared["comparisons"].as_array().unwrap();
        assert_eq!(all.len(), 5);
        for c in all {
            assert!(number(c, "/reprojection/max_without_rotation_px") < 1e-9, "{c:#}");
            assert!(number(c, "/joint/chi_squared") < 1e-12, "{c:#}");
        }
    }
}

#[test]
fn the_tripod_differs_from_its_truth_within_its_errors() {
    let out = tempdir().unwrap();
    let out = out.path().join("new");
    let args = ["compare", &text(tripod().path()), &at("examples/tripod/truth.json"), "--out", &text(&out)];
    let run = groundcal(&args);
    assert_eq!(run.code, 0, "{}", run.stderr);
    println!("{}", run.stdout);
    for words in ["std. errors", "within their errors", "after the best rotation"] {
        assert!(run.stdout.contains(words), "{}", run.stdout);
    }
    let names: Vec<String> = results_in(&out).into_iter().collect();
    assert_eq!(names, ["comparison.json", "difference_1.png", "difference_1.svg"]);
    let json = read_json(&out.join("comparison.json"));
    let c = &json["comparisons"][0];
    // A few hundredths of a pixel of f and of the principal point: so much, and no more, is left of them in the corner.
    assert!(number(c, "/reprojection/max_px") < 0.1 && number(c, "/reprojection/rms_px") > 1e-4, "{c:#}");
    // fx, fy, cx, cy, k1, k2, p1, p2.
    assert_eq!(number(c, "/joint/degrees_of_freedom"), 8.0);
    assert!(number(c, "/joint/p_value") > 0.001, "{c:#}");
    for p in c["parameters"].as_array().unwrap().iter().filter(|p| p["standard_deviation"].is_f64()) {
        assert!(number(p, "/difference_in_standard_deviations").abs() < 4.0, "{p}");
    }
    let picture = image::open(out.join("difference_1.png")).unwrap();
    assert!(picture.width() > 1000 && picture.height() > 800);
}

#[test]
fn a_wrong_camera_is_significant_and_scaled_cameras_agree() {
    let folder = tempdir().unwrap();
    let wrong = write(folder.path(), "cameras.txt", "1 SIMPLE_PINHOLE 800 600 712 410 291.5\n");
    let run = groundcal(&["compare", &text(tripod().path()), &wrong]);
    assert!(run.code == 0 && run.stdout.contains("more than their errors explain"), "{}{}", run.stdout, run.stderr);
    let half = write(folder.path(), "half.txt", "1 SIMPLE_PINHOLE 400 300 352.5 205 145.75\n");
    let json = groundcal(&["compare", &at("examples/tripod/truth.json"), &half, "--json"]).json();
    assert_eq!(json["comparisons"][0]["scaled_from"], json!([400, 300]));
    assert!(number(&json, "/comparisons/0/reprojection/max_without_rotation_px") < 1e-9, "{json:#}");
    assert!(json["comparisons"][0]["joint"].is_null());
    let other = write(folder.path(), "other.txt", "1 SIMPLE_PINHOLE 800 450 700 400 225\n");
    let run = groundcal(&["compare", &at("examples/tripod/truth.json"), &other]);
    assert!(run.code == 4 && run.stderr.contains("other.txt") && run.stderr.contains("450"), "{}", run.stderr);
    let missing = groundcal(&["compare", &other, &text(&folder.path().join("none.yaml"))]);
    assert!(missing.code == 4 && missing.stderr.contains("none.yaml"), "{}", missing.stderr);
    assert_eq!(groundcal(&["compare", &other]).code, 2);
}

#[test]
fn manual_pages_and_completions_come_out() {
    let folder = tempdir().unwrap();
    let run = groundcal(&["man", "--out", &text(&folder.path().join("man1"))]);
    assert_eq!(run.code, 0, "{}", run.stderr);
    let pages = files_in(folder.path());
    for page in ["man1/groundcal.1", "man1/groundcal-calibrate.1", "man1/groundcal-compare.1"] {
        assert!(pages.contains(page), "{pages:?}");
    }
    let bash = groundcal(&["completions", "bash"]);
    assert!(bash.code == 0 && bash.stdout.contains("complete -F _groundcal"), "{}", bash.stderr);
}
