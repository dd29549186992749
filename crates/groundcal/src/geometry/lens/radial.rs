//! The odd polynomial of radial lens models, its first fold and its inverse.
//!
//! ```text
//! f(r) = r (1 + a1 r² + a2 r⁴ + ...),      f'(r) = 1 + 3 a1 r² + 5 a2 r⁴ + ...
//! ```
//!
//! f is one to one from 0 to the first root of f'. Further out it may rise again and show what lies far to the side in the
//! middle of the image.

/// Steps of the inversion: Newton's method needs about five, bisection 60.
const MAX_STEPS: usize = 120;

/// f, by a1, a2, ...
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct OddPolynomial<const N: usize>(pub(super) [f64; N]);

impl<const N: usize> OddPolynomial<N> {
    /// f(r) / r, by r².
    pub(super) fn factor(&self, r2: f64) -> f64 {
        1.0 + r2 * self.0.iter().rev().fold(0.0, |sum, a| a + r2 * sum)
    }

    /// f'(r), by r².
    pub(super) fn slope(&self, r2: f64) -> f64 {
        let terms = self.0.iter().enumerate().rev();
        1.0 + r2 * terms.fold(0.0, |sum, (i, a)| (2 * i + 3) as f64 * a + r2 * sum)
    }

    /// Derivative of f(r) / r by r².
    pub(super) fn factor_slope(&self, r2: f64) -> f64 {
        self.0.iter().enumerate().rev().fold(0.0, |sum, (i, a)| (i + 1) as f64 * a + r2 * sum)
    }

    /// The first root of f', infinite where there is none.
    pub(super) fn fold(&self) -> f64 {
        // 1 + c1 s + c2 s² + ..., s = r².
        let mut slope = self.0;
        for (i, c) in slope.iter_mut().enumerate() {
            *c *= (2 * i + 3) as f64;
        }
        let degree = slope.iter().rposition(|c| *c != 0.0).map_or(0, |last| last + 1);
        let s = match slope[..degree] {
            [] => f64::INFINITY,
            [c1] => {
                if c1 < 0.0 {
                    -1.0 / c1
                } else {
                    f64::INFINITY
                }
            }
            [c1, c2] => {
                let discriminant = c1 * c1 - 4.0 * c2;
                match (c1 < 0.0, c2 < 0.0) {
                    (true, _) if discriminant >= 0.0 => 2.0 / (discriminant.sqrt() - c1),
                    (false, true) => (c1 + discriminant.sqrt()) / (-2.0 * c2),
                    _ => f64::INFINITY,
                }
            }
            // In 1/s the polynomial is monic, and the first root the largest.
            _ => {
                let monic: Vec<f64> = slope[..degree].iter().rev().copied().chain([1.0]).collect();
                let bound = 1.0 + monic.iter().fold(0.0, |most: f64, c| most.max(c.abs()));
                positive_roots(&monic, bound).last().map_or(f64::INFINITY, |t| t.recip())
            }
        };
        s.sqrt()
    }

    /// The r from 0 to `max`, at most the fold, with f(r) = `value`; `None` where there is none. Newton's method within a bracket.
    pub(super) fn inverse(&self, value: f64, max: f64) -> Option<f64> {
        let f = |r: f64| r * self.factor(r * r);
        if value == 0.0 {
            return Some(0.0);
        }
        let reached = value > 0.0 && value.is_finite() && !(max.is_finite() && f(max) <= value);
        if !reached {
            return None;
        }
        let (mut low, mut high) = (0.0, max);
        let (mut r, mut last_step) = (if value < max { value } else { 0.5 * max }, f64::INFINITY);
        for _ in 0..MAX_STEPS {
            let residual = f(r) - value;
            if residual > 0.0 {
                high = r;
            } else {
                low = r;
            }
            let step = residual / self.slope(r * r);
            let next = r - step;
            if step.abs() <= 1e-12 * r {
                return Some(next.clamp(low, high));
            }
            // Steps that do not halve are those of a start far out, where halving the bracket is faster.
            let good = next > low && next < high && step.abs() <= 0.5 * last_step;
            r = match (good, high.is_finite()) {
                (true, _) => next,
                (false, true) => 0.5 * (low + high),
                (false, false) => 2.0 * r,
            };
            last_step = if good { step.abs() } else { f64::INFINITY };
            if high.is_finite() && high - low <= 2.0 * f64::EPSILON * high {
                break;
            }
        }
        // Close to the fold, where rounding hides the slope, the bracket ends the search.
        ((f(r) - value).abs() <= 1e-10 * (1.0 + value)).then_some(r)
    }
}

/// The roots between 0 and `bound` at which a polynomial (lowest coefficient first) changes its sign, ascending: between each two
/// of its extrema there is one at most.
fn positive_roots(polynomial: &[f64], bound: f64) -> Vec<f64> {
    let value = |t: f64| polynomial.iter().rev().fold(0.0, |sum, c| c + t * sum);
    if polynomial.len() < 2 {
        return Vec::new();
    }
    let derivative: Vec<f64> = polynomial.iter().enumerate().skip(1).map(|(i, c)| i as f64 * c).collect();
    let mut ends = vec![0.0];
    ends.extend(positive_roots(&derivative, bound));
    ends.push(bound);
    let between = |ends: &[f64]| {
        let (mut low, mut high) = (ends[0], ends[1]);
        let rising = value(high) > 0.0;
        if (value(low) > 0.0) == rising {
            return None;
        }
        loop {
            let middle = 0.5 * (low + high);
            if middle <= low || middle >= high {
                return Some(middle);
            }
            if (value(middle) > 0.0) == rising {
                high = middle;
            } else {
                low = middle;
            }
        }
    };
    ends.windows(2).filter_map(between).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_fold_is_the_first_of_several() {
        // f' = (1 - s)(1 - s/2)(1 - s/3)(1 - s/4) expanded by hand: roots s = 1, 2, 3, 4.
        let slope = [-25.0 / 12.0, 35.0 / 24.0, -10.0 / 24.0, 1.0 / 24.0];
        let p = OddPolynomial([slope[0] / 3.0, slope[1] / 5.0, slope[2] / 7.0, slope[3] / 9.0]);
        assert!((p.fold() - 1.0).abs() < 1e-12);
        assert!((OddPolynomial([-1.2, 0.5, 0.0]).fold() - OddPolynomial([-1.2, 0.5, 1e-12]).fold()).abs() < 1e-9);
        assert!((OddPolynomial([-1.0 / 3.0]).fold() - 1.0).abs() < 1e-15);
        for never in [[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [-0.25, 0.05, 0.0], [0.1, 0.01, 0.02], [-0.1, 0.1, 0.1]] {
            assert_eq!(OddPolynomial(never).fold(), f64::INFINITY, "{never:?}");
        }
        assert!(OddPolynomial([0.1, 0.1, -1e-9]).fold().is_finite());
    }

    #[test]
    fn the_inverse_is_found_up_to_the_fold_and_not_beyond() {
        for a in [[-0.4, 0.05, 0.0], [-0.2, 0.0, 0.0], [0.1, -0.05, 0.02], [-0.25, 0.05, 0.0], [5.0, 3.0, 8.0]] {
            let p = OddPolynomial(a);
            let (fold, f) = (p.fold(), |r: f64| r * p.factor(r * r));
            let end = fold.min(50.0);
            for i in 0..200 {
                let r = 0.99 * end * f64::from(i) / 199.0;
                let found = p.inverse(f(r), fold).expect("inside");
                assert!((found - r).abs() < 1e-12 * (1.0 + r), "{a:?} {r} {found}");
            }
            // At the fold itself rounding leaves half the digits.
            let near = fold * (1.0 - 1e-9);
            assert!(fold.is_infinite() || (p.inverse(f(near), fold).unwrap_or(fold) - fold).abs() < 1e-6 * fold);
            assert!(fold.is_infinite() || p.inverse(f(fold) * 1.0001, fold).is_none());
            assert_eq!(p.inverse(f64::NAN, fold), None);
            assert_eq!(p.inverse(f64::INFINITY, fold), None);
        }
    }
}
