//! Names of values in the wild: `dist_coeff`, `distCoeffs`, `Distortion_Coefficients`, `D2`, `cameraMatrixL`.

use crate::import::{node::Node, spelling::plain};

/// Names of a camera matrix, as [`plain`] writes them.
const MATRIX: [&str; 12] = [
    "cameramatrix",
    "k",
    "m",
    "mtx",
    "intrinsicmatrix",
    "intrinsicsmatrix",
    "intrinsic",
    "intrinsics",
    "kmatrix",
    "matrix",
    "cammatrix",
    "cameraintrinsics",
];
/// Names of a list of lens coefficients.
const LENS: [&str; 20] = [
    "distortioncoefficients",
    "distortioncoefficient",
    "distortioncoeffs",
    "distortioncoeff",
    "distortioncoefs",
    "distortioncoef",
    "distcoefficients",
    "distcoeffs",
    "distcoeff",
    "distcoefs",
    "distcoef",
    "distortions",
    "distortion",
    "distortionvector",
    "distortionparams",
    "distortionparameters",
    "distvec",
    "dist",
    "d",
    "kc",
];
/// What tells the cameras of a pair apart.
const SIDES: [&str; 10] = ["0", "1", "2", "3", "4", "left", "right", "l", "r", "rgb"];
/// Lens coefficients that have names of their own.
const COEFFICIENTS: [&str; 9] = ["k1", "k2", "k3", "k4", "k5", "k6", "p1", "p2", "xi"];

/// The side in a name that is otherwise one of `names`: empty where the name is whole.
fn side_of(name: &str, names: &[&str]) -> Option<&'static str> {
    let name = plain(name);
    if names.contains(&name.as_str()) {
        return Some("");
    }
    SIDES.into_iter().find(|side| {
        let rest = name.strip_suffix(side).or_else(|| (side.len() > 1).then(|| name.strip_prefix(side)).flatten());
        rest.is_some_and(|rest| names.contains(&rest))
    })
}

/// A camera matrix's side; nothing for what is none. A single number under `K1` is a coefficient of a lens.
pub(crate) fn matrix_side(name: &str, value: &Node) -> Option<&'static str> {
    side_of(name, &MATRIX).filter(|_| value.number().is_none())
}

/// A lens's side; nothing for what is no list of coefficients.
pub(crate) fn lens_side(name: &str) -> Option<&'static str> {
    side_of(name, &LENS)
}

/// Whether a name is that of a single coefficient.
pub(crate) fn is_coefficient(name: &str) -> bool {
    COEFFICIENTS.contains(&plain(name).as_str())
}

/// Whether a name that is not read sounds like a lens.
pub(crate) fn sounds_like_a_lens(name: &str) -> bool {
    let name = plain(name);
    let within = ["distort", "distcoef", "distparam", "lens", "fisheye", "undist", "radial", "tangential", "coeff"];
    // What says how far an object was, or which model is meant, is no coefficient.
    let aside = ["distortionmodel", "distance"];
    !aside.iter().any(|w| name.contains(w))
        && (within.iter().any(|w| name.contains(w))
            || COEFFICIENTS.contains(&name.as_str())
            || lens_side(&name).is_some())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spellings() {
        for (name, side) in [
            ("dist_coeff", ""),
            ("distCoeffs", ""),
            ("Distortion_Coefficients", ""),
            ("D", ""),
            ("D2", "2"),
            ("dist_coefs_left", "left"),
            ("right_distortion", "right"),
            ("distCoeffsR", "r"),
        ] {
            assert_eq!(lens_side(name), Some(side), "{name}");
        }
        for name in ["R", "P", "T", "DX", "description", "model"] {
            assert_eq!(lens_side(name), None, "{name}");
        }
        let matrix = Node::List(vec![Node::Number(1.0); 9]);
        assert_eq!(matrix_side("cameraMatrix1", &matrix), Some("1"));
        assert_eq!(matrix_side("left_camera_matrix", &matrix), Some("left"));
        assert_eq!(matrix_side("K1", &matrix), Some("1"));
        assert_eq!(matrix_side("k1", &Node::Number(-0.1)), None);
        assert!(sounds_like_a_lens("lens_coeffs_v2") && sounds_like_a_lens("k4") && !sounds_like_a_lens("square_size"));
    }
}
