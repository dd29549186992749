//! How sure the camera is of where things appear.

use groundcal::result::{Calibration, ProjectionUncertainty};

use crate::{
    canvas::Anchor,
    html::markup::{Drawing, drawing, figure},
    number::{three_digits, typeset},
    uncertainty::in_short,
};

/// Shades of the cells, pale to dark.
const SHADES: usize = 8;
const WIDTH: f64 = 520.0;

pub(crate) fn section(c: &Calibration, of: &ProjectionUncertainty) -> String {
    let mut out = String::from(
        "<p>By how many pixels the camera shows things in the wrong place, root mean square. Errors of its numbers that hide each other are none; this is \
         what all of them together amount to.</p>\n<div class=\"figures\">\n",
    );
    let kinds = [
        (&of.distant_px, "Points far away", "after the rotation of the camera that hides most of the error"),
        (&of.floor_px, "Points of the floor", "after the pose of the camera that hides most of it"),
    ];
    for (px, what, after) in kinds {
        out.push_str(&grid(c, of, px, what, after));
    }
    out + "</div>\n"
}

fn grid(c: &Calibration, of: &ProjectionUncertainty, px: &[Option<f64>], what: &str, after: &str) -> String {
    let Some([middle, all, most]) = in_short(of, px) else { return String::new() };
    let [w, h] = c.camera.image_size.map(|s| s as f64);
    let scale = (WIDTH - 20.0) / w;
    let [columns, rows] = of.cells_xy;
    let [cell_w, cell_h] = [w * scale / columns as f64, h * scale / rows as f64];
    let mut svg = Drawing::new([0.0, 0.0, WIDTH, h * scale + 20.0]);
    for (i, value) in px.iter().enumerate() {
        let Some(value) = value else { continue };
        let shade = ((value / most * SHADES as f64) as usize).min(SHADES - 1);
        let corner = [10.0 + (i % columns) as f64 * cell_w, 10.0 + (i / columns) as f64 * cell_h];
        svg.rectangle(format!("shade shade{shade}"), corner, [cell_w, cell_h]);
    }
    svg.rectangle("frame", [10.0, 10.0], [w * scale, h * scale]);
    // A few numbers, large enough to be read on a phone.
    for (x, y) in [(0, 0), (2, 0), (1, 1), (0, 2), (2, 2)] {
        let at = |n: usize, k: usize| (k * (n - 1)) / 2;
        let (column, row) = (at(columns, x), at(rows, y));
        if let Some(Some(value)) = px.get(row * columns + column) {
            let anchor = [Anchor::Start, Anchor::Middle, Anchor::End][x];
            let left = 10.0 + [6.0, 0.5 * w * scale, w * scale - 6.0][x];
            let top = 10.0 + [20.0, 0.5 * h * scale + 5.0, h * scale - 10.0][y];
            svg.text("mark", [left, top], anchor, &typeset(&three_digits(*value)));
        }
    }
    let [a, b, c] = [middle, all, most].map(three_digits);
    figure(
        "half",
        &drawing(&svg, "plot", &format!("{what}: expected error over the image")),
        &format!(
            "{what}, {after}: {a} px in the middle, {b} px over the whole image, {c} px where it is largest. Darker is worse; blank: none is seen there."
        ),
    )
}
