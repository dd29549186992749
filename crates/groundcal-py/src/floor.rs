//! `undistort` and `rectify`: pictures without their lens, and the floor from above.

use std::path::PathBuf;

use groundcal::{
    floor::{
        DEFAULT_EXTENT_HEIGHTS, Fit, FloorGrid, FloorLayout, FloorView, Mosaic, Placed, ResolutionError, Undistortion,
        Up, placed, rectify, sets_of_one_world,
    },
    geometry::ImageSize,
    result::{Calibration, Camera},
    vision::{Depth, Pyramid, Raster, Resampled, resample},
};
use groundcal_io::{
    inputs::find_images,
    pictures::{self, Picture, PictureReader},
    view_files::{look_beside, match_files},
};
use numpy::{IntoPyArray, PyArrayMethods};
use pyo3::{
    prelude::*,
    types::{PyDict, PyList},
};

use crate::{
    arrays::{self, Made, PerDepth},
    failure::Failure,
    handle::Handle,
    options::{named, taken},
    work::{self, Watch},
};

/// How a picture is undistorted.
fn undistortion(camera: &Camera, fit: &str, fov_deg: Option<f64>) -> Result<Undistortion, Failure> {
    let fit = match (fov_deg, fit) {
        (Some(degrees), _) if (1.0..=175.0).contains(&degrees) => {
            Fit::FieldOfView { horizontal_rad: degrees.to_radians() }
        }
        (Some(degrees), _) => return Err(Failure::option(format!("fov_deg={degrees}: give 1 to 175 degrees"))),
        (None, "same") => Fit::Same,
        (None, "all") => Fit::All,
        (None, "crop") => Fit::Crop,
        (None, other) => {
            let text = format!("fit={other:?}: {}", crate::nearest::no_such(other, &["same", "all", "crop"]));
            return Err(Failure::option(text));
        }
    };
    Undistortion::new(&camera.model(), fit).map_err(|e| Failure::of_input("calibration", e))
}

/// A camera matrix and two maps.
type Maps<'py> = ([[f64; 3]; 3], Bound<'py, PyAny>, Bound<'py, PyAny>);

/// The camera matrix of undistorted pictures, and the two maps (H, W) from their pixels to those of the originals.
#[pyfunction]
#[pyo3(signature = (calibration, fit, fov_deg))]
pub(crate) fn undistort_maps<'py>(
    py: Python<'py>,
    calibration: &Handle,
    fit: &str,
    fov_deg: Option<f64>,
) -> PyResult<Maps<'py>> {
    let calibration = calibration.shared();
    let fit = fit.to_string();
    let size = calibration.camera.model().size;
    let (matrix, [x, y]) = work::run(py, None, None, move |_| {
        let undistortion = undistortion(&calibration.camera, &fit, fov_deg)?;
        Ok((matrix(&undistortion), undistortion.maps()))
    })?;
    let array = |map: Vec<f32>| map.into_pyarray(py).reshape([size.height, size.width]);
    Ok((matrix, array(x)?.into_any(), array(y)?.into_any()))
}

fn matrix(undistortion: &Undistortion) -> [[f64; 3]; 3] {
    let k = undistortion.intrinsics();
    [[k.fx, k.skew, k.cx], [0.0, k.fy, k.cy], [0.0, 0.0, 1.0]]
}

/// The work of [`undistort`] on a picture.
struct Straighten(Undistortion);

impl PerDepth for Straighten {
    fn on<T: Depth>(&self, picture: Raster<T>) -> Resampled<T> {
        let size = picture.size();
        resample(&Pyramid::new(picture), size, |p| self.0.source_pixel(p))
    }
}

/// A picture, its mask (0 to 255) and its camera matrix.
type Straight<'py> = (Bound<'py, PyAny>, Bound<'py, PyAny>, [[f64; 3]; 3]);

/// A picture: an array or a file.
enum Source {
    Array(Picture),
    File(PathBuf),
}

impl Source {
    fn of(image: &Bound<'_, PyAny>) -> PyResult<Self> {
        match image.extract::<PathBuf>() {
            Ok(path) => Ok(Source::File(path)),
            Err(_) => arrays::picture(image).map(Source::Array),
        }
    }

    fn read(self, size: ImageSize) -> Result<Picture, Failure> {
        match self {
            Source::Array(picture) => Ok(picture),
            Source::File(path) => Ok(PictureReader::new(&[path], size, None, false)?.0.read(0)?),
        }
    }
}

/// A picture as a lens without distortion would have taken it.
#[pyfunction]
#[pyo3(signature = (calibration, image, fit, fov_deg))]
pub(crate) fn undistort<'py>(
    py: Python<'py>,
    calibration: &Handle,
    image: &Bound<'py, PyAny>,
    fit: &str,
    fov_deg: Option<f64>,
) -> PyResult<Straight<'py>> {
    let source = Source::of(image)?;
    let (calibration, fit) = (calibration.shared(), fit.to_string());
    let (made, matrix) = work::run(py, None, None, move |_| {
        let undistortion = undistortion(&calibration.camera, &fit, fov_deg)?;
        let matrix = matrix(&undistortion);
        let picture = source.read(calibration.camera.model().size)?;
        Ok((arrays::per_depth(picture, &Straighten(undistortion)), matrix))
    })?;
    let (picture, mask) = made.arrays(py)?;
    Ok((picture, mask, matrix))
}

/// What is asked of pictures of the floor.
struct FloorAsked {
    mosaic: bool,
    resolution: Option<f64>,
    extent: Option<f64>,
    camera_height_m: Option<f64>,
    up: Option<Up>,
    threads: Option<usize>,
}

impl FloorAsked {
    fn of(given: &Bound<'_, PyDict>) -> PyResult<Self> {
        let positive = |name: &str| -> PyResult<Option<f64>> {
            let value = taken::<f64>(given, name)?;
            match value.filter(|v| !(v.is_finite() && (1e-6..=1e9).contains(v))) {
                Some(v) => Err(Failure::option(format!("{name}={v}: it must be positive")).raise(given.py())),
                None => Ok(value),
            }
        };
        Ok(Self {
            mosaic: taken(given, "mosaic")?.unwrap_or(false),
            resolution: positive("resolution")?,
            extent: positive("extent")?,
            camera_height_m: positive("camera_height_m")?,
            up: named(given, "up", &[("heading", Up::Heading), ("y", Up::Y)])?,
            threads: taken(given, "threads")?,
        })
    }
}

/// Pictures of views: of all that have one.
enum Shots {
    /// Arrays by the names of their views.
    Arrays(Vec<(String, Picture)>),
    /// Files; none: looked for in the current folder.
    Files(Vec<PathBuf>),
}

/// The floor as one view shows it, or several.
struct FloorPicture {
    made: Made,
    grid: FloorGrid,
    views: Vec<String>,
    metres: bool,
}

impl FloorPicture {
    fn into_dict<'py>(self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let dict = PyDict::new(py);
        let (image, mask) = self.made.arrays(py)?;
        let h = self.grid.floor_from_pixel_matrix();
        let rows: [[f64; 3]; 3] = std::array::from_fn(|i| std::array::from_fn(|j| h[(i, j)]));
        dict.set_item("image", image)?;
        dict.set_item("mask", mask)?;
        dict.set_item("floor_from_pixel", rows)?;
        dict.set_item("unit_per_px", self.grid.unit_per_px)?;
        dict.set_item("unit", if self.metres { "m" } else { "camera height" })?;
        dict.set_item("views", self.views)?;
        Ok(dict)
    }
}

/// The floor from above; `shots` are paths, or pairs of a view's name and its array.
#[pyfunction]
#[pyo3(signature = (calibration, paths, arrays, options, progress))]
pub(crate) fn rectify_floor<'py>(
    py: Python<'py>,
    calibration: &Handle,
    paths: Vec<PathBuf>,
    arrays: Option<Vec<(String, Bound<'py, PyAny>)>>,
    options: &Bound<'py, PyDict>,
    progress: Option<&Bound<'py, PyAny>>,
) -> PyResult<(Bound<'py, PyList>, Vec<String>)> {
    let asked = FloorAsked::of(options)?;
    let shots = match arrays {
        None => Shots::Files(paths),
        Some(list) => {
            let of = |(name, array): (String, Bound<'py, PyAny>)| Ok((name, arrays::picture(&array)?));
            Shots::Arrays(list.into_iter().map(of).collect::<PyResult<_>>()?)
        }
    };
    let calibration = calibration.shared();
    let (made, notes) =
        work::run(py, asked.threads, progress, move |watch| floor_pictures(&calibration, shots, &asked, watch))?;
    let made = made.into_iter().map(|p| p.into_dict(py)).collect::<PyResult<Vec<_>>>()?;
    Ok((PyList::new(py, made)?, notes))
}

/// Views over the floor with their pictures, read when they are wanted.
struct Found {
    views: Vec<Placed>,
    pictures: Pictures,
}

enum Pictures {
    Arrays(Vec<Picture>),
    Files(PictureReader),
}

impl Pictures {
    fn read(&self, index: usize) -> Result<Picture, Failure> {
        match self {
            Pictures::Files(reader) => Ok(reader.read(index)?),
            Pictures::Arrays(all) => {
                all.get(index).cloned().ok_or_else(|| Failure::Fault(format!("there is no picture {index}")))
            }
        }
    }

    fn has_colour(&self) -> bool {
        let colour = |p: &Picture| match p {
            Picture::U8(p) => p.channels() > 2,
            Picture::U16(p) => p.channels() > 2,
            Picture::F32(p) => p.channels() > 2,
        };
        match self {
            Pictures::Files(reader) => reader.has_colour(),
            Pictures::Arrays(all) => all.iter().any(colour),
        }
    }
}

fn floor_pictures(
    calibration: &Calibration,
    shots: Shots,
    asked: &FloorAsked,
    watch: &Watch,
) -> Result<(Vec<FloorPicture>, Vec<String>), Failure> {
    let height_m = asked.camera_height_m.or(calibration.camera_height_m);
    let scale = asked.camera_height_m.map_or(1.0, |h| h / calibration.camera_height_m.unwrap_or(1.0));
    let all = placed(calibration, scale)?;
    if asked.mosaic && all.iter().all(|p| p.origin.is_none()) {
        return Err(Failure::input(
            "the views have attitudes but no positions, so there is no common floor to lay them on. Calibrate with method=\"joint\", or \
             leave mosaic=True out to rectify each view by itself",
        ));
    }
    let mut notes = Vec::new();
    let size = calibration.camera.model().size;
    let found = found(all, shots, size, asked.mosaic, &mut notes)?;
    let layout = FloorLayout {
        size,
        max_distance: asked.extent.unwrap_or(DEFAULT_EXTENT_HEIGHTS * height_m.unwrap_or(1.0)),
        up: asked.up.unwrap_or(if asked.mosaic { Up::Y } else { Up::Heading }),
    };
    let sets: Vec<Vec<usize>> = if asked.mosaic {
        sets_of_one_world(&found.views.iter().map(|p| p.origin.as_deref()).collect::<Vec<_>>())
    } else {
        (0..found.views.len()).map(|i| vec![i]).collect()
    };
    let views_of = |set: &Vec<usize>| set.iter().map(|i| &found.views[*i].view).collect::<Vec<&FloorView>>();
    let of_sets: Vec<Vec<&FloorView>> = sets.iter().map(views_of).collect();
    let px_per_unit = resolution(&layout, &of_sets, asked.resolution, &mut notes)?;
    let mut made = Vec::new();
    let mut watched: Vec<(FloorGrid, Vec<usize>)> = Vec::new();
    for (set, views) in sets.into_iter().zip(&of_sets) {
        match layout.grid(views, px_per_unit) {
            Some(grid) => watched.push((grid, set)),
            None => notes.push(format!("{}: no floor in it within extent=: left out", found.views[set[0]].image)),
        }
    }
    let stage = if asked.mosaic { "mosaics" } else { "views" };
    groundcal_lab::progress::Progress::begin(watch, stage, watched.len() as u64);
    for (grid, set) in watched {
        let views = set.iter().map(|i| found.views[*i].image.clone()).collect();
        let picture = flat(&found, &set, grid, &layout, asked.mosaic, watch)?;
        made.push(FloorPicture { made: picture, grid, views, metres: height_m.is_some() });
        groundcal_lab::progress::Progress::advance(watch);
    }
    Ok((made, notes))
}

/// Which views have a picture.
fn found(
    all: Vec<Placed>,
    shots: Shots,
    size: ImageSize,
    together: bool,
    notes: &mut Vec<String>,
) -> Result<Found, Failure> {
    let names: Vec<&str> = all.iter().map(|p| p.image.as_str()).collect();
    match shots {
        Shots::Arrays(list) => {
            let mut wanted: Vec<Option<Picture>> = names.iter().map(|_| None).collect();
            for (name, picture) in list {
                match names.iter().position(|n| *n == name) {
                    Some(at) => wanted[at] = Some(picture),
                    None => notes.push(format!("left out, as the calibration has no position for it: {name}")),
                }
            }
            if wanted.iter().all(Option::is_none) {
                let text = format!("no image given is a view of the calibration, which has {}", names.join(", "));
                return Err(Failure::input(text));
            }
            let both = all.into_iter().zip(wanted).filter_map(|(view, picture)| Some((view, picture?)));
            let (views, pictures) = both.unzip();
            Ok(Found { views, pictures: Pictures::Arrays(pictures) })
        }
        Shots::Files(paths) => {
            let matched =
                if paths.is_empty() { look_beside(&names, None) } else { match_files(&names, &find_images(&paths)?)? };
            let missing = matched.missing(&names);
            if missing.len() == names.len() {
                return Err(Failure::input(format!(
                    "no image of the calibration ({}) is there. Give the images that were calibrated, under the names they had",
                    names.join(", ")
                )));
            }
            // Who names files wants those.
            if !missing.is_empty() && paths.iter().all(|p| p.is_dir()) {
                notes.push(format!("of the calibration's images not found: {}", missing.join(", ")));
            }
            if !matched.others.is_empty() {
                let others = matched.others.join(", ");
                notes.push(format!("left out, as the calibration has no position for them: {others}"));
            }
            let both = all.iter().zip(&matched.files).filter_map(|(v, file)| Some((v.clone(), file.clone()?)));
            let (views, files): (Vec<Placed>, Vec<PathBuf>) = both.unzip();
            let (reader, said) = PictureReader::new(&files, size, None, together)?;
            notes.extend(said.iter().map(ToString::to_string));
            Ok(Found { views, pictures: Pictures::Files(reader) })
        }
    }
}

fn resolution(
    layout: &FloorLayout,
    sets: &[Vec<&FloorView>],
    asked: Option<f64>,
    notes: &mut Vec<String>,
) -> Result<f64, Failure> {
    let chosen = layout.resolution(sets, asked).map_err(|error| match error {
        ResolutionError::NoFloor => Failure::input(format!(
            "no view sees floor within {} of the point below it. Take a larger extent=; if there is no floor in the images, there is \
             nothing to rectify",
            layout.max_distance
        )),
        ResolutionError::TooLarge { pixels, most_pixels, fits_px_per_unit } => Failure::option(format!(
            "resolution={}: a picture would have {:.0} megapixels, {} at most. Take {fits_px_per_unit} or less, or a smaller extent= \
             than {}",
            asked.unwrap_or(f64::NAN),
            pixels as f64 / 1e6,
            most_pixels / 1_000_000,
            layout.max_distance
        )),
    })?;
    if let Some(wanted) = chosen.lowered_from {
        notes.push(format!(
            "resolution lowered from {wanted} to {} px a unit, for pictures of at most {} megapixels",
            chosen.px_per_unit,
            chosen.most_pixels / 1_000_000
        ));
    }
    Ok(chosen.px_per_unit)
}

/// The work of [`rectify`] on the picture of one view.
struct Flatten<'a> {
    view: &'a FloorView,
    grid: FloorGrid,
    max_distance: f64,
}

impl PerDepth for Flatten<'_> {
    fn on<T: Depth>(&self, picture: Raster<T>) -> Resampled<T> {
        rectify(&Pyramid::new(picture), self.view, &self.grid, self.max_distance)
    }
}

/// The pictures of a set laid over each other, in 8 bits unless all have one depth.
fn flat(
    found: &Found,
    set: &[usize],
    grid: FloorGrid,
    layout: &FloorLayout,
    mosaic: bool,
    watch: &Watch,
) -> Result<Made, Failure> {
    go_on(watch)?;
    let first = found.pictures.read(set[0])?;
    if !mosaic {
        let work = Flatten { view: &found.views[set[0]].view, grid, max_distance: layout.max_distance };
        return Ok(arrays::per_depth(first, &work));
    }
    macro_rules! laid {
        ($depth:path, $kind:ty) => {{
            let colour = found.pictures.has_colour();
            let mut all = Mosaic::new(grid, if colour { 3 } else { 1 }, layout.max_distance);
            for i in set {
                go_on(watch)?;
                let $depth(picture) = found.pictures.read(*i)? else {
                    return Err(Failure::input("the images have different dtypes: give all in one"));
                };
                let picture = if colour { pictures::to_colour(picture) } else { picture };
                all.add(&Pyramid::new(picture), &found.views[*i].view);
            }
            all.finish::<$kind>()
        }};
    }
    Ok(match first {
        Picture::U8(_) => Made::U8(laid!(Picture::U8, u8)),
        Picture::U16(_) => Made::U16(laid!(Picture::U16, u16)),
        Picture::F32(_) => Made::F32(laid!(Picture::F32, f32)),
    })
}

/// An error where the work is to stop.
fn go_on(watch: &Watch) -> Result<(), Failure> {
    let stopped = groundcal::Observer::stopped(watch);
    if stopped { Err(groundcal::Error::Stopped.into()) } else { Ok(()) }
}
