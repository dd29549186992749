//! Time of each stage on one thread: `cargo bench`. Prints the median and the fastest of repeated runs.

#![allow(clippy::expect_used)] // a test or benchmark may end in a panic

use std::{hint::black_box, time::Instant};

use nalgebra::{Vector2, Vector3};

use groundcal::{
    attitude_groups::{Motion, Sides},
    camera::{CameraOptions, solve_camera},
    circular_points::from_homography,
    correspondence::PointMatch,
    features::{FeatureOptions, MatchOptions, detect, match_features},
    frame::Frame,
    homography::{HomographyEstimate, RobustOptions, estimate_robust, refine::RefineOptions, refine::refine},
    least_squares_matching::{PatchOptions, match_patches, template_grid},
    synthetic::{
        points::{MotionSpec, PointScene},
        render::render_view,
        scene::{Camera, Group, Scene, TextureKind, View},
    },
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
    // `cargo bench` and `cargo test --benches` pass flags of their own; there is nothing to choose.
    let single = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a thread");
    single.install(run);
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
        .map(|p| {
            let matches: &[PointMatch] = &p.pair.matches;
            refine(matches, None, &frame, &RefineOptions::default()).expect("a homography")
        })
        .collect();
    for constraint in groundcal::absolute_conic::Constraint::ALL {
        let options = CameraOptions {
            given: Vec::new(),
            constraint,
            aspect: 1.0,
            aspect_sigma: 0.003,
            principal_point_sigma_px: 64.0,
            attitude_sigma_rad: 0.0,
            estimate_attitude_sigma: false,
        };
        let to_camera = || {
            let motions: Vec<Motion> = estimates
                .iter()
                .enumerate()
                .filter_map(|(i, e)| {
                    Some(Motion { from: 2 * i, to: 2 * i + 1, geometry: from_homography(e).ok()?, sides: Sides::One })
                })
                .collect();
            solve_camera(&motions, &frame, &options)
        };
        time(&format!("six homographies to K, {}", constraint.name()), 501, to_camera);
    }
}
