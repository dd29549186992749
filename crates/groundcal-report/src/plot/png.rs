//! A canvas as PNG, with the letters of the program: the same picture on every machine.

use image::{
    ExtendedColorType, ImageEncoder,
    codecs::png::{CompressionType, FilterType, PngEncoder},
};
use tiny_skia::{
    Color as SkiaColor, FillRule, LineCap, LineJoin, Paint, Path, PathBuilder, Pixmap, Stroke, StrokeDash, Transform,
};

use crate::plot::{Anchor, Canvas, Color, Item, letters};

/// The file, `scale` pixels for one of the canvas.
///
/// # Errors
/// In words; a canvas without area, or too large for the memory.
pub fn encode(canvas: &Canvas, scale: f64) -> Result<Vec<u8>, String> {
    let (width, height) = ((canvas.width * scale).ceil() as u32, (canvas.height * scale).ceil() as u32);
    let mut pixmap = Pixmap::new(width, height).ok_or_else(|| format!("no picture of {width} x {height} pixels"))?;
    pixmap.fill(SkiaColor::WHITE);
    let pen = Stroke {
        width: letters::PEN as f32,
        line_cap: LineCap::Round,
        line_join: LineJoin::Round,
        ..Stroke::default()
    };
    let whole = Transform::from_scale(scale as f32, scale as f32);
    for item in &canvas.items {
        match item {
            Item::Line { points, color, width, dash } => {
                let stroke = Stroke {
                    width: *width as f32,
                    line_cap: LineCap::Butt,
                    line_join: LineJoin::Round,
                    dash: StrokeDash::new(dash.iter().map(|d| *d as f32).collect(), 0.0),
                    ..Stroke::default()
                };
                if let Some(path) = path(points, false) {
                    pixmap.stroke_path(&path, &paint(color, 1.0), &stroke, whole, None);
                }
            }
            Item::Area { points, color, opacity } => {
                if let Some(path) = path(points, true) {
                    pixmap.fill_path(&path, &paint(color, *opacity), FillRule::Winding, whole, None);
                }
            }
            Item::Text { at, text, size, anchor, color, upwards } => {
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
                if let Some(path) = lines {
                    pixmap.stroke_path(&path, &paint(color, 1.0), &pen, place, None);
                }
            }
        }
    }
    // Everything is drawn on opaque white: alpha says nothing.
    let rgb: Vec<u8> = pixmap.data().chunks_exact(4).flat_map(|p| [p[0], p[1], p[2]]).collect();
    let mut bytes = Vec::new();
    // Flat areas: filters do not help.
    PngEncoder::new_with_quality(&mut bytes, CompressionType::Best, FilterType::NoFilter)
        .write_image(&rgb, width, height, ExtendedColorType::Rgb8)
        .map_err(|e| format!("cannot encode the picture: {e}"))?;
    Ok(bytes)
}

fn paint([r, g, b]: &Color, opacity: f64) -> Paint<'static> {
    let mut paint = Paint::default();
    paint.set_color_rgba8(*r, *g, *b, (255.0 * opacity).round() as u8);
    paint.anti_alias = true;
    paint
}

fn path(points: &[[f64; 2]], closed: bool) -> Option<Path> {
    let mut builder = PathBuilder::new();
    for (i, [x, y]) in points.iter().enumerate() {
        if i == 0 {
            builder.move_to(*x as f32, *y as f32);
        } else {
            builder.line_to(*x as f32, *y as f32);
        }
    }
    if closed {
        builder.close();
    }
    builder.finish()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_canvas_becomes_a_picture_of_its_size() {
        let line = Item::Line { points: vec![[0.0, 5.0], [20.0, 5.0]], color: [255, 0, 0], width: 2.0, dash: &[] };
        let canvas = Canvas { width: 20.0, height: 10.0, items: vec![line] };
        let picture = image::load_from_memory(&encode(&canvas, 2.0).unwrap()).unwrap().to_rgb8();
        assert_eq!(picture.dimensions(), (40, 20));
        assert_eq!(picture.get_pixel(10, 10).0, [255, 0, 0]);
        assert_eq!(picture.get_pixel(10, 2).0, [255; 3]);
    }
}
