//! What a figure shows: panels of curves with common axes.

use crate::canvas::Color;

/// The symbol at the points of a curve.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Marker {
    /// A circle.
    Circle,
    /// A square.
    Square,
    /// A triangle that points up.
    Triangle,
    /// A square on its corner.
    Diamond,
}

/// How a curve looks.
#[derive(Debug, Clone, Copy)]
pub struct Style {
    /// Of line and marker.
    pub color: Color,
    /// Of the line.
    pub width: f64,
    /// Lengths of dashes and gaps; empty: solid.
    pub dash: &'static [f64],
    /// At each point.
    pub marker: Option<Marker>,
    /// Whether the marker is filled, or white inside.
    pub filled: bool,
}

/// A line through points (x, y), where y may be infinite, and the area between (x, low, high).
#[derive(Debug, Clone)]
pub struct Curve {
    /// How it looks.
    pub style: Style,
    /// x and y.
    pub points: Vec<[f64; 2]>,
    /// x, low and high.
    pub band: Vec<[f64; 3]>,
}

/// One pair of axes.
#[derive(Debug, Clone)]
pub struct Panel {
    /// Above it.
    pub title: String,
    /// Drawn in this order.
    pub curves: Vec<Curve>,
}

/// Panels with common axes. The y axis is logarithmic.
#[derive(Debug, Clone)]
pub struct Figure {
    /// Above all.
    pub title: String,
    /// Below all.
    pub x_label: String,
    /// Beside each row.
    pub y_label: String,
    /// Whether the x axis is logarithmic.
    pub x_log: bool,
    /// Rows of equally many panels.
    pub rows: Vec<Vec<Panel>>,
    /// Looks and what they stand for.
    pub legend: Vec<(Style, String)>,
    /// Lines of small print below the legend.
    pub notes: Vec<String>,
}
