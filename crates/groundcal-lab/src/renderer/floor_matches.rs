//! A few matches of floor points between two views of a [`Scene`], as a hand would pick them: exact places plus noise.
//!
//! ```text
//! b = H a,   H the homography of the floor (undistorted pixels);   both measured with normal errors of sigma_px
//! ```

use nalgebra::{Vector2, Vector3};
use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Mcg;

use crate::renderer::scene::{Scene, SceneError};
use groundcal::pairs::PointMatch;

/// Points tried for each match asked for: views that share less floor than a hundredth of the image give fewer matches.
const TRIES: usize = 100;
/// Border of the images in which nobody picks a point, as a fraction of the width.
const BORDER: f64 = 0.02;

/// `count` matches (undistorted pixels) of points of the floor spread at random over what views `a` and `b` share, with normal
/// errors of `sigma_px` in every coordinate; things on the floor hide none. Fewer where the views share too little. The same seed
/// gives the same matches.
///
/// # Errors
/// [`SceneError::NoSuchView`].
pub fn floor_matches(
    scene: &Scene,
    [a, b]: [usize; 2],
    count: usize,
    sigma_px: f64,
    seed: u64,
) -> Result<Vec<PointMatch>, SceneError> {
    let h = scene.h_b_from_a(a, b)?;
    let [width, height] = scene.camera.image_size.map(|n| n as f64);
    let border = BORDER * width;
    let inside = |p: &Vector2<f64>| {
        (border..width - 1.0 - border).contains(&p.x) && (border..height - 1.0 - border).contains(&p.y)
    };
    let pose = scene.pose(a)?;
    let from_pixel = pose.r_cam_from_world.transpose() * scene.camera.intrinsics().inverse_matrix();
    let mut rng = Pcg64Mcg::seed_from_u64(seed);
    let mut matches = Vec::with_capacity(count);
    for _ in 0..TRIES * count {
        if matches.len() == count {
            break;
        }
        let p = Vector2::new(rng.random_range(0.0..width), rng.random_range(0.0..height));
        let q = h * Vector3::new(p.x, p.y, 1.0);
        // Below the horizon of the first view and before the second.
        let on_floor = (from_pixel * Vector3::new(p.x, p.y, 1.0)).z < 0.0 && q.z > 0.0;
        let image = Vector2::new(q.x / q.z, q.y / q.z);
        if !(on_floor && inside(&p) && inside(&image)) {
            continue;
        }
        let mut error = || Vector2::from_fn(|_, _| sigma_px * Distribution::<f64>::sample(&StandardNormal, &mut rng));
        matches.push(PointMatch { a: p + error(), b: image + error(), sigma_px: 1.0 });
    }
    Ok(matches)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::renderer::scene::{Camera, Group, View};

    fn scene() -> Scene {
        let view = |file: &str, yaw_deg, centre_m| View {
            file: file.into(),
            yaw_deg,
            centre_m,
            pitch_error_deg: 0.0,
            roll_error_deg: 0.0,
            exposure: 1.0,
        };
        // Level views: half the image is sky.
        let views = vec![view("a.png", 0.0, [0.0, 0.0, 1.2]), view("b.png", 15.0, [0.2, 0.1, 1.2])];
        let group = Group { pitch_down_deg: 0.0, roll_deg: 5.0, views };
        Scene::new(Camera::centred([640, 480], 500.0), vec![group])
    }

    #[test]
    fn matches_are_of_the_floor_and_have_the_noise_asked_for() {
        let s = scene();
        let exact = floor_matches(&s, [0, 1], 40, 0.0, 3).unwrap();
        assert_eq!(exact.len(), 40);
        let h = s.h_b_from_a(0, 1).unwrap();
        for m in &exact {
            let q = h * Vector3::new(m.a.x, m.a.y, 1.0);
            assert!((Vector2::new(q.x / q.z, q.y / q.z) - m.b).norm() < 1e-9);
            assert!(m.a.y > 200.0, "{m:?} is above the horizon");
        }
        let noisy = floor_matches(&s, [0, 1], 2000, 0.7, 3).unwrap();
        // Errors of b against the place of the noisy a, small turns apart: nearly the noise of both.
        let squares: f64 = noisy
            .iter()
            .map(|m| {
                let q = h * Vector3::new(m.a.x, m.a.y, 1.0);
                (Vector2::new(q.x / q.z, q.y / q.z) - m.b).x.powi(2)
            })
            .sum();
        let sigma = (squares / 2.0 / noisy.len() as f64).sqrt();
        assert!((0.5..1.2).contains(&sigma), "{sigma}");
        assert_eq!(noisy, floor_matches(&s, [0, 1], 2000, 0.7, 3).unwrap());
    }

    #[test]
    fn views_that_share_nothing_give_none() {
        let mut s = scene();
        s.groups[0].views[1].yaw_deg = 180.0;
        assert!(floor_matches(&s, [0, 1], 8, 0.5, 0).unwrap().is_empty());
        assert!(floor_matches(&s, [0, 2], 8, 0.5, 0).is_err());
    }
}
