//! A lens given by its coefficients before the focal length is known through which they act.
//!
//! The camera f that, used to undo the distortion, comes out again is the fixed point of f -> camera(matches undone through f),
//! found by Steffensen's iteration on ln f.

use crate::{error::Error, geometry::intrinsics::Intrinsics, pairs::placed_lens::PlacedLens};

/// The fixed point.
#[derive(Debug, Clone, Copy)]
pub(crate) struct FixedPoint {
    /// The given coefficients through the camera found.
    pub(crate) lens: PlacedLens,
    /// d ln f / d ln(f of the noise alone): the given coefficients pull the answer along with the focal length.
    pub(crate) amplification: f64,
    /// Relative change in the last round.
    pub(crate) last_change: f64,
}

/// Most rounds.
const MAX_ROUNDS: usize = 25;
/// Relative change at which it has converged.
const RELATIVE_TOLERANCE: f64 = 1e-10;

/// The camera that, used to undo the given distortion, comes out again. `solve` gives the camera of matches undone by a lens.
///
/// # Errors
/// Those of `solve`.
pub(crate) fn fixed_point(
    start: PlacedLens,
    solve: impl Fn(&PlacedLens) -> Result<Intrinsics, Error>,
) -> Result<FixedPoint, Error> {
    let mut lens = start;
    let mut slope: f64 = 0.0;
    let mut last: Option<(f64, f64)> = None;
    let mut last_change = f64::INFINITY;
    for _ in 0..MAX_ROUNDS {
        let solved = solve(&lens)?;
        let (input, output) = (lens.intrinsics.fx.ln(), solved.fx.ln());
        if let Some((last_input, last_output)) = last
            && (input - last_input).abs() > 1e-7
        {
            slope = ((output - last_output) / (input - last_input)).clamp(-3.0, 0.95);
        }
        last = Some((input, output));
        let k = &lens.intrinsics;
        let shift = (solved.cx - k.cx).abs().max((solved.cy - k.cy).abs()) / k.fx;
        last_change = (output - input).abs().max(shift);
        // Newton on output(input) - input, not more than a factor of two at once.
        let step = ((output - input) / (1.0 - slope)).clamp(-0.7, 0.7);
        let factor = (input + step - output).exp();
        lens.intrinsics =
            Intrinsics { fx: solved.fx * factor, fy: solved.fy * factor, skew: solved.skew * factor, ..solved };
        if last_change < RELATIVE_TOLERANCE {
            break;
        }
    }
    Ok(FixedPoint { lens, amplification: (1.0 / (1.0 - slope)).max(1.0), last_change })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::lens::Lens;

    #[test]
    fn a_linear_map_of_ln_f_is_solved_and_its_amplification_told() {
        // ln f -> a ln f + (1 - a) ln 700: fixed at 700, errors enlarged by 1 / (1 - a).
        let a = 0.6;
        let solve = |lens: &PlacedLens| {
            let f = (a * lens.intrinsics.fx.ln() + (1.0 - a) * 700f64.ln()).exp();
            Ok(Intrinsics::square(f, 320.0, 240.0))
        };
        let start = PlacedLens { lens: Lens::radial(-0.1, 0.0), intrinsics: Intrinsics::square(1000.0, 300.0, 250.0) };
        let found = fixed_point(start, solve).expect("a fixed point");
        assert!((found.lens.intrinsics.fx / 700.0 - 1.0).abs() < 1e-9, "{found:?}");
        assert!((found.amplification - 2.5).abs() < 1e-6 && found.last_change < 1e-9, "{found:?}");
        assert_eq!(found.lens.lens, start.lens);
    }
}
