//! From matches to what each pair of images says: homography, circular point, or the reason why not.

use nalgebra::{Vector2, Vector4};
use rayon::prelude::*;

use crate::calibrate::{Pipeline, Stage, evidence::Superseded};
use crate::{
    error::Error,
    geometry::{distortion::Distortion, intrinsics::Intrinsics},
    numerics::linalg::complex_pair_eigen,
    pairs::{
        circular_points::{CircularPoint, MotionGeometry, NoCircularPoint, from_homography},
        correspondence::{ImagePair, PointMatch},
        plane_lens::Lens,
        refine::{HomographyEstimate, RefineOptions, refine, spread_ratio},
        robust::{RobustHomography, RobustOptions, estimate_robust},
    },
    remedy::Remedy,
};

/// Why a pair has no homography or no circular point, in the words of the report.
pub(super) struct Refusal {
    pub(super) reason: String,
    pub(super) rotation_deg: Option<f64>,
    pub(super) homography: Option<Box<RobustHomography>>,
    /// The error itself, to be shown where there is one pair only.
    pub(super) error: Option<Box<Error>>,
    pub(super) kind: RefusalKind,
}

#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum RefusalKind {
    NoPlane,
    Static,
    NoRotation,
    Uncertain,
}

impl PairResult {
    /// Matches of a background that does not move, set aside.
    pub(super) fn background(&self) -> usize {
        self.outcome.as_ref().map_or(0, |(robust, _)| robust.static_background)
    }
}

/// Largest noise of a patch match in units of its predicted deviation.
const MAX_PATCH_NOISE: f64 = 6.0;

/// Fraction of the largest noise thought possible from which on more is allowed for given matches, and where that ends.
const NEAR_LIMIT: f64 = 0.6;
const COARSEST_PX: f64 = 16.0;

/// Where no model takes any point to.
const OUT_OF_REACH_PX: f64 = 1e7;

/// Width over length below which points count as lying on a line.
const ON_A_LINE: f64 = 0.01;

pub(super) struct PairResult {
    pub(super) candidates: usize,
    pub(super) outcome: Result<(RobustHomography, MotionGeometry), Refusal>,
    /// What patches took the place of, if they did.
    pub(super) superseded: Option<Box<Superseded>>,
}

pub(super) fn geometry_of(robust: RobustHomography) -> Result<(RobustHomography, MotionGeometry), Refusal> {
    match from_homography(&robust.estimate) {
        Ok(geometry) => Ok((robust, geometry)),
        Err(NoCircularPoint::NoRotation { rotation_rad, significance }) => {
            let deg = rotation_rad.to_degrees();
            let near = if rotation_rad > 1.6 { "a turn near 180 degrees" } else { "a translation, or hardly a turn" };
            Err(Refusal {
                reason: format!(
                    "no rotation to be seen: {near} (eigenvalue angle {deg:.1} degrees, {significance:.1} sigma; 8 needed)"
                ),
                rotation_deg: Some(deg),
                homography: Some(Box::new(robust)),
                error: None,
                kind: RefusalKind::NoRotation,
            })
        }
        Err(NoCircularPoint::TooUncertain { sigma }) => Err(Refusal {
            reason: format!("circular point too uncertain (direction known to {:.0} degrees)", sigma.to_degrees()),
            rotation_deg: None,
            homography: Some(Box::new(robust)),
            error: None,
            kind: RefusalKind::Uncertain,
        }),
    }
}

impl Pipeline<'_> {
    pub(super) fn homographies(&self, pairs: &[ImagePair], lens: Option<&Lens>) -> Vec<PairResult> {
        self.observer.begin(Stage::Homographies, pairs.len());
        pairs
            .par_iter()
            .map(|pair| {
                let result = self.homography(pair, lens);
                self.observer.advance(Stage::Homographies);
                result
            })
            .collect()
    }

    pub(super) fn homography(&self, pair: &ImagePair, lens: Option<&Lens>) -> PairResult {
        let mut options = self.robust_options(false);
        let mut result = self.homography_with(pair, lens, options);
        // Matches from elsewhere may be coarser than those of features: where the noise comes near what was thought possible, it
        // is cut off by that, and more is allowed.
        while self.images.is_none() && options.max_sigma_px < COARSEST_PX {
            let noise = result.robust().map_or(0.0, |r| r.estimate.sigma_px);
            if noise < NEAR_LIMIT * options.max_sigma_px {
                break;
            }
            options.max_sigma_px *= 2.0;
            result = self.homography_with(pair, lens, options);
        }
        result
    }

    /// Options of the robust fit for features, or for patches, which carry their own deviation: noise is in units of it.
    pub(super) fn robust_options(&self, patches: bool) -> RobustOptions {
        let mut robust = self.options.robust;
        if patches {
            (robust.max_sigma_px, robust.static_px) = (MAX_PATCH_NOISE, 0.0);
        }
        robust
    }

    pub(super) fn homography_with(
        &self,
        pair: &ImagePair,
        lens: Option<&Lens>,
        mut robust: RobustOptions,
    ) -> PairResult {
        let candidates = pair.matches.len();
        let refuse = |reason: String, kind, homography| PairResult {
            candidates,
            outcome: Err(Refusal { reason, rotation_deg: None, homography, error: None, kind }),
            superseded: None,
        };
        if candidates < self.min_matches.max(4) {
            let text = format!("{candidates} matches only ({} needed)", self.min_matches.max(4));
            return refuse(text, RefusalKind::NoPlane, None);
        }
        // Indices into the pair's matches are kept; a match that has no ideal point is moved out of every model's reach.
        let ideal: Vec<PointMatch> = match lens {
            None => pair.matches.clone(),
            Some(lens) => pair
                .matches
                .iter()
                .map(|m| lens.ideal_match(m).unwrap_or(PointMatch { b: Vector2::repeat(OUT_OF_REACH_PX), ..*m }))
                .collect(),
        };
        robust.min_inliers = self.min_matches.max(6);
        robust.ransac.seed = self.options.seed ^ ((pair.from as u64) << 32 | pair.to as u64);
        match estimate_robust(&ideal, &self.frame(), &robust) {
            Err(error) => {
                let on_a_line = spread_ratio(&ideal) < ON_A_LINE;
                let reason = if on_a_line {
                    format!("the {candidates} matches lie on a line")
                } else {
                    format!("no common plane: none of {candidates} matches agree on one")
                };
                let error = on_a_line.then_some(Box::new(error));
                let kind = RefusalKind::NoPlane;
                PairResult {
                    candidates,
                    outcome: Err(Refusal { reason, rotation_deg: None, homography: None, error, kind }),
                    superseded: None,
                }
            }
            Ok(found) if spread_ratio(&found.inliers.iter().map(|&k| ideal[k]).collect::<Vec<_>>()) < ON_A_LINE => {
                let reason = format!("the {} matches that agree lie on a line", found.inliers.len());
                let spread_ratio = spread_ratio(&ideal);
                let error = Some(Box::new(Error::DegeneratePoints { count: found.inliers.len(), spread_ratio }));
                let kind = RefusalKind::NoPlane;
                PairResult {
                    candidates,
                    outcome: Err(Refusal {
                        reason,
                        rotation_deg: None,
                        homography: Some(Box::new(found)),
                        error,
                        kind,
                    }),
                    superseded: None,
                }
            }
            Ok(found) if found.inliers.len() < self.min_matches => {
                let text = format!(
                    "no common plane: {} of {candidates} matches agree on one ({} needed)",
                    found.inliers.len(),
                    self.min_matches
                );
                refuse(text, RefusalKind::NoPlane, Some(Box::new(found)))
            }
            Ok(found) if found.is_static => {
                let text = format!("nothing moved: {} of {candidates} matches stand still", found.inliers.len());
                refuse(text, RefusalKind::Static, Some(Box::new(found)))
            }
            Ok(found) => {
                let mut outcome = geometry_of(found);
                if let Ok((robust, geometry)) = &mut outcome {
                    geometry.circular_point.by_k1 = self.shift_by_k1(&ideal, robust, &geometry.circular_point);
                }
                PairResult { candidates, outcome, superseded: None }
            }
        }
    }

    /// The change of a circular point for each unit of k1 undone, by a difference: both homographies from the same (at most
    /// a few hundred) inliers.
    fn shift_by_k1(
        &self,
        matches: &[PointMatch],
        robust: &RobustHomography,
        point: &CircularPoint,
    ) -> Option<Vector4<f64>> {
        const STEP: f64 = 0.02;
        const ENOUGH: usize = 300;
        let [cx, cy] = self.options.principal_point_px.unwrap_or(self.size.centre_px());
        let lens = Lens {
            distortion: Distortion::radial(STEP, 0.0),
            intrinsics: Intrinsics::square(self.size.width.max(self.size.height) as f64, cx, cy),
        };
        let stride = robust.inliers.len().div_ceil(ENOUGH);
        let some: Vec<PointMatch> = robust.inliers.iter().step_by(stride).map(|&k| matches[k]).collect();
        let undone: Vec<PointMatch> = some.iter().filter_map(|m| lens.ideal_match(m)).collect();
        let coordinates = |matches: &[PointMatch]| {
            let start = &robust.estimate.in_frame;
            let estimate = refine(matches, Some(start), &self.frame(), &RefineOptions::default()).ok()?;
            let eigen = complex_pair_eigen(&estimate.in_frame)?;
            Some(point.coordinates_of(&eigen.complex_right))
        };
        Some((coordinates(&undone)? - coordinates(&some)?) / STEP)
    }

    pub(super) fn refit(&self, pair: &ImagePair, robust: &RobustHomography, lens: &Lens) -> Option<HomographyEstimate> {
        let ideal: Vec<PointMatch> =
            robust.inliers.iter().filter_map(|&k| lens.ideal_match(&pair.matches[k])).collect();
        refine(&ideal, None, &self.frame(), &RefineOptions::default()).ok()
    }

    pub(super) fn refit_all(&self, pairs: &[ImagePair], results: Vec<PairResult>, lens: &Lens) -> Vec<PairResult> {
        results
            .into_iter()
            .zip(pairs)
            .map(|(result, pair)| {
                let outcome = match result.outcome {
                    Ok((mut robust, geometry)) => {
                        if let Some(estimate) = self.refit(pair, &robust, lens) {
                            robust.estimate = estimate;
                        }
                        let by_k1 = geometry.circular_point.by_k1;
                        geometry_of(robust).map(|(robust, mut geometry)| {
                            geometry.circular_point.by_k1 = by_k1;
                            (robust, geometry)
                        })
                    }
                    refused => refused,
                };
                PairResult { outcome, ..result }
            })
            .collect()
    }

    pub(super) fn why_nothing(&self, results: &[PairResult]) -> Error {
        let refusals = || results.iter().filter_map(|r| r.outcome.as_ref().err());
        let count = |kind| refusals().filter(|r| r.kind == kind).count();
        let with_plane = results.len() - count(RefusalKind::NoPlane);
        if with_plane == 0 {
            if let ([_], Some(error)) = (results, refusals().find_map(|r| r.error.clone())) {
                return *error;
            }
            let best = refusals().filter_map(|r| r.homography.as_ref()).map(|h| h.inliers.len()).max().unwrap_or(0);
            return Error::NoCommonPlane { pairs: results.len(), best, needed: self.min_matches };
        }
        let (reason, remedies) = if count(RefusalKind::Static) == with_plane {
            ("nothing moved between the images (all matches stand still)".to_string(), vec![Remedy::CLEAR_TURN])
        } else if count(RefusalKind::NoRotation) > 0 {
            let angles = || refusals().filter(|r| r.kind == RefusalKind::NoRotation).filter_map(|r| r.rotation_deg);
            let (largest, half_turns) = (angles().fold(0.0, f64::max), angles().filter(|a| *a > 90.0).count());
            let reason = if half_turns == count(RefusalKind::NoRotation) {
                format!(
                    "the camera was turned by nearly 180 degrees (eigenvalue angle {largest:.1} degrees): the circular points cannot be \
                     told apart there"
                )
            } else {
                format!(
                    "the camera was moved without a turn, a pure translation says nothing of the focal length (largest eigenvalue angle \
                     {largest:.1} degrees, not above its noise)"
                )
            };
            (reason, vec![Remedy::CLEAR_TURN])
        } else {
            let text =
                refusals().find(|r| r.kind == RefusalKind::Uncertain).map_or(String::new(), |r| r.reason.clone());
            (text, vec![Remedy::MoreMatches, Remedy::TurnFurther])
        };
        Error::NoUsableMotion { pairs: with_plane, reason, remedies }
    }
}
