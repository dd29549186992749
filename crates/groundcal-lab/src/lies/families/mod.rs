//! All families of the bench.

mod axis;
mod camera;
mod control;
mod degenerate;
mod floor;
mod general;
mod noise;
mod selection;

use crate::lies::family::Family;

/// Every family, controls last.
pub fn families() -> Vec<Family> {
    [
        general::FAMILIES,
        selection::FAMILIES,
        axis::FAMILIES,
        floor::FAMILIES,
        camera::FAMILIES,
        noise::FAMILIES,
        degenerate::FAMILIES,
        control::FAMILIES,
    ]
    .concat()
}
