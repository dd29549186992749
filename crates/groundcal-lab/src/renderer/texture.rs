//! What floors, boxes and skies look like: reflectance in linear light as a function of position.
//!
//! Every pattern is evaluated for a patch of a given width and leaves out what that patch cannot resolve, so that pictures
//! of a floor seen at a slant do not alias. Lengths are in metres.

use crate::renderer::noise::{
    Footprint, byte, cell, fractal, gradient_noise, gradient_noise_3d, hash2, interval_coverage, rehash, resolved,
    smoothstep, unit,
};
use crate::renderer::scene::{Backdrop, Floor, Sky, TextureKind};

/// Linear red, green, blue.
pub(crate) type Rgb = [f32; 3];

/// One sRGB component (0 to 1) to linear light.
pub(crate) fn linear_from_srgb(v: f64) -> f64 {
    if v <= 0.04045 { v / 12.92 } else { libm::pow((v + 0.055) / 1.055, 2.4) }
}

/// A colour, sRGB 0 to 1, to linear light.
pub(crate) fn linear_colour(c: &[f64; 3]) -> Rgb {
    c.map(|v| linear_from_srgb(v) as f32)
}

#[inline]
pub(crate) fn mix(a: Rgb, b: Rgb, t: f32) -> Rgb {
    [a[0] + (b[0] - a[0]) * t, a[1] + (b[1] - a[1]) * t, a[2] + (b[2] - a[2]) * t]
}

#[inline]
pub(crate) fn scaled(a: Rgb, s: f32) -> Rgb {
    [a[0] * s, a[1] * s, a[2] * s]
}

/// Angular polygons strewn over a turned square grid, at most one to a cell and none across a cell's border (so that one
/// hash decides each sample).
#[derive(Debug, Clone)]
struct Chips {
    size: f64,
    cos: f64,
    sin: f64,
    seed: u32,
    /// Fraction of the cells that hold a chip.
    density: f32,
    /// Least and greatest circumradius, in cells.
    radius: [f32; 2],
    /// Corners cut (5 half planes) or round.
    angular: bool,
    /// Mean fraction of the area under chips.
    mean_coverage: f32,
}

impl Chips {
    fn new(size: f64, turn_rad: f64, seed: u32, density: f32, radius: [f32; 2], angular: bool) -> Self {
        let mut chips = Self {
            size,
            cos: libm::cos(turn_rad),
            sin: libm::sin(turn_rad),
            seed,
            density,
            radius,
            angular,
            mean_coverage: 0.0,
        };
        let n = 128;
        let covered: f32 = (0..n * n)
            .map(|i| {
                chips.inside([(i % n) as f64 * 0.27 * size, (i / n) as f64 * 0.27 * size], 0.0).map_or(0.0, |c| c.0)
            })
            .sum();
        chips.mean_coverage = covered / (n * n) as f32;
        chips
    }

    /// Coverage of the patch by the chip of its cell and that chip's hash, for a patch width in cells.
    #[inline]
    fn inside(&self, p: [f64; 2], width: f32) -> Option<(f32, u32)> {
        let (i, x) = cell((self.cos * p[0] - self.sin * p[1]) / self.size);
        let (j, y) = cell((self.sin * p[0] + self.cos * p[1]) / self.size);
        let h = hash2(i, j, self.seed);
        if byte(h, 0) >= self.density {
            return None;
        }
        // Small chips outnumber large ones.
        let t = byte(h, 1);
        let r = self.radius[0] + (self.radius[1] - self.radius[0]) * t * t;
        let dx = x - (r + (1.0 - 2.0 * r) * byte(h, 2));
        let dy = y - (r + (1.0 - 2.0 * r) * byte(h, 3));
        let d2 = dx * dx + dy * dy;
        let reach = r + 0.5 * width;
        if d2 > reach * reach {
            return None;
        }
        let distance = if self.angular {
            // Half planes in five directions a fifth of a turn apart, turned and pushed in by the hash.
            const DIRECTIONS: [[f32; 2]; 5] = [
                [1.0, 0.0],
                [0.309_017, 0.951_056_5],
                [-0.809_017, 0.587_785_3],
                [-0.809_017, -0.587_785_3],
                [0.309_017, -0.951_056_5],
            ];
            let g = rehash(h);
            let (c, s) = (byte(g, 0) * 2.0 - 1.0, byte(g, 1) * 2.0 - 1.0);
            let norm = (c * c + s * s).sqrt().max(0.05);
            let (ux, uy) = ((c * dx + s * dy) / norm, (c * dy - s * dx) / norm);
            let mut outside = f32::MIN;
            for (k, d) in DIRECTIONS.iter().enumerate() {
                let support = r * (0.5 + 0.45 * ((g >> (12 + 4 * k)) & 15) as f32 / 15.0);
                outside = outside.max(d[0] * ux + d[1] * uy - support);
            }
            outside
        } else {
            d2.sqrt() - r
        };
        // A chip's own edge is never quite sharp: a few per cent of a cell.
        let coverage = (0.5 - distance / width.max(0.03)).clamp(0.0, 1.0);
        (coverage > 0.0).then_some((coverage, h))
    }

    /// Coverage and hash as [`Self::inside`], with the mean coverage (and no hash) where cells are below the patch's width.
    #[inline]
    fn at(&self, p: [f64; 2], width_m: f32) -> (f32, f32, u32) {
        let width = width_m / self.size as f32;
        let keep = resolved(0.8, width);
        let (coverage, h) = if keep > 0.0 { self.inside(p, width).unwrap_or((0.0, 0)) } else { (0.0, 0) };
        (keep * coverage, (1.0 - keep) * self.mean_coverage, h)
    }
}

/// A floor, ready to be evaluated.
#[derive(Debug, Clone)]
pub(crate) struct FloorTexture {
    kind: TextureKind,
    scale: f64,
    contrast: f32,
    base: Rgb,
    second: Rgb,
    palette: [Rgb; 8],
    palette_mean: Rgb,
    cos: f64,
    sin: f64,
    seed: u32,
    chips: Vec<Chips>,
    mean: Rgb,
}

impl FloorTexture {
    pub(crate) fn new(floor: &Floor) -> Self {
        let (scale, base, second): (f64, [f64; 3], [f64; 3]) = match floor.texture {
            TextureKind::Tiles => (0.30, [0.70, 0.62, 0.54], [0.40, 0.38, 0.36]),
            TextureKind::Carpet => (0.006, [0.44, 0.48, 0.53], [0.33, 0.36, 0.43]),
            TextureKind::Terrazzo => (0.045, [0.74, 0.72, 0.68], [0.33, 0.32, 0.32]),
            TextureKind::Concrete => (1.0, [0.66, 0.65, 0.63], [0.44, 0.43, 0.42]),
            TextureKind::Wood => (0.14, [0.72, 0.54, 0.36], [0.42, 0.27, 0.16]),
            TextureKind::Asphalt => (0.014, [0.36, 0.36, 0.37], [0.66, 0.64, 0.60]),
        };
        let scale = floor.scale_m.unwrap_or(scale);
        let base = linear_colour(&floor.colour.unwrap_or(base));
        let second = linear_colour(&floor.second_colour.unwrap_or(second));
        let seed = floor.seed.wrapping_mul(0x9e37_79b1) ^ 0x51ed_270b;
        // Stone comes in the two given colours, between them, and warmer or cooler than they are.
        let toned = |c: Rgb, by: Rgb| [(c[0] * by[0]).min(0.9), (c[1] * by[1]).min(0.9), (c[2] * by[2]).min(0.9)];
        let palette = [
            second,
            toned(base, [1.35, 1.35, 1.33]),
            mix(base, second, 0.5),
            toned(base, [0.72, 0.50, 0.38]),
            toned(base, [0.80, 0.66, 0.47]),
            toned(second, [0.55, 0.57, 0.60]),
            toned(mix(base, second, 0.4), [0.85, 1.00, 0.92]),
            toned(base, [1.20, 1.15, 1.05]),
        ];
        let mut palette_mean = [0.0; 3];
        for (k, mean) in palette_mean.iter_mut().enumerate() {
            *mean = palette.iter().map(|c| c[k]).sum::<f32>() / palette.len() as f32;
        }
        let chips = match floor.texture {
            TextureKind::Terrazzo => vec![
                Chips::new(scale, 0.3, seed ^ 11, 0.75, [0.16, 0.48], true),
                Chips::new(0.56 * scale, 1.1, seed ^ 12, 0.75, [0.14, 0.48], true),
                Chips::new(0.30 * scale, 0.7, seed ^ 13, 0.70, [0.14, 0.46], true),
                Chips::new(0.16 * scale, 0.1, seed ^ 14, 0.60, [0.14, 0.44], true),
            ],
            TextureKind::Concrete => vec![
                Chips::new(0.060 * scale, 0.4, seed ^ 21, 0.22, [0.03, 0.16], false),
                Chips::new(0.021 * scale, 1.2, seed ^ 22, 0.30, [0.10, 0.32], false),
            ],
            TextureKind::Tiles => vec![Chips::new(0.05 * scale, 0.4, seed ^ 31, 0.35, [0.08, 0.34], true)],
            TextureKind::Asphalt => vec![
                Chips::new(scale, 0.4, seed ^ 41, 0.85, [0.2, 0.48], true),
                Chips::new(0.6 * scale, 1.2, seed ^ 42, 0.8, [0.2, 0.48], true),
            ],
            TextureKind::Wood => vec![Chips::new(0.9, 0.0, seed ^ 51, 0.55, [0.015, 0.03], false)],
            TextureKind::Carpet => Vec::new(),
        };
        let turn = floor.yaw_deg.to_radians();
        let mut texture = Self {
            kind: floor.texture,
            scale,
            contrast: floor.contrast as f32,
            base,
            second,
            palette,
            palette_mean,
            cos: libm::cos(turn),
            sin: libm::sin(turn),
            seed,
            chips,
            mean: [0.0; 3],
        };
        // The mean over some hundred cells: what the floor tends to at the horizon, and what contrast is counted from.
        let n = 64;
        let step = texture.mean_step();
        let mut sum = [0.0_f64; 3];
        for i in 0..n * n {
            let c = texture.pattern([(i % n) as f64 * step, (i / n) as f64 * step], Footprint::round(0.0));
            for (s, v) in sum.iter_mut().zip(c) {
                *s += f64::from(v);
            }
        }
        texture.mean = sum.map(|v| (v / (n * n) as f64) as f32);
        texture
    }

    /// A step that visits every part of the pattern's cells in turn.
    fn mean_step(&self) -> f64 {
        match self.kind {
            TextureKind::Tiles => 0.618 * self.scale,
            TextureKind::Wood => 1.618 * self.scale,
            TextureKind::Carpet => 9.618 * self.scale,
            TextureKind::Terrazzo | TextureKind::Asphalt => 0.618 * self.scale,
            TextureKind::Concrete => 0.318_7 * self.scale,
        }
    }

    /// Reflectance at a floor position, for a patch of the given extent along world X and Y.
    pub(crate) fn reflectance(&self, p: [f64; 2], footprint: Footprint) -> Rgb {
        let q = [self.cos * p[0] + self.sin * p[1], self.cos * p[1] - self.sin * p[0]];
        // A turned pattern sees the patch's box turned: bounded from above, never beyond the long axis.
        let (c, s) = (self.cos.abs() as f32, self.sin.abs() as f32);
        let f = Footprint {
            x: (c * footprint.x + s * footprint.y).min(footprint.max),
            y: (c * footprint.y + s * footprint.x).min(footprint.max),
            max: footprint.max,
        };
        let v = self.pattern(q, f);
        let m = self.mean;
        let d = |k: usize| (m[k] + self.contrast * (v[k] - m[k])).max(0.004);
        [d(0), d(1), d(2)]
    }

    fn pattern(&self, p: [f64; 2], f: Footprint) -> Rgb {
        match self.kind {
            TextureKind::Tiles => self.tiles(p, f),
            TextureKind::Carpet => self.carpet(p, f),
            TextureKind::Terrazzo => self.terrazzo(p, f),
            TextureKind::Concrete => self.concrete(p, f),
            TextureKind::Wood => self.wood(p, f),
            TextureKind::Asphalt => self.asphalt(p, f),
        }
    }

    fn tiles(&self, p: [f64; 2], f: Footprint) -> Rgb {
        let s = self.scale;
        let ((i, x), (j, y)) = (cell(p[0] / s), cell(p[1] / s));
        let inv = 1.0 / s as f32;
        let (fx, fy) = (f.x * inv, f.y * inv);
        const HALF_GROUT: f32 = 0.011;
        let line = |t: f32, w: f32| {
            let t = if t > 0.5 { t - 1.0 } else { t };
            interval_coverage(t, -HALF_GROUT, HALF_GROUT, w)
        };
        let (gx, gy) = (line(x, fx), line(y, fy));
        let grout = 1.0 - (1.0 - gx) * (1.0 - gy);
        let h = hash2(i, j, self.seed);
        let keep = resolved(s as f32, f.max);
        // Each tile is cut from another part of the stone.
        let q = [p[0] + f64::from(h & 0xff) * 3.7 * s, p[1] + f64::from((h >> 8) & 0xff) * 5.3 * s];
        let cloud = fractal(q, 0.33 * s, 6, 0.72, f.max, self.seed ^ 1);
        let vein_at = gradient_noise(q[0] / (0.8 * s), q[1] / (0.8 * s), self.seed ^ 2) + 0.25 * cloud;
        let vein = (1.0 - vein_at.abs() * 9.0).max(0.0) * resolved(0.1 * s as f32, f.max);
        let tone = 1.0 + keep * (0.26 * (byte(h, 2) - 0.5)) + 0.085 * cloud - 0.20 * vein;
        let warmth = keep * 0.10 * (byte(h, 3) - 0.5);
        let stone = [self.base[0] * (tone + warmth), self.base[1] * tone, self.base[2] * (tone - warmth)];
        let (c, mean, ch) = self.chips[0].at(p, f.max);
        let spot = if ch & 0x100 == 0 { scaled(stone, 0.72) } else { scaled(stone, 1.22) };
        let stone = mix(mix(stone, spot, 0.8 * c), scaled(stone, 0.97), mean);
        // Worn rims: tiles darken towards their edges.
        let rim = smoothstep(0.06, 0.01, x.min(1.0 - x).min(y.min(1.0 - y))) * keep;
        let dirt = 1.0 + 0.16 * fractal(p, 0.02, 3, 0.8, f.max, self.seed ^ 3);
        mix(scaled(stone, 1.0 - 0.10 * rim), scaled(self.second, dirt), grout)
    }

    fn carpet(&self, p: [f64; 2], f: Footprint) -> Rgb {
        let s = self.scale;
        // Yarn of two colours, mixed on every scale from a tuft to a hand; slow wear on top.
        let tuft = fractal(p, 8.0 * s, 5, 1.12, f.max, self.seed ^ 1);
        let wear = fractal([p[0], p[1] + 70.0], 120.0 * s, 3, 0.6, f.max, self.seed ^ 2);
        let (_, row) = cell(p[1] / (1.7 * s));
        let rows = (4.0 * (row - 0.5).abs() - 1.0) * resolved(1.7 * s as f32, f.y);
        let t = 0.5 + 0.12 * tuft + 0.05 * wear + 0.05 * rows;
        mix(self.second, self.base, t.clamp(-0.5, 1.5))
    }

    fn terrazzo(&self, p: [f64; 2], f: Footprint) -> Rgb {
        let cement = 1.0
            + 0.05 * fractal(p, 20.0 * self.scale, 4, 0.7, f.max, self.seed ^ 1)
            + 0.06 * fractal(p, 0.35 * self.scale, 3, 0.8, f.max, self.seed ^ 2);
        let mut colour = scaled(self.base, cement);
        for chips in self.chips.iter().rev() {
            let (c, mean, h) = chips.at(p, f.max);
            if mean > 0.0 {
                colour = mix(colour, self.palette_mean, mean);
            }
            if c > 0.0 {
                let g = rehash(h ^ 0x5bd1);
                let stone = scaled(self.palette[(g & 7) as usize], 0.85 + 0.3 * byte(g, 1));
                colour = mix(colour, stone, c);
            }
        }
        colour
    }

    fn concrete(&self, p: [f64; 2], f: Footprint) -> Rgb {
        let s = self.scale;
        let stains = fractal(p, s, 3, 0.75, f.max, self.seed ^ 1);
        let grain = fractal(p, 0.09 * s, 5, 0.95, f.max, self.seed ^ 2);
        let mut t = 0.32 + 0.13 * stains - 0.085 * grain;
        let bend = 0.35 * gradient_noise(p[0] / (0.35 * s), p[1] / (0.35 * s), self.seed ^ 4);
        let crack_at = gradient_noise(p[0] / (2.2 * s), p[1] / (2.2 * s), self.seed ^ 3) + 0.3 * bend + 0.03 * grain;
        let crack = interval_coverage(crack_at / 2.2 * s as f32, -0.0012, 0.0012, f.max + 0.001);
        t += 0.75 * crack;
        for (chips, depth) in self.chips.iter().zip([0.9, 0.55]) {
            let (c, mean, h) = chips.at(p, f.max);
            let sign = if h & 0x300 == 0 { -0.6 } else { 1.0 };
            t += depth * (sign * c + 0.6 * mean);
        }
        mix(self.base, self.second, t.clamp(-0.5, 1.6))
    }

    fn wood(&self, p: [f64; 2], f: Footprint) -> Rgb {
        let w = self.scale;
        let length = 9.0 * w;
        let (row, v) = cell(p[1] / w);
        let shift = f64::from(unit(hash2(row, 0, self.seed))) * length;
        let (plank, u) = cell((p[0] + shift) / length);
        let h = hash2(plank, row, self.seed ^ 1);
        let keep = resolved(w as f32, f.max);
        // Each plank comes from another tree.
        let (mut x, mut y) = (p[0] + f64::from(h & 0x3ff) * 1.7, p[1] + f64::from((h >> 10) & 0x3ff) * 0.77);
        let knots = &self.chips[0];
        // The grain bends round a knot: squeeze the pattern where the knot's cell has one.
        let bend = fractal([x / 6.0, y], 0.6 * w, 2, 0.5, f.y, self.seed ^ 2);
        y += 0.05 * w * f64::from(bend);
        x += 0.02 * w * f64::from(bend);
        // Each octave of grain is 14 times longer than wide; its width decides whether a patch resolves it.
        let strand = |size: f64, stretch: f64, seed: u32| {
            let keep = resolved(size as f32, f.y) * resolved((size * stretch) as f32, f.x);
            if keep == 0.0 { 0.0 } else { keep * gradient_noise(x / (size * stretch), y / size, self.seed ^ seed) }
        };
        let grain = strand(0.36 * w, 10.0, 3)
            + 0.9 * strand(0.17 * w, 14.0, 4)
            + 0.9 * strand(0.075 * w, 12.0, 5)
            + 0.8 * strand(0.036 * w, 10.0, 6);
        // Pores and scratches: short marks that fix a position along the plank as well.
        let marks = strand(0.05 * w, 2.2, 7);
        let fine = strand(0.085 * w, 1.6, 8);
        let pores = (strand(0.022 * w, 7.0, 9) - 0.9).max(0.0);
        let mut t = 0.30 + 0.13 * grain + 0.50 * pores + 0.13 * (marks - 0.7).max(0.0) + 0.055 * fine;
        t += keep * 0.55 * (byte(h, 3) - 0.5);
        let (knot, _, kh) = knots.at([x, y * 1.6], f.max);
        if knot > 0.0 {
            t += knot * (0.75 + 0.3 * byte(kh, 1));
        }
        let tone = 1.0 + keep * 0.14 * (unit(rehash(h)) - 0.5);
        let colour = scaled(mix(self.base, self.second, t.clamp(-0.3, 1.4)), tone);
        let seam = |d: f32, width: f32, unit_m: f64| {
            let d = if d > 0.5 { d - 1.0 } else { d };
            interval_coverage(d * unit_m as f32, -0.0011, 0.0011, width)
        };
        let gap = 1.0 - (1.0 - seam(v, f.y, w)) * (1.0 - seam(u, f.x, length));
        mix(colour, scaled(self.second, 0.22), gap)
    }

    fn asphalt(&self, p: [f64; 2], f: Footprint) -> Rgb {
        let patches = fractal(p, 50.0 * self.scale, 4, 0.6, f.max, self.seed ^ 1);
        let grit = fractal(p, 0.9 * self.scale, 3, 0.8, f.max, self.seed ^ 2);
        let mut colour = scaled(self.base, (1.0 + 0.10 * patches + 0.22 * grit).max(0.2));
        for chips in self.chips.iter().rev() {
            let (c, mean, h) = chips.at(p, f.max);
            let g = rehash(h ^ 0x77);
            colour = mix(colour, mix(self.base, self.second, 0.42), mean);
            if c > 0.0 {
                colour = mix(colour, scaled(mix(self.base, self.second, byte(g, 0) * 0.9), 0.9 + 0.25 * byte(g, 1)), c);
            }
        }
        colour
    }
}

/// Cardboard or painted wood: a faint mottling, and darker rims. `face` is the position on the face and `size` the face's
/// extent, in metres; `width` that of the patch.
pub(crate) fn box_reflectance(colour: Rgb, face: [f64; 2], size: [f64; 2], top: bool, width: f32, seed: u32) -> Rgb {
    let mottle = 0.055 * fractal(face, 0.05, 4, 0.75, width, seed);
    let fibre = 0.03 * resolved(0.004, width) * gradient_noise(face[0] / 0.03, face[1] / 0.004, seed ^ 5);
    let mut c = scaled(colour, 1.0 + mottle + fibre);
    let short = size[0].min(size[1]);
    if top {
        // Packing tape along the longer side, with the slit between the flaps under it.
        let (across, slit) = if size[0] >= size[1] { (face[1], face[1]) } else { (face[0], face[0]) };
        let half_tape = (0.12 * short).min(0.025) as f32;
        let tape = interval_coverage(across as f32, -half_tape, half_tape, width);
        c = mix(c, mix(scaled(c, 1.12), [0.55, 0.45, 0.32], 0.25), 0.8 * tape);
        c = scaled(c, 1.0 - 0.45 * interval_coverage(slit as f32, -0.0012, 0.0012, width));
    } else if short > 0.09 {
        // A label on each side face.
        let at = [0.22 * size[0] * (f64::from(byte(seed, 1)) - 0.5), 0.12 * size[1]];
        let (lx, ly) = ((face[0] - at[0]) as f32, (face[1] - at[1]) as f32);
        let (hw, hh) = ((0.17 * size[0]) as f32, (0.15 * size[1]) as f32);
        let label = interval_coverage(lx, -hw, hw, width) * interval_coverage(ly, -hh, hh, width);
        if label > 0.0 {
            let (line, y) = cell(f64::from((ly + hh) / (0.33 * hh)));
            let (word, x) = cell(f64::from((lx + hw) / (0.12 * hw)));
            let print = hash2(word, line, seed ^ 0x1abe1) & 3 != 0 && (0.3..0.75).contains(&y) && x < 0.8;
            let ink = if print && lx.abs() < 0.85 * hw { resolved(0.2 * hh, width) * 0.75 } else { 0.0 };
            c = mix(c, scaled([0.78, 0.77, 0.73], 1.0 - ink), label);
        }
    }
    let rim_distance = (0.5 * size[0] - face[0].abs()).min(0.5 * size[1] - face[1].abs()) as f32;
    let rim = smoothstep(0.006, 0.001, rim_distance) * resolved(0.01, width);
    scaled(c, 1.0 - 0.18 * rim)
}

/// The sky, ready to be evaluated.
#[derive(Debug, Clone)]
pub(crate) struct SkyTexture {
    horizon: Rgb,
    zenith: Rgb,
    backdrop: Backdrop,
    seed: u32,
}

impl SkyTexture {
    pub(crate) fn new(sky: &Sky) -> Self {
        Self {
            horizon: linear_colour(&sky.horizon_colour),
            zenith: linear_colour(&sky.zenith_colour),
            backdrop: sky.backdrop,
            seed: sky.seed.wrapping_mul(0x85eb_ca6b) ^ 0x1234_5678,
        }
    }

    /// Radiance in a unit direction, for a patch of the given width in radians.
    pub(crate) fn radiance(&self, d: [f64; 3], width: f32) -> Rgb {
        let up = d[2].max(0.0) as f32;
        let mut colour = mix(self.horizon, self.zenith, up.sqrt());
        if self.backdrop == Backdrop::None {
            return colour;
        }
        let (mut size, mut amplitude, mut cloud) = (0.35_f64, 1.0_f32, 0.0_f32);
        let mut q = [d[0], d[1], 1.7 * d[2]];
        for octave in 0..7 {
            let keep = resolved(size as f32, width);
            if keep == 0.0 {
                break;
            }
            cloud += amplitude * keep * gradient_noise_3d(q.map(|v| v / size), self.seed ^ octave);
            q = [0.8 * q[0] - 0.6 * q[1], 0.6 * q[0] + 0.8 * q[1], q[2]];
            size *= 0.52;
            amplitude *= 0.62;
        }
        let cover = smoothstep(-0.3, 1.6, cloud);
        colour = mix(colour, [0.88, 0.89, 0.91], 0.85 * cover);
        if self.backdrop == Backdrop::Skyline && d[2] < 0.4 {
            for layer in [1_u32, 0] {
                colour = self.buildings(colour, d, width, layer);
            }
        }
        colour
    }

    /// A ring of buildings, the further one (layer 1) higher and paler.
    fn buildings(&self, behind: Rgb, d: [f64; 3], width: f32, layer: u32) -> Rgb {
        const BLOCKS: [f64; 2] = [53.0, 37.0];
        let n = BLOCKS[layer as usize];
        let azimuth = (libm::atan2(d[1], d[0]) / std::f64::consts::TAU + 0.5) * n;
        let (block, x) = cell(azimuth.clamp(0.0, n - 1e-9));
        let h = hash2(block, layer as i32, self.seed ^ 0xb10c);
        let tan_elevation = (d[2] / d[0].hypot(d[1])) as f32;
        let height = if layer == 0 { 0.04 + 0.13 * unit(h) } else { 0.08 + 0.22 * unit(h) };
        let roof = interval_coverage(tan_elevation, -1.0, height, width);
        if roof == 0.0 {
            return behind;
        }
        let block_width = (std::f64::consts::TAU / n) as f32;
        let tone = 0.10 + 0.30 * byte(h, 0) + if layer == 1 { 0.15 } else { 0.0 };
        let warm = 0.2 * (byte(h, 1) - 0.5);
        let wall = [tone * (1.0 + warm), tone, tone * (1.0 - warm)];
        // Windows: a grid of the building's own, some lit, some dark, each of its own grey.
        let pitch = block_width / (5.0 + (h & 7) as f32);
        let storey = 0.012 + 0.008 * byte(h, 2);
        let (column, u) = cell(f64::from(x * block_width / pitch));
        let (floor, v) = cell(f64::from(tan_elevation / storey));
        let g = hash2(column + 64 * block, floor, self.seed ^ layer);
        let window = interval_coverage(u, 0.22, 0.78, width / pitch) * interval_coverage(v, 0.25, 0.8, width / storey);
        let keep = resolved(pitch.min(storey), 0.7 * width);
        let glass = scaled([0.75, 0.85, 1.0], 0.04 + 0.5 * byte(g, 1) * byte(g, 2));
        let mut face = mix(wall, glass, window * keep + 0.3 * (1.0 - keep) * 0.5);
        if layer == 1 {
            face = mix(face, self.horizon, 0.35);
        }
        // Gaps between neighbours are narrow bright slits.
        let slit = 1.0 - interval_coverage(x, 0.012, 0.988, width / block_width);
        mix(behind, mix(face, scaled(face, 0.5), slit), roof)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const KINDS: [TextureKind; 6] = [
        TextureKind::Tiles,
        TextureKind::Carpet,
        TextureKind::Terrazzo,
        TextureKind::Concrete,
        TextureKind::Wood,
        TextureKind::Asphalt,
    ];

    /// Mean and deviation of the green channel on a grid of positions.
    fn statistics(texture: &FloorTexture, width: f32) -> (f64, f64) {
        let n = 120;
        let values: Vec<f64> = (0..n * n)
            .map(|i| {
                let p = [(i % n) as f64 * 0.1313 - 7.9, (i / n) as f64 * 0.1217 - 7.0];
                f64::from(texture.reflectance(p, Footprint::round(width))[1])
            })
            .collect();
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        let variance = values.iter().map(|v| (v - mean) * (v - mean)).sum::<f64>() / values.len() as f64;
        (mean, variance.sqrt())
    }

    #[test]
    fn every_floor_has_contrast_and_loses_it_with_distance_but_not_its_mean() {
        for kind in KINDS {
            let texture = FloorTexture::new(&Floor { texture: kind, ..Floor::default() });
            let (near, contrast) = statistics(&texture, 0.0005);
            let (far, left) = statistics(&texture, 100.0);
            assert!(contrast / near > 0.03, "{kind:?}: {contrast} of {near}");
            assert!((far / near - 1.0).abs() < 0.08, "{kind:?}: mean {near} near, {far} far");
            assert!(left / far < 0.01, "{kind:?}: {left} of {far} left");
        }
    }

    #[test]
    fn carpet_is_the_hard_one() {
        let contrast = |kind| {
            let (mean, deviation) = statistics(&FloorTexture::new(&Floor { texture: kind, ..Floor::default() }), 0.003);
            deviation / mean
        };
        for other in KINDS.into_iter().filter(|k| !matches!(k, TextureKind::Carpet)) {
            let (hard, easier) = (contrast(TextureKind::Carpet), contrast(other));
            assert!(hard < 0.9 * easier, "carpet {hard}, {other:?} {easier}");
        }
    }
}
