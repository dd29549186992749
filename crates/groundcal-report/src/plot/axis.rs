//! Axes with round numbers.

use crate::{
    canvas::scale::{multiples, nice_step},
    number::trimmed,
};

/// A linear or logarithmic axis.
pub(crate) struct Axis {
    log: bool,
    pub(crate) low: f64,
    pub(crate) high: f64,
    /// Values with a number and a line across the panel.
    pub(crate) ticks: Vec<f64>,
}

impl Axis {
    /// An axis over the values.
    pub(crate) fn new(values: impl Iterator<Item = f64>, log: bool) -> Self {
        let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
        let (low, high) = if low <= high { (low, high) } else { (1.0, 10.0) };
        if log {
            // A little room beyond the extreme values.
            let (low, high) = (low / 1.12, high * 1.12);
            let wide = (high / low).log10() > 2.3;
            let steps: &[f64] = if wide { &[1.0] } else { &[1.0, 2.0, 5.0] };
            let decades = low.log10().floor() as i32..=high.log10().ceil() as i32;
            let ticks = decades.flat_map(|d| steps.iter().map(move |s| s * 10f64.powi(d)));
            Self { log, low, high, ticks: ticks.filter(|t| (low..=high).contains(t)).collect() }
        } else {
            let range = (high - low).max(1e-9);
            let ticks = multiples(nice_step(range / 6.0), low, high);
            Self { log, low: low - 0.03 * range, high: high + 0.03 * range, ticks }
        }
    }

    /// 0 at the low end, 1 at the high end.
    pub(crate) fn position(&self, value: f64) -> f64 {
        if self.log {
            (value / self.low).ln() / (self.high / self.low).ln()
        } else {
            (value - self.low) / (self.high - self.low)
        }
    }

    /// Values between the ticks of a logarithmic axis.
    pub(crate) fn minor_ticks(&self) -> Vec<f64> {
        if !self.log {
            return Vec::new();
        }
        let decades = self.low.log10().floor() as i32..=self.high.log10().ceil() as i32;
        let all = decades.flat_map(|d| (1..10).map(move |s| f64::from(s) * 10f64.powi(d)));
        all.filter(|t| (self.low..=self.high).contains(t)).collect()
    }
}

/// A number at a tick, without trailing zeros.
pub(crate) fn tick_text(value: f64) -> String {
    trimmed(&format!("{value:.4}")).to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_numbers_inside_the_range() {
        let linear = Axis::new([0.0, 4.0].into_iter(), false);
        assert_eq!(linear.ticks, [0.0, 1.0, 2.0, 3.0, 4.0]);
        let wide = Axis::new([0.02, 100.0].into_iter(), true);
        assert_eq!(wide.ticks.iter().map(|t| tick_text(*t)).collect::<Vec<_>>(), ["0.1", "1", "10", "100"]);
        let narrow = Axis::new([0.3, 4.0].into_iter(), true);
        assert_eq!(narrow.ticks.iter().map(|t| tick_text(*t)).collect::<Vec<_>>(), ["0.5", "1", "2"]);
        for axis in [linear, wide, narrow] {
            assert!(axis.ticks.iter().all(|t| (0.0..=1.0).contains(&axis.position(*t))));
        }
        assert_eq!(Axis::new(std::iter::empty(), true).ticks.len(), 4);
    }
}
