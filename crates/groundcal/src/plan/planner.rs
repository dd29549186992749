//! Capture advice: which motions to make, and how well the camera will be known from them.
//!
//! ```text
//! Λ(S) = Λ₀ + Σ_{m ∈ S} Λ_m,    Σ = Λ(S)⁻¹,    var ln f = cᵀ Σ c,    f = √(fx fy),  c = (1, ½, 0, 0, ...)
//! ```
//!
//! over the camera's numbers (ln fx, ln fy/fx, cx, cy, skew, then those of the lens): Λ_m is the Fisher information of a motion (`information.rs`), Λ₀ that of the
//! priors, or the inverse covariance of a calibration that is to be improved. Σ is what the joint refinement reports, to first
//! order, of motions whose views' attitudes and heights vary as assumed. The motions are chosen from a grid of attitudes and
//! turns to make var ln f small (c-optimal design; Pukelsheim 1993, *Optimal Design of Experiments*): one after the other, then
//! each against every other until none is better. Nothing is random.

use nalgebra::DMatrix;
use serde::Serialize;

use crate::{
    calibrate::Options,
    error::Error,
    geometry::{
        attitude::PARALLEL_HORIZONS_DEG, constraint::Constraint, frame::Frame, intrinsics::Intrinsics, lens::Lens,
        size::ImageSize,
    },
    numerics::linalg::inverse_spd,
    plan::{
        candidate::{CameraMatrix, Candidate, Free, inverse_free, ln_f_variance},
        information::Setting,
        search::{self, MIN_RELATIVE_GAIN},
    },
    refine::{
        CameraState,
        blocks::{MATRIX, MAX_CAMERA_NUMBERS},
        bundle::pixels_by_camera,
    },
    remedy::Remedy,
    result::{Covariance, Parameter, PrincipalPointDoubt, Prior, StandardDeviation, Warning},
    start::linear_camera::{PRIOR_DECIDES, PriorParameter, check_certainty},
    synthetic::points::MotionSpec,
};

/// How a camera can move. Every pitch may be combined with every roll and every turn.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Rig {
    /// Angles of the optical axis below the horizontal, radians.
    pub pitches_down_rad: Vec<f64>,
    /// Rolls, radians.
    pub rolls_rad: Vec<f64>,
    /// Turns between the two pictures of a motion, anticlockwise seen from above, radians.
    pub turns_rad: Vec<f64>,
    /// Distance from the optical centre back to the axis of the turns, in heights of the camera over the floor.
    pub axis_offset: f64,
    /// How far the floor is seen, in heights.
    pub reach: f64,
}

/// What is planned for.
#[derive(Debug, Clone)]
pub(crate) struct PlanOptions {
    /// The camera as it is thought to be, pixels.
    pub intrinsics: Intrinsics,
    /// Its lens.
    pub lens: Lens,
    /// Its images.
    pub size: ImageSize,
    /// How it can move.
    pub rig: Rig,
    /// Standard deviation of each coordinate of a match in either image, pixels.
    pub noise_px: f64,
    /// Matches of a motion that shows the same floor all over both images; one that shows less has fewer in proportion.
    pub points: f64,
    /// Motions to choose.
    pub motions: usize,
    /// What the calibration is going to be told (constraint, priors, lens, attitude and height sigma). `None` of the two
    /// deviations: 0.1 degrees, and [`HEIGHT_SIGMA`].
    pub calibration: Options,
}

/// A calibration to be improved: the covariance of its camera in pixels squared, zero rows for what it held. It has the priors in it.
pub(crate) type Start = Covariance<Parameter>;

/// Relative standard deviation of heights taken where none is given: that of a tripod or a robot on a floor.
pub(crate) const HEIGHT_SIGMA: f64 = 1e-3;
/// Fewest matches of a motion, as in the calibration of images.
pub(crate) const MIN_MATCHES: f64 = 15.0;
/// Least part of the first image's floor that the second must show.
const MIN_OVERLAP: f64 = 0.5;
/// Smallest turn worth planning, and distance from 180 degrees.
const MIN_TURN_RAD: f64 = 0.03;
/// Of turns that are worth the same the one nearest to this: 30 degrees.
const EASY_TURN_RAD: f64 = std::f64::consts::FRAC_PI_6;
/// Pitch from which on a view says nothing of the focal length.
const STRAIGHT_DOWN_RAD: f64 = 1.52;
/// Standard deviation of ln f beyond which there is no sense in naming it.
const MAX_LN_F_SIGMA: f64 = 2.0;

/// How well the camera is expected to be known.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Prediction {
    /// Standard deviations, pixels; `None`: held.
    pub standard_deviation: StandardDeviation,
    /// Standard deviation of the focal length √(fx fy), per cent.
    pub f_percent: f64,
    /// Parts of the variance of f that would be gone if the principal point, the aspect ratio or the lens were known.
    pub share: VarianceShares,
}

/// Where the error of the focal length comes from: parts of its variance, 0 to 1. They overlap.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[allow(missing_docs)]
pub struct VarianceShares {
    pub principal_point: f64,
    pub aspect: f64,
    pub lens: f64,
}

/// A motion of the plan: two pictures of one attitude.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PlannedMotion {
    /// Angle of the optical axis below the horizontal, degrees.
    pub pitch_down_deg: f64,
    /// Roll, degrees: positive dips the camera's right-hand side.
    pub roll_deg: f64,
    /// Turn from the first to the second picture, anticlockwise seen from above, degrees.
    pub turn_deg: f64,
    /// Whether its first picture is the last one of the motion before.
    pub continues: bool,
    /// Matches expected.
    pub matches: f64,
    /// Part of the first picture's floor that the second shows too.
    pub overlap: f64,
    /// The camera after this motion and those before; `None`: not determined yet.
    pub after: Option<Prediction>,
}

/// What to do, and what to expect of it.
#[derive(Debug, Clone)]
pub(crate) struct Plan {
    /// The motions, the most useful first; fewer than asked for where one more would lower the standard deviation of f by less
    /// than a hundredth.
    pub motions: Vec<PlannedMotion>,
    /// The camera before the first of them; `None` without a calibration to start from.
    pub before: Option<Prediction>,
    /// What is assumed beforehand and how much of it is left to count in the end.
    pub priors: Vec<Prior>,
    /// What the calibration is going to warn of.
    pub warnings: Vec<Warning>,
}

/// Degrees without the rounding of their way through radians.
fn round(degrees: f64) -> f64 {
    (degrees * 1e9).round() / 1e9
}

/// Everything a plan is made with.
pub(crate) struct Planner {
    setting: Setting,
    rig: Rig,
    motions: usize,
    calibration: Options,
    /// Information that is there before the first motion.
    base: CameraMatrix,
    started: bool,
    intrinsics: Intrinsics,
}

impl PlanOptions {
    /// Checks every number once.
    fn validate(&self) -> Result<(), Error> {
        let fail = |text: String| Err(Error::InvalidOption(text));
        let within = |v: f64, low: f64, high: f64| v.is_finite() && (low..=high).contains(&v);
        let (k, rig) = (&self.intrinsics, &self.rig);
        let width = self.size.width as f64;
        if self.size.width < 2 || self.size.height < 2 {
            return fail(format!("an image size of {} pixels", self.size));
        }
        for f in [k.fx, k.fy] {
            if !within(f / width, 0.05, 100.0) {
                return fail(format!("focal length {f} px must lie between 0.05 and 100 image widths ({width} px)"));
            }
        }
        if !within(self.noise_px, 1e-3, 100.0) {
            return fail(format!("noise {} px must lie between 0.001 and 100", self.noise_px));
        }
        if !within(self.points, MIN_MATCHES, 1e6) {
            return fail(format!("{} points a motion: give {MIN_MATCHES} to 1000000", self.points));
        }
        if !(1..=50).contains(&self.motions) {
            return fail(format!("{} motions: give 1 to 50", self.motions));
        }
        let angles =
            [("tilt", &rig.pitches_down_rad, 90.0), ("roll", &rig.rolls_rad, 180.0), ("turn", &rig.turns_rad, 180.0)];
        for (name, values, limit) in angles {
            if values.is_empty() || values.len() > 50 {
                return fail(format!("{} {name} angles: give 1 to 50", values.len()));
            }
            if let Some(bad) = values.iter().find(|v| !within(v.to_degrees(), -limit - 1e-9, limit + 1e-9)) {
                return fail(format!(
                    "{name} {} degrees must lie between -{limit} and {limit}",
                    round(bad.to_degrees())
                ));
            }
        }
        if !within(rig.axis_offset, 0.0, 1e3) {
            return fail(format!("an axis {} camera heights away: give 0 to 1000", rig.axis_offset));
        }
        if !within(rig.reach, 0.5, 1e4) {
            return fail(format!("floor seen up to {} camera heights: give 0.5 to 10000", rig.reach));
        }
        if self.calibration.lens.is_fisheye() {
            return fail("motions are not planned for a fisheye's lens: give radtan, k1 or none".into());
        }
        self.calibration.validate(self.size)
    }
}

impl Planner {
    /// Prepares a plan; with `start` the motions are to improve that calibration.
    ///
    /// # Errors
    /// [`Error::InvalidOption`], [`Error::InvalidInput`] for a covariance that is none.
    pub(crate) fn new(options: &PlanOptions, start: Option<&Start>) -> Result<Self, Error> {
        options.validate()?;
        let (size, calibration) = (options.size, &options.calibration);
        let frame = Frame::new(size, calibration.principal_point_px);
        let lens = match options.lens {
            // A pinhole bends with the coefficients that are estimated of it.
            Lens::None => Lens::radial(0.0, 0.0),
            Lens::Radtan(_) => options.lens,
            other => {
                return Err(Error::InvalidInput(format!(
                    "a lens of the model {} ({}): what is estimated of a lens, and planned for, is radtan",
                    other.name(),
                    other.parameter_names().join(", ")
                )));
            }
        };
        let camera = CameraState::new(&options.intrinsics, &lens, &frame);
        let assumed = calibration.assumptions(size);
        let unknowns = &assumed.cameras[0];
        let mut free: Free = std::array::from_fn(|i| unknowns.is_free(i));
        let base = match start {
            Some(covariance) => {
                let back = pixels_by_camera(&options.intrinsics, &frame, MAX_CAMERA_NUMBERS)
                    .try_inverse()
                    .ok_or_else(|| Error::InvalidInput("a camera matrix that is singular".into()))?;
                let places = Parameter::ALL.map(|p| (p, camera.place(p)));
                let at = |place: usize| places.iter().find(|(_, at)| *at == Some(place)).map(|(p, _)| *p);
                let in_pixels =
                    CameraMatrix::from_fn(|r, c| at(r).zip(at(c)).map_or(0.0, |(a, b)| covariance.get(a, b)));
                let in_frame = CameraMatrix::from_iterator((&back * in_pixels * back.transpose()).iter().copied());
                free = std::array::from_fn(|i| in_frame[(i, i)] > MIN_VARIANCE);
                // Without a focal length there is nothing to improve.
                let known = free[0].then(|| inverse_free(&in_frame, &free)).flatten();
                known.ok_or_else(|| {
                    Error::InvalidInput("a covariance that is not positive definite in what was estimated".into())
                })?
            }
            None => CameraMatrix::from_diagonal(&nalgebra::SVector::from_fn(|i, _| {
                unknowns.prior(i).filter(|_| free[i]).map_or(0.0, |(_, sigma)| sigma.powi(-2))
            })),
        };
        Ok(Self {
            setting: Setting {
                size,
                frame,
                camera,
                free,
                options: assumed,
                height_sigma: calibration.height_sigma.unwrap_or(HEIGHT_SIGMA),
                noise_px: options.noise_px,
                points: options.points,
                reach: options.rig.reach,
            },
            rig: options.rig.clone(),
            motions: options.motions,
            calibration: calibration.clone(),
            base,
            started: start.is_some(),
            intrinsics: options.intrinsics,
        })
    }

    /// A motion of the rig, height 1.
    pub(crate) fn motion(&self, pitch_down_rad: f64, roll_rad: f64, turn_rad: f64) -> MotionSpec {
        MotionSpec::about_axis(pitch_down_rad, roll_rad, turn_rad, self.rig.axis_offset, 1.0)
    }

    /// Part of the first image of a motion whose floor the second shows too: `points` times this is the number of its matches.
    pub(crate) fn shared_fraction(&self, motion: &MotionSpec) -> f64 {
        self.setting.shared_floor(motion).fraction
    }

    /// How well the camera is known from what was known before and these motions; `None` when they do not determine it.
    #[cfg(test)]
    pub(crate) fn predict(&self, motions: &[MotionSpec]) -> Option<Prediction> {
        let of = |m: &MotionSpec| self.setting.information(m, &self.setting.shared_floor(m), 1);
        let sum = motions.iter().map(of).sum::<Option<CameraMatrix>>()?;
        self.prediction(&(self.base + sum)).ok()
    }

    /// Chooses the motions.
    ///
    /// # Errors
    /// [`Error::Undetermined`] or [`Error::TooFewAttitudes`] when no motions of the rig tell what the constraint asks for, with
    /// the reason and what to change.
    pub(crate) fn plan(&self) -> Result<Plan, Error> {
        self.refuse_undetermined()?;
        let candidates = self.candidates()?;
        // A rig of one attitude goes on from picture to picture.
        let chain = !self.started && self.rig.pitches_down_rad.len() * self.rig.rolls_rad.len() == 1;
        let (chosen, sums) = if chain { self.chain(&candidates) } else { self.separate(&candidates) };
        let mut motions: Vec<PlannedMotion> = Vec::new();
        let (mut outcome, mut sum) = (None, self.base);
        for (&i, next) in chosen.iter().zip(&sums) {
            let c = &candidates[i];
            let prediction = self.prediction(next);
            let f = |p: &Option<Prediction>| p.as_ref().map_or(f64::INFINITY, |p| p.f_percent);
            if motions.len() > 1
                && let Ok(next) = &prediction
                && next.f_percent > (1.0 - MIN_RELATIVE_GAIN) * motions.last().map_or(f64::INFINITY, |m| f(&m.after))
            {
                break;
            }
            sum = *next;
            motions.push(PlannedMotion {
                pitch_down_deg: round(c.spec.pitch_down_rad.to_degrees()),
                roll_deg: round(c.spec.roll_rad.to_degrees()),
                turn_deg: round(c.spec.turn_rad.to_degrees()),
                continues: chain && !motions.is_empty(),
                matches: c.matches,
                overlap: c.overlap,
                after: prediction.as_ref().ok().cloned(),
            });
            outcome = Some(prediction);
        }
        if let Some(Err(error)) = outcome {
            return Err(error);
        }
        let covariance = inverse_free(&sum, &self.setting.free).unwrap_or_default();
        let priors = self.priors(&covariance);
        let specs: Vec<MotionSpec> = chosen.iter().take(motions.len()).map(|&i| candidates[i].spec).collect();
        Ok(Plan {
            warnings: self.warnings(&specs, &covariance, &priors),
            before: self.started.then(|| self.prediction(&self.base).ok()).flatten(),
            motions,
            priors,
        })
    }

    /// Motions one by one, each of pictures of its own: indices of the candidates, and the information after each.
    fn separate(&self, candidates: &[Candidate]) -> (Vec<usize>, Vec<CameraMatrix>) {
        let chosen = search::choose(candidates, &self.base, &self.setting.free, self.motions, !self.started);
        let sums = chosen
            .iter()
            .scan(self.base, |sum, &i| {
                *sum += candidates[i].information;
                Some(*sum)
            })
            .collect();
        (chosen, sums)
    }

    /// The same for motions of one turn that go on from each other.
    fn chain(&self, candidates: &[Candidate]) -> (Vec<usize>, Vec<CameraMatrix>) {
        let of = |spec: &MotionSpec, links| {
            self.setting.information(spec, &self.setting.shared_floor(spec), links).unwrap_or_default()
        };
        let whole: Vec<Candidate> =
            candidates.iter().map(|c| Candidate { information: of(&c.spec, self.motions), ..*c }).collect();
        let best = search::choose(&whole, &self.base, &self.setting.free, 1, false);
        let Some(&i) = best.first() else { return (best, Vec::new()) };
        let sums: Vec<CameraMatrix> =
            (1..=self.motions).map(|links| self.base + of(&candidates[i].spec, links)).collect();
        (vec![i; sums.len()], sums)
    }

    fn undetermined(&self, direction: String, remedies: Vec<Remedy>) -> Error {
        Error::Undetermined { constraint: self.calibration.constraint.name(), direction, remedies }
    }

    /// What can be said before anything is computed.
    fn refuse_undetermined(&self) -> Result<(), Error> {
        let rig = &self.rig;
        let largest = rig.turns_rad.iter().fold(0.0f64, |m, t| m.max(t.abs()));
        if largest < MIN_TURN_RAD {
            return Err(self.undetermined(
                format!(
                    "the camera turns by {:.1} degrees at most, and a camera that only slides over the floor tells nothing of its \
                     focal length",
                    largest.to_degrees()
                ),
                vec![Remedy::AllowLargerTurns],
            ));
        }
        if rig.pitches_down_rad.iter().all(|p| p.abs() > STRAIGHT_DOWN_RAD) {
            return Err(self.undetermined(
                "the camera looks straight down on the floor in every picture, which says nothing of the focal length or the \
                 principal point, whatever the roll"
                    .into(),
                vec![Remedy::AllowTilts],
            ));
        }
        let needed = self.calibration.constraint.attitudes_needed();
        let attitudes = (rig.pitches_down_rad.len() * rig.rolls_rad.len()).min(self.motions);
        if attitudes < needed && !self.started {
            return Err(Error::TooFewAttitudes {
                constraint: self.calibration.constraint.name(),
                unknowns: self.calibration.constraint.unknowns(),
                needed,
                motions: self.motions,
                attitudes,
                alternatives: vec![Constraint::Auto, Constraint::Focal, Constraint::FixedPrincipalPoint],
            });
        }
        Ok(())
    }

    /// Motions of the grid that show enough floor twice, the simplest first.
    fn candidates(&self) -> Result<Vec<Candidate>, Error> {
        use rayon::prelude::*;
        let rig = &self.rig;
        let useful = |t: &&f64| (MIN_TURN_RAD..=std::f64::consts::PI - MIN_TURN_RAD).contains(&t.abs());
        let mut specs: Vec<MotionSpec> = Vec::new();
        for &roll in &rig.rolls_rad {
            for &turn in rig.turns_rad.iter().filter(useful) {
                for &pitch in rig.pitches_down_rad.iter().filter(|p| p.abs() <= STRAIGHT_DOWN_RAD) {
                    specs.push(self.motion(pitch, roll, turn));
                }
            }
        }
        specs.sort_by(|a, b| {
            let ease = |m: &MotionSpec| (m.roll_rad.abs(), (m.turn_rad.abs() - EASY_TURN_RAD).abs(), m.pitch_down_rad);
            let (a, b) = (ease(a), ease(b));
            a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)).then(a.2.total_cmp(&b.2))
        });
        let looked: Vec<(f64, f64, Option<CameraMatrix>)> = specs
            .par_iter()
            .map(|spec| {
                let shared = self.setting.shared_floor(spec);
                let matches = self.setting.points * shared.fraction;
                let enough = matches >= MIN_MATCHES && shared.overlap >= MIN_OVERLAP;
                (matches, shared.overlap, enough.then(|| self.setting.information(spec, &shared, 1)).flatten())
            })
            .collect();
        let (matches, overlap) =
            looked.iter().fold((0.0f64, 0.0f64), |(m, o), (matches, overlap, _)| (m.max(*matches), o.max(*overlap)));
        let found: Vec<Candidate> = specs
            .iter()
            .zip(&looked)
            .filter_map(|(spec, (matches, overlap, information))| {
                Some(Candidate { spec: *spec, information: (*information)?, matches: *matches, overlap: *overlap })
            })
            .collect();
        if found.is_empty() {
            return Err(self.undetermined(
                format!(
                    "none of the {} motions shows enough floor in both pictures: at best {matches:.0} matches ({MIN_MATCHES:.0} \
                     needed), at best {:.0} % of the first picture's floor in the second ({:.0} % needed)",
                    specs.len(),
                    100.0 * overlap,
                    100.0 * MIN_OVERLAP
                ),
                vec![Remedy::ShowMoreFloor],
            ));
        }
        Ok(found)
    }

    /// From the information to what is reported; an error when the camera is not determined, as the calibration would say it.
    fn prediction(&self, information: &CameraMatrix) -> Result<Prediction, Error> {
        let singular = || {
            self.undetermined(
                format!("the motions do not tell its {} unknowns apart", self.calibration.constraint.unknowns()),
                unclear(),
            )
        };
        let free = &self.setting.free;
        let c = inverse_free(information, free)
            .filter(|c| c[(0, 0)] < MAX_LN_F_SIGMA * MAX_LN_F_SIGMA)
            .ok_or_else(singular)?;
        let of_matrix = c.fixed_view::<5, 5>(0, 0).into_owned();
        check_certainty(&of_matrix, self.calibration.constraint, 1, &self.setting.frame).map_err(
            |error| match error {
                Error::Undetermined { direction, .. } => self.undetermined(
                    direction.replacen("1 attitude would give", "the motions planned would give", 1),
                    unclear(),
                ),
                error => error,
            },
        )?;
        let px = self.in_pixels(&c);
        let sd = |p: Parameter| {
            let place = self.setting.camera.place(p).filter(|place| free[*place])?;
            Some(px[(place, place)].max(0.0).sqrt())
        };
        let variance = ln_f_variance(&c);
        let share = |indices: &[usize]| {
            let kept: Vec<usize> = indices.iter().copied().filter(|&i| free[i]).collect();
            let cross = nalgebra::DVector::from_fn(kept.len(), |r, _| c[(kept[r], 0)] + 0.5 * c[(kept[r], 1)]);
            let block = nalgebra::DMatrix::from_fn(kept.len(), kept.len(), |r, s| c[(kept[r], kept[s])]);
            match inverse_spd(&block) {
                Some(inverse) if !kept.is_empty() => {
                    ((cross.transpose() * inverse * &cross)[(0, 0)] / variance).min(1.0)
                }
                _ => 0.0,
            }
        };
        Ok(Prediction {
            standard_deviation: StandardDeviation {
                fx: sd(Parameter::Fx),
                // Tied to fx where the aspect ratio is held.
                fy: Some(px[(1, 1)].max(0.0).sqrt()),
                cx: sd(Parameter::Cx),
                cy: sd(Parameter::Cy),
                skew: sd(Parameter::Skew),
                k1: sd(Parameter::K1),
                k2: sd(Parameter::K2),
                p1: sd(Parameter::P1),
                p2: sd(Parameter::P2),
                k3: sd(Parameter::K3),
            },
            f_percent: 100.0 * variance.sqrt(),
            share: VarianceShares {
                principal_point: share(&[2, 3]),
                aspect: share(&[1]),
                lens: share(&(MATRIX..MAX_CAMERA_NUMBERS).collect::<Vec<_>>()),
            },
        })
    }

    /// A covariance of the camera's numbers in pixels.
    fn in_pixels(&self, covariance: &CameraMatrix) -> DMatrix<f64> {
        let jacobian = pixels_by_camera(&self.intrinsics, &self.setting.frame, MAX_CAMERA_NUMBERS);
        &jacobian * covariance * jacobian.transpose()
    }

    fn priors(&self, covariance: &CameraMatrix) -> Vec<Prior> {
        let frame = &self.setting.frame;
        let of = |p: Parameter| {
            let i = self.setting.camera.place(p)?;
            let (mean, sigma) = self.setting.options.cameras[0].prior(i).filter(|_| self.setting.free[i])?;
            let (value, unit) = match i {
                0 => (mean.exp() * frame.scale_px, mean.exp() * frame.scale_px),
                1 => (mean.exp(), mean.exp()),
                2 => (mean * frame.scale_px + frame.origin_px.x, frame.scale_px),
                3 => (mean * frame.scale_px + frame.origin_px.y, frame.scale_px),
                4 => (mean * frame.scale_px, frame.scale_px),
                _ => (mean, 1.0),
            };
            Some(Prior {
                parameter: p.prior(),
                mean: value,
                sigma: sigma * unit,
                posterior_over_prior: covariance[(i, i)].sqrt() / sigma,
                conflict: None,
            })
        };
        Parameter::ALL.into_iter().filter_map(of).collect()
    }

    /// What the calibration of the motions planned is going to warn of.
    fn warnings(&self, motions: &[MotionSpec], covariance: &CameraMatrix, priors: &[Prior]) -> Vec<Warning> {
        let mut out = Vec::new();
        let free = &self.setting.free;
        if !self.started {
            if motions.len() == 1 {
                out.push(Warning::SingleMotion);
            }
            let same = |a: &MotionSpec, b: &MotionSpec| {
                (a.pitch_down_rad - b.pitch_down_rad).abs() < 1e-9 && (a.roll_rad - b.roll_rad).abs() < 1e-9
            };
            let rolls = || motions.iter().map(|m| m.roll_rad);
            let spread = rolls().fold(f64::MIN, f64::max) - rolls().fold(f64::MAX, f64::min);
            if motions.iter().all(|m| same(m, &motions[0])) {
                let px = self.in_pixels(covariance);
                let doubt = free[2].then(|| PrincipalPointDoubt::new(self.intrinsics.fx, |r, c| px[(r, c)]));
                out.push(Warning::SingleAttitude { motions: motions.len(), doubt });
            } else if spread < PARALLEL_HORIZONS_DEG.to_radians() && free[2] {
                out.push(Warning::ParallelHorizons { spread_deg: spread.to_degrees() });
            }
        }
        // The priors of the aspect ratio and of the distortion decide for good cameras too, so they are not warned of.
        let matters = |p: &&Prior| p.parameter != PriorParameter::Aspect && !p.parameter.is_of_lens();
        for p in priors.iter().filter(matters).filter(|p| p.posterior_over_prior > PRIOR_DECIDES) {
            out.push(Warning::PriorDecides { parameter: p.parameter, posterior_over_prior: p.posterior_over_prior });
        }
        out
    }
}

/// What to do where the motions of a plan leave the camera open.
fn unclear() -> Vec<Remedy> {
    let any_of = vec![Constraint::Auto, Constraint::Focal];
    vec![Remedy::VaryTiltAndRoll, Remedy::MoreMotions, Remedy::UseConstraint { any_of }]
}

/// Variance (frame units) below which a number of a calibration was held: rounding of what is tied.
const MIN_VARIANCE: f64 = 1e-18;
