//! Least squares matching of rendered pictures against the exact homography.

#![allow(clippy::expect_used)] // a test or benchmark may end in a panic

use groundcal::{
    Error,
    calibrate::{FeatureDensity, Options, Silent, calibrate_images, calibrate_matched_images},
    pairs::ImagePair,
    vision::{PatchMatch, PatchOptions, detect, match_features, match_patches, template_grid},
};
use groundcal_lab::renderer::{
    render::render_view,
    scene::{Camera, Group, Scene, TextureKind, View},
};
use nalgebra::{Matrix3, Vector2, Vector3};

/// A turn of 20 degrees over a floor that is blurred enough to be sampled without aliasing.
fn scene(texture: TextureKind) -> Scene {
    let view = |file: &str, yaw_deg: f64, x: f64| View {
        file: file.into(),
        yaw_deg,
        centre_m: [x, 0.0, 1.4],
        pitch_error_deg: 0.0,
        roll_error_deg: 0.0,
        exposure: 1.0,
    };
    let views = vec![view("a.png", 0.0, 0.0), view("b.png", 20.0, 0.2)];
    let mut scene =
        Scene::new(Camera::centred([640, 480], 560.0), vec![Group { pitch_down_deg: 50.0, roll_deg: 10.0, views }]);
    scene.floor.texture = texture;
    scene.sensor.blur_sigma_px = 0.7;
    scene
}

/// Errors against the truth of the patches found, from a prediction half a pixel off, and the patches.
fn errors(scene: &Scene) -> Vec<(Vector2<f64>, PatchMatch)> {
    let [a, b] = [0, 1].map(|i| render_view(scene, i).expect("a picture").to_gray());
    let h: Matrix3<f64> = scene.h_b_from_a(0, 1).expect("a homography");
    let apply = |p: &Vector2<f64>| {
        let q = h * Vector3::new(p.x, p.y, 1.0);
        Vector2::new(q.x / q.z, q.y / q.z)
    };
    let rough = |p: &Vector2<f64>| Some(apply(p) + Vector2::new(0.4, -0.3));
    let options = PatchOptions::default();
    let found = match_patches(&a, &template_grid(&a, &options), &b, &rough, &options);
    found.into_iter().map(|m| (m.b - apply(&m.a), m)).collect()
}

/// Mean error, and root mean square of either coordinate's.
fn bias_and_rms(errors: &[(Vector2<f64>, PatchMatch)]) -> (Vector2<f64>, f64) {
    let n = errors.len() as f64;
    let bias = errors.iter().map(|(e, _)| *e).sum::<Vector2<f64>>() / n;
    (bias, (errors.iter().map(|(e, _)| e.norm_squared()).sum::<f64>() / (2.0 * n)).sqrt())
}

fn report(name: &str, errors: &[(Vector2<f64>, PatchMatch)]) -> (Vector2<f64>, f64) {
    let (bias, rms) = bias_and_rms(errors);
    let predicted = errors.iter().map(|(_, m)| m.covariance.trace()).sum::<f64>() / (2.0 * errors.len() as f64);
    println!(
        "{name}: {} patches, bias ({:+.4}, {:+.4}) px, rms {rms:.4} px, predicted {:.4} px",
        errors.len(),
        bias.x,
        bias.y,
        predicted.sqrt()
    );
    (bias, rms)
}

#[test]
fn patches_of_rendered_floors_are_not_biased() {
    for texture in [TextureKind::Concrete, TextureKind::Terrazzo, TextureKind::Tiles] {
        let found = errors(&scene(texture));
        let (bias, rms) = report(&format!("{texture:?}"), &found);
        assert!(found.len() >= 150, "{texture:?}: {} patches", found.len());
        assert!(bias.amax() < 0.01, "{texture:?}: bias {bias}");
        assert!(rms < 0.06, "{texture:?}: {rms} px");
    }
}

#[test]
fn matches_that_are_there_already_give_the_same_calibration() {
    let scene = scene(TextureKind::Terrazzo);
    let images = [0, 1].map(|i| render_view(&scene, i).expect("a picture").to_gray());
    let names = ["a.png", "b.png"].map(String::from);
    let options = Options { feature_density: FeatureDensity::Dense, ..Options::default() };
    let features = images.each_ref().map(|i| detect(i, &options.features));
    let matches = match_features(&features[0], &features[1], &options.matching);
    let pair = ImagePair { from: 0, to: 1, matches };
    let expected = calibrate_images(&names, &images, &options, &Silent).expect("a calibration");
    let given = calibrate_matched_images(&names, &images, std::slice::from_ref(&pair), &options, &Silent);
    // What differs is far too long to be printed.
    assert!(given.expect("a calibration") == expected);
    // A pair of images that are not there.
    let wrong = ImagePair { to: 2, ..pair };
    assert!(matches!(
        calibrate_matched_images(&names, &images, &[wrong], &options, &Silent),
        Err(Error::InvalidInput(text)) if text.contains("(0, 2)")
    ));
}

#[test]
fn few_features_lead_to_patches_and_all_are_used_where_there_are_none() {
    let scene = scene(TextureKind::Terrazzo);
    let images = [0, 1].map(|i| render_view(&scene, i).expect("a picture").to_gray());
    let names = ["a.png", "b.png"].map(String::from);
    let calibrate = |feature_density: FeatureDensity, max_sigma_px: f64| {
        let mut options = Options { feature_density, ..Options::default() };
        options.patches.max_sigma_px = max_sigma_px;
        calibrate_images(&names, &images, &options, &Silent).expect("a calibration")
    };
    let usual = Options::default().patches.max_sigma_px;
    let [few, all] = [FeatureDensity::Auto, FeatureDensity::Dense].map(|density| calibrate(density, usual));
    assert!(few.motions[0].candidate_matches < all.motions[0].candidate_matches);
    assert!(few.evidence.pairs[0].matches.iter().any(|m| m.patch));
    // No texture is enough: the features carry the answer, and it is that of all of them.
    let [few, all] = [FeatureDensity::Auto, FeatureDensity::Dense].map(|density| calibrate(density, 1e-9));
    assert!(all.evidence.pairs[0].matches.iter().all(|m| !m.patch));
    assert!(few == all);
}
