//! Calibrates a camera from the floor it looks at: from pictures of a floor between which the camera turned about an axis normal to
//! it, to the camera matrix, lens and attitudes, with an error bar on every number. Nothing else in the scene has to be known.
//!
//! ```
//! use groundcal::{Constraint, ImagePair, Options, Parameter, Silent, calibrate_matches, synthetic::PointScene};
//!
//! // Point matches of three motions; from your own matcher in earnest.
//! let scene = PointScene::nominal(0);
//! let pairs: Vec<ImagePair> = scene.pairs();
//! let names: Vec<String> = (0..6).map(|i| format!("view {i}")).collect();
//!
//! let options = Options { constraint: Constraint::ZeroSkew, ..Options::default() };
//! let calibration = calibrate_matches(&names, scene.size, &pairs, &options, &Silent)?;
//!
//! let fx = calibration.value(Parameter::Fx);
//! let sigma = calibration.standard_deviation(Parameter::Fx).expect("estimated");
//! assert!((fx - 1000.0).abs() < 4.0 * sigma);
//! # Ok::<(), groundcal::Error>(())
//! ```
//!
//! # Where to begin
//!
//! | You have | Call | with |
//! |---|---|---|
//! | pictures | [`calibrate_images`] | [`GrayImage`], with a [`Mask`] where parts are to be left out |
//! | pictures, and matches of your own | [`calibrate_matched_images`] | [`GrayImage`], [`ImagePair`] |
//! | matches, or tracks as pairs | [`calibrate_matches`] | [`ImagePair`], [`PointMatch`] |
//! | homographies with covariance | [`calibrate_homographies`] | [`HomographyEstimate`] |
//! | circular points | [`calibrate_circular_points`] | complex vectors |
//!
//! All take [`Options`] (what is known beforehand: [`Constraint`], [`LensModel`], [`MotionModel`], priors) and an [`Observer`] ([`Silent`]: none),
//! and give a [`Calibration`] or an [`Error`] that carries numbers and each [`Remedy`] that may help. [`Calibration::verdict`] says whether
//! to trust it, [`Calibration::warnings`] what to doubt.
//!
//! With a calibration: [`FloorView`] maps pixels to the floor and back, [`placed`] says where each picture was taken, [`MeasuringView`] gives
//! points and distances with error bars, [`rectify_image`] a picture of the floor from above, [`Undistortion`] the images as an ideal lens
//! would have taken them.
//!
//! # Conventions
//!
//! Pixel (0, 0) is the centre of the top-left pixel. Camera coordinates: x right, y down, z forward. The floor is Z = 0, Z up. `h_b_from_a` maps
//! points of a to points of b. Angles are radians, or their names end in `_deg`; lengths are in units of the camera's height until
//! [`Calibration::with_camera_height`] says what that is. Matrices and vectors are those of [`nalgebra`], which is exported here.
//!
//! This crate neither opens files nor prints, and runs in WebAssembly; `groundcal-io` reads and writes files (`calibrate_folder`),
//! `groundcal-report` makes text and figures. The feature `synthetic` adds [scenes with truth](https://docs.rs/groundcal) and plans of pictures.
//!
//! # Inside
//!
//! The folders are stages, in the order of the way: `vision`, `pairs`, `select`, `start`, `refine`, `calibrate`, `result`; `geometry` and `numerics` below
//! all. Those that are not documented here are public for the sibling crates and may change without a line in the changelog.

#![forbid(unsafe_code)]
#![deny(clippy::print_stdout, clippy::print_stderr)]

pub(crate) mod calibrate;
pub(crate) mod error;
pub mod floor;
pub mod geometry;
pub(crate) mod ids;
pub(crate) mod named;
#[doc(hidden)]
pub mod numerics;
pub(crate) mod observer;
#[doc(hidden)]
pub mod pairs;
#[cfg(feature = "synthetic")]
pub mod plan;
pub(crate) mod refine;
pub(crate) mod remedy;
pub mod result;
pub(crate) mod select;
#[doc(hidden)]
pub mod start;
#[cfg(feature = "synthetic")]
pub mod synthetic;
pub mod vision;

pub use nalgebra;

#[doc(inline)]
pub use crate::{
    calibrate::{
        FeatureDensity, HomographyFit, LensModel, MotionModel, Options, RadialCorrection, calibrate_circular_points,
        calibrate_homographies, calibrate_images, calibrate_matched_images, calibrate_matches, match_images, priors_of,
    },
    error::Error,
    floor::{FloorGrid, FloorView, MeasuringView, Placed, Undistortion, placed, rectify_image},
    geometry::{Camera, Constraint, Fisheye, Homography, ImageSize, Intrinsics, Lens, Radtan},
    observer::{Observer, Silent, Stage},
    pairs::{HomographyEstimate, ImagePair, PointMatch},
    remedy::{Plain, Remedy, Wording, either},
    result::{Calibration, Covariance, Method, Parameter, PriorParameter, Verdict, VerdictLevel, Warning},
    start::{GivenPrior, LinearCamera},
    vision::{GrayImage, Mask},
};

/// The commands and the code of the README, so that they are compiled.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
