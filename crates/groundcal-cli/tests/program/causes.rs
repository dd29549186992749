//! Degenerate matches: the message must name the true cause, not a neighbour of it.

use std::fmt::Write;

use crate::common::*;
use groundcal::synthetic::{MotionSpec, PointScene};
use tempfile::tempdir;

/// The message, in lower case, for a CSV that has to be refused as degenerate.
fn message(csv: &str, constraint: &str) -> String {
    let folder = tempdir().unwrap();
    let csv = write(folder.path(), "matches.csv", csv);
    refused(&[&csv, "--image-size", "1280x960", "--constraint", constraint], 3, &[]).stderr.to_lowercase()
}

#[test]
fn points_on_a_line_are_called_so() {
    for sigma_px in [0.0, 0.5] {
        let mut scene = PointScene::nominal(1);
        scene.motions = vec![MotionSpec::about_axis(50f64.to_radians(), 0.0, 20f64.to_radians(), 0.2, 3.0)];
        let h = scene.homography(0).unwrap();
        scene.matches = 400;
        scene.sigma_px = sigma_px;
        let mut csv = "image_a,image_b,xa,ya,xb,yb\n".to_string();
        // Noise from the scene, places from a line.
        for m in &scene.pairs()[0].matches {
            let exact = h.apply(&m.a).unwrap();
            let noise = m.b - exact;
            let on_line = nalgebra::Vector2::new(m.a.x, 300.0 + 0.2 * m.a.x);
            let b = h.apply(&on_line).unwrap() + noise;
            if (0.0..1280.0).contains(&b.x) && (0.0..960.0).contains(&b.y) {
                let _ = writeln!(csv, "a,b,{},{},{},{}", on_line.x, on_line.y + 0.3 * noise.y, b.x, b.y);
            }
        }
        let text = message(&csv, "focal");
        assert!(text.contains("on a line"), "{text}");
        assert!(!text.contains("translation"), "{text}");
    }
}

#[test]
fn a_half_turn_is_not_called_a_translation() {
    let mut scene = PointScene::nominal(2);
    scene.motions = vec![MotionSpec { shift: [5.0, 0.0], ..scene.motions[0] }];
    scene.motions[0].turn_rad = std::f64::consts::PI;
    let text = message(&matches_csv(&scene), "focal");
    assert!(text.contains("180"), "{text}");
    assert!(!text.contains("without a turn") && !text.contains("translation"), "{text}");
}

#[test]
fn a_camera_square_to_the_floor_is_told_to_tilt() {
    let mut scene = PointScene::nominal(3);
    scene.motions = vec![MotionSpec::about_axis(90f64.to_radians(), 0.0, 25f64.to_radians(), 0.2, 3.0)];
    for constraint in ["focal", "fixed-pp", "auto"] {
        let text = message(&matches_csv(&scene), constraint);
        assert!(text.contains("tilt the camera"), "{constraint}: {text}");
        assert!(constraint != "focal" || !text.contains("--constraint focal"), "advice already taken: {text}");
    }
}

#[test]
fn the_rotating_camera_method_knows_its_limits() {
    let rotating = ["--method", "rotating", "--max-features", "800", "--threads", "1"];
    // The axis 0.2 m off over a floor 1.3 m away: nearly rotations, with a warning.
    let path = at("examples/head");
    let head = groundcal(&[&["calibrate", path.as_str(), "--verbose"][..], &rotating].concat());
    let json = calibrate(&[&[path.as_str()][..], &rotating].concat()).json();
    assert_eq!((head.code, json["method"].as_str()), (0, Some("rotating")), "{}", head.stderr);
    assert!(head.stdout.contains("rotating camera") && warnings(&json).contains(&"not_rotations"), "{}", head.stdout);
    // Every rendering names the method.
    let out = tempdir().unwrap();
    let folder = text(out.path());
    let args = [&["calibrate", path.as_str(), "--out", &folder][..], &rotating].concat();
    assert_eq!(groundcal(&args).code, 0);
    let page = std::fs::read_to_string(out.path().join("report.html")).unwrap();
    assert!(page.contains("rotating-camera method") && !page.contains("linear method"));
    // Its bars are wider than the method's noise, and it is wrong by more than a per cent.
    let (fx, sigma) = (number(&json, "/camera/fx"), number(&json, "/standard_deviation/fx"));
    assert!((fx - 668.0).abs() > 6.68 && sigma > 1.0, "{fx} +- {sigma}");
    // A tripod carried over the floor: no rotation at all.
    let tripod = at("examples/tripod");
    refused(&[&[tripod.as_str()][..], &rotating].concat(), 3, &["moved", "joint"]);
    refused(&[&[tripod.as_str(), "--height-sigma", "0"][..], &rotating].concat(), 2, &["floor"]);
}
