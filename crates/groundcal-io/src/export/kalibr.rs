//! `camchain.yaml`, as Kalibr writes and reads it.

use groundcal::result::Calibration;

use crate::{
    error::IoError,
    export::{file::File, number::list, world::World},
};

/// The file.
pub(crate) fn files(calibration: &Calibration, _: &World) -> Result<Vec<File>, IoError> {
    Ok(vec![File::new("camchain.yaml", yaml(calibration))])
}

/// The file's text: one camera, pinhole with radtan distortion. Kalibr counts pixels as we do; it has no skew.
fn yaml(calibration: &Calibration) -> String {
    let c = &calibration.camera;
    let d = &c.distortion;
    let skew = if c.skew == 0.0 {
        String::new()
    } else {
        format!("# a skew of {} px is left out: the format has none\n", c.skew)
    };
    format!(
        "# {}\n{skew}cam0:\n  cam_overlaps: []\n  camera_model: pinhole\n  distortion_coeffs: [{}]\n  distortion_model: radtan\n  \
         intrinsics: [{}]\n  resolution: [{}, {}]\n  rostopic: /cam0/image_raw\n",
        calibration.pixel_centre,
        list(&[d.k1, d.k2, d.p1, d.p2]),
        list(&[c.fx, c.fy, c.cx, c.cy]),
        c.image_size[0],
        c.image_size[1],
    )
}
