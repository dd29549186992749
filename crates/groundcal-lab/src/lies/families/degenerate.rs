//! Families whose pictures do not, or hardly, say what is asked.

use nalgebra::Vector3;

use crate::lies::{
    family::Family,
    kind::Kind::Degenerate,
    pose::{Pose, looking},
    scene::Scene,
    studio::{Studio, Tilt},
};

pub(crate) const FAMILIES: &[Family] = &[
    Family::points("tiny_turns", Degenerate, "turns of 0.2 to 4 degrees", tiny_turns),
    Family::points(
        "tiny_turn_tilted",
        Degenerate,
        "two pictures, a turn of 1 to 6 degrees, tilted by 0.1 to 0.5",
        tiny_tilted,
    ),
    Family::points("near_half_turn", Degenerate, "straight down, turns of 165 to 179.9 degrees", near_half_turn),
    Family::points(
        "translation",
        Degenerate,
        "moved without a turn, each view tilted by up to 0.3 degrees",
        translation,
    ),
    Family::points(
        "road_forward",
        Degenerate,
        "a car straight on: pitch and heading wander by tenths of a degree",
        road_forward,
    ),
    Family::points("nadir", Degenerate, "straight down but for a degree, several motions", |s| downward(s, [0.0, 1.5])),
    Family::points("near_nadir", Degenerate, "straight down but for 2 to 8 degrees, several motions", |s| {
        downward(s, [2.0, 8.0])
    }),
    Family::points(
        "grazing",
        Degenerate,
        "the floor seen at a grazing angle, 5 to 14 degrees below the horizontal",
        grazing,
    ),
    Family::points(
        "two_pictures",
        Degenerate,
        "two pictures of one attitude, tilted by 0.05 to 0.5 degrees",
        two_pictures,
    ),
    Family::points(
        "elevations_only",
        Degenerate,
        "parallel horizons: three or four elevations, no roll, principal point off",
        elevations,
    ),
    Family::points(
        "two_attitudes_alike",
        Degenerate,
        "two attitudes 1 to 5 degrees apart, views tilted by 0.1",
        two_alike,
    ),
    Family::points("one_attitude_off", Degenerate, "one attitude, principal point 5 to 12 per cent off", one_off),
    Family::points("telephoto", Degenerate, "a lens of 3 to 8 widths: nearly no perspective", telephoto),
    Family::pictures("near_nadir_pictures", Degenerate, "straight down but for 1 to 8 degrees", |s| {
        downward(s, [1.0, 8.0])
    }),
    Family::pictures(
        "two_pictures_pictures",
        Degenerate,
        "two pictures of one attitude, tilted by 0.05 to 0.5 degrees",
        two_pictures,
    ),
    Family::pictures(
        "translation_pictures",
        Degenerate,
        "moved without a turn, tilted by up to 0.3 degrees",
        translation,
    ),
    Family::pictures(
        "one_attitude_off_pictures",
        Degenerate,
        "one attitude, principal point 5 to 12 per cent off",
        one_off,
    ),
];

/// Motions of these attitudes, on floors apart, turned by an angle within these degrees; pairs moved along by `way` heights.
fn motions(s: &mut Studio, tilts: &[Tilt], turn_deg: [f64; 2], way: f64) -> Scene {
    let size = s.size();
    let optics = s.optics(size);
    let height = s.random.uniform(0.8, 1.5);
    let mut poses = Vec::new();
    for (group, &(pitch, roll)) in tilts.iter().enumerate() {
        let heading = s.random.uniform(0.0, std::f64::consts::TAU);
        let turn = s.random.either_sign(turn_deg[0], turn_deg[1]).to_radians();
        let start = Vector3::new(60.0 * group as f64, 0.0, height);
        let moved = s.random.level_direction() * s.random.uniform(0.3, 1.0) * way * height;
        poses.push(Pose::new(looking(heading, pitch, roll), start));
        poses.push(Pose::new(looking(heading + turn, pitch, roll), start + moved));
    }
    s.scene(size, optics, &poses)
}

fn tilted_each(s: &mut Studio, scene: &mut Scene, degrees: [f64; 2]) {
    let sigma = s.random.uniform(degrees[0], degrees[1]);
    for view in 0..scene.views.len() {
        let tilt = s.random.normal(sigma);
        scene.tilt(view, tilt, &mut s.random);
    }
}

fn tiny_turns(s: &mut Studio) -> Scene {
    let count = s.random.between(1, 5);
    let tilts = s.tilts(count);
    let largest = s.random.log_uniform(0.4, 4.0);
    let mut scene = motions(s, &tilts, [0.2, largest], 0.2);
    tilted_each(s, &mut scene, [0.0, 0.05]);
    scene
}

fn tiny_tilted(s: &mut Studio) -> Scene {
    let tilts = s.tilts(1);
    let mut scene = motions(s, &tilts, [1.0, 6.0], 0.2);
    tilted_each(s, &mut scene, [0.1, 0.5]);
    scene
}

fn near_half_turn(s: &mut Studio) -> Scene {
    let count = s.random.between(1, 5);
    let tilts: Vec<Tilt> =
        (0..count).map(|_| (s.random.uniform(68.0, 85.0).to_radians(), s.random.uniform(-0.4, 0.4))).collect();
    let size = s.size();
    let optics = s.optics(size);
    let height = s.random.uniform(0.8, 1.5);
    let mut poses = Vec::new();
    for (group, (pitch, roll)) in tilts.into_iter().enumerate() {
        let heading = s.random.uniform(0.0, std::f64::consts::TAU);
        let turn = s.random.either_sign(165.0, 179.9).to_radians();
        // Walked round the place looked at, so that both pictures show it.
        let reach = height / pitch.tan();
        let at = Vector3::new(60.0 * group as f64, 0.0, height);
        for angle in [heading, heading + turn] {
            let centre = at - Vector3::new(angle.cos(), angle.sin(), 0.0) * reach;
            poses.push(Pose::new(looking(angle, pitch, roll), centre));
        }
    }
    s.scene(size, optics, &poses)
}

fn translation(s: &mut Studio) -> Scene {
    let count = s.random.between(1, 3);
    let tilts = s.tilts(count);
    let mut scene = motions(s, &tilts, [0.0, 1e-6], 0.35);
    tilted_each(s, &mut scene, [0.0, 0.3]);
    scene
}

fn road_forward(s: &mut Studio) -> Scene {
    let size = s.size();
    let optics = s.optics(size);
    let views = s.random.between(6, 12);
    let (pitch, wander) = (s.random.uniform(8.0, 25.0).to_radians(), s.random.uniform(0.05, 0.4).to_radians());
    let poses: Vec<Pose> = (0..views)
        .map(|k| {
            let r = &mut s.random;
            let rotation = looking(r.normal(wander), pitch + r.normal(wander), r.normal(0.5 * wander));
            Pose::new(rotation, Vector3::new(0.5 * k as f64, 0.0, 1.4))
        })
        .collect();
    s.scene(size, optics, &poses)
}

fn downward(s: &mut Studio, off_deg: [f64; 2]) -> Scene {
    let count = s.random.between(2, 5);
    let tilts: Vec<Tilt> = (0..count)
        .map(|_| {
            let off = s.random.uniform(off_deg[0], off_deg[1]);
            ((90.0 - off).to_radians(), s.random.uniform(-3.0, 3.0))
        })
        .collect();
    let mut scene = motions(s, &tilts, [20.0, 80.0], 0.15);
    tilted_each(s, &mut scene, [0.0, 0.1]);
    scene
}

fn grazing(s: &mut Studio) -> Scene {
    let count = s.random.between(1, 4);
    let tilts: Vec<Tilt> =
        (0..count).map(|_| (s.random.uniform(5.0, 14.0).to_radians(), s.random.uniform(-0.3, 0.3))).collect();
    let mut scene = motions(s, &tilts, [10.0, 25.0], 0.5);
    tilted_each(s, &mut scene, [0.0, 0.15]);
    scene
}

fn two_pictures(s: &mut Studio) -> Scene {
    let mut scene = s.tripod(1, 2);
    tilted_each(s, &mut scene, [0.05, 0.5]);
    scene
}

fn elevations(s: &mut Studio) -> Scene {
    let count = s.random.between(3, 4);
    let tilts: Vec<Tilt> = (0..count)
        .map(|k| ((30.0 + 11.0 * k as f64 + s.random.uniform(-2.0, 2.0)).to_radians(), s.random.normal(0.003)))
        .collect();
    let mut scene = motions(s, &tilts, [15.0, 32.0], 0.2);
    let mut optics = scene.views[0].optics;
    optics.cx += s.random.either_sign(0.04, 0.12) * scene.size[0] as f64;
    scene.set_optics(optics);
    tilted_each(s, &mut scene, [0.0, 0.1]);
    scene
}

fn two_alike(s: &mut Studio) -> Scene {
    let (pitch, roll) = s.tilts(1)[0];
    let apart = s.random.uniform(1.0, 5.0).to_radians();
    let direction = s.random.level_direction() * apart;
    let mut scene = motions(s, &[(pitch, roll), (pitch + direction.x, roll + direction.y)], [14.0, 34.0], 0.2);
    tilted_each(s, &mut scene, [0.05, 0.15]);
    scene
}

fn one_off(s: &mut Studio) -> Scene {
    let views = s.random.between(3, 4);
    let mut scene = s.one_attitude(views);
    let mut optics = scene.views[0].optics;
    let way = s.random.level_direction() * s.random.uniform(0.05, 0.12) * scene.size[0] as f64;
    (optics.cx, optics.cy) = (optics.cx + way.x, optics.cy + way.y);
    scene.set_optics(optics);
    scene
}

fn telephoto(s: &mut Studio) -> Scene {
    let mut scene = s.good_set();
    let optics = scene.views[0].optics;
    let factor = s.random.log_uniform(3.0, 8.0) * scene.size[0] as f64 / optics.fx;
    scene.set_optics(optics.zoomed(factor).with(crate::lies::optics::Bending::NONE));
    // As far away as it takes to see the same floor.
    let origin: Vec<Vector3<f64>> = scene.views.iter().map(|v| Studio::looked_at(&v.pose)).collect();
    for (v, at) in scene.views.iter_mut().zip(origin) {
        v.pose.centre = at + (v.pose.centre - at) * factor;
    }
    let turn = s.random.level_direction() * 0.3;
    scene.views.iter_mut().skip(1).step_by(2).for_each(|v| v.pose.centre += turn);
    scene
}
