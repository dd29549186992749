//! Resampling of pictures through a map from target to source pixels, in their own depth ([`Depth`]).
//!
//! A target pixel is the mean of bilinear samples over the parallelogram that it covers in the source, spanned by the columns of
//! the map's derivative J. Samples lie one source pixel apart; where the parallelogram's narrow side is wider than two, they
//! are taken from a copy halved so often that it is not (a pyramid of 2 x 2 means), so that nothing aliases whatever the
//! scale. Rows run in parallel and depend on nothing but their place: the result is the same for any number of threads.

use nalgebra::{Matrix2, Vector2};
use rayon::prelude::*;

use crate::geometry::size::ImageSize;

/// Samples along one side of the parallelogram at most.
const MAX_SAMPLES: usize = 32;
/// Length of a side up to which one sample does: undistorting stays plain bilinear interpolation.
const ONE_SAMPLE: f64 = 1.25;

/// Most channels of a picture.
pub(crate) const MAX_CHANNELS: usize = 4;

/// A kind of number that samples are.
pub trait Depth: Copy + Default + Send + Sync + PartialEq + std::fmt::Debug {
    /// As single precision, which holds 16 bits exactly.
    fn to_f32(self) -> f32;
    /// The nearest that there is; what is not a number is 0 in integers.
    fn nearest(value: f32) -> Self;
}

impl Depth for u8 {
    fn to_f32(self) -> f32 {
        f32::from(self)
    }
    fn nearest(value: f32) -> Self {
        rounded(value)
    }
}

impl Depth for u16 {
    fn to_f32(self) -> f32 {
        f32::from(self)
    }
    fn nearest(value: f32) -> Self {
        // A cast saturates, and what is not a number becomes 0.
        (value + 0.5) as u16
    }
}

impl Depth for f32 {
    fn to_f32(self) -> f32 {
        self
    }
    fn nearest(value: f32) -> Self {
        value
    }
}

/// A picture, row by row, the channels of a pixel side by side.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Raster<T = u8> {
    size: ImageSize,
    channels: usize,
    data: Vec<T>,
}

impl<T: Depth> Raster<T> {
    /// A picture from its rows; `None` when the data do not have width times height times channels (1 to 4) values.
    pub fn from_rows(size: ImageSize, channels: usize, data: Vec<T>) -> Option<Self> {
        let right = (1..=MAX_CHANNELS).contains(&channels) && data.len() == size.width * size.height * channels;
        (right && !data.is_empty()).then_some(Self { size, channels, data })
    }

    /// Width and height.
    pub fn size(&self) -> ImageSize {
        self.size
    }

    /// Values a pixel.
    pub fn channels(&self) -> usize {
        self.channels
    }

    /// All values.
    pub fn data(&self) -> &[T] {
        &self.data
    }

    /// The values of a pixel.
    #[cfg(test)]
    pub(crate) fn pixel(&self, x: usize, y: usize) -> &[T] {
        let at = (y * self.size.width + x) * self.channels;
        &self.data[at..at + self.channels]
    }

    /// Means of 2 x 2 pixels; a last odd column or row counts twice.
    fn halved(&self) -> Self {
        let (w, h, c) = (self.size.width, self.size.height, self.channels);
        let size = ImageSize::new(w.div_ceil(2), h.div_ceil(2));
        let mut data = vec![T::default(); size.width * size.height * c];
        data.par_chunks_exact_mut(size.width * c).enumerate().for_each(|(y, row)| {
            let (top, bottom) = (2 * y, (2 * y + 1).min(h - 1));
            for x in 0..size.width {
                let (left, right) = (2 * x, (2 * x + 1).min(w - 1));
                for k in 0..c {
                    let sum: f32 = [(left, top), (right, top), (left, bottom), (right, bottom)]
                        .iter()
                        .map(|(x, y)| self.data[(y * w + x) * c + k].to_f32())
                        .sum();
                    row[x * c + k] = T::nearest(0.25 * sum);
                }
            }
        });
        Self { size, channels: c, data }
    }

    /// Adds `weight` times the bilinear sample at a pixel; beyond the border the border's pixels go on.
    fn add_bilinear(&self, at: &Vector2<f64>, weight: f32, sum: &mut [f32; MAX_CHANNELS]) {
        let (w, h, c) = (self.size.width, self.size.height, self.channels);
        let x = at.x.clamp(0.0, (w - 1) as f64);
        let y = at.y.clamp(0.0, (h - 1) as f64);
        let (left, top) = (x as usize, y as usize);
        let (right, bottom) = ((left + 1).min(w - 1), (top + 1).min(h - 1));
        let (u, v) = ((x - left as f64) as f32, (y - top as f64) as f32);
        let corners = [
            (left, top, (1.0 - u) * (1.0 - v)),
            (right, top, u * (1.0 - v)),
            (left, bottom, (1.0 - u) * v),
            (right, bottom, u * v),
        ];
        // A pixel that is not a number spoils its neighbours only where it takes part.
        for (x, y, part) in corners.into_iter().filter(|c| c.2 > 0.0) {
            let from = (y * w + x) * c;
            for (s, value) in sum.iter_mut().zip(&self.data[from..from + c]) {
                *s += weight * part * value.to_f32();
            }
        }
    }
}

/// Its values, without a copy.
impl<T> From<Raster<T>> for Vec<T> {
    fn from(picture: Raster<T>) -> Self {
        picture.data
    }
}

/// A picture with copies halved again and again.
#[derive(Debug, Clone)]
pub struct Pyramid<T = u8> {
    levels: Vec<Raster<T>>,
}

/// What a target pixel is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Sample {
    /// Mean of the source over the pixel; as many values as the source has channels count.
    pub value: [f32; MAX_CHANNELS],
    /// How much of the pixel lies inside the source, 0 to 1: the border's edge without steps.
    pub coverage: f32,
    /// Where its centre lies in the source, pixels.
    pub source: Vector2<f64>,
    /// Source pixels a target pixel in area: |det J|.
    pub area: f64,
}

impl<T: Depth> Pyramid<T> {
    /// Of a picture.
    pub fn new(picture: Raster<T>) -> Self {
        let mut levels = vec![picture];
        while let Some(last) = levels.last()
            && last.size.width.min(last.size.height) > 2
        {
            let next = last.halved();
            levels.push(next);
        }
        Self { levels }
    }

    /// The picture.
    pub(crate) fn picture(&self) -> &Raster<T> {
        &self.levels[0]
    }

    /// The target pixel that lies at `source` and whose neighbours to the right and below lie at the columns of `jacobian` from it;
    /// `None` outside the source.
    pub(crate) fn sample(&self, source: &Vector2<f64>, jacobian: &Matrix2<f64>) -> Option<Sample> {
        let picture = &self.levels[0];
        let size = [picture.size.width as f64, picture.size.height as f64];
        // Along each axis of the source how far inside, in units of the pixel's extent there.
        let inside = |i: usize| {
            let extent = (jacobian[(i, 0)].abs() + jacobian[(i, 1)].abs()).max(1.0);
            let room = (source[i] + 0.5).min(size[i] - 0.5 - source[i]);
            (room / extent + 0.5).clamp(0.0, 1.0)
        };
        let coverage = (inside(0) * inside(1)) as f32;
        if !(coverage > 0.0 && source.x.is_finite() && source.y.is_finite()) {
            return None;
        }
        let sides = [0, 1].map(|i| jacobian.column(i).norm());
        let area = jacobian.determinant().abs();
        // Width across the longer side, at least a pixel.
        let narrow = area / sides[0].max(sides[1]).max(1e-12);
        let level = (narrow.max(1.0).log2() as usize).min(self.levels.len() - 1);
        let scale = (1u64 << level) as f64;
        let counts = sides.map(|s| {
            let length = s / scale;
            if length <= ONE_SAMPLE { 1 } else { (length.ceil() as usize).min(MAX_SAMPLES) }
        });
        let weight = 1.0 / (counts[0] * counts[1]) as f32;
        let mut value = [0.0; MAX_CHANNELS];
        for j in 0..counts[1] {
            for i in 0..counts[0] {
                let at = |k: usize, n: usize| (k as f64 + 0.5) / n as f64 - 0.5;
                let offset = jacobian * Vector2::new(at(i, counts[0]), at(j, counts[1]));
                // The centre of a halved image's first pixel lies between the first two of the whole one.
                let p = (source + offset).map(|v| (v + 0.5) / scale - 0.5);
                self.levels[level].add_bilinear(&p, weight, &mut value);
            }
        }
        Some(Sample { value, coverage, source: *source, area })
    }
}

/// Calls `put(x, sample, values)` for each target pixel that the source covers; `target` has `stride` values a pixel.
///
/// `map` gives the source pixel of a target pixel, `None` where there is none.
pub(crate) fn resample_into<T: Send, S: Depth>(
    source: &Pyramid<S>,
    size: ImageSize,
    target: &mut [T],
    stride: usize,
    map: impl Fn(&Vector2<f64>) -> Option<Vector2<f64>> + Sync,
    put: impl Fn(usize, usize, &Sample, &mut [T]) + Sync,
) {
    if size.width == 0 || stride == 0 {
        return;
    }
    target.par_chunks_exact_mut(size.width * stride).take(size.height).enumerate().for_each(|(y, row)| {
        // One column and one row more, for the derivative.
        let line = |y: f64| -> Vec<Option<Vector2<f64>>> {
            (0..=size.width).map(|x| map(&Vector2::new(x as f64, y))).collect()
        };
        let (here, below) = (line(y as f64), line(y as f64 + 1.0));
        for x in 0..size.width {
            let Some(at) = here[x] else { continue };
            let before = |x: f64, y: f64| map(&Vector2::new(x, y)).map(|p| at - p);
            let (x_f, y_f) = (x as f64, y as f64);
            // Where there is no neighbour after it, the one before it tells.
            let Some(right) = here[x + 1].map(|p| p - at).or_else(|| before(x_f - 1.0, y_f)) else { continue };
            let Some(down) = below[x].map(|p| p - at).or_else(|| before(x_f, y_f - 1.0)) else { continue };
            if let Some(sample) = source.sample(&at, &Matrix2::from_columns(&[right, down])) {
                put(x, y, &sample, &mut row[x * stride..(x + 1) * stride]);
            }
        }
    });
}

/// A resampled picture.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Resampled<T = u8> {
    /// The picture; zero where the source does not reach.
    pub picture: Raster<T>,
    /// How much of each pixel the source covers, 0 to 255: an alpha channel.
    pub coverage: Vec<u8>,
}

impl<T: Depth> Resampled<T> {
    /// From values and coverage (0 to 255) side by side; `size` times `channels + 1` values.
    pub(crate) fn from_interleaved(size: ImageSize, channels: usize, both: &[T]) -> Self {
        let coverage = both.iter().skip(channels).step_by(channels + 1).map(|c| rounded(c.to_f32())).collect();
        let data = both.chunks_exact(channels + 1).flat_map(|p| p[..channels].iter().copied()).collect();
        Self { picture: Raster { size, channels, data }, coverage }
    }
}

/// The source as seen through a map from target to source pixels; see `resample_into`. `size` must not be empty.
pub fn resample<T: Depth>(
    source: &Pyramid<T>,
    size: ImageSize,
    map: impl Fn(&Vector2<f64>) -> Option<Vector2<f64>> + Sync,
) -> Resampled<T> {
    let channels = source.picture().channels;
    let mut both = vec![T::default(); size.width * size.height * (channels + 1)];
    resample_into(source, size, &mut both, channels + 1, map, |_, _, sample, out| {
        for (o, v) in out.iter_mut().zip(&sample.value[..channels]) {
            *o = T::nearest(*v);
        }
        // Of the values that every depth has.
        out[channels] = T::nearest(f32::from(rounded(255.0 * sample.coverage)));
    });
    Resampled::from_interleaved(size, channels, &both)
}

/// The nearest 8-bit value.
pub(crate) fn rounded(value: f32) -> u8 {
    // A cast saturates, and what is not a number becomes 0.
    (value + 0.5) as u8
}

#[cfg(test)]
mod tests {
    use super::*;

    fn picture(size: ImageSize, value: impl Fn(f64, f64) -> f64) -> Pyramid {
        let data = (0..size.width * size.height)
            .map(|i| rounded(value((i % size.width) as f64, (i / size.width) as f64) as f32))
            .collect();
        Pyramid::new(Raster::from_rows(size, 1, data).unwrap())
    }

    #[test]
    fn the_identity_changes_nothing() {
        let size = ImageSize::new(31, 17);
        let source = picture(size, |x, y| (37.0 * x + 91.0 * y) % 256.0);
        let out = resample(&source, size, |p| Some(*p));
        assert_eq!(&out.picture, source.picture());
        assert!(out.coverage.iter().all(|c| *c == 255));
    }

    #[test]
    fn a_linear_picture_stays_linear_under_shift_and_scale() {
        let source = picture(ImageSize::new(200, 160), |x, y| 20.0 + 0.7 * x + 0.4 * y);
        for scale in [0.3, 1.0, 1.7, 4.0] {
            let map = |p: &Vector2<f64>| Some(p * scale + Vector2::new(11.3, 7.6));
            let out = resample(&source, ImageSize::new(30, 30), map);
            for y in 0..30 {
                for x in 0..30 {
                    let at = map(&Vector2::new(x as f64, y as f64)).unwrap();
                    let expected = 20.0 + 0.7 * at.x + 0.4 * at.y;
                    // Rounding of the source, of its halved copies and of the result.
                    let error = f64::from(out.picture.pixel(x, y)[0]) - expected;
                    assert!(error.abs() <= 1.6, "scale {scale} at {x} {y}: {error}");
                }
            }
        }
    }

    #[test]
    fn nothing_aliases_where_the_target_is_coarser() {
        // Stripes of one pixel: any plain interpolation at an odd step turns them into a coarse pattern.
        let source = picture(ImageSize::new(1200, 900), |x, _| if x % 2.0 < 1.0 { 0.0 } else { 255.0 });
        for (across, along) in [(5.3, 1.0), (7.7, 7.7), (1.0, 6.0), (40.1, 3.0)] {
            let size = ImageSize::new(28, 28);
            let map = |p: &Vector2<f64>| Some(Vector2::new(p.x * across + 3.0, p.y * along + 5.0));
            let stripes = resample(&source, size, map);
            let values: Vec<f64> = stripes.picture.data().iter().map(|v| f64::from(*v)).collect();
            let spread = values.iter().fold(0.0f64, |m, v| m.max((v - 127.5).abs()));
            if across > 2.0 {
                assert!(spread < 26.0, "{across} x {along}: {spread}");
            } else {
                assert!(spread > 127.0, "along the stripes they stay: {spread}");
            }
        }
    }

    #[test]
    fn the_border_has_soft_edges_and_outside_is_nothing() {
        let source = picture(ImageSize::new(20, 20), |_, _| 200.0);
        let out = resample(&source, ImageSize::new(30, 30), |p| Some(p - Vector2::new(5.25, 5.0)));
        assert_eq!(out.coverage[0], 0);
        assert_eq!(out.coverage[15 * 30 + 15], 255);
        assert_eq!(out.picture.pixel(15, 15), [200]);
        let edge = out.coverage[15 * 30 + 5];
        assert!(edge > 180 && edge < 200, "three quarters: {edge}");
        assert_eq!(resample(&source, ImageSize::new(3, 3), |_| None).coverage, vec![0; 9]);
    }

    #[test]
    fn samples_keep_their_depth() {
        let size = ImageSize::new(120, 80);
        let exact = |p: &Vector2<f64>| 1000.0 + 301.3 * p.x + 97.7 * p.y;
        let at = |i: usize| exact(&Vector2::new((i % 120) as f64, (i / 120) as f64));
        let map = |p: &Vector2<f64>| Some(p * 0.6 + Vector2::new(7.3, 5.8));
        let target = ImageSize::new(60, 50);
        let sixteen = Raster::from_rows(size, 1, (0..9600).map(|i| at(i).round() as u16).collect()).unwrap();
        let float = Raster::from_rows(size, 1, (0..9600).map(|i| (at(i) / 65536.0 - 0.5) as f32).collect()).unwrap();
        let (a, b) = (resample(&Pyramid::new(sixteen), target, map), resample(&Pyramid::new(float), target, map));
        assert!(a.coverage.iter().chain(&b.coverage).all(|c| *c == 255));
        let mut levels = std::collections::BTreeSet::new();
        for y in 0..50 {
            for x in 0..60 {
                let expected = exact(&map(&Vector2::new(x as f64, y as f64)).unwrap());
                let (found, float) = (a.picture.pixel(x, y)[0], b.picture.pixel(x, y)[0]);
                // Rounding of the source and of the result; single precision.
                assert!((f64::from(found) - expected).abs() <= 1.0, "{found} {expected}");
                assert!((f64::from(float) - (expected / 65536.0 - 0.5)).abs() < 1e-6, "{float} {expected}");
                levels.insert(found);
            }
        }
        assert!(levels.len() > 2000, "{}", levels.len());
    }

    #[test]
    fn what_is_no_number_spoils_its_neighbours_alone() {
        let size = ImageSize::new(9, 9);
        let mut data = vec![0.5f32; 81];
        data[4 * 9 + 4] = f32::NAN;
        let source = Pyramid::new(Raster::from_rows(size, 1, data).unwrap());
        let spoilt = |shift: f64| {
            let out = resample(&source, size, |p| Some(p + Vector2::repeat(shift)));
            out.picture.data().iter().filter(|v| v.is_nan()).count()
        };
        assert_eq!((spoilt(0.0), spoilt(0.25)), (1, 4));
    }

    #[test]
    fn threads_do_not_matter() {
        let source = picture(ImageSize::new(90, 70), |x, y| (x * y) % 256.0);
        let map = |p: &Vector2<f64>| {
            let w = 1.0 + 0.02 * p.y;
            Some(Vector2::new((p.x + 3.0) / w * 1.3, (p.y + 1.0) / w * 2.1))
        };
        let with = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| resample(&source, ImageSize::new(80, 60), map))
        };
        assert_eq!(with(1), with(5));
    }
}
