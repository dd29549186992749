//! Lens models: between rays in camera coordinates and distorted normalised coordinates, which the camera matrix takes to pixels.
//!
//! ```text
//! project:  ray (X, Y, Z), any length  ->  (x_d, y_d)          pixel = K (x_d, y_d, 1)
//! ```
//!
//! A model knows once, when it is made, how far it reaches: up to the first fold, where it ceases to be one to one. Beyond, there
//! is neither point nor ray, also where the polynomial rises again. Models of wide lenses work on rays at and beyond 90 degrees
//! from the optical axis; the others see what lies in front of the camera.

mod division;
mod fisheye;
mod projection;
mod radial;
mod radtan;
mod record;
#[cfg(test)]
mod tests;

use nalgebra::{Matrix2x3, Vector2, Vector3};

pub use division::Division;
pub use fisheye::Fisheye;
pub(crate) use projection::ByLensParameters;
pub(crate) use projection::LensProjection;
pub(crate) use projection::MAX_LENS_PARAMETERS;
pub use radtan::Radtan;

/// A lens.
///
/// # Examples
/// ```
/// use groundcal::{Lens, nalgebra::Vector2};
/// let lens = Lens::radial(-0.2, 0.05);
/// assert_eq!((lens.name(), lens.parameter("k1")), ("radtan", Some(-0.2)));
/// // A point of the image as an ideal lens would show it, in focal lengths from the principal point.
/// let ideal = lens.undistort(&Vector2::new(0.3, 0.0)).expect("inside the image");
/// assert!(ideal.x > 0.3);
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[non_exhaustive]
pub enum Lens {
    /// No distortion: (x_d, y_d) = (X/Z, Y/Z).
    #[default]
    None,
    /// Brown-Conrady: k1, k2, p1, p2, k3.
    Radtan(Radtan),
    /// The division model: λ.
    Division(Division),
    /// The equidistant fisheye of Kannala and Brandt: k1, k2, k3, k4.
    Fisheye(Fisheye),
}

impl From<&Lens> for Lens {
    fn from(lens: &Lens) -> Self {
        *lens
    }
}

impl Lens {
    /// Brown-Conrady with k1 and k2 alone.
    pub fn radial(k1: f64, k2: f64) -> Self {
        Self::Radtan(Radtan::radial(k1, k2))
    }

    /// The model's name, as files have it.
    pub fn name(&self) -> &'static str {
        match self {
            Self::None => "none",
            Self::Radtan(_) => "radtan",
            Self::Division(_) => "division",
            Self::Fisheye(_) => "fisheye",
        }
    }

    /// Whether it is that of a pinhole: no distortion, whatever the model.
    pub fn is_none(&self) -> bool {
        match self {
            Self::None => true,
            Self::Radtan(lens) => lens.is_none(),
            Self::Division(lens) => lens.parameters() == [0.0],
            Self::Fisheye(_) => false,
        }
    }

    /// Whether it acts on the points (X/Z, Y/Z) of a flat image, which ends before 90 degrees from the axis; the others act on directions.
    pub fn is_flat(&self) -> bool {
        match self {
            Self::None | Self::Radtan(_) => true,
            Self::Division(_) | Self::Fisheye(_) => false,
        }
    }

    /// Names of the parameters, in the order of [`Self::parameters`] and of derivatives.
    pub fn parameter_names(&self) -> &'static [&'static str] {
        match self {
            Self::None => &[],
            Self::Radtan(_) => &Radtan::PARAMETER_NAMES,
            Self::Division(_) => &Division::PARAMETER_NAMES,
            Self::Fisheye(_) => &Fisheye::PARAMETER_NAMES,
        }
    }

    /// The parameters; none has a unit, they act on coordinates over the focal length or on radians.
    pub fn parameters(&self) -> Vec<f64> {
        match self {
            Self::None => Vec::new(),
            Self::Radtan(lens) => lens.parameters().into(),
            Self::Division(lens) => lens.parameters().into(),
            Self::Fisheye(lens) => lens.parameters().into(),
        }
    }

    /// A parameter by its name; `None` where the model has none of it.
    pub fn parameter(&self, name: &str) -> Option<f64> {
        let at = self.parameter_names().iter().position(|n| *n == name)?;
        self.parameters().get(at).copied()
    }

    /// The same model with other parameters; `None` where their number is not the model's.
    pub(crate) fn with_parameters(&self, parameters: &[f64]) -> Option<Self> {
        Some(match self {
            Self::None => parameters.is_empty().then_some(Self::None)?,
            Self::Radtan(_) => Self::Radtan(Radtan::new(parameters.try_into().ok()?)),
            Self::Division(_) => match parameters {
                [lambda] => Self::Division(Division::new(*lambda)),
                _ => return None,
            },
            Self::Fisheye(_) => Self::Fisheye(Fisheye::new(parameters.try_into().ok()?)),
        })
    }

    /// The largest angle from the optical axis that the model describes, radians: below it everything, at it and beyond nothing.
    /// That of Brown-Conrady is without its tangential part.
    pub(crate) fn max_angle_rad(&self) -> f64 {
        match self {
            Self::None => std::f64::consts::FRAC_PI_2,
            Self::Radtan(lens) => lens.max_ideal_radius().atan(),
            Self::Division(lens) => lens.max_angle_rad(),
            Self::Fisheye(lens) => lens.max_angle_rad(),
        }
    }

    /// The radius of the points (distorted normalised coordinates) that come from rays, infinite where there is no end.
    pub(crate) fn max_radius(&self) -> f64 {
        match self {
            Self::None => f64::INFINITY,
            Self::Radtan(lens) => lens.max_radius(),
            Self::Division(lens) => lens.max_radius(),
            Self::Fisheye(lens) => lens.max_radius(),
        }
    }

    /// Whether rays square to the optical axis, or behind the camera, have points.
    pub(crate) fn sees_behind(&self) -> bool {
        self.max_angle_rad() > std::f64::consts::FRAC_PI_2
    }

    /// The same lens where lengths are in units of a focal length `ratio` times as long: a pixel keeps its ray's direction across the
    /// axis in pixels. With u the ideal point in pixels, the terms of Brown-Conrady are u k1 u²/f², u k2 u⁴/f⁴, u k3 u⁶/f⁶ and
    /// p u²/f, that of the division model λ u²/f²: the coefficients grow as f², f⁴, f⁶, f and f². `None` for the fisheye, whose
    /// angles have no such family.
    pub(crate) fn for_focal_length_times(&self, ratio: f64) -> Option<Self> {
        let square = ratio * ratio;
        match self {
            Self::None => Some(Self::None),
            Self::Radtan(lens) => {
                let [k1, k2, p1, p2, k3] = lens.parameters();
                let scaled = [k1 * square, k2 * square * square, p1 * ratio, p2 * ratio, k3 * square.powi(3)];
                Some(Self::Radtan(Radtan::new(scaled)))
            }
            Self::Division(lens) => {
                let [lambda] = lens.parameters();
                Some(Self::Division(Division::new(lambda * square)))
            }
            Self::Fisheye(_) => None,
        }
    }

    /// Distorted to ideal normalised coordinates (X/Z, Y/Z); `None` for what lies square to the axis, behind or beyond the fold.
    pub fn undistort(&self, point: &Vector2<f64>) -> Option<Vector2<f64>> {
        match self {
            Self::None => Some(*point),
            Self::Radtan(lens) => lens.undistort(point),
            Self::Division(_) | Self::Fisheye(_) => radtan::ideal_point(&self.unproject(point)?),
        }
    }

    /// Ideal to distorted normalised coordinates; `None` beyond the fold.
    pub(crate) fn distort(&self, point: &Vector2<f64>) -> Option<Vector2<f64>> {
        match self {
            Self::Radtan(lens) => lens.distort(point),
            _ => self.project(&point.push(1.0)),
        }
    }

    /// The point (distorted normalised coordinates) of a ray of any length; `None` where the model describes none.
    pub fn project(&self, ray: &Vector3<f64>) -> Option<Vector2<f64>> {
        match self {
            Self::None => radtan::ideal_point(ray),
            Self::Radtan(lens) => lens.project(ray),
            Self::Division(lens) => lens.project(ray),
            Self::Fisheye(lens) => lens.project(ray),
        }
    }

    /// [`Self::project`] with derivatives.
    // Called for every observation of every iteration: what it returns is large, and is not copied where it is inlined.
    #[inline(always)]
    pub(crate) fn project_with_jacobian(&self, ray: &Vector3<f64>) -> Option<LensProjection> {
        match self {
            Self::None => {
                let (point, inverse) = (radtan::ideal_point(ray)?, 1.0 / ray.z);
                let by_ray = Matrix2x3::new(inverse, 0.0, -point.x * inverse, 0.0, inverse, -point.y * inverse);
                Some(LensProjection { point, by_ray, by_parameters: ByLensParameters::zeros() })
            }
            Self::Radtan(lens) => lens.project_with_jacobian(ray),
            Self::Division(lens) => lens.project_with_jacobian(ray),
            Self::Fisheye(lens) => lens.project_with_jacobian(ray),
        }
    }

    /// The ray, of unit length, that is seen at a point (distorted normalised coordinates); `None` where the model gives none.
    pub(crate) fn unproject(&self, point: &Vector2<f64>) -> Option<Vector3<f64>> {
        match self {
            Self::None => Radtan::default().unproject(point),
            Self::Radtan(lens) => lens.unproject(point),
            Self::Division(lens) => lens.unproject(point),
            Self::Fisheye(lens) => lens.unproject(point),
        }
    }
}
