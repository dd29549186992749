//! The shape of the likelihood along the focal length, where its error bar is wide.

use crate::{
    numerics::{
        levenberg_marquardt::{LmOptions, LmOutput, minimise_until},
        skyline_cholesky::SkylineCholesky,
        statistics::NORMAL_95,
    },
    observer::Observer,
    refine::{blocks::State, elimination::Reduced, problem::Problem},
};

/// Standard deviation of ln f from which on the shape of the likelihood is looked at.
const MIN_PROFILED_SIGMA: f64 = 0.01;
/// Rise of the cost that belongs to 95 %.
const COST_RISE_95: f64 = 1.92;
/// Standard deviation of the prior that holds ln f where it is looked at.
const HELD_SIGMA: f64 = 1e-8;
/// Step outwards, and how far (in ln f) it goes: f is off by a factor of three.
const STEP: f64 = 1.3;
const MAX_LN_F_CHANGE: f64 = 1.1;

/// How much wider than its linearised error bar the interval of a camera's f is: the cost, minimised over everything else, must
/// have risen by what belongs to 95 % at the ends (profile likelihood). Only where the bar is wide; 1: the bar holds.
pub(crate) fn profile_widening(
    problem: &Problem,
    best: &LmOutput<State, Reduced>,
    factor: &SkylineCholesky,
    lm: &LmOptions,
    observer: &dyn Observer,
) -> f64 {
    let of_camera = |camera: usize| widening_of(camera, problem, best, factor, lm, observer);
    (0..best.state.cameras.len()).map(of_camera).fold(1.0, f64::max)
}

fn widening_of(
    camera: usize,
    problem: &Problem,
    best: &LmOutput<State, Reduced>,
    factor: &SkylineCholesky,
    lm: &LmOptions,
    observer: &dyn Observer,
) -> f64 {
    let Some(column) = problem.layout.cameras[camera].column(0) else { return 1.0 };
    let sigma = factor.inverse_block(&[column])[(0, 0)].sqrt();
    if sigma < MIN_PROFILED_SIGMA {
        return 1.0;
    }
    let prior = problem.cameras[camera].prior(0);
    let prior_cost = |ln_f: f64| prior.map_or(0.0, |(mean, s)| 0.5 * ((ln_f - mean) / s).powi(2));
    let cost_at = |from: &State, ln_f: f64| {
        let mut held = problem.clone();
        held.cameras[camera].matrix_priors[0] = Some((ln_f, HELD_SIGMA));
        let mut start = from.clone();
        start.cameras[camera].matrix[0] = ln_f;
        let out = minimise_until(&held, start, lm, observer)?;
        Some((out.cost + prior_cost(ln_f), out.state))
    };
    let (state, ln_f) = (&best.state, best.state.cameras[camera].matrix[0]);
    let mut widest: f64 = 1.0;
    for side in [-1.0, 1.0] {
        let mut from = state.clone();
        let mut factor = 1.0;
        // Outwards in steps until the cost has risen.
        while factor * NORMAL_95 * sigma < MAX_LN_F_CHANGE {
            let Some((at, next)) = cost_at(&from, ln_f + side * factor * NORMAL_95 * sigma) else { break };
            if at - best.cost >= COST_RISE_95 {
                break;
            }
            from = next;
            factor *= STEP;
        }
        widest = widest.max(factor);
    }
    // A widening by one step is within the resolution of the search.
    if widest <= STEP { 1.0 } else { widest }
}
