//! Pairs named as the motions: no other pair is one, and what other pairs show of the same floor is used all the same.

use groundcal::{Calibration, Error, ImagePair, Method, MotionModel, Options, Silent, calibrate_matches};

use crate::floor_views::{self, FOCAL_PX, FloorView, SIZE, Taken, view};

/// The first two turn about the floor's normal, the others look otherwise.
const VIEWS: [FloorView; 5] = [
    view([40.0, 5.0, 0.0], [0.0, 0.0]),
    view([40.0, 5.0, 40.0], [0.3, -0.2]),
    view([58.0, 25.0, 10.0], [0.2, 0.3]),
    view([50.0, -30.0, 70.0], [-0.2, 0.6]),
    view([65.0, 60.0, -20.0], [0.4, 0.1]),
];

fn matches(seed: u64) -> Vec<ImagePair> {
    floor_views::matches(&VIEWS, Taken { aspect: 1.0, row_turn_deg: 0.0 }, seed)
}

fn calibrated(pairs: &[ImagePair], options: &Options) -> Result<Calibration, Error> {
    let names: Vec<String> = (0..VIEWS.len()).map(|i| i.to_string()).collect();
    calibrate_matches(&names, SIZE, pairs, options, &Silent)
}

/// One motion has five equations less than it takes; two views and more of the same floor, which turned anyhow, bring them (the paper's
/// section 2.3).
#[test]
fn views_of_no_motion_complete_a_single_one() {
    let named = Options { pairs: Some(vec![(1, 0)]), ..Options::default() };
    for seed in 0..8 {
        let pairs = matches(seed);
        let c = calibrated(&pairs, &named).expect("a camera");
        let (f, sigma) = (c.camera.fx, c.standard_deviation.fx.expect("estimated"));
        println!("seed {seed}: {f:.2} +- {sigma:.2}, {:?}", c.verdict.as_ref().map(|v| v.level));
        assert!((f - FOCAL_PX).abs() < 3.5 * sigma && sigma < 0.01 * FOCAL_PX, "{f} +- {sigma}");
        assert_eq!((c.views.len(), c.motions.len()), (VIEWS.len(), pairs.len()));
        let used: Vec<&str> = c.motions.iter().filter(|m| m.used).map(|m| m.from.as_str()).collect();
        assert_eq!(used, ["0"], "it leads as the matches do");
        assert!(c.motions.iter().any(|m| m.cross_attitude_link));
        assert!(c.motions[1..].iter().all(|m| !m.used));
        assert!(c.verdict.as_ref().is_some_and(|v| v.checked));
        assert!(!c.warnings.iter().any(|w| w.code() == "single_motion"));
    }
    // Without them it is one motion that nothing checks, whoever names it.
    let alone: Vec<ImagePair> = matches(0).into_iter().filter(|p| (p.from, p.to) == (0, 1)).collect();
    let vouched = Options { motion: MotionModel::PlaneNormal, ..named.clone() };
    let c = calibrated(&alone, &vouched).expect("a camera that is vouched for");
    assert!(c.standard_deviation.fx > Some(0.03 * FOCAL_PX), "{:?}", c.standard_deviation);
    assert!(c.warnings.iter().any(|w| w.code() == "single_motion") && c.verdict.is_some_and(|v| !v.checked));
}

#[test]
fn closed_forms_have_no_use_for_other_pairs() {
    let options = Options { pairs: Some(vec![(0, 1)]), method: Method::Linear, ..Options::default() };
    let c = calibrated(&matches(1), &options).expect("a camera by its priors");
    assert_eq!((c.motions.len(), c.views.len()), (1, 0));
}

/// The linear version: one motion, its circular point carried into the views joined to it. Its deviations are those of its errors.
#[test]
fn one_motion_is_transferred_into_other_views() {
    let options = |pairs| Options { pairs: Some(pairs), method: Method::Transferred, ..Options::default() };
    let trials = 40;
    let mut squares = 0.0;
    for seed in 0..trials {
        let pairs = matches(100 + seed);
        let c = calibrated(&pairs, &options(vec![(0, 1)])).expect("a camera");
        let sigma = c.standard_deviation.fx.expect("estimated");
        squares += ((c.camera.fx - FOCAL_PX) / sigma).powi(2) / trials as f64;
        assert!(sigma < 0.02 * FOCAL_PX, "{sigma}");
        assert_eq!((c.method, c.motions.iter().filter(|m| m.used).count()), (Method::Transferred, 1));
        // A view that shares hardly any point with the motion's is not joined.
        let joined = c.motions.iter().filter(|m| m.cross_attitude_link).count();
        assert!((VIEWS.len() - 3..=VIEWS.len() - 2).contains(&joined), "{joined}");
        let kinds: Vec<_> = c.verdict.iter().flat_map(|v| &v.reasons).map(|r| r.code.as_str()).collect();
        assert!(kinds.contains(&"not_refined"), "{kinds:?}");
    }
    println!("rms of errors over deviations {:.2}", squares.sqrt());
    // An axis as far off the normal as the deviations allow for is not in these scenes.
    assert!(squares.sqrt() < 1.3, "{squares}");
    // A pair that is no turn about the normal is refused for its height ratio; where somebody vouches for it, the other views contradict it.
    for named in [(0, 2), (1, 3), (0, 4)] {
        let of = |motion| calibrated(&matches(7), &Options { motion, ..options(vec![named]) });
        assert!(matches!(of(MotionModel::Auto), Err(Error::NoUsableMotion { .. })), "{named:?}");
        let vouched = of(MotionModel::PlaneNormal);
        assert!(matches!(vouched, Err(Error::NotPositiveDefinite { .. } | Error::Unsound { .. })), "{named:?}");
    }
    // And none at all without views of other attitudes.
    let alone: Vec<ImagePair> = matches(0).into_iter().filter(|p| (p.from, p.to) == (0, 1)).collect();
    assert!(matches!(calibrated(&alone, &options(vec![(0, 1)])), Err(Error::TooFewAttitudes { .. })));
}
