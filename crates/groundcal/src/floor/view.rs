//! The floor that a view sees: between pixels and points of the plane, with the lens; what part of it is seen; grids on it.
//!
//! ```text
//! image from floor   x ~ K R [e1 e2 -c] (X, Y, 1)ᵀ
//! floor from image   (X, Y, 1)ᵀ ~ | h  0  -c_x |
//!                                 | 0  h  -c_y | Rᵀ K⁻¹ x,     c = (c_x, c_y, h)
//!                                 | 0  0  -1   |
//! ```
//!
//! Both matrices act on *ideal* pixels, those of a lens without distortion; [`FloorView::pixel_from_floor`] and
//! [`FloorView::floor_from_pixel`] include the lens. The third coordinate is positive in front of the camera, and below the
//! horizon. Pixel (0, 0) is the centre of the top-left pixel; the floor is Z = 0 and has the unit of the view's centre.

use nalgebra::{Matrix3, SMatrix, SVector, Vector2, Vector3};

use crate::{
    error::Error,
    floor::outline::{border, clipped, convex_hull},
    geometry::{
        attitude::{angles_from_rotation, rotation_cam_from_world},
        intrinsics::Intrinsics,
        lens::Lens,
        plane_view::View,
        size::ImageSize,
    },
    result::{Camera, Covariance, FloorHomography, Parameter, ViewParameter, ViewReport},
};

/// Sides of the polygon that stands for the circle of the largest distance.
const CIRCLE_SIDES: usize = 128;
/// Points on each side of the image whose rays make the outline of the floor seen.
const BORDER_POINTS: usize = 48;
/// Points of each kind, on a side and round a circle, that make the hull of what a wide lens sees.
const HULL_POINTS: usize = 512;

/// A camera over the floor, ready to map points both ways.
///
/// # Examples
/// ```
/// # use groundcal::{ImagePair, Options, Silent, calibrate_matches, synthetic::PointScene};
/// # let scene = PointScene::nominal(0);
/// # let pairs: Vec<ImagePair> = scene.pairs();
/// # let names: Vec<String> = (0..6).map(|i| format!("view {i}")).collect();
/// # let calibration = calibrate_matches(&names, scene.size, &pairs, &Options::default(), &Silent)?;
/// use groundcal::{FloorView, nalgebra::Vector2};
/// let view = FloorView::of_report(&calibration.camera, &calibration.views[0])?;
/// let point = view.floor_from_pixel(&Vector2::new(640.0, 700.0)).expect("below the horizon");
/// let pixel = view.pixel_from_floor(&point).expect("in front");
/// assert!((pixel - Vector2::new(640.0, 700.0)).norm() < 1e-6);
/// # Ok::<(), groundcal::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct FloorView {
    intrinsics: Intrinsics,
    lens: Lens,
    rotation: Matrix3<f64>,
    centre: Vector3<f64>,
}

impl FloorView {
    /// A view by a camera.
    ///
    /// # Errors
    /// [`Error::InvalidInput`] when a number is not finite or the optical centre is not above the floor.
    pub fn new(intrinsics: &Intrinsics, lens: impl Into<Lens>, view: &View) -> Result<Self, Error> {
        let (k, lens) = (intrinsics, lens.into());
        let finite = k.matrix().iter().chain(view.centre.iter()).all(|v| v.is_finite())
            && [view.pitch_down_rad, view.roll_rad, view.yaw_rad].iter().all(|v| v.is_finite())
            && lens.parameters().iter().all(|v| v.is_finite());
        if !finite || k.fx <= 0.0 || k.fy <= 0.0 {
            return Err(Error::InvalidInput(
                "a view's camera and pose must be finite, its focal lengths positive".into(),
            ));
        }
        if view.centre.z <= 0.0 {
            return Err(Error::InvalidInput(format!(
                "an optical centre at height {}: not above the floor",
                view.centre.z
            )));
        }
        Ok(Self {
            intrinsics: *k,
            lens,
            rotation: rotation_cam_from_world(view.pitch_down_rad, view.roll_rad, view.yaw_rad),
            centre: view.centre,
        })
    }

    /// Points of the floor from ideal pixels, with the covariance that follows from that of the camera and the view.
    pub(crate) fn homography_with_covariance(&self, covariance: &Covariance<ViewParameter>) -> FloorHomography {
        let by = self
            .derivative_by_numbers(|v| SVector::<f64, 9>::from_row_slice(v.floor_from_image().transpose().as_slice()));
        let h = self.floor_from_image();
        let c = by * covariance.of(&ViewParameter::ALL) * by.transpose();
        FloorHomography {
            matrix: std::array::from_fn(|r| std::array::from_fn(|c| h[(r, c)])),
            covariance: std::array::from_fn(|r| std::array::from_fn(|s| 0.5 * (c[(r, s)] + c[(s, r)]))),
        }
    }

    /// A view of a calibration, in the floor's unit of its positions.
    ///
    /// # Errors
    /// [`Error::InvalidInput`] when the view has no position (a camera that turns on the spot before a distant scene).
    pub fn of_report(camera: &Camera, view: &ViewReport) -> Result<Self, Error> {
        let position = view.position.ok_or_else(|| {
            Error::InvalidInput(format!("{} has no position over a floor: its scene is directions only", view.image))
        })?;
        let pose = View {
            pitch_down_rad: view.pitch_down_deg.to_radians(),
            roll_rad: view.roll_deg.to_radians(),
            yaw_rad: view.yaw_deg.to_radians(),
            centre: Vector3::from(position),
        };
        Self::new(&camera.intrinsics(), camera.lens(), &pose)
    }

    /// Optical centre: x, y, height.
    pub fn centre(&self) -> &Vector3<f64> {
        &self.centre
    }

    /// The point of the floor below the optical centre.
    pub(crate) fn foot(&self) -> Vector2<f64> {
        self.centre.xy()
    }

    /// Unit vector on the floor along the heading: that of the optical axis, or of the image's upward direction for a camera that
    /// looks straight down.
    pub fn heading(&self) -> Vector2<f64> {
        let axis = self.rotation.row(2).transpose().xy();
        let up = -self.rotation.row(1).transpose().xy();
        let level = if axis.norm() > 1e-6 { axis } else { up };
        level.try_normalize(0.0).unwrap_or(Vector2::x())
    }

    /// Ideal pixels from points of the floor, homogeneous; the third coordinate is the depth.
    #[cfg(test)]
    pub(crate) fn image_from_floor(&self) -> Matrix3<f64> {
        let [x, y] = [0, 1].map(|i| self.rotation.column(i).into_owned());
        self.intrinsics.matrix() * Matrix3::from_columns(&[x, y, -(self.rotation * self.centre)])
    }

    /// Points of the floor from ideal pixels, homogeneous; the third coordinate is positive below the horizon.
    pub fn floor_from_image(&self) -> Matrix3<f64> {
        self.floor_from_ray() * self.intrinsics.inverse_matrix()
    }

    /// Points of the floor from rays in camera coordinates.
    fn floor_from_ray(&self) -> Matrix3<f64> {
        let c = &self.centre;
        Matrix3::new(c.z, 0.0, -c.x, 0.0, c.z, -c.y, 0.0, 0.0, -1.0) * self.rotation.transpose()
    }

    /// The pixel at which a point of the floor is seen; `None` where the lens model describes none: beyond its fold, or behind a
    /// camera whose lens does not see there. It may lie outside the image.
    pub fn pixel_from_floor(&self, point: &Vector2<f64>) -> Option<Vector2<f64>> {
        self.pixel_from_ray(&(self.rotation * (Vector3::new(point.x, point.y, 0.0) - self.centre)))
    }

    /// The pixel at which a point far away in a direction (world coordinates) is seen; `None` as above.
    pub(crate) fn pixel_from_direction(&self, direction: &Vector3<f64>) -> Option<Vector2<f64>> {
        self.pixel_from_ray(&(self.rotation * direction))
    }

    /// The direction (world coordinates, unit length) of what is seen at a pixel; `None` where the lens model gives no ray.
    pub(crate) fn direction(&self, pixel: &Vector2<f64>) -> Option<Vector3<f64>> {
        self.ray(pixel).map(|ray| self.rotation.transpose() * ray)
    }

    fn pixel_from_ray(&self, ray: &Vector3<f64>) -> Option<Vector2<f64>> {
        self.lens.project(ray).map(|d| self.intrinsics.pixel_from_normalised(&d))
    }

    /// The point of the floor seen at a pixel; `None` at or above the horizon, or where the lens model gives no ray.
    pub fn floor_from_pixel(&self, pixel: &Vector2<f64>) -> Option<Vector2<f64>> {
        self.floor_along(&self.ray(pixel)?)
    }

    /// The point of the floor along a ray in camera coordinates; `None` at or above the horizon.
    fn floor_along(&self, ray: &Vector3<f64>) -> Option<Vector2<f64>> {
        let q = self.floor_from_ray() * ray;
        (q.z > 1e-12 * q.norm()).then(|| Vector2::new(q.x / q.z, q.y / q.z))
    }

    /// The ray (unit length) of a pixel in camera coordinates.
    fn ray(&self, pixel: &Vector2<f64>) -> Option<Vector3<f64>> {
        self.lens.unproject(&self.intrinsics.normalised_from_pixel(pixel))
    }

    /// Outline of the floor within `max_distance` of the foot (floor units) that an image of a size sees: corners in order
    /// round it, not closed; empty when it sees none. With a lens that sees behind the camera, the convex hull of that.
    pub fn seen_floor(&self, size: ImageSize, max_distance: f64) -> Vec<Vector2<f64>> {
        if self.lens.is_flat() { self.seen_in_front(size, max_distance) } else { self.hull_of_seen(size, max_distance) }
    }

    /// Clipped in homogeneous coordinates, so that the horizon needs no care: the half planes that make the circle leave nothing of
    /// it.
    fn seen_in_front(&self, size: ImageSize, max_distance: f64) -> Vec<Vector2<f64>> {
        let floor_from_ray = self.floor_from_ray();
        let outline = border(size, BORDER_POINTS);
        let mut polygon: Vec<Vector3<f64>> =
            outline.iter().filter_map(|p| self.ray(p)).map(|r| floor_from_ray * r).collect();
        let foot = self.foot();
        // An inscribed polygon would cut the circle; this one touches it from outside by less than 0.1 %.
        for i in 0..CIRCLE_SIDES {
            let (sin, cos) = (std::f64::consts::TAU * i as f64 / CIRCLE_SIDES as f64).sin_cos();
            let side = Vector3::new(-cos, -sin, max_distance + cos * foot.x + sin * foot.y);
            polygon = clipped(&polygon, &side);
        }
        polygon.iter().filter(|q| q.z > 0.0).map(|q| Vector2::new(q.x / q.z, q.y / q.z)).collect()
    }

    /// What is seen ends at the image's border, at the lens's largest angle or at the circle.
    fn hull_of_seen(&self, size: ImageSize, max_distance: f64) -> Vec<Vector2<f64>> {
        let foot = self.foot();
        let (w, h) = (size.width as f64, size.height as f64);
        let inside = |p: &Vector2<f64>| p.x >= -0.5 && p.y >= -0.5 && p.x <= w - 0.5 && p.y <= h - 0.5;
        let turn = |i: usize| (std::f64::consts::TAU * i as f64 / HULL_POINTS as f64).sin_cos();
        let at_border = border(size, HULL_POINTS).into_iter().filter_map(|p| self.floor_from_pixel(&p));
        let edge = self.lens.max_angle_rad() * (1.0 - 1e-6);
        let at_edge = (0..HULL_POINTS).filter_map(|i| {
            let (sin, cos) = turn(i);
            let ray = Vector3::new(cos * edge.sin(), sin * edge.sin(), edge.cos());
            self.pixel_from_ray(&ray).filter(inside).and_then(|_| self.floor_along(&ray))
        });
        let circle = (0..HULL_POINTS).map(|i| {
            let (sin, cos) = turn(i);
            foot + Vector2::new(cos, sin) * max_distance
        });
        let on_circle = circle.filter(|p| self.pixel_from_floor(p).is_some_and(|p| inside(&p)));
        let near = |p: &Vector2<f64>| (p - foot).norm() <= max_distance * (1.0 + 1e-9);
        convex_hull(at_border.chain(at_edge).filter(near).chain(on_circle).collect())
    }
}

/// How far each number of [`FloorView::derivative_by_numbers`] is moved for the difference, relative to a pixel or one.
const STEP: f64 = 1e-6;

impl FloorView {
    /// Derivative of something made of a view by the numbers of [`ViewReport::covariance`], in the order of [`ViewParameter::ALL`].
    /// Central differences.
    pub(crate) fn derivative_by_numbers<const N: usize>(
        &self,
        value: impl Fn(&Self) -> SVector<f64, N>,
    ) -> SMatrix<f64, N, { ViewParameter::COUNT }> {
        let (pitch, roll, yaw) = angles_from_rotation(&self.rotation);
        // A lens without distortion bends with coefficients all the same.
        let lens = if self.lens == Lens::None { Lens::radial(0.0, 0.0) } else { self.lens };
        let bent = |name: &str, step: f64| {
            let mut parameters = lens.parameters();
            let at = lens.parameter_names().iter().position(|n| *n == name);
            if let Some(p) = at.and_then(|i| parameters.get_mut(i)) {
                *p += step;
            }
            lens.with_parameters(&parameters).unwrap_or(lens)
        };
        let moved = |p: ViewParameter, step: f64| {
            let mut m = self.clone();
            let k = &mut m.intrinsics;
            let turned = |pitch, roll, yaw| rotation_cam_from_world(pitch, roll, yaw);
            match p {
                ViewParameter::Camera(Parameter::Fx) => k.fx += step,
                ViewParameter::Camera(Parameter::Fy) => k.fy += step,
                ViewParameter::Camera(Parameter::Cx) => k.cx += step,
                ViewParameter::Camera(Parameter::Cy) => k.cy += step,
                ViewParameter::Camera(Parameter::Skew) => k.skew += step,
                ViewParameter::Camera(of_lens) => m.lens = bent(of_lens.name(), step),
                ViewParameter::PitchDownRad => m.rotation = turned(pitch + step, roll, yaw),
                ViewParameter::RollRad => m.rotation = turned(pitch, roll + step, yaw),
                ViewParameter::YawRad => m.rotation = turned(pitch, roll, yaw + step),
                ViewParameter::X => m.centre.x += step,
                ViewParameter::Y => m.centre.y += step,
                ViewParameter::Height => m.centre.z += step,
            }
            value(&m)
        };
        let mut by = SMatrix::<f64, N, { ViewParameter::COUNT }>::zeros();
        for (i, p) in ViewParameter::ALL.into_iter().enumerate() {
            let in_pixels = matches!(p, ViewParameter::Camera(p) if !p.is_of_lens());
            let h = if in_pixels { STEP * self.intrinsics.fx } else { STEP };
            by.set_column(i, &((moved(p, h) - moved(p, -h)) / (2.0 * h)));
        }
        by
    }

    /// Derivative of [`Self::floor_from_pixel`] by the same numbers; with their covariance it gives the error bars of points and
    /// distances on the floor. `None` where no floor is seen.
    pub(crate) fn floor_point_jacobian(
        &self,
        pixel: &Vector2<f64>,
    ) -> Option<SMatrix<f64, 2, { ViewParameter::COUNT }>> {
        self.floor_from_pixel(pixel)?;
        // What falls off the lens's edge within the step has no derivative.
        let nowhere = Vector2::repeat(f64::NAN);
        let by = self.derivative_by_numbers(|v| v.floor_from_pixel(pixel).unwrap_or(nowhere));
        by.iter().all(|v| v.is_finite()).then_some(by)
    }
}

/// A raster on the floor, as on a map: columns along [`FloorGrid::right`], rows a quarter turn clockwise of it seen from above.
///
/// # Examples
/// ```
/// use groundcal::{FloorGrid, ImageSize, nalgebra::Vector2};
/// let grid = FloorGrid { top_left: Vector2::new(0.0, 1.0), right: Vector2::x(), unit_per_px: 0.01, size: ImageSize::new(200, 100) };
/// let point = grid.floor_from_pixel(&Vector2::new(100.0, 50.0));
/// assert!((point - Vector2::new(1.0, 0.5)).norm() < 1e-12);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FloorGrid {
    /// The point of the floor at the centre of the top-left pixel.
    pub top_left: Vector2<f64>,
    /// Unit vector of the columns' direction on the floor.
    pub right: Vector2<f64>,
    /// Side of a pixel, floor units.
    pub unit_per_px: f64,
    /// Columns and rows.
    pub size: ImageSize,
}

impl FloorGrid {
    /// The smallest grid of a direction and a side of pixels that covers points of the floor. Pixel centres lie at whole
    /// multiples of the side from the floor's origin, so that grids of one direction and side fit together. `None` without points,
    /// or where columns or rows would be too many to count.
    pub fn covering(points: &[Vector2<f64>], right: &Vector2<f64>, unit_per_px: f64) -> Option<Self> {
        let right = right.try_normalize(0.0)?;
        let down = Vector2::new(right.y, -right.x);
        let along = |axis: &Vector2<f64>| {
            let all = points.iter().map(|p| p.dot(axis) / unit_per_px);
            let (low, high) = all.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
            let (first, last) = ((low + 0.5).floor(), (high + 0.5).floor());
            let count = last - first + 1.0;
            // Also refuses what is not a number.
            (1.0..1e9).contains(&count).then_some((first, count as usize))
        };
        let ((x, width), (y, height)) = (along(&right)?, along(&down)?);
        let top_left = (right * x + down * y) * unit_per_px;
        Some(Self { top_left, right, unit_per_px, size: ImageSize::new(width, height) })
    }

    /// Direction of the rows on the floor.
    pub(crate) fn down(&self) -> Vector2<f64> {
        Vector2::new(self.right.y, -self.right.x)
    }

    /// The point of the floor at a pixel of the grid.
    pub fn floor_from_pixel(&self, pixel: &Vector2<f64>) -> Vector2<f64> {
        self.top_left + (self.right * pixel.x + self.down() * pixel.y) * self.unit_per_px
    }

    /// The pixel of the grid at a point of the floor.
    pub fn pixel_from_floor(&self, point: &Vector2<f64>) -> Vector2<f64> {
        let d = (point - self.top_left) / self.unit_per_px;
        Vector2::new(d.dot(&self.right), d.dot(&self.down()))
    }

    /// [`Self::floor_from_pixel`] as a matrix on homogeneous pixels.
    pub fn floor_from_pixel_matrix(&self) -> Matrix3<f64> {
        let (r, d, o) = (self.right * self.unit_per_px, self.down() * self.unit_per_px, self.top_left);
        Matrix3::new(r.x, d.x, o.x, r.y, d.y, o.y, 0.0, 0.0, 1.0)
    }

    /// Number of pixels.
    pub(crate) fn pixels(&self) -> u64 {
        self.size.width as u64 * self.size.height as u64
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{
        lens::{Division, Fisheye, Radtan},
        plane_view::project,
    };

    fn example() -> (FloorView, View, Intrinsics) {
        let k = Intrinsics { fx: 700.0, fy: 710.0, cx: 400.0, cy: 310.0, skew: 1.0 };
        let view = View { pitch_down_rad: 0.5, roll_rad: 0.2, yaw_rad: -2.0, centre: Vector3::new(0.3, -0.7, 1.2) };
        let lens = Lens::Radtan(Radtan::new([-0.15, 0.03, 1e-3, -5e-4, 0.0]));
        (FloorView::new(&k, lens, &view).unwrap(), view, k)
    }

    #[test]
    fn homographies_are_those_of_the_projection_and_inverses() {
        let (floor, view, k) = example();
        let product = floor.image_from_floor() * floor.floor_from_image();
        assert!((product / product[(2, 2)] - Matrix3::identity()).norm() < 1e-9);
        let point = floor.foot() + floor.heading() * 1.7 + Vector2::new(0.1, 0.2);
        let q = floor.image_from_floor() * point.push(1.0);
        assert!((Vector2::new(q.x / q.z, q.y / q.z) - project(&k, &view, &point).unwrap()).norm() < 1e-9);
        let ideal = floor.floor_from_image() * Vector3::new(q.x / q.z, q.y / q.z, 1.0);
        assert!(ideal.z > 0.0 && (Vector2::new(ideal.x / ideal.z, ideal.y / ideal.z) - point).norm() < 1e-12);
    }

    #[test]
    fn pixels_with_the_lens_map_back() {
        let (floor, ..) = example();
        let pixel = Vector2::new(700.0, 500.0);
        let point = floor.floor_from_pixel(&pixel).unwrap();
        assert!((floor.pixel_from_floor(&point).unwrap() - pixel).norm() < 1e-8);
        assert_eq!(floor.floor_from_pixel(&Vector2::new(400.0, -400.0)), None, "above the horizon");
        assert_eq!(floor.pixel_from_floor(&(floor.foot() - floor.heading() * 5.0)), None, "behind the camera");
    }

    #[test]
    fn the_floor_seen_ends_at_the_image_and_at_the_largest_distance() {
        let (floor, ..) = example();
        let (size, far) = (ImageSize::new(800, 600), 6.0);
        let outline = floor.seen_floor(size, far);
        assert!(outline.len() > 20);
        let mut farthest: f64 = 0.0;
        for p in &outline {
            let distance = (p - floor.foot()).norm();
            farthest = farthest.max(distance);
            assert!(distance < far * 1.001);
            let pixel = floor.pixel_from_floor(p).unwrap();
            let inset = [pixel.x + 0.5, pixel.y + 0.5, 799.5 - pixel.x, 599.5 - pixel.y];
            let at_border = inset.iter().any(|v| v.abs() < 0.2);
            assert!(inset.iter().all(|v| *v > -0.2) && (at_border || distance > far * 0.9985), "{pixel} {distance}");
        }
        assert!(farthest > far * 0.9995, "the horizon is in the image");
        // Looking up, nothing of the floor is seen.
        let (_, view, k) = example();
        let up = View { pitch_down_rad: -1.2, ..view };
        assert!(FloorView::new(&k, Lens::None, &up).unwrap().seen_floor(size, far).is_empty());
    }

    #[test]
    fn a_lens_that_sees_behind_the_camera_sees_the_floor_there() {
        // 200 degrees across, straight down and tilted; the image circle fits into the height.
        let size = ImageSize::new(900, 700);
        let k = Intrinsics::square(190.0, 449.5, 349.5);
        for lens in [Lens::Fisheye(Fisheye::new([0.02, -0.005, 0.0, 0.0])), Lens::Division(Division::new(-0.4))] {
            for pitch in [90f64, 50.0] {
                let view = View {
                    pitch_down_rad: pitch.to_radians(),
                    roll_rad: 0.1,
                    yaw_rad: 0.3,
                    centre: Vector3::new(1.0, 2.0, 1.5),
                };
                let floor = FloorView::new(&k, lens, &view).unwrap();
                let far = 8.0;
                let outline = floor.seen_floor(size, far);
                let inside = |p: &Vector2<f64>| p.x > -0.5 && p.y > -0.5 && p.x < 899.5 && p.y < 699.5;
                // Whatever is seen within the distance lies in the outline.
                let area = |a: &Vector2<f64>, b: &Vector2<f64>, p: &Vector2<f64>| (b - a).perp(&(p - a));
                let mut seen = 0;
                for i in 0..40 {
                    for j in 0..60 {
                        let (sin, cos) = (f64::from(j) * 0.1047).sin_cos();
                        let p = floor.foot() + Vector2::new(cos, sin) * (far * 0.99 * f64::from(i) / 39.0);
                        let Some(pixel) = floor.pixel_from_floor(&p).filter(inside) else { continue };
                        seen += 1;
                        assert!((floor.floor_from_pixel(&pixel).unwrap() - p).norm() < 1e-8 * (1.0 + p.norm()), "{p}");
                        let left = (0..outline.len())
                            .all(|c| area(&outline[c], &outline[(c + 1) % outline.len()], &p) > -1e-2);
                        assert!(left, "{lens:?} {pitch} {p}");
                    }
                }
                assert!(seen > 1500, "{lens:?} {pitch}: {seen}");
                let behind = floor.foot() - floor.heading() * 2.0;
                assert!(floor.pixel_from_floor(&behind).is_some_and(|p| inside(&p)), "{lens:?} {pitch}");
            }
        }
    }

    #[test]
    fn grids_cover_their_points_and_map_back() {
        let points = [Vector2::new(-1.03, 2.0), Vector2::new(3.4, 0.2), Vector2::new(0.0, 5.111)];
        let grid = FloorGrid::covering(&points, &Vector2::new(0.6, 0.8), 0.01).unwrap();
        for p in &points {
            let pixel = grid.pixel_from_floor(p);
            let inside = |v: f64, n: usize| v > -0.501 && v < n as f64 - 0.499;
            assert!(inside(pixel.x, grid.size.width) && inside(pixel.y, grid.size.height), "{pixel}");
            assert!((grid.floor_from_pixel(&pixel) - p).norm() < 1e-12);
            let q = grid.floor_from_pixel_matrix() * pixel.push(1.0);
            assert!((q.xy() - p).norm() < 1e-12);
        }
        let map = FloorGrid::covering(&points, &Vector2::x(), 0.01).unwrap();
        assert_eq!(map.size, ImageSize::new(444, 492));
        assert!(map.down().y < 0.0, "Y points up on the map");
        assert_eq!(FloorGrid::covering(&[], &Vector2::x(), 0.01), None);
    }
}
