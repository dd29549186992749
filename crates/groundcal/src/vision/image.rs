//! Grey images.
//!
//! Pixel (0, 0) is the **centre** of the top-left pixel (OpenCV, ROS, Kalibr; COLMAP counts from the corner).
//! Values are linear in the stored sample: 0 is black, 1 is white.

use std::sync::Arc;

use crate::{error::Error, geometry::size::ImageSize, vision::mask::Mask};

/// A grey image, row by row, values nominally in 0..=1. A copy costs nothing until its values are written.
///
/// # Examples
/// ```
/// use groundcal::{GrayImage, ImageSize};
/// let ramp = (0..12).map(|i| i as f32 / 12.0).collect();
/// let image = GrayImage::from_rows(ImageSize::new(4, 3), ramp).expect("as many values as pixels");
/// assert_eq!(image.get(1, 2), 9.0 / 12.0);
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct GrayImage {
    size: ImageSize,
    /// Shared by copies with another mask.
    data: Arc<Vec<f32>>,
    /// What of it is used; all, where there is none.
    mask: Option<Arc<Mask>>,
}

impl GrayImage {
    /// An image of one value.
    pub fn filled(size: ImageSize, value: f32) -> Self {
        Self { size, data: Arc::new(vec![value; size.width * size.height]), mask: None }
    }

    /// An image from its rows laid end to end; `None` when the length is not width times height or a value is not finite.
    pub fn from_rows(size: ImageSize, data: Vec<f32>) -> Option<Self> {
        (data.len() == size.width * size.height && data.iter().all(|v| v.is_finite())).then_some(Self {
            size,
            data: Arc::new(data),
            mask: None,
        })
    }

    /// An image from rows that are known to be finite and of the right number.
    pub(crate) fn from_parts(size: ImageSize, data: Vec<f32>) -> Self {
        debug_assert_eq!(data.len(), size.width * size.height);
        Self { size, data: Arc::new(data), mask: None }
    }

    /// The same image, of which only what the mask holds is used (and what a mask that it has already does).
    ///
    /// # Errors
    /// [`Error::InvalidInput`] where the mask has another size.
    ///
    /// ```
    /// use std::sync::Arc;
    /// use groundcal::{geometry::ImageSize, vision::{GrayImage, Mask}};
    ///
    /// let size = ImageSize::new(4, 3);
    /// let upper_row = Mask::new(size, &(0..12).map(|i| i < 4).collect::<Vec<_>>()).expect("12 pixels");
    /// let image = GrayImage::filled(size, 0.5).masked(Arc::new(upper_row))?;
    /// assert!(image.mask().is_some_and(|mask| !mask.contains(0.0, 1.0)));
    /// # Ok::<(), groundcal::Error>(())
    /// ```
    pub fn masked(self, mask: Arc<Mask>) -> Result<Self, Error> {
        if mask.size() != self.size {
            return Err(Error::InvalidInput(format!("a mask of {} pixels for an image of {}", mask.size(), self.size)));
        }
        let mask = match &self.mask {
            None => mask,
            Some(before) => Arc::new(before.and(&mask)?),
        };
        Ok(Self { mask: Some(mask), ..self })
    }

    /// What of it is used; `None`: all.
    pub fn mask(&self) -> Option<&Arc<Mask>> {
        self.mask.as_ref()
    }

    /// Fraction of the pixels used in a square of half side `reach` about a place (see [`Mask::share`]); 1 without a mask.
    pub(crate) fn used_about(&self, x: f64, y: f64, reach: f64) -> f64 {
        self.mask.as_ref().map_or(1.0, |mask| mask.share(x, y, reach))
    }

    /// Width and height.
    pub fn size(&self) -> ImageSize {
        self.size
    }

    /// Number of columns.
    pub(crate) fn width(&self) -> usize {
        self.size.width
    }

    /// Number of rows.
    pub(crate) fn height(&self) -> usize {
        self.size.height
    }

    /// All values, row by row.
    pub fn data(&self) -> &[f32] {
        &self.data
    }

    /// All values, row by row, to be written.
    pub fn data_mut(&mut self) -> &mut [f32] {
        Arc::make_mut(&mut self.data).as_mut_slice()
    }

    /// One row.
    pub(crate) fn row(&self, y: usize) -> &[f32] {
        &self.data[y * self.size.width..(y + 1) * self.size.width]
    }

    /// The value of the pixel in column `x` and row `y`.
    #[inline]
    pub fn get(&self, x: usize, y: usize) -> f32 {
        self.data[y * self.size.width + x]
    }
}
