//! What the cameras look at: planes, a height field, a sphere far around; each with a texture, each able to move between pictures.

use nalgebra::{Matrix3, Vector2, Vector3};

use crate::lies::{
    pose::Pose,
    texture::{Texture, lattice_noise},
};

/// Form of a surface in its own frame.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Shape {
    /// z = 0 where `region` says.
    Plane { region: Region },
    /// z = amplitude times smooth noise of (x, y) with this wavelength, never more than the amplitude.
    Relief { amplitude_m: f64, wavelength_m: f64, seed: u64 },
    /// z = -curvature (x² + y²) / 2.
    Dome { curvature_per_m: f64 },
    /// All around at a distance.
    Sphere { radius_m: f64 },
}

/// Part of a plane.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Region {
    Everywhere,
    /// |x| and |y| below these.
    Rectangle([f64; 2]),
}

/// A surface of the scene.
#[derive(Debug, Clone)]
pub(crate) struct Surface {
    pub(crate) shape: Shape,
    pub(crate) texture: Texture,
    /// How many times as likely as on other surfaces a point on this one is found.
    pub(crate) richness: f64,
    /// Where it stands in each view; a single one stands for all.
    pub(crate) placements: Vec<Pose>,
}

/// Where a ray meets a surface.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Hit {
    /// Distance along the unit ray, metres.
    pub(crate) distance: f64,
    /// The point in the surface's frame.
    pub(crate) point: Vector3<f64>,
    /// Cosine of the angle to the normal.
    pub(crate) cosine: f64,
}

impl Surface {
    /// The whole floor.
    pub(crate) fn floor(texture: Texture) -> Self {
        Self::fixed(Shape::Plane { region: Region::Everywhere }, texture, Pose::identity())
    }

    /// A surface that stands still.
    pub(crate) fn fixed(shape: Shape, texture: Texture, pose: Pose) -> Self {
        Self { shape, texture, richness: 1.0, placements: vec![pose] }
    }

    /// Where it stands in a view.
    pub(crate) fn placement(&self, view: usize) -> &Pose {
        &self.placements[view.min(self.placements.len() - 1)]
    }

    /// Where a ray of the world (unit direction) meets it first.
    pub(crate) fn hit(&self, view: usize, origin: &Vector3<f64>, direction: &Vector3<f64>) -> Option<Hit> {
        let pose = self.placement(view);
        let to_frame: Matrix3<f64> = pose.rotation.transpose();
        let (o, d) = (to_frame * (origin - pose.centre), to_frame * direction);
        let (distance, normal) = match self.shape {
            Shape::Plane { .. } => (plane_distance(&o, &d, 0.0)?, Vector3::z()),
            Shape::Relief { .. } => self.field_hit(&o, &d)?,
            Shape::Dome { curvature_per_m } => dome_hit(&o, &d, curvature_per_m)?,
            Shape::Sphere { radius_m } => {
                let along = o.dot(&d);
                let root = along * along - o.norm_squared() + radius_m * radius_m;
                let distance = -along + if root > 0.0 { root.sqrt() } else { return None };
                (distance, (o + d * distance).normalize())
            }
        };
        let point = o + d * distance;
        let inside = match self.shape {
            Shape::Plane { region: Region::Rectangle([x, y]) } => point.x.abs() < x && point.y.abs() < y,
            _ => true,
        };
        (inside && distance > 0.05).then(|| Hit { distance, point, cosine: normal.dot(&d).abs() })
    }

    /// A height field: the plane at the height found so far, a few times over; slopes are small.
    fn field_hit(&self, o: &Vector3<f64>, d: &Vector3<f64>) -> Option<(f64, Vector3<f64>)> {
        let mut distance = plane_distance(o, d, 0.0)?;
        for _ in 0..6 {
            let p = o + d * distance;
            distance = plane_distance(o, d, self.height(p.x, p.y))?;
        }
        Some((distance, Vector3::z()))
    }

    fn height(&self, x: f64, y: f64) -> f64 {
        match self.shape {
            Shape::Relief { amplitude_m, wavelength_m, seed } => {
                amplitude_m * lattice_noise(seed, 0, x / wavelength_m, y / wavelength_m)
            }
            _ => 0.0,
        }
    }

    /// Coordinates of the texture, metres.
    pub(crate) fn texture_point(&self, point: &Vector3<f64>) -> Vector2<f64> {
        match self.shape {
            // Equal areas, but for the poles where nobody looks.
            Shape::Sphere { radius_m } => {
                let sine = (point.z / radius_m).clamp(-1.0, 1.0);
                Vector2::new(radius_m * point.y.atan2(point.x), radius_m * sine)
            }
            _ => point.xy(),
        }
    }
}

fn plane_distance(o: &Vector3<f64>, d: &Vector3<f64>, z: f64) -> Option<f64> {
    let distance = (z - o.z) / d.z;
    (distance.is_finite() && distance > 0.0).then_some(distance)
}

/// The nearer meeting with z = -c (x² + y²) / 2.
fn dome_hit(o: &Vector3<f64>, d: &Vector3<f64>, c: f64) -> Option<(f64, Vector3<f64>)> {
    let (a, b) = (0.5 * c * d.xy().norm_squared(), d.z + c * o.xy().dot(&d.xy()));
    let e = o.z + 0.5 * c * o.xy().norm_squared();
    let root = b * b - 4.0 * a * e;
    if root < 0.0 {
        return None;
    }
    // In the form that stays exact where the curvature goes to zero.
    let distance = 2.0 * e / (-b + root.sqrt());
    let p = o + d * distance;
    (distance.is_finite() && distance > 0.0).then(|| (distance, Vector3::new(c * p.x, c * p.y, 1.0).normalize()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rays_meet_surfaces_where_they_are() {
        let texture = Texture::far(1, 0.4);
        let (o, d) = (Vector3::new(0.1, 0.2, 1.5), Vector3::new(0.5, 0.1, -0.6).normalize());
        for (shape, height) in [
            (Shape::Plane { region: Region::Everywhere }, None),
            (Shape::Dome { curvature_per_m: 0.05 }, Some(0.05)),
            (Shape::Sphere { radius_m: 9.0 }, None),
        ] {
            let surface = Surface::fixed(shape, texture, Pose::identity());
            let p = surface.hit(0, &o, &d).expect("a hit").point;
            match (shape, height) {
                (Shape::Sphere { .. }, _) => assert!((p.norm() - 9.0).abs() < 1e-12),
                (_, Some(c)) => assert!((p.z + 0.5 * c * p.xy().norm_squared()).abs() < 1e-12),
                _ => assert!(p.z.abs() < 1e-12),
            }
        }
    }
}
