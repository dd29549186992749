//! A camera from homographies found elsewhere: `cargo run --release --example from_homographies`
//!
//! Each homography maps pixels of the first view of a plane to pixels of the second, the camera having turned about an axis
//! normal to the plane (and moved, if it liked) in between.

use groundcal::{
    Options, calibrate_homographies, geometry::Frame, pairs::HomographyEstimate, start::Constraint,
    synthetic::PointScene,
};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let scene = PointScene::nominal(0);
    let frame = Frame::new(scene.size, None);
    // Without a covariance of their own all count the same.
    let homographies: Vec<(usize, usize, HomographyEstimate)> = (0..scene.motions.len())
        .filter_map(|i| {
            let h = scene.homography(i)?;
            Some((2 * i, 2 * i + 1, HomographyEstimate::from_pixels(&h.into(), None, frame, 200).ok()?))
        })
        .collect();
    let names: Vec<String> = (0..2 * homographies.len()).map(|i| format!("view {i}")).collect();
    let options = Options { constraint: Constraint::ZeroSkew, attitude_sigma_deg: Some(0.0), ..Options::default() };
    let calibration = calibrate_homographies(&names, scene.size, &homographies, &options)?;
    let (found, truth) = (&calibration.camera, &scene.intrinsics);
    println!("found  fx {:.4}  fy {:.4}  cx {:.4}  cy {:.4}", found.fx, found.fy, found.cx, found.cy);
    println!("truth  fx {:.4}  fy {:.4}  cx {:.4}  cy {:.4}", truth.fx, truth.fy, truth.cx, truth.cy);
    Ok(())
}
