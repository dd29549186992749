//! The focal length that photographs say they were taken with (Exif): to check an answer by, never the answer.
//!
//! ```text
//! f_px = f35 √(w² + h²) / 43.27 mm        f35: FocalLengthIn35mmFilm, whole millimetres, by the diagonal (CIPA DCG-001)
//! ```

use std::{fs::File, io::BufReader, path::PathBuf};

use exif::{Exif, In, Reader, Tag};
use groundcal::geometry::size::ImageSize;

/// Diagonal of 36 x 24 mm.
const DIAGONAL_35_MM: f64 = 43.266_615_305_567_87;
/// Focal lengths that lenses have, millimetres of 35 mm film.
const PLAUSIBLE_MM: std::ops::RangeInclusive<u32> = 5..=3000;
/// Relative difference of the aspect ratios of a picture and of what its camera says it took, from which on it was cropped.
const CROPPED: f64 = 0.01;

/// In pixels; `None` where not all files state one, and the same, of pictures that were not cropped since.
pub(super) fn stated_focal_length_px(files: &[PathBuf], size: ImageSize) -> Option<f64> {
    let (first, others) = files.split_first()?;
    let stated = stated_mm(first, size)?;
    if others.iter().any(|file| stated_mm(file, size) != Some(stated)) {
        return None;
    }
    let diagonal = (size.width as f64).hypot(size.height as f64);
    Some(f64::from(stated) * diagonal / DIAGONAL_35_MM)
}

fn stated_mm(file: &PathBuf, size: ImageSize) -> Option<u32> {
    let exif = Reader::new().read_from_container(&mut BufReader::new(File::open(file).ok()?)).ok()?;
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

    /// A JPEG of 40 x 30 pixels whose Exif states a focal length and, if at all, a size.
    fn jpeg(folder: &tempfile::TempDir, name: &str, mm: u16, taken: Option<[u16; 2]>) -> PathBuf {
        let path = folder.path().join(name);
        image::GrayImage::from_pixel(40, 30, image::Luma([90])).save(&path).expect("a file");
        let plain = std::fs::read(&path).expect("a file");
        let mut fields: Vec<(u16, u16)> = vec![(0xa405, mm)];
        if let Some([w, h]) = taken {
            fields.extend([(0xa002, w), (0xa003, h)]);
        }
        fields.sort_unstable();
        // Little-endian TIFF: IFD0 with a pointer to the Exif IFD, and that.
        let mut tiff = b"II\x2a\0\x08\0\0\0\x01\0\x69\x87\x04\0\x01\0\0\0\x1a\0\0\0\0\0\0\0".to_vec();
        tiff.extend((fields.len() as u16).to_le_bytes());
        for (tag, value) in fields {
            tiff.extend(tag.to_le_bytes());
            tiff.extend([3, 0, 1, 0, 0, 0]);
            tiff.extend(value.to_le_bytes());
            tiff.extend([0, 0]);
        }
        tiff.extend([0; 4]);
        let segment = [b"Exif\0\0".to_vec(), tiff].concat();
        let length = (segment.len() as u16 + 2).to_be_bytes();
        let with = [&plain[..2], &[0xff, 0xe1], &length, &segment, &plain[2..]].concat();
        std::fs::write(&path, with).expect("written");
        path
    }

    #[test]
    fn what_photographs_state_is_read_where_they_agree_and_are_whole() {
        let folder = tempfile::tempdir().expect("a folder");
        let size = ImageSize::new(40, 30);
        let file = |name: &str, mm: u16, taken: Option<[u16; 2]>| jpeg(&folder, name, mm, taken);
        let stated = |files: &[PathBuf]| stated_focal_length_px(files, size);
        let whole = file("a.jpg", 26, Some([4000, 3000]));
        let upright = file("b.jpg", 26, Some([3000, 4000]));
        let px = stated(&[whole.clone(), upright]).expect("26 mm");
        assert!((px - 26.0 * 50.0 / DIAGONAL_35_MM).abs() < 1e-9, "{px}");
        assert!(stated(&[file("c.jpg", 26, None)]).is_some());
        // Another zoom; a crop; none at all; not a number that lenses have.
        assert_eq!(stated(&[whole.clone(), file("d.jpg", 52, None)]), None);
        assert_eq!(stated(&[file("e.jpg", 26, Some([4000, 2250]))]), None);
        let bare = folder.path().join("f.png");
        image::GrayImage::new(40, 30).save(&bare).expect("a file");
        assert_eq!(stated(&[whole, bare]), None);
        assert_eq!(stated(&[file("g.jpg", 0, None)]), None);
    }
}
