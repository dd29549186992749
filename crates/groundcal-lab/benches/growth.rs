//! How the time of a calibration grows with its motions and its views: `cargo bench -p groundcal-lab --bench growth`. Each motion is a pair of views
//! of an attitude of its own, with 30 matches; the views are those of a robot that drives with its camera in three attitudes, one after the other, and see
//! 20 new points each. Printed are seconds, and the exponent from one number to the next.

#![allow(clippy::expect_used)] // a test or benchmark may end in a panic

use std::{f64::consts::PI, time::Instant};

use groundcal::{
    ImageSize, Options, Silent, calibrate_matches,
    nalgebra::{Rotation3, Vector2, Vector3},
    pairs::{ImagePair, PointMatch},
    synthetic::{MotionSpec, PointScene},
};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

const MATCHES: usize = 30;

/// Views on both sides of one that see its new points, and points a view.
const SEEN_FROM: usize = 4;
const NEW_POINTS: usize = 20;
const SIZE: ImageSize = ImageSize { width: 1024, height: 768 };
const FOCAL_PX: f64 = 800.0;

/// Where a camera sees a point of the floor, pixels, with noise of 0.3; `None`: not in the picture.
fn seen(
    from_level: &Rotation3<f64>,
    [yaw, x, y]: [f64; 3],
    [u, v]: [f64; 2],
    rng: &mut Pcg64Mcg,
) -> Option<Vector2<f64>> {
    let level = Rotation3::from_axis_angle(&Vector3::z_axis(), yaw) * Vector3::new(u - x, v - y, -1.5);
    let p = from_level * level;
    let noise = Vector2::from_fn(|_, _| 0.3 * (0..12).map(|_| rng.random_range(-0.5..0.5)).sum::<f64>());
    let [cx, cy] = SIZE.centre_px();
    let pixel = Vector2::new(cx + FOCAL_PX * p.x / p.z, cy + FOCAL_PX * p.y / p.z) + noise;
    let inside = (0.0..SIZE.width as f64).contains(&pixel.x) && (0.0..SIZE.height as f64).contains(&pixel.y);
    (p.z > 0.05 && inside).then_some(pixel)
}

/// The drive of a robot with its camera in one attitude: pairs of views that follow each other, numbered from `first`.
fn drive(first: usize, views: usize, [pitch, roll]: [f64; 2], rng: &mut Pcg64Mcg, pairs: &mut Vec<ImagePair>) {
    let down = Rotation3::from_axis_angle(&Vector3::x_axis(), PI);
    let from_level = Rotation3::from_axis_angle(&Vector3::z_axis(), roll)
        * Rotation3::from_axis_angle(&Vector3::x_axis(), pitch)
        * down;
    let (mut heading, mut x, mut y) = (0.0_f64, 0.0, 0.0);
    let poses: Vec<[f64; 3]> = (0..views)
        .map(|_| {
            let pose = [heading, x, y];
            heading += rng.random_range(-0.25..0.35);
            (x, y) = (x + 0.1 * heading.cos(), y + 0.1 * heading.sin());
            pose
        })
        .collect();
    let mut tracks: Vec<Vec<(usize, Vector2<f64>)>> = Vec::new();
    for k in 0..views {
        for _ in 0..NEW_POINTS {
            let [yaw, x, y] = poses[k];
            let pixel = [rng.random_range(0.0..1024.0), rng.random_range(0.0..768.0)];
            let [cx, cy] = SIZE.centre_px();
            let ray = Vector3::new((pixel[0] - cx) / FOCAL_PX, (pixel[1] - cy) / FOCAL_PX, 1.0);
            let level = from_level.inverse() * ray;
            if level.z > -0.05 {
                continue;
            }
            let floor = Rotation3::from_axis_angle(&Vector3::z_axis(), -yaw) * (level * (-1.5 / level.z));
            let point = [floor.x + x, floor.y + y];
            let near = k.saturating_sub(SEEN_FROM)..(k + SEEN_FROM).min(views);
            let track = near.filter_map(|i| Some((first + i, seen(&from_level, poses[i], point, rng)?)));
            tracks.push(track.collect());
        }
    }
    for from in first..first + views {
        for to in from + 1..(from + SEEN_FROM).min(first + views) {
            let of =
                |track: &Vec<(usize, Vector2<f64>)>, view: usize| track.iter().find(|(v, _)| *v == view).map(|o| o.1);
            let both = |track| Some(PointMatch { a: of(track, from)?, b: of(track, to)?, sigma_px: 1.0 });
            let near = tracks.iter().skip((from - first).saturating_sub(SEEN_FROM) * NEW_POINTS / 2);
            let matches: Vec<PointMatch> = near.filter_map(both).collect();
            if matches.len() >= 8 {
                pairs.push(ImagePair { from, to, matches });
            }
        }
    }
}

/// Seconds of a calibration, as a row with the exponent since the row before.
fn timed(
    what: &str,
    number: usize,
    names: &[String],
    pairs: &[ImagePair],
    size: ImageSize,
    before: &mut Option<(usize, f64)>,
) {
    let start = Instant::now();
    let found = calibrate_matches(names, size, pairs, &Options::default(), &Silent).expect("a camera");
    let seconds = start.elapsed().as_secs_f64();
    let exponent = before.map(|(n, s)| (seconds / s).ln() / (number as f64 / n as f64).ln());
    let exponent = exponent.map_or_else(String::new, |e| format!("   exponent {e:.2}"));
    println!("{number:>5} {what}   {seconds:>7.2} s   fx {:.1} px{exponent}", found.camera.fx);
    *before = Some((number, seconds));
}

fn main() {
    let mut before: Option<(usize, f64)> = None;
    for views in [99, 201, 402, 1002] {
        let mut rng = Pcg64Mcg::seed_from_u64(11);
        let mut pairs = Vec::new();
        for (k, attitude) in [[0.7, 0.0], [0.61, 1.05], [0.79, -0.87]].into_iter().enumerate() {
            drive(k * views / 3, views / 3, attitude, &mut rng, &mut pairs);
        }
        let names: Vec<String> = (0..views).map(|i| format!("{i:04}.png")).collect();
        timed("views", views, &names, &pairs, SIZE, &mut before);
    }
    before = None;
    for motions in [50, 100, 200, 400, 1000] {
        let mut rng = Pcg64Mcg::seed_from_u64(7);
        let mut scene = PointScene { matches: MATCHES, ..PointScene::nominal(1) };
        scene.motions = (0..motions)
            .map(|_| {
                let (pitch_deg, roll_deg): (f64, f64) = (rng.random_range(40.0..65.0), rng.random_range(-45.0..45.0));
                let (turn_rad, offset) = (rng.random_range(0.15..0.5), rng.random_range(0.0..0.3));
                MotionSpec::about_axis(pitch_deg.to_radians(), roll_deg.to_radians(), turn_rad, offset, 3.0)
            })
            .collect();
        let pairs: Vec<ImagePair> = scene.pairs();
        let names: Vec<String> = (0..2 * motions).map(|i| format!("{i:04}.png")).collect();
        timed("motions", motions, &names, &pairs, scene.size, &mut before);
    }
}
