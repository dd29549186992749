//! Covariances of a solution: cameras, rig poses, and what is reported of groups and frames, turned into angles and positions in a
//! world that begins at the first frame of a connected set.
//!
//! ```text
//! cov(f) = κ G N⁻¹ Gᵀ,        G = ∂f/∂columns
//! f of a view:  pitch, roll,  ψ - ψ₀,  Rz(-ψ₀) ((x, y) - (x₀, y₀)),  h            f of a group:  pitch, roll, h
//! ```
//!
//! N: the reduced information (`elimination`); κ: by how much more the variances are than its inverse says (`adjust`); ψ₀, (x₀, y₀): heading and place
//! of the frame where the world begins.
//!
//! The world's +X is that frame's heading, which an error of its attitude turns (by tan(pitch) times the error about the heading):
//! the covariance of every other frame's yaw and position has it. Derivatives are central differences, of closed forms.

use nalgebra::{DMatrix, Matrix2, SMatrix, SVector, Vector2, Vector3};
use rayon::prelude::*;

use crate::{
    geometry::attitude::{angles_from_rotation, attitude_from_up},
    numerics::skyline_cholesky::SkylineCholesky,
    refine::{
        blocks::{FRAME, FrameState, GROUP, GroupState, RIG_POSE, State},
        bundle::{CameraEstimate, FIRST_CAMERA, GroupEstimate, JointCovariance, RigEstimate, ViewEstimate},
        layout::Layout,
        residual::{Pose, SceneModel},
        tracks::Track,
    },
};

/// Step of the differences; all numbers are of order one.
const STEP: f64 = 1e-6;

/// Pitch (down), roll, yaw, x, y, height.
type PoseNumbers = SVector<f64, 6>;

/// A solution from which results are read.
pub(crate) struct Solution<'a> {
    pub(crate) layout: &'a Layout,
    pub(crate) state: &'a State,
    pub(crate) factor: &'a SkylineCholesky,
    /// By how much the variances are wider than the inverse information says.
    pub(crate) widened: f64,
}

/// Derivative of numbers by columns.
struct Derivative {
    columns: Vec<usize>,
    jacobian: DMatrix<f64>,
}

impl Derivative {
    /// Without the columns of what is held.
    fn new(columns: &[Option<usize>], jacobian: &DMatrix<f64>) -> Self {
        let free: Vec<usize> = (0..columns.len()).filter(|&c| columns[c].is_some()).collect();
        Self { columns: columns.iter().copied().flatten().collect(), jacobian: jacobian.select_columns(&free) }
    }
}

impl Solution<'_> {
    /// Columns of the inverse that the covariances of groups and frames with the camera need, each for itself.
    pub(crate) fn columns_of_poses(&self) -> usize {
        let camera = self.layout.cameras[FIRST_CAMERA].columns().len();
        let (groups, frames) = (self.state.groups.len(), self.state.frames.len());
        groups * (camera + GROUP) + frames * (camera + GROUP + FRAME)
    }

    /// Covariance of linear functions of the columns.
    fn propagated(&self, by: &Derivative) -> DMatrix<f64> {
        let all = &by.jacobian * self.factor.inverse_block(&by.columns) * by.jacobian.transpose();
        DMatrix::from_fn(all.nrows(), all.ncols(), |r, c| 0.5 * (all[(r, c)] + all[(c, r)]) * self.widened)
    }

    /// Covariance of the numbers in these columns; zero for those held.
    fn of_columns(&self, columns: &[Option<usize>]) -> DMatrix<f64> {
        let free: Vec<usize> = columns.iter().copied().flatten().collect();
        let block = self.factor.inverse_block(&free);
        let mut places = 0..free.len();
        let place: Vec<Option<usize>> = columns.iter().map(|c| c.and_then(|_| places.next())).collect();
        DMatrix::from_fn(columns.len(), columns.len(), |r, c| match (place[r], place[c]) {
            (Some(r), Some(c)) => block[(r, c)] * self.widened,
            _ => 0.0,
        })
    }

    /// Cameras of the rig.
    pub(crate) fn cameras(&self) -> Vec<CameraEstimate> {
        let of = |(camera, block): (&_, &crate::refine::layout::Block)| CameraEstimate {
            state: *camera,
            covariance: self.of_columns(block.columns()),
        };
        self.state.cameras.iter().zip(&self.layout.cameras).map(of).collect()
    }

    /// Their poses in it.
    pub(crate) fn rig(&self) -> Vec<RigEstimate> {
        let of = |(pose, block): (&_, &crate::refine::layout::Block)| {
            let all = self.of_columns(block.columns());
            RigEstimate { pose: *pose, covariance: SMatrix::<f64, RIG_POSE, RIG_POSE>::from_fn(|r, c| all[(r, c)]) }
        };
        self.state.rig.iter().zip(&self.layout.rig).map(of).collect()
    }

    /// Attitude groups.
    pub(crate) fn groups(&self) -> Vec<GroupEstimate> {
        (0..self.state.groups.len())
            .map(|g| {
                let group = &self.state.groups[g];
                let [pitch, roll, height] = group_numbers(group).into();
                let origin = |v: usize| self.layout.component_of_frame[v];
                GroupEstimate {
                    pitch_roll_rad: [pitch, roll],
                    height,
                    covariance: self.with_camera(&self.group_derivative(g)),
                    up: group.attitude.column(2).into_owned(),
                    origin: self.state.frames.iter().position(|v| v.group == g).map_or(0, origin),
                }
            })
            .collect()
    }

    /// Frames as the rig's first camera takes them; `None` for those without observations.
    pub(crate) fn views(&self, tracks: &[Track], squared_residuals: &[Vec<f64>]) -> Vec<Option<ViewEstimate>> {
        let count = self.state.frames.len();
        let (mut sums, mut counts) = (vec![0.0; count], vec![0usize; count]);
        for (t, residuals) in tracks.iter().zip(squared_residuals) {
            // The point takes a part of the residual with it.
            let share = t.observations.len() as f64 / (t.observations.len() as f64 - 1.0);
            for (o, r) in t.observations.iter().zip(residuals) {
                sums[o.frame] += 0.5 * r * share;
                counts[o.frame] += 1;
            }
        }
        (0..count)
            .into_par_iter()
            .map(|v| {
                if counts[v] == 0 {
                    return None;
                }
                let origin = self.layout.component_of_frame[v];
                let [pitch, roll, yaw, x, y, height] = self.pose_numbers(v, origin).into();
                let covariance = self.with_camera(&self.view_derivative(v, origin));
                let of_pose = covariance.without_camera();
                let sd = |i: usize| of_pose[(i, i)].max(0.0).sqrt();
                Some(ViewEstimate {
                    origin,
                    yaw_rad: yaw,
                    yaw_sigma_rad: sd(2),
                    pitch_roll_rad: [pitch, roll],
                    delta_rad: self.state.frames[v].delta_rad,
                    centre: Vector3::new(x, y, height),
                    centre_sigma: Vector3::new(sd(3), sd(4), sd(5)),
                    covariance,
                    weighted_rms: (sums[v] / counts[v] as f64).sqrt(),
                    observations: counts[v],
                })
            })
            .collect()
    }

    fn with_camera(&self, by: &Derivative) -> JointCovariance {
        JointCovariance::new(self.propagated(by), self.layout.cameras[FIRST_CAMERA].columns().len())
    }

    /// Derivative of the first camera's numbers and of others, given by differences for the columns after the camera's.
    fn derivative<const N: usize>(
        &self,
        others: &[Option<usize>],
        difference: impl Fn(usize) -> SVector<f64, N>,
    ) -> Derivative {
        let camera = self.layout.cameras[FIRST_CAMERA].columns();
        let columns: Vec<Option<usize>> = camera.iter().chain(others).copied().collect();
        let mut jacobian = DMatrix::zeros(camera.len() + N, columns.len());
        for c in 0..columns.len() {
            if c < camera.len() {
                jacobian[(c, c)] = 1.0;
            } else if columns[c].is_some() {
                jacobian.view_mut((camera.len(), c), (N, 1)).copy_from(&difference(c - camera.len()));
            }
        }
        Derivative::new(&columns, &jacobian)
    }

    /// Of the camera's numbers and [`group_numbers`].
    fn group_derivative(&self, group: usize) -> Derivative {
        let at = |number: usize, step: f64| group_numbers(&stepped_group(&self.state.groups[group], number, step));
        self.derivative(self.layout.groups[group].columns(), |number| {
            let mut d = at(number, STEP) - at(number, -STEP);
            d[1] = wrapped(d[1]);
            d / (2.0 * STEP)
        })
    }

    /// The pose of a frame in the world of another, its origin (which may be itself).
    fn pose_numbers(&self, view: usize, origin: usize) -> PoseNumbers {
        let frames = [view, origin].map(|v| self.state.frames[v]);
        numbers_of(self.layout.units.contains(&view), frames.map(|f| self.state.groups[f.group]), frames)
    }

    /// Of the camera's numbers and [`Self::pose_numbers`].
    fn view_derivative(&self, view: usize, origin: usize) -> Derivative {
        let (layout, state) = (self.layout, self.state);
        let (own, first) = (state.frames[view].group, state.frames[origin].group);
        let held = |block: &crate::refine::layout::Block| vec![None; block.columns().len()];
        let mut columns: Vec<Option<usize>> = layout.groups[own].columns().to_vec();
        columns.extend(layout.frames[view].columns());
        // What the two have in common stands once.
        let of_first = &layout.groups[first];
        columns.extend(if first == own { held(of_first) } else { of_first.columns().to_vec() });
        let of_origin = &layout.frames[origin];
        columns.extend(if origin == view { held(of_origin) } else { of_origin.columns().to_vec() });
        let at = |number: usize, step: f64| {
            let mut groups = [state.groups[own], state.groups[first]];
            let mut frames = [state.frames[view], state.frames[origin]];
            let (which, number) = (number / (GROUP + FRAME), number % (GROUP + FRAME));
            if number < GROUP {
                groups[which] = stepped_group(&groups[which], number, step);
            } else {
                frames[which] = stepped_frame(&frames[which], number - GROUP, step);
            }
            if which == 0 && first == own {
                groups[1] = groups[0];
            }
            if which == 0 && origin == view {
                frames[1] = frames[0];
            }
            numbers_of(layout.units.contains(&view), groups, frames)
        };
        self.derivative(&columns, |number| {
            let mut d = at(number, STEP) - at(number, -STEP);
            (0..3).for_each(|angle| d[angle] = wrapped(d[angle]));
            d / (2.0 * STEP)
        })
    }
}

/// Pitch and roll (radians) and height of a group.
fn group_numbers(group: &GroupState) -> Vector3<f64> {
    let (pitch, roll) = attitude_from_up(&group.attitude.column(2).into_owned());
    Vector3::new(pitch, roll, group.ln_height.exp())
}

/// An angle in (-π, π].
fn wrapped(angle: f64) -> f64 {
    use std::f64::consts::{PI, TAU};
    PI - (PI - angle).rem_euclid(TAU)
}

fn numbers_of(is_unit: bool, groups: [GroupState; 2], frames: [FrameState; 2]) -> PoseNumbers {
    let [own, origin] = [0, 1].map(|i| Pose::new(SceneModel::Floor, &groups[i], &frames[i]));
    let (pitch, roll, yaw) = angles_from_rotation(&own.rotation);
    let (_, _, heading) = angles_from_rotation(&origin.rotation);
    let (sin, cos) = heading.sin_cos();
    let position = Matrix2::new(cos, sin, -sin, cos) * (frames[0].position - frames[1].position);
    // The height that is the unit stays so, whatever that of its group.
    let height = if is_unit { 1.0 } else { own.centre().z };
    PoseNumbers::from([pitch, roll, wrapped(yaw - heading), position.x, position.y, height])
}

fn stepped_group(group: &GroupState, number: usize, step: f64) -> GroupState {
    let turn = |a: f64, b: f64| GroupState { attitude: group.turned([a, b]), ..*group };
    match number {
        0 => turn(step, 0.0),
        1 => turn(0.0, step),
        _ => GroupState { ln_height: group.ln_height + step, ..*group },
    }
}

fn stepped_frame(frame: &FrameState, number: usize, step: f64) -> FrameState {
    let mut f = *frame;
    match number {
        0 | 1 => f.delta_rad[number] += step,
        2 => f.yaw_rad += step,
        3 => f.position += Vector2::new(step, 0.0),
        4 => f.position += Vector2::new(0.0, step),
        5 => f.ln_height_ratio += step,
        // Departures of the picture are no part of the pose.
        _ => {}
    }
    f
}
