//! Views of a floor from anywhere, as a pinhole camera takes them that may turn while a picture is read out: plain geometry, nothing of the library's.

use groundcal::{Calibration, ImagePair, ImageSize, PointMatch};
use nalgebra::{Rotation3, Vector2, Vector3};
use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Mcg;

pub(crate) const SIZE: ImageSize = ImageSize { width: 1024, height: 768 };
pub(crate) const FOCAL_PX: f64 = 900.0;
const NOISE_PX: f64 = 0.2;

/// A view from one unit above the floor.
#[derive(Clone, Copy)]
pub(crate) struct FloorView {
    /// Degrees.
    pub(crate) pitch_roll_yaw: [f64; 3],
    /// Over the floor.
    pub(crate) place: [f64; 2],
}

pub(crate) const fn view(pitch_roll_yaw: [f64; 3], place: [f64; 2]) -> FloorView {
    FloorView { pitch_roll_yaw, place }
}

/// How a camera takes pictures.
#[derive(Clone, Copy)]
pub(crate) struct Taken {
    /// fy over fx.
    pub(crate) aspect: f64,
    /// Turn about the floor's normal from the first row to the last, degrees.
    pub(crate) row_turn_deg: f64,
}

/// A pixel of a floor point; `None`: outside of the image.
fn project(floor: [f64; 2], view: &FloorView, taken: Taken) -> Option<Vector2<f64>> {
    let about = |axis, degrees: f64| Rotation3::from_axis_angle(&axis, degrees.to_radians());
    let [pitch, roll, yaw] = view.pitch_roll_yaw;
    // Of the level camera x is right, y down, z ahead; of the world z is up.
    let at = Vector3::new(floor[0] - view.place[0], floor[1] - view.place[1], -1.0);
    let seen = |yaw: f64| {
        let level = about(Vector3::z_axis(), -yaw) * at;
        let level = Vector3::new(level.x, -level.z, level.y);
        let p = about(Vector3::z_axis(), roll) * (about(Vector3::x_axis(), pitch) * level);
        let pixel = Vector2::new(FOCAL_PX * p.x / p.z + 511.5, taken.aspect * FOCAL_PX * p.y / p.z + 383.5);
        (p.z > 0.0).then_some(pixel)
    };
    let mut pixel = seen(yaw)?;
    // The row in which a point is seen hangs on the turn, a little.
    for _ in 0..20 {
        pixel = seen(yaw + taken.row_turn_deg * (pixel.y - 383.5) / 768.0)?;
    }
    let inside = (0.0..=1023.0).contains(&pixel.x) && (0.0..=767.0).contains(&pixel.y);
    inside.then_some(pixel)
}

/// Matches of all pairs of views that share some points; a point has one place in a view.
pub(crate) fn matches(views: &[FloorView], taken: Taken, seed: u64) -> Vec<ImagePair> {
    let mut rng = Pcg64Mcg::seed_from_u64(seed);
    let mut seen: Vec<Vec<Option<Vector2<f64>>>> = Vec::new();
    for _ in 0..600 {
        let floor = [rng.random_range(-2.0..2.0), rng.random_range(-1.0..3.0)];
        let mut noise = || NOISE_PX * <StandardNormal as Distribution<f64>>::sample(&StandardNormal, &mut rng);
        let of_view = |view| project(floor, view, taken).map(|p| p + Vector2::new(noise(), noise()));
        seen.push(views.iter().map(of_view).collect());
    }
    let mut pairs = Vec::new();
    for from in 0..views.len() {
        for to in from + 1..views.len() {
            let both = seen.iter().filter_map(|s| Some(PointMatch::new(s[from]?.into(), s[to]?.into())));
            let matches: Vec<PointMatch> = both.map(|m| PointMatch { sigma_px: NOISE_PX, ..m }).collect();
            if matches.len() >= 6 {
                pairs.push(ImagePair { from, to, matches });
            }
        }
    }
    pairs
}

/// Attitudes of a tripod, pitch and roll in degrees.
pub(crate) const SIX: [[f64; 2]; 6] =
    [[40.0, 5.0], [58.0, 25.0], [50.0, -30.0], [65.0, 60.0], [45.0, -60.0], [55.0, 0.0]];

/// Two views each at attitudes of which the camera turned about the floor's normal, by about 35 degrees.
pub(crate) fn pairs_of_views(attitudes: &[[f64; 2]]) -> Vec<FloorView> {
    let of = |(i, [pitch, roll]): (usize, &[f64; 2])| {
        let (i, yaw) = (i as f64, 50.0 * i as f64);
        [
            view([*pitch, *roll, yaw], [0.1 * i, 0.05 * i]),
            view([*pitch, *roll, yaw + 35.0], [0.1 * i + 0.25, 0.05 * i - 0.2]),
        ]
    };
    attitudes.iter().enumerate().flat_map(of).collect()
}

/// How far the camera is off, in deviations at most.
pub(crate) fn furthest(c: &Calibration, aspect: f64) -> f64 {
    let s = &c.standard_deviation;
    let off = |value: f64, truth: f64, sigma: Option<f64>| (value - truth).abs() / sigma.expect("estimated");
    [
        off(c.camera.fx, FOCAL_PX, s.fx),
        off(c.camera.fy, aspect * FOCAL_PX, s.fy),
        off(c.camera.cx, 511.5, s.cx),
        off(c.camera.cy, 383.5, s.cy),
    ]
    .into_iter()
    .fold(0.0, f64::max)
}
