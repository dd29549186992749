//! What a calibration was made from (see [`crate::result::evidence`]), gathered at the end.

use nalgebra::Complex;

use crate::{
    calibrate::{joint::JointSolution, names::Names},
    geometry::frame::Frame,
    ids::ViewId,
    numerics::statistics::HUBER_SIGMAS,
    pairs::{
        correspondence::PointMatch,
        known_lens::KnownLens,
        observation::{PairObservation, carried},
        placed_lens::PlacedLens,
    },
    refine::{
        Kind,
        residual::{Pose, Projector},
    },
    result::evidence::{Evidence, MatchEvidence, ObservationEvidence, PairEvidence},
};

/// Of all pairs and the joint refinement, if there was one.
pub(super) fn evidence_of(
    pairs: &[PairObservation],
    joint: Option<&JointSolution>,
    known: &KnownLens,
    names: Names<'_>,
    frame: &Frame,
) -> Evidence {
    let lens = known.lens().copied();
    Evidence {
        images: names.0.to_vec(),
        pairs: pairs.iter().map(|pair| pair_evidence(pair, lens.as_ref(), frame)).collect(),
        observations: joint.map_or(Vec::new(), |joint| observations(joint, frame)),
        lens,
    }
}

fn pair_evidence(pair: &PairObservation, lens: Option<&PlacedLens>, frame: &Frame) -> PairEvidence {
    let images = pair.images().map(|image| image.index());
    // Pairs without a plane are many and say nothing point by point.
    let Some(plane) = pair.plane() else { return PairEvidence { images, ..PairEvidence::default() } };
    let h = &plane.estimate.h_b_from_a;
    let evidence = |(m, accepted): (PointMatch, bool), patch: bool| MatchEvidence {
        a: m.a.into(),
        b: m.b.into(),
        patch,
        accepted,
        distance_px: carried(h, &m.a, lens).map(|b| (b - m.b).norm()),
    };
    let before = pair.superseded.as_deref();
    let features = before.map_or(&[][..], |s| &s.features).iter().map(|f| evidence(*f, false));
    // Homographies from elsewhere come without matches.
    let own = pair.marked_matches(plane);
    let matches = features.chain(own.into_iter().map(|f| evidence(f, plane.patches))).collect();
    let to_pixel = frame.pixel_matrix().map(|x| Complex::new(x, 0.0));
    let m = h.matrix();
    PairEvidence {
        images,
        h_b_from_a: Some(std::array::from_fn(|r| std::array::from_fn(|c| m[(r, c)]))),
        circular_point: pair.geometry().map(|g| {
            let e = to_pixel * g.circular_point.point;
            [0, 1, 2].map(|i| [e[i].re, e[i].im])
        }),
        matches,
        lost_patches: before.map_or(Vec::new(), |s| s.lost.clone()),
    }
}

fn observations(joint: &JointSolution, frame: &Frame) -> Vec<ObservationEvidence> {
    let b = &joint.bundle;
    let projector = Projector::new(&b.state.cameras[0]);
    let poses: Vec<Pose> = b.state.frames.iter().map(|v| Pose::new(b.scene, &b.state.groups[v.group], v)).collect();
    let mut all = Vec::with_capacity(b.counts[0]);
    for (t, track) in joint.tracks.iter().enumerate() {
        let n = track.observations.len() as f64;
        // The point follows its observations: a residual is smaller than the error by this much.
        let share = (n - 1.0) / n;
        for (o, squared) in track.observations.iter().zip(&b.squared_residuals[t]) {
            let camera_point = poses[o.frame].camera_point(&b.state.points[t]);
            let Some(predicted) = projector.project(&camera_point) else { continue };
            let standardised_residual = (squared * b.design_effects[track.kind as usize] / share).sqrt();
            all.push(ObservationEvidence {
                image: joint.views.image(ViewId::new(o.frame)).index(),
                track: t,
                patch: track.kind == Kind::Patch,
                pixel: o.pixel.into(),
                residual_px: (o.pixel - frame.pixel(&predicted)).into(),
                standardised_residual,
                weight: if standardised_residual > HUBER_SIGMAS { HUBER_SIGMAS / standardised_residual } else { 1.0 },
            });
        }
    }
    all
}
