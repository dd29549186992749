//! A canvas as SVG. Texts stay texts.

use std::fmt::Write;

use crate::plot::{Anchor, Canvas, Color, Item};

/// The document.
pub fn document(canvas: &Canvas) -> String {
    let mut out = String::new();
    // Writing to a string cannot fail.
    let _ = write_document(&mut out, canvas);
    out
}

fn write_document(w: &mut String, canvas: &Canvas) -> std::fmt::Result {
    let (width, height) = (canvas.width, canvas.height);
    writeln!(
        w,
        r#"<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="{height}" viewBox="0 0 {width} {height}" font-family="'Noto Sans', 'DejaVu Sans', Arial, sans-serif">"#
    )?;
    writeln!(w, r#"<rect width="{width}" height="{height}" fill="white"/>"#)?;
    for item in &canvas.items {
        match item {
            Item::Line { points, color, width, dash } => {
                write!(
                    w,
                    r#"<polyline points="{}" fill="none" stroke="{}" stroke-width="{width}" stroke-linejoin="round""#,
                    coordinates(points),
                    hex(color)
                )?;
                if !dash.is_empty() {
                    let lengths: Vec<String> = dash.iter().map(f64::to_string).collect();
                    write!(w, r#" stroke-dasharray="{}""#, lengths.join(" "))?;
                }
                writeln!(w, "/>")?;
            }
            Item::Area { points, color, opacity } => {
                write!(w, r#"<polygon points="{}" fill="{}""#, coordinates(points), hex(color))?;
                if *opacity < 1.0 {
                    write!(w, r#" fill-opacity="{opacity}""#)?;
                }
                writeln!(w, "/>")?;
            }
            Item::Text { at: [x, y], text, size, anchor, color, upwards } => {
                let anchor = match anchor {
                    Anchor::Start => "start",
                    Anchor::Middle => "middle",
                    Anchor::End => "end",
                };
                write!(
                    w,
                    r#"<text x="{x:.1}" y="{y:.1}" font-size="{size}" text-anchor="{anchor}" fill="{}""#,
                    hex(color)
                )?;
                if *upwards {
                    write!(w, r#" transform="rotate(-90 {x:.1} {y:.1})""#)?;
                }
                writeln!(w, ">{}</text>", escaped(text))?;
            }
        }
    }
    writeln!(w, "</svg>")
}

fn coordinates(points: &[[f64; 2]]) -> String {
    points.iter().map(|[x, y]| format!("{x:.1},{y:.1}")).collect::<Vec<_>>().join(" ")
}

fn hex([r, g, b]: &Color) -> String {
    format!("#{r:02x}{g:02x}{b:02x}")
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}
