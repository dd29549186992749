//! How well a model explains what it was refined on: the logarithm of its evidence, for comparing models of the same tracks.
//!
//! ```text
//! -2 ln E = Σ_kinds (N / D) ln s²  +  Σ (d / σ)²  +  V
//! V       = Σ ln σ²  -  ln |C|  -  2 ln m
//!
//! gain of 1 over 0 = Σ_kinds (N₁ / D₁) ln (s₀² / s₁²)  +  Σ₀ (d / σ)² - Σ₁ (d / σ)²  +  V₀ - V₁
//! ```
//!
//! N: degrees of freedom of the residuals of a kind; s²: their variance in units of the expected, at least 0.04 (the noise is profiled, not
//! integrated out); D: their design effect. d: a number that has a prior, less its mean; σ: the prior's standard deviation. These are numbers of
//! the cameras and the random effects: attitude and height errors, departures. C: covariance of the d with all other numbers free and the points
//! eliminated. So Σ ln σ² - ln |C| is the volume that the priors allow over the volume that the data leave of it, as twice a logarithm: a wide
//! prior, or a large σ_a, has to earn its width. What has no prior is profiled, as in restricted likelihood. m: likelihood of the variance
//! components σ_a, σ_h and those of departures, averaged over their priors, over that of the values in force.
//!
//! A gain counts both variances with the N and D of the model that is asked about: what neighbours have in common under the other model and
//! not under this one is what this one explains. So the gain of 1 over 0 is not the gain of 0 over 1 with the other sign. Positive
//! speaks for the model; a gain of 2 ln x is odds of x.

use crate::numerics::skyline_cholesky::SkylineCholesky;
use crate::refine::{
    blocks::State, elimination::Reduced, problem::Problem, tracks::KINDS, variance_components::VarianceComponents,
};

/// Least variance of residuals, in units of the expected: below it there is no noise to speak of (the weights stop there too).
const MIN_VARIANCE: f64 = 0.04;

/// The parts of a model's evidence.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Evidence {
    /// Σ (d / σ)² over the numbers that have a prior.
    squares: f64,
    /// V ([`volumes`]).
    pub(crate) volumes: f64,
    /// Degrees of freedom of each kind, and the variance of its residuals.
    residuals: [(f64, f64); KINDS],
    /// What neighbouring residuals have in common, for each kind.
    design_effects: [f64; KINDS],
}

impl Evidence {
    /// Of a solution; `residuals` are the degrees of freedom and the variance of each kind. `None` where the information of what has no
    /// prior is singular.
    pub(crate) fn new(
        problem: &Problem,
        (state, linearised): (&State, &Reduced),
        factor: &SkylineCholesky,
        components: &VarianceComponents,
        residuals: [(f64, f64); KINDS],
        design_effects: [f64; KINDS],
    ) -> Option<Self> {
        let squares = problem.priors(state).iter().map(|(d, sigma)| (d.value / sigma).powi(2)).sum();
        let volumes = volumes(problem, state, linearised, factor, components)?;
        Some(Self { squares, volumes, residuals, design_effects })
    }

    /// By how much -2 ln E is smaller than another model's of the same tracks.
    pub(crate) fn gain_over(&self, other: &Self) -> f64 {
        let of_kind = |k: usize| {
            let (count, variance) = self.residuals[k];
            let (_, before) = other.residuals[k];
            // What neighbours have in common under the other model and not under this one is what this one explains.
            let effect = self.design_effects[k];
            count / effect * (ln_variance(before) - ln_variance(variance))
        };
        other.squares - self.squares + other.volumes - self.volumes + (0..KINDS).map(of_kind).sum::<f64>()
    }

    /// By how much the residuals' part of it is smaller than under a model of more tracks, where those that this one has not are left to a homography of their
    /// own, of variance 1.
    pub(crate) fn gain_with_rest_apart(&self, other: &Self) -> f64 {
        let of_kind = |k: usize| {
            let ((own, variance), (all, before)) = (self.residuals[k], other.residuals[k]);
            let after = if all > 0.0 { (own * variance + (all - own).max(0.0)) / all.max(own) } else { before };
            all / self.design_effects[k] * (ln_variance(before) - ln_variance(after))
        };
        (0..KINDS).map(of_kind).sum()
    }
}

fn ln_variance(variance: f64) -> f64 {
    variance.max(MIN_VARIANCE).ln()
}

/// V of the header: volume that the priors allow over that which the data leave, and the mean over the variance components. `None` where the
/// information of what has no prior is singular.
pub(crate) fn volumes(
    problem: &Problem,
    state: &State,
    linearised: &Reduced,
    factor: &SkylineCholesky,
    components: &VarianceComponents,
) -> Option<f64> {
    let mut free = vec![true; problem.layout.size];
    let mut sum = -2.0 * components.log_evidence;
    for (d, sigma) in problem.priors(state) {
        free[d.column] = false;
        sum += 2.0 * sigma.ln();
    }
    // ln |C| = ln |information of the others| - ln |information of all|.
    let others: Vec<usize> = (0..free.len()).filter(|&column| free[column]).collect();
    let of_others = linearised.information.restricted(&others).cholesky(0.0)?.log_determinant();
    Some(sum + factor.log_determinant() - of_others)
}
