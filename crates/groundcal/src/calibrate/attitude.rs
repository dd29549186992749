//! The plane's normal in the camera frame, as circular points under a camera matrix show it.

use nalgebra::{Complex, SMatrix, Vector3};

use crate::{
    geometry::{
        attitude::{attitude_from_up, up_in_camera},
        camera::INTRINSIC_NAMES,
        frame::Frame,
        intrinsics::Intrinsics,
        size::ImageSize,
    },
    ids::PairId,
    pairs::{circular_points::CircularPoint, observation::PairObservation},
    refine::JointCovariance,
    select::attitude_groups::AttitudeGroup,
};

/// The floor's normal in the camera frame.
pub(super) struct Attitude {
    pub(super) pitch_down_rad: f64,
    pub(super) roll_rad: f64,
    pub(super) horizon_px: Option<[f64; 3]>,
    up: Vector3<f64>,
}

impl Attitude {
    /// From a circular point (frame coordinates): the normal is the cross product of the real and imaginary part of
    /// K⁻¹e. It points up: away from the points seen on the floor, or, when points lie on both sides of the horizon (a
    /// scene at infinity), to the top of the image.
    fn of(point: &CircularPoint, k: &Intrinsics, frame: &Frame, seen: impl Iterator<Item = Vector3<f64>>) -> Self {
        let mut up = normal_of(point, k, frame);
        let (mut below, mut above) = (0usize, 0usize);
        for p in seen {
            if (k.inverse_matrix() * p).dot(&up) < 0.0 {
                below += 1;
            } else {
                above += 1;
            }
        }
        let one_sided = below.max(above) > 9 * below.min(above) && below + above > 0;
        let turn_over = if one_sided { above > below } else { up.y > 0.0 || (up.y == 0.0 && up.z > 0.0) };
        if turn_over {
            up = -up;
        }
        Self::from_up(up, k)
    }

    /// Of a group of the motions `used`, which their points lie below.
    pub(super) fn of_group(
        group: &AttitudeGroup,
        k: &Intrinsics,
        frame: &Frame,
        pairs: &[PairObservation],
        used: &[PairId],
    ) -> Self {
        let seen = group.members.iter().flat_map(|&member| pairs[used[member]].seen_in_first());
        Self::of(&group.fused.point, k, frame, seen)
    }

    /// From the unit normal itself.
    pub(super) fn from_up(up: Vector3<f64>, k: &Intrinsics) -> Self {
        let (pitch_down_rad, roll_rad) = attitude_from_up(&up);
        Self { pitch_down_rad, roll_rad, horizon_px: horizon_px(k, &up), up }
    }

    /// Standard deviations of the horizon's direction (radians) and of its distance from the image's centre (pixels), from the
    /// covariance of camera (pixels), pitch and roll (radians). `None`: at infinity.
    pub(super) fn horizon_sigma(
        &self,
        k: &Intrinsics,
        size: ImageSize,
        covariance: &JointCovariance,
    ) -> Option<[f64; 2]> {
        let [x, y] = size.centre_px();
        // The line's normal turns by the cross product, its distance changes by the difference.
        let [a, b, c] = self.horizon_px?;
        // The camera matrix, pitch and roll; neither the lens nor the height has a part in an ideal horizon.
        const NUMBERS: usize = INTRINSIC_NAMES.len() + 2;
        let moved = |i: usize, step: f64| {
            let mut p = [k.fx, k.fy, k.cx, k.cy, k.skew, self.pitch_down_rad, self.roll_rad];
            p[i] += step;
            let [fx, fy, cx, cy, skew, pitch_down_rad, roll_rad] = p;
            let k = Intrinsics { fx, fy, cx, cy, skew };
            let [a2, b2, c2] = horizon_px(&k, &up_in_camera(pitch_down_rad, roll_rad))?;
            Some([(a * b2 - b * a2).atan2(a * a2 + b * b2), (a2 - a) * x + (b2 - b) * y + (c2 - c)])
        };
        let mut jacobian = SMatrix::<f64, 2, NUMBERS>::zeros();
        for i in 0..NUMBERS {
            let h = if i < INTRINSIC_NAMES.len() { 1e-3 } else { 1e-6 };
            let (up, down) = (moved(i, h)?, moved(i, -h)?);
            for r in 0..2 {
                jacobian[(r, i)] = (up[r] - down[r]) / (2.0 * h);
            }
        }
        let after_camera = covariance.camera_numbers();
        let place = |i: usize| i.checked_sub(INTRINSIC_NAMES.len()).map_or(i, |of_pose| after_camera + of_pose);
        let covariance = SMatrix::<f64, NUMBERS, NUMBERS>::from_fn(|r, c| covariance.matrix()[(place(r), place(c))]);
        let variance = jacobian * covariance * jacobian.transpose();
        Some([0, 1].map(|i| variance[(i, i)].max(0.0).sqrt()))
    }

    /// +1 when the eigenvalue's angle is a counter-clockwise turn of the camera seen from above, -1 otherwise: the
    /// eigenvector K A (1, i, 0) belongs to exp(i (yaw_b - yaw_a)).
    pub(super) fn turn_sign(&self, point: &CircularPoint, k: &Intrinsics, frame: &Frame) -> f64 {
        normal_of(point, k, frame).dot(&self.up).signum()
    }
}

/// The line a x + b y + c = 0, a² + b² = 1, of a plane's normal; `None` at infinity.
fn horizon_px(k: &Intrinsics, up: &Vector3<f64>) -> Option<[f64; 3]> {
    let line = k.inverse_matrix().transpose() * up;
    let length = line.xy().norm();
    (length > 1e-12).then(|| [line.x / length, line.y / length, line.z / length])
}

fn normal_of(point: &CircularPoint, k: &Intrinsics, frame: &Frame) -> Vector3<f64> {
    let m = (k.inverse_matrix() * frame.pixel_matrix()).map(|x| Complex::new(x, 0.0));
    let v = m * point.point;
    v.map(|z| z.re).cross(&v.map(|z| z.im)).normalize()
}
