//! Residuals against the radius, over the image plane, per image.

use groundcal::result::Calibration;

use crate::{
    canvas::{
        Anchor, Point, Shape,
        arrow::{Head, arrow},
        scale::{Scale, nice_step},
    },
    html::{
        markup::{Axes, Drawing, drawing, figure, fixed, symbol, table},
        model::residuals::{Field, Histogram, Residuals, Ring},
    },
    number::{decimals_of_sigma, decimals_of_step},
};

/// Images whose residuals are drawn one by one.
const DRAWN: usize = 40;
/// Deviations from which on a mean is drawn bold.
const BOLD: f64 = 3.0;
const HEAD: Head = Head { longest: 6.0, part: 0.6, spread: 0.45 };
/// Residuals so many times as large as those of single homographies are not explained.
const MANY_TIMES: f64 = 2.5;

pub(crate) fn section(c: &Calibration, r: &Residuals) -> String {
    let longest_of_all = longest(&r.all, false);
    let all = Arrows { field: &r.all, c, longest: longest_of_all, width: 520.0, key: true };
    let over_the_image = figure(
        "half",
        &all.drawing("All images"),
        "Mean residuals of all images over the image plane (measured less predicted). Bold: more than three standard deviations. \
         Arrows that point in or out together are the lens; arrows of one place a thing on the floor.",
    );
    format!(
        "{}{}<div class=\"figures\">\n{}{}{over_the_image}</div>\n{}{}",
        of_the_radius(r),
        of_the_model(r),
        histogram(&r.histogram),
        against_radius(&r.rings),
        image_by_image(c, r),
        table_of_images(r)
    )
}

/// Whether something is left that depends on the radius.
fn of_the_radius(r: &Residuals) -> String {
    if r.radial_significance > 4.0 {
        format!(
            "<p class=\"note\"><strong>Something that depends on the radius is left:</strong> {} px outwards in one ring, {} standard \
             deviations. Usual causes: a lens model that is too simple (see <code>--lens</code>), or a floor that is not flat.</p>\n",
            fixed(r.radial_px, 3),
            fixed(r.radial_significance, 1)
        )
    } else {
        format!(
            "<p>No ring about the principal point has a mean radial residual of more than {} standard deviations: nothing is left \
             that a better lens model would explain.</p>\n",
            fixed(r.radial_significance.max(0.1), 1)
        )
    }
}

/// Whether one camera explains what each pair's homography explains.
fn of_the_model(r: &Residuals) -> String {
    let [patches, points] = r.times_own;
    let kinds = [("patches", patches), ("points", points)].into_iter().filter_map(|(kind, t)| Some((kind, t?)));
    let times: Vec<String> = kinds.map(|(kind, t)| format!("{} times ({kind})", fixed(t, 2))).collect();
    // Features of images have errors of their own that patches have not: patches tell, where there are any.
    let worst = patches.or(points).unwrap_or(1.0);
    let text = format!(
        "Residuals are {} as large as those about a homography of each pair's own (1: the camera explains them as well)",
        times.join(" and ")
    );
    if worst > MANY_TIMES {
        format!(
            "<p class=\"note\"><strong>The model does not explain the matches:</strong> {text}. A motion is wrong, or the lens model too simple.</p>\n"
        )
    } else if times.is_empty() {
        String::new()
    } else {
        format!("<p>{text}.</p>\n")
    }
}

fn image_by_image(c: &Calibration, r: &Residuals) -> String {
    let mut out = String::from("<h3>Image by image</h3>\n<div class=\"small\">\n");
    let common = longest_of_tiles(r);
    for image in r.images.iter().take(DRAWN) {
        let caption =
            format!("{}: {} px rms, {} deviations", image.name, fixed(image.rms_px, 3), fixed(image.weighted_rms, 2));
        let arrows = Arrows { field: &image.field, c, longest: common, width: 240.0, key: false };
        out.push_str(&figure("tile", &arrows.drawing(&image.name), &caption));
    }
    out.push_str(&format!(
        "</div>\n<p class=\"legend\">The longest arrows of these pictures are {} px; the same scale in all.</p>\n",
        fixed(common, decimals_of_sigma(common))
    ));
    if r.images.len() > DRAWN {
        out.push_str(&format!("<p>The first {DRAWN} of {} images; all are in the table.</p>\n", r.images.len()));
    }
    out
}

fn table_of_images(r: &Residuals) -> String {
    let rows: Vec<Vec<String>> = r
        .images
        .iter()
        .map(|i| {
            vec![
                i.name.clone(),
                i.observations.to_string(),
                fixed(i.rms_px, 3),
                fixed(i.weighted_rms, 2),
                format!("{} ({} %)", i.downweighted, fixed(100.0 * i.downweighted as f64 / i.observations as f64, 1)),
            ]
        })
        .collect();
    table(
        "Residuals of each image (deviations: as all images together show them; 1 is average, more where something does not fit)",
        &["image", "points", "rms, px", "rms, deviations", "counted less"],
        &rows,
    )
}

/// How many residuals are how long, and how many would be by chance.
fn histogram(h: &Histogram) -> String {
    let (left, right, top, bottom) = (66.0, 500.0, 12.0, 300.0);
    let total: usize = h.counts.iter().sum::<usize>() + h.beyond;
    let share = |n: usize| 100.0 * n as f64 / total.max(1) as f64;
    let end = h.step * h.counts.len() as f64;
    // Rayleigh's distribution: the length of two independent residuals of one deviation.
    let survives = |d: f64| (-0.5 * d * d).exp();
    let expected = |i: usize| 100.0 * (survives(h.step * i as f64) - survives(h.step * (i + 1) as f64));
    let most = (0..h.counts.len()).map(|i| share(h.counts[i]).max(expected(i))).fold(1.0, f64::max);
    let (x, y) = (Scale::new([0.0, end], [left, right]), Scale::new([0.0, 1.08 * most], [bottom, top]));
    let mut svg = Drawing::new([0.0, 0.0, 520.0, 346.0]);
    let axes = Axes {
        frame: [left, right, top, bottom],
        x: &x,
        y: &y,
        x_label: "length of a residual, standard deviations",
        y_label: "residuals, %",
    };
    axes.draw(&mut svg);
    for (i, n) in h.counts.iter().enumerate() {
        let [from, to] = [x.at(h.step * i as f64), x.at(h.step * (i + 1) as f64)];
        let height = y.at(share(*n));
        svg.rectangle("bar", [from + 0.5, height], [to - from - 1.0, bottom - height]);
    }
    let curve = (0..h.counts.len()).map(|i| [x.at(h.step * (i as f64 + 0.5)), y.at(expected(i))]).collect();
    svg.shape("second", Shape::polyline(curve));
    figure(
        "half",
        &drawing(&svg, "plot", "Histogram of the lengths of residuals"),
        &format!(
            "How long the residuals are (bars), and how long Gaussian noise would make them (line): matches of pictures have more short and more \
             long ones. {} of {total} are longer than {} deviations ({} by chance); they count less.",
            h.beyond,
            fixed(end, 0),
            fixed(total as f64 * survives(end), 1)
        ),
    )
}

fn against_radius(rings: &[Ring]) -> String {
    let (left, right, top, bottom) = (66.0, 500.0, 12.0, 300.0);
    let farthest = rings.last().map_or(1.0, |r| r.radius_px[1]);
    let most = rings
        .iter()
        .flat_map(|r| [r.radial_px, r.tangential_px].map(|v| v.abs() + 2.0 * r.sigma_px))
        .fold(1e-6, f64::max);
    let (x, y) = (Scale::new([0.0, farthest], [left, right]), Scale::new([-1.1 * most, 1.1 * most], [bottom, top]));
    let mut svg = Drawing::new([0.0, 0.0, 520.0, 346.0]);
    let axes = Axes {
        frame: [left, right, top, bottom],
        x: &x,
        y: &y,
        x_label: "distance from the principal point, px",
        y_label: "mean residual, px",
    };
    axes.draw(&mut svg);
    for r in rings {
        let [u, v] = [x.at(r.at_px) - 4.0, x.at(r.at_px) + 4.0];
        let bar = |value: f64| [y.at(value - 2.0 * r.sigma_px), y.at(value + 2.0 * r.sigma_px)];
        let [low, high] = bar(r.tangential_px);
        svg.line("second", [v, low], [v, high]);
        svg.rectangle("second open", [v - 4.0, y.at(r.tangential_px) - 4.0], [8.0, 8.0]);
        let [low, high] = bar(r.radial_px);
        svg.line("first", [u, low], [u, high]);
        svg.circle("first dot", [u, y.at(r.radial_px)], 4.5);
    }
    let legend = format!(
        "<p class=\"legend\">{} outwards {} across (clockwise)</p>",
        symbol("first dot", &Shape::Circle([7.0, 7.0], 4.5)),
        symbol("second open", &Shape::Rectangle([3.0, 3.0], [8.0, 8.0]))
    );
    let rings = drawing(&svg, "plot", "Mean residual against the distance from the principal point");
    figure(
        "half",
        &format!("{rings}{legend}"),
        "Mean residual in rings about the principal point with equally many points, bars of two standard deviations. A curve of the \
         circles away from zero is distortion left over.",
    )
}

/// Length of the longest mean residual, of all or of those that are no chance (then possibly none: 0).
fn longest(field: &Field, bold_only: bool) -> f64 {
    let lengths = |least: f64| {
        let cells = field.cells.iter().map(|c| (c.mean_px[0].hypot(c.mean_px[1]), c.sigma_px));
        cells.filter(move |(length, sigma)| *length >= least * sigma).map(|(length, _)| length).fold(0.0, f64::max)
    };
    let bold = lengths(BOLD);
    if bold_only { bold } else { lengths(0.0).max(1e-6) }
}

/// The same for the images one by one, the few longest apart.
fn longest_of_tiles(r: &Residuals) -> f64 {
    const PART: f64 = 0.97;
    let bold = r.images.iter().map(|i| longest(&i.field, true)).fold(0.0, f64::max);
    let mut lengths: Vec<f64> =
        r.images.iter().flat_map(|i| i.field.cells.iter().map(|c| c.mean_px[0].hypot(c.mean_px[1]))).collect();
    lengths.sort_by(f64::total_cmp);
    let most = lengths.get((PART * lengths.len() as f64) as usize).copied().unwrap_or(1e-6);
    most.max(0.3 * bold).max(1e-6)
}

/// Mean residuals as arrows over the image.
struct Arrows<'a> {
    field: &'a Field,
    c: &'a Calibration,
    /// So many pixels of residual are as long as a cell.
    longest: f64,
    /// Of the drawing.
    width: f64,
    /// Whether a key stands below.
    key: bool,
}

impl Arrows<'_> {
    fn drawing(&self, name: &str) -> String {
        let [w, h] = self.c.camera.image_size.map(|s| s as f64);
        let scale = (self.width - 20.0) / w;
        let cell = (self.width - 20.0) / self.field.cells_xy[0].max(1) as f64;
        let magnified = 0.95 * cell / self.longest;
        let height = h * scale + 20.0;
        let extra = if self.key { 34.0 } else { 0.0 };
        let mut svg = Drawing::new([0.0, 0.0, self.width, height + extra]);
        svg.rectangle("frame", [10.0, 10.0], [w * scale, h * scale]);
        let at = |p: Point| [10.0 + (p[0] + 0.5) * scale, 10.0 + (p[1] + 0.5) * scale];
        let [px, py] = at([self.c.camera.cx, self.c.camera.cy]);
        svg.line("zero", [px - 6.0, py], [px + 6.0, py]).line("zero", [px, py - 6.0], [px, py + 6.0]);
        for cell in &self.field.cells {
            let [mx, my] = cell.mean_px;
            let length = mx.hypot(my);
            // What lies beyond the common scale would hide its neighbours.
            let factor = magnified * (self.longest / length.max(1e-12)).min(1.0);
            let from = at(cell.at);
            let bold = length > BOLD * cell.sigma_px;
            svg.shape(if bold { "arrow bold" } else { "arrow" }, arrow(from, [mx * factor, my * factor], HEAD));
            svg.circle("pin", from, 1.2);
        }
        if self.key {
            let unit = nice_step(self.longest * 0.5);
            let text = format!("{} px", fixed(unit, decimals_of_step(unit)));
            svg.shape("arrow bold", arrow([14.0, height + 18.0], [unit * magnified, 0.0], HEAD));
            svg.text("tick", [24.0 + unit * magnified, height + 22.0], Anchor::Start, &text);
            svg.text("tick", [self.width - 10.0, height + 22.0], Anchor::End, "cross: principal point");
        }
        drawing(&svg, "plot", &format!("{name}: mean residuals over the image"))
    }
}
