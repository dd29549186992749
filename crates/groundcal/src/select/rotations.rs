//! Which pairs of views are rotations of a camera that turns on the spot, about any axes, before a scene of any shape (a
//! panorama, a pan-tilt head).
//!
//! ```text
//! M_i = K⁻¹ H_i K,  det M_i = 1:        f = argmin Σ_i min(‖M_i M_iᵀ - I‖, 0.2)²         a rotation: ‖M Mᵀ - I‖ < 0.1
//! ```
//!
//! Then every pair's homography H_i is K R K⁻¹, whatever the axis. That is told from a plane by a focal length f that makes M a rotation for
//! pairs of all images at once: 81 are tried, from 0.3 to 6 image widths.

use nalgebra::Matrix3;

use crate::{
    error::Error,
    geometry::{intrinsics::Intrinsics, size::ImageSize},
    ids::{ImageId, PairId},
    numerics::graph::{components, largest_component},
    pairs::observation::{PairObservation, images_of, why_no_motion},
    remedy::Remedy,
    select::{
        attitude_groups::HorizonSides,
        selection::{MotionKind, PairVerdict, Rejection, Selection},
    },
};

/// Options of [`find_turning`] and [`select_rotations`].
#[derive(Debug, Clone, Copy)]
pub(crate) struct RotationOptions {
    /// Size of the images.
    pub(crate) size: ImageSize,
    /// Assumed principal point, pixels.
    pub(crate) principal_point_px: [f64; 2],
    /// Expected fy / fx.
    pub(crate) aspect: f64,
    /// All pairs are known to be rotations.
    pub(crate) trusted: bool,
    /// Fewest matches on a plane, for the error's words.
    pub(crate) min_matches: usize,
}

/// Fewest images: two views of a turn are a plane-normal motion, whatever the axis.
const MIN_IMAGES: usize = 3;
/// Largest ‖M Mᵀ - I‖ of a pair's M = K⁻¹ H K that passes for a rotation before distortion and noise are known.
const MAX_ROTATION_RESIDUAL: f64 = 0.1;
/// Focal lengths tried, in image widths.
const FOCAL_RANGE: (f64, f64) = (0.3, 6.0);
const FOCAL_STEPS: usize = 80;

/// The pairs that one camera turning on the spot explains, if they join three images or more and most pairs are among them: a
/// floor seen from several places contradicts in most. To be confirmed by a refinement of directions, whose residuals must be
/// those of the matches.
pub(crate) fn find_turning(pairs: &[PairObservation], options: &RotationOptions) -> Option<Selection> {
    let (nearest, rotations) = nearest_to_rotations(pairs, options)?;
    if 2 * rotations.len() <= moving(pairs).count() {
        return None;
    }
    let joined = largest_connected(&rotations, pairs);
    (images_of(&joined, pairs).len() >= MIN_IMAGES).then(|| selection_of(&joined, &nearest, pairs))
}

/// Pairs taken for rotations: those named, or those that one focal length makes so. Chance hardly ever does that (five equations
/// a pair), so that three images joined by them are enough; else they must be most.
///
/// # Errors
/// Why there are none.
pub(crate) fn select_rotations(pairs: &[PairObservation], options: &RotationOptions) -> Result<Selection, Error> {
    let seen: Vec<PairId> = moving(pairs).map(|pair| pair.id).collect();
    if seen.is_empty() {
        return Err(why_no_motion(pairs, options.min_matches));
    }
    let (nearest, rotations) = nearest_to_rotations(pairs, options)
        .ok_or_else(|| Error::Numerical { stage: "rotations", detail: "no focal length was tried".into() })?;
    if options.trusted {
        return Ok(selection_of(&seen, &nearest, pairs));
    }
    if images_of(&rotations, pairs).len() < MIN_IMAGES && 2 * rotations.len() <= seen.len() {
        return Err(Error::NoUsableMotion {
            pairs: seen.len(),
            reason: format!(
                "{} of them can be a rotation about the optical centre under one focal length, more than half or \
                 three joined images are needed: the camera was moved between the images",
                rotations.len()
            ),
            remedies: vec![Remedy::UseJointMethod, Remedy::NamePairs],
        });
    }
    Ok(selection_of(&rotations, &nearest, pairs))
}

fn moving(pairs: &[PairObservation]) -> impl Iterator<Item = &PairObservation> {
    pairs.iter().filter(|pair| pair.moving_plane().is_some())
}

fn selection_of(used: &[PairId], nearest: &Intrinsics, pairs: &[PairObservation]) -> Selection {
    Selection::new(MotionKind::Turning { focal_px: nearest.fx }, pairs, |id| {
        if used.contains(&id) {
            PairVerdict::Used { sides: HorizonSides::Both }
        } else {
            match rotation_residual(&pairs[id], nearest) {
                // Of those that nothing joins with the others.
                Some(misfit) if misfit < MAX_ROTATION_RESIDUAL => PairVerdict::Rejected(Rejection::Unconnected),
                Some(misfit) => PairVerdict::Rejected(Rejection::NoRotation { misfit, most: MAX_ROTATION_RESIDUAL }),
                None => PairVerdict::NoMotion,
            }
        }
    })
}

/// The square-pixel camera that makes rotations of most pairs, and which pairs those are.
fn nearest_to_rotations(pairs: &[PairObservation], options: &RotationOptions) -> Option<(Intrinsics, Vec<PairId>)> {
    let (width, [cx, cy]) = (options.size.width as f64, options.principal_point_px);
    let camera = |i: usize| {
        let (low, high) = FOCAL_RANGE;
        let f = width * low * (high / low).powf(i as f64 / FOCAL_STEPS as f64);
        Intrinsics { fy: f * options.aspect, ..Intrinsics::square(f, cx, cy) }
    };
    // Truncated squares: a wrong pair costs no more than a bad one.
    let score = |k: &Intrinsics| -> f64 {
        let all = pairs.iter().filter_map(|pair| rotation_residual(pair, k));
        all.map(|d| d.min(2.0 * MAX_ROTATION_RESIDUAL).powi(2)).sum()
    };
    let best = (0..=FOCAL_STEPS).map(camera).min_by(|a, b| score(a).total_cmp(&score(b)))?;
    let fits = |pair: &&PairObservation| rotation_residual(pair, &best).is_some_and(|d| d < MAX_ROTATION_RESIDUAL);
    Some((best, pairs.iter().filter(fits).map(|pair| pair.id).collect()))
}

/// ‖M Mᵀ - I‖ for M = K⁻¹ H K of determinant 1: zero for a rotation.
fn rotation_residual(pair: &PairObservation, k: &Intrinsics) -> Option<f64> {
    let plane = pair.moving_plane()?;
    let m = k.inverse_matrix() * plane.estimate.h_b_from_a.matrix() * k.matrix();
    Some((m * m.transpose() - Matrix3::identity()).norm())
}

/// The pairs of the largest set of images that pairs connect.
fn largest_connected(some: &[PairId], pairs: &[PairObservation]) -> Vec<PairId> {
    let edges = || some.iter().map(|&id| pairs[id].images().map(ImageId::index)).map(|[a, b]| (a, b));
    let label = components(edges().map(|(a, b)| a.max(b) + 1).max().unwrap_or(0), edges());
    let largest = largest_component(&label);
    some.iter().copied().filter(|&id| Some(label[pairs[id].from.index()]) == largest).collect()
}
