//! What usually carries a camera over a floor, and how it can move there.

use serde::Serialize;

use crate::plan::planner::{HEIGHT_SIGMA, Rig};

/// What carries the camera.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Carrier {
    /// Tilts and rolls by hand; turned about its column or lifted and put down again.
    #[default]
    Tripod,
    /// Turns and tilts, without roll.
    PanHead,
    /// One attitude; turns on the spot or drives curves.
    Robot,
    /// A gimbal that tilts; turns while it hovers.
    Drone,
}

/// Turns that are tried, degrees, as far as the carrier turns.
const TURNS_DEG: [f64; 8] = [5.0, 10.0, 15.0, 20.0, 30.0, 45.0, 60.0, 90.0];
/// Largest of them unless said otherwise.
pub(crate) const MAX_TURN_DEG: f64 = 60.0;
/// Distance to which the floor can be matched, heights: it is seen under 6 degrees there.
const MAX_DISTANCE_HEIGHTS: f64 = 10.0;

/// How a camera can move, in metres and degrees. Every tilt may be combined with every roll and every turn.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct CarrierMotion {
    /// What carries the camera.
    pub name: &'static str,
    /// Whether it turns by driving on.
    #[serde(skip)]
    pub drives: bool,
    /// Angles of the optical axis below the horizon.
    pub tilts_deg: Vec<f64>,
    /// Rolls, positive with the camera's right-hand side down.
    pub rolls_deg: Vec<f64>,
    /// Turns between two pictures.
    pub turns_deg: Vec<f64>,
    /// Height over the floor.
    pub height_m: f64,
    /// Distance from the optical centre back to the axis of the turns.
    pub axis_offset_m: f64,
    /// How far the floor can be matched.
    pub reach_m: f64,
}

impl Carrier {
    /// Its name in sentences.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Carrier::Tripod => "tripod",
            Carrier::PanHead => "pan head",
            Carrier::Robot => "robot",
            Carrier::Drone => "drone",
        }
    }

    /// Its usual height over the floor, metres.
    pub(crate) fn height_m(self) -> f64 {
        match self {
            Carrier::Tripod => 1.5,
            Carrier::PanHead => 2.5,
            Carrier::Robot => 0.5,
            Carrier::Drone => 10.0,
        }
    }

    /// How far its height varies between views, relative standard deviation.
    pub(crate) fn height_sigma(self) -> f64 {
        match self {
            Carrier::Drone => 0.02,
            _ => HEIGHT_SIGMA,
        }
    }

    /// How it usually moves at a height.
    pub(crate) fn motion(self, height_m: f64) -> CarrierMotion {
        let (tilts_deg, axis_offset_m): (&[f64], f64) = match self {
            Carrier::Tripod => (&[20.0, 30.0, 40.0, 50.0, 60.0], 0.1),
            Carrier::PanHead => (&[10.0, 20.0, 30.0, 40.0, 50.0, 60.0], 0.05),
            Carrier::Robot => (&[30.0], 0.2),
            Carrier::Drone => (&[30.0, 45.0, 60.0], 0.0),
        };
        let rolls_deg: &[f64] = match self {
            Carrier::Tripod => &[-40.0, -20.0, 0.0, 20.0, 40.0],
            _ => &[0.0],
        };
        CarrierMotion {
            name: self.name(),
            drives: self == Carrier::Robot,
            tilts_deg: tilts_deg.to_vec(),
            rolls_deg: rolls_deg.to_vec(),
            turns_deg: turns_up_to_deg(MAX_TURN_DEG),
            height_m,
            axis_offset_m,
            reach_m: MAX_DISTANCE_HEIGHTS * height_m,
        }
    }
}

/// The turns that are tried where a carrier turns so far at most: itself where it is less than the smallest.
pub(crate) fn turns_up_to_deg(max_turn_deg: f64) -> Vec<f64> {
    let mut turns: Vec<f64> = TURNS_DEG.into_iter().filter(|t| *t <= max_turn_deg).collect();
    if turns.is_empty() {
        turns.push(max_turn_deg);
    }
    turns
}

impl CarrierMotion {
    /// In radians and heights of the camera.
    pub(crate) fn rig(&self) -> Rig {
        let radians = |values: &[f64]| values.iter().map(|v| v.to_radians()).collect();
        Rig {
            pitches_down_rad: radians(&self.tilts_deg),
            rolls_rad: radians(&self.rolls_deg),
            turns_rad: radians(&self.turns_deg),
            axis_offset: self.axis_offset_m / self.height_m,
            reach: self.reach_m / self.height_m,
        }
    }
}
