//! Where the camera sits on a robot, and the unit of length, from the robot's odometry.
//!
//! Between two views of one attitude the base moves by u (metres, in the base's frame before) and turns by δ; the camera, mounted at t with its heading
//! φ from the base's x, moves by w (units of the calibration's world, in the frame of its heading before). Both are rigid on the floor:
//!
//! ```text
//! s R(φ) w + (I - R(δ)) t = u            two equations a motion
//! a = s cos φ,  b = s sin φ              linear in (a, b, tx, ty)
//! ```
//!
//! (hand-eye calibration in the plane; δ is the camera's, which sees it better). Odometry errs by a part k of the way, which the residuals tell
//! together with what is usual ([`PRIOR_NOISE`]). The errors of the views have a part that all share, that of camera and attitude: it goes through the
//! estimate as a whole and is not averaged.

use nalgebra::{DMatrix, Matrix2, Matrix2x4, Matrix4, Rotation2, Vector2, Vector4};

use crate::{
    error::Error,
    floor::{points::view_named, scale::with_uncertain_height},
    numerics::linalg::symmetric_eigen,
    result::{Calibration, CameraOnBase, Parameter, ViewParameter, ViewReport},
};

/// A pose of the robot's base on the floor.
#[derive(Debug, Clone, PartialEq)]
pub struct BasePose {
    /// The image taken there.
    pub image: String,
    /// x and y in metres, in a frame of the odometry's own.
    pub position_m: [f64; 2],
    /// Heading, anticlockwise seen from above, radians.
    pub yaw_rad: f64,
}

/// What odometry of wheels errs by over the way driven, and how many equations' worth of trust that has.
pub(crate) const PRIOR_NOISE: f64 = 0.01;
const PRIOR_EQUATIONS: f64 = 4.0;
/// A camera sits within this of the base's origin, one standard deviation in metres.
const MOUNT_SIGMA_M: f64 = 10.0;
/// A place of the camera that is known no better than by this part of that is not told.
const MAX_POSTERIOR_RATIO: f64 = 0.3;
/// Part of the longest way of a motion below which ways count as that long.
const MIN_WAY_FRACTION: f64 = 0.02;
const MAX_ROUNDS: usize = 30;

/// A motion of base and camera.
struct Motion {
    /// Of the camera.
    w: Vector2<f64>,
    delta: f64,
    /// Of the base.
    u: Vector2<f64>,
    /// Covariance of w that it has by itself.
    own: Matrix2<f64>,
    /// Derivative of w by what all views share.
    by_shared: DMatrix<f64>,
}

/// What all views of an attitude share: the camera, and the attitude itself.
fn shared_numbers() -> Vec<ViewParameter> {
    let camera = Parameter::ALL.into_iter().map(ViewParameter::Camera);
    camera.chain([ViewParameter::PitchDownRad, ViewParameter::RollRad]).collect()
}

/// The camera on the base, for every attitude of which two motions or more are known. Motions are those between poses that follow each other in
/// `poses` and whose views have one attitude and one world.
///
/// # Errors
/// [`Error::InvalidInput`] where a name is none of the views', or no attitude has two motions.
pub(crate) fn camera_on_base(c: &Calibration, poses: &[BasePose]) -> Result<Vec<CameraOnBase>, Error> {
    let views: Vec<Option<&ViewReport>> = poses
        .iter()
        .map(|pose| {
            if !(pose.position_m.iter().all(|v| v.is_finite()) && pose.yaw_rad.is_finite()) {
                return Err(Error::InvalidInput(format!("{}: a pose of the base that is not finite", pose.image)));
            }
            Ok(view_named(c, &pose.image).ok().filter(|v| v.position.is_some()))
        })
        .collect::<Result<_, _>>()?;
    let known: Vec<(&BasePose, &ViewReport)> = poses.iter().zip(views).filter_map(|(p, v)| Some((p, v?))).collect();
    let mut kinds: Vec<(usize, &str)> =
        known.iter().filter_map(|(_, v)| Some((v.attitude?, v.origin.as_str()))).collect();
    kinds.sort_unstable();
    kinds.dedup();
    let of_kind = |&(attitude, origin): &(usize, &str)| {
        let here = |v: &ViewReport| v.attitude == Some(attitude) && v.origin == origin;
        let both = |pair: &&[(&BasePose, &ViewReport)]| here(pair[0].1) && here(pair[1].1);
        let motions: Vec<Motion> = known.windows(2).filter(both).filter_map(|p| motion([p[0], p[1]])).collect();
        let view = known.iter().map(|(_, v)| *v).find(|v| here(v))?;
        solved(&motions, view, attitude)
    };
    let found: Vec<CameraOnBase> = kinds.iter().filter_map(of_kind).collect();
    if found.is_empty() {
        return Err(Error::InvalidInput(format!(
            "odometry of {} views of the calibration: no attitude has two motions between views that follow each other in it. Name the images as the \
             calibration does, in the order in which they were taken",
            known.len()
        )));
    }
    Ok(found)
}

fn motion([(base_a, a), (base_b, b)]: [(&BasePose, &ViewReport); 2]) -> Option<Motion> {
    let place = |v: &ViewReport| v.position.map(|p| Vector2::new(p[0], p[1]));
    let back = Rotation2::new(-a.yaw_deg.to_radians());
    let w = back * (place(b)? - place(a)?);
    let turn = b.yaw_deg.to_radians() - a.yaw_deg.to_radians();
    let delta = turn.sin().atan2(turn.cos());
    let [from, to] = [base_a, base_b].map(|p| Vector2::from(p.position_m));
    let u = Rotation2::new(-base_a.yaw_rad) * (to - from);
    let [(of_a, own_a), (of_b, own_b)] = [a, b].map(parts);
    // A heading that is off turns the way.
    let across = Matrix2::identity() * w.norm_squared() * a.yaw_sigma_deg.to_radians().powi(2);
    let back_matrix = back.matrix();
    let own = back_matrix * (own_a + own_b) * back_matrix.transpose() + across;
    let back_dynamic = DMatrix::from_fn(2, 2, |r, c| back_matrix[(r, c)]);
    Some(Motion { w, delta, u, own, by_shared: back_dynamic * (of_b - of_a) })
}

/// Errors of a view's x and y: their derivative by those of what all views share, and the covariance of the rest.
fn parts(v: &ViewReport) -> (DMatrix<f64>, Matrix2<f64>) {
    let shared = shared_numbers();
    let place = [ViewParameter::X, ViewParameter::Y];
    let cross = DMatrix::from_fn(2, shared.len(), |r, c| v.covariance.get(place[r], shared[c]));
    let by = &cross * pseudo_inverse(&v.covariance.of(&shared));
    let rest = v.covariance.of(&place) - &by * cross.transpose();
    let rest = Matrix2::from_fn(|r, c| if r == c { rest[(r, c)].max(0.0) } else { rest[(r, c)] });
    (by, rest)
}

/// Of a covariance, in which numbers were held; directions that rounding alone fills are left out.
fn pseudo_inverse(m: &DMatrix<f64>) -> DMatrix<f64> {
    const ROUNDING: f64 = 1e-9;
    let scale: Vec<f64> = m.diagonal().iter().map(|v| if *v > 0.0 { v.sqrt().recip() } else { 0.0 }).collect();
    let correlation = DMatrix::from_fn(m.nrows(), m.ncols(), |r, c| m[(r, c)] * scale[r] * scale[c]);
    let Some((values, vectors)) = symmetric_eigen(&correlation) else { return DMatrix::zeros(m.nrows(), m.ncols()) };
    let inverted = values.map(|v| if v > ROUNDING { v.recip() } else { 0.0 });
    let inverse = &vectors * DMatrix::from_diagonal(&inverted) * vectors.transpose();
    DMatrix::from_fn(m.nrows(), m.ncols(), |r, c| inverse[(r, c)] * scale[r] * scale[c])
}

/// The two equations of a motion.
fn equations(m: &Motion) -> Matrix2x4<f64> {
    let turned = Matrix2::identity() - Rotation2::new(m.delta).matrix();
    Matrix2x4::new(m.w.x, -m.w.y, turned[(0, 0)], turned[(0, 1)], m.w.y, m.w.x, turned[(1, 0)], turned[(1, 1)])
}

fn solved(motions: &[Motion], view: &ViewReport, attitude: usize) -> Option<CameraOnBase> {
    if motions.len() < 2 {
        return None;
    }
    let (mut p, mut noise) = (Vector4::zeros(), PRIOR_NOISE);
    let mut inverse = Matrix4::zeros();
    // The scale before anything is known: of the ways driven.
    let ways = |f: &dyn Fn(&Motion) -> f64| motions.iter().map(f).fold(0.0, f64::max);
    let mut scale = ways(&|m| m.u.norm()) / ways(&|m| m.w.norm()).max(f64::MIN_POSITIVE);
    for _ in 0..MAX_ROUNDS {
        let mount = p.fixed_rows::<2>(2).norm();
        let way = |m: &Motion| m.u.norm() + m.delta.abs() * mount;
        let least = MIN_WAY_FRACTION * ways(&way);
        let (relative_noise, unit) = (noise, scale);
        let weight = |m: &Motion| {
            let variance = (relative_noise * way(m).max(least)).powi(2);
            (Matrix2::identity() * variance + m.own * unit.powi(2)).try_inverse()
        };
        let prior = MOUNT_SIGMA_M.powi(-2);
        let mut normal = Matrix4::from_diagonal(&Vector4::new(0.0, 0.0, prior, prior));
        let mut right = Vector4::zeros();
        for m in motions {
            let (a, weight) = (equations(m), weight(m)?);
            normal += a.transpose() * weight * a;
            right += a.transpose() * weight * m.u;
        }
        inverse = normal.try_inverse()?;
        p = inverse * right;
        scale = p.x.hypot(p.y);
        let mut chi_squared = 0.0;
        for m in motions {
            let left = m.u - equations(m) * p;
            chi_squared += (left.transpose() * weight(m)? * left)[(0, 0)];
        }
        let freedom = (2.0 * motions.len() as f64 - 4.0).max(0.0);
        let squared =
            (PRIOR_EQUATIONS * PRIOR_NOISE.powi(2) + noise.powi(2) * chi_squared) / (PRIOR_EQUATIONS + freedom);
        noise = squared.sqrt();
    }
    let covariance = inverse + through_shared(motions, view, &p, &inverse, noise)?;
    result(motions.len(), view, attitude, &p, &covariance, noise)
}

/// What the errors that all views share make of the estimate.
fn through_shared(
    motions: &[Motion],
    view: &ViewReport,
    p: &Vector4<f64>,
    inverse: &Matrix4<f64>,
    noise: f64,
) -> Option<Matrix4<f64>> {
    let shared = view.covariance.of(&shared_numbers());
    let mount = p.fixed_rows::<2>(2).norm();
    let way = |m: &Motion| m.u.norm() + m.delta.abs() * mount;
    let least = MIN_WAY_FRACTION * motions.iter().map(way).fold(0.0, f64::max);
    let turned = Matrix2::new(p.x, -p.y, p.y, p.x);
    let mut by = DMatrix::zeros(4, shared.nrows());
    for m in motions {
        let variance = (noise * way(m).max(least)).powi(2);
        let weight = (Matrix2::identity() * variance + m.own * turned.determinant()).try_inverse()?;
        let pull = inverse * equations(m).transpose() * weight * turned;
        let pull = DMatrix::from_fn(4, 2, |r, c| pull[(r, c)]);
        by -= pull * &m.by_shared;
    }
    let c = &by * shared * by.transpose();
    Some(Matrix4::from_fn(|r, s| c[(r, s)]))
}

fn result(
    motions: usize,
    view: &ViewReport,
    attitude: usize,
    p: &Vector4<f64>,
    covariance: &Matrix4<f64>,
    relative_noise: f64,
) -> Option<CameraOnBase> {
    let scale = p.x.hypot(p.y);
    if !(scale.is_finite() && scale > 0.0) {
        return None;
    }
    let of = |by: Vector4<f64>| (by.transpose() * covariance * by)[(0, 0)].max(0.0).sqrt();
    let scale_sigma = of(Vector4::new(p.x, p.y, 0.0, 0.0) / scale);
    let yaw_sigma = of(Vector4::new(-p.y, p.x, 0.0, 0.0) / scale.powi(2));
    let [x, y] = [2, 3].map(|i| covariance[(i, i)].max(0.0).sqrt());
    let [height, height_sigma] = [view.position?[2], view.position_sigma.map_or(0.0, |s| s[2])];
    let is_told = x.max(y) < MAX_POSTERIOR_RATIO * MOUNT_SIGMA_M;
    Some(CameraOnBase {
        attitude,
        origin: view.origin.clone(),
        motions,
        metres_per_unit: scale,
        metres_per_unit_sigma: scale_sigma,
        position_m: is_told.then_some([p.z, p.w]),
        position_sigma_m: is_told.then_some([x, y]),
        height_m: scale * height,
        height_sigma_m: (scale * height_sigma).hypot(scale_sigma * height),
        yaw_deg: p.y.atan2(p.x).to_degrees(),
        yaw_sigma_deg: yaw_sigma.to_degrees(),
        pitch_down_deg: view.pitch_down_deg,
        roll_deg: view.roll_deg,
        relative_noise,
    })
}

/// The calibration in metres as the odometry has them, unless it is in metres already, and where the camera sits on the base, which it has
/// with it ([`Calibration::on_base`]).
///
/// # Errors
/// [`Error::InvalidInput`] where a name is none of the views', or no attitude has two motions.
pub fn with_odometry(c: Calibration, poses: &[BasePose]) -> Result<Calibration, Error> {
    let found = camera_on_base(&c, poses)?;
    let mut c = match scale_of_all(&found).filter(|_| c.camera_height_m.is_none()) {
        Some([height_m, sigma]) => with_uncertain_height(c, height_m, sigma / height_m)?,
        None => c,
    };
    c.on_base = found;
    Ok(c)
}

/// The scale of several attitudes of one world together, and its standard deviation: weighted by their errors. `None` for none.
fn scale_of_all(found: &[CameraOnBase]) -> Option<[f64; 2]> {
    let weights: Vec<f64> = found.iter().map(|f| f.metres_per_unit_sigma.powi(-2)).collect();
    let sum: f64 = weights.iter().sum();
    let mean = found.iter().zip(&weights).map(|(f, w)| f.metres_per_unit * w).sum::<f64>() / sum;
    (sum.is_finite() && sum > 0.0).then(|| [mean, sum.sqrt().recip()])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        calibrate::{Options, Silent, calibrate_matches},
        pairs::correspondence::ImagePair,
        result::{Covariance, Scene},
        synthetic::points::PointScene,
    };
    use rand::{RngExt, SeedableRng};
    use rand_distr::StandardNormal;
    use rand_pcg::Pcg64Mcg;

    const POSES: usize = 13;
    /// Truth: metres of a unit, the camera's place and heading on the base.
    const SCALE: f64 = 1.37;
    const MOUNT: [f64; 3] = [0.25, -0.08, 0.3];

    /// A calibration of one attitude to be filled with views.
    fn template() -> Calibration {
        let scene = PointScene::nominal(4);
        let pairs: Vec<ImagePair> = scene.pairs();
        let names: Vec<String> = (0..2 * pairs.len()).map(|i| i.to_string()).collect();
        let c = calibrate_matches(&names, scene.size, &pairs, &Options::default(), &Silent).expect("a camera");
        Calibration { scene: Some(Scene::Floor), ..c }
    }

    /// Odometry with noise in each step, and views whose errors are as their covariance says: a part by themselves, and a stretch of everything that
    /// goes with the pitch.
    fn drive(c: &Calibration, noise: f64, own: f64, stretch: f64, rng: &mut Pcg64Mcg) -> (Calibration, Vec<BasePose>) {
        let mut normal = || rng.sample::<f64, _>(StandardNormal);
        let (mut c, mut poses) = (c.clone(), Vec::new());
        let model = c.views[0].clone();
        c.views.clear();
        let pitch_sigma = 0.002;
        let pitch_error = pitch_sigma * normal();
        let (mut true_at, mut true_yaw) = (Vector2::zeros(), 0.2);
        let (mut odometry_at, mut odometry_yaw) = (Vector2::new(3.0, -1.0), 1.0);
        let mut origin = None;
        for i in 0..POSES {
            if i > 0 {
                let (way, turn) = (0.4 + 0.1 * (i % 3) as f64, if i % 2 == 0 { 0.5 } else { -0.35 + 0.05 * i as f64 });
                // Along an arc, in the base's own frame.
                let step = Rotation2::new(0.5 * turn) * Vector2::new(way, 0.0);
                true_at += Rotation2::new(true_yaw) * step;
                true_yaw += turn;
                let measured = step + Vector2::new(normal(), normal()) * noise * way;
                odometry_at += Rotation2::new(odometry_yaw) * measured;
                odometry_yaw += turn * (1.0 + noise * normal());
            }
            let camera = true_at + Rotation2::new(true_yaw) * Vector2::new(MOUNT[0], MOUNT[1]);
            let yaw = true_yaw + MOUNT[2];
            let (from, heading) = *origin.get_or_insert((camera, yaw));
            let place = Rotation2::new(-heading) * (camera - from) / SCALE;
            let seen = place * (1.0 + stretch * pitch_error) + Vector2::new(normal(), normal()) * own;
            let numbers = ViewParameter::ALL;
            let by_pitch = |p: ViewParameter| match p {
                ViewParameter::PitchDownRad => 1.0,
                ViewParameter::X => stretch * place.x,
                ViewParameter::Y => stretch * place.y,
                _ => 0.0,
            };
            let alone =
                |p: ViewParameter| if matches!(p, ViewParameter::X | ViewParameter::Y) { own * own } else { 0.0 };
            let covariance = Covariance::from_fn(&numbers, |r, s| {
                by_pitch(numbers[r]) * by_pitch(numbers[s]) * pitch_sigma.powi(2)
                    + if r == s { alone(numbers[r]) } else { 0.0 }
            });
            c.views.push(ViewReport {
                image: format!("{i}.jpg"),
                attitude: Some(0),
                origin: "0.jpg".into(),
                yaw_deg: (yaw - heading).to_degrees(),
                yaw_sigma_deg: 0.0,
                position: Some([seen.x, seen.y, 1.0]),
                position_sigma: Some([own, own, 0.0]),
                covariance,
                ..model.clone()
            });
            poses.push(BasePose { image: i.to_string(), position_m: odometry_at.into(), yaw_rad: odometry_yaw });
        }
        (c, poses)
    }

    #[test]
    fn exact_odometry_gives_the_pose_on_the_base() {
        let (c, poses) = drive(&template(), 0.0, 0.0, 0.0, &mut Pcg64Mcg::seed_from_u64(0));
        let found = camera_on_base(&c, &poses).unwrap();
        let f = &found[0];
        assert_eq!((found.len(), f.motions), (1, POSES - 1));
        let [x, y] = f.position_m.unwrap();
        for (value, truth) in
            [(f.metres_per_unit, SCALE), (x, MOUNT[0]), (y, MOUNT[1]), (f.yaw_deg.to_radians(), MOUNT[2])]
        {
            // The weak prior of the mount pulls by a part in 1e8.
            assert!((value - truth).abs() < 1e-6, "{value} for {truth}");
        }
    }

    #[test]
    fn bars_hold_with_one_per_cent_of_noise() {
        let template = template();
        for (own, stretch) in [(0.0005, 0.0), (0.0005, 1.5)] {
            let mut rng = Pcg64Mcg::seed_from_u64(7);
            const TRIALS: usize = 500;
            let mut held = [0; 4];
            let mut squares = [0.0; 4];
            for _ in 0..TRIALS {
                let (c, poses) = drive(&template, 0.01, own, stretch, &mut rng);
                let f = camera_on_base(&c, &poses).unwrap().remove(0);
                let [x, y] = f.position_m.unwrap();
                let [x_sigma, y_sigma] = f.position_sigma_m.unwrap();
                let pulls = [
                    (f.metres_per_unit - SCALE) / f.metres_per_unit_sigma,
                    (x - MOUNT[0]) / x_sigma,
                    (y - MOUNT[1]) / y_sigma,
                    (f.yaw_deg.to_radians() - MOUNT[2]) / f.yaw_sigma_deg.to_radians(),
                ];
                for (i, pull) in pulls.iter().enumerate() {
                    held[i] += usize::from(pull.abs() < 1.96);
                    squares[i] += pull * pull / TRIALS as f64;
                }
            }
            // 93 to 97 %.
            assert!(
                held.iter().all(|h| (465..=485).contains(h)),
                "stretch {stretch}: {held:?} of {TRIALS}, {squares:?}"
            );
        }
    }

    #[test]
    fn a_straight_drive_does_not_show_where_the_camera_sits() {
        let (c, poses) = drive(&template(), 0.0, 0.0, 0.0, &mut Pcg64Mcg::seed_from_u64(0));
        let straight = |i: usize| Vector2::new(0.5 * i as f64, 0.0);
        let mut c = c;
        for (i, v) in c.views.iter_mut().enumerate() {
            let at = Rotation2::new(-MOUNT[2]) * straight(i) / SCALE;
            (v.position, v.yaw_deg) = (Some([at.x, at.y, 1.0]), 0.0);
        }
        let poses: Vec<BasePose> = poses
            .into_iter()
            .enumerate()
            .map(|(i, p)| BasePose { position_m: straight(i).into(), yaw_rad: 0.0, ..p })
            .collect();
        let f = camera_on_base(&c, &poses).unwrap().remove(0);
        assert!((f.metres_per_unit - SCALE).abs() < 1e-6 && (f.yaw_deg.to_radians() - MOUNT[2]).abs() < 1e-6, "{f:?}");
        assert_eq!(f.position_m, None);
    }

    #[test]
    fn names_that_are_not_there_are_said() {
        let c = template();
        let pose = |image: &str| BasePose { image: image.into(), position_m: [0.0; 2], yaw_rad: 0.0 };
        let message = camera_on_base(&c, &[pose("x"), pose("y")]).unwrap_err().to_string();
        assert!(message.contains("odometry of 0 views"), "{message}");
    }
}
