//! Both images of a motion laid on the floor, or their points where there are no images.

use groundcal::result::{Calibration, PairEvidence};

use crate::{
    canvas::{
        self, Class, Clip, Mark, Point,
        scale::Scale,
        svg::{Placing, escape},
    },
    html::{
        markup::{Axes, Drawing, figure, fixed},
        model::motions::{Motion, Overlay},
        pictures,
        sections::motions::matches::{CROSS, SQUARE, marks},
    },
};

/// Units of the drawing to a pixel of an overlay, and page pixels to one of them.
const ZOOM: f64 = 1.25;
const OVERLAY_SCALE: f64 = 1.1;

/// Frame, metric grid and labels of an overlay; the pictures or points go in between.
struct FloorFrame {
    svg: Drawing,
    label: String,
    x: Scale,
    y: Scale,
    /// Left, right, top, bottom.
    frame: [f64; 4],
}

impl FloorFrame {
    fn new(m: &Motion, o: &Overlay) -> Self {
        let [w, h] = o.size.map(|s| s as f64);
        let (left, top) = (58.0, 10.0);
        let (width, height) = (ZOOM * w, ZOOM * h);
        // Floor coordinates about the first camera's foot, in its heights.
        let ends = |i: usize, length: f64, sign: f64| {
            [(-0.5 - o.foot_px[i]) * o.unit_per_px * sign, (length - 0.5 - o.foot_px[i]) * o.unit_per_px * sign]
        };
        let [low, high] = ends(0, w, 1.0);
        let [far, near] = ends(1, h, -1.0);
        Self {
            svg: Drawing::new([0.0, 0.0, left + width + 12.0, top + height + 46.0]),
            label: format!("{} and {} laid on the floor", m.from, m.to),
            x: Scale::new([low, high], [left, left + width]),
            y: Scale::new([near, far], [top + height, top]),
            frame: [left, left + width, top, top + height],
        }
    }

    /// Where a pixel of the overlay lies.
    fn at(&self, [x, y]: [f64; 2]) -> Point {
        [self.frame[0] + ZOOM * (x + 0.5), self.frame[2] + ZOOM * (y + 0.5)]
    }

    /// The grid, its lines of a class, and its labels above what was drawn.
    fn finish(mut self, grid: &str) -> String {
        let [left, right, top, bottom] = self.frame;
        let axes = Axes {
            frame: self.frame,
            x: &self.x,
            y: &self.y,
            x_label: "to the right of the first camera, camera heights",
            y_label: "ahead, camera heights",
        };
        axes.grid(&mut self.svg, grid, grid);
        self.svg.rectangle("frame", [left, top], [right - left, bottom - top]);
        axes.labels(&mut self.svg);
        // As large as the pictures in it, so that all texts of the page have one size.
        let placing = Placing { class: "plot overlay", label: &self.label, px_per_unit: Some(OVERLAY_SCALE) };
        canvas::svg::element(&self.svg, &placing)
    }
}

/// Both pictures on the floor with the controls.
pub(crate) fn pictures(
    index: usize,
    m: &Motion,
    o: &Overlay,
    pair: &[pictures::Picture; 2],
    c: &Calibration,
) -> String {
    let mut frame = FloorFrame::new(m, o);
    let [left, _, top, _] = frame.frame;
    for (which, picture) in pair.iter().enumerate() {
        let corners = o.map.outline(&c.evidence, which, c.camera.model().size);
        let clip =
            Clip { id: format!("clip{index}-{which}"), outline: corners.into_iter().map(|p| frame.at(p)).collect() };
        frame.svg.picture(canvas::Picture::Own {
            uri: picture.uri.clone(),
            corner: [left, top],
            size: o.size.map(|s| ZOOM * s as f64),
            class: Class::from(if which == 0 { "under" } else { "over" }),
            clip,
        });
    }
    let (from, to) = (escape(&m.from), escape(&m.to));
    let controls = format!(
        "<p class=\"controls\" role=\"group\" aria-label=\"Overlay of {from} and {to}\"><label class=\"slide\"><span>{from}</span>\
         <input type=\"range\" min=\"0\" max=\"100\" value=\"50\" data-mix aria-label=\"From {from} (0) to {to} (100)\"><span>{to}</span></label> \
         <button type=\"button\" data-blink aria-pressed=\"false\">Blink</button> \
         <label><input type=\"checkbox\" data-difference> Difference</label></p>"
    );
    let fit = o
        .correlation
        .map_or(String::new(), |r| format!(" Where both see the floor their correlation is {}.", fixed(r, 3)));
    let caption = format!(
        "The floor seen from above in both images, up is where {} looks; unit: height of its camera over the floor. Move the slider or \
         blink: the floor stays still, whatever jumps stands on it, moved, or does not fit.{fit}",
        m.from
    );
    figure("whole lay", &format!("{controls}{}", frame.finish("metric")), &caption)
}

/// Without pictures: the points of both views on the floor, which lie on each other where all fits.
pub(crate) fn points(m: &Motion, o: &Overlay, c: &Calibration, p: &PairEvidence) -> String {
    let mut frame = FloorFrame::new(m, o);
    let [left, right, top, bottom] = frame.frame;
    let of = |frame: &FloorFrame, accepted: bool, which: usize| -> Vec<Point> {
        let chosen = p.matches.iter().filter(|k| k.accepted == accepted);
        let place = |pixel: [f64; 2]| Some(frame.at(o.map.on_grid(&c.evidence, which, pixel)?));
        let inside = |at: &Point| at[0] > left && at[0] < right && at[1] > top && at[1] < bottom;
        chosen.filter_map(|k| place(if which == 0 { k.a } else { k.b }).filter(inside)).collect()
    };
    let (first, second, rejected) = (of(&frame, true, 0), of(&frame, true, 1), of(&frame, false, 0));
    frame.svg.shape("accepted", marks(Mark::Dot, &first));
    frame.svg.shape("lost", marks(SQUARE, &second));
    frame.svg.shape("rejected", marks(CROSS, &rejected));
    let caption = format!(
        "The matches on the floor seen from above: dots from {}, squares around them from {}, by the camera found; crosses: rejected. A dot \
         outside its square does not fit.",
        m.from, m.to
    );
    figure("whole lay", &frame.finish("grid"), &caption)
}
