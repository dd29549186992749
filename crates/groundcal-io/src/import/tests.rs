use groundcal::geometry::{Fisheye, ImageSize, Intrinsics, Lens, Radtan};
use groundcal::result::Parameter;

use crate::import::{ImportedCamera, formats::parse, read_camera};

/// fx 700, fy 702, cx 400.25, cy 299.5, k1 -0.1, k2 0.02, p1 1e-3, p2 -2e-3, k3 0.005, 800 x 600.
const OPENCV_YAML: &str = "%YAML:1.0\n---\ncalibration_time: \"Mon 23 Nov\"\nimage_width: 800\nimage_height: 600\nflags: 0\ncamera_matrix: \
                           !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n   data: [ 700., 0., 400.25, 0.,\n       7.02e+02, 299.5, 0., 0., 1. \
                           ]\ndistortion_coefficients: !!opencv-matrix\n   rows: 5\n   cols: 1\n   dt: d\n   data: [ -0.1, 2.0e-02, 1e-3, -2e-3, 0.005 ]\n";
const OPENCV_XML: &str = "<?xml version=\"1.0\"?>\n<opencv_storage>\n<image_Width>800</image_Width>\n<image_Height>600</image_Height>\n<Camera_Matrix \
                          type_id=\"opencv-matrix\">\n<rows>3</rows><cols>3</cols><dt>d</dt>\n<data>\n 700. 0. 400.25 0. 702. 299.5 0.\n 0. \
                          1.</data></Camera_Matrix>\n<Distortion_Coefficients type_id=\"opencv-matrix\"><rows>5</rows><cols>1</cols><dt>d</dt>\n<data>-0.1 \
                          0.02 1e-3 -2e-3 0.005</data></Distortion_Coefficients>\n</opencv_storage>\n";
const ROS: &str = "image_width: 800\nimage_height: 600\ncamera_name: narrow_stereo\ncamera_matrix:\n  rows: 3\n  cols: 3\n  data: [700, 0, 400.25, 0, \
                   702, 299.5, 0, 0, 1]\ndistortion_model: plumb_bob\ndistortion_coefficients:\n  rows: 1\n  cols: 5\n  data: [-0.1, 0.02, 0.001, -0.002, \
                   0.005]\nrectification_matrix:\n  rows: 3\n  cols: 3\n  data: [1, 0, 0, 0, 1, 0, 0, 0, 1]\nprojection_matrix:\n  rows: 3\n  cols: 4\n  \
                   data: [690, 0, 401, 0, 0, 691, 298, 0, 0, 0, 1, 0]\n";
const ROS_MESSAGE: &str = "header:\n  seq: 1\nheight: 600\nwidth: 800\ndistortion_model: \"plumb_bob\"\nD: [-0.1, 0.02, 0.001, -0.002, 0.005]\nK: [700.0, \
                           0.0, 400.25, 0.0, 702.0, 299.5, 0.0, 0.0, 1.0]\nR: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]\nP: [690.0, 0.0, 401.0, 0.0, \
                           0.0, 691.0, 298.0, 0.0, 0.0, 0.0, 1.0, 0.0]\n---\nheader:\n  seq: 2\n";
const KALIBR: &str = "cam0:\n  cam_overlaps: [1]\n  camera_model: pinhole\n  distortion_coeffs: [-0.1, 0.02, 0.001, -0.002]\n  distortion_model: radtan\n  \
                      intrinsics: [700.0, 702.0, 400.25, 299.5]\n  resolution: [800, 600]\n  rostopic: /cam0\ncam1:\n  T_cn_cnm1:\n  - [1.0, 0.0, 0.0, \
                      0.1]\n  - [0.0, 1.0, 0.0, 0.0]\n  - [0.0, 0.0, 1.0, 0.0]\n  - [0.0, 0.0, 0.0, 1.0]\n  camera_model: pinhole\n  distortion_coeffs: \
                      []\n  distortion_model: none\n  intrinsics: [650.0, 651.0, 399.0, 301.0]\n  resolution: [800, 600]\n";
const COLMAP: &str = "# Camera list\n#   CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]\n1 OPENCV 800 600 700 702 400.75 300 -0.1 0.02 0.001 -0.002\n2 \
                      SIMPLE_RADIAL 640 480 500 320 240 -0.05\n3 PINHOLE 640 480 500 501 320 240\n4 SIMPLE_PINHOLE 640 480 500 320 240\n5 RADIAL 640 480 \
                      500 320 240 -0.05 0.01\n6 FULL_OPENCV 800 600 700 702 400.75 300 -0.1 0.02 0.001 -0.002 0.005 0 0 0\n";
const NERFSTUDIO: &str = r#"{"camera_model": "OPENCV", "w": 800, "h": 600, "fl_x": 700, "fl_y": 702, "cx": 400.75, "cy": 300, "k1": -0.1, "k2": 0.02,
    "p1": 0.001, "p2": -0.002, "k3": 0.005, "frames": []}"#;
const TRUTH: &str = r#"{"image_size": [800, 600], "fx": 700, "fy": 702, "cx": 400.25, "cy": 299.5, "skew": 0, "kind": "rendered",
    "distortion": {"model": "radtan", "k1": -0.1, "k2": 0.02, "p1": 0.001, "p2": -0.002, "k3": 0.005}}"#;
const OURS: &str = r#"{"format_version": 1, "camera": {"image_size": [800, 600], "fx": 700.0, "fy": 702.0, "cx": 400.25, "cy": 299.5, "skew": 0.0,
    "distortion": {"model": "radtan", "k1": -0.1, "k2": 0.02, "p1": 0.001, "p2": -0.002}},
    "covariance": {"parameters": ["fx", "k1"], "matrix": [[4.0, 0.1], [0.1, 0.01]]}}"#;

fn one(text: &str) -> ImportedCamera {
    let mut cameras = parse(text).unwrap_or_else(|e| panic!("{e}\n{text}"));
    cameras.swap_remove(0)
}

/// A coefficient of the lens, 0 where its model has none of the name.
fn of(camera: &ImportedCamera, name: &str) -> f64 {
    camera.lens.parameter(name).unwrap_or(0.0)
}

#[test]
fn every_format_gives_the_same_camera() {
    for (format, k3, text) in [
        ("OpenCV", 0.005, OPENCV_YAML),
        ("OpenCV", 0.005, OPENCV_XML),
        ("ROS camera_info", 0.005, ROS),
        ("ROS camera_info", 0.005, ROS_MESSAGE),
        ("Kalibr", 0.0, KALIBR),
        ("COLMAP", 0.0, COLMAP),
        ("transforms.json", 0.005, NERFSTUDIO),
        ("truth", 0.005, TRUTH),
        ("groundcal", 0.0, OURS),
    ] {
        let camera = one(text);
        assert_eq!(camera.format, format);
        assert_eq!(camera.size, Some(ImageSize::new(800, 600)), "{format}");
        assert_eq!(
            camera.intrinsics,
            Intrinsics { fx: 700.0, fy: 702.0, cx: 400.25, cy: 299.5, skew: 0.0 },
            "{format}"
        );
        assert_eq!(camera.lens, Lens::Radtan(Radtan::new([-0.1, 0.02, 1e-3, -2e-3, k3])), "{format}");
    }
}

#[test]
fn models_of_colmap_and_errors_of_ours() {
    let all = parse(COLMAP).unwrap();
    let found: Vec<(&str, f64, f64, f64, f64)> =
        all.iter().map(|c| (c.label.as_str(), c.intrinsics.fy, c.intrinsics.cx, of(c, "k1"), of(c, "k2"))).collect();
    assert_eq!(found[1], ("2", 500.0, 319.5, -0.05, 0.0));
    assert_eq!(found[2], ("3", 501.0, 319.5, 0.0, 0.0));
    assert_eq!(found[3], ("4", 500.0, 319.5, 0.0, 0.0));
    assert_eq!(found[4], ("5", 500.0, 319.5, -0.05, 0.01));
    assert_eq!(of(&all[5], "k3"), 0.005);
    // Rows by name, wherever they stand.
    let covariance = one(OURS).covariance.unwrap();
    let (fx, fy, k1) = (Parameter::Fx, Parameter::Fy, Parameter::K1);
    let found = [covariance.get(fx, fx), covariance.get(fx, k1), covariance.get(k1, k1), covariance.get(fy, fy)];
    assert_eq!(found, [4.0, 0.1, 0.01, 0.0]);
    let sigmas = OURS.replace(
        r#""covariance": {"parameters": ["fx", "k1"], "matrix": [[4.0, 0.1], [0.1, 0.01]]}"#,
        r#""standard_deviation": {"fx": 2.0, "fy": null, "cx": null, "cy": null, "skew": null, "k1": 0.5, "k2": null}"#,
    );
    let covariance = one(&sigmas).covariance.unwrap();
    assert_eq!((covariance.get(fx, fx), covariance.get(k1, k1), covariance.get(fx, k1)), (4.0, 0.25, 0.0));
}

/// The message says all these words.
fn refused(text: &str, words: &[&str]) {
    let message = parse(text).map(|c| format!("{c:?}")).unwrap_err();
    for word in words {
        assert!(message.contains(word), "\"{word}\" is missing in: {message}");
    }
}

/// The files with their four numbers taken for a fisheye's: k1 -0.1, k2 0.02, k3 0.001, k4 -0.002.
fn fisheyes() -> Vec<(&'static str, String)> {
    let four = |text: &str| {
        let text = text.replace("rows: 5\n", "rows: 4\n").replace("<rows>5</rows>", "<rows>4</rows>");
        let text = text.replace("cols: 5", "cols: 4").replace(" 0.005</data>", "</data>").replace(", 0.005", "");
        text.replace(", \"k3\": 0.005", "")
    };
    let renamed = |text: &str| {
        let text = text.replace(", \"k3\": 0.005", "");
        text.replace("\"p1\"", "\"k3\"").replace("\"p2\"", "\"k4\"").replace("radtan", "fisheye")
    };
    vec![
        ("OpenCV", four(OPENCV_YAML).replace("flags: 0", "fisheye_model: 1")),
        ("OpenCV", four(OPENCV_YAML).replace("flags: 0", "distortion_model: equidistant")),
        ("OpenCV", four(OPENCV_XML).replace("<image_Width>", "<fisheye_model>1</fisheye_model><image_Width>")),
        ("ROS camera_info", four(ROS).replace("plumb_bob", "equidistant")),
        ("ROS camera_info", four(ROS_MESSAGE).replace("plumb_bob", "equidistant")),
        ("Kalibr", KALIBR.replace("radtan", "equidistant")),
        ("COLMAP", COLMAP.replace("1 OPENCV", "1 OPENCV_FISHEYE")),
        ("transforms.json", renamed(NERFSTUDIO).replace("\"OPENCV\"", "\"OPENCV_FISHEYE\"")),
        ("transforms.json", renamed(NERFSTUDIO).replace("\"w\"", "\"is_fisheye\": true, \"w\"")),
        ("truth", renamed(TRUTH)),
        ("groundcal", renamed(OURS)),
    ]
}

#[test]
fn every_format_gives_the_same_fisheye() {
    for (format, text) in fisheyes() {
        let camera = one(&text);
        assert_eq!(camera.format, format);
        assert_eq!(camera.lens, Lens::Fisheye(Fisheye::new([-0.1, 0.02, 1e-3, -2e-3])), "{format}: {text}");
        assert!(
            (camera.intrinsics.cx - 400.25).abs() < 1e-12 && camera.notes.is_empty(),
            "{format}: {:?}",
            camera.notes
        );
    }
    let simple = one(&COLMAP.replace(
        "1 OPENCV 800 600 700 702 400.75 300 -0.1 0.02 0.001 -0.002",
        "1 SIMPLE_RADIAL_FISHEYE 800 600 700 400 300 0.1",
    ));
    assert_eq!(simple.lens, Lens::Fisheye(Fisheye::new([0.1, 0.0, 0.0, 0.0])));
    let named = "K: [700, 0, 320, 0, 700, 240, 0, 0, 1]\nfisheye: true\nk1: -0.1\nk4: 0.02\n";
    assert_eq!(one(named).lens, Lens::Fisheye(Fisheye::new([-0.1, 0.0, 0.0, 0.02])));
    refused(&format!("{named}p1: 0.1\n"), &["p1 is 0.1", "k1, k2, k3, k4"]);
}

#[test]
fn lenses_that_are_not_read_are_named() {
    refused(&KALIBR.replace("radtan", "fov"), &["cam0", "fov", "radtan, equidistant"]);
    refused(&KALIBR.replace("radtan", "equidistant").replace(", -0.002]", "]"), &["cam0", "3 distortion", "has four"]);
    refused(&KALIBR.replace("camera_model: pinhole", "camera_model: omni"), &["omni", "only pinhole"]);
    refused(
        &COLMAP.replace("2 SIMPLE_RADIAL", "2 THIN_PRISM_FISHEYE"),
        &["line 4", "THIN_PRISM_FISHEYE", "OPENCV_FISHEYE"],
    );
    refused(&COLMAP.replace("2 SIMPLE_RADIAL", "2 OPENCV_FISHEYE"), &["line 4", "OPENCV_FISHEYE has 8"]);
    refused(&COLMAP.replace("0.005 0 0 0", "0.005 0.1 0 0"), &["line 8", "coefficient 6 is 0.1"]);
    refused(&ROS.replace("plumb_bob", "thin_prism"), &["thin_prism", "plumb_bob", "equidistant"]);
    refused(&ROS.replace("plumb_bob", "equidistant"), &["5 distortion coefficients", "has four"]);
    refused(&OPENCV_YAML.replace("flags: 0", "fisheye: true"), &["distortion_coefficients", "has four"]);
    refused(&OPENCV_YAML.replace("flags: 0", "xi: 1.2"), &["xi is 1.2", "omnidirectional"]);
    refused(&NERFSTUDIO.replace("\"w\"", "\"is_fisheye\": true, \"w\""), &["p1 is 0.001", "k1, k2, k3, k4 are"]);
    refused(&NERFSTUDIO.replace("\"OPENCV\"", "\"EQUIRECTANGULAR\""), &["EQUIRECTANGULAR", "not"]);
    refused(&TRUTH.replace("radtan", "fisheye"), &["p1 is 0.001", "fisheye"]);
    refused(&TRUTH.replace("radtan", "omni"), &["omni", "fisheye"]);
    let eight = OPENCV_YAML.replace("rows: 5\n", "rows: 8\n").replace("0.005 ]", "0.005, 0, 0.3, 0 ]");
    refused(&eight, &["coefficient 7 is 0.3", "rational"]);
    assert_eq!(of(&one(&eight.replace("0.3", "0")), "k3"), 0.005);
}

#[test]
fn errors_say_what_was_expected_and_found() {
    refused("", &["empty"]);
    refused("hello world\n", &["no calibration", "camera_matrix", "cam0"]);
    refused("alpha: 1\nbeta: 2\n", &["camera_matrix", "alpha, beta"]);
    refused("# COLMAP, but no camera\n", &["no calibration"]);
    refused(
        &COLMAP.replace("1 OPENCV 800 600 700 702", "1 OPENCV 800 600 700"),
        &["line 3", "OPENCV has 8", "found 7"],
    );
    refused(
        &COLMAP.replace("400.75 300 -0.1 0.02 0.001 -0.002\n2", "400.75 x -0.1 0.02 0.001 -0.002\n2"),
        &["line 3", "\"x\""],
    );
    refused(&OPENCV_YAML.replace("data: [ 700., 0.,", "data: [ 700.,"), &["camera_matrix", "3 rows", "8 numbers"]);
    refused(&OPENCV_YAML.replace("700.", ".Nan"), &["camera_matrix", "\".Nan\" is not a number"]);
    refused(&OPENCV_YAML.replace("700.", ".nan"), &["fx is NaN"]);
    refused(&OPENCV_YAML.replace("700.", "-700."), &["fx is -700", "positive"]);
    refused(&ROS.replace("image_width: 800", "image_width: 0"), &["0 x 600"]);
    refused(&ROS.replace("299.5, 0, 0, 1]", "299.5, 0, 0.1, 1]"), &["camera_matrix", "0.1"]);
    refused(&ROS.replace("-0.1, 0.02, 0.001, -0.002, 0.005", "-0.1, 0.02, 0.001"), &["distortion", "5"]);
    refused(&KALIBR.replace("  resolution: [800, 600]\n  rostopic: /cam0\n", ""), &["cam0", "no resolution"]);
    refused("{\"a\": 1}", &["neither", "calibration.json"]);
    refused("{\"a\": ", &["damaged JSON", "too early"]);
    refused("a: [1, 2\nb: {", &["damaged YAML", "line"]);
    refused("<a><b></a>", &["damaged XML"]);
    refused("<opencv_storage><x>1</x></opencv_storage>", &["no camera_matrix", "x"]);
    refused(&OURS.replace("[0.1, 0.01]]", "[0.1]]"), &["covariance"]);
    // A machine's stack must not decide.
    refused(&"[".repeat(100_000), &["nested"]);
    refused(&"- ".repeat(100_000), &["nested"]);
    refused(&"? ".repeat(100_000), &["nested"]);
    refused(&"<a>".repeat(100_000), &["XML"]);
}

#[test]
fn one_camera_of_several_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("chain.yaml");
    std::fs::write(&path, KALIBR).unwrap();
    let name = path.to_str().unwrap();
    let message = read_camera(name).unwrap_err().to_string();
    assert!(message.contains("cam0, cam1") && message.contains("chain.yaml#cam0"), "{message}");
    assert_eq!(read_camera(format!("{name}#cam1")).unwrap().intrinsics.fx, 650.0);
    assert!(read_camera(format!("{name}#cam7")).unwrap_err().to_string().contains("no camera cam7"));
    assert!(read_camera(folder.path()).unwrap_err().to_string().contains("truth.json"));
    std::fs::write(folder.path().join("truth.json"), TRUTH).unwrap();
    assert_eq!(read_camera(folder.path()).unwrap().format, "truth");
    std::fs::write(&path, [0xff, 0xd8, 0xff, 0x00]).unwrap();
    assert!(read_camera(name).unwrap_err().to_string().contains("expected text"));
}

fn opencv_with(lens_key: &str) -> String {
    OPENCV_YAML.replace("distortion_coefficients", lens_key)
}

#[test]
fn the_lens_is_read_under_any_spelling() {
    for key in [
        "dist_coeff",
        "dist_coeffs",
        "dist_coefs",
        "dist_coef",
        "distCoeffs",
        "distortion_coeffs",
        "Distortion",
        "dist",
        "D",
        "D1",
        "kc",
    ] {
        let text = if key == "D1" { opencv_with(key).replace("camera_matrix", "M1") } else { opencv_with(key) };
        let camera = one(&text);
        assert_eq!(
            (of(&camera, "k1"), of(&camera, "k3"), camera.notes.len()),
            (-0.1, 0.005, 0),
            "{key}: {:?}",
            camera.notes
        );
    }
    // Lists of lists, in YAML and in JSON; coefficients by their names.
    let plain = "camera_matrix:\n- [705.0, 0.0, 409.5]\n- [0.0, 705.0, 291.0]\n- [0.0, 0.0, 1.0]\ndist_coeff:\n- [-0.1, 0.02, 0.0, 0.0, 0.0]\n";
    assert_eq!(of(&one(plain), "k1"), -0.1);
    let json = r#"{"mtx": [[700, 0, 320], [0, 700, 240], [0, 0, 1]], "dist": [[-0.1, 0.02, 0.0, 0.0, 0.0]]}"#;
    assert_eq!((one(json).intrinsics.fx, of(&one(json), "k2")), (700.0, 0.02));
    let named = "K: [700, 0, 320, 0, 700, 240, 0, 0, 1]\nk1: -0.1\nk2: 0.02\nimage_size: [640, 480]\n";
    assert_eq!((of(&one(named), "k1"), one(named).size), (-0.1, Some(ImageSize::new(640, 480))));
    refused(&format!("{named}k4: 0.1\n"), &["k4 is 0.1"]);
    refused(&format!("{plain}D: [1, 2, 3, 4]\n"), &["dist_coeff", "D", "both a lens"]);
}

#[test]
fn a_lens_that_is_missing_or_unknown_is_said() {
    let notes = |text: &str| one(text).notes.join("; ");
    assert!(notes(&opencv_with("unrelated")).contains("no lens distortion in the file"));
    let unknown = notes(&opencv_with("my_lens_polynomial"));
    assert!(unknown.contains("no lens distortion") && unknown.contains("not read: my_lens_polynomial"), "{unknown}");
    assert!(notes(&NERFSTUDIO.replace("\"k3\"", "\"distortion_params\": [1], \"k3\"")).contains("distortion_params"));
    let four = OPENCV_YAML.replace("rows: 5", "rows: 4").replace(", 0.005 ]", " ]");
    assert!(notes(&four).contains("cv2.fisheye"));
    assert_eq!(notes(OPENCV_YAML), "");
}

#[test]
fn both_cameras_of_a_pair_are_reached() {
    let matrix = |f: f64| format!("[{f}, 0, 409.5, 0, {f}, 291, 0, 0, 1]");
    for [k1, d1, k2, d2] in [
        ["M1", "D1", "M2", "D2"],
        ["K1", "D1", "K2", "D2"],
        ["cameraMatrix1", "distCoeffs1", "cameraMatrix2", "distCoeffs2"],
        ["camera_matrix_left", "dist_coeffs_left", "camera_matrix_right", "dist_coeffs_right"],
        ["left_K", "left_dist", "right_K", "right_dist"],
        ["cameraMatrixL", "distCoeffsL", "cameraMatrixR", "distCoeffsR"],
    ] {
        let text = format!(
            "{k1}: {}\n{d1}: [-0.1, 0, 0, 0, 0]\n{k2}: {}\n{d2}: [-0.2, 0, 0, 0, 0]\nR: [1, 0, 0, 0, 1, 0, 0, 0, 1]\nT: [1, 0, 0]\n",
            matrix(705.0),
            matrix(900.0)
        );
        let cameras = parse(&text).unwrap();
        let found: Vec<(&str, f64, f64)> =
            cameras.iter().map(|c| (c.label.as_str(), c.intrinsics.fx, of(c, "k1"))).collect();
        assert_eq!(found, [(k1, 705.0, -0.1), (k2, 900.0, -0.2)]);
    }
}

#[test]
fn cameras_of_frames_are_reached() {
    let frames = |frames: &str| NERFSTUDIO.replace("\"frames\": []", &format!("\"frames\": [{frames}]"));
    let other = r#"{"file_path": "a.png"}, {"file_path": "b.png", "fl_x": 900, "fl_y": 901}, {"file_path": "c.png", "fl_x": 900, "fl_y": 901}"#;
    let cameras = parse(&frames(other)).unwrap();
    let found: Vec<(&str, f64, f64)> =
        cameras.iter().map(|c| (c.label.as_str(), c.intrinsics.fx, of(c, "k1"))).collect();
    assert_eq!(found, [("a.png", 700.0, -0.1), ("b.png", 900.0, -0.1)]);
    assert_eq!(one(&frames(r#"{"file_path": "a.png", "fl_x": 700}"#)).label, "");
    refused(
        &frames(r#"{"file_path": "a\u001b.png", "camera_model": "EQUIRECTANGULAR"}"#),
        &["frames[0]", r"a\u{1b}.png", "EQUIRECTANGULAR"],
    );
    refused(&NERFSTUDIO.replace("\"k1\": -0.1", "\"k1\": \"x\""), &["k1 is not a number"]);
    // instant-ngp: the angle of view.
    let angle = one(r#"{"camera_angle_x": 1.5707963267948966, "w": 800, "h": 600, "frames": []}"#);
    assert!((angle.intrinsics.fx - 400.0).abs() < 1e-9 && angle.intrinsics.cx == 399.5);
    assert_eq!(angle.notes.len(), 3, "{:?}", angle.notes);
}

#[test]
fn sizes_have_the_limits_of_images() {
    refused(
        &ROS.replace("image_width: 800", "image_width: 100000").replace("image_height: 600", "image_height: 100000"),
        &["megapixels"],
    );
    refused(&TRUTH.replace("[800, 600]", "[1e300, 600]"), &["image size"]);
}

#[test]
fn words_of_files_are_printable_and_short() {
    let long = "x".repeat(100_000);
    for text in [
        KALIBR.replace("radtan", &long),
        ROS.replace("plumb_bob", &long),
        format!("{long}: 1\n"),
        NERFSTUDIO.replace("OPENCV", &long),
        TRUTH.replace("radtan", &long),
        COLMAP.replace("SIMPLE_RADIAL", &long.to_uppercase()),
        OPENCV_YAML.replace("700.", &long),
    ] {
        let message = parse(&text).unwrap_err();
        assert!(message.len() < 600, "{} characters: {}", message.len(), &message[..300]);
    }
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a\u{1b}[2J.yaml");
    std::fs::write(&path, KALIBR.replace("radtan", "\"a\\u001b[31m\"")).unwrap();
    let message = read_camera(&path).unwrap_err().to_string();
    assert!(!message.contains(char::is_control) && message.contains(r"\u{1b}[31m"), "{message:?}");
    for (from, to) in [("700,", "\"x\","), ("[800, 600]", "7"), ("\"radtan\"", "7"), ("-0.1", "[]")] {
        let message = parse(&TRUTH.replace(from, to)).unwrap_err();
        assert!(!message.contains("f64") && !message.contains("struct"), "{message}");
    }
    // A few lines that stand for more values than memory holds.
    let mut laughs = String::from("a0: &a0 [1, 2, 3, 4, 5, 6, 7, 8, 9]\n");
    for i in 1..12 {
        laughs += &format!("a{i}: &a{i} [{}]\n", vec![format!("*a{}", i - 1); 9].join(", "));
    }
    refused(&laughs, &["damaged YAML"]);
}
