//! The way from a source to a calibration.
//!
//! ```text
//! observe pairs -> find the lens -> select motions -> match their floor again -> the lens again -> solve -> report
//! ```
//!
//! Every step is a function of what was found so far. [`PairObservation`]s are one list from beginning to end, a [`Selection`] an
//! index on it, so that a step may be taken again with what a later one found.

use crate::{
    calibrate::{
        copies::count_once,
        doubts::is_answer_doubted,
        general::solve_general,
        lens::{estimated_lens_of_motions, given_lens_of_motions, lens_placed_by_motions, through_own_camera},
        names::Names,
        options::{HomographyFit, Method, MotionModel, Options},
        order::{content_key, in_order_of_images},
        outcome::{assemble, pairs_left_out},
        plane_normal::solve_plane_normal,
        published::solve_published,
        refinement::likely_links,
        rotating::solve_rotating,
        solved::Solved,
        source::{GivenPairs, Source},
        stage_options::StageOptions,
        stated_noise::contradicted_noise,
        transferred::solve_transferred,
        turning::{rotations_explain, solve_turning},
    },
    error::Error,
    geometry::parameters::PriorParameter,
    ids::{ImageId, PairId},
    observer::{Observer, Stage},
    pairs::{
        known_lens::{KnownLens, find_fisheye, find_lens, find_placement, lens_of_motions},
        observation::{PairObservation, images_of, why_no_motion},
        observe::{observe, observe_anew, refit_linearly},
        pair_lens::{PairLensOptions, RadialCorrection, correct_each},
        patch::match_by_patches,
        placed_lens::PlacedLens,
    },
    remedy::Remedy,
    result::{Calibration, Warning, judge::one_account_at_most},
    select::{
        general::select_general,
        plane_normal::{PlaneNormalOptions, select_plane_normal},
        rotations::{find_turning, select_rotations},
        selection::{MotionKind, Selection},
    },
    vision::image::GrayImage,
};

/// Relative change of the focal length in the last round of a fixed point that counts as converged.
const FIXED_POINT_TOLERANCE: f64 = 1e-6;

/// Views from which on general motion is tried unasked: of three the equations for a focal length and a normal leave one to check them by.
const MIN_VIEWS_UNASKED: usize = 4;

/// What is known before the camera is.
#[derive(Clone)]
struct Found {
    pairs: Vec<PairObservation>,
    lens: KnownLens,
    selection: Selection,
    /// By how much coefficients given enlarge errors of the focal length through which they act, where they were put through it.
    amplification: Option<f64>,
    warnings: Vec<Warning>,
}

/// From a source to a calibration.
///
/// # Errors
/// See [`Error`].
pub(super) fn run(source: Source<'_>, options: &Options, observer: &dyn Observer) -> Result<Calibration, Error> {
    let stages = StageOptions::new(options, &source.traits);
    let (mut pairs, lens, of_noise) = observe_with_their_noise(source.pairs, &stages, observer)?;
    let images = source.images.as_deref();
    let mut warnings = source.warnings;
    warnings.extend(of_noise);
    warnings.extend(copies_counted_once(&mut pairs, source.names, images));
    observer.begin(Stage::Selection, 1);
    let selected = select_motions(&pairs, &lens, &stages, observer);
    observer.advance(Stage::Selection);
    let left_out = pairs_left_out(&pairs, selected.as_ref().ok(), Names(source.names));
    // A camera that turned on the spot before no floor has no plane to be seen in general motion.
    let turning = selected.as_ref().is_ok_and(is_turning);
    let again = (!turning && tries_general_motion(source.names.len(), options))
        .then(|| (pairs.clone(), lens.clone(), warnings.clone()));
    let answer = selected.and_then(|selection| {
        let found = Found { pairs, lens, selection, amplification: None, warnings };
        camera_of(found, images, &stages, observer)
    });
    let is_doubted = answer.as_ref().is_ok_and(|(solved, _)| is_answer_doubted(solved));
    let traits = (source.names, images);
    let answer = answer.and_then(|(solved, found)| reported(&solved, found, traits, &stages));
    let is_doubted = is_doubted || answer.as_ref().is_err_and(Error::is_degenerate);
    let answer = match again.filter(|_| is_doubted) {
        Some((pairs, lens, warnings)) => {
            let general = of_general_motion(pairs, lens, warnings, images, &stages, observer)
                .and_then(|(solved, found)| reported(&solved, found, traits, &stages));
            better_account(answer, general)
        }
        None => answer,
    };
    observer.advance(Stage::Camera);
    if answer.as_ref().is_err_and(Error::is_degenerate) {
        left_out.iter().for_each(|([a, b], reason)| observer.pair_left_out([a, b], reason));
    }
    answer
}

/// An answer that is doubted, or none, beside that of views from anywhere before one plane, which assumes less.
fn better_account(
    plane_normal: Result<Calibration, Error>,
    general: Result<Calibration, Error>,
) -> Result<Calibration, Error> {
    let says = |c: &Calibration, what: fn(&Warning) -> bool| c.warnings.iter().any(what);
    let contradicts_prior = |c: &Calibration| says(c, |w| matches!(w, Warning::PriorContradicted(_)));
    let has_fisheye = |c: &Calibration| says(c, |w| matches!(w, Warning::FisheyeLens { .. }));
    match (plane_normal, general) {
        (_, Err(Error::Stopped)) => Err(Error::Stopped),
        // That the motions are not those looked for is one account of what was seen; another beside it is one too many. (Of 9 such answers of the
        // bench 7 were lies, of 74 others one, by a lens that was not modelled.)
        (Ok(answer), Ok(general)) if contradicts_prior(&general) && !contradicts_prior(&answer) => {
            Err(Error::Unsound {
                reason: "the motions are hardly turns about the floor's normal, and as views from anywhere they contradict what was assumed of the camera: \
                         no telling which of these accounts is the right one"
                    .into(),
                remedies: vec![Remedy::NamePairs, Remedy::ClearMotions, Remedy::MoreViews],
            })
        }
        (answer, Ok(general)) if contradicts_prior(&general) => answer,
        // Another lens is another account, too.
        (Ok(answer), Ok(general)) if has_fisheye(&answer) && !has_fisheye(&general) => Ok(answer),
        (_, Ok(general)) => Ok(general),
        (answer, Err(_)) => answer,
    }
}

/// What is reported of a camera, and whether it may be.
fn reported(
    solved: &Solved,
    found: Found,
    (names, images): (&[String], Option<&[GrayImage]>),
    stages: &StageOptions<'_>,
) -> Result<Calibration, Error> {
    let Found { pairs, lens, selection, warnings, .. } = found;
    let calibration = assemble(solved, &selection, &pairs, &lens, Names(names), stages, warnings);
    one_account_at_most(&calibration)?;
    let first = stages.plane_normal.named.unwrap_or(0);
    Ok(if images.is_some() { in_order_of_images(calibration, &pairs, first) } else { calibration })
}

/// The camera of the motions selected first: plane-normal ones, or those of a camera turning on the spot.
fn camera_of(
    found: Found,
    images: Option<&[GrayImage]>,
    stages: &StageOptions<'_>,
    observer: &dyn Observer,
) -> Result<(Solved, Found), Error> {
    let mut found = looked_at_again(found, images, stages, observer)?;
    observer.begin(Stage::Camera, 1);
    let solved = match solve(&found, stages, observer) {
        // Where rotations do not hold in the end, it may have been motions over a floor.
        Err(Error::Unsound { .. }) if is_turning(&found.selection) && stages.options.motion == MotionModel::Auto => {
            found.selection = select_plane_normal(&found.pairs, &stages.plane_normal, observer)?;
            found = looked_at_again(found, images, stages, observer)?;
            solve(&found, stages, observer)?
        }
        answer => answer?,
    };
    match with_motions_of_its_aspect(&found, &solved, images, stages, observer)? {
        Some(again) => Ok(again),
        None => Ok((solved, found)),
    }
}

/// The camera of the motions that are ones for pixels of the shape that was found, where these are more: those selected were selected for square ones.
fn with_motions_of_its_aspect(
    found: &Found,
    solved: &Solved,
    images: Option<&[GrayImage]>,
    stages: &StageOptions<'_>,
    observer: &dyn Observer,
) -> Result<Option<(Solved, Found)>, Error> {
    let contradicted = |w: &Warning| match w {
        Warning::PriorContradicted(conflict) if conflict.parameter == PriorParameter::Aspect => Some(conflict.found),
        _ => None,
    };
    let aspect = solved.warnings.iter().find_map(contradicted);
    let Some(aspect) = aspect.filter(|_| found.selection.kind == MotionKind::PlaneNormal) else { return Ok(None) };
    let options = PlaneNormalOptions { aspect, ..stages.plane_normal };
    let selection = match select_plane_normal(&found.pairs, &options, observer) {
        Err(Error::Stopped) => return Err(Error::Stopped),
        Ok(selection) if selection.used().len() > found.selection.used().len() => selection,
        _ => return Ok(None),
    };
    let again = Found { selection, ..found.clone() };
    let again = looked_at_again(again, images, stages, observer).and_then(|again| {
        let solved = solve(&again, stages, observer)?;
        Ok((solved, again))
    });
    match again {
        Err(Error::Stopped) => Err(Error::Stopped),
        again => Ok(again.ok()),
    }
}

/// Whether general motion is tried before giving up: nobody said what the motion was, or held what only other motions need.
fn tries_general_motion(images: usize, options: &Options) -> bool {
    let nothing_said =
        options.motion == MotionModel::Auto && options.pairs.is_none() && options.attitude_sigma_deg.is_none();
    nothing_said && options.method == Method::Joint && images >= MIN_VIEWS_UNASKED
}

/// The camera of views that moved in any way before one plane, where nobody asked for it: of half of the images or more.
fn of_general_motion(
    pairs: Vec<PairObservation>,
    lens: KnownLens,
    warnings: Vec<Warning>,
    images: Option<&[GrayImage]>,
    stages: &StageOptions<'_>,
    observer: &dyn Observer,
) -> Result<(Solved, Found), Error> {
    let moving: Vec<PairId> = pairs.iter().filter(|pair| pair.moving_plane().is_some()).map(|pair| pair.id).collect();
    let enough = MIN_VIEWS_UNASKED.max(images_of(&moving, &pairs).len().div_ceil(2));
    let too_few = |pairs: &[PairObservation]| Err(why_no_motion(pairs, stages.general.min_matches));
    let selection = select_general(&pairs, &[], &stages.general)?;
    if images_of(&selection.used(), &pairs).len() < enough {
        return too_few(&pairs);
    }
    let found = Found { pairs, lens, selection, amplification: None, warnings };
    if images.is_some() {
        // What its features contradict is not worth patches.
        solve(&found, stages, observer)?;
    }
    let found = looked_at_again(found, images, stages, observer)?;
    observer.begin(Stage::Camera, 1);
    let solved = solve(&found, stages, observer)?;
    if images_of(&solved.used, &found.pairs).len() < enough {
        return too_few(&found.pairs);
    }
    Ok((solved, found))
}

/// Of pairs of the same pictures one is left.
fn copies_counted_once(pairs: &mut [PairObservation], names: &[String], images: Option<&[GrayImage]>) -> Vec<Warning> {
    let key = |image: ImageId| (images.map_or(0, |all| content_key(&all[image.index()])), image);
    let name = |image: ImageId| names[image.index()].clone();
    let of_copy = |[first, copy]: [ImageId; 2]| Warning::DuplicateImages { first: name(first), second: name(copy) };
    count_once(pairs, key, name).into_iter().map(of_copy).collect()
}

fn is_turning(selection: &Selection) -> bool {
    matches!(selection.kind, MotionKind::Turning { .. })
}

/// The motions selected through their own camera's lens, matched again patch by patch.
fn looked_at_again(
    found: Found,
    images: Option<&[GrayImage]>,
    stages: &StageOptions<'_>,
    observer: &dyn Observer,
) -> Result<Found, Error> {
    let mut found = given_lens_through_its_camera(found, stages, observer)?;
    if let (Some(images), Some(patches)) = (images, &stages.patches) {
        let used = found.selection.used();
        let has_links = found.selection.kind == MotionKind::PlaneNormal
            && matches!(stages.options.method, Method::Joint | Method::Transferred);
        let links = if has_links { likely_links(&found.pairs, &used) } else { Vec::new() };
        let lens = found.lens.lens();
        found.pairs = match_by_patches(found.pairs, [&used, &links], images, lens, patches, observer)?;
    }
    seen_again(found, stages, observer)
}

/// What each pair shows, with the deviations that its matches have where they contradict those stated.
fn observe_with_their_noise(
    given: GivenPairs,
    stages: &StageOptions<'_>,
    observer: &dyn Observer,
) -> Result<(Vec<PairObservation>, KnownLens, Option<Warning>), Error> {
    let (pairs, lens) = observe_pairs(given, stages, observer)?;
    // A lens of each pair's own is taken out of its matches for good, and linear homographies ask for no deviations.
    let asks = stages.options.radial == RadialCorrection::None;
    let noise = if asks { contradicted_noise(&pairs, lens.lens(), &stages.observe, observer)? } else { None };
    let Some(noise) = noise else { return Ok((pairs, lens, None)) };
    let (pairs, lens) = observe_pairs(GivenPairs::Matches(noise.corrected(pairs)), stages, observer)?;
    Ok((pairs, lens, Some(noise.warning())))
}

/// What each pair shows, and the lens as far as it is known beforehand or the planes tell it.
fn observe_pairs(
    given: GivenPairs,
    stages: &StageOptions<'_>,
    observer: &dyn Observer,
) -> Result<(Vec<PairObservation>, KnownLens), Error> {
    let options = stages.options;
    let pairs = match given {
        GivenPairs::Planes(pairs) => return Ok((pairs, KnownLens::NotModelled)),
        GivenPairs::Matches(pairs) => pairs,
    };
    if let Some(lens) = &stages.lens {
        let (pairs, finding) = find_lens(pairs, lens, &stages.observe, observer)?;
        return Ok((pairs, finding.into()));
    }
    if options.distortion.is_none() && options.lens.is_fisheye() {
        let centre = options.assumed_principal_point(stages.size);
        let (pairs, placement) = find_fisheye(pairs, stages.size, centre, &stages.observe, observer)?;
        return Ok((pairs, KnownLens::Placed(placement)));
    }
    let lens = if options.distortion.is_none() {
        KnownLens::NotModelled
    } else {
        let measured = PlacedLens { lens: options.distortion, intrinsics: options.camera_of_lens(stages.size) };
        if measured.lens.sees_behind() {
            let (pairs, placement) = find_placement(pairs, measured, &stages.observe, observer)?;
            return Ok((pairs, KnownLens::Placed(placement)));
        }
        KnownLens::Given(measured)
    };
    let pairs = observe(pairs, lens.lens(), &stages.observe, observer)?;
    if options.radial == RadialCorrection::None {
        return Ok((pairs, lens));
    }
    let linear = options.homographies == HomographyFit::Linear;
    let of_pairs = PairLensOptions { correction: options.radial, linear, observe: stages.observe };
    let (pairs, middle) = correct_each(pairs, &of_pairs, observer)?;
    Ok((pairs, middle.map_or(lens, KnownLens::OfPairs)))
}

/// Which pairs are motions, and of what kind: rotations where the method is the rotating camera's; else plane-normal motions, or a
/// camera that turns on the spot about any axes where that explains more of the images.
fn select_motions(
    pairs: &[PairObservation],
    lens: &KnownLens,
    stages: &StageOptions<'_>,
    observer: &dyn Observer,
) -> Result<Selection, Error> {
    if stages.options.method == Method::Rotating {
        return select_rotations(pairs, &stages.rotations);
    }
    if stages.options.motion == MotionModel::Turning {
        return select_turning(pairs, lens, stages, observer);
    }
    if stages.options.motion == MotionModel::General {
        return select_general(pairs, &[], &stages.general);
    }
    let plane_normal = select_plane_normal(pairs, &stages.plane_normal, observer);
    observer.go_on()?;
    let plane_normal_only = stages.options.motion == MotionModel::PlaneNormal;
    let closed_form = matches!(stages.options.method, Method::Linear | Method::Kzr | Method::Transferred);
    if stages.plane_normal.named.is_some() || plane_normal_only || closed_form {
        return plane_normal;
    }
    if let Some(turning) = find_turning(pairs, &stages.rotations)
        && let MotionKind::Turning { focal_px } = turning.kind
        && explains_more(&turning, plane_normal.as_ref().ok(), pairs)
        && rotations_explain(pairs, &turning, focal_px, lens, stages, observer)?
    {
        return Ok(turning);
    }
    plane_normal
}

/// The pairs that a camera turning on the spot explains, which the user says it did.
fn select_turning(
    pairs: &[PairObservation],
    lens: &KnownLens,
    stages: &StageOptions<'_>,
    observer: &dyn Observer,
) -> Result<Selection, Error> {
    if let Some(turning) = find_turning(pairs, &stages.rotations)
        && let MotionKind::Turning { focal_px } = turning.kind
        && rotations_explain(pairs, &turning, focal_px, lens, stages, observer)?
    {
        return Ok(turning);
    }
    Err(Error::NoUsableMotion {
        pairs: pairs.len(),
        reason: "no three images are joined by rotations about the optical centre under one focal length".into(),
        remedies: vec![Remedy::TurnAboutOpticalCentre, Remedy::TurnOverFloor],
    })
}

/// Whether rotations join more images than plane-normal motions, or as many with a third more pairs. A pan about one axis is
/// explained by both, and then it is motions of one attitude, which is more to know.
fn explains_more(turning: &Selection, plane_normal: Option<&Selection>, pairs: &[PairObservation]) -> bool {
    let count = |selection: &Selection| {
        let used = selection.used();
        (images_of(&used, pairs).len(), used.len())
    };
    let (images, rotations) = count(turning);
    let (joined, motions) = plane_normal.map_or((0, 0), count);
    images > joined || (images == joined && 4 * motions < 3 * rotations)
}

/// A given lens put through the camera of the pairs selected, which are selected anew under it. Which scene it is does not hang on
/// that: a joint refinement of directions finds the camera by itself.
fn given_lens_through_its_camera(
    found: Found,
    stages: &StageOptions<'_>,
    observer: &dyn Observer,
) -> Result<Found, Error> {
    let rotating = stages.options.method == Method::Rotating;
    let KnownLens::Given(start) = found.lens else { return Ok(found) };
    if !rotating && found.selection.kind != MotionKind::PlaneNormal {
        return Ok(found);
    }
    let select = |pairs: &[PairObservation]| {
        if rotating {
            select_rotations(pairs, &stages.rotations)
        } else {
            select_plane_normal(pairs, &stages.plane_normal, observer)
        }
    };
    let (pairs, selection, point) = through_own_camera(found.pairs, found.selection, start, select, stages, observer)?;
    let mut warnings = found.warnings;
    // Motions are looked at again after their patches; then the selection must no longer change.
    if rotating && point.last_change > FIXED_POINT_TOLERANCE {
        warnings.push(Warning::DistortionNotConverged { relative_change: point.last_change });
    }
    let (lens, amplification) = (KnownLens::Given(point.lens), Some(point.amplification));
    Ok(Found { pairs, lens, selection, amplification, warnings })
}

/// What the matches of the motions selected, better than before, say of the lens and of the selection.
fn seen_again(found: Found, stages: &StageOptions<'_>, observer: &dyn Observer) -> Result<Found, Error> {
    let Found { mut pairs, mut lens, mut selection, mut amplification, mut warnings } = found;
    if stages.options.method == Method::Rotating {
        selection = select_rotations(&pairs, &stages.rotations)?;
    } else if selection.kind == MotionKind::PlaneNormal {
        if let KnownLens::Given(before) = lens {
            let (refitted, point) = given_lens_of_motions(pairs, &selection, before, stages, observer)?;
            (pairs, lens) = (refitted, KnownLens::Given(point.lens));
            amplification = amplification.map(|before| before.max(point.amplification));
            if point.last_change > FIXED_POINT_TOLERANCE {
                warnings.push(Warning::DistortionNotConverged { relative_change: point.last_change });
            }
        } else if let KnownLens::Placed(before) = lens {
            (pairs, lens) = lens_placed_by_motions(pairs, &selection, before, stages, observer)?;
        } else if let Some(options) = &stages.lens {
            (pairs, selection, lens) = estimated_lens_of_motions(pairs, selection, lens, options, stages, observer)?;
        }
        if stages.options.homographies == HomographyFit::Linear && stages.options.radial == RadialCorrection::None {
            pairs = refit_linearly(pairs, &stages.frame, observer)?;
        }
        selection = selection.confirmed(&pairs);
    } else if let (MotionKind::General, KnownLens::NotModelled, Some(options)) = (selection.kind, &lens, &stages.lens) {
        // Planes of few matches told no lens one by one; all views together may.
        let centre = options.assumed_centre();
        lens = lens_of_motions(&pairs, &selection.used(), centre, None, options, observer)?.into();
        if lens.lens().is_some() {
            pairs = observe_anew(pairs, lens.lens(), &stages.observe, observer)?;
        }
    }
    Ok(Found { pairs, lens, selection, amplification, warnings })
}

/// The camera, by the method asked for and the kind of motion found.
fn solve(found: &Found, stages: &StageOptions<'_>, observer: &dyn Observer) -> Result<Solved, Error> {
    let Found { pairs, lens, selection, .. } = found;
    let solved = match (stages.options.method, selection.kind) {
        (Method::Rotating, _) => solve_rotating(pairs, selection, lens, stages, observer)?,
        (Method::Joint | Method::Linear, MotionKind::PlaneNormal) => {
            solve_plane_normal(pairs, selection, lens, stages, observer)?
        }
        // Its selection knows plane-normal motions alone.
        (Method::Kzr, _) => solve_published(pairs, selection, lens, stages, observer)?,
        (Method::Transferred, _) => solve_transferred(pairs, selection, lens, stages, observer)?,
        (Method::Joint | Method::Linear, MotionKind::General) => solve_general(pairs, lens, stages, observer)?,
        (Method::Joint | Method::Linear, MotionKind::Turning { focal_px }) => {
            solve_turning(pairs, selection, focal_px, lens, stages, observer)?
        }
    };
    // The joint refinement has the lens and the camera together: its error bars hold already.
    let amplification = found.amplification.filter(|_| solved.joint.is_none());
    Ok(Solved { amplification, ..solved })
}
