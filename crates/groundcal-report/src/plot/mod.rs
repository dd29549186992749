//! Figures that stand alone: curves in panels, and fields of vectors over an image.

mod axis;
pub(crate) mod field;
mod figure;
pub(crate) mod ink;
mod layout;

pub use field::Field;
pub use figure::{Curve, Figure, Marker, Panel, Style};
