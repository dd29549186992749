//! The laws that every lens obeys.

use nalgebra::{Vector2, Vector3};

use super::*;

/// Lenses of every model, weak and strong, with and without a fold.
fn lenses() -> Vec<Lens> {
    let radtan = [
        [0.0; 5],
        [-0.3, 0.09, 0.0, 0.0, 0.0],
        [0.1, -0.02, 0.0, 0.0, 0.0],
        [-0.2, 0.03, 1e-3, -2e-3, 0.0],
        [-0.3, 0.12, 1e-3, -5e-4, -0.02],
        [0.05, 0.0, -2e-3, 1e-3, 0.01],
        [-0.25, 0.05, 0.0, 0.0, 0.0],
        // Folds, and rises again.
        [-1.2, 0.5, 0.0, 0.0, 0.0],
        [-0.9, 0.6, 0.0, 0.0, -0.1],
    ];
    let fisheye = [
        [0.0; 4],
        [0.02, -0.01, 0.003, -0.0005],
        [-0.01, 0.0, 0.0, 0.0],
        [-0.1, 0.0, 0.0, 0.0],
        // Folds before 90 degrees, and rises again.
        [-0.6, 0.1, 0.0, 0.002],
        [0.3, 0.05, 0.02, 0.01],
    ];
    let mut all = vec![Lens::None];
    all.extend(radtan.map(|c| Lens::Radtan(Radtan::new(c))));
    all.extend([0.0, -0.3, -2.0, 0.05, 0.4].map(|l| Lens::Division(Division::new(l))));
    all.extend(fisheye.map(|c| Lens::Fisheye(Fisheye::new(c))));
    // A new model does not compile here until its lenses are above.
    let model = |lens: &Lens| match lens {
        Lens::None => 0,
        Lens::Radtan(_) => 1,
        Lens::Division(_) => 2,
        Lens::Fisheye(_) => 3,
    };
    let mut models: Vec<usize> = all.iter().map(model).collect();
    models.dedup();
    assert_eq!(models, [0, 1, 2, 3]);
    all
}

fn ray(angle: f64, around: f64) -> Vector3<f64> {
    Vector3::new(angle.sin() * around.cos(), angle.sin() * around.sin(), angle.cos())
}

/// Directions at parts of the largest angle: rays of unit length, the optical axis among them. The last is short of the fold by
/// little enough to be felt, by enough for rounding not to rule.
fn rays(lens: &Lens) -> Vec<Vector3<f64>> {
    // Where the perspective models end at 90 degrees, coordinates grow without bounds: up to 85 degrees.
    let end = lens.max_angle_rad();
    let end = if lens.max_radius().is_infinite() && !lens.sees_behind() { end.min(1.48) } else { 0.98 * end };
    let parts = (0..=40).flat_map(|i| (0..12).map(move |j| (f64::from(i) / 40.0, f64::from(j) * 0.55 + 0.1)));
    parts.map(|(part, around)| ray(part * end, around)).collect()
}

fn tangential(lens: &Lens) -> bool {
    lens.parameter("p1").is_some_and(|p| p != 0.0)
}

#[test]
fn rays_and_points_go_there_and_back() {
    for lens in lenses() {
        let mut count = 0;
        for ray in rays(&lens) {
            // The length of a ray says nothing.
            let Some(point) = lens.project(&(ray * 2.5)) else {
                assert!(tangential(&lens), "{lens:?} {ray}");
                continue;
            };
            count += 1;
            let back = lens.unproject(&point).unwrap_or_else(|| panic!("{lens:?} {ray}"));
            assert!((back.norm() - 1.0).abs() < 1e-14);
            assert!((back - ray).norm() < 1e-12, "{lens:?} {ray} {back}");
            let again = lens.project(&back).expect("inside");
            assert!((again - point).norm() < 1e-12 * (1.0 + point.norm()), "{lens:?} {point} {again}");
        }
        assert!(count > 480, "{lens:?}: {count}");
    }
}

#[test]
fn derivatives_agree_with_differences() {
    for lens in lenses() {
        for ray in rays(&lens) {
            let ray = ray * 1.3;
            let Some(p) = lens.project_with_jacobian(&ray) else { continue };
            assert_eq!(Some(p.point), lens.project(&ray));
            assert!(
                (p.by_ray * ray).norm() < 1e-10 * (1.0 + p.by_ray.norm()),
                "{lens:?}: along the ray nothing changes"
            );
            let h = 1e-6 * ray.z.abs().clamp(0.01, 1.0);
            for c in 0..3 {
                let mut step = Vector3::zeros();
                step[c] = h;
                let (Some(up), Some(down)) = (lens.project(&(ray + step)), lens.project(&(ray - step))) else {
                    continue;
                };
                let (difference, analytic) = ((up - down) / (2.0 * h), p.by_ray.column(c));
                assert!((difference - analytic).norm() < 1e-6 * (1.0 + p.by_ray.norm()), "{lens:?} {ray} {c}");
            }
            let parameters = lens.parameters();
            for i in 0..MAX_LENS_PARAMETERS {
                let analytic = p.by_parameters.column(i);
                if i >= parameters.len() {
                    assert_eq!(analytic.norm(), 0.0);
                    continue;
                }
                let at = |step: f64| {
                    let mut moved = parameters.clone();
                    moved[i] += step;
                    lens.with_parameters(&moved).and_then(|l| l.project(&ray))
                };
                let (Some(up), Some(down)) = (at(1e-6), at(-1e-6)) else { continue };
                let difference = (up - down) / 2e-6;
                assert!((difference - analytic).norm() < 1e-6 * (1.0 + analytic.norm()), "{lens:?} {ray} {i}");
            }
        }
    }
}

#[test]
fn the_radius_grows_up_to_the_largest_and_nothing_lies_beyond() {
    for lens in lenses() {
        let end = lens.max_angle_rad();
        let radius = |angle: f64| lens.project(&ray(angle, 0.7)).map(|p| p.norm());
        let mut last = -1.0;
        for i in 0..1000 {
            let Some(r) = radius(end * (1.0 - 1e-6) * f64::from(i) / 999.0) else {
                assert!(tangential(&lens), "{lens:?} {i}");
                break;
            };
            assert!(r > last && (tangential(&lens) || r <= lens.max_radius()), "{lens:?} {i}");
            last = r;
        }
        // From the fold to straight back.
        for i in 0..1000 {
            let angle = end * (1.0 + 1e-9) + (std::f64::consts::PI - end) * f64::from(i) / 999.0;
            if angle < std::f64::consts::PI {
                assert_eq!(radius(angle), None, "{lens:?} {angle}");
                assert_eq!(lens.project_with_jacobian(&ray(angle, 0.7)), None, "{lens:?} {angle}");
            }
        }
        if lens.max_radius().is_finite() && !tangential(&lens) {
            // At a fold the radius goes as the root of the distance in angle.
            assert!((radius(end * (1.0 - 1e-12)).expect("inside") / lens.max_radius() - 1.0).abs() < 1e-5, "{lens:?}");
            for beyond in [1.0 + 1e-9, 1.1, 3.0, 100.0] {
                let point = Vector2::new(0.6, 0.8) * lens.max_radius() * beyond;
                assert_eq!(lens.unproject(&point), None, "{lens:?} {beyond}");
            }
        }
    }
}

#[test]
fn a_second_branch_is_not_inside() {
    // The polynomial folds at 0.60 and rises again from 1.05 on.
    let twice = Radtan::new([-1.2, 0.5, 0.0, 0.0, 0.0]);
    assert!(twice.jacobian(&Vector2::new(1.4, 0.0)).determinant() > 0.0);
    for tangential in [0.0, 1e-3] {
        let lens = Lens::Radtan(Radtan::new([-1.2, 0.5, tangential, 0.0, 0.0]));
        assert_eq!(lens.project(&Vector3::new(1.4, 0.0, 1.0)), None);
        assert_eq!(lens.unproject(&twice.polynomial(&Vector2::new(1.4, 0.0))), None);
    }
    // Where the tangential part alone turns the map over within the radial radius.
    let bent = Radtan::new([0.0, 0.0, 0.3, 0.0, 0.0]);
    assert!(!bent.contains(&Vector2::new(0.0, -0.8)) && bent.contains(&Vector2::new(0.0, 0.8)));
}

#[test]
fn zero_coefficients_are_no_lens() {
    for lens in [Lens::radial(0.0, 0.0), Lens::Division(Division::new(0.0))] {
        assert!(lens.is_none());
        for ray in rays(&Lens::None) {
            let (a, b) = (lens.project(&ray).expect("in front"), Lens::None.project(&ray).expect("in front"));
            assert!((a - b).norm() < 1e-14 * (1.0 + b.norm()));
            assert!((lens.unproject(&b).expect("in front") - ray).norm() < 1e-14);
        }
        assert_eq!((lens.max_angle_rad(), lens.max_radius()), (Lens::None.max_angle_rad(), f64::INFINITY));
        assert_eq!(lens.project(&Vector3::new(1.0, 0.0, 0.0)), None);
    }
}

#[test]
fn parameters_come_back_under_their_names() {
    for lens in lenses() {
        let parameters = lens.parameters();
        assert_eq!(parameters.len(), lens.parameter_names().len());
        assert!(parameters.len() <= MAX_LENS_PARAMETERS);
        assert_eq!(lens.with_parameters(&parameters), Some(lens));
        assert_eq!(lens.with_parameters(&[&parameters[..], &[0.0]].concat()), None);
        for (name, value) in lens.parameter_names().iter().zip(&parameters) {
            assert_eq!(lens.parameter(name), Some(*value));
        }
        assert_eq!(lens.parameter("none"), None);
    }
}

#[test]
fn what_is_no_number_has_neither_point_nor_ray() {
    for lens in lenses() {
        for bad in [f64::NAN, f64::INFINITY] {
            let seen = lens.project(&Vector3::new(bad, 0.1, 1.0));
            assert!(seen.is_none_or(|p| !p.x.is_finite() || bad.is_infinite()), "{lens:?} {seen:?}");
            assert_eq!(lens.project(&Vector3::new(0.1, 0.1, f64::NAN)), None, "{lens:?}");
        }
        assert_eq!(lens.project(&Vector3::zeros()), None, "{lens:?}");
    }
}

/// Wide lenses see at and behind 90 degrees.
#[test]
fn wide_lenses_see_square_to_the_axis_and_behind() {
    let half_turn = std::f64::consts::FRAC_PI_2;
    let fisheye = Lens::Fisheye(Fisheye::default());
    assert!((fisheye.project(&Vector3::new(0.0, 2.0, 0.0)).expect("seen").y - half_turn).abs() < 1e-15);
    assert!((fisheye.project(&ray(2.5, 0.0)).expect("seen").x - 2.5).abs() < 1e-14);
    let division = Lens::Division(Division::new(-0.25));
    assert!((division.project(&Vector3::new(0.0, 2.0, 0.0)).expect("seen").y - 2.0).abs() < 1e-15);
    assert!(division.project(&ray(3.0, 0.0)).is_some() && division.project(&ray(std::f64::consts::PI, 0.0)).is_none());
    for lens in [fisheye, division] {
        assert!(lens.sees_behind());
        // On the axis, where directions have no sense, the limit of those beside it.
        let (on, beside) = (Vector3::new(0.0, 0.0, 2.0), Vector3::new(2e-9, 1e-9, 2.0));
        let (a, b) =
            (lens.project_with_jacobian(&on).expect("seen"), lens.project_with_jacobian(&beside).expect("seen"));
        assert!((a.by_ray - b.by_ray).norm() < 1e-8 && (a.point - b.point).norm() < 1e-8);
    }
    assert!(!Lens::None.sees_behind() && !Lens::radial(-0.1, 0.2).sees_behind());
}

#[test]
fn through_another_focal_length_a_pixel_keeps_its_ideal_pixel() {
    let (f, other) = (800.0, 500.0);
    for lens in lenses() {
        let Some(scaled) = lens.for_focal_length_times(other / f) else {
            assert!(matches!(lens, Lens::Fisheye(_)), "{lens:?}");
            continue;
        };
        assert_eq!(scaled.name(), lens.name());
        for pixel in [Vector2::new(30.0, 20.0), Vector2::new(-220.0, 90.0), Vector2::new(100.0, -310.0)] {
            let ideal = |lens: &Lens, f: f64| lens.undistort(&(pixel / f)).map(|p| p * f);
            match (ideal(&lens, f), ideal(&scaled, other)) {
                (Some(a), Some(b)) => assert!((a - b).norm() < 1e-9 * a.norm(), "{lens:?} {pixel} {a} {b}"),
                (a, b) => assert_eq!(a, b, "{lens:?} {pixel}"),
            }
        }
    }
}

#[test]
fn ideal_points_are_those_of_the_rays() {
    for lens in lenses() {
        for point in [Vector2::new(0.0, 0.0), Vector2::new(0.3, -0.2), Vector2::new(-0.1, 0.45)] {
            let Some(ray) = lens.unproject(&point) else { continue };
            let ideal = lens.undistort(&point);
            assert_eq!(ideal.is_some(), ray.z > 1e-9, "{lens:?} {point}");
            let Some(ideal) = ideal else { continue };
            assert!((ideal - ray.xy() / ray.z).norm() < 1e-12 * (1.0 + ideal.norm()));
            let back = lens.distort(&ideal).expect("inside");
            assert!((back - point).norm() < 1e-12 * (1.0 + ideal.norm()), "{lens:?} {point} {back}");
        }
    }
}
