//! Attitudes, positions, horizons and floor distances of a calibration against truth: errors within their error bars.

use crate::calibrate::Options;
use crate::calibrate::calibrate_matches;
use crate::floor::view::FloorView;
use crate::geometry::lens::Lens;
use crate::observer::Silent;
use crate::pairs::correspondence::ImagePair;
use crate::result::calibration::Calibration;
use crate::result::views::ViewParameter;
use crate::synthetic::points::PointScene;
use nalgebra::{Matrix2, SMatrix, SVector, Vector2, Vector3};
use rayon::prelude::*;

fn names(count: usize) -> Vec<String> {
    (0..count).map(|i| i.to_string()).collect()
}

/// Three motions with 0.5 px of noise, and their calibration.
fn calibrated(seed: u64) -> (PointScene, Calibration) {
    let mut scene = PointScene::nominal(seed);
    scene.sigma_px = 0.5;
    let pairs: Vec<ImagePair> = scene.pairs();
    let options = Options { attitude_sigma_deg: Some(0.0), ..Options::default() };
    let c = calibrate_matches(&names(2 * pairs.len()), scene.size, &pairs, &options, &Silent).expect("a camera");
    (scene, c)
}

#[test]
fn poses_horizons_and_distances_are_within_their_error_bars() {
    const TRIALS: u64 = 80;
    let kinds = ["yaw", "x", "y", "horizon direction", "horizon offset", "group height", "distance", "homography"];
    let normalised: Vec<(usize, f64)> = (0..TRIALS)
        .into_par_iter()
        .flat_map_iter(|seed| {
            let (scene, c) = calibrated(seed);
            let mut errors = Vec::new();
            let centre = scene.size.centre_px();
            for (m, motion) in scene.motions.iter().enumerate() {
                let truth = motion.views();
                let unit = truth[0].centre.z;
                let of = |name: usize| c.views.iter().find(|v| v.image == name.to_string()).expect("a view");
                let second = of(2 * m + 1);
                let (position, sigma) = (second.position.expect("a floor"), second.position_sigma.expect("a floor"));
                let degrees = truth[1].yaw_rad.to_degrees();
                errors.push((0, (second.yaw_deg - degrees) / second.yaw_sigma_deg));
                let shift = (truth[1].centre - truth[0].centre) / unit;
                errors.push((1, (position[0] - shift.x) / sigma[0]));
                errors.push((2, (position[1] - shift.y) / sigma[1]));

                let attitude = &c.attitudes[second.attitude.expect("an attitude")];
                let up = crate::geometry::attitude::up_in_camera(motion.pitch_down_rad, motion.roll_rad);
                let line = scene.intrinsics.inverse_matrix().transpose() * up;
                let line = line / line.xy().norm();
                let [a, b, offset] = attitude.horizon_px.expect("finite");
                let turned = (line.x * b - line.y * a).atan2(line.x * a + line.y * b).to_degrees();
                errors.push((3, turned / attitude.horizon_sigma_deg.expect("refined")));
                let at = |l: &Vector3<f64>| l.dot(&Vector3::new(centre[0], centre[1], 1.0));
                let away = at(&Vector3::new(a, b, offset)) - at(&line);
                errors.push((4, away / attitude.horizon_sigma_px.expect("refined")));
                let (height, height_sigma) =
                    (attitude.height.expect("a floor"), attitude.height_sigma.expect("a floor"));
                errors.push((5, (height - 1.0) / height_sigma));

                // A distance on the floor between two pixels, as the homography and as the whole view say it.
                let exact = FloorView::new(&scene.intrinsics, Lens::None, &truth[1]).expect("over the floor");
                let view = FloorView::of_report(&c.camera, second).expect("over the floor");
                let pixels = [Vector2::new(250.0, 500.0), Vector2::new(1000.0, 800.0)];
                let points = pixels.map(|p| exact.floor_from_pixel(&p).expect("below the horizon"));
                let distance = (points[1] - points[0]).norm() / unit;
                let [p, q] = pixels.map(|p| view.floor_from_pixel(&p).expect("below the horizon"));
                let [jp, jq] = pixels.map(|p| view.floor_point_jacobian(&p).expect("below the horizon"));
                let along = (q - p).normalize().transpose() * (jq - jp);
                let sd = (along * second.covariance.of(&ViewParameter::ALL) * along.transpose())[(0, 0)].sqrt();
                errors.push((6, ((q - p).norm() - distance) / sd));

                let h = second.floor_from_image.as_ref().expect("over the floor");
                let covariance = SMatrix::<f64, 9, 9>::from_fn(|r, c| h.covariance[r][c]);
                let by_homography = |pixel: &Vector2<f64>| {
                    let x = pixel.push(1.0);
                    let w = Vector3::from_fn(|r, _| (0..3).map(|c| h.matrix[r][c] * x[c]).sum::<f64>());
                    let mut j = SMatrix::<f64, 2, 9>::zeros();
                    for k in 0..3 {
                        (j[(0, k)], j[(1, 3 + k)]) = (x[k] / w.z, x[k] / w.z);
                        (j[(0, 6 + k)], j[(1, 6 + k)]) = (-w.x * x[k] / (w.z * w.z), -w.y * x[k] / (w.z * w.z));
                    }
                    (w.xy() / w.z, j)
                };
                // The pixel that the camera found would have given without its lens; its part of the error is not in the bar.
                let ideal = |p: &Vector2<f64>| {
                    let ray = c.camera.model().unproject(p).expect("inside the fold");
                    c.camera.intrinsics().pixel_from_normalised(&(ray.xy() / ray.z))
                };
                let [(p, jp), (q, jq)] = [pixels[0], pixels[1]].map(|p| by_homography(&ideal(&p)));
                let along = (q - p).normalize().transpose() * (jq - jp);
                let sd = (along * covariance * along.transpose())[(0, 0)].sqrt();
                errors.push((7, ((q - p).norm() - distance) / sd));
            }
            errors
        })
        .collect();
    for (kind, name) in kinds.iter().enumerate() {
        let of_kind: Vec<f64> = normalised.iter().filter(|(k, _)| *k == kind).map(|(_, e)| e.abs()).collect();
        assert!(of_kind.len() > 200, "{name}");
        let n = of_kind.len() as f64;
        let held = of_kind.iter().filter(|e| **e < 1.96).count() as f64 / n;
        let rms = (of_kind.iter().map(|e| e * e).sum::<f64>() / n).sqrt();
        println!("{name}: {held:.3} of {n} within 95 %, rms {rms:.2}");
        // Three motions of a trial share their camera: the sampling error is that of trials more than of motions.
        assert!(held >= 0.90 && rms < 1.25, "{name}: {held} of {n}, rms {rms}");
    }
}

#[test]
fn a_camera_height_makes_lengths_metres() {
    let (_, c) = calibrated(1);
    let metres = c.clone().with_camera_height(1.6).expect("positive");
    let again = metres.clone().with_camera_height(3.2).expect("positive");
    assert_eq!((c.camera_height_m, again.camera_height_m), (None, Some(3.2)));
    let pixel = Vector2::new(640.0, 700.0);
    for ((a, b), twice) in c.views.iter().zip(&metres.views).zip(&again.views) {
        let point = |v| FloorView::of_report(&c.camera, v).expect("a floor").floor_from_pixel(&pixel).expect("below");
        assert!((point(a) * 1.6 - point(b)).norm() < 1e-9 && (point(a) * 3.2 - point(twice)).norm() < 1e-9);
        let (h, k) = (a.floor_from_image.as_ref().expect("a floor"), b.floor_from_image.as_ref().expect("a floor"));
        assert!((h.matrix[0][1] * 1.6 - k.matrix[0][1]).abs() < 1e-12 && h.matrix[2] == k.matrix[2]);
        assert!((h.covariance[0][8] * 1.6 - k.covariance[0][8]).abs() <= 1e-9 * h.covariance[0][8].abs());
        let relative = |v: &crate::result::ViewReport| {
            v.covariance.variance(ViewParameter::X).sqrt() / v.position.expect("a floor")[0]
        };
        assert!(a.position.expect("a floor")[0] == 0.0 || (relative(a) - relative(b)).abs() < 1e-9 * relative(a).abs());
    }
    assert!(c.with_camera_height(-1.0).expect_err("negative").to_string().contains("-1"));
}

#[test]
fn derivatives_of_floor_points_agree_with_a_step_along_all_numbers() {
    let (_, c) = calibrated(2);
    let view = FloorView::of_report(&c.camera, &c.views[1]).expect("a floor");
    let pixel = Vector2::new(300.0, 700.0);
    let by = view.floor_point_jacobian(&pixel).expect("below the horizon");
    // Scaling the world scales its points: x, y and height together.
    let place = |p: ViewParameter| ViewParameter::ALL.iter().position(|q| *q == p).expect("one of them");
    let scaled = by.fixed_columns::<3>(place(ViewParameter::X)) * view.centre();
    assert!((scaled - view.floor_from_pixel(&pixel).expect("below")).norm() < 1e-7);
    // Turning the world about the optical centre's foot by the yaw.
    let arm = view.floor_from_pixel(&pixel).expect("below") - view.foot();
    let turned = Matrix2::new(0.0, -1.0, 1.0, 0.0) * arm;
    assert!((by.column(place(ViewParameter::YawRad)) - turned).norm() < 1e-7);
    let moved: SVector<f64, 2> = by.column(place(ViewParameter::X)).into_owned();
    assert!((moved - Vector2::x()).norm() < 1e-7);
}
