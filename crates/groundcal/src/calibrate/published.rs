//! The camera of plane-normal motions as the paper has it, for comparison ([`Method::Kzr`]): homographies, their eigenvectors e,
//! eᵀ ω e = 0 of all motions with weight one ([`crate::start::unweighted_camera`]), Cholesky. No lens, no weights, no polishing, no
//! patches, no priors.
//!
//! Two things are added beside the answer: its standard deviations, the points' noise and an axis off the normal carried through to first
//! order, and a refusal where these say that nothing is known.

use crate::{
    calibrate::{
        checks::unmodelled_distortion, options::Method, solved::Solved, soundness::check_field_of_view,
        stage_options::StageOptions,
    },
    error::Error,
    numerics::{linalg::ComplexPoint, statistics::chi_squared_survival},
    observer::Observer,
    pairs::{known_lens::KnownLens, observation::PairObservation, placed_lens::PlacedLens},
    select::{
        attitude_groups::{Motion, group_attitudes_until},
        selection::Selection,
    },
    start::{
        absolute_conic::{Priors, WeightedPoint, intrinsics_of, refine, solve_unweighted},
        from_pairs::motions_through,
        linear_camera::{CameraSolution, DISAGREEMENT_P, check_attitudes, check_certainty},
        unweighted_camera::solve_unweighted_with_covariance,
    },
};

/// The camera of the motions selected.
///
/// # Errors
/// [`Error::TooFewAttitudes`], [`Error::NotPositiveDefinite`], [`Error::Undetermined`]; [`Error::Stopped`].
pub(super) fn solve_published(
    pairs: &[PairObservation],
    selection: &Selection,
    lens: &KnownLens,
    stages: &StageOptions<'_>,
    observer: &dyn Observer,
) -> Result<Solved, Error> {
    let used = selection.used();
    let solution = camera(&selection.motions(pairs), stages, observer)?;
    check_field_of_view(&solution.intrinsics, stages.size)?;
    let through = |lens: &PlacedLens| {
        let motions = motions_through(lens, pairs, &used, &stages.frame, observer)?;
        Ok(camera(&motions, stages, observer)?.intrinsics)
    };
    let warnings = unmodelled_distortion(pairs, lens, &solution.intrinsics, through)?.into_iter().collect();
    Ok(Solved {
        method: Method::Kzr,
        constraint: stages.constraint_without_priors(),
        solution,
        joint: None,
        used,
        links: Vec::new(),
        selection: None,
        lens_share: 0.0,
        rotations_rad: None,
        amplification: None,
        warnings,
    })
}

fn camera(motions: &[Motion], stages: &StageOptions<'_>, observer: &dyn Observer) -> Result<CameraSolution, Error> {
    let (frame, constraint) = (&stages.frame, stages.constraint_without_priors());
    let (aspect, attitude_sigma_rad) = (stages.camera.aspect, stages.camera.attitude_sigma_rad);
    let bare: Vec<ComplexPoint> = motions.iter().map(|m| m.geometry.circular_point.point).collect();
    let k = intrinsics_of(&solve_unweighted(&bare, constraint, aspect)?);
    // What an axis off the normal does depends on the camera.
    let weighted = |m: &Motion| WeightedPoint {
        point: m.geometry.circular_point.clone(),
        covariance: m.geometry.circular_point.total_covariance(&k, attitude_sigma_rad),
    };
    let points: Vec<WeightedPoint> = motions.iter().map(weighted).collect();
    let (p, covariance) = solve_unweighted_with_covariance(&points, constraint, aspect)?;
    let groups = group_attitudes_until(motions, &k, attitude_sigma_rad, observer)?;
    check_attitudes(&groups, motions.len(), constraint)?;
    // Whether one camera can explain all motions is asked of the one that does so best.
    let best = refine(&points, &p, constraint.free(), &Priors::NONE);
    let (chi_squared, degrees_of_freedom) = best.map_or((0.0, 0), |s| (s.chi_squared, s.degrees_of_freedom));
    let disagree = degrees_of_freedom > 0 && chi_squared_survival(chi_squared, degrees_of_freedom) < DISAGREEMENT_P;
    let variance_inflation = if disagree { chi_squared / degrees_of_freedom as f64 } else { 1.0 };
    let covariance = covariance * variance_inflation;
    check_certainty(&covariance, constraint, groups.len(), frame)?;
    let intrinsics = frame.intrinsics_to_pixel(&k);
    let jacobian = frame.pixels_by_logarithms(&intrinsics);
    Ok(CameraSolution {
        intrinsics,
        covariance_px: jacobian * covariance * jacobian.transpose(),
        estimated: constraint.estimated(),
        priors: Vec::new(),
        groups,
        chi_squared,
        degrees_of_freedom,
        attitude_sigma_rad,
        attitude_sigma_estimated: false,
        variance_inflation,
    })
}
