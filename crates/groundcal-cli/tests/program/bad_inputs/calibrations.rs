//! This program's own files: calibration.json and scenes.

const CALIBRATION: &str = r#"{"format_version": 1,
    "camera": {"image_size": [64, 48], "fx": 60.0, "fy": 60.0, "cx": 31.5, "cy": 23.5, "skew": 0.0,
               "distortion": {"model": "radtan", "source": "estimated", "k1": 0.0, "k2": 0.0, "p1": 0.0, "p2": 0.0}},
    "covariance": {"parameters": ["fx", "fy", "cx", "cy", "skew", "k1", "k2"], "matrix": [[4.0, 0, 0, 0, 0, 0, 0],
        [0, 4.0, 0, 0, 0, 0, 0], [0, 0, 4.0, 0, 0, 0, 0], [0, 0, 0, 4.0, 0, 0, 0], [0, 0, 0, 0, 0, 0, 0],
        [0, 0, 0, 0, 0, 0.01, 0], [0, 0, 0, 0, 0, 0, 0.01]]},
    "method": "joint", "scene": "floor", "attitude_sigma_deg": 0.1,
    "attitudes": [{"pitch_down_deg": 50.0, "roll_deg": 1.0, "motions": [0]}],
    "views": [{"image": "a.png", "attitude": 0, "origin": "a.png", "yaw_deg": 0.0, "pitch_down_deg": 50.0, "roll_deg": 1.0,
               "position": [0.0, 0.0, 1.0]}],
    "motions": [{"from": "a.png", "to": "b.png", "used": true, "attitude": 0}],
    "warnings": []}"#;

const SCENE: &str = "[camera]\nimage_size = [64, 48]\nfx = 50\n[sensor]\nsamples_per_pixel = 1\n[[group]]\npitch_down_deg = 50\n[[group.view]]\nfile = \
                     \"a.png\"\nyaw_deg = 0\ncentre_m = [0, 0, 1.5]\n";

pub(super) fn files() -> Vec<(String, Vec<u8>)> {
    let c = |from: &str, to: &str| {
        assert!(CALIBRATION.contains(from), "{from}");
        CALIBRATION.replace(from, to)
    };
    let s = |from: &str, to: &str| {
        assert!(SCENE.contains(from), "{from}");
        SCENE.replace(from, to)
    };
    let view = &CALIBRATION[CALIBRATION.find("{\"image\"").unwrap()..CALIBRATION.find("],\n    \"motions\"").unwrap()];
    let all: Vec<(&str, String)> = vec![
        ("view.json", CALIBRATION.into()),
        ("version.json", c("\"format_version\": 1", "\"format_version\": 7")),
        ("schema.json", c("\"format_version\": 1", "\"format_version\": 1, \"schema_version\": 99")),
        ("no_version.json", c("\"format_version\": 1,", "")),
        ("fx_word.json", c("\"fx\": 60.0", "\"fx\": \"wide\"")),
        ("fx_null.json", c("\"fx\": 60.0", "\"fx\": null")),
        ("fx_missing.json", c("\"fx\": 60.0,", "")),
        ("fx_negative.json", c("\"fx\": 60.0", "\"fx\": -60.0")),
        ("fx_infinite.json", c("\"fx\": 60.0", "\"fx\": 1e999")),
        ("fx_huge.json", c("\"fx\": 60.0", "\"fx\": 1e200")),
        ("huge_size.json", c("[64, 48]", "[100000, 100000]")),
        ("zero_size.json", c("[64, 48]", "[0, 48]")),
        ("size_fraction.json", c("[64, 48]", "[64.5, 48]")),
        ("lens.json", c("radtan", "magic")),
        ("covariance_short.json", c("[4.0, 0, 0, 0, 0, 0, 0],\n", "")),
        ("covariance_negative.json", c("[[4.0,", "[[-4.0,")),
        ("covariance_asymmetric.json", c("[0, 4.0, 0, 0, 0, 0, 0]", "[1, 4.0, 0, 0, 0, 0, 0]")),
        ("covariance_name.json", c("[\"fx\", \"fy\"", "[\"fx\", \"zoom\"")),
        ("no_covariance.json", {
            let (before, after) =
                (CALIBRATION.find("\"covariance\"").unwrap(), CALIBRATION.find("\"method\"").unwrap());
            format!("{}{}", &CALIBRATION[..before], &CALIBRATION[after..])
        }),
        ("sigma_negative.json", c("\"attitude_sigma_deg\": 0.1", "\"attitude_sigma_deg\": -0.1")),
        ("sigma_large.json", c("\"attitude_sigma_deg\": 0.1", "\"attitude_sigma_deg\": 50")),
        (
            "height_sigma_large.json",
            c("\"attitude_sigma_deg\": 0.1", "\"attitude_sigma_deg\": 0.1, \"height_sigma\": 50"),
        ),
        ("priors_twice.json", {
            let prior = r#"{"parameter": "cx", "mean": 30, "sigma": 1, "posterior_over_prior": 1}"#;
            c("\"scene\": \"floor\",", &format!("\"scene\": \"floor\", \"priors\": [{prior}, {prior}],"))
        }),
        ("wide_camera.json", c("\"fx\": 60.0, \"fy\": 60.0", "\"fx\": 0.5, \"fy\": 0.5")),
        (
            "pitch.json",
            c(
                "\"pitch_down_deg\": 50.0, \"roll_deg\": 1.0, \"motions\"",
                "\"pitch_down_deg\": 150.0, \"roll_deg\": 1.0, \"motions\"",
            ),
        ),
        ("height.json", c("[0.0, 0.0, 1.0]", "[0.0, 0.0, -1.0]")),
        ("view_attitude.json", c("\"attitude\": 0, \"origin\"", "\"attitude\": 9, \"origin\"")),
        ("motion_attitude.json", c("\"used\": true, \"attitude\": 0", "\"used\": true, \"attitude\": 9")),
        ("attitude_motion.json", c("\"motions\": [0]", "\"motions\": [9]")),
        ("view_twice.json", c(view, &format!("{view}, {view}"))),
        ("view_escape.json", c("\"image\": \"a.png\"", "\"image\": \"a\\u001b[2J\\u202e.png\"")),
        ("camera_height.json", c("\"method\"", "\"camera_height_m\": -1, \"method\"")),
        ("method.json", c("\"joint\"", "\"magic\"")),
        ("linear.json", c("\"joint\"", "\"linear\"").replace(view, "")),
        ("directions.json", c("\"floor\"", "\"directions\"").replace("[0.0, 0.0, 1.0]", "null")),
        (
            "fisheye.json",
            c(
                "\"radtan\", \"source\": \"estimated\", \"k1\": 0.0, \"k2\": 0.0, \"p1\": 0.0, \"p2\": 0.0",
                "\"fisheye\", \"k1\": 0.01, \"k2\": 0.0, \"k3\": 0.0, \"k4\": 0.0",
            ),
        ),
        (
            "no_views.json",
            c(view, "")
                .replace("{\"from\": \"a.png\", \"to\": \"b.png\", \"used\": true, \"attitude\": 0}", "")
                .replace("\"motions\": [0]", "\"motions\": []"),
        ),
        ("scene.toml", SCENE.into()),
        ("scene_word.toml", s("fx = 50", "fx = \"wide\"")),
        ("scene_negative.toml", s("fx = 50", "fx = -1")),
        ("scene_unknown.toml", s("fx = 50", "focal = 50")),
        ("scene_size.toml", s("[64, 48]", "[30000, 30000]")),
        ("scene_three.toml", s("[64, 48]", "[64, 48, 3]")),
        ("scene_damaged.toml", "[camera\nimage_size = \n".into()),
        ("scene_no_view.toml", SCENE[..SCENE.find("[[group.view]]").unwrap()].into()),
        ("scene_path.toml", s("\"a.png\"", "\"../a.png\"")),
        ("scene_below.toml", s("[0, 0, 1.5]", "[0, 0, -1.5]")),
        ("scene_lens.toml", s("fx = 50", "fx = 50\nlens = { model = \"magic\" }")),
        ("scene_escape.toml", s("\"a.png\"", "\"a\\u001b[2J\"")),
        ("scene_long.toml", s("\"a.png\"", &format!("\"{}\"", "a".repeat(50_000)))),
        ("scene_samples.toml", s("samples_per_pixel = 1", "samples_per_pixel = 0")),
        ("scene_empty.toml", String::new()),
        ("scene_large.toml", "# much\n".repeat(1_000_000)),
    ];
    all.into_iter().map(|(name, content)| (name.to_string(), content.into_bytes())).collect()
}
