//! An image file to its samples: kind by content, limits before memory, damage said, orientation applied.

use std::{
    borrow::Cow,
    io::Cursor,
    path::{Path, PathBuf},
    sync::atomic::{AtomicU64, Ordering},
};

use groundcal::geometry::ImageSize;
use image::{DynamicImage, ImageDecoder, ImageFormat, ImageReader, metadata::Orientation};

use crate::{
    error::IoError,
    file,
    images::{
        convert::{self, Foreign},
        jpeg::{self, Health},
        stored::{Samples, StoredImage},
        tiff,
    },
    limits::{MAX_DECODER_BYTES, MAX_IMAGE_BYTES, MAX_PIXELS, MAX_PIXELS_TOGETHER},
    note::Note,
    text::plain,
};

/// Part of a picture that is one flat grey at its end, from which on it is doubted.
const FLAT_PART: f64 = 0.05;

/// Reads image files, and counts their pixels together.
pub(crate) struct ImageFiles {
    pixels: AtomicU64,
    /// Where converters are looked for.
    folders: Vec<PathBuf>,
}

impl ImageFiles {
    pub(crate) fn new() -> Self {
        Self::with_converters(convert::search_path())
    }

    /// With converters of these folders only.
    pub(crate) fn with_converters(folders: Vec<PathBuf>) -> Self {
        Self { pixels: AtomicU64::new(0), folders }
    }

    /// An image file, upright.
    pub(crate) fn read(&self, path: &Path) -> Result<StoredImage, IoError> {
        self.read_bytes(path, &file::bytes(path, MAX_IMAGE_BYTES)?)
    }

    /// The content of an image file, upright.
    pub(crate) fn read_bytes(&self, path: &Path, bytes: &[u8]) -> Result<StoredImage, IoError> {
        if bytes.is_empty() {
            return Err(IoError::file(path, "the file is empty. Copy it again or remove it"));
        }
        match self.decode(path, bytes)? {
            Decoded::Image(image) => Ok(image),
            Decoded::Foreign(kind) => self.convert(path, bytes, kind),
        }
    }

    fn convert(&self, path: &Path, bytes: &[u8], kind: Foreign) -> Result<StoredImage, IoError> {
        let fail = |what: String| IoError::file(path, what);
        let converted = convert::convert(path, kind, &self.folders).map_err(fail)?;
        let result = file::bytes(&converted.path, MAX_IMAGE_BYTES)?;
        let Decoded::Image(mut image) = self.decode(path, &result)? else {
            return Err(fail(format!("{} did not make an image of it. Convert it", converted.tool)));
        };
        // Some programs convert one tile of many.
        if let (Foreign::Heic | Foreign::Avif, Some([w, h])) = (kind, convert::heif_size(bytes)) {
            let found = (image.size.width * image.size.height) as f64;
            if found < 0.5 * f64::from(w) * f64::from(h) {
                return Err(fail(format!(
                    "{} gave {} pixels of an image of {w}x{h}: one tile of it. Convert it with heif-convert",
                    converted.tool, image.size
                )));
            }
        }
        image.notes.push(Note::file(Note::CONVERTED_IMAGE, path, format!("read through {}", converted.tool)));
        Ok(image)
    }

    /// Refuses what is too large before memory is taken for it.
    fn admit(&self, path: &Path, [columns, rows]: [u32; 2], decoded_bytes: u64) -> Result<(), IoError> {
        let pixels = u64::from(columns) * u64::from(rows);
        if pixels > MAX_PIXELS || decoded_bytes > MAX_DECODER_BYTES {
            return Err(IoError::file(
                path,
                format!(
                    "too large: {columns} x {rows} pixels, at most {} megapixels and {} MiB decoded are read. Scale it down",
                    MAX_PIXELS / 1_000_000,
                    MAX_DECODER_BYTES >> 20
                ),
            ));
        }
        let together = self.pixels.fetch_add(pixels, Ordering::Relaxed) + pixels;
        if together > MAX_PIXELS_TOGETHER {
            return Err(IoError::Input(format!(
                "the images have more than {} megapixels together, which takes too much memory. Give fewer, or scale them down",
                MAX_PIXELS_TOGETHER / 1_000_000
            )));
        }
        Ok(())
    }

    fn decode(&self, path: &Path, bytes: &[u8]) -> Result<Decoded, IoError> {
        let fail = |what: String| IoError::file(path, what);
        let mut notes = Vec::new();
        let mut bytes = Cow::Borrowed(bytes);
        let format = match format_of(&bytes) {
            Some(format) => format,
            None => {
                return match Foreign::of(&bytes) {
                    Some(kind) => Ok(Decoded::Foreign(kind)),
                    None => Err(fail(
                        "not an image (its content is no JPEG, PNG, TIFF or WebP). Remove it or convert it".into(),
                    )),
                };
            }
        };
        let (mut sequential, mut sound_rows) = (false, None);
        if format == ImageFormat::Tiff {
            if tiff::is_raw(&bytes) {
                return Ok(Decoded::Foreign(Foreign::Raw));
            }
            let header = tiff::header(&bytes).map_err(|e| fail(damaged(&e)))?;
            if header.is_raw {
                return Ok(Decoded::Foreign(Foreign::Raw));
            }
            if header.has_pages {
                notes.push(Note::file(Note::SEVERAL_PAGES, path, "has several pages; the first is read"));
            }
            if !header.is_plain {
                self.admit(path, header.size, header.decoded_bytes())?;
                let image = tiff::read(&bytes).map_err(|e| fail(damaged(&e)))?;
                return Ok(Decoded::Image(StoredImage { notes, ..image }));
            }
        }
        if format == ImageFormat::Jpeg {
            let report = jpeg::inspect(&bytes);
            (sequential, sound_rows) = (report.sequential, report.sound_rows);
            notes.extend(jpeg_note(path, &report)?);
            if let Cow::Owned(whole) = jpeg::with_tables(&bytes, &report) {
                bytes = Cow::Owned(whole);
            }
        }
        let (image, stored_size, orientation) = self.plain(path, &bytes, format)?;
        let mut image = StoredImage::from_dynamic(image, notes);
        image.sound = sound_rows.and_then(|rows| StoredImage::sound_rows(stored_size, rows, orientation));
        image.is_tiff = format == ImageFormat::Tiff;
        if format == ImageFormat::Jpeg && !sequential {
            image.notes.extend(flat_end(path, &image));
        }
        Ok(Decoded::Image(image))
    }

    /// What the `image` crate reads, upright; the size in which it is stored, and how it was turned.
    fn plain(
        &self,
        path: &Path,
        bytes: &[u8],
        format: ImageFormat,
    ) -> Result<(DynamicImage, ImageSize, Orientation), IoError> {
        let mut reader = ImageReader::with_format(Cursor::new(bytes), format);
        let mut limits = image::Limits::default();
        limits.max_alloc = Some(MAX_DECODER_BYTES);
        reader.limits(limits);
        let fail = |e: image::ImageError| {
            IoError::file(
                path,
                match e {
                    image::ImageError::Limits(_) => {
                        format!("too large: decoding it needs more than {} MiB. Scale it down", MAX_DECODER_BYTES >> 20)
                    }
                    e => damaged(&e.to_string()),
                },
            )
        };
        let mut decoder = reader.into_decoder().map_err(fail)?;
        // The decoder's own limits leave its output aside.
        let (columns, rows) = decoder.dimensions();
        self.admit(path, [columns, rows], decoder.total_bytes())?;
        let orientation = decoder.orientation().map_err(fail)?;
        let mut decoded = DynamicImage::from_decoder(decoder).map_err(fail)?;
        decoded.apply_orientation(orientation);
        Ok((decoded, ImageSize::new(columns as usize, rows as usize), orientation))
    }
}

/// What a file turned out to hold.
enum Decoded {
    Image(StoredImage),
    Foreign(Foreign),
}

/// The kinds that are read, by their first bytes.
fn format_of(bytes: &[u8]) -> Option<ImageFormat> {
    // BigTIFF, which `guess_format` does not know.
    if bytes.starts_with(b"II\x2b\0") || bytes.starts_with(b"MM\0\x2b") {
        return Some(ImageFormat::Tiff);
    }
    let known = [ImageFormat::Jpeg, ImageFormat::Png, ImageFormat::Tiff, ImageFormat::WebP];
    image::guess_format(bytes).ok().filter(|f| known.contains(f))
}

fn damaged(what: &str) -> String {
    format!(
        "damaged or truncated, or a kind of image this program does not read ({}). Copy or export it again",
        plain(what.trim())
    )
}

/// A JPEG that is not whole: refused where it has no end, else noted.
fn jpeg_note(path: &Path, report: &jpeg::Report) -> Result<Option<Note>, IoError> {
    let percent = |part: f64| (100.0 * part).floor();
    let note = |what: String| Ok(Some(Note::file(Note::DAMAGED_IMAGE, path, what)));
    match report.health {
        // Frames of films leave the marker out.
        Health::Whole if report.ended || report.sequential => Ok(None),
        Health::Coarse if report.ended => note(
            "the JPEG ends early: the picture is there without its details (it is a progressive one). Copy it again from the camera"
                .to_string(),
        ),
        Health::Whole | Health::Coarse => {
            Err(IoError::file(path, "truncated: the JPEG has no end marker. Copy it again from the camera"))
        }
        Health::EndsEarly(part) if !report.ended => Err(IoError::file(
            path,
            format!(
                "truncated: the JPEG ends after {:.0} % of the picture. Copy it again from the camera",
                percent(part)
            ),
        )),
        Health::EndsEarly(part) => note(format!(
            "the JPEG ends early: only the first {:.0} % of the picture are there, the rest is filled in. Copy it again from the camera",
            percent(part)
        )),
        Health::DamagedFrom(part) if part < 1.0 => note(format!(
            "the JPEG is damaged inside, after {:.0} % of the picture; what follows is shifted or made up. Copy it again from the \
             camera",
            percent(part)
        )),
        Health::DamagedFrom(_) => note(
            "the JPEG is damaged inside: it has more data than its picture. Copy it again from the camera".to_string(),
        ),
    }
}

/// A note about a picture whose last rows are all the grey that decoders fill in.
fn flat_end(path: &Path, image: &StoredImage) -> Option<Note> {
    let Samples::U8(data) = &image.samples else { return None };
    let pixel = data.get(data.len().checked_sub(image.channels)?..)?;
    let row = image.size.width * image.channels;
    let flat = data.rchunks_exact(row).take_while(|r| r.chunks_exact(image.channels).all(|p| p == pixel)).count();
    let part = flat as f64 / image.size.height as f64;
    let filled_in = pixel.iter().all(|v| v.abs_diff(128) <= 2);
    (filled_in && part > FLAT_PART && flat < image.size.height).then(|| {
        let what = format!(
            "the last {:.0} % of the picture are one flat grey: the file may have been cut. Copy it again from the camera",
            100.0 * part
        );
        Note::file(Note::DAMAGED_IMAGE, path, what)
    })
}
