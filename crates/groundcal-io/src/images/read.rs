//! The images of a run as grey values of one range.

use std::path::{Path, PathBuf};

use groundcal::{Error, Observer, Silent, vision::GrayImage};
use rayon::prelude::*;

use crate::{
    error::IoError,
    file,
    images::{
        array::{ArrayImage, Pixels},
        decode::ImageFiles,
        focal_length::{focal_length_px, stated_focal_length_mm},
        grey,
        range::{self, Kind, Ranges, Values},
        stored::StoredImage,
    },
    limits::MAX_IMAGE_BYTES,
    note::Note,
};

/// Images and what there is to say about them.
#[derive(Debug, Clone, PartialEq)]
pub struct Images {
    /// In the order of the files.
    pub images: Vec<GrayImage>,
    /// In the order of the files, what is about all of them last.
    pub notes: Vec<Note>,
    /// The focal length that all files state in their Exif, pixels; `None` where they state none, or not the same, or were cropped since.
    pub stated_focal_px: Option<f64>,
}

/// All images as grey values, in parallel, their values in one range; the first failure in the order of the list is the one reported.
///
/// # Errors
/// [`IoError::File`] for a file that is no image, or damaged beyond use, or too large.
pub fn read_images(files: &[PathBuf]) -> Result<Images, IoError> {
    read_images_until(files, &Silent)
}

/// The same, until the observer asks to stop: before the next file.
///
/// # Errors
/// As [`read_images`]; [`Error::Stopped`].
pub fn read_images_until(files: &[PathBuf], observer: &dyn Observer) -> Result<Images, IoError> {
    read_with(&ImageFiles::new(), files, observer)
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
/// assert_eq!((grey.size().width, grey.size().height, grey.get(0, 0)), (4, 3, 0.2));
/// assert!(notes.is_empty());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn read_image(path: &Path) -> Result<(GrayImage, Vec<Note>), IoError> {
    let Images { mut images, notes, .. } = read_images(&[path.to_path_buf()])?;
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
    let sound = image.sound.take();
    let mut grey = GrayImage::from_rows(size, grey::grey(image))
        .ok_or_else(|| IoError::file(path, "a pixel value is not a finite number"))?;
    if let Some(sound) = sound {
        grey = grey.masked(sound).map_err(|e| IoError::file(path, e.to_string()))?;
    }
    Ok(Loaded { grey, kind, values, notes })
}

pub(crate) fn read_with(reader: &ImageFiles, files: &[PathBuf], observer: &dyn Observer) -> Result<Images, IoError> {
    let one = |file: &PathBuf| {
        if observer.stopped() {
            return Err(IoError::Calibration(Error::Stopped));
        }
        let bytes = file::bytes(file, MAX_IMAGE_BYTES)?;
        let image = reader.read_bytes(file, &bytes)?;
        let stated_mm = stated_focal_length_mm(bytes, image.size);
        Ok((loaded(file, image)?, stated_mm))
    };
    let all: Vec<Result<(Loaded, Option<u32>), IoError>> = files.par_iter().map(one).collect();
    let (all, stated_mm): (Vec<_>, Vec<_>) = all.into_iter().collect::<Result<Vec<_>, _>>()?.into_iter().unzip();
    let images = in_one_range(all);
    let stated_focal_px = images.images.first().and_then(|image| focal_length_px(stated_mm, image.size()));
    Ok(Images { stated_focal_px, ..images })
}

fn in_one_range(mut all: Vec<Loaded>) -> Images {
    let mut notes: Vec<Note> = all.iter_mut().flat_map(|l| std::mem::take(&mut l.notes)).collect();
    let mut ranges = Ranges::default();
    for one in &all {
        ranges.add(one.kind, one.values.clone());
    }
    let ranges = ranges.found();
    all.par_iter_mut().for_each(|l| grey::in_range(l.grey.data_mut(), l.kind, &ranges));
    notes.extend(ranges.notes());
    Images { images: all.into_iter().map(|l| l.grey).collect(), notes, stated_focal_px: None }
}

/// Pictures in memory, collected one by one, as [`read_images`] would give them had they come from files.
///
/// ```
/// use groundcal::geometry::ImageSize;
/// use groundcal_io::images::{ArrayImage, Arrays, Pixels};
///
/// let blue = [255u8, 0, 0].repeat(12);
/// let array = ArrayImage {
///     name: "first",
///     size: ImageSize::new(4, 3),
///     channels: 3,
///     blue_first: true,
///     pixels: Pixels::U8(&blue),
/// };
/// let mut arrays = Arrays::default();
/// arrays.add(&array)?;
/// assert_eq!(arrays.finish().images[0].get(0, 0), 0.0722);
/// # Ok::<(), groundcal_io::error::IoError>(())
/// ```
#[derive(Default)]
pub struct Arrays(Vec<Loaded>);

impl Arrays {
    /// One more.
    ///
    /// # Errors
    /// [`IoError::Input`] where there are not 1 to 4 channels, the samples are not as many as the size says, or one is not finite.
    pub fn add(&mut self, array: &ArrayImage) -> Result<(), IoError> {
        let samples = match array.pixels {
            Pixels::U8(data) => data.len(),
            Pixels::U16(data) => data.len(),
            Pixels::F32(data) => data.len(),
        };
        let wrong = |what: String| Err(IoError::Input(format!("{}: {what}", array.name)));
        if !(1..=4).contains(&array.channels) {
            return wrong(format!("{} channels: 1 to 4 are read", array.channels));
        }
        if array.size.width.checked_mul(array.size.height).and_then(|n| n.checked_mul(array.channels)) != Some(samples)
        {
            return wrong(format!(
                "{samples} samples are not those of {} pixels of {} channels",
                array.size, array.channels
            ));
        }
        let kind = range::kind_of_pixels(array.pixels);
        let values = if kind.is_some() { Values::of_pixels(array.pixels, array.channels) } else { Values::default() };
        let grey = GrayImage::from_rows(array.size, grey::grey_of_array(array))
            .ok_or_else(|| IoError::Input(format!("{}: a pixel value is not a finite number", array.name)))?;
        self.0.push(Loaded { grey, kind, values, notes: Vec::new() });
        Ok(())
    }

    /// All of them, their values in one range.
    pub fn finish(self) -> Images {
        in_one_range(self.0)
    }
}
