//! One robust loop for every model fitted to data with outliers.
//!
//! Random minimal samples, MAGSAC++ scoring (Barath, Noskova, Ivashechkin & Matas, CVPR 2020: the noise scale is
//! marginalised up to a largest one, so no inlier threshold has to be right), local optimisation of every new best model
//! by re-weighted least squares (Chum, Matas & Kittler 2003), and a number of trials from the exact probability that a
//! sample drawn without replacement is all inliers.

use std::sync::OnceLock;

use rand::{Rng, RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

use crate::{numerics::statistics::CHI_SQUARED_2_99, observer::Observer};

/// What the loop asks of a model.
pub(crate) trait RobustProblem {
    /// The model.
    type Model: Clone;
    /// Data in a minimal sample.
    const SAMPLE_SIZE: usize;
    /// Number of data.
    fn len(&self) -> usize;
    /// The model through a minimal sample; `None` when the sample is degenerate.
    fn minimal(&self, sample: &[usize]) -> Option<Self::Model>;
    /// Squared residual of one datum in units of the largest noise variance; two degrees of freedom.
    fn squared_residual(&self, model: &Self::Model, index: usize) -> f64;
    /// A better model from weighted data; `None` when it cannot be had.
    fn refit(&self, model: &Self::Model, weights: &[f64]) -> Option<Self::Model>;
}

/// Options of `search_until`.
#[derive(Debug, Clone, Copy)]
pub(crate) struct RansacOptions {
    /// Probability of having drawn an all-inlier sample when the loop ends.
    pub confidence: f64,
    /// Least number of trials.
    pub min_trials: usize,
    /// Most trials.
    pub max_trials: usize,
    /// Rounds of re-weighted least squares for each new best model.
    pub local_iterations: usize,
    /// Seed of the random samples.
    pub seed: u64,
}

impl Default for RansacOptions {
    fn default() -> Self {
        Self { confidence: 0.9999, min_trials: 50, max_trials: 4000, local_iterations: 4, seed: 0 }
    }
}

/// The best model and how it was found.
#[derive(Debug, Clone)]
pub(crate) struct RansacOutput<M> {
    /// The best model.
    pub model: M,
    /// Sum of losses, 0 (perfect) to the number of data.
    #[cfg_attr(not(test), allow(dead_code))]
    pub cost: f64,
    /// Data within the largest noise scale's 99 % bound.
    pub inliers: Vec<usize>,
}

/// The squared residual, in units of the largest noise variance, beyond which a datum is an outlier at every scale.
pub(crate) const OUTLIER_SQUARED: f64 = CHI_SQUARED_2_99;

/// Loss and weight of MAGSAC++ for residuals of two degrees of freedom, tabulated.
///
/// w(s) ∝ Γ(1/2, s/2) - Γ(1/2, k²/2), loss = ∫ w ds / 2, scaled to reach 1 at s = k².
struct Magsac {
    loss: Vec<f64>,
    weight: Vec<f64>,
}

impl Magsac {
    const CELLS: usize = 2048;

    /// The one table there is.
    fn table() -> &'static Self {
        static TABLE: OnceLock<Magsac> = OnceLock::new();
        TABLE.get_or_init(Self::new)
    }

    fn new() -> Self {
        let gamma_half = |x: f64| std::f64::consts::PI.sqrt() * libm::erfc(x.sqrt());
        let gamma_three_halves = |x: f64| 0.5 * gamma_half(x) + x.sqrt() * (-x).exp();
        let end = OUTLIER_SQUARED / 2.0;
        let floor = gamma_half(end);
        let integral = |x: f64| x * gamma_half(x) + gamma_three_halves(0.0) - gamma_three_halves(x) - x * floor;
        let total = integral(end);
        let peak = gamma_half(0.0) - floor;
        let at = |cell: usize| end * cell as f64 / Self::CELLS as f64;
        Self {
            loss: (0..=Self::CELLS).map(|c| integral(at(c)) / total).collect(),
            weight: (0..=Self::CELLS).map(|c| (gamma_half(at(c)) - floor) / peak).collect(),
        }
    }

    #[inline]
    fn cell(squared: f64) -> Option<usize> {
        (squared < OUTLIER_SQUARED).then(|| (squared * (Self::CELLS as f64 / OUTLIER_SQUARED) + 0.5) as usize)
    }

    #[inline]
    fn loss(&self, squared: f64) -> f64 {
        Self::cell(squared).map_or(1.0, |c| self.loss[c])
    }

    #[inline]
    fn weight(&self, squared: f64) -> f64 {
        Self::cell(squared).map_or(0.0, |c| self.weight[c])
    }
}

/// The number of trials after which a sample of `size` out of `n` without an outlier has been drawn with probability
/// `confidence`, when `inliers` of the `n` are good; exact for sampling without replacement.
pub(crate) fn required_trials(inliers: usize, n: usize, size: usize, confidence: f64) -> usize {
    if inliers < size || n < size {
        return usize::MAX;
    }
    let all_good: f64 = (0..size).map(|i| (inliers - i) as f64 / (n - i) as f64).product();
    if all_good >= 1.0 - 1e-12 {
        return 1;
    }
    let trials = (1.0 - confidence).ln() / (-all_good).ln_1p();
    if trials.is_finite() && trials < usize::MAX as f64 { trials.ceil().max(1.0) as usize } else { usize::MAX }
}

/// Data on which models are compared: a share of good data of one half is then known to a third of a per cent. Of more data a random
/// part serves, so that the time of a search does not grow without bound.
const MAX_SCORED: usize = 20_000;

/// Trials between two questions whether to stop.
const TRIALS_BETWEEN_STOPS: usize = 16;

/// Search for the model with the least cost; `None` when there are too few data, every sample was degenerate, or the observer says stop.
pub(crate) fn search_until<P: RobustProblem>(
    problem: &P,
    options: &RansacOptions,
    observer: &dyn Observer,
) -> Option<RansacOutput<P::Model>> {
    let n = problem.len();
    let size = P::SAMPLE_SIZE;
    if n < size {
        return None;
    }
    let magsac = Magsac::table();
    let mut rng = Pcg64Mcg::seed_from_u64(options.seed);
    // Scored in random order, so that a wrong model shows early whatever the order of the data.
    let mut order: Vec<usize> = (0..n).collect();
    for i in (1..n).rev() {
        order.swap(i, rng.random_range(0..=i));
    }
    let rest = order.split_off(n.min(MAX_SCORED));
    let score = |model: &P::Model, give_up: f64| -> Option<(f64, usize)> {
        let (mut cost, mut inliers) = (0.0, 0);
        for chunk in order.chunks(64) {
            for &i in chunk {
                let squared = problem.squared_residual(model, i);
                inliers += usize::from(squared < OUTLIER_SQUARED);
                cost += magsac.loss(squared);
            }
            if cost >= give_up {
                return None;
            }
        }
        Some((cost, inliers))
    };
    let mut best: Option<(P::Model, f64, usize)> = None;
    let mut sample = vec![0; size];
    // Zero for what is not scored.
    let mut weights = vec![0.0; n];
    let mut needed = options.max_trials;
    let mut trials = 0;
    while trials < needed.max(options.min_trials).min(options.max_trials) {
        if trials.is_multiple_of(TRIALS_BETWEEN_STOPS) && observer.stopped() {
            return None;
        }
        trials += 1;
        draw(&mut rng, n, &mut sample);
        let Some(model) = problem.minimal(&sample) else { continue };
        let bound = best.as_ref().map_or(f64::INFINITY, |b| b.1);
        let Some((mut cost, mut inliers)) = score(&model, bound) else { continue };
        let mut model = model;
        for _ in 0..options.local_iterations {
            for &i in &order {
                weights[i] = magsac.weight(problem.squared_residual(&model, i));
            }
            let Some(better) = problem.refit(&model, &weights) else { break };
            let Some((new_cost, new_inliers)) = score(&better, cost) else { break };
            (model, cost, inliers) = (better, new_cost, new_inliers);
        }
        needed = required_trials(inliers, order.len(), size, options.confidence);
        best = Some((model, cost, inliers));
    }
    let (mut model, mut cost, _) = best?;
    if !rest.is_empty() {
        (model, cost) = on_all(problem, options, model, magsac);
    }
    let inliers = (0..n).filter(|&i| problem.squared_residual(&model, i) < OUTLIER_SQUARED).collect();
    Some(RansacOutput { model, cost, inliers })
}

/// A model found on a part of the data, improved on all of them, and its cost there.
fn on_all<P: RobustProblem>(
    problem: &P,
    options: &RansacOptions,
    mut model: P::Model,
    magsac: &Magsac,
) -> (P::Model, f64) {
    let squared =
        |model: &P::Model| (0..problem.len()).map(|i| problem.squared_residual(model, i)).collect::<Vec<f64>>();
    let cost_of = |squared: &[f64]| squared.iter().map(|s| magsac.loss(*s)).sum::<f64>();
    let mut residuals = squared(&model);
    let mut cost = cost_of(&residuals);
    for _ in 0..options.local_iterations {
        let weights: Vec<f64> = residuals.iter().map(|s| magsac.weight(*s)).collect();
        let Some(better) = problem.refit(&model, &weights) else { break };
        residuals = squared(&better);
        let new = cost_of(&residuals);
        if new >= cost {
            break;
        }
        (model, cost) = (better, new);
    }
    (model, cost)
}

/// Distinct indices below `n`.
fn draw(rng: &mut impl Rng, n: usize, sample: &mut [usize]) {
    for i in 0..sample.len() {
        loop {
            let candidate = rng.random_range(0..n);
            if !sample[..i].contains(&candidate) {
                sample[i] = candidate;
                break;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A line y = m x + c through points with outliers, which counts how often it is asked.
    struct Line(Vec<(f64, f64)>, std::cell::Cell<usize>);

    impl RobustProblem for Line {
        type Model = (f64, f64);
        const SAMPLE_SIZE: usize = 2;
        fn len(&self) -> usize {
            self.0.len()
        }
        fn minimal(&self, s: &[usize]) -> Option<Self::Model> {
            let (p, q) = (self.0[s[0]], self.0[s[1]]);
            let m = (q.1 - p.1) / (q.0 - p.0);
            m.is_finite().then_some((m, p.1 - m * p.0))
        }
        fn squared_residual(&self, m: &Self::Model, i: usize) -> f64 {
            self.1.set(self.1.get() + 1);
            (self.0[i].1 - m.0 * self.0[i].0 - m.1).powi(2)
        }
        fn refit(&self, _: &Self::Model, _: &[f64]) -> Option<Self::Model> {
            None
        }
    }

    #[test]
    fn a_line_among_outliers_and_the_same_every_time() {
        let points: Vec<_> = (0..100)
            .map(|i| {
                let x = i as f64;
                if i % 5 < 3 { (x, 37.0 * (x * 1.7).sin() * 10.0) } else { (x, 2.0 * x + 1.0 + 0.1 * (x * 3.1).sin()) }
            })
            .collect();
        let line = Line(points, Default::default());
        let first = search_until(&line, &RansacOptions::default(), &crate::observer::Silent).expect("a line");
        assert!((first.model.0 - 2.0).abs() < 0.01 && first.inliers.len() >= 40, "{first:?}");
        let again = search_until(&line, &RansacOptions::default(), &crate::observer::Silent).expect("a line");
        assert_eq!(first.model, again.model);
    }

    #[test]
    fn very_many_data_take_no_more_trials_on_all_of_them() {
        let asked = |count: usize, good: bool| {
            let scattered = |i: usize| (i as f64, 1e6 * (i as f64 * 1.7).sin());
            let point =
                |i: usize| if good && i.is_multiple_of(2) { (i as f64, 2.0 * i as f64 + 1.0) } else { scattered(i) };
            let line = Line((0..count).map(point).collect(), Default::default());
            let found = search_until(&line, &RansacOptions::default(), &crate::observer::Silent).expect("a line");
            if good {
                assert!((found.model.0 - 2.0).abs() < 1e-6 && found.inliers.len() >= count / 2, "{:?}", found.model);
                // The cost is that of all: every outlier counts one.
                assert!((found.cost / (count / 2) as f64 - 1.0).abs() < 1e-3, "{}", found.cost);
            }
            line.1.get()
        };
        for good in [true, false] {
            let (few, many) = (asked(2 * MAX_SCORED, good), asked(20 * MAX_SCORED, good));
            // Beyond the trials, a few looks at each datum.
            assert!(many < few + 20 * MAX_SCORED * 8, "{few}, {many}");
        }
    }

    #[test]
    fn trials_without_replacement() {
        // 4 of 5 are good, samples of 4: one of the C(5,4) = 5 is clean.
        let p: f64 = 1.0 / 5.0;
        assert_eq!(required_trials(4, 5, 4, 0.99), ((0.01f64).ln() / (1.0 - p).ln()).ceil() as usize);
        assert_eq!(required_trials(5, 5, 4, 0.99), 1);
        assert_eq!(required_trials(3, 5, 4, 0.99), usize::MAX);
    }

    #[test]
    fn the_loss_rises_from_zero_to_one_and_the_weight_falls() {
        let m = Magsac::table();
        assert_eq!(m.loss[0], 0.0);
        assert!((m.loss[Magsac::CELLS] - 1.0).abs() < 1e-12);
        assert!(m.loss.windows(2).all(|w| w[1] >= w[0]) && m.weight.windows(2).all(|w| w[1] <= w[0]));
    }
}
