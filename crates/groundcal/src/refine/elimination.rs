//! Elimination of the points, one track after the other, and the reduced equations that are left.
//!
//! ```text
//! P = Q [R; 0],   Qᵀ [J r] = [J₁ r₁; J₂ r₂]           N = Σ J₂ᵀJ₂ = Σ (JᵀJ - J₁ᵀJ₁),   g = Σ J₂ᵀr₂ = Σ (Jᵀr - J₁ᵀr₁)
//! N Δ = -g,       R Δq = -(r₁ + J₁ Δ)
//! ```
//!
//! of a track's residuals r with their derivatives J by the blocks and P by its point, two columns; sums over tracks, Δ the step of the blocks and Δq
//! that of a point. The rows J₂, r₂ do not contain the point any more and make the reduced normal equations: the Schur complement (Triggs et
//! al. 2000) in its numerically better square-root form, of long tracks as the difference. The rows J₁, r₁ give the point back.

use multiversion::multiversion;
use nalgebra::{DVector, Vector2};

use crate::{
    numerics::{
        levenberg_marquardt::{DampedStep, Linearisation},
        skyline::Skyline,
    },
    refine::layout::{Cluster, ObservationPlaces, Places},
};

/// Observations of a track from which on its elimination is a subtraction.
const LONG_TRACK: usize = 5;

/// What gives a track's point back once the step of the blocks is known.
struct Elimination {
    track: usize,
    /// R, upper triangular: (0,0), (0,1), (1,1).
    r: [f64; 3],
    /// Qᵀ r, the first two rows.
    right: [f64; 2],
}

/// Numbers that are worked on at once: rows are padded with zeros to a multiple.
const LANES: usize = 4;

/// Where a row of a lower triangle begins, each row padded to a multiple of [`LANES`].
fn row_start(row: usize) -> usize {
    let (blocks, beyond) = (row / LANES, row % LANES);
    LANES * (blocks + 1) * (LANES / 2 * blocks + beyond)
}

/// A chunk's part of the reduced equations.
pub(crate) struct Part {
    cluster: usize,
    cost: f64,
    /// Half the squared residual that the points alone take away.
    by_points: f64,
    /// Lower triangle of the information, by [`row_start`]; the gradient is the row after its last.
    equations: Vec<f64>,
    eliminations: Vec<Elimination>,
    /// Those of each track's observations, whitened and weighted, one track after the other.
    residuals: Vec<Vector2<f64>>,
    /// Two rows of Qᵀ J a track, one after the other.
    rows: Vec<f64>,
    /// Rows whose outer products are still to be added to the equations, or taken away.
    pending: Vec<f64>,
}

/// The rows of a track's observations, two each: derivatives by the cluster's columns, residual, padding, derivatives by the point (2).
pub(crate) struct TrackRows {
    rows: Vec<f64>,
    columns: usize,
    reflections: Reflections,
}

impl TrackRows {
    pub(crate) fn new(cluster: &Cluster) -> Self {
        let mut new = Self { rows: Vec::new(), columns: cluster.columns.len(), reflections: Reflections::default() };
        new.rows.resize(2 * cluster.images.len() * new.width(), 0.0);
        new
    }

    fn width(&self) -> usize {
        (self.columns + 1).next_multiple_of(LANES) + 2
    }

    pub(crate) fn clear(&mut self) {
        self.rows.fill(0.0);
    }

    /// The two rows of an observation.
    pub(crate) fn of_observation(&mut self, index: usize) -> ObservationRows<'_> {
        let (width, columns) = (self.width(), self.columns);
        let (x, y) = self.rows[2 * index * width..(2 * index + 2) * width].split_at_mut(width);
        ObservationRows { x, y, columns }
    }

    /// Derivatives of an observation's two coordinates by the columns.
    pub(crate) fn observation(&self, index: usize) -> [&[f64]; 2] {
        let width = self.width();
        [2 * index, 2 * index + 1].map(|row| &self.rows[row * width..row * width + self.columns])
    }

    /// Residuals of an observation.
    pub(crate) fn residual(&self, index: usize) -> [f64; 2] {
        let width = self.width();
        [2 * index, 2 * index + 1].map(|row| self.rows[row * width + self.columns])
    }

    /// Derivatives of all rows by one of the point's two coordinates.
    pub(crate) fn by_point(&self, coordinate: usize) -> impl Iterator<Item = f64> + Clone {
        let width = self.width();
        self.rows.chunks_exact(width).map(move |row| row[width - 2 + coordinate])
    }
}

/// The rows of an observation's two coordinates.
pub(crate) struct ObservationRows<'a> {
    x: &'a mut [f64],
    y: &'a mut [f64],
    columns: usize,
}

impl ObservationRows<'_> {
    /// Adds a block's derivatives (columns of two), whitened by the upper triangular root (a, b; 0, d).
    pub(crate) fn add_block(&mut self, derivatives: &[f64], places: &Places, [a, b, d]: [f64; 3]) {
        let columns = derivatives.as_chunks::<2>().0;
        for &(number, place) in places {
            let [x, y] = columns[number];
            self.x[place] += a * x + b * y;
            self.y[place] += d * y;
        }
    }

    /// Sets the derivatives by one of the point's two coordinates, whitened.
    pub(crate) fn set_point(&mut self, coordinate: usize, (x, y): (f64, f64), [a, b, d]: [f64; 3]) {
        let at = self.x.len() - 2 + coordinate;
        (self.x[at], self.y[at]) = (a * x + b * y, d * y);
    }

    /// Sets the residual, weighted.
    pub(crate) fn set_residual(&mut self, x: f64, y: f64) {
        self.x[self.columns] = x;
        self.y[self.columns] = y;
    }
}

impl Part {
    pub(crate) fn new(cluster: usize, columns: usize, tracks: usize) -> Self {
        Self {
            cluster,
            cost: 0.0,
            by_points: 0.0,
            equations: vec![0.0; row_start(columns + 1)],
            eliminations: Vec::with_capacity(tracks),
            residuals: Vec::new(),
            rows: Vec::with_capacity(2 * columns * tracks),
            pending: Vec::new(),
        }
    }

    pub(crate) fn add_cost(&mut self, cost: f64) {
        self.cost += cost;
    }

    /// Keeps the residuals of the next track that is eliminated.
    pub(crate) fn keep_residuals(&mut self, rows: &TrackRows, observations: usize) {
        self.residuals.extend((0..observations).map(|o| Vector2::from(rows.residual(o))));
    }

    /// Eliminates a track's point; `None` when it is not determined.
    pub(crate) fn eliminate(&mut self, track: usize, rows: &mut TrackRows, places: &[ObservationPlaces]) -> Option<()> {
        let (n, width) = (rows.columns, rows.width());
        // Of a long track each row has few entries before the elimination and many after: there the two rows of R are taken
        // from the sum of all, elsewhere the rows that are left are summed.
        let long = places.len() > LONG_TRACK;
        if long {
            for (pair, p) in rows.rows.chunks_exact(2 * width).zip(places) {
                self.add_sparse(pair.split_at(width), &p.occupied, n);
            }
        }
        let [r00, r01, r11] = rows.reflections.triangulate(&mut rows.rows, width)?;
        let of_point = &rows.rows[..2 * width];
        let right = [of_point[n], of_point[width + n]];
        self.by_points += 0.5 * (right[0] * right[0] + right[1] * right[1]);
        self.eliminations.push(Elimination { track, r: [r00, r01, r11], right });
        self.rows.extend_from_slice(&of_point[..n]);
        self.rows.extend_from_slice(&of_point[width..width + n]);
        // The rows of R, or those that are left.
        let pending = if long { of_point } else { &rows.rows[2 * width..] };
        pending.chunks_exact(width).for_each(|row| self.pending.extend_from_slice(&row[..width - 2]));
        Some(())
    }

    /// Adds the outer products of the rows that are left of all tracks, or takes those of R away, in blocks that stay in registers.
    pub(crate) fn finish(&mut self, cluster: &Cluster) {
        let sign = if cluster.images.len() > LONG_TRACK { -1.0 } else { 1.0 };
        let last = cluster.columns.len();
        add_outer_products(&self.pending, last, sign, &mut self.equations);
        self.pending = Vec::new();
    }

    /// Adds the outer products of two rows that have entries at `occupied` only, ascending, and the residual.
    fn add_sparse(&mut self, (first, second): (&[f64], &[f64]), occupied: &[usize], residual: usize) {
        for (k, &row) in occupied.iter().chain([&residual]).enumerate() {
            let (a, b) = (first[row], second[row]);
            let sums = &mut self.equations[row_start(row)..row_start(row + 1)];
            for &column in &occupied[..(k + 1).min(occupied.len())] {
                sums[column] += a * first[column] + b * second[column];
            }
        }
    }
}

/// Adds the outer products of rows of `last` derivatives and a residual, padded, to a lower triangle (see [`row_start`]), in blocks that stay in
/// registers.
#[multiversion(targets("x86_64+avx2"))]
fn add_outer_products(rows: &[f64], last: usize, sign: f64, triangle: &mut [f64]) {
    let width = (last + 1).next_multiple_of(LANES);
    for i in 0..width / LANES {
        for k in 0..=i {
            let mut sums = [[0.0; LANES]; LANES];
            for row in rows.chunks_exact(width) {
                let blocks = row.as_chunks::<LANES>().0;
                let (x, y) = (blocks[i], blocks[k]);
                for (sums, x) in sums.iter_mut().zip(&x) {
                    sums.iter_mut().zip(&y).for_each(|(sum, y)| *sum += x * y);
                }
            }
            for (row, sums) in (LANES * i..=last).zip(&sums) {
                let at = row_start(row) + LANES * k;
                triangle[at..at + LANES].iter_mut().zip(sums).for_each(|(e, s)| *e += sign * s);
            }
        }
    }
}

/// Two Householder reflections that make the last two columns (the point's) upper triangular, applied to all others at once:
/// I - β v vᵀ, then I - γ w wᵀ.
#[derive(Default)]
struct Reflections {
    /// (v, w), a row each.
    vectors: Vec<[f64; 2]>,
}

impl Reflections {
    /// Applies them and returns R: (0,0), (0,1), (1,1). The columns of the point are left as they were. `None` when the point is
    /// not determined.
    fn triangulate(&mut self, rows: &mut [f64], width: usize) -> Option<[f64; 3]> {
        let active = width - 2;
        self.vectors.clear();
        self.vectors.extend(rows.chunks_exact(width).map(|row| [row[active], row[active + 1]]));
        let (first, beta) = reflection(&mut self.vectors, 0)?;
        let along: f64 = beta * self.vectors.iter().map(|[v, c]| v * c).sum::<f64>();
        self.vectors.iter_mut().for_each(|[v, c]| *c -= along * *v);
        let corner = self.vectors[0][1];
        self.vectors[0][1] = 0.0;
        let (second, gamma) = reflection(&mut self.vectors, 1)?;
        let common: f64 = self.vectors.iter().map(|[v, w]| v * w).sum();
        apply(rows, width, &self.vectors, [beta, gamma, common]);
        Some([first, corner, second])
    }
}

/// Applies two reflections to all columns but the last two, a few at a time, so that what they are multiplied with stays in registers.
#[multiversion(targets("x86_64+avx2"))]
fn apply(rows: &mut [f64], width: usize, vectors: &[[f64; 2]], [beta, gamma, common]: [f64; 3]) {
    for at in (0..width - 2).step_by(LANES) {
        let (mut by_v, mut by_w) = ([0.0; LANES], [0.0; LANES]);
        for (row, [v, w]) in rows.chunks_exact(width).zip(vectors) {
            let Some(values) = row[at..].first_chunk::<LANES>() else { return };
            by_v = std::array::from_fn(|i| by_v[i] + v * values[i]);
            by_w = std::array::from_fn(|i| by_w[i] + w * values[i]);
        }
        by_v = by_v.map(|p| p * beta);
        by_w = std::array::from_fn(|i| gamma * (by_w[i] - common * by_v[i]));
        for (row, [v, w]) in rows.chunks_exact_mut(width).zip(vectors) {
            let Some(values) = row[at..].first_chunk_mut::<LANES>() else { return };
            *values = std::array::from_fn(|i| values[i] - (v * by_v[i] + w * by_w[i]));
        }
    }
}

/// Makes column k of the pairs, from row k on, the vector of the reflection that turns it into a multiple α of the k-th axis;
/// returns α and 2 / vᵀv.
fn reflection(vectors: &mut [[f64; 2]], k: usize) -> Option<(f64, f64)> {
    let norm = vectors[k..].iter().map(|v| v[k] * v[k]).sum::<f64>().sqrt();
    if norm.is_nan() || norm <= f64::MIN_POSITIVE {
        return None;
    }
    let head = vectors[k][k];
    let alpha = if head > 0.0 { -norm } else { norm };
    vectors[k][k] -= alpha;
    // v = column - α e_k, vᵀv / 2 = norm (norm + |head|).
    Some((alpha, 1.0 / (norm * (norm + head.abs()))))
}

/// The problem linearised, points eliminated.
pub(crate) struct Reduced {
    cost: f64,
    by_points: f64,
    /// Information of the columns.
    pub information: Skyline,
    pub(crate) gradient: DVector<f64>,
    parts: Vec<Part>,
    columns: Vec<Vec<usize>>,
    points: usize,
}

impl Reduced {
    /// The sum of the parts, in their order; `first` is the skyline of the columns.
    pub(crate) fn new(parts: Vec<Part>, clusters: &[Cluster], first: Vec<usize>, points: usize) -> Self {
        let mut gradient = DVector::zeros(first.len());
        let mut information = Skyline::zeros(first);
        let (mut cost, mut by_points) = (0.0, 0.0);
        for part in &parts {
            cost += part.cost;
            by_points += part.by_points;
            let columns = &clusters[part.cluster].columns;
            for (i, &row) in columns.iter().enumerate() {
                for (&column, value) in columns[..=i].iter().zip(&part.equations[row_start(i)..]) {
                    information.add(row, column, *value);
                }
            }
            for (&column, value) in columns.iter().zip(&part.equations[row_start(columns.len())..]) {
                gradient[column] += value;
            }
        }
        let columns = clusters.iter().map(|c| c.columns.clone()).collect();
        Self { cost, by_points, information, gradient, parts, columns, points }
    }

    /// Residuals of the observations of each track, whitened and weighted.
    pub(crate) fn residuals(&self) -> Vec<Vec<Vector2<f64>>> {
        let mut of_tracks = vec![Vec::new(); self.points];
        for part in &self.parts {
            let observations = part.residuals.len() / part.eliminations.len().max(1);
            for (e, residuals) in part.eliminations.iter().zip(part.residuals.chunks(observations.max(1))) {
                of_tracks[e.track] = residuals.to_vec();
            }
        }
        of_tracks
    }

    /// Adds a prior of standard deviation `sigma` on a number that is `value` off its mean, to which `sign` times the column's step adds.
    pub(crate) fn add_prior(&mut self, column: usize, sign: f64, value: f64, sigma: f64) {
        let weight = 1.0 / (sigma * sigma);
        self.cost += 0.5 * weight * value * value;
        self.gradient[column] += sign * weight * value;
        self.information.add(column, column, weight);
    }
}

impl Linearisation for Reduced {
    fn cost(&self) -> f64 {
        self.cost
    }

    fn solve(&self, lambda: f64) -> Option<DampedStep> {
        let step = self.information.cholesky(lambda)?.solve(&(-&self.gradient));
        let predicted_decrease =
            self.by_points - self.gradient.dot(&step) - 0.5 * step.dot(&self.information.product(&step));
        Some(DampedStep { step, predicted_decrease })
    }

    fn completed(&self, step: DVector<f64>) -> DVector<f64> {
        let n = step.len();
        let mut all = DVector::zeros(n + 2 * self.points);
        all.rows_mut(0, n).copy_from(&step);
        for part in &self.parts {
            let columns = &self.columns[part.cluster];
            let local: Vec<f64> = columns.iter().map(|&c| step[c]).collect();
            for (e, rows) in part.eliminations.iter().zip(part.rows.chunks_exact(2 * columns.len())) {
                let (first, second) = rows.split_at(columns.len());
                let along = |row: &[f64]| -> f64 { row.iter().zip(&local).map(|(a, b)| a * b).sum() };
                let (u, v) = (-(e.right[0] + along(first)), -(e.right[1] + along(second)));
                let b = v / e.r[2];
                all[n + 2 * e.track] = (u - e.r[1] * b) / e.r[0];
                all[n + 2 * e.track + 1] = b;
            }
        }
        all
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::DMatrix;

    use super::*;

    #[test]
    fn rows_of_a_triangle_follow_each_other() {
        let mut start = 0;
        for row in 0..40 {
            assert_eq!(row_start(row), start);
            start += (row + 1).next_multiple_of(LANES);
        }
    }

    #[test]
    fn reflections_are_orthogonal_and_leave_nothing_of_the_point() {
        const WIDTH: usize = 6;
        let value = |i: usize| ((7 * i + 3) as f64).sin();
        let before = DMatrix::from_fn(6, WIDTH, |r, c| value(r * WIDTH + c));
        let mut rows: Vec<f64> = before.transpose().as_slice().to_vec();
        let [a, b, c] = Reflections::default().triangulate(&mut rows, WIDTH).expect("two directions");
        // With R in the place of the point's columns, lengths and products of columns are what they were.
        let mut after = DMatrix::from_row_slice(6, WIDTH, &rows);
        after.columns_mut(4, 2).fill(0.0);
        (after[(0, 4)], after[(0, 5)], after[(1, 5)]) = (a, b, c);
        assert!((after.tr_mul(&after) - before.tr_mul(&before)).norm() < 1e-13);
        // The same direction twice is no point.
        let mut flat = rows.clone();
        flat.chunks_exact_mut(WIDTH).for_each(|row| (row[4], row[5]) = (0.0, row[4]));
        assert!(Reflections::default().triangulate(&mut flat, WIDTH).is_none());
    }
}
