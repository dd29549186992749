//! Textures of floors, from hashed lattices; metres. What is finer than a pixel's footprint fades out, so that little aliases.

use nalgebra::Vector2;

use crate::lies::random::scrambled;

/// How a surface looks.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Texture {
    /// Noise of many wavelengths: carpet, concrete, grass.
    Speckled { seed: u64, coarsest_m: f64, contrast: f64 },
    /// Tiles of one pitch with joints; `individual` is how much each differs from the others (0: an exactly periodic floor).
    Tiles { seed: u64, pitch_m: f64, individual: f64 },
    /// Black and white squares, exactly periodic.
    Chess { pitch_m: f64 },
}

const OCTAVES: i32 = 7;

impl Texture {
    /// Far things: `size_m` is that of the largest.
    pub(crate) fn far(seed: u64, size_m: f64) -> Self {
        Self::Speckled { seed, coarsest_m: size_m, contrast: 0.6 }
    }

    /// Length after which it repeats itself.
    pub(crate) fn period_m(&self) -> Option<f64> {
        match self {
            Self::Tiles { pitch_m, individual, .. } if *individual == 0.0 => Some(*pitch_m),
            Self::Chess { pitch_m } => Some(2.0 * pitch_m),
            _ => None,
        }
    }

    /// Grey value 0..1 where a pixel covers `footprint_m`.
    pub(crate) fn value(&self, p: &Vector2<f64>, footprint_m: f64) -> f64 {
        match *self {
            Self::Speckled { seed, coarsest_m, contrast } => {
                let raw = octaves(seed, p, coarsest_m, footprint_m);
                (0.5 + contrast * raw).clamp(0.02, 0.98)
            }
            Self::Tiles { seed, pitch_m, individual } => {
                let (u, v) = (p.x / pitch_m, p.y / pitch_m);
                let (cell_u, cell_v) = (u.floor(), v.floor());
                let edge = |t: f64| (t - t.floor() - 0.5).abs();
                let from_joint = (0.5 - edge(u).max(edge(v))) * pitch_m;
                let joint = smooth_step((from_joint - 0.003) / footprint_m.max(1e-4));
                // The pattern within a tile, the same in all, and each tile's own.
                let within = Vector2::new(u - cell_u, v - cell_v) * pitch_m;
                let common = octaves(seed, &within, 0.25 * pitch_m, footprint_m);
                let own = octaves(seed ^ 0x51, p, 0.3, footprint_m);
                let shade = cell_hash(seed, cell_u as i64, cell_v as i64) - 0.5;
                let tile = 0.55 + 0.3 * common + individual * (0.45 * own + 0.2 * shade);
                (0.15 + (tile - 0.15) * joint).clamp(0.02, 0.98)
            }
            Self::Chess { pitch_m } => {
                // Product of two square waves whose edges are as soft as a pixel is large.
                let wave = |t: f64| {
                    let phase = (t / pitch_m).rem_euclid(2.0);
                    let (inside, sign) = if phase < 1.0 { (phase, 1.0) } else { (phase - 1.0, -1.0) };
                    let from_edge = inside.min(1.0 - inside) * pitch_m;
                    sign * (from_edge / (0.7 * footprint_m.max(1e-4))).min(1.0)
                };
                0.5 + 0.4 * wave(p.x) * wave(p.y)
            }
        }
    }
}

fn octaves(seed: u64, p: &Vector2<f64>, coarsest_m: f64, footprint_m: f64) -> f64 {
    let mut sum = 0.0;
    for octave in 0..OCTAVES {
        let wavelength = coarsest_m * 0.5f64.powi(octave);
        let fade = smooth_step(wavelength / (2.0 * footprint_m.max(1e-9)) - 1.0);
        if fade <= 0.0 {
            break;
        }
        // Each octave has axes of its own, or the lattice shows.
        let (s, c) = (0.6 + 1.1 * f64::from(octave)).sin_cos();
        let q = Vector2::new(c * p.x - s * p.y, s * p.x + c * p.y) / wavelength;
        sum += 0.55 * fade * lattice_noise(seed, octave as u64, q.x, q.y) * 0.9f64.powi(octave);
    }
    sum
}

fn smooth_step(t: f64) -> f64 {
    let t = t.clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

fn cell_hash(seed: u64, x: i64, y: i64) -> f64 {
    let mixed = seed ^ (x as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ (y as u64).wrapping_mul(0xc2b2_ae3d_27d4_eb4f);
    scrambled(mixed) as f64 / u64::MAX as f64
}

/// Smooth noise in -1..1 whose values on the integer lattice are independent.
pub(crate) fn lattice_noise(seed: u64, layer: u64, x: f64, y: f64) -> f64 {
    let (x0, y0) = (x.floor(), y.floor());
    let (u, v) = (smooth_step(x - x0), smooth_step(y - y0));
    let key = seed ^ (layer << 56);
    let (x0, y0) = (x0 as i64, y0 as i64);
    let at = |dx: i64, dy: i64| cell_hash(key, x0 + dx, y0 + dy);
    let top = at(0, 0) * (1.0 - u) + at(1, 0) * u;
    let bottom = at(0, 1) * (1.0 - u) + at(1, 1) * u;
    2.0 * (top * (1.0 - v) + bottom * v) - 1.0
}
