//! Numbers of a lens that are held until the residuals ask for them: a score (Lagrange multiplier) test.
//!
//! ```text
//! T = δ² / Σ_cc,      δ = -(A⁻¹ g)_c,   Σ = A⁻¹        T ~ χ²(1) where the number is what it is held at
//! ```
//!
//! g and A: gradient and information with the number's column c beside all others, at the solution that holds it; δ is the step that
//! would be made. It costs one linearisation. (Rao 1948; Engle 1984, *Wald, likelihood ratio and Lagrange multiplier tests*.)

use crate::{
    numerics::{
        levenberg_marquardt::{LeastSquares, Linearisation},
        statistics::chi_squared_survival,
    },
    refine::{
        blocks::{MATRIX, State},
        layout::Ingredients,
        problem::Problem,
        tracks::Track,
    },
};

/// Probability below which what a number would explain is not put down to chance. One camera in a thousand that needs no further
/// number gets it all the same, with its prior; that costs a little of the error bar and nothing of the truth.
const RELEASE_P: f64 = 1e-3;

/// The problem with a number more estimated; `None`: the residuals ask for none, or there is none left.
pub(crate) fn released(problem: &Problem, tracks: &[Track], state: &State) -> Option<Problem> {
    (0..state.cameras.len()).find_map(|camera| {
        let on_demand = problem.cameras[camera].lens_on_demand.clone();
        on_demand.into_iter().find_map(|(of_lens, prior)| {
            let mut cameras = problem.cameras.clone();
            let unknowns = &mut cameras[camera];
            unknowns.lens_on_demand.retain(|(number, _)| *number != of_lens);
            unknowns.free_lens(of_lens, None);
            let ingredients = Ingredients {
                scene: problem.scene,
                tracks,
                state,
                cameras: &cameras,
                stray_frames: &problem.stray_frames,
                departures: &problem.departures_estimated,
                huber: problem.huber,
            };
            let mut with = problem.with(&ingredients);
            let column = with.layout.cameras[camera].column(MATRIX + of_lens)?;
            let equations = with.linearise(state)?;
            let step = equations.solve(0.0)?.step[column];
            let variance = equations.information.cholesky(0.0)?.inverse_block(&[column])[(0, 0)];
            let asked_for = chi_squared_survival(step * step / variance, 1) < RELEASE_P;
            with.cameras[camera].free_lens(of_lens, Some(prior));
            asked_for.then_some(with)
        })
    })
}
