//! One Levenberg-Marquardt loop for every refinement.
//!
//! Minimises cost(x) = rᵀ W r / 2 over a state that need not be a vector space: a problem supplies its linearisation at a
//! state (dense [`NormalEquations`], or one that eliminates unknowns its own way) and the step to a new one. Damping
//! multiplies the diagonal (Marquardt 1963), its factor follows the ratio of actual to predicted decrease (Nielsen 1999).
//!
//! Estimating equations g(x) = 0 whose weights depend on x are no gradient of a cost: of these every full step is taken
//! ([`StepPolicy::Undamped`]), and the cost says no more than whether the model is defined.

use nalgebra::{DMatrix, DVector};

use crate::observer::{Observer, Silent};

/// Cost, gradient and Gauss-Newton matrix at a state.
pub(crate) struct NormalEquations {
    /// Half the weighted sum of squared residuals.
    pub cost: f64,
    /// Jᵀ W r.
    pub gradient: DVector<f64>,
    /// Jᵀ W J.
    pub information: DMatrix<f64>,
}

/// A step that solves damped normal equations.
pub(crate) struct DampedStep {
    /// In the tangent space of the state, less what was eliminated from the equations ([`Linearisation::completed`]).
    pub step: DVector<f64>,
    /// By how much the linearised problem says the cost falls.
    pub predicted_decrease: f64,
}

/// A problem linearised at a state.
pub(crate) trait Linearisation {
    /// Half the weighted sum of squared residuals.
    fn cost(&self) -> f64;
    /// The step for a damping factor λ on the diagonal; `None` when the damped matrix is not positive definite.
    fn solve(&self, lambda: f64) -> Option<DampedStep>;
    /// The same step with what was eliminated from the equations. Asked for of steps that are taken.
    fn completed(&self, step: DVector<f64>) -> DVector<f64> {
        step
    }
}

impl Linearisation for NormalEquations {
    fn cost(&self) -> f64 {
        self.cost
    }

    fn solve(&self, lambda: f64) -> Option<DampedStep> {
        let mut damped = self.information.clone();
        for i in 0..damped.nrows() {
            damped[(i, i)] += lambda * self.information[(i, i)].max(f64::MIN_POSITIVE);
        }
        let step = damped.cholesky()?.solve(&(-&self.gradient));
        let predicted_decrease = -(self.gradient.dot(&step) + 0.5 * step.dot(&(&self.information * &step)));
        Some(DampedStep { step, predicted_decrease })
    }
}

/// What the loop asks of a problem.
pub(crate) trait LeastSquares {
    /// The unknowns.
    type State: Clone;
    /// Its linearised form.
    type Linearised: Linearisation;
    /// The problem linearised at a state; `None` where the model is not defined.
    fn linearise(&self, state: &Self::State) -> Option<Self::Linearised>;
    /// Cost alone; `None` where the model is not defined.
    fn cost(&self, state: &Self::State) -> Option<f64>;
    /// The state a tangent step away.
    fn retract(&self, state: &Self::State, step: &DVector<f64>) -> Self::State;
}

/// Which steps are taken.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) enum StepPolicy {
    /// Those that lower the cost (Levenberg-Marquardt).
    #[default]
    Damped,
    /// All that stay where the model is defined (Gauss-Newton).
    Undamped,
}

/// When to stop.
#[derive(Debug, Clone, Copy)]
pub(crate) struct LmOptions {
    /// Which steps are taken.
    pub descent: StepPolicy,
    /// Most steps tried.
    pub max_iterations: usize,
    /// Stop when the decrease predicted for the next step is below this fraction of the cost.
    pub relative_cost_tolerance: f64,
    /// Stop when no component of the step exceeds this (in units of the tangent space).
    pub step_tolerance: f64,
}

impl Default for LmOptions {
    fn default() -> Self {
        Self { descent: StepPolicy::Damped, max_iterations: 50, relative_cost_tolerance: 1e-12, step_tolerance: 1e-14 }
    }
}

/// Why the loop ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum StopReason {
    /// The next step would not lower the cost by a noticeable amount.
    Converged,
    /// The iteration limit was reached; the best state found is returned.
    MaxIterations,
    /// No damping gave a lower cost, with the predicted decrease still noticeable; or an undamped step left the model.
    Stalled,
    /// The observer said so.
    Stopped,
}

/// The best state found and how it was reached.
pub(crate) struct LmOutput<S, L> {
    /// The best state.
    pub state: S,
    /// Half the weighted sum of squared residuals there.
    pub cost: f64,
    /// The problem linearised there.
    pub linearised: L,
    /// Steps tried.
    pub iterations: usize,
    /// Why the loop ended.
    pub stop: StopReason,
}

/// By how much the damping grows after a step that did not lower the cost; the next time by twice as much (Nielsen 1999).
const FIRST_GROWTH: f64 = 2.0;

/// Minimise; `None` only when the problem is undefined at the start.
pub(crate) fn minimise<P: LeastSquares>(
    problem: &P,
    start: P::State,
    options: &LmOptions,
) -> Option<LmOutput<P::State, P::Linearised>> {
    minimise_until(problem, start, options, &Silent)
}

/// The same under an observer's eyes, which is asked before each step whether to stop ([`StopReason::Stopped`]).
pub(crate) fn minimise_until<P: LeastSquares>(
    problem: &P,
    start: P::State,
    options: &LmOptions,
    observer: &dyn Observer,
) -> Option<LmOutput<P::State, P::Linearised>> {
    let mut state = start;
    let mut at = problem.linearise(&state)?;
    let undamped = options.descent == StepPolicy::Undamped;
    let mut lambda = if undamped { 0.0 } else { 1e-6 };
    let mut growth = FIRST_GROWTH;
    let mut iterations = 0;
    let mut stop = StopReason::MaxIterations;
    while iterations < options.max_iterations {
        if observer.stopped() {
            stop = StopReason::Stopped;
            break;
        }
        iterations += 1;
        let solved = at.solve(lambda).filter(|s| s.step.iter().all(|v| v.is_finite()));
        let Some(DampedStep { step, predicted_decrease }) = solved else {
            if undamped || lambda > 1e12 {
                stop = StopReason::Stalled;
                break;
            }
            lambda = (lambda * 10.0).max(1e-9);
            continue;
        };
        let no_gain = predicted_decrease <= options.relative_cost_tolerance * at.cost();
        if no_gain || step.amax() <= options.step_tolerance {
            stop = StopReason::Converged;
            break;
        }
        let step = at.completed(step);
        let candidate = problem.retract(&state, &step);
        if undamped {
            let Some(linearised) = problem.linearise(&candidate) else {
                stop = StopReason::Stalled;
                break;
            };
            (state, at) = (candidate, linearised);
            continue;
        }
        if let Some((linearised, gain)) = lower(problem, &candidate, &at, predicted_decrease, growth > FIRST_GROWTH) {
            state = candidate;
            at = linearised;
            lambda = (lambda * f64::max(1.0 / 3.0, 1.0 - (2.0 * gain - 1.0).powi(3))).max(1e-12);
            growth = FIRST_GROWTH;
            continue;
        }
        lambda = (lambda * growth).max(1e-9);
        growth *= 2.0;
        if lambda > 1e14 {
            stop = StopReason::Stalled;
            break;
        }
    }
    Some(LmOutput { state, cost: at.cost(), linearised: at, iterations, stop })
}

/// The problem linearised at a candidate of less cost, and the ratio of actual to predicted decrease. Nearly every step lowers the cost,
/// and what is linearised has its cost; only after one that did not (`in_doubt`) is the cost alone looked at first.
fn lower<P: LeastSquares>(
    problem: &P,
    candidate: &P::State,
    at: &P::Linearised,
    predicted_decrease: f64,
    in_doubt: bool,
) -> Option<(P::Linearised, f64)> {
    let gain = |cost: f64| (at.cost() - cost) / predicted_decrease;
    if in_doubt && problem.cost(candidate).is_none_or(|cost| gain(cost) <= 0.0) {
        return None;
    }
    let linearised = problem.linearise(candidate)?;
    let gain = gain(linearised.cost());
    (gain > 0.0).then_some((linearised, gain))
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Rosenbrock;

    impl LeastSquares for Rosenbrock {
        type State = DVector<f64>;
        type Linearised = NormalEquations;
        fn cost(&self, x: &Self::State) -> Option<f64> {
            let (a, b) = (10.0 * (x[1] - x[0] * x[0]), 1.0 - x[0]);
            Some(0.5 * (a * a + b * b))
        }
        fn linearise(&self, x: &Self::State) -> Option<NormalEquations> {
            let r = DVector::from_vec(vec![10.0 * (x[1] - x[0] * x[0]), 1.0 - x[0]]);
            let j = DMatrix::from_row_slice(2, 2, &[-20.0 * x[0], 10.0, -1.0, 0.0]);
            Some(NormalEquations {
                cost: 0.5 * r.norm_squared(),
                gradient: j.transpose() * &r,
                information: j.transpose() * &j,
            })
        }
        fn retract(&self, x: &Self::State, step: &DVector<f64>) -> Self::State {
            x + step
        }
    }

    #[test]
    fn rosenbrock_valley() {
        let start = DVector::from_vec(vec![-1.2, 1.0]);
        let out = minimise(&Rosenbrock, start.clone(), &LmOptions::default()).expect("defined");
        assert!((out.state - DVector::from_element(2, 1.0)).norm() < 1e-8);
        assert_ne!(out.stop, StopReason::Stalled);
        // Full steps: two residuals of two unknowns are zero after two, over a hill.
        let undamped = LmOptions { descent: StepPolicy::Undamped, ..LmOptions::default() };
        let out = minimise(&Rosenbrock, start, &undamped).expect("defined");
        assert!((out.state - DVector::from_element(2, 1.0)).norm() < 1e-8 && out.iterations <= 4);
    }
}
