//! Calibrating from what moves: what stands still in all images is found once for all of them, set aside, and the rest is calibrated from.
//!
//! What stands still (a bumper, the background of a turntable, a date stamp) matches better than any floor. Pair by pair it can be told from
//! what moves where the matches of both lie on planes ([`crate::pairs::robust`]); in many images it shows before there are any matches.

use crate::{
    calibrate::{HELD_ATTITUDE_SIGMA_DEG, Observer, Options, calibrate_images},
    error::Error,
    result::{Calibration, Warning},
    vision::{image::GrayImage, still::set_still_parts_aside},
};

/// A calibration, and the images as it was made from them: with masks of what moves.
#[derive(Debug, Clone)]
pub struct Moving {
    /// The calibration, with a warning of what stood still.
    pub calibration: Calibration,
    /// Its images.
    pub images: Vec<GrayImage>,
}

/// Why there is no calibration.
#[derive(Debug, Clone)]
pub struct NotCalibrated {
    /// The reason.
    pub error: Error,
    /// What stood still and was set aside.
    pub still: Option<Box<Warning>>,
}

/// Calibrates from images as [`calibrate_images`] does, without what stands still in all of them.
///
/// # Errors
/// See [`Error`].
pub fn calibrate_moving(
    names: &[String],
    mut images: Vec<GrayImage>,
    options: &Options,
    observer: &dyn Observer,
) -> Result<Moving, NotCalibrated> {
    let found = set_still_parts_aside(&mut images, observer).map_err(|error| NotCalibrated { error, still: None })?;
    let still = found.map(|found| Warning::StillInAllImages { percent: 100.0 * found.share });
    let calibrated = |options: &Options| {
        let failed = |error| NotCalibrated { error, still: still.clone().map(Box::new) };
        calibrate_images(names, &images, options, observer).map_err(failed)
    };
    let mut calibration = calibrated(options)?;
    let single = calibration.motions.iter().filter(|motion| motion.used).count() == 1;
    // A single motion before a still background is a thing held before the camera: its axis may stray, though the background is no longer seen.
    if still.is_some() && single && options.attitude_sigma_deg.is_none() {
        calibration = calibrated(&Options { attitude_sigma_deg: Some(HELD_ATTITUDE_SIGMA_DEG), ..options.clone() })?;
    }
    calibration.warnings.extend(still);
    Ok(Moving { calibration, images })
}
