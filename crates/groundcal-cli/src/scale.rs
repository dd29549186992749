//! Lengths in metres: from the camera's height, a distance on the floor, or a robot's odometry.

use std::{collections::BTreeSet, path::Path};

use groundcal::{
    floor::{KnownDistance, with_floor_distance, with_odometry},
    result::{Calibration, CameraOnBase},
};
use groundcal_io::matches::read_odometry;
use groundcal_report::number::short;

use crate::{args::FloorDistance, error::CliError};

/// How well somebody points at a pixel, one standard deviation of each coordinate.
const POINTING_SIGMA_PX: f64 = 0.5;
/// Odometry that errs by more than this part of the way is not that of these pictures.
const MAX_ODOMETRY_NOISE: f64 = 0.1;

/// What the options say of lengths.
pub(crate) struct Lengths<'a> {
    /// `--camera-height`, metres.
    pub(crate) camera_height_m: Option<f64>,
    /// `--floor-distance`, as it was given; empty: not.
    pub(crate) floor_distance: &'a [String],
    /// `--odometry`.
    pub(crate) odometry: Option<&'a Path>,
}

/// The calibration in metres, if the options say how, and what there is to say about it.
pub(crate) fn scaled(lengths: &Lengths<'_>, c: Calibration) -> Result<(Calibration, Vec<String>), CliError> {
    let mut notes = Vec::new();
    let mut c = c;
    if let Some(height_m) = lengths.camera_height_m {
        c = c.with_camera_height(height_m)?;
    }
    if !lengths.floor_distance.is_empty() {
        let known = FloorDistance::parse(lengths.floor_distance)
            .map_err(|e| CliError::Usage(format!("--floor-distance: {e}")))?;
        let [metres, metres_sigma] = known.metres;
        let distance = KnownDistance { pixels: known.pixels, pixel_sigma_px: POINTING_SIGMA_PX, metres, metres_sigma };
        c = with_floor_distance(c, &known.view, &distance).map_err(|e| CliError::of_input("--floor-distance", e))?;
        notes.extend(other_worlds(&c, c.views.iter().find(|v| v.image == known.view).map(|v| v.origin.as_str())));
    }
    let Some(file) = lengths.odometry else { return Ok((c, notes)) };
    let poses = read_odometry(file, &c.views.iter().map(|v| v.image.clone()).collect::<Vec<_>>())?;
    let scaled_before = c.camera_height_m.is_some();
    c = with_odometry(c, &poses).map_err(|e| CliError::of_file(file, e))?;
    notes.extend(c.on_base.iter().filter(|f| f.relative_noise > MAX_ODOMETRY_NOISE).map(odometry_note));
    if !scaled_before {
        notes.extend(other_worlds(&c, c.on_base.first().map(|f| f.origin.as_str())));
    }
    Ok((c, notes))
}

fn odometry_note(f: &CameraOnBase) -> String {
    format!(
        "the odometry and the images differ by {} % of the way driven (attitude {}): check that poses and images belong together, and that its \
         lengths are metres",
        short(100.0 * f.relative_noise),
        f.attitude + 1
    )
}

/// Views that nothing connects to those whose lengths are known.
fn other_worlds(c: &Calibration, known: Option<&str>) -> Option<String> {
    let origins: BTreeSet<&str> = c.views.iter().filter(|v| v.position.is_some()).map(|v| v.origin.as_str()).collect();
    let known = known.or(origins.first().copied())?;
    let others: Vec<&str> = origins.iter().copied().filter(|o| *o != known).collect();
    (!others.is_empty()).then(|| {
        format!(
            "nothing connects the views of {} to those of {known}: the cameras of these images are taken to be equally high",
            others.join(", ")
        )
    })
}
