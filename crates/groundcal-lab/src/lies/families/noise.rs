//! Families in which the matches are not what a good matcher gives.

use crate::lies::{family::Family, kind::Kind::Violated, scene::NoiseKind, scene::Scene, studio::Studio};

pub(crate) const FAMILIES: &[Family] = &[
    Family::points("heavy_tails", Violated, "match errors of Student's t with three degrees of freedom", heavy),
    Family::points("correlated_noise", Violated, "half of the match errors smooth over each picture", correlated),
    Family::points(
        "correlated_one_attitude",
        Violated,
        "half of the match errors smooth over each picture, one attitude",
        correlated_one,
    ),
    Family::points("whole_pixels", Violated, "matches in whole pixels", |s| quantised(s, 1.0)),
    Family::points("coarse_pixels", Violated, "matches in steps of two to four pixels (of a smaller picture)", coarse),
    Family::points("outliers", Violated, "40 to 60 per cent of the matches wrong", outliers),
    Family::points(
        "outliers_agreeing",
        Violated,
        "30 to 50 per cent wrong, most of them in agreement with each other",
        agreeing,
    ),
    Family::points("few_matches", Violated, "8 to 15 matches a pair, several attitudes", few),
    Family::points("few_matches_single", Violated, "8 to 20 matches, two pictures", few_single),
    Family::points("one_corner", Violated, "matches in a part of the picture only", one_corner),
    Family::points("strip", Violated, "matches in a strip of the picture only", strip),
    Family::points(
        "wrong_sigmas",
        Violated,
        "deviations given with the matches are wrong by up to five times",
        wrong_sigmas,
    ),
    Family::points(
        "one_pair_blurred",
        Violated,
        "the matches of one motion 4 to 15 times as noisy as the others",
        one_blurred,
    ),
    Family::points("noisy", Violated, "match errors of 1 to 3 pixels", noisy),
];

fn heavy(s: &mut Studio) -> Scene {
    let mut scene = s.good_set();
    scene.matching.kind = NoiseKind::HeavyTailed;
    scene
}

fn correlated(s: &mut Studio) -> Scene {
    let mut scene = s.good_set();
    scene.matching.kind = NoiseKind::Correlated;
    scene
}

fn correlated_one(s: &mut Studio) -> Scene {
    let views = s.random.between(2, 6);
    let mut scene = s.one_attitude(views);
    scene.matching.kind = NoiseKind::Correlated;
    scene
}

fn quantised(s: &mut Studio, step: f64) -> Scene {
    let mut scene = s.good_set();
    scene.matching.kind = NoiseKind::Quantised(step);
    scene
}

fn coarse(s: &mut Studio) -> Scene {
    let step = s.random.one_of(&[2.0, 4.0]);
    quantised(s, step)
}

fn outliers(s: &mut Studio) -> Scene {
    let mut scene = s.good_set();
    scene.matching.outliers = s.random.uniform(0.4, 0.6);
    scene
}

fn agreeing(s: &mut Studio) -> Scene {
    let mut scene = s.good_set();
    scene.matching.outliers = s.random.uniform(0.3, 0.5);
    scene.matching.conspiracy = s.random.uniform(0.6, 0.95);
    scene
}

fn few(s: &mut Studio) -> Scene {
    let mut scene = s.good_set();
    (scene.matching.points, scene.matching.most) = (40, s.random.between(8, 15));
    scene.matching.outliers = 0.0;
    scene
}

fn few_single(s: &mut Studio) -> Scene {
    let mut scene = s.tripod(1, 2);
    (scene.matching.points, scene.matching.most) = (40, s.random.between(8, 20));
    scene.matching.outliers = s.random.uniform(0.0, 0.1);
    scene
}

fn one_corner(s: &mut Studio) -> Scene {
    let mut scene = s.good_set();
    let (left, top) = (s.random.one_of(&[0.0, 0.25, 0.5]), s.random.one_of(&[0.0, 0.25, 0.5]));
    scene.matching.window = [left, top, left + 0.5, top + 0.5];
    scene
}

fn strip(s: &mut Studio) -> Scene {
    let mut scene = s.good_set();
    let top = s.random.uniform(0.2, 0.6);
    scene.matching.window = [0.0, top, 1.0, top + s.random.uniform(0.12, 0.3)];
    scene
}

fn wrong_sigmas(s: &mut Studio) -> Scene {
    let mut scene = s.good_set();
    scene.matching.wrong_sigmas = Some(5.0);
    scene
}

fn one_blurred(s: &mut Studio) -> Scene {
    let mut scene = s.good_set();
    let motion = s.random.below(scene.views.len() / 2);
    scene.matching.blurred = vec![(2 * motion, 2 * motion + 1, s.random.uniform(4.0, 15.0))];
    scene
}

fn noisy(s: &mut Studio) -> Scene {
    let mut scene = s.good_set();
    scene.matching.sigma_px = s.random.uniform(1.0, 3.0);
    scene
}
