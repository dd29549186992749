//! Families in which some of the pictures are not what they are taken for: which to believe is the question.

use crate::lies::{
    family::Family,
    kind::Kind::{Degenerate, General, Violated},
    optics::Bending,
    scene::{Flip, Scene},
    studio::Studio,
};

pub(crate) const FAMILIES: &[Family] = &[
    Family::points("two_tilted", Violated, "two pictures whose attitudes differ by 3 to 25 degrees", two_tilted),
    Family::points(
        "two_tilted_slightly",
        Violated,
        "two pictures whose attitudes differ by 0.5 to 3 degrees",
        two_tilted_slightly,
    ),
    Family::points(
        "three_one_wrong",
        Violated,
        "three pictures, two of one attitude, the third tilted",
        three_one_wrong,
    ),
    Family::points(
        "three_motions_one_wrong",
        Violated,
        "three motions, one tilted by 1 to 8 degrees between its pictures",
        |s| wrong_motion(s, 3, false),
    ),
    Family::points(
        "four_motions_one_wrong",
        Violated,
        "four motions, one tilted by 1 to 8 degrees between its pictures",
        |s| wrong_motion(s, 4, false),
    ),
    Family::points(
        "four_named_one_wrong",
        Violated,
        "four motions named by the user, one of them tilted by 1 to 8 degrees",
        |s| wrong_motion(s, 4, true),
    ),
    Family::points(
        "two_motions_one_wrong",
        Violated,
        "two motions, one tilted by 1 to 8 degrees between its pictures",
        |s| wrong_motion(s, 2, false),
    ),
    Family::points("shuffled_head", Violated, "many attitudes over one floor, pictures in any order", shuffled),
    Family::points(
        "many_attitudes_alone",
        General,
        "five to eight pictures on one floor, no two of one attitude",
        alone,
    ),
    Family::points(
        "one_pair_among_many",
        Violated,
        "one true motion among four to six pictures of other attitudes",
        one_pair,
    ),
    Family::points(
        "ring_one_bad",
        Violated,
        "full turn over a floor; one picture tilted by 1.5 to 5 degrees",
        ring_one_bad,
    ),
    Family::points(
        "ring_one_bad_far",
        Violated,
        "full turn before far things, one pair of poor matches",
        ring_poor_pair,
    ),
    Family::points("copies", Violated, "good motions, some pictures twice under other names", copies),
    Family::points(
        "copies_of_wrong",
        Violated,
        "three motions; the tilted one is there two or three times",
        copies_of_wrong,
    ),
    Family::points(
        "single_motion_copies",
        Degenerate,
        "one motion and copies of its pictures: nothing new",
        single_copies,
    ),
    Family::points("other_camera", Violated, "of four or five motions one by another camera", other_camera),
    Family::points("other_camera_half", Violated, "half of the motions by another camera", other_camera_half),
    Family::points(
        "mirrored_some",
        Violated,
        "one or two pictures left-right mirrored (a front camera)",
        mirrored_some,
    ),
    Family::points("upside_down_some", Violated, "some pictures turned by 180 degrees", upside_down_some),
    Family::points(
        "upside_down_pairs",
        Violated,
        "in every motion the second picture is turned by 180 degrees",
        upside_down_pairs,
    ),
    Family::pictures(
        "two_tilted_pictures",
        Violated,
        "two pictures whose attitudes differ by 3 to 25 degrees",
        two_tilted,
    ),
    Family::pictures("three_one_wrong_pictures", Violated, "three pictures, the third tilted", three_one_wrong),
    Family::pictures("four_motions_one_wrong_pictures", Violated, "four motions, one tilted by 1 to 8 degrees", |s| {
        wrong_motion(s, 4, false)
    }),
    Family::pictures("shuffled_head_pictures", Violated, "attitudes over one floor, pictures in any order", shuffled),
    Family::pictures("other_camera_pictures", Violated, "one motion by another camera", other_camera),
    Family::pictures("copies_of_wrong_pictures", Violated, "three motions, the tilted one twice", copies_of_wrong),
];

fn tilted_pair(s: &mut Studio, degrees: [f64; 2]) -> Scene {
    let mut scene = s.tripod(1, 2);
    let tilt = s.random.uniform(degrees[0], degrees[1]);
    scene.tilt(1, tilt, &mut s.random);
    scene
}

fn two_tilted(s: &mut Studio) -> Scene {
    tilted_pair(s, [3.0, 25.0])
}

fn two_tilted_slightly(s: &mut Studio) -> Scene {
    tilted_pair(s, [0.5, 3.0])
}

fn three_one_wrong(s: &mut Studio) -> Scene {
    let mut scene = s.tripod(1, 3);
    let tilt = s.random.either_sign(3.0, 20.0);
    let view = s.random.below(3);
    scene.tilt(view, tilt, &mut s.random);
    scene
}

fn wrong_motion(s: &mut Studio, motions: usize, named: bool) -> Scene {
    let mut scene = s.tripod(motions, 2);
    let motion = s.random.below(motions);
    let tilt = s.random.uniform(1.0, 8.0);
    scene.tilt(2 * motion + 1, tilt, &mut s.random);
    if named {
        scene.named = Some((0..motions).map(|m| (2 * m, 2 * m + 1)).collect());
    }
    scene
}

fn shuffled(s: &mut Studio) -> Scene {
    let attitudes = s.random.between(3, 5);
    let mut scene = s.tripod_on(attitudes, 2, true);
    let order = s.random.order(scene.views.len());
    scene.reorder(&order);
    scene
}

fn alone(s: &mut Studio) -> Scene {
    let attitudes = s.random.between(5, 8);
    s.tripod_on(attitudes, 1, true)
}

fn one_pair(s: &mut Studio) -> Scene {
    let attitudes = s.random.between(4, 6);
    let mut scene = s.tripod_on(attitudes, 2, true);
    let lonely: Vec<usize> = (0..attitudes).flat_map(|a| if a == 0 { vec![0, 1] } else { vec![2 * a] }).collect();
    scene.views = lonely.iter().map(|&i| scene.views[i].clone()).collect();
    let order = s.random.order(scene.views.len());
    scene.reorder(&order);
    scene
}

/// A full turn over a floor, the lens a little off the axis.
fn ring(s: &mut Studio) -> Scene {
    let size = s.size();
    let optics = s.optics(size);
    let count = s.random.between(12, 18);
    let headings: Vec<f64> = (0..count).map(|k| 360.0 / count as f64 * k as f64 + s.random.normal(1.0)).collect();
    let pitch = s.random.uniform(35.0, 60.0);
    let poses = s.head_poses(&headings, &[pitch], 1.4, 0.08);
    s.scene(size, optics, &poses)
}

fn ring_one_bad(s: &mut Studio) -> Scene {
    let mut scene = ring(s);
    let view = s.random.below(scene.views.len());
    let tilt = s.random.uniform(1.5, 5.0);
    scene.tilt(view, tilt, &mut s.random);
    scene
}

fn ring_poor_pair(s: &mut Studio) -> Scene {
    let mut scene = ring(s);
    let height = scene.views[0].pose.centre.z;
    scene.views.iter_mut().for_each(|v| v.pose.centre.z -= height);
    scene.surfaces = vec![s.far_away(60.0)];
    let count = scene.views.len();
    let bad = s.random.below(count - 1);
    scene.matching.blurred = vec![(bad, bad + 1, s.random.uniform(6.0, 20.0))];
    scene
}

fn copies(s: &mut Studio) -> Scene {
    let mut scene = s.tripod(3, 2);
    for _ in 0..s.random.between(1, 3) {
        copy(&mut scene, s.random.below(6));
    }
    scene
}

fn copy(scene: &mut Scene, original: usize) {
    let mut view = scene.views[original].clone();
    view.copy_of = Some(original);
    scene.views.push(view);
}

fn copies_of_wrong(s: &mut Studio) -> Scene {
    let mut scene = s.tripod(3, 2);
    let tilt = s.random.uniform(1.0, 6.0);
    scene.tilt(5, tilt, &mut s.random);
    for _ in 0..s.random.between(1, 2) {
        copy(&mut scene, 4);
        copy(&mut scene, 5);
    }
    scene
}

fn single_copies(s: &mut Studio) -> Scene {
    let mut scene = tilted_pair(s, [0.0, 4.0]);
    for _ in 0..s.random.between(1, 3) {
        copy(&mut scene, 0);
        copy(&mut scene, 1);
    }
    scene
}

fn by_another(s: &mut Studio, scene: &mut Scene, motions: &[usize]) {
    let mut other = s.optics(scene.size);
    other = other.zoomed(s.random.one_of(&[0.8, 0.9, 1.1, 1.25]) * scene.views[0].optics.fx / other.fx);
    for &m in motions {
        scene.views[2 * m].optics = other;
        scene.views[2 * m + 1].optics = other;
    }
}

fn other_camera(s: &mut Studio) -> Scene {
    let mut scene = s.good_set();
    let motion = s.random.below(scene.views.len() / 2);
    by_another(s, &mut scene, &[motion]);
    scene
}

fn other_camera_half(s: &mut Studio) -> Scene {
    let mut scene = s.tripod(4, 2);
    by_another(s, &mut scene, &[2, 3]);
    scene.any_camera_is_right();
    scene
}

fn mirrored_some(s: &mut Studio) -> Scene {
    let mut scene = s.good_set();
    let centred = Bending::radial(s.random.uniform(-0.1, 0.02), 0.0);
    scene.set_optics(scene.views[0].optics.with(centred));
    for _ in 0..s.random.between(1, 2) {
        let view = s.random.below(scene.views.len());
        scene.views[view].flip = Flip::Mirrored;
    }
    scene.any_camera_is_right();
    scene
}

fn upside_down_some(s: &mut Studio) -> Scene {
    let mut scene = s.good_set();
    for view in 0..scene.views.len() {
        if s.random.chance(0.3) {
            scene.views[view].flip = Flip::UpsideDown;
        }
    }
    scene.any_camera_is_right();
    scene
}

fn upside_down_pairs(s: &mut Studio) -> Scene {
    let mut scene = s.good_set();
    // The axis well off the middle, as in a cropped picture: turned pictures then disagree about it.
    let mut optics = scene.views[0].optics;
    optics.cx += s.random.either_sign(0.02, 0.06) * scene.size[0] as f64;
    scene.set_optics(optics);
    for view in (1..scene.views.len()).step_by(2) {
        scene.views[view].flip = Flip::UpsideDown;
    }
    scene.any_camera_is_right();
    scene
}
