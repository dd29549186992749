//! Matches between the features of two images: mutual nearest neighbours that pass the ratio test.
//!
//! Descriptors have unit length, so |p - q|² = 2 - 2 p·q: the nearest is the one of largest product.

use multiversion::multiversion;
use nalgebra::{DMatrix, DMatrixView, DMatrixViewMut, Vector2};

use crate::{
    error::Error,
    observer::Observer,
    pairs::correspondence::PointMatch,
    vision::features::feature::{DESCRIPTOR_LENGTH, Features},
};

/// Which features match.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct MatchOptions {
    /// Largest ratio of the distance to the nearest and to the second nearest descriptor of another place.
    pub max_ratio: f32,
    /// A rival within this many scales of the nearest is the same place seen twice, not a rival.
    pub same_place_scales: f32,
}

impl Default for MatchOptions {
    fn default() -> Self {
        Self { max_ratio: 0.88, same_place_scales: 1.0 }
    }
}

/// Rows of the product computed at once: the block stays in the cache.
const BLOCK: usize = 128;

/// Matches, in the order of the first image's features. Deterministic.
///
/// # Errors
/// [`Error::Stopped`] and no other.
pub(crate) fn match_features_until(
    a: &Features,
    b: &Features,
    options: &MatchOptions,
    observer: &dyn Observer,
) -> Result<Vec<PointMatch>, Error> {
    let (na, nb) = (a.points.len(), b.points.len());
    if na == 0 || nb < 2 {
        return Ok(Vec::new());
    }
    let mut products = vec![0.0f32; BLOCK * nb];
    // nb x 128, so that the product below is a plain one, for which nalgebra has a fast kernel.
    let rows_of_b = DMatrix::from_row_slice(nb, DESCRIPTOR_LENGTH, &b.descriptors);
    // For each feature of a its nearest and the best rival's product; for each of b its nearest.
    let mut forward: Vec<(usize, f32, f32)> = Vec::with_capacity(na);
    let (mut backward, mut backward_best) = (vec![0u32; nb], vec![f32::NEG_INFINITY; nb]);
    for start in (0..na).step_by(BLOCK) {
        observer.go_on()?;
        let rows = BLOCK.min(na - start);
        let block = &a.descriptors[start * DESCRIPTOR_LENGTH..(start + rows) * DESCRIPTOR_LENGTH];
        // Column r of the product is row r of `products`.
        DMatrixViewMut::from_slice(&mut products[..rows * nb], nb, rows).gemm(
            1.0,
            &rows_of_b,
            &DMatrixView::from_slice(block, DESCRIPTOR_LENGTH, rows),
            0.0,
        );
        for r in 0..rows {
            let row = &products[r * nb..(r + 1) * nb];
            let index = (start + r) as u32;
            keep_nearest(row, index, &mut backward_best, &mut backward);
            let [first, mut second] = two_largest(row);
            let near = |j: usize| {
                let (p, q) = (&b.points[first.0], &b.points[j]);
                let reach = options.same_place_scales * p.scale_px.max(q.scale_px);
                (p.x - q.x).abs() <= reach && (p.y - q.y).abs() <= reach
            };
            if near(second.0) {
                // Rare: the rival is the same place with another direction or scale. Look on.
                second = row
                    .iter()
                    .enumerate()
                    .filter(|(j, _)| !near(*j))
                    .map(|(j, &v)| (j, v))
                    .fold((0, f32::NEG_INFINITY), |s, t| if t.1 > s.1 { t } else { s });
            }
            forward.push((first.0, first.1, second.1));
        }
    }
    let squared = |product: f32| (2.0 - 2.0 * product).max(0.0);
    let mut matches: Vec<PointMatch> = Vec::new();
    let mut seen = std::collections::HashSet::new();
    for (i, &(j, best, rival)) in forward.iter().enumerate() {
        let distinct = rival == f32::NEG_INFINITY || squared(best) < options.max_ratio.powi(2) * squared(rival);
        if !distinct || backward[j] as usize != i {
            continue;
        }
        let (p, q) = (&a.points[i], &b.points[j]);
        // A point with several directions would count several times.
        if seen.insert([p.x, p.y, q.x, q.y].map(f32::to_bits)) {
            matches.push(PointMatch {
                a: Vector2::new(f64::from(p.x), f64::from(p.y)),
                b: Vector2::new(f64::from(q.x), f64::from(q.y)),
                sigma_px: 1.0,
            });
        }
    }
    Ok(matches)
}

/// The same without an observer.
#[cfg(test)]
pub(crate) fn match_features(a: &Features, b: &Features, options: &MatchOptions) -> Vec<PointMatch> {
    match_features_until(a, b, options, &crate::observer::Silent).unwrap_or_default()
}

/// Puts a row's values and its index in the place of smaller ones.
#[multiversion(targets("x86_64+avx2"))]
fn keep_nearest(row: &[f32], index: u32, best: &mut [f32], nearest: &mut [u32]) {
    for ((&value, best), nearest) in row.iter().zip(best).zip(nearest) {
        // Masks instead of a branch: the compiler does several at once.
        let (before, was) = (*best, *nearest);
        let mask = u32::from(value > before).wrapping_neg();
        *best = if value > before { value } else { before };
        *nearest = (index & mask) | (was & !mask);
    }
}

/// The two largest values of a row and where they are; of equals the first.
#[multiversion(targets("x86_64+avx2"))]
fn two_largest(row: &[f32]) -> [(usize, f32); 2] {
    const LANES: usize = 16;
    let (mut first, mut second) = ((0, f32::NEG_INFINITY), (0, f32::NEG_INFINITY));
    for (c, chunk) in row.chunks(LANES).enumerate() {
        // Hardly any chunk has one: looked at without a branch for each value.
        let limit = second.1;
        let above = chunk.iter().fold(false, |above, &value| above | (value > limit));
        if !above {
            continue;
        }
        for (j, &value) in chunk.iter().enumerate() {
            if value > second.1 {
                let here = (c * LANES + j, value);
                if value > first.1 {
                    (first, second) = (here, first);
                } else {
                    second = here;
                }
            }
        }
    }
    [first, second]
}
