//! truth.json of a rendered scene (docs/formats.md).

use groundcal::geometry::{distortion::Distortion, intrinsics::Intrinsics};
use serde::Deserialize;

use crate::import::ImportedCamera;

#[derive(Deserialize)]
struct Truth {
    image_size: [f64; 2],
    fx: f64,
    fy: f64,
    cx: f64,
    cy: f64,
    #[serde(default)]
    skew: f64,
    distortion: Option<Lens>,
}

#[derive(Deserialize)]
struct Lens {
    model: Option<String>,
    #[serde(flatten)]
    coefficients: Distortion,
    #[serde(default)]
    k3: f64,
}

/// The camera; it has no errors.
pub fn camera(text: &str) -> Result<ImportedCamera, String> {
    let t: Truth = serde_json::from_str(text).map_err(|e| format!("not a truth.json: {e}"))?;
    let intrinsics = Intrinsics { fx: t.fx, fy: t.fy, cx: t.cx, cy: t.cy, skew: t.skew };
    let lens = match t.distortion {
        None => Default::default(),
        Some(lens) => match lens.model.as_deref() {
            None | Some("none" | "radtan") => (lens.coefficients, lens.k3),
            Some(other) => return Err(format!("distortion.model is {other}: none or radtan is read")),
        },
    };
    ImportedCamera::new("truth", Some(t.image_size), intrinsics, lens)
}
