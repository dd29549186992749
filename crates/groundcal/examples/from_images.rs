//! A camera from floor photographs: `cargo run --release --example from_images -- examples/tripod/*.jpg`
//!
//! The library takes grey pixels; any decoder will do.

use groundcal::{Options, Silent, calibrate_images, geometry::ImageSize, vision::GrayImage};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut names: Vec<String> = std::env::args().skip(1).collect();
    if names.is_empty() {
        let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../examples/tripod");
        let files = std::fs::read_dir(folder)?.filter_map(|entry| Some(entry.ok()?.path().to_str()?.to_string()));
        names = files.filter(|name| name.ends_with(".jpg")).collect();
        names.sort();
    }
    let mut images = Vec::new();
    for name in &names {
        let grey = image::open(name)?.into_luma16();
        let size = ImageSize::new(grey.width() as usize, grey.height() as usize);
        let values = grey.into_raw().into_iter().map(|v| f32::from(v) / 65535.0).collect();
        images.push(GrayImage::from_rows(size, values).ok_or("wrong number of pixels")?);
    }
    let calibration = calibrate_images(&names, &images, &Options::default(), &Silent)?;
    let (camera, sd) = (&calibration.camera, &calibration.standard_deviation);
    println!(
        "fx {:.2} +- {:.2}   fy {:.2} +- {:.2} px",
        camera.fx,
        sd.fx.unwrap_or(0.0),
        camera.fy,
        sd.fy.unwrap_or(0.0)
    );
    println!(
        "cx {:.2} +- {:.2}   cy {:.2} +- {:.2} px",
        camera.cx,
        sd.cx.unwrap_or(0.0),
        camera.cy,
        sd.cy.unwrap_or(0.0)
    );
    for motion in calibration.motions.iter().filter(|m| m.used) {
        println!(
            "{} -> {}: turned {:+.2} degrees, {} matches, rms {:.2} px",
            motion.from,
            motion.to,
            motion.rotation_deg.unwrap_or(f64::NAN),
            motion.matches,
            motion.rms_px.unwrap_or(f64::NAN)
        );
    }
    Ok(())
}
