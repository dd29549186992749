//! A state to refine from: camera, attitudes and homographies of pairs, put together along the best supported pairs.
//!
//! With F the map from the floor (X, Y, 1) to ideal pixels of a view, F_b ~ H_ba F_a, and K⁻¹ F ~ [r1 r2 -R c]. For a scene of
//! directions K⁻¹ H K = R_b R_aᵀ.

use nalgebra::{Matrix3, Rotation3, Vector2, Vector3};

use crate::refine::{
    blocks::{CameraState, CameraUnknowns, Departure, FrameState, GroupState, State},
    residual::{Pose, Projector, SceneModel},
    tracks::{Observation, Track},
};
use crate::{
    geometry::{
        attitude::{angles_from_rotation, attitude_from_up, attitude_rotation, yaw_rotation},
        homography::Homography,
        intrinsics::Intrinsics,
    },
    numerics::graph::{TreeNode, spanning_forest},
};

/// A pair of views joined by a homography of the floor (or of directions) between ideal pixels.
#[derive(Debug, Clone)]
pub(crate) struct Link {
    /// Index of the first view.
    pub from: usize,
    /// Index of the second view.
    pub to: usize,
    /// Ideal pixels of the first to those of the second.
    pub h_to_from: Homography,
    /// Matches behind it: better links are followed first.
    pub matches: usize,
}

impl Link {
    /// The homography that leads away from one of its two views.
    fn to_other_end(&self, view: usize) -> Homography {
        if view == self.from { self.h_to_from } else { self.h_to_from.inverse() }
    }
}

/// Views in the order in which the links lead to them, those of most matches first; indices are those of `links`.
fn along_best(count: usize, links: &[Link]) -> Vec<TreeNode> {
    let mut order: Vec<usize> = (0..links.len()).collect();
    order.sort_by_key(|&l| std::cmp::Reverse(links[l].matches));
    let edges: Vec<(usize, usize)> = order.iter().map(|&l| (links[l].from, links[l].to)).collect();
    let mut reached = spanning_forest(count, &edges);
    for (edge, _) in reached.iter_mut().filter_map(|r| r.by.as_mut()) {
        *edge = order[*edge];
    }
    reached
}

/// The state: `attitudes` of the groups, `group_of_view` of the views. `None` when a link's homography fits no camera.
pub(crate) fn state_from_links(
    scene: SceneModel,
    camera: CameraState,
    k_px: &Intrinsics,
    attitudes: &[Matrix3<f64>],
    group_of_view: &[usize],
    links: &[Link],
) -> Option<State> {
    let groups: Vec<GroupState> = attitudes.iter().map(|a| GroupState { attitude: *a, ln_height: 0.0 }).collect();
    let count = group_of_view.len();
    // Camera from world rotation and optical centre.
    let mut poses: Vec<Option<(Matrix3<f64>, Vector3<f64>)>> = vec![None; count];
    let (k, k_inverse) = (k_px.matrix(), k_px.inverse_matrix());
    for reached in along_best(count, links) {
        let TreeNode { node, by: Some((link, known)) } = reached else {
            poses[reached.node] = Some((attitudes[group_of_view[reached.node]], Vector3::z()));
            continue;
        };
        let (rotation, centre) = poses[known]?;
        let m = k_inverse * links[link].to_other_end(known).matrix() * k;
        poses[node] = Some(match scene {
            SceneModel::Floor => {
                let [x, y] = [0, 1].map(|i| rotation.column(i).into_owned());
                pose_from_floor(&(m * Matrix3::from_columns(&[x, y, -(rotation * centre)])))?
            }
            SceneModel::Directions => (nearest_rotation(&m)? * rotation, Vector3::z()),
        });
    }
    let frames = group_of_view
        .iter()
        .zip(&poses)
        .map(|(&group, pose)| {
            let (rotation, centre) = (*pose)?;
            // A D Rz(-yaw) with D near the identity.
            let turn = attitudes[group].tr_mul(&rotation);
            Some(FrameState {
                group,
                delta_rad: [0.0; 2],
                yaw_rad: (turn[(0, 1)] - turn[(1, 0)]).atan2(turn[(0, 0)] + turn[(1, 1)]),
                position: Vector2::new(centre.x, centre.y),
                ln_height_ratio: centre.z.ln(),
                departure: Departure::default(),
            })
        })
        .collect::<Option<Vec<_>>>()?;
    Some(State::of_one_camera(camera, groups, frames))
}

/// A state of views that moved in any way over a floor, each with an attitude of its own: `up` is the floor's normal in the camera coordinates
/// of a reference view, `from_reference` K⁻¹ H K of the homography from there to each view. `None` when one fits no camera.
pub(crate) fn state_of_views(camera: CameraState, up: &Vector3<f64>, from_reference: &[Matrix3<f64>]) -> Option<State> {
    let (pitch, roll) = attitude_from_up(up);
    let reference = attitude_rotation(pitch, roll);
    let [x, y] = [0, 1].map(|i| reference.column(i).into_owned());
    let floor = Matrix3::from_columns(&[x, y, -(reference * Vector3::z())]);
    let poses: Vec<(Matrix3<f64>, Vector3<f64>)> =
        from_reference.iter().map(|m| pose_from_floor(&(m * floor))).collect::<Option<_>>()?;
    // The world is that of the first view: there it is level, and its height is the unit.
    let (first, origin) = poses.first()?;
    let (_, _, heading) = angles_from_rotation(first);
    let turn = yaw_rotation(heading);
    let view = |(group, (rotation, centre)): (usize, &(Matrix3<f64>, Vector3<f64>))| {
        let (pitch, roll, yaw) = angles_from_rotation(rotation);
        let from_origin = turn * Vector3::new(centre.x - origin.x, centre.y - origin.y, 0.0) / origin.z;
        let state = GroupState { attitude: attitude_rotation(pitch, roll), ln_height: (centre.z / origin.z).ln() };
        let frame = FrameState {
            group,
            delta_rad: [0.0; 2],
            yaw_rad: yaw - heading,
            position: Vector2::new(from_origin.x, from_origin.y),
            ln_height_ratio: 0.0,
            departure: Departure::default(),
        };
        (state, frame)
    };
    let (groups, frames) = poses.iter().enumerate().map(view).unzip();
    Some(State::of_one_camera(camera, groups, frames))
}

/// Which tracks a state can show at all: their points, as the first image of each has them, are in front of all their images and
/// within the lens's reach. A wrong match may lie behind a camera that turned, where the model has no residual.
pub(crate) fn shown_by(state: &State, scene: SceneModel, tracks: &[Track], cameras: &[CameraUnknowns]) -> Vec<bool> {
    let projectors: Vec<Projector> = state.cameras.iter().map(Projector::new).collect();
    let pose = |o: &Observation| {
        let frame = &state.frames[o.frame];
        let rig = (o.camera > 0).then(|| &state.rig[o.camera]);
        Pose::of(scene, &state.groups[frame.group], frame, rig)
    };
    let shown = |track: &Track| {
        let first = track.observations.first()?;
        let ray = projectors[first.camera].ray(&cameras[first.camera].frame.local(&first.pixel))?;
        let point = pose(first).back_project(&ray);
        let seen = |o: &Observation| projectors[o.camera].project(&pose(o).camera_point(&point)).is_some();
        track.observations.iter().all(seen).then_some(())
    };
    tracks.iter().map(|track| shown(track).is_some()).collect()
}

/// How a homography from a view of known attitude (level to camera rotation) has a second view see the floor: by how much it stretches it, which
/// a homography of the floor does not, and the attitude. `None` when it fits no camera.
pub(crate) fn floor_seen(m: &Matrix3<f64>, attitude: &Matrix3<f64>) -> Option<(f64, Matrix3<f64>)> {
    let floor = m * floor_of(attitude);
    let (pitch, roll) = attitude_from_up(&pose_from_floor(&floor)?.0.column(2).into_owned());
    Some((stretch(&floor), attitude_rotation(pitch, roll)))
}

/// The floor's axes and the point below the optical centre as a view of this attitude and of height 1 sees them.
fn floor_of(attitude: &Matrix3<f64>) -> Matrix3<f64> {
    Matrix3::from_columns(&[attitude.column(0).into_owned(), attitude.column(1).into_owned(), -attitude.column(2)])
}

/// Logarithm of the ratio of the axes' lengths, and the cosine between them.
fn stretch(floor: &Matrix3<f64>) -> f64 {
    let (x, y) = (floor.column(0), floor.column(1));
    (x.norm() / y.norm()).ln().abs() + (x.dot(&y) / (x.norm() * y.norm())).abs()
}

/// How far a homography between two views is from one of the floor that both have a known attitude to: the sine of the angle
/// between the normal it gives the second view and the known one, and by how much it stretches the floor. `None` when it fits no
/// camera. `m` is K⁻¹ H K, `attitudes` level to camera rotations.
pub(crate) fn floor_misfit(m: &Matrix3<f64>, attitudes: [&Matrix3<f64>; 2]) -> Option<f64> {
    let [a, b] = attitudes;
    let floor = m * floor_of(a);
    let (rotation, _) = pose_from_floor(&floor)?;
    Some(rotation.column(2).cross(&b.column(2)).norm() + stretch(&floor))
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
pub(crate) fn rotations_from_links(
    first: Matrix3<f64>,
    count: usize,
    k_px: &Intrinsics,
    links: &[Link],
) -> Option<Vec<Matrix3<f64>>> {
    let (k, k_inverse) = (k_px.matrix(), k_px.inverse_matrix());
    let mut rotations = vec![None; count];
    *rotations.first_mut()? = Some(first);
    for TreeNode { node, by } in along_best(count, links).into_iter().skip(1) {
        // What no link leads to belongs to no turn of this camera.
        let (link, known) = by?;
        let turn = nearest_rotation(&(k_inverse * links[link].to_other_end(known).matrix() * k))?;
        rotations[node] = Some(turn * rotations[known]?);
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
