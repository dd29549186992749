//! `camera_info.yaml`, as ROS's camera_info_manager and camera_calibration_parsers read it.

use groundcal::{geometry::Lens, result::PixelCentre};

use crate::{
    error::IoError,
    export::{
        file::File,
        number::{camera_matrix, list},
        source::Source,
    },
};

/// The file.
pub(crate) fn files(source: &Source) -> Result<Vec<File>, IoError> {
    Ok(vec![File::new("camera_info.yaml", yaml(source))])
}

/// The file's text. ROS counts pixels as we do. A camera by itself is rectified by the identity, and its projection matrix is
/// [K | 0]: the rectified image has the camera matrix of the raw one.
fn yaml(source: &Source) -> String {
    let (c, k) = (&source.camera, &source.camera.intrinsics);
    let matrix = |name: &str, rows: usize, columns: usize, data: &[f64]| {
        format!("{name}:\n  rows: {rows}\n  cols: {columns}\n  data: [{}]\n", list(data))
    };
    let (model, coefficients) = match c.lens {
        Lens::Fisheye(_) => ("equidistant", c.lens.parameters()),
        _ => ("plumb_bob", source.lens_parameters(["k1", "k2", "p1", "p2", "k3"]).to_vec()),
    };
    let projection = [k.fx, k.skew, k.cx, 0.0, 0.0, k.fy, k.cy, 0.0, 0.0, 0.0, 1.0, 0.0];
    [
        format!("# {}\n", PixelCentre::TopLeftPixel),
        format!("image_width: {}\nimage_height: {}\ncamera_name: camera\n", c.size.width, c.size.height),
        matrix("camera_matrix", 3, 3, &camera_matrix(k)),
        format!("distortion_model: {model}\n"),
        matrix("distortion_coefficients", 1, coefficients.len(), &coefficients),
        matrix("rectification_matrix", 3, 3, &[1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]),
        matrix("projection_matrix", 3, 4, &projection),
    ]
    .concat()
}
