//! What an uncertain lens adds to the error bars of a camera made from homographies, which do not carry it.

use nalgebra::{DMatrix, SMatrix, SVector};

use crate::{
    error::Error,
    geometry::intrinsics::Intrinsics,
    pairs::{known_lens::KnownLens, lens_placement, placed_lens::PlacedLens, plane_lens},
    remedy::Remedy,
};

/// A whole deviation may leave the range of the lens model: a step of a tenth, scaled.
const STEP_SIGMAS: f64 = 0.1;

/// What the uncertainty of the lens, estimated or placed, adds to the covariance of (fx, fy, cx, cy, skew), pixels squared. `None`: it has
/// none. `solve` gives the camera of matches undone by a lens.
///
/// # Errors
/// [`Error::Unsound`] when there is no camera for one of these lenses; [`Error::Stopped`].
pub(crate) fn covariance_of_lens(
    known: &KnownLens,
    solve: impl Fn(&PlacedLens) -> Result<Intrinsics, Error>,
) -> Result<Option<SMatrix<f64, 5, 5>>, Error> {
    match known {
        KnownLens::NotModelled | KnownLens::Given(_) | KnownLens::OfPairs(_) => Ok(None),
        KnownLens::Estimated(finding) => {
            added(&finding.reference(), &finding.estimate.covariance, plane_lens::moved, solve).map(Some)
        }
        KnownLens::Placed(p) => match &p.covariance {
            Some(covariance) => added(&p.lens, covariance, lens_placement::moved, solve).map(Some),
            None => Ok(None),
        },
    }
}

/// The camera again with the lens moved along each column of the covariance's root.
fn added<const N: usize>(
    reference: &PlacedLens,
    covariance: &SMatrix<f64, N, N>,
    moved: impl Fn(&PlacedLens, &SVector<f64, N>) -> PlacedLens,
    solve: impl Fn(&PlacedLens) -> Result<Intrinsics, Error>,
) -> Result<SMatrix<f64, 5, 5>, Error> {
    let failed = || Error::Unsound {
        reason: "the lens distortion is known so badly that lenses within its error bar leave no camera at all".into(),
        remedies: vec![Remedy::GiveLensCoefficients, Remedy::StateNoDistortion, Remedy::MoreMotions],
    };
    let numbers = |lens: &PlacedLens| match solve(lens) {
        Ok(k) => Ok(SVector::<f64, 5>::from([k.fx, k.fy, k.cx, k.cy, k.skew])),
        Err(Error::Stopped) => Err(Error::Stopped),
        Err(_) => Err(failed()),
    };
    let here = numbers(reference)?;
    let symmetric = (covariance + covariance.transpose()) * 0.5;
    let n = DMatrix::from_fn(N, N, |r, c| symmetric[(r, c)]);
    let root = n.cholesky().ok_or_else(failed)?.l();
    let mut total = SMatrix::<f64, 5, 5>::zeros();
    for column in root.column_iter() {
        let step = SVector::<f64, N>::from_fn(|r, _| column[r] * STEP_SIGMAS);
        let difference = (numbers(&moved(reference, &step))? - here) / STEP_SIGMAS;
        total += difference * difference.transpose();
    }
    Ok(total)
}
