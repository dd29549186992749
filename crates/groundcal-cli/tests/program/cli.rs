//! The program from end to end: exit codes, messages, files, and the camera that comes out.

use std::{collections::BTreeSet, path::Path, sync::OnceLock};

use crate::common::*;
use groundcal::synthetic::{MotionSpec, PointScene};
use groundcal_lab::renderer::{
    render::{Renderer, RgbImage8},
    scene::{Camera, Group, Scene, View},
};
use image::{DynamicImage, ImageFormat, RgbImage};
use serde_json::Value;
use tempfile::tempdir;

const DEGENERATE: i32 = 3;
const INPUT: i32 = 4;
const USAGE: i32 = 2;

const TRIPOD_PAIR: [&str; 2] = ["examples/tripod/00a.jpg", "examples/tripod/00b.jpg"];
const TRIPOD_TWO_PAIRS: [&str; 4] =
    ["examples/tripod/00a.jpg", "examples/tripod/00b.jpg", "examples/tripod/01a.jpg", "examples/tripod/01b.jpg"];

/// Files of the repository, then other arguments.
fn args(files: &[&str], more: &[&str]) -> Vec<String> {
    files.iter().map(|f| at(f)).chain(more.iter().map(|m| m.to_string())).collect()
}

// ---- Exit code 3: well-formed, but it cannot determine what was asked.

#[test]
fn two_attitudes_cannot_give_five_unknowns() {
    refused(
        &args(&TRIPOD_TWO_PAIRS, &["--constraint", "full"]),
        DEGENERATE,
        &["`full`", "5 unknowns", "needs 3", "2 motions have 2", "Tilt or roll the camera by 20 degrees", "zero-skew"],
    );
}

#[test]
fn one_attitude_cannot_give_four_unknowns() {
    refused(
        &args(&TRIPOD_PAIR, &["--constraint", "zero-skew"]),
        DEGENERATE,
        &[
            "`zero-skew`",
            "4 unknowns",
            "needs 2",
            "1 motion has 1",
            "Tilt or roll the camera",
            "ask for less with a stronger constraint",
            "fixed-pp",
        ],
    );
}

#[test]
fn four_motions_of_one_attitude_count_as_one() {
    let mut scene = PointScene::nominal(3);
    let attitude = (50f64.to_radians(), 10f64.to_radians());
    scene.motions = [(20.0, 0.2), (30.0, 0.5), (-25.0, 0.1), (40.0, 0.8)]
        .map(|(turn, offset): (f64, f64)| {
            MotionSpec::about_axis(attitude.0, attitude.1, turn.to_radians(), offset, 3.0)
        })
        .to_vec();
    let folder = tempdir().unwrap();
    let csv = write(folder.path(), "matches.csv", matches_csv(&scene));
    refused(
        &[&csv, "--image-size", "1280x960", "--constraint", "zero-skew"],
        DEGENERATE,
        &["`zero-skew`", "4 motions have 1", "same two equations", "Tilt or roll the camera by 20 degrees"],
    );
}

#[test]
fn pure_translation_is_named() {
    let mut scene = PointScene::nominal(4);
    scene.motions.truncate(1);
    scene.motions[0].turn_rad = 0.0;
    scene.motions[0].shift = [0.6, 0.3];
    let folder = tempdir().unwrap();
    let csv = write(folder.path(), "matches.csv", matches_csv(&scene));
    let words =
        ["no usable motion in 1 image pair", "pure translation", "degrees", "Turn the camera by 15 to 60 degrees"];
    refused(&[&csv, "--image-size", "1280x960", "--constraint", "focal"], DEGENERATE, &words);
}

#[test]
fn one_image_is_not_enough() {
    let folder = tempdir().unwrap();
    std::fs::copy(at(TRIPOD_PAIR[0]), folder.path().join("only.jpg")).unwrap();
    refused(&[text(folder.path())], DEGENERATE, &["1 image:", "at least two", "Take a second image after turning"]);
}

#[test]
fn unrelated_photographs_have_no_common_plane() {
    let files = args(&["examples/tripod/00a.jpg", "examples/head/00a.jpg"], &[]);
    let words =
        ["the image pair does not show", "common plane", "15 are needed", "Check that the images belong together"];
    refused(&files, DEGENERATE, &words);
}

#[test]
fn three_matches_are_too_few() {
    let folder = tempdir().unwrap();
    let csv = "image_a,image_b,xa,ya,xb,yb\na,b,10,10,12,11\na,b,400,30,410,35\na,b,90,300,99,310\n";
    let csv = write(folder.path(), "matches.csv", csv);
    let words = ["3 different matches between a and b (3 given)", "needs 4", "Give more matches"];
    refused(&[&csv, "--image-size", "640x480"], DEGENERATE, &words);
}

#[test]
fn a_match_repeated_100_000_times_is_one_match() {
    let folder = tempdir().unwrap();
    let csv = format!("image_a,image_b,xa,ya,xb,yb\n{}", "a,b,10,10,12,11\n".repeat(100_000));
    let csv = write(folder.path(), "matches.csv", csv);
    let words = ["1 different match between a and b (100000 given)", "needs 4", "Give more matches"];
    refused(&[&csv, "--image-size", "640x480"], DEGENERATE, &words);
}

#[test]
fn the_same_image_twice_says_nothing() {
    let folder = tempdir().unwrap();
    for name in ["one.jpg", "two.jpg"] {
        std::fs::copy(at(TRIPOD_PAIR[0]), folder.path().join(name)).unwrap();
    }
    let words =
        ["no usable motion in 1 image pair", "nothing moved", "stand still", "Turn the camera by 15 to 60 degrees"];
    refused(&[text(folder.path())], DEGENERATE, &words);
}

// ---- Exit code 4: malformed or unreadable.

#[test]
fn empty_folder() {
    let folder = tempdir().unwrap();
    let path = text(folder.path());
    refused(&[&path], INPUT, &["no images", &path, "0 other entries", "Images end in .jpg", ".webp"]);
}

#[test]
fn truncated_jpeg() {
    let folder = tempdir().unwrap();
    let whole = std::fs::read(at(TRIPOD_PAIR[0])).unwrap();
    let half = write(folder.path(), "half.jpg", &whole[..whole.len() / 2]);
    refused(&[&half, &at(TRIPOD_PAIR[1])], INPUT, &["half.jpg", "truncated", "Copy it again"]);
}

/// Decoders fill the rest with grey; the user hears of it.
#[test]
fn a_jpeg_that_ends_early_is_named() {
    let folder = tempdir().unwrap();
    let whole = std::fs::read(at(TRIPOD_PAIR[0])).unwrap();
    let cut = [&whole[..whole.len() * 9 / 10], &[0, 0xff, 0xd9]].concat();
    let cut = write(folder.path(), "cut.jpg", cut);
    let outcome = calibrate(&[&cut, &at(TRIPOD_PAIR[1]), "--max-features", "1500"]);
    assert_eq!(outcome.code, 0, "{}", outcome.stderr);
    assert!(outcome.stderr.contains("cut.jpg: the JPEG ends early"), "{}", outcome.stderr);
}

#[test]
fn truncated_png() {
    let folder = tempdir().unwrap();
    let [upright, _] = rendered();
    let whole = encoded(&DynamicImage::ImageRgb8(upright.clone()), ImageFormat::Png);
    let half = write(folder.path(), "half.png", &whole[..whole.len() / 2]);
    refused(&[&half, &at(TRIPOD_PAIR[1])], INPUT, &["half.png", "truncated", "Copy or export it again"]);
}

#[test]
fn text_named_as_an_image() {
    let folder = tempdir().unwrap();
    let note = write(folder.path(), "note.jpg", "Shopping list: bread, milk, a tripod.\n");
    refused(&[&note, &at(TRIPOD_PAIR[1])], INPUT, &["note.jpg", "not an image", "Remove it or convert it"]);
}

#[test]
fn empty_file_named_as_an_image() {
    let folder = tempdir().unwrap();
    let empty = write(folder.path(), "empty.png", "");
    refused(&[&empty, &at(TRIPOD_PAIR[1])], INPUT, &["empty.png", "the file is empty", "Copy it again"]);
}

#[test]
fn not_a_number_in_csv() {
    let folder = tempdir().unwrap();
    let csv = "image_a,image_b,xa,ya,xb,yb\na,b,10,10,12,11\na,b,400,30,410,35\na,b,90,NaN,99,310\n";
    let csv = write(folder.path(), "matches.csv", csv);
    let words = ["matches.csv line 4", "ya", "NaN", "not a finite number", "Correct or remove the line"];
    refused(&[&csv, "--image-size", "640x480"], INPUT, &words);
}

#[test]
fn short_line_in_csv() {
    let folder = tempdir().unwrap();
    let csv = write(folder.path(), "matches.csv", "image_a,image_b,xa,ya,xb,yb\na,b,10,10,12,11\na,b,400,30\n");
    refused(&[&csv, "--image-size", "640x480"], INPUT, &["matches.csv", "line 3", "4 fields", "6 fields"]);
}

#[test]
fn comments_and_blank_lines_are_skipped_and_counted() {
    let scene = PointScene::nominal(6);
    let plain = matches_csv(&scene);
    let folder = tempdir().unwrap();
    let options = ["--image-size", "1280x960", "--method", "linear"];
    let run = |name: &str, csv: &str| {
        let csv = write(folder.path(), name, csv);
        calibrate(&[&[csv.as_str()][..], &options].concat())
    };
    let lines: Vec<&str> = plain.lines().collect();
    let commented =
        format!("\u{feff}# of a test\n\n{}\n  # indented\n   \t\n{}\n# the end", lines[0], lines[1..].join("\n"));
    assert_eq!(run("commented.csv", &commented).json(), run("plain.csv", &plain).json());
    // Lines 1 and 3 are comments, 4 is blank: the bad value stands in line 6 of the file.
    let bad = format!("# one\n{}\n# three\n \n{}\nm0a,m0b,1,2,3,four,1\n", lines[0], lines[1]);
    let message = run("bad.csv", &bad).stderr;
    assert!(message.contains("line 6: yb is \"four\""), "{message}");
    let message = run("short.csv", &bad.replace(",3,four,1", "")).stderr;
    assert!(message.contains("line 6: 4 fields where the header has 7"), "{message}");
    let message = run("twice.csv", &plain.replacen("sigma_px", "xa", 1)).stderr;
    assert!(message.contains("the column xa is there twice"), "{message}");
}

#[test]
fn wrong_header_in_csv() {
    let folder = tempdir().unwrap();
    let csv = write(folder.path(), "matches.csv", "left,right,x0,y0,x1,y1\na,b,10,10,12,11\n");
    let words = ["matches.csv", "header", "image_a,image_b,xa,ya,xb,yb", "image,track,x,y"];
    refused(&[&csv, "--image-size", "640x480"], INPUT, &words);
}

#[test]
fn no_rows_in_csv() {
    let folder = tempdir().unwrap();
    let csv = write(folder.path(), "matches.csv", "image_a,image_b,xa,ya,xb,yb\n");
    refused(&[&csv, "--image-size", "640x480"], INPUT, &["matches.csv", "no rows"]);
}

#[test]
fn missing_file() {
    let folder = tempdir().unwrap();
    let path = text(&folder.path().join("absent.jpg"));
    refused(&[&path, &at(TRIPOD_PAIR[1])], INPUT, &[&path, "does not exist", "Check the path"]);
}

#[test]
fn pattern_that_matches_nothing() {
    let folder = tempdir().unwrap();
    let pattern = text(&folder.path().join("*.jpg"));
    refused(&[&pattern], INPUT, &["no file matches", &pattern, "Check the pattern"]);
}

#[test]
fn images_of_different_sizes() {
    let folder = tempdir().unwrap();
    let [small, _] = rendered();
    let small = write(folder.path(), "small.png", encoded(&DynamicImage::ImageRgb8(small.clone()), ImageFormat::Png));
    let words = ["small.png", "480x360", "00a.jpg", "800x600", "all images must come from one camera at one size"];
    refused(&[&at(TRIPOD_PAIR[0]), &small], INPUT, &words);
}

#[test]
fn match_far_outside_the_image() {
    let folder = tempdir().unwrap();
    let csv = "image_a,image_b,xa,ya,xb,yb\na,b,10,10,12,11\na,b,4000,30,410,35\na,b,90,300,99,310\n";
    let csv = write(folder.path(), "matches.csv", csv);
    let words = ["matches.csv line 3", "4000", "far outside an image of 640x480 pixels", "--image-size"];
    refused(&[&csv, "--image-size", "640x480"], INPUT, &words);
}

#[test]
fn pairs_that_name_an_unknown_image() {
    let folder = tempdir().unwrap();
    let pairs = write(folder.path(), "pairs.csv", "image_a,image_b\n00a.jpg,00b.jpg\n00a.jpg,77z.jpg\n");
    let words = ["pairs.csv line 3", "77z.jpg is none of the 4 images", "00a.jpg, 00b.jpg, 01a.jpg, 01b.jpg"];
    refused(&args(&TRIPOD_TWO_PAIRS, &["--pairs", &pairs]), INPUT, &words);
}

#[test]
fn pairs_of_one_image_or_given_twice() {
    let folder = tempdir().unwrap();
    let with = |rows: &str, words: &[&str]| {
        let pairs = write(folder.path(), "pairs.csv", format!("image_a,image_b\n{rows}"));
        refused(&args(&TRIPOD_TWO_PAIRS, &["--pairs", &pairs]), INPUT, words);
    };
    with("00a,00b\n01b,01b\n", &["pairs.csv line 3", "01b.jpg with itself", "Name two images"]);
    with("00a,00b\n01a,01b\n00b,00a\n", &["pairs.csv line 4", "00b.jpg and 00a.jpg", "line 2", "Remove one"]);
    with("", &["pairs.csv", "no rows"]);
}

// ---- Exit code 2: wrong usage.

#[test]
fn unknown_option() {
    refused(&args(&TRIPOD_PAIR, &["--nonsense"]), USAGE, &["--nonsense", "--help"]);
}

#[test]
fn csv_without_image_size() {
    let folder = tempdir().unwrap();
    let csv = write(folder.path(), "matches.csv", "image_a,image_b,xa,ya,xb,yb\na,b,10,10,12,11\n");
    refused(&[&csv], USAGE, &["matches.csv", "--image-size WxH"]);
}

#[test]
fn image_size_that_is_none() {
    let folder = tempdir().unwrap();
    let csv = write(folder.path(), "matches.csv", "image_a,image_b,xa,ya,xb,yb\na,b,10,10,12,11\n");
    refused(&[&csv, "--image-size", "640by480"], USAGE, &["640by480", "--image-size", "1280x960"]);
    refused(&[&csv, "--image-size", "640x0"], USAGE, &["640x0", "whole numbers from 2 to 100000"]);
}

#[test]
fn options_out_of_range() {
    let with = |more: &[&str], words: &[&str]| refused(&args(&TRIPOD_PAIR, more), USAGE, words);
    with(&["--aspect", "-3"], &["-3", "aspect"]);
    with(&["--aspect", "30"], &["aspect ratio 30", "between 0.1 and 10"]);
    with(&["--attitude-sigma-deg", "50"], &["attitude sigma 50", "between 0 and 20"]);
    with(&["--k1", "nan"], &["distortion k1 NaN", "finite"]);
    with(&["--principal-point", "9e9,1"], &["principal point (9000000000, 1)", "800x600"]);
    with(&["--image-size", "800x600"], &["--image-size", "images have their own"]);
}

#[test]
fn out_that_is_a_file() {
    let folder = tempdir().unwrap();
    let taken = write(folder.path(), "taken", "precious");
    let outcome = calibrate(&args(&TRIPOD_PAIR, &["--constraint", "focal", "--out", &taken]));
    assert_eq!(outcome.code, USAGE, "{}", outcome.stderr);
    for word in [&*taken, "is a file", "name a folder"] {
        assert!(outcome.stderr.contains(word), "{word}: {}", outcome.stderr);
    }
    assert!(outcome.stdout.contains("\"wrong_usage\""), "{}", outcome.stdout);
    assert_eq!(std::fs::read_to_string(folder.path().join("taken")).unwrap(), "precious");
}

#[test]
fn csv_together_with_images() {
    let folder = tempdir().unwrap();
    let csv = write(folder.path(), "matches.csv", "image_a,image_b,xa,ya,xb,yb\na,b,10,10,12,11\n");
    refused(&[&csv, &at(TRIPOD_PAIR[0])], USAGE, &["CSV", "alone"]);
}

// ---- Exit code 1: the surroundings.

#[test]
fn out_that_cannot_be_made() {
    let folder = tempdir().unwrap();
    write(folder.path(), "taken", "precious");
    let out = text(&folder.path().join("taken/result"));
    let outcome = calibrate(&args(&TRIPOD_PAIR, &["--constraint", "focal", "--out", &out]));
    assert_eq!(outcome.code, 1, "{}", outcome.stderr);
    assert!(outcome.stdout.contains("\"failed\""), "{}", outcome.stdout);
    assert!(outcome.stderr.contains("cannot make the folder") && outcome.stderr.contains(&out), "{}", outcome.stderr);
}

#[test]
fn out_that_cannot_be_written_is_noticed_first() {
    let folder = tempdir().unwrap();
    let file = write(folder.path(), "file", "x");
    // The input does not exist either: the folder is asked about before it is looked for.
    let run = groundcal(&["calibrate", "nowhere", "--out", &format!("{file}/sub/folder")]);
    assert!(run.code == 1 && run.stderr.contains("file is a file"), "{} {}", run.code, run.stderr);
    // A folder in which even the superuser can make nothing.
    if Path::new("/proc/sys").is_dir() {
        let run = groundcal(&["calibrate", "nowhere", "--out", "/proc/sys/new"]);
        assert!(run.code == 1 && run.stderr.contains("cannot write into /proc/sys"), "{} {}", run.code, run.stderr);
    }
    let new = folder.path().join("new");
    assert_eq!(groundcal(&["calibrate", "nowhere", "--out", &text(&new)]).code, INPUT);
    assert!(!new.exists(), "asking makes nothing");
}

// ---- Exit code 0: a camera.

/// The example set calibrated once for several tests: standard output, and the files of `--out` with their content.
struct TripodRun {
    stdout: String,
    json: Value,
    files: Vec<(String, String)>,
}

fn tripod() -> &'static TripodRun {
    static RUN: OnceLock<TripodRun> = OnceLock::new();
    RUN.get_or_init(|| {
        let folder = tempdir().unwrap();
        let out = folder.path().join("new/result");
        let outcome = calibrate(&args(&["examples/tripod"], &["--constraint", "zero-skew", "--out", &text(&out)]));
        let json = outcome.json();
        let read = |name: String| {
            let content = std::fs::read_to_string(out.join(&name)).unwrap();
            (name, content)
        };
        let files = results_in(&out).into_iter().map(read).collect();
        TripodRun { stdout: outcome.stdout, json, files }
    })
}

#[test]
fn tripod_example_gives_the_true_camera_from_the_six_motions() {
    let json = &tripod().json;
    assert_eq!(used(json), a_b_pairs(6), "the motions found");
    let truth = read_json(Path::new(&at("examples/tripod/truth.json")));
    let f = number(&truth, "/fx");
    for (parameter, tolerance) in [("fx", 0.005 * f), ("fy", 0.005 * f), ("cx", 6.0), ("cy", 6.0)] {
        close(json, &truth, parameter, tolerance);
        let error = number(json, &format!("/camera/{parameter}")) - number(&truth, &format!("/{parameter}"));
        let sigma = number(json, &format!("/standard_deviation/{parameter}"));
        assert!(error.abs() < 4.0 * sigma, "{parameter} is off by {error:.2}, the error bar is {sigma:.2}");
    }
    // Turns and attitudes against the truth of the views.
    let views = truth["views"].as_array().unwrap();
    for (i, motion) in json["motions"].as_array().unwrap().iter().filter(|m| m["used"] == true).enumerate() {
        let turn = number(&views[2 * i + 1], "/yaw_deg") - number(&views[2 * i], "/yaw_deg");
        let turn = (turn + 180.0).rem_euclid(360.0) - 180.0;
        let found = number(motion, "/rotation_deg");
        assert!((found - turn).abs() < 0.5, "motion {i}: turn {found}, truth {turn}");
        assert!(
            (number(motion, "/height_ratio") - 1.0).abs() < 0.01,
            "motion {i}: height_ratio {}",
            motion["height_ratio"]
        );
        let attitude = &json["attitudes"][motion["attitude"].as_u64().unwrap() as usize];
        for angle in ["/pitch_down_deg", "/roll_deg"] {
            let (found, wanted) = (number(attitude, angle), number(&views[2 * i], angle));
            assert!((found - wanted).abs() < 1.0, "motion {i}: {angle} {found}, truth {wanted}");
        }
    }
}

#[test]
fn json_has_the_documented_keys() {
    let json = &tripod().json;
    let has = |value: &Value, keys: &[&str]| {
        let object = value.as_object().unwrap_or_else(|| panic!("{value} is not an object"));
        for key in keys {
            assert!(object.contains_key(*key), "{key} is missing in {value:#}");
        }
    };
    has(json, &["camera", "standard_deviation", "constraint", "motions", "warnings"]);
    has(&json["camera"], &["image_size", "fx", "fy", "cx", "cy", "skew", "distortion"]);
    has(&json["camera"]["distortion"], &["model", "k1", "k2", "p1", "p2"]);
    has(&json["standard_deviation"], &["fx", "fy", "cx", "cy", "skew", "k1", "k2"]);
    for motion in json["motions"].as_array().unwrap() {
        has(motion, &["from", "to", "used", "rotation_deg", "height_ratio", "matches", "rms_px", "reason"]);
        assert_eq!(motion["reason"].is_null(), motion["used"] == true, "a reason for what is left out: {motion}");
    }
    assert_eq!(json["motions"].as_array().unwrap().len(), 66, "every pair of 12 images");
    for warning in json["warnings"].as_array().unwrap() {
        has(warning, &["code", "message"]);
    }
    assert_eq!(json["camera"]["image_size"], serde_json::json!([800, 600]));
    assert_eq!(json["constraint"], "zero-skew");
    assert_eq!(json["camera"]["skew"], 0.0);
    assert!(json["standard_deviation"]["skew"].is_null(), "held");
}

#[test]
fn out_holds_every_format_and_the_same_json() {
    let run = tripod();
    let names: BTreeSet<&str> = run.files.iter().map(|f| f.0.as_str()).collect();
    let expected = [
        "calibration.json",
        "camchain.yaml",
        "camera_info.yaml",
        "camera_matlab.csv",
        "camera_opencv.yaml",
        "cameras.txt",
        "images.txt",
        "points3D.txt",
        "report.html",
        "transforms.json",
    ];
    assert_eq!(names, BTreeSet::from(expected));
    let content = |name: &str| &run.files.iter().find(|f| f.0 == name).unwrap().1;
    assert_eq!(content("calibration.json"), &run.stdout);
    let yaml = content("camera_opencv.yaml");
    assert!(yaml.starts_with("%YAML:1.0\n---\n"), "{yaml}");
    let matrix = yaml.split("camera_matrix").nth(1).and_then(|t| t.split('[').nth(1)).and_then(|t| t.split(']').next());
    let matrix: Vec<f64> = matrix.unwrap().split(',').map(|v| v.trim().parse().unwrap()).collect();
    let [fx, fy, cx, cy] = ["fx", "fy", "cx", "cy"].map(|p| number(&run.json, &format!("/camera/{p}")));
    assert_eq!(matrix, [fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0]);
}

#[test]
fn same_bytes_for_any_number_of_threads_and_again() {
    for threads in ["1", "2"] {
        let again = calibrate(&args(&["examples/tripod"], &["--constraint", "zero-skew", "--threads", threads]));
        assert_eq!(again.code, 0, "{}", again.stderr);
        assert!(again.stdout == tripod().stdout, "--threads {threads} changes the result");
    }
}

#[test]
fn order_of_the_files_hardly_matters() {
    let mut files: Vec<String> =
        a_b_pairs(6).iter().flat_map(|(a, b)| [a, b].map(|f| format!("examples/tripod/{f}"))).collect();
    files.reverse();
    files.swap(1, 8);
    let files: Vec<&str> = files.iter().map(String::as_str).collect();
    let json = calibrate(&args(&files, &["--constraint", "zero-skew"])).json();
    let sorted = |json: &Value| {
        let order = |(a, b): (String, String)| if a < b { (a, b) } else { (b, a) };
        used(json).into_iter().map(order).collect::<BTreeSet<_>>()
    };
    assert_eq!(sorted(&json), sorted(&tripod().json));
    for parameter in ["fx", "fy", "cx", "cy"] {
        let [here, there] = [&json, &tripod().json].map(|j| number(j, &format!("/camera/{parameter}")));
        let sigma = number(&tripod().json, &format!("/standard_deviation/{parameter}"));
        println!("{parameter}: {here} in another order, {there}; sd {sigma}");
        // The first image of a pair has the grid of patches: in the other order it is other patches, with noise of their own,
        // of the same two pictures.
        assert!((here - there).abs() < sigma, "{parameter}: {here} in another order, {there} +- {sigma}");
    }
}

#[test]
fn head_example_gives_the_focal_length() {
    let json = calibrate(&args(&["examples/head"], &["--constraint", "square"])).json();
    let truth = read_json(Path::new(&at("examples/head/truth.json")));
    close(&json, &truth, "fx", 0.015 * number(&truth, "/fx"));
    assert_eq!(json["camera"]["fx"], json["camera"]["fy"]);
    let found = used(&json);
    for pair in a_b_pairs(5) {
        assert!(found.contains(&pair), "{pair:?} is not among {found:?}");
    }
}

#[test]
fn quoted_pattern_is_expanded() {
    let pattern = at("examples/tripod/0[01][ab].jpg");
    let json = calibrate(&[&pattern, "--constraint", "square"]).json();
    assert_eq!(used(&json), a_b_pairs(2));
    assert_eq!(json["motions"].as_array().unwrap().len(), 6, "every pair of 4 images");
}

#[test]
fn motions_are_looked_for_among_the_pairs_given() {
    let folder = tempdir().unwrap();
    // By name and by the name's stem; the second the other way round.
    let pairs = write(folder.path(), "pairs.csv", "image_a,image_b\n00a.jpg,00b.jpg\n01b,01a\n");
    let json = calibrate(&args(&TRIPOD_TWO_PAIRS, &["--constraint", "square", "--pairs", &pairs])).json();
    let name = |s: &str| s.to_string();
    assert_eq!(used(&json), [(name("00a.jpg"), name("00b.jpg")), (name("01b.jpg"), name("01a.jpg"))]);
    assert_eq!(json["motions"].as_array().unwrap().len(), 6, "named first, then the others, which link attitudes");
}

#[test]
fn summary_has_the_parameters_and_the_warning_about_distortion() {
    let mut all = args(&TRIPOD_PAIR, &["--constraint", "focal", "--distortion", "none", "--verbose"]);
    all.insert(0, "calibrate".into());
    let outcome = groundcal(&all);
    assert_eq!(outcome.code, 0, "{}", outcome.stderr);
    let page = &outcome.stdout;
    let words_of = |line: &str| line.split_whitespace().map(str::to_string).collect::<Vec<_>>();
    for parameter in ["fx", "fy", "cx", "cy", "skew"] {
        let row = page.lines().map(words_of).find(|w| w.first().is_some_and(|w| w == parameter));
        let row = row.unwrap_or_else(|| panic!("no row {parameter} in\n{page}"));
        assert!(row[1].parse::<f64>().is_ok(), "{row:?}");
        let held = ["cx", "cy", "skew"].contains(&parameter);
        assert!(if held { row[2] == "held" } else { row[2].parse::<f64>().is_ok_and(|s| s > 0.0) }, "{row:?}");
    }
    assert!(page.contains("00a.jpg") && page.contains("00b.jpg"), "the motion");
    let warning =
        page.split("warning [distortion_not_modelled]").nth(1).unwrap_or_else(|| panic!("no warning in\n{page}"));
    let words = words_of(warning.split("warning [").next().unwrap());
    let percent =
        words.windows(2).find(|w| w[1].starts_with('%')).unwrap_or_else(|| panic!("no percentage in {words:?}"));
    assert!(percent[0].parse::<f64>().is_ok_and(|p| p != 0.0), "{percent:?}");
    assert!(words.iter().any(|w| w == "--k1"), "the remedy: {words:?}");
    assert!(page.lines().all(|l| l.chars().count() <= 120), "lines fit a terminal");
}

#[test]
fn matches_and_tracks_of_the_same_points_give_the_same_camera() {
    let mut scene = PointScene::nominal(5);
    scene.sigma_px = 0.5;
    let folder = tempdir().unwrap();
    let run = |name: &str, csv: String| {
        let csv = write(folder.path(), name, csv);
        calibrate(&[&csv, "--image-size", "1280x960", "--constraint", "zero-skew"]).json()
    };
    let backwards = |csv: String| {
        let (header, rows) = csv.split_once('\n').unwrap();
        let rows: Vec<&str> = rows.lines().rev().collect();
        format!("{header}\n{}\n", rows.join("\n"))
    };
    let matches = run("matches.csv", matches_csv(&scene));
    let tracks = run("tracks.csv", tracks_csv(&scene));
    assert_eq!(used(&matches).len(), 3);
    assert_eq!(tracks, matches, "tracks");
    assert_eq!(run("tracks_backwards.csv", backwards(tracks_csv(&scene))), matches, "the order of tracks is not read");
    let matches_backwards = run("matches_backwards.csv", backwards(matches_csv(&scene)));
    for (parameter, truth) in [("fx", 1000.0), ("fy", 1000.0), ("cx", 649.5), ("cy", 469.5)] {
        let [here, there] = [&matches, &matches_backwards].map(|j| number(j, &format!("/camera/{parameter}")));
        let sigma = number(&matches, &format!("/standard_deviation/{parameter}"));
        println!("{parameter}: {here}, {there} from the rows backwards, truth {truth}, sd {sigma}");
        assert!((here - truth).abs() < 4.0 * sigma, "{parameter}: {here} +- {sigma}, truth {truth}");
        assert!((here - there).abs() < 0.3 * sigma, "{parameter}: {here} +- {sigma}, {there} from the rows backwards");
    }
}

#[test]
fn many_matches_take_no_more_iterations_than_few() {
    let mut scene = PointScene::nominal(6);
    scene.motions.truncate(2);
    scene.matches = 50_000;
    let folder = tempdir().unwrap();
    let csv = write(folder.path(), "matches.csv", matches_csv(&scene));
    let json = calibrate(&[
        &csv,
        "--image-size",
        "1280x960",
        "--constraint",
        "square",
        "--attitude-sigma-deg",
        "0",
        "--distortion",
        "none",
    ])
    .json();
    // What an iteration costs is measured by the benchmark `stages`.
    let iterations = number(&json, "/fit/refinement/iterations");
    println!("{iterations} iterations for 100,000 matches");
    assert!(iterations <= 30.0, "{iterations} iterations");
    assert_eq!(used(&json).len(), 2);
    let (f, sigma) = (number(&json, "/camera/fx"), number(&json, "/standard_deviation/fx"));
    println!("f {f} +- {sigma}");
    assert!((f - 1000.0).abs() < 4.0 * sigma && sigma < 1.0, "f {f} +- {sigma}");
}

// ---- Kinds of images.

/// Two views, 480x360, of a motion with 25 degrees of turn, square pixels, f = 430.
fn rendered() -> &'static [RgbImage; 2] {
    static PAIR: OnceLock<[RgbImage; 2]> = OnceLock::new();
    PAIR.get_or_init(|| {
        let view = |file: &str, yaw_deg: f64, centre_m: [f64; 3]| View {
            file: file.into(),
            yaw_deg,
            centre_m,
            pitch_error_deg: 0.0,
            roll_error_deg: 0.0,
            exposure: 1.0,
        };
        let views = vec![view("a.png", 0.0, [0.0, 0.0, 1.4]), view("b.png", 25.0, [0.05, -0.15, 1.4])];
        let group = Group { pitch_down_deg: 50.0, roll_deg: 0.0, views };
        let mut scene = Scene::new(Camera::centred([480, 360], 430.0), vec![group]);
        scene.floor.scale_m = Some(0.08);
        let renderer = Renderer::new(&scene).unwrap();
        [0, 1].map(|i| {
            let RgbImage8 { size, data } = renderer.render(i).unwrap();
            RgbImage::from_raw(size.width as u32, size.height as u32, data).unwrap()
        })
    })
}

fn encoded(image: &DynamicImage, format: ImageFormat) -> Vec<u8> {
    let mut bytes = std::io::Cursor::new(Vec::new());
    image.write_to(&mut bytes, format).unwrap();
    bytes.into_inner()
}

/// The calibration of the rendered pair, its images made into files by `make`.
fn calibrated_as(extension: &str, make: impl Fn(&RgbImage) -> Vec<u8>) -> Value {
    let folder = tempdir().unwrap();
    for (image, name) in rendered().iter().zip(["a", "b"]) {
        write(folder.path(), &format!("{name}.{extension}"), make(image));
    }
    calibrate(&[&text(folder.path()), "--constraint", "focal"]).json()
}

/// The calibration of the pair as ordinary PNG files.
fn reference() -> &'static Value {
    static JSON: OnceLock<Value> = OnceLock::new();
    JSON.get_or_init(|| {
        let json = calibrated_as("png", |i| encoded(&DynamicImage::ImageRgb8(i.clone()), ImageFormat::Png));
        let (f, sigma) = (number(&json, "/camera/fx"), number(&json, "/standard_deviation/fx"));
        println!("f {f} +- {sigma}, truth 430");
        assert!((f - 430.0).abs() < 4.0 * sigma && sigma < 0.03 * f, "f {f} +- {sigma}, truth 430");
        json
    })
}

fn relative_change_of_f(json: &Value) -> f64 {
    let change = number(json, "/camera/fx") / number(reference(), "/camera/fx") - 1.0;
    println!("f changes by {change:.1e}");
    change.abs()
}

#[test]
fn lossless_formats_of_the_same_pixels_give_the_same_camera() {
    for (extension, format) in [("tiff", ImageFormat::Tiff), ("tif", ImageFormat::Tiff), ("webp", ImageFormat::WebP)] {
        let json = calibrated_as(extension, |i| encoded(&DynamicImage::ImageRgb8(i.clone()), format));
        assert!(relative_change_of_f(&json) < 1e-6, "{extension}");
    }
    let json = calibrated_as("jpg", |i| encoded(&DynamicImage::ImageRgb8(i.clone()), ImageFormat::Png));
    assert!(relative_change_of_f(&json) < 1e-6, "PNG under another name: the content counts");
}

#[test]
fn alpha_is_ignored() {
    let json = calibrated_as("png", |i| {
        let mut with_alpha = DynamicImage::ImageRgb8(i.clone()).into_rgba8();
        with_alpha.pixels_mut().for_each(|p| p.0[3] = 128);
        encoded(&DynamicImage::ImageRgba8(with_alpha), ImageFormat::Png)
    });
    assert!(relative_change_of_f(&json) < 1e-6);
}

#[test]
fn sixteen_bits_give_the_same_camera() {
    let wide = |i: &RgbImage| DynamicImage::ImageRgb16(DynamicImage::ImageRgb8(i.clone()).into_rgb16());
    let json = calibrated_as("png", |i| encoded(&wide(i), ImageFormat::Png));
    assert!(relative_change_of_f(&json) < 1e-3);
    let json = calibrated_as("tif", |i| encoded(&wide(i), ImageFormat::Tiff));
    assert!(relative_change_of_f(&json) < 1e-3);
}

#[test]
fn grey_gives_the_same_camera() {
    let json = calibrated_as("png", |i| {
        encoded(&DynamicImage::ImageLuma8(DynamicImage::ImageRgb8(i.clone()).into_luma8()), ImageFormat::Png)
    });
    assert!(relative_change_of_f(&json) < 1e-3);
}

#[test]
fn jpeg_gives_nearly_the_same_camera() {
    let json = calibrated_as("JPG", jpeg);
    assert!(relative_change_of_f(&json) < 0.01);
}

fn jpeg(image: &RgbImage) -> Vec<u8> {
    let mut bytes = Vec::new();
    image::codecs::jpeg::JpegEncoder::new_with_quality(&mut bytes, 95).encode_image(image).unwrap();
    bytes
}

/// The JPEG with an Exif segment that holds nothing but the orientation.
fn with_orientation(jpeg: &[u8], orientation: u8) -> Vec<u8> {
    let mut exif = b"Exif\0\0MM\0\x2a\0\0\0\x08".to_vec();
    // One entry: tag 0x0112, a short, one of it; then no further directory.
    exif.extend([0, 1, 0x01, 0x12, 0, 3, 0, 0, 0, 1, 0, orientation, 0, 0, 0, 0, 0, 0]);
    let length = (exif.len() as u16 + 2).to_be_bytes();
    [&jpeg[..2], &[0xff, 0xe1], &length, &exif, &jpeg[2..]].concat()
}

#[test]
fn exif_orientation_is_honoured() {
    // Orientation 6: to be shown turned by 90 degrees clockwise, so stored turned by 90 degrees anticlockwise.
    for (orientation, clockwise) in [(6, false), (8, true)] {
        let json = calibrated_as("jpg", |upright| {
            let stored =
                if clockwise { image::imageops::rotate90(upright) } else { image::imageops::rotate270(upright) };
            assert_eq!(stored.dimensions(), (360, 480));
            with_orientation(&jpeg(&stored), orientation)
        });
        assert_eq!(json["camera"]["image_size"], serde_json::json!([480, 360]));
        assert!(relative_change_of_f(&json) < 0.01);
        for angle in ["/attitudes/0/roll_deg", "/attitudes/0/pitch_down_deg", "/motions/0/rotation_deg"] {
            let (found, wanted) = (number(&json, angle), number(reference(), angle));
            assert!((found - wanted).abs() < 0.5, "orientation {orientation}: {angle} {found}, upright {wanted}");
        }
    }
    assert!(number(reference(), "/attitudes/0/roll_deg").abs() < 1.0, "the reference itself is upright");
}

// ---- Rendering.

const SCENE: &str = r#"
[camera]
image_size = [64, 48]
fx = 50
[sensor]
samples_per_pixel = 1
[[group]]
pitch_down_deg = 50
[[group.view]]
file = "a.png"
yaw_deg = 0
centre_m = [0, 0, 1.5]
[[group.view]]
file = "b.jpg"
yaw_deg = 20
centre_m = [0.1, 0, 1.5]
"#;

#[test]
fn render_writes_pictures_and_truth() {
    let folder = tempdir().unwrap();
    let scene = write(folder.path(), "scene.toml", SCENE);
    let out = folder.path().join("rendered");
    let outcome = groundcal(&["render", &scene, "--out", &text(&out)]);
    let written = format!("written to {}: a.png, b.jpg, truth.json\n", text(&out));
    assert_eq!((outcome.code, outcome.stdout.as_str(), outcome.stderr.as_str()), (0, "", written.as_str()));
    assert_eq!(results_in(&out), ["a.png", "b.jpg", "truth.json"].map(String::from).into());
    assert_eq!(number(&read_json(&out.join("truth.json")), "/fx"), 50.0);
}

#[test]
fn render_refuses_a_bad_scene() {
    let folder = tempdir().unwrap();
    let out = folder.path().join("rendered");
    let cases = [
        (SCENE.replace("fx = 50", "fx = -1"), vec!["camera.fx = -1", "must be positive"]),
        (SCENE.replace("fx = 50", "focal = 50"), vec!["not a scene file", "focal", "line 4"]),
        ("no scene at all".to_string(), vec!["not a scene file", "line 1"]),
    ];
    for (scene, words) in cases {
        let scene = write(folder.path(), "scene.toml", scene);
        let outcome = groundcal(&["render", &scene, "--out", &text(&out)]);
        assert_eq!(outcome.code, INPUT, "{}", outcome.stderr);
        for word in ["error: ", "scene.toml"].iter().chain(&words) {
            assert!(outcome.stderr.contains(word), "\"{word}\" is missing in: {}", outcome.stderr);
        }
        assert_eq!(outcome.stdout, "");
        assert!(!out.exists(), "nothing is written");
    }
    let absent = text(&folder.path().join("absent.toml"));
    let outcome = groundcal(&["render", &absent, "--out", &text(&out)]);
    assert!(outcome.code == INPUT && outcome.stderr.contains("absent.toml"), "{}", outcome.stderr);
}

// ---- Lens distortion.

#[test]
fn a_wide_lens_is_estimated_with_the_camera() {
    let scene: Scene = toml::from_str(
        &std::fs::read_to_string(root().join("examples/tripod/scene.toml"))
            .unwrap()
            .replace("fx = 705", "fx = 500\nk1 = -0.2\nk2 = 0.035"),
    )
    .unwrap();
    let folder = tempdir().unwrap();
    let renderer = Renderer::new(&scene).unwrap();
    // Four attitudes of the six are enough.
    for (i, (_, view)) in scene.views().enumerate().take(8) {
        let picture = renderer.render(i).unwrap();
        let (w, h) = (picture.size.width as u32, picture.size.height as u32);
        RgbImage::from_raw(w, h, picture.data).unwrap().save(folder.path().join(&view.file)).unwrap();
    }
    let json = calibrate(&[&text(folder.path())]).json();
    println!("{}", json["camera"]);
    for (parameter, truth, tolerance) in
        [("fx", 500.0, 0.0005 * 500.0), ("fy", 500.0, 0.0005 * 500.0), ("cx", 409.5, 0.8), ("cy", 291.0, 0.8)]
    {
        let (found, sigma) = (
            number(&json, &format!("/camera/{parameter}")),
            number(&json, &format!("/standard_deviation/{parameter}")),
        );
        assert!((found - truth).abs() < tolerance, "{parameter}: {found} +- {sigma}");
        assert!((found - truth).abs() < 4.0 * sigma, "{parameter}: {found} +- {sigma}");
    }
    assert!((number(&json, "/camera/distortion/k1") + 0.2).abs() < 0.001);
    assert_eq!(json["camera"]["distortion"]["source"], "estimated");
}

#[test]
fn method_lens_and_priors_can_be_chosen() {
    let linear = calibrate(&args(&["examples/tripod"], &["--method", "linear"])).json();
    assert_eq!(linear["method"], "linear");
    assert!(linear["scene"].is_null() && linear["views"].as_array().is_some_and(Vec::is_empty));
    let joint = &tripod().json;
    assert_eq!((&joint["method"], &joint["scene"]), (&Value::from("joint"), &Value::from("floor")));
    assert!(number(joint, "/standard_deviation/fx") < number(&linear, "/standard_deviation/fx"), "joint is sharper");
    // A prior far off and stiff pulls, and is reported with what the images made of it.
    let given =
        args(&["examples/tripod"], &["--prior", "cx=419.5+-0.001", "--prior", "k2=0+-0.01", "--distortion", "k1k2"]);
    let pulled = calibrate(&given).json();
    close_to(number(&pulled, "/camera/cx"), 419.5, 0.1);
    let prior = |json: &Value, name: &str| {
        json["priors"].as_array().unwrap().iter().find(|p| p["parameter"] == name).cloned().unwrap_or_default()
    };
    assert!(number(&prior(&pulled, "cx"), "/posterior_over_prior") > 0.9);
    close_to(number(&prior(&pulled, "k2"), "/sigma"), 0.01, 1e-12);
    let k1 = calibrate(&args(&["examples/tripod"], &["--distortion", "k1"])).json();
    assert_eq!(k1["camera"]["distortion"]["k2"], 0.0);
    assert!(k1["standard_deviation"]["k2"].is_null() && number(&k1, "/standard_deviation/k1") > 0.0);
}

#[test]
fn priors_that_make_no_sense_are_refused() {
    for (prior, constraint, code, word) in [
        ("cx", "auto", 2, "NAME=VALUE+-SIGMA"),
        ("width=3+-1", "auto", 2, "none of fx"),
        ("cx=3+-x", "auto", 2, "NAME=VALUE+-SIGMA"),
        ("cx=300+-0", "auto", 2, "positive"),
        ("fx=-5+-1", "auto", 2, "positive"),
        ("cx=300+-5", "focal", 2, "holds"),
    ] {
        let outcome = calibrate(&args(&["examples/tripod"], &["--prior", prior, "--constraint", constraint]));
        assert_eq!(outcome.code, code, "{prior}: {}", outcome.stderr);
        assert!(outcome.stderr.contains(word), "{prior}: {}", outcome.stderr);
    }
}

fn close_to(value: f64, expected: f64, tolerance: f64) {
    assert!((value - expected).abs() <= tolerance, "{value}, {expected} expected");
}
