//! Pictures of a [`Scene`]: a ray caster whose camera is exact.
//!
//! Every sample's pixel position goes through the inverse of the lens model, so no resampling stands between the truth and
//! the picture; where the lens folds over, the picture is black. A pixel is the mean over its square, taken by jittered
//! strata, of patterns that leave out what a stratum cannot resolve. Light is added up linearly; exposure, optical blur and
//! noise act on linear light; sRGB and 8 bits come last.
//!
//! The picture is a function of the scene alone: every random number is a hash of seed, view, pixel and sample, so neither
//! the number of threads nor the order of the views matters.

use nalgebra::Vector3;
use rayon::prelude::*;

use crate::renderer::noise::{Footprint, hash3, rehash, unit};
use crate::renderer::optics::Optics;
use crate::renderer::scene::{Scene, SceneError};
use crate::renderer::texture::{
    FloorTexture, Rgb, SkyTexture, box_reflectance, linear_colour, linear_from_srgb, scaled,
};
use groundcal::{geometry::ImageSize, vision::GrayImage};

/// A colour picture of 8 bits per channel, sRGB.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RgbImage8 {
    /// Width and height.
    pub size: ImageSize,
    /// Red, green, blue, pixel by pixel and row by row.
    pub data: Vec<u8>,
}

impl RgbImage8 {
    /// The luma (0.299 R + 0.587 G + 0.114 B) as 0 to 1.
    pub fn to_gray(&self) -> GrayImage {
        let mut gray = GrayImage::filled(self.size, 0.0);
        for (out, p) in gray.data_mut().iter_mut().zip(self.data.chunks_exact(3)) {
            *out = (0.299 * f32::from(p[0]) + 0.587 * f32::from(p[1]) + 0.114 * f32::from(p[2])) / 255.0;
        }
        gray
    }
}

/// Renders one view of a scene. For many views of one scene, [`Renderer`] checks and prepares it once.
pub fn render_view(scene: &Scene, index: usize) -> Result<RgbImage8, SceneError> {
    Renderer::new(scene)?.render(index)
}

/// A scene that has been checked and prepared.
#[derive(Debug, Clone)]
pub struct Renderer<'a> {
    scene: &'a Scene,
    optics: Optics,
    floor: FloorTexture,
    sky: SkyTexture,
    boxes: Vec<SolidBox>,
    light: Light,
    strata: u32,
    encoder: Encoder,
}

#[derive(Debug, Clone)]
struct Light {
    /// Unit vector towards the light, and two across it.
    to: Vector3<f64>,
    across: [Vector3<f64>; 2],
    /// Radius as a tangent.
    spread: f64,
    ambient: f32,
}

/// A box turned by yaw about its own vertical axis.
#[derive(Debug, Clone)]
struct SolidBox {
    centre: Vector3<f64>,
    half: Vector3<f64>,
    cos: f64,
    sin: f64,
    radius: f64,
    colour: Rgb,
    seed: u32,
}

/// Where a ray meets a box.
struct Hit {
    t: f64,
    /// Index of the face's axis, and on which side of the centre.
    axis: usize,
    positive: bool,
}

impl SolidBox {
    fn to_local(&self, v: &Vector3<f64>) -> Vector3<f64> {
        Vector3::new(self.cos * v.x + self.sin * v.y, self.cos * v.y - self.sin * v.x, v.z)
    }

    /// Entry of the ray `origin + t direction` (world) for t in 0..limit; from inside there is no entry.
    fn entry(&self, origin: &Vector3<f64>, direction: &Vector3<f64>, limit: f64) -> Option<Hit> {
        let o = self.to_local(&(origin - self.centre));
        let d = self.to_local(direction);
        let (mut near, mut far, mut axis) = (0.0_f64, limit, usize::MAX);
        for k in 0..3 {
            let inverse = 1.0 / d[k];
            let a = (-self.half[k] - o[k]) * inverse;
            let b = (self.half[k] - o[k]) * inverse;
            let (low, high) = if a < b { (a, b) } else { (b, a) };
            if low > near {
                near = low;
                axis = k;
            }
            far = far.min(high);
        }
        (near < far && axis < 3).then(|| Hit { t: near, axis, positive: o[axis] > 0.0 })
    }

    /// Fraction of an even sky that the box hides from a floor point: a wall of its height at the point's distance, as
    /// wide as the box. An approximation, for contact shadows.
    fn hides_sky(&self, p: [f64; 2]) -> f64 {
        let q = self.to_local(&Vector3::new(p[0] - self.centre.x, p[1] - self.centre.y, 0.0));
        let d = (q.x.abs() - self.half.x).max(0.0).hypot((q.y.abs() - self.half.y).max(0.0));
        let height = 2.0 * self.half.z;
        let width = self.half.x + self.half.y;
        0.5 * (1.0 - d / d.hypot(height)) * width / (width + d)
    }
}

/// Everything about one view that the pixels share.
struct ViewSetup {
    /// World from camera.
    r: nalgebra::Matrix3<f64>,
    centre: Vector3<f64>,
    seed: u32,
}

impl<'a> Renderer<'a> {
    /// Checks the scene and prepares its patterns.
    pub fn new(scene: &'a Scene) -> Result<Self, SceneError> {
        scene.validate()?;
        let boxes = scene.all_boxes()?;
        let solids = boxes.iter().enumerate().map(|(i, b)| {
            let yaw = b.yaw_deg.to_radians();
            let half = Vector3::from(b.size_m) * 0.5;
            SolidBox {
                centre: Vector3::new(b.centre_m[0], b.centre_m[1], half.z),
                half,
                cos: yaw.cos(),
                sin: yaw.sin(),
                radius: half.norm(),
                colour: linear_colour(&b.colour),
                seed: hash3(i as i32, 0, 0, 0xb0c5),
            }
        });
        let (azimuth, elevation) = (scene.light.azimuth_deg.to_radians(), scene.light.elevation_deg.to_radians());
        let to = Vector3::new(azimuth.cos() * elevation.cos(), azimuth.sin() * elevation.cos(), elevation.sin());
        let side = Vector3::new(azimuth.sin(), -azimuth.cos(), 0.0);
        let light = Light {
            to,
            across: [side, to.cross(&side)],
            spread: scene.light.radius_deg.to_radians().tan(),
            ambient: scene.light.ambient as f32,
        };
        Ok(Self {
            scene,
            optics: Optics::new(&scene.camera.model()),
            floor: FloorTexture::new(&scene.floor),
            sky: SkyTexture::new(&scene.sky),
            boxes: solids.collect(),
            light,
            strata: (f64::from(scene.sensor.samples_per_pixel).sqrt().ceil() as u32).max(1),
            encoder: Encoder::new(),
        })
    }

    /// Renders view `index` (counted through all groups).
    pub fn render(&self, index: usize) -> Result<RgbImage8, SceneError> {
        let pose = self.scene.pose(index)?;
        let exposure = self.scene.views().nth(index).map_or(1.0, |(_, v)| v.exposure) as f32;
        let size = self.scene.camera.size();
        let seed = hash3(self.scene.seed as i32, (self.scene.seed >> 32) as i32, index as i32, 0x5eed);
        let view = ViewSetup { r: pose.r_cam_from_world.transpose(), centre: pose.centre_m, seed };

        let mut light = vec![0.0_f32; size.width * size.height * 3];
        light.par_chunks_mut(size.width * 3).enumerate().for_each(|(y, row)| {
            let mut shader = Shader::new(self, &view);
            for (x, out) in row.chunks_exact_mut(3).enumerate() {
                let c = shader.pixel(x, y);
                out.copy_from_slice(&scaled(c, exposure));
            }
        });
        if self.scene.sensor.blur_sigma_px > 0.0 {
            light = blurred(&light, size, self.scene.sensor.blur_sigma_px);
        }
        Ok(RgbImage8 { size, data: self.develop(&light, size, seed) })
    }

    /// Noise, sRGB, 8 bits.
    fn develop(&self, light: &[f32], size: ImageSize, seed: u32) -> Vec<u8> {
        let sensor = &self.scene.sensor;
        let middle = linear_from_srgb(0.5);
        // Linear light per grey level at mid grey carries the noise from the encoded scale to the linear one.
        let per_level = (linear_from_srgb(0.5 + 0.5 / 255.0) - linear_from_srgb(0.5 - 0.5 / 255.0)).abs();
        let variance = (sensor.noise_sigma_gl * per_level).powi(2);
        let read = (variance * (1.0 - sensor.shot_fraction)) as f32;
        let shot = (variance * sensor.shot_fraction / middle) as f32;
        let mut data = vec![0_u8; light.len()];
        let row = size.width * 3;
        data.par_chunks_mut(row).zip(light.par_chunks(row)).enumerate().for_each(|(y, (out, light))| {
            for (i, (o, &l)) in out.iter_mut().zip(light).enumerate() {
                let sigma = (read + shot * l.max(0.0)).sqrt();
                let noisy = if sigma > 0.0 { l + sigma * normal(hash3(i as i32, y as i32, 1, seed)) } else { l };
                *o = self.encoder.encode(noisy);
            }
        });
        data
    }
}

/// Shades the pixels of one row; holds lists that are reused from pixel to pixel.
struct Shader<'a> {
    renderer: &'a Renderer<'a>,
    view: &'a ViewSetup,
    /// Boxes the current pixel may see.
    seen: Vec<&'a SolidBox>,
    /// Boxes that may come between the pixel's floor and the light.
    shading: Vec<&'a SolidBox>,
    /// Fraction of the sky that boxes hide from the pixel's floor.
    hidden: f32,
}

/// One sample's numbers besides its ray.
struct Sample {
    footprint: Footprint,
    /// Angular width in radians.
    angle: f64,
    /// Offset into the sequence of shadow rays, and the pixel's own turn of that sequence.
    index: u32,
    turn: [f32; 2],
}

impl<'a> Shader<'a> {
    fn new(renderer: &'a Renderer<'a>, view: &'a ViewSetup) -> Self {
        Self { renderer, view, seen: Vec::new(), shading: Vec::new(), hidden: 0.0 }
    }

    /// The mean light of one pixel.
    fn pixel(&mut self, x: usize, y: usize) -> Rgb {
        let (px, py) = (x as f64, y as f64);
        let renderer = self.renderer;
        let Some(middle) = renderer.optics.middle(px, py) else { return [0.0; 3] };
        let (r, centre) = (self.view.r, self.view.centre);

        // Ray differentials: directions per pixel, then floor coordinates.
        let direction = r * middle.ray;
        let steps = middle.per_pixel.map(|step| r * step);
        let angle = steps[0].norm().max(steps[1].norm()) / middle.ray.norm();

        let n = renderer.strata;
        let (mut nx, mut ny) = (n, n);
        // Beyond the horizon nothing on the floor is resolved.
        let mut floor_per_pixel = None;
        let mut footprint = Footprint::round(1e9);
        if direction.z < -1e-9 {
            let t = -centre.z / direction.z;
            let slide = |s: &Vector3<f64>| {
                let d = (s - direction * (s.z / direction.z)) * t;
                [d.x, d.y]
            };
            let j = [slide(&steps[0]), slide(&steps[1])];
            // More strata along the image axis that covers more floor, fewer along the other.
            let lengths = [j[0][0].hypot(j[0][1]), j[1][0].hypot(j[1][1])];
            let ratio = (lengths[1] / lengths[0]).clamp(0.25, 4.0).sqrt();
            if n > 1 {
                ny = (f64::from(n) * ratio).round() as u32;
                nx = (f64::from(n * n) / f64::from(ny)).round() as u32;
            }
            let j = [j[0].map(|v| v / f64::from(nx)), j[1].map(|v| v / f64::from(ny))];
            let (a, b, c) = (
                j[0][0] * j[0][0] + j[1][0] * j[1][0],
                j[0][1] * j[0][1] + j[1][1] * j[1][1],
                j[0][0] * j[0][1] + j[1][0] * j[1][1],
            );
            let long = 0.5 * (a + b) + (0.25 * (a - b) * (a - b) + c * c).sqrt();
            footprint = Footprint { x: a.sqrt() as f32, y: b.sqrt() as f32, max: long.sqrt() as f32 };
            let at = centre + direction * t;
            floor_per_pixel = Some((at, lengths[0].max(lengths[1])));
        }
        self.candidates(&direction.normalize(), angle, floor_per_pixel);

        let pixel_hash = hash3(x as i32, y as i32, 0, self.view.seed);
        let turn = [unit(rehash(pixel_hash ^ 1)), unit(rehash(pixel_hash ^ 2))];
        let mut sum = [0.0_f32; 3];
        let (inv_x, inv_y) = (1.0 / f64::from(nx), 1.0 / f64::from(ny));
        let straight = renderer.optics.is_straight();
        for sy in 0..ny {
            for sx in 0..nx {
                let index = sy * nx + sx;
                let h = rehash(pixel_hash.wrapping_add(index.wrapping_mul(0x632b_e5ab)));
                let dx = (f64::from(sx) + f64::from(h & 0xffff) / 65536.0) * inv_x - 0.5;
                let dy = (f64::from(sy) + f64::from(h >> 16) / 65536.0) * inv_y - 0.5;
                let d = if straight {
                    direction + steps[0] * dx + steps[1] * dy
                } else {
                    match renderer.optics.near(&middle, [px, py], [dx, dy]) {
                        Some(ray) => r * ray,
                        None => continue,
                    }
                };
                let sample = Sample { footprint, angle: angle * inv_x.max(inv_y), index, turn };
                let c = self.radiance(&d, &sample);
                for k in 0..3 {
                    sum[k] += c[k];
                }
            }
        }
        scaled(sum, 1.0 / (nx * ny) as f32)
    }

    /// Lists the boxes that matter to this pixel, by their bounding spheres.
    fn candidates(&mut self, direction: &Vector3<f64>, angle: f64, floor: Option<(Vector3<f64>, f64)>) {
        let renderer = self.renderer;
        self.seen.clear();
        self.shading.clear();
        self.hidden = 0.0;
        for b in &renderer.boxes {
            let v = b.centre - self.view.centre;
            let along = v.dot(direction);
            let off = (v - direction * along).norm();
            if along > -b.radius && off < b.radius + 2.0 * angle * (along.abs() + b.radius) {
                self.seen.push(b);
            }
            if let Some((at, extent)) = floor {
                let v = b.centre - at;
                let along = v.dot(&renderer.light.to);
                let off = (v - renderer.light.to * along).norm();
                let reach = b.radius + renderer.light.spread * (along.abs() + b.radius) + extent;
                if along > -b.radius - extent && off < reach {
                    self.shading.push(b);
                }
                if v.norm() < 6.0 * b.radius {
                    self.hidden += b.hides_sky([at.x, at.y]) as f32;
                }
            }
        }
        self.hidden = self.hidden.min(0.9);
    }

    /// Light along one ray, whose direction is of any length.
    fn radiance(&self, d: &Vector3<f64>, sample: &Sample) -> Rgb {
        let renderer = self.renderer;
        let origin = &self.view.centre;
        let floor_t = if d.z < 0.0 { -origin.z / d.z } else { f64::INFINITY };
        let mut nearest: Option<(&SolidBox, Hit)> = None;
        let mut limit = floor_t;
        for b in &self.seen {
            if let Some(hit) = b.entry(origin, d, limit) {
                limit = hit.t;
                nearest = Some((b, hit));
            }
        }
        let light = &renderer.light;
        if let Some((b, hit)) = nearest {
            return self.box_light(b, &hit, d, sample);
        }
        if floor_t.is_finite() {
            let at = origin + d * floor_t;
            let lit = self.lit(&at, &self.shading, sample);
            let irradiance = light.ambient * (1.0 - self.hidden) + (1.0 - light.ambient) * lit;
            return scaled(renderer.floor.reflectance([at.x, at.y], sample.footprint), irradiance);
        }
        let unit_d = d / d.norm();
        renderer.sky.radiance([unit_d.x, unit_d.y, unit_d.z], sample.angle as f32)
    }

    fn box_light(&self, b: &SolidBox, hit: &Hit, d: &Vector3<f64>, sample: &Sample) -> Rgb {
        let renderer = self.renderer;
        let light = &renderer.light;
        let at = self.view.centre + d * hit.t;
        let local = b.to_local(&(at - b.centre));
        let side = if hit.positive { 1.0 } else { -1.0 };
        let mut normal = Vector3::zeros();
        normal[hit.axis] = side;
        let normal_world =
            Vector3::new(b.cos * normal.x - b.sin * normal.y, b.sin * normal.x + b.cos * normal.y, normal.z);
        let (face, extent) = match hit.axis {
            0 => ([local.y * side, local.z], [b.half.y, b.half.z]),
            1 => ([-local.x * side, local.z], [b.half.x, b.half.z]),
            _ => ([local.x, local.y], [b.half.x, b.half.y]),
        };
        let slant = (d.dot(&normal_world) / d.norm()).abs().max(0.05);
        let width = (sample.angle * hit.t * d.norm() / slant) as f32;
        let seed = b.seed ^ (hit.axis as u32 * 2 + u32::from(hit.positive));
        let colour = box_reflectance(b.colour, face, extent.map(|v| 2.0 * v), hit.axis == 2, width, seed);

        let facing = (normal_world.dot(&light.to) / light.to.z.max(0.3)).max(0.0) as f32;
        let direct = if facing > 0.0 {
            // Start off the face, so that the box does not shade itself.
            let others: Vec<&SolidBox> = renderer.boxes.iter().filter(|o| !std::ptr::eq(*o, b)).collect();
            facing * self.lit(&at, &others, sample)
        } else {
            0.0
        };
        // Side faces see half the sky and the floor's reflection; the foot of a face sees less of both.
        let height = at.z as f32;
        let ambient = if hit.axis == 2 { 1.0 } else { 0.62 + 0.16 * (height / (height + 0.05)) };
        scaled(colour, light.ambient * ambient + (1.0 - light.ambient) * direct)
    }

    /// The part of the light that is seen from a point.
    fn lit(&self, at: &Vector3<f64>, boxes: &[&SolidBox], sample: &Sample) -> f32 {
        if boxes.is_empty() {
            return 1.0;
        }
        let light = &self.renderer.light;
        if light.spread == 0.0 {
            return if boxes.iter().any(|b| b.entry(at, &light.to, f64::INFINITY).is_some()) { 0.0 } else { 1.0 };
        }
        const RAYS: u32 = 4;
        let mut seen = 0;
        for i in 0..RAYS {
            // The plane's counterpart of the golden-ratio sequence, shifted by the pixel's own offset.
            let n = (sample.index * RAYS + i) as f32;
            let u = (sample.turn[0] + n * 0.754_877_7).fract();
            let v = (sample.turn[1] + n * 0.569_840_3).fract();
            let (a, b) = disc(u, v);
            let to = light.to + light.across[0] * (a * light.spread) + light.across[1] * (b * light.spread);
            if !boxes.iter().any(|o| o.entry(at, &to, f64::INFINITY).is_some()) {
                seen += 1;
            }
        }
        seen as f32 / RAYS as f32
    }
}

/// The unit square onto the unit disc, areas in proportion (concentric squares to concentric circles).
fn disc(u: f32, v: f32) -> (f64, f64) {
    let (a, b) = (2.0 * f64::from(u) - 1.0, 2.0 * f64::from(v) - 1.0);
    let quarter = std::f64::consts::FRAC_PI_4;
    if a == 0.0 && b == 0.0 {
        return (0.0, 0.0);
    }
    let (radius, turn) = if a.abs() > b.abs() { (a, quarter * b / a) } else { (b, 2.0 * quarter - quarter * a / b) };
    (radius * libm::cos(turn), radius * libm::sin(turn))
}

/// A normal deviate from a hash (Box and Muller).
fn normal(h: u32) -> f32 {
    let u = 1.0 - unit(h);
    let v = unit(rehash(h ^ 0xa511_e9b3));
    libm::sqrtf(-2.0 * libm::logf(u)) * libm::cosf(std::f32::consts::TAU * v)
}

/// Linear light to 8-bit sRGB, rounding to nearest.
#[derive(Debug, Clone)]
struct Encoder {
    /// The light at which each code above 0 begins.
    begins: Vec<f32>,
}

impl Encoder {
    fn new() -> Self {
        Self { begins: (0..255).map(|c| linear_from_srgb((f64::from(c) + 0.5) / 255.0) as f32).collect() }
    }

    fn encode(&self, light: f32) -> u8 {
        self.begins.partition_point(|&b| b <= light) as u8
    }
}

/// A Gaussian blur along rows and columns; the border repeats.
fn blurred(light: &[f32], size: ImageSize, sigma_px: f64) -> Vec<f32> {
    let radius = (3.5 * sigma_px).ceil() as isize;
    let mut kernel: Vec<f32> =
        (-radius..=radius).map(|i| libm::exp(-0.5 * (i as f64 / sigma_px).powi(2)) as f32).collect();
    let total: f32 = kernel.iter().sum();
    kernel.iter_mut().for_each(|k| *k /= total);
    let (w, h) = (size.width as isize, size.height as isize);
    let row = size.width * 3;
    let pass = |from: &[f32], horizontal: bool| {
        let mut out = vec![0.0_f32; from.len()];
        out.par_chunks_mut(row).enumerate().for_each(|(y, line)| {
            for (i, o) in line.iter_mut().enumerate() {
                let (x, c) = (i / 3, i % 3);
                *o = (-radius..=radius)
                    .zip(&kernel)
                    .map(|(d, k)| {
                        let xx = if horizontal { (x as isize + d).clamp(0, w - 1) } else { x as isize };
                        let yy = if horizontal { y as isize } else { (y as isize + d).clamp(0, h - 1) };
                        k * from[yy as usize * row + 3 * xx as usize + c]
                    })
                    .sum();
            }
        });
        out
    };
    pass(&pass(light, true), false)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::renderer::scene::{Camera, FloorBox, Group, SceneLens, TextureKind, View};
    use nalgebra::{Matrix3, Vector2};

    fn fisheye(f_px: f64) -> Camera {
        let parameters = [("k1".to_string(), 0.02), ("k2".to_string(), -0.005)].into();
        Camera { lens: Some(SceneLens { model: "fisheye".into(), parameters }), ..Camera::centred([160, 120], f_px) }
    }

    fn view(file: &str, yaw_deg: f64, centre_m: [f64; 3]) -> View {
        View { file: file.into(), yaw_deg, centre_m, pitch_error_deg: 0.0, roll_error_deg: 0.0, exposure: 1.0 }
    }

    fn two_views(camera: Camera, roll_deg: f64) -> Scene {
        let views = vec![view("a.png", 100.0, [0.1, 0.2, 1.4]), view("b.png", 114.0, [0.25, 0.1, 1.5])];
        Scene::new(camera, vec![Group { pitch_down_deg: 55.0, roll_deg, views }])
    }

    fn bilinear(image: &GrayImage, p: &Vector2<f64>) -> Option<f64> {
        let (x, y) = (p.x.floor(), p.y.floor());
        if !(x >= 0.0 && y >= 0.0 && x + 1.0 < image.size().width as f64 && y + 1.0 < image.size().height as f64) {
            return None;
        }
        let (u, v) = (p.x - x, p.y - y);
        let at = |dx: usize, dy: usize| f64::from(image.get(x as usize + dx, y as usize + dy));
        Some((at(0, 0) * (1.0 - u) + at(1, 0) * u) * (1.0 - v) + (at(0, 1) * (1.0 - u) + at(1, 1) * u) * v)
    }

    /// Zero-mean correlation of two samples.
    fn correlation(a: &[f64], b: &[f64]) -> f64 {
        let mean = |v: &[f64]| v.iter().sum::<f64>() / v.len() as f64;
        let (ma, mb) = (mean(a), mean(b));
        let (mut ab, mut aa, mut bb) = (0.0, 0.0, 0.0);
        for (x, y) in a.iter().zip(b) {
            ab += (x - ma) * (y - mb);
            aa += (x - ma) * (x - ma);
            bb += (y - mb) * (y - mb);
        }
        ab / (aa * bb).sqrt()
    }

    /// Maps a distorted pixel of view a to the distorted pixel of view b by the floor's homography.
    fn transfer(scene: &Scene, h: &Matrix3<f64>, p: &Vector2<f64>) -> Option<Vector2<f64>> {
        let (camera, k) = (scene.camera.model(), scene.camera.intrinsics());
        camera.project(&(k.inverse_matrix() * (h * (k.matrix() * camera.unproject(p)?))))
    }

    /// Median correlation of patches, and mean and root mean square of their shift from the truth in pixels.
    fn agreement(scene: &Scene) -> (f64, Vector2<f64>, f64, usize) {
        let renderer = Renderer::new(scene).unwrap();
        let (a, b) = (renderer.render(0).unwrap().to_gray(), renderer.render(1).unwrap().to_gray());
        let h = scene.h_b_from_a(0, 1).unwrap();
        let (mut peaks, mut shifts) = (Vec::new(), Vec::new());
        for cy in (20..a.size().height - 20).step_by(16) {
            for cx in (20..a.size().width - 20).step_by(16) {
                let patch = |sx: f64, sy: f64| -> Option<f64> {
                    let (mut va, mut vb) = (Vec::new(), Vec::new());
                    for dy in -8..=8_i32 {
                        for dx in -8..=8_i32 {
                            let p = Vector2::new((cx as i32 + dx) as f64, (cy as i32 + dy) as f64);
                            let q = transfer(scene, &h, &p)? + Vector2::new(sx, sy);
                            va.push(bilinear(&a, &p)?);
                            vb.push(bilinear(&b, &q)?);
                        }
                    }
                    Some(correlation(&va, &vb))
                };
                let step = 0.7;
                let values =
                    [(0.0, 0.0), (-step, 0.0), (step, 0.0), (0.0, -step), (0.0, step)].map(|(x, y)| patch(x, y));
                let [Some(o), Some(l), Some(r), Some(u), Some(d)] = values else { continue };
                // Vertex of the parabola through three correlations.
                let vertex = |m: f64, p: f64| step * 0.5 * (m - p) / (m - 2.0 * o + p);
                peaks.push(o);
                shifts.push(Vector2::new(vertex(l, r), vertex(u, d)));
            }
        }
        peaks.sort_by(f64::total_cmp);
        let n = shifts.len() as f64;
        let mean = shifts.iter().sum::<Vector2<f64>>() / n;
        let rms = (shifts.iter().map(|s| s.norm_squared()).sum::<f64>() / n).sqrt();
        (peaks[peaks.len() / 2], mean, rms, shifts.len())
    }

    #[test]
    fn the_true_homography_aligns_rendered_floors() {
        let plain = Camera::centred([200, 150], 190.0);
        let skewed = Camera { fy: Some(196.0), cx: Some(105.0), cy: Some(71.0), skew: 2.0, ..plain.clone() };
        let wide = Camera { k1: -0.25, k2: 0.05, p1: 2e-3, p2: -3e-3, ..plain.clone() };
        for (camera, roll) in [(plain, 0.0), (skewed, 30.0), (wide, -20.0), (fisheye(160.0), 5.0)] {
            let mut scene = two_views(camera, roll);
            scene.floor.scale_m = Some(0.14);
            scene.sensor.samples_per_pixel = 9;
            let (peak, mean, rms, patches) = agreement(&scene);
            assert!(patches > 20, "{patches}");
            assert!(peak > 0.95, "median correlation {peak}");
            assert!(mean.norm() < 0.02 && rms < 0.1, "mean shift {mean:?}, rms {rms} over {patches} patches");
        }
    }

    #[test]
    fn the_number_of_threads_does_not_matter() {
        let mut scene = two_views(Camera { k1: -0.2, ..Camera::centred([97, 64], 80.0) }, 15.0);
        scene.sensor.blur_sigma_px = 0.6;
        scene.boxes.list.push(FloorBox {
            centre_m: [0.0, 1.2],
            yaw_deg: 20.0,
            size_m: [0.3, 0.2, 0.3],
            colour: [0.7, 0.5, 0.3],
        });
        let with = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| render_view(&scene, 1).unwrap())
        };
        let one = with(1);
        assert_eq!(one, with(3));
        assert_ne!(one, render_view(&scene, 0).unwrap());
        scene.seed += 1;
        assert_ne!(one, render_view(&scene, 1).unwrap());
    }

    #[test]
    fn a_mark_on_the_floor_is_painted_where_it_projects() {
        for (camera, roll) in [
            (Camera::centred([160, 120], 150.0), 25.0),
            (Camera { k1: -0.3, k2: 0.08, p1: 1e-3, ..Camera::centred([160, 120], 120.0) }, -40.0),
            // More than 180 degrees from corner to corner.
            (fisheye(60.0), 10.0),
        ] {
            let mut scene = two_views(camera, roll);
            scene.floor.contrast = 0.0;
            scene.sensor.noise_sigma_gl = 0.0;
            scene.light.ambient = 1.0;
            let clean = Renderer::new(&scene).unwrap().render(1).unwrap().to_gray();
            let places = [[-0.1, 1.0], [-0.45, 1.3], [0.2, 0.8]];
            // So flat and small that its centre of brightness is the image of its centre to a few hundredths of a pixel.
            let mark = |centre_m| FloorBox { centre_m, yaw_deg: 30.0, size_m: [0.05, 0.05, 1e-5], colour: [0.02; 3] };
            scene.boxes.list = places.map(mark).to_vec();
            let marked = Renderer::new(&scene).unwrap().render(1).unwrap().to_gray();
            for at in places {
                let expected = scene.pixel_from_world(1, &Vector3::new(at[0], at[1], 0.0)).unwrap().unwrap();
                let (mut weight, mut sum) = (0.0, Vector2::zeros());
                for y in 0..marked.size().height {
                    for x in 0..marked.size().width {
                        let p = Vector2::new(x as f64, y as f64);
                        let w = f64::from((clean.get(x, y) - marked.get(x, y)).abs());
                        if w > 0.02 && (p - expected).norm() < 6.0 {
                            weight += w;
                            sum += p * w;
                        }
                    }
                }
                let error = (sum / weight - expected).norm();
                assert!(weight > 0.5 && error < 0.12, "{at:?}: {error} px from {expected:?}, weight {weight}");
            }
        }
    }

    #[test]
    fn a_shadow_falls_away_from_the_light_and_a_box_hides_the_floor() {
        let mut scene = two_views(Camera::centred([320, 240], 300.0), 0.0);
        scene.floor.contrast = 0.0;
        scene.light.azimuth_deg = 180.0;
        scene.light.elevation_deg = 45.0;
        let colour = [0.1, 0.1, 0.8];
        scene.boxes.list = vec![FloorBox { centre_m: [-0.1, 1.1], yaw_deg: 0.0, size_m: [0.2, 0.2, 0.2], colour }];
        let picture = render_view(&scene, 0).unwrap();
        let at = |x: f64, y: f64, z: f64| {
            let p = scene.pixel_from_world(0, &Vector3::new(x, y, z)).unwrap().unwrap();
            let i = 3 * (p.y.round() as usize * 320 + p.x.round() as usize);
            [0, 1, 2].map(|k| i32::from(picture.data[i + k]))
        };
        // Light from -X: lit side at -X, shadow at +X.
        assert!(
            at(0.1, 1.1, 0.0)[0] + 25 < at(-0.45, 1.1, 0.0)[0],
            "{:?} {:?}",
            at(0.1, 1.1, 0.0),
            at(-0.45, 1.1, 0.0)
        );
        let top = at(-0.05, 1.15, 0.2);
        assert!(top[2] > top[0] + 60, "{top:?}");
    }

    #[test]
    fn noise_has_the_deviation_asked_for_at_mid_grey() {
        let mut scene = two_views(Camera::centred([200, 200], 200.0), 0.0);
        scene.floor =
            crate::renderer::scene::Floor { texture: TextureKind::Concrete, contrast: 0.0, ..Default::default() };
        scene.sensor.noise_sigma_gl = 3.0;
        let mean = f64::from(FloorTexture::new(&scene.floor).reflectance([0.0, 0.0], Footprint::round(0.0))[1]);
        scene.groups[0].views[0].exposure = linear_from_srgb(0.5) / mean;
        let picture = render_view(&scene, 0).unwrap();
        let green: Vec<f64> = picture.data.iter().skip(1).step_by(3).map(|&v| f64::from(v)).collect();
        let n = green.len() as f64;
        let middle = green.iter().sum::<f64>() / n;
        let deviation = (green.iter().map(|v| (v - middle).powi(2)).sum::<f64>() / n).sqrt();
        // Rounding to 8 bits adds 1/12; 40000 samples give the deviation to 0.4 %.
        assert!((middle - 127.5).abs() < 0.5, "{middle}");
        assert!((deviation / (9.0_f64 + 1.0 / 12.0).sqrt() - 1.0).abs() < 0.02, "{deviation}");
    }

    #[test]
    fn a_wide_lens_sees_the_horizon_all_round() {
        // Straight down, 200 degrees over the height: floor in the middle, sky at the border on every side.
        let mut scene = two_views(Camera { image_size: [120, 120], ..fisheye(33.0) }, 0.0);
        scene.groups[0].pitch_down_deg = 90.0;
        scene.floor.contrast = 0.0;
        scene.sensor.noise_sigma_gl = 0.0;
        let picture = render_view(&scene, 0).unwrap();
        let blue_less_red = |x: usize, y: usize| {
            let i = 3 * (y * 120 + x);
            i32::from(picture.data[i + 2]) - i32::from(picture.data[i])
        };
        for (x, y) in [(60, 1), (60, 118), (1, 60), (118, 60)] {
            assert!(blue_less_red(x, y) > blue_less_red(60, 60) + 10, "{x} {y}");
        }
        for (x, y) in [(60, 12), (60, 107), (12, 60), (107, 60)] {
            assert!((blue_less_red(x, y) - blue_less_red(60, 60)).abs() < 5, "{x} {y}");
        }
    }

    #[test]
    fn where_the_lens_folds_the_picture_is_black() {
        let mut scene = two_views(Camera { k1: -0.5, ..Camera::centred([200, 150], 60.0) }, 0.0);
        scene.sensor.noise_sigma_gl = 0.0;
        let picture = render_view(&scene, 0).unwrap();
        assert_eq!(picture.data[..3], [0, 0, 0]);
        assert!(picture.data[3 * (75 * 200 + 100)] > 20);
    }
}
