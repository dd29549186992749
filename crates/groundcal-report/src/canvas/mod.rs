//! One list of shapes, texts and pictures for every drawing, and what turns it into files: [`svg`] and [`png`].

pub(crate) mod arrow;
pub(crate) mod item;
mod letters;
pub mod png;
pub(crate) mod scale;
pub mod svg;
mod texts;

pub use item::{Anchor, Canvas, Class, Clip, Color, Ink, Item, Mark, Picture, Point, Shape};
pub use texts::PlacedText;
