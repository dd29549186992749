//! When is one motion carried into other views (KZR 2.3) better than motions of their own? Error of the focal length against the turn
//! of the other motions, the first turning by a fixed angle, and against the error of the rotation axes at equal turns.
//!
//! The same three attitudes in both cases, zero skew. All motions: one turn at each attitude, the conic linear from their circular points.
//! One motion: the first turn, and homographies from its first view to the first views of the other attitudes.

use crate::studies::{
    figure4::{Condition, groundcal, scene},
    setting::Setting,
};
use groundcal::synthetic::{HeightModel, MotionSpec, PointScene};
use groundcal::{
    geometry::Frame,
    pairs::{HomographyEstimate, ImagePair, gold_standard_homography},
    start::{Constraint, calibrate_transferred, unweighted_camera},
};

/// Turn of the motion that is transferred where that of the others is varied, degrees.
pub const FIRST_TURN_DEG: f64 = 30.0;
/// Turn of the other motions, degrees.
pub const TURNS_DEG: [f64; 9] = [1.0, 2.0, 3.0, 5.0, 8.0, 12.0, 20.0, 30.0, 45.0];
/// Angles between the axis of each motion and the floor's normal, degrees.
pub const AXIS_ERRORS_DEG: [f64; 8] = [0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 3.0, 5.0];
/// Turn of every motion there, degrees.
pub const EQUAL_TURN_DEG: f64 = 15.0;

/// What a trial is made with.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Setup {
    /// Turn of the motion that is transferred, degrees.
    pub first_turn_deg: f64,
    /// Turn of the other motions, degrees.
    pub turn_deg: f64,
    /// Angle between the axis of each motion and the floor's normal, degrees.
    pub axis_error_deg: f64,
    /// Attitudes, matches of each homography, image.
    pub setting: Setting,
    /// Standard deviation of each image coordinate, pixels.
    pub noise_px: f64,
}

impl Setup {
    /// The motions but the first turn by `turn_deg`, about exact axes.
    pub fn turning(turn_deg: f64, setting: Setting, noise_px: f64) -> Self {
        Self { first_turn_deg: FIRST_TURN_DEG, turn_deg, axis_error_deg: 0.0, setting, noise_px }
    }

    /// Equal turns about axes that are off the normal.
    pub fn off_axis(axis_error_deg: f64, setting: Setting, noise_px: f64) -> Self {
        Self { first_turn_deg: EQUAL_TURN_DEG, turn_deg: EQUAL_TURN_DEG, axis_error_deg, setting, noise_px }
    }
}

/// Where the first views of the other attitudes stand from that of the first, metres.
const PLACES_M: [[f64; 2]; 2] = [[0.3, -0.4], [-0.2, 0.3]];

/// A curve.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Method {
    /// A motion at each attitude, linear.
    AllMotions,
    /// The first motion transferred, linear.
    OneTransferred,
    /// Joint refinement of the motions.
    Groundcal,
    /// Cramér-Rao bound of the motions.
    Bound,
}

impl Method {
    /// All of them.
    pub const ALL: [Method; 4] = [Method::AllMotions, Method::OneTransferred, Method::Groundcal, Method::Bound];

    /// The name used in files.
    pub fn name(self) -> &'static str {
        match self {
            Method::AllMotions => "all_motions",
            Method::OneTransferred => "one_transferred",
            Method::Groundcal => "groundcal",
            Method::Bound => "cramer_rao_bound",
        }
    }
}

/// Relative errors of fx, in the order of [`Method::ALL`] (the last: the bound's relative standard deviation); `None`: no camera.
pub fn trial(setup: &Setup, seed: u64, number: u64) -> [Option<f64>; 4] {
    let condition = Condition {
        turn_deg: setup.turn_deg,
        setting: setup.setting,
        noise_px: setup.noise_px,
        axis_error_deg: setup.axis_error_deg,
        axis_known: setup.axis_error_deg == 0.0,
        ..Condition::default()
    };
    let mut base = scene(&condition, seed, number);
    let first = base.motions[0];
    let level = |m: &MotionSpec| MotionSpec { attitude_error_rad: [0.0; 2], height_ratio: 1.0, ..*m };
    let offset_m = condition.offset_m;
    if setup.first_turn_deg != setup.turn_deg {
        base.motions[0] = MotionSpec::about_axis(
            first.pitch_down_rad,
            first.roll_rad,
            setup.first_turn_deg.to_radians(),
            offset_m,
            first.height,
        );
    }
    let across = base.motions[1..].iter().zip(PLACES_M).map(|(other, shift)| MotionSpec {
        turn_rad: 0.0,
        shift,
        attitude_error_rad: [other.pitch_down_rad - first.pitch_down_rad, other.roll_rad - first.roll_rad],
        ..level(&first)
    });
    let links = PointScene { motions: across.collect(), seed: base.seed ^ 0x7a5f, ..base.clone() };
    let frame = Frame::new(base.size, None);
    let pairs = base.pairs();
    let fit = |pairs: &[ImagePair]| -> Option<Vec<HomographyEstimate>> {
        pairs.iter().map(|p| gold_standard_homography(&p.matches, &frame).ok()).collect()
    };
    let own = fit(&pairs);
    let relative = |fx: f64| Some(fx / base.intrinsics.fx - 1.0).filter(|e: &f64| e.is_finite());
    Method::ALL.map(|method| match method {
        Method::AllMotions => {
            let matrices: Vec<_> = own.as_ref()?.iter().map(|h| h.in_frame).collect();
            relative(unweighted_camera(&matrices, &frame, Constraint::ZeroSkew, 1.0).ok()?.fx)
        }
        Method::OneTransferred => {
            let others = fit(&links.pairs())?;
            let found = calibrate_transferred(own.as_ref()?.first()?, &others, Constraint::ZeroSkew, 1.0).ok()?;
            relative(found.intrinsics.fx)
        }
        Method::Groundcal => relative(groundcal(&pairs, &condition, seed).ok()?.0.fx),
        Method::Bound => {
            let bound = base.bound(Constraint::ZeroSkew, HeightModel::Constant)?;
            Some(bound[(0, 0)].sqrt() / base.intrinsics.fx)
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_good_motion_beats_poor_ones_and_loses_where_axes_stray() {
        let rms = |setup: Setup, method: usize| {
            let errors: Vec<f64> = (0..40).filter_map(|n| trial(&setup, 2, n)[method]).collect();
            assert!(errors.len() >= 30, "{setup:?} {method}: {}", errors.len());
            (errors.iter().map(|e| e * e).sum::<f64>() / errors.len() as f64).sqrt()
        };
        let (poor, stray) =
            (Setup::turning(3.0, Setting::default(), 1.0), Setup::off_axis(3.0, Setting::default(), 1.0));
        let (poor, stray) = ([rms(poor, 0), rms(poor, 1)], [rms(stray, 0), rms(stray, 1)]);
        assert!(2.0 * poor[1] < poor[0] && 1.5 * stray[0] < stray[1], "{poor:?} {stray:?}");
    }
}
