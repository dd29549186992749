//! Fisheye cameras: converted, undistorted and compared, against `cv2.fisheye`.

use std::{collections::HashMap, path::Path, process::Command};

use groundcal::{
    geometry::{Fisheye, ImageSize, Intrinsics, Lens},
    synthetic::PointScene,
};
use serde_json::json;
use tempfile::tempdir;

use crate::{common::*, readers::python};

/// 180 degrees over the width, more in the corners.
const KALIBR: &str = "cam0:\n  camera_model: pinhole\n  distortion_coeffs: [0.01, -0.003, 0.0005, -0.0001]\n  distortion_model: equidistant\n  \
                      intrinsics: [318.31, 318.52, 499.7, 499.2]\n  resolution: [1000, 1000]\n  rostopic: /cam0\n";

fn done(args: &[&str]) -> Outcome {
    let run = groundcal(args);
    assert_eq!(run.code, 0, "{args:?}: {}", run.stderr);
    run
}

/// `NAME NUMBER` of each line that a script prints.
fn measured(python: &Path, folder: &Path) -> HashMap<String, f64> {
    let script = root().join("crates/groundcal-cli/tests/formats/fisheye.py");
    let output = Command::new(python).arg(&script).arg(folder).output().unwrap();
    let printed = String::from_utf8_lossy(&output.stdout);
    assert!(output.status.success(), "{printed}{}", String::from_utf8_lossy(&output.stderr));
    println!("{printed}");
    let of_line = |line: &str| line.split_once(' ').map(|(name, number)| (name.to_string(), number.parse().unwrap()));
    printed.lines().filter_map(of_line).collect()
}

#[test]
fn a_half_sphere_agrees_with_cv2_fisheye() {
    let Some(python) = python(&["cv2", "numpy"]) else { return };
    let folder = tempdir().unwrap();
    let at = |name: &str| text(&folder.path().join(name));
    let camera = write(folder.path(), "camchain.yaml", KALIBR);
    done(&["convert", &camera, "--out", &at("converted"), "--format", "opencv"]);
    done(&["undistort", &camera, "--maps", "--fov", "120", "--out", &at("undistorted")]);
    // Camera B, written by OpenCV.
    assert!(measured(python, folder.path()).is_empty());
    let compared = done(&["compare", &camera, &at("other.yaml"), "--json"]).json();
    assert_eq!(compared["reference"]["lens"], "fisheye");
    let names: Vec<&str> = compared["comparisons"][0]["parameters"]
        .as_array()
        .unwrap()
        .iter()
        .map(|p| p["parameter"].as_str().unwrap())
        .collect();
    assert_eq!(names, ["fx", "fy", "cx", "cy", "skew", "k1", "k2", "k3", "k4"]);
    write(folder.path(), "comparison.json", compared.to_string());
    let found = measured(python, folder.path());
    let of = |name: &str| found[name];
    // Maps are of single precision: a step is 6e-5 px beyond pixel 512. What is exact is rounded alike.
    assert!(of("maps_px") < 7e-5 && of("maps_from_exact_px") < 3.1e-5, "{found:?}");
    assert!(of("rounded_otherwise") < 1e-4, "a rounding of 1e-4 of the pixels is an error of 1e-8 px: {found:?}");
    assert!(of("behind") > 0.1 && number(&compared, "/comparisons/0/reprojection/compared") == 1.0, "{found:?}");
    for name in [
        "front_px",
        "max_px",
        "rms_px",
        "without_rotation_front_px",
        "without_rotation_max_px",
        "without_rotation_rms_px",
    ] {
        assert!(of(name) < 1e-6, "{name}: {found:?}");
    }
    // There is something to be compared.
    assert!(number(&compared, "/comparisons/0/reprojection/rms_px") > 0.1, "{compared:#}");
}

#[test]
fn a_fisheye_goes_through_every_format_and_back() {
    let folder = tempdir().unwrap();
    let at = |name: &str| text(&folder.path().join(name));
    let camera = write(folder.path(), "camchain.yaml", KALIBR);
    let run = done(&["convert", &camera, "--out", &at("converted")]);
    assert!(run.stderr.contains("not written: camera_matlab.csv"), "{}", run.stderr);
    let files = ["camera_opencv.yaml", "camera_info.yaml", "camchain.yaml", "cameras.txt", "transforms.json"];
    let files = files.map(|name| at(&format!("converted/{name}")));
    let mut args = vec!["compare".to_string(), camera.clone()];
    args.extend(files);
    args.push("--json".into());
    let compared = groundcal(&args).json();
    for c in compared["comparisons"].as_array().unwrap() {
        assert!(number(c, "/reprojection/max_without_rotation_px") < 1e-9, "{c:#}");
        assert_eq!(c["camera"]["lens"], "fisheye");
    }
    // Another model's coefficients are not compared, its pixels are.
    let pinhole = write(folder.path(), "cameras.txt", "1 OPENCV 1000 1000 318 318 500 500 0.1 0 0 0\n");
    let run = done(&["compare", &camera, &pinhole]);
    assert!(
        run.stdout.contains("no coefficients in common") && run.stdout.contains("lens models gives nothing"),
        "{}",
        run.stdout
    );
    assert!(!run.stdout.contains("k1"), "{}", run.stdout);
}

#[test]
fn a_wide_image_is_made_flat_as_far_as_that_goes() {
    let folder = tempdir().unwrap();
    let at = |name: &str| text(&folder.path().join(name));
    let camera = write(folder.path(), "camchain.yaml", KALIBR);
    let all = groundcal(&["undistort", &camera, "--maps", "--fit", "all", "--out", &at("all")]);
    assert!(all.code == 4 && all.stderr.contains("degrees from the optical axis"), "{}", all.stderr);
    for (name, args) in [("same", &["--fit", "same"][..]), ("crop", &["--fit", "crop"]), ("fov", &["--fov", "100"])] {
        let out = at(name);
        done(&[&["undistort", &camera, "--maps", "--out", &out], args].concat());
        let json = read_json(&folder.path().join(name).join("camera_undistorted.json"));
        assert_eq!(json["distorted_camera"]["distortion"]["model"], "fisheye");
        assert_eq!(json["distorted_camera"]["distortion"]["k4"], -0.0001);
        assert_eq!(json["camera"]["distortion"]["model"], "none");
        let fx = number(&json, "/camera/fx");
        let expected = match name {
            "same" => (318.0, 319.0),
            // Corners at 80 degrees.
            "crop" => (124.0, 126.0),
            _ => (419.0, 420.0),
        };
        assert!(expected.0 < fx && fx < expected.1, "{name}: {fx}");
        // What is undistorted is read as a camera again.
        let made = at(&format!("{name}/camera_undistorted.json"));
        done(&["compare", &made, &made]);
    }
    for bad in ["0", "180", "wide"] {
        assert_eq!(groundcal(&["undistort", &camera, "--maps", "--fov", bad, "--out", &at("bad")]).code, 2);
    }
    let unsized_camera = write(folder.path(), "plain.yaml", "K: [700, 0, 320, 0, 700, 240, 0, 0, 1]\nk1: -0.1\n");
    let run = groundcal(&["undistort", &unsized_camera, "--maps", "--out", &at("bad")]);
    assert!(run.code == 4 && run.stderr.contains("image_width"), "{}", run.stderr);
}

#[test]
fn a_scene_with_a_fisheye_is_rendered_and_its_truth_is_the_camera() {
    let folder = tempdir().unwrap();
    let scene = "[camera]\nimage_size = [160, 120]\nfx = 60.0\n\n[camera.lens]\nmodel = \"fisheye\"\nk1 = 0.02\n\n[[group]]\npitch_down_deg = 60\n\n\
                 [[group.view]]\nfile = \"a.png\"\nyaw_deg = 0\ncentre_m = [0, 0, 1.5]\n";
    let scene = write(folder.path(), "scene.toml", scene);
    let out = text(&folder.path().join("out"));
    done(&["render", &scene, "--out", &out]);
    let truth = read_json(&folder.path().join("out/truth.json"));
    assert_eq!(truth["distortion"], json!({"model": "fisheye", "k1": 0.02, "k2": 0.0, "k3": 0.0, "k4": 0.0}));
    done(&[
        "undistort",
        &out,
        &text(&folder.path().join("out/a.png")),
        "--out",
        &text(&folder.path().join("flat")),
        "--fit",
        "crop",
    ]);
    assert!(folder.path().join("flat/a.png").is_file());
    let wrong =
        write(folder.path(), "wrong.toml", std::fs::read_to_string(&scene).unwrap().replace("k1 = 0.02", "p1 = 0.02"));
    let run = groundcal(&["render", &wrong, "--out", &out]);
    assert!(run.code == 4 && run.stderr.contains("camera.lens"), "{}", run.stderr);
}

/// Matches of three motions through the camera of [`KALIBR`].
fn matches_csv() -> String {
    let scene = PointScene {
        intrinsics: Intrinsics { fx: 318.31, fy: 318.52, cx: 499.7, cy: 499.2, skew: 0.0 },
        lens: Lens::Fisheye(Fisheye::new([0.01, -0.003, 0.0005, -0.0001])),
        size: ImageSize::new(1000, 1000),
        matches: 300,
        sigma_px: 0.2,
        ..PointScene::nominal(3)
    };
    let mut csv = String::from("image_a,image_b,xa,ya,xb,yb\n");
    for (i, motion) in scene.pairs().iter().enumerate() {
        for m in &motion.matches {
            csv += &format!("{i}a,{i}b,{},{},{},{}\n", m.a.x, m.a.y, m.b.x, m.b.y);
        }
    }
    csv
}

#[test]
fn a_fisheye_lens_from_a_file_is_held_and_its_camera_matrix_estimated() {
    let folder = tempdir().unwrap();
    let csv = write(folder.path(), "matches.csv", matches_csv());
    // Of images of half the size, 2 % off.
    let other = KALIBR
        .replace("[318.31, 318.52, 499.7, 499.2]", "[162.0, 162.0, 251.0, 248.0]")
        .replace("1000, 1000", "500, 500");
    let file = write(folder.path(), "camchain.yaml", &other);
    let out = text(&folder.path().join("out"));
    let run =
        done(&["calibrate", &csv, "--image-size", "1000x1000", "--lens-from", &file, "--json", "--out", &out]).json();
    for (name, truth) in [("fx", 318.31), ("fy", 318.52), ("cx", 499.7), ("cy", 499.2)] {
        let (value, sd) =
            (number(&run, &format!("/camera/{name}")), number(&run, &format!("/standard_deviation/{name}")));
        assert!((value - truth).abs() < 4.0 * sd && sd < 1.0, "{name} {value} +- {sd}");
    }
    let lens = &run["camera"]["distortion"];
    assert_eq!([&lens["model"], &lens["source"]], ["fisheye", "given"]);
    assert_eq!((number(lens, "/k1"), number(lens, "/k4")), (0.01, -0.0001));
    let written = done(&["compare", &file, &text(&folder.path().join("out")), "--json"]).json();
    assert_eq!(written["reference"]["lens"], "fisheye");

    let cropped = KALIBR.replace("1000, 1000", "1000, 800");
    let file = write(folder.path(), "cropped.yaml", &cropped);
    let refused = groundcal(&["calibrate", &csv, "--image-size", "1000x1000", "--lens-from", &file]);
    assert!(refused.code == 2 && refused.stderr.contains("another shape"), "{}", refused.stderr);
    let file = write(
        folder.path(),
        "pinhole.yaml",
        KALIBR.replace("[0.01, -0.003, 0.0005, -0.0001]", "[]").replace("equidistant", "none"),
    );
    let refused = groundcal(&["calibrate", &csv, "--image-size", "1000x1000", "--lens-from", &file]);
    assert!(refused.code == 2 && refused.stderr.contains("--lens none"), "{}", refused.stderr);
}
