//! Images that other programs read: HEIC, AVIF and raw images go through an installed converter, or are refused with the one
//! command that converts them.

use std::{
    ffi::OsString,
    fs::File,
    path::{Path, PathBuf},
    process::{Command, Stdio},
    time::{Duration, Instant},
};

use crate::text::name_text;

/// The longest that a converter may take.
const TIMEOUT: Duration = Duration::from_secs(120);
/// Between looks at it.
const POLL_INTERVAL: Duration = Duration::from_millis(10);

/// A kind of image that is not read here.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Foreign {
    /// HEIC and HEIF: phones.
    Heic,
    /// AVIF.
    Avif,
    /// DNG and other raw images.
    Raw,
    /// One that any editor converts.
    Other(&'static str),
}

/// A converter: its name, its arguments with IN and OUT (without OUT it writes to standard output), and the ending of what it makes.
type Tool = (&'static str, &'static [&'static str], &'static str);

const HEIF_CONVERT: Tool = ("heif-convert", &["IN", "OUT"], "png");
const HEIF_DEC: Tool = ("heif-dec", &["IN", "OUT"], "png");
const AVIFDEC: Tool = ("avifdec", &["IN", "OUT"], "png");
const FFMPEG: Tool = ("ffmpeg", &["-nostdin", "-v", "error", "-i", "file:IN", "-frames:v", "1", "-y", "OUT"], "png");
const DCRAW_EMU: Tool = ("dcraw_emu", &["-T", "-w", "-Z", "OUT", "IN"], "tiff");
const DCRAW: Tool = ("dcraw", &["-T", "-w", "-c", "IN"], "tiff");

impl Foreign {
    /// What a file is by its first bytes, where it is an image of another kind.
    pub(crate) fn of(bytes: &[u8]) -> Option<Self> {
        let starts = |magic: &[u8]| bytes.starts_with(magic);
        if bytes.get(4..8) == Some(b"ftyp") {
            // The brands: the major one, then those it is compatible with.
            let length = bytes.first_chunk::<4>().map_or(0, |l| u32::from_be_bytes(*l) as usize).min(256);
            let brands = bytes.get(8..length.min(bytes.len())).unwrap_or_default();
            let has = |names: &[&[u8]]| brands.chunks_exact(4).any(|b| names.contains(&b));
            return if has(&[b"avif", b"avis"]) {
                Some(Foreign::Avif)
            } else if has(&[b"heic", b"heix", b"hevc", b"hevx", b"heim", b"heis", b"mif1", b"msf1"]) {
                Some(Foreign::Heic)
            } else if has(&[b"crx "]) {
                Some(Foreign::Raw)
            } else {
                Some(Foreign::Other("a film; take single frames of it"))
            };
        }
        let others: [(&[u8], Foreign); 12] = [
            (b"FUJIFILMCCD-RAW", Foreign::Raw),
            (b"IIRO", Foreign::Raw),
            (b"IIRS", Foreign::Raw),
            (b"IIU\0", Foreign::Raw),
            (b"GIF8", Foreign::Other("a GIF")),
            (b"BM", Foreign::Other("a BMP")),
            (b"%PDF", Foreign::Other("a PDF")),
            (b"\0\0\0\x0cjP  ", Foreign::Other("a JPEG 2000")),
            (b"\0\0\0\x0cJXL ", Foreign::Other("a JPEG XL")),
            (b"\xff\x0a", Foreign::Other("a JPEG XL")),
            (b"v/1\x01", Foreign::Other("an OpenEXR")),
            (b"\x1aE\xdf\xa3", Foreign::Other("a film; take single frames of it")),
        ];
        others.into_iter().find(|(magic, _)| starts(magic)).map(|(_, kind)| kind)
    }

    fn name(self) -> &'static str {
        match self {
            Foreign::Heic => "HEIC",
            Foreign::Avif => "AVIF",
            Foreign::Raw => "a raw image",
            Foreign::Other(name) => name,
        }
    }

    /// The converters, the best first.
    fn tools(self) -> &'static [Tool] {
        match self {
            Foreign::Heic => &[HEIF_CONVERT, HEIF_DEC, FFMPEG],
            Foreign::Avif => &[HEIF_CONVERT, HEIF_DEC, AVIFDEC, FFMPEG],
            Foreign::Raw => &[DCRAW_EMU, DCRAW],
            Foreign::Other(_) => &[],
        }
    }

    /// The sentence for a user whose converters failed.
    fn other_help(self, path: &Path) -> String {
        match self {
            // Another than those that were tried, if there is none left.
            Foreign::Raw => {
                "Export it as TIFF or JPEG with a raw developer, or with the program of its camera".to_string()
            }
            other => other.help(path),
        }
    }

    /// The sentence for a user without a converter.
    fn help(self, path: &Path) -> String {
        let name = path.file_name().map(name_text).unwrap_or_default();
        let stem = path.file_stem().map(name_text).unwrap_or_default();
        match self {
            Foreign::Heic | Foreign::Avif => format!("Convert it: heif-convert '{name}' '{stem}.png'"),
            Foreign::Raw => format!("Convert it: dcraw_emu -T -w '{name}' (of LibRaw; Debian: libraw-bin)"),
            Foreign::Other(_) => "Only JPEG, PNG, TIFF and WebP are read. Convert it".to_string(),
        }
    }
}

/// A converted image, which lies in a folder that goes with it.
pub(crate) struct Converted {
    _folder: tempfile::TempDir,
    pub(crate) path: PathBuf,
    /// The program that made it.
    pub(crate) tool: &'static str,
}

/// The folders in which programs are looked for.
pub(crate) fn search_path() -> Vec<PathBuf> {
    std::env::var_os("PATH").map(|p| std::env::split_paths(&p).collect()).unwrap_or_default()
}

/// Converts a file with the first program of the folders that can.
pub(crate) fn convert(path: &Path, kind: Foreign, folders: &[PathBuf]) -> Result<Converted, String> {
    let mut failed: Vec<&str> = Vec::new();
    for (name, arguments, ending) in kind.tools() {
        let Some(program) = folders.iter().map(|f| f.join(name)).find(|p| p.is_file()) else { continue };
        let folder = tempfile::tempdir().map_err(|e| format!("cannot make a temporary folder: {e}"))?;
        let out = folder.path().join(format!("converted.{ending}"));
        if run(&program, arguments, path, &out) {
            return Ok(Converted { _folder: folder, path: out, tool: name });
        }
        failed.push(name);
    }
    let name = kind.name();
    Err(match failed.as_slice() {
        [] => format!("{name}, which is not read here. {}", kind.help(path)),
        tools => format!(
            "{name}, which {} cannot convert: damaged, or of a kind that it does not know. {}",
            tools.join(" and "),
            kind.other_help(path)
        ),
    })
}

/// Runs a converter; whether there is a result.
fn run(program: &Path, arguments: &[&str], input: &Path, output: &Path) -> bool {
    // A name that begins with a dash is no option.
    let Ok(input) = std::path::absolute(input) else { return false };
    let filled = arguments.iter().map(|a| match a.strip_suffix("IN") {
        Some(lead) => {
            let mut argument = OsString::from(lead);
            argument.push(&input);
            argument
        }
        None if *a == "OUT" => output.as_os_str().to_os_string(),
        None => OsString::from(a),
    });
    let mut command = Command::new(program);
    let stdout = if arguments.contains(&"OUT") {
        Stdio::null()
    } else {
        let Ok(file) = File::create(output) else { return false };
        file.into()
    };
    command.args(filled).stdin(Stdio::null()).stdout(stdout).stderr(Stdio::null());
    let Ok(mut child) = command.spawn() else { return false };
    let start = Instant::now();
    loop {
        match child.try_wait() {
            Ok(Some(status)) => return status.success() && output.is_file(),
            Ok(None) if start.elapsed() < TIMEOUT => std::thread::sleep(POLL_INTERVAL),
            _ => {
                let _ = child.kill();
                let _ = child.wait();
                return false;
            }
        }
    }
}

/// The largest size that a HEIF file names for one of its images (`ispe` boxes): that of the whole picture.
pub(crate) fn heif_size(bytes: &[u8]) -> Option<[u32; 2]> {
    let word = |at: usize| bytes.get(at..at + 4).and_then(|w| w.first_chunk()).map(|w| u32::from_be_bytes(*w));
    let found = bytes.windows(4).enumerate().filter(|(_, w)| w == b"ispe");
    found.filter_map(|(i, _)| Some([word(i + 8)?, word(i + 12)?])).max_by_key(|[w, h]| u64::from(*w) * u64::from(*h))
}
