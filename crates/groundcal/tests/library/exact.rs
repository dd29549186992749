//! Exact matches: the camera to 1e-9 relative under every constraint, whatever the order or the unit.

use groundcal::{
    LensModel, Options, Silent, calibrate_matches,
    geometry::{ImageSize, Intrinsics},
    pairs::{ImagePair, PointMatch},
    result::Camera,
    start::Constraint,
    synthetic::{MotionSpec, PointScene},
};

/// The general camera that each constraint allows; the principal point is held at the given place.
fn truth(constraint: Constraint) -> Intrinsics {
    let general = Intrinsics { fx: 1010.0, fy: 995.0, cx: 652.0, cy: 471.0, skew: 3.0 };
    let k = match constraint {
        Constraint::Full => general,
        Constraint::ZeroSkew | Constraint::FixedPrincipalPoint => Intrinsics { skew: 0.0, ..general },
        Constraint::Auto | Constraint::Square | Constraint::Focal => {
            Intrinsics { skew: 0.0, fy: general.fx, ..general }
        }
    };
    // The prior of `auto` pulls to the middle: put the truth there, for exact agreement.
    if constraint == Constraint::Auto { Intrinsics { cx: 639.5, cy: 479.5, ..k } } else { k }
}

fn scene(constraint: Constraint) -> PointScene {
    let motion = |pitch: f64, roll: f64, turn: f64, shift: [f64; 2], ratio: f64| MotionSpec {
        shift,
        height_ratio: ratio,
        ..MotionSpec::about_axis(pitch.to_radians(), roll.to_radians(), turn.to_radians(), 0.2, 1.5)
    };
    PointScene {
        intrinsics: truth(constraint),
        sigma_px: 0.0,
        matches: 60,
        motions: vec![
            motion(50.0, 5.0, 20.0, [0.1, 0.2], 1.0),
            motion(40.0, 30.0, -25.0, [0.0, 0.0], 1.0),
            motion(60.0, -40.0, 40.0, [-0.2, 0.1], 1.2),
            motion(45.0, 70.0, 15.0, [0.0, 0.3], 1.0),
            motion(55.0, -15.0, -33.0, [0.2, -0.1], 0.9),
        ],
        ..PointScene::nominal(7)
    }
}

fn solve(pairs: &[ImagePair], size: ImageSize, constraint: Constraint, principal_point_px: Option<[f64; 2]>) -> Camera {
    let names: Vec<String> = (0..10).map(|i| i.to_string()).collect();
    let options = Options { constraint, principal_point_px, lens: LensModel::None, ..Options::default() };
    let c = calibrate_matches(&names, size, pairs, &options, &Silent).expect("a camera");
    assert!(c.motions.iter().all(|m| m.used), "{constraint:?}: {:?}", c.motions);
    c.camera
}

fn held_point(constraint: Constraint) -> Option<[f64; 2]> {
    let k = truth(constraint);
    matches!(constraint, Constraint::Focal | Constraint::FixedPrincipalPoint).then_some([k.cx, k.cy])
}

fn assert_close(k: &Camera, t: &Intrinsics, scale: f64, constraint: Constraint) {
    for (name, found, expected) in
        [("fx", k.fx, t.fx), ("fy", k.fy, t.fy), ("cx", k.cx, t.cx), ("cy", k.cy, t.cy), ("skew", k.skew, t.skew)]
    {
        let error = (found - expected * scale).abs() / (t.fx * scale);
        assert!(error < 1e-9, "{constraint:?} {name}: {found} instead of {}, error {error:e}", expected * scale);
    }
}

fn pairs_of(scene: &PointScene) -> Vec<ImagePair> {
    scene.pairs()
}

#[test]
fn the_camera_to_1e_9_under_every_constraint() {
    for constraint in Constraint::ALL {
        let scene = scene(constraint);
        let k = solve(&pairs_of(&scene), scene.size, constraint, held_point(constraint));
        assert_close(&k, &scene.intrinsics, 1.0, constraint);
    }
}

#[test]
fn the_order_of_images_and_matches_does_not_matter() {
    for constraint in Constraint::ALL {
        let scene = scene(constraint);
        let mut pairs = pairs_of(&scene);
        pairs.reverse();
        for (i, pair) in pairs.iter_mut().enumerate() {
            pair.matches.rotate_left(17);
            if i % 2 == 0 {
                // The second image first.
                std::mem::swap(&mut pair.from, &mut pair.to);
                for m in &mut pair.matches {
                    std::mem::swap(&mut m.a, &mut m.b);
                }
            }
        }
        let k = solve(&pairs, scene.size, constraint, held_point(constraint));
        assert_close(&k, &scene.intrinsics, 1.0, constraint);
    }
}

#[test]
fn the_unit_of_the_coordinates_does_not_matter() {
    for constraint in Constraint::ALL {
        let scene = scene(constraint);
        // Pixel centres: (0, 0) stays where it is, so the image's centre moves with the factor only to half a pixel.
        let factor = 10.0;
        let size = ImageSize::new(scene.size.width * 10, scene.size.height * 10);
        let pairs: Vec<ImagePair> = pairs_of(&scene)
            .into_iter()
            .map(|p| {
                let matches = p.matches.iter().map(|m| PointMatch { a: m.a * factor, b: m.b * factor, ..*m }).collect();
                ImagePair { matches, ..p }
            })
            .collect();
        let t = truth(constraint);
        // `auto` too: its prior is centred on the scaled point.
        let held = (held_point(constraint).is_some() || constraint == Constraint::Auto)
            .then_some([t.cx * factor, t.cy * factor]);
        let k = solve(&pairs, size, constraint, held);
        assert_close(&k, &t, factor, constraint);
    }
}
