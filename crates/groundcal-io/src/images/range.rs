//! Which stored values are black and white: 0 and 1 of grey values.
//!
//! 8 bits fill their type. In 16 bits there may be 10 (industrial cameras), 8 (converted) or a few hundred counts far from zero
//! (thermal cameras); floating point may run from 0 to 1, to 255 or anywhere. Features are found by contrast, so that the same
//! picture must not depend on the type that holds it. One range serves all images of a run: light that changes from one to the next
//! is not evened out.
//!
//! Of all values, let lo and hi be the 0.1 % and the 99.9 % point. White is the largest number with as many bits as the greatest
//! value; where lo..hi is less than an eighth of that, lo..hi itself is the range, a twentieth wider on both sides.

use crate::{
    images::{
        array::Pixels,
        stored::{Samples, StoredImage},
    },
    note::Note,
};

/// Values taken of an image to learn its range.
const SAMPLES: usize = 8_000;
/// Part of the values left out at each end.
const TAIL: f64 = 0.001;
/// Part of the range that values must use.
const MIN_PART: f64 = 0.125;
/// Part of lo..hi added on both sides.
const MARGIN: f64 = 0.05;

/// What types of number there are, as far as their ranges differ.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Kind {
    /// 16 bits.
    Integer,
    /// Anything wider.
    Float,
}

/// The stored values that become 0 and 1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ValueRange {
    /// Black.
    pub black: f64,
    /// White.
    pub white: f64,
}

impl ValueRange {
    /// The range of the type.
    pub(crate) fn of_type(kind: Kind) -> Self {
        match kind {
            Kind::Integer => Self { black: 0.0, white: 65535.0 },
            Kind::Float => Self { black: 0.0, white: 1.0 },
        }
    }

    /// A stored value as a grey value.
    pub(crate) fn grey(&self, value: f64) -> f64 {
        (value - self.black) / (self.white - self.black)
    }
}

/// The kind whose range has to be found; nothing for 8 bits.
pub(crate) fn kind(image: &StoredImage) -> Option<Kind> {
    match image.samples {
        Samples::U8(_) => None,
        Samples::U16(_) => Some(Kind::Integer),
        Samples::F32(_) => Some(Kind::Float),
    }
}

/// The same of samples.
pub(crate) fn kind_of_pixels(pixels: Pixels) -> Option<Kind> {
    match pixels {
        Pixels::U8(_) => None,
        Pixels::U16(_) => Some(Kind::Integer),
        Pixels::F32(_) => Some(Kind::Float),
    }
}

/// Some values of the images of a run, alpha left out, and the greatest of all.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct Values {
    some: Vec<f32>,
    greatest: f64,
}

impl Values {
    /// Of one image.
    pub(crate) fn of(image: &StoredImage) -> Self {
        let pixels = match &image.samples {
            Samples::U8(data) => Pixels::U8(data),
            Samples::U16(data) => Pixels::U16(data),
            Samples::F32(data) => Pixels::F32(data),
        };
        Self::of_pixels(pixels, image.channels)
    }

    /// Of samples with so many channels.
    pub(crate) fn of_pixels(pixels: Pixels, channels: usize) -> Self {
        fn taken<T: Copy>(data: &[T], channels: usize, value: impl Fn(T) -> f32) -> Values {
            let colours = if channels <= 2 { 1 } else { 3 };
            let pixels = data.len() / channels.max(1);
            // A stride without a common divisor with the usual sides.
            let stride = (pixels / SAMPLES).max(1) | 1;
            let pixel = |p: &[T]| p[..colours].iter().map(|v| value(*v)).fold(f32::MIN, f32::max);
            let greatest = data.chunks_exact(channels).map(pixel).fold(f32::MIN, f32::max);
            let some = data.chunks_exact(channels).step_by(stride).flat_map(|p| p[..colours].iter().map(|v| value(*v)));
            Values { some: some.collect(), greatest: f64::from(greatest) }
        }
        match pixels {
            Pixels::U8(data) => taken(data, channels, f32::from),
            Pixels::U16(data) => taken(data, channels, f32::from),
            Pixels::F32(data) => taken(data, channels, |v| v),
        }
    }

    /// With those of another image.
    pub(crate) fn join(mut self, other: Values) -> Self {
        self.greatest = if self.some.is_empty() { other.greatest } else { self.greatest.max(other.greatest) };
        self.some.extend(other.some);
        self
    }

    /// The range of all.
    pub(crate) fn range(mut self, kind: Kind) -> ValueRange {
        if self.some.is_empty() {
            return ValueRange::of_type(kind);
        }
        self.some.sort_by(f32::total_cmp);
        let at = |part: f64| f64::from(self.some[(part * (self.some.len() - 1) as f64).round() as usize]);
        let (lo, hi) = (at(TAIL), at(1.0 - TAIL));
        let white = match kind {
            Kind::Float if hi <= 1.0 => 1.0,
            _ => ((self.greatest.max(1.0) + 1.0).log2().ceil().exp2() - 1.0).max(255.0),
        };
        // An image of one value has no range to stretch.
        if hi > lo && (lo < -MARGIN * (hi - lo) || hi - lo < MIN_PART * white) {
            let margin = MARGIN * (hi - lo);
            return ValueRange { black: lo - margin, white: hi + margin };
        }
        ValueRange { black: 0.0, white }
    }
}

/// Collects the values of the images of a run.
#[derive(Debug, Default)]
pub(crate) struct Ranges {
    integer: Option<Values>,
    float: Option<Values>,
}

impl Ranges {
    /// With those of another image.
    pub(crate) fn add(&mut self, kind: Option<Kind>, values: Values) {
        let of = match kind {
            None => return,
            Some(Kind::Integer) => &mut self.integer,
            Some(Kind::Float) => &mut self.float,
        };
        *of = Some(match of.take() {
            Some(known) => known.join(values),
            None => values,
        });
    }

    /// The ranges of all.
    pub(crate) fn found(self) -> ValueRanges {
        ValueRanges {
            integer: self.integer.map(|v| v.range(Kind::Integer)),
            float: self.float.map(|v| v.range(Kind::Float)),
        }
    }
}

/// The ranges of a run's images, by type of number; nothing where there was none of the type.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct ValueRanges {
    /// Of 16-bit images.
    pub integer: Option<ValueRange>,
    /// Of images of wider numbers.
    pub float: Option<ValueRange>,
}

impl ValueRanges {
    pub(crate) fn of(&self, kind: Kind) -> ValueRange {
        let found = match kind {
            Kind::Integer => self.integer,
            Kind::Float => self.float,
        };
        found.unwrap_or(ValueRange::of_type(kind))
    }

    /// What to say of ranges that are not those of the types.
    pub(crate) fn notes(&self) -> Vec<Note> {
        let note = |kind: Kind, values: &str| {
            let range = self.of(kind);
            let text = format!(
                "{values} are taken as grey from {} (black) to {} (white), the range that the images use together",
                short(range.black),
                short(range.white)
            );
            (range != ValueRange::of_type(kind)).then(|| Note::all(Note::VALUE_RANGE, text))
        };
        [note(Kind::Integer, "16-bit values"), note(Kind::Float, "values of float or wide integer images")]
            .into_iter()
            .flatten()
            .collect()
    }
}

/// A number for a sentence.
fn short(value: f64) -> String {
    if value.abs() < 1e6 && (value.fract() == 0.0 || value.abs() >= 1000.0) {
        format!("{value:.0}")
    } else {
        format!("{value:.3e}")
    }
}

#[cfg(test)]
mod tests {
    use groundcal::geometry::ImageSize;

    use super::*;

    fn range(values: impl Fn(usize) -> f32, kind: Kind) -> ValueRange {
        let data: Vec<f32> = (0..10_000).map(values).collect();
        let samples = match kind {
            Kind::Integer => Samples::U16(data.iter().map(|v| *v as u16).collect()),
            Kind::Float => Samples::F32(data),
        };
        let image = StoredImage {
            size: ImageSize::new(100, 100),
            channels: 1,
            samples,
            is_tiff: false,
            is_exact: true,
            sound: None,
            notes: Vec::new(),
        };
        Values::default().join(Values::of(&image)).range(kind)
    }

    #[test]
    fn ranges_are_those_that_values_use() {
        use Kind::{Float, Integer};
        let ramp = |from: f32, to: f32| move |i: usize| from + (to - from) * i as f32 / 9999.0;
        let whites = [
            (65535.0, range(ramp(0.0, 60_000.0), Integer)),
            (1023.0, range(ramp(10.0, 1023.0), Integer)),
            (4095.0, range(ramp(10.0, 3000.0), Integer)),
            (255.0, range(ramp(0.0, 255.0), Integer)),
            (255.0, range(ramp(0.0, 90.0), Integer)),
            (1.0, range(ramp(0.0, 1.0), Float)),
            (1.0, range(ramp(0.1, 0.4), Float)),
            (255.0, range(ramp(0.0, 254.5), Float)),
            (65535.0, range(ramp(0.0, 50_000.0), Float)),
        ];
        for (white, found) in whites {
            assert_eq!(found, ValueRange { black: 0.0, white });
        }
        // Thermal counts, temperatures, and light against darkness.
        for (lo, hi, kind) in [(7000.0, 7400.0, Integer), (-20.0, 35.0, Float), (29_000.0, 30_500.0, Integer)] {
            let found = range(ramp(lo, hi), kind);
            let spread = f64::from(hi - lo);
            assert!((found.black - (f64::from(lo) - 0.05 * spread)).abs() < 0.01 * spread, "{found:?}");
            assert!((found.white - (f64::from(hi) + 0.05 * spread)).abs() < 0.01 * spread, "{found:?}");
        }
        // One lamp does not hide the floor.
        let lamp = range(|i| if i == 5000 { 65535.0 } else { ramp(2000.0, 4000.0)(i) }, Integer);
        assert!(lamp.white < 4200.0, "{lamp:?}");
        assert_eq!(range(|_| 700.0, Integer).black, 0.0);
    }
}
