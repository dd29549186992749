//! Many random effects with a common variance: their likelihood from the sparse equations of all unknowns, factored once for each variance.
//!
//! ```text
//! A(σ) = A0 + Σ_e c_e c_eᵀ / σ²,   g(σ) = Σ_e s_e v_e (1/σ0² - 1/σ²) c_e
//! ln L(σ) = ½ gᵀ A⁻¹ g - ½ Σ_e v_e² / σ² - ½ ln |A(σ)| - n ln σ + const
//! ```
//!
//! A0: information of all columns without the prior of the effects; e: an effect of value v_e at the solution under σ0, to which s_e times the step of
//! column c_e adds. Eigenvalues of what is left when all else is eliminated, which is how few effects are treated, cost the cube of their number; this
//! grows with it. Where the cameras alone connect the motions, all but the effects and the cameras is eliminated once ([`crate::refine::effects_by_parts`]).

use std::{
    collections::BTreeMap,
    sync::{Mutex, PoisonError},
};

use nalgebra::DVector;

use crate::{
    numerics::skyline::Skyline,
    refine::{
        effects_by_parts::{EffectsByParts, Solved},
        problem::{MIN_PRIOR_SIGMA, RandomEffect},
    },
};

/// Step of ln σ for derivatives.
const STEP: f64 = 0.05;
/// Standard deviation beyond which nothing is known of an effect: of angles, 20 degrees.
pub(crate) const MAX_KNOWN_SIGMA: f64 = 0.354;

/// The effects, and the equations of all unknowns without their prior.
pub(crate) struct ManyEffects<'a> {
    effects: &'a [RandomEffect],
    information: Skyline,
    in_force: f64,
    /// The same by the parts that the cameras alone connect, where these are small.
    parts: Option<EffectsByParts>,
    /// What was found for a σ.
    known: Mutex<BTreeMap<u64, Option<Fit>>>,
}

/// Half of chi-squared, and ln |A|.
#[derive(Debug, Clone, Copy)]
struct Fit {
    cost: f64,
    log_determinant: f64,
}

impl<'a> ManyEffects<'a> {
    /// From the information of all columns at a solution under a prior of standard deviation `sigma`; those of cameras begin at a column.
    pub(crate) fn new(effects: &'a [RandomEffect], information: &Skyline, sigma: f64, first_of_cameras: usize) -> Self {
        let in_force = sigma.max(MIN_PRIOR_SIGMA);
        let mut without = information.clone();
        effects.iter().for_each(|e| without.add(e.column, e.column, -1.0 / (in_force * in_force)));
        let parts = EffectsByParts::new(effects, &without, first_of_cameras);
        Self { effects, information: without, in_force, parts, known: Mutex::default() }
    }

    fn fit(&self, sigma: f64) -> Option<Fit> {
        let sigma = sigma.max(MIN_PRIOR_SIGMA);
        let known = || self.known.lock().unwrap_or_else(PoisonError::into_inner);
        let found = known().get(&sigma.to_bits()).copied();
        found.unwrap_or_else(|| {
            let fit = self.factored(sigma);
            known().insert(sigma.to_bits(), fit);
            fit
        })
    }

    fn factored(&self, sigma: f64) -> Option<Fit> {
        let weight = 1.0 / (sigma * sigma);
        let change = 1.0 / (self.in_force * self.in_force) - weight;
        let solved = match &self.parts {
            Some(parts) => parts.solved(weight, change)?,
            None => Self::whole(self.effects, &self.information, weight, change)?,
        };
        let squares: f64 = self.effects.iter().map(|e| e.value * e.value * weight).sum();
        Some(Fit { cost: 0.5 * (squares - solved.explained), log_determinant: solved.log_determinant })
    }

    /// The equations with the inverse variance of the effects, and what that in force is larger by.
    pub(super) fn whole(effects: &[RandomEffect], without: &Skyline, weight: f64, change: f64) -> Option<Solved> {
        let mut information = without.clone();
        let mut right = DVector::zeros(information.size());
        for e in effects {
            information.add(e.column, e.column, weight);
            right[e.column] += e.sign * e.value * change;
        }
        let factor = information.cholesky(0.0)?;
        Some(Solved { explained: right.dot(&factor.solve(&right)), log_determinant: factor.log_determinant() })
    }

    /// Logarithm of the likelihood of a standard deviation, all else being profiled out, but for a constant.
    pub(crate) fn log_likelihood(&self, sigma: f64) -> f64 {
        let n = self.effects.len() as f64;
        let of = |fit: Fit| -fit.cost - 0.5 * fit.log_determinant - n * sigma.max(MIN_PRIOR_SIGMA).ln();
        self.fit(sigma).map_or(f64::NEG_INFINITY, of)
    }

    /// How many directions of the effects the data see better than a prior of this standard deviation does.
    pub(crate) fn directions(&self, sigma: f64) -> f64 {
        let determinant = |factor: f64| self.fit(sigma * factor).map(|fit| fit.log_determinant);
        let slope = determinant(STEP.exp()).zip(determinant((-STEP).exp())).map(|(a, b)| (a - b) / (2.0 * STEP));
        slope.map_or(0.0, |slope| self.effects.len() as f64 + 0.5 * slope)
    }

    /// Chi-squared of the effects for a given standard deviation.
    pub(crate) fn chi_squared(&self, sigma: f64) -> f64 {
        let costs = self.fit(sigma).zip(self.fit(MAX_KNOWN_SIGMA));
        costs.map_or(0.0, |(fit, free)| 2.0 * (fit.cost - free.cost)).max(0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Three parts of four columns, of which two are effects, one of none, and two columns of a camera.
    #[test]
    fn parts_have_the_likelihood_of_the_whole() {
        let first = vec![0, 0, 0, 0, 4, 4, 4, 4, 8, 8, 8, 8, 12, 0, 0];
        let size = first.len();
        let mut information = Skyline::zeros(first.clone());
        for (row, &first) in first.iter().enumerate() {
            for column in first..=row {
                let value =
                    if row == column { 900.0 + row as f64 } else { 50.0 * ((3 * row + 7 * column) as f64).sin() };
                information.add(row, column, value);
            }
        }
        let effect = |column: usize| RandomEffect {
            column,
            sign: if column.is_multiple_of(4) { 1.0 } else { -1.0 },
            value: 0.1 * (column as f64).cos(),
        };
        let effects: Vec<RandomEffect> = [0, 2, 4, 6, 8, 10].map(effect).into();
        let parts = EffectsByParts::new(&effects, &information, size - 2).expect("determined");
        for (weight, change) in [(1.0, 3.0), (2e4, -0.5), (1e-6, 10.0)] {
            let (ours, whole) =
                (parts.solved(weight, change), ManyEffects::whole(&effects, &information, weight, change));
            let (ours, whole) = ours.zip(whole).expect("determined");
            assert!((ours.explained - whole.explained).abs() < 1e-12 * whole.explained, "{ours:?} {whole:?}");
            assert!((ours.log_determinant - whole.log_determinant).abs() < 1e-11, "{ours:?} {whole:?}");
        }
    }
}
