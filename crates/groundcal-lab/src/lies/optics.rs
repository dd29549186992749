//! Cameras of the scenes: pixel = (fx x + skew y + cx, fy y + cy) with (x, y) where the lens puts a ray. Pixel (0, 0) is the centre of
//! the top-left one. In every lens (x, y) is the ray's (X/Z, Y/Z) near the axis, so that fx, fy, cx, cy mean the same for all of them.

use nalgebra::{Vector2, Vector3};

/// What a lens does to the tangent ρ of the angle θ to its axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Bending {
    /// r = ρ (1 + k1 ρ² + k2 ρ⁴ + k3 ρ⁶), and Brown's tangential terms p1, p2.
    Polynomial { radial: [f64; 3], tangential: [f64; 2] },
    /// ρ = r / (1 + λ r²).
    Division { lambda: f64 },
    /// r = θ.
    Equidistant,
}

impl Bending {
    /// No distortion.
    pub(crate) const NONE: Self = Self::Polynomial { radial: [0.0; 3], tangential: [0.0; 2] };

    /// k1 and k2.
    pub(crate) fn radial(k1: f64, k2: f64) -> Self {
        Self::Polynomial { radial: [k1, k2, 0.0], tangential: [0.0; 2] }
    }
}

/// A camera.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Optics {
    pub(crate) fx: f64,
    pub(crate) fy: f64,
    pub(crate) cx: f64,
    pub(crate) cy: f64,
    pub(crate) skew: f64,
    pub(crate) bending: Bending,
}

/// No ray further off the axis than this is looked at: 86 degrees for lenses of tangents.
const MAX_TANGENT: f64 = 14.0;

impl Optics {
    /// fx, fy, cx, cy: what a calibration should say.
    pub(crate) fn numbers(&self) -> [f64; 4] {
        [self.fx, self.fy, self.cx, self.cy]
    }

    /// The same with another lens.
    pub(crate) fn with(self, bending: Bending) -> Self {
        Self { bending, ..self }
    }

    /// The same with both focal lengths times a factor.
    pub(crate) fn zoomed(self, factor: f64) -> Self {
        Self { fx: self.fx * factor, fy: self.fy * factor, skew: self.skew * factor, ..self }
    }

    /// Where a ray of the camera is seen.
    pub(crate) fn pixel_of(&self, ray: &Vector3<f64>) -> Option<Vector2<f64>> {
        let bent = self.bending.bent(ray)?;
        Some(Vector2::new(self.fx * bent.x + self.skew * bent.y + self.cx, self.fy * bent.y + self.cy))
    }

    /// The unit ray that is seen there.
    pub(crate) fn ray_of(&self, pixel: &Vector2<f64>) -> Option<Vector3<f64>> {
        let y = (pixel.y - self.cy) / self.fy;
        let x = (pixel.x - self.cx - self.skew * y) / self.fx;
        self.bending.straight(&Vector2::new(x, y))
    }
}

impl Bending {
    fn bent(&self, ray: &Vector3<f64>) -> Option<Vector2<f64>> {
        let side = ray.xy().norm();
        if let Self::Equidistant = self {
            let angle = side.atan2(ray.z);
            let unit = if side > 0.0 { ray.xy() / side } else { Vector2::zeros() };
            return (angle < 1.7).then(|| unit * angle);
        }
        if ray.z <= side / MAX_TANGENT {
            return None;
        }
        let ideal = ray.xy() / ray.z;
        let squared = ideal.norm_squared();
        match self {
            Self::Polynomial { radial, tangential } => {
                if squared.sqrt() >= fold(radial) {
                    return None;
                }
                Some(ideal * radial_factor(radial, squared) + decentring(tangential, &ideal))
            }
            Self::Division { lambda } => {
                // r solves λ ρ r² - r + ρ = 0; the root that is ρ for λ = 0.
                let root = 1.0 - 4.0 * lambda * squared;
                (root > 0.0).then(|| ideal * (2.0 / (1.0 + root.sqrt())))
            }
            Self::Equidistant => None,
        }
    }

    fn straight(&self, bent: &Vector2<f64>) -> Option<Vector3<f64>> {
        let ideal = match self {
            Self::Polynomial { radial, tangential } => {
                let mut ideal = unbent(radial, bent)?;
                // Tangential terms are small: each round leaves a thousandth of the error.
                if *tangential != [0.0; 2] {
                    for _ in 0..6 {
                        ideal = unbent(radial, &(bent - decentring(tangential, &ideal)))?;
                    }
                }
                ideal
            }
            Self::Division { lambda } => {
                let factor = 1.0 + lambda * bent.norm_squared();
                (factor > 1e-3).then(|| bent / factor)?
            }
            Self::Equidistant => {
                let angle = bent.norm();
                let unit = if angle > 0.0 { bent / angle } else { Vector2::zeros() };
                let (s, c) = angle.sin_cos();
                return (angle < 1.7).then(|| Vector3::new(unit.x * s, unit.y * s, c));
            }
        };
        Some(Vector3::new(ideal.x, ideal.y, 1.0).normalize())
    }
}

fn radial_factor([k1, k2, k3]: &[f64; 3], squared: f64) -> f64 {
    1.0 + squared * (k1 + squared * (k2 + squared * k3))
}

fn radial_slope([k1, k2, k3]: &[f64; 3], squared: f64) -> f64 {
    1.0 + squared * (3.0 * k1 + squared * (5.0 * k2 + squared * 7.0 * k3))
}

fn decentring([p1, p2]: &[f64; 2], p: &Vector2<f64>) -> Vector2<f64> {
    let squared = p.norm_squared();
    let product = 2.0 * p.x * p.y;
    Vector2::new(p1 * product + p2 * (squared + 2.0 * p.x * p.x), p1 * (squared + 2.0 * p.y * p.y) + p2 * product)
}

/// The tangent from which on the image of a ray turns back.
fn fold(radial: &[f64; 3]) -> f64 {
    const STEP: f64 = 0.02;
    if *radial == [0.0; 3] {
        return MAX_TANGENT;
    }
    let mut tangent = STEP;
    while tangent < 3.0 && radial_slope(radial, tangent * tangent) > 0.02 {
        tangent += STEP;
    }
    tangent
}

/// The ideal point of a radial lens, by Newton's method kept inside a bracket.
fn unbent(radial: &[f64; 3], bent: &Vector2<f64>) -> Option<Vector2<f64>> {
    let wanted = bent.norm();
    if *radial == [0.0; 3] || wanted == 0.0 {
        return Some(*bent);
    }
    let (mut low, mut high) = (0.0, fold(radial));
    let image = |tangent: f64| tangent * radial_factor(radial, tangent * tangent);
    if image(high) <= wanted {
        return None;
    }
    let mut tangent = wanted.min(0.9 * high);
    for _ in 0..60 {
        let error = image(tangent) - wanted;
        if error.abs() < 1e-14 {
            break;
        }
        if error > 0.0 {
            high = tangent
        } else {
            low = tangent
        }
        let next = tangent - error / radial_slope(radial, tangent * tangent);
        tangent = if next > low && next < high { next } else { 0.5 * (low + high) };
    }
    Some(bent * (tangent / wanted))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pixel_comes_back_through_every_lens() {
        let plain = Optics { fx: 500.0, fy: 520.0, cx: 320.0, cy: 236.0, skew: 3.0, bending: Bending::NONE };
        let lenses = [
            Bending::NONE,
            Bending::radial(-0.3, 0.08),
            Bending::Polynomial { radial: [0.1, -0.2, 0.05], tangential: [0.002, -0.001] },
            Bending::Division { lambda: -0.3 },
            Bending::Equidistant,
        ];
        for lens in lenses {
            let camera = plain.with(lens);
            for pixel in [[320.0, 236.0], [10.0, 20.0], [600.0, 100.0], [630.0, 470.0]] {
                let pixel = Vector2::from(pixel);
                let ray = camera.ray_of(&pixel).expect("a ray");
                let back = camera.pixel_of(&(ray * 3.0)).expect("a pixel");
                assert!((back - pixel).norm() < 1e-8, "{lens:?}: {pixel} -> {back}");
            }
        }
    }

    #[test]
    fn every_lens_has_the_same_focal_length_on_its_axis() {
        let ray = Vector3::new(1e-4, 0.0, 1.0);
        for lens in [Bending::radial(-0.3, 0.0), Bending::Division { lambda: -0.4 }, Bending::Equidistant] {
            assert!((lens.bent(&ray).expect("a point").x / 1e-4 - 1.0).abs() < 1e-6, "{lens:?}");
        }
    }
}
