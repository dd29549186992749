//! Grey images.
//!
//! Pixel (0, 0) is the **centre** of the top-left pixel (OpenCV, ROS, Kalibr; COLMAP counts from the corner).
//! Values are linear in the stored sample: 0 is black, 1 is white.

use crate::geometry::size::ImageSize;

/// A grey image, row by row, values nominally in 0..=1.
#[derive(Debug, Clone, PartialEq)]
pub struct GrayImage {
    size: ImageSize,
    data: Vec<f32>,
}

impl GrayImage {
    /// An image of one value.
    pub fn filled(size: ImageSize, value: f32) -> Self {
        Self { size, data: vec![value; size.width * size.height] }
    }

    /// An image from its rows laid end to end; `None` when the length is not width times height or a value is not finite.
    pub fn from_rows(size: ImageSize, data: Vec<f32>) -> Option<Self> {
        (data.len() == size.width * size.height && data.iter().all(|v| v.is_finite())).then_some(Self { size, data })
    }

    /// An image from rows that are known to be finite and of the right number.
    pub(crate) fn from_parts(size: ImageSize, data: Vec<f32>) -> Self {
        debug_assert_eq!(data.len(), size.width * size.height);
        Self { size, data }
    }

    /// Width and height.
    pub fn size(&self) -> ImageSize {
        self.size
    }

    /// Number of columns.
    pub fn width(&self) -> usize {
        self.size.width
    }

    /// Number of rows.
    pub fn height(&self) -> usize {
        self.size.height
    }

    /// All values, row by row.
    pub fn data(&self) -> &[f32] {
        &self.data
    }

    /// All values, row by row, to be written.
    pub fn data_mut(&mut self) -> &mut [f32] {
        &mut self.data
    }

    /// One row.
    pub fn row(&self, y: usize) -> &[f32] {
        &self.data[y * self.size.width..(y + 1) * self.size.width]
    }

    /// The value of the pixel in column `x` and row `y`.
    #[inline]
    pub fn get(&self, x: usize, y: usize) -> f32 {
        self.data[y * self.size.width + x]
    }
}
