//! The views of a calibration as poses of one world, for the formats that have poses.

use groundcal::result::{Calibration, ViewReport};

/// A view with its place: camera coordinates are R (X - c).
pub(crate) struct Pose<'a> {
    /// Name of the image.
    pub(crate) image: &'a str,
    /// Camera from world.
    pub(crate) r_cam_from_world: nalgebra::Matrix3<f64>,
    /// Optical centre in the world.
    pub(crate) centre: nalgebra::Vector3<f64>,
}

/// The largest set of views that have a position in one world, and the views outside it.
pub(crate) struct World<'a> {
    /// Its views; empty where none has a position.
    pub(crate) poses: Vec<Pose<'a>>,
    /// Name of the image whose foot is its origin.
    pub(crate) origin: Option<&'a str>,
    /// Views with a position in another world.
    pub(crate) left_out: Vec<&'a str>,
    /// Unit of length, in words.
    pub(crate) unit: &'static str,
}

impl<'a> World<'a> {
    /// Worlds are told apart by their origin; of equally large ones the first is taken.
    pub(crate) fn largest(calibration: &'a Calibration) -> Self {
        let placed = || calibration.views.iter().filter(|v| v.position.is_some());
        let count = |origin: &str| placed().filter(|v| v.origin == origin).count();
        let mut origin: Option<&str> = None;
        for view in placed() {
            if origin.is_none_or(|o| count(&view.origin) > count(o)) {
                origin = Some(&view.origin);
            }
        }
        let inside = |v: &&ViewReport| Some(v.origin.as_str()) == origin;
        let poses = placed().filter(inside).filter_map(|v| {
            let [pitch, roll, yaw] = [v.pitch_down_deg, v.roll_deg, v.yaw_deg].map(f64::to_radians);
            let r_cam_from_world = groundcal::geometry::rotation_cam_from_world(pitch, roll, yaw);
            Some(Pose { image: &v.image, r_cam_from_world, centre: v.position?.into() })
        });
        let metres = calibration.camera_height_m.is_some();
        Self {
            poses: poses.collect(),
            origin,
            unit: if metres { "metres" } else { "heights of the first camera" },
            left_out: placed().filter(|v| !inside(v)).map(|v| v.image.as_str()).collect(),
        }
    }

    /// Without views.
    pub(crate) fn empty() -> Self {
        Self { poses: Vec::new(), origin: None, left_out: Vec::new(), unit: "heights of the first camera" }
    }

    /// A sentence about the other worlds.
    pub(crate) fn what_is_left_out(&self) -> String {
        format!(
            "poses are those of the {} views connected to {}; {} in other worlds (no common points tie them together): {}",
            self.poses.len(),
            self.origin.unwrap_or_default(),
            match self.left_out.len() {
                1 => "1 view is".to_string(),
                n => format!("{n} views are"),
            },
            self.left_out.join(", ")
        )
    }
}
