//! A camera's view of a point: the residual's model and its derivatives by each block.
//!
//! ```text
//! y = R (A D(δ) Rz(-ψ - v w) B q) + W t,     pixel = e^φ (K lens(y) - p) + p + s
//!
//! floor:       q = (X, Y, W) homogeneous point of the plane,  B q = (X - W x, Y - W y, -W h)
//! directions:  q = direction of a point far away,             B q = q,  W = 0
//! D(δ) = Rx(δ1) Ry(δ2)
//! ```
//!
//! The camera: K its matrix, p = (cx, cy) the principal point, (R, t) its pose in the rig. The frame: ψ its yaw, (x, y, h) its optical centre,
//! A the attitude of its group, D its own error of that about two axes across the plane's normal. The departures of its picture: φ of ln f, w a
//! turn while it is read out (v: row from the middle, -1 to 1), s a shift. y is the point in camera coordinates, of any length.
//!
//! Homogeneous points pass the horizon without a jump, and a motion without translation is the same in both models. A moves as
//! A Rx(a1) Ry(a2), R as exp(r) R, so that no attitude is singular.

use std::borrow::Cow;

use nalgebra::{Matrix2, Matrix2x3, Matrix3, SMatrix, Vector2, Vector3};

use crate::geometry::{
    attitude::yaw_rotation,
    lens::{Lens, LensProjection, MAX_LENS_PARAMETERS},
};
use crate::refine::blocks::{
    CameraState, DEPARTURES, Departure, FRAME_POSE, FRAME_YAW, FrameState, GROUP, GroupState, MATRIX,
    MAX_CAMERA_NUMBERS, RIG_POSE, RigPose, rotation_x, rotation_y,
};

/// What the points are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum SceneModel {
    /// Points of one plane, the floor.
    Floor,
    /// Points too far away to show any translation.
    Directions,
}

/// The matrices of a camera at a frame, made once for all points.
#[derive(Debug, Clone)]
pub(crate) struct Pose {
    scene: SceneModel,
    /// R A.
    attitude: Matrix3<f64>,
    /// R A Rx(δ1).
    half_tilted: Matrix3<f64>,
    /// Ry(δ2).
    second_tilt: Matrix3<f64>,
    /// R A D.
    tilted: Matrix3<f64>,
    /// R A D Rz(-yaw): camera from world coordinates.
    pub rotation: Matrix3<f64>,
    /// Camera coordinates of q.
    matrix: Matrix3<f64>,
    /// Optical centre of the rig's first camera.
    centre: Vector3<f64>,
    /// Departures of the frame's picture.
    departure: Departure,
    /// t; `None` for the first camera, whose pose in the rig has no derivatives.
    translation: Option<Vector3<f64>>,
}

impl Pose {
    /// Of the rig's first camera at a frame of a group.
    pub(crate) fn new(scene: SceneModel, group: &GroupState, frame: &FrameState) -> Self {
        Self::of(scene, group, frame, None)
    }

    /// Of a camera of the rig; `None`: the first.
    pub(crate) fn of(scene: SceneModel, group: &GroupState, frame: &FrameState, rig: Option<&RigPose>) -> Self {
        let attitude = rig.map_or(group.attitude, |r| r.rotation * group.attitude);
        let (first, second_tilt) = (rotation_x(frame.delta_rad[0]), rotation_y(frame.delta_rad[1]));
        let half_tilted = attitude * first;
        let tilted = half_tilted * second_tilt;
        let rotation = tilted * yaw_rotation(frame.yaw_rad);
        let centre = Vector3::new(frame.position.x, frame.position.y, (group.ln_height + frame.ln_height_ratio).exp());
        let translation = rig.map(|r| r.translation);
        let matrix = camera_from_scene(scene, &rotation, &centre, translation);
        let departure = frame.departure;
        Self { scene, attitude, half_tilted, second_tilt, tilted, rotation, matrix, centre, departure, translation }
    }

    /// The pose when a row was read out, from -1 (first) to 1 (last).
    pub(crate) fn at_row(&self, row: f64) -> Cow<'_, Self> {
        let turn_rad = self.departure.row_turn_rad * row;
        if turn_rad == 0.0 {
            return Cow::Borrowed(self);
        }
        let rotation = self.rotation * yaw_rotation(turn_rad);
        let matrix = camera_from_scene(self.scene, &rotation, &self.centre, self.translation);
        Cow::Owned(Self { rotation, matrix, ..self.clone() })
    }

    /// Camera coordinates of a point, up to a positive factor in front.
    pub(crate) fn camera_point(&self, q: &Vector3<f64>) -> Vector3<f64> {
        self.matrix * q
    }

    /// The point (unit length) seen along a ray given in camera coordinates.
    pub(crate) fn back_project(&self, ray: &Vector3<f64>) -> Vector3<f64> {
        let w = self.rotation.transpose() * ray;
        let q = match self.scene {
            SceneModel::Directions => w,
            SceneModel::Floor => {
                let centre = self.centre();
                let scale = -w.z / centre.z;
                Vector3::new(w.x + scale * centre.x, w.y + scale * centre.y, scale)
            }
        };
        q.normalize()
    }

    /// Optical centre: x, y, height.
    pub(crate) fn centre(&self) -> Vector3<f64> {
        match (self.translation, self.scene) {
            (Some(t), SceneModel::Floor) => self.centre - self.rotation.tr_mul(&t),
            _ => self.centre,
        }
    }
}

/// Camera coordinates of q.
fn camera_from_scene(
    scene: SceneModel,
    rotation: &Matrix3<f64>,
    centre: &Vector3<f64>,
    translation: Option<Vector3<f64>>,
) -> Matrix3<f64> {
    match scene {
        SceneModel::Floor => {
            let [x, y] = [0, 1].map(|i| rotation.column(i).into_owned());
            let origin = -(rotation * centre);
            Matrix3::from_columns(&[x, y, translation.map_or(origin, |t| origin + t)])
        }
        SceneModel::Directions => *rotation,
    }
}

/// The lens and the camera matrix of a camera, ready for projecting.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Projector {
    linear: Matrix2<f64>,
    centre: Vector2<f64>,
    lens: Lens,
}

impl Projector {
    /// Of a camera.
    pub(crate) fn new(camera: &CameraState) -> Self {
        let k = camera.intrinsics_in_frame();
        Self { linear: Matrix2::new(k.fx, k.skew, 0.0, k.fy), centre: Vector2::new(k.cx, k.cy), lens: camera.lens }
    }

    fn pixel(&self, d: &Vector2<f64>) -> Vector2<f64> {
        let m = &self.linear;
        Vector2::new(m[(0, 0)] * d.x + m[(0, 1)] * d.y, m[(1, 1)] * d.y) + self.centre
    }

    /// For the picture of a frame.
    fn departing(&self, departure: &Departure) -> Self {
        if *departure == Departure::default() {
            return *self;
        }
        Self { linear: self.linear * departure.ln_focal.exp(), centre: self.centre + departure.shift, lens: self.lens }
    }

    /// The pixel of a point, seen in this row (see [`Pose::at_row`]) of the picture of a frame; `None` where the lens shows none.
    pub(crate) fn project_from(&self, pose: &Pose, q: &Vector3<f64>, row: f64) -> Option<Vector2<f64>> {
        self.departing(&pose.departure).project(&pose.at_row(row).camera_point(q))
    }

    /// The point (unit length) that a pixel of a frame's picture shows, in this row.
    pub(crate) fn point_of(&self, pose: &Pose, pixel: &Vector2<f64>, row: f64) -> Option<Vector3<f64>> {
        Some(pose.at_row(row).back_project(&self.departing(&pose.departure).ray(pixel)?))
    }

    /// The pixel of a point in camera coordinates; `None` where the lens shows none.
    pub(crate) fn project(&self, x: &Vector3<f64>) -> Option<Vector2<f64>> {
        self.lens.project(x).map(|d| self.pixel(&d))
    }

    /// The ray (unit length) of a pixel in camera coordinates.
    pub(crate) fn ray(&self, pixel: &Vector2<f64>) -> Option<Vector3<f64>> {
        let m = &self.linear;
        let y = (pixel.y - self.centre.y) / m[(1, 1)];
        self.lens.unproject(&Vector2::new((pixel.x - self.centre.x - m[(0, 1)] * y) / m[(0, 0)], y))
    }
}

/// A pixel (units of the camera's frame) with its derivatives by each block.
pub(crate) struct Projection {
    /// Where the point is seen.
    pub pixel: Vector2<f64>,
    /// By the camera; columns beyond its numbers are zero.
    pub by_camera: SMatrix<f64, 2, MAX_CAMERA_NUMBERS>,
    /// By the group.
    pub by_group: SMatrix<f64, 2, GROUP>,
    /// By the frame's pose.
    pub by_frame: SMatrix<f64, 2, FRAME_POSE>,
    /// By the point's homogeneous coordinates.
    pub by_point: Matrix2x3<f64>,
    /// The point.
    pub(crate) point: Vector3<f64>,
    /// By camera coordinates.
    pub(crate) by_camera_point: Matrix2x3<f64>,
    /// What the rotations turn: camera coordinates less the camera's translation in the rig.
    turned: Vector3<f64>,
    /// The point's weight of translations.
    weight: f64,
    /// The pixel from the principal point.
    from_centre: Vector2<f64>,
}

impl Projection {
    /// By the pose in the rig of a camera that is not the first.
    pub(crate) fn by_rig(&self) -> SMatrix<f64, 2, RIG_POSE> {
        let (g, turned) = (&self.by_camera_point, &self.turned);
        let mut j = SMatrix::<f64, 2, RIG_POSE>::zeros();
        j.set_column(0, &(g * Vector3::new(0.0, -turned.z, turned.y)));
        j.set_column(1, &(g * Vector3::new(turned.z, 0.0, -turned.x)));
        j.set_column(2, &(g * Vector3::new(-turned.y, turned.x, 0.0)));
        j.fixed_columns_mut::<3>(3).copy_from(&(g * self.weight));
        j
    }

    /// By the departures of the frame's picture, of a point seen in this row.
    pub(crate) fn by_departures(&self, row: f64) -> SMatrix<f64, 2, DEPARTURES> {
        let mut j = SMatrix::<f64, 2, DEPARTURES>::zeros();
        j.set_column(0, &self.from_centre);
        j.set_column(1, &(self.by_frame.column(FRAME_YAW) * row));
        j.fixed_columns_mut::<2>(2).fill_with_identity();
        j
    }
}

/// Projects a point, seen in a row (see [`Pose::at_row`]), with all derivatives; `None` where the lens shows none.
#[inline]
pub(crate) fn project_with_derivatives(
    projector: &Projector,
    pose: &Pose,
    q: &Vector3<f64>,
    row: f64,
) -> Option<Projection> {
    // Most pictures do not depart: what is looked at in every iteration is copied for those alone that do.
    if pose.departure == Departure::default() {
        return derivatives(projector, pose, q);
    }
    derivatives(&projector.departing(&pose.departure), &pose.at_row(row), q)
}

// Called for every observation of every iteration: what it returns is large, and is not copied where it is inlined.
#[inline(always)]
fn derivatives(projector: &Projector, pose: &Pose, q: &Vector3<f64>) -> Option<Projection> {
    let scale = if pose.departure.ln_focal == 0.0 { 1.0 } else { pose.departure.ln_focal.exp() };
    let x = pose.camera_point(q);
    let seen = projector.lens.project_with_jacobian(&x)?;
    let g = projector.linear * seen.by_ray;
    let weight = if pose.scene == SceneModel::Floor { q.z } else { 0.0 };
    let turned = pose.translation.map_or(x, |t| x - t * weight);
    let (by_group, by_frame) = by_poses(pose, &g, &turned, weight);
    Some(Projection {
        pixel: projector.pixel(&seen.point),
        by_camera: by_camera(&projector.linear, scale, &seen),
        by_group,
        by_frame,
        by_point: g * pose.matrix,
        point: *q,
        by_camera_point: g,
        turned,
        weight,
        from_centre: projector.linear * seen.point,
    })
}

#[inline(always)]
fn by_camera(linear: &Matrix2<f64>, scale: f64, seen: &LensProjection) -> SMatrix<f64, 2, MAX_CAMERA_NUMBERS> {
    let mut j = SMatrix::<f64, 2, MAX_CAMERA_NUMBERS>::zeros();
    let d = &seen.point;
    let fy_part = linear[(1, 1)] * d.y;
    // ln fx moves fy too; both move the pixel in proportion, the skew apart.
    (j[(0, 0)], j[(1, 0)]) = (linear[(0, 0)] * d.x, fy_part);
    j[(1, 1)] = fy_part;
    (j[(0, 2)], j[(1, 3)]) = (1.0, 1.0);
    j[(0, 4)] = scale * d.y;
    j.fixed_columns_mut::<MAX_LENS_PARAMETERS>(MATRIX).copy_from(&(linear * seen.by_parameters));
    j
}

/// By group and frame, given the derivative by camera coordinates, what the rotations turn and the weight of the translations.
#[inline(always)]
fn by_poses(
    pose: &Pose,
    g: &Matrix2x3<f64>,
    turned: &Vector3<f64>,
    weight: f64,
) -> (SMatrix<f64, 2, GROUP>, SMatrix<f64, 2, FRAME_POSE>) {
    let mut by_group = SMatrix::<f64, 2, GROUP>::zeros();
    let mut by_frame = SMatrix::<f64, 2, FRAME_POSE>::zeros();
    let t = pose.attitude.tr_mul(turned);
    let by_first = g * (pose.attitude * Vector3::new(0.0, -t.z, t.y));
    by_group.set_column(0, &by_first);
    by_group.set_column(1, &(g * (pose.attitude * Vector3::new(t.z, 0.0, -t.x))));
    let s = pose.half_tilted.tr_mul(turned);
    by_frame.set_column(0, &by_first);
    by_frame.set_column(1, &(g * (pose.half_tilted * Vector3::new(s.z, 0.0, -s.x))));
    let w = pose.second_tilt.tr_mul(&s);
    by_frame.set_column(2, &(g * (pose.tilted * Vector3::new(w.y, -w.x, 0.0))));
    if pose.scene == SceneModel::Floor {
        by_frame.set_column(3, &(g * pose.rotation.column(0) * -weight));
        by_frame.set_column(4, &(g * pose.rotation.column(1) * -weight));
        let by_height = g * pose.rotation.column(2) * (-weight * pose.centre.z);
        by_group.set_column(2, &by_height);
        by_frame.set_column(5, &by_height);
    }
    (by_group, by_frame)
}

/// Two orthonormal directions across a unit vector.
pub(crate) fn tangent_of(q: &Vector3<f64>) -> [Vector3<f64>; 2] {
    let sign = if q.z >= 0.0 { 1.0 } else { -1.0 };
    // Duff et al. 2017, "Building an orthonormal basis, revisited".
    let a = -1.0 / (sign + q.z);
    let b = q.x * q.y * a;
    [Vector3::new(1.0 + sign * q.x * q.x * a, sign * b, -sign * q.x), Vector3::new(b, sign + q.y * q.y * a, -q.y)]
}

#[cfg(test)]
mod tests {
    use nalgebra::SVector;

    use super::*;
    use crate::{
        geometry::{
            attitude::attitude_rotation,
            lens::{Fisheye, Radtan},
        },
        refine::blocks::State,
    };

    /// Camera, its place in the rig, group, frame and a point.
    type Example = (CameraState, RigPose, GroupState, FrameState, Vector3<f64>);

    fn example(scene: SceneModel, lens: Lens) -> Example {
        let camera = CameraState { matrix: [0.8, 0.01, 0.05, -0.03, 0.01].into(), lens };
        let rig = RigPose::identity().moved(&SVector::from([0.05, -0.1, 0.2, 0.3, -0.05, 0.02]));
        let group = GroupState { attitude: attitude_rotation(0.7, 0.3), ln_height: 0.1 };
        let frame = FrameState {
            group: 0,
            delta_rad: [0.03, -0.05],
            yaw_rad: 0.4,
            position: Vector2::new(0.3, -0.2),
            ln_height_ratio: -0.05,
            departure: Departure { ln_focal: 0.01, row_turn_rad: 0.02, shift: Vector2::new(0.003, -0.002) },
        };
        let q = Pose::new(scene, &group, &frame).back_project(&Vector3::new(0.21, -0.13, 1.0));
        (camera, rig, group, frame, q)
    }

    /// The numbers of all blocks, one after the other, and where each block begins.
    const BEGIN: [usize; 5] = [0, 10, 16, 19, 29];
    const ALL: usize = 32;
    const ROW: f64 = -0.4;

    /// Lenses of three, five and no numbers.
    fn lenses() -> [Lens; 3] {
        let radtan = Radtan::new([-0.15, 0.03, 1e-3, -2e-3, 0.004]);
        [Lens::Radtan(radtan), Lens::Fisheye(Fisheye::new([0.02, -0.01, 0.003, -0.0005])), Lens::None]
    }

    fn moved(e: &Example, i: usize, by: f64) -> Example {
        let (mut camera, mut rig, mut group, mut frame, mut q) = *e;
        let block = (0..5).rfind(|&b| BEGIN[b] <= i).expect("one of them");
        let number = i - BEGIN[block];
        match block {
            0 if number < camera.count() => camera = camera.moved(std::iter::once((number, by))),
            0 => {}
            1 => rig = rig.moved(&SVector::from_fn(|r, _| if r == number { by } else { 0.0 })),
            2 => match number {
                0 => group.attitude = group.turned([by, 0.0]),
                1 => group.attitude = group.turned([0.0, by]),
                _ => group.ln_height += by,
            },
            3 => match number {
                0 | 1 => frame.delta_rad[number] += by,
                2 => frame.yaw_rad += by,
                3 | 4 => frame.position[number - 3] += by,
                5 => frame.ln_height_ratio += by,
                _ => {
                    let mut numbers = frame.departure.numbers();
                    numbers[number - FRAME_POSE] += by;
                    frame.departure = Departure::from_numbers(numbers);
                }
            },
            _ => q[number] += by,
        }
        (camera, rig, group, frame, q)
    }

    fn agrees_with_differences(scene: SceneModel, in_rig: bool, lens: Lens) {
        let pose = |e: &Example| Pose::of(scene, &e.2, &e.3, in_rig.then_some(&e.1));
        let value =
            |e: &Example| Projector::new(&e.0).project_from(&pose(e), &e.4, ROW).expect("in front of the camera");
        let e = example(scene, lens);
        let p = project_with_derivatives(&Projector::new(&e.0), &pose(&e), &e.4, ROW).expect("in front");
        assert!((p.pixel - value(&e)).norm() < 1e-14);
        for i in 0..ALL {
            const H: f64 = 1e-6;
            let difference = (value(&moved(&e, i, H)) - value(&moved(&e, i, -H))) / (2.0 * H);
            let block = (0..5).rfind(|&b| BEGIN[b] <= i).expect("one of them");
            let n = i - BEGIN[block];
            let analytic = match block {
                0 => p.by_camera.column(n).into_owned(),
                1 if in_rig => p.by_rig().column(n).into_owned(),
                1 => Vector2::zeros(),
                2 => p.by_group.column(n).into_owned(),
                3 if n < FRAME_POSE => p.by_frame.column(n).into_owned(),
                3 => p.by_departures(ROW).column(n - FRAME_POSE).into_owned(),
                _ => p.by_point.column(n).into_owned(),
            };
            let error = (difference - analytic).norm();
            assert!(error < 1e-8, "{scene:?} {in_rig} {lens:?} block {block} number {n}: {difference} {analytic}");
        }
    }

    #[test]
    fn derivatives_by_every_block_agree_with_differences() {
        for scene in [SceneModel::Floor, SceneModel::Directions] {
            for in_rig in [false, true] {
                lenses().into_iter().for_each(|lens| agrees_with_differences(scene, in_rig, lens));
            }
        }
    }

    #[test]
    fn a_group_of_its_own_changes_no_pose() {
        let (camera, rig, group, frame, _) = example(SceneModel::Floor, Lens::None);
        let other = FrameState { delta_rad: [0.6, -0.4], ..frame };
        let state = State {
            cameras: vec![camera],
            rig: vec![rig],
            groups: vec![group],
            frames: vec![frame, other],
            points: Vec::new(),
        };
        let own = state.clone().with_own_attitudes();
        assert_eq!(own.groups.len(), 2);
        for (before, after) in state.frames.iter().zip(&own.frames) {
            let [a, b] =
                [(&state, before), (&own, after)].map(|(s, f)| Pose::new(SceneModel::Floor, &s.groups[f.group], f));
            assert!((a.matrix - b.matrix).norm() < 1e-14 && after.delta_rad == [0.0; 2]);
        }
    }

    #[test]
    fn what_is_seen_along_a_ray_is_seen_there() {
        for scene in [SceneModel::Floor, SceneModel::Directions] {
            for (in_rig, lens) in [false, true].into_iter().flat_map(|in_rig| lenses().map(|lens| (in_rig, lens))) {
                let (camera, rig, group, frame, _) = example(scene, lens);
                let projector = Projector::new(&camera);
                let pose = Pose::of(scene, &group, &frame, in_rig.then_some(&rig));
                // Below and above the horizon.
                for pixel in [Vector2::new(0.3, 0.4), Vector2::new(-0.2, -1.1)] {
                    let q = projector.point_of(&pose, &pixel, ROW).expect("inside the fold");
                    let again = projector.project_from(&pose, &q, ROW).expect("in front");
                    assert!((again - pixel).norm() < 1e-12);
                    let [u, v] = tangent_of(&q);
                    let orthonormal = [u.dot(&q), v.dot(&q), u.dot(&v), u.norm() - 1.0, v.norm() - 1.0];
                    assert!(orthonormal.iter().all(|e| e.abs() < 1e-14));
                }
            }
        }
    }
}
