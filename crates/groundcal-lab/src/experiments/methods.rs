//! The methods that the experiments compare, each giving errors against the scene's exact camera.
//!
//! - *linear*: the paper's. Robust homographies of the matched features, their imaged circular points e, and eᵀ ω e = 0 of all
//!   motions with weight one (KZR 1.1). Its deviation: the points' covariances carried through that solution.
//! - *rotating camera*: Hᵀ ω H = ω of the same homographies (Hartley 1994).
//! - *groundcal*: the program's own, from the pictures or the matches.

use groundcal::{
    Error, Options, Remedy, Silent, calibrate_matched_images,
    geometry::{Frame, Intrinsics},
    pairs::{HomographyEstimate, ImagePair, PointMatch, ideal_match, robust_homography, shows_turn},
    result::{Calibration, Method, Parameter},
    start::{Constraint, closed_form},
    vision::GrayImage,
};
use rayon::prelude::*;

/// A number of the camera: its error against truth and the stated standard deviation, both in per cent.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Score {
    /// Error. Of the focal length (along x, of itself) and the aspect ratio (fy / fx, of itself) with its sign; of the principal
    /// point its distance from the truth, of the focal length.
    pub(crate) error: f64,
    /// `None`: the constraint holds the number.
    pub(crate) sd: Option<f64>,
}

/// A camera against the truth.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Scores {
    pub(crate) focal: Score,
    pub(crate) aspect: Score,
    pub(crate) principal_point: Score,
}

impl Scores {
    /// `covariance` is that of (fx, fy, cx, cy) in pixels squared.
    fn new(
        truth: &Intrinsics,
        k: &Intrinsics,
        constraint: Constraint,
        covariance: impl Fn(usize, usize) -> f64,
    ) -> Self {
        let free = constraint.free();
        // Not a number: an error without bound times zero.
        let root = |v: f64| if v.is_nan() { f64::INFINITY } else { 100.0 * v.max(0.0).sqrt() };
        let aspect_variance =
            covariance(0, 0) / k.fx.powi(2) + covariance(1, 1) / k.fy.powi(2) - 2.0 * covariance(0, 1) / (k.fx * k.fy);
        Self {
            focal: Score { error: 100.0 * (k.fx / truth.fx - 1.0), sd: Some(root(covariance(0, 0)) / k.fx) },
            aspect: Score {
                error: 100.0 * ((k.fy / k.fx) / (truth.fy / truth.fx) - 1.0),
                sd: free[1].then(|| root(aspect_variance)),
            },
            principal_point: Score {
                error: 100.0 * (k.cx - truth.cx).hypot(k.cy - truth.cy) / truth.fx,
                sd: free[2].then(|| root(covariance(2, 2) + covariance(3, 3)) / k.fx),
            },
        }
    }

    pub(crate) fn of_calibration(truth: &Intrinsics, c: &Calibration, constraint: Constraint) -> Self {
        Self::new(truth, &c.camera.model().intrinsics, constraint, |i, j| {
            c.covariance.get(Parameter::ALL[i], Parameter::ALL[j])
        })
    }
}

/// A homography a motion from the matched features of its two pictures.
pub(crate) struct Measured {
    pub(crate) homographies: Vec<HomographyEstimate>,
    /// Those that show a turn.
    pub(crate) motions: Vec<HomographyEstimate>,
    /// Fewest and most inliers of a motion.
    pub(crate) matches: [usize; 2],
}

/// Robust homographies of matches, and those of them that show a turn above their noise.
///
/// # Errors
/// That of the first motion without a homography; [`Error::NoUsableMotion`] when none shows a turn.
pub(crate) fn measure(pairs: &[ImagePair], frame: Frame, options: &Options) -> Result<Measured, Error> {
    let all: Vec<HomographyEstimate> = pairs
        .par_iter()
        .enumerate()
        .map(|(i, pair)| robust_homography(&pair.matches, &frame, &options.robust, options.seed ^ i as u64))
        .collect::<Result<_, Error>>()?;
    let mut out = Measured { homographies: Vec::new(), motions: Vec::new(), matches: [usize::MAX, 0] };
    for homography in all {
        let matches = homography.matches;
        out.motions.extend(Some(&homography).filter(|h| shows_turn(h)).cloned());
        out.homographies.push(homography);
        out.matches = [out.matches[0].min(matches), out.matches[1].max(matches)];
    }
    if out.motions.is_empty() {
        return Err(Error::NoUsableMotion {
            pairs: pairs.len(),
            reason: "none shows a turn above its noise".into(),
            remedies: vec![Remedy::MoreMatches, Remedy::TurnFurther],
        });
    }
    Ok(out)
}

/// The paper's linear method.
///
/// # Errors
/// See [`closed_form`].
pub(crate) fn linear(measured: &Measured, truth: &Intrinsics, constraint: Constraint) -> Result<Scores, Error> {
    let s = closed_form(Method::Kzr, &measured.motions, constraint, 1.0)?;
    Ok(Scores::new(truth, &s.intrinsics, constraint, |i, j| s.covariance_px[(i, j)]))
}

/// The rotating-camera method as Hartley has it, every equation with weight one.
///
/// # Errors
/// See [`closed_form`].
pub(crate) fn rotating(measured: &Measured, truth: &Intrinsics, constraint: Constraint) -> Result<Scores, Error> {
    let s = closed_form(Method::Rotating, &measured.homographies, constraint, 1.0)?;
    Ok(Scores::new(truth, &s.intrinsics, constraint, |i, j| s.covariance_px[(i, j)]))
}

/// The program's own method.
///
/// # Errors
/// Those of [`calibrate_matched_images`].
pub(crate) fn groundcal(
    names: &[String],
    images: &[GrayImage],
    pairs: &[ImagePair],
    options: &Options,
    truth: &Intrinsics,
) -> Result<(Scores, Calibration), Error> {
    let c = calibrate_matched_images(names, images, pairs, options, &Silent)?;
    Ok((Scores::of_calibration(truth, &c, options.constraint), c))
}

/// Matches as a camera without distortion would have seen them.
pub(crate) fn undistorted(pairs: &[ImagePair], c: &Calibration) -> Vec<ImagePair> {
    let camera = c.camera.model();
    let undone = |m: &PointMatch| ideal_match(&camera, m);
    pairs.iter().map(|p| ImagePair { matches: p.matches.iter().filter_map(undone).collect(), ..*p }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use groundcal::synthetic::PointScene;

    #[test]
    fn the_predicted_deviation_of_the_linear_method_is_that_of_its_errors() {
        // 120 draws of noise: the rms of error over prediction has a sampling error of 6 %.
        const TRIALS: u64 = 120;
        for constraint in [Constraint::Focal, Constraint::Square, Constraint::ZeroSkew] {
            let mut sum = [0.0; 3];
            for seed in 0..TRIALS {
                let mut scene = PointScene::nominal(seed);
                let [cx, cy] = scene.size.centre_px();
                scene.intrinsics = Intrinsics::square(1000.0, cx, cy);
                scene.sigma_px = 0.5;
                let pairs: Vec<ImagePair> = scene.pairs();
                let frame = Frame::new(scene.size, None);
                let measured = measure(&pairs, frame, &Options { seed, ..Options::default() }).unwrap();
                let s = linear(&measured, &scene.intrinsics, constraint).unwrap();
                for (total, score) in sum.iter_mut().zip([s.focal, s.aspect, s.principal_point]) {
                    *total += score.sd.map_or(1.0, |sd| (score.error / sd).powi(2)) / TRIALS as f64;
                }
            }
            for square in sum {
                assert!((0.8..1.2).contains(&square.sqrt()), "{constraint:?}: {sum:?}");
            }
        }
    }
}
