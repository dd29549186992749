//! Error bars against truth, on rendered sets of pictures drawn at random:
//! `cargo bench -p groundcal-lab --bench rendered_sets [-- --general --sets N --only I --seed S --keep DIR]`.
//!
//! Each set has a floor, a camera, a lens, attitudes, motions, a sensor and a file format of its own, all drawn from a
//! seed. It is calibrated with default options, and under zero skew too where three attitudes or more differ in roll; with `--general` it is 4 to 15 pictures
//! taken by hand of one place of the floor, each with tilt and height of its own, calibrated with `--motion general`. One
//! line a calibration. z is error over stated standard deviation. Ends with code 1 where 2 % or more of the intrinsics
//! (fx, fy, cx, cy) lie more than three standard deviations off, or there was nothing to judge.

#![allow(clippy::expect_used)] // a test or benchmark may end in a panic

use std::{io::Cursor, path::PathBuf, process::ExitCode, time::Instant};

use groundcal::{
    MotionModel, Options, Silent, calibrate_images,
    geometry::{ImageSize, rotation_cam_from_world},
    numerics::median,
    result::{Calibration, Parameter},
    start::Constraint,
    vision::GrayImage,
};
use groundcal_lab::renderer::{
    render::{Renderer, RgbImage8},
    scene::{Backdrop, Camera, Floor, Group, Light, RandomBoxes, Scene, Sensor, Sky, TextureKind, View},
};
use image::{ExtendedColorType, ImageEncoder, ImageFormat, codecs::jpeg::JpegEncoder};
use nalgebra::{Vector2, Vector3};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use rayon::prelude::*;

const USAGE: &str = "options: --general (pictures by hand), --sets N (36), --only I (one set, in detail), --seed S (1), --keep DIR (keep the pictures)";
const TEXTURES: [TextureKind; 6] = [
    TextureKind::Tiles,
    TextureKind::Carpet,
    TextureKind::Terrazzo,
    TextureKind::Concrete,
    TextureKind::Wood,
    TextureKind::Asphalt,
];
const SIZES: [[usize; 2]; 5] = [[640, 480], [800, 600], [960, 640], [960, 720], [1024, 768]];
const MAX_VIEWS: usize = 14;
/// Attitudes nearer to one another than this are one attitude to a person, and no separate views of the floor.
const MIN_BETWEEN_ATTITUDES_DEG: f64 = 6.0;
/// From this spread of roll on, zero skew is asked for as well.
const MIN_ROLL_SPREAD_DEG: f64 = 15.0;
/// Least slope of distorted over ideal radius in the image: a lens that compresses more is near its fold.
const MIN_LENS_SLOPE: f64 = 0.3;
/// Floor further away than this shows nothing to match.
const FARTHEST_IN_HEIGHTS: f64 = 8.0;
/// Goal: fewer than this fraction of the intrinsics more than `OUTSIDE_Z` standard deviations off.
const GOAL_OUTSIDE: f64 = 0.02;
const OUTSIDE_Z: f64 = 3.0;

struct Arguments {
    general: bool,
    sets: u64,
    only: Option<u64>,
    seed: u64,
    keep: Option<PathBuf>,
}

/// `None`: not started by `cargo bench`, which passes `--bench` on.
fn arguments() -> Result<Option<Arguments>, String> {
    let mut found = Arguments { general: false, sets: 36, only: None, seed: 1, keep: None };
    let mut bench = false;
    let mut words = std::env::args().skip(1);
    while let Some(word) = words.next() {
        let mut value = || words.next().ok_or(format!("{word} needs a value; {USAGE}"));
        let number = |text: String| text.parse::<u64>().map_err(|_| format!("{text} is no number; {USAGE}"));
        match word.as_str() {
            "--bench" => bench = true,
            "--general" => found.general = true,
            "--sets" => found.sets = number(value()?)?,
            "--only" => found.only = Some(number(value()?)?),
            "--seed" => found.seed = number(value()?)?,
            "--keep" => found.keep = Some(value()?.into()),
            _ => return Err(format!("unknown option {word}; {USAGE}")),
        }
    }
    Ok(bench.then_some(found))
}

/// A lens whose image does not fold over, and its k1 and k2.
fn draw_lens(rng: &mut Pcg64Mcg, camera: &Camera) -> (f64, f64) {
    if rng.random_bool(0.2) {
        return (0.0, 0.0);
    }
    let k = camera.intrinsics();
    let [w, h] = camera.image_size.map(|n| (n - 1) as f64);
    let farthest = [[0.0, 0.0], [w, 0.0], [0.0, h], [w, h]]
        .map(|[x, y]| k.normalised_from_pixel(&Vector2::new(x, y)).norm())
        .into_iter()
        .fold(0.0, f64::max);
    loop {
        let k1 = rng.random_range(-0.3..0.1);
        let k2 = rng.random_range(0.0..1.0) * k1 * k1;
        let monotonic = || {
            let mut r = 0.0_f64;
            while r * (1.0 + r * r * (k1 + k2 * r * r)) < farthest {
                if 1.0 + r * r * (3.0 * k1 + 5.0 * k2 * r * r) < MIN_LENS_SLOPE {
                    return false;
                }
                r += 0.01;
            }
            true
        };
        if monotonic() {
            return (k1, k2);
        }
    }
}

/// Attitudes (pitch, roll) in degrees, apart from one another.
fn draw_attitudes(rng: &mut Pcg64Mcg) -> Vec<[f64; 2]> {
    let elevation_only = rng.random_bool(0.2);
    let count = if elevation_only { rng.random_range(2..=4) } else { rng.random_range(1..=7) };
    let level_deg = if rng.random_bool(0.5) { 0.0 } else { rng.random_range(-10.0..10.0) };
    let mut attitudes: Vec<[f64; 2]> = Vec::new();
    while attitudes.len() < count {
        let roll = if elevation_only { level_deg } else { rng.random_range(-45.0..45.0) };
        let new = [rng.random_range(25.0..65.0), roll];
        let up =
            |a: &[f64; 2]| rotation_cam_from_world(a[0].to_radians(), a[1].to_radians(), 0.0).column(2).into_owned();
        if attitudes.iter().all(|a| up(a).angle(&up(&new)).to_degrees() > MIN_BETWEEN_ATTITUDES_DEG) {
            attitudes.push(new);
        }
    }
    attitudes
}

/// Views of one attitude that turn about a vertical axis through `axis_m`, and may stand off it.
fn draw_views(
    rng: &mut Pcg64Mcg,
    group: usize,
    count: usize,
    axis_m: [f64; 2],
    height_m: f64,
    yaw_deg: f64,
) -> Vec<View> {
    let offset_m = rng.random_range(0.0..1.0) * height_m;
    let bearing_deg: f64 = rng.random_range(0.0..360.0);
    let sign = if rng.random_bool(0.5) { 1.0 } else { -1.0 };
    let mut turned_deg = 0.0;
    (0..count)
        .map(|i| {
            if i > 0 {
                turned_deg += sign * rng.random_range(10.0..60.0);
            }
            let (s, c) = (bearing_deg + turned_deg).to_radians().sin_cos();
            View {
                file: format!("{group:02}{}.jpg", char::from(b'a' + i as u8)),
                yaw_deg: yaw_deg + turned_deg,
                centre_m: [axis_m[0] + offset_m * c, axis_m[1] + offset_m * s, height_m],
                pitch_error_deg: 0.0,
                roll_error_deg: 0.0,
                exposure: rng.random_range(0.7_f64.ln()..1.3_f64.ln()).exp(),
            }
        })
        .collect()
}

/// The part of the near floor seen by view `a` that view `b` sees too, and the part of `a` that sees near floor.
fn overlap(scene: &Scene, a: usize, b: usize) -> (f64, f64) {
    let camera = scene.camera.model();
    let [pa, pb] = [a, b].map(|i| scene.pose(i).expect("a view"));
    let size = scene.camera.size();
    let (mut pixels, mut floor, mut shared) = (0.0, 0.0, 0.0);
    for y in (0..size.height).step_by(size.height / 24) {
        for x in (0..size.width).step_by(size.width / 32) {
            pixels += 1.0;
            let Some(ray) = camera.unproject(&Vector2::new(x as f64, y as f64)) else { continue };
            let ray = pa.r_cam_from_world.transpose() * ray;
            let reach = -pa.centre_m.z / ray.z;
            if !(ray.z < 0.0 && reach * ray.xy().norm() < FARTHEST_IN_HEIGHTS * pa.centre_m.z) {
                continue;
            }
            floor += 1.0;
            let q = pb.r_cam_from_world * (pa.centre_m + ray * reach - pb.centre_m);
            let inside = |pixel: Vector2<f64>| {
                (0.0..size.width as f64 - 1.0).contains(&pixel.x) && (0.0..size.height as f64 - 1.0).contains(&pixel.y)
            };
            if camera.project(&q).is_some_and(inside) {
                shared += 1.0;
            }
        }
    }
    (if floor > 0.0 { shared / floor } else { 0.0 }, floor / pixels)
}

/// Whether each two neighbours share half of the floor they see, and each view sees floor in more than half of it.
fn is_fair(camera: &Camera, group: &Group) -> bool {
    let scene = Scene::new(camera.clone(), vec![group.clone()]);
    (1..group.views.len())
        .flat_map(|i| [(i - 1, i), (i, i - 1)])
        .map(|(a, b)| overlap(&scene, a, b))
        .all(|(shared, floor)| shared >= 0.5 && floor >= 0.5)
}

fn draw_camera(rng: &mut Pcg64Mcg) -> Camera {
    let image_size = SIZES[rng.random_range(0..SIZES.len())];
    let [w, h] = image_size.map(|n| n as f64);
    let fx = w * rng.random_range(0.6_f64.ln()..1.5_f64.ln()).exp();
    let mut off_centre_px = || rng.random_range(-0.02..0.02) * w;
    let mut camera = Camera::centred(image_size, fx);
    camera.cx = Some(0.5 * (w - 1.0) + off_centre_px());
    camera.cy = Some(0.5 * (h - 1.0) + off_centre_px());
    camera.fy = Some(fx * (1.0 + rng.random_range(-0.002..0.002)));
    (camera.k1, camera.k2) = draw_lens(rng, &camera);
    camera
}

/// Pictures by hand of the floor about the world's origin: tilts up to 20 to 60 degrees from straight down, to all sides, the camera turned about its axis
/// by up to 60 degrees, at 0.7 to 1.4 of one distance. Each sees half of what an earlier one does.
fn draw_by_hand(rng: &mut Pcg64Mcg, camera: &Camera) -> Vec<Group> {
    let count = rng.random_range(4..=15);
    let most_tilted_deg = rng.random_range(20.0..60.0);
    let distance_m = rng.random_range(0.8..2.0);
    let mut groups: Vec<Group> = Vec::new();
    while groups.len() < count {
        let tilt_deg: f64 = rng.random_range(0.0..most_tilted_deg);
        let (roll_deg, yaw_deg) = (rng.random_range(-60.0..60.0), rng.random_range(0.0..360.0_f64));
        let distance_m = distance_m * rng.random_range(0.7_f64.ln()..1.4_f64.ln()).exp();
        let seen_m = [0, 1].map(|_| rng.random_range(-0.1..0.1) * distance_m);
        let (level_m, height_m) = (distance_m * tilt_deg.to_radians().sin(), distance_m * tilt_deg.to_radians().cos());
        let (sin, cos) = yaw_deg.to_radians().sin_cos();
        let view = View {
            file: format!("{:02}.jpg", groups.len()),
            yaw_deg,
            centre_m: [seen_m[0] - level_m * cos, seen_m[1] - level_m * sin, height_m],
            pitch_error_deg: 0.0,
            roll_error_deg: 0.0,
            exposure: rng.random_range(0.7_f64.ln()..1.3_f64.ln()).exp(),
        };
        groups.push(Group { pitch_down_deg: 90.0 - tilt_deg, roll_deg, views: vec![view] });
        let scene = Scene::new(camera.clone(), groups.clone());
        let last = groups.len() - 1;
        let is_joined = last == 0
            || (0..last).any(|earlier| {
                let both = [overlap(&scene, earlier, last), overlap(&scene, last, earlier)];
                both.iter().all(|(shared, floor)| *shared >= 0.5 && *floor >= 0.5)
            });
        if !is_joined {
            groups.pop();
        }
    }
    groups
}

fn draw(seed: u64, set: u64, general: bool) -> Scene {
    let rng = &mut Pcg64Mcg::seed_from_u64(seed.wrapping_mul(1_000_003).wrapping_add(set));
    let camera = draw_camera(rng);
    if general {
        let groups = draw_by_hand(rng, &camera);
        return surrounded(rng, Scene::new(camera, groups), set);
    }
    let attitudes = draw_attitudes(rng);
    let height_m = rng.random_range(0.8..2.0);
    // A tripod or a head stays where it is, a robot wanders.
    let wanders = rng.random_bool(0.5);
    let heading_deg = rng.random_range(0.0..360.0);
    let mut left = MAX_VIEWS;
    let mut groups: Vec<Group> = Vec::new();
    for (g, [pitch_down_deg, roll_deg]) in attitudes.iter().copied().enumerate() {
        let after = attitudes.len() - g - 1;
        let count = if left >= 2 * after + 3 && rng.random_bool(0.3) { 3 } else { 2 };
        left -= count;
        groups.push(loop {
            let (axis_m, yaw_deg) = if wanders {
                let place_m = [0, 1].map(|_| rng.random_range(-1.5..1.5) * height_m);
                (place_m, rng.random_range(0.0..360.0))
            } else {
                ([0.0; 2], heading_deg + rng.random_range(-30.0..30.0))
            };
            let views = draw_views(rng, g, count, axis_m, height_m, yaw_deg);
            let group = Group { pitch_down_deg, roll_deg, views };
            if is_fair(&camera, &group) {
                break group;
            }
        });
    }

    surrounded(rng, Scene::new(camera, groups), set)
}

/// With floor, light, sky, sensor and boxes.
fn surrounded(rng: &mut Pcg64Mcg, mut scene: Scene, set: u64) -> Scene {
    let height_m = scene.groups[0].views[0].centre_m[2];
    scene.seed = rng.random();
    let texture = TEXTURES[(set % TEXTURES.len() as u64) as usize];
    scene.floor = Floor { texture, yaw_deg: rng.random_range(0.0..360.0), seed: rng.random(), ..Floor::default() };
    scene.light = Light {
        azimuth_deg: rng.random_range(0.0..360.0),
        elevation_deg: rng.random_range(30.0..80.0),
        ..Light::default()
    };
    let backdrop = [Backdrop::None, Backdrop::Clouds, Backdrop::Skyline][rng.random_range(0..3)];
    scene.sky = Sky { backdrop, seed: rng.random(), ..Sky::default() };
    scene.sensor = Sensor {
        // Fewer samples than for a picture to look at: what they leave of aliasing is below the noise.
        samples_per_pixel: 9,
        noise_sigma_gl: rng.random_range(0.5..3.0),
        blur_sigma_px: rng.random_range(0.0..1.2),
        jpeg_quality: rng.random_range(60..=98),
        ..Sensor::default()
    };
    let count = rng.random_range(0..=6);
    let reach_m = 3.0 * height_m;
    scene.boxes.random = Some(RandomBoxes {
        count,
        extent_m: [-reach_m, reach_m, -reach_m, reach_m],
        side_m: [0.12, 0.4],
        height_m: [0.08, 0.35],
        seed: rng.random(),
    });
    if scene.all_boxes().is_err() {
        scene.boxes.random = None;
    }
    scene
}

fn roll_spread_deg(scene: &Scene) -> f64 {
    let rolls = || scene.groups.iter().map(|g| g.roll_deg);
    rolls().fold(f64::MIN, f64::max) - rolls().fold(f64::MAX, f64::min)
}

fn describe(scene: &Scene) -> String {
    let c = &scene.camera;
    let s = &scene.sensor;
    let views: String = scene.groups.iter().map(|g| g.views.len().to_string()).collect::<Vec<_>>().join("+");
    format!(
        "{:<8} {:>4}x{:<3} f {:.2}w k1 {:+.3} k2 {:.3} views {:<13} roll {:>2.0} noise {:.1} q {} blur {:.1} {:<8}",
        format!("{:?}", scene.floor.texture).to_lowercase(),
        c.image_size[0],
        c.image_size[1],
        c.fx / c.image_size[0] as f64,
        c.k1,
        c.k2,
        views,
        roll_spread_deg(scene),
        s.noise_sigma_gl,
        s.jpeg_quality,
        s.blur_sigma_px,
        match scene.sky.backdrop {
            Backdrop::None => "",
            Backdrop::Clouds => "clouds",
            Backdrop::Skyline => "skyline",
        },
    )
}

/// The pictures as a user's program reads them: compressed, and opened again.
fn pictures(scene: &Scene, keep: Option<&PathBuf>) -> Vec<GrayImage> {
    let renderer = Renderer::new(scene).expect("a scene within its bounds");
    let views: Vec<&View> = scene.views().map(|(_, v)| v).collect();
    let images = views.par_iter().enumerate().map(|(index, view)| {
        let picture = renderer.render(index).expect("a picture");
        let (width, height) = (picture.size.width as u32, picture.size.height as u32);
        let mut file = Vec::new();
        JpegEncoder::new_with_quality(Cursor::new(&mut file), scene.sensor.jpeg_quality)
            .write_image(&picture.data, width, height, ExtendedColorType::Rgb8)
            .expect("a JPEG file");
        if let Some(folder) = keep {
            std::fs::write(folder.join(&view.file), &file).expect("a folder to write to");
        }
        let opened = image::load_from_memory_with_format(&file, ImageFormat::Jpeg).expect("a JPEG file").into_rgb8();
        let size = ImageSize::new(opened.width() as usize, opened.height() as usize);
        RgbImage8 { size, data: opened.into_raw() }.to_gray()
    });
    let images = images.collect();
    if let Some(folder) = keep {
        let truth = serde_json::to_string_pretty(&scene.truth()).expect("JSON");
        std::fs::write(folder.join("truth.json"), truth).expect("a folder to write to");
    }
    images
}

/// Whether each picture has an attitude of its own.
fn is_by_hand(scene: &Scene) -> bool {
    scene.groups.iter().all(|g| g.views.len() == 1)
}

/// Error over stated standard deviation; `None` where it is held.
fn z(found: f64, truth: f64, sigma: Option<f64>) -> Option<f64> {
    sigma.filter(|&s| s > 0.0).map(|s| (found - truth) / s)
}

fn column(z: Option<f64>) -> String {
    z.map_or("   --".into(), |z| format!("{z:+5.1}"))
}

/// What all calibrations under one constraint come to.
#[derive(Default)]
struct Tally {
    /// z of fx, fy, cx, cy, one list each; and of k1.
    z: [Vec<f64>; 4],
    k1_z: Vec<f64>,
    /// |error of fx| and stated standard deviation, in percent.
    f_error_percent: Vec<f64>,
    f_sigma_percent: Vec<f64>,
    refused: usize,
    false_motions: usize,
}

impl Tally {
    fn add(&mut self, other: Tally) {
        for (mine, theirs) in self.z.iter_mut().zip(other.z) {
            mine.extend(theirs);
        }
        self.k1_z.extend(other.k1_z);
        self.f_error_percent.extend(other.f_error_percent);
        self.f_sigma_percent.extend(other.f_sigma_percent);
        self.refused += other.refused;
        self.false_motions += other.false_motions;
    }

    fn judged(&self) -> usize {
        self.z.iter().map(Vec::len).sum()
    }

    fn fraction_outside(&self) -> f64 {
        let outside = self.z.iter().flatten().filter(|z| z.abs() > OUTSIDE_Z).count();
        outside as f64 / self.judged() as f64
    }

    fn print(&self, name: &str) {
        let judged: Vec<f64> = self.z.iter().flatten().copied().collect();
        let each = self.z.each_ref().map(|z| rms(z));
        println!(
            "{name:<9} {:>4} intrinsics judged, |z| > 3: {:>4.1} %, rms z {:.2} (fx {:.2}, fy {:.2}, cx {:.2}, cy {:.2}; k1 {:.2}), \
             median |z| {:.2}; f: median |error| {:.3} %, median sigma {:.3} %; refused {}, false motions {}",
            judged.len(),
            100.0 * self.fraction_outside(),
            rms(&judged),
            each[0],
            each[1],
            each[2],
            each[3],
            rms(&self.k1_z),
            median(&mut judged.iter().map(|z| z.abs()).collect::<Vec<_>>()),
            median(&mut self.f_error_percent.clone()),
            median(&mut self.f_sigma_percent.clone()),
            self.refused,
            self.false_motions,
        );
    }
}

fn rms(values: &[f64]) -> f64 {
    (values.iter().map(|v| v * v).sum::<f64>() / values.len() as f64).sqrt()
}

/// Compares a calibration with the truth, prints its line and returns what it adds to the tally.
fn judge(scene: &Scene, result: &Calibration, label: &str, seconds: f64, in_detail: bool) -> Tally {
    let (c, sd) = (&result.camera, &result.standard_deviation);
    let truth = scene.camera.intrinsics();
    let zs = [z(c.fx, truth.fx, sd.fx), z(c.fy, truth.fy, sd.fy), z(c.cx, truth.cx, sd.cx), z(c.cy, truth.cy, sd.cy)];
    let k1_z = z(result.value(Parameter::K1), scene.camera.k1, sd.k1);
    let group_of = |name: &str| scene.views().find(|(_, v)| v.file == name).map(|(g, _)| g);
    let by_hand = is_by_hand(scene);
    let is_false = |from: &str, to: &str| !by_hand && group_of(from) != group_of(to);
    let used = || result.motions.iter().filter(|m| m.used);
    let false_motions: Vec<String> =
        used().filter(|m| is_false(&m.from, &m.to)).map(|m| format!("{}-{}", m.from, m.to)).collect();
    let error_percent = 100.0 * (c.fx / truth.fx - 1.0);
    let warnings: Vec<&str> = result.warnings.iter().map(|w| w.code()).collect();
    println!(
        "{label} f {error_percent:+7.3} %  z fx {} fy {} cx {} cy {} k1 {}  {:>2} motions{}  {seconds:4.1} s  {}",
        column(zs[0]),
        column(zs[1]),
        column(zs[2]),
        column(zs[3]),
        column(k1_z),
        used().count(),
        if false_motions.is_empty() { String::new() } else { format!(", FALSE {}", false_motions.join(" ")) },
        warnings.join(" "),
    );
    if in_detail {
        detail(scene, result, &group_of);
    }
    Tally {
        z: zs.map(|z| z.into_iter().collect()),
        k1_z: k1_z.into_iter().collect(),
        f_error_percent: vec![error_percent.abs()],
        f_sigma_percent: sd.fx.map(|s| 100.0 * s / truth.fx).into_iter().collect(),
        refused: 0,
        false_motions: false_motions.len(),
    }
}

/// The attitudes, the parameters with their truth and the motions, one line each.
fn detail(scene: &Scene, result: &Calibration, group_of: &dyn Fn(&str) -> Option<usize>) {
    let (c, sd) = (&result.camera, &result.standard_deviation);
    let truth = scene.camera.intrinsics();
    let sigma = |s: Option<f64>| s.map_or("held".into(), |s| format!("{s:.4}"));
    for (name, found, truth, s) in [
        ("fx", c.fx, truth.fx, sd.fx),
        ("fy", c.fy, truth.fy, sd.fy),
        ("cx", c.cx, truth.cx, sd.cx),
        ("cy", c.cy, truth.cy, sd.cy),
        ("k1", result.value(Parameter::K1), scene.camera.k1, sd.k1),
        ("k2", result.value(Parameter::K2), scene.camera.k2, sd.k2),
    ] {
        println!("    {name} {found:.4} +- {}, truth {truth:.4}", sigma(s));
    }
    println!("    fit {:?}, attitude sigma {:.4} degrees", result.fit, result.attitude_sigma_deg);
    for group in scene.groups.iter().filter(|g| g.views.len() > 1) {
        let [a, b] = [0, 1].map(|i| Vector3::from(group.views[i].centre_m));
        println!(
            "    attitude pitch {:.1} roll {:.1} degrees, first step {:.2} heights",
            group.pitch_down_deg,
            group.roll_deg,
            (b - a).norm() / a.z,
        );
    }
    let yaw_deg = |name: &str| scene.views().find(|(_, v)| v.file == name).map_or(0.0, |(_, v)| v.yaw_deg);
    for m in &result.motions {
        let same = group_of(&m.from) == group_of(&m.to);
        if !(m.used || same) {
            continue;
        }
        let number = |v: Option<f64>, digits: usize| v.map_or("--".into(), |v| format!("{v:.digits$}"));
        println!(
            "    {} {} {}{} turn {} (truth {:.3}) height_ratio {} +- {}, {} of {} matches, rms {} px {}",
            m.from,
            m.to,
            if m.used { "used" } else { "left out" },
            if same { "" } else { " FALSE" },
            number(m.rotation_deg, 3),
            yaw_deg(&m.to) - yaw_deg(&m.from),
            number(m.height_ratio, 5),
            number(m.height_ratio_sigma, 5),
            m.matches,
            m.candidate_matches,
            number(m.rms_px, 3),
            m.reason.as_deref().unwrap_or(""),
        );
    }
}

fn main() -> ExitCode {
    let arguments = match arguments() {
        Ok(Some(arguments)) => arguments,
        Ok(None) => {
            println!("too long for a test: cargo bench -p groundcal-lab --bench rendered_sets");
            return ExitCode::SUCCESS;
        }
        Err(message) => {
            eprintln!("{message}");
            return ExitCode::from(2);
        }
    };
    let sets = arguments.only.map_or(0..arguments.sets, |i| i..i + 1);
    let motion = if arguments.general { MotionModel::General } else { MotionModel::Auto };
    let in_detail = arguments.only.is_some();
    let start = Instant::now();
    let mut rendering_seconds = 0.0;
    let [mut auto, mut zero_skew] = [Tally::default(), Tally::default()];
    for set in sets {
        let scene = draw(arguments.seed, set, arguments.general);
        let keep = arguments.keep.as_ref().map(|folder| folder.join(format!("set-{set:02}")));
        if let Some(folder) = &keep {
            std::fs::create_dir_all(folder).expect("a folder to write to");
        }
        let begin = Instant::now();
        let images = pictures(&scene, keep.as_ref());
        rendering_seconds += begin.elapsed().as_secs_f64();
        let names: Vec<String> = scene.views().map(|(_, v)| v.file.clone()).collect();
        let may_be_skewed =
            !arguments.general && scene.groups.len() >= 3 && roll_spread_deg(&scene) >= MIN_ROLL_SPREAD_DEG;
        let calibrate = |constraint: Constraint, heading: String, tally: &mut Tally| {
            let begin = Instant::now();
            let options = Options { constraint, motion, ..Options::default() };
            let result = calibrate_images(&names, &images, &options, &Silent);
            let seconds = begin.elapsed().as_secs_f64();
            let label = format!("{heading} {constraint:<9}");
            match result {
                Ok(result) => tally.add(judge(&scene, &result, &label, seconds, in_detail)),
                Err(error) => {
                    println!("{label} REFUSED {seconds:4.1} s: {error}");
                    tally.refused += 1;
                }
            }
        };
        calibrate(Constraint::Auto, format!("{set:>3} {}", describe(&scene)), &mut auto);
        if may_be_skewed {
            calibrate(
                Constraint::ZeroSkew,
                format!("{set:>3} {:<width$}", "", width = describe(&scene).len()),
                &mut zero_skew,
            );
        }
    }
    println!();
    auto.print("auto");
    zero_skew.print("zero-skew");
    auto.add(zero_skew);
    auto.print("all");
    println!("{:.0} s, of which rendering {rendering_seconds:.0} s", start.elapsed().as_secs_f64());
    if auto.fraction_outside() < GOAL_OUTSIDE { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}
