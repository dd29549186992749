//! What stands in `--out` before and after a run: nothing of the user's is replaced, nothing of an earlier run stays beside the new, and
//! pictures keep their depth.

use std::{
    collections::BTreeSet,
    fs,
    path::{Path, PathBuf},
    process::{Command, Stdio},
    time::Duration,
};

use groundcal::{
    floor::{Fit, Undistortion},
    geometry::{Camera, ImageSize, Intrinsics, Lens},
    synthetic::PointScene,
};
use image::{DynamicImage, GrayImage, ImageBuffer, Luma, Rgb};
use nalgebra::Vector2;
use serde_json::json;
use tempfile::tempdir;

use crate::{
    common::*,
    rectify::{rendered, tiled, truth_json},
};

const USAGE: i32 = 2;

fn done(args: &[&str]) -> Outcome {
    let run = groundcal(args);
    assert_eq!(run.code, 0, "{args:?}: {}", run.stderr);
    run
}

/// A run that is refused with these words and prints no result.
fn refused_with(args: &[&str], code: i32, words: &[&str]) {
    let run = groundcal(args);
    assert_eq!((run.code, run.stdout.as_str()), (code, ""), "{args:?}: {}", run.stderr);
    for word in words {
        assert!(run.stderr.contains(word), "\"{word}\" is missing in: {}", run.stderr);
    }
}

/// A small `matches.csv` and the options that calibrate from it.
fn matched(folder: &Path) -> Vec<String> {
    let csv = write(folder, "matches.csv", matches_csv(&PointScene { matches: 60, ..PointScene::nominal(0) }));
    ["calibrate", &csv, "--image-size", "1280x960", "--method", "linear"].map(String::from).to_vec()
}

fn with<'a>(base: &'a [String], more: &[&'a str]) -> Vec<&'a str> {
    base.iter().map(String::as_str).chain(more.iter().copied()).collect()
}

// ---- Names.

#[test]
fn a_rectified_picture_never_takes_the_place_of_a_photograph() {
    let folder = tempdir().unwrap();
    let mut scene = tiled();
    scene.groups[0].views[1].file = "a_floor.png".into();
    rendered(&scene, folder.path());
    let photographs = ["a.png", "a_floor.png"].map(|n| folder.path().join(n));
    let before = photographs.clone().map(|p| fs::read(p).unwrap());
    let here = text(folder.path());
    let words = ["a_floor.png would be overwritten, which this run reads", "Name another folder"];
    refused_with(&["rectify", &here, &here, "--out", &here], USAGE, &words);
    refused_with(&["rectify", &here, &here, "--out", &here, "--overwrite"], USAGE, &words);
    assert_eq!(before, photographs.map(|p| fs::read(p).unwrap()));
    assert_eq!(files_in(folder.path()), ["a.png", "a_floor.png", "calibration.json"].map(String::from).into());
}

#[test]
fn every_image_gets_a_name_of_its_own() {
    let folder = tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    for (name, grey) in [("x/a.png", 50), ("y/a.png", 100), ("x/a_png_1.png", 150), ("z/A.PNG", 200)] {
        fs::create_dir_all(at(name).parent().unwrap()).unwrap();
        GrayImage::from_pixel(640, 480, Luma([grey])).save(at(name)).unwrap();
    }
    let camera = write(folder.path(), "camera.json", truth_json(&tiled()).to_string());
    let out = at("out");
    let [x, y, z] = ["x", "y", "z"].map(|n| text(&at(n)));
    let run = done(&["undistort", &camera, &x, &y, &z, "--out", &text(&out)]);
    let pictures: Vec<PathBuf> = run.stdout.lines().skip(1).map(PathBuf::from).collect();
    let middle = |p: &PathBuf| image::open(p).unwrap().to_luma8().get_pixel(320, 240).0[0];
    let greys: BTreeSet<u8> = pictures.iter().map(middle).collect();
    assert_eq!((pictures.len(), greys), (4, [50, 100, 150, 200].into()));
    let lower: BTreeSet<String> = results_in(&out).iter().map(|n| n.to_lowercase()).collect();
    assert_eq!(lower.len(), 5);
    assert_eq!(middle(&out.join("a_png_1.png")), 150, "the image of that name keeps it");
}

#[test]
fn files_of_others_are_replaced_on_demand_only() {
    let folder = tempdir().unwrap();
    let base = matched(folder.path());
    let out = folder.path().join("sparse");
    fs::create_dir(&out).unwrap();
    for name in ["transforms.json", "points3D.txt"] {
        write(&out, name, "of another program");
    }
    let there = text(&out);
    let words = ["transforms.json", "points3D.txt", "which no run wrote", "--overwrite"];
    refused_with(&with(&base, &["--out", &there]), USAGE, &words);
    assert_eq!(files_in(&out), ["transforms.json", "points3D.txt"].map(String::from).into());
    assert_eq!(fs::read_to_string(out.join("points3D.txt")).unwrap(), "of another program");
    done(&with(&base, &["--out", &there, "--format", "ros"]));
    done(&with(&base, &["--out", &there, "--overwrite"]));
    assert!(fs::read_to_string(out.join("points3D.txt")).unwrap().starts_with("# 3D point list"));
    // Its own may be replaced; what was edited may not.
    done(&with(&base, &["--out", &there]));
    write(&out, "camera_info.yaml", "edited");
    refused_with(&with(&base, &["--out", &there]), USAGE, &["camera_info.yaml would be overwritten", "changed since"]);
    // Where the next run has no such file, it is kept and said.
    let run = done(&with(&base, &["--out", &there, "--format", "kalibr"]));
    for word in ["taken away, of an earlier run: camera_matlab.csv", "changed since, and kept: camera_info.yaml"] {
        assert!(run.stderr.contains(word), "{}", run.stderr);
    }
    let expected = ["calibration.json", "camchain.yaml", "camera_info.yaml", "report.html"];
    assert_eq!(results_in(&out), expected.map(String::from).into());
}

#[test]
fn commands_live_together_in_one_folder() {
    let folder = tempdir().unwrap();
    rendered(&tiled(), folder.path());
    let (camera, out) = (text(&folder.path().join("calibration.json")), folder.path().join("out"));
    let [a, b] = ["a.png", "b.png"].map(|n| text(&folder.path().join(n)));
    let there = text(&out);
    done(&["convert", &camera, "--out", &there, "--format", "ros"]);
    done(&["rectify", &camera, &a, "--out", &there, "--resolution", "60"]);
    done(&["undistort", &camera, &a, "--out", &there]);
    // Images of one camera may come one after the other.
    done(&["rectify", &camera, &b, "--out", &there, "--resolution", "60"]);
    done(&["undistort", &camera, &b, "--out", &there]);
    let floor = ["a_floor", "b_floor"].iter().flat_map(|n| ["json", "pgw", "png"].map(|e| format!("{n}.{e}")));
    let others = ["a.png", "b.png", "camera_info.yaml", "camera_undistorted.json"].map(String::from);
    assert_eq!(results_in(&out), floor.clone().chain(others).collect());
    // Of another camera they are not mixed.
    done(&["undistort", &camera, &b, "--out", &there, "--fit", "crop"]);
    assert!(!results_in(&out).contains("a.png") && results_in(&out).contains("a_floor.png"));
}

// ---- Folders that cannot be.

#[test]
fn what_stands_in_the_way_is_said_before_the_work() {
    let folder = tempdir().unwrap();
    let base = matched(folder.path());
    let out = folder.path().join("out");
    fs::create_dir_all(out.join("calibration.json")).unwrap();
    let there = text(&out);
    refused_with(&with(&base, &["--out", &there]), USAGE, &["calibration.json is a folder where a file"]);
    refused_with(&with(&base, &["--out", &there, "--overwrite"]), USAGE, &["calibration.json is a folder"]);
    #[cfg(unix)]
    {
        let link = folder.path().join("link");
        std::os::unix::fs::symlink("nothing", &link).unwrap();
        refused_with(
            &with(&base, &["--out", &text(&link)]),
            USAGE,
            &["link is a link to something that does not exist"],
        );
        refused_with(&["undistort", "nowhere", "--maps", "--out", &text(&link)], USAGE, &["is a link"]);
    }
    assert_eq!(files_in(&out).len(), 0);
}

#[test]
fn a_second_run_into_a_folder_is_refused_while_one_is_at_work() {
    let folder = tempdir().unwrap();
    let base = matched(folder.path());
    let out = folder.path().join("out");
    fs::create_dir_all(out.join(".groundcal-run")).unwrap();
    let lock = fs::File::create(out.join(".groundcal-run/lock")).unwrap();
    lock.lock().unwrap();
    write(&out.join(".groundcal-run"), "of the first", "");
    refused_with(&with(&base, &["--out", &text(&out)]), 1, &["another run is writing into"]);
    assert!(out.join(".groundcal-run/of the first").exists());
    drop(lock);
    done(&with(&base, &["--out", &text(&out)]));
    assert!(!out.join(".groundcal-run").exists());
}

#[cfg(unix)]
#[test]
fn interrupted_runs_tidy_up() {
    let folder = tempdir().unwrap();
    let scene = PointScene { matches: 3000, ..PointScene::nominal(0) };
    let csv = write(folder.path(), "matches.csv", matches_csv(&scene));
    let commands: [(&str, Vec<&str>); 3] = [
        ("-INT", vec!["calibrate", &csv, "--image-size", "1280x960"]),
        ("-INT", vec!["simulate", "noise", "--trials", "100000"]),
        ("-TERM", vec!["simulate", "noise", "--trials", "100000"]),
    ];
    for (signal, args) in &commands {
        let out = folder.path().join("new/out");
        let mut child = Command::new(env!("CARGO_BIN_EXE_groundcal"))
            .args(args)
            .arg("--out")
            .arg(&out)
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        while !out.join(".groundcal-run/new").exists() && child.try_wait().unwrap().is_none() {
            std::thread::sleep(Duration::from_millis(1));
        }
        Command::new("sh").args(["-c", &format!("kill {signal} {}", child.id())]).status().unwrap();
        let output = child.wait_with_output().unwrap();
        let code = if *signal == "-INT" { 130 } else { 143 };
        assert_eq!(output.status.code(), Some(code), "{args:?}: {}", String::from_utf8_lossy(&output.stderr));
        assert!(output.stdout.is_empty() && !folder.path().join("new").exists(), "{args:?}");
    }
}

// ---- What is said.

#[test]
fn a_run_says_what_it_wrote() {
    let folder = tempdir().unwrap();
    let base = matched(folder.path());
    let out = text(&folder.path().join("out"));
    let run = done(&with(&base, &["--out", &out, "--json"]));
    run.json();
    for word in [&format!("written to {out}: calibration.json, report.html"), &format!("the page: {out}/report.html")] {
        assert!(run.stderr.contains(word.as_str()), "{}", run.stderr);
    }
    let manifest = read_json(&folder.path().join("out").join(MANIFEST));
    let files = manifest["commands"][0]["files"].as_array().unwrap();
    assert_eq!((manifest["commands"][0]["command"].as_str(), files.len()), (Some("calibrate"), 10));
    for file in files {
        let content = fs::read(folder.path().join("out").join(file["name"].as_str().unwrap())).unwrap();
        assert_eq!(file["bytes"], content.len());
        assert_eq!(file["sha256"], groundcal_io::outputs::sha256(&content));
    }
}

// ---- Depth.

const SIZE: ImageSize = ImageSize { width: 320, height: 240 };

/// A brightness that is linear in the pixel: interpolation does not change it.
fn brightness(p: &Vector2<f64>, channel: usize) -> f64 {
    3000.0 + 71.3 * p.x + 93.9 * p.y + 1000.0 * channel as f64
}

fn values(channels: usize) -> impl Iterator<Item = f64> {
    (0..SIZE.width * SIZE.height * channels).map(move |i| {
        let (pixel, channel) = (i / channels, i % channels);
        brightness(&Vector2::new((pixel % SIZE.width) as f64, (pixel / SIZE.width) as f64), channel)
    })
}

/// The pictures of the brightness in every depth and format, and their camera.
fn deep_pictures(folder: &Path) -> Camera {
    let [w, h] = [SIZE.width as u32, SIZE.height as u32];
    let sixteen = |channels| values(channels).map(|v| v.round() as u16).collect::<Vec<u16>>();
    let save = |name: &str, image: DynamicImage| image.save(folder.join(name)).unwrap();
    let grey: ImageBuffer<Luma<u16>, _> = ImageBuffer::from_raw(w, h, sixteen(1)).unwrap();
    let colour: ImageBuffer<Rgb<u16>, _> = ImageBuffer::from_raw(w, h, sixteen(3)).unwrap();
    let floats = values(3).map(|v| (v / 65536.0) as f32).collect();
    save("grey.png", grey.clone().into());
    save("grey16.tif", grey.into());
    save("colour.png", colour.clone().into());
    save("colour16.tif", colour.into());
    save("float.tif", DynamicImage::ImageRgb32F(ImageBuffer::from_raw(w, h, floats).unwrap()));
    let intrinsics = Intrinsics::square(260.0, 161.0, 118.0);
    let lens = Lens::radial(-0.12, 0.02);
    let view = |name: &str| {
        json!({"image": name, "attitude": 0, "origin": "grey.png", "yaw_deg": 0, "pitch_down_deg": 50, "roll_deg": 3,
               "position": [0, 0, 1]})
    };
    let views = ["grey.png", "grey16.tif", "colour.png", "colour16.tif", "float.tif"].map(view);
    let camera = json!({"format_version": 1, "method": "joint", "scene": "floor",
        "attitudes": [{"pitch_down_deg": 50, "roll_deg": 3}],
        "views": views,
        "camera": {"image_size": [320, 240], "fx": 260, "fy": 260, "cx": 161, "cy": 118, "skew": 0,
                   "distortion": {"model": "radtan", "k1": -0.12, "k2": 0.02, "p1": 0, "p2": 0}}});
    write(folder, "calibration.json", camera.to_string());
    Camera { size: SIZE, intrinsics, lens }
}

/// Samples of 16 bits as they are, of floating point times 65536; alpha left out; with the colours that the file has.
fn samples(path: &Path) -> (Vec<f64>, usize) {
    let image = image::open(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    let without = |all: usize, kept: usize, data: &[u16]| {
        data.chunks_exact(all).flat_map(|p| p[..kept].iter().map(|v| f64::from(*v))).collect::<Vec<f64>>()
    };
    match image {
        DynamicImage::ImageLuma16(i) => (without(1, 1, &i), 1),
        DynamicImage::ImageLumaA16(i) => (without(2, 1, &i), 1),
        DynamicImage::ImageRgb16(i) => (without(3, 3, &i), 3),
        DynamicImage::ImageRgba16(i) => (without(4, 3, &i), 3),
        DynamicImage::ImageRgb32F(i) => (i.iter().map(|v| 65536.0 * f64::from(*v)).collect(), 3),
        other => panic!("{}: {:?}", path.display(), other.color()),
    }
}

#[test]
fn undistorted_pictures_keep_their_depth() {
    let folder = tempdir().unwrap();
    let camera = deep_pictures(folder.path());
    let out = folder.path().join("out");
    let here = text(folder.path());
    let run = done(&["undistort", &here, &here, "--out", &text(&out), "--fit", "crop"]);
    assert!(!run.stderr.contains("note:"), "{}", run.stderr);
    let undistortion = Undistortion::new(&camera, Fit::Crop).unwrap();
    for name in ["grey.png", "grey16.tiff", "colour.png", "colour16.tiff", "float.tiff"] {
        let (found, channels) = samples(&out.join(name));
        assert_eq!(channels, if name.starts_with("grey") { 1 } else { 3 }, "{name}");
        let (mut worst, mut levels) = (0.0f64, BTreeSet::new());
        for (i, value) in found.iter().enumerate() {
            let (pixel, channel) = (i / channels, i % channels);
            let at = Vector2::new((pixel % SIZE.width) as f64, (pixel / SIZE.width) as f64);
            let source = undistortion.source_pixel(&at).unwrap();
            let inside = source.x >= 0.0 && source.y >= 0.0 && source.x <= 319.0 && source.y <= 239.0;
            if inside {
                worst = worst.max((value - brightness(&source, channel)).abs());
                levels.insert(value.round() as u32);
            }
        }
        println!("{name}: {} levels, largest error {worst:.3} of 65536", levels.len());
        // Rounding of the source and of the result; of 8 bits it would be 128.
        let bound = if name == "float.tiff" { 0.02 } else { 1.0 };
        assert!(worst <= bound && levels.len() > 10_000, "{name}: {worst}, {} levels", levels.len());
    }
}

#[test]
fn a_format_that_cannot_hold_the_depth_is_said_by_name() {
    let folder = tempdir().unwrap();
    deep_pictures(folder.path());
    let out = folder.path().join("out");
    let here = text(folder.path());
    let run = done(&["undistort", &here, &here, "--out", &text(&out), "--format", "jpeg"]);
    for name in ["grey.png", "grey16.tif", "colour.png", "colour16.tif"] {
        assert!(
            run.stderr.contains(&format!("{name}: has 16 bits, which JPEG does not hold: written with 8 bits")),
            "{}",
            run.stderr
        );
    }
    assert!(run.stderr.contains("float.tif: has floating point numbers, which JPEG"), "{}", run.stderr);
    assert_eq!(image::open(out.join("colour.jpg")).unwrap().color(), image::ColorType::Rgb8);
    let run = done(&["undistort", &here, &here, "--out", &text(&out), "--format", "png"]);
    assert!(run.stderr.contains("float.tif: has floating point numbers, which PNG"), "{}", run.stderr);
    assert!(!run.stderr.contains("16 bits, which"), "{}", run.stderr);
    assert_eq!(samples(&out.join("float.png")).1, 3);
}

#[test]
fn pictures_of_the_floor_keep_their_depth() {
    let folder = tempdir().unwrap();
    deep_pictures(folder.path());
    let here = text(folder.path());
    let out = folder.path().join("out");
    done(&["rectify", &here, &here, "--out", &text(&out), "--resolution", "80", "--extent", "2"]);
    let (float, _) = samples(&out.join("float_floor.tiff"));
    assert!(float.iter().any(|v| v.is_nan()), "beyond the view floats are no numbers");
    for (name, channels) in
        [("grey_floor.png", 1), ("grey16_floor.tiff", 1), ("colour_floor.png", 3), ("colour16_floor.tiff", 3)]
    {
        let (found, n) = samples(&out.join(name));
        assert_eq!(n, channels);
        let (mut levels, mut compared) = (BTreeSet::new(), 0);
        for (i, value) in found.iter().enumerate().filter(|(_, v)| **v > 0.0) {
            let exact = float[i / channels * 3 + i % channels];
            if !exact.is_nan() {
                // Half a step each: the source, its copies halved once and twice, the result. Of 8 bits a step would be 257.
                assert!((value - exact).abs() <= 2.0, "{name}: {value} {exact}");
                levels.insert(*value as u32);
                compared += 1;
            }
        }
        assert!(levels.len() > 5000 && compared > 10_000, "{name}: {} levels of {compared}", levels.len());
    }
    assert!(out.join("grey16_floor.tfw").exists() && out.join("grey_floor.pgw").exists());
    // All in one: of one depth it is kept, of several it is said.
    let mosaic = |names: &[&str]| {
        let files: Vec<String> = names.iter().map(|n| text(&folder.path().join(n))).collect();
        let there = text(&out);
        let base =
            ["rectify", &here, "--mosaic", "--resolution", "80", "--extent", "2", "--up", "heading", "--out", &there];
        done(&base.iter().copied().chain(files.iter().map(String::as_str)).collect::<Vec<_>>())
    };
    assert!(!mosaic(&["colour16.tif", "grey16.tif"]).stderr.contains("depth"));
    let (found, channels) = samples(&out.join("mosaic.tiff"));
    assert!(channels == 3 && found.iter().map(|v| *v as u32).collect::<BTreeSet<_>>().len() > 5000);
    let run = mosaic(&["colour16.tif", "float.tif"]);
    assert!(run.stderr.contains("different depths"), "{}", run.stderr);
    assert!(out.join("mosaic.png").exists() && !out.join("mosaic.tiff").exists());
}
