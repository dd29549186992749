//! TIFF beyond what the `image` crate reads: one floating point channel, integers of any size with or without sign, half floats,
//! palettes, JPEG inside (which is stored as YCbCr), BigTIFF. And what a TIFF may be instead: a raw image.

use std::io::Cursor;

use groundcal::geometry::ImageSize;
use image::metadata::Orientation;
use tiff::{
    ColorType,
    decoder::{Decoder, DecodingResult, Limits},
    tags::Tag,
};

use crate::{
    images::stored::{Samples, StoredImage},
    limits::MAX_DECODER_BYTES,
};

/// DNGVersion: only raw images have it.
const DNG_VERSION: u16 = 50706;
/// PhotometricInterpretation, and the colours of a mosaic of filters and of a raw image without mosaic.
const PHOTOMETRIC: u16 = 262;
const RAW_COLOURS: [u16; 2] = [32803, 34892];
/// SubIFDs: where raw files of Nikon, Sony and others keep the raw image, behind a small one.
const SUB_IFDS: Tag = Tag::Unknown(330);
/// NewSubfileType of a reduced copy.
const REDUCED: u32 = 1;

/// What the directory says.
pub(crate) struct Header {
    pub(crate) size: [u32; 2],
    /// Whether the picture is a small one before others, as raw files have it.
    pub(crate) is_raw: bool,
    /// Whether another page follows that is no smaller copy.
    pub(crate) has_pages: bool,
    /// Whether the `image` crate can read it; else [`read`] may.
    pub(crate) is_plain: bool,
    bytes_per_pixel: u64,
}

/// Directories whose tags are looked up here: that of the picture, and whether another follows.
const DIRECTORIES: usize = 2;
/// Type of a tag that is text.
const TEXT: u64 = 2;

fn open(bytes: &[u8]) -> Result<Decoder<Cursor<&[u8]>>, String> {
    if has_endless_text(bytes) {
        return Err("a tag has a text longer than the file".into());
    }
    let mut limits = Limits::default();
    limits.decoding_buffer_size = MAX_DECODER_BYTES as usize;
    limits.intermediate_buffer_size = MAX_DECODER_BYTES as usize;
    Decoder::new(Cursor::new(bytes)).map(|d| d.with_limits(limits)).map_err(|e| e.to_string())
}

/// Whether a directory has a text that is longer than the file. The decoder would take memory for it first, and of the largest print a line of its
/// own on standard error.
fn has_endless_text(bytes: &[u8]) -> bool {
    let big_endian = bytes.starts_with(b"MM");
    let number = |at: u64, length: usize| -> Option<u64> {
        let at = usize::try_from(at).ok()?;
        let field = bytes.get(at..at.checked_add(length)?)?.iter();
        let join = |sum: u64, byte: &u8| sum << 8 | u64::from(*byte);
        Some(if big_endian { field.fold(0, join) } else { field.rev().fold(0, join) })
    };
    // BigTIFF has eight bytes where TIFF has four, and counts its entries with eight in place of two.
    let (place, wide, count_wide) = if number(2, 2) == Some(43) { (8, 8, 8) } else { (4, 4, 2) };
    let entry_wide = 4 + 2 * wide as u64;
    let mut directory = number(place, wide);
    for _ in 0..DIRECTORIES {
        let Some(at) = directory.filter(|at| *at > 0) else { return false };
        let Some(count) = number(at, count_wide) else { return false };
        let first = at.saturating_add(count_wide as u64);
        let mut end = first;
        for _ in 0..count {
            // A directory that is cut ends here, whatever its count.
            let (Some(kind), Some(length)) = (number(end.saturating_add(2), 2), number(end.saturating_add(4), wide))
            else {
                return false;
            };
            if kind == TEXT && length > bytes.len() as u64 {
                return true;
            }
            end = end.saturating_add(entry_wide);
        }
        directory = number(end, wide);
    }
    false
}

/// Whether the first directory is that of a raw image: decoders take the small picture in it for the image.
pub(crate) fn is_raw(bytes: &[u8]) -> bool {
    let big_endian = bytes.starts_with(b"MM");
    let short = |at: usize| {
        let pair = bytes.get(at..at + 2).and_then(|p| p.first_chunk::<2>().copied());
        pair.map(|p| if big_endian { u16::from_be_bytes(p) } else { u16::from_le_bytes(p) })
    };
    let long = |at: usize| Some(if big_endian { (short(at)?, short(at + 2)?) } else { (short(at + 2)?, short(at)?) });
    let Some((high, low)) = long(4) else { return false };
    let first = usize::from(high) << 16 | usize::from(low);
    // BigTIFF has another layout, and no camera writes it.
    if short(2) != Some(42) {
        return false;
    }
    let mut entries = (0..usize::from(short(first).unwrap_or(0))).map(|i| first + 2 + 12 * i);
    let raw = |at: usize| match short(at) {
        Some(DNG_VERSION) => true,
        Some(PHOTOMETRIC) => short(at + 8).is_some_and(|colour| RAW_COLOURS.contains(&colour)),
        _ => false,
    };
    bytes.get(8..10) == Some(b"CR") || entries.any(raw)
}

/// The header of the first page.
pub(crate) fn header(bytes: &[u8]) -> Result<Header, String> {
    let mut decoder = open(bytes)?;
    let (width, height) = decoder.dimensions().map_err(|e| e.to_string())?;
    let colour = decoder.colortype().map_err(|e| e.to_string())?;
    let formats: Vec<u16> = decoder.find_tag_unsigned_vec(Tag::SampleFormat).ok().flatten().unwrap_or_default();
    let reduced = decoder.find_tag_unsigned::<u32>(Tag::NewSubfileType).ok().flatten() == Some(REDUCED);
    let has = |decoder: &mut Decoder<_>, tag| matches!(decoder.find_tag(tag), Ok(Some(_)));
    let is_raw = reduced && has(&mut decoder, SUB_IFDS);
    // Sample formats: 1 unsigned, 2 signed, 3 floating point.
    let floats = formats.iter().all(|f| *f == 3) && !formats.is_empty();
    let unsigned = formats.iter().all(|f| *f == 1);
    let is_plain = match colour {
        ColorType::Gray(1) => unsigned,
        ColorType::Gray(n) | ColorType::GrayA(n) | ColorType::CMYK(n) => unsigned && matches!(n, 8 | 16),
        ColorType::RGB(n) | ColorType::RGBA(n) => (unsigned && matches!(n, 8 | 16)) || (floats && n == 32),
        _ => false,
    };
    let bytes_per_pixel = u64::from(colour.num_samples()) * u64::from(colour.bit_depth()).div_ceil(8);
    let has_pages = decoder.more_images()
        && decoder.next_image().is_ok()
        && decoder.find_tag_unsigned::<u32>(Tag::NewSubfileType).ok().flatten().unwrap_or(0) & REDUCED == 0
        && decoder.dimensions().is_ok_and(|(w, h)| (w, h) == (width, height));
    Ok(Header { size: [width, height], is_raw, has_pages, is_plain, bytes_per_pixel })
}

impl Header {
    /// Bytes of the decoded picture.
    pub(crate) fn decoded_bytes(&self) -> u64 {
        let [w, h] = self.size.map(u64::from);
        (w * h).saturating_mul(self.bytes_per_pixel)
    }
}

/// The first page of a TIFF that the `image` crate does not read, upright.
pub(crate) fn read(bytes: &[u8]) -> Result<StoredImage, String> {
    let mut decoder = open(bytes)?;
    let (width, height) = decoder.dimensions().map_err(|e| e.to_string())?;
    let colour = decoder.colortype().map_err(|e| e.to_string())?;
    let orientation = decoder.find_tag_unsigned::<u8>(Tag::Orientation).ok().flatten();
    let palette = match colour {
        ColorType::Palette(_) => decoder.get_tag_u16_vec(Tag::ColorMap).map_err(|e| e.to_string())?,
        _ => Vec::new(),
    };
    let planar = decoder.find_tag_unsigned::<u16>(Tag::PlanarConfiguration).ok().flatten() == Some(2);
    let channels = match colour {
        ColorType::Gray(8 | 16 | 32 | 64) => 1,
        ColorType::GrayA(8 | 16 | 32 | 64) => 2,
        ColorType::RGB(8 | 16 | 32 | 64) | ColorType::YCbCr(8) => 3,
        ColorType::RGBA(8 | 16 | 32 | 64) => 4,
        ColorType::Palette(8) => 1,
        other => return Err(format!("its pixels ({}) are not read", words(other))),
    };
    if planar && channels > 1 {
        return Err(
            "its channels are stored one after the other (planar), which is not read for this kind of number".into()
        );
    }
    let size = ImageSize::new(width as usize, height as usize);
    let decoded = decoder.read_image().map_err(|e| e.to_string())?;
    let is_exact = !matches!(
        decoded,
        DecodingResult::U32(_)
            | DecodingResult::U64(_)
            | DecodingResult::I32(_)
            | DecodingResult::I64(_)
            | DecodingResult::F64(_)
    );
    let samples = samples(decoded);
    let count = match &samples {
        Samples::U8(v) => v.len(),
        Samples::U16(v) => v.len(),
        Samples::F32(v) => v.len(),
    };
    if count != size.width * size.height * channels {
        return Err("it holds fewer pixels than its size says".into());
    }
    let (channels, samples) = match (colour, samples) {
        (ColorType::YCbCr(_), Samples::U8(data)) => {
            (3, Samples::U8(data.as_chunks::<3>().0.iter().flat_map(rgb_of).collect()))
        }
        (ColorType::Palette(_), Samples::U8(data)) => (3, Samples::U16(looked_up(&data, &palette)?)),
        (_, samples) => (channels, samples),
    };
    let image = StoredImage { size, channels, samples, is_tiff: true, is_exact, sound: None, notes: Vec::new() };
    Ok(image.oriented(orientation.and_then(Orientation::from_exif).unwrap_or(Orientation::NoTransforms)))
}

fn words(colour: ColorType) -> String {
    let bits = colour.bit_depth();
    match colour {
        ColorType::Gray(_) => format!("grey of {bits} bits"),
        ColorType::Palette(_) => format!("a palette of {bits} bits"),
        ColorType::Multiband { num_samples, .. } => format!("{num_samples} channels of {bits} bits"),
        ColorType::CMYK(_) => format!("CMYK of {bits} bits"),
        ColorType::YCbCr(_) => format!("YCbCr of {bits} bits"),
        ColorType::Lab(_) => format!("Lab of {bits} bits"),
        _ => format!("{} channels of {bits} bits", colour.num_samples()),
    }
}

fn samples(decoded: DecodingResult) -> Samples {
    fn floats<T: Copy>(data: Vec<T>, float: impl Fn(T) -> f32) -> Samples {
        Samples::F32(data.into_iter().map(float).collect())
    }
    match decoded {
        DecodingResult::U8(v) => Samples::U8(v),
        DecodingResult::U16(v) => Samples::U16(v),
        DecodingResult::U32(v) => floats(v, |v| v as f32),
        DecodingResult::U64(v) => floats(v, |v| v as f32),
        DecodingResult::I8(v) => floats(v, f32::from),
        DecodingResult::I16(v) => floats(v, f32::from),
        DecodingResult::I32(v) => floats(v, |v| v as f32),
        DecodingResult::I64(v) => floats(v, |v| v as f32),
        DecodingResult::F16(v) => floats(v, |v| v.to_f32()),
        DecodingResult::F32(v) => Samples::F32(v),
        DecodingResult::F64(v) => floats(v, |v| v as f32),
    }
}

/// YCbCr of JFIF (ITU-R BT.601, full range).
fn rgb_of(&[y, cb, cr]: &[u8; 3]) -> [u8; 3] {
    let (y, cb, cr) = (f32::from(y), f32::from(cb) - 128.0, f32::from(cr) - 128.0);
    [y + 1.402 * cr, y - 0.344_136 * cb - 0.714_136 * cr, y + 1.772 * cb].map(|v| v.round().clamp(0.0, 255.0) as u8)
}

/// The colours of a palette: all reds, then all greens, then all blues.
fn looked_up(data: &[u8], palette: &[u16]) -> Result<Vec<u16>, String> {
    let count = palette.len() / 3;
    let colour = |v: &u8| {
        let i = usize::from(*v);
        (i < count).then(|| [palette[i], palette[count + i], palette[2 * count + i]])
    };
    let colours: Option<Vec<[u16; 3]>> = data.iter().map(colour).collect();
    colours.map(|c| c.as_flattened().to_vec()).ok_or_else(|| "a pixel lies outside its palette".to_string())
}
