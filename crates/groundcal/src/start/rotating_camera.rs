//! The rotating-camera method: calibration from homographies between views of one optical centre.
//!
//! ```text
//! H = K R K⁻¹,   det H = 1:        Hᵀ ω H = ω,   ω = K⁻ᵀ K⁻¹
//! ```
//!
//! linear in ω (Hartley, *Self-calibration from multiple views with a rotating camera*, ECCV 1994; the same equations as his
//! ω = H⁻ᵀ ω H⁻¹), with what is known of the camera imposed on ω (de Agapito, Hayman & Reid, *Self-calibration of rotating
//! and zooming cameras*, IJCV 2001). H in frame coordinates. Each rotation gives four independent equations; a fifth
//! combination, which no ω changes, tells whether H is a rotation at all, and goes into chi-squared. To first order noise
//! moves five of the six entries of the residual Hᵀ ω H - ω: det H = 1 holds the sixth, tr(ω⁻¹ Hᵀ ω H) - 3.
//!
//! What cannot be told: rotations about one axis a leave ω + s b bᵀ, b = K⁻ᵀ a, for every s. Zero skew ends that unless a is
//! an axis of the image: a pan (a = y) leaves fy free, a tilt (a = x) leaves fx, a roll (a = z) both, whatever else is known.
//! Any two different axes suffice (rotations of 180 degrees apart).
//!
//! The method needs a camera that turns about its optical centre. One that also moves biases it: chi-squared tells, where the
//! error is large enough to be seen. [`crate::pairs::circular_points`] needs no such thing, but a floor.

use nalgebra::{DMatrix, DVector, Matrix3, SMatrix, SVector, Vector3};

use crate::{
    error::Error,
    geometry::{frame::Frame, intrinsics::Intrinsics},
    numerics::{
        linalg::{inverse_spd, symmetric_eigen},
        statistics::chi_squared_survival,
    },
    pairs::refine::HomographyEstimate,
    remedy::Remedy,
    start::{
        absolute_conic::{
            Constraint, MIN_SIGNAL_OVER_NOISE, Parameters, conic_from_entries, intrinsics_from_conic, intrinsics_of,
            parameters_of, signal_over_noise,
        },
        linear_camera::{DISAGREEMENT_P, what_is_uncertain},
    },
};

/// How the equations of a rotation count.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Weighting {
    /// All nine entries of Hᵀ ω H - ω alike, as Hartley has it.
    Uniform,
    /// By the inverse of their covariance, iterated.
    Covariance,
}

/// Options of [`calibrate_rotating`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct RotatingOptions {
    /// What is assumed of the camera matrix; every one but [`Constraint::Auto`]. A known principal point is the origin of the
    /// homographies' frame.
    pub constraint: Constraint,
    /// fy / fx where the constraint holds it.
    pub aspect: f64,
    /// Weights of the equations.
    pub weighting: Weighting,
}

impl Default for RotatingOptions {
    fn default() -> Self {
        Self { constraint: Constraint::ZeroSkew, aspect: 1.0, weighting: Weighting::Covariance }
    }
}

/// One rotation as the estimated camera sees it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Rotation {
    /// Axis in the camera frame of the first view (and of the second), unit length.
    pub axis: Vector3<f64>,
    /// Angle about it, 0 to π, radians.
    pub angle_rad: f64,
    /// Squared normalised residual of its equations; 5 degrees of freedom less what the camera took.
    pub chi_squared: f64,
}

/// A camera from rotations and how sure it is.
#[derive(Debug, Clone)]
pub(crate) struct RotatingSolution {
    /// In pixels.
    pub intrinsics: Intrinsics,
    /// Covariance of (fx, fy, cx, cy, skew) in pixels squared; zero rows for what was held.
    pub covariance_px: SMatrix<f64, 5, 5>,
    /// Which of (fx, fy, cx, cy, skew) were estimated.
    pub estimated: [bool; 5],
    /// The rotations, in the order of the homographies.
    pub rotations: Vec<Rotation>,
    /// Sum of squared normalised residuals.
    pub chi_squared: f64,
    /// Its degrees of freedom: five for each rotation less the unknowns.
    pub degrees_of_freedom: usize,
    /// Factor on the covariance because the homographies are further from rotations than their noise explains (1: none).
    pub variance_inflation: f64,
}

/// A homography of determinant one, frame coordinates, with the columns of a root of its covariance.
struct RotationHomography {
    h: Matrix3<f64>,
    noise: Vec<Matrix3<f64>>,
}

impl RotationHomography {
    fn new(estimate: &HomographyEstimate) -> Option<Self> {
        let scale = estimate.in_frame.determinant().cbrt();
        let h = estimate.in_frame / scale;
        let inverse = h.try_inverse()?;
        let covariance = DMatrix::from_fn(9, 9, |r, c| estimate.covariance[(r, c)]);
        let (values, vectors) = symmetric_eigen(&covariance)?;
        let noise: Vec<Matrix3<f64>> = (0..9)
            .filter(|&i| values[i] > 1e-12 * values[8])
            .map(|i| {
                let d = Matrix3::from_fn(|r, c| vectors[(3 * r + c, i)]) * (values[i].sqrt() / scale);
                // Along H the determinant would change.
                d - h * ((inverse * d).trace() / 3.0)
            })
            .collect();
        (h.iter().all(|v| v.is_finite()) && !noise.is_empty()).then_some(Self { h, noise })
    }

    /// The entries of Hᵀ ω H - ω for ω of entries `w`.
    fn residual(&self, omega: &Matrix3<f64>) -> SVector<f64, 6> {
        entries(&(self.h.transpose() * omega * self.h - omega))
    }

    /// The residual's covariance.
    fn covariance(&self, omega: &Matrix3<f64>) -> SMatrix<f64, 6, 6> {
        let mut covariance = SMatrix::<f64, 6, 6>::zeros();
        for d in &self.noise {
            let half = d.transpose() * omega * self.h;
            let moved = entries(&(half + half.transpose()));
            covariance.ger(1.0, &moved, &moved, 1.0);
        }
        covariance
    }

    /// The matrix that takes (ω11, ω12, ω13, ω22, ω23, ω33) to the residual, or to its change with H by `d`.
    fn equations(&self, d: Option<&Matrix3<f64>>) -> SMatrix<f64, 6, 6> {
        let mut a = SMatrix::<f64, 6, 6>::zeros();
        for k in 0..6 {
            let unit = conic_from_entries(&DVector::from_fn(6, |i, _| if i == k { 1.0 } else { 0.0 }));
            let column = match d {
                None => self.residual(&unit),
                Some(d) => {
                    let half = d.transpose() * unit * self.h;
                    entries(&(half + half.transpose()))
                }
            };
            a.set_column(k, &column);
        }
        a
    }
}

/// The six entries of a symmetric matrix, those off the diagonal times √2: the Euclidean norm is then Frobenius's.
fn entries(m: &Matrix3<f64>) -> SVector<f64, 6> {
    let s = std::f64::consts::SQRT_2;
    SVector::from([m[(0, 0)], s * m[(0, 1)], s * m[(0, 2)], m[(1, 1)], s * m[(1, 2)], m[(2, 2)]])
}

/// The inverse of the covariance on the five directions in which it moves.
fn pseudo_inverse(covariance: &SMatrix<f64, 6, 6>) -> Option<SMatrix<f64, 6, 6>> {
    let (values, vectors) = symmetric_eigen(&DMatrix::from_fn(6, 6, |r, c| covariance[(r, c)]))?;
    let mut inverse = SMatrix::<f64, 6, 6>::zeros();
    for i in 1..6 {
        let v = SVector::<f64, 6>::from_fn(|r, _| vectors[(r, i)]);
        inverse.ger(1.0 / values[i].max(1e-12 * values[5]), &v, &v, 1.0);
    }
    inverse.iter().all(|v| v.is_finite()).then_some(inverse)
}

fn numerical(detail: &str) -> Error {
    Error::Numerical { stage: "rotating camera", detail: detail.into() }
}

/// The camera of homographies (all in one frame) that are taken to be pure rotations.
///
/// # Errors
/// [`Error::Undetermined`] for rotations about one axis that leave what the constraint asks for free, and for turns too small
/// for their noise; [`Error::NotPositiveDefinite`] when no real camera solves the equations; [`Error::NoUsableMotion`] for an
/// empty slice; [`Error::InvalidInput`] for frames that differ or numbers that are not finite; [`Error::InvalidOption`] for
/// [`Constraint::Auto`].
pub(crate) fn calibrate_rotating(
    homographies: &[HomographyEstimate],
    options: &RotatingOptions,
) -> Result<RotatingSolution, Error> {
    let constraint = options.constraint;
    if constraint == Constraint::Auto {
        return Err(Error::InvalidOption(
            "the rotating-camera method has no priors: give zero-skew, square or another constraint instead of auto"
                .into(),
        ));
    }
    if !(options.aspect.is_finite() && options.aspect > 0.0) {
        return Err(Error::InvalidOption(format!("aspect ratio {} must be positive", options.aspect)));
    }
    let Some(first) = homographies.first() else {
        return Err(Error::NoUsableMotion {
            pairs: 0,
            reason: "there is no homography".into(),
            remedies: vec![Remedy::TurnAboutOpticalCentre, Remedy::TurnAboutTwoAxes { turn_deg: 10.0 }],
        });
    };
    if homographies.iter().any(|h| h.frame != first.frame) {
        return Err(Error::InvalidInput("the homographies are given in different frames".into()));
    }
    let rotations: Vec<RotationHomography> = homographies
        .iter()
        .enumerate()
        .map(|(i, h)| {
            let unusable = || Error::InvalidInput(format!("homography {i} is not finite or has no covariance"));
            RotationHomography::new(h).ok_or_else(unusable)
        })
        .collect::<Result<_, _>>()?;
    let parameters = solve(&rotations, options)?;
    finish(&rotations, parameters, options, &first.frame)
}

/// The linear solution.
fn solve(rotations: &[RotationHomography], options: &RotatingOptions) -> Result<Parameters, Error> {
    let constraint = options.constraint;
    let basis = constraint.basis(options.aspect);
    let reduce = |m: &SMatrix<f64, 6, 6>| basis.transpose() * DMatrix::from_fn(6, 6, |r, c| m[(r, c)]) * &basis;
    let mut p = Parameters::from([2f64.ln(), options.aspect.ln(), 0.0, 0.0, 0.0]);
    let rounds = if options.weighting == Weighting::Covariance { 4 } else { 1 };
    for round in 0..rounds {
        let omega = conic(&p);
        let mut signal = SMatrix::<f64, 6, 6>::zeros();
        let mut noise = SMatrix::<f64, 6, 6>::zeros();
        for rotation in rotations {
            let weight = match options.weighting {
                Weighting::Uniform => SMatrix::<f64, 6, 6>::identity(),
                Weighting::Covariance => pseudo_inverse(&rotation.covariance(&omega))
                    .ok_or_else(|| numerical("covariance of the equations not finite"))?,
            };
            let a = rotation.equations(None);
            signal += a.transpose() * weight * a;
            for d in &rotation.noise {
                let a = rotation.equations(Some(d));
                noise += a.transpose() * weight * a;
            }
        }
        let signal = reduce(&signal);
        let last = round == rounds - 1;
        if last {
            let ratio = signal_over_noise(&signal, &reduce(&noise)).ok_or_else(|| numerical("equations not finite"))?;
            if ratio < MIN_SIGNAL_OVER_NOISE {
                return Err(undetermined(rotations, &p, ratio, constraint));
            }
        }
        let (_, vectors) = symmetric_eigen(&signal).ok_or_else(|| numerical("equations not finite"))?;
        match intrinsics_from_conic(&conic_from_entries(&(&basis * vectors.column(0)))) {
            Ok(k) => p = parameters_of(&k),
            Err(eigenvalues) if last => {
                return Err(Error::NotPositiveDefinite {
                    constraint: constraint.name(),
                    eigenvalues,
                    remedies: vec![Remedy::TurnAboutOpticalCentre, Remedy::TurnOverFloor],
                });
            }
            // The first weights may be far off; the next round has another chance from them.
            Err(_) => {}
        }
    }
    Ok(p)
}

fn conic(p: &Parameters) -> Matrix3<f64> {
    let inverse = intrinsics_of(p).inverse_matrix();
    inverse.transpose() * inverse
}

/// Axes closer than this count as one, in degrees.
const ONE_AXIS_DEG: f64 = 3.0;

/// Names the cause: no turn to speak of, one axis, or noise.
fn undetermined(rotations: &[RotationHomography], p: &Parameters, ratio: f64, constraint: Constraint) -> Error {
    let k = intrinsics_of(p);
    let seen: Vec<(Vector3<f64>, f64)> = rotations.iter().map(|r| axis_and_angle(&k, &r.h)).collect();
    let least_deg =
        |angles: &[(Vector3<f64>, f64)]| angles.iter().map(|a| a.1).fold(f64::INFINITY, f64::min).to_degrees();
    let spread_deg = seen
        .iter()
        .flat_map(|a| seen.iter().map(move |b| a.0.dot(&b.0).abs().min(1.0).acos()))
        .fold(0.0, f64::max)
        .to_degrees();
    let noise = format!("signal over noise {ratio:.2}, at least {MIN_SIGNAL_OVER_NOISE} is needed");
    let n = rotations.len();
    let count = if n == 1 { "the one rotation".to_string() } else { format!("the {n} rotations") };
    let (direction, remedies) = if seen.iter().all(|s| s.1 < 0.5f64.to_radians()) {
        (
            format!("{count} turn the camera by {:.2} degrees or less ({noise})", least_deg(&seen)),
            vec![Remedy::TurnAboutTwoAxes { turn_deg: 10.0 }],
        )
    } else if spread_deg < ONE_AXIS_DEG {
        let axis = seen[0].0;
        let largest = axis.amax();
        let free = if axis.z.abs() == largest {
            "roughly the optical axis (a roll), which leaves the focal length free"
        } else if axis.y.abs() == largest {
            "roughly the image's vertical (a pan), which leaves fy free"
        } else {
            "roughly the image's horizontal (a tilt), which leaves fx free"
        };
        (
            format!("{count} go about one axis, to {spread_deg:.1} degrees: {free} ({noise})"),
            // After a pan or a tilt alone a known aspect ratio may do.
            vec![
                Remedy::TurnAboutTwoAxes { turn_deg: 10.0 },
                Remedy::UseConstraint { any_of: vec![Constraint::Square] },
            ],
        )
    } else {
        (
            format!("{count} are too small or too alike for their noise ({noise})"),
            vec![Remedy::TurnFurther, Remedy::TurnAboutTwoAxes { turn_deg: 10.0 }],
        )
    };
    Error::Undetermined { constraint: constraint.name(), direction, remedies }
}

/// Axis (unit length) and angle (0 to π) of the rotation nearest to K⁻¹ H K.
fn axis_and_angle(k: &Intrinsics, h: &Matrix3<f64>) -> (Vector3<f64>, f64) {
    let m = k.inverse_matrix() * h * k.matrix();
    let skew = Vector3::new(m[(2, 1)] - m[(1, 2)], m[(0, 2)] - m[(2, 0)], m[(1, 0)] - m[(0, 1)]) * 0.5;
    let sine = skew.norm();
    let angle = sine.atan2(0.5 * (m.trace() - 1.0));
    (if sine > 0.0 { skew / sine } else { Vector3::z() }, angle)
}

/// Covariance, chi-squared and the numbers in pixels.
fn finish(
    rotations: &[RotationHomography],
    p: Parameters,
    options: &RotatingOptions,
    frame: &Frame,
) -> Result<RotatingSolution, Error> {
    let constraint = options.constraint;
    let free: Vec<usize> = (0..5).filter(|&i| constraint.free()[i]).collect();
    let n = free.len();
    let k = intrinsics_of(&p);
    let omega = conic(&p);
    let by_parameters = conic_derivatives(&k);
    let mut information = DMatrix::<f64>::zeros(n, n);
    let mut scatter = DMatrix::<f64>::zeros(n, n);
    let mut reports = Vec::with_capacity(rotations.len());
    for rotation in rotations {
        let covariance = rotation.covariance(&omega);
        let inverse = pseudo_inverse(&covariance).ok_or_else(|| numerical("covariance of the equations not finite"))?;
        let weight = if options.weighting == Weighting::Uniform { SMatrix::identity() } else { inverse };
        let mut j = DMatrix::<f64>::zeros(6, n);
        for (c, &i) in free.iter().enumerate() {
            j.set_column(c, &rotation.residual(&by_parameters[i]));
        }
        let weighted = j.transpose() * weight;
        information += &weighted * &j;
        scatter += &weighted * covariance * weighted.transpose();
        let r = rotation.residual(&omega);
        let (axis, angle_rad) = axis_and_angle(&k, &rotation.h);
        reports.push(Rotation { axis, angle_rad, chi_squared: (r.transpose() * inverse * r)[(0, 0)] });
    }
    let undetermined = |direction: String| Error::Undetermined {
        constraint: constraint.name(),
        direction,
        remedies: vec![Remedy::TurnFurther, Remedy::TurnAboutTwoAxes { turn_deg: 10.0 }],
    };
    let inverse = inverse_spd(&information)
        .ok_or_else(|| undetermined(format!("{} rotations do not tell the {n} unknowns apart", rotations.len())))?;
    let reduced = &inverse * scatter * &inverse;
    let mut covariance = SMatrix::<f64, 5, 5>::zeros();
    for (r, &i) in free.iter().enumerate() {
        for (c, &j) in free.iter().enumerate() {
            covariance[(i, j)] = reduced[(r, c)];
        }
    }
    if let Some(uncertain) = what_is_uncertain(&covariance, frame) {
        return Err(undetermined(format!("{} rotations would give {uncertain}", rotations.len())));
    }
    let chi_squared: f64 = reports.iter().map(|r| r.chi_squared).sum();
    let degrees_of_freedom = (5 * rotations.len()).saturating_sub(n);
    let disagree = degrees_of_freedom > 0 && chi_squared_survival(chi_squared, degrees_of_freedom) < DISAGREEMENT_P;
    let variance_inflation = if disagree { (chi_squared / degrees_of_freedom as f64).max(1.0) } else { 1.0 };
    let mut intrinsics = frame.intrinsics_to_pixel(&k);
    // Minus zero looks odd in a file.
    intrinsics.skew += 0.0;
    let mut to_pixels = SMatrix::<f64, 5, 5>::from_diagonal_element(frame.scale_px);
    (to_pixels[(0, 0)], to_pixels[(1, 0)], to_pixels[(1, 1)]) = (intrinsics.fx, intrinsics.fy, intrinsics.fy);
    Ok(RotatingSolution {
        intrinsics,
        covariance_px: to_pixels * covariance * to_pixels.transpose() * variance_inflation,
        estimated: constraint.estimated(),
        rotations: reports,
        chi_squared,
        degrees_of_freedom,
        variance_inflation,
    })
}

/// ∂ω / ∂(ln fx, ln fy/fx, cx, cy, skew) = -(K⁻ᵀ ∂Kᵀ ω + ω ∂K K⁻¹).
fn conic_derivatives(k: &Intrinsics) -> [Matrix3<f64>; 5] {
    let inverse = k.inverse_matrix();
    let omega = inverse.transpose() * inverse;
    let one = |r: usize, c: usize, value: f64| {
        let mut m = Matrix3::zeros();
        m[(r, c)] = value;
        m
    };
    let changes = [one(0, 0, k.fx) + one(1, 1, k.fy), one(1, 1, k.fy), one(0, 2, 1.0), one(1, 2, 1.0), one(0, 1, 1.0)];
    changes.map(|d| {
        let half = omega * d * inverse;
        -(half + half.transpose())
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        geometry::{
            homography::{Homography, HomographyCovariance},
            size::ImageSize,
        },
        numerics::linalg::rows_of,
        pairs::{
            correspondence::PointMatch,
            refine::{RefineOptions, refine},
        },
    };
    use nalgebra::{Rotation3, Unit, Vector2};
    use rand::{RngExt, SeedableRng};
    use rand_distr::{Distribution, StandardNormal};
    use rand_pcg::Pcg64Mcg;

    const SIZE: ImageSize = ImageSize { width: 1280, height: 960 };

    fn camera(constraint: Constraint) -> Intrinsics {
        let general = Intrinsics { fx: 1010.0, fy: 985.0, cx: 652.0, cy: 468.0, skew: 3.0 };
        let centre = SIZE.centre_px();
        match constraint {
            Constraint::Full => general,
            Constraint::ZeroSkew | Constraint::Auto => Intrinsics { skew: 0.0, ..general },
            Constraint::Square => Intrinsics { skew: 0.0, fy: general.fx, ..general },
            Constraint::FixedPrincipalPoint => Intrinsics { skew: 0.0, cx: centre[0], cy: centre[1], ..general },
            Constraint::Focal => Intrinsics::square(general.fx, centre[0], centre[1]),
        }
    }

    fn turn(axis: [f64; 3], degrees: f64) -> Matrix3<f64> {
        Rotation3::from_axis_angle(&Unit::new_normalize(Vector3::from(axis)), degrees.to_radians()).into_inner()
    }

    fn exact(k: &Intrinsics, r: &Matrix3<f64>, sigma: f64) -> HomographyEstimate {
        let h = Homography::new(k.matrix() * r * k.inverse_matrix()).expect("invertible");
        let frame = Frame::new(SIZE, None);
        let unit = rows_of(&h.in_frame(&frame));
        let along = unit * unit.transpose();
        let covariance = (HomographyCovariance::identity() - along) * (sigma * sigma);
        HomographyEstimate::from_parts(h, covariance, frame, 100)
    }

    fn options(constraint: Constraint, weighting: Weighting) -> RotatingOptions {
        RotatingOptions { constraint, weighting, ..RotatingOptions::default() }
    }

    const HARD: [Constraint; 5] = [
        Constraint::Full,
        Constraint::ZeroSkew,
        Constraint::Square,
        Constraint::FixedPrincipalPoint,
        Constraint::Focal,
    ];

    #[test]
    fn exact_rotations_give_the_exact_camera_under_every_constraint() {
        for constraint in HARD {
            let k = camera(constraint);
            let turns = [turn([0.1, 1.0, 0.2], 14.0), turn([1.0, -0.2, 0.1], -9.0), turn([0.2, 0.5, 1.0], 20.0)];
            let all: Vec<_> = turns.iter().map(|r| exact(&k, r, 1e-9)).collect();
            for weighting in [Weighting::Uniform, Weighting::Covariance] {
                for count in [2, 3] {
                    let s = calibrate_rotating(&all[..count], &options(constraint, weighting)).expect("determined");
                    let error = (s.intrinsics.matrix() - k.matrix()).norm() / k.fx;
                    assert!(error < 1e-9, "{constraint:?} {weighting:?} {count}: {error:e}");
                    assert!((s.rotations[0].angle_rad.to_degrees() - 14.0).abs() < 1e-6);
                    assert!((s.rotations[1].axis - Vector3::new(-1.0, 0.2, -0.1).normalize()).norm() < 1e-7);
                    assert!(s.chi_squared < 1e-6 && s.variance_inflation == 1.0);
                }
            }
        }
    }

    #[test]
    fn derivatives_of_the_conic_agree_with_differences() {
        let p = Parameters::from([0.7, 0.02, 0.05, -0.03, 0.01]);
        for (i, analytic) in conic_derivatives(&intrinsics_of(&p)).iter().enumerate() {
            let mut d = Parameters::zeros();
            d[i] = 1e-6;
            let difference = (conic(&(p + d)) - conic(&(p - d))) / 2e-6;
            assert!((difference - analytic).norm() < 1e-8, "{i}");
        }
    }

    #[test]
    fn what_one_axis_leaves_free_is_refused_and_named() {
        let cases: [([f64; 3], Constraint, Option<&str>); 10] = [
            ([0.0, 1.0, 0.0], Constraint::Full, Some("fy")),
            ([0.0, 1.0, 0.0], Constraint::ZeroSkew, Some("fy")),
            ([0.0, 1.0, 0.0], Constraint::Square, None),
            ([1.0, 0.0, 0.0], Constraint::ZeroSkew, Some("fx")),
            ([1.0, 0.0, 0.0], Constraint::Square, None),
            ([0.0, 0.0, 1.0], Constraint::ZeroSkew, Some("focal length")),
            ([0.0, 0.0, 1.0], Constraint::Square, Some("focal length")),
            ([0.0, 0.0, 1.0], Constraint::Focal, Some("focal length")),
            ([0.5, 1.0, 0.3], Constraint::Full, Some("one axis")),
            ([0.5, 1.0, 0.3], Constraint::ZeroSkew, None),
        ];
        for (axis, constraint, word) in cases {
            let k = camera(constraint);
            for weighting in [Weighting::Uniform, Weighting::Covariance] {
                let all: Vec<_> = [10.0, 20.0, -15.0].map(|a| exact(&k, &turn(axis, a), 1e-4)).to_vec();
                let found = calibrate_rotating(&all, &options(constraint, weighting));
                match (word, found) {
                    (None, Ok(s)) => assert!((s.intrinsics.fx - k.fx).abs() < 1e-6, "{axis:?} {constraint:?}"),
                    (Some(word), Err(Error::Undetermined { direction, .. })) => {
                        assert!(direction.contains("one axis") && direction.contains(word), "{axis:?}: {direction}");
                    }
                    (_, other) => panic!("{axis:?} {constraint:?} {weighting:?}: {other:?}"),
                }
            }
        }
    }

    #[test]
    fn pan_and_tilt_without_roll_determine_a_fixed_camera() {
        let k = camera(Constraint::Full);
        let all = [turn([0.0, 1.0, 0.0], 15.0), turn([1.0, 0.0, 0.0], 10.0)].map(|r| exact(&k, &r, 1e-5));
        let s = calibrate_rotating(&all, &options(Constraint::Full, Weighting::Covariance)).expect("determined");
        assert!((s.intrinsics.matrix() - k.matrix()).norm() < 1e-6);
    }

    #[test]
    fn no_turn_nothing_and_priors_are_refused() {
        let k = camera(Constraint::ZeroSkew);
        let still = [turn([0.0, 1.0, 0.0], 0.01), turn([1.0, 0.0, 0.0], 0.01)].map(|r| exact(&k, &r, 1e-3));
        let Err(Error::Undetermined { direction, .. }) = calibrate_rotating(&still, &RotatingOptions::default()) else {
            panic!("no turn");
        };
        assert!(direction.contains("degrees or less"), "{direction}");
        assert!(matches!(calibrate_rotating(&[], &RotatingOptions::default()), Err(Error::NoUsableMotion { .. })));
        let auto = options(Constraint::Auto, Weighting::Covariance);
        assert!(matches!(calibrate_rotating(&still, &auto), Err(Error::InvalidOption(_))));
    }

    /// Homographies of noisy matches of far points, `translation` in units of their distance.
    fn measured(k: &Intrinsics, translation: f64, seed: u64) -> Vec<HomographyEstimate> {
        let mut rng = Pcg64Mcg::seed_from_u64(seed);
        let turns = [turn([0.1, 1.0, 0.2], 14.0), turn([1.0, -0.2, 0.1], -12.0), turn([0.2, 0.5, 1.0], 20.0)];
        let frame = Frame::new(SIZE, None);
        let normal = Vector3::new(0.1, 0.3, 1.0);
        turns
            .iter()
            .map(|r| {
                let moved = r + Vector3::new(translation, 0.0, 0.0) * normal.transpose();
                let h = Homography::new(k.matrix() * moved * k.inverse_matrix()).expect("invertible");
                let mut noise = || Vector2::from_fn(|_, _| StandardNormal.sample(&mut rng));
                let noise: Vec<[Vector2<f64>; 2]> = (0..200).map(|_| [noise(), noise()]).collect();
                let matches: Vec<PointMatch> = noise
                    .into_iter()
                    .filter_map(|[na, nb]| {
                        let a = Vector2::new(rng.random_range(0.0..1279.0), rng.random_range(0.0..959.0));
                        let b = h.apply(&a)?;
                        Some(PointMatch { a: a + na, b: b + nb, sigma_px: 1.0 })
                    })
                    .collect();
                refine(&matches, None, &frame, &RefineOptions::default()).expect("a homography")
            })
            .collect()
    }

    #[test]
    fn error_bars_agree_with_the_errors_of_seeded_trials() {
        let k = camera(Constraint::ZeroSkew);
        const TRIALS: u64 = 300;
        for weighting in [Weighting::Uniform, Weighting::Covariance] {
            let mut normalised = [0.0; 4];
            let mut chi_squared = 0.0;
            for seed in 0..TRIALS {
                let s = calibrate_rotating(&measured(&k, 0.0, seed), &options(Constraint::ZeroSkew, weighting))
                    .expect("determined");
                let q = s.intrinsics;
                for (i, e) in [q.fx - k.fx, q.fy - k.fy, q.cx - k.cx, q.cy - k.cy].iter().enumerate() {
                    normalised[i] += e * e * s.variance_inflation / s.covariance_px[(i, i)];
                }
                chi_squared += s.chi_squared / s.degrees_of_freedom as f64 / TRIALS as f64;
            }
            let normalised = normalised.map(|v| (v / TRIALS as f64).sqrt());
            // Sampling error of a standard deviation from 300 trials: 4 %.
            assert!(normalised.iter().all(|v| (0.85..1.15).contains(v)), "{normalised:?}");
            // Residuals at the weighted solution have the mean of chi-squared; at the other they are larger.
            assert!(weighting == Weighting::Uniform || (0.9..1.1).contains(&chi_squared), "{chi_squared}");
        }
    }

    #[test]
    fn translation_shows_in_chi_squared_and_in_the_error_bar() {
        let k = camera(Constraint::ZeroSkew);
        let still = calibrate_rotating(&measured(&k, 0.0, 1), &RotatingOptions::default()).expect("determined");
        let moved = calibrate_rotating(&measured(&k, 0.03, 1), &RotatingOptions::default()).expect("determined");
        assert_eq!(still.variance_inflation, 1.0);
        assert!(moved.chi_squared > 10.0 * moved.degrees_of_freedom as f64);
        assert!(moved.covariance_px[(0, 0)] > 3.0 * still.covariance_px[(0, 0)]);
    }
}
