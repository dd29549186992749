//! Random numbers of the scenes: one stream a scene, from the seed, the family's name and the scene's number alone.

use nalgebra::Vector3;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

/// A stream of random numbers.
pub(crate) struct Random(Pcg64Mcg);

impl Random {
    /// A stream of its own for each seed.
    pub(crate) fn new(seed: u64) -> Self {
        Self(Pcg64Mcg::seed_from_u64(seed))
    }

    /// Uniform in `low..high`.
    pub(crate) fn uniform(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.0.random::<f64>()
    }

    /// As likely between 1 and 2 as between 2 and 4.
    pub(crate) fn log_uniform(&mut self, low: f64, high: f64) -> f64 {
        self.uniform(low.ln(), high.ln()).exp()
    }

    /// Uniform in size, of either sign.
    pub(crate) fn either_sign(&mut self, low: f64, high: f64) -> f64 {
        let size = self.uniform(low, high);
        if self.chance(0.5) { size } else { -size }
    }

    /// Normal with mean zero (Box and Muller).
    pub(crate) fn normal(&mut self, sigma: f64) -> f64 {
        let radius = (-2.0 * self.uniform(1e-300, 1.0).ln()).sqrt();
        sigma * radius * self.uniform(0.0, std::f64::consts::TAU).cos()
    }

    /// Student's t with three degrees of freedom, scaled so that the middle of it is as wide as a normal's.
    pub(crate) fn heavy_tailed(&mut self, sigma: f64) -> f64 {
        let chi_squared: f64 = (0..3).map(|_| self.normal(1.0).powi(2)).sum();
        self.normal(sigma) / (chi_squared / 3.0).sqrt().max(1e-3)
    }

    /// True with this probability.
    pub(crate) fn chance(&mut self, probability: f64) -> bool {
        self.uniform(0.0, 1.0) < probability
    }

    /// One of `0..count`.
    pub(crate) fn below(&mut self, count: usize) -> usize {
        self.0.random_range(0..count.max(1))
    }

    /// One of `low..=high`.
    pub(crate) fn between(&mut self, low: usize, high: usize) -> usize {
        low + self.below(high + 1 - low)
    }

    /// One of these.
    pub(crate) fn one_of<T: Copy>(&mut self, all: &[T]) -> T {
        all[self.below(all.len())]
    }

    /// A random order of `0..count` (Fisher and Yates).
    pub(crate) fn order(&mut self, count: usize) -> Vec<usize> {
        let mut all: Vec<usize> = (0..count).collect();
        for i in (1..count).rev() {
            all.swap(i, self.below(i + 1));
        }
        all
    }

    /// A unit vector in the plane z = 0.
    pub(crate) fn level_direction(&mut self) -> Vector3<f64> {
        let angle = self.uniform(0.0, std::f64::consts::TAU);
        Vector3::new(angle.cos(), angle.sin(), 0.0)
    }

    /// A seed for something with a stream of its own.
    pub(crate) fn seed(&mut self) -> u64 {
        self.0.random::<u64>()
    }
}

/// A number as different as can be for numbers that hardly differ (the finaliser of SplitMix64).
pub(crate) fn scrambled(value: u64) -> u64 {
    let mut z = value.wrapping_add(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// The seed of a scene.
pub(crate) fn scene_seed(seed: u64, family: &str, index: usize) -> u64 {
    let start = scrambled(seed) ^ (index as u64).rotate_left(32);
    family.bytes().fold(scrambled(start), |hash, byte| scrambled(hash ^ u64::from(byte)))
}
