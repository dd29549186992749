//! Reading what the user names: images, folders, patterns, CSV files.

use std::{
    cmp::Ordering,
    collections::HashMap,
    path::{Path, PathBuf},
};

use groundcal::{
    geometry::size::ImageSize,
    pairs::correspondence::{ImagePair, PointMatch, validated},
    vision::image::GrayImage,
};
use image::{DynamicImage, ImageDecoder, ImageReader};
use rayon::prelude::*;

use crate::error::IoError;

/// File name endings taken for images in a folder.
const IMAGE_EXTENSIONS: [&str; 6] = ["jpg", "jpeg", "png", "tif", "tiff", "webp"];
/// Memory a decoder may ask for: 100 megapixels of 16-bit RGBA.
const MAX_DECODER_BYTES: u64 = 1 << 30;
/// Pixels of one image.
const MAX_PIXELS: u64 = 150_000_000;

/// What the inputs turned out to be.
pub enum Input {
    /// Image files, in order.
    Images(Vec<PathBuf>),
    /// One CSV of matches or tracks.
    Csv(PathBuf),
}

/// Folders, patterns and files to a list of files.
pub fn find(inputs: &[String]) -> Result<Input, IoError> {
    let mut files: Vec<PathBuf> = Vec::new();
    for input in inputs {
        let path = Path::new(input);
        if path.is_dir() {
            files.extend(images_in(path)?);
        } else if path.exists() {
            files.push(path.to_path_buf());
        } else if input.contains(['*', '?', '[']) {
            let pattern =
                glob::glob(input).map_err(|e| IoError::Usage(format!("{input} is not a valid pattern: {e}")))?;
            let mut found: Vec<PathBuf> = pattern.filter_map(Result::ok).filter(|p| p.is_file()).collect();
            if found.is_empty() {
                return Err(IoError::Input(format!(
                    "no file matches {input}. Check the pattern (quote it: 'photos/*.jpg')"
                )));
            }
            found.sort_by(|a, b| natural_order(&a.to_string_lossy(), &b.to_string_lossy()));
            files.extend(found);
        } else {
            return Err(IoError::Input(format!("{input} does not exist. Check the path")));
        }
    }
    let is_csv = |p: &PathBuf| p.extension().is_some_and(|e| e.eq_ignore_ascii_case("csv"));
    match files.as_slice() {
        [only] if is_csv(only) => Ok(Input::Csv(only.clone())),
        _ if files.iter().any(is_csv) => {
            Err(IoError::Usage("a CSV of matches or tracks is given alone, not together with other inputs".into()))
        }
        _ => {
            // One file under two spellings is one file.
            let mut seen = std::collections::HashSet::new();
            files.retain(|f| seen.insert(f.canonicalize().unwrap_or_else(|_| f.clone())));
            Ok(Input::Images(files))
        }
    }
}

fn images_in(folder: &Path) -> Result<Vec<PathBuf>, IoError> {
    let cannot = |e: std::io::Error| IoError::Input(format!("cannot read the folder {}: {e}", folder.display()));
    let mut found = Vec::new();
    let mut others = 0;
    for entry in std::fs::read_dir(folder).map_err(cannot)? {
        let path = entry.map_err(cannot)?.path();
        let extension = path.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default();
        let hidden = path.file_name().is_some_and(|n| n.to_string_lossy().starts_with('.'));
        if path.is_file() && !hidden && IMAGE_EXTENSIONS.contains(&extension.as_str()) {
            found.push(path);
        } else {
            others += 1;
        }
    }
    if found.is_empty() {
        return Err(IoError::Input(format!(
            "no images in the folder {} ({others} other entries). Images end in .{}; folders inside it are not searched",
            folder.display(),
            IMAGE_EXTENSIONS.join(", .")
        )));
    }
    found.sort_by(|a, b| natural_order(&a.to_string_lossy(), &b.to_string_lossy()));
    Ok(found)
}

/// Order of names in which 2 comes before 10; the order says which images are neighbours.
fn natural_order(a: &str, b: &str) -> Ordering {
    let (mut a_rest, mut b_rest) = (a, b);
    let digits = |s: &str| s.len() - s.trim_start_matches(|c: char| c.is_ascii_digit()).len();
    while let (Some(x), Some(y)) = (a_rest.chars().next(), b_rest.chars().next()) {
        let (m, n) = (digits(a_rest), digits(b_rest));
        if m > 0 && n > 0 {
            let (p, q) = (a_rest[..m].trim_start_matches('0'), b_rest[..n].trim_start_matches('0'));
            let order = p.len().cmp(&q.len()).then_with(|| p.cmp(q));
            if order != Ordering::Equal {
                return order;
            }
            (a_rest, b_rest) = (&a_rest[m..], &b_rest[n..]);
        } else if x != y {
            return x.cmp(&y);
        } else {
            (a_rest, b_rest) = (&a_rest[x.len_utf8()..], &b_rest[y.len_utf8()..]);
        }
    }
    a_rest.len().cmp(&b_rest.len()).then_with(|| a.cmp(b))
}

/// Names by which images are known in the output: file names, or whole paths where file names repeat.
pub fn names_of(files: &[PathBuf]) -> Vec<String> {
    let short =
        |p: &PathBuf| p.file_name().map_or_else(|| p.display().to_string(), |n| n.to_string_lossy().into_owned());
    let mut count: HashMap<String, usize> = HashMap::new();
    for f in files {
        *count.entry(short(f)).or_default() += 1;
    }
    files.iter().map(|f| if count[&short(f)] > 1 { f.display().to_string() } else { short(f) }).collect()
}

/// All images as grey values, in parallel; the first failure in the order of the list is the one reported.
pub fn images(files: &[PathBuf]) -> Result<Vec<GrayImage>, IoError> {
    let loaded: Vec<Result<GrayImage, IoError>> = files.par_iter().map(|f| image(f)).collect();
    loaded.into_iter().collect()
}

fn image(path: &Path) -> Result<GrayImage, IoError> {
    gray(path, decoded(path)?)
}

/// The content of an image file as grey values, upright; `path` stands for it in messages.
///
/// # Errors
/// [`IoError::Input`] that names the file and what is wrong with it.
pub fn gray_image(path: &Path, bytes: &[u8]) -> Result<GrayImage, IoError> {
    gray(path, decode(path, bytes)?)
}

fn gray(path: &Path, decoded: DynamicImage) -> Result<GrayImage, IoError> {
    let size = ImageSize::new(decoded.width() as usize, decoded.height() as usize);
    GrayImage::from_rows(size, grey(decoded))
        .ok_or_else(|| IoError::Input(format!("{}: a pixel value is not a finite number", path.display())))
}

/// An image file, upright.
pub fn decoded(path: &Path) -> Result<DynamicImage, IoError> {
    let fail = |what: String| IoError::Input(format!("{}: {what}", path.display()));
    let bytes = std::fs::read(path).map_err(|e| fail(format!("cannot be read: {e}")))?;
    decode(path, &bytes)
}

fn decode(path: &Path, bytes: &[u8]) -> Result<DynamicImage, IoError> {
    let fail = |what: String| IoError::Input(format!("{}: {what}", path.display()));
    if bytes.is_empty() {
        return Err(fail("the file is empty. Copy it again or remove it".into()));
    }
    let mut reader = ImageReader::new(std::io::Cursor::new(bytes))
        .with_guessed_format()
        .map_err(|e| fail(format!("cannot be read: {e}")))?;
    let format = reader.format().ok_or_else(|| {
        fail("not an image (its content is no JPEG, PNG, TIFF or WebP). Remove it or convert it".into())
    })?;
    let mut limits = image::Limits::default();
    limits.max_alloc = Some(MAX_DECODER_BYTES);
    reader.limits(limits);
    let damaged = |e: image::ImageError| match e {
        image::ImageError::Limits(_) => {
            fail(format!("too large: decoding it needs more than {} MiB. Scale it down", MAX_DECODER_BYTES >> 20))
        }
        e => fail(format!(
            "damaged or truncated, or a kind of image this program does not read ({e}). Copy or export it again"
        )),
    };
    if format == image::ImageFormat::Jpeg && !ends_like_a_jpeg(bytes) {
        return Err(fail("truncated: the JPEG has no end marker. Copy it again from the camera".into()));
    }
    let mut decoder = reader.into_decoder().map_err(damaged)?;
    // The decoder's own limits leave its output aside.
    let (columns, rows) = decoder.dimensions();
    if u64::from(columns) * u64::from(rows) > MAX_PIXELS || decoder.total_bytes() > MAX_DECODER_BYTES {
        return Err(fail(format!(
            "too large: {columns} x {rows} pixels, at most {} megapixels and {} MiB decoded are read. Scale it down",
            MAX_PIXELS / 1_000_000,
            MAX_DECODER_BYTES >> 20
        )));
    }
    let orientation = decoder.orientation().map_err(damaged)?;
    let mut decoded = DynamicImage::from_decoder(decoder).map_err(damaged)?;
    decoded.apply_orientation(orientation);
    Ok(decoded)
}

/// Whether the image data end with an end-of-image marker; decoders fill the rest of a truncated file with grey. Segments are
/// skipped by their length (thumbnails have markers of their own), and what follows the end (a motion photo's film) is not
/// looked at.
fn ends_like_a_jpeg(bytes: &[u8]) -> bool {
    let mut at = 2;
    while at + 1 < bytes.len() {
        if bytes[at] != 0xff {
            // Entropy-coded data, or padding between segments.
            at += 1;
            continue;
        }
        match bytes[at + 1] {
            0xd9 => return true,
            // A stuffed zero, a restart marker, a fill byte.
            0x00 | 0x01 | 0xd0..=0xd8 => at += 2,
            0xff => at += 1,
            _ => {
                let Some(length) = bytes.get(at + 2..at + 4) else { return false };
                at += 2 + usize::from(u16::from_be_bytes([length[0], length[1]]));
            }
        }
    }
    false
}

/// Luminance weights of Rec. 709 on the stored values, 0..1; alpha is ignored.
fn grey(image: DynamicImage) -> Vec<f32> {
    fn mix<T: Copy + Into<f32>>(raw: &[T], channels: usize, full: f32) -> Vec<f32> {
        let one = |v: T| -> f32 { v.into() / full };
        match channels {
            1 | 2 => raw.chunks_exact(channels).map(|p| one(p[0])).collect(),
            _ => raw
                .chunks_exact(channels)
                .map(|p| 0.2126 * one(p[0]) + 0.7152 * one(p[1]) + 0.0722 * one(p[2]))
                .collect(),
        }
    }
    match image {
        DynamicImage::ImageLuma8(i) => mix(i.as_raw(), 1, 255.0),
        DynamicImage::ImageLumaA8(i) => mix(i.as_raw(), 2, 255.0),
        DynamicImage::ImageRgb8(i) => mix(i.as_raw(), 3, 255.0),
        DynamicImage::ImageRgba8(i) => mix(i.as_raw(), 4, 255.0),
        DynamicImage::ImageLuma16(i) => mix(i.as_raw(), 1, 65535.0),
        DynamicImage::ImageLumaA16(i) => mix(i.as_raw(), 2, 65535.0),
        DynamicImage::ImageRgb16(i) => mix(i.as_raw(), 3, 65535.0),
        DynamicImage::ImageRgba16(i) => mix(i.as_raw(), 4, 65535.0),
        other => mix(other.into_rgb32f().as_raw(), 3, 1.0),
    }
}

/// Matches of pairs of images, from a CSV.
pub struct CsvMatches {
    /// Image names, in order of appearance (matches) or natural order (tracks).
    pub names: Vec<String>,
    /// Pairs that share points.
    pub pairs: Vec<ImagePair>,
    /// Whether pairs that are no neighbours were left out.
    pub neighbours_only: bool,
}

/// Reads `matches.csv` (`image_a,image_b,xa,ya,xb,yb[,sigma_px]`) or `tracks.csv` (`image,track,x,y[,sigma_px]`), told apart by
/// the header.
pub fn csv_matches(path: &Path, size: ImageSize, all_pairs_limit: usize) -> Result<CsvMatches, IoError> {
    let table = Table::read(path)?;
    let has = |name: &str| table.columns.contains_key(name);
    if has("image_a") && has("xa") {
        matches_table(&table, size)
    } else if has("track") && has("image") {
        tracks_table(&table, size, all_pairs_limit)
    } else {
        Err(IoError::Input(format!(
            "{}: the header is neither that of matches (image_a,image_b,xa,ya,xb,yb[,sigma_px]) nor of tracks \
             (image,track,x,y[,sigma_px])",
            path.display()
        )))
    }
}

struct Table {
    path: PathBuf,
    columns: HashMap<String, usize>,
    /// Line number and fields.
    rows: Vec<(u64, csv::StringRecord)>,
}

impl Table {
    fn read(path: &Path) -> Result<Self, IoError> {
        let fail = |what: String| IoError::Input(format!("{}: {what}", path.display()));
        let bytes = std::fs::read(path).map_err(|e| fail(format!("cannot be read: {e}")))?;
        let text = String::from_utf8(bytes).map_err(|e| {
            fail(format!("not text in UTF-8 (byte {}). Save it as UTF-8", e.utf8_error().valid_up_to()))
        })?;
        // Comments and blank lines go first, the lines that stay keep their numbers: the CSV reader miscounts after comments.
        let mut lines: Vec<u64> = Vec::new();
        let mut data = String::with_capacity(text.len());
        for (number, line) in (1..).zip(text.trim_start_matches('\u{feff}').lines()) {
            if !line.trim().is_empty() && !line.trim_start().starts_with('#') {
                lines.push(number);
                data.push_str(line);
                data.push('\n');
            }
        }
        let line_of = |position: Option<&csv::Position>| {
            let kept = position.map_or(1, csv::Position::line).max(1) as usize - 1;
            lines.get(kept).copied().unwrap_or(0)
        };
        let damaged = |e: csv::Error| match e.kind() {
            csv::ErrorKind::UnequalLengths { pos, expected_len, len } => IoError::Input(format!(
                "{} line {}: {len} fields where the header has {expected_len} fields. Correct or remove the line",
                path.display(),
                line_of(pos.as_ref())
            )),
            _ => fail(e.to_string()),
        };
        let mut reader = csv::ReaderBuilder::new().trim(csv::Trim::All).from_reader(data.as_bytes());
        let mut columns: HashMap<String, usize> = HashMap::new();
        for (i, name) in reader.headers().map_err(damaged)?.iter().enumerate() {
            if columns.insert(name.to_string(), i).is_some() && !name.is_empty() {
                return Err(fail(format!("the column {name} is there twice. Rename or remove one")));
            }
        }
        let mut rows = Vec::new();
        for record in reader.records() {
            let record = record.map_err(damaged)?;
            rows.push((line_of(record.position()), record));
        }
        if rows.is_empty() {
            return Err(fail("no rows below the header".into()));
        }
        Ok(Self { path: path.to_path_buf(), columns, rows })
    }

    fn text<'a>(&self, row: &'a (u64, csv::StringRecord), name: &str) -> Result<&'a str, IoError> {
        let column = self
            .columns
            .get(name)
            .ok_or_else(|| IoError::Input(format!("{}: the column {name} is missing", self.path.display())))?;
        Ok(&row.1[*column])
    }

    fn number(&self, row: &(u64, csv::StringRecord), name: &str) -> Result<f64, IoError> {
        let text = self.text(row, name)?;
        text.parse::<f64>().ok().filter(|v| v.is_finite()).ok_or_else(|| {
            IoError::Input(format!(
                "{} line {}: {name} is \"{text}\", which is not a finite number. Correct or remove the line",
                self.path.display(),
                row.0
            ))
        })
    }

    /// A point, refused with its line where the library would refuse it with a number of its own.
    fn point(&self, row: &(u64, csv::StringRecord), columns: [&str; 2], size: ImageSize) -> Result<[f64; 2], IoError> {
        let (x, y) = (self.number(row, columns[0])?, self.number(row, columns[1])?);
        let point = PointMatch::new([x, y], [x, y]);
        if validated(&[point], size).is_err() {
            return Err(IoError::Input(format!(
                "{} line {}: ({x}, {y}) lies far outside an image of {size} pixels. Check the line and --image-size",
                self.path.display(),
                row.0
            )));
        }
        Ok([x, y])
    }

    fn sigma(&self, row: &(u64, csv::StringRecord)) -> Result<f64, IoError> {
        if !self.columns.contains_key("sigma_px") {
            return Ok(1.0);
        }
        let sigma = self.number(row, "sigma_px")?;
        if sigma > 0.0 {
            return Ok(sigma);
        }
        Err(IoError::Input(format!("{} line {}: sigma_px is {sigma}, it must be positive", self.path.display(), row.0)))
    }
}

fn matches_table(table: &Table, size: ImageSize) -> Result<CsvMatches, IoError> {
    let mut names: Vec<String> = Vec::new();
    let mut index: HashMap<String, usize> = HashMap::new();
    let mut pairs: Vec<ImagePair> = Vec::new();
    let mut known: HashMap<(usize, usize), usize> = HashMap::new();
    for row in &table.rows {
        let mut number_of = |name: &str| {
            *index.entry(name.to_string()).or_insert_with(|| {
                names.push(name.to_string());
                names.len() - 1
            })
        };
        let (from, to) = (number_of(table.text(row, "image_a")?), number_of(table.text(row, "image_b")?));
        if from == to {
            return Err(IoError::Input(format!(
                "{} line {}: a match of {} with itself",
                table.path.display(),
                row.0,
                names[from]
            )));
        }
        let a = table.point(row, ["xa", "ya"], size)?;
        let b = table.point(row, ["xb", "yb"], size)?;
        let mut m = PointMatch { sigma_px: table.sigma(row)?, ..PointMatch::new(a, b) };
        // The same two images the other way round belong to the same pair.
        let turned = known.contains_key(&(to, from));
        if turned {
            std::mem::swap(&mut m.a, &mut m.b);
        }
        let key = if turned { (to, from) } else { (from, to) };
        let at = *known.entry(key).or_insert_with(|| {
            pairs.push(ImagePair { from: key.0, to: key.1, matches: Vec::new() });
            pairs.len() - 1
        });
        pairs[at].matches.push(m);
    }
    Ok(CsvMatches { names, pairs, neighbours_only: false })
}

/// Pairs of images that share tracks: all of them for a small set or when the user will choose, else neighbours.
fn tracks_table(table: &Table, size: ImageSize, all_pairs_limit: usize) -> Result<CsvMatches, IoError> {
    type Observations = HashMap<String, ([f64; 2], f64)>;
    let mut images: HashMap<String, Observations> = HashMap::new();
    for row in &table.rows {
        let (image, track) = (table.text(row, "image")?, table.text(row, "track")?);
        let point = (table.point(row, ["x", "y"], size)?, table.sigma(row)?);
        if images.entry(image.to_string()).or_default().insert(track.to_string(), point).is_some() {
            return Err(IoError::Input(format!(
                "{} line {}: track {track} appears twice in image {image}",
                table.path.display(),
                row.0
            )));
        }
    }
    let mut names: Vec<String> = images.keys().cloned().collect();
    names.sort_by(|a, b| natural_order(a, b));
    let count = names.len();
    let neighbours_only = count > all_pairs_limit;
    let mut pairs = Vec::new();
    for i in 0..count {
        for j in i + 1..count {
            // The last image meets the first where a turn closes.
            if neighbours_only && j - i > 3 && (i, j) != (0, count - 1) {
                continue;
            }
            let (a, b) = (&images[&names[i]], &images[&names[j]]);
            let mut shared: Vec<&String> = a.keys().filter(|track| b.contains_key(*track)).collect();
            // An order that the order of the rows has no part in.
            shared.sort_by(|a, b| natural_order(a, b));
            let matches: Vec<PointMatch> = shared
                .into_iter()
                .map(|track| {
                    let ((pa, sa), (pb, sb)) = (&a[track], &b[track]);
                    // The model has one deviation for both images of a match.
                    let sigma_px = (0.5 * (sa * sa + sb * sb)).sqrt();
                    PointMatch { sigma_px, ..PointMatch::new(*pa, *pb) }
                })
                .collect();
            if !matches.is_empty() {
                pairs.push(ImagePair { from: i, to: j, matches });
            }
        }
    }
    Ok(CsvMatches { names, pairs, neighbours_only })
}

/// Reads `--pairs`: image_a,image_b, each a name of `names` (or the end of its path, or without its extension).
pub fn pairs(path: &Path, names: &[String]) -> Result<Vec<(usize, usize)>, IoError> {
    const LISTED: usize = 12;
    let table = Table::read(path)?;
    let find = |row: &(u64, csv::StringRecord), column: &str| -> Result<usize, IoError> {
        let wanted = table.text(row, column)?;
        let stem = |n: &str| Path::new(n).file_stem().map(|s| s.to_string_lossy().into_owned()).unwrap_or_default();
        let exact = |n: &str| n == wanted;
        let by_end = |n: &str| Path::new(n).ends_with(wanted) || Path::new(wanted).ends_with(n);
        let by_stem = |n: &str| stem(n) == wanted;
        let rules: [&dyn Fn(&str) -> bool; 3] = [&exact, &by_end, &by_stem];
        let fail = |what: String| Err(IoError::Input(format!("{} line {}: {what}", path.display(), row.0)));
        for rule in rules {
            let found: Vec<usize> = (0..names.len()).filter(|&i| rule(&names[i])).collect();
            match found.as_slice() {
                [] => {}
                [only] => return Ok(*only),
                [first, second, ..] => {
                    let (first, second) = (&names[*first], &names[*second]);
                    return fail(format!("{wanted} may be {first} or {second}; write the whole name"));
                }
            }
        }
        fail(format!(
            "{wanted} is none of the {} images. Write the names as the program does: {}{}",
            names.len(),
            names[..names.len().min(LISTED)].join(", "),
            if names.len() > LISTED { ", ..." } else { "" }
        ))
    };
    let mut pairs = Vec::with_capacity(table.rows.len());
    let mut line_of: HashMap<(usize, usize), u64> = HashMap::new();
    for row in &table.rows {
        let (a, b) = (find(row, "image_a")?, find(row, "image_b")?);
        let refuse = |what: String| Err(IoError::Input(format!("{} line {}: {what}", path.display(), row.0)));
        if a == b {
            return refuse(format!("a pair of {} with itself. Name two images", names[a]));
        }
        if let Some(earlier) = line_of.insert((a.min(b), a.max(b)), row.0) {
            return refuse(format!(
                "{} and {} are a pair already in line {earlier}. Remove one of the lines",
                names[a], names[b]
            ));
        }
        pairs.push((a, b));
    }
    Ok(pairs)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_in_names_are_ordered_by_value() {
        let mut names = vec!["img10.jpg", "img2.jpg", "img02b.jpg", "a.jpg", "img1.jpg"];
        names.sort_by(|a, b| natural_order(a, b));
        assert_eq!(names, ["a.jpg", "img1.jpg", "img2.jpg", "img02b.jpg", "img10.jpg"]);
    }

    #[test]
    fn file_names_that_repeat_are_told_apart() {
        let files = [PathBuf::from("a/1.jpg"), PathBuf::from("b/1.jpg"), PathBuf::from("b/2.jpg")];
        assert_eq!(names_of(&files), ["a/1.jpg", "b/1.jpg", "2.jpg"]);
    }
}
