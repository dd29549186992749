//! Motions: matches accepted and rejected, where the rejected ones gather, the part of the floor that both images see.

use groundcal::{
    Wording,
    floor::{FloorGrid, FloorView},
    geometry::{ImageSize, View},
    numerics::components,
    result::{Calibration, Evidence, MotionReport, PairEvidence},
};
use nalgebra::{Matrix3, Vector2, Vector3};
use rayon::prelude::*;
use serde::Serialize;

/// A pair of images of which pictures are shown.
#[derive(Debug, Serialize)]
pub(crate) struct Motion {
    /// Index into the calibration's motions.
    pub(crate) pair: usize,
    /// Indices of the images.
    pub(crate) images: [usize; 2],
    pub(crate) from: String,
    pub(crate) to: String,
    pub(crate) used: bool,
    pub(crate) reason: Option<String>,
    pub(crate) rotation_deg: Option<f64>,
    pub(crate) height_ratio: Option<f64>,
    /// Matches on the floor and off it, features and patches together; patches not found again.
    pub(crate) accepted: usize,
    pub(crate) rejected: usize,
    pub(crate) lost: usize,
    /// Of the pair's own homography, pixels.
    pub(crate) rms_px: Option<f64>,
    /// Of the camera of all motions, both images together, pixels: much more than `rms_px` where the motion does not fit the others.
    pub(crate) joint_rms_px: Option<f64>,
    /// How far the attitudes of its two views are apart, degrees: 0 for a turn about the floor's normal.
    pub(crate) apart_deg: Option<f64>,
    /// What is wrong with it, in a sentence, if anything is.
    pub(crate) attention: Option<String>,
    /// Where rejected matches gather in the first image: things that stand on the floor, or moved.
    pub(crate) clusters: Vec<Cluster>,
    pub(crate) overlay: Option<Overlay>,
}

/// A part of the first image in which most matches are rejected.
#[derive(Debug, Clone, Serialize)]
pub(crate) struct Cluster {
    /// Left, top, right, bottom, pixels.
    pub(crate) box_px: [f64; 4],
    pub(crate) rejected: usize,
    pub(crate) accepted: usize,
}

/// Both images laid on the floor.
#[derive(Debug, Serialize)]
pub(crate) struct Overlay {
    /// Side of a pixel of the overlay, heights of the first camera.
    pub(crate) unit_per_px: f64,
    pub(crate) size: [usize; 2],
    /// Where the first camera's foot lies in it, pixels; up is where it looks.
    pub(crate) foot_px: [f64; 2],
    /// Correlation coefficient of the two where both see the floor (with images only): near 1 where they fit.
    pub(crate) correlation: Option<f64>,
    #[serde(skip)]
    pub(crate) map: OverlayMap,
}

/// How the overlay is made.
#[derive(Debug)]
pub(crate) struct OverlayMap {
    pub(crate) grid: FloorGrid,
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
    pub(crate) fn source(&self, e: &Evidence, which: usize, p: &Vector2<f64>) -> Option<Vector2<f64>> {
        let floor = self.grid.floor_from_pixel(p);
        match (which, &self.second) {
            (0, _) => self.first.pixel_from_floor(&floor),
            (_, Second::View(view)) => view.pixel_from_floor(&floor),
            (_, Second::Homography(h)) => e.carried(h, &self.first.pixel_from_floor(&floor)?),
        }
    }
}

impl OverlayMap {
    /// Outline of the floor that an image sees, in pixels of the overlay; a pixel narrower than the image, where it has neighbours
    /// to be resampled from.
    pub(crate) fn outline(&self, e: &Evidence, which: usize, size: ImageSize) -> Vec<[f64; 2]> {
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
                let far = OUTLINE_RANGE_HEIGHTS * view.centre().z;
                view.seen_floor(size, far).iter().map(|p| self.grid.pixel_from_floor(p).into()).collect()
            }
            _ => seen,
        }
    }

    /// The pixel of the overlay at a pixel of the first (0) or second (1) image; `None` at or above the horizon.
    pub(crate) fn on_grid(&self, e: &Evidence, which: usize, pixel: [f64; 2]) -> Option<[f64; 2]> {
        let pixel = Vector2::from(pixel);
        let floor = match (which, &self.second) {
            (0, _) => self.first.floor_from_pixel(&pixel)?,
            (_, Second::View(view)) => view.floor_from_pixel(&pixel)?,
            (_, Second::Homography(h)) => {
                let a = e.carried(&h.try_inverse()?, &pixel)?;
                self.first.floor_from_pixel(&a)?
            }
        };
        Some(self.grid.pixel_from_floor(&floor).into())
    }
}

/// Pairs of images that no motion uses are shown too, up to so many.
const UNUSED_SHOWN: usize = 6;
/// Longer side of an overlay in pixels.
pub(crate) const OVERLAY_PX: f64 = 460.0;
/// How far floor is laid out, in camera heights.
const OVERLAY_RANGE_HEIGHTS: f64 = 8.0;
/// Floor beyond this lies outside every overlay, in camera heights.
const OUTLINE_RANGE_HEIGHTS: f64 = 40.0;
/// Nearest neighbours looked at of a rejected match; how many of them must be rejected too, and by how many deviations more
/// than chance gives; fewest rejected matches of a cluster.
const NEIGHBOURS: usize = 8;
const MAX_NEIGHBOURS: usize = 5;
const CLUSTER_SIGMAS: f64 = 2.5;
const CLUSTER_REJECTED: usize = 8;

/// The motions used, then the best pair of each image that none of them uses.
pub(crate) fn motions(c: &Calibration, wording: &dyn Wording) -> Vec<Motion> {
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
    let mut all: Vec<Motion> = chosen.into_par_iter().map(|i| motion(c, i)).collect();
    for m in &mut all {
        m.attention = c.motions[m.pair].diagnosis.and_then(|d| d.verdict.message(wording));
    }
    all
}

fn motion(c: &Calibration, pair: usize) -> Motion {
    let (report, p) = (&c.motions[pair], &c.evidence.pairs[pair]);
    let accepted = p.matches.iter().filter(|m| m.accepted).count();
    Motion {
        pair,
        images: p.images,
        from: report.from.clone(),
        to: report.to.clone(),
        used: report.used,
        reason: report.reason.clone(),
        rotation_deg: report.rotation_deg,
        height_ratio: report.height_ratio,
        accepted,
        rejected: p.matches.len() - accepted,
        lost: p.lost_patches.len(),
        rms_px: report.rms_px,
        joint_rms_px: report.diagnosis.and_then(|d| d.joint_rms_px),
        apart_deg: report.diagnosis.and_then(|d| d.apart_deg),
        attention: None,
        clusters: clusters(p, &c.evidence, c.camera.image_size),
        overlay: overlay(c, report, p),
    }
}

/// Parts of the first image where rejected matches (and patches not found) are among themselves: those most of whose nearest
/// neighbours are rejected too, more than chance gives, joined with these neighbours. What the second image does not show cannot
/// be matched and does not count.
pub(crate) fn clusters(p: &PairEvidence, e: &Evidence, size: [usize; 2]) -> Vec<Cluster> {
    let shown = |a: [f64; 2]| carried(p, e, Vector2::from(a)).is_none_or(|b| inside(b, size));
    let of = |wanted: bool| p.matches.iter().filter(move |m| m.accepted == wanted).map(|m| m.a);
    let rejected: Vec<[f64; 2]> = of(false).chain(p.lost_patches.iter().copied()).filter(|a| shown(*a)).collect();
    let all: Vec<[f64; 2]> = rejected.iter().copied().chain(of(true)).collect();
    if rejected.len() < CLUSTER_REJECTED || all.len() <= NEIGHBOURS {
        return Vec::new();
    }
    let share = rejected.len() as f64 / all.len() as f64;
    let (mean, deviation) = (NEIGHBOURS as f64 * share, (NEIGHBOURS as f64 * share * (1.0 - share)).sqrt());
    let enough = MAX_NEIGHBOURS.max((mean + CLUSTER_SIGMAS * deviation) as usize + 1);
    // Rejected neighbours of each rejected point that is among its like. Places come first in `all`.
    let among: Vec<Vec<usize>> = (0..rejected.len())
        .map(|i| {
            let squared = |k: usize| (all[k][0] - all[i][0]).powi(2) + (all[k][1] - all[i][1]).powi(2);
            let mut near: Vec<(f64, usize)> = (0..all.len()).filter(|k| *k != i).map(|k| (squared(k), k)).collect();
            near.select_nth_unstable_by(NEIGHBOURS - 1, |a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            let like: Vec<usize> = near[..NEIGHBOURS].iter().map(|n| n.1).filter(|k| *k < rejected.len()).collect();
            if like.len() >= enough { like } else { Vec::new() }
        })
        .collect();
    let edges = among.iter().enumerate().flat_map(|(i, like)| like.iter().map(move |&k| (i, k)));
    let label = components(rejected.len(), edges);
    let mut found: Vec<Cluster> = (0..rejected.len())
        .map(|root| (0..rejected.len()).filter(|&i| label[i] == root).map(|i| rejected[i]).collect::<Vec<_>>())
        .filter(|members| members.len() >= CLUSTER_REJECTED)
        .map(|members| {
            let ends = |k: usize| {
                members.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[l, h], p| [l.min(p[k]), h.max(p[k])])
            };
            let ([left, right], [top, bottom]) = (ends(0), ends(1));
            let within = |[x, y]: &[f64; 2]| (left..=right).contains(x) && (top..=bottom).contains(y);
            Cluster {
                box_px: [left, top, right, bottom],
                rejected: members.len(),
                accepted: of(true).filter(|a| within(a)).count(),
            }
        })
        .collect();
    found.sort_by_key(|c| std::cmp::Reverse(c.rejected));
    found
}

/// Where the pair's homography takes a pixel of the first image in the second, lens and all.
fn carried(p: &PairEvidence, e: &Evidence, a: Vector2<f64>) -> Option<Vector2<f64>> {
    let h = Matrix3::from_fn(|r, k| p.h_b_from_a.map_or(if r == k { 1.0 } else { 0.0 }, |h| h[r][k]));
    e.carried(&h, &a)
}

fn inside(p: Vector2<f64>, [width, height]: [usize; 2]) -> bool {
    p.x >= 0.0 && p.y >= 0.0 && p.x <= width as f64 - 1.0 && p.y <= height as f64 - 1.0
}

fn overlay(c: &Calibration, report: &MotionReport, p: &PairEvidence) -> Option<Overlay> {
    let (camera, size) = (&c.camera, c.camera.model().size);
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
                FloorView::new(&camera.model().intrinsics, camera.model().lens, &pose).ok()?,
                Second::Homography(Matrix3::from_fn(|r, k| h[r][k])),
            )
        }
    };
    let height = first.centre().z;
    let heading = first.heading();
    let right = Vector2::new(heading.y, -heading.x);
    let foot = first.centre().xy();
    // What the matches cover, with some room: far floor is mostly blur.
    let near = |q: &Vector2<f64>| (q - foot).norm() < OVERLAY_RANGE_HEIGHTS * height;
    let accepted = p.matches.iter().filter(|m| m.accepted);
    let mut points: Vec<Vector2<f64>> =
        accepted.filter_map(|m| first.floor_from_pixel(&Vector2::from(m.a))).filter(near).collect();
    if points.len() < 4 {
        points = first.seen_floor(size, OVERLAY_RANGE_HEIGHTS * height);
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
pub(crate) fn size_of(overlay: &Overlay) -> ImageSize {
    overlay.map.grid.size
}

#[cfg(test)]
mod tests {
    use super::*;
    use groundcal::result::MatchEvidence;

    fn grid(rejected: impl Fn(f64, f64) -> bool) -> Vec<Cluster> {
        let matches = (0..1200)
            .map(|i| {
                let (x, y) = ((i % 40) as f64 * 16.0 + 5.0, (i / 40) as f64 * 16.0 + 5.0);
                let accepted = !rejected(x, y);
                MatchEvidence { a: [x, y], b: [x, y], patch: false, accepted, distance_px: None }
            })
            .collect();
        clusters(&PairEvidence { matches, ..PairEvidence::default() }, &Evidence::default(), [640, 480])
    }

    #[test]
    fn rejected_matches_that_gather_are_found_and_scattered_ones_are_not() {
        let inside = |x: f64, y: f64| (200.0..320.0).contains(&x) && (120.0..220.0).contains(&y);
        let found = grid(inside);
        assert_eq!(found.len(), 1, "{found:?}");
        // Places lie 16 pixels apart from 5 on; corners have more neighbours outside.
        let [left, top, right, bottom] = found[0].box_px;
        assert!((213.0..=229.0).contains(&left) && (293.0..=309.0).contains(&right), "{found:?}");
        assert!((133.0..=149.0).contains(&top) && (197.0..=213.0).contains(&bottom), "{found:?}");
        assert!(found[0].rejected > 30 && found[0].accepted == 0, "{found:?}");
        // One in four, evenly: nothing stands out.
        assert!(grid(|x, y| ((x + 3.0 * y) as usize / 16).is_multiple_of(4)).is_empty());
        assert!(grid(|_, _| false).is_empty() && grid(|_, _| true).is_empty());
    }

    #[test]
    fn what_the_second_image_does_not_show_does_not_count() {
        let at = |i: usize, accepted: bool, x0: f64| {
            let a = [x0 + (i % 20) as f64 * 8.0, (i / 20) as f64 * 20.0];
            MatchEvidence { a, b: a, patch: false, accepted, distance_px: None }
        };
        // The right half of the first image lies outside the second, and nothing is accepted there.
        let matches = (0..400).map(|i| at(i, true, 10.0)).chain((0..100).map(|i| at(i, false, 400.0))).collect();
        let shifted = Some([[1.0, 0.0, 320.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]);
        let pair = PairEvidence { matches, h_b_from_a: shifted, ..PairEvidence::default() };
        assert!(clusters(&pair, &Evidence::default(), [640, 480]).is_empty());
        let here = PairEvidence { h_b_from_a: None, ..pair };
        assert_eq!(clusters(&here, &Evidence::default(), [640, 480]).len(), 1);
    }
}
