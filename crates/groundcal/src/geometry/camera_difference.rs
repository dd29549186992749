//! How far two calibrations of one camera differ, in pixels.
//!
//! A user of a calibration estimates the camera's pose with it, and a change of the principal point is then nearly a rotation
//! of the camera. What matters is what no rotation takes away:
//!
//! ```text
//! d_i(R) = project_b(R unproject_a(u_i)) - u_i,      min over R of Σ w_i |d_i(R)|²
//! ```
//!
//! over a grid of pixels u_i of the image (trapezoidal weights: the mean is that over the image's area), on rays of any direction
//! ([`Camera`]). Depth and translation are left out: for a pose of six numbers the difference is at most this.

use nalgebra::{DMatrix, DVector, Matrix3, Rotation3, UnitQuaternion, Vector2, Vector3};

use crate::{
    error::Error,
    geometry::{camera::Camera, size::ImageSize},
    numerics::{
        levenberg_marquardt::{LeastSquares, LmOptions, NormalEquations, minimise},
        linalg::cross_matrix,
    },
};

/// Grid points along the longer side of the image.
const GRID: usize = 49;
/// Fewest grid points that both cameras see.
const MIN_POINTS: usize = 50;

/// A grid point and how far the second camera sees it from where the first does.
#[derive(Debug, Clone, Copy, PartialEq)]
struct PixelDifference {
    /// Pixel of the first camera.
    pixel: Vector2<f64>,
    /// Pixel of the second camera less that of the first; `None` where either lens model gives nothing.
    difference_px: Option<Vector2<f64>>,
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
    /// Pixel of the second camera less that of the first after the rotation, row by row; `None` where either lens model gives nothing.
    pub differences_px: Vec<Option<Vector2<f64>>>,
}

/// A ray of the first camera, with the pixel it comes from and that pixel's part of the area.
struct Ray {
    ray: Vector3<f64>,
    pixel: Vector2<f64>,
    weight: f64,
}

/// Rays of the first camera, to be seen by the second.
struct Problem<'a> {
    b: &'a Camera,
    rays: Vec<Ray>,
}

/// How far inside the largest angle of the lens model a ray beyond it is taken to be seen, relative.
const INSIDE: f64 = 1.0 - 1e-9;

impl Problem<'_> {
    /// The direction in the second camera's coordinates. The sum must run over the same points for every rotation: what is turned
    /// out of the second lens stays at its edge.
    fn turned(&self, r: &Rotation3<f64>, ray: &Ray) -> Vector3<f64> {
        let x = r * ray.ray;
        let (edge, off_axis) = (self.b.lens.max_angle_rad() * INSIDE, x.xy().norm());
        if self.b.lens.max_radius().is_finite() && off_axis.atan2(x.z) > edge && off_axis > 0.0 {
            let outward = x.xy() * (edge.sin() / off_axis);
            return Vector3::new(outward.x, outward.y, edge.cos());
        }
        x
    }

    fn residual(&self, r: &Rotation3<f64>, ray: &Ray) -> Option<Vector2<f64>> {
        self.b.project(&self.turned(r, ray)).map(|seen| seen - ray.pixel)
    }
}

impl LeastSquares for Problem<'_> {
    type State = Rotation3<f64>;
    type Linearised = NormalEquations;

    fn cost(&self, r: &Self::State) -> Option<f64> {
        self.rays.iter().map(|ray| Some(0.5 * ray.weight * self.residual(r, ray)?.norm_squared())).sum()
    }

    fn linearise(&self, r: &Self::State) -> Option<NormalEquations> {
        let mut normal = NormalEquations { cost: 0.0, gradient: DVector::zeros(3), information: DMatrix::zeros(3, 3) };
        for ray in &self.rays {
            let x = self.turned(r, ray);
            let seen = self.b.project_with_jacobians(&x)?;
            let residual = seen.pixel - ray.pixel;
            let jacobian = seen.by_point * -cross_matrix(&x);
            normal.cost += 0.5 * ray.weight * residual.norm_squared();
            normal.gradient += jacobian.transpose() * residual * ray.weight;
            normal.information += jacobian.transpose() * jacobian * ray.weight;
        }
        Some(normal)
    }

    fn retract(&self, r: &Self::State, step: &DVector<f64>) -> Self::State {
        let turned =
            UnitQuaternion::from_scaled_axis(Vector3::new(step[0], step[1], step[2])) * UnitQuaternion::from(*r);
        turned.to_rotation_matrix()
    }
}

/// The points of the grid, row by row, differences yet unknown; and its numbers along x and y.
fn grid_over(size: ImageSize) -> (Vec<PixelDifference>, [usize; 2]) {
    let (width, height) = (size.width as f64 - 1.0, size.height as f64 - 1.0);
    let longer = width.max(height).max(1.0);
    let along = |side: f64| (((GRID - 1) as f64 * side / longer).round() as usize).max(2) + 1;
    let grid = [along(width), along(height)];
    let part = |i: usize, n: usize| i as f64 / (n - 1) as f64;
    let half = |i: usize, n: usize| if i == 0 || i == n - 1 { 0.5 } else { 1.0 };
    let points = (0..grid[1]).flat_map(|row| (0..grid[0]).map(move |column| (row, column)));
    let points = points.map(|(row, column)| PixelDifference {
        pixel: Vector2::new(width * part(column, grid[0]), height * part(row, grid[1])),
        difference_px: None,
        weight: half(column, grid[0]) * half(row, grid[1]),
    });
    (points.collect(), grid)
}

/// Root mean square and largest length, and where the largest is, of the differences that there are.
fn lengths(points: &[PixelDifference]) -> (f64, f64, Vector2<f64>) {
    let (mut squares, mut weights, mut largest) = (0.0, 0.0, (0.0, Vector2::zeros()));
    for p in points {
        let Some(d) = p.difference_px else { continue };
        squares += p.weight * d.norm_squared();
        weights += p.weight;
        if d.norm() > largest.0 {
            largest = (d.norm(), p.pixel);
        }
    }
    ((squares / weights).sqrt(), largest.0, largest.1)
}

/// The difference of two cameras of one image size, after the best rotation. Pixels of `a` are compared with pixels of `b`.
///
/// # Errors
/// [`Error::InvalidInput`] where the sizes differ, or fewer than 50 points of the grid are described by both lens models.
pub fn camera_difference(a: &Camera, b: &Camera) -> Result<CameraDifference, Error> {
    if a.size != b.size {
        return Err(Error::InvalidInput(format!(
            "the cameras have images of {} and {} pixels; scale one to the size of the other",
            a.size, b.size
        )));
    }
    let (mut points, grid) = grid_over(a.size);
    let mut problem = Problem { b, rays: Vec::new() };
    let mut known = Vec::new();
    for (i, p) in points.iter().enumerate() {
        if let Some(ray) = a.unproject(&p.pixel).filter(|ray| b.project(ray).is_some()) {
            problem.rays.push(Ray { ray, pixel: p.pixel, weight: p.weight });
            known.push(i);
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
    let seen: f64 = problem.rays.iter().map(|r| r.weight).sum();
    let undefined = || Error::InvalidInput("the cameras' rays cannot be compared: check their parameters".into());
    let mut measure = |r: &Rotation3<f64>| {
        for (i, ray) in known.iter().zip(&problem.rays) {
            // What the rotation takes beyond the second lens has no difference.
            points[*i].difference_px = b.project(&(r * ray.ray)).map(|seen| seen - ray.pixel);
        }
        let lengths = lengths(&points);
        lengths.0.is_finite().then_some(lengths).ok_or_else(undefined)
    };
    let start = Rotation3::identity();
    let (rms_unrotated_px, max_unrotated_px, _) = measure(&start)?;
    let best = minimise(&problem, start, &LmOptions::default()).ok_or_else(undefined)?.state;
    let (rms_px, max_px, max_at_px) = measure(&best)?;
    Ok(CameraDifference {
        r_b_from_a: best.into_inner(),
        rotation_rad: best.angle(),
        rms_px,
        max_px,
        max_at_px,
        rms_unrotated_px,
        max_unrotated_px,
        compared: seen / total,
        grid,
        differences_px: points.into_iter().map(|p| p.difference_px).collect(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{
        intrinsics::Intrinsics,
        lens::{Division, Fisheye, Lens},
    };

    fn camera() -> Camera {
        Camera {
            size: ImageSize::new(1280, 960),
            intrinsics: Intrinsics { fx: 1000.0, fy: 1003.0, cx: 645.0, cy: 470.0, skew: 0.0 },
            lens: Lens::radial(-0.2, 0.05),
        }
    }

    /// The least rms over rotations, by coordinate search with halving steps and no derivatives, on the grid of the result.
    fn brute_force(a: &Camera, b: &Camera) -> f64 {
        let (points, _) = grid_over(a.size);
        let rms = |w: &Vector3<f64>| {
            let r = Rotation3::from_scaled_axis(*w);
            let (mut sum, mut weights) = (0.0, 0.0);
            for p in &points {
                let seen = b.project(&(r * a.unproject(&p.pixel).unwrap())).unwrap();
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
        let direct = brute_force(&camera(), &b);
        assert!((d.rms_px - direct).abs() < 1e-6, "{} {direct}", d.rms_px);
        // To first order the camera turns by the shift over the focal length.
        assert!((d.rotation_rad - (5e-3f64).hypot(3.0 / 1003.0)).abs() < 1.5e-3, "{}", d.rotation_rad);
    }

    #[test]
    fn a_difference_of_k1_stays_and_grows_outwards() {
        let mut b = camera();
        b.lens = Lens::radial(-0.19, 0.05);
        let d = camera_difference(&camera(), &b).unwrap();
        // The rotation can do little about it: at the far corner f dk1 r³ of the ideal radius.
        let ray = camera().unproject(&Vector2::new(0.0, 959.0)).unwrap();
        let expected = 1000.0 * 0.01 * (ray.xy() / ray.z).norm().powi(3);
        assert!((d.max_unrotated_px / expected - 1.0).abs() < 0.01, "{} {expected}", d.max_unrotated_px);
        assert!(
            d.rms_px <= d.rms_unrotated_px && d.rms_px > 0.9 * d.rms_unrotated_px,
            "{} {}",
            d.rms_px,
            d.rms_unrotated_px
        );
        assert!((d.rms_px - brute_force(&camera(), &b)).abs() < 1e-6);
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
        let small = camera().scaled_to(ImageSize::new(640, 480)).unwrap();
        let message = camera_difference(&camera(), &small).unwrap_err().to_string();
        assert!(message.contains("1280") && message.contains("640"), "{message}");
        let folding = Camera { lens: Lens::radial(-60.0, 0.0), ..camera() };
        assert!(camera_difference(&camera(), &folding).unwrap_err().to_string().contains("distortion"));
        // A lens model that reaches over part of the image is compared there.
        let partly = Camera { lens: Lens::radial(-0.75, 0.0), ..camera() };
        let compared = camera_difference(&camera(), &partly).unwrap().compared;
        assert!(compared > 0.4 && compared < 0.95, "{compared}");
    }

    /// Half a sphere and more: rays square to the axis lie inside the image.
    fn wide(lens: Lens) -> Camera {
        Camera { intrinsics: Intrinsics { fx: 385.0, fy: 386.0, cx: 645.0, cy: 470.0, skew: 0.0 }, lens, ..camera() }
    }

    #[test]
    fn fields_of_view_beyond_180_degrees_are_compared() {
        let a = wide(Lens::Fisheye(Fisheye::new([0.01, -0.003, 0.0005, 0.0])));
        assert!(a.unproject(&Vector2::new(1279.0, 470.0)).unwrap().z < 0.0);
        assert!(camera_difference(&a, &a).unwrap().max_px < 1e-9);
        let mut b = wide(Lens::Fisheye(Fisheye::new([0.012, -0.003, 0.0004, 0.0])));
        b.intrinsics.cx += 2.0;
        let d = camera_difference(&a, &b).unwrap();
        assert_eq!(d.compared, 1.0);
        assert!(d.rms_px < 0.9 * d.rms_unrotated_px && d.rms_px > 0.1, "{} {}", d.rms_px, d.rms_unrotated_px);
        assert!((d.rms_px - brute_force(&a, &b)).abs() < 1e-6);
        // Another model of the same lens: far from it, over the whole image.
        let d = camera_difference(&a, &wide(Lens::Division(Division::new(-0.3)))).unwrap();
        assert!(d.compared == 1.0 && d.max_px > 1.0);
        // A pinhole sees what lies in front of it.
        let d = camera_difference(&a, &wide(Lens::None)).unwrap();
        assert!(d.compared < 0.95, "{}", d.compared);
    }

    #[test]
    fn what_a_rotation_takes_beyond_a_fold_stays_at_the_edge() {
        // The second lens ends at 80 degrees, inside the image; its principal point is off by a degree.
        let a = wide(Lens::Fisheye(Fisheye::default()));
        let mut b = wide(Lens::Fisheye(Fisheye::new([-0.171, 0.0, 0.0, 0.0])));
        b.intrinsics.cx += 7.0;
        assert!((b.lens.max_angle_rad().to_degrees() - 80.0).abs() < 1.0);
        let d = camera_difference(&a, &b).unwrap();
        assert!(d.compared > 0.6 && d.compared < 0.95, "{}", d.compared);
        assert!((d.rotation_rad - 7.0 / 385.0).abs() < 4e-3, "{}", d.rotation_rad);
    }
}
