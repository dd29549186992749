//! The camera of views that moved in any way before one plane (Triggs 1998; Malis & Cipolla 2000).
//!
//! ```text
//! homographies of all views through the lens that the planes tell -> focal length and normal (start/general_plane.rs)
//!     -> joint refinement from each of the best few, every view with an attitude and a height of its own -> the best by evidence
//! ```
//!
//! It is the refinement of plane-normal motions with σ_a infinite. What the data leave open shows in its error bars, but for two things that
//! have no error bar: another minimum that is as good, and views that are all tilted alike.

use nalgebra::{Matrix3, SMatrix, Vector3};

use crate::{
    calibrate::{
        doubts::widen_general_by_doubts,
        joint::JointSolution,
        options::{Method, MotionModel},
        prior_conflicts::{allow_for_open_alternatives, release_contradicted_priors},
        refinement_input::{
            Refined, RefinementInput, RefinementOptions, adjusted, adjusted_below_horizon, shown_by_all,
        },
        setup::{Setup, starting_camera},
        solved::Solved,
        soundness::check_soundness,
        stage_options::StageOptions,
    },
    error::Error,
    geometry::intrinsics::Intrinsics,
    ids::{ImageId, PairId, ViewId},
    numerics::statistics::median,
    observer::Observer,
    pairs::{known_lens::KnownLens, observation::PairObservation},
    refine::{SceneModel, State, Track, start::state_of_views},
    remedy::Remedy,
    result::Warning,
    select::general::{homographies_from_reference, select_general},
    start::{
        general_plane::{PlaneStart, in_camera_coordinates, plane_starts},
        linear_camera::{CameraSolution, what_is_uncertain},
    },
};

use super::departures::departures_found;

/// Twice the logarithm of the odds within which two minima are both possible: 3 standard deviations.
const AMBIGUOUS_LOG_ODDS: f64 = 9.0;
/// Distance of two minima's focal lengths, in deviations of the better, from which on they are two.
const MIN_SEPARATION_SIGMAS: f64 = 4.0;
/// Least distance between optical centres, in distances from the plane, with which there is a plane to be seen: that of a lens off the axis of a
/// head by 2 cm, 1 m above a floor.
const MIN_BASELINE_HEIGHTS: f64 = 0.02;
/// The same where nobody asked for views of a plane: a lens off the axis by 5 cm in a room of 1.5 m to each side has as much and more. (Of 30 such answers of
/// the bench one in a room had 0.036 and was off by 14 deviations, one on a lawn had 0.032; a ring about a tilted axis has 0.08 to 0.12, views by hand and of
/// walls 0.24 and more.)
const MIN_BASELINE_UNASKED_HEIGHTS: f64 = 0.065;
/// Largest variance of the residuals in units of the matching noise: of bent boards it is up to 2, of a street corner 24.
const MAX_VARIANCE: f64 = 5.0;
/// Largest design effect of the residuals: of bent boards it is up to 5, of scenes of the bench that are not one plane 9 to 50.
const MAX_DESIGN_EFFECT: f64 = 8.0;
/// Median squared residual of a pair, in that of all pairs, from which on it shows another plane: five deviations.
const OTHER_PLANE_VARIANCE: f64 = 25.0;
/// Angle between the plane's normals as the views see it, degrees, below which the focal length hardly shows: its standard deviation falls
/// with the square of that angle.
const MIN_SPREAD_DEG: f64 = 3.0;

/// The camera of views of one plane.
///
/// # Errors
/// [`Error::Undetermined`] where the views are tilted alike, two cameras explain them or the error bars are too wide; see [`check_soundness`];
/// [`Error::Stopped`].
pub(super) fn solve_general(
    pairs: &[PairObservation],
    lens: &KnownLens,
    stages: &StageOptions<'_>,
    observer: &dyn Observer,
) -> Result<Solved, Error> {
    let options = refinement_options(lens, stages);
    // Matched again, some pairs are known better than others.
    let (mut selection, mut other_planes) = (select_general(pairs, &[], &stages.general)?, Vec::new());
    let (input, best) = loop {
        let input = RefinementInput::of_views(pairs, &selection, lens, &options, observer).ok_or(Error::Numerical {
            stage: "joint refinement",
            detail: "there are no matches to refine on".into(),
        })?;
        let best = best_of(&input, starts(&input, lens, stages), &options, stages)?;
        let wrong = of_other_planes(&best, &input);
        if wrong.is_empty() {
            break (input, best);
        }
        other_planes.extend(wrong);
        selection = select_general(pairs, &other_planes, &stages.general)?;
    };
    let joint = adjusted_below_horizon(
        SceneModel::Floor,
        Setup { links: Vec::new(), tracks: best.tracks.clone() },
        input.views.clone(),
        vec![best.bundle.state.clone()],
        &options,
        observer,
    )
    .map_err(|error| match error {
        Error::Numerical { .. } => Error::Unsound {
            reason: format!("the views do not hold together as views of one plane ({})", error.finding()),
            remedies: vec![Remedy::CheckImages, Remedy::MoreViews],
        },
        error => error,
    })?;
    let refined = input.refined(joint, solution_of(&best, stages), options);
    let (mut refined, _) = release_contradicted_priors(&input, refined)?;
    allow_for_open_alternatives(&mut refined);
    widen_general_by_doubts(&mut refined.joint, stages.options);
    check_spread(&refined.joint.bundle.state, stages)?;
    check_soundness(&refined.joint, stages.size)?;
    check_one_plane(&refined.joint)?;
    check_moved(&refined.joint, stages.options.motion)?;
    let constraint = stages.options.constraint;
    if let Some(uncertain) = what_is_uncertain(&refined.joint.camera_covariance(), &stages.frame) {
        return Err(Error::Undetermined {
            constraint: constraint.name(),
            direction: format!("{} views of a plane would give {uncertain}", input.views.len()),
            remedies: vec![Remedy::MoreViews, Remedy::GiveValue],
        });
    }
    let mut warnings = departures_found(&refined);
    warnings.extend(refined.fisheye.map(|twice_log_odds| Warning::FisheyeLens { twice_log_odds }));
    warnings.extend(refined.conflicts.iter().cloned().map(Warning::PriorContradicted));
    let Refined { joint, options, .. } = refined;
    let solution = joint.solution(solution_of(&joint, stages), &options.bundle);
    // An attitude of its own has no error against a group.
    let solution = CameraSolution { attitude_sigma_rad: 0.0, attitude_sigma_estimated: false, ..solution };
    Ok(Solved {
        method: Method::Joint,
        constraint,
        solution,
        lens_share: joint.share_of_lens().sqrt(),
        rotations_rad: Some(rotations(&joint, &input)),
        joint: Some(joint),
        used: input.used,
        links: Vec::new(),
        selection: Some(selection),
        amplification: None,
        warnings,
    })
}

fn refinement_options(lens: &KnownLens, stages: &StageOptions<'_>) -> RefinementOptions {
    let options = stages.options;
    let mut bundle = options.refinement(stages.size, &stages.camera, lens.is_estimated());
    bundle.attitude_sigma_rad = Some(f64::INFINITY);
    RefinementOptions {
        frame: stages.frame,
        k2_is_held: options.lens.holds_k2(),
        radtan_only: options.lens.is_radtan_only(),
        bundle,
        camera: stages.camera.clone(),
    }
}

/// States to refine from.
fn starts(input: &RefinementInput<'_>, lens: &KnownLens, stages: &StageOptions<'_>) -> Vec<State> {
    let (reference, known) = homographies_from_reference(&input.used, input.pairs);
    let aspect = stages.options.aspect.unwrap_or(1.0);
    let images: Vec<ImageId> = (0..input.views.len()).map(|v| input.views.image(ViewId::new(v))).collect();
    let Some(of_views) = images.iter().map(|image| known.get(image).copied()).collect::<Option<Vec<_>>>() else {
        return Vec::new();
    };
    let others: Vec<Matrix3<f64>> =
        images.iter().zip(&of_views).filter(|(image, _)| **image != reference).map(|(_, h)| *h).collect();
    let state = |start: PlaneStart| {
        let f_px = start.f * stages.frame.scale_px;
        let origin = stages.frame.origin_px;
        let k = Intrinsics { fy: f_px * aspect, ..Intrinsics::square(f_px, origin.x, origin.y) };
        let camera = starting_camera(&k, lens, stages.options.lens.holds_k2(), &stages.frame);
        let m: Vec<Matrix3<f64>> = of_views.iter().map(|h| in_camera_coordinates(h, start.f, aspect)).collect();
        let up = towards_camera(&start.normal, reference, input, &k);
        state_of_views(camera, &up, &m)
    };
    plane_starts(&others, aspect).into_iter().filter_map(state).collect()
}

/// The normal with the sign that has the plane in front of the reference: its points lie below.
fn towards_camera(
    normal: &Vector3<f64>,
    reference: ImageId,
    input: &RefinementInput<'_>,
    k: &Intrinsics,
) -> Vector3<f64> {
    let k_inverse = k.inverse_matrix();
    let view = input.views.of(reference).map_or(0, ViewId::index);
    let seen = input.setup.tracks.iter().flat_map(|t| &t.observations).filter(|o| o.frame == view);
    let below = seen.map(|o| normal.dot(&(k_inverse * o.pixel.push(1.0))).signum()).sum::<f64>();
    if below > 0.0 { -normal } else { *normal }
}

/// The refinement of most evidence, roughly; refused where another, of another focal length, has nearly as much.
fn best_of(
    input: &RefinementInput<'_>,
    mut starts: Vec<State>,
    options: &RefinementOptions,
    stages: &StageOptions<'_>,
) -> Result<JointSolution, Error> {
    let unsound = |reason: String| Error::Unsound { reason, remedies: vec![Remedy::CheckImages, Remedy::MoreViews] };
    if starts.is_empty() {
        return Err(unsound("no camera makes views of one plane of the homographies".into()));
    }
    if let [state, ..] = starts.as_slice() {
        check_spread(state, stages)?;
    }
    let scene = SceneModel::Floor;
    // Evidences are compared on the same points.
    let tracks = shown_by_all(scene, input.setup.tracks.clone(), &mut starts, &options.bundle);
    let mut trial = options.clone();
    trial.bundle = trial.bundle.for_trial();
    let refined = |state: &State, options: &RefinementOptions| {
        let setup = Setup { links: Vec::new(), tracks: tracks.clone() };
        adjusted(scene, setup, input.views.clone(), vec![state.clone()], options, input.observer)
    };
    let mut found: Vec<JointSolution> = Vec::new();
    let mut last_error = None;
    for state in &starts {
        match refined(state, &trial) {
            Ok(joint) => found.push(joint),
            Err(Error::Stopped) => return Err(Error::Stopped),
            Err(error) => last_error = Some(error),
        }
    }
    let gain = |a: &JointSolution, b: &JointSolution| match (a.bundle.evidence, b.bundle.evidence) {
        (Some(a), Some(b)) => a.gain_over(&b),
        (Some(_), None) => f64::INFINITY,
        _ => f64::NEG_INFINITY,
    };
    let better = |best: usize, other: usize| if gain(&found[other], &found[best]) > 0.0 { other } else { best };
    let Some(gains_most) = (0..found.len()).reduce(better) else {
        // What has no refinement is contradicted by its points, whatever stopped it.
        return Err(match last_error {
            Some(error) if error.is_degenerate() => error,
            Some(error) => {
                unsound(format!("views of one plane do not explain the homographies together ({})", error.finding()))
            }
            None => unsound("the joint refinement failed".into()),
        });
    };
    let best = &found[gains_most];
    let sigma = best.camera_covariance()[(0, 0)].max(0.0).sqrt();
    let rival = found.iter().find(|other| {
        let apart = (other.intrinsics.fx / best.intrinsics.fx).ln().abs();
        apart > MIN_SEPARATION_SIGMAS * sigma && gain(best, other) < AMBIGUOUS_LOG_ODDS
    });
    if let Some(rival) = rival {
        return Err(Error::Undetermined {
            constraint: stages.options.constraint.name(),
            direction: format!(
                "two cameras explain the {} views of the plane alike: focal lengths of {:.0} and {:.0} px",
                input.views.len(),
                best.intrinsics.fx,
                rival.intrinsics.fx
            ),
            remedies: vec![Remedy::MoreViews, Remedy::GiveValue],
        });
    }
    Ok(found.swap_remove(gains_most))
}

/// Pairs whose points are not of the plane that the others show: their residuals are far larger, in the median, than those of all.
fn of_other_planes(joint: &JointSolution, input: &RefinementInput<'_>) -> Vec<PairId> {
    let of_pair = |id: PairId| {
        let [a, b] = input.views.of_pair(&input.pairs[id])?.map(ViewId::index);
        let squared = |(track, residuals): (&Track, &Vec<f64>)| {
            let of = |frame: usize| track.observations.iter().position(|o| o.frame == frame).map(|o| residuals[o]);
            Some(of(a)? + of(b)?)
        };
        let both = joint.tracks.iter().zip(&joint.bundle.squared_residuals).filter_map(squared);
        Some(median(&mut both.collect::<Vec<f64>>()))
    };
    let residuals: Vec<(PairId, f64)> =
        input.used.iter().filter_map(|&id| Some((id, of_pair(id)?))).filter(|(_, r)| r.is_finite()).collect();
    let usual = median(&mut residuals.iter().map(|(_, r)| *r).collect::<Vec<f64>>());
    residuals.into_iter().filter(|(_, r)| *r > OTHER_PLANE_VARIANCE * usual).map(|(id, _)| id).collect()
}

/// Refuses residuals that are no noise: where every view is free, nothing else but the plane itself can be wrong.
fn check_one_plane(joint: &JointSolution) -> Result<(), Error> {
    let variance = joint.bundle.variance_factors.iter().copied().fold(0.0, f64::max);
    let effect = joint.bundle.design_effects.iter().copied().fold(0.0, f64::max);
    if variance <= MAX_VARIANCE && effect <= MAX_DESIGN_EFFECT {
        return Ok(());
    }
    Err(Error::Unsound {
        reason: format!(
            "the points are not of one plane, or the lens is of no known model: however the camera moved, residuals are left that are {:.1} \
             times as large as the matching noise, and neighbours have {effect:.1} times as much in common as noise has (at most {:.1} and \
             {MAX_DESIGN_EFFECT} are trusted)",
            variance.sqrt(),
            MAX_VARIANCE.sqrt()
        ),
        remedies: vec![Remedy::CheckImages, Remedy::MaskBackground],
    })
}

/// Refuses a camera that turned on the spot: then any plane will do, and what is said of it is made up.
fn check_moved(joint: &JointSolution, motion: MotionModel) -> Result<(), Error> {
    let least = if motion == MotionModel::General { MIN_BASELINE_HEIGHTS } else { MIN_BASELINE_UNASKED_HEIGHTS };
    let centres: Vec<Vector3<f64>> = joint.bundle.views.iter().flatten().map(|view| view.centre).collect();
    let farthest = centres.iter().flat_map(|a| centres.iter().map(move |b| (a - b).norm())).fold(0.0, f64::max);
    if farthest >= least {
        return Ok(());
    }
    Err(Error::Unsound {
        reason: format!(
            "the camera turned on the spot: as views of one plane its optical centres are within {:.1} % of its distance from it ({:.1} % are \
             needed), and such views show no plane",
            100.0 * farthest,
            100.0 * least
        ),
        remedies: vec![Remedy::MoreViews, Remedy::TurnAboutOpticalCentre],
    })
}

/// Refuses views that are all tilted alike: whatever the focal length, the plane is seen as it is.
fn check_spread(state: &State, stages: &StageOptions<'_>) -> Result<(), Error> {
    let ups: Vec<Vector3<f64>> = state.groups.iter().map(|g| g.attitude.column(2).into_owned()).collect();
    let angle = |a: &Vector3<f64>, b: &Vector3<f64>| a.cross(b).norm().atan2(a.dot(b));
    let spread = ups.iter().flat_map(|a| ups.iter().map(move |b| angle(a, b))).fold(0.0, f64::max).to_degrees();
    if spread >= MIN_SPREAD_DEG {
        return Ok(());
    }
    let off_axis = ups.iter().map(|up| angle(&-up, &Vector3::z())).fold(0.0, f64::max).to_degrees();
    let what = if off_axis < MIN_SPREAD_DEG {
        "all views look straight at the plane".to_string()
    } else {
        format!("the camera was tilted alike to the plane in all views (within {spread:.1} degrees)")
    };
    Err(Error::Undetermined {
        constraint: stages.options.constraint.name(),
        direction: format!("{what}: without a change of tilt the focal length does not show, whatever else moved"),
        remedies: vec![Remedy::TiltOrRoll { deg: 30.0 }, Remedy::VouchPlaneNormal],
    })
}

/// No closed form: general motion needs no plane-normal motions, which it is made of.
fn solution_of(joint: &JointSolution, stages: &StageOptions<'_>) -> CameraSolution {
    CameraSolution {
        intrinsics: joint.intrinsics,
        covariance_px: SMatrix::zeros(),
        estimated: stages.options.constraint.estimated(),
        priors: stages.camera.prior_uses(&stages.frame, &SMatrix::zeros()),
        groups: Vec::new(),
        chi_squared: 0.0,
        degrees_of_freedom: 0,
        attitude_sigma_rad: 0.0,
        attitude_sigma_estimated: false,
        variance_inflation: 1.0,
    }
}

/// Angles by which the camera turned between the images of each pair used.
fn rotations(joint: &JointSolution, input: &RefinementInput<'_>) -> Vec<f64> {
    let state = &joint.bundle.state;
    let rotation = |view: ViewId| {
        let frame = &state.frames[view.index()];
        state.groups[frame.group].attitude * crate::geometry::attitude::yaw_rotation(frame.yaw_rad)
    };
    let of_pair = |pair: &PairObservation| {
        let [a, b] = input.views.of_pair(pair)?.map(rotation);
        let cosine = 0.5 * ((b * a.transpose()).trace() - 1.0);
        Some(cosine.clamp(-1.0, 1.0).acos())
    };
    input.used.iter().map(|&id| of_pair(&input.pairs[id]).unwrap_or(0.0)).collect()
}
