//! Families in which the camera is not the one that is assumed.

use nalgebra::Vector3;

use crate::lies::{
    family::Family,
    kind::{Kind::Violated, Medium},
    optics::{Bending, Optics},
    scene::{Flip, Scene, Sweep},
    studio::Studio,
};

pub(crate) const FAMILIES: &[Family] = &[
    Family::points("aspect_slight", Violated, "pixels of aspect 0.9 to 1.1, several attitudes", |s| {
        aspect(s, [0.9, 1.1])
    }),
    Family::points(
        "aspect_strong",
        Violated,
        "pixels of aspect 0.5 to 2 (anamorphic, interlaced, squeezed), several attitudes",
        |s| aspect(s, [0.5, 2.0]),
    ),
    Family::points("aspect_one_attitude", Violated, "pixels of aspect 0.9 to 1.1, one attitude", aspect_one),
    Family::points("skew", Violated, "skew of 0.3 to 3 per cent of f (a tilted sensor, a sheared scan)", skew),
    Family::points("tangential", Violated, "p1, p2 of 0.0005 to 0.003, several attitudes", tangential),
    Family::points("tangential_one_attitude", Violated, "p1, p2 of 0.0005 to 0.003, one attitude", tangential_one),
    Family::points("k3", Violated, "a lens with a k3 of 0.02 to 0.15 in size", k3),
    Family::points("moustache", Violated, "barrel in the middle, pincushion at the border", moustache),
    Family::points("barrel_strong", Violated, "k1 of -0.28 to -0.4", barrel_strong),
    Family::points("barrel_one_attitude", Violated, "k1 of -0.1 to -0.35, one attitude", barrel_one),
    Family::points("barrel_single_motion", Violated, "k1 of -0.1 to -0.3, two pictures", barrel_single),
    Family::points("pincushion", Violated, "k1 of 0.05 to 0.3", pincushion),
    Family::points("division_lens", Violated, "a lens of the division model", division),
    Family::points("fisheye_narrow", Violated, "equidistant lens of 80 to 115 degrees, several attitudes", |s| {
        fisheye(s, [80.0, 115.0])
    }),
    Family::points("fisheye_wide", Violated, "equidistant lens of 115 to 150 degrees, several attitudes", |s| {
        fisheye(s, [115.0, 150.0])
    }),
    Family::points(
        "fisheye_one_attitude",
        Violated,
        "equidistant lens of 80 to 150 degrees, one attitude",
        fisheye_one,
    ),
    Family::points("rolling_shutter_slight", Violated, "0.1 to 0.5 degrees of pan while a picture is read out", |s| {
        rolling(s, [0.1, 0.5])
    }),
    Family::points("rolling_shutter", Violated, "0.5 to 1.5 degrees of pan while a picture is read out", |s| {
        rolling(s, [0.5, 1.5])
    }),
    Family::points(
        "rolling_shutter_robot",
        Violated,
        "a robot that drives and turns while pictures are read out, one attitude",
        rolling_robot,
    ),
    Family::points(
        "focus_breathing",
        Violated,
        "f differs by 0.3 to 2 per cent between the pictures of every motion",
        breathing,
    ),
    Family::points("autofocus", Violated, "f of every picture its own within 0.2 to 1.5 per cent", autofocus),
    Family::points("zoom_between", Violated, "zoomed between attitudes by 3 to 40 per cent", zoom_between),
    Family::points("zoom_single", Violated, "two pictures, zoomed by 1 to 20 per cent between them", zoom_single),
    Family::points("stabilised", Violated, "a stabiliser shifts every picture by pixels", stabilised),
    Family::points(
        "cropped",
        Violated,
        "cropped pictures: principal point 10 to 25 per cent of the width off the middle",
        cropped,
    ),
    Family::points("cropped_one_attitude", Violated, "cropped pictures of one attitude", cropped_one),
    Family::points("cropped_each", Violated, "every picture cropped by hand on its own", cropped_each),
    Family::points(
        "resized_some",
        Violated,
        "some pictures cropped and resized to the size of the others",
        resized_some,
    ),
    Family::points("resized_unequally", Violated, "pictures resized from 4:3 to 16:9 or back", resized_unequally),
    Family::points("mirrored_all", Violated, "all pictures left-right mirrored", mirrored_all),
    Family::pictures("aspect_pictures", Violated, "pixels of aspect 0.9 to 1.1", |s| aspect(s, [0.9, 1.1])),
    Family::pictures("skew_pictures", Violated, "skew of 0.3 to 3 per cent of f", skew),
    Family::pictures("tangential_pictures", Violated, "p1, p2 of 0.0005 to 0.003", tangential),
    Family::pictures("k3_pictures", Violated, "a lens with a k3", k3),
    Family::pictures("barrel_one_attitude_pictures", Violated, "k1 of -0.1 to -0.35, one attitude", barrel_one),
    Family::pictures("fisheye_pictures", Violated, "equidistant lens of 80 to 115 degrees", |s| {
        fisheye(s, [80.0, 115.0])
    }),
    Family::pictures(
        "fisheye_one_attitude_pictures",
        Violated,
        "equidistant lens of 80 to 150 degrees, one attitude",
        fisheye_one,
    ),
    Family::pictures(
        "rolling_shutter_pictures",
        Violated,
        "0.1 to 1.5 degrees of pan while a picture is read out",
        |s| rolling(s, [0.1, 1.5]),
    ),
    Family::pictures(
        "focus_breathing_pictures",
        Violated,
        "f differs by 0.3 to 2 per cent between the pictures of every motion",
        breathing,
    ),
    Family::pictures("zoom_between_pictures", Violated, "zoomed between attitudes by 3 to 40 per cent", zoom_between),
    Family::pictures("cropped_pictures", Violated, "cropped pictures", cropped),
    Family::pictures("mirrored_all_pictures", Violated, "all pictures mirrored", mirrored_all),
];

/// One attitude, as few pictures as the medium can bear.
fn one_attitude(s: &mut Studio) -> Scene {
    let views = match s.medium {
        Medium::Points => s.random.between(3, 8),
        Medium::Pictures => s.random.between(3, 4),
    };
    s.one_attitude(views)
}

fn with_aspect(scene: &mut Scene, ratio: f64) {
    let optics = scene.views[0].optics;
    // The angle of view stays: a wider pixel in the place of the square one.
    scene.set_optics(Optics { fy: optics.fx * ratio, ..optics });
}

fn aspect(s: &mut Studio, range: [f64; 2]) -> Scene {
    let mut scene = s.good_set();
    let mut ratio = s.random.log_uniform(range[0], range[1]);
    // Less than one per cent is hardly an error.
    while (ratio - 1.0f64).abs() < 0.01 {
        ratio = s.random.log_uniform(range[0], range[1]);
    }
    with_aspect(&mut scene, ratio);
    scene
}

fn aspect_one(s: &mut Studio) -> Scene {
    let mut scene = one_attitude(s);
    let ratio = 1.0 + s.random.either_sign(0.02, 0.1);
    with_aspect(&mut scene, ratio);
    scene
}

fn skew(s: &mut Studio) -> Scene {
    let mut scene = s.good_set();
    let optics = scene.views[0].optics;
    scene.set_optics(Optics { skew: optics.fx * s.random.either_sign(0.003, 0.03), ..optics });
    scene
}

fn decentred(s: &mut Studio, scene: &mut Scene) {
    let optics = scene.views[0].optics;
    let size = s.random.log_uniform(0.0005, 0.003);
    let direction = s.random.level_direction() * size;
    let k1 = s.random.uniform(-0.12, 0.03);
    let bending = Bending::Polynomial { radial: [k1, 0.0, 0.0], tangential: [direction.x, direction.y] };
    scene.set_optics(optics.with(bending));
}

fn tangential(s: &mut Studio) -> Scene {
    let mut scene = s.good_set();
    decentred(s, &mut scene);
    scene
}

fn tangential_one(s: &mut Studio) -> Scene {
    let mut scene = one_attitude(s);
    decentred(s, &mut scene);
    scene
}

/// A good set by a wider lens than usual: higher orders show at the border.
fn wide_set(s: &mut Studio, width_over_f: f64) -> Scene {
    let mut scene = s.good_set();
    let optics = scene.views[0].optics;
    scene.set_optics(optics.zoomed(scene.size[0] as f64 / width_over_f / optics.fx));
    scene
}

fn k3(s: &mut Studio) -> Scene {
    let mut scene = wide_set(s, 1.4);
    let radial = [s.random.uniform(-0.2, 0.0), s.random.uniform(-0.02, 0.08), s.random.either_sign(0.02, 0.15)];
    scene.set_optics(scene.views[0].optics.with(Bending::Polynomial { radial, tangential: [0.0; 2] }));
    scene
}

fn moustache(s: &mut Studio) -> Scene {
    let mut scene = wide_set(s, 1.3);
    let radial = [s.random.uniform(-0.3, -0.15), s.random.uniform(0.15, 0.3), s.random.uniform(0.0, 0.1)];
    scene.set_optics(scene.views[0].optics.with(Bending::Polynomial { radial, tangential: [0.0; 2] }));
    scene
}

fn barrel_strong(s: &mut Studio) -> Scene {
    let mut scene = wide_set(s, 1.4);
    let k1 = s.random.uniform(-0.4, -0.28);
    scene.set_optics(scene.views[0].optics.with(Bending::radial(k1, s.random.uniform(0.6, 1.2) * k1 * k1)));
    scene
}

fn barrel_in(s: &mut Studio, scene: &mut Scene, range: [f64; 2]) {
    let k1 = s.random.uniform(range[0], range[1]);
    scene.set_optics(scene.views[0].optics.with(Bending::radial(k1, s.random.uniform(0.0, 0.8) * k1 * k1)));
}

fn barrel_one(s: &mut Studio) -> Scene {
    let mut scene = one_attitude(s);
    barrel_in(s, &mut scene, [-0.35, -0.1]);
    scene
}

fn barrel_single(s: &mut Studio) -> Scene {
    let mut scene = s.tripod(1, 2);
    barrel_in(s, &mut scene, [-0.3, -0.1]);
    scene
}

fn pincushion(s: &mut Studio) -> Scene {
    let mut scene = s.good_set();
    barrel_in(s, &mut scene, [0.05, 0.3]);
    scene
}

fn division(s: &mut Studio) -> Scene {
    let mut scene = wide_set(s, 1.5);
    let lambda = s.random.uniform(-0.35, -0.05);
    scene.set_optics(scene.views[0].optics.with(Bending::Division { lambda }));
    scene
}

/// An equidistant lens with so many degrees across the width.
fn fisheye_optics(s: &mut Studio, scene: &mut Scene, degrees: [f64; 2]) {
    let across = s.random.uniform(degrees[0], degrees[1]).to_radians();
    let optics = scene.views[0].optics;
    let f = scene.size[0] as f64 / across;
    scene.set_optics(Optics { fx: f, fy: f, ..optics }.with(Bending::Equidistant));
}

fn fisheye(s: &mut Studio, degrees: [f64; 2]) -> Scene {
    let mut scene = s.good_set();
    fisheye_optics(s, &mut scene, degrees);
    scene
}

fn fisheye_one(s: &mut Studio) -> Scene {
    let mut scene = one_attitude(s);
    fisheye_optics(s, &mut scene, [80.0, 150.0]);
    scene
}

fn rolling(s: &mut Studio, degrees: [f64; 2]) -> Scene {
    let mut scene = s.good_set();
    let turn_rad = Vector3::z() * s.random.uniform(degrees[0], degrees[1]).to_radians();
    // Pictures out of one pan, or each where it happened to move.
    let one_way = s.random.chance(0.6);
    for v in &mut scene.views {
        let sense = if one_way || s.random.chance(0.5) { 1.0 } else { -1.0 };
        v.sweep = Some(Sweep { turn_rad: turn_rad * sense, way_m: Vector3::zeros() });
    }
    scene
}

fn rolling_robot(s: &mut Studio) -> Scene {
    let mut scene = one_attitude(s);
    let (turn, way) = (s.random.either_sign(0.0, 1.0).to_radians(), s.random.uniform(0.0, 0.02));
    for v in &mut scene.views {
        let forward: Vector3<f64> = v.pose.rotation.column(2).into_owned();
        let level = Vector3::new(forward.x, forward.y, 0.0).normalize();
        v.sweep = Some(Sweep { turn_rad: Vector3::z() * turn, way_m: level * way });
    }
    scene
}

fn breathing(s: &mut Studio) -> Scene {
    let mut scene = s.good_set();
    let factor = 1.0 + s.random.either_sign(0.003, 0.02);
    for v in scene.views.iter_mut().skip(1).step_by(2) {
        v.optics = v.optics.zoomed(factor);
    }
    scene.any_camera_is_right();
    scene
}

fn autofocus(s: &mut Studio) -> Scene {
    let mut scene = s.good_set();
    let spread = s.random.uniform(0.002, 0.015);
    for v in &mut scene.views {
        v.optics = v.optics.zoomed(1.0 + s.random.uniform(-spread, spread));
    }
    scene.any_camera_is_right();
    scene
}

fn zoom_between(s: &mut Studio) -> Scene {
    let mut scene = s.good_set();
    let factor = s.random.log_uniform(1.03, 1.4);
    let first = scene.views.len() / 4 * 2;
    for v in scene.views.iter_mut().skip(first) {
        v.optics = v.optics.zoomed(factor);
    }
    scene.any_camera_is_right();
    scene
}

fn zoom_single(s: &mut Studio) -> Scene {
    let mut scene = s.tripod(1, 2);
    let factor = s.random.log_uniform(1.01, 1.2);
    scene.views[1].optics = scene.views[1].optics.zoomed(factor);
    scene.any_camera_is_right();
    scene
}

fn shifted_each(s: &mut Studio, scene: &mut Scene, of_width: [f64; 2]) {
    let sigma = s.random.log_uniform(of_width[0], of_width[1]) * scene.size[0] as f64;
    for v in &mut scene.views {
        v.optics.cx += s.random.normal(sigma);
        v.optics.cy += s.random.normal(sigma);
    }
    scene.any_camera_is_right();
}

fn stabilised(s: &mut Studio) -> Scene {
    let mut scene = s.good_set();
    shifted_each(s, &mut scene, [0.002, 0.02]);
    scene
}

fn cropped_each(s: &mut Studio) -> Scene {
    let mut scene = s.good_set();
    shifted_each(s, &mut scene, [0.02, 0.08]);
    scene
}

fn crop(s: &mut Studio, scene: &mut Scene) {
    let mut optics = scene.views[0].optics;
    let width = scene.size[0] as f64;
    if s.random.chance(0.5) {
        optics.cx += s.random.either_sign(0.1, 0.25) * width;
    } else {
        optics.cy += s.random.either_sign(0.1, 0.25) * width;
    }
    scene.set_optics(optics);
}

fn cropped(s: &mut Studio) -> Scene {
    let mut scene = s.good_set();
    crop(s, &mut scene);
    scene
}

fn cropped_one(s: &mut Studio) -> Scene {
    let mut scene = one_attitude(s);
    crop(s, &mut scene);
    scene
}

fn resized_some(s: &mut Studio) -> Scene {
    let mut scene = s.good_set();
    let factor = s.random.uniform(1.05, 1.6);
    let some = s.random.between(1, 3);
    for _ in 0..some {
        let view = s.random.below(scene.views.len());
        scene.views[view].optics = scene.views[0].optics.zoomed(factor);
    }
    scene.any_camera_is_right();
    scene
}

fn resized_unequally(s: &mut Studio) -> Scene {
    let mut scene = s.good_set();
    with_aspect(&mut scene, [0.75, 4.0 / 3.0, 0.9, 1.185][s.random.below(4)]);
    scene
}

fn mirrored_all(s: &mut Studio) -> Scene {
    let mut scene = s.good_set();
    scene.views.iter_mut().for_each(|v| v.flip = Flip::Mirrored);
    scene.any_camera_is_right();
    scene
}
