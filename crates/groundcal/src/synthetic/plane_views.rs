//! Views of one plane from anywhere: points that many views share, with noise and truth.

use nalgebra::{Matrix3, Vector2, Vector3};
use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Mcg;

use crate::{
    geometry::{
        attitude::angles_from_rotation, camera::Camera, intrinsics::Intrinsics, lens::Lens, plane_view::View,
        size::ImageSize,
    },
    pairs::correspondence::{ImagePair, PointMatch},
};

/// A scene of a plane seen from several places; lengths in half the side of the square in which its points lie.
#[derive(Debug, Clone, PartialEq)]
pub struct PlaneViewScene {
    /// The camera, pixels.
    pub intrinsics: Intrinsics,
    /// The lens.
    pub lens: Lens,
    /// The image.
    pub size: ImageSize,
    /// Views.
    pub views: usize,
    /// Least and largest angle between the optical axis and the plane's normal, degrees.
    pub tilt_deg: [f64; 2],
    /// Least and largest turn of the camera about its optical axis, degrees; with one value of it and of the tilt all views see the plane alike.
    pub turn_deg: [f64; 2],
    /// Points of the plane.
    pub points: usize,
    /// Standard deviation of each coordinate, pixels.
    pub sigma_px: f64,
    /// Seed of points, views and noise.
    pub seed: u64,
}

/// What a scene shows, with its truth.
#[derive(Debug, Clone)]
pub(crate) struct PlaneViews {
    /// The matches.
    pairs: Vec<ImagePair>,
    /// Where each view was taken from.
    pub(crate) views: Vec<View>,
    /// The points.
    pub(crate) points: Vec<Vector2<f64>>,
    /// Which points each view sees.
    pub(crate) seen: Vec<Vec<bool>>,
}

/// Part of the image's shorter half side that the plane fills, about.
const FILLED_FRACTION: f64 = 0.8;
/// Fewest points of a pair.
const MIN_POINTS: usize = 6;

impl PlaneViewScene {
    /// Eight views, tilted by up to 50 degrees, of 100 points with 0.3 px of noise: 1280 x 960, f = 1000.
    pub fn nominal(seed: u64) -> Self {
        Self {
            intrinsics: Intrinsics::square(1000.0, 639.5, 479.5),
            lens: Lens::None,
            size: ImageSize::new(1280, 960),
            views: 8,
            tilt_deg: [0.0, 50.0],
            turn_deg: [0.0, 360.0],
            points: 100,
            sigma_px: 0.3,
            seed,
        }
    }

    /// Matches of all pairs of views that share six points or more; a point has the same coordinates in all pairs of a view.
    pub fn pairs(&self) -> Vec<ImagePair> {
        self.views_with_truth().pairs
    }

    /// The same with their truth.
    pub(crate) fn views_with_truth(&self) -> PlaneViews {
        let mut rng = Pcg64Mcg::seed_from_u64(self.seed.wrapping_mul(7_368_787).wrapping_add(11));
        let camera = Camera { size: self.size, intrinsics: self.intrinsics, lens: self.lens };
        let points: Vec<Vector2<f64>> =
            (0..self.points).map(|_| Vector2::from_fn(|_, _| rng.random_range(-1.0..1.0))).collect();
        let mut normal = {
            let mut noise = Pcg64Mcg::seed_from_u64(self.seed.wrapping_mul(1_000_003).wrapping_add(5));
            move || -> f64 { StandardNormal.sample(&mut noise) }
        };
        let (w, h) = (self.size.width as f64, self.size.height as f64);
        let inside = |p: &Vector2<f64>| p.x >= 0.0 && p.y >= 0.0 && p.x <= w - 1.0 && p.y <= h - 1.0;
        let mut out = PlaneViews { pairs: Vec::new(), views: Vec::new(), points: points.clone(), seen: Vec::new() };
        let mut pixels: Vec<Vec<Option<Vector2<f64>>>> = Vec::new();
        for _ in 0..self.views {
            let (rotation, centre) = self.pose(&mut rng);
            let of = |point: &Vector2<f64>| {
                let pixel = camera.project(&(rotation * (point.push(0.0) - centre)))?;
                let noisy = pixel + Vector2::new(normal(), normal()) * self.sigma_px;
                inside(&noisy).then_some(noisy)
            };
            let seen: Vec<Option<Vector2<f64>>> = points.iter().map(of).collect();
            out.seen.push(seen.iter().map(Option::is_some).collect());
            pixels.push(seen);
            let (pitch_down_rad, roll_rad, yaw_rad) = angles_from_rotation(&rotation);
            out.views.push(View { pitch_down_rad, roll_rad, yaw_rad, centre });
        }
        for from in 0..self.views {
            for to in from + 1..self.views {
                let both = pixels[from].iter().zip(&pixels[to]);
                let matches: Vec<PointMatch> =
                    both.filter_map(|(a, b)| Some(PointMatch { a: (*a)?, b: (*b)?, sigma_px: 1.0 })).collect();
                if matches.len() >= MIN_POINTS {
                    out.pairs.push(ImagePair { from, to, matches });
                }
            }
        }
        out
    }

    /// A camera that looks at the middle of the plane from the side of +Z, tilted towards any side, turned about its axis by any angle.
    fn pose(&self, rng: &mut Pcg64Mcg) -> (Matrix3<f64>, Vector3<f64>) {
        let between = |rng: &mut Pcg64Mcg, [low, high]: [f64; 2]| low + (high - low) * rng.random_range(0.0..1.0);
        let tilt = between(rng, self.tilt_deg).to_radians();
        let side = between(rng, [0.0, std::f64::consts::TAU]);
        let turn = between(rng, self.turn_deg).to_radians();
        let shorter = 0.5 * self.size.width.min(self.size.height) as f64;
        let distance = self.intrinsics.fx / (FILLED_FRACTION * shorter) * between(rng, [0.9, 1.6]);
        let aim = Vector3::new(between(rng, [-0.2, 0.2]), between(rng, [-0.2, 0.2]), 0.0);
        let away = Vector3::new(tilt.sin() * side.cos(), tilt.sin() * side.sin(), tilt.cos());
        let z = -away;
        let x = Vector3::new(-side.sin(), side.cos(), 0.0);
        let y = z.cross(&x);
        let (s, c) = turn.sin_cos();
        let rows = [x * c + y * s, y * c - x * s, z].map(|axis| axis.transpose());
        (Matrix3::from_rows(&rows), aim + away * distance)
    }
}
