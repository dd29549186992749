//! Numbers onto lengths, with round numbers for ticks.

use crate::number::decimals_of_step;

/// Maps numbers onto a side of a drawing.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Scale {
    low: f64,
    high: f64,
    from: f64,
    to: f64,
}

impl Scale {
    /// `low` goes to `from`, `high` to `to`.
    pub(crate) fn new([low, high]: [f64; 2], [from, to]: [f64; 2]) -> Self {
        let high = if high > low { high } else { low + 1.0 };
        Self { low, high, from, to }
    }

    /// Where a number lies.
    pub(crate) fn at(&self, value: f64) -> f64 {
        self.from + (value - self.low) / (self.high - self.low) * (self.to - self.from)
    }

    /// Round numbers inside, about `count` of them, and the decimals they need.
    pub(crate) fn ticks(&self, count: usize) -> (Vec<f64>, usize) {
        let step = nice_step((self.high - self.low) / count.max(1) as f64);
        (multiples(step, self.low, self.high), decimals_of_step(step))
    }
}

/// Multiples of a step from `low` to `high`.
pub(crate) fn multiples(step: f64, low: f64, high: f64) -> Vec<f64> {
    const MOST: i64 = 50;
    let first = (low / step - 1e-9).ceil() as i64;
    let last = (high / step + 1e-9).floor() as i64;
    (first..=last.min(first + MOST)).map(|i| i as f64 * step).collect()
}

/// The next larger of 1, 2, 5 times a power of ten.
pub(crate) fn nice_step(rough: f64) -> f64 {
    if !(rough.is_finite() && rough > 0.0) {
        return 1.0;
    }
    let power = 10f64.powf(rough.log10().floor());
    let factor = [1.0, 2.0, 5.0].into_iter().find(|f| f * power >= rough * 0.999).unwrap_or(10.0);
    factor * power
}

/// The next smaller of 1, 2, 5 times a power of ten.
pub(crate) fn nice_step_below(value: f64) -> f64 {
    let power = 10f64.powf(value.log10().floor());
    [5.0, 2.0, 1.0].iter().map(|m| m * power).find(|s| *s <= value * (1.0 + 1e-9)).unwrap_or(power)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::number::fixed;

    #[test]
    fn ticks_are_round_numbers_inside() {
        let (ticks, decimals) = Scale::new([-0.13, 0.42], [0.0, 100.0]).ticks(5);
        assert_eq!(ticks.iter().map(|t| fixed(*t, decimals)).collect::<Vec<_>>(), ["0.0", "0.2", "0.4"]);
        let (ticks, decimals) = Scale::new([0.0, 500.0], [0.0, 100.0]).ticks(5);
        assert_eq!((ticks, decimals), (vec![0.0, 100.0, 200.0, 300.0, 400.0, 500.0], 0));
        // Equal ends do not divide by zero.
        assert!(Scale::new([2.0, 2.0], [0.0, 1.0]).at(2.0).abs() < 1e-12);
    }

    #[test]
    fn steps_are_round() {
        for (value, expected) in [(7.3, 5.0), (5.0, 5.0), (1.99, 1.0), (0.021, 0.02), (431.0, 200.0)] {
            assert!((nice_step_below(value) / expected - 1.0).abs() < 1e-12, "{value}");
        }
        for (value, expected) in [(7.3, 10.0), (5.0, 5.0), (1.99, 2.0), (0.021, 0.05)] {
            assert!((nice_step(value) / expected - 1.0).abs() < 1e-12, "{value}");
        }
    }
}
