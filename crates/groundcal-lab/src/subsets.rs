//! Minimal sets: the camera of every subset of m motions (KZR 3, figures 5 and 6).
//!
//! ```text
//! for each {i₁ < … < i_m} ⊂ {1 … n}:   K of those motions alone, σ(fx) / fx from their covariances
//! ```
//!
//! In the minimal case the equations are met exactly, so that residuals say nothing of the error; the covariance of the circular
//! points does. [`rank_subsets`] orders subsets by it, without truth.

use rayon::prelude::*;

use groundcal::{
    Error, Method,
    pairs::HomographyEstimate,
    start::{Constraint, LinearCamera, closed_form},
};

/// One subset and its camera.
#[derive(Debug, Clone)]
pub struct Subset {
    /// Indices of its motions, ascending.
    pub motions: Vec<usize>,
    /// The camera, or why there is none.
    pub camera: Result<LinearCamera, Error>,
}

impl Subset {
    /// Predicted relative standard deviation of fx; infinite without a camera.
    pub fn predicted_sigma(&self) -> f64 {
        self.camera.as_ref().map_or(f64::INFINITY, |c| c.covariance_px[(0, 0)].max(0.0).sqrt() / c.intrinsics.fx)
    }
}

/// Most subsets that are looked at.
pub const MAX_SUBSETS: u128 = 1_000_000;

/// All subsets of `size` out of `count`, in lexicographic order.
pub fn combinations(count: usize, size: usize) -> impl Iterator<Item = Vec<usize>> {
    let mut next: Option<Vec<usize>> = (size <= count).then(|| (0..size).collect());
    std::iter::from_fn(move || {
        let current = next.take()?;
        let movable = (0..size).rev().find(|&i| current[i] < count - size + i);
        next = movable.map(|i| {
            let mut after = current.clone();
            after[i] += 1;
            for k in i + 1..size {
                after[k] = after[k - 1] + 1;
            }
            after
        });
        Some(current)
    })
}

/// How many they are.
pub fn combinations_count(count: usize, size: usize) -> u128 {
    if size > count {
        return 0;
    }
    (0..size.min(count - size) as u128).fold(1, |product, i| product * (count as u128 - i) / (i + 1))
}

/// The cameras of all subsets of `size` motions, the surest first; those without a camera last.
///
/// # Errors
/// [`Error::InvalidOption`] for a size of zero, beyond the number of motions, or with more than [`MAX_SUBSETS`] subsets.
pub fn rank_subsets(motions: &[HomographyEstimate], constraint: Constraint, size: usize) -> Result<Vec<Subset>, Error> {
    let total = combinations_count(motions.len(), size);
    if size == 0 || total == 0 || total > MAX_SUBSETS {
        return Err(Error::InvalidOption(format!(
            "{total} subsets of {size} out of {} motions: from 1 to {MAX_SUBSETS} are possible",
            motions.len()
        )));
    }
    let all: Vec<Vec<usize>> = combinations(motions.len(), size).collect();
    let mut ranked: Vec<Subset> = all
        .into_par_iter()
        .map(|indices| {
            let chosen: Vec<HomographyEstimate> = indices.iter().map(|&i| motions[i].clone()).collect();
            Subset { camera: closed_form(Method::Linear, &chosen, constraint, 1.0), motions: indices }
        })
        .collect();
    // A stable sort: equals stay in lexicographic order.
    ranked.sort_by(|a, b| a.predicted_sigma().total_cmp(&b.predicted_sigma()));
    Ok(ranked)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rank_correlation::spearman;
    use crate::studies::figure4::{Condition, scene};
    use groundcal::{geometry::Frame, pairs::gold_standard_homography};

    #[test]
    fn combinations_are_all_there_once() {
        let all: Vec<Vec<usize>> = combinations(5, 3).collect();
        assert_eq!(all.len(), 10);
        assert_eq!((all[0].as_slice(), all[9].as_slice()), (&[0, 1, 2][..], &[2, 3, 4][..]));
        assert!(all.windows(2).all(|w| w[0] < w[1]));
        assert_eq!((combinations(3, 4).count(), combinations(4, 4).count(), combinations(4, 0).count()), (0, 1, 1));
        assert_eq!((combinations_count(14, 3), combinations_count(60, 30)), (364, 118_264_581_564_861_424));
    }

    #[test]
    fn predicted_errors_are_those_that_come_true() {
        let condition = Condition { motions: 10, ..Condition::default() };
        let (mut normalised, mut correlation) = (Vec::new(), 0.0);
        let scenes = 12;
        for number in 0..scenes {
            let scene = scene(&condition, 3, number);
            let frame = Frame::new(scene.size, None);
            let fit = |matches: &[_]| gold_standard_homography(matches, &frame).expect("a homography");
            let motions: Vec<HomographyEstimate> = scene.pairs().iter().map(|p| fit(&p.matches)).collect();
            let ranked = rank_subsets(&motions, Constraint::ZeroSkew, 3).expect("few enough");
            assert_eq!(ranked.len(), 120);
            assert!(ranked.windows(2).all(|w| w[0].predicted_sigma() <= w[1].predicted_sigma()));
            let fx = scene.intrinsics.fx;
            let found =
                ranked.iter().filter_map(|s| Some((s.predicted_sigma(), s.camera.as_ref().ok()?.intrinsics.fx)));
            let (predicted, errors): (Vec<f64>, Vec<f64>) = found.map(|(p, f)| (p, (f / fx - 1.0).abs())).unzip();
            correlation += spearman(&predicted, &errors) / scenes as f64;
            normalised.extend(errors.iter().zip(&predicted).map(|(e, p)| e / p));
        }
        // Subsets of one scene share motions: the errors of a dozen scenes are a dozen draws or a little more.
        let within = normalised.iter().filter(|z| **z < 2.0).count() as f64 / normalised.len() as f64;
        assert!(within > 0.85, "{within}");
        assert!(correlation > 0.2, "{correlation}");
        assert!(rank_subsets(&[], Constraint::ZeroSkew, 3).is_err());
    }
}
