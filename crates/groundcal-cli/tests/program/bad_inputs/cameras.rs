//! Cameras in the formats of other programs.

const OPENCV: &str = "%YAML:1.0\n---\nimage_width: 64\nimage_height: 48\ncamera_matrix: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n   data: \
                      [ 60., 0., 31.5, 0., 61., 23.5, 0., 0., 1. ]\ndistortion_coefficients: !!opencv-matrix\n   rows: 1\n   cols: 5\n   dt: d\n   \
                      data: [ -0.1, 0.02, 0., 0., 0. ]\n";
const MATRIX: &str = "[[60, 0, 31.5], [0, 61, 23.5], [0, 0, 1]]";
const KALIBR: &str = "cam0:\n  camera_model: pinhole\n  distortion_coeffs: [-0.1, 0.02, 0.001, -0.002]\n  distortion_model: radtan\n  intrinsics: \
                      [60, 61, 31.5, 23.5]\n  resolution: [64, 48]\n";
const NERFSTUDIO: &str = r#"{"camera_model": "OPENCV", "w": 64, "h": 48, "fl_x": 60, "fl_y": 61, "cx": 32, "cy": 24, "k1": -0.1, "frames": []}"#;
const TRUTH: &str = r#"{"image_size": [64, 48], "fx": 60, "fy": 61, "cx": 31.5, "cy": 23.5, "distortion": {"model": "radtan", "k1": -0.1}}"#;
const XML: &str = "<?xml version=\"1.0\"?>\n<opencv_storage>\n<image_Width>64</image_Width>\n<image_Height>48</image_Height>\n<Camera_Matrix \
                   type_id=\"opencv-matrix\">\n<rows>3</rows><cols>3</cols><dt>d</dt>\n<data>60. 0. 31.5 0. 61. 23.5 0. 0. \
                   1.</data></Camera_Matrix>\n</opencv_storage>\n";

/// A size and a matrix, and what else is given.
fn with(lines: &str) -> String {
    format!("image_width: 64\nimage_height: 48\ncamera_matrix: {MATRIX}\n{lines}\n")
}

/// Ten times ten times ten ... values behind one name.
fn yaml_bomb() -> String {
    let mut text = "a0: &a0 [x,x,x,x,x,x,x,x,x,x]\n".to_string();
    for i in 1..12 {
        let before = format!("*a{}", i - 1);
        text += &format!("a{i}: &a{i} [{}]\n", vec![before; 10].join(" , "));
    }
    text
}

fn xml_bomb() -> String {
    let mut text = "<?xml version=\"1.0\"?>\n<!DOCTYPE z [<!ENTITY a0 \"xxxxxxxxxx\">".to_string();
    for i in 1..12 {
        text += &format!("<!ENTITY a{i} \"{}\">", format!("&a{};", i - 1).repeat(10));
    }
    text + "]>\n<opencv_storage><camera_matrix>&a11;</camera_matrix></opencv_storage>\n"
}

/// A file that an OpenCV program wrote for two cameras.
const STEREO: &str = "%YAML:1.0\n---\nM1: [[60, 0, 31.5], [0, 60, 23.5], [0, 0, 1]]\nD1: [-0.1, 0, 0, 0]\nM2: [[70, 0, 31.5], [0, 70, 23.5], \
                      [0, 0, 1]]\nD2: [-0.2, 0, 0, 0]\nimage_width: 64\nimage_height: 48\n";

pub(super) fn files() -> Vec<(String, Vec<u8>)> {
    let frame = |f: f64| format!(r#"{{"file_path": "{f}.png", "w": 64, "h": 48, "fl_x": {f}, "cx": 32, "cy": 24}}"#);
    let all: Vec<(&str, String)> = vec![
        ("good.yaml", OPENCV.into()),
        ("good.xml", XML.into()),
        ("kalibr.yaml", KALIBR.into()),
        ("truth.json", TRUTH.into()),
        // Each stands for a file that was read wrongly by programs like this one.
        ("dist_coeff.yaml", with("dist_coeff: [-0.1, 0.02, 0, 0, 0]")),
        ("dist_coefs.yaml", with("dist_coefs: [-0.1, 0.02, 0, 0, 0]")),
        ("dist_camel.yaml", with("distCoeffs: [-0.1, 0.02, 0, 0, 0]")),
        ("lens_unknown_name.yaml", with("lens_coeffs_v2: [-0.1, 0.02, 0, 0, 0]")),
        ("lens_missing.yaml", with("")),
        ("stereo.yml", STEREO.into()),
        ("is_fisheye.json", NERFSTUDIO.replace("\"camera_model\": \"OPENCV\"", "\"is_fisheye\": true")),
        ("frame_cameras.json", format!("{{\"frames\": [{}, {}]}}", frame(60.0), frame(70.0))),
        // Files that are none, or not whole.
        ("empty.yaml", String::new()),
        ("prose.yaml", "Dear reader, this is no calibration.\n".into()),
        ("unknown.yaml", "alpha: 1\nbeta: 2\n".into()),
        ("damaged.yaml", "camera_matrix: [1, 2\nimage_width: {\n".into()),
        ("deep.yaml", "[".repeat(100_000)),
        ("deep.json", "{\"format_version\":".to_string() + &"[".repeat(100_000)),
        ("deep.xml", "<a>".repeat(100_000)),
        ("bomb.yaml", yaml_bomb()),
        ("bomb.xml", xml_bomb()),
        ("cut.xml", XML[..XML.len() / 2].into()),
        ("damaged.json", "{\"fl_x\": 1,, }".into()),
        ("cut.json", NERFSTUDIO[..60].into()),
        ("unknown.json", "{\"alpha\": 1}".into()),
        ("markup_large.yaml", "# much\n".to_string() + &"x: 1\n".repeat(1_000_000)),
        // Values that are none.
        ("no_matrix.yaml", "image_width: 64\nimage_height: 48\ndistortion_coefficients: [0, 0, 0, 0, 0]\n".into()),
        ("eight_numbers.yaml", OPENCV.replace(", 0., 1. ]", ", 0. ]")),
        ("zero_focal.yaml", OPENCV.replace("60., 0., 31.5", "0., 0., 31.5")),
        ("negative_focal.yaml", OPENCV.replace("60., 0., 31.5", "-60., 0., 31.5")),
        ("nan_focal.yaml", OPENCV.replace("60., 0., 31.5", ".nan, 0., 31.5")),
        ("word_focal.yaml", OPENCV.replace("60., 0., 31.5", "wide, 0., 31.5")),
        ("escape_value.yaml", with("distortion_coefficients: \"a\\e[2Jb\"")),
        ("long_value.yaml", with(&format!("distortion_coefficients: \"{}\"", "z".repeat(100_000)))),
        ("three_coefficients.yaml", with("distortion_coefficients: [0.1, 0.2, 0.3]")),
        ("rational.yaml", with("distortion_coefficients: [0.1, 0.2, 0, 0, 0, 0.5, 0, 0]")),
        ("omnidirectional.yaml", with("distortion_coefficients: [0.1, 0.2, 0, 0, 0]\nxi: 1.2")),
        ("no_size.yaml", format!("camera_matrix: {MATRIX}\n")),
        (
            "huge_size.yaml",
            OPENCV.replace("image_width: 64\nimage_height: 48", "image_width: 100000\nimage_height: 100000"),
        ),
        ("half_size.yaml", OPENCV.replace("image_width: 64", "image_width: 64.5")),
        ("negative_size.yaml", OPENCV.replace("image_width: 64", "image_width: -64")),
        ("other_shape.yaml", OPENCV.replace("image_width: 64", "image_width: 128")),
        ("folded.yaml", OPENCV.replace("-0.1, 0.02", "-9, 0")),
        ("kalibr_omni.yaml", KALIBR.replace("pinhole", "omni")),
        ("kalibr_lens.yaml", KALIBR.replace("radtan", "fov")),
        ("kalibr_three.yaml", KALIBR.replace("[60, 61, 31.5, 23.5]", "[60, 61, 31.5]")),
        ("kalibr_two.yaml", format!("{KALIBR}{}", KALIBR.replace("cam0", "cam1"))),
        ("colmap_model.txt", "1 FOV 64 48 60 61 32 24 0.5\n".into()),
        ("colmap_count.txt", "1 PINHOLE 64 48 60 61 32\n".into()),
        ("colmap_word.txt", "1 PINHOLE 64 48 60 61 32 mid\n".into()),
        ("nerf_no_focal.json", NERFSTUDIO.replace("\"fl_x\": 60, ", "")),
        ("nerf_model.json", NERFSTUDIO.replace("OPENCV", "FISHEYE624")),
        ("nerf_angle.json", NERFSTUDIO.replace("\"fl_x\": 60, ", "\"camera_angle_x\": 3.5, ")),
        ("nerf_word.json", NERFSTUDIO.replace("\"fl_x\": 60", "\"fl_x\": \"wide\"")),
        ("truth_size.json", TRUTH.replace("[64, 48]", "[64]")),
        ("truth_lens.json", TRUTH.replace("radtan", "magic")),
        ("truth_word.json", TRUTH.replace("\"fx\": 60", "\"fx\": \"wide\"")),
    ];
    let mut all: Vec<(String, Vec<u8>)> = all.into_iter().map(|(n, c)| (n.to_string(), c.into_bytes())).collect();
    all.push(("binary.yaml".into(), (0..=255u8).cycle().skip(1).take(4096).collect()));
    all
}
