//! Which pictures of a floor are made: views that share one, its grid, and the resolution of all.
//!
//! The resolution is that of the images' median pixel on the floor ([`source_resolution`]), as 1, 2 or 5 times a power of ten, lowered
//! where a picture would have more than [`MAX_PIXELS`].

use std::{collections::HashMap, hash::Hash};

use nalgebra::Vector2;

use crate::{
    floor::{
        rectify::source_resolution,
        view::{FloorGrid, FloorView},
    },
    geometry::size::ImageSize,
};

/// Camera heights to which the floor is shown where nothing is said.
pub const DEFAULT_EXTENT_HEIGHTS: f64 = 5.0;
/// Most pixels of one picture.
pub(crate) const MAX_PIXELS: u64 = 100_000_000;

/// Which way is up in a picture of the floor.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Up {
    /// The way the camera looks; of several views the first.
    Heading,
    /// +Y of the world, +X to the right.
    Y,
}

/// What all pictures of a floor have in common.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FloorLayout {
    /// Size of the images.
    pub size: ImageSize,
    /// How far from the point below each camera the floor is shown, units of the floor.
    pub max_distance: f64,
    /// Which way is up.
    pub up: Up,
}

/// Pixels for a unit of length.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Resolution {
    /// What is to be taken.
    pub px_per_unit: f64,
    /// What the images have, where that makes too large a picture.
    pub lowered_from: Option<f64>,
    /// The most pixels that a picture may have.
    pub most_pixels: u64,
}

/// Why there is no resolution.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ResolutionError {
    /// No view sees floor so near.
    NoFloor,
    /// A picture of the resolution asked for would be too large.
    TooLarge {
        /// Its pixels.
        pixels: u64,
        /// The most that a picture may have.
        most_pixels: u64,
        /// A resolution that fits.
        fits_px_per_unit: f64,
    },
}

/// Indices of the views that share a world, in the order of the first of each.
pub fn sets_of_one_world<T: Eq + Hash>(worlds: &[T]) -> Vec<Vec<usize>> {
    let mut sets: Vec<Vec<usize>> = Vec::new();
    let mut set_of: HashMap<&T, usize> = HashMap::new();
    for (i, world) in worlds.iter().enumerate() {
        let set = *set_of.entry(world).or_insert(sets.len());
        match sets.get_mut(set) {
            Some(set) => set.push(i),
            None => sets.push(vec![i]),
        }
    }
    sets
}

impl FloorLayout {
    /// Unit vector of a picture's rows on the floor, to the right.
    fn right(&self, first: &FloorView) -> Vector2<f64> {
        match self.up {
            Up::Y => Vector2::x(),
            Up::Heading => {
                let heading = first.heading();
                Vector2::new(heading.y, -heading.x)
            }
        }
    }

    /// Outlines of the floor that a set sees, one after the other.
    fn seen(&self, set: &[&FloorView]) -> Vec<Vector2<f64>> {
        set.iter().flat_map(|view| view.seen_floor(self.size, self.max_distance)).collect()
    }

    /// The grid of the picture of a set; `None` where it sees no floor.
    pub fn grid(&self, set: &[&FloorView], px_per_unit: f64) -> Option<FloorGrid> {
        FloorGrid::covering(&self.seen(set), &self.right(set.first()?), 1.0 / px_per_unit)
    }

    /// The resolution asked for, or that of the images; no picture of a set may become too large.
    ///
    /// # Errors
    /// [`ResolutionError`].
    pub fn resolution(&self, sets: &[Vec<&FloorView>], asked: Option<f64>) -> Result<Resolution, ResolutionError> {
        let views = sets.iter().flatten().copied();
        let of_images = source_resolution(views, self.size, self.max_distance).ok_or(ResolutionError::NoFloor)?;
        let seen: Vec<(Vector2<f64>, Vec<Vector2<f64>>)> = sets
            .iter()
            .filter_map(|set| Some((self.right(set.first()?), self.seen(set))))
            .filter(|(_, outlines)| !outlines.is_empty())
            .collect();
        let largest = |px_per_unit: f64| {
            // A grid beyond counting is too large.
            let pixels = |(right, outlines): &(Vector2<f64>, Vec<Vector2<f64>>)| {
                FloorGrid::covering(outlines, right, 1.0 / px_per_unit).map_or(u64::MAX, |g| g.pixels())
            };
            seen.iter().map(pixels).max().unwrap_or(0)
        };
        if let Some(px_per_unit) = asked {
            let pixels = largest(px_per_unit);
            if pixels > MAX_PIXELS {
                // A margin for the rounding up of sides.
                let fits = px_per_unit * (MAX_PIXELS as f64 / pixels.max(1) as f64).sqrt() * 0.999;
                return Err(ResolutionError::TooLarge {
                    pixels,
                    most_pixels: MAX_PIXELS,
                    fits_px_per_unit: three_digits_down(fits),
                });
            }
            return Ok(Resolution { px_per_unit, lowered_from: None, most_pixels: MAX_PIXELS });
        }
        let wanted = one_two_five(of_images);
        let mut px_per_unit = wanted;
        while largest(px_per_unit) > MAX_PIXELS && px_per_unit > 1e-6 * wanted {
            px_per_unit = one_two_five(px_per_unit * 0.6);
        }
        Ok(Resolution { px_per_unit, lowered_from: (px_per_unit < wanted).then_some(wanted), most_pixels: MAX_PIXELS })
    }
}

/// The nearest of 1, 2 and 5 times a power of ten to a positive value, by their ratio.
fn one_two_five(value: f64) -> f64 {
    let power = 10f64.powi(value.log10().floor() as i32);
    let apart = |s: &f64| (s / value).ln().abs();
    let steps = [1.0, 2.0, 5.0, 10.0].map(|s| s * power);
    steps.into_iter().min_by(|a, b| apart(a).total_cmp(&apart(b))).unwrap_or(power)
}

/// Three digits, not above the value.
fn three_digits_down(value: f64) -> f64 {
    let unit = 10f64.powi(value.log10().floor() as i32 - 2);
    if unit >= 1.0 { (value / unit).floor() * unit } else { (value / unit).floor() / (1.0 / unit).round() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn round_resolutions() {
        for (value, expected) in
            [(487.0, 500.0), (500.0, 500.0), (800.0, 1000.0), (1000.0, 1000.0), (0.03, 0.02), (3.3, 5.0)]
        {
            assert!((one_two_five(value) - expected).abs() < 1e-9 * expected, "{value}: {}", one_two_five(value));
        }
        assert_eq!((three_digits_down(12345.6), three_digits_down(0.123_456)), (12300.0, 0.123));
    }

    #[test]
    fn views_of_one_world_come_together() {
        assert_eq!(sets_of_one_world(&["a", "b", "a", "c", "b"]), [vec![0, 2], vec![1, 4], vec![3]]);
    }
}
