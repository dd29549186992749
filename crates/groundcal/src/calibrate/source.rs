//! What a calibration is made from: images, images with matches, matches, or homographies. Each is checked here and enters the
//! driver at its place.
//!
//! What stands still in all images (a bumper, the background of a turntable, a date stamp) is set aside here, once for all: it matches better
//! than any floor. Pair by pair it can be told from what moves only where the matches of both lie on planes ([`crate::pairs::robust`]).

use std::{
    borrow::Cow,
    cmp::Reverse,
    collections::{BTreeSet, HashMap, HashSet},
};

use nalgebra::Vector2;
use rayon::prelude::*;

use crate::{
    calibrate::{
        options::Options,
        order::{by_content, content_key},
        stage_options::SourceTraits,
    },
    error::Error,
    geometry::size::ImageSize,
    ids::PairId,
    observer::{Observer, Stage},
    pairs::{
        correspondence::{ImagePair, validated},
        observation::PairObservation,
        pair_lens::RadialCorrection,
        refine::HomographyEstimate,
    },
    result::Warning,
    vision::{
        features::{FeatureOptions, Features, MatchOptions, detect_until, match_features_until},
        image::GrayImage,
        still::still_parts,
    },
};

/// A homography from elsewhere between two images, by their indices.
pub(super) type GivenHomography = (usize, usize, HomographyEstimate);

/// Fewest matches on a plane where nothing is said: of features, and of matches given.
const MIN_FEATURES_ON_PLANE: usize = 15;
const MIN_MATCHES_ON_PLANE: usize = 6;
/// Neighbours that an image of many is compared with.
const NEIGHBOURS: usize = 3;
/// Of many images each is compared with those, so many, with which most of its strongest features, so many, match.
const LIKELY_PARTNERS: usize = 6;
const FEW_FEATURES: usize = 200;

/// What the driver is given.
pub(super) struct Source<'a> {
    /// A name for each image index.
    pub(super) names: &'a [String],
    /// The images, where there are any.
    pub(super) images: Option<Cow<'a, [GrayImage]>>,
    /// What is known of each pair.
    pub(super) pairs: GivenPairs,
    /// What it decides of the options.
    pub(super) traits: SourceTraits,
    /// Doubts about it.
    pub(super) warnings: Vec<Warning>,
}

/// Where pairs enter.
pub(super) enum GivenPairs {
    /// Matches, checked.
    Matches(Vec<ImagePair>),
    /// Planes fitted elsewhere.
    Planes(Vec<PairObservation>),
}

/// Images alone, ready for features: without what stands still in all of them, and with the pairs that are to be compared.
pub(super) struct PreparedImages<'a> {
    names: &'a [String],
    images: Cow<'a, [GrayImage]>,
    /// Those named first.
    pairs: Vec<(usize, usize)>,
    named: Option<usize>,
    /// There are too many to compare all; which pairs are likely their features tell.
    many: bool,
    warnings: Vec<Warning>,
}

/// Images alone.
///
/// # Errors
/// See [`Error`].
pub(super) fn from_images<'a>(
    names: &'a [String],
    images: &'a [GrayImage],
    options: &Options,
    observer: &dyn Observer,
) -> Result<PreparedImages<'a>, Error> {
    let size = one_size(names, images)?;
    options.validate(size)?;
    let (images, still) = without_still_parts(images, observer)?;
    let mut warnings: Vec<Warning> = still.into_iter().collect();
    let named = options.pairs.as_deref().map(|pairs| checked_names(pairs, images.len())).transpose()?;
    if named.is_none() && images.len() > options.all_pairs_limit {
        warnings.push(Warning::NeighboursOnly { images: images.len() });
    }
    let copies = copies(&images);
    warnings.extend(warnings_of(&copies, names));
    let mut pairs = named.map_or(Vec::new(), <[_]>::to_vec);
    if named.is_none() || options.has_links_beside_named_pairs() {
        // A picture under two names is one picture; where there is no other, matching it says best what is wrong.
        let all_alike = named.is_none() && copies.iter().filter(|c| c.is_none()).count() < 2;
        let once = |&(a, b): &(usize, usize)| all_alike || (copies[a].is_none() && copies[b].is_none());
        let known: HashSet<(usize, usize)> = pairs.iter().map(|&(a, b)| (a.min(b), a.max(b))).collect();
        let others: Vec<(usize, usize)> =
            candidate_pairs(images.len(), options).into_iter().filter(|p| once(p) && !known.contains(p)).collect();
        if images.len() > options.all_pairs_limit {
            pairs.extend(others);
        } else {
            pairs.extend(by_content(&others, &images.par_iter().map(content_key).collect::<Vec<_>>()));
        }
    }
    if pairs.is_empty() {
        return Err(Error::TooFewImages { found: copies.iter().filter(|c| c.is_none()).count() });
    }
    let many = images.len() > options.all_pairs_limit && (named.is_none() || options.has_links_beside_named_pairs());
    Ok(PreparedImages { names, images, pairs, named: named.map(<[_]>::len), many, warnings })
}

impl<'a> PreparedImages<'a> {
    /// Images that an answer should have a view of: all but copies, or those of the pairs named.
    pub(super) fn images_expected(&self) -> usize {
        let pairs = self.pairs.iter().take(self.named.unwrap_or(usize::MAX));
        pairs.flat_map(|&(a, b)| [a, b]).collect::<HashSet<usize>>().len()
    }

    /// Their features and the matches of these.
    ///
    /// # Errors
    /// See [`Error`].
    pub(super) fn matched(
        &self,
        features: &FeatureOptions,
        options: &Options,
        observer: &dyn Observer,
    ) -> Result<Source<'a>, Error> {
        let features = features_of(&self.images, features, observer)?;
        let mut pairs = self.pairs.clone();
        if self.many {
            pairs.extend(likely_pairs(&features, &pairs, observer)?);
        }
        let matched = matched(&features, &pairs, observer)?;
        of_images(self.names, self.images.clone(), (matched, self.named), options, self.warnings.clone())
    }
}

/// The features of each image.
fn features_of(
    images: &[GrayImage],
    options: &FeatureOptions,
    observer: &dyn Observer,
) -> Result<Vec<Features>, Error> {
    observer.map(Stage::Features, images, |image| detect_until(image, options, observer))
}

/// The matches of each pair.
fn matched(features: &[Features], pairs: &[(usize, usize)], observer: &dyn Observer) -> Result<Vec<ImagePair>, Error> {
    observer.map(Stage::Matching, pairs, |&(from, to)| {
        let matches = match_features_until(&features[from], &features[to], &MatchOptions::default(), observer)?;
        Ok(ImagePair { from, to, matches })
    })
}

/// Matches of the features of pairs of images, of which what stands still in all of them is set aside.
///
/// # Errors
/// See [`Error`].
pub(super) fn matches_of_images(
    images: &[GrayImage],
    pairs: &[(usize, usize)],
    options: &Options,
    observer: &dyn Observer,
) -> Result<Vec<ImagePair>, Error> {
    let pairs = checked_names(pairs, images.len())?;
    let (images, _) = without_still_parts(images, observer)?;
    matched(&features_of(&images, &options.features(), observer)?, pairs, observer)
}

/// Images with matches between them. Matches of what is not used of an image are left out.
///
/// # Errors
/// See [`Error`].
pub(super) fn from_matched_images<'a>(
    names: &'a [String],
    images: &'a [GrayImage],
    pairs: &[ImagePair],
    options: &Options,
    observer: &dyn Observer,
) -> Result<Source<'a>, Error> {
    let size = one_size(names, images)?;
    options.validate(size)?;
    let (images, still) = without_still_parts(images, observer)?;
    let (mut known, named) = named_first(names, pairs, options)?;
    for pair in &mut known {
        let used = |image: usize, at: Vector2<f64>| images[image].used_about(at.x, at.y, 0.0) > 0.5;
        let (from, to) = (pair.from, pair.to);
        pair.matches.retain(|m| used(from, m.a) && used(to, m.b));
    }
    let warnings = still.into_iter().chain(warnings_of(&copies(&images), names)).collect();
    of_images(names, images, (known, named), options, warnings)
}

/// The images without what stands still in all of them, which the observer hears of.
fn without_still_parts<'a>(
    images: &'a [GrayImage],
    observer: &dyn Observer,
) -> Result<(Cow<'a, [GrayImage]>, Option<Warning>), Error> {
    let Some(found) = still_parts(images, observer)? else { return Ok((Cow::Borrowed(images), None)) };
    let warning = Warning::StillInAllImages { percent: 100.0 * found.share };
    observer.notice(&warning);
    Ok((Cow::Owned(found.set_aside(images)?), Some(warning)))
}

/// Matches without images.
///
/// # Errors
/// See [`Error`].
pub(super) fn from_matches<'a>(
    names: &'a [String],
    size: ImageSize,
    pairs: &[ImagePair],
    options: &Options,
) -> Result<Source<'a>, Error> {
    check_size(size)?;
    options.validate(size)?;
    if names.len() < 2 {
        return Err(Error::TooFewImages { found: names.len() });
    }
    let (pairs, named) = named_first(names, pairs, options)?;
    let traits = SourceTraits {
        size,
        named,
        min_plane_matches: MIN_MATCHES_ON_PLANE,
        has_images: false,
        has_matches: true,
        sequence: false,
        background_set_aside: false,
    };
    let pairs = GivenPairs::Matches(checked(names, pairs, size)?);
    Ok(Source { names, images: None, pairs, traits, warnings: Vec::new() })
}

/// Homographies, all of them motions.
///
/// # Errors
/// See [`Error`].
pub(super) fn from_homographies<'a>(
    names: &'a [String],
    size: ImageSize,
    homographies: &[GivenHomography],
    options: &Options,
) -> Result<Source<'a>, Error> {
    check_size(size)?;
    options.validate(size)?;
    if !options.distortion.is_none() {
        return Err(Error::InvalidOption("a lens distortion cannot be undone in homographies".into()));
    }
    if options.radial != RadialCorrection::None {
        return Err(Error::InvalidOption("a radial distortion cannot be corrected in homographies".into()));
    }
    if homographies.is_empty() {
        return Err(Error::InvalidInput("no homographies at all".into()));
    }
    let frame = options.frame(size);
    let observation = |(i, (from, to, estimate)): (usize, &GivenHomography)| {
        if *from >= names.len() || *to >= names.len() || from == to {
            return Err(Error::InvalidInput(format!("homography {i} from {from} to {to} of {} images", names.len())));
        }
        if !estimate.covariance.iter().all(|v| v.is_finite()) {
            return Err(Error::InvalidInput(format!("homography {i} has a covariance that is not finite")));
        }
        if estimate.frame != frame {
            return Err(Error::InvalidInput(format!(
                "homography {i} has its covariance in a frame of another image size or principal point"
            )));
        }
        Ok(PairObservation::of_homography(PairId::new(i), [(*from).into(), (*to).into()], estimate.clone()))
    };
    let pairs = homographies.iter().enumerate().map(observation).collect::<Result<_, _>>()?;
    let traits = SourceTraits {
        size,
        // They are given as motions.
        named: Some(homographies.len()),
        min_plane_matches: 0,
        has_images: false,
        has_matches: false,
        sequence: false,
        background_set_aside: false,
    };
    Ok(Source { names, images: None, pairs: GivenPairs::Planes(pairs), traits, warnings: Vec::new() })
}

fn of_images<'a>(
    names: &'a [String],
    images: Cow<'a, [GrayImage]>,
    (matched, named): (Vec<ImagePair>, Option<usize>),
    options: &Options,
    warnings: Vec<Warning>,
) -> Result<Source<'a>, Error> {
    let needed = options.min_plane_matches.unwrap_or(MIN_FEATURES_ON_PLANE);
    if let [only] = matched.as_slice()
        && only.matches.len() < 4
    {
        return Err(Error::NoCommonPlane { pairs: 1, best: only.matches.len(), needed });
    }
    let size = images[0].size();
    // Few images may be in any order.
    let sequence = images.len() > options.all_pairs_limit;
    let traits = SourceTraits {
        size,
        named,
        min_plane_matches: MIN_FEATURES_ON_PLANE,
        has_images: true,
        has_matches: true,
        sequence,
        background_set_aside: warnings.iter().any(|w| matches!(w, Warning::StillInAllImages { .. })),
    };
    let pairs = GivenPairs::Matches(checked(names, matched, size)?);
    Ok(Source { names, images: Some(images), pairs, traits, warnings })
}

/// The one size of the images.
fn one_size(names: &[String], images: &[GrayImage]) -> Result<ImageSize, Error> {
    if names.len() != images.len() {
        return Err(Error::InvalidInput(format!("{} names for {} images", names.len(), images.len())));
    }
    if images.len() < 2 {
        return Err(Error::TooFewImages { found: images.len() });
    }
    let size = images[0].size();
    if size.width < 2 || size.height < 2 {
        return Err(Error::InvalidInput(format!("{} is {size} pixels: nothing can be seen in it", names[0])));
    }
    if let Some(other) = images.iter().position(|i| i.size() != size) {
        return Err(Error::InvalidInput(format!(
            "{} is {} pixels, {} is {size}: all images must come from one camera at one size",
            names[other],
            images[other].size(),
            names[0],
        )));
    }
    Ok(size)
}

fn check_size(size: ImageSize) -> Result<(), Error> {
    if size.width < 2 || size.height < 2 {
        return Err(Error::InvalidInput(format!("an image size of {size} pixels")));
    }
    Ok(())
}

/// For each image the earlier one that it is a copy of.
fn copies(images: &[GrayImage]) -> Vec<Option<usize>> {
    (0..images.len()).map(|j| (0..j).find(|&i| images[i] == images[j])).collect()
}

fn warnings_of(copies: &[Option<usize>], names: &[String]) -> Vec<Warning> {
    let warning = |(j, original): (usize, &Option<usize>)| {
        let first = names[(*original)?].clone();
        Some(Warning::DuplicateImages { first, second: names[j].clone() })
    };
    copies.iter().enumerate().filter_map(warning).collect()
}

/// The pairs named, if they name images.
fn checked_names(pairs: &[(usize, usize)], images: usize) -> Result<&[(usize, usize)], Error> {
    if pairs.is_empty() {
        return Err(Error::InvalidOption("the list of pairs is empty".into()));
    }
    let mut known = HashSet::new();
    for &(a, b) in pairs {
        if a >= images || b >= images || a == b {
            return Err(Error::InvalidOption(format!("pair ({a}, {b}) does not name two of the {images} images")));
        }
        if !known.insert((a.min(b), a.max(b))) {
            return Err(Error::InvalidOption(format!("pair ({a}, {b}) is given twice")));
        }
    }
    Ok(pairs)
}

/// The pairs of images to be compared: all of few images, neighbours of many.
fn candidate_pairs(images: usize, options: &Options) -> Vec<(usize, usize)> {
    let all = images <= options.all_pairs_limit;
    let reach = if all { images } else { NEIGHBOURS };
    let mut pairs: Vec<(usize, usize)> =
        (0..images).flat_map(|a| (a + 1..images.min(a + 1 + reach)).map(move |b| (a, b))).collect();
    if !all {
        // A closed turn ends where it began.
        pairs.push((0, images - 1));
    }
    pairs
}

/// Pairs of many images that look alike, beside those known: of each image the ones with which most of its strongest features match. Pictures of one
/// floor share some by chance; that costs time and no more.
fn likely_pairs(
    features: &[Features],
    known: &[(usize, usize)],
    observer: &dyn Observer,
) -> Result<Vec<(usize, usize)>, Error> {
    let few: Vec<Features> = features.iter().map(|features| features.strongest(FEW_FEATURES)).collect();
    let compared: BTreeSet<usize> = known.iter().flat_map(|&(a, b)| [a, b]).collect();
    let all: Vec<(usize, usize)> =
        compared.iter().flat_map(|&a| compared.range(a + 1..).map(move |&b| (a, b))).collect();
    let counts = observer.map(Stage::Candidates, &all, |&(a, b)| {
        match_features_until(&few[a], &few[b], &MatchOptions::default(), observer).map(|matches| matches.len())
    })?;
    let mut partners: Vec<Vec<(usize, usize)>> = vec![Vec::new(); features.len()];
    for (&(a, b), &count) in all.iter().zip(&counts) {
        partners[a].push((count, b));
        partners[b].push((count, a));
    }
    let known: HashSet<(usize, usize)> = known.iter().map(|&(a, b)| (a.min(b), a.max(b))).collect();
    let mut likely = BTreeSet::new();
    for (image, partners) in partners.iter_mut().enumerate() {
        partners.sort_by_key(|&(count, other)| (Reverse(count), other));
        let best = partners.iter().take(LIKELY_PARTNERS).filter(|(count, _)| *count > 0);
        likely
            .extend(best.map(|&(_, other)| (image.min(other), image.max(other))).filter(|pair| !known.contains(pair)));
    }
    Ok(likely.into_iter().collect())
}

/// Given pairs, those that the options name first, and how many these are.
fn named_first(
    names: &[String],
    pairs: &[ImagePair],
    options: &Options,
) -> Result<(Vec<ImagePair>, Option<usize>), Error> {
    let index_ok = |p: &ImagePair| p.from < names.len() && p.to < names.len() && p.from != p.to;
    if let Some(bad) = pairs.iter().find(|p| !index_ok(p)) {
        return Err(Error::InvalidInput(format!("a pair ({}, {}) of {} images", bad.from, bad.to, names.len())));
    }
    if pairs.is_empty() {
        return Err(Error::InvalidInput("no matches at all".into()));
    }
    let Some(wanted) = &options.pairs else { return Ok((pairs.to_vec(), None)) };
    let wanted = checked_names(wanted, names.len())?;
    let of = |a: usize, b: usize| (a.min(b), a.max(b));
    let mut known: HashMap<(usize, usize), &ImagePair> = HashMap::with_capacity(pairs.len());
    for pair in pairs {
        known.entry(of(pair.from, pair.to)).or_insert(pair);
    }
    let mut named = Vec::with_capacity(pairs.len());
    for &(a, b) in wanted {
        let Some(pair) = known.get(&of(a, b)) else {
            let [a, b] = [a, b].map(|i| &names[i]);
            return Err(Error::InvalidInput(format!("no matches between {a} and {b}, which the pairs name")));
        };
        named.push((*pair).clone());
    }
    if options.has_links_beside_named_pairs() {
        let is_named: HashSet<(usize, usize)> = wanted.iter().map(|&(a, b)| of(a, b)).collect();
        named.extend(pairs.iter().filter(|p| !is_named.contains(&of(p.from, p.to))).cloned());
    }
    Ok((named, Some(wanted.len())))
}

/// The pairs with their matches checked and without repetitions.
fn checked(names: &[String], pairs: Vec<ImagePair>, size: ImageSize) -> Result<Vec<ImagePair>, Error> {
    let given = pairs.first().map_or(0, |pair| pair.matches.len());
    let different = |pair: ImagePair| Ok(ImagePair { matches: validated(&pair.matches, size)?, ..pair });
    let pairs = pairs.into_iter().map(different).collect::<Result<Vec<_>, Error>>()?;
    if let [only] = pairs.as_slice()
        && only.matches.len() < 4
    {
        return Err(Error::TooFewMatches {
            from: names[only.from].clone(),
            to: names[only.to].clone(),
            given,
            found: only.matches.len(),
        });
    }
    Ok(pairs)
}
