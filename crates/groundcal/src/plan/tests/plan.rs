//! Error bars promised before any picture is taken, against the errors the calibration then makes: seeded trials whose cameras, axes
//! and heights vary as the plan assumed.

use crate::calibrate::calibrate_matches;
use crate::calibrate::{LensModel, Options};
use crate::error::Error;
use crate::geometry::attitude::{angles_from_rotation, attitude_rotation, yaw_rotation};
use crate::geometry::constraint::Constraint;
use crate::geometry::intrinsics::Intrinsics;
use crate::geometry::lens::Lens;
use crate::geometry::lens::Radtan;
use crate::geometry::parameters::{Parameter, PriorParameter};
use crate::geometry::plane_view::View;
use crate::geometry::size::ImageSize;
use crate::observer::Silent;
use crate::pairs::correspondence::{ImagePair, PointMatch};
use crate::plan::planner::{HEIGHT_SIGMA, Plan, PlanOptions, PlannedMotion, Planner, Prediction, Rig, Start};
use crate::result::calibration::Calibration;
use crate::result::warning::Warning;
use crate::synthetic::points::{MotionSpec, PointScene};
use nalgebra::{Rotation3, Vector3};
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Mcg;
use rayon::prelude::*;

/// Relative sampling error of a root mean square over so many trials: 1 / sqrt(2 n) = 5 %.
const TRIALS: u64 = 200;
const SIZE: ImageSize = ImageSize { width: 1280, height: 960 };

fn degrees(values: &[f64]) -> Vec<f64> {
    values.iter().map(|v| v.to_radians()).collect()
}

fn rig(tilts_deg: &[f64], rolls_deg: &[f64], axis_offset: f64) -> Rig {
    Rig {
        pitches_down_rad: degrees(tilts_deg),
        rolls_rad: degrees(rolls_deg),
        turns_rad: degrees(&[15.0, 20.0, 30.0, 45.0]),
        axis_offset,
        reach: 10.0,
    }
}

fn tripod() -> Rig {
    rig(&[30.0, 40.0, 50.0, 60.0], &[-40.0, -20.0, 0.0, 20.0, 40.0], 0.1)
}

fn pan_head() -> Rig {
    rig(&[20.0, 30.0, 40.0, 50.0, 60.0], &[0.0], 0.02)
}

fn robot() -> Rig {
    rig(&[35.0], &[0.0], 0.4)
}

fn options(rig: Rig, motions: usize) -> PlanOptions {
    let [cx, cy] = SIZE.centre_px();
    PlanOptions {
        intrinsics: Intrinsics::square(1100.0, cx, cy),
        lens: Lens::None,
        size: SIZE,
        rig,
        noise_px: 0.3,
        points: 250.0,
        motions,
        calibration: Options::default(),
    }
}

/// What a trial draws from.
struct World {
    rng: Pcg64Mcg,
    seed: u64,
    camera: Intrinsics,
    lens: Lens,
    attitude_sigma_rad: f64,
    height_sigma: f64,
}

impl World {
    /// A camera drawn from the priors of `auto` about the one of the plan.
    fn new(options: &PlanOptions, seed: u64) -> Self {
        let mut world = Self {
            rng: Pcg64Mcg::seed_from_u64(seed),
            seed,
            camera: options.intrinsics,
            lens: Lens::None,
            attitude_sigma_rad: options.calibration.attitude_sigma_deg.unwrap_or(0.1).to_radians(),
            height_sigma: options.calibration.height_sigma.unwrap_or(HEIGHT_SIGMA),
        };
        let k = options.intrinsics;
        let ln_aspect = 0.003 * world.normal();
        let principal_point = 0.05 * SIZE.width as f64;
        world.camera = Intrinsics {
            fx: k.fx * (-0.5 * ln_aspect).exp(),
            fy: k.fy * (0.5 * ln_aspect).exp(),
            cx: k.cx + principal_point * world.normal(),
            cy: k.cy + principal_point * world.normal(),
            skew: 0.0,
        };
        if options.calibration.lens != LensModel::None {
            let [p1, p2] = [0, 1].map(|_| 0.001 * world.normal());
            world.lens = Lens::Radtan(Radtan::new([0.0, 0.0, p1, p2, 0.0]));
        }
        world
    }

    fn normal(&mut self) -> f64 {
        StandardNormal.sample(&mut self.rng)
    }

    /// A view as it is made: pitch, roll and yaw, its attitude being off by σ_a about two level axes, and its height off by σ_h.
    fn view(&mut self, m: &MotionSpec, yaw_rad: f64, centre: Vector3<f64>) -> View {
        let stray = Rotation3::new(Vector3::new(self.normal(), self.normal(), 0.0) * self.attitude_sigma_rad);
        let attitude = attitude_rotation(m.pitch_down_rad, m.roll_rad) * stray.matrix();
        let (pitch_down_rad, roll_rad, yaw_rad) = angles_from_rotation(&(attitude * yaw_rotation(yaw_rad)));
        let height = centre.z * (self.height_sigma * self.normal()).exp();
        View { pitch_down_rad, roll_rad, yaw_rad, centre: Vector3::new(centre.x, centre.y, height) }
    }

    /// Matches of the motions of a plan; those that continue begin with the last picture of the one before.
    fn pairs(&mut self, planner: &Planner, motions: &[PlannedMotion], options: &PlanOptions) -> Vec<ImagePair> {
        let mut out = Vec::new();
        let mut last: Option<(View, usize, f64, Vector3<f64>)> = None;
        let mut images = 0;
        for (i, m) in motions.iter().enumerate() {
            let spec = spec(planner, m);
            let (a, from, yaw, centre) = match last.filter(|_| m.continues) {
                Some(last) => last,
                None => {
                    images += 1;
                    let centre = Vector3::new(0.0, 0.0, 1.0);
                    (self.view(&spec, 0.0, centre), images - 1, 0.0, centre)
                }
            };
            let shift = yaw_rotation(yaw).transpose() * Vector3::new(spec.shift[0], spec.shift[1], 0.0);
            let (yaw, centre) = (yaw + spec.turn_rad, centre + shift);
            let b = self.view(&spec, yaw, centre);
            last = Some((b, images, yaw, centre));
            let matches = self.matches([a, b], options, m.matches.round() as usize, i);
            out.push(ImagePair { from, to: images, matches });
            images += 1;
        }
        out
    }

    /// Matches between two views.
    fn matches(&mut self, [a, b]: [View; 2], options: &PlanOptions, count: usize, index: usize) -> Vec<PointMatch> {
        let shift = yaw_rotation(a.yaw_rad) * (b.centre - a.centre);
        let motion = MotionSpec {
            pitch_down_rad: a.pitch_down_rad,
            roll_rad: a.roll_rad,
            turn_rad: b.yaw_rad - a.yaw_rad,
            shift: [shift.x, shift.y],
            height: a.centre.z,
            height_ratio: b.centre.z / a.centre.z,
            attitude_error_rad: [b.pitch_down_rad - a.pitch_down_rad, b.roll_rad - a.roll_rad],
        };
        let scene = PointScene {
            intrinsics: self.camera,
            lens: self.lens,
            size: SIZE,
            motions: vec![motion],
            matches: count,
            sigma_px: options.noise_px,
            outlier_fraction: 0.0,
            reach: options.rig.reach,
            seed: self.seed * 100 + index as u64,
        };
        scene.pairs().remove(0).matches
    }

    /// Errors of (ln f, fx, fy, cx, cy).
    fn errors(&self, c: &Calibration) -> [f64; 5] {
        let (k, t) = (&c.camera, &self.camera);
        [0.5 * (k.fx * k.fy / (t.fx * t.fy)).ln(), k.fx - t.fx, k.fy - t.fy, k.cx - t.cx, k.cy - t.cy]
    }
}

fn calibrate(pairs: &[ImagePair], calibration: &Options) -> Result<Calibration, Error> {
    let images = pairs.iter().map(|p| p.to + 1).max().unwrap_or(0);
    let names: Vec<String> = (0..images).map(|i| i.to_string()).collect();
    calibrate_matches(&names, SIZE, pairs, calibration, &Silent)
}

fn spec(planner: &Planner, m: &PlannedMotion) -> MotionSpec {
    planner.motion(m.pitch_down_deg.to_radians(), m.roll_deg.to_radians(), m.turn_deg.to_radians())
}

fn predicted(p: &Prediction) -> [f64; 5] {
    let s = &p.standard_deviation;
    [Some(p.f_percent / 100.0), s.fx, s.fy, s.cx, s.cy].map(|v| v.expect("estimated"))
}

/// Root mean square errors over the standard deviations promised: of f, fx, fy, cx, cy.
fn compare(name: &str, errors: &[[f64; 5]], promised: &[f64; 5]) -> [f64; 5] {
    let n = errors.len() as f64;
    assert!(n >= 0.99 * TRIALS as f64, "{name}: {n} of {TRIALS} trials have a camera");
    let ratios: [f64; 5] =
        std::array::from_fn(|i| (errors.iter().map(|e| e[i] * e[i]).sum::<f64>() / n).sqrt() / promised[i]);
    println!(
        "{name}: predicted f {:.3} %, fx, fy, cx, cy {:.2?} px; achieved over predicted: f {:.3}, {:.3?}",
        100.0 * promised[0],
        &promised[1..],
        ratios[0],
        &ratios[1..]
    );
    ratios
}

fn show(plan: &Plan) {
    for m in &plan.motions {
        let f = m.after.as_ref().map(|p| p.f_percent);
        println!(
            "  tilt {:.0} roll {:.0} turn {:.0}: {:.0} matches, overlap {:.2}, f {f:.3?} %",
            m.pitch_down_deg, m.roll_deg, m.turn_deg, m.matches, m.overlap
        );
    }
}

/// How far axes and heights vary, told to the calibration, which otherwise estimates it.
fn told(calibration: Options) -> Options {
    Options {
        attitude_sigma_deg: Some(calibration.attitude_sigma_deg.unwrap_or(0.1)),
        height_sigma: Some(calibration.height_sigma.unwrap_or(HEIGHT_SIGMA)),
        ..calibration
    }
}

fn achieves(name: &str, options: &PlanOptions) {
    let planner = Planner::new(options, None).expect("good options");
    let plan = planner.plan().expect("a plan");
    show(&plan);
    let last = plan.motions.last().and_then(|m| m.after.clone()).expect("determined");
    let ratios = |name: &str, calibration: &Options| {
        let errors: Vec<[f64; 5]> = (0..TRIALS)
            .into_par_iter()
            .filter_map(|seed| {
                let mut world = World::new(options, seed);
                let pairs = world.pairs(&planner, &plan.motions, options);
                calibrate(&pairs, calibration).ok().map(|c| world.errors(&c))
            })
            .collect();
        compare(name, &errors, &predicted(&last))
    };
    let all = ratios(&format!("{name}, errors told"), &told(options.calibration.clone()));
    let untold = Options { attitude_sigma_deg: None, height_sigma: None, ..options.calibration.clone() };
    let by_default = ratios(name, &untold);
    assert!(all.iter().chain(&by_default[..1]).all(|r| (r - 1.0).abs() < 0.15), "{all:.3?} {by_default:.3?}");
}

#[test]
fn a_tripod_that_rolls_achieves_what_was_predicted() {
    achieves("tripod", &options(tripod(), 4));
}

#[test]
fn a_pan_head_that_only_tilts_achieves_what_was_predicted() {
    achieves("pan head", &options(pan_head(), 5));
}

#[test]
fn a_robot_of_one_attitude_achieves_what_was_predicted() {
    achieves("robot", &options(robot(), 4));
}

#[test]
fn a_drone_whose_height_strays_achieves_what_was_predicted() {
    let unsteady = Options { height_sigma: Some(0.02), ..Options::default() };
    achieves("drone", &PlanOptions { calibration: unsteady, ..options(rig(&[30.0, 45.0, 60.0], &[0.0], 0.0), 4) });
}

#[test]
fn zero_skew_without_priors_achieves_what_was_predicted() {
    let zero_skew = Options { constraint: Constraint::ZeroSkew, ..Options::default() };
    achieves("tripod, zero-skew", &PlanOptions { calibration: zero_skew, ..options(tripod(), 5) });
}

/// Two motions are calibrated, a third is proposed from that calibration alone and made: the promise against what it achieves.
fn after_two_motions(name: &str, calibration: Options) -> [f64; 5] {
    let options = PlanOptions { calibration, ..options(tripod(), 1) };
    let nominal = Planner::new(&options, None).expect("good options");
    let planned = |planner: &Planner, (tilt, roll, turn): (f64, f64, f64)| {
        let mut m = PlannedMotion {
            pitch_down_deg: tilt,
            roll_deg: roll,
            turn_deg: turn,
            continues: false,
            matches: 0.0,
            overlap: 1.0,
            after: None,
        };
        m.matches = options.points * planner.shared_fraction(&spec(planner, &m));
        m
    };
    let first = [(40.0, 0.0, 20.0), (50.0, 20.0, 20.0)].map(|m| planned(&nominal, m));
    let start = |c: &Calibration| (PlanOptions { intrinsics: camera_of(c), ..options.clone() }, covariance_of(c));
    let propose = |c: &Calibration| {
        let (options, covariance) = start(c);
        Planner::new(&options, Some(&covariance)).and_then(|p| p.plan())
    };
    // The proposal from one calibration serves all.
    let pairs = World::new(&options, 0).pairs(&nominal, &first, &options);
    let plan = propose(&calibrate(&pairs, &options.calibration).expect("a camera")).expect("a plan");
    show(&plan);
    let before = plan.before.as_ref().expect("a calibration").f_percent;
    let after = plan.motions[0].after.as_ref().expect("determined").f_percent;
    println!("  f {before:.3} % before");
    assert!(after < 0.8 * before, "{before} {after}");
    let three: Vec<PlannedMotion> = first.iter().chain(&plan.motions).cloned().collect();
    let outcomes: Vec<([f64; 5], [f64; 5])> = (0..TRIALS)
        .into_par_iter()
        .filter_map(|seed| {
            let mut world = World::new(&options, seed);
            let pairs = world.pairs(&nominal, &three, &options);
            let (own_options, covariance) = start(&calibrate(&pairs[..2], &options.calibration).ok()?);
            let own = Planner::new(&own_options, Some(&covariance)).ok()?;
            let promised = predicted(&own.predict(&[spec(&own, &plan.motions[0])])?);
            Some((world.errors(&calibrate(&pairs, &options.calibration).ok()?), promised))
        })
        .collect();
    let n = outcomes.len() as f64;
    assert!(n >= 0.99 * TRIALS as f64, "{name}: {n} of {TRIALS} trials have a camera");
    type Outcome = ([f64; 5], [f64; 5]);
    let mean_square = |f: &dyn Fn(&Outcome) -> f64| outcomes.iter().map(f).sum::<f64>() / n;
    let ratios: [f64; 5] =
        std::array::from_fn(|i| (mean_square(&|o| o.0[i].powi(2)) / mean_square(&|o| o.1[i].powi(2))).sqrt());
    println!("{name}: achieved over predicted (f, fx, fy, cx, cy) {ratios:.3?}");
    ratios
}

#[test]
fn the_motion_proposed_after_a_calibration_achieves_what_was_predicted() {
    let ratios = after_two_motions("after two motions, errors told", told(Options::default()));
    assert!(ratios.iter().all(|r| (r - 1.0).abs() < 0.15), "{ratios:.3?}");
    // Two motions alone hardly tell how far heights vary, so that their error bars are wide and the promise is careful; f keeps to it.
    let ratios = after_two_motions("after two motions", Options::default());
    assert!((ratios[0] - 1.0).abs() < 0.15, "{ratios:.3?}");
}

fn camera_of(c: &Calibration) -> Intrinsics {
    let k = &c.camera;
    Intrinsics { fx: k.fx, fy: k.fy, cx: k.cx, cy: k.cy, skew: k.skew }
}

fn covariance_of(c: &Calibration) -> Start {
    c.covariance.clone()
}

fn codes(warnings: &[Warning]) -> Vec<&str> {
    warnings.iter().map(|w| w.code()).collect()
}

#[test]
fn what_a_rig_cannot_tell_is_said() {
    let plan = |o: &PlanOptions| Planner::new(o, None).and_then(|p| p.plan());
    // One attitude: the prior holds the principal point, and f goes with it.
    let p = plan(&options(robot(), 4)).expect("held by the prior");
    assert_eq!(codes(&p.warnings), ["single_attitude", "prior_decides"]);
    assert!(matches!(&p.warnings[1], Warning::PriorDecides { parameter: PriorParameter::Cy, .. }));
    // More of the same would not help: two motions, one to check the other.
    assert_eq!(p.motions.iter().map(|m| m.continues).collect::<Vec<_>>(), [false, true]);
    let last = p.motions[1].after.as_ref().expect("determined");
    assert!(last.share.principal_point > 0.95, "{last:?}");
    assert!(last.f_percent > 0.98 * p.motions[0].after.as_ref().expect("determined").f_percent);
    let p = plan(&options(pan_head(), 4)).expect("a plan");
    assert_eq!(codes(&p.warnings), ["parallel_horizons"]);
    let p = plan(&options(tripod(), 4)).expect("a plan");
    assert_eq!(codes(&p.warnings), [""; 0]);
    let refused = |o: &PlanOptions, words: &[&str]| {
        let error = plan(o).expect_err("refused");
        assert!(error.is_degenerate(), "{error:?}");
        let text = error.to_string();
        println!("{text}");
        assert!(words.iter().all(|w| text.contains(w)), "{text}");
    };
    refused(&options(rig(&[90.0], &[0.0, 45.0], 0.0), 3), &["straight down", "focal length", "30 to 60 degrees"]);
    refused(&options(Rig { turns_rad: vec![0.0], ..tripod() }, 3), &["turns by 0.0 degrees", "15 degrees or more"]);
    refused(
        &options(rig(&[-40.0], &[0.0], 0.0), 3),
        &["none of the 4 motions", "0 matches", "Tilt the camera further down"],
    );
    let zero_skew = Options { constraint: Constraint::ZeroSkew, ..Options::default() };
    refused(
        &PlanOptions { calibration: zero_skew.clone(), ..options(robot(), 4) },
        &["`zero-skew`", "needs 2", "the 4 motions have 1"],
    );
    // Two elevations do not tell four unknowns.
    let two = rig(&[30.0, 50.0], &[0.0], 0.1);
    refused(&PlanOptions { calibration: zero_skew, ..options(two, 2) }, &["`zero-skew`", "the motions"]);
}

#[test]
fn options_out_of_range_are_refused() {
    let good = || options(tripod(), 4);
    let bad = [
        PlanOptions { noise_px: 0.0, ..good() },
        PlanOptions { noise_px: f64::NAN, ..good() },
        PlanOptions { points: 3.0, ..good() },
        PlanOptions { motions: 0, ..good() },
        PlanOptions { intrinsics: Intrinsics::square(-1.0, 0.0, 0.0), ..good() },
        PlanOptions { rig: rig(&[], &[0.0], 0.0), ..good() },
        PlanOptions { rig: rig(&[100.0], &[0.0], 0.0), ..good() },
        PlanOptions { rig: rig(&[30.0], &[f64::INFINITY], 0.0), ..good() },
        PlanOptions { rig: rig(&[30.0], &[0.0], -1.0), ..good() },
    ];
    for o in bad {
        assert!(matches!(Planner::new(&o, None), Err(Error::InvalidOption(_))), "{o:?}");
    }
    let diagonal = |v: f64| Start::from_fn(&Parameter::ALL, |r, c| if r == c { v } else { 0.0 });
    let ones = Start::from_fn(&Parameter::ALL, |_, _| 1.0);
    for wrong in [diagonal(0.0), diagonal(-1.0), diagonal(f64::NAN), ones] {
        assert!(matches!(Planner::new(&good(), Some(&wrong)), Err(Error::InvalidInput(_))), "{wrong:?}");
    }
}

#[test]
fn a_plan_is_the_same_each_time_and_its_first_motions_help_most() {
    let o = options(tripod(), 5);
    let plan = || Planner::new(&o, None).and_then(|p| p.plan()).expect("a plan");
    let (a, b) = (plan(), plan());
    assert_eq!(a.motions, b.motions);
    let f: Vec<f64> = a.motions.iter().map(|m| m.after.as_ref().expect("determined").f_percent).collect();
    assert!(f.windows(2).all(|w| w[1] < w[0]), "{f:?}");
}
