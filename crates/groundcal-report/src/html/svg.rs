//! Pieces of SVG inside the page: escaping, elements, axes. Colours come from the page's style sheet by class.

use std::fmt::Write;

/// Text made harmless inside elements and quoted attributes.
pub fn escape(text: &str) -> String {
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

/// A number with a given number of decimals, without a minus before nothing.
pub fn fixed(value: f64, decimals: usize) -> String {
    let text = format!("{value:.decimals$}");
    match text.strip_prefix('-') {
        Some(rest) if rest.bytes().all(|b| b == b'0' || b == b'.') => rest.to_string(),
        _ => text.replace('-', "\u{2212}"),
    }
}

/// A coordinate of a drawing, as short as a tenth of a unit allows.
pub fn short(value: f64) -> String {
    let text = format!("{value:.1}");
    let text = text.strip_suffix(".0").unwrap_or(&text);
    if text == "-0" { "0".into() } else { text.into() }
}

/// Where a text's reference point is.
#[derive(Clone, Copy)]
pub enum Anchor {
    Start,
    Middle,
    End,
}

impl Anchor {
    fn name(self) -> &'static str {
        match self {
            Anchor::Start => "start",
            Anchor::Middle => "middle",
            Anchor::End => "end",
        }
    }
}

/// A drawing being made. Writing to a string cannot fail.
pub struct Svg {
    open: String,
    width: f64,
    scale: Option<f64>,
    body: String,
}

impl Svg {
    /// A drawing whose coordinates run over `view_box` (left, top, width, height); `label` is read out.
    pub fn new(view_box: [f64; 4], class: &str, label: &str) -> Self {
        let [x, y, w, h] = view_box.map(short);
        let open =
            format!(r#"<svg class="{class}" viewBox="{x} {y} {w} {h}" role="img" aria-label="{}""#, escape(label));
        Self { open, width: view_box[2], scale: None, body: String::new() }
    }

    /// Elements made elsewhere.
    pub fn raw(&mut self, elements: &str) -> &mut Self {
        self.body.push_str(elements);
        self
    }

    pub fn line(&mut self, class: &str, [x1, y1]: [f64; 2], [x2, y2]: [f64; 2]) -> &mut Self {
        let [x1, y1, x2, y2] = [x1, y1, x2, y2].map(short);
        let _ = write!(self.body, r#"<line class="{class}" x1="{x1}" y1="{y1}" x2="{x2}" y2="{y2}"/>"#);
        self
    }

    pub fn rect(&mut self, class: &str, [x, y]: [f64; 2], [w, h]: [f64; 2]) -> &mut Self {
        let [x, y, w, h] = [x, y, w.max(0.0), h.max(0.0)].map(short);
        let _ = write!(self.body, r#"<rect class="{class}" x="{x}" y="{y}" width="{w}" height="{h}"/>"#);
        self
    }

    pub fn circle(&mut self, class: &str, [x, y]: [f64; 2], r: f64) -> &mut Self {
        let [x, y, r] = [x, y, r].map(short);
        let _ = write!(self.body, r#"<circle class="{class}" cx="{x}" cy="{y}" r="{r}"/>"#);
        self
    }

    pub fn path(&mut self, class: &str, d: &str) -> &mut Self {
        if !d.is_empty() {
            let _ = write!(self.body, r#"<path class="{class}" d="{d}"/>"#);
        }
        self
    }

    pub fn polyline(&mut self, class: &str, points: &[[f64; 2]], closed: bool) -> &mut Self {
        let d = path_of(points, closed);
        self.path(class, &d)
    }

    /// A text on its base line.
    pub fn text(&mut self, class: &str, [x, y]: [f64; 2], anchor: Anchor, text: &str) -> &mut Self {
        let [x, y] = [x, y].map(short);
        let _ = write!(
            self.body,
            r#"<text class="{class}" x="{x}" y="{y}" text-anchor="{}">{}</text>"#,
            anchor.name(),
            escape(text)
        );
        self
    }

    /// A text that runs upwards.
    pub fn text_up(&mut self, class: &str, [x, y]: [f64; 2], text: &str) -> &mut Self {
        let [x, y] = [x, y].map(short);
        let _ = write!(
            self.body,
            r#"<text class="{class}" transform="translate({x} {y}) rotate(-90)" text-anchor="middle">{}</text>"#,
            escape(text)
        );
        self
    }

    /// Gives the drawing a width of its own, in units of the page's pixels to one of the drawing's.
    pub fn at_scale(&mut self, scale: f64) -> &mut Self {
        self.scale = Some(scale);
        self
    }

    /// The element.
    pub fn finish(self) -> String {
        let own =
            self.scale.map_or(String::new(), |scale| format!(" style=\"width:{}px\"", (self.width * scale).round()));
        format!("{}{own}>{}</svg>", self.open, self.body)
    }
}

/// The path through points.
pub fn path_of(points: &[[f64; 2]], closed: bool) -> String {
    let mut d = String::new();
    for (i, [x, y]) in points.iter().enumerate() {
        let _ = write!(d, "{}{} {}", if i == 0 { "M" } else { "L" }, short(*x), short(*y));
    }
    if closed && !points.is_empty() {
        d.push('Z');
    }
    d
}

/// An arrow from a point along a vector, with a head of a given length.
pub fn arrow(from: [f64; 2], along: [f64; 2], head: f64) -> String {
    let length = along[0].hypot(along[1]);
    let tip = [from[0] + along[0], from[1] + along[1]];
    let mut d = format!("M{} {}L{} {}", short(from[0]), short(from[1]), short(tip[0]), short(tip[1]));
    if length > 1e-9 {
        let (ux, uy) = (along[0] / length, along[1] / length);
        let head = head.min(0.6 * length);
        let [a, b] =
            [0.45, -0.45].map(|side: f64| [tip[0] - head * (ux - side * uy), tip[1] - head * (uy + side * ux)]);
        let _ = write!(
            d,
            "M{} {}L{} {}L{} {}",
            short(a[0]),
            short(a[1]),
            short(tip[0]),
            short(tip[1]),
            short(b[0]),
            short(b[1])
        );
    }
    d
}

/// Maps numbers onto a side of a drawing.
#[derive(Clone, Copy)]
pub struct Scale {
    low: f64,
    high: f64,
    from: f64,
    to: f64,
}

impl Scale {
    /// `low` goes to `from`, `high` to `to`.
    pub fn new([low, high]: [f64; 2], [from, to]: [f64; 2]) -> Self {
        let high = if high > low { high } else { low + 1.0 };
        Self { low, high, from, to }
    }

    pub fn at(&self, value: f64) -> f64 {
        self.from + (value - self.low) / (self.high - self.low) * (self.to - self.from)
    }

    /// Round numbers inside, about `count` of them, and the decimals they need.
    pub fn ticks(&self, count: usize) -> (Vec<f64>, usize) {
        let step = nice_step((self.high - self.low) / count.max(1) as f64);
        let first = (self.low / step - 1e-9).ceil() as i64;
        let last = (self.high / step + 1e-9).floor() as i64;
        let ticks = (first..=last.min(first + 50)).map(|i| i as f64 * step).collect();
        (ticks, decimals_of(step))
    }
}

/// The next larger of 1, 2, 5 times a power of ten.
pub fn nice_step(rough: f64) -> f64 {
    if !(rough.is_finite() && rough > 0.0) {
        return 1.0;
    }
    let power = 10f64.powf(rough.log10().floor());
    let factor = [1.0, 2.0, 5.0].into_iter().find(|f| f * power >= rough * 0.999).unwrap_or(10.0);
    factor * power
}

/// Decimals that multiples of a step need.
pub fn decimals_of(step: f64) -> usize {
    (-(step.log10() + 1e-9).floor()).clamp(0.0, 9.0) as usize
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn markup_in_names_is_harmless() {
        assert_eq!(escape("<a href=\"x\">&'\u{7}"), "&lt;a href=&quot;x&quot;&gt;&amp;&#39; ");
    }

    #[test]
    fn numbers_are_short_and_have_no_minus_before_nothing() {
        assert_eq!((fixed(-0.0004, 3), fixed(-1.5, 1)), ("0.000".into(), "\u{2212}1.5".into()));
        assert_eq!((short(-0.04), short(12.04), short(3.26)), ("0".into(), "12".into(), "3.3".into()));
    }

    #[test]
    fn ticks_are_round_numbers_inside() {
        let (ticks, decimals) = Scale::new([-0.13, 0.42], [0.0, 100.0]).ticks(5);
        assert_eq!(ticks.iter().map(|t| fixed(*t, decimals)).collect::<Vec<_>>(), ["0.0", "0.2", "0.4"]);
        let (ticks, decimals) = Scale::new([0.0, 500.0], [0.0, 100.0]).ticks(5);
        assert_eq!((ticks, decimals), (vec![0.0, 100.0, 200.0, 300.0, 400.0, 500.0], 0));
        // Equal ends do not divide by zero.
        assert!(Scale::new([2.0, 2.0], [0.0, 1.0]).at(2.0).abs() < 1e-12);
    }
}
