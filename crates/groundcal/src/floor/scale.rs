//! Lengths in metres from a distance on the floor that is known.
//!
//! With ℓ the distance as the calibration has it and D the one measured, every length L of the world becomes s L, s = D / ℓ. The error of ℓ is
//! made of the errors of the camera and of the view that it is measured in, which the lengths of that view share:
//!
//! ```text
//! ds / s = dD / D - (∂ℓ/∂θ dθ + ∂ℓ/∂q dq) / ℓ          δ(s L) = s dL + L ds
//! ```
//!
//! In that view both parts of δ(s L) are taken together; of other views the calibration does not say how their errors go with those of this one, and
//! the error of s is added as an independent one.

use nalgebra::{DMatrix, DVector};

use crate::{
    error::Error,
    floor::{
        points::{MeasuringView, view_named},
        view::FloorView,
    },
    result::{Calibration, Covariance, ViewParameter, ViewReport},
};

/// A distance on the floor that was measured.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct KnownDistance {
    /// Its ends in the image, pixels.
    pub pixels: [[f64; 2]; 2],
    /// Standard deviation of each coordinate of these.
    pub pixel_sigma_px: f64,
    /// The distance in metres.
    pub metres: f64,
    /// Its standard deviation.
    pub metres_sigma: f64,
}

/// The same calibration with lengths in metres. The optical centres of the origins of all worlds are taken to be equally high, as by
/// [`Calibration::with_camera_height`].
///
/// # Errors
/// [`Error::InvalidOption`] for a distance that is not positive, [`Error::InvalidInput`] where the view is not there or does not see the floor at both
/// pixels.
pub fn with_floor_distance(c: Calibration, image: &str, known: &KnownDistance) -> Result<Calibration, Error> {
    let positive = |v: f64| v.is_finite() && v > 0.0;
    if !(positive(known.metres) && (0.0..known.metres).contains(&known.metres_sigma)) {
        return Err(Error::InvalidOption(format!(
            "a distance of {} +- {} m on the floor: it must be positive, and its deviation smaller than itself",
            known.metres, known.metres_sigma
        )));
    }
    let measuring = MeasuringView::of(&c, image)?;
    let (length, by, of_pixels) = measuring.distance_by_numbers(known.pixels).ok_or_else(|| {
        Error::InvalidInput(format!(
            "{image}: no distance on the floor between ({}, {}) and ({}, {}): a pixel at or above the horizon, or one pixel twice",
            known.pixels[0][0], known.pixels[0][1], known.pixels[1][0], known.pixels[1][1]
        ))
    })?;
    let outside = (known.metres_sigma / known.metres).powi(2) + of_pixels * (known.pixel_sigma_px / length).powi(2);
    let name = view_named(&c, image)?.image.clone();
    let factor = known.metres / length;
    let height_m = factor * c.camera_height_m.unwrap_or(1.0);
    let mut scaled = c.with_camera_height(height_m)?;
    let by = by / -length;
    let of_view = scaled.views.iter().find(|v| v.image == name).map_or(0.0, |v| {
        // In the units of before.
        let mut before = v.covariance.clone();
        before.scale(|p| if p.is_length() { 1.0 / factor } else { 1.0 });
        (by.transpose() * before.of(&ViewParameter::ALL) * &by)[(0, 0)]
    });
    let relative = (of_view.max(0.0) + outside).sqrt();
    for v in &mut scaled.views {
        if v.image == name {
            together(v, &by, factor, outside);
        } else {
            apart(v, relative);
        }
    }
    Ok(with_errors_of_views(scaled, relative))
}

/// Lengths of a calibration in metres whose error is independent of all others.
///
/// # Errors
/// As [`Calibration::with_camera_height`].
pub(crate) fn with_uncertain_height(c: Calibration, height_m: f64, relative_sigma: f64) -> Result<Calibration, Error> {
    let mut scaled = c.with_camera_height(height_m)?;
    scaled.views.iter_mut().for_each(|v| apart(v, relative_sigma));
    Ok(with_errors_of_views(scaled, relative_sigma))
}

/// What follows from the covariances of the views, and the errors of the heights themselves.
fn with_errors_of_views(mut c: Calibration, relative: f64) -> Calibration {
    let camera = c.camera.clone();
    for v in c.views.iter_mut().filter(|v| v.covariance.is_known()) {
        let of = [ViewParameter::X, ViewParameter::Y, ViewParameter::Height];
        v.position_sigma = v.position.map(|_| of.map(|p| v.covariance.variance(p).max(0.0).sqrt()));
        if let (Some(_), Ok(view)) = (&v.floor_from_image, FloorView::of_report(&camera, v)) {
            v.floor_from_image = Some(view.homography_with_covariance(&v.covariance));
        }
    }
    c.camera_height_sigma_m = c.camera_height_m.map(|h| h * relative);
    for a in &mut c.attitudes {
        if let (Some(height), Some(sigma)) = (a.height, &mut a.height_sigma) {
            *sigma = sigma.hypot(height * relative);
        }
    }
    c
}

/// x, y and height of a view where they stand in [`ViewParameter::ALL`].
fn lengths(v: &ViewReport) -> DVector<f64> {
    let [x, y, height] = v.position.unwrap_or_default();
    DVector::from_iterator(
        ViewParameter::COUNT,
        ViewParameter::ALL.iter().map(|p| match p {
            ViewParameter::X => x,
            ViewParameter::Y => y,
            ViewParameter::Height => height,
            _ => 0.0,
        }),
    )
}

/// The view that the distance was measured in: `by` derivative of ln s by its numbers before they were scaled.
fn together(v: &mut ViewReport, by: &DVector<f64>, factor: f64, outside: f64) {
    let scale: Vec<f64> = ViewParameter::ALL.iter().map(|p| if p.is_length() { factor } else { 1.0 }).collect();
    let lengths = lengths(v);
    // From the scaled numbers back to those before, and forth with the error of s.
    let whole = DMatrix::from_fn(ViewParameter::COUNT, ViewParameter::COUNT, |r, c| {
        (if r == c { 1.0 } else { 0.0 }) + lengths[r] * by[c] / scale[c]
    });
    let covariance = &whole * v.covariance.of(&ViewParameter::ALL) * whole.transpose();
    let covariance = covariance + &lengths * lengths.transpose() * outside;
    v.covariance = Covariance::from_fn(&ViewParameter::ALL, |r, c| 0.5 * (covariance[(r, c)] + covariance[(c, r)]));
}

/// Any other view.
fn apart(v: &mut ViewReport, relative: f64) {
    if !v.covariance.is_known() {
        return;
    }
    let lengths = lengths(v);
    let covariance = v.covariance.of(&ViewParameter::ALL) + &lengths * lengths.transpose() * relative.powi(2);
    v.covariance = Covariance::from_fn(&ViewParameter::ALL, |r, c| covariance[(r, c)]);
}
