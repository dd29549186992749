//! A camera as the formats give it: below them all.

use groundcal::{
    geometry::{ImageSize, Intrinsics, Lens},
    result::{Covariance, LensSource, Parameter},
};

use crate::limits::{FOCAL_LENGTHS_PX, MAX_PIXELS, SIDES_PX};

/// A camera as a file describes it, pixel (0, 0) being the centre of the top-left pixel whatever the file's convention.
#[derive(Debug, Clone, PartialEq)]
pub struct ImportedCamera {
    /// Name inside the file where it may hold several (`cam0`, `1`, `M2`), else empty.
    pub label: String,
    /// Name of the format.
    pub format: &'static str,
    /// Image size, where the file says it.
    pub size: Option<ImageSize>,
    /// Camera matrix in pixels.
    pub intrinsics: Intrinsics,
    /// Lens.
    pub lens: Lens,
    /// Where its coefficients come from, as far as the file says it.
    pub lens_source: LensSource,
    /// Covariance (rows of what was held are zero), where the file has errors.
    pub covariance: Option<Covariance<Parameter>>,
    /// What was taken for granted, and what was left aside: sentences.
    pub notes: Vec<String>,
}

impl ImportedCamera {
    /// A camera without errors.
    ///
    /// # Errors
    /// What is no camera: the field, its value, and its range.
    pub fn new(
        format: &'static str,
        size: Option<[f64; 2]>,
        intrinsics: Intrinsics,
        lens: Lens,
    ) -> Result<Self, String> {
        let k = &intrinsics;
        for (name, value) in [("fx", k.fx), ("fy", k.fy)] {
            if !FOCAL_LENGTHS_PX.contains(&value) {
                return Err(format!("the focal length {name} is {value:?}: it must be positive, and 1e7 px at most"));
            }
        }
        let of_lens = lens.parameter_names().iter().copied().zip(lens.parameters());
        let mut others = [("cx", k.cx), ("cy", k.cy), ("skew", k.skew)].into_iter().chain(of_lens);
        if let Some((name, value)) = others.find(|(_, v)| !v.is_finite()) {
            return Err(format!("{name} is {value}: it must be finite"));
        }
        let size = size.map(image_size).transpose()?;
        let (label, notes) = (String::new(), Vec::new());
        Ok(Self { label, format, size, intrinsics, lens, lens_source: LensSource::Given, covariance: None, notes })
    }

    /// Under a name of its own.
    pub(crate) fn labelled(self, label: impl Into<String>) -> Self {
        Self { label: label.into(), ..self }
    }

    /// With more notes.
    pub(crate) fn noted(mut self, notes: impl IntoIterator<Item = String>) -> Self {
        self.notes.extend(notes);
        self
    }
}

/// An image size of a file, which has the limits of images.
pub(crate) fn image_size([w, h]: [f64; 2]) -> Result<ImageSize, String> {
    let (least, most) = (*SIDES_PX.start(), *SIDES_PX.end());
    let side = |v: f64| (least as f64..=most as f64).contains(&v) && v.fract() == 0.0;
    if !side(w) || !side(h) {
        return Err(format!("the image size is {w} x {h}: expected whole numbers from {least} to {most}"));
    }
    if w * h > MAX_PIXELS as f64 {
        return Err(format!("the image size is {w} x {h}: at most {} megapixels are read", MAX_PIXELS / 1_000_000));
    }
    Ok(ImageSize::new(w as usize, h as usize))
}
