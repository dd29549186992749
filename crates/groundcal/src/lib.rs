#![forbid(unsafe_code)]
#![deny(clippy::print_stdout, clippy::print_stderr)]
#![doc = include_str!("../README.md")]
//!
//! # The pipeline
//!
//! Data flows down this list, by stage; a module imports only from those above it and from the shared tools. `calibrate/driver.rs`
//! says the way in one screen.
//!
//! | module | what |
//! |---|---|
//! | [`vision`] | grey pixels; features, their description and matching; patches matched by least squares |
//! | [`pairs`] | what one pair of images says: matches, homography with covariance, circular point, the lens from planes |
//! | [`select`] | which pairs are motions, of which kind; which motions share an attitude |
//! | [`start`] | closed-form cameras: absolute conic under constraints, plane-normal motions, rotations, a given lens |
//! | [`refine`] | joint refinement of camera, lens, attitudes, views and points; covariance |
//! | [`floor`] | pixels and points of the floor, with the lens; bird's-eye views; images as an ideal lens would have taken them |
//! | [`result`] | the result value, its warnings, and what it was made from |
//! | [`mod@calibrate`] | the front door: options, sources, the driver, checks |
//! | [`plan`] | capture advice: which motions to make, and the error bars to expect |
//!
//! Shared tools: [`geometry`] (models and conventions), [`numerics`] (RANSAC, Levenberg-Marquardt, linear algebra, statistics),
//! [`ids`] (indices that cannot be mixed up), [`observer`] (progress, and stopping the work), [`synthetic`] (scenes with truth).

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
