//! Integer-hash noise, and the filters that keep patterns below the sampling limit.
//!
//! Everything here is a pure function of its arguments, so a texture is the same whoever asks, in whatever order.

/// How wide the patch of surface under one sample is, in the surface's own length unit.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Footprint {
    /// Extent along the surface's first axis.
    pub(crate) x: f32,
    /// Extent along the surface's second axis.
    pub(crate) y: f32,
    /// Extent along the patch's longest direction.
    pub(crate) max: f32,
}

impl Footprint {
    /// The same width in every direction.
    pub(crate) fn round(width: f32) -> Self {
        Self { x: width, y: width, max: width }
    }
}

/// Mixes two lattice coordinates and a seed into 32 bits: two rounds of 64-bit multiplication, the upper half of each fed
/// back.
#[inline]
pub(crate) fn hash2(ix: i32, iy: i32, seed: u32) -> u32 {
    let lattice = u64::from(ix as u32) | (u64::from(iy as u32) << 32);
    let mut h = (lattice ^ u64::from(seed).wrapping_mul(0x9e37_79b9_7f4a_7c15)).wrapping_mul(0xd6e8_feb8_6659_fd93);
    h ^= h >> 32;
    (h.wrapping_mul(0xd6e8_feb8_6659_fd93) >> 32) as u32
}

/// Mixes three lattice coordinates and a seed into 32 bits.
#[inline]
pub(crate) fn hash3(ix: i32, iy: i32, iz: i32, seed: u32) -> u32 {
    hash2(ix, iy, seed ^ (iz as u32).wrapping_mul(0xcb1a_b31f))
}

/// The next 32 bits after `h`: for when one hash does not hold enough numbers.
#[inline]
pub(crate) fn rehash(h: u32) -> u32 {
    finish(h.wrapping_add(0x9e37_79b9))
}

#[inline]
fn finish(mut h: u32) -> u32 {
    h ^= h >> 16;
    h = h.wrapping_mul(0x7feb_352d);
    h ^= h >> 15;
    h = h.wrapping_mul(0x846c_a68b);
    h ^ (h >> 16)
}

/// Uniform in 0..1 from the upper 24 bits.
#[inline]
pub(crate) fn unit(h: u32) -> f32 {
    (h >> 8) as f32 * (1.0 / 16_777_216.0)
}

/// Uniform in 0..1 from one byte of a hash (`which` 0 to 3).
#[inline]
pub(crate) fn byte(h: u32, which: u32) -> f32 {
    ((h >> (8 * which)) & 255) as f32 * (1.0 / 255.0)
}

/// Cell index and position inside the cell, 0..1.
#[inline]
pub(crate) fn cell(x: f64) -> (i32, f32) {
    // `floor` is a library call on baseline x86-64 and a checked cast costs several instructions; adding 1.5 * 2^52 rounds
    // to an integer in the low bits. On a boundary either neighbour may be named: the position inside says which.
    const ROUND: f64 = 6_755_399_441_055_744.0;
    let x = x.clamp(-1e9, 1e9);
    let rounded = (x - 0.5) + ROUND;
    (rounded.to_bits() as i32, (x - (rounded - ROUND)) as f32)
}

#[inline]
fn fade(t: f32) -> f32 {
    t * t * t * (t * (t * 6.0 - 15.0) + 10.0)
}

#[inline]
fn lerp(a: f32, b: f32, t: f32) -> f32 {
    a + (b - a) * t
}

/// 0 below `low`, 1 above `high`, smooth between.
#[inline]
pub(crate) fn smoothstep(low: f32, high: f32, x: f32) -> f32 {
    let t = ((x - low) / (high - low)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// Gradient noise of cell size 1: zero mean, standard deviation about 1, wavelengths of about 1 to 2.
#[inline]
pub(crate) fn gradient_noise(x: f64, y: f64, seed: u32) -> f32 {
    let (ix, fx) = cell(x);
    let (iy, fy) = cell(y);
    let corner = |dx: i32, dy: i32| {
        let h = hash2(ix.wrapping_add(dx), iy.wrapping_add(dy), seed);
        let gx = (h & 0xffff) as f32 * (1.0 / 32768.0) - 1.0;
        let gy = (h >> 16) as f32 * (1.0 / 32768.0) - 1.0;
        gx * (fx - dx as f32) + gy * (fy - dy as f32)
    };
    let (u, v) = (fade(fx), fade(fy));
    5.0 * lerp(lerp(corner(0, 0), corner(1, 0), u), lerp(corner(0, 1), corner(1, 1), u), v)
}

/// Gradient noise in space, as [`gradient_noise`].
pub(crate) fn gradient_noise_3d(p: [f64; 3], seed: u32) -> f32 {
    let ((ix, fx), (iy, fy), (iz, fz)) = (cell(p[0]), cell(p[1]), cell(p[2]));
    let corner = |dx: i32, dy: i32, dz: i32| {
        let h = hash3(ix.wrapping_add(dx), iy.wrapping_add(dy), iz.wrapping_add(dz), seed);
        let g = |shift: u32| ((h >> shift) & 0x3ff) as f32 * (1.0 / 512.0) - 1.0;
        g(0) * (fx - dx as f32) + g(10) * (fy - dy as f32) + g(20) * (fz - dz as f32)
    };
    let (u, v, w) = (fade(fx), fade(fy), fade(fz));
    let layer =
        |dz: i32| lerp(lerp(corner(0, 0, dz), corner(1, 0, dz), u), lerp(corner(0, 1, dz), corner(1, 1, dz), u), v);
    5.0 * lerp(layer(0), layer(1), w)
}

/// The sample spacing, in wavelengths, from which on a pattern is left out.
const UNRESOLVED: f32 = 0.7;

/// How much of a pattern of the given wavelength survives sampling `width` apart: 1 when it is well resolved, 0 before it
/// would alias.
#[inline]
pub(crate) fn resolved(wavelength: f32, width: f32) -> f32 {
    let r = width / wavelength;
    if r < 0.35 { 1.0 } else { 1.0 - smoothstep(0.35, UNRESOLVED, r) }
}

/// A sum of gradient noises: `octaves` of them from cell size `largest` downwards, each about half the last and `gain`
/// times as strong; those that the footprint cannot resolve are left out. Standard deviation of the first octave: 1.
pub(crate) fn fractal(p: [f64; 2], largest: f64, octaves: u32, gain: f32, width: f32, seed: u32) -> f32 {
    const SHRINK: f64 = 1.0 / 0.51;
    // A turn by the angle of the 3-4-5 triangle keeps the lattices of successive octaves apart.
    const COS: f64 = 0.8 * SHRINK;
    const SIN: f64 = 0.6 * SHRINK;
    let per_cell = 1.0 / largest;
    let (mut x, mut y) = (p[0] * per_cell, p[1] * per_cell);
    let (mut width_cells, mut amplitude, mut sum) = (width * per_cell as f32, 1.0_f32, 0.0_f32);
    for octave in 0..octaves {
        if width_cells >= UNRESOLVED {
            break;
        }
        let keep = resolved(1.0, width_cells);
        sum += amplitude * keep * gradient_noise(x, y, seed.wrapping_add(octave.wrapping_mul(0x68e3_1da4)));
        (x, y) = (COS * x - SIN * y, SIN * x + COS * y);
        width_cells *= SHRINK as f32;
        amplitude *= gain;
    }
    sum
}

/// The fraction of the interval of length `width` about `x` that lies within `low..high`: a step or a line, box filtered.
#[inline]
pub(crate) fn interval_coverage(x: f32, low: f32, high: f32, width: f32) -> f32 {
    let half = 0.5 * width.max(1e-9);
    (((x + half).min(high) - (x - half).max(low)) / (2.0 * half)).clamp(0.0, 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn noise_has_zero_mean_and_unit_deviation_and_no_steps() {
        let n = 200;
        let (mut sum, mut square, mut cube_sum, mut cube_square) = (0.0, 0.0, 0.0, 0.0);
        for i in 0..n {
            for j in 0..n {
                let (x, y) = (i as f64 * 0.37 - 20.0, j as f64 * 0.41 - 30.0);
                let v = gradient_noise(x, y, 7) as f64;
                sum += v;
                square += v * v;
                let w = gradient_noise_3d([x, y, x - y], 7) as f64;
                cube_sum += w;
                cube_square += w * w;
                let step = gradient_noise(x + 1e-4, y, 7) as f64 - v;
                assert!(step.abs() < 3e-3, "{x} {y}: {step}");
            }
        }
        let m = (n * n) as f64;
        assert!(
            (sum / m).abs() < 0.03 && ((square / m).sqrt() - 1.0).abs() < 0.25,
            "{} {}",
            sum / m,
            (square / m).sqrt()
        );
        assert!((cube_sum / m).abs() < 0.03 && ((cube_square / m).sqrt() - 1.0).abs() < 0.25, "{}", cube_square / m);
    }

    #[test]
    fn unresolved_octaves_vanish() {
        assert_eq!(fractal([0.3, 0.7], 0.1, 6, 0.5, 0.1, 1), 0.0);
        assert_ne!(fractal([0.3, 0.7], 0.1, 6, 0.5, 0.0, 1), 0.0);
    }

    #[test]
    fn a_line_narrower_than_the_filter_keeps_its_area() {
        let total: f32 =
            (0..1000).map(|i| interval_coverage(i as f32 * 0.01 - 5.0, -0.1, 0.1, 1.0)).sum::<f32>() * 0.01;
        assert!((total - 0.2).abs() < 1e-3, "{total}");
    }
}
