//! What is given mutated inputs: each reader with what is usually done with what was read, and calibrations from matches.
//!
//! A target answers what it read in a few words, or with the message of its error. Where the program promises something (what is
//! written is read back), it panics if the promise is broken.

#![allow(clippy::panic)] // a broken promise is a finding, as a panic is

use std::path::Path;

use groundcal::{
    LensModel, Method, Options, Plain, Silent, calibrate_matches,
    floor::{Fit, FloorLayout, FloorView, Undistortion, Up, placed, sets_of_one_world},
    geometry::{Camera, ImageSize, camera_difference},
    plan::PlanRequest,
    result::Calibration,
    start::Constraint,
};
use groundcal_io::{
    export,
    images::{read_image_bytes, stated_focal_length_mm},
    import::{groundcal_json, read_camera},
    matches::{PairChoice, PointPairs, read_matches, read_pairs},
    text::message,
};
use groundcal_lab::{render_scene, renderer::render::Renderer};

/// Size of the images of tables.
const SIZE: ImageSize = ImageSize { width: 1280, height: 960 };
/// Images, pairs and matches of the largest calibration that is tried.
const MAX_IMAGES: usize = 10;
const MAX_PAIRS: usize = 8;
const MAX_MATCHES: usize = 400;

/// A target.
pub(crate) struct Target {
    pub(crate) name: &'static str,
    /// The input's name as a file.
    pub(crate) file_name: &'static str,
    pub(crate) is_text: bool,
    pub(crate) run: fn(&Path) -> Result<String, String>,
}

/// All of them.
pub(crate) const TARGETS: [Target; 8] = [
    Target { name: "images", file_name: "input.png", is_text: false, run: images },
    Target { name: "exif", file_name: "input.jpg", is_text: false, run: exif },
    Target { name: "cameras", file_name: "input.yaml", is_text: true, run: cameras },
    Target { name: "calibrations", file_name: "input.json", is_text: true, run: calibrations },
    Target { name: "tables", file_name: "input.csv", is_text: true, run: tables },
    Target { name: "pairs", file_name: "input.csv", is_text: true, run: pairs },
    Target { name: "scenes", file_name: "input.toml", is_text: true, run: scenes },
    Target { name: "calibrate", file_name: "input.csv", is_text: true, run: calibrate },
];

fn bytes(path: &Path) -> Result<Vec<u8>, String> {
    std::fs::read(path).map_err(|e| e.to_string())
}

/// JPEG, PNG, TIFF, WebP.
fn images(path: &Path) -> Result<String, String> {
    let image = read_image_bytes(path, &bytes(path)?).map_err(|e| e.to_string())?;
    assert!(image.data().iter().all(|v| v.is_finite()), "a value that is not finite");
    Ok(format!("{} x {}", image.size().width > image.size().height, image.data().len() > 1000))
}

/// The focal length that JPEG, PNG, TIFF, WebP and HEIC state.
fn exif(path: &Path) -> Result<String, String> {
    let file = bytes(path)?;
    let kinds: [(&[u8], &str); 6] = [
        (b"\xff\xd8", "JPEG"),
        (b"\x89PNG", "PNG"),
        (b"II", "TIFF"),
        (b"MM", "TIFF of Motorola"),
        (b"RIFF", "WebP"),
        (b"", "other"),
    ];
    let kind = kinds.iter().find(|(start, _)| file.starts_with(start)).map_or("", |(_, kind)| kind);
    match stated_focal_length_mm(file, ImageSize::new(40, 30)) {
        Some(mm) => {
            assert!((5..=3000).contains(&mm), "{mm} mm");
            Ok(format!("{kind} stated"))
        }
        None => Ok(format!("{kind} none")),
    }
}

/// Cameras in any format, then what `convert`, `undistort` and `compare` do with them.
fn cameras(path: &Path) -> Result<String, String> {
    let imported = read_camera(path).map_err(|e| e.to_string())?;
    let size = imported.size.unwrap_or(SIZE);
    let camera = Camera { size, intrinsics: imported.intrinsics, lens: imported.lens };
    let mut text = format!("{} {} {:?}", imported.format, imported.lens.name(), imported.notes);
    match export::render_camera(&camera, &[]) {
        Ok(files) => text += &format!(" {}", files.files.len()),
        Err(e) => text += &format!(" {e}"),
    }
    for fit in [Fit::Same, Fit::All, Fit::Crop, Fit::FieldOfView { horizontal_rad: 1.5 }] {
        match Undistortion::new(&camera, fit) {
            Ok(straight) => text += &format!(" {}", straight.source_pixel(&nalgebra_point(size)).is_some()),
            Err(e) => text += &format!(" {e}"),
        }
    }
    let moved = Camera {
        intrinsics: groundcal::geometry::Intrinsics { fx: 1.01 * camera.intrinsics.fx, ..camera.intrinsics },
        ..camera
    };
    match camera_difference(&camera, &moved) {
        Ok(difference) => text += &format!(" {}", difference.rms_px.is_finite()),
        Err(e) => text += &format!(" {e}"),
    }
    Ok(text)
}

/// A pixel of an image.
fn nalgebra_point(size: ImageSize) -> nalgebra::Vector2<f64> {
    nalgebra::Vector2::new(0.25 * size.width as f64, 0.75 * size.height as f64)
}

/// calibration.json, then what `rectify`, `plan` and the formats do with it.
fn calibrations(path: &Path) -> Result<String, String> {
    let c = groundcal_json::read(path).map_err(|e| e.to_string())?;
    written_is_read(&c);
    let mut text = format!("{} views {} motions", c.views.len().min(3), c.motions.len().min(3));
    let _ = export::render(&c, &[]).map_err(|e| text += &format!(" {e}"));
    // Of one motion: what the calibration says of its camera is checked before.
    let _ = PlanRequest { motions: Some(1), ..PlanRequest::default() }
        .report(Some(&c), &Plain)
        .map_err(|e| text += &format!(" {e:?}"));
    match placed(&c, 1.0) {
        Err(e) => text += &format!(" {e}"),
        Ok(placed) => {
            let layout = FloorLayout { size: c.camera.model().size, max_distance: 5.0, up: Up::Heading };
            let worlds: Vec<Option<&str>> = placed.iter().map(|p| p.origin.as_deref()).collect();
            let sets: Vec<Vec<&FloorView>> = sets_of_one_world(&worlds)
                .into_iter()
                .map(|s| s.into_iter().map(|i| &placed[i].view).collect())
                .collect();
            match layout.resolution(&sets, None) {
                Ok(chosen) => {
                    let grid = sets.first().and_then(|set| layout.grid(set, chosen.px_per_unit));
                    text += &format!(" floor {}", grid.is_some());
                }
                Err(e) => text += &format!(" {e:?}"),
            }
        }
    }
    Ok(text)
}

/// Matches and tracks.
fn tables(path: &Path) -> Result<String, String> {
    let found = read(path)?;
    assert!(found.pairs.iter().all(|p| p.from < found.names.len() && p.to < found.names.len() && p.from != p.to));
    Ok(format!("{} pairs {:?}", found.pairs.len().min(3), found.notes))
}

fn read(path: &Path) -> Result<PointPairs, String> {
    read_matches(path, SIZE, PairChoice::Near { all_pairs_limit: 40 }).map_err(|e| e.to_string())
}

/// Lists of pairs.
fn pairs(path: &Path) -> Result<String, String> {
    let names = ["a.jpg", "b.jpg", "x/c.jpg", "y/c.jpg", "d.png"].map(String::from);
    let found = read_pairs(path, &names).map_err(|e| e.to_string())?;
    assert!(found.iter().all(|(a, b)| a != b && a.max(b) < &names.len()));
    Ok(format!("{} pairs", found.len()))
}

/// Scene files, prepared for rendering where that is soon done.
fn scenes(path: &Path) -> Result<String, String> {
    let text = String::from_utf8(bytes(path)?).map_err(|_| "no text")?;
    let scene = render_scene::parse(&text).map_err(|(line, what)| format!("line {}: {what}", line.unwrap_or(0)))?;
    scene.validate().map_err(|e| message(&e.to_string()))?;
    let few = scene.boxes.random.as_ref().is_none_or(|r| r.count < 30);
    let small = scene.camera.image_size.iter().product::<usize>() < 10_000 && scene.sensor.samples_per_pixel < 5;
    if !(few && small) {
        return Ok("a large scene".into());
    }
    let renderer = Renderer::new(&scene).map_err(|e| e.to_string())?;
    let picture = renderer.render(0).map_err(|e| e.to_string())?;
    Ok(format!("{} views, {}", scene.view_count().min(3), picture.data.iter().any(|v| *v != picture.data[0])))
}

/// What is written is read back, and is the same calibration.
fn written_is_read(c: &Calibration) {
    let written = match export::json(c, &Plain) {
        Ok(text) => text,
        Err(e) => panic!("a calibration that cannot be written: {e}"),
    };
    match groundcal_json::parse(&written) {
        Ok(again) => {
            let twice = export::json(&again, &Plain).unwrap_or_default();
            // As values: a zero may lose its sign.
            let value = |text: &str| serde_json::from_str::<serde_json::Value>(text).ok();
            assert!(value(&twice) == value(&written), "what is read back differs from what was written");
        }
        Err(e) => panic!("what was written is not read: {e}"),
    }
}

/// From matches to a camera, with options that follow from the input.
fn calibrate(path: &Path) -> Result<String, String> {
    let found = read(path)?;
    let matches: usize = found.pairs.iter().map(|p| p.matches.len()).sum();
    if found.names.len() > MAX_IMAGES || found.pairs.len() > MAX_PAIRS || matches > MAX_MATCHES {
        return Err("larger than is tried".into());
    }
    // Any sum of the input tells options apart.
    let choice = bytes(path)?.iter().fold(7u64, |h, b| h.wrapping_mul(0x100_0000_01b3) ^ u64::from(*b)) >> 7;
    let options = Options {
        constraint: Constraint::ALL[choice as usize % Constraint::ALL.len()],
        method: [Method::Joint, Method::Kzr, Method::Linear, Method::Rotating][choice as usize / 6 % 4],
        lens: [LensModel::K1K2, LensModel::K1, LensModel::None][choice as usize / 24 % 3],
        pairs: (choice / 72 % 4 == 0).then(|| found.pairs.iter().map(|p| (p.from, p.to)).collect()),
        attitude_sigma_deg: (choice / 288 % 4 == 0).then_some(0.0),
        ..Options::default()
    };
    match calibrate_matches(&found.names, SIZE, &found.pairs, &options, &Silent) {
        Ok(c) => {
            if let Err(what) = groundcal_json::check(&c) {
                panic!("a calibration that is none: {what}");
            }
            written_is_read(&c);
            let warnings: Vec<&str> = c.warnings.iter().map(|w| w.code()).collect();
            Ok(format!("{:?} {:?} {warnings:?}", c.method, c.scene))
        }
        Err(e) => Err(e.to_string()),
    }
}
