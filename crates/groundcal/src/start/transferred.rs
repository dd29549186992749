//! One motion transferred: the circular points of a single plane-normal motion carried into other views by ordinary homographies
//! of the same plane (KZR 2.3, "at one extreme").
//!
//! ```text
//! e₀ the circular point of H₀ = K (R + t nᵀ/d) K⁻¹ in view 0,     e_i = H_i e₀ in view i,     e_iᵀ ω e_i = 0 for all i
//! ```
//!
//! The other views need not be turned about the plane's normal: they only have to see the plane, at attitudes of their own. One good
//! turn is enough, and with an exact axis it does as well as a turn at each attitude or better. An axis off the normal, though, is believed
//! in every view, where motions of their own are hardly harmed (the study `transfer`). The joint refinement uses both.

use nalgebra::{Complex, DMatrix, Matrix3, SMatrix, SVector, Vector4};

use crate::{
    error::Error,
    geometry::{constraint::Constraint, frame::Frame},
    numerics::linalg::{ComplexPoint, symmetric_eigen},
    pairs::{
        circular_points::{MAX_DIRECTION_SIGMA, MIN_SIGNIFICANCE, NoCircularPoint, from_homography},
        refine::HomographyEstimate,
    },
    remedy::Remedy,
    start::{
        absolute_conic::{Parameters, WeightedPoint, intrinsics_of, solve_unweighted},
        closed_forms::{LinearCamera, common_frame},
        linear_camera::what_is_uncertain,
        unweighted_camera::STEP_SIGMAS,
    },
};

/// A camera from one motion and views it was transferred to.
#[derive(Debug, Clone)]
pub(crate) struct Transferred {
    /// The noise of the motion and of the transfers is carried through the linear solution.
    pub(crate) camera: LinearCamera,
    /// Which of (fx, fy, cx, cy, skew) were estimated.
    pub(crate) estimated: [bool; 5],
    /// What the circular point of each view leaves of its equation: |eᵀ ω e| / (eᴴ ω e), by how much the floor comes out stretched.
    pub(crate) misfits: Vec<f64>,
}

/// Another view's homography with a view of the motion.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Join<'a> {
    /// It leads to the other view, or `backwards` from it.
    pub(crate) estimate: &'a HomographyEstimate,
    pub(crate) backwards: bool,
}

/// The circular point of a view from that of another.
fn transfer(h: &Matrix3<f64>, point: &ComplexPoint) -> ComplexPoint {
    (h.map(|v| Complex::new(v, 0.0)) * point).normalize()
}

/// The camera from the homography of one plane-normal motion (view 0 to its second view) and homographies from view 0 to other
/// views of the same plane, all in one frame, every equation having the same weight. `aspect` is fy / fx where the constraint holds it.
///
/// # Errors
/// [`Error::NoUsableMotion`] when the motion shows no turn; [`Error::TooFewAttitudes`] for fewer views than the constraint needs;
/// [`Error::Undetermined`] and [`Error::NotPositiveDefinite`] when the views are too alike or no real camera solves the equations;
/// [`Error::InvalidInput`] for frames that differ; [`Error::InvalidOption`] for [`Constraint::Auto`].
pub fn calibrate_transferred(
    motion: &HomographyEstimate,
    others: &[HomographyEstimate],
    constraint: Constraint,
    aspect: f64,
) -> Result<LinearCamera, Error> {
    if !(aspect.is_finite() && aspect > 0.0) {
        return Err(Error::InvalidOption(format!("aspect ratio {aspect} must be positive")));
    }
    let frame = common_frame(std::iter::once(motion).chain(others))?;
    let first = from_homography(motion).map_err(|why| Error::NoUsableMotion {
        pairs: 1,
        reason: match why {
            NoCircularPoint::NoRotation { rotation_rad, significance } => format!(
                "no rotation to be seen (eigenvalue angle {:.1} degrees, {significance:.1} sigma; {MIN_SIGNIFICANCE} needed)",
                rotation_rad.to_degrees()
            ),
            NoCircularPoint::TooUncertain { sigma } => {
                let [known, needed] = [sigma, MAX_DIRECTION_SIGMA].map(f64::to_degrees);
                format!("circular point too uncertain (direction known to {known:.0} degrees, {needed:.0} needed)")
            }
        },
        remedies: vec![Remedy::CLEAR_TURN],
    })?;
    let point = first.circular_point;
    let first = WeightedPoint { covariance: point.covariance, point };
    let joins: Vec<Join<'_>> = others.iter().map(|estimate| Join { estimate, backwards: false }).collect();
    Ok(camera_transferred(&first, &joins, frame, constraint, aspect)?.camera)
}

/// The same from a motion's circular point with its covariance, which is that of both of its views, and other views joined to either.
///
/// # Errors
/// As [`calibrate_transferred`].
pub(crate) fn camera_transferred(
    first: &WeightedPoint,
    joins: &[Join<'_>],
    frame: &Frame,
    constraint: Constraint,
    aspect: f64,
) -> Result<Transferred, Error> {
    if constraint == Constraint::Auto {
        return Err(Error::InvalidOption(
            "the transfer of one motion has no priors: give zero-skew, square or another constraint instead of auto"
                .into(),
        ));
    }
    let (found, needed) = (1 + joins.len(), constraint.attitudes_needed());
    if found < needed {
        return Err(Error::TooFewAttitudes {
            constraint: constraint.name(),
            unknowns: constraint.unknowns(),
            needed,
            motions: 1,
            attitudes: found,
            alternatives: vec![Constraint::Focal],
        });
    }
    let (p, covariance, points) = propagate(first, joins, constraint, aspect)?;
    let in_frame = intrinsics_of(&p);
    let back = in_frame.inverse_matrix().map(|v| Complex::new(v, 0.0));
    let misfit = |e: &ComplexPoint| {
        let direction = back * e;
        direction.dot(&direction).norm() / direction.norm_squared()
    };
    let misfits = points.iter().map(misfit).collect();
    let mut intrinsics = frame.intrinsics_to_pixel(&in_frame);
    intrinsics.skew += 0.0;
    if let Some(uncertain) = what_is_uncertain(&covariance, frame) {
        return Err(Error::Undetermined {
            constraint: constraint.name(),
            direction: format!("one motion seen from {found} views would give {uncertain}"),
            remedies: vec![Remedy::VaryTiltAndRoll, Remedy::TurnFurther],
        });
    }
    let to_pixels = frame.pixels_by_logarithms(&intrinsics);
    Ok(Transferred {
        camera: LinearCamera { intrinsics, covariance_px: to_pixels * covariance * to_pixels.transpose() },
        estimated: constraint.estimated(),
        misfits,
    })
}

type Solution = (Parameters, SMatrix<f64, 5, 5>, Vec<ComplexPoint>);

/// The linear solution with the covariance that its inputs give it, by differences.
fn propagate(
    first: &WeightedPoint,
    joins: &[Join<'_>],
    constraint: Constraint,
    aspect: f64,
) -> Result<Solution, Error> {
    let singular =
        || Error::Numerical { stage: "transfer of circular points", detail: "a homography has no inverse".into() };
    let points_of = |e: &ComplexPoint, matrices: &[Matrix3<f64>]| -> Result<Vec<ComplexPoint>, Error> {
        let forward = matrices.iter().zip(joins).map(|(h, join)| match join.backwards {
            false => Ok(*h),
            true => h.try_inverse().ok_or_else(singular),
        });
        std::iter::once(Ok(e.normalize())).chain(forward.map(|h| Ok(transfer(&h?, e)))).collect()
    };
    let solve =
        |e: &ComplexPoint, matrices: &[Matrix3<f64>]| solve_unweighted(&points_of(e, matrices)?, constraint, aspect);
    let matrices: Vec<Matrix3<f64>> = joins.iter().map(|join| join.estimate.in_frame).collect();
    let e = first.point.point;
    let p = solve(&e, &matrices)?;
    let mut covariance = SMatrix::<f64, 5, 5>::zeros();
    let mut add = |up: Parameters, down: Parameters| {
        let slope: SVector<f64, 5> = (up - down) / (2.0 * STEP_SIGMAS);
        covariance += slope * slope.transpose();
    };
    let roots = |m: DMatrix<f64>| -> Result<Vec<Vec<f64>>, Error> {
        let (values, vectors) = symmetric_eigen(&m).ok_or_else(|| Error::Numerical {
            stage: "transfer of circular points",
            detail: "covariance not finite".into(),
        })?;
        let column = |i: usize| vectors.column(i).iter().map(|v| v * values[i].sqrt()).collect();
        Ok((0..values.len()).filter(|&i| values[i] > 0.0).map(column).collect())
    };
    for root in roots(DMatrix::from_fn(4, 4, |r, c| first.covariance[(r, c)]))? {
        let step = Vector4::from_fn(|i, _| STEP_SIGMAS * root[i]);
        add(solve(&first.point.moved(&step), &matrices)?, solve(&first.point.moved(&-step), &matrices)?);
    }
    for (i, join) in joins.iter().enumerate() {
        for root in roots(DMatrix::from_fn(9, 9, |r, c| join.estimate.covariance[(r, c)]))? {
            let step = Matrix3::from_fn(|r, c| STEP_SIGMAS * root[3 * r + c]);
            let moved = |sign: f64| {
                let mut matrices = matrices.clone();
                matrices[i] += step * sign;
                solve(&e, &matrices)
            };
            add(moved(1.0)?, moved(-1.0)?);
        }
    }
    Ok((p, covariance, points_of(&e, &matrices)?))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        pairs::refine::{RefineOptions, refine},
        synthetic::points::{MotionSpec, PointScene},
    };

    /// One turn of 25 degrees, then views of other attitudes from other places.
    fn scene(sigma_px: f64, seed: u64) -> PointScene {
        let nominal = PointScene::nominal(seed);
        let first = MotionSpec::about_axis(50f64.to_radians(), 0.0, 25f64.to_radians(), 0.2, 3.0);
        let other = |pitch_deg: f64, roll_deg: f64, yaw_deg: f64, shift: [f64; 2], height_ratio: f64| MotionSpec {
            turn_rad: yaw_deg.to_radians(),
            shift,
            height_ratio,
            attitude_error_rad: [(pitch_deg - 50.0).to_radians(), roll_deg.to_radians()],
            ..first
        };
        let others = [other(42.0, 30.0, 5.0, [0.3, -0.4], 1.1), other(60.0, -35.0, -8.0, [-0.2, 0.3], 0.9)];
        PointScene { motions: [&[first][..], &others].concat(), sigma_px, ..nominal }
    }

    fn solve(scene: &PointScene, constraint: Constraint) -> Result<LinearCamera, Error> {
        let frame = Frame::new(scene.size, None);
        let fit = |matches: &[_]| refine(matches, None, &frame, &RefineOptions::default()).expect("a homography");
        let all: Vec<HomographyEstimate> = scene.pairs().iter().map(|p| fit(&p.matches)).collect();
        calibrate_transferred(&all[0], &all[1..], constraint, scene.intrinsics.fy / scene.intrinsics.fx)
    }

    #[test]
    fn exact_homographies_give_the_camera() {
        for constraint in [Constraint::Full, Constraint::ZeroSkew, Constraint::Square] {
            let scene = scene(0.0, 1);
            let found = solve(&scene, constraint).expect("a camera");
            let (k, truth) = (found.intrinsics, scene.intrinsics);
            for (a, b) in [(k.fx, truth.fx), (k.fy, truth.fy), (k.cx, truth.cx), (k.cy, truth.cy), (k.skew, truth.skew)]
            {
                assert!((a - b).abs() < 1e-8 * truth.fx, "{}: {a} {b}", constraint.name());
            }
        }
    }

    #[test]
    fn the_stated_deviations_are_the_scatter() {
        let mut squares = [0.0; 4];
        let trials = 200;
        for seed in 0..trials {
            let scene = scene(0.5, seed);
            let found = solve(&scene, Constraint::ZeroSkew).expect("a camera");
            let (k, truth, c) = (found.intrinsics, scene.intrinsics, found.covariance_px);
            for (i, error) in
                [k.fx - truth.fx, k.fy - truth.fy, k.cx - truth.cx, k.cy - truth.cy].into_iter().enumerate()
            {
                squares[i] += error * error / c[(i, i)] / trials as f64;
            }
        }
        // 200 trials tell each to 5 %.
        assert!(squares.iter().all(|s| (0.8..1.2).contains(&s.sqrt())), "{squares:?}");
    }

    #[test]
    fn what_cannot_be_told_is_refused() {
        let scene = scene(0.5, 3);
        let frame = Frame::new(scene.size, None);
        let fit = |i: usize| {
            refine(&scene.pairs()[i].matches, None, &frame, &RefineOptions::default()).expect("a homography")
        };
        let motion = fit(0);
        let refused = |others: &[HomographyEstimate], constraint| {
            calibrate_transferred(&motion, others, constraint, 1.0).expect_err("not determined")
        };
        assert!(matches!(refused(&[], Constraint::ZeroSkew), Error::TooFewAttitudes { attitudes: 1, needed: 2, .. }));
        assert!(matches!(refused(&[fit(1)], Constraint::Auto), Error::InvalidOption(_)));
        // The second view of the motion itself has the same attitude.
        let same = refused(std::slice::from_ref(&motion), Constraint::ZeroSkew);
        assert!(matches!(same, Error::Undetermined { .. } | Error::NotPositiveDefinite { .. }), "{same}");
    }
}
