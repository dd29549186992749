//! Random effects of parts of a scene that the cameras alone connect, as motions of attitudes of their own are.
//!
//! ```text
//! A(w) = [ O   X    Y     ]      Q = E - Xᵀ O⁻¹ X = V Λ Vᵀ      F = (Z - Yᵀ O⁻¹ X) V      C' = C - Σ Yᵀ O⁻¹ Y       of each part
//!        [ Xᵀ  E+w  Zᵀ    ]
//!        [ Yᵀ  Z    C     ]      S = C' - Σ F (Λ + w)⁻¹ Fᵀ       ln |A| = Σ ln |O| + Σ ln |Λ + w| + ln |S|
//!
//! gᵀ A⁻¹ g = Σ s' (Λ + w)⁻¹ s' + hᵀ S⁻¹ h,        h = Σ F (Λ + w)⁻¹ s',      s' = Vᵀ s          g = s in the columns of effects, else 0
//! ```
//!
//! E: effects; C: cameras; O: all else of the part; w: inverse variance of the effects. With Λ and F known, another w costs a few products a motion.

use std::ops::Range;

use nalgebra::{DMatrix, DVector};

use crate::{
    numerics::{linalg::symmetric_eigen, skyline::Skyline},
    refine::problem::RandomEffect,
};

/// Effects of a part up to which its eigenvalues are worth their cube.
const MAX_EFFECTS: usize = 50;

/// gᵀ A⁻¹ g and ln |A|.
#[derive(Debug, Clone, Copy)]
pub(super) struct Solved {
    pub(super) explained: f64,
    pub(super) log_determinant: f64,
}

/// The effects of all parts.
pub(super) struct EffectsByParts {
    parts: Vec<Part>,
    /// Information of the cameras with all but the effects eliminated.
    cameras: DMatrix<f64>,
    /// Σ ln |O|.
    log_determinant: f64,
}

struct Part {
    /// Λ.
    eigenvalues: DVector<f64>,
    /// s' for a change of one.
    right: DVector<f64>,
    /// F.
    with_cameras: DMatrix<f64>,
}

impl EffectsByParts {
    /// `None` where a part has many effects, or is not determined by what is no effect.
    pub(super) fn new(effects: &[RandomEffect], information: &Skyline, first_of_cameras: usize) -> Option<Self> {
        let cameras: Vec<usize> = (first_of_cameras..information.size()).collect();
        let block = |rows: &[usize], columns: &[usize]| {
            DMatrix::from_fn(rows.len(), columns.len(), |r, c| information.entry_or_zero(rows[r], columns[c]))
        };
        let mut of_columns: Vec<Option<&RandomEffect>> = vec![None; first_of_cameras];
        for effect in effects {
            *of_columns.get_mut(effect.column)? = Some(effect);
        }
        let mut all = Self { parts: Vec::new(), cameras: block(&cameras, &cameras), log_determinant: 0.0 };
        for columns in parts_of(information, first_of_cameras) {
            let (own, others): (Vec<usize>, Vec<usize>) = columns.partition(|&column| of_columns[column].is_some());
            if own.len() > MAX_EFFECTS {
                return None;
            }
            let of_others = block(&others, &others).cholesky()?;
            all.log_determinant += 2.0 * of_others.l_dirty().diagonal().iter().map(|l| l.ln()).sum::<f64>();
            let mut beside = DMatrix::zeros(others.len(), own.len() + cameras.len());
            beside.columns_mut(0, own.len()).copy_from(&block(&others, &own));
            beside.columns_mut(own.len(), cameras.len()).copy_from(&block(&others, &cameras));
            // Lᵀ L = O, so that products of L⁻ᵀ with what stands beside it are what the elimination takes away.
            of_others.l_dirty().solve_lower_triangular_mut(&mut beside).then_some(())?;
            let (of_own, of_cameras) = (beside.columns(0, own.len()), beside.columns(own.len(), cameras.len()));
            all.cameras -= of_cameras.tr_mul(&of_cameras);
            if own.is_empty() {
                continue;
            }
            let left = block(&own, &own) - of_own.tr_mul(&of_own);
            let (eigenvalues, vectors) = symmetric_eigen(&((&left + left.transpose()) * 0.5))?;
            let with_cameras = (block(&cameras, &own) - of_cameras.tr_mul(&of_own)) * &vectors;
            let value = |&column: &usize| of_columns[column].map_or(0.0, |e| e.sign * e.value);
            let right = vectors.tr_mul(&DVector::from_iterator(own.len(), own.iter().map(value)));
            all.parts.push(Part { eigenvalues, right, with_cameras });
        }
        Some(all)
    }

    /// With an inverse variance of the effects, g being `change` times what they are worth.
    pub(super) fn solved(&self, weight: f64, change: f64) -> Option<Solved> {
        let mut cameras = self.cameras.clone();
        let mut of_cameras = DVector::zeros(cameras.nrows());
        let (mut log_determinant, mut explained) = (self.log_determinant, 0.0);
        for part in &self.parts {
            for (k, (value, right)) in part.eigenvalues.iter().zip(&part.right).enumerate() {
                let information = value + weight;
                if information.is_nan() || information <= 0.0 {
                    return None;
                }
                log_determinant += information.ln();
                explained += right * right / information;
                let with = part.with_cameras.column(k);
                cameras.ger(-1.0 / information, &with, &with, 1.0);
                of_cameras.axpy(right / information, &with, 1.0);
            }
        }
        if cameras.is_empty() {
            return Some(Solved { explained: explained * change * change, log_determinant });
        }
        let factor = cameras.cholesky()?;
        log_determinant += 2.0 * factor.l_dirty().diagonal().iter().map(|l| l.ln()).sum::<f64>();
        explained += of_cameras.dot(&factor.solve(&of_cameras));
        Some(Solved { explained: explained * change * change, log_determinant })
    }
}

/// Columns before those of the cameras, in parts that have no entry in common.
fn parts_of(information: &Skyline, first_of_cameras: usize) -> Vec<Range<usize>> {
    let mut parts = Vec::new();
    let (mut end, mut reach) = (first_of_cameras, first_of_cameras);
    for row in (0..first_of_cameras).rev() {
        reach = reach.min(information.first(row));
        if reach == row {
            parts.push(row..end);
            (end, reach) = (row, row);
        }
    }
    parts.reverse();
    parts
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_part_of_many_effects_is_left_to_the_whole() {
        let size = MAX_EFFECTS + 3;
        let mut information = Skyline::zeros(vec![0; size]);
        (0..size).for_each(|i| information.add(i, i, 1.0));
        let effects: Vec<RandomEffect> =
            (0..=MAX_EFFECTS).map(|column| RandomEffect { column, sign: 1.0, value: 0.0 }).collect();
        assert!(EffectsByParts::new(&effects, &information, size - 2).is_none());
        assert!(EffectsByParts::new(&effects[1..], &information, size - 2).is_some());
    }

    #[test]
    fn parts_are_what_the_cameras_alone_connect() {
        let information = Skyline::zeros(vec![0, 0, 0, 0, 4, 5, 4, 4, 8, 8, 9, 8, 12, 0, 0]);
        assert_eq!(parts_of(&information, 13), [0..4, 4..8, 8..12, 12..13]);
    }
}
