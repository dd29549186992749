//! `calibrate`, from each kind of source.

use std::{path::PathBuf, sync::Arc};

use groundcal::{
    Error, calibrate_homographies, calibrate_images, calibrate_matches,
    geometry::{Frame, ImageSize},
    pairs::{HomographyEstimate, ImagePair, PointMatch},
    result::{Calibration, Warning},
    vision::{GrayImage, Mask},
};
use groundcal_io::{
    images::{Arrays, MaskFiles, read_images_until},
    inputs::{Inputs, find_inputs},
    matches::{PairChoice, PointPairs, TracksOfImage, pairs_of_tracks, read_matches, read_pairs},
    names::image_names,
    note::Note,
    text::shown,
};
use nalgebra::{Matrix3, SMatrix};
use numpy::{PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::{
    exceptions::PyTypeError,
    prelude::*,
    types::{PyDict, PyString},
};

use crate::{arrays, failure::Failure, handle::Handle, nearest::no_such, options::Asked, work};

/// What `calibrate` gives: the calibration, and what there is to say about its input.
type Made = (Handle, Vec<String>);

/// `pairs=`: a CSV, or pairs of names or indices.
enum NamedPairs {
    File(PathBuf),
    List(Vec<[ImageKey; 2]>),
}

#[derive(Debug, Clone, FromPyObject)]
enum ImageKey {
    Index(usize),
    Name(String),
}

impl NamedPairs {
    fn of(given: &Bound<'_, PyDict>) -> PyResult<Option<Self>> {
        let Some(value) = given.get_item("pairs")?.filter(|v| !v.is_none()) else { return Ok(None) };
        if value.is_instance_of::<PyString>() || value.hasattr("__fspath__")? {
            return Ok(Some(Self::File(value.extract()?)));
        }
        let wrong = || {
            PyTypeError::new_err(
                "pairs= must be a list of pairs of image names or indices, for example [(\"1.jpg\", \"2.jpg\")], or the path of a CSV",
            )
        };
        let mut list = Vec::new();
        for pair in value.try_iter().map_err(|_| wrong())? {
            let (from, to) = pair?.extract::<(ImageKey, ImageKey)>().map_err(|_| wrong())?;
            list.push([from, to]);
        }
        Ok(Some(Self::List(list)))
    }

    /// Indices of the names.
    fn indices(&self, names: &[String]) -> Result<Vec<(usize, usize)>, Failure> {
        let known: Vec<&str> = names.iter().map(String::as_str).collect();
        let place = |key: &ImageKey| match key {
            ImageKey::Index(i) if *i < names.len() => Ok(*i),
            ImageKey::Index(i) => Err(Failure::option(format!("pairs=: there is no image {i} of {}", names.len()))),
            ImageKey::Name(name) => {
                let found = known.iter().position(|n| n == name);
                found.ok_or_else(|| Failure::option(format!("pairs=: {}", no_such(name, &known))))
            }
        };
        match self {
            Self::File(path) => Ok(read_pairs(path, names)?),
            Self::List(list) => list.iter().map(|[a, b]| Ok((place(a)?, place(b)?))).collect(),
        }
    }
}

/// `mask=`: a file or a folder, or arrays: one for all images, or one for each.
enum GivenMask {
    Path(PathBuf),
    Arrays(Vec<Arc<Mask>>),
}

impl GivenMask {
    fn of(given: &Bound<'_, PyDict>) -> PyResult<Option<Self>> {
        let Some(value) = given.get_item("mask")?.filter(|v| !v.is_none()) else { return Ok(None) };
        if value.is_instance_of::<PyString>() || value.hasattr("__fspath__")? {
            return Ok(Some(Self::Path(value.extract()?)));
        }
        let mut masks = Vec::new();
        for array in value.try_iter()? {
            let array: PyReadonlyArray2<bool> = array?.extract()?;
            let size = ImageSize::new(array.shape()[1], array.shape()[0]);
            let used: Vec<bool> = array.as_array().iter().copied().collect();
            if !used.contains(&true) {
                return Err(Failure::option("mask=: nothing of it is used").raise(given.py()));
            }
            let mask = Mask::new(size, &used).ok_or_else(|| Failure::option("mask=: too large").raise(given.py()))?;
            masks.push(Arc::new(mask));
        }
        Ok(Some(Self::Arrays(masks)))
    }

    /// Before anything is read.
    fn files(&self, images: &[PathBuf]) -> Result<Option<MaskFiles>, Failure> {
        match self {
            Self::Path(path) => Ok(Some(MaskFiles::find(path, images)?)),
            Self::Arrays(masks) if masks.len() != 1 && masks.len() != images.len() => {
                Err(Failure::option(format!("mask=: {} masks for {} images", masks.len(), images.len())))
            }
            Self::Arrays(_) => Ok(None),
        }
    }

    fn put_on(
        &self,
        found: Option<&MaskFiles>,
        images: Vec<GrayImage>,
        files: &[PathBuf],
    ) -> Result<Vec<GrayImage>, Failure> {
        match (self, found) {
            (_, Some(found)) => Ok(found.put_on(images, files)?),
            (Self::Arrays(masks), None) => {
                let of = |(i, image): (usize, GrayImage)| {
                    let mask = masks.get(i).or(masks.first()).map(Arc::clone);
                    let masked = mask.map_or_else(|| Ok(image.clone()), |mask| image.clone().masked(mask));
                    masked.map_err(|e| Failure::option(format!("mask=: {e}")))
                };
                images.into_iter().enumerate().map(of).collect()
            }
            (Self::Path(_), None) => Ok(images),
        }
    }

    /// Where there are no images.
    fn refuse(given: &Bound<'_, PyDict>) -> PyResult<()> {
        match Self::of(given)? {
            None => Ok(()),
            Some(_) => Err(Failure::option("mask= goes with images").raise(given.py())),
        }
    }
}

/// From images, with their masks, and without what stands still in all of them.
fn of_images(
    asked: &Asked,
    names: &[String],
    images: Vec<GrayImage>,
    masks: Option<(&GivenMask, Option<&MaskFiles>)>,
    files: Vec<PathBuf>,
    watch: &work::Watch,
) -> Result<Handle, Failure> {
    let named: Vec<PathBuf> = if files.is_empty() { names.iter().map(PathBuf::from).collect() } else { files.clone() };
    let images = match masks {
        Some((masks, found)) => masks.put_on(found, images, &named)?,
        None => images,
    };
    let calibration = calibrate_images(names, &images, &asked.options, watch)?;
    finished(asked, calibration, images, files)
}

/// The calibration with its lengths in metres, if asked.
fn finished(
    asked: &Asked,
    calibration: Calibration,
    images: Vec<GrayImage>,
    inputs: Vec<PathBuf>,
) -> Result<Handle, Failure> {
    let calibration = match asked.camera_height_m {
        Some(height_m) => calibration.with_camera_height(height_m)?,
        None => calibration,
    };
    Ok(Handle::new(calibration, images, inputs))
}

/// From files: folders, images, glob patterns, or one CSV.
#[pyfunction]
#[pyo3(signature = (paths, options, progress))]
pub(crate) fn calibrate_files<'py>(
    py: Python<'py>,
    paths: Vec<PathBuf>,
    options: &Bound<'py, PyDict>,
    progress: Option<&Bound<'py, PyAny>>,
) -> PyResult<Made> {
    let mut asked = Asked::of(options)?;
    let pairs = NamedPairs::of(options)?;
    let mask = GivenMask::of(options)?;
    work::run(py, asked.threads, progress, move |watch| match find_inputs(&paths)? {
        Inputs::Csv(_) if mask.is_some() => Err(Failure::option("mask= goes with images")),
        Inputs::Csv(path) => of_csv(asked, pairs, path, watch),
        Inputs::Images(files) => {
            if asked.image_size.is_some() {
                return Err(Failure::option(
                    "image_size= goes with matches, tracks and homographies; images have their own",
                ));
            }
            let names = image_names(&files);
            if let Some(pairs) = &pairs {
                asked.options.pairs = Some(pairs.indices(&names)?);
            }
            let found = mask.as_ref().map(|mask| mask.files(&files)).transpose()?.flatten();
            let read = read_images_until(&files, watch)?;
            let mut notes: Vec<String> = read.notes.iter().map(ToString::to_string).collect();
            asked.options.stated_focal_px = read.stated_focal_px;
            if let Some(image) = read.images.first() {
                notes.extend(asked.take_lens(image.size())?);
            }
            watch.note(&notes);
            let masks = mask.as_ref().map(|mask| (mask, found.as_ref()));
            Ok((of_images(&asked, &names, read.images, masks, files, watch)?, notes))
        }
    })
}

fn size_needed(asked: &Asked, of: &str) -> Result<ImageSize, Failure> {
    asked
        .image_size
        .ok_or_else(|| Failure::option(format!("{of}: give the size of the images with image_size=(width, height)")))
}

/// What there is to say about matches; the size of the images has its name here.
fn said(notes: &[Note]) -> Vec<String> {
    notes.iter().map(|n| n.to_string().replace("--image-size", "image_size=")).collect()
}

fn of_csv(asked: Asked, pairs: Option<NamedPairs>, path: PathBuf, watch: &work::Watch) -> Result<Made, Failure> {
    let size = size_needed(&asked, &shown(&path))?;
    let list = match &pairs {
        Some(NamedPairs::File(list)) => Some(list.clone()),
        _ => None,
    };
    let choice = match &list {
        Some(list) => PairChoice::Listed { list, all_pairs_limit: asked.options.all_pairs_limit },
        None => PairChoice::Near { all_pairs_limit: asked.options.all_pairs_limit },
    };
    let mut found = read_matches(&path, size, choice)?;
    if let (None, Some(pairs)) = (&list, &pairs) {
        found.listed = Some(pairs.indices(&found.names)?);
    }
    let name = shown(&path);
    of_matches(asked, found, size, vec![path], Some(&name), watch)
}

fn of_matches(
    mut asked: Asked,
    found: PointPairs,
    size: ImageSize,
    inputs: Vec<PathBuf>,
    name: Option<&str>,
    watch: &work::Watch,
) -> Result<Made, Failure> {
    let mut notes = said(&found.notes);
    notes.extend(asked.take_lens(size)?);
    watch.note(&notes);
    asked.options.pairs.clone_from(&found.listed);
    let made = calibrate_matches(&found.names, size, &found.pairs, &asked.options, watch);
    let mut calibration = made.map_err(|error| match (error, name) {
        // Options are the other input.
        (error @ Error::InvalidOption(_), _) | (error, None) => error.into(),
        (error, Some(name)) => Failure::of_input(name, error),
    })?;
    if found.neighbours_only {
        calibration.warnings.push(Warning::NeighboursOnly { images: found.names.len() });
    }
    Ok((finished(&asked, calibration, Vec::new(), inputs)?, notes))
}

/// From arrays, each of them C-contiguous and of a dtype and shape that was looked at.
#[pyfunction]
#[pyo3(signature = (names, images, bgr, options, progress))]
pub(crate) fn calibrate_arrays<'py>(
    py: Python<'py>,
    names: Vec<String>,
    images: Vec<Bound<'py, PyAny>>,
    bgr: bool,
    options: &Bound<'py, PyDict>,
    progress: Option<&Bound<'py, PyAny>>,
) -> PyResult<Made> {
    let mut asked = Asked::of(options)?;
    if asked.image_size.is_some() {
        let text = "image_size= goes with matches, tracks and homographies; images have their own";
        return Err(Failure::option(text).raise(py));
    }
    if let Some(pairs) = NamedPairs::of(options)? {
        asked.options.pairs = Some(pairs.indices(&names).map_err(|e| e.raise(py))?);
    }
    let mask = GivenMask::of(options)?;
    let mut all = Arrays::default();
    for (name, image) in names.iter().zip(&images) {
        arrays::with_pixels(image, name, bgr, |pixels| all.add(&pixels).map_err(|e| Failure::from(e).raise(py)))?;
        py.check_signals()?;
    }
    work::run(py, asked.threads, progress, move |watch| {
        let all = all.finish();
        let mut notes: Vec<String> = all.notes.iter().map(ToString::to_string).collect();
        if let Some(image) = all.images.first() {
            notes.extend(asked.take_lens(image.size())?);
        }
        watch.note(&notes);
        let named: Vec<PathBuf> = names.iter().map(PathBuf::from).collect();
        let found = mask.as_ref().map(|mask| mask.files(&named)).transpose()?.flatten();
        let masks = mask.as_ref().map(|mask| (mask, found.as_ref()));
        Ok((of_images(&asked, &names, all.images, masks, Vec::new(), watch)?, notes))
    })
}

/// Matches of a pair: indices of its images, places in both, deviations.
type GivenMatches<'py> = (usize, usize, PyReadonlyArray2<'py, f64>, PyReadonlyArray2<'py, f64>, Option<Vec<f64>>);

/// From matches.
#[pyfunction]
#[pyo3(signature = (names, pairs, options, progress))]
pub(crate) fn calibrate_pairs<'py>(
    py: Python<'py>,
    names: Vec<String>,
    pairs: Vec<GivenMatches<'py>>,
    options: &Bound<'py, PyDict>,
    progress: Option<&Bound<'py, PyAny>>,
) -> PyResult<Made> {
    let asked = Asked::of(options)?;
    GivenMask::refuse(options)?;
    let listed = NamedPairs::of(options)?;
    let mut all = Vec::new();
    for (from, to, a, b, sigma_px) in &pairs {
        let (a, b) = (a.as_array(), b.as_array());
        let of = |(i, (a, b)): (usize, (numpy::ndarray::ArrayView1<f64>, numpy::ndarray::ArrayView1<f64>))| {
            let sigma_px = sigma_px.as_ref().and_then(|s| s.get(i)).copied().unwrap_or(1.0);
            PointMatch { sigma_px, ..PointMatch::new([a[0], a[1]], [b[0], b[1]]) }
        };
        let matches = a.outer_iter().zip(b.outer_iter()).enumerate().map(of).collect();
        all.push(ImagePair { from: *from, to: *to, matches });
    }
    work::run(py, asked.threads, progress, move |watch| {
        let size = size_needed(&asked, "matches")?;
        let listed = listed.map(|l| l.indices(&names)).transpose()?;
        let found = PointPairs { names, pairs: all, neighbours_only: false, listed, notes: Vec::new() };
        of_matches(asked, found, size, Vec::new(), None, watch)
    })
}

/// Tracks of an image: its name, names of the tracks, places.
type GivenTracks<'py> = (String, Vec<String>, PyReadonlyArray2<'py, f64>);

/// From tracks.
#[pyfunction]
#[pyo3(signature = (images, options, progress))]
pub(crate) fn calibrate_tracks<'py>(
    py: Python<'py>,
    images: Vec<GivenTracks<'py>>,
    options: &Bound<'py, PyDict>,
    progress: Option<&Bound<'py, PyAny>>,
) -> PyResult<Made> {
    let asked = Asked::of(options)?;
    GivenMask::refuse(options)?;
    let listed = NamedPairs::of(options)?;
    let of = |(image, tracks, points): GivenTracks<'py>| {
        let points = points.as_array().outer_iter().map(|p| [p[0], p[1]]).collect();
        TracksOfImage { image, tracks, points }
    };
    let images: Vec<TracksOfImage> = images.into_iter().map(of).collect();
    work::run(py, asked.threads, progress, move |watch| {
        let size = size_needed(&asked, "tracks")?;
        // A list of pairs may name any.
        let limit = if listed.is_some() { images.len() } else { asked.options.all_pairs_limit };
        let mut found = pairs_of_tracks(&images, limit).map_err(Failure::input)?;
        found.listed = listed.map(|l| l.indices(&found.names)).transpose()?;
        of_matches(asked, found, size, Vec::new(), None, watch)
    })
}

/// A homography: indices of its images, the matrix, its covariance, matches.
type GivenHomography<'py> = (usize, usize, PyReadonlyArray2<'py, f64>, Option<PyReadonlyArray2<'py, f64>>, usize);

/// From homographies. A covariance is that of the nine entries, row by row, of the matrix as it is given, in pixels.
#[pyfunction]
#[pyo3(signature = (names, homographies, options, progress))]
pub(crate) fn calibrate_planes<'py>(
    py: Python<'py>,
    names: Vec<String>,
    homographies: Vec<GivenHomography<'py>>,
    options: &Bound<'py, PyDict>,
    progress: Option<&Bound<'py, PyAny>>,
) -> PyResult<Made> {
    let mut asked = Asked::of(options)?;
    GivenMask::refuse(options)?;
    if NamedPairs::of(options)?.is_some() {
        return Err(Failure::option("pairs= has no meaning for homographies: all of them are motions").raise(py));
    }
    let made = || -> Result<_, Failure> {
        let size = size_needed(&asked, "homographies")?;
        let frame = Frame::new(size, asked.options.principal_point_px);
        let mut all = Vec::new();
        for (from, to, h, covariance, matches) in &homographies {
            let h = h.as_array();
            let matrix = Matrix3::from_fn(|r, c| h[[r, c]]);
            let between = format!("the homography from {} to {}", names[*from], names[*to]);
            let covariance = covariance.as_ref().map(|given| {
                let given = given.as_array();
                SMatrix::from_fn(|r, c| given[[r, c]])
            });
            let estimate = HomographyEstimate::from_pixels(&matrix, covariance.as_ref(), frame, *matches)
                .map_err(|e| Failure::of_input(&between, e))?;
            all.push((*from, *to, estimate));
        }
        Ok((size, all))
    };
    let (size, all) = made().map_err(|e| e.raise(py))?;
    work::run(py, asked.threads, progress, move |_| {
        let notes = asked.take_lens(size)?;
        let calibration = calibrate_homographies(&names, size, &all, &asked.options)?;
        Ok((finished(&asked, calibration, Vec::new(), Vec::new())?, notes))
    })
}
