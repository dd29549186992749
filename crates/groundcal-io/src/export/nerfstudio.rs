//! `transforms.json` of nerfstudio.
//!
//! Camera axes are OpenGL's (x right, y up, z backward); `transform_matrix` takes camera coordinates to the world:
//! Rᵀ diag(1, -1, -1) beside the optical centre. Pixels are counted from the corner of the image: cx and cy are ours plus ½.

use groundcal::geometry::Lens;
use serde::Serialize;

use crate::{
    error::IoError,
    export::{file::File, source::Source, world::Pose},
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
    #[serde(flatten)]
    lens: LensKeys,
    frames: Vec<Frame<'a>>,
}

/// Of OPENCV k1, k2, p1, p2 (and k3 where there is one), of OPENCV_FISHEYE k1 to k4.
#[derive(Serialize)]
#[serde(untagged)]
enum LensKeys {
    Opencv {
        k1: f64,
        k2: f64,
        p1: f64,
        p2: f64,
        #[serde(skip_serializing_if = "Option::is_none")]
        k3: Option<f64>,
    },
    Fisheye {
        k1: f64,
        k2: f64,
        k3: f64,
        k4: f64,
    },
}

#[derive(Serialize)]
struct Frame<'a> {
    file_path: &'a str,
    transform_matrix: [[f64; 4]; 4],
}

/// The file.
pub(crate) fn files(source: &Source) -> Result<Vec<File>, IoError> {
    Ok(vec![File::new("transforms.json", json(source)?)])
}

/// The file's text.
fn json(source: &Source) -> Result<String, IoError> {
    let (c, k, world) = (&source.camera, &source.camera.intrinsics, &source.world);
    let (camera_model, lens) = match c.lens {
        Lens::Fisheye(_) => {
            let [k1, k2, k3, k4] = source.lens_parameters(["k1", "k2", "k3", "k4"]);
            ("OPENCV_FISHEYE", LensKeys::Fisheye { k1, k2, k3, k4 })
        }
        _ => {
            let [k1, k2, p1, p2, k3] = source.lens_parameters(["k1", "k2", "p1", "p2", "k3"]);
            ("OPENCV", LensKeys::Opencv { k1, k2, p1, p2, k3: (k3 != 0.0).then_some(k3) })
        }
    };
    let transforms = Transforms {
        camera_model,
        pixel_centre: "(0.5,0.5) is the centre of the top-left pixel",
        camera_axes: "x right, y up, z backward (OpenGL)",
        world_axes: format!("the floor is z = 0, z up; lengths in {}", world.unit),
        left_out: (!world.left_out.is_empty()).then(|| world.what_is_left_out()),
        w: c.size.width,
        h: c.size.height,
        fl_x: k.fx,
        fl_y: k.fy,
        cx: k.cx + 0.5,
        cy: k.cy + 0.5,
        lens,
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
