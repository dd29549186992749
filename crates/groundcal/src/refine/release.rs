//! Numbers of a lens that are held until the residuals ask for them: a score test ([`Problem::score`]).

use crate::refine::{blocks::MATRIX, layout::ProblemInputs, problem::Problem, score::Minimum, tracks::Track};

/// Probability below which what a number would explain is not put down to chance. One camera in a thousand that needs no further
/// number gets it all the same, with its prior; that costs a little of the error bar and nothing of the truth.
const RELEASE_P: f64 = 1e-3;

/// The problem with a number more estimated; `None`: the residuals ask for none, or there is none left.
pub(crate) fn released(problem: &Problem, tracks: &[Track], at: Minimum<'_>) -> Option<Problem> {
    let state = at.state;
    let asked_for = |camera: usize, of_lens: usize| {
        let number = MATRIX + of_lens;
        // A lens that has no such number has no use for it.
        let score = (number < state.cameras[camera].count()).then(|| {
            problem.score::<1>(at, f64::INFINITY, &|image, projection| {
                let by = projection.by_camera.column(number);
                if image.1 == camera { by.into_owned() } else { by * 0.0 }
            })
        });
        score.flatten().is_some_and(|score| score.chance() < RELEASE_P)
    };
    let (camera, of_lens, prior) = (0..state.cameras.len()).find_map(|camera| {
        let on_demand = problem.cameras[camera].lens_on_demand.iter();
        on_demand
            .copied()
            .find(|&(of_lens, _)| asked_for(camera, of_lens))
            .map(|(of_lens, prior)| (camera, of_lens, prior))
    })?;
    let mut cameras = problem.cameras.clone();
    cameras[camera].lens_on_demand.retain(|(number, _)| *number != of_lens);
    cameras[camera].free_lens(of_lens, Some(prior));
    Some(problem.with(&ProblemInputs {
        scene: problem.scene,
        tracks,
        state,
        cameras: &cameras,
        outlier_frames: &problem.outlier_frames,
        departures: &problem.departures_estimated,
        huber: problem.huber,
    }))
}
