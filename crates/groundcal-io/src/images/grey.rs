//! Luminance of stored samples.
//!
//! Weights of ITU-R BT.709 on the stored values, without undoing the gamma; alpha is ignored.

use crate::images::{
    array::{ArrayImage, Pixels},
    range::{Kind, ValueRange, ValueRanges},
    stored::{Samples, StoredImage},
};

/// Weights of red, green and blue.
const WEIGHTS: [f32; 3] = [0.2126, 0.7152, 0.0722];

/// Grey values of pixels; `full` is the sample that becomes 1.
fn mix<T: Copy + Into<f32>>(raw: &[T], channels: usize, [r, g, b]: [usize; 3], full: f32) -> Vec<f32> {
    let one = |v: T| -> f32 { v.into() / full };
    match channels {
        1 | 2 => raw.chunks_exact(channels).map(|p| one(p[0])).collect(),
        _ => raw
            .chunks_exact(channels)
            .map(|p| WEIGHTS[0] * one(p[r]) + WEIGHTS[1] * one(p[g]) + WEIGHTS[2] * one(p[b]))
            .collect(),
    }
}

/// Where red, green and blue are in a pixel of a file.
const RGB: [usize; 3] = [0, 1, 2];
const BGR: [usize; 3] = [2, 1, 0];

/// Grey values, black 0 and white 1 by the range of the type; [`in_range`] takes another.
pub(crate) fn grey(image: StoredImage) -> Vec<f32> {
    let channels = image.channels;
    match image.samples {
        Samples::U8(data) => mix(&data, channels, RGB, 255.0),
        Samples::U16(data) => mix(&data, channels, RGB, 65535.0),
        Samples::F32(data) if channels == 1 => data,
        Samples::F32(data) => mix(&data, channels, RGB, 1.0),
    }
}

/// The same of an array, which stays where it is.
pub(crate) fn grey_of_array(array: &ArrayImage) -> Vec<f32> {
    let order = if array.blue_first { BGR } else { RGB };
    match array.pixels {
        Pixels::U8(data) => mix(data, array.channels, order, 255.0),
        Pixels::U16(data) => mix(data, array.channels, order, 65535.0),
        Pixels::F32(data) => mix(data, array.channels, order, 1.0),
    }
}

/// Grey values of a type's own range in that of the images of a run. What lies far beyond black and white is cut.
pub(crate) fn in_range(grey: &mut [f32], kind: Option<Kind>, ranges: &ValueRanges) {
    let Some(kind) = kind else { return };
    let (of_type, range) = (ValueRange::of_type(kind), ranges.of(kind));
    if range == of_type {
        return;
    }
    let scale = (of_type.white / (range.white - range.black)) as f32;
    let shift = range.grey(0.0) as f32;
    for value in grey {
        *value = (*value * scale + shift).clamp(-1.0, 2.0);
    }
}
