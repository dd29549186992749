//! Numbers as people read them: one place for every table, caption and axis.

use groundcal::numerics::NORMAL_95;

/// A number with a fixed count of decimals, without a minus before nothing.
pub fn fixed(value: f64, decimals: usize) -> String {
    let text = format!("{value:.decimals$}");
    match text.strip_prefix('-') {
        Some(rest) if rest.bytes().all(|b| b == b'0' || b == b'.') => rest.to_string(),
        _ => text,
    }
}

/// The 95 % interval of a number.
pub(crate) fn interval_95(value: f64, sigma: f64) -> [f64; 2] {
    [-NORMAL_95, NORMAL_95].map(|t| value + t * sigma)
}

/// A number as typeset text has it: with a minus sign in place of the hyphen.
pub fn typeset(text: &str) -> String {
    text.replace('-', "\u{2212}")
}

/// So many significant digits, without an exponent and with at most so many decimals; what is not finite is named.
pub fn significant(value: f64, digits: usize, most_decimals: usize) -> String {
    if value == 0.0 || !value.is_finite() {
        // Adding zero turns -0 into 0.
        return (value + 0.0).to_string();
    }
    let wanted = digits as i32 - 1 - value.abs().log10().floor() as i32;
    format!("{value:.*}", wanted.clamp(0, most_decimals as i32) as usize)
}

/// Without the zeros, and the point, that end the decimals.
pub fn trimmed(text: &str) -> &str {
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.') } else { text }
}

/// Up to three significant digits, as short as they allow: for sentences.
pub fn short(value: f64) -> String {
    trimmed(&significant(value, 3, 6)).to_string()
}

/// As short as it is said, up to three decimals: for pixels and places that were given.
pub fn short_decimals(value: f64) -> String {
    trimmed(&fixed(value, 3)).to_string()
}

/// Three significant digits, with an exponent where there would be more than eight decimals: for scales.
pub fn three_digits(value: f64) -> String {
    const MAX_DECIMALS: usize = 8;
    if value != 0.0 && value.abs() < 10f64.powi(2 - MAX_DECIMALS as i32) {
        format!("{value:.2e}")
    } else {
        significant(value, 3, MAX_DECIMALS)
    }
}

/// A coordinate of a drawing, as short as a tenth of a unit allows.
pub fn coordinate(value: f64) -> String {
    trimmed(&fixed(value, 1)).to_string()
}

/// Decimals that show two digits of a standard deviation.
pub fn decimals_of_sigma(sigma: f64) -> usize {
    if sigma > 0.0 && sigma.is_finite() { (1.0 - sigma.log10().floor()).clamp(0.0, 9.0) as usize } else { 3 }
}

/// Decimals that multiples of a step need.
pub fn decimals_of_step(step: f64) -> usize {
    (-(step.log10() + 1e-9).floor()).clamp(0.0, 9.0) as usize
}

/// The value, or a dash where there is none.
pub fn or_dash(value: Option<f64>, decimals: usize) -> String {
    value.map_or_else(|| "-".to_string(), |v| fixed(v, decimals))
}

/// A value and its standard deviation with the same decimals; a dash where there is no value.
pub fn with_sigma(value: Option<f64>, sigma: Option<f64>, decimals: usize) -> String {
    match (value, sigma) {
        (Some(v), Some(s)) => format!("{} +-{}", fixed(v, decimals), fixed(s, decimals)),
        _ => or_dash(value, decimals),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn there_is_no_minus_before_nothing() {
        assert_eq!((fixed(-0.0004, 3), fixed(-1.5, 1)), ("0.000".into(), "-1.5".into()));
        assert_eq!(typeset(&fixed(-1.5, 1)), "\u{2212}1.5");
        assert_eq!(coordinate(-0.04), "0");
        assert_eq!((coordinate(12.04), coordinate(3.26), coordinate(120.0)), ("12".into(), "3.3".into(), "120".into()));
    }

    #[test]
    fn significant_digits_have_no_exponent() {
        for (value, text) in [
            (0.0, "0"),
            (15.0, "15"),
            (0.02, "0.02"),
            (1.0 / 3.0, "0.333333"),
            (123_456.7, "123457"),
            (f64::INFINITY, "inf"),
        ] {
            assert_eq!(trimmed(&significant(value, 6, 20)), text);
        }
        assert_eq!(significant(-0.25, 6, 12), "-0.250000");
        for (value, text) in
            [(0.0, "0"), (0.01234, "0.0123"), (12.345, "12.3"), (1234.5, "1234"), (3.2e-12, "3.20e-12")]
        {
            assert_eq!(three_digits(value), text);
        }
        for (value, text) in [(0.0, "0"), (0.3, "0.3"), (100.0, "100"), (1.005, "1"), (0.012_34, "0.0123")] {
            assert_eq!(short(value), text);
        }
    }

    #[test]
    fn deviations_go_with_their_values() {
        assert_eq!(with_sigma(Some(1.0), Some(0.25), 2), "1.00 +-0.25");
        assert_eq!((with_sigma(Some(1.0), None, 1), with_sigma(None, Some(1.0), 1)), ("1.0".into(), "-".into()));
        assert_eq!((decimals_of_sigma(0.0123), decimals_of_sigma(7.0), decimals_of_sigma(0.0)), (3, 1, 3));
        assert_eq!((decimals_of_step(0.2), decimals_of_step(5.0)), (1, 0));
    }
}
