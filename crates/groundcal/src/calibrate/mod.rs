//! The front door: from images, matches or homographies to a camera.
//!
//! One may enter at images ([`calibrate_images`], or with matches [`calibrate_matched_images`]), matches ([`calibrate_matches`]),
//! homographies ([`calibrate_homographies`]) or circular points ([`calibrate_circular_points`]). All but the last go the way of
//! `driver.rs`, which reads as the program.

mod attitude;
mod checks;
mod copies;
mod departures;
mod doubts;
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
mod row_turn;
mod setup;
mod solved;
mod soundness;
mod source;
mod stage_options;
mod stated_noise;
mod transferred;
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
    start::{closed_forms::LinearCamera, linear_camera::solve_camera},
    vision::{features::FeatureOptions, image::GrayImage},
};

pub(crate) use crate::observer::Observer;
pub(crate) use crate::observer::Silent;
pub use crate::pairs::pair_lens::RadialCorrection;
pub use options::{FeatureDensity, HomographyFit, LensModel, MotionModel, Options};

/// Matches of the features of pairs of images, as [`calibrate_images`] finds them: to look at, or to be joined with matches of your own. What
/// stands still in all images is set aside before, and the observer hears of it.
///
/// # Errors
/// [`Error::InvalidOption`] for pairs that do not name two of the images; [`Error::Stopped`].
///
/// # Examples
/// ```
/// use groundcal::{GrayImage, ImageSize, Options, Silent, match_images};
/// // Pictures without texture have no features.
/// let images = vec![GrayImage::filled(ImageSize::new(320, 240), 0.5); 2];
/// let pairs = match_images(&images, &[(0, 1)], &Options::default(), &Silent)?;
/// assert_eq!((pairs[0].from, pairs[0].to, pairs[0].matches.len()), (0, 1, 0));
/// # Ok::<(), groundcal::Error>(())
/// ```
pub fn match_images(
    images: &[GrayImage],
    pairs: &[(usize, usize)],
    options: &Options,
    observer: &dyn Observer,
) -> Result<Vec<ImagePair>, Error> {
    source::matches_of_images(images, pairs, options, observer)
}

/// Calibrates from photographs of the floor, all of one size, by one camera at one zoom. What stands still in all of them is set aside
/// before (see `still`); the observer hears of it, and the calibration has it among its warnings.
///
/// # Errors
/// See [`Error`].
///
/// # Examples
/// ```
/// use groundcal::{GrayImage, ImageSize, Options, Silent, calibrate_images};
/// // Pictures without texture have no features: the error says so.
/// let images = vec![GrayImage::filled(ImageSize::new(320, 240), 0.5); 3];
/// let names: Vec<String> = ["a.jpg", "b.jpg", "c.jpg"].map(String::from).to_vec();
/// let error = calibrate_images(&names, &images, &Options::default(), &Silent).expect_err("nothing to see");
/// assert!(!error.remedies().is_empty() || !error.to_string().is_empty());
/// ```
pub fn calibrate_images(
    names: &[String],
    images: &[GrayImage],
    options: &Options,
    observer: &dyn Observer,
) -> Result<Calibration, Error> {
    let prepared = source::from_images(names, images, options, observer)?;
    let with =
        |features: &FeatureOptions| driver::run(prepared.matched(features, options, observer)?, options, observer);
    if options.feature_density == FeatureDensity::Dense || !options.has_patches() {
        return with(&options.features());
    }
    let first = with(&options.features().coarse());
    let suffices =
        |answer: &Calibration| is_carried_by_patches(answer) && answer.views.len() >= prepared.images_expected();
    if matches!(first, Err(Error::Stopped)) || first.as_ref().is_ok_and(suffices) {
        return first;
    }
    match (with(&options.features()), first) {
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
///
/// # Examples
/// ```
/// use groundcal::{Error, GrayImage, ImageSize, Options, Silent, calibrate_matched_images};
/// // As many names as images are asked for.
/// let images = vec![GrayImage::filled(ImageSize::new(320, 240), 0.5); 2];
/// let refused = calibrate_matched_images(&["a.jpg".into()], &images, &[], &Options::default(), &Silent);
/// assert!(matches!(refused, Err(Error::InvalidInput(_))));
/// ```
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
///
/// # Examples
/// ```
/// use groundcal::{ImagePair, Options, Silent, calibrate_matches, synthetic::PointScene};
/// let scene = PointScene::nominal(0);
/// let pairs: Vec<ImagePair> = scene.pairs();
/// let names: Vec<String> = (0..6).map(|i| format!("view {i}")).collect();
/// let calibration = calibrate_matches(&names, scene.size, &pairs, &Options::default(), &Silent)?;
/// assert!((calibration.camera.fx - 1000.0).abs() < 20.0);
/// # Ok::<(), groundcal::Error>(())
/// ```
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
///
/// # Examples
/// ```
/// use groundcal::{HomographyEstimate, Options, calibrate_homographies, geometry::Frame, synthetic::PointScene};
/// let scene = PointScene::nominal(0);
/// let frame = Frame::new(scene.size, None);
/// let homography = |i: usize| {
///     let h = scene.homography(i)?;
///     Some((2 * i, 2 * i + 1, HomographyEstimate::from_pixels(&h.into(), None, frame, 200).ok()?))
/// };
/// let homographies: Vec<_> = (0..scene.motions.len()).filter_map(homography).collect();
/// let names: Vec<String> = (0..2 * homographies.len()).map(|i| format!("view {i}")).collect();
/// let options = Options { attitude_sigma_deg: Some(0.0), ..Options::default() };
/// let calibration = calibrate_homographies(&names, scene.size, &homographies, &options)?;
/// assert!((calibration.camera.fx - scene.intrinsics.fx).abs() < 1.0);
/// # Ok::<(), groundcal::Error>(())
/// ```
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
///
/// # Examples
/// ```
/// use groundcal::{ImageSize, Intrinsics, Options, calibrate_circular_points};
/// use groundcal::nalgebra::{Complex, Rotation3, Vector3};
/// // K A (1, i, 0) of three attitudes A.
/// let k = Intrinsics::square(1000.0, 639.5, 479.5).matrix().map(|x| Complex::new(x, 0.0));
/// let point = |pitch: f64, roll: f64| {
///     let a = (Rotation3::from_axis_angle(&Vector3::z_axis(), roll) * Rotation3::from_axis_angle(&Vector3::x_axis(), pitch)).into_inner();
///     k * a.map(|x| Complex::new(x, 0.0)) * Vector3::new(Complex::new(1.0, 0.0), Complex::new(0.0, 1.0), Complex::new(0.0, 0.0))
/// };
/// let points: Vec<_> = [(2.2, 0.0), (2.4, 0.6), (2.0, -0.5)].map(|(pitch, roll)| (point(pitch, roll), 1e-4)).to_vec();
/// let options = Options { attitude_sigma_deg: Some(0.0), ..Options::default() };
/// let camera = calibrate_circular_points(ImageSize::new(1280, 960), &points, &options)?;
/// assert!((camera.intrinsics.fx - 1000.0).abs() < 1.0);
/// # Ok::<(), groundcal::Error>(())
/// ```
pub fn calibrate_circular_points(
    size: ImageSize,
    points: &[(Vector3<Complex<f64>>, f64)],
    options: &Options,
) -> Result<LinearCamera, Error> {
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
    let found = solve_camera(&motions, &frame, &options.camera(size))?;
    Ok(LinearCamera { intrinsics: found.intrinsics, covariance_px: found.covariance_px })
}

#[cfg(test)]
mod tests;
