//! Images: whole, damaged, of other kinds.

use std::io::Cursor;

use image::{ExtendedColorType, ImageEncoder, codecs::jpeg::JpegEncoder, codecs::png::PngEncoder};
use tiff::encoder::{TiffEncoder, TiffKindBig, colortype};

const W: u32 = 64;
const H: u32 = 48;

/// A texture of 8 bits.
fn texture() -> Vec<u8> {
    let value = |x: u32, y: u32| (x.wrapping_mul(2_654_435_761) ^ y.wrapping_mul(40_503).wrapping_mul(x + 7)) >> 13;
    (0..H).flat_map(|y| (0..W).map(move |x| (value(x / 3, y / 3) % 251) as u8)).collect()
}

fn png(data: &[u8], w: u32, h: u32) -> Vec<u8> {
    let mut bytes = Vec::new();
    PngEncoder::new(&mut bytes).write_image(data, w, h, ExtendedColorType::L8).unwrap();
    bytes
}

fn jpeg() -> Vec<u8> {
    let mut bytes = Vec::new();
    let rgb: Vec<u8> = texture().iter().flat_map(|v| [*v, 255 - *v, 128]).collect();
    JpegEncoder::new_with_quality(&mut bytes, 90).write_image(&rgb, W, H, ExtendedColorType::Rgb8).unwrap();
    bytes
}

/// Without the Huffman tables, as frames of films are.
fn film_frame() -> Vec<u8> {
    let mut frame = jpeg();
    while let Some(at) = frame.windows(2).position(|w| w == [0xff, 0xc4]) {
        let length = usize::from(u16::from_be_bytes([frame[at + 2], frame[at + 3]]));
        frame.drain(at..at + 2 + length);
    }
    frame
}

fn tiff_of<C: colortype::ColorType>(data: &[C::Inner]) -> Vec<u8>
where
    [C::Inner]: tiff::encoder::TiffValue,
{
    let mut bytes = Cursor::new(Vec::new());
    TiffEncoder::new(&mut bytes).unwrap().write_image::<C>(W, H, data).unwrap();
    bytes.into_inner()
}

fn big_tiff() -> Vec<u8> {
    let mut bytes = Cursor::new(Vec::new());
    let mut encoder = TiffEncoder::<_, TiffKindBig>::new_generic(&mut bytes).unwrap();
    encoder.write_image::<colortype::Gray8>(W, H, &texture()).unwrap();
    bytes.into_inner()
}

/// A TIFF whose format of samples is a text of two gigabytes.
fn tiff_with_endless_text() -> Vec<u8> {
    let mut bytes = tiff_of::<colortype::Gray8>(&texture());
    // The entry: tag, type of a short, count.
    let entry = [339u16.to_le_bytes(), 3u16.to_le_bytes(), 1u16.to_le_bytes(), [0; 2]].concat();
    let at = bytes.windows(8).position(|w| w == entry).unwrap();
    bytes[at + 2..at + 4].copy_from_slice(&2u16.to_le_bytes());
    bytes[at + 4..at + 8].copy_from_slice(&2_000_000_000u32.to_le_bytes());
    bytes
}

/// A strip of JPEG inside a TIFF of a size.
fn tiff_with_jpeg(w: u32, h: u32) -> Vec<u8> {
    let jpeg = jpeg();
    let entries: [(u16, u16, u32, u32); 9] = [
        (256, 4, 1, w),
        (257, 4, 1, h),
        (258, 3, 3, 122),
        (259, 3, 1, 7),
        (262, 3, 1, 6),
        (273, 4, 1, 128),
        (277, 3, 1, 3),
        (278, 4, 1, h),
        (279, 4, 1, jpeg.len() as u32),
    ];
    let mut bytes = b"II\x2a\0\x08\0\0\0\x09\0".to_vec();
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

/// A PNG that says to be larger than it is.
fn png_of_said_size(side: u32) -> Vec<u8> {
    let mut bytes = png(&texture(), W, H);
    bytes[16..20].copy_from_slice(&side.to_be_bytes());
    bytes[20..24].copy_from_slice(&side.to_be_bytes());
    let check = crc(&bytes[12..29]);
    bytes[29..33].copy_from_slice(&check.to_be_bytes());
    bytes
}

/// The check sum of PNG.
fn crc(bytes: &[u8]) -> u32 {
    let step = |c: u32| if c & 1 == 1 { 0xedb8_8320 ^ (c >> 1) } else { c >> 1 };
    !bytes.iter().fold(!0u32, |c, b| (0..8).fold(c ^ u32::from(*b), |c, _| step(c)))
}

pub(super) fn files() -> Vec<(String, Vec<u8>)> {
    let t = texture();
    let wide = |factor: u16, offset: u16| t.iter().map(|v| offset + u16::from(*v) * factor).collect::<Vec<u16>>();
    let floats = |factor: f32| t.iter().map(|v| f32::from(*v) * factor).collect::<Vec<f32>>();
    let whole = jpeg();
    let scan = whole.windows(2).position(|w| w == [0xff, 0xda]).unwrap() + 14;
    let middle = (scan + whole.len()) / 2;
    let mut damaged = whole.clone();
    damaged[middle..middle + 16].iter_mut().enumerate().for_each(|(i, b)| *b = (37 * i as u8) & 0x7f);
    let all: Vec<(&str, Vec<u8>)> = vec![
        ("a.png", png(&t, W, H)),
        ("copy.png", png(&t, W, H)),
        ("grey.png", png(&vec![128; t.len()], W, H)),
        ("negative.png", png(&t.iter().rev().map(|v| 255 - v).collect::<Vec<u8>>(), W, H)),
        ("one_pixel.png", png(&[7], 1, 1)),
        ("small.png", png(&t[..32 * 32], 32, 32)),
        // Each stands for a file that programs like this one do not read, or read wrongly.
        ("float.tif", tiff_of::<colortype::Gray32Float>(&floats(1.0 / 255.0))),
        (
            "float255.tif",
            tiff_of::<colortype::RGB32Float>(&floats(1.0).iter().flat_map(|v| [*v; 3]).collect::<Vec<_>>()),
        ),
        ("ten_bits.tif", tiff_of::<colortype::Gray16>(&wide(4, 0))),
        ("eight_in_sixteen.tif", tiff_of::<colortype::Gray16>(&wide(1, 0))),
        ("thermal.tif", tiff_of::<colortype::Gray16>(&wide(1, 7000))),
        ("sixteen.tif", tiff_of::<colortype::Gray16>(&wide(257, 0))),
        ("big.tif", big_tiff()),
        ("jpeg_inside.tif", tiff_with_jpeg(W, H)),
        ("film_frame.jpg", film_frame()),
        ("cut.jpg", [&whole[..middle], &[0, 0xff, 0xd9]].concat()),
        ("damaged.jpg", damaged),
        // Damaged beyond use, and no images.
        ("truncated.jpg", whole[..middle].to_vec()),
        ("truncated.png", {
            let p = png(&t, W, H);
            p[..p.len() / 2].to_vec()
        }),
        ("truncated.tif", {
            let p = tiff_of::<colortype::Gray8>(&t);
            p[..p.len() / 2].to_vec()
        }),
        ("nan.tif", tiff_of::<colortype::Gray32Float>(&vec![f32::NAN; t.len()])),
        ("huge.png", png_of_said_size(100_000)),
        ("endless_text.tif", tiff_with_endless_text()),
        ("huge.tif", tiff_with_jpeg(60_000, 60_000)),
        ("note.jpg", b"Shopping list: bread, milk, a tripod.\n".to_vec()),
        ("empty.png", Vec::new()),
        ("a.gif", b"GIF89a..........".to_vec()),
        ("a.mp4", b"\0\0\0\x18ftypisom\0\0\0\0isommp42....".to_vec()),
    ];
    all.into_iter().map(|(name, content)| (name.to_string(), content)).collect()
}
