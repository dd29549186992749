//! The experiments of the paper (KZR) on scenes with exact truth, rendered, calibrated and put into tables: constraint by
//! method, errors of focal length, aspect ratio and principal point.

mod arch;
pub mod catalogue;
mod contact_sheet;
mod film;
mod lens;
mod methods;
mod mobile;
mod pan_head;
mod paths;
pub mod real;
pub mod setup;
mod subsets;
mod table;
mod tripod;
