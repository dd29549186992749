//! The focal length that photographs say they were taken with (Exif): to check an answer by, never the answer.
//!
//! ```text
//! f_px = f35 √(w² + h²) / 43.27 mm        f35: FocalLengthIn35mmFilm, whole millimetres, by the diagonal (CIPA DCG-001)
//! ```

use std::io::Cursor;

use exif::{Exif, In, Reader, Tag};
use groundcal::geometry::ImageSize;

/// Diagonal of 36 x 24 mm.
const DIAGONAL_35_MM: f64 = 43.266_615_305_567_87;
/// Focal lengths that lenses have, millimetres of 35 mm film.
const PLAUSIBLE_MM: std::ops::RangeInclusive<u32> = 5..=3000;
/// Relative difference of the aspect ratios of a picture and of what its camera says it took, from which on it was cropped.
const CROPPED: f64 = 0.01;

/// In pixels; `None` where not all pictures state one, and the same.
pub(super) fn focal_length_px(stated_mm: impl IntoIterator<Item = Option<u32>>, size: ImageSize) -> Option<f64> {
    let mut all = stated_mm.into_iter();
    let first = all.next()??;
    if all.any(|other| other != Some(first)) {
        return None;
    }
    let diagonal = (size.width as f64).hypot(size.height as f64);
    Some(f64::from(first) * diagonal / DIAGONAL_35_MM)
}

/// The focal length that an image file (JPEG, PNG, TIFF, WebP, HEIC) states, in millimetres of 35 mm film; `None` where it states none, or one that
/// no lens has, or was cropped to `size` since.
///
/// ```
/// use groundcal::geometry::ImageSize;
/// use groundcal_io::images::stated_focal_length_mm;
///
/// // A TIFF of nothing but FocalLengthIn35mmFilm = 26 in its Exif directory.
/// let tiff = b"II*\0\x08\0\0\0\x01\0\x69\x87\x04\0\x01\0\0\0\x1a\0\0\0\0\0\0\0\x01\0\x05\xa4\x03\0\x01\0\0\0\x1a\0\0\0\0\0\0\0";
/// assert_eq!(stated_focal_length_mm(tiff.to_vec(), ImageSize::new(40, 30)), Some(26));
/// ```
pub fn stated_focal_length_mm(file: Vec<u8>, size: ImageSize) -> Option<u32> {
    // A TIFF is looked up where it stands; of the others the reader takes out the part it needs.
    let is_tiff = file.starts_with(b"II") || file.starts_with(b"MM");
    let reader = Reader::new();
    let exif =
        if is_tiff { reader.read_raw(file) } else { reader.read_from_container(&mut Cursor::new(&file)) }.ok()?;
    let number = |tag: Tag| number(&exif, tag);
    if let (Some(w), Some(h)) = (number(Tag::PixelXDimension), number(Tag::PixelYDimension)) {
        // Whichever side is up.
        let ratio = |a: f64, b: f64| a.max(b) / a.min(b).max(1.0);
        let (taken, now) = (ratio(f64::from(w), f64::from(h)), ratio(size.width as f64, size.height as f64));
        if (taken / now).ln().abs() > CROPPED {
            return None;
        }
    }
    number(Tag::FocalLengthIn35mmFilm).filter(|mm| PLAUSIBLE_MM.contains(mm))
}

fn number(exif: &Exif, tag: Tag) -> Option<u32> {
    exif.get_field(tag, In::PRIMARY)?.value.get_uint(0)
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: ImageSize = ImageSize { width: 40, height: 30 };

    /// An image file of 40 x 30 pixels, as it is saved.
    fn plain(format: image::ImageFormat) -> Vec<u8> {
        let mut bytes = Cursor::new(Vec::new());
        image::GrayImage::from_pixel(40, 30, image::Luma([90])).write_to(&mut bytes, format).expect("written");
        bytes.into_inner()
    }

    /// The Exif that states a focal length and, if at all, a size: little-endian TIFF, IFD0 with a pointer to the Exif IFD, and that.
    fn tiff(mm: u16, taken: Option<[u16; 2]>) -> Vec<u8> {
        let mut fields: Vec<(u16, u16)> = vec![(0xa405, mm)];
        if let Some([w, h]) = taken {
            fields.extend([(0xa002, w), (0xa003, h)]);
        }
        fields.sort_unstable();
        let mut tiff = b"II\x2a\0\x08\0\0\0\x01\0\x69\x87\x04\0\x01\0\0\0\x1a\0\0\0\0\0\0\0".to_vec();
        tiff.extend((fields.len() as u16).to_le_bytes());
        for (tag, value) in fields {
            tiff.extend(tag.to_le_bytes());
            tiff.extend([3, 0, 1, 0, 0, 0]);
            tiff.extend(value.to_le_bytes());
            tiff.extend([0, 0]);
        }
        tiff.extend([0; 4]);
        tiff
    }

    /// A JPEG with it.
    fn jpeg(mm: u16, taken: Option<[u16; 2]>) -> Vec<u8> {
        let plain = plain(image::ImageFormat::Jpeg);
        let segment = [b"Exif\0\0".to_vec(), tiff(mm, taken)].concat();
        let length = (segment.len() as u16 + 2).to_be_bytes();
        [&plain[..2], &[0xff, 0xe1], &length, &segment, &plain[2..]].concat()
    }

    #[test]
    fn what_photographs_state_is_read_unless_they_were_cropped() {
        let stated = |file: Vec<u8>| stated_focal_length_mm(file, SIZE);
        assert_eq!(stated(jpeg(26, None)), Some(26));
        assert_eq!(stated(jpeg(26, Some([4000, 3000]))), Some(26));
        assert_eq!(stated(jpeg(26, Some([3000, 4000]))), Some(26), "upright");
        assert_eq!(stated(tiff(35, None)), Some(35));
        // A crop; not a number that lenses have; none at all; no image.
        assert_eq!(stated(jpeg(26, Some([4000, 2250]))), None);
        assert_eq!(stated(jpeg(0, None)), None);
        assert_eq!(stated(plain(image::ImageFormat::Png)), None);
        assert_eq!(stated(b"II".to_vec()), None);
        assert_eq!(stated(Vec::new()), None);
    }

    #[test]
    fn all_pictures_have_to_state_the_same() {
        let px = focal_length_px([Some(26), Some(26)], SIZE).expect("26 mm");
        assert!((px - 26.0 * 50.0 / DIAGONAL_35_MM).abs() < 1e-9, "{px}");
        // Another zoom; none in one of them; no picture.
        for stated in [&[Some(26), Some(52)][..], &[Some(26), None], &[None, Some(26)], &[]] {
            assert_eq!(focal_length_px(stated.iter().copied(), SIZE), None, "{stated:?}");
        }
    }
}
