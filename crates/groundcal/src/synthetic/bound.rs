//! The Cramér-Rao bound: the least covariance any unbiased estimator of the camera matrix can have.
//!
//! Fisher information of all unknowns (camera, attitude, turn and position of each motion, floor points) for Gaussian
//! noise in both images; points, then motions are eliminated by Schur complements.

use nalgebra::{DMatrix, SMatrix, Vector2};

use crate::{
    geometry::{
        intrinsics::Intrinsics,
        plane_view::{View, project_with_jacobian},
    },
    numerics::linalg::inverse_spd,
    start::absolute_conic::Constraint,
    synthetic::{
        plane_views::{PlaneViewScene, PlaneViews},
        points::PointScene,
    },
};

/// Whether the height may change between the views of a motion.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum HeightModel {
    /// Known to be constant: planar motion.
    Constant,
    /// Unknown: screw motion (ρ free).
    Free,
}

/// Columns of one match's Jacobian: camera (5), attitude (2), turn (1), second centre (x, y, height), point (2).
const COLUMNS: usize = 13;

/// Jacobian of the four coordinates of a match; `None` behind a camera.
fn match_jacobian(k: &Intrinsics, views: &[View; 2], point: &Vector2<f64>) -> Option<SMatrix<f64, 4, COLUMNS>> {
    let (_, a) = project_with_jacobian(k, &views[0], point)?;
    let (_, b) = project_with_jacobian(k, &views[1], point)?;
    let mut j = SMatrix::<f64, 4, COLUMNS>::zeros();
    // The first view is the origin of the floor's frame: its yaw and centre are held.
    j.fixed_view_mut::<2, 7>(0, 0).copy_from(&a.fixed_columns::<7>(0));
    j.fixed_view_mut::<2, 2>(0, 11).copy_from(&a.fixed_columns::<2>(11));
    j.fixed_view_mut::<2, COLUMNS>(2, 0).copy_from(&b);
    Some(j)
}

impl PointScene {
    /// The bound on the covariance of (fx, fy, cx, cy, skew) in pixels squared, zero rows for what the constraint holds; `None` when the
    /// motions do not determine them.
    pub fn bound(&self, constraint: Constraint, height: HeightModel) -> Option<SMatrix<f64, 5, 5>> {
        let pairs = self.pairs_with_truth();
        let motions: Vec<_> =
            self.motions.iter().zip(&pairs).map(|(m, p)| (m.views(), p.floor_points.as_slice())).collect();
        cramer_rao_bound(&self.intrinsics, &motions, self.sigma_px, constraint, height)
    }
}

impl PlaneViewScene {
    /// The same of views that moved in any way before a plane.
    pub fn bound(&self, constraint: Constraint) -> Option<SMatrix<f64, 5, 5>> {
        let PlaneViews { views, points, seen, .. } = self.views_with_truth();
        plane_views_bound(&self.intrinsics, &views, (&points, &seen), self.sigma_px, constraint)
    }
}

/// The bound on the covariance of (fx, fy, cx, cy, skew) in pixels squared, zero rows for what the constraint holds;
/// `None` when the motions do not determine them. `motions` are pairs of views with the floor points both see.
pub(crate) fn cramer_rao_bound(
    k: &Intrinsics,
    motions: &[([View; 2], &[Vector2<f64>])],
    sigma_px: f64,
    constraint: Constraint,
    height: HeightModel,
) -> Option<SMatrix<f64, 5, 5>> {
    // Columns: the free parameters; square pixels tie fy to fx.
    let free = constraint.free();
    let tied = free[0] && !free[1];
    let kept: Vec<usize> =
        [free[0], free[1], free[2], free[3], free[4]].iter().enumerate().filter_map(|(i, f)| f.then_some(i)).collect();
    let motion_columns: &[usize] = if height == HeightModel::Free { &[5, 6, 7, 8, 9, 10] } else { &[5, 6, 7, 8, 9] };
    let n = kept.len();
    let mut camera = DMatrix::<f64>::zeros(n, n);
    for (views, points) in motions {
        let size = n + motion_columns.len();
        let mut reduced = DMatrix::<f64>::zeros(size, size);
        for point in *points {
            let full = match_jacobian(k, views, point)?;
            let mut j = DMatrix::<f64>::zeros(4, size);
            for (c, &i) in kept.iter().chain(motion_columns).enumerate() {
                j.set_column(c, &full.column(i));
            }
            if tied {
                let column = full.column(0) + full.column(1) * (k.fy / k.fx);
                j.set_column(0, &column);
            }
            let p = full.fixed_columns::<2>(11).into_owned();
            let p_information = p.transpose() * p;
            let cross = j.transpose() * p;
            reduced += j.transpose() * &j - &cross * p_information.try_inverse()? * cross.transpose();
        }
        let m = motion_columns.len();
        let motion_block = reduced.view((n, n), (m, m)).into_owned();
        let cross = reduced.view((0, n), (n, m)).into_owned();
        camera += reduced.view((0, 0), (n, n)) - &cross * inverse_spd(&motion_block)? * cross.transpose();
    }
    let inverse = inverse_spd(&camera)? * (sigma_px * sigma_px);
    let mut bound = SMatrix::<f64, 5, 5>::zeros();
    // Rows of the free parameters; fy follows fx where tied.
    let mut spread = DMatrix::<f64>::zeros(5, n);
    for (c, &i) in kept.iter().enumerate() {
        spread[(i, c)] = 1.0;
    }
    if tied {
        spread[(1, 0)] = k.fy / k.fx;
    }
    let full = &spread * inverse * spread.transpose();
    for r in 0..5 {
        for c in 0..5 {
            bound[(r, c)] = full[(r, c)];
        }
    }
    Some(bound)
}

/// Columns of a view of a plane: attitude (2), turn (1), centre (3).
const VIEW: usize = 6;

/// The bound on the covariance of (fx, fy, cx, cy, skew) in pixels squared from views that moved in any way before a plane, zero rows for what the
/// constraint holds; `None` when they do not determine it. `seen`: which of the points each view sees. The world is held by the turn and centre of
/// the first view.
fn plane_views_bound(
    k: &Intrinsics,
    views: &[View],
    (points, seen): (&[Vector2<f64>], &[Vec<bool>]),
    sigma_px: f64,
    constraint: Constraint,
) -> Option<SMatrix<f64, 5, 5>> {
    let kept: Vec<usize> = (0..5).filter(|&i| constraint.free()[i]).collect();
    let n = kept.len();
    let size = n + VIEW * views.len();
    let mut information = DMatrix::<f64>::zeros(size, size);
    for (p, point) in points.iter().enumerate() {
        let of_view = |(v, view): (usize, &View)| {
            seen[v][p].then(|| project_with_jacobian(k, view, point)).flatten().map(|(_, j)| (v, j))
        };
        let jacobians: Vec<_> = views.iter().enumerate().filter_map(of_view).collect();
        let mut rows = DMatrix::<f64>::zeros(2 * jacobians.len(), size);
        let mut by_point = DMatrix::<f64>::zeros(2 * jacobians.len(), 2);
        for (i, (v, j)) in jacobians.iter().enumerate() {
            for (column, &number) in kept.iter().enumerate() {
                rows.view_mut((2 * i, column), (2, 1)).copy_from(&j.column(number));
            }
            rows.view_mut((2 * i, n + VIEW * v), (2, VIEW)).copy_from(&j.fixed_columns::<VIEW>(5));
            by_point.view_mut((2 * i, 0), (2, 2)).copy_from(&j.fixed_columns::<2>(11));
        }
        let of_point = by_point.transpose() * &by_point;
        let cross = rows.transpose() * &by_point;
        information += rows.transpose() * &rows - &cross * inverse_spd(&of_point)? * cross.transpose();
    }
    // Turn and centre of the first view.
    let held = n + 2..n + VIEW;
    let free: Vec<usize> = (0..size).filter(|i| !held.contains(i)).collect();
    let reduced = DMatrix::from_fn(free.len(), free.len(), |r, c| information[(free[r], free[c])]);
    let inverse = inverse_spd(&reduced)? * (sigma_px * sigma_px);
    let mut bound = SMatrix::<f64, 5, 5>::zeros();
    for (r, &i) in kept.iter().enumerate() {
        for (c, &j) in kept.iter().enumerate() {
            bound[(i, j)] = inverse[(r, c)];
        }
    }
    Some(bound)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::plane_view::project;
    use nalgebra::Vector3;

    /// The same information from a dense Jacobian by central differences, nothing eliminated by hand.
    #[test]
    fn the_bound_agrees_with_finite_differences() {
        let scene = PointScene { matches: 12, sigma_px: 0.0, ..PointScene::nominal(4) };
        let pairs = scene.pairs_with_truth();
        let motions: Vec<([View; 2], &[Vector2<f64>])> =
            scene.motions.iter().zip(&pairs).map(|(m, p)| (m.views(), p.floor_points.as_slice())).collect();
        for height in [HeightModel::Constant, HeightModel::Free] {
            let analytic =
                cramer_rao_bound(&scene.intrinsics, &motions, 1.0, Constraint::ZeroSkew, height).expect("determined");
            // Unknowns: fx, fy, cx, cy; per motion pitch, roll, turn, x, y (, height), points.
            let per_motion = if height == HeightModel::Free { 6 } else { 5 };
            let mut start = vec![scene.intrinsics.fx, scene.intrinsics.fy, scene.intrinsics.cx, scene.intrinsics.cy];
            for (views, points) in &motions {
                let b = &views[1];
                start.extend([b.pitch_down_rad, b.roll_rad, b.yaw_rad, b.centre.x, b.centre.y]);
                if per_motion == 6 {
                    start.push(b.centre.z);
                }
                start.extend(points.iter().flat_map(|p| [p.x, p.y]));
            }
            let predict = |x: &[f64]| -> Vec<f64> {
                let k = Intrinsics { fx: x[0], fy: x[1], cx: x[2], cy: x[3], skew: 0.0 };
                let mut at = 4;
                let mut out = Vec::new();
                for (views, points) in &motions {
                    let [mut a, mut b] = *views;
                    (a.pitch_down_rad, a.roll_rad) = (x[at], x[at + 1]);
                    (b.pitch_down_rad, b.roll_rad, b.yaw_rad) = (x[at], x[at + 1], x[at + 2]);
                    let z = if per_motion == 6 { x[at + 5] } else { b.centre.z };
                    b.centre = Vector3::new(x[at + 3], x[at + 4], z);
                    at += per_motion;
                    for _ in *points {
                        let p = Vector2::new(x[at], x[at + 1]);
                        at += 2;
                        for view in [&a, &b] {
                            let q = project(&k, view, &p).expect("in front");
                            out.extend([q.x, q.y]);
                        }
                    }
                }
                out
            };
            let n = start.len();
            let rows = predict(&start).len();
            let mut jacobian = DMatrix::<f64>::zeros(rows, n);
            for i in 0..n {
                let h = 1e-5 * start[i].abs().max(0.1);
                let (mut up, mut down) = (start.clone(), start.clone());
                up[i] += h;
                down[i] -= h;
                for (r, (u, d)) in predict(&up).iter().zip(predict(&down)).enumerate() {
                    jacobian[(r, i)] = (u - d) / (2.0 * h);
                }
            }
            let dense = inverse_spd(&(jacobian.transpose() * &jacobian)).expect("determined");
            for i in 0..4 {
                let ratio = analytic[(i, i)] / dense[(i, i)];
                assert!((ratio - 1.0).abs() < 1e-4, "{height:?} {i}: {ratio}");
            }
        }
    }
}
