//! Lens coefficients as lists.

use groundcal::geometry::{Fisheye, Lens, Radtan};

/// Names of the equidistant fisheye of Kannala and Brandt in files, in small letters.
const FISHEYE: [&str; 8] = [
    "equidistant",
    "fisheye",
    "opencv_fisheye",
    "kannala_brandt",
    "kannala_brandt4",
    "kannalabrandt",
    "kannalabrandt8",
    "equi",
];

/// Whether a model's name is one of the equidistant fisheye.
pub(crate) fn is_fisheye(model: &str) -> bool {
    FISHEYE.contains(&model.to_ascii_lowercase().as_str())
}

/// Brown-Conrady as OpenCV orders it: k1, k2, p1, p2[, k3[, k4, k5, k6[, s1 .. s4[, tau_x, tau_y]]]]; what lies beyond k3 must be zero.
pub(crate) fn brown_conrady(coefficients: &[f64]) -> Result<Lens, String> {
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
    Ok(Lens::Radtan(Radtan::new([0, 1, 2, 3, 4].map(at))))
}

/// The equidistant fisheye: k1, k2, k3, k4.
pub(crate) fn kannala_brandt(coefficients: &[f64]) -> Result<Lens, String> {
    match coefficients.try_into() {
        Ok(four) => Ok(Lens::Fisheye(Fisheye::new(four))),
        Err(_) => {
            Err(format!("{} distortion coefficients: a fisheye lens has four, k1, k2, k3, k4", coefficients.len()))
        }
    }
}
