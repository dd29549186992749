//! Least squares matching of rendered pictures against the exact homography.

#![allow(clippy::expect_used)] // a test or benchmark may end in a panic

use groundcal::{
    Error, FeatureDensity, Options, Silent, calibrate_images, calibrate_matched_images, match_images, pairs::ImagePair,
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

/// Errors against the truth of the patches that a calibration of the two pictures accepts.
fn errors(scene: &Scene) -> Vec<Vector2<f64>> {
    let images = [0, 1].map(|i| render_view(scene, i).expect("a picture").to_gray());
    let names = ["a.png", "b.png"].map(String::from);
    let c = calibrate_images(&names, &images, &Options::default(), &Silent).expect("a calibration");
    let pair = &c.evidence.pairs[0];
    let h: Matrix3<f64> = scene.h_b_from_a(pair.images[0], pair.images[1]).expect("a homography");
    let apply = |[x, y]: [f64; 2]| {
        let q = h * Vector3::new(x, y, 1.0);
        Vector2::new(q.x / q.z, q.y / q.z)
    };
    pair.matches.iter().filter(|m| m.patch && m.accepted).map(|m| Vector2::from(m.b) - apply(m.a)).collect()
}

/// Mean error, and root mean square of either coordinate's.
fn bias_and_rms(errors: &[Vector2<f64>]) -> (Vector2<f64>, f64) {
    let n = errors.len() as f64;
    (errors.iter().sum::<Vector2<f64>>() / n, (errors.iter().map(|e| e.norm_squared()).sum::<f64>() / (2.0 * n)).sqrt())
}

#[test]
fn patches_of_rendered_floors_are_not_biased() {
    for texture in [TextureKind::Concrete, TextureKind::Terrazzo, TextureKind::Tiles] {
        let found = errors(&scene(texture));
        let (bias, rms) = bias_and_rms(&found);
        println!("{texture:?}: {} patches, bias ({:+.4}, {:+.4}) px, rms {rms:.4} px", found.len(), bias.x, bias.y);
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
    let pair = match_images(&images, &[(0, 1)], &options, &Silent).expect("two pictures").remove(0);
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
        let options = Options { feature_density, max_patch_sigma_px: max_sigma_px, ..Options::default() };
        calibrate_images(&names, &images, &options, &Silent).expect("a calibration")
    };
    let usual = Options::default().max_patch_sigma_px;
    let [few, all] = [FeatureDensity::Auto, FeatureDensity::Dense].map(|density| calibrate(density, usual));
    assert!(few.motions[0].candidate_matches < all.motions[0].candidate_matches);
    assert!(few.evidence.pairs[0].matches.iter().any(|m| m.patch));
    // No texture is enough: the features carry the answer, and it is that of all of them.
    let [few, all] = [FeatureDensity::Auto, FeatureDensity::Dense].map(|density| calibrate(density, 1e-9));
    assert!(all.evidence.pairs[0].matches.iter().all(|m| !m.patch));
    assert!(few == all);
}
