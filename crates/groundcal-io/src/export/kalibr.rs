//! `camchain.yaml`, as Kalibr writes and reads it.

use groundcal::{geometry::Lens, result::PixelCentre};

use crate::{
    error::IoError,
    export::{file::File, number::list, source::Source},
};

/// The file.
pub(crate) fn files(source: &Source) -> Result<Vec<File>, IoError> {
    Ok(vec![File::new("camchain.yaml", yaml(source))])
}

/// The file's text: one camera, pinhole with radtan or equidistant distortion. Kalibr counts pixels as we do; it has neither skew
/// nor k3.
fn yaml(source: &Source) -> String {
    let (c, k) = (&source.camera, &source.camera.intrinsics);
    let (model, coefficients, k3) = match c.lens {
        Lens::Fisheye(_) => ("equidistant", c.lens.parameters(), 0.0),
        _ => ("radtan", source.lens_parameters(["k1", "k2", "p1", "p2"]).to_vec(), source.lens_parameter("k3")),
    };
    let left_out = [("a skew", k.skew, " px"), ("a k3", k3, "")].into_iter().filter(|(_, value, _)| *value != 0.0);
    let left_out: String = left_out
        .map(|(what, value, unit)| format!("# {what} of {value}{unit} is left out: the format has none\n"))
        .collect();
    format!(
        "# {}\n{left_out}cam0:\n  cam_overlaps: []\n  camera_model: pinhole\n  distortion_coeffs: [{}]\n  distortion_model: {model}\n  \
         intrinsics: [{}]\n  resolution: [{}, {}]\n  rostopic: /cam0/image_raw\n",
        PixelCentre::TopLeftPixel,
        list(&coefficients),
        list(&[k.fx, k.fy, k.cx, k.cy]),
        c.size.width,
        c.size.height,
    )
}
