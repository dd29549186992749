//! How the time of a calibration grows with the number of its motions: `cargo bench -p groundcal-lab --bench growth`. Each motion is a pair of views
//! of an attitude of its own, with 30 matches; printed are seconds, and the exponent from one number to the next.

#![allow(clippy::expect_used)] // a test or benchmark may end in a panic

use std::time::Instant;

use groundcal::{
    Options, Silent, calibrate_matches,
    pairs::ImagePair,
    synthetic::{MotionSpec, PointScene},
};
use rand::{RngExt, SeedableRng};

const MATCHES: usize = 30;

fn main() {
    let mut before: Option<(usize, f64)> = None;
    for motions in [50, 100, 200, 400] {
        let mut rng = rand_pcg::Pcg64Mcg::seed_from_u64(7);
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
        let start = Instant::now();
        let found = calibrate_matches(&names, scene.size, &pairs, &Options::default(), &Silent).expect("a camera");
        let seconds = start.elapsed().as_secs_f64();
        let exponent = before.map(|(n, s)| (seconds / s).ln() / (motions as f64 / n as f64).ln());
        let exponent = exponent.map_or_else(String::new, |e| format!("   exponent {e:.2}"));
        println!("{motions:>5} motions   {seconds:>7.2} s   fx {:.1} px{exponent}", found.camera.fx);
        before = Some((motions, seconds));
    }
}
