//! Reading calibrations: this program's and those of others. The content tells the format, not the name.

pub mod colmap;
pub mod groundcal_json;
pub mod kalibr;
pub mod nerfstudio;
pub mod node;
pub mod opencv;
pub mod ros;
pub mod truth_json;

use std::path::{Path, PathBuf};

use groundcal::{
    geometry::{distortion::Distortion, intrinsics::Intrinsics, size::ImageSize},
    result::{Covariance, Parameter},
};
use node::Node;

use crate::error::IoError;

/// What is read, for messages.
const READ: &str = "calibration.json and truth.json of this program, OpenCV (YAML or XML), ROS camera_info, Kalibr camchain, \
                    COLMAP cameras.txt and transforms.json are read";
/// Focal lengths that a camera can have: the longest telescope on the finest pixels stays below.
const FOCAL_LENGTHS_PX: std::ops::RangeInclusive<f64> = 1e-3..=1e7;
/// A calibration is a small file; a model with this many bytes is something else.
const MAX_BYTES: u64 = 64 << 20;

/// A camera as a file describes it, pixel (0, 0) being the centre of the top-left pixel whatever the file's convention.
#[derive(Debug, Clone, PartialEq)]
pub struct ImportedCamera {
    /// Name inside the file where it may hold several (`cam0`, `1`), else empty.
    pub label: String,
    /// Name of the format.
    pub format: &'static str,
    /// Image size, where the file says it.
    pub size: Option<ImageSize>,
    /// Camera matrix in pixels.
    pub intrinsics: Intrinsics,
    /// Lens.
    pub distortion: Distortion,
    /// Radial coefficient of sixth order.
    pub k3: f64,
    /// Covariance (rows of what was held are zero), where the file has errors.
    pub covariance: Option<Covariance<Parameter>>,
}

impl ImportedCamera {
    /// A camera without errors; refused where its numbers are no camera.
    pub fn new(
        format: &'static str,
        size: Option<[f64; 2]>,
        intrinsics: Intrinsics,
        (distortion, k3): (Distortion, f64),
    ) -> Result<Self, String> {
        let k = &intrinsics;
        for (name, value) in [("fx", k.fx), ("fy", k.fy)] {
            if !FOCAL_LENGTHS_PX.contains(&value) {
                return Err(format!("the focal length {name} is {value:?}: it must be positive, and 1e7 px at most"));
            }
        }
        let d = &distortion;
        let others = [
            ("cx", k.cx),
            ("cy", k.cy),
            ("skew", k.skew),
            ("k1", d.k1),
            ("k2", d.k2),
            ("p1", d.p1),
            ("p2", d.p2),
            ("k3", k3),
        ];
        if let Some((name, value)) = others.iter().find(|(_, v)| !v.is_finite()) {
            return Err(format!("{name} is {value}: it must be finite"));
        }
        let size = match size {
            None => None,
            Some([w, h]) => {
                let side = |v: f64| (2.0..=100_000.0).contains(&v) && v.fract() == 0.0;
                if !side(w) || !side(h) {
                    return Err(format!("the image size is {w} x {h}: expected whole numbers from 2 to 100000"));
                }
                Some(ImageSize::new(w as usize, h as usize))
            }
        };
        Ok(Self { label: String::new(), format, size, intrinsics, distortion, k3, covariance: None })
    }

    /// Under a name of its own.
    pub fn labelled(self, label: impl Into<String>) -> Self {
        Self { label: label.into(), ..self }
    }
}

/// k1, k2, p1, p2[, k3[, ...]] as OpenCV orders them; what lies beyond must be zero.
pub fn brown_conrady(coefficients: &[f64]) -> Result<(Distortion, f64), String> {
    let at = |i: usize| coefficients.get(i).copied().unwrap_or(0.0);
    match coefficients.len() {
        0 | 4 | 5 | 8 | 12 | 14 => {}
        n => return Err(format!("{n} distortion coefficients: expected k1, k2, p1, p2 and perhaps k3")),
    }
    if let Some(i) = (5..coefficients.len()).find(|i| coefficients[*i] != 0.0) {
        return Err(format!(
            "distortion coefficient {} is {}: only k1, k2, p1, p2, k3 are read, not the rational, thin-prism or tilted models",
            i + 1,
            coefficients[i]
        ));
    }
    Ok((Distortion { k1: at(0), k2: at(1), p1: at(2), p2: at(3) }, at(4)))
}

/// The camera of a file; `FILE#NAME` where the file has several. A folder stands for its calibration.json (or truth.json).
///
/// # Errors
/// [`IoError::Input`] that names the file, what was expected and what was found.
pub fn read(argument: &str) -> Result<ImportedCamera, IoError> {
    let whole = Path::new(argument);
    let (path, wanted) = match argument.rsplit_once('#') {
        Some((path, name)) if !whole.exists() => (Path::new(path), Some(name)),
        _ => (whole, None),
    };
    let path: PathBuf = match ["calibration.json", "truth.json"].map(|n| path.join(n)).into_iter().find(|p| p.is_file())
    {
        Some(inside) if path.is_dir() => inside,
        _ if path.is_dir() => {
            return Err(IoError::Input(format!(
                "{}: a folder without calibration.json and truth.json. Name the file of the camera",
                path.display()
            )));
        }
        _ => path.to_path_buf(),
    };
    let fail = |what: String| IoError::Input(format!("{}: {what}", path.display()));
    let length = std::fs::metadata(&path).map_err(|e| fail(format!("cannot be read: {e}")))?.len();
    if length > MAX_BYTES {
        return Err(fail(format!("no calibration: {} MiB. {READ}", length >> 20)));
    }
    let bytes = std::fs::read(&path).map_err(|e| fail(format!("cannot be read: {e}")))?;
    let text = String::from_utf8(bytes).map_err(|_| fail(format!("no calibration: expected text. {READ}")))?;
    let mut cameras = parse(&text).map_err(fail)?;
    let labels: Vec<&str> = cameras.iter().map(|c| c.label.as_str()).collect();
    let hint = || format!("it has {}. Write {}#{}", labels.join(", "), path.display(), labels[0]);
    let at = match wanted {
        Some(name) => labels.iter().position(|l| *l == name).ok_or_else(|| {
            fail(if labels == [""] {
                format!("it has one camera only: leave out #{name}")
            } else {
                format!("no camera {name}: {}", hint())
            })
        })?,
        None if labels.len() > 1 => return Err(fail(format!("{} cameras, one is compared: {}", labels.len(), hint()))),
        None => 0,
    };
    Ok(cameras.swap_remove(at))
}

/// All cameras of a file, one at least.
fn parse(text: &str) -> Result<Vec<ImportedCamera>, String> {
    let text = text.trim_start_matches('\u{feff}').trim_start();
    if text.is_empty() {
        return Err(format!("the file is empty. {READ}"));
    }
    if text.starts_with('{') {
        let value: serde_json::Value = serde_json::from_str(text).map_err(|e| format!("damaged JSON: {e}"))?;
        return match &value {
            v if groundcal_json::looks_like_it(v) => groundcal_json::camera(text).map(|c| vec![c]),
            v if v.get("fl_x").is_some() || v.get("frames").is_some() => nerfstudio::camera(v).map(|c| vec![c]),
            v if v.get("image_size").is_some() && v.get("fx").is_some() => truth_json::camera(text).map(|c| vec![c]),
            _ => Err(format!(
                "JSON, but neither calibration.json (format_version), truth.json (image_size, fx) nor transforms.json (fl_x). {READ}"
            )),
        };
    }
    if text.starts_with('<') {
        return opencv::camera(&Node::from_xml(text)?).map(|c| vec![c]);
    }
    if colmap::looks_like_it(text) {
        return colmap::cameras(text);
    }
    let root = Node::from_yaml(text)?;
    if kalibr::looks_like_it(&root) {
        kalibr::cameras(&root)
    } else if ros::looks_like_it(&root) {
        ros::camera(&root).map(|c| vec![c])
    } else if opencv::looks_like_it(&root) {
        opencv::camera(&root).map(|c| vec![c])
    } else {
        let keys = root.keys();
        let found = if keys.is_empty() {
            "text without named values".to_string()
        } else {
            let more = if keys.len() > 8 { ", ..." } else { "" };
            format!("the keys {}{more}", keys[..keys.len().min(8)].join(", "))
        };
        Err(format!(
            "no calibration: expected camera_matrix (OpenCV, ROS), cam0 (Kalibr) or lines of COLMAP cameras.txt, found {found}. {READ}"
        ))
    }
}

#[cfg(test)]
mod tests;
