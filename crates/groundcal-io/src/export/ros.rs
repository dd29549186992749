//! `camera_info.yaml`, as ROS's camera_info_manager and camera_calibration_parsers read it.

use groundcal::result::Calibration;

use crate::{
    error::IoError,
    export::{
        file::File,
        number::{camera_matrix, list},
        world::World,
    },
};

/// The file.
pub(crate) fn files(calibration: &Calibration, _: &World) -> Result<Vec<File>, IoError> {
    Ok(vec![File::new("camera_info.yaml", yaml(calibration))])
}

/// The file's text. ROS counts pixels as we do. A camera by itself is rectified by the identity, and its projection matrix is
/// [K | 0]: the rectified image has the camera matrix of the raw one.
fn yaml(calibration: &Calibration) -> String {
    let c = &calibration.camera;
    let matrix = |name: &str, rows: usize, columns: usize, data: &[f64]| {
        format!("{name}:\n  rows: {rows}\n  cols: {columns}\n  data: [{}]\n", list(data))
    };
    let d = &c.distortion;
    let projection = [c.fx, c.skew, c.cx, 0.0, 0.0, c.fy, c.cy, 0.0, 0.0, 0.0, 1.0, 0.0];
    [
        format!("# {}\n", calibration.pixel_centre),
        format!("image_width: {}\nimage_height: {}\ncamera_name: camera\n", c.image_size[0], c.image_size[1]),
        matrix("camera_matrix", 3, 3, &camera_matrix(c)),
        "distortion_model: plumb_bob\n".into(),
        matrix("distortion_coefficients", 1, 5, &[d.k1, d.k2, d.p1, d.p2, 0.0]),
        matrix("rectification_matrix", 3, 3, &[1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]),
        matrix("projection_matrix", 3, 4, &projection),
    ]
    .concat()
}
