//! Line plots in panels: a figure is laid out into a list of lines, areas and texts, which [`svg`] and [`png`] draw alike.

pub mod field;
pub mod letters;
pub mod png;
pub mod svg;

/// Red, green and blue.
pub type Color = [u8; 3];

const BLACK: Color = [0, 0, 0];
const GREY: Color = [110, 110, 110];
const PALE: Color = [225, 225, 225];

/// The symbol at the points of a curve.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Marker {
    Circle,
    Square,
    Triangle,
    Diamond,
}

/// How a curve looks.
#[derive(Debug, Clone, Copy)]
pub struct Style {
    pub color: Color,
    pub width: f64,
    /// Lengths of dashes and gaps; empty: solid.
    pub dash: &'static [f64],
    pub marker: Option<Marker>,
    /// Whether the marker is filled, or white inside.
    pub filled: bool,
}

/// A line through points (x, y), where y may be infinite, and the area between (x, low, high).
#[derive(Debug, Clone)]
pub struct Curve {
    pub style: Style,
    pub points: Vec<[f64; 2]>,
    pub band: Vec<[f64; 3]>,
}

/// One pair of axes.
#[derive(Debug, Clone)]
pub struct Panel {
    pub title: String,
    pub curves: Vec<Curve>,
}

/// Panels with common axes. The y axis is logarithmic.
#[derive(Debug, Clone)]
pub struct Figure {
    pub title: String,
    pub x_label: String,
    pub y_label: String,
    /// Whether the x axis is logarithmic.
    pub x_log: bool,
    /// Rows of equally many panels.
    pub rows: Vec<Vec<Panel>>,
    pub legend: Vec<(Style, String)>,
    /// Lines of small print below the legend.
    pub notes: Vec<String>,
}

/// Where a text's reference point is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Anchor {
    Start,
    Middle,
    End,
}

/// Something drawn; coordinates in pixels from the top-left corner.
#[derive(Debug, Clone)]
pub enum Item {
    Line {
        points: Vec<[f64; 2]>,
        color: Color,
        width: f64,
        dash: &'static [f64],
    },
    Area {
        points: Vec<[f64; 2]>,
        color: Color,
        opacity: f64,
    },
    /// `at` is on the base line; `upwards` turns the text by a quarter.
    Text {
        at: [f64; 2],
        text: String,
        size: f64,
        anchor: Anchor,
        color: Color,
        upwards: bool,
    },
}

/// The figure laid out.
#[derive(Debug, Clone)]
pub struct Canvas {
    pub width: f64,
    pub height: f64,
    pub items: Vec<Item>,
}

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
const TICK_SIZE: f64 = 13.0;
const LABEL_SIZE: f64 = 14.0;
const TITLE_SIZE: f64 = 17.0;
const NOTE_SIZE: f64 = 12.0;
/// Per cent: the plot shows nothing above, and curves that touch this floor (exact answers) are not drawn there.
const TOP_LIMIT: f64 = 200.0;
const FLOOR: f64 = 1e-4;

/// A linear or logarithmic axis.
struct Axis {
    log: bool,
    low: f64,
    high: f64,
    /// Values with a number and a line across the panel.
    ticks: Vec<f64>,
}

impl Axis {
    /// An axis over the values.
    fn new(values: impl Iterator<Item = f64>, log: bool) -> Self {
        let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
        let (low, high) = if low <= high { (low, high) } else { (1.0, 10.0) };
        if log {
            // A little room beyond the extreme values.
            let (low, high) = (low / 1.12, high * 1.12);
            let wide = (high / low).log10() > 2.3;
            let steps: &[f64] = if wide { &[1.0] } else { &[1.0, 2.0, 5.0] };
            let decades = low.log10().floor() as i32..=high.log10().ceil() as i32;
            let ticks = decades.flat_map(|d| steps.iter().map(move |s| s * 10f64.powi(d)));
            Self { log, low, high, ticks: ticks.filter(|t| (low..=high).contains(t)).collect() }
        } else {
            let room = 0.03 * (high - low).max(1e-9);
            let rough = (high - low).max(1e-9) / 6.0;
            let power = 10f64.powf(rough.log10().floor());
            let step = [1.0, 2.0, 5.0, 10.0].iter().map(|m| m * power).find(|s| *s >= rough).unwrap_or(rough);
            let (first, last) = ((low / step).ceil() as i64, (high / step + 1e-9).floor() as i64);
            Self { log, low: low - room, high: high + room, ticks: (first..=last).map(|i| i as f64 * step).collect() }
        }
    }

    /// 0 at the low end, 1 at the high end.
    fn position(&self, value: f64) -> f64 {
        if self.log {
            (value / self.low).ln() / (self.high / self.low).ln()
        } else {
            (value - self.low) / (self.high - self.low)
        }
    }

    /// Values between the ticks of a logarithmic axis.
    fn minor_ticks(&self) -> Vec<f64> {
        if !self.log {
            return Vec::new();
        }
        let decades = self.low.log10().floor() as i32..=self.high.log10().ceil() as i32;
        let all = decades.flat_map(|d| (1..10).map(move |s| f64::from(s) * 10f64.powi(d)));
        all.filter(|t| (self.low..=self.high).contains(t)).collect()
    }
}

/// A number at a tick, without trailing zeros.
fn tick_text(value: f64) -> String {
    let text = format!("{value:.4}");
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_string() } else { text }
}

/// A panel's place on the canvas.
struct Place {
    left: f64,
    top: f64,
    width: f64,
}

impl Place {
    fn at(&self, x: f64, y: f64) -> [f64; 2] {
        [self.left + x * self.width, self.top + (1.0 - y) * PANEL_HEIGHT]
    }
}

impl Figure {
    /// Every line, area and text of the figure.
    pub fn layout(&self) -> Canvas {
        let mut items = Vec::new();
        let all = || self.rows.iter().flatten().flat_map(|p| &p.curves);
        let x = Axis::new(all().flat_map(|c| c.points.iter().map(|p| p[0])), self.x_log);
        let shown = |v: &f64| (FLOOR..=TOP_LIMIT).contains(v);
        let bands = all().flat_map(|c| c.band.iter().flat_map(|b| [b[1], b[2]]));
        let y = Axis::new(all().flat_map(|c| c.points.iter().map(|p| p[1])).chain(bands).filter(shown), true);

        let columns = self.rows.iter().map(Vec::len).max().unwrap_or(1).max(1) as f64;
        let width = (WIDTH - LEFT - RIGHT - GAP * (columns - 1.0)) / columns;
        items.push(text([WIDTH / 2.0, TITLE_HEIGHT - 10.0], &self.title, TITLE_SIZE, Anchor::Middle, BLACK));
        let mut top = TITLE_HEIGHT;
        for row in &self.rows {
            for (i, panel) in row.iter().enumerate() {
                let place = Place { left: LEFT + i as f64 * (width + GAP), top: top + PANEL_TITLE_HEIGHT, width };
                axes(&mut items, &place, &x, &y, i == 0);
                items.push(text(
                    [place.left + width / 2.0, place.top - 8.0],
                    &panel.title,
                    LABEL_SIZE,
                    Anchor::Middle,
                    BLACK,
                ));
                for curve in &panel.curves {
                    draw_band(&mut items, &place, &x, &y, curve);
                }
                for curve in &panel.curves {
                    draw_curve(&mut items, &place, &x, &y, curve);
                }
                // Last, so that no curve hides them.
                for (index, curve) in panel.curves.iter().enumerate() {
                    let earlier = &panel.curves[..index];
                    for p in curve.points.iter().filter(|p| p[1] == f64::INFINITY) {
                        // One below the other where several curves have none.
                        let above = earlier.iter().filter(|c| c.points.contains(p)).count();
                        cross(&mut items, &place, &x, p[0], above, curve.style.color);
                    }
                }
            }
            let middle = top + PANEL_TITLE_HEIGHT + PANEL_HEIGHT / 2.0;
            let Item::Text { at, text, size, anchor, color, .. } =
                text([18.0, middle], &self.y_label, LABEL_SIZE, Anchor::Middle, BLACK)
            else {
                continue;
            };
            items.push(Item::Text { at, text, size, anchor, color, upwards: true });
            top += PANEL_TITLE_HEIGHT + PANEL_HEIGHT + TICKS_HEIGHT;
        }
        let middle = LEFT + (WIDTH - LEFT - RIGHT) / 2.0;
        items.push(text([middle, top + 12.0], &self.x_label, LABEL_SIZE, Anchor::Middle, BLACK));
        top += LABEL_HEIGHT + 6.0;
        let rows = self.legend.len().div_ceil(2);
        for (i, (style, label)) in self.legend.iter().enumerate() {
            let left = LEFT + (i / rows) as f64 * (WIDTH - LEFT - RIGHT) / 2.0;
            let middle = top + (i % rows) as f64 * LEGEND_ROW + 0.5 * LEGEND_ROW;
            line(&mut items, vec![[left, middle], [left + 44.0, middle]], style);
            marker(&mut items, [left + 22.0, middle], style);
            items.push(text([left + 54.0, middle + 4.5], label, TICK_SIZE, Anchor::Start, BLACK));
        }
        top += rows as f64 * LEGEND_ROW + 8.0;
        for note in &self.notes {
            top += NOTE_ROW;
            items.push(text([LEFT, top - 5.0], note, NOTE_SIZE, Anchor::Start, GREY));
        }
        Canvas { width: WIDTH, height: (top + 6.0).ceil(), items }
    }
}

fn text(at: [f64; 2], text: &str, size: f64, anchor: Anchor, color: Color) -> Item {
    Item::Text { at, text: text.to_string(), size, anchor, color, upwards: false }
}

fn line(items: &mut Vec<Item>, points: Vec<[f64; 2]>, style: &Style) {
    items.push(Item::Line { points, color: style.color, width: style.width, dash: style.dash });
}

/// Box, grid, ticks and their numbers.
fn axes(items: &mut Vec<Item>, place: &Place, x: &Axis, y: &Axis, numbers_of_y: bool) {
    let plain = |points: Vec<[f64; 2]>, color: Color| Item::Line { points, color, width: 1.0, dash: &[] };
    for &t in &x.ticks {
        let p = x.position(t);
        items.push(plain(vec![place.at(p, 0.0), place.at(p, 1.0)], PALE));
        let [px, py] = place.at(p, 0.0);
        items.push(text([px, py + 17.0], &tick_text(t), TICK_SIZE, Anchor::Middle, BLACK));
    }
    for &t in &y.ticks {
        let p = y.position(t);
        items.push(plain(vec![place.at(0.0, p), place.at(1.0, p)], PALE));
        let [px, py] = place.at(0.0, p);
        if numbers_of_y {
            items.push(text([px - 7.0, py + 4.5], &tick_text(t), TICK_SIZE, Anchor::End, BLACK));
        }
    }
    for t in x.minor_ticks() {
        let [px, py] = place.at(x.position(t), 0.0);
        items.push(plain(vec![[px, py], [px, py - 4.0]], GREY));
    }
    for t in y.minor_ticks() {
        let [px, py] = place.at(0.0, y.position(t));
        items.push(plain(vec![[px, py], [px + 4.0, py]], GREY));
    }
    let corners = [[0.0, 0.0], [0.0, 1.0], [1.0, 1.0], [1.0, 0.0], [0.0, 0.0]];
    items.push(plain(corners.iter().map(|c| place.at(c[0], c[1])).collect(), GREY));
}

fn draw_band(items: &mut Vec<Item>, place: &Place, x: &Axis, y: &Axis, curve: &Curve) {
    // Runs of points that can be drawn; an infinite quartile ends at the top.
    let usable = |b: &&[f64; 3]| b[1].is_finite() && b[1] >= FLOOR;
    let run: Vec<&[f64; 3]> = curve.band.iter().filter(usable).collect();
    if run.len() < 2 {
        return;
    }
    let at = |xv: f64, yv: f64| place.at(x.position(xv), y.position(yv.clamp(y.low, y.high)));
    let low = run.iter().map(|b| at(b[0], b[1]));
    let high = run.iter().rev().map(|b| at(b[0], b[2]));
    items.push(Item::Area { points: low.chain(high).collect(), color: curve.style.color, opacity: 0.18 });
}

fn draw_curve(items: &mut Vec<Item>, place: &Place, x: &Axis, y: &Axis, curve: &Curve) {
    let style = &curve.style;
    let mut run: Vec<[f64; 2]> = Vec::new();
    let mut runs = Vec::new();
    for p in &curve.points {
        if p[1].is_finite() && p[1] >= FLOOR {
            run.push([x.position(p[0]), y.position(p[1])]);
        } else {
            runs.push(std::mem::take(&mut run));
        }
    }
    runs.push(run);
    for run in runs {
        for piece in below_the_top(&run) {
            line(items, piece.iter().map(|p| place.at(p[0], p[1])).collect(), style);
        }
        for p in run.iter().filter(|p| (0.0..=1.0).contains(&p[1])) {
            marker(items, place.at(p[0], p[1]), style);
        }
    }
}

/// In place of a point at infinity: a cross below the upper edge, under `above` others.
fn cross(items: &mut Vec<Item>, place: &Place, x: &Axis, value: f64, above: usize, color: Color) {
    let [px, py] = place.at(x.position(value), 1.0);
    let py = py + 8.0 + 11.0 * above as f64;
    let stroke = |s: f64, color, width| {
        let points = vec![[px - 4.0, py - s], [px + 4.0, py + s]];
        Item::Line { points, color, width, dash: &[] }
    };
    // On a pale rim it is told from the curves behind it.
    for (color, width) in [([255; 3], 5.0), (color, 2.0)] {
        items.extend([-4.0, 4.0].map(|s| stroke(s, color, width)));
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

fn marker(items: &mut Vec<Item>, at: [f64; 2], style: &Style) {
    let Some(kind) = style.marker else { return };
    let (corners, radius, start): (usize, f64, f64) = match kind {
        Marker::Circle => (24, 4.0, 0.0),
        Marker::Square => (4, 5.0, 0.25 * std::f64::consts::PI),
        Marker::Triangle => (3, 5.4, 0.5 * std::f64::consts::PI),
        Marker::Diamond => (4, 5.4, 0.0),
    };
    let corner = |i: usize| {
        let angle = start + std::f64::consts::TAU * i as f64 / corners as f64;
        [at[0] + radius * angle.cos(), at[1] - radius * angle.sin()]
    };
    let outline: Vec<[f64; 2]> = (0..=corners).map(corner).collect();
    let inside = if style.filled { style.color } else { [255; 3] };
    items.push(Item::Area { points: outline.clone(), color: inside, opacity: 1.0 });
    items.push(Item::Line { points: outline, color: style.color, width: 1.5, dash: &[] });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_numbers_inside_the_range() {
        let linear = Axis::new([0.0, 4.0].into_iter(), false);
        assert_eq!(linear.ticks, [0.0, 1.0, 2.0, 3.0, 4.0]);
        let wide = Axis::new([0.02, 100.0].into_iter(), true);
        assert_eq!(wide.ticks.iter().map(|t| tick_text(*t)).collect::<Vec<_>>(), ["0.1", "1", "10", "100"]);
        let narrow = Axis::new([0.3, 4.0].into_iter(), true);
        assert_eq!(narrow.ticks.iter().map(|t| tick_text(*t)).collect::<Vec<_>>(), ["0.5", "1", "2"]);
        for axis in [linear, wide, narrow] {
            assert!(axis.ticks.iter().all(|t| (0.0..=1.0).contains(&axis.position(*t))));
        }
        assert_eq!(Axis::new(std::iter::empty(), true).ticks.len(), 4);
    }

    #[test]
    fn lines_end_at_the_edges() {
        let pieces = below_the_top(&[[0.0, 0.5], [0.5, 1.5], [1.0, 0.5]]);
        assert_eq!(pieces, [[[0.0, 0.5], [0.25, 1.0]], [[0.75, 1.0], [1.0, 0.5]]]);
        assert_eq!(below_the_top(&[[0.0, 0.2], [0.5, 0.2], [1.0, 0.4]]).len(), 1);
        assert!(below_the_top(&[[0.0, 2.0], [1.0, 3.0]]).is_empty());
    }
}
