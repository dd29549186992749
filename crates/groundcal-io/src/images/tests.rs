use std::{
    io::Cursor,
    path::{Path, PathBuf},
};

use groundcal::Silent;
use groundcal::geometry::ImageSize;
use image::{ExtendedColorType, ImageEncoder, codecs::jpeg::JpegEncoder};
use tiff::encoder::{TiffEncoder, TiffKindBig, colortype};

use crate::{
    images::{ArrayImage, Arrays, Pixels, Samples, decode::ImageFiles, read::read_with, read_images, read_stored},
    note::Note,
    pictures::{Picture, PictureFormat, PictureReader},
};

const W: u32 = 96;
const H: u32 = 64;

/// A texture of 8 bits.
fn texture() -> Vec<u8> {
    let value = |x: u32, y: u32| (x.wrapping_mul(2_654_435_761) ^ y.wrapping_mul(40_503).wrapping_mul(x + 7)) >> 13;
    (0..H).flat_map(|y| (0..W).map(move |x| (value(x / 3, y / 3) % 251) as u8)).collect()
}

struct Folder(tempfile::TempDir);

impl Folder {
    fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    fn file(&self, name: &str, bytes: &[u8]) -> PathBuf {
        let path = self.0.path().join(name);
        std::fs::write(&path, bytes).unwrap();
        path
    }
}

fn tiff_of<C: colortype::ColorType>(data: &[C::Inner], big: bool) -> Vec<u8>
where
    [C::Inner]: tiff::encoder::TiffValue,
{
    let mut bytes = Cursor::new(Vec::new());
    if big {
        TiffEncoder::<_, TiffKindBig>::new_generic(&mut bytes).unwrap().write_image::<C>(W, H, data).unwrap();
    } else {
        TiffEncoder::new(&mut bytes).unwrap().write_image::<C>(W, H, data).unwrap();
    }
    bytes.into_inner()
}

/// The greatest difference of an image from the texture.
fn difference(bytes: &[u8]) -> f32 {
    let folder = Folder::new();
    let read = read_images(&[folder.file("a", bytes)]).unwrap();
    let pairs = read.images[0].data().iter().zip(texture());
    pairs.map(|(g, t)| (g - f32::from(t) / 255.0).abs()).fold(0.0, f32::max)
}

#[test]
fn one_channel_of_any_number() {
    let t = texture();
    let floats = |scale: f32| t.iter().map(|v| f32::from(*v) * scale).collect::<Vec<f32>>();
    assert!(difference(&tiff_of::<colortype::Gray8>(&t, false)) < 1e-6);
    assert!(difference(&tiff_of::<colortype::Gray8>(&t, true)) < 1e-6);
    assert!(
        difference(&tiff_of::<colortype::Gray16>(&t.iter().map(|v| u16::from(*v) * 257).collect::<Vec<_>>(), false))
            < 1e-6
    );
    // 8 bits in 16, and 10 in 16: what the texture is, up to the least step of white.
    assert!(
        difference(&tiff_of::<colortype::Gray16>(&t.iter().map(|v| u16::from(*v)).collect::<Vec<_>>(), false)) < 1e-6
    );
    assert!(
        difference(&tiff_of::<colortype::Gray16>(&t.iter().map(|v| u16::from(*v) * 4).collect::<Vec<_>>(), false))
            < 0.004
    );
    assert!(
        difference(&tiff_of::<colortype::Gray32>(&t.iter().map(|v| u32::from(*v)).collect::<Vec<_>>(), false)) < 1e-6
    );
    assert!(
        difference(&tiff_of::<colortype::GrayI16>(&t.iter().map(|v| i16::from(*v)).collect::<Vec<_>>(), false)) < 1e-6
    );
    assert!(difference(&tiff_of::<colortype::Gray32Float>(&floats(1.0 / 255.0), false)) < 1e-6);
    assert!(difference(&tiff_of::<colortype::Gray32Float>(&floats(1.0), false)) < 1e-6);
    assert!(
        difference(&tiff_of::<colortype::Gray64Float>(
            &floats(1.0).iter().map(|v| f64::from(*v)).collect::<Vec<_>>(),
            true
        )) < 1e-6
    );
    let rgb: Vec<f32> = floats(1.0).iter().flat_map(|v| [*v; 3]).collect();
    assert!(difference(&tiff_of::<colortype::RGB32Float>(&rgb, false)) < 1e-5);
}

#[test]
fn float_colour_keeps_its_depth_where_the_format_has_it() {
    let folder = Folder::new();
    let rgb: Vec<f32> = texture().iter().flat_map(|v| [f32::from(*v), 0.0, 255.0]).collect();
    let path = folder.file("a.tif", &tiff_of::<colortype::RGB32Float>(&rgb, false));
    let read = |asked| {
        let size = ImageSize::new(W as usize, H as usize);
        let (reader, notes) = PictureReader::new(std::slice::from_ref(&path), size, asked, false).unwrap();
        let notes: Vec<String> = notes.iter().map(ToString::to_string).collect();
        (reader.read(0).unwrap(), reader.format(0), notes.join("\n"))
    };
    let (picture, format, notes) = read(None);
    let Picture::F32(raster) = picture else { panic!("{picture:?}") };
    assert_eq!((raster.data(), format, notes.as_str()), (rgb.as_slice(), PictureFormat::Tiff, ""));
    let (picture, _, notes) = read(Some(PictureFormat::Jpeg));
    let Picture::U8(raster) = picture else { panic!("{picture:?}") };
    assert_eq!(raster.data()[..3], [texture()[0], 0, 255]);
    assert!(
        notes.contains("a.tif: has floating point numbers, which JPEG does not hold") && notes.contains("255"),
        "{notes}"
    );
    let (picture, _, notes) = read(Some(PictureFormat::Png));
    let Picture::U16(raster) = picture else { panic!("{picture:?}") };
    assert_eq!(raster.data()[..3], [u16::from(texture()[0]) * 257, 0, 65535]);
    assert!(notes.contains("written with 16 bits"), "{notes}");
}

/// Thermal counts differ by little, and not from picture to picture: one range serves both.
#[test]
fn one_range_serves_all_images() {
    let folder = Folder::new();
    let counts = |offset: u16| texture().iter().map(|v| 7000 + offset + u16::from(*v)).collect::<Vec<u16>>();
    let a = folder.file("a.tif", &tiff_of::<colortype::Gray16>(&counts(0), false));
    let b = folder.file("b.tif", &tiff_of::<colortype::Gray16>(&counts(50), false));
    let read = read_images(&[a, b]).unwrap();
    assert_eq!(read.notes.len(), 1);
    assert!(read.notes[0].code == Note::VALUE_RANGE && read.notes[0].file.is_none());
    let steps: Vec<f32> = read.images[0].data().iter().zip(read.images[1].data()).map(|(x, y)| y - x).collect();
    assert!(steps.iter().all(|s| (s - steps[0]).abs() < 1e-4 && *s > 0.1), "{:?}", &steps[..4]);
    let (least, most) = read.images[0].data().iter().fold((9.0f32, -9.0f32), |(l, m), v| (l.min(*v), m.max(*v)));
    assert!(most - least > 0.6, "{least} to {most}");
}

fn jpeg_of(data: &[u8], quality: u8) -> Vec<u8> {
    let mut bytes = Vec::new();
    let rgb: Vec<u8> = data.iter().flat_map(|v| [*v, 255 - *v, 128]).collect();
    JpegEncoder::new_with_quality(&mut bytes, quality).write_image(&rgb, W, H, ExtendedColorType::Rgb8).unwrap();
    bytes
}

/// Position behind the header of the first scan.
fn scan_start(jpeg: &[u8]) -> usize {
    let at = jpeg.windows(2).position(|w| w == [0xff, 0xda]).unwrap();
    at + 2 + usize::from(u16::from_be_bytes([jpeg[at + 2], jpeg[at + 3]]))
}

#[test]
fn damaged_jpegs_are_named() {
    let folder = Folder::new();
    let whole = jpeg_of(&texture(), 90);
    let notes = |bytes: &[u8]| read_images(&[folder.file("a.jpg", bytes)]).map(|r| r.notes);
    assert_eq!(notes(&whole).unwrap(), []);
    let start = scan_start(&whole);
    let data = whole.len() - 2 - start;
    for part in [0.1, 0.5, 0.9] {
        let cut = start + (data as f64 * part) as usize;
        let mut early = whole[..cut].to_vec();
        // Half a stuffed byte would eat the marker.
        early.push(0);
        early.extend([0xff, 0xd9]);
        let found = notes(&early).unwrap();
        assert!(
            found[0].code == Note::DAMAGED_IMAGE && found[0].to_string().contains("a.jpg: the JPEG ends early"),
            "{found:?}"
        );
        let message = notes(&whole[..cut]).unwrap_err().to_string();
        assert!(message.contains("truncated"), "{message}");
    }
    // Bytes in the middle of the data put others out of step.
    let mut seen = 0;
    for at in (0..data - 24).step_by(data / 20) {
        let mut damaged = whole.clone();
        damaged[start + at..start + at + 16].iter_mut().enumerate().for_each(|(i, b)| *b = (37 * i as u8) & 0x7f);
        seen += notes(&damaged).map_or(1, |n| usize::from(!n.is_empty()));
    }
    assert!(seen >= 18, "{seen} of 20");
}

/// The first half of the data of a JPEG, with an end.
fn cut(whole: &[u8]) -> Vec<u8> {
    let start = scan_start(whole);
    [&whole[..(start + whole.len()) / 2], &[0, 0xff, 0xd9]].concat()
}

#[test]
fn what_a_decoder_fills_in_is_not_used() {
    let folder = Folder::new();
    let whole = jpeg_of(&texture(), 90);
    let read = |bytes: &[u8]| read_images(&[folder.file("a.jpg", bytes)]).unwrap().images.remove(0);
    assert_eq!(read(&whole).mask(), None);
    let (whole_picture, picture) = (read(&whole), read(&cut(&whole)));
    let mask = picture.mask().expect("a mask");
    let (w, h) = (f64::from(W), f64::from(H));
    assert!((0.2..0.8).contains(&used(mask)), "{}", used(mask));
    assert!(mask.contains(0.0, 0.0) && mask.contains(w - 1.0, 0.0) && !mask.contains(0.0, h - 1.0));
    // What is used is what the whole file shows there.
    for (i, (a, b)) in picture.data().iter().zip(whole_picture.data()).enumerate() {
        let (x, y) = (i % W as usize, i / W as usize);
        assert!(!mask.contains(x as f64, y as f64) || a == b, "({x}, {y})");
    }
    // Turned by its tag: Exif with orientation 6, a quarter to the right, so that the first rows stand at the right.
    let exif = b"Exif\0\0II\x2a\0\x08\0\0\0\x01\0\x12\x01\x03\0\x01\0\0\0\x06\0\0\0\0\0\0\0";
    let length = (exif.len() as u16 + 2).to_be_bytes();
    let cut = cut(&whole);
    let turned = read(&[&cut[..2], &[0xff, 0xe1], &length, exif, &cut[2..]].concat());
    let turned = turned.mask().expect("a mask");
    assert_eq!(used(turned), used(mask));
    assert!(turned.contains(h - 1.0, 0.0) && turned.contains(h - 1.0, w - 1.0) && !turned.contains(0.0, 0.0));
}

/// A picture of 32 x 24 pixels in ten scans.
fn progressive() -> Vec<u8> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../groundcal-fuzz/corpus/images/progressive.jpg");
    std::fs::read(path).unwrap()
}

#[test]
fn a_progressive_jpeg_that_is_cut_is_named() {
    let folder = Folder::new();
    let whole = progressive();
    let read = |bytes: &[u8]| read_images(&[folder.file("a.jpg", bytes)]).unwrap();
    let found = read(&whole);
    assert_eq!((found.notes.as_slice(), found.images[0].mask()), (&[][..], None));
    let scans: Vec<usize> = (0..whole.len()).filter(|i| whole[*i..].starts_with(&[0xff, 0xda])).collect();
    assert!(scans.len() > 3, "{scans:?}");
    // Whole scans are missing at the end: coarse everywhere.
    for end in &scans[2..] {
        let found = read(&[&whole[..*end], &[0xff, 0xd9]].concat());
        assert!(found.notes[0].to_string().contains("ends early: the picture is there without its details"));
        assert_eq!(found.images[0].mask(), None);
    }
    // In the first details of brightness, of 21 bytes: a decoder makes a pattern of what is missing.
    let found = read(&[&whole[..scans[1] + 10 + 8], &[0, 0xff, 0xd9]].concat());
    assert!(found.notes[0].to_string().contains("the JPEG ends early: only the first"), "{:?}", found.notes);
    assert!(found.images[0].mask().is_some_and(|mask| used(mask) < 1.0));
    // Half of the first scan, of eleven bytes: what is below is not there at all.
    let found = read(&[&whole[..scan_start(&whole) + 5], &[0, 0xff, 0xd9]].concat());
    assert!(found.notes[0].to_string().contains("the JPEG ends early: only the first"), "{:?}", found.notes);
    let used = used(found.images[0].mask().expect("a mask"));
    assert!((0.0..0.5).contains(&used), "{used}");
}

#[test]
fn frames_of_films_get_their_tables() {
    let folder = Folder::new();
    let whole = jpeg_of(&texture(), 90);
    // The encoder writes the tables of annex K; a frame leaves them out.
    let mut frame = whole.clone();
    while let Some(at) = frame.windows(2).position(|w| w == [0xff, 0xc4]) {
        let length = usize::from(u16::from_be_bytes([frame[at + 2], frame[at + 3]]));
        frame.drain(at..at + 2 + length);
    }
    assert!(frame.len() + 400 < whole.len());
    let stored = |bytes: &[u8]| read_stored(&folder.file("a.jpg", bytes)).unwrap();
    assert_eq!(stored(&frame), stored(&whole));
    // Nor need it end with a marker.
    assert_eq!(stored(&frame[..frame.len() - 2]), stored(&whole));
}

/// A strip of JPEG inside a TIFF, as scanners write it.
fn tiff_with_jpeg(jpeg: &[u8], [w, h]: [u32; 2]) -> Vec<u8> {
    let mut entries: Vec<(u16, u16, u32, u32)> = vec![
        (256, 4, 1, w),
        (257, 4, 1, h),
        (258, 3, 3, 0),
        (259, 3, 1, 7),
        (262, 3, 1, 6),
        (273, 4, 1, 0),
        (277, 3, 1, 3),
        (278, 4, 1, h),
        (279, 4, 1, jpeg.len() as u32),
    ];
    let after = 8 + 2 + 12 * entries.len() as u32 + 4;
    entries[2].3 = after;
    entries[5].3 = after + 6;
    let mut bytes = b"II\x2a\0\x08\0\0\0".to_vec();
    bytes.extend((entries.len() as u16).to_le_bytes());
    for (tag, kind, count, value) in entries {
        bytes.extend(tag.to_le_bytes());
        bytes.extend(kind.to_le_bytes());
        bytes.extend(count.to_le_bytes());
        bytes.extend(value.to_le_bytes());
    }
    bytes.extend([0; 4]);
    bytes.extend([8, 0, 8, 0, 8, 0]);
    bytes.extend(jpeg);
    bytes
}

#[test]
fn jpeg_inside_tiff_is_the_same_picture() {
    let folder = Folder::new();
    let jpeg = jpeg_of(&texture(), 95);
    let rgb = |path: &Path| match read_stored(path).unwrap().samples {
        Samples::U8(data) => data,
        other => panic!("{other:?}"),
    };
    let plain = rgb(&folder.file("a.jpg", &jpeg));
    let inside = rgb(&folder.file("a.tif", &tiff_with_jpeg(&jpeg, [W, H])));
    let worst = plain.iter().zip(&inside).map(|(a, b)| a.abs_diff(*b)).max().unwrap();
    assert!(worst <= 2, "{worst}");
}

#[test]
fn what_is_no_image_is_named() {
    let folder = Folder::new();
    let none = ImageFiles::with_converters(Vec::new());
    let says = |name: &str, bytes: &[u8], word: &str| {
        let message = read_with(&none, &[folder.file(name, bytes)], &Silent).unwrap_err().to_string();
        assert!(message.contains(word) && message.contains(name), "{message}");
    };
    says("a.heic", b"\0\0\0\x18ftypheic\0\0\0\0mif1heic....", "heif-convert 'a.heic' 'a.png'");
    says("a.avif", b"\0\0\0\x18ftypavif\0\0\0\0mif1avif....", "AVIF");
    says("a.gif", b"GIF89a..........", "a GIF");
    says("a.mp4", b"\0\0\0\x18ftypisom\0\0\0\0isommp42....", "a film");
    says("a.txt", b"hello", "not an image");
    says("a.jpg", b"", "empty");
    // A DNG is a TIFF whose first picture is a small one.
    let mut dng = b"II\x2a\0\x08\0\0\0\x04\0".to_vec();
    for (tag, kind, value) in [(256u16, 4u16, W), (257, 4, H), (258, 3, 8), (50706, 1, 1)] {
        dng.extend(tag.to_le_bytes());
        dng.extend(kind.to_le_bytes());
        dng.extend(1u32.to_le_bytes());
        dng.extend(value.to_le_bytes());
    }
    dng.extend([0; 8]);
    says("a.dng", &dng, "dcraw_emu -T -w 'a.dng'");
}

/// Stands in for a converter.
#[cfg(unix)]
#[test]
fn a_converter_is_used_where_there_is_one() {
    use std::os::unix::fs::PermissionsExt;
    let folder = Folder::new();
    let png = folder.file("result.png", &{
        let mut bytes = Vec::new();
        image::codecs::png::PngEncoder::new(&mut bytes).write_image(&texture(), W, H, ExtendedColorType::L8).unwrap();
        bytes
    });
    let heic = folder.file("-a.heic", b"\0\0\0\x18ftypheic\0\0\0\0mif1heic....");
    let tools = Folder::new();
    let tool =
        tools.file("heif-convert", format!("#!/bin/sh\ntest -f \"$1\" && cp '{}' \"$2\"\n", png.display()).as_bytes());
    std::fs::set_permissions(&tool, PermissionsExt::from_mode(0o755)).unwrap();
    let reader = ImageFiles::with_converters(vec![tools.0.path().to_path_buf()]);
    let read = read_with(&reader, std::slice::from_ref(&heic), &Silent).unwrap();
    assert_eq!(read.images[0].size().width, W as usize);
    assert!(read.notes[0].to_string().contains("read through heif-convert"), "{:?}", read.notes);
    // One tile of a larger picture is no picture.
    let mut tiled = std::fs::read(&heic).unwrap();
    tiled.extend(b"\0\0\0\x14ispe\0\0\0\0\0\0\x10\0\0\0\x0c\0");
    let tiled = folder.file("b.heic", &tiled);
    let message = read_with(&reader, &[tiled], &Silent).unwrap_err().to_string();
    assert!(message.contains("one tile"), "{message}");
    std::fs::write(&tool, "#!/bin/sh\nexit 1\n").unwrap();
    let message = read_with(&reader, &[heic], &Silent).unwrap_err().to_string();
    assert!(message.contains("heif-convert cannot convert"), "{message}");
}

/// One that writes to standard output, where the first cannot.
#[cfg(unix)]
#[test]
fn a_raw_image_goes_through_the_next_converter() {
    use std::os::unix::fs::PermissionsExt;
    let folder = Folder::new();
    let result = folder.file("result.tiff", &tiff_of::<colortype::Gray8>(&texture(), false));
    let raw = folder.file("a.raf", b"FUJIFILMCCD-RAW 0201");
    let tools = Folder::new();
    let tool = |name: &str, script: String| {
        let path = tools.file(name, script.as_bytes());
        std::fs::set_permissions(path, PermissionsExt::from_mode(0o755)).unwrap();
    };
    tool("dcraw_emu", "#!/bin/sh\nexit 1\n".into());
    let reader = ImageFiles::with_converters(vec![tools.0.path().to_path_buf()]);
    let message = read_with(&reader, std::slice::from_ref(&raw), &Silent).unwrap_err().to_string();
    assert!(message.contains("dcraw_emu cannot convert") && message.contains("raw developer"), "{message}");
    tool("dcraw", format!("#!/bin/sh\ncat '{}'\n", result.display()));
    let read = read_with(&reader, &[raw], &Silent).unwrap();
    assert!(read.notes[0].to_string().contains("read through dcraw"), "{:?}", read.notes);
    assert_eq!(read.images[0].size().width, W as usize);
}

/// Sizes are refused by the header, before memory is taken.
#[test]
fn huge_images_are_refused() {
    let folder = Folder::new();
    let tiff = tiff_with_jpeg(&jpeg_of(&texture(), 90), [60_000, 60_000]);
    let message = read_images(&[folder.file("a.tif", &tiff)]).unwrap_err().to_string();
    assert!(message.contains("too large: 60000 x 60000"), "{message}");
    #[cfg(unix)]
    assert!(read_images(&["/dev/zero".into()]).unwrap_err().to_string().contains("a device"));
}

#[test]
fn arrays_whose_samples_are_not_as_said_are_refused() {
    let of = |width: usize, channels: usize, pixels: &[f32]| {
        let size = ImageSize::new(width, 3);
        let array = ArrayImage { name: "it", size, channels, blue_first: false, pixels: Pixels::F32(pixels) };
        Arrays::default().add(&array).map_err(|error| error.to_string())
    };
    let samples = [0.5f32; 36];
    assert!(of(4, 3, &samples).is_ok());
    for (width, channels, what) in
        [(4, 0, "0 channels"), (4, 5, "5 channels"), (4, 2, "36 samples"), (usize::MAX, 3, "36 samples")]
    {
        let message = of(width, channels, &samples).unwrap_err();
        assert!(message.starts_with("it: ") && message.contains(what), "{message}");
    }
    let message = of(4, 3, &[f32::NAN; 36]).unwrap_err();
    assert!(message.contains("not a finite number"), "{message}");
}

/// Fraction of the pixels that a mask holds.
fn used(mask: &groundcal::Mask) -> f64 {
    let size = mask.size();
    let held = |i: usize| mask.contains((i % size.width) as f64, (i / size.width) as f64);
    let all = size.width * size.height;
    (0..all).filter(|i| held(*i)).count() as f64 / all as f64
}
