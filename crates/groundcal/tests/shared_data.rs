//! Matches against the truth of rendered sets that live outside the repository; skipped, with a line, where they are not.
//! The truth is read for scoring only.

#![allow(clippy::expect_used)] // a test or benchmark may end in a panic

use std::path::{Path, PathBuf};

use groundcal::{
    features::{FeatureOptions, MatchOptions, detect, match_features},
    image::{GrayImage, ImageSize},
};
use nalgebra::{Matrix3, Vector3};

/// The folder of a set, if it is there.
fn set(name: &str) -> Option<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data").join(name);
    if folder.join("truth.json").is_file() {
        return Some(folder);
    }
    println!("skipped: {name} is not at {}", folder.display());
    None
}

fn load(path: &Path) -> GrayImage {
    let grey = image::open(path).expect("readable").into_luma8();
    let size = ImageSize::new(grey.width() as usize, grey.height() as usize);
    let values = grey.into_raw().into_iter().map(|v| f32::from(v) / 255.0).collect();
    GrayImage::from_rows(size, values).expect("right size")
}

/// The map from the floor (X, Y, 1) to pixels of a view: K R [e1 e2 -c].
fn image_from_floor(truth: &serde_json::Value, view: &serde_json::Value) -> Matrix3<f64> {
    let number = |v: &serde_json::Value| v.as_f64().expect("a number");
    let degrees = |name: &str| number(&view[name]).to_radians();
    let (sp, cp) = degrees("pitch_down_deg").sin_cos();
    let (sr, cr) = (-degrees("roll_deg")).sin_cos();
    let (sy, cy) = (-degrees("yaw_deg")).sin_cos();
    let roll = Matrix3::new(cr, -sr, 0.0, sr, cr, 0.0, 0.0, 0.0, 1.0);
    let pitch = Matrix3::new(1.0, 0.0, 0.0, 0.0, cp, -sp, 0.0, sp, cp);
    let level = Matrix3::new(0.0, -1.0, 0.0, 0.0, 0.0, -1.0, 1.0, 0.0, 0.0);
    let yaw = Matrix3::new(cy, -sy, 0.0, sy, cy, 0.0, 0.0, 0.0, 1.0);
    let r = roll * pitch * level * yaw;
    let c = Vector3::from_fn(|i, _| number(&view["centre_m"][i]));
    let k = Matrix3::new(
        number(&truth["fx"]),
        0.0,
        number(&truth["cx"]),
        0.0,
        number(&truth["fy"]),
        number(&truth["cy"]),
        0.0,
        0.0,
        1.0,
    );
    k * Matrix3::from_columns(&[r.column(0).into_owned(), r.column(1).into_owned(), -(r * c)])
}

#[test]
fn every_true_motion_has_150_correct_matches() {
    for name in ["tripod_tiles", "head_carpet"] {
        let Some(folder) = set(name) else { continue };
        let text = std::fs::read_to_string(folder.join("truth.json")).expect("readable");
        let truth: serde_json::Value = serde_json::from_str(&text).expect("JSON");
        let views = truth["views"].as_array().expect("views");
        for pair in views.chunks(2) {
            let h =
                image_from_floor(&truth, &pair[1]) * image_from_floor(&truth, &pair[0]).try_inverse().expect("regular");
            let [a, b] = [&pair[0], &pair[1]].map(|v| {
                let file = v["file"].as_str().expect("a name");
                detect(&load(&folder.join(file)), &FeatureOptions::default())
            });
            let matches = match_features(&a, &b, &MatchOptions::default());
            let errors: Vec<f64> = matches
                .iter()
                .map(|m| {
                    let q = h * Vector3::new(m.a.x, m.a.y, 1.0);
                    (q.x / q.z - m.b.x).hypot(q.y / q.z - m.b.y)
                })
                .filter(|e| *e <= 2.0)
                .collect();
            let rms = (errors.iter().map(|e| e * e).sum::<f64>() / errors.len().max(1) as f64).sqrt();
            println!(
                "{name} {}: {} / {} features, {} matches, {} correct, rms {rms:.3} px",
                pair[0]["file"],
                a.points.len(),
                b.points.len(),
                matches.len(),
                errors.len()
            );
            assert!(errors.len() >= 150, "{name} {}: {} correct matches", pair[0]["file"], errors.len());
        }
    }
}
