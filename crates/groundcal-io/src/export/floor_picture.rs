//! The files beside a picture of the floor: a world file, and JSON with the homographies from image to floor.

use std::collections::BTreeMap;

use groundcal::{
    floor::{FloorGrid, FloorView},
    geometry::{Camera, Lens},
};
use nalgebra::Matrix3;
use serde::Serialize;

use crate::error::IoError;

/// A picture of the floor.
#[derive(Debug, Clone)]
pub struct FloorPicture<'a> {
    /// Name of its file.
    pub file: String,
    /// Its grid on the floor.
    pub grid: FloorGrid,
    /// The views in it: image and place.
    pub views: Vec<(&'a str, &'a FloorView)>,
    /// The image at whose foot the world begins; `None`: below the optical centre.
    pub origin: Option<&'a str>,
    /// How far from below each camera the floor is shown.
    pub max_distance: f64,
    /// Height of the camera at the first view in metres, where lengths are.
    pub camera_height_m: Option<f64>,
    /// The camera of the views.
    pub camera: Camera,
}

/// Name of the unit of length: metres where the camera's height is known in them.
pub fn unit(camera_height_m: Option<f64>) -> &'static str {
    if camera_height_m.is_some() { "metre" } else { "camera height" }
}

#[derive(Debug, Serialize)]
struct FloorPictureJson<'a> {
    picture: &'a str,
    picture_size: [usize; 2],
    pixel_centre: &'static str,
    unit: &'static str,
    camera_height_m: Option<f64>,
    units_per_pixel: f64,
    max_distance: f64,
    origin: Option<&'a str>,
    floor_from_picture: [[f64; 3]; 3],
    views: Vec<ViewJson<'a>>,
    camera: CameraJson,
}

#[derive(Debug, Serialize)]
struct ViewJson<'a> {
    image: &'a str,
    floor_from_image: [[f64; 3]; 3],
    picture_from_image: [[f64; 3]; 3],
    position: [f64; 3],
}

/// The camera, and its coefficients beside it as well, where they were before there were other lenses.
#[derive(Debug, Serialize)]
struct CameraJson {
    #[serde(flatten)]
    camera: Camera,
    #[serde(flatten)]
    coefficients: BTreeMap<&'static str, f64>,
}

impl From<Camera> for CameraJson {
    fn from(camera: Camera) -> Self {
        let lens = camera.lens;
        let known = matches!(lens, Lens::None | Lens::Radtan(_));
        let of = |name: &'static str| (name, lens.parameter(name).unwrap_or(0.0));
        let coefficients = if known { ["k1", "k2", "p1", "p2"].map(of).into() } else { BTreeMap::new() };
        Self { camera, coefficients }
    }
}

impl<'a> FloorPicture<'a> {
    /// The JSON beside the picture.
    ///
    /// # Errors
    /// [`IoError::Other`] when it cannot be written as JSON.
    pub fn json(&self) -> Result<String, IoError> {
        let floor_from_picture = self.grid.floor_from_pixel_matrix();
        let picture_from_floor = floor_from_picture.try_inverse().unwrap_or(Matrix3::identity());
        let of_view = |(image, view): &(&'a str, &FloorView)| {
            let h = view.floor_from_image();
            ViewJson {
                image,
                floor_from_image: rows(&h),
                picture_from_image: rows(&(picture_from_floor * h)),
                position: (*view.centre()).into(),
            }
        };
        let json = FloorPictureJson {
            picture: &self.file,
            picture_size: [self.grid.size.width, self.grid.size.height],
            pixel_centre: "(0,0) is the centre of the top-left pixel",
            unit: unit(self.camera_height_m),
            camera_height_m: self.camera_height_m,
            units_per_pixel: self.grid.unit_per_px,
            max_distance: self.max_distance,
            origin: self.origin,
            floor_from_picture: rows(&floor_from_picture),
            views: self.views.iter().map(of_view).collect(),
            camera: self.camera.into(),
        };
        serde_json::to_string_pretty(&json)
            .map(|json| json + "\n")
            .map_err(|e| IoError::Other(format!("cannot write the homography as JSON: {e}")))
    }

    /// The world file, six lines: X and Y by the column, X and Y by the row, X and Y of the centre of the top-left pixel.
    pub fn world_file(&self) -> String {
        world_file(&self.grid)
    }
}

fn world_file(grid: &FloorGrid) -> String {
    // By the column, by the row, and the first pixel: X and Y of each. Adding zero turns -0 into 0.
    let h = grid.floor_from_pixel_matrix();
    h.fixed_rows::<2>(0).iter().map(|v| format!("{:?}\n", v + 0.0)).collect()
}

fn rows(m: &Matrix3<f64>) -> [[f64; 3]; 3] {
    std::array::from_fn(|r| std::array::from_fn(|c| m[(r, c)]))
}

#[cfg(test)]
mod tests {
    use groundcal::geometry::ImageSize;
    use nalgebra::Vector2;

    use super::*;

    #[test]
    fn world_files_have_six_lines() {
        let grid = FloorGrid {
            top_left: Vector2::new(-1.5, 2.25),
            right: Vector2::x(),
            unit_per_px: 0.01,
            size: ImageSize::new(10, 10),
        };
        assert_eq!(world_file(&grid), "0.01\n0.0\n0.0\n-0.01\n-1.5\n2.25\n");
    }
}
