//! Elimination of the points, one track after the other, and the reduced equations that are left.
//!
//! A track's residuals r with their derivatives J by the blocks and P by its point are multiplied by Qᵀ of P = Q R; the rows below
//! R do not contain the point any more and make the reduced normal equations (the Schur complement, Triggs et al. 2000, in its
//! numerically better square-root form; of long tracks JᵀJ less the rows of R), the rows of R give the point back.

use nalgebra::DVector;

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

/// A chunk's part of the reduced equations.
pub(crate) struct Part {
    cluster: usize,
    cost: f64,
    /// Half the squared residual that the points alone take away.
    by_points: f64,
    /// Lower triangle by rows.
    information: Vec<f64>,
    gradient: Vec<f64>,
    eliminations: Vec<Elimination>,
    /// Two rows of Qᵀ J a track, one after the other.
    rows: Vec<f64>,
}

/// The rows of a track's observations, two each: derivatives by the cluster's columns, by the point (2), residual.
pub(crate) struct TrackRows {
    rows: Vec<f64>,
    columns: usize,
    scratch: Vec<f64>,
}

impl TrackRows {
    pub(crate) fn new(cluster: &Cluster) -> Self {
        let columns = cluster.columns.len();
        Self { rows: vec![0.0; 2 * cluster.images.len() * (columns + 3)], columns, scratch: Vec::new() }
    }

    fn width(&self) -> usize {
        self.columns + 3
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
        for &(number, place) in places {
            let (x, y) = (derivatives[2 * number], derivatives[2 * number + 1]);
            self.x[place] += a * x + b * y;
            self.y[place] += d * y;
        }
    }

    /// Sets the derivatives by one of the point's two coordinates, whitened.
    pub(crate) fn set_point(&mut self, coordinate: usize, (x, y): (f64, f64), [a, b, d]: [f64; 3]) {
        self.x[self.columns + coordinate] = a * x + b * y;
        self.y[self.columns + coordinate] = d * y;
    }

    /// Sets the residual, weighted.
    pub(crate) fn set_residual(&mut self, x: f64, y: f64) {
        self.x[self.columns + 2] = x;
        self.y[self.columns + 2] = y;
    }
}

impl Part {
    pub(crate) fn new(cluster: usize, columns: usize, tracks: usize) -> Self {
        Self {
            cluster,
            cost: 0.0,
            by_points: 0.0,
            information: vec![0.0; columns * (columns + 1) / 2],
            gradient: vec![0.0; columns],
            eliminations: Vec::with_capacity(tracks),
            rows: Vec::with_capacity(2 * columns * tracks),
        }
    }

    pub(crate) fn add_cost(&mut self, cost: f64) {
        self.cost += cost;
    }

    /// Eliminates a track's point; `None` when it is not determined.
    pub(crate) fn eliminate(&mut self, track: usize, rows: &mut TrackRows, places: &[ObservationPlaces]) -> Option<()> {
        let (n, width) = (rows.columns, rows.width());
        // Of a long track each row has few entries before the elimination and many after: there the two rows of R are taken
        // from the sum of all, elsewhere the rows that are left are summed.
        let long = places.len() > LONG_TRACK;
        if long {
            for (pair, p) in rows.rows.chunks_exact(2 * width).zip(places) {
                for row in pair.chunks_exact(width) {
                    self.add_sparse(row, &p.occupied, row[n + 2]);
                }
            }
        }
        let e = triangulate(&mut rows.rows, width, n, &mut rows.scratch)?;
        self.by_points += 0.5 * (e[3] * e[3] + e[4] * e[4]);
        self.eliminations.push(Elimination { track, r: [e[0], e[1], e[2]], right: [e[3], e[4]] });
        self.rows.extend_from_slice(&rows.rows[..n]);
        self.rows.extend_from_slice(&rows.rows[width..width + n]);
        if long {
            for row in rows.rows.chunks_exact(width).take(2) {
                self.add(&row[..n], row[n + 2], -1.0);
            }
        } else {
            for row in rows.rows.chunks_exact(width).skip(2) {
                self.add(&row[..n], row[n + 2], 1.0);
            }
        }
        Some(())
    }

    /// Adds (or takes away) the outer product of a row of J and its product with the residual.
    fn add(&mut self, j: &[f64], r: f64, sign: f64) {
        let mut at = 0;
        for (i, &value) in j.iter().enumerate() {
            let value = sign * value;
            self.gradient[i] += value * r;
            for (sum, other) in self.information[at..=at + i].iter_mut().zip(j) {
                *sum += value * other;
            }
            at += i + 1;
        }
    }

    /// The same for a row that has entries at `occupied` only, ascending.
    fn add_sparse(&mut self, j: &[f64], occupied: &[usize], r: f64) {
        for (k, &row) in occupied.iter().enumerate() {
            let value = j[row];
            self.gradient[row] += value * r;
            let start = row * (row + 1) / 2;
            for &column in &occupied[..=k] {
                self.information[start + column] += value * j[column];
            }
        }
    }
}

/// Two Householder reflections that make the columns n and n + 1 (the point's) upper triangular; returns R by rows and the two
/// first entries of the residual column. `None` when the point is not determined.
fn triangulate(rows: &mut [f64], width: usize, n: usize, scratch: &mut Vec<f64>) -> Option<[f64; 5]> {
    let count = rows.len() / width;
    let mut diagonal = [0.0; 2];
    for (k, alpha) in diagonal.iter_mut().enumerate() {
        let column = n + k;
        let norm = (k..count).map(|i| rows[i * width + column].powi(2)).sum::<f64>().sqrt();
        if norm.is_nan() || norm <= f64::MIN_POSITIVE {
            return None;
        }
        let head = rows[k * width + column];
        *alpha = if head > 0.0 { -norm } else { norm };
        // v = column - alpha e_k, vᵀv / 2 = norm (norm + |head|).
        let beta = 1.0 / (norm * (norm + head.abs()));
        scratch.clear();
        scratch.resize(width + count, 0.0);
        let (sums, v) = scratch.split_at_mut(width);
        for i in k..count {
            v[i] = rows[i * width + column];
        }
        v[k] -= *alpha;
        for (row, weight) in rows.chunks_exact(width).zip(v.iter()).skip(k) {
            for (sum, value) in sums.iter_mut().zip(row) {
                *sum += weight * value;
            }
        }
        for (row, weight) in rows.chunks_exact_mut(width).zip(v.iter()).skip(k) {
            let factor = beta * weight;
            for (value, sum) in row.iter_mut().zip(sums.iter()) {
                *value -= factor * sum;
            }
        }
    }
    Some([diagonal[0], rows[n + 1], diagonal[1], rows[n + 2], rows[width + n + 2]])
}

/// The problem linearised, points eliminated.
pub struct Reduced {
    cost: f64,
    by_points: f64,
    /// Information of the columns.
    pub information: Skyline,
    gradient: DVector<f64>,
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
            let mut values = part.information.iter();
            for (i, &row) in columns.iter().enumerate() {
                gradient[row] += part.gradient[i];
                for (&column, value) in columns[..=i].iter().zip(&mut values) {
                    information.add(row, column, *value);
                }
            }
        }
        let columns = clusters.iter().map(|c| c.columns.clone()).collect();
        Self { cost, by_points, information, gradient, parts, columns, points }
    }

    /// Adds a prior: `sign` times the column's step adds to a value of a deviation.
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
        let n = self.information.size();
        let step = self.information.cholesky(lambda)?.solve(&(-&self.gradient));
        let predicted_decrease =
            self.by_points - self.gradient.dot(&step) - 0.5 * step.dot(&self.information.product(&step));
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
        Some(DampedStep { step: all, predicted_decrease })
    }
}
