//! The front door: from images, matches or homographies to a camera.
//!
//! One may enter at images ([`calibrate_images`], or with matches [`calibrate_matched_images`]), matches ([`calibrate_matches`]),
//! homographies ([`calibrate_homographies`]) or circular points ([`calibrate_circular_points`]). All but the last go the way of
//! `driver.rs`, which reads as the program.

mod attitude;
mod checks;
mod copies;
mod departures;
mod driver;
pub(crate) mod earlier;
mod evidence;
mod fisheye;
mod general;
mod joint;
mod lens;
mod lens_result;
mod names;
mod options;
mod order;
mod outcome;
mod outlier_frames;
mod plane_normal;
mod prior_conflicts;
mod published;
mod refinement;
mod refinement_input;
mod rotating;
mod setup;
mod solved;
mod soundness;
mod source;
mod stage_options;
mod turning;
mod views;

pub use earlier::priors_of;

use nalgebra::{Complex, Vector3};

use crate::{
    error::Error,
    geometry::size::ImageSize,
    ids::ImageId,
    pairs::{
        circular_points::{CircularPoint, MotionGeometry},
        correspondence::ImagePair,
        refine::HomographyEstimate,
    },
    result::Calibration,
    select::attitude_groups::{HorizonSides, Motion},
    start::linear_camera::{CameraSolution, solve_camera},
    vision::{features::FeatureOptions, image::GrayImage},
};

pub use crate::observer::Observer;
pub use crate::observer::Silent;
pub use crate::observer::Stage;
pub use crate::pairs::pair_lens::RadialCorrection;
pub use options::{FeatureDensity, HomographyFit, LensModel, Method, MotionModel, Options};

/// Calibrates from photographs of the floor, all of one size, by one camera at one zoom. What stands still in all of them is set aside
/// before (see [`crate::vision::still`]); the observer hears of it, and the calibration has it among its warnings.
///
/// # Errors
/// See [`Error`].
pub fn calibrate_images(
    names: &[String],
    images: &[GrayImage],
    options: &Options,
    observer: &dyn Observer,
) -> Result<Calibration, Error> {
    let prepared = source::from_images(names, images, options, observer)?;
    let with =
        |features: &FeatureOptions| driver::run(prepared.matched(features, options, observer)?, options, observer);
    if options.feature_density == FeatureDensity::Dense || !options.match_patches {
        return with(&options.features);
    }
    let first = with(&options.features.coarse());
    let suffices =
        |answer: &Calibration| is_carried_by_patches(answer) && answer.views.len() == prepared.images_compared();
    if matches!(first, Err(Error::Stopped)) || first.as_ref().is_ok_and(suffices) {
        return first;
    }
    match (with(&options.features), first) {
        (Err(error), Ok(_)) if error == Error::Stopped => Err(error),
        (Err(_), Ok(first)) => Ok(first),
        (dense, _) => dense,
    }
}

/// Whether features only led to the answer: all of its motions were matched again patch by patch.
fn is_carried_by_patches(calibration: &Calibration) -> bool {
    let used = calibration.motions.iter().zip(&calibration.evidence.pairs).filter(|(motion, _)| motion.used);
    used.map(|(_, pair)| pair).all(|pair| pair.matches.iter().any(|m| m.patch))
}

/// Calibrates from photographs as [`calibrate_images`] does, from matches between them that are there already: another
/// matcher's, or the same for several calibrations. The floor of the motions found is matched again patch by patch all the same, and
/// matches of what stands still in all images, or what their masks leave out, are not used.
///
/// # Errors
/// See [`Error`].
pub fn calibrate_matched_images(
    names: &[String],
    images: &[GrayImage],
    pairs: &[ImagePair],
    options: &Options,
    observer: &dyn Observer,
) -> Result<Calibration, Error> {
    driver::run(source::from_matched_images(names, images, pairs, options, observer)?, options, observer)
}

/// Calibrates from point matches; `names` gives a name for each image index used by the pairs.
///
/// # Errors
/// See [`Error`].
pub fn calibrate_matches(
    names: &[String],
    size: ImageSize,
    pairs: &[ImagePair],
    options: &Options,
    observer: &dyn Observer,
) -> Result<Calibration, Error> {
    driver::run(source::from_matches(names, size, pairs, options)?, options, observer)
}

/// Calibrates from homographies (pixels of `from` to pixels of `to`) with covariance, all of them plane-normal motions.
/// The distortion of the options must be none: it cannot be undone in a homography.
///
/// # Errors
/// See [`Error`].
pub fn calibrate_homographies(
    names: &[String],
    size: ImageSize,
    homographies: &[(usize, usize, HomographyEstimate)],
    options: &Options,
) -> Result<Calibration, Error> {
    driver::run(source::from_homographies(names, size, homographies, options)?, options, &Silent)
}

/// The camera from circular points alone, given in pixels (any non-zero multiple) with the standard deviation of each
/// point's direction in frame coordinates.
///
/// # Errors
/// See [`Error`].
pub fn calibrate_circular_points(
    size: ImageSize,
    points: &[(Vector3<Complex<f64>>, f64)],
    options: &Options,
) -> Result<CameraSolution, Error> {
    options.validate(size)?;
    let frame = options.frame(size);
    let to_frame = frame.frame_matrix().map(|x| Complex::new(x, 0.0));
    let motions: Vec<Motion> = points
        .iter()
        .enumerate()
        .map(|(i, (point, sigma))| {
            let circular_point = CircularPoint::from_point(to_frame * point, *sigma).ok_or_else(|| {
                Error::InvalidInput(format!(
                    "circular point {i} is zero, real or not finite, or its sigma not positive"
                ))
            })?;
            let geometry = MotionGeometry {
                circular_point,
                rotation_rad: 0.0,
                rotation_sigma_rad: 0.0,
                height_ratio: 1.0,
                height_ratio_sigma: 0.0,
            };
            Ok(Motion { from: ImageId::new(2 * i), to: ImageId::new(2 * i + 1), geometry, sides: HorizonSides::One })
        })
        .collect::<Result<_, Error>>()?;
    solve_camera(&motions, &frame, &options.camera(size))
}
