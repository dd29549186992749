//! Gaussian scale space and the extrema of its differences.

use multiversion::multiversion;

use crate::{
    error::Error,
    geometry::size::ImageSize,
    observer::Observer,
    vision::{features::feature::FeatureOptions, image::GrayImage},
};

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
    pub(super) fn new(image: &GrayImage, options: &FeatureOptions, observer: &dyn Observer) -> Result<Self, Error> {
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
                observer.go_on()?;
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
                observer.go_on()?;
                let before = BASE_SIGMA * step.powi(layer as i32 - 1);
                let next = blur(&gaussians[layer - 1], before * (step * step - 1.0).sqrt());
                gaussians.push(next);
            }
            first = halve(&gaussians[LAYERS]);
            octaves.push(Octave { gaussians, pixel_px });
            pixel_px *= 2.0;
        }
        Ok(Self { octaves })
    }

    pub(super) fn extrema(&self, options: &FeatureOptions, observer: &dyn Observer) -> Result<Vec<Extremum>, Error> {
        let mut found = Vec::new();
        for (index, octave) in self.octaves.iter().enumerate() {
            extrema_of_octave(octave, index, options, observer, &mut found)?;
        }
        Ok(found)
    }
}

/// A row of a difference of Gaussians, and the highest and lowest values of it and the rows above and below.
struct DifferenceRows {
    /// Three rows in turn: row y is entry y mod 3.
    rows: [Vec<f32>; 3],
    high: Vec<f32>,
    low: Vec<f32>,
}

impl DifferenceRows {
    fn new(w: usize) -> Self {
        let row = || vec![0.0f32; w];
        Self { rows: [row(), row(), row()], high: row(), low: row() }
    }

    #[inline(always)]
    fn subtract(&mut self, upper: &[f32], lower: &[f32], y: usize) {
        for ((d, u), l) in self.rows[y % 3].iter_mut().zip(upper).zip(lower) {
            *d = u - l;
        }
    }

    #[inline(always)]
    fn take_extremes(&mut self) {
        let [a, b, c] = &self.rows;
        for (high, ((a, b), c)) in self.high.iter_mut().zip(a.iter().zip(b).zip(c)) {
            *high = larger(larger(*a, *b), *c);
        }
        for (low, ((a, b), c)) in self.low.iter_mut().zip(a.iter().zip(b).zip(c)) {
            *low = smaller(smaller(*a, *b), *c);
        }
    }
}

// Plain comparisons, which become one instruction; `f32::max` must look after NaN.
#[inline(always)]
fn larger(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

#[inline(always)]
fn smaller(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

/// Samples of an octave's differences that are not exceeded by their 26 neighbours. The differences are taken row by row and
/// not kept.
#[multiversion(targets("x86_64+avx2"))]
fn extrema_of_octave(
    octave: &Octave,
    index: usize,
    options: &FeatureOptions,
    observer: &dyn Observer,
    found: &mut Vec<Extremum>,
) -> Result<(), Error> {
    let threshold = (0.5 * options.contrast_threshold / LAYERS as f64) as f32;
    let g = &octave.gaussians;
    let (w, h) = (g[0].width(), g[0].height());
    let mut differences: Vec<DifferenceRows> = (0..LAYERS + 2).map(|_| DifferenceRows::new(w)).collect();
    let (mut high, mut low) = (vec![0.0f32; w], vec![0.0f32; w]);
    let mut is_extremum = vec![false; w];
    let mut layers: [Vec<Extremum>; LAYERS] = [const { Vec::new() }; LAYERS];
    for y in BORDER - 1..h - BORDER + 1 {
        observer.go_on()?;
        for (layer, difference) in differences.iter_mut().enumerate() {
            difference.subtract(g[layer + 1].row(y), g[layer].row(y), y);
            if y > BORDER {
                difference.take_extremes();
            }
        }
        if y <= BORDER {
            continue;
        }
        // All around the row before is there now.
        let y = y - 1;
        for layer in 1..=LAYERS {
            let [before, here, after] = [&differences[layer - 1], &differences[layer], &differences[layer + 1]];
            for (high, ((a, b), c)) in high.iter_mut().zip(before.high.iter().zip(&here.high).zip(&after.high)) {
                *high = larger(larger(*a, *b), *c);
            }
            for (low, ((a, b), c)) in low.iter_mut().zip(before.low.iter().zip(&here.low).zip(&after.low)) {
                *low = smaller(smaller(*a, *b), *c);
            }
            let row = &here.rows[y % 3][BORDER..w - BORDER];
            let n = row.len();
            let (h0, h1, h2) = (&high[BORDER - 1..][..n], &high[BORDER..][..n], &high[BORDER + 1..][..n]);
            let (l0, l1, l2) = (&low[BORDER - 1..][..n], &low[BORDER..][..n], &low[BORDER + 1..][..n]);
            let flags = &mut is_extremum[..n];
            for i in 0..n {
                let v = row[i];
                let top = (v > threshold) & (v >= h0[i]) & (v >= h1[i]) & (v >= h2[i]);
                let bottom = (v < -threshold) & (v <= l0[i]) & (v <= l1[i]) & (v <= l2[i]);
                flags[i] = top | bottom;
            }
            for x in (0..n).filter(|&i| flags[i]).map(|i| i + BORDER) {
                if let Some((fx, fy, fs, response, final_layer)) = locate(g, layer, x, y, options) {
                    layers[layer - 1].push(Extremum {
                        x: fx * octave.pixel_px,
                        y: fy * octave.pixel_px,
                        scale: (BASE_SIGMA as f32) * 2f32.powf(fs / LAYERS as f32) * octave.pixel_px,
                        response,
                        octave: index,
                        layer: final_layer,
                    });
                }
            }
        }
    }
    for layer in &mut layers {
        found.append(layer);
    }
    Ok(())
}

/// The extremum of the quadratic through the neighbours, moving on where it lies nearer to another sample; contrast and
/// edge tests. Column, row and layer as fractions, response, nearest layer.
fn locate(
    g: &[GrayImage],
    mut layer: usize,
    mut x: usize,
    mut y: usize,
    options: &FeatureOptions,
) -> Option<(f32, f32, f32, f32, usize)> {
    let (w, h) = (g[0].width(), g[0].height());
    for _ in 0..5 {
        let at = |l: usize, dx: isize, dy: isize| {
            let (x, y) = (x.wrapping_add_signed(dx), y.wrapping_add_signed(dy));
            f64::from(g[l + 1].get(x, y) - g[l].get(x, y))
        };
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
pub(crate) fn halve(image: &GrayImage) -> GrayImage {
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
const LANES: usize = 32;

/// Weighted sum of symmetric neighbours. `pairs[i]` are the two rows (or the row, shifted) `i` steps to either side, as long as `out`.
#[inline(always)]
fn symmetric_sum(out: &mut [f32], weights: &[f32], pairs: &[[&[f32]; 2]]) {
    let width = out.len();
    let whole = width - width % LANES;
    let (blocks, rest) = out.split_at_mut(whole);
    for (block, out) in blocks.as_chunks_mut::<LANES>().0.iter_mut().enumerate() {
        let x = block * LANES;
        let mut sums = [0.0f32; LANES];
        for (i, ([before, after], weight)) in pairs.iter().zip(weights).enumerate() {
            let (before, after) = (&before[x..x + LANES], &after[x..x + LANES]);
            if i == 0 {
                sums.iter_mut().zip(before).for_each(|(s, v)| *s = weight * v);
            } else {
                sums.iter_mut().zip(before.iter().zip(after)).for_each(|(s, (b, a))| *s += weight * (b + a));
            }
        }
        *out = sums;
    }
    for (x, out) in (whole..width).zip(rest) {
        let pairs = pairs.iter().zip(weights).enumerate();
        *out = pairs.fold(0.0, |sum, (i, ([b, a], weight))| sum + weight * if i == 0 { b[x] } else { b[x] + a[x] });
    }
}

/// Gaussian blur, borders repeated; the kernel reaches to three and a half standard deviations.
#[multiversion(targets("x86_64+avx2"))]
pub(crate) fn blur(image: &GrayImage, sigma: f64) -> GrayImage {
    let radius = (3.5 * sigma).ceil().max(1.0) as usize;
    let weights: Vec<f64> = (0..=radius).map(|i| (-0.5 * (i as f64 / sigma).powi(2)).exp()).collect();
    let total = weights[0] + 2.0 * weights[1..].iter().sum::<f64>();
    let weights: Vec<f32> = weights.iter().map(|w| (w / total) as f32).collect();

    let (w, h) = (image.width(), image.height());
    let mut padded = vec![0.0f32; w + 2 * radius];
    // Rows blurred along themselves, as many as one row of the result takes, in turn: they stay in the cache.
    let kept = 2 * radius + 1;
    let mut across = vec![0.0f32; kept * w];
    let place = |y: usize| y % kept * w..(y % kept + 1) * w;
    let mut down = vec![0.0f32; w * h];
    let mut done = 0;
    for (y, out) in down.chunks_exact_mut(w).enumerate() {
        while done < (y + radius + 1).min(h) {
            let row = image.row(done);
            padded[..radius].fill(row[0]);
            padded[radius..radius + w].copy_from_slice(row);
            padded[radius + w..].fill(row[w - 1]);
            let shifted: Vec<[&[f32]; 2]> =
                (0..=radius).map(|i| [&padded[radius - i..][..w], &padded[radius + i..][..w]]).collect();
            symmetric_sum(&mut across[place(done)], &weights, &shifted);
            done += 1;
        }
        let rows: Vec<[&[f32]; 2]> =
            (0..=radius).map(|i| [&across[place(y.saturating_sub(i))], &across[place((y + i).min(h - 1))]]).collect();
        symmetric_sum(out, &weights, &rows);
    }
    GrayImage::from_parts(image.size(), down)
}
