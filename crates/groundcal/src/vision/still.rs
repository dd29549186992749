//! What stands still in all images of a set: a bumper, a robot's frame, the background of a turntable, a date stamp.
//!
//! The images, halved to `MAX_PIXELS` or less, are reduced to the detail that features are made of, and that to unit length in every cell of
//! `CELL` x `CELL` pixels in which there is any:
//!
//! ```text
//! d_i = G(1) * I_i - G(2) * I_i,    z_i = d_i / |d_i|,    S = Σ z_i
//! c_i = Σ z_i · (S - z_i) / Σ (n - 1)       sums over 3 x 3 cells
//! ```
//!
//! c_i is the mean correlation of image i with the n - 1 others at the same place. It needs one pass over the images, no features and no pairs, and
//! gain and offset of the exposure fall out. What stands still has a c_i of the fraction of the detail's variance that is not noise; what
//! moves has none (see `MIN_CORRELATION`).

use std::sync::Arc;

use rayon::prelude::*;

use crate::{
    error::Error,
    geometry::size::ImageSize,
    observer::Observer,
    vision::{
        features::{blur, halve},
        image::GrayImage,
        mask::Mask,
    },
};

/// Fewest images: of two, what stands still in both is told from what moves by the planes that their matches lie on.
const MIN_IMAGES: usize = 3;
/// Images that are compared, evenly spread over the set: what stands still in all stands still in these. 24 of a megapixel are 100 MB.
const MAX_IMAGES: usize = 24;
/// Pixels that are enough to see it, and few enough for a shake by a pixel of a large picture not to matter.
const MAX_PIXELS: usize = 1_500_000;
/// Side of a cell, pixels.
const CELL: usize = 8;
/// Cells to either side that judge together.
const NEIGHBOURHOOD_CELLS: usize = 1;
/// Root mean square of a cell's detail from which on there is something to see: half the least response of a feature (|D| of 0.01 / 2 / 3
/// scales in an octave), four times what rounding to 8 bits leaves of noise in it.
const MIN_DETAIL: f32 = 0.5 * 0.01 / 6.0;
/// Mean correlation from which on a place stands still: half of what is seen there is common to all images. Measured, least over the images
/// as it is used: in twelve sets of 6 to 24 pictures, rendered and photographed, in which nothing stands still, 99.9 % of the cells lie below
/// 0.06 and the highest at 0.12; before a wall that stands still behind a turntable half of them lie above 0.97.
const MIN_CORRELATION: f32 = 0.5;
/// One image in so many may show something else at a place: somebody passed by.
const IMAGES_PER_EXCEPTION: usize = 10;
/// Fewest cells of a thing that are no edge: one neighbourhood. Less is the axis of a turn seen in the picture, which stands still as well.
const MIN_CELLS: usize = (2 * NEIGHBOURHOOD_CELLS + 1) * (2 * NEIGHBOURHOOD_CELLS + 1);
/// Ratio of principal curvatures from which on features count as edges, and are left out. A still edge alone is no still thing: the horizon
/// of a camera that pans lies where it lay, whatever is seen there.
const EDGE_RATIO: f32 = 10.0;
/// Least fraction of the picture in which detail moves. With less nothing moved, and pairs say so.
const MIN_MOVING: f64 = 0.01;

/// What stands still in all images.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct StillParts {
    /// The rest of the picture.
    pub mask: Arc<Mask>,
    /// Fraction of the places with detail that stand still.
    pub share: f64,
}

impl StillParts {
    /// The images without them.
    ///
    /// # Errors
    /// [`Error::InvalidInput`] where an image has another size.
    pub(crate) fn set_aside(&self, images: &[GrayImage]) -> Result<Vec<GrayImage>, Error> {
        images.iter().map(|image| image.clone().masked(Arc::clone(&self.mask))).collect()
    }
}

/// Finds what stands still in all images; `None` where nothing does, or nothing else is there, or there are two images only, or images
/// of different sizes. What a mask leaves out is not looked at.
///
/// # Errors
/// [`Error::Stopped`] and no other.
pub(crate) fn still_parts(images: &[GrayImage], observer: &dyn Observer) -> Result<Option<StillParts>, Error> {
    let Some(size) = images.first().map(GrayImage::size) else { return Ok(None) };
    if images.len() < MIN_IMAGES || images.iter().any(|i| i.size() != size) {
        return Ok(None);
    }
    let chosen = evenly_spread(images);
    let all: Vec<Detail> = chosen
        .par_iter()
        .map(|image| {
            observer.go_on()?;
            Ok(Detail::of(image))
        })
        .collect::<Result<_, Error>>()?;
    let grid = all[0].grid;
    if grid.cells() == 0 {
        return Ok(None);
    }
    let seen = with_detail(&all);
    let still = with_corners(standing(&all, &seen, grid), &all, grid);
    let (places, count) = (seen.iter().filter(|s| **s).count(), still.iter().filter(|s| **s).count());
    let moving = (places - count) as f64 / grid.cells() as f64;
    if count == 0 || moving < MIN_MOVING {
        return Ok(None);
    }
    let around = grid.widened(&still);
    let used: Vec<bool> = (0..size.height)
        .flat_map(|y| (0..size.width).map(move |x| (x, y)))
        .map(|(x, y)| !around[grid.cell_of(x, y)])
        .collect();
    let mask = Mask::new(size, &used).map(Arc::new);
    Ok(mask.map(|mask| StillParts { mask, share: count as f64 / places as f64 }))
}

fn evenly_spread(images: &[GrayImage]) -> Vec<&GrayImage> {
    let count = images.len().min(MAX_IMAGES);
    (0..count).map(|i| &images[i * (images.len() - 1) / (count - 1).max(1)]).collect()
}

/// Cells over a halved image.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Grid {
    columns: usize,
    rows: usize,
    /// Pixels of the image for one of the halved.
    pixel_px: usize,
}

impl Grid {
    fn new(halved: ImageSize, pixel_px: usize) -> Self {
        Self { columns: halved.width / CELL, rows: halved.height / CELL, pixel_px }
    }

    fn cells(&self) -> usize {
        self.columns * self.rows
    }

    /// The cell of a pixel of the whole image; those of the border belong to the last.
    fn cell_of(&self, x: usize, y: usize) -> usize {
        let along = |v: usize, cells: usize| (v / self.pixel_px / CELL).min(cells - 1);
        along(y, self.rows) * self.columns + along(x, self.columns)
    }

    /// The cell and those about it.
    fn about(self, cell: usize) -> impl Iterator<Item = usize> {
        let (x, y) = (cell % self.columns, cell / self.columns);
        let rows = y.saturating_sub(NEIGHBOURHOOD_CELLS)..(y + NEIGHBOURHOOD_CELLS + 1).min(self.rows);
        rows.flat_map(move |y| {
            let columns = x.saturating_sub(NEIGHBOURHOOD_CELLS)..(x + NEIGHBOURHOOD_CELLS + 1).min(self.columns);
            columns.map(move |x| y * self.columns + x)
        })
    }

    /// The same cells and all next to them.
    fn widened(self, cells: &[bool]) -> Vec<bool> {
        (0..cells.len()).map(|cell| self.about(cell).any(|c| cells[c])).collect()
    }
}

/// The detail of an image, cell by cell.
struct Detail {
    grid: Grid,
    /// CELL x CELL values of unit length for each cell, or zeros where there is no detail.
    values: Vec<f32>,
    /// Whether there is any.
    is_seen: Vec<bool>,
}

/// Values of a cell.
const AREA: usize = CELL * CELL;

impl Detail {
    fn of(image: &GrayImage) -> Self {
        let mut pixel_px = 1;
        let mut halved = None;
        while halved.as_ref().unwrap_or(image).data().len() > MAX_PIXELS {
            halved = Some(halve(&blur(halved.as_ref().unwrap_or(image), 1.0)));
            pixel_px *= 2;
        }
        let small = halved.as_ref().unwrap_or(image);
        let grid = Grid::new(small.size(), pixel_px);
        let (fine, coarse) = (blur(small, 1.0), blur(small, 2.0));
        let mut values = vec![0.0f32; grid.cells() * AREA];
        let mut is_seen = vec![false; grid.cells()];
        for (cell, (values, is_seen)) in values.chunks_exact_mut(AREA).zip(&mut is_seen).enumerate() {
            let (x0, y0) = (cell % grid.columns * CELL, cell / grid.columns * CELL);
            for (row, values) in values.chunks_exact_mut(CELL).enumerate() {
                let place = x0..x0 + CELL;
                let (fine, coarse) = (&fine.row(y0 + row)[place.clone()], &coarse.row(y0 + row)[place]);
                values.iter_mut().zip(fine.iter().zip(coarse)).for_each(|(v, (f, c))| *v = f - c);
            }
            let length = values.iter().map(|v| v * v).sum::<f32>().sqrt();
            let centre = |from: usize| ((from + CELL / 2) * pixel_px) as f64;
            let reach = (CELL / 2 * pixel_px) as f64;
            *is_seen = length > MIN_DETAIL * CELL as f32 && image.used_about(centre(x0), centre(y0), reach) >= 1.0;
            let scale = if *is_seen { 1.0 / length } else { 0.0 };
            values.iter_mut().for_each(|v| *v *= scale);
        }
        Self { grid, values, is_seen }
    }
}

/// Cells that have detail in all images, but for the exceptions.
fn with_detail(all: &[Detail]) -> Vec<bool> {
    let needed = all.len() - all.len() / IMAGES_PER_EXCEPTION;
    (0..all[0].is_seen.len()).map(|cell| all.iter().filter(|d| d.is_seen[cell]).count() >= needed).collect()
}

/// Cells in which each image, but for the exceptions, looks as the others do. None, if an image looks otherwise in most of them: it is of
/// another scene or attitude, and then nothing stands still in all.
fn standing(all: &[Detail], seen: &[bool], grid: Grid) -> Vec<bool> {
    let n = all.len();
    let mut sums = vec![0.0f32; all[0].values.len()];
    for detail in all {
        sums.iter_mut().zip(&detail.values).for_each(|(s, v)| *s += v);
    }
    let agreeing = |detail: &Detail| -> Vec<bool> {
        let of_cell = |cell: usize| {
            let place = cell * AREA..(cell + 1) * AREA;
            let products = sums[place.clone()].iter().zip(&detail.values[place]).map(|(s, z)| z * (s - z));
            if seen[cell] { products.sum::<f32>() / (n - 1) as f32 } else { 0.0 }
        };
        let single: Vec<f32> = (0..seen.len()).map(of_cell).collect();
        let agrees = |cell: usize| {
            let (sum, count) =
                grid.about(cell).filter(|&c| seen[c]).fold((0.0, 0), |(sum, count), c| (sum + single[c], count + 1));
            seen[cell] && sum >= MIN_CORRELATION * count as f32
        };
        (0..seen.len()).map(agrees).collect()
    };
    let agreeing: Vec<Vec<bool>> = all.par_iter().map(agreeing).collect();
    let needed = n - n / IMAGES_PER_EXCEPTION;
    let still: Vec<bool> = (0..seen.len()).map(|cell| agreeing.iter().filter(|a| a[cell]).count() >= needed).collect();
    let count = still.iter().filter(|s| **s).count();
    let in_all = agreeing
        .iter()
        .all(|a| 2 * a.iter().zip(&still).filter(|(agrees, still)| **agrees && **still).count() >= count);
    if in_all { still } else { vec![false; seen.len()] }
}

/// The connected parts of which at least half, and [`MIN_CELLS`], are more than edges.
fn with_corners(still: Vec<bool>, all: &[Detail], grid: Grid) -> Vec<bool> {
    let (mut open, mut kept) = (still.clone(), vec![false; still.len()]);
    for first in 0..still.len() {
        if !open[first] {
            continue;
        }
        open[first] = false;
        let mut part = vec![first];
        let mut next = 0;
        while let Some(&cell) = part.get(next) {
            next += 1;
            for near in grid.about(cell) {
                if std::mem::take(&mut open[near]) {
                    part.push(near);
                }
            }
        }
        let corners = part.iter().filter(|&&cell| is_corner(all, cell, grid)).count();
        if corners >= MIN_CELLS && 2 * corners >= part.len() {
            part.iter().for_each(|&cell| kept[cell] = true);
        }
    }
    kept
}

/// Whether what the images have in common about a cell has detail in more than one direction (the test of edges of features, Lowe 2004,
/// of the structure tensor).
fn is_corner(all: &[Detail], cell: usize, grid: Grid) -> bool {
    let mut tensor = [0.0f32; 3];
    for cell in grid.about(cell) {
        let common = |i: usize| all.iter().map(|detail| detail.values[cell * AREA + i]).sum::<f32>();
        let values: [f32; AREA] = std::array::from_fn(common);
        for i in (0..AREA - CELL).filter(|i| i % CELL < CELL - 1) {
            let (gx, gy) = (values[i + 1] - values[i], values[i + CELL] - values[i]);
            tensor = [tensor[0] + gx * gx, tensor[1] + gx * gy, tensor[2] + gy * gy];
        }
    }
    let [xx, xy, yy] = tensor;
    (xx * yy - xy * xy) * (EDGE_RATIO + 1.0).powi(2) > EDGE_RATIO * (xx + yy).powi(2)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{geometry::size::ImageSize, observer::Silent};
    use rand::{RngExt, SeedableRng};

    const SIZE: ImageSize = ImageSize { width: 320, height: 240 };

    /// Blurred white noise: what moves is another in every image.
    fn texture(seed: u64) -> GrayImage {
        let mut rng = rand_pcg::Pcg64Mcg::seed_from_u64(seed);
        let white = (0..SIZE.width * SIZE.height).map(|_| rng.random_range(0.0..1.0)).collect();
        let mut image = blur(&GrayImage::from_rows(SIZE, white).expect("right size"), 1.5);
        image.data_mut().iter_mut().for_each(|v| *v = 0.5 + 3.0 * (*v - 0.5));
        image
    }

    /// Images of `moving` textures with `still` where `is_still` says, at another exposure each, with a noise of a percent.
    fn images(count: u64, still: &GrayImage, is_still: impl Fn(u64, usize, usize) -> bool) -> Vec<GrayImage> {
        let one = |i: u64| {
            let mut image = texture(100 + i);
            let mut rng = rand_pcg::Pcg64Mcg::seed_from_u64(1000 + i);
            for y in 0..SIZE.height {
                for x in 0..SIZE.width {
                    let value = &mut image.data_mut()[y * SIZE.width + x];
                    if is_still(i, x, y) {
                        *value = (1.0 - 0.03 * i as f32) * still.get(x, y) + 0.01 * i as f32;
                    }
                    *value += rng.random_range(-0.017..0.017);
                }
            }
            image
        };
        (0..count).map(one).collect()
    }

    fn found(images: &[GrayImage]) -> Option<StillParts> {
        still_parts(images, &Silent).expect("not stopped")
    }

    #[test]
    fn a_bumper_is_found_and_masked_in_all() {
        for count in [3, 4, 12, 30] {
            let all = images(count, &texture(1), |_, _, y| y >= 180);
            let parts = found(&all).expect("something stands still");
            assert!((parts.share - 0.25).abs() < 0.05, "{}", parts.share);
            for image in &parts.set_aside(&all).expect("one size") {
                let mask = image.mask().expect("a mask");
                let (above, below) = (mask.share(160.0, 80.0, 300.0), mask.share(160.0, 215.0, 30.0));
                assert!(mask.share(160.0, 80.0, 80.0) > 0.99 && below < 0.01, "{above} {below}");
            }
        }
    }

    #[test]
    fn who_passes_by_in_one_of_many_does_not_hide_it() {
        // In each image something else in front of another part of it.
        let all = images(20, &texture(1), |i, x, y| y >= 120 && !(16 * i as usize..16 * i as usize + 16).contains(&x));
        let parts = found(&all).expect("something stands still");
        assert!((parts.share - 0.5).abs() < 0.06, "{}", parts.share);
    }

    #[test]
    fn where_nothing_or_everything_stands_still_nothing_is_masked() {
        assert_eq!(found(&images(10, &texture(1), |_, _, _| false)), None);
        assert_eq!(found(&images(10, &texture(1), |_, _, _| true)), None);
        // Two of three of one attitude, and all but one of five.
        assert_eq!(found(&images(3, &texture(1), |i, _, _| i < 2)), None);
        assert_eq!(found(&images(5, &texture(1), |i, _, _| i < 4)), None);
        assert_eq!(found(&images(2, &texture(1), |_, _, y| y >= 180)), None, "left to the pair");
        assert_eq!(found(&[]), None);
    }

    #[test]
    fn an_edge_that_lies_where_it_lay_is_no_still_thing() {
        // A horizon: bright sky over moving floor.
        let sky = GrayImage::filled(SIZE, 1.2);
        assert_eq!(found(&images(10, &sky, |_, _, y| y < 83)), None);
    }

    #[test]
    fn what_is_masked_already_is_not_looked_at() {
        let used: Vec<bool> = (0..SIZE.width * SIZE.height).map(|i| i / SIZE.width < 180).collect();
        let mask = Arc::new(Mask::new(SIZE, &used).expect("right size"));
        let all = images(10, &texture(1), |_, _, y| y >= 180);
        let masked: Vec<GrayImage> = all.into_iter().map(|i| i.masked(Arc::clone(&mask)).expect("one size")).collect();
        assert_eq!(found(&masked), None);
    }
}
