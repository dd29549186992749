//! Width and height of an image. Pixel (0, 0) is the **centre** of the top-left pixel.

/// Width and height of an image in pixels.
///
/// # Examples
/// ```
/// use groundcal::ImageSize;
/// // Pixel (0, 0) is the centre of the top-left pixel.
/// assert_eq!(ImageSize::new(640, 480).centre_px(), [319.5, 239.5]);
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct ImageSize {
    /// Number of columns.
    pub width: usize,
    /// Number of rows.
    pub height: usize,
}

impl ImageSize {
    /// An image size; see [`ImageSize::width`] and [`ImageSize::height`].
    pub fn new(width: usize, height: usize) -> Self {
        Self { width, height }
    }

    /// The centre of the image in pixel coordinates: ((w - 1) / 2, (h - 1) / 2).
    pub fn centre_px(self) -> [f64; 2] {
        [(self.width as f64 - 1.0) / 2.0, (self.height as f64 - 1.0) / 2.0]
    }

    /// Half the mean side, in pixels: the unit of the normalised image frame.
    pub(crate) fn half_mean_side_px(self) -> f64 {
        (self.width + self.height) as f64 / 4.0
    }

    /// Whether it is another size scaled as a whole: off by the rounding of a side at most.
    pub(crate) fn has_shape_of(self, other: Self) -> bool {
        let [w, h, other_w, other_h] = [self.width, self.height, other.width, other.height].map(|side| side as f64);
        let (sx, sy) = (w / other_w, h / other_h);
        (sx * other_h - h).abs() < 1.0 || (sy * other_w - w).abs() < 1.0 || (other_h - h / sx).abs() < 1.0
    }
}

impl std::fmt::Display for ImageSize {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}x{}", self.width, self.height)
    }
}
