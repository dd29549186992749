//! Files for groundcal: images and matches in, cameras of other programs in and out.
//!
//! - [`calibrate_folder`]: a folder of photographs to a calibration.
//! - [`inputs::find_images`], [`images::read_images`]: what the user names, to grey values of one range.
//! - [`matches::read_matches`], [`matches::read_pairs`]: CSV.
//! - [`import::read_camera`]: a camera of this program or another, whatever its format.
//! - [`export::write_formats`]: a calibration as files of other programs.
//! - [`outputs::Outputs`]: what a run writes, without loss of what was there.
//! - [`pictures`]: pictures in and out for undistorting and rectifying.
//!
//! Whatever is read has limits ([`limits`]); whatever is said about it is printable ([`text`]). Errors name the file, and the line or
//! field; what does not stop the work comes back as a [`note::Note`].

#![forbid(unsafe_code)]

mod calibrate_folder;
pub mod error;
pub mod export;
pub mod file;
pub mod images;
pub mod import;
pub mod inputs;
pub mod limits;
pub mod matches;
pub mod names;
pub mod note;
pub mod outputs;
pub mod pictures;
pub mod text;
pub mod view_files;
pub mod words;

pub use calibrate_folder::calibrate_folder;
