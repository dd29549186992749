//! Motions of one attitude repeat the same two equations, so they are joined before anything is counted or solved.
//!
//! ```text
//! d² = (x_a - x_b)ᵀ (C_a + C_b)⁻¹ (x_a - x_b)             one attitude: below 18.5 (99.9 % of chi-squared, four degrees of freedom)
//! x = C Σ C_i⁻¹ x_i,   C = (Σ C_i⁻¹)⁻¹ · m / (V - 1) · χ² / (4 (m - 1))
//! ```
//!
//! x: tangent coordinates of a circular point (its conjugate is the same point), C their covariance. m motions among V images repeat the noise of
//! V - 1 of them: the factor is 1 where they are no more. χ², the sum of squared distances of the members from the mean, each by its own
//! covariance, widens where chance exceeds it with less than one in a hundred.
//!
//! Circular points that agree within their covariances become one, their weighted mean.
//! Without this, twenty noisy copies of one attitude look like twenty slightly different attitudes, and the noise between
//! them passes for information on the principal point.

use std::collections::BTreeMap;

use nalgebra::{Complex, Matrix4, Vector4};

use crate::{
    error::Error,
    geometry::intrinsics::Intrinsics,
    ids::ImageId,
    numerics::{
        graph::components,
        statistics::{CHI_SQUARED_4_999, chi_squared_survival},
    },
    observer::Observer,
    pairs::circular_points::{CircularPoint, MotionGeometry},
    start::absolute_conic::WeightedPoint,
};

/// A pair of views with what its homography says.
#[derive(Debug, Clone)]
pub(crate) struct Motion {
    /// The first image.
    pub from: ImageId,
    /// The second image.
    pub to: ImageId,
    /// Circular point, angle, ρ.
    pub geometry: MotionGeometry,
    /// Where the matched points lie.
    pub sides: HorizonSides,
}

/// Where the points of a motion lie with respect to the horizon that the motion implies.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum HorizonSides {
    /// On one side: they can lie on a floor.
    One,
    /// On both: no floor is seen from above and below; they can only be far away, the camera turning on the spot.
    Both,
}

/// Motions of one attitude.
#[derive(Debug, Clone)]
pub(crate) struct AttitudeGroup {
    /// Indices of the motions.
    pub members: Vec<usize>,
    /// Their common circular point.
    pub(crate) fused: WeightedPoint,
}

/// Squared distance beyond which two attitudes are different: 99.9 % of chi-squared with four degrees of freedom.
pub(crate) const DIFFERENT_ATTITUDE: f64 = CHI_SQUARED_4_999;

/// A circular point in the tangent coordinates of another.
struct Transferred {
    coordinates: Vector4<f64>,
    covariance: Matrix4<f64>,
    by_k1: Option<Vector4<f64>>,
}

/// The point `other` (or its conjugate, whichever is nearer) in the tangent coordinates of `base`, with its covariance
/// there; exact for points that agree, first order near them.
fn in_tangent_of(base: &CircularPoint, other: &WeightedPoint) -> Option<Transferred> {
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
    Some(Transferred {
        coordinates: vector,
        covariance: map * covariance * map.transpose(),
        by_k1: point.by_k1.map(|shift| map * shift),
    })
}

/// Squared Mahalanobis distance between two circular points (four degrees of freedom); infinite for points far apart. A
/// radial distortion of deviation `k1_sigma` moves both: only the difference of what it does to them counts.
pub(crate) fn attitude_distance(a: &WeightedPoint, b: &WeightedPoint, k1_sigma: f64) -> f64 {
    let Some(Transferred { coordinates: difference, covariance, by_k1 }) = in_tangent_of(&a.point, b) else {
        return f64::INFINITY;
    };
    let mut total = a.covariance + covariance;
    if let (Some(p), Some(q)) = (a.point.by_k1, by_k1) {
        total += (q - p) * (q - p).transpose() * (k1_sigma * k1_sigma);
    }
    let floor = Matrix4::from_diagonal_element(1e-20 + 1e-12 * total.trace());
    (total + floor).try_inverse().map_or(f64::INFINITY, |i| (difference.transpose() * i * difference)[(0, 0)])
}

/// The groups again with another axis error; who belongs together stays.
pub(crate) fn regroup(
    groups: &[AttitudeGroup],
    motions: &[Motion],
    k: &Intrinsics,
    attitude_sigma_rad: f64,
) -> Vec<AttitudeGroup> {
    let weighted = weighted_points(motions, k, attitude_sigma_rad);
    groups.iter().map(|g| join(g.members.clone(), &weighted, motions)).collect()
}

fn weighted_points(motions: &[Motion], k: &Intrinsics, attitude_sigma_rad: f64) -> Vec<WeightedPoint> {
    let weighted = |m: &Motion| WeightedPoint {
        point: m.geometry.circular_point.clone(),
        covariance: m.geometry.circular_point.total_covariance(k, attitude_sigma_rad),
    };
    motions.iter().map(weighted).collect()
}

/// Motions of one attitude, whether or not they share an image: the nearest two groups are joined as long as their fused circular points are nearer than
/// [`DIFFERENT_ATTITUDE`].
///
/// # Errors
/// [`Error::Stopped`] and no other.
pub(crate) fn group_attitudes_until(
    motions: &[Motion],
    k: &Intrinsics,
    attitude_sigma_rad: f64,
    observer: &dyn Observer,
) -> Result<Vec<AttitudeGroup>, Error> {
    let weighted = weighted_points(motions, k, attitude_sigma_rad);
    let mut groups: Vec<AttitudeGroup> =
        connected_by_images(motions).into_iter().map(|members| join(members, &weighted, motions)).collect();
    // From the best known to the worst, so that a group of large covariance joins another instead of founding one.
    groups.sort_by(|a, b| {
        (a.fused.covariance.trace().total_cmp(&b.fused.covariance.trace())).then(a.members[0].cmp(&b.members[0]))
    });
    let mut apart: Vec<AttitudeGroup> = Vec::new();
    for group in groups {
        observer.go_on()?;
        let nearest = apart
            .iter_mut()
            .map(|g| (attitude_distance(&g.fused, &group.fused, 0.0), g))
            .min_by(|a, b| a.0.total_cmp(&b.0))
            .filter(|(distance, _)| *distance < DIFFERENT_ATTITUDE);
        match nearest {
            Some((_, known)) => {
                known.members.extend(group.members);
                if let Some(fused) = fuse(&known.fused, &group.fused) {
                    known.fused = fused;
                }
            }
            None => apart.push(group),
        }
    }
    for group in &mut apart {
        group.members.sort_unstable();
    }
    apart.sort_by_key(|g| g.members[0]);
    Ok(apart)
}

/// Sets of motions joined by common images, in the order of their last members.
fn connected_by_images(motions: &[Motion]) -> Vec<Vec<usize>> {
    let images = motions.iter().map(|m| m.from.max(m.to).index() + 1).max().unwrap_or(0);
    let label = components(images, motions.iter().map(|m| (m.from.index(), m.to.index())));
    let mut sets: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
    for (i, m) in motions.iter().enumerate() {
        sets.entry(label[m.from.index()]).or_default().push(i);
    }
    let mut sets: Vec<Vec<usize>> = sets.into_values().collect();
    sets.sort_by_key(|members| members.last().copied());
    sets
}

/// One circular point for motions of one attitude. All pairs among V images repeat the noise of V - 1 independent ones,
/// and members that disagree by more than their noise widen the result by what they disagree.
fn join(members: Vec<usize>, weighted: &[WeightedPoint], motions: &[Motion]) -> AttitudeGroup {
    let best = members
        .iter()
        .copied()
        .min_by(|&i, &j| weighted[i].covariance.trace().total_cmp(&weighted[j].covariance.trace()).then(i.cmp(&j)));
    let mut fused = weighted[best.unwrap_or(members[0])].clone();
    for &m in members.iter().filter(|m| Some(**m) != best) {
        if let Some(next) = fuse(&fused, &weighted[m]) {
            fused = next;
        }
    }
    let images: std::collections::BTreeSet<ImageId> =
        members.iter().flat_map(|&m| [motions[m].from, motions[m].to]).collect();
    let repeated = (members.len() as f64 / (images.len() - 1) as f64).max(1.0);
    let mut disagreement = 1.0;
    if members.len() > 1 {
        let dof = 4 * (members.len() - 1);
        let chi_squared: f64 = members.iter().map(|&m| squared_difference(&fused, &weighted[m])).sum();
        if chi_squared_survival(chi_squared, dof) < 0.01 {
            disagreement = chi_squared / dof as f64;
        }
    }
    fused.covariance *= repeated * disagreement;
    AttitudeGroup { members, fused }
}

/// Squared distance of a member from the mean, in units of the member's own covariance.
fn squared_difference(mean: &WeightedPoint, member: &WeightedPoint) -> f64 {
    let Some(Transferred { coordinates: difference, covariance, .. }) = in_tangent_of(&mean.point, member) else {
        return f64::INFINITY;
    };
    let floor = Matrix4::from_diagonal_element(1e-20 + 1e-12 * covariance.trace());
    (covariance + floor).try_inverse().map_or(f64::INFINITY, |i| (difference.transpose() * i * difference)[(0, 0)])
}

/// The weighted mean of two circular points.
fn fuse(base: &WeightedPoint, other: &WeightedPoint) -> Option<WeightedPoint> {
    let Transferred { coordinates: difference, covariance, .. } = in_tangent_of(&base.point, other)?;
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
        point: CircularPoint { point, tangent: [u, v], covariance: symmetric, sensitivity: None, by_k1: None },
        covariance: symmetric,
    })
}
