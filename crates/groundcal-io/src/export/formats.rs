//! The files of `calibrate --out` beside `calibration.json`: a table of formats, one module each, chosen by name.

use std::path::{Path, PathBuf};

use groundcal::result::Calibration;

use crate::{
    error::IoError,
    export::{colmap, file::File, kalibr, matlab, nerfstudio, opencv, ros, world::World, write::write_whole},
    text::quoted,
};

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

    fn writer(self) -> Writer {
        match self {
            Format::Opencv => Writer { files: opencv::files, poses: false, without_skew: None },
            Format::Ros => Writer { files: ros::files, poses: false, without_skew: None },
            Format::Kalibr => Writer { files: kalibr::files, poses: false, without_skew: Some("camchain.yaml") },
            Format::Colmap => Writer { files: colmap::files, poses: true, without_skew: Some("cameras.txt") },
            Format::Nerfstudio => {
                Writer { files: nerfstudio::files, poses: true, without_skew: Some("transforms.json") }
            }
            Format::Matlab => Writer { files: matlab::files, poses: false, without_skew: None },
        }
    }
}

/// A row of the table of formats.
struct Writer {
    /// Makes the files.
    files: fn(&Calibration, &World) -> Result<Vec<File>, IoError>,
    /// Whether poses are written.
    poses: bool,
    /// The file that has no place for a skew.
    without_skew: Option<&'static str>,
}

/// Files of the formats asked for, and what they cannot say.
#[derive(Debug)]
pub struct Files {
    /// In the order of the formats.
    pub files: Vec<File>,
    /// Sentences for the user.
    pub notes: Vec<String>,
}

/// Renders the formats, each once, in the order of [`Format::ALL`]; an empty list stands for all.
///
/// # Errors
/// [`IoError::Other`] where a number cannot be written.
pub fn render(calibration: &Calibration, formats: &[Format]) -> Result<Files, IoError> {
    let chosen: Vec<Format> = Format::ALL.into_iter().filter(|f| formats.is_empty() || formats.contains(f)).collect();
    let world = World::largest(calibration);
    let mut files = Vec::new();
    for format in &chosen {
        files.extend((format.writer().files)(calibration, &world)?);
    }
    Ok(Files { files, notes: notes(calibration, &world, &chosen) })
}

fn notes(calibration: &Calibration, world: &World, chosen: &[Format]) -> Vec<String> {
    let mut notes = Vec::new();
    if chosen.iter().any(|f| f.writer().poses) && !world.left_out.is_empty() {
        notes.push(world.what_is_left_out());
    }
    let blank = world.poses.iter().find(|p| p.image.contains(char::is_whitespace));
    if let Some(pose) = blank.filter(|_| chosen.contains(&Format::Colmap)) {
        notes.push(format!(
            "COLMAP reads the name of an image up to the first blank: {} will not be found. Rename the file",
            quoted(pose.image)
        ));
    }
    let unable: Vec<&str> = chosen.iter().filter_map(|f| f.writer().without_skew).collect();
    if calibration.camera.skew != 0.0 && !unable.is_empty() {
        notes.push(format!(
            "the skew of {:.3} px is left out of {}: the format has no place for it",
            calibration.camera.skew,
            unable.join(", ")
        ));
    }
    notes
}

/// Writes the files of the formats into a folder, which is made if need be. Returns their paths, and sentences about what the
/// formats cannot say.
///
/// # Errors
/// [`IoError::Other`] where the folder does not take them.
///
/// ```
/// use groundcal_io::export::{Format, write_formats};
///
/// fn camera_for_ros(calibration: &groundcal::result::Calibration) -> Result<(), groundcal_io::error::IoError> {
///     let (paths, notes) = write_formats(calibration, &[Format::Ros], "out".as_ref())?;
///     assert!(paths[0].ends_with("camera_info.yaml"));
///     for note in notes {
///         eprintln!("note: {note}");
///     }
///     Ok(())
/// }
/// ```
pub fn write_formats(
    calibration: &Calibration,
    formats: &[Format],
    folder: &Path,
) -> Result<(Vec<PathBuf>, Vec<String>), IoError> {
    let rendered = render(calibration, formats)?;
    std::fs::create_dir_all(folder)
        .map_err(|e| IoError::Other(format!("cannot make the folder {}: {e}", folder.display())))?;
    let mut paths = Vec::with_capacity(rendered.files.len());
    for file in &rendered.files {
        let path = folder.join(file.name);
        write_whole(&path, file.content.as_bytes())?;
        paths.push(path);
    }
    Ok((paths, rendered.notes))
}
