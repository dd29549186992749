//! How sure a camera is of where things appear in its images.
//!
//! The standard deviations of single numbers hide that errors of several cancel: a focal length and a distortion that are wrong together may
//! show everything in the right place. What a user of the camera meets is the place q at which it shows a point X,
//!
//! ```text
//! q(θ, m)             θ numbers of the camera, m motion of the camera
//! dq = A dθ + B dm    for a point; A is 2 x 10, B is 2 x 3 (rotation) or 2 x 6 (pose)
//! dm = -(Σ BᵀB)⁻¹ Σ BᵀA dθ    the motion that hides most of it: sums over a grid that fills the image
//! rms² = tr(E C Eᵀ),  E = A + B dm/dθ,  C = cov θ
//! ```
//!
//! Points far away are met by a rotation, as nobody knows the camera's attitude better than its own images do; points of a floor by a pose.
//! The idea is that of mrcal (Kogan: "A tour of mrcal: projection uncertainty").

use nalgebra::{DMatrix, SMatrix, SVector, Vector2, Vector3};

use crate::{
    floor::view::FloorView,
    geometry::{plane_view::View, size::ImageSize},
    numerics::linalg::inverse_spd,
    result::{Calibration, Parameter, ViewParameter, projection::ProjectionUncertainty},
};

/// Cells along the longer side of the image.
pub const CELLS: usize = 16;
/// Most cells along it: beyond that nothing new is seen.
pub(crate) const MAX_CELLS: usize = 200;

const NUMBERS: usize = Parameter::ALL.len();
const POSE: usize = ViewParameter::OF_POSE.len();
/// The first three of [`ViewParameter::OF_POSE`] turn the camera.
const ROTATION: usize = 3;

/// What a point's pixel does when the numbers of camera and view change.
type ByNumbers = SMatrix<f64, 2, { ViewParameter::COUNT }>;

/// On a grid with `cells` along the longer side; `None` where the covariance of the camera is not known, or every number was held.
pub fn projection_uncertainty(c: &Calibration, cells: usize) -> Option<ProjectionUncertainty> {
    let covariance = c.covariance.of(&Parameter::ALL);
    if !(covariance.trace() > 0.0 && covariance.iter().all(|v| v.is_finite())) {
        return None;
    }
    let size = c.camera.size();
    let cells_xy = cells_of(size, cells.clamp(1, MAX_CELLS));
    let mut of = ProjectionUncertainty { cells_xy, distant_px: Vec::new(), attitude: None, floor_px: Vec::new() };
    let middles: Vec<Vector2<f64>> =
        (0..cells_xy[0] * cells_xy[1]).map(|i| of.middle_px(i, c.camera.image_size).into()).collect();
    // Any pose serves for points far away; one without a gimbal's lock.
    let view = View { pitch_down_rad: 0.5, roll_rad: 0.0, yaw_rad: 0.0, centre: Vector3::z() };
    let anywhere = FloorView::new(&c.camera.intrinsics(), c.camera.lens(), &view).ok()?;
    let distant: Vec<Option<ByNumbers>> = middles.iter().map(|p| distant_point(&anywhere, p)).collect();
    of.distant_px = rms_px(&distant, ROTATION, &covariance)?;
    if let Some((attitude, view)) = floor_of(c) {
        let floor: Vec<Option<ByNumbers>> = middles.iter().map(|p| floor_point(&view, p)).collect();
        if let Some(floor_px) = rms_px(&floor, POSE, &covariance) {
            of.attitude = Some(attitude);
            of.floor_px = floor_px;
        }
    }
    Some(of)
}

/// Square cells as nearly as whole numbers allow.
fn cells_of(size: ImageSize, along: usize) -> [usize; 2] {
    let side = size.width.max(size.height) as f64 / along as f64;
    [size.width, size.height].map(|n| ((n as f64 / side).round() as usize).max(1))
}

/// The attitude that most views have, and a view of it.
fn floor_of(c: &Calibration) -> Option<(usize, FloorView)> {
    let count = |a: usize| c.views.iter().filter(|v| v.attitude == Some(a) && v.position.is_some()).count();
    let most = (0..c.attitudes.len()).max_by_key(|&a| (count(a), std::cmp::Reverse(a)))?;
    let view = c.views.iter().find(|v| v.attitude == Some(most))?;
    Some((most, FloorView::of_report(&c.camera, view).ok()?))
}

fn distant_point(view: &FloorView, pixel: &Vector2<f64>) -> Option<ByNumbers> {
    let direction = view.direction(pixel)?;
    finite(view.derivative_by_numbers(|v| v.pixel_from_direction(&direction).unwrap_or(NOWHERE)))
}

fn floor_point(view: &FloorView, pixel: &Vector2<f64>) -> Option<ByNumbers> {
    let point = view.floor_from_pixel(pixel)?;
    finite(view.derivative_by_numbers(|v| v.pixel_from_floor(&point).unwrap_or(NOWHERE)))
}

/// What falls off the lens's edge within the step of a difference has no derivative.
const NOWHERE: SVector<f64, 2> = SVector::<f64, 2>::new(f64::NAN, f64::NAN);

fn finite(by: ByNumbers) -> Option<ByNumbers> {
    by.iter().all(|v| v.is_finite()).then_some(by)
}

/// Of each point after the best motion, whose numbers are the first `motion` of a view's own; `None` where the points do not determine it.
fn rms_px(points: &[Option<ByNumbers>], motion: usize, covariance: &DMatrix<f64>) -> Option<Vec<Option<f64>>> {
    let camera = |by: &ByNumbers| by.columns(0, NUMBERS).into_owned();
    let moved = |by: &ByNumbers| by.columns(NUMBERS, motion).into_owned();
    let mut normal = DMatrix::zeros(motion, motion);
    let mut right = DMatrix::zeros(motion, NUMBERS);
    for by in points.iter().flatten() {
        let b = moved(by);
        normal += b.transpose() * &b;
        right += b.transpose() * camera(by);
    }
    let hidden = -(inverse_spd(&normal)? * right);
    let rms = |by: &ByNumbers| {
        let left = camera(by) + moved(by) * &hidden;
        (&left * covariance * left.transpose()).trace().max(0.0).sqrt()
    };
    Some(points.iter().map(|by| by.as_ref().map(rms)).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        calibrate::{Options, Silent, calibrate_matches},
        geometry::{
            intrinsics::Intrinsics,
            lens::{Lens, Radtan},
        },
        numerics::linalg::symmetric_eigen,
        pairs::correspondence::ImagePair,
        synthetic::points::PointScene,
    };
    use rand::{RngExt, SeedableRng};
    use rand_distr::StandardNormal;

    fn calibration(seed: u64) -> (PointScene, Calibration) {
        let scene = PointScene { matches: 80, ..PointScene::nominal(seed) };
        let pairs: Vec<ImagePair> = scene.pairs();
        let names: Vec<String> = (0..2 * pairs.len()).map(|i| i.to_string()).collect();
        let c = calibrate_matches(&names, scene.size, &pairs, &Options::default(), &Silent).expect("a camera");
        (scene, c)
    }

    /// A camera that has been turned.
    fn turned(camera: &(Intrinsics, Lens), angles: &[f64; 3]) -> FloorView {
        let [pitch_down_rad, roll_rad, yaw_rad] = *angles;
        FloorView::new(&camera.0, camera.1, &View { pitch_down_rad, roll_rad, yaw_rad, centre: Vector3::z() }).unwrap()
    }

    /// Distances in pixels between where two cameras show distant points, after the rotation that fits best, found by iteration.
    fn after_best_rotation(c: &Calibration, other: &(Intrinsics, Lens), of: &ProjectionUncertainty) -> Vec<f64> {
        let mut angles = [0.5, 0.0, 0.0];
        let here = turned(&(c.camera.intrinsics(), c.camera.lens()), &angles);
        let pixels: Vec<Vector2<f64>> =
            (0..of.distant_px.len()).map(|i| of.middle_px(i, c.camera.image_size).into()).collect();
        let mut errors = Vec::new();
        for _ in 0..6 {
            let there = turned(other, &angles);
            let mut normal = DMatrix::zeros(3, 3);
            let mut right = DMatrix::zeros(3, 1);
            errors.clear();
            for p in &pixels {
                let shown = there.pixel_from_direction(&here.direction(p).unwrap()).unwrap();
                let b = distant_point(&there, &shown).unwrap().columns(NUMBERS, 3).into_owned();
                normal += b.transpose() * &b;
                right += b.transpose() * (shown - p);
                errors.push((shown - p).norm());
            }
            let step = inverse_spd(&normal).unwrap() * right;
            angles.iter_mut().zip(step.iter()).for_each(|(angle, step)| *angle -= step);
        }
        errors
    }

    #[test]
    fn it_is_what_cameras_drawn_from_the_covariance_do() {
        let (_, c) = calibration(4);
        let of = projection_uncertainty(&c, 6).unwrap();
        assert_eq!((of.cells_xy, of.distant_px.len(), of.attitude.is_some()), ([6, 5], 30, true));
        let (values, vectors) = symmetric_eigen(&c.covariance.of(&Parameter::ALL)).unwrap();
        let mut rng = rand_pcg::Pcg64Mcg::seed_from_u64(1);
        const DRAWN: usize = 400;
        let mut squares = vec![0.0; 30];
        for _ in 0..DRAWN {
            let normal = |v: &f64| v.max(0.0).sqrt() * rng.sample::<f64, _>(StandardNormal);
            let step = &vectors * nalgebra::DVector::from_iterator(NUMBERS, values.iter().map(normal));
            let mut camera = c.camera.clone();
            (camera.fx, camera.fy) = (camera.fx + step[0], camera.fy + step[1]);
            (camera.cx, camera.cy, camera.skew) = (camera.cx + step[2], camera.cy + step[3], camera.skew + step[4]);
            let lens = [step[5], step[6], step[7], step[8], step[9]];
            let at = |i: usize| c.value(Parameter::ALL[5 + i]) + lens[i];
            let other = (camera.intrinsics(), Lens::Radtan(Radtan::new(std::array::from_fn(at))));
            for (sum, e) in squares.iter_mut().zip(after_best_rotation(&c, &other, &of)) {
                *sum += e * e;
            }
        }
        // A root mean square of 400 with one or two degrees of freedom each is known to 5 % at most; four of those.
        for (i, (sum, expected)) in squares.iter().zip(&of.distant_px).enumerate() {
            let (drawn, expected) = ((sum / DRAWN as f64).sqrt(), expected.unwrap());
            assert!((drawn / expected - 1.0).abs() < 0.2, "cell {i}: {drawn} px, {expected} px expected");
        }
    }

    #[test]
    fn it_is_how_far_estimated_cameras_are_from_the_true_one() {
        let (mut ratio, mut count) = (0.0, 0);
        for seed in 0..40 {
            let (scene, c) = calibration(100 + seed);
            let of = projection_uncertainty(&c, 6).unwrap();
            let errors = after_best_rotation(&c, &(scene.intrinsics, scene.lens), &of);
            let mean = |v: &mut dyn Iterator<Item = f64>| v.map(|e| e * e).sum::<f64>() / 30.0;
            let expected = mean(&mut of.distant_px.iter().map(|e| e.unwrap()));
            ratio += mean(&mut errors.into_iter()) / expected;
            count += 1;
        }
        // A trial's mean of squares is made of some three independent directions: its deviation is 0.8 of its mean, that of 40 trials' mean 0.13.
        let ratio = ratio / f64::from(count);
        assert!((0.6..1.4).contains(&ratio), "{ratio}");
    }

    #[test]
    fn without_error_bars_there_is_none() {
        let (_, mut c) = calibration(4);
        c.covariance = Default::default();
        assert_eq!(projection_uncertainty(&c, 6), None);
    }
}
