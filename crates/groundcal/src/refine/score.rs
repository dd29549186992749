//! A number that the model leaves out: what it would be, how well that is known, and what all others would be with it.
//!
//! ```text
//! a = Jᵀ M c,   d = cᵀ M c,   g = cᵀ M r,      M = I - P (Pᵀ P)⁻¹ Pᵀ
//! S = d - aᵀ A⁻¹ a,      δ = -(g - aᵀ A⁻¹ ∇) / S,      T = δ² S ~ χ²(1) where the number is what it is held at
//! ```
//!
//! c: derivative of the observations by the number; J: by the columns; P: by the point of each track; A and ∇: information and gradient
//! of the columns at the solution. The number takes no column, and nothing is solved again: a score (Lagrange multiplier) test (Rao
//! 1948; Engle 1984, *Wald, likelihood ratio and Lagrange multiplier tests*).

use nalgebra::{DVector, Vector2};
use rayon::prelude::*;

use crate::{
    numerics::{skyline::SkylineCholesky, statistics::chi_squared_survival},
    refine::{
        blocks::State,
        elimination::TrackRows,
        layout::Cluster,
        problem::{Problem, Seen},
        residual::Projection,
    },
};

/// A number left out, as the residuals have it.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Score {
    /// What it would be, from what it is held at.
    pub(crate) step: f64,
    /// Its variance.
    pub(crate) variance: f64,
}

impl Score {
    /// Probability of as large a step where the number is what it is held at.
    pub(crate) fn chance(&self) -> f64 {
        chi_squared_survival(self.step * self.step / self.variance, 1)
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

/// Derivative of an observation by the number: of (frame, camera), its projection and what was seen there.
pub(crate) type ByNumber<'a> = dyn Fn((usize, usize), &Projection, &Seen) -> Vector2<f64> + Sync + 'a;

/// A cluster's part of the products with the derivative by the number.
struct Products {
    with_columns: Vec<f64>,
    with_itself: f64,
    with_residuals: f64,
}

impl Products {
    fn of(columns: usize) -> Self {
        Self { with_columns: vec![0.0; columns], with_itself: 0.0, with_residuals: 0.0 }
    }

    /// Adds those of a track: its rows, and the derivative by the number in each of them. `None` when the point is not determined.
    fn add(&mut self, rows: &TrackRows, cluster: &Cluster, by_number: &mut [f64]) -> Option<()> {
        let along_first = rows.by_point(0);
        let first_norm = along_first.clone().map(|p| p * p).sum::<f64>();
        let common = along_first.clone().zip(rows.by_point(1)).map(|(p, q)| p * q).sum::<f64>() / first_norm;
        // Two orthogonal directions that the point takes up (Gram and Schmidt).
        let second = along_first.clone().zip(rows.by_point(1)).map(|(p, q)| q - common * p);
        let second_norm = second.clone().map(|q| q * q).sum::<f64>();
        if !(first_norm > 0.0 && second_norm > 0.0) {
            return None;
        }
        let along =
            |direction: &mut dyn Iterator<Item = f64>, by: &[f64]| direction.zip(by).map(|(d, c)| d * c).sum::<f64>();
        let of_first = along(&mut along_first.clone(), by_number) / first_norm;
        let of_second = along(&mut second.clone(), by_number) / second_norm;
        for ((c, p), q) in by_number.iter_mut().zip(along_first).zip(second) {
            *c -= of_first * p + of_second * q;
        }
        for (o, (c, places)) in by_number.as_chunks::<2>().0.iter().zip(&cluster.places).enumerate() {
            let [x, y] = rows.observation(o);
            for &place in &places.occupied {
                self.with_columns[place] += c[0] * x[place] + c[1] * y[place];
            }
            let [rx, ry] = rows.residual(o);
            self.with_residuals += c[0] * rx + c[1] * ry;
            self.with_itself += c[0] * c[0] + c[1] * c[1];
        }
        Some(())
    }
}

impl Problem {
    /// The score of a number that has no column. `None` where the residuals do not depend on it beside the others.
    pub(crate) fn score(&self, at: Minimum<'_>, by_number: &ByNumber<'_>) -> Option<Score> {
        let Minimum { state, factor, gradient } = at;
        let views = self.views(state);
        let of_chunk = |(cluster, tracks): &(usize, &[usize])| {
            let c = &self.clusters[*cluster];
            let mut products = Products::of(c.columns.len());
            let mut rows = TrackRows::new(c);
            let mut derivatives = vec![0.0; 2 * c.images.len()];
            for &t in *tracks {
                self.linearise_track((c, t), state, &views, &mut rows, |o, projection, seen, root| {
                    let by = by_number(c.images[o], projection, seen);
                    (derivatives[2 * o], derivatives[2 * o + 1]) = (root[0] * by.x + root[1] * by.y, root[2] * by.y);
                })?;
                products.add(&rows, c, &mut derivatives)?;
            }
            Some(products)
        };
        let chunks = self.chunks();
        let parts: Vec<Option<Products>> = chunks.par_iter().map(of_chunk).collect();
        let mut with_columns = DVector::zeros(self.layout.size);
        let (mut with_itself, mut with_residuals) = (0.0, 0.0);
        for ((cluster, _), part) in chunks.iter().zip(parts) {
            let part = part?;
            with_itself += part.with_itself;
            with_residuals += part.with_residuals;
            self.clusters[*cluster]
                .columns
                .iter()
                .zip(part.with_columns)
                .for_each(|(&c, value)| with_columns[c] += value);
        }
        let explained = factor.solve(&with_columns);
        let information = with_itself - with_columns.dot(&explained);
        let step = -(with_residuals - explained.dot(gradient)) / information;
        let score = Score { step, variance: 1.0 / information };
        (score.variance > 0.0 && score.variance.is_finite() && score.step.is_finite()).then_some(score)
    }
}
