//! Directions and gradient histograms of extrema.

use multiversion::multiversion;

use crate::vision::features::{
    feature::{DESCRIPTOR_LENGTH, Feature, Features},
    scale_space::{Extremum, ScaleSpace},
};
use crate::vision::image::GrayImage;

/// Bins of the direction histogram.
const DIRECTIONS: usize = 36;
/// A direction is kept from this fraction of the strongest on.
const PEAK_RATIO: f32 = 0.8;
/// Cells along a side of the descriptor, and directions in each.
const CELLS: usize = 4;
const BINS: usize = 8;
/// Side of a cell in units of the feature's scale.
const CELL_SIDE: f32 = 3.0;
/// Half the side of all cells together, in units of the feature's scale.
pub(super) const HALF_WIDTH: f32 = 0.5 * CELLS as f32 * CELL_SIDE;
/// Largest value of an entry before the second normalisation: one strong edge should not decide alone.
const CLIP: f32 = 0.2;

const TAU: f32 = std::f32::consts::TAU;

/// atan2 in 0..2π to 1e-4 rad, which is a thousandth of a histogram bin.
#[inline(always)]
fn direction(y: f32, x: f32) -> f32 {
    let (ax, ay) = (x.abs(), y.abs());
    let (small, large) = if ax < ay { (ax, ay) } else { (ay, ax) };
    let t = small / (large + f32::MIN_POSITIVE);
    let s = t * t;
    // Minimax-like odd polynomial for atan on 0..1 (Abramowitz & Stegun 4.4.49).
    let mut a = t * (0.999_866 + s * (-0.330_299_5 + s * (0.180_141 + s * (-0.085_133 + s * 0.020_835_1))));
    if ay > ax {
        a = std::f32::consts::FRAC_PI_2 - a;
    }
    if x < 0.0 {
        a = std::f32::consts::PI - a;
    }
    if y < 0.0 { TAU - a } else { a }
}

/// Appends the feature once for each of its dominant directions.
pub(super) fn describe(space: &ScaleSpace, extremum: &Extremum, out: &mut Features) {
    let octave = &space.octaves[extremum.octave];
    let image = &octave.gaussians[extremum.layer];
    let (x, y) = (extremum.x / octave.pixel_px, extremum.y / octave.pixel_px);
    let scale = extremum.scale / octave.pixel_px;
    for angle_rad in directions(image, x, y, scale) {
        if let Some(descriptor) = histogram(image, x, y, scale, angle_rad) {
            out.points.push(Feature {
                x: extremum.x,
                y: extremum.y,
                scale_px: extremum.scale,
                angle_rad,
                response: extremum.response,
            });
            out.descriptors.extend_from_slice(&descriptor);
        }
    }
}

/// A square window of the image around a feature, clipped so that every pixel has four neighbours.
struct Window {
    x: std::ops::Range<usize>,
    y: std::ops::Range<usize>,
    /// exp(-d² / 2σ²) for each column and each row, d from the feature; their product is the Gaussian weight.
    weight_x: Vec<f32>,
    weight_y: Vec<f32>,
    magnitude: Vec<f32>,
    angle: Vec<f32>,
}

impl Window {
    fn new(image: &GrayImage, x: f32, y: f32, radius: f32, sigma: f32) -> Self {
        let side = |centre: f32, length: usize| {
            let low = (centre - radius).round().max(1.0) as usize;
            let high = (centre + radius).round().min(length as f32 - 2.0);
            low..if high >= low as f32 { high as usize + 1 } else { low }
        };
        let (columns, rows) = (side(x, image.width()), side(y, image.height()));
        let falloff = -1.0 / (2.0 * sigma * sigma);
        let weights = |range: &std::ops::Range<usize>, centre: f32| -> Vec<f32> {
            range.clone().map(|i| ((i as f32 - centre).powi(2) * falloff).exp()).collect()
        };
        Self {
            weight_x: weights(&columns, x),
            weight_y: weights(&rows, y),
            magnitude: vec![0.0; columns.len()],
            angle: vec![0.0; columns.len()],
            x: columns,
            y: rows,
        }
    }

    /// Weighted gradient magnitudes and directions of the columns `from..to` (counted in the window) of a row, by central
    /// differences; they come first.
    #[inline(always)]
    fn fill(&mut self, image: &GrayImage, y: usize, from: usize, to: usize) {
        let (x, n) = (self.x.start + from, to - from);
        let row = image.row(y);
        let (left, right) = (&row[x - 1..x - 1 + n], &row[x + 1..x + 1 + n]);
        let (above, below) = (&image.row(y - 1)[x..x + n], &image.row(y + 1)[x..x + n]);
        let weight_y = self.weight_y[y - self.y.start];
        let out = self.magnitude[..n].iter_mut().zip(&mut self.angle[..n]).zip(&self.weight_x[from..to]);
        for (i, ((magnitude, angle), weight_x)) in out.enumerate() {
            let (gx, gy) = (right[i] - left[i], below[i] - above[i]);
            *magnitude = (gx * gx + gy * gy).sqrt() * (weight_x * weight_y);
            *angle = direction(gy, gx);
        }
    }
}

#[multiversion(targets("x86_64+avx2"))]
fn directions(image: &GrayImage, x: f32, y: f32, scale: f32) -> Vec<f32> {
    let sigma = 1.5 * scale;
    let mut window = Window::new(image, x, y, 3.0 * sigma, sigma);
    let mut histogram = [0.0f32; DIRECTIONS];
    for py in window.y.clone() {
        window.fill(image, py, 0, window.x.len());
        for (weight, angle) in window.magnitude.iter().zip(&window.angle) {
            // Shared between the two nearest bins.
            let position = angle * (DIRECTIONS as f32 / TAU);
            let low = position as usize;
            let fraction = position - low as f32;
            histogram[low % DIRECTIONS] += weight * (1.0 - fraction);
            histogram[(low + 1) % DIRECTIONS] += weight * fraction;
        }
    }
    // Binomial smoothing, twice.
    for _ in 0..2 {
        let h = histogram;
        for i in 0..DIRECTIONS {
            histogram[i] = 0.25 * h[(i + DIRECTIONS - 1) % DIRECTIONS] + 0.5 * h[i] + 0.25 * h[(i + 1) % DIRECTIONS];
        }
    }
    let highest = histogram.iter().copied().fold(0.0, f32::max);
    if highest <= 0.0 {
        return Vec::new();
    }
    let mut peaks = Vec::new();
    for i in 0..DIRECTIONS {
        let (before, here, after) =
            (histogram[(i + DIRECTIONS - 1) % DIRECTIONS], histogram[i], histogram[(i + 1) % DIRECTIONS]);
        if here >= PEAK_RATIO * highest && here > before && here >= after {
            let curvature = before - 2.0 * here + after;
            let offset = if curvature < 0.0 { 0.5 * (before - after) / curvature } else { 0.0 };
            peaks.push(((i as f32 + offset) * (TAU / DIRECTIONS as f32)).rem_euclid(TAU));
        }
    }
    peaks
}

#[multiversion(targets("x86_64+avx2"))]
fn histogram(image: &GrayImage, x: f32, y: f32, scale: f32, angle: f32) -> Option<[f32; DESCRIPTOR_LENGTH]> {
    let side = CELL_SIDE * scale;
    let radius = side * std::f32::consts::SQRT_2 * (CELLS as f32 + 1.0) * 0.5;
    // The Gaussian over the cells has half the descriptor's width as its deviation.
    let mut window = Window::new(image, x, y, radius, 0.5 * CELLS as f32 * side);
    let (sin, cos) = (angle.sin() / side, angle.cos() / side);
    // A margin of one cell takes what falls outside.
    const WIDE: usize = CELLS + 2;
    let mut cells = [0.0f32; WIDE * WIDE * BINS];
    let middle = CELLS as f32 * 0.5 + 0.5;
    // Gradients at a blur of two pixels change little from row to row: every second tells as much. (Of 20,000 inliers of 142 pairs 0.3 % fewer.)
    for py in window.y.clone().step_by(2) {
        let dy = py as f32 - y;
        // The columns where the turned square meets this row, and one more on either side; `max` and `min` pass over the NaN
        // of a square that is not turned.
        let along = |across: f32, slope: f32| {
            let (p, q) = ((-middle - across) / slope, (middle - across) / slope);
            if p < q { (p, q) } else { (q, p) }
        };
        let ((low, high), (low_too, high_too)) = (along(sin * dy, cos), along(cos * dy, -sin));
        let from = (x + low.max(low_too) - 1.0).max(window.x.start as f32);
        let to = (x + high.min(high_too) + 2.0).min(window.x.end as f32);
        if from.is_nan() || to.is_nan() || from >= to {
            continue;
        }
        let (from, to) = (from as usize, to as usize);
        window.fill(image, py, from - window.x.start, to - window.x.start);
        for (i, px) in (from..to).enumerate() {
            let dx = px as f32 - x;
            let (column, row) = (cos * dx + sin * dy + middle, cos * dy - sin * dx + middle);
            if column <= 0.0 || row <= 0.0 || column >= (WIDE - 1) as f32 || row >= (WIDE - 1) as f32 {
                continue;
            }
            let mut turn = window.angle[i] - angle;
            if turn < 0.0 {
                turn += TAU;
            }
            let bin = turn * (BINS as f32 / TAU);
            let (c0, r0, b0) = (column as usize, row as usize, bin as usize);
            let (fc, fr, fb) = (column - c0 as f32, row - r0 as f32, bin - b0 as f32);
            let (b0, b1) = (b0 % BINS, (b0 + 1) % BINS);
            for (r, wr) in [(r0, 1.0 - fr), (r0 + 1, fr)] {
                let in_row = window.magnitude[i] * wr;
                for (c, wc) in [(c0, 1.0 - fc), (c0 + 1, fc)] {
                    let cell = &mut cells[(r * WIDE + c) * BINS..][..BINS];
                    let value = in_row * wc;
                    cell[b0] += value * (1.0 - fb);
                    cell[b1] += value * fb;
                }
            }
        }
    }
    let mut out = [0.0f32; DESCRIPTOR_LENGTH];
    for r in 0..CELLS {
        for c in 0..CELLS {
            let from = ((r + 1) * WIDE + c + 1) * BINS;
            out[(r * CELLS + c) * BINS..][..BINS].copy_from_slice(&cells[from..from + BINS]);
        }
    }
    let norm = out.iter().map(|v| v * v).sum::<f32>().sqrt();
    if norm.is_nan() || norm <= f32::MIN_POSITIVE {
        return None;
    }
    let limit = CLIP * norm;
    for v in &mut out {
        *v = v.min(limit);
    }
    // RootSIFT: unit L1 norm, then the square root, which has unit L2 norm.
    let sum: f32 = out.iter().sum();
    for v in &mut out {
        *v = (*v / sum).sqrt();
    }
    Some(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn direction_agrees_with_atan2() {
        for i in 0..3600 {
            let a = (i as f32 + 0.5) * TAU / 3600.0;
            let found = direction(3.0 * a.sin(), 3.0 * a.cos());
            assert!((found - a).abs() < 1e-4, "{a} {found}");
        }
        assert!(direction(0.0, 0.0).is_finite());
    }
}
