//! A calibration as Python holds it: the library's value, with the images it was made from.

use std::{
    path::{Path, PathBuf},
    sync::Arc,
};

use groundcal::{
    geometry::rotation_cam_from_world,
    result::{Calibration, Camera},
    vision::GrayImage,
};
use groundcal_io::{
    export::{self, Format},
    import::{groundcal_json, read_camera},
    outputs::{Outputs, Request},
    text::shown,
};
use groundcal_report::{
    html,
    text::{self, SummaryOptions},
};
use pyo3::prelude::*;

use crate::{failure::Failure, keywords::Keywords, work};

/// The page of a calibration.
const PAGE: &str = "report.html";
const JSON: &str = "calibration.json";

/// A calibration and what it was made from.
#[pyclass(frozen, module = "groundcal._groundcal")]
pub(crate) struct Handle {
    calibration: Arc<Calibration>,
    /// Grey images, for the page; none of a calibration that was read, or made from matches.
    images: Arc<Vec<GrayImage>>,
    /// Files that it was made from.
    inputs: Vec<PathBuf>,
}

impl Handle {
    pub(crate) fn new(calibration: Calibration, images: Vec<GrayImage>, inputs: Vec<PathBuf>) -> Self {
        Self { calibration: Arc::new(calibration), images: Arc::new(images), inputs }
    }

    pub(crate) fn calibration(&self) -> &Calibration {
        &self.calibration
    }

    pub(crate) fn shared(&self) -> Arc<Calibration> {
        Arc::clone(&self.calibration)
    }
}

/// Names and contents of files, and what their format cannot say.
type Rendered = (Vec<(String, String)>, Vec<String>);

/// The formats by their names.
const FORMATS: [(&str, Format); 6] = [
    ("opencv", Format::Opencv),
    ("ros", Format::Ros),
    ("kalibr", Format::Kalibr),
    ("colmap", Format::Colmap),
    ("nerfstudio", Format::Nerfstudio),
    ("matlab", Format::Matlab),
];

fn format_of(name: &str) -> Result<Format, Failure> {
    let names: Vec<&str> = FORMATS.iter().map(|f| f.0).collect();
    let found = FORMATS.iter().find(|f| f.0 == name).map(|f| f.1);
    found.ok_or_else(|| Failure::option(format!("formats=: {}", crate::nearest::no_such(name, &names))))
}

#[pymethods]
impl Handle {
    /// The text of calibration.json.
    fn json(&self, py: Python<'_>) -> PyResult<String> {
        export::json(&self.calibration, &Keywords).map_err(|e| Failure::from(e).raise(py))
    }

    /// The summary that the program prints.
    #[pyo3(signature = (verbose, width))]
    fn summary(&self, verbose: bool, width: usize) -> String {
        text::summary(&self.calibration, &SummaryOptions { width, verbose, more: "" }, &Keywords)
    }

    /// The page.
    fn page(&self, py: Python<'_>) -> PyResult<String> {
        let (calibration, images) = (Arc::clone(&self.calibration), Arc::clone(&self.images));
        work::run(py, None, None, move |_| Ok(html::page(&calibration, &images, &Keywords, None)?))
    }

    /// Files of a format: names with content, and what the format cannot say.
    fn rendered(&self, py: Python<'_>, format: &str) -> PyResult<Rendered> {
        let made = || -> Result<_, Failure> {
            let rendered = export::render(&self.calibration, &[format_of(format)?])?;
            let files = rendered.files.into_iter().map(|f| (f.name.to_string(), f.content)).collect();
            Ok((files, rendered.notes))
        };
        made().map_err(|e| e.raise(py))
    }

    /// Of each view the rotation of camera coordinates from the world's, row by row.
    fn rotations(&self) -> Vec<[[f64; 3]; 3]> {
        let of = |v: &groundcal::result::ViewReport| {
            let [pitch, roll, yaw] = [v.pitch_down_deg, v.roll_deg, v.yaw_deg].map(f64::to_radians);
            let r = rotation_cam_from_world(pitch, roll, yaw);
            std::array::from_fn(|i| std::array::from_fn(|j| r[(i, j)]))
        };
        self.calibration.views.iter().map(of).collect()
    }

    /// The same with lengths in metres.
    fn with_camera_height(&self, py: Python<'_>, height_m: f64) -> PyResult<Self> {
        let calibration = (*self.calibration).clone().with_camera_height(height_m);
        let calibration = calibration.map_err(|e| Failure::from(e).raise(py))?;
        Ok(Self { calibration: Arc::new(calibration), images: Arc::clone(&self.images), inputs: self.inputs.clone() })
    }

    /// Whether both say the same.
    fn equals(&self, other: &Self) -> bool {
        // What it was made from is not kept in files.
        let bare = |c: &Calibration| {
            let mut bare = c.clone();
            bare.evidence = Default::default();
            bare
        };
        Arc::ptr_eq(&self.calibration, &other.calibration) || bare(&self.calibration) == bare(&other.calibration)
    }

    /// Writes calibration.json, the page and the formats; gives their paths and notes.
    fn save(
        &self,
        py: Python<'_>,
        folder: PathBuf,
        formats: Option<Vec<String>>,
        report: bool,
        overwrite: bool,
    ) -> PyResult<(Vec<PathBuf>, Vec<String>)> {
        let of_names = |names: Vec<String>| names.iter().map(|n| format_of(n)).collect::<Result<Vec<_>, _>>();
        let formats = formats.map(of_names).transpose().map_err(|e| e.raise(py))?;
        let (calibration, images) = (Arc::clone(&self.calibration), Arc::clone(&self.images));
        let inputs = self.inputs.clone();
        let what = What { formats, report, overwrite };
        work::run(py, None, None, move |_| saved(&calibration, &images, &inputs, &folder, &what))
    }
}

/// What is written beside calibration.json.
struct What {
    /// `None`: all.
    formats: Option<Vec<Format>>,
    report: bool,
    overwrite: bool,
}

fn saved(
    calibration: &Calibration,
    images: &[GrayImage],
    inputs: &[PathBuf],
    folder: &Path,
    what: &What,
) -> Result<(Vec<PathBuf>, Vec<String>), Failure> {
    // An empty list of formats stands for all of them there.
    let rendered = match &what.formats {
        Some(none) if none.is_empty() => None,
        Some(some) => Some(export::render(calibration, some)?),
        None => Some(export::render(calibration, &[])?),
    };
    let files = rendered.as_ref().map_or(&[][..], |r| &r.files);
    let mut names = vec![JSON.to_string()];
    names.extend(what.report.then(|| PAGE.to_string()));
    names.extend(files.iter().map(|f| f.name.to_string()));
    let outputs = Outputs::begin(&Request {
        folder,
        command: "calibrate",
        names: &names,
        inputs,
        basis: None,
        overwrite: what.overwrite,
    })?;
    outputs.write(JSON, export::json(calibration, &Keywords)?.as_bytes())?;
    if what.report {
        outputs.write(PAGE, html::page(calibration, images, &Keywords, None)?.as_bytes())?;
    }
    for file in files {
        outputs.write(file.name, file.content.as_bytes())?;
    }
    let mut notes = outputs.notes().to_vec();
    notes.extend(rendered.iter().flat_map(|r| r.notes.clone()));
    let written = outputs.commit()?;
    notes.extend(written.notes);
    Ok((names.iter().map(|n| folder.join(n)).collect(), notes))
}

/// A calibration of a file: calibration.json, the folder it is in, or a camera of another program; and what there is to say about it.
#[pyfunction]
pub(crate) fn load(py: Python<'_>, path: PathBuf) -> PyResult<(Handle, Vec<String>)> {
    loaded(&path).map_err(|e| e.raise(py))
}

fn loaded(path: &Path) -> Result<(Handle, Vec<String>), Failure> {
    let camera = read_camera(path)?;
    if camera.format == "groundcal" {
        return Ok((Handle::new(groundcal_json::read(path)?, Vec::new(), Vec::new()), camera.notes));
    }
    let size = camera.size.ok_or_else(|| {
        Failure::input(format!("{}: the size of the images is not said. Add image_width and image_height", shown(path)))
    })?;
    let value = serde_json::json!({
        "format_version": 1,
        "camera": Camera::new(size, &camera.intrinsics, camera.lens, camera.lens_source),
    });
    let mut calibration = of_text(&value.to_string())?;
    calibration.covariance = camera.covariance.unwrap_or_default();
    Ok((Handle::new(calibration, Vec::new(), Vec::new()), camera.notes))
}

fn of_text(text: &str) -> Result<Calibration, Failure> {
    groundcal_json::parse(text).map_err(Failure::input)
}

/// A calibration from the text of calibration.json.
#[pyfunction]
pub(crate) fn from_json(py: Python<'_>, text: &str) -> PyResult<Handle> {
    of_text(text).map(|c| Handle::new(c, Vec::new(), Vec::new())).map_err(|e| e.raise(py))
}
