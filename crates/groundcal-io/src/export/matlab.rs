//! `camera_matlab.csv`: the camera under the names and the pixel convention of MATLAB, whose top-left pixel has its centre at
//! (1, 1): PrincipalPoint is ours plus 1. Beside each number its standard deviation (empty: held, given or not estimated).

use groundcal::result::Calibration;

use crate::{
    error::IoError,
    export::{file::File, world::World},
};

/// The file.
pub(crate) fn files(calibration: &Calibration, _: &World) -> Result<Vec<File>, IoError> {
    Ok(vec![File::new("camera_matlab.csv", csv(calibration))])
}

/// The file's text.
fn csv(calibration: &Calibration) -> String {
    let c = &calibration.camera;
    let s = &calibration.standard_deviation;
    let d = &c.distortion;
    let rows = [
        ("ImageSize_rows", c.image_size[1] as f64, None, "px"),
        ("ImageSize_columns", c.image_size[0] as f64, None, "px"),
        ("FocalLength_x", c.fx, s.fx, "px"),
        ("FocalLength_y", c.fy, s.fy, "px"),
        ("PrincipalPoint_x", c.cx + 1.0, s.cx, "px"),
        ("PrincipalPoint_y", c.cy + 1.0, s.cy, "px"),
        ("Skew", c.skew, s.skew, "px"),
        ("RadialDistortion_1", d.k1, s.k1, "1"),
        ("RadialDistortion_2", d.k2, s.k2, "1"),
        ("TangentialDistortion_1", d.p1, None, "1"),
        ("TangentialDistortion_2", d.p2, None, "1"),
    ];
    let mut out = String::from("parameter,value,standard_deviation,unit\n");
    for (name, value, sigma, unit) in rows {
        let sigma = sigma.map(|s: f64| s.to_string()).unwrap_or_default();
        out += &format!("{name},{value},{sigma},{unit}\n");
    }
    out
}
