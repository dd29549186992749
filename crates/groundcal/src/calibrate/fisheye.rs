//! A lens that is a fisheye's, not one of Brown and Conrady.
//!
//! ```text
//! r = f tan θ (1 + k1 tan² θ + k2 tan⁴ θ)      or      r = f (θ + k1 θ³ + k2 θ⁵)
//! ```
//!
//! Over a floor alone the first, with another f, follows the second for a while: the residuals stay small and f is wrong by tenths. So
//! where the images reach far from the axis the second is tried from where the first came to, and their evidences compared.

use nalgebra::{DMatrix, DVector, Vector2};

use crate::{
    calibrate::{
        options::FISHEYE_SIGMAS,
        refinement_input::{Refined, RefinementInput},
    },
    error::Error,
    geometry::lens::{Fisheye, Lens, Radtan},
    pairs::known_lens::{K1_SIGMA, K2_SIGMA},
    refine::{CameraState, CameraUnknowns, State, blocks::MATRIX},
};

/// Radius of the image's corner over that of an ideal lens, above which no fisheye is tried: at 30 degrees from the axis an equidistant lens
/// has 0.91 of it, a stereographic one 0.93; at 40 degrees 0.83 and 0.87.
const MIN_BARREL: f64 = 0.95;
/// Coefficients that are estimated where nobody said that it is a fisheye: what is held would be taken up by the others, and be wrong by more than their
/// error bars.
const NUMBERS: usize = 3;
/// Radii at which the fisheye that is nearest to a lens is fitted to it.
const RADII: usize = 40;
const MIN_RADII: usize = 8;

/// The refinement with a fisheye's lens, where the tracks ask for it; with it twice the logarithm of the odds.
///
/// # Errors
/// [`Error::Stopped`] and no other.
pub(super) fn with_fisheye(
    input: &RefinementInput<'_>,
    refined: &Refined,
    needed: f64,
) -> Result<Option<(f64, Refined)>, Error> {
    let state = &refined.joint.bundle.state;
    let Lens::Radtan(radtan) = state.cameras[0].lens else { return Ok(None) };
    let unknowns = &refined.options.bundle.cameras[0];
    if refined.options.radtan_only || !is_of_our_choice(unknowns) {
        return Ok(None);
    }
    let starts = starts(state, &radtan, unknowns);
    if starts.is_empty() {
        return Ok(None);
    }
    let mut options = refined.options.clone();
    let unknowns = &mut options.bundle.cameras[0];
    unknowns.hold_lens_from(0);
    (0..NUMBERS).for_each(|k| unknowns.free_lens(k, Some((0.0, FISHEYE_SIGMAS[k]))));
    options.bundle = options.bundle.for_trial();
    let tried = input.tried(refined, refined.solution.clone(), options, starts)?;
    Ok(tried.and_then(|mut with| {
        let gain = with.gain_over(refined, needed)?;
        with.fisheye = Some(gain);
        Some((gain, with))
    }))
}

/// Nobody said anything of the lens's numbers.
fn is_of_our_choice(unknowns: &CameraUnknowns) -> bool {
    let usual = [K1_SIGMA, K2_SIGMA].map(|sigma| Some((0.0, sigma)));
    (0..2).all(|k| unknowns.is_free(MATRIX + k) && unknowns.prior(MATRIX + k) == usual[k])
}

/// States with the fisheyes nearest to a lens, with and without coefficients; none where the lens is like no fisheye.
fn starts(state: &State, radtan: &Radtan, unknowns: &CameraUnknowns) -> Vec<State> {
    let k = state.cameras[0].intrinsics_in_frame();
    let f = (k.fx * k.fy).sqrt();
    let [half_width, half_height] = unknowns.image_half_sides;
    let corner = half_width.hypot(half_height) / f;
    // Radii as the images have them, and the angles that the lens sees there.
    let at = |i: usize| {
        let radius = corner * (i + 1) as f64 / RADII as f64;
        let ray = radtan.unproject(&Vector2::new(radius, 0.0))?;
        Some((radius, ray.x.atan2(ray.z)))
    };
    let seen: Vec<(f64, f64)> = (0..RADII).map_while(at).collect();
    // Beyond the fold of a lens there is nothing to fit to, and none but a fisheye's has a fold inside the image.
    let barrel = seen.last().map_or(1.0, |(radius, angle)| radius / angle.tan());
    if seen.len() < MIN_RADII || barrel > MIN_BARREL {
        return Vec::new();
    }
    let fitted = |powers: i32| {
        let design = DMatrix::from_fn(seen.len(), powers as usize, |r, c| seen[r].1.powi(2 * c as i32 + 1));
        let radii = DVector::from_iterator(seen.len(), seen.iter().map(|(radius, _)| *radius));
        let solution = design.svd(true, true).solve(&radii, 1e-12).ok()?;
        let scale = solution[0];
        let of = |c: usize| solution.get(c).map_or(0.0, |v| v / scale);
        let lens = Lens::Fisheye(Fisheye::new([of(1), of(2), 0.0, 0.0]));
        let mut camera = CameraState { lens, ..state.cameras[0] };
        camera.matrix[0] += scale.ln();
        let mut start = state.clone();
        start.cameras[0] = camera;
        (scale > 0.0).then_some(start)
    };
    [3, 1].into_iter().filter_map(fitted).collect()
}
