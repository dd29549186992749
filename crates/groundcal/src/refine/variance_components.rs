//! Variance components: how far attitudes and heights of frames vary from those of their groups, and pictures depart from each other, by
//! restricted likelihood.
//!
//! ```text
//! ln L(σ) = ½ Σ_j ( σ² r_j² / (1 + σ² l_j) - ln (1 + σ² l_j) )          σ̂² = ∫ σ² L p dσ / ∫ L p dσ          m = ∫ L p dσ / (L(σ in force) ∫ p dσ)
//! χ²(σ)   = Σ_j r_j² / (l_j (1 + σ² l_j))                                p(σ) ∝ 1 / (1 + σ² / scale²)                        (Gelman 2006)
//! ```
//!
//! of random effects δ ~ N(0, σ² I) of one kind. Q: their information from the data alone, everything else eliminated; l_j its eigenvalues, r_j the
//! components of Q δ* along its eigenvectors, δ* being the effects that fit best without a prior. Attitude errors whose χ² is too large for the σ_a
//! that was given widen the covariances by χ² over its degrees of freedom.

use nalgebra::{DMatrix, DVector};

use crate::{
    numerics::{
        linalg::{inverse_spd, symmetric_eigen},
        skyline::Skyline,
        skyline_cholesky::SkylineCholesky,
        statistics::{GridLikelihood, VarianceComponent, chi_squared_survival},
    },
    refine::{
        blocks::{BundleOptions, DepartureKind, State},
        many_effects::{MAX_KNOWN_SIGMA, ManyEffects},
        problem::{MIN_PRIOR_SIGMA, Problem, RandomEffect},
    },
    start::linear_camera::DISAGREEMENT_P,
};

/// A variance component and where it comes from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Component {
    /// Standard deviation.
    pub sigma: f64,
    /// Whether the data told it.
    pub estimated: bool,
}

/// The half-Cauchy prior of σ_h: a tripod or a robot on a floor keeps its height to about a thousandth.
const HEIGHT_PRIOR: VarianceComponent = VarianceComponent { scale: 1e-3, below: 30.0, above: 1000.0 };
/// The half-Cauchy prior of σ_a.
fn attitude_prior(scale: f64) -> VarianceComponent {
    VarianceComponent { scale, below: 30.0, above: 50.0 }
}

/// The half-Cauchy priors of departures: focal lengths (relative), turns while a picture is read out (radians), shifts (frame units). What
/// focus and stabilisers do is a few thousandths; a pan of 10 degrees a second read out in a hundredth of a second turns by a tenth of a degree.
const DEPARTURE_PRIOR: VarianceComponent = VarianceComponent { scale: 2e-3, below: 30.0, above: 100.0 };
/// Directions in which the data must see a variance component before they decide it.
const MIN_DIRECTIONS: usize = 4;
/// Relative change at which a component has converged.
const RELATIVE_TOLERANCE: f64 = 0.05;
/// Largest σ_a with which motions are about the plane's normal: 2.5 degrees. A tripod has 0.01, a trolley that rocks one or two, a hand three
/// and more. (Of 740 answers of the bench with less 39 were wrong by more than 4 deviations, of 47 with more 10.)
pub(crate) const MAX_ATTITUDE_SIGMA_RAD: f64 = 0.0436;

/// By how much the variances grow because the attitudes disagree with a σ_a that was given.
pub(crate) fn disagreement((chi_squared, degrees_of_freedom): (f64, usize)) -> f64 {
    if chi_squared_survival(chi_squared, degrees_of_freedom) < DISAGREEMENT_P {
        chi_squared / degrees_of_freedom as f64
    } else {
        1.0
    }
}

/// The components of the model.
#[derive(Debug, Clone, Copy)]
pub(crate) struct VarianceComponents {
    /// σ_a, radians.
    pub(crate) attitude: Component,
    /// σ_h, relative.
    pub(crate) height: Component,
    /// Of each kind of departure.
    pub(crate) departures: [Component; DepartureKind::ALL.len()],
    /// Chi-squared of the attitude errors under the σ_a in force, and its degrees of freedom.
    pub(crate) agreement: (f64, usize),
    /// The same under the largest σ_a with which a motion is about the plane's normal, [`MAX_ATTITUDE_SIGMA_RAD`].
    pub(crate) agreement_at_most: (f64, usize),
    /// Logarithm of the evidence of those that are estimated over the likelihood of those in force.
    pub(crate) log_evidence: f64,
}

impl VarianceComponents {
    /// Before anything is known.
    pub(crate) fn start(options: &BundleOptions) -> Self {
        let given = |sigma: f64| Component { sigma, estimated: false };
        Self {
            attitude: given(options.attitude_sigma_rad.unwrap_or(options.attitude_scale_rad)),
            height: given(options.height_sigma.unwrap_or(1.0)),
            departures: std::array::from_fn(|k| {
                let estimated = options.departures.contains(&DepartureKind::ALL[k]);
                Component { sigma: if estimated { 10.0 * DEPARTURE_PRIOR.scale } else { 0.0 }, estimated }
            }),
            agreement: (0.0, 0),
            agreement_at_most: (0.0, 0),
            log_evidence: 0.0,
        }
    }

    /// Estimates those that are not given from a solution under those in force.
    pub(crate) fn updated(
        &self,
        problem: &Problem,
        state: &State,
        equations: (&Skyline, &SkylineCholesky),
        options: &BundleOptions,
    ) -> Self {
        let mut next = *self;
        let first_of_cameras = problem.layout.first_of_cameras();
        let (of_attitudes, of_heights) = (problem.attitude_errors(state), problem.height_errors(state));
        let attitudes = RandomEffects::new(&of_attitudes, equations, self.attitude.sigma, first_of_cameras);
        let heights = RandomEffects::new(&of_heights, equations, self.height.sigma, first_of_cameras);
        next.agreement = attitudes.as_ref().map_or((0.0, 0), |d| d.agreement(self.attitude.sigma));
        next.agreement_at_most = attitudes.as_ref().map_or((0.0, 0), |d| d.agreement(MAX_ATTITUDE_SIGMA_RAD));
        next.log_evidence = 0.0;
        if options.attitude_sigma_rad.is_none()
            && let Some(d) = &attitudes
        {
            let prior = attitude_prior(options.attitude_scale_rad);
            let likelihood = d.likelihood(&prior);
            next.attitude = d.attitude_component(options.attitude_scale_rad, &likelihood);
            next.log_evidence += likelihood.log_evidence() - d.log_likelihood(self.attitude.sigma);
        }
        if options.height_sigma.is_none()
            && let Some(d) = &heights
        {
            let likelihood = d.likelihood(&HEIGHT_PRIOR);
            next.height = Component { sigma: likelihood.posterior(), estimated: true };
            next.log_evidence += likelihood.log_evidence() - d.log_likelihood(self.height.sigma);
        }
        for (k, kind) in DepartureKind::ALL.into_iter().enumerate() {
            let departures = problem.departures(state, kind);
            let of_kind = RandomEffects::new(&departures, equations, self.departures[k].sigma, first_of_cameras);
            if let Some(d) = &of_kind {
                let likelihood = d.likelihood(&DEPARTURE_PRIOR);
                next.departures[k].sigma = likelihood.posterior();
                next.log_evidence += likelihood.log_evidence() - d.log_likelihood(self.departures[k].sigma);
            }
        }
        next
    }

    /// Whether they are hardly other than those in force. Those given do not move.
    pub(crate) fn has_converged(&self, in_force: &Self) -> bool {
        let converged =
            |a: &Component, b: &Component| a.sigma == b.sigma || (a.sigma / b.sigma).ln().abs() < RELATIVE_TOLERANCE;
        let departures = self.departures.iter().zip(&in_force.departures).all(|(a, b)| converged(a, b));
        converged(&self.attitude, &in_force.attitude) && converged(&self.height, &in_force.height) && departures
    }
}

/// Effects up to which they are treated by eigenvalues; beyond, the cube of their number is more than a factor for each of twenty-five variances.
const MAX_DENSE: usize = 100;

/// Random effects with a common variance, everything else eliminated.
enum RandomEffects<'a> {
    /// Their information Q from the data alone, by its eigenvalues, and the components of Q δ* (δ*: their best values) along the eigenvectors.
    Few {
        eigenvalues: DVector<f64>,
        right: DVector<f64>,
    },
    Many(ManyEffects<'a>),
}

impl<'a> RandomEffects<'a> {
    /// From a solution under a prior of standard deviation `sigma`.
    fn new(
        effects: &'a [RandomEffect],
        (information, factor): (&Skyline, &SkylineCholesky),
        sigma: f64,
        first_of_cameras: usize,
    ) -> Option<Self> {
        if effects.is_empty() {
            return None;
        }
        if effects.len() > MAX_DENSE {
            return Some(Self::Many(ManyEffects::new(effects, information, sigma, first_of_cameras)));
        }
        let columns: Vec<usize> = effects.iter().map(|d| d.column).collect();
        let block = factor.inverse_block(&columns);
        let covariance =
            DMatrix::from_fn(block.nrows(), block.ncols(), |r, c| effects[r].sign * effects[c].sign * block[(r, c)]);
        let mean = DVector::from_iterator(effects.len(), effects.iter().map(|d| d.value));
        let prior = 1.0 / sigma.max(MIN_PRIOR_SIGMA).powi(2);
        let posterior = inverse_spd(&covariance)?;
        let information = &posterior - DMatrix::from_diagonal_element(mean.len(), mean.len(), prior);
        let (values, vectors) = symmetric_eigen(&((&information + information.transpose()) * 0.5))?;
        // Rounding of what the prior held.
        let least = 1e-9 * prior;
        let eigenvalues = values.map(|v| if v > least { v } else { 0.0 });
        Some(Self::Few { right: vectors.tr_mul(&(posterior * mean)), eigenvalues })
    }

    /// Logarithm of the likelihood of a standard deviation, all else being profiled out.
    fn log_likelihood(&self, sigma: f64) -> f64 {
        let (eigenvalues, right) = match self {
            Self::Few { eigenvalues, right } => (eigenvalues, right),
            Self::Many(effects) => return effects.log_likelihood(sigma),
        };
        let variance = sigma * sigma;
        eigenvalues
            .iter()
            .zip(right.iter())
            .filter(|(l, _)| **l > 0.0)
            .map(|(l, r)| 0.5 * (variance * r * r / (1.0 + variance * l) - (variance * l).ln_1p()))
            .sum()
    }

    /// Chi-squared of the effects for a given variance, and its degrees of freedom.
    fn agreement(&self, sigma: f64) -> (f64, usize) {
        let (eigenvalues, right) = match self {
            Self::Few { eigenvalues, right } => (eigenvalues, right),
            Self::Many(effects) => {
                return (effects.chi_squared(sigma), effects.directions(MAX_KNOWN_SIGMA).round() as usize);
            }
        };
        let least = 1.0 / (MAX_KNOWN_SIGMA * MAX_KNOWN_SIGMA);
        let seen = eigenvalues.iter().zip(right.iter()).filter(|(l, _)| **l > least);
        seen.fold((0.0, 0), |(sum, count), (l, r)| (sum + r * r / (l * (1.0 + sigma * sigma * l)), count + 1))
    }

    /// The likelihood of all standard deviations that a prior allows.
    fn likelihood<'p>(&self, prior: &'p VarianceComponent) -> GridLikelihood<'p> {
        match self {
            Self::Few { .. } => prior.likelihood(|sigma| self.log_likelihood(sigma)),
            Self::Many(effects) => prior.smooth_likelihood(|sigma| effects.log_likelihood(sigma)),
        }
    }

    fn attitude_component(&self, scale: f64, likelihood: &GridLikelihood<'_>) -> Component {
        let seen = match self {
            Self::Few { eigenvalues, .. } => eigenvalues.iter().filter(|l| **l * scale * scale > 1.0).count(),
            Self::Many(effects) => effects.directions(scale).round() as usize,
        };
        let told = likelihood.posterior();
        if seen >= MIN_DIRECTIONS {
            return Component { sigma: told, estimated: true };
        }
        // Few directions, or ones of little information, do not make the deviation smaller than stated, but they may make it larger.
        let (_, directions) = self.agreement(scale);
        let sigma = if directions > 0 { told.max(scale) } else { scale };
        Component { sigma, estimated: sigma > scale }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn few_and_many_effects_have_one_likelihood() {
        // Nine columns that all hang together, three of them effects, one with the other sign.
        const SIZE: usize = 9;
        let root = DMatrix::from_fn(14, SIZE, |r, c| ((5 * r * r + 3 * c * c + 7 * r * c + 1) as f64).sin());
        let data = root.tr_mul(&root) * 400.0;
        let in_force = 0.05;
        let effect = |column, sign, value| RandomEffect { column, sign, value };
        let effects = [effect(1, 1.0, 0.04), effect(4, -1.0, -0.07), effect(7, 1.0, 0.02)];
        let mut information = Skyline::zeros(vec![0; SIZE]);
        for r in 0..SIZE {
            (0..=r).for_each(|c| information.add(r, c, data[(r, c)]));
        }
        effects.iter().for_each(|e| information.add(e.column, e.column, 1.0 / (in_force * in_force)));
        let factor = information.cholesky(0.0).expect("positive definite");
        let few = RandomEffects::new(&effects, (&information, &factor), in_force, SIZE).expect("determined");
        let many = RandomEffects::Many(ManyEffects::new(&effects, &information, in_force, SIZE));
        // Both but for a constant.
        let over = |of: &RandomEffects<'_>, sigma: f64| of.log_likelihood(sigma) - of.log_likelihood(in_force);
        for sigma in [1e-4, 0.01, 0.03, 0.2, 1.0] {
            let (a, b) = (over(&few, sigma), over(&many, sigma));
            assert!((a - b).abs() < 1e-7 * (1.0 + a.abs()), "{sigma}: {a} {b}");
        }
        let RandomEffects::Few { eigenvalues, .. } = &few else { panic!("three are few") };
        let RandomEffects::Many(many) = &many else { panic!("asked for") };
        for sigma in [0.01, 0.05, MAX_KNOWN_SIGMA] {
            let seen: f64 = eigenvalues.iter().map(|l| sigma * sigma * l / (1.0 + sigma * sigma * l)).sum();
            assert!((many.directions(sigma) - seen).abs() < 1e-3, "{} {seen}", many.directions(sigma));
        }
        let (chi_squared, directions) = few.agreement(in_force);
        assert_eq!(directions, 3);
        assert!(
            (many.chi_squared(in_force) / chi_squared - 1.0).abs() < 0.05,
            "{} {chi_squared}",
            many.chi_squared(in_force)
        );
    }
}
