//! A picture under another name, and matches under other names, count once.

use groundcal::{
    Options, Silent, calibrate_matches,
    pairs::{ImagePair, PointMatch},
    result::{Calibration, Parameter, Warning},
    synthetic::PointScene,
};

fn calibrate(scene: &PointScene, pairs: &[ImagePair]) -> Calibration {
    let images = pairs.iter().map(|p| p.from.max(p.to) + 1).max().expect("pairs");
    let names: Vec<String> = (0..images).map(|i| i.to_string()).collect();
    calibrate_matches(&names, scene.size, pairs, &Options::default(), &Silent).unwrap_or_else(|error| panic!("{error}"))
}

fn given(scene: &PointScene) -> Vec<ImagePair> {
    scene.pairs()
}

fn copies(c: &Calibration) -> Vec<[String; 2]> {
    let of = |w: &'_ Warning| match w {
        Warning::DuplicateImages { first, second } => Some([first.clone(), second.clone()]),
        _ => None,
    };
    c.warnings.iter().filter_map(of).collect()
}

/// The matches of a pair whose first picture is there again, displaced by as much; every fifth wrong.
fn again(pair: &ImagePair, copy: usize, displaced_px: f64) -> ImagePair {
    let mut matches = Vec::new();
    for (i, m) in pair.matches.iter().enumerate() {
        let (x, y) = (m.a.x, m.a.y);
        let by = if i % 5 == 0 { 40.0 } else { displaced_px };
        let angle = (i * 37 % 100) as f64;
        matches.push(PointMatch::new([x, y], [x + by * angle.cos(), y + by * angle.sin()]));
    }
    ImagePair { from: pair.from, to: copy, matches }
}

fn same(a: &Calibration, b: &Calibration) {
    for parameter in [Parameter::Fx, Parameter::Cx] {
        assert_eq!(a.standard_deviation(parameter), b.standard_deviation(parameter));
    }
    assert_eq!(a.camera.fx.to_bits(), b.camera.fx.to_bits());
}

#[test]
fn a_picture_saved_again_counts_once() {
    let scene = PointScene::nominal(4);
    let mut pairs = given(&scene);
    let alone = calibrate(&scene, &pairs);
    assert!(copies(&alone).is_empty());
    let copy = 2 * pairs.len();
    let to_other = ImagePair { from: copy, ..pairs[0].clone() };
    pairs.extend([again(&pairs[0], copy, 0.04), to_other]);
    let with = calibrate(&scene, &pairs);
    assert_eq!(copies(&with), [["0".to_string(), copy.to_string()]]);
    same(&alone, &with);
    // Another exposure of a camera that stood still has noise of its own.
    let last = pairs.len() - 2;
    pairs[last] = again(&pairs[0], copy, 0.3);
    pairs[last + 1].matches.iter_mut().enumerate().for_each(|(i, m)| m.a.x += 0.2 * ((i % 7) as f64 - 3.0) / 3.0);
    assert!(copies(&calibrate(&scene, &pairs)).is_empty());
}

#[test]
fn matches_under_other_names_count_once() {
    let scene = PointScene::nominal(5);
    let mut pairs = given(&scene);
    let alone = calibrate(&scene, &pairs);
    let next = 2 * pairs.len();
    let turned = pairs[1].matches.iter().rev().map(|m| PointMatch { a: m.b, b: m.a, ..*m }).collect();
    pairs.push(ImagePair { from: next, to: next + 1, ..pairs[0].clone() });
    pairs.push(ImagePair { from: next + 2, to: next + 3, matches: turned });
    let with = calibrate(&scene, &pairs);
    let expected = ["0", "1", "3", "2"].into_iter().enumerate();
    assert_eq!(
        copies(&with),
        expected.map(|(i, first)| [first.to_string(), (next + i).to_string()]).collect::<Vec<_>>()
    );
    same(&alone, &with);
}
