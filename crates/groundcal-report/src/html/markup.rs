//! Pieces of the page that all sections use: figures, tables, numbers as typeset text has them, axes.

use crate::{
    canvas::{
        Anchor, Canvas, Class, Shape,
        scale::Scale,
        svg::{self, Placing, escape},
    },
    number::{self, decimals_of_sigma, typeset},
};

/// A drawing of the page, its looks in the style sheet.
pub(crate) type Drawing = Canvas<Class>;

/// Where there is no value.
pub(crate) const NONE: &str = "\u{2013}";

/// A number with a given number of decimals.
pub(crate) fn fixed(value: f64, decimals: usize) -> String {
    typeset(&number::fixed(value, decimals))
}

/// A value and its deviation with two digits of it.
pub(crate) fn with_sigma(value: f64, sigma: Option<f64>) -> String {
    match sigma {
        Some(s) if s > 0.0 => {
            let decimals = decimals_of_sigma(s);
            format!("{} \u{b1} {}", fixed(value, decimals), fixed(s, decimals))
        }
        _ => fixed(value, 4),
    }
}

/// A power of ten as a decimal number.
pub(crate) fn power_of_ten(power: i32) -> String {
    fixed(10f64.powi(power), (-power).max(0) as usize)
}

/// A count and its word in singular or plural.
pub(crate) fn counted(count: usize, word: &str) -> String {
    format!("{count} {word}{}", if count == 1 { "" } else { "s" })
}

/// The element of a drawing; `label` is read out.
pub(crate) fn drawing(canvas: &Drawing, class: &str, label: &str) -> String {
    svg::element(canvas, &Placing { class, label, px_per_unit: None })
}

/// A figure with its caption (plain text).
pub(crate) fn figure(class: &str, content: &str, caption: &str) -> String {
    format!("<figure class=\"{class}\">{content}<figcaption>{}</figcaption></figure>\n", escape(caption))
}

/// A small symbol of a legend.
pub(crate) fn symbol(look: &str, shape: &Shape) -> String {
    svg::sample("", [14.0, 14.0], look, shape)
}

/// A wider one, for lines.
pub(crate) fn wide_symbol(look: &str, shape: &Shape) -> String {
    svg::sample("wide", [24.0, 14.0], look, shape)
}

/// A table; the first column is the row's heading.
pub(crate) fn table(caption: &str, heads: &[&str], rows: &[Vec<String>]) -> String {
    let head: String = heads.iter().map(|h| format!("<th scope=\"col\">{}</th>", escape(h))).collect();
    let body: String = rows
        .iter()
        .map(|row| {
            let cells: String = row
                .iter()
                .enumerate()
                .map(|(i, v)| match i {
                    0 => format!("<th scope=\"row\">{}</th>", escape(v)),
                    _ => format!("<td>{}</td>", escape(v)),
                })
                .collect();
            format!("<tr>{cells}</tr>\n")
        })
        .collect();
    format!(
        // What is read out belongs to the table; what is seen does not scroll with it.
        "<p class=\"caption\" aria-hidden=\"true\">{0}</p>\n\
         <div class=\"scroll\" tabindex=\"0\" role=\"region\" aria-label=\"{0}\"><table><caption>{0}</caption>\n\
         <thead><tr>{head}</tr></thead>\n<tbody>\n{body}</tbody></table></div>\n",
        escape(caption)
    )
}

/// Class of an attitude's lines: colours and dashes repeat after six.
pub(crate) fn attitude_class(attitude: Option<usize>) -> String {
    format!("s{}", attitude.unwrap_or(0) % 6)
}

/// Grid, ticks and labels of a plot.
pub(crate) struct Axes<'a> {
    /// Left, right, top, bottom of the frame.
    pub(crate) frame: [f64; 4],
    pub(crate) x: &'a Scale,
    pub(crate) y: &'a Scale,
    pub(crate) x_label: &'a str,
    pub(crate) y_label: &'a str,
}

impl Axes<'_> {
    /// Lines at round numbers, in a class, with the numbers; those at zero in another class if there is one.
    pub(crate) fn grid(&self, canvas: &mut Drawing, class: &str, at_zero: &str) {
        let [left, right, top, bottom] = self.frame;
        let (ticks, decimals) = self.x.ticks(6);
        for t in ticks {
            let x = self.x.at(t);
            canvas.line(class, [x, top], [x, bottom]);
            canvas.text("tick", [x, bottom + 17.0], Anchor::Middle, &fixed(t, decimals));
        }
        let (ticks, decimals) = self.y.ticks(5);
        for t in ticks {
            let y = self.y.at(t);
            canvas.line(if t.abs() < 1e-12 { at_zero } else { class }, [left, y], [right, y]);
            canvas.text("tick", [left - 7.0, y + 4.0], Anchor::End, &fixed(t, decimals));
        }
    }

    /// What the axes stand for.
    pub(crate) fn labels(&self, canvas: &mut Drawing) {
        let [left, right, top, bottom] = self.frame;
        canvas.text("tick", [0.5 * (left + right), bottom + 38.0], Anchor::Middle, self.x_label);
        canvas.text_upwards("tick", [13.0, 0.5 * (top + bottom)], self.y_label);
    }

    /// Everything, with lines at the left and below.
    pub(crate) fn draw(&self, canvas: &mut Drawing) {
        let [left, right, top, bottom] = self.frame;
        self.grid(canvas, "grid", "zero");
        canvas.line("axis", [left, bottom], [right, bottom]).line("axis", [left, top], [left, bottom]);
        self.labels(canvas);
    }
}
