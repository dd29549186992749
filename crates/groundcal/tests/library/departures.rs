//! What no prior is of and no residual shows: a turn while all pictures are read out, and alternatives that the evidence leaves open.

use groundcal::{Calibration, ImagePair, Options, Silent, calibrate_matches};

use crate::floor_views::{FOCAL_PX, FloorView, SIX, SIZE, Taken, furthest, matches, pairs_of_views, view};

/// With the motions alone, as a set of single turns has them.
fn calibrated(attitudes: &[[f64; 2]], taken: Taken, seed: u64) -> Result<Calibration, groundcal::Error> {
    calibrated_with(&pairs_of_views(attitudes), taken, seed, &Options::default())
}

fn calibrated_with(
    views: &[FloorView],
    taken: Taken,
    seed: u64,
    options: &Options,
) -> Result<Calibration, groundcal::Error> {
    let motions: Vec<ImagePair> =
        matches(views, taken, seed).into_iter().filter(|p| p.from % 2 == 0 && p.to == p.from + 1).collect();
    let names: Vec<String> = (0..views.len()).map(|i| i.to_string()).collect();
    calibrate_matches(&names, SIZE, &motions, options, &Silent)
}

#[test]
fn one_turn_while_all_pictures_are_read_out_is_found_and_named() {
    let turns_found = |c: &Calibration| c.warnings.iter().filter(|w| w.code() == "pictures_depart").count();
    for (seed, row_turn_deg) in [(1, 0.0), (2, 0.0), (3, 0.2), (4, 0.7), (5, -0.8)] {
        let c = calibrated(&SIX, Taken { aspect: 1.0, row_turn_deg }, seed).expect("a camera");
        let (off, sigma) = (furthest(&c, 1.0), c.standard_deviation.fx.expect("estimated"));
        println!("{row_turn_deg} degrees: fx {:.2} +- {sigma:.2}, {off:.1} deviations at most", c.camera.fx);
        assert!(off < 3.5 && sigma < 0.01 * FOCAL_PX, "{row_turn_deg}: {off} deviations, {sigma}");
        // Two tenths of a degree are within the error bars, shown or not.
        if row_turn_deg != 0.2 {
            assert_eq!(turns_found(&c), usize::from(row_turn_deg != 0.0), "{row_turn_deg}: {:?}", c.warnings);
        }
    }
}

/// The same, or refused, where it bends the pictures so that matches are cut off.
#[test]
fn a_great_turn_while_pictures_are_read_out_is_no_lie() {
    let mut answered = 0;
    for (seed, row_turn_deg) in [(11, -1.5), (12, 1.0), (13, 1.5), (14, -1.0)] {
        match calibrated(&SIX, Taken { aspect: 1.0, row_turn_deg }, seed) {
            Ok(c) => {
                answered += 1;
                let off = furthest(&c, 1.0);
                assert!(off < 3.5, "{row_turn_deg}: {off} deviations");
            }
            Err(error) => assert!(matches!(error, groundcal::Error::Unsound { .. }), "{row_turn_deg}: {error}"),
        }
    }
    println!("{answered} of 4 answered");
}

/// With attitudes held a motion between which the camera tilted goes into skew, lens and shutter, until its residuals are like those of the others. It is
/// singled out, or the answer is refused: of 60 such scenes answered as they are 15 are off by more than 3 deviations.
#[test]
fn the_motion_without_which_the_rest_is_noise_is_the_wrong_one() {
    let options = Options { attitude_sigma_deg: Some(0.0), ..Options::default() };
    let still = Taken { aspect: 1.0, row_turn_deg: 0.0 };
    let mut found = 0;
    for n in 0..20 {
        let (wrong, tilt) = (n % 4, [0.0, -3.0, 4.0, -6.0, 9.0][n % 5]);
        let mut views = pairs_of_views(&SIX[..4]);
        let [pitch, roll] = SIX[wrong];
        let (i, yaw) = (wrong as f64, 50.0 * wrong as f64);
        views[2 * wrong + 1] = view([pitch + tilt, roll, yaw + 35.0], [0.1 * i + 0.25, 0.05 * i - 0.2]);
        match calibrated_with(&views, still, 20 + n as u64, &options) {
            Ok(c) => {
                let used = c.motions.iter().filter(|m| m.used).count();
                let off = furthest(&c, 1.0);
                assert!(off < 3.5, "motion {wrong} tilted by {tilt}: {off} deviations, {used} used");
                assert!(tilt != 0.0 || used == 4, "all are right");
                found += usize::from(!c.motions[wrong].used);
            }
            Err(error) => {
                assert!(tilt != 0.0 && matches!(error, groundcal::Error::Unsound { .. }), "{tilt}: {error}");
            }
        }
    }
    println!("{found} of 16 found");
    assert!(found >= 6, "{found} of 16 found");
}

/// A slight turn moves the camera by several of its deviations before the images are sure of it; then the bars have it, and say so. (Without it in the bars
/// 13 of these 16 are off by more than 3 deviations, up to 5.3.)
#[test]
fn what_the_evidence_leaves_open_is_in_the_error_bars() {
    let mut open = 0;
    for seed in 0..16 {
        let c = calibrated(&SIX, Taken { aspect: 1.0, row_turn_deg: -0.25 }, 40 + seed).expect("a camera");
        if c.warnings.iter().any(|w| w.code() == "assumption_open") {
            open += 1;
            let off = furthest(&c, 1.0);
            assert!(off < 3.5, "seed {seed}: {off} deviations");
        }
    }
    assert!(open >= 8, "{open} of 16 are left open");
}
