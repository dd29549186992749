//! Pictures that are copies of each other count once.
//!
//! ```text
//! |b - a| < 0.1 px for nine of ten matches of a pair in which nothing moved     the two pictures are one
//! nine of ten matches of two pairs are the same numbers                         their first pictures are one, and their second
//! ```
//!
//! A picture under a second name (saved again, in another format, twice in a list of matches) has the same errors again. Taken for a picture
//! of its own it makes the residuals and the error bars too small, and a single motion to several that agree.

use std::{
    collections::{HashMap, HashSet},
    hash::{DefaultHasher, Hash, Hasher},
};

use crate::{
    ids::ImageId,
    pairs::{
        correspondence::PointMatch,
        observation::{PairObservation, Refusal, RefusalKind},
    },
};

/// Displacement below which a match joins a point to itself, pixels. (Nine of ten features of four photographs saved again as JPEGs of quality
/// 90 to 95 are displaced by 0.006 to 0.12, of quality 75 by 0.2 to 0.7; with the noise of another exposure, of one to three grey levels,
/// by 0.07 to 0.7.)
const DISPLACED_PX: f64 = 0.1;
/// Part of the matches that must say so: the rest are wrong matches, or things that moved.
const MIN_UNMOVED_FRACTION: f64 = 0.9;
/// Matches of a pair that are compared with those of others: of a hundred in common all have the same least keys.
const SKETCH_SIZE: usize = 64;
/// Matches that two pairs must have in common: by chance they have none.
const MIN_COMMON_MATCHES: usize = 4;

/// Where images are copies of others, several pairs are of the same two pictures; one of them is left to show a motion. It is the pair of the two
/// originals if there is one, else the pair of most matches. The original of several copies is the first by `order`, which does not depend on
/// their names. Returns [original, copy] for each image that is a copy.
pub(super) fn count_once(
    pairs: &mut [PairObservation],
    order: impl Fn(ImageId) -> (u64, ImageId),
    name: impl Fn(ImageId) -> String,
) -> Vec<[ImageId; 2]> {
    let mut pictures = Pictures::default();
    for pair in pairs.iter().filter(|pair| is_of_one_picture(pair)) {
        pictures.join(pair.images());
    }
    for images in same_under_other_names(pairs) {
        pictures.join(images);
    }
    if pictures.joined.is_empty() {
        return Vec::new();
    }
    let copies = pictures.copies(order);
    let worth = |pair: &PairObservation| {
        let originals = pair.images().iter().all(|image| copies.iter().all(|[_, copy]| copy != image));
        (originals, pair.inliers().count())
    };
    let mut best: HashMap<[ImageId; 2], usize> = HashMap::new();
    for (p, pair) in pairs.iter().enumerate() {
        let kept = best.entry(pictures.of(pair)).or_insert(p);
        if worth(pair) > worth(&pairs[*kept]) {
            *kept = p;
        }
    }
    for p in 0..pairs.len() {
        let kept = best[&pictures.of(&pairs[p])];
        if kept != p && pairs[p].geometry().is_some() {
            let [a, b] = pairs[kept].images().map(&name);
            let reason = format!("the pictures are those of {a} and {b} again, and count once");
            pairs[p].outcome = Err(Refusal::new(RefusalKind::Repeated, reason, None));
        }
    }
    copies
}

/// Sets of images that are one picture, by their members.
#[derive(Default)]
struct Pictures {
    joined: HashMap<ImageId, ImageId>,
}

impl Pictures {
    fn of_image(&self, image: ImageId) -> ImageId {
        self.joined.get(&image).copied().unwrap_or(image)
    }

    /// The two pictures of a pair, in either order alike.
    fn of(&self, pair: &PairObservation) -> [ImageId; 2] {
        let mut both = pair.images().map(|image| self.of_image(image));
        both.sort_unstable();
        both
    }

    fn join(&mut self, images: [ImageId; 2]) {
        let [a, b] = images.map(|image| self.of_image(image));
        let (to, from) = (a.min(b), a.max(b));
        self.joined.values_mut().filter(|set| **set == from).for_each(|set| *set = to);
        self.joined.extend([(a, to), (b, to), (images[0], to), (images[1], to)]);
    }

    /// Each image but the first of its picture, after that.
    fn copies(&self, order: impl Fn(ImageId) -> (u64, ImageId)) -> Vec<[ImageId; 2]> {
        let mut first: HashMap<ImageId, ImageId> = HashMap::new();
        for (&image, &set) in &self.joined {
            let kept = first.entry(set).or_insert(image);
            *kept = std::cmp::min_by_key(*kept, image, |&i| order(i));
        }
        let copy = |(&image, set): (&ImageId, &ImageId)| (first[set] != image).then_some([first[set], image]);
        let mut copies: Vec<[ImageId; 2]> = self.joined.iter().filter_map(copy).collect();
        copies.sort_unstable_by_key(|[_, copy]| *copy);
        copies
    }
}

/// Nothing moved between the images of a pair, not even by what another exposure does.
fn is_of_one_picture(pair: &PairObservation) -> bool {
    let Some(plane) = pair.plane().filter(|plane| plane.is_static) else { return false };
    let stays = |k: &&usize| (pair.matches[**k].b - pair.matches[**k].a).norm() < DISPLACED_PX;
    let staying = plane.inliers.iter().filter(stays).count();
    staying >= MIN_COMMON_MATCHES && staying as f64 >= MIN_UNMOVED_FRACTION * plane.inliers.len() as f64
}

/// Images that stand for each other in pairs that have their matches in common.
fn same_under_other_names(pairs: &[PairObservation]) -> Vec<[ImageId; 2]> {
    let sketches: Vec<Vec<u64>> = pairs.iter().map(sketch).collect();
    // With the first that has a match each other is compared, not all with all.
    let mut first_with: HashMap<u64, usize> = HashMap::new();
    let mut in_common: HashMap<[usize; 2], usize> = HashMap::new();
    for (p, keys) in sketches.iter().enumerate() {
        for key in keys {
            match first_with.get(key) {
                Some(&q) => *in_common.entry([q, p]).or_default() += 1,
                None => drop(first_with.insert(*key, p)),
            }
        }
    }
    let alike = in_common.into_iter().filter(|&([p, q], common)| {
        let fewer = sketches[p].len().min(sketches[q].len());
        common >= MIN_COMMON_MATCHES && common as f64 >= MIN_UNMOVED_FRACTION * fewer as f64
    });
    alike.flat_map(|([p, q], _)| corresponding(&pairs[p], &pairs[q])).collect()
}

/// Which images of two pairs with the same matches are each other's copies.
fn corresponding(p: &PairObservation, q: &PairObservation) -> [[ImageId; 2]; 2] {
    let firsts: HashSet<u64> = p.matches.iter().map(|m| key(&[m.a.x, m.a.y, m.b.x, m.b.y])).collect();
    let alike = q.matches.iter().filter(|m| firsts.contains(&key(&[m.a.x, m.a.y, m.b.x, m.b.y]))).count();
    if 2 * alike >= p.matches.len().min(q.matches.len()) {
        [[p.from, q.from], [p.to, q.to]]
    } else {
        [[p.from, q.to], [p.to, q.from]]
    }
}

/// The least keys of a pair's matches, whichever of its images is the first (the least of random numbers are a sample that two sets have
/// in common as far as they are alike: Broder 1997, *On the resemblance and containment of documents*).
fn sketch(pair: &PairObservation) -> Vec<u64> {
    let of_match = |m: &PointMatch| key(&[m.a.x, m.a.y, m.b.x, m.b.y]).wrapping_add(key(&[m.b.x, m.b.y, m.a.x, m.a.y]));
    let mut keys: Vec<u64> = pair.matches.iter().map(of_match).collect();
    if keys.len() > SKETCH_SIZE {
        keys.select_nth_unstable(SKETCH_SIZE);
        keys.truncate(SKETCH_SIZE);
    }
    keys.sort_unstable();
    keys.dedup();
    keys
}

/// A number that a match has.
fn key(numbers: &[f64; 4]) -> u64 {
    let mut hasher = DefaultHasher::new();
    numbers.map(f64::to_bits).hash(&mut hasher);
    hasher.finish()
}
