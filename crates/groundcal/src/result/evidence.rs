//! What a calibration was made from, point by point: for pictures of it, not for its files.
//!
//! Pixels throughout, (0, 0) being the centre of the top-left pixel, as the lens gave them unless *ideal* is said (those of a lens
//! without distortion). A residual is measured less predicted.

use nalgebra::{Matrix3, Vector2};

use crate::{geometry::homography::Homography, pairs::placed_lens::PlacedLens};

/// Everything that was measured and what became of it. Empty where nothing was kept.
#[derive(Debug, Clone, PartialEq, Default)]
#[non_exhaustive]
pub struct Evidence {
    /// Names of the images; `image` below counts in it.
    pub images: Vec<String>,
    /// One for each of the calibration's `motions`.
    pub pairs: Vec<PairEvidence>,
    /// Every point of the joint refinement in every image that sees it, by track, then image.
    pub observations: Vec<ObservationEvidence>,
    /// The lens under which the homographies of [`Self::pairs`] take ideal pixels to ideal pixels; `None`: none was undone.
    pub(crate) lens: Option<PlacedLens>,
}

impl Evidence {
    /// Where a homography between ideal pixels takes a pixel of the first image in the second, lens and all; `None` beyond infinity, and
    /// where the lens gives none.
    pub fn carried(&self, h_b_from_a: &Matrix3<f64>, pixel: &Vector2<f64>) -> Option<Vector2<f64>> {
        let h = Homography::new(*h_b_from_a).ok()?;
        match &self.lens {
            Some(lens) => lens.carried(&h, pixel),
            None => h.apply(pixel),
        }
    }
}

/// What a pair of images showed by itself.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct PairEvidence {
    /// First and second image.
    pub images: [usize; 2],
    /// The plane's homography, row by row: ideal pixels of the first image to those of the second.
    pub h_b_from_a: Option<[[f64; 3]; 3]>,
    /// The imaged circular point in ideal pixels, (real, imaginary) of each homogeneous coordinate; its conjugate is the other.
    pub circular_point: Option<[[f64; 2]; 3]>,
    /// Matches, where a plane was found: features (or points given), then patches.
    pub matches: Vec<MatchEvidence>,
    /// Places in the first image whose patch the second should show and where it was not found again: hidden, moved, or
    /// too little texture.
    pub lost_patches: Vec<[f64; 2]>,
}

/// A match of two images.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MatchEvidence {
    /// In the first image.
    pub a: [f64; 2],
    /// In the second image.
    pub b: [f64; 2],
    /// A patch matched by least squares; otherwise a feature, or a point from elsewhere.
    pub patch: bool,
    /// Whether it agrees with the pair's plane.
    pub accepted: bool,
    /// In the second image, the distance from where the pair's homography takes the first point, pixels; `None` where that is beyond
    /// infinity.
    pub distance_px: Option<f64>,
}

/// A point of the joint refinement in an image.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ObservationEvidence {
    /// The image.
    pub image: usize,
    /// The point; it has two observations or more.
    pub track: usize,
    /// A patch matched by least squares; otherwise a feature, or a point from elsewhere.
    pub patch: bool,
    /// Where it was measured, pixels.
    pub pixel: [f64; 2],
    /// Measured less predicted, pixels.
    pub residual_px: [f64; 2],
    /// Length of the residual in standard deviations of a residual (each of the two coordinates has one).
    pub standardised_residual: f64,
    /// By how much it counted less because its residual is too large for its noise; 1: it did not.
    pub weight: f64,
}
