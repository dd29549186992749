//! Symmetric positive definite matrices in skyline storage: of each row what lies between its first entry and the diagonal.
//!
//! Their factor keeps it (`skyline_cholesky`), so that views that see only their neighbours cost time and memory in proportion to their number.

use nalgebra::DVector;

/// A symmetric matrix: lower triangle, each row from its first entry on.
#[derive(Debug, Clone)]
pub(crate) struct Skyline {
    pub(super) first: Vec<usize>,
    /// The least of these of every [`ROWS_TOGETHER`] rows.
    least_first: Vec<usize>,
    /// Where the row's values begin; one more at the end.
    pub(super) start: Vec<usize>,
    pub(super) values: Vec<f64>,
}

/// Rows that are passed over at once where none of them reaches back far enough.
const ROWS_TOGETHER: usize = 32;

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
        let least_of = |rows: &[usize]| rows.iter().copied().min().unwrap_or(0);
        let least_first = first.chunks(ROWS_TOGETHER).map(least_of).collect();
        Self { values: vec![0.0; total], first, least_first, start }
    }

    /// Rows.
    pub(crate) fn size(&self) -> usize {
        self.first.len()
    }

    /// Column of a row's first entry.
    pub(crate) fn first(&self, i: usize) -> usize {
        self.first[i]
    }

    /// A row from there to the diagonal.
    pub(super) fn row(&self, i: usize) -> &[f64] {
        &self.values[self.start[i]..self.start[i + 1]]
    }

    /// The same to write to.
    pub(super) fn row_mut(&mut self, i: usize) -> &mut [f64] {
        &mut self.values[self.start[i]..self.start[i + 1]]
    }

    /// Entries that are stored.
    pub(super) fn entries(&self) -> usize {
        self.values.len()
    }

    /// The first row from `from` on that has an entry in a column or before it; the number of rows: none has.
    pub(super) fn next_reaching(&self, from: usize, column: usize) -> usize {
        let mut row = from;
        while row < self.size() {
            if row.is_multiple_of(ROWS_TOGETHER) && self.least_first[row / ROWS_TOGETHER] > column {
                row += ROWS_TOGETHER;
            } else if self.first[row] <= column {
                return row;
            } else {
                row += 1;
            }
        }
        self.size()
    }

    fn index(&self, i: usize, j: usize) -> usize {
        let (row, column) = if i >= j { (i, j) } else { (j, i) };
        debug_assert!(column >= self.first[row], "outside the skyline");
        self.start[row] + column - self.first[row]
    }

    /// An entry within the skyline.
    pub(super) fn entry(&self, i: usize, j: usize) -> f64 {
        self.values[self.index(i, j)]
    }

    /// An entry, within the skyline or not.
    pub(crate) fn entry_or_zero(&self, i: usize, j: usize) -> f64 {
        if self.first[i.max(j)] <= i.min(j) { self.entry(i, j) } else { 0.0 }
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
}

/// Products summed up in lanes, so that the compiler does several at once.
#[inline(always)]
pub(super) fn dot(a: &[f64], b: &[f64]) -> f64 {
    const LANES: usize = 8;
    let mut sums = [0.0; LANES];
    let ((a, a_rest), (b, b_rest)) = (a.as_chunks::<LANES>(), b.as_chunks::<LANES>());
    for (a, b) in a.iter().zip(b) {
        sums.iter_mut().zip(a.iter().zip(b)).for_each(|(sum, (a, b))| *sum += a * b);
    }
    a_rest.iter().zip(b_rest).map(|(a, b)| a * b).sum::<f64>() + sums.iter().sum::<f64>()
}

#[cfg(test)]
mod tests {
    use nalgebra::DMatrix;

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
