//! What the joint refinement of the pairs selected is made from, and what comes of it once.

use nalgebra::Matrix3;

use crate::{
    calibrate::{
        attitude::Attitude,
        joint::JointSolution,
        setup::{Setup, ViewGroups, starting_camera},
        views::Views,
    },
    error::Error,
    geometry::{attitude::attitude_rotation, frame::Frame, intrinsics::Intrinsics, lens::Lens},
    ids::PairId,
    observer::Observer,
    pairs::{known_lens::KnownLens, observation::PairObservation},
    refine::{
        BundleOptions, DepartureKind, SceneModel, State, Track,
        adjust::adjust_until,
        bundle::FIRST_CAMERA,
        prospect::{Prospect, prospect},
        start::{shown_by, state_from_links},
    },
    remedy::Remedy,
    result::{PriorConflict, Warning},
    select::{
        attitude_groups::{AttitudeGroup, Motion},
        selection::Selection,
    },
    start::linear_camera::{CameraOptions, CameraSolution},
};

/// Options of the joint refinement in images and pairs.
#[derive(Debug, Clone)]
pub(super) struct RefinementOptions {
    /// Frame of the estimation.
    pub(super) frame: Frame,
    /// An estimated lens has no k2.
    pub(super) k2_is_held: bool,
    /// Somebody said that the lens is no fisheye.
    pub(super) radtan_only: bool,
    /// What is free, priors, variance components.
    pub(super) bundle: BundleOptions,
    /// The same for the closed form, of which other starts are asked.
    pub(super) camera: CameraOptions,
}

/// Variance of the residuals under rotations, in units of the matching noise, that no real lens and distant scene come near.
const MAX_ROTATION_VARIANCE: f64 = 100.0;

/// A turn of the camera while each picture is read out, the same for all of them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct RowTurn {
    /// From the middle row to the last, about the plane's normal, radians.
    pub(super) turn_rad: f64,
    /// Twice the logarithm of the odds for it.
    pub(super) twice_log_odds: f64,
}

/// A refinement with what it was made from.
pub(super) struct Refined {
    pub(super) joint: JointSolution,
    /// The closed-form solution it started from, whose groups its attitudes count in.
    pub(super) solution: CameraSolution,
    /// Options in force: those asked for, with some priors released.
    pub(super) options: RefinementOptions,
    /// Priors that were released, and why.
    pub(super) conflicts: Vec<PriorConflict>,
    /// Departures of the pictures that are estimated, with twice the logarithm of the odds for each.
    pub(super) departures: Vec<(DepartureKind, f64)>,
    /// Twice the logarithm of the odds for a fisheye's lens, where that was found.
    pub(super) fisheye: Option<f64>,
    /// A turn while each picture is read out that is the same for all, where that was found.
    pub(super) row_turn: Option<RowTurn>,
    /// What the alternatives promise that were looked at and not taken, with what was assumed instead.
    pub(super) open: Vec<(&'static str, Prospect)>,
    /// That of them for which the error bars are wider.
    pub(super) open_assumption: Option<Warning>,
}

/// Standard deviation of attitudes, radians, from which on it is asked what else may have caused their errors: a camera that stands still has attitude errors of a
/// hundredth of a degree.
const SUSPECT_ATTITUDE_SIGMA: f64 = 5e-4;
/// Design effect up to which residuals of neighbours have no more in common than patches of pictures seen in many views usually do.
const MAX_LINEAR_DESIGN_EFFECT: f64 = 5.0;

impl Refined {
    /// A start whose pictures turned while they were read out as these did.
    pub(super) fn as_read_out(&self, state: State) -> State {
        match self.row_turn {
            Some(RowTurn { turn_rad, .. }) => state.read_out_turning(turn_rad),
            None => state,
        }
    }

    /// Whether the lens is a fisheye's, found or asked for.
    pub(super) fn has_fisheye_lens(&self) -> bool {
        matches!(self.joint.bundle.state.cameras[FIRST_CAMERA].lens, Lens::Fisheye(_))
    }

    /// Whether an assumption of the camera or of its pictures was given up for it.
    pub(super) fn is_repaired(&self) -> bool {
        !self.conflicts.is_empty() || self.has_departures()
    }

    /// Whether its pictures depart from each other, or from those of a camera that stands still.
    pub(super) fn has_departures(&self) -> bool {
        !self.departures.is_empty() || self.row_turn.is_some()
    }

    /// Whether the attitude errors are larger than those of a camera that stands still.
    pub(super) fn has_attitude_errors(&self) -> bool {
        self.joint.bundle.attitude_sigma.sigma > SUSPECT_ATTITUDE_SIGMA
    }

    /// Whether the refinement is linear enough for the evidence of alternatives to be foretold: it converged, attitude errors are small, and the residuals
    /// have little in common. (Of 643 alternatives tried there 560 promised nothing, and none of them was better by odds of 1000; elsewhere 29 of 2,000.)
    pub(super) fn is_nearly_linear(&self) -> bool {
        let effects = &self.joint.bundle.design_effects;
        self.joint.has_converged()
            && !self.has_attitude_errors()
            && effects.iter().all(|e| *e <= MAX_LINEAR_DESIGN_EFFECT)
    }

    /// What an alternative promises, to first order; `None` where that is not defined.
    pub(super) fn prospect(&self, options: &RefinementOptions) -> Option<Prospect> {
        prospect(&self.joint.bundle, &self.joint.tracks, &options.bundle).filter(|prospect| prospect.gain.is_finite())
    }

    /// By how much twice the logarithm of the evidence is larger than that of another refinement of the same tracks, where that is more than
    /// `needed`. `None`, too, where this one is no minimum; one that is needs no odds against one that is not.
    pub(super) fn gain_over(&self, other: &Self, needed: f64) -> Option<f64> {
        let (mine, others) = (self.joint.bundle.evidence?, other.joint.bundle.evidence?);
        let gain = mine.gain_over(&others);
        let better = gain > needed || !other.joint.has_converged();
        (self.joint.has_converged() && better).then_some(gain)
    }
}

/// What is refined: the matches of the motions selected.
pub(super) struct RefinementInput<'a> {
    pub(super) pairs: &'a [PairObservation],
    pub(super) motions: Vec<Motion>,
    pub(super) observer: &'a dyn Observer,
    pub(super) lens: &'a KnownLens,
    frame: Frame,
    k2_is_held: bool,
    pub(super) used: Vec<PairId>,
    pub(super) views: Views,
    pub(super) group_of_view: Vec<usize>,
    pub(super) setup: Setup,
    pub(super) scene: SceneModel,
}

impl<'a> RefinementInput<'a> {
    pub(super) fn new(
        pairs: &'a [PairObservation],
        selection: &Selection,
        solution: &CameraSolution,
        lens: &'a KnownLens,
        options: &RefinementOptions,
        observer: &'a dyn Observer,
    ) -> Option<Self> {
        let used = selection.used();
        let views = Views::of_pairs(&used, pairs);
        let group_of_view = ViewGroups::of_motions(&used, pairs, &views, solution)?.indices();
        let setup = Setup::of_pairs(&used, pairs, &views, lens.lens(), &options.frame)?;
        let scene = if selection.is_far_away() { SceneModel::Directions } else { SceneModel::Floor };
        let motions = selection.motions(pairs);
        let (frame, k2_is_held) = (options.frame, options.k2_is_held);
        Some(Self { pairs, motions, observer, lens, frame, k2_is_held, used, views, group_of_view, setup, scene })
    }

    /// Views that moved in any way before a plane: each has an attitude of its own.
    pub(super) fn of_views(
        pairs: &'a [PairObservation],
        selection: &Selection,
        lens: &'a KnownLens,
        options: &RefinementOptions,
        observer: &'a dyn Observer,
    ) -> Option<Self> {
        let used = selection.used();
        let views = Views::of_pairs(&used, pairs);
        let setup = Setup::of_pairs(&used, pairs, &views, lens.lens(), &options.frame)?;
        let (group_of_view, motions, scene) = ((0..views.len()).collect(), Vec::new(), SceneModel::Floor);
        let (frame, k2_is_held) = (options.frame, options.k2_is_held);
        Some(Self { pairs, motions, observer, lens, frame, k2_is_held, used, views, group_of_view, setup, scene })
    }

    /// The attitude of a solution that each group of views has; none without plane-normal motions, of which solutions are made.
    fn attitudes_of(&self, solution: &CameraSolution) -> Option<Vec<usize>> {
        if self.motions.is_empty() {
            return Some(Vec::new());
        }
        Some(ViewGroups::of_motions(&self.used, self.pairs, &self.views, solution)?.attitudes)
    }

    /// A state to refine from: a solution with its focal length times a factor.
    pub(super) fn start(&self, solution: &CameraSolution, factor: f64) -> Option<State> {
        let k = &solution.intrinsics;
        let k = Intrinsics { fx: k.fx * factor, fy: k.fy * factor, ..*k };
        let of_solution = attitudes_under(&k, self.pairs, &self.used, solution, &self.frame);
        let attitudes: Vec<Matrix3<f64>> = self.attitudes_of(solution)?.into_iter().map(|a| of_solution[a]).collect();
        let camera = starting_camera(&k, self.lens, self.k2_is_held, &self.frame);
        state_from_links(self.scene, camera, &k, &attitudes, &self.group_of_view, &self.setup.links)
    }

    pub(super) fn refined(
        &self,
        mut joint: JointSolution,
        solution: CameraSolution,
        options: RefinementOptions,
    ) -> Refined {
        joint.attitudes = self.attitudes_of(&solution).unwrap_or_default();
        Refined {
            joint,
            solution,
            options,
            conflicts: Vec::new(),
            departures: Vec::new(),
            fisheye: None,
            row_turn: None,
            open: Vec::new(),
            open_assumption: None,
        }
    }

    /// The same as an alternative that is tried: `None` where it comes to nothing.
    ///
    /// # Errors
    /// [`Error::Stopped`] and no other.
    pub(super) fn tried(
        &self,
        refined: &Refined,
        solution: CameraSolution,
        options: RefinementOptions,
        starts: Vec<State>,
    ) -> Result<Option<Refined>, Error> {
        match self.refined_again(refined, solution, options, starts) {
            Ok(tried) => Ok(Some(tried)),
            Err(Error::Stopped) => Err(Error::Stopped),
            Err(_) => Ok(None),
        }
    }

    /// An alternative with other options, tried roughly from where the refinement came to, where its evidence is better by more than
    /// `needed`; with it twice the logarithm of the odds.
    ///
    /// # Errors
    /// [`Error::Stopped`] and no other.
    pub(super) fn better_with(
        &self,
        refined: &Refined,
        mut options: RefinementOptions,
        needed: f64,
    ) -> Result<Option<(f64, Refined)>, Error> {
        options.bundle = options.bundle.for_trial();
        let starts = vec![refined.joint.bundle.state.clone()];
        let tried = self.tried(refined, refined.solution.clone(), options, starts)?;
        Ok(tried.and_then(|with| Some((with.gain_over(refined, needed)?, with))))
    }

    /// Refined again on the very same tracks, under other options, from other starts.
    pub(super) fn refined_again(
        &self,
        refined: &Refined,
        solution: CameraSolution,
        options: RefinementOptions,
        starts: Vec<State>,
    ) -> Result<Refined, Error> {
        let before = &refined.joint;
        let setup = Setup { links: Vec::new(), tracks: before.tracks.clone() };
        let starts = starts.into_iter().map(|state| refined.as_read_out(state)).collect();
        let joint = adjusted(before.bundle.scene, setup, before.views.clone(), starts, &options, self.observer)?;
        let mut again = self.refined(joint, solution, options);
        (again.joint.cross_links, again.joint.floors) = (before.cross_links.clone(), before.floors);
        again.conflicts.clone_from(&refined.conflicts);
        again.departures.clone_from(&refined.departures);
        (again.fisheye, again.row_turn) = (refined.fisheye, refined.row_turn);
        Ok(again)
    }
}

/// Attitudes of the groups of a solution as their circular points say under a camera matrix.
fn attitudes_under(
    k: &Intrinsics,
    pairs: &[PairObservation],
    used: &[PairId],
    solution: &CameraSolution,
    frame: &Frame,
) -> Vec<Matrix3<f64>> {
    let of = |group: &AttitudeGroup| {
        let attitude = Attitude::of_group(group, k, frame, pairs, used);
        attitude_rotation(attitude.pitch_down_rad, attitude.roll_rad)
    };
    solution.groups.iter().map(of).collect()
}

/// Most tracks, as a fraction, that a start may be unable to show: wrong matches are fewer, of a wrong start about half go.
const MAX_UNSHOWN: f64 = 0.3;

/// The tracks that the starts show; starts that cannot show most are left out, unless none can.
pub(super) fn shown_by_all(
    scene: SceneModel,
    tracks: Vec<Track>,
    starts: &mut Vec<State>,
    options: &BundleOptions,
) -> Vec<Track> {
    let shown: Vec<Vec<bool>> = starts.iter().map(|state| shown_by(state, scene, &tracks, &options.cameras)).collect();
    let usable = |shown: &Vec<bool>| {
        let missing = shown.iter().filter(|s| !**s).count();
        missing as f64 <= MAX_UNSHOWN * tracks.len() as f64
    };
    if !shown.iter().any(usable) {
        return tracks;
    }
    let mut usable_starts = shown.iter().map(usable);
    starts.retain(|_| usable_starts.next() == Some(true));
    let kept: Vec<&Vec<bool>> = shown.iter().filter(|s| usable(s)).collect();
    let of_all: Vec<bool> = (0..tracks.len()).map(|t| kept.iter().all(|s| s[t])).collect();
    let mut of_all = of_all.into_iter();
    tracks.into_iter().filter(|_| of_all.next() == Some(true)).collect()
}

/// Refines from starts.
pub(super) fn adjusted(
    scene: SceneModel,
    mut setup: Setup,
    views: Views,
    mut starts: Vec<State>,
    options: &RefinementOptions,
    observer: &dyn Observer,
) -> Result<JointSolution, Error> {
    if starts.is_empty() {
        return Err(Error::Numerical {
            stage: "joint refinement",
            detail: "the homographies of the motions fit no camera".into(),
        });
    }
    setup.tracks = shown_by_all(scene, setup.tracks, &mut starts, &options.bundle);
    let bundle = adjust_until(scene, &setup.tracks, starts, &options.bundle, observer)?;
    let [patches, points] = bundle.variance_factors;
    if scene == SceneModel::Directions && patches.max(points) > MAX_ROTATION_VARIANCE {
        return Err(Error::NoUsableMotion {
            pairs: setup.links.len(),
            reason: format!(
                "the points lie above and below the horizon, as those far from a camera that turns on the spot do, but rotations \
                 leave residuals {:.0} times as large as the matching noise: the camera moved, before a scene that is no floor",
                patches.max(points).sqrt()
            ),
            remedies: vec![Remedy::TurnAboutOpticalCentre, Remedy::TurnOverFloor, Remedy::NamePairs],
        });
    }
    Ok(JointSolution::new(bundle, setup.tracks, views, &options.frame))
}

/// Most times that points beyond the horizon are taken out: without them the horizon moves, and a few more may lie beyond it.
const HORIZON_ROUNDS: usize = 3;

/// The same without the points that come to lie beyond the plane's horizon. No point of the plane is seen there, but far things are, and near
/// the horizon those of a camera that turns almost on the spot move as the plane's points do, within the noise. (Of a wide lens in the open, a tenth of
/// the points: fy 0.4 % and 24 deviations off with them, 1.2 without.) Where a third lies beyond, it is no horizon.
pub(super) fn adjusted_below_horizon(
    scene: SceneModel,
    setup: Setup,
    views: Views,
    starts: Vec<State>,
    options: &RefinementOptions,
    observer: &dyn Observer,
) -> Result<JointSolution, Error> {
    let mut joint = adjusted(scene, setup, views, starts, options, observer)?;
    if scene != SceneModel::Floor {
        return Ok(joint);
    }
    for _ in 0..HORIZON_ROUNDS {
        let state = &joint.bundle.state;
        let below: Vec<bool> = state.points.iter().map(|point| point.z >= 0.0).collect();
        let beyond = below.iter().filter(|below| !**below).count();
        if beyond == 0 || beyond as f64 > MAX_UNSHOWN * below.len() as f64 {
            break;
        }
        let tracks =
            joint.tracks.iter().zip(below).filter(|(_, below)| *below).map(|(track, _)| track.clone()).collect();
        let setup = Setup { links: Vec::new(), tracks };
        joint = adjusted(scene, setup, joint.views.clone(), vec![state.clone()], options, observer)?;
    }
    Ok(joint)
}
