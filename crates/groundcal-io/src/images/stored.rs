//! A picture as a file stores it: samples in their own depth, upright.

use std::sync::Arc;

use groundcal::{geometry::ImageSize, vision::Mask};
use image::{DynamicImage, metadata::Orientation};

use crate::note::Note;

/// Samples of a picture, row by row, the channels of a pixel together.
#[derive(Debug, Clone, PartialEq)]
pub enum Samples {
    /// 8 bits, 0 to 255.
    U8(Vec<u8>),
    /// 16 bits, 0 to 65535 at most.
    U16(Vec<u16>),
    /// Floating point, or integers that 16 bits do not hold; in a range of their own.
    F32(Vec<f32>),
}

/// A picture as it is stored, upright.
#[derive(Debug, Clone, PartialEq)]
pub struct StoredImage {
    /// Width and height.
    pub size: ImageSize,
    /// 1 grey, 2 grey and alpha, 3 colour, 4 colour and alpha.
    pub channels: usize,
    /// The samples.
    pub samples: Samples,
    /// Whether the file is a TIFF, which holds any kind of number.
    pub is_tiff: bool,
    /// Whether the samples are the file's numbers; else it has wider ones.
    pub is_exact: bool,
    /// Where its content is the file's, where that is not everywhere: a JPEG that is cut or damaged is filled up by its decoder.
    pub sound: Option<Arc<Mask>>,
    /// What there is to say about the file.
    pub notes: Vec<Note>,
}

impl StoredImage {
    /// What the `image` crate decoded, after its orientation.
    pub(crate) fn from_dynamic(image: DynamicImage, notes: Vec<Note>) -> Self {
        let size = ImageSize::new(image.width() as usize, image.height() as usize);
        let channels = usize::from(image.color().channel_count());
        let samples = match image {
            DynamicImage::ImageLuma8(i) => Samples::U8(i.into_raw()),
            DynamicImage::ImageLumaA8(i) => Samples::U8(i.into_raw()),
            DynamicImage::ImageRgb8(i) => Samples::U8(i.into_raw()),
            DynamicImage::ImageRgba8(i) => Samples::U8(i.into_raw()),
            DynamicImage::ImageLuma16(i) => Samples::U16(i.into_raw()),
            DynamicImage::ImageLumaA16(i) => Samples::U16(i.into_raw()),
            DynamicImage::ImageRgb16(i) => Samples::U16(i.into_raw()),
            DynamicImage::ImageRgba16(i) => Samples::U16(i.into_raw()),
            DynamicImage::ImageRgb32F(i) => Samples::F32(i.into_raw()),
            DynamicImage::ImageRgba32F(i) => Samples::F32(i.into_raw()),
            other => {
                let samples = Samples::F32(other.into_rgba32f().into_raw());
                return Self { size, channels: 4, samples, is_tiff: false, is_exact: false, sound: None, notes };
            }
        };
        Self { size, channels, samples, is_tiff: false, is_exact: true, sound: None, notes }
    }

    /// A picture of `size`, as it is stored, of which the first `rows` are sound; turned and mirrored as a tag asks.
    pub(crate) fn sound_rows(size: ImageSize, rows: usize, orientation: Orientation) -> Option<Arc<Mask>> {
        let values = (0..size.width * size.height).map(|i| u8::from(i / size.width.max(1) < rows)).collect();
        let values = Self {
            size,
            channels: 1,
            samples: Samples::U8(values),
            is_tiff: false,
            is_exact: true,
            sound: None,
            notes: Vec::new(),
        };
        let turned = values.oriented(orientation);
        let Samples::U8(values) = turned.samples else { return None };
        Mask::new(turned.size, &values.iter().map(|v| *v == 1).collect::<Vec<_>>()).map(Arc::new)
    }

    /// Turned and mirrored as a tag asks.
    pub(crate) fn oriented(self, orientation: Orientation) -> Self {
        let (w, h) = (self.size.width, self.size.height);
        let n = self.channels;
        let swapped = matches!(
            orientation,
            Orientation::Rotate90 | Orientation::Rotate270 | Orientation::Rotate90FlipH | Orientation::Rotate270FlipH
        );
        let size = if swapped { ImageSize::new(h, w) } else { self.size };
        // The pixel of the stored picture that is shown at (x, y).
        let source = |x: usize, y: usize| match orientation {
            Orientation::NoTransforms => (x, y),
            Orientation::FlipHorizontal => (w - 1 - x, y),
            Orientation::Rotate180 => (w - 1 - x, h - 1 - y),
            Orientation::FlipVertical => (x, h - 1 - y),
            Orientation::Rotate90FlipH => (y, x),
            Orientation::Rotate90 => (y, h - 1 - x),
            Orientation::Rotate270FlipH => (w - 1 - y, h - 1 - x),
            Orientation::Rotate270 => (w - 1 - y, x),
        };
        fn moved<T: Copy>(
            data: &[T],
            n: usize,
            w: usize,
            size: ImageSize,
            source: impl Fn(usize, usize) -> (usize, usize),
        ) -> Vec<T> {
            let mut out = Vec::with_capacity(data.len());
            for y in 0..size.height {
                for x in 0..size.width {
                    let (sx, sy) = source(x, y);
                    let at = (sy * w + sx) * n;
                    out.extend_from_slice(&data[at..at + n]);
                }
            }
            out
        }
        if orientation == Orientation::NoTransforms {
            return self;
        }
        let samples = match &self.samples {
            Samples::U8(data) => Samples::U8(moved(data, n, w, size, source)),
            Samples::U16(data) => Samples::U16(moved(data, n, w, size, source)),
            Samples::F32(data) => Samples::F32(moved(data, n, w, size, source)),
        };
        Self { size, samples, ..self }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn orientations_are_those_of_the_image_crate() {
        let data: Vec<u8> = (0..6).collect();
        for tag in 1..=8 {
            let orientation = Orientation::from_exif(tag).unwrap();
            let mut theirs = DynamicImage::ImageLuma8(image::GrayImage::from_raw(3, 2, data.clone()).unwrap());
            let ours = StoredImage::from_dynamic(theirs.clone(), Vec::new()).oriented(orientation);
            theirs.apply_orientation(orientation);
            assert_eq!(ours, StoredImage::from_dynamic(theirs, Vec::new()), "{tag}");
        }
    }
}
