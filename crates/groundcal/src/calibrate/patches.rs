//! The motions' floor matched again patch by patch (see [`crate::vision::patches`]).

use nalgebra::Vector2;
use rayon::prelude::*;

use crate::calibrate::{Pipeline, Stage, evidence::Superseded, pairs::PairResult};
use crate::{
    pairs::{
        correspondence::{ImagePair, PointMatch},
        plane_lens::Lens,
    },
    vision::{
        image::GrayImage,
        patches::{match_patches, template_grid},
    },
};

/// Fewest patches that replace feature matches.
const MIN_PATCHES: usize = 30;
/// Distance from the border, in half sides of a patch, within which a patch may be found missing because part of it is outside.
const LOST_MARGIN: f64 = 2.5;

impl Pipeline<'_> {
    /// Replaces the matches of the pairs `used` by patches matched by least squares and fits the homographies to them. A
    /// pair whose floor has too little texture, or whose patches contradict its features, keeps what it had.
    pub(super) fn sharpen(
        &self,
        mut pairs: Vec<ImagePair>,
        mut results: Vec<PairResult>,
        used: &[usize],
        lens: Option<&Lens>,
    ) -> (Vec<ImagePair>, Vec<PairResult>) {
        let Some(images) = self.images else { return (pairs, results) };
        if !self.options.match_patches {
            return (pairs, results);
        }
        self.observer.begin(Stage::Patches, used.len());
        let needed: std::collections::BTreeSet<usize> = used.iter().map(|&i| pairs[i].from).collect();
        // Templates belong to their image: all its pairs share them.
        let grids: std::collections::BTreeMap<usize, Vec<(usize, usize)>> =
            needed.into_par_iter().map(|i| (i, template_grid(&images[i], &self.options.patches))).collect();
        let better: Vec<(usize, ImagePair, PairResult)> = used
            .par_iter()
            .filter_map(|&i| {
                let found = self.sharpened(&pairs[i], &results[i], images, &grids, lens);
                self.observer.advance(Stage::Patches);
                found.map(|(pair, result)| (i, pair, result))
            })
            .collect();
        for (i, pair, result) in better {
            pairs[i] = pair;
            results[i] = result;
        }
        (pairs, results)
    }

    fn sharpened(
        &self,
        pair: &ImagePair,
        result: &PairResult,
        images: &[GrayImage],
        grids: &std::collections::BTreeMap<usize, Vec<(usize, usize)>>,
        lens: Option<&Lens>,
    ) -> Option<(ImagePair, PairResult)> {
        let (robust, geometry) = result.outcome.as_ref().ok()?;
        let h = robust.estimate.h_b_from_a;
        let map = |p: &Vector2<f64>| match lens {
            None => h.apply(p),
            Some(lens) => lens.real_point(&h.apply(&lens.ideal_point(p)?)?),
        };
        let options = &self.options.patches;
        let patches = match_patches(&images[pair.from], grids.get(&pair.from)?, &images[pair.to], &map, options);
        let matches: Vec<PointMatch> = patches.iter().map(|m| m.to_point_match(options.model_sigma_px)).collect();
        if matches.len() < MIN_PATCHES {
            return None;
        }
        let found: std::collections::HashSet<_> = patches.iter().map(|m| (m.a.x as usize, m.a.y as usize)).collect();
        // Only where all of the patch should be seen.
        let (size, margin) = (images[pair.to].size(), options.radius_px as f64 * LOST_MARGIN);
        let seen_in_b = |p: &Vector2<f64>| {
            p.x > margin && p.y > margin && p.x < size.width as f64 - margin && p.y < size.height as f64 - margin
        };
        let lost = grids
            .get(&pair.from)?
            .iter()
            .filter(|place| !found.contains(place))
            .map(|&(x, y)| Vector2::new(x as f64, y as f64))
            .filter(|a| map(a).is_some_and(|b| seen_in_b(&b)))
            .map(|a| a.into())
            .collect();
        let sharp = ImagePair { matches, ..pair.clone() };
        let mut next = self.homography_with(&sharp, lens, self.robust_options(true));
        let (found, sharp_geometry) = next.outcome.as_mut().ok()?;
        // The patches were sought where the features said: they may refine that, not turn it into something else.
        let turned = (sharp_geometry.rotation_rad - geometry.rotation_rad).abs();
        if found.inliers.len() < MIN_PATCHES || turned > 0.1 {
            return None;
        }
        (found.patches, found.static_background) = (true, robust.static_background);
        next.candidates = result.candidates;
        next.superseded = Some(Box::new(Superseded::new(pair, robust, lost)));
        Some((sharp, next))
    }
}
