//! Families in which all holds that is assumed: they must be answered, and rightly.

use crate::lies::{
    family::Family,
    kind::Kind::WellSpecified,
    optics::Bending,
    pose::Pose,
    scene::Scene,
    studio::Studio,
    surface::{Shape, Surface},
    texture::Texture,
};

pub(crate) const FAMILIES: &[Family] = &[
    Family::points("good_apart", WellSpecified, "four to six attitudes, each over a floor of its own", apart),
    Family::points("good_together", WellSpecified, "four to six attitudes over one floor", together),
    Family::points("good_three_views", WellSpecified, "three or four attitudes of three pictures", three_views),
    Family::points("good_two_attitudes", WellSpecified, "two attitudes of two or three pictures", two_attitudes),
    Family::points("good_single_motion", WellSpecified, "two pictures of one attitude", single_motion),
    Family::points("good_robot", WellSpecified, "one attitude, six to twelve pictures of a robot's way", robot),
    Family::points("good_barrel", WellSpecified, "k1 of -0.1 to -0.25, four to six attitudes", barrel),
    Family::points("good_outliers", WellSpecified, "20 to 35 per cent of wrong matches", outliers),
    Family::points(
        "good_small_pitch",
        WellSpecified,
        "each view pitched by 0.05 to 0.15 degrees, five or six attitudes",
        small_pitch,
    ),
    Family::points("good_head", WellSpecified, "pan head over a floor, four or five elevations", head),
    Family::points("good_ring_far", WellSpecified, "full turn on the spot, level, all things far away", ring_far),
    Family::pictures("good_tripod_pictures", WellSpecified, "three or four attitudes", Studio::good_set),
    Family::pictures("good_together_pictures", WellSpecified, "three attitudes over one floor", |s| {
        s.tripod_on(3, 2, true)
    }),
    Family::pictures("good_two_attitudes_pictures", WellSpecified, "two attitudes", |s| s.tripod(2, 2)),
    Family::pictures("good_barrel_pictures", WellSpecified, "k1 of -0.1 to -0.25, three or four attitudes", barrel),
];

fn apart(s: &mut Studio) -> Scene {
    let attitudes = s.random.between(4, 6);
    s.tripod_on(attitudes, 2, false)
}

fn together(s: &mut Studio) -> Scene {
    let attitudes = s.random.between(4, 6);
    s.tripod_on(attitudes, 2, true)
}

fn three_views(s: &mut Studio) -> Scene {
    let attitudes = s.random.between(3, 4);
    s.tripod(attitudes, 3)
}

fn two_attitudes(s: &mut Studio) -> Scene {
    let each = s.random.between(2, 3);
    s.tripod(2, each)
}

fn single_motion(s: &mut Studio) -> Scene {
    s.tripod(1, 2)
}

fn robot(s: &mut Studio) -> Scene {
    let views = s.random.between(6, 12);
    s.one_attitude(views)
}

fn barrel(s: &mut Studio) -> Scene {
    let mut scene = s.good_set();
    let k1 = s.random.uniform(-0.25, -0.1);
    scene.set_optics(scene.views[0].optics.with(Bending::radial(k1, s.random.uniform(0.0, 0.3) * k1 * k1)));
    scene
}

fn outliers(s: &mut Studio) -> Scene {
    let mut scene = s.good_set();
    scene.matching.outliers = s.random.uniform(0.2, 0.35);
    scene
}

fn small_pitch(s: &mut Studio) -> Scene {
    let attitudes = s.random.between(5, 6);
    let mut scene = s.tripod(attitudes, 2);
    let sigma = s.random.uniform(0.05, 0.15);
    for view in 0..scene.views.len() {
        let degrees = s.random.normal(sigma);
        scene.tilt(view, degrees, &mut s.random);
    }
    scene
}

fn head(s: &mut Studio) -> Scene {
    let size = s.size();
    let optics = s.optics(size);
    let count = s.random.between(4, 5);
    let height = s.random.uniform(1.0, 1.6);
    let mut poses: Vec<Pose> = Vec::new();
    for k in 0..count {
        let pitch = 32.0 + 9.0 * k as f64 + s.random.uniform(-2.0, 2.0);
        let turn = s.random.uniform(16.0, 30.0);
        poses.extend(s.head_poses(&[0.0, turn], &[pitch], height, 0.05));
    }
    s.scene(size, optics, &poses)
}

fn ring_far(s: &mut Studio) -> Scene {
    let size = s.size();
    let optics = s.optics(size);
    let count = s.random.between(14, 18);
    let headings: Vec<f64> = (0..count).map(|k| 360.0 / count as f64 * k as f64 + s.random.normal(1.0)).collect();
    let pitch = s.random.uniform(-4.0, 8.0);
    let poses = s.head_poses(&headings, &[pitch], 0.0, 0.0);
    let mut scene = s.scene(size, optics, &poses);
    let texture = Texture::far(s.random.seed(), 1000.0);
    scene.surfaces = vec![Surface::fixed(Shape::Sphere { radius_m: 10_000.0 }, texture, Pose::identity())];
    scene
}
