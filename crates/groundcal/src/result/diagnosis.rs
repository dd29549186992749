//! Which motions do not fit the others.
//!
//! A motion is a turn about the floor's normal, so that both its views have one attitude; and its points, like those of all others, are
//! images of a floor by one camera. Either may be contradicted by one motion alone: compared are the attitudes of its two views with those
//! of the other motions, and its residuals from the camera of all motions with those from a homography of its own.

use crate::{
    geometry::attitude::up_in_camera,
    numerics::statistics::median,
    result::{
        calibration::Calibration,
        evidence::ObservationEvidence,
        motions::{MotionDiagnosis, MotionReport, MotionVerdict},
    },
};

/// Views of a motion further apart than this, and than so many times what is usual, have tilted against each other.
const MIN_RELATIVE_TILT_DEG: f64 = 0.2;
const TILT_RATIO: f64 = 5.0;
/// A motion that fits the camera of all so many times worse than a homography, and by so many pixels, does not fit it.
const MISFIT_RATIO: f64 = 4.0;
const MIN_MISFIT_PX: f64 = 0.1;

/// Of each of the calibration's motions; `None` for those that take no part. From its views and its evidence: without evidence (of a
/// calibration that was read from a file) what [`MotionReport::diagnosis`] says of the residuals is kept.
pub(crate) fn motions(c: &Calibration) -> Vec<Option<MotionDiagnosis>> {
    let numbers: Vec<(Option<f64>, Option<f64>)> =
        c.motions.iter().enumerate().map(|(i, m)| (joint_rms_px(c, i), apart_deg(c, m))).collect();
    let used = || (0..numbers.len()).filter(|&i| c.motions[i].used);
    let judge = |i: usize| {
        let (joint_rms_px, apart_deg) = numbers[i];
        let others = used().filter(|&j| j != i).filter_map(|j| numbers[j].1).collect();
        let verdict = verdict(c.motions[i].rms_px, joint_rms_px, apart_deg, others);
        MotionDiagnosis { joint_rms_px, apart_deg, verdict }
    };
    (0..numbers.len()).map(|i| c.motions[i].used.then(|| judge(i))).collect()
}

/// Its views tilt against each other more than those of the `others` do, or it fits the camera of all far worse than its own homography.
fn verdict(own: Option<f64>, joint: Option<f64>, apart: Option<f64>, mut others: Vec<f64>) -> MotionVerdict {
    if let Some(apart_deg) = apart {
        let usual_deg = if others.is_empty() { 0.0 } else { median(&mut others) };
        if apart_deg > MIN_RELATIVE_TILT_DEG && apart_deg > TILT_RATIO * usual_deg {
            return MotionVerdict::Tilts { apart_deg, usual_deg };
        }
    }
    match (own, joint) {
        (Some(own_rms_px), Some(joint_rms_px))
            if joint_rms_px > MISFIT_RATIO * own_rms_px && joint_rms_px > MIN_MISFIT_PX =>
        {
            MotionVerdict::OffCamera { joint_rms_px, own_rms_px }
        }
        _ if joint.is_none() && apart.is_none() => MotionVerdict::NotJudged,
        _ => MotionVerdict::Fits,
    }
}

/// Residuals of the points of a motion's two images in the joint refinement, both images together.
fn joint_rms_px(c: &Calibration, motion: usize) -> Option<f64> {
    let Some(p) = c.evidence.pairs.get(motion) else {
        return c.motions[motion].diagnosis.and_then(|d| d.joint_rms_px);
    };
    // Of the kind that its own homography is of.
    let patches = p.matches.iter().any(|m| m.patch);
    let of_motion = |o: &&ObservationEvidence| p.images.contains(&o.image) && o.patch == patches;
    let (mut squares, mut count) = (0.0, 0);
    for o in c.evidence.observations.iter().filter(of_motion) {
        squares += o.residual_px[0].powi(2) + o.residual_px[1].powi(2);
        count += 1;
    }
    (c.motions[motion].used && count > 0).then(|| (2.0 * squares / f64::from(count)).sqrt())
}

/// The angle between the floor's normals as its two views have them.
fn apart_deg(c: &Calibration, motion: &MotionReport) -> Option<f64> {
    let up = |name: &str| {
        let v = c.views.iter().find(|v| v.image == name && v.attitude.is_some())?;
        Some(up_in_camera(v.pitch_down_deg.to_radians(), v.roll_deg.to_radians()))
    };
    match (up(&motion.from), up(&motion.to)) {
        (Some(a), Some(b)) if motion.used => Some(a.cross(&b).norm().atan2(a.dot(&b)).to_degrees()),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn verdicts_follow_the_numbers() {
        let tilts = MotionVerdict::Tilts { apart_deg: 4.0, usual_deg: 0.1 };
        assert_eq!(verdict(Some(0.1), Some(0.1), Some(4.0), vec![0.1, 0.05, 0.3]), tilts);
        assert_eq!(verdict(Some(0.1), Some(0.1), Some(0.4), vec![0.1, 0.05, 0.3]), MotionVerdict::Fits);
        let off = MotionVerdict::OffCamera { joint_rms_px: 0.5, own_rms_px: 0.1 };
        assert_eq!(verdict(Some(0.1), Some(0.5), Some(0.0), Vec::new()), off);
        assert_eq!(verdict(Some(0.01), Some(0.05), None, Vec::new()), MotionVerdict::Fits);
        assert_eq!(verdict(Some(0.01), None, None, Vec::new()), MotionVerdict::NotJudged);
        assert_eq!(serde_json::from_str::<MotionVerdict>(&serde_json::to_string(&tilts).unwrap()).unwrap(), tilts);
    }
}
