//! Symmetric positive definite matrices in skyline storage: of each row what lies between its first entry and the diagonal.
//!
//! A = L Lᵀ keeps the skyline (George & Liu 1981, 4.2), so that views that see only their neighbours cost time and memory in
//! proportion to their number.

use multiversion::multiversion;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// A symmetric matrix: lower triangle, each row from its first entry on.
#[derive(Debug, Clone)]
pub(crate) struct Skyline {
    first: Vec<usize>,
    /// Where the row's values begin; one more at the end.
    start: Vec<usize>,
    values: Vec<f64>,
}

/// Columns of a product: wide enough for the kernel of products, narrow enough to leave out most of the zeros.
const PRODUCT_BLOCK: usize = 64;
/// Right-hand sides solved for at once: their sums fill vector registers.
const TOGETHER: usize = 8;
/// Pivots below this fraction of the diagonal are rounding: the matrix is singular to working precision.
const SINGULAR: f64 = 1e-14;

impl Skyline {
    /// All zero; `first[i] <= i` is the column of row i's first entry.
    pub(crate) fn zeros(first: Vec<usize>) -> Self {
        let mut start = Vec::with_capacity(first.len() + 1);
        let mut total = 0;
        for (row, &column) in first.iter().enumerate() {
            start.push(total);
            total += row + 1 - column.min(row);
        }
        start.push(total);
        Self { values: vec![0.0; total], first, start }
    }

    /// Rows.
    pub(crate) fn size(&self) -> usize {
        self.first.len()
    }

    fn row(&self, i: usize) -> &[f64] {
        &self.values[self.start[i]..self.start[i + 1]]
    }

    fn index(&self, i: usize, j: usize) -> usize {
        let (row, column) = if i >= j { (i, j) } else { (j, i) };
        debug_assert!(column >= self.first[row], "outside the skyline");
        self.start[row] + column - self.first[row]
    }

    /// Adds to an entry (and its mirror image), which must lie within the skyline.
    pub(crate) fn add(&mut self, i: usize, j: usize, value: f64) {
        let at = self.index(i, j);
        self.values[at] += value;
    }

    /// The rows and columns `kept` (ascending) alone.
    pub(crate) fn restricted(&self, kept: &[usize]) -> Self {
        let first = kept.iter().enumerate().map(|(row, &i)| kept.partition_point(|&j| j < self.first[i]).min(row));
        let mut out = Self::zeros(first.collect());
        for (row, &i) in kept.iter().enumerate() {
            let from = out.first[row];
            for (column, &j) in kept[..=row].iter().enumerate().skip(from) {
                out.add(row, column, self.values[self.index(i, j)]);
            }
        }
        out
    }

    /// A x.
    pub(crate) fn product(&self, x: &DVector<f64>) -> DVector<f64> {
        let mut y = DVector::zeros(x.len());
        for i in 0..self.size() {
            let (row, first) = (self.row(i), self.first[i]);
            let mut sum = 0.0;
            for (k, value) in row[..i - first].iter().enumerate() {
                sum += value * x[first + k];
                y[first + k] += value * x[i];
            }
            y[i] += sum + row[i - first] * x[i];
        }
        y
    }

    /// The factor of A + λ diag(A); `None` when that is not positive definite to working precision.
    pub(crate) fn cholesky(&self, lambda: f64) -> Option<SkylineCholesky> {
        let mut l = self.clone();
        factorise(&mut l, lambda).then_some(SkylineCholesky(l))
    }
}

/// Products summed up in lanes, so that the compiler does several at once.
#[inline(always)]
fn dot(a: &[f64], b: &[f64]) -> f64 {
    const LANES: usize = 8;
    let mut sums = [0.0; LANES];
    let ((a, a_rest), (b, b_rest)) = (a.as_chunks::<LANES>(), b.as_chunks::<LANES>());
    for (a, b) in a.iter().zip(b) {
        sums.iter_mut().zip(a.iter().zip(b)).for_each(|(sum, (a, b))| *sum += a * b);
    }
    a_rest.iter().zip(b_rest).map(|(a, b)| a * b).sum::<f64>() + sums.iter().sum::<f64>()
}

/// Makes a matrix A the factor L of A + λ diag(A); whether that is positive definite to working precision.
#[multiversion(targets("x86_64+avx2"))]
fn factorise(l: &mut Skyline, lambda: f64) -> bool {
    let size = l.size();
    let Skyline { first: firsts, start: starts, values } = l;
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
#[derive(Debug, Clone)]
pub(crate) struct SkylineCholesky(Skyline);

impl SkylineCholesky {
    /// Logarithm of the determinant of A.
    pub(crate) fn log_determinant(&self) -> f64 {
        let l = &self.0;
        (0..l.size()).map(|i| 2.0 * l.values[l.start[i + 1] - 1].ln()).sum()
    }

    /// A⁻¹ b.
    pub(crate) fn solve(&self, b: &DVector<f64>) -> DVector<f64> {
        let l = &self.0;
        let mut forward: Vec<[f64; 1]> = b.iter().map(|value| [*value]).collect();
        self.forward(&mut forward, 0);
        let mut x = DVector::from_iterator(b.len(), forward.into_iter().map(|[value]| value));
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

    /// L⁻¹ X in place, for as many right-hand sides as a row of X has entries; X is zero before row `from`.
    fn forward<const N: usize>(&self, x: &mut [[f64; N]], from: usize) {
        let l = &self.0;
        // One beyond the last row that is not zero: rows that do not reach back to it are none either.
        let mut reach = from;
        for i in from..l.size() {
            let (row, first) = (l.row(i), l.first[i]);
            if first >= reach && x[i].iter().all(|x| *x == 0.0) {
                continue;
            }
            reach = i + 1;
            let begin = first.max(from);
            let mut sums = [0.0; N];
            for (entry, x) in row[begin - first..i - first].iter().zip(&x[begin..i]) {
                sums.iter_mut().zip(x).for_each(|(sum, x)| *sum += entry * x);
            }
            x[i].iter_mut().zip(sums).for_each(|(x, sum)| *x = (*x - sum) / row[i - first]);
        }
    }

    /// Diagonal entries of A⁻¹: (A⁻¹)ᵢᵢ = |L⁻¹ eᵢ|².
    pub(crate) fn inverse_diagonal(&self, indices: &[usize]) -> Vec<f64> {
        let of_some = |indices: &[usize]| {
            let from = indices.iter().copied().min().unwrap_or(0);
            let mut x = vec![[0.0; TOGETHER]; self.0.size()];
            indices.iter().enumerate().for_each(|(lane, &i)| x[i][lane] = 1.0);
            self.forward(&mut x, from);
            let mut sums = [0.0; TOGETHER];
            x[from..].iter().for_each(|x| sums.iter_mut().zip(x).for_each(|(sum, x)| *sum += x * x));
            sums[..indices.len()].to_vec()
        };
        indices.par_chunks(TOGETHER).flat_map_iter(of_some).collect()
    }

    /// Rows and columns `indices` of A⁻¹: (A⁻¹)ᵢⱼ = (L⁻¹ eᵢ)·(L⁻¹ eⱼ). Thousands of them, the deviations of as many views, are most of the
    /// work of a refinement: several are solved for at once, and what is zero is left out of their products.
    pub(crate) fn inverse_block(&self, indices: &[usize]) -> DMatrix<f64> {
        let (n, count) = (self.0.size(), indices.len());
        let mut order: Vec<usize> = (0..count).collect();
        order.sort_by_key(|&k| indices[k]);
        let sorted: Vec<usize> = order.iter().map(|&k| indices[k]).collect();
        let mut columns = DMatrix::<f64>::zeros(n, count);
        columns.as_mut_slice().par_chunks_mut((n * TOGETHER).max(1)).zip(sorted.par_chunks(TOGETHER)).for_each(
            |(columns, indices)| {
                let mut x = vec![[0.0; TOGETHER]; n];
                indices.iter().enumerate().for_each(|(lane, &i)| x[i][lane] = 1.0);
                self.forward(&mut x, indices[0]);
                for (lane, column) in columns.chunks_exact_mut(n).enumerate() {
                    column.iter_mut().zip(&x).for_each(|(value, x)| *value = x[lane]);
                }
            },
        );
        let products = products_of_columns(&columns, &sorted);
        let mut place = vec![0; count];
        order.iter().enumerate().for_each(|(to, &from)| place[from] = to);
        DMatrix::from_fn(count, count, |r, c| products[(place[r], place[c])])
    }
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

    /// A band of three with two full rows at the end, and the same dense.
    fn example() -> (Skyline, DMatrix<f64>) {
        let n = 12;
        let first: Vec<usize> = (0..n).map(|i: usize| if i >= n - 2 { 0 } else { i.saturating_sub(2) }).collect();
        let mut sparse = Skyline::zeros(first.clone());
        let mut dense = DMatrix::zeros(n, n);
        for i in 0..n {
            for j in first[i]..=i {
                let value = if i == j { 8.0 + i as f64 } else { ((3 * i + 7 * j) as f64).sin() };
                sparse.add(j, i, value);
                dense[(i, j)] = value;
                dense[(j, i)] = value;
            }
        }
        (sparse, dense)
    }

    #[test]
    fn agrees_with_dense_algebra() {
        let (sparse, dense) = example();
        let x = DVector::from_fn(12, |i, _| (i as f64).cos());
        assert!((sparse.product(&x) - &dense * &x).norm() < 1e-13);
        for lambda in [0.0, 0.3] {
            let mut damped = dense.clone();
            for i in 0..12 {
                damped[(i, i)] *= 1.0 + lambda;
            }
            let factor = sparse.cholesky(lambda).expect("positive definite");
            assert!((&damped * factor.solve(&x) - &x).norm() < 1e-12);
            let inverse = damped.try_inverse().expect("regular");
            let block = factor.inverse_block(&[1, 5, 11]);
            for (r, i) in [1, 5, 11].into_iter().enumerate() {
                for (c, j) in [1, 5, 11].into_iter().enumerate() {
                    assert!((block[(r, c)] - inverse[(i, j)]).abs() < 1e-14);
                }
            }
        }
    }

    /// Of more columns than are solved for at once or multiplied at once, in any order, some twice.
    #[test]
    fn many_columns_of_the_inverse_agree_with_dense_algebra() {
        let n = 150;
        let first: Vec<usize> = (0..n).map(|i: usize| if i >= n - 3 { 0 } else { i.saturating_sub(i % 7) }).collect();
        let (mut sparse, mut dense) = (Skyline::zeros(first.clone()), DMatrix::zeros(n, n));
        for (i, &first) in first.iter().enumerate() {
            for j in first..=i {
                let value = if i == j { 90.0 + i as f64 } else { ((3 * i + 7 * j) as f64).sin() };
                sparse.add(i, j, value);
                (dense[(i, j)], dense[(j, i)]) = (value, value);
            }
        }
        let inverse = dense.try_inverse().expect("regular");
        let indices: Vec<usize> = (0..149).map(|k| (k * 91 + 20) % n).chain([20, 0]).collect();
        let block = sparse.cholesky(0.0).expect("positive definite").inverse_block(&indices);
        let wanted = DMatrix::from_fn(indices.len(), indices.len(), |r, c| inverse[(indices[r], indices[c])]);
        assert!((&block - wanted).amax() < 1e-15, "{}", (block.clone() - block.transpose()).amax());
        assert_eq!(sparse.cholesky(0.0).expect("positive definite").inverse_block(&[]).nrows(), 0);
    }

    #[test]
    fn determinants_and_parts_agree_with_dense_algebra() {
        let (sparse, dense) = example();
        let kept = [0, 2, 3, 7, 10, 11];
        for (part, dense) in [
            (sparse.restricted(&(0..12).collect::<Vec<_>>()), dense.clone()),
            (sparse.restricted(&kept), dense.select_rows(&kept).select_columns(&kept)),
        ] {
            let factor = part.cholesky(0.0).expect("positive definite");
            assert!((factor.log_determinant() - dense.determinant().ln()).abs() < 1e-12);
            let x = DVector::from_element(dense.nrows(), 1.0);
            assert!((part.product(&x) - &dense * &x).norm() < 1e-13);
        }
    }

    #[test]
    fn what_is_not_positive_definite_is_refused() {
        let mut indefinite = Skyline::zeros(vec![0, 0]);
        indefinite.add(0, 0, 1.0);
        indefinite.add(1, 0, 2.0);
        indefinite.add(1, 1, 4.0);
        assert!(indefinite.cholesky(0.0).is_none(), "singular");
        assert!(indefinite.cholesky(0.1).is_some(), "damped");
        indefinite.add(1, 1, f64::NAN);
        assert!(indefinite.cholesky(0.1).is_none(), "not a number");
    }
}
