//! What is known of the lens, and finding it from the planes of pairs: first from the best supported planes of any pairs, later
//! from the pairs that turned out to be motions.

use nalgebra::Vector2;

use crate::{
    error::Error,
    geometry::{
        frame::Frame,
        intrinsics::Intrinsics,
        lens::{Fisheye, Lens},
        size::ImageSize,
    },
    ids::PairId,
    numerics::statistics::CHI_SQUARED_2_999,
    observer::Observer,
    pairs::{
        correspondence::{ImagePair, PointMatch},
        lens_placement::{LensPlacement, place_lens},
        observation::PairObservation,
        observe::{ObserveOptions, observe, observe_anew},
        placed_lens::PlacedLens,
        plane_lens::{LensEstimate, LensPrior, coefficients, estimate_lens_until},
    },
};

/// Priors of k1 and k2, lenses from wide to long.
pub(crate) const K1_SIGMA: f64 = 0.3;
pub(crate) const K2_SIGMA: f64 = 0.3;
/// Prior of k3, where the residuals ask for it.
pub(crate) const K3_SIGMA: f64 = 0.3;
/// Prior of p1 and p2: decentring of ordinary lenses is some 1e-4 to 1e-3.
pub(crate) const P_SIGMA: f64 = 1e-3;
/// Centre of distortion: standard deviation about the assumed principal point, as a fraction of the width, before it is known better.
const CENTRE_SIGMA: f64 = 0.05;
/// Pairs and matches of a pair that tell of the lens before the motions are known.
const MAX_PAIRS: usize = 24;
const MIN_INLIERS: usize = 40;
/// Standard deviation of a k2 that is held at zero, but for rounding.
const HELD_K2_SIGMA: f64 = 1e-6;
/// Times that homographies and lens are found in turn before motions are chosen.
const ROUNDS: usize = 2;

/// Options of [`find_lens`] and [`lens_of_motions`].
#[derive(Debug, Clone, Copy)]
pub(crate) struct LensOptions {
    /// Size of the images.
    pub(crate) size: ImageSize,
    /// Frame of the homographies.
    pub(crate) frame: Frame,
    /// Camera through which the coefficients act.
    pub(crate) nominal_camera: Intrinsics,
    /// Whether k2 is estimated beside k1.
    pub(crate) with_k2: bool,
}

/// What is known of the lens.
#[derive(Debug, Clone)]
pub(crate) enum KnownLens {
    /// Taken to have no distortion.
    NotModelled,
    /// Coefficients given, and the camera they act through.
    Given(PlacedLens),
    /// Coefficients given of a lens that sees behind the camera, and the camera matrix that the planes tell.
    Placed(LensPlacement),
    /// Estimated, or found to be none.
    Estimated(LensFromPlanes),
    /// Each pair had its own ([`crate::pairs::pair_lens`]); this is the one in their middle.
    OfPairs(PlacedLens),
}

impl KnownLens {
    /// The lens that was undone in the homographies.
    pub(crate) fn lens(&self) -> Option<&PlacedLens> {
        match self {
            KnownLens::NotModelled => None,
            KnownLens::Given(lens) | KnownLens::OfPairs(lens) => Some(lens),
            KnownLens::Placed(placement) => Some(&placement.lens),
            KnownLens::Estimated(finding) => finding.lens(),
        }
    }

    /// Whether it is among what is estimated.
    pub(crate) fn is_estimated(&self) -> bool {
        match self {
            KnownLens::Estimated(_) => true,
            KnownLens::Placed(placement) => placement.of_model_alone,
            KnownLens::NotModelled | KnownLens::Given(_) | KnownLens::OfPairs(_) => false,
        }
    }
}

impl From<Option<LensFromPlanes>> for KnownLens {
    fn from(finding: Option<LensFromPlanes>) -> Self {
        finding.map_or(KnownLens::NotModelled, KnownLens::Estimated)
    }
}

/// The lens as far as planes tell it.
#[derive(Debug, Clone)]
pub(crate) struct LensFromPlanes {
    pub(crate) estimate: LensEstimate,
    /// Whether the coefficients differ from zero.
    pub(crate) significant: bool,
}

impl LensFromPlanes {
    fn new(estimate: LensEstimate) -> Self {
        let [k1, k2, ..] = coefficients(&estimate.lens);
        let k = Vector2::new(k1, k2);
        let block = estimate.covariance.fixed_view::<2, 2>(0, 0).into_owned();
        let distance = block.try_inverse().map_or(0.0, |i| (k.transpose() * i * k)[(0, 0)]);
        Self { estimate, significant: distance > CHI_SQUARED_2_999 }
    }

    /// The lens to be undone: none where its coefficients are not told from zero.
    pub(crate) fn lens(&self) -> Option<&PlacedLens> {
        self.significant.then_some(&self.estimate.lens)
    }

    /// The lens about which the covariance holds.
    pub(crate) fn reference(&self) -> PlacedLens {
        let mut lens = self.estimate.lens;
        if !self.significant {
            lens.lens = Lens::None;
        }
        lens
    }

    /// Standard deviations of k1 and k2 for the camera's focal length (the estimate has a nominal one).
    pub(crate) fn sigmas(&self, k: &Intrinsics) -> [f64; 2] {
        let ratio = k.fx / self.estimate.lens.intrinsics.fx;
        let sigma = |i: usize| self.estimate.covariance[(i, i)].sqrt();
        [sigma(0) * ratio.powi(2), sigma(1) * ratio.powi(4)]
    }
}

/// Where the centre of distortion is thought to be.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct DistortionCentre {
    pub(crate) px: [f64; 2],
    /// Its standard deviation as a fraction of the width.
    pub(crate) sigma: f64,
}

impl LensOptions {
    /// Where nothing is known of the camera yet.
    pub(crate) fn assumed_centre(&self) -> DistortionCentre {
        let k = &self.nominal_camera;
        DistortionCentre { px: [k.cx, k.cy], sigma: CENTRE_SIGMA }
    }
}

/// What every pair shows, and the lens undone in it, from the planes' own residuals. `None`: no plane tells of it.
///
/// # Errors
/// [`Error::Stopped`] and no other.
pub(crate) fn find_lens(
    pairs: Vec<ImagePair>,
    options: &LensOptions,
    observe_options: &ObserveOptions,
    observer: &dyn Observer,
) -> Result<(Vec<PairObservation>, Option<LensFromPlanes>), Error> {
    let mut pairs = observe(pairs, None, observe_options, observer)?;
    let mut finding: Option<LensFromPlanes> = None;
    for _ in 0..ROUNDS {
        let Some(next) = lens_of_planes(&pairs, finding.as_ref(), options, observer)? else { break };
        let significant = next.significant;
        if significant {
            pairs = observe_anew(pairs, next.lens(), observe_options, observer)?;
        }
        finding = Some(next);
        if !significant {
            break;
        }
    }
    Ok((pairs, finding))
}

/// What every pair shows through a known lens that sees behind the camera, and through which camera matrix, from the planes' own
/// residuals. `measured`: the lens as it was measured, where it stays if no plane tells of it.
///
/// # Errors
/// [`Error::Stopped`] and no other.
pub(crate) fn find_placement(
    pairs: Vec<ImagePair>,
    measured: PlacedLens,
    observe_options: &ObserveOptions,
    observer: &dyn Observer,
) -> Result<(Vec<PairObservation>, LensPlacement), Error> {
    let mut pairs = observe(pairs, Some(&measured), observe_options, observer)?;
    let mut placement = LensPlacement { lens: measured, covariance: None, of_model_alone: false };
    for _ in 0..ROUNDS {
        let best = best_supported(&pairs);
        let Some(next) = placement_of(&pairs, &best, &placement, &measured, &observe_options.frame, observer)? else {
            break;
        };
        pairs = observe_anew(pairs, Some(&next.lens), observe_options, observer)?;
        placement = next;
    }
    Ok((pairs, placement))
}

/// Angles from the axis to the image's corner, degrees, at which a fisheye is looked for.
const CORNER_ANGLES_DEG: [f64; 6] = [45.0, 60.0, 75.0, 90.0, 105.0, 125.0];
/// Pairs that are asked which of them it is, those of most matches.
const MAX_VOTING_PAIRS: usize = 8;

/// What every pair shows through an equidistant lens (r = f θ) of a focal length that the planes tell: that through which most matches are
/// on planes. Its coefficients are left to the refinement.
///
/// # Errors
/// [`Error::Stopped`] and no other.
pub(crate) fn find_fisheye(
    pairs: Vec<ImagePair>,
    size: ImageSize,
    centre_px: [f64; 2],
    observe_options: &ObserveOptions,
    observer: &dyn Observer,
) -> Result<(Vec<PairObservation>, LensPlacement), Error> {
    let half_diagonal = 0.5 * (size.width as f64).hypot(size.height as f64);
    let mut order: Vec<usize> = (0..pairs.len()).collect();
    order.sort_by_key(|&i| (std::cmp::Reverse(pairs[i].matches.len()), i));
    let asked: Vec<ImagePair> = order.iter().take(MAX_VOTING_PAIRS).map(|&i| pairs[i].clone()).collect();
    let mut best: Option<(usize, PlacedLens)> = None;
    for angle in CORNER_ANGLES_DEG {
        let [cx, cy] = centre_px;
        let f = half_diagonal / angle.to_radians();
        let start =
            PlacedLens { lens: Lens::Fisheye(Fisheye::new([0.0; 4])), intrinsics: Intrinsics::square(f, cx, cy) };
        let (seen, placement) = find_placement(asked.clone(), start, observe_options, observer)?;
        let on_planes: usize = seen.iter().filter_map(PairObservation::moving_plane).map(|p| p.inliers.len()).sum();
        if best.as_ref().is_none_or(|(most, _)| on_planes > *most) {
            best = Some((on_planes, placement.lens));
        }
    }
    let start = best.map_or_else(
        || PlacedLens { lens: Lens::Fisheye(Fisheye::new([0.0; 4])), intrinsics: observe_options.nominal_camera },
        |(_, lens)| lens,
    );
    let (pairs, placement) = find_placement(pairs, start, observe_options, observer)?;
    Ok((pairs, LensPlacement { of_model_alone: true, ..placement }))
}

/// The camera matrix of a known lens from the pairs `used`, if they tell it.
///
/// # Errors
/// [`Error::Stopped`] and no other.
pub(crate) fn placement_of(
    pairs: &[PairObservation],
    used: &[PairId],
    before: &LensPlacement,
    measured: &PlacedLens,
    frame: &Frame,
    observer: &dyn Observer,
) -> Result<Option<LensPlacement>, Error> {
    let planes = matches_on_planes(pairs, &some_of(used, pairs));
    let slices: Vec<&[PointMatch]> = planes.iter().map(Vec::as_slice).collect();
    let found = (!slices.is_empty()).then(|| place_lens(&slices, frame, &before.lens, measured, observer)).flatten();
    observer.go_on()?;
    Ok(found)
}

/// From the best supported planes of any pairs.
fn lens_of_planes(
    pairs: &[PairObservation],
    before: Option<&LensFromPlanes>,
    options: &LensOptions,
    observer: &dyn Observer,
) -> Result<Option<LensFromPlanes>, Error> {
    lens_of(pairs, &best_supported(pairs), options.assumed_centre(), before, options, observer)
}

/// The pairs with the best supported planes.
fn best_supported(pairs: &[PairObservation]) -> Vec<PairId> {
    let supported = |pair: &'_ PairObservation| {
        let inliers = pair.moving_plane().map_or(0, |plane| plane.inliers.len());
        (inliers >= MIN_INLIERS).then_some((pair.id, inliers))
    };
    let mut best: Vec<(PairId, usize)> = pairs.iter().filter_map(supported).collect();
    best.sort_by_key(|(id, inliers)| (std::cmp::Reverse(*inliers), *id));
    best.truncate(MAX_PAIRS);
    best.into_iter().map(|(id, _)| id).collect()
}

/// From the pairs `used`, about a centre of distortion.
///
/// # Errors
/// [`Error::Stopped`] and no other.
pub(crate) fn lens_of_motions(
    pairs: &[PairObservation],
    used: &[PairId],
    centre: DistortionCentre,
    before: Option<&LensFromPlanes>,
    options: &LensOptions,
    observer: &dyn Observer,
) -> Result<Option<LensFromPlanes>, Error> {
    lens_of(pairs, &some_of(used, pairs), centre, before, options, observer)
}

/// Some of many pairs that show a turn: all pairs of many views repeat each other.
fn some_of(used: &[PairId], pairs: &[PairObservation]) -> Vec<PairId> {
    let stride = used.len().div_ceil(MAX_PAIRS);
    used.iter().step_by(stride.max(1)).filter(|&&id| pairs[id].outcome.is_ok()).copied().collect()
}

/// The matches on the planes of some pairs.
fn matches_on_planes(pairs: &[PairObservation], some: &[PairId]) -> Vec<Vec<PointMatch>> {
    let on_plane = |id: &PairId| -> Option<Vec<PointMatch>> {
        let pair = &pairs[*id];
        Some(pair.plane()?.inliers.iter().map(|&k| pair.matches[k]).collect())
    };
    some.iter().filter_map(on_plane).collect()
}

fn lens_of(
    pairs: &[PairObservation],
    some: &[PairId],
    centre: DistortionCentre,
    before: Option<&LensFromPlanes>,
    options: &LensOptions,
    observer: &dyn Observer,
) -> Result<Option<LensFromPlanes>, Error> {
    let matches = matches_on_planes(pairs, some);
    let slices: Vec<&[PointMatch]> = matches.iter().map(Vec::as_slice).collect();
    if slices.is_empty() {
        return Ok(None);
    }
    let [cx, cy] = centre.px;
    let start = PlacedLens {
        lens: before.map_or(Lens::None, |b| b.estimate.lens.lens),
        intrinsics: Intrinsics { cx, cy, ..options.nominal_camera },
    };
    let prior = LensPrior {
        k1_sigma: K1_SIGMA,
        k2_sigma: if options.with_k2 { K2_SIGMA } else { HELD_K2_SIGMA },
        centre_sigma: centre.sigma * options.size.width as f64 / start.intrinsics.fx,
    };
    let found = estimate_lens_until(&slices, &options.frame, &start, &prior, observer);
    observer.go_on()?;
    Ok(found.map(LensFromPlanes::new))
}
