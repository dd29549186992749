//! The joint refinement of what is more than one camera on plane-normal motions, against the Cramér-Rao bound: two cameras on one
//! rig, and a camera whose every view has an attitude of its own. Both are data: other blocks, the same equations.
//!
//! The bound comes from a model of its own (Euclidean points, angles) by central differences, nothing eliminated.

use crate::geometry::attitude::rotation_cam_from_world;
use crate::geometry::frame::Frame;
use crate::geometry::intrinsics::Intrinsics;
use crate::geometry::lens::Lens;
use crate::geometry::size::ImageSize;
use crate::numerics::levenberg_marquardt::LmOptions;
use crate::refine::adjust::adjust;
use crate::refine::blocks::{BundleOptions, CameraState, CameraUnknowns, FrameState, GroupState, RigPose, State};
use crate::refine::bundle::Bundle;
use crate::refine::residual::SceneModel;
use crate::refine::tracks::{Kind, Observation, Track};
use nalgebra::{DMatrix, DVector, Matrix2, Matrix3, Rotation3, Vector2, Vector3};
use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Mcg;
use rayon::prelude::*;

const SIZE: ImageSize = ImageSize { width: 1280, height: 960 };
const NOISE_PX: f64 = 0.3;

/// A camera at a frame: camera coordinates of a point of the floor are R (p - c), its own numbers those of the rig.
#[derive(Clone)]
struct Camera {
    k: Intrinsics,
    k1: f64,
    /// From the first camera's coordinates: scaled axis and translation.
    turn: Vector3<f64>,
    shift: Vector3<f64>,
}

/// Pitch (down), roll, yaw, centre of the rig's first camera.
#[derive(Clone)]
struct Pose {
    pitch: f64,
    roll: f64,
    yaw: f64,
    centre: Vector3<f64>,
}

#[derive(Clone)]
struct Scene {
    cameras: Vec<Camera>,
    poses: Vec<Pose>,
    points: Vec<Vector2<f64>>,
    /// (point, frame, camera), in order.
    seen: Vec<(usize, usize, usize)>,
}

fn pixel(camera: &Camera, pose: &Pose, point: &Vector2<f64>) -> Option<Vector2<f64>> {
    let in_rig = rotation_cam_from_world(pose.pitch, pose.roll, pose.yaw) * (point.push(0.0) - pose.centre);
    let x = Rotation3::from_scaled_axis(camera.turn) * in_rig + camera.shift;
    let n = x.xy() / x.z;
    // Within the fold of the lens.
    (x.z > 0.05 && n.norm() < 1.5).then(|| camera.k.pixel_from_normalised(&(n * (1.0 + camera.k1 * n.norm_squared()))))
}

impl Scene {
    fn pixels(&self) -> DVector<f64> {
        let all = self.seen.iter().flat_map(|&(p, f, c)| {
            let at = pixel(&self.cameras[c], &self.poses[f], &self.points[p]).expect("in front");
            [at.x, at.y]
        });
        DVector::from_iterator(2 * self.seen.len(), all)
    }

    /// What cameras of `frames` see of a point, where it is seen twice or more.
    fn look(&mut self, frames: &[usize], point: Vector2<f64>) {
        let inside = |p: &Vector2<f64>| {
            (0.0..SIZE.width as f64 - 1.0).contains(&p.x) && (0.0..SIZE.height as f64 - 1.0).contains(&p.y)
        };
        let at = self.points.len();
        let mut seen = Vec::new();
        for &f in frames {
            for (c, camera) in self.cameras.iter().enumerate() {
                if pixel(camera, &self.poses[f], &point).is_some_and(|p| inside(&p)) {
                    seen.push((at, f, c));
                }
            }
        }
        if seen.len() > 1 {
            self.points.push(point);
            self.seen.append(&mut seen);
        }
    }

    fn tracks(&self, rng: &mut Pcg64Mcg) -> Vec<Track> {
        let mut noise = || -> f64 { StandardNormal.sample(rng) };
        self.seen
            .chunk_by(|a, b| a.0 == b.0)
            .map(|of_point| {
                let observation = |&(p, frame, camera): &(usize, usize, usize)| {
                    let at = pixel(&self.cameras[camera], &self.poses[frame], &self.points[p]).expect("in front");
                    Observation {
                        frame,
                        camera,
                        pixel: at + Vector2::new(noise(), noise()) * NOISE_PX,
                        information: Matrix2::from_diagonal_element(NOISE_PX.powi(-2)),
                    }
                };
                Track { kind: Kind::Point, observations: of_point.iter().map(observation).collect() }
            })
            .collect()
    }

    /// The true state, frames in groups.
    fn state(&self, group_of: impl Fn(usize) -> usize, frame: &Frame) -> State {
        let attitude = |p: &Pose| rotation_cam_from_world(p.pitch, p.roll, 0.0);
        let groups = (0..=group_of(self.poses.len() - 1)).map(|g| {
            let f = (0..self.poses.len()).find(|&f| group_of(f) == g).expect("a frame");
            GroupState { attitude: attitude(&self.poses[f]), ln_height: self.poses[f].centre.z.ln() }
        });
        let frames = self.poses.iter().enumerate().map(|(f, p)| FrameState {
            group: group_of(f),
            delta_rad: [0.0; 2],
            yaw_rad: p.yaw,
            position: p.centre.xy(),
            ln_height_ratio: 0.0,
            departure: crate::refine::blocks::Departure::default(),
        });
        State {
            cameras: self
                .cameras
                .iter()
                .map(|c| {
                    let lens = if c.k1 == 0.0 { Lens::None } else { Lens::radial(c.k1, 0.0) };
                    CameraState::new(&c.k, &lens, frame)
                })
                .collect(),
            rig: self
                .cameras
                .iter()
                .map(|c| RigPose { rotation: Rotation3::from_scaled_axis(c.turn).into_inner(), translation: c.shift })
                .collect(),
            groups: groups.collect(),
            frames: frames.collect(),
            points: Vec::new(),
        }
    }

    /// Covariance of the first `reported` of the numbers that `change` moves; the points are free too.
    fn bound(&self, numbers: usize, reported: usize, change: impl Fn(&mut Scene, usize, f64)) -> DMatrix<f64> {
        let all = numbers + 2 * self.points.len();
        let mut jacobian = DMatrix::zeros(2 * self.seen.len(), all);
        for i in 0..all {
            const STEP: f64 = 1e-6;
            let [up, down] = [STEP, -STEP].map(|step| {
                let mut moved = self.clone();
                match i.checked_sub(numbers) {
                    None => change(&mut moved, i, step),
                    Some(at) => moved.points[at / 2][at % 2] += step,
                }
                moved.pixels()
            });
            jacobian.set_column(i, &((up - down) / (2.0 * STEP)));
        }
        let scale = DVector::from_iterator(all, jacobian.column_iter().map(|c| 1.0 / c.norm()));
        let scaled = &jacobian * DMatrix::from_diagonal(&scale);
        let inverse = scaled.tr_mul(&scaled).cholesky().expect("determined").inverse() * NOISE_PX.powi(2);
        DMatrix::from_fn(reported, reported, |r, c| inverse[(r, c)] * scale[r] * scale[c])
    }
}

fn options(unknowns: Vec<CameraUnknowns>, attitude_sigma_rad: f64) -> BundleOptions {
    BundleOptions {
        attitude_sigma_rad: Some(attitude_sigma_rad),
        height_sigma: Some(0.0),
        huber: 1e6,
        lm: LmOptions { max_iterations: 60, ..LmOptions::default() },
        ..BundleOptions::new(unknowns)
    }
}

/// Estimates of many trials against the bound: each number's RMSE over it, and all of them whitened.
fn compare(names: &[&str], bound: &DMatrix<f64>, errors: &[DVector<f64>], limit: f64) {
    let n = errors.len() as f64;
    for (i, name) in names.iter().enumerate() {
        let rmse = (errors.iter().map(|e| e[i] * e[i]).sum::<f64>() / n).sqrt();
        let ratio = rmse / bound[(i, i)].sqrt();
        println!("{name}: rmse {rmse:.3e}, over the bound {ratio:.3}");
        // Three deviations of the ratio's sampling error.
        assert!((ratio - 1.0).abs() < 3.0 / (2.0 * n).sqrt(), "{name}: {ratio}");
    }
    let whiten = bound.clone().cholesky().expect("positive definite");
    let squared: f64 = errors.iter().map(|e| e.dot(&whiten.solve(e))).sum();
    let ratio = (squared / (n * bound.nrows() as f64)).sqrt();
    println!("all: over the bound {ratio:.3}");
    assert!(ratio < limit, "{ratio}");
}

fn trials(scene: &Scene, start: &State, options: &BundleOptions, count: u64) -> Vec<Bundle> {
    (0..count)
        .into_par_iter()
        .map(|seed| {
            let mut rng = Pcg64Mcg::seed_from_u64(seed);
            let tracks = scene.tracks(&mut rng);
            let mut start = start.clone();
            for c in &mut start.cameras {
                c.matrix[0] += 0.02;
            }
            adjust(SceneModel::Floor, &tracks, vec![start], options).expect("refined")
        })
        .collect()
}

/// Plane-normal motions of a rig of two cameras at several elevations; some of the floor is seen by both cameras.
fn rig_scene() -> Scene {
    let left = Camera {
        k: Intrinsics::square(1000.0, 650.0, 470.0),
        k1: -0.08,
        turn: Vector3::zeros(),
        shift: Vector3::zeros(),
    };
    let right = Camera {
        k: Intrinsics::square(900.0, 630.0, 490.0),
        k1: 0.0,
        turn: Vector3::new(0.03, -0.25, 0.02),
        shift: Vector3::new(-0.2, 0.01, 0.03),
    };
    let mut scene = Scene { cameras: vec![left, right], poses: Vec::new(), points: Vec::new(), seen: Vec::new() };
    let mut rng = Pcg64Mcg::seed_from_u64(7);
    for (g, (pitch, roll, height)) in [(0.6, 0.0, 1.0), (0.9, 0.3, 1.1), (0.75, -0.35, 0.95)].into_iter().enumerate() {
        let pose = |yaw: f64, x: f64, y: f64| Pose { pitch, roll, yaw, centre: Vector3::new(x, y, height) };
        scene.poses.extend([pose(0.0, 0.0, 0.0), pose(0.35, 0.15, -0.1)]);
        for _ in 0..150 {
            let at = Vector2::new(rng.random_range(0.3..2.5), rng.random_range(-1.5..1.5));
            scene.look(&[2 * g, 2 * g + 1], at);
        }
    }
    scene
}

#[test]
fn two_cameras_on_one_rig_are_refined_to_the_bound() {
    let scene = rig_scene();
    let of_cameras = |k: usize| scene.seen.iter().filter(|s| s.2 == k).count();
    println!("{} points, observations {} and {}", scene.points.len(), of_cameras(0), of_cameras(1));
    // Reported: f, cx, cy, k1 of the left, f, cx, cy of the right, turn and shift.
    let names = [
        "left f", "left cx", "left cy", "left k1", "right f", "right cx", "right cy", "turn x", "turn y", "turn z",
        "shift x", "shift y", "shift z",
    ];
    let change = |s: &mut Scene, i: usize, by: f64| match i {
        0..=2 | 4..=6 => {
            let k = &mut s.cameras[i / 4].k;
            match i % 4 {
                0 => (k.fx, k.fy) = (k.fx + by, k.fy + by),
                1 => k.cx += by,
                _ => k.cy += by,
            }
        }
        3 => s.cameras[0].k1 += by,
        7..=9 => {
            // A small turn about the camera's axes, after its own.
            let mut step = Vector3::zeros();
            step[i - 7] = by;
            let turned = Rotation3::from_scaled_axis(step) * Rotation3::from_scaled_axis(s.cameras[1].turn);
            s.cameras[1].turn = turned.scaled_axis();
        }
        10..=12 => s.cameras[1].shift[i - 10] += by,
        _ => {
            let (motion, number) = ((i - 13) / 6, (i - 13) % 6);
            let (first, second) = (2 * motion, 2 * motion + 1);
            match number {
                0 => [first, second].iter().for_each(|&f| s.poses[f].pitch += by),
                1 => [first, second].iter().for_each(|&f| s.poses[f].roll += by),
                2 => s.poses[second].yaw += by,
                3 | 4 => s.poses[second].centre[number - 3] += by,
                _ => [first, second].iter().for_each(|&f| s.poses[f].centre.z += by),
            }
        }
    };
    // The height of the last motion listed here first is the unit: motion 0 has no height of its own.
    let free: Vec<usize> = (0..13 + 18).filter(|&i| i != 13 + 5).collect();
    let bound = scene.bound(free.len(), names.len(), |s, i, by| change(s, free[i], by));

    let frame = Frame::new(SIZE, None);
    let unknowns = |lens: usize| CameraUnknowns {
        matrix_free: [true, false, true, true, false],
        lens_free: vec![true; lens],
        ..CameraUnknowns::new(frame, [1.15, 0.86])
    };
    let options = options(vec![unknowns(1), unknowns(0)], 0.0);
    let truth = scene.state(|f| f / 2, &frame);
    let found = trials(&scene, &truth, &options, 400);
    let error = |b: &Bundle| {
        let k = [0, 1].map(|c| frame.intrinsics_to_pixel(&b.state.cameras[c].intrinsics_in_frame()));
        let [l, r] = [0, 1].map(|c| &scene.cameras[c].k);
        let turn: Matrix3<f64> = b.rig[1].pose.rotation * truth.rig[1].rotation.transpose();
        let turn = Rotation3::from_matrix_unchecked(turn).scaled_axis();
        let shift = b.rig[1].pose.translation - truth.rig[1].translation;
        let k1 = b.state.cameras[0].numbers()[5] - scene.cameras[0].k1;
        let numbers =
            [k[0].fx - l.fx, k[0].cx - l.cx, k[0].cy - l.cy, k1, k[1].fx - r.fx, k[1].cx - r.cx, k[1].cy - r.cy];
        DVector::from_iterator(
            names.len(),
            numbers.into_iter().chain(turn.iter().copied()).chain(shift.iter().copied()),
        )
    };
    let errors: Vec<DVector<f64>> = found.iter().map(error).collect();
    compare(&names, &bound, &errors, 1.05);
    // What is stated of each trial is the bound, the noise and the point of linearisation being its own.
    let n = found.len() as f64;
    let stated_f = (found.iter().map(|b| b.cameras[0].covariance[(0, 0)]).sum::<f64>() / n).sqrt() * 1000.0;
    let stated_turn = (found.iter().map(|b| b.rig[1].covariance[(1, 1)]).sum::<f64>() / n).sqrt();
    for (stated, i) in [(stated_f, 0), (stated_turn, 8)] {
        let ratio = stated / bound[(i, i)].sqrt();
        assert!((ratio - 1.0).abs() < 0.03, "{}: stated {ratio} of the bound", names[i]);
    }
}

#[test]
fn views_with_attitudes_of_their_own_are_refined_to_the_bound() {
    let camera = Camera {
        k: Intrinsics { fx: 1000.0, fy: 1005.0, cx: 650.0, cy: 470.0, skew: 0.0 },
        k1: 0.0,
        turn: Vector3::zeros(),
        shift: Vector3::zeros(),
    };
    let mut scene = Scene { cameras: vec![camera], poses: Vec::new(), points: Vec::new(), seen: Vec::new() };
    // A hand-held camera round a piece of floor, at distances and tilts of all kinds.
    for i in 0..8 {
        let (around, pitch) = (0.8 * f64::from(i), 0.75 + 0.09 * f64::from(i));
        let height = if i == 0 { 1.0 } else { 0.9 + 0.03 * f64::from(i * i % 7) };
        let distance = height / pitch.tan();
        let centre = Vector3::new(-around.cos() * distance, -around.sin() * distance, height);
        let roll = 0.2 * (1.7 * f64::from(i)).sin();
        scene.poses.push(Pose { pitch, roll, yaw: around, centre });
    }
    let mut rng = Pcg64Mcg::seed_from_u64(3);
    let all: Vec<usize> = (0..8).collect();
    for _ in 0..80 {
        scene.look(&all, Vector2::new(rng.random_range(-0.5..0.5), rng.random_range(-0.5..0.5)));
    }
    // The world begins below the first view, along its heading.
    let (first, heading) = (scene.poses[0].centre.xy(), scene.poses[0].yaw);
    assert!(heading == 0.0);
    scene.poses.iter_mut().for_each(|p| p.centre -= first.push(0.0));
    scene.points.iter_mut().for_each(|p| *p -= first);
    let names = ["fx", "fy", "cx", "cy"];
    let change = |s: &mut Scene, i: usize, by: f64| {
        let k = &mut s.cameras[0].k;
        match i {
            0 => k.fx += by,
            1 => k.fy += by,
            2 => k.cx += by,
            3 => k.cy += by,
            4 => s.poses[0].pitch += by,
            5 => s.poses[0].roll += by,
            _ => {
                let pose = &mut s.poses[1 + (i - 6) / 6];
                match (i - 6) % 6 {
                    0 => pose.pitch += by,
                    1 => pose.roll += by,
                    2 => pose.yaw += by,
                    axis => pose.centre[axis - 3] += by,
                }
            }
        }
    };
    let bound = scene.bound(6 + 7 * 6, names.len(), change);
    println!(
        "{} points, {} observations; sd of fx {:.2} px",
        scene.points.len(),
        scene.seen.len(),
        bound[(0, 0)].sqrt()
    );
    let frame = Frame::new(SIZE, None);
    let unknowns = CameraUnknowns { lens_free: Vec::new(), ..CameraUnknowns::new(frame, [1.15, 0.86]) };
    let options = options(vec![unknowns], f64::INFINITY);
    // Every view in a group of its own, and heights that differ.
    let found = trials(&scene, &scene.state(|f| f, &frame), &options, 400);
    assert!(found.iter().all(|b| b.groups.len() == 8 && b.agreement.1 == 0));
    let truth = &scene.cameras[0].k;
    let error = |b: &Bundle| {
        let k = frame.intrinsics_to_pixel(&b.state.cameras[0].intrinsics_in_frame());
        DVector::from_vec(vec![k.fx - truth.fx, k.fy - truth.fy, k.cx - truth.cx, k.cy - truth.cy])
    };
    let errors: Vec<DVector<f64>> = found.iter().map(error).collect();
    compare(&names, &bound, &errors, 1.05);
    let stated = found.iter().map(|b| b.cameras[0].covariance[(0, 0)]).sum::<f64>() / found.len() as f64;
    let ratio = stated.sqrt() * truth.fx / bound[(0, 0)].sqrt();
    assert!((ratio - 1.0).abs() < 0.03, "stated {ratio} of the bound");
}
