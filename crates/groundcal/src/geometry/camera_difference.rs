//! How far two calibrations of one camera differ, in pixels.
//!
//! A user of a calibration estimates the camera's pose with it, and a change of the principal point is then nearly a rotation
//! of the camera. What matters is what no rotation takes away:
//!
//! ```text
//! d_i(R) = pixel_b(R ray_a(u_i)) - u_i,      min over R of Σ w_i |d_i(R)|²
//! ```
//!
//! over a grid of pixels u_i of the image (trapezoidal weights: the mean is that over the image's area). `ray` undoes the lens,
//! `pixel` applies it ([`CameraModel`]). Depth and translation are left out: for a pose of six numbers the difference is at most this.
//!
//! Whether two sets of parameters differ by more than their errors is told by the squared Mahalanobis distance dᵀ (C_a + C_b)⁻¹ d,
//! chi-squared distributed if the two are independent.

use nalgebra::{DMatrix, DVector, Matrix2x3, Matrix3, Rotation3, UnitQuaternion, Vector2, Vector3};

use crate::{
    error::Error,
    geometry::camera_model::CameraModel,
    numerics::{
        levenberg_marquardt::{LeastSquares, LmOptions, NormalEquations, minimise},
        linalg::{cross_matrix, inverse_spd},
        statistics::chi_squared_survival,
    },
};

/// Grid points along the longer side of the image.
const GRID: usize = 49;
/// Fewest grid points that both cameras see.
const MIN_POINTS: usize = 50;

/// A grid point and how far the second camera sees it from where the first does.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PixelDifference {
    /// Pixel of the first camera.
    pub pixel: Vector2<f64>,
    /// Pixel of the second camera less that of the first; `None` where either lens model gives nothing.
    pub difference_px: Option<Vector2<f64>>,
    /// Its part of the image's area.
    weight: f64,
}

/// The difference of two cameras over the image.
#[derive(Debug, Clone, PartialEq)]
pub struct CameraDifference {
    /// The best rotation: camera coordinates of the second camera from those of the first.
    pub r_b_from_a: Matrix3<f64>,
    /// Its angle in radians.
    pub rotation_rad: f64,
    /// Root mean square length of the differences over the image, after the rotation.
    pub rms_px: f64,
    /// The largest.
    pub max_px: f64,
    /// Where in the image.
    pub max_at_px: Vector2<f64>,
    /// Root mean square without a rotation (both cameras looking the same way).
    pub rms_unrotated_px: f64,
    /// The largest without a rotation.
    pub max_unrotated_px: f64,
    /// Part of the image that both cameras describe (0 to 1).
    pub compared: f64,
    /// Grid points along x and y.
    pub grid: [usize; 2],
    /// The differences after the rotation, row by row.
    pub points: Vec<PixelDifference>,
}

/// Rays of the first camera, with the pixels they come from.
struct Problem<'a> {
    b: &'a CameraModel,
    rays: Vec<(Vector3<f64>, Vector2<f64>, f64)>,
}

impl Problem<'_> {
    fn residual(&self, r: &Rotation3<f64>, i: usize) -> Option<Vector2<f64>> {
        let (ray, pixel, _) = &self.rays[i];
        let x = r * ray;
        // The fold is not asked about here: the sum must run over the same points for every rotation.
        (x.z > 1e-6 * x.norm()).then(|| {
            let p = Vector2::new(x.x / x.z, x.y / x.z);
            self.b.intrinsics.pixel_from_normalised(&self.b.distort(&p)) - pixel
        })
    }
}

impl LeastSquares for Problem<'_> {
    type State = Rotation3<f64>;
    type Linearised = NormalEquations;

    fn cost(&self, r: &Self::State) -> Option<f64> {
        let terms = (0..self.rays.len()).map(|i| Some(0.5 * self.rays[i].2 * self.residual(r, i)?.norm_squared()));
        terms.sum()
    }

    fn linearise(&self, r: &Self::State) -> Option<NormalEquations> {
        let k = &self.b.intrinsics;
        let k = nalgebra::Matrix2::new(k.fx, k.skew, 0.0, k.fy);
        let mut normal = NormalEquations { cost: 0.0, gradient: DVector::zeros(3), information: DMatrix::zeros(3, 3) };
        for (i, (ray, _, weight)) in self.rays.iter().enumerate() {
            let residual = self.residual(r, i)?;
            let x = r * ray;
            let p = Vector2::new(x.x / x.z, x.y / x.z);
            let perspective = Matrix2x3::new(1.0, 0.0, -p.x, 0.0, 1.0, -p.y) / x.z;
            let jacobian = k * self.b.distort_jacobian(&p) * perspective * -cross_matrix(&x);
            normal.cost += 0.5 * weight * residual.norm_squared();
            normal.gradient += jacobian.transpose() * residual * *weight;
            normal.information += jacobian.transpose() * jacobian * *weight;
        }
        Some(normal)
    }

    fn retract(&self, r: &Self::State, step: &DVector<f64>) -> Self::State {
        let turned =
            UnitQuaternion::from_scaled_axis(Vector3::new(step[0], step[1], step[2])) * UnitQuaternion::from(*r);
        turned.to_rotation_matrix()
    }
}

/// The difference of two cameras of one image size, after the best rotation. Pixels of `a` are compared with pixels of `b`.
///
/// # Errors
/// [`Error::InvalidInput`] where the sizes differ, or fewer than 50 points of the grid are described by both lens models.
pub fn camera_difference(a: &CameraModel, b: &CameraModel) -> Result<CameraDifference, Error> {
    if a.size != b.size {
        return Err(Error::InvalidInput(format!(
            "the cameras have images of {} and {} pixels; scale one to the size of the other",
            a.size, b.size
        )));
    }
    let (width, height) = (a.size.width as f64 - 1.0, a.size.height as f64 - 1.0);
    let longer = width.max(height).max(1.0);
    let along = |side: f64| (((GRID - 1) as f64 * side / longer).round() as usize).max(2) + 1;
    let grid = [along(width), along(height)];
    let mut points = Vec::with_capacity(grid[0] * grid[1]);
    let mut problem = Problem { b, rays: Vec::new() };
    let mut known = Vec::new();
    for row in 0..grid[1] {
        for column in 0..grid[0] {
            let part = |i: usize, n: usize| i as f64 / (n - 1) as f64;
            let pixel = Vector2::new(width * part(column, grid[0]), height * part(row, grid[1]));
            let half = |i: usize, n: usize| if i == 0 || i == n - 1 { 0.5 } else { 1.0 };
            let weight = half(column, grid[0]) * half(row, grid[1]);
            let ray = a.ray(&pixel).filter(|ray| b.pixel(ray).is_some());
            if let Some(ray) = ray {
                problem.rays.push((ray, pixel, weight));
                known.push(points.len());
            }
            points.push(PixelDifference { pixel, difference_px: None, weight });
        }
    }
    if known.len() < MIN_POINTS {
        return Err(Error::InvalidInput(format!(
            "only {} of {} points of the image are seen by both cameras ({MIN_POINTS} are needed): their lens models do not reach \
             over the image. Check the distortion coefficients",
            known.len(),
            points.len()
        )));
    }
    let total: f64 = points.iter().map(|p| p.weight).sum();
    let seen: f64 = problem.rays.iter().map(|r| r.2).sum();
    let undefined = || Error::InvalidInput("the cameras' rays cannot be compared: check their parameters".into());
    let length = |differences: &[Vector2<f64>]| {
        let squares: f64 = differences.iter().zip(&problem.rays).map(|(d, r)| r.2 * d.norm_squared()).sum();
        let longest =
            differences.iter().map(Vector2::norm).enumerate().fold((0, 0.0), |m, d| if d.1 > m.1 { d } else { m });
        ((squares / seen).sqrt(), longest)
    };
    let differences = |r: &Rotation3<f64>| -> Option<Vec<Vector2<f64>>> {
        (0..problem.rays.len()).map(|i| problem.residual(r, i)).collect()
    };
    let start = Rotation3::identity();
    let (rms_unrotated_px, (_, max_unrotated_px)) = length(&differences(&start).ok_or_else(undefined)?);
    let best = minimise(&problem, start, &LmOptions::default()).ok_or_else(undefined)?.state;
    let after = differences(&best).ok_or_else(undefined)?;
    let (rms_px, (at, max_px)) = length(&after);
    for (i, difference) in known.iter().zip(&after) {
        points[*i].difference_px = Some(*difference);
    }
    Ok(CameraDifference {
        r_b_from_a: best.into_inner(),
        rotation_rad: best.angle(),
        rms_px,
        max_px,
        max_at_px: problem.rays[at].1,
        rms_unrotated_px,
        max_unrotated_px,
        compared: seen / total,
        grid,
        points,
    })
}

/// Whether two sets of parameters differ by more than their errors.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Significance {
    /// Squared Mahalanobis distance.
    pub chi_squared: f64,
    /// Parameters that have an error.
    pub degrees_of_freedom: usize,
    /// Probability of a distance at least as large by chance.
    pub p_value: f64,
}

/// The squared Mahalanobis distance of a difference under the sum of the covariances of both sides. Parameters without variance
/// (held on both sides) have no part. `None` where no parameter has an error, or the covariance is singular.
pub fn significance(difference: &DVector<f64>, covariance: &DMatrix<f64>) -> Option<Significance> {
    let free: Vec<usize> = (0..difference.len()).filter(|&i| covariance[(i, i)] > 0.0).collect();
    if free.is_empty() {
        return None;
    }
    // Pixels and lens coefficients differ in size by many orders: invert correlations.
    let sigma = |i: usize| covariance[(i, i)].sqrt();
    let scaled = DVector::from_iterator(free.len(), free.iter().map(|&i| difference[i] / sigma(i)));
    let correlation = DMatrix::from_fn(free.len(), free.len(), |r, c| {
        let (i, j) = (free[r], free[c]);
        covariance[(i, j)] / (sigma(i) * sigma(j))
    });
    let chi_squared = scaled.dot(&(inverse_spd(&correlation)? * &scaled));
    let degrees_of_freedom = free.len();
    chi_squared.is_finite().then(|| Significance {
        chi_squared,
        degrees_of_freedom,
        p_value: chi_squared_survival(chi_squared, degrees_of_freedom),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{distortion::Distortion, intrinsics::Intrinsics, size::ImageSize};

    fn camera() -> CameraModel {
        CameraModel {
            size: ImageSize::new(1280, 960),
            intrinsics: Intrinsics { fx: 1000.0, fy: 1003.0, cx: 645.0, cy: 470.0, skew: 0.0 },
            distortion: Distortion::radial(-0.2, 0.05),
            k3: 0.0,
        }
    }

    /// The least rms over rotations, by coordinate search with halving steps and no derivatives, on the grid of the result.
    fn brute_force(a: &CameraModel, b: &CameraModel, points: &[PixelDifference]) -> f64 {
        let rms = |w: &Vector3<f64>| {
            let r = Rotation3::from_scaled_axis(*w);
            let (mut sum, mut weights) = (0.0, 0.0);
            for p in points {
                let seen = b.pixel(&(r * a.ray(&p.pixel).unwrap())).unwrap();
                sum += p.weight * (seen - p.pixel).norm_squared();
                weights += p.weight;
            }
            (sum / weights).sqrt()
        };
        let (mut at, mut best, mut step) = (Vector3::zeros(), rms(&Vector3::zeros()), 0.01);
        while step > 1e-9 {
            let tries = (0..6).map(|i| {
                let mut w = at;
                w[i / 2] += if i % 2 == 0 { step } else { -step };
                (rms(&w), w)
            });
            let (value, w) = tries.min_by(|x, y| x.0.total_cmp(&y.0)).unwrap();
            if value < best {
                (best, at) = (value, w);
            } else {
                step *= 0.5;
            }
        }
        best
    }

    #[test]
    fn identical_cameras_do_not_differ() {
        let d = camera_difference(&camera(), &camera()).unwrap();
        assert!(d.max_px < 1e-9 && d.rotation_rad < 1e-12 && d.rms_unrotated_px < 1e-9, "{d:?}");
        assert_eq!((d.compared, d.grid), (1.0, [49, 37]));
    }

    #[test]
    fn a_rotation_takes_away_most_of_a_shifted_principal_point() {
        let mut b = camera();
        b.intrinsics.cx += 5.0;
        b.intrinsics.cy -= 3.0;
        let d = camera_difference(&camera(), &b).unwrap();
        assert!((d.rms_unrotated_px - 34f64.sqrt()).abs() < 1e-9, "{}", d.rms_unrotated_px);
        // What is left is of the order of the shift times the squared half field of view.
        assert!(d.rms_px > 0.1 && d.rms_px < 0.35 * d.rms_unrotated_px, "{}", d.rms_px);
        let direct = brute_force(&camera(), &b, &d.points);
        assert!((d.rms_px - direct).abs() < 1e-6, "{} {direct}", d.rms_px);
        // To first order the camera turns by the shift over the focal length.
        assert!((d.rotation_rad - (5e-3f64).hypot(3.0 / 1003.0)).abs() < 1.5e-3, "{}", d.rotation_rad);
    }

    #[test]
    fn a_difference_of_k1_stays_and_grows_outwards() {
        let mut b = camera();
        b.distortion.k1 += 0.01;
        let d = camera_difference(&camera(), &b).unwrap();
        // The rotation can do little about it: at the far corner f dk1 r³ of the ideal radius.
        let ray = camera().ray(&Vector2::new(0.0, 959.0)).unwrap();
        let expected = 1000.0 * 0.01 * ray.xy().norm().powi(3);
        assert!((d.max_unrotated_px / expected - 1.0).abs() < 0.01, "{} {expected}", d.max_unrotated_px);
        assert!(
            d.rms_px <= d.rms_unrotated_px && d.rms_px > 0.9 * d.rms_unrotated_px,
            "{} {}",
            d.rms_px,
            d.rms_unrotated_px
        );
        assert!((d.rms_px - brute_force(&camera(), &b, &d.points)).abs() < 1e-6);
        let corner = d.max_at_px.x.min(1279.0 - d.max_at_px.x) + d.max_at_px.y.min(959.0 - d.max_at_px.y);
        assert!(corner < 1e-9, "{}", d.max_at_px);
    }

    #[test]
    fn a_longer_focal_length_is_a_difference_that_no_rotation_takes_away() {
        let mut b = camera();
        (b.intrinsics.fx, b.intrinsics.fy) = (b.intrinsics.fx * 1.01, b.intrinsics.fy * 1.01);
        let d = camera_difference(&camera(), &b).unwrap();
        // One per cent of the distance from the principal point.
        assert!((d.max_px - 0.01 * 645f64.hypot(489.0)).abs() < 0.3, "{}", d.max_px);
    }

    #[test]
    fn different_sizes_and_lenses_that_fold_are_refused() {
        let small = camera().scaled_to(ImageSize::new(640, 480));
        let message = camera_difference(&camera(), &small).unwrap_err().to_string();
        assert!(message.contains("1280") && message.contains("640"), "{message}");
        let folding = CameraModel { distortion: Distortion::radial(-60.0, 0.0), ..camera() };
        assert!(camera_difference(&camera(), &folding).unwrap_err().to_string().contains("distortion"));
        // A lens model that reaches over part of the image is compared there.
        let partly = CameraModel { distortion: Distortion::radial(-0.75, 0.0), ..camera() };
        let compared = camera_difference(&camera(), &partly).unwrap().compared;
        assert!(compared > 0.4 && compared < 0.95, "{compared}");
    }

    #[test]
    fn the_mahalanobis_distance_leaves_out_what_is_held() {
        let covariance = DMatrix::from_row_slice(3, 3, &[4.0, 0.0, 3.0, 0.0, 0.0, 0.0, 3.0, 0.0, 9.0]);
        let s = significance(&DVector::from_vec(vec![2.0, 7.0, 3.0]), &covariance).unwrap();
        // (1, 1) under a correlation of one half: 2 (1 - ½) / (1 - ¼).
        assert!((s.chi_squared - 4.0 / 3.0).abs() < 1e-12);
        assert_eq!(s.degrees_of_freedom, 2);
        assert!((s.p_value - (-2.0f64 / 3.0).exp()).abs() < 1e-9);
        assert_eq!(significance(&DVector::from_vec(vec![1.0]), &DMatrix::zeros(1, 1)), None);
    }
}
