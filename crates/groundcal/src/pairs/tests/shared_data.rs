//! Matches against the truth of rendered sets that live outside the repository; skipped, with a line, where they are not.
//! The truth is read for scoring only.

use std::path::{Path, PathBuf};

use crate::geometry::frame::Frame;
use crate::geometry::size::ImageSize;
use crate::pairs::correspondence::PointMatch;
use crate::pairs::robust::{RobustHomography, RobustOptions};
use crate::pairs::tests::estimate_robust;
use crate::vision::features::FeatureOptions;
use crate::vision::features::detect;
use crate::vision::features::{MatchOptions, match_features};
use crate::vision::image::GrayImage;
use crate::vision::patches::{PatchOptions, match_patches, template_grid};
use nalgebra::{Matrix3, Vector2, Vector3};

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

#[test]
fn patches_of_the_true_motions_are_good_to_a_few_hundredths_of_a_pixel() {
    let Some(folder) = set("tripod_tiles") else { return };
    let text = std::fs::read_to_string(folder.join("truth.json")).expect("readable");
    let truth: serde_json::Value = serde_json::from_str(&text).expect("JSON");
    for pair in truth["views"].as_array().expect("views").chunks(2) {
        let h = image_from_floor(&truth, &pair[1]) * image_from_floor(&truth, &pair[0]).try_inverse().expect("regular");
        let images = [&pair[0], &pair[1]].map(|v| load(&folder.join(v["file"].as_str().expect("a name"))));
        let [fa, fb] = images.each_ref().map(|image| detect(image, &FeatureOptions::default()));
        let frame = Frame::new(images[0].size(), None);
        let robust = |matches: &[PointMatch], max_sigma_px: f64| -> RobustHomography {
            let options = RobustOptions { max_sigma_px, ..RobustOptions::default() };
            estimate_robust(matches, &frame, &options).expect("a homography")
        };
        // As a calibration does it: features give the map, patches refine it, and those that disagree are left out.
        let rough = robust(&match_features(&fa, &fb, &MatchOptions::default()), 2.0).estimate.h_b_from_a;
        let options = PatchOptions::default();
        let [a, b] = &images;
        let grid = template_grid(a, &options);
        let patches = match_patches(a, &grid, b, &|p| rough.apply(p), &options);
        let matches: Vec<PointMatch> = patches.iter().map(|m| m.point_match(options.model_sigma_px)).collect();
        let kept = robust(&matches, 6.0).inliers;
        let errors: Vec<Vector2<f64>> = kept
            .iter()
            .map(|&i| {
                let q = h * Vector3::new(matches[i].a.x, matches[i].a.y, 1.0);
                matches[i].b - Vector2::new(q.x / q.z, q.y / q.z)
            })
            .collect();
        let n = errors.len() as f64;
        let bias = errors.iter().sum::<Vector2<f64>>() / n;
        let rms = [0, 1].map(|axis| (errors.iter().map(|e| e[axis] * e[axis]).sum::<f64>() / n).sqrt());
        println!(
            "{}: {} templates, {} patches, {} kept, rms ({:.4}, {:.4}) px, mean ({:+.4}, {:+.4}) px",
            pair[0]["file"],
            grid.len(),
            patches.len(),
            kept.len(),
            rms[0],
            rms[1],
            bias.x,
            bias.y
        );
        assert!(kept.len() >= 300, "{}: {} patches", pair[0]["file"], kept.len());
        assert!(rms[0].hypot(rms[1]) <= 0.06 * 2f64.sqrt(), "{}: rms {rms:?} px", pair[0]["file"]);
        assert!(bias.amax() < 0.02, "{}: bias {bias}", pair[0]["file"]);
    }
}
