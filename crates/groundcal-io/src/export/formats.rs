//! The files of `calibrate --out` beside `calibration.json`: a table of formats, one module each, chosen by name.

use std::path::{Path, PathBuf};

use groundcal::{
    geometry::{Camera, Lens},
    result::Calibration,
};

use crate::{
    error::IoError,
    export::{colmap, file::File, kalibr, matlab, nerfstudio, opencv, ros, source::Source},
    outputs::{Outputs, Request},
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
        let whole = Writer {
            file: "",
            more_files: &[],
            files: opencv::files,
            poses: false,
            skew: true,
            k3: true,
            fisheye: true,
        };
        match self {
            Format::Opencv => Writer { file: "camera_opencv.yaml", ..whole },
            Format::Ros => Writer { file: "camera_info.yaml", files: ros::files, ..whole },
            Format::Kalibr => Writer { file: "camchain.yaml", files: kalibr::files, skew: false, k3: false, ..whole },
            Format::Colmap => Writer {
                file: "cameras.txt",
                more_files: &["images.txt", "points3D.txt"],
                files: colmap::files,
                poses: true,
                skew: false,
                ..whole
            },
            Format::Nerfstudio => {
                Writer { file: "transforms.json", files: nerfstudio::files, poses: true, skew: false, ..whole }
            }
            Format::Matlab => Writer { file: "camera_matlab.csv", files: matlab::files, fisheye: false, ..whole },
        }
    }
}

/// A row of the table of formats.
struct Writer {
    /// The file of the camera.
    file: &'static str,
    /// Those beside it.
    more_files: &'static [&'static str],
    /// Makes the files.
    files: fn(&Source) -> Result<Vec<File>, IoError>,
    /// Whether poses are written.
    poses: bool,
    /// Whether it has a place for a skew.
    skew: bool,
    /// Whether it has a place for k3 of Brown-Conrady.
    k3: bool,
    /// Whether it has the equidistant fisheye.
    fisheye: bool,
}

impl Writer {
    /// Whether it has the lens's model. Without its lens a camera would be another.
    fn has(&self, lens: &Lens) -> bool {
        match lens {
            Lens::None | Lens::Radtan(_) => true,
            Lens::Fisheye(_) => self.fisheye,
            _ => lens.is_none(),
        }
    }
}

/// Names of the files that [`render`] makes at most.
pub fn file_names(formats: &[Format]) -> Vec<&'static str> {
    let wanted = Format::ALL.into_iter().filter(|f| formats.is_empty() || formats.contains(f)).map(Format::writer);
    wanted.flat_map(|w| [w.file].into_iter().chain(w.more_files.iter().copied())).collect()
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
    rendered(&Source::of_calibration(calibration), formats)
}

/// A camera alone in the formats, without poses.
///
/// # Errors
/// As [`render`].
pub fn render_camera(camera: &Camera, formats: &[Format]) -> Result<Files, IoError> {
    rendered(&Source::of_camera(camera), formats)
}

fn rendered(source: &Source, formats: &[Format]) -> Result<Files, IoError> {
    let wanted = Format::ALL.into_iter().filter(|f| formats.is_empty() || formats.contains(f));
    let lens = &source.camera.lens;
    let (able, unable): (Vec<Format>, Vec<Format>) = wanted.partition(|f| f.writer().has(lens));
    let mut files = Vec::new();
    for format in &able {
        files.extend((format.writer().files)(source)?);
    }
    let mut notes = notes(source, &able);
    if !unable.is_empty() {
        let names: Vec<&str> = unable.iter().map(|f| f.writer().file).collect();
        notes.push(format!("not written: {}; the format has no lens of the model {}", names.join(", "), lens.name()));
    }
    Ok(Files { files, notes })
}

fn notes(source: &Source, chosen: &[Format]) -> Vec<String> {
    let mut notes = Vec::new();
    let (world, camera) = (&source.world, &source.camera);
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
    let files = |without: &dyn Fn(&Writer) -> bool| {
        let names: Vec<&str> = chosen.iter().map(|f| f.writer()).filter(|w| without(w)).map(|w| w.file).collect();
        (!names.is_empty()).then(|| names.join(", "))
    };
    let skew = camera.intrinsics.skew;
    if let Some(names) = files(&|w| !w.skew).filter(|_| skew != 0.0) {
        notes.push(format!("the skew of {skew:.3} px is left out of {names}: the format has no place for it"));
    }
    let k3 = if matches!(camera.lens, Lens::Radtan(_)) { source.lens_parameter("k3") } else { 0.0 };
    if let Some(names) = files(&|w| !w.k3).filter(|_| k3 != 0.0) {
        notes.push(format!("the coefficient k3 = {k3} is left out of {names}: the format has no place for it"));
    }
    if let Some(names) = files(&|w| w.skew).filter(|_| skew != 0.0 && matches!(camera.lens, Lens::Fisheye(_))) {
        notes.push(format!(
            "the skew of {skew:.3} px in {names} is passed over by cv2.fisheye, which takes it beside the matrix"
        ));
    }
    notes
}

/// Writes the files of the formats into a folder, which is made if need be; earlier ones of its own are replaced. Returns their paths, and
/// sentences about what the formats cannot say.
///
/// # Errors
/// As [`Outputs::begin`]: files that no run wrote are not replaced.
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
    let names: Vec<String> = rendered.files.iter().map(|f| f.name.to_string()).collect();
    let request =
        Request { folder, command: "write_formats", names: &names, inputs: &[], basis: None, overwrite: false };
    let outputs = Outputs::begin(&request)?;
    for file in &rendered.files {
        outputs.write(file.name, file.content.as_bytes())?;
    }
    let written = outputs.commit()?;
    Ok((names.iter().map(|n| folder.join(n)).collect(), [rendered.notes, written.notes].concat()))
}

#[cfg(test)]
mod tests {
    use groundcal::geometry::{Division, Fisheye, ImageSize, Intrinsics, Radtan};

    use super::*;
    use crate::import::parse;

    fn camera(lens: Lens) -> Camera {
        let intrinsics = Intrinsics { fx: 410.25, fy: 411.5, cx: 400.25, cy: 299.5, skew: 0.0 };
        Camera { size: ImageSize::new(800, 600), intrinsics, lens }
    }

    /// What is read back of each file of a camera.
    fn read_back(camera: &Camera) -> Vec<(&'static str, Camera)> {
        let rendered = render_camera(camera, &[]).unwrap();
        let files = rendered.files.iter().filter(|f| !["images.txt", "points3D.txt"].contains(&f.name));
        let read = files.filter(|f| f.name != "camera_matlab.csv").map(|f| {
            let read = parse(&f.content).unwrap_or_else(|e| panic!("{}: {e}", f.name)).swap_remove(0);
            assert!(read.notes.is_empty(), "{}: {:?}", f.name, read.notes);
            (f.name, Camera { size: read.size.unwrap(), intrinsics: read.intrinsics, lens: read.lens })
        });
        read.collect()
    }

    #[test]
    fn cameras_come_back_from_every_format_that_has_their_lens() {
        let fisheye = Lens::Fisheye(Fisheye::new([0.02, -0.01, 0.003, -5e-7]));
        let wide = Lens::Radtan(Radtan::new([-0.2, 0.03, 1e-3, -2e-3, 0.004]));
        for lens in [fisheye, wide, Lens::radial(-0.1, 0.02), Lens::radial(-0.1, 0.0)] {
            let all = read_back(&camera(lens));
            assert_eq!(all.len(), 5, "{lens:?}");
            for (name, read) in all {
                let expected = match (name, lens) {
                    // Kalibr has no k3.
                    ("camchain.yaml", Lens::Radtan(_)) if lens == wide => {
                        Lens::Radtan(Radtan::new([-0.2, 0.03, 1e-3, -2e-3, 0.0]))
                    }
                    _ => lens,
                };
                assert_eq!(read, camera(expected), "{name}");
            }
        }
    }

    #[test]
    fn what_a_format_cannot_hold_is_said() {
        let said = |camera: &Camera, words: &[&str]| {
            let rendered = render_camera(camera, &[]).unwrap();
            let notes = rendered.notes.join("\n");
            assert!(words.iter().all(|w| notes.contains(w)), "{notes}");
            rendered.files.len()
        };
        let plain = camera(Lens::radial(-0.1, 0.0));
        assert!(render_camera(&plain, &[]).unwrap().notes.is_empty());
        let skewed = Camera { intrinsics: Intrinsics { skew: 1.5, ..plain.intrinsics }, ..plain };
        let without_skew = ["skew of 1.500 px", "camchain.yaml, cameras.txt, transforms.json"];
        assert_eq!(said(&skewed, &without_skew), 8);
        let k3 = camera(Lens::Radtan(Radtan::new([-0.2, 0.03, 0.0, 0.0, 0.004])));
        assert_eq!(said(&k3, &["k3 = 0.004 is left out of camchain.yaml"]), 8);
        let fisheye = Camera { lens: Lens::Fisheye(Fisheye::default()), ..skewed };
        let words = [
            "not written: camera_matlab.csv",
            "fisheye",
            "passed over by cv2.fisheye",
            "camera_opencv.yaml, camera_info.yaml",
        ];
        assert_eq!(said(&fisheye, &words), 7);
        let division = camera(Lens::Division(Division::new(-0.2)));
        assert_eq!(said(&division, &["camera_opencv.yaml, camera_info.yaml, camchain.yaml", "division"]), 0);
    }
}
