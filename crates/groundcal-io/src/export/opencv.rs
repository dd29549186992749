//! `camera_opencv.yaml`, as `cv2.FileStorage` reads it.

use groundcal::geometry::Lens;

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
    Ok(vec![File::new("camera_opencv.yaml", yaml(source))])
}

/// The file's text. OpenCV counts pixels as we do: (0, 0) is the centre of the top-left pixel. A fisheye lens is told by the flag of
/// OpenCV's calibration program; its four numbers are the D of `cv2.fisheye`.
fn yaml(source: &Source) -> String {
    let c = &source.camera;
    let matrix = |rows: usize, columns: usize, data: &[f64]| {
        format!("!!opencv-matrix\n   rows: {rows}\n   cols: {columns}\n   dt: d\n   data: [ {} ]\n", list(data))
    };
    let lens = match c.lens {
        Lens::Fisheye(_) => format!(
            "fisheye_model: 1\ndistortion_model: equidistant\ndistortion_coefficients: {}",
            matrix(1, 4, &c.lens.parameters())
        ),
        _ => format!(
            "distortion_model: plumb_bob\ndistortion_coefficients: {}",
            matrix(1, 5, &source.lens_parameters(["k1", "k2", "p1", "p2", "k3"]))
        ),
    };
    format!(
        "%YAML:1.0\n---\nimage_width: {}\nimage_height: {}\ncamera_matrix: {}{lens}",
        c.size.width,
        c.size.height,
        matrix(3, 3, &camera_matrix(&c.intrinsics)),
    )
}
