//! What is reported of groups and views, and its covariance: the numbers of the solution turned into angles and positions in a
//! world that begins at the first view of a connected set.
//!
//! The world's +X is that view's heading, which an error of its attitude turns (by tan(pitch) times the error about the heading):
//! the covariance of every other view's yaw and position has it. Derivatives are central differences, of closed forms.

use nalgebra::{DMatrix, Matrix2, SMatrix, SVector, Vector2, Vector3};

use crate::geometry::attitude::{angles_from_rotation, attitude_from_up};
use crate::refine::{
    CAMERA, GroupState, SceneModel, State, ViewState,
    layout::{HELD, Layout},
    model::{GROUP, Pose, VIEW},
};

/// Numbers of a view's covariance: the camera's, then pitch (down), roll, yaw, x, y, height.
pub const VIEW_NUMBERS: usize = CAMERA + 6;
/// Numbers of a group's covariance: the camera's, then pitch (down), roll, height.
pub const GROUP_NUMBERS: usize = CAMERA + 3;

/// Step of the differences; all numbers are of order one.
const STEP: f64 = 1e-6;

/// Pitch (down), roll, yaw, x, y, height.
pub(super) type PoseNumbers = SVector<f64, 6>;

/// Pitch and roll (radians) and height of a group.
pub(super) fn group_numbers(group: &GroupState) -> Vector3<f64> {
    let (pitch, roll) = attitude_from_up(&group.attitude.column(2).into_owned());
    Vector3::new(pitch, roll, group.ln_height.exp())
}

/// A group's columns and the derivative of the camera's numbers and [`group_numbers`] by them.
pub(super) fn group_jacobian(layout: &Layout, state: &State, group: usize) -> (Vec<usize>, DMatrix<f64>) {
    let at = |slot: usize, step: f64| group_numbers(&stepped_group(&state.groups[group], slot, step));
    let columns: Vec<usize> = layout.camera.iter().chain(&layout.groups[group]).copied().collect();
    let derivative = |slot: usize| {
        let mut d = (at(slot, STEP) - at(slot, -STEP)) / (2.0 * STEP);
        d[1] = wrapped(d[1] * 2.0 * STEP) / (2.0 * STEP);
        d
    };
    let jacobian = DMatrix::from_fn(GROUP_NUMBERS, columns.len(), |r, c| match (r < CAMERA, c < CAMERA) {
        (true, _) => f64::from(u8::from(r == c)),
        (false, true) => 0.0,
        (false, false) => derivative(c - CAMERA)[r - CAMERA],
    });
    free_of(columns, jacobian)
}

/// The pose of a view in the world of another, its origin (which may be itself).
pub(super) fn pose_numbers(state: &State, view: usize, origin: usize) -> PoseNumbers {
    let group = |v: usize| state.groups[state.views[v].group];
    numbers_of(view == origin, [group(view), group(origin)], [state.views[view], state.views[origin]])
}

/// The columns on which a view's pose depends and the derivative of the camera's numbers and [`pose_numbers`] by them.
pub(super) fn view_jacobian(layout: &Layout, state: &State, view: usize, origin: usize) -> (Vec<usize>, DMatrix<f64>) {
    let (own, first) = (state.views[view].group, state.views[origin].group);
    let mut columns: Vec<usize> = layout.camera.to_vec();
    columns.extend(layout.groups[own].iter().chain(&layout.views[view]));
    // What the two have in common stands once.
    let mut of_origin = [HELD; GROUP + VIEW];
    if first != own {
        of_origin[..GROUP].copy_from_slice(&layout.groups[first]);
    }
    if origin != view {
        of_origin[GROUP..].copy_from_slice(&layout.views[origin]);
    }
    columns.extend(of_origin);
    let at = |slot: usize, step: f64| {
        let mut groups = [state.groups[own], state.groups[first]];
        let mut views = [state.views[view], state.views[origin]];
        let (which, slot) = (slot / (GROUP + VIEW), slot % (GROUP + VIEW));
        if slot < GROUP {
            groups[which] = stepped_group(&groups[which], slot, step);
        } else {
            views[which] = stepped_view(&views[which], slot - GROUP, step);
        }
        if which == 0 && first == own {
            groups[1] = groups[0];
        }
        if which == 0 && origin == view {
            views[1] = views[0];
        }
        numbers_of(view == origin, groups, views)
    };
    let mut jacobian = DMatrix::zeros(VIEW_NUMBERS, columns.len());
    for (c, column) in columns.iter().enumerate() {
        if c < CAMERA {
            jacobian[(c, c)] = 1.0;
        } else if Layout::is_free(*column) {
            let mut difference = at(c - CAMERA, STEP) - at(c - CAMERA, -STEP);
            for angle in 0..3 {
                difference[angle] = wrapped(difference[angle]);
            }
            for r in 0..6 {
                jacobian[(CAMERA + r, c)] = difference[r] / (2.0 * STEP);
            }
        }
    }
    free_of(columns, jacobian)
}

/// Covariance of linear functions of the numbers in `columns`, of whose covariance `block` gives a part.
pub(super) fn propagated<const N: usize>(
    (columns, jacobian): &(Vec<usize>, DMatrix<f64>),
    block: impl Fn(&[usize]) -> DMatrix<f64>,
) -> SMatrix<f64, N, N> {
    let all = jacobian * block(columns) * jacobian.transpose();
    SMatrix::from_fn(|r, c| 0.5 * (all[(r, c)] + all[(c, r)]))
}

/// An angle in (-π, π].
pub(super) fn wrapped(angle: f64) -> f64 {
    use std::f64::consts::{PI, TAU};
    PI - (PI - angle).rem_euclid(TAU)
}

fn numbers_of(is_origin: bool, groups: [GroupState; 2], views: [ViewState; 2]) -> PoseNumbers {
    let [own, origin] = [0, 1].map(|i| Pose::new(SceneModel::Floor, &groups[i], &views[i]));
    let (pitch, roll, yaw) = angles_from_rotation(&own.rotation);
    let (_, _, heading) = angles_from_rotation(&origin.rotation);
    let (sin, cos) = heading.sin_cos();
    let position = Matrix2::new(cos, sin, -sin, cos) * (views[0].position - views[1].position);
    // The origin's height is the unit whatever that of its group.
    let height = if is_origin { 1.0 } else { own.centre().z };
    PoseNumbers::from([pitch, roll, wrapped(yaw - heading), position.x, position.y, height])
}

fn stepped_group(group: &GroupState, slot: usize, step: f64) -> GroupState {
    let turn = |a: f64, b: f64| GroupState { attitude: group.turned([a, b]), ..*group };
    match slot {
        0 => turn(step, 0.0),
        1 => turn(0.0, step),
        _ => GroupState { ln_height: group.ln_height + step, ..*group },
    }
}

fn stepped_view(view: &ViewState, slot: usize, step: f64) -> ViewState {
    let mut v = *view;
    match slot {
        0 | 1 => v.delta_rad[slot] += step,
        2 => v.yaw_rad += step,
        3 => v.position += Vector2::new(step, 0.0),
        4 => v.position += Vector2::new(0.0, step),
        _ => v.ln_height_ratio += step,
    }
    v
}

/// Without the columns of what was held.
fn free_of(columns: Vec<usize>, jacobian: DMatrix<f64>) -> (Vec<usize>, DMatrix<f64>) {
    let free: Vec<usize> = (0..columns.len()).filter(|&c| Layout::is_free(columns[c])).collect();
    (free.iter().map(|&c| columns[c]).collect(), jacobian.select_columns(&free))
}
