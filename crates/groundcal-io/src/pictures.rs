//! Pictures in and out: files to 8-bit rasters of the calibrated size, and back to PNG or JPEG.

use std::path::{Path, PathBuf};

use groundcal::{
    geometry::size::ImageSize,
    vision::resample::{Raster, Resampled},
};
use image::{
    ExtendedColorType, ImageEncoder,
    codecs::{
        jpeg::JpegEncoder,
        png::{CompressionType, FilterType, PngEncoder},
    },
};

use crate::{
    error::IoError,
    images::{
        Samples, StoredImage, ValueRange, ValueRanges,
        range::{self, Ranges, Values},
        read_stored,
    },
    note::Note,
    text::shown,
};

/// Quality of JPEG files, and their longest side.
const JPEG_QUALITY: u8 = 92;
const MAX_JPEG_SIDE: usize = 65_535;
/// What a JPEG shows where nothing was seen.
const OUTSIDE: u8 = 255;

/// Kind of picture written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PictureFormat {
    /// PNG, transparent where nothing was seen
    Png,
    /// JPEG, white where nothing was seen
    Jpeg,
}

impl PictureFormat {
    /// Ending of file names.
    pub fn extension(self) -> &'static str {
        match self {
            PictureFormat::Png => "png",
            PictureFormat::Jpeg => "jpg",
        }
    }

    /// Ending of the world file's name.
    pub fn world_extension(self) -> &'static str {
        match self {
            PictureFormat::Png => "pgw",
            PictureFormat::Jpeg => "jgw",
        }
    }
}

/// Reads pictures one by one, all in one range of values.
#[derive(Debug, Clone)]
pub struct PictureReader {
    size: ImageSize,
    ranges: ValueRanges,
    has_colour: bool,
}

impl PictureReader {
    /// Reads all files once, to find the range of their values, and to refuse before any work what cannot be used or has not the size
    /// of the calibration.
    ///
    /// # Errors
    /// [`IoError::File`] for a file that is no image, or damaged beyond use, or of another size.
    pub fn new(files: &[PathBuf], size: ImageSize) -> Result<(Self, Vec<Note>), IoError> {
        let mut notes = Vec::new();
        let mut ranges = Ranges::default();
        let mut has_colour = false;
        for file in files {
            let image = read_of_size(file, size)?;
            ranges.add(range::kind(&image), Values::of(&image));
            has_colour |= image.channels > 2;
            notes.extend(image.notes);
        }
        let ranges = ranges.found();
        notes.extend(ranges.notes());
        Ok((Self { size, ranges, has_colour }, notes))
    }

    /// Whether any of the files has colour.
    pub fn has_colour(&self) -> bool {
        self.has_colour
    }

    /// A file as 8-bit grey or RGB.
    ///
    /// # Errors
    /// As [`PictureReader::new`].
    pub fn read(&self, path: &Path) -> Result<Raster, IoError> {
        let image = read_of_size(path, self.size)?;
        let kept = if image.channels <= 2 { 1 } else { 3 };
        let data = match (&image.samples, range::kind(&image)) {
            (Samples::U8(data), _) => without_alpha(data, image.channels, kept, |v| v),
            (Samples::U16(data), Some(kind)) => {
                let range = self.ranges.of(kind);
                without_alpha(data, image.channels, kept, |v| eight_bits(range, f64::from(v)))
            }
            (Samples::F32(data), Some(kind)) => {
                let range = self.ranges.of(kind);
                without_alpha(data, image.channels, kept, |v| eight_bits(range, f64::from(v)))
            }
            _ => Vec::new(),
        };
        Raster::from_rows(self.size, kept, data).ok_or_else(|| IoError::file(path, "the image is empty"))
    }
}

fn eight_bits(range: ValueRange, value: f64) -> u8 {
    // What is no number becomes 0.
    (255.0 * range.grey(value)).round().clamp(0.0, 255.0) as u8
}

fn without_alpha<T: Copy>(data: &[T], channels: usize, kept: usize, value: impl Fn(T) -> u8) -> Vec<u8> {
    data.chunks_exact(channels).flat_map(|p| p[..kept].iter().map(|v| value(*v))).collect()
}

fn read_of_size(path: &Path, size: ImageSize) -> Result<StoredImage, IoError> {
    let image = read_stored(path)?;
    let found = image.size;
    if found == size {
        return Ok(image);
    }
    let turned = found.width == size.height && found.height == size.width;
    let help = if turned {
        "it is turned. Give the image as it was calibrated (see its EXIF orientation)"
    } else {
        "another camera, zoom or scale. Give images of the camera and size that were calibrated"
    };
    Err(IoError::file(path, format!("is {found} pixels, the calibration is of {size}: {help}")))
}

/// Grey as colour; colour as it is.
pub fn to_colour(picture: Raster) -> Raster {
    if picture.channels() != 1 {
        return picture;
    }
    let data = picture.data().iter().flat_map(|v| [*v; 3]).collect();
    Raster::from_rows(picture.size(), 3, data).unwrap_or(picture)
}

/// The file's bytes. PNG gets an alpha channel where something is not covered.
pub fn encode(resampled: &Resampled, format: PictureFormat, path: &Path) -> Result<Vec<u8>, IoError> {
    let picture = &resampled.picture;
    let size = picture.size();
    let (width, height) = (size.width as u32, size.height as u32);
    let channels = picture.channels();
    let whole = resampled.coverage.iter().all(|c| *c == 255);
    let mut bytes = Vec::new();
    let done = match format {
        PictureFormat::Png => {
            let both: Vec<u8>;
            let (data, colour) = match (whole, channels) {
                (true, 1) => (picture.data(), ExtendedColorType::L8),
                (true, _) => (picture.data(), ExtendedColorType::Rgb8),
                (false, _) => {
                    let pixels = picture.data().chunks_exact(channels).zip(&resampled.coverage);
                    both = pixels.flat_map(|(p, c)| p.iter().copied().chain([*c])).collect();
                    (both.as_slice(), if channels == 1 { ExtendedColorType::La8 } else { ExtendedColorType::Rgba8 })
                }
            };
            PngEncoder::new_with_quality(&mut bytes, CompressionType::Default, FilterType::Adaptive)
                .write_image(data, width, height, colour)
        }
        PictureFormat::Jpeg => {
            if size.width.max(size.height) > MAX_JPEG_SIDE {
                return Err(IoError::Usage(format!(
                    "{} would be {size} pixels; a JPEG's sides are {MAX_JPEG_SIDE} at most. Take --format png or a lower --resolution",
                    shown(path)
                )));
            }
            let over = |v: u8, c: u8| {
                let (v, c, outside) = (u32::from(v), u32::from(c), u32::from(OUTSIDE));
                ((v * c + outside * (255 - c) + 127) / 255) as u8
            };
            let pixels = picture.data().chunks_exact(channels).zip(&resampled.coverage);
            let data: Vec<u8> = pixels.flat_map(|(p, c)| p.iter().map(|v| over(*v, *c))).collect();
            let colour = if channels == 1 { ExtendedColorType::L8 } else { ExtendedColorType::Rgb8 };
            JpegEncoder::new_with_quality(&mut bytes, JPEG_QUALITY).write_image(&data, width, height, colour)
        }
    };
    done.map_err(|e| IoError::Other(format!("cannot encode {}: {e}", shown(path))))?;
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn png_has_alpha_only_where_something_is_missing() {
        let picture = Raster::from_rows(ImageSize::new(2, 1), 3, vec![10, 20, 30, 40, 50, 60]).unwrap();
        let bytes = |coverage: Vec<u8>, format| {
            let resampled = Resampled { picture: picture.clone(), coverage };
            image::load_from_memory(&encode(&resampled, format, Path::new("x")).unwrap()).unwrap()
        };
        assert_eq!(bytes(vec![255, 255], PictureFormat::Png).color(), image::ColorType::Rgb8);
        let partly = bytes(vec![255, 0], PictureFormat::Png).into_rgba8();
        assert_eq!((partly.get_pixel(0, 0).0, partly.get_pixel(1, 0).0[3]), ([10, 20, 30, 255], 0));
        let white = bytes(vec![0, 0], PictureFormat::Jpeg).into_rgb8();
        assert!(white.pixels().all(|p| p.0.iter().all(|v| *v > 250)));
    }
}
