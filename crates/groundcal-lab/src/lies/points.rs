//! Matches of a scene without pictures: points of the surfaces, found in each picture with noise, matched by identity, some of them
//! wrongly. A point has one position in a picture, whichever pair it is matched in, as features have.

use groundcal::pairs::{ImagePair, PointMatch};
use nalgebra::{Vector2, Vector3};

use crate::lies::{
    random::{Random, scrambled},
    scene::{NoiseKind, Scene},
};

/// A point of a surface, in the frame of the surface; or of the carrier, in pixels.
#[derive(Clone, Copy)]
enum Anchor {
    Surface { surface: usize, point: Vector3<f64> },
    Carrier { pixel: Vector2<f64> },
}

/// Where a point was found in a picture, and from how far.
#[derive(Clone, Copy)]
struct Found {
    pixel: Vector2<f64>,
    distance: f64,
}

/// Matchers lose a point whose size in the picture changes by more than this.
const MAX_SCALE: f64 = 3.0;
/// Fewer matches than this are not written down.
const MIN_MATCHES: usize = 6;
/// Up to this many pictures all pairs are matched; beyond, each with so many that follow it, round the ring.
const ALL_PAIRS: usize = 12;
const NEIGHBOUR_RANGE: usize = 3;

/// The matches of all pairs.
pub(crate) fn matches(scene: &Scene) -> Vec<ImagePair> {
    let mut random = Random::new(scrambled(scene.seed ^ 0x706f_696e));
    let anchors = anchors(scene, &mut random);
    let found = found(scene, &anchors, &mut random);
    let count = scene.views.len();
    let mut pairs = Vec::new();
    for from in 0..count {
        for to in from + 1..count {
            let apart = (to - from).min(from + count - to);
            let named = scene.named.as_ref().is_some_and(|n| n.contains(&(from, to)) || n.contains(&(to, from)));
            if count > ALL_PAIRS && apart > NEIGHBOUR_RANGE && !named {
                continue;
            }
            let matches = pair(scene, (from, to), &anchors, &found, &mut random);
            if matches.len() >= MIN_MATCHES {
                pairs.push(ImagePair { from, to, matches });
            }
        }
    }
    pairs
}

/// Points to be found: in each picture about as many as asked for, spread over it.
fn anchors(scene: &Scene, random: &mut Random) -> Vec<Anchor> {
    let [left, top, right, bottom] = scene.matching.window;
    let (width, height) = (scene.size[0] as f64, scene.size[1] as f64);
    let most = scene.surfaces.iter().map(|s| s.richness).fold(1e-9, f64::max);
    let mut all = Vec::new();
    for (index, view) in scene.views.iter().enumerate().filter(|(_, v)| v.copy_of.is_none()) {
        let (mut tries, mut here) = (0, 0);
        while here < scene.matching.points && tries < 20 * scene.matching.points {
            tries += 1;
            let pixel =
                Vector2::new(random.uniform(left, right) * width - 0.5, random.uniform(top, bottom) * height - 0.5);
            if scene.on_bumper(&pixel) {
                if index == 0 {
                    all.push(Anchor::Carrier { pixel });
                }
                here += 1;
                continue;
            }
            let Some((origin, direction)) = view.ray(&pixel, scene.size) else { continue };
            let Some(seen) = scene.cast(index, &origin, &direction) else { continue };
            // Floor seen at less than five degrees shows nothing.
            if seen.hit.cosine < 0.09 || !random.chance(scene.surfaces[seen.surface].richness / most) {
                continue;
            }
            all.push(Anchor::Surface { surface: seen.surface, point: seen.hit.point });
            here += 1;
        }
    }
    all
}

/// `[view][anchor]`.
fn found(scene: &Scene, anchors: &[Anchor], random: &mut Random) -> Vec<Vec<Option<Found>>> {
    let mut all: Vec<Vec<Option<Found>>> = Vec::with_capacity(scene.views.len());
    for (index, view) in scene.views.iter().enumerate() {
        if let Some(original) = view.copy_of {
            let same = all.get(original).cloned().unwrap_or_else(|| vec![None; anchors.len()]);
            all.push(same);
            continue;
        }
        let field = SmoothField::new(random, scene.size);
        let row = anchors.iter().map(|anchor| {
            let (exact, distance) = exact_pixel(scene, index, anchor)?;
            if !random.chance(scene.matching.repeatability) {
                return None;
            }
            let pixel = disturbed(scene, &exact, &field, 1.0, random);
            scene.inside(&pixel).then_some(Found { pixel, distance })
        });
        all.push(row.collect());
    }
    all
}

/// Where a view shows a point and from how far; `None` where something hides it.
fn exact_pixel(scene: &Scene, view: usize, anchor: &Anchor) -> Option<(Vector2<f64>, f64)> {
    let (surface, point) = match anchor {
        Anchor::Carrier { pixel } => return Some((*pixel, 1.0)),
        Anchor::Surface { surface, point } => (*surface, point),
    };
    let world = scene.surfaces[surface].placement(view).outward(point);
    let v = &scene.views[view];
    let pixel = v.pixel(&world, scene.size)?;
    if !scene.inside(&pixel) || scene.on_bumper(&pixel) {
        return None;
    }
    let distance = (world - v.pose.centre).norm();
    if scene.surfaces.len() > 1 {
        let (origin, direction) = v.ray(&pixel, scene.size)?;
        let seen = scene.cast(view, &origin, &direction)?;
        if seen.surface != surface || (seen.hit.distance - distance).abs() > 0.02 * distance {
            return None;
        }
    }
    Some((pixel, distance))
}

/// Smooth over a picture, each coordinate of unit deviation.
struct SmoothField {
    waves: Vec<(Vector2<f64>, f64, Vector2<f64>)>,
}

impl SmoothField {
    fn new(random: &mut Random, size: [usize; 2]) -> Self {
        let width = size[0] as f64;
        let wave = |_| {
            let direction = random.level_direction().xy();
            let frequency = std::f64::consts::TAU * random.uniform(0.7, 2.5) / width;
            let phase = random.uniform(0.0, std::f64::consts::TAU);
            (direction * frequency, phase, Vector2::new(random.normal(1.0), random.normal(1.0)))
        };
        Self { waves: (0..8).map(wave).collect() }
    }

    fn at(&self, p: &Vector2<f64>) -> Vector2<f64> {
        if self.waves.is_empty() {
            return Vector2::zeros();
        }
        let sum: Vector2<f64> = self.waves.iter().map(|(k, phase, a)| a * (k.dot(p) + phase).cos()).sum();
        sum / (0.5 * self.waves.len() as f64).sqrt()
    }
}

fn disturbed(scene: &Scene, p: &Vector2<f64>, field: &SmoothField, times: f64, random: &mut Random) -> Vector2<f64> {
    let sigma = scene.matching.sigma_px * times;
    match scene.matching.kind {
        NoiseKind::Normal => p + Vector2::new(random.normal(sigma), random.normal(sigma)),
        NoiseKind::HeavyTailed => p + Vector2::new(random.heavy_tailed(sigma), random.heavy_tailed(sigma)),
        NoiseKind::Correlated => {
            let own = Vector2::new(random.normal(sigma), random.normal(sigma));
            p + (own + field.at(p) * sigma) * std::f64::consts::FRAC_1_SQRT_2
        }
        NoiseKind::Quantised(step) => {
            let noisy = p + Vector2::new(random.normal(sigma), random.normal(sigma));
            noisy.map(|v| (v / step).round() * step)
        }
    }
}

/// The matches of one pair.
fn pair(
    scene: &Scene,
    (from, to): (usize, usize),
    anchors: &[Anchor],
    found: &[Vec<Option<Found>>],
    random: &mut Random,
) -> Vec<PointMatch> {
    let matching = &scene.matching;
    let alias = scene.aliases.iter().find(|a| a.pair == (from, to));
    let blur = matching.blurred.iter().find(|b| (b.0, b.1) == (from, to)).map(|b| b.2);
    let field = SmoothField { waves: Vec::new() };
    let mut matches = Vec::new();
    for (i, anchor) in anchors.iter().enumerate() {
        let Some(a) = found[from][i] else { continue };
        let b = match (alias, anchor) {
            (Some(alias), Anchor::Surface { surface, point }) => {
                let pitch = scene.surfaces[*surface].texture.period_m().unwrap_or(1.0);
                let point = alias.mistaken(point, pitch);
                exact_pixel(scene, to, &Anchor::Surface { surface: *surface, point })
                    .map(|(exact, distance)| Found { pixel: disturbed(scene, &exact, &field, 1.0, random), distance })
            }
            _ => found[to][i],
        };
        let Some(mut b) = b else { continue };
        let scale = a.distance / b.distance;
        if !(1.0 / MAX_SCALE..MAX_SCALE).contains(&scale) {
            continue;
        }
        if let Some(times) = blur {
            b.pixel = disturbed(scene, &b.pixel, &field, times, random);
        }
        matches.push((a.pixel, b.pixel));
    }
    // A matcher's order says nothing, and more than enough is enough.
    let order = random.order(matches.len());
    let kept: Vec<_> = order.into_iter().take(matching.most).map(|i| matches[i]).collect();
    spoiled(scene, kept, random)
}

/// Wrong matches in the place of some, and deviations that are not those of the matches.
fn spoiled(scene: &Scene, right: Vec<(Vector2<f64>, Vector2<f64>)>, random: &mut Random) -> Vec<PointMatch> {
    let matching = &scene.matching;
    let (width, height) = (scene.size[0] as f64, scene.size[1] as f64);
    // A thing that was carried on between the pictures: turned and shifted in the picture.
    let (sine, cosine) = random.either_sign(0.05, 0.6).sin_cos();
    let shift = Vector2::new(random.either_sign(0.05, 0.3) * width, random.either_sign(0.05, 0.3) * height);
    let centre = Vector2::new(width, height) * 0.5;
    let mut out = Vec::with_capacity(right.len());
    for (a, mut b) in right {
        if random.chance(matching.outliers) {
            b = if random.chance(matching.conspiracy) {
                let d = a - centre;
                let noise = Vector2::new(random.normal(matching.sigma_px), random.normal(matching.sigma_px));
                centre + Vector2::new(cosine * d.x - sine * d.y, sine * d.x + cosine * d.y) + shift + noise
            } else {
                Vector2::new(random.uniform(0.0, width - 1.0), random.uniform(0.0, height - 1.0))
            };
            if !scene.inside(&b) {
                continue;
            }
        }
        let sigma_px = matching.wrong_sigmas.map_or(1.0, |factor| random.log_uniform(1.0 / factor, factor));
        out.push(PointMatch { a, b, sigma_px });
    }
    out
}
