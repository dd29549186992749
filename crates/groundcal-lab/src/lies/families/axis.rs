//! Families in which the axis is not quite the floor's normal, or the lens not quite on it.

use nalgebra::Vector3;

use crate::lies::{
    family::Family,
    kind::Kind::Violated,
    pose::{Pose, about, looking},
    scene::Scene,
    studio::Studio,
};

pub(crate) const FAMILIES: &[Family] = &[
    Family::points(
        "common_tilt_slight",
        Violated,
        "the axis of a head 0.2 to 1 degree off the floor's normal, the same for all motions",
        |s| common_tilt(s, [0.2, 1.0]),
    ),
    Family::points(
        "common_tilt",
        Violated,
        "the axis of a head 1 to 3 degrees off the floor's normal, the same for all motions",
        |s| common_tilt(s, [1.0, 3.0]),
    ),
    Family::points(
        "common_tilt_one_attitude",
        Violated,
        "one attitude, axis 0.3 to 2 degrees off the normal, four to eight headings",
        common_tilt_one,
    ),
    Family::points("own_tilt", Violated, "each motion's axis off the normal by 0.3 to 3 degrees its own way", own_tilt),
    Family::points(
        "robot_pitch_slight",
        Violated,
        "a robot whose every view pitches and rolls by 0.1 to 0.5 degrees, four to six attitudes",
        |s| pitch(s, [0.1, 0.5]),
    ),
    Family::points(
        "robot_pitch",
        Violated,
        "a robot whose every view pitches and rolls by 0.5 to 3 degrees, four to six attitudes",
        |s| pitch(s, [0.5, 3.0]),
    ),
    Family::points(
        "robot_pitch_one_attitude",
        Violated,
        "one attitude, every view pitched by 0.2 to 2 degrees",
        pitch_one,
    ),
    Family::points("robot_pitch_two", Violated, "two pictures, each pitched by 0.2 to 1.5 degrees", pitch_two),
    Family::points(
        "lens_off_axis_3",
        Violated,
        "pan and tilt on the spot over a floor 1.5 m below, lens 3 mm before the axes",
        |s| off_axis(s, 0.003),
    ),
    Family::points(
        "lens_off_axis_10",
        Violated,
        "pan and tilt on the spot over a floor 1.5 m below, lens 10 mm before the axes",
        |s| off_axis(s, 0.01),
    ),
    Family::points(
        "lens_off_axis_30",
        Violated,
        "pan and tilt on the spot over a floor 1.5 m below, lens 30 mm before the axes",
        |s| off_axis(s, 0.03),
    ),
    Family::points(
        "lens_off_axis_room",
        Violated,
        "a panorama by hand in a room, the lens 20 to 200 mm off the neck",
        off_axis_room,
    ),
    Family::points(
        "ring_tilted_axis",
        Violated,
        "a full turn over a floor about an axis 2 to 15 degrees off its normal",
        ring_tilted,
    ),
    Family::points(
        "rocking_trolley",
        Violated,
        "a trolley rocking: views of an attitude alternate by 0.5 to 2 degrees of pitch",
        rocking,
    ),
    Family::points(
        "road_camber",
        Violated,
        "a car in a bend: roll of 0.5 to 3 degrees between the pictures of each motion",
        camber,
    ),
    Family::pictures(
        "common_tilt_pictures",
        Violated,
        "axis 0.3 to 2 degrees off the normal, the same for all motions",
        |s| common_tilt(s, [0.3, 2.0]),
    ),
    Family::pictures("robot_pitch_pictures", Violated, "every view pitches and rolls by 0.2 to 1.5 degrees", |s| {
        pitch(s, [0.2, 1.5])
    }),
    Family::pictures(
        "lens_off_axis_pictures",
        Violated,
        "pan and tilt on the spot over a floor, lens 3 to 30 mm before the axes",
        off_axis_any,
    ),
];

fn common_tilt(s: &mut Studio, degrees: [f64; 2]) -> Scene {
    let mut scene = s.good_set();
    let (axis, angle) = (s.random.level_direction(), s.random.uniform(degrees[0], degrees[1]).to_radians());
    scene.rotate_cameras(&about(&axis, angle));
    scene
}

fn common_tilt_one(s: &mut Studio) -> Scene {
    let size = s.size();
    let optics = s.optics(size);
    let views = s.random.between(4, 8);
    let headings: Vec<f64> = (0..views).map(|k| 14.0 * k as f64).collect();
    let pitch = s.random.uniform(30.0, 65.0);
    let poses = s.head_poses(&headings, &[pitch], 1.4, 0.06);
    let mut scene = s.scene(size, optics, &poses);
    let (axis, angle) = (s.random.level_direction(), s.random.uniform(0.3, 2.0).to_radians());
    scene.rotate_cameras(&about(&axis, angle));
    scene
}

fn own_tilt(s: &mut Studio) -> Scene {
    let mut scene = s.good_set();
    for motion in scene.views.chunks_mut(2) {
        let (axis, angle) = (s.random.level_direction(), s.random.uniform(0.3, 3.0).to_radians());
        for v in motion {
            v.pose = v.pose.turned(&axis, angle);
        }
    }
    scene
}

fn pitched(s: &mut Studio, scene: &mut Scene, degrees: [f64; 2]) {
    let sigma = s.random.uniform(degrees[0], degrees[1]);
    for view in 0..scene.views.len() {
        let tilt = s.random.normal(sigma);
        scene.tilt(view, tilt, &mut s.random);
    }
}

fn pitch(s: &mut Studio, degrees: [f64; 2]) -> Scene {
    let mut scene = s.good_set();
    pitched(s, &mut scene, degrees);
    scene
}

fn pitch_one(s: &mut Studio) -> Scene {
    let views = s.random.between(4, 10);
    let mut scene = s.one_attitude(views);
    pitched(s, &mut scene, [0.2, 2.0]);
    scene
}

fn pitch_two(s: &mut Studio) -> Scene {
    let mut scene = s.tripod(1, 2);
    pitched(s, &mut scene, [0.2, 1.5]);
    scene
}

fn off_axis(s: &mut Studio, ahead_m: f64) -> Scene {
    let size = s.size();
    let optics = s.optics(size);
    let step = s.random.uniform(14.0, 22.0);
    let columns = s.random.between(3, 5);
    let headings: Vec<f64> = (0..columns).map(|k| step * k as f64).collect();
    let first = s.random.uniform(28.0, 36.0);
    let pitches: Vec<f64> = (0..s.random.between(2, 3)).map(|k| first + 13.0 * k as f64).collect();
    let poses = s.head_poses(&headings, &pitches, 1.5, ahead_m);
    s.scene(size, optics, &poses)
}

fn off_axis_any(s: &mut Studio) -> Scene {
    let size = s.size();
    let optics = s.optics(size);
    let step = s.random.uniform(15.0, 22.0);
    let ahead = s.random.one_of(&[0.003, 0.01, 0.03]);
    let first = s.random.uniform(32.0, 45.0);
    let poses = s.head_poses(&[0.0, step, 2.0 * step], &[first, first + 14.0], 1.5, ahead);
    s.scene(size, optics, &poses)
}

fn off_axis_room(s: &mut Studio) -> Scene {
    let size = s.size();
    let optics = s.optics(size);
    let count = s.random.between(10, 16);
    let headings: Vec<f64> = (0..count).map(|k| 360.0 / count as f64 * k as f64 + s.random.normal(2.0)).collect();
    let ahead = s.random.log_uniform(0.02, 0.2);
    let pitch = s.random.uniform(-5.0, 10.0);
    let mut poses = s.head_poses(&headings, &[pitch], 0.0, ahead);
    for p in &mut poses {
        let (axis, angle) = (s.random.level_direction(), s.random.normal(0.02));
        *p = p.turned(&axis, angle);
    }
    let mut scene = s.scene(size, optics, &poses);
    let radius = s.random.log_uniform(3.0, 12.0);
    scene.surfaces = vec![s.far_away(radius)];
    scene
}

fn ring_tilted(s: &mut Studio) -> Scene {
    let size = s.size();
    let optics = s.optics(size);
    let count = s.random.between(12, 18);
    let angle = s.random.uniform(2.0, 15.0).to_radians();
    let tilt = about(&s.random.level_direction(), angle);
    let pitch = s.random.uniform(42.0, 60.0).to_radians();
    let poses: Vec<Pose> = (0..count)
        .map(|k| {
            let heading = std::f64::consts::TAU * k as f64 / count as f64 + s.random.normal(0.02);
            let r = tilt * looking(heading, pitch, 0.0);
            Pose::new(r, Vector3::new(0.0, 0.0, 1.5) + r.column(2) * 0.08)
        })
        .collect();
    s.scene(size, optics, &poses)
}

fn rocking(s: &mut Studio) -> Scene {
    let attitudes = s.random.between(3, 5);
    let mut scene = s.tripod(attitudes, 2);
    let angle = s.random.uniform(0.5, 2.0).to_radians();
    for v in scene.views.iter_mut().skip(1).step_by(2) {
        let right: Vector3<f64> = v.pose.rotation.column(0).into_owned();
        v.pose = v.pose.turned(&Vector3::new(right.x, right.y, 0.0), angle);
    }
    scene
}

fn camber(s: &mut Studio) -> Scene {
    let attitudes = s.random.between(2, 4);
    let mut scene = s.tripod(attitudes, 2);
    let angle = s.random.either_sign(0.5, 3.0).to_radians();
    for v in scene.views.iter_mut().skip(1).step_by(2) {
        let forward: Vector3<f64> = v.pose.rotation.column(2).into_owned();
        v.pose = v.pose.turned(&Vector3::new(forward.x, forward.y, 0.0), angle);
    }
    scene
}
