//! The factor of a skyline matrix, which keeps the skyline (George & Liu 1981, 4.2), and entries of the inverse from it.
//!
//! ```text
//! A = L Lᵀ,  Z = A⁻¹:     z_ij = -(1 / l_jj) Σ_k z_ik l_kj  (i > j),     z_jj = (1 / l_jj - Σ_k z_jk l_kj) / l_jj         (Takahashi, Fagan & Chin 1973)
//!                         z_ij = (L⁻¹ eᵢ)·(L⁻¹ eⱼ)
//! ```
//!
//! k runs over the rows below j in which column j of L has an entry. Any two of them have an entry of A in common, so that what Z has where A has
//! entries follows from the last column to the first (Erisman & Tinney 1975), at the cost of a factorisation or two: the deviations of thousands of
//! views. Few entries, or those elsewhere, are products of solutions.

use std::{
    collections::BTreeMap,
    ops::Range,
    sync::{Arc, Mutex, OnceLock, PoisonError},
};

use multiversion::multiversion;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use crate::numerics::skyline::{Skyline, dot};

/// Columns of a product: wide enough for the kernel of products, narrow enough to leave out most of the zeros.
const PRODUCT_BLOCK: usize = 64;
/// Right-hand sides solved for at once: their sums fill vector registers.
const TOGETHER: usize = 8;

/// Pivots below this fraction of the diagonal are rounding: the matrix is singular to working precision.
const SINGULAR: f64 = 1e-14;

/// What is known of the inverse.
#[derive(Debug, Default)]
struct KnownInverse {
    /// Its entries where the matrix has some.
    within: OnceLock<Skyline>,
    /// Columns that were asked for elsewhere.
    beyond: Mutex<BTreeMap<usize, Arc<SparseColumn>>>,
}

/// Entries of a column of the inverse from its diagonal on, in some rows.
#[derive(Debug)]
struct SparseColumn {
    rows: Rows,
    values: Vec<f64>,
}

/// Ascending ranges of rows, as one after the other.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Rows {
    ranges: Vec<Range<usize>>,
    /// Where each begins among all.
    offsets: Vec<usize>,
    count: usize,
}

impl Rows {
    fn new(ranges: Vec<Range<usize>>) -> Self {
        let mut offsets = Vec::with_capacity(ranges.len());
        let mut count = 0;
        for range in &ranges {
            offsets.push(count);
            count += range.len();
        }
        Self { ranges, offsets, count }
    }

    /// Each with its place.
    fn iter(&self) -> impl Iterator<Item = (&Range<usize>, usize)> {
        self.ranges.iter().zip(self.offsets.iter().copied())
    }

    /// The place of a row.
    fn place(&self, row: usize) -> Option<usize> {
        let k = self.ranges.partition_point(|range| range.end <= row);
        let range = self.ranges.get(k).filter(|range| range.contains(&row))?;
        Some(self.offsets[k] + row - range.start)
    }
}

impl Skyline {
    /// The factor of A + λ diag(A); `None` when that is not positive definite to working precision.
    pub(crate) fn cholesky(&self, lambda: f64) -> Option<SkylineCholesky> {
        let mut l = self.clone();
        factorise(&mut l, lambda).then(|| SkylineCholesky { l, inverse: KnownInverse::default() })
    }

    /// Rows of L⁻¹ X that are not zero where X has entries in rows `of` (ascending) alone.
    fn touched(&self, of: &[usize]) -> Rows {
        let mut ranges = Vec::new();
        let mut next_of = 0;
        let mut row = of.first().copied().unwrap_or(self.size());
        while row < self.size() {
            let start = row;
            row += 1;
            // A row reaches back to the one before, or is one of those asked for.
            while row < self.size() && (self.first(row) < row || of.binary_search(&row).is_ok()) {
                row += 1;
            }
            ranges.push(start..row);
            next_of += of[next_of..].partition_point(|&i| i < row);
            let asked_for = of.get(next_of).copied().unwrap_or(self.size());
            row = self.next_reaching(row, row - 1).min(asked_for);
        }
        Rows::new(ranges)
    }

    /// Steps of the recursion for Z: squares of the entries of each column below the diagonal.
    fn work_of_inverse(&self) -> f64 {
        let mut changes = vec![0isize; self.size() + 1];
        for row in 0..self.size() {
            changes[self.first(row)] += 1;
            changes[row] -= 1;
        }
        let mut below = 0isize;
        let of_column = |change: &isize| {
            below += change;
            (below * below) as f64
        };
        changes.iter().map(of_column).sum()
    }
}

/// Makes a matrix A the factor L of A + λ diag(A); whether that is positive definite to working precision.
#[multiversion(targets("x86_64+avx2"))]
fn factorise(l: &mut Skyline, lambda: f64) -> bool {
    let size = l.size();
    let Skyline { first: firsts, start: starts, values, .. } = l;
    for i in 0..size {
        let (start, end, first) = (starts[i], starts[i + 1], firsts[i]);
        let (done, rest) = values.split_at_mut(start);
        let row = &mut rest[..end - start];
        for j in first..i {
            let (other_first, other) = (firsts[j], &done[starts[j]..starts[j + 1]]);
            let from = first.max(other_first);
            // Rows of other components reach back to nothing of this one.
            if from < j {
                let sum = dot(&row[from - first..j - first], &other[from - other_first..j - other_first]);
                row[j - first] -= sum;
            }
            row[j - first] /= other[j - other_first];
        }
        let diagonal = row[i - first] * (1.0 + lambda);
        let pivot = diagonal - dot(&row[..i - first], &row[..i - first]);
        if pivot.is_nan() || pivot <= SINGULAR * diagonal || !pivot.is_finite() {
            return false;
        }
        row[i - first] = pivot.sqrt();
    }
    true
}

/// The lower factor L of A = L Lᵀ.
#[derive(Debug)]
pub(crate) struct SkylineCholesky {
    l: Skyline,
    inverse: KnownInverse,
}

impl SkylineCholesky {
    /// Logarithm of the determinant of A.
    pub(crate) fn log_determinant(&self) -> f64 {
        let l = &self.l;
        (0..l.size()).map(|i| 2.0 * l.values[l.start[i + 1] - 1].ln()).sum()
    }

    /// A⁻¹ b.
    pub(crate) fn solve(&self, b: &DVector<f64>) -> DVector<f64> {
        let l = &self.l;
        let mut x = b.clone();
        for i in 0..l.size() {
            let (row, first) = (l.row(i), l.first[i]);
            let sum: f64 = row[..i - first].iter().zip(&x.as_slice()[first..i]).map(|(entry, x)| entry * x).sum();
            x[i] = (x[i] - sum) / row[i - first];
        }
        for i in (0..l.size()).rev() {
            let (row, first) = (l.row(i), l.first[i]);
            x[i] /= row[i - first];
            let value = x[i];
            for (k, entry) in row[..i - first].iter().enumerate() {
                x[first + k] -= entry * value;
            }
        }
        x
    }
}

impl SkylineCholesky {
    /// Has the entries of the inverse where A has some computed, where that is less work than `solutions` for single columns.
    pub(crate) fn expect_entries(&self, solutions: usize) {
        let _ = self.within(solutions);
    }

    fn within(&self, solutions: usize) -> Option<&Skyline> {
        let known = self.inverse.within.get();
        if known.is_some() || self.l.work_of_inverse() > 0.25 * solutions as f64 * self.l.entries() as f64 {
            return known;
        }
        Some(self.inverse.within.get_or_init(|| inverse_within(&self.l)))
    }

    /// L⁻¹ X in place, for as many right-hand sides as a row of X has entries, of the rows of which all others of it are zero.
    fn forward<const N: usize>(&self, rows: &Rows, x: &mut [[f64; N]]) {
        let l = &self.l;
        for (k, (range, offset)) in rows.iter().enumerate() {
            for i in range.clone() {
                let (row, first) = (l.row(i), l.first(i));
                let mut sums = [0.0; N];
                for (before, place) in rows.iter().take(k + 1) {
                    let (low, high) = (first.max(before.start), i.min(before.end));
                    if low < high {
                        let x = &x[place + low - before.start..place + high - before.start];
                        for (entry, x) in row[low - first..high - first].iter().zip(x) {
                            sums.iter_mut().zip(x).for_each(|(sum, x)| *sum += entry * x);
                        }
                    }
                }
                let x = &mut x[offset + i - range.start];
                x.iter_mut().zip(sums).for_each(|(x, sum)| *x = (*x - sum) / row[i - first]);
            }
        }
    }

    /// Columns `of` (ascending, at most [`TOGETHER`]) of L⁻¹ in the rows where they are not zero.
    fn forward_columns(&self, of: &[usize]) -> (Rows, Vec<[f64; TOGETHER]>) {
        let rows = self.l.touched(of);
        let mut x = vec![[0.0; TOGETHER]; rows.count];
        for (lane, &i) in of.iter().enumerate() {
            if let Some(place) = rows.place(i) {
                x[place][lane] = 1.0;
            }
        }
        self.forward(&rows, &mut x);
        (rows, x)
    }

    /// Diagonal entries of A⁻¹: (A⁻¹)ᵢᵢ = |L⁻¹ eᵢ|².
    pub(crate) fn inverse_diagonal(&self, indices: &[usize]) -> Vec<f64> {
        if let Some(z) = self.within(indices.len()) {
            return indices.iter().map(|&i| z.entry(i, i)).collect();
        }
        let (sorted, place) = sorted(indices);
        let of_some = |indices: &[usize]| {
            let (_, x) = self.forward_columns(indices);
            let mut sums = [0.0; TOGETHER];
            x.iter().for_each(|x| sums.iter_mut().zip(x).for_each(|(sum, x)| *sum += x * x));
            sums[..indices.len()].to_vec()
        };
        let found: Vec<f64> = sorted.par_chunks(TOGETHER).flat_map_iter(of_some).collect();
        place.into_iter().map(|at| found[at]).collect()
    }

    /// Rows and columns `indices` of A⁻¹.
    pub(crate) fn inverse_block(&self, indices: &[usize]) -> DMatrix<f64> {
        let Some(z) = self.inverse.within.get() else { return self.block_of_solutions(indices) };
        let entry = |r: usize, c: usize| {
            let (row, column) = (indices[r].max(indices[c]), indices[r].min(indices[c]));
            if z.first(row) <= column { z.entry(row, column) } else { self.entry_beyond(row, column) }
        };
        let mut out = DMatrix::zeros(indices.len(), indices.len());
        for r in 0..indices.len() {
            for c in 0..=r {
                let value = entry(r, c);
                (out[(r, c)], out[(c, r)]) = (value, value);
            }
        }
        out
    }

    /// An entry of A⁻¹ where A has none: of a column that is kept, many rows being asked for.
    fn entry_beyond(&self, row: usize, column: usize) -> f64 {
        let beyond = &self.inverse.beyond;
        let known = beyond.lock().unwrap_or_else(PoisonError::into_inner).get(&column).cloned();
        let known = known.unwrap_or_else(|| {
            let found = Arc::new(self.column_beyond(column));
            beyond.lock().unwrap_or_else(PoisonError::into_inner).insert(column, found.clone());
            found
        });
        match known.rows.place(row) {
            Some(place) => known.values[place],
            // Of another component, which all that they have in common is between.
            None => self.block_of_solutions(&[column, row])[(0, 1)],
        }
    }

    /// A column of A⁻¹ from its diagonal on, in the rows that its solution touches: A⁻¹ e = L⁻ᵀ (L⁻¹ e), which for these needs no others.
    fn column_beyond(&self, column: usize) -> SparseColumn {
        let rows = self.l.touched(&[column]);
        let mut x = vec![[0.0]; rows.count];
        x[0] = [1.0];
        self.forward(&rows, &mut x);
        let mut values: Vec<f64> = x.into_iter().map(|[value]| value).collect();
        for (k, (range, offset)) in rows.iter().enumerate().collect::<Vec<_>>().into_iter().rev() {
            for i in range.clone().rev() {
                let (row, first) = (self.l.row(i), self.l.first(i));
                let at = offset + i - range.start;
                values[at] /= row[i - first];
                let value = values[at];
                for (before, place) in rows.iter().take(k + 1) {
                    let (low, high) = (first.max(before.start), i.min(before.end));
                    if low < high {
                        let values = &mut values[place + low - before.start..place + high - before.start];
                        values
                            .iter_mut()
                            .zip(&row[low - first..high - first])
                            .for_each(|(x, entry)| *x -= entry * value);
                    }
                }
            }
        }
        SparseColumn { rows, values }
    }

    /// Rows and columns `indices` of A⁻¹ as products of solutions: several are solved for at once, and what is zero is left out of their products.
    fn block_of_solutions(&self, indices: &[usize]) -> DMatrix<f64> {
        let count = indices.len();
        let (sorted, place) = sorted(indices);
        let rows = self.l.touched(&sorted);
        let n = rows.count;
        let mut columns = DMatrix::<f64>::zeros(n, count);
        columns.as_mut_slice().par_chunks_mut((n * TOGETHER).max(1)).zip(sorted.par_chunks(TOGETHER)).for_each(
            |(columns, indices)| {
                let (of_these, x) = self.forward_columns(indices);
                for (range, from) in of_these.iter() {
                    // What is touched by some is touched by all of them together, in one piece.
                    let Some(to) = rows.place(range.start) else { continue };
                    for (lane, column) in columns.chunks_exact_mut(n).enumerate() {
                        let x = &x[from..from + range.len()];
                        column[to..to + range.len()].iter_mut().zip(x).for_each(|(value, x)| *value = x[lane]);
                    }
                }
            },
        );
        let first: Vec<usize> = sorted.iter().map(|&i| rows.place(i).unwrap_or(0)).collect();
        let products = products_of_columns(&columns, &first);
        DMatrix::from_fn(count, count, |r, c| products[(place[r], place[c])])
    }
}

/// Indices in ascending order, and where each has gone.
fn sorted(indices: &[usize]) -> (Vec<usize>, Vec<usize>) {
    let mut order: Vec<usize> = (0..indices.len()).collect();
    order.sort_by_key(|&k| indices[k]);
    let mut place = vec![0; indices.len()];
    order.iter().enumerate().for_each(|(to, &from)| place[from] = to);
    (order.iter().map(|&k| indices[k]).collect(), place)
}

/// Z = A⁻¹ where A has entries, from its factor.
#[multiversion(targets("x86_64+avx2"))]
fn inverse_within(l: &Skyline) -> Skyline {
    let n = l.size();
    let mut z = Skyline::zeros((0..n).map(|i| l.first(i)).collect());
    // Ranges of the rows below j with an entry in column j, the entries, and their products with Z.
    let (mut ranges, mut entries, mut products): (Vec<Range<usize>>, Vec<f64>, Vec<f64>) = Default::default();
    for j in (0..n).rev() {
        ranges.clear();
        entries.clear();
        let mut row = l.next_reaching(j + 1, j);
        while row < n {
            let start = row;
            while row < n && l.first(row) <= j {
                entries.push(l.row(row)[j - l.first(row)]);
                row += 1;
            }
            ranges.push(start..row);
            row = l.next_reaching(row, j);
        }
        products.clear();
        products.resize(entries.len(), 0.0);
        let mut at = 0;
        for (k, range) in ranges.iter().enumerate() {
            for i in range.clone() {
                let (row, first) = (z.row(i), z.first(i));
                let (entry, mut sum, mut place) = (entries[at], 0.0, 0);
                for before in &ranges[..=k] {
                    let width = i.min(before.end) - before.start;
                    let row = &row[before.start - first..][..width];
                    sum += dot(row, &entries[place..place + width]);
                    products[place..place + width].iter_mut().zip(row).for_each(|(sum, z)| *sum += z * entry);
                    place += before.len();
                }
                products[at] += sum + row[i - first] * entry;
                at += 1;
            }
        }
        let diagonal = l.row(j)[j - l.first(j)];
        let mut at = 0;
        let mut sum = 0.0;
        for range in &ranges {
            for i in range.clone() {
                let value = -products[at] / diagonal;
                sum += value * entries[at];
                let first = z.first(i);
                z.row_mut(i)[j - first] = value;
                at += 1;
            }
        }
        let first = z.first(j);
        z.row_mut(j)[j - first] = (1.0 / diagonal - sum) / diagonal;
    }
    z
}

/// Xᵀ X of a matrix whose column c is zero before row `first[c]`, which ascend.
fn products_of_columns(columns: &DMatrix<f64>, first: &[usize]) -> DMatrix<f64> {
    let (n, count) = columns.shape();
    let rows = columns.transpose();
    let starts: Vec<usize> = (0..count).step_by(PRODUCT_BLOCK).collect();
    // Of each block of columns the products with those before it and its own, from the row where it begins.
    let products: Vec<DMatrix<f64>> = starts
        .par_iter()
        .map(|&start| {
            let (from, width) = (first[start], PRODUCT_BLOCK.min(count - start));
            rows.view((0, from), (start + width, n - from)) * columns.view((from, start), (n - from, width))
        })
        .collect();
    let mut out = DMatrix::zeros(count, count);
    for (&start, product) in starts.iter().zip(&products) {
        for c in start..start + product.ncols() {
            for r in 0..=c {
                let value = product[(r, c - start)];
                (out[(r, c)], out[(c, r)]) = (value, value);
            }
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A matrix with entries from these columns on, and the same dense.
    fn with_values(first: &[usize]) -> (Skyline, DMatrix<f64>) {
        let n = first.len();
        let (mut sparse, mut dense) = (Skyline::zeros(first.to_vec()), DMatrix::zeros(n, n));
        for (i, &first) in first.iter().enumerate() {
            for j in first..=i {
                let value = if i == j { 90.0 + i as f64 } else { ((3 * i + 7 * j) as f64).sin() };
                sparse.add(i, j, value);
                (dense[(i, j)], dense[(j, i)]) = (value, value);
            }
        }
        (sparse, dense)
    }

    /// Of more columns than are solved for at once or multiplied at once, in any order, some twice.
    #[test]
    fn many_columns_of_the_inverse_agree_with_dense_algebra() {
        let n = 150;
        let first: Vec<usize> = (0..n).map(|i: usize| if i >= n - 3 { 0 } else { i.saturating_sub(i % 7) }).collect();
        let (sparse, dense) = with_values(&first);
        let inverse = dense.try_inverse().expect("regular");
        let indices: Vec<usize> = (0..149).map(|k| (k * 91 + 20) % n).chain([20, 0]).collect();
        let block = sparse.cholesky(0.0).expect("positive definite").inverse_block(&indices);
        let wanted = DMatrix::from_fn(indices.len(), indices.len(), |r, c| inverse[(indices[r], indices[c])]);
        assert!((&block - wanted).amax() < 1e-15, "{}", (block.clone() - block.transpose()).amax());
        assert_eq!(sparse.cholesky(0.0).expect("positive definite").inverse_block(&[]).nrows(), 0);
    }

    /// Blocks of 5 to 40 that hang together by the last three rows alone, the largest a band.
    fn components() -> (Skyline, DMatrix<f64>) {
        let sizes = [5, 11, 40, 7];
        let mut first = Vec::new();
        for size in sizes {
            let start = first.len();
            first.extend((0..size).map(|k| if size == 40 { start + k.max(4) - 4 } else { start }));
        }
        first.extend([0, 0, 0]);
        with_values(&first)
    }

    #[test]
    fn entries_within_the_skyline_and_beyond_agree_with_dense_algebra() {
        let (sparse, dense) = components();
        let inverse = dense.try_inverse().expect("regular");
        let n = inverse.nrows();
        // Of one component, of two, both ends of the band, what all have in common, in any order.
        for indices in [vec![1, 0, 4], vec![2, 8, 65], vec![16, 55, 63, 20], (0..n).rev().collect()] {
            let factor = sparse.cholesky(0.0).expect("positive definite");
            let wanted = DMatrix::from_fn(indices.len(), indices.len(), |r, c| inverse[(indices[r], indices[c])]);
            let of_solutions = factor.inverse_block(&indices);
            assert!((&of_solutions - &wanted).amax() < 1e-15);
            let diagonal = factor.inverse_diagonal(&indices);
            assert!((DVector::from_vec(diagonal) - wanted.diagonal()).amax() < 1e-15);
            factor.expect_entries(usize::MAX);
            assert!(factor.inverse.within.get().is_some());
            assert!((&factor.inverse_block(&indices) - &wanted).amax() < 1e-15, "{indices:?}");
        }
    }

    #[test]
    fn solutions_touch_their_component_and_what_all_have_in_common() {
        let (sparse, _) = components();
        assert_eq!(sparse.touched(&[7]).ranges, [7..16, 63..66]);
        assert_eq!(sparse.touched(&[3, 60]).ranges, [3..5, 60..66]);
        assert_eq!(sparse.touched(&[]).ranges, []);
        assert_eq!(sparse.touched(&[64, 65]).ranges.as_slice(), std::slice::from_ref(&(64..66)));
    }
}
