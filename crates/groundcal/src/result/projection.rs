//! How sure the camera is of where things appear, over the image ([`crate::floor::projection`] computes it).

use serde::{Deserialize, Serialize};

/// Root mean square distance, in pixels, by which the camera shows points in the wrong place, on a grid over the image.
///
/// One number for each cell, row by row from the top left, taken at the cell's middle.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ProjectionUncertainty {
    /// Columns and rows; the cells fill the image.
    pub cells_xy: [usize; 2],
    /// Of points far away, after the rotation of the camera that fits best. `None`: the lens model gives no ray there.
    pub distant_px: Vec<Option<f64>>,
    /// Index of the attitude whose floor is meant below; `None`: there is no floor.
    pub attitude: Option<usize>,
    /// Of points of the floor, after the pose of the camera that fits best. `None`: at or above the horizon. Empty without a floor.
    #[serde(default)]
    pub floor_px: Vec<Option<f64>>,
}

impl ProjectionUncertainty {
    /// The middle of a cell of an image of this size, in pixels.
    pub(crate) fn middle_px(&self, cell: usize, image_size: [usize; 2]) -> [f64; 2] {
        let [columns, rows] = self.cells_xy.map(|n| n.max(1));
        let [width, height] = image_size.map(|n| n as f64);
        let along = |i: usize, n: usize, side: f64| (i as f64 + 0.5) * side / n as f64 - 0.5;
        [along(cell % columns, columns, width), along(cell / columns, rows, height)]
    }
}
