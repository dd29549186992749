//! Images as a lens without distortion would have taken them.
//!
//! ```text
//! source pixel = K lens(K'⁻¹ x)        x: pixel of the undistorted image, K' its camera matrix
//! ```
//!
//! Pixel (0, 0) is the centre of the top-left pixel in both. What a wide lens sees beyond [`MAX_ANGLE_RAD`] from its axis no flat image
//! holds sensibly: there a pixel of the original covers more than thirty of the new one.

use std::f64::consts::PI;

use nalgebra::{Vector2, Vector3};

use crate::{
    error::Error,
    geometry::{camera::Camera, intrinsics::Intrinsics, size::ImageSize},
};

/// Which part of the undistorted scene an image of the same size shows.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum Fit {
    /// That of the same camera matrix.
    #[default]
    Same,
    /// Everything the original shows; borders may be empty.
    All,
    /// The largest part, of the image's shape, that leaves nothing empty.
    Crop,
    /// A field of view from the left side to the right, about the optical axis.
    FieldOfView {
        /// Its angle in radians, below π.
        horizontal_rad: f64,
    },
}

/// The undistortion of a camera's images.
///
/// # Examples
/// ```
/// use groundcal::{Camera, ImageSize, Intrinsics, Lens, Undistortion, floor::Fit, nalgebra::Vector2};
/// let camera = Camera { size: ImageSize::new(640, 480), intrinsics: Intrinsics::square(500.0, 319.5, 239.5), lens: Lens::radial(-0.2, 0.0) };
/// let undistortion = Undistortion::new(&camera, Fit::Crop)?;
/// assert!(undistortion.source_pixel(&Vector2::new(0.0, 0.0)).is_some());
/// let [map_x, map_y] = undistortion.maps();
/// assert_eq!((map_x.len(), map_y.len()), (640 * 480, 640 * 480));
/// # Ok::<(), groundcal::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Undistortion {
    camera: Camera,
    intrinsics: Intrinsics,
}

/// Points on each side of the image that say how far the undistorted scene reaches.
const BORDER_POINTS: usize = 64;
/// Angle from the optical axis up to which a flat image is stretched over what a wide lens sees.
pub(crate) const MAX_ANGLE_RAD: f64 = 80.0 / 180.0 * PI;
/// Widest field of view that can be asked for.
const MAX_FIELD_OF_VIEW_RAD: f64 = 175.0 / 180.0 * PI;

impl Undistortion {
    /// Of a camera.
    ///
    /// # Errors
    /// [`Error::InvalidInput`] when the lens model folds over within the image (`All`, `Crop`), where nothing can be undone; when the
    /// image shows more than a flat one can (`All`); when a field of view is not between 0 and 175 degrees.
    pub fn new(camera: &Camera, fit: Fit) -> Result<Self, Error> {
        let wide = || !camera.lens.is_flat();
        let intrinsics = match fit {
            Fit::Same => camera.intrinsics,
            Fit::FieldOfView { horizontal_rad } => of_field_of_view(camera, horizontal_rad)?,
            Fit::Crop if wide() => cropped(camera)?,
            Fit::Crop | Fit::All => {
                let sides = sides(camera)?;
                around(camera, &sides, fit).ok_or_else(|| folded(camera))?
            }
        };
        Ok(Self { camera: *camera, intrinsics })
    }

    /// Camera matrix of the undistorted images, which have the size of the originals.
    pub fn intrinsics(&self) -> &Intrinsics {
        &self.intrinsics
    }

    /// The pixel of the original at a pixel of the undistorted image; `None` beyond the lens's fold. It may lie outside the original.
    pub fn source_pixel(&self, pixel: &Vector2<f64>) -> Option<Vector2<f64>> {
        self.camera.project(&self.intrinsics.ray(pixel))
    }

    /// [`Self::source_pixel`] of every pixel, x and y, row by row; -1 (outside the original) beyond the fold.
    pub fn maps(&self) -> [Vec<f32>; 2] {
        let size = self.camera.size;
        let pixels = (0..size.height).flat_map(|y| (0..size.width).map(move |x| (x, y)));
        let outside = Vector2::repeat(-1.0);
        pixels
            .map(|(x, y)| self.source_pixel(&Vector2::new(x as f64, y as f64)).unwrap_or(outside))
            .map(|p| (p.x as f32, p.y as f32))
            .unzip::<f32, f32, Vec<f32>, Vec<f32>>()
            .into()
    }
}

fn folded(camera: &Camera) -> Error {
    let lens = &camera.lens;
    let values = lens.parameter_names().iter().zip(lens.parameters()).filter(|(_, v)| *v != 0.0);
    let values: Vec<String> = values.map(|(name, v)| format!("{name} {v}")).collect();
    Error::InvalidInput(format!(
        "the lens model ({}) folds over within an image of {} pixels: its corners cannot be undistorted. Use the same camera matrix, \
         or calibrate with points out to the corners",
        values.join(", "),
        camera.size
    ))
}

/// A point of the image's border, `side` 0 to 3: left, right, top, bottom.
fn on_border(size: ImageSize, side: usize, t: f64) -> Vector2<f64> {
    let (w, h) = (size.width as f64, size.height as f64);
    let (x, y) = [(0.0, t * h), (w, t * h), (t * w, 0.0), (t * w, h)][side];
    Vector2::new(x - 0.5, y - 0.5)
}

fn along_side() -> impl Iterator<Item = f64> {
    (0..=BORDER_POINTS).map(|k| k as f64 / BORDER_POINTS as f64)
}

/// The sides of the image, undistorted, in pixels of the same camera matrix.
fn sides(camera: &Camera) -> Result<[Vec<Vector2<f64>>; 4], Error> {
    let k = &camera.intrinsics;
    let mut sides: [Vec<Vector2<f64>>; 4] = Default::default();
    for (i, side) in sides.iter_mut().enumerate() {
        for t in along_side() {
            let pixel = on_border(camera.size, i, t);
            let ray = camera.unproject(&pixel).ok_or_else(|| folded(camera))?;
            let angle = ray.xy().norm().atan2(ray.z);
            if angle > MAX_ANGLE_RAD && !camera.lens.is_flat() {
                return Err(Error::InvalidInput(format!(
                    "the image shows directions of {:.0} degrees from the optical axis: no flat image holds them. Crop it, or name a \
                     field of view",
                    angle.to_degrees()
                )));
            }
            side.push(k.pixel_from_normalised(&(ray.xy() / ray.z)));
        }
    }
    Ok(sides)
}

/// The camera matrix about all of the sides, or within them.
fn around(camera: &Camera, sides: &[Vec<Vector2<f64>>; 4], fit: Fit) -> Option<Intrinsics> {
    let low = |i: usize, c: usize| sides[i].iter().map(|p| p[c]).fold(f64::INFINITY, f64::min);
    let high = |i: usize, c: usize| sides[i].iter().map(|p| p[c]).fold(f64::NEG_INFINITY, f64::max);
    // left, right, top, bottom of what is seen: furthest out, or furthest in.
    let [left, right, top, bottom] = match fit {
        Fit::All => {
            let all = |c: usize, f: &dyn Fn(usize, usize) -> f64, pick: fn(f64, f64) -> f64| {
                (0..4).map(|i| f(i, c)).reduce(pick).unwrap_or(0.0)
            };
            [all(0, &low, f64::min), all(0, &high, f64::max), all(1, &low, f64::min), all(1, &high, f64::max)]
        }
        _ => [high(0, 0), low(1, 0), high(2, 1), low(3, 1)],
    };
    if !(right - left > 1.0 && bottom - top > 1.0) {
        return None;
    }
    // One scale for both axes keeps the pixels' shape.
    let (w, h) = (camera.size.width as f64, camera.size.height as f64);
    let scales = [w / (right - left), h / (bottom - top)];
    let scale = if fit == Fit::All { scales[0].min(scales[1]) } else { scales[0].max(scales[1]) };
    let (k, [x, y]) = (&camera.intrinsics, camera.size.centre_px());
    Some(Intrinsics {
        fx: k.fx * scale,
        fy: k.fy * scale,
        skew: k.skew * scale,
        cx: x + scale * (k.cx - 0.5 * (left + right)),
        cy: y + scale * (k.cy - 0.5 * (top + bottom)),
    })
}

/// The camera matrix of a focal length along x, with the pixels' shape, and the axis in the middle of the image.
fn centred(camera: &Camera, fx: f64) -> Intrinsics {
    let (k, [cx, cy]) = (&camera.intrinsics, camera.size.centre_px());
    Intrinsics { fx, fy: fx * k.fy / k.fx, skew: fx * k.skew / k.fx, cx, cy }
}

fn of_field_of_view(camera: &Camera, horizontal_rad: f64) -> Result<Intrinsics, Error> {
    if !(horizontal_rad > 0.0 && horizontal_rad <= MAX_FIELD_OF_VIEW_RAD) {
        return Err(Error::InvalidInput(format!(
            "a field of view of {:.1} degrees: a flat image shows more than 0 and at most {:.0}",
            horizontal_rad.to_degrees(),
            MAX_FIELD_OF_VIEW_RAD.to_degrees()
        )));
    }
    Ok(centred(camera, 0.5 * camera.size.width as f64 / (0.5 * horizontal_rad).tan()))
}

/// The shortest focal length whose image is filled, its corners at most [`MAX_ANGLE_RAD`] from the axis. The lens being wide, its
/// border has rays that no flat image holds, so the search is from the inside.
fn cropped(camera: &Camera) -> Result<Intrinsics, Error> {
    let (w, h) = (camera.size.width as f64, camera.size.height as f64);
    let filled = |fx: f64| {
        let k = centred(camera, fx);
        (0..4).flat_map(|side| along_side().map(move |t| (side, t))).all(|(side, t)| {
            let ray = k.ray(&on_border(camera.size, side, t));
            let within = ray.xy().norm() <= MAX_ANGLE_RAD.tan();
            let inside = |p: Vector2<f64>| p.x >= -0.5 && p.y >= -0.5 && p.x <= w - 0.5 && p.y <= h - 0.5;
            within && camera.project(&ray).is_some_and(inside)
        })
    };
    let (mut short, mut long) = (1e-3 * camera.intrinsics.fx, 1e3 * camera.intrinsics.fx);
    if !filled(long) {
        let centre: Option<Vector3<f64>> = camera.unproject(&camera.size.centre_px().into());
        return Err(Error::InvalidInput(format!(
            "the optical axis is not inside the image (its middle looks along {centre:?}): there is nothing to crop about it"
        )));
    }
    for _ in 0..100 {
        let middle = (short * long).sqrt();
        if filled(middle) {
            long = middle;
        } else {
            short = middle;
        }
    }
    Ok(centred(camera, long))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::lens::{Division, Fisheye, Lens, Radtan};

    fn camera(lens: Lens) -> Camera {
        let intrinsics = Intrinsics { fx: 500.0, fy: 510.0, cx: 330.0, cy: 232.0, skew: 0.0 };
        Camera { size: ImageSize::new(640, 480), intrinsics, lens }
    }

    fn corners_and_sides(size: ImageSize) -> Vec<Vector2<f64>> {
        let (w, h) = (size.width as f64 - 0.5, size.height as f64 - 0.5);
        let at = |t: f64, low: f64, high: f64| low + t * (high - low);
        (0..=20)
            .map(|i| f64::from(i) / 20.0)
            .flat_map(|t| [(-0.5, at(t, -0.5, h)), (w, at(t, -0.5, h)), (at(t, -0.5, w), -0.5), (at(t, -0.5, w), h)])
            .map(|(x, y)| Vector2::new(x, y))
            .collect()
    }

    #[test]
    fn crop_leaves_nothing_empty_and_all_loses_nothing() {
        for lens in [Lens::radial(-0.25, 0.05), Lens::Radtan(Radtan::new([0.1, 0.0, 1e-3, -2e-3, 0.0]))] {
            let camera = camera(lens);
            let inside = |p: &Vector2<f64>, tolerance: f64| {
                let room = [p.x + 0.5, p.y + 0.5, 639.5 - p.x, 479.5 - p.y];
                room.iter().all(|r| *r > -tolerance)
            };
            let crop = Undistortion::new(&camera, Fit::Crop).unwrap();
            let border = corners_and_sides(camera.size);
            assert!(border.iter().all(|p| inside(&crop.source_pixel(p).unwrap(), 0.05)), "{lens:?}");
            let all = Undistortion::new(&camera, Fit::All).unwrap();
            for p in &border {
                let ray = camera.unproject(p).unwrap();
                assert!(inside(&all.intrinsics().pixel_from_normalised(&(ray.xy() / ray.z)), 0.05), "{lens:?} {p}");
            }
            assert!(all.intrinsics().fx < crop.intrinsics().fx);
            // Both touch a border: neither could be better.
            let touches = border.iter().any(|p| !inside(&crop.source_pixel(p).unwrap(), -1.0));
            assert!(touches, "{lens:?}");
        }
    }

    #[test]
    fn without_distortion_every_fit_is_the_identity() {
        for lens in [Lens::None, Lens::radial(0.0, 0.0)] {
            for fit in [Fit::Same, Fit::All, Fit::Crop] {
                let u = Undistortion::new(&camera(lens), fit).unwrap();
                let p = Vector2::new(17.0, 401.0);
                assert!((u.source_pixel(&p).unwrap() - p).norm() < 1e-9, "{fit:?}");
            }
            let [x, y] = Undistortion::new(&camera(lens), Fit::Same).unwrap().maps();
            assert_eq!((x[640 * 3 + 5], y[640 * 3 + 5]), (5.0, 3.0));
        }
    }

    #[test]
    fn a_lens_that_folds_over_is_refused_or_outside() {
        let folding = camera(Lens::radial(-1.2, 0.0));
        let error = Undistortion::new(&folding, Fit::All).unwrap_err().to_string();
        assert!(error.contains("folds over") && error.contains("k1 -1.2"), "{error}");
        let [x, _] = Undistortion::new(&folding, Fit::Same).unwrap().maps();
        assert_eq!(x[0], -1.0);
    }

    #[test]
    fn a_half_sphere_is_cropped_or_shown_in_a_field_of_view() {
        // 180 degrees over the width.
        for lens in [Lens::Fisheye(Fisheye::new([0.01, -0.002, 0.0, 0.0])), Lens::Division(Division::new(-1.0))] {
            let at_side = lens.project(&Vector3::new(1.0, 0.0, 0.0)).unwrap().x;
            let k = Intrinsics { fx: 320.0 / at_side, fy: 320.0 / at_side, cx: 319.5, cy: 239.5, skew: 0.0 };
            let wide = Camera { size: ImageSize::new(640, 480), intrinsics: k, lens };
            let error = Undistortion::new(&wide, Fit::All).unwrap_err().to_string();
            assert!(error.contains("degrees from the optical axis"), "{error}");
            let crop = Undistortion::new(&wide, Fit::Crop).unwrap();
            let border = corners_and_sides(wide.size);
            let seen = |u: &Undistortion| border.iter().map(|p| u.source_pixel(p).unwrap()).collect::<Vec<_>>();
            let inside = |p: &Vector2<f64>| p.x > -0.51 && p.y > -0.51 && p.x < 639.51 && p.y < 479.51;
            assert!(seen(&crop).iter().all(inside), "{lens:?}");
            // It touches a border, or has corners as far out as can be.
            let corner = crop.intrinsics().ray(&Vector2::new(-0.5, -0.5));
            let touches = seen(&crop).iter().any(|p| p.x < -0.3 || p.y < -0.3);
            assert!(touches || (corner.xy().norm().atan() - MAX_ANGLE_RAD).abs() < 1e-6, "{lens:?} {corner}");
            let fov = Undistortion::new(&wide, Fit::FieldOfView { horizontal_rad: PI / 2.0 }).unwrap();
            assert!((fov.intrinsics().fx - 320.0).abs() < 1e-9 && fov.intrinsics().cx == 319.5);
            // 45 degrees to the right are at the right side.
            let expected = wide.project(&Vector3::new(1.0, 0.0, 1.0)).unwrap();
            assert!((fov.source_pixel(&Vector2::new(639.5, 239.5)).unwrap() - expected).norm() < 1e-9);
            for bad in [0.0, -1.0, PI, f64::NAN] {
                assert!(Undistortion::new(&wide, Fit::FieldOfView { horizontal_rad: bad }).is_err());
            }
            assert!(Undistortion::new(&wide, Fit::Same).unwrap().maps()[0].iter().all(|x| *x > -1.0));
        }
    }
}
