//! `compare`, `plan`, `simulate`, and the whole program.

use std::{ffi::OsString, path::PathBuf};

use groundcal::{
    plan::{Carrier, PlanRequest, RequestError},
    result::Covariance,
};
use groundcal_io::{import::read_camera, text::name_text};
use groundcal_lab::studies::{catalogue::Study, setting::Asked};
use groundcal_report::{
    canvas::svg,
    compare::{self, CompareError},
    comparison, plan, terminal,
};
use pyo3::{prelude::*, types::PyDict};

use crate::{
    failure::Failure,
    handle::Handle,
    keywords::Keywords,
    nearest::no_such,
    options::{constraints, image_size, lens_models, named, priors, taken},
    work,
};

/// A camera to be compared: a calibration with a name, or a file.
#[derive(FromPyObject)]
pub(crate) enum ComparedCamera {
    Named(String, Py<Handle>),
    File(PathBuf),
}

fn of_file(path: &std::path::Path, notes: &mut Vec<String>) -> Result<compare::Camera, Failure> {
    let read = read_camera(path)?;
    let name = name_text(path.as_os_str());
    notes.extend(read.notes.iter().map(|n| format!("{name}: {n}")));
    Ok(compare::Camera {
        name,
        format: read.format,
        size: read.size,
        intrinsics: read.intrinsics,
        lens: read.lens,
        covariance: read.covariance,
    })
}

fn of_handle(name: String, handle: &Handle) -> compare::Camera {
    let c = handle.calibration();
    let camera = &c.camera;
    let known = |covariance: &Covariance<_>| (!covariance.parameters.is_empty()).then(|| covariance.clone());
    compare::Camera {
        name,
        format: "groundcal",
        size: Some(camera.model().size),
        intrinsics: camera.model().intrinsics,
        lens: camera.model().lens,
        covariance: known(&c.covariance),
    }
}

/// What is given to Python: JSON, a page of text, figures, and notes.
type Told = (String, String, Vec<String>, Vec<String>);

/// How far cameras differ.
#[pyfunction]
#[pyo3(signature = (cameras, width))]
pub(crate) fn compare_cameras(py: Python<'_>, cameras: Vec<ComparedCamera>, width: usize) -> PyResult<Told> {
    let mut notes = Vec::new();
    let mut all = Vec::new();
    for camera in cameras {
        all.push(match camera {
            ComparedCamera::Named(name, handle) => of_handle(name, handle.get()),
            ComparedCamera::File(path) => of_file(&path, &mut notes).map_err(|e| e.raise(py))?,
        });
    }
    let names: Vec<String> = all.iter().map(|c| c.name.clone()).collect();
    work::run(py, None, None, move |_| {
        let both = |i: usize| format!("{} and {}", names[0], names[i]);
        let (found, differences) = compare::compare(&all).map_err(|error| match error {
            CompareError::NoSize => Failure::input(format!("{}: none says the size of its images", names.join(", "))),
            CompareError::Shapes(i, what) => Failure::input(format!("{}: {what}", both(i))),
            CompareError::Camera(i, error) => Failure::of_input(&both(i), error),
        })?;
        let size = groundcal::geometry::ImageSize::new(found.reference.image_size[0], found.reference.image_size[1]);
        let figure = |(name, d)| svg::document(&comparison::figure(&names[0], name, size, d).layout());
        let figures = names[1..].iter().map(String::as_str).zip(&differences).map(figure).collect();
        Ok((serde_json::to_string(&found)?, comparison::text(&found, width), figures, notes))
    })
}

const CARRIERS: [(&str, Carrier); 4] =
    [("tripod", Carrier::Tripod), ("pan-head", Carrier::PanHead), ("robot", Carrier::Robot), ("drone", Carrier::Drone)];

fn plan_request(given: &Bound<'_, PyDict>) -> PyResult<PlanRequest> {
    let motions = taken::<usize>(given, "motions")?;
    Ok(PlanRequest {
        carrier: named(given, "rig", &CARRIERS)?.unwrap_or_default(),
        image_size: image_size(given)?,
        f_px: taken(given, "f")?,
        hfov_deg: taken(given, "hfov_deg")?,
        principal_point_px: taken::<(f64, f64)>(given, "principal_point_px")?.map(|(x, y)| [x, y]),
        tilts_deg: taken(given, "tilts_deg")?,
        rolls_deg: taken(given, "rolls_deg")?,
        max_turn_deg: taken(given, "max_turn_deg")?,
        height_m: taken(given, "height_m")?,
        axis_offset_m: taken(given, "axis_offset_m")?,
        reach_m: taken(given, "reach_m")?,
        noise_px: taken(given, "noise_px")?,
        points: taken(given, "points")?,
        motions,
        constraint: named(given, "constraint", &constraints())?.unwrap_or_default(),
        priors: priors(given)?,
        lens: named(given, "lens", &lens_models())?.unwrap_or_default(),
        attitude_sigma_deg: taken(given, "attitude_sigma_deg")?,
        height_sigma: taken(given, "height_sigma")?,
    })
}

/// Which pictures to take.
#[pyfunction]
#[pyo3(signature = (after, options, then, width))]
pub(crate) fn plan_motions(
    py: Python<'_>,
    after: Option<&Handle>,
    options: &Bound<'_, PyDict>,
    then: String,
    width: usize,
) -> PyResult<Told> {
    let request = plan_request(options)?;
    let after = after.map(Handle::shared);
    work::run(py, None, None, move |_| {
        let report = request.report(after.as_deref(), &Keywords).map_err(|error| match error {
            RequestError::OutOfRange { field, value, expected } => {
                Failure::option(format!("{field}={value}: give {expected}"))
            }
            RequestError::OfCalibration(error) => Failure::of_input("after=", error),
            RequestError::Plan(error) => error.into(),
        })?;
        let figure = svg::document(&plan::figure(&report).layout());
        Ok((serde_json::to_string(&report)?, plan::text(&report, &then, width), vec![figure], Vec::new()))
    })
}

fn study_of(name: &str) -> Result<Study, Failure> {
    let all = Study::all();
    let found = all.iter().find(|s| s.name() == name).copied();
    found.ok_or_else(|| {
        let names: Vec<&str> = all.iter().map(|s| s.name()).collect();
        Failure::option(format!("study={name:?}: {}", no_such(name, &names)))
    })
}

/// What a study is asked for in place of its own settings.
fn asked_of(study: Study, given: &Bound<'_, PyDict>) -> PyResult<Asked> {
    let refuse = |text: String| Err(Failure::option(text).raise(given.py()));
    let matches = taken::<usize>(given, "matches")?;
    if let Some(n) = matches.filter(|n| !(6..=10_000).contains(n)) {
        return refuse(format!("matches={n}: it must lie between 6 and 10000"));
    }
    let roll_deg = taken::<f64>(given, "roll_deg")?;
    if let Some(deg) = roll_deg.filter(|deg| !(0.0..=90.0).contains(deg)) {
        return refuse(format!("roll_deg={deg}: it must lie between 0 and 90"));
    }
    let noise_px = taken::<f64>(given, "noise_px")?;
    if let Some(px) = noise_px.filter(|px| !(0.0..=100.0).contains(px)) {
        return refuse(format!("noise_px={px}: it must lie between 0 and 100"));
    }
    if noise_px.is_some() && study.varies_noise() {
        return refuse(format!("noise_px=: {:?} varies the noise itself", study.name()));
    }
    if roll_deg.is_some() && !study.knows_rolls() {
        return refuse(format!("roll_deg=: the views of {:?} are rolled by any angle", study.name()));
    }
    Ok(Asked { matches, roll_deg, noise_px, size: image_size(given)? })
}

/// A study of the paper: its table (CSV), its page, its figure.
#[pyfunction]
#[pyo3(signature = (study, given, trials, seed, threads, progress))]
pub(crate) fn run_study<'py>(
    py: Python<'py>,
    study: &str,
    given: &Bound<'_, PyDict>,
    trials: u32,
    seed: u64,
    threads: Option<usize>,
    progress: Option<&Bound<'py, PyAny>>,
) -> PyResult<(String, String, String)> {
    let study = study_of(study).map_err(|e| e.raise(py))?;
    let asked = asked_of(study, given)?;
    work::run(py, threads, progress, move |watch| {
        let output = study.run(&asked, trials, seed, watch)?;
        let table = String::from_utf8(output.table).map_err(|e| Failure::Fault(e.to_string()))?;
        Ok((table, output.page, svg::document(&output.figure.layout())))
    })
}

/// The names of the studies.
pub(crate) fn studies() -> Vec<&'static str> {
    Study::all().into_iter().map(Study::name).collect()
}

/// The program, with its command line; its exit code.
#[pyfunction]
pub(crate) fn run_program(py: Python<'_>, args: Vec<OsString>) -> u8 {
    // Ctrl-C ends the process, as it does the program.
    groundcal_cli::end_on_signals();
    py.detach(|| groundcal_cli::run(args))
}

/// Columns of pages of text.
pub(crate) const WIDTH: usize = terminal::WIDTH;
