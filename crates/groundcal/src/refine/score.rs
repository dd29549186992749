//! Numbers that the model leaves out: what they would be, how well that is known, and what all others would be with them.
//!
//! ```text
//! B = Jᵀ M C,   D = Cᵀ M C,   g = Cᵀ M r,      M = I - P (Pᵀ P)⁻¹ Pᵀ
//! S = D + Λ - Bᵀ A⁻¹ B,   δ = -S⁻¹ (g - Bᵀ A⁻¹ ∇),   T = δᵀ S δ ~ χ²(m) where the numbers are what they are held at
//! and the columns move by -A⁻¹ B δ
//! ```
//!
//! C: derivatives of the observations by the m numbers; J: by the columns; P: by the point of each track; A and ∇: information and gradient of
//! the columns at the solution; Λ: information of the numbers' priors, with which T is a little small. The numbers take no column, and
//! nothing is solved again: a score (Lagrange multiplier) test (Rao 1948; Engle 1984, *Wald, likelihood ratio and Lagrange multiplier tests*).

use nalgebra::{DMatrix, DVector, SMatrix, SVector};
use rayon::prelude::*;

use crate::{
    numerics::{skyline_cholesky::SkylineCholesky, statistics::chi_squared_survival},
    refine::{blocks::State, elimination::TrackRows, layout::Cluster, problem::Problem, residual::Projection},
};

/// Numbers left out, as the residuals have them.
#[derive(Debug, Clone)]
pub(crate) struct Score<const NUMBERS: usize> {
    /// What they would be, from what they are held at.
    pub(crate) step: SVector<f64, NUMBERS>,
    /// Their covariance.
    pub(crate) covariance: SMatrix<f64, NUMBERS, NUMBERS>,
    /// T: the fall of -2 ln likelihood with them.
    pub(crate) statistic: f64,
    /// By how much each column moves with each of them, were they not what they are held at: -A⁻¹ B.
    pub(crate) moved_by: DMatrix<f64>,
}

impl<const NUMBERS: usize> Score<NUMBERS> {
    /// Probability of as large a step where the numbers are what they are held at.
    pub(crate) fn chance(&self) -> f64 {
        chi_squared_survival(self.statistic, NUMBERS)
    }
}

/// Where a problem has been minimised.
#[derive(Clone, Copy)]
pub(crate) struct Minimum<'a> {
    pub(crate) state: &'a State,
    /// Of the information there.
    pub(crate) factor: &'a SkylineCholesky,
    pub(crate) gradient: &'a DVector<f64>,
}

/// Derivatives of an observation by the numbers: of (frame, camera), and its projection.
pub(crate) type ByNumbers<'a, const NUMBERS: usize> =
    dyn Fn((usize, usize), &Projection) -> SMatrix<f64, 2, NUMBERS> + Sync + 'a;

/// A cluster's part of the products with the derivatives by the numbers.
struct Products<const NUMBERS: usize> {
    with_columns: Vec<SVector<f64, NUMBERS>>,
    with_themselves: SMatrix<f64, NUMBERS, NUMBERS>,
    with_residuals: SVector<f64, NUMBERS>,
}

impl<const NUMBERS: usize> Products<NUMBERS> {
    fn of(columns: usize) -> Self {
        Self {
            with_columns: vec![SVector::zeros(); columns],
            with_themselves: SMatrix::zeros(),
            with_residuals: SVector::zeros(),
        }
    }

    /// Adds those of a track: its rows, and the derivatives by the numbers in each of them. `None` when the point is not determined.
    fn add(&mut self, rows: &TrackRows, cluster: &Cluster, by_numbers: &mut [SVector<f64, NUMBERS>]) -> Option<()> {
        without_point(rows, by_numbers)?;
        for (o, ([cx, cy], places)) in by_numbers.as_chunks::<2>().0.iter().zip(&cluster.places).enumerate() {
            let [x, y] = rows.observation(o);
            for &place in &places.occupied {
                self.with_columns[place] += cx * x[place] + cy * y[place];
            }
            let [rx, ry] = rows.residual(o);
            self.with_residuals += cx * rx + cy * ry;
            self.with_themselves += cx * cx.transpose() + cy * cy.transpose();
        }
        Some(())
    }
}

/// Takes the direction of a track's point out of derivatives of its rows. `None` when the point is not determined.
pub(crate) fn without_point<const NUMBERS: usize>(
    rows: &TrackRows,
    by_numbers: &mut [SVector<f64, NUMBERS>],
) -> Option<()> {
    let [p, q] = [0, 1].map(|coordinate| rows.by_point(coordinate));
    let p_norm = p.clone().map(|p| p * p).sum::<f64>();
    let common = p.clone().zip(q.clone()).map(|(p, q)| p * q).sum::<f64>() / p_norm;
    // Two orthogonal directions that the point takes up (Gram and Schmidt).
    let q = p.clone().zip(q).map(|(p, q)| q - common * p);
    let q_norm = q.clone().map(|q| q * q).sum::<f64>();
    if !(p_norm > 0.0 && q_norm > 0.0) {
        return None;
    }
    let (mut of_p, mut of_q) = (SVector::<f64, NUMBERS>::zeros(), SVector::<f64, NUMBERS>::zeros());
    for ((c, p), q) in by_numbers.iter().zip(p.clone()).zip(q.clone()) {
        of_p += c * (p / p_norm);
        of_q += c * (q / q_norm);
    }
    for ((c, p), q) in by_numbers.iter_mut().zip(p).zip(q) {
        *c -= of_p * p + of_q * q;
    }
    Some(())
}

impl Problem {
    /// The score of numbers that have no columns, with the standard deviation that each has beforehand (infinite: none). `None` where the
    /// residuals do not depend on them beside the others.
    pub(crate) fn score<const NUMBERS: usize>(
        &self,
        at: Minimum<'_>,
        sigma: f64,
        by_numbers: &ByNumbers<'_, NUMBERS>,
    ) -> Option<Score<NUMBERS>> {
        let (with_columns, products) = self.products(at.state, by_numbers)?;
        let mut information = products.with_themselves + SMatrix::identity() / (sigma * sigma);
        let mut right = products.with_residuals;
        let mut moved_by = DMatrix::zeros(self.layout.size, NUMBERS);
        for number in 0..NUMBERS {
            let explained = at.factor.solve(&with_columns.column(number).into_owned());
            right[number] -= explained.dot(at.gradient);
            for other in 0..NUMBERS {
                information[(other, number)] -= with_columns.column(other).dot(&explained);
            }
            moved_by.set_column(number, &-explained);
        }
        let covariance = information.try_inverse()?;
        let step = -(covariance * right);
        let statistic = step.dot(&(information * step));
        (statistic >= 0.0 && statistic.is_finite()).then_some(Score { step, covariance, statistic, moved_by })
    }

    /// B, and the products that have no columns.
    fn products<const NUMBERS: usize>(
        &self,
        state: &State,
        by_numbers: &ByNumbers<'_, NUMBERS>,
    ) -> Option<(DMatrix<f64>, Products<NUMBERS>)> {
        let views = self.views(state);
        let of_chunk = |(cluster, tracks): &(usize, &[usize])| {
            let c = &self.clusters[*cluster];
            let mut products = Products::of(c.columns.len());
            let mut rows = TrackRows::new(c);
            let mut derivatives = vec![SVector::zeros(); 2 * c.images.len()];
            for &t in *tracks {
                self.linearise_track((c, t), state, &views, &mut rows, |o, projection, root| {
                    let by = by_numbers(c.images[o], projection);
                    derivatives[2 * o] = (by.row(0) * root[0] + by.row(1) * root[1]).transpose();
                    derivatives[2 * o + 1] = (by.row(1) * root[2]).transpose();
                })?;
                products.add(&rows, c, &mut derivatives)?;
            }
            Some(products)
        };
        let chunks = self.chunks();
        let parts: Vec<Option<Products<NUMBERS>>> = chunks.par_iter().map(of_chunk).collect();
        let mut with_columns = DMatrix::zeros(self.layout.size, NUMBERS);
        let mut all = Products::of(0);
        for ((cluster, _), part) in chunks.iter().zip(parts) {
            let part = part?;
            all.with_themselves += part.with_themselves;
            all.with_residuals += part.with_residuals;
            for (&column, value) in self.clusters[*cluster].columns.iter().zip(&part.with_columns) {
                let mut row = with_columns.row_mut(column);
                row += value.transpose();
            }
        }
        Some((with_columns, all))
    }
}
