//! From a folder of photographs to a calibration, in one call.

use std::path::Path;

use groundcal::{Calibration, Observer, Options, calibrate_images};

use crate::{error::IoError, images::read_images_until, inputs::find_images, names::image_names, note::Note};

/// Calibrates from the photographs of a folder (files in natural order of their names; folders in it are left out), and notes what was found
/// of the files. The focal length that the files state is compared with the one found, unless the options state one.
///
/// # Errors
/// [`IoError::Usage`] without images; [`IoError::File`] for a file that is no image; [`IoError::Calibration`] where there is no calibration.
///
/// # Examples
/// ```
/// use groundcal::{Error, Options, Silent};
/// use groundcal_io::{calibrate_folder, error::IoError};
///
/// let folder = tempfile::tempdir()?;
/// let refused = calibrate_folder(folder.path(), &Options::default(), &Silent);
/// assert!(refused.is_err(), "nothing is in it");
/// # Ok::<(), std::io::Error>(())
/// ```
pub fn calibrate_folder(
    folder: &Path,
    options: &Options,
    observer: &dyn Observer,
) -> Result<(Calibration, Vec<Note>), IoError> {
    let files = find_images(&[folder])?;
    let read = read_images_until(&files, observer)?;
    let stated_focal_px = options.stated_focal_px.or(read.stated_focal_px);
    let options = Options { stated_focal_px, ..options.clone() };
    let calibration = calibrate_images(&image_names(&files), &read.images, &options, observer)?;
    Ok((calibration, read.notes))
}

#[cfg(test)]
mod tests {
    use groundcal::{Error, Silent};

    use super::*;

    #[test]
    fn a_folder_of_pictures_without_texture_is_refused_by_the_library_and_an_empty_one_before() {
        let folder = tempfile::tempdir().unwrap();
        let of = || calibrate_folder(folder.path(), &Options::default(), &Silent);
        assert!(matches!(of(), Err(IoError::Usage(_) | IoError::Input(_) | IoError::File { .. })));
        for name in ["a.png", "b.png", "c.png"] {
            image::GrayImage::from_pixel(320, 240, image::Luma([90])).save(folder.path().join(name)).unwrap();
        }
        match of() {
            Err(IoError::Calibration(e)) => assert!(!matches!(e, Error::InvalidInput(_)), "{e}"),
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn the_pictures_of_the_example_give_the_camera_of_their_truth() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/head");
        let (c, notes) = calibrate_folder(&folder, &Options::default(), &Silent).unwrap();
        let truth = crate::import::read_camera(folder.join("truth.json")).unwrap();
        assert!((c.camera.fx / truth.intrinsics.fx - 1.0).abs() < 0.01, "{}", c.camera.fx);
        assert!(notes.is_empty() && !c.views.is_empty());
    }
}
