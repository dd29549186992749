//! What a calibration was made from (see [`crate::result::evidence`]), gathered at the end.

use nalgebra::{Complex, Vector2};

use crate::calibrate::{Pipeline, joint::Joint, pairs::PairResult, report::KnownLens};
use crate::{
    geometry::homography::Homography,
    pairs::{
        correspondence::{ImagePair, PointMatch},
        plane_lens::Lens,
        robust::RobustHomography,
    },
    refine::{
        BundleOptions, Kind,
        residual::{Pose, Projector},
    },
    result::evidence::{Evidence, MatchEvidence, ObservationEvidence, PairEvidence},
};

/// What patches took the place of.
#[derive(Clone)]
pub(super) struct Superseded {
    /// Features, and whether each was on the plane.
    pub(super) features: Vec<(PointMatch, bool)>,
    /// Places of templates that were sought in the second image and not found.
    pub(super) lost: Vec<[f64; 2]>,
}

impl Superseded {
    pub(super) fn new(pair: &ImagePair, robust: &RobustHomography, lost: Vec<[f64; 2]>) -> Self {
        Self { features: marked(pair, robust), lost }
    }
}

fn marked(pair: &ImagePair, robust: &RobustHomography) -> Vec<(PointMatch, bool)> {
    let mut features: Vec<(PointMatch, bool)> = pair.matches.iter().map(|m| (*m, false)).collect();
    for &k in &robust.inliers {
        features[k].1 = true;
    }
    features
}

impl Pipeline<'_> {
    /// Of all pairs and the joint refinement, if there was one.
    pub(super) fn evidence(
        &self,
        pairs: &[ImagePair],
        results: &[PairResult],
        joint: Option<&Joint>,
        known: &KnownLens,
    ) -> Evidence {
        let lens = known.lens().copied();
        Evidence {
            images: self.names.to_vec(),
            pairs: pairs.iter().zip(results).map(|(p, r)| self.pair_evidence(p, r, lens.as_ref())).collect(),
            observations: joint.map_or(Vec::new(), |j| self.observations(j)),
            lens,
        }
    }

    fn pair_evidence(&self, pair: &ImagePair, result: &PairResult, lens: Option<&Lens>) -> PairEvidence {
        let images = [pair.from, pair.to];
        // Pairs without a plane are many and say nothing point by point.
        let Some(robust) = result.robust() else { return PairEvidence { images, ..PairEvidence::default() } };
        let h = &robust.estimate.h_b_from_a;
        let evidence = |(m, accepted): (PointMatch, bool), patch: bool| MatchEvidence {
            a: m.a.into(),
            b: m.b.into(),
            patch,
            accepted,
            distance_px: carried(h, &m.a, lens).map(|b| (b - m.b).norm()),
        };
        let before = result.superseded.as_deref();
        let features = before.map_or(&[][..], |s| &s.features).iter().map(|f| evidence(*f, false));
        // Homographies from elsewhere come without matches.
        let own = if pair.matches.is_empty() { Vec::new() } else { marked(pair, robust) };
        let matches = features.chain(own.into_iter().map(|f| evidence(f, robust.patches))).collect();
        let geometry = result.outcome.as_ref().ok().map(|(_, g)| g);
        let to_pixel = self.frame().pixel_matrix().map(|x| Complex::new(x, 0.0));
        let m = h.matrix();
        PairEvidence {
            images,
            h_b_from_a: Some(std::array::from_fn(|r| std::array::from_fn(|c| m[(r, c)]))),
            circular_point: geometry.map(|g| {
                let e = to_pixel * g.circular_point.point;
                [0, 1, 2].map(|i| [e[i].re, e[i].im])
            }),
            matches,
            lost_patches: before.map_or(Vec::new(), |s| s.lost.clone()),
        }
    }

    fn observations(&self, joint: &Joint) -> Vec<ObservationEvidence> {
        let (b, frame) = (&joint.bundle, self.frame());
        let projector = Projector::new(&b.state.cameras[0]);
        let poses: Vec<Pose> = b.state.frames.iter().map(|v| Pose::new(b.scene, &b.state.groups[v.group], v)).collect();
        let huber = BundleOptions::HUBER;
        let mut all = Vec::with_capacity(b.counts[0]);
        for (t, track) in joint.tracks.iter().enumerate() {
            let n = track.observations.len() as f64;
            // The point follows its observations: a residual is smaller than the error by this much.
            let share = (n - 1.0) / n;
            for (o, squared) in track.observations.iter().zip(&b.squared_residuals[t]) {
                let camera_point = poses[o.frame].camera_point(&b.state.points[t]);
                let Some(predicted) = projector.project(&camera_point) else { continue };
                let deviations = (squared * b.design_effects[track.kind as usize] / share).sqrt();
                all.push(ObservationEvidence {
                    image: joint.images[o.frame],
                    track: t,
                    patch: track.kind == Kind::Patch,
                    pixel: o.pixel.into(),
                    residual_px: (o.pixel - frame.to_pixel(&predicted)).into(),
                    deviations,
                    downweighted: deviations > huber,
                });
            }
        }
        all
    }
}

/// Where a pair's homography takes a pixel of the first image in the second, lens and all.
fn carried(h: &Homography, a: &Vector2<f64>, lens: Option<&Lens>) -> Option<Vector2<f64>> {
    match lens {
        None => h.apply(a),
        Some(lens) => lens.real_point(&h.apply(&lens.ideal_point(a)?)?),
    }
}
