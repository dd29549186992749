//! Motions: matches accepted and rejected, where the rejected ones gather, the part of the floor that both images see.

use groundcal::{
    evidence::{Evidence, PairEvidence},
    floor::{FloorGrid, FloorView},
    image::ImageSize,
    plane_view::View,
    result::{Calibration, MotionReport},
};
use nalgebra::{Matrix3, Vector2, Vector3};
use serde::Serialize;

/// A pair of images of which pictures are shown.
#[derive(Debug, Serialize)]
pub struct Motion {
    /// Index into the calibration's motions.
    pub pair: usize,
    /// Indices of the images.
    pub images: [usize; 2],
    pub from: String,
    pub to: String,
    pub used: bool,
    pub reason: Option<String>,
    pub rotation_deg: Option<f64>,
    pub rho: Option<f64>,
    /// Matches on the floor and off it, features and patches together; patches not found again.
    pub accepted: usize,
    pub rejected: usize,
    pub lost: usize,
    /// Of the pair's own homography, pixels.
    pub rms_px: Option<f64>,
    /// Residuals of the joint refinement in its two images, in standard deviations: 1 as expected.
    pub weighted_rms: Option<f64>,
    /// Where rejected matches gather in the first image: things that stand on the floor, or moved.
    pub clusters: Vec<Cluster>,
    pub overlay: Option<Overlay>,
}

/// A part of the first image in which most matches are rejected.
#[derive(Debug, Clone, Serialize)]
pub struct Cluster {
    /// Left, top, right, bottom, pixels.
    pub box_px: [f64; 4],
    pub rejected: usize,
    pub accepted: usize,
}

/// Both images laid on the floor.
#[derive(Debug, Serialize)]
pub struct Overlay {
    /// Side of a pixel of the overlay, heights of the first camera.
    pub unit_per_px: f64,
    pub size: [usize; 2],
    /// Where the first camera's foot lies in it, pixels; up is where it looks.
    pub foot_px: [f64; 2],
    /// Correlation coefficient of the two where both see the floor (with images only): near 1 where they fit.
    pub correlation: Option<f64>,
    #[serde(skip)]
    pub map: OverlayMap,
}

/// How the overlay is made.
#[derive(Debug)]
pub struct OverlayMap {
    pub grid: FloorGrid,
    first: FloorView,
    second: Second,
}

#[derive(Debug)]
enum Second {
    /// Pose of the joint refinement.
    View(FloorView),
    /// The pair's homography.
    Homography(Matrix3<f64>),
}

impl OverlayMap {
    /// The pixel of the first (0) or second (1) image at a pixel of the overlay.
    pub fn source(&self, e: &Evidence, which: usize, p: &Vector2<f64>) -> Option<Vector2<f64>> {
        let floor = self.grid.floor_from_pixel(p);
        match (which, &self.second) {
            (0, _) => self.first.pixel_from_floor(&floor),
            (_, Second::View(view)) => view.pixel_from_floor(&floor),
            (_, Second::Homography(h)) => {
                let a = self.first.pixel_from_floor(&floor)?;
                let ideal = match &e.lens {
                    Some(lens) => lens.ideal_point(&a)?,
                    None => a,
                };
                let q = h * Vector3::new(ideal.x, ideal.y, 1.0);
                let b = (q.z > 0.0).then(|| Vector2::new(q.x / q.z, q.y / q.z))?;
                match &e.lens {
                    Some(lens) => lens.real_point(&b),
                    None => Some(b),
                }
            }
        }
    }
}

impl OverlayMap {
    /// Outline of the floor that an image sees, in pixels of the overlay; a pixel narrower than the image, where it has neighbours
    /// to be resampled from.
    pub fn outline(&self, e: &Evidence, which: usize, size: ImageSize) -> Vec<[f64; 2]> {
        const SIDE_POINTS: usize = 24;
        let (w, h) = (size.width as f64 - 2.0, size.height as f64 - 2.0);
        let corners = [[1.0, 1.0], [w, 1.0], [w, h], [1.0, h]];
        let border: Vec<[f64; 2]> = (0..4 * SIDE_POINTS)
            .map(|i| {
                let ([x0, y0], [x1, y1]) = (corners[i / SIDE_POINTS], corners[(i / SIDE_POINTS + 1) % 4]);
                let t = (i % SIDE_POINTS) as f64 / SIDE_POINTS as f64;
                [x0 + t * (x1 - x0), y0 + t * (y1 - y0)]
            })
            .collect();
        let seen: Vec<[f64; 2]> = border.iter().filter_map(|p| self.on_grid(e, which, *p)).collect();
        let view = match (which, &self.second) {
            (0, _) => Some(&self.first),
            (_, Second::View(view)) => Some(view),
            (_, Second::Homography(_)) => None,
        };
        match view {
            // The horizon is in the image.
            Some(view) if seen.len() < border.len() => {
                let far = OUTLINE_FARTHEST * view.centre().z;
                view.seen_floor(size, far).iter().map(|p| self.grid.pixel_from_floor(p).into()).collect()
            }
            _ => seen,
        }
    }

    /// The pixel of the overlay at a pixel of the first (0) or second (1) image; `None` at or above the horizon.
    pub fn on_grid(&self, e: &Evidence, which: usize, pixel: [f64; 2]) -> Option<[f64; 2]> {
        let pixel = Vector2::from(pixel);
        let floor = match (which, &self.second) {
            (0, _) => self.first.floor_from_pixel(&pixel)?,
            (_, Second::View(view)) => view.floor_from_pixel(&pixel)?,
            (_, Second::Homography(h)) => {
                let ideal = match &e.lens {
                    Some(lens) => lens.ideal_point(&pixel)?,
                    None => pixel,
                };
                let q = h.try_inverse()? * Vector3::new(ideal.x, ideal.y, 1.0);
                let a = (q.z > 0.0).then(|| Vector2::new(q.x / q.z, q.y / q.z))?;
                let a = match &e.lens {
                    Some(lens) => lens.real_point(&a)?,
                    None => a,
                };
                self.first.floor_from_pixel(&a)?
            }
        };
        Some(self.grid.pixel_from_floor(&floor).into())
    }
}

/// Pairs of images that no motion uses are shown too, up to so many.
const UNUSED_SHOWN: usize = 6;
/// Longer side of an overlay in pixels.
pub const OVERLAY_PX: f64 = 560.0;
/// How far floor is laid out, in camera heights.
const OVERLAY_FARTHEST: f64 = 8.0;
/// Floor beyond this lies outside every overlay, in camera heights.
const OUTLINE_FARTHEST: f64 = 40.0;
/// Cells along the longer side of the image in which rejected matches are counted.
const CELLS: usize = 16;
/// Fewest rejected matches of a cell that counts, and of a cluster.
const CELL_REJECTED: usize = 3;
const CLUSTER_REJECTED: usize = 8;

/// The motions used, then the best pair of each image that none of them uses.
pub fn motions(c: &Calibration) -> Vec<Motion> {
    let e = &c.evidence;
    let mut chosen: Vec<usize> = (0..e.pairs.len()).filter(|&i| c.motions[i].used).collect();
    let mut seen: Vec<usize> = chosen.iter().flat_map(|&i| e.pairs[i].images).collect();
    let mut rest: Vec<usize> =
        (0..e.pairs.len()).filter(|&i| !c.motions[i].used && !e.pairs[i].matches.is_empty()).collect();
    rest.sort_by_key(|&i| (std::cmp::Reverse(c.motions[i].matches), i));
    let mut shown = 0;
    for i in rest {
        let new = e.pairs[i].images.iter().any(|image| !seen.contains(image));
        if new && shown < UNUSED_SHOWN {
            chosen.push(i);
            seen.extend(e.pairs[i].images);
            shown += 1;
        }
    }
    chosen.into_iter().map(|i| motion(c, i)).collect()
}

fn motion(c: &Calibration, pair: usize) -> Motion {
    let (report, p) = (&c.motions[pair], &c.evidence.pairs[pair]);
    let accepted = p.matches.iter().filter(|m| m.accepted).count();
    let squares: Vec<f64> = c
        .evidence
        .observations
        .iter()
        .filter(|o| p.images.contains(&o.image))
        .map(|o| o.deviations * o.deviations)
        .collect();
    let weighted_rms =
        (report.used && !squares.is_empty()).then(|| (squares.iter().sum::<f64>() / (2 * squares.len()) as f64).sqrt());
    Motion {
        pair,
        images: p.images,
        from: report.from.clone(),
        to: report.to.clone(),
        used: report.used,
        reason: report.reason.clone(),
        rotation_deg: report.rotation_deg,
        rho: report.rho,
        accepted,
        rejected: p.matches.len() - accepted,
        lost: p.lost_patches.len(),
        rms_px: report.rms_px,
        weighted_rms,
        clusters: clusters(p, c.camera.image_size),
        overlay: overlay(c, report, p),
    }
}

/// Parts of the first image where rejected matches (and patches not found) are most of all, and more than elsewhere.
pub fn clusters(p: &PairEvidence, [width, height]: [usize; 2]) -> Vec<Cluster> {
    let side = width.max(height) as f64 / CELLS as f64;
    let (columns, rows) = ((width as f64 / side).ceil() as usize, (height as f64 / side).ceil() as usize);
    let mut cells = vec![[0usize; 2]; columns * rows];
    let place = |x: f64, n: usize| ((x / side).max(0.0) as usize).min(n - 1);
    let mut count = |[x, y]: [f64; 2], rejected: bool| {
        cells[place(y, rows) * columns + place(x, columns)][usize::from(rejected)] += 1;
    };
    for m in &p.matches {
        count(m.a, !m.accepted);
    }
    for place in &p.lost_patches {
        count(*place, true);
    }
    let total = cells.iter().fold([0, 0], |sum, c| [sum[0] + c[0], sum[1] + c[1]]);
    let share = total[1] as f64 / (total[0] + total[1]).max(1) as f64;
    let stands_out = |[accepted, rejected]: [usize; 2]| {
        let n = (accepted + rejected) as f64;
        let excess = rejected as f64 - n * share;
        rejected >= CELL_REJECTED && rejected > accepted && excess > 2.0 * (n * share * (1.0 - share)).sqrt()
    };
    let mut open: Vec<bool> = cells.iter().map(|c| stands_out(*c)).collect();
    let mut found = Vec::new();
    for start in 0..cells.len() {
        if !open[start] {
            continue;
        }
        open[start] = false;
        let (mut stack, mut members) = (vec![start], Vec::new());
        while let Some(i) = stack.pop() {
            members.push(i);
            let (x, y) = (i % columns, i / columns);
            for ny in y.saturating_sub(1)..=(y + 1).min(rows - 1) {
                for nx in x.saturating_sub(1)..=(x + 1).min(columns - 1) {
                    let next = ny * columns + nx;
                    if std::mem::take(&mut open[next]) {
                        stack.push(next);
                    }
                }
            }
        }
        let sum = |k: usize| members.iter().map(|&i| cells[i][k]).sum::<usize>();
        if sum(1) < CLUSTER_REJECTED {
            continue;
        }
        let over = |f: fn(usize, usize) -> usize| {
            let values = members.iter().map(|&i| f(i, columns));
            (values.clone().min().unwrap_or(0) as f64, values.max().unwrap_or(0) as f64 + 1.0)
        };
        let ((left, right), (top, bottom)) = (over(|i, n| i % n), over(|i, n| i / n));
        let ends = [left, top, right, bottom].map(|v| v * side - 0.5);
        let box_px = [ends[0], ends[1], ends[2].min(width as f64 - 0.5), ends[3].min(height as f64 - 0.5)];
        found.push(Cluster { box_px, rejected: sum(1), accepted: sum(0) });
    }
    found.sort_by_key(|c| std::cmp::Reverse(c.rejected));
    found
}

fn overlay(c: &Calibration, report: &MotionReport, p: &PairEvidence) -> Option<Overlay> {
    let (camera, size) = (&c.camera, c.camera.size());
    let view = |name: &str| c.views.iter().find(|v| v.image == name);
    let (first, second) = match (view(&report.from), view(&report.to)) {
        (Some(a), Some(b)) if a.origin == b.origin => {
            (FloorView::of_report(camera, a).ok()?, Second::View(FloorView::of_report(camera, b).ok()?))
        }
        _ => {
            // Without poses: the first camera over the floor by its attitude, the second by the pair's homography.
            let attitude = c.attitudes.get(report.attitude?)?;
            let pose = View {
                pitch_down_rad: attitude.pitch_down_deg.to_radians(),
                roll_rad: attitude.roll_deg.to_radians(),
                yaw_rad: 0.0,
                centre: Vector3::z(),
            };
            let h = p.h_b_from_a?;
            (
                FloorView::new(&camera.intrinsics(), &camera.lens(), &pose).ok()?,
                Second::Homography(Matrix3::from_fn(|r, k| h[r][k])),
            )
        }
    };
    let height = first.centre().z;
    let heading = first.heading();
    let right = Vector2::new(heading.y, -heading.x);
    let foot = first.foot();
    // What the matches cover, with some room: far floor is mostly blur.
    let near = |q: &Vector2<f64>| (q - foot).norm() < OVERLAY_FARTHEST * height;
    let accepted = p.matches.iter().filter(|m| m.accepted);
    let mut points: Vec<Vector2<f64>> =
        accepted.filter_map(|m| first.floor_from_pixel(&Vector2::from(m.a))).filter(near).collect();
    if points.len() < 4 {
        points = first.seen_floor(size, OVERLAY_FARTHEST * height);
    }
    let bounds = |axis: &Vector2<f64>| {
        let mut along: Vec<f64> = points.iter().map(|q| q.dot(axis)).collect();
        along.sort_by(f64::total_cmp);
        let cut = along.len() / 100;
        let (low, high) = (*along.get(cut)?, *along.get(along.len() - 1 - cut)?);
        let room = 0.06 * (high - low);
        Some([low - room, high + room])
    };
    let (x, y) = (bounds(&right)?, bounds(&heading)?);
    let unit_per_px = (x[1] - x[0]).max(y[1] - y[0]) / OVERLAY_PX;
    let corners: Vec<Vector2<f64>> = x.iter().flat_map(|&u| y.iter().map(move |&v| right * u + heading * v)).collect();
    let grid = FloorGrid::covering(&corners, &right, unit_per_px)?;
    let foot_px = grid.pixel_from_floor(&foot);
    Some(Overlay {
        unit_per_px: unit_per_px / height,
        size: [grid.size.width, grid.size.height],
        foot_px: foot_px.into(),
        correlation: None,
        map: OverlayMap { grid, first, second },
    })
}

/// The size of an overlay's grid.
pub fn size_of(overlay: &Overlay) -> ImageSize {
    overlay.map.grid.size
}

#[cfg(test)]
mod tests {
    use super::*;
    use groundcal::evidence::MatchEvidence;

    fn grid(rejected: impl Fn(f64, f64) -> bool) -> PairEvidence {
        let matches = (0..1200)
            .map(|i| {
                let (x, y) = ((i % 40) as f64 * 16.0 + 5.0, (i / 40) as f64 * 16.0 + 5.0);
                let accepted = !rejected(x, y);
                MatchEvidence { a: [x, y], b: [x, y], patch: false, accepted, distance_px: None }
            })
            .collect();
        PairEvidence { matches, ..PairEvidence::default() }
    }

    #[test]
    fn rejected_matches_that_gather_are_found_and_scattered_ones_are_not() {
        let inside = |x: f64, y: f64| (200.0..320.0).contains(&x) && (120.0..220.0).contains(&y);
        let found = clusters(&grid(inside), [640, 480]);
        assert_eq!(found.len(), 1);
        let [left, top, right, bottom] = found[0].box_px;
        assert!(left <= 200.0 && left > 140.0 && right >= 305.0 && right < 380.0, "{found:?}");
        assert!(top <= 133.0 && top > 60.0 && bottom >= 205.0 && bottom < 280.0, "{found:?}");
        assert!(found[0].rejected >= 40);
        // One in four, evenly: nothing stands out.
        assert!(clusters(&grid(|x, y| ((x + 3.0 * y) as usize / 16) % 4 == 0), [640, 480]).is_empty());
        assert!(clusters(&grid(|_, _| false), [640, 480]).is_empty());
    }
}
