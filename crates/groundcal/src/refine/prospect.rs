//! How much better an alternative would explain the tracks, from the problem linearised once where it was minimised without it.
//!
//! ```text
//! gain = 2 (J - J' + ΔJ)  +  V - V'        J = ½ (Σ |r|² + Σ (d / σ)²)
//! ```
//!
//! J: cost at the solution, of weighted residuals r and priors; J': cost at the same state with the unknowns and priors of the alternative; ΔJ: by how
//! much one full step with these lowers it, the model being linear; V, V': volumes of priors and variance components as in
//! [`crate::refine::evidence`], V' after the step. To first order that is the gain in evidence. A full refinement gains more where the weights
//! of the loss follow, and in the model's curvature. The same step says where the camera would be.

use nalgebra::{DMatrix, DVector};

use crate::{
    numerics::{
        levenberg_marquardt::{LeastSquares, Linearisation},
        skyline_cholesky::SkylineCholesky,
    },
    refine::{
        adjust::of_any_picture,
        blocks::{BundleOptions, DepartureKind, FRAME_YAW},
        bundle::{Bundle, FIRST_CAMERA},
        evidence::volumes,
        layout::ProblemInputs,
        problem::Problem,
        score::{ByNumbers, Minimum},
        tracks::Track,
        variance_components::VarianceComponents,
    },
};

/// What an alternative promises.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Prospect {
    /// Twice the logarithm of the evidence that it would gain.
    pub(crate) gain: f64,
    /// By how much the first camera's numbers would move.
    pub(crate) step: DVector<f64>,
    /// Their covariance then, as that of any picture; zero rows for what is held.
    pub(crate) covariance: DMatrix<f64>,
}

/// What an alternative promises on the tracks of `bundle`; `None` where that is not defined or not determined at its state.
pub(crate) fn prospect(bundle: &Bundle, tracks: &[Track], options: &BundleOptions) -> Option<Prospect> {
    let (problem, state, volumes_here) = (&bundle.problem, &bundle.state, bundle.evidence?.volumes);
    let mut other = problem.with(&ProblemInputs {
        scene: problem.scene,
        tracks,
        state,
        cameras: &options.cameras,
        outlier_frames: &options.outlier_frames,
        departures: &options.departures,
        huber: problem.huber,
    });
    let mut in_force = VarianceComponents::start(options);
    (in_force.attitude.sigma, in_force.height.sigma) = (problem.attitude_sigma_rad, problem.height_sigma);
    for (k, kind) in DepartureKind::ALL.iter().enumerate() {
        if problem.departures_estimated.contains(kind) {
            in_force.departures[k].sigma = problem.departure_sigmas[k];
        }
    }
    other.departure_sigmas = in_force.departures.map(|c| c.sigma);
    let linearised = other.linearise(state)?;
    let step = linearised.solve(0.0)?;
    let factor = linearised.information.cholesky(0.0)?;
    let there = other.retract(state, &linearised.completed(step.step));
    let components = in_force.updated(&other, &there, (&linearised.information, &factor), options);
    let volumes = volumes(&other, &there, &linearised, &factor, &components)?;
    let mut covariance = of_camera(&other, &factor);
    for ((number, _), variance) in of_any_picture(&components) {
        if covariance[(number, number)] > 0.0 {
            covariance[(number, number)] += variance;
        }
    }
    Some(Prospect {
        gain: 2.0 * (bundle.cost - linearised.cost() + step.predicted_decrease) + volumes_here - volumes,
        step: there.cameras[FIRST_CAMERA].numbers() - state.cameras[FIRST_CAMERA].numbers(),
        covariance,
    })
}

/// Covariance of the first camera's numbers, from the information's factor.
fn of_camera(problem: &Problem, factor: &SkylineCholesky) -> DMatrix<f64> {
    let columns = problem.layout.cameras[FIRST_CAMERA].columns();
    let free: Vec<usize> = columns.iter().copied().flatten().collect();
    let inverse = factor.inverse_block(&free);
    let place = |number: usize| columns[number].and_then(|c| free.iter().position(|f| *f == c));
    DMatrix::from_fn(columns.len(), columns.len(), |r, c| match (place(r), place(c)) {
        (Some(r), Some(c)) => inverse[(r, c)],
        _ => 0.0,
    })
}

/// Standard deviation beforehand of the turn of a camera from the middle row to the last, radians (half a degree: 20 degrees a second and 50 milliseconds
/// for a picture, or 40 and 25).
const ROW_TURN_SIGMA_RAD: f64 = 0.0087;

/// One turn while each picture is read out, the same for all, as the residuals have it beside what is there already.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct RowTurnOfAll {
    /// From the middle row to the last, about the plane's normal, radians.
    pub(crate) turn_rad: f64,
    /// Its variance.
    pub(crate) variance: f64,
    /// What it promises.
    pub(crate) prospect: Prospect,
    /// By how much the first camera's numbers move with it.
    pub(crate) moved_by: DVector<f64>,
}

impl RowTurnOfAll {
    /// What -2 ln of the evidence has for a turn that is estimated: its square over the variance beforehand, and the volume that the data leave of that.
    pub(crate) fn price(&self, turn_rad: f64) -> f64 {
        let before = ROW_TURN_SIGMA_RAD * ROW_TURN_SIGMA_RAD;
        turn_rad * turn_rad / before - (self.variance / before).ln()
    }
}

/// A turn that pictures out of a pan have in common, or of a robot that turns on. `None` where it is not defined.
pub(crate) fn row_turn_of_all(bundle: &Bundle) -> Option<RowTurnOfAll> {
    let (problem, state) = (&bundle.problem, &bundle.state);
    let linearised = problem.linearise(state)?;
    let factor = linearised.information.cholesky(0.0)?;
    let by_turn: &ByNumbers<'_, 1> = &|(_, camera), projection| {
        let row = projection.pixel.y / problem.cameras[camera].image_half_sides[1];
        projection.by_frame.fixed_columns::<1>(FRAME_YAW) * row
    };
    let at = Minimum { state, factor: &factor, gradient: &linearised.gradient };
    let score = problem.score(at, ROW_TURN_SIGMA_RAD, by_turn)?;
    let columns = problem.layout.cameras[FIRST_CAMERA].columns();
    let moved_by = DVector::from_iterator(columns.len(), columns.iter().map(|c| c.map_or(0.0, |c| score.moved_by[c])));
    let (turn_rad, variance) = (score.step[0], score.covariance[0]);
    let prospect = Prospect {
        gain: score.statistic + (variance / (ROW_TURN_SIGMA_RAD * ROW_TURN_SIGMA_RAD)).ln(),
        step: &moved_by * turn_rad,
        covariance: of_camera(problem, &factor) + &moved_by * moved_by.transpose() * variance,
    };
    prospect.gain.is_finite().then_some(RowTurnOfAll { turn_rad, variance, prospect, moved_by })
}
