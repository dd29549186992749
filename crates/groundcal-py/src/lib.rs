//! The native part of the Python package `groundcal` (`python/groundcal`), which wraps it: nothing here is documented for users.
//!
//! Python has the names, the documentation and the checks of what it is given; here its values become the library's, the work is done
//! beside the interpreter ([`work`]), and errors become exceptions ([`failure`]) worded as keywords ([`keywords`]). What is computed,
//! read, written or drawn is so by the crates that the program uses.

#![deny(unsafe_code)]

mod arrays;
mod calibrate;
mod failure;
mod floor;
mod handle;
mod keywords;
mod nearest;
mod options;
mod tools;
mod work;

use pyo3::prelude::*;

/// The nearest of known names, as a sentence.
#[pyfunction]
fn no_such(name: &str, known: Vec<String>) -> String {
    nearest::no_such(name, &known.iter().map(String::as_str).collect::<Vec<_>>())
}

#[pymodule]
fn _groundcal(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("VERSION", env!("CARGO_PKG_VERSION"))?;
    module.add("WIDTH", tools::WIDTH)?;
    module.add("STUDIES", tools::studies())?;
    module.add_class::<handle::Handle>()?;
    module.add_function(wrap_pyfunction!(no_such, module)?)?;
    module.add_function(wrap_pyfunction!(handle::load, module)?)?;
    module.add_function(wrap_pyfunction!(handle::from_json, module)?)?;
    module.add_function(wrap_pyfunction!(calibrate::calibrate_files, module)?)?;
    module.add_function(wrap_pyfunction!(calibrate::calibrate_arrays, module)?)?;
    module.add_function(wrap_pyfunction!(calibrate::calibrate_pairs, module)?)?;
    module.add_function(wrap_pyfunction!(calibrate::calibrate_tracks, module)?)?;
    module.add_function(wrap_pyfunction!(calibrate::calibrate_planes, module)?)?;
    module.add_function(wrap_pyfunction!(floor::undistort, module)?)?;
    module.add_function(wrap_pyfunction!(floor::undistort_maps, module)?)?;
    module.add_function(wrap_pyfunction!(floor::rectify_floor, module)?)?;
    module.add_function(wrap_pyfunction!(tools::compare_cameras, module)?)?;
    module.add_function(wrap_pyfunction!(tools::plan_motions, module)?)?;
    module.add_function(wrap_pyfunction!(tools::run_study, module)?)?;
    module.add_function(wrap_pyfunction!(tools::run_program, module)?)?;
    Ok(())
}
