//! Figures that stand alone: curves in panels, and fields of vectors over an image.

mod axis;
mod field;
mod figure;
mod ink;
mod layout;

pub use field::Field;
pub use figure::{Curve, Figure, Marker, Panel, Style};
