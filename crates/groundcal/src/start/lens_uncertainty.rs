//! What an uncertain lens adds to the error bars of a camera made from homographies, which do not carry it.

use nalgebra::{Matrix4, SMatrix, SVector};

use crate::{
    error::Error,
    geometry::{constraint::Constraint, intrinsics::Intrinsics},
    pairs::{known_lens::LensFinding, plane_lens::Lens},
    remedy::Remedy,
};

/// A whole deviation may leave the range of the lens model: a step of a tenth, scaled.
const PART: f64 = 0.1;

/// What the uncertainty of the lens adds to the covariance of (fx, fy, cx, cy, skew), pixels squared: the camera again
/// with the lens moved along each column of the covariance's root. `solve` gives the camera of matches undone by a lens.
///
/// # Errors
/// [`Error::Undetermined`] when there is no camera for one of these lenses; [`Error::Stopped`].
pub(crate) fn covariance_of_lens(
    finding: &LensFinding,
    constraint: Constraint,
    solve: impl Fn(&Lens) -> Result<Intrinsics, Error>,
) -> Result<SMatrix<f64, 5, 5>, Error> {
    let failed = || Error::Undetermined {
        constraint: constraint.name(),
        direction: "the lens distortion is known so badly that for a lens within its error bars there is no camera"
            .into(),
        remedies: vec![Remedy::GiveLensCoefficients, Remedy::StateNoDistortion, Remedy::CoverCorners],
    };
    let reference = finding.reference();
    let numbers = |lens: &Lens| match solve(lens) {
        Ok(k) => Ok(SVector::<f64, 5>::from([k.fx, k.fy, k.cx, k.cy, k.skew])),
        Err(Error::Stopped) => Err(Error::Stopped),
        Err(_) => Err(failed()),
    };
    let here = numbers(&reference)?;
    let symmetric = (finding.estimate.covariance + finding.estimate.covariance.transpose()) * 0.5;
    let root: Matrix4<f64> = symmetric.cholesky().ok_or_else(failed)?.l();
    let mut total = SMatrix::<f64, 5, 5>::zeros();
    for column in root.column_iter() {
        let difference = (numbers(&reference.moved(&(column * PART)))? - here) / PART;
        total += difference * difference.transpose();
    }
    Ok(total)
}
