//! Time of each stage on one thread: `cargo bench -p groundcal-lab --bench stages [-- refinement]`. Prints the median and the fastest of repeated runs.

#![allow(clippy::expect_used)] // a test or benchmark may end in a panic

use std::{hint::black_box, time::Instant};

use nalgebra::{Vector2, Vector3};

use groundcal::{
    calibrate::{MotionModel, Options, Silent, calibrate_matches},
    geometry::Frame,
    pairs::{HomographyEstimate, ImagePair, RobustOptions, estimate_robust, gold_standard_homography},
    start::{Constraint, weighted_camera},
    synthetic::{MotionSpec, PointScene},
    vision::{FeatureOptions, MatchOptions, PatchOptions, detect, match_features, match_patches, template_grid},
};
use groundcal_lab::renderer::{
    render::render_view,
    scene::{Camera, Group, Scene, TextureKind, View},
};

fn time<T>(name: &str, runs: usize, mut work: impl FnMut() -> T) -> f64 {
    let mut times: Vec<f64> = (0..runs)
        .map(|_| {
            let start = Instant::now();
            black_box(work());
            start.elapsed().as_secs_f64()
        })
        .collect();
    times.sort_by(f64::total_cmp);
    println!("{name:<52} median {:>10.1} us   fastest {:>10.1} us", 1e6 * times[runs / 2], 1e6 * times[0]);
    times[runs / 2]
}

fn main() {
    // `cargo bench` and `cargo test --benches` pass flags of their own; `refinement` chooses that alone.
    let single = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a thread");
    if !std::env::args().any(|argument| argument == "refinement") {
        single.install(run);
    }
    single.install(refinement);
}

fn run() {
    let view = |file: &str, yaw_deg: f64| View {
        file: file.into(),
        yaw_deg,
        centre_m: [0.0, 0.0, 1.4],
        pitch_error_deg: 0.0,
        roll_error_deg: 0.0,
        exposure: 1.0,
    };
    let views = vec![view("a.png", 0.0), view("b.png", 20.0)];
    let mut scene =
        Scene::new(Camera::centred([1024, 768], 900.0), vec![Group { pitch_down_deg: 50.0, roll_deg: 10.0, views }]);
    scene.floor.texture = TextureKind::Tiles;
    let [a, b] = [0, 1].map(|i| render_view(&scene, i).expect("a picture").to_gray());
    let options = FeatureOptions::default();
    time("features of a 1024x768 image", 7, || detect(&a, &options));
    let (fa, fb) = (detect(&a, &options), detect(&b, &options));
    time("matches of a pair (3000 features each)", 7, || match_features(&fa, &fb, &MatchOptions::default()));

    let options = PatchOptions::default();
    time("templates of a 1024x768 image", 7, || template_grid(&a, &options));
    let grid = template_grid(&a, &options);
    // Half a pixel off, as features leave it.
    let h: nalgebra::Matrix3<f64> = scene.h_b_from_a(0, 1).expect("a homography");
    let map = |p: &Vector2<f64>| {
        let q = h * Vector3::new(p.x, p.y, 1.0);
        (q.z > 0.0).then(|| Vector2::new(q.x / q.z + 0.4, q.y / q.z - 0.3))
    };
    let match_all = || match_patches(&a, &grid, &b, &map, &options);
    let found = match_all();
    let steps = found.iter().map(|m| m.iterations).sum::<usize>() as f64 / found.len() as f64;
    let median_s = time("least squares matching of a pair's patches", 15, match_all);
    let per_thousand = 1e3 * median_s * 1e3 / found.len() as f64;
    println!(
        "  {} of {} templates found in {steps:.1} steps; {per_thousand:.1} ms per 1000 patches of 21x21 pixels",
        found.len(),
        grid.len()
    );

    for (matches, outliers) in [(200, 0.0), (200, 0.3), (200, 0.6), (2000, 0.0), (2000, 0.3), (2000, 0.6)] {
        let scene = PointScene { matches, outlier_fraction: outliers, ..PointScene::nominal(1) };
        let pair = &scene.pairs()[0].pair;
        let frame = Frame::new(scene.size, None);
        let name = format!("robust homography, {matches} matches, {:.0} % outliers", 100.0 * outliers);
        time(&name, 51, || estimate_robust(&pair.matches, &frame, &RobustOptions::default()));
    }

    let mut scene = PointScene::nominal(1);
    scene.motions = [(50.0, 0.0), (40.0, 30.0), (60.0, -40.0), (45.0, 60.0), (55.0, -15.0), (35.0, 10.0)]
        .map(|(p, r): (f64, f64)| MotionSpec::about_axis(p.to_radians(), r.to_radians(), 0.3, 0.2, 3.0))
        .to_vec();
    let frame = Frame::new(scene.size, None);
    let estimates: Vec<HomographyEstimate> = scene
        .pairs()
        .iter()
        .map(|p| gold_standard_homography(&p.pair.matches, &frame).expect("a homography"))
        .collect();
    // `auto` is for the whole way.
    for constraint in Constraint::ALL.into_iter().filter(|c| *c != Constraint::Auto) {
        let to_camera = || weighted_camera(&estimates, constraint, 1.0);
        time(&format!("six homographies to K, {}", constraint.name()), 501, to_camera);
    }
}

fn refinement() {
    // A calibration from matches, nearly all of which is the joint refinement: motions of one attitude each.
    for (motions, matches) in [(6, 1000), (12, 500), (25, 500), (50, 500), (100, 500)] {
        let scene = PointScene {
            motions: (0..motions)
                .map(|i| {
                    let part = f64::from(i) / f64::from(motions - 1);
                    MotionSpec::about_axis(0.6 + 0.35 * part, -0.5 + part, 0.4, 0.3, 1.0)
                })
                .collect(),
            matches,
            sigma_px: 0.05,
            ..PointScene::nominal(1)
        };
        let pairs: Vec<ImagePair> = scene.pairs().into_iter().map(|p| p.pair).collect();
        let names: Vec<String> = (0..2 * motions).map(|i| i.to_string()).collect();
        let told = Some(pairs.iter().map(|p| (p.from, p.to)).collect());
        let options = Options { pairs: told, motion: MotionModel::PlaneNormal, ..Options::default() };
        let observations: usize = pairs.iter().map(|p| 2 * p.matches.len()).sum();
        let name = format!("calibration from matches, {motions} motions, {observations} observations");
        let seconds = time(&name, if motions < 20 { 7 } else { 3 }, || {
            calibrate_matches(&names, scene.size, &pairs, &options, &Silent).expect("a camera")
        });
        println!("{:<52} {:.2} us an observation", "", 1e6 * seconds / observations as f64);
    }
}
