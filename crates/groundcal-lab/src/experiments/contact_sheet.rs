//! All pictures of a scene on one sheet.

use image::{ImageEncoder, RgbImage, codecs::jpeg::JpegEncoder, imageops};

use crate::{error::LabError, renderer::render::RgbImage8};

/// Width of a sheet and the gap between its pictures, pixels.
const WIDTH: u32 = 980;
const GAP: u32 = 4;
const QUALITY: u8 = 72;

/// The pictures, `columns` a row, as JPEG.
pub(crate) fn jpeg(pictures: &[&RgbImage8], columns: u32) -> Result<Vec<u8>, LabError> {
    let Some(first) = pictures.first() else { return Ok(Vec::new()) };
    let width = (WIDTH - GAP * (columns - 1)) / columns;
    let height = width * first.size.height as u32 / first.size.width as u32;
    let rows = (pictures.len() as u32).div_ceil(columns);
    let mut sheet = RgbImage::from_pixel(WIDTH, rows * (height + GAP) - GAP, image::Rgb([255; 3]));
    for (i, picture) in pictures.iter().enumerate() {
        let (w, h) = (picture.size.width as u32, picture.size.height as u32);
        let Some(full) = RgbImage::from_raw(w, h, picture.data.clone()) else { continue };
        let small = imageops::thumbnail(&full, width, height);
        let (column, row) = (i as u32 % columns, i as u32 / columns);
        imageops::replace(&mut sheet, &small, i64::from(column * (width + GAP)), i64::from(row * (height + GAP)));
    }
    let mut bytes = Vec::new();
    JpegEncoder::new_with_quality(&mut bytes, QUALITY)
        .write_image(&sheet, sheet.width(), sheet.height(), image::ExtendedColorType::Rgb8)
        .map_err(|e| LabError::Other(format!("cannot encode the sheet of pictures: {e}")))?;
    Ok(bytes)
}
