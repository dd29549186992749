//! Patches of the plane, matched again to a few hundredths of a pixel (least squares matching, Förstner 1982, Gruen 1985).
//!
//! Once a map f from image a to image b is known roughly, a patch around p is sought in b by
//!
//! ```text
//! minimise over s, g, c:   Σ_o ϱ( A(p + o) - g B(f(p + o) + s) - c ),     ϱ Huber's
//! ```
//!
//! with shift s in pixels of b, gain g, bias c. A and B are the cubic B-splines whose coefficients are the pixels: that blurs
//! by (1, 4, 1) / 6 along both axes (deviation 0.58 pixels), which costs little where the pictures are good, and where they
//! are noisy or badly sampled is a tenth more accurate than a spline through the pixels. Gauss-Newton with the template's own values and gradient (their noise is uncorrelated with the sum
//! it is multiplied with at the solution), carried to b by the Jacobian of f, and with clipped residuals instead of weights
//! (Huber & Dutter 1974): the normal matrix is one of the template alone, inverted once.
//!
//! Templates belong to an image, not to a pair (`template_grid_until`): matches of one image with several others share their
//! places exactly and join to tracks.

use multiversion::multiversion;
use nalgebra::{Matrix2, Matrix4, Vector2, Vector4};
use rayon::prelude::*;

use crate::{error::Error, observer::Observer, pairs::correspondence::PointMatch, vision::image::GrayImage};

/// How patches are sought.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct PatchOptions {
    /// Half the side of a patch in pixels: a patch has (2 r + 1)² pixels.
    pub(crate) radius_px: usize,
    /// About the most templates of an image, on a grid over all of it.
    pub(crate) max_patches: usize,
    /// Most Gauss-Newton steps.
    pub(crate) max_iterations: usize,
    /// Largest shift from the predicted place, in pixels.
    pub(crate) max_shift_px: f64,
    /// Largest predicted standard deviation of either coordinate, in pixels: less texture than that is left out.
    pub(crate) max_sigma_px: f64,
    /// Least correlation coefficient of template and matched patch.
    pub(crate) min_correlation: f64,
    /// Standard deviation added to the predicted one (interpolation, aliasing, a floor that is not quite flat), in pixels.
    pub(crate) model_sigma_px: f64,
}

impl Default for PatchOptions {
    fn default() -> Self {
        Self {
            radius_px: 10,
            max_patches: 1700,
            max_iterations: 10,
            max_shift_px: 2.5,
            max_sigma_px: 0.2,
            min_correlation: 0.6,
            model_sigma_px: 0.02,
        }
    }
}

/// A patch found again.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct PatchMatch {
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
    pub(crate) fn point_match(&self, model_sigma_px: f64) -> PointMatch {
        let spread = (Matrix2::identity() + self.jacobian * self.jacobian.transpose()).trace();
        let variance = self.covariance.trace() / spread + model_sigma_px * model_sigma_px;
        PointMatch { a: self.a, b: self.b, sigma_px: variance.sqrt() }
    }
}

/// Distance from a template's centre to the border of its image that leaves room for gradients.
fn margin_px(options: &PatchOptions) -> usize {
    options.radius_px + 2
}

/// Places of an image's templates: in every cell of a grid the one with the best texture, row by row. The cells are so wide,
/// and the places so far from their borders, that templates do not overlap: their noise is independent. In images of up to
/// a megapixel the cells are no larger than a template: more patches tell more than better ones.
///
/// # Errors
/// [`Error::Stopped`] and no other.
pub(crate) fn template_grid_until(
    a: &GrayImage,
    options: &PatchOptions,
    observer: &dyn Observer,
) -> Result<Vec<(usize, usize)>, Error> {
    let (w, h) = (a.size().width, a.size().height);
    let (margin, side) = (margin_px(options), 2 * options.radius_px + 1);
    if w < 2 * margin + 1 || h < 2 * margin + 1 {
        return Ok(Vec::new());
    }
    // Where centres may be.
    let (columns, rows) = (w - 2 * margin, h - 2 * margin);
    let area = (columns * rows) as f64;
    let spacing = ((area / options.max_patches.max(1) as f64).sqrt().ceil() as usize).max(side);
    let slack = spacing - side;
    let mut lines = TextureLines::new(w);
    let mut grid = Vec::with_capacity((columns / spacing + 1) * (rows / spacing + 1));
    for y0 in (0..rows).step_by(spacing) {
        observer.go_on()?;
        let mut best: Vec<Option<(f64, (usize, usize))>> = vec![None; columns.div_ceil(spacing)];
        for dy in (0..=slack).step_by((slack / 2).max(1)) {
            let y = margin + y0 + dy;
            if y >= h - margin {
                continue;
            }
            lines.fill(a, y, options.radius_px);
            for (x0, best) in (0..columns).step_by(spacing).zip(&mut best) {
                for x in (x0..=x0 + slack).filter(|x| *x < columns) {
                    if !wholly_used(a, (margin + x) as f64, y as f64, options) {
                        continue;
                    }
                    let texture = lines.texture(margin + x, options.radius_px);
                    if best.is_none_or(|(most, _)| texture > most) {
                        *best = Some((texture, (margin + x, y)));
                    }
                }
            }
        }
        grid.extend(best.into_iter().flatten().filter(|(texture, _)| *texture > MIN_TEXTURE).map(|(_, place)| place));
    }
    Ok(grid)
}

/// The same without an observer.
#[cfg(test)]
pub(crate) fn template_grid(a: &GrayImage, options: &PatchOptions) -> Vec<(usize, usize)> {
    template_grid_until(a, options, &crate::observer::Silent).unwrap_or_default()
}

/// Whether the image's mask holds all of the patch at this place.
fn wholly_used(image: &GrayImage, x: f64, y: f64, options: &PatchOptions) -> bool {
    image.used_about(x, y, options.radius_px as f64) >= 1.0
}

/// Least eigenvalue of a template's sum of gradient products: below it the rounding to 8 bits alone moves a patch by a third of
/// a pixel.
const MIN_TEXTURE: f64 = 1e-5;

/// Sums of gradient products over the height of a template (every second row), running along the image.
struct TextureLines {
    gx: Vec<f32>,
    gy: Vec<f32>,
    columns: [Vec<f32>; 3],
    /// Sums over all columns before.
    running: Vec<[f64; 3]>,
}

impl TextureLines {
    fn new(w: usize) -> Self {
        Self {
            gx: vec![0.0; w - 2],
            gy: vec![0.0; w - 2],
            columns: [0; 3].map(|_| vec![0.0; w - 2]),
            running: vec![[0.0; 3]; w - 1],
        }
    }

    /// For templates whose centres lie in row `y`.
    fn fill(&mut self, a: &GrayImage, y: usize, radius: usize) {
        for column in &mut self.columns {
            column.fill(0.0);
        }
        let [xx, xy, yy] = &mut self.columns;
        for py in (y - radius..=y + radius).step_by(2) {
            spline_gradients(a, (1, py), &mut self.gx, &mut self.gy);
            for (i, (gx, gy)) in self.gx.iter().zip(&self.gy).enumerate() {
                xx[i] += gx * gx;
                xy[i] += gx * gy;
                yy[i] += gy * gy;
            }
        }
        let mut sums = [0.0; 3];
        for (i, next) in self.running[1..].iter_mut().enumerate() {
            sums = [sums[0] + f64::from(xx[i]), sums[1] + f64::from(xy[i]), sums[2] + f64::from(yy[i])];
            *next = sums;
        }
    }

    /// Smaller eigenvalue of the sum of gradient products of the template in column `x`.
    fn texture(&self, x: usize, radius: usize) -> f64 {
        // Column x of the image is entry x - 1 here.
        let (before, after) = (&self.running[x - 1 - radius], &self.running[x + radius]);
        let [xx, xy, yy] = [0, 1, 2].map(|k| after[k] - before[k]);
        // Every second row.
        (0.5 * (xx + yy) - (0.25 * (xx - yy) * (xx - yy) + xy * xy).sqrt()) * 2.0
    }
}

/// Matches the templates at `grid` (see [`template_grid_until`]) that image b sees, given a map from pixels of a to pixels of b good
/// to a pixel or two. In the order of the grid; the same whatever the number of threads.
///
/// # Errors
/// [`Error::Stopped`] and no other.
pub(crate) fn match_patches_until(
    a: &GrayImage,
    grid: &[(usize, usize)],
    b: &GrayImage,
    map: &(dyn Fn(&Vector2<f64>) -> Option<Vector2<f64>> + Sync),
    options: &PatchOptions,
    observer: &dyn Observer,
) -> Result<Vec<PatchMatch>, Error> {
    let margin = margin_px(options);
    let in_a =
        |x: usize, y: usize| x >= margin && y >= margin && x + margin < a.size().width && y + margin < a.size().height;
    let found: Vec<Option<PatchMatch>> = grid
        .par_iter()
        .map_init(
            || Workspace::new(options.radius_px),
            |work, &(x, y)| {
                observer.go_on()?;
                Ok(if in_a(x, y) { match_patch(work, a, b, (x, y), map, options) } else { None })
            },
        )
        .collect::<Result<_, Error>>()?;
    Ok(found.into_iter().flatten().collect())
}

/// The same without an observer.
#[cfg(test)]
pub(crate) fn match_patches(
    a: &GrayImage,
    grid: &[(usize, usize)],
    b: &GrayImage,
    map: &(dyn Fn(&Vector2<f64>) -> Option<Vector2<f64>> + Sync),
    options: &PatchOptions,
) -> Vec<PatchMatch> {
    match_patches_until(a, grid, b, map, options, &crate::observer::Silent).unwrap_or_default()
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
}

/// Residual, in robust deviations, from which on a pixel counts less.
const HUBER: f32 = 2.0;
/// Steps for which the robust deviation is estimated; then it is held, so that the iteration converges.
const SCALE_STEPS: usize = 4;
/// White noise has this many times the variance that the spline leaves of it in a pixel; in sums over a patch it is all
/// there, as neighbours are correlated.
const NOISE_AMPLIFICATION: f32 = 4.0;
/// Shift in pixels of b below which the iteration has converged.
const CONVERGENCE_PX: f64 = 2e-3;
/// Values handled at once: enough for the compiler to fill vector registers.
const LANES: usize = 8;

/// See [`Workspace::match_patch`].
#[multiversion(targets("x86_64+avx2"))]
fn match_patch(
    work: &mut Workspace,
    a: &GrayImage,
    b: &GrayImage,
    at: (usize, usize),
    map: &(dyn Fn(&Vector2<f64>) -> Option<Vector2<f64>> + Sync),
    options: &PatchOptions,
) -> Option<PatchMatch> {
    work.match_patch(a, b, at, map, options)
}

/// Room for one patch, used again for every patch of a thread. All vectors have one entry a pixel, row by row, filled up to
/// whole lanes with entries that add nothing.
struct Workspace {
    radius: usize,
    /// Pixels of a patch.
    n: usize,
    /// The template less its mean, and its gradient.
    template: Vec<f32>,
    gx: Vec<f32>,
    gy: Vec<f32>,
    /// Where the pixels lie in b before any shift, from a whole pixel near the patch's centre.
    x: Vec<f32>,
    y: Vec<f32>,
    /// b there.
    values: Vec<f32>,
    residuals: Vec<f32>,
}

/// What the iteration needs of a template besides its pixels.
struct TemplateSums {
    /// Mean square of the template less its mean.
    variance: f32,
    /// Inverse of Σ j jᵀ, j = (gradient in x, in y, template less mean, 1).
    inverse: Matrix4<f64>,
}

impl Workspace {
    fn new(radius: usize) -> Self {
        let n = (2 * radius + 1).pow(2);
        let room = || vec![0.0f32; n.next_multiple_of(LANES)];
        Self {
            radius,
            n,
            template: room(),
            gx: room(),
            gy: room(),
            x: room(),
            y: room(),
            values: room(),
            residuals: room(),
        }
    }

    /// Matches one patch; `None` where there is too little texture, the patch leaves b, or something else is seen there.
    #[inline(always)]
    fn match_patch(
        &mut self,
        a: &GrayImage,
        b: &GrayImage,
        (x, y): (usize, usize),
        map: &(dyn Fn(&Vector2<f64>) -> Option<Vector2<f64>> + Sync),
        options: &PatchOptions,
    ) -> Option<PatchMatch> {
        let centre = Vector2::new(x as f64, y as f64);
        // Where the whole patch may lie in b, whatever the shift: splines reach two pixels further.
        let reach = options.max_shift_px + 2.0;
        let (right, bottom) = (b.size().width as f64 - 1.0 - reach, b.size().height as f64 - 1.0 - reach);
        let fits = |x: f64, y: f64| x > reach && y > reach && x < right && y < bottom;
        let predicted = map(&centre)?;
        if !fits(predicted.x, predicted.y) || !wholly_used(b, predicted.x, predicted.y, options) {
            return None;
        }
        let local = LocalMap::new(map, centre, self.radius as f64)?;
        let jacobian = Matrix2::from_columns(&[local.x, local.y]);
        // Seen at less than half or more than twice the scale the patch is another picture.
        if !(0.2..5.0).contains(&jacobian.determinant()) {
            return None;
        }
        let base = local.at.map(f64::floor);
        let [low, high] = self.place(&local, &base);
        if !(fits(base.x + low[0], base.y + low[1]) && fits(base.x + high[0], base.y + high[1])) {
            return None;
        }
        let sums = self.take_template(a, (x, y))?;
        let base_index = base.y as usize * b.size().width + base.x as usize;

        let mut shift = Vector2::<f64>::zeros();
        let (mut gain, mut bias) = (1.0f32, 0.0f32);
        let mut limit = f32::INFINITY;
        let mut converged_at = 0;
        for iteration in 1..=options.max_iterations {
            self.sample(b, base_index, (shift.x as f32, shift.y as f32));
            if iteration == 1 {
                // Brightness of the two patches as a start.
                let values = &self.values[..self.n];
                let mean = values.iter().sum::<f32>() / self.n as f32;
                let variance = values.iter().map(|v| (v - mean) * (v - mean)).sum::<f32>() / self.n as f32;
                if variance <= 0.0 {
                    return None;
                }
                gain = (sums.variance / variance).sqrt();
                bias = -gain * mean;
            }
            let squares = self.subtract(gain, bias);
            if (2..=SCALE_STEPS).contains(&iteration) {
                let sigma = 1.4826 * self.median_size((squares / self.n as f32).sqrt());
                limit = HUBER * sigma.max(1e-6);
            }
            let step = sums.inverse * self.clipped_products(limit);
            // The patch moves in a by step[..2]: in b by as much as f makes of it.
            let moved = jacobian * Vector2::new(step[0], step[1]);
            shift += moved;
            // Template = gain value + bias: a multiple of the template is one of both.
            let relative = step[2] as f32;
            gain += relative * gain;
            bias += relative * bias + step[3] as f32;
            if shift.amax().is_nan() || shift.amax() > options.max_shift_px {
                return None;
            }
            if iteration > 2 && moved.norm() < CONVERGENCE_PX {
                converged_at = iteration;
                break;
            }
        }
        if converged_at == 0 {
            return None;
        }
        let spread = self.spread(limit);
        let correlation = (1.0 - spread.weighted_variance / sums.variance).max(0.0).sqrt();
        let in_a = sums.inverse.fixed_view::<2, 2>(0, 0) * f64::from(spread.noise_variance);
        let covariance = jacobian * in_a * jacobian.transpose();
        let sigma = covariance[(0, 0)].max(covariance[(1, 1)]).sqrt();
        let good = sigma <= options.max_sigma_px
            && f64::from(correlation) >= options.min_correlation
            && (0.3..3.0).contains(&gain);
        good.then(|| PatchMatch {
            a: centre,
            b: local.at + shift,
            covariance,
            jacobian,
            correlation: f64::from(correlation),
            gain: f64::from(gain),
            iterations: converged_at,
        })
    }

    /// Where the patch's pixels lie in b, from `base`; the least and the greatest of both coordinates.
    #[inline(always)]
    fn place(&mut self, local: &LocalMap, base: &Vector2<f64>) -> [[f64; 2]; 2] {
        let side = 2 * self.radius + 1;
        let start = local.at - base;
        let (mut low, mut high) = ([f32::INFINITY; 2], [f32::NEG_INFINITY; 2]);
        for (axis, out) in [&mut self.x, &mut self.y].into_iter().enumerate() {
            let [at, x, y, xx, xy, yy] =
                [start[axis], local.x[axis], local.y[axis], local.xx[axis], local.xy[axis], local.yy[axis]]
                    .map(|v| v as f32);
            for (row, out) in out[..self.n].chunks_exact_mut(side).enumerate() {
                let dy = row as f32 - self.radius as f32;
                let (constant, slope) = (at + (y + yy * dy) * dy, x + xy * dy);
                for (column, out) in out.iter_mut().enumerate() {
                    let dx = column as f32 - self.radius as f32;
                    *out = constant + (slope + xx * dx) * dx;
                }
            }
            // Beyond the last pixel: the centre again.
            out[self.n..].fill(at);
            for v in out.iter() {
                low[axis] = if *v < low[axis] { *v } else { low[axis] };
                high[axis] = if *v > high[axis] { *v } else { high[axis] };
            }
        }
        [low.map(f64::from), high.map(f64::from)]
    }

    /// The template around (x, y) and its normal matrix; `None` without texture.
    #[inline(always)]
    fn take_template(&mut self, a: &GrayImage, (x, y): (usize, usize)) -> Option<TemplateSums> {
        let side = 2 * self.radius + 1;
        let (left, top) = (x - self.radius, y - self.radius);
        for row in 0..side {
            let range = row * side..(row + 1) * side;
            spline_values(a, (left, top + row), &mut self.template[range.clone()]);
            spline_gradients(a, (left, top + row), &mut self.gx[range.clone()], &mut self.gy[range]);
        }
        let n = self.n as f32;
        let mean = self.template[..self.n].iter().sum::<f32>() / n;
        for t in &mut self.template[..self.n] {
            *t -= mean;
        }
        let mut lanes = [[0.0f32; LANES]; 8];
        let pixels = self.gx.as_chunks::<LANES>().0.iter().zip(self.gy.as_chunks::<LANES>().0);
        for ((gx, gy), t) in pixels.zip(self.template.as_chunks::<LANES>().0) {
            for l in 0..LANES {
                let (gx, gy, t) = (gx[l], gy[l], t[l]);
                lanes[0][l] += gx * gx;
                lanes[1][l] += gx * gy;
                lanes[2][l] += gx * t;
                lanes[3][l] += gx;
                lanes[4][l] += gy * gy;
                lanes[5][l] += gy * t;
                lanes[6][l] += gy;
                lanes[7][l] += t * t;
            }
        }
        let [xx, xy, xt, x, yy, yt, y, tt] = lanes.map(|l| f64::from(l.iter().sum::<f32>()));
        if tt <= 0.0 {
            return None;
        }
        // The template has mean zero.
        #[rustfmt::skip]
        let normal = Matrix4::new(
            xx, xy, xt, x,
            xy, yy, yt, y,
            xt, yt, tt, 0.0,
            x, y, 0.0, f64::from(n),
        );
        Some(TemplateSums { variance: tt as f32 / n, inverse: normal.try_inverse()? })
    }

    /// Values of b at the patch's places, shifted.
    #[inline(always)]
    fn sample(&mut self, b: &GrayImage, base_index: usize, (sx, sy): (f32, f32)) {
        let width = b.size().width;
        let places = self.x.as_chunks::<LANES>().0.iter().zip(self.y.as_chunks::<LANES>().0);
        for ((x, y), values) in places.zip(self.values.as_chunks_mut::<LANES>().0) {
            let (mut wx, mut wy) = ([[0.0f32; 4]; LANES], [[0.0f32; 4]; LANES]);
            let mut start = [0usize; LANES];
            let (mut ix, mut iy) = ([0i32; LANES], [0i32; LANES]);
            let (mut tx, mut ty) = ([0.0f32; LANES], [0.0f32; LANES]);
            for l in 0..LANES {
                (ix[l], tx[l]) = whole_and_fraction(x[l] + sx);
                (iy[l], ty[l]) = whole_and_fraction(y[l] + sy);
            }
            for l in 0..LANES {
                wx[l] = weights(tx[l]);
                wy[l] = weights(ty[l]);
                let index = (iy[l] - 1) as isize * width as isize + (ix[l] - 1) as isize;
                start[l] = base_index.wrapping_add_signed(index);
            }
            for l in 0..LANES {
                let mut sums = [0.0f32; 4];
                for (r, weight) in wy[l].iter().enumerate() {
                    let c = &b.data()[start[l] + r * width..][..4];
                    for k in 0..4 {
                        sums[k] += weight * c[k];
                    }
                }
                values[l] = sums[0] * wx[l][0] + sums[1] * wx[l][1] + (sums[2] * wx[l][2] + sums[3] * wx[l][3]);
            }
        }
    }

    /// Residuals; their sum of squares.
    #[inline(always)]
    fn subtract(&mut self, gain: f32, bias: f32) -> f32 {
        for ((r, t), v) in self.residuals.iter_mut().zip(&self.template).zip(&self.values) {
            *r = t - gain * v - bias;
        }
        self.residuals[self.n..].fill(0.0);
        let mut squares = [0.0f32; LANES];
        for r in self.residuals.as_chunks::<LANES>().0 {
            for l in 0..LANES {
                squares[l] += r[l] * r[l];
            }
        }
        squares.iter().sum()
    }

    /// Median of the residuals' sizes, by bisection: it is not above √2 times their root mean square.
    #[inline(always)]
    fn median_size(&self, rms: f32) -> f32 {
        let (mut low, mut high) = (0.0f32, std::f32::consts::SQRT_2 * rms);
        let wanted = (self.n / 2 + self.residuals.len() - self.n) as u32;
        for _ in 0..7 {
            let middle = 0.5 * (low + high);
            let mut counts = [0u32; LANES];
            for r in self.residuals.as_chunks::<LANES>().0 {
                for l in 0..LANES {
                    counts[l] += u32::from(r[l].abs() <= middle);
                }
            }
            if counts.iter().sum::<u32>() > wanted {
                high = middle;
            } else {
                low = middle;
            }
        }
        0.5 * (low + high)
    }

    /// Σ j ψ, with j as in [`TemplateSums::inverse`] and ψ the residual, cut at `limit`.
    #[inline(always)]
    fn clipped_products(&self, limit: f32) -> Vector4<f64> {
        let mut lanes = [[0.0f32; LANES]; 4];
        let residuals = self.residuals.as_chunks::<LANES>().0.iter();
        let pixels = self.gx.as_chunks::<LANES>().0.iter().zip(self.gy.as_chunks::<LANES>().0);
        for (r, ((gx, gy), t)) in residuals.zip(pixels.zip(self.template.as_chunks::<LANES>().0)) {
            for l in 0..LANES {
                let r = clipped(r[l], limit);
                lanes[0][l] += gx[l] * r;
                lanes[1][l] += gy[l] * r;
                lanes[2][l] += t[l] * r;
                lanes[3][l] += r;
            }
        }
        Vector4::from_column_slice(&lanes.map(|l| f64::from(l.iter().sum::<f32>())))
    }

    /// How large the residuals are that `clipped_products` saw.
    #[inline(always)]
    fn spread(&self, limit: f32) -> Spread {
        let (mut squares, mut weighted, mut weights, mut within) = (0.0f32, 0.0f32, 0.0f32, 0.0f32);
        for r in &self.residuals[..self.n] {
            let cut = clipped(*r, limit);
            squares += cut * cut;
            weighted += cut * r;
            weights += (limit / r.abs()).min(1.0);
            within += if r.abs() <= limit { 1.0 } else { 0.0 };
        }
        let n = self.n as f32;
        // Huber 1981, 7.6: mean square of ψ over the squared mean of its slope.
        let slope = (within / n).max(0.1);
        Spread {
            weighted_variance: weighted / weights,
            noise_variance: NOISE_AMPLIFICATION * squares / (n - 4.0).max(1.0) / (slope * slope),
        }
    }
}

/// Sizes of the residuals of a patch.
struct Spread {
    /// Mean square, pixels beyond the limit counted less.
    weighted_variance: f32,
    /// Factor from the inverse of the normal matrix to a covariance.
    noise_variance: f32,
}

#[inline(always)]
fn clipped(r: f32, limit: f32) -> f32 {
    let r = if r > limit { limit } else { r };
    if r < -limit { -limit } else { r }
}

/// Whole part and fraction, 0 to 1, of a number below a million in size, without a conversion that must look after
/// overflow: adding 1.5 · 2²³ leaves the nearest whole number in the last bits.
#[inline(always)]
fn whole_and_fraction(x: f32) -> (i32, f32) {
    const ROUND: f32 = 12_582_912.0;
    let rounded = (x - 0.5) + ROUND;
    (rounded.to_bits() as i32 - ROUND.to_bits() as i32, x - (rounded - ROUND))
}

/// The three rows around row `y`, from one column left of `x` on, `n + 2` columns.
#[inline(always)]
fn three_rows(image: &GrayImage, (x, y): (usize, usize), n: usize) -> [&[f32]; 3] {
    [y - 1, y, y + 1].map(|y| &image.row(y)[x - 1..x + n + 1])
}

/// The spline at the pixels of row `y` from column `x` on, at least one pixel inside the image.
#[inline(always)]
fn spline_values(image: &GrayImage, at: (usize, usize), values: &mut [f32]) {
    let [above, here, below] = three_rows(image, at, values.len());
    for (i, value) in values.iter_mut().enumerate() {
        let across = |k: usize| above[k] + 4.0 * here[k] + below[k];
        *value = (across(i) + 4.0 * across(i + 1) + across(i + 2)) * (1.0 / 36.0);
    }
}

/// Its gradient there.
#[inline(always)]
fn spline_gradients(image: &GrayImage, at: (usize, usize), gx: &mut [f32], gy: &mut [f32]) {
    let [above, here, below] = three_rows(image, at, gx.len());
    // Derivative (-1, 0, 1) / 2 along one axis, value (1, 4, 1) / 6 along the other.
    for (i, (gx, gy)) in gx.iter_mut().zip(gy).enumerate() {
        let value = |k: usize| above[k] + 4.0 * here[k] + below[k];
        let slope = |k: usize| below[k] - above[k];
        *gx = (value(i + 2) - value(i)) * (1.0 / 12.0);
        *gy = (slope(i) + 4.0 * slope(i + 1) + slope(i + 2)) * (1.0 / 12.0);
    }
}

/// Cubic B-spline weights of the four coefficients around a fraction.
#[inline(always)]
fn weights(t: f32) -> [f32; 4] {
    let u = 1.0 - t;
    let (t2, u2) = (t * t, u * u);
    const SIXTH: f32 = 1.0 / 6.0;
    let (first, last) = (SIXTH * u2 * u, SIXTH * t2 * t);
    [first, 2.0 / 3.0 - 0.5 * t2 * (2.0 - t), 2.0 / 3.0 - 0.5 * u2 * (2.0 - u), last]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::size::ImageSize;

    /// A smooth pattern that can be sampled anywhere.
    fn pattern(x: f64, y: f64) -> f64 {
        0.5 + 0.1 * (0.55 * x + 0.2 * y).sin() + 0.1 * (0.31 * y - 0.4 * x).sin() + 0.08 * (0.9 * y + 0.13 * x).cos()
    }

    fn image(f: impl Fn(f64, f64) -> f64) -> GrayImage {
        let size = ImageSize::new(160, 120);
        let rows = (0..size.height).flat_map(|y| (0..size.width).map(move |x| (x, y)));
        GrayImage::from_rows(size, rows.map(|(x, y)| f(x as f64, y as f64) as f32).collect()).expect("right size")
    }

    fn value(image: &GrayImage, x: f32, y: f32) -> f32 {
        let mut work = Workspace::new(0);
        work.sample(image, 0, (x, y));
        work.values[0]
    }

    fn matched(
        a: &GrayImage,
        b: &GrayImage,
        map: &(dyn Fn(&Vector2<f64>) -> Option<Vector2<f64>> + Sync),
    ) -> Vec<PatchMatch> {
        let options = PatchOptions::default();
        match_patches(a, &template_grid(a, &options), b, map, &options)
    }

    #[test]
    fn values_and_slopes_are_those_of_one_spline() {
        let picture = image(pattern);
        for (x, y) in [(5, 7), (80, 60), (150, 100)] {
            let (mut v, mut gx, mut gy) = ([0.0], [0.0], [0.0]);
            spline_values(&picture, (x, y), &mut v);
            spline_gradients(&picture, (x, y), &mut gx, &mut gy);
            let at = |dx: f32, dy: f32| value(&picture, x as f32 + dx, y as f32 + dy);
            assert!((at(0.0, 0.0) - v[0]).abs() < 1e-6);
            let h = 0.01;
            assert!(((at(h, 0.0) - at(-h, 0.0)) / (2.0 * h) - gx[0]).abs() < 1e-4);
            assert!(((at(0.0, h) - at(0.0, -h)) / (2.0 * h) - gy[0]).abs() < 1e-4);
            // Between the pixels smooth, and about what the picture is.
            let here = pattern(x as f64 + 0.3, y as f64 + 0.7);
            assert!((f64::from(at(0.3, 0.7)) - here).abs() < 0.03);
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
        // Predicted half a pixel off.
        let rough = |p: &Vector2<f64>| Some(forward(p) + Vector2::new(0.4, -0.3));
        let found = matched(&pa, &pb, &rough);
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
        let find = |p: &GrayImage, q: &GrayImage| matched(p, q, &identity).len();
        assert_eq!(find(&flat, &flat), 0);
        assert_eq!(find(&picture, &flat), 0);
        assert!(find(&picture, &other) <= 1);
    }

    #[test]
    fn templates_are_textured_and_do_not_overlap() {
        let options = PatchOptions::default();
        let side = 2 * options.radius_px + 1;
        // Flat on the left.
        let picture = image(|x, y| if x < 60.0 { 0.5 } else { pattern(x, y) });
        let grid = template_grid(&picture, &options);
        assert!(grid.len() >= 12, "{}", grid.len());
        for (i, p) in grid.iter().enumerate() {
            assert!(p.0 + options.radius_px > 50, "a flat place: {p:?}");
            for q in &grid[..i] {
                assert!(p.0.abs_diff(q.0) >= side || p.1.abs_diff(q.1) >= side, "{p:?} overlaps {q:?}");
            }
        }
    }
}
