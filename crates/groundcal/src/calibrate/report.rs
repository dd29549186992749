//! The result value of a calibration: attitudes, reports of the pairs, warnings.

use nalgebra::{SMatrix, Vector2, Vector3};

use crate::calibrate::{
    HELD_ATTITUDE_SIGMA_DEG, Method, Pipeline, Stage,
    joint::Joint,
    linear::Chosen,
    pairs::PairResult,
    unknown_lens::{LensFinding, covariance_of_lens},
};
use crate::{
    error::Error,
    geometry::{
        attitude::{attitude_from_up, up_in_camera},
        distortion::Distortion,
        frame::Frame,
        intrinsics::Intrinsics,
        size::ImageSize,
    },
    numerics::statistics::chi_squared_survival,
    pairs::{circular_points::CircularPoint, correspondence::ImagePair, plane_lens::Lens},
    refine::{GROUP_NUMBERS, SceneModel},
    result::{
        AttitudeReport, Calibration, Camera, Covariance, DistortionReport, Fit, MotionReport, PrincipalPointDoubt,
        Prior, StandardDeviation, Warning, evidence::Evidence,
    },
    select::{attitude_groups::AttitudeGroup, plane_normal::Verdict},
    start::linear_camera::{CameraSolution, check_certainty},
};

/// Standard deviation of fx, in percent, from which on its interval is only roughly one.
const LARGE_UNCERTAINTY_PERCENT: f64 = 5.0;

/// Parameters whose priors, when they decide, are worth a warning: a good camera's aspect ratio and a lens without distortion are
/// no news.
const MATTERS: [&str; 4] = ["fx", "cx", "cy", "skew"];

/// Deviation of the principal point, as a fraction of the width, below which it counts as known.
const KNOWN_PRINCIPAL_POINT: f64 = 0.01;

/// What is known of the lens.
pub(super) enum KnownLens {
    /// Taken to have no distortion.
    NotModelled,
    /// Coefficients given, and the camera they act through.
    Given(Lens),
    /// Estimated, or found to be none.
    Estimated(LensFinding),
}

impl KnownLens {
    /// The lens that was undone in the homographies.
    pub(super) fn lens(&self) -> Option<&Lens> {
        match self {
            KnownLens::NotModelled => None,
            KnownLens::Given(lens) => Some(lens),
            KnownLens::Estimated(finding) => finding.lens(),
        }
    }
}

impl LensFinding {
    /// Standard deviation of k1 for the camera's focal length (the estimate has a reference one).
    fn k1_sigma(&self, k: &Intrinsics) -> f64 {
        self.estimate.covariance[(0, 0)].sqrt() * (k.fx / self.estimate.lens.intrinsics.fx).powi(2)
    }

    fn k2_sigma(&self, k: &Intrinsics) -> f64 {
        self.estimate.covariance[(1, 1)].sqrt() * (k.fx / self.estimate.lens.intrinsics.fx).powi(4)
    }
}

impl Pipeline<'_> {
    /// The camera of the chosen motions, with everything that is reported beside it.
    pub(super) fn conclude(
        &self,
        pairs: &[ImagePair],
        results: &[PairResult],
        chosen: Chosen,
        mut warnings: Vec<Warning>,
        known: &KnownLens,
    ) -> Result<Calibration, Error> {
        self.observer.begin(Stage::Camera, 1);
        let used = chosen.used();
        let mut camera = self.options.camera(self.size);
        let before_a_background = used.iter().any(|&i| results[i].background() > 0);
        if self.options.attitude_sigma_deg.is_none() && used.len() == 1 && before_a_background {
            camera.attitude_sigma_rad = HELD_ATTITUDE_SIGMA_DEG.to_radians();
        }
        let mut solution = self.camera_of(&chosen, &camera)?;
        let joint_options = self.bundle_options(&camera, known, &self.frame());
        // The same weights for every question asked of this solution.
        (camera.attitude_sigma_rad, camera.estimate_attitude_sigma) = (solution.attitude_sigma_rad, false);
        let mut joint = None;
        if self.options.method == Method::Joint {
            match self.refine_jointly(pairs, results, &chosen, &solution, known, &joint_options) {
                Ok(refined) => joint = refined,
                Err(error) if error.is_degenerate() => return Err(error),
                Err(error) => warnings.push(Warning::NotRefined { reason: error.to_string() }),
            }
        }
        let mut lens_share = 0.0;
        if let Some(joint) = &joint {
            check_certainty(&joint.camera_covariance(), self.options.constraint, solution.groups.len(), &self.frame())?;
            solution = joint.solution(solution, &joint_options);
            lens_share = joint.share_of_lens().sqrt();
        } else if let KnownLens::Estimated(finding) = known {
            let added = covariance_of_lens(finding, |lens| {
                Ok(self.refit_camera(pairs, results, &used, lens, &camera)?.intrinsics)
            })?;
            solution.covariance_px += added;
            lens_share = (added[(0, 0)] / solution.covariance_px[(0, 0)]).sqrt();
        }
        let matched = pairs.iter().any(|p| !p.matches.is_empty());
        if matches!(known, KnownLens::NotModelled) && matched {
            // An unmodelled k1 of the true lens shows as the change that undoing it would make, the other way round.
            let f_if = |k1: f64| {
                let lens = Lens { distortion: Distortion::radial(k1, 0.0), intrinsics: solution.intrinsics };
                self.refit_camera(pairs, results, &used, &lens, &camera)
                    .map(|s| 100.0 * (solution.intrinsics.fx / s.intrinsics.fx - 1.0))
            };
            warnings.push(Warning::DistortionNotModelled {
                pincushion_percent: f_if(0.05).unwrap_or(f64::INFINITY),
                barrel_percent: f_if(-0.05).unwrap_or(f64::INFINITY),
            });
        }
        Ok(self.report(pairs, results, Concluded { solution, joint, lens_share, chosen, used }, warnings, known))
    }

    /// Everything that is reported of a solution.
    pub(super) fn report(
        &self,
        pairs: &[ImagePair],
        results: &[PairResult],
        concluded: Concluded,
        mut warnings: Vec<Warning>,
        known: &KnownLens,
    ) -> Calibration {
        let Concluded { solution, joint, lens_share, used, .. } = &concluded;
        let lens = LensResult::new(known, joint.as_ref(), solution);
        let percent = 100.0 * lens_share * solution.covariance_px[(0, 0)].sqrt() / solution.intrinsics.fx;
        if let Some(k1_sigma) = lens.k1_sigma
            && *lens_share > 0.8
            && percent > 1.0
        {
            warnings.push(Warning::DistortionUncertain { percent, k1_sigma });
        }
        for (pair, result) in pairs.iter().zip(results) {
            if result.background() > 0 {
                warnings.push(Warning::StaticBackground {
                    from: self.names[pair.from].clone(),
                    to: self.names[pair.to].clone(),
                    matches: result.background(),
                });
            }
        }
        let attitudes: Vec<Attitude> = match joint {
            // Without plane-normal motions there is no floor to have an attitude to.
            Some(joint) => (0..solution.groups.len())
                .filter_map(|a| Some(Attitude::from_up(joint.group_with(a)?.up, &solution.intrinsics)))
                .collect(),
            None => {
                let of = |group: &AttitudeGroup| {
                    let members = group.members.iter().map(|&m| used[m]);
                    let seen = members.flat_map(|i| results[i].inliers().iter().map(move |&k| pairs[i].matches[k].a));
                    Attitude::of(&group.fused.point, &solution.intrinsics, &self.frame(), seen)
                };
                solution.groups.iter().map(of).collect()
            }
        };
        self.add_warnings(&mut warnings, solution, &attitudes, used.len());
        if let Some(joint) = joint {
            warnings.extend(self.straying_motions(pairs, used, joint));
            let floors = joint.floors;
            if floors.contradict >= 2 && floors.contradict > floors.agree {
                warnings.push(Warning::FloorsContradict { agree: floors.agree, contradict: floors.contradict });
            }
        }
        let motion_reports = self.motion_reports(pairs, results, &concluded, &attitudes);
        let reports = solution
            .groups
            .iter()
            .zip(&attitudes)
            .enumerate()
            .map(|(g, (group, attitude))| {
                let refined = joint.as_ref().and_then(|j| Some((j, j.group_with(g)?)));
                let sigma = |i: usize| refined.map(|(_, g)| g.covariance.rest()[(i, i)].max(0.0).sqrt());
                let over_floor = refined.filter(|(j, _)| j.bundle.scene == SceneModel::Floor);
                let horizon_sigma = refined.and_then(|(j, g)| {
                    attitude.horizon_sigma(&solution.intrinsics, self.size, &j.in_pixels(&g.covariance.fixed()))
                });
                AttitudeReport {
                    pitch_down_deg: attitude.pitch_down_rad.to_degrees(),
                    pitch_down_sigma_deg: sigma(0).map(f64::to_degrees),
                    roll_deg: attitude.roll_rad.to_degrees(),
                    roll_sigma_deg: sigma(1).map(f64::to_degrees),
                    height: over_floor.map(|(_, g)| g.height),
                    height_sigma: over_floor.and(sigma(2)),
                    origin: over_floor.map(|(j, g)| self.names[j.images[g.origin]].clone()),
                    horizon_px: attitude.horizon_px,
                    horizon_sigma_deg: horizon_sigma.map(|s| s[0].to_degrees()),
                    horizon_sigma_px: horizon_sigma.map(|s| s[1]),
                    motions: group.members.iter().map(|&m| used[m]).collect(),
                }
            })
            .collect();
        self.observer.advance(Stage::Camera);
        let calibration = self.assemble(solution, joint.as_ref(), &lens, reports, motion_reports, &warnings);
        Calibration { evidence: self.evidence(pairs, results, joint.as_ref(), known), ..calibration }
    }

    /// Motions whose views' attitudes stray by more than σ_a explains: chi-squared of four deviations, one in a hundred for all
    /// motions together.
    fn straying_motions(&self, pairs: &[ImagePair], used: &[usize], joint: &Joint) -> Vec<Warning> {
        let sigma = joint.bundle.attitude_sigma.sigma;
        let delta = |image: usize| {
            joint.images.binary_search(&image).map_or([0.0; 2], |v| joint.bundle.state.frames[v].delta_rad)
        };
        let strays = |&i: &usize| {
            let (a, b) = (delta(pairs[i].from), delta(pairs[i].to));
            let squares = a.iter().chain(&b).map(|d| (d / sigma).powi(2)).sum::<f64>();
            let improbable = chi_squared_survival(squares, 4) < 0.01 / used.len() as f64;
            (sigma > 0.0 && improbable).then(|| Warning::MotionStrays {
                from: self.names[pairs[i].from].clone(),
                to: self.names[pairs[i].to].clone(),
                apart_deg: (a[0] - b[0]).hypot(a[1] - b[1]).to_degrees(),
                sigma_deg: sigma.to_degrees(),
            })
        };
        used.iter().filter_map(strays).collect()
    }

    fn add_warnings(&self, warnings: &mut Vec<Warning>, s: &CameraSolution, attitudes: &[Attitude], motions: usize) {
        if motions == 1 {
            warnings.push(Warning::SingleMotion);
        }
        let point_given = self.options.principal_point_px.is_some();
        if attitudes.len() == 1 && !point_given {
            let doubt =
                s.estimated[2].then(|| PrincipalPointDoubt::new(s.intrinsics.fx, |r, c| s.covariance_px[(r, c)]));
            // A closed turn or the lens may tell the principal point all the same.
            let known = doubt.is_some_and(|d| d.sigma_px < KNOWN_PRINCIPAL_POINT * self.size.width as f64);
            if !known {
                warnings.push(Warning::SingleAttitude { motions, doubt });
            }
        } else if attitudes.len() > 1 && s.estimated[2] {
            // Rolls modulo 180 degrees: the horizon is a line without direction.
            let rolls: Vec<f64> = attitudes.iter().map(|a| a.roll_rad).collect();
            let apart = |a: f64, b: f64| {
                let d = (a - b).rem_euclid(std::f64::consts::PI);
                d.min(std::f64::consts::PI - d)
            };
            let spread = rolls.iter().flat_map(|a| rolls.iter().map(move |b| apart(*a, *b))).fold(0.0, f64::max);
            if spread < 5f64.to_radians() {
                warnings.push(Warning::ParallelHorizons { spread_deg: spread.to_degrees() });
            }
        }
        if s.variance_inflation > 1.0 {
            warnings.push(Warning::MotionsDisagree {
                chi_squared: s.chi_squared,
                degrees_of_freedom: s.degrees_of_freedom,
                widened: s.variance_inflation.sqrt(),
            });
        }
        for prior in s.priors.iter().filter(|p| MATTERS.contains(&p.parameter) && p.posterior_over_prior > 0.7) {
            warnings.push(Warning::PriorDecides {
                parameter: prior.parameter,
                posterior_over_prior: prior.posterior_over_prior,
            });
        }
        let percent = 100.0 * s.covariance_px[(0, 0)].sqrt() / s.intrinsics.fx;
        if percent > LARGE_UNCERTAINTY_PERCENT {
            warnings.push(Warning::LargeUncertainty { percent });
        }
    }

    fn motion_reports(
        &self,
        pairs: &[ImagePair],
        results: &[PairResult],
        concluded: &Concluded,
        attitudes: &[Attitude],
    ) -> Vec<MotionReport> {
        let Concluded { solution, joint, chosen, used, .. } = concluded;
        let ties = joint.as_ref().map_or(&[][..], |j| &j.ties);
        let motions = &chosen.motions;
        let name = |i: usize| self.names[i].clone();
        pairs
            .iter()
            .zip(results)
            .enumerate()
            .map(|(i, (pair, result))| {
                let position = used.iter().position(|&u| u == i);
                let attitude = position.and_then(|m| solution.groups.iter().position(|g| g.members.contains(&m)));
                let verdict = motions.iter().position(|(m, _)| *m == i).map(|m| chosen.verdicts[m]);
                let reason = match (&result.outcome, verdict) {
                    (Err(refusal), _) => Some(refusal.reason.clone()),
                    (Ok(_), Some(Verdict::Disagrees { sigmas })) if sigmas.is_finite() => {
                        Some(format!("not a turn about the floor's normal: no agreement with the other motions' camera ({sigmas:.0} sigma)"))
                    }
                    (Ok(_), Some(Verdict::Disagrees { .. })) => Some("agrees with no camera".to_string()),
                    (Ok(_), Some(Verdict::WrongSides)) => Some(
                        "not a turn about the floor's normal: the horizon it implies passes between its points".to_string(),
                    ),
                    (Ok(_), Some(Verdict::OtherAttitude { motion, image, sigmas })) => {
                        let other = &motions[motion].1;
                        Some(format!(
                            "not a turn about the floor's normal: {} has another attitude in {} - {} ({sigmas:.0} sigma)",
                            name(image),
                            name(other.from),
                            name(other.to)
                        ))
                    }
                    (Ok(_), None) if position.is_none() => {
                        Some("not explained by a camera that turns on the spot, as the others are".to_string())
                    }
                    _ => None,
                };
                let reason = reason.filter(|_| position.is_none());
                let robust = match &result.outcome {
                    Ok((robust, _)) => Some(robust),
                    Err(refusal) => refusal.homography.as_deref(),
                };
                let geometry = result.outcome.as_ref().ok().map(|(_, g)| g);
                let rotation = geometry.map(|g| {
                    let turn = g.rotation_rad.to_degrees();
                    match attitude.map(|a| &attitudes[a]) {
                        Some(a) => turn * a.turn_sign(&g.circular_point, &solution.intrinsics, &self.frame()),
                        None => turn,
                    }
                });
                let refused_rotation = result.outcome.as_ref().err().and_then(|r| r.rotation_deg);
                MotionReport {
                    from: name(pair.from),
                    to: name(pair.to),
                    used: position.is_some(),
                    tie: ties.contains(&i),
                    rotation_deg: rotation.or(refused_rotation),
                    rotation_sigma_deg: geometry.map(|g| g.rotation_sigma_rad.to_degrees()),
                    rho: geometry.map(|g| g.rho),
                    rho_sigma: geometry.map(|g| g.rho_sigma),
                    matches: robust.map_or(0, |r| r.estimate.matches),
                    candidate_matches: result.candidates,
                    rms_px: robust.map(|r| r.estimate.rms_px),
                    attitude,
                    reason,
                }
            })
            .collect()
    }

    fn assemble(
        &self,
        s: &CameraSolution,
        joint: Option<&Joint>,
        lens: &LensResult,
        attitudes: Vec<AttitudeReport>,
        motions: Vec<MotionReport>,
        warnings: &[Warning],
    ) -> Calibration {
        let k = &s.intrinsics;
        let sd = |i: usize| s.estimated[i].then(|| s.covariance_px[(i, i)].max(0.0).sqrt());
        let d = &lens.distortion;
        let covariance = |r: usize, c: usize| match joint {
            Some(joint) => joint.covariance_px[(r, c)],
            None if r < 5 && c < 5 => s.covariance_px[(r, c)],
            None if r == c => [lens.k1_sigma, lens.k2_sigma][r - 5].map_or(0.0, |v| v * v),
            None => 0.0,
        };
        Calibration {
            format_version: 1,
            pixel_centre: "(0,0) is the centre of the top-left pixel",
            camera: Camera {
                image_size: [self.size.width, self.size.height],
                fx: k.fx,
                fy: k.fy,
                cx: k.cx,
                cy: k.cy,
                skew: k.skew,
                distortion: DistortionReport {
                    model: if d.is_none() { "none" } else { "radtan" },
                    source: lens.source,
                    k1: d.k1,
                    k2: d.k2,
                    p1: d.p1,
                    p2: d.p2,
                },
            },
            standard_deviation: StandardDeviation {
                fx: sd(0),
                fy: sd(1),
                cx: sd(2),
                cy: sd(3),
                skew: sd(4),
                k1: lens.k1_sigma,
                k2: lens.k2_sigma,
            },
            covariance: Covariance {
                parameters: ["fx", "fy", "cx", "cy", "skew", "k1", "k2"],
                matrix: std::array::from_fn(|r| std::array::from_fn(|c| covariance(r, c))),
            },
            constraint: self.options.constraint.name().to_string(),
            method: if joint.is_some() { "joint" } else { "linear" },
            camera_height_m: None,
            scene: joint.map(|j| match j.bundle.scene {
                SceneModel::Floor => "floor",
                SceneModel::Directions => "directions",
            }),
            priors: s
                .priors
                .iter()
                .map(|p| Prior {
                    parameter: p.parameter,
                    mean: p.mean,
                    sigma: p.sigma,
                    posterior_over_prior: p.posterior_over_prior,
                })
                .collect(),
            // Radians and back leave digits that nobody gave.
            attitude_sigma_estimated: s.attitude_sigma_estimated,
            attitude_sigma_deg: (s.attitude_sigma_rad.to_degrees() * 1e9).round() / 1e9,
            fit: Fit {
                chi_squared: s.chi_squared,
                degrees_of_freedom: s.degrees_of_freedom,
                variance_inflation: s.variance_inflation,
                distortion_amplification: 1.0,
                refinement: joint.map(Joint::report),
            },
            views: joint.map_or(Vec::new(), |j| self.view_reports(j)),
            height_sigma: joint
                .map(|j| j.bundle.height_sigma.sigma)
                .filter(|_| joint.is_some_and(|j| j.bundle.scene == SceneModel::Floor)),
            attitudes,
            motions,
            warnings: warnings.iter().map(Warning::report).collect(),
            evidence: Evidence::default(),
        }
    }
}

pub(super) fn amplify(c: &mut Calibration, factor: f64) {
    let s = &mut c.standard_deviation;
    for value in [&mut s.fx, &mut s.fy, &mut s.cx, &mut s.cy, &mut s.skew].into_iter().flatten() {
        *value *= factor;
    }
    for value in c.covariance.matrix.iter_mut().flatten() {
        *value *= factor * factor;
    }
    c.fit.distortion_amplification = factor;
    let percent = 100.0 * c.standard_deviation.fx.unwrap_or(0.0) / c.camera.fx;
    let warning = Warning::LargeUncertainty { percent };
    c.warnings.retain(|w| w.code != warning.report().code);
    if percent > LARGE_UNCERTAINTY_PERCENT {
        c.warnings.push(warning.report());
    }
}

/// A solution and what it came from.
pub(super) struct Concluded {
    pub(super) solution: CameraSolution,
    pub(super) joint: Option<Joint>,
    /// How much of the deviation of f comes from the lens.
    pub(super) lens_share: f64,
    pub(super) chosen: Chosen,
    /// Indices of the pairs used.
    pub(super) used: Vec<usize>,
}

/// The lens as it is reported.
struct LensResult {
    source: &'static str,
    distortion: Distortion,
    k1_sigma: Option<f64>,
    k2_sigma: Option<f64>,
}

impl LensResult {
    fn new(known: &KnownLens, joint: Option<&Joint>, s: &CameraSolution) -> Self {
        let held = |source, distortion| Self { source, distortion, k1_sigma: None, k2_sigma: None };
        match (known, joint) {
            (KnownLens::NotModelled, _) => held("not modelled", Distortion::default()),
            (KnownLens::Given(lens), _) => held("given", lens.distortion),
            (KnownLens::Estimated(_), Some(joint)) => {
                // What is not estimated has no variance.
                let sigma = |i: usize| Some(joint.covariance_px[(i, i)].sqrt()).filter(|s| *s > 0.0);
                Self { source: "estimated", distortion: joint.distortion, k1_sigma: sigma(5), k2_sigma: sigma(6) }
            }
            (KnownLens::Estimated(finding), None) => {
                let k = &s.intrinsics;
                let ln_f_sigma = s.covariance_px[(0, 0)].max(0.0).sqrt() / k.fx;
                let lens = finding.lens().map(|l| l.with_focal_length(k.fx));
                let d = lens.map_or(Distortion::default(), |l| l.distortion);
                Self {
                    source: "estimated",
                    distortion: d,
                    // The residuals see k1 / f² and k2 / f⁴: what is unknown of f adds.
                    k1_sigma: Some(finding.k1_sigma(k).hypot(2.0 * d.k1 * ln_f_sigma)),
                    k2_sigma: Some(finding.k2_sigma(k).hypot(4.0 * d.k2 * ln_f_sigma)),
                }
            }
        }
    }
}

/// The floor's normal in the camera frame.
pub(super) struct Attitude {
    pub(super) pitch_down_rad: f64,
    pub(super) roll_rad: f64,
    horizon_px: Option<[f64; 3]>,
    up: Vector3<f64>,
}

impl Attitude {
    /// From a circular point (frame coordinates): the normal is the cross product of the real and imaginary part of
    /// K⁻¹e. It points up: away from the points seen on the floor, or, when points lie on both sides of the horizon (a
    /// scene at infinity), to the top of the image.
    pub(super) fn of(
        point: &CircularPoint,
        k: &Intrinsics,
        frame: &Frame,
        seen: impl Iterator<Item = Vector2<f64>>,
    ) -> Self {
        let mut up = normal_of(point, k, frame);
        let (mut below, mut above) = (0usize, 0usize);
        for p in seen {
            if k.ray(&p).dot(&up) < 0.0 {
                below += 1;
            } else {
                above += 1;
            }
        }
        let one_sided = below.max(above) > 9 * below.min(above) && below + above > 0;
        let turn_over = if one_sided { above > below } else { up.y > 0.0 || (up.y == 0.0 && up.z > 0.0) };
        if turn_over {
            up = -up;
        }
        Self::from_up(up, k)
    }

    /// From the unit normal itself.
    fn from_up(up: Vector3<f64>, k: &Intrinsics) -> Self {
        let (pitch_down_rad, roll_rad) = attitude_from_up(&up);
        Self { pitch_down_rad, roll_rad, horizon_px: horizon_px(k, &up), up }
    }

    /// Standard deviations of the horizon's direction (radians) and of its distance from the image's centre (pixels), from the
    /// covariance of camera (pixels), pitch and roll (radians). `None`: at infinity.
    fn horizon_sigma(
        &self,
        k: &Intrinsics,
        size: ImageSize,
        covariance: &SMatrix<f64, GROUP_NUMBERS, GROUP_NUMBERS>,
    ) -> Option<[f64; 2]> {
        let [x, y] = size.centre_px();
        // The line's normal turns by the cross product, its distance changes by the difference.
        let [a, b, c] = self.horizon_px?;
        let moved = |i: usize, step: f64| {
            let mut p = [k.fx, k.fy, k.cx, k.cy, k.skew, 0.0, 0.0, self.pitch_down_rad, self.roll_rad, 0.0];
            p[i] += step;
            let k = Intrinsics { fx: p[0], fy: p[1], cx: p[2], cy: p[3], skew: p[4] };
            let [a2, b2, c2] = horizon_px(&k, &up_in_camera(p[7], p[8]))?;
            Some([(a * b2 - b * a2).atan2(a * a2 + b * b2), (a2 - a) * x + (b2 - b) * y + (c2 - c)])
        };
        let mut jacobian = SMatrix::<f64, 2, GROUP_NUMBERS>::zeros();
        for i in 0..GROUP_NUMBERS {
            let h = if i < 5 { 1e-3 } else { 1e-6 };
            let (up, down) = (moved(i, h)?, moved(i, -h)?);
            for r in 0..2 {
                jacobian[(r, i)] = (up[r] - down[r]) / (2.0 * h);
            }
        }
        let variance = jacobian * covariance * jacobian.transpose();
        Some([0, 1].map(|i| variance[(i, i)].max(0.0).sqrt()))
    }

    /// +1 when the eigenvalue's angle is a counter-clockwise turn of the camera seen from above, -1 otherwise: the
    /// eigenvector K A (1, i, 0) belongs to exp(i (yaw_b - yaw_a)).
    fn turn_sign(&self, point: &CircularPoint, k: &Intrinsics, frame: &Frame) -> f64 {
        normal_of(point, k, frame).dot(&self.up).signum()
    }
}

/// The line a x + b y + c = 0, a² + b² = 1, of a plane's normal; `None` at infinity.
fn horizon_px(k: &Intrinsics, up: &Vector3<f64>) -> Option<[f64; 3]> {
    let line = k.inverse_matrix().transpose() * up;
    let length = line.xy().norm();
    (length > 1e-12).then(|| [line.x / length, line.y / length, line.z / length])
}

fn normal_of(point: &CircularPoint, k: &Intrinsics, frame: &Frame) -> Vector3<f64> {
    let m = (k.inverse_matrix() * frame.pixel_matrix()).map(|x| nalgebra::Complex::new(x, 0.0));
    let v = m * point.point;
    v.map(|z| z.re).cross(&v.map(|z| z.im)).normalize()
}
