//! The least squares problem of the joint refinement: linearisation, elimination of the points, priors and weights.
//!
//! A track's residuals r with their derivatives J by cameras and views and P by its point are multiplied by Qᵀ of P = Q R; the
//! rows below R do not contain the point any more and make the reduced normal equations (the Schur complement, Triggs et al.
//! 2000, in its numerically better square-root form; of long tracks JᵀJ less the rows of R), the rows of R give the point back.

use std::collections::BTreeMap;

use nalgebra::{DVector, Matrix2, Vector2, Vector3};
use rayon::prelude::*;

use crate::numerics::{
    levenberg_marquardt::{DampedStep, LeastSquares, Linearisation},
    statistics::chi_squared_survival,
};
use crate::{
    numerics::skyline::Skyline,
    refine::{
        layout::{Cluster, HELD, Ingredients, Layout, cluster, components_of, lay_out},
        model::{
            CAMERA, CameraVector, GroupState, Pose, Projector, SceneModel, ViewState, project_with_derivatives,
            tangent_of,
        },
        tracks::KINDS,
    },
};

/// Everything that is estimated.
#[derive(Debug, Clone)]
pub struct State {
    /// Camera matrix and lens.
    pub camera: CameraVector,
    /// Attitude groups.
    pub groups: Vec<GroupState>,
    /// Views.
    pub views: Vec<ViewState>,
    /// A unit vector for each track.
    pub points: Vec<Vector3<f64>>,
}

/// An observation, ready for use.
#[derive(Debug, Clone, Copy)]
struct Seen {
    pixel: Vector2<f64>,
    /// Upper triangular root of the information: |whiten r|² = rᵀ Λ r.
    whiten: [f64; 3],
    /// Less than 1 where the residual was too large to count in full.
    robust: f64,
}

/// Gaussian prior on one column: (mean, standard deviation) of the number it stands for.
pub type Prior = (f64, f64);

/// The problem.
#[derive(Debug, Clone)]
pub struct Problem {
    scene: SceneModel,
    tangential: [f64; 2],
    seen: Vec<Vec<Seen>>,
    clusters: Vec<Cluster>,
    /// Columns.
    pub layout: Layout,
    first: Vec<usize>,
    /// Priors of the camera's numbers.
    pub camera_priors: [Option<Prior>; CAMERA],
    /// Deviation of each view's attitude about each of two axes, radians.
    pub attitude_sigma_rad: f64,
    /// Relative deviation of each view's height from that of its group.
    pub height_sigma: f64,
    /// Factors on the information of the observations of each kind.
    pub weights: [f64; KINDS],
    /// Kind of each track.
    kinds: Vec<usize>,
    /// Views whose height is the unit of length: 1 by definition.
    origins: Vec<usize>,
    /// Residuals beyond this many deviations count less (Huber).
    huber: f64,
}

/// Least deviation of attitudes (radians) and heights (relative): what is said to be exact is held this stiffly.
pub const STIFF: f64 = 1e-7;

/// Cells along each side of an image, and the fewest points of one, for residuals that neighbours have in common.
const CELLS: usize = 4;
const CELL_COUNT: usize = 3;
/// Probability below which what they have in common is not put down to chance.
const DESIGN_EFFECT_P: f64 = 0.01;

/// Sum of the residuals in a part of an image.
#[derive(Debug, Clone, Copy, Default)]
struct Cell {
    sum: Vector2<f64>,
    /// Expected mean square of each of its coordinates, if they were independent.
    variance: f64,
    count: usize,
}

/// Observations of a track from which on its elimination is a subtraction.
const LONG_TRACK: usize = 5;

/// Tracks of a cluster that are worked on at once.
const CHUNK: usize = 64;

impl Problem {
    /// Orders the unknowns and prepares the observations.
    pub fn new(i: &Ingredients<'_>) -> Self {
        let views = i.group_of_view.len();
        let components = components_of(views, i.tracks);
        let (layout, origins) = lay_out(i, &components);
        let scale = i.frame.scale_px;
        let seen = i
            .tracks
            .iter()
            .map(|t| {
                t.observations
                    .iter()
                    .map(|o| Seen {
                        pixel: i.frame.from_pixel(&o.pixel),
                        whiten: root(&(o.information * scale * scale)),
                        robust: 1.0,
                    })
                    .collect()
            })
            .collect();
        let clusters = cluster(i, &layout, &origins);
        let mut first: Vec<usize> = (0..layout.size).collect();
        for c in &clusters {
            let least = c.columns.iter().copied().min().unwrap_or(0);
            for &column in &c.columns {
                first[column] = first[column].min(least);
            }
        }
        Self {
            scene: i.scene,
            tangential: i.tangential,
            seen,
            clusters,
            layout,
            first,
            camera_priors: i.camera_priors,
            attitude_sigma_rad: STIFF,
            height_sigma: 1.0,
            weights: [1.0; KINDS],
            kinds: i.tracks.iter().map(|t| t.kind as usize).collect(),
            origins,
            huber: i.huber,
        }
    }

    /// Observations.
    pub fn observations(&self) -> usize {
        self.seen.iter().map(Vec::len).sum()
    }

    /// Degrees of freedom of each kind before cameras and views are counted: two an observation less two a track.
    pub fn redundancies(&self) -> [usize; KINDS] {
        let mut out = [0; KINDS];
        for (seen, &kind) in self.seen.iter().zip(&self.kinds) {
            out[kind] += 2 * (seen.len() - 1);
        }
        out
    }

    /// Tracks.
    pub fn tracks(&self) -> usize {
        self.seen.len()
    }

    fn projector(&self, state: &State) -> Projector {
        Projector::new(&state.camera, self.tangential)
    }

    fn poses(&self, state: &State) -> Vec<Pose> {
        state.views.iter().map(|v| Pose::new(self.scene, &state.groups[v.group], v)).collect()
    }

    /// Gives the origins the height 1, whatever that of their groups.
    pub fn hold_origins(&self, state: &mut State) {
        for &v in &self.origins {
            state.views[v].ln_height_ratio = -state.groups[state.views[v].group].ln_height;
        }
    }

    /// Points as the first view of each track sees them; `None` where the lens folds over.
    pub fn points_from_first_views(&self, state: &State) -> Option<Vec<Vector3<f64>>> {
        let (projector, poses) = (self.projector(state), self.poses(state));
        let mut points = vec![Vector3::z(); self.seen.len()];
        for c in &self.clusters {
            for &t in &c.tracks {
                points[t] = poses[c.views[0]].back_project(&projector.ray(&self.seen[t][0].pixel)?);
            }
        }
        Some(points)
    }

    /// Every prior as (column, sign, value, deviation): what `sign` times the column's step adds to.
    fn priors(&self, state: &State) -> Vec<(usize, f64, f64, f64)> {
        let mut out = Vec::new();
        for (k, prior) in self.camera_priors.iter().enumerate() {
            if let Some((mean, sigma)) = prior
                && Layout::is_free(self.layout.camera[k])
            {
                out.push((self.layout.camera[k], 1.0, state.camera[k] - mean, *sigma));
            }
        }
        let attitude = self.attitude_sigma_rad.max(STIFF);
        let height = self.height_sigma.max(STIFF);
        for (v, columns) in self.layout.views.iter().enumerate() {
            let view = &state.views[v];
            for (column, delta) in columns.iter().zip(view.delta_rad) {
                if Layout::is_free(*column) {
                    out.push((*column, 1.0, delta, attitude));
                }
            }
            if Layout::is_free(columns[5]) {
                out.push((columns[5], 1.0, view.ln_height_ratio, height));
            }
        }
        // The height of an origin is 1: what it strays from its group's is what the group's is away from 1.
        for &v in &self.origins {
            let g = state.views[v].group;
            let column = self.layout.groups[g][2];
            if self.scene == SceneModel::Floor && Layout::is_free(column) {
                out.push((column, -1.0, -state.groups[g].ln_height, height));
            }
        }
        out
    }

    /// Columns of the views' attitude errors.
    pub fn attitude_columns(&self) -> Vec<usize> {
        self.layout.views.iter().flat_map(|c| [c[0], c[1]]).filter(|c| Layout::is_free(*c)).collect()
    }

    /// Columns of the heights' deviations, with the sign in which they count.
    pub fn height_columns(&self, state: &State) -> Vec<(usize, f64)> {
        if self.scene == SceneModel::Directions {
            return Vec::new();
        }
        let own = self.layout.views.iter().map(|c| (c[5], 1.0));
        let origins = self.origins.iter().map(|&v| (self.layout.groups[state.views[v].group][2], -1.0));
        own.chain(origins).filter(|(c, _)| Layout::is_free(*c)).collect()
    }

    /// Information of the priors by column.
    pub fn prior_information(&self, state: &State) -> Vec<(usize, f64)> {
        self.priors(state).into_iter().map(|(c, _, _, sigma)| (c, 1.0 / (sigma * sigma))).collect()
    }

    /// Weighted squared residual of each observation of each track (weights of the loss not applied).
    pub fn squared_residuals(&self, state: &State) -> Option<Vec<Vec<f64>>> {
        let (projector, poses) = (self.projector(state), self.poses(state));
        let mut out: Vec<Vec<f64>> = vec![Vec::new(); self.seen.len()];
        for c in &self.clusters {
            for &t in &c.tracks {
                for (s, &v) in self.seen[t].iter().zip(&c.views) {
                    let pixel = projector.project(&poses[v].camera_point(&state.points[t]))?;
                    out[t].push(self.weights[self.kinds[t]] * whitened(s, &(pixel - s.pixel)).norm_squared());
                }
            }
        }
        Some(out)
    }

    /// Deviations of the heights, in the order of [`Self::height_columns`].
    pub fn height_deviations(&self, state: &State) -> Vec<f64> {
        let own = self.layout.views.iter().zip(&state.views).map(|(c, v)| (c[5], v.ln_height_ratio));
        let origins = self.origins.iter().map(|&v| {
            let g = state.views[v].group;
            (self.layout.groups[g][2], -state.groups[g].ln_height)
        });
        own.chain(origins).filter(|(c, _)| Layout::is_free(*c)).map(|(_, value)| value).collect()
    }

    /// How much more the residuals of neighbouring points of each kind have in common than independent ones would: the mean square
    /// of sums over cells of the images, by its expectation from the `variances` of single residuals. A lens or a floor that is
    /// not quite as the model says, and matching errors that depend on the perspective, show in it where the size of single
    /// residuals does not. 1 where the difference may be chance.
    pub fn design_effects(
        &self,
        state: &State,
        image_half_sides: [f64; 2],
        variances: [f64; KINDS],
    ) -> Option<[f64; KINDS]> {
        let (projector, poses) = (self.projector(state), self.poses(state));
        let mut cells: BTreeMap<[usize; 3], [Cell; CELLS * CELLS]> = BTreeMap::new();
        for c in &self.clusters {
            let share = (c.views.len() as f64 - 1.0) / c.views.len() as f64;
            for &t in &c.tracks {
                let kind = self.kinds[t];
                for (s, &v) in self.seen[t].iter().zip(&c.views).skip(1) {
                    let pixel = projector.project(&poses[v].camera_point(&state.points[t]))?;
                    let r = whitened(s, &(pixel - s.pixel)) * (self.weights[kind] * s.robust).sqrt();
                    let place =
                        |x: f64, half: f64| ((0.5 * (x / half + 1.0) * CELLS as f64).max(0.0) as usize).min(CELLS - 1);
                    let at = place(s.pixel.y, image_half_sides[1]) * CELLS + place(s.pixel.x, image_half_sides[0]);
                    let cell = &mut cells.entry([kind, c.views[0], v]).or_default()[at];
                    cell.sum += r;
                    cell.variance += share * variances[kind];
                    cell.count += 1;
                }
            }
        }
        let (mut squares, mut expected, mut degrees_of_freedom) = ([0.0; KINDS], [0.0; KINDS], [0.0; KINDS]);
        for ([kind, _, _], pair) in &cells {
            let full = || pair.iter().filter(|c| c.count >= CELL_COUNT);
            let numbers = 2.0 * full().count() as f64;
            // What a homography of its own would follow is not in the residuals.
            let left = numbers - 8.0;
            if left <= 0.0 {
                continue;
            }
            squares[*kind] += full().map(|c| c.sum.norm_squared()).sum::<f64>();
            expected[*kind] += 2.0 * full().map(|c| c.variance).sum::<f64>() * left / numbers;
            degrees_of_freedom[*kind] += left;
        }
        Some(std::array::from_fn(|k| {
            let (ratio, dof) = (squares[k] / expected[k], degrees_of_freedom[k]);
            let chance = chi_squared_survival(ratio * dof, dof.round() as usize);
            if dof >= 1.0 && ratio > 1.0 && chance < DESIGN_EFFECT_P { ratio } else { 1.0 }
        }))
    }

    /// Sets the weight of each observation to Huber's (1964) for its squared residual. Between two calls the problem is one of
    /// plain least squares (iteratively reweighted), which converges in a few steps.
    ///
    /// `scales` multiplies the residuals of each kind beforehand.
    pub fn reweight(&mut self, squared_residuals: &[Vec<f64>], scales: [f64; KINDS]) {
        for ((seen, residuals), &kind) in self.seen.iter_mut().zip(squared_residuals).zip(&self.kinds) {
            // The point follows the observations: a residual is smaller than the error by this much.
            let limit = self.huber * self.huber * (seen.len() as f64 - 1.0) / seen.len() as f64;
            for (s, r) in seen.iter_mut().zip(residuals) {
                let r = r * scales[kind];
                s.robust = if r > limit { (limit / r).sqrt() } else { 1.0 };
            }
        }
    }

    /// Sums of the squared residuals of each kind with the weights in force.
    pub fn weighted_sums(&self, squared_residuals: &[Vec<f64>]) -> [f64; KINDS] {
        let mut sums = [0.0; KINDS];
        for ((seen, residuals), &kind) in self.seen.iter().zip(squared_residuals).zip(&self.kinds) {
            sums[kind] += seen.iter().zip(residuals).map(|(s, r)| s.robust * r).sum::<f64>();
        }
        sums
    }
}

fn whitened(s: &Seen, r: &Vector2<f64>) -> Vector2<f64> {
    Vector2::new(s.whiten[0] * r.x + s.whiten[1] * r.y, s.whiten[2] * r.y)
}

/// Upper triangular U with UᵀU = m.
fn root(m: &Matrix2<f64>) -> [f64; 3] {
    let a = m[(0, 0)].max(f64::MIN_POSITIVE).sqrt();
    let b = m[(0, 1)] / a;
    [a, b, (m[(1, 1)] - b * b).max(0.0).sqrt()]
}

/// What gives a track's point back once the cameras' step is known.
struct Elimination {
    track: usize,
    /// R, upper triangular: (0,0), (0,1), (1,1).
    r: [f64; 3],
    /// Qᵀ r, the first two rows.
    right: [f64; 2],
}

/// A chunk's part of the reduced equations.
struct Part {
    cluster: usize,
    cost: f64,
    /// Half the squared residual that the points alone take away.
    by_points: f64,
    /// Lower triangle by rows.
    information: Vec<f64>,
    gradient: Vec<f64>,
    eliminations: Vec<Elimination>,
    /// Two rows of Qᵀ J a track, one after the other.
    rows: Vec<f64>,
}

impl Part {
    /// Adds (or takes away) the outer product of a row of J and its product with the residual.
    fn add(&mut self, j: &[f64], r: f64, sign: f64) {
        let mut at = 0;
        for (i, &value) in j.iter().enumerate() {
            let value = sign * value;
            self.gradient[i] += value * r;
            for (sum, other) in self.information[at..=at + i].iter_mut().zip(j) {
                *sum += value * other;
            }
            at += i + 1;
        }
    }

    /// The same for a row that has entries at `occupied` only, ascending.
    fn add_sparse(&mut self, j: &[f64], occupied: &[usize], r: f64) {
        for (k, &row) in occupied.iter().enumerate() {
            let value = j[row];
            self.gradient[row] += value * r;
            let start = row * (row + 1) / 2;
            for &column in &occupied[..=k] {
                self.information[start + column] += value * j[column];
            }
        }
    }
}

/// The problem linearised, points eliminated.
pub struct Reduced {
    cost: f64,
    by_points: f64,
    /// Information of the columns.
    pub information: Skyline,
    gradient: DVector<f64>,
    parts: Vec<Part>,
    columns: Vec<Vec<usize>>,
    points: usize,
}

impl Linearisation for Reduced {
    fn cost(&self) -> f64 {
        self.cost
    }

    fn solve(&self, lambda: f64) -> Option<DampedStep> {
        let n = self.information.size();
        let step = self.information.cholesky(lambda)?.solve(&(-&self.gradient));
        let predicted_decrease =
            self.by_points - self.gradient.dot(&step) - 0.5 * step.dot(&self.information.product(&step));
        let mut all = DVector::zeros(n + 2 * self.points);
        all.rows_mut(0, n).copy_from(&step);
        for part in &self.parts {
            let columns = &self.columns[part.cluster];
            let local: Vec<f64> = columns.iter().map(|&c| step[c]).collect();
            for (e, rows) in part.eliminations.iter().zip(part.rows.chunks_exact(2 * columns.len())) {
                let (first, second) = rows.split_at(columns.len());
                let along = |row: &[f64]| -> f64 { row.iter().zip(&local).map(|(a, b)| a * b).sum() };
                let (u, v) = (-(e.right[0] + along(first)), -(e.right[1] + along(second)));
                let b = v / e.r[2];
                all[n + 2 * e.track] = (u - e.r[1] * b) / e.r[0];
                all[n + 2 * e.track + 1] = b;
            }
        }
        Some(DampedStep { step: all, predicted_decrease })
    }
}

impl Problem {
    fn part(
        &self,
        cluster: usize,
        tracks: &[usize],
        state: &State,
        projector: &Projector,
        poses: &[Pose],
    ) -> Option<Part> {
        let c = &self.clusters[cluster];
        let (m, n) = (c.views.len(), c.columns.len());
        let width = n + 3; // J, P, r
        let mut part = Part {
            cluster,
            cost: 0.0,
            by_points: 0.0,
            information: vec![0.0; n * (n + 1) / 2],
            gradient: vec![0.0; n],
            eliminations: Vec::with_capacity(tracks.len()),
            rows: Vec::with_capacity(2 * n * tracks.len()),
        };
        let mut rows = vec![0.0; 2 * m * width];
        let mut scratch = Vec::new();
        for &t in tracks {
            rows.fill(0.0);
            let q = &state.points[t];
            let tangent = tangent_of(q);
            for (o, (s, &v)) in self.seen[t].iter().zip(&c.views).enumerate() {
                let p = project_with_derivatives(projector, &poses[v], q)?;
                let r = whitened(s, &(p.pixel - s.pixel));
                let w = (self.weights[self.kinds[t]] * s.robust).sqrt();
                part.cost += 0.5 * w * w * r.norm_squared();
                let [a, b, d] = s.whiten.map(|u| u * w);
                let (top, bottom) = rows[2 * o * width..(2 * o + 2) * width].split_at_mut(width);
                for (slot, &at) in c.place[o].iter().enumerate() {
                    if at != HELD {
                        let (x, y) = (p.by_slots[(0, slot)], p.by_slots[(1, slot)]);
                        top[at] += a * x + b * y;
                        bottom[at] += d * y;
                    }
                }
                for (k, direction) in tangent.iter().enumerate() {
                    let by = p.by_point * direction;
                    top[n + k] = a * by.x + b * by.y;
                    bottom[n + k] = d * by.y;
                }
                (top[n + 2], bottom[n + 2]) = (r.x * w, r.y * w);
            }
            // Of a long track each row has few entries before the elimination and many after: there the two rows of R are taken
            // from the sum of all, elsewhere the rows that are left are summed.
            let long = m > LONG_TRACK;
            if long {
                for (o, pair) in rows.chunks_exact(2 * width).enumerate() {
                    for row in pair.chunks_exact(width) {
                        part.add_sparse(row, &c.occupied[o], row[n + 2]);
                    }
                }
            }
            let e = eliminate(&mut rows, width, n, &mut scratch)?;
            part.by_points += 0.5 * (e[3] * e[3] + e[4] * e[4]);
            part.eliminations.push(Elimination { track: t, r: [e[0], e[1], e[2]], right: [e[3], e[4]] });
            part.rows.extend_from_slice(&rows[..n]);
            part.rows.extend_from_slice(&rows[width..width + n]);
            if long {
                for row in rows.chunks_exact(width).take(2) {
                    part.add(&row[..n], row[n + 2], -1.0);
                }
            } else {
                for row in rows.chunks_exact(width).skip(2) {
                    part.add(&row[..n], row[n + 2], 1.0);
                }
            }
        }
        Some(part)
    }

    fn chunks(&self) -> Vec<(usize, &[usize])> {
        self.clusters.iter().enumerate().flat_map(|(i, c)| c.tracks.chunks(CHUNK).map(move |t| (i, t))).collect()
    }
}

/// Two Householder reflections that make the columns n and n + 1 (the point's) upper triangular; returns R by rows and the two
/// first entries of the residual column. `None` when the point is not determined.
fn eliminate(rows: &mut [f64], width: usize, n: usize, scratch: &mut Vec<f64>) -> Option<[f64; 5]> {
    let count = rows.len() / width;
    let mut diagonal = [0.0; 2];
    for (k, alpha) in diagonal.iter_mut().enumerate() {
        let column = n + k;
        let norm = (k..count).map(|i| rows[i * width + column].powi(2)).sum::<f64>().sqrt();
        if norm.is_nan() || norm <= f64::MIN_POSITIVE {
            return None;
        }
        let head = rows[k * width + column];
        *alpha = if head > 0.0 { -norm } else { norm };
        // v = column - alpha e_k, vᵀv / 2 = norm (norm + |head|).
        let beta = 1.0 / (norm * (norm + head.abs()));
        scratch.clear();
        scratch.resize(width + count, 0.0);
        let (sums, v) = scratch.split_at_mut(width);
        for i in k..count {
            v[i] = rows[i * width + column];
        }
        v[k] -= *alpha;
        for (row, weight) in rows.chunks_exact(width).zip(v.iter()).skip(k) {
            for (sum, value) in sums.iter_mut().zip(row) {
                *sum += weight * value;
            }
        }
        for (row, weight) in rows.chunks_exact_mut(width).zip(v.iter()).skip(k) {
            let factor = beta * weight;
            for (value, sum) in row.iter_mut().zip(sums.iter()) {
                *value -= factor * sum;
            }
        }
    }
    Some([diagonal[0], rows[n + 1], diagonal[1], rows[n + 2], rows[width + n + 2]])
}

impl LeastSquares for Problem {
    type State = State;
    type Linearised = Reduced;

    fn cost(&self, state: &State) -> Option<f64> {
        let (projector, poses) = (self.projector(state), self.poses(state));
        let chunks = self.chunks();
        let parts: Vec<Option<f64>> = chunks
            .par_iter()
            .map(|(cluster, tracks)| {
                let c = &self.clusters[*cluster];
                let mut cost = 0.0;
                for &t in *tracks {
                    for (s, &v) in self.seen[t].iter().zip(&c.views) {
                        let pixel = projector.project(&poses[v].camera_point(&state.points[t]))?;
                        let r = whitened(s, &(pixel - s.pixel));
                        cost += 0.5 * self.weights[self.kinds[t]] * s.robust * r.norm_squared();
                    }
                }
                Some(cost)
            })
            .collect();
        let mut total: f64 = self.priors(state).iter().map(|(_, _, value, sigma)| 0.5 * (value / sigma).powi(2)).sum();
        for part in parts {
            total += part?;
        }
        total.is_finite().then_some(total)
    }

    fn linearise(&self, state: &State) -> Option<Reduced> {
        let (projector, poses) = (self.projector(state), self.poses(state));
        let chunks = self.chunks();
        let parts: Vec<Option<Part>> =
            chunks.par_iter().map(|(c, tracks)| self.part(*c, tracks, state, &projector, &poses)).collect();
        let parts: Vec<Part> = parts.into_iter().collect::<Option<_>>()?;
        let mut information = Skyline::zeros(self.first.clone());
        let mut gradient = DVector::zeros(self.layout.size);
        let (mut cost, mut by_points) = (0.0, 0.0);
        for part in &parts {
            cost += part.cost;
            by_points += part.by_points;
            let columns = &self.clusters[part.cluster].columns;
            let mut values = part.information.iter();
            for (i, &row) in columns.iter().enumerate() {
                gradient[row] += part.gradient[i];
                for (&column, value) in columns[..=i].iter().zip(&mut values) {
                    information.add(row, column, *value);
                }
            }
        }
        for (column, sign, value, sigma) in self.priors(state) {
            let weight = 1.0 / (sigma * sigma);
            cost += 0.5 * weight * value * value;
            gradient[column] += sign * weight * value;
            information.add(column, column, weight);
        }
        cost.is_finite().then(|| Reduced {
            cost,
            by_points,
            information,
            gradient,
            parts,
            columns: self.clusters.iter().map(|c| c.columns.clone()).collect(),
            points: self.seen.len(),
        })
    }

    fn retract(&self, state: &State, step: &DVector<f64>) -> State {
        let at = |column: usize| if Layout::is_free(column) { step[column] } else { 0.0 };
        let mut moved = state.clone();
        for (k, &column) in self.layout.camera.iter().enumerate() {
            moved.camera[k] += at(column);
        }
        for (g, columns) in moved.groups.iter_mut().zip(&self.layout.groups) {
            g.attitude = g.turned([at(columns[0]), at(columns[1])]);
            g.ln_height += at(columns[2]);
        }
        for (v, columns) in moved.views.iter_mut().zip(&self.layout.views) {
            v.delta_rad[0] += at(columns[0]);
            v.delta_rad[1] += at(columns[1]);
            v.yaw_rad += at(columns[2]);
            v.position += Vector2::new(at(columns[3]), at(columns[4]));
            v.ln_height_ratio += at(columns[5]);
        }
        self.hold_origins(&mut moved);
        let n = self.layout.size;
        for (t, q) in moved.points.iter_mut().enumerate() {
            let [u, v] = tangent_of(q);
            *q = (*q + u * step[n + 2 * t] + v * step[n + 2 * t + 1]).normalize();
        }
        moved
    }
}
