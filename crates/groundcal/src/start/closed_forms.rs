//! The closed forms in one call: homographies in, a camera with its covariance out. For comparisons of methods; the calibrations
//! proper call the solvers themselves, with lenses, priors and checks of the answer.

use nalgebra::{Matrix3, SMatrix};

use crate::{
    error::Error,
    geometry::{constraint::Constraint, frame::Frame, intrinsics::Intrinsics},
    numerics::linalg::{ComplexPoint, complex_pair_eigen},
    pairs::{circular_points::from_homography, refine::HomographyEstimate},
    result::camera::Method,
    select::attitude_groups::{HorizonSides, Motion},
    start::{
        absolute_conic::{WeightedPoint, intrinsics_of, solve_unweighted},
        linear_camera::{CameraOptions, solve_camera},
        rotating_camera::{RotatingOptions, Weighting, calibrate_rotating},
        unweighted_camera::solve_unweighted_with_covariance,
    },
};

/// A camera matrix and how sure it is.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct LinearCamera {
    /// In pixels.
    pub intrinsics: Intrinsics,
    /// Covariance of (fx, fy, cx, cy, skew) in pixels squared, to first order; zero rows for what was held.
    pub covariance_px: SMatrix<f64, 5, 5>,
}

/// The frame that the homographies share.
pub(crate) fn common_frame<'a>(
    mut homographies: impl Iterator<Item = &'a HomographyEstimate>,
) -> Result<&'a Frame, Error> {
    let Some(first) = homographies.next() else {
        return Err(Error::InvalidInput("no homographies are given".into()));
    };
    if homographies.any(|h| h.frame != first.frame) {
        return Err(Error::InvalidInput("the homographies are given in different frames".into()));
    }
    Ok(&first.frame)
}

/// The camera of plane-normal motions as the paper has it (KZR 1.1), from bare homographies in frame coordinates: every equation with
/// weight one, no motion left out however little it shows. `aspect` is fy / fx where the constraint holds it.
///
/// # Errors
/// [`Error::NotPositiveDefinite`] when no real camera solves the equations, or a homography has no circular point.
pub fn unweighted_camera(
    homographies: &[Matrix3<f64>],
    frame: &Frame,
    constraint: Constraint,
    aspect: f64,
) -> Result<Intrinsics, Error> {
    let point = |h: &Matrix3<f64>| complex_pair_eigen(h).map(|pair| pair.complex_right);
    let points: Option<Vec<ComplexPoint>> = homographies.iter().map(point).collect();
    let points = points.ok_or_else(|| Error::Numerical {
        stage: "circular points",
        detail: "a homography has no complex pair of eigenvectors".into(),
    })?;
    Ok(frame.intrinsics_to_pixel(&intrinsics_of(&solve_unweighted(&points, constraint, aspect)?)))
}

/// The motions of those homographies that show a turn above their noise, each of views of its own.
fn motions(homographies: &[HomographyEstimate]) -> Vec<Motion> {
    let motion = |(i, h): (usize, &HomographyEstimate)| {
        let geometry = from_homography(h).ok()?;
        Some(Motion { from: (2 * i).into(), to: (2 * i + 1).into(), geometry, sides: HorizonSides::One })
    };
    homographies.iter().enumerate().filter_map(motion).collect()
}

/// The camera of one of the methods that are solved in closed form, with the noise of the homographies carried through it: no lens, no
/// priors, axes exactly normal. Homographies that show no turn above their noise are left out of the first two.
///
/// | [`Method`] | equations |
/// |---|---|
/// | `Kzr` | eᵀ ω e = 0 of every motion with weight one, as the paper has it (KZR 1.1) |
/// | `Linear` | the same, each weighted by the noise of its homography |
/// | `Rotating` | Hᵀ ω H = ω of turns about the camera's own centre with weight one (Hartley 1994) |
///
/// # Errors
/// [`Error::InvalidOption`] for another method, and for [`Constraint::Auto`] with weights, which has priors; [`Error::InvalidInput`] for no
/// homographies, or of different frames; too few attitudes or rotations, no real camera, or one that nothing is known of.
pub fn closed_form(
    method: Method,
    homographies: &[HomographyEstimate],
    constraint: Constraint,
    aspect: f64,
) -> Result<LinearCamera, Error> {
    match method {
        Method::Kzr => with_weight_one(homographies, constraint, aspect),
        Method::Linear => weighted(homographies, constraint, aspect),
        Method::Rotating => {
            let options = RotatingOptions { constraint, aspect, weighting: Weighting::Uniform };
            let found = calibrate_rotating(homographies, &options)?;
            Ok(LinearCamera { intrinsics: found.intrinsics, covariance_px: found.covariance_px })
        }
        Method::Joint | Method::Transferred => Err(Error::InvalidOption(format!(
            "homographies alone are solved in closed form by the methods kzr, linear and rotating, not by {method:?}"
        ))),
    }
}

fn with_weight_one(
    homographies: &[HomographyEstimate],
    constraint: Constraint,
    aspect: f64,
) -> Result<LinearCamera, Error> {
    let frame = common_frame(homographies.iter())?;
    let weighted = |m: Motion| {
        let point = m.geometry.circular_point;
        WeightedPoint { covariance: point.covariance, point }
    };
    let points: Vec<WeightedPoint> = motions(homographies).into_iter().map(weighted).collect();
    let (p, covariance) = solve_unweighted_with_covariance(&points, constraint, aspect)?;
    let intrinsics = frame.intrinsics_to_pixel(&intrinsics_of(&p));
    let to_pixels = frame.pixels_by_logarithms(&intrinsics);
    Ok(LinearCamera { intrinsics, covariance_px: to_pixels * covariance * to_pixels.transpose() })
}

fn weighted(homographies: &[HomographyEstimate], constraint: Constraint, aspect: f64) -> Result<LinearCamera, Error> {
    if constraint == Constraint::Auto {
        return Err(Error::InvalidOption("a camera without priors needs another constraint than auto".into()));
    }
    let frame = common_frame(homographies.iter())?;
    let options = CameraOptions {
        constraint,
        aspect,
        aspect_sigma: f64::INFINITY,
        principal_point_sigma_px: f64::INFINITY,
        given: Vec::new(),
        attitude_sigma_rad: 0.0,
        estimate_attitude_sigma: false,
    };
    let found = solve_camera(&motions(homographies), frame, &options)?;
    Ok(LinearCamera { intrinsics: found.intrinsics, covariance_px: found.covariance_px })
}
