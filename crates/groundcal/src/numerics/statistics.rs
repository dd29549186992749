//! The few distributions the estimators need.
//!
//! ```text
//! P(χ²₂ₘ > x)   = exp(-x/2) Σ_{k<m} (x/2)ᵏ / k!                        P(χ²₂ > x) = p at x = -2 ln p
//! P(χ²₂ₘ₊₁ > x) = erfc(√(x/2)) + √(2x/π) exp(-x/2) Σ_{k<m} xᵏ / (3 · 5 ⋯ (2k + 1))         (Abramowitz & Stegun 26.4.4, 26.4.5)
//! E(χ²₂ | χ²₂ < c) = 2 - c exp(-c/2) / (1 - exp(-c/2))
//! σ̂² = Σ σ² L p / Σ L p,     p(σ) dσ ∝ σ / (1 + (σ / scale)²) d ln σ     over a grid of ln σ                          (Gelman 2006)
//! ```

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

impl VarianceComponent {
    /// The root of the posterior mean of the variance, given the logarithm of the (restricted) likelihood: with few data it
    /// stays wide.
    pub(crate) fn posterior(&self, log_likelihood: impl Fn(f64) -> f64) -> f64 {
        let scored: Vec<(f64, f64)> = self
            .grid()
            .map(|(sigma, prior)| (sigma, prior + log_likelihood(sigma)))
            .filter(|(_, score)| score.is_finite())
            .collect();
        let best = scored.iter().map(|s| s.1).fold(f64::NEG_INFINITY, f64::max);
        let (mut mass, mut moment) = (0.0, 0.0);
        for (sigma, score) in &scored {
            let weight = (score - best).exp();
            mass += weight;
            moment += weight * sigma * sigma;
        }
        if mass > 0.0 { (moment / mass).sqrt() } else { self.scale }
    }

    /// Logarithm of the mean likelihood over the prior: the evidence, whatever the deviation is.
    pub(crate) fn log_evidence(&self, log_likelihood: impl Fn(f64) -> f64) -> f64 {
        let scored: Vec<(f64, f64)> = self.grid().map(|(sigma, prior)| (prior, log_likelihood(sigma))).collect();
        let best = scored.iter().map(|s| s.1).filter(|l| l.is_finite()).fold(f64::NEG_INFINITY, f64::max);
        let (mut mass, mut sum) = (0.0, 0.0);
        for (prior, likelihood) in scored {
            mass += prior.exp();
            sum += (prior + likelihood - best).exp();
        }
        best + (sum / mass).ln()
    }

    /// Values of the deviation with the logarithm of their prior, in the measure of ln σ.
    fn grid(&self) -> impl Iterator<Item = (f64, f64)> {
        const STEPS: i32 = 48;
        let (low, high, scale) = (-self.below.ln(), self.above.ln(), self.scale);
        (0..=STEPS).map(move |i| {
            let relative = (low + (high - low) * f64::from(i) / f64::from(STEPS)).exp();
            (scale * relative, -(1.0 + relative * relative).ln() + relative.ln())
        })
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
        assert!((component.log_evidence(|_| -7.5) + 7.5).abs() < 1e-12);
        let told = component.log_evidence(|sigma| if (sigma / 0.1f64).ln().abs() < 0.05 { 0.0 } else { -1e4 });
        let chance = told.exp();
        assert!(chance > 0.01 && chance < 0.1, "one step of 48, where the prior is greatest: {chance}");
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
