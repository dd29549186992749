//! A field of vectors over an image: colours for their lengths, arrows for a part of them.

use crate::{
    canvas::{
        Anchor, Canvas, Color, Ink, Point,
        arrow::{Head, arrow},
        scale::nice_step_below,
    },
    number::three_digits,
    plot::{
        axis::{Axis, tick_text},
        ink::{BLACK, GREY, LABEL, NOTE, TICKS, TITLE, WHITE, opaque, solid, thin},
    },
};

const WIDTH: f64 = 800.0;
const LEFT: f64 = 76.0;
/// Colour bar and its numbers.
const RIGHT: f64 = 124.0;
const TOP: f64 = 46.0;
const MAX_HEIGHT: f64 = 640.0;
const NOTE_ROW: f64 = 18.0;
const BAR_STEPS: usize = 64;
/// Grid points from one arrow to the next.
const ARROW_STEP: usize = 4;
/// Shorter ones show no direction.
const SHORTEST_ARROW: f64 = 1.0;
const HEAD: Head = Head { longest: 5.0, part: 0.35, spread: 0.6 };

/// Pale to dark, so that it reads without colour too.
const STOPS: [Color; 5] = [[255, 250, 225], [250, 205, 125], [225, 130, 90], [150, 60, 110], [55, 20, 85]];
const NOTHING: Color = [205, 205, 205];

/// Vectors on a regular grid that spans the image from the first to the last pixel centre.
#[derive(Debug, Clone)]
pub struct Field {
    /// Above it.
    pub title: String,
    /// Unit and meaning of the lengths, at the colour bar.
    pub label: String,
    /// Width and height of the image in pixels.
    pub size: [f64; 2],
    /// Grid points along x and y.
    pub grid: [usize; 2],
    /// Row by row, in pixels; nothing where there is no value.
    pub vectors: Vec<Option<[f64; 2]>>,
    /// Lines of small print.
    pub notes: Vec<String>,
}

/// The colour of a value from 0 to 1.
pub(crate) fn color(value: f64) -> Color {
    let at = value.clamp(0.0, 1.0) * (STOPS.len() - 1) as f64;
    let i = (at as usize).min(STOPS.len() - 2);
    let part = at - i as f64;
    std::array::from_fn(|c| (f64::from(STOPS[i][c]) * (1.0 - part) + f64::from(STOPS[i + 1][c]) * part).round() as u8)
}

impl Field {
    /// Every line, area and text.
    pub fn layout(&self) -> Canvas<Ink> {
        let plan = Layout::new(self);
        let mut canvas = Canvas::new([0.0, 0.0, LEFT + plan.width + RIGHT, 0.0]);
        canvas.text(TITLE, [LEFT + plan.width / 2.0, 28.0], Anchor::Middle, &self.title);
        plan.cells(&mut canvas);
        let mut notes = self.notes.clone();
        if let Some(factor) = plan.arrows(&mut canvas) {
            let times = tick_text(factor);
            notes.push(format!("Arrows are {times} times as long as the differences at their middles."));
        }
        if self.vectors.iter().any(Option::is_none) {
            notes.push("Grey: one of the lens models gives nothing there.".into());
        }
        plan.axes(&mut canvas);
        plan.bar(&mut canvas);
        let mut top = TOP + plan.height + 52.0;
        for note in &notes {
            top += NOTE_ROW;
            canvas.text(NOTE, [LEFT, top], Anchor::Start, note);
        }
        canvas.view[3] = (top + 14.0).ceil();
        canvas
    }
}

/// Where the parts of a field lie.
struct Layout<'a> {
    field: &'a Field,
    /// Canvas units to a pixel.
    scale: f64,
    /// Of the picture.
    width: f64,
    height: f64,
    longest: f64,
}

impl<'a> Layout<'a> {
    fn new(field: &'a Field) -> Self {
        let [w, h] = field.size;
        let scale = ((WIDTH - LEFT - RIGHT) / w).min(MAX_HEIGHT / h);
        let longest = field.vectors.iter().flatten().map(|v| v[0].hypot(v[1])).fold(0.0, f64::max);
        Self { field, scale, width: (w * scale).round(), height: (h * scale).round(), longest }
    }

    /// Pixel centres: the picture begins half a pixel before the first.
    fn place(&self, x: f64, y: f64) -> Point {
        let [w, h] = self.field.size;
        [LEFT + (x + 0.5) * self.width / w, TOP + (y + 0.5) * self.height / h]
    }

    fn cells(&self, canvas: &mut Canvas<Ink>) {
        // Cells reach half way to the neighbours; whole canvas pixels leave no seams.
        let edge = |i: usize, n: usize, start: f64, length: f64| {
            let at = (i as f64 - 0.5).clamp(0.0, (n - 1) as f64) / (n - 1) as f64;
            (start + at * length).round()
        };
        let [columns, rows] = self.field.grid;
        for row in 0..rows {
            for column in 0..columns {
                let value = self.field.vectors[row * columns + column].map(|v| v[0].hypot(v[1]));
                let part = |v: f64| if self.longest > 0.0 { v / self.longest } else { 0.0 };
                let fill = value.map_or(NOTHING, |v| color(part(v)));
                let [left, right] = [column, column + 1].map(|i| edge(i, columns, LEFT, self.width));
                let [top, bottom] = [row, row + 1].map(|i| edge(i, rows, TOP, self.height));
                canvas.rectangle(opaque(fill), [left, top], [right - left, bottom - top]);
            }
        }
    }

    /// Draws a part of the vectors; returns how many times too long they are, unless there is nothing to draw.
    fn arrows(&self, canvas: &mut Canvas<Ink>) -> Option<f64> {
        let [columns, rows] = self.field.grid;
        let [w, h] = self.field.size;
        let spacing = self.width / (columns - 1) as f64 * ARROW_STEP as f64;
        if self.longest <= 0.0 {
            return None;
        }
        // The longest arrow spans at most the way to the next; a round factor can be read off.
        let factor = nice_step_below(0.95 * spacing / (self.longest * self.scale));
        // Centred on points half a step inside, none leaves the picture.
        let inside = |n: usize| (ARROW_STEP / 2..n.saturating_sub(ARROW_STEP / 2)).step_by(ARROW_STEP);
        let node = |i: usize, n: usize, side: f64| i as f64 / (n - 1) as f64 * (side - 1.0);
        for (row, column) in inside(rows).flat_map(|row| inside(columns).map(move |column| (row, column))) {
            let Some(v) = self.field.vectors[row * columns + column] else { continue };
            let [x, y] = self.place(node(column, columns, w), node(row, rows, h));
            let [dx, dy] = v.map(|d| d * self.scale * factor);
            if dx.hypot(dy) < SHORTEST_ARROW {
                continue;
            }
            let shape = arrow([x - 0.5 * dx, y - 0.5 * dy], [dx, dy], HEAD);
            // A pale rim shows it on dark ground.
            canvas.shape(solid(WHITE, 3.0), shape.clone()).shape(solid(BLACK, 1.2), shape);
        }
        Some(factor)
    }

    fn axes(&self, canvas: &mut Canvas<Ink>) {
        let [w, h] = self.field.size;
        let bottom = TOP + self.height;
        for t in Axis::new([0.0, w - 1.0].into_iter(), false).ticks {
            let x = self.place(t, 0.0)[0];
            canvas.line(thin(GREY), [x, bottom], [x, bottom + 5.0]);
            canvas.text(TICKS, [x, bottom + 19.0], Anchor::Middle, &tick_text(t));
        }
        for t in Axis::new([0.0, h - 1.0].into_iter(), false).ticks {
            let y = self.place(0.0, t)[1];
            canvas.line(thin(GREY), [LEFT - 5.0, y], [LEFT, y]);
            canvas.text(TICKS, [LEFT - 9.0, y + 4.5], Anchor::End, &tick_text(t));
        }
        canvas.rectangle(thin(GREY), [LEFT, TOP], [self.width, self.height]);
        canvas.text(LABEL, [LEFT + self.width / 2.0, bottom + 40.0], Anchor::Middle, "x, px");
        canvas.text_upwards(LABEL, [22.0, TOP + self.height / 2.0], "y, px");
    }

    /// The colours and what they stand for.
    fn bar(&self, canvas: &mut Canvas<Ink>) {
        const BAR_WIDTH: f64 = 16.0;
        let left = LEFT + self.width + 18.0;
        let bottom = TOP + self.height;
        let level = |i: usize| (bottom - self.height * i as f64 / BAR_STEPS as f64).round();
        for i in 0..BAR_STEPS {
            let fill = color((i as f64 + 0.5) / BAR_STEPS as f64);
            canvas.rectangle(opaque(fill), [left, level(i + 1)], [BAR_WIDTH, level(i) - level(i + 1)]);
        }
        for part in [0.0, 0.25, 0.5, 0.75, 1.0] {
            let y = bottom - part * self.height;
            canvas.line(thin(GREY), [left + BAR_WIDTH, y], [left + BAR_WIDTH + 4.0, y]);
            let number = three_digits(part * self.longest);
            canvas.text(TICKS, [left + BAR_WIDTH + 7.0, y + 4.5], Anchor::Start, &number);
        }
        canvas.text_upwards(LABEL, [left + BAR_WIDTH + 80.0, TOP + self.height / 2.0], &self.field.label);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::canvas::{Item, Shape};

    #[test]
    fn colours_darken() {
        let sum = |c: Color| c.iter().map(|v| u32::from(*v)).sum::<u32>();
        for i in 0..20 {
            assert!(sum(color(f64::from(i) / 20.0)) > sum(color(f64::from(i + 1) / 20.0)));
        }
    }

    #[test]
    fn arrows_point_where_the_differences_do() {
        let grid = [9, 9];
        let field = |v: Option<[f64; 2]>| Field {
            title: "t".into(),
            label: "px".into(),
            size: [101.0, 101.0],
            grid,
            vectors: vec![v; 81],
            notes: Vec::new(),
        };
        let lines = |f: &Field| -> Vec<Vec<Point>> {
            let black = solid(BLACK, 1.2);
            let shaft = |i: Item<Ink>| match i {
                Item::Shape { shape: Shape::Runs { runs, .. }, look } if look == black => Some(runs[0].clone()),
                _ => None,
            };
            f.layout().items.into_iter().filter_map(shaft).collect()
        };
        let down = lines(&field(Some([0.0, 0.5])));
        assert_eq!(down.len(), 4);
        assert!(down.iter().all(|p| p[1][0] == p[0][0] && p[1][1] > p[0][1] + 10.0));
        assert!(lines(&field(Some([0.0, 0.0]))).is_empty() && lines(&field(None)).is_empty());
    }
}
