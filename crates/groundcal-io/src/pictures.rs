//! Pictures in and out: files to rasters of the calibrated size in the depth that they are stored in, and back to PNG, TIFF or JPEG.
//!
//! | stored | PNG | TIFF | JPEG |
//! |---|---|---|---|
//! | 8 bits | 8 bits | 8 bits | 8 bits |
//! | 16 bits | 16 bits | 16 bits | 8 bits of the range used |
//! | floating point | 16 bits of the range used | floating point | 8 bits of the range used |
//!
//! Where no format is asked for, 8 bits go into PNG, 16 bits into PNG or TIFF as the file has it, floating point into TIFF.

use std::{
    io::Cursor,
    path::{Path, PathBuf},
};

use groundcal::{
    geometry::ImageSize,
    vision::{Depth, Raster, Resampled},
};
use image::{
    ExtendedColorType, ImageEncoder,
    codecs::{
        jpeg::JpegEncoder,
        png::{CompressionType, FilterType, PngEncoder},
    },
};
use tiff::encoder::{
    TiffEncoder,
    colortype::{Gray8, Gray16, Gray32Float, RGB8, RGB16, RGB32Float},
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
/// Coverage from which on a pixel of a TIFF, which has no transparency here, is seen.
const SEEN: u8 = 128;

/// Kind of picture written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PictureFormat {
    /// PNG, transparent where nothing was seen
    Png,
    /// TIFF, zero where nothing was seen, of floating point not a number
    Tiff,
    /// JPEG, white where nothing was seen
    Jpeg,
}

impl PictureFormat {
    /// Ending of file names.
    pub fn extension(self) -> &'static str {
        match self {
            PictureFormat::Png => "png",
            PictureFormat::Tiff => "tiff",
            PictureFormat::Jpeg => "jpg",
        }
    }

    /// Ending of the world file's name.
    pub fn world_extension(self) -> &'static str {
        match self {
            PictureFormat::Png => "pgw",
            PictureFormat::Tiff => "tfw",
            PictureFormat::Jpeg => "jgw",
        }
    }

    fn name(self) -> &'static str {
        match self {
            PictureFormat::Png => "PNG",
            PictureFormat::Tiff => "TIFF",
            PictureFormat::Jpeg => "JPEG",
        }
    }
}

/// A picture in its depth.
#[derive(Debug, Clone, PartialEq)]
pub enum Picture {
    /// 8 bits.
    U8(Raster<u8>),
    /// 16 bits, the values as the file has them.
    U16(Raster<u16>),
    /// Floating point, the values as the file has them.
    F32(Raster<f32>),
}

/// Kinds of number, the narrowest first.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Bits {
    Eight,
    Sixteen,
    Float,
}

impl Bits {
    fn of(image: &StoredImage) -> Self {
        match image.samples {
            Samples::U8(_) => Bits::Eight,
            Samples::U16(_) => Bits::Sixteen,
            Samples::F32(_) => Bits::Float,
        }
    }

    fn words(self) -> &'static str {
        match self {
            Bits::Eight => "8 bits",
            Bits::Sixteen => "16 bits",
            Bits::Float => "floating point numbers",
        }
    }

    /// The widest that a format holds of it.
    fn within(self, format: PictureFormat) -> Self {
        match format {
            PictureFormat::Jpeg => Bits::Eight,
            PictureFormat::Png => self.min(Bits::Sixteen),
            PictureFormat::Tiff => self,
        }
    }
}

/// How a file is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Target {
    stored: Bits,
    bits: Bits,
    format: PictureFormat,
}

impl Target {
    fn of(image: &StoredImage, asked: Option<PictureFormat>) -> Self {
        let stored = Bits::of(image);
        let format = asked.unwrap_or(match stored {
            Bits::Eight => PictureFormat::Png,
            Bits::Sixteen if image.is_tiff => PictureFormat::Tiff,
            Bits::Sixteen => PictureFormat::Png,
            Bits::Float => PictureFormat::Tiff,
        });
        Self { stored, bits: stored.within(format), format }
    }

    /// What is lost, if anything.
    fn note(self, path: &Path, is_exact: bool) -> Option<Note> {
        let what = if self.bits < self.stored {
            let (has, format, bits) = (self.stored.words(), self.format.name(), self.bits.words());
            format!("has {has}, which {format} does not hold: written with {bits}")
        } else if is_exact {
            return None;
        } else {
            "its numbers are wider than 32-bit floating point, in which it is written".to_string()
        };
        Some(Note::file(Note::DEPTH_LOST, path, what))
    }
}

/// Reads pictures one by one, those that lose depth all in one range of values.
#[derive(Debug, Clone)]
pub struct PictureReader {
    files: Vec<PathBuf>,
    targets: Vec<Target>,
    size: ImageSize,
    ranges: ValueRanges,
    has_colour: bool,
}

impl PictureReader {
    /// Reads all files once, to find their depth and the range of their values, and to refuse before any work what cannot be used or has
    /// not the size of the calibration. `asked` is the format of all that is written; `together`: one picture is made of all.
    ///
    /// # Errors
    /// [`IoError::File`] for a file that is no image, or damaged beyond use, or of another size.
    pub fn new(
        files: &[PathBuf],
        size: ImageSize,
        asked: Option<PictureFormat>,
        together: bool,
    ) -> Result<(Self, Vec<Note>), IoError> {
        let mut notes = Vec::new();
        let mut ranges = Ranges::default();
        let mut has_colour = false;
        let mut targets: Vec<Target> = Vec::new();
        let mut lost: Vec<Note> = Vec::new();
        for file in files {
            let image = read_of_size(file, size)?;
            ranges.add(range::kind(&image), Values::of(&image));
            has_colour |= image.channels > 2;
            let target = Target::of(&image, asked);
            lost.extend(target.note(file, image.is_exact));
            targets.push(target);
            notes.extend(image.notes);
        }
        if let Some(first) = targets.first().copied().filter(|_| together)
            && targets.iter().any(|t| *t != first)
        {
            let one_depth = targets.iter().all(|t| t.stored == first.stored);
            let format = asked.unwrap_or(PictureFormat::Png);
            for target in &mut targets {
                let bits = if one_depth { target.stored.within(format) } else { Bits::Eight };
                *target = Target { bits, format, ..*target };
            }
            if !one_depth {
                let what = "the images have different depths: the picture of all has 8 bits";
                lost = vec![Note::all(Note::DEPTH_LOST, what)];
            }
        }
        let ranges = ranges.found();
        notes.extend(lost);
        if targets.iter().any(|t| t.bits < t.stored) {
            notes.extend(ranges.notes());
        }
        Ok((Self { files: files.to_vec(), targets, size, ranges, has_colour }, notes))
    }

    /// Whether any of the files has colour.
    pub fn has_colour(&self) -> bool {
        self.has_colour
    }

    /// The format in which what is made of a file is written.
    pub fn format(&self, index: usize) -> PictureFormat {
        self.targets.get(index).map_or(PictureFormat::Png, |t| t.format)
    }

    /// A file as grey or RGB.
    ///
    /// # Errors
    /// As [`PictureReader::new`]; [`IoError::Input`] for a file that changed since.
    pub fn read(&self, index: usize) -> Result<Picture, IoError> {
        let (Some(path), Some(target)) = (self.files.get(index), self.targets.get(index)) else {
            return Err(IoError::Other(format!("there is no picture {index}")));
        };
        let image = read_of_size(path, self.size)?;
        if Bits::of(&image) != target.stored {
            return Err(IoError::file(path, "was changed while the program ran"));
        }
        let kept = if image.channels <= 2 { 1 } else { 3 };
        let all = image.channels;
        let raster = match (&image.samples, target.bits) {
            (Samples::U16(data), Bits::Sixteen) => {
                self.raster(kept, without_alpha(data, all, kept, |v| v)).map(Picture::U16)
            }
            (Samples::F32(data), Bits::Float) => {
                self.raster(kept, without_alpha(data, all, kept, |v| v)).map(Picture::F32)
            }
            (Samples::F32(data), Bits::Sixteen) => {
                let to = |v| scaled(self.range(&image), 65535.0, v) as u16;
                self.raster(kept, without_alpha(data, all, kept, to)).map(Picture::U16)
            }
            (Samples::U8(data), _) => self.raster(kept, without_alpha(data, all, kept, |v| v)).map(Picture::U8),
            (Samples::U16(data), _) => {
                let to = |v| scaled(self.range(&image), 255.0, f32::from(v)) as u8;
                self.raster(kept, without_alpha(data, all, kept, to)).map(Picture::U8)
            }
            (Samples::F32(data), _) => {
                let to = |v| scaled(self.range(&image), 255.0, v) as u8;
                self.raster(kept, without_alpha(data, all, kept, to)).map(Picture::U8)
            }
        };
        raster.ok_or_else(|| IoError::file(path, "the image is empty"))
    }

    fn raster<T: Depth>(&self, channels: usize, data: Vec<T>) -> Option<Raster<T>> {
        Raster::from_rows(self.size, channels, data)
    }

    fn range(&self, image: &StoredImage) -> ValueRange {
        range::kind(image).map_or(ValueRange { black: 0.0, white: 255.0 }, |kind| self.ranges.of(kind))
    }
}

/// A value of a range as a whole number up to the largest.
fn scaled(range: ValueRange, largest: f64, value: f32) -> f64 {
    // What is no number becomes 0 when it is cast.
    (largest * range.grey(f64::from(value))).round().clamp(0.0, largest)
}

fn without_alpha<T: Copy, U>(data: &[T], channels: usize, kept: usize, value: impl Fn(T) -> U) -> Vec<U> {
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
pub fn to_colour<T: Depth>(picture: Raster<T>) -> Raster<T> {
    if picture.channels() != 1 {
        return picture;
    }
    let data = picture.data().iter().flat_map(|v| [*v; 3]).collect();
    Raster::from_rows(picture.size(), 3, data).unwrap_or(picture)
}

/// A depth that can be written.
pub trait Encode: Depth {
    /// Samples for the encoders.
    fn slice(data: &[Self]) -> Slice<'_>;
    /// A picture, if it has this depth.
    fn of(picture: Picture) -> Option<Raster<Self>>;
}

/// Samples of one depth.
#[derive(Debug, Clone, Copy)]
pub enum Slice<'a> {
    /// 8 bits.
    U8(&'a [u8]),
    /// 16 bits.
    U16(&'a [u16]),
    /// Floating point.
    F32(&'a [f32]),
}

impl Encode for u8 {
    fn slice(data: &[Self]) -> Slice<'_> {
        Slice::U8(data)
    }
    fn of(picture: Picture) -> Option<Raster<Self>> {
        if let Picture::U8(raster) = picture { Some(raster) } else { None }
    }
}

impl Encode for u16 {
    fn slice(data: &[Self]) -> Slice<'_> {
        Slice::U16(data)
    }
    fn of(picture: Picture) -> Option<Raster<Self>> {
        if let Picture::U16(raster) = picture { Some(raster) } else { None }
    }
}

impl Encode for f32 {
    fn slice(data: &[Self]) -> Slice<'_> {
        Slice::F32(data)
    }
    fn of(picture: Picture) -> Option<Raster<Self>> {
        if let Picture::F32(raster) = picture { Some(raster) } else { None }
    }
}

/// The file's bytes. PNG gets an alpha channel where something is not covered; PNG of floating point and JPEG of more than 8 bits are not
/// written ([`PictureReader`] does not give such pictures for them).
///
/// # Errors
/// [`IoError::Usage`] for a picture too large for the format, [`IoError::Other`] where it cannot be encoded.
pub fn encode<T: Encode>(resampled: &Resampled<T>, format: PictureFormat, path: &Path) -> Result<Vec<u8>, IoError> {
    let cannot = |e: String| IoError::Other(format!("cannot encode {}: {e}", shown(path)));
    match format {
        PictureFormat::Png => png(resampled).map_err(cannot),
        PictureFormat::Tiff => tiff(resampled).map_err(|e| cannot(e.to_string())),
        PictureFormat::Jpeg => {
            let size = resampled.picture.size();
            if size.width.max(size.height) > MAX_JPEG_SIDE {
                return Err(IoError::Usage(format!(
                    "{} would be {size} pixels; a JPEG's sides are {MAX_JPEG_SIDE} at most. Take --format png or a lower --resolution",
                    shown(path)
                )));
            }
            jpeg(resampled).map_err(cannot)
        }
    }
}

fn png<T: Encode>(resampled: &Resampled<T>) -> Result<Vec<u8>, String> {
    let picture = &resampled.picture;
    let (size, channels) = (picture.size(), picture.channels());
    let whole = resampled.coverage.iter().all(|c| *c == 255);
    fn with<T: Copy>(data: &[T], channels: usize, alpha: impl Iterator<Item = T>) -> Vec<T> {
        data.chunks_exact(channels).zip(alpha).flat_map(|(p, a)| p.iter().copied().chain([a])).collect()
    }
    let sixteen: Vec<u16>;
    let eight: Vec<u8>;
    let (bytes, deep): (&[u8], bool) = match T::slice(picture.data()) {
        Slice::U8(data) if whole => (data, false),
        Slice::U8(data) => {
            eight = with(data, channels, resampled.coverage.iter().copied());
            (&eight, false)
        }
        Slice::U16(data) => {
            let opaque = |c: &u8| u16::from(*c) * 257;
            sixteen = if whole { data.to_vec() } else { with(data, channels, resampled.coverage.iter().map(opaque)) };
            eight = sixteen.iter().flat_map(|v| v.to_ne_bytes()).collect();
            (&eight, true)
        }
        Slice::F32(_) => return Err("PNG has no floating point".into()),
    };
    let colour = match (channels == 1, whole, deep) {
        (true, true, false) => ExtendedColorType::L8,
        (true, false, false) => ExtendedColorType::La8,
        (false, true, false) => ExtendedColorType::Rgb8,
        (false, false, false) => ExtendedColorType::Rgba8,
        (true, true, true) => ExtendedColorType::L16,
        (true, false, true) => ExtendedColorType::La16,
        (false, true, true) => ExtendedColorType::Rgb16,
        (false, false, true) => ExtendedColorType::Rgba16,
    };
    let mut out = Vec::new();
    PngEncoder::new_with_quality(&mut out, CompressionType::Default, FilterType::Adaptive)
        .write_image(bytes, size.width as u32, size.height as u32, colour)
        .map_err(|e| e.to_string())?;
    Ok(out)
}

fn tiff<T: Encode>(resampled: &Resampled<T>) -> tiff::TiffResult<Vec<u8>> {
    let picture = &resampled.picture;
    let (w, h) = (picture.size().width as u32, picture.size().height as u32);
    fn seen<T: Copy>(data: &[T], channels: usize, coverage: &[u8], outside: T) -> Vec<T> {
        let pixels = data.chunks_exact(channels).zip(coverage);
        pixels.flat_map(|(p, c)| p.iter().map(|v| if *c < SEEN { outside } else { *v })).collect()
    }
    let (n, coverage) = (picture.channels(), &resampled.coverage);
    let mut out = Cursor::new(Vec::new());
    let mut encoder = TiffEncoder::new(&mut out)?;
    match (T::slice(picture.data()), n == 1) {
        (Slice::U8(data), true) => encoder.write_image::<Gray8>(w, h, &seen(data, n, coverage, 0))?,
        (Slice::U8(data), false) => encoder.write_image::<RGB8>(w, h, &seen(data, n, coverage, 0))?,
        (Slice::U16(data), true) => encoder.write_image::<Gray16>(w, h, &seen(data, n, coverage, 0))?,
        (Slice::U16(data), false) => encoder.write_image::<RGB16>(w, h, &seen(data, n, coverage, 0))?,
        (Slice::F32(data), true) => encoder.write_image::<Gray32Float>(w, h, &seen(data, n, coverage, f32::NAN))?,
        (Slice::F32(data), false) => encoder.write_image::<RGB32Float>(w, h, &seen(data, n, coverage, f32::NAN))?,
    }
    Ok(out.into_inner())
}

fn jpeg<T: Encode>(resampled: &Resampled<T>) -> Result<Vec<u8>, String> {
    let picture = &resampled.picture;
    let (size, channels) = (picture.size(), picture.channels());
    let Slice::U8(data) = T::slice(picture.data()) else { return Err("JPEG has 8 bits".into()) };
    let over = |v: u8, c: u8| {
        let (v, c, outside) = (u32::from(v), u32::from(c), u32::from(OUTSIDE));
        ((v * c + outside * (255 - c) + 127) / 255) as u8
    };
    let pixels = data.chunks_exact(channels).zip(&resampled.coverage);
    let data: Vec<u8> = pixels.flat_map(|(p, c)| p.iter().map(|v| over(*v, *c))).collect();
    let colour = if channels == 1 { ExtendedColorType::L8 } else { ExtendedColorType::Rgb8 };
    let mut out = Vec::new();
    JpegEncoder::new_with_quality(&mut out, JPEG_QUALITY)
        .write_image(&data, size.width as u32, size.height as u32, colour)
        .map_err(|e| e.to_string())?;
    Ok(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn png_has_alpha_only_where_something_is_missing() {
        let picture = Raster::from_rows(ImageSize::new(2, 1), 3, vec![10u8, 20, 30, 40, 50, 60]).unwrap();
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

    /// Writes pictures with a seam of what was not seen, and reads them back as they are stored.
    #[test]
    fn every_depth_comes_back_as_it_was() {
        let folder = tempfile::tempdir().unwrap();
        let size = ImageSize::new(40, 30);
        fn data<T>(channels: usize, value: impl Fn(usize) -> T) -> Vec<T> {
            (0..40 * 30 * channels).map(value).collect()
        }
        let coverage: Vec<u8> = (0..1200).map(|i| if i % 40 < 3 { 0 } else { 255 }).collect();
        for (channels, whole) in [(1, true), (1, false), (3, true), (3, false)] {
            let stored = |bytes: Vec<u8>, name: &str| {
                let path = folder.path().join(name);
                std::fs::write(&path, bytes).unwrap();
                read_stored(&path).unwrap()
            };
            let coverage = if whole { vec![255; 1200] } else { coverage.clone() };
            let sixteen = data(channels, |i| (i * 13 % 65536) as u16);
            let picture = Raster::from_rows(size, channels, sixteen.clone()).unwrap();
            let resampled = Resampled { picture, coverage: coverage.clone() };
            let png = stored(encode(&resampled, PictureFormat::Png, Path::new("x")).unwrap(), "a.png");
            let tiff = stored(encode(&resampled, PictureFormat::Tiff, Path::new("x")).unwrap(), "a.tiff");
            assert_eq!((png.channels, tiff.channels), (channels + usize::from(!whole), channels));
            let (Samples::U16(png_data), Samples::U16(tiff_data)) = (&png.samples, &tiff.samples) else {
                panic!("not 16 bits")
            };
            assert_eq!(without_alpha(png_data, png.channels, channels, |v| v), sixteen);
            for (i, v) in sixteen.iter().enumerate() {
                let seen = coverage[i / channels] == 255;
                assert_eq!(tiff_data[i], if seen { *v } else { 0 });
                assert!(whole || png_data[i / channels * png.channels + channels] == if seen { 65535 } else { 0 });
            }
            let floats = data(channels, |i| i as f32 * 1e-3 - 7.5);
            let picture = Raster::from_rows(size, channels, floats.clone()).unwrap();
            let resampled = Resampled { picture, coverage: coverage.clone() };
            let tiff = stored(encode(&resampled, PictureFormat::Tiff, Path::new("x")).unwrap(), "a.tiff");
            let Samples::F32(found) = &tiff.samples else { panic!("no floats") };
            let as_written = |(i, v): (usize, &f32)| {
                if coverage[i / channels] == 255 { found[i] == *v } else { found[i].is_nan() }
            };
            assert!(floats.iter().enumerate().all(as_written));
            assert!(encode(&resampled, PictureFormat::Png, Path::new("x")).is_err());
        }
    }
}
