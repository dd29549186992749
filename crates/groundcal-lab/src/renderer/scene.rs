//! Scenes to render: a floor, boxes standing on it, a light, a camera and its views, all from one description.
//!
//! Lengths are in metres, angles in degrees, image coordinates in pixels with (0, 0) the centre of the top-left pixel.
//! The floor is the plane Z = 0 of a world with Z up; a view sees world point X at
//!
//! ```text
//! x ~ K lens(A_g Rz(-yaw) [I | -c] X)
//! ```
//!
//! with `A_g` the attitude of the view's group; [`groundcal::geometry::rotation_cam_from_world`] gives the signs of all angles.

use std::collections::BTreeMap;

use nalgebra::{Matrix3, Vector2, Vector3};
use serde::{Deserialize, Serialize};

use crate::renderer::noise;
use groundcal::geometry::ImageSize;
use groundcal::geometry::Intrinsics;
use groundcal::geometry::rotation_cam_from_world;
use groundcal::geometry::{Lens, Radtan};

/// Pixels of a picture: about a gigabyte while it is rendered.
const MAX_PIXELS: usize = 50_000_000;
/// Views of a scene, which are rendered one after the other.
const MAX_VIEWS: usize = 10_000;
/// Boxes: every ray is tested against each.
const MAX_BOXES: usize = 1000;

/// Why a scene cannot be rendered.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum SceneError {
    /// A field has a value outside its range.
    #[error("{field} = {value}: {rule}")]
    Invalid {
        /// The field, as it is written in the scene file.
        field: String,
        /// The value found.
        value: String,
        /// What the value has to be.
        rule: &'static str,
    },
    /// A view was asked for that the scene does not have.
    #[error("view {index} was asked for, but the scene has {count} (counted from 0)")]
    NoSuchView {
        /// The index asked for.
        index: usize,
        /// How many views there are.
        count: usize,
    },
    /// The boxes placed at random do not fit without touching one another or a camera.
    #[error(
        "only {placed} of boxes.random.count = {wanted} boxes fit into boxes.random.extent_m; enlarge it or ask for fewer"
    )]
    NoRoom {
        /// Boxes that found a place.
        placed: usize,
        /// Boxes asked for.
        wanted: usize,
    },
}

/// A scene and the views to take of it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Scene {
    /// Seed of everything random in the pictures themselves: sampling positions and sensor noise.
    #[serde(default = "default_seed")]
    pub seed: u64,
    /// The camera, the same for all views.
    pub camera: Camera,
    /// The floor.
    #[serde(default)]
    pub floor: Floor,
    /// Boxes standing on the floor.
    #[serde(default)]
    pub boxes: Boxes,
    /// The light.
    #[serde(default)]
    pub light: Light,
    /// What is seen above the horizon.
    #[serde(default)]
    pub sky: Sky,
    /// What the sensor and the file format do to the picture.
    #[serde(default)]
    pub sensor: Sensor,
    /// Views by attitude (`[[group]]` in a scene file).
    #[serde(rename = "group")]
    pub groups: Vec<Group>,
}

fn default_seed() -> u64 {
    1
}

/// The camera. See [`Intrinsics`] and [`Lens`] for what the numbers mean.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Camera {
    /// Width and height in pixels.
    pub image_size: [usize; 2],
    /// Focal length along x, in pixels.
    pub fx: f64,
    /// Focal length along y, in pixels. Default: `fx`.
    #[serde(default)]
    pub fy: Option<f64>,
    /// Principal point, x, in pixels. Default: the centre of the image, (width - 1) / 2.
    #[serde(default)]
    pub cx: Option<f64>,
    /// Principal point, y, in pixels. Default: the centre of the image, (height - 1) / 2.
    #[serde(default)]
    pub cy: Option<f64>,
    /// Skew in pixels. Default 0.
    #[serde(default)]
    pub skew: f64,
    /// Radial distortion, second order. Default 0.
    #[serde(default)]
    pub k1: f64,
    /// Radial distortion, fourth order. Default 0.
    #[serde(default)]
    pub k2: f64,
    /// Tangential distortion. Default 0.
    #[serde(default)]
    pub p1: f64,
    /// Tangential distortion. Default 0.
    #[serde(default)]
    pub p2: f64,
    /// A lens of another model (`[camera.lens]` in a scene file), instead of k1, k2, p1, p2.
    #[serde(default)]
    pub lens: Option<SceneLens>,
}

/// A lens by the name of its model and of its parameters.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SceneLens {
    /// `none`, `radtan` (k1, k2, p1, p2, k3), `division` (lambda) or `fisheye` (k1, k2, k3, k4).
    pub model: String,
    /// The parameters; those left out are zero.
    #[serde(flatten)]
    pub parameters: BTreeMap<String, f64>,
}

impl SceneLens {
    fn lens(&self) -> Result<Lens, String> {
        Lens::from_named(&self.model, self.parameters.iter().map(|(name, value)| (name.as_str(), *value)))
    }
}

impl Camera {
    /// A camera of square pixels with its principal point in the centre and no distortion.
    pub fn centred(image_size: [usize; 2], f_px: f64) -> Self {
        let (k1, k2, p1, p2) = (0.0, 0.0, 0.0, 0.0);
        Self { image_size, fx: f_px, fy: None, cx: None, cy: None, skew: 0.0, k1, k2, p1, p2, lens: None }
    }

    /// Width and height.
    pub fn size(&self) -> ImageSize {
        ImageSize::new(self.image_size[0], self.image_size[1])
    }

    /// The camera matrix, defaults filled in.
    pub fn intrinsics(&self) -> Intrinsics {
        let centre = self.size().centre_px();
        Intrinsics {
            fx: self.fx,
            fy: self.fy.unwrap_or(self.fx),
            cx: self.cx.unwrap_or(centre[0]),
            cy: self.cy.unwrap_or(centre[1]),
            skew: self.skew,
        }
    }

    /// The lens; none where [`Scene::validate`] refuses what is written.
    pub fn lens(&self) -> Lens {
        match &self.lens {
            None => Lens::Radtan(Radtan::new([self.k1, self.k2, self.p1, self.p2, 0.0])),
            Some(named) => named.lens().unwrap_or_default(),
        }
    }

    /// Size, camera matrix and lens.
    pub fn model(&self) -> groundcal::geometry::Camera {
        groundcal::geometry::Camera { size: self.size(), intrinsics: self.intrinsics(), lens: self.lens() }
    }
}

/// A kind of floor. All are aperiodic on a fine scale; they differ in contrast and in what they repeat.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum TextureKind {
    /// Stone tiles with grout lines and a tone of their own: well marked.
    Tiles,
    /// Fine heathered carpet, low in contrast: hard for feature detectors.
    Carpet,
    /// Stone chips of many sizes in cement: well marked on every scale.
    Terrazzo,
    /// Cast concrete: mottling on many scales, pits and hairline cracks.
    Concrete,
    /// Planks: strong grain along one direction, weak detail across it.
    Wood,
    /// Dark binder with bright aggregate.
    Asphalt,
}

/// The floor.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Floor {
    /// Which pattern. Default: terrazzo.
    pub texture: TextureKind,
    /// Characteristic length in metres: side of a tile (default 0.3), largest chip cell of terrazzo (0.045), width of a plank
    /// (0.14), spacing of carpet tufts (0.006), largest mottling of concrete (1.0), aggregate of asphalt (0.014).
    pub scale_m: Option<f64>,
    /// Deviation from the mean colour, as a multiple of the pattern's own (1).
    pub contrast: f64,
    /// Base colour, sRGB 0 to 1. Default: the pattern's own.
    pub colour: Option<[f64; 3]>,
    /// Second colour (grout, chips, grain, second yarn), sRGB 0 to 1. Default: the pattern's own.
    pub second_colour: Option<[f64; 3]>,
    /// Direction of the pattern's first axis from world +X, anticlockwise, in degrees (0).
    pub yaw_deg: f64,
    /// Seed of the pattern (1).
    pub seed: u32,
}

impl Default for Floor {
    fn default() -> Self {
        Self {
            texture: TextureKind::Terrazzo,
            scale_m: None,
            contrast: 1.0,
            colour: None,
            second_colour: None,
            yaw_deg: 0.0,
            seed: 1,
        }
    }
}

/// The boxes: those listed and those placed at random, together.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Boxes {
    /// Boxes one by one.
    pub list: Vec<FloorBox>,
    /// Boxes placed by a seed.
    pub random: Option<RandomBoxes>,
}

/// A box standing on the floor.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FloorBox {
    /// Centre of its base in metres.
    pub centre_m: [f64; 2],
    /// Direction of its first side from world +X, anticlockwise, in degrees. Default 0.
    #[serde(default)]
    pub yaw_deg: f64,
    /// Two sides and height in metres.
    pub size_m: [f64; 3],
    /// Colour, sRGB 0 to 1. Default: cardboard.
    #[serde(default = "cardboard")]
    pub colour: [f64; 3],
}

fn cardboard() -> [f64; 3] {
    [0.71, 0.55, 0.38]
}

/// Boxes placed at random: none touches another, none stands within 0.5 m of a camera.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RandomBoxes {
    /// How many.
    pub count: usize,
    /// Where their centres lie: x from, x to, y from, y to, in metres.
    pub extent_m: [f64; 4],
    /// Shortest and longest side in metres. Default 0.12 to 0.4.
    #[serde(default = "default_side_m")]
    pub side_m: [f64; 2],
    /// Least and greatest height in metres. Default 0.08 to 0.35.
    #[serde(default = "default_height_m")]
    pub height_m: [f64; 2],
    /// Seed. Default 1.
    #[serde(default = "default_box_seed")]
    pub seed: u32,
}

fn default_side_m() -> [f64; 2] {
    [0.12, 0.4]
}

fn default_height_m() -> [f64; 2] {
    [0.08, 0.35]
}

fn default_box_seed() -> u32 {
    1
}

/// A distant light and an even ambient one; the open floor's brightness does not depend on them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Light {
    /// Where the light comes from: anticlockwise from world +X, as a camera's yaw, in degrees (125).
    pub azimuth_deg: f64,
    /// Its height above the horizon in degrees, 5 to 90 (55).
    pub elevation_deg: f64,
    /// Radius of the light as seen from the floor, in degrees, 0 to 20: 0 gives shadows a hard edge (1.5).
    pub radius_deg: f64,
    /// The ambient part of the open floor's light, 0 to 1 (0.45).
    pub ambient: f64,
}

impl Default for Light {
    fn default() -> Self {
        Self { azimuth_deg: 125.0, elevation_deg: 55.0, radius_deg: 1.5, ambient: 0.45 }
    }
}

/// A pattern on a sphere at infinity, above the horizon.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Backdrop {
    /// Nothing but the gradient.
    None,
    /// Clouds: smooth, low in contrast.
    Clouds,
    /// Distant buildings with windows before the clouds: plenty of corners.
    Skyline,
}

/// What is seen above the horizon: a function of direction alone, so it moves with the camera's rotation only.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Sky {
    /// Colour at the horizon, sRGB 0 to 1.
    pub horizon_colour: [f64; 3],
    /// Colour straight up, sRGB 0 to 1.
    pub zenith_colour: [f64; 3],
    /// Pattern (none).
    pub backdrop: Backdrop,
    /// Seed of the pattern (1).
    pub seed: u32,
}

impl Default for Sky {
    fn default() -> Self {
        Self {
            horizon_colour: [0.82, 0.86, 0.90],
            zenith_colour: [0.42, 0.58, 0.82],
            backdrop: Backdrop::None,
            seed: 1,
        }
    }
}

/// From light to file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Sensor {
    /// Samples per pixel, 1 to 1024, rounded up to a square; on a floor seen at a slant they lie closer along the
    /// slant and further apart across it (16).
    pub samples_per_pixel: u32,
    /// Standard deviation of the noise at mid grey, in grey levels of 8 bits, in each colour channel (1).
    pub noise_sigma_gl: f64,
    /// The part of the noise variance at mid grey that grows with the light (photon noise), 0 to 1; the rest is read noise,
    /// the same everywhere in linear light (0.7).
    pub shot_fraction: f64,
    /// Standard deviation of the optical blur in pixels, on top of the pixel's own square (0).
    pub blur_sigma_px: f64,
    /// Quality of files named .jpg or .jpeg, 1 to 100; 0 allows .png only (92).
    pub jpeg_quality: u8,
}

impl Default for Sensor {
    fn default() -> Self {
        Self { samples_per_pixel: 16, noise_sigma_gl: 1.0, shot_fraction: 0.7, blur_sigma_px: 0.0, jpeg_quality: 92 }
    }
}

/// Views that share one attitude of the camera to the floor.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Group {
    /// Angle of the optical axis below the horizontal, in degrees (90: straight down).
    pub pitch_down_deg: f64,
    /// Turn about the optical axis, in degrees; positive dips the camera's right-hand side. Default 0.
    #[serde(default)]
    pub roll_deg: f64,
    /// The views (`[[group.view]]` in a scene file).
    #[serde(rename = "view")]
    pub views: Vec<View>,
}

/// One view.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct View {
    /// Name of the image file; it ends in .png, .jpg or .jpeg and names no folder.
    pub file: String,
    /// Heading in degrees, anticlockwise from world +X.
    pub yaw_deg: f64,
    /// Optical centre in metres; the last is the height above the floor.
    pub centre_m: [f64; 3],
    /// Added to the group's pitch for this view, in degrees: the axis is then not quite normal to the floor. Default 0.
    #[serde(default)]
    pub pitch_error_deg: f64,
    /// Added to the group's roll for this view, in degrees. Default 0.
    #[serde(default)]
    pub roll_error_deg: f64,
    /// Factor on the light. Default 1.
    #[serde(default = "default_exposure")]
    pub exposure: f64,
}

fn default_exposure() -> f64 {
    1.0
}

/// Where a view stands and looks.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ViewPose {
    /// Index of the attitude group.
    pub group: usize,
    /// Camera coordinates from world coordinates.
    pub r_cam_from_world: Matrix3<f64>,
    /// Optical centre in metres.
    pub centre_m: Vector3<f64>,
}

impl Scene {
    /// A scene with the given camera and views and defaults for all else.
    pub fn new(camera: Camera, groups: Vec<Group>) -> Self {
        Self {
            seed: default_seed(),
            camera,
            floor: Floor::default(),
            boxes: Boxes::default(),
            light: Light::default(),
            sky: Sky::default(),
            sensor: Sensor::default(),
            groups,
        }
    }

    /// All views in order, each with the index of its group.
    pub fn views(&self) -> impl Iterator<Item = (usize, &View)> {
        self.groups.iter().enumerate().flat_map(|(g, group)| group.views.iter().map(move |v| (g, v)))
    }

    /// How many views there are.
    pub fn view_count(&self) -> usize {
        self.groups.iter().map(|g| g.views.len()).sum()
    }

    fn view(&self, index: usize) -> Result<(usize, &View), SceneError> {
        self.views().nth(index).ok_or(SceneError::NoSuchView { index, count: self.view_count() })
    }

    /// Where view `index` (counted through all groups) stands and looks.
    pub fn pose(&self, index: usize) -> Result<ViewPose, SceneError> {
        let (group, view) = self.view(index)?;
        let g = &self.groups[group];
        let r = rotation_cam_from_world(
            (g.pitch_down_deg + view.pitch_error_deg).to_radians(),
            (g.roll_deg + view.roll_error_deg).to_radians(),
            view.yaw_deg.to_radians(),
        );
        Ok(ViewPose { group, r_cam_from_world: r, centre_m: Vector3::from(view.centre_m) })
    }

    /// The pixel (distorted, as in the picture) at which view `index` sees a world point in metres; `None` where its lens does
    /// not see it, as behind most cameras.
    pub fn pixel_from_world(&self, index: usize, point_m: &Vector3<f64>) -> Result<Option<Vector2<f64>>, SceneError> {
        let pose = self.pose(index)?;
        let p = pose.r_cam_from_world * (point_m - pose.centre_m);
        Ok(self.camera.model().project(&p))
    }

    /// The homography from undistorted pixels of view `a` to undistorted pixels of view `b` that the floor induces, with
    /// determinant 1; floor points that both views see have positive third coordinate on both sides.
    pub fn h_b_from_a(&self, a: usize, b: usize) -> Result<Matrix3<f64>, SceneError> {
        let k = self.camera.intrinsics();
        let (pa, pb) = (self.pose(a)?, self.pose(b)?);
        // Floor coordinates (X, Y, 1) to camera coordinates.
        let floor = |p: &ViewPose| {
            let c = p.centre_m;
            p.r_cam_from_world * Matrix3::new(1.0, 0.0, -c.x, 0.0, 1.0, -c.y, 0.0, 0.0, -c.z)
        };
        // The inverse of the floor map in closed form: no decomposition, hence no failure for a camera above the floor.
        let c = pa.centre_m;
        let world = Matrix3::new(1.0, 0.0, -c.x / c.z, 0.0, 1.0, -c.y / c.z, 0.0, 0.0, -1.0 / c.z);
        let h = k.matrix() * floor(&pb) * world * pa.r_cam_from_world.transpose() * k.inverse_matrix();
        // det = height of b over height of a.
        Ok(h / (pb.centre_m.z / c.z).cbrt())
    }

    /// The truth to score a calibration of the rendered pictures with.
    pub fn truth(&self) -> Truth {
        let k = self.camera.intrinsics();
        let views = self.views().map(|(group, view)| TruthView {
            file: view.file.clone(),
            attitude_group: group,
            yaw_deg: view.yaw_deg,
            pitch_down_deg: self.groups[group].pitch_down_deg + view.pitch_error_deg,
            roll_deg: self.groups[group].roll_deg + view.roll_error_deg,
            centre_m: view.centre_m,
        });
        Truth {
            image_size: self.camera.image_size,
            fx: k.fx,
            fy: k.fy,
            cx: k.cx,
            cy: k.cy,
            skew: k.skew,
            distortion: self.camera.lens(),
            pixel_centre: "(0,0) is the centre of the top-left pixel".to_owned(),
            kind: "rendered".to_owned(),
            views: views.collect(),
        }
    }

    /// All boxes: those listed, then those placed at random.
    pub fn all_boxes(&self) -> Result<Vec<FloorBox>, SceneError> {
        let mut boxes = self.boxes.list.clone();
        let Some(random) = &self.boxes.random else { return Ok(boxes) };
        const PALETTE: [[f64; 3]; 6] = [
            [0.71, 0.55, 0.38],
            [0.66, 0.51, 0.35],
            [0.75, 0.28, 0.22],
            [0.22, 0.42, 0.62],
            [0.85, 0.83, 0.78],
            [0.30, 0.52, 0.38],
        ];
        let radius = |size: &[f64; 3]| 0.5 * size[0].hypot(size[1]);
        let mut placed = 0;
        for attempt in 0..(200 * random.count) {
            if placed == random.count {
                break;
            }
            let mut h = noise::hash2(attempt as i32, 0, random.seed);
            let mut between = |low: f64, high: f64| {
                h = noise::rehash(h);
                low + (high - low) * f64::from(noise::unit(h))
            };
            let [x0, x1, y0, y1] = random.extent_m;
            let candidate = FloorBox {
                centre_m: [between(x0, x1), between(y0, y1)],
                yaw_deg: between(0.0, 360.0),
                size_m: [
                    between(random.side_m[0], random.side_m[1]),
                    between(random.side_m[0], random.side_m[1]),
                    between(random.height_m[0], random.height_m[1]),
                ],
                colour: PALETTE[(between(0.0, 1.0) * 5.999) as usize],
            };
            let r = radius(&candidate.size_m);
            let away =
                |c: [f64; 2], least: f64| (candidate.centre_m[0] - c[0]).hypot(candidate.centre_m[1] - c[1]) > least;
            let free = boxes.iter().all(|b| away(b.centre_m, r + radius(&b.size_m) + 0.02))
                && self.views().all(|(_, v)| away([v.centre_m[0], v.centre_m[1]], r + 0.5));
            if free {
                boxes.push(candidate);
                placed += 1;
            }
        }
        if placed < random.count {
            return Err(SceneError::NoRoom { placed, wanted: random.count });
        }
        Ok(boxes)
    }

    /// Checks every field; the error names the first that is out of range.
    pub fn validate(&self) -> Result<(), SceneError> {
        let c = &self.camera;
        if c.image_size.iter().any(|&n| !(8..=32768).contains(&n)) {
            return Err(invalid("camera.image_size", &c.image_size, "each side must be 8 to 32768 pixels"));
        }
        if c.image_size[0] * c.image_size[1] > MAX_PIXELS {
            return Err(invalid("camera.image_size", &c.image_size, "at most 50 megapixels are rendered"));
        }
        let k = c.intrinsics();
        positive("camera.fx", k.fx)?;
        positive("camera.fy", k.fy)?;
        for (name, value) in [("cx", k.cx), ("cy", k.cy), ("skew", k.skew)] {
            finite(&format!("camera.{name}"), value)?;
        }
        for (name, value) in [("k1", c.k1), ("k2", c.k2), ("p1", c.p1), ("p2", c.p2)] {
            finite(&format!("camera.{name}"), value)?;
        }
        if let Some(lens) = &c.lens {
            let rule =
                "must be none, radtan (k1, k2, p1, p2, k3), division (lambda) or fisheye (k1, k2, k3, k4), finite";
            lens.lens().map_err(|_| invalid("camera.lens", lens, rule))?;
            if [c.k1, c.k2, c.p1, c.p2] != [0.0; 4] {
                return Err(invalid("camera.lens", lens, "must not stand beside k1, k2, p1, p2 of the camera"));
            }
        }

        let f = &self.floor;
        if let Some(scale) = f.scale_m {
            positive("floor.scale_m", scale)?;
        }
        in_range("floor.contrast", f.contrast, 0.0, 10.0, "must be 0 to 10")?;
        finite("floor.yaw_deg", f.yaw_deg)?;
        f.colour.as_ref().map_or(Ok(()), |v| colour("floor.colour", v))?;
        f.second_colour.as_ref().map_or(Ok(()), |v| colour("floor.second_colour", v))?;

        if self.boxes.list.len() > MAX_BOXES {
            return Err(invalid("boxes.list", &self.boxes.list.len(), "must be at most 1000 boxes"));
        }
        for (i, b) in self.boxes.list.iter().enumerate() {
            b.centre_m.iter().try_for_each(|&v| finite(&format!("boxes.list[{i}].centre_m"), v))?;
            b.size_m.iter().try_for_each(|&v| positive(&format!("boxes.list[{i}].size_m"), v))?;
            finite(&format!("boxes.list[{i}].yaw_deg"), b.yaw_deg)?;
            colour(&format!("boxes.list[{i}].colour"), &b.colour)?;
        }
        if let Some(r) = &self.boxes.random {
            if r.count > MAX_BOXES {
                return Err(invalid("boxes.random.count", &r.count, "must be at most 1000"));
            }
            let e = r.extent_m;
            if !(e.iter().all(|v| v.is_finite()) && e[0] <= e[1] && e[2] <= e[3]) {
                return Err(invalid(
                    "boxes.random.extent_m",
                    &e,
                    "must be x from, x to, y from, y to, in rising order",
                ));
            }
            for (name, v) in [("side_m", r.side_m), ("height_m", r.height_m)] {
                if !(v.iter().all(|v| v.is_finite()) && v[0] > 0.0 && v[0] <= v[1]) {
                    let field = format!("boxes.random.{name}");
                    return Err(invalid(&field, &v, "must be least and greatest, both positive"));
                }
            }
        }

        let l = &self.light;
        finite("light.azimuth_deg", l.azimuth_deg)?;
        in_range("light.elevation_deg", l.elevation_deg, 5.0, 90.0, "must be 5 to 90 degrees")?;
        in_range("light.radius_deg", l.radius_deg, 0.0, 20.0, "must be 0 to 20 degrees")?;
        in_range("light.ambient", l.ambient, 0.0, 1.0, "must be 0 to 1")?;
        colour("sky.horizon_colour", &self.sky.horizon_colour)?;
        colour("sky.zenith_colour", &self.sky.zenith_colour)?;

        let s = &self.sensor;
        if !(1..=1024).contains(&s.samples_per_pixel) {
            return Err(invalid("sensor.samples_per_pixel", &s.samples_per_pixel, "must be 1 to 1024"));
        }
        in_range("sensor.noise_sigma_gl", s.noise_sigma_gl, 0.0, 100.0, "must be 0 to 100 grey levels")?;
        in_range("sensor.shot_fraction", s.shot_fraction, 0.0, 1.0, "must be 0 to 1")?;
        in_range("sensor.blur_sigma_px", s.blur_sigma_px, 0.0, 20.0, "must be 0 to 20 pixels")?;
        if s.jpeg_quality > 100 {
            return Err(invalid("sensor.jpeg_quality", &s.jpeg_quality, "must be 0 to 100"));
        }
        self.validate_views()
    }

    fn validate_views(&self) -> Result<(), SceneError> {
        if self.view_count() == 0 {
            return Err(invalid("group", &"no view", "a scene needs at least one [[group]] with a [[group.view]]"));
        }
        if self.view_count() > MAX_VIEWS {
            return Err(invalid("group", &self.view_count(), "must have at most 10000 views"));
        }
        let mut names = std::collections::HashSet::new();
        for (g, group) in self.groups.iter().enumerate() {
            let pitch = format!("group[{g}].pitch_down_deg");
            in_range(&pitch, group.pitch_down_deg, -90.0, 90.0, "must be -90 to 90 degrees")?;
            finite(&format!("group[{g}].roll_deg"), group.roll_deg)?;
            for (v, view) in group.views.iter().enumerate() {
                let field = |name: &str| format!("group[{g}].view[{v}].{name}");
                let lower = view.file.to_ascii_lowercase();
                let jpeg = lower.ends_with(".jpg") || lower.ends_with(".jpeg");
                if view.file.contains(['/', '\\']) || !(jpeg || lower.ends_with(".png")) || lower.starts_with('.') {
                    return Err(invalid(
                        &field("file"),
                        &view.file,
                        "must be a name ending in .png, .jpg or .jpeg, no path",
                    ));
                }
                if jpeg && self.sensor.jpeg_quality == 0 {
                    return Err(invalid(&field("file"), &view.file, "must end in .png, as sensor.jpeg_quality is 0"));
                }
                if !names.insert(lower) {
                    return Err(invalid(&field("file"), &view.file, "is the name of an earlier view too"));
                }
                finite(&field("yaw_deg"), view.yaw_deg)?;
                in_range(&field("pitch_error_deg"), view.pitch_error_deg, -45.0, 45.0, "must be -45 to 45 degrees")?;
                in_range(&field("roll_error_deg"), view.roll_error_deg, -45.0, 45.0, "must be -45 to 45 degrees")?;
                in_range(&field("exposure"), view.exposure, 1e-3, 1e3, "must be 0.001 to 1000")?;
                if !(view.centre_m.iter().all(|v| v.is_finite()) && view.centre_m[2] > 0.0) {
                    return Err(invalid(
                        &field("centre_m"),
                        &view.centre_m,
                        "must be finite and above the floor (Z > 0)",
                    ));
                }
            }
        }
        Ok(())
    }
}

fn invalid(field: &str, value: &impl std::fmt::Debug, rule: &'static str) -> SceneError {
    SceneError::Invalid { field: field.to_owned(), value: format!("{value:?}"), rule }
}

fn finite(field: &str, value: f64) -> Result<(), SceneError> {
    if value.is_finite() { Ok(()) } else { Err(invalid(field, &value, "must be finite")) }
}

fn positive(field: &str, value: f64) -> Result<(), SceneError> {
    if value.is_finite() && value > 0.0 { Ok(()) } else { Err(invalid(field, &value, "must be positive")) }
}

fn in_range(field: &str, value: f64, low: f64, high: f64, rule: &'static str) -> Result<(), SceneError> {
    if (low..=high).contains(&value) { Ok(()) } else { Err(invalid(field, &value, rule)) }
}

fn colour(field: &str, value: &[f64; 3]) -> Result<(), SceneError> {
    let ok = value.iter().all(|v| (0.0..=1.0).contains(v));
    if ok { Ok(()) } else { Err(invalid(field, value, "must be three numbers from 0 to 1")) }
}

/// What is known exactly about rendered pictures.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Truth {
    /// Width and height in pixels.
    pub image_size: [usize; 2],
    /// Focal length along x, in pixels.
    pub fx: f64,
    /// Focal length along y, in pixels.
    pub fy: f64,
    /// Principal point, x, in pixels.
    pub cx: f64,
    /// Principal point, y, in pixels.
    pub cy: f64,
    /// Skew in pixels.
    pub skew: f64,
    /// Lens distortion.
    pub distortion: Lens,
    /// Where pixel (0, 0) is.
    pub pixel_centre: String,
    /// How the pictures came about.
    pub kind: String,
    /// The views, in order.
    pub views: Vec<TruthView>,
}

/// One view of a [`Truth`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TruthView {
    /// Name of the image file.
    pub file: String,
    /// Index of the attitude group.
    pub attitude_group: usize,
    /// Heading in degrees, anticlockwise.
    pub yaw_deg: f64,
    /// Angle of the optical axis below the horizontal in degrees, the view's own error included.
    pub pitch_down_deg: f64,
    /// Turn about the optical axis in degrees, the view's own error included.
    pub roll_deg: f64,
    /// Optical centre in metres.
    pub centre_m: [f64; 3],
}

#[cfg(test)]
mod tests {
    use super::*;

    fn view(file: &str, yaw_deg: f64, centre_m: [f64; 3]) -> View {
        View { file: file.into(), yaw_deg, centre_m, pitch_error_deg: 0.0, roll_error_deg: 0.0, exposure: 1.0 }
    }

    fn scene() -> Scene {
        let views = vec![view("a.png", 100.0, [0.1, 0.2, 1.4]), view("b.png", 125.0, [0.5, -0.1, 1.6])];
        Scene::new(Camera::centred([320, 240], 280.0), vec![Group { pitch_down_deg: 50.0, roll_deg: 12.0, views }])
    }

    #[test]
    fn the_homography_maps_projections_of_floor_points() {
        let s = scene();
        let h = s.h_b_from_a(0, 1).unwrap();
        assert!((h.determinant() - 1.0).abs() < 1e-12);
        for p in [[0.0, 1.0], [-0.4, 1.5], [0.7, 1.2]] {
            let x = Vector3::new(p[0], p[1], 0.0);
            let (a, b) = (s.pixel_from_world(0, &x).unwrap().unwrap(), s.pixel_from_world(1, &x).unwrap().unwrap());
            let q = h * Vector3::new(a.x, a.y, 1.0);
            assert!(q.z > 0.0);
            assert!((Vector2::new(q.x / q.z, q.y / q.z) - b).norm() < 1e-9);
        }
        assert!((s.h_b_from_a(1, 0).unwrap() * h - Matrix3::identity()).norm() < 1e-9);
    }

    #[test]
    fn errors_name_the_field_and_the_value() {
        let message = |change: &dyn Fn(&mut Scene)| {
            let mut s = scene();
            change(&mut s);
            s.validate().unwrap_err().to_string()
        };
        assert!(scene().validate().is_ok());
        assert_eq!(message(&|s| s.camera.fx = -3.0), "camera.fx = -3.0: must be positive");
        let text = message(&|s| s.groups[0].views[1].centre_m[2] = 0.0);
        assert!(text.starts_with("group[0].view[1].centre_m = [0.5, -0.1, 0.0]"), "{text}");
        assert!(message(&|s| s.groups[0].views[1].file = "A.PNG".into()).contains("earlier view"));
        assert!(message(&|s| s.groups[0].views[1].file = "../b.png".into()).contains("no path"));
        assert!(message(&|s| s.floor.colour = Some([0.2, 1.2, 0.0])).starts_with("floor.colour"));
        assert!(message(&|s| s.sensor.noise_sigma_gl = f64::NAN).starts_with("sensor.noise_sigma_gl = NaN"));
        assert!(message(&|s| s.groups.clear()).starts_with("group"));
        let lens = |model: &str, name: &str| SceneLens { model: model.into(), parameters: [(name.into(), 0.1)].into() };
        assert!(message(&|s| s.camera.lens = Some(lens("fisheye", "p1"))).starts_with("camera.lens"));
        assert!(message(&|s| s.camera.lens = Some(lens("omni", "k1"))).contains("fisheye (k1, k2, k3, k4)"));
        let beside = message(&|s| (s.camera.lens, s.camera.k1) = (Some(lens("fisheye", "k1")), 0.1));
        assert!(beside.contains("beside"), "{beside}");
        assert_eq!(scene().pose(2), Err(SceneError::NoSuchView { index: 2, count: 2 }));
    }

    #[test]
    fn random_boxes_keep_apart_or_say_that_they_cannot() {
        let mut s = scene();
        let mut random = RandomBoxes {
            count: 8,
            extent_m: [-2.0, 2.0, 0.0, 3.0],
            side_m: [0.1, 0.3],
            height_m: [0.1, 0.2],
            seed: 3,
        };
        s.boxes.random = Some(random.clone());
        let boxes = s.all_boxes().unwrap();
        assert_eq!(boxes.len(), 8);
        assert_eq!(boxes, s.all_boxes().unwrap());
        random.extent_m = [0.0, 0.1, 2.0, 2.1];
        s.boxes.random = Some(random);
        assert!(matches!(s.all_boxes(), Err(SceneError::NoRoom { wanted: 8, .. })));
    }
}
