//! A field of vectors over an image: colours for their lengths, arrows for a part of them.

use crate::plot::{
    Anchor, Axis, BLACK, Canvas, Color, GREY, Item, LABEL_SIZE, NOTE_SIZE, TICK_SIZE, TITLE_SIZE, text, tick_text,
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

/// Pale to dark, so that it reads without colour too.
const STOPS: [Color; 5] = [[255, 250, 225], [250, 205, 125], [225, 130, 90], [150, 60, 110], [55, 20, 85]];
const NOTHING: Color = [205, 205, 205];

/// Vectors on a regular grid that spans the image from the first to the last pixel centre.
pub struct Field {
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
fn color(value: f64) -> Color {
    let at = value.clamp(0.0, 1.0) * (STOPS.len() - 1) as f64;
    let i = (at as usize).min(STOPS.len() - 2);
    let part = at - i as f64;
    std::array::from_fn(|c| (f64::from(STOPS[i][c]) * (1.0 - part) + f64::from(STOPS[i + 1][c]) * part).round() as u8)
}

fn rectangle(left: f64, top: f64, right: f64, bottom: f64) -> Vec<[f64; 2]> {
    vec![[left, top], [right, top], [right, bottom], [left, bottom]]
}

/// A round number not above the value: 1, 2 or 5 times a power of ten.
fn round_down(value: f64) -> f64 {
    let power = 10f64.powf(value.log10().floor());
    [5.0, 2.0, 1.0].iter().map(|m| m * power).find(|s| *s <= value * (1.0 + 1e-9)).unwrap_or(power)
}

/// A number with three digits, without an exponent where it can be read.
pub fn short(value: f64) -> String {
    if value == 0.0 {
        return "0".into();
    }
    let places = 2 - value.abs().log10().floor() as i32;
    if places > 8 { format!("{value:.2e}") } else { format!("{value:.*}", places.max(0) as usize) }
}

impl Field {
    /// Every line, area and text.
    pub fn layout(&self) -> Canvas {
        let [w, h] = self.size;
        let scale = ((WIDTH - LEFT - RIGHT) / w).min(MAX_HEIGHT / h);
        let (width, height) = ((w * scale).round(), (h * scale).round());
        let lengths = || self.vectors.iter().flatten().map(|v| v[0].hypot(v[1]));
        let longest = lengths().fold(0.0, f64::max);
        // Pixel centres: the picture begins half a pixel before the first.
        let place = |x: f64, y: f64| [LEFT + (x + 0.5) * width / w, TOP + (y + 0.5) * height / h];
        let node = |i: usize, n: usize, side: f64| i as f64 / (n - 1) as f64 * (side - 1.0);
        let mut items = vec![text([LEFT + width / 2.0, 28.0], &self.title, TITLE_SIZE, Anchor::Middle, BLACK)];

        // Cells reach half way to the neighbours; whole canvas pixels leave no seams.
        let edge = |i: usize, n: usize, start: f64, length: f64| {
            let at = (i as f64 - 0.5).clamp(0.0, (n - 1) as f64) / (n - 1) as f64;
            (start + at * length).round()
        };
        let [columns, rows] = self.grid;
        for row in 0..rows {
            for column in 0..columns {
                let value = self.vectors[row * columns + column].map(|v| v[0].hypot(v[1]));
                let fill = value.map_or(NOTHING, |v| color(if longest > 0.0 { v / longest } else { 0.0 }));
                let (left, right) = (edge(column, columns, LEFT, width), edge(column + 1, columns, LEFT, width));
                let (top, bottom) = (edge(row, rows, TOP, height), edge(row + 1, rows, TOP, height));
                items.push(Item::Area { points: rectangle(left, top, right, bottom), color: fill, opacity: 1.0 });
            }
        }

        let spacing = width / (columns - 1) as f64 * ARROW_STEP as f64;
        let mut notes = self.notes.clone();
        if longest > 0.0 {
            // The longest arrow spans at most the way to the next; a round factor can be read off.
            let factor = round_down(0.95 * spacing / (longest * scale));
            // Centred on points half a step inside, none leaves the picture.
            let inside = |n: usize| (ARROW_STEP / 2..n.saturating_sub(ARROW_STEP / 2)).step_by(ARROW_STEP);
            for row in inside(rows) {
                for column in inside(columns) {
                    if let Some(v) = self.vectors[row * columns + column] {
                        let [x, y] = place(node(column, columns, w), node(row, rows, h));
                        let [dx, dy] = v.map(|d| d * scale * factor);
                        arrow(&mut items, [x - 0.5 * dx, y - 0.5 * dy], [dx, dy]);
                    }
                }
            }
            notes.push(format!("Arrows are {} times as long as the differences at their middles.", tick_text(factor)));
        }
        if self.vectors.iter().any(Option::is_none) {
            notes.push("Grey: one of the lens models gives nothing there.".into());
        }

        self.axes(&mut items, [width, height], &place);
        bar(&mut items, LEFT + width + 18.0, height, longest, &self.label);
        let mut top = TOP + height + 52.0;
        for note in &notes {
            top += NOTE_ROW;
            items.push(text([LEFT, top], note, NOTE_SIZE, Anchor::Start, GREY));
        }
        Canvas { width: LEFT + width + RIGHT, height: (top + 14.0).ceil(), items }
    }

    fn axes(&self, items: &mut Vec<Item>, [width, height]: [f64; 2], place: &impl Fn(f64, f64) -> [f64; 2]) {
        let plain = |points: Vec<[f64; 2]>| Item::Line { points, color: GREY, width: 1.0, dash: &[] };
        let (right, bottom) = (LEFT + width, TOP + height);
        for t in Axis::new([0.0, self.size[0] - 1.0].into_iter(), false).ticks {
            let x = place(t, 0.0)[0];
            items.push(plain(vec![[x, bottom], [x, bottom + 5.0]]));
            items.push(text([x, bottom + 19.0], &tick_text(t), TICK_SIZE, Anchor::Middle, BLACK));
        }
        for t in Axis::new([0.0, self.size[1] - 1.0].into_iter(), false).ticks {
            let y = place(0.0, t)[1];
            items.push(plain(vec![[LEFT - 5.0, y], [LEFT, y]]));
            items.push(text([LEFT - 9.0, y + 4.5], &tick_text(t), TICK_SIZE, Anchor::End, BLACK));
        }
        items.push(plain(vec![[LEFT, TOP], [right, TOP], [right, bottom], [LEFT, bottom], [LEFT, TOP]]));
        items.push(text([LEFT + width / 2.0, bottom + 40.0], "x, px", LABEL_SIZE, Anchor::Middle, BLACK));
        items.push(upwards([22.0, TOP + height / 2.0], "y, px"));
    }
}

fn upwards(at: [f64; 2], words: &str) -> Item {
    Item::Text { at, text: words.into(), size: LABEL_SIZE, anchor: Anchor::Middle, color: BLACK, upwards: true }
}

fn bar(items: &mut Vec<Item>, left: f64, height: f64, longest: f64, label: &str) {
    const BAR_WIDTH: f64 = 16.0;
    let bottom = TOP + height;
    let level = |i: usize| (bottom - height * i as f64 / BAR_STEPS as f64).round();
    for i in 0..BAR_STEPS {
        let fill = color((i as f64 + 0.5) / BAR_STEPS as f64);
        let points = rectangle(left, level(i + 1), left + BAR_WIDTH, level(i));
        items.push(Item::Area { points, color: fill, opacity: 1.0 });
    }
    for part in [0.0, 0.25, 0.5, 0.75, 1.0] {
        let y = bottom - part * height;
        let points = vec![[left + BAR_WIDTH, y], [left + BAR_WIDTH + 4.0, y]];
        items.push(Item::Line { points, color: GREY, width: 1.0, dash: &[] });
        items.push(text([left + BAR_WIDTH + 7.0, y + 4.5], &short(part * longest), TICK_SIZE, Anchor::Start, BLACK));
    }
    items.push(upwards([left + BAR_WIDTH + 80.0, TOP + height / 2.0], label));
}

/// A line with a head, on a pale rim that shows it on dark ground.
fn arrow(items: &mut Vec<Item>, from: [f64; 2], [dx, dy]: [f64; 2]) {
    let length = dx.hypot(dy);
    if length < 1.0 {
        return;
    }
    let to = [from[0] + dx, from[1] + dy];
    let (ux, uy) = (dx / length, dy / length);
    let head = (0.35 * length).min(5.0);
    let side = |s: f64| [to[0] - head * (ux - s * 0.6 * uy), to[1] - head * (uy + s * 0.6 * ux)];
    for (color, width) in [([255; 3], 3.0), (BLACK, 1.2)] {
        items.push(Item::Line { points: vec![from, to], color, width, dash: &[] });
        items.push(Item::Line { points: vec![side(1.0), to, side(-1.0)], color, width, dash: &[] });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_darken_and_factors_are_round() {
        let sum = |c: Color| c.iter().map(|v| u32::from(*v)).sum::<u32>();
        for i in 0..20 {
            assert!(sum(color(f64::from(i) / 20.0)) > sum(color(f64::from(i + 1) / 20.0)));
        }
        for (value, expected) in [(7.3, 5.0), (5.0, 5.0), (1.99, 1.0), (0.021, 0.02), (431.0, 200.0)] {
            assert!((round_down(value) / expected - 1.0).abs() < 1e-12, "{value}");
        }
        for (value, text) in
            [(0.0, "0"), (0.01234, "0.0123"), (12.345, "12.3"), (1234.5, "1234"), (3.2e-12, "3.20e-12")]
        {
            assert_eq!(short(value), text);
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
        let lines = |f: &Field| -> Vec<Vec<[f64; 2]>> {
            let two = |i: Item| match i {
                Item::Line { points, width, .. } if width == 1.2 && points.len() == 2 => Some(points),
                _ => None,
            };
            f.layout().items.into_iter().filter_map(two).collect()
        };
        let down = lines(&field(Some([0.0, 0.5])));
        assert_eq!(down.len(), 4);
        assert!(down.iter().all(|p| p[1][0] == p[0][0] && p[1][1] > p[0][1] + 10.0));
        assert!(lines(&field(Some([0.0, 0.0]))).is_empty() && lines(&field(None)).is_empty());
    }
}
