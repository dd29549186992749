//! Masks, and what stands still in all images.

use std::{
    path::Path,
    sync::{Mutex, OnceLock},
};

use groundcal::{
    Observer, Options, Silent, calibrate_images, calibrate_matched_images, match_images,
    pairs::ImagePair,
    result::{Calibration, Warning},
};
use groundcal_io::images::read_images;
use groundcal_lab::renderer::{
    render::{Renderer, RgbImage8},
    scene::{Camera, Group, Scene, View},
};
use image::{GrayImage, Luma, RgbImage};
use serde_json::Value;
use tempfile::{TempDir, tempdir};

use crate::common::*;

const WIDTH: u32 = 480;
const HEIGHT: u32 = 360;
const F: f64 = 430.0;

/// Three attitudes, two views of each.
fn rendered() -> &'static [RgbImage] {
    static VIEWS: OnceLock<Vec<RgbImage>> = OnceLock::new();
    VIEWS.get_or_init(|| {
        let view = |file: String, yaw_deg: f64, centre_m: [f64; 3]| View {
            file,
            yaw_deg,
            centre_m,
            pitch_error_deg: 0.0,
            roll_error_deg: 0.0,
            exposure: 1.0,
        };
        let group = |i: usize, pitch_down_deg: f64, roll_deg: f64| {
            let x = 0.7 * i as f64;
            let turn = 25.0 + 4.0 * i as f64;
            let views = vec![
                view(format!("{i}a.png"), 20.0 * i as f64, [x, 0.0, 1.4]),
                view(format!("{i}b.png"), 20.0 * i as f64 + turn, [x + 0.05, -0.15, 1.4]),
            ];
            Group { pitch_down_deg, roll_deg, views }
        };
        let groups = vec![group(0, 50.0, 0.0), group(1, 58.0, -28.0), group(2, 44.0, 26.0)];
        let mut scene = Scene::new(Camera::centred([WIDTH as usize, HEIGHT as usize], F), groups);
        scene.floor.scale_m = Some(0.08);
        scene.sensor.noise_sigma_gl = 1.0;
        let renderer = Renderer::new(&scene).unwrap();
        let picture = |i: usize| {
            let RgbImage8 { size, data } = renderer.render(i).unwrap();
            RgbImage::from_raw(size.width as u32, size.height as u32, data).unwrap()
        };
        (0..scene.view_count()).map(picture).collect()
    })
}

/// The views, with something painted over all of them where `is_still` says.
fn painted(folder: &Path, is_still: impl Fn(u32, u32) -> bool) {
    // Squares of 4 pixels of any grey.
    let tone = |x: u32, y: u32| {
        let mixed = (x / 4).wrapping_mul(2_654_435_761) ^ (y / 4).wrapping_mul(2_246_822_519);
        (mixed.wrapping_mul(3_266_489_917) >> 24) as u8
    };
    for (i, image) in rendered().iter().enumerate() {
        let mut image = image.clone();
        for (x, y, pixel) in image.enumerate_pixels_mut() {
            if is_still(x, y) {
                // A grey value of noise, another in every picture.
                let noise = ((x * 31 + y * 17 + i as u32 * 101).wrapping_mul(2_654_435_761) >> 30) as u8;
                pixel.0 = [tone(x, y).saturating_add(noise); 3];
            }
        }
        image.save(folder.join(format!("{}{}.png", i / 2, ["a", "b"][i % 2]))).unwrap();
    }
}

fn set(is_still: impl Fn(u32, u32) -> bool) -> TempDir {
    let folder = tempdir().unwrap();
    painted(folder.path(), is_still);
    folder
}

/// The three motions are found, and no more than chance lies between the answer and the truth.
fn is_right(json: &Value) {
    println!("{:?}", warnings(json));
    for (parameter, truth) in
        [("fx", F), ("fy", F), ("cx", f64::from(WIDTH - 1) / 2.0), ("cy", f64::from(HEIGHT - 1) / 2.0)]
    {
        let found = number(json, &format!("/camera/{parameter}"));
        let sigma = number(json, &format!("/standard_deviation/{parameter}"));
        println!("{parameter} {found:.2} +- {sigma:.2}, truth {truth}");
        assert!(
            (found - truth).abs() < 4.0 * sigma && sigma < 0.03 * F,
            "{parameter} {found} +- {sigma}, truth {truth}"
        );
    }
    let name = |i: usize, view: &str| format!("{i}{view}.png");
    for i in 0..3 {
        assert!(used(json).contains(&(name(i, "a"), name(i, "b"))), "{:?}", used(json));
    }
}

fn still_percent(json: &Value) -> f64 {
    let all = json["warnings"].as_array().unwrap();
    let still: Vec<&Value> = all.iter().filter(|w| w["code"] == "still_in_all_images").collect();
    assert_eq!(still.len(), 1, "one warning: {all:#?}");
    assert!(!warnings(json).contains(&"static_background"), "not pair by pair: {all:#?}");
    number(still[0], "/numbers/percent")
}

#[test]
fn a_bumper_in_all_images_is_one_warning_and_the_floor_is_matched() {
    let folder = set(|_, y| y >= 260);
    let json = calibrate(&[&text(folder.path())]).json();
    is_right(&json);
    let percent = still_percent(&json);
    assert!((percent - 100.0 * 100.0 / 360.0).abs() < 5.0, "{percent}");
}

#[test]
fn a_background_that_stands_still_about_what_turns_is_one_warning() {
    // The floor is seen in a quarter of the picture.
    let folder = set(|x, y| !(120..360).contains(&x) || !(140..320).contains(&y));
    let json = calibrate(&[&text(folder.path())]).json();
    is_right(&json);
    let percent = still_percent(&json);
    assert!((percent - 75.0).abs() < 5.0, "{percent}");
}

#[test]
fn where_nothing_stands_still_nothing_is_said_and_a_white_mask_changes_nothing() {
    let folder = set(|_, _| false);
    let json = calibrate(&[&text(folder.path())]).json();
    is_right(&json);
    assert!(!warnings(&json).contains(&"still_in_all_images"));
    let masks = tempdir().unwrap();
    let white = masks.path().join("white.png");
    GrayImage::from_pixel(WIDTH, HEIGHT, Luma([255])).save(&white).unwrap();
    let masked = calibrate(&[&text(folder.path()), "--mask", &text(&white)]).json();
    assert_eq!(masked["camera"], json["camera"]);
    assert_eq!(masked["covariance"], json["covariance"]);
}

#[test]
fn a_mask_takes_away_what_it_holds_black_in_one_file_or_in_one_for_each_image() {
    let folder = set(|_, y| y >= 260);
    let masks = tempdir().unwrap();
    // Of 0 and 1, as some programs write them.
    let mask = GrayImage::from_fn(WIDTH, HEIGHT, |_, y| Luma([u8::from(y < 256)]));
    let one = masks.path().join("one.png");
    mask.save(&one).unwrap();
    let of_file = calibrate(&[&text(folder.path()), "--mask", &text(&one)]).json();
    is_right(&of_file);
    assert!(!warnings(&of_file).contains(&"still_in_all_images"), "{:?}", warnings(&of_file));
    let each = masks.path().join("each");
    std::fs::create_dir(&each).unwrap();
    for name in ["0a", "0b", "1a", "1b", "2a"] {
        std::fs::copy(&one, each.join(format!("{name}.png"))).unwrap();
    }
    let arguments = [text(folder.path()), "--mask".into(), text(&each)];
    refused(&arguments, 4, &["folder of masks", "none for 1 of 6 images: 2b.png", "a.png"]);
    std::fs::copy(&one, each.join("2b.png.png")).unwrap();
    let of_folder = calibrate(&arguments).json();
    assert_eq!(of_folder["camera"], of_file["camera"]);
    mask.save(each.join("0a.tiff")).unwrap();
    refused(&arguments, 4, &["two or more for 1 of 6 images: 0a.png"]);
    let black = masks.path().join("black.png");
    GrayImage::new(WIDTH, HEIGHT).save(&black).unwrap();
    refused(&[text(folder.path()), "--mask".into(), text(&black)], 4, &["black.png", "without white"]);
}

/// Remembers what it is told.
#[derive(Default)]
struct Listener(Mutex<Vec<Warning>>);

impl Observer for Listener {
    fn notice(&self, warning: &Warning) {
        self.0.lock().unwrap().push(warning.clone());
    }
}

#[test]
fn the_library_sets_it_aside_whatever_enters() {
    let folder = set(|_, y| y >= 260);
    let names = ["0a", "0b", "1a", "1b", "2a", "2b"].map(|n| format!("{n}.png"));
    let files: Vec<_> = names.iter().map(|n| folder.path().join(n)).collect();
    let images = read_images(&files).unwrap().images;
    let options = Options { pairs: Some(vec![(0, 1), (2, 3), (4, 5)]), ..Options::default() };
    let listener = Listener::default();
    let of_images = calibrate_images(&names, &images, &options, &listener).unwrap();
    let still: Vec<&Warning> =
        of_images.warnings.iter().filter(|w| matches!(w, Warning::StillInAllImages { .. })).collect();
    assert_eq!(listener.0.lock().unwrap().iter().collect::<Vec<_>>(), still);
    assert_eq!(still.len(), 1);
    // Matches of whole images: those of the bumper are more than those of the floor, and are not used.
    let pair = |&(from, to): &(usize, usize)| {
        // Of two images nothing is set aside.
        let two = [from, to].map(|i| images[i].clone());
        let found = match_images(&two, &[(0, 1)], &options, &Silent).unwrap().remove(0);
        ImagePair { from, to, ..found }
    };
    let pairs: Vec<ImagePair> = options.pairs.iter().flatten().map(pair).collect();
    let of_matches = calibrate_matched_images(&names, &images, &pairs, &options, &Silent).unwrap();
    let lost = |c: &Calibration| c.warnings.iter().any(|w| matches!(w, Warning::StaticBackground { .. }));
    for c in [&of_images, &of_matches] {
        assert!(!lost(c), "{:?}", c.warnings);
        let (f, sigma) = (c.camera.model().intrinsics.fx, c.standard_deviation.fx.unwrap());
        println!("fx {f:.2} +- {sigma:.2}, truth {F}");
        assert!((f - F).abs() < 4.0 * sigma && sigma < 0.03 * F, "{f} +- {sigma}");
    }
}

/// What is held before a fixed camera turns about an axis that varies, and the background that tells so is no longer among the matches.
#[test]
fn a_single_motion_before_a_still_background_may_stray() {
    let folder = set(|x, y| !(60..420).contains(&x) || !(60..340).contains(&y));
    let pairs = folder.path().join("pairs.csv");
    std::fs::write(&pairs, "image_a,image_b\n0a.png,0b.png\n").unwrap();
    let images: Vec<String> = ["0a", "0b", "1a"].map(|n| text(&folder.path().join(format!("{n}.png")))).into();
    let calibrated = |more: &[&str]| {
        let mut arguments = images.clone();
        arguments.extend(["--pairs".into(), text(&pairs), "--constraint".into(), "focal".into()]);
        arguments.extend(more.iter().map(ToString::to_string));
        calibrate(&arguments).json()
    };
    let json = calibrated(&[]);
    still_percent(&json);
    assert_eq!(number(&json, "/attitude_sigma_deg"), 1.5);
    assert_eq!(number(&calibrated(&["--attitude-sigma-deg", "0.2"]), "/attitude_sigma_deg"), 0.2);
}

/// The error names it too, for who reads JSON alone.
#[test]
fn what_stands_still_and_damaged_images_are_in_the_error() {
    let folder = set(|_, y| y >= 260);
    // One motion for five unknowns, a third picture cut.
    let of = |name: &str| folder.path().join(name);
    let jpeg = of("2a.jpg");
    image::open(of("2a.png")).unwrap().save(&jpeg).unwrap();
    let mut bytes = std::fs::read(&jpeg).unwrap();
    bytes.truncate(bytes.len() * 9 / 10);
    bytes.extend([0xff, 0xd9]);
    std::fs::write(&jpeg, bytes).unwrap();
    let pairs = of("pairs.csv");
    std::fs::write(&pairs, "image_a,image_b\n0a.png,0b.png\n").unwrap();
    let images = [of("0a.png"), of("0b.png"), jpeg].map(|path| text(&path));
    let options = ["--constraint", "full", "--pairs", &text(&pairs)].map(String::from);
    let run = calibrate(&[images.as_slice(), &options].concat());
    assert_eq!(run.code, 3, "{}", run.stderr);
    let error: Value = serde_json::from_str(&run.stdout).unwrap();
    let notes = error["error"]["notes"].as_array().unwrap();
    let codes: Vec<&str> = notes.iter().map(|n| n["code"].as_str().unwrap()).collect();
    assert_eq!(codes, ["damaged_image", "still_in_all_images"], "{error:#}");
    // Standard error has the same words, each once, before the error.
    for note in notes {
        let message = format!("note: {}\n", note["message"].as_str().unwrap());
        assert_eq!(run.stderr.matches(&message).count(), 1, "{message}: {}", run.stderr);
    }
    assert!(run.stderr.lines().last().unwrap().starts_with("error: "), "{}", run.stderr);
}
