//! `rectify` and `undistort` from end to end: lines, lengths and overlaps measured in the pictures they write, against truth.

use std::{path::Path, process::Command, sync::OnceLock};

use crate::{common::*, readers::python};
use groundcal_lab::renderer::{
    render::Renderer,
    scene::{Camera, Group, Scene, View},
};
use image::{DynamicImage, GrayImage, ImageFormat, RgbImage};
use nalgebra::{Matrix3, SMatrix, Vector2, Vector3};
use serde_json::{Value, json};
use tempfile::{TempDir, tempdir};

const INPUT: i32 = 4;
const USAGE: i32 = 2;

/// `examples/tripod`, calibrated once.
fn tripod() -> &'static Path {
    static FOLDER: OnceLock<TempDir> = OnceLock::new();
    FOLDER
        .get_or_init(|| {
            let folder = tempdir().unwrap();
            let run = groundcal(&["calibrate", &at("examples/tripod"), "--out", &text(folder.path())]);
            assert_eq!(run.code, 0, "{}", run.stderr);
            folder
        })
        .path()
}

/// Two views of a tiled floor by a lens with distortion.
pub(crate) fn tiled() -> Scene {
    let camera = Camera { k1: -0.2, k2: 0.03, p1: 1e-3, p2: -5e-4, ..Camera::centred([640, 480], 520.0) };
    let view = |file: &str, yaw_deg: f64, centre_m: [f64; 3]| View {
        file: file.into(),
        yaw_deg,
        centre_m,
        pitch_error_deg: 0.0,
        roll_error_deg: 0.0,
        exposure: 1.0,
    };
    let views = vec![view("a.png", 0.0, [0.0, 0.0, 1.2]), view("b.png", 25.0, [0.2, -0.1, 1.2])];
    let mut scene = Scene::new(camera, vec![Group { pitch_down_deg: 42.0, roll_deg: 9.0, views }]);
    scene.floor = serde_json::from_value(json!({
        "texture": "tiles", "colour": [0.75, 0.74, 0.72], "second_colour": [0.05, 0.05, 0.05], "yaw_deg": 17.0
    }))
    .unwrap();
    scene
}

/// A calibration.json that says the truth of a scene whose first view stands at the origin with heading 0.
pub(crate) fn truth_json(scene: &Scene) -> Value {
    let c = &scene.camera;
    let k = c.intrinsics();
    let height = scene.views().next().unwrap().1.centre_m[2];
    let views: Vec<Value> = scene
        .views()
        .map(|(g, v)| {
            json!({"image": v.file, "attitude": g, "origin": scene.views().next().unwrap().1.file, "yaw_deg": v.yaw_deg,
                   "pitch_down_deg": scene.groups[g].pitch_down_deg, "roll_deg": scene.groups[g].roll_deg,
                   "position": v.centre_m.map(|x| x / height)})
        })
        .collect();
    let attitudes: Vec<Value> =
        scene.groups.iter().map(|g| json!({"pitch_down_deg": g.pitch_down_deg, "roll_deg": g.roll_deg})).collect();
    json!({"format_version": 1, "method": "joint", "scene": "floor", "attitudes": attitudes, "views": views,
           "camera": {"image_size": c.image_size, "fx": k.fx, "fy": k.fy, "cx": k.cx, "cy": k.cy, "skew": k.skew,
                      "distortion": {"model": "radtan", "k1": c.k1, "k2": c.k2, "p1": c.p1, "p2": c.p2}}})
}

/// Renders a scene into a folder with its calibration.json.
pub(crate) fn rendered(scene: &Scene, folder: &Path) {
    let renderer = Renderer::new(scene).unwrap();
    for (i, (_, view)) in scene.views().enumerate() {
        let picture = renderer.render(i).unwrap();
        let image = RgbImage::from_raw(picture.size.width as u32, picture.size.height as u32, picture.data).unwrap();
        image.save_with_format(folder.join(&view.file), ImageFormat::Png).unwrap();
    }
    write(folder, "calibration.json", truth_json(scene).to_string());
}

/// `examples` of the tiled scene, rendered once.
fn tiled_folder() -> &'static Path {
    static FOLDER: OnceLock<TempDir> = OnceLock::new();
    FOLDER
        .get_or_init(|| {
            let folder = tempdir().unwrap();
            rendered(&tiled(), folder.path());
            folder
        })
        .path()
}

/// Runs a command that has to succeed.
fn done(args: &[&str]) -> Outcome {
    let run = groundcal(args);
    assert_eq!(run.code, 0, "{args:?}: {}", run.stderr);
    run
}

fn matrix(value: &Value) -> Matrix3<f64> {
    Matrix3::from_fn(|r, c| value[r][c].as_f64().unwrap())
}

fn applied(h: &Matrix3<f64>, p: &Vector2<f64>) -> Vector2<f64> {
    let q = h * p.push(1.0);
    q.xy() / q.z
}

/// Grey values and alpha.
fn grey_and_alpha(path: &Path) -> (GrayImage, GrayImage) {
    let image = image::open(path).unwrap();
    let alpha = GrayImage::from_raw(image.width(), image.height(), image.to_rgba8().pixels().map(|p| p.0[3]).collect());
    (image.to_luma8(), alpha.unwrap())
}

fn bilinear(image: &GrayImage, p: &Vector2<f64>) -> f64 {
    let (x, y) = (p.x.floor(), p.y.floor());
    let (u, v) = (p.x - x, p.y - y);
    let get = |i: f64, j: f64| f64::from(image.get_pixel((x + i) as u32, (y + j) as u32).0[0]);
    (1.0 - v) * ((1.0 - u) * get(0.0, 0.0) + u * get(1.0, 0.0)) + v * ((1.0 - u) * get(0.0, 1.0) + u * get(1.0, 1.0))
}

// ---- Lines and lengths.

#[test]
fn grout_lines_are_parallel_and_30_centimetres_apart() {
    let out = tempdir().unwrap();
    let folder = text(tiled_folder());
    let run = done(&[
        "rectify",
        &folder,
        &folder,
        "--out",
        &text(out.path()),
        "--camera-height",
        "1.2",
        "--resolution",
        "400",
        "--up",
        "y",
        "--extent",
        "2.2",
    ]);
    assert!(run.stdout.contains("400 px per metre"), "{}", run.stdout);
    let sidecar = read_json(&out.path().join("a_floor.json"));
    let floor_from_picture = matrix(&sidecar["floor_from_picture"]);
    let picture_from_floor = floor_from_picture.try_inverse().unwrap();
    let (grey, alpha) = grey_and_alpha(&out.path().join("a_floor.png"));
    let inside = |p: &Vector2<f64>| {
        let corner = |dx: i32, dy: i32| {
            let (x, y) = (p.x as i32 + dx, p.y as i32 + dy);
            x >= 0
                && y >= 0
                && (x as u32) < alpha.width()
                && (y as u32) < alpha.height()
                && alpha.get_pixel(x as u32, y as u32).0[0] == 255
        };
        [-12, 12].iter().all(|dx| [-12, 12].iter().all(|dy| corner(*dx, *dy)))
    };
    let (sin, cos) = 17f64.to_radians().sin_cos();
    let axes = [Vector2::new(cos, sin), Vector2::new(-sin, cos)];
    let mut measured = 0;
    for (along, across) in [(axes[0], axes[1]), (axes[1], axes[0])] {
        // For each line, where the dark is, square to it, in metres from where it should be.
        let mut lines: Vec<(f64, f64, f64)> = Vec::new();
        for k in -8..=8 {
            let mut points: Vec<(f64, f64)> = Vec::new();
            for step in -250..250 {
                let s = f64::from(step) * 0.01;
                // Crossings have dark of the other lines.
                let from_crossing = (s / 0.3 - (s / 0.3).round()).abs() * 0.3;
                let expected = along * s + across * (0.3 * f64::from(k));
                if from_crossing < 0.06 || !inside(&applied(&picture_from_floor, &expected)) {
                    continue;
                }
                // The centre of what is darker than the tiles beside the line.
                let value = |d: f64| bilinear(&grey, &applied(&picture_from_floor, &(expected + across * d)));
                let steps: Vec<f64> = (-40..=40).map(|i| f64::from(i) * 0.000_3).collect();
                let light = (value(-0.015) + value(0.015)) / 2.0;
                let dark = |d: f64| (0.6 * light - value(d)).max(0.0);
                let total: f64 = steps.iter().map(|d| dark(*d)).sum();
                if total > 0.0 {
                    points.push((s, steps.iter().map(|d| d * dark(*d)).sum::<f64>() / total));
                }
            }
            if points.len() < 25 {
                continue;
            }
            // A straight line through them.
            let n = points.len() as f64;
            let (ms, md) = (points.iter().map(|p| p.0).sum::<f64>() / n, points.iter().map(|p| p.1).sum::<f64>() / n);
            let slope = points.iter().map(|p| (p.0 - ms) * (p.1 - md)).sum::<f64>()
                / points.iter().map(|p| (p.0 - ms).powi(2)).sum::<f64>();
            let bend = (points.iter().map(|p| (p.1 - md - slope * (p.0 - ms)).powi(2)).sum::<f64>() / n).sqrt();
            lines.push((slope.atan().to_degrees(), md - slope * ms, bend));
        }
        assert!(lines.len() >= 3, "{lines:?}");
        measured += lines.len();
        for (degrees, offset, bend) in &lines {
            println!(
                "turned {degrees:+.4} deg, off {:+.2} mm, rms about a straight line {:.2} mm",
                offset * 1e3,
                bend * 1e3
            );
            // The pixel is 2.5 mm.
            assert!(degrees.abs() < 0.06 && offset.abs() < 6e-4 && *bend < 1e-3, "{degrees} {offset} {bend}");
        }
    }
    assert!(measured >= 8, "{measured} lines");
}

#[test]
fn poses_and_distances_agree_with_the_truth_within_their_error_bars() {
    let calibration = read_json(&tripod().join("calibration.json"));
    let truth = read_json(&root().join("examples/tripod/truth.json"));
    let of = |name: &str| truth["views"].as_array().unwrap().iter().find(|v| v["file"] == *name).unwrap();
    let centre = |v: &Value| Vector3::from_fn(|i, _| v["centre_m"][i].as_f64().unwrap());
    let views = calibration["views"].as_array().unwrap();
    let origin = of(views[0]["origin"].as_str().unwrap());
    let (unit, heading) = (centre(origin).z, number(origin, "/yaw_deg").to_radians());
    let (sin, cos) = heading.sin_cos();
    let mut normalised: Vec<f64> = Vec::new();
    let mut worst: f64 = 0.0;
    for view in views {
        let exact = of(view["image"].as_str().unwrap());
        let shift = (centre(exact) - centre(origin)) / unit;
        let wanted = [cos * shift.x + sin * shift.y, cos * shift.y - sin * shift.x, centre(exact).z / unit];
        for (i, wanted) in wanted.iter().enumerate() {
            let (found, sigma) = (view["position"][i].as_f64().unwrap(), view["position_sigma"][i].as_f64().unwrap());
            if sigma > 0.0 {
                normalised.push((found - wanted) / sigma);
            }
        }
        let turn =
            (number(view, "/yaw_deg") - number(exact, "/yaw_deg") + heading.to_degrees() + 180.0).rem_euclid(360.0);
        if number(view, "/yaw_sigma_deg") > 0.0 {
            normalised.push((turn - 180.0) / number(view, "/yaw_sigma_deg"));
        }
        for (angle, sigma) in [("pitch_down_deg", "pitch_down_sigma_deg"), ("roll_deg", "roll_sigma_deg")] {
            let [found, wanted] = [view, exact].map(|v| v[angle].as_f64().unwrap());
            normalised.push((found - wanted) / view[sigma].as_f64().unwrap());
        }
        // A length on the floor, from two pixels, by the homography and its covariance.
        let h = matrix(&view["floor_from_image"]["matrix"]);
        let covariance =
            SMatrix::<f64, 9, 9>::from_fn(|r, c| view["floor_from_image"]["covariance"][r][c].as_f64().unwrap());
        let exact_floor = {
            let [pitch, roll, yaw] =
                ["pitch_down_deg", "roll_deg", "yaw_deg"].map(|n| exact[n].as_f64().unwrap().to_radians());
            let r = groundcal::geometry::rotation_cam_from_world(pitch, roll, yaw);
            let k = Matrix3::new(705.0, 0.0, 409.5, 0.0, 705.0, 291.0, 0.0, 0.0, 1.0);
            let c = centre(exact);
            (k * Matrix3::from_columns(&[r.column(0).into_owned(), r.column(1).into_owned(), -(r * c)]))
                .try_inverse()
                .unwrap()
        };
        let pixels = [Vector2::new(150.0, 420.0), Vector2::new(640.0, 380.0)];
        let [p, q] = pixels.map(|x| applied(&h, &x));
        let [pt, qt] = pixels.map(|x| applied(&exact_floor, &x));
        let by = |x: &Vector2<f64>| {
            let w = h * x.push(1.0);
            let mut j = SMatrix::<f64, 2, 9>::zeros();
            for k in 0..3 {
                let u = x.push(1.0)[k] / w.z;
                (j[(0, k)], j[(1, 3 + k)]) = (u, u);
                (j[(0, 6 + k)], j[(1, 6 + k)]) = (-w.x / w.z * u, -w.y / w.z * u);
            }
            j
        };
        let along = (q - p).normalize().transpose() * (by(&pixels[1]) - by(&pixels[0]));
        let sigma = (along * covariance * along.transpose())[(0, 0)].sqrt();
        let (found, wanted) = ((q - p).norm(), (qt - pt).norm() / unit);
        println!("{}: {:.6} +- {sigma:.6}, truth {wanted:.6}", view["image"], found);
        worst = worst.max((found / wanted - 1.0).abs());
        normalised.push((found - wanted) / sigma);
    }
    let rms = (normalised.iter().map(|e| e * e).sum::<f64>() / normalised.len() as f64).sqrt();
    let largest = normalised.iter().fold(0.0f64, |m, e| m.max(e.abs()));
    println!(
        "{} numbers: rms {rms:.2}, largest {largest:.2} standard deviations; distances within {:.4} %",
        normalised.len(),
        100.0 * worst
    );
    assert!(normalised.len() > 70 && rms < 1.6 && largest < 4.0, "rms {rms}, largest {largest}");
    assert!(worst < 1e-3, "{worst}");
}

// ---- Overlaps.

/// Shift (px) of `b` against `a` in a window, by least squares on the gradients, iterated; `None` without texture.
fn shift(a: &GrayImage, b: &GrayImage, from: [u32; 2], side: u32, offset: [f64; 2]) -> Option<Vector2<f64>> {
    let mut d = Vector2::zeros();
    for _ in 0..8 {
        let (mut n, mut r) = (nalgebra::Matrix2::zeros(), Vector2::zeros());
        for y in from[1]..from[1] + side {
            for x in from[0]..from[0] + side {
                let p = Vector2::new(f64::from(x), f64::from(y));
                let at = |dx: f64, dy: f64| bilinear(a, &(p + Vector2::new(dx, dy)));
                let g = Vector2::new((at(1.0, 0.0) - at(-1.0, 0.0)) / 2.0, (at(0.0, 1.0) - at(0.0, -1.0)) / 2.0);
                let other = bilinear(b, &(p + Vector2::new(offset[0], offset[1]) + d));
                n += g * g.transpose();
                r += g * (at(0.0, 0.0) - other);
            }
        }
        let step: Vector2<f64> = n.try_inverse()? * r;
        d += step;
        if d.norm() > 3.0 {
            return None;
        }
    }
    Some(d)
}

#[test]
fn views_of_the_example_lie_on_each_other() {
    let out = tempdir().unwrap();
    done(&[
        "rectify",
        &text(tripod()),
        &at("examples/tripod"),
        "--out",
        &text(out.path()),
        "--up",
        "y",
        "--resolution",
        "400",
    ]);
    let load = |name: &str| {
        let sidecar = read_json(&out.path().join(format!("{name}_floor.json")));
        (grey_and_alpha(&out.path().join(format!("{name}_floor.png"))), matrix(&sidecar["floor_from_picture"]))
    };
    for (first, second) in [("00a", "00b"), ("01a", "01b"), ("02a", "05b")] {
        let ((a, alpha_a), floor_a) = load(first);
        let ((b, alpha_b), floor_b) = load(second);
        // Grids of one direction and resolution fit together: whole pixels apart.
        let apart = applied(&floor_b.try_inverse().unwrap(), &applied(&floor_a, &Vector2::zeros()));
        assert!((apart - apart.map(f64::round)).norm() < 1e-6, "{apart}");
        let offset = [apart.x.round(), apart.y.round()];
        const SIDE: u32 = 40;
        let mut shifts: Vec<f64> = Vec::new();
        for y in (4..a.height().saturating_sub(SIDE + 4)).step_by(SIDE as usize) {
            for x in (4..a.width().saturating_sub(SIDE + 4)).step_by(SIDE as usize) {
                let covered = |image: &GrayImage, dx: f64, dy: f64| {
                    (-4..=SIDE as i32 + 4).step_by(4).all(|j| {
                        (-4..=SIDE as i32 + 4).step_by(4).all(|i| {
                            let (u, v) = (f64::from(x) + dx + f64::from(i), f64::from(y) + dy + f64::from(j));
                            u >= 0.0
                                && v >= 0.0
                                && (u as u32) < image.width()
                                && (v as u32) < image.height()
                                && image.get_pixel(u as u32, v as u32).0[0] == 255
                        })
                    })
                };
                if covered(&alpha_a, 0.0, 0.0) && covered(&alpha_b, offset[0], offset[1]) {
                    shifts.extend(shift(&a, &b, [x, y], SIDE, offset).map(|d| d.norm()));
                }
            }
        }
        shifts.sort_by(f64::total_cmp);
        let quantile = |q: f64| shifts[(q * (shifts.len() - 1) as f64) as usize];
        println!(
            "{first} - {second}: {} windows, shift median {:.3} px, 75 % {:.3} px",
            shifts.len(),
            quantile(0.5),
            quantile(0.75)
        );
        // Boxes stand on the floor: their windows do not fit.
        assert!(shifts.len() >= 20 && quantile(0.5) < 0.1 && quantile(0.75) < 0.3, "{first} - {second}");
    }
}

#[test]
fn the_mosaic_has_all_views_and_does_not_depend_on_threads() {
    let out = tempdir().unwrap();
    let bytes = |threads: &str, format: &str| {
        let folder = out.path().join(threads).join(format);
        let run = done(&[
            "rectify",
            &text(tripod()),
            &at("examples/tripod"),
            "--out",
            &text(&folder),
            "--mosaic",
            "--threads",
            threads,
            "--format",
            format,
            "--resolution",
            "100",
            "--camera-height",
            "1.45",
        ]);
        assert!(run.stdout.contains("12 views"), "{}", run.stdout);
        assert_eq!(run.stderr.lines().count(), 1, "{}", run.stderr);
        let (image, world) = if format == "png" { ("mosaic.png", "mosaic.pgw") } else { ("mosaic.jpg", "mosaic.jgw") };
        assert_eq!(results_in(&folder), [image, world, "mosaic.json"].map(String::from).into());
        (std::fs::read(folder.join(image)).unwrap(), read_json(&folder.join("mosaic.json")), folder.join(world))
    };
    let (one, sidecar, world) = bytes("1", "png");
    assert_eq!(one, bytes("3", "png").0);
    let picture = image::load_from_memory(&one).unwrap().into_rgba8();
    assert_eq!(json!([picture.width(), picture.height()]), sidecar["picture_size"]);
    assert_eq!((&sidecar["unit"], sidecar["views"].as_array().unwrap().len()), (&json!("metre"), 12));
    // Transparent outside, opaque inside, soft between.
    let of_alpha = |f: fn(u8) -> bool| picture.pixels().filter(|p| f(p.0[3])).count();
    assert!(of_alpha(|a| a == 0) > 1000 && of_alpha(|a| a == 255) > 10_000 && of_alpha(|a| a > 0 && a < 255) > 100);
    // The world file says what the JSON says.
    let lines: Vec<f64> = std::fs::read_to_string(world).unwrap().lines().map(|l| l.parse().unwrap()).collect();
    let m = matrix(&sidecar["floor_from_picture"]);
    let expected = [m[(0, 0)], m[(1, 0)], m[(0, 1)], m[(1, 1)], m[(0, 2)], m[(1, 2)]];
    assert!(lines.len() == 6 && lines.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12), "{lines:?}");
    assert!(m[(0, 0)] == 0.01 && m[(1, 1)] == -0.01, "+X to the right, +Y up");
    let jpeg = image::load_from_memory(&bytes("2", "jpeg").0).unwrap().into_rgb8();
    assert!(jpeg.get_pixel(0, 0).0.iter().all(|v| *v > 245), "white outside");
}

#[test]
fn the_heading_is_up_in_single_views_and_images_are_found_beside_the_calibration() {
    let out = tempdir().unwrap();
    done(&["rectify", &text(&tiled_folder().join("calibration.json")), "--out", &text(out.path())]);
    let sidecar = read_json(&out.path().join("b_floor.json"));
    let m = matrix(&sidecar["floor_from_picture"]);
    let up = -Vector2::new(m[(0, 1)], m[(1, 1)]).normalize();
    let heading = 25f64.to_radians();
    assert!((up - Vector2::new(heading.cos(), heading.sin())).norm() < 1e-9, "{up}");
    assert_eq!(sidecar["unit"], "camera height");
    // A corner of the picture's content comes from the pixel that the homography names (the lens undone).
    let chained = matrix(&sidecar["views"][0]["picture_from_image"]);
    let direct = m.try_inverse().unwrap() * matrix(&sidecar["views"][0]["floor_from_image"]);
    assert!((chained - direct).norm() < 1e-9 * direct.norm());
}

// ---- What cannot be done is said, and leaves nothing behind.

/// A run that must fail with a code and words, and write nothing.
fn fails(args: &[&str], code: i32, words: &[&str]) {
    let folder = tempdir().unwrap();
    let out = text(&folder.path().join("out"));
    let mut all = args.to_vec();
    all.extend(["--out", &out]);
    let run = groundcal(&all);
    println!("{}", run.stderr);
    assert_eq!(run.code, code, "{}", run.stderr);
    for word in words {
        assert!(run.stderr.contains(word), "\"{word}\" is missing in: {}", run.stderr);
    }
    assert_eq!(run.stdout, "");
    assert!(files_in(folder.path()).is_empty(), "files are left");
}

#[test]
fn bad_input_is_refused_by_name() {
    let folder = tempdir().unwrap();
    let images = text(tiled_folder());
    let mut calibration = truth_json(&tiled());
    let good = write(folder.path(), "good.json", calibration.to_string());

    fails(&["rectify", "nowhere.json", &images], INPUT, &["nowhere.json", "does not exist"]);
    fails(&["rectify", &at("README.md"), &images], INPUT, &["README.md", "not a calibration", "calibration.json"]);
    fails(
        &["rectify", &good, &at("examples/head")],
        INPUT,
        &["no image given (00a.jpg", "is a view of the calibration", "a.png"],
    );
    fails(&["rectify", &good], INPUT, &["no image of the calibration (a.png, b.png)", "Name their folder"]);
    fails(
        &["rectify", &good, &images, "--resolution", "1e6"],
        USAGE,
        &["megapixels, 100 at most", "px per camera height or less"],
    );
    fails(&["rectify", &good, &images, "--resolution", "-3"], USAGE, &["positive"]);
    fails(&["rectify", &good, &images, "--extent", "0.01"], INPUT, &["no view sees floor within 0.01", "--extent"]);
    fails(&["undistort", &good, &at("examples/tripod")], INPUT, &["00a.jpg: is 800x600", "of 640x480"]);
    fails(&["undistort", &good], USAGE, &["IMAGES"]);

    // An image of another size, named as a view: whatever else could be written is not.
    let other = tempdir().unwrap();
    std::fs::copy(tiled_folder().join("a.png"), other.path().join("a.png")).unwrap();
    let small = DynamicImage::new_rgb8(320, 240);
    small.save_with_format(other.path().join("b.png"), ImageFormat::Png).unwrap();
    fails(&["rectify", &good, &text(other.path())], INPUT, &["b.png: is 320x240", "of 640x480", "camera and size"]);
    let damaged = std::fs::read(tiled_folder().join("b.png")).unwrap();
    std::fs::write(other.path().join("b.png"), &damaged[..damaged.len() / 2]).unwrap();
    fails(&["rectify", &good, &text(other.path()), "--mosaic"], INPUT, &["b.png", "damaged or truncated"]);
    fails(&["undistort", &good, &text(other.path())], INPUT, &["b.png", "damaged or truncated"]);

    calibration["scene"] = json!("directions");
    for v in calibration["views"].as_array_mut().unwrap() {
        v["position"] = Value::Null;
    }
    let turning = write(folder.path(), "turning.json", calibration.to_string());
    fails(&["rectify", &turning, &images], INPUT, &["no floor", "turned on the spot", "directions"]);

    calibration["distortion"] = Value::Null;
    calibration["camera"]["distortion"]["k1"] = json!(-2.0);
    let folding = write(folder.path(), "folding.json", calibration.to_string());
    fails(&["undistort", &folding, &images, "--fit", "all"], INPUT, &["folds over", "k1 -2"]);
}

#[test]
fn the_linear_method_gives_single_views_and_no_mosaic() {
    let folder = tempdir().unwrap();
    let pair = [at("examples/tripod/00a.jpg"), at("examples/tripod/00b.jpg")];
    let out = text(&folder.path().join("linear"));
    done(&["calibrate", &pair[0], &pair[1], "--constraint", "focal", "--method", "linear", "--out", &out]);
    fails(
        &["rectify", &out, &pair[0], &pair[1], "--mosaic"],
        INPUT,
        &["no positions (--method linear)", "leave --mosaic out"],
    );
    let pictures = folder.path().join("pictures");
    done(&["rectify", &out, &pair[0], &pair[1], "--out", &text(&pictures)]);
    let names =
        ["00a_floor.json", "00a_floor.pgw", "00a_floor.png", "00b_floor.json", "00b_floor.pgw", "00b_floor.png"];
    assert_eq!(results_in(&pictures), names.map(String::from).into());
    assert_eq!(read_json(&pictures.join("00a_floor.json"))["origin"], Value::Null);
}

#[test]
fn images_that_are_no_views_are_left_out_with_a_note() {
    let out = tempdir().unwrap();
    let (folder, a, head) = (text(tiled_folder()), text(&tiled_folder().join("a.png")), at("examples/head/00a.jpg"));
    let run = done(&["rectify", &folder, &a, &head, "--out", &text(out.path())]);
    for words in [
        "note: left out, as the calibration has no position for them: 00a.jpg",
        "note: of the calibration's images not found: b.png",
    ] {
        assert!(run.stderr.contains(words), "{}", run.stderr);
    }
}

// ---- Undistorting.

#[test]
fn undistorted_images_never_take_the_place_of_their_originals() {
    let folder = tempdir().unwrap();
    rendered(&tiled(), folder.path());
    let before = std::fs::read(folder.path().join("a.png")).unwrap();
    let here = text(folder.path());
    let run = groundcal(&["undistort", &here, &here, "--out", &here]);
    assert_eq!(run.code, USAGE, "{}", run.stderr);
    assert!(run.stderr.contains("would be overwritten"), "{}", run.stderr);
    assert_eq!(before, std::fs::read(folder.path().join("a.png")).unwrap());
}

#[test]
fn the_camera_of_undistorted_images_is_read_back() {
    let out = tempdir().unwrap();
    let (folder, first) = (text(tiled_folder()), text(&out.path().join("first")));
    done(&["undistort", &folder, &folder, "--out", &first, "--fit", "crop", "--format", "jpeg"]);
    let camera = read_json(&out.path().join("first/camera_undistorted.json"));
    assert_eq!((&camera["camera"]["distortion"]["model"], &camera["undistort_fit"]), (&json!("none"), &json!("crop")));
    let fx = camera["camera"]["fx"].as_f64().unwrap();
    assert!(fx > 300.0 && fx < 520.0, "the same camera would show less of a barrel than there is: {fx}");
    assert_eq!(camera["distorted_camera"]["distortion"]["k1"], -0.2);
    let camera = text(&out.path().join("first/camera_undistorted.json"));
    let second = text(&out.path().join("second"));
    let run = done(&["undistort", &camera, &text(&out.path().join("first/a.jpg")), "--out", &second]);
    assert!(run.stderr.contains("no distortion"), "{}", run.stderr);
}

/// Prints the largest difference of the maps, the largest and the mean difference of the images.
const COMPARE: &str = r#"
import cv2, json, sys, numpy as np
original, folder, name = sys.argv[1:4]
image = cv2.imread(original)
x, y = (cv2.imread(f"{folder}/map_{a}.tiff", cv2.IMREAD_UNCHANGED) for a in "xy")
assert x.dtype == np.float32 and y.dtype == np.float32 and x.shape == y.shape == image.shape[:2], (x.dtype, x.shape)
camera = json.load(open(f"{folder}/camera_undistorted.json"))
matrix = lambda c: np.array([[c["fx"], c["skew"], c["cx"]], [0, c["fy"], c["cy"]], [0, 0, 1]])
d = camera["distorted_camera"]
lens = np.array([d["distortion"][n] for n in ("k1", "k2", "p1", "p2")])
size = image.shape[1::-1]
u, v = cv2.initUndistortRectifyMap(matrix(d), lens, None, matrix(camera["camera"]), size, cv2.CV_32FC1)
ours = cv2.imread(f"{folder}/{name}", cv2.IMREAD_UNCHANGED)
inside = ours[:, :, 3] == 255 if ours.shape[2] == 4 else np.ones(ours.shape[:2], bool)
print(max(np.abs(x - u).max(), np.abs(y - v).max()))
for theirs in (cv2.remap(image, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE),
               cv2.undistort(image, matrix(d), lens, None, matrix(camera["camera"]))):
    # cv2.undistort has black beyond the border.
    difference = np.abs(theirs.astype(int) - ours[:, :, :3].astype(int))[inside & (x >= 0) & (y >= 0) & (x <= size[0] - 1) & (y <= size[1] - 1)]
    print(difference.max(), difference.mean(), len(difference))
"#;

#[test]
fn opencv_reads_the_maps_and_undistorts_alike() {
    let Some(python) = python(&["cv2", "numpy"]) else { return };
    let out = tempdir().unwrap();
    let folder = text(tiled_folder());
    for fit in ["same", "all", "crop"] {
        let there = text(&out.path().join(fit));
        done(&["undistort", &folder, &folder, "--out", &there, "--maps", "--fit", fit]);
        let original = text(&tiled_folder().join("a.png"));
        let output = Command::new(python).args(["-c", COMPARE, &original, &there, "a.png"]).output().unwrap();
        let printed = String::from_utf8_lossy(&output.stdout);
        assert!(output.status.success(), "{printed}{}", String::from_utf8_lossy(&output.stderr));
        println!("{fit}: {printed}");
        let numbers: Vec<f64> = printed.split_whitespace().map(|n| n.parse().unwrap()).collect();
        // Single precision; positions of remap in steps of 1/32 px.
        assert!(numbers[0] < 1e-3, "maps: {}", numbers[0]);
        for image in numbers[1..].chunks(3) {
            assert!(image[2] > 100_000.0, "{fit}: {} pixels compared", image[2]);
            assert!(image[0] <= 8.0 && image[1] < 0.6, "{fit}: largest {}, mean {}", image[0], image[1]);
        }
    }
}
