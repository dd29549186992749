//! How much better an alternative would explain the tracks, from the problem linearised once where it was minimised without it.
//!
//! ```text
//! -2 ln E - (-2 ln E')  ~=  2 (c - c' + d)  +  V - V'
//! ```
//!
//! c: cost; c': cost with the alternative's unknowns and priors at the same state; d: the decrease that a full step promises; V: what
//! -2 ln E ([`crate::refine::evidence`]) has beside the squares, the volumes of what is estimated and the mean over the variance components, after the
//! step. To first order that is the gain in evidence. A full refinement gains more where weights of the loss follow, and in the model's curvature.

use crate::{
    numerics::levenberg_marquardt::{LeastSquares, Linearisation},
    refine::{
        blocks::{BundleOptions, DepartureKind, State},
        evidence::volumes,
        layout::ProblemInputs,
        problem::Problem,
        tracks::Track,
        variance_components::VarianceComponents,
    },
};

/// Where a problem was minimised: state, cost, and V there.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Explained<'a> {
    pub(crate) state: &'a State,
    pub(crate) cost: f64,
    pub(crate) volumes: f64,
}

/// What the evidence would gain by an alternative; `None` where that is not defined or not determined at this state.
pub(crate) fn prospect(problem: &Problem, at: Explained<'_>, tracks: &[Track], options: &BundleOptions) -> Option<f64> {
    let state = at.state;
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
    Some(2.0 * (at.cost - linearised.cost() + step.predicted_decrease) + at.volumes - volumes)
}
