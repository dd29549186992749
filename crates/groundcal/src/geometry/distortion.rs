//! The four coefficients of Brown-Conrady that are estimated or given here, as options and results name them. The lens model
//! itself is [`Radtan`].

use nalgebra::{Matrix2, Vector2};
use serde::{Deserialize, Serialize};

use crate::{
    error::Error,
    geometry::{
        intrinsics::Intrinsics,
        lens::{Lens, Radtan},
    },
};

/// Coefficients of the lens distortion (no unit: they act on coordinates divided by the focal length).
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Distortion {
    /// Radial, second order.
    #[serde(default)]
    pub k1: f64,
    /// Radial, fourth order.
    #[serde(default)]
    pub k2: f64,
    /// Tangential.
    #[serde(default)]
    pub p1: f64,
    /// Tangential.
    #[serde(default)]
    pub p2: f64,
}

impl Distortion {
    /// Radial distortion alone.
    pub fn radial(k1: f64, k2: f64) -> Self {
        Self { k1, k2, p1: 0.0, p2: 0.0 }
    }

    /// Whether all coefficients are zero.
    pub fn is_none(&self) -> bool {
        self.k1 == 0.0 && self.k2 == 0.0 && self.p1 == 0.0 && self.p2 == 0.0
    }

    /// The lens model.
    pub fn radtan(&self) -> Radtan {
        Radtan::new([self.k1, self.k2, self.p1, self.p2, 0.0])
    }

    /// Ideal to distorted normalised coordinates, beyond the fold too.
    pub fn distort(&self, p: &Vector2<f64>) -> Vector2<f64> {
        self.radtan().polynomial(p)
    }

    /// The derivative of [`Self::distort`].
    pub fn distort_jacobian(&self, p: &Vector2<f64>) -> Matrix2<f64> {
        self.radtan().jacobian(p)
    }

    /// Whether an ideal point lies within the first fold of the lens model.
    pub fn is_one_to_one_at(&self, p: &Vector2<f64>) -> bool {
        self.radtan().contains(p)
    }

    /// Distorted to ideal normalised coordinates; `None` where no point within the fold maps there.
    pub fn undistort(&self, d: &Vector2<f64>) -> Option<Vector2<f64>> {
        self.radtan().undistort(d)
    }

    /// A distorted pixel to the pixel an ideal lens would have given, with the same camera matrix.
    pub fn undistort_pixel(&self, k: &Intrinsics, pixel: &Vector2<f64>) -> Option<Vector2<f64>> {
        self.undistort(&k.normalised_from_pixel(pixel)).map(|p| k.pixel_from_normalised(&p))
    }
}

impl TryFrom<&Lens> for Distortion {
    type Error = Error;

    /// Of a lens that k1, k2, p1 and p2 describe.
    fn try_from(lens: &Lens) -> Result<Self, Error> {
        match lens {
            Lens::None => Ok(Self::default()),
            Lens::Radtan(radtan) if radtan.parameters()[4] == 0.0 => {
                let [k1, k2, p1, p2, _] = radtan.parameters();
                Ok(Self { k1, k2, p1, p2 })
            }
            _ => Err(Error::InvalidInput(format!(
                "a lens of the model {} ({}): only radtan with k1, k2, p1 and p2 is known here",
                lens.name(),
                lens.parameter_names().join(", ")
            ))),
        }
    }
}

impl From<&Distortion> for Lens {
    fn from(d: &Distortion) -> Self {
        Self::Radtan(d.radtan())
    }
}

impl From<Distortion> for Lens {
    fn from(d: Distortion) -> Self {
        Self::from(&d)
    }
}
