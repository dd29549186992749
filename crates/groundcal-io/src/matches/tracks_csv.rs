//! `tracks.csv`: image,track,x,y[,sigma_px].

use std::collections::HashMap;

use groundcal::{
    geometry::size::ImageSize,
    pairs::correspondence::{ImagePair, PointMatch},
};

use crate::{
    error::IoError,
    matches::{point_pairs::PointPairs, table::Table},
    names::natural_order,
    text::plain,
};

/// Where an image sees a track, and the standard deviation there.
type Sighting = ([f64; 2], f64);

/// The tracks of all images.
pub(crate) struct Tracks {
    /// Images in natural order.
    pub(crate) names: Vec<String>,
    /// Names of the tracks in natural order: matches must not depend on the order of the rows.
    track_count: usize,
    /// Of each image, tracks (as places in that order) with what is seen of them, sorted.
    seen: Vec<Vec<(usize, Sighting)>>,
}

impl Tracks {
    /// All rows.
    pub(crate) fn read(table: &Table, size: ImageSize) -> Result<Self, IoError> {
        let mut images: HashMap<String, HashMap<usize, Sighting>> = HashMap::new();
        let mut tracks: HashMap<String, usize> = HashMap::new();
        table.each(|row| {
            let (image, track) = (row.name("image")?, row.name("track")?);
            let point = (row.point(["x", "y"], size)?, row.sigma_px()?);
            let next = tracks.len();
            let number = *tracks.entry(track.clone()).or_insert(next);
            if images.entry(image.clone()).or_default().insert(number, point).is_some() {
                return Err(row.fault(format!("track {} appears twice in image {}", plain(&track), plain(&image))));
            }
            Ok(())
        })?;
        let mut ordered: Vec<(&String, usize)> = tracks.iter().map(|(name, number)| (name, *number)).collect();
        ordered.sort_by(|a, b| natural_order(a.0, b.0));
        let mut place = vec![0; ordered.len()];
        for (at, (_, number)) in ordered.iter().enumerate() {
            place[*number] = at;
        }
        let mut names: Vec<String> = images.keys().cloned().collect();
        names.sort_by(|a, b| natural_order(a, b));
        let sorted = |name: &String| {
            let mut seen: Vec<(usize, Sighting)> = images[name].iter().map(|(t, s)| (place[*t], *s)).collect();
            seen.sort_by_key(|(track, _)| *track);
            seen
        };
        let seen = names.iter().map(sorted).collect();
        Ok(Self { names, track_count: tracks.len(), seen })
    }

    /// What two images share, in the order of the tracks.
    fn shared(&self, i: usize, j: usize) -> Option<ImagePair> {
        let (a, b) = (&self.seen[i], &self.seen[j]);
        let mut matches = Vec::new();
        let mut at = 0;
        for (track, (pa, sa)) in a {
            while b.get(at).is_some_and(|(other, _)| other < track) {
                at += 1;
            }
            if let Some((_, (pb, sb))) = b.get(at).filter(|(other, _)| other == track) {
                // The model has one deviation for both images of a match.
                let sigma_px = (0.5 * (sa * sa + sb * sb)).sqrt();
                matches.push(PointMatch { sigma_px, ..PointMatch::new(*pa, *pb) });
            }
        }
        (!matches.is_empty()).then_some(ImagePair { from: i, to: j, matches })
    }

    /// All pairs of a small set, else neighbours.
    pub(crate) fn near(self, all_pairs_limit: usize) -> Result<PointPairs, String> {
        let count = self.names.len();
        let neighbours_only = count > all_pairs_limit;
        let mut pairs = Vec::new();
        for i in 0..count {
            for j in i + 1..count {
                // The last image meets the first where a turn closes.
                if !neighbours_only || j - i <= 3 || (i, j) == (0, count - 1) {
                    pairs.extend(self.shared(i, j));
                }
            }
        }
        self.finish(pairs, neighbours_only, None)
    }

    /// The pairs of a list.
    pub(crate) fn listed(self, list: Vec<(usize, usize)>) -> Result<PointPairs, String> {
        // The order of the images, as `near` has it.
        let mut ordered: Vec<(usize, usize)> = list.iter().map(|(i, j)| (*i.min(j), *i.max(j))).collect();
        ordered.sort_unstable();
        let pairs = ordered.into_iter().filter_map(|(i, j)| self.shared(i, j)).collect();
        self.finish(pairs, false, Some(list))
    }

    fn finish(
        self,
        pairs: Vec<ImagePair>,
        neighbours_only: bool,
        listed: Option<Vec<(usize, usize)>>,
    ) -> Result<PointPairs, String> {
        if pairs.is_empty() {
            let which = match (&listed, neighbours_only) {
                (Some(_), _) => "of the pairs listed",
                (None, true) => "that are neighbours",
                (None, false) => "at all",
            };
            return Err(format!(
                "no two images {which} share a track ({} images, {} tracks). The name of a track must be the same in all images \
                 that see its point",
                self.names.len(),
                self.track_count
            ));
        }
        Ok(PointPairs { names: self.names, pairs, neighbours_only, listed })
    }
}
