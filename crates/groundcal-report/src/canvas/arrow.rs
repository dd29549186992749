//! Arrows.

use crate::canvas::item::{Point, Shape};

/// The head of an arrow.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Head {
    /// Its longest length.
    pub(crate) longest: f64,
    /// Its largest part of the arrow.
    pub(crate) part: f64,
    /// Half its width to its length.
    pub(crate) spread: f64,
}

/// An arrow from a point along a vector.
pub(crate) fn arrow(from: Point, along: [f64; 2], head: Head) -> Shape {
    let length = along[0].hypot(along[1]);
    let tip = [from[0] + along[0], from[1] + along[1]];
    let mut runs = vec![vec![from, tip]];
    if length > 1e-9 {
        let (ux, uy) = (along[0] / length, along[1] / length);
        let size = head.longest.min(head.part * length);
        let [a, b] = [head.spread, -head.spread]
            .map(|side: f64| [tip[0] - size * (ux - side * uy), tip[1] - size * (uy + side * ux)]);
        runs.push(vec![a, tip, b]);
    }
    Shape::Runs { runs, closed: false }
}
