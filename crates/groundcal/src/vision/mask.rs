//! Which pixels of an image are used.
//!
//! A mask belongs to an image ([`GrayImage::masked`](crate::vision::image::GrayImage::masked)). A feature is used where its centre and most of
//! what its descriptor covers lie inside; a patch where all of it does, since least squares would be drawn by the part that moves otherwise.

use crate::{error::Error, geometry::size::ImageSize};

/// The pixels that are used, and how many of them any square holds.
///
/// # Examples
/// ```
/// use std::sync::Arc;
/// use groundcal::{GrayImage, ImageSize, Mask};
/// // The lower rows show the robot itself.
/// let size = ImageSize::new(4, 4);
/// let used: Vec<bool> = (0..16).map(|i| i < 12).collect();
/// let mask = Mask::new(size, &used).expect("as many values as pixels");
/// assert!(mask.contains(0.0, 2.0) && !mask.contains(0.0, 3.0));
/// let image = GrayImage::filled(size, 0.5).masked(Arc::new(mask)).expect("of one size");
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Mask {
    size: ImageSize,
    /// Used pixels left of column x and above row y, for x in 0..=width and y in 0..=height.
    sums: Vec<u32>,
}

impl Mask {
    /// From what is used, row by row; `None` where that is not width times height values.
    pub fn new(size: ImageSize, used: &[bool]) -> Option<Self> {
        if used.len() != size.width * size.height || u32::try_from(used.len()).is_err() {
            return None;
        }
        let columns = size.width + 1;
        let mut sums = vec![0u32; columns * (size.height + 1)];
        for y in 0..size.height {
            let mut in_row = 0;
            for x in 0..size.width {
                in_row += u32::from(used[y * size.width + x]);
                sums[(y + 1) * columns + x + 1] = sums[y * columns + x + 1] + in_row;
            }
        }
        Some(Self { size, sums })
    }

    /// Width and height.
    pub fn size(&self) -> ImageSize {
        self.size
    }

    /// Fraction of the pixels that are used.
    #[cfg(test)]
    pub(crate) fn used(&self) -> f64 {
        let all = self.size.width * self.size.height;
        self.sums.last().map_or(0.0, |&n| f64::from(n) / all.max(1) as f64)
    }

    /// Whether the pixel at this place is used; outside the image none is.
    pub fn contains(&self, x: f64, y: f64) -> bool {
        self.share(x, y, 0.0) > 0.5
    }

    /// Fraction of the pixels that are used in a square of half side `reach` about a place, as far as it lies in the image; 0 where none does.
    pub(crate) fn share(&self, x: f64, y: f64, reach: f64) -> f64 {
        // The pixels whose centres lie in it, the nearest one at least; of NaN none.
        let side = |centre: f64, length: usize| {
            let nearest = centre.round();
            let low = (centre - reach).ceil().min(nearest).max(0.0);
            let high = (centre + reach).floor().max(nearest).min(length as f64 - 1.0);
            (low <= high).then_some((low as usize, high as usize + 1))
        };
        let (Some((x0, x1)), Some((y0, y1))) = (side(x, self.size.width), side(y, self.size.height)) else {
            return 0.0;
        };
        let columns = self.size.width + 1;
        let sum = |x: usize, y: usize| i64::from(self.sums[y * columns + x]);
        let inside = sum(x1, y1) - sum(x0, y1) - sum(x1, y0) + sum(x0, y0);
        inside as f64 / ((x1 - x0) * (y1 - y0)) as f64
    }

    /// What both use.
    ///
    /// # Errors
    /// [`Error::InvalidInput`] where their sizes differ.
    pub(crate) fn and(&self, other: &Self) -> Result<Self, Error> {
        if self.size != other.size {
            return Err(Error::InvalidInput(format!("masks of {} and of {} pixels", self.size, other.size)));
        }
        let used: Vec<bool> = (0..self.size.height)
            .flat_map(|y| (0..self.size.width).map(move |x| (x as f64, y as f64)))
            .map(|(x, y)| self.contains(x, y) && other.contains(x, y))
            .collect();
        Self::new(self.size, &used).ok_or_else(|| Error::InvalidInput(format!("a mask of {} pixels", self.size)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn left_half() -> Mask {
        let size = ImageSize::new(8, 4);
        let used: Vec<bool> = (0..32).map(|i| i % 8 < 4).collect();
        Mask::new(size, &used).expect("right size")
    }

    #[test]
    fn squares_are_counted_as_far_as_they_lie_in_the_image() {
        let mask = left_half();
        assert_eq!(mask.used(), 0.5);
        assert!(mask.contains(0.0, 0.0) && mask.contains(3.4, 3.4) && !mask.contains(3.6, 0.0));
        assert!(!mask.contains(-1.0, 0.0) && !mask.contains(1.0, 4.0) && !mask.contains(f64::NAN, 1.0));
        // Columns 2..=5.
        assert_eq!(mask.share(3.5, 2.0, 1.5), 0.5);
        assert_eq!(mask.share(0.0, 0.0, 2.0), 1.0);
        assert_eq!(mask.share(7.0, 0.0, 100.0), 0.5);
        assert_eq!(mask.share(-50.0, 0.0, 2.0), 0.0);
        assert!(Mask::new(ImageSize::new(3, 3), &[true; 8]).is_none());
    }

    #[test]
    fn of_two_masks_what_both_use_is_used() {
        let size = ImageSize::new(8, 4);
        let upper = Mask::new(size, &(0..32).map(|i| i < 16).collect::<Vec<_>>()).expect("right size");
        let both = left_half().and(&upper).expect("one size");
        assert_eq!(both.used(), 0.25);
        let small = Mask::new(ImageSize::new(2, 2), &[true; 4]).expect("right size");
        assert!(both.and(&small).is_err());
    }
}
