//! How well do views that moved in any way before a plane tell the focal length (Triggs 1998)? Error against the number of views, and against
//! the spread of their tilts, beside plane-normal motions of as many pictures.
//!
//! A square of points fills most of each picture; the camera is tilted towards any side, turned about its axis by any angle. The motions beside
//! them are the nominal ones of the other studies (15 degrees about an axis 0.2 m away, three attitudes or more), two pictures each.

use groundcal::{
    LensModel, MotionModel, Options, Silent, calibrate_matches,
    geometry::{Constraint, ImageSize, Intrinsics},
    pairs::ImagePair,
    synthetic::{MotionSpec, PlaneViewScene, PointScene},
};

/// Numbers of views.
pub const VIEWS: [usize; 7] = [3, 4, 5, 6, 8, 10, 15];
/// Largest tilt there, degrees.
pub const TILT_DEG: f64 = 50.0;
/// Largest tilts where those are varied, degrees; the least is none.
pub const TILTS_DEG: [f64; 7] = [5.0, 10.0, 15.0, 20.0, 30.0, 40.0, 50.0];
/// Number of views there.
pub const SOME_VIEWS: usize = 6;
/// Standard deviation of each image coordinate, pixels.
pub const NOISE_PX: f64 = 0.3;
/// Points of the plane, and matches of each motion.
pub const POINTS: usize = 100;

/// What a trial is made with.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Setup {
    /// Pictures.
    pub views: usize,
    /// Largest angle between the optical axis and the plane's normal, degrees.
    pub tilt_deg: f64,
    /// Points of the plane.
    pub points: usize,
    /// Image.
    pub size: ImageSize,
    /// Standard deviation of each image coordinate, pixels.
    pub noise_px: f64,
}

/// A curve.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Method {
    /// Views from anywhere.
    General,
    /// Plane-normal motions of as many pictures.
    PlaneNormal,
    /// Cramér-Rao bound of the views from anywhere.
    Bound,
}

impl Method {
    /// All of them.
    pub const ALL: [Method; 3] = [Method::General, Method::PlaneNormal, Method::Bound];

    /// The name used in files.
    pub fn name(self) -> &'static str {
        match self {
            Method::General => "general",
            Method::PlaneNormal => "plane_normal",
            Method::Bound => "cramer_rao_bound",
        }
    }
}

/// Pitch and roll of the motions beside the views, degrees.
const ATTITUDES_DEG: [[f64; 2]; 7] =
    [[50.0, 0.0], [40.0, 30.0], [60.0, -40.0], [45.0, 15.0], [55.0, -20.0], [35.0, -35.0], [65.0, 25.0]];

/// Relative errors of fx, in the order of [`Method::ALL`] (the last: the bound's relative standard deviation); `None`: no camera.
pub fn trial(setup: &Setup, seed: u64, number: u64) -> [Option<f64>; 3] {
    let seed = seed.wrapping_mul(1_000_003).wrapping_add(number);
    let f = setup.size.width as f64 / 1.28;
    let centre = setup.size.centre_px();
    let intrinsics = Intrinsics::square(f, centre[0], centre[1]);
    let scene = PlaneViewScene {
        intrinsics,
        size: setup.size,
        views: setup.views,
        tilt_deg: [0.0, setup.tilt_deg],
        points: setup.points,
        sigma_px: setup.noise_px,
        ..PlaneViewScene::nominal(seed)
    };
    let calibrated = |images: usize, pairs: &[ImagePair], motion: MotionModel| {
        let options = Options { motion, constraint: Constraint::ZeroSkew, lens: LensModel::None, ..Options::default() };
        let names: Vec<String> = (0..images).map(|i| i.to_string()).collect();
        let c = calibrate_matches(&names, setup.size, pairs, &options, &Silent).ok()?;
        Some(c.camera.fx / f - 1.0).filter(|e: &f64| e.is_finite())
    };
    Method::ALL.map(|method| match method {
        Method::General => calibrated(setup.views, &scene.pairs(), MotionModel::General),
        Method::PlaneNormal => {
            let motions: Vec<MotionSpec> = ATTITUDES_DEG
                .iter()
                .take(setup.views / 2)
                .map(|[pitch, roll]| {
                    MotionSpec::about_axis(pitch.to_radians(), roll.to_radians(), 15f64.to_radians(), 0.2, 3.0)
                })
                .collect();
            let scene = PointScene {
                intrinsics,
                size: setup.size,
                matches: setup.points,
                sigma_px: setup.noise_px,
                motions,
                ..PointScene::nominal(seed)
            };
            let pairs: Vec<ImagePair> = scene.pairs();
            calibrated(2 * scene.motions.len(), &pairs, MotionModel::PlaneNormal)
        }
        Method::Bound => Some(scene.bound(Constraint::ZeroSkew)?[(0, 0)].sqrt() / f),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn more_views_and_more_tilt_tell_more_and_the_bound_is_reached() {
        let size = ImageSize::new(1280, 960);
        let of = |views: usize, tilt_deg: f64| {
            let setup = Setup { views, tilt_deg, points: POINTS, size, noise_px: NOISE_PX };
            let all: Vec<[Option<f64>; 3]> = (0..24).map(|n| trial(&setup, 4, n)).collect();
            // The scale of a bound is its median: a few scenes tell next to nothing.
            let median = |method: usize| {
                let mut errors: Vec<f64> = all.iter().map(|t| t[method].map_or(f64::INFINITY, f64::abs)).collect();
                errors.sort_by(f64::total_cmp);
                errors[errors.len() / 2]
            };
            [median(0), median(2)]
        };
        let (few, many, flat) = (of(5, 50.0), of(10, 50.0), of(6, 10.0));
        assert!(many[0] < few[0] && many[0] < flat[0], "{few:?} {many:?} {flat:?}");
        for [error, bound] in [few, many] {
            assert!(error < 1.4 * bound, "{error} {bound}");
        }
    }
}
