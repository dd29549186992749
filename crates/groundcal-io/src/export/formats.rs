//! The files of `calibrate --out` beside `calibration.json`: one module a format, chosen by name.

use groundcal::result::{Calibration, Camera};

use crate::error::IoError;
use crate::export::{colmap, kalibr, matlab, nerfstudio, opencv, ros};

/// A format of another program.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Format {
    /// camera_opencv.yaml: OpenCV's FileStorage
    Opencv,
    /// camera_info.yaml: ROS camera_info
    Ros,
    /// camchain.yaml: Kalibr
    Kalibr,
    /// cameras.txt, images.txt, points3D.txt: COLMAP
    Colmap,
    /// transforms.json: nerfstudio and its relatives
    Nerfstudio,
    /// camera_matlab.csv: the numbers as MATLAB counts pixels
    Matlab,
}

impl Format {
    /// All of them.
    pub const ALL: [Format; 6] =
        [Format::Opencv, Format::Ros, Format::Kalibr, Format::Colmap, Format::Nerfstudio, Format::Matlab];
}

/// A file to write.
pub struct File {
    /// Its name.
    pub name: &'static str,
    /// Its content.
    pub content: String,
}

/// Files of the formats asked for, and what they cannot say.
pub struct Files {
    /// In the order of the formats.
    pub files: Vec<File>,
    /// Sentences for the user.
    pub notes: Vec<String>,
}

/// Renders the formats; an empty list stands for all.
pub fn render(calibration: &Calibration, formats: &[Format]) -> Result<Files, IoError> {
    let formats = if formats.is_empty() { &Format::ALL[..] } else { formats };
    let has = |format: Format| formats.contains(&format);
    let world = World::largest(calibration);
    let mut files = Vec::new();
    // In the order of the enumeration, each once, whatever the order they were named in.
    for format in Format::ALL.iter().filter(|f| has(**f)) {
        let mut add = |name: &'static str, content: String| files.push(File { name, content });
        match format {
            Format::Opencv => add("camera_opencv.yaml", opencv::yaml(calibration)),
            Format::Ros => add("camera_info.yaml", ros::yaml(calibration)),
            Format::Kalibr => add("camchain.yaml", kalibr::yaml(calibration)),
            Format::Colmap => {
                add("cameras.txt", colmap::cameras(calibration));
                add("images.txt", colmap::images(&world));
                add("points3D.txt", colmap::points());
            }
            Format::Nerfstudio => add("transforms.json", nerfstudio::json(calibration, &world)?),
            Format::Matlab => add("camera_matlab.csv", matlab::csv(calibration)),
        }
    }
    let mut notes = Vec::new();
    if (has(Format::Colmap) || has(Format::Nerfstudio)) && !world.left_out.is_empty() {
        notes.push(world.what_is_left_out());
    }
    if let Some(pose) = world.poses.iter().find(|p| has(Format::Colmap) && p.image.contains(char::is_whitespace)) {
        notes.push(format!(
            "COLMAP reads the name of an image up to the first blank: \"{}\" will not be found. Rename the file",
            pose.image
        ));
    }
    let unable: Vec<&str> =
        [(Format::Kalibr, "camchain.yaml"), (Format::Colmap, "cameras.txt"), (Format::Nerfstudio, "transforms.json")]
            .iter()
            .filter(|(format, _)| has(*format))
            .map(|(_, name)| *name)
            .collect();
    if calibration.camera.skew != 0.0 && !unable.is_empty() {
        notes.push(format!(
            "the skew of {:.3} px is left out of {}: the format has no place for it",
            calibration.camera.skew,
            unable.join(", ")
        ));
    }
    Ok(Files { files, notes })
}

/// A view with its place: camera coordinates are R (X - c).
pub struct Pose<'a> {
    /// Name of the image.
    pub image: &'a str,
    /// Camera from world.
    pub r_cam_from_world: nalgebra::Matrix3<f64>,
    /// Optical centre in the world.
    pub centre: nalgebra::Vector3<f64>,
}

/// The largest set of views that have a position in one world, and the views outside it.
pub struct World<'a> {
    /// Its views; empty where none has a position.
    pub poses: Vec<Pose<'a>>,
    /// Name of the image whose foot is its origin.
    pub origin: Option<&'a str>,
    /// Views with a position in another world.
    pub left_out: Vec<&'a str>,
    /// Unit of length, in words.
    pub unit: &'static str,
}

impl<'a> World<'a> {
    /// Worlds are told apart by their origin; of equally large ones the first is taken.
    pub fn largest(calibration: &'a Calibration) -> Self {
        let placed = || calibration.views.iter().filter(|v| v.position.is_some());
        let count = |origin: &str| placed().filter(|v| v.origin == origin).count();
        let mut origin: Option<&str> = None;
        for view in placed() {
            if origin.is_none_or(|o| count(&view.origin) > count(o)) {
                origin = Some(&view.origin);
            }
        }
        let inside = |v: &&groundcal::result::ViewReport| Some(v.origin.as_str()) == origin;
        let poses = placed().filter(inside).filter_map(|v| {
            let [pitch, roll, yaw] = [v.pitch_down_deg, v.roll_deg, v.yaw_deg].map(f64::to_radians);
            let r_cam_from_world = groundcal::geometry::attitude::rotation_cam_from_world(pitch, roll, yaw);
            Some(Pose { image: &v.image, r_cam_from_world, centre: v.position?.into() })
        });
        let metres = calibration.camera_height_m.is_some();
        Self {
            poses: poses.collect(),
            origin,
            unit: if metres { "metres" } else { "heights of the first camera" },
            left_out: placed().filter(|v| !inside(v)).map(|v| v.image.as_str()).collect(),
        }
    }

    /// A sentence about the other worlds.
    pub fn what_is_left_out(&self) -> String {
        format!(
            "poses are those of the {} views connected to {}; {} in other worlds (no common points tie them together): {}",
            self.poses.len(),
            self.origin.unwrap_or_default(),
            match self.left_out.len() {
                1 => "1 view is".to_string(),
                n => format!("{n} views are"),
            },
            self.left_out.join(", ")
        )
    }
}

/// A number that every YAML reader takes for one: YAML 1.1 (PyYAML) wants a point in the mantissa and a sign in the exponent.
/// Shortest digits that read back exactly.
pub fn number(value: f64) -> String {
    // Negative zero helps nobody.
    let text = format!("{:?}", value + 0.0);
    match text.split_once('e') {
        Some((mantissa, exponent)) => {
            let point = if mantissa.contains('.') { "" } else { ".0" };
            let sign = if exponent.starts_with('-') { "" } else { "+" };
            format!("{mantissa}{point}e{sign}{exponent}")
        }
        None => text,
    }
}

/// Numbers with commas between.
pub fn list(values: &[f64]) -> String {
    values.iter().map(|v| number(*v)).collect::<Vec<_>>().join(", ")
}

/// The nine numbers of K, row by row.
pub fn camera_matrix(c: &Camera) -> [f64; 9] {
    [c.fx, c.skew, c.cx, 0.0, c.fy, c.cy, 0.0, 0.0, 1.0]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_a_point_and_a_signed_exponent() {
        for (value, text) in [
            (705.0, "705.0"),
            (-0.0, "0.0"),
            (1e-5, "1.0e-5"),
            (-8.28619e-5, "-8.28619e-5"),
            (1e20, "1.0e+20"),
            (0.1, "0.1"),
        ] {
            assert_eq!(number(value), text);
            assert_eq!(text.parse::<f64>(), Ok(value));
        }
    }
}
