//! `cameras.txt`, `images.txt` and `points3D.txt`: a COLMAP model as text.
//!
//! COLMAP counts pixels from the corner of the image, half a pixel before our origin: its cx and cy are ours plus ½. A pose is
//! the unit quaternion and the translation of x_camera = R X + t, t = -R c; its camera frame is ours (x right, y down, z forward).

use std::fmt::Write;

use groundcal::geometry::Lens;
use nalgebra::{Rotation3, UnitQuaternion};

use crate::{
    error::IoError,
    export::{file::File, source::Source, world::World},
};

/// The three files.
pub(crate) fn files(source: &Source) -> Result<Vec<File>, IoError> {
    Ok(vec![
        File::new("cameras.txt", cameras(source)),
        File::new("images.txt", images(&source.world)),
        File::new("points3D.txt", points()),
    ])
}

/// The camera, with the smallest model that holds it.
fn cameras(source: &Source) -> String {
    let (c, k) = (&source.camera, &source.camera.intrinsics);
    let [k1, k2, p1, p2, k3] = source.lens_parameters(["k1", "k2", "p1", "p2", "k3"]);
    let (centre, square) = ([k.cx + 0.5, k.cy + 0.5], k.fx == k.fy);
    let (one_focal, two_focals) = (vec![k.fx, centre[0], centre[1]], vec![k.fx, k.fy, centre[0], centre[1]]);
    let (model, mut parameters, lens) = match c.lens {
        Lens::Fisheye(_) => ("OPENCV_FISHEYE", two_focals, c.lens.parameters()),
        _ if k3 != 0.0 => ("FULL_OPENCV", two_focals, vec![k1, k2, p1, p2, k3, 0.0, 0.0, 0.0]),
        _ if p1 != 0.0 || p2 != 0.0 => ("OPENCV", two_focals, vec![k1, k2, p1, p2]),
        _ if k1 == 0.0 && k2 == 0.0 && square => ("SIMPLE_PINHOLE", one_focal, Vec::new()),
        _ if k1 == 0.0 && k2 == 0.0 => ("PINHOLE", two_focals, Vec::new()),
        _ if k2 == 0.0 && square => ("SIMPLE_RADIAL", one_focal, vec![k1]),
        _ if square => ("RADIAL", one_focal, vec![k1, k2]),
        _ => ("OPENCV", two_focals, vec![k1, k2, p1, p2]),
    };
    parameters.extend(lens);
    let numbers: Vec<String> = parameters.iter().map(f64::to_string).collect();
    let skew = if k.skew == 0.0 {
        String::new()
    } else {
        format!("# A skew of {} px is left out: the format has none.\n", k.skew)
    };
    format!(
        "# Camera list with one line of data per camera:\n#   CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]\n\
         # (0.5,0.5) is the centre of the top-left pixel, as COLMAP counts.\n{skew}# Number of cameras: 1\n1 {model} {} {} {}\n",
        c.size.width,
        c.size.height,
        numbers.join(" ")
    )
}

/// The poses of one world, without points.
fn images(world: &World) -> String {
    let mut out = String::from(
        "# Image list with two lines of data per image:\n\
         #   IMAGE_ID, QW, QX, QY, QZ, TX, TY, TZ, CAMERA_ID, NAME\n\
         #   POINTS2D[] as (X, Y, POINT3D_ID)\n\
         # World: the floor is Z = 0, Z up",
    );
    let _ = writeln!(out, "; lengths in {}.", world.unit);
    if world.poses.is_empty() {
        out += "# No poses: the calibration has no positions of its views.\n";
    }
    if !world.left_out.is_empty() {
        let _ = writeln!(out, "# Here, {}.", one_line(&world.what_is_left_out()));
    }
    let _ = writeln!(out, "# Number of images: {}, mean observations per image: 0", world.poses.len());
    for (i, pose) in world.poses.iter().enumerate() {
        let r = Rotation3::from_matrix_unchecked(pose.r_cam_from_world);
        let q = UnitQuaternion::from_rotation_matrix(&r);
        // Of the two quaternions of a rotation, the one of the smaller angle.
        let q = if q.w < 0.0 { UnitQuaternion::new_unchecked(-q.into_inner()) } else { q };
        let t = -(r * pose.centre);
        // The second line, of points, stays empty.
        let _ = writeln!(
            out,
            "{} {} {} {} {} {} {} {} 1 {}\n",
            i + 1,
            q.w,
            q.i,
            q.j,
            q.k,
            t.x,
            t.y,
            t.z,
            one_line(pose.image)
        );
    }
    out
}

/// No points: COLMAP reads a model only where the file is there.
fn points() -> String {
    "# 3D point list with one line of data per point:\n#   POINT3D_ID, X, Y, Z, R, G, B, ERROR, TRACK[] as (IMAGE_ID, POINT2D_IDX)\n\
     # Number of points: 0, mean track length: 0\n"
        .into()
}

/// A name that cannot end its line.
fn one_line(text: &str) -> String {
    text.replace(char::is_control, "_")
}
