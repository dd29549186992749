//! `calibration.json`, as this program writes it (docs/formats.md): what other commands need of it, checked.

use std::path::{Path, PathBuf};

use groundcal::{
    error::Error,
    floor::view::FloorView,
    geometry::{distortion::Distortion, intrinsics::Intrinsics, plane_view::View, size::ImageSize},
};
use nalgebra::Vector3;
use serde::Deserialize;

use crate::error::IoError;
use crate::import::imported::{ImportedCamera, PARAMETERS};
use crate::limits::FOCAL_LENGTHS_PX;

/// The version of the format that is read.
const FORMAT_VERSION: u64 = 1;

/// A calibration read from a file.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct Calibration {
    /// The camera.
    pub camera: Camera,
    /// Standard deviations; nothing: not written.
    pub standard_deviation: Option<StandardDeviation>,
    /// Covariance of the camera's numbers.
    pub covariance: Option<Covariance>,
    /// `joint` or `linear`.
    pub method: Option<String>,
    /// `floor` or `directions`; nothing for the linear method.
    pub scene: Option<String>,
    /// Height of the origins' cameras in metres where positions are metres; nothing: that height is 1.
    pub camera_height_m: Option<f64>,
    /// Attitudes to the floor.
    #[serde(default)]
    pub attitudes: Vec<Attitude>,
    /// Views of the joint refinement.
    #[serde(default)]
    pub views: Vec<ImportedView>,
    /// Pairs.
    #[serde(default)]
    pub motions: Vec<Motion>,
    /// Name of the constraint.
    pub constraint: Option<String>,
    /// What was assumed beforehand.
    #[serde(default)]
    pub priors: Vec<Prior>,
    /// How far the views' attitudes stray, degrees.
    pub attitude_sigma_deg: Option<f64>,
    /// How far their heights stray, relative.
    pub height_sigma: Option<f64>,
    /// How well it all agrees.
    pub fit: Option<Fit>,
}

/// A prior.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[allow(missing_docs)]
pub struct Prior {
    pub parameter: String,
    pub mean: f64,
    pub sigma: f64,
}

/// What is read of the fit.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct Fit {
    /// Nothing: the linear method.
    pub refinement: Option<Refinement>,
}

/// What is read of the joint refinement: the residuals of each kind of measurement.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[allow(missing_docs)]
pub struct Refinement {
    pub patches: Option<Residuals>,
    pub points: Option<Residuals>,
}

/// Residuals of one kind of measurement.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[allow(missing_docs)]
pub struct Residuals {
    pub variance_factor: f64,
    pub design_effect: f64,
}

/// Camera matrix and lens, pixels.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[allow(missing_docs)]
pub struct Camera {
    pub image_size: [u64; 2],
    pub fx: f64,
    pub fy: f64,
    pub cx: f64,
    pub cy: f64,
    #[serde(default)]
    pub skew: f64,
    pub distortion: Option<Lens>,
}

/// Lens distortion.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct Lens {
    /// `none` or `radtan`.
    pub model: String,
    /// The coefficients.
    #[serde(flatten)]
    pub coefficients: Distortion,
}

/// Standard deviations; nothing: held.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[allow(missing_docs)]
pub struct StandardDeviation {
    pub fx: Option<f64>,
    pub fy: Option<f64>,
    pub cx: Option<f64>,
    pub cy: Option<f64>,
    pub skew: Option<f64>,
    pub k1: Option<f64>,
    pub k2: Option<f64>,
}

/// Covariance with the names of its rows.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[allow(missing_docs)]
pub struct Covariance {
    pub parameters: Vec<String>,
    pub matrix: Vec<Vec<f64>>,
}

/// An attitude to the floor.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[allow(missing_docs)]
pub struct Attitude {
    pub pitch_down_deg: f64,
    pub roll_deg: f64,
    #[serde(default)]
    pub motions: Vec<usize>,
}

/// A view.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[allow(missing_docs)]
pub struct ImportedView {
    pub image: String,
    pub origin: String,
    pub attitude: Option<usize>,
    pub yaw_deg: f64,
    pub pitch_down_deg: f64,
    pub roll_deg: f64,
    pub position: Option<[f64; 3]>,
}

/// A pair of images.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[allow(missing_docs)]
pub struct Motion {
    pub from: String,
    pub to: String,
    pub used: bool,
    pub attitude: Option<usize>,
    pub rotation_deg: Option<f64>,
    pub matches: Option<f64>,
    pub rms_px: Option<f64>,
}

/// Where an image was taken from, over the floor.
#[derive(Debug, Clone, PartialEq)]
pub struct Placed {
    /// Name of the image.
    pub image: String,
    /// Image whose foot is the origin of its world; nothing: a world of its own (heading +X, height 1).
    pub origin: Option<String>,
    /// The view.
    pub view: FloorView,
}

impl Calibration {
    /// Reads and checks a file, or the `calibration.json` in a folder.
    ///
    /// # Errors
    /// [`IoError::Input`] that names the file and what is wrong with it.
    pub fn read(path: &Path) -> Result<Self, IoError> {
        let path: PathBuf = if path.is_dir() { path.join("calibration.json") } else { path.to_path_buf() };
        let fail = |what: String| IoError::Input(format!("{}: {what}", path.display()));
        let text = match std::fs::read_to_string(&path) {
            Ok(text) => text,
            Err(e) if e.kind() == std::io::ErrorKind::InvalidData => {
                return Err(fail(
                    "not a calibration (no text). Name the calibration.json of `groundcal calibrate --out`".into(),
                ));
            }
            Err(e) => return Err(fail(format!("cannot be read: {e}"))),
        };
        Self::parse(&text).map_err(fail)
    }

    /// From the file's text; the error says what is wrong with it.
    pub fn parse(text: &str) -> Result<Self, String> {
        const HINT: &str = "Name the calibration.json that `groundcal calibrate --out` wrote";
        let value: serde_json::Value =
            serde_json::from_str(text).map_err(|e| format!("not a calibration: no JSON ({e}). {HINT}"))?;
        match value.get("format_version").map(|v| v.as_u64()) {
            Some(Some(FORMAT_VERSION)) => {}
            Some(_) => {
                return Err(format!(
                    "format_version is {}, this program reads {FORMAT_VERSION}. Take the program that wrote it, or calibrate again",
                    value["format_version"]
                ));
            }
            None => return Err(format!("not a calibration: there is no format_version. {HINT}")),
        }
        let calibration: Self =
            serde_json::from_value(value).map_err(|e| format!("not a calibration of this program: {e}. {HINT}"))?;
        calibration.check()?;
        Ok(calibration)
    }

    fn check(&self) -> Result<(), String> {
        let c = &self.camera;
        let [width, height] = c.image_size;
        if !(2..=100_000).contains(&width) || !(2..=100_000).contains(&height) {
            return Err(format!("camera.image_size is {width} x {height}: both must lie between 2 and 100000"));
        }
        // NaN is in no range.
        for (name, value) in [("fx", c.fx), ("fy", c.fy)] {
            if !FOCAL_LENGTHS_PX.contains(&value) {
                return Err(format!("camera.{name} is {value:?}: it must be positive, and 1e7 px at most"));
            }
        }
        let lens = c.lens();
        let others = [
            ("cx", c.cx),
            ("cy", c.cy),
            ("skew", c.skew),
            ("distortion.k1", lens.k1),
            ("distortion.k2", lens.k2),
            ("distortion.p1", lens.p1),
            ("distortion.p2", lens.p2),
        ];
        if let Some((name, value)) = others.iter().find(|(_, v)| !v.is_finite()) {
            return Err(format!("camera.{name} is {value}: it must be finite"));
        }
        if let Some(lens) = &c.distortion
            && !matches!(lens.model.as_str(), "none" | "radtan")
        {
            return Err(format!("camera.distortion.model is \"{}\": none or radtan is known", lens.model));
        }
        if let Some(height) = self.camera_height_m
            && !(height.is_finite() && height > 0.0)
        {
            return Err(format!("camera_height_m is {height}: it must be positive"));
        }
        for (i, a) in self.attitudes.iter().enumerate() {
            if !(a.pitch_down_deg.abs() <= 90.0 && a.roll_deg.is_finite()) {
                return Err(format!(
                    "attitudes[{i}]: pitch {} and roll {} are no attitude",
                    a.pitch_down_deg, a.roll_deg
                ));
            }
        }
        for (i, v) in self.views.iter().enumerate() {
            let position = v.position.unwrap_or([0.0, 0.0, 1.0]);
            let finite = position.iter().chain([&v.yaw_deg, &v.roll_deg]).all(|x| x.is_finite());
            if !(finite && v.pitch_down_deg.abs() <= 90.0 && position[2] > 0.0) {
                return Err(format!(
                    "views[{i}] ({}): angles and position must be finite, the pitch within 90 degrees, the height positive",
                    v.image
                ));
            }
            if self.views[..i].iter().any(|other| other.image == v.image) {
                return Err(format!("views[{i}]: {} is there twice", v.image));
            }
        }
        Ok(())
    }

    /// Every image over the floor, in the order of the file: those of the joint refinement, each in the world of its origin; of the
    /// linear method those of the motions used, each in a world of its own. Positions are multiplied by `scale`.
    ///
    /// # Errors
    /// [`IoError::Input`] where no view has a floor below it.
    pub fn placed(&self, scale: f64) -> Result<Vec<Placed>, IoError> {
        let at = |pitch_deg: f64, roll_deg: f64, yaw_deg: f64, position: [f64; 3]| {
            let view = View {
                pitch_down_rad: pitch_deg.to_radians(),
                roll_rad: roll_deg.to_radians(),
                yaw_rad: yaw_deg.to_radians(),
                centre: Vector3::from(position) * scale,
            };
            FloorView::new(&self.camera.intrinsics(), &self.camera.lens(), &view)
        };
        let placed: Result<Vec<Placed>, Error> = if self.views.is_empty() {
            self.attitude_of_images()
                .into_iter()
                .map(|(image, a)| {
                    let a = &self.attitudes[a];
                    let view = at(a.pitch_down_deg, a.roll_deg, 0.0, [0.0, 0.0, 1.0])?;
                    Ok(Placed { image: image.into(), origin: None, view })
                })
                .collect()
        } else {
            let of_view = |v: &ImportedView| {
                let position = v.position?;
                let view = at(v.pitch_down_deg, v.roll_deg, v.yaw_deg, position);
                Some(view.map(|view| Placed { image: v.image.clone(), origin: Some(v.origin.clone()), view }))
            };
            self.views.iter().filter_map(of_view).collect()
        };
        let placed = placed?;
        if placed.is_empty() {
            return Err(IoError::Input(match self.scene.as_deref() {
                Some("directions") => "the calibration has no floor: its camera turned on the spot before a distant scene \
                                       (\"scene\": \"directions\"), so no view has a position over a plane. Only a calibration \
                                       from a floor can be rectified"
                    .into(),
                _ => "the calibration has neither views nor attitudes to a floor. Calibrate from images or matches of a floor".into(),
            }));
        }
        Ok(placed)
    }

    /// Images of the motions used, in order of appearance, with their attitudes.
    fn attitude_of_images(&self) -> Vec<(&str, usize)> {
        let mut found: Vec<(&str, usize)> = Vec::new();
        for m in self.motions.iter().filter(|m| m.used) {
            let Some(a) = m.attitude.filter(|a| *a < self.attitudes.len()) else { continue };
            for image in [m.from.as_str(), m.to.as_str()] {
                if !found.iter().any(|(known, _)| *known == image) {
                    found.push((image, a));
                }
            }
        }
        found
    }
}

impl Camera {
    /// Width and height.
    pub fn size(&self) -> ImageSize {
        ImageSize::new(self.image_size[0] as usize, self.image_size[1] as usize)
    }

    /// The camera matrix.
    pub fn intrinsics(&self) -> Intrinsics {
        Intrinsics { fx: self.fx, fy: self.fy, cx: self.cx, cy: self.cy, skew: self.skew }
    }

    /// The lens.
    pub fn lens(&self) -> Distortion {
        self.distortion.as_ref().map_or(Distortion::default(), |l| l.coefficients)
    }
}

/// The camera with its covariance, for comparisons.
pub fn camera(text: &str) -> Result<ImportedCamera, String> {
    let calibration = Calibration::parse(text)?;
    let c = &calibration.camera;
    let size = [c.size().width as f64, c.size().height as f64];
    let camera = ImportedCamera::new("groundcal", Some(size), c.intrinsics(), (c.lens(), 0.0))?;
    Ok(ImportedCamera { covariance: calibration.covariance_of_parameters()?, ..camera })
}

impl Calibration {
    /// The covariance in the order of [`PARAMETERS`], or the squares of the standard deviations; nothing where neither is there.
    fn covariance_of_parameters(&self) -> Result<Option<[[f64; 7]; 7]>, String> {
        let mut full = [[0.0; 7]; 7];
        if let Some(covariance) = &self.covariance {
            let n = covariance.parameters.len();
            let whole = covariance.matrix.len() == n && covariance.matrix.iter().all(|row| row.len() == n);
            if !whole || covariance.matrix.iter().flatten().any(|v| !v.is_finite()) {
                return Err(format!(
                    "covariance.matrix: expected {n} rows of {n} finite numbers, one for each of its parameters"
                ));
            }
            let place: Vec<Option<usize>> =
                covariance.parameters.iter().map(|name| PARAMETERS.iter().position(|p| p == name)).collect();
            for (i, row) in covariance.matrix.iter().enumerate() {
                for (j, value) in row.iter().enumerate() {
                    if let (Some(to_i), Some(to_j)) = (place[i], place[j]) {
                        full[to_i][to_j] = *value;
                    }
                }
            }
            return Ok(Some(full));
        }
        let Some(s) = &self.standard_deviation else { return Ok(None) };
        for (i, sigma) in [s.fx, s.fy, s.cx, s.cy, s.skew, s.k1, s.k2].into_iter().enumerate() {
            full[i][i] = sigma.map_or(0.0, |v| v * v);
        }
        Ok(Some(full))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SMALL: &str = r#"{"format_version": 1,
        "camera": {"image_size": [800, 600], "fx": 700.0, "fy": 701.0, "cx": 400.0, "cy": 300.0, "skew": 0.0,
                   "distortion": {"model": "radtan", "source": "estimated", "k1": -0.1, "k2": 0.0, "p1": 0.0, "p2": 0.0}},
        "method": "joint", "scene": "floor",
        "attitudes": [{"pitch_down_deg": 50.0, "roll_deg": 1.0, "motions": [0]}],
        "views": [{"image": "a.jpg", "attitude": 0, "origin": "a.jpg", "yaw_deg": 0.0, "pitch_down_deg": 50.0,
                   "roll_deg": 1.0, "position": [0.0, 0.0, 1.0]}],
        "motions": [{"from": "a.jpg", "to": "b.jpg", "used": true, "attitude": 0}]}"#;

    #[test]
    fn what_is_needed_is_read() {
        let c = Calibration::parse(SMALL).unwrap();
        assert_eq!((c.camera.size(), c.camera.lens().k1), (ImageSize::new(800, 600), -0.1));
        let placed = c.placed(1.4).unwrap();
        assert_eq!((placed.len(), placed[0].view.centre().z), (1, 1.4));
    }

    #[test]
    fn without_views_the_attitudes_of_the_motions_serve() {
        let mut c = Calibration::parse(SMALL).unwrap();
        c.views.clear();
        let placed = c.placed(1.0).unwrap();
        let names: Vec<&str> = placed.iter().map(|p| p.image.as_str()).collect();
        assert_eq!(names, ["a.jpg", "b.jpg"]);
        assert!(placed.iter().all(|p| p.origin.is_none()));
    }

    #[test]
    fn errors_say_what_is_wrong() {
        let wrong = |from: &str, to: &str, words: &[&str]| {
            let message = Calibration::parse(&SMALL.replace(from, to)).unwrap_err();
            for word in words {
                assert!(message.contains(word), "\"{word}\" is missing in: {message}");
            }
        };
        wrong("\"fx\": 700.0", "\"fx\": -1.0", &["camera.fx is -1"]);
        wrong("\"cx\": 400.0", "\"cx\": 1e999", &["number out of range"]);
        wrong("\"fx\": 700.0,", "", &["fx"]);
        wrong("\"format_version\": 1", "\"format_version\": 7", &["format_version is 7", "reads 1"]);
        wrong("\"format_version\": 1,", "", &["no format_version", "calibration.json"]);
        wrong("radtan", "fisheye", &["fisheye", "radtan"]);
        wrong("[800, 600]", "[0, 600]", &["0 x 600"]);
        wrong("\"position\": [0.0, 0.0, 1.0]", "\"position\": [0.0, 0.0, -1.0]", &["views[0]", "a.jpg", "height"]);
        assert!(Calibration::parse("fx: 3").unwrap_err().contains("no JSON"));
        let mut turning = Calibration::parse(SMALL).unwrap();
        turning.scene = Some("directions".into());
        turning.views[0].position = None;
        assert!(turning.placed(1.0).unwrap_err().to_string().contains("no floor"));
    }
}
