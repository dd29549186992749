//! The order of the images of an unordered set plays no part in what is estimated.
//!
//! Which of two images lends the templates of the patches, and in which order pairs are tried, would else follow the names of the files.
//! Both follow the pictures themselves instead: pairs lead from the image of the lesser key ([`content_key`]) to the other, and stand in the
//! order of these keys. What is reported leads from the earlier image to the later again ([`in_order_of_images`]).

use crate::{
    pairs::{
        observation::{PairObservation, carried},
        placed_lens::PlacedLens,
    },
    result::{Calibration, MotionReport, evidence::PairEvidence},
    vision::image::GrayImage,
};
use nalgebra::{Matrix3, Vector2};

use crate::geometry::homography::Homography;

/// A number that an image has whatever its name and place (FNV-1a over its values and width).
pub(super) fn content_key(image: &GrayImage) -> u64 {
    let mix = |hash: u64, word: u64| (hash ^ word).wrapping_mul(0x0000_0100_0000_01b3);
    let start = mix(0xcbf2_9ce4_8422_2325, image.width() as u64);
    image.data().iter().fold(start, |hash, value| mix(hash, u64::from(value.to_bits())))
}

/// Pairs of images, each leading from the lesser key to the greater, in the order of their keys. Equal images keep the order they came in.
pub(super) fn by_content(pairs: &[(usize, usize)], keys: &[u64]) -> Vec<(usize, usize)> {
    let key = |image: usize| (keys[image], image);
    let oriented = pairs.iter().map(|&(a, b)| if key(a) <= key(b) { (a, b) } else { (b, a) });
    let mut ordered: Vec<(usize, usize)> = oriented.collect();
    ordered.sort_by_key(|&(a, b)| (key(a), key(b)));
    ordered
}

/// The same calibration with its pairs leading from the earlier image to the later, in that order; the `first` ones, which the user names,
/// stay as they are.
pub(super) fn in_order_of_images(calibration: Calibration, pairs: &[PairObservation], first: usize) -> Calibration {
    let mut order: Vec<usize> = (0..pairs.len()).collect();
    let images = |i: usize| {
        let [a, b] = pairs[i].images();
        (a.min(b), a.max(b))
    };
    order[first.min(pairs.len())..].sort_by_key(|&i| images(i));
    let mut place = vec![0; pairs.len()];
    order.iter().enumerate().for_each(|(to, &from)| place[from] = to);
    let mut calibration = calibration;
    let lens = calibration.evidence.lens;
    let backwards = |i: usize| i >= first && pairs[i].from > pairs[i].to;
    let motions = std::mem::take(&mut calibration.motions);
    let evidence = std::mem::take(&mut calibration.evidence.pairs);
    let motions: Vec<MotionReport> =
        motions.into_iter().enumerate().map(|(i, m)| if backwards(i) { reversed_motion(m) } else { m }).collect();
    let evidence: Vec<PairEvidence> = evidence
        .into_iter()
        .enumerate()
        .map(|(i, e)| if backwards(i) { reversed_evidence(e, lens.as_ref()) } else { e })
        .collect();
    calibration.motions = order.iter().filter_map(|&i| motions.get(i).cloned()).collect();
    calibration.evidence.pairs = order.iter().filter_map(|&i| evidence.get(i).cloned()).collect();
    for attitude in &mut calibration.attitudes {
        attitude.motions.iter_mut().for_each(|m| *m = place[*m]);
        attitude.motions.sort_unstable();
    }
    calibration
}

fn reversed_motion(m: MotionReport) -> MotionReport {
    MotionReport {
        // Turns about no floor's normal have no sign.
        rotation_deg: m.rotation_deg.map(|deg| if m.attitude.is_some() { -deg } else { deg }),
        height_ratio_sigma: m
            .height_ratio_sigma
            .zip(m.height_ratio)
            .map(|(sigma, height_ratio)| sigma / (height_ratio * height_ratio)),
        height_ratio: m.height_ratio.map(|height_ratio| 1.0 / height_ratio),
        from: m.to,
        to: m.from,
        ..m
    }
}

fn reversed_evidence(e: PairEvidence, lens: Option<&PlacedLens>) -> PairEvidence {
    let forward = e.h_b_from_a.and_then(|h| Homography::new(Matrix3::from_fn(|r, c| h[r][c])).ok());
    let back = forward.map(|h| h.inverse());
    let point = |p: [f64; 2]| Vector2::new(p[0], p[1]);
    let matches = e.matches.into_iter().map(|m| {
        let distance = back.and_then(|h| carried(&h, &point(m.b), lens)).map(|a| (a - point(m.a)).norm());
        crate::result::evidence::MatchEvidence { a: m.b, b: m.a, distance_px: distance, ..m }
    });
    PairEvidence {
        images: [e.images[1], e.images[0]],
        matches: matches.collect(),
        h_b_from_a: back.map(|h| std::array::from_fn(|r| std::array::from_fn(|c| h.matrix()[(r, c)]))),
        // The other of the two.
        circular_point: e.circular_point.map(|p| p.map(|[re, im]| [re, -im])),
        lost_patches: match forward {
            Some(h) => e.lost_patches.iter().filter_map(|p| carried(&h, &point(*p), lens)).map(Into::into).collect(),
            None => Vec::new(),
        },
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::size::ImageSize;

    #[test]
    fn pairs_follow_the_pictures_and_not_their_order() {
        let size = ImageSize::new(4, 3);
        let image = |seed: usize| {
            let values = (0..12).map(|i| ((i * 7 + seed * 5) % 11) as f32 / 11.0).collect();
            GrayImage::from_rows(size, values).expect("right size")
        };
        let images: Vec<GrayImage> = (0..5).map(image).collect();
        let shuffled = [3, 0, 4, 2, 1];
        let all: Vec<(usize, usize)> = (0..5).flat_map(|a| (a + 1..5).map(move |b| (a, b))).collect();
        let pairs = by_content(&all, &images.iter().map(content_key).collect::<Vec<_>>());
        let again = by_content(&all, &shuffled.map(|i: usize| content_key(&images[i])));
        assert_eq!(pairs, again.iter().map(|&(a, b)| (shuffled[a], shuffled[b])).collect::<Vec<_>>());
        assert_eq!(pairs.len(), 10);
    }
}
