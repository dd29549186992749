//! The joint refinement as a loop of named steps: minimise; weigh the observations; estimate the variance components; and, when
//! all of these have converged, covariances and the shape of the likelihood.
//!
//! ```text
//! C = κ N⁻¹ + extra,      κ = n / (n - 2) · u · p² · m
//! ```
//!
//! N: reduced information at the minimum; n: degrees of freedom, whose factor is the variance of Student's distribution (2 for n up to 4); u: by how
//! much attitudes disagree beyond a σ_a that was given (`variance_components`); p: widening where the likelihood is no parabola (`profile`); m: of
//! deviations that were stated wrongly (`reweight`); extra, of the first camera: variances of what pictures depart by, and of a lens off the axis
//! (`lever`).

use nalgebra::Vector2;

use crate::{
    error::Error,
    numerics::{
        levenberg_marquardt::{Linearisation, LmOutput, minimise_until},
        skyline::Skyline,
        skyline_cholesky::SkylineCholesky,
    },
    observer::Observer,
    refine::{
        blocks::{BundleOptions, State},
        bundle::{Bundle, CameraEstimate},
        covariance::Solution,
        elimination::Reduced,
        evidence::Evidence,
        layout::ProblemInputs,
        lever::LeverArm,
        problem::Problem,
        profile::profile_widening,
        release::released,
        residual::SceneModel,
        reweight::WeightEstimate,
        score::Minimum,
        tracks::{KINDS, Track},
        variance_components::{Component, VarianceComponents, disagreement},
    },
};

/// Standard deviations by which the cameras move from round to round when they have converged.
const CAMERA_TOLERANCE_SIGMAS: f64 = 0.02;

/// Refines a state. Where more than one start is given, all are followed and the one of least cost is the answer: a wide error
/// bar may hold more than one minimum. The starts must have the same cameras, groups and frames.
///
/// # Errors
/// [`Error::InvalidInput`] when tracks, cameras and frames do not fit; [`Error::Numerical`] when the start is outside the model or
/// the information is singular.
#[cfg(test)]
pub(crate) fn adjust(
    scene: SceneModel,
    tracks: &[Track],
    starts: Vec<State>,
    options: &BundleOptions,
) -> Result<Bundle, Error> {
    adjust_until(scene, tracks, starts, options, &crate::observer::Silent)
}

/// The same under an observer's eyes; [`Error::Stopped`] when it says so.
pub(crate) fn adjust_until(
    scene: SceneModel,
    tracks: &[Track],
    starts: Vec<State>,
    options: &BundleOptions,
    observer: &dyn Observer,
) -> Result<Bundle, Error> {
    let mut rounds = Rounds::new(scene, tracks, starts, options)?;
    let mut last_round = options.rounds;
    for round in 1.. {
        let fit = rounds.minimised(observer)?;
        let weight_estimate = rounds.weight_estimate(&fit);
        let components = rounds.components.updated(&rounds.problem, &fit.out.state, fit.equations(), options);
        let converged = rounds.cameras_converged(&fit)
            & weight_estimate.has_converged(rounds.effects)
            & components.has_converged(&rounds.components);
        if converged || round >= last_round {
            if !rounds.release(&fit) {
                return rounds.finish(fit, &weight_estimate, &components, observer);
            }
            last_round = round + options.rounds;
        }
        rounds.advance(&fit, &weight_estimate, components);
    }
    Err(failed("it came to no end"))
}

fn failed(detail: &str) -> Error {
    Error::Numerical { stage: "joint refinement", detail: detail.into() }
}

/// What goes from round to round.
struct Rounds<'a> {
    tracks: &'a [Track],
    options: &'a BundleOptions,
    problem: Problem,
    /// Where each start has come to.
    states: Vec<State>,
    /// Variance components in force.
    components: VarianceComponents,
    /// What the weights in force allow neighbouring residuals to have in common.
    effects: [f64; KINDS],
    /// The solution of the round before.
    last: Option<State>,
    iterations: usize,
}

/// The best minimum of a round.
struct Fit {
    out: LmOutput<State, Reduced>,
    factor: SkylineCholesky,
    /// Residual of each observation of each track, whitened and weighted.
    residuals: Vec<Vec<Vector2<f64>>>,
    /// Their squares without the weights of the loss.
    squared_residuals: Vec<Vec<f64>>,
}

impl Fit {
    fn equations(&self) -> (&Skyline, &SkylineCholesky) {
        (&self.out.linearised.information, &self.factor)
    }
}

fn minimum(fit: &Fit) -> Minimum<'_> {
    Minimum { state: &fit.out.state, factor: &fit.factor, gradient: &fit.out.linearised.gradient }
}

impl<'a> Rounds<'a> {
    fn new(
        scene: SceneModel,
        tracks: &'a [Track],
        mut starts: Vec<State>,
        options: &'a BundleOptions,
    ) -> Result<Self, Error> {
        if options.attitude_sigma_rad == Some(f64::INFINITY) {
            starts = starts.into_iter().map(State::with_own_attitudes).collect();
        }
        check(tracks, &starts, options)?;
        let first = starts.first().ok_or_else(|| failed("there is no start"))?;
        let huber = options.huber;
        let problem = Problem::new(&ProblemInputs {
            scene,
            tracks,
            state: first,
            cameras: &options.cameras,
            outlier_frames: &options.outlier_frames,
            departures: &options.departures,
            huber,
        });
        let with_points = |mut state: State| {
            problem.hold_units(&mut state);
            state.points = problem.points_from_first_images(&state)?;
            Some(state)
        };
        let states = starts.into_iter().filter_map(with_points).collect();
        Ok(Self {
            tracks,
            options,
            problem,
            states,
            components: VarianceComponents::start(options),
            effects: [1.0; KINDS],
            last: None,
            iterations: 0,
        })
    }

    /// Follows every start to its minimum under the weights and components in force.
    fn minimised(&mut self, observer: &dyn Observer) -> Result<Fit, Error> {
        let (attitude, height) = (self.components.attitude.sigma, self.components.height.sigma);
        (self.problem.attitude_sigma_rad, self.problem.height_sigma) = (attitude, height);
        self.problem.departure_sigmas = self.components.departures.map(|c| c.sigma);
        let mut best: Option<LmOutput<State, Reduced>> = None;
        for state in &mut self.states {
            let next = minimise_until(&self.problem, state.clone(), &self.options.lm, observer);
            observer.go_on()?;
            let Some(next) = next else { continue };
            self.iterations += next.iterations;
            *state = next.state.clone();
            if best.as_ref().is_none_or(|b| next.cost < b.cost) {
                best = Some(next);
            }
        }
        let out = best.ok_or_else(|| failed("the start is outside the model"))?;
        let factor = out.linearised.information.cholesky(0.0).ok_or_else(|| failed("the information is singular"))?;
        let residuals = out.linearised.residuals();
        let squared_residuals = self.problem.squared_residuals(&residuals);
        Ok(Fit { out, factor, residuals, squared_residuals })
    }

    fn weight_estimate(&self, fit: &Fit) -> WeightEstimate {
        let residuals = (fit.residuals.as_slice(), fit.squared_residuals.as_slice());
        WeightEstimate::new(&self.problem, &fit.out.state, residuals, &fit.factor, self.effects)
    }

    /// From round to round the weights of the loss change too: the cameras have converged when they hardly move them.
    fn cameras_converged(&self, fit: &Fit) -> bool {
        let Some(last) = &self.last else { return false };
        let cameras = fit.out.state.cameras.iter().zip(&last.cameras).zip(&self.problem.layout.cameras);
        let mut moved = cameras.flat_map(|((now, before), block)| {
            let difference = now.numbers() - before.numbers();
            let in_sigmas =
                |(n, c): (usize, usize)| difference[n].abs() / fit.factor.inverse_block(&[c])[(0, 0)].sqrt();
            block.free().map(in_sigmas).collect::<Vec<f64>>()
        });
        moved.all(|m| m < CAMERA_TOLERANCE_SIGMAS)
    }

    /// Puts what a round found into force.
    fn advance(&mut self, fit: &Fit, weight_estimate: &WeightEstimate, components: VarianceComponents) {
        weight_estimate.apply(&mut self.problem, &fit.squared_residuals, self.effects);
        self.effects = weight_estimate.effects;
        self.components = components;
        self.last = Some(fit.out.state.clone());
    }

    /// Has a number more estimated where the residuals ask for it.
    fn release(&mut self, fit: &Fit) -> bool {
        let released = released(&self.problem, self.tracks, minimum(fit));
        let any = released.is_some();
        if let Some(problem) = released {
            self.problem = problem;
        }
        any
    }

    /// Covariances and what else is reported.
    fn finish(
        self,
        fit: Fit,
        weight_estimate: &WeightEstimate,
        components: &VarianceComponents,
        observer: &dyn Observer,
    ) -> Result<Bundle, Error> {
        let (problem, tracks) = (&self.problem, self.tracks);
        let lever_arm = LeverArm::of(problem, minimum(&fit), self.options.lens_on_axis);
        let Fit { out, factor, squared_residuals, .. } = fit;
        // Few degrees of freedom leave the noise uncertain: the variance of Student's distribution.
        let dof = weight_estimate.degrees_of_freedom;
        let student = if dof > 4.0 { dof / (dof - 2.0) } else { 2.0 };
        let given = self.options.attitude_sigma_rad.is_some();
        let unexplained = if given { disagreement(components.agreement) } else { 1.0 };
        let nonlinear = match self.options.profile {
            true => profile_widening(problem, &out, &factor, &self.options.lm, observer),
            false => 1.0,
        };
        observer.go_on()?;
        let misstated = problem.misstated_noise(&squared_residuals);
        let widened = student * unexplained * nonlinear * nonlinear * misstated;
        let solution = Solution { layout: &problem.layout, state: &out.state, factor: &factor, widened };
        factor.expect_entries(solution.columns_of_poses());
        let mut cameras = solution.cameras();
        let (mut groups, mut views) = (solution.groups(), solution.views(tracks, &squared_residuals));
        let added = of_all_pictures(&cameras, components, lever_arm.as_ref());
        let of_cameras = cameras.iter_mut().take(1).map(|camera| &mut camera.covariance);
        let of_groups = groups.iter_mut().map(|group| group.covariance.matrix_mut());
        let of_views = views.iter_mut().flatten().map(|view| view.covariance.matrix_mut());
        for covariance in of_cameras.chain(of_groups).chain(of_views) {
            added.iter().for_each(|(places, value)| covariance[*places] += value);
        }
        let variance_factors =
            std::array::from_fn(|k| weight_estimate.single_variances[k] / (problem.weights[k] * self.effects[k]));
        let at_fixed_point = weight_estimate.at_fixed_point(problem, &squared_residuals, self.effects);
        let of_evidence = |k: usize| at_fixed_point[k] / (problem.weights[k] * self.effects[k]);
        let residuals = std::array::from_fn(|k| (weight_estimate.of_kinds[k], of_evidence(k)));
        let at = (&out.state, &out.linearised);
        let evidence = Evidence::new(problem, at, &factor, components, residuals, self.effects);
        let observations_of =
            |k: usize| tracks.iter().filter(|t| t.kind as usize == k).map(|t| t.observations.len()).sum();
        Ok(Bundle {
            scene: self.problem.scene,
            cameras,
            lever_arm,
            unknowns: problem.cameras.clone(),
            rig: solution.rig(),
            groups,
            views,
            outlier_frames: problem.outlier_frames.clone(),
            attitude_sigma: Component { sigma: problem.attitude_sigma_rad, ..components.attitude },
            height_sigma: Component { sigma: problem.height_sigma, ..components.height },
            departure_sigmas: std::array::from_fn(|k| Component {
                sigma: problem.departure_sigmas[k],
                ..components.departures[k]
            }),
            variance_factors,
            design_effects: self.effects,
            counts: [problem.observations(), problem.tracks(), problem.layout.size],
            observations_of: std::array::from_fn(observations_of),
            degrees_of_freedom: dof,
            agreement: components.agreement,
            agreement_at_most: components.agreement_at_most,
            evidence,
            widened,
            cost: out.cost,
            squared_residuals,
            iterations: self.iterations,
            remaining_gain: out.linearised.solve(0.0).map_or(f64::INFINITY, |step| step.predicted_decrease),
            stop: out.stop,
            state: out.state,
            problem: self.problem,
        })
    }
}

/// What the covariance of the first camera has beside the inverse information, by places: it is the camera of any of its pictures, so that how
/// far these depart from each other in focal length and place is part of it; and what a lens off the axis may make wrong.
fn of_all_pictures(
    cameras: &[CameraEstimate],
    components: &VarianceComponents,
    lever_arm: Option<&LeverArm>,
) -> Vec<((usize, usize), f64)> {
    let is_estimated = |number: usize| cameras.first().is_some_and(|c| c.covariance[(number, number)] > 0.0);
    let of_departures = of_any_picture(components).into_iter().filter(|((number, _), _)| is_estimated(*number));
    of_departures.chain(lever_arm.map_or(&[][..], LeverArm::added).iter().copied()).collect()
}

/// How far the pictures depart from each other in focal length and place, as variances of the camera's numbers, by places.
pub(crate) fn of_any_picture(components: &VarianceComponents) -> [((usize, usize), f64); 3] {
    let [focal, _, shift] = components.departures.map(|c| c.sigma * c.sigma);
    [((0, 0), focal), ((2, 2), shift), ((3, 3), shift)]
}

/// Refuses what would index beyond the cameras, frames and groups there are.
fn check(tracks: &[Track], starts: &[State], options: &BundleOptions) -> Result<(), Error> {
    let fail = |text: String| Err(Error::InvalidInput(text));
    let Some(first) = starts.first() else { return Ok(()) };
    let (cameras, frames) = (options.cameras.len(), first.frames.len());
    let fits = |s: &State| {
        s.cameras.len() == cameras
            && s.rig.len() == cameras
            && s.groups.len() == first.groups.len()
            && s.frames.iter().map(|f| f.group).eq(first.frames.iter().map(|f| f.group))
            && s.frames.iter().all(|f| f.group < s.groups.len())
    };
    if cameras == 0 || !starts.iter().all(fits) {
        return fail("the starts differ in their cameras, groups and frames, or a frame has no group".into());
    }
    for (t, track) in tracks.iter().enumerate() {
        let o = &track.observations;
        let ascending = o.windows(2).all(|w| (w[0].frame, w[0].camera) < (w[1].frame, w[1].camera));
        let finite = o.iter().all(|o| o.pixel.iter().chain(o.information.iter()).all(|v| v.is_finite()));
        if o.len() < 2 || !ascending || !finite || o.iter().any(|o| o.frame >= frames || o.camera >= cameras) {
            return fail(format!(
                "track {t} must have two observations or more, finite, in ascending order of frames and cameras that exist"
            ));
        }
    }
    Ok(())
}
