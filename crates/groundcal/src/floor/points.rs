//! From pixels of a view to points of the floor and back, with what is known of them.
//!
//! ```text
//! X = floor(q; θ)      cov X = J C Jᵀ + D σ² Dᵀ      J = ∂X/∂θ,  D = ∂X/∂q
//! q = pixel(X; θ)      cov q = J C Jᵀ + D S Dᵀ       J = ∂q/∂θ,  D = ∂q/∂X
//! ```
//!
//! θ: numbers of the camera and pose of the view, C their covariance; σ: standard deviation of each coordinate of a pixel, S: covariance of a given
//! point. Points of one view share the errors of θ, so that covariances of several points are had together: a distance between two of them is
//! better known than their independent errors would have it.

use nalgebra::{DMatrix, DVector, Matrix2, SMatrix, Vector2};

use crate::{
    error::Error,
    floor::view::FloorView,
    result::{Calibration, Covariance, ViewParameter, ViewReport},
};

/// How far a pixel or a point is moved for a difference.
const PIXEL_STEP: f64 = 1e-3;

/// A view of a calibration whose floor is seen, with the covariance of its numbers.
///
/// # Examples
/// ```
/// # use groundcal::{ImagePair, Options, Silent, calibrate_matches, synthetic::PointScene};
/// # let scene = PointScene::nominal(0);
/// # let pairs: Vec<ImagePair> = scene.pairs();
/// # let names: Vec<String> = (0..6).map(|i| format!("view {i}")).collect();
/// # let calibration = calibrate_matches(&names, scene.size, &pairs, &Options::default(), &Silent)?;
/// use groundcal::MeasuringView;
/// let calibration = calibration.with_camera_height(1.5)?;
/// let view = MeasuringView::of(&calibration, "view 0")?;
/// let length = view.distance([[600.0, 700.0], [700.0, 700.0]], 0.5).expect("two points of the floor");
/// assert!(length.value > 0.0 && length.sigma > 0.0);
/// # Ok::<(), groundcal::Error>(())
/// ```
#[derive(Debug, Clone)]
pub struct MeasuringView {
    /// Name of its image.
    pub image: String,
    /// Image whose foot is the origin of the floor's coordinates.
    pub origin: String,
    view: FloorView,
    covariance: Covariance<ViewParameter>,
}

/// A point of the floor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FloorPoint {
    /// X and Y in the unit of the view's world.
    pub position: [f64; 2],
    /// Covariance of the two.
    pub covariance: [[f64; 2]; 2],
}

/// A place in the image.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ImagePoint {
    /// x and y, pixels.
    pub pixel: [f64; 2],
    /// Covariance of the two.
    pub covariance_px2: [[f64; 2]; 2],
}

/// A length with its standard deviation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Length {
    /// In the unit of the view's world.
    pub value: f64,
    /// One standard deviation.
    pub sigma: f64,
}

type ByNumbers = SMatrix<f64, 2, { ViewParameter::COUNT }>;

impl MeasuringView {
    /// A view of a calibration, by the name of its image (or the end of its path, or without its extension).
    ///
    /// # Errors
    /// [`Error::InvalidInput`] where there is no such view, or it has no place over a floor.
    pub fn of(c: &Calibration, image: &str) -> Result<Self, Error> {
        let report = view_named(c, image)?;
        let view = FloorView::of_report(&c.camera, report)?;
        Ok(Self {
            image: report.image.clone(),
            origin: report.origin.clone(),
            view,
            covariance: report.covariance.clone(),
        })
    }

    /// The point of the floor at a pixel; `None` at or above the horizon, or where the lens model gives no ray.
    pub fn floor_point(&self, pixel: [f64; 2], pixel_sigma_px: f64) -> Option<FloorPoint> {
        let q = Vector2::from(pixel);
        let at = self.view.floor_from_pixel(&q)?;
        let by = self.view.floor_point_jacobian(&q)?;
        let d = self.floor_by_pixel(&q)?;
        let covariance = by * self.numbers() * by.transpose() + d * d.transpose() * pixel_sigma_px.powi(2);
        Some(FloorPoint { position: at.into(), covariance: rows(&covariance) })
    }

    /// The pixel at a point of the floor; `None` where the camera cannot see it. It may lie outside the image.
    pub fn image_point(&self, point: &FloorPoint) -> Option<ImagePoint> {
        let at = Vector2::from(point.position);
        let pixel = self.view.pixel_from_floor(&at)?;
        let nowhere = Vector2::repeat(f64::NAN);
        let by: ByNumbers = self.view.derivative_by_numbers(|v| v.pixel_from_floor(&at).unwrap_or(nowhere));
        let height = self.view.centre().z;
        let step = 1e-6 * height.max(at.norm());
        let d = differences(step, |move_by| self.view.pixel_from_floor(&(at + move_by)))?;
        let given = Matrix2::from_fn(|r, c| point.covariance[r][c]);
        let covariance = by * self.numbers() * by.transpose() + d * given * d.transpose();
        let finite = covariance.iter().all(|v| v.is_finite());
        finite.then(|| ImagePoint { pixel: pixel.into(), covariance_px2: rows(&covariance) })
    }

    /// The distance over the floor between the points at two pixels. `None` as [`Self::floor_point`], and for one pixel twice.
    pub fn distance(&self, pixels: [[f64; 2]; 2], pixel_sigma_px: f64) -> Option<Length> {
        let (value, by, of_pixels) = self.distance_by_numbers(pixels)?;
        let variance = (by.transpose() * self.numbers_dynamic() * &by)[(0, 0)] + of_pixels * pixel_sigma_px.powi(2);
        Some(Length { value, sigma: variance.max(0.0).sqrt() })
    }

    /// The distance, its derivative by the view's numbers, and the sum of its squared derivatives by the coordinates of the pixels.
    pub(crate) fn distance_by_numbers(&self, pixels: [[f64; 2]; 2]) -> Option<(f64, DVector<f64>, f64)> {
        let [p, q] = pixels.map(Vector2::from);
        let apart = self.view.floor_from_pixel(&q)? - self.view.floor_from_pixel(&p)?;
        let along = apart.try_normalize(1e-12 * self.view.centre().z)?;
        let by = (self.view.floor_point_jacobian(&q)? - self.view.floor_point_jacobian(&p)?).transpose() * along;
        let [of_p, of_q] =
            [self.floor_by_pixel(&p)?, self.floor_by_pixel(&q)?].map(|d| (d.transpose() * along).norm_squared());
        Some((apart.norm(), DVector::from_column_slice(by.as_slice()), of_p + of_q))
    }

    /// Derivative of the floor point by the pixel.
    fn floor_by_pixel(&self, pixel: &Vector2<f64>) -> Option<Matrix2<f64>> {
        differences(PIXEL_STEP, |move_by| self.view.floor_from_pixel(&(pixel + move_by)))
    }

    fn numbers(&self) -> SMatrix<f64, { ViewParameter::COUNT }, { ViewParameter::COUNT }> {
        SMatrix::from_fn(|r, c| self.covariance.get(ViewParameter::ALL[r], ViewParameter::ALL[c]))
    }

    fn numbers_dynamic(&self) -> DMatrix<f64> {
        self.covariance.of(&ViewParameter::ALL)
    }
}

/// The view of an image by its name, the end of its path, or its name without extension.
///
/// # Errors
/// [`Error::InvalidInput`] where there is none, or several.
pub(crate) fn view_named<'a>(c: &'a Calibration, image: &str) -> Result<&'a ViewReport, Error> {
    let stem =
        |name: &str| name.rsplit(['/', '\\']).next().and_then(|n| n.rsplit_once('.').map(|(s, _)| s.to_string()));
    let end = |name: &str| image.ends_with(&format!("/{name}")) || name.ends_with(&format!("/{image}"));
    let rules: [&dyn Fn(&str) -> bool; 3] =
        [&|name| name == image, &end, &|name| stem(name).is_some_and(|s| s == image)];
    for rule in rules {
        let found: Vec<&ViewReport> = c.views.iter().filter(|v| rule(&v.image)).collect();
        match found.as_slice() {
            [] => {}
            [only] => return Ok(only),
            [first, second, ..] => {
                return Err(Error::InvalidInput(format!(
                    "{image} may be {} or {}; write the whole name",
                    first.image, second.image
                )));
            }
        }
    }
    let names: Vec<&str> = c.views.iter().take(8).map(|v| v.image.as_str()).collect();
    Err(Error::InvalidInput(if names.is_empty() {
        format!("no view {image}: the calibration has no views with a place; calibrate with the joint refinement")
    } else {
        format!("no view {image} among the {} of the calibration: {}", c.views.len(), names.join(", "))
    }))
}

/// Central differences by two coordinates.
fn differences(step: f64, at: impl Fn(Vector2<f64>) -> Option<Vector2<f64>>) -> Option<Matrix2<f64>> {
    let by = |axis: Vector2<f64>| Some((at(axis * step)? - at(-axis * step)?) / (2.0 * step));
    Some(Matrix2::from_columns(&[by(Vector2::x())?, by(Vector2::y())?]))
}

fn rows(m: &Matrix2<f64>) -> [[f64; 2]; 2] {
    let cross = 0.5 * (m[(0, 1)] + m[(1, 0)]);
    [[m[(0, 0)], cross], [cross, m[(1, 1)]]]
}
