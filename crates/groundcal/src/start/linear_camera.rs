//! From plane-normal motions to the camera matrix with its covariance.
//!
//! ```text
//! χ²(p) = Σ_g r_gᵀ C_g⁻¹ r_g  +  Σ_i (p_i - p̄_i)² / σ_i²            p = (ln fx, ln fy/fx, cx, cy, skew)
//! cov(fx, fy, cx, cy, skew) = J Σ Jᵀ · max(1, χ² / n)               J = ∂(fx, fy, cx, cy, skew) / ∂p
//! ln L(σ_a) = -½ (χ² + Σ_g ln |C_g| - ln |Σ|),   σ̂_a² = ∫ σ² L prior dσ / ∫ L prior dσ
//! ```
//!
//! r_g: residual of the circular point of an attitude group on the conic, C_g its covariance, with σ_a about each axis
//! ([`crate::start::absolute_conic`], which has Σ); p̄_i ± σ_i: priors. Groups and C_g depend on K through σ_a, so all is done three times. The
//! factor on the covariance, n being the degrees of freedom, is 1 unless χ² is exceeded by chance with less than one in a hundred. σ_a is
//! estimated where it is not given, from three groups and four degrees of freedom on.

use nalgebra::SMatrix;

use crate::{
    error::Error,
    geometry::{frame::Frame, intrinsics::Intrinsics},
    numerics::{
        linalg::ComplexPoint,
        statistics::{VarianceComponent, chi_squared_survival},
    },
    observer::{Observer, Silent},
    remedy::Remedy,
    result::camera::Prior,
    select::attitude_groups::{AttitudeGroup, Motion, group_attitudes_until, regroup},
    start::absolute_conic::{
        ConicSolution, Constraint, Parameters, Priors, WeightedPoint, intrinsics_of, refine, solve_linear,
    },
};

pub use crate::geometry::parameters::PriorParameter;

/// A Gaussian prior: mean and standard deviation in pixels (aspect and those of the lens: no unit).
///
/// # Examples
/// ```
/// use groundcal::{GivenPrior, Options, PriorParameter};
/// // From the data sheet: 900 px, to 5 %.
/// let prior = GivenPrior { parameter: PriorParameter::Fx, mean: 900.0, sigma: 45.0 };
/// let options = Options { priors: vec![prior], ..Options::default() };
/// assert_eq!(options.priors.len(), 1);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GivenPrior {
    /// Of what.
    pub parameter: PriorParameter,
    /// Mean.
    pub mean: f64,
    /// Standard deviation.
    pub sigma: f64,
}

/// What is known of the camera and of the motion beforehand.
#[derive(Debug, Clone)]
pub(crate) struct CameraOptions {
    /// What is assumed of the camera matrix.
    pub constraint: Constraint,
    /// fy / fx where the constraint holds it, and centre of its prior under `Auto`.
    pub aspect: f64,
    /// Standard deviation of the prior of ln(fy / fx), `Auto` only.
    pub aspect_sigma: f64,
    /// Standard deviation of the prior of each coordinate of the principal point about the frame's origin, in pixels,
    /// `Auto` only.
    pub principal_point_sigma_px: f64,
    /// Priors that take the place of those of `Auto`, or join the other constraints.
    pub given: Vec<GivenPrior>,
    /// Standard deviation of each view's attitude about each axis across the floor's normal, in radians.
    pub attitude_sigma_rad: f64,
    /// Whether that is only the scale of a prior, and the motions, where there are enough, tell it (variance component).
    pub estimate_attitude_sigma: bool,
}

/// A camera matrix and how sure it is.
#[derive(Debug, Clone)]
pub(crate) struct CameraSolution {
    /// In pixels.
    pub(crate) intrinsics: Intrinsics,
    /// Covariance of (fx, fy, cx, cy, skew) in pixels squared; zero rows for what was held.
    pub(crate) covariance_px: SMatrix<f64, 5, 5>,
    /// Which of (fx, fy, cx, cy, skew) were estimated.
    pub(crate) estimated: [bool; 5],
    /// Priors used, and how much they counted.
    pub(crate) priors: Vec<Prior>,
    /// Attitudes and the motions that show them.
    pub(crate) groups: Vec<AttitudeGroup>,
    /// Sum of squared normalised residuals of the conic equations and priors.
    pub(crate) chi_squared: f64,
    /// Its degrees of freedom.
    pub(crate) degrees_of_freedom: usize,
    /// The standard deviation of the attitudes that the covariance was made with, in radians.
    pub(crate) attitude_sigma_rad: f64,
    /// Whether it was estimated from the motions.
    pub(crate) attitude_sigma_estimated: bool,
    /// Factor on the covariance because the motions disagree by more than their noise (1: none).
    pub(crate) variance_inflation: f64,
}

/// Standard deviation of ln f above which focal length counts as undetermined: the interval would span a factor of 2.7.
const MAX_LN_SIGMA: f64 = 0.25;
/// Standard deviation of the principal point above which it counts as undetermined, in half mean image sides.
const MAX_PRINCIPAL_POINT_SIGMA: f64 = 0.5;
/// Posterior over prior standard deviation from which on the prior decided: above 1/√2 it holds more than half of the information.
pub(crate) const PRIOR_DECIDES: f64 = 0.7;
/// Probability below which the disagreement of motions, or of attitude errors, is not put down to chance.
pub(crate) const DISAGREEMENT_P: f64 = 0.01;

impl CameraOptions {
    /// The priors in frame units.
    pub(crate) fn priors(&self, frame: &Frame) -> Priors {
        let mut priors = Priors::NONE;
        if self.constraint == Constraint::Auto {
            let principal_point = self.principal_point_sigma_px / frame.scale_px;
            priors.0[1] = Some((self.aspect.ln(), self.aspect_sigma));
            priors.0[2] = Some((0.0, principal_point));
            priors.0[3] = Some((0.0, principal_point));
        }
        for p in &self.given {
            let scale = frame.scale_px;
            match p.parameter {
                PriorParameter::Fx => priors.0[0] = Some(((p.mean / scale).ln(), p.sigma / p.mean)),
                PriorParameter::Aspect => priors.0[1] = Some((p.mean.ln(), p.sigma / p.mean)),
                PriorParameter::Cx => priors.0[2] = Some(((p.mean - frame.origin_px.x) / scale, p.sigma / scale)),
                PriorParameter::Cy => priors.0[3] = Some(((p.mean - frame.origin_px.y) / scale, p.sigma / scale)),
                PriorParameter::Skew => priors.0[4] = Some((p.mean / scale, p.sigma / scale)),
                // The joint refinement has those of the lens.
                PriorParameter::K1
                | PriorParameter::K2
                | PriorParameter::P1
                | PriorParameter::P2
                | PriorParameter::K3 => {}
            }
        }
        priors
    }
}

impl CameraOptions {
    /// What the priors were and what the covariance of (ln fx, ln fy/fx, cx, cy, skew), frame units, says they were worth.
    pub(crate) fn prior_uses(&self, frame: &Frame, covariance: &SMatrix<f64, 5, 5>) -> Vec<Prior> {
        let scale = frame.scale_px;
        let origins = [0.0, 0.0, frame.origin_px.x, frame.origin_px.y, 0.0];
        let priors = self.priors(frame);
        (0..5)
            .filter_map(|i| {
                let (mean, sigma) = priors.0[i]?;
                let (mean, unit) = match i {
                    0 => (mean.exp() * scale, mean.exp() * scale),
                    1 => (mean.exp(), mean.exp()),
                    _ => (mean * scale + origins[i], scale),
                };
                Some(Prior {
                    parameter: PriorParameter::ALL[i],
                    mean,
                    sigma: sigma * unit,
                    posterior_over_prior: covariance[(i, i)].max(0.0).sqrt() / sigma,
                    conflict: None,
                })
            })
            .collect()
    }
}

/// The camera of a set of motions given in `frame` coordinates.
///
/// # Errors
/// [`Error::TooFewAttitudes`], [`Error::Undetermined`], [`Error::NotPositiveDefinite`] when the motions do not determine
/// what the constraint asks for; [`Error::NoUsableMotion`] for an empty set.
pub(crate) fn solve_camera(
    motions: &[Motion],
    frame: &Frame,
    options: &CameraOptions,
) -> Result<CameraSolution, Error> {
    solve_camera_until(motions, frame, options, &Silent)
}

/// The same under an observer's eyes; [`Error::Stopped`] when it says so.
pub(crate) fn solve_camera_until(
    motions: &[Motion],
    frame: &Frame,
    options: &CameraOptions,
    observer: &dyn Observer,
) -> Result<CameraSolution, Error> {
    if motions.is_empty() {
        return Err(Error::NoUsableMotion {
            pairs: 0,
            reason: "no motion is left".into(),
            remedies: vec![Remedy::CLEAR_TURN],
        });
    }
    let priors = options.priors(frame);
    let mut parameters = Parameters::from([2f64.ln(), options.aspect.ln(), 0.0, 0.0, 0.0]);
    // Attitude errors make the weights depend on K: three rounds from a nominal focal length are plenty.
    let rounds = if options.attitude_sigma_rad > 0.0 { 3 } else { 1 };
    let mut last = None;
    for _ in 0..rounds {
        let k = intrinsics_of(&parameters);
        let groups = group_attitudes_until(motions, &k, options.attitude_sigma_rad, observer)?;
        let solution = solve_groups(&groups, motions.len(), options, &priors, frame)?;
        parameters = solution.parameters;
        last = Some((groups, solution));
    }
    let Some((mut groups, mut solution)) = last else {
        return Err(Error::Numerical { stage: "camera", detail: "no round was run".into() });
    };
    let mut sigma = options.attitude_sigma_rad;
    let enough = groups.len() >= MIN_GROUPS_FOR_SIGMA && solution.degrees_of_freedom >= MIN_DOF_FOR_SIGMA;
    let estimated = options.estimate_attitude_sigma && enough;
    if estimated {
        sigma = estimate_attitude_sigma(&groups, motions, &solution, options, &priors, observer);
        observer.go_on()?;
        groups = regroup(&groups, motions, &intrinsics_of(&solution.parameters), sigma);
        solution = solve_groups(&groups, motions.len(), options, &priors, frame)?;
    }
    let mut out = in_pixels(groups, solution, options, frame);
    (out.attitude_sigma_rad, out.attitude_sigma_estimated) = (sigma, estimated);
    Ok(out)
}

/// Attitudes and degrees of freedom from which on the motions can tell how far the axis varies.
const MIN_GROUPS_FOR_SIGMA: usize = 3;
const MIN_DOF_FOR_SIGMA: usize = 4;

/// The standard deviation of the attitudes from the motions' disagreement: restricted likelihood of the conic's residuals
/// times a half-Cauchy prior of the stated scale, on a logarithmic grid; the root of the mean of σ² over the posterior, so that
/// few motions keep a wide bar.
fn estimate_attitude_sigma(
    groups: &[AttitudeGroup],
    motions: &[Motion],
    solution: &ConicSolution,
    options: &CameraOptions,
    priors: &Priors,
    observer: &dyn Observer,
) -> f64 {
    let k = intrinsics_of(&solution.parameters);
    let component = VarianceComponent { scale: options.attitude_sigma_rad, below: 30.0, above: 30.0 };
    component.posterior(|sigma| {
        if observer.stopped() {
            return f64::NEG_INFINITY;
        }
        let points: Vec<WeightedPoint> = regroup(groups, motions, &k, sigma).into_iter().map(|g| g.fused).collect();
        refine(&points, &solution.parameters, options.constraint.free(), priors)
            .map_or(f64::NEG_INFINITY, |s| -0.5 * (s.chi_squared + s.log_determinants))
    })
}

/// Whether there are as many attitudes as the constraint needs.
///
/// # Errors
/// [`Error::TooFewAttitudes`].
pub(crate) fn check_attitudes(groups: &[AttitudeGroup], motions: usize, constraint: Constraint) -> Result<(), Error> {
    let needed = constraint.attitudes_needed();
    if groups.len() >= needed {
        return Ok(());
    }
    let alternatives = if groups.len() == 1 {
        vec![Constraint::Auto, Constraint::Focal, Constraint::FixedPrincipalPoint]
    } else {
        vec![Constraint::ZeroSkew, Constraint::Square]
    };
    Err(Error::TooFewAttitudes {
        constraint: constraint.name(),
        unknowns: constraint.unknowns(),
        needed,
        motions,
        attitudes: groups.len(),
        alternatives,
    })
}

fn solve_groups(
    groups: &[AttitudeGroup],
    motions: usize,
    options: &CameraOptions,
    priors: &Priors,
    frame: &Frame,
) -> Result<ConicSolution, Error> {
    check_attitudes(groups, motions, options.constraint)?;
    let points: Vec<WeightedPoint> = groups.iter().map(|g| g.fused.clone()).collect();
    solve_points(&points, options, priors, frame).map_err(|error| match error {
        // Straight down the circular points lie at infinity (third coordinate 0), whatever the roll.
        Error::Undetermined { constraint, direction, .. } if points.iter().all(|p| looks_straight_down(&p.point.point)) => {
            Error::Undetermined {
                constraint,
                direction: format!("{direction}; the camera looks straight down on the plane in every motion, which says nothing of the focal length"),
                remedies: vec![Remedy::TILT_DOWN],
            }
        }
        Error::NotPositiveDefinite { constraint, .. } if points.iter().all(|p| looks_straight_down(&p.point.point)) => {
            Error::Undetermined {
                constraint,
                direction: "the camera looks straight down on the plane in every motion, which says nothing of the focal length".into(),
                remedies: vec![Remedy::TILT_DOWN],
            }
        }
        Error::NotPositiveDefinite { constraint, eigenvalues, .. }
            if options.constraint == Constraint::FixedPrincipalPoint && points.len() == 1 =>
        {
            Error::NotPositiveDefinite {
                constraint,
                eigenvalues,
                // One attitude with a roll near 0 or 90 degrees does not tell fx from fy.
                remedies: vec![
                    Remedy::RollCamera { deg: 20.0 },
                    Remedy::UseConstraint { any_of: vec![Constraint::Focal] },
                ],
            }
        }
        error => error,
    })
}

/// Whether a circular point is that of a view square to the plane, to about three degrees.
fn looks_straight_down(point: &ComplexPoint) -> bool {
    point.z.norm() < 0.05 * point.x.norm().hypot(point.y.norm())
}

fn solve_points(
    points: &[WeightedPoint],
    options: &CameraOptions,
    priors: &Priors,
    frame: &Frame,
) -> Result<ConicSolution, Error> {
    let constraint = options.constraint;
    let solution = if constraint == Constraint::Auto {
        maximum_a_posteriori(points, options, priors)
    } else {
        let start = solve_linear(points, constraint, options.aspect)?;
        refine(points, &start, constraint.free(), priors)
    };
    let solution = solution.ok_or_else(|| Error::Undetermined {
        constraint: constraint.name(),
        direction: format!(
            "the equations of {} do not tell its {} unknowns apart",
            attitudes(points.len()),
            constraint.unknowns()
        ),
        remedies: remedies(constraint),
    })?;
    check_certainty(&solution.covariance, constraint, points.len(), frame)?;
    Ok(solution)
}

fn attitudes(count: usize) -> String {
    if count == 1 { "1 attitude".into() } else { format!("{count} attitudes") }
}

fn remedies(constraint: Constraint) -> Vec<Remedy> {
    let mut remedies = vec![Remedy::TILT_DOWN, Remedy::RollCamera { deg: 20.0 }, Remedy::CLEAR_TURN];
    if !matches!(constraint, Constraint::Auto | Constraint::Focal) {
        remedies.push(Remedy::UseConstraint { any_of: vec![Constraint::Auto, Constraint::Focal] });
    }
    remedies
}

/// With priors any start will do that is on the right side: the linear solutions, else the best of a few focal lengths.
fn maximum_a_posteriori(points: &[WeightedPoint], options: &CameraOptions, priors: &Priors) -> Option<ConicSolution> {
    let better = |best: ConicSolution, next: ConicSolution| {
        if next.chi_squared < best.chi_squared * (1.0 - 1e-9) { next } else { best }
    };
    let attempt = |start: Parameters| {
        refine(points, &start, Constraint::Auto.free(), priors)
            .filter(|s| s.parameters.iter().all(|v| v.is_finite()) && s.parameters[0].abs() < 5.0)
    };
    // Where the aspect ratio may be anything, square pixels are no start.
    let any_aspect = priors.0[1].is_none_or(|(_, sigma)| sigma > MAX_LN_SIGMA);
    let linear = [Constraint::ZeroSkew, Constraint::Square, Constraint::Focal]
        .into_iter()
        .filter(|c| any_aspect || *c != Constraint::ZeroSkew)
        .filter(|c| points.len() >= c.attitudes_needed())
        .find_map(|c| solve_linear(points, c, options.aspect).ok())
        .and_then(attempt);
    // Good enough that no other minimum can be better by much?
    if let Some(s) = &linear
        && chi_squared_survival(s.chi_squared, s.degrees_of_freedom) > DISAGREEMENT_P
    {
        return linear;
    }
    let grid = [0.6f64, 1.2, 2.4, 4.8, 9.6]
        .into_iter()
        .filter_map(|f| attempt(Parameters::from([f.ln(), options.aspect.ln(), 0.0, 0.0, 0.0])));
    linear.into_iter().chain(grid).reduce(better)
}

/// Refuses an answer whose error bar is so wide that the linearised interval means nothing. The covariance is that of
/// (ln fx, ln fy/fx, cx, cy, skew), frame units, from `groups` attitudes.
///
/// # Errors
/// [`Error::Undetermined`] naming what is not known, and how badly.
pub(crate) fn check_certainty(
    covariance: &SMatrix<f64, 5, 5>,
    constraint: Constraint,
    groups: usize,
    frame: &Frame,
) -> Result<(), Error> {
    let Some(uncertain) = what_is_uncertain(covariance, frame) else { return Ok(()) };
    Err(Error::Undetermined {
        constraint: constraint.name(),
        direction: format!("{} would give {uncertain}", attitudes(groups)),
        remedies: remedies(constraint),
    })
}

/// Which of (ln fx, ln fy/fx, cx, cy, skew), frame units, are known too badly to count as determined, in words; `None`: none of them.
pub(crate) fn what_is_uncertain(covariance: &SMatrix<f64, 5, 5>, frame: &Frame) -> Option<String> {
    let parts: Vec<String> = (0..5)
        .filter_map(|i| {
            let name = ["focal length", "aspect ratio", "cx", "cy", "skew"][i];
            let sigma = covariance[(i, i)].max(0.0).sqrt();
            let (limit, text) = if i < 2 {
                (MAX_LN_SIGMA, by_factor(name, 2.0 * sigma))
            } else {
                (MAX_PRINCIPAL_POINT_SIGMA, by_pixels(name, 2.0 * sigma, frame))
            };
            (sigma.is_nan() || sigma > limit).then_some(text)
        })
        .collect();
    (!parts.is_empty()).then(|| parts.join(", "))
}

/// How far a positive number is known, `half_width` being that of the interval of its logarithm. Beyond a factor of a thousand there
/// is no camera that it excludes.
fn by_factor(name: &str, half_width: f64) -> String {
    match half_width.exp() {
        factor if factor < 1000.0 => format!("{name} to a factor of {factor:.2} only"),
        _ => format!("{name} not at all"),
    }
}

/// How far a pixel coordinate is known, `half_width` in frame units. Beyond a hundred images it may be anywhere.
fn by_pixels(name: &str, half_width: f64, frame: &Frame) -> String {
    if half_width < 200.0 {
        format!("{name} to +-{:.0} px only", half_width * frame.scale_px)
    } else {
        format!("{name} not at all")
    }
}

fn in_pixels(groups: Vec<AttitudeGroup>, s: ConicSolution, options: &CameraOptions, frame: &Frame) -> CameraSolution {
    let mut intrinsics = frame.intrinsics_to_pixel(&s.intrinsics());
    // Minus zero looks odd in a file.
    intrinsics.skew += 0.0;
    let p_value = chi_squared_survival(s.chi_squared, s.degrees_of_freedom);
    let variance_inflation = if s.degrees_of_freedom > 0 && p_value < DISAGREEMENT_P {
        s.chi_squared / s.degrees_of_freedom as f64
    } else {
        1.0
    };
    let jacobian = frame.pixels_by_logarithms(&intrinsics);
    CameraSolution {
        intrinsics,
        covariance_px: jacobian * s.covariance * jacobian.transpose() * variance_inflation,
        estimated: options.constraint.estimated(),
        priors: options.prior_uses(frame, &s.covariance),
        groups,
        chi_squared: s.chi_squared,
        degrees_of_freedom: s.degrees_of_freedom,
        attitude_sigma_rad: options.attitude_sigma_rad,
        attitude_sigma_estimated: false,
        variance_inflation,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_not_known_is_not_given_in_digits() {
        let frame = Frame::new(crate::geometry::size::ImageSize::new(800, 600), None);
        let uncertain = |sigma: f64| {
            let covariance = SMatrix::<f64, 5, 5>::from_diagonal_element(sigma * sigma);
            what_is_uncertain(&covariance, &frame).unwrap_or_default()
        };
        assert!(uncertain(0.01).is_empty());
        assert!(uncertain(0.5).starts_with("focal length to a factor of 2.72 only, "), "{}", uncertain(0.5));
        for sigma in [1e3, 1e100, f64::INFINITY] {
            let text = uncertain(sigma);
            assert!(text.starts_with("focal length not at all") && text.ends_with("skew not at all"), "{text}");
        }
    }
}
