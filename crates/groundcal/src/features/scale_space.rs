//! Gaussian scale space and the extrema of its differences.

use super::FeatureOptions;
use crate::image::{GrayImage, ImageSize};

/// Scales in an octave.
const LAYERS: usize = 3;
/// Blur of the first image of an octave, in its pixels.
const BASE_SIGMA: f64 = 1.6;
/// Blur that the camera is taken to have given, in pixels.
const CAMERA_SIGMA: f64 = 0.5;
/// Extrema nearer to the border than this are left out.
const BORDER: usize = 5;

/// One octave: `LAYERS + 3` images of doubling blur.
pub(super) struct Octave {
    pub(super) gaussians: Vec<GrayImage>,
    /// Image pixels for one pixel of this octave; pixel i lies at i times this.
    pub(super) pixel_px: f32,
}

pub(super) struct ScaleSpace {
    pub(super) octaves: Vec<Octave>,
}

/// An extremum, not yet given a direction.
#[derive(Debug, Clone, Copy)]
pub(super) struct Extremum {
    /// Image pixels.
    pub(super) x: f32,
    pub(super) y: f32,
    /// Blur in image pixels.
    pub(super) scale: f32,
    pub(super) response: f32,
    pub(super) octave: usize,
    pub(super) layer: usize,
}

impl ScaleSpace {
    pub(super) fn new(image: &GrayImage, options: &FeatureOptions) -> Self {
        let mut pixel_px = 1.0f32;
        let mut sigma = CAMERA_SIGMA;
        let mut base;
        if image.data().len() <= options.upsample_below_px {
            base = upsample(image);
            pixel_px = 0.5;
            sigma *= 2.0;
        } else {
            base = image.clone();
            while base.data().len() > options.halve_above_px {
                // To the blur of a camera of twice the pixel size, then every second pixel.
                let target: f64 = 2.0 * CAMERA_SIGMA;
                base = halve(&blur(&base, (target * target - sigma * sigma).max(0.01).sqrt()));
                pixel_px *= 2.0;
                sigma = CAMERA_SIGMA;
            }
        }
        let mut octaves = Vec::new();
        let mut first = blur(&base, (BASE_SIGMA * BASE_SIGMA - sigma * sigma).sqrt());
        drop(base);
        let step = 2f64.powf(1.0 / LAYERS as f64);
        while first.width().min(first.height()) > 2 * BORDER + 2 {
            let mut gaussians = vec![first];
            for layer in 1..LAYERS + 3 {
                let before = BASE_SIGMA * step.powi(layer as i32 - 1);
                let next = blur(&gaussians[layer - 1], before * (step * step - 1.0).sqrt());
                gaussians.push(next);
            }
            first = halve(&gaussians[LAYERS]);
            octaves.push(Octave { gaussians, pixel_px });
            pixel_px *= 2.0;
        }
        Self { octaves }
    }

    pub(super) fn extrema(&self, options: &FeatureOptions) -> Vec<Extremum> {
        let mut found = Vec::new();
        for (index, octave) in self.octaves.iter().enumerate() {
            let differences: Vec<GrayImage> =
                octave.gaussians.windows(2).map(|pair| subtract(&pair[1], &pair[0])).collect();
            for layer in 1..=LAYERS {
                extrema_of_layer(&differences, layer, index, octave.pixel_px, options, &mut found);
            }
        }
        found
    }
}

fn extrema_of_layer(
    differences: &[GrayImage],
    layer: usize,
    octave: usize,
    pixel_px: f32,
    options: &FeatureOptions,
    found: &mut Vec<Extremum>,
) {
    let threshold = (0.5 * options.contrast_threshold / LAYERS as f64) as f32;
    let (w, h) = (differences[0].width(), differences[0].height());
    // Highest and lowest of the nine values in this column: three rows of three layers.
    let (mut high, mut low) = (vec![0.0f32; w], vec![0.0f32; w]);
    for y in BORDER..h - BORDER {
        let row = differences[layer].row(y);
        high.copy_from_slice(row);
        low.copy_from_slice(row);
        for difference in &differences[layer - 1..=layer + 1] {
            for neighbour in [y - 1, y, y + 1] {
                for ((top, bottom), &v) in high.iter_mut().zip(&mut low).zip(difference.row(neighbour)) {
                    *top = if v > *top { v } else { *top };
                    *bottom = if v < *bottom { v } else { *bottom };
                }
            }
        }
        for x in BORDER..w - BORDER {
            let v = row[x];
            let is_extremum = (v > threshold && v >= high[x - 1] && v >= high[x] && v >= high[x + 1])
                || (v < -threshold && v <= low[x - 1] && v <= low[x] && v <= low[x + 1]);
            if is_extremum && let Some((fx, fy, fs, response, final_layer)) = locate(differences, layer, x, y, options)
            {
                found.push(Extremum {
                    x: fx * pixel_px,
                    y: fy * pixel_px,
                    scale: (BASE_SIGMA as f32) * 2f32.powf(fs / LAYERS as f32) * pixel_px,
                    response,
                    octave,
                    layer: final_layer,
                });
            }
        }
    }
}

/// The extremum of the quadratic through the neighbours, moving on where it lies nearer to another sample; contrast and
/// edge tests. Column, row and layer as fractions, response, nearest layer.
fn locate(
    d: &[GrayImage],
    mut layer: usize,
    mut x: usize,
    mut y: usize,
    options: &FeatureOptions,
) -> Option<(f32, f32, f32, f32, usize)> {
    let (w, h) = (d[0].width(), d[0].height());
    for _ in 0..5 {
        let at =
            |l: usize, dx: isize, dy: isize| f64::from(d[l].get(x.wrapping_add_signed(dx), y.wrapping_add_signed(dy)));
        let (below, here, above) = (layer - 1, layer, layer + 1);
        let v = at(here, 0, 0);
        let gx = 0.5 * (at(here, 1, 0) - at(here, -1, 0));
        let gy = 0.5 * (at(here, 0, 1) - at(here, 0, -1));
        let gs = 0.5 * (at(above, 0, 0) - at(below, 0, 0));
        let xx = at(here, 1, 0) + at(here, -1, 0) - 2.0 * v;
        let yy = at(here, 0, 1) + at(here, 0, -1) - 2.0 * v;
        let ss = at(above, 0, 0) + at(below, 0, 0) - 2.0 * v;
        let xy = 0.25 * (at(here, 1, 1) - at(here, -1, 1) - at(here, 1, -1) + at(here, -1, -1));
        let xs = 0.25 * (at(above, 1, 0) - at(above, -1, 0) - at(below, 1, 0) + at(below, -1, 0));
        let ys = 0.25 * (at(above, 0, 1) - at(above, 0, -1) - at(below, 0, 1) + at(below, 0, -1));
        let hessian = nalgebra::Matrix3::new(xx, xy, xs, xy, yy, ys, xs, ys, ss);
        let offset = -(hessian.try_inverse()? * nalgebra::Vector3::new(gx, gy, gs));
        if offset.amax() < 0.5 {
            let response = v + 0.5 * (gx * offset.x + gy * offset.y + gs * offset.z);
            if response.abs() * (LAYERS as f64) < options.contrast_threshold {
                return None;
            }
            let (trace, determinant) = (xx + yy, xx * yy - xy * xy);
            let r = options.edge_ratio;
            if determinant <= 0.0 || trace * trace * r >= (r + 1.0) * (r + 1.0) * determinant {
                return None;
            }
            let fraction = |base: usize, o: f64| (base as f64 + o) as f32;
            return Some((
                fraction(x, offset.x),
                fraction(y, offset.y),
                fraction(layer, offset.z),
                response.abs() as f32,
                layer,
            ));
        }
        if offset.amax().is_nan() || offset.amax() > 1e3 {
            return None;
        }
        let moved = |base: usize, o: f64, low: usize, high: usize| {
            let next = base as f64 + o.round();
            (next >= low as f64 && next <= high as f64).then_some(next as usize)
        };
        x = moved(x, offset.x, BORDER, w - 1 - BORDER)?;
        y = moved(y, offset.y, BORDER, h - 1 - BORDER)?;
        layer = moved(layer, offset.z, 1, LAYERS)?;
    }
    None
}

fn subtract(a: &GrayImage, b: &GrayImage) -> GrayImage {
    GrayImage::from_fn_of(a, b, |x, y| x - y)
}

/// Twice the size by linear interpolation; pixel i of the image is pixel 2 i of the result.
fn upsample(image: &GrayImage) -> GrayImage {
    let (w, h) = (image.width(), image.height());
    let size = ImageSize::new(2 * w, 2 * h);
    let mut out = GrayImage::filled(size, 0.0);
    let rows = out.data_mut();
    for y in 0..h {
        let from = image.row(y);
        let to = &mut rows[2 * y * 2 * w..(2 * y + 1) * 2 * w];
        for x in 0..w {
            to[2 * x] = from[x];
            to[2 * x + 1] = 0.5 * (from[x] + from[(x + 1).min(w - 1)]);
        }
    }
    for y in 0..h {
        let (done, rest) = rows.split_at_mut((2 * y + 1) * 2 * w);
        let above = &done[2 * y * 2 * w..];
        let (middle, after) = rest.split_at_mut(2 * w);
        let below = if y + 1 < h { &after[..2 * w] } else { above };
        for ((m, a), b) in middle.iter_mut().zip(above).zip(below) {
            *m = 0.5 * (a + b);
        }
    }
    out
}

/// Every second pixel: pixel i of the result is pixel 2 i.
fn halve(image: &GrayImage) -> GrayImage {
    let size = ImageSize::new(image.width().div_ceil(2), image.height().div_ceil(2));
    let mut out = GrayImage::filled(size, 0.0);
    for (y, row) in out.data_mut().chunks_exact_mut(size.width).enumerate() {
        let from = image.row(2 * y);
        for (x, o) in row.iter_mut().enumerate() {
            *o = from[2 * x];
        }
    }
    out
}

/// Columns summed up at once: their sums stay in registers.
const LANES: usize = 16;

/// Weighted sum of symmetric neighbours for the `LANES` (or, at the end of a row, fewer) values from column `x` on.
/// `at(i)` gives the two rows (or the row, shifted) `i` steps to either side.
#[inline(always)]
fn symmetric_sum<'a>(out: &mut [f32], weights: &[f32], at: impl Fn(usize) -> (&'a [f32], &'a [f32])) {
    let width = out.len();
    let whole = width - width % LANES;
    for x in (0..whole).step_by(LANES) {
        let mut sums = [0.0f32; LANES];
        let centre = &at(0).0[x..x + LANES];
        for (s, v) in sums.iter_mut().zip(centre) {
            *s = weights[0] * v;
        }
        for (i, weight) in weights.iter().enumerate().skip(1) {
            let (before, after) = at(i);
            let (before, after) = (&before[x..x + LANES], &after[x..x + LANES]);
            for ((s, b), a) in sums.iter_mut().zip(before).zip(after) {
                *s += weight * (b + a);
            }
        }
        out[x..x + LANES].copy_from_slice(&sums);
    }
    for x in whole..width {
        let mut sum = weights[0] * at(0).0[x];
        for (i, weight) in weights.iter().enumerate().skip(1) {
            let (before, after) = at(i);
            sum += weight * (before[x] + after[x]);
        }
        out[x] = sum;
    }
}

/// Gaussian blur, borders repeated; the kernel reaches to three and a half standard deviations.
pub(crate) fn blur(image: &GrayImage, sigma: f64) -> GrayImage {
    let radius = (3.5 * sigma).ceil().max(1.0) as usize;
    let weights: Vec<f64> = (0..=radius).map(|i| (-0.5 * (i as f64 / sigma).powi(2)).exp()).collect();
    let total = weights[0] + 2.0 * weights[1..].iter().sum::<f64>();
    let weights: Vec<f32> = weights.iter().map(|w| (w / total) as f32).collect();

    let (w, h) = (image.width(), image.height());
    let mut across = GrayImage::filled(image.size(), 0.0);
    let mut padded = vec![0.0f32; w + 2 * radius];
    for (y, out) in across.data_mut().chunks_exact_mut(w).enumerate() {
        let row = image.row(y);
        padded[..radius].fill(row[0]);
        padded[radius..radius + w].copy_from_slice(row);
        padded[radius + w..].fill(row[w - 1]);
        symmetric_sum(out, &weights, |i| (&padded[radius - i..radius - i + w], &padded[radius + i..radius + i + w]));
    }
    let mut down = GrayImage::filled(image.size(), 0.0);
    for (y, out) in down.data_mut().chunks_exact_mut(w).enumerate() {
        symmetric_sum(out, &weights, |i| (across.row(y.saturating_sub(i)), across.row((y + i).min(h - 1))));
    }
    down
}
