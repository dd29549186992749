//! Colours and sizes of letters of all figures.

use crate::canvas::{Color, Ink};

pub(crate) const BLACK: Color = [0, 0, 0];
pub(crate) const WHITE: Color = [255; 3];
pub(crate) const GREY: Color = [110, 110, 110];
pub(crate) const PALE: Color = [225, 225, 225];

/// At the ticks of an axis and in the legend.
pub(crate) const TICKS: Ink = Ink::Letters { color: BLACK, size: 13.0 };
/// Along an axis, above a panel.
pub(crate) const LABEL: Ink = Ink::Letters { color: BLACK, size: 14.0 };
/// Above the figure.
pub(crate) const TITLE: Ink = Ink::Letters { color: BLACK, size: 17.0 };
/// Below the figure.
pub(crate) const NOTE: Ink = Ink::Letters { color: GREY, size: 12.0 };

/// A thin solid line.
pub(crate) fn thin(color: Color) -> Ink {
    solid(color, 1.0)
}

/// A solid line.
pub(crate) fn solid(color: Color, width: f64) -> Ink {
    Ink::Line { color, width, dash: &[] }
}

/// A whole area.
pub(crate) fn opaque(color: Color) -> Ink {
    Ink::Area { color, opacity: 1.0 }
}
