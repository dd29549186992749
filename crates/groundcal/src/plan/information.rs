//! What one motion says of the camera: its Fisher information with everything of its own eliminated.
//!
//! ```text
//! Λ_m = C − Bᵀ A⁻¹ B
//! ```
//!
//! C, B, A: camera, cross and motion blocks of the normal equations of the joint refinement ([`crate::refine::problem`]: floor
//! points eliminated, priors on the views' attitudes and heights included), linearised at the motion as planned. The points stand
//! on a grid over the first image, each for its share of the matches.

use nalgebra::{DMatrix, DVector, Matrix2, Vector2, Vector3};

use crate::{
    geometry::{
        attitude::{attitude_rotation, yaw_rotation},
        frame::Frame,
        size::ImageSize,
    },
    numerics::{levenberg_marquardt::LeastSquares, linalg::inverse_spd},
    plan::candidate::{CameraMatrix, Free},
    refine::{
        blocks::{BundleOptions, CameraState, Departure, FrameState, GroupState, MATRIX, State},
        layout::ProblemInputs,
        problem::Problem,
        residual::{Pose, Projector, SceneModel},
        tracks::{Kind, Observation, Track},
    },
    synthetic::points::MotionSpec,
};

/// Columns of the grid over the image.
const GRID: usize = 24;

/// What all motions of a plan have in common.
#[derive(Debug, Clone)]
pub(super) struct Setting {
    pub(super) size: ImageSize,
    pub(super) frame: Frame,
    /// The camera as it is thought to be, frame units.
    pub(super) camera: CameraState,
    /// Which of its numbers the estimator frees.
    pub(super) free: Free,
    /// How far it lets attitudes and heights vary.
    pub(super) options: BundleOptions,
    pub(super) height_sigma: f64,
    pub(super) noise_px: f64,
    /// Matches of a motion that shows the same floor all over both images.
    pub(super) points: f64,
    /// How far the floor is seen, heights.
    pub(super) reach: f64,
}

/// World from level coordinates of a heading, on the floor.
fn along(yaw_rad: f64) -> Matrix2<f64> {
    yaw_rotation(yaw_rad).transpose().fixed_view::<2, 2>(0, 0).into_owned()
}

/// The floor that both views of a motion see.
#[derive(Debug, Clone)]
pub(super) struct Shared {
    /// Pixel in the first image (frame units), floor point.
    seen: Vec<(Vector2<f64>, Vector3<f64>)>,
    /// Fraction of the first image's floor that the second image shows too.
    pub(super) overlap: f64,
    /// Fraction of the first image that it fills.
    pub(super) fraction: f64,
}

impl Setting {
    /// The views of `links` equal motions, each of which begins where the one before ended.
    fn state(&self, spec: &MotionSpec, links: usize) -> State {
        let shift = Vector2::from(spec.shift) / spec.height;
        let frame = |yaw_rad: f64, position: Vector2<f64>| FrameState {
            group: 0,
            delta_rad: [0.0; 2],
            yaw_rad,
            position,
            ln_height_ratio: 0.0,
            departure: Departure::default(),
        };
        let mut frames = vec![frame(0.0, Vector2::zeros())];
        for i in 0..links {
            let last = frames[i];
            frames.push(frame(last.yaw_rad + spec.turn_rad, last.position + along(last.yaw_rad) * shift));
        }
        let attitude = attitude_rotation(spec.pitch_down_rad, spec.roll_rad);
        State::of_one_camera(self.camera, vec![GroupState { attitude, ln_height: 0.0 }], frames)
    }

    fn projector(&self) -> Projector {
        Projector::new(&self.camera)
    }

    /// The floor that both views see.
    pub(super) fn shared_floor(&self, spec: &MotionSpec) -> Shared {
        let state = self.state(spec, 1);
        let [a, b] = [0, 1].map(|v| Pose::new(SceneModel::Floor, &state.groups[0], &state.frames[v]));
        let projector = self.projector();
        let (w, h) = (self.size.width as f64, self.size.height as f64);
        let rows = ((GRID as f64 * h / w).round() as usize).clamp(6, 2 * GRID);
        let inside = |p: &Vector2<f64>| {
            let p = self.frame.pixel(p);
            (0.0..=w - 1.0).contains(&p.x) && (0.0..=h - 1.0).contains(&p.y)
        };
        let (mut floor, mut seen) = (0, Vec::new());
        for row in 0..rows {
            for column in 0..GRID {
                let at = |i: usize, n: usize, side: f64| (i as f64 + 0.5) / n as f64 * (side - 1.0);
                let pixel = self.frame.local(&Vector2::new(at(column, GRID, w), at(row, rows, h)));
                let Some(ray) = projector.ray(&pixel) else { continue };
                let q = a.back_project(&ray);
                // Above the horizon the homogeneous point lies behind; towards it, at any distance.
                if q.z <= 0.0 || (q.xy() / q.z - a.centre().xy()).norm() > self.reach {
                    continue;
                }
                floor += 1;
                if projector.project(&b.camera_point(&q)).is_some_and(|p| inside(&p)) {
                    seen.push((pixel, q));
                }
            }
        }
        Shared {
            overlap: if floor > 0 { seen.len() as f64 / floor as f64 } else { 0.0 },
            fraction: seen.len() as f64 / (GRID * rows) as f64,
            seen,
        }
    }

    /// What `links` equal motions of one attitude, each beginning with the last picture of the one before, say of the camera; zero
    /// rows for what the estimator holds. `None` when the equations of the motions themselves are singular.
    pub(super) fn information(&self, spec: &MotionSpec, shared: &Shared, links: usize) -> Option<CameraMatrix> {
        let mut state = self.state(spec, links);
        let count = shared.seen.len() as f64;
        let information = Matrix2::from_diagonal_element(self.points * shared.fraction / count / self.noise_px.powi(2));
        let mut tracks = Vec::with_capacity(links * shared.seen.len());
        for link in 0..links {
            let from = state.frames[link];
            for (pixel, q) in &shared.seen {
                // The normal equations take no pixel into account, only where the points are.
                let pixel = self.frame.pixel(pixel);
                let observations =
                    [link, link + 1].map(|frame| Observation { frame, camera: 0, pixel, information }).to_vec();
                tracks.push(Track { kind: Kind::Point, observations });
                let at = along(from.yaw_rad) * q.xy() + from.position * q.z;
                state.points.push(Vector3::new(at.x, at.y, q.z).normalize());
            }
        }
        let mut unknowns = self.options.cameras[0].clone();
        (unknowns.matrix_priors, unknowns.lens_priors) = ([None; MATRIX], Vec::new());
        (0..self.free.len()).for_each(|i| unknowns.set_free(i, self.free[i]));
        let mut problem = Problem::new(&ProblemInputs {
            scene: SceneModel::Floor,
            tracks: &tracks,
            state: &state,
            outlier_frames: &[],
            departures: &[],
            cameras: &[unknowns],
            huber: self.options.huber,
        });
        problem.attitude_sigma_rad = self.options.attitude_sigma_rad.unwrap_or(self.options.attitude_scale_rad);
        problem.height_sigma = self.height_sigma;
        let normal = problem.linearise(&state)?.information;
        let n = normal.size();
        let unit = |i: usize| DVector::from_fn(n, |r, _| if r == i { 1.0 } else { 0.0 });
        let columns: Vec<DVector<f64>> = (0..n).map(|i| normal.product(&unit(i))).collect();
        let camera: Vec<(usize, usize)> = problem.layout.cameras[0].free().collect();
        let own: Vec<usize> = (0..n).filter(|c| camera.iter().all(|(_, taken)| taken != c)).collect();
        let cross = DMatrix::from_fn(own.len(), camera.len(), |r, c| columns[camera[c].1][own[r]]);
        let inverse = inverse_spd(&DMatrix::from_fn(own.len(), own.len(), |r, c| columns[own[c]][own[r]]))?;
        let taken = cross.tr_mul(&(inverse * &cross));
        let mut out = CameraMatrix::zeros();
        for (r, &(i, row)) in camera.iter().enumerate() {
            for (c, &(j, column)) in camera.iter().enumerate() {
                out[(i, j)] = columns[column][row] - 0.5 * (taken[(r, c)] + taken[(c, r)]);
            }
        }
        Some(out)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        calibrate::{LensModel, Options},
        geometry::{intrinsics::Intrinsics, lens::Lens, plane_view::View},
        plan::candidate::inverse_free,
        refine::bundle::pixels_by_camera,
        start::absolute_conic::Constraint,
        synthetic::bound::{HeightModel, cramer_rao_bound},
    };

    fn free_of(options: &BundleOptions) -> Free {
        std::array::from_fn(|i| options.cameras[0].is_free(i))
    }

    /// A motion added to others that share its pictures takes no information away.
    #[test]
    fn a_chain_of_motions_is_worth_more_than_one() {
        let size = ImageSize::new(640, 480);
        let frame = Frame::new(size, None);
        let camera = CameraState::new(&Intrinsics::square(600.0, 319.5, 239.5), &Lens::radial(0.0, 0.0), &frame);
        let options = Options::default().assumptions(size);
        let setting = Setting {
            size,
            frame,
            camera,
            free: free_of(&options),
            options,
            height_sigma: 1e-3,
            noise_px: 0.3,
            points: 200.0,
            reach: 10.0,
        };
        let motion = MotionSpec::about_axis(0.6, 0.1, 0.3, 0.4, 1.0);
        let shared = setting.shared_floor(&motion);
        let [one, two, three] = [1, 2, 3].map(|n| setting.information(&motion, &shared, n).expect("regular"));
        for (less, more) in [(&one, &two), (&two, &three)] {
            let kept: Vec<usize> = (0..setting.free.len()).filter(|&i| setting.free[i]).collect();
            let gain = DMatrix::from_fn(kept.len(), kept.len(), |r, c| {
                let (i, j) = (kept[r], kept[c]);
                (more[(i, j)] - less[(i, j)]) / (more[(i, i)] * more[(j, j)]).sqrt()
            });
            let (values, _) = crate::numerics::linalg::symmetric_eigen(&gain).expect("finite");
            assert!(values[0] > -1e-9 && values[kept.len() - 1] > 0.1, "{values}");
        }
    }

    /// The Cramér-Rao bound has a Jacobian and an elimination of its own; with exact axes, no lens and the very same points both
    /// must agree.
    #[test]
    fn three_motions_give_the_cramer_rao_bound() {
        let size = ImageSize::new(1280, 960);
        let frame = Frame::new(size, None);
        let k = Intrinsics { fx: 1000.0, fy: 1010.0, cx: 649.5, cy: 469.5, skew: 0.0 };
        let camera = CameraState::new(&k, &Lens::radial(0.0, 0.0), &frame);
        let options = Options {
            constraint: Constraint::ZeroSkew,
            attitude_sigma_deg: Some(0.0),
            lens: LensModel::None,
            ..Options::default()
        };
        let specs: Vec<MotionSpec> = [(50f64, 0f64), (40.0, 30.0), (60.0, -40.0)]
            .map(|(p, r)| MotionSpec::about_axis(p.to_radians(), r.to_radians(), 0.26, 0.1, 1.0))
            .to_vec();
        // Ten is as good as free, and the largest that is allowed.
        for (height_sigma, height) in [(0.0, HeightModel::Constant), (10.0, HeightModel::Free)] {
            let setting = Setting {
                size,
                frame,
                camera,
                free: free_of(&options.assumptions(size)),
                options: options.assumptions(size),
                height_sigma,
                noise_px: 0.7,
                points: 200.0,
                reach: 10.0,
            };
            let shared: Vec<Shared> = specs.iter().map(|s| setting.shared_floor(s)).collect();
            let sum = specs.iter().zip(&shared).map(|(m, s)| setting.information(m, s, 1).expect("regular")).sum();
            let covariance = inverse_free(&sum, &setting.free).expect("determined");
            let jacobian = pixels_by_camera(&k, &frame, camera.count());
            let planned = &jacobian * covariance * jacobian.transpose();
            let points: Vec<Vec<Vector2<f64>>> =
                shared.iter().map(|s| s.seen.iter().map(|(_, q)| q.xy() / q.z).collect()).collect();
            let motions: Vec<([View; 2], &[Vector2<f64>])> =
                specs.iter().zip(&points).map(|(m, p)| (m.views(), p.as_slice())).collect();
            // All grid points count alike: as many matches of one motion as of another.
            let counts: Vec<f64> = shared.iter().map(|s| 200.0 * s.fraction / s.seen.len() as f64).collect();
            assert!(counts.iter().all(|c| (c / counts[0] - 1.0).abs() < 1e-12));
            let sigma = 0.7 / counts[0].sqrt();
            let bound = cramer_rao_bound(&k, &motions, sigma, Constraint::ZeroSkew, height).expect("determined");
            for i in 0..4 {
                let ratio = (planned[(i, i)] / bound[(i, i)]).sqrt();
                assert!((ratio - 1.0).abs() < 1e-4, "{height:?} {i}: {ratio}");
            }
        }
    }
}
