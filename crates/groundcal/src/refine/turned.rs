//! Pictures that were turned by 180 degrees before they came here, among others that were not.
//!
//! ```text
//! p_i = σ_i m,   σ_i = ±1        Q(σ, m) = (p - p̂)ᵀ Λ (p - p̂) + (m - m₀)ᵀ (m - m₀) / s²
//! gain = min Q(1, m) - min Q(σ, m) - 2 ln C(n, k)
//! ```
//!
//! p_i: the principal point of picture i as it lies here, from the picture's middle, m: that of the pictures that were not turned, with its prior; p̂ and Λ: estimate
//! and information of all p_i, each picture having its own, from the problem linearised once where it was minimised with one for
//! all. k of n pictures are turned, and any k might be. The signs are searched for: from those that each picture's p̂ gives it, one is changed after the other, or
//! those of a whole group, while that makes Q less.

use nalgebra::{DMatrix, DVector, Matrix2, Vector2};

use crate::{
    numerics::{
        levenberg_marquardt::{LeastSquares, Linearisation},
        linalg::inverse_spd,
    },
    refine::{
        blocks::{BundleOptions, DepartureKind},
        bundle::{Bundle, FIRST_CAMERA},
        layout::ProblemInputs,
        problem::Problem,
        prospect::Prospect,
        tracks::Track,
    },
};

/// Places of the principal point among the numbers of a camera.
const PRINCIPAL_POINT: [usize; 2] = [2, 3];
/// Pictures up to which it is asked: of a film none is turned, and the work is that of a dense matrix.
const MAX_TURNED_VIEWS: usize = 64;
/// Standard deviation beforehand of a picture's own principal point, frame units: none.
const FREE_SHIFT_SIGMA: f64 = 10.0;
/// Pictures whose principal points the search begins from.
const MAX_STARTS: usize = 16;

/// The principal points of all pictures, each on its own.
struct OwnPrincipalPoints {
    /// One column for each coordinate: as it is estimated, frame units.
    estimates: DVector<f64>,
    information: DMatrix<f64>,
    /// Mean and variance beforehand of that of all, by coordinate.
    prior: [(f64, f64); 2],
}

/// Signs, and the principal point under them.
struct Signed {
    signs: Vec<f64>,
    cost: f64,
    principal_point: Vector2<f64>,
    covariance: Matrix2<f64>,
}

impl OwnPrincipalPoints {
    /// The least Q under signs.
    fn under(&self, signs: Vec<f64>) -> Option<Signed> {
        let design = self.design(&signs);
        let weighted = &self.information * &design;
        let [(x, x_variance), (y, y_variance)] = self.prior;
        let (mean, weight) = (Vector2::new(x, y), Matrix2::new(1.0 / x_variance, 0.0, 0.0, 1.0 / y_variance));
        let equations: Matrix2<f64> = Matrix2::from_fn(|r, c| design.column(r).dot(&weighted.column(c))) + weight;
        let covariance = equations.try_inverse()?;
        let right = Vector2::from_fn(|r, _| weighted.column(r).dot(&self.estimates)) + weight * mean;
        let principal_point = covariance * right;
        let residual = &self.estimates - design * principal_point;
        let from_mean = principal_point - mean;
        let cost = residual.dot(&(&self.information * &residual)) + from_mean.dot(&(weight * from_mean));
        Some(Signed { signs, cost, principal_point, covariance })
    }

    /// Derivatives of the pictures' principal points by that of all.
    fn design(&self, signs: &[f64]) -> DMatrix<f64> {
        DMatrix::from_fn(2 * signs.len(), 2, |row, c| if row % 2 == c { signs[row / 2] } else { 0.0 })
    }

    /// The signs of the least Q that the search comes to; `together`: the pictures of each group.
    fn best(&self, together: &[Vec<usize>]) -> Option<Signed> {
        let count = self.estimates.len() / 2;
        let of = |i: usize| Vector2::new(self.estimates[2 * i], self.estimates[2 * i + 1]);
        let starts = (0..count.min(MAX_STARTS)).map(|k| {
            let like = of(k);
            (0..count).map(|i| if of(i).dot(&like) < 0.0 { -1.0 } else { 1.0 }).collect()
        });
        let singles = (0..count).map(|i| vec![i]);
        let changes: Vec<Vec<usize>> = singles.chain(together.iter().cloned()).collect();
        let found = starts.filter_map(|signs| {
            let mut best = self.under(signs)?;
            for _ in 0..count {
                let changed = |change: &Vec<usize>| {
                    let mut signs = best.signs.clone();
                    change.iter().for_each(|&i| signs[i] = -signs[i]);
                    self.under(signs)
                };
                let next = changes.iter().filter_map(changed).min_by(|a, b| a.cost.total_cmp(&b.cost))?;
                if next.cost >= best.cost {
                    break;
                }
                best = next;
            }
            Some(best)
        });
        found.min_by(|a, b| a.cost.total_cmp(&b.cost))
    }
}

/// What it promises that some pictures are turned; `None` where that is not defined, or none is.
pub(crate) fn some_turned(bundle: &Bundle, tracks: &[Track], options: &BundleOptions) -> Option<Prospect> {
    let (problem, state) = (&bundle.problem, &bundle.state);
    let unknowns = options.cameras.first()?;
    let estimated = PRINCIPAL_POINT.iter().all(|&number| unknowns.is_free(number));
    let (frames, groups): (Vec<usize>, Vec<usize>) =
        (0..state.frames.len()).filter(|f| bundle.views[*f].is_some()).map(|f| (f, state.frames[f].group)).unzip();
    let shifted = options.departures.contains(&DepartureKind::Shift);
    if !estimated || shifted || state.cameras.len() > 1 || !(3..=MAX_TURNED_VIEWS).contains(&frames.len()) {
        return None;
    }
    let mut with_shifts = options.clone();
    with_shifts.departures.push(DepartureKind::Shift);
    PRINCIPAL_POINT.iter().for_each(|&number| with_shifts.cameras[FIRST_CAMERA].set_free(number, false));
    let mut other = problem.with(&ProblemInputs {
        scene: problem.scene,
        tracks,
        state,
        cameras: &with_shifts.cameras,
        outlier_frames: &options.outlier_frames,
        departures: &with_shifts.departures,
        huber: problem.huber,
    });
    other.departure_sigmas[DepartureKind::Shift as usize] = FREE_SHIFT_SIGMA;
    own_principal_points(&other, bundle, options, &frames, &groups)
}

/// The same from the problem in which each picture is shifted on its own, and nothing else is the principal point.
fn own_principal_points(
    other: &Problem,
    bundle: &Bundle,
    options: &BundleOptions,
    frames: &[usize],
    groups: &[usize],
) -> Option<Prospect> {
    let (state, count) = (&bundle.state, frames.len());
    let linearised = other.linearise(state)?;
    let step = linearised.solve(0.0)?.step;
    let factor = linearised.information.cholesky(0.0)?;
    let columns_of =
        |&f: &usize| DepartureKind::Shift.numbers().map(move |number| other.layout.frames[f].column(number));
    let shifts: Vec<usize> = frames.iter().flat_map(columns_of).collect::<Option<_>>()?;
    let camera = other.layout.cameras[FIRST_CAMERA].columns();
    let free: Vec<usize> = camera.iter().copied().flatten().collect();
    let all: Vec<usize> = shifts.iter().chain(&free).copied().collect();
    let inverse = factor.inverse_block(&all);
    let of_shifts = inverse.view((0, 0), (2 * count, 2 * count)).into_owned();
    let here = state.cameras[FIRST_CAMERA].numbers();
    let prior = PRINCIPAL_POINT.map(|number| {
        let (mean, sigma) = options.cameras[FIRST_CAMERA].prior(number).unwrap_or((0.0, FREE_SHIFT_SIGMA));
        (mean, sigma * sigma)
    });
    let own = OwnPrincipalPoints {
        estimates: DVector::from_fn(2 * count, |row, _| here[PRINCIPAL_POINT[row % 2]] + step[shifts[row]]),
        information: inverse_spd(&of_shifts)?,
        prior,
    };
    let members = |group: &usize| (0..count).filter(|&i| groups[i] == *group).collect::<Vec<usize>>();
    let mut distinct = groups.to_vec();
    distinct.sort_unstable();
    distinct.dedup();
    let together: Vec<Vec<usize>> = distinct.iter().map(members).filter(|members| members.len() > 1).collect();
    let (none, mut best) = (own.under(vec![1.0; count])?, own.best(&together)?);
    let turned = best.signs.iter().filter(|sign| **sign < 0.0).count();
    // All turned is none turned: the fewer are.
    let is_majority = 2 * turned > count;
    if is_majority {
        best.signs.iter_mut().for_each(|sign| *sign = -*sign);
        best.principal_point = -best.principal_point;
    }
    let turned = if is_majority { count - turned } else { turned };
    if turned == 0 {
        return None;
    }
    // The camera's other numbers follow the principal points.
    let along = inverse.view((2 * count, 0), (free.len(), 2 * count)) * &own.information;
    let design = own.design(&best.signs);
    let follow = &along * (&design * best.principal_point - &own.estimates);
    let by_point = &along * design;
    let of_free = inverse.view((2 * count, 2 * count), (free.len(), free.len()));
    let given = of_free - &along * inverse.view((0, 2 * count), (2 * count, free.len()))
        + &by_point * best.covariance * by_point.transpose();
    let with_point = by_point * best.covariance;
    let place = |number: usize| camera[number].and_then(|c| free.iter().position(|f| *f == c));
    let of_point = |number: usize| PRINCIPAL_POINT.iter().position(|p| *p == number);
    let numbers = camera.len();
    let moved = DVector::from_fn(numbers, |number, _| match (of_point(number), place(number)) {
        (Some(axis), _) => best.principal_point[axis] - here[number],
        (None, Some(at)) => step[free[at]] + follow[at],
        (None, None) => 0.0,
    });
    let covariance = DMatrix::from_fn(numbers, numbers, |r, c| match (of_point(r), of_point(c), place(r), place(c)) {
        (Some(a), Some(b), ..) => best.covariance[(a, b)],
        (Some(a), None, _, Some(at)) | (None, Some(a), Some(at), _) => with_point[(at, a)],
        (None, None, Some(a), Some(b)) => given[(a, b)],
        _ => 0.0,
    });
    let gain = none.cost - best.cost - 2.0 * ln_choices(count, turned);
    gain.is_finite().then_some(Prospect { gain, step: moved, covariance })
}

/// Logarithm of the ways to choose some of a number.
fn ln_choices(of: usize, some: usize) -> f64 {
    (0..some).map(|i| ((of - i) as f64 / (i + 1) as f64).ln()).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ways_to_choose_are_counted() {
        assert!((ln_choices(12, 3).exp() - 220.0).abs() < 1e-9);
        assert!(ln_choices(5, 0).abs() < 1e-15);
    }

    /// Pictures with principal points of their own, of which two are turned: found, where they are known well.
    #[test]
    fn the_pictures_turned_are_found() {
        let truth = [0.02, -0.05];
        let turned = [1, 4];
        let sign = |i: usize| if turned.contains(&i) { -1.0 } else { 1.0 };
        let estimates = DVector::from_fn(12, |row, _| sign(row / 2) * truth[row % 2] + 0.003 * (row as f64).sin());
        let information = DMatrix::from_diagonal_element(12, 12, 1e4);
        let own = OwnPrincipalPoints { estimates, information, prior: [(0.0, 0.01); 2] };
        let best = own.best(&[]).expect("signs");
        let none = own.under(vec![1.0; 6]).expect("a principal point");
        let flip = best.signs[0];
        let found: Vec<usize> = (0..6).filter(|&i| best.signs[i] * flip < 0.0).collect();
        assert_eq!(found, turned);
        assert!((best.principal_point * flip - Vector2::from(truth)).norm() < 0.005, "{}", best.principal_point);
        assert!(none.cost - best.cost > 100.0, "{} {}", none.cost, best.cost);
    }
}
