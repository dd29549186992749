//! A camera of a file, or one of several by its name.

use std::{
    ffi::OsStr,
    path::{Path, PathBuf},
};

use crate::{
    error::IoError,
    file,
    import::{
        formats::{READ, parse},
        imported::ImportedCamera,
    },
    limits::MAX_CAMERA_BYTES,
    text::{plain, printable, shown, some_of},
};

/// Names of cameras that a message shows.
const LISTED: usize = 8;

/// `FILE#NAME` as its parts, where there is no file of the whole name.
fn parts(argument: &Path) -> (PathBuf, Option<String>) {
    let name = argument.as_os_str().to_str().filter(|_| !argument.exists());
    match name.and_then(|text| text.rsplit_once('#')) {
        Some((path, name)) => (path.into(), Some(name.to_string())),
        None => (argument.to_path_buf(), None),
    }
}

/// The file that [`read_camera`] reads; the folder itself where it has none.
pub fn camera_file(argument: impl AsRef<OsStr>) -> PathBuf {
    let (path, _) = parts(Path::new(argument.as_ref()));
    let inside = ["calibration.json", "truth.json"].map(|n| path.join(n)).into_iter().find(|p| p.is_file());
    inside.filter(|_| path.is_dir()).unwrap_or(path)
}

/// The camera of a file; `FILE#NAME` where the file has several. A folder stands for its calibration.json (or truth.json).
///
/// # Errors
/// [`IoError::File`] that says what was expected and what was found.
///
/// ```
/// # let folder = tempfile::tempdir()?;
/// # let path = folder.path().join("camera.yaml");
/// std::fs::write(&path, "camera_matrix: [[700, 0, 320], [0, 700, 240], [0, 0, 1]]\ndist_coeff: [-0.1, 0.02, 0, 0, 0]\n")?;
/// let camera = groundcal_io::import::read_camera(&path)?;
/// assert_eq!((camera.intrinsics.fx, camera.lens.parameters()[0], camera.size), (700.0, -0.1, None));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn read_camera(argument: impl AsRef<OsStr>) -> Result<ImportedCamera, IoError> {
    let (_, wanted) = parts(Path::new(argument.as_ref()));
    let path = camera_file(argument);
    if path.is_dir() {
        return Err(IoError::file(
            &path,
            "a folder without calibration.json and truth.json. Name the file of the camera",
        ));
    }
    let fail = |what: String| IoError::file(&path, what);
    let text = file::text(&path, MAX_CAMERA_BYTES, &format!("No calibration: expected text. {READ}"))?;
    let mut cameras = parse(&text).map_err(fail)?;
    // A name is compared as it is shown.
    for camera in &mut cameras {
        camera.label = printable(&camera.label).into_owned();
    }
    let labels = || cameras.iter().map(|c| c.label.as_str());
    let hint = || {
        let first = labels().next().unwrap_or_default();
        format!("it has {}. Write {}#{}", some_of(labels(), LISTED), shown(&path), plain(first))
    };
    let at = match wanted {
        Some(name) => labels().position(|l| l == name).ok_or_else(|| {
            fail(if cameras.len() == 1 && cameras[0].label.is_empty() {
                format!("it has one camera only: leave out #{}", plain(&name))
            } else {
                format!("no camera {}: {}", plain(&name), hint())
            })
        })?,
        None if cameras.len() > 1 => return Err(fail(format!("{} cameras, say which: {}", cameras.len(), hint()))),
        None => 0,
    };
    Ok(cameras.swap_remove(at))
}
