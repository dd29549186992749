//! Images as a lens without distortion would have taken them.
//!
//! ```text
//! source pixel = K distort(K'⁻¹ x)        x: pixel of the undistorted image, K' its camera matrix
//! ```
//!
//! Pixel (0, 0) is the centre of the top-left pixel in both.

use nalgebra::Vector2;

use crate::{
    error::Error,
    geometry::{distortion::Distortion, intrinsics::Intrinsics, size::ImageSize},
};

/// Which part of the undistorted scene an image of the same size shows.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Fit {
    /// That of the same camera matrix.
    #[default]
    Same,
    /// Everything the original shows; borders may be empty.
    All,
    /// The largest part, of the image's shape, that leaves nothing empty.
    Crop,
}

/// The undistortion of a camera's images.
#[derive(Debug, Clone, PartialEq)]
pub struct Undistortion {
    original: Intrinsics,
    distortion: Distortion,
    size: ImageSize,
    intrinsics: Intrinsics,
}

/// Points on each side of the image that say how far the undistorted scene reaches.
const BORDER_POINTS: usize = 64;

impl Undistortion {
    /// Of a camera.
    ///
    /// # Errors
    /// [`Error::InvalidInput`] when the lens model folds over within the image (`All`, `Crop`), where nothing can be undone.
    pub fn new(intrinsics: &Intrinsics, distortion: &Distortion, size: ImageSize, fit: Fit) -> Result<Self, Error> {
        let mut new = Self { original: *intrinsics, distortion: *distortion, size, intrinsics: *intrinsics };
        if fit == Fit::Same {
            return Ok(new);
        }
        let folded = || {
            Error::InvalidInput(format!(
                "the lens model (k1 {}, k2 {}) folds over within an image of {size} pixels: its corners cannot be undistorted. Use \
                 the same camera matrix, or calibrate with points out to the corners",
                distortion.k1, distortion.k2
            ))
        };
        // The sides of the image, undistorted, in pixels of the same camera matrix.
        let (w, h) = (size.width as f64, size.height as f64);
        let side = |i: usize| -> Option<Vec<Vector2<f64>>> {
            (0..=BORDER_POINTS)
                .map(|k| {
                    let t = k as f64 / BORDER_POINTS as f64;
                    let (x, y) = [(0.0, t * h), (w, t * h), (t * w, 0.0), (t * w, h)][i];
                    distortion.undistort_pixel(intrinsics, &Vector2::new(x - 0.5, y - 0.5))
                })
                .collect()
        };
        let sides: Option<Vec<_>> = (0..4).map(side).collect();
        let sides = sides.ok_or_else(folded)?;
        let low = |i: usize, c: usize| sides[i].iter().map(|p| p[c]).fold(f64::INFINITY, f64::min);
        let high = |i: usize, c: usize| sides[i].iter().map(|p| p[c]).fold(f64::NEG_INFINITY, f64::max);
        // left, right, top, bottom of what is seen: furthest out, or furthest in.
        let [left, right, top, bottom] = match fit {
            Fit::All => {
                let all = |c: usize, f: &dyn Fn(usize, usize) -> f64, pick: fn(f64, f64) -> f64| {
                    (0..4).map(|i| f(i, c)).reduce(pick).unwrap_or(0.0)
                };
                [all(0, &low, f64::min), all(0, &high, f64::max), all(1, &low, f64::min), all(1, &high, f64::max)]
            }
            _ => [high(0, 0), low(1, 0), high(2, 1), low(3, 1)],
        };
        if !(right - left > 1.0 && bottom - top > 1.0) {
            return Err(folded());
        }
        // One scale for both axes keeps the pixels' shape.
        let scales = [w / (right - left), h / (bottom - top)];
        let scale = if fit == Fit::All { scales[0].min(scales[1]) } else { scales[0].max(scales[1]) };
        let k = intrinsics;
        let [x, y] = size.centre_px();
        new.intrinsics = Intrinsics {
            fx: k.fx * scale,
            fy: k.fy * scale,
            skew: k.skew * scale,
            cx: x + scale * (k.cx - 0.5 * (left + right)),
            cy: y + scale * (k.cy - 0.5 * (top + bottom)),
        };
        Ok(new)
    }

    /// Camera matrix of the undistorted images, which have the size of the originals.
    pub fn intrinsics(&self) -> &Intrinsics {
        &self.intrinsics
    }

    /// The pixel of the original at a pixel of the undistorted image; `None` beyond the lens's fold. It may lie outside the original.
    pub fn source_pixel(&self, pixel: &Vector2<f64>) -> Option<Vector2<f64>> {
        let n = self.intrinsics.normalised_from_pixel(pixel);
        self.distortion.is_one_to_one_at(&n).then(|| self.original.pixel_from_normalised(&self.distortion.distort(&n)))
    }

    /// [`Self::source_pixel`] of every pixel, x and y, row by row; -1 (outside the original) beyond the fold.
    pub fn maps(&self) -> [Vec<f32>; 2] {
        let pixels = (0..self.size.height).flat_map(|y| (0..self.size.width).map(move |x| (x, y)));
        let outside = Vector2::repeat(-1.0);
        pixels
            .map(|(x, y)| self.source_pixel(&Vector2::new(x as f64, y as f64)).unwrap_or(outside))
            .map(|p| (p.x as f32, p.y as f32))
            .unzip::<f32, f32, Vec<f32>, Vec<f32>>()
            .into()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn camera() -> (Intrinsics, ImageSize) {
        (Intrinsics { fx: 500.0, fy: 510.0, cx: 330.0, cy: 232.0, skew: 0.0 }, ImageSize::new(640, 480))
    }

    fn corners_and_sides(size: ImageSize) -> Vec<Vector2<f64>> {
        let (w, h) = (size.width as f64 - 0.5, size.height as f64 - 0.5);
        let at = |t: f64, low: f64, high: f64| low + t * (high - low);
        (0..=20)
            .map(|i| f64::from(i) / 20.0)
            .flat_map(|t| [(-0.5, at(t, -0.5, h)), (w, at(t, -0.5, h)), (at(t, -0.5, w), -0.5), (at(t, -0.5, w), h)])
            .map(|(x, y)| Vector2::new(x, y))
            .collect()
    }

    #[test]
    fn crop_leaves_nothing_empty_and_all_loses_nothing() {
        let (k, size) = camera();
        for lens in [Distortion::radial(-0.25, 0.05), Distortion { k1: 0.1, k2: 0.0, p1: 1e-3, p2: -2e-3 }] {
            let inside = |p: &Vector2<f64>, tolerance: f64| {
                let room = [p.x + 0.5, p.y + 0.5, 639.5 - p.x, 479.5 - p.y];
                room.iter().all(|r| *r > -tolerance)
            };
            let crop = Undistortion::new(&k, &lens, size, Fit::Crop).unwrap();
            let border = corners_and_sides(size);
            assert!(border.iter().all(|p| inside(&crop.source_pixel(p).unwrap(), 0.05)), "{lens:?}");
            let all = Undistortion::new(&k, &lens, size, Fit::All).unwrap();
            for p in &border {
                let n = lens.undistort(&k.normalised_from_pixel(p)).unwrap();
                assert!(inside(&all.intrinsics().pixel_from_normalised(&n), 0.05), "{lens:?} {p}");
            }
            assert!(all.intrinsics().fx < crop.intrinsics().fx);
            // Both touch a border: neither could be better.
            let touches = border.iter().any(|p| !inside(&crop.source_pixel(p).unwrap(), -1.0));
            assert!(touches, "{lens:?}");
        }
    }

    #[test]
    fn without_distortion_every_fit_is_the_identity() {
        let (k, size) = camera();
        for fit in [Fit::Same, Fit::All, Fit::Crop] {
            let u = Undistortion::new(&k, &Distortion::default(), size, fit).unwrap();
            let p = Vector2::new(17.0, 401.0);
            assert!((u.source_pixel(&p).unwrap() - p).norm() < 1e-9, "{fit:?}");
        }
        let [x, y] = Undistortion::new(&k, &Distortion::default(), size, Fit::Same).unwrap().maps();
        assert_eq!((x[640 * 3 + 5], y[640 * 3 + 5]), (5.0, 3.0));
    }

    #[test]
    fn a_lens_that_folds_over_is_refused_or_outside() {
        let (k, size) = camera();
        let folding = Distortion::radial(-1.2, 0.0);
        let error = Undistortion::new(&k, &folding, size, Fit::All).unwrap_err().to_string();
        assert!(error.contains("folds over") && error.contains("k1 -1.2"), "{error}");
        let [x, _] = Undistortion::new(&k, &folding, size, Fit::Same).unwrap().maps();
        assert_eq!(x[0], -1.0);
    }
}
