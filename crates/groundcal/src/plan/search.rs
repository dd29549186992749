//! The choice of motions: greedy, then exchanges (Fedorov 1972, *Theory of Optimal Experiments*).

use crate::plan::candidate::{CameraMatrix, Candidate, Free, inverse_free, ln_f_variance};

/// Relative gain in the standard deviation of f for which a less simple motion is taken, and for which one is exchanged; with less
/// further motions are not worth the pictures (two are made in any case, so that one checks the other). Pictures cost minutes, and an error bar is
/// itself known to some per cent (with 20 degrees of freedom to 16 %).
pub(super) const MIN_RELATIVE_GAIN: f64 = 0.01;
/// Information of every number (frame units) while nothing else tells it, so that a first motion can be judged at all.
const WEAK_PRIOR_INFORMATION: f64 = 1.0;
/// Rounds of exchanges.
const ROUNDS: usize = 10;

struct Search<'a> {
    candidates: &'a [Candidate],
    free: &'a Free,
}

impl Search<'_> {
    /// Standard deviation of ln f.
    fn sigma(&self, information: &CameraMatrix) -> f64 {
        inverse_free(information, self.free).map_or(f64::INFINITY, |c| ln_f_variance(&c).max(0.0).sqrt())
    }

    /// The candidate that helps most; among those as good to within [`MIN_RELATIVE_GAIN`] the simplest, which comes first.
    fn best(&self, information: &CameraMatrix, among: &[usize]) -> Option<(usize, f64)> {
        let sigmas: Vec<f64> =
            among.iter().map(|&i| self.sigma(&(information + self.candidates[i].information))).collect();
        let least = sigmas.iter().copied().fold(f64::INFINITY, f64::min);
        let at = sigmas.iter().position(|s| *s <= least * (1.0 + MIN_RELATIVE_GAIN))?;
        Some((among[at], sigmas[at]))
    }

    /// One after the other.
    fn greedy(&self, base: &CameraMatrix, among: &[usize], count: usize, again: bool) -> Vec<usize> {
        let (mut left, mut sum, mut chosen) = (among.to_vec(), *base, Vec::new());
        while chosen.len() < count {
            let Some((i, _)) = self.best(&sum, &left) else { break };
            sum += self.candidates[i].information;
            chosen.push(i);
            if !again && let Some(at) = left.iter().position(|&j| j == i) {
                left.remove(at);
            }
        }
        chosen
    }
}

/// Indices of the candidates chosen (one may come more than once), the most useful first. With `exchange` the set is improved as a
/// whole; without, each is the best next one.
pub(super) fn choose(
    candidates: &[Candidate],
    base: &CameraMatrix,
    free: &Free,
    count: usize,
    exchange: bool,
) -> Vec<usize> {
    let search = Search { candidates, free };
    let base = base
        + CameraMatrix::from_diagonal(&nalgebra::SVector::from_fn(|i, _| {
            if base[(i, i)] == 0.0 && free[i] { WEAK_PRIOR_INFORMATION } else { 0.0 }
        }));
    let all: Vec<usize> = (0..candidates.len()).collect();
    let mut chosen = search.greedy(&base, &all, count, true);
    if !exchange {
        return chosen;
    }
    let total = |chosen: &[usize]| base + chosen.iter().map(|&i| candidates[i].information).sum::<CameraMatrix>();
    for _ in 0..ROUNDS {
        let mut changed = false;
        for at in 0..chosen.len() {
            let now = search.sigma(&total(&chosen));
            let without = total(&chosen) - candidates[chosen[at]].information;
            if let Some((i, sigma)) = search.best(&without, &all)
                && sigma < now * (1.0 - MIN_RELATIVE_GAIN)
            {
                chosen[at] = i;
                changed = true;
            }
        }
        if !changed {
            break;
        }
    }
    search.greedy(&base, &chosen, count, false)
}
