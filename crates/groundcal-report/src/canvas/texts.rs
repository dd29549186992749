//! Where the texts of a canvas lie, so that it can be seen to that they fit.

use crate::canvas::{
    item::{Anchor, Canvas, Ink, Item},
    letters,
};

/// A text with its extent.
#[derive(Debug, Clone, PartialEq)]
pub struct PlacedText {
    /// The words.
    pub text: String,
    /// Whether it is read upwards.
    pub upwards: bool,
    /// Beginning and end along the line.
    pub along: [f64; 2],
    /// The base line: y, or x where it is read upwards.
    pub across: f64,
    /// The font's size.
    pub size: f64,
    /// Whether there are letters for all of it.
    pub has_letters: bool,
}

impl Canvas<Ink> {
    /// All texts, in letters `wider` times as wide as those of the PNG: a viewer of SVG may choose a wider face.
    pub fn texts(&self, wider: f64) -> Vec<PlacedText> {
        let placed = |item: &Item<Ink>| match item {
            Item::Text { at, text, anchor, upwards, look: Ink::Letters { size, .. } } => {
                let length = letters::write(text).1 * size / letters::EM * wider;
                // What is read upwards begins below.
                let (middle, across) = if *upwards { (at[1], at[0]) } else { (at[0], at[1]) };
                let start = match (anchor, upwards) {
                    (Anchor::Middle, _) => middle - 0.5 * length,
                    (Anchor::Start, false) | (Anchor::End, true) => middle,
                    (Anchor::End, false) | (Anchor::Start, true) => middle - length,
                };
                Some(PlacedText {
                    text: text.clone(),
                    upwards: *upwards,
                    along: [start, start + length],
                    across,
                    size: *size,
                    has_letters: text.chars().all(|c| letters::letter(c).is_some()),
                })
            }
            _ => None,
        };
        self.items.iter().filter_map(placed).collect()
    }
}
