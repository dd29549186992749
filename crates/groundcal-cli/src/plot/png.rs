//! A canvas as PNG, in the font that comes with the program: the same picture on every machine.

use image::{
    ExtendedColorType, ImageEncoder,
    codecs::png::{CompressionType, FilterType, PngEncoder},
};
use tiny_skia::{
    Color as SkiaColor, FillRule, LineCap, LineJoin, Paint, Path, PathBuilder, Pixmap, Stroke, StrokeDash, Transform,
};
use ttf_parser::{Face, OutlineBuilder};

use super::{Anchor, Canvas, Color, Item};

/// Noto Sans Regular, the letters a figure needs (SIL Open Font License, see the file beside it).
const FONT: &[u8] = include_bytes!("../../assets/NotoSans-subset.ttf");

/// The file, `scale` pixels for one of the canvas.
///
/// # Errors
/// In words; a canvas without area, or too large for the memory.
pub fn encode(canvas: &Canvas, scale: f64) -> Result<Vec<u8>, String> {
    let (width, height) = ((canvas.width * scale).ceil() as u32, (canvas.height * scale).ceil() as u32);
    let mut pixmap = Pixmap::new(width, height).ok_or_else(|| format!("no picture of {width} x {height} pixels"))?;
    pixmap.fill(SkiaColor::WHITE);
    let face = Face::parse(FONT, 0).map_err(|e| format!("the built-in font cannot be read: {e}"))?;
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
                let size = size / f64::from(face.units_per_em());
                let (outline, length) = outline(&face, text);
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
                if let Some(path) = outline {
                    pixmap.fill_path(&path, &paint(color, 1.0), FillRule::Winding, place, None);
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

/// Letters one after the other on the base line, and their length; font units, y down.
fn outline(face: &Face<'_>, text: &str) -> (Option<Path>, f64) {
    let mut pen = Pen { builder: PathBuilder::new(), x: 0.0 };
    for letter in text.chars() {
        let Some(glyph) = face.glyph_index(letter) else { continue };
        face.outline_glyph(glyph, &mut pen);
        pen.x += f32::from(face.glyph_hor_advance(glyph).unwrap_or(0));
    }
    (pen.builder.finish(), f64::from(pen.x))
}

struct Pen {
    builder: PathBuilder,
    x: f32,
}

impl OutlineBuilder for Pen {
    fn move_to(&mut self, x: f32, y: f32) {
        self.builder.move_to(self.x + x, -y);
    }

    fn line_to(&mut self, x: f32, y: f32) {
        self.builder.line_to(self.x + x, -y);
    }

    fn quad_to(&mut self, x1: f32, y1: f32, x: f32, y: f32) {
        self.builder.quad_to(self.x + x1, -y1, self.x + x, -y);
    }

    fn curve_to(&mut self, x1: f32, y1: f32, x2: f32, y2: f32, x: f32, y: f32) {
        self.builder.cubic_to(self.x + x1, -y1, self.x + x2, -y2, self.x + x, -y);
    }

    fn close(&mut self) {
        self.builder.close();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_font_has_the_letters_of_the_figures() {
        let face = Face::parse(FONT, 0).unwrap();
        let missing: String =
            "0123456789.,%|()-:abcxyzABCXYZ é°±".chars().filter(|c| face.glyph_index(*c).is_none()).collect();
        assert_eq!(missing, "");
        assert!(outline(&face, "Cramér-Rao").1 > outline(&face, "Cram").1);
    }

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
