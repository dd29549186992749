//! Focal length and floor from homographies of views that moved in any way before one plane.
//!
//! ```text
//! M_i = K⁻¹ H_i K,  H_i from the reference to view i;  u, v orthonormal and square to the plane's normal n in the reference:
//!
//! |M_i u|² = |M_i v|²,   (M_i u) · (M_i v) = 0                                            (Triggs, ECCV 1998; Malis & Cipolla, 2000)
//! ```
//!
//! Two equations a view for the focal length and two numbers of the normal. With a, b, c the entries of the form Mᵀ M on (u, v) the residual
//! is r = (a - b, 2 c) / (a + b), whose length is (1 - q²) / (1 + q²), q the ratio of the axes of the ellipse that a circle of the plane becomes: no choice
//! of u and v matters. What is summed is |r|² / (1 + |r|² / 0.3²) (Geman & McClure 1985), so that a wrong homography costs no more than 0.3². The equations have several solutions, so all focal lengths and normals are scanned, and what is best there is refined.

use nalgebra::{DVector, Matrix3, SMatrix, SVector, Vector3};

use crate::numerics::levenberg_marquardt::{LeastSquares, LmOptions, NormalEquations, minimise};

/// A focal length and a normal that fit the homographies.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct PlaneStart {
    /// Focal length, units of the homographies' frame.
    pub(crate) f: f64,
    /// The plane's normal in the reference's camera coordinates, unit length; its sign says nothing.
    pub(crate) normal: Vector3<f64>,
    /// Sum of the squared residuals, each view's at most [`OUTLIER_RESIDUAL`]².
    pub(crate) cost: f64,
}

/// Focal lengths scanned, in half mean sides of the image: from 140 degrees across the image to a telephoto lens.
const FOCAL_RANGE: (f64, f64) = (0.35, 15.0);
const FOCAL_STEPS: usize = 24;
/// Directions scanned on the half sphere of normals: 11 degrees apart.
const SCANNED_NORMALS: usize = 160;
/// Best normals of each focal length that are refined.
const NORMALS_REFINED: usize = 4;
/// Length of a view's residual from which on it hardly counts: its homography is of another plane.
const OUTLIER_RESIDUAL: f64 = 0.3;
/// Solutions kept, at most.
const MAX_STARTS: usize = 5;
/// Solutions nearer than this (ln f, and radians of the normal) are one.
const SAME_LN_F: f64 = 0.05;
const SAME_NORMAL_RAD: f64 = 0.06;
/// Step of numerical derivatives.
const STEP: f64 = 1e-6;
/// Focal lengths beyond this factor of the range are no solutions.
const RANGE_MARGIN: f64 = 2.0;

/// M = K⁻¹ H K with K = diag(f, f a, 1): the homography between camera coordinates of two views whose principal point is the frame's origin.
pub(crate) fn in_camera_coordinates(h: &Matrix3<f64>, f: f64, aspect: f64) -> Matrix3<f64> {
    let k = Vector3::new(f, f * aspect, 1.0);
    Matrix3::from_fn(|r, c| h[(r, c)] * k[c] / k[r])
}

/// The best few solutions, best first, from homographies of the reference to other views in frame units (origin the principal point);
/// `aspect`: fy / fx. None with fewer than two views beside the reference.
pub(crate) fn plane_starts(from_reference: &[Matrix3<f64>], aspect: f64) -> Vec<PlaneStart> {
    if from_reference.len() < 2 {
        return Vec::new();
    }
    let problem = Triggs { from_reference, aspect };
    let (low, high) = FOCAL_RANGE;
    let normals = half_sphere(SCANNED_NORMALS);
    let mut found: Vec<PlaneStart> = Vec::new();
    for step in 0..FOCAL_STEPS {
        let f = low * (high / low).powf(step as f64 / (FOCAL_STEPS - 1) as f64);
        let forms = problem.forms(f);
        let mut scanned: Vec<(f64, Vector3<f64>)> = normals.iter().map(|n| (cost_of(&forms, n), *n)).collect();
        scanned.sort_by(|a, b| a.0.total_cmp(&b.0));
        for (_, normal) in scanned.into_iter().take(NORMALS_REFINED) {
            let start = State { ln_f: f.ln(), normal };
            let options = LmOptions { max_iterations: 30, relative_cost_tolerance: 1e-9, ..LmOptions::default() };
            let Some(out) = minimise(&problem, start, &options) else { continue };
            let State { ln_f, normal } = out.state;
            let f = ln_f.exp();
            if (low / RANGE_MARGIN..high * RANGE_MARGIN).contains(&f) {
                found.push(PlaneStart { f, normal, cost: 2.0 * out.cost });
            }
        }
    }
    found.sort_by(|a, b| a.cost.total_cmp(&b.cost));
    let mut distinct: Vec<PlaneStart> = Vec::new();
    for start in found {
        let same = |other: &PlaneStart| {
            (other.f / start.f).ln().abs() < SAME_LN_F
                && other.normal.cross(&start.normal).norm() < SAME_NORMAL_RAD.sin()
        };
        if distinct.len() < MAX_STARTS && !distinct.iter().any(same) {
            distinct.push(start);
        }
    }
    distinct
}

/// Points of a half sphere, evenly (a Fibonacci lattice).
fn half_sphere(count: usize) -> Vec<Vector3<f64>> {
    let golden = std::f64::consts::PI * (3.0 - 5f64.sqrt());
    let point = |i: usize| {
        let z = (i as f64 + 0.5) / count as f64;
        let (s, c) = (golden * i as f64).sin_cos();
        let r = (1.0 - z * z).sqrt();
        Vector3::new(r * c, r * s, z)
    };
    (0..count).map(point).collect()
}

/// Two directions of a plane, orthonormal; near a normal they turn with it.
fn directions(normal: &Vector3<f64>) -> [Vector3<f64>; 2] {
    let axis = if normal.x.abs() < 0.7 { Vector3::x() } else { Vector3::y() };
    let u = (axis - normal * normal.dot(&axis)).normalize();
    [u, normal.cross(&u)]
}

/// (a - b, 2 c) / (a + b) of the form of a view.
fn residual(form: &Matrix3<f64>, [u, v]: &[Vector3<f64>; 2]) -> [f64; 2] {
    let (a, b, c) = (u.dot(&(form * u)), v.dot(&(form * v)), u.dot(&(form * v)));
    let sum = (a + b).max(f64::MIN_POSITIVE);
    let (r, s) = ((a - b) / sum, 2.0 * c / sum);
    // However far a view is off, it counts for no more than `OUTLIER_RESIDUAL` (Geman and McClure).
    let shrunk = (1.0 + (r * r + s * s) / (OUTLIER_RESIDUAL * OUTLIER_RESIDUAL)).sqrt();
    [r / shrunk, s / shrunk]
}

fn cost_of(forms: &[Matrix3<f64>], normal: &Vector3<f64>) -> f64 {
    let plane = directions(normal);
    forms.iter().map(|form| residual(form, &plane).iter().map(|r| r * r).sum::<f64>()).sum()
}

#[derive(Debug, Clone, Copy)]
struct State {
    ln_f: f64,
    normal: Vector3<f64>,
}

struct Triggs<'a> {
    from_reference: &'a [Matrix3<f64>],
    aspect: f64,
}

impl Triggs<'_> {
    /// Mᵀ M of each view.
    fn forms(&self, f: f64) -> Vec<Matrix3<f64>> {
        let form = |h: &Matrix3<f64>| {
            let m = in_camera_coordinates(h, f, self.aspect);
            m.tr_mul(&m)
        };
        self.from_reference.iter().map(form).collect()
    }

    fn residuals(&self, state: &State) -> Vec<f64> {
        let plane = directions(&state.normal);
        self.forms(state.ln_f.exp()).iter().flat_map(|form| residual(form, &plane)).collect()
    }

    /// Three steps: of ln f, and of the normal along two directions of the plane.
    fn moved(state: &State, step: [f64; 3]) -> State {
        let [u, v] = directions(&state.normal);
        let normal = (state.normal + u * step[1] + v * step[2]).normalize();
        State { ln_f: state.ln_f + step[0], normal }
    }
}

impl LeastSquares for Triggs<'_> {
    type State = State;
    type Linearised = NormalEquations;

    fn linearise(&self, state: &State) -> Option<NormalEquations> {
        let r = self.residuals(state);
        let along = |k: usize, by: f64| {
            self.residuals(&Self::moved(state, std::array::from_fn(|i| if i == k { by } else { 0.0 })))
        };
        let derivatives: [Vec<f64>; 3] = std::array::from_fn(|k| {
            let (plus, minus) = (along(k, STEP), along(k, -STEP));
            plus.iter().zip(&minus).map(|(p, m)| (p - m) / (2.0 * STEP)).collect()
        });
        let mut information = SMatrix::<f64, 3, 3>::zeros();
        let mut gradient = SVector::<f64, 3>::zeros();
        for (i, value) in r.iter().enumerate() {
            let row = SVector::<f64, 3>::from_fn(|k, _| derivatives[k][i]);
            information += row * row.transpose();
            gradient += row * *value;
        }
        let cost = 0.5 * r.iter().map(|v| v * v).sum::<f64>();
        let finite = cost.is_finite() && information.iter().all(|v| v.is_finite());
        finite.then(|| NormalEquations {
            cost,
            gradient: DVector::from_column_slice(gradient.as_slice()),
            information: nalgebra::DMatrix::from_column_slice(3, 3, information.as_slice()),
        })
    }

    fn cost(&self, state: &State) -> Option<f64> {
        let cost = 0.5 * self.residuals(state).iter().map(|v| v * v).sum::<f64>();
        cost.is_finite().then_some(cost)
    }

    fn retract(&self, state: &State, step: &DVector<f64>) -> State {
        Self::moved(state, [step[0], step[1], step[2]])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::attitude::rotation_cam_from_world;

    /// Homographies of a plane between views of the given pitch, roll, yaw (degrees) and place.
    fn homographies(f: f64, views: &[[f64; 6]]) -> (Vec<Matrix3<f64>>, Vector3<f64>) {
        let k = Matrix3::from_diagonal(&Vector3::new(f, f, 1.0));
        let of_floor = |v: &[f64; 6]| {
            let r = rotation_cam_from_world(v[0].to_radians(), v[1].to_radians(), v[2].to_radians());
            let t = -r * Vector3::new(v[3], v[4], v[5]);
            k * Matrix3::from_columns(&[r.column(0).into_owned(), r.column(1).into_owned(), t])
        };
        let reference = of_floor(&views[0]).try_inverse().expect("regular");
        let normal =
            rotation_cam_from_world(views[0][0].to_radians(), views[0][1].to_radians(), 0.0).column(2).into_owned();
        (views[1..].iter().map(|v| of_floor(v) * reference).collect(), normal)
    }

    #[test]
    fn exact_homographies_of_any_motion_give_the_focal_length_and_the_floor() {
        let views = [
            [50.0, 5.0, 0.0, 0.0, 0.0, 1.0],
            [35.0, -20.0, 40.0, 0.3, -0.4, 1.2],
            [65.0, 10.0, 110.0, 1.0, 0.2, 0.8],
            [45.0, 30.0, -70.0, 0.4, 0.9, 1.1],
            [75.0, -15.0, 200.0, 0.8, 0.5, 1.4],
        ];
        for f in [0.6, 1.0, 2.2, 6.0] {
            let (all, normal) = homographies(f, &views);
            let best = plane_starts(&all, 1.0)[0];
            assert!((best.f / f - 1.0).abs() < 1e-6, "{f}: {best:?}");
            assert!(best.normal.cross(&normal).norm() < 1e-6 && best.cost < 1e-12);
        }
    }

    #[test]
    fn one_homography_of_another_plane_does_not_spoil_the_rest() {
        let views = [
            [50.0, 5.0, 0.0, 0.0, 0.0, 1.0],
            [35.0, -20.0, 40.0, 0.3, -0.4, 1.2],
            [65.0, 10.0, 110.0, 1.0, 0.2, 0.8],
            [45.0, 30.0, -70.0, 0.4, 0.9, 1.1],
            [75.0, -15.0, 200.0, 0.8, 0.5, 1.4],
            [60.0, 25.0, 150.0, 0.1, 0.5, 1.0],
        ];
        let (mut all, _) = homographies(1.3, &views);
        all[2][(0, 0)] *= 1.5;
        assert!((plane_starts(&all, 1.0)[0].f / 1.3 - 1.0).abs() < 0.03);
    }

    #[test]
    fn one_view_beside_the_reference_says_nothing() {
        let (all, _) = homographies(1.0, &[[50.0, 5.0, 0.0, 0.0, 0.0, 1.0], [35.0, -20.0, 40.0, 0.3, -0.4, 1.2]]);
        assert!(plane_starts(&all, 1.0).is_empty());
    }
}
