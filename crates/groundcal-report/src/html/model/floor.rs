//! The floor: where the views are, where they look and what they see of it.

use groundcal::{floor::FloorView, result::Calibration};
use serde::Serialize;

/// Views that common points connect, seen from above.
#[derive(Debug, Serialize)]
pub(crate) struct FloorMap {
    /// Name of the image below whose optical centre the origin is, +X being its heading, and whose height is the unit.
    pub(crate) origin: String,
    pub(crate) views: Vec<FloorPose>,
}

/// A view on the floor.
#[derive(Debug, Serialize)]
pub(crate) struct FloorPose {
    /// Index of the image.
    pub(crate) image: usize,
    pub(crate) name: String,
    pub(crate) attitude: Option<usize>,
    /// x, y, height in heights of the origin's camera.
    pub(crate) position: [f64; 3],
    pub(crate) position_sigma: [f64; 3],
    /// Anticlockwise from +X seen from above.
    pub(crate) yaw_deg: f64,
    pub(crate) yaw_sigma_deg: f64,
    /// Unit vector where it looks.
    pub(crate) heading: [f64; 2],
    /// Outline of the floor it sees, up to some heights away.
    pub(crate) seen: Vec<[f64; 2]>,
}

/// Farther floor is not drawn, in camera heights.
pub(crate) const DRAWN_RANGE_HEIGHTS: f64 = 6.0;

/// Connected sets of views in the order of their origins.
pub(crate) fn maps(c: &Calibration) -> Vec<FloorMap> {
    let mut maps: Vec<FloorMap> = Vec::new();
    for v in &c.views {
        let (Some(position), Ok(view)) = (v.position, FloorView::of_report(&c.camera, v)) else { continue };
        let Some(image) = c.evidence.images.iter().position(|n| *n == v.image) else { continue };
        let heading = view.heading();
        let pose = FloorPose {
            image,
            name: v.image.clone(),
            attitude: v.attitude,
            position,
            position_sigma: v.position_sigma.unwrap_or_default(),
            yaw_deg: v.yaw_deg,
            yaw_sigma_deg: v.yaw_sigma_deg,
            heading: heading.into(),
            seen: view
                .seen_floor(c.camera.model().size, DRAWN_RANGE_HEIGHTS * position[2])
                .iter()
                .map(|p| (*p).into())
                .collect(),
        };
        match maps.iter_mut().find(|m| m.origin == v.origin) {
            Some(map) => map.views.push(pose),
            None => maps.push(FloorMap { origin: v.origin.clone(), views: vec![pose] }),
        }
    }
    maps
}
