//! Pictures in the page: thumbnails and floor overlays as JPEG in data URIs.

use base64::{Engine, engine::general_purpose::STANDARD};
use groundcal::{
    geometry::ImageSize,
    result::Evidence,
    vision::{GrayImage, Pyramid, Raster, Resampled, resample},
};
use image::{ExtendedColorType, ImageBuffer, Luma, codecs::jpeg::JpegEncoder, imageops::thumbnail as thumbnail_of};
use rayon::prelude::*;

use crate::error::ReportError;
use crate::html::model::motions::{Motion, Overlay, size_of};

/// Longer side of a thumbnail, and for how many images; of more they are smaller, so that the page stays small.
const THUMBNAIL_PX: f64 = 640.0;
const THUMBNAILS: f64 = 14.0;
const MIN_THUMBNAIL_PX: f64 = 160.0;
const QUALITY: u8 = 72;
/// Overlays are made for so many motions.
pub(crate) const OVERLAYS: usize = 16;
/// Coverage (of 255) from which on a pixel of an overlay counts as seen.
const SEEN: u8 = 250;

/// A picture ready for the page.
pub(crate) struct Picture {
    /// Pixels of the JPEG.
    pub(crate) size: [usize; 2],
    /// `data:image/jpeg;base64,...`.
    pub(crate) uri: String,
}

/// The pictures of the page.
#[derive(Default)]
pub(crate) struct Pictures {
    /// One for each image, or none at all.
    pub(crate) thumbnails: Vec<Picture>,
    /// For each motion both images on the floor, where they were made.
    pub(crate) overlays: Vec<Option<[Picture; 2]>>,
}

/// Makes the pictures and notes in the motions how well the overlays fit.
pub(crate) fn pictures(images: &[GrayImage], e: &Evidence, motions: &mut [Motion]) -> Result<Pictures, ReportError> {
    let rasters: Vec<Raster> = images.par_iter().map(raster).collect::<Result<_, _>>()?;
    let shrink = (THUMBNAILS / images.len().max(1) as f64).sqrt().min(1.0);
    let side = (THUMBNAIL_PX * shrink).max(MIN_THUMBNAIL_PX);
    let thumbnails = rasters.par_iter().map(|r| thumbnail(r, side)).collect::<Result<_, _>>()?;
    let pyramids: Vec<Pyramid> = rasters.into_par_iter().map(Pyramid::new).collect();
    let overlays = motions
        .par_iter_mut()
        .enumerate()
        .map(|(i, m)| {
            let [a, b] = m.images;
            match &mut m.overlay {
                Some(overlay) if i < OVERLAYS => on_the_floor([&pyramids[a], &pyramids[b]], e, overlay).map(Some),
                _ => Ok(None),
            }
        })
        .collect::<Result<_, _>>()?;
    Ok(Pictures { thumbnails, overlays })
}

/// The values in 8 bits, row by row.
fn bytes_of(image: &GrayImage) -> Vec<u8> {
    image.data().iter().map(|v| (255.0 * v + 0.5) as u8).collect()
}

fn raster(image: &GrayImage) -> Result<Raster, ReportError> {
    Raster::from_rows(image.size(), 1, bytes_of(image))
        .ok_or_else(|| ReportError("an empty image cannot be shown in the report".into()))
}

fn thumbnail(source: &Raster, side: f64) -> Result<Picture, ReportError> {
    let full = source.size();
    let scale = (full.width.max(full.height) as f64 / side).max(1.0);
    let reduced = |length: usize| ((length as f64 / scale).round() as usize).max(1);
    let size = ImageSize::new(reduced(full.width), reduced(full.height));
    let whole = ImageBuffer::<Luma<u8>, &[u8]>::from_raw(pixels(full.width), pixels(full.height), source.data())
        .ok_or_else(|| ReportError("an empty image cannot be shown in the report".into()))?;
    let small = thumbnail_of(&whole, pixels(size.width), pixels(size.height));
    jpeg(small.as_raw(), size)
}

fn pixels(length: usize) -> u32 {
    u32::try_from(length).unwrap_or(u32::MAX)
}

fn jpeg(data: &[u8], size: ImageSize) -> Result<Picture, ReportError> {
    let mut bytes = Vec::new();
    JpegEncoder::new_with_quality(&mut bytes, QUALITY)
        .encode(data, pixels(size.width), pixels(size.height), ExtendedColorType::L8)
        .map_err(|e| ReportError(format!("cannot encode a picture of the report: {e}")))?;
    let uri = format!("data:image/jpeg;base64,{}", STANDARD.encode(&bytes));
    Ok(Picture { size: [size.width, size.height], uri })
}

/// Both images on the floor, the second as bright as the first where both see it.
fn on_the_floor(sources: [&Pyramid; 2], e: &Evidence, overlay: &mut Overlay) -> Result<[Picture; 2], ReportError> {
    let size = size_of(overlay);
    let [a, b] = [0, 1].map(|i| resample(sources[i], size, |p| overlay.map.source(e, i, p)));
    let both = common(&a, &b);
    let moments = Moments::new(both.iter().copied());
    overlay.correlation = moments.as_ref().map(Moments::correlation);
    let matched: Vec<u8> = match &moments {
        Some(m) => {
            let gain = (m.spread[0] / m.spread[1].max(1.0)).clamp(0.5, 2.0);
            b.picture.data().iter().map(|v| (m.mean[0] + gain * (f64::from(*v) - m.mean[1]) + 0.5) as u8).collect()
        }
        None => b.picture.data().to_vec(),
    };
    Ok([jpeg(a.picture.data(), size)?, jpeg(&matched, size)?])
}

/// Values of both where both see the floor.
fn common(a: &Resampled, b: &Resampled) -> Vec<[f64; 2]> {
    let values = a.picture.data().iter().zip(b.picture.data());
    let seen = a.coverage.iter().zip(&b.coverage).map(|(a, b)| *a >= SEEN && *b >= SEEN);
    values.zip(seen).filter(|(_, seen)| *seen).map(|((a, b), _)| [f64::from(*a), f64::from(*b)]).collect()
}

/// Means and deviations of pairs of values.
struct Moments {
    mean: [f64; 2],
    spread: [f64; 2],
    covariance: f64,
}

impl Moments {
    fn new(pairs: impl ExactSizeIterator<Item = [f64; 2]> + Clone) -> Option<Self> {
        const FEWEST: usize = 100;
        if pairs.len() < FEWEST {
            return None;
        }
        let n = pairs.len() as f64;
        let mean = pairs.clone().fold([0.0; 2], |s, v| [s[0] + v[0] / n, s[1] + v[1] / n]);
        let (mut squares, mut product) = ([0.0; 2], 0.0);
        for [a, b] in pairs {
            let (a, b) = (a - mean[0], b - mean[1]);
            squares = [squares[0] + a * a / n, squares[1] + b * b / n];
            product += a * b / n;
        }
        Some(Self { mean, spread: squares.map(f64::sqrt), covariance: product })
    }

    fn correlation(&self) -> f64 {
        self.covariance / (self.spread[0] * self.spread[1]).max(f64::MIN_POSITIVE)
    }
}
