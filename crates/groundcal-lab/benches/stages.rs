//! Time of each stage on one thread: `cargo bench -p groundcal-lab --bench stages [-- refinement]`. Prints the median and the fastest of repeated runs.

#![allow(clippy::expect_used)] // a test or benchmark may end in a panic

use std::{hint::black_box, sync::Mutex, time::Instant};

use groundcal::{
    MotionModel, Observer, Options, Silent, Stage, calibrate_images, calibrate_matches,
    geometry::Frame,
    pairs::{HomographyEstimate, ImagePair, RobustOptions, gold_standard_homography, robust_homography},
    result::Method,
    start::{Constraint, closed_form},
    synthetic::{MotionSpec, PointScene},
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
    show(name, &mut times)
}

/// Prints a line and gives the median.
fn show(name: &str, times: &mut [f64]) -> f64 {
    times.sort_by(f64::total_cmp);
    let median = times[times.len() / 2];
    println!("{name:<52} median {:>10.1} us   fastest {:>10.1} us", 1e6 * median, 1e6 * times[0]);
    median
}

/// When each stage of a calibration began.
#[derive(Default)]
struct Watch(Mutex<Vec<(Stage, Instant)>>);

impl Observer for Watch {
    fn begin(&self, stage: Stage, _total: usize) {
        self.0.lock().expect("no panic").push((stage, Instant::now()));
    }
}

impl Watch {
    /// How long each took, until the next began; the last until now.
    fn seconds(&self) -> Vec<(Stage, f64)> {
        let begun = self.0.lock().expect("no panic");
        let ends = begun.iter().skip(1).map(|(_, at)| *at).chain([Instant::now()]);
        begun.iter().zip(ends).map(|((stage, at), end)| (*stage, (end - *at).as_secs_f64())).collect()
    }
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
    let names = ["a.png", "b.png"].map(String::from);
    let runs: Vec<Vec<(Stage, f64)>> = (0..7)
        .map(|_| {
            let watch = Watch::default();
            calibrate_images(&names, &[a.clone(), b.clone()], &Options::default(), &watch).expect("a camera");
            watch.seconds()
        })
        .collect();
    for (i, (stage, _)) in runs[0].iter().enumerate() {
        let mut times: Vec<f64> = runs.iter().filter_map(|run| run.get(i).map(|(_, seconds)| *seconds)).collect();
        show(&format!("two pictures of 1024x768: {stage:?}"), &mut times);
    }

    for (matches, outliers) in [(200, 0.0), (200, 0.3), (200, 0.6), (2000, 0.0), (2000, 0.3), (2000, 0.6)] {
        let scene = PointScene { matches, outlier_fraction: outliers, ..PointScene::nominal(1) };
        let pair = &scene.pairs()[0];
        let frame = Frame::new(scene.size, None);
        let name = format!("robust homography, {matches} matches, {:.0} % outliers", 100.0 * outliers);
        time(&name, 51, || robust_homography(&pair.matches, &frame, &RobustOptions::default(), 0));
    }

    let mut scene = PointScene::nominal(1);
    scene.motions = [(50.0, 0.0), (40.0, 30.0), (60.0, -40.0), (45.0, 60.0), (55.0, -15.0), (35.0, 10.0)]
        .map(|(p, r): (f64, f64)| MotionSpec::about_axis(p.to_radians(), r.to_radians(), 0.3, 0.2, 3.0))
        .to_vec();
    let frame = Frame::new(scene.size, None);
    let estimates: Vec<HomographyEstimate> =
        scene.pairs().iter().map(|p| gold_standard_homography(&p.matches, &frame).expect("a homography")).collect();
    // `auto` is for the whole way.
    for constraint in Constraint::ALL.into_iter().filter(|c| *c != Constraint::Auto) {
        let to_camera = || closed_form(Method::Linear, &estimates, constraint, 1.0);
        time(&format!("six homographies to K, {constraint}"), 501, to_camera);
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
        let pairs: Vec<ImagePair> = scene.pairs();
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
