//! Time of each stage on one thread: `cargo bench -p groundcal-lab --bench stages [-- refinement]`. Prints the median and the fastest of repeated runs.

#![allow(clippy::expect_used)] // a test or benchmark may end in a panic

use std::{hint::black_box, time::Instant};

use nalgebra::{Vector2, Vector3};

use groundcal::{
    geometry::{Frame, ImageSize, Intrinsics, Lens, attitude_rotation, yaw_rotation},
    pairs::{HomographyEstimate, PointMatch, RefineOptions, RobustOptions, estimate_robust, from_homography, refine},
    refine::{
        BundleOptions, CameraState, CameraUnknowns, FrameState, GroupState, Kind, Observation, SceneModel, State,
        Track, adjust,
    },
    select::{HorizonSides, Motion},
    start::{CameraOptions, solve_camera},
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
        .map(|p| {
            let matches: &[PointMatch] = &p.pair.matches;
            refine(matches, None, &frame, &RefineOptions::default()).expect("a homography")
        })
        .collect();
    for constraint in groundcal::start::Constraint::ALL {
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
                    Some(Motion {
                        from: (2 * i).into(),
                        to: (2 * i + 1).into(),
                        geometry: from_homography(e).ok()?,
                        sides: HorizonSides::One,
                    })
                })
                .collect();
            solve_camera(&motions, &frame, &options)
        };
        time(&format!("six homographies to K, {}", constraint.name()), 501, to_camera);
    }
}

/// Views of a camera that turns and moves on along a floor, each seeing the points ahead of it, with 0.05 px of noise.
fn drive(views: usize, points_a_view: usize) -> (Vec<Track>, State) {
    let attitude = attitude_rotation(0.9, 0.1);
    let k = Intrinsics::square(900.0, 511.5, 383.5);
    let group = GroupState { attitude, ln_height: 0.0 };
    let poses: Vec<FrameState> = (0..views)
        .map(|v| FrameState {
            group: 0,
            delta_rad: [0.0; 2],
            yaw_rad: 0.2 * (v as f64 * 0.9).sin(),
            position: Vector2::new(0.25 * v as f64, 0.0),
            ln_height_ratio: 0.0,
            departure: groundcal::refine::Departure::default(),
        })
        .collect();
    let rotations: Vec<_> = poses.iter().map(|p| attitude * yaw_rotation(p.yaw_rad)).collect();
    // A low-discrepancy cover of the strip that is seen.
    let length = 0.25 * views as f64 + 2.0;
    let count = (points_a_view as f64 * length / 1.1) as usize;
    let (golden, plastic) = (0.618_033_988_749_895, 0.754_877_666_246_693);
    let tracks = (0..count)
        .filter_map(|i| {
            let at = |step: f64| (i as f64 * step).fract();
            let (x, y) = (length * at(golden), 1.6 * at(plastic) - 0.8);
            let seen = poses.iter().zip(&rotations).enumerate().filter_map(|(v, (p, r))| {
                let c = r * Vector3::new(x - p.position.x, y - p.position.y, -1.0);
                let pixel = k.pixel_from_normalised(&Vector2::new(c.x / c.z, c.y / c.z));
                let inside = c.z > 0.1 && (0.0..1023.0).contains(&pixel.x) && (0.0..767.0).contains(&pixel.y);
                let wobble = |n: usize| 0.05 * ((n * 7919 + i * 104_729 + v * 1_299_709) as f64).sin();
                inside.then(|| Observation::new(v, pixel + Vector2::new(wobble(1), wobble(2)), 0.05))
            });
            let observations: Vec<Observation> = seen.collect();
            (observations.len() >= 2).then_some(Track { kind: Kind::Patch, observations })
        })
        .collect();
    let frame = Frame::new(ImageSize::new(1024, 768), None);
    let camera = CameraState::new(&Intrinsics::square(905.0, 513.0, 381.0), &Lens::radial(0.0, 0.0), &frame);
    (tracks, State::of_one_camera(camera, vec![group], poses))
}

fn refinement() {
    let frame = Frame::new(ImageSize::new(1024, 768), None);
    let options = |frame: Frame| {
        BundleOptions::new(vec![CameraUnknowns {
            matrix_priors: [None, Some((0.0, 0.003)), Some((0.0, 0.12)), Some((0.0, 0.12)), None],
            // k1, k2, p1, p2 free and k3 on demand, as in a calibration.
            lens_free: vec![true; 4],
            lens_priors: [0.3, 0.3, 1e-3, 1e-3].map(|sigma| Some((0.0, sigma))).to_vec(),
            lens_on_demand: vec![(4, (0.0, 0.3))],
            ..CameraUnknowns::new(frame, [1.14, 0.86])
        }])
    };
    // Six motions of a thousand points.
    let scene = PointScene {
        motions: (0..6)
            .map(|i| MotionSpec::about_axis(0.6 + 0.07 * f64::from(i), -0.5 + 0.2 * f64::from(i), 0.4, 0.3, 1.0))
            .collect(),
        matches: 1000,
        sigma_px: 0.05,
        ..PointScene::nominal(1)
    };
    let pairs = scene.pairs();
    let tracks: Vec<Track> = pairs
        .iter()
        .flat_map(|p| {
            p.pair.matches.iter().map(|m| {
                let seen = |frame: usize, pixel: Vector2<f64>| Observation::new(frame, pixel, 0.05);
                Track { kind: Kind::Patch, observations: vec![seen(p.pair.from, m.a), seen(p.pair.to, m.b)] }
            })
        })
        .collect();
    let frame_of_scene = Frame::new(scene.size, None);
    let camera = CameraState::new(&Intrinsics::square(1005.0, 640.0, 480.0), &Lens::radial(0.0, 0.0), &frame_of_scene);
    let groups = scene
        .motions
        .iter()
        .map(|m| GroupState { attitude: attitude_rotation(m.pitch_down_rad, m.roll_rad), ln_height: 0.0 });
    let views = scene.motions.iter().enumerate().flat_map(|(g, m)| {
        m.views().map(|v| FrameState {
            group: g,
            delta_rad: [0.0; 2],
            yaw_rad: v.yaw_rad,
            position: v.centre.xy(),
            ln_height_ratio: 0.0,
            departure: groundcal::refine::Departure::default(),
        })
    });
    let start = State::of_one_camera(camera, groups.collect(), views.collect());
    let of_scene = options(frame_of_scene);
    time("joint refinement, 6 motions x 1000 points, covariance", 7, || {
        adjust(SceneModel::Floor, &tracks, vec![start.clone()], &of_scene).expect("refined")
    });
    // Growth, the variance components given.
    let given = BundleOptions { attitude_sigma_rad: Some(0.0005), height_sigma: Some(0.001), ..options(frame) };
    for views in [25, 50, 100, 200] {
        let (tracks, start) = drive(views, 500);
        let observations: usize = tracks.iter().map(|t| t.observations.len()).sum();
        let seconds = time(&format!("joint refinement, {views} views, {observations} observations"), 3, || {
            adjust(SceneModel::Floor, &tracks, vec![start.clone()], &given).expect("refined")
        });
        println!("{:<52} {:.2} us an observation", "", 1e6 * seconds / observations as f64);
    }
}
