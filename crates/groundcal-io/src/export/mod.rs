//! A calibration as the files of this program and of others.
//!
//! `formats` has the table of formats; one file a format (`opencv`, `ros`, `kalibr`, `colmap`, `nerfstudio`, `matlab`); below them
//! what they share (`source`: what is written, `world`: poses, `number`: digits, `file`).

mod calibration_json;
mod colmap;
mod file;
pub mod floor_picture;
pub mod formats;
mod kalibr;
mod matlab;
mod nerfstudio;
mod number;
mod opencv;
mod ros;
mod source;
pub mod undistorted;
mod world;

pub use calibration_json::json;
pub use file::File;
pub use formats::{Files, Format, file_names, render, render_camera, write_formats};
