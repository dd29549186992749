//! Points seen in two or more views, joined from matches of pairs.

use std::collections::HashMap;

use nalgebra::{Matrix2, Vector2};

/// Where a point is seen.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Observation {
    /// Index of the frame: the moment at which it is seen.
    pub frame: usize,
    /// Index of the camera of the rig that sees it.
    pub camera: usize,
    /// In pixels, (0, 0) the centre of the top-left pixel.
    pub pixel: Vector2<f64>,
    /// Inverse covariance, pixels⁻².
    pub information: Matrix2<f64>,
}

impl Observation {
    /// By the first camera, with the same deviation in all directions.
    pub(crate) fn new(frame: usize, pixel: Vector2<f64>, sigma_px: f64) -> Self {
        Self { frame, camera: 0, pixel, information: Matrix2::from_diagonal_element(sigma_px.powi(-2)) }
    }

    fn image(&self) -> (usize, usize) {
        (self.frame, self.camera)
    }
}

/// Kinds of measurement, each with a noise of its own.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Kind {
    /// Patches matched by least squares.
    Patch,
    /// Features, or points from elsewhere.
    Point,
}

/// Number of kinds.
pub(crate) const KINDS: usize = 2;

/// A point and where it is seen: each frame and camera once, in ascending order.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Track {
    /// How it was measured.
    pub kind: Kind,
    /// Two or more.
    pub observations: Vec<Observation>,
}

/// Joins matches that share a point of an image (the very same coordinates). A match that would put a second point of one
/// image into a track starts one of its own. The order of the matches decides the order of the tracks.
pub(crate) fn join_matches(kind: Kind, matches: &[[Observation; 2]]) -> Vec<Track> {
    let key = |o: &Observation| (o.image(), o.pixel.x.to_bits(), o.pixel.y.to_bits());
    // A track under construction: observations, and how many matches speak for each.
    let mut tracks: Vec<Vec<(Observation, f64)>> = Vec::new();
    let mut track_of: HashMap<((usize, usize), u64, u64), usize> = HashMap::new();
    let put = |tracks: &mut Vec<Vec<(Observation, f64)>>, t: usize, o: &Observation| {
        if let Some((known, count)) = tracks[t].iter_mut().find(|(known, _)| key(known) == key(o)) {
            known.information += o.information;
            *count += 1.0;
        } else {
            tracks[t].push((*o, 1.0));
        }
    };
    for [a, b] in matches {
        let (ta, tb) = (track_of.get(&key(a)).copied(), track_of.get(&key(b)).copied());
        let takes =
            |t: usize, o: &Observation| tracks[t].iter().all(|(k, _)| k.image() != o.image() || key(k) == key(o));
        let target = match (ta, tb) {
            (Some(s), Some(t)) if s == t => Some(s),
            (Some(s), Some(t)) => {
                let clash = tracks[t].iter().any(|(o, _)| !takes(s, o));
                (!clash).then(|| {
                    let moved = std::mem::take(&mut tracks[t]);
                    for (o, _) in &moved {
                        track_of.insert(key(o), s);
                    }
                    tracks[s].extend(moved);
                    s
                })
            }
            (Some(t), None) => takes(t, b).then_some(t),
            (None, Some(t)) => takes(t, a).then_some(t),
            (None, None) => None,
        };
        let t = target.unwrap_or_else(|| {
            tracks.push(Vec::new());
            tracks.len() - 1
        });
        for o in [a, b] {
            put(&mut tracks, t, o);
            track_of.entry(key(o)).or_insert(t);
        }
    }
    tracks
        .into_iter()
        .filter(|t| t.len() >= 2)
        .map(|mut t| {
            t.sort_by_key(|(o, _)| o.image());
            let observations =
                t.into_iter().map(|(o, count)| Observation { information: o.information / count, ..o }).collect();
            Track { kind, observations }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn seen(frame: usize, x: f64) -> Observation {
        Observation::new(frame, Vector2::new(x, 1.0), 1.0)
    }

    fn frames(t: &Track) -> Vec<usize> {
        t.observations.iter().map(|o| o.frame).collect()
    }

    #[test]
    fn chains_become_one_track_and_contradictions_do_not() {
        // 0-1 and 2-1 share a point of 1; 2-3 continues; 0-3' would put a second point of 3 in.
        let tracks = join_matches(
            Kind::Point,
            &[
                [seen(0, 5.0), seen(1, 6.0)],
                [seen(2, 7.0), seen(3, 8.0)],
                [seen(1, 6.0), seen(2, 7.0)],
                [seen(0, 5.0), seen(3, 9.0)],
                [seen(4, 1.0), seen(5, 1.0)],
            ],
        );
        assert_eq!(tracks.iter().map(frames).collect::<Vec<_>>(), [vec![0, 1, 2, 3], vec![0, 3], vec![4, 5]]);
        assert!(tracks[0].observations.iter().all(|o| (o.information - Matrix2::identity()).norm() < 1e-15));
    }
}
