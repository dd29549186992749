//! `report.html`: the numbers behind its pictures show a lens left over, a wrong motion and a moved object; one file that needs
//! nothing else, harmless whatever the names; it works in a browser.

use std::{path::Path, process::Command, sync::OnceLock};

use crate::common::*;
use groundcal::synthetic::PointScene;
use groundcal_lab::renderer::{
    render::Renderer,
    scene::{Boxes, Camera, FloorBox, Group, Scene, View},
};
use image::RgbImage;
use nalgebra::Vector3;
use serde_json::Value;
use tempfile::{TempDir, tempdir};

/// Most bytes of a page of twelve images.
const MAX_BYTES: usize = 5_000_000;

/// A page and the numbers in it.
struct Page {
    html: String,
    data: Value,
}

/// `groundcal calibrate ARGS --out NEW`, which has to succeed; its page.
fn page<S: AsRef<str>>(args: &[S]) -> Page {
    let folder = tempdir().unwrap();
    let out = text(&folder.path().join("out"));
    let all: Vec<&str> =
        ["calibrate"].into_iter().chain(args.iter().map(AsRef::as_ref)).chain(["--out", out.as_str()]).collect();
    let outcome = groundcal(&all);
    assert_eq!(outcome.code, 0, "{}", outcome.stderr);
    let html = std::fs::read_to_string(folder.path().join("out/report.html")).unwrap();
    let data = data_of(&html);
    Page { html, data }
}

fn data_of(html: &str) -> Value {
    let (_, rest) = html.split_once("id=\"groundcal-data\">").expect("the numbers are in the page");
    serde_json::from_str(rest.split_once("</script>").expect("they end").0).expect("they are JSON")
}

/// Four attitudes, two views each, of a floor of stone chips; `turned` changes single views.
fn scene(k1: f64, turned: impl Fn(&mut View)) -> Scene {
    let mut camera = Camera::centred([480, 360], 430.0);
    camera.k1 = k1;
    let attitudes = [(50.0, 0.0), (42.0, 30.0), (58.0, -40.0), (47.0, 75.0)];
    let groups = attitudes
        .into_iter()
        .enumerate()
        .map(|(i, (pitch_down_deg, roll_deg))| {
            let first = 80.0 * i as f64;
            let views = [("a", 0.0, 0.0), ("b", 25.0, 0.15)]
                .map(|(letter, turn, aside): (&str, f64, f64)| {
                    let heading = (first + 90.0f64).to_radians();
                    let mut view = View {
                        file: format!("{i:02}{letter}.png"),
                        yaw_deg: first + turn,
                        centre_m: [-aside * heading.cos(), -aside * heading.sin(), 1.4],
                        pitch_error_deg: 0.0,
                        roll_error_deg: 0.0,
                        exposure: 1.0,
                    };
                    turned(&mut view);
                    view
                })
                .to_vec();
            Group { pitch_down_deg, roll_deg, views }
        })
        .collect();
    let mut scene = Scene::new(camera, groups);
    scene.floor.scale_m = Some(0.08);
    scene.sensor.samples_per_pixel = 9;
    scene
}

/// Renders views of a scene into a folder.
fn render(scene: &Scene, folder: &Path, wanted: impl Fn(&str) -> bool) {
    let renderer = Renderer::new(scene).unwrap();
    for (i, (_, view)) in scene.views().enumerate().filter(|(_, (_, v))| wanted(&v.file)) {
        let picture = renderer.render(i).unwrap();
        let (w, h) = (picture.size.width as u32, picture.size.height as u32);
        RgbImage::from_raw(w, h, picture.data).unwrap().save(folder.join(&view.file)).unwrap();
    }
}

/// `--pairs` of the first motions of [`scene`].
fn pairs(folder: &Path, count: usize) -> String {
    let rows: String = (0..count).map(|i| format!("{i:02}a.png,{i:02}b.png\n")).collect();
    write(folder, "pairs.csv", format!("image_a,image_b\n{rows}"))
}

fn tripod() -> &'static Page {
    static PAGE: OnceLock<Page> = OnceLock::new();
    PAGE.get_or_init(|| page(&[at("examples/tripod")]))
}

// ---- What the pictures show.

#[test]
fn a_lens_left_over_shows_against_the_radius() {
    let folder = tempdir().unwrap();
    render(&scene(-0.1, |_| ()), folder.path(), |name| name < "03");
    let (images, pairs) = (text(folder.path()), pairs(folder.path(), 3));
    let significance = |more: &[&str]| {
        let args: Vec<&str> = [images.as_str(), "--pairs", &pairs].into_iter().chain(more.iter().copied()).collect();
        let page = page(&args);
        let r = &page.data["residuals"];
        let rings: Vec<String> = r["rings"]
            .as_array()
            .unwrap()
            .iter()
            .map(|r| format!("{:.0}: {:+.3}", r["at_px"].as_f64().unwrap(), r["radial_px"].as_f64().unwrap()))
            .collect();
        println!("{more:?}: {:.1} sigma; {}", number(r, "/radial_significance"), rings.join(", "));
        let said = page.html.contains("Something that depends on the radius is left");
        (number(r, "/radial_significance"), number(r, "/radial_px").abs(), said)
    };
    let (modelled, small_px, said_of_good) = significance(&[]);
    let (ignored, large_px, said_of_bad) = significance(&["--distortion", "none"]);
    assert!(modelled < 4.0 && !said_of_good, "{modelled} sigma with the lens modelled");
    assert!(ignored > 6.0 && said_of_bad, "{ignored} sigma with a lens of k1 = -0.1 taken for perfect");
    assert!(large_px > 10.0 * small_px, "{large_px} px against {small_px} px");
}

#[test]
fn a_wrong_motion_is_shown_with_its_reason_or_its_residuals() {
    let folder = tempdir().unwrap();
    // The camera is tilted by four degrees between the two images of the last motion.
    render(&scene(0.0, |v| v.pitch_error_deg = if v.file == "03b.png" { 4.0 } else { 0.0 }), folder.path(), |_| true);
    let images = text(folder.path());
    let pairs = pairs(folder.path(), 4);
    let of = |more: &[&str]| {
        let args: Vec<&str> = [images.as_str(), "--pairs", &pairs].into_iter().chain(more.iter().copied()).collect();
        let page = page(&args);
        let motions = page.data["motions"].as_array().unwrap().clone();
        for m in &motions {
            println!(
                "{more:?} {}: {:?}",
                m["from"],
                [&m["rms_px"], &m["joint_rms_px"], &m["apart_deg"], &m["attention"]]
            );
        }
        (page, motions)
    };
    // Views may vary: those of the wrong motion are seen to.
    let (soft, motions) = of(&[]);
    for m in &motions {
        let wrong = m["from"] == "03a.png";
        let apart = number(m, "/apart_deg");
        // Four motions, each of which may vary, tell attitudes to a few tenths of a degree.
        assert!(if wrong { (apart - 4.0).abs() < 0.4 } else { apart < 0.4 }, "{m}");
        assert_eq!(m["attention"].is_string(), wrong, "{m}");
    }
    assert_eq!(soft.html.matches("<strong>Does not fit:</strong>").count(), 1);
    // Views may not: then no camera explains the motions together, and the wrong one is left out.
    let (hard, motions) = of(&["--attitude-sigma-deg", "0"]);
    for m in &motions {
        let wrong = m["from"] == "03a.png";
        assert_eq!(m["used"], !wrong, "{m}");
        let worst = if wrong { 0.0 } else { number(m, "/joint_rms_px") / number(m, "/rms_px") };
        assert!(worst < 1.2, "{worst} times");
    }
    assert!(motions[3]["reason"].as_str().is_some_and(|reason| reason.contains("left out")), "{}", motions[3]);
    assert!(hard.html.contains("motion_left_out"));
}

#[test]
fn a_pair_left_out_is_shown_with_its_reason() {
    let folder = tempdir().unwrap();
    // The last camera only moves aside, without a turn.
    let mut scene = scene(0.0, |_| ());
    scene.groups[3].views[1].yaw_deg = scene.groups[3].views[0].yaw_deg;
    render(&scene, folder.path(), |_| true);
    let pairs = pairs(folder.path(), 4);
    let page = page(&[text(folder.path()).as_str(), "--pairs", &pairs]);
    let motions = page.data["motions"].as_array().unwrap();
    let left_out: Vec<&Value> = motions.iter().filter(|m| m["used"] == false).collect();
    assert_eq!(left_out.len(), 1);
    assert_eq!(left_out[0]["from"], "03a.png");
    let reason = left_out[0]["reason"].as_str().expect("a reason");
    println!("{reason}");
    assert!(reason.contains("translation"), "{reason}");
    assert!(page.html.contains("<strong>Not used:</strong> no rotation to be seen"));
}

#[test]
fn a_moved_object_gathers_the_rejected_matches() {
    // A mat, too thin to be seen to stand on the floor, is pushed aside between the two images.
    let with_box = |centre_m: [f64; 2]| {
        let mut scene = scene(0.0, |_| ());
        let flat = FloorBox { centre_m, yaw_deg: 20.0, size_m: [0.4, 0.3, 0.0005], colour: [0.7, 0.5, 0.3] };
        scene.boxes = Boxes { list: vec![flat], random: None };
        scene
    };
    let (before, after) = ([1.15, 0.05], [1.25, 0.4]);
    let first = with_box(before);
    let [x, y] = first.pixel_from_world(0, &Vector3::new(before[0], before[1], 0.0)).unwrap().unwrap().into();
    let clusters = |second: &Scene| {
        let folder = tempdir().unwrap();
        render(&first, folder.path(), |name| name == "00a.png");
        render(second, folder.path(), |name| name == "00b.png");
        let page = page(&[text(folder.path())]);
        let found = page.data["motions"][0]["clusters"].as_array().unwrap().clone();
        let correlation = number(&page.data, "/motions/0/overlay/correlation");
        println!("box at {x:.0}, {y:.0}; clusters {found:?}; correlation of the overlay {correlation:.3}");
        let around = |c: &Value| {
            let b: Vec<f64> = c["box_px"].as_array().unwrap().iter().map(|v| v.as_f64().unwrap()).collect();
            b[0] < x && x < b[2] && b[1] < y && y < b[3]
        };
        (found.iter().find(|c| around(c)).cloned(), correlation, page)
    };
    let (still, fits, _) = clusters(&first);
    let (moved, jumps, page) = clusters(&with_box(after));
    let moved = moved.expect("a cluster where the box was");
    assert!(moved["rejected"].as_u64() > moved["accepted"].as_u64(), "{moved}");
    assert!(page.html.contains(&format!("{} rejected</text>", moved["rejected"])), "drawn with its number");
    assert!(still.is_none(), "a mat that lies still: {still:?}");
    assert!(jumps < fits - 0.02, "the overlay: {jumps} against {fits}");
}

// ---- The page.

#[test]
fn the_page_of_twelve_images_is_whole_and_small() {
    let Page { html, data } = tripod();
    println!("{} bytes", html.len());
    assert!(html.len() < MAX_BYTES);
    // Nothing is fetched from anywhere.
    for reference in ["http:", "https:", "src=", "url(\"", "@import", "<link"] {
        assert!(!html.contains(reference), "{reference}");
    }
    assert_eq!(
        html.matches("data:image/jpeg;base64,").count(),
        12 + 2 * 6 + 1,
        "thumbnails, overlays, and the self-test"
    );
    for id in ["warnings", "camera", "motions", "residuals", "floor", "attitudes", "tables"] {
        assert!(html.contains(&format!("<section id=\"{id}\"")), "{id}");
    }
    assert_eq!(data["motions"].as_array().unwrap().len(), 6);
    for m in data["motions"].as_array().unwrap() {
        assert_eq!(m["used"], true);
        assert!(number(m, "/overlay/correlation") > 0.8 && m["attention"].is_null(), "{m}");
        assert!(number(m, "/accepted") > 10.0 * number(m, "/rejected") / 3.0, "{m}");
    }
    assert_eq!(data["residuals"]["images"].as_array().unwrap().len(), 12);
    assert!(number(data, "/residuals/radial_significance") < 4.0);
    assert_eq!(data["floor"].as_array().map(Vec::len), Some(1), "all views are connected");
    assert_eq!(data["floor"][0]["views"].as_array().map(Vec::len), Some(12));
}

#[test]
fn circular_points_of_the_motions_lie_on_those_of_the_camera() {
    let conic = &tripod().data["conic"];
    assert_eq!(conic["equations"], 12);
    assert_eq!(conic["unknowns"], serde_json::json!(["ln fx", "ln fy/fx", "cx", "cy"]));
    for a in conic["attitudes"].as_array().unwrap() {
        let point = |p: &Value| -> Vec<f64> {
            p.as_array().unwrap().iter().flat_map(|v| v.as_array().unwrap()).map(|v| v.as_f64().unwrap()).collect()
        };
        let model = point(&a["circular_points"]);
        let measured = point(&a["measured"][0]);
        let apart = model.iter().zip(&measured).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(apart < 1.0, "{apart} px");
        // m is the foot of the perpendicular from the principal point, |d|² = f² + its distance² (square pixels).
        let (cx, cy, f) = (409.5, 291.0, 705.0);
        let distance = (model[0] - cx).hypot(model[1] - cy);
        assert!((model[2].hypot(model[3]) - f64::hypot(f, distance)).abs() < 1.0);
        let expected = f * a["pitch_down_deg"].as_f64().unwrap().to_radians().tan();
        assert!((distance - expected).abs() < 1.0, "{distance} {expected}");
    }
}

#[test]
fn the_camera_is_that_of_the_calibration_with_what_was_assumed() {
    let data = &tripod().data;
    let parameters = data["camera"]["parameters"].as_array().unwrap();
    let of = |name: &str| parameters.iter().find(|p| p["name"] == name).unwrap();
    assert!((number(of("fx"), "/value") - 705.0).abs() < 0.3);
    assert_eq!(of("cx")["prior"], serde_json::json!([399.5, 40.0]));
    assert!(number(of("cx"), "/from_images") > 0.999);
    assert!(of("skew")["sigma"].is_null() && of("skew")["from_images"].is_null());
}

#[test]
fn no_report_writes_none_and_goes_with_out() {
    let folder = tempdir().unwrap();
    let csv = write(folder.path(), "matches.csv", matches_csv(&PointScene::nominal(2)));
    let out = text(&folder.path().join("out"));
    let args = ["calibrate", &csv, "--image-size", "1280x960", "--out", &out, "--no-report"];
    assert_eq!(groundcal(&args).code, 0);
    assert!(!files_in(&folder.path().join("out")).contains("report.html"));
    let outcome = groundcal(&["calibrate", &csv, "--image-size", "1280x960", "--no-report"]);
    assert_eq!(outcome.code, 2, "{}", outcome.stderr);
}

#[test]
fn matches_from_elsewhere_get_the_page_without_pictures_whatever_their_names() {
    let folder = tempdir().unwrap();
    let evil = "<script>alert(1)</script>&'";
    let csv = matches_csv(&PointScene::nominal(2)).replace("m0a", evil);
    let csv = write(folder.path(), "matches.csv", csv);
    for method in ["joint", "linear", "kzr"] {
        let Page { html, data } = page(&[csv.as_str(), "--image-size", "1280x960", "--method", method]);
        assert!(!html.contains("<image") && !html.contains("<use "), "no pictures");
        assert!(!html.contains("<script>alert"), "the name is harmless");
        assert!(html.contains("&lt;script&gt;alert(1)&lt;/script&gt;&amp;&#39;"), "and there");
        assert_eq!(data["images"][0], evil);
        assert!(number(&data, "/motions/0/accepted") > 150.0);
        assert_eq!(data["residuals"].is_null(), method != "joint");
        let words = match method {
            "joint" => "joint refinement",
            "linear" => "linear method, weighted and polished",
            _ => "linear method as published",
        };
        assert!(html.contains(words), "the page names the method: {words}");
        assert!(number(&data, "/motions/0/overlay/unit_per_px") > 0.0);
        assert!(html.contains("class=\"plot overlay\""), "the floor is drawn");
    }
}

#[test]
fn the_same_page_for_any_number_of_threads() {
    let pair = [at("examples/tripod/00a.jpg"), at("examples/tripod/00b.jpg")];
    // The command that made it names what makes a difference to it.
    let without_command = |html: String| {
        let (head, rest) = html.split_once("<code id=\"command\">").expect("the command");
        let (command, tail) = rest.split_once("</code>").expect("its end");
        assert!(command.starts_with("groundcal calibrate ") && !command.contains("--threads"), "{command}");
        format!("{head}{tail}")
    };
    let with = |threads: &str| without_command(page(&[&pair[0], &pair[1], "--threads", threads]).html);
    assert!(with("1") == with("2"));
}

// ---- In a browser.

/// A Chromium, if there is one.
fn browser() -> Option<&'static str> {
    ["chromium", "chromium-browser", "google-chrome", "chrome"]
        .into_iter()
        .find(|name| Command::new(name).arg("--version").output().is_ok_and(|o| o.status.success()))
}

/// Opens a page and lets it move its own controls; returns what it then looks like and what the console said.
fn opened(browser: &str, html: &str) -> (String, String) {
    let folder: TempDir = tempdir().unwrap();
    let path = folder.path().join("report.html");
    std::fs::write(&path, html).unwrap();
    let output = Command::new(browser)
        .args(["--headless", "--no-sandbox", "--disable-gpu", "--enable-logging=stderr", "--v=0", "--dump-dom"])
        .arg(format!("--user-data-dir={}", folder.path().join("profile").display()))
        .arg(format!("file://{}#selftest", path.display()))
        .output()
        .unwrap();
    let string = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    (string(&output.stdout), string(&output.stderr))
}

#[test]
fn in_a_browser_it_opens_without_errors_and_its_controls_work() {
    let Some(browser) = browser() else {
        println!("skipped: no Chromium here");
        return;
    };
    let (dom, log) = opened(browser, &tripod().html);
    let console: Vec<&str> = log.lines().filter(|l| l.contains("CONSOLE")).collect();
    assert!(console.is_empty(), "{console:?}");
    let root = dom.lines().find(|l| l.contains("<html")).unwrap_or_default();
    assert!(!root.contains("data-errors"), "{root}");
    let said = root.split_once("data-selftest=\"").map(|(_, rest)| rest.split('"').next().unwrap_or_default());
    let said = said.unwrap_or_else(|| panic!("the self-test did not end: {root}"));
    assert!(!said.contains("failed"), "{said}");
    // Four positions of each of six sliders, blinking, and the three layers of the pictures.
    let count = |what: &str| said.split(' ').filter(|s| *s == what).count();
    assert_eq!(
        (count("slider:ok"), count("blink:ok"), count("still:ok"), count("difference:ok")),
        (24, 6, 6, 6),
        "{said}"
    );
    assert_eq!((count("layer:ok"), count("pictures:ok"), count("copy:ok")), (3, 1, 3), "{said}");
    // A page whose script fails is told apart.
    let (broken, _) = opened(browser, &tripod().html.replace("JSON.parse(", "JSON.prase("));
    assert!(!broken.contains("data-selftest="), "a broken script passed");
}
