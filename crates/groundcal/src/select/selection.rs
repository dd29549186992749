//! Which pairs are used as motions, of what kind, and what became of each of the others: an index on the list of pair
//! observations, so that pairs looked at again keep their verdicts.

use crate::{
    ids::{ImageId, PairId},
    pairs::observation::PairObservation,
    select::attitude_groups::{HorizonSides, Motion},
};

/// What a camera did between the images of the pairs used.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum MotionKind {
    /// It turned about the normal of a plane, and may have moved along it.
    PlaneNormal,
    /// It turned on the spot, about any axes.
    Turning {
        /// The focal length that makes rotations of the pairs, roughly.
        focal_px: f64,
    },
    /// It moved in any way before one plane.
    General,
}

/// What became of a pair.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum PairVerdict {
    /// It shows no motion that could be judged: its observation says why.
    NoMotion,
    /// It takes part.
    Used {
        /// Where its points lie.
        sides: HorizonSides,
    },
    /// It takes no part.
    Rejected(Rejection),
}

/// Why a motion takes no part.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Rejection {
    /// Its points lie on both sides of the horizon it implies, where a floor explains the others.
    WrongSides {
        /// Fraction of the points on the side of fewer.
        beyond: f64,
        /// The most that a floor has.
        most: f64,
    },
    /// Its circular point is this many standard deviations off the conic of the others.
    Disagrees {
        /// Infinite where no camera was found that it could agree with.
        sigmas: f64,
    },
    /// A pair used gives one of its images another attitude.
    OtherAttitude {
        /// The pair used.
        pair: PairId,
        /// The image they share.
        image: ImageId,
        /// Distance of the attitudes in standard deviations.
        sigmas: f64,
    },
    /// With it no camera explains all motions together, and its points were furthest from the one that came out.
    LeftOut,
    /// No rotation under the camera that makes rotations of the others.
    NoRotation {
        /// ‖M Mᵀ - I‖ of its M = K⁻¹ H K.
        misfit: f64,
        /// The most that passes for a rotation.
        most: f64,
    },
    /// The method uses one motion, and another has more matches.
    OneMotionOnly {
        /// Its own matches on the plane.
        matches: usize,
        /// Those of the motion used.
        of_used: usize,
    },
    /// It is none of the pairs named as the motions.
    NotNamed,
    /// Its images are joined by pairs of more matches, [`crate::select::general::PAIRS_PER_IMAGE`] of each.
    Redundant,
    /// No pair used joins its images with the others.
    Unconnected,
    /// Its points are not of the plane that the others show.
    OtherPlane,
    /// The points of its plane scatter by more than general motion makes use of.
    TooNoisy {
        /// Standard deviation of a match.
        sigma_px: f64,
        /// The largest allowed.
        most_px: f64,
    },
    /// Its images show the two sides of a plane, or one of them is mirrored.
    Mirrored,
}

/// The motions among a list of pairs.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Selection {
    pub(crate) kind: MotionKind,
    /// One a pair, in the order of the list.
    verdicts: Vec<PairVerdict>,
}

impl Selection {
    /// From a verdict on each pair.
    pub(crate) fn new(kind: MotionKind, pairs: &[PairObservation], verdict: impl Fn(PairId) -> PairVerdict) -> Self {
        Self { kind, verdicts: pairs.iter().map(|pair| verdict(pair.id)).collect() }
    }

    /// What became of a pair.
    pub(crate) fn verdict(&self, id: PairId) -> PairVerdict {
        self.verdicts[id.index()]
    }

    /// The pairs used, ascending.
    pub(crate) fn used(&self) -> Vec<PairId> {
        let used =
            |(i, verdict): (usize, &PairVerdict)| matches!(verdict, PairVerdict::Used { .. }).then_some(PairId::new(i));
        self.verdicts.iter().enumerate().filter_map(used).collect()
    }

    /// Whether a motion used has points on both sides of the horizon: they are far away, and no floor.
    pub(crate) fn is_far_away(&self) -> bool {
        self.verdicts.contains(&PairVerdict::Used { sides: HorizonSides::Both })
    }

    /// The pairs used as the motions that their observations show now, in the order of [`Self::used`]. Every one of them must show
    /// a turn (see [`Self::confirmed`]).
    pub(crate) fn motions(&self, pairs: &[PairObservation]) -> Vec<Motion> {
        let motion = |(pair, verdict): (&PairObservation, &PairVerdict)| match *verdict {
            PairVerdict::Used { sides } => {
                Some(Motion { from: pair.from, to: pair.to, geometry: pair.geometry()?.clone(), sides })
            }
            _ => None,
        };
        pairs.iter().zip(&self.verdicts).filter_map(motion).collect()
    }

    /// The same without a pair that the refinement does without.
    pub(crate) fn without(mut self, id: PairId) -> Self {
        self.verdicts[id.index()] = PairVerdict::Rejected(Rejection::LeftOut);
        self
    }

    /// The same with this motion alone.
    pub(crate) fn with_one(mut self, id: PairId, pairs: &[PairObservation]) -> Self {
        let matches_of = |index: usize| pairs[PairId::new(index)].plane().map_or(0, |plane| plane.estimate.matches);
        for (index, verdict) in self.verdicts.iter_mut().enumerate() {
            if index != id.index() && matches!(verdict, PairVerdict::Used { .. }) {
                let (matches, of_used) = (matches_of(index), matches_of(id.index()));
                *verdict = PairVerdict::Rejected(Rejection::OneMotionOnly { matches, of_used });
            }
        }
        self
    }

    /// Pairs that the selection had and the refinement did without.
    pub(crate) fn left_out(&self) -> impl Iterator<Item = PairId> {
        let left_out = |verdict: &PairVerdict| matches!(verdict, PairVerdict::Rejected(Rejection::LeftOut));
        self.verdicts.iter().enumerate().filter(move |(_, v)| left_out(v)).map(|(index, _)| PairId::new(index))
    }

    /// The same without the pairs that no longer show a turn, having been looked at again.
    pub(crate) fn confirmed(mut self, pairs: &[PairObservation]) -> Self {
        for (pair, verdict) in pairs.iter().zip(&mut self.verdicts) {
            if matches!(verdict, PairVerdict::Used { .. }) && pair.outcome.is_err() {
                *verdict = PairVerdict::NoMotion;
            }
        }
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        geometry::{frame::Frame, intrinsics::Intrinsics},
        observer::Silent,
        pairs::{
            observation::{Refusal, RefusalKind},
            observe::{ObserveOptions, observe},
            robust::RobustOptions,
        },
        synthetic::points::PointScene,
    };

    fn observed(scene: &PointScene) -> Vec<PairObservation> {
        let [cx, cy] = scene.size.centre_px();
        let options = ObserveOptions {
            frame: Frame::new(scene.size, None),
            nominal_camera: Intrinsics::square(scene.size.width as f64, cx, cy),
            min_matches: 6,
            from_elsewhere: true,
            robust: RobustOptions::default(),
            seed: 0,
        };
        let pairs = scene.pairs();
        observe(pairs, None, &options, &Silent).expect("not stopped")
    }

    #[test]
    fn the_motions_are_those_that_the_pairs_show_now() {
        let mut pairs = observed(&PointScene::nominal(3));
        let selection = Selection::new(MotionKind::PlaneNormal, &pairs, |id| match id.index() {
            0 => PairVerdict::Rejected(Rejection::WrongSides { beyond: 0.4, most: 0.05 }),
            _ => PairVerdict::Used { sides: HorizonSides::One },
        });
        let [first, second] = [1, 2].map(PairId::new);
        assert_eq!(selection.used(), [first, second]);
        assert!(!selection.is_far_away());
        let turned = |selection: &Selection, pairs: &[PairObservation]| -> Vec<f64> {
            selection.motions(pairs).iter().map(|m| m.geometry.rotation_rad).collect()
        };
        let before = turned(&selection, &pairs);
        assert_eq!(before.len(), 2);
        // Looked at again, a pair shows another turn: the selection has no copy of the old one.
        pairs[1].outcome.as_mut().expect("a turn").geometry.rotation_rad += 0.1;
        assert_eq!(turned(&selection, &pairs), [before[0] + 0.1, before[1]]);
        // And one that shows none any more takes no part, without moving the others.
        pairs[1].outcome = Err(Refusal::new(RefusalKind::NoRotation, "hardly a turn".into(), None));
        let selection = selection.confirmed(&pairs);
        assert_eq!((selection.used(), turned(&selection, &pairs)), (vec![second], vec![before[1]]));
        assert!(matches!(selection.verdict(first), PairVerdict::NoMotion));
    }
}
