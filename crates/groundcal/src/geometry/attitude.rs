//! Angles of a camera over a level plane.
//!
//! World: X and Y span the plane, Z points up. Camera: x right, y down, z forward. With `Rx`, `Rz` the usual
//! right-handed rotations of coordinates,
//!
//! ```text
//! R_cam_from_world = Rz(-roll) Rx(pitch_down) R0 Rz(-yaw)
//!                    '-------- A_g ---------'
//!
//!      | 0 -1  0 |          | 1  0   0 |          | c -s  0 |
//! R0 = | 0  0 -1 |  Rx(a) = | 0  c  -s |  Rz(a) = | s  c  0 |   c = cos a, s = sin a
//!      | 1  0  0 |          | 0  s   c |          | 0  0  1 |
//! ```
//!
//! All angles zero: the camera looks along world +X, its x is world -Y, its y is world -Z (the heading of ROS REP 103). Then, as motions of the camera:
//! - *yaw* turns it anticlockwise seen from above (from +X towards +Y);
//! - *pitch_down* lowers the optical axis below the horizon (90 degrees: straight down);
//! - *roll* turns it about its optical axis, clockwise seen from behind (its right-hand side dips), so that the picture
//!   turns anticlockwise.
//!
//! Pitch and roll are the two numbers an attitude group shares; `A_g` is what a turn about the plane's normal leaves alone.

use nalgebra::{Matrix3, Vector3};

/// Spread of rolls, degrees, below which horizons count as parallel: along them the principal point is told by the priors alone. (A tripod
/// that is set up again differs by a degree or two.)
pub(crate) const PARALLEL_HORIZONS_DEG: f64 = 5.0;

/// The rotation of camera coordinates from a level world frame whose heading is the camera's own (yaw 0): the `A_g` of
/// an attitude group. Angles in radians; signs as the module says.
pub(crate) fn attitude_rotation(pitch_down_rad: f64, roll_rad: f64) -> Matrix3<f64> {
    let (sp, cp) = pitch_down_rad.sin_cos();
    let (sr, cr) = roll_rad.sin_cos();
    // Rx(pitch) R0, written out.
    let pitched = Matrix3::new(0.0, -1.0, 0.0, -sp, 0.0, -cp, cp, 0.0, -sp);
    Matrix3::new(cr, sr, 0.0, -sr, cr, 0.0, 0.0, 0.0, 1.0) * pitched
}

/// The rotation of world coordinates about the plane's normal that a camera's yaw stands for: `Rz(-yaw)`, in radians.
pub(crate) fn yaw_rotation(yaw_rad: f64) -> Matrix3<f64> {
    let (s, c) = yaw_rad.sin_cos();
    Matrix3::new(c, s, 0.0, -s, c, 0.0, 0.0, 0.0, 1.0)
}

/// Camera coordinates from world coordinates (rotation only), of angles in radians; signs as the module says.
pub fn rotation_cam_from_world(pitch_down_rad: f64, roll_rad: f64, yaw_rad: f64) -> Matrix3<f64> {
    attitude_rotation(pitch_down_rad, roll_rad) * yaw_rotation(yaw_rad)
}

/// The plane's upward normal in camera coordinates (unit length), of an attitude in radians.
pub(crate) fn up_in_camera(pitch_down_rad: f64, roll_rad: f64) -> Vector3<f64> {
    let (sp, cp) = pitch_down_rad.sin_cos();
    let (sr, cr) = roll_rad.sin_cos();
    Vector3::new(-sr * cp, -cr * cp, -sp)
}

/// Pitch (down) and roll in radians, from the plane's upward normal in camera coordinates (any positive length). Looking
/// straight down or up leaves the roll undetermined: it is then whatever rounding makes of it (zero for exact zeros).
pub(crate) fn attitude_from_up(up_in_camera: &Vector3<f64>) -> (f64, f64) {
    let (x, y, z) = (up_in_camera.x, up_in_camera.y, up_in_camera.z);
    let level = x.hypot(y);
    let roll = if level == 0.0 { 0.0 } else { (-x).atan2(-y) };
    ((-z).atan2(level), roll)
}

/// Pitch (down), roll and yaw in radians of a rotation of camera from world coordinates: the inverse of
/// [`rotation_cam_from_world`] for pitches within 90 degrees.
pub fn angles_from_rotation(r_cam_from_world: &Matrix3<f64>) -> (f64, f64, f64) {
    let (pitch, roll) = attitude_from_up(&r_cam_from_world.column(2).into_owned());
    let yaw = attitude_rotation(pitch, roll).transpose() * r_cam_from_world;
    (pitch, roll, yaw[(0, 1)].atan2(yaw[(0, 0)]))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rx(a: f64) -> Matrix3<f64> {
        let (s, c) = a.sin_cos();
        Matrix3::new(1.0, 0.0, 0.0, 0.0, c, -s, 0.0, s, c)
    }

    fn rz(a: f64) -> Matrix3<f64> {
        let (s, c) = a.sin_cos();
        Matrix3::new(c, -s, 0.0, s, c, 0.0, 0.0, 0.0, 1.0)
    }

    #[test]
    fn the_product_is_the_one_the_module_states() {
        let r0 = Matrix3::new(0.0, -1.0, 0.0, 0.0, 0.0, -1.0, 1.0, 0.0, 0.0);
        let (p, r, y) = (0.7, -0.4, 1.9);
        let expected = rz(-r) * rx(p) * r0 * rz(-y);
        let got = rotation_cam_from_world(p, r, y);
        assert!((got - expected).norm() < 1e-15);
        assert!((got.determinant() - 1.0).abs() < 1e-14);
        assert!((got.column(2) - up_in_camera(p, r)).norm() < 1e-15);
    }

    #[test]
    fn each_angle_moves_the_camera_the_way_its_name_says() {
        let axis = |p: f64, r: f64, y: f64| rotation_cam_from_world(p, r, y).row(2).transpose();
        let right = |p: f64, r: f64, y: f64| rotation_cam_from_world(p, r, y).row(0).transpose();
        assert!((axis(0.0, 0.0, 0.0) - Vector3::x()).norm() < 1e-15);
        assert!((right(0.0, 0.0, 0.0) + Vector3::y()).norm() < 1e-15);
        // A quarter turn to the left from +X faces +Y.
        assert!((axis(0.0, 0.0, std::f64::consts::FRAC_PI_2) - Vector3::y()).norm() < 1e-15);
        assert!(axis(0.3, 0.0, 0.0).z < 0.0);
        assert!((axis(std::f64::consts::FRAC_PI_2, 0.0, 0.0) + Vector3::z()).norm() < 1e-15);
        assert!(right(0.0, 0.3, 0.0).z < 0.0, "a positive roll dips the right-hand side");
        assert!((axis(0.5, 0.3, 0.2) - axis(0.5, 0.0, 0.2)).norm() < 1e-15, "roll keeps the optical axis");
    }

    #[test]
    fn angles_come_back() {
        for (p, r, y) in [(0.7, -0.4, 1.9), (-0.2, 2.5, -3.0), (1.5, 0.1, 0.0)] {
            let (p2, r2, y2) = angles_from_rotation(&rotation_cam_from_world(p, r, y));
            assert!((p - p2).abs() < 1e-12 && (r - r2).abs() < 1e-12 && (y - y2).abs() < 1e-12, "{p2} {r2} {y2}");
        }
        assert_eq!(attitude_from_up(&-Vector3::z()), (std::f64::consts::FRAC_PI_2, 0.0));
    }
}
