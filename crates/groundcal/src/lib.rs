#![deny(clippy::print_stdout, clippy::print_stderr)]
#![doc = include_str!("../README.md")]
//!
//! # The pipeline
//!
//! Data flows down this list; a module imports only from those above it and from the shared tools.
//!
//! | module | what |
//! |---|---|
//! | [`image`], [`features`] | grey pixels; detection, description, matching |
//! | [`correspondence`] | point pairs between two images |
//! | [`homography`] | linear, robust, gold standard; information matrix |
//! | [`circular_points`] | from a homography: angle, height ratio, horizon, covariance |
//! | [`attitude_groups`], [`motions`] | motions of one attitude; which pairs are plane-normal motions |
//! | [`absolute_conic`], [`camera`] | constraints, rank, weighted solution; camera matrix in pixels |
//! | [`bundle`] | joint refinement of camera, lens, attitudes, views and points; covariance |
//! | [`subsets`] | cameras of all minimal sets of motions, ranked |
//! | [`transfer`] | one motion's circular points carried into other views |
//! | [`camera_model`], [`camera_difference`] | a camera with any lens others describe; how far two differ, in pixels |
//! | [`rotating`] | the other method: camera matrix from rotations about the optical centre |
//! | [`mod@calibrate`], [`result`], [`evidence`] | the front door; the result value, its warnings and what it was made from |
//! | [`floor`], [`resample`], [`rectify`](mod@rectify) | pixels and points of the floor, with the lens; pictures through such maps; bird's-eye views |
//! | [`undistort`] | images as an ideal lens would have taken them |
//! | [`intrinsics`], [`distortion`], [`attitude`], [`plane_view`], [`frame`] | models and conventions |
//! | [`ransac`], [`levenberg_marquardt`], [`linalg`], [`statistics`] | shared tools |
//! | [`synthetic`] | scenes with truth |
//! | [`plan`] | capture advice: which motions to make, and the error bars to expect |

pub mod calibrate;
pub mod error;
pub mod floor;
pub mod geometry;
pub mod ids;
pub mod numerics;
pub mod observer;
pub mod pairs;
#[cfg(feature = "synthetic")]
pub mod plan;
pub mod refine;
pub mod remedy;
pub mod result;
pub mod select;
pub mod start;
#[cfg(feature = "synthetic")]
pub mod synthetic;
pub mod vision;
