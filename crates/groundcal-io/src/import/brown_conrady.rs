//! Brown-Conrady coefficients as OpenCV orders them: k1, k2, p1, p2[, k3[, k4, k5, k6[, s1 .. s4[, tau_x, tau_y]]]].

use groundcal::geometry::distortion::Distortion;

/// k1, k2, p1, p2 and k3; what lies beyond must be zero.
pub(crate) fn brown_conrady(coefficients: &[f64]) -> Result<(Distortion, f64), String> {
    let at = |i: usize| coefficients.get(i).copied().unwrap_or(0.0);
    match coefficients.len() {
        0 | 4 | 5 | 8 | 12 | 14 => {}
        n => return Err(format!("{n} distortion coefficients: expected k1, k2, p1, p2 and perhaps k3")),
    }
    if let Some(i) = (5..coefficients.len()).find(|i| coefficients[*i] != 0.0) {
        return Err(format!(
            "distortion coefficient {} is {}: only k1, k2, p1, p2, k3 are read, not the rational, thin-prism or tilted models",
            i + 1,
            coefficients[i]
        ));
    }
    Ok((Distortion { k1: at(0), k2: at(1), p1: at(2), p2: at(3) }, at(4)))
}
