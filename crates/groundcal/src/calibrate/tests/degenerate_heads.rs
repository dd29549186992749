//! What a head without roll leaves open, in numbers (docs/theory.md, "What cannot be told"): pans at several elevations for the
//! rotating-camera method, and one motion under `fixed-pp`.

use crate::calibrate::calibrate_matches;
use crate::calibrate::{LensModel, MotionModel, Options};
use crate::error::Error;
use crate::geometry::constraint::Constraint;
use crate::geometry::frame::Frame;
use crate::geometry::intrinsics::Intrinsics;
use crate::observer::Silent;
use crate::pairs::correspondence::ImagePair;
use crate::pairs::refine::{HomographyEstimate, RefineOptions, refine};
use crate::result::camera::Method;
use crate::start::rotating_camera::{RotatingOptions, Weighting, calibrate_rotating};
use crate::synthetic::points::{MotionSpec, PointScene};

/// Pans of 20 degrees about a vertical axis through the optical centre, one at each elevation; 0.5 px, 200 matches, pixels square, the
/// principal point in the centre.
fn scene(elevations_deg: &[f64], roll_deg: f64, seed: u64) -> PointScene {
    let nominal = PointScene::nominal(seed);
    let [cx, cy] = nominal.size.centre_px();
    let motion = |deg: &f64| MotionSpec::about_axis(deg.to_radians(), roll_deg.to_radians(), 0.35, 0.0, 3.0);
    let motions = elevations_deg.iter().map(motion).collect();
    PointScene { intrinsics: Intrinsics::square(1000.0, cx, cy), motions, sigma_px: 0.5, ..nominal }
}

/// Stated deviations of (fx, fy, cx, cy), per cent of fx, of the rotating-camera method.
fn rotating(spread_deg: f64, constraint: Constraint) -> Result<[f64; 4], Error> {
    let scene = scene(&[45.0 - 0.5 * spread_deg, 45.0, 45.0 + 0.5 * spread_deg], 0.0, 1);
    let frame = Frame::new(scene.size, None);
    let homographies: Vec<HomographyEstimate> =
        (scene.pairs().iter()).map(|p| refine(&p.matches, None, &frame, &RefineOptions::default()).unwrap()).collect();
    let options = RotatingOptions { constraint, aspect: 1.0, weighting: Weighting::Covariance };
    let s = calibrate_rotating(&homographies, &options)?;
    Ok(std::array::from_fn(|i| 100.0 * s.covariance_px[(i, i)].sqrt() / s.intrinsics.fx))
}

#[test]
fn pans_without_roll_tell_aspect_and_cy_by_the_spread_of_their_elevations_alone() {
    assert!(matches!(rotating(0.0, Constraint::ZeroSkew), Err(Error::Undetermined { .. })));
    let mut before = f64::INFINITY;
    for (spread, least, most) in [(4.0, 8.0, 20.0), (10.0, 3.0, 10.0), (20.0, 1.5, 5.0), (36.0, 1.0, 4.0)] {
        let [zero_skew, square] = [Constraint::ZeroSkew, Constraint::Square].map(|c| rotating(spread, c).unwrap());
        // The axis a of a pan lies in the plane of y and z: ω + s b bᵀ, b = K⁻ᵀ a, moves fy / fx and cy together.
        let ratio = zero_skew[3] / square[3];
        assert!(ratio < before && (least..most).contains(&ratio), "{ratio}");
        assert!((zero_skew[2] / square[2] - 1.0).abs() < 0.1, "cx is known either way");
        before = ratio;
    }
    // With one elevation square pixels are enough.
    assert!(rotating(0.0, Constraint::Square).unwrap()[0] < 1.0);
}

/// Stated deviation of (fx, fy), per cent, of one motion under `fixed-pp`; `None`: refused.
fn one_motion(roll_deg: f64) -> Option<[f64; 2]> {
    let scene = scene(&[45.0], roll_deg, 1);
    let names = ["a", "b"].map(String::from);
    let pairs: Vec<ImagePair> = scene.pairs();
    let options = Options {
        method: Method::Linear,
        constraint: Constraint::FixedPrincipalPoint,
        motion: MotionModel::PlaneNormal,
        lens: LensModel::None,
        pairs: Some(vec![(0, 1)]),
        attitude_sigma_deg: Some(0.0),
        ..Options::default()
    };
    match calibrate_matches(&names, scene.size, &pairs, &options, &Silent) {
        Ok(c) => Some([c.standard_deviation.fx?, c.standard_deviation.fy?].map(|sd| sd / 10.0)),
        Err(error) => {
            assert!(error.is_degenerate(), "{error}");
            None
        }
    }
}

#[test]
fn one_motion_with_the_principal_point_held_needs_a_roll_between_0_and_90_degrees() {
    for roll in [0.0, 2.0, 5.0, 10.0, 20.0, 30.0, 45.0, 60.0, 70.0, 80.0, 85.0, 88.0, 90.0] {
        let sd = one_motion(roll);
        match sd {
            None => assert!(!(10.0..=80.0).contains(&roll), "{roll}"),
            Some(sd) => {
                assert!((2.0..=88.0).contains(&roll), "{roll}: an answer");
                assert!(sd.iter().all(|v| *v < 2.0) || !(20.0..=70.0).contains(&roll), "{roll}: {sd:?}");
            }
        }
    }
}
