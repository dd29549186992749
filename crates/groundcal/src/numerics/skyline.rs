//! Symmetric positive definite matrices in skyline storage: of each row what lies between its first entry and the diagonal.
//!
//! A = L Lᵀ keeps the skyline (George & Liu 1981, 4.2), so that views that see only their neighbours cost time and memory in
//! proportion to their number.

use nalgebra::{DMatrix, DVector};

/// A symmetric matrix: lower triangle, each row from its first entry on.
#[derive(Debug, Clone)]
pub struct Skyline {
    first: Vec<usize>,
    /// Where the row's values begin; one more at the end.
    start: Vec<usize>,
    values: Vec<f64>,
}

/// Pivots below this fraction of the diagonal are rounding: the matrix is singular to working precision.
const SINGULAR: f64 = 1e-14;

impl Skyline {
    /// All zero; `first[i] <= i` is the column of row i's first entry.
    pub fn zeros(first: Vec<usize>) -> Self {
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
    pub fn size(&self) -> usize {
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
    pub fn add(&mut self, i: usize, j: usize, value: f64) {
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
    pub fn product(&self, x: &DVector<f64>) -> DVector<f64> {
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
    pub fn cholesky(&self, lambda: f64) -> Option<SkylineCholesky> {
        let mut l = self.clone();
        for i in 0..self.size() {
            let (done, rest) = l.values.split_at_mut(self.start[i]);
            let row = &mut rest[..self.start[i + 1] - self.start[i]];
            let first = self.first[i];
            for j in first..i {
                let (other_first, other) = (self.first[j], &done[self.start[j]..self.start[j + 1]]);
                let from = first.max(other_first);
                let sum: f64 = row[from - first..j - first]
                    .iter()
                    .zip(&other[from - other_first..j - other_first])
                    .map(|(a, b)| a * b)
                    .sum();
                row[j - first] = (row[j - first] - sum) / other[j - other_first];
            }
            let diagonal = row[i - first] * (1.0 + lambda);
            let pivot = diagonal - row[..i - first].iter().map(|v| v * v).sum::<f64>();
            if pivot.is_nan() || pivot <= SINGULAR * diagonal || !pivot.is_finite() {
                return None;
            }
            row[i - first] = pivot.sqrt();
        }
        Some(SkylineCholesky(l))
    }
}

/// The lower factor L of A = L Lᵀ.
#[derive(Debug, Clone)]
pub struct SkylineCholesky(Skyline);

impl SkylineCholesky {
    /// Logarithm of the determinant of A.
    pub(crate) fn log_determinant(&self) -> f64 {
        let l = &self.0;
        (0..l.size()).map(|i| 2.0 * l.values[l.start[i + 1] - 1].ln()).sum()
    }

    /// A⁻¹ b.
    pub fn solve(&self, b: &DVector<f64>) -> DVector<f64> {
        let l = &self.0;
        let mut x = b.clone();
        self.forward(&mut x, 0);
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

    /// L⁻¹ x in place, x being zero before `from`.
    fn forward(&self, x: &mut DVector<f64>, from: usize) {
        let l = &self.0;
        for i in from..l.size() {
            let (row, first) = (l.row(i), l.first[i]);
            let begin = first.max(from);
            let sum: f64 = (begin..i).map(|k| row[k - first] * x[k]).sum();
            x[i] = (x[i] - sum) / row[i - first];
        }
    }

    /// Rows and columns `indices` of A⁻¹: (A⁻¹)ᵢⱼ = (L⁻¹ eᵢ)·(L⁻¹ eⱼ).
    pub fn inverse_block(&self, indices: &[usize]) -> DMatrix<f64> {
        let columns: Vec<DVector<f64>> = indices
            .iter()
            .map(|&i| {
                let mut x = DVector::zeros(self.0.size());
                x[i] = 1.0;
                self.forward(&mut x, i);
                x
            })
            .collect();
        DMatrix::from_fn(indices.len(), indices.len(), |r, c| columns[r].dot(&columns[c]))
    }
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
