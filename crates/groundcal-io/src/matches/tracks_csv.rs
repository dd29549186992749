//! `tracks.csv`: image,track,x,y[,sigma_px].

use std::collections::HashMap;

use groundcal::{
    geometry::ImageSize,
    pairs::{ImagePair, PointMatch},
};

use crate::{
    error::IoError,
    limits::{MAX_MATCHES, MAX_PAIRS},
    matches::{point_pairs::PointPairs, table::Table},
    names::natural_order,
    note::Note,
    text::plain,
};

/// Where an image sees a track, and the standard deviation there.
type Sighting = ([f64; 2], f64);

/// Images of a table: each makes pairs with the three that follow it.
const MAX_IMAGES: usize = MAX_PAIRS / 4;

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
            // A name that is there already need not be kept twice.
            let number = match tracks.get(&track) {
                Some(number) => *number,
                None => *tracks.entry(track.clone()).or_insert(next),
            };
            let seen = match images.get_mut(&image) {
                Some(seen) => seen,
                None => images.entry(image.clone()).or_default(),
            };
            if seen.insert(number, point).is_some() {
                return Err(row.fault(format!("track {} appears twice in image {}", plain(&track), plain(&image))));
            }
            if images.len() > MAX_IMAGES {
                return Err(row.fault(format!("more than {MAX_IMAGES} images. Give fewer at a time")));
            }
            Ok(())
        })?;
        Ok(Self::of(&images, &tracks))
    }

    /// In natural order: what each image sees of the tracks, which have numbers by their names.
    fn of(images: &HashMap<String, HashMap<usize, Sighting>>, tracks: &HashMap<String, usize>) -> Self {
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
        Self { names, track_count: tracks.len(), seen }
    }

    /// Sightings of the tracks that two images share, in the order of the tracks.
    fn common(&self, i: usize, j: usize) -> impl Iterator<Item = (&Sighting, &Sighting)> {
        let mut others = self.seen[j].iter().peekable();
        self.seen[i].iter().filter_map(move |(track, seen)| {
            while others.next_if(|(other, _)| other < track).is_some() {}
            others.next_if(|(other, _)| other == track).map(|(_, other)| (seen, other))
        })
    }

    /// What two images share.
    fn shared(&self, i: usize, j: usize) -> Option<ImagePair> {
        let of = |((pa, sa), (pb, sb)): (&Sighting, &Sighting)| {
            // The model has one deviation for both images of a match.
            let sigma_px = (0.5 * (sa * sa + sb * sb)).sqrt();
            PointMatch { sigma_px, ..PointMatch::new(*pa, *pb) }
        };
        let matches: Vec<PointMatch> = self.common(i, j).map(of).collect();
        (!matches.is_empty()).then_some(ImagePair { from: i, to: j, matches })
    }

    /// The matches of pairs; of very many tracks some, the same in all images.
    fn matches_of(&mut self, pairs: &[(usize, usize)], most: usize) -> (Vec<ImagePair>, Option<Note>) {
        let total: usize = pairs.iter().map(|(i, j)| self.common(*i, *j).count()).sum();
        let note = (total > most).then(|| {
            let part = most as f64 / total as f64;
            // Not every n-th: names may run along the rows of a grid. A hash of the place is as good as a draw, and always the same.
            let kept = |track: usize| (mixed(track as u64) as f64) < part * u64::MAX as f64;
            for seen in &mut self.seen {
                seen.retain(|(track, _)| kept(*track));
            }
            let what = format!(
                "{total} matches in {} pairs: {:.1} % of the {} tracks are used, which take part in all of their images",
                pairs.len(),
                100.0 * part,
                self.track_count
            );
            Note::all(Note::THINNED_TRACKS, what)
        });
        (pairs.iter().filter_map(|(i, j)| self.shared(*i, *j)).collect(), note)
    }

    /// All pairs of a small set, else neighbours.
    pub(crate) fn near(mut self, all_pairs_limit: usize) -> Result<PointPairs, String> {
        let neighbours_only = self.names.len() > all_pairs_limit;
        let pairs = self.near_pairs(all_pairs_limit);
        let found = self.matches_of(&pairs, MAX_MATCHES);
        self.finish(found, neighbours_only, None)
    }

    fn near_pairs(&self, all_pairs_limit: usize) -> Vec<(usize, usize)> {
        let count = self.names.len();
        let reach = if count > all_pairs_limit { 3 } else { count };
        let mut pairs = Vec::new();
        for i in 0..count {
            pairs.extend((i + 1..count.min(i + 1 + reach)).map(|j| (i, j)));
            // The last image meets the first where a turn closes.
            if i == 0 && count > reach + 1 {
                pairs.push((0, count - 1));
            }
        }
        pairs
    }

    /// The pairs of a list, and those near beside them.
    pub(crate) fn listed(mut self, list: Vec<(usize, usize)>, all_pairs_limit: usize) -> Result<PointPairs, String> {
        // The order of the images, as `near` has it.
        let mut ordered: Vec<(usize, usize)> = list.iter().map(|(i, j)| (*i.min(j), *i.max(j))).collect();
        if ordered.iter().all(|&(i, j)| self.common(i, j).next().is_none()) {
            return self.finish((Vec::new(), None), false, Some(list));
        }
        ordered.extend(self.near_pairs(all_pairs_limit));
        ordered.sort_unstable();
        ordered.dedup();
        let found = self.matches_of(&ordered, MAX_MATCHES);
        self.finish(found, false, Some(list))
    }

    fn finish(
        self,
        (pairs, note): (Vec<ImagePair>, Option<Note>),
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
        let notes = note.into_iter().collect();
        Ok(PointPairs { names: self.names, pairs, neighbours_only, listed, notes })
    }
}

/// What an image sees of tracks: pairs of a track's name and its place there, in pixels.
#[derive(Debug, Clone)]
pub struct TracksOfImage {
    /// Its name.
    pub image: String,
    /// Names of the tracks that it sees, each once.
    pub tracks: Vec<String>,
    /// Where it sees them, pixels.
    pub points: Vec<[f64; 2]>,
}

/// Pairs of images that share tracks, as [`super::read_matches`] makes them of a table: all pairs up to so many images, else neighbours.
///
/// # Errors
/// What is wrong with the tracks, in words.
pub fn pairs_of_tracks(images: &[TracksOfImage], all_pairs_limit: usize) -> Result<PointPairs, String> {
    let mut tracks: HashMap<String, usize> = HashMap::new();
    let mut seen: HashMap<String, HashMap<usize, Sighting>> = HashMap::new();
    for of in images {
        let mut here = HashMap::with_capacity(of.tracks.len());
        for (track, point) in of.tracks.iter().zip(&of.points) {
            let next = tracks.len();
            let number = *tracks.entry(track.clone()).or_insert(next);
            if here.insert(number, (*point, 1.0)).is_some() {
                return Err(format!("track {} appears twice in image {}", plain(track), plain(&of.image)));
            }
        }
        if seen.insert(of.image.clone(), here).is_some() {
            return Err(format!("image {} is there twice", plain(&of.image)));
        }
    }
    if images.len() > MAX_IMAGES {
        return Err(format!("more than {MAX_IMAGES} images. Give fewer at a time"));
    }
    Tracks::of(&seen, &tracks).near(all_pairs_limit)
}

/// A number with all of its bits mixed (SplitMix64).
fn mixed(number: u64) -> u64 {
    let z = number.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn very_many_tracks_are_thinned_alike_in_all_images() {
        let sighting = |t: usize| (t, ([t as f64, 1.0], 1.0));
        let seen: Vec<_> = (0..4).map(|_| (0..1000).map(sighting).collect()).collect();
        let names = (0..4).map(|i| format!("{i}")).collect();
        let mut tracks = Tracks { names, track_count: 1000, seen };
        let pairs = [(0, 1), (0, 3), (1, 2)];
        let (whole, note) = tracks.matches_of(&pairs, 3000);
        assert!(note.is_none() && whole.iter().all(|p| p.matches.len() == 1000));
        let (some, note) = tracks.matches_of(&pairs, 600);
        assert!(note.unwrap().to_string().contains("3000 matches in 3 pairs: 20.0 % of the 1000 tracks"));
        // 200 of 1000, within four standard deviations of a draw.
        assert!(some.iter().all(|p| p.matches == some[0].matches && p.matches.len().abs_diff(200) < 51));
    }
}
