//! Pictures of a scene: a ray for each of four places in a pixel, the textures' values averaged, exposure, noise, eight bits.

use groundcal::{geometry::ImageSize, vision::GrayImage};
use nalgebra::Vector2;
use rayon::prelude::*;

use crate::lies::{
    random::{Random, scrambled},
    scene::Scene,
    texture::Texture,
};

/// Where in a pixel it is looked.
const PLACES: [[f64; 2]; 4] = [[-0.25, -0.25], [0.25, -0.25], [-0.25, 0.25], [0.25, 0.25]];
/// Noise of the sensor in grey values of 0..1.
const SENSOR_SIGMA: f64 = 0.008;
/// Nothing is there.
const EMPTY: f64 = 0.75;

/// All pictures of a scene.
pub(crate) fn pictures(scene: &Scene) -> Vec<GrayImage> {
    let mut all: Vec<GrayImage> = Vec::with_capacity(scene.views.len());
    for (index, view) in scene.views.iter().enumerate() {
        let picture = match view.copy_of.and_then(|original| all.get(original)) {
            Some(original) => original.clone(),
            None => picture(scene, index),
        };
        all.push(picture);
    }
    all
}

fn picture(scene: &Scene, view: usize) -> GrayImage {
    let [width, height] = scene.size;
    let mut exposure = Random::new(scrambled(scene.seed ^ 0xe8_0000 ^ view as u64));
    let (gain, level) = (exposure.uniform(0.92, 1.06), exposure.uniform(-0.02, 0.02));
    let rows: Vec<Vec<f32>> = (0..height)
        .into_par_iter()
        .map(|y| {
            let mut noise = Random::new(scrambled(scene.seed ^ ((view as u64) << 40) ^ ((y as u64) << 8) ^ 0x11));
            let pixel = |x: usize| {
                let sum: f64 =
                    PLACES.iter().map(|[dx, dy]| value(scene, view, &Vector2::new(x as f64 + dx, y as f64 + dy))).sum();
                let grey = gain * sum / PLACES.len() as f64 + level + noise.normal(SENSOR_SIGMA);
                ((grey * 255.0).round().clamp(0.0, 255.0) / 255.0) as f32
            };
            (0..width).map(pixel).collect()
        })
        .collect();
    let size = ImageSize::new(width, height);
    GrayImage::from_rows(size, rows.concat()).unwrap_or_else(|| GrayImage::filled(size, 0.0))
}

fn value(scene: &Scene, view: usize, pixel: &Vector2<f64>) -> f64 {
    if scene.on_bumper(pixel) {
        let carrier = Texture::Speckled { seed: scene.seed ^ 0xb0, coarsest_m: 80.0, contrast: 0.5 };
        return carrier.value(pixel, 1.0);
    }
    let v = &scene.views[view];
    let Some((origin, direction)) = v.ray(pixel, scene.size) else { return EMPTY };
    let Some(seen) = scene.cast(view, &origin, &direction) else { return EMPTY };
    let surface = &scene.surfaces[seen.surface];
    // Between what a pixel covers along and across the direction of sight.
    let footprint = seen.hit.distance / v.optics.fx / seen.hit.cosine.max(0.02).sqrt();
    surface.texture.value(&surface.texture_point(&seen.hit.point), footprint)
}
