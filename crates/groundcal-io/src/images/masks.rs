//! Masks of images: a file for all of them, or a folder with one for each. White is used.

use std::{
    collections::HashMap,
    ffi::OsStr,
    path::{Path, PathBuf},
    sync::Arc,
};

use groundcal::vision::{GrayImage, Mask};
use rayon::prelude::*;

use crate::{
    error::IoError,
    images::{grey, read::read_stored},
    inputs::images_in,
    text::{name_text, shown, some_of},
};

/// Images that a message names.
const MAX_NAMED: usize = 5;

/// The masks of some images, found but not yet read.
///
/// ```
/// use std::path::Path;
/// use groundcal_io::images::{MaskFiles, read_images};
///
/// # let folder = tempfile::tempdir()?;
/// # let path = |name: &str| folder.path().join(name);
/// image::GrayImage::from_pixel(4, 3, image::Luma([90])).save(path("a.png"))?;
/// image::GrayImage::from_fn(4, 3, |x, _| image::Luma([if x < 2 { 255 } else { 0 }])).save(path("mask.png"))?;
/// let files = [path("a.png")];
/// let masks = MaskFiles::find(&path("mask.png"), &files)?;
/// let images = masks.put_on(read_images(&files)?.images, &files)?;
/// let mask = images[0].mask().expect("one for all images");
/// assert_eq!([0.0, 1.0, 2.0, 3.0].map(|x| mask.contains(x, 0.0)), [true, true, false, false]);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct MaskFiles {
    /// Different files.
    files: Vec<PathBuf>,
    /// For each image the index of its file.
    of_image: Vec<usize>,
}

impl MaskFiles {
    /// A file is the mask of all images. In a folder the mask of `a.jpg` is called `a` with any ending, or `a.jpg` with one more.
    ///
    /// # Errors
    /// [`IoError::Input`] where images have none or two, and names them; [`IoError::File`] where there is no such file or folder.
    pub fn find(given: &Path, images: &[PathBuf]) -> Result<Self, IoError> {
        if !given.is_dir() {
            crate::file::check_is_file(given)?;
            return Ok(Self { files: vec![given.to_path_buf()], of_image: vec![0; images.len()] });
        }
        let files = images_in(given)?;
        let mut by_stem: HashMap<&OsStr, Vec<usize>> = HashMap::new();
        for (i, file) in files.iter().enumerate() {
            if let Some(stem) = file.file_stem() {
                by_stem.entry(stem).or_default().push(i);
            }
        }
        let mut of_image = Vec::with_capacity(images.len());
        let (mut without, mut doubtful) = (Vec::new(), Vec::new());
        for image in images {
            let name = |name: Option<&OsStr>| name.map(name_text).unwrap_or_default();
            let called = |name: Option<&OsStr>| name.and_then(|n| by_stem.get(n)).map_or(&[][..], Vec::as_slice);
            // The longer name says more: x.jpg.png is of x.jpg, though there may be an x.png as well.
            let found = match called(image.file_name()) {
                [] => called(image.file_stem()),
                found => found,
            };
            match found {
                [one] => of_image.push(*one),
                [] => without.push(name(image.file_name())),
                _ => doubtful.push(name(image.file_name())),
            }
        }
        let refused = |what: &str, names: &[String], help: &str| {
            let some = some_of(names.iter().map(String::as_str), MAX_NAMED);
            let (folder, count, all) = (shown(given), names.len(), images.len());
            Err(IoError::Input(format!(
                "the folder of masks {folder} has {what} for {count} of {all} images: {some}. {help}"
            )))
        };
        if !without.is_empty() {
            return refused(
                "none",
                &without,
                "The mask of a.jpg is called a.png, whatever its ending; one file is the mask of all images",
            );
        }
        if !doubtful.is_empty() {
            return refused("two or more", &doubtful, "Leave one of them");
        }
        Ok(Self { files, of_image })
    }

    /// The files, those of no image included.
    pub fn files(&self) -> &[PathBuf] {
        &self.files
    }

    /// Reads them and puts them on their images, which `files` names in the same order.
    ///
    /// # Errors
    /// [`IoError::File`] where one is no image, has another size than its image, or has no white.
    pub fn put_on(&self, images: Vec<GrayImage>, files: &[PathBuf]) -> Result<Vec<GrayImage>, IoError> {
        let mut needed = self.of_image.clone();
        needed.sort_unstable();
        needed.dedup();
        let read = |i: usize| read_mask(&self.files[i]).map(|mask| (i, Arc::new(mask)));
        let read: Vec<Result<_, IoError>> = needed.into_par_iter().map(read).collect();
        let masks: HashMap<usize, Arc<Mask>> = read.into_iter().collect::<Result<_, _>>()?;
        let put_on = |(image, (file, of)): (GrayImage, (&PathBuf, &usize))| {
            let (mask, path) = (&masks[of], &self.files[*of]);
            if mask.size() != image.size() {
                let what = format!(
                    "a mask of {} pixels, its image {} has {}: a mask has the size of its image",
                    mask.size(),
                    shown(file),
                    image.size()
                );
                return Err(IoError::file(path, what));
            }
            image.masked(Arc::clone(mask)).map_err(|e| IoError::file(path, e.to_string()))
        };
        images.into_iter().zip(files.iter().zip(&self.of_image)).map(put_on).collect()
    }
}

/// White is the upper half of the values, up to the largest there is: masks of 0 and 1 are as usual as those of 0 and 255.
fn read_mask(path: &Path) -> Result<Mask, IoError> {
    let stored = read_stored(path)?;
    let size = stored.size;
    let values = grey::grey(stored);
    let white = values.iter().copied().fold(0.0f32, f32::max);
    if white.is_nan() || white <= 0.0 || !white.is_finite() {
        return Err(IoError::file(path, "a mask without white: nothing of its images would be used"));
    }
    let used: Vec<bool> = values.iter().map(|&v| v > 0.5 * white).collect();
    Mask::new(size, &used).ok_or_else(|| IoError::file(path, "not a mask"))
}
