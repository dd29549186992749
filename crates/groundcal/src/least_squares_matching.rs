//! Patches of the plane, matched again to a few hundredths of a pixel (least squares matching, Förstner 1982, Gruen 1985).
//!
//! Once a map f from image a to image b is known roughly, a patch around p is sought in b by
//!
//! ```text
//! minimise over s, g, c:   Σ_o w_o ( A(p + o) - g B(f(p + o) + s) - c )²
//! ```
//!
//! with shift s in pixels of b, gain g, bias c. B is interpolated by cubic B-splines; p is a pixel of a, so the template is
//! not interpolated at all. Gauss-Newton with the template's gradient, carried to b by the inverse of f's Jacobian (it does
//! not change from step to step, and its noise is uncorrelated with the sum it is multiplied with at the solution). The
//! inverse of the normal matrix times the residual variance is the covariance of s.

use nalgebra::{Matrix2, Matrix4, Vector2, Vector4};
use rayon::prelude::*;

use crate::{
    correspondence::PointMatch,
    image::{GrayImage, ImageSize},
};

/// Options of [`match_patches`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PatchOptions {
    /// Half the side of a patch in pixels: a patch has (2 r + 1)² pixels.
    pub radius_px: usize,
    /// Most patches of a pair of images, on a grid over what both see.
    pub max_patches: usize,
    /// Most Gauss-Newton steps.
    pub max_iterations: usize,
    /// Largest shift from the predicted place, in pixels.
    pub max_shift_px: f64,
    /// Largest predicted standard deviation of either coordinate, in pixels: less texture than that is left out.
    pub max_sigma_px: f64,
    /// Least correlation coefficient of template and matched patch.
    pub min_correlation: f64,
    /// Deviation added to the predicted one (interpolation, aliasing, a floor that is not quite flat), in pixels.
    pub model_sigma_px: f64,
}

impl Default for PatchOptions {
    fn default() -> Self {
        Self {
            radius_px: 10,
            max_patches: 1000,
            max_iterations: 8,
            max_shift_px: 2.5,
            max_sigma_px: 0.2,
            min_correlation: 0.6,
            model_sigma_px: 0.02,
        }
    }
}

/// An image as cubic B-spline coefficients (Unser 1999): interpolates every pixel exactly, with smooth derivatives.
#[derive(Debug, Clone)]
pub struct SplineImage {
    size: ImageSize,
    coefficients: Vec<f32>,
}

/// Pole of the cubic B-spline's inverse filter: √3 - 2.
const POLE: f32 = -0.267_949_2;
/// Terms after which powers of the pole are below single precision.
const HORIZON: usize = 14;

impl SplineImage {
    /// The spline through an image's pixels (borders mirrored).
    pub fn new(image: &GrayImage) -> Self {
        let (w, h) = (image.width(), image.height());
        let mut c = image.data().to_vec();
        for row in c.chunks_exact_mut(w) {
            filter_line(row);
        }
        // Columns: the same recursion with whole rows as values.
        filter_rows(&mut c, w, h);
        Self { size: image.size(), coefficients: c }
    }

    /// Width and height of the image.
    pub fn size(&self) -> ImageSize {
        self.size
    }

    /// Value at a point at least two pixels inside the image.
    #[inline]
    fn value(&self, x: f32, y: f32) -> f32 {
        let (ix, iy) = (x as usize, y as usize);
        let (wx, wy) = (weights(x - ix as f32), weights(y - iy as f32));
        let start = (iy - 1) * self.size.width + ix - 1;
        let mut sum = 0.0;
        for (r, weight) in wy.iter().enumerate() {
            let c = &self.coefficients[start + r * self.size.width..][..4];
            sum += weight * (wx[0] * c[0] + wx[1] * c[1] + wx[2] * c[2] + wx[3] * c[3]);
        }
        sum
    }

    /// Gradient at a pixel at least one pixel inside the image.
    #[inline]
    fn gradient(&self, x: usize, y: usize) -> (f32, f32) {
        let w = self.size.width;
        let at = |dx: usize, dy: usize| self.coefficients[(y + dy - 1) * w + x + dx - 1];
        // Derivative (-1, 0, 1) / 2 across, value (1, 4, 1) / 6 along.
        let gx = (at(2, 0) - at(0, 0)) + 4.0 * (at(2, 1) - at(0, 1)) + (at(2, 2) - at(0, 2));
        let gy = (at(0, 2) - at(0, 0)) + 4.0 * (at(1, 2) - at(1, 0)) + (at(2, 2) - at(2, 0));
        (gx / 12.0, gy / 12.0)
    }
}

/// Cubic B-spline weights of the four coefficients around a fraction.
#[inline]
fn weights(t: f32) -> [f32; 4] {
    let u = 1.0 - t;
    let (t2, u2) = (t * t, u * u);
    [u2 * u / 6.0, 2.0 / 3.0 - 0.5 * t2 * (2.0 - t), 2.0 / 3.0 - 0.5 * u2 * (2.0 - u), t2 * t / 6.0]
}

/// Coefficients of a line in place: causal and anticausal recursion with mirrored ends.
fn filter_line(line: &mut [f32]) {
    let n = line.len();
    if n < 2 {
        return;
    }
    let mut power = 1.0;
    let mut first = 0.0;
    for v in line.iter().take(HORIZON) {
        first += power * v;
        power *= POLE;
    }
    line[0] = first;
    for i in 1..n {
        line[i] += POLE * line[i - 1];
    }
    line[n - 1] = POLE / (POLE * POLE - 1.0) * (line[n - 1] + POLE * line[n - 2]);
    for i in (0..n - 1).rev() {
        line[i] = POLE * (line[i + 1] - line[i]);
    }
    for v in line {
        *v *= 6.0;
    }
}

/// [`filter_line`] down the columns, row by row.
fn filter_rows(c: &mut [f32], w: usize, h: usize) {
    if h < 2 {
        return;
    }
    let mut first = vec![0.0f32; w];
    let mut power = 1.0;
    for row in c.chunks_exact(w).take(HORIZON) {
        for (f, v) in first.iter_mut().zip(row) {
            *f += power * v;
        }
        power *= POLE;
    }
    c[..w].copy_from_slice(&first);
    for y in 1..h {
        let (done, rest) = c.split_at_mut(y * w);
        for (v, before) in rest[..w].iter_mut().zip(&done[(y - 1) * w..]) {
            *v += POLE * before;
        }
    }
    {
        let (done, last) = c.split_at_mut((h - 1) * w);
        for (v, before) in last.iter_mut().zip(&done[(h - 2) * w..]) {
            *v = POLE / (POLE * POLE - 1.0) * (*v + POLE * before);
        }
    }
    for y in (0..h - 1).rev() {
        let (done, rest) = c.split_at_mut((y + 1) * w);
        for (v, after) in done[y * w..].iter_mut().zip(&rest[..w]) {
            *v = POLE * (after - *v);
        }
    }
    for v in c {
        *v *= 6.0;
    }
}

/// A patch found again.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PatchMatch {
    /// Centre in image a, pixels.
    pub a: Vector2<f64>,
    /// Where it is in image b, pixels.
    pub b: Vector2<f64>,
    /// Covariance of that place, pixels squared.
    pub covariance: Matrix2<f64>,
    /// Jacobian of the map from a to b there.
    pub jacobian: Matrix2<f64>,
    /// Correlation coefficient of the template and the matched patch.
    pub correlation: f64,
    /// Brightness of a over that of b.
    pub gain: f64,
    /// Gauss-Newton steps.
    pub iterations: usize,
}

impl PatchMatch {
    /// As a point match: the shift's covariance shared out between both images, whose errors the homography's model takes to
    /// be equal: tr C = σ² tr(I + J Jᵀ).
    pub fn to_point_match(&self, model_sigma_px: f64) -> PointMatch {
        let spread = (Matrix2::identity() + self.jacobian * self.jacobian.transpose()).trace();
        let variance = self.covariance.trace() / spread + model_sigma_px * model_sigma_px;
        PointMatch { a: self.a, b: self.b, sigma_px: variance.sqrt() }
    }
}

/// Matches patches on a grid over what both images see, given a map from pixels of a to pixels of b good to a pixel or two.
/// In the order of the grid; the same whatever the number of threads.
pub fn match_patches(
    a: &SplineImage,
    image_a: &GrayImage,
    b: &SplineImage,
    map: &(dyn Fn(&Vector2<f64>) -> Option<Vector2<f64>> + Sync),
    options: &PatchOptions,
) -> Vec<PatchMatch> {
    let (w, h) = (a.size.width, a.size.height);
    let margin = options.radius_px + 2;
    if w < 2 * margin + 1 || h < 2 * margin + 1 {
        return Vec::new();
    }
    let inside_b = |q: &Vector2<f64>| {
        let m = margin as f64;
        q.x > m && q.y > m && q.x < b.size.width as f64 - 1.0 - m && q.y < b.size.height as f64 - 1.0 - m
    };
    let seen = |x: usize, y: usize| map(&Vector2::new(x as f64, y as f64)).is_some_and(|q| inside_b(&q));
    // The share of a that b sees, on a coarse raster, sets the spacing.
    const RASTER: usize = 32;
    let steps = |n: usize| (0..RASTER).map(move |i| margin + i * (n - 2 * margin) / RASTER);
    let overlap = steps(w).flat_map(|x| steps(h).map(move |y| (x, y))).filter(|&(x, y)| seen(x, y)).count() as f64
        / (RASTER * RASTER) as f64;
    let area = overlap * ((w - 2 * margin) * (h - 2 * margin)) as f64;
    let spacing = (area / options.max_patches as f64).sqrt().ceil().max((2 * options.radius_px + 1) as f64) as usize;
    let cells: Vec<(usize, usize)> = (margin..h - margin)
        .step_by(spacing)
        .flat_map(|y| (margin..w - margin).step_by(spacing).map(move |x| (x, y)))
        .collect();
    cells
        .par_iter()
        .filter_map(|&(x0, y0)| {
            // The best textured of a few places of the cell.
            let slack = spacing.saturating_sub(1) / 2;
            let places = [(0, 0), (slack, 0), (0, slack), (slack, slack)];
            let (x, y) = places
                .iter()
                .map(|(dx, dy)| ((x0 + dx).min(w - 1 - margin), (y0 + dy).min(h - 1 - margin)))
                .filter(|&(x, y)| seen(x, y))
                .map(|(x, y)| (texture(a, x, y, options.radius_px), (x, y)))
                .max_by(|p, q| p.0.total_cmp(&q.0).then(q.1.cmp(&p.1)))?
                .1;
            match_patch(a, image_a, b, (x, y), map, options)
        })
        .collect()
}

/// Smaller eigenvalue of the sum of gradient products over every second pixel of a patch.
fn texture(a: &SplineImage, x: usize, y: usize, radius: usize) -> f32 {
    let (mut xx, mut xy, mut yy) = (0.0f32, 0.0f32, 0.0f32);
    for py in (y - radius..=y + radius).step_by(2) {
        for px in (x - radius..=x + radius).step_by(2) {
            let (gx, gy) = a.gradient(px, py);
            xx += gx * gx;
            xy += gx * gy;
            yy += gy * gy;
        }
    }
    0.5 * (xx + yy) - (0.25 * (xx - yy) * (xx - yy) + xy * xy).sqrt()
}

/// The quadratic through the map at a patch's centre, edges and corners.
struct LocalMap {
    at: Vector2<f64>,
    x: Vector2<f64>,
    y: Vector2<f64>,
    xx: Vector2<f64>,
    xy: Vector2<f64>,
    yy: Vector2<f64>,
}

impl LocalMap {
    fn new(
        map: &(dyn Fn(&Vector2<f64>) -> Option<Vector2<f64>> + Sync),
        centre: Vector2<f64>,
        radius: f64,
    ) -> Option<Self> {
        let f = |dx: f64, dy: f64| map(&(centre + Vector2::new(dx, dy) * radius));
        let at = f(0.0, 0.0)?;
        let (right, left, below, above) = (f(1.0, 0.0)?, f(-1.0, 0.0)?, f(0.0, 1.0)?, f(0.0, -1.0)?);
        let corners = f(1.0, 1.0)? - f(-1.0, 1.0)? - f(1.0, -1.0)? + f(-1.0, -1.0)?;
        Some(Self {
            at,
            x: (right - left) / (2.0 * radius),
            y: (below - above) / (2.0 * radius),
            xx: (right + left - at * 2.0) / (2.0 * radius * radius),
            yy: (below + above - at * 2.0) / (2.0 * radius * radius),
            xy: corners / (4.0 * radius * radius),
        })
    }

    fn apply(&self, dx: f64, dy: f64) -> Vector2<f64> {
        self.at + (self.x + self.xx * dx + self.xy * dy) * dx + (self.y + self.yy * dy) * dy
    }
}

/// Residual, in robust deviations, from which on a pixel counts less.
const HUBER: f32 = 2.0;

/// Matches one patch; `None` where there is too little texture, the patch leaves b, or something else is seen there.
fn match_patch(
    a: &SplineImage,
    image_a: &GrayImage,
    b: &SplineImage,
    (x, y): (usize, usize),
    map: &(dyn Fn(&Vector2<f64>) -> Option<Vector2<f64>> + Sync),
    options: &PatchOptions,
) -> Option<PatchMatch> {
    let radius = options.radius_px as isize;
    let centre = Vector2::new(x as f64, y as f64);
    let local = LocalMap::new(map, centre, options.radius_px as f64)?;
    let jacobian = Matrix2::from_columns(&[local.x, local.y]);
    let size = jacobian.determinant();
    // Seen at less than half or more than twice the scale the patch is another picture.
    if !(0.2..5.0).contains(&size) {
        return None;
    }
    let to_b = jacobian.try_inverse()?.transpose().map(|v| v as f32);
    let side = 2 * options.radius_px + 1;
    let n = side * side;
    let (mut template, mut gx, mut gy, mut place) =
        (Vec::with_capacity(n), Vec::with_capacity(n), Vec::with_capacity(n), Vec::with_capacity(n));
    for dy in -radius..=radius {
        for dx in -radius..=radius {
            let (px, py) = (x.wrapping_add_signed(dx), y.wrapping_add_signed(dy));
            template.push(image_a.get(px, py));
            let (tx, ty) = a.gradient(px, py);
            gx.push(to_b[(0, 0)] * tx + to_b[(0, 1)] * ty);
            gy.push(to_b[(1, 0)] * tx + to_b[(1, 1)] * ty);
            let q = local.apply(dx as f64, dy as f64);
            place.push((q.x as f32, q.y as f32));
        }
    }
    // Where the whole patch may lie in b, whatever the shift.
    let reach = options.max_shift_px as f32 + 2.0;
    let (width, height) = (b.size.width as f32, b.size.height as f32);
    let fits =
        |&(qx, qy): &(f32, f32)| qx > reach && qy > reach && qx < width - 1.0 - reach && qy < height - 1.0 - reach;
    if !place.iter().all(fits) {
        return None;
    }
    let (mut sx, mut sy) = (0.0f32, 0.0f32);
    let (mut gain, mut bias) = (1.0f32, 0.0f32);
    let mut values = vec![0.0f32; n];
    let mut residuals = vec![0.0f32; n];
    let mut robust_sigma = f32::INFINITY;
    let mut result = None;
    for iteration in 1..=options.max_iterations {
        for (v, (qx, qy)) in values.iter_mut().zip(&place) {
            *v = b.value(qx + sx, qy + sy);
        }
        if iteration == 1 {
            // Brightness of the two patches as a start.
            let (ma, mb) = (mean(&template), mean(&values));
            let (va, vb) = (variance(&template, ma), variance(&values, mb));
            if va <= 0.0 || vb <= 0.0 {
                return None;
            }
            gain = (va / vb).sqrt();
            bias = ma - gain * mb;
        }
        for ((r, t), v) in residuals.iter_mut().zip(&template).zip(&values) {
            *r = t - gain * v - bias;
        }
        if iteration > 1 {
            let mut sizes: Vec<f32> = residuals.iter().map(|r| r.abs()).collect();
            let middle = n / 2;
            robust_sigma = 1.4826 * *sizes.select_nth_unstable_by(middle, f32::total_cmp).1;
        }
        let mut normal = [[0.0f32; 4]; 4];
        let mut right = [0.0f32; 4];
        let (mut weight_sum, mut square_sum) = (0.0f32, 0.0f32);
        let limit = HUBER * robust_sigma.max(1e-6);
        for i in 0..n {
            let r = residuals[i];
            let weight = if r.abs() <= limit { 1.0 } else { limit / r.abs() };
            let row = [gx[i], gy[i], values[i], 1.0];
            for p in 0..4 {
                let weighted = weight * row[p];
                right[p] += weighted * r;
                for q in p..4 {
                    normal[p][q] += weighted * row[q];
                }
            }
            weight_sum += weight;
            square_sum += weight * r * r;
        }
        let normal = Matrix4::from_fn(|p, q| f64::from(normal[p.min(q)][p.max(q)]));
        let right = Vector4::from_fn(|p, _| f64::from(right[p]));
        let inverse = normal.try_inverse()?;
        let step = inverse * right;
        sx += step[0] as f32;
        sy += step[1] as f32;
        gain += step[2] as f32;
        bias += step[3] as f32;
        if !(f64::from(sx.abs()) <= options.max_shift_px && f64::from(sy.abs()) <= options.max_shift_px) {
            return None;
        }
        let settled = step[0].hypot(step[1]) < 2e-3;
        if (settled && iteration > 2) || iteration == options.max_iterations {
            let ma = mean(&template);
            let total = variance(&template, ma) * n as f32;
            let explained = 1.0 - (square_sum * n as f32 / weight_sum) / total.max(f32::MIN_POSITIVE);
            let noise = f64::from(square_sum) / (f64::from(weight_sum) - 4.0).max(1.0);
            result = settled.then(|| PatchMatch {
                a: centre,
                b: local.at + Vector2::new(f64::from(sx), f64::from(sy)),
                covariance: inverse.fixed_view::<2, 2>(0, 0) * noise,
                jacobian,
                correlation: f64::from(explained.max(0.0).sqrt()),
                gain: f64::from(gain),
                iterations: iteration,
            });
            break;
        }
    }
    let found = result?;
    let sigma = found.covariance[(0, 0)].max(found.covariance[(1, 1)]).sqrt();
    let good = sigma <= options.max_sigma_px
        && found.correlation >= options.min_correlation
        && (0.3..3.0).contains(&found.gain);
    good.then_some(found)
}

fn mean(values: &[f32]) -> f32 {
    values.iter().sum::<f32>() / values.len() as f32
}

fn variance(values: &[f32], mean: f32) -> f32 {
    values.iter().map(|v| (v - mean) * (v - mean)).sum::<f32>() / values.len() as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A smooth pattern that can be sampled anywhere.
    fn pattern(x: f64, y: f64) -> f64 {
        0.5 + 0.1 * (0.55 * x + 0.2 * y).sin() + 0.1 * (0.31 * y - 0.4 * x).sin() + 0.08 * (0.9 * y + 0.13 * x).cos()
    }

    fn image(f: impl Fn(f64, f64) -> f64) -> GrayImage {
        let size = ImageSize::new(160, 120);
        let rows = (0..size.height).flat_map(|y| (0..size.width).map(move |x| (x, y)));
        GrayImage::from_rows(size, rows.map(|(x, y)| f(x as f64, y as f64) as f32).collect()).expect("right size")
    }

    #[test]
    fn the_spline_goes_through_the_pixels_and_has_the_right_slope() {
        let picture = image(pattern);
        let spline = SplineImage::new(&picture);
        for (x, y) in [(5, 7), (80, 60), (150, 100)] {
            assert!((spline.value(x as f32, y as f32) - picture.get(x, y)).abs() < 1e-5);
            let (gx, gy) = spline.gradient(x, y);
            let h = 1e-4;
            let dx = (pattern(x as f64 + h, y as f64) - pattern(x as f64 - h, y as f64)) / (2.0 * h);
            let dy = (pattern(x as f64, y as f64 + h) - pattern(x as f64, y as f64 - h)) / (2.0 * h);
            assert!((f64::from(gx) - dx).abs() < 2e-3 && (f64::from(gy) - dy).abs() < 2e-3);
        }
        for (x, y) in [(50.3, 40.7), (90.5, 77.5)] {
            assert!((f64::from(spline.value(x, y)) - pattern(f64::from(x), f64::from(y))).abs() < 1e-3);
        }
    }

    #[test]
    fn patches_are_found_without_bias_under_a_warp_and_a_change_of_brightness() {
        // b(f(p)) = a(p): sample b by the inverse of the map.
        let (c, s) = (0.2f64.cos() * 1.1, 0.2f64.sin() * 1.1);
        let forward = |p: &Vector2<f64>| {
            let (x, y) = (p.x - 80.0, p.y - 60.0);
            Vector2::new(c * x - s * y + 81.3, s * x + c * y + 59.6)
        };
        let det = c * c + s * s;
        let backward = |x: f64, y: f64| {
            let (u, v) = (x - 81.3, y - 59.6);
            ((c * u + s * v) / det + 80.0, (-s * u + c * v) / det + 60.0)
        };
        let (pa, pb) = (
            image(pattern),
            image(|x, y| {
                let (u, v) = backward(x, y);
                0.7 * pattern(u, v) + 0.1
            }),
        );
        let (a, b) = (SplineImage::new(&pa), SplineImage::new(&pb));
        // Predicted half a pixel off.
        let rough = |p: &Vector2<f64>| Some(forward(p) + Vector2::new(0.4, -0.3));
        let found = match_patches(&a, &pa, &b, &rough, &PatchOptions::default());
        assert!(found.len() >= 8, "{}", found.len());
        for m in &found {
            assert!((m.b - forward(&m.a)).norm() < 0.01, "{:?} {}", m, forward(&m.a));
            assert!((m.gain - 1.0 / 0.7).abs() < 0.02);
        }
    }

    #[test]
    fn flat_and_foreign_patches_are_left_out() {
        let (flat, picture) = (image(|_, _| 0.5), image(pattern));
        let other = image(|x, y| pattern(1.7 * y + 31.0, 1.3 * x));
        let identity = |p: &Vector2<f64>| Some(*p);
        let options = PatchOptions::default();
        let find = |p: &GrayImage, q: &GrayImage| {
            match_patches(&SplineImage::new(p), p, &SplineImage::new(q), &identity, &options).len()
        };
        assert_eq!(find(&flat, &flat), 0);
        assert_eq!(find(&picture, &flat), 0);
        assert!(find(&picture, &other) <= 1);
    }
}
