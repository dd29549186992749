//! A view of a point on the floor, with its derivatives.
//!
//! ```text
//! x ~ K A(pitch, roll) Rz(-yaw) (X - c),    X = (X, Y, 0),   c = (x, y, height)
//! ```
//!
//! (see [`crate::geometry::attitude`] for the angles). The model of the synthetic scenes and of the Cramér-Rao bound; that of the joint
//! refinement, with a lens and homogeneous points, is that of [`crate::refine`].

use nalgebra::Vector3;
#[cfg(feature = "synthetic")]
use nalgebra::{SMatrix, Vector2};

#[cfg(feature = "synthetic")]
use crate::geometry::{
    attitude::{attitude_rotation, yaw_rotation},
    intrinsics::Intrinsics,
};

/// Position and orientation of a camera over the floor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct View {
    /// Angle of the optical axis below the horizontal, radians.
    pub pitch_down_rad: f64,
    /// Roll about the optical axis, radians.
    pub roll_rad: f64,
    /// Heading, counter-clockwise from above, radians.
    pub yaw_rad: f64,
    /// Optical centre over the floor, in the floor's unit.
    pub centre: Vector3<f64>,
}

/// Number of derivatives of [`project_with_jacobian`].
#[cfg(feature = "synthetic")]
pub(crate) const PARAMETERS: usize = 13;

/// Order of the derivatives: (fx, fy, cx, cy, skew), (pitch, roll), yaw, centre (x, y, height), point (X, Y).
#[cfg(feature = "synthetic")]
pub(crate) type ProjectionJacobian = SMatrix<f64, 2, PARAMETERS>;

/// The pixel of a floor point; `None` when it lies behind the camera.
#[cfg(test)]
pub(crate) fn project(k: &Intrinsics, view: &View, point: &Vector2<f64>) -> Option<Vector2<f64>> {
    let w = yaw_rotation(view.yaw_rad) * (Vector3::new(point.x, point.y, 0.0) - view.centre);
    let x = attitude_rotation(view.pitch_down_rad, view.roll_rad) * w;
    (x.z > 0.0).then(|| k.pixel_from_normalised(&Vector2::new(x.x / x.z, x.y / x.z)))
}

/// The pixel of a floor point and its derivatives.
#[cfg(feature = "synthetic")]
pub(crate) fn project_with_jacobian(
    k: &Intrinsics,
    view: &View,
    point: &Vector2<f64>,
) -> Option<(Vector2<f64>, ProjectionJacobian)> {
    let attitude = attitude_rotation(view.pitch_down_rad, view.roll_rad);
    let yaw = yaw_rotation(view.yaw_rad);
    let w = yaw * (Vector3::new(point.x, point.y, 0.0) - view.centre);
    let x = attitude * w;
    if x.z <= 0.0 {
        return None;
    }
    let (u, v, inverse) = (x.x / x.z, x.y / x.z, 1.0 / x.z);
    let pixel = k.pixel_from_normalised(&Vector2::new(u, v));
    let by_camera_point = SMatrix::<f64, 2, 3>::new(
        k.fx * inverse,
        k.skew * inverse,
        -(k.fx * u + k.skew * v) * inverse,
        0.0,
        k.fy * inverse,
        -k.fy * v * inverse,
    );
    let mut j = ProjectionJacobian::zeros();
    j.fixed_view_mut::<2, 5>(0, 0).copy_from(&SMatrix::<f64, 2, 5>::new(
        u, 0.0, 1.0, 0.0, v, //
        0.0, v, 0.0, 1.0, 0.0,
    ));
    // A = Rz(-roll) Rx(pitch) R0: pitching turns about the camera's x as it was before the roll.
    let (sin, cos) = view.roll_rad.sin_cos();
    let pitch_axis = Vector3::new(cos, -sin, 0.0);
    let rotation = attitude * yaw;
    let columns: [Vector3<f64>; 8] = [
        pitch_axis.cross(&x),
        -Vector3::z().cross(&x),
        attitude * -Vector3::z().cross(&w),
        -rotation.column(0),
        -rotation.column(1),
        -rotation.column(2),
        rotation.column(0).into_owned(),
        rotation.column(1).into_owned(),
    ];
    for (i, column) in columns.iter().enumerate() {
        j.set_column(5 + i, &(by_camera_point * column));
    }
    Some((pixel, j))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn derivatives_agree_with_differences() {
        let k = Intrinsics { fx: 900.0, fy: 910.0, cx: 510.0, cy: 380.0, skew: 1.5 };
        let view = View { pitch_down_rad: 0.8, roll_rad: 0.3, yaw_rad: 0.5, centre: Vector3::new(0.2, -0.3, 1.4) };
        // Ahead of the camera, whatever the heading means.
        let ahead = attitude_rotation(0.8, 0.3).transpose() * Vector3::new(0.1, -0.05, 1.0);
        let ahead = yaw_rotation(0.5).transpose() * ahead;
        let hit = view.centre - ahead * (view.centre.z / ahead.z);
        let point = Vector2::new(hit.x, hit.y);
        let value = |p: &SMatrix<f64, PARAMETERS, 1>| {
            let k = Intrinsics { fx: p[0], fy: p[1], cx: p[2], cy: p[3], skew: p[4] };
            let view =
                View { pitch_down_rad: p[5], roll_rad: p[6], yaw_rad: p[7], centre: Vector3::new(p[8], p[9], p[10]) };
            project(&k, &view, &Vector2::new(p[11], p[12])).expect("in front")
        };
        let at = SMatrix::<f64, PARAMETERS, 1>::from_column_slice(&[
            k.fx, k.fy, k.cx, k.cy, k.skew, 0.8, 0.3, 0.5, 0.2, -0.3, 1.4, point.x, point.y,
        ]);
        let (pixel, jacobian) = project_with_jacobian(&k, &view, &point).expect("in front");
        assert!((pixel - value(&at)).norm() < 1e-12);
        for i in 0..PARAMETERS {
            let h = 1e-6 * at[i].abs().max(0.1);
            let (mut up, mut down) = (at, at);
            up[i] += h;
            down[i] -= h;
            let difference = (value(&up) - value(&down)) / (2.0 * h);
            let error = (difference - jacobian.column(i)).norm();
            assert!(error < 1e-6 * (1.0 + difference.norm()), "{i}: {difference} {}", jacobian.column(i));
        }
    }
}
