//! The result value, put together from a camera and what it was made from.

use crate::{
    calibrate::{
        attitude::Attitude,
        checks::{doubts, large_uncertainty},
        evidence::evidence_of,
        joint::JointSolution,
        lens_result::LensResult,
        names::Names,
        options::{Method, MotionModel},
        solved::Solved,
        stage_options::StageOptions,
    },
    floor::{
        projection::{CELLS, projection_uncertainty},
        view::FloorView,
    },
    geometry::plane_view::View,
    ids::{GroupId, ViewId},
    numerics::statistics::CHI_SQUARED_2_999,
    pairs::{known_lens::KnownLens, observation::PairObservation},
    refine::{SceneModel, ViewEstimate},
    result::{
        self, AttitudeReport, Calibration, Camera, Covariance, Fit, MotionReport, Parameter, PixelCentre, Scene,
        StandardDeviation, ViewParameter, ViewReport, Warning,
        calibration::{FORMAT_VERSION, SCHEMA_VERSION},
        diagnosis,
        evidence::ObservationEvidence,
        judge::verdict_on,
    },
    select::{
        attitude_groups::{AttitudeGroup, DIFFERENT_ATTITUDE},
        general::PAIRS_PER_IMAGE,
        selection::{MotionKind, PairVerdict, Rejection, Selection},
    },
};

/// Everything that is reported of a camera. `before`: doubts about the source.
pub(super) fn assemble(
    solved: &Solved,
    selection: &Selection,
    pairs: &[PairObservation],
    known: &KnownLens,
    names: Names<'_>,
    stages: &StageOptions<'_>,
    before: Vec<Warning>,
) -> Calibration {
    let joint = solved.joint.as_ref();
    let selection = solved.selection.as_ref().unwrap_or(selection);
    let lens = LensResult::new(known, joint, &solved.solution);
    let attitudes = attitudes_of(solved, pairs, stages);
    let mut warnings = before;
    warnings.extend(solved.warnings.iter().cloned());
    warnings.extend(doubts(solved, &lens, &attitudes, pairs, names, stages));
    let calibration = Calibration {
        attitudes: attitude_reports(solved, &attitudes, names, stages),
        views: joint.map_or(Vec::new(), |joint| view_reports(joint, names)),
        motions: motion_reports(solved, selection, pairs, &attitudes, names, stages),
        warnings,
        evidence: evidence_of(pairs, joint, known, names, &stages.frame),
        ..camera_report(solved, &lens, reported(selection.kind), stages)
    };
    let mut calibration = match solved.amplification {
        Some(factor) => amplified(calibration, factor),
        None => calibration,
    };
    if let Some(refinement) = &mut calibration.fit.refinement {
        refinement.reprojection_rms_px = reprojection_rms_px(&calibration.evidence.observations);
    }
    calibration.projection_uncertainty = projection_uncertainty(&calibration, CELLS);
    let diagnoses = diagnosis::motions(&calibration);
    for (motion, diagnosis) in calibration.motions.iter_mut().zip(diagnoses) {
        motion.diagnosis = diagnosis;
    }
    calibration.verdict = Some(verdict_on(&calibration, stages.options.motion == MotionModel::Turning));
    calibration
}

/// The kind of motion as it is reported.
fn reported(kind: MotionKind) -> result::MotionKind {
    match kind {
        MotionKind::PlaneNormal => result::MotionKind::PlaneNormal,
        MotionKind::Turning { .. } => result::MotionKind::Turning,
        MotionKind::General => result::MotionKind::General,
    }
}

/// Over the observations in all images; `None` without any.
fn reprojection_rms_px(observations: &[ObservationEvidence]) -> Option<f64> {
    let squares: f64 = observations.iter().map(|o| o.residual_px[0].powi(2) + o.residual_px[1].powi(2)).sum();
    (!observations.is_empty()).then(|| (squares / observations.len() as f64).sqrt())
}

/// The camera alone.
fn camera_report(
    solved: &Solved,
    lens: &LensResult,
    motion: result::MotionKind,
    stages: &StageOptions<'_>,
) -> Calibration {
    let (s, joint) = (&solved.solution, solved.joint.as_ref());
    let sd = |i: usize| s.estimated[i].then(|| s.covariance_px[(i, i)].max(0.0).sqrt());
    let covariance = |r: usize, c: usize| match (joint, Parameter::ALL[r], Parameter::ALL[c]) {
        (Some(joint), a, b) => joint.covariance_of(a, b),
        (None, a, b) if !a.is_of_lens() && !b.is_of_lens() => s.covariance_px[(r, c)],
        (None, a, b) if a == b => lens.sigma(a).map_or(0.0, |v| v * v),
        (None, ..) => 0.0,
    };
    let over_floor = joint.filter(|joint| joint.bundle.scene == SceneModel::Floor);
    Calibration {
        schema_version: SCHEMA_VERSION,
        format_version: FORMAT_VERSION,
        verdict: None,
        pixel_centre: PixelCentre::TopLeftPixel,
        camera: Camera::new(stages.size, &s.intrinsics, lens.lens, lens.source),
        standard_deviation: StandardDeviation {
            fx: sd(0),
            fy: sd(1),
            cx: sd(2),
            cy: sd(3),
            skew: sd(4),
            k1: lens.sigma(Parameter::K1),
            k2: lens.sigma(Parameter::K2),
            p1: lens.sigma(Parameter::P1),
            p2: lens.sigma(Parameter::P2),
            k3: lens.sigma(Parameter::K3),
        },
        covariance: Covariance::from_fn(&Parameter::ALL, covariance),
        constraint: solved.constraint,
        method: solved.method,
        motion: Some(motion),
        camera_height_m: None,
        camera_height_sigma_m: None,
        scene: match (solved.method, over_floor) {
            (Method::Linear | Method::Kzr | Method::Transferred, _) => None,
            (Method::Joint, Some(_)) => Some(Scene::Floor),
            (Method::Joint, None) | (Method::Rotating, _) => Some(Scene::Directions),
        },
        priors: s.priors.clone(),
        attitude_sigma_estimated: s.attitude_sigma_estimated,
        // Radians and back leave digits that nobody gave.
        attitude_sigma_deg: (s.attitude_sigma_rad.to_degrees() * 1e9).round() / 1e9,
        fit: Fit {
            chi_squared: s.chi_squared,
            degrees_of_freedom: s.degrees_of_freedom,
            variance_inflation: s.variance_inflation,
            distortion_amplification: 1.0,
            refinement: joint.map(JointSolution::report),
        },
        height_sigma: over_floor
            .filter(|_| motion != result::MotionKind::General)
            .map(|joint| joint.bundle.height_sigma.sigma),
        attitudes: Vec::new(),
        views: Vec::new(),
        motions: Vec::new(),
        on_base: Vec::new(),
        projection_uncertainty: None,
        warnings: Vec::new(),
        evidence: Default::default(),
    }
}

/// The attitudes of the solution's groups, as they are known best.
fn attitudes_of(solved: &Solved, pairs: &[PairObservation], stages: &StageOptions<'_>) -> Vec<Attitude> {
    let s = &solved.solution;
    match &solved.joint {
        // Without plane-normal motions there is no floor to have an attitude to.
        Some(joint) => (0..s.groups.len())
            .filter_map(|a| Some(Attitude::from_up(joint.group_with(a)?.up, &s.intrinsics)))
            .collect(),
        None => {
            let of =
                |group: &AttitudeGroup| Attitude::of_group(group, &s.intrinsics, &stages.frame, pairs, &solved.used);
            s.groups.iter().map(of).collect()
        }
    }
}

fn attitude_reports(
    solved: &Solved,
    attitudes: &[Attitude],
    names: Names<'_>,
    stages: &StageOptions<'_>,
) -> Vec<AttitudeReport> {
    let k = &solved.solution.intrinsics;
    let report = |(g, (group, attitude)): (usize, (&AttitudeGroup, &Attitude))| {
        let refined = solved.joint.as_ref().and_then(|j| Some((j, j.group_with(g)?)));
        let sigma = |i: usize| refined.map(|(_, g)| g.covariance.without_camera()[(i, i)].max(0.0).sqrt());
        let over_floor = refined.filter(|(j, _)| j.bundle.scene == SceneModel::Floor);
        let horizon_sigma =
            refined.and_then(|(j, g)| attitude.horizon_sigma(k, stages.size, &j.in_pixels(&g.covariance)));
        AttitudeReport {
            pitch_down_deg: attitude.pitch_down_rad.to_degrees(),
            pitch_down_sigma_deg: sigma(0).map(f64::to_degrees),
            roll_deg: attitude.roll_rad.to_degrees(),
            roll_sigma_deg: sigma(1).map(f64::to_degrees),
            height: over_floor.map(|(_, g)| g.height),
            height_sigma: over_floor.and(sigma(2)),
            origin: over_floor.map(|(j, g)| names.of(j.views.image(ViewId::new(g.origin)))),
            horizon_px: attitude.horizon_px,
            horizon_sigma_deg: horizon_sigma.map(|s| s[0].to_degrees()),
            horizon_sigma_px: horizon_sigma.map(|s| s[1]),
            motions: group.members.iter().map(|&m| solved.used[m].index()).collect(),
        }
    };
    solved.solution.groups.iter().zip(attitudes).enumerate().map(report).collect()
}

fn view_reports(joint: &JointSolution, names: Names<'_>) -> Vec<ViewReport> {
    let b = &joint.bundle;
    let name = |view: usize| names.of(joint.views.image(ViewId::new(view)));
    let report = |(v, estimate): (usize, &Option<ViewEstimate>)| {
        let e = estimate.as_ref()?;
        let floor = b.scene == SceneModel::Floor;
        let covariance = joint.view_covariance(e);
        let sigma_deg = |p: ViewParameter| covariance.variance(p).max(0.0).sqrt().to_degrees();
        let [pitch_down_rad, roll_rad] = e.pitch_roll_rad;
        let view = View { pitch_down_rad, roll_rad, yaw_rad: e.yaw_rad, centre: e.centre };
        let over_floor = FloorView::new(&joint.intrinsics, joint.lens, &view).ok().filter(|_| floor);
        Some(ViewReport {
            image: name(v),
            attitude: joint.attitude_of(GroupId::new(b.state.frames[v].group)),
            origin: name(e.origin),
            yaw_deg: e.yaw_rad.to_degrees(),
            yaw_sigma_deg: e.yaw_sigma_rad.to_degrees(),
            pitch_down_deg: pitch_down_rad.to_degrees(),
            pitch_down_sigma_deg: sigma_deg(ViewParameter::PitchDownRad),
            roll_deg: roll_rad.to_degrees(),
            roll_sigma_deg: sigma_deg(ViewParameter::RollRad),
            position: floor.then(|| e.centre.into()),
            position_sigma: floor.then(|| e.centre_sigma.into()),
            floor_from_image: over_floor.map(|o| o.homography_with_covariance(&covariance)),
            observations: e.observations,
            weighted_rms: e.weighted_rms,
            covariance,
        })
    };
    b.views.iter().enumerate().filter_map(report).collect()
}

fn motion_reports(
    solved: &Solved,
    selection: &Selection,
    pairs: &[PairObservation],
    attitudes: &[Attitude],
    names: Names<'_>,
    stages: &StageOptions<'_>,
) -> Vec<MotionReport> {
    let s = &solved.solution;
    let cross_links = solved.joint.as_ref().map_or(&solved.links, |joint| &joint.cross_links);
    let report = |pair: &PairObservation| {
        let member = solved.used.iter().position(|id| *id == pair.id);
        let attitude = member.and_then(|m| s.groups.iter().position(|g| g.members.contains(&m)));
        let geometry = pair.geometry();
        // Of a general motion a homography's eigenvectors are of no turn about the plane's normal.
        let of_turn = geometry.filter(|_| selection.kind != MotionKind::General);
        let rotation_rad = match (&solved.rotations_rad, member, geometry) {
            (Some(angles), Some(m), _) => angles.get(m).copied(),
            (_, _, Some(g)) if of_turn.is_some() => {
                let sign = attitude.map(|a| attitudes[a].turn_sign(&g.circular_point, &s.intrinsics, &stages.frame));
                Some(g.rotation_rad * sign.unwrap_or(1.0))
            }
            _ => None,
        };
        let refused_deg = pair.outcome.as_ref().err().and_then(|refusal| refusal.rotation_deg);
        let plane = pair.plane();
        MotionReport {
            from: names.of(pair.from),
            to: names.of(pair.to),
            used: member.is_some(),
            cross_attitude_link: cross_links.contains(&pair.id),
            rotation_deg: rotation_rad.map(f64::to_degrees).or(refused_deg),
            rotation_sigma_deg: of_turn.map(|g| g.rotation_sigma_rad.to_degrees()),
            height_ratio: of_turn.map(|g| g.height_ratio),
            height_ratio_sigma: of_turn.map(|g| g.height_ratio_sigma),
            matches: plane.map_or(0, |plane| plane.estimate.matches),
            candidate_matches: pair.candidates,
            rms_px: plane.map(|plane| plane.estimate.rms_px),
            attitude,
            reason: match member {
                Some(_) => None,
                None => why_not_used(pair, selection.verdict(pair.id), pairs, names),
            },
            diagnosis: None,
        }
    };
    pairs.iter().map(report).collect()
}

/// Why each pair that is no motion is none, as far as the selection says; without one, as far as its own matches do.
pub(super) fn pairs_left_out(
    pairs: &[PairObservation],
    selection: Option<&Selection>,
    names: Names<'_>,
) -> Vec<([String; 2], String)> {
    let left_out = |pair: &PairObservation| {
        let verdict = selection.map_or(PairVerdict::NoMotion, |selection| selection.verdict(pair.id));
        if matches!(verdict, PairVerdict::Used { .. }) {
            return None;
        }
        let of_turn = || "a turn is to be seen, but with the other pairs it makes no set of motions".to_string();
        let reason = why_not_used(pair, verdict, pairs, names).unwrap_or_else(of_turn);
        Some((pair.images().map(|image| names.of(image)), reason))
    };
    pairs.iter().filter_map(left_out).collect()
}

/// Why a pair is not used, in the words of the report.
fn why_not_used(
    pair: &PairObservation,
    verdict: PairVerdict,
    pairs: &[PairObservation],
    names: Names<'_>,
) -> Option<String> {
    // What a kind of motion asks of a pair is not what makes it a turn.
    let PairVerdict::Rejected(rejection) = verdict else {
        return pair.outcome.as_ref().err().map(|refusal| refusal.reason.clone());
    };
    Some(match rejection {
        Rejection::Disagrees { sigmas } if sigmas * sigmas < CHI_SQUARED_2_999 => format!(
            "within the error bars of the other motions' camera ({sigmas:.1} sigma), but with it their set is no likelier than without"
        ),
        Rejection::Disagrees { sigmas } if sigmas.is_finite() => format!(
            "not a turn about the floor's normal: no agreement with the other motions' camera ({sigmas:.0} sigma, {:.1} are allowed)",
            CHI_SQUARED_2_999.sqrt()
        ),
        Rejection::Disagrees { .. } => "agrees with no camera".to_string(),
        Rejection::WrongSides { beyond, most } => format!(
            "not a turn about the floor's normal: the horizon it implies passes between its points ({:.0} % lie beyond it, {:.0} % are allowed)",
            100.0 * beyond,
            100.0 * most
        ),
        Rejection::OtherAttitude { pair: other, image, sigmas } => {
            let [from, to] = pairs[other].images().map(|image| names.of(image));
            format!(
                "not a turn about the floor's normal: {} has another attitude in {from} - {to} ({sigmas:.0} sigma, {:.1} are allowed)",
                names.of(image),
                DIFFERENT_ATTITUDE.sqrt()
            )
        }
        Rejection::LeftOut => {
            "left out: with it no camera explains all motions together, and its points were furthest from the one \
                               that came out"
                .to_string()
        }
        Rejection::NoRotation { misfit, most } => format!(
            "not explained by a camera that turns on the spot, as the others are (off a rotation by {misfit:.2}, {most} is allowed)"
        ),
        Rejection::OneMotionOnly { matches, of_used } => format!(
            "not needed: the method transfers the one motion of most matches (it has {matches}, the one used {of_used})"
        ),
        Rejection::NotNamed => "not one of the pairs named: at most a link between views".to_string(),
        Rejection::Redundant => {
            format!("not needed: pairs of more matches join its images ({PAIRS_PER_IMAGE} of each image are used)")
        }
        Rejection::TooNoisy { sigma_px, most_px } => {
            format!("the points of its plane scatter by {sigma_px:.1} px, {most_px} px are allowed")
        }
        Rejection::Mirrored => "one of its images is mirrored, or they show a plane from its two sides".to_string(),
        Rejection::OtherPlane => "its points are not of the plane that the other pairs show".to_string(),
        Rejection::Unconnected => "no pair used joins its images with the others".to_string(),
    })
}

/// With all deviations widened because given coefficients act through the focal length.
fn amplified(mut c: Calibration, factor: f64) -> Calibration {
    let s = &mut c.standard_deviation;
    for value in [&mut s.fx, &mut s.fy, &mut s.cx, &mut s.cy, &mut s.skew].into_iter().flatten() {
        *value *= factor;
    }
    c.covariance.scale(|_| factor);
    c.fit.distortion_amplification = factor;
    let percent = 100.0 * c.standard_deviation.fx.unwrap_or(0.0) / c.camera.fx;
    c.warnings.retain(|warning| !matches!(warning, Warning::LargeUncertainty { .. }));
    c.warnings.extend(large_uncertainty(percent));
    c
}
