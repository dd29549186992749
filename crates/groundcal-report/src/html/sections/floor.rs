//! The views from above: where they are, where they look, what they see.

use crate::{
    canvas::{
        Anchor, Point, Shape,
        arrow::{Head, arrow},
        scale::Scale,
    },
    html::{
        markup::{Axes, Drawing, attitude_class, drawing, figure, fixed},
        model::{
            Model,
            floor::{DRAWN_RANGE_HEIGHTS, FloorMap},
        },
    },
};

/// Sets of connected views that are drawn.
const DRAWN: usize = 24;
/// Of the arrow where a view looks.
const HEAD: Head = Head { longest: 8.0, part: 0.6, spread: 0.45 };

pub(crate) fn section(model: &Model) -> String {
    let mut out = String::from("<div class=\"figures\">\n");
    for map in model.floor.iter().take(DRAWN) {
        out.push_str(&seen_from_above(map, model.floor.len() == 1));
    }
    out.push_str("</div>\n");
    if model.floor.len() > DRAWN {
        out.push_str(&format!(
            "<p>The first {DRAWN} of {} sets of connected views; all are in the tables.</p>\n",
            model.floor.len()
        ));
    }
    out
}

fn seen_from_above(map: &FloorMap, alone: bool) -> String {
    let points = || map.views.iter().flat_map(|v| v.seen.iter().copied().chain([[v.position[0], v.position[1]]]));
    let bounds = |i: usize| {
        let (low, high) = points().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), p| (l.min(p[i]), h.max(p[i])));
        let room = 0.05 * (high - low).max(0.5);
        [low - room, high + room]
    };
    // +X up the page, +Y to the left: the first view looks up.
    let (x, y) = (bounds(0), bounds(1));
    let width = if alone { 760.0 } else { 520.0 };
    let (left, top) = (62.0, 12.0);
    let tallest = if alone { 640.0 } else { 460.0 };
    let per_unit = ((width - left - 14.0) / (y[1] - y[0])).min(tallest / (x[1] - x[0]));
    let (right, bottom) = (left + per_unit * (y[1] - y[0]), top + per_unit * (x[1] - x[0]));
    let across = Scale::new([-y[1], -y[0]], [left, right]);
    let ahead = Scale::new(x, [bottom, top]);
    let at = |p: Point| [across.at(-p[1]), ahead.at(p[0])];
    let mut svg = Drawing::new([0.0, 0.0, (right + 14.0).max(300.0), bottom + 46.0]);
    let axes = Axes {
        frame: [left, right, top, bottom],
        x: &across,
        y: &ahead,
        x_label: "to the right, camera heights",
        y_label: "ahead, camera heights",
    };
    axes.draw(&mut svg);
    for v in &map.views {
        let outline = v.seen.iter().map(|p| at(*p)).collect();
        svg.shape(format!("seen {}", attitude_class(v.attitude)), Shape::polygon(outline));
    }
    let mut taken: Vec<Point> = map.views.iter().map(|v| at([v.position[0], v.position[1]])).collect();
    for v in &map.views {
        let [px, py] = at([v.position[0], v.position[1]]);
        let [dx, dy] = [-v.heading[1], -v.heading[0]];
        let class = attitude_class(v.attitude);
        svg.shape(format!("pose {class}"), arrow([px, py], [30.0 * dx, 30.0 * dy], HEAD));
        svg.circle(format!("foot {class}"), [px, py], 4.0);
        let label = free_place([px, py], [dx, dy], &taken);
        taken.push(label);
        svg.text("mark", [label[0], label[1] + 4.0], Anchor::Middle, &(v.image + 1).to_string());
    }
    let names: Vec<String> = map
        .views
        .iter()
        .map(|v| {
            let attitude = v.attitude.map_or(String::new(), |a| format!(", attitude {}", a + 1));
            format!("{}: {}{attitude}", v.image + 1, v.name)
        })
        .collect();
    let caption = format!(
        "Floor seen from above; the unit is the height of the camera over the floor in {}, which stands at (0, 0) and looks up the page. \
         Dots: optical centres; arrows: headings; outlines: floor seen, up to {} heights away. One line style for each attitude. {}.",
        map.origin,
        fixed(DRAWN_RANGE_HEIGHTS, 0),
        names.join("; ")
    );
    let label = format!("Views connected with {} seen from above", map.origin);
    figure(if alone { "whole" } else { "half" }, &drawing(&svg, "plot", &label), &caption)
}

/// A place for a view's number near its foot: behind the camera, or beside that where others are.
fn free_place([px, py]: Point, [dx, dy]: [f64; 2], taken: &[Point]) -> Point {
    const APART: f64 = 14.0;
    let behind = (-dy).atan2(-dx);
    let places = [15.0, 24.0].into_iter().flat_map(|r: f64| {
        [0.0, 0.8, -0.8, 1.6, -1.6, 2.4, -2.4].map(|turn| {
            let (sin, cos) = (behind + turn).sin_cos();
            [px + r * cos, py + r * sin]
        })
    });
    let own = [px, py];
    let free = |p: &Point| taken.iter().all(|t| *t == own || (p[0] - t[0]).hypot(p[1] - t[1]) > APART);
    places.clone().find(free).or_else(|| places.clone().next()).unwrap_or(own)
}
