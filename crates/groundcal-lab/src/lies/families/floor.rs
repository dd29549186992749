//! Families in which what is looked at is not one plane that stands still.

use nalgebra::{Matrix3, Vector3};

use crate::lies::{
    family::Family,
    kind::{
        Kind::{General, Violated},
        Medium,
    },
    optics::Bending,
    pose::{Pose, about},
    scene::Scene,
    studio::Studio,
    surface::{Region, Shape, Surface},
    texture::Texture,
};

pub(crate) const FAMILIES: &[Family] = &[
    Family::points("ramp", Violated, "part of the floor is a ramp of 2 to 12 degrees", ramp),
    Family::points(
        "ramp_one_attitude",
        Violated,
        "one attitude, part of the floor a ramp of 2 to 12 degrees",
        ramp_one,
    ),
    Family::points(
        "cardboard",
        Violated,
        "a richly textured board lies 2 to 8 per cent of the height above a carpet",
        cardboard,
    ),
    Family::points("wall_in_view", Violated, "a wall behind the floor fills much of the pictures", wall_in_view),
    Family::points("relief", Violated, "grass or cobbles: heights within 1 to 5 per cent of the camera's", relief),
    Family::points(
        "relief_single",
        Violated,
        "one motion over heights within 1 to 5 per cent of the camera's",
        relief_single,
    ),
    Family::points("dome", Violated, "a floor that falls off to its drains, or bulges", dome),
    Family::points(
        "moved_rug",
        Violated,
        "a rug with most of the features is pulled along between the pictures",
        moved_rug,
    ),
    Family::points("turntable", Violated, "a turntable before a fixed camera, background standing still", turntable),
    Family::points(
        "turntable_tilted",
        Violated,
        "a thing turned by hand before a fixed camera: axis 0.5 to 4 degrees off",
        turntable_tilted,
    ),
    Family::points("bumper", Violated, "the carrier's bumper in the lower part of every picture", bumper),
    Family::points(
        "tiles_shifted",
        Violated,
        "exactly periodic tiles, a third of all pairs a tile beside the truth",
        |s| periodic(s, 0.35),
    ),
    Family::points("tiles_all_shifted", Violated, "exactly periodic tiles, most pairs a tile beside the truth", |s| {
        periodic(s, 0.9)
    }),
    Family::points(
        "tiles_few_shifted",
        Violated,
        "two or three pictures of exactly periodic tiles, pairs a tile beside the truth",
        periodic_few,
    ),
    Family::points("lawn_panorama", General, "level panorama by hand, lawn below and far things above", lawn_panorama),
    Family::points(
        "lawn_pan_tilt",
        General,
        "pan and tilt on the spot, floor below and far things above",
        lawn_pan_tilt,
    ),
    Family::points("wide_ring_horizon", General, "wide barrel lens, full turn, the horizon in view", wide_ring),
    Family::points(
        "near_panorama",
        Violated,
        "panorama of a room taken for far away: things 2 to 6 m off, the stand moved",
        near_panorama,
    ),
    Family::pictures("ramp_pictures", Violated, "part of the floor is a ramp of 2 to 12 degrees", ramp),
    Family::pictures(
        "cardboard_pictures",
        Violated,
        "a board lies 2 to 8 per cent of the height above the carpet",
        cardboard,
    ),
    Family::pictures("relief_pictures", Violated, "heights within 1 to 5 per cent of the camera's", relief),
    Family::pictures("tiles_pictures", Violated, "exactly periodic tiles", tiles_rendered),
    Family::pictures("chess_pictures", Violated, "a chess floor", chess_rendered),
    Family::pictures("turntable_pictures", Violated, "a turntable, background standing still", turntable),
    Family::pictures(
        "turntable_tilted_pictures",
        Violated,
        "a thing turned by hand, axis 0.5 to 4 degrees off",
        turntable_tilted,
    ),
    Family::pictures(
        "lawn_panorama_pictures",
        General,
        "level panorama by hand, lawn below and far things above",
        lawn_panorama,
    ),
];

/// A slope that rises from the floor where the pictures look.
fn add_ramp(s: &mut Studio, scene: &mut Scene) {
    let angle = s.random.uniform(2.0, 12.0).to_radians();
    let texture = s.texture();
    let mut edges: Vec<Vector3<f64>> = Vec::new();
    for pose in scene.views.iter().map(|v| v.pose) {
        let edge = Studio::looked_at(&pose);
        if edges.iter().any(|e| (e - edge).norm() < 20.0) {
            continue;
        }
        edges.push(edge);
        let along = s.random.level_direction();
        let across = Vector3::z().cross(&along);
        let frame = about(&across, -angle) * Matrix3::from_columns(&[along, across, Vector3::z()]);
        let shape = Shape::Plane { region: Region::Rectangle([2.0, 4.0]) };
        scene.surfaces.push(Surface::fixed(shape, texture, Pose::new(frame, edge + frame.column(0) * 2.0)));
    }
}

fn ramp(s: &mut Studio) -> Scene {
    let mut scene = s.good_set();
    add_ramp(s, &mut scene);
    scene
}

fn ramp_one(s: &mut Studio) -> Scene {
    let views = s.random.between(2, 6);
    let mut scene = s.one_attitude(views);
    add_ramp(s, &mut scene);
    scene
}

/// A board of its own for every place where floors are looked at.
fn boards(s: &mut Studio, scene: &Scene, half_of_height: [f64; 2], above_of_height: [f64; 2]) -> Vec<Surface> {
    let mut places: Vec<Vector3<f64>> = Vec::new();
    let mut all = Vec::new();
    for pose in scene.views.iter().map(|v| v.pose) {
        let at = Studio::looked_at(&pose);
        if places.iter().any(|p| (p - at).norm() < 20.0) {
            continue;
        }
        places.push(at);
        let height = pose.centre.z;
        let [low, high] = half_of_height;
        let half = [s.random.uniform(low, high) * height, s.random.uniform(low, high) * height];
        let above = s.random.uniform(above_of_height[0], above_of_height[1]) * height;
        let turned = about(&Vector3::z(), s.random.uniform(0.0, 3.0));
        let aside = s.random.level_direction() * s.random.uniform(0.0, 0.3) * height;
        all.push(s.board(half, Pose::new(turned, at + aside + Vector3::z() * above)));
    }
    all
}

fn cardboard(s: &mut Studio) -> Scene {
    let mut scene = s.good_set();
    for mut board in boards(s, &scene, [0.35, 0.6], [0.02, 0.08]) {
        board.richness = 3.0;
        scene.surfaces.push(board);
    }
    scene
}

fn wall_in_view(s: &mut Studio) -> Scene {
    let mut scene = s.good_set();
    let walls: Vec<Surface> = scene
        .views
        .chunks(2)
        .map(|motion| {
            let pose = motion[0].pose;
            let at = Studio::looked_at(&pose);
            let forward: Vector3<f64> = pose.rotation.column(2).into_owned();
            let level = Vector3::new(forward.x, forward.y, 0.0).normalize();
            let foot = at + level * s.random.uniform(0.1, 0.6) * pose.centre.z;
            let texture = s.texture();
            let shape = Shape::Plane { region: Region::Rectangle([6.0, 6.0]) };
            Surface::fixed(shape, texture, Pose::new(Studio::facing(&-level), foot))
        })
        .collect();
    // Where the attitudes share one floor there is one wall.
    let apart = (scene.views[0].pose.centre - scene.views[2].pose.centre).norm() > 20.0;
    scene.surfaces.extend(walls.into_iter().take(if apart { usize::MAX } else { 1 }));
    scene
}

fn uneven(s: &mut Studio, scene: &mut Scene) {
    let height = scene.views[0].pose.centre.z;
    let amplitude_m = s.random.uniform(0.01, 0.05) * height;
    let wavelength_m = s.random.log_uniform(0.3, 2.0) * height;
    scene.surfaces[0].shape = Shape::Relief { amplitude_m, wavelength_m, seed: s.random.seed() };
}

fn relief(s: &mut Studio) -> Scene {
    let mut scene = s.good_set();
    uneven(s, &mut scene);
    scene
}

fn relief_single(s: &mut Studio) -> Scene {
    let mut scene = s.tripod(1, 2);
    uneven(s, &mut scene);
    scene
}

fn dome(s: &mut Studio) -> Scene {
    let mut scene = s.tripod_on(4, 2, true);
    let curvature = s.random.either_sign(0.01, 0.06);
    scene.surfaces[0].shape = Shape::Dome { curvature_per_m: curvature };
    scene
}

fn moved_rug(s: &mut Studio) -> Scene {
    let mut scene = s.good_set();
    let mut rugs = boards(s, &scene, [0.5, 0.8], [0.003, 0.006]);
    let views = scene.views.len();
    for rug in &mut rugs {
        rug.richness = 4.0;
        let start = rug.placements[0];
        rug.placements = (0..views)
            .map(|_| {
                let shift = s.random.level_direction() * s.random.uniform(0.02, 0.2);
                let turn = about(&Vector3::z(), s.random.normal(0.15));
                Pose::new(turn * start.rotation, start.centre + shift)
            })
            .collect();
    }
    scene.surfaces.extend(rugs);
    scene
}

/// A disc (a square, here) that turns before a fixed camera, on a table that does not.
fn on_turntable(s: &mut Studio, off_deg: f64) -> Scene {
    let views = s.random.between(3, 6);
    let mut scene = s.tripod(1, 1);
    scene.views = vec![scene.views[0].clone(); views];
    let pose = scene.views[0].pose;
    let at = Studio::looked_at(&pose) + Vector3::z() * 0.02;
    let half = s.random.uniform(0.35, 0.6) * pose.centre.z;
    let mut disc = s.board([half, half], Pose::identity());
    let step = s.random.either_sign(10.0, 30.0).to_radians();
    disc.placements = (0..views)
        .map(|k| {
            let off = about(&s.random.level_direction(), (s.random.normal(1.0) * off_deg).to_radians());
            Pose::new(off * about(&Vector3::z(), step * k as f64), at)
        })
        .collect();
    disc.richness = s.random.uniform(1.0, 3.0);
    scene.surfaces.push(disc);
    scene
}

fn turntable(s: &mut Studio) -> Scene {
    on_turntable(s, 0.0)
}

fn turntable_tilted(s: &mut Studio) -> Scene {
    let off = s.random.uniform(0.5, 4.0);
    on_turntable(s, off)
}

fn bumper(s: &mut Studio) -> Scene {
    let mut scene = s.good_set();
    scene.bumper = Some(s.random.uniform(0.5, 0.8));
    scene
}

fn periodic_floor(s: &mut Studio, scene: &mut Scene) -> f64 {
    let pitch_m = s.random.uniform(0.1, 0.3);
    scene.surfaces[0].texture = if s.random.chance(0.5) {
        Texture::Tiles { seed: s.random.seed(), pitch_m, individual: 0.0 }
    } else {
        Texture::Chess { pitch_m: 0.5 * pitch_m }
    };
    pitch_m
}

fn periodic(s: &mut Studio, fraction: f64) -> Scene {
    let mut scene = s.tripod_on(4, 2, true);
    let pitch = periodic_floor(s, &mut scene);
    s.confuse(&mut scene, pitch, fraction);
    scene
}

fn periodic_few(s: &mut Studio) -> Scene {
    let views = s.random.between(2, 3);
    let tilts = s.tilts(views);
    let poses = s.tripod_poses(&tilts, 1, true);
    let size = s.size();
    let optics = s.optics(size);
    let mut scene = s.scene(size, optics, &poses);
    let pitch = periodic_floor(s, &mut scene);
    s.confuse(&mut scene, pitch, 0.7);
    scene
}

fn tiles_rendered(s: &mut Studio) -> Scene {
    let mut scene = s.tripod_on(3, 2, true);
    scene.surfaces[0].texture =
        Texture::Tiles { seed: s.random.seed(), pitch_m: s.random.uniform(0.1, 0.3), individual: 0.0 };
    scene
}

fn chess_rendered(s: &mut Studio) -> Scene {
    let mut scene = s.tripod_on(3, 2, true);
    scene.surfaces[0].texture = Texture::Chess { pitch_m: s.random.uniform(0.06, 0.15) };
    scene
}

/// Floor below, far things above, the camera 1.5 m over the floor.
fn open_air(s: &mut Studio, poses: &[Pose]) -> Scene {
    let size = s.size();
    let optics = s.optics(size);
    let mut scene = s.scene(size, optics, poses);
    let radius = s.random.log_uniform(15.0, 80.0);
    scene.surfaces.push(s.far_away(radius));
    scene
}

fn lawn_panorama(s: &mut Studio) -> Scene {
    let (headings, pitch) = match s.medium {
        Medium::Points => (s.random.between(8, 16), s.random.uniform(2.0, 14.0)),
        Medium::Pictures => (6, s.random.uniform(4.0, 14.0)),
    };
    let step = s.random.uniform(15.0, 22.0);
    let headings: Vec<f64> = (0..headings).map(|k| step * k as f64).collect();
    let sway = s.random.log_uniform(0.01, 0.15);
    let mut poses = s.head_poses(&headings, &[pitch], 1.5, 0.0);
    for p in &mut poses {
        p.centre += Vector3::new(s.random.normal(sway), s.random.normal(sway), 0.3 * s.random.normal(sway));
        let (axis, angle) = (s.random.level_direction(), s.random.normal(0.015));
        *p = p.turned(&axis, angle);
    }
    open_air(s, &poses)
}

fn lawn_pan_tilt(s: &mut Studio) -> Scene {
    let step = s.random.uniform(14.0, 20.0);
    let headings: Vec<f64> = (0..s.random.between(3, 5)).map(|k| step * k as f64).collect();
    let first = s.random.uniform(2.0, 12.0);
    let ahead = s.random.log_uniform(0.002, 0.06);
    let poses = s.head_poses(&headings, &[first, first + 13.0], 1.5, ahead);
    open_air(s, &poses)
}

fn wide_ring(s: &mut Studio) -> Scene {
    let count = s.random.between(14, 20);
    let headings: Vec<f64> = (0..count).map(|k| 360.0 / count as f64 * k as f64 + s.random.normal(0.5)).collect();
    let pitch = s.random.uniform(8.0, 25.0);
    let poses = s.head_poses(&headings, &[pitch], 1.5, 0.02);
    let mut scene = open_air(s, &poses);
    let optics = scene.views[0].optics;
    let wide = optics.zoomed(0.52 * scene.size[0] as f64 / optics.fx);
    let k1 = s.random.uniform(-0.3, -0.2);
    scene.set_optics(wide.with(Bending::radial(k1, 0.25 * k1 * k1 + 0.02)));
    scene
}

fn near_panorama(s: &mut Studio) -> Scene {
    let count = s.random.between(10, 16);
    let headings: Vec<f64> = (0..count).map(|k| 360.0 / count as f64 * k as f64).collect();
    let pitch = s.random.uniform(-3.0, 8.0);
    let mut poses = s.head_poses(&headings, &[pitch], 0.0, 0.0);
    let moved = s.random.log_uniform(0.01, 0.15);
    for p in &mut poses {
        p.centre += Vector3::new(s.random.normal(moved), s.random.normal(moved), 0.0);
    }
    let size = s.size();
    let optics = s.optics(size);
    let mut scene = s.scene(size, optics, &poses);
    let radius = s.random.uniform(2.0, 6.0);
    scene.surfaces = vec![s.far_away(radius)];
    scene
}
