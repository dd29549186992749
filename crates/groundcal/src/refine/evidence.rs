//! How well a model explains what it was refined on: the logarithm of its evidence, for comparing models of the same tracks.
//!
//! ```text
//! -2 ln E = Σ_kinds N ln s²  +  Σ_D (d / σ)²  +  ln |C_prior,D|  -  ln |C_D|  -  2 ln e(σ_a, σ_h)
//! ```
//!
//! N is the number of degrees of freedom of a kind over its design effect, s² the variance of its residuals (profile likelihood of
//! the noise); D are all numbers that have a prior: those of the cameras, and the random_effects of the frames' attitudes and heights. C_D is
//! their covariance given all, so that the determinants are the volume that the data leave over the volume that was allowed
//! beforehand: a wide prior, or a large σ_a, has to earn its width. What has no prior is profiled, as in restricted likelihood.
//! e is the mean likelihood of σ_a and σ_h over their own priors, over that of the values in force.

use crate::numerics::skyline::SkylineCholesky;
use crate::refine::{
    blocks::State, elimination::Reduced, problem::Problem, tracks::KINDS, variance_components::VarianceComponents,
};

/// Least variance of residuals, in units of the expected: below it there is no noise to speak of (the weights stop there too).
const MIN_VARIANCE: f64 = 0.04;

/// The parts of a model's evidence.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Evidence {
    /// Sum of squares of what has a prior, in its deviations.
    squares: f64,
    /// The rest of -2 ln of the part of priors and variance components ([`volumes`]).
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

/// What -2 ln E has beside squares: volumes that the priors allow over those that the data leave, and the mean over the variance components. `None` where
/// the information of what has no prior is singular.
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
    // ln |C_D| = ln |information of the others| - ln |information of all|.
    let others: Vec<usize> = (0..free.len()).filter(|&column| free[column]).collect();
    let of_others = linearised.information.restricted(&others).cholesky(0.0)?.log_determinant();
    Some(sum + factor.log_determinant() - of_others)
}
