//! The two images of a motion with their matches, horizons and what gathers rejected matches.

use groundcal::result::{Calibration, MatchEvidence, PairEvidence};

use crate::{
    canvas::{Anchor, Mark, Picture, Point, Shape},
    html::{
        markup::{Drawing, drawing, figure, fixed},
        model::{conic::horizon, motions::Motion},
        pictures::Pictures,
    },
};

/// Matches drawn of each kind in an image.
const MATCHES: usize = 2500;
/// Numbered matches, the same number in both images.
const LANDMARKS: usize = 8;
/// Width of a drawn image in the drawing's units.
pub(crate) const WIDTH: f64 = 640.0;
/// A horizon this far outside the image, in image heights, is still drawn.
const OUTSIDE: f64 = 0.4;
/// How far beside the image it is followed, in image widths.
const BESIDE: f64 = 0.12;
/// Sides of the marks.
pub(crate) const CROSS: Mark = Mark::Cross(7.0);
pub(crate) const SQUARE: Mark = Mark::Square(8.0);

/// Both images side by side.
pub(crate) fn both(m: &Motion, c: &Calibration, p: &PairEvidence, pictures: &Pictures) -> String {
    let landmarks = landmarks(p, c.camera.image_size);
    let image = |second: bool| Image { m, c, p, second, landmarks: &landmarks }.figure(pictures);
    format!("<div class=\"figures\">\n{}{}</div>\n", image(false), image(true))
}

/// One mark at each point; every so many of them, where there are too many.
pub(crate) fn marks(mark: Mark, points: &[Point]) -> Shape {
    let stride = points.len().div_ceil(MATCHES).max(1);
    Shape::Marks(mark, points.iter().step_by(stride).copied().collect())
}

/// Accepted matches far from one another, and from the borders, where their numbers would be cut off.
fn landmarks(p: &PairEvidence, [width, height]: [usize; 2]) -> Vec<usize> {
    const ROOM: f64 = 0.07;
    let inside = |[x, y]: Point| {
        let (u, v) = (x / width as f64, y / height as f64);
        (ROOM..=1.0 - ROOM).contains(&u) && (ROOM..=1.0 - ROOM).contains(&v)
    };
    let shown = |k: &usize| p.matches[*k].accepted && inside(p.matches[*k].a) && inside(p.matches[*k].b);
    let accepted: Vec<usize> = (0..p.matches.len()).filter(shown).collect();
    let mut chosen: Vec<usize> = Vec::new();
    let mut distance = vec![f64::INFINITY; accepted.len()];
    while chosen.len() < LANDMARKS.min(accepted.len()) {
        let next = match chosen.last() {
            None => 0,
            Some(_) => (0..accepted.len()).max_by(|a, b| distance[*a].total_cmp(&distance[*b])).unwrap_or(0),
        };
        let at = p.matches[accepted[next]].a;
        for (d, &k) in distance.iter_mut().zip(&accepted) {
            let [x, y] = p.matches[k].a;
            *d = d.min((x - at[0]).hypot(y - at[1]));
        }
        chosen.push(accepted[next]);
    }
    chosen
}

/// One of the images.
struct Image<'a> {
    m: &'a Motion,
    c: &'a Calibration,
    p: &'a PairEvidence,
    second: bool,
    landmarks: &'a [usize],
}

impl Image<'_> {
    fn figure(&self, pictures: &Pictures) -> String {
        let number = self.m.images[usize::from(self.second)];
        let name = if self.second { &self.m.to } else { &self.m.from };
        let pose = pose_of(self.c, name, self.m);
        let [w, h] = self.c.camera.image_size.map(|s| s as f64);
        let room = OUTSIDE * h;
        let window = [-room, -room, w + room, h + room];
        let pieces = pose.map_or(Vec::new(), |[pitch, roll]| horizon(self.c, pitch, roll, window));
        let crosses = pieces.iter().flatten().any(|[x, y]| (0.0..w).contains(x) || (0.0..h).contains(y));
        let pieces: Vec<Vec<Point>> = pieces.iter().map(|piece| piece.iter().map(|q| self.at(*q)).collect()).collect();
        let height = self.height();
        let mut svg = Drawing::new(view(height, crosses.then_some(&pieces)));
        if pictures.thumbnails.is_empty() {
            svg.rectangle("blank", [0.0, 0.0], [WIDTH, height]);
        } else {
            svg.picture(Picture::Shared(format!("im{number}")));
            svg.rectangle("border", [0.0, 0.0], [WIDTH, height]);
        }
        self.draw_matches(&mut svg);
        for piece in pieces {
            svg.shape("sky halo", Shape::polyline(piece.clone())).shape("sky", Shape::polyline(piece));
        }
        self.draw_numbers(&mut svg);
        if !crosses && let Some([pitch, roll]) = pose {
            svg.text("mark", [8.0, height - 10.0], Anchor::Start, &far_horizon(self.c, pitch, roll));
        }
        let label = format!("{name} with its matches");
        figure("half", &drawing(&svg, "picture", &label), &format!("{}. {name}", number + 1))
    }

    fn scale(&self) -> f64 {
        WIDTH / self.c.camera.image_size[0] as f64
    }

    fn height(&self) -> f64 {
        self.scale() * self.c.camera.image_size[1] as f64
    }

    /// Where a pixel lies in the drawing.
    fn at(&self, pixel: [f64; 2]) -> Point {
        pixel.map(|x| (x + 0.5) * self.scale())
    }

    fn place_of(&self, k: &MatchEvidence) -> Point {
        self.at(if self.second { k.b } else { k.a })
    }

    /// Accepted and rejected matches, patches not found again, places where rejected ones gather.
    fn draw_matches(&self, svg: &mut Drawing) {
        let of = |accepted: bool| -> Vec<Point> {
            self.p.matches.iter().filter(|k| k.accepted == accepted).map(|k| self.place_of(k)).collect()
        };
        let accepted = marks(Mark::Dot, &of(true));
        if !accepted.is_empty() {
            svg.layer("accepted", |g| {
                g.shape("accepted halo", accepted.clone()).shape("accepted", accepted);
            });
        }
        let rejected = marks(CROSS, &of(false));
        let lost: &[[f64; 2]] = if self.second { &[] } else { &self.p.lost_patches };
        let lost: Vec<Point> = lost.iter().map(|q| self.at(*q)).collect();
        let clusters = if self.second { &[][..] } else { &self.m.clusters };
        svg.layer("rejected", |g| {
            g.shape("lost", marks(SQUARE, &lost));
            g.shape("rejected halo", rejected.clone()).shape("rejected", rejected);
            for cluster in clusters {
                let [left, top, right, bottom] = cluster.box_px;
                let ([left, top], [right, bottom]) = (self.at([left, top]), self.at([right, bottom]));
                let size = [right - left, bottom - top];
                g.rectangle("cluster halo", [left, top], size).rectangle("cluster", [left, top], size);
                let count = format!("{} rejected", cluster.rejected);
                g.text("mark small", [left + 3.0, top + 14.0], Anchor::Start, &count);
            }
        });
    }

    fn draw_numbers(&self, svg: &mut Drawing) {
        svg.layer("numbers", |g| {
            for (n, &k) in self.landmarks.iter().enumerate() {
                let [x, y] = self.place_of(&self.p.matches[k]);
                g.circle("landmark", [x, y], 5.0);
                g.text("mark", [x + 7.0, y - 6.0], Anchor::Start, &(n + 1).to_string());
            }
        });
    }
}

/// The image, or as far as a horizon outside it, if that is not far; with a little margin.
fn view(height: f64, horizon: Option<&Vec<Vec<Point>>>) -> [f64; 4] {
    const MARGIN: f64 = 2.0;
    let reach = |f: fn(f64, f64) -> f64, i: usize, start: f64| {
        horizon.into_iter().flatten().flatten().map(|q| q[i]).fold(start, f)
    };
    let left = reach(f64::min, 0, 0.0).max(-BESIDE * WIDTH);
    let right = reach(f64::max, 0, WIDTH).min((1.0 + BESIDE) * WIDTH);
    let (top, bottom) = (reach(f64::min, 1, 0.0), reach(f64::max, 1, height));
    [left - MARGIN, top - MARGIN, right - left + 2.0 * MARGIN, bottom - top + 2.0 * MARGIN]
}

/// Where a horizon is that is not drawn.
fn far_horizon(c: &Calibration, pitch: f64, roll: f64) -> String {
    let distance = c.camera.fx * pitch.to_radians().tan();
    if !(distance.is_finite() && distance.abs() < 1e5) {
        return "horizon at infinity: the camera looks straight down".into();
    }
    // The horizon lies opposite to the direction in which the picture's lower side dips.
    let angle = roll.rem_euclid(360.0);
    let side = [
        "above",
        "to the upper left of",
        "to the left of",
        "to the lower left of",
        "below",
        "to the lower right of",
        "to the right of",
        "to the upper right of",
    ];
    let place = side[((angle + 22.5) / 45.0) as usize % 8];
    format!("horizon {} px {place} the principal point", fixed(distance.abs(), 0))
}

/// Pitch and roll of an image, of its own or of the motion's attitude.
fn pose_of(c: &Calibration, name: &str, m: &Motion) -> Option<[f64; 2]> {
    let own = c.views.iter().find(|v| v.image == name && v.attitude.is_some()).map(|v| [v.pitch_down_deg, v.roll_deg]);
    own.or_else(|| {
        let a = c.attitudes.get(c.motions[m.pair].attitude?)?;
        Some([a.pitch_down_deg, a.roll_deg])
    })
}
