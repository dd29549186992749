//! Point scenes: matches of floor points between the two views of plane-normal motions, with noise, outliers and truth.

use nalgebra::{Matrix3, Vector2, Vector3};
use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Mcg;

use crate::{
    geometry::{
        attitude::{attitude_rotation, yaw_rotation},
        camera::Camera,
        homography::Homography,
        intrinsics::Intrinsics,
        lens::Lens,
        plane_view::View,
        size::ImageSize,
    },
    pairs::correspondence::{ImagePair, PointMatch},
};

/// One motion; lengths in the floor's unit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MotionSpec {
    /// The camera's pitch below the horizontal, radians.
    pub pitch_down_rad: f64,
    /// The camera's roll, radians.
    pub roll_rad: f64,
    /// Turn from the first to the second view, counter-clockwise from above, radians.
    pub turn_rad: f64,
    /// Horizontal displacement of the optical centre, in the frame of the first view's heading.
    pub shift: [f64; 2],
    /// Height of the first view over the floor.
    pub height: f64,
    /// Height of the second view over that of the first.
    pub height_ratio: f64,
    /// Error of the second view's pitch and roll, radians: the axis is off the normal.
    pub attitude_error_rad: [f64; 2],
}

impl MotionSpec {
    /// A turn about a vertical axis `offset` away from the optical centre, straight behind it.
    pub fn about_axis(pitch_down_rad: f64, roll_rad: f64, turn_rad: f64, offset: f64, height: f64) -> Self {
        let heading = heading(0.0);
        let axis = -heading * offset;
        let turned = yaw_rotation(-turn_rad) * -axis + axis;
        Self {
            pitch_down_rad,
            roll_rad,
            turn_rad,
            shift: [turned.x, turned.y],
            height,
            height_ratio: 1.0,
            attitude_error_rad: [0.0; 2],
        }
    }

    /// The two views.
    pub fn views(&self) -> [View; 2] {
        let first = View {
            pitch_down_rad: self.pitch_down_rad,
            roll_rad: self.roll_rad,
            yaw_rad: 0.0,
            centre: Vector3::new(0.0, 0.0, self.height),
        };
        let second = View {
            pitch_down_rad: self.pitch_down_rad + self.attitude_error_rad[0],
            roll_rad: self.roll_rad + self.attitude_error_rad[1],
            yaw_rad: self.turn_rad,
            centre: Vector3::new(self.shift[0], self.shift[1], self.height * self.height_ratio),
        };
        [first, second]
    }
}

/// The horizontal direction in which a level camera of the given yaw looks.
fn heading(yaw_rad: f64) -> Vector3<f64> {
    yaw_rotation(yaw_rad).transpose() * (attitude_rotation(0.0, 0.0).transpose() * Vector3::z())
}

/// Nominal [`PointScene::reach`].
pub(crate) const NOMINAL_RANGE: f64 = 30.0;

/// A scene of points.
#[derive(Debug, Clone, PartialEq)]
pub struct PointScene {
    /// The camera, pixels.
    pub intrinsics: Intrinsics,
    /// The lens.
    pub lens: Lens,
    /// The image.
    pub size: ImageSize,
    /// The motions.
    pub motions: Vec<MotionSpec>,
    /// Matches of each motion, outliers included.
    pub matches: usize,
    /// Standard deviation of each coordinate in both images, pixels.
    pub sigma_px: f64,
    /// Fraction of matches whose second point is anywhere in the image.
    pub outlier_fraction: f64,
    /// How far floor points lie at most from below the first view, in its heights.
    pub reach: f64,
    /// Seed of points and noise.
    pub seed: u64,
}

/// The matches of one motion with their truth.
#[derive(Debug, Clone)]
pub(crate) struct SyntheticPair {
    /// Noisy matches.
    pub(crate) pair: ImagePair,
    /// The floor points behind them.
    pub(crate) floor_points: Vec<Vector2<f64>>,
    /// Which matches are not outliers.
    #[cfg(test)]
    pub(crate) is_inlier: Vec<bool>,
}

impl PointScene {
    /// The nominal condition: 1280x960, f = 1000, 1 px of noise, 200 matches a motion, turns of 15 degrees about an axis
    /// 0.2 m away, the floor 3 m below, three attitudes.
    pub fn nominal(seed: u64) -> Self {
        let attitudes: [(f64, f64); 3] = [(50.0, 0.0), (40.0, 30.0), (60.0, -40.0)];
        Self {
            intrinsics: Intrinsics::square(1000.0, 649.5, 469.5),
            lens: Lens::None,
            size: ImageSize::new(1280, 960),
            motions: attitudes
                .iter()
                .map(|(p, r)| MotionSpec::about_axis(p.to_radians(), r.to_radians(), 15f64.to_radians(), 0.2, 3.0))
                .collect(),
            matches: 200,
            sigma_px: 1.0,
            outlier_fraction: 0.0,
            reach: NOMINAL_RANGE,
            seed,
        }
    }

    /// The exact homography of a motion, ideal pixels.
    pub fn homography(&self, motion: usize) -> Option<Homography> {
        let from_floor = |view: &View| {
            let r = attitude_rotation(view.pitch_down_rad, view.roll_rad) * yaw_rotation(view.yaw_rad);
            let columns = [r.column(0).into_owned(), r.column(1).into_owned(), -(r * view.centre)];
            self.intrinsics.matrix() * nalgebra::Matrix3::from_columns(&columns)
        };
        let [a, b] = self.motions.get(motion)?.views();
        Homography::new(from_floor(&b) * from_floor(&a).try_inverse()?).ok()
    }

    /// The matches of every motion; views are numbered 2 i and 2 i + 1 for motion i. Points are drawn uniformly over the first image from
    /// what both views see of the floor within reach; a motion that shows too little of it has fewer.
    pub fn pairs(&self) -> Vec<ImagePair> {
        self.pairs_with_truth().into_iter().map(|p| p.pair).collect()
    }

    /// The same with their truth.
    pub(crate) fn pairs_with_truth(&self) -> Vec<SyntheticPair> {
        (0..self.motions.len()).map(|i| self.pair(i)).collect()
    }

    fn pair(&self, motion: usize) -> SyntheticPair {
        let mut rng = Pcg64Mcg::seed_from_u64(self.seed.wrapping_mul(1_000_003).wrapping_add(motion as u64));
        let [a, b] = self.motions[motion].views();
        let (w, h) = (self.size.width as f64, self.size.height as f64);
        let inside = |p: &Vector2<f64>| p.x >= 0.0 && p.y >= 0.0 && p.x <= w - 1.0 && p.y <= h - 1.0;
        let [to_a, to_b] = [a, b].map(|v| attitude_rotation(v.pitch_down_rad, v.roll_rad) * yaw_rotation(v.yaw_rad));
        let back = to_a.transpose();
        let camera = Camera { size: self.size, intrinsics: self.intrinsics, lens: self.lens };
        let normal = |rng: &mut Pcg64Mcg| -> f64 { StandardNormal.sample(rng) };
        let mut out = SyntheticPair {
            pair: ImagePair { from: 2 * motion, to: 2 * motion + 1, matches: Vec::new() },
            floor_points: Vec::new(),
            #[cfg(test)]
            is_inlier: Vec::new(),
        };
        let outliers = (self.outlier_fraction * self.matches as f64).round() as usize;
        for _ in 0..1000 * self.matches.max(1) {
            if out.floor_points.len() == self.matches {
                break;
            }
            let pixel = Vector2::new(rng.random_range(0.0..w - 1.0), rng.random_range(0.0..h - 1.0));
            let Some(ray) = camera.unproject(&pixel).map(|ray| back * ray) else { continue };
            if ray.z >= 0.0 {
                continue;
            }
            let reach = -a.centre.z / ray.z;
            let point = Vector2::new(a.centre.x + reach * ray.x, a.centre.y + reach * ray.y);
            if (point - a.centre.xy()).norm() > self.reach * a.centre.z {
                continue;
            }
            let from_b = to_b * (Vector3::new(point.x, point.y, 0.0) - b.centre);
            let Some(in_b) = camera.project(&from_b).filter(inside) else { continue };
            let is_outlier = out.floor_points.len() < outliers;
            let mut noisy = |p: Vector2<f64>| p + Vector2::new(normal(&mut rng), normal(&mut rng)) * self.sigma_px;
            let seen_a = noisy(pixel);
            let seen_b = noisy(in_b);
            let seen_b = if is_outlier {
                Vector2::new(rng.random_range(0.0..w - 1.0), rng.random_range(0.0..h - 1.0))
            } else {
                seen_b
            };
            out.pair.matches.push(PointMatch { a: seen_a, b: seen_b, sigma_px: 1.0 });
            out.floor_points.push(point);
            #[cfg(test)]
            out.is_inlier.push(!is_outlier);
        }
        out
    }
}

/// Cosine of the largest angle from the axis at which [`turning_pairs`] sees a point.
const NEAREST_TO_EDGE_ON: f64 = 0.2;

/// Matches of all pairs of views that turn on the spot before `count` points in all directions: `rotations` take the world's axes to
/// each camera's. Pairs of fewer than 20 matches are left out.
pub fn turning_pairs(
    rotations: &[Matrix3<f64>],
    k: &Intrinsics,
    lens: &Lens,
    size: ImageSize,
    count: usize,
    sigma_px: f64,
    seed: u64,
) -> Vec<ImagePair> {
    let mut rng = Pcg64Mcg::seed_from_u64(seed);
    let normal = |rng: &mut Pcg64Mcg| -> f64 { StandardNormal.sample(rng) };
    let directions: Vec<Vector3<f64>> =
        (0..count).map(|_| Vector3::from_fn(|_, _| normal(&mut rng)).normalize()).collect();
    let inside = |p: &Vector2<f64>| {
        p.x >= 0.0 && p.y >= 0.0 && p.x <= size.width as f64 - 1.0 && p.y <= size.height as f64 - 1.0
    };
    let views: Vec<Vec<Option<Vector2<f64>>>> = rotations
        .iter()
        .map(|r| {
            directions
                .iter()
                .map(|d| {
                    let x = r * d;
                    let noise = Vector2::new(normal(&mut rng), normal(&mut rng)) * sigma_px;
                    let p = k.pixel_from_normalised(&lens.project(&x)?) + noise;
                    (x.z > NEAREST_TO_EDGE_ON && inside(&p)).then_some(p)
                })
                .collect()
        })
        .collect();
    let mut pairs = Vec::new();
    for from in 0..views.len() {
        for to in from + 1..views.len() {
            let both = views[from].iter().zip(&views[to]);
            let matches: Vec<PointMatch> =
                both.filter_map(|(a, b)| Some(PointMatch { a: (*a)?, b: (*b)?, sigma_px: 1.0 })).collect();
            if matches.len() >= 20 {
                pairs.push(ImagePair { from, to, matches });
            }
        }
    }
    pairs
}
