//! The keywords of `calibrate`, as the library's options.
//!
//! `groundcal/_calibrate.py` gives a dictionary of those that were given (not `None`); a value of a wrong type is a `TypeError` that
//! names the keyword.

use std::path::PathBuf;

use groundcal::{
    FeatureDensity, HomographyFit, LensModel, Method, MotionModel, Options, RadialCorrection,
    geometry::{Camera, Constraint, ImageSize, Lens},
    result::PriorParameter,
    start::GivenPrior,
};
use groundcal_io::{
    import::read_camera,
    limits::{MAX_PIXELS, SIDES_PX},
    text::plain,
};
use pyo3::{
    exceptions::PyTypeError,
    prelude::*,
    types::{PyDict, PyString},
};

use crate::{failure::Failure, handle::Handle, nearest::no_such};

/// What each keyword has to be.
const TYPES: [(&str, &str); 38] = [
    ("motion", "a string"),
    ("constraint", "a string"),
    ("method", "a string"),
    ("homographies", "a string"),
    ("radial", "a string"),
    ("lens", "a string"),
    ("principal_point_px", "a pair of numbers (x, y) in pixels"),
    ("aspect", "a number"),
    ("priors", "a mapping from names to pairs (mean, sigma), for example {\"cx\": (640, 5)}"),
    ("attitude_sigma_deg", "a number of degrees"),
    ("height_sigma", "a number"),
    ("camera_height_m", "a number of metres"),
    ("all_pairs_limit", "a whole number from 0"),
    ("min_plane_matches", "a whole number from 0"),
    ("features", "a string"),
    ("max_features", "a whole number from 0"),
    ("match_patches", "True or False"),
    ("seed", "a whole number from 0"),
    ("motions", "a whole number from 1"),
    ("threads", "a whole number from 1"),
    ("image_size", "a pair of whole numbers (width, height) in pixels"),
    ("resolution", "a number of pixels"),
    ("extent", "a number"),
    ("up", "a string"),
    ("mosaic", "True or False"),
    ("rig", "a string"),
    ("f", "a number of pixels"),
    ("hfov_deg", "a number of degrees"),
    ("tilts_deg", "a list of numbers of degrees"),
    ("rolls_deg", "a list of numbers of degrees"),
    ("max_turn_deg", "a number of degrees"),
    ("height_m", "a number of metres"),
    ("axis_offset_m", "a number of metres"),
    ("reach_m", "a number of metres"),
    ("noise_px", "a number of pixels"),
    ("points", "a number"),
    ("matches", "a whole number from 6"),
    ("roll_deg", "a number of degrees"),
];

/// A value of a dictionary of keywords.
pub(crate) fn taken<'py, T>(given: &Bound<'py, PyDict>, name: &str) -> PyResult<Option<T>>
where
    T: for<'a> FromPyObject<'a, 'py>,
{
    let Some(value) = given.get_item(name)?.filter(|v| !v.is_none()) else { return Ok(None) };
    value.extract().map(Some).map_err(|_| wrong_type(name, &value))
}

/// The `TypeError` of a value of a keyword.
pub(crate) fn wrong_type(name: &str, value: &Bound<'_, PyAny>) -> PyErr {
    let expected = TYPES.iter().find(|(known, _)| *known == name).map_or("another type", |(_, words)| words);
    let kind = value.get_type().name().map_or_else(|_| "?".into(), |n| n.to_string());
    let shown = value.repr().map_or_else(|_| String::new(), |r| r.to_string());
    let shown: String = shown.chars().take(60).collect();
    PyTypeError::new_err(format!("{name}= must be {expected}, not {} ({kind})", plain(&shown)))
}

/// One of several values by its name.
pub(crate) fn named<T: Copy>(given: &Bound<'_, PyDict>, keyword: &str, values: &[(&str, T)]) -> PyResult<Option<T>> {
    let Some(name) = taken::<String>(given, keyword)? else { return Ok(None) };
    let found = values.iter().find(|(known, _)| *known == name).map(|(_, value)| *value);
    found.map(Some).ok_or_else(|| {
        let names: Vec<&str> = values.iter().map(|(known, _)| *known).collect();
        let text = format!("{keyword}={name:?}: {}", no_such(&name, &names));
        Failure::option(text).raise(given.py())
    })
}

/// The names of constraints.
pub(crate) fn constraints() -> [(&'static str, Constraint); Constraint::ALL.len()] {
    Constraint::ALL.map(|c| (c.name(), c))
}

/// The names of what is estimated of a lens.
pub(crate) fn lens_models() -> [(&'static str, LensModel); LensModel::ALL.len()] {
    LensModel::ALL.map(|lens| (lens.name(), lens))
}

const FEATURES: [(&str, FeatureDensity); 2] = [("auto", FeatureDensity::Auto), ("dense", FeatureDensity::Dense)];
const MOTIONS: [(&str, MotionModel); 4] = [
    ("auto", MotionModel::Auto),
    ("plane-normal", MotionModel::PlaneNormal),
    ("turning", MotionModel::Turning),
    ("general", MotionModel::General),
];
const METHODS: [(&str, Method); 5] = [
    ("joint", Method::Joint),
    ("linear", Method::Linear),
    ("kzr", Method::Kzr),
    ("transferred", Method::Transferred),
    ("rotating", Method::Rotating),
];
const RADIAL: [(&str, RadialCorrection); 2] =
    [("per-pair", RadialCorrection::PerPair), ("closed-form", RadialCorrection::ClosedForm)];
const HOMOGRAPHIES: [(&str, HomographyFit); 2] =
    [("linear", HomographyFit::Linear), ("nonlinear", HomographyFit::NonLinear)];

/// `image_size=(width, height)`.
pub(crate) fn image_size(given: &Bound<'_, PyDict>) -> PyResult<Option<ImageSize>> {
    let Some((width, height)) = taken::<(usize, usize)>(given, "image_size")? else { return Ok(None) };
    let sides = [width, height].map(|side| side as u64);
    let refused = if !sides.iter().all(|side| SIDES_PX.contains(side)) {
        format!("both must lie between {} and {}", SIDES_PX.start(), SIDES_PX.end())
    } else if sides[0] * sides[1] > MAX_PIXELS {
        format!("images of at most {} megapixels are read", MAX_PIXELS / 1_000_000)
    } else {
        return Ok(Some(ImageSize::new(width, height)));
    };
    Err(Failure::option(format!("image_size=({width}, {height}): {refused}")).raise(given.py()))
}

/// `priors={"cx": (640, 5)}`.
pub(crate) fn priors(given: &Bound<'_, PyDict>) -> PyResult<Vec<GivenPrior>> {
    let Some(value) = given.get_item("priors")?.filter(|v| !v.is_none()) else { return Ok(Vec::new()) };
    let Ok(priors) = value.cast::<PyDict>() else { return Err(wrong_type("priors", &value)) };
    let names = PriorParameter::ALL.map(|p| p.to_string());
    let mut all = Vec::new();
    for (name, pair) in priors {
        let name: String = name.extract().map_err(|_| wrong_type("priors", &value))?;
        let (mean, sigma) = pair.extract::<(f64, f64)>().map_err(|_| wrong_type("priors", &value))?;
        let known = PriorParameter::ALL.into_iter().find(|p| p.to_string() == name);
        let parameter = known.ok_or_else(|| {
            Failure::option(format!(
                "priors={{{name:?}: ...}}: {}",
                no_such(&name, &names.each_ref().map(String::as_str))
            ))
            .raise(given.py())
        })?;
        all.push(GivenPrior { parameter, mean, sigma });
    }
    Ok(all)
}

/// A known lens.
#[derive(Debug, Clone)]
pub(crate) enum KnownLens {
    /// Its coefficients alone.
    Coefficients(Lens),
    /// A camera, with what it is called.
    Camera(String, Camera),
    /// A camera file, which may not say the size of its images.
    File(PathBuf),
}

/// `distortion=`: coefficients by name, a camera file, or a calibration.
fn known_lens(given: &Bound<'_, PyDict>) -> PyResult<Option<KnownLens>> {
    let Some(value) = given.get_item("distortion")?.filter(|v| !v.is_none()) else { return Ok(None) };
    if let Ok(handle) = value.cast::<Handle>() {
        let camera = handle.get().calibration().camera.model();
        return Ok(Some(KnownLens::Camera("distortion=".into(), camera)));
    }
    if value.is_instance_of::<PyString>() || value.hasattr("__fspath__")? {
        return Ok(Some(KnownLens::File(value.extract()?)));
    }
    let wrong = || {
        PyTypeError::new_err(
            "distortion= must be a mapping of coefficients, for example {\"k1\": -0.1, \"k2\": 0.02}, the path of a camera file, or a \
             Calibration",
        )
    };
    let coefficients = value.cast::<PyDict>().map_err(|_| wrong())?;
    let (mut model, mut all) = ("radtan".to_string(), Vec::new());
    for (name, value) in coefficients {
        let name: String = name.extract().map_err(|_| wrong())?;
        if name == "model" {
            model = value.extract().map_err(|_| wrong())?;
        } else {
            all.push((name, value.extract::<f64>().map_err(|_| wrong())?));
        }
    }
    let of_lens = ["k1", "k2", "k3", "k4", "p1", "p2", "lambda"];
    if let Some((name, _)) = all.iter().find(|(name, _)| !of_lens.contains(&name.as_str())) {
        let text = format!("distortion={{{name:?}: ...}}: {}", no_such(name, &of_lens));
        return Err(Failure::option(text).raise(value.py()));
    }
    let lens = Lens::from_named(&model, all.iter().map(|(name, value)| (name.as_str(), *value)))
        .map_err(|what| Failure::option(what).raise(value.py()))?;
    Ok(Some(KnownLens::Coefficients(lens)))
}

/// All that `calibrate` is told beside its source.
#[derive(Debug, Clone)]
pub(crate) struct Asked {
    pub(crate) options: Options,
    pub(crate) lens: Option<KnownLens>,
    pub(crate) camera_height_m: Option<f64>,
    pub(crate) image_size: Option<ImageSize>,
    pub(crate) threads: Option<usize>,
}

impl Asked {
    pub(crate) fn of(given: &Bound<'_, PyDict>) -> PyResult<Self> {
        let usual = Options::default();
        let mut options = Options {
            motion: named(given, "motion", &MOTIONS)?.unwrap_or_default(),
            feature_density: named(given, "features", &FEATURES)?.unwrap_or_default(),
            constraint: named(given, "constraint", &constraints())?.unwrap_or_default(),
            method: named(given, "method", &METHODS)?.unwrap_or_default(),
            homographies: named(given, "homographies", &HOMOGRAPHIES)?.unwrap_or_default(),
            radial: named(given, "radial", &RADIAL)?.unwrap_or_default(),
            lens: named(given, "lens", &lens_models())?.unwrap_or_default(),
            principal_point_px: taken::<(f64, f64)>(given, "principal_point_px")?.map(|(x, y)| [x, y]),
            aspect: taken(given, "aspect")?,
            priors: priors(given)?,
            attitude_sigma_deg: taken(given, "attitude_sigma_deg")?,
            height_sigma: taken(given, "height_sigma")?,
            all_pairs_limit: taken(given, "all_pairs_limit")?.unwrap_or(usual.all_pairs_limit),
            min_plane_matches: taken(given, "min_plane_matches")?,
            match_patches: taken(given, "match_patches")?.unwrap_or(usual.match_patches),
            seed: taken(given, "seed")?.unwrap_or(usual.seed),
            ..usual
        };
        if let Some(most) = taken::<usize>(given, "max_features")? {
            if !(50..=50_000).contains(&most) {
                let text = format!("max_features={most}: it must lie between 50 and 50000");
                return Err(Failure::option(text).raise(given.py()));
            }
            options.max_features = most;
        }
        let threads = taken::<usize>(given, "threads")?;
        if threads == Some(0) {
            return Err(Failure::option("threads=0: it must be 1 or more").raise(given.py()));
        }
        Ok(Self {
            options,
            lens: known_lens(given)?,
            camera_height_m: taken(given, "camera_height_m")?,
            image_size: image_size(given)?,
            threads: threads.map(|n| n.min(MAX_THREADS)),
        })
    }

    /// Takes the known lens, and the camera matrix through which it was measured, at the size of these images. Returns what there is to
    /// say about its file.
    pub(crate) fn take_lens(&mut self, size: ImageSize) -> Result<Vec<String>, Failure> {
        let (name, camera, notes) = match self.lens.take() {
            None => return Ok(Vec::new()),
            Some(KnownLens::Coefficients(lens)) => {
                self.options.distortion = if lens.is_none() { Lens::None } else { lens };
                return Ok(Vec::new());
            }
            Some(KnownLens::Camera(name, camera)) => (name, camera, Vec::new()),
            Some(KnownLens::File(path)) => {
                let read = read_camera(&path)?;
                let camera = Camera { size: read.size.unwrap_or(size), intrinsics: read.intrinsics, lens: read.lens };
                (format!("distortion={:?}", path.display().to_string()), camera, read.notes)
            }
        };
        if camera.lens.is_none() {
            return Err(Failure::option(format!(
                "{name}: it has no lens distortion. Give lens=\"none\" for a lens known to have none"
            )));
        }
        let Some(scaled) = camera.scaled_to(size) else {
            return Err(Failure::option(format!(
                "{name}: a camera of {} pixels, the images have {size}: another shape, so they are not the same picture at another size",
                camera.size
            )));
        };
        self.options.distortion = scaled.lens;
        self.options.distortion_camera = Some(scaled.intrinsics);
        Ok(notes)
    }
}

/// More than this help on no machine.
const MAX_THREADS: usize = 256;
