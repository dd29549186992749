//! `camera_opencv.yaml`, as `cv2.FileStorage` reads it.

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
    Ok(vec![File::new("camera_opencv.yaml", yaml(calibration))])
}

/// The file's text. OpenCV counts pixels as we do: (0, 0) is the centre of the top-left pixel.
fn yaml(calibration: &Calibration) -> String {
    let c = &calibration.camera;
    let matrix = |rows: usize, columns: usize, data: &[f64]| {
        format!("!!opencv-matrix\n   rows: {rows}\n   cols: {columns}\n   dt: d\n   data: [ {} ]\n", list(data))
    };
    let d = &c.distortion;
    format!(
        "%YAML:1.0\n---\nimage_width: {}\nimage_height: {}\ncamera_matrix: {}distortion_model: plumb_bob\ndistortion_coefficients: {}",
        c.image_size[0],
        c.image_size[1],
        matrix(3, 3, &camera_matrix(c)),
        matrix(1, 5, &[d.k1, d.k2, d.p1, d.p2, 0.0]),
    )
}
