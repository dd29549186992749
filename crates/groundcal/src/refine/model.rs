//! The camera's view of a point: model and derivatives of the joint refinement.
//!
//! ```text
//! x = A D(δ) Rz(-yaw) B q,     pixel = K distort(x / z)
//!
//! floor:       q = (X, Y, W) homogeneous point of the plane,  B q = (X - W cx, Y - W cy, -W h)
//! directions:  q = direction of a point far away,             B q = q
//! D(δ) = Rx(δ1) Ry(δ2)
//! ```
//!
//! A is the attitude of the view's group, D the view's own error of it about two axes across the plane's normal, (cx, cy, h) its
//! optical centre. Homogeneous points pass the horizon without a jump, and a motion without translation is the same in both
//! models. A moves as A Rx(a1) Ry(a2), so that no attitude is singular.

use nalgebra::{Matrix2, Matrix2x3, Matrix3, SMatrix, SVector, Vector2, Vector3};

use crate::geometry::{attitude::yaw_rotation, distortion::Distortion, frame::Frame, intrinsics::Intrinsics};

/// What the points are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SceneModel {
    /// Points of one plane, the floor.
    Floor,
    /// Points too far away to show any translation.
    Directions,
}

/// Numbers of the camera: ln fx, ln fy/fx, cx, cy, skew (frame units), k1, k2.
pub const CAMERA: usize = 7;
/// Numbers of a group: attitude (2), ln of the height.
pub const GROUP: usize = 3;
/// Numbers of a view: δ (2), yaw, x, y, ln of the height over that of its group.
pub const VIEW: usize = 6;
/// All that one observation depends on, the point apart.
pub const SLOTS: usize = CAMERA + GROUP + VIEW;

/// The camera's numbers.
pub type CameraVector = SVector<f64, CAMERA>;

/// Derivatives of (fx, fy, cx, cy, skew, k1, k2) in pixels by the camera's numbers.
pub fn pixels_by_camera(k: &Intrinsics, frame: &Frame) -> SMatrix<f64, CAMERA, CAMERA> {
    let mut jacobian = SMatrix::<f64, CAMERA, CAMERA>::identity();
    jacobian[(0, 0)] = k.fx;
    (jacobian[(1, 0)], jacobian[(1, 1)]) = (k.fy, k.fy);
    for i in 2..5 {
        jacobian[(i, i)] = frame.scale_px;
    }
    jacobian
}

/// What a group of views shares.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GroupState {
    /// A: camera coordinates from level coordinates with the camera's heading.
    pub attitude: Matrix3<f64>,
    /// Logarithm of the height.
    pub ln_height: f64,
}

/// What a view has of its own.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ViewState {
    /// Its group.
    pub group: usize,
    /// Error of the attitude about level axes across and along the heading, radians.
    pub delta_rad: [f64; 2],
    /// Heading, radians.
    pub yaw_rad: f64,
    /// Optical centre over the floor.
    pub position: Vector2<f64>,
    /// Logarithm of its height over that of its group.
    pub ln_height_ratio: f64,
}

fn rotation_x(a: f64) -> Matrix3<f64> {
    let (s, c) = a.sin_cos();
    Matrix3::new(1.0, 0.0, 0.0, 0.0, c, -s, 0.0, s, c)
}

fn rotation_y(a: f64) -> Matrix3<f64> {
    let (s, c) = a.sin_cos();
    Matrix3::new(c, 0.0, s, 0.0, 1.0, 0.0, -s, 0.0, c)
}

impl GroupState {
    /// The attitude turned by a small step about two level axes.
    pub fn turned(&self, step: [f64; 2]) -> Matrix3<f64> {
        self.attitude * rotation_x(step[0]) * rotation_y(step[1])
    }
}

/// A view's matrices, made once for all its points.
#[derive(Debug, Clone)]
pub struct Pose {
    scene: SceneModel,
    attitude: Matrix3<f64>,
    /// A Rx(δ1).
    half_tilted: Matrix3<f64>,
    /// Ry(δ2).
    second_tilt: Matrix3<f64>,
    /// A D.
    tilted: Matrix3<f64>,
    /// A D Rz(-yaw): camera from world coordinates.
    pub rotation: Matrix3<f64>,
    /// Rotation times B: camera coordinates of q.
    matrix: Matrix3<f64>,
    centre: Vector3<f64>,
}

impl Pose {
    /// Of a view in its group.
    pub fn new(scene: SceneModel, group: &GroupState, view: &ViewState) -> Self {
        let (first, second_tilt) = (rotation_x(view.delta_rad[0]), rotation_y(view.delta_rad[1]));
        let half_tilted = group.attitude * first;
        let tilted = half_tilted * second_tilt;
        let rotation = tilted * yaw_rotation(view.yaw_rad);
        let centre = Vector3::new(view.position.x, view.position.y, (group.ln_height + view.ln_height_ratio).exp());
        let matrix = match scene {
            SceneModel::Floor => {
                let [x, y] = [0, 1].map(|i| rotation.column(i).into_owned());
                Matrix3::from_columns(&[x, y, -(rotation * centre)])
            }
            SceneModel::Directions => rotation,
        };
        Self { scene, attitude: group.attitude, half_tilted, second_tilt, tilted, rotation, matrix, centre }
    }

    /// Camera coordinates of a point, up to a positive factor in front.
    pub fn camera_point(&self, q: &Vector3<f64>) -> Vector3<f64> {
        self.matrix * q
    }

    /// The point (unit length) seen along a ray given in camera coordinates.
    pub fn back_project(&self, ray: &Vector3<f64>) -> Vector3<f64> {
        let w = self.rotation.transpose() * ray;
        let q = match self.scene {
            SceneModel::Directions => w,
            SceneModel::Floor => {
                let scale = -w.z / self.centre.z;
                Vector3::new(w.x + scale * self.centre.x, w.y + scale * self.centre.y, scale)
            }
        };
        q.normalize()
    }

    /// Optical centre: x, y, height.
    pub fn centre(&self) -> Vector3<f64> {
        self.centre
    }
}

/// The lens and the camera matrix of a camera vector, ready for projecting.
#[derive(Debug, Clone, Copy)]
pub struct Projector {
    fx: f64,
    fy: f64,
    centre: Vector2<f64>,
    skew: f64,
    distortion: Distortion,
}

impl Projector {
    /// `tangential` holds p1 and p2, which are not refined.
    pub fn new(camera: &CameraVector, tangential: [f64; 2]) -> Self {
        let fx = camera[0].exp();
        let [p1, p2] = tangential;
        Self {
            fx,
            fy: fx * camera[1].exp(),
            centre: Vector2::new(camera[2], camera[3]),
            skew: camera[4],
            distortion: Distortion { k1: camera[5], k2: camera[6], p1, p2 },
        }
    }

    fn pixel(&self, d: &Vector2<f64>) -> Vector2<f64> {
        Vector2::new(self.fx * d.x + self.skew * d.y, self.fy * d.y) + self.centre
    }

    /// The pixel of a point in camera coordinates; `None` behind the camera or beyond the lens's fold.
    pub fn project(&self, x: &Vector3<f64>) -> Option<Vector2<f64>> {
        if x.z <= 1e-9 * x.norm() {
            return None;
        }
        let n = Vector2::new(x.x / x.z, x.y / x.z);
        if self.distortion.is_none() {
            return Some(self.pixel(&n));
        }
        (self.distortion.distort_jacobian(&n).determinant() > 0.0).then(|| self.pixel(&self.distortion.distort(&n)))
    }

    /// The ray (z = 1) of a pixel in camera coordinates.
    pub fn ray(&self, pixel: &Vector2<f64>) -> Option<Vector3<f64>> {
        let y = (pixel.y - self.centre.y) / self.fy;
        let d = Vector2::new((pixel.x - self.centre.x - self.skew * y) / self.fx, y);
        let n = self.distortion.undistort(&d)?;
        Some(Vector3::new(n.x, n.y, 1.0))
    }
}

/// A pixel (frame units) with its derivatives.
pub struct Projection {
    /// Where the point is seen.
    pub pixel: Vector2<f64>,
    /// By camera (7), group (3), view (6).
    pub by_slots: SMatrix<f64, 2, SLOTS>,
    /// By the point's homogeneous coordinates.
    pub by_point: Matrix2x3<f64>,
}

/// Projects a point with all derivatives; `None` behind the camera or beyond the lens's fold.
pub fn project_with_derivatives(projector: &Projector, pose: &Pose, q: &Vector3<f64>) -> Option<Projection> {
    let x = pose.camera_point(q);
    if x.z <= 1e-9 * x.norm() {
        return None;
    }
    let inverse = 1.0 / x.z;
    let n = Vector2::new(x.x * inverse, x.y * inverse);
    let d = projector.distortion.distort(&n);
    let lens = projector.distortion.distort_jacobian(&n);
    if lens.determinant() <= 0.0 {
        return None;
    }
    let linear = Matrix2::new(projector.fx, projector.skew, 0.0, projector.fy);
    let by_normalised = linear * lens;
    // ∂pixel / ∂x, homogeneous of degree -1.
    let g = Matrix2x3::from_columns(&[
        by_normalised.column(0) * inverse,
        by_normalised.column(1) * inverse,
        -(by_normalised * n) * inverse,
    ]);
    let mut j = SMatrix::<f64, 2, SLOTS>::zeros();
    let fy_part = projector.fy * d.y;
    (j[(0, 0)], j[(1, 0)]) = (projector.fx * d.x, fy_part);
    j[(1, 1)] = fy_part;
    (j[(0, 2)], j[(1, 3)]) = (1.0, 1.0);
    j[(0, 4)] = d.y;
    let r2 = n.norm_squared();
    let along = linear * n * r2;
    j.set_column(5, &along);
    j.set_column(6, &(along * r2));
    let t = pose.attitude.tr_mul(&x);
    let by_first = g * (pose.attitude * Vector3::new(0.0, -t.z, t.y));
    j.set_column(7, &by_first);
    j.set_column(8, &(g * (pose.attitude * Vector3::new(t.z, 0.0, -t.x))));
    let s = pose.half_tilted.tr_mul(&x);
    j.set_column(10, &by_first);
    j.set_column(11, &(g * (pose.half_tilted * Vector3::new(s.z, 0.0, -s.x))));
    let w = pose.second_tilt.tr_mul(&s);
    j.set_column(12, &(g * (pose.tilted * Vector3::new(w.y, -w.x, 0.0))));
    if pose.scene == SceneModel::Floor {
        let weight = -q.z;
        j.set_column(13, &(g * pose.rotation.column(0) * weight));
        j.set_column(14, &(g * pose.rotation.column(1) * weight));
        let by_height = g * pose.rotation.column(2) * (weight * pose.centre.z);
        j.set_column(9, &by_height);
        j.set_column(15, &by_height);
    }
    Some(Projection { pixel: projector.pixel(&d), by_slots: j, by_point: g * pose.matrix })
}

/// Two orthonormal directions across a unit vector.
pub fn tangent_of(q: &Vector3<f64>) -> [Vector3<f64>; 2] {
    let sign = if q.z >= 0.0 { 1.0 } else { -1.0 };
    // Duff et al. 2017, "Building an orthonormal basis, revisited".
    let a = -1.0 / (sign + q.z);
    let b = q.x * q.y * a;
    [Vector3::new(1.0 + sign * q.x * q.x * a, sign * b, -sign * q.x), Vector3::new(b, sign + q.y * q.y * a, -q.y)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::attitude::attitude_rotation;

    fn example(scene: SceneModel) -> (CameraVector, GroupState, ViewState, Vector3<f64>) {
        let camera = CameraVector::from([0.8, 0.01, 0.05, -0.03, 0.01, -0.15, 0.03]);
        let group = GroupState { attitude: attitude_rotation(0.7, 0.3), ln_height: 0.1 };
        let view = ViewState {
            group: 0,
            delta_rad: [0.03, -0.05],
            yaw_rad: 0.4,
            position: Vector2::new(0.3, -0.2),
            ln_height_ratio: -0.05,
        };
        let q = Pose::new(scene, &group, &view).back_project(&Vector3::new(0.21, -0.13, 1.0));
        (camera, group, view, q)
    }

    #[test]
    fn derivatives_agree_with_differences() {
        for scene in [SceneModel::Floor, SceneModel::Directions] {
            let (camera, group, view, q) = example(scene);
            let value = |step: &SVector<f64, { SLOTS + 3 }>| {
                let camera = camera + step.fixed_rows::<CAMERA>(0);
                let group =
                    GroupState { attitude: group.turned([step[7], step[8]]), ln_height: group.ln_height + step[9] };
                let view = ViewState {
                    group: 0,
                    delta_rad: [view.delta_rad[0] + step[10], view.delta_rad[1] + step[11]],
                    yaw_rad: view.yaw_rad + step[12],
                    position: view.position + Vector2::new(step[13], step[14]),
                    ln_height_ratio: view.ln_height_ratio + step[15],
                };
                let q = q + Vector3::new(step[16], step[17], step[18]);
                let pose = Pose::new(scene, &group, &view);
                Projector::new(&camera, [1e-3, -2e-3]).project(&pose.camera_point(&q)).expect("in front")
            };
            let pose = Pose::new(scene, &group, &view);
            let projector = Projector::new(&camera, [1e-3, -2e-3]);
            let p = project_with_derivatives(&projector, &pose, &q).expect("in front");
            assert!((p.pixel - value(&SVector::zeros())).norm() < 1e-14);
            for i in 0..SLOTS + 3 {
                let mut step = SVector::zeros();
                step[i] = 1e-6;
                let difference = (value(&step) - value(&-step)) / 2e-6;
                let analytic = if i < SLOTS { p.by_slots.column(i) } else { p.by_point.column(i - SLOTS) };
                assert!((difference - analytic).norm() < 1e-8, "{scene:?} {i}: {difference} {analytic}");
            }
        }
    }

    #[test]
    fn what_is_seen_along_a_ray_is_seen_there() {
        for scene in [SceneModel::Floor, SceneModel::Directions] {
            let (camera, group, view, _) = example(scene);
            let projector = Projector::new(&camera, [0.0; 2]);
            let pose = Pose::new(scene, &group, &view);
            // Below and above the horizon.
            for pixel in [Vector2::new(0.3, 0.4), Vector2::new(-0.2, -1.1)] {
                let q = pose.back_project(&projector.ray(&pixel).expect("inside the fold"));
                let again = projector.project(&pose.camera_point(&q)).expect("in front");
                assert!((again - pixel).norm() < 1e-12);
                let [u, v] = tangent_of(&q);
                let orthonormal = [u.dot(&q), v.dot(&q), u.dot(&v), u.norm() - 1.0, v.norm() - 1.0];
                assert!(orthonormal.iter().all(|e| e.abs() < 1e-14));
            }
        }
    }
}
