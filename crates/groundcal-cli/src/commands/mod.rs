//! The commands: of each its arguments and its run.

pub(crate) mod calibrate;
pub(crate) mod compare;
pub(crate) mod completions;
pub(crate) mod convert;
pub(crate) mod experiment;
pub(crate) mod floor;
pub(crate) mod man;
pub(crate) mod plan;
pub(crate) mod rectify;
pub(crate) mod render;
pub(crate) mod simulate;
pub(crate) mod uncertainty;
pub(crate) mod undistort;
