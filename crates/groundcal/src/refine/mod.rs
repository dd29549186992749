//! Joint refinement of camera, lens, attitudes, views and points: planar bundle adjustment.
//!
//! ```text
//! minimise   Σ_tracks Σ_views ρ( |x_vt - π(K, k, A_g, δ_v, ψ_v, c_v, q_t)|²_Λ )
//!          + Σ_v |δ_v|² / σ_a²  +  Σ_v (ln h_v - ln h_g)² / σ_h²  +  Σ_i (p_i - p̄_i)² / σ_i²
//! ```
//!
//! with π of [`model`], Huber's ρ, Λ the inverse covariance of an observation. σ_a, how far each view's attitude strays from that
//! of its group, and σ_h, how far its height does, are variance components: 0 for exact plane-normal motion at constant height
//! (KZR's model), infinite for general motion (Triggs 1998); where nothing is said of them they are estimated by restricted
//! likelihood. The points are eliminated ([`problem`]); what is left is sparse ([`skyline`]).

pub mod layout;
pub mod model;
pub mod poses;
pub mod problem;
pub mod start;
pub mod tracks;

use nalgebra::{DMatrix, DVector, SMatrix, Vector3};
use rayon::prelude::*;

use crate::{
    error::Error,
    geometry::frame::Frame,
    numerics::{
        levenberg_marquardt::{LmOptions, LmOutput, StopReason, minimise},
        linalg::{inverse_spd, symmetric_eigen},
        statistics::{NORMAL_95, VarianceComponent, chi_squared_survival},
    },
};

pub use crate::numerics::skyline::SkylineCholesky;
use layout::{Ingredients, Layout, components_of};
pub use model::{CAMERA, CameraVector, GroupState, SceneModel, ViewState};
pub use poses::{GROUP_NUMBERS, VIEW_NUMBERS};
use poses::{group_jacobian, group_numbers, pose_numbers, propagated, view_jacobian};
pub use problem::State;
use problem::{Problem, Reduced, STIFF};
pub use tracks::{KINDS, Kind, Observation, Track};

/// Options of [`adjust`].
#[derive(Debug, Clone, Copy)]
pub struct BundleOptions {
    /// Which of (ln fx, ln fy/fx, cx, cy, skew, k1, k2) are estimated.
    pub free: [bool; CAMERA],
    /// Priors (mean, standard deviation) of the same, frame units.
    pub priors: [Option<(f64, f64)>; CAMERA],
    /// p1 and p2 of the lens, held.
    pub tangential: [f64; 2],
    /// σ_a in radians, about each of two axes; `None`: estimated where enough views tell it, else its scale.
    pub attitude_sigma_rad: Option<f64>,
    /// Scale of the half-Cauchy prior of σ_a, radians.
    pub attitude_scale_rad: f64,
    /// σ_h, relative; `None`: estimated.
    pub height_sigma: Option<f64>,
    /// Residuals beyond this many standard deviations count less.
    pub huber: f64,
    /// Half width and height of the images, frame units.
    pub image_half_sides: [f64; 2],
    /// The loop.
    pub lm: LmOptions,
}

impl Default for BundleOptions {
    fn default() -> Self {
        Self {
            free: [true, true, true, true, false, true, true],
            priors: [None; CAMERA],
            tangential: [0.0; 2],
            attitude_sigma_rad: None,
            attitude_scale_rad: 0.1f64.to_radians(),
            height_sigma: None,
            huber: 3.0,
            image_half_sides: [1.0; 2],
            lm: LmOptions {
                max_iterations: 60,
                relative_cost_tolerance: 1e-7,
                step_tolerance: 1e-13,
                ..LmOptions::default()
            },
        }
    }
}

/// An attitude group's result.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GroupEstimate {
    /// Pitch (down) and roll, radians.
    pub pitch_roll_rad: [f64; 2],
    /// Height over the floor, in the world of its views (directions: 1).
    pub height: f64,
    /// Covariance of the camera's numbers (frame units), pitch, roll (radians) and height; zero for what was held.
    pub covariance: SMatrix<f64, GROUP_NUMBERS, GROUP_NUMBERS>,
    /// First view of the connected set its views belong to.
    pub origin: usize,
    /// The floor's upward normal in camera coordinates.
    pub up: Vector3<f64>,
}

/// A view's result, in a world whose origin is the floor below the first view connected to it, +X along that view's heading,
/// unit its height.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ViewEstimate {
    /// First view of the connected set; its own index for that view.
    pub origin: usize,
    /// Heading, anticlockwise from above, radians.
    pub yaw_rad: f64,
    /// Its standard deviation; 0 for an origin.
    pub yaw_sigma_rad: f64,
    /// Pitch (down) and roll of this view, radians.
    pub pitch_roll_rad: [f64; 2],
    /// How far its attitude strays from its group's about two level axes, radians.
    pub delta_rad: [f64; 2],
    /// Optical centre: x, y, height (directions: zero, zero, one).
    pub centre: Vector3<f64>,
    /// Standard deviations of the three.
    pub centre_sigma: Vector3<f64>,
    /// Covariance of the camera's numbers (frame units), pitch, roll, yaw (radians), x, y and height; zero for what was held.
    pub covariance: SMatrix<f64, VIEW_NUMBERS, VIEW_NUMBERS>,
    /// Root mean square of the weighted residuals of its observations (1: as expected).
    pub weighted_rms: f64,
    /// Observations.
    pub observations: usize,
}

/// A variance component and where it comes from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Component {
    /// Standard deviation.
    pub sigma: f64,
    /// Whether the data told it.
    pub estimated: bool,
}

/// The refined state and how sure it is.
#[derive(Debug, Clone)]
pub struct Bundle {
    /// Floor or directions.
    pub scene: SceneModel,
    /// Everything estimated.
    pub state: State,
    /// Covariance of the camera's numbers, frame units; zero rows for what was held.
    pub covariance: SMatrix<f64, CAMERA, CAMERA>,
    /// One a group.
    pub groups: Vec<GroupEstimate>,
    /// One a view; `None` for views without tracks.
    pub views: Vec<Option<ViewEstimate>>,
    /// Deviation of the views' attitudes, radians.
    pub attitude_sigma: Component,
    /// Relative deviation of the views' heights.
    pub height_sigma: Component,
    /// Weighted squared residuals over their degrees of freedom, before the weights were scaled by it, for each [`Kind`]; 1 where
    /// there are none.
    pub variance_factors: [f64; KINDS],
    /// How much more the residuals of neighbours have in common than independent ones would, for each [`Kind`]; the covariances
    /// allow for it.
    pub design_effects: [f64; KINDS],
    /// Observations (of two coordinates), tracks, columns.
    pub counts: [usize; 3],
    /// Observations of each [`Kind`].
    pub observations_of: [usize; KINDS],
    /// Degrees of freedom of the residuals.
    pub degrees_of_freedom: f64,
    /// How well the views' attitudes agree with σ_a: chi-squared of their deviations and its degrees of freedom.
    pub agreement: (f64, usize),
    /// Half the weighted squared residuals, losses and priors included.
    pub cost: f64,
    /// Weighted squared residual of each observation of each track.
    pub squared_residuals: Vec<Vec<f64>>,
    /// Steps tried, over all rounds.
    pub iterations: usize,
    /// Why the last loop ended.
    pub stop: StopReason,
}

/// Scale of the half-Cauchy prior of σ_h: a tripod or a robot on a floor keeps its height to about this.
const HEIGHT_SCALE: f64 = 1e-3;
/// Directions in which the data must see a variance component before they decide it.
const MIN_DIRECTIONS: usize = 4;
/// Probability below which the attitudes' disagreement is not put down to chance.
pub const DISAGREEMENT_P: f64 = 0.01;
/// Relative error of the variance of the residuals at which the weights rest.
const WEIGHTS_REST: f64 = 0.005;
/// Rounds of estimation of weights and variance components.
const ROUNDS: usize = 10;

/// Refines a state. Where more than one start is given, all are followed and the one of least cost is the answer: a wide error
/// bar may hold more than one minimum. The starts must have the same groups and views.
///
/// # Errors
/// [`Error::InvalidInput`] when tracks and views do not fit; [`Error::Numerical`] when the start is outside the model or the information is singular.
pub fn adjust(
    scene: SceneModel,
    frame: &Frame,
    tracks: &[Track],
    starts: Vec<State>,
    options: &BundleOptions,
) -> Result<Bundle, Error> {
    let failed = |detail: &str| Error::Numerical { stage: "joint refinement", detail: detail.into() };
    let first = starts.first().ok_or_else(|| failed("there is no start"))?;
    let group_of_view: Vec<usize> = first.views.iter().map(|v| v.group).collect();
    check(tracks, &starts)?;
    let mut problem = Problem::new(&Ingredients {
        scene,
        frame,
        tracks,
        group_of_view: &group_of_view,
        free: options.free,
        camera_priors: options.priors,
        tangential: options.tangential,
        huber: options.huber,
    });
    let mut states: Vec<State> = starts
        .into_iter()
        .filter_map(|mut state| {
            problem.hold_origins(&mut state);
            state.points = problem.points_from_first_views(&state)?;
            Some(state)
        })
        .collect();
    let mut attitude_sigma =
        Component { sigma: options.attitude_sigma_rad.unwrap_or(options.attitude_scale_rad), estimated: false };
    let mut height_sigma = Component { sigma: options.height_sigma.unwrap_or(1.0), estimated: false };
    let mut iterations = 0;
    let mut round = 0;
    let mut last = None;
    let mut effects = [1.0; KINDS];
    loop {
        round += 1;
        (problem.attitude_sigma_rad, problem.height_sigma) = (attitude_sigma.sigma, height_sigma.sigma);
        let mut best: Option<LmOutput<State, Reduced>> = None;
        for state in &mut states {
            let Some(next) = minimise(&problem, state.clone(), &options.lm) else { continue };
            iterations += next.iterations;
            *state = next.state.clone();
            if best.as_ref().is_none_or(|b| next.cost < b.cost) {
                best = Some(next);
            }
        }
        let out = best.ok_or_else(|| failed("the start is outside the model"))?;
        let factor = out.linearised.information.cholesky(0.0).ok_or_else(|| failed("the information is singular"))?;
        let squared_residuals =
            problem.squared_residuals(&out.state).ok_or_else(|| failed("the solution is outside the model"))?;
        let (variances, degrees_of_freedom) = variance_factors(&problem, &out.state, &squared_residuals, &factor);
        let next_effects = problem
            .design_effects(&out.state, options.image_half_sides, variances)
            .ok_or_else(|| failed("the solution is outside the model"))?;
        // In units of single residuals, which the weights in force take for larger by what neighbours have in common.
        let white: [f64; KINDS] = std::array::from_fn(|k| variances[k] * effects[k]);
        let deltas = Deviations::of_attitudes(&problem, &out.state, &factor, problem.attitude_sigma_rad);
        let heights = Deviations::of_heights(&problem, &out.state, &factor, problem.height_sigma);
        // From round to round the weights of the loss change too: the camera rests when they hardly move it.
        let moved = last.map_or(f64::INFINITY, |before: CameraVector| {
            (0..CAMERA)
                .filter(|&i| Layout::is_free(problem.layout.camera[i]))
                .map(|i| {
                    let column = problem.layout.camera[i];
                    (out.state.camera[i] - before[i]).abs() / factor.inverse_block(&[column])[(0, 0)].sqrt()
                })
                .fold(0.0, f64::max)
        });
        last = Some(out.state.camera);
        let rests =
            |k: usize| (white[k] - 1.0).abs() < WEIGHTS_REST && (next_effects[k] / effects[k]).ln().abs() < 0.05;
        let mut settled = moved < 0.02 && (0..KINDS).all(rests);
        let agreement = deltas.as_ref().map_or((0.0, 0), |d| d.agreement(attitude_sigma.sigma));
        if options.attitude_sigma_rad.is_none()
            && let Some(d) = &deltas
        {
            let next = d.attitude_component(options.attitude_scale_rad);
            settled &= (next.sigma / attitude_sigma.sigma).ln().abs() < 0.05;
            attitude_sigma = next;
        }
        if options.height_sigma.is_none()
            && let Some(h) = &heights
        {
            let component = VarianceComponent { scale: HEIGHT_SCALE, below: 30.0, above: 1000.0 };
            let next = Component { sigma: component.posterior(|s| h.log_likelihood(s)), estimated: true };
            settled &= (next.sigma / height_sigma.sigma).ln().abs() < 0.05;
            height_sigma = next;
        }
        if settled || round == ROUNDS {
            let solution = Solution { problem: &problem, state: &out.state, factor: &factor };
            // Few degrees of freedom leave the noise uncertain: the variance of Student's distribution.
            let student = if degrees_of_freedom > 4.0 { degrees_of_freedom / (degrees_of_freedom - 2.0) } else { 2.0 };
            let unexplained = if options.attitude_sigma_rad.is_some() { disagreement(agreement) } else { 1.0 };
            let nonlinear = profile_widening(&problem, &out.state, out.cost, &factor, &options.lm);
            let widened = student * unexplained * nonlinear * nonlinear;
            let origin_of = components_of(group_of_view.len(), tracks);
            return Ok(Bundle {
                scene,
                covariance: solution.camera_covariance() * widened,
                groups: solution.groups(&origin_of, widened),
                views: solution.views(&origin_of, tracks, &squared_residuals, widened),
                attitude_sigma: Component { sigma: problem.attitude_sigma_rad, ..attitude_sigma },
                height_sigma: Component { sigma: problem.height_sigma, ..height_sigma },
                variance_factors: std::array::from_fn(|k| white[k] / (problem.weights[k] * effects[k])),
                design_effects: effects,
                counts: [problem.observations(), problem.tracks(), problem.layout.size],
                observations_of: std::array::from_fn(|k| {
                    tracks.iter().filter(|t| t.kind as usize == k).map(|t| t.observations.len()).sum()
                }),
                degrees_of_freedom,
                agreement,
                cost: out.cost,
                squared_residuals,
                iterations,
                stop: out.stop,
                state: out.state,
            });
        }
        // What is large is so in units of single residuals.
        let next_white: [f64; KINDS] =
            std::array::from_fn(|k| (problem.weights[k] * effects[k] / white[k]).clamp(1e-6, 25.0));
        problem.reweight(&squared_residuals, std::array::from_fn(|k| next_white[k] / problem.weights[k]));
        problem.weights = std::array::from_fn(|k| next_white[k] / next_effects[k]);
        effects = next_effects;
    }
}

/// Refuses what would index beyond the views and groups there are.
fn check(tracks: &[Track], starts: &[State]) -> Result<(), Error> {
    let fail = |text: String| Err(Error::InvalidInput(text));
    let groups: Vec<usize> = starts[0].views.iter().map(|v| v.group).collect();
    let same = |s: &State| s.views.iter().map(|v| v.group).eq(groups.iter().copied());
    if starts.iter().any(|s| !same(s) || groups.iter().any(|g| *g >= s.groups.len())) {
        return fail("the starts differ in their views and groups, or a view has no group".into());
    }
    for (t, track) in tracks.iter().enumerate() {
        let o = &track.observations;
        let ascending = o.windows(2).all(|w| w[0].view < w[1].view);
        let finite = o.iter().all(|o| o.pixel.iter().chain(o.information.iter()).all(|v| v.is_finite()));
        if o.len() < 2 || !ascending || !finite || o.iter().any(|o| o.view >= groups.len()) {
            return fail(format!(
                "track {t} must have two observations or more, finite, in ascending order of views that exist"
            ));
        }
    }
    Ok(())
}

/// By how much the variances grow because the attitudes disagree with a σ_a that was given.
pub fn disagreement((chi_squared, degrees_of_freedom): (f64, usize)) -> f64 {
    if chi_squared_survival(chi_squared, degrees_of_freedom) < DISAGREEMENT_P {
        chi_squared / degrees_of_freedom as f64
    } else {
        1.0
    }
}

/// Standard deviation of ln f from which on the shape of the likelihood is looked at.
const PROFILE_FROM: f64 = 0.01;

/// How much wider than its linearised error bar the interval of f is: the cost, minimised over everything else, must have risen
/// by what belongs to 95 % at the ends (profile likelihood). Only where the bar is wide; 1: the bar holds.
fn profile_widening(problem: &Problem, state: &State, cost: f64, factor: &SkylineCholesky, lm: &LmOptions) -> f64 {
    const RISE: f64 = 1.92;
    const STIFFNESS: f64 = 1e-8;
    let column = problem.layout.camera[0];
    if !Layout::is_free(column) {
        return 1.0;
    }
    let sigma = factor.inverse_block(&[column])[(0, 0)].sqrt();
    if sigma < PROFILE_FROM {
        return 1.0;
    }
    let prior_cost = |ln_f: f64| problem.camera_priors[0].map_or(0.0, |(mean, s)| 0.5 * ((ln_f - mean) / s).powi(2));
    let cost_at = |from: &State, ln_f: f64| {
        let mut held = problem.clone();
        held.camera_priors[0] = Some((ln_f, STIFFNESS));
        let mut start = from.clone();
        start.camera[0] = ln_f;
        let out = minimise(&held, start, lm)?;
        Some((out.cost + prior_cost(ln_f), out.state))
    };
    let base = cost;
    let mut widest: f64 = 1.0;
    for side in [-1.0, 1.0] {
        let mut from = state.clone();
        let mut factor = 1.0;
        // Outwards in steps until the cost has risen, or f is off by a factor of three.
        while factor * NORMAL_95 * sigma < 1.1 {
            let Some((at, next)) = cost_at(&from, state.camera[0] + side * factor * NORMAL_95 * sigma) else { break };
            if at - base >= RISE {
                break;
            }
            from = next;
            factor *= 1.3;
        }
        widest = widest.max(factor);
    }
    // A step of the search is no finding.
    if widest <= 1.3 { 1.0 } else { widest }
}

/// Mean squared weighted residual per degree of freedom of each kind, and all of these: two an observation less two a track less
/// the columns, of which those with priors count by how much the data decide them.
fn variance_factors(
    problem: &Problem,
    state: &State,
    squared_residuals: &[Vec<f64>],
    factor: &SkylineCholesky,
) -> ([f64; KINDS], f64) {
    let held: f64 = problem
        .prior_information(state)
        .into_iter()
        .map(|(column, information)| (information * factor.inverse_block(&[column])[(0, 0)]).min(1.0))
        .sum();
    let redundancies = problem.redundancies().map(|r| r as f64);
    let total: f64 = redundancies.iter().sum();
    let dof = total - (problem.layout.size as f64 - held);
    if dof < 1.0 {
        return ([1.0; KINDS], dof.max(0.0));
    }
    let sums = problem.weighted_sums(squared_residuals);
    // The columns cost each kind in proportion.
    let of_kind = |k: usize| if redundancies[k] > 0.0 { sums[k] / (redundancies[k] * dof / total) } else { 1.0 };
    (std::array::from_fn(of_kind), dof)
}

/// Deviations with a common variance, everything else eliminated: their information Q from the data alone, by its eigenvalues,
/// and Q times their best values.
struct Deviations {
    eigenvalues: DVector<f64>,
    /// Components of Q δ* along the eigenvectors.
    right: DVector<f64>,
}

impl Deviations {
    fn of_attitudes(problem: &Problem, state: &State, factor: &SkylineCholesky, sigma: f64) -> Option<Self> {
        let columns = problem.attitude_columns();
        let values = problem
            .layout
            .views
            .iter()
            .zip(&state.views)
            .flat_map(|(c, v)| [(c[0], v.delta_rad[0]), (c[1], v.delta_rad[1])])
            .filter(|(c, _)| Layout::is_free(*c))
            .map(|(_, value)| value);
        Self::new(factor.inverse_block(&columns), DVector::from_iterator(columns.len(), values), sigma)
    }

    fn of_heights(problem: &Problem, state: &State, factor: &SkylineCholesky, sigma: f64) -> Option<Self> {
        let columns = problem.height_columns(state);
        let indices: Vec<usize> = columns.iter().map(|(c, _)| *c).collect();
        let block = factor.inverse_block(&indices);
        let signed = DMatrix::from_fn(block.nrows(), block.ncols(), |r, c| columns[r].1 * columns[c].1 * block[(r, c)]);
        let values = problem.height_deviations(state);
        Self::new(signed, DVector::from_vec(values), sigma)
    }

    /// From the posterior covariance and mean under a prior of deviation `sigma`.
    fn new(covariance: DMatrix<f64>, mean: DVector<f64>, sigma: f64) -> Option<Self> {
        if mean.is_empty() {
            return None;
        }
        let prior = 1.0 / sigma.max(STIFF).powi(2);
        let posterior = inverse_spd(&covariance)?;
        let information = &posterior - DMatrix::from_diagonal_element(mean.len(), mean.len(), prior);
        let (values, vectors) = symmetric_eigen(&((&information + information.transpose()) * 0.5))?;
        // Rounding of what the prior held.
        let least = 1e-9 * prior;
        Some(Self {
            right: vectors.tr_mul(&(posterior * mean)),
            eigenvalues: values.map(|v| if v > least { v } else { 0.0 }),
        })
    }

    /// Logarithm of the likelihood of a deviation, all else being profiled out.
    fn log_likelihood(&self, sigma: f64) -> f64 {
        let variance = sigma * sigma;
        self.eigenvalues
            .iter()
            .zip(self.right.iter())
            .filter(|(l, _)| **l > 0.0)
            .map(|(l, r)| 0.5 * (variance * r * r / (1.0 + variance * l) - (variance * l).ln_1p()))
            .sum()
    }

    /// Chi-squared of the deviations for a given variance, and its degrees of freedom.
    fn agreement(&self, sigma: f64) -> (f64, usize) {
        // A direction known to no better than 20 degrees says nothing.
        let seen = self.eigenvalues.iter().zip(self.right.iter()).filter(|(l, _)| **l > 8.0);
        seen.fold((0.0, 0), |(sum, count), (l, r)| (sum + r * r / (l * (1.0 + sigma * sigma * l)), count + 1))
    }

    fn attitude_component(&self, scale: f64) -> Component {
        let seen = self.eigenvalues.iter().filter(|l| **l * scale * scale > 1.0).count();
        let component = VarianceComponent { scale, below: 30.0, above: 50.0 };
        let told = || component.posterior(|s| self.log_likelihood(s));
        if seen >= MIN_DIRECTIONS {
            return Component { sigma: told(), estimated: true };
        }
        // Few directions, or vague ones, do not make the deviation smaller than stated, but they may make it larger.
        let (_, directions) = self.agreement(scale);
        let sigma = if directions > 0 { told().max(scale) } else { scale };
        Component { sigma, estimated: sigma > scale }
    }
}

/// A solution from which results are read.
struct Solution<'a> {
    problem: &'a Problem,
    state: &'a State,
    factor: &'a SkylineCholesky,
}

impl Solution<'_> {
    /// Covariance of the numbers in `columns`, zero for those held.
    fn block<const N: usize>(&self, columns: [usize; N]) -> SMatrix<f64, N, N> {
        let free: Vec<usize> = columns.iter().copied().filter(|c| Layout::is_free(*c)).collect();
        let block = self.factor.inverse_block(&free);
        let place: Vec<Option<usize>> = columns.iter().map(|c| free.iter().position(|f| f == c)).collect();
        SMatrix::from_fn(|r, c| match (place[r], place[c]) {
            (Some(r), Some(c)) => block[(r, c)],
            _ => 0.0,
        })
    }

    fn camera_covariance(&self) -> SMatrix<f64, CAMERA, CAMERA> {
        self.block(self.problem.layout.camera)
    }

    fn groups(&self, origin_of: &[usize], widened: f64) -> Vec<GroupEstimate> {
        let inverse = |columns: &[usize]| self.factor.inverse_block(columns);
        (0..self.state.groups.len())
            .map(|g| {
                let group = &self.state.groups[g];
                let [pitch, roll, height] = group_numbers(group).into();
                GroupEstimate {
                    pitch_roll_rad: [pitch, roll],
                    height,
                    covariance: propagated(&group_jacobian(&self.problem.layout, self.state, g), inverse) * widened,
                    up: group.attitude.column(2).into_owned(),
                    origin: self.state.views.iter().position(|v| v.group == g).map_or(0, |v| origin_of[v]),
                }
            })
            .collect()
    }

    fn views(
        &self,
        origin_of: &[usize],
        tracks: &[Track],
        squared_residuals: &[Vec<f64>],
        widened: f64,
    ) -> Vec<Option<ViewEstimate>> {
        let count = self.state.views.len();
        let (mut sums, mut counts) = (vec![0.0; count], vec![0usize; count]);
        for (t, residuals) in tracks.iter().zip(squared_residuals) {
            // The point takes a part of the residual with it.
            let share = t.observations.len() as f64 / (t.observations.len() as f64 - 1.0);
            for (o, r) in t.observations.iter().zip(residuals) {
                sums[o.view] += 0.5 * r * share;
                counts[o.view] += 1;
            }
        }
        (0..count)
            .into_par_iter()
            .map(|v| {
                let origin = origin_of[v];
                if counts[v] == 0 {
                    return None;
                }
                let [pitch, roll, yaw, x, y, height] = pose_numbers(self.state, v, origin).into();
                let jacobian = view_jacobian(&self.problem.layout, self.state, v, origin);
                let covariance: SMatrix<f64, VIEW_NUMBERS, VIEW_NUMBERS> =
                    propagated(&jacobian, |columns| self.factor.inverse_block(columns)) * widened;
                let sd = |i: usize| covariance[(CAMERA + i, CAMERA + i)].max(0.0).sqrt();
                Some(ViewEstimate {
                    origin,
                    yaw_rad: yaw,
                    yaw_sigma_rad: sd(2),
                    pitch_roll_rad: [pitch, roll],
                    delta_rad: self.state.views[v].delta_rad,
                    centre: Vector3::new(x, y, height),
                    centre_sigma: Vector3::new(sd(3), sd(4), sd(5)),
                    covariance,
                    weighted_rms: (sums[v] / counts[v] as f64).sqrt(),
                    observations: counts[v],
                })
            })
            .collect()
    }
}
