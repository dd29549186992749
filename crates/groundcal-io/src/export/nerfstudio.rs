//! `transforms.json` of nerfstudio.
//!
//! Camera axes are OpenGL's (x right, y up, z backward); `transform_matrix` takes camera coordinates to the world:
//! Rᵀ diag(1, -1, -1) beside the optical centre. Pixels are counted from the corner of the image: cx and cy are ours plus ½.

use groundcal::result::Calibration;
use serde::Serialize;

use crate::{
    error::IoError,
    export::{
        file::File,
        world::{Pose, World},
    },
};

#[derive(Serialize)]
struct Transforms<'a> {
    camera_model: &'static str,
    pixel_centre: &'static str,
    camera_axes: &'static str,
    world_axes: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    left_out: Option<String>,
    w: usize,
    h: usize,
    fl_x: f64,
    fl_y: f64,
    cx: f64,
    cy: f64,
    k1: f64,
    k2: f64,
    p1: f64,
    p2: f64,
    frames: Vec<Frame<'a>>,
}

#[derive(Serialize)]
struct Frame<'a> {
    file_path: &'a str,
    transform_matrix: [[f64; 4]; 4],
}

/// The file.
pub(crate) fn files(calibration: &Calibration, world: &World) -> Result<Vec<File>, IoError> {
    Ok(vec![File::new("transforms.json", json(calibration, world)?)])
}

/// The file's text.
fn json(calibration: &Calibration, world: &World) -> Result<String, IoError> {
    let c = &calibration.camera;
    let d = &c.distortion;
    let transforms = Transforms {
        camera_model: "OPENCV",
        pixel_centre: "(0.5,0.5) is the centre of the top-left pixel",
        camera_axes: "x right, y up, z backward (OpenGL)",
        world_axes: format!("the floor is z = 0, z up; lengths in {}", world.unit),
        left_out: (!world.left_out.is_empty()).then(|| world.what_is_left_out()),
        w: c.image_size[0],
        h: c.image_size[1],
        fl_x: c.fx,
        fl_y: c.fy,
        cx: c.cx + 0.5,
        cy: c.cy + 0.5,
        k1: d.k1,
        k2: d.k2,
        p1: d.p1,
        p2: d.p2,
        frames: world.poses.iter().map(frame).collect(),
    };
    serde_json::to_string_pretty(&transforms)
        .map(|text| text + "\n")
        .map_err(|e| IoError::Other(format!("cannot write transforms.json: {e}")))
}

fn frame<'a>(pose: &Pose<'a>) -> Frame<'a> {
    let (r, c) = (&pose.r_cam_from_world, &pose.centre);
    let row = |i: usize| [r[(0, i)], -r[(1, i)], -r[(2, i)], c[i]];
    Frame { file_path: pose.image, transform_matrix: [row(0), row(1), row(2), [0.0, 0.0, 0.0, 1.0]] }
}
