//! Residuals of the joint refinement: per image, over the image plane, against the distance from the principal point.
//!
//! Means are weighted by 1 / σ², σ being the deviation of each residual; a point's residuals in its two or more images are
//! parts of one error, so the deviation of a mean is that of independent ones.

use groundcal::result::{Calibration, ObservationEvidence, Refinement};
use serde::Serialize;

/// Residuals, measured less predicted, in pixels.
#[derive(Debug, Serialize)]
pub(crate) struct Residuals {
    /// One for each image that takes part.
    pub(crate) images: Vec<ImageResiduals>,
    /// All images together.
    pub(crate) all: Field,
    /// How many residuals are how long.
    pub(crate) histogram: Histogram,
    /// Rings about the principal point, from it outwards, with equally many points.
    pub(crate) rings: Vec<Ring>,
    /// Largest mean radial residual of a ring over its standard deviation: above 4 something is left that depends on the radius.
    pub(crate) radial_significance: f64,
    /// Mean radial residual where it is largest, pixels.
    pub(crate) radial_px: f64,
    /// How many times larger residuals are than those about a homography of each pair's own, for patches and for points (1: the
    /// camera explains them as well).
    pub(crate) times_own: [Option<f64>; 2],
}

/// Residuals by their length in standard deviations.
#[derive(Debug, Serialize)]
pub(crate) struct Histogram {
    /// Width of a bin.
    pub(crate) step: f64,
    pub(crate) counts: Vec<usize>,
    /// Longer than the last bin.
    pub(crate) beyond: usize,
}

/// Residuals of an image.
#[derive(Debug, Serialize)]
pub(crate) struct ImageResiduals {
    /// Index of the image.
    pub(crate) image: usize,
    pub(crate) name: String,
    pub(crate) observations: usize,
    /// Root mean square of both coordinates together, pixels.
    pub(crate) rms_px: f64,
    /// The same in standard deviations of a coordinate as all images together show them: 1 is average.
    pub(crate) weighted_rms: f64,
    /// Points that count less because their residual is too large.
    pub(crate) downweighted: usize,
    /// Where they point.
    #[serde(skip)]
    pub(crate) field: Field,
}

/// Mean residuals over the image plane.
#[derive(Debug, Serialize)]
pub(crate) struct Field {
    /// Columns and rows of cells.
    pub(crate) cells_xy: [usize; 2],
    /// Row by row; cells with fewer than three points are left out.
    pub(crate) cells: Vec<Cell>,
}

/// Mean residual in a part of the image.
#[derive(Debug, Clone, Serialize)]
pub(crate) struct Cell {
    /// Its middle, pixels.
    pub(crate) at: [f64; 2],
    pub(crate) observations: usize,
    pub(crate) mean_px: [f64; 2],
    /// Standard deviation of each coordinate of the mean.
    pub(crate) sigma_px: f64,
}

/// Mean residuals in a ring.
#[derive(Debug, Clone, Serialize)]
pub(crate) struct Ring {
    /// Inner and outer radius, pixels.
    pub(crate) radius_px: [f64; 2],
    /// Mean radius of its points.
    pub(crate) at_px: f64,
    pub(crate) observations: usize,
    /// Mean of the outward component.
    pub(crate) radial_px: f64,
    /// Mean of the component across, clockwise as shown.
    pub(crate) tangential_px: f64,
    /// Standard deviation of both means.
    pub(crate) sigma_px: f64,
}

/// Rings, and the fewest points of one.
const RINGS: usize = 12;
const RING_POINTS: usize = 20;
/// Cells along the longer side of the image, for all images together and for one.
const CELLS_ALL: usize = 12;
const CELLS_ONE: usize = 8;
const CELL_POINTS: usize = 3;

/// One observation with its weight.
struct Weighted<'a> {
    o: &'a ObservationEvidence,
    /// Standard deviation of each coordinate, pixels.
    sigma_px: f64,
}

fn weighted(o: &ObservationEvidence) -> Option<Weighted<'_>> {
    let sigma_px = o.residual_px[0].hypot(o.residual_px[1]) / o.standardised_residual;
    (sigma_px.is_finite() && sigma_px > 0.0).then_some(Weighted { o, sigma_px })
}

impl Weighted<'_> {
    /// Less for what is too far off, as in the refinement.
    fn weight(&self) -> f64 {
        self.o.weight / (self.sigma_px * self.sigma_px)
    }
}

/// Residuals of a calibration; `None` without a joint refinement.
pub(crate) fn residuals(c: &Calibration) -> Option<Residuals> {
    let e = &c.evidence;
    let all: Vec<Weighted> = e.observations.iter().filter_map(weighted).collect();
    if all.is_empty() {
        return None;
    }
    let mut of_image: Vec<Vec<&Weighted>> = vec![Vec::new(); e.images.len()];
    for w in &all {
        of_image[w.o.image].push(w);
    }
    let images = of_image
        .iter()
        .enumerate()
        .filter(|(_, list)| !list.is_empty())
        .map(|(image, list)| {
            let n = list.len() as f64;
            let squares = |f: &dyn Fn(&Weighted) -> f64| list.iter().map(|w| f(w).powi(2)).sum::<f64>();
            ImageResiduals {
                image,
                name: e.images[image].clone(),
                observations: list.len(),
                rms_px: (squares(&|w| w.o.residual_px[0].hypot(w.o.residual_px[1])) / n).sqrt(),
                weighted_rms: (squares(&|w| w.o.standardised_residual) / (2.0 * n)).sqrt(),
                downweighted: list.iter().filter(|w| w.o.weight < 1.0).count(),
                field: field(list, c.camera.image_size, CELLS_ONE),
            }
        })
        .collect();
    let list: Vec<&Weighted> = all.iter().collect();
    let rings = rings(&list, [c.camera.cx, c.camera.cy]);
    let worst = rings.iter().max_by(|a, b| a.significance().total_cmp(&b.significance()));
    Some(Residuals {
        images,
        histogram: histogram(&all),
        all: field(&list, c.camera.image_size, CELLS_ALL),
        radial_significance: worst.map_or(0.0, Ring::significance),
        radial_px: worst.map_or(0.0, |r| r.radial_px),
        rings,
        times_own: [|r: &Refinement| r.patches, |r: &Refinement| r.points]
            .map(|of| Some(of(c.fit.refinement.as_ref()?)?.variance_factor.sqrt())),
    })
}

/// Bins of a quarter of a deviation, up to so many deviations.
const BIN: f64 = 0.25;
const LONGEST: f64 = 5.0;

fn histogram(all: &[Weighted]) -> Histogram {
    let mut of = Histogram { step: BIN, counts: vec![0; (LONGEST / BIN) as usize], beyond: 0 };
    for w in all {
        match of.counts.get_mut((w.o.standardised_residual / BIN) as usize) {
            Some(count) => *count += 1,
            None => of.beyond += 1,
        }
    }
    of
}

impl Ring {
    /// Mean radial residual over its deviation, without sign.
    pub(crate) fn significance(&self) -> f64 {
        self.radial_px.abs() / self.sigma_px
    }
}

/// Weighted means of two components, and the standard deviation of each.
fn means<'a>(list: impl Iterator<Item = (&'a Weighted<'a>, [f64; 2])>) -> ([f64; 2], f64, usize) {
    let (mut sums, mut weights, mut count) = ([0.0; 2], 0.0, 0);
    for (w, [u, v]) in list {
        let weight = w.weight();
        sums = [sums[0] + weight * u, sums[1] + weight * v];
        weights += weight;
        count += 1;
    }
    (sums.map(|s| s / weights), 1.0 / f64::sqrt(weights), count)
}

fn field(list: &[&Weighted], [width, height]: [usize; 2], along: usize) -> Field {
    let side = width.max(height) as f64 / along as f64;
    let count = |length: usize| ((length as f64 / side).round() as usize).max(1);
    let [columns, rows] = [count(width), count(height)];
    let place =
        |x: f64, length: usize, n: usize| ((x + 0.5) / length as f64 * n as f64).clamp(0.0, n as f64 - 0.5) as usize;
    let mut cells: Vec<Vec<&Weighted>> = vec![Vec::new(); columns * rows];
    for w in list {
        let [x, y] = w.o.pixel;
        cells[place(y, height, rows) * columns + place(x, width, columns)].push(w);
    }
    let middle = |i: usize, length: usize, n: usize| (i as f64 + 0.5) * length as f64 / n as f64 - 0.5;
    let cells = cells
        .iter()
        .enumerate()
        .filter(|(_, list)| list.len() >= CELL_POINTS)
        .map(|(i, list)| {
            let (mean_px, sigma_px, observations) = means(list.iter().map(|w| (*w, w.o.residual_px)));
            let at = [middle(i % columns, width, columns), middle(i / columns, height, rows)];
            Cell { at, observations, mean_px, sigma_px }
        })
        .collect();
    Field { cells_xy: [columns, rows], cells }
}

fn rings(list: &[&Weighted], [cx, cy]: [f64; 2]) -> Vec<Ring> {
    let radius = |w: &Weighted| (w.o.pixel[0] - cx).hypot(w.o.pixel[1] - cy);
    let mut ordered: Vec<(f64, &Weighted)> = list.iter().map(|w| (radius(w), *w)).collect();
    ordered.sort_by(|a, b| a.0.total_cmp(&b.0));
    let rings = RINGS.min(ordered.len() / RING_POINTS).max(1);
    let size = ordered.len().div_ceil(rings);
    ordered
        .chunks(size)
        .map(|ring| {
            let component = |(r, w): &(f64, &'_ Weighted)| {
                // At the very centre there is no outwards.
                let r = r.max(1e-9);
                let (ux, uy) = ((w.o.pixel[0] - cx) / r, (w.o.pixel[1] - cy) / r);
                let [x, y] = w.o.residual_px;
                [x * ux + y * uy, y * ux - x * uy]
            };
            let ([radial_px, tangential_px], sigma_px, observations) =
                means(ring.iter().map(|entry| (entry.1, component(entry))));
            Ring {
                radius_px: [ring[0].0, ring[ring.len() - 1].0],
                at_px: ring.iter().map(|r| r.0).sum::<f64>() / ring.len() as f64,
                observations,
                radial_px,
                tangential_px,
                sigma_px,
            }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn seen(pixel: [f64; 2], residual_px: [f64; 2]) -> ObservationEvidence {
        let standardised_residual = residual_px[0].hypot(residual_px[1]) / 0.1;
        ObservationEvidence { image: 0, track: 0, patch: false, pixel, residual_px, standardised_residual, weight: 1.0 }
    }

    #[test]
    fn an_outward_residual_is_radial_and_a_whirl_tangential() {
        let points: Vec<[f64; 2]> = (0..400).map(|i| [(i % 20) as f64 * 30.0, (i / 20) as f64 * 24.0]).collect();
        let centre = [285.0, 228.0];
        let of = |turn: bool| -> Vec<ObservationEvidence> {
            let residual = |p: &[f64; 2]| {
                let (x, y) = (1e-4 * (p[0] - centre[0]), 1e-4 * (p[1] - centre[1]));
                if turn { [-y, x] } else { [x, y] }
            };
            points.iter().map(|p| ObservationEvidence { standardised_residual: 0.2, ..seen(*p, residual(p)) }).collect()
        };
        for turn in [false, true] {
            let list = of(turn);
            let weighted: Vec<Weighted> = list.iter().filter_map(weighted).collect();
            let rings = rings(&weighted.iter().collect::<Vec<_>>(), centre);
            assert_eq!(rings.len(), RINGS);
            let last = &rings[RINGS - 1];
            let (along, across) =
                if turn { (last.tangential_px, last.radial_px) } else { (last.radial_px, last.tangential_px) };
            // Means are weighted, hence between the ring's ends.
            let ends = last.radius_px.map(|r| 1e-4 * r);
            assert!(along > 0.99 * ends[0] && along < 1.01 * ends[1] && across.abs() < 1e-9, "{last:?}");
        }
    }

    #[test]
    fn cells_hold_the_points_they_cover() {
        let list: Vec<ObservationEvidence> = (0..5)
            .map(|i| seen([639.0, 479.0 - i as f64], [0.1, -0.05]))
            .chain([seen([0.0, 0.0], [1.0, 1.0])])
            .collect();
        let weighted: Vec<Weighted> = list.iter().filter_map(weighted).collect();
        let field = field(&weighted.iter().collect::<Vec<_>>(), [640, 480], 8);
        assert_eq!((field.cells_xy, field.cells.len()), ([8, 6], 1));
        let cell = &field.cells[0];
        assert_eq!((cell.observations, cell.at), (5, [599.5, 439.5]));
        assert!((cell.mean_px[0] - 0.1).abs() < 1e-12 && (cell.mean_px[1] + 0.05).abs() < 1e-12);
        assert!((cell.sigma_px - 0.1 / 5f64.sqrt()).abs() < 1e-12);
    }
}
