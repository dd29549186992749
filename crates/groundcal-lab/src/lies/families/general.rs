//! Families in which the camera moved more freely than about a plane's normal: what people do who have not read the manual.

use nalgebra::Vector3;

use crate::lies::{
    family::Family,
    kind::Kind::{General, Violated},
    pose::{Pose, looking, looking_at},
    scene::Scene,
    studio::Studio,
    surface::{Region, Shape, Surface},
};

pub(crate) const FAMILIES: &[Family] = &[
    Family::points("hand_held_2", General, "two pictures from the hand around a piece of floor", |s| {
        s.hand_held(2, [8.0, 55.0])
    }),
    Family::points("hand_held_3", General, "three pictures from the hand", |s| s.hand_held(3, [8.0, 55.0])),
    Family::points("hand_held_4", General, "four pictures from the hand", |s| s.hand_held(4, [8.0, 55.0])),
    Family::points("hand_held_6", General, "six pictures from the hand", |s| s.hand_held(6, [8.0, 55.0])),
    Family::points("hand_held_10", General, "ten pictures from the hand", |s| s.hand_held(10, [8.0, 55.0])),
    Family::points("hand_held_alike", General, "three to eight pictures from the hand, all tilted much alike", alike),
    Family::points(
        "hand_held_sequence",
        General,
        "a walk with the camera in the hand, tilt wandering by degrees",
        walk,
    ),
    Family::points("hand_held_named", Violated, "pictures from the hand, neighbours named as motions", named),
    Family::points(
        "wall_hand_held",
        General,
        "three to eight pictures of a wall or poster from the hand",
        wall_hand_held,
    ),
    Family::points("wall_turn", General, "a level camera turned before a wall: the axis lies in the plane", wall_turn),
    Family::points("orbit", General, "round a point of the floor, always looking at it, height wandering", orbit),
    Family::points("crane", General, "axis along the normal, height of every view its own by up to 25 per cent", crane),
    Family::points("crane_two", General, "one pair whose height changed by 3 to 25 per cent", crane_two),
    Family::points("pan_tilt_far", General, "on the spot, two or three rows of a panorama of far things", pan_tilt_far),
    Family::points("pan_tilt_floor", General, "on the spot, two or three rows over a floor", pan_tilt_floor),
    Family::points("drone", General, "over the ground at 10 to 40 m, each view tilted by degrees by the wind", drone),
    Family::pictures("hand_held_2_pictures", General, "two pictures from the hand", |s| s.hand_held(2, [8.0, 45.0])),
    Family::pictures("hand_held_4_pictures", General, "four pictures from the hand", |s| s.hand_held(4, [8.0, 45.0])),
    Family::pictures("hand_held_6_pictures", General, "six pictures from the hand", |s| s.hand_held(6, [8.0, 45.0])),
    Family::pictures("hand_held_alike_pictures", General, "pictures from the hand, tilted much alike", alike),
    Family::pictures(
        "pan_tilt_far_pictures",
        General,
        "on the spot, two rows of a panorama of far things",
        pan_tilt_far,
    ),
];

fn alike(s: &mut Studio) -> Scene {
    let views = s.random.between(3, 5);
    let middle = s.random.uniform(20.0, 50.0);
    let spread = s.random.uniform(1.0, 5.0);
    s.hand_held(views, [middle - spread, middle + spread])
}

fn walk(s: &mut Studio) -> Scene {
    let views = s.random.between(6, 14);
    let mut scene = s.one_attitude(views);
    let sigma = s.random.uniform(1.0, 5.0);
    for view in 0..views {
        let degrees = s.random.normal(sigma);
        scene.tilt(view, degrees, &mut s.random);
        scene.views[view].pose.centre.z *= 1.0 + s.random.normal(0.03);
    }
    scene
}

fn named(s: &mut Studio) -> Scene {
    let views = s.random.between(2, 6);
    let mut scene = s.hand_held(views, [15.0, 50.0]);
    scene.named = Some((1..views).map(|i| (i - 1, i)).collect());
    scene
}

/// A wall at x = 0, seen from x < 0.
fn wall(s: &mut Studio) -> Surface {
    let texture = s.texture();
    let frame = Studio::facing(&Vector3::new(-1.0, 0.0, 0.0));
    Surface::fixed(Shape::Plane { region: Region::Everywhere }, texture, Pose::new(frame, Vector3::zeros()))
}

fn wall_hand_held(s: &mut Studio) -> Scene {
    let size = s.size();
    let optics = s.optics(size);
    let views = s.random.between(3, 8);
    let distance = s.random.uniform(0.8, 3.0);
    let poses: Vec<Pose> = (0..views)
        .map(|_| {
            let r = &mut s.random;
            let at = Vector3::new(0.0, r.normal(0.1), r.normal(0.1)) * distance;
            let (across, up) = (r.uniform(-0.7, 0.7), r.uniform(-0.4, 0.4));
            let centre = Vector3::new(-1.0, across, up).normalize() * distance * r.uniform(0.85, 1.2);
            Pose::new(looking_at(&centre, &at, r.normal(0.06)), centre)
        })
        .collect();
    let wall = wall(s);
    let mut scene = s.scene(size, optics, &poses);
    scene.surfaces = vec![wall];
    scene
}

fn wall_turn(s: &mut Studio) -> Scene {
    let size = s.size();
    let optics = s.optics(size);
    let views = s.random.between(2, 6);
    let distance = s.random.uniform(1.0, 4.0);
    let pitch = s.random.normal(0.08);
    let poses: Vec<Pose> = (0..views)
        .map(|_| {
            let r = &mut s.random;
            let way = Vector3::new(r.normal(0.05), r.normal(0.1), 0.0) * distance;
            Pose::new(looking(r.uniform(-0.5, 0.5), pitch, 0.0), Vector3::new(-distance, 0.0, 0.0) + way)
        })
        .collect();
    let wall = wall(s);
    let mut scene = s.scene(size, optics, &poses);
    scene.surfaces = vec![wall];
    scene
}

fn orbit(s: &mut Studio) -> Scene {
    let size = s.size();
    let optics = s.optics(size);
    let views = s.random.between(4, 10);
    let (radius, height) = (s.random.uniform(0.8, 2.0), s.random.uniform(0.8, 1.6));
    let (step, wander) = (s.random.uniform(0.15, 0.4), s.random.uniform(0.01, 0.12));
    let poses: Vec<Pose> = (0..views)
        .map(|k| {
            let r = &mut s.random;
            let angle = step * k as f64;
            let centre = Vector3::new(radius * angle.cos(), radius * angle.sin(), height * (1.0 + r.normal(wander)));
            let at = Vector3::new(r.normal(0.03), r.normal(0.03), 0.0);
            Pose::new(looking_at(&centre, &at, r.normal(0.02)), centre)
        })
        .collect();
    s.scene(size, optics, &poses)
}

fn crane(s: &mut Studio) -> Scene {
    let mut scene = s.good_set();
    for v in &mut scene.views {
        v.pose.centre.z *= 1.0 + s.random.uniform(-0.25, 0.25);
    }
    scene
}

fn crane_two(s: &mut Studio) -> Scene {
    let mut scene = s.tripod(1, 2);
    scene.views[1].pose.centre.z *= 1.0 + s.random.either_sign(0.03, 0.25);
    scene
}

fn rows(s: &mut Studio) -> (Vec<f64>, usize) {
    let step = s.random.uniform(14.0, 22.0);
    let columns = s.random.between(3, 5);
    ((0..columns).map(|k| step * k as f64).collect(), s.random.between(2, 3))
}

fn pan_tilt_far(s: &mut Studio) -> Scene {
    let size = s.size();
    let optics = s.optics(size);
    let (headings, count) = rows(s);
    let first = s.random.uniform(-15.0, 5.0);
    let pitches: Vec<f64> = (0..count).map(|k| first + 14.0 * k as f64).collect();
    let poses = s.head_poses(&headings, &pitches, 0.0, 0.0);
    let mut scene = s.scene(size, optics, &poses);
    scene.surfaces = vec![s.far_away(1000.0)];
    scene
}

fn pan_tilt_floor(s: &mut Studio) -> Scene {
    let size = s.size();
    let optics = s.optics(size);
    let (headings, count) = rows(s);
    let first = s.random.uniform(28.0, 36.0);
    let pitches: Vec<f64> = (0..count).map(|k| first + 13.0 * k as f64).collect();
    let poses = s.head_poses(&headings, &pitches, 1.5, 0.0);
    s.scene(size, optics, &poses)
}

fn drone(s: &mut Studio) -> Scene {
    let views = s.random.between(4, 10);
    let mut scene = s.one_attitude(views);
    let wind = s.random.uniform(0.3, 3.0);
    for view in 0..views {
        let degrees = s.random.normal(wind);
        scene.tilt(view, degrees, &mut s.random);
        scene.views[view].pose.centre.z *= 1.0 + s.random.normal(0.02);
    }
    scene
}
