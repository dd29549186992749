//! The images of a run as grey values of one range.

use std::path::{Path, PathBuf};

use groundcal::vision::image::GrayImage;
use rayon::prelude::*;

use crate::{
    error::IoError,
    images::{
        decode::ImageFiles,
        grey,
        range::{self, Kind, Ranges, Values},
        stored::StoredImage,
    },
    note::Note,
};

/// Images and what there is to say about them.
#[derive(Debug, Clone, PartialEq)]
pub struct Images {
    /// In the order of the files.
    pub images: Vec<GrayImage>,
    /// In the order of the files, what is about all of them last.
    pub notes: Vec<Note>,
}

/// All images as grey values, in parallel, their values in one range; the first failure in the order of the list is the one reported.
///
/// # Errors
/// [`IoError::File`] for a file that is no image, or damaged beyond use, or too large.
pub fn read_images(files: &[PathBuf]) -> Result<Images, IoError> {
    read_with(&ImageFiles::new(), files)
}

/// An image as it is stored, in its own depth, upright; notes are in it.
///
/// # Errors
/// As [`read_images`].
pub fn read_stored(path: &Path) -> Result<StoredImage, IoError> {
    ImageFiles::new().read(path)
}

/// One image as grey values, with notes about it. Of several images take [`read_images`]: one range then serves them all.
///
/// # Errors
/// As [`read_images`].
///
/// ```
/// # let folder = tempfile::tempdir()?;
/// # let path = folder.path().join("grey.png");
/// image::GrayImage::from_pixel(4, 3, image::Luma([51])).save(&path)?;
/// let (grey, notes) = groundcal_io::images::read_image(&path)?;
/// assert_eq!((grey.width(), grey.height(), grey.get(0, 0)), (4, 3, 0.2));
/// assert!(notes.is_empty());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn read_image(path: &Path) -> Result<(GrayImage, Vec<Note>), IoError> {
    let Images { mut images, notes } = read_images(&[path.to_path_buf()])?;
    let image = images.pop().ok_or_else(|| IoError::file(path, "no image"))?;
    Ok((image, notes))
}

/// The content of an image file as grey values of its type's range; `path` stands for it in messages.
///
/// # Errors
/// As [`read_images`].
pub fn read_image_bytes(path: &Path, bytes: &[u8]) -> Result<GrayImage, IoError> {
    Ok(loaded(path, ImageFiles::new().read_bytes(path, bytes)?)?.grey)
}

/// Grey values in their type's range, with what is needed to find a better one.
struct Loaded {
    grey: GrayImage,
    kind: Option<Kind>,
    values: Values,
    notes: Vec<Note>,
}

fn loaded(path: &Path, mut image: StoredImage) -> Result<Loaded, IoError> {
    let notes = std::mem::take(&mut image.notes);
    let (size, kind) = (image.size, range::kind(&image));
    let values = if kind.is_some() { Values::of(&image) } else { Values::default() };
    let grey = GrayImage::from_rows(size, grey::grey(image))
        .ok_or_else(|| IoError::file(path, "a pixel value is not a finite number"))?;
    Ok(Loaded { grey, kind, values, notes })
}

pub(crate) fn read_with(reader: &ImageFiles, files: &[PathBuf]) -> Result<Images, IoError> {
    let all: Vec<Result<Loaded, IoError>> =
        files.par_iter().map(|f| reader.read(f).and_then(|image| loaded(f, image))).collect();
    let mut all: Vec<Loaded> = all.into_iter().collect::<Result<_, _>>()?;
    let mut notes: Vec<Note> = all.iter_mut().flat_map(|l| std::mem::take(&mut l.notes)).collect();
    let mut ranges = Ranges::default();
    for one in &all {
        ranges.add(one.kind, one.values.clone());
    }
    let ranges = ranges.found();
    all.par_iter_mut().for_each(|l| grey::in_range(l.grey.data_mut(), l.kind, &ranges));
    notes.extend(ranges.notes());
    Ok(Images { images: all.into_iter().map(|l| l.grey).collect(), notes })
}
