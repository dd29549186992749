//! Pictures in and out: files to 8-bit rasters of the calibrated size, and back to PNG or JPEG.

use std::{
    collections::HashMap,
    path::{Path, PathBuf},
};

use groundcal::{
    geometry::size::ImageSize,
    vision::resample::{Raster, Resampled},
};
use image::{
    DynamicImage, ExtendedColorType, ImageEncoder,
    codecs::{
        jpeg::JpegEncoder,
        png::{CompressionType, FilterType, PngEncoder},
    },
};

use crate::error::IoError;
use crate::load;

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

/// The image files that the inputs name.
pub fn files(inputs: &[String]) -> Result<Vec<PathBuf>, IoError> {
    match load::find(inputs)? {
        load::Input::Images(files) => Ok(files),
        load::Input::Csv(path) => {
            Err(IoError::Usage(format!("{} is a CSV; name images or a folder of them", path.display())))
        }
    }
}

/// A file as 8-bit grey or RGB, which must have the size of the calibration.
pub fn read(path: &Path, size: ImageSize) -> Result<Raster, IoError> {
    let decoded = load::decoded(path)?;
    let found = ImageSize::new(decoded.width() as usize, decoded.height() as usize);
    if found != size {
        let turned = found.width == size.height && found.height == size.width;
        return Err(IoError::Input(format!(
            "{} is {found} pixels, the calibration is of {size}: {}",
            path.display(),
            if turned {
                "it is turned. Give the image as it was calibrated (see its EXIF orientation)"
            } else {
                "another camera, zoom or scale. Give images of the camera and size that were calibrated"
            }
        )));
    }
    let grey = decoded.color().channel_count() <= 2;
    let (channels, data) =
        if grey { (1, decoded.into_luma8().into_raw()) } else { (3, DynamicImage::into_rgb8(decoded).into_raw()) };
    Raster::from_rows(size, channels, data)
        .ok_or_else(|| IoError::Input(format!("{}: the image is empty", path.display())))
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
                    path.display()
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
    done.map_err(|e| IoError::Other(format!("cannot encode {}: {e}", path.display())))?;
    Ok(bytes)
}

/// Names for the files made of others: their stems, or whole file names where stems repeat; folders apart only by number.
pub fn stems(files: &[PathBuf]) -> Vec<String> {
    let text = |name: Option<&std::ffi::OsStr>| name.map_or_else(String::new, |n| n.to_string_lossy().into_owned());
    let mut names: Vec<String> = files.iter().map(|f| text(f.file_stem())).collect();
    for attempt in 0..2 {
        let mut count: HashMap<String, usize> = HashMap::new();
        for name in &names {
            *count.entry(name.to_lowercase()).or_default() += 1;
        }
        let mut seen: HashMap<String, usize> = HashMap::new();
        for (name, file) in names.iter_mut().zip(files) {
            if count[&name.to_lowercase()] > 1 {
                let number = seen.entry(name.to_lowercase()).or_default();
                *number += 1;
                *name =
                    if attempt == 0 { text(file.file_name()).replace('.', "_") } else { format!("{name}_{number}") };
            }
        }
    }
    names
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_what_is_made_are_told_apart() {
        let paths = |names: &[&str]| names.iter().map(PathBuf::from).collect::<Vec<_>>();
        assert_eq!(stems(&paths(&["x/a.jpg", "x/b.png"])), ["a", "b"]);
        assert_eq!(stems(&paths(&["x/a.jpg", "x/a.png"])), ["a_jpg", "a_png"]);
        assert_eq!(stems(&paths(&["x/a.jpg", "y/a.jpg"])), ["a_jpg_1", "a_jpg_2"]);
    }

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
