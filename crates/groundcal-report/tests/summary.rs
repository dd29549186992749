//! The summary and the page of a calibration: nothing runs together at any width, whatever the names.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use groundcal::{
    Method, MotionModel, Options, Plain, Silent, calibrate_matches,
    geometry::{ImageSize, Intrinsics, Lens, rotation_cam_from_world},
    pairs::ImagePair,
    result::{Calibration, Scene, Warning},
    synthetic::{MotionSpec, PointScene, turning_pairs},
};
use groundcal_report::{
    html,
    text::{SummaryOptions, summary},
};

fn names(prefix: &str, count: usize) -> Vec<String> {
    (0..count).map(|i| format!("{prefix}{i:02}.jpg")).collect()
}

fn of_points(prefix: &str, scene: &PointScene, options: Options) -> Calibration {
    let pairs: Vec<ImagePair> = scene.pairs();
    let names = names(prefix, 2 * pairs.len());
    calibrate_matches(&names, scene.size, &pairs, &options, &Silent).unwrap()
}

fn calibration(prefix: &str, method: Method) -> Calibration {
    let scene = PointScene { sigma_px: 0.3, ..PointScene::nominal(3) };
    of_points(prefix, &scene, Options { method, ..Options::default() })
}

/// A camera that turns on the spot, once round.
fn panorama(prefix: &str) -> Calibration {
    let rotations: Vec<_> =
        (0..12).map(|i| rotation_cam_from_world(0.05, 0.02, (30.0 * f64::from(i)).to_radians())).collect();
    let (size, k) = (ImageSize::new(640, 480), Intrinsics::square(520.0, 317.0, 243.0));
    let pairs = turning_pairs(&rotations, &k, &Lens::None, size, 4000, 0.2, 1);
    let c = calibrate_matches(&names(prefix, 12), size, &pairs, &Options::default(), &Silent).unwrap();
    assert_eq!(c.scene, Some(Scene::Directions));
    c
}

/// The kinds of scene that have an answer; what is refused has none.
fn kinds(prefix: &str) -> Vec<(&'static str, Calibration)> {
    let nominal = PointScene { sigma_px: 0.3, ..PointScene::nominal(3) };
    let with = |motions: Vec<MotionSpec>| PointScene { motions, ..nominal.clone() };
    let about = |pitch: f64, roll: f64, turn: f64, offset: f64| {
        MotionSpec::about_axis(pitch.to_radians(), roll.to_radians(), turn.to_radians(), offset, 3.0)
    };
    let vouched = Options { motion: MotionModel::PlaneNormal, ..Options::default() };
    let head = with([30.0, 40.0, 50.0, 60.0].map(|pitch| about(pitch, 0.0, 20.0, 0.05)).to_vec());
    let turntable = with((0..24).map(|i| about(35.0, 2.0, 10.0 + f64::from(i), 1.0)).collect());
    vec![
        ("tripod", of_points(prefix, &nominal, Options::default())),
        ("tripod, linear", calibration(prefix, Method::Linear)),
        ("head", of_points(prefix, &head, Options::default())),
        ("panorama", panorama(prefix)),
        ("two images", of_points(prefix, &with(vec![about(50.0, 0.0, 30.0, 0.2)]), vouched.clone())),
        ("turntable", of_points(prefix, &turntable, vouched)),
    ]
}

/// No two numbers run together, none is cut, and no line is too long.
fn assert_whole(page: &str, width: usize, of: &str) {
    for line in page.lines() {
        assert!(line.chars().count() <= width, "{of}, {width}: {line}");
        // Rows of tables: what has a digit is a name, or a number, whole.
        let words: Vec<&str> = line.split_whitespace().collect();
        let number = |word: &&&str| {
            let word = word.trim_start_matches("+-").trim_end_matches('%');
            matches!(word, "-" | "to" | "held" | "") || word.parse::<f64>().is_ok()
        };
        let parameter = ["fx", "fy", "cx", "cy", "skew", "k1", "k2", "p1", "p2", "k3"]
            .contains(&words.first().copied().unwrap_or("x"));
        if parameter && !line.starts_with(' ') && !line.contains(',') {
            assert!(words[1..].iter().all(|w| number(&w)), "{of}, {width}: {line}");
        }
        let name = |word: &&str| word.ends_with(".jpg") || word.contains("...");
        if words.len() > 2 && words[..2].iter().all(name) && !line.starts_with(' ') {
            assert!(words[2..].iter().all(|w| number(&w)), "{of}, {width}: {line}");
        }
    }
}

#[test]
fn tables_are_whole_at_every_width_for_every_kind_of_scene() {
    for prefix in ["m", "IMG_20260704_101112_front_left_"] {
        for (of, c) in kinds(prefix) {
            for width in (60..=130).step_by(if prefix == "m" { 10 } else { 1 }) {
                for verbose in [false, true] {
                    let page = summary(&c, &SummaryOptions { width, verbose, more: "The rest: elsewhere." }, &Plain);
                    assert_whole(&page, width, of);
                    let labels: &[&str] = if verbose {
                        &["Images:", "Method:", "Attitude sigma:", "Chi-squared:"]
                    } else {
                        &["Images:", "Lens:"]
                    };
                    for label in labels {
                        let at = page.find(label).unwrap_or_else(|| panic!("{label} is missing at {width}"));
                        assert!(page[..at].ends_with(['\n', ' ']), "{label} at {width}");
                    }
                    if !verbose && width >= 80 {
                        assert!(page.lines().count() <= 40, "{of}: more than a screen\n{page}");
                    }
                }
            }
            for width in [60, 80, 120] {
                println!(
                    "{of}, {width} columns\n{}",
                    summary(&c, &SummaryOptions { width, verbose: true, more: "" }, &Plain)
                );
            }
        }
    }
}

#[test]
fn the_two_names_of_a_motion_are_told_apart_however_narrow() {
    let c = calibration("IMG_20260704_101112_front_left_", Method::Joint);
    let page = summary(&c, &SummaryOptions { width: 60, verbose: true, more: "" }, &Plain);
    let rows: Vec<&str> = page.lines().filter(|l| l.starts_with("IM") && l.contains("...")).collect();
    for (from, to) in [("00", "01"), ("02", "03"), ("04", "05")] {
        let both = |row: &&&str| {
            let words: Vec<&str> = row.split_whitespace().collect();
            words[0].trim_end_matches(".jpg").ends_with(from) && words[1].trim_end_matches(".jpg").ends_with(to)
        };
        assert!(rows.iter().any(|row| both(&row)), "{from}, {to}: {rows:#?}");
    }
}

#[test]
fn a_panorama_does_not_speak_of_a_floor() {
    let c = panorama("m");
    for verbose in [false, true] {
        let page = summary(&c, &SummaryOptions { verbose, ..SummaryOptions::default() }, &Plain);
        for word in ["floor", "Height", "height", "NaN"] {
            assert!(!page.contains(word), "{word} in\n{page}");
        }
    }
}

#[test]
fn the_first_lines_answer_what_everybody_asks() {
    let c = calibration("m", Method::Joint);
    let page = summary(&c, &SummaryOptions::default(), &Plain);
    assert!(page.starts_with("Verdict: "), "{page}");
    let rms = c.fit.refinement.unwrap().reprojection_rms_px.unwrap();
    // 0.3 px of noise in both coordinates of both views, of which the place of the point takes half.
    assert!((rms / 0.3 - 1.0).abs() < 0.1, "{rms}");
    let words = page.split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(words.contains(&format!("Reprojection: {rms:.2} px rms")), "{page}");
}

#[test]
fn doubts_come_by_gravity_and_all_of_them_with_verbose() {
    let mut c = calibration("m", Method::Joint);
    let attitude_error =
        |i: u32| Warning::MotionAttitudeError { from: format!("{i}"), to: "b".into(), apart_deg: 1.0, sigma_deg: 0.1 };
    c.warnings = vec![
        Warning::NeighboursOnly { images: 50 },
        Warning::SingleMotion,
        attitude_error(1),
        attitude_error(2),
        attitude_error(3),
    ];
    // What the warnings make of it, as in a file.
    let reasons = ["motion_strays", "single_motion"].map(|code| serde_json::json!({ "code": code, "message": "" }));
    let verdict = serde_json::json!({ "level": "unchecked", "checked": true, "reasons": reasons });
    c.verdict = Some(serde_json::from_value(verdict).unwrap());
    let of = |verbose: bool| {
        let page = summary(&c, &SummaryOptions { verbose, ..SummaryOptions::default() }, &Plain);
        let heads = page.lines().filter(|l| l.starts_with("warning [")).map(str::to_string);
        heads.collect::<Vec<_>>()
    };
    let short = of(false);
    assert_eq!(short[0], "warning [motion_strays], and 2 more like it");
    assert_eq!(short[1..], ["warning [single_motion]", "warning [neighbours_only]"]);
    assert_eq!(of(true).iter().filter(|l| l.contains("motion_strays")).count(), 3);
}

#[test]
fn the_camera_stands_with_its_error_bars() {
    let c = calibration("m", Method::Joint);
    let page = summary(&c, &SummaryOptions::default(), &Plain);
    println!("{page}");
    let row = page.lines().find(|l| l.starts_with("fx ")).unwrap();
    let words: Vec<&str> = row.split_whitespace().collect();
    let sigma = c.standard_deviation.fx.unwrap();
    assert_eq!(words[1..3], [format!("{:.3}", c.camera.fx), format!("{sigma:.3}")]);
    assert_eq!(
        words[3..6],
        [
            format!("{:.3}", c.camera.fx - 1.959_963_984_540_054 * sigma),
            "to".into(),
            format!("{:.3}", c.camera.fx + 1.959_963_984_540_054 * sigma)
        ]
    );
    assert!(page.lines().any(|l| l.starts_with("skew") && l.ends_with("held")), "{page}");
}

#[test]
fn the_page_has_every_section_and_its_numbers() {
    let page = html::page(&calibration("<m>", Method::Joint), &[], &Plain, Some("groundcal calibrate <m>")).unwrap();
    for id in ["warnings", "camera", "images", "projection", "motions", "residuals", "floor", "attitudes", "tables"] {
        assert!(page.contains(&format!("<section id=\"{id}\"")), "{id}");
    }
    assert!(page.contains("&lt;m&gt;00.jpg") && !page.contains("<m>00.jpg"));
    assert!(page.contains("id=\"groundcal-data\">{") && page.ends_with("</html>\n"));
}
