//! The few distributions the estimators need.
//!
//! ```text
//! P(χ²₂ₘ > x)   = exp(-x/2) Σ_{k<m} (x/2)ᵏ / k!                        P(χ²₂ > x) = p at x = -2 ln p
//! P(χ²₂ₘ₊₁ > x) = erfc(√(x/2)) + √(2x/π) exp(-x/2) Σ_{k<m} xᵏ / (3 · 5 ⋯ (2k + 1))         (Abramowitz & Stegun 26.4.4, 26.4.5)
//! E(χ²₂ | χ²₂ < c) = 2 - c exp(-c/2) / (1 - exp(-c/2))
//! σ̂² = Σ σ² L p / Σ L p,     p(σ) dσ ∝ σ / (1 + (σ / scale)²) d ln σ     over a grid of ln σ                          (Gelman 2006)
//! ```

use rayon::prelude::*;

/// Upper quantile of the standard normal distribution that makes a two-sided 95 % interval.
pub const NORMAL_95: f64 = 1.959_963_984_540_054;

/// Of chi-squared with two degrees of freedom the value that 1 % exceed: -2 ln 0.01.
pub(crate) const CHI_SQUARED_2_99: f64 = 9.210_340_371_976_182;
/// The same that 0.1 % exceed: -2 ln 0.001.
pub(crate) const CHI_SQUARED_2_999: f64 = 13.815_510_557_964_274;
/// Of a standard normal variable the value that 0.1 % exceed.
pub(crate) const NORMAL_999: f64 = 3.090_232_306_167_813;
/// Of chi-squared with four degrees of freedom the value that 0.1 % exceed.
pub(crate) const CHI_SQUARED_4_999: f64 = 18.466_826_952_903_17;
/// Standard deviations from which on a residual counts less (Huber's loss): 0.27 % of a normal variable's are beyond,
/// so that good residuals keep their weight, and no outlier pulls harder than a residual of three.
pub(crate) const HUBER_SIGMAS: f64 = 3.0;

/// The chi-squared quantile of two degrees of freedom: the value exceeded with probability `p`.
pub(crate) fn chi_squared_2_quantile(p: f64) -> f64 {
    -2.0 * p.ln()
}

/// Mean of a chi-squared variable of two degrees of freedom, given that it is below `limit`.
pub(crate) fn chi_squared_2_mean_below(limit: f64) -> f64 {
    let tail = (-0.5 * limit).exp();
    2.0 - limit * tail / (1.0 - tail)
}

/// Probability that a chi-squared variable of `dof` degrees of freedom exceeds `value`.
///
/// Finite sums for even and odd `dof` (Abramowitz & Stegun 26.4.4, 26.4.5), from their largest term on, which is no smaller than their sum over
/// the number of terms: exp(-x/2) alone is zero from x = 1,490 on, however many degrees of freedom there are.
pub fn chi_squared_survival(value: f64, dof: usize) -> f64 {
    if value <= 0.0 || dof == 0 {
        return 1.0;
    }
    let half = 0.5 * value;
    // Terms exp(-h) h^s / Γ(s + 1) of s = 0, 1, ... or ½, 1 ½, ...
    let (first, terms) = if dof.is_multiple_of(2) { (0.0, dof / 2) } else { (0.5, dof / 2) };
    let rest = if first > 0.0 { libm::erfc(half.sqrt()) } else { 0.0 };
    let Some(last) = terms.checked_sub(1) else { return rest };
    let largest = (half as usize).min(last);
    let power = |k: usize| first + k as f64;
    let term = (power(largest) * half.ln() - half - libm::lgamma(power(largest) + 1.0)).exp();
    let below = (0..largest).rev().scan(term, |term, k| {
        *term *= power(k + 1) / half;
        Some(*term)
    });
    let above = (largest + 1..terms).scan(term, |term, k| {
        *term *= half / power(k);
        Some(*term)
    });
    (rest + term + below.sum::<f64>() + above.sum::<f64>()).min(1.0)
}

/// Median of the values (the upper one of an even count); 0 for none. The slice is reordered.
pub fn median(values: &mut [f64]) -> f64 {
    if values.is_empty() {
        return 0.0;
    }
    let middle = values.len() / 2;
    *values.select_nth_unstable_by(middle, f64::total_cmp).1
}

/// A standard deviation to be estimated from the data: a half-Cauchy prior of `scale` (Gelman 2006), on a logarithmic grid
/// from `scale / below` to `scale * above`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct VarianceComponent {
    /// Scale of the prior.
    pub scale: f64,
    /// Range below it.
    pub below: f64,
    /// Range above it.
    pub above: f64,
}

/// Steps of the grid.
const STEPS: usize = 48;
/// Steps between the values that are looked at first where a likelihood is dear; halved until what is between them is known.
const FIRST_STRIDE: usize = 8;
/// Error of the logarithm of a likelihood that makes no difference, and how far below the greatest its value has none: e⁻⁴⁰ of all its mass, a million of
/// which, the range of the variance, are nothing still.
const NO_ERROR: f64 = 0.005;
const NO_LIKELIHOOD: f64 = 40.0;
/// A cubic through four values is wrong by the fourth power of their distance.
const ERROR_OF_DOUBLE_STRIDE: f64 = 16.0;

impl VarianceComponent {
    /// The root of the posterior mean of the variance, given the logarithm of the (restricted) likelihood: with few data it
    /// stays wide.
    pub(crate) fn posterior(&self, log_likelihood: impl Fn(f64) -> f64) -> f64 {
        self.likelihood(log_likelihood).posterior()
    }

    /// A likelihood on the grid.
    pub(crate) fn likelihood(&self, log_likelihood: impl Fn(f64) -> f64) -> GridLikelihood<'_> {
        let values = (0..=STEPS).map(|i| log_likelihood(self.sigma(i))).collect();
        GridLikelihood { component: self, values }
    }

    /// The same where values are dear: the likelihood of a variance of many effects is smooth in ln σ (each adds ln(1 + σ² l), without a singularity nearer
    /// than π/2), so that a cubic through four of its values is right where they are near enough, and no value matters far below the greatest.
    pub(crate) fn smooth_likelihood(&self, log_likelihood: impl Fn(f64) -> f64 + Sync) -> GridLikelihood<'_> {
        let of = |nodes: &[usize]| -> Vec<f64> { nodes.par_iter().map(|&i| log_likelihood(self.sigma(i))).collect() };
        let mut values = [0.0; STEPS + 1];
        let mut stride = FIRST_STRIDE;
        let first: Vec<usize> = (0..=STEPS).step_by(stride).collect();
        first.iter().zip(of(&first)).for_each(|(&i, value)| values[i] = value);
        // Error of the cubic at the middle of the interval that each node begins, when last it was looked at.
        let mut errors = [f64::INFINITY; STEPS + 1];
        while stride > 1 {
            let half = stride / 2;
            let middles: Vec<usize> = (half..STEPS).step_by(stride).collect();
            let between = |middle: usize| cubic_between(&values, middle, stride);
            let score = |i: usize, value: f64| value + self.log_prior(i);
            let most = (0..=STEPS).step_by(stride).map(|i| score(i, values[i])).fold(f64::NEG_INFINITY, f64::max);
            let matters = |&middle: &usize| {
                let [a, b] = [middle - half, middle + half].map(|i| score(i, values[i]));
                let nearest = a.max(b).max(score(middle, between(middle)));
                let is_known = errors[middle - half] < ERROR_OF_DOUBLE_STRIDE * NO_ERROR;
                !between(middle).is_finite() || (nearest > most - NO_LIKELIHOOD && !is_known)
            };
            let dear: Vec<usize> = middles.iter().copied().filter(matters).collect();
            let mut next = values;
            middles.iter().for_each(|&middle| next[middle] = between(middle));
            let mut of_halves = errors;
            for &middle in &middles {
                // Where it was not looked at, it is better by what the distance is less.
                let error = errors[middle - half] / ERROR_OF_DOUBLE_STRIDE;
                (of_halves[middle - half], of_halves[middle]) = (error, error);
            }
            for (&middle, value) in dear.iter().zip(of(&dear)) {
                let error = (value - next[middle]).abs();
                next[middle] = value;
                (of_halves[middle - half], of_halves[middle]) = (error, error);
            }
            (values, errors) = (next, of_halves);
            stride = half;
        }
        GridLikelihood { component: self, values: values.to_vec() }
    }

    /// A value of the deviation on the grid.
    fn sigma(&self, i: usize) -> f64 {
        self.scale * self.relative(i)
    }

    fn relative(&self, i: usize) -> f64 {
        let (low, high) = (-self.below.ln(), self.above.ln());
        (low + (high - low) * i as f64 / STEPS as f64).exp()
    }

    /// Logarithm of its prior, in the measure of ln σ.
    fn log_prior(&self, i: usize) -> f64 {
        let relative = self.relative(i);
        -(1.0 + relative * relative).ln() + relative.ln()
    }
}

/// The cubic through the four values nearest to the middle of two, of those a stride apart.
fn cubic_between(values: &[f64; STEPS + 1], middle: usize, stride: usize) -> f64 {
    let half = stride / 2;
    let first = (middle + half).saturating_sub(2 * stride).min(STEPS - 3 * stride);
    let at = (middle - first) as f64 / stride as f64;
    let weight = |k: usize| -> f64 {
        let others = (0..4).filter(|&other| other != k);
        others.map(|other| (at - other as f64) / (k as f64 - other as f64)).product()
    };
    (0..4).map(|k| weight(k) * values[first + k * stride]).sum()
}

/// Logarithms of a likelihood of a standard deviation, on its grid.
pub(crate) struct GridLikelihood<'a> {
    component: &'a VarianceComponent,
    values: Vec<f64>,
}

impl GridLikelihood<'_> {
    /// The root of the posterior mean of the variance.
    pub(crate) fn posterior(&self) -> f64 {
        let of = |(i, value): (usize, &f64)| (self.component.sigma(i), self.component.log_prior(i) + value);
        let scored: Vec<(f64, f64)> =
            self.values.iter().enumerate().map(of).filter(|(_, score)| score.is_finite()).collect();
        let best = scored.iter().map(|s| s.1).fold(f64::NEG_INFINITY, f64::max);
        let (mut mass, mut moment) = (0.0, 0.0);
        for (sigma, score) in &scored {
            let weight = (score - best).exp();
            mass += weight;
            moment += weight * sigma * sigma;
        }
        if mass > 0.0 { (moment / mass).sqrt() } else { self.component.scale }
    }

    /// Logarithm of the mean likelihood over the prior: the evidence, whatever the deviation is.
    pub(crate) fn log_evidence(&self) -> f64 {
        let best = self.values.iter().copied().filter(|l| l.is_finite()).fold(f64::NEG_INFINITY, f64::max);
        let (mut mass, mut sum) = (0.0, 0.0);
        for (i, likelihood) in self.values.iter().enumerate() {
            let prior = self.component.log_prior(i);
            mass += prior.exp();
            sum += (prior + likelihood - best).exp();
        }
        best + (sum / mass).ln()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_have_their_levels() {
        // The square of a normal variable counts both of its sides.
        for (value, dof, level) in [
            (CHI_SQUARED_2_99, 2, 0.01),
            (CHI_SQUARED_2_999, 2, 0.001),
            (CHI_SQUARED_4_999, 4, 0.001),
            (NORMAL_999 * NORMAL_999, 1, 0.002),
        ] {
            assert!((chi_squared_survival(value, dof) / level - 1.0).abs() < 1e-12, "{value}");
        }
        assert!((chi_squared_survival(NORMAL_95 * NORMAL_95, 1) / 0.05 - 1.0).abs() < 1e-9);
        assert!((chi_squared_survival(HUBER_SIGMAS * HUBER_SIGMAS, 1) - 0.0027).abs() < 1e-5);
    }

    #[test]
    fn chi_squared_survival_agrees_with_tables() {
        for (value, dof, expected) in [
            (3.841_459, 1, 0.05),
            (5.991_465, 2, 0.05),
            (7.814_728, 3, 0.05),
            (11.344_867, 3, 0.01),
            (18.307_038, 10, 0.05),
            (24.995_79, 15, 0.05),
        ] {
            assert!((chi_squared_survival(value, dof) - expected).abs() < 1e-6, "{value} {dof}");
        }
        assert!((chi_squared_2_quantile(0.05) - 5.991_464_5).abs() < 1e-6);
    }

    /// With many degrees of freedom the cube root is normal (Wilson & Hilferty 1931), to about 1e-3 of a probability.
    #[test]
    fn many_degrees_of_freedom_leave_chi_squared_its_distribution() {
        for dof in [999, 1_000, 2_361, 2_362, 50_001, 400_000] {
            let n = dof as f64;
            for z in [-3.0, -1.0, 0.0, 1.0, 3.0] {
                let value = n * (1.0 - 2.0 / (9.0 * n) + z * (2.0 / (9.0 * n)).sqrt()).powi(3);
                let expected = 0.5 * libm::erfc(z / std::f64::consts::SQRT_2);
                let found = chi_squared_survival(value, dof);
                assert!((found - expected).abs() < 2e-4, "{dof} {z}: {found} {expected}");
            }
        }
    }

    #[test]
    fn evidence_of_a_deviation_is_the_mean_of_its_likelihood() {
        let component = VarianceComponent { scale: 0.1, below: 30.0, above: 50.0 };
        // A likelihood that does not depend on it, and one so steep that a single value of the grid counts.
        assert!((component.likelihood(|_| -7.5).log_evidence() + 7.5).abs() < 1e-12);
        let told =
            component.likelihood(|sigma| if (sigma / 0.1f64).ln().abs() < 0.05 { 0.0 } else { -1e4 }).log_evidence();
        let chance = told.exp();
        assert!(chance > 0.01 && chance < 0.1, "one step of 48, where the prior is greatest: {chance}");
    }

    /// Effects whose deviation is far within what the data tell, about it and far below, and few or thousands of them.
    #[test]
    fn a_likelihood_that_is_dear_is_known_from_fewer_values() {
        let component = VarianceComponent { scale: 0.1, below: 30.0, above: 50.0 };
        for count in [101, 500, 4000] {
            for truth in [0.002, 0.03, 0.1, 1.5] {
                let log_likelihood = |sigma: f64| -> f64 {
                    let of = |k: usize| {
                        // Informations over four orders of magnitude, squares that are their expectation.
                        let l = 10f64.powf(1.0 + 4.0 * k as f64 / count as f64);
                        let squared = l + truth * truth * l * l;
                        let variance = sigma * sigma;
                        0.5 * (variance * squared / (1.0 + variance * l) - (variance * l).ln_1p())
                    };
                    (0..count).map(of).sum()
                };
                let looked_at = std::sync::atomic::AtomicUsize::new(0);
                let counted = |sigma: f64| {
                    looked_at.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
                    log_likelihood(sigma)
                };
                let (all, some) = (component.likelihood(log_likelihood), component.smooth_likelihood(counted));
                assert!((some.posterior() / all.posterior() - 1.0).abs() < 0.002, "{count} {truth}");
                assert!((some.log_evidence() - all.log_evidence()).abs() < 0.02, "{count} {truth}");
                let looked_at = looked_at.into_inner();
                assert!(looked_at <= 28, "{count} {truth}: {looked_at} of 49");
            }
        }
    }

    #[test]
    fn truncated_mean_by_quadrature() {
        let limit = 9.21;
        let n = 200_000;
        let (mut mass, mut moment) = (0.0, 0.0);
        for i in 0..n {
            let x = (i as f64 + 0.5) * limit / n as f64;
            mass += (-0.5 * x).exp();
            moment += x * (-0.5 * x).exp();
        }
        assert!((chi_squared_2_mean_below(limit) - moment / mass).abs() < 1e-6);
    }
}
