//! Bird's-eye pictures of the floor: of one view, or of many laid over each other.
//!
//! ```text
//! rectified pixel -> floor ([`FloorGrid`]) -> pixel with the lens ([`FloorView::pixel_from_floor`])
//!
//! mosaic = Σ_v w_v I_v / Σ_v w_v,     w_v = |det J_v|⁴ b_v²
//! ```
//!
//! with |det J| the source pixels for a pixel of the mosaic (the view that sees the floor best counts most, so that what stands on
//! the floor is not shown over and over) and b from 0 at the image's border to 1 well inside it (no seams).

use nalgebra::Vector2;

use crate::{
    floor::view::{FloorGrid, FloorView},
    geometry::size::ImageSize,
    vision::resample::{Depth, MAX_CHANNELS, Pyramid, Resampled, Sample, resample_into, rounded},
};

/// Width of the border over which a view fades in a mosaic, as a fraction of the image's shorter side, and what is left of its weight
/// at the very border.
const BORDER: f64 = 0.2;
const MIN_WEIGHT: f64 = 1e-3;
/// Columns and rows of pixels that are asked for their resolution.
const PROBES: [usize; 2] = [32, 24];

/// The resolution of views on the floor, in pixels for a unit of length: the median over pixels that see the floor within
/// `max_distance` of the view's foot of the root of the area that a unit of floor has in the image. `None` when none sees it.
pub(crate) fn source_resolution<'a>(
    views: impl IntoIterator<Item = &'a FloorView>,
    size: ImageSize,
    max_distance: f64,
) -> Option<f64> {
    let mut all = Vec::new();
    for view in views {
        for j in 0..PROBES[1] {
            for i in 0..PROBES[0] {
                let at = |k: usize, n: usize, side: usize| (k as f64 + 0.5) / n as f64 * side as f64 - 0.5;
                let pixel = Vector2::new(at(i, PROBES[0], size.width), at(j, PROBES[1], size.height));
                let on_floor = |dx: f64, dy: f64| view.floor_from_pixel(&(pixel + Vector2::new(dx, dy)));
                let (Some(p), Some(right), Some(down)) = (on_floor(0.0, 0.0), on_floor(0.5, 0.0), on_floor(0.0, 0.5))
                else {
                    continue;
                };
                let area = 4.0 * (right - p).perp(&(down - p)).abs();
                if (p - view.foot()).norm() <= max_distance && area > 0.0 {
                    all.push(1.0 / area.sqrt());
                }
            }
        }
    }
    all.sort_unstable_by(f64::total_cmp);
    all.get(all.len() / 2).copied()
}

/// How much of a rectified pixel lies within the largest distance of the view's foot, 0 to 1.
fn within(view: &FloorView, grid: &FloorGrid, max_distance: f64, x: usize, y: usize) -> f32 {
    let point = grid.floor_from_pixel(&Vector2::new(x as f64, y as f64));
    let room = (max_distance - (point - view.foot()).norm()) / grid.unit_per_px;
    (room + 0.5).clamp(0.0, 1.0) as f32
}

/// The floor as one view shows it on a grid, as far as `max_distance` (floor units) from the point below its optical centre.
pub fn rectify<T: Depth>(picture: &Pyramid<T>, view: &FloorView, grid: &FloorGrid, max_distance: f64) -> Resampled<T> {
    let channels = picture.picture().channels();
    let stride = channels + 1;
    let mut target = vec![T::default(); grid.size.width * grid.size.height * stride];
    let map = |p: &Vector2<f64>| view.pixel_from_floor(&grid.floor_from_pixel(p));
    resample_into(picture, grid.size, &mut target, stride, map, |x, y, sample, out| {
        let coverage = sample.coverage * within(view, grid, max_distance, x, y);
        let coverage = rounded(255.0 * coverage);
        if coverage > 0 {
            for (o, v) in out.iter_mut().zip(&sample.value[..channels]) {
                *o = T::nearest(*v);
            }
            out[channels] = T::nearest(f32::from(coverage));
        }
    });
    Resampled::from_interleaved(grid.size, channels, &target)
}

/// Pictures of one floor laid over each other.
#[derive(Debug, Clone)]
pub struct Mosaic {
    grid: FloorGrid,
    channels: usize,
    max_distance: f64,
    /// For each pixel the weighted sum of each channel, the weight, the coverage.
    sums: Vec<f32>,
}

impl Mosaic {
    /// An empty one of pictures with so many channels.
    pub fn new(grid: FloorGrid, channels: usize, max_distance: f64) -> Self {
        let channels = channels.clamp(1, MAX_CHANNELS);
        let sums = vec![0.0; grid.size.width * grid.size.height * (channels + 2)];
        Self { grid, channels, max_distance, sums }
    }

    /// Adds what a view sees. Pictures with other numbers of channels than the mosaic, and views that see nothing of it, add nothing.
    pub fn add<T: Depth>(&mut self, picture: &Pyramid<T>, view: &FloorView) {
        let (channels, stride) = (self.channels, self.channels + 2);
        let size = picture.picture().size();
        if picture.picture().channels() != channels {
            return;
        }
        // The part of the grid that the view sees.
        let seen = view.seen_floor(size, self.max_distance);
        let (mut low, mut high) = (Vector2::repeat(f64::INFINITY), Vector2::repeat(f64::NEG_INFINITY));
        for p in &seen {
            let pixel = self.grid.pixel_from_floor(p);
            (low, high) = (low.inf(&pixel), high.sup(&pixel));
        }
        let range = |low: f64, high: f64, count: usize| {
            let last = count as f64 - 1.0;
            (high >= -1.0 && low <= last + 1.0)
                .then(|| ((low - 1.0).clamp(0.0, last) as usize, (high + 1.0).ceil().clamp(0.0, last) as usize + 1))
        };
        let Some((left, right)) = range(low.x, high.x, self.grid.size.width) else { return };
        let Some((top, bottom)) = range(low.y, high.y, self.grid.size.height) else { return };
        let part = FloorGrid {
            top_left: self.grid.floor_from_pixel(&Vector2::new(left as f64, top as f64)),
            size: ImageSize::new(right - left, bottom - top),
            ..self.grid
        };
        let mut target = vec![0.0f32; part.size.width * part.size.height * stride];
        let map = |p: &Vector2<f64>| view.pixel_from_floor(&part.floor_from_pixel(p));
        resample_into(picture, part.size, &mut target, stride, map, |x, y, sample, out| {
            let coverage = sample.coverage * within(view, &part, self.max_distance, x, y);
            let weight = coverage * weight_of(sample, size);
            for (o, v) in out.iter_mut().zip(&sample.value[..channels]) {
                *o = weight * v;
            }
            (out[channels], out[channels + 1]) = (weight, coverage);
        });
        let width = self.grid.size.width;
        for (y, row) in target.chunks_exact(part.size.width * stride).enumerate() {
            let from = ((top + y) * width + left) * stride;
            for (sum, value) in self.sums[from..from + row.len()].iter_mut().zip(row) {
                *sum += value;
            }
        }
    }

    /// The picture, in the depth of those that were added.
    pub fn finish<T: Depth>(self) -> Resampled<T> {
        let stride = self.channels + 2;
        let mut target = vec![T::default(); self.grid.size.width * self.grid.size.height * (self.channels + 1)];
        for (out, sums) in target.chunks_exact_mut(self.channels + 1).zip(self.sums.chunks_exact(stride)) {
            let (weight, coverage) = (sums[self.channels], rounded(255.0 * sums[self.channels + 1].min(1.0)));
            if weight > 0.0 && coverage > 0 {
                for (o, s) in out.iter_mut().zip(&sums[..self.channels]) {
                    *o = T::nearest(s / weight);
                }
                out[self.channels] = T::nearest(f32::from(coverage));
            }
        }
        Resampled::from_interleaved(self.grid.size, self.channels, &target)
    }
}

/// The weight of a view in a pixel of a mosaic.
fn weight_of(sample: &Sample, size: ImageSize) -> f32 {
    let (w, h) = (size.width as f64, size.height as f64);
    let p = sample.source;
    let room = [p.x + 0.5, p.y + 0.5, w - 0.5 - p.x, h - 0.5 - p.y].into_iter().fold(f64::INFINITY, f64::min);
    let t = (room / (BORDER * w.min(h))).clamp(0.0, 1.0);
    let inside = t * t * (3.0 - 2.0 * t);
    // Within the range of single precision, sums included.
    let detail = sample.area.clamp(1e-6, 1e6);
    (detail.powi(4) * inside.max(MIN_WEIGHT).powi(2)) as f32
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{intrinsics::Intrinsics, lens::Lens, plane_view::View};
    use crate::vision::resample::{Raster, rounded};
    use nalgebra::Vector3;

    /// Brightness of a pattern on the floor.
    fn floor_value(p: &Vector2<f64>) -> f64 {
        128.0 + 60.0 * (5.0 * p.x).sin() * (4.0 * p.y).cos() + 30.0 * (2.0 * p.x + 3.0 * p.y).sin()
    }

    fn shot(yaw: f64, centre: [f64; 3]) -> (FloorView, Pyramid) {
        let k = Intrinsics::square(300.0, 160.0, 118.0);
        let lens = Lens::radial(-0.1, 0.01);
        let view = View { pitch_down_rad: 0.9, roll_rad: 0.1, yaw_rad: yaw, centre: Vector3::from(centre) };
        let floor = FloorView::new(&k, lens, &view).unwrap();
        let data = (0..320 * 240)
            .map(|i| {
                let at = floor.floor_from_pixel(&Vector2::new((i % 320) as f64, (i / 320) as f64)).unwrap();
                rounded(floor_value(&at) as f32)
            })
            .collect();
        (floor, Pyramid::new(Raster::from_rows(ImageSize::new(320, 240), 1, data).unwrap()))
    }

    #[test]
    fn rectified_pixels_show_the_floor_where_the_grid_says() {
        let (view, picture) = shot(0.7, [0.3, -0.2, 1.0]);
        let size = picture.picture().size();
        let resolution = source_resolution([&view], size, 4.0).unwrap();
        assert!((150.0..400.0).contains(&resolution), "{resolution}");
        let grid = FloorGrid::covering(&view.seen_floor(size, 4.0), &Vector2::x(), 1.0 / resolution).unwrap();
        let out = rectify(&picture, &view, &grid, 4.0);
        let mut compared = 0;
        for y in 0..grid.size.height {
            for x in 0..grid.size.width {
                if out.coverage[y * grid.size.width + x] == 255 {
                    let expected = floor_value(&grid.floor_from_pixel(&Vector2::new(x as f64, y as f64)));
                    let found = f64::from(out.picture.pixel(x, y)[0]);
                    assert!((found - expected).abs() < 4.0, "{x} {y}: {found} {expected}");
                    compared += 1;
                }
            }
        }
        assert!(compared > 20_000, "{compared}");
    }

    #[test]
    fn a_mosaic_of_two_views_is_the_floor_of_both() {
        let shots = [shot(0.0, [0.0, 0.0, 1.0]), shot(0.5, [0.4, 0.2, 1.1])];
        let far = 3.0;
        let seen: Vec<Vector2<f64>> = shots.iter().flat_map(|(v, p)| v.seen_floor(p.picture().size(), far)).collect();
        let grid = FloorGrid::covering(&seen, &Vector2::new(0.8, 0.6), 0.005).unwrap();
        let mut mosaic = Mosaic::new(grid, 1, far);
        let mut single = 0;
        for (view, picture) in &shots {
            mosaic.add(picture, view);
            single += rectify(picture, view, &grid, far).coverage.iter().filter(|c| **c == 255).count();
        }
        let out = mosaic.finish::<u8>();
        let mut covered = 0;
        for (i, coverage) in out.coverage.iter().enumerate() {
            let (x, y) = (i % grid.size.width, i / grid.size.width);
            if *coverage == 255 {
                covered += 1;
                let expected = floor_value(&grid.floor_from_pixel(&Vector2::new(x as f64, y as f64)));
                let found = f64::from(out.picture.pixel(x, y)[0]);
                assert!((found - expected).abs() < 4.0, "{x} {y}: {found} {expected}");
            }
        }
        assert!(covered > single / 2 && covered < single, "they overlap: {covered} of {single}");
    }

    #[test]
    fn beyond_the_largest_distance_nothing_is_shown() {
        let (view, picture) = shot(0.0, [0.0, 0.0, 1.0]);
        let size = picture.picture().size();
        let grid = FloorGrid::covering(&view.seen_floor(size, 5.0), &Vector2::x(), 0.01).unwrap();
        let near = rectify(&picture, &view, &grid, 0.9);
        for (i, coverage) in near.coverage.iter().enumerate() {
            let (x, y) = (i % grid.size.width, i / grid.size.width);
            let distance = grid.floor_from_pixel(&Vector2::new(x as f64, y as f64)).norm();
            assert!(distance < 0.906 || *coverage == 0, "{distance}");
        }
        assert!(near.coverage.contains(&255));
    }
}
