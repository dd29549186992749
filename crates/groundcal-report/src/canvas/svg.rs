//! A canvas as SVG: a document of its own in inks, or an element of a page in classes. Texts stay texts.

use crate::{
    canvas::item::{Anchor, Canvas, Class, Color, Ink, Item, Mark, Picture, Point, Shape},
    number::coordinate,
};

/// The document, on white ground.
pub fn document(canvas: &Canvas<Ink>) -> String {
    let [left, top, width, height] = canvas.view.map(coordinate);
    let mut out = format!(
        r#"<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="{height}" viewBox="{left} {top} {width} {height}" font-family="'Noto Sans', 'DejaVu Sans', Arial, sans-serif">"#
    );
    out.push_str(&format!("\n<rect x=\"{left}\" y=\"{top}\" width=\"{width}\" height=\"{height}\" fill=\"white\"/>\n"));
    for item in &canvas.items {
        write_item(&mut out, item);
        out.push('\n');
    }
    out.push_str("</svg>\n");
    out
}

/// How a drawing stands in a page.
pub(crate) struct Placing<'a> {
    /// Class of the element.
    pub(crate) class: &'a str,
    /// Read out where the drawing is not seen.
    pub(crate) label: &'a str,
    /// Pixels of the page to a unit of the drawing; as wide as there is room without.
    pub(crate) px_per_unit: Option<f64>,
}

/// An element of a page whose style sheet knows the classes.
pub(crate) fn element(canvas: &Canvas<Class>, placing: &Placing) -> String {
    let [left, top, width, height] = canvas.view.map(coordinate);
    let mut out = format!(
        r#"<svg class="{}" viewBox="{left} {top} {width} {height}" role="img" aria-label="{}""#,
        placing.class,
        escape(placing.label)
    );
    if let Some(scale) = placing.px_per_unit {
        out.push_str(&format!(" style=\"width:{}px\"", (canvas.view[2] * scale).round()));
    }
    out.push('>');
    canvas.items.iter().for_each(|item| write_item(&mut out, item));
    out.push_str("</svg>");
    out
}

/// A small sample of a look beside a word, in a page.
pub(crate) fn sample(class: &str, [width, height]: [f64; 2], look: &str, shape: &Shape) -> String {
    let class = if class.is_empty() { String::new() } else { format!(" class=\"{class}\"") };
    let [width, height] = [width, height].map(coordinate);
    let mut out = format!("<svg{class} viewBox=\"0 0 {width} {height}\" aria-hidden=\"true\">");
    write_shape(&mut out, shape, &Class::from(look));
    out.push_str("</svg>");
    out
}

/// What an element says of its look.
trait Look {
    /// Attributes, each after a space.
    fn attributes(&self) -> String;
}

impl Look for Class {
    fn attributes(&self) -> String {
        format!(" class=\"{}\"", self.0)
    }
}

impl Look for Ink {
    fn attributes(&self) -> String {
        match self {
            Ink::Line { color, width, dash } => {
                let dash = if dash.is_empty() {
                    String::new()
                } else {
                    let lengths: Vec<String> = dash.iter().map(f64::to_string).collect();
                    format!(" stroke-dasharray=\"{}\"", lengths.join(" "))
                };
                let color = hex(color);
                format!(" fill=\"none\" stroke=\"{color}\" stroke-width=\"{width}\" stroke-linejoin=\"round\"{dash}")
            }
            Ink::Area { color, opacity } if *opacity < 1.0 => {
                format!(" fill=\"{}\" fill-opacity=\"{opacity}\"", hex(color))
            }
            Ink::Area { color, .. } => format!(" fill=\"{}\"", hex(color)),
            Ink::Letters { color, size } => format!(" font-size=\"{size}\" fill=\"{}\"", hex(color)),
        }
    }
}

fn hex([r, g, b]: &Color) -> String {
    format!("#{r:02x}{g:02x}{b:02x}")
}

fn write_item<L: Look>(out: &mut String, item: &Item<L>) {
    match item {
        Item::Shape { shape, look } => write_shape(out, shape, look),
        Item::Text { at, text, anchor, upwards, look } => {
            let [x, y] = at.map(coordinate);
            let place = if *upwards {
                format!("transform=\"translate({x} {y}) rotate(-90)\"")
            } else {
                format!("x=\"{x}\" y=\"{y}\"")
            };
            let anchor = match anchor {
                Anchor::Start => "start",
                Anchor::Middle => "middle",
                Anchor::End => "end",
            };
            out.push_str(&format!(
                "<text{} {place} text-anchor=\"{anchor}\">{}</text>",
                look.attributes(),
                escape(text)
            ));
        }
        Item::Layer { name, items } => {
            out.push_str(&format!("<g data-layer=\"{name}\">"));
            items.iter().for_each(|item| write_item(out, item));
            out.push_str("</g>");
        }
        Item::Picture(picture) => write_picture(out, picture),
    }
}

fn write_shape<L: Look>(out: &mut String, shape: &Shape, look: &L) {
    let look = look.attributes();
    match shape {
        Shape::Line(from, to) => {
            let ([x1, y1], [x2, y2]) = (from.map(coordinate), to.map(coordinate));
            out.push_str(&format!(r#"<line{look} x1="{x1}" y1="{y1}" x2="{x2}" y2="{y2}"/>"#));
        }
        Shape::Rectangle(corner, size) => {
            let ([x, y], [w, h]) = (corner.map(coordinate), size.map(coordinate));
            out.push_str(&format!(r#"<rect{look} x="{x}" y="{y}" width="{w}" height="{h}"/>"#));
        }
        Shape::Circle([x, y], radius) => {
            let [x, y, r] = [*x, *y, *radius].map(coordinate);
            out.push_str(&format!(r#"<circle{look} cx="{x}" cy="{y}" r="{r}"/>"#));
        }
        Shape::Runs { runs, closed } => {
            let way: String = runs.iter().map(|run| way_through(run, *closed)).collect();
            out.push_str(&format!(r#"<path{look} d="{way}"/>"#));
        }
        Shape::Marks(mark, places) => {
            let way: String = places.iter().map(|place| way_of_mark(*mark, *place)).collect();
            out.push_str(&format!(r#"<path{look} d="{way}"/>"#));
        }
    }
}

fn way_through(points: &[Point], closed: bool) -> String {
    let mut way = String::new();
    for (i, point) in points.iter().enumerate() {
        let [x, y] = point.map(coordinate);
        way.push_str(&format!("{}{x} {y}", if i == 0 { "M" } else { "L" }));
    }
    if closed && !points.is_empty() {
        way.push('Z');
    }
    way
}

/// As few letters as will do: a page has thousands of marks.
fn way_of_mark(mark: Mark, [x, y]: Point) -> String {
    let from = |side: f64| [x - 0.5 * side, y - 0.5 * side].map(coordinate);
    match mark {
        Mark::Dot => {
            let [x, y] = from(0.0);
            format!("M{x} {y}h0")
        }
        Mark::Cross(side) => {
            let ([x, y], s) = (from(side), coordinate(side));
            format!("M{x} {y}l{s} {s}m-{s} 0l{s}-{s}")
        }
        Mark::Square(side) => {
            let ([x, y], s) = (from(side), coordinate(side));
            format!("M{x} {y}h{s}v{s}h-{s}Z")
        }
    }
}

fn write_picture(out: &mut String, picture: &Picture) {
    match picture {
        Picture::Shared(id) => out.push_str(&format!("<use href=\"#{id}\"/>")),
        Picture::Own { uri, corner, size, class, clip } => {
            let ([x, y], [w, h]) = (corner.map(coordinate), size.map(coordinate));
            let (id, outline) = (&clip.id, way_through(&clip.outline, true));
            out.push_str(&format!(
                "<clipPath id=\"{id}\"><path d=\"{outline}\"/></clipPath><g clip-path=\"url(#{id})\" class=\"{}\"><image x=\"{x}\" \
                 y=\"{y}\" width=\"{w}\" height=\"{h}\" preserveAspectRatio=\"none\" href=\"{uri}\"/></g>",
                class.0
            ));
        }
    }
}

/// Text made harmless inside elements and quoted attributes.
pub(crate) fn escape(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            '\'' => out.push_str("&#39;"),
            // Control characters are not allowed in the page at all.
            c if c.is_control() => out.push(' '),
            c => out.push(c),
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn markup_in_names_is_harmless() {
        assert_eq!(escape("<a href=\"x\">&'\u{7}"), "&lt;a href=&quot;x&quot;&gt;&amp;&#39; ");
    }

    #[test]
    fn one_list_of_items_in_inks_and_in_classes() {
        let shapes = || {
            [
                Shape::Line([0.0, 1.0], [2.5, 3.0]),
                Shape::polygon(vec![[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]]),
                Shape::Marks(Mark::Cross(7.0), vec![[10.0, 10.0]]),
            ]
        };
        let mut of_page = Canvas::<Class>::new([0.0, 0.0, 20.0, 10.0]);
        let mut alone = Canvas::<Ink>::new([0.0, 0.0, 20.0, 10.0]);
        for shape in shapes() {
            of_page.shape("grid", shape.clone());
            alone.shape(Ink::Line { color: [255, 0, 0], width: 1.5, dash: &[] }, shape);
        }
        // Nothing to draw is not drawn.
        of_page.shape("grid", Shape::Marks(Mark::Dot, Vec::new()));
        let page = element(&of_page, &Placing { class: "plot", label: "a & b", px_per_unit: Some(2.0) });
        assert_eq!(
            page,
            "<svg class=\"plot\" viewBox=\"0 0 20 10\" role=\"img\" aria-label=\"a &amp; b\" style=\"width:40px\">\
             <line class=\"grid\" x1=\"0\" y1=\"1\" x2=\"2.5\" y2=\"3\"/><path class=\"grid\" d=\"M0 0L1 0L1 1Z\"/>\
             <path class=\"grid\" d=\"M6.5 6.5l7 7m-7 0l7-7\"/></svg>"
        );
        let document = document(&alone);
        for part in ["d=\"M0 0L1 0L1 1Z\"", "x1=\"0\" y1=\"1\" x2=\"2.5\"", "stroke=\"#ff0000\" stroke-width=\"1.5\""] {
            assert!(document.contains(part), "{part}");
        }
    }
}
