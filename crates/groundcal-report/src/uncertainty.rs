//! How sure a camera is of where things appear: a grid over the image as text and as figures.

use groundcal::result::ProjectionUncertainty;

use crate::{
    canvas::{Anchor, Canvas, Ink, Shape},
    number::{decimals_of_sigma, fixed, three_digits},
    plot::{
        field::color,
        ink::{BLACK, LABEL, NOTE, PALE, TITLE, WHITE, opaque, thin},
    },
    terminal::{Table, wrapped},
};

/// Width of a column of the text.
const COLUMN: usize = 8;
/// Rows and columns of the text at most.
const MOST: usize = 10;

/// The root mean square of a grid's cells over a part of it; `None` where there is no value.
fn rms(values: impl Iterator<Item = Option<f64>>) -> Option<f64> {
    let (sum, count) = values.flatten().fold((0.0, 0), |(sum, n), v| (sum + v * v, n + 1));
    (count > 0).then(|| (sum / f64::from(count)).sqrt())
}

/// In the middle of the image, over all of it, and where it is largest.
pub(crate) fn in_short(of: &ProjectionUncertainty, px: &[Option<f64>]) -> Option<[f64; 3]> {
    let [columns, rows] = of.cells_xy;
    let near = |i: usize, n: usize| (2 * i + 1).abs_diff(n) <= 2;
    let middle = rms((0..px.len()).filter(|i| near(i % columns, columns) && near(i / columns, rows)).map(|i| px[i]));
    let all = rms(px.iter().copied())?;
    let most = px.iter().flatten().fold(0.0, |m: f64, v| m.max(*v));
    Some([middle.unwrap_or(all), all, most])
}

/// The grid, as coarse as the width asks for.
pub fn text(of: &ProjectionUncertainty, image_size: [usize; 2], width: usize) -> String {
    let [w, h] = image_size;
    let mut out = format!("Image {w} x {h} px; numbers in px, root mean square.\n");
    let kinds = [
        ("Points far away, after the rotation that fits best:", &of.distant_px),
        ("Points of the floor, after the pose that fits best:", &of.floor_px),
    ];
    for (title, px) in kinds {
        let Some([middle, all, most]) = in_short(of, px) else { continue };
        out += &format!("\n{}\n", wrapped(title, 0, width));
        let [a, b, c] = [middle, all, most].map(three_digits);
        out += &wrapped(&format!("in the middle {a}, over the whole image {b}, at most {c}"), 2, width);
        out += "\n\n";
        out += &table(of, px, image_size, most, width);
    }
    out
}

fn table(of: &ProjectionUncertainty, px: &[Option<f64>], [w, h]: [usize; 2], most: f64, width: usize) -> String {
    let [columns, rows] = of.cells_xy;
    let shown = [columns.min(MOST).min(width / COLUMN - 1), rows.min(MOST)];
    // Two digits of the largest.
    let decimals = decimals_of_sigma(most).min(5);
    let part = |i: usize, n: usize, of: usize| (i * of / n)..((i + 1) * of / n);
    let middle = |i: usize, n: usize, side: usize| fixed((i as f64 + 0.5) * side as f64 / n as f64 - 0.5, 0);
    let mut table = Table::new().number("y \\ x");
    for i in 0..shown[0] {
        table = table.number(&middle(i, shown[0], w));
    }
    for j in 0..shown[1] {
        let cell = |i: usize| {
            let cells = part(j, shown[1], rows).flat_map(|r| part(i, shown[0], columns).map(move |c| r * columns + c));
            rms(cells.map(|k| px.get(k).copied().flatten())).map_or("-".into(), |v| fixed(v, decimals))
        };
        table.row([middle(j, shown[1], h)].into_iter().chain((0..shown[0]).map(cell)));
    }
    table.text(width)
}

/// Longer side of a picture, of the grid alone.
const SIDE: f64 = 800.0;
const LEFT: f64 = 20.0;
const TOP: f64 = 48.0;
/// Room for the small print below a narrow image.
const NOTE_WIDTH: f64 = 600.0;
/// Cells narrower than this have no number.
const NARROWEST: f64 = 38.0;

/// A picture of each kind of point, with its name.
pub fn figures(of: &ProjectionUncertainty, image_size: [usize; 2]) -> Vec<(&'static str, Canvas<Ink>)> {
    let kinds = [
        ("distant", "Expected error of points far away, px", &of.distant_px),
        ("floor", "Expected error of points of the floor, px", &of.floor_px),
    ];
    let figure =
        |(name, title, px): (&'static str, &str, &Vec<Option<f64>>)| Some((name, figure(of, px, image_size, title)?));
    kinds.into_iter().filter_map(figure).collect()
}

fn figure(of: &ProjectionUncertainty, px: &[Option<f64>], [w, h]: [usize; 2], title: &str) -> Option<Canvas<Ink>> {
    let [middle, all, most] = in_short(of, px)?;
    let [columns, rows] = of.cells_xy;
    let scale = SIDE / w.max(h) as f64;
    let (width, height) = (w as f64 * scale, h as f64 * scale);
    let [cell_w, cell_h] = [width / columns as f64, height / rows as f64];
    let wide = width.max(NOTE_WIDTH);
    let mut canvas: Canvas<Ink> = Canvas::new([0.0, 0.0, wide + 2.0 * LEFT, TOP + height + 64.0]);
    canvas.text(TITLE, [LEFT + wide / 2.0, 30.0], Anchor::Middle, title);
    for (i, value) in px.iter().enumerate() {
        let corner = [LEFT + (i % columns) as f64 * cell_w, TOP + (i / columns) as f64 * cell_h];
        let part = value.map_or(0.0, |v| v / most.max(f64::MIN_POSITIVE));
        let fill = value.map_or(PALE, |_| color(part));
        canvas.shape(opaque(fill), Shape::Rectangle(corner, [cell_w, cell_h]));
        if let (Some(v), true) = (value, cell_w >= NARROWEST) {
            let letters = Ink::Letters { color: if part > 0.55 { WHITE } else { BLACK }, size: 11.0 };
            canvas.text(
                letters,
                [corner[0] + 0.5 * cell_w, corner[1] + 0.5 * cell_h + 4.0],
                Anchor::Middle,
                &three_digits(*v),
            );
        }
    }
    canvas.shape(thin(BLACK), Shape::Rectangle([LEFT, TOP], [width, height]));
    let [a, b, c] = [middle, all, most].map(three_digits);
    canvas.text(
        LABEL,
        [LEFT, TOP + height + 24.0],
        Anchor::Start,
        &format!("In the middle {a} px, over the image {b}, at most {c}."),
    );
    let hidden = if title.contains("floor") { "pose" } else { "rotation" };
    let note = format!(
        "Root mean square, after the {hidden} of the camera that hides most of it; grey: nothing is seen there."
    );
    canvas.text(NOTE, [LEFT, TOP + height + 44.0], Anchor::Start, &note);
    Some(canvas)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grid() -> ProjectionUncertainty {
        let distant_px = (0..16 * 12).map(|i| Some(0.01 * f64::from(1 + i % 16))).collect();
        let floor_px = (0..16 * 12).map(|i| (i >= 64).then_some(0.5)).collect();
        ProjectionUncertainty { cells_xy: [16, 12], distant_px, attitude: Some(0), floor_px }
    }

    #[test]
    fn the_text_fits_and_says_where() {
        for width in [60, 80, 120] {
            let page = text(&grid(), [800, 600], width);
            assert!(page.lines().all(|l| l.chars().count() <= width), "{width}\n{page}");
            assert!(
                page.split_whitespace().collect::<Vec<_>>().join(" ").contains("at most 0.160")
                    && page.contains("Points of the floor"),
                "{page}"
            );
            let last = page.lines().last().unwrap();
            assert!(last.split_whitespace().skip(1).all(|w| w == "0.50"), "{last}");
        }
        let none = ProjectionUncertainty { floor_px: Vec::new(), attitude: None, ..grid() };
        assert!(!text(&none, [800, 600], 80).contains("floor"));
        assert_eq!(figures(&none, [800, 600]).len(), 1);
    }

    #[test]
    fn texts_of_the_pictures_fit_with_the_letters_there_are() {
        for size in [[800, 600], [400, 1000]] {
            for (_, canvas) in figures(&grid(), size) {
                for text in canvas.texts(1.0) {
                    assert!(text.has_letters && text.along[0] >= 0.0 && text.along[1] <= canvas.view[2], "{text:?}");
                }
            }
        }
    }
}
