//! Numbers as every reader of YAML takes them, and the nine numbers of K.

use groundcal::geometry::Intrinsics;

/// A number that every YAML reader takes for one: YAML 1.1 (PyYAML) wants a point in the mantissa and a sign in the exponent.
/// Shortest digits that read back exactly.
pub(crate) fn number(value: f64) -> String {
    // Negative zero helps nobody.
    let text = format!("{:?}", value + 0.0);
    match text.split_once('e') {
        Some((mantissa, exponent)) => {
            let point = if mantissa.contains('.') { "" } else { ".0" };
            let sign = if exponent.starts_with('-') { "" } else { "+" };
            format!("{mantissa}{point}e{sign}{exponent}")
        }
        None => text,
    }
}

/// Numbers with commas between.
pub(crate) fn list(values: &[f64]) -> String {
    values.iter().map(|v| number(*v)).collect::<Vec<_>>().join(", ")
}

/// The nine numbers of K, row by row.
pub(crate) fn camera_matrix(k: &Intrinsics) -> [f64; 9] {
    [k.fx, k.skew, k.cx, 0.0, k.fy, k.cy, 0.0, 0.0, 1.0]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_a_point_and_a_signed_exponent() {
        for (value, text) in [
            (705.0, "705.0"),
            (-0.0, "0.0"),
            (1e-5, "1.0e-5"),
            (-8.28619e-5, "-8.28619e-5"),
            (1e20, "1.0e+20"),
            (0.1, "0.1"),
        ] {
            assert_eq!(number(value), text);
            assert_eq!(text.parse::<f64>(), Ok(value));
        }
    }
}
