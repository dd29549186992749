//! A canvas as PNG, with the letters of the program: the same picture on every machine.

use image::{
    ExtendedColorType, ImageEncoder,
    codecs::png::{CompressionType, FilterType, PngEncoder},
};
use tiny_skia::{
    Color as SkiaColor, FillRule, LineCap, LineJoin, Paint, Path, PathBuilder, Pixmap, Rect, Stroke, StrokeDash,
    Transform,
};

use crate::{
    canvas::{
        item::{Anchor, Canvas, Color, Ink, Item, Mark, Point, Shape},
        letters,
    },
    error::ReportError,
};

/// The file, `scale` pixels for one of the canvas.
///
/// # Errors
/// A canvas without area, or too large for the memory; photographs, which only pages have.
pub fn encode(canvas: &Canvas<Ink>, scale: f64) -> Result<Vec<u8>, ReportError> {
    let [left, top, width, height] = canvas.view;
    let (width, height) = ((width * scale).ceil() as u32, (height * scale).ceil() as u32);
    let mut pixmap =
        Pixmap::new(width, height).ok_or_else(|| ReportError(format!("no picture of {width} x {height} pixels")))?;
    pixmap.fill(SkiaColor::WHITE);
    let whole = Transform::from_scale(scale as f32, scale as f32).pre_translate(-left as f32, -top as f32);
    for item in &canvas.items {
        draw(&mut pixmap, item, whole)?;
    }
    // Everything is drawn on opaque white: alpha says nothing.
    let rgb: Vec<u8> = pixmap.data().chunks_exact(4).flat_map(|p| [p[0], p[1], p[2]]).collect();
    let mut bytes = Vec::new();
    // Flat areas: filters do not help.
    PngEncoder::new_with_quality(&mut bytes, CompressionType::Best, FilterType::NoFilter)
        .write_image(&rgb, width, height, ExtendedColorType::Rgb8)
        .map_err(|e| ReportError(format!("cannot encode the picture: {e}")))?;
    Ok(bytes)
}

fn draw(pixmap: &mut Pixmap, item: &Item<Ink>, whole: Transform) -> Result<(), ReportError> {
    match item {
        Item::Shape { shape, look } => draw_shape(pixmap, shape, look, whole),
        Item::Text { at, text, anchor, upwards, look: Ink::Letters { color, size } } => {
            let size = size / letters::EM;
            let (lines, length) = letters::write(text);
            let start = match anchor {
                Anchor::Start => 0.0,
                Anchor::Middle => -0.5 * length,
                Anchor::End => -length,
            };
            let turn = if *upwards { Transform::from_rotate(-90.0) } else { Transform::identity() };
            let place = whole
                .pre_translate(at[0] as f32, at[1] as f32)
                .pre_concat(turn)
                .pre_scale(size as f32, size as f32)
                .pre_translate(start as f32, 0.0);
            let pen = Stroke {
                width: letters::PEN as f32,
                line_cap: LineCap::Round,
                line_join: LineJoin::Round,
                ..Stroke::default()
            };
            if let Some(path) = lines {
                pixmap.stroke_path(&path, &paint(color, 1.0), &pen, place, None);
            }
        }
        Item::Text { .. } => {}
        Item::Layer { items, .. } => items.iter().try_for_each(|item| draw(pixmap, item, whole))?,
        Item::Picture(_) => return Err(ReportError("a photograph cannot be drawn into a figure as PNG".into())),
    }
    Ok(())
}

fn draw_shape(pixmap: &mut Pixmap, shape: &Shape, look: &Ink, whole: Transform) {
    match look {
        Ink::Line { color, width, dash } => {
            let dot = if let Shape::Marks(Mark::Dot, _) = shape { LineCap::Round } else { LineCap::Butt };
            let stroke = Stroke {
                width: *width as f32,
                line_cap: dot,
                line_join: LineJoin::Round,
                dash: StrokeDash::new(dash.iter().map(|d| *d as f32).collect(), 0.0),
                ..Stroke::default()
            };
            if let Some(path) = path_of(shape) {
                pixmap.stroke_path(&path, &paint(color, 1.0), &stroke, whole, None);
            }
        }
        Ink::Area { color, opacity } => {
            if let Some(path) = path_of(shape) {
                pixmap.fill_path(&path, &paint(color, *opacity), FillRule::Winding, whole, None);
            }
        }
        Ink::Letters { .. } => {}
    }
}

fn paint([r, g, b]: &Color, opacity: f64) -> Paint<'static> {
    let mut paint = Paint::default();
    paint.set_color_rgba8(*r, *g, *b, (255.0 * opacity).round() as u8);
    paint.anti_alias = true;
    paint
}

fn path_of(shape: &Shape) -> Option<Path> {
    let mut builder = PathBuilder::new();
    match shape {
        Shape::Line(from, to) => follow(&mut builder, &[*from, *to], false),
        Shape::Rectangle([x, y], [w, h]) => {
            builder.push_rect(Rect::from_xywh(*x as f32, *y as f32, *w as f32, *h as f32)?)
        }
        Shape::Circle([x, y], radius) => builder.push_circle(*x as f32, *y as f32, *radius as f32),
        Shape::Runs { runs, closed } => runs.iter().for_each(|run| follow(&mut builder, run, *closed)),
        Shape::Marks(mark, places) => places.iter().for_each(|place| draw_mark(&mut builder, *mark, *place)),
    }
    builder.finish()
}

fn draw_mark(builder: &mut PathBuilder, mark: Mark, [x, y]: Point) {
    match mark {
        Mark::Dot => follow(builder, &[[x, y], [x, y]], false),
        Mark::Cross(side) => {
            let s = 0.5 * side;
            follow(builder, &[[x - s, y - s], [x + s, y + s]], false);
            follow(builder, &[[x - s, y + s], [x + s, y - s]], false);
        }
        Mark::Square(side) => {
            let s = 0.5 * side;
            follow(builder, &[[x - s, y - s], [x + s, y - s], [x + s, y + s], [x - s, y + s]], true);
        }
    }
}

fn follow(builder: &mut PathBuilder, points: &[Point], closed: bool) {
    for (i, [x, y]) in points.iter().enumerate() {
        if i == 0 {
            builder.move_to(*x as f32, *y as f32);
        } else {
            builder.line_to(*x as f32, *y as f32);
        }
    }
    if closed && !points.is_empty() {
        builder.close();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn picture_of(canvas: &Canvas<Ink>, scale: f64) -> image::RgbImage {
        image::load_from_memory(&encode(canvas, scale).unwrap()).unwrap().to_rgb8()
    }

    #[test]
    fn a_canvas_becomes_a_picture_of_its_size() {
        let mut canvas = Canvas::new([0.0, 0.0, 20.0, 10.0]);
        canvas.line(Ink::Line { color: [255, 0, 0], width: 2.0, dash: &[] }, [0.0, 5.0], [20.0, 5.0]);
        let picture = picture_of(&canvas, 2.0);
        assert_eq!(picture.dimensions(), (40, 20));
        assert_eq!(picture.get_pixel(10, 10).0, [255, 0, 0]);
        assert_eq!(picture.get_pixel(10, 2).0, [255; 3]);
    }

    #[test]
    fn every_shape_is_drawn_where_it_is() {
        let shapes = [
            Shape::Rectangle([2.0, 2.0], [6.0, 6.0]),
            Shape::Circle([5.0, 5.0], 3.0),
            Shape::polygon(vec![[2.0, 2.0], [8.0, 2.0], [8.0, 8.0], [2.0, 8.0]]),
            Shape::Marks(Mark::Square(6.0), vec![[5.0, 5.0]]),
        ];
        for shape in shapes {
            // The view begins at (-10, 0).
            let mut canvas = Canvas::new([-10.0, 0.0, 20.0, 10.0]);
            canvas.shape(Ink::Area { color: [0; 3], opacity: 1.0 }, shape.clone());
            let picture = picture_of(&canvas, 1.0);
            assert_eq!((picture.get_pixel(15, 5).0, picture.get_pixel(5, 5).0), ([0; 3], [255; 3]), "{shape:?}");
        }
        for mark in [Mark::Dot, Mark::Cross(6.0)] {
            let mut canvas = Canvas::new([0.0, 0.0, 10.0, 10.0]);
            canvas.shape(Ink::Line { color: [0; 3], width: 3.0, dash: &[] }, Shape::Marks(mark, vec![[5.0, 5.0]]));
            assert_eq!(picture_of(&canvas, 1.0).get_pixel(5, 5).0, [0; 3], "{mark:?}");
        }
    }
}
