//! Motions of one attitude repeat the same two equations, so they are joined before anything is counted or solved.
//!
//! Circular points that agree within their covariances (four degrees of freedom) become one, their weighted mean.
//! Without this, twenty noisy copies of one attitude look like twenty slightly different attitudes, and the noise between
//! them passes for information on the principal point.

use nalgebra::{Complex, Matrix4, Vector4};

use crate::{
    absolute_conic::WeightedPoint,
    circular_points::{CircularPoint, MotionGeometry},
    intrinsics::Intrinsics,
};

/// A pair of views with what its homography says.
#[derive(Debug, Clone)]
pub struct Motion {
    /// Index of the first view.
    pub from: usize,
    /// Index of the second view.
    pub to: usize,
    /// Circular point, angle, ρ.
    pub geometry: MotionGeometry,
}

/// Motions of one attitude.
#[derive(Debug, Clone)]
pub struct AttitudeGroup {
    /// Indices of the motions.
    pub members: Vec<usize>,
    /// Their common circular point.
    pub fused: WeightedPoint,
}

/// Squared distance beyond which two attitudes are different: 99.9 % of chi-squared with four degrees of freedom.
pub const DIFFERENT_ATTITUDE: f64 = 18.467;

/// The point `other` (or its conjugate, whichever is nearer) in the tangent coordinates of `base`, with its covariance
/// there; exact for points that agree, first order near them.
fn in_tangent_of(base: &CircularPoint, other: &WeightedPoint) -> Option<(Vector4<f64>, Matrix4<f64>)> {
    let conjugate = other.point.conjugate();
    let conjugate_covariance = {
        let flip = Matrix4::from_diagonal(&Vector4::new(1.0, -1.0, 1.0, -1.0));
        flip * other.covariance * flip
    };
    let direct = base.point.dotc(&other.point.point).norm();
    let turned = base.point.dotc(&conjugate.point).norm();
    let (point, covariance) =
        if direct >= turned { (&other.point, other.covariance) } else { (&conjugate, conjugate_covariance) };
    let along = base.point.dotc(&point.point);
    if along.norm() < 0.1 {
        return None;
    }
    let coordinates = base.tangent.map(|t| t.dotc(&point.point) / along);
    // Complex 2x2 map between the tangent spaces, as a real 4x4.
    let mut map = Matrix4::zeros();
    for (r, t) in base.tangent.iter().enumerate() {
        for (c, u) in point.tangent.iter().enumerate() {
            let z: Complex<f64> = t.dotc(u) / along;
            map[(2 * r, 2 * c)] = z.re;
            map[(2 * r, 2 * c + 1)] = -z.im;
            map[(2 * r + 1, 2 * c)] = z.im;
            map[(2 * r + 1, 2 * c + 1)] = z.re;
        }
    }
    let vector = Vector4::new(coordinates[0].re, coordinates[0].im, coordinates[1].re, coordinates[1].im);
    Some((vector, map * covariance * map.transpose()))
}

/// Squared Mahalanobis distance between two circular points (four degrees of freedom); infinite for points far apart.
pub fn attitude_distance(a: &WeightedPoint, b: &WeightedPoint) -> f64 {
    let Some((difference, covariance)) = in_tangent_of(&a.point, b) else { return f64::INFINITY };
    let total = a.covariance + covariance;
    let floor = Matrix4::from_diagonal_element(1e-20 + 1e-12 * total.trace());
    (total + floor).try_inverse().map_or(f64::INFINITY, |i| (difference.transpose() * i * difference)[(0, 0)])
}

/// Joins motions that share an attitude, with axis errors of `attitude_sigma_rad` as seen by the camera `k` (frame units).
pub fn group_attitudes(motions: &[Motion], k: &Intrinsics, attitude_sigma_rad: f64) -> Vec<AttitudeGroup> {
    let weighted: Vec<WeightedPoint> = motions
        .iter()
        .map(|m| WeightedPoint {
            point: m.geometry.circular_point.clone(),
            covariance: m.geometry.circular_point.total_covariance(k, attitude_sigma_rad),
        })
        .collect();
    // From the best known to the worst, so that a vague motion joins a group instead of founding one.
    let mut order: Vec<usize> = (0..motions.len()).collect();
    order.sort_by(|&i, &j| weighted[i].covariance.trace().total_cmp(&weighted[j].covariance.trace()).then(i.cmp(&j)));
    let mut groups: Vec<AttitudeGroup> = Vec::new();
    for i in order {
        let nearest = groups
            .iter_mut()
            .map(|g| (attitude_distance(&g.fused, &weighted[i]), g))
            .min_by(|a, b| a.0.total_cmp(&b.0))
            .filter(|(distance, _)| *distance < DIFFERENT_ATTITUDE);
        match nearest {
            Some((_, group)) => {
                group.members.push(i);
                if let Some(fused) = fuse(&group.fused, &weighted[i]) {
                    group.fused = fused;
                }
            }
            None => groups.push(AttitudeGroup { members: vec![i], fused: weighted[i].clone() }),
        }
    }
    for group in &mut groups {
        group.members.sort_unstable();
        group.fused.covariance *= redundancy(&group.members, motions);
    }
    groups.sort_by_key(|g| g.members[0]);
    groups
}

/// How many times the motions of a group are counted: V views joined by motions hold V - (connected sets) independent
/// ones; all pairs among them repeat the same image noise.
fn redundancy(members: &[usize], motions: &[Motion]) -> f64 {
    let mut root: std::collections::BTreeMap<usize, usize> = std::collections::BTreeMap::new();
    fn find(root: &mut std::collections::BTreeMap<usize, usize>, v: usize) -> usize {
        let parent = *root.entry(v).or_insert(v);
        if parent == v {
            return v;
        }
        let top = find(root, parent);
        root.insert(v, top);
        top
    }
    let mut independent = 0;
    for &m in members {
        let (a, b) = (find(&mut root, motions[m].from), find(&mut root, motions[m].to));
        if a != b {
            root.insert(a, b);
            independent += 1;
        }
    }
    (members.len() as f64 / independent.max(1) as f64).max(1.0)
}

/// The weighted mean of two circular points.
fn fuse(base: &WeightedPoint, other: &WeightedPoint) -> Option<WeightedPoint> {
    let (difference, covariance) = in_tangent_of(&base.point, other)?;
    let floor = Matrix4::from_diagonal_element(1e-30);
    let (base_information, information) =
        ((base.covariance + floor).try_inverse()?, (covariance + floor).try_inverse()?);
    let fused = (base_information + information).try_inverse()?;
    let moved = base.point.moved(&(fused * information * difference));
    let point = moved.unscale(moved.norm());
    // The tangent directions follow the point (Gram-Schmidt).
    let u = base.point.tangent[0] - point * point.dotc(&base.point.tangent[0]);
    let u = u.unscale(u.norm());
    let v = base.point.tangent[1] - point * point.dotc(&base.point.tangent[1]);
    let v = v - u * u.dotc(&v);
    let v = v.unscale(v.norm());
    let symmetric = (fused + fused.transpose()) * 0.5;
    Some(WeightedPoint {
        point: CircularPoint { point, tangent: [u, v], covariance: symmetric, sensitivity: None },
        covariance: symmetric,
    })
}
