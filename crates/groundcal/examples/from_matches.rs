//! A camera from point matches: `cargo run --release --example from_matches`
//!
//! Matches of floor points, wrong ones among them, for pairs of images; which pairs are plane-normal motions is found.

use groundcal::{Options, Silent, calibrate_matches, pairs::ImagePair, synthetic::PointScene};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let scene = PointScene { outlier_fraction: 0.3, matches: 300, ..PointScene::nominal(0) };
    let pairs: Vec<ImagePair> = scene.pairs();
    let names: Vec<String> = (0..2 * pairs.len()).map(|i| format!("view {i}")).collect();
    let calibration = calibrate_matches(&names, scene.size, &pairs, &Options::default(), &Silent)?;
    let (camera, sd) = (&calibration.camera, &calibration.standard_deviation);
    println!("fx {:.1} +- {:.1} px (truth {})", camera.fx, sd.fx.unwrap_or(0.0), scene.intrinsics.fx);
    println!("cy {:.1} +- {:.1} px (truth {})", camera.cy, sd.cy.unwrap_or(0.0), scene.intrinsics.cy);
    for warning in &calibration.warnings {
        println!("warning [{}] {warning}", warning.code());
    }
    Ok(())
}
