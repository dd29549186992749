//! A figure laid out on a canvas. The y axis is logarithmic.

use crate::{
    canvas::{Anchor, Canvas, Color, Ink, Point, Shape},
    plot::{
        axis::{Axis, tick_text},
        figure::{Curve, Figure, Marker, Panel, Style},
        ink::{GREY, LABEL, NOTE, PALE, TICKS, TITLE, WHITE, opaque, solid, thin},
    },
};

const WIDTH: f64 = 800.0;
const LEFT: f64 = 66.0;
const RIGHT: f64 = 14.0;
const GAP: f64 = 24.0;
const PANEL_HEIGHT: f64 = 290.0;
const TITLE_HEIGHT: f64 = 34.0;
const PANEL_TITLE_HEIGHT: f64 = 24.0;
const TICKS_HEIGHT: f64 = 28.0;
const LABEL_HEIGHT: f64 = 26.0;
const LEGEND_ROW: f64 = 21.0;
const NOTE_ROW: f64 = 17.0;
/// Per cent: the plot shows nothing above, and curves that touch this floor (exact answers) are not drawn there.
const TOP_LIMIT: f64 = 200.0;
const FLOOR: f64 = 1e-4;

/// A panel's place on the canvas, and its axes.
struct Place<'a> {
    left: f64,
    top: f64,
    width: f64,
    x: &'a Axis,
    y: &'a Axis,
}

impl Place<'_> {
    /// From 0 to 1 along both axes.
    fn at(&self, x: f64, y: f64) -> Point {
        [self.left + x * self.width, self.top + (1.0 - y) * PANEL_HEIGHT]
    }
}

impl Figure {
    /// Every line, area and text of the figure.
    pub fn layout(&self) -> Canvas<Ink> {
        let mut canvas = Canvas::new([0.0, 0.0, WIDTH, 0.0]);
        canvas.text(TITLE, [WIDTH / 2.0, TITLE_HEIGHT - 10.0], Anchor::Middle, &self.title);
        let top = self.panels(&mut canvas, TITLE_HEIGHT);
        let middle = LEFT + (WIDTH - LEFT - RIGHT) / 2.0;
        canvas.text(LABEL, [middle, top + 12.0], Anchor::Middle, &self.x_label);
        let mut top = self.draw_legend(&mut canvas, top + LABEL_HEIGHT + 6.0);
        for note in &self.notes {
            top += NOTE_ROW;
            canvas.text(NOTE, [LEFT, top - 5.0], Anchor::Start, note);
        }
        canvas.view[3] = (top + 6.0).ceil();
        canvas
    }

    /// Draws all panels from `top` on; returns where they end.
    fn panels(&self, canvas: &mut Canvas<Ink>, mut top: f64) -> f64 {
        let all = || self.rows.iter().flatten().flat_map(|p| &p.curves);
        let x = Axis::new(all().flat_map(|c| c.points.iter().map(|p| p[0])), self.x_log);
        let shown = |v: &f64| (FLOOR..=TOP_LIMIT).contains(v);
        let bands = all().flat_map(|c| c.band.iter().flat_map(|b| [b[1], b[2]]));
        let y = Axis::new(all().flat_map(|c| c.points.iter().map(|p| p[1])).chain(bands).filter(shown), true);
        let columns = self.rows.iter().map(Vec::len).max().unwrap_or(1).max(1) as f64;
        let width = (WIDTH - LEFT - RIGHT - GAP * (columns - 1.0)) / columns;
        for row in &self.rows {
            for (i, panel) in row.iter().enumerate() {
                let left = LEFT + i as f64 * (width + GAP);
                let place = Place { left, top: top + PANEL_TITLE_HEIGHT, width, x: &x, y: &y };
                draw_axes(canvas, &place, i == 0);
                draw_panel(canvas, &place, panel);
            }
            let middle = top + PANEL_TITLE_HEIGHT + PANEL_HEIGHT / 2.0;
            canvas.text_upwards(LABEL, [18.0, middle], &self.y_label);
            top += PANEL_TITLE_HEIGHT + PANEL_HEIGHT + TICKS_HEIGHT;
        }
        top
    }

    /// Draws the legend in two columns from `top` on; returns where it ends.
    fn draw_legend(&self, canvas: &mut Canvas<Ink>, top: f64) -> f64 {
        let rows = self.legend.len().div_ceil(2);
        for (i, (style, label)) in self.legend.iter().enumerate() {
            let left = LEFT + (i / rows) as f64 * (WIDTH - LEFT - RIGHT) / 2.0;
            let middle = top + (i % rows) as f64 * LEGEND_ROW + 0.5 * LEGEND_ROW;
            canvas.shape(style.line(), Shape::polyline(vec![[left, middle], [left + 44.0, middle]]));
            draw_marker(canvas, [left + 22.0, middle], style);
            canvas.text(TICKS, [left + 54.0, middle + 4.5], Anchor::Start, label);
        }
        top + rows as f64 * LEGEND_ROW + 8.0
    }
}

impl Style {
    fn line(&self) -> Ink {
        Ink::Line { color: self.color, width: self.width, dash: self.dash }
    }
}

/// Title and curves.
fn draw_panel(canvas: &mut Canvas<Ink>, place: &Place, panel: &Panel) {
    canvas.text(LABEL, [place.left + place.width / 2.0, place.top - 8.0], Anchor::Middle, &panel.title);
    for curve in &panel.curves {
        draw_band(canvas, place, curve);
    }
    for curve in &panel.curves {
        draw_curve(canvas, place, curve);
    }
    // Last, so that no curve hides them.
    for (index, curve) in panel.curves.iter().enumerate() {
        let earlier = &panel.curves[..index];
        for p in curve.points.iter().filter(|p| p[1] == f64::INFINITY) {
            // One below the other where several curves have none.
            let above = earlier.iter().filter(|c| c.points.contains(p)).count();
            draw_cross(canvas, place, p[0], above, curve.style.color);
        }
    }
}

/// Box, grid, ticks and their numbers.
fn draw_axes(canvas: &mut Canvas<Ink>, place: &Place, numbers_of_y: bool) {
    let (x, y) = (place.x, place.y);
    for &t in &x.ticks {
        let p = x.position(t);
        canvas.line(thin(PALE), place.at(p, 0.0), place.at(p, 1.0));
        let [px, py] = place.at(p, 0.0);
        canvas.text(TICKS, [px, py + 17.0], Anchor::Middle, &tick_text(t));
    }
    for &t in &y.ticks {
        let p = y.position(t);
        canvas.line(thin(PALE), place.at(0.0, p), place.at(1.0, p));
        let [px, py] = place.at(0.0, p);
        if numbers_of_y {
            canvas.text(TICKS, [px - 7.0, py + 4.5], Anchor::End, &tick_text(t));
        }
    }
    for t in x.minor_ticks() {
        let [px, py] = place.at(x.position(t), 0.0);
        canvas.line(thin(GREY), [px, py], [px, py - 4.0]);
    }
    for t in y.minor_ticks() {
        let [px, py] = place.at(0.0, y.position(t));
        canvas.line(thin(GREY), [px, py], [px + 4.0, py]);
    }
    canvas.rectangle(thin(GREY), place.at(0.0, 1.0), [place.width, PANEL_HEIGHT]);
}

fn draw_band(canvas: &mut Canvas<Ink>, place: &Place, curve: &Curve) {
    // Runs of points that can be drawn; an infinite quartile ends at the top.
    let usable = |b: &&[f64; 3]| b[1].is_finite() && b[1] >= FLOOR;
    let run: Vec<&[f64; 3]> = curve.band.iter().filter(usable).collect();
    if run.len() < 2 {
        return;
    }
    let (x, y) = (place.x, place.y);
    let at = |xv: f64, yv: f64| place.at(x.position(xv), y.position(yv.clamp(y.low, y.high)));
    let low = run.iter().map(|b| at(b[0], b[1]));
    let high = run.iter().rev().map(|b| at(b[0], b[2]));
    let look = Ink::Area { color: curve.style.color, opacity: 0.18 };
    canvas.shape(look, Shape::polygon(low.chain(high).collect()));
}

fn draw_curve(canvas: &mut Canvas<Ink>, place: &Place, curve: &Curve) {
    let style = &curve.style;
    let mut run: Vec<Point> = Vec::new();
    let mut runs = Vec::new();
    for p in &curve.points {
        if p[1].is_finite() && p[1] >= FLOOR {
            run.push([place.x.position(p[0]), place.y.position(p[1])]);
        } else {
            runs.push(std::mem::take(&mut run));
        }
    }
    runs.push(run);
    for run in runs {
        for piece in below_the_top(&run) {
            let points = piece.iter().map(|p| place.at(p[0], p[1])).collect();
            canvas.shape(style.line(), Shape::polyline(points));
        }
        for p in run.iter().filter(|p| (0.0..=1.0).contains(&p[1])) {
            draw_marker(canvas, place.at(p[0], p[1]), style);
        }
    }
}

/// In place of a point at infinity: a cross below the upper edge, under `above` others.
fn draw_cross(canvas: &mut Canvas<Ink>, place: &Place, value: f64, above: usize, color: Color) {
    let [x, y] = place.at(place.x.position(value), 1.0);
    let y = y + 8.0 + 11.0 * above as f64;
    // On a pale rim it is told from the curves behind it.
    for look in [solid(WHITE, 5.0), solid(color, 2.0)] {
        for s in [-4.0, 4.0] {
            canvas.line(look.clone(), [x - 4.0, y - s], [x + 4.0, y + s]);
        }
    }
}

/// The pieces of a line (unit square) that lie between the lower and the upper edge.
fn below_the_top(run: &[[f64; 2]]) -> Vec<Vec<[f64; 2]>> {
    let mut pieces: Vec<Vec<[f64; 2]>> = Vec::new();
    for pair in run.windows(2) {
        let ([x0, y0], [x1, y1]) = (pair[0], pair[1]);
        let along = |edge: f64| if y1 == y0 { 0.0 } else { (edge - y0) / (y1 - y0) };
        let (enter, leave) = (along(0.0).min(along(1.0)).max(0.0), along(0.0).max(along(1.0)).min(1.0));
        let inside = if y1 == y0 { (0.0..=1.0).contains(&y0) } else { enter < leave };
        if !inside {
            continue;
        }
        let (enter, leave) = if y1 == y0 { (0.0, 1.0) } else { (enter, leave) };
        let point = |s: f64| [x0 + s * (x1 - x0), y0 + s * (y1 - y0)];
        match pieces.last_mut() {
            Some(piece) if enter == 0.0 && piece.last() == Some(&[x0, y0]) => piece.push(point(leave)),
            _ => pieces.push(vec![point(enter), point(leave)]),
        }
    }
    pieces
}

fn draw_marker(canvas: &mut Canvas<Ink>, at: Point, style: &Style) {
    const SIDE: f64 = 7.0;
    const RADIUS: f64 = 5.4;
    let Some(kind) = style.marker else { return };
    let corner = |degrees: f64| {
        let (sin, cos) = degrees.to_radians().sin_cos();
        [at[0] + RADIUS * cos, at[1] - RADIUS * sin]
    };
    let shape = match kind {
        Marker::Circle => Shape::Circle(at, 4.0),
        Marker::Square => Shape::Rectangle([at[0] - 0.5 * SIDE, at[1] - 0.5 * SIDE], [SIDE; 2]),
        Marker::Triangle => Shape::polygon([90.0, 210.0, 330.0].map(corner).to_vec()),
        Marker::Diamond => Shape::polygon([0.0, 90.0, 180.0, 270.0].map(corner).to_vec()),
    };
    canvas.shape(opaque(if style.filled { style.color } else { WHITE }), shape.clone());
    canvas.shape(solid(style.color, 1.5), shape);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_end_at_the_edges() {
        let pieces = below_the_top(&[[0.0, 0.5], [0.5, 1.5], [1.0, 0.5]]);
        assert_eq!(pieces, [[[0.0, 0.5], [0.25, 1.0]], [[0.75, 1.0], [1.0, 0.5]]]);
        assert_eq!(below_the_top(&[[0.0, 0.2], [0.5, 0.2], [1.0, 0.4]]).len(), 1);
        assert!(below_the_top(&[[0.0, 2.0], [1.0, 3.0]]).is_empty());
    }
}
