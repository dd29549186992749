//! The summary and the page of a calibration: nothing runs together at any width, whatever the names.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use groundcal::{
    calibrate::{Method, Options, Silent, calibrate_matches},
    pairs::correspondence::ImagePair,
    remedy::Plain,
    result::Calibration,
    synthetic::points::PointScene,
};
use groundcal_report::{
    html,
    text::{SummaryOptions, summary},
};

fn calibration(prefix: &str, method: Method) -> Calibration {
    let scene = PointScene { sigma_px: 0.3, ..PointScene::nominal(3) };
    let pairs: Vec<ImagePair> = scene.pairs().into_iter().map(|p| p.pair).collect();
    let names: Vec<String> = (0..2 * pairs.len()).map(|i| format!("{prefix}{i}.jpg")).collect();
    let options = Options { method, ..Options::default() };
    calibrate_matches(&names, scene.size, &pairs, &options, &Silent).unwrap()
}

#[test]
fn lines_fit_and_numbers_stand_apart_at_every_width() {
    for prefix in ["m", "IMG_20260704_101112_front_left_"] {
        for method in [Method::Joint, Method::Linear] {
            let c = calibration(prefix, method);
            for width in 60..=130 {
                let page = summary(&c, &SummaryOptions { width, verbose: true }, &Plain);
                for line in page.lines() {
                    assert!(line.chars().count() <= width, "{width}: {line}");
                    // Rows of motions and views: two names, then numbers.
                    let words: Vec<&str> = line.split_whitespace().collect();
                    if words.len() > 2 && words[..2].iter().all(|w| w.ends_with(".jpg")) && !line.starts_with(' ') {
                        for word in &words[2..] {
                            let number = word.trim_start_matches("+-");
                            assert!(number == "-" || number.parse::<f64>().is_ok(), "{width}: {word} in {line}");
                        }
                    }
                }
                for label in ["Images:", "Method:", "Attitude sigma:", "Chi-squared:"] {
                    let at = page.find(label).unwrap_or_else(|| panic!("{label} is missing at {width}"));
                    assert!(page[..at].ends_with(['\n', ' ']), "{label} at {width}");
                }
            }
        }
    }
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
    let page = html::page(&calibration("<m>", Method::Joint), &[], &Plain).unwrap();
    for id in ["warnings", "camera", "motions", "residuals", "floor", "attitudes", "tables"] {
        assert!(page.contains(&format!("<section id=\"{id}\"")), "{id}");
    }
    assert!(page.contains("&lt;m&gt;0.jpg") && !page.contains("<m>0.jpg"));
    assert!(page.contains("id=\"groundcal-data\">{") && page.ends_with("</html>\n"));
}
