//! Which pairs of views are plane-normal motions: those that one camera explains (see [`crate::select::consistent_set`]).

use crate::{
    error::Error,
    geometry::{frame::Frame, size::ImageSize},
    ids::PairId,
    numerics::statistics::CHI_SQUARED_2_999,
    observer::Observer,
    pairs::observation::{PairObservation, TurningPlane, why_no_motion},
    remedy::Remedy,
    select::{
        attitude_groups::{HorizonSides, Motion},
        consistent_set::{
            ConsistencyOptions, ConsistentSet, MARGIN_LOG_ODDS, Verdict, find_consistent, height_log_odds,
        },
        selection::{MotionKind, PairVerdict, Rejection, Selection},
    },
};

/// Prior of the principal point in the search for consistent motions, as a fraction of the width: nothing should be lost to
/// an odd lens.
const SEARCH_PRINCIPAL_POINT_SIGMA: f64 = 0.1;
/// Least standard deviation of the attitudes in the search: what is left of lens distortion and of a scene that is not quite a plane
/// moves circular points by more than the noise says, and a motion is not to be lost for it. Pairs of images of different
/// attitudes are off by degrees.
const SEARCH_ATTITUDE_SIGMAS_DEG: [f64; 3] = [0.3, 1.0, 2.5];
/// Standard deviation of the k1 that the search takes to be still there, given or not: a given one has its own error and no lens has
/// k1 alone.
const SEARCH_K1_SIGMA: f64 = 0.05;
/// Standard deviation of a circular point's direction in the search for all other faults of the model (higher distortion, a scene not
/// quite flat or not quite at infinity): a third of a degree.
const SEARCH_DIRECTION_SIGMA: f64 = 0.006;
/// Fraction of points beyond the horizon from which on a scene is no floor.
const MINOR_SIDE: f64 = 0.05;

/// Options of [`select_plane_normal`].
#[derive(Debug, Clone, Copy)]
pub(crate) struct PlaneNormalOptions {
    /// Size of the images.
    pub(crate) size: ImageSize,
    /// Frame of the homographies.
    pub(crate) frame: Frame,
    /// Expected fy / fx.
    pub(crate) aspect: f64,
    /// Standard deviation of each view's attitude about the axes across the plane's normal, degrees; `None`: found.
    pub(crate) attitude_sigma_deg: Option<f64>,
    /// How many pairs, the first, the user names as the motions: none of them is left out, and no other is one.
    pub(crate) named: Option<usize>,
    /// The user vouches that motions are plane-normal; nothing else needs to show it.
    pub(crate) vouched: bool,
    /// The images are in the order in which they were taken.
    pub(crate) sequence: bool,
    /// Fewest matches on a plane, for the error's words.
    pub(crate) min_matches: usize,
}

/// The consistent plane-normal motions among the pairs.
///
/// # Errors
/// Why there are none; [`Error::Stopped`].
pub(crate) fn select_plane_normal(
    pairs: &[PairObservation],
    options: &PlaneNormalOptions,
    observer: &dyn Observer,
) -> Result<Selection, Error> {
    let named = &pairs[..options.named.map_or(pairs.len(), |first| first.min(pairs.len()))];
    let (candidates, motions): (Vec<PairId>, Vec<Motion>) =
        named.iter().filter_map(|pair| Some((pair.id, motion_of(pair, &options.frame)?))).unzip();
    if motions.is_empty() {
        return Err(why_no_motion(named, options.min_matches));
    }
    if let [only] = motions.as_slice()
        && !options.vouched
    {
        check_single(only, pairs[candidates[0]].background())?;
    }
    let verdicts = if options.named.is_some() || motions.len() == 1 {
        vec![Verdict::Accepted; motions.len()]
    } else {
        let found = search(&motions, options, observer)?;
        // Of two that disagree the better one is used where the user vouches for it.
        let vouched = options.vouched && motions.len() == 2;
        if !vouched && found.log_odds < found.needed_log_odds {
            return Err(coincidence(&found));
        }
        found.verdicts
    };
    Ok(Selection::new(MotionKind::PlaneNormal, pairs, |id| {
        if id.index() >= named.len() {
            return PairVerdict::Rejected(Rejection::NotNamed);
        }
        let Ok(place) = candidates.binary_search(&id) else { return PairVerdict::NoMotion };
        match verdicts[place] {
            Verdict::Accepted => PairVerdict::Used { sides: motions[place].sides },
            Verdict::WrongSides => {
                let beyond = minor_side(&pairs[id], &options.frame).unwrap_or(1.0);
                PairVerdict::Rejected(Rejection::WrongSides { beyond, most: MINOR_SIDE })
            }
            Verdict::Disagrees { sigmas } => PairVerdict::Rejected(Rejection::Disagrees { sigmas }),
            Verdict::OtherAttitude { motion, image, sigmas } => {
                PairVerdict::Rejected(Rejection::OtherAttitude { pair: candidates[motion], image, sigmas })
            }
        }
    }))
}

/// A single motion has nothing to be checked by but its height ratio: two views that tilted differ in it (see
/// [`height_log_odds`]).
///
/// # Errors
/// [`Error::NoUsableMotion`], with the matches of a background that stands still named.
fn check_single(motion: &Motion, background: usize) -> Result<(), Error> {
    let (height_ratio, sigma) = (motion.geometry.height_ratio, motion.geometry.height_ratio_sigma);
    let log_odds = height_log_odds(height_ratio, sigma);
    if log_odds >= MARGIN_LOG_ODDS {
        return Ok(());
    }
    let still = match background {
        0 => String::new(),
        matches => format!(" ({matches} matches stand still, a background that was set aside)"),
    };
    Err(Error::NoUsableMotion {
        pairs: 1,
        reason: format!(
            "nothing shows that the camera turned without tilting: the ratio of its heights over the plane is {height_ratio:.4} +- {sigma:.4}, \
             where a camera that keeps its height has 1, and one that tilted has any (log odds {log_odds:.1}, {MARGIN_LOG_ODDS:.1} needed). Such a focal length may be wrong by half{still}"
        ),
        remedies: vec![Remedy::MoreMotions, Remedy::VouchPlaneNormal],
    })
}

/// Fraction of a motion's points on that side of the horizon it implies on which there are fewer.
fn minor_side(pair: &PairObservation, frame: &Frame) -> Option<f64> {
    let TurningPlane { geometry, .. } = pair.outcome.as_ref().ok()?;
    Some(geometry.minor_side(pair.seen_in_first().map(|p| frame.frame_matrix() * p)))
}

fn motion_of(pair: &PairObservation, frame: &Frame) -> Option<Motion> {
    let TurningPlane { geometry, .. } = pair.outcome.as_ref().ok()?;
    let sides = if minor_side(pair, frame)? > MINOR_SIDE { HorizonSides::Both } else { HorizonSides::One };
    Some(Motion { from: pair.from, to: pair.to, geometry: geometry.clone(), sides })
}

/// The best set, with the smallest attitude errors that explain it: a carrier that pitches or an arm that is not quite aligned may
/// have larger ones than is usual.
fn search(motions: &[Motion], options: &PlaneNormalOptions, observer: &dyn Observer) -> Result<ConsistentSet, Error> {
    let with = |sigma_deg: f64| {
        let consistency = ConsistencyOptions {
            attitude_sigma_rad: options.attitude_sigma_deg.unwrap_or(0.0).max(sigma_deg).to_radians(),
            k1_sigma: SEARCH_K1_SIGMA,
            direction_sigma: SEARCH_DIRECTION_SIGMA,
            principal_point_sigma: SEARCH_PRINCIPAL_POINT_SIGMA * options.size.width as f64 / options.frame.scale_px,
            aspect: options.aspect,
            gate: CHI_SQUARED_2_999,
            sequence: options.sequence,
        };
        find_consistent(motions, &consistency, observer)
    };
    let mut best = with(SEARCH_ATTITUDE_SIGMAS_DEG[0])?;
    for sigma_deg in &SEARCH_ATTITUDE_SIGMAS_DEG[1..] {
        if best.log_odds >= best.needed_log_odds || options.attitude_sigma_deg.is_some() {
            break;
        }
        let wider = with(*sigma_deg)?;
        if wider.log_odds > best.log_odds {
            best = wider;
        }
    }
    Ok(best)
}

fn coincidence(found: &ConsistentSet) -> Error {
    let agreeing = found.verdicts.iter().filter(|v| **v == Verdict::Accepted).count();
    let candidates = found.verdicts.len();
    Error::NoUsableMotion {
        pairs: candidates,
        reason: format!(
            "of the {candidates} pairs that show a turning plane the best set that agrees on one camera has {agreeing}, no more than \
             coincidence gives (log odds {:.1}, {:.1} needed): these are not turns about the floor's normal, or the lens \
             distortion is large",
            found.log_odds, found.needed_log_odds
        ),
        remedies: vec![Remedy::DoNotTilt, Remedy::NamePairs, Remedy::GiveLensCoefficients, Remedy::GiveAttitudeSigma],
    }
}
