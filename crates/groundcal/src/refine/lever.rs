//! A camera taken to turn on the spot whose lens is off the axis of turning, before things that are not all far away.
//!
//! ```text
//! x = R q - l / d,      l: the lens from the axis, in camera coordinates, alike in all pictures;  d: distance of the point
//! ```
//!
//! The distances are not known. With one for all of them the score of l / d tells whether the pictures show any parallax, and by how much
//! the camera is wrong for leaving it out; that goes into its error bars.

use nalgebra::DMatrix;

use crate::refine::{
    problem::Problem,
    residual::SceneModel,
    score::{Minimum, Score},
};

/// Deviation of each coordinate of l / d beforehand: 3 mm over a floor 1.5 m below are 0.002, an arm's length in a room 0.2.
const SIGMA: f64 = 0.1;
/// Probability below which parallax is not put down to chance.
const LEVER_P: f64 = 1e-3;

/// Parallax that a camera taken to turn on the spot shows.
#[derive(Debug, Clone, PartialEq)]
pub struct LeverArm {
    /// How far the lens is off the axis, over the distance of the points.
    pub over_distance: f64,
    /// By how much ln f of the first camera is wrong for leaving it out.
    pub moves_ln_f: f64,
    /// By how much the numbers of the first camera are.
    moves: Vec<(usize, f64)>,
}

impl LeverArm {
    /// Of a solution; `None`: it shows none.
    pub(crate) fn of(problem: &Problem, at: Minimum<'_>) -> Option<Self> {
        if problem.scene != SceneModel::Directions {
            return None;
        }
        let score: Score<3> = problem.score(at, SIGMA, &|_, projection, _| -projection.by_camera_point)?;
        if score.chance() >= LEVER_P {
            return None;
        }
        let moves: Vec<(usize, f64)> =
            problem.layout.cameras[0].free().map(|(number, column)| (number, score.moves[column])).collect();
        let moves_ln_f = moves.iter().find(|(number, _)| *number == 0).map_or(0.0, |(_, by)| *by);
        Some(Self { over_distance: score.step.norm(), moves_ln_f, moves })
    }

    /// Adds what leaving it out makes wrong to the covariance of the first camera.
    pub(crate) fn widen(&self, covariance: &mut DMatrix<f64>) {
        for &(row, by_row) in &self.moves {
            for &(column, by_column) in &self.moves {
                covariance[(row, column)] += by_row * by_column;
            }
        }
    }
}
