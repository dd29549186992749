//! `camera_matlab.csv`: the camera under the names and the pixel convention of MATLAB, whose top-left pixel has its centre at
//! (1, 1): PrincipalPoint is ours plus 1. Beside each number its standard deviation (empty: held, given or not estimated).

use groundcal::result::Parameter;

use crate::{
    error::IoError,
    export::{file::File, source::Source},
};

/// The file.
pub(crate) fn files(source: &Source) -> Result<Vec<File>, IoError> {
    Ok(vec![File::new("camera_matlab.csv", csv(source))])
}

/// The file's text.
fn csv(source: &Source) -> String {
    let (c, k) = (&source.camera, &source.camera.intrinsics);
    let sigma = |p: Parameter| source.standard_deviation(p);
    let [k1, k2, p1, p2, k3] = source.lens_parameters(["k1", "k2", "p1", "p2", "k3"]);
    let mut rows = vec![
        ("ImageSize_rows", c.size.height as f64, None, "px"),
        ("ImageSize_columns", c.size.width as f64, None, "px"),
        ("FocalLength_x", k.fx, sigma(Parameter::Fx), "px"),
        ("FocalLength_y", k.fy, sigma(Parameter::Fy), "px"),
        ("PrincipalPoint_x", k.cx + 1.0, sigma(Parameter::Cx), "px"),
        ("PrincipalPoint_y", k.cy + 1.0, sigma(Parameter::Cy), "px"),
        ("Skew", k.skew, sigma(Parameter::Skew), "px"),
        ("RadialDistortion_1", k1, sigma(Parameter::K1), "1"),
        ("RadialDistortion_2", k2, sigma(Parameter::K2), "1"),
        ("TangentialDistortion_1", p1, sigma(Parameter::P1), "1"),
        ("TangentialDistortion_2", p2, sigma(Parameter::P2), "1"),
    ];
    if k3 != 0.0 {
        rows.insert(9, ("RadialDistortion_3", k3, sigma(Parameter::K3), "1"));
    }
    let mut out = String::from("parameter,value,standard_deviation,unit\n");
    for (name, value, sigma, unit) in rows {
        let sigma = sigma.map(|s: f64| s.to_string()).unwrap_or_default();
        out += &format!("{name},{value},{sigma},{unit}\n");
    }
    out
}
