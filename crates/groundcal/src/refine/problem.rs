//! The least squares problem of the joint refinement: observations, priors, cost, linearisation and steps.
//!
//! ```text
//! J = ½ Σ_o w_o |U_o (π_o - x_o)|²  +  ½ Σ_d (d / σ_d)²,        U_oᵀ U_o = Λ_o
//! ```
//!
//! x_o: a pixel, Λ_o the inverse of its covariance; π_o: where the model sees the point (`residual`); w_o: weight of the kind of measurement times
//! that of the loss, held while the cost is minimised (`reweight`); d: a number that has a prior, less its mean, σ_d the prior's deviation. A point
//! q moves in its tangent plane, q ← (q + a u + b v) / |…|, so that it takes two columns.

use nalgebra::{DVector, Matrix2, SVector, Vector2, Vector3};
use rayon::prelude::*;

use crate::{
    numerics::levenberg_marquardt::LeastSquares,
    refine::{
        blocks::{
            CameraUnknowns, Departure, DepartureKind, FRAME_POSE, GROUP_HEIGHT, OUTLIER_ATTITUDE_SIGMA_RAD, State,
        },
        elimination::{Part, Reduced, TrackRows},
        layout::{Cluster, Layout, ProblemInputs, build_layout, cluster_tracks},
        residual::{Pose, Projection, Projector, SceneModel, project_with_derivatives, tangent_of},
        tracks::KINDS,
    },
};

/// An observation, ready for use.
#[derive(Debug, Clone, Copy)]
pub(crate) struct PreparedObservation {
    pub(crate) pixel: Vector2<f64>,
    /// Its row, from -1 (first) to 1 (last).
    pub(crate) row: f64,
    /// Upper triangular root of the information: |whiten r|² = rᵀ Λ r.
    whiten: [f64; 3],
    /// Less than 1 where the residual was too large to count in full.
    pub(crate) robust: f64,
}

impl PreparedObservation {
    pub(crate) fn whitened(&self, r: &Vector2<f64>) -> Vector2<f64> {
        Vector2::new(self.whiten[0] * r.x + self.whiten[1] * r.y, self.whiten[2] * r.y)
    }

    /// Trace of the information that was stated of it.
    pub(crate) fn stated_information(&self) -> f64 {
        self.whiten.iter().map(|w| w * w).sum()
    }
}

/// Upper triangular U with UᵀU = m.
fn root(m: &Matrix2<f64>) -> [f64; 3] {
    let a = m[(0, 0)].max(f64::MIN_POSITIVE).sqrt();
    let b = m[(0, 1)] / a;
    [a, b, (m[(1, 1)] - b * b).max(0.0).sqrt()]
}

/// A random effect: it has a variance in common with others: `sign` times the step of a column adds to its value.
#[derive(Debug, Clone, Copy)]
pub(crate) struct RandomEffect {
    pub(crate) column: usize,
    pub(crate) sign: f64,
    pub(crate) value: f64,
}

/// The problem.
#[derive(Debug, Clone)]
pub(crate) struct Problem {
    pub(crate) scene: SceneModel,
    pub(crate) prepared: Vec<Vec<PreparedObservation>>,
    pub(crate) clusters: Vec<Cluster>,
    /// Columns.
    pub layout: Layout,
    first: Vec<usize>,
    /// What is estimated of the cameras, with its priors.
    pub(crate) cameras: Vec<CameraUnknowns>,
    /// Standard deviation of each frame's attitude about each of two axes, radians.
    pub attitude_sigma_rad: f64,
    /// Frames whose attitude errors have a standard deviation of their own.
    pub(crate) outlier_frames: Vec<usize>,
    /// Relative standard deviation of each frame's height from that of its group.
    pub height_sigma: f64,
    /// Departures that are estimated.
    pub(crate) departures_estimated: Vec<DepartureKind>,
    /// Standard deviation of each kind of departure.
    pub departure_sigmas: [f64; DepartureKind::ALL.len()],
    /// Factors on the information of the observations of each kind.
    pub(crate) weights: [f64; KINDS],
    /// Kind of each track.
    pub(crate) kinds: Vec<usize>,
    /// Residuals beyond this many deviations count less (Huber).
    pub(crate) huber: f64,
}

/// Least standard deviation of attitudes (radians) and heights (relative): what is said to be exact is held with this standard deviation.
pub(crate) const MIN_PRIOR_SIGMA: f64 = 1e-7;

/// Tracks of a cluster that are worked on at once.
const CHUNK: usize = 64;

/// Cameras and poses of a state, ready for projecting.
pub(crate) struct Views {
    cameras: usize,
    projectors: Vec<Projector>,
    /// By frame, then camera.
    poses: Vec<Pose>,
}

impl Views {
    fn of(&self, (frame, camera): (usize, usize)) -> (&Projector, &Pose) {
        (&self.projectors[camera], &self.poses[frame * self.cameras + camera])
    }

    /// Where an image shows the point of an observation.
    pub(crate) fn project(
        &self,
        image: (usize, usize),
        q: &Vector3<f64>,
        seen: &PreparedObservation,
    ) -> Option<Vector2<f64>> {
        let (projector, pose) = self.of(image);
        projector.project_from(pose, q, seen.row)
    }
}

impl Problem {
    /// Orders the unknowns and prepares the observations.
    pub(crate) fn new(i: &ProblemInputs<'_>) -> Self {
        let layout = build_layout(i);
        let prepared: Vec<Vec<PreparedObservation>> = i
            .tracks
            .iter()
            .map(|t| {
                let of = |o: &crate::refine::tracks::Observation| {
                    let camera = &i.cameras[o.camera];
                    let frame = &camera.frame;
                    let information = o.information * frame.scale_px * frame.scale_px;
                    let pixel = frame.local(&o.pixel);
                    PreparedObservation {
                        pixel,
                        row: pixel.y / camera.image_half_sides[1],
                        whiten: root(&information),
                        robust: 1.0,
                    }
                };
                t.observations.iter().map(of).collect()
            })
            .collect();
        let clusters = cluster_tracks(i, &layout);
        let mut first: Vec<usize> = (0..layout.size).collect();
        for c in &clusters {
            let least = c.columns.first().copied().unwrap_or(0);
            for &column in &c.columns {
                first[column] = first[column].min(least);
            }
        }
        Self {
            scene: i.scene,
            prepared,
            clusters,
            layout,
            first,
            cameras: i.cameras.to_vec(),
            attitude_sigma_rad: MIN_PRIOR_SIGMA,
            outlier_frames: i.outlier_frames.to_vec(),
            height_sigma: 1.0,
            departures_estimated: i.departures.to_vec(),
            departure_sigmas: [1.0; DepartureKind::ALL.len()],
            weights: [1.0; KINDS],
            kinds: i.tracks.iter().map(|t| t.kind as usize).collect(),
            huber: i.huber,
        }
    }

    /// The same observations, weights and components with other unknowns.
    pub(crate) fn with(&self, i: &ProblemInputs<'_>) -> Self {
        Self {
            prepared: self.prepared.clone(),
            attitude_sigma_rad: self.attitude_sigma_rad,
            height_sigma: self.height_sigma,
            departure_sigmas: self.departure_sigmas,
            weights: self.weights,
            ..Self::new(i)
        }
    }

    /// Observations.
    pub(crate) fn observations(&self) -> usize {
        self.prepared.iter().map(Vec::len).sum()
    }

    /// Tracks.
    pub(crate) fn tracks(&self) -> usize {
        self.prepared.len()
    }

    pub(crate) fn views(&self, state: &State) -> Views {
        let cameras = state.cameras.len();
        let pose = |at: usize| {
            let (frame, camera) = (&state.frames[at / cameras], at % cameras);
            let rig = (camera > 0).then(|| &state.rig[camera]);
            Pose::of(self.scene, &state.groups[frame.group], frame, rig)
        };
        Views {
            cameras,
            projectors: state.cameras.iter().map(Projector::new).collect(),
            poses: (0..cameras * state.frames.len()).map(pose).collect(),
        }
    }

    /// Gives the origins the height 1, whatever that of their groups.
    pub(crate) fn hold_units(&self, state: &mut State) {
        for &v in &self.layout.units {
            let group = state.frames[v].group;
            if self.layout.groups[group].column(GROUP_HEIGHT).is_none() {
                state.groups[group].ln_height = 0.0;
            }
            state.frames[v].ln_height_ratio = -state.groups[group].ln_height;
        }
    }

    /// Points as the first image of each track shows them; `None` where the lens folds over.
    pub(crate) fn points_from_first_images(&self, state: &State) -> Option<Vec<Vector3<f64>>> {
        let views = self.views(state);
        let mut points = vec![Vector3::z(); self.prepared.len()];
        for c in &self.clusters {
            let (projector, pose) = views.of(c.images[0]);
            for &t in &c.tracks {
                let first = &self.prepared[t][0];
                points[t] = projector.point_of(pose, &first.pixel, first.row)?;
            }
        }
        Some(points)
    }

    /// Errors of the frames' attitudes against those of their groups, but for outlier frames.
    pub(crate) fn attitude_errors(&self, state: &State) -> Vec<RandomEffect> {
        self.attitudes_of_frames(state, |frame| !self.outlier_frames.contains(&frame))
    }

    /// The same of outlier frames.
    fn outlier_attitude_errors(&self, state: &State) -> Vec<RandomEffect> {
        self.attitudes_of_frames(state, |frame| self.outlier_frames.contains(&frame))
    }

    fn attitudes_of_frames(&self, state: &State, wanted: impl Fn(usize) -> bool) -> Vec<RandomEffect> {
        let of_frame = |(v, f): (usize, &crate::refine::blocks::FrameState)| {
            let block = &self.layout.frames[v];
            let effect = |axis: usize| {
                block.column(axis).map(|column| RandomEffect { column, sign: 1.0, value: f.delta_rad[axis] })
            };
            [effect(0), effect(1)]
        };
        state.frames.iter().enumerate().filter(|(v, _)| wanted(*v)).flat_map(of_frame).flatten().collect()
    }

    /// Errors of the frames' heights against those of their groups. The height of a unit is 1: what it differs from its group's is
    /// what the group's is away from 1.
    pub(crate) fn height_errors(&self, state: &State) -> Vec<RandomEffect> {
        if self.scene == SceneModel::Directions {
            return Vec::new();
        }
        let own = state.frames.iter().enumerate().filter_map(|(v, f)| {
            Some(RandomEffect { column: self.layout.height_column(v)?, sign: 1.0, value: f.ln_height_ratio })
        });
        let units = self.layout.units.iter().filter_map(|&v| {
            let g = state.frames[v].group;
            let column = self.layout.groups[g].column(GROUP_HEIGHT)?;
            Some(RandomEffect { column, sign: -1.0, value: -state.groups[g].ln_height })
        });
        own.chain(units).collect()
    }

    /// Departures of one kind of the frames' pictures from those of the others.
    pub(crate) fn departures(&self, state: &State, kind: DepartureKind) -> Vec<RandomEffect> {
        let of_frame = |(f, block): (&crate::refine::blocks::FrameState, &crate::refine::layout::Block)| {
            let numbers = f.departure.numbers();
            let effect =
                |n: usize| Some(RandomEffect { column: block.column(n)?, sign: 1.0, value: numbers[n - FRAME_POSE] });
            kind.numbers().filter_map(effect).collect::<Vec<_>>()
        };
        state.frames.iter().zip(&self.layout.frames).flat_map(of_frame).collect()
    }

    /// Every prior: by how much its number is off the mean, and its standard deviation.
    pub(crate) fn priors(&self, state: &State) -> Vec<(RandomEffect, f64)> {
        let mut out = Vec::new();
        for ((camera, unknowns), block) in state.cameras.iter().zip(&self.cameras).zip(&self.layout.cameras) {
            let numbers = camera.numbers();
            for (number, column) in block.free() {
                if let Some((mean, sigma)) = unknowns.prior(number) {
                    out.push((RandomEffect { column, sign: 1.0, value: numbers[number] - mean }, sigma));
                }
            }
        }
        let with = |sigma: f64| move |d: RandomEffect| (d, sigma.max(MIN_PRIOR_SIGMA));
        out.extend(self.attitude_errors(state).into_iter().map(with(self.attitude_sigma_rad)));
        out.extend(self.outlier_attitude_errors(state).into_iter().map(with(OUTLIER_ATTITUDE_SIGMA_RAD)));
        out.extend(self.height_errors(state).into_iter().map(with(self.height_sigma)));
        for (kind, sigma) in DepartureKind::ALL.into_iter().zip(self.departure_sigmas) {
            out.extend(self.departures(state, kind).into_iter().map(with(sigma)));
        }
        out
    }

    /// Information of the priors by column.
    pub(crate) fn prior_information(&self, state: &State) -> Vec<(usize, f64)> {
        self.priors(state).into_iter().map(|(d, sigma)| (d.column, 1.0 / (sigma * sigma))).collect()
    }

    /// Weighted squared residual of each observation of each track (weights of the loss not applied), from the residuals with them.
    pub(crate) fn squared_residuals(&self, residuals: &[Vec<Vector2<f64>>]) -> Vec<Vec<f64>> {
        let of_track = |(seen, residuals): (&Vec<PreparedObservation>, &Vec<Vector2<f64>>)| {
            seen.iter().zip(residuals).map(|(s, r)| r.norm_squared() / s.robust).collect()
        };
        self.prepared.iter().zip(residuals).map(of_track).collect()
    }

    fn part(&self, cluster: usize, tracks: &[usize], state: &State, views: &Views) -> Option<Part> {
        let c = &self.clusters[cluster];
        let mut part = Part::new(cluster, c.columns.len(), tracks.len());
        let mut rows = TrackRows::new(c);
        for &t in tracks {
            let squared = self.linearise_track((c, t), state, views, &mut rows, |_, _, _| {})?;
            part.add_cost(0.5 * squared);
            part.keep_residuals(&rows, c.images.len());
            part.eliminate(t, &mut rows, &c.places)?;
        }
        part.finish(c);
        Some(part)
    }

    /// The rows of a track of a cluster; returns the sum of its squared residuals, weighted. `also` is told of each observation, by its
    /// index, how it is projected, and the root of its weight: upper triangular (a, b; 0, d).
    #[inline(always)]
    pub(crate) fn linearise_track(
        &self,
        (c, t): (&Cluster, usize),
        state: &State,
        views: &Views,
        rows: &mut TrackRows,
        mut also: impl FnMut(usize, &Projection, [f64; 3]),
    ) -> Option<f64> {
        rows.clear();
        let q = &state.points[t];
        let tangent = tangent_of(q);
        let weight = self.weights[self.kinds[t]];
        let mut squared = 0.0;
        for (o, (s, places)) in self.prepared[t].iter().zip(&c.places).enumerate() {
            let (projector, pose) = views.of(c.images[o]);
            let p = project_with_derivatives(projector, pose, q, s.row)?;
            let w = (weight * s.robust).sqrt();
            let r = s.whitened(&(p.pixel - s.pixel)) * w;
            squared += r.norm_squared();
            let root = s.whiten.map(|u| u * w);
            let mut row = rows.of_observation(o);
            row.add_block(p.by_camera.as_slice(), &places.camera, root);
            if !places.rig.is_empty() {
                row.add_block(p.by_rig().as_slice(), &places.rig, root);
            }
            row.add_block(p.by_group.as_slice(), &places.group, root);
            row.add_block(p.by_frame.as_slice(), &places.frame, root);
            if !places.departures.is_empty() {
                row.add_block(p.by_departures(s.row).as_slice(), &places.departures, root);
            }
            for (k, direction) in tangent.iter().enumerate() {
                let by = p.by_point * direction;
                row.set_point(k, (by.x, by.y), root);
            }
            row.set_residual(r.x, r.y);
            also(o, &p, root);
        }
        Some(squared)
    }

    pub(crate) fn chunks(&self) -> Vec<(usize, &[usize])> {
        self.clusters.iter().enumerate().flat_map(|(i, c)| c.tracks.chunks(CHUNK).map(move |t| (i, t))).collect()
    }
}

impl LeastSquares for Problem {
    type State = State;
    type Linearised = Reduced;

    fn cost(&self, state: &State) -> Option<f64> {
        let views = self.views(state);
        let of_tracks = |(cluster, tracks): &(usize, &[usize])| {
            let c = &self.clusters[*cluster];
            let mut cost = 0.0;
            for &t in *tracks {
                for (s, &image) in self.prepared[t].iter().zip(&c.images) {
                    let r = s.whitened(&(views.project(image, &state.points[t], s)? - s.pixel));
                    cost += 0.5 * self.weights[self.kinds[t]] * s.robust * r.norm_squared();
                }
            }
            Some(cost)
        };
        let parts: Vec<Option<f64>> = self.chunks().par_iter().map(of_tracks).collect();
        let mut total: f64 = self.priors(state).iter().map(|(d, sigma)| 0.5 * (d.value / sigma).powi(2)).sum();
        for part in parts {
            total += part?;
        }
        total.is_finite().then_some(total)
    }

    fn linearise(&self, state: &State) -> Option<Reduced> {
        let views = self.views(state);
        let parts: Vec<Option<Part>> =
            self.chunks().par_iter().map(|(c, tracks)| self.part(*c, tracks, state, &views)).collect();
        let parts: Vec<Part> = parts.into_iter().collect::<Option<_>>()?;
        let mut reduced = Reduced::new(parts, &self.clusters, self.first.clone(), self.prepared.len());
        for (d, sigma) in self.priors(state) {
            reduced.add_prior(d.column, d.sign, d.value, sigma);
        }
        use crate::numerics::levenberg_marquardt::Linearisation;
        reduced.cost().is_finite().then_some(reduced)
    }

    fn retract(&self, state: &State, step: &DVector<f64>) -> State {
        let at = |column: Option<usize>| column.map_or(0.0, |c| step[c]);
        let mut moved = state.clone();
        for (camera, block) in moved.cameras.iter_mut().zip(&self.layout.cameras) {
            *camera = camera.moved(block.free().map(|(number, column)| (number, step[column])));
        }
        for (pose, block) in moved.rig.iter_mut().zip(&self.layout.rig) {
            if block.size > 0 {
                *pose = pose.moved(&SVector::from_fn(|number, _| at(block.column(number))));
            }
        }
        for (g, block) in moved.groups.iter_mut().zip(&self.layout.groups) {
            g.attitude = g.turned([at(block.column(0)), at(block.column(1))]);
            g.ln_height += at(block.column(GROUP_HEIGHT));
        }
        for (f, block) in moved.frames.iter_mut().zip(&self.layout.frames) {
            f.delta_rad[0] += at(block.column(0));
            f.delta_rad[1] += at(block.column(1));
            f.yaw_rad += at(block.column(2));
            f.position += Vector2::new(at(block.column(3)), at(block.column(4)));
            f.ln_height_ratio += at(block.column(5));
            let numbers = f.departure.numbers();
            f.departure =
                Departure::from_numbers(std::array::from_fn(|n| numbers[n] + at(block.column(FRAME_POSE + n))));
        }
        self.hold_units(&mut moved);
        let n = self.layout.size;
        for (t, q) in moved.points.iter_mut().enumerate() {
            let [u, v] = tangent_of(q);
            *q = (*q + u * step[n + 2 * t] + v * step[n + 2 * t + 1]).normalize();
        }
        moved
    }
}
