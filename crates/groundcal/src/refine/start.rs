//! A state to refine from: camera, attitudes and homographies of pairs, put together along the best supported pairs.
//!
//! With F the map from the floor (X, Y, 1) to ideal pixels of a view, F_b ~ H_ba F_a, and K⁻¹ F ~ [r1 r2 -R c]. For a scene of
//! directions K⁻¹ H K = R_b R_aᵀ.

use nalgebra::{Matrix3, Rotation3, Vector2, Vector3};

use crate::geometry::{homography::Homography, intrinsics::Intrinsics};
use crate::refine::{
    model::{CameraVector, GroupState, SceneModel, ViewState},
    problem::State,
};

/// A pair of views joined by a homography of the floor (or of directions) between ideal pixels.
#[derive(Debug, Clone)]
pub struct Link {
    /// Index of the first view.
    pub from: usize,
    /// Index of the second view.
    pub to: usize,
    /// Ideal pixels of the first to those of the second.
    pub h_to_from: Homography,
    /// Matches behind it: better links are followed first.
    pub matches: usize,
}

/// The state: `attitudes` of the groups, `group_of_view` of the views. `None` when a link's homography fits no camera.
pub fn state_from_links(
    scene: SceneModel,
    camera: CameraVector,
    k_px: &Intrinsics,
    attitudes: &[Matrix3<f64>],
    group_of_view: &[usize],
    links: &[Link],
) -> Option<State> {
    let groups: Vec<GroupState> = attitudes.iter().map(|a| GroupState { attitude: *a, ln_height: 0.0 }).collect();
    let count = group_of_view.len();
    // Camera from world rotation and optical centre.
    let mut poses: Vec<Option<(Matrix3<f64>, Vector3<f64>)>> = vec![None; count];
    let mut order: Vec<&Link> = links.iter().collect();
    order.sort_by_key(|l| std::cmp::Reverse(l.matches));
    let (k, k_inverse) = (k_px.matrix(), k_px.inverse_matrix());
    for root in 0..count {
        if poses[root].is_some() {
            continue;
        }
        poses[root] = Some((attitudes[group_of_view[root]], Vector3::z()));
        // The best link that leads on, until none does (Prim).
        while let Some(link) = order.iter().find(|l| poses[l.from].is_some() != poses[l.to].is_some()) {
            let (known, new, h) = if poses[link.from].is_some() {
                (link.from, link.to, link.h_to_from)
            } else {
                (link.to, link.from, link.h_to_from.inverse())
            };
            let (rotation, centre) = poses[known]?;
            let m = k_inverse * h.matrix() * k;
            poses[new] = Some(match scene {
                SceneModel::Floor => {
                    let [x, y] = [0, 1].map(|i| rotation.column(i).into_owned());
                    pose_from_floor(&(m * Matrix3::from_columns(&[x, y, -(rotation * centre)])))?
                }
                SceneModel::Directions => (nearest_rotation(&m)? * rotation, Vector3::z()),
            });
        }
    }
    let views = group_of_view
        .iter()
        .zip(&poses)
        .map(|(&group, pose)| {
            let (rotation, centre) = (*pose)?;
            // A D Rz(-yaw) with D near the identity.
            let turn = attitudes[group].tr_mul(&rotation);
            Some(ViewState {
                group,
                delta_rad: [0.0; 2],
                yaw_rad: (turn[(0, 1)] - turn[(1, 0)]).atan2(turn[(0, 0)] + turn[(1, 1)]),
                position: Vector2::new(centre.x, centre.y),
                ln_height_ratio: centre.z.ln(),
            })
        })
        .collect::<Option<Vec<_>>>()?;
    Some(State { camera, groups, views, points: Vec::new() })
}

/// How far a homography between two views is from one of the floor that both have a known attitude to: the sine of the angle
/// between the normal it gives the second view and the known one, and by how much it stretches the floor. `None` when it fits no
/// camera. `m` is K⁻¹ H K, `attitudes` level to camera rotations.
pub fn floor_deviation(m: &Matrix3<f64>, attitudes: [&Matrix3<f64>; 2]) -> Option<f64> {
    let [a, b] = attitudes;
    let floor = m * Matrix3::from_columns(&[a.column(0).into_owned(), a.column(1).into_owned(), -a.column(2)]);
    let (x, y) = (floor.column(0), floor.column(1));
    let stretch = (x.norm() / y.norm()).ln().abs() + (x.dot(&y) / (x.norm() * y.norm())).abs();
    let (rotation, _) = pose_from_floor(&floor)?;
    Some(rotation.column(2).cross(&b.column(2)).norm() + stretch)
}

/// Rotation and optical centre from K⁻¹ F.
fn pose_from_floor(m: &Matrix3<f64>) -> Option<(Matrix3<f64>, Vector3<f64>)> {
    let scale = (m.column(0).norm() * m.column(1).norm()).sqrt();
    let m = m / scale;
    let (x, y) = (m.column(0).into_owned(), m.column(1).into_owned());
    let rotation = nearest_rotation(&Matrix3::from_columns(&[x, y, x.cross(&y)]))?;
    let centre = -rotation.tr_mul(&m.column(2).into_owned());
    // The floor lies below; K⁻¹ F and its negative are the same map.
    let (rotation, centre) = if centre.z < 0.0 {
        let turned =
            Matrix3::from_columns(&[-rotation.column(0), -rotation.column(1), rotation.column(2).into_owned()]);
        (turned, -turned.tr_mul(&-m.column(2).into_owned()))
    } else {
        (rotation, centre)
    };
    (centre.z > 1e-6 && centre.iter().all(|v| v.is_finite())).then_some((rotation, centre))
}

/// Rotations of cameras that turn on the spot, from those of the first: camera from world coordinates, along the best links.
/// `None` when the links do not connect all of them.
pub fn rotations_from_links(
    first: Matrix3<f64>,
    count: usize,
    k_px: &Intrinsics,
    links: &[Link],
) -> Option<Vec<Matrix3<f64>>> {
    let (k, k_inverse) = (k_px.matrix(), k_px.inverse_matrix());
    let mut rotations = vec![None; count];
    *rotations.first_mut()? = Some(first);
    let mut order: Vec<&Link> = links.iter().collect();
    order.sort_by_key(|l| std::cmp::Reverse(l.matches));
    while let Some(l) = order.iter().find(|l| rotations[l.from].is_some() != rotations[l.to].is_some()) {
        let (known, new, h) = match rotations[l.from] {
            Some(r) => (r, l.to, l.h_to_from),
            None => (rotations[l.to]?, l.from, l.h_to_from.inverse()),
        };
        rotations[new] = Some(nearest_rotation(&(k_inverse * h.matrix() * k))? * known);
    }
    rotations.into_iter().collect()
}

/// The rotation nearest to a multiple of one.
fn nearest_rotation(m: &Matrix3<f64>) -> Option<Matrix3<f64>> {
    let det = m.determinant();
    if !det.is_finite() || det.abs() < 1e-30 {
        return None;
    }
    let m = m / det.cbrt();
    m.iter()
        .all(|v| v.is_finite())
        .then(|| Rotation3::from_matrix_eps(&m, 1e-12, 100, Rotation3::identity()).into_inner())
}
