//! `calibration.json`, as this program writes it (docs/formats.md): [`Calibration`] itself, checked.

use std::{
    collections::HashSet,
    path::{Path, PathBuf},
};

use groundcal::result::{Calibration, Covariance, FORMAT_VERSION, Parameter, SCHEMA_VERSION};

use crate::{
    error::IoError,
    file,
    import::{
        imported::{ImportedCamera, image_size},
        json,
    },
    limits::{FOCAL_LENGTHS_PX, MAX_CAMERA_BYTES},
    text::plain,
};

const HINT: &str = "Name the calibration.json that `groundcal calibrate --out` wrote";
/// How far an eigenvalue of a matrix of correlations may lie below zero: the rounding of numbers that are nearly tied.
const ROUNDING: f64 = 1e-6;

/// The file that [`read`] reads.
pub fn file_of(path: &Path) -> PathBuf {
    if path.is_dir() { path.join("calibration.json") } else { path.to_path_buf() }
}

/// Reads and checks a file, or the `calibration.json` in a folder.
///
/// # Errors
/// [`IoError::File`] that names the file and what is wrong with it.
pub fn read(path: &Path) -> Result<Calibration, IoError> {
    let path = file_of(path);
    let text = file::text(&path, MAX_CAMERA_BYTES, &format!("Not a calibration. {HINT}"))?;
    parse(&text).map_err(|what| IoError::file(&path, what))
}

/// From the file's text; the error says what is wrong with it.
pub fn parse(text: &str) -> Result<Calibration, String> {
    from_value(json::value(text).map_err(|e| format!("not a calibration: {e}. {HINT}"))?)
}

fn from_value(value: serde_json::Value) -> Result<Calibration, String> {
    versions(&value)?;
    let calibration: Calibration =
        json::typed(value).map_err(|e| format!("not a calibration of this program: {e}. {HINT}"))?;
    check(&calibration)?;
    Ok(calibration)
}

/// Whether a file says that it is one of this program.
pub fn looks_like_it(value: &serde_json::Value) -> bool {
    value.get("format_version").is_some() || value.get("schema_version").is_some()
}

/// Refuses what a later version of the program wrote.
fn versions(value: &serde_json::Value) -> Result<(), String> {
    if !looks_like_it(value) {
        return Err(format!("not a calibration: there is no format_version. {HINT}"));
    }
    for (name, newest) in [("format_version", FORMAT_VERSION), ("schema_version", SCHEMA_VERSION)] {
        let Some(version) = value.get(name) else { continue };
        if !version.as_u64().is_some_and(|v| (1..=u64::from(newest)).contains(&v)) {
            let known = if newest == 1 { "1".to_string() } else { format!("1 to {newest}") };
            return Err(format!(
                "{name} is {}, this program reads {known}. Take the program that wrote it, or calibrate again",
                plain(&version.to_string())
            ));
        }
    }
    Ok(())
}

/// Whether the numbers can be those of a calibration; the error names the field.
///
/// # Errors
/// What is wrong, with the name of the field as the file has it.
pub fn check(c: &Calibration) -> Result<(), String> {
    check_camera(c)?;
    covariance(&c.covariance).map_err(|e| format!("covariance.{e}"))?;
    for p in Parameter::ALL {
        if c.standard_deviation(p).is_some_and(|s| !(s.is_finite() && s >= 0.0)) {
            return Err(format!("standard_deviation.{p} must be finite and not negative"));
        }
    }
    if let Some(height) = c.camera_height_m
        && !(height.is_finite() && height > 0.0)
    {
        return Err(format!("camera_height_m is {height}: it must be positive"));
    }
    if !(c.attitude_sigma_deg.is_finite() && c.attitude_sigma_deg >= 0.0) {
        return Err(format!("attitude_sigma_deg is {}: it must be finite and not negative", c.attitude_sigma_deg));
    }
    check_attitudes(c)?;
    check_views(c)?;
    for (i, m) in c.motions.iter().enumerate() {
        index(m.attitude, c.attitudes.len()).map_err(|e| format!("motions[{i}].attitude {e}"))?;
    }
    Ok(())
}

fn check_camera(c: &Calibration) -> Result<(), String> {
    let camera = &c.camera;
    image_size(camera.image_size.map(|side| side as f64)).map_err(|e| format!("camera.image_size: {e}"))?;
    // NaN is in no range.
    for (name, value) in [("fx", camera.fx), ("fy", camera.fy)] {
        if !FOCAL_LENGTHS_PX.contains(&value) {
            return Err(format!("camera.{name} is {value:?}: it must be positive, and 1e7 px at most"));
        }
    }
    // What the lens has is finite when it is read.
    let others = [("cx", camera.cx), ("cy", camera.cy), ("skew", camera.skew)];
    match others.iter().find(|(_, v)| !v.is_finite()) {
        Some((name, value)) => Err(format!("camera.{name} is {value}: it must be finite")),
        None => Ok(()),
    }
}

fn check_attitudes(c: &Calibration) -> Result<(), String> {
    for (i, a) in c.attitudes.iter().enumerate() {
        if !(a.pitch_down_deg.abs() <= 90.0 && a.roll_deg.is_finite()) {
            return Err(format!("attitudes[{i}]: pitch {} and roll {} are no attitude", a.pitch_down_deg, a.roll_deg));
        }
        for m in &a.motions {
            index(Some(*m), c.motions.len()).map_err(|e| format!("attitudes[{i}].motions {e}"))?;
        }
    }
    Ok(())
}

fn check_views(c: &Calibration) -> Result<(), String> {
    let mut known = HashSet::new();
    for (i, v) in c.views.iter().enumerate() {
        let named = |what: String| format!("views[{i}] ({}): {what}", plain(&v.image));
        let position = v.position.unwrap_or([0.0, 0.0, 1.0]);
        let finite = position.iter().chain([&v.yaw_deg, &v.roll_deg]).all(|x| x.is_finite());
        if !(finite && v.pitch_down_deg.abs() <= 90.0 && position[2] > 0.0) {
            return Err(named(
                "angles and position must be finite, the pitch within 90 degrees, the height positive".into(),
            ));
        }
        if !known.insert(v.image.as_str()) {
            return Err(format!("views[{i}]: {} is there twice", plain(&v.image)));
        }
        index(v.attitude, c.attitudes.len()).map_err(|e| named(format!("attitude {e}")))?;
        covariance(&v.covariance).map_err(|e| named(format!("covariance.{e}")))?;
        if let Some(h) = &v.floor_from_image
            && !h.matrix.iter().flatten().chain(h.covariance.iter().flatten()).all(|x| x.is_finite())
        {
            return Err(named("floor_from_image must be finite".into()));
        }
    }
    Ok(())
}

fn index(i: Option<usize>, count: usize) -> Result<(), String> {
    match i {
        Some(i) if i >= count => Err(format!("is {i}: there are {count}")),
        _ => Ok(()),
    }
}

/// Square, named once each, finite, symmetric, and no combination of the parameters with a negative variance.
fn covariance<P: Copy + PartialEq>(c: &Covariance<P>) -> Result<(), String> {
    let n = c.parameters.len();
    let whole = c.matrix.len() == n && c.matrix.iter().all(|row| row.len() == n);
    if !whole || c.matrix.iter().flatten().any(|v| !v.is_finite()) {
        return Err(format!("matrix: expected {n} rows of {n} finite numbers, one for each of its parameters"));
    }
    if (0..n).any(|i| c.parameters[..i].contains(&c.parameters[i])) {
        return Err("parameters: a name is there twice".into());
    }
    let sigma: Vec<f64> = (0..n).map(|i| c.matrix[i][i].max(0.0).sqrt()).collect();
    let unequal = |i: usize, j: usize| {
        let (a, b) = (c.matrix[i][j], c.matrix[j][i]);
        (a - b).abs() > ROUNDING * (sigma[i] * sigma[j]).max(a.abs()).max(b.abs())
    };
    if (0..n).any(|i| (0..i).any(|j| unequal(i, j))) {
        return Err("matrix is not symmetric".into());
    }
    let correlation = nalgebra::DMatrix::from_fn(n, n, |i, j| match sigma[i] * sigma[j] {
        scale if scale > 0.0 => c.matrix[i][j] / scale,
        _ if c.matrix[i][j] == 0.0 => 0.0,
        // A variance of zero or less with something beside it.
        _ => f64::INFINITY,
    });
    // An empty matrix has no eigenvalues to ask for.
    let possible = n == 0
        || correlation.iter().all(|r| r.abs() <= 1.0 + ROUNDING)
            && correlation.symmetric_eigenvalues().iter().all(|e| *e >= -ROUNDING * n as f64);
    if possible { Ok(()) } else { Err("matrix is no covariance: it has a negative variance".into()) }
}

/// The camera with its covariance, for comparisons.
pub(crate) fn camera(value: serde_json::Value) -> Result<ImportedCamera, String> {
    let calibration = from_value(value)?;
    let c = &calibration.camera;
    let model = c.model();
    let size = [model.size.width as f64, model.size.height as f64];
    let camera = ImportedCamera::new("groundcal", Some(size), model.intrinsics, model.lens)?;
    Ok(ImportedCamera {
        covariance: covariance_of_parameters(&calibration),
        lens_source: c.distortion.source,
        ..camera
    })
}

/// The covariance, or else the squares of the standard deviations; nothing where neither is there.
fn covariance_of_parameters(c: &Calibration) -> Option<Covariance<Parameter>> {
    if !c.covariance.parameters.is_empty() {
        return Some(c.covariance.clone());
    }
    let variance = |p: Parameter| c.standard_deviation(p).map_or(0.0, |s| s * s);
    let diagonal = Covariance::from_fn(&Parameter::ALL, |i, j| if i == j { variance(Parameter::ALL[i]) } else { 0.0 });
    Parameter::ALL.iter().any(|p| diagonal.get(*p, *p) > 0.0).then_some(diagonal)
}

#[cfg(test)]
mod tests {
    use super::*;
    use groundcal::{
        floor::placed,
        geometry::ImageSize,
        result::{LensSource, Method, Scene, Warning},
    };

    const SMALL: &str = r#"{"format_version": 1,
        "camera": {"image_size": [800, 600], "fx": 700.0, "fy": 701.0, "cx": 400.0, "cy": 300.0, "skew": 0.0,
                   "distortion": {"model": "radtan", "source": "estimated", "k1": -0.1, "k2": 0.0, "p1": 0.0, "p2": 0.0}},
        "covariance": {"parameters": ["fx", "cx"], "matrix": [[4.0, 0.5], [0.5, 1.0]]},
        "method": "joint", "scene": "floor",
        "attitudes": [{"pitch_down_deg": 50.0, "roll_deg": 1.0, "motions": [0]}],
        "views": [{"image": "a.jpg", "attitude": 0, "origin": "a.jpg", "yaw_deg": 0.0, "pitch_down_deg": 50.0,
                   "roll_deg": 1.0, "position": [0.0, 0.0, 1.0]}],
        "motions": [{"from": "a.jpg", "to": "b.jpg", "used": true, "attitude": 0}],
        "warnings": [{"code": "single_attitude", "message": "Tilt"}]}"#;

    #[test]
    fn what_is_there_is_read_and_the_rest_is_what_is_usual() {
        let c = parse(SMALL).unwrap();
        assert_eq!((c.camera.model().size, c.value(Parameter::K1)), (ImageSize::new(800, 600), -0.1));
        assert_eq!((c.schema_version, c.method, c.scene), (1, Method::Joint, Some(Scene::Floor)));
        assert_eq!(
            (c.covariance.get(Parameter::Cx, Parameter::Fx), c.covariance.get(Parameter::Cy, Parameter::Cy)),
            (0.5, 0.0)
        );
        assert_eq!(c.warnings, [Warning::Other { code: "single_attitude".into(), message: "Tilt".into() }]);
        let placed = placed(&c, 1.4).unwrap();
        assert_eq!((placed.len(), placed[0].view.centre().z), (1, 1.4));
        let camera = r#"{"format_version": 1, "camera": {"image_size": [9, 9], "fx": 7, "fy": 7, "cx": 4, "cy": 4}}"#;
        let c = parse(camera).unwrap();
        assert_eq!((c.camera.distortion.source, c.attitude_sigma_deg), (LensSource::Given, 0.1));
        assert!(c.views.is_empty() && c.covariance.parameters.is_empty());
    }

    #[test]
    fn names_of_earlier_versions_are_read() {
        let motion = r#""used": true, "attitude": 0}"#;
        let earlier = r#""used": false, "tie": true, "rho": 1.25, "rho_sigma": 0.5, "attitude": null}"#;
        let strays = r#"{"code": "large_strays", "numbers": {"sigma_deg": 0.5, "checked_deg": 0.15}, "message": "w"}"#;
        let text = SMALL.replace(motion, earlier).replace(r#""warnings": ["#, &format!(r#""warnings": [{strays}, "#));
        let c = parse(&text).unwrap();
        let m = &c.motions[0];
        assert_eq!((m.cross_attitude_link, m.height_ratio, m.height_ratio_sigma), (true, Some(1.25), Some(0.5)));
        assert_eq!(c.warnings[0].code(), "large_attitude_errors");
        let again = serde_json::to_string(&c).unwrap();
        assert!(again.contains("\"height_ratio\":1.25") && !again.contains("\"rho\""), "{again}");
    }

    #[test]
    fn without_views_the_attitudes_of_the_motions_serve() {
        let mut c = parse(SMALL).unwrap();
        c.views.clear();
        let placed = placed(&c, 1.0).unwrap();
        let names: Vec<&str> = placed.iter().map(|p| p.image.as_str()).collect();
        assert_eq!(names, ["a.jpg", "b.jpg"]);
        assert!(placed.iter().all(|p| p.origin.is_none()));
    }

    #[test]
    fn errors_say_what_is_wrong() {
        let wrong = |from: &str, to: &str, words: &[&str]| {
            let message = parse(&SMALL.replace(from, to)).expect_err(to);
            for word in words {
                assert!(message.contains(word), "\"{word}\" is missing in: {message}");
            }
        };
        wrong("\"fx\": 700.0", "\"fx\": -1.0", &["camera.fx is -1"]);
        wrong("\"cx\": 400.0", "\"cx\": 1e999", &["number out of range"]);
        wrong("\"fx\": 700.0,", "", &["camera: there is no `fx`"]);
        wrong("\"fx\": 700.0", "\"fx\": \"wide\"", &["camera.fx: found the text \"wide\", expected a number"]);
        wrong("[800, 600]", "[100000, 100000]", &["camera.image_size", "megapixels"]);
        wrong("\"format_version\": 1", "\"format_version\": 7", &["format_version is 7", "reads 1 to 2"]);
        let later = "\"format_version\": 1, \"schema_version\": 9";
        wrong("\"format_version\": 1", later, &["schema_version is 9", "reads 1 to 6"]);
        wrong("\"format_version\": 1,", "", &["no format_version", "calibration.json"]);
        wrong("radtan", "omni", &["omni", "radtan"]);
        wrong("\"joint\"", "\"magic\"", &["magic", "rotating"]);
        wrong("[800, 600]", "[0, 600]", &["0 x 600"]);
        wrong("\"position\": [0.0, 0.0, 1.0]", "\"position\": [0.0, 0.0, -1.0]", &["views[0]", "a.jpg", "height"]);
        wrong("\"motions\": [0]", "\"motions\": [1]", &["attitudes[0].motions is 1", "1"]);
        wrong("\"image\": \"a.jpg\", \"attitude\": 0", "\"image\": \"a.jpg\", \"attitude\": 3", &["views[0]", "is 3"]);
        wrong("\"used\": true, \"attitude\": 0", "\"used\": true, \"attitude\": 2", &["motions[0].attitude is 2"]);
        wrong("[0.5, 1.0]", "[0.4, 1.0]", &["covariance.matrix", "symmetric"]);
        wrong("[4.0, 0.5], [0.5, 1.0]", "[4.0, 2.5], [2.5, 1.0]", &["covariance.matrix", "negative variance"]);
        wrong("[4.0, 0.5], [0.5, 1.0]", "[4.0, 0.5], [0.5, -1.0]", &["covariance.matrix", "negative variance"]);
        wrong("[\"fx\", \"cx\"]", "[\"fx\", \"fx\"]", &["covariance.parameters", "twice"]);
        wrong("[\"fx\", \"cx\"]", "[\"fx\", \"zoom\"]", &["zoom"]);
        assert!(parse("fx: 3").unwrap_err().contains("JSON"));
        let mut turning = parse(SMALL).unwrap();
        turning.scene = Some(Scene::Directions);
        turning.views[0].position = None;
        assert!(placed(&turning, 1.0).unwrap_err().to_string().contains("no floor"));
    }
}
