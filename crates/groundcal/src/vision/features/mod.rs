//! Scale- and rotation-invariant features: extrema of the difference of Gaussians with gradient histograms
//! (Lowe, IJCV 2004), compared as square roots of L1-normalised histograms (RootSIFT, Arandjelović & Zisserman,
//! CVPR 2012).
//!
//! ```text
//! D(x, s) = G(x; k s) * I - G(x; s) * I,     k = 2^(1/3),     extrema over x and s, refined by a quadratic
//! ```
//!
//! Two things differ from the usual implementations. The first octave is upsampled so that pixel i lands on 2 i exactly:
//! plain resizing shifts every feature by a quarter of a pixel. And the contrast threshold is low, with the features
//! spread over the image by a grid: floors are faint, and the strongest responses are the things that stand on them.

mod descriptor;
mod feature;
mod matching;
mod scale_space;

pub(crate) use feature::DESCRIPTOR_LENGTH;
pub(crate) use feature::{FeatureOptions, Features};
pub(crate) use matching::MatchOptions;
#[cfg(test)]
pub(crate) use matching::match_features;
pub(crate) use matching::match_features_until;
pub(crate) use scale_space::{blur, halve};

use crate::{error::Error, observer::Observer, vision::image::GrayImage};

/// Detects and describes the features of an image. The same image gives the same features in the same order.
///
/// # Errors
/// [`Error::Stopped`] and no other.
pub(crate) fn detect_until(
    image: &GrayImage,
    options: &FeatureOptions,
    observer: &dyn Observer,
) -> Result<Features, Error> {
    let space = scale_space::ScaleSpace::new(image, options, observer)?;
    let mut extrema = space.extrema(options, observer)?;
    if image.mask().is_some() {
        extrema.retain(|e| is_used(image, e));
    }
    let extrema = spread(extrema, image, options.max_features);
    let mut features = Features::default();
    for extremum in &extrema {
        observer.go_on()?;
        // Several directions at one point may exceed the cap: the weakest go.
        if features.points.len() >= options.max_features {
            break;
        }
        descriptor::describe(&space, extremum, &mut features);
    }
    let keep = options.max_features.min(features.points.len());
    features.points.truncate(keep);
    features.descriptors.truncate(keep * DESCRIPTOR_LENGTH);
    Ok(features)
}

/// The same without an observer.
#[cfg(test)]
pub(crate) fn detect(image: &GrayImage, options: &FeatureOptions) -> Features {
    detect_until(image, options, &crate::observer::Silent).unwrap_or_default()
}

/// Whether the mask holds a feature's centre and most of what its descriptor covers.
fn is_used(image: &GrayImage, e: &scale_space::Extremum) -> bool {
    let (x, y) = (f64::from(e.x), f64::from(e.y));
    image.used_about(x, y, 0.0) > 0.5 && image.used_about(x, y, f64::from(descriptor::HALF_WIDTH * e.scale)) > 0.5
}

/// Cells along the longer side of the grid that spreads the features.
const GRID: usize = 12;

/// The strongest extrema of every cell of a grid, cell by cell in turn, until the cap.
fn spread(mut extrema: Vec<scale_space::Extremum>, image: &GrayImage, cap: usize) -> Vec<scale_space::Extremum> {
    extrema.sort_by(|a, b| {
        (b.response.total_cmp(&a.response))
            .then(a.y.total_cmp(&b.y))
            .then(a.x.total_cmp(&b.x))
            .then(a.scale.total_cmp(&b.scale))
    });
    let cell = (image.width().max(image.height()) as f32 / GRID as f32).max(1.0);
    let columns = (image.width() as f32 / cell).ceil() as usize + 1;
    let mut counts = vec![0usize; columns * ((image.height() as f32 / cell).ceil() as usize + 1)];
    let mut ranked: Vec<(usize, usize)> = extrema
        .iter()
        .enumerate()
        .map(|(i, e)| {
            let index = (e.y.max(0.0) / cell) as usize * columns + (e.x.max(0.0) / cell) as usize;
            let index = index.min(counts.len() - 1);
            counts[index] += 1;
            (counts[index], i)
        })
        .collect();
    ranked.sort_unstable();
    ranked.truncate(cap);
    // Strongest first again.
    ranked.sort_unstable_by_key(|&(_, i)| i);
    ranked.into_iter().map(|(_, i)| extrema[i]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::size::ImageSize;

    /// Gaussian blobs of known centres.
    fn blobs(centres: &[(f64, f64, f64)]) -> GrayImage {
        let size = ImageSize::new(200, 160);
        let value = |x: usize, y: usize| {
            centres
                .iter()
                .map(|(cx, cy, s)| {
                    let d = (x as f64 - cx).powi(2) + (y as f64 - cy).powi(2);
                    0.5 * (-d / (2.0 * s * s)).exp()
                })
                .sum::<f64>() as f32
        };
        let rows =
            (0..size.height).flat_map(|y| (0..size.width).map(move |x| (x, y))).map(|(x, y)| value(x, y)).collect();
        GrayImage::from_rows(size, rows).expect("right size")
    }

    #[test]
    fn blobs_are_found_where_they_are_without_a_shift() {
        let centres = [(50.3, 40.7, 2.0), (120.25, 60.5, 3.0), (80.0, 110.0, 5.0), (160.6, 120.1, 2.5)];
        let found = detect(&blobs(&centres), &FeatureOptions::default());
        for (x, y, s) in centres {
            let nearest = found
                .points
                .iter()
                .filter(|f| f64::from(f.scale_px) > 0.6 * s && f64::from(f.scale_px) < 1.6 * s)
                .map(|f| (f64::from(f.x) - x).hypot(f64::from(f.y) - y))
                .fold(f64::INFINITY, f64::min);
            assert!(nearest < 0.06, "blob at {x}, {y}: off by {nearest}");
        }
    }

    #[test]
    fn a_mask_leaves_the_rest_as_it_is() {
        use crate::vision::mask::Mask;
        let centres = [(50.3, 40.7, 2.0), (120.25, 60.5, 3.0), (80.0, 110.0, 5.0), (160.6, 120.1, 2.5)];
        let image = blobs(&centres);
        let all = detect(&image, &FeatureOptions::default());
        // The left half, and a narrow strip about the blob at the right, of whose patch most lies outside.
        let used: Vec<bool> = (0..200 * 160).map(|i| i % 200 < 100 || (155..165).contains(&(i % 200))).collect();
        let mask = Mask::new(image.size(), &used).expect("right size");
        let masked = detect(&image.masked(std::sync::Arc::new(mask)).expect("one size"), &FeatureOptions::default());
        assert!(!masked.points.is_empty() && masked.points.iter().all(|p| p.x < 100.0), "{:?}", masked.points);
        let left: Vec<_> = all.points.iter().filter(|p| p.x < 100.0).collect();
        assert!(all.points.len() > left.len() && masked.points.iter().all(|p| left.contains(&p)));
        assert!(masked.points.iter().any(|p| (p.x - 50.3).hypot(p.y - 40.7) < 0.1));
    }

    #[test]
    fn flat_tiny_and_thin_images_have_no_features_and_do_no_harm() {
        for (w, h) in [(1, 1), (2, 2), (3, 200), (64, 64), (500, 5)] {
            let found = detect(&GrayImage::filled(ImageSize::new(w, h), 0.5), &FeatureOptions::default());
            assert!(found.points.is_empty(), "{w}x{h}");
        }
    }

    #[test]
    fn a_turned_image_gives_the_same_features() {
        use rand::{RngExt, SeedableRng};
        let mut rng = rand_pcg::Pcg64Mcg::seed_from_u64(5);
        let size = ImageSize::new(200, 160);
        let white = (0..size.width * size.height).map(|_| rng.random_range(0.0..1.0)).collect();
        let white = GrayImage::from_rows(size, white).expect("right size");
        let mut upright = scale_space::blur(&white, 2.0);
        for v in upright.data_mut() {
            *v = 0.5 + 4.0 * (*v - 0.5);
        }
        // A quarter turn: (x, y) -> (h - 1 - y, x).
        let turned_size = ImageSize::new(size.height, size.width);
        let rows = (0..turned_size.height)
            .flat_map(|y| (0..turned_size.width).map(move |x| (x, y)))
            .map(|(x, y)| upright.get(y, size.height - 1 - x))
            .collect();
        let turned = GrayImage::from_rows(turned_size, rows).expect("right size");
        let (a, b) = (detect(&upright, &FeatureOptions::default()), detect(&turned, &FeatureOptions::default()));
        let matches = match_features(&a, &b, &MatchOptions::default());
        let good =
            matches.iter().filter(|m| (m.b.x - (size.height as f64 - 1.0 - m.a.y)).hypot(m.b.y - m.a.x) < 0.1).count();
        assert!(good >= 100 && good * 100 >= matches.len() * 97, "{good} of {}", matches.len());
    }
}
