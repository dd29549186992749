//! Where a camera or a thing stands. World: Z up, the floor at Z = 0, metres. Camera: x right, y down, z forward.

use nalgebra::{Matrix3, Rotation3, Vector3};

/// Rotation and position of a frame in the world: X = R x + c.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Pose {
    /// Directions of the frame in the world.
    pub(crate) rotation: Matrix3<f64>,
    /// Its origin in the world, metres.
    pub(crate) centre: Vector3<f64>,
}

impl Pose {
    pub(crate) fn identity() -> Self {
        Self { rotation: Matrix3::identity(), centre: Vector3::zeros() }
    }

    pub(crate) fn new(rotation: Matrix3<f64>, centre: Vector3<f64>) -> Self {
        Self { rotation, centre }
    }

    /// World coordinates of a point of the frame.
    pub(crate) fn outward(&self, point: &Vector3<f64>) -> Vector3<f64> {
        self.rotation * point + self.centre
    }

    /// Coordinates in the frame of a point of the world.
    pub(crate) fn inward(&self, point: &Vector3<f64>) -> Vector3<f64> {
        self.rotation.transpose() * (point - self.centre)
    }

    /// Turned about an axis of the world, the centre staying where it is.
    pub(crate) fn turned(&self, axis: &Vector3<f64>, angle_rad: f64) -> Self {
        Self { rotation: about(axis, angle_rad) * self.rotation, ..*self }
    }
}

/// Rotation about an axis.
pub(crate) fn about(axis: &Vector3<f64>, angle_rad: f64) -> Matrix3<f64> {
    by(&(axis.normalize() * angle_rad))
}

/// Rotation by a vector: axis times angle.
pub(crate) fn by(vector: &Vector3<f64>) -> Matrix3<f64> {
    *Rotation3::new(*vector).matrix()
}

/// A camera that looks along a heading, so far below the horizontal, rolled about its axis.
pub(crate) fn looking(heading_rad: f64, pitch_down_rad: f64, roll_rad: f64) -> Matrix3<f64> {
    let (sh, ch) = heading_rad.sin_cos();
    let (sp, cp) = pitch_down_rad.sin_cos();
    let forward = Vector3::new(ch * cp, sh * cp, -sp);
    let right = Vector3::new(sh, -ch, 0.0);
    let down = forward.cross(&right);
    let (sr, cr) = roll_rad.sin_cos();
    Matrix3::from_columns(&[right * cr + down * sr, down * cr - right * sr, forward])
}

/// A camera at a place that looks at a point, rolled about its axis.
pub(crate) fn looking_at(from: &Vector3<f64>, at: &Vector3<f64>, roll_rad: f64) -> Matrix3<f64> {
    let d = (at - from).normalize();
    looking(d.y.atan2(d.x), (-d.z).clamp(-1.0, 1.0).asin(), roll_rad)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_camera_has_right_handed_axes_and_looks_where_it_should() {
        let r = looking(0.7, 0.5, 0.3);
        assert!((r.determinant() - 1.0).abs() < 1e-12 && (r * r.transpose() - Matrix3::identity()).norm() < 1e-12);
        assert!(looking(0.0, 0.0, 0.0).column(1).z < -0.999, "down is down");
        let (from, at) = (Vector3::new(1.0, 2.0, 3.0), Vector3::new(2.0, -1.0, 0.0));
        let seen = Pose::new(looking_at(&from, &at, 0.2), from).inward(&at);
        assert!(seen.xy().norm() < 1e-12 && seen.z > 0.0);
    }
}
